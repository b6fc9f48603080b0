#pragma once
#include <Kokkos_Core.hpp>
#include <array>
#include <cmath>
#include <gsp/core/check.hpp>
#include <gsp/math/quat.hpp>

/// Where a camera stands and how wide it sees, as `Cameras` takes it.
namespace gsp {

/// Where a camera stands: x_camera = r x_world + t; the rows of r are its axes x right, y down, z forward in the world.
template <class T>
struct CameraPose {
  Mat3<T> r;
  Vec3<T> t;
  /// (4, 4) as `Cameras::viewmats` has it. Host.
  std::array<float, 16> matrix() const {
    std::array<float, 16> m{};
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) m[4 * i + j] = static_cast<float>(r(i, j));
      m[4 * i + 3] = static_cast<float>(t[i]);
    }
    m[15] = 1;
    return m;
  }
};
/// From its axes in the world and its place.
template <class T>
KOKKOS_INLINE_FUNCTION CameraPose<T> camera_pose(Vec3<T> const& eye, Vec3<T> const& right, Vec3<T> const& down, Vec3<T> const& forward) {
  return {{{right.x, right.y, right.z, down.x, down.y, down.z, forward.x, forward.y, forward.z}},
          {-dot(right, eye), -dot(down, eye), -dot(forward, eye)}};
}
/// At `eye`, looking at `target`, with `up` pointing up in the picture; where it looks along `up`, the world's y (or x) does.
template <class T>
KOKKOS_INLINE_FUNCTION CameraPose<T> look_at(Vec3<T> const& eye, Vec3<T> const& target, Vec3<T> const& up = {T(0), T(0), T(1)}) {
  Vec3<T> const forward = normalized(target - eye);
  Vec3<T> side = cross(forward, up);
  T const least = T(1e-6) * norm(up);
  if (!(norm(side) > least)) side = cross(forward, Vec3<T>{T(0), T(1), T(0)});
  if (!(norm(side) > T(1e-6))) side = cross(forward, Vec3<T>{T(1), T(0), T(0)});
  Vec3<T> const right = normalized(side);
  return camera_pose(eye, right, cross(forward, right), forward);
}

/// How wide a pinhole sees: one of the three is positive, the rest follows from square pixels.
struct FieldOfView {
  double fovx = 0, fovy = 0;  // [rad] across the picture, from its top to its bottom
  double focal = 0;           // [pixel]
};
/// K (3, 3) of a picture of width x height whose axis goes through its centre. Throws std::invalid_argument on anything but one of the
/// three.
inline std::array<float, 9> pinhole(int width, int height, FieldOfView view) {
  expects(width > 0 && height > 0, "gsp::pinhole: width and height must be positive");
  expects((view.fovx > 0) + (view.fovy > 0) + (view.focal > 0) == 1 && view.fovx < 3.141592 && view.fovy < 3.141592,
          "gsp::pinhole: give one of fovx, fovy (radians, below pi) and focal (pixels)");
  double const f = view.fovx > 0   ? 0.5 * width / std::tan(0.5 * view.fovx)
                   : view.fovy > 0 ? 0.5 * height / std::tan(0.5 * view.fovy)
                                   : view.focal;
  float const focal = static_cast<float>(f);
  return {focal, 0.f, 0.5f * static_cast<float>(width), 0.f, focal, 0.5f * static_cast<float>(height), 0.f, 0.f, 1.f};
}

}  // namespace gsp
