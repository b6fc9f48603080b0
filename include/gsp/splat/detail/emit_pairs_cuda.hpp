#pragma once
#include <gsp/parallel/detail/launch_cuda.hpp>
#include <gsp/splat/detail/bin_tiles_kernels.hpp>

namespace gsp::detail {

/// What EmitPairs does, on a GPU: a splat of few tiles a lane, those of more by all lanes of the warp together, a row of tiles each.
template <class Mem>
__global__ void __launch_bounds__(128) emit_pairs_kernel(EmitPairs<Mem> const __grid_constant__ emit) {
  constexpr unsigned all = 0xffffffffu;
  constexpr int few = 8;
  auto const& wave = emit.wave;
  std::int64_t const i = std::int64_t(blockIdx.x) * blockDim.x + threadIdx.x, count = wave.visible();
  int const lane = int(threadIdx.x) % 32;
  if (i - lane >= count || wave.pairs() == 0) return;
  bool const together = i < count && wave.pair_offset(i + 1) - wave.pair_offset(i) > few;
  if (i < count && !together) emit(i);
  for (unsigned word = __ballot_sync(all, together); word != 0; word &= word - 1) {
    std::int64_t const splat = i - lane + (__ffs(int(word)) - 1), end = wave.pair_offset(splat + 1);
    int const index = wave.order(splat), columns = wave.grid.columns();
    std::uint32_t const base = emit.first_key(wave.origins(index).image);
    Ellipse const e(wave.splats(index));
    PixelRange const pixels = e.rows(0, wave.grid.height - 1),
                     rows = pixels.first <= pixels.last ? wave.grid.rows_of(pixels) : PixelRange{0, -1};
    std::int64_t to = wave.pair_offset(splat);
    for (int top = rows.first; top <= rows.last; top += 32) {
      int const ty = top + lane;
      PixelRange const tiles = ty <= rows.last ? wave.grid.touched(e, pixels, ty) : PixelRange{0, -1};
      int const own = tiles.last - tiles.first + 1;
      int before = own;
      for (int step = 1; step < 32; step *= 2) {
        int const other = __shfl_up_sync(all, before, step);
        if (lane >= step) before += other;
      }
      std::int64_t const first = to + before - own;
      for (int k = 0; k < own && first + k < end; ++k) {
        wave.tile_keys(first + k) = base + std::uint32_t(ty * columns + tiles.first + k);
        wave.tile_splats(first + k) = index;
      }
      to += __shfl_sync(all, before, 31);
    }
    for (to += lane; to < end; to += 32) {  // cannot happen while counting and emitting round alike
      wave.tile_keys(to) = emit.pad;
      wave.tile_splats(to) = index;
    }
  }
}

template <class Mem>
void emit_pairs_on_cuda(Kokkos::Cuda const& exec, EmitPairs<Mem> const& emit) {
  constexpr int threads = 128;
  launch_on_cuda("gsp::splat::bin_tiles_emit", exec, [&](cudaStream_t stream) {
    emit_pairs_kernel<<<unsigned((emit.wave.visible_capacity + threads - 1) / threads), threads, 0, stream>>>(emit);
  });
}

}  // namespace gsp::detail
