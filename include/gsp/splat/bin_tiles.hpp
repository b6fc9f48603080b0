#pragma once
#include <bit>
#include <gsp/core/region.hpp>
#include <gsp/splat/detail/bin_tiles_kernels.hpp>
#if defined(KOKKOS_ENABLE_CUDA) && defined(__CUDACC__)
#include <gsp/splat/detail/list_pairs_cuda.hpp>
#include <gsp/splat/detail/sort_tiles_cuda.hpp>
#endif

namespace gsp {

/// Third stage: for each tile of each image of the wave, the splats that touch it, front to back (equal depths by source index).
/// A CPU puts the splats in the order of (image, source), sorts them by depth, lets them emit their tiles in that order, and sorts the
/// pairs by tile; both sorts are stable, so the second needs no depth and the first neither image nor source: far fewer bytes than one sort
/// of pairs by all of them. A GPU counts the pairs of each tile, puts them down tile by tile, and a block sorts each list in its own
/// memory.
/// @param frames  in: project's splats.   out: wave.tile_splats, tile_begin (image x tiles + tile), pairs, block_masks; status as in
/// project. Neither allocates nor fences. Cost: CPU: visible x 4 and pairs x (bits of image, tile) / 8 radix passes; GPU: pairs x 4.
template <ExecutionSpace Exec, class Mem>
void bin_tiles(Exec const& exec, Frames<Mem>& frames) {
  Region const region("gsp::splat::bin_tiles");
  static_assert(can_access<Exec, Frames<Mem>>, "gsp::bin_tiles: the frames are not accessible from this execution space");
  auto& wave = frames.wave;
  using Range = Kokkos::RangePolicy<Exec, Kokkos::IndexType<std::int64_t>>;
  int const tiles = wave.images * wave.tiles();
  if constexpr (is_device<Exec>) {
#if defined(KOKKOS_ENABLE_CUDA) && defined(__CUDACC__)
    Kokkos::parallel_for("gsp::splat::bin_tiles_begin", lightweight(Kokkos::RangePolicy<Exec>(exec, 0, tiles)),
                         detail::BeginLists<Mem>{wave});
    detail::list_pairs_on_cuda(exec, wave);
    detail::begin_tiles_on_cuda(exec, wave, frames.status);
    detail::place_pairs_on_cuda(exec, wave);
    detail::sort_tiles_on_cuda(exec, wave);
#else
    static_assert(!is_device<Exec>, "gsp::bin_tiles: pictures are drawn on CPUs and on CUDA GPUs; compile with nvcc for CUDA");
#endif
  } else {
    std::int64_t const words = std::int64_t(wave.images) * wave.words;
    Kokkos::View<int*, Kokkos::LayoutRight, Mem> seen_before(wave.seen_before, Kokkos::make_pair(std::int64_t(0), words + 1));
    exclusive_scan(exec, detail::SeenOfWord<Mem>{wave}, seen_before, ScanScratch<Mem>{});
    Kokkos::parallel_for("gsp::splat::bin_tiles_rank", lightweight(Range(exec, 0, wave.visible_capacity)), detail::RankSplats<Mem>{wave});
    sort_by_key(exec, wave.depth_keys, wave.order, wave.order_scratch, wave.visible);
    exclusive_scan(exec, detail::OrderedTiles<Mem>{wave}, wave.pair_offset, ScanScratch<Mem>{});
    Kokkos::parallel_for("gsp::splat::bin_tiles_settle", lightweight(Kokkos::RangePolicy<Exec>(exec, 0, 1)),
                         detail::SettlePairs<Mem>{wave, frames.status});
    std::uint32_t const pad = static_cast<std::uint32_t>(tiles);
    // behind what is visible a capacity is empty
    using Dynamic = Kokkos::RangePolicy<Exec, Kokkos::Schedule<Kokkos::Dynamic>, Kokkos::IndexType<std::int64_t>>;
    Kokkos::parallel_for("gsp::splat::bin_tiles_emit", Dynamic(exec, 0, wave.visible_capacity, Kokkos::ChunkSize(1024)),
                         detail::EmitPairs<Mem>{wave, pad});
    sort_by_key(exec, wave.tile_keys, wave.tile_splats, wave.tile_scratch, wave.pairs, {.bits = static_cast<int>(std::bit_width(pad))});
    Kokkos::parallel_for("gsp::splat::bin_tiles_begins", lightweight(Range(exec, 0, std::int64_t(pad) + 1)), detail::TileBegins<Mem>{wave});
  }
}

}  // namespace gsp
