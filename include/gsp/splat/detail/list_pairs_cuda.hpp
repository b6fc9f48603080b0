#pragma once
#include <gsp/parallel/detail/launch_cuda.hpp>
#include <gsp/parallel/detail/warp_cuda.hpp>
#include <gsp/splat/frames.hpp>

/// Pairs of splats and tiles on a GPU. Which comes first hangs on the order of threads, and nothing hangs on it: SortTiles puts each list
/// in order.
namespace gsp::detail {

/// Nothing has been listed.
template <class Mem>
struct BeginLists {
  SplatWave<Mem> wave;
  KOKKOS_FUNCTION void operator()(int tile) const {
    if (tile == 0) wave.pairs() = 0;
    wave.tile_count(tile) = 0;
  }
};

/// The tiles of a splat, a splat a thread; those of more than a few tiles by a warp each, a tile a lane. A block asks once for neighbouring
/// places in the pool, and lanes that meet one tile ask once for neighbouring places in its list.
template <class Mem>
struct ListPairs {
  SplatWave<Mem> wave;
  static constexpr int threads = 128, warps = threads / 32, few = 8, at_once = 4;
  static constexpr unsigned all = 0xffffffffu;
  struct Large {
    int thread, before;  // whose splat it is; tiles of the block's splats before it
  };
  struct Shared {
    int before_warp[warps];
    std::int64_t first;  // place in the pool
    int large_count;
    Large large[threads];  // in no order
  };

  __device__ void operator()(Shared& shared) const {
    std::int64_t const begin = std::int64_t(blockIdx.x) * threads, i = begin + threadIdx.x, count = wave.visible();
    if (begin >= count) return;
    int const warp = int(threadIdx.x) / 32, lane = int(threadIdx.x) % 32;
    SplatOrigin const o = i < count ? wave.origins(i) : SplatOrigin{};
    Splat const splat = wave.splats(i < count ? i : 0);  // on its way while the block asks for places
    int const upto = sum_upto_lane(o.tiles);
    if (lane == 31) shared.before_warp[warp] = upto;
    __syncthreads();
    if (threadIdx.x == 0) {
      int sum = 0;
      for (int& n : shared.before_warp) {
        int const own = n;
        n = sum;
        sum += own;
      }
      shared.large_count = 0;
      shared.first = std::int64_t(atomicAdd(reinterpret_cast<unsigned long long*>(&wave.pairs()), static_cast<unsigned long long>(sum)));
    }
    __syncthreads();
    int const before = shared.before_warp[warp] + upto - o.tiles;
    std::int64_t const own = shared.first + before;
    bool const fits = own + o.tiles <= wave.pair_capacity;  // else the wave is left out (BeginTiles)
    if (fits && o.tiles > few) shared.large[atomicAdd(&shared.large_count, 1)] = {int(threadIdx.x), before};
    one_by_one(i, o, splat, fits && o.tiles <= few ? o.tiles : 0, own, lane);
    __syncthreads();
    for (int k = warp; k < shared.large_count; k += warps)
      together(begin + shared.large[k].thread, shared.first + shared.large[k].before, lane);
  }

 private:
  __device__ void one_by_one(std::int64_t i, SplatOrigin const& o, Splat const& splat, int left, std::int64_t to, int lane) const {
    Ellipse const e(splat);
    PixelRange const pixels = e.rows(0, wave.grid.height - 1);
    int const columns = wave.grid.columns(), below = wave.grid.rows_of(pixels).last;
    int ty = wave.grid.rows_of(pixels).first;
    PixelRange tiles{0, -1};
    for (; __any_sync(all, left > 0); --left, ++to) {
      std::uint32_t tile = no_tile;
      if (left > 0) {
        while (tiles.first > tiles.last && ty <= below) tiles = wave.grid.touched(e, pixels, ty++);
        // the other case cannot be while counting and listing round alike
        if (tiles.first <= tiles.last) tile = first_tile(o.image) + std::uint32_t((ty - 1) * columns + tiles.first++);
      }
      unsigned const same = __match_any_sync(all, tile);
      int const leader = __ffs(int(same)) - 1;
      int place = 0;
      if (lane == leader && tile != no_tile) place = atomicAdd(&wave.tile_count(tile), __popc(same));
      place = __shfl_sync(all, place, leader) + __popc(same & ((1u << lane) - 1u));
      if (left > 0) wave.pair_pool(to) = {tile, place, int(i), __float_as_uint(o.depth)};
    }
  }
  /// Rows of tiles are the lanes', 32 at a time; then their tiles are, some at once, for each waits for its place.
  __device__ void together(std::int64_t i, std::int64_t to, int lane) const {
    SplatOrigin const o = wave.origins(i);
    Ellipse const e(wave.splats(i));
    PixelRange const pixels = e.rows(0, wave.grid.height - 1), rows = wave.grid.rows_of(pixels);
    std::uint32_t const columns = std::uint32_t(wave.grid.columns());
    std::int64_t const end = to + o.tiles;
    for (int top = rows.first; top <= rows.last; top += 32) {
      int const ty = top + lane;
      PixelRange const tiles = ty <= rows.last ? wave.grid.touched(e, pixels, ty) : PixelRange{0, -1};
      int const own = tiles.first <= tiles.last ? tiles.last - tiles.first + 1 : 0, upto = sum_upto_lane(own);
      int const count = __shfl_sync(all, upto, 31),
                shift = tiles.first - (upto - own);  // the row's k-th tile of all is in column k + shift
      for (int first = 0; first < count; first += 32 * at_once) {
        std::uint32_t tile[at_once];
        int place[at_once];
#pragma unroll
        for (int u = 0; u < at_once; ++u) {
          tile[u] = no_tile;
          if (first + 32 * u >= count) continue;  // for all lanes
          int const k = first + 32 * u + lane;
          int row = 0;  // how many rows end before k
#pragma unroll
          for (int step = 16; step > 0; step /= 2)
            if (__shfl_sync(all, upto, row + step - 1) <= k) row += step;
          int const column = k + __shfl_sync(all, shift, row);
          if (k < count && to + k < end) tile[u] = first_tile(o.image) + std::uint32_t(top + row) * columns + std::uint32_t(column);
        }
#pragma unroll
        for (int u = 0; u < at_once; ++u)
          if (tile[u] != no_tile) place[u] = atomicAdd(&wave.tile_count(tile[u]), 1);
#pragma unroll
        for (int u = 0; u < at_once; ++u)
          if (tile[u] != no_tile) wave.pair_pool(to + first + 32 * u + lane) = {tile[u], place[u], int(i), __float_as_uint(o.depth)};
      }
      to += count;
    }
    for (to += lane; to < end; to += 32) wave.pair_pool(to).tile = no_tile;  // cannot be while counting and listing round alike
  }
  __device__ std::uint32_t first_tile(int image) const { return std::uint32_t(image) * std::uint32_t(wave.tiles()); }
  static constexpr std::uint32_t no_tile = ~0u;

 public:
  /// Puts a pair from the pool into its tile's list.
  __device__ void place(std::int64_t i) const {
    if (i >= wave.pairs()) return;
    PooledPair const p = wave.pair_pool(i);
    if (p.tile != no_tile) wave.pair_list(wave.tile_begin(p.tile) + p.place) = {p.depth, p.splat};
  }
};

/// Where the lists begin, by one block: there are few tiles, and this is soon done. Do the pairs fit? As for the splats, a wave that does
/// not is left out and marked. And which tiles go first: what is begun last ends last, so those with long lists come before the others, by
/// the two leading bits of their lengths.
template <class Mem>
struct BeginTiles {
  SplatWave<Mem> wave;
  Kokkos::View<std::uint32_t*, Kokkos::LayoutRight, Mem> status;
  static constexpr int threads = 1024, lengths = 64;
  static constexpr unsigned all = 0xffffffffu;
  struct Shared {
    int sums[threads / 32];
    int places[lengths];  // how many tiles have lists of about that length, the longest first; then where the next goes
  };

  __device__ void operator()(Shared& shared) const {
    std::int64_t const pairs = wave.pairs();
    bool const fits = pairs <= wave.pair_capacity;
    int const tiles = wave.images * wave.tiles(), each = (tiles + threads - 1) / threads, warp = int(threadIdx.x) / 32,
              lane = int(threadIdx.x) % 32, first = int(threadIdx.x) * each;
    auto const count = [&](int k) { return fits && first + k < tiles ? wave.tile_count(first + k) : 0; };
    if (threadIdx.x < lengths) shared.places[threadIdx.x] = 0;
    __syncthreads();
    int own = 0;
    for (int k = 0; k < each; ++k) {
      own += count(k);
      take(shared, first + k < tiles ? length(count(k)) : -1, lane);
    }
    int const upto = sum_upto_lane(own);
    if (lane == 31) shared.sums[warp] = upto;
    __syncthreads();
    int begin = upto - own;
    for (int w = 0; w < warp; ++w) begin += shared.sums[w];
    if (warp == 0) {
      int const even = shared.places[2 * lane], odd = shared.places[2 * lane + 1], before = sum_upto_lane(even + odd) - even - odd;
      shared.places[2 * lane] = before;
      shared.places[2 * lane + 1] = before + even;
    }
    __syncthreads();
    for (int k = 0; k < each; ++k) {
      bool const is_one = first + k < tiles;
      int const place = take(shared, is_one ? length(count(k)) : -1, lane);
      if (is_one) {
        wave.tile_order(place) = first + k;
        wave.tile_begin(first + k) = begin;
      }
      begin += count(k);
    }
    if (threadIdx.x == 0) {
      wave.tile_begin(tiles) = fits ? pairs : 0;
      wave.pairs() = fits ? pairs : 0;
      wave.needed(1) = pairs > wave.needed(1) ? pairs : wave.needed(1);
    }
    for (int k = int(threadIdx.x); !fits && k < wave.images; k += threads) status(wave.first + k) |= frame_overflow;
  }

 private:
  __device__ static int length(int pairs) {
    int const bits = 32 - __clz(pairs), half = bits > 1 ? pairs >> (bits - 2) & 1 : 0;
    return lengths - 1 - (2 * bits + half);  // pairs < 2^31
  }
  /// The lanes' next places among tiles of a length (-1: none), which count on.
  __device__ static int take(Shared& shared, int length, int lane) {
    unsigned const same = __match_any_sync(all, length);
    int const leader = __ffs(int(same)) - 1;
    int place = 0;
    if (lane == leader && length >= 0) place = atomicAdd(&shared.places[length], __popc(same));
    return __shfl_sync(all, place, leader) + __popc(same & ((1u << lane) - 1u));
  }
};

template <class Pairs>
__global__ void __launch_bounds__(Pairs::threads, 12) list_pairs_kernel(Pairs const __grid_constant__ pairs) {
  __shared__ typename Pairs::Shared shared;
  pairs(shared);
}
template <class Tiles>
__global__ void __launch_bounds__(Tiles::threads) begin_tiles_kernel(Tiles const __grid_constant__ tiles) {
  __shared__ typename Tiles::Shared shared;
  tiles(shared);
}
template <class Pairs>
__global__ void __launch_bounds__(256) place_pairs_kernel(Pairs const __grid_constant__ pairs) {
  pairs.place(std::int64_t(blockIdx.x) * 256 + threadIdx.x);
}
template <class Mem>
void list_pairs_on_cuda(Kokkos::Cuda const& exec, SplatWave<Mem> const& wave) {
  using Pairs = ListPairs<Mem>;
  launch_on_cuda("gsp::splat::bin_tiles_list", exec, [&](cudaStream_t stream) {
    list_pairs_kernel<<<unsigned((wave.visible_capacity + Pairs::threads - 1) / Pairs::threads), Pairs::threads, 0, stream>>>(Pairs{wave});
  });
}
template <class Mem, class Status>
void begin_tiles_on_cuda(Kokkos::Cuda const& exec, SplatWave<Mem> const& wave, Status const& status) {
  using Tiles = BeginTiles<Mem>;
  launch_on_cuda("gsp::splat::bin_tiles_begins", exec, [&](cudaStream_t stream) {
    begin_tiles_kernel<<<1, Tiles::threads, 0, stream>>>(Tiles{wave, status});
  });
}
template <class Mem>
void place_pairs_on_cuda(Kokkos::Cuda const& exec, SplatWave<Mem> const& wave) {
  launch_on_cuda("gsp::splat::bin_tiles_place", exec, [&](cudaStream_t stream) {
    place_pairs_kernel<<<unsigned((wave.pair_capacity + 255) / 256), 256, 0, stream>>>(ListPairs<Mem>{wave});
  });
}

}  // namespace gsp::detail
