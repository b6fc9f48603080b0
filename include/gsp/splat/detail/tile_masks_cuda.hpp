#pragma once
#include <gsp/parallel/detail/launch_cuda.hpp>
#include <gsp/splat/frames.hpp>

namespace gsp::detail {

/// Which blocks of 8 x 8 pixels the splats of a tile's list touch: a tile has 8 x 4 of them, and for every 32 splats one word a block. The
/// words of a list that begins at pair b, of tile t, stand in the rows of block_masks from b / 32 + t on: no two lists share one.
template <class Mem>
struct TileMasks {
  SplatWave<Mem> wave;
  static constexpr int threads = 256, side = 8, across = 8, down = 4;

  __device__ void operator()() const {
    int const index = int(blockIdx.x), tile = index % wave.tiles(), lane = int(threadIdx.x) % 32;
    std::int64_t const begin = wave.tile_begin(index), end = wave.tile_begin(index + 1);
    int const columns = wave.grid.columns(), x0 = tile % columns * (across * side), y0 = tile / columns * (down * side);
    for (std::int64_t chunk = threadIdx.x / 32; begin + 32 * chunk < end; chunk += threads / 32) {
      std::int64_t const at = begin + 32 * chunk + lane;
      unsigned const blocks = at < end ? touched(wave.splats(wave.tile_splats(at)), x0, y0) : 0;
      unsigned word = 0;
      for (int block = 0; block < 32; ++block) {
        unsigned const splats = __ballot_sync(0xffffffffu, blocks >> block & 1u);
        if (block == lane) word = splats;
      }
      wave.block_masks(begin / 32 + index + chunk, lane) = word;
    }
  }

 private:
  /// Bit across * row + column of each block that the ellipse touches.
  __device__ unsigned touched(Splat const& s, int x0, int y0) const {
    Ellipse const e(s);
    int const right = x0 + across * side, below = y0 + down * side, width = wave.grid.width, height = wave.grid.height;
    PixelRange const rows = e.rows(y0, (below < height ? below : height) - 1);
    unsigned bits = 0;
    for (int strip = 0; strip < down; ++strip) {
      int const north = y0 + strip * side, south = north + side - 1;
      int const top = north > rows.first ? north : rows.first, bottom = south < rows.last ? south : rows.last;
      if (top > bottom) continue;
      PixelRange const pixels = e.columns(top, bottom, x0, (right < width ? right : width) - 1);
      if (pixels.first > pixels.last) continue;
      int const first = (pixels.first - x0) / side, last = (pixels.last - x0) / side;
      bits |= ((2u << last) - (1u << first)) << across * strip;
    }
    return bits;
  }
};

template <class Masks>
__global__ void __launch_bounds__(Masks::threads) tile_masks_kernel(Masks const __grid_constant__ masks) {
  masks();
}
template <class Mem>
void tile_masks_on_cuda(Kokkos::Cuda const& exec, SplatWave<Mem> const& wave) {
  launch_on_cuda("gsp::splat::bin_tiles_masks", exec, [&](cudaStream_t stream) {
    tile_masks_kernel<<<unsigned(wave.images * wave.tiles()), TileMasks<Mem>::threads, 0, stream>>>(TileMasks<Mem>{wave});
  });
}

}  // namespace gsp::detail
