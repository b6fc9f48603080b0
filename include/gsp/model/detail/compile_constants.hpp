#pragma once
#include <gsp/model/detail/compile_forces.hpp>
#include <gsp/model/detail/initial_inertia.hpp>
#include <gsp/model/detail/initial_pose.hpp>
#include <gsp/model/detail/length_range.hpp>
#include <gsp/model/detail/slider.hpp>
#include <string>
#include <utility>
#include <vector>

namespace gsp::detail {

/// What follows from the mass matrix and the poses in qpos0, as mj_setConst finds it: inverse weights, dof_M0, acc0, lengths, data of
/// equality constraints, where cameras stand.
class ConstantsCompiler : public ForceCompiler {
 protected:
  using ForceCompiler::ForceCompiler;

  void constants() {
    InitialPose const pose(m_, m_.qpos0);
    std::vector<LengthAndRow> ropes;
    std::vector<std::pair<double, SparseRow>> heavy;
    for (int t = 0; t < m_.ntendon; ++t) {
      ropes.push_back(pose.tendon(t));
      double const armature = m_.tendon_armature[t] + (drives_armature() ? actuator_armature(m_, true, t) : 0);
      if (armature != 0) heavy.emplace_back(armature, ropes.back().row);
      m_.tendon_length0.push_back(ropes.back().length);
    }
    lengths_of_springs();
    auto armature = m_.dof_armature;
    if (drives_armature())
      for (int d = 0; d < m_.nv; ++d) armature[d] += actuator_armature(m_, false, m_.dof_jnt[d]);
    std::vector<InitialInertia> inertia;
    inertia.reserve(std::size_t(m_.ntree));
    for (int t = 0; t < m_.ntree; ++t) {
      if (m_.tree_dofnum[t] > 3000)
        fail(d_.bodies[m_.tree_bodyadr[t]].place, "body", m_.body_name[m_.tree_bodyadr[t]],
             "carries a tree of " + std::to_string(m_.tree_dofnum[t]) + " degrees of freedom, and at most 3000 are supported: split it");
      inertia.emplace_back(m_, pose, t, armature, heavy);
      for (int d : inertia.back().singular()) note_singular(d);
      m_.dof_M0.insert(m_.dof_M0.end(), inertia.back().diagonal().begin(), inertia.back().diagonal().end());
    }
    inverse_weights(pose, inertia);
    for (auto const& rope : ropes) m_.tendon_invweight0.push_back(inverse_weight(rope.row, inertia));
    springs_from_inertia();
    for (int a = 0; a < m_.nu; ++a) {
      auto const arm = pose.actuator(a);
      m_.act_length0.push_back(arm.length);
      m_.act_acc0.push_back(acceleration(arm.row, inertia));
      damping_ratio(a, arm.row, inertia);
    }
    equality_data(pose);
    for (int c = 0; c < m_.ncam; ++c) {
      Pose const x = pose.camera(c);
      int const b = m_.cam_body[c], target = m_.cam_target[c];
      m_.cam_pos0.push_back(x.p - pose.body(b).p);
      m_.cam_poscom0.push_back(x.p - pose.subtree_com(target >= 0 ? target : b));
      Double3 const axes[] = {rotate(x.q, {1, 0, 0}), rotate(x.q, {0, 1, 0}), rotate(x.q, {0, 0, 1})};
      auto& rows = m_.cam_mat0.emplace_back();
      for (std::size_t i = 0; i < 9; ++i) rows[i] = axes[i % 3][i / 3];
    }
  }

  /// Ranges of the lengths of actuators that are neither given nor limits, by pulling each to both ends.
  void length_ranges() {
    if (unknown_ranges_.empty()) return;
    auto const& options = d_.compiler.length_range;
    PulledModel model(m_, options);
    for (int a : unknown_ranges_) {
      auto const refuse = [&](std::string const& why) {
        fail(d_.actuators[std::size_t(a)].place, "actuator", m_.act_name[a],
             "needs the range of its length, and the simulation that pulls it to both ends " + why +
                 ": give lengthrange, limits to what it moves, or other numbers in <compiler> <lengthrange>");
      };
      if (!(options.total <= 1e6 * model.timestep())) refuse("takes more than a million steps");
      auto const shortest = model.pull(a, -1);
      auto const longest = shortest ? model.pull(a, 1) : shortest;
      if (!longest) refuse("is unstable");
      std::array const range{shortest->at(0), longest->at(1)};
      double const width = range[1] - range[0];
      auto const text = [](std::array<double, 2> const& ends) { return std::to_string(ends[0]) + " .. " + std::to_string(ends[1]); };
      if (!(width > 0)) refuse("finds no range (" + text(range) + ")");
      for (auto const& ends : {*shortest, *longest})
        if (ends[1] - ends[0] > options.tolerance * width)
          refuse("does not settle (the length goes on changing, " + text(ends) + ", in a range of " + text(range) + ")");
      m_.act_lengthrange[a] = range;
    }
  }

 private:
  void note_singular(int dof) {
    int const j = m_.dof_jnt[dof], b = m_.jnt_body[j];
    auto const& place = d_.bodies[b].joints[std::size_t(j - m_.body_jntadr[b])].place;
    m_.report.push_back(
        {ReportLine::Kind::approximated, place.file >= 0 ? d_.files[std::size_t(place.file)] : d_.name, place.line,
         "joint '" + m_.jnt_name[j] +
             "': the mass matrix is singular in the initial pose, as nothing with mass resists this joint or it repeats others of its "
             "body; a pivot is taken as 1e-15",
         1});
  }
  bool drives_armature() const {
    return std::any_of(m_.act_armature.begin(), m_.act_armature.end(), [](double x) { return x != 0; });
  }
  // Where a tendon's spring rests at the length that it has in qpos_spring.
  void lengths_of_springs() {
    std::optional<InitialPose> rest;
    for (int t = 0; t < m_.ntendon; ++t) {
      auto& spring = m_.tendon_lengthspring[t];
      if (spring[0] != -1 || spring[1] != -1) continue;
      if (!rest) rest.emplace(m_, m_.qpos_spring);
      spring[0] = spring[1] = rest->tendon(t).length;
    }
  }
  // A row's part in one tree, dense.
  std::vector<double> part(SparseRow const& row, int tree) const {
    std::vector<double> a(std::size_t(m_.tree_dofnum[tree]), 0.);
    for (auto const& [d, x] : row.entries)
      if (d >= m_.tree_dofadr[tree] && d < m_.tree_dofadr[tree] + m_.tree_dofnum[tree]) a[std::size_t(d - m_.tree_dofadr[tree])] = x;
    return a;
  }
  std::vector<int> trees_of(SparseRow const& row) const {
    std::vector<int> trees;
    for (auto const& [d, x] : row.entries)
      if (int const t = m_.body_tree[m_.dof_body[d]]; x != 0 && std::find(trees.begin(), trees.end(), t) == trees.end()) trees.push_back(t);
    return trees;
  }
  // row M^-1 row^T and |M^-1 row^T|: M is block diagonal, so trees add up.
  double inverse_weight(SparseRow const& row, std::vector<InitialInertia> const& inertia) const {
    double sum = 0;
    for (int t : trees_of(row)) sum += inertia[std::size_t(t)].inverse_weight(part(row, t));
    return sum;
  }
  double acceleration(SparseRow const& row, std::vector<InitialInertia> const& inertia) const {
    double sum = 0;
    for (int t : trees_of(row))
      for (double x : inertia[std::size_t(t)].solve(part(row, t))) sum += x * x;
    return std::sqrt(sum);
  }

  void inverse_weights(InitialPose const& pose, std::vector<InitialInertia> const& inertia) {
    m_.body_invweight0.assign(m_.nbody, {0, 0});
    m_.dof_invweight0.assign(m_.nv, 0);
    for (int t = 0; t < m_.ntree; ++t) {
      int const n = m_.tree_dofnum[t], d0 = m_.tree_dofadr[t];
      for (int b = m_.tree_bodyadr[t], end = b + m_.tree_bodynum[t]; b < end; ++b)
        m_.body_invweight0[b] = inertia[std::size_t(t)].body_inverse_weight(pose, b);
      for (int d = d0; d < d0 + n; ++d) {
        std::vector<double> unit(std::size_t(n), 0.);
        unit[std::size_t(d - d0)] = 1;
        m_.dof_invweight0[d] = inertia[std::size_t(t)].inverse_weight(std::move(unit));
      }
      for (int j = m_.tree_jntadr[t], end = j + m_.tree_jntnum[t]; j < end; ++j)  // the three of a translation or a ball share their mean
        for (int first = 0, dofs = m_.jnt_type[j] == 0 ? 6 : m_.jnt_type[j] == 1 ? 3 : 0; first < dofs; first += 3) {
          double* w = &m_.dof_invweight0[m_.jnt_dofadr[j] + first];
          w[0] = w[1] = w[2] = (w[0] + w[1] + w[2]) / 3;
        }
      if (int const root = m_.tree_bodyadr[t]; is_slider(m_, root)) {
        m_.body_invweight0[root] = {1 / m_.body_mass[root], 0};
        for (int d = d0; d < d0 + n; ++d) m_.dof_invweight0[d] = 1 / m_.body_mass[root];
      }
    }
  }

  void springs_from_inertia() {
    for (int b = 1; b < m_.nbody; ++b)
      for (std::size_t k = 0; k < d_.bodies[b].joints.size(); ++k) {
        auto const& spring = d_.bodies[b].joints[k].springdamper;
        int const j = m_.body_jntadr[b] + int(k), dofs = m_.jnt_type[j] == 0 ? 6 : m_.jnt_type[j] == 1 ? 3 : 1, d = m_.jnt_dofadr[j];
        if (!(spring[0] > 0 && spring[1] > 0)) continue;
        double weight = 0;
        for (int i = d; i < d + dofs; ++i) weight += m_.dof_invweight0[i];
        double const inertia = dofs / std::max(weight, 1e-15);
        m_.jnt_stiffness[j] = inertia / (spring[0] * spring[0] * spring[1] * spring[1]);
        for (int i = d; i < d + dofs; ++i) m_.dof_damping[i] = 2 * inertia / spring[0];
      }
  }
  // bias2 = -2 ratio sqrt(kp m), m = 1 / (row M^-1 row^T) the inertia that the actuator feels.
  void damping_ratio(int a, SparseRow const& row, std::vector<InitialInertia> const& inertia) {
    double const ratio = d_.actuators[std::size_t(a)].dampratio, kp = -m_.act_biasprm[a][1];
    if (!(ratio > 0)) return;
    if (!(kp > 0)) fail(d_.actuators[std::size_t(a)].place, "actuator", m_.act_name[a], "has dampratio but no stiffness: give kp");
    m_.act_biasprm[a][2] = -2 * ratio * std::sqrt(kp / std::max(inverse_weight(row, inertia), 1e-15));
  }
  // connect: the anchor in the second body's frame. weld: the anchor in the first's and the relative turn, unless they are given.
  void equality_data(InitialPose const& pose) {
    for (int e = 0; e < m_.neq; ++e) {
      auto const type = EqualityType(m_.eq_type[e]);
      if (type == EqualityType::connect && m_.eq_sites[e]) m_.eq_data[e] = {};  // the sites say all
      if ((type != EqualityType::connect && type != EqualityType::weld) || m_.eq_sites[e]) continue;
      auto& data = m_.eq_data[e];
      bool const weld = type == EqualityType::weld;
      Pose const one = pose.body(m_.eq_id1[e]), two = pose.body(m_.eq_id2[e]);
      Double4 turn{data[6], data[7], data[8], data[9]};
      if (weld && turn != Double4{0, 0, 0, 0}) {
        turn = normalized(turn);
      } else {
        Double3 const anchor{data[0], data[1], data[2]};
        Pose const &from = weld ? two : one, &to = weld ? one : two;
        Double3 const there = rotate_inverse(to.q, from * anchor - to.p);
        std::copy(there.begin(), there.end(), data.begin() + 3);
        turn = weld ? times({one.q[0], -one.q[1], -one.q[2], -one.q[3]}, two.q) : Double4{0, 0, 0, 0};
      }
      std::copy(turn.begin(), turn.end(), data.begin() + 6);
    }
  }
};

}  // namespace gsp::detail
