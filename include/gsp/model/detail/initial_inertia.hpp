#pragma once
#include <algorithm>
#include <array>
#include <cmath>
#include <gsp/model/compiled.hpp>
#include <gsp/model/detail/host_math.hpp>
#include <gsp/model/detail/initial_pose.hpp>
#include <utility>
#include <vector>

namespace gsp::detail {

/// Inertia that actuators add to what they drive: armature times the gear ratio squared.
inline double actuator_armature(CompiledModel const& m, bool tendon, int id) {
  double sum = 0;
  for (int a = 0; a < m.nu; ++a) {
    auto const target = Transmission(m.act_target[a]);
    bool const here = tendon ? target == Transmission::tendon : target == Transmission::joint || target == Transmission::joint_in_parent;
    if (here && m.act_id[a] == id) sum += m.act_armature[a] * m.act_gear[a][0] * m.act_gear[a][0];
  }
  return sum;
}

/// Mass matrix of one tree in the initial pose, dense, and its factors L^T D L. Made from the Jacobians of the bodies' centres of mass,
///   M = sum_b Jv^T m Jv + Jw^T I Jw + armature + sum_t a J_t^T J_t,
/// which shares nothing with the recursive algorithm of the dynamics, so that each can check the other. Of a tendon's armature only the
/// entries between a dof and its ancestors are kept, as in MuJoCo, whose M has no others.
class InitialInertia {
 public:
  /// `armature`: of the dofs, with the actuators'. `tendons`: armature and moment arms of those that have any.
  InitialInertia(CompiledModel const& m, InitialPose const& pose, int tree, std::vector<double> const& armature,
                 std::vector<std::pair<double, SparseRow>> const& tendons)
      : n_(m.tree_dofnum[tree]), first_(m.tree_dofadr[tree]), matrix_(std::size_t(n_) * std::size_t(n_), 0.) {
    for (int b = m.tree_bodyadr[tree], end = b + m.tree_bodynum[tree]; b < end; ++b) {
      auto const frame = times(pose.body(b).q, m.body_iquat[b]);
      auto const chain = pose.dofs_of(b);
      std::vector<Double3> v, w;
      for (int d : chain) {
        v.push_back(pose.linear(d, pose.com(b)));
        w.push_back(rotate_inverse(frame, pose.angular(d)));
      }
      for (std::size_t i = 0; i < chain.size(); ++i)
        for (std::size_t k = 0; k <= i; ++k) {
          double const rotation = w[i][0] * w[k][0] * m.body_inertia[b][0] + w[i][1] * w[k][1] * m.body_inertia[b][1] +
                                  w[i][2] * w[k][2] * m.body_inertia[b][2];
          add(chain[i] - first_, chain[k] - first_, m.body_mass[b] * dot(v[i], v[k]) + rotation);
        }
    }
    for (int d = 0; d < n_; ++d) {
      at(d, d) += armature[first_ + d];
      diagonal_.push_back(at(d, d));
    }
    for (auto const& [inertia, row] : tendons)
      for (auto const& [i, x] : row.entries) {
        if (i < first_ || i >= first_ + n_) continue;
        for (auto const& [k, y] : row.entries) {  // of each pair of dofs once: k above or at i
          int above = i;
          while (above > k) above = m.dof_parent[above];
          if (above == k && k >= first_) add(i - first_, k - first_, inertia * x * y);
        }
      }
    factor();
  }

  /// Diagonal of M without the tendons' part, which is what MuJoCo keeps as dof_M0.
  std::vector<double> const& diagonal() const { return diagonal_; }

  /// Dofs whose pivot was not positive and was taken as 1e-15, as MuJoCo takes it: nothing with mass resists them.
  std::vector<int> const& singular() const { return singular_; }

  /// a^T M^-1 a for a row `a` over the tree's dofs, counted from the tree's first: with y = L^-T a it is y^T D^-1 y.
  double inverse_weight(std::vector<double> a) const {
    solve_transposed(a);
    double sum = 0;
    for (int i = 0; i < n_; ++i) sum += a[i] * a[i] / at(i, i);
    return sum;
  }
  /// M^-1 a.
  std::vector<double> solve(std::vector<double> a) const {
    solve_transposed(a);
    for (int i = 0; i < n_; ++i) {
      a[i] /= at(i, i);
      for (int k = 0; k < i; ++k) a[i] -= at(i, k) * a[k];
    }
    return a;
  }
  /// Means over x, y, z of J M^-1 J^T for translation and rotation at the body's centre of mass.
  std::array<double, 2> body_inverse_weight(InitialPose const& pose, int b) const {
    auto const chain = pose.dofs_of(b);
    std::array<double, 2> mean{0, 0};
    for (int c = 0; c < 3; ++c) {
      std::vector<double> v(n_, 0.), w(n_, 0.);
      for (int d : chain) {
        v[d - first_] = pose.linear(d, pose.com(b))[c];
        w[d - first_] = pose.angular(d)[c];
      }
      mean[0] += inverse_weight(std::move(v)) / 3;
      mean[1] += inverse_weight(std::move(w)) / 3;
    }
    return mean;
  }

 private:
  double& at(int i, int k) { return matrix_[std::size_t(i) * std::size_t(n_) + std::size_t(k)]; }
  double at(int i, int k) const { return matrix_[std::size_t(i) * std::size_t(n_) + std::size_t(k)]; }
  void add(int i, int k, double value) { at(std::max(i, k), std::min(i, k)) += value; }
  void solve_transposed(std::vector<double>& a) const {
    for (int i = n_ - 1; i > 0; --i)
      if (a[i] != 0)
        for (int k = 0; k < i; ++k) a[k] -= at(i, k) * a[i];
  }
  // M = L^T D L from the last dof to the first, which fills nothing in where M couples a dof with its ancestors only.
  void factor() {
    std::vector<int> near;
    for (int i = n_ - 1; i >= 0; --i) {
      if (!(at(i, i) >= 1e-15)) {
        at(i, i) = 1e-15;
        singular_.push_back(first_ + i);
      }
      near.clear();
      for (int k = 0; k < i; ++k)
        if (at(i, k) != 0) near.push_back(k);
      for (auto k = near.rbegin(); k != near.rend(); ++k) {
        double const l = at(i, *k) / at(i, i);
        for (int j : near) {
          if (j > *k) break;
          at(*k, j) -= l * at(i, j);
        }
        at(i, *k) = l;
      }
    }
  }

  int n_, first_;
  std::vector<double> matrix_, diagonal_;  // matrix: the lower triangle, then D on its diagonal and L below
  std::vector<int> singular_;
};

}  // namespace gsp::detail
