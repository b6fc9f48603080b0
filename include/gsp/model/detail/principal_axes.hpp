#pragma once
#include <array>
#include <cmath>
#include <gsp/model/detail/host_math.hpp>
#include <utility>

namespace gsp::detail {

/// Symmetric 3x3 as xx yy zz xy xz yz.
using Symmetric3 = std::array<double, 6>;

/// R diag(d) R^T, R the rotation of q.
inline Symmetric3 rotated_diagonal(Double4 const& q, Double3 const& d) {
  Double3 const x = rotate(q, {1, 0, 0}), y = rotate(q, {0, 1, 0}), z = rotate(q, {0, 0, 1});
  auto const entry = [&](int i, int j) { return x[i] * d[0] * x[j] + y[i] * d[1] * y[j] + z[i] * d[2] * z[j]; };
  return {entry(0, 0), entry(1, 1), entry(2, 2), entry(0, 1), entry(0, 2), entry(1, 2)};
}

struct PrincipalAxes {
  Double3 moments;  // in decreasing order
  Double4 quat;     // takes the principal frame to the frame of the tensor
};

/// Eigenvalues and axes by Jacobi rotations: each rotation about a coordinate axis removes the largest off-diagonal entry,
/// tan(2 t) = 2 a_ij / (a_ii - a_jj); it converges quadratically, so that 30 sweeps are far more than enough. Entries that are rounding of
/// the tensor's own sums count as zero, and moments that differ by rounding keep their order: where moments are equal, axes would otherwise
/// be a matter of the compiler's flags.
inline PrincipalAxes principal_axes(Symmetric3 const& s) {
  double a[3][3] = {{s[0], s[3], s[4]}, {s[3], s[1], s[5]}, {s[4], s[5], s[2]}};
  double v[3][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};  // columns: the axes
  double const scale = std::abs(s[0]) + std::abs(s[1]) + std::abs(s[2]);
  for (int sweep = 0; sweep < 90; ++sweep) {
    int p = 0, q = 1;
    if (std::abs(a[0][2]) > std::abs(a[p][q])) q = 2;
    if (std::abs(a[1][2]) > std::abs(a[p][q])) {
      p = 1;
      q = 2;
    }
    if (!(std::abs(a[p][q]) > 1e-14 * scale)) break;
    double const t = 0.5 * std::atan2(2 * a[p][q], a[p][p] - a[q][q]), c = std::cos(t), n = std::sin(t);
    for (auto& row : a) {
      double const x = row[p], y = row[q];
      row[p] = c * x + n * y;
      row[q] = c * y - n * x;
    }
    for (int k = 0; k < 3; ++k) {
      double const x = a[p][k], y = a[q][k];
      a[p][k] = c * x + n * y;
      a[q][k] = c * y - n * x;
    }
    for (auto& row : v) {
      double const x = row[p], y = row[q];
      row[p] = c * x + n * y;
      row[q] = c * y - n * x;
    }
  }
  int order[3] = {0, 1, 2};
  for (int i : {0, 1, 0})
    if (a[order[i]][order[i]] + 1e-13 * scale < a[order[i + 1]][order[i + 1]]) std::swap(order[i], order[i + 1]);
  PrincipalAxes result;
  Double3 axis[3];
  for (int k = 0; k < 3; ++k) {
    result.moments[k] = a[order[k]][order[k]];
    axis[k] = {v[0][order[k]], v[1][order[k]], v[2][order[k]]};
  }
  if (dot(cross(axis[0], axis[1]), axis[2]) < 0) axis[2] = -1. * axis[2];
  result.quat = quat_of_axes(axis[0], axis[1], axis[2]);
  return result;
}

}  // namespace gsp::detail
