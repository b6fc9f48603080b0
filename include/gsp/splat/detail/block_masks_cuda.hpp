#pragma once
#include <gsp/splat/detail/ellipse.hpp>

namespace gsp::detail {

/// A GPU's tile has 8 x 4 blocks of 8 x 8 pixels, a bit each.
struct BlockMasks {
  static constexpr int side = 8, across = 8, down = 4;
  static_assert(side == 1 << 3);

  /// Bit across * row + column of each block that the ellipse touches, in the tile whose first pixel is (x0, y0): Ellipse::columns of each
  /// row of blocks, in pixels of the tile from the start.
  __device__ static unsigned touched(Splat const& s, int x0, int y0) {
    Ellipse const e(s);
    float const above = float(y0) + 0.5f - e.v - e.pad, high = float(side - 1) + 2 * e.pad, left_end = e.u - e.pad - (float(x0) + 0.5f),
                right_end = left_end + 2 * e.pad;
    unsigned bits = 0;
#pragma unroll
    for (int row = 0; row < down; ++row) {
      float const top = max(above + float(row * side), -e.ye), bottom = min(above + float(row * side) + high, e.ye);
      float const right_y = clamp(e.y_right, top, bottom), left_y = clamp(-e.y_right, top, bottom);
      float const wr = e.l22 * right_y, wl = e.l22 * left_y;
      float const right = fma(-e.slope, right_y, near_sqrt(max(0.f, fma(-wr, wr, e.reach))) * e.inverse_l11);
      float const left = fma(-e.slope, left_y, -(near_sqrt(max(0.f, fma(-wl, wl, e.reach))) * e.inverse_l11));
      int const first = __float2int_ru(left_end + left) >> 3, last = __float2int_rd(right_end + right) >> 3;
      int const from = first > 0 ? first : 0, to = last < across - 1 ? last : across - 1;
      if (top <= bottom && from <= to) bits |= ((2u << to) - (1u << from)) << across * row;
    }
    return bits;
  }
};

/// Where a warp works that takes 8 x 4 pixels of a block, one a lane; blocks of threads that take tiles with long lists come first.
struct HalfBlock {
  static constexpr int threads = 128, blocks_of_tile = 2 * BlockMasks::across * BlockMasks::down / (threads / 32);
  int index, block, image;  // tile of the wave, block of the tile
  int x, y;                 // of the lane's pixel

  template <class Wave>
  __device__ explicit HalfBlock(Wave const& wave) {
    int const half = int(blockIdx.x) % blocks_of_tile * (threads / 32) + int(threadIdx.x) / 32, lane = int(threadIdx.x) % 32,
              columns = wave.grid.columns();
    index = wave.tile_order(blockIdx.x / blocks_of_tile);
    block = half / 2;
    image = wave.first + index / wave.tiles();
    int const tile = index % wave.tiles();
    x = (tile % columns * BlockMasks::across + block % BlockMasks::across) * BlockMasks::side + lane % 8;
    y = (tile / columns * BlockMasks::down + block / BlockMasks::across) * BlockMasks::side + 4 * (half % 2) + lane / 8;
  }
};

}  // namespace gsp::detail
