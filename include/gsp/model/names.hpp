#pragma once
#include <algorithm>
#include <gsp/core/check.hpp>
#include <gsp/model/compiled.hpp>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

/// Indices by name: body_id(compiled, "torso"). Each throws Error where there is no such name, with the nearest ones. Host, a search
/// through all names.
namespace gsp {

namespace detail {
/// Least number of insertions, deletions and replacements that make one word of the other.
inline int edits(std::string_view a, std::string_view b) {
  std::vector<int> row(b.size() + 1);
  for (std::size_t j = 0; j < row.size(); ++j) row[j] = int(j);
  for (std::size_t i = 1; i <= a.size(); ++i) {
    int diagonal = row[0];
    row[0] = int(i);
    for (std::size_t j = 1; j <= b.size(); ++j) {
      int const replaced = diagonal + (a[i - 1] != b[j - 1]);
      diagonal = row[j];
      row[j] = std::min({row[j] + 1, row[j - 1] + 1, replaced});
    }
  }
  return row.back();
}

/// name_of(i) of the n things of a kind; what: "body".
template <class NameOf>
int id_by_name(char const* what, int n, NameOf const& name_of, std::string_view name) {
  struct Near {
    bool apart;  // neither is a part of the other
    int edits;
    std::string name;
  };
  std::vector<Near> near;
  for (int i = 0; i < n; ++i) {
    std::string const& other = name_of(i);
    if (other == name && !name.empty()) return i;
    if (other.empty()) continue;
    bool const part = !name.empty() && (other.find(name) != other.npos || name.find(other) != name.npos);
    near.push_back({!part, edits(name, other), other});
  }
  std::string text = "gsp::" + std::string(what) + "_id: the model has no " + what + " '" + std::string(name) + "'";
  if (near.empty()) throw Error(text + ": none of its " + std::to_string(n) + " has a name; give an index");
  std::size_t const count = std::min<std::size_t>(3, near.size());
  std::stable_sort(near.begin(), near.end(), [](Near const& a, Near const& b) { return a.apart != b.apart ? b.apart : a.edits < b.edits; });
  text += "; nearest:";
  for (std::size_t k = 0; k < count; ++k) text += (k ? ", '" : " '") + near[k].name + "'";
  throw Error(text);
}
template <class Names>
int id_in(char const* what, Names const& names, std::string_view name) {
  return id_by_name(
      what, int(names.size()), [&](int i) -> std::string const& { return names[i]; }, name);
}
}  // namespace detail

inline int body_id(CompiledModel const& m, std::string_view name) { return detail::id_in("body", m.body_name, name); }
inline int joint_id(CompiledModel const& m, std::string_view name) { return detail::id_in("joint", m.jnt_name, name); }
inline int geom_id(CompiledModel const& m, std::string_view name) { return detail::id_in("geom", m.geom_name, name); }
inline int site_id(CompiledModel const& m, std::string_view name) { return detail::id_in("site", m.site_name, name); }
inline int camera_id(CompiledModel const& m, std::string_view name) { return detail::id_in("camera", m.cam_name, name); }
inline int mesh_id(CompiledModel const& m, std::string_view name) { return detail::id_in("mesh", m.mesh_name, name); }
inline int tendon_id(CompiledModel const& m, std::string_view name) { return detail::id_in("tendon", m.tendon_name, name); }
inline int actuator_id(CompiledModel const& m, std::string_view name) { return detail::id_in("actuator", m.act_name, name); }
inline int equality_id(CompiledModel const& m, std::string_view name) { return detail::id_in("equality", m.eq_name, name); }
/// Of sensors and their numbers: compiled.sensor_adr[sensor_id(compiled, "imu")].
inline int sensor_id(CompiledModel const& m, std::string_view name) {
  return detail::id_by_name(
      "sensor", m.nsensor, [&](int i) -> std::string const& { return m.sensors[i].name; }, name);
}
inline int keyframe_id(CompiledModel const& m, std::string_view name) {
  return detail::id_by_name(
      "keyframe", int(m.keyframes.size()), [&](int i) -> std::string const& { return m.keyframes[i].name; }, name);
}

}  // namespace gsp
