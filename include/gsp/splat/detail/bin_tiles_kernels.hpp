#pragma once
#include <gsp/parallel/scan.hpp>
#include <gsp/parallel/sort_by_key.hpp>
#include <gsp/splat/detail/ellipse.hpp>
#include <gsp/splat/frames.hpp>

/// Kernels of gsp/splat/bin_tiles.hpp, where the contract stands.
namespace gsp::detail {

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

}  // namespace gsp::detail
