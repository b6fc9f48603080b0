#pragma once
#include <gsp/parallel/detail/launch_cuda.hpp>
#include <gsp/parallel/detail/warp_cuda.hpp>
#include <gsp/splat/detail/block_masks_cuda.hpp>
#include <gsp/splat/frames.hpp>

namespace gsp::detail {

/// Puts the list of a tile in order, front to back and by source where depths are equal, and makes its masks: a block a tile.
/// A radix sort by the first of the bits in which the list's depths differ, after which pairs that are still alike stand together, few at a
/// time: each counts the neighbours that come before it, by depth and by source. Where more than a few are alike (a wall that faces the
/// camera) the list is sorted by all bits of source and depth instead. A pass: each warp counts the digits of its part of the list, sums
/// over warps and digits say where each goes, and those of one digit keep their order.
/// Lists from `least` pairs on; up to `most` in registers and the block's own memory, by two digits; longer ones by three, in the wave's,
/// if the block takes those.
template <class Mem, int warps, int digit_bits, int rounds_here, bool takes_longer>
struct SortTiles {
  SplatWave<Mem> wave;
  int least;
  static constexpr int threads = 32 * warps, digits = 1 << digit_bits, most = rounds_here * threads, few = 32;
  static constexpr int key_bits = 2 * digit_bits, place_bits = 32 - key_bits;
  static constexpr unsigned all = 0xffffffffu;
  static_assert(most <= 1 << place_bits && digits <= threads);
  struct Shared {
    std::uint32_t pairs[most];  // first the bits of the depth, then where in the list it is
    int counts[warps][digits];  // of a warp and digit; then where the next goes
    int sums[warps];
    std::uint32_t least, greatest;  // depth
    int shift;                      // of the key, (depth - least) >> shift
  };

  __device__ void operator()(Shared& shared) const {
    int const index = wave.tile_order(blockIdx.x);
    std::int64_t const begin = wave.tile_begin(index);
    int const n = int(wave.tile_begin(index + 1) - begin);
    if (n < least || (n > most && !takes_longer)) return;
    TilePair* const list = &wave.pair_list(begin);
    TilePair* const scratch = reinterpret_cast<TilePair*>(wave.pair_pool.data()) + begin;  // the pool is empty by now
    bool crowded = true;
    if (n <= most)
      crowded = sort_here(shared, list, begin, n);
    else if constexpr (takes_longer)
      crowded = sort_there(shared, list, scratch, begin, n);
    if (crowded) {
      int const of_source = (32 - __clz(32 * wave.words) + digit_bits - 1) / digit_bits, of_depth = (32 + digit_bits - 1) / digit_bits;
      TilePair const* const sorted = passes(shared, list, scratch, n, of_source + of_depth, [&](TilePair const& p, int pass) {
        return pass < of_source ? unsigned(wave.origins(p.splat).source) >> digit_bits * pass : p.depth >> digit_bits * (pass - of_source);
      });
      for (int i = int(threadIdx.x); i < n; i += threads) wave.tile_splats(begin + i) = sorted[i].splat;
      __syncthreads();
    }
    masks(index, begin, n);
  }

 private:
  /// Round k of a warp holds the 32 pairs behind those of round k - 1.
  __device__ static int rounds_of(int n) { return (n + threads - 1) / threads; }
  __device__ static int first_of(int n) { return int(threadIdx.x) / 32 * 32 * rounds_of(n) + int(threadIdx.x) % 32; }

  /// In registers, from where all of a digit go is known, to the block's memory and back. True as `finish`.
  __device__ bool sort_here(Shared& shared, TilePair const* list, std::int64_t begin, int n) const {
    int const rounds = rounds_of(n), first = first_of(n);
    int* const counts = shared.counts[threadIdx.x / 32];
    std::uint32_t pair[rounds_here], least = ~0u, greatest = 0;
    int rank[rounds_here];
    for_rounds(rounds, [&](int k) {
      int const at = first + 32 * k;
      if (at >= n) return;
      pair[k] = list[at].depth;
      least = pair[k] < least ? pair[k] : least;
      greatest = pair[k] > greatest ? pair[k] : greatest;
    });
    range(shared, least, greatest, key_bits);
    for_rounds(rounds, [&](int k) { pair[k] = (pair[k] - shared.least) >> shared.shift << place_bits | std::uint32_t(first + 32 * k); });
    for (int from = place_bits; from < 32; from += digit_bits) {
      auto const digit = [&](std::uint32_t p) { return int(p >> from & (digits - 1u)); };
      clear(shared);
      for_rounds(rounds, [&](int k) { rank[k] = take(counts, first + 32 * k < n ? digit(pair[k]) : -1); });
      __syncthreads();
      places(shared);
      for_rounds(rounds, [&](int k) {
        if (first + 32 * k < n) shared.pairs[counts[digit(pair[k])] + rank[k]] = pair[k];
      });
      __syncthreads();
      if (from == place_bits) for_rounds(rounds, [&](int k) { pair[k] = first + 32 * k < n ? shared.pairs[first + 32 * k] : 0; });
    }
    return finish(
        begin, n, [&](int i) { return shared.pairs[i] >> place_bits; },
        [&](int i) { return list[shared.pairs[i] & ((1u << place_bits) - 1u)]; });
  }
  /// In memory. True as `finish`.
  __device__ bool sort_there(Shared& shared, TilePair* list, TilePair* scratch, std::int64_t begin, int n) const {
    std::uint32_t least = ~0u, greatest = 0;
    for (int i = int(threadIdx.x); i < n; i += threads) {
      std::uint32_t const depth = list[i].depth;
      least = depth < least ? depth : least;
      greatest = depth > greatest ? depth : greatest;
    }
    range(shared, least, greatest, 3 * digit_bits);
    TilePair const* const sorted =
        passes(shared, list, scratch, n, 3, [&](TilePair const& p, int pass) { return key(shared, p) >> digit_bits * pass; });
    return finish(
        begin, n, [&](int i) { return key(shared, sorted[i]); }, [&](int i) { return sorted[i]; });
  }
  __device__ static std::uint32_t key(Shared const& shared, TilePair const& p) { return (p.depth - shared.least) >> shared.shift; }
  /// Sorts by the last digit of of_pass(pair, 0), then 1 ..., between the two places. Returns where they end.
  template <class OfPass>
  __device__ static TilePair* passes(Shared& shared, TilePair* from, TilePair* to, int n, int count, OfPass const& of_pass) {
    int const rounds = rounds_of(n), first = first_of(n);
    int* const counts = shared.counts[threadIdx.x / 32];
    for (int pass = 0; pass < count; ++pass) {
      auto const digit = [&](TilePair const& p) { return int(of_pass(p, pass) & (digits - 1u)); };
      clear(shared);
      for (int k = 0; k < rounds; ++k)
        if (first + 32 * k < n) atomicAdd(&counts[digit(from[first + 32 * k])], 1);
      __syncthreads();
      places(shared);
      for (int k = 0; k < rounds; ++k) {
        bool const there = first + 32 * k < n;
        TilePair const p = there ? from[first + 32 * k] : TilePair{};
        int const place = take(counts, there ? digit(p) : -1);
        if (there) to[place] = p;
      }
      __syncthreads();
      TilePair* const last = from;
      from = to;
      to = last;
    }
    return from;
  }

  template <class F>
  __device__ static void for_rounds(int rounds, F const& f) {
#pragma unroll
    for (int k = 0; k < rounds_here; ++k) {
      if (k >= rounds) return;
      f(k);
    }
  }
  /// From the least and greatest depths of each thread: what a key of so many bits is made of.
  __device__ static void range(Shared& shared, std::uint32_t least, std::uint32_t greatest, int most_bits) {
    if (threadIdx.x == 0) {
      shared.least = ~0u;
      shared.greatest = 0;
    }
    for (int step = 16; step > 0; step /= 2) {
      std::uint32_t const a = __shfl_xor_sync(all, least, step), b = __shfl_xor_sync(all, greatest, step);
      least = a < least ? a : least;
      greatest = b > greatest ? b : greatest;
    }
    __syncthreads();
    if (threadIdx.x % 32 == 0) {
      atomicMin(&shared.least, least);
      atomicMax(&shared.greatest, greatest);
    }
    __syncthreads();
    if (threadIdx.x == 0) {
      int const bits = 32 - __clz(int(shared.greatest - shared.least));
      shared.shift = bits > most_bits ? bits - most_bits : 0;
    }
    __syncthreads();
  }
  __device__ static void clear(Shared& shared) {
    if (threadIdx.x < digits)
      for (int w = 0; w < warps; ++w) shared.counts[w][threadIdx.x] = 0;
    __syncthreads();
  }
  /// The lanes' next places among those of their digit (-1: none), which count on.
  __device__ static int take(int* counts, int digit) {
    unsigned const same = __match_any_sync(all, digit);
    int const lane = int(threadIdx.x) % 32, leader = __ffs(int(same)) - 1;
    int place = 0;
    if (lane == leader && digit >= 0) {
      place = counts[digit];
      counts[digit] = place + __popc(same);
    }
    __syncwarp();  // what one lane has counted, another may read in the next round
    return __shfl_sync(all, place, leader) + __popc(same & ((1u << lane) - 1u));
  }
  /// From how many there are to where they go.
  __device__ static void places(Shared& shared) {
    int const digit = int(threadIdx.x), warp = digit / 32, lane = digit % 32;
    bool const is_one = digit < digits;
    int own[warps], sum = 0;
#pragma unroll
    for (int w = 0; w < warps; ++w) own[w] = is_one ? shared.counts[w][digit] : 0;
#pragma unroll
    for (int w = 0; w < warps; ++w) sum += own[w];
    int const upto = sum_upto_lane(sum);
    if (lane == 31) shared.sums[warp] = upto;
    __syncthreads();
    int before = upto - sum;
    for (int w = 0; w < warp; ++w) before += shared.sums[w];
#pragma unroll
    for (int w = 0; w < warps; ++w) {
      if (is_one) shared.counts[w][digit] = before;
      before += own[w];
    }
    __syncthreads();
  }

  /// Writes the list, given in the order of keys. True where more than a few have one key: then it is not in order.
  template <class Key, class PairAt>
  __device__ bool finish(std::int64_t begin, int n, Key const& key, PairAt const& pair) const {
    bool crowded = false;
    auto const near = [&](int i) { return pair(i < n ? i : n - 1); };
    TilePair next = near(int(threadIdx.x));
    for (int i = int(threadIdx.x); i < n; i += threads) {
      TilePair const p = next;
      next = near(i + threads);
      std::uint32_t const own = key(i);
      int low = i, high = i + 1;
      while (low > 0 && i - low < few && key(low - 1) == own) --low;
      while (high < n && high - i < few && key(high) == own) ++high;
      int to = low;
      for (int k = low; high - low > 1 && k < high; ++k) {
        TilePair const q = pair(k);
        to += q.depth < p.depth || (q.depth == p.depth && wave.origins(q.splat).source < wave.origins(p.splat).source);
      }
      crowded = crowded || i - low == few || high - i == few;
      wave.tile_splats(begin + to) = p.splat;
    }
    return __syncthreads_or(crowded);
  }

  /// Which blocks of 8 x 8 pixels the splats touch, for every 32 of them a word a block (SplatWave::block_masks).
  __device__ void masks(int index, std::int64_t begin, int n) const {
    using M = BlockMasks;
    int const tile = index % wave.tiles(), lane = int(threadIdx.x) % 32, columns = wave.grid.columns();
    int const x0 = tile % columns * (M::across * M::side), y0 = tile / columns * (M::down * M::side);
    auto const splat_at = [&](int at) { return wave.splats(wave.tile_splats(begin + (at < n ? at : n - 1))); };
    int chunk = int(threadIdx.x) / 32;
    Splat next = splat_at(32 * chunk + lane);
    for (; 32 * chunk < n; chunk += warps) {
      Splat const splat = next;
      next = splat_at(32 * (chunk + warps) + lane);
      unsigned word = 32 * chunk + lane < n ? M::touched(splat, x0, y0) : 0;
      // bit b of lane l becomes bit l of lane b: halves, quarters ... change places
      unsigned keep = 0x0000ffffu;
#pragma unroll
      for (int step = 16; step > 0; step /= 2) {
        unsigned const other = __shfl_xor_sync(all, word, step);
        word = lane & step ? (word & ~keep) | ((other & ~keep) >> step) : (word & keep) | ((other & keep) << step);
        keep ^= keep << step / 2;
      }
      wave.block_masks(begin / 32 + index + chunk, lane) = word;
    }
  }
};

template <class Tiles, int blocks>
__global__ void __launch_bounds__(Tiles::threads, blocks) sort_tiles_kernel(Tiles const __grid_constant__ tiles) {
  extern __shared__ std::uint32_t memory[];
  tiles(*reinterpret_cast<typename Tiles::Shared*>(memory));
}
template <int blocks, class Tiles>
void sort_lists_on_cuda(cudaStream_t stream, unsigned count, Tiles const& tiles) {
  auto const kernel = sort_tiles_kernel<Tiles, blocks>;
  constexpr int bytes = sizeof(typename Tiles::Shared);
  if (bytes > 48 << 10)
    cuda_expects(cudaFuncSetAttribute(kernel, cudaFuncAttributeMaxDynamicSharedMemorySize, bytes), "gsp::splat::bin_tiles_sort");
  kernel<<<count, Tiles::threads, bytes, stream>>>(tiles);
}
/// Lists of up to 1,024 pairs by small blocks, of which a multiprocessor holds many; the others by large ones.
template <class Mem>
void sort_tiles_on_cuda(Kokkos::Cuda const& exec, SplatWave<Mem> const& wave) {
  using Small = SortTiles<Mem, 4, 7, 8, false>;
  using Large = SortTiles<Mem, 16, 9, 15, true>;
  unsigned const tiles = unsigned(wave.images * wave.tiles());
  launch_on_cuda("gsp::splat::bin_tiles_sort", exec, [&](cudaStream_t stream) {
    sort_lists_on_cuda<10>(stream, tiles, Small{wave, 1});
    sort_lists_on_cuda<2>(stream, tiles, Large{wave, Small::most + 1});
  });
}

}  // namespace gsp::detail
