#pragma once
#include <gsp/math/quat.hpp>
#include <gsp/parallel/scan.hpp>
#include <gsp/splat/detail/ellipse.hpp>
#include <gsp/splat/detail/spherical_harmonics.hpp>
#include <gsp/splat/frames.hpp>

namespace gsp {

/// Constants of the picture; the defaults are those of gsplat 1.5.3.
struct RenderOptions {
  float near = 0.01f, far = 1e10f;  // camera z outside is not seen [m]
  float blur = 0.3f;                // added to both variances of a splat [pixel^2]
  float alpha_max = 0.999f;         // an alpha is at most this
  float stop = 1e-4f;               // a pixel is done before the Gaussian that would leave no more light than this
};

namespace detail {

/// EWA projection of one Gaussian (Zwicker et al. 2001, with gsplat's constants): centre x = R mu + t, derivative J of the projection there,
///   M = J R R_q S (2 x 3),   covariance = M M^T + blur I,   det = |m1 x m2|^2 + blur (|m1|^2 + |m2|^2) + blur^2   (Cauchy-Binet: no cancellation).
template <class Mem>
struct Projector {
  Gaussians<Mem> cloud;
  SplatWave<Mem> wave;
  RenderOptions options;
  int width, height;

  /// False only if no Gaussian of the cluster can touch the picture. With z > 0, a Gaussian left of the picture would need
  /// fx x + cx z + z r <= 0, r <= 3.34 (fx/z sqrt(1 + limit^2) scale + sqrt(blur)): a half-space in (x, z), asked of the ball around the centres.
  KOKKOS_FUNCTION bool may_see(GaussianCluster const& c, LinkView const& link, ImageView const& view) const {
    double const x = link.m[0] * c.x + link.m[1] * c.y + link.m[2] * c.z + link.m[3];
    double const y = link.m[4] * c.x + link.m[5] * c.y + link.m[6] * c.z + link.m[7];
    double const z = link.m[8] * c.x + link.m[9] * c.y + link.m[10] * c.z + link.m[11];
    double const radius = 1.001 * c.radius + 1e-6;
    if (!(z + radius >= options.near) || !(z - radius <= options.far)) return false;
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

  /// The splat of Gaussian i without its colour; false where it is not seen.
  KOKKOS_FUNCTION bool geometry(int i, LinkView const& link, ImageView const& view, Splat& s) const {
    double const px = cloud.positions(0, i), py = cloud.positions(1, i), pz = cloud.positions(2, i);
    double const z = fma(link.m[8], px, fma(link.m[9], py, fma(link.m[10], pz, link.m[11])));
    s.depth = static_cast<float>(z);
    if (!(s.depth >= options.near && s.depth <= options.far)) return false;
    float const opacity = cloud.opacities(i);
    if (!(opacity >= 1.f / 255.f)) return false;
    double const x = fma(link.m[0], px, fma(link.m[1], py, fma(link.m[2], pz, link.m[3])));
    double const y = fma(link.m[4], px, fma(link.m[5], py, fma(link.m[6], pz, link.m[7])));
    double const inverse = 1. / z, xz = x * inverse, yz = y * inverse;
    s.u = static_cast<float>(fma(view.fx, xz, view.cx)), s.v = static_cast<float>(fma(view.fy, yz, view.cy));

    float const sx = clamp(static_cast<float>(xz), view.x_low, view.x_high), sy = clamp(static_cast<float>(yz), view.y_low, view.y_high);
    float const fx = static_cast<float>(view.fx * inverse), fy = static_cast<float>(view.fy * inverse);
    Vec3<float> const r0{float(link.m[0]), float(link.m[1]), float(link.m[2])}, r1{float(link.m[4]), float(link.m[5]), float(link.m[6])},
        r2{float(link.m[8]), float(link.m[9]), float(link.m[10])};
    Mat3<float> const R = to_matrix(Quat<float>{cloud.quats(0, i), cloud.quats(1, i), cloud.quats(2, i), cloud.quats(3, i)});
    auto const row = [&](float f, float slope, Vec3<float> const& r) {
      Vec3<float> const m = transpose_times(R, f * fma(-slope, r2, r));
      return Vec3<float>{m.x * cloud.scales(0, i), m.y * cloud.scales(1, i), m.z * cloud.scales(2, i)};
    };
    Vec3<float> const a = row(fx, sx, r0), b = row(fy, sy, r1), n = cross(a, b);
    float const aa = dot(a, a), bb = dot(b, b), xy = dot(a, b), blur = options.blur;
    float const det = fma(blur, aa + bb + blur, dot(n, n)), xx = aa + blur, yy = bb + blur;
    if (!(det > 0.f)) return false;

    constexpr float half_log2e = 0.72134752f;
    s.power = Kokkos::log2(opacity);
    float const reach = max(0.f, s.power + splat_log2_255);
    s.l11 = Kokkos::sqrt(half_log2e * yy / det);
    s.l21 = -xy * Kokkos::sqrt(half_log2e / det) / Kokkos::sqrt(yy);
    s.l22 = Kokkos::sqrt(half_log2e / yy);
    s.xe = Kokkos::sqrt(reach * xx / half_log2e), s.ye = Kokkos::sqrt(reach * yy / half_log2e);
    return true;
  }

  KOKKOS_FUNCTION void colour(int i, LinkView const& link, Splat& s) const {
    Vec3<float> const d{cloud.positions(0, i) - link.eye[0], cloud.positions(1, i) - link.eye[1], cloud.positions(2, i) - link.eye[2]};
    Vec3<float> const c = sh_colour(cloud.sh, cloud.sh_degree, i, normalized(d));
    s.r = c.x, s.g = c.y, s.b = c.z;
  }
};

/// Pass 1 (fill = false): how many Gaussians of each cluster are seen, and how many tiles they touch. Pass 2: writes them, in order.
template <class Mem, bool fill>
struct ProjectClusters {
  Projector<Mem> p;
  int clusters;

  template <class Member>
  KOKKOS_FUNCTION void operator()(Member const& team) const {
    auto const& wave = p.wave;
    int const index = team.league_rank(), image = index / clusters;
    if (fill && (wave.visible() == 0 || wave.cluster_visible(index) == 0)) return;
    GaussianCluster const cluster = p.cloud.clusters(index % clusters);
    LinkView const& link = wave.link_views(image, cluster.body);
    ImageView const& view = wave.image_views(image);
    if (!fill && !p.may_see(cluster, link, view)) {
      Kokkos::single(Kokkos::PerTeam(team), [&] { wave.cluster_visible(index) = wave.cluster_pairs(index) = 0; });
      return;
    }
    int found = 0, pairs = 0;
    std::int64_t offset = fill ? wave.cluster_offset(index) : 0;
    for (int base = cluster.begin; base < cluster.end; base += team.team_size()) {
      int const i = base + team.team_rank();
      Splat s;
      int const tiles = i < cluster.end && p.geometry(i, link, view, s) ? count_tiles(s, p.width, p.height) : 0;
      if constexpr (fill) {
        int const seen = tiles > 0, rank = team.team_scan(seen);
        int total = rank + seen;
        team.team_broadcast(total, team.team_size() - 1);
        if (seen) {
          std::int64_t const to = offset + rank;
          p.colour(i, link, s);
          wave.splats(to) = s;
          wave.splat_tiles(to) = tiles;
          wave.order(to) = static_cast<int>(to);
          wave.order_keys(to) = (static_cast<std::uint64_t>(image) << 32 | Kokkos::bit_cast<std::uint32_t>(s.depth)) << wave.index_bits |
                                static_cast<std::uint64_t>(p.cloud.source(i));
        }
        offset += total;
      } else {
        found += tiles > 0, pairs += tiles;
      }
    }
    if constexpr (!fill) {
      team.team_reduce(Kokkos::Sum<int>(found));
      team.team_reduce(Kokkos::Sum<int>(pairs));
      Kokkos::single(Kokkos::PerTeam(team), [&] { wave.cluster_visible(index) = found, wave.cluster_pairs(index) = pairs; });
    }
  }
};

template <class Mem>
struct SumPairs {
  SplatWave<Mem> wave;
  KOKKOS_FUNCTION void operator()(int i, std::int64_t& sum) const { sum += wave.cluster_pairs(i); }
};

/// Do they fit? If not, the wave is left out: its images are marked, later stages find nothing to do.
template <class Mem>
struct Settle {
  SplatWave<Mem> wave;
  Kokkos::View<std::uint32_t*, Kokkos::LayoutRight, Mem> status;
  int cells;
  KOKKOS_FUNCTION void operator()(int) const {
    std::int64_t const visible = wave.cluster_offset(cells), pairs = wave.pairs_needed();
    bool const fits = visible <= wave.visible_capacity && pairs <= wave.pair_capacity;
    wave.visible() = fits ? visible : 0;
    wave.pairs() = fits ? pairs : 0;
    wave.needed(0) = visible > wave.needed(0) ? visible : wave.needed(0);
    wave.needed(1) = pairs > wave.needed(1) ? pairs : wave.needed(1);
    for (int k = 0; k < wave.images; ++k) {
      std::uint32_t const old = status(wave.first + k);
      status(wave.first + k) = fits ? old & ~frame_overflow : old | frame_overflow;
    }
  }
};

/// A scan's input over a wave's first cells only.
template <class View>
struct Head {
  View view;
  std::int64_t n;
  KOKKOS_FUNCTION auto operator()(std::int64_t i) const { return view(i); }
  KOKKOS_FUNCTION std::int64_t extent(int) const { return n; }
};

}  // namespace detail

/// Second stage: the Gaussians that the wave's cameras see, as splats. Culls clusters against the picture, then projects, twice: once to count,
/// once to write, so that places in the pool follow from a sum and not from who came first.
/// @param frames  in: place_gaussians' views.   out: wave.splats, splat_tiles, order, order_keys (image, depth, source), visible, pairs;
///                status(c) = frame_overflow where the buffers are too small (then the wave is empty)
/// Neither allocates nor fences.
template <ExecutionSpace Exec, class Mem>
void project(Exec const& exec, Gaussians<Mem> const& cloud, Frames<Mem> const& frames, RenderOptions options = {}) {
  static_assert(can_access<Exec, Frames<Mem>>, "gsp::project: the frames are not accessible from this execution space");
  expects(options.near > 0 && options.far > options.near, "gsp::project: 0 < near < far must hold");
  expects(options.blur >= 0 && options.alpha_max > 0 && options.alpha_max < 1 && options.stop >= 0 && options.stop < 1,
          "gsp::project: blur must be >= 0, alpha_max and stop between 0 and 1");
  auto const& wave = frames.wave;
  int const clusters = static_cast<int>(cloud.clusters.extent(0)), cells = wave.images * clusters;
  detail::Projector<Mem> const projector{cloud, wave, options, frames.width, frames.height};
  Kokkos::TeamPolicy<Exec> const policy(exec, cells, is_device<Exec> ? 128 : 1);
  Kokkos::parallel_for("gsp::splat::project_count", policy, detail::ProjectClusters<Mem, false>{projector, clusters});
  using Offsets = Kokkos::View<std::int64_t*, Kokkos::LayoutRight, Mem>;
  exclusive_scan(exec, detail::Head<Kokkos::View<int*, Kokkos::LayoutRight, Mem>>{wave.cluster_visible, cells},
                 Offsets(wave.cluster_offset, Kokkos::make_pair(0, cells + 1)));
  Kokkos::parallel_reduce("gsp::splat::project_pairs", Kokkos::RangePolicy<Exec>(exec, 0, cells), detail::SumPairs<Mem>{wave}, wave.pairs_needed);
  Kokkos::parallel_for("gsp::splat::project_settle", Kokkos::RangePolicy<Exec>(exec, 0, 1), detail::Settle<Mem>{wave, frames.status, cells});
  Kokkos::parallel_for("gsp::splat::project", policy, detail::ProjectClusters<Mem, true>{projector, clusters});
}

}  // namespace gsp
