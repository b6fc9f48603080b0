#pragma once
#include <gsp/core/region.hpp>
#include <gsp/parallel/scan.hpp>
#include <gsp/parallel/sort_by_key.hpp>
#include <gsp/splat/detail/ellipse.hpp>
#include <gsp/splat/frames.hpp>

namespace gsp {

namespace detail {

/// Keys behind all others, where a device sorts the whole capacity.
template <class Key, class Mem>
struct PadKeys {
  Kokkos::View<Key*, Mem> keys;
  Kokkos::View<std::int64_t, Kokkos::LayoutRight, Mem> count;
  Key pad;
  KOKKOS_FUNCTION void operator()(std::int64_t i) const {
    if (i >= count()) keys(i) = pad;
  }
};

/// Tiles of the splats, front to back.
template <class Mem>
struct OrderedTiles {
  SplatWave<Mem> wave;
  KOKKOS_FUNCTION int operator()(std::int64_t i) const { return i < wave.visible() ? wave.splat_tiles(wave.order(i)) : 0; }
  KOKKOS_FUNCTION std::int64_t extent(int) const { return wave.visible_capacity; }
};

/// Do the pairs fit? As for the splats, a wave that does not is left out and marked.
template <class Mem>
struct SettlePairs {
  SplatWave<Mem> wave;
  Kokkos::View<std::uint32_t*, Kokkos::LayoutRight, Mem> status;
  KOKKOS_FUNCTION void operator()(int) const {
    std::int64_t const pairs = wave.pair_offset(wave.visible_capacity);
    bool const fits = pairs <= wave.pair_capacity;
    wave.pairs() = fits ? pairs : 0;
    wave.needed(1) = pairs > wave.needed(1) ? pairs : wave.needed(1);
    if (!fits)
      for (int k = 0; k < wave.images; ++k) status(wave.first + k) |= frame_overflow;
  }
};

template <class Mem>
struct EmitPairs {
  SplatWave<Mem> wave;
  int width, height;
  std::uint32_t pad;
  KOKKOS_FUNCTION void operator()(std::int64_t i) const {
    if (i >= wave.visible() || wave.pairs() == 0) return;
    int const index = wave.order(i);
    std::uint32_t const image = static_cast<std::uint32_t>(wave.order_keys(i) >> (32 + wave.index_bits)),
                        base = image * static_cast<std::uint32_t>(wave.tiles());
    std::int64_t to = wave.pair_offset(i);
    std::int64_t const end = wave.pair_offset(i + 1);
    auto const put = [&](std::uint32_t key) {
      if (to >= end) return;  // cannot happen while counting and emitting round alike; memory is safe if they do not
      wave.tile_keys(to) = key;
      wave.tile_splats(to++) = index;
    };
    for_tile_rows(wave.splats(index), width, height, [&](int ty, int first, int last) {
      for (int tx = first; tx <= last; ++tx) put(base + static_cast<std::uint32_t>(ty * wave.tiles_x + tx));
    });
    while (to < end) put(pad);
  }
};

/// First pair of each tile: the first key that is not below it.
template <class Mem>
struct TileBegins {
  SplatWave<Mem> wave;
  KOKKOS_FUNCTION void operator()(std::int64_t tile) const {
    std::int64_t low = 0, high = wave.pairs();
    while (low < high) {
      std::int64_t const middle = (low + high) / 2;
      if (wave.tile_keys(middle) < static_cast<std::uint32_t>(tile))
        low = middle + 1;
      else
        high = middle;
    }
    wave.tile_begin(tile) = low;
  }
};

}  // namespace detail

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
    Kokkos::parallel_for("gsp::splat::bin_tiles_pad", light(Range(exec, 0, wave.visible_capacity)),
                         detail::PadKeys<std::uint64_t, Mem>{wave.order_keys, wave.visible, pad});
  }
  sort_by_key(exec, wave.order_keys, wave.order, wave.order_scratch, wave.visible,
              {.bits = std::min(64, 32 + wave.index_bits + image_bits)});
  exclusive_scan(exec, detail::OrderedTiles<Mem>{wave}, wave.pair_offset);
  Kokkos::parallel_for("gsp::splat::bin_tiles_settle", light(Kokkos::RangePolicy<Exec>(exec, 0, 1)),
                       detail::SettlePairs<Mem>{wave, frames.status});
  if constexpr (is_device<Exec>)
    Kokkos::parallel_for("gsp::splat::bin_tiles_pad", light(Range(exec, 0, wave.pair_capacity)),
                         detail::PadKeys<std::uint32_t, Mem>{wave.tile_keys, wave.pairs, tile_pad});
  Kokkos::parallel_for("gsp::splat::bin_tiles_emit", light(Range(exec, 0, wave.visible_capacity)),
                       detail::EmitPairs<Mem>{wave, frames.width, frames.height, tile_pad});
  sort_by_key(exec, wave.tile_keys, wave.tile_splats, wave.tile_scratch, wave.pairs, {.bits = tile_bits});
  Kokkos::parallel_for("gsp::splat::bin_tiles_begins", light(Range(exec, 0, std::int64_t(tile_pad) + 1)), detail::TileBegins<Mem>{wave});
}

}  // namespace gsp
