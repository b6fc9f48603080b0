#pragma once
#include <array>
#include <concepts>
#include <gsp/model/description.hpp>
#include <set>
#include <string>
#include <string_view>
#include <type_traits>

/// Which entries of a description name which others, so that replicating, attaching and leaving out can follow the names.
namespace gsp::detail {

enum class Kind : int { none, body, joint, geom, site, camera, tendon, actuator, mesh, equality, sensor, pair, count };

/// MJCF's word for a kind of object (xbody and subtree: bodies).
inline Kind kind_of(std::string_view word) {
  if (word == "body" || word == "xbody" || word == "subtree") return Kind::body;
  if (word == "joint") return Kind::joint;
  if (word == "geom") return Kind::geom;
  if (word == "site") return Kind::site;
  if (word == "camera") return Kind::camera;
  if (word == "tendon") return Kind::tendon;
  if (word == "actuator") return Kind::actuator;
  if (word == "mesh") return Kind::mesh;
  return Kind::none;
}

/// The world's name is one in all models: copies and attached models keep it.
inline bool is_world(Kind kind, std::string_view name) { return kind == Kind::body && name == "world"; }

/// Calls f(kind, name) for every name that the entry holds (not its own); T may be const. Empty names are left out.
template <class T, class F>
requires std::same_as<std::remove_const_t<T>, TendonDescription>
void for_each_reference(T& t, F const& f) {
  for (auto& term : t.terms) f(Kind::joint, term.joint);
  for (auto& item : t.path) {
    if (item.type == WrapType::pulley) continue;
    f(item.type == WrapType::site ? Kind::site : Kind::geom, item.name);
    if (!item.sidesite.empty()) f(Kind::site, item.sidesite);
  }
}
template <class T, class F>
requires std::same_as<std::remove_const_t<T>, ActuatorDescription>
void for_each_reference(T& a, F const& f) {
  constexpr std::array kinds{Kind::joint, Kind::joint, Kind::site, Kind::tendon, Kind::site, Kind::body};
  f(kinds[std::size_t(a.target)], a.target_name);
  if (!a.reference_name.empty()) f(Kind::site, a.reference_name);
}
template <class T, class F>
requires std::same_as<std::remove_const_t<T>, EqualityDescription>
void for_each_reference(T& e, F const& f) {
  Kind const kind = e.type == EqualityType::joint    ? Kind::joint
                    : e.type == EqualityType::tendon ? Kind::tendon
                    : e.sites                        ? Kind::site
                                                     : Kind::body;
  f(kind, e.name1);
  if (!e.name2.empty()) f(kind, e.name2);
}
template <class T, class F>
requires std::same_as<std::remove_const_t<T>, SensorDescription>
void for_each_reference(T& s, F const& f) {
  if (!s.object.empty()) f(kind_of(s.object_type), s.object);
  if (!s.reference.empty()) f(kind_of(s.reference_type), s.reference);
}
template <class T, class F>
requires std::same_as<std::remove_const_t<T>, PairDescription>
void for_each_reference(T& p, F const& f) {
  f(Kind::geom, p.geom1);
  f(Kind::geom, p.geom2);
}
template <class T, class F>
requires std::same_as<std::remove_const_t<T>, ExcludeDescription>
void for_each_reference(T& e, F const& f) {
  f(Kind::body, e.body1);
  f(Kind::body, e.body2);
}
/// The entry's own name and kind; excludes have none.
inline Kind own_kind(TendonDescription const&) { return Kind::tendon; }
inline Kind own_kind(ActuatorDescription const&) { return Kind::actuator; }
inline Kind own_kind(EqualityDescription const&) { return Kind::equality; }
inline Kind own_kind(SensorDescription const&) { return Kind::sensor; }
inline Kind own_kind(PairDescription const&) { return Kind::pair; }
inline Kind own_kind(ExcludeDescription const&) { return Kind::none; }
template <class T>
std::string* own_name(T& entry) {
  if constexpr (requires { entry.name; })
    return &entry.name;
  else
    return nullptr;
}

/// A set of names by kind.
struct NameSet {
  std::array<std::set<std::string, std::less<>>, std::size_t(Kind::count)> of;
  void add(Kind kind, std::string const& name) {
    if (!name.empty()) of[std::size_t(kind)].insert(name);
  }
  bool has(Kind kind, std::string const& name) const { return of[std::size_t(kind)].contains(name); }
};

}  // namespace gsp::detail
