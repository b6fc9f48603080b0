#pragma once
#include <Kokkos_Core.hpp>
#include <gsp/splat/detail/link_view.hpp>
#include <gsp/splat/detail/render_options.hpp>
#include <gsp/splat/gaussians.hpp>

/// What an image and its lens have in common, and the cull of clusters that follows from it.
namespace gsp::detail {

KOKKOS_INLINE_FUNCTION double ring_radius(int i) { return Kokkos::tan(i * (1.57079632679489661923 / Lens::rings)); }
/// The first ring of at least that radius; Lens::rings for what is beyond them all.
KOKKOS_INLINE_FUNCTION int lens_ring(double radius) {
  double const i = Kokkos::ceil(Kokkos::atan(radius) * (Lens::rings / 1.57079632679489661923) + 1e-9);
  return i < Lens::rings ? static_cast<int>(i) : Lens::rings;
}

/// Limits of the derivative about the rays of a picture: no further out than those of its corners and of the middles of its edges, and as
/// much beyond as without a lens; where none comes to one of these, the lens's disc ends within the picture, at whatever place: then all of
/// it.
KOKKOS_INLINE_FUNCTION void limit_about_picture(Lens const& lens, int width, int height, ImageView& v) {
  double low[2] = {1e30, 1e30}, high[2] = {-1e30, -1e30};
  for (int i = 0; i < 9; ++i) {
    if (i == 4) continue;
    LensPoint<double> ray;
    bool const there = undistorted(lens, (i % 3 * 0.5 * width - v.cx) / v.fx, (i / 3 * 0.5 * height - v.cy) / v.fy, ray);
    double const edge = Kokkos::fmin(lens.valid, Lens::widest), place[2] = {ray.x, ray.y};
    for (int k = 0; k < 2; ++k) {
      low[k] = Kokkos::fmin(low[k], there ? place[k] : -edge);
      high[k] = Kokkos::fmax(high[k], there ? place[k] : edge);
    }
  }
  double const beyond_x = 0.15 * width / Kokkos::fabs(v.fx), beyond_y = 0.15 * height / Kokkos::fabs(v.fy);
  v.x_low = static_cast<float>(low[0] - beyond_x);
  v.x_high = static_cast<float>(high[0] + beyond_x);
  v.y_low = static_cast<float>(low[1] - beyond_y);
  v.y_high = static_cast<float>(high[1] + beyond_y);
}

/// Of a view whose focal lengths and limits are those of the pinhole: limits of the derivative, and what the cull of clusters needs. False
/// where the lens leads back in the middle of the picture: within a quarter of its shorter side.
KOKKOS_INLINE_FUNCTION bool look_through(Lens const& lens, int width, int height, ImageView& v) {
  double const fx = Kokkos::fabs(v.fx), fy = Kokkos::fabs(v.fy);
  v.lens = &lens;
  // a fisheye's J (1 0 -x; 0 1 -y) / z falls with the distance, as it does along the ray: it is taken where the Gaussian is. Another's does
  // not
  if (lens.model == Lens::Model::fisheye) {
    v.x_low = v.y_low = -1e30f;
    v.x_high = v.y_high = 1e30f;
  } else {
    limit_about_picture(lens, width, height, v);
  }

  // outside of a circle about the axis that holds the picture and `beyond` more, and so outside of the first ring that comes outside of it:
  // how far a ray comes out at least, r s - 3 |p| r^2, grows with r, by J along the radius
  double const p = Kokkos::sqrt(lens.p1 * lens.p1 + lens.p2 * lens.p2), beyond = 0.15 * (width > height ? width : height);
  double const x = Kokkos::fmax(Kokkos::fabs(v.cx), Kokkos::fabs(width - v.cx)) + beyond,
               y = Kokkos::fmax(Kokkos::fabs(v.cy), Kokkos::fabs(height - v.cy)) + beyond;
  double const far = Kokkos::sqrt(x * x / (fx * fx) + y * y / (fy * fy));
  auto const least = [&](double r) { return r * radial_lens(lens, r * r).s - 3 * p * r * r; };
  int inside = 0, outside = Lens::rings;  // the last is as good as none
  while (outside - inside > 1) {
    int const i = (inside + outside) / 2;
    (ring_radius(i) < lens.valid && least(ring_radius(i)) < 1.0001 * far ? inside : outside) = i;
  }
  double const seen = outside < Lens::rings ? Kokkos::fmin(ring_radius(outside), lens.valid) : lens.valid;
  v.beyond = static_cast<float>(beyond);
  v.seen = static_cast<float>(seen);
  double const limit_x = Kokkos::fmax(Kokkos::fabs(double(v.x_low)), Kokkos::fabs(double(v.x_high))),
               limit_y = Kokkos::fmax(Kokkos::fabs(double(v.y_low)), Kokkos::fabs(double(v.y_high)));
  v.stretch = lens.stretch[outside];
  v.grows = lens.grows[outside];
  v.reach = lens.reach[lens_ring(Kokkos::fmin(1.0001 * Kokkos::sqrt(limit_x * limit_x + limit_y * limit_y), lens.valid))];
  return lens.valid > 1e18 || Kokkos::fmin(fx, fy) * least(lens.valid) >= 0.25 * (width < height ? width : height);
}

/// False only if no Gaussian of the cluster can touch the picture; x, y, z: its centre before the camera, `radius` about it all centres.
/// With r, z of a Gaussian's own centre, its splat reaches 3.34 (f reach scale / z + sqrt(blur)) pixels at most, and in the plane z = 1
///   within the lens's disc,   r <= valid
///   beyond `seen` the picture is missed by grows (r - seen), so  grows (r - seen) <= sqrt(2) 3.34 reach scale / z
///   or, where no splat reaches `beyond`,   r <= seen
/// are cones, asked of the ball. Within `seen` a centre is no further from the cluster's place (where that is outside: from the nearest
/// inside, which is nearer) than `spread`, on a way within the disc, so that its pixel is no further than `stretch` says.
KOKKOS_INLINE_FUNCTION bool may_see_through(GaussianCluster const& c, ImageView const& view, RenderOptions const& options, int width,
                                            int height, double x, double y, double z, double radius) {
  double const nearest = Kokkos::fmax(double(options.near), z - radius), f = Kokkos::fmax(Kokkos::fabs(view.fx), Kokkos::fabs(view.fy));
  double const margin = 3.34 * Kokkos::sqrt(double(options.blur)) + 0.01, size = 3.34 * 1.001 * double(view.reach) * c.scale,
               reach = f * size / nearest + margin, across = Kokkos::sqrt(x * x + y * y), seen = view.seen;
  auto const outside = [&](double cone, double more) {
    return cone < 1e15 && across - 1.0001 * cone * z > radius * Kokkos::sqrt(1 + 1.001 * cone * cone) + more;
  };
  if (outside(view.lens->valid, 0)) return false;
  if (margin <= view.beyond && view.grows > 0 && outside(seen, 1.4143 * size / view.grows)) return false;
  if (!(reach <= view.beyond)) return true;
  if (outside(seen, 0)) return false;
  if (!(z > 0)) return true;
  double const spread = radius * Kokkos::sqrt(1 + across * across / (z * z)) / nearest, share = across > seen * z ? seen / across : 1 / z;
  LensPoint<double> const at = distorted(*view.lens, x * share, y * share);
  double const most = reach + 1.001 * f * view.stretch * spread, u = view.fx * at.x + view.cx, v = view.fy * at.y + view.cy;
  return !(u + most < 0 || u - most > width || v + most < 0 || v - most > height);
}

}  // namespace gsp::detail
