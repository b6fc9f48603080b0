#pragma once
#include <gsp/core/region.hpp>
#include <gsp/splat/detail/projector.hpp>
#include <gsp/splat/project.hpp>
#if defined(KOKKOS_ENABLE_CUDA) && defined(__CUDACC__)
#include <gsp/splat/detail/project_cuda.hpp>
#endif

/// Kernels and launches of gsp/splat/project.hpp, where the contract stands.
namespace gsp {

namespace detail {

/// Before: nothing has been seen; and, on a GPU, which clusters an image may see.
template <class Mem, bool device, bool lensed>
struct BeginProjection {
  Projector<Mem, lensed> p;
  int clusters;
  Kokkos::View<std::uint32_t*, Kokkos::LayoutRight, Mem> status;
  KOKKOS_FUNCTION void operator()(int index) const {
    auto const& wave = p.wave;
    if (index == 0) wave.visible() = 0;
    if (index < wave.images) status(wave.first + index) &= ~frame_overflow;
    if constexpr (device) {
      if (index >= wave.images * clusters) return;
      int const image = index / clusters, k = index % clusters, at = p.cloud.cluster_of(wave.image_views(image).world, k);
      bool seen = at >= 0;
      if (seen) {
        GaussianCluster const& cluster = p.cloud.clusters(at);
        seen = p.may_see(cluster, wave.link_views(image, cluster.body), wave.image_views(image));
      }
      wave.cluster_seen(image, k) = seen;
    } else if (index < wave.images * wave.words) {
      wave.seen(index / wave.words, index % wave.words) = 0;
    }
  }
};

/// The splats of a cluster, a pack of Gaussians at a time (CPU).
template <class Mem, class List, bool lensed>
struct ProjectPacks {
  Projector<Mem, lensed> p;
  int clusters;
  List channels;
  static constexpr int W = native_width<float>, most = Gaussians<Mem>::cluster_size;
  using T = Pack<float, W>;

  void operator()(int index) const {
    auto const& wave = p.wave;
    int const image = index / clusters;
    ImageView const& view = wave.image_views(image);
    int const at = p.cloud.cluster_of(view.world, index % clusters);
    if (at < 0) return;
    GaussianCluster const& cluster = p.cloud.clusters(at);
    LinkView const& link = wave.link_views(image, cluster.body);
    if (!p.may_see(cluster, link, view)) return;
    Splat splats[most];
    int places[most], found = 0;
    for (int base = cluster.begin; base < cluster.end; base += W) {
      SplatOf<T> s;
      auto const seen = p.geometry(base, link, view, s);
      if (!any_lane(seen)) continue;
      p.colour(base, link, s);
      int const lanes = cluster.end - base < W ? cluster.end - base : W;
      for (int k = 0; k < lanes; ++k)
        if (seen[k]) {
          splats[found] = {s.u[k], s.v[k], s.l11[k], s.l21[k], s.l22[k], s.power[k], s.xe[k], s.ye[k], s.r[k], s.g[k], s.b[k], s.depth[k]};
          places[found++] = base + k;
        }
    }
    if (found == 0) return;
    std::int64_t const to = Kokkos::atomic_fetch_add(&wave.visible(), std::int64_t(found));
    for (int k = 0; k < found && to + k < wave.visible_capacity; ++k) {
      p.put(to + k, image, places[k], splats[k]);
      int const source = wave.origins(to + k).source;
      Kokkos::atomic_or(&wave.seen(image, source / 32), std::uint32_t(1) << source % 32);
      p.put_values(channels, to + k, image, cluster.body, places[k], link);
    }
  }
};

/// Do they fit? If not, the wave is left out: its images are marked, later stages find nothing to do.
template <class Mem>
struct SettleVisible {
  SplatWave<Mem> wave;
  Kokkos::View<std::uint32_t*, Kokkos::LayoutRight, Mem> status;
  KOKKOS_FUNCTION void operator()(int) const {
    std::int64_t const visible = wave.visible();
    bool const fits = visible <= wave.visible_capacity;
    wave.visible() = fits ? visible : 0;
    wave.needed(0) = visible > wave.needed(0) ? visible : wave.needed(0);
    if (!fits)
      for (int k = 0; k < wave.images; ++k) status(wave.first + k) |= frame_overflow;
  }
};

/// The launches, for a wave with lenses and one without.
template <bool lensed, class Exec, class Mem, class List>
void launch_projection(Exec const& exec, Gaussians<Mem> const& cloud, Frames<Mem> const& frames, RenderOptions const& options, int cells,
                       List const& list) {
  auto const& wave = frames.wave;
  int const clusters = cloud.most_clusters, beginnings = std::max(wave.images, is_device<Exec> ? cells : wave.images * wave.words);
  Projector<Mem, lensed> const projector{cloud, wave, options, frames.width, frames.height};
  Kokkos::parallel_for("gsp::splat::project_begin", lightweight(Kokkos::RangePolicy<Exec>(exec, 0, beginnings)),
                       BeginProjection<Mem, is_device<Exec>, lensed>{projector, clusters, frames.status});
  if constexpr (is_device<Exec>) {
#if defined(KOKKOS_ENABLE_CUDA) && defined(__CUDACC__)
    project_on_cuda(exec, ProjectClusters<Mem, List, lensed>{projector, clusters, cells, list});
#else
    static_assert(!is_device<Exec>, "gsp::project: pictures are drawn on CPUs and on CUDA GPUs; compile with nvcc for CUDA");
#endif
  } else {
    Kokkos::parallel_for("gsp::splat::project",
                         Kokkos::RangePolicy<Exec, Kokkos::Schedule<Kokkos::Dynamic>>(exec, 0, cells, Kokkos::ChunkSize(8)),
                         ProjectPacks<Mem, List, lensed>{projector, clusters, list});
  }
}

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
  int const cells = wave.images * cloud.most_clusters;
  if (wave.lenses.extent(0) > 0)
    detail::launch_projection<true>(exec, cloud, frames, options, cells, list);
  else
    detail::launch_projection<false>(exec, cloud, frames, options, cells, list);
  Kokkos::parallel_for("gsp::splat::project_settle", lightweight(Kokkos::RangePolicy<Exec>(exec, 0, 1)),
                       detail::SettleVisible<Mem>{wave, frames.status});
}

}  // namespace gsp
