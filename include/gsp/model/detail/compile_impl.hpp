#pragma once
#include <algorithm>
#include <cmath>
#include <gsp/core/check.hpp>
#include <gsp/core/detail/compiled.hpp>
#include <gsp/geometry/shape_pairs.hpp>
#include <gsp/model/compile.hpp>
#include <gsp/model/compiled.hpp>
#include <gsp/model/detail/compile_constants.hpp>
#include <gsp/model/detail/leave_out.hpp>
#include <gsp/model/detail/meeting_geoms.hpp>
#include <gsp/model/detail/model_notes.hpp>
#include <set>
#include <string>
#include <utility>
#include <vector>

namespace gsp {

namespace detail {

class Compiler : public ConstantsCompiler {
 public:
  explicit Compiler(Description const& d, CompileOptions options = {}) : ConstantsCompiler(d), options_(options) {}
  CompiledModel run() {
    masses_only();
    align_free_bodies();
    tendons();
    actuators();
    equalities();
    sensors();
    constants();
    length_ranges();
    named_pairs();
    pairs();
    keyframes();
    ModelNotes(d_, m_).write();
    return std::move(m_);
  }
  /// Bodies, joints, shapes and masses, before anything that depends on the initial pose.
  CompiledModel bodies_only() {
    masses_only();
    return std::move(m_);
  }

 private:
  void masses_only() {
    m_.name = d_.name;
    m_.option = d_.option;
    m_.report = d_.report;
    check_numbers();
    assets();
    bodies();
    trees();
    masses();
  }

  // Two geoms that may touch in any case, by their own numbers: nothing is mixed from the geoms. The geom of the earlier body comes first.
  void named_pairs() {
    for (std::size_t i = 0; i < d_.pairs.size(); ++i) {
      auto const& p = d_.pairs[i];
      enter(Kind::pair, p.name, int(i), p.place);
      int a = find(Kind::geom, p.geom1, p.place, "pair", p.name), b = find(Kind::geom, p.geom2, p.place, "pair", p.name);
      if (a == b) fail(p.place, "pair", p.name, "names one geom twice: name two");
      if (m_.geom_body[a] > m_.geom_body[b]) std::swap(a, b);
      CompiledModel::NamedPair pair{};
      pair.geom1 = a;
      pair.geom2 = b;
      pair.condim = p.condim.value_or(3);
      if (pair.condim != 1 && pair.condim != 3 && pair.condim != 4 && pair.condim != 6)
        fail(p.place, "pair", p.name, "has a condim other than 1, 3, 4, 6: choose one of them");
      SoftnessDescription const standard;
      pair.friction = p.friction.value_or(std::array{1., 1., 0.005, 0.0001, 0.0001});
      pair.solref = p.solref.value_or(standard.solref);
      pair.solimp = p.solimp.value_or(standard.solimp);
      pair.solreffriction = p.solreffriction.value_or(std::array{0., 0.});
      pair.margin = p.margin.value_or(0);
      pair.gap = p.gap.value_or(0);
      pair.adhesion = p.adhesion.value_or(0);
      pair.rigid = p.rigid;
      rigid(p.rigid, p.place, "pair", p.name);
      require_finite(finite(pair.friction) && finite(pair.solref) && finite(pair.solimp) && finite(pair.solreffriction) &&
                         std::isfinite(pair.margin) && std::isfinite(pair.gap) && std::isfinite(pair.adhesion),
                     p.place, "pair", p.name);
      for (double f : pair.friction)
        if (f < 0) fail(p.place, "pair", p.name, "has a negative friction: give zero or more");
      named_.emplace(std::min(a, b), std::max(a, b));
      ShapeType const type_a{m_.geom_type[a]};
      ShapeType const type_b{m_.geom_type[b]};
      if (!can_collide(type_a, type_b)) continue;
      m_.named_pairs.push_back(pair);
    }
  }

  // Two geoms may touch when a bit of contype meets one of conaffinity and their bodies are not welded together, not parent and child
  // (unless one is the world), and not excluded; two that are a named pair are none here. Of more than can be listed, those of planes and
  // height fields are, which have no box to speak of.
  void pairs() {
    excluded_.resize(std::size_t(m_.nbody));
    for (auto const& e : d_.excludes) {
      int const a = find(Kind::body, e.body1, e.place, "exclude", ""), b = find(Kind::body, e.body2, e.place, "exclude", "");
      excluded_[std::size_t(a)].push_back(b);
      excluded_[std::size_t(b)].push_back(a);
      m_.excluded_bodies.push_back({a, b});
    }
    MeetingGeoms const meeting(m_);
    std::vector<int> others;
    for (int const a : meeting.colliding()) {
      meeting.find_later(a, others);
      for (int const b : others)
        if (may_touch(a, b)) add_pair(a, b);
      m_.pairs_searched = int(m_.pairs.size()) > options_.listed_pairs;
      if (m_.pairs_searched) break;
    }
    if (!m_.pairs_searched) return;
    m_.pairs.clear();
    auto const wide = [&](int g) { return is_wide(ShapeType(m_.geom_type[g])); };
    for (int const a : meeting.colliding()) {
      if (!wide(a)) continue;
      meeting.find_later(-1, a, others);
      for (int const b : others)
        if ((b > a || !wide(b)) && may_touch(a, b)) add_pair(std::min(a, b), std::max(a, b));
      if (m_.pairs.size() > 50'000'000)
        throw Error(at({}) +
                    "more than 50 million pairs of a plane or height field with another geom can meet: keep geoms apart with "
                    "contype and conaffinity");
    }
  }
  /// By all filters but that of their bits.
  bool may_touch(int a, int b) const {
    int const body_a = m_.geom_body[a], body_b = m_.geom_body[b], weld_a = m_.body_weld[body_a], weld_b = m_.body_weld[body_b];
    if (d_.option.filterparent && weld_a != 0 && weld_b != 0 &&
        (weld_a == m_.body_weld[m_.body_parent[weld_b]] || weld_b == m_.body_weld[m_.body_parent[weld_a]]))
      return false;
    auto const& not_with = excluded_[std::size_t(body_a)];
    if (std::find(not_with.begin(), not_with.end(), body_b) != not_with.end()) return false;
    if (!named_.empty() && named_.count(std::minmax(a, b))) return false;
    return can_collide(ShapeType(m_.geom_type[a]), ShapeType(m_.geom_type[b]));
  }
  void add_pair(int a, int b) { m_.pairs.push_back(m_.geom_type[a] <= m_.geom_type[b] ? std::array{a, b} : std::array{b, a}); }

  void keyframes() {
    std::vector<double> mpos, mquat;
    for (int b = 0; b < m_.nbody; ++b) {
      if (m_.body_mocap[b] < 0) continue;
      mpos.insert(mpos.end(), m_.body_pos[b].begin(), m_.body_pos[b].end());
      mquat.insert(mquat.end(), m_.body_quat[b].begin(), m_.body_quat[b].end());
    }
    std::set<std::string> names;
    for (auto key : d_.keyframes) {
      if (!key.name.empty() && !names.insert(key.name).second)
        fail(key.place, "key", key.name, "has a name that is taken already: rename one of the two");
      auto const fill = [&](std::vector<double>& v, std::vector<double> const& initial, char const* attribute) {
        if (v.empty()) v = initial;
        if (v.size() != initial.size())
          fail(key.place, "key", key.name,
               std::string("has ") + std::to_string(v.size()) + " numbers in " + attribute + ", and the model needs " +
                   std::to_string(initial.size()) + ": correct the list");
        require_finite(finite(v), key.place, "key", key.name);
      };
      fill(key.qpos, m_.qpos0, "qpos");
      fill(key.qvel, std::vector<double>(std::size_t(m_.nv), 0.), "qvel");
      fill(key.act, std::vector<double>(std::size_t(m_.na), 0.), "act");
      fill(key.ctrl, std::vector<double>(std::size_t(m_.nu), 0.), "ctrl");
      fill(key.mpos, mpos, "mpos");
      fill(key.mquat, mquat, "mquat");
      auto const normalize = [&](double* q) {
        auto const n = unit({q[0], q[1], q[2], q[3]});
        std::copy(n.begin(), n.end(), q);
      };
      for (int j = 0; j < m_.njnt; ++j)
        if (m_.jnt_type[j] <= int(JointType::ball)) normalize(&key.qpos[m_.jnt_qposadr[j] + (m_.jnt_type[j] == 0 ? 3 : 0)]);
      for (int i = 0; i < m_.nmocap; ++i) normalize(&key.mquat[4 * i]);
      m_.keyframes.push_back(std::move(key));
    }
  }

  CompileOptions options_;
  std::vector<std::vector<int>> excluded_;  // of bodies: with which, both ways
  std::set<std::pair<int, int>> named_;     // geoms of named pairs, the smaller index first: no ordinary pairs
};

}  // namespace detail

GSP_INLINE CompiledModel compile(Description const& description, CompileOptions options) {
  if (!description.compiler.discard_visual && !description.compiler.fuse_static) return detail::Compiler(description, options).run();
  auto const smaller = detail::left_out(description, [&](Description const& d) { return detail::Compiler(d).bodies_only(); });
  return detail::Compiler(smaller, options).run();
}

}  // namespace gsp
