#pragma once
#include <algorithm>
#include <array>
#include <cmath>
#include <gsp/core/check.hpp>
#include <gsp/model/compiled.hpp>
#include <gsp/model/detail/host_math.hpp>
#include <vector>

namespace gsp::detail {

/// Mass matrix of one tree in the initial pose, dense, and its Cholesky factor. Made from the Jacobians of the bodies' centres of mass,
///   M = sum_b Jv^T m Jv + Jw^T I Jw + armature + sum_t a J_t^T J_t,
/// which shares nothing with the recursive algorithm of the dynamics, so that each can check the other.
class InitialInertia {
 public:
  InitialInertia(CompiledModel const& m, int tree) : n_(m.tree_dofnum[tree]), first_(m.tree_dofadr[tree]), matrix_(n_ * n_, 0.) {
    int const b0 = m.tree_bodyadr[tree], bodies = m.tree_bodynum[tree];
    std::vector<Pose> pose(bodies);
    axis_.resize(n_), anchor_.resize(n_), turns_.resize(n_);
    for (int b = b0; b < b0 + bodies; ++b) {
      Pose parent{{0, 0, 0}, {1, 0, 0, 0}};
      if (b > b0)
        parent = pose[m.body_parent[b] - b0];
      else
        for (int p = m.body_parent[b]; p > 0; p = m.body_parent[p]) parent = Pose{m.body_pos[p], m.body_quat[p]} * parent;
      auto const x = pose[b - b0] = parent * Pose{m.body_pos[b], m.body_quat[b]};
      for (int j = m.body_jntadr[b], end = j + m.body_jntnum[b]; j < end; ++j) {
        int const d = m.jnt_dofadr[j] - first_;
        auto const anchor = x * m.jnt_pos[j];
        auto const put = [&](int k, Double3 const& direction, bool turns) { axis_[k] = direction, anchor_[k] = anchor, turns_[k] = turns; };
        auto const unit = [](int k) { return Double3{k == 0 ? 1. : 0., k == 1 ? 1. : 0., k == 2 ? 1. : 0.}; };
        switch (JointType(m.jnt_type[j])) {
          case JointType::free:
            for (int k = 0; k < 3; ++k) put(d + k, unit(k), false), put(d + 3 + k, rotate(x.q, unit(k)), true);
            break;
          case JointType::ball:
            for (int k = 0; k < 3; ++k) put(d + k, rotate(x.q, unit(k)), true);
            break;
          case JointType::slide:
            put(d, rotate(x.q, m.jnt_axis[j]), false);
            break;
          case JointType::hinge:
            put(d, rotate(x.q, m.jnt_axis[j]), true);
            break;
        }
      }
    }
    com_.resize(bodies);
    for (int b = b0; b < b0 + bodies; ++b) {
      com_[b - b0] = pose[b - b0] * m.body_ipos[b];
      auto const frame = times(pose[b - b0].q, m.body_iquat[b]);
      auto const chain = dofs_of(m, b);
      for (std::size_t i = 0; i < chain.size(); ++i)
        for (std::size_t k = 0; k <= i; ++k) {
          auto const wi = rotate_inverse(frame, angular(chain[i])), wk = rotate_inverse(frame, angular(chain[k]));
          double const rotation =
              wi[0] * wk[0] * m.body_inertia[b][0] + wi[1] * wk[1] * m.body_inertia[b][1] + wi[2] * wk[2] * m.body_inertia[b][2];
          add(chain[i], chain[k], m.body_mass[b] * dot(linear(chain[i], com_[b - b0]), linear(chain[k], com_[b - b0])) + rotation);
        }
    }
    for (int d = 0; d < n_; ++d) matrix_[d * n_ + d] += m.dof_armature[first_ + d];
    for (int t = 0; t < m.ntendon; ++t) {
      if (m.tendon_tree[t] != tree || m.tendon_armature[t] == 0) continue;
      for (int i = m.tendon_termadr[t], end = i + m.tendon_termnum[t]; i < end; ++i)
        for (int k = m.tendon_termadr[t]; k < end; ++k)
          matrix_[(m.jnt_dofadr[m.term_jnt[i]] - first_) * n_ + m.jnt_dofadr[m.term_jnt[k]] - first_] +=
              m.tendon_armature[t] * m.term_coef[i] * m.term_coef[k];
    }
    factor(m);
  }

  /// a^T M^-1 a for a row `a` over the tree's dofs, counted from the tree's first.
  double inverse_weight(std::vector<double> a) const {  // |L^-1 a|^2
    double sum = 0;
    for (int i = 0; i < n_; ++i) {
      double x = a[i];
      if (x == 0 && sum == 0) continue;  // leading zeros stay zero
      for (int k = 0; k < i; ++k) x -= matrix_[i * n_ + k] * a[k];
      a[i] = x / matrix_[i * n_ + i];
      sum += a[i] * a[i];
    }
    return sum;
  }
  /// Means over x, y, z of J M^-1 J^T for translation and rotation at the body's centre of mass.
  std::array<double, 2> body_inverse_weight(CompiledModel const& m, int b) const {
    auto const chain = dofs_of(m, b);
    auto const& com = com_[b - m.tree_bodyadr[m.body_tree[b]]];
    std::array<double, 2> mean{0, 0};
    for (int c = 0; c < 3; ++c) {
      std::vector<double> v(n_, 0.), w(n_, 0.);
      for (int d : chain) v[d] = linear(d, com)[c], w[d] = angular(d)[c];
      mean[0] += inverse_weight(std::move(v)) / 3, mean[1] += inverse_weight(std::move(w)) / 3;
    }
    return mean;
  }

 private:
  std::vector<int> dofs_of(CompiledModel const& m, int b) const {  // from the root down
    std::vector<int> dofs;
    while (m.body_tree[b] >= 0 && m.body_dofnum[b] == 0) b = m.body_parent[b];
    if (m.body_tree[b] < 0) return dofs;
    for (int d = m.body_dofadr[b] + m.body_dofnum[b] - 1; d >= 0; d = m.dof_parent[d]) dofs.push_back(d - first_);
    std::reverse(dofs.begin(), dofs.end());
    return dofs;
  }
  Double3 angular(int d) const { return turns_[d] ? axis_[d] : Double3{0, 0, 0}; }
  Double3 linear(int d, Double3 const& at) const { return turns_[d] ? cross(axis_[d], at - anchor_[d]) : axis_[d]; }
  void add(int i, int k, double value) {
    matrix_[i * n_ + k] += value;
    if (i != k) matrix_[k * n_ + i] += value;
  }
  void factor(CompiledModel const& m) {
    for (int i = 0; i < n_; ++i)
      for (int k = 0; k <= i; ++k) {
        double x = matrix_[i * n_ + k];
        for (int l = 0; l < k; ++l) x -= matrix_[i * n_ + l] * matrix_[k * n_ + l];
        if (i != k)
          matrix_[i * n_ + k] = x / matrix_[k * n_ + k];
        else if (x > 1e-15)
          matrix_[i * n_ + i] = std::sqrt(x);
        else
          throw Error("joint '" + m.jnt_name[m.dof_jnt[first_ + i]] +
                      "': the mass matrix is singular in the initial pose: nothing with mass resists this joint, or it repeats another "
                      "joint of its body; add a "
                      "geom, an inertial or armature, or remove the joint");
      }
  }

  int n_, first_;
  std::vector<double> matrix_;
  std::vector<Double3> axis_, anchor_, com_;  // world frame
  std::vector<char> turns_;
};

}  // namespace gsp::detail
