#pragma once
#include <gsp/math/quat.hpp>
#include <gsp/splat/channels.hpp>
#include <gsp/splat/detail/ellipse.hpp>
#include <gsp/splat/detail/lanes.hpp>
#include <gsp/splat/detail/lens_view.hpp>
#include <gsp/splat/detail/render_options.hpp>
#include <gsp/splat/detail/spherical_harmonics.hpp>

/// What `project` does with a Gaussian, on every backend.
namespace gsp::detail {

template <class T>
struct SplatOf {
  T u, v, l11, l21, l22, power, xe, ye, r, g, b, depth;
};

/// EWA projection of one Gaussian (Zwicker et al. 2001, with gsplat's constants): centre x = R mu + t, derivative J of the projection
/// there,
///   M = J R R_q S (2 x 3),   covariance = M M^T + blur I,   det = |m1 x m2|^2 + blur (|m1|^2 + |m2|^2) + blur^2   (Cauchy-Binet: no
///   cancellation).
/// Behind a lens, where x/z, y/z come to x_d, y_d in the plane z = 1, J is the derivative of both: (fx 0; 0 fy) (dx_d/d(x/z, y/z)) (1 0
/// -x/z; 0 1 -y/z) / z; and what is outside of the lens's disc is not seen.
template <class Mem, bool lensed = false>
struct Projector {
  Gaussians<Mem> cloud;
  SplatWave<Mem> wave;
  RenderOptions options;
  int width, height;

  /// False only if no Gaussian of the cluster can touch the picture. With z > 0, a Gaussian left of the picture would need
  /// fx x + cx z + z r <= 0, r <= 3.34 (fx/z sqrt(1 + limit^2) scale + sqrt(blur)): a half-space in (x, z), asked of the ball around the
  /// centres.
  KOKKOS_FUNCTION bool may_see(GaussianCluster const& c, LinkView const& link, ImageView const& view) const {
    double const x = link.m[0] * c.x + link.m[1] * c.y + link.m[2] * c.z + link.m[3];
    double const y = link.m[4] * c.x + link.m[5] * c.y + link.m[6] * c.z + link.m[7];
    double const z = link.m[8] * c.x + link.m[9] * c.y + link.m[10] * c.z + link.m[11];
    double const radius = 1.001 * c.radius + 1e-6;
    if (!(z + radius >= options.near) || !(z - radius <= options.far)) return false;
    if constexpr (lensed) return may_see_through(c, view, options, width, height, x, y, z, radius);
    double const margin = 3.34 * Kokkos::sqrt(double(options.blur)) + 0.01;
    auto const outside = [&](double f, double across, double before, float low, float high) {
      double const limit = Kokkos::fmax(Kokkos::fabs(double(low)), Kokkos::fabs(double(high)));
      double const reach = 3.34 * f * Kokkos::sqrt(1 + limit * limit) * c.scale * 1.001, n = before + margin;
      return f * across + n * z + reach + radius * Kokkos::sqrt(f * f + n * n) < 0;
    };
    double const fx = Kokkos::fabs(view.fx), fy = Kokkos::fabs(view.fy), sx = view.fx < 0 ? -x : x, sy = view.fy < 0 ? -y : y;
    return !outside(fx, sx, view.cx, view.x_low, view.x_high) && !outside(fx, -sx, width - view.cx, view.x_low, view.x_high) &&
           !outside(fy, sy, view.cy, view.y_low, view.y_high) && !outside(fy, -sy, height - view.cy, view.y_low, view.y_high);
  }

  /// The splats of the Gaussians from i on (one on a GPU, a pack on a CPU), without colour; true where the box of the ellipse meets the
  /// picture.
  template <class T>
  KOKKOS_FUNCTION auto geometry(int i, LinkView const& link, ImageView const& view, SplatOf<T>& s) const -> decltype(T() < T()) {
    using L = Lanes<T>;
    using Wide = typename L::Wide;
    Wide const px = widen(L::load(cloud.positions, 0, i)), py = widen(L::load(cloud.positions, 1, i)),
               pz = widen(L::load(cloud.positions, 2, i));
    Wide const z = px * link.m[8] + (py * link.m[9] + (pz * link.m[10] + link.m[11]));
    s.depth = narrow(z);
    s.power = L::load(cloud.power, i);
    T const reach = s.power + T(splat_log2_255);
    auto seen = s.depth >= T(options.near) && s.depth <= T(options.far) && reach >= T(0.f);
    if (!any_lane(seen)) return seen;
    Wide const x = px * link.m[0] + (py * link.m[1] + (pz * link.m[2] + link.m[3]));
    Wide const y = px * link.m[4] + (py * link.m[5] + (pz * link.m[6] + link.m[7]));
    Wide const inverse = reciprocal(z), xz = x * inverse, yz = y * inverse;
    LensPoint<Wide> at{xz, yz};
    if constexpr (lensed) {
      seen = seen && narrow(xz * xz + yz * yz) <= T(static_cast<float>(view.lens->valid * view.lens->valid));
      if (!any_lane(seen)) return seen;
      at = distorted(*view.lens, xz, yz);
    }
    s.u = narrow(at.x * view.fx + view.cx);
    s.v = narrow(at.y * view.fy + view.cy);

    T sx = clamp(narrow(xz), T(view.x_low), T(view.x_high)), sy = clamp(narrow(yz), T(view.y_low), T(view.y_high));
    LensSlope<T> bent{T(1.f), T(0.f), T(1.f)};
    if constexpr (lensed) {  // the limits' corners may be outside of the disc
      T const valid(static_cast<float>(view.lens->valid)), far = near_sqrt(fma(sx, sx, sy * sy)),
                                                           inward = select(far > valid, valid / far, T(1.f));
      sx = sx * inward;
      sy = sy * inward;
      bent = distortion_slope(*view.lens, sx, sy);
    }
    T const fx = narrow(inverse * view.fx), fy = narrow(inverse * view.fy);
    Mat3<T> const R =
        to_matrix(Quat<T>{L::load(cloud.quats, 0, i), L::load(cloud.quats, 1, i), L::load(cloud.quats, 2, i), L::load(cloud.quats, 3, i)});
    Vec3<T> const S{L::load(cloud.scales, 0, i), L::load(cloud.scales, 1, i), L::load(cloud.scales, 2, i)};
    auto const row = [&](T const& f, T const& slope, int r) {
      T const x0(float(link.m[r])), x1(float(link.m[r + 1])), x2(float(link.m[r + 2])), z0(float(link.m[8])), z1(float(link.m[9])),
          z2(float(link.m[10]));
      Vec3<T> const m = transpose_times(R, Vec3<T>{f * fma(-slope, z0, x0), f * fma(-slope, z1, x1), f * fma(-slope, z2, x2)});
      return Vec3<T>{m.x * S.x, m.y * S.y, m.z * S.z};
    };
    Vec3<T> a = row(fx, sx, 0), b = row(fy, sy, 4);
    if constexpr (lensed) {
      T const across = bent.xy * T(static_cast<float>(view.fx / view.fy)), down = bent.xy * T(static_cast<float>(view.fy / view.fx));
      Vec3<T> const x_row = a, y_row = b;
      for (int k = 0; k < 3; ++k) {
        a[k] = fma(across, y_row[k], bent.xx * x_row[k]);
        b[k] = fma(down, x_row[k], bent.yy * y_row[k]);
      }
    }
    Vec3<T> const n = cross(a, b);
    T const aa = dot(a, a), bb = dot(b, b), xy = dot(a, b), blur(options.blur);
    T const xx = aa + blur, yy = bb + blur, det = fma(blur, xx + bb, dot(n, n));

    constexpr float root_half_log2e = 0.84932180f;  // sqrt(log2(e) / 2)
    T const root = T(root_half_log2e) * inverse_sqrt(det), inverse_root_yy = inverse_sqrt(yy), root_yy = yy * inverse_root_yy;
    s.l11 = root * root_yy;
    s.l21 = -xy * root * inverse_root_yy;
    s.l22 = T(root_half_log2e) * inverse_root_yy;
    T const extent = near_sqrt(max(reach, T(0.f))) * T(1.f / root_half_log2e);
    s.xe = extent * near_sqrt(xx);
    s.ye = extent * root_yy;
    T const pad = fma(T(2e-6f), abs(s.u) + abs(s.v) + s.xe + s.ye, T(2e-3f)), w(static_cast<float>(width) - 0.5f),
            h(static_cast<float>(height) - 0.5f);
    return seen && det > T(0.f) && s.u + s.xe + pad >= T(0.5f) && s.u - s.xe - pad <= w && s.v + s.ye + pad >= T(0.5f) &&
           s.v - s.ye - pad <= h;
  }

  template <class T>
  KOKKOS_FUNCTION void colour(int i, LinkView const& link, SplatOf<T>& s) const {
    using L = Lanes<T>;
    Vec3<T> const d{L::load(cloud.positions, 0, i) - T(link.eye[0]), L::load(cloud.positions, 1, i) - T(link.eye[1]),
                    L::load(cloud.positions, 2, i) - T(link.eye[2])};
    Vec3<T> const c = sh_colour(cloud.sh, cloud.sh_degree, i, cloud.sh_degree > 0 ? normalized(d) : d);
    s.r = c.x;
    s.g = c.y;
    s.b = c.z;
  }

  /// Puts a splat into the pool.
  KOKKOS_FUNCTION void put(std::int64_t to, int image, int i, Splat const& s) const {
    wave.splats(to) = s;
    wave.origins(to) = {image, cloud.source(i), s.depth, count_tiles(s, wave.grid)};
  }
  /// What channels keep of it.
  template <class List>
  KOKKOS_FUNCTION void put_values(List const& channels, std::int64_t to, int image, int body, int i, LinkView const& link) const {
    if constexpr (List::stored > 0) {
      float values[List::stored];
      SeenGaussian<Mem> const seen{cloud, link, wave.splats(to), i, wave.first + image, body, wave.image_views(image), options.blur};
      if constexpr (lensed)
        channels.values(LensedGaussian<Mem>{seen}, values);
      else
        channels.values(seen, values);
      for (int k = 0; k < List::stored; ++k) wave.values(to * List::stored + k) = values[k];
    }
  }
};

}  // namespace gsp::detail
