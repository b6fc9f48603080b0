#pragma once
#include <cmath>
#include <cstdint>
#include <gsp/model/compiled.hpp>
#include <gsp/splat/detail/geom_surface.hpp>
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
  std::vector<int> groups = {};  // only geoms of these groups; empty: 0 to 2, and all of a body that has none in them
};

namespace detail {

/// Numbers in [0, 1)^2 that fill the square evenly: multiples of the reciprocals of the plastic number and its square (Roberts' R2
/// sequence).
inline std::array<double, 2> even2(std::int64_t i) {
  double const x = 0.5 + 0.7548776662466927 * double(i + 1), y = 0.5 + 0.5698402909980532 * double(i + 1);
  return {x - std::floor(x), y - std::floor(y)};
}

/// Turns z onto the unit vector n.
inline Quat<double> z_to(Vec3<double> const& n) {
  if (n.z < -0.999999) return {0, 1, 0, 0};
  return normalized(Quat<double>{1 + n.z, -n.y, n.x, 0});
}

}  // namespace detail

/// Gaussians on the geoms of a model, for robots and objects that have none of their own: flat discs, spread evenly over the surfaces of
/// all shapes (infinite planes as patches, meshes by their triangles, height fields by their tops), coloured by the geom's rgba, each in
/// the frame of its body. Without `groups`, what MuJoCo's viewer shows is drawn, groups 0 to 2, and all geoms of a body that has none in
/// them (of URDF, whose visual geoms are group 1 and colliding ones group 0, both: {.groups = {1}} for the first). Alpha 0 is left out. The
/// same model gives the same set. Host, about 0.3 us a Gaussian.
inline GaussianSet sample_surface(CompiledModel const& model, SampleSurfaceOptions options = {}) {
  expects(options.count > 0 && options.density >= 0 && options.spread > 0 && options.plane_half > 0,
          "gsp::sample_surface: count, spread and plane_half must be positive and density not negative");
  expects(options.world_share >= 0 && options.world_share <= 1, "gsp::sample_surface: world_share must be between 0 and 1");
  expects(options.opacity > 0 && options.opacity <= 1 && options.shading >= 0 && options.shading <= 1,
          "gsp::sample_surface: opacity must be in (0, 1] and shading in [0, 1]");
  std::vector<int> geoms;
  std::vector<detail::GeomSurface> surfaces;
  double total = 0, fixed = 0;  // areas: of all, of what does not move
  auto const moves = [&](int g) {
    int const b = model.geom_body[g];
    return b > 0 && (model.body_weld.empty() || model.body_weld[b] != 0);
  };
  auto const is_shown = [&](int g) { return model.geom_group[g] >= 0 && model.geom_group[g] <= 2; };  // by a viewer
  std::vector<char> shows(model.nbody, 0);                                                            // some geom of the body is
  for (int g = 0; g < model.ngeom; ++g)
    if (is_shown(g) && model.geom_rgba[g][3] != 0) shows[model.geom_body[g]] = 1;
  auto const is_chosen = [&](int g) {
    if (options.groups.empty()) return is_shown(g) || !shows[model.geom_body[g]];
    return std::find(options.groups.begin(), options.groups.end(), model.geom_group[g]) != options.groups.end();
  };
  for (int g = 0; g < model.ngeom; ++g) {
    if ((!options.world && model.geom_body[g] == 0) || !is_chosen(g) || model.geom_rgba[g][3] == 0) continue;
    detail::GeomSurface surface(model, g, options.plane_half);
    double const area = surface.area();
    if (!(area > 0)) continue;  // nothing to draw on
    geoms.push_back(g);
    surfaces.push_back(std::move(surface));
    total += area;
    if (!moves(g)) fixed += area;
  }
  bool const crowded = fixed < total && fixed > options.world_share * total;
  auto const gaussians = [&](int g, double a) {
    if (options.density > 0) return options.density * a;
    if (!crowded) return options.count * a / total;
    return moves(g) ? options.count * (1 - options.world_share) * a / (total - fixed) : options.count * options.world_share * a / fixed;
  };

  GaussianSet out;
  out.sh_degree = options.shading > 0 ? 1 : 0;
  for (std::size_t k = 0; k < geoms.size(); ++k) {
    int const g = geoms[k];
    detail::GeomSurface const& surface = surfaces[k];
    double const a = surface.area();
    int const n = std::max(16, static_cast<int>(std::lround(gaussians(g, a))));
    double const least = std::max(surface.thickness(), 0.2 * std::sqrt(a / (4 * std::numbers::pi)));
    double const sigma = std::min(options.spread * std::sqrt(a / n), 0.5 * least);  // a disc is no wider than half of the least size
    Double3 const& gp = model.geom_pos[g];
    Double4 const& gq = model.geom_quat[g];
    Transform<double> const frame{{gp[0], gp[1], gp[2]}, {gq[0], gq[1], gq[2], gq[3]}};
    auto const& rgba = model.geom_rgba[g];
    for (std::int64_t i = 0, made = 0; made < n; ++i) {
      auto const [t, w] = detail::even2(i);
      SurfacePoint const point = surface.point(t, w);
      double const golden = 0.6180339887498949 * double(i + 1);
      if (point.keep < 1 && golden - std::floor(golden) >= point.keep) continue;
      ++made;
      Vec3<double> const p = frame * point.p, normal = rotate(frame.q, point.n);
      Quat<double> const q = detail::z_to(normal);
      for (double x : {p.x, p.y, p.z}) out.positions.push_back(static_cast<float>(x));
      for (double x : {q.w, q.x, q.y, q.z}) out.quats.push_back(static_cast<float>(x));
      for (double x : {sigma, sigma, 0.05 * sigma}) out.scales.push_back(static_cast<float>(x));
      out.opacities.push_back(options.opacity * rgba[3]);
      // colour (1 - k + k (-n.d)): degree 1 holds it exactly; Y_1..3 = 0.4886 (-y, z, -x)
      double const shade = options.shading, c0 = 0.28209479177387814, c1 = 0.48860251190291992;
      for (int c = 0; c < 3; ++c) out.sh.push_back(static_cast<float>((rgba[c] * (1 - shade) - 0.5) / c0));
      if (out.sh_degree == 1)
        for (double y : {normal.y, -normal.z, normal.x})
          for (int c = 0; c < 3; ++c) out.sh.push_back(static_cast<float>(rgba[c] * shade * y / c1));
      out.body.push_back(model.geom_body[g]);
    }
  }
  return out;
}

}  // namespace gsp
