#pragma once
#include <array>

namespace gsp::io::detail {

using Matrix3 = std::array<double, 9>;  // row-major

inline Matrix3 rotation_matrix(std::array<double, 4> const& q) {
  auto const [w, x, y, z] = q;
  return {1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y), 2 * (x * y + w * z),    1 - 2 * (x * x + z * z),
          2 * (y * z - w * x),     2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)};
}

/// The real spherical harmonics of degree 0-3 in the order and with the signs that 3DGS files use, (x, y, z) a unit vector.
inline std::array<double, 16> sh_basis(double x, double y, double z) {
  double const xx = x * x, yy = y * y, zz = z * z;
  return {0.28209479177387814,
          -0.48860251190291992 * y,
          0.48860251190291992 * z,
          -0.48860251190291992 * x,
          1.0925484305920792 * x * y,
          -1.0925484305920792 * y * z,
          0.94617469575756 * zz - 0.31539156525252,
          -1.0925484305920792 * x * z,
          0.5462742152960396 * (xx - yy),
          -0.5900435899266435 * y * (3 * xx - yy),
          2.890611442640554 * x * y * z,
          -0.4570457994644658 * y * (5 * zz - 1),
          0.3731763325901154 * z * (5 * zz - 3),
          -0.4570457994644658 * x * (5 * zz - 1),
          1.445305721320277 * z * (xx - yy),
          -0.5900435899266435 * x * (xx - 3 * yy)};
}

}  // namespace gsp::io::detail
