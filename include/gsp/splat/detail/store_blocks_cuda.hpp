#pragma once
#include <cstdint>
#include <gsp/splat/channels.hpp>

/// Where a warp's 8 x 8 pixels go, two neighbours of a row a lane. A GPU writes sectors of 32 bytes, and what an instruction writes of one
/// it writes by itself: four bytes every twelve, a pixel's red, and every sector goes out six times. So colours change lanes first and go
/// out 16 bytes at a time, and what is one number a pixel goes out two at a time.
namespace gsp::detail {

/// The place of a warp's 8 x 8 pixels, and of a lane's two in it.
struct BlockPlace {
  static constexpr int side = 8;
  int image, x0, y0, width, height;
  float* room;  // of the warp, in shared memory, side x side x 3

  __device__ static int lane() { return int(threadIdx.x) % 32; }
  __device__ int x() const { return x0 + lane() % 4 * 2; }
  __device__ int y() const { return y0 + lane() / 4; }
  __device__ bool has_first() const { return x() < width && y() < height; }
  __device__ bool has_second() const { return x() + 1 < width && y() < height; }
  /// Does the block lie in the picture, and its rows, the first of which begins at `row`, where 16 bytes may?
  __device__ bool whole(float const& row) const {
    return width % 4 == 0 && x0 + side <= width && y0 + side <= height && reinterpret_cast<std::uintptr_t>(&row) % 16 == 0;
  }
};

template <class C>
__device__ void store_pixels(C const& channel, BlockPlace const& at, float const* first, float const* second) {
  if (at.has_first()) channel.store(at.image, at.y(), at.x(), first);
  if (at.has_second()) channel.store(at.image, at.y(), at.x() + 1, second);
}
/// One number a pixel.
template <class C>
__device__ void store_numbers(C const& channel, BlockPlace const& at, float const* first, float const* second) {
  if (channel.image.extent(0) == 0) return;
  if (!at.whole(channel.image(at.image, at.y0, at.x0))) return store_pixels(channel, at, first, second);
  *reinterpret_cast<float2*>(&channel.image(at.image, at.y(), at.x())) = {first[0], second[0]};
}

template <class C>
__device__ void store_block(C const& channel, BlockPlace const& at, float const* first, float const* second) {
  store_pixels(channel, at, first, second);
}
template <class Mem>
__device__ void store_block(DepthChannel<Mem> const& channel, BlockPlace const& at, float const* first, float const* second) {
  store_numbers(channel, at, first, second);
}
template <class Mem>
__device__ void store_block(AlphaChannel<Mem> const& channel, BlockPlace const& at, float const* first, float const* second) {
  store_numbers(channel, at, first, second);
}
template <class Mem>
__device__ void store_block(RgbChannel<Mem> const& channel, BlockPlace const& at, float const* first, float const* second) {
  constexpr int row = 3 * BlockPlace::side, fours = BlockPlace::side * row / 4;
  if (channel.image.extent(0) == 0) return;
  if (!at.whole(channel.image(at.image, at.y0, at.x0, 0))) return store_pixels(channel, at, first, second);
  float* const own = at.room + 6 * BlockPlace::lane();  // a lane's two pixels are the next six numbers of the block
  for (int k = 0; k < 3; ++k) {
    own[k] = first[k];
    own[3 + k] = second[k];
  }
  __syncwarp();
  for (int k = BlockPlace::lane(); k < fours; k += 32)
    *reinterpret_cast<float4*>(&channel.image(at.image, at.y0 + 4 * k / row, at.x0, 0) + 4 * k % row) =
        reinterpret_cast<float4 const*>(at.room)[k];
  __syncwarp();
}

__device__ inline void store_block(ChannelList<> const&, BlockPlace const&, float const*, float const*) {}
template <class C, class... Rest>
__device__ void store_block(ChannelList<C, Rest...> const& list, BlockPlace const& at, float const* first, float const* second) {
  store_block(list.channel, at, first, second);
  store_block(list.rest, at, first + C::size, second + C::size);
}

}  // namespace gsp::detail
