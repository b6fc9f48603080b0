#pragma once
#include <gsp/parallel/detail/launch_cuda.hpp>
#include <gsp/parallel/detail/warp_cuda.hpp>
#include <gsp/splat/channels.hpp>
#include <gsp/splat/detail/block_masks_cuda.hpp>
#include <gsp/splat/detail/store_blocks_cuda.hpp>
#include <gsp/splat/frames.hpp>

namespace gsp::detail {

/// What a warp does with 8 x 8 pixels, two neighbours of a row a lane: splats lie in shared memory, and it goes through them without a
/// branch. What bounds it is the instructions that are issued for each splat and block, so what depends on the block alone is paid when a
/// splat is put down:
///   l11 (x - u) + l21 (y - v) = l11 i + l21 j + across,  l22 (y - v) = l22 j + down,  for column i and row j of the block.
template <class List>
struct BlendBlocks {
  List channels;
  float alpha_max, stop;

  struct alignas(16) Queued {
    float across, down, l11, l21;
    float l22, power;
    int id;
    int : 32;
    Splat splat;
  };
  struct Pixel {
    float numbers[List::size] = {};
    float left = 1;  // of the light; negative: the pixel is done
  };

  __device__ static void put(Queued& to, Splat const& s, int id, float x, float y) {
    float const du = s.u - x, dv = s.v - y;
    to.across = -fmaf(s.l11, du, s.l21 * dv);
    to.down = -(s.l22 * dv);
    to.l11 = s.l11;
    to.l21 = s.l21;
    to.l22 = s.l22;
    to.power = s.power;
    to.id = id;
    to.splat = s;
  }
  /// Of the next `count` splats, at column i of row j and at its right neighbour, so many at a time. `kept`: what channels keep of splats,
  /// by id.
  template <int splats_at_once>
  __device__ __forceinline__ void through(Queued const* at, int count, float i, float j, float const* kept, Pixel& first,
                                          Pixel& second) const {
    Queued const* const behind = at + count;
    for (; splats_at_once > 2 && behind - at >= splats_at_once; at += splats_at_once) {
      float left[splats_at_once], right[splats_at_once];
#pragma unroll
      for (int k = 0; k < splats_at_once; ++k) {
        float const wy = fmaf(at[k].l22, j, at[k].down), most = fmaf(-wy, wy, at[k].power),
                    wx = fmaf(at[k].l11, i, fmaf(at[k].l21, j, at[k].across)), next = wx + at[k].l11;
        left[k] = fmaf(-wx, wx, most);
        right[k] = fmaf(-next, next, most);
      }
#pragma unroll
      for (int k = 0; k < splats_at_once; ++k) {
        float const* const values = List::stored > 0 ? kept + std::int64_t(at[k].id) * List::stored : nullptr;
        blend(first, left[k], at[k].splat, values);
        blend(second, right[k], at[k].splat, values);
      }
    }
#pragma unroll 2
    for (; at != behind; ++at) {
      float const wy = fmaf(at->l22, j, at->down), most = fmaf(-wy, wy, at->power), wx = fmaf(at->l11, i, fmaf(at->l21, j, at->across)),
                  right = wx + at->l11;
      float const* const values = List::stored > 0 ? kept + std::int64_t(at->id) * List::stored : nullptr;
      blend(first, fmaf(-wx, wx, most), at->splat, values);
      blend(second, fmaf(-right, right, most), at->splat, values);
    }
  }
  /// All lanes; the queue is done with.
  __device__ void store(Pixel& first, Pixel& second, BlockPlace const& at, Queued (&queue)[32]) const {
    channels.finish(first.numbers, 1.f - fabsf(first.left));
    channels.finish(second.numbers, 1.f - fabsf(second.left));
    __syncwarp();
    store_block(channels, at, room_for_colours(queue), first.numbers, second.numbers);
  }

 private:
  __device__ void blend(Pixel& pixel, float exponent, Splat const& s, float const* values) const {
    float power;
    asm("ex2.approx.ftz.f32 %0, %1;" : "=f"(power) : "f"(exponent));
    float const alpha = fminf(power, alpha_max), before = pixel.left, left = fmaf(-alpha, before, before);
    bool const counts = exponent >= -splat_log2_255, adds = counts && left > stop;
    Blend<float> const b{adds ? alpha * before : 0.f, fabsf(before), adds ? left : fabsf(before)};
    channels.blend(pixel.numbers, s, values, b);
    pixel.left = adds ? left : counts ? -fabsf(before) : before;
  }
};

/// Lists which of the next 1,024 splats of a list touch a block: 32 of them a lane, whose word stands at `mask`. Returns how many.
__device__ inline int find_touching(unsigned short* touching, std::uint32_t const* mask, bool there, int lane) {
  unsigned word = there ? *mask : 0;
  int const own = __popc(word);
  int const upto = sum_upto_lane(own);
  __syncwarp();
  for (int to = upto - own; word != 0; word &= word - 1) touching[to++] = static_cast<unsigned short>(32 * lane + __ffs(int(word)) - 1);
  __syncwarp();
  return __shfl_sync(0xffffffffu, upto, 31);
}

/// Pictures on a GPU: a warp blends 8 x 8 pixels by itself. It asks the masks of its tile (BlockMasks) which splats touch the block, 1,024
/// at a time, fetches those 32 at a time into shared memory, and goes through them (BlendBlocks); the next 32 are on their way meanwhile.
template <class Mem, class List, int warps, int splats_at_once>
struct RasterizeBlocks {
  Frames<Mem> frames;
  BlendBlocks<List> blend;

  using Masks = BlockMasks;
  using Queued = typename BlendBlocks<List>::Queued;
  static constexpr int side = Masks::side, threads = 32 * warps, grid_of_tile = Masks::across * Masks::down / warps, entries = 1024;
  static constexpr unsigned all = 0xffffffffu;

  struct Queue {  // of a warp
    Queued splats[32];
    unsigned short touching[entries];  // places in the list, from where the 1,024 begin
  };

  __device__ void operator()(Queue* queues) const {
    auto const& wave = frames.wave;
    int const warp = int(threadIdx.x) / 32, lane = int(threadIdx.x) % 32;
    int const index = wave.tile_order(blockIdx.x / grid_of_tile), block = int(blockIdx.x) % grid_of_tile * warps + warp;
    int const tiles = wave.tiles(), image = wave.first + index / tiles, tile = index % tiles, columns = wave.grid.columns();
    // four one after the other lie two and two
    int const across = block / 4 % (Masks::across / 2) * 2 + block % 2, down = block / (2 * Masks::across) * 2 + block / 2 % 2;
    int const x0 = (tile % columns * Masks::across + across) * side, y0 = (tile / columns * Masks::down + down) * side;
    if (x0 >= frames.width || y0 >= frames.height || frames.status(image) != 0) return;
    Queue& queue = queues[warp];
    BlockPlace const at{image, x0, y0, frames.width, frames.height};
    float const i = float(at.x() - x0), j = float(at.y() - y0);
    typename BlendBlocks<List>::Pixel first, second;
    if (!at.has_first()) first.left = -1;
    if (!at.has_second()) second.left = -1;

    int const begin = int(wave.tile_begin(index)), end = int(wave.tile_begin(index + 1));  // shorter than 2^31 (reserve)
    std::uint32_t const* const masks = &wave.block_masks(begin / 32 + index, down * Masks::across + across);
    for (int group = begin; group < end; group += entries) {
      int const found = find_touching(queue.touching, masks + (group - begin + 32 * lane), group + 32 * lane < end, lane);
      // ids are fetched two rounds ahead, splats one
      auto const id_at = [&](int at) { return wave.tile_splats(group + queue.touching[at < found ? at : found - 1]); };
      if (found == 0) continue;
      int id = id_at(lane), next_id = id_at(32 + lane);
      Splat next = wave.splats(id);
      for (int base = 0; base < found; base += 32) {
        blend.put(queue.splats[lane], next, id, float(x0) + 0.5f, float(y0) + 0.5f);
        id = next_id;
        next = wave.splats(id);
        next_id = id_at(base + 64 + lane);
        __syncwarp();
        blend.template through<splats_at_once>(queue.splats, found - base < 32 ? found - base : 32, i, j, wave.values.data(), first,
                                               second);
        if (__all_sync(all, first.left < 0 && second.left < 0)) break;
        __syncwarp();
      }
      if (__all_sync(all, first.left < 0 && second.left < 0)) break;
    }
    blend.store(first, second, at, queue.splats);
  }
};

template <class Blocks>
__global__ void __launch_bounds__(Blocks::threads) rasterize_blocks_kernel(Blocks const __grid_constant__ blocks) {
  __shared__ typename Blocks::Queue queues[Blocks::threads / 32];
  blocks(queues);
}
/// Where a wave fills the GPU many times over, what counts is how many warps it holds; else, how soon the longest lists end: then more
/// splats at a time, in more registers (measured in decision 42).
template <class Mem, class List>
void rasterize_on_cuda(Kokkos::Cuda const& exec, Frames<Mem> const& frames, BlendBlocks<List> const& blend) {
  constexpr std::int64_t many_pixels = std::int64_t(3) << 19;
  auto const& wave = frames.wave;
  auto const launch = [&](auto const& blocks) {
    using Blocks = std::remove_cvref_t<decltype(blocks)>;
    launch_on_cuda("gsp::splat::rasterize", exec, [&](cudaStream_t stream) {
      unsigned const grid = unsigned(wave.images * wave.tiles()) * Blocks::grid_of_tile;
      rasterize_blocks_kernel<<<grid, Blocks::threads, 0, stream>>>(blocks);
    });
  };
  if (std::int64_t(wave.images) * frames.width * frames.height > many_pixels)
    launch(RasterizeBlocks<Mem, List, 4, 2>{frames, blend});
  else
    launch(RasterizeBlocks<Mem, List, 4, 4>{frames, blend});
}

}  // namespace gsp::detail
