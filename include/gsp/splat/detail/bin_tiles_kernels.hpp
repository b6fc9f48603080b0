#pragma once
#include <gsp/core/detail/prefetch.hpp>
#include <gsp/parallel/scan.hpp>
#include <gsp/parallel/sort_by_key.hpp>
#include <gsp/splat/frames.hpp>

/// Kernels of gsp/splat/bin_tiles.hpp on a CPU, where the contract stands.
namespace gsp::detail {

/// How many splats there are of a word's 32 Gaussians.
template <class Mem>
struct SeenOfWord {
  SplatWave<Mem> wave;
  KOKKOS_FUNCTION int operator()(std::int64_t i) const {
    return wave.visible() == 0 ? 0 : Kokkos::popcount(wave.seen(i / wave.words, i % wave.words));
  }
  KOKKOS_FUNCTION std::int64_t extent(int) const { return std::int64_t(wave.images) * wave.words; }
};

/// Splats by (image, source), with the bits of their depth, which are as the depths themselves: these are positive.
template <class Mem>
struct RankSplats {
  SplatWave<Mem> wave;
  KOKKOS_FUNCTION void operator()(std::int64_t i) const {
    if (i >= wave.visible()) return;
    SplatOrigin const o = wave.origins(i);
    int const word = o.source / 32;
    std::uint32_t const below = (std::uint32_t(1) << o.source % 32) - 1;
    std::int64_t const rank =
        wave.seen_before(std::int64_t(o.image) * wave.words + word) + Kokkos::popcount(wave.seen(o.image, word) & below);
    wave.depth_keys(rank) = Kokkos::bit_cast<std::uint32_t>(o.depth);
    wave.order(rank) = static_cast<int>(i);
  }
};

/// Tiles of the splats, front to back.
template <class Mem>
struct OrderedTiles {
  SplatWave<Mem> wave;
  KOKKOS_FUNCTION int operator()(std::int64_t i) const { return i < wave.visible() ? wave.origins(wave.order(i)).tiles : 0; }
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

/// The pairs of the i-th splat, front to back.
template <class Mem>
struct EmitPairs {
  SplatWave<Mem> wave;
  std::uint32_t pad;  // behind all keys
  static constexpr int ahead = 16;
  KOKKOS_FUNCTION std::uint32_t first_key(int image) const { return std::uint32_t(image) * std::uint32_t(wave.tiles()); }
  KOKKOS_FUNCTION void operator()(std::int64_t i) const {
    if (i >= wave.visible() || wave.pairs() == 0) return;
    if (i + ahead < wave.visible()) {  // by depth they lie anywhere
      prefetch(&wave.splats(wave.order(i + ahead)), sizeof(Splat));
      prefetch(&wave.origins(wave.order(i + ahead)), sizeof(SplatOrigin));
    }
    int const index = wave.order(i), columns = wave.grid.columns();
    std::uint32_t const base = first_key(wave.origins(index).image);
    std::int64_t to = wave.pair_offset(i);
    std::int64_t const end = wave.pair_offset(i + 1);
    auto const put = [&](std::uint32_t key) {
      if (to >= end) return;  // cannot happen while counting and emitting round alike; memory is safe if they do not
      wave.tile_keys(to) = key;
      wave.tile_splats(to++) = index;
    };
    for_tile_rows(wave.splats(index), wave.grid, [&](int ty, int first, int last) {
      for (int tx = first; tx <= last; ++tx) put(base + static_cast<std::uint32_t>(ty * columns + tx));
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
