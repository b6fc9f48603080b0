#pragma once
#include <gsp/splat/detail/rasterize_cuda.hpp>
#include <gsp/splat/detail/still_lists.hpp>

namespace gsp::detail {

/// Pictures of cameras that stand still on a GPU: a block takes a tile. Its warps blend those 8 x 8 blocks of pixels that something
/// touches which moves, as RasterizeBlocks does, but from two lists, and copy what stands to those that nothing touches any more.
/// Two lists become one 32 splats at a time: each lane has the next of either, finds by bisection how many of the other list come before
/// its own, and the first 32 are fetched and blended. Keys are (depth, source), which no two Gaussians share, so the order is that of one
/// list of all.
template <class Mem, class List>
struct RasterizeFixedBlocks {
  BlendBlocks<List> blend;
  Frames<Mem> frames;     // of what moves
  StillLists<Mem> still;  // of what stands

  using Blend = BlendBlocks<List>;
  using Masks = BlockMasks;
  static constexpr int warps = 4, threads = 32 * warps, entries = 1024;
  static constexpr unsigned all = 0xffffffffu;
  static_assert(List::stored == 0);

  struct Queue {  // of a warp
    typename Blend::Queued splats[32];
    int ids[32];                          // in order; of what stands: ~id
    unsigned short touching[2][entries];  // places in the lists, from where the 1,024 begin
  };

  __device__ void operator()(Queue* queues) const {
    auto const& wave = frames.wave;
    int const warp = int(threadIdx.x) / 32, lane = int(threadIdx.x) % 32, index = wave.tile_order(blockIdx.x), tiles = wave.tiles(),
              image = wave.first + index / tiles, tile = index % tiles, columns = wave.grid.columns();
    if (frames.status(image) != 0) return;
    int const begin = int(wave.tile_begin(index)), end = int(wave.tile_begin(index + 1)), row = begin / 32 + index;
    std::uint32_t& drawn = still.drawn(image, tile);
    unsigned touched = 0;  // lane: block
    for (int chunk = 0; 32 * chunk < end - begin; ++chunk) touched |= wave.block_masks(row + chunk, lane);
    unsigned const now = __ballot_sync(all, touched != 0), before = drawn;
    if (now == 0 && before == 0) return;
    __syncthreads();  // all have read what one writes
    if (threadIdx.x == 0) drawn = now;
    int const view = still.view(image), of_view = view * tiles + tile;
    int turn = 0;
    for (unsigned work = now | before; work != 0; work &= work - 1) {
      if (turn++ % warps != warp) continue;
      int const block = __ffs(int(work)) - 1;
      int const x0 = (tile % columns * Masks::across + block % Masks::across) * Masks::side,
                y0 = (tile / columns * Masks::down + block / Masks::across) * Masks::side;
      if (x0 >= frames.width || y0 >= frames.height) continue;
      if (now >> block & 1u)
        draw(queues[warp], image, x0, y0, Touching<SplatWave<Mem>>(wave, index, block, queues[warp].touching[0]),
             Touching<StillLists<Mem>>(still, of_view, block, queues[warp].touching[1]));
      else
        restore(image, view, x0, y0);
    }
  }

 private:
  /// The next 32 of a list, one a lane.
  struct Next {
    int count, id = 0;
    std::uint64_t key = ~std::uint64_t(0);
  };

  /// The splats of a tile's list that touch a block, in order, 1,024 of the list at a time.
  template <class Lists>
  struct Touching {
    Lists const& lists;
    unsigned short* places;
    std::uint32_t const* masks;  // of the next 1,024
    int next, end, found = 0, taken = 0;

    __device__ Touching(Lists const& all_lists, int index, int block, unsigned short* room)
        : lists(all_lists), places(room), next(int(all_lists.tile_begin(index))), end(int(all_lists.tile_begin(index + 1))) {
      masks = lists.block_masks.data() + std::int64_t(next / 32 + index) * 32 + block;
    }
    /// Of the next that are known, 32 at most; none: there are none.
    __device__ Next ids(int lane) {
      while (taken == found && next < end) {
        taken = 0;
        found = find_touching(places, masks + 32 * lane, next + 32 * lane < end, lane);
        next += entries;
        masks += entries;  // 32 rows of 32 blocks
      }
      Next n;
      n.count = found - taken < 32 ? found - taken : 32;
      if (lane < n.count) n.id = lists.tile_splats(next - entries + places[taken + lane]);
      return n;
    }
    __device__ void key(Next& n, int lane) const {
      if (lane >= n.count) return;
      SplatOrigin const o = lists.origins(n.id);
      n.key = std::uint64_t(__float_as_uint(o.depth)) << 32 | std::uint32_t(o.source);
    }
    /// Does the list go on behind those that have been looked at?
    __device__ bool more() const { return next < end; }
  };

  /// How many of the lanes' keys, which ascend, are below `own`.
  __device__ static int count_below(std::uint64_t keys, std::uint64_t own) {
    int count = 0;
#pragma unroll
    for (int step = 16; step > 0; step /= 2) count += __shfl_sync(all, keys, count + step - 1) < own ? step : 0;
    return count + (__shfl_sync(all, keys, count) < own);
  }

  template <class Moving, class Standing>
  __device__ void draw(Queue& queue, int image, int x0, int y0, Moving moving, Standing standing) const {
    int const lane = int(threadIdx.x) % 32;
    BlockPlace const at{image, x0, y0, frames.width, frames.height};
    typename Blend::Pixel first, second;
    if (!at.has_first()) first.left = -1;
    if (!at.has_second()) second.left = -1;
    Next a = moving.ids(lane), b = standing.ids(lane);
    moving.key(a, lane);
    standing.key(b, lane);
    while (a.count > 0 || b.count > 0) {
      int const a_place = lane + (b.count > 0 ? count_below(b.key, a.key) : 0),
                b_place = lane + (a.count > 0 ? count_below(a.key, b.key) : 0);
      // of the splats behind the last that is known of a list that goes on, nothing is known
      int count = a.count + b.count < 32 ? a.count + b.count : 32;
      int const to_a = __shfl_sync(all, a_place, a.count > 0 && a.count < 32 ? a.count - 1 : 31) + 1,
                to_b = __shfl_sync(all, b_place, b.count > 0 && b.count < 32 ? b.count - 1 : 31) + 1;
      if (a.count > 0 && a.count < 32 && moving.more() && to_a < count) count = to_a;
      if (b.count > 0 && b.count < 32 && standing.more() && to_b < count) count = to_b;
      bool const takes_a = lane < a.count && a_place < count, takes_b = lane < b.count && b_place < count;
      if (takes_a) queue.ids[a_place] = a.id;
      if (takes_b) queue.ids[b_place] = ~b.id;
      moving.taken += __popc(__ballot_sync(all, takes_a));
      standing.taken += __popc(__ballot_sync(all, takes_b));
      __syncwarp();
      // ids of the next round are on their way while splats of this one are fetched, and their keys while those are blended
      int const id = queue.ids[lane < count ? lane : 0];
      a = moving.ids(lane);
      b = standing.ids(lane);
      Splat const splat = id < 0 ? standing.lists.splats(~id) : moving.lists.splats(id);
      moving.key(a, lane);
      standing.key(b, lane);
      Blend::put(queue.splats[lane], splat, id, float(x0) + 0.5f, float(y0) + 0.5f);
      __syncwarp();
      blend.template through<2>(queue.splats, count, float(at.x() - x0), float(at.y() - y0), nullptr, first, second);
      if (__all_sync(all, first.left < 0 && second.left < 0)) break;
      __syncwarp();
    }
    blend.store(first, second, at, queue.splats);
  }

  __device__ void restore(int image, int view, int x0, int y0) const {
    BlockPlace const at{image, x0, y0, frames.width, frames.height};
    if (frames.rgb.extent(0) > 0) copy_block(at, &frames.rgb(image, 0, 0, 0), &still.rgb(view, 0, 0, 0), 3);
    if (frames.depth.extent(0) > 0) copy_block(at, &frames.depth(image, 0, 0), &still.depth(view, 0, 0), 1);
    if (frames.alpha.extent(0) > 0) copy_block(at, &frames.alpha(image, 0, 0), &still.alpha(view, 0, 0), 1);
  }
};

template <class Blocks>
__global__ void __launch_bounds__(Blocks::threads) rasterize_fixed_kernel(Blocks const __grid_constant__ blocks) {
  __shared__ typename Blocks::Queue queues[Blocks::warps];
  blocks(queues);
}
template <class Mem, class List>
void rasterize_fixed_on_cuda(Kokkos::Cuda const& exec, RasterizeFixedBlocks<Mem, List> const& blocks) {
  using Blocks = RasterizeFixedBlocks<Mem, List>;
  unsigned const grid = unsigned(blocks.frames.wave.images * blocks.frames.wave.tiles());
  launch_on_cuda("gsp::splat::rasterize_fixed", exec,
                 [&](cudaStream_t stream) { rasterize_fixed_kernel<<<grid, Blocks::threads, 0, stream>>>(blocks); });
}

}  // namespace gsp::detail
