#pragma once
#include <cmath>
#include <cstdint>
#include <gsp/math/quat.hpp>
#include <gsp/model/compiled.hpp>
#include <gsp/splat/gaussians.hpp>
#include <numbers>

namespace gsp {

struct SampleSurfaceOptions {
  int count = 20000;    // Gaussians on all chosen geoms together, about: shared out by area (and world_share), at least 16 a geom
  double density = 0;   // Gaussians a square metre; positive: instead of `count`
  double spread = 0.8;  // standard deviation of a disc over the square root of its share of the surface
  float opacity = 0.95f;
  float shading = 0.35f;         // 0: flat colour; else darker where the surface turns away from the eye, by SH of degree 1
  double plane_half = 5;         // half side of the patch that stands for an infinite plane [m]
  bool world = true;             // also geoms that are fixed to the world (body 0)
  double world_share = 0.5;      // of `count`: what does not move takes no more where there are links, however large a floor is
  std::vector<int> groups = {};  // only geoms of these groups; empty: all
};

namespace detail {

struct SurfacePoint {
  Vec3<double> p, n;  // in the geom's frame; n unit, outward
};

/// Numbers in [0, 1)^2 that fill the square evenly: multiples of the reciprocals of the plastic number and its square (Roberts' R2
/// sequence).
inline std::array<double, 2> even2(std::int64_t i) {
  double const x = 0.5 + 0.7548776662466927 * double(i + 1), y = 0.5 + 0.5698402909980532 * double(i + 1);
  return {x - std::floor(x), y - std::floor(y)};
}

/// Surface area [m^2] of a primitive; 0 for what has none here.
inline double surface_area(ShapeType type, Double3 const& s, double plane_half) {
  constexpr double pi = std::numbers::pi;
  switch (type) {
    case ShapeType::plane:
      return 4 * (s[0] > 0 ? s[0] : plane_half) * (s[1] > 0 ? s[1] : plane_half);
    case ShapeType::sphere:
      return 4 * pi * s[0] * s[0];
    case ShapeType::capsule:
      return 4 * pi * s[0] * (s[0] + s[1]);
    case ShapeType::cylinder:
      return 2 * pi * s[0] * (s[0] + 2 * s[1]);
    case ShapeType::box:
      return 8 * (s[0] * s[1] + s[1] * s[2] + s[2] * s[0]);
    case ShapeType::ellipsoid: {  // Thomsen's formula, within 1.1 %
      double const k = 1.6075, a = std::pow(s[0] * s[1], k), b = std::pow(s[1] * s[2], k), c = std::pow(s[2] * s[0], k);
      return 4 * pi * std::pow((a + b + c) / 3, 1 / k);
    }
    default:
      return 0;
  }
}

/// The point of the surface for (t, w) in [0, 1)^2, even by area: t also chooses the face.
inline SurfacePoint surface_point(ShapeType type, Double3 const& s, double plane_half, double t, double w) {
  constexpr double pi = std::numbers::pi;
  auto const around = [&](double x) { return Vec3<double>{std::cos(2 * pi * x), std::sin(2 * pi * x), 0}; };
  auto const ball = [&](double u, double x) {
    double const z = 1 - 2 * u, r = std::sqrt(std::max(0., 1 - z * z));
    Vec3<double> const c = around(x);
    return Vec3<double>{r * c.x, r * c.y, z};
  };
  switch (type) {
    case ShapeType::plane: {
      double const x = s[0] > 0 ? s[0] : plane_half, y = s[1] > 0 ? s[1] : plane_half;
      return {{x * (2 * t - 1), y * (2 * w - 1), 0}, {0, 0, 1}};
    }
    case ShapeType::sphere: {
      Vec3<double> const n = ball(t, w);
      return {s[0] * n, n};
    }
    case ShapeType::capsule: {
      double const side = s[1] / (s[0] + s[1]);  // share of the area
      if (t < side) {
        Vec3<double> const n = around(w);
        return {{s[0] * n.x, s[0] * n.y, s[1] * (2 * t / side - 1)}, n};
      }
      Vec3<double> const n = ball((t - side) / (1 - side), w);
      return {{s[0] * n.x, s[0] * n.y, s[0] * n.z + (n.z < 0 ? -s[1] : s[1])}, n};
    }
    case ShapeType::cylinder: {
      double const side = 2 * s[1] / (s[0] + 2 * s[1]);
      if (t < side) {
        Vec3<double> const n = around(w);
        return {{s[0] * n.x, s[0] * n.y, s[1] * (2 * t / side - 1)}, n};
      }
      double const u = 2 * (t - side) / (1 - side), end = u < 1 ? 1 : -1, r = s[0] * std::sqrt(u - std::floor(u));
      Vec3<double> const c = around(w);
      return {{r * c.x, r * c.y, end * s[1]}, {0, 0, end}};
    }
    case ShapeType::box: {
      double const area[3] = {s[1] * s[2], s[2] * s[0], s[0] * s[1]}, all = area[0] + area[1] + area[2];
      double u = t * all;
      int axis = 0;
      while (axis < 2 && u >= area[axis]) u -= area[axis++];
      u = std::min(2 * u / area[axis], std::nextafter(2., 0.));  // [0, 2): the two faces
      double const side = u < 1 ? 1 : -1;
      SurfacePoint r{{0, 0, 0}, {0, 0, 0}};
      int const b = (axis + 1) % 3, c = (axis + 2) % 3;
      r.p[axis] = side * s[axis], r.n[axis] = side;
      r.p[b] = s[b] * (2 * (u - std::floor(u)) - 1), r.p[c] = s[c] * (2 * w - 1);
      return r;
    }
    default: {  // ellipsoid, even over the ball of directions: the caller thins it out by area
      Vec3<double> const d = ball(t, w);
      return {{s[0] * d.x, s[1] * d.y, s[2] * d.z}, normalized(Vec3<double>{d.x / s[0], d.y / s[1], d.z / s[2]})};
    }
  }
}

/// Turns z onto the unit vector n.
inline Quat<double> z_to(Vec3<double> const& n) {
  if (n.z < -0.999999) return {0, 1, 0, 0};
  return normalized(Quat<double>{1 + n.z, -n.y, n.x, 0});
}

}  // namespace detail

/// Gaussians on the geoms of a model, for robots and objects that have none of their own: flat discs, spread evenly over planes (as
/// patches), spheres, capsules, cylinders, boxes and ellipsoids, coloured by the geom's rgba, each in the frame of its body. The same model
/// gives the same set. Geoms with alpha 0 are left out. Throws Error for a chosen geom of another type (mesh, height field), naming it.
/// Host, about 0.3 us a Gaussian.
inline GaussianSet sample_surface(CompiledModel const& model, SampleSurfaceOptions options = {}) {
  expects(options.count > 0 && options.density >= 0 && options.spread > 0 && options.plane_half > 0,
          "gsp::sample_surface: count, spread and plane_half must be positive and density not negative");
  expects(options.world_share >= 0 && options.world_share <= 1, "gsp::sample_surface: world_share must be between 0 and 1");
  expects(options.opacity > 0 && options.opacity <= 1 && options.shading >= 0 && options.shading <= 1,
          "gsp::sample_surface: opacity must be in (0, 1] and shading in [0, 1]");
  std::vector<int> geoms;
  double total = 0, fixed = 0;  // areas: of all, of what does not move
  auto const moves = [&](int g) {
    int const b = model.geom_body[g];
    return b > 0 && (model.body_weld.empty() || model.body_weld[b] != 0);
  };
  auto const area = [&](int g) { return detail::surface_area(ShapeType(model.geom_type[g]), model.geom_size[g], options.plane_half); };
  for (int g = 0; g < model.ngeom; ++g) {
    if (!options.world && model.geom_body[g] == 0) continue;
    if (!options.groups.empty() && std::find(options.groups.begin(), options.groups.end(), model.geom_group[g]) == options.groups.end())
      continue;
    if (model.geom_rgba[g][3] == 0) continue;
    ShapeType const type{model.geom_type[g]};
    if (type == ShapeType::mesh || type == ShapeType::hfield)
      throw Error("gsp::sample_surface: geom " + std::to_string(g) + " ('" + model.geom_name[g] + "') is a " +
                  (type == ShapeType::mesh ? "mesh" : "height field") +
                  ", which cannot be sampled; choose other groups, or leave visual geoms out when reading");
    geoms.push_back(g);
    total += area(g);
    if (!moves(g)) fixed += area(g);
  }
  bool const crowded = fixed < total && fixed > options.world_share * total;
  auto const gaussians = [&](int g) {
    double const a = area(g);
    if (options.density > 0) return options.density * a;
    if (!crowded) return options.count * a / total;
    return moves(g) ? options.count * (1 - options.world_share) * a / (total - fixed) : options.count * options.world_share * a / fixed;
  };

  GaussianSet out;
  out.sh_degree = options.shading > 0 ? 1 : 0;
  for (int g : geoms) {
    ShapeType const type{model.geom_type[g]};
    Double3 const& s = model.geom_size[g];
    double const a = area(g);
    int const n = std::max(16, static_cast<int>(std::lround(gaussians(g))));
    double least = s[0];  // a disc is no wider than half of the shape's least size
    if (type == ShapeType::box || type == ShapeType::ellipsoid) least = std::min({s[0], s[1], s[2]});
    double sigma = options.spread * std::sqrt(a / n);
    if (type != ShapeType::plane) sigma = std::min(sigma, 0.5 * std::max(least, 0.2 * std::sqrt(a / (4 * std::numbers::pi))));
    Double3 const& gp = model.geom_pos[g];
    Double4 const& gq = model.geom_quat[g];
    Transform<double> const frame{{gp[0], gp[1], gp[2]}, {gq[0], gq[1], gq[2], gq[3]}};
    auto const& rgba = model.geom_rgba[g];
    double const widest = std::max({s[0] * s[1], s[1] * s[2], s[2] * s[0]});
    for (std::int64_t i = 0, made = 0; made < n; ++i) {
      auto const [t, w] = detail::even2(i);
      detail::SurfacePoint const point = detail::surface_point(type, s, options.plane_half, t, w);
      if (type == ShapeType::ellipsoid) {  // keep by the ratio of areas, ellipsoid over ball
        Vec3<double> const d{point.p.x / s[0], point.p.y / s[1], point.p.z / s[2]};
        double const ratio = norm(Vec3<double>{s[1] * s[2] * d.x, s[2] * s[0] * d.y, s[0] * s[1] * d.z}) / widest,
                     golden = 0.6180339887498949 * double(i + 1);
        if (golden - std::floor(golden) >= ratio) continue;
      }
      ++made;
      Vec3<double> const p = frame * point.p, normal = rotate(frame.q, point.n);
      Quat<double> const q = detail::z_to(normal);
      for (double x : {p.x, p.y, p.z}) out.positions.push_back(static_cast<float>(x));
      for (double x : {q.w, q.x, q.y, q.z}) out.quats.push_back(static_cast<float>(x));
      for (double x : {sigma, sigma, 0.05 * sigma}) out.scales.push_back(static_cast<float>(x));
      out.opacities.push_back(options.opacity * rgba[3]);
      // colour (1 - k + k (-n.d)): degree 1 holds it exactly; Y_1..3 = 0.4886 (-y, z, -x)
      double const k = options.shading, c0 = 0.28209479177387814, c1 = 0.48860251190291992;
      for (int c = 0; c < 3; ++c) out.sh.push_back(static_cast<float>((rgba[c] * (1 - k) - 0.5) / c0));
      if (out.sh_degree == 1)
        for (double y : {normal.y, -normal.z, normal.x})
          for (int c = 0; c < 3; ++c) out.sh.push_back(static_cast<float>(rgba[c] * k * y / c1));
      out.body.push_back(model.geom_body[g]);
    }
  }
  return out;
}

}  // namespace gsp
