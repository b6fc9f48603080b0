#pragma once
#include <gsp/core/region.hpp>
#include <gsp/parallel/scan.hpp>
#include <gsp/parallel/sort_by_key.hpp>
#include <gsp/splat/detail/bin_tiles_kernels.hpp>
#include <gsp/splat/detail/ellipse.hpp>
#include <gsp/splat/frames.hpp>

namespace gsp {

/// Third stage: for each tile of each image of the wave, the splats that touch it, front to back (equal depths by source index).
/// Sorts the splats by (image, depth), lets them emit their tiles in that order, and sorts the pairs by tile alone, stably: far fewer bytes
/// than one sort of pairs by (tile, depth).
/// @param frames  in: project's splats.   out: wave.tile_splats, tile_begin (image x tiles + tile), pairs; status as in project
/// Neither allocates nor fences. Cost: visible x (bits of image, depth, index) / 8 and pairs x (bits of image, tile) / 8 radix passes.
template <ExecutionSpace Exec, class Mem>
void bin_tiles(Exec const& exec, Frames<Mem>& frames) {
  Region const region("gsp::splat::bin_tiles");
  static_assert(can_access<Exec, Frames<Mem>>, "gsp::bin_tiles: the frames are not accessible from this execution space");
  auto& wave = frames.wave;
  using Range = Kokkos::RangePolicy<Exec, Kokkos::IndexType<std::int64_t>>;
  std::uint32_t const tile_pad = static_cast<std::uint32_t>(wave.images * wave.tiles());
  int const image_bits = std::bit_width(static_cast<unsigned>(wave.images)), tile_bits = std::bit_width(tile_pad);
  if constexpr (is_device<Exec>) {
    std::uint64_t const pad = ((static_cast<std::uint64_t>(wave.images) + 1) << (32 + wave.index_bits)) - 1;
    Kokkos::parallel_for("gsp::splat::bin_tiles_pad", lightweight(Range(exec, 0, wave.visible_capacity)),
                         detail::PadKeys<std::uint64_t, Mem>{wave.order_keys, wave.visible, pad});
  }
  sort_by_key(exec, wave.order_keys, wave.order, wave.order_scratch, wave.visible,
              {.bits = std::min(64, 32 + wave.index_bits + image_bits)});
  exclusive_scan(exec, detail::OrderedTiles<Mem>{wave}, wave.pair_offset);
  Kokkos::parallel_for("gsp::splat::bin_tiles_settle", lightweight(Kokkos::RangePolicy<Exec>(exec, 0, 1)),
                       detail::SettlePairs<Mem>{wave, frames.status});
  if constexpr (is_device<Exec>)
    Kokkos::parallel_for("gsp::splat::bin_tiles_pad", lightweight(Range(exec, 0, wave.pair_capacity)),
                         detail::PadKeys<std::uint32_t, Mem>{wave.tile_keys, wave.pairs, tile_pad});
  Kokkos::parallel_for("gsp::splat::bin_tiles_emit", lightweight(Range(exec, 0, wave.visible_capacity)),
                       detail::EmitPairs<Mem>{wave, frames.width, frames.height, tile_pad});
  sort_by_key(exec, wave.tile_keys, wave.tile_splats, wave.tile_scratch, wave.pairs, {.bits = tile_bits});
  Kokkos::parallel_for("gsp::splat::bin_tiles_begins", lightweight(Range(exec, 0, std::int64_t(tile_pad) + 1)),
                       detail::TileBegins<Mem>{wave});
}

}  // namespace gsp
