#pragma once
#include <array>
#include <cmath>
#include <gsp/math/quat.hpp>
#include <utility>

namespace gsp::detail {

/// Symmetric 3x3 as xx yy zz xy xz yz.
using Symmetric3 = std::array<double, 6>;

/// R diag(d) R^T, R the rotation of q.
inline Symmetric3 rotated_diagonal(Quat<double> const& q, std::array<double, 3> const& d) {
  auto const r = to_matrix(q);
  auto const entry = [&](int i, int j) { return r(i, 0) * d[0] * r(j, 0) + r(i, 1) * d[1] * r(j, 1) + r(i, 2) * d[2] * r(j, 2); };
  return {entry(0, 0), entry(1, 1), entry(2, 2), entry(0, 1), entry(0, 2), entry(1, 2)};
}

struct PrincipalAxes {
  std::array<double, 3> moments;  // in decreasing order
  Quat<double> quat;              // takes the principal frame to the frame of the tensor
};

/// Eigenvalues and axes by Jacobi rotations on a quaternion: each rotation about a coordinate axis removes the largest off-diagonal entry,
/// tan(2 t) = 2 a_ij / (a_ii - a_jj); it converges quadratically, so that 30 sweeps are far more than enough.
inline PrincipalAxes principal_axes(Symmetric3 const& s) {
  double a[3][3] = {{s[0], s[3], s[4]}, {s[3], s[1], s[5]}, {s[4], s[5], s[2]}};
  double v[3][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};  // columns: the axes
  double const scale = std::abs(s[0]) + std::abs(s[1]) + std::abs(s[2]);
  for (int sweep = 0; sweep < 90; ++sweep) {
    int p = 0, q = 1;
    if (std::abs(a[0][2]) > std::abs(a[p][q])) q = 2;
    if (std::abs(a[1][2]) > std::abs(a[p][q])) p = 1, q = 2;
    if (!(std::abs(a[p][q]) > 1e-17 * scale)) break;
    double const t = 0.5 * std::atan2(2 * a[p][q], a[p][p] - a[q][q]), c = std::cos(t), n = std::sin(t);
    for (auto& row : a) {
      double const x = row[p], y = row[q];
      row[p] = c * x + n * y, row[q] = c * y - n * x;
    }
    for (int k = 0; k < 3; ++k) {
      double const x = a[p][k], y = a[q][k];
      a[p][k] = c * x + n * y, a[q][k] = c * y - n * x;
    }
    for (auto& row : v) {
      double const x = row[p], y = row[q];
      row[p] = c * x + n * y, row[q] = c * y - n * x;
    }
  }
  int order[3] = {0, 1, 2};
  for (int i : {0, 1, 0})
    if (a[order[i]][order[i]] < a[order[i + 1]][order[i + 1]]) std::swap(order[i], order[i + 1]);
  PrincipalAxes result;
  double r[3][3];
  for (int k = 0; k < 3; ++k) {
    result.moments[k] = a[order[k]][order[k]];
    for (int i = 0; i < 3; ++i) r[i][k] = v[i][order[k]];
  }
  double const handed = r[0][0] * (r[1][1] * r[2][2] - r[2][1] * r[1][2]) - r[0][1] * (r[1][0] * r[2][2] - r[2][0] * r[1][2]) +
                        r[0][2] * (r[1][0] * r[2][1] - r[2][0] * r[1][1]);
  if (handed < 0)
    for (auto& row : r) row[2] = -row[2];
  // the largest of w, x, y, z first, so that no root of a small number is taken
  double const four[4] = {1 + r[0][0] + r[1][1] + r[2][2], 1 + r[0][0] - r[1][1] - r[2][2], 1 - r[0][0] + r[1][1] - r[2][2],
                          1 - r[0][0] - r[1][1] + r[2][2]};
  int k = 0;
  for (int i = 1; i < 4; ++i)
    if (four[i] > four[k]) k = i;
  double const m = 0.5 * std::sqrt(four[k]), f = 0.25 / m;
  if (k == 0) result.quat = {m, f * (r[2][1] - r[1][2]), f * (r[0][2] - r[2][0]), f * (r[1][0] - r[0][1])};
  if (k == 1) result.quat = {f * (r[2][1] - r[1][2]), m, f * (r[0][1] + r[1][0]), f * (r[0][2] + r[2][0])};
  if (k == 2) result.quat = {f * (r[0][2] - r[2][0]), f * (r[0][1] + r[1][0]), m, f * (r[1][2] + r[2][1])};
  if (k == 3) result.quat = {f * (r[1][0] - r[0][1]), f * (r[0][2] + r[2][0]), f * (r[1][2] + r[2][1]), m};
  result.quat = normalized(result.quat);
  return result;
}

}  // namespace gsp::detail
