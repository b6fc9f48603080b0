#pragma once
#include <gsp/parallel/detail/launch_cuda.hpp>
#include <gsp/splat/detail/projector.hpp>

namespace gsp::detail {

/// The splats of a cluster, a Gaussian a thread: those that are seen take neighbouring places in the pool, which the block asks for once.
template <class Mem, class List, bool lensed>
struct ProjectClusters {
  Projector<Mem, lensed> p;
  int clusters, cells;  // that an image shows at most; of the wave
  List channels;

  static constexpr int threads = Gaussians<Mem>::cluster_size, warps = threads / 32;
  struct Places {
    int of_warp[warps];
    std::int64_t first;
  };

  /// Most clusters are not seen, so a block takes one after the other: blocks that end at once would cost as much as they do.
  static constexpr int most_blocks = 1 << 15;
  __device__ void operator()(Places& places) const {
    for (std::int64_t cell = blockIdx.x; cell < cells; cell += gridDim.x) {
      int const image = int(cell) / clusters, k = int(cell) % clusters;
      if (!p.wave.cluster_seen(image, k)) continue;
      cluster(places, image, p.cloud.cluster_of(p.wave.image_views(image).world, k));
      __syncthreads();
    }
  }

 private:
  __device__ void cluster(Places& places, int image, int k) const {
    auto const& wave = p.wave;
    GaussianCluster const& of = p.cloud.clusters(k);
    LinkView const& link = wave.link_views(image, of.body);
    int const warp = int(threadIdx.x) / 32, lane = int(threadIdx.x) % 32, i = of.begin + int(threadIdx.x);
    SplatOf<float> s;
    bool const seen = i < of.end && p.geometry(i, link, wave.image_views(image), s);
    unsigned const word = __ballot_sync(0xffffffffu, seen);
    if (lane == 0) places.of_warp[warp] = __popc(word);
    __syncthreads();
    if (threadIdx.x == 0) {
      int sum = 0;
      for (int& n : places.of_warp) {
        int const own = n;
        n = sum;
        sum += own;
      }
      if (sum > 0)
        places.first =
            std::int64_t(atomicAdd(reinterpret_cast<unsigned long long*>(&wave.visible()), static_cast<unsigned long long>(sum)));
    }
    __syncthreads();
    std::int64_t const to = places.first + places.of_warp[warp] + __popc(word & ((1u << lane) - 1u));
    if (!seen || to >= wave.visible_capacity) return;
    p.colour(i, link, s);
    p.put(to, image, i, {s.u, s.v, s.l11, s.l21, s.l22, s.power, s.xe, s.ye, s.r, s.g, s.b, s.depth});
    p.put_values(channels, to, image, of.body, i, link);
  }
};

template <class Clusters>
__global__ void __launch_bounds__(Clusters::threads) project_clusters_kernel(Clusters const __grid_constant__ clusters) {
  __shared__ typename Clusters::Places places;
  clusters(places);
}
template <class Clusters>
void project_on_cuda(Kokkos::Cuda const& exec, Clusters const& clusters) {
  if (clusters.cells == 0) return;
  unsigned const blocks = unsigned(clusters.cells < Clusters::most_blocks ? clusters.cells : Clusters::most_blocks);
  launch_on_cuda("gsp::splat::project", exec,
                 [&](cudaStream_t stream) { project_clusters_kernel<<<blocks, Clusters::threads, 0, stream>>>(clusters); });
}

}  // namespace gsp::detail
