#pragma once
#include <gsp/math/scalar.hpp>
#include <vector>

/// How lenses differ from a pinhole, as OpenCV has it. No Kokkos.
namespace gsp {

/// A lens: where the ray (x, y, 1) comes in the plane z = 1, before K makes pixels of it,
///   x_d = s x + 2 p1 x y + p2 (r^2 + 2 x^2),   y_d = s y + p1 (r^2 + 2 y^2) + 2 p2 x y,   r^2 = x^2 + y^2
///   opencv    s = (1 + k1 r^2 + k2 r^4 + k3 r^6) / (1 + k4 r^2 + k5 r^4 + k6 r^6)
///   fisheye   s = a (1 + k1 a^2 + k2 a^4 + k3 a^6 + k4 a^8) / r,   a = atan r,   p1 = p2 = 0
/// Its derivative is symmetric, J = s I + b (x, y)(x, y)^T + (2 p1 y + 6 p2 x, 2 p1 x + 2 p2 y; ., 6 p1 y + 2 p2 x), b = (ds/dr) / r. So as
/// long as J is positive definite, on a disc about the axis, no two rays come to one place (the map is the gradient of a convex function);
/// beyond, the polynomials lead back into the picture, and nothing is drawn. `opencv_lens` and `fisheye_lens` make it.
/// Source: OpenCV 4, module calib3d, "Camera Calibration and 3D Reconstruction" and "Fisheye camera model".
struct Lens {
  enum class Model : int { opencv, fisheye };
  static constexpr int rings = 64;               // of radius tan(i pi / 128)
  static constexpr double widest = 5729.577951;  // tan 89.99 degrees: the radius of the rays that `undistorted` looks for
  Model model = Model::opencv;
  double k[6] = {};       // k1 ... k6, of a fisheye k1 ... k4
  double p1 = 0, p2 = 0;  // 0 of a fisheye
  double valid = 0;       // radius of the largest disc on which J is positive definite; may be infinite
  // bounds, within ring i or all of the disc: at least the norm of J, and of J (1, 0, -x; 0, 1, -y): how far a metre at z = 1 m reaches;
  // from ring i on to the end of the disc: at most the derivative of x_d, y_d along the radius
  float stretch[rings + 1] = {}, reach[rings + 1] = {}, grows[rings + 1] = {};
  bool operator==(Lens const&) const = default;
};

/// Of OpenCV's vector: 4, 5 or 8 numbers k1 k2 p1 p2 k3 k4 k5 k6. Host, 0.4 ms. Throws std::invalid_argument for another number of them
/// (OpenCV's 12 and 14 also have thin prisms and a tilted sensor), and where one is not finite.
Lens opencv_lens(std::vector<double> const& coefficients);

/// Of the 4 numbers k1 k2 k3 k4 of OpenCV's fisheye. Rays of 90 degrees and more off the axis are not drawn. As above.
Lens fisheye_lens(std::vector<double> const& coefficients);

/// A place in the plane z = 1, and the derivative J there.
template <class T>
struct LensPoint {
  T x, y;
};
template <class T>
struct LensSlope {
  T xx, xy, yy;
};

/// Where a ray comes. T: float, double or a pack of them.
template <class T>
GSP_FUNCTION LensPoint<T> distorted(Lens const& lens, T const& x, T const& y);

template <class T>
GSP_FUNCTION LensSlope<T> distortion_slope(Lens const& lens, T const& x, T const& y);

/// The ray that comes to (u, v): by Newton's iteration, first of the radius alone, in a bracket that is halved where a step does not help,
/// then of both, with steps made shorter until they do. False where none within the lens's disc (and 89.99 degrees) does: then `ray` is by
/// the edge of it in about that direction. Cost: about 6 evaluations; beside poles some 50.
GSP_FUNCTION bool undistorted(Lens const& lens, double u, double v, LensPoint<double>& ray);

}  // namespace gsp

#include <gsp/splat/detail/lens_impl.hpp>
