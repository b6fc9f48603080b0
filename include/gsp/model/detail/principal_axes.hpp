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

/// Eigenvalues and axes by Jacobi rotations of at most 45 degrees, each about a coordinate axis of the frame so far; it removes the largest
/// off-diagonal entry,
///   tan t = sign(c) / (|c| + sqrt(1 + c^2)),  c = (a_jj - a_ii) / (2 a_ij),
/// and converges quadratically, so that 90 rotations are far more than enough. Moments are sorted by quarter turns of the frame. Of the 24
/// frames (and two signs of the quaternion) that this leaves open it is the one of MuJoCo's compiler, where a frame shows: qpos0 of a free
/// body that is aligned. Entries that are rounding of the tensor's own sums count as zero, and moments that differ by rounding keep their
/// order: where moments are equal, axes would otherwise be a matter of the compiler's flags.
inline PrincipalAxes principal_axes(Symmetric3 const& s) {
  double const scale = std::abs(s[0]) + std::abs(s[1]) + std::abs(s[2]);
  Double4 q{1, 0, 0, 0};
  Symmetric3 a = s;
  for (int turn = 0; turn < 90; ++turn) {
    double const xy = std::abs(a[3]), xz = std::abs(a[4]), yz = std::abs(a[5]);
    int const k = xy > xz && xy > yz ? 2 : xz > yz ? 1 : 0;  // about this axis, which the two others turn round
    int const i = k == 0 ? 1 : 0, j = k == 2 ? 1 : 2;
    double const entry = a[5 - k];
    if (!(std::abs(entry) > 1e-14 * scale)) break;
    double const c = (a[j] - a[i]) / (2 * entry), t = std::atan((c < 0 ? -1 : 1) / (std::abs(c) + std::sqrt(1 + c * c)));
    Double3 axis{};
    axis[k] = k == 1 ? 1 : -1;
    q = normalized(times(q, axis_angle(axis, t)));
    Double3 const x = rotate(q, {1, 0, 0}), y = rotate(q, {0, 1, 0}), z = rotate(q, {0, 0, 1});
    auto const along = [&](Double3 const& u, Double3 const& v) {
      return dot(
          u, {s[0] * v[0] + s[3] * v[1] + s[4] * v[2], s[3] * v[0] + s[1] * v[1] + s[5] * v[2], s[4] * v[0] + s[5] * v[1] + s[2] * v[2]});
    };
    a = {along(x, x), along(y, y), along(z, z), along(x, y), along(x, z), along(y, z)};
  }
  for (int i : {0, 1, 0}) {
    if (!(a[i] + 1e-13 * scale < a[i + 1])) continue;
    std::swap(a[i], a[i + 1]);
    Double4 quarter{std::sqrt(0.5), 0, 0, 0};
    quarter[i == 0 ? 3 : 1] = std::sqrt(0.5);
    q = normalized(times(q, quarter));
  }
  return {{a[0], a[1], a[2]}, q};
}

}  // namespace gsp::detail
