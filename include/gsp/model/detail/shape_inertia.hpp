#pragma once
#include <array>
#include <cmath>
#include <gsp/model/description.hpp>

namespace gsp::detail {

/// Volume and moments of inertia of a shape about its centre along its own axes, per unit of density and of mass.
struct ShapeInertia {
  double measure = 0;  // volume [m^3]; of a shell its area [m^2]
  Double3 moments{};   // of one kilogram [m^2]
};

/// Closed forms. Capsule: a cylinder and two half balls, moved by the parallel axis theorem (com of a half ball 3r/8 from its base, of a
/// half sphere r/2). Planes have none.
inline ShapeInertia shape_inertia(ShapeType type, Double3 const& size, bool shell) {
  double constexpr pi = 3.14159265358979323846;
  double const a = size[0], b = size[1], c = size[2];
  double const h = 2 * b;  // full height of capsule and cylinder
  auto const round = [](double measure, double across, double along) { return ShapeInertia{measure, {across, across, along}}; };
  switch (type) {
    case ShapeType::sphere:
      return shell ? round(4 * pi * a * a, a * a * 2 / 3, a * a * 2 / 3) : round(pi * a * a * a * 4 / 3, a * a * 2 / 5, a * a * 2 / 5);
    case ShapeType::capsule: {
      double const ball = shell ? 4 * pi * a * a : pi * a * a * a * 4 / 3, tube = shell ? 2 * pi * a * h : pi * a * a * h;
      double const whole = ball + tube, mb = ball / whole, mt = tube / whole;
      double const along_ball = shell ? a * a * 2 / 3 : a * a * 2 / 5, along_tube = shell ? a * a : a * a / 2;
      double const away = shell ? h * (h + 2 * a) / 4 : h * (2 * h + 3 * a) / 8;
      return round(whole, mb * (along_ball + away) + mt * (along_tube / 2 + h * h / 12), mb * along_ball + mt * along_tube);
    }
    case ShapeType::cylinder: {
      if (!shell) return round(pi * a * a * h, (3 * a * a + h * h) / 12, a * a / 2);
      double const tube = 2 * pi * a * h, caps = 2 * pi * a * a, whole = tube + caps, mt = tube / whole, mc = caps / whole;
      return round(whole, mt * (a * a / 2 + h * h / 12) + mc * (a * a / 4 + h * h / 4), mt * a * a + mc * a * a / 2);
    }
    case ShapeType::ellipsoid:
      return {pi * a * b * c * 4 / 3, {(b * b + c * c) / 5, (a * a + c * c) / 5, (a * a + b * b) / 5}};
    case ShapeType::box: {
      if (!shell) return {8 * a * b * c, {(b * b + c * c) / 3, (a * a + c * c) / 3, (a * a + b * b) / 3}};
      double const x = 8 * b * c, y = 8 * a * c, z = 8 * a * b, whole = x + y + z;  // areas of the faces across x, y, z
      double const xx = a * a * (x + (y + z) / 3) / whole, yy = b * b * (y + (x + z) / 3) / whole, zz = c * c * (z + (x + y) / 3) / whole;
      return {whole, {yy + zz, xx + zz, xx + yy}};
    }
    default:
      return {};
  }
}

/// Radius of the bounding sphere about the geom's centre; 0 for planes.
inline double bounding_radius(ShapeType type, Double3 const& s) {
  switch (type) {
    case ShapeType::sphere:
      return s[0];
    case ShapeType::capsule:
      return s[0] + s[1];
    case ShapeType::cylinder:
      return std::hypot(s[0], s[1]);
    case ShapeType::ellipsoid:
      return std::fmax(s[0], std::fmax(s[1], s[2]));
    case ShapeType::box:
      return std::hypot(s[0], s[1], s[2]);
    default:
      return 0;
  }
}

}  // namespace gsp::detail
