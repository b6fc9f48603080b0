#pragma once
#include <cstdint>
#include <gsp/splat/channels.hpp>

/// Where a warp's 8 x 8 pixels go, two neighbours of a row a lane. A GPU writes sectors of 32 bytes, and what an instruction writes of one
/// it writes by itself: four bytes every twenty-four, the red of every second pixel, and each sector goes out six times. So colours change
/// lanes first and go out 16 bytes at a time, and what is one number a pixel goes out two at a time.
namespace gsp::detail {

/// The place of a warp's 8 x 8 pixels, and of a lane's two in it.
struct BlockPlace {
  static constexpr int side = 8, colours = 3 * side * side;
  int image, x0, y0, width, height;

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

/// A queue's memory as room for the colours of a block.
template <class T, int n>
__device__ float* room_for_colours(T (&memory)[n]) {
  static_assert(sizeof memory >= BlockPlace::colours * sizeof(float) && alignof(T) % 16 == 0);
  return reinterpret_cast<float*>(memory);
}

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

/// `room`: of the warp, in shared memory (room_for_colours).
template <class C>
__device__ void store_block(C const& channel, BlockPlace const& at, float*, float const* first, float const* second) {
  store_pixels(channel, at, first, second);
}
template <class Mem>
__device__ void store_block(DepthChannel<Mem> const& channel, BlockPlace const& at, float*, float const* first, float const* second) {
  store_numbers(channel, at, first, second);
}
template <class Mem>
__device__ void store_block(AlphaChannel<Mem> const& channel, BlockPlace const& at, float*, float const* first, float const* second) {
  store_numbers(channel, at, first, second);
}
template <class Mem>
__device__ void store_block(RgbChannel<Mem> const& channel, BlockPlace const& at, float* room, float const* first, float const* second) {
  constexpr int row = 3 * BlockPlace::side;
  if (channel.image.extent(0) == 0) return;
  if (!at.whole(channel.image(at.image, at.y0, at.x0, 0))) return store_pixels(channel, at, first, second);
  float* const own = room + 6 * BlockPlace::lane();  // a lane's two pixels are the next six numbers of the block
  for (int k = 0; k < 3; ++k) {
    own[k] = first[k];
    own[3 + k] = second[k];
  }
  __syncwarp();
  for (int k = 4 * BlockPlace::lane(); k < BlockPlace::colours; k += 4 * 32)
    *reinterpret_cast<float4*>(&channel.image(at.image, at.y0 + k / row, at.x0, 0) + k % row) = *reinterpret_cast<float4 const*>(room + k);
  __syncwarp();
}

__device__ inline void store_block(ChannelList<> const&, BlockPlace const&, float*, float const*, float const*) {}
template <class C, class... Rest>
__device__ void store_block(ChannelList<C, Rest...> const& list, BlockPlace const& at, float* room, float const* first,
                            float const* second) {
  store_block(list.channel, at, room, first, second);
  store_block(list.rest, at, room, first + C::size, second + C::size);
}

/// Copies a block of `numbers` a pixel from picture `from` to picture `to`, of the size of `at`'s.
__device__ inline void copy_block(BlockPlace const& at, float* to, float const* from, int numbers) {
  auto const place = [&](int row, int of_row) { return (std::int64_t(at.y0 + row) * at.width + at.x0) * numbers + of_row; };
  int const of_row = BlockPlace::side * numbers, lane = BlockPlace::lane();
  if (at.whole(to[place(0, 0)]) && at.whole(from[place(0, 0)])) {
    for (int k = 4 * lane; k < BlockPlace::side * of_row; k += 4 * 32)
      *reinterpret_cast<float4*>(to + place(k / of_row, k % of_row)) =
          *reinterpret_cast<float4 const*>(from + place(k / of_row, k % of_row));
  } else {
    int const rows = at.height - at.y0 < BlockPlace::side ? at.height - at.y0 : BlockPlace::side,
              columns = at.width - at.x0 < BlockPlace::side ? (at.width - at.x0) * numbers : of_row;
    for (int k = lane; k < rows * columns; k += 32) to[place(k / columns, k % columns)] = from[place(k / columns, k % columns)];
  }
}

}  // namespace gsp::detail
