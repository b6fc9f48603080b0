#pragma once
#include <gsp/core/region.hpp>
#include <gsp/math/quat.hpp>
#include <gsp/parallel/scan.hpp>
#include <gsp/splat/detail/ellipse.hpp>
#include <gsp/splat/detail/spherical_harmonics.hpp>
#include <gsp/splat/project.hpp>

/// Kernels and launches of gsp/splat/project.hpp, where the contract stands.
namespace gsp {

namespace detail {

template <class T>
struct SplatOf {
  T u, v, l11, l21, l22, power, xe, ye, r, g, b, depth;
};

/// EWA projection of one Gaussian (Zwicker et al. 2001, with gsplat's constants): centre x = R mu + t, derivative J of the projection
/// there,
///   M = J R R_q S (2 x 3),   covariance = M M^T + blur I,   det = |m1 x m2|^2 + blur (|m1|^2 + |m2|^2) + blur^2   (Cauchy-Binet: no
///   cancellation).
template <class Mem>
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
    Wide const inverse = Wide(1.) / z, xz = x * inverse, yz = y * inverse;
    s.u = narrow(xz * view.fx + view.cx);
    s.v = narrow(yz * view.fy + view.cy);

    T const sx = clamp(narrow(xz), T(view.x_low), T(view.x_high)), sy = clamp(narrow(yz), T(view.y_low), T(view.y_high));
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
    Vec3<T> const a = row(fx, sx, 0), b = row(fy, sy, 4), n = cross(a, b);
    T const aa = dot(a, a), bb = dot(b, b), xy = dot(a, b), blur(options.blur);
    T const xx = aa + blur, yy = bb + blur, det = fma(blur, xx + bb, dot(n, n));

    T const half_log2e(0.72134752f), root = sqrt(half_log2e / det), root_yy = sqrt(yy);
    s.l11 = root * root_yy;
    s.l21 = -xy * root / root_yy;
    s.l22 = sqrt(half_log2e) / root_yy;
    T const extent = sqrt(max(reach, T(0.f)) / half_log2e);
    s.xe = extent * sqrt(xx);
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
    Vec3<T> const c = sh_colour(cloud.sh, cloud.sh_degree, i, normalized(d));
    s.r = c.x;
    s.g = c.y;
    s.b = c.z;
  }

  /// Puts a splat into the pool, with its key (image, depth, source) and the number of tiles that it touches (0: none after all).
  KOKKOS_FUNCTION void put(std::int64_t to, int image, int i, Splat const& s) const {
    wave.splats(to) = s;
    wave.splat_tiles(to) = count_tiles(s, width, height);
    wave.order(to) = static_cast<int>(to);
    wave.order_keys(to) = (static_cast<std::uint64_t>(image) << 32 | Kokkos::bit_cast<std::uint32_t>(s.depth)) << wave.index_bits |
                          static_cast<std::uint64_t>(cloud.source(i));
  }
  /// What channels keep of it.
  template <class List>
  KOKKOS_FUNCTION void put_values(List const& channels, std::int64_t to, int image, int body, int i, LinkView const& link) const {
    if constexpr (List::stored > 0) {
      float values[List::stored];
      channels.values(SeenGaussian<Mem>{cloud, link, wave.splats(to), i, wave.first + image, body}, values);
      for (int k = 0; k < List::stored; ++k) wave.values(to * List::stored + k) = values[k];
    }
  }
  /// A place that stayed free: counting and filling are compiled apart and may round the edge of the picture apart, where nothing is drawn
  /// anyway.
  KOKKOS_FUNCTION void put_nothing(std::int64_t to, int image) const {
    wave.splat_tiles(to) = 0;
    wave.order(to) = static_cast<int>(to);
    wave.order_keys(to) = static_cast<std::uint64_t>(image) << 32 << wave.index_bits;
  }
};

/// Pass 1 (fill = false): how many Gaussians of each cluster are seen. Pass 2: writes them, in order. A cluster a team (GPU).
template <class Mem, bool fill, class List>
struct ProjectClusters {
  Projector<Mem> p;
  int clusters;
  List channels;

  template <class Member>
  KOKKOS_FUNCTION void operator()(Member const& team) const {
    auto const& wave = p.wave;
    int const index = team.league_rank(), image = index / clusters;
    if (fill && (wave.visible() == 0 || wave.cluster_visible(index) == 0)) return;
    GaussianCluster const cluster = p.cloud.clusters(index % clusters);
    LinkView const& link = wave.link_views(image, cluster.body);
    ImageView const& view = wave.image_views(image);
    if (!fill && !p.may_see(cluster, link, view)) {
      Kokkos::single(Kokkos::PerTeam(team), [&] { wave.cluster_visible(index) = 0; });
      return;
    }
    int found = 0;
    std::int64_t offset = 0, end = 0;
    if constexpr (fill) {
      offset = wave.cluster_offset(index);
      end = wave.cluster_offset(index + 1);
    }
    for (int base = cluster.begin; base < cluster.end; base += team.team_size()) {
      int const i = base + team.team_rank();
      SplatOf<float> s;
      bool const seen = i < cluster.end && p.geometry(i, link, view, s);
      if constexpr (fill) {
        int const rank = team.team_scan(int(seen));
        int total = rank + seen;
        team.team_broadcast(total, team.team_size() - 1);
        if (seen && offset + rank < end) {
          p.colour(i, link, s);
          p.put(offset + rank, image, i, {s.u, s.v, s.l11, s.l21, s.l22, s.power, s.xe, s.ye, s.r, s.g, s.b, s.depth});
          p.put_values(channels, offset + rank, image, cluster.body, i, link);
        }
        offset += total;
      } else {
        found += seen;
      }
    }
    if constexpr (fill) {
      for (std::int64_t to = offset + team.team_rank(); to < end; to += team.team_size()) p.put_nothing(to, image);
    } else {
      team.team_reduce(Kokkos::Sum<int>(found));
      Kokkos::single(Kokkos::PerTeam(team), [&] { wave.cluster_visible(index) = found; });
    }
  }
};

/// The same on a CPU: a cluster a task, a pack of Gaussians at a time.
template <class Mem, bool fill, class List>
struct ProjectPacks {
  Projector<Mem> p;
  int clusters;
  List channels;
  static constexpr int W = native_width<float>;
  using T = Pack<float, W>;

  void operator()(int index) const {
    auto const& wave = p.wave;
    int const image = index / clusters;
    if (fill && (wave.visible() == 0 || wave.cluster_visible(index) == 0)) return;
    GaussianCluster const& cluster = p.cloud.clusters(index % clusters);
    LinkView const& link = wave.link_views(image, cluster.body);
    ImageView const& view = wave.image_views(image);
    if (!fill && !p.may_see(cluster, link, view)) {
      wave.cluster_visible(index) = 0;
      return;
    }
    int found = 0;
    std::int64_t offset = 0, end = 0;
    if constexpr (fill) {
      offset = wave.cluster_offset(index);
      end = wave.cluster_offset(index + 1);
    }
    for (int base = cluster.begin; base < cluster.end; base += W) {
      SplatOf<T> s;
      auto const seen = p.geometry(base, link, view, s);
      if (!any_lane(seen)) continue;
      int const lanes = cluster.end - base < W ? cluster.end - base : W;
      if constexpr (fill) {
        p.colour(base, link, s);
        for (int k = 0; k < lanes; ++k)
          if (seen[k] && offset < end) {
            p.put(offset, image, base + k,
                  {s.u[k], s.v[k], s.l11[k], s.l21[k], s.l22[k], s.power[k], s.xe[k], s.ye[k], s.r[k], s.g[k], s.b[k], s.depth[k]});
            p.put_values(channels, offset, image, cluster.body, base + k, link);
            ++offset;
          }
      } else {
        for (int k = 0; k < lanes; ++k) found += seen[k];
      }
    }
    if constexpr (fill)
      for (; offset < end; ++offset) p.put_nothing(offset, image);
    else
      wave.cluster_visible(index) = found;
  }
};

/// Do they fit? If not, the wave is left out: its images are marked, later stages find nothing to do.
template <class Mem>
struct SettleVisible {
  SplatWave<Mem> wave;
  Kokkos::View<std::uint32_t*, Kokkos::LayoutRight, Mem> status;
  int cells;
  KOKKOS_FUNCTION void operator()(int) const {
    std::int64_t const visible = wave.cluster_offset(cells);
    bool const fits = visible <= wave.visible_capacity;
    wave.visible() = fits ? visible : 0;
    wave.needed(0) = visible > wave.needed(0) ? visible : wave.needed(0);
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

template <ExecutionSpace Exec, class Mem, class... Channels>
void project(Exec const& exec, Gaussians<Mem> const& cloud, Frames<Mem>& frames, RenderOptions options, Channels const&... channels) {
  Region const region("gsp::splat::project");
  static_assert(can_access<Exec, Frames<Mem>>, "gsp::project: the frames are not accessible from this execution space");
  expects(options.near > 0 && options.far > options.near, "gsp::project: 0 < near < far must hold");
  expects(options.blur >= 0 && options.alpha_max > 0 && options.alpha_max < 1 && options.stop >= 0 && options.stop < 1,
          "gsp::project: blur must be >= 0, alpha_max and stop between 0 and 1");
  auto const list = detail::channel_list(channels...);
  using List = std::remove_const_t<decltype(list)>;
  detail::check_values<List>("gsp::project", frames);
  auto const& wave = frames.wave;
  int const clusters = static_cast<int>(cloud.clusters.extent(0)), cells = wave.images * clusters;
  detail::Projector<Mem> const projector{cloud, wave, options, frames.width, frames.height};
  auto const pass = [&](char const* label, auto const& teams, auto const& packs) {
    if constexpr (is_device<Exec>)
      Kokkos::parallel_for(label, lightweight(Kokkos::TeamPolicy<Exec>(exec, cells, 128)), teams);
    else
      Kokkos::parallel_for(label, Kokkos::RangePolicy<Exec, Kokkos::Schedule<Kokkos::Dynamic>>(exec, 0, cells, Kokkos::ChunkSize(8)),
                           packs);
  };
  pass("gsp::splat::project_count", detail::ProjectClusters<Mem, false, detail::ChannelList<>>{projector, clusters, {}},
       detail::ProjectPacks<Mem, false, detail::ChannelList<>>{projector, clusters, {}});
  using Offsets = Kokkos::View<std::int64_t*, Kokkos::LayoutRight, Mem>;
  Offsets offsets(wave.cluster_offset, Kokkos::make_pair(0, cells + 1));
  exclusive_scan(exec, detail::Head<Kokkos::View<int*, Kokkos::LayoutRight, Mem>>{wave.cluster_visible, cells}, offsets);
  Kokkos::parallel_for("gsp::splat::project_settle", lightweight(Kokkos::RangePolicy<Exec>(exec, 0, 1)),
                       detail::SettleVisible<Mem>{wave, frames.status, cells});
  pass("gsp::splat::project", detail::ProjectClusters<Mem, true, List>{projector, clusters, list},
       detail::ProjectPacks<Mem, true, List>{projector, clusters, list});
}

}  // namespace gsp
