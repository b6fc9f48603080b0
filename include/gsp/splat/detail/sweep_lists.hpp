#pragma once
#include <gsp/splat/channels.hpp>
#include <gsp/splat/detail/exact_sum.hpp>
#include <gsp/splat/detail/lanes.hpp>
#include <gsp/splat/detail/render_options.hpp>
#include <gsp/splat/wanted_pictures.hpp>
#if defined(KOKKOS_ENABLE_CUDA) && defined(__CUDACC__)
#include <gsp/parallel/detail/launch_cuda.hpp>
#include <gsp/splat/detail/block_masks_cuda.hpp>
#endif

/// A sweep over the lists of pictures that are drawn, which tells of each Gaussian at each pixel what the picture would lose with it. The
/// picture is affine in each alpha: with the light C_i that is still to come behind Gaussian i, which is the picture's less what has been
/// blended up to it, dropping i takes
///   D = w_i c_i - alpha_i / (1 - alpha_i) C_i,
/// and d picture / d alpha_i is D / alpha_i. With its factor L (splat.hpp), w = L^T d and h = log2(e) / 2, a Gaussian that grows by e keeps
///   d alpha / de = 2 ln 2 (|w|^2 - blur / h |L w|^2) alpha,
/// since of its covariance the blur does not grow. The fourth colour of a pixel is (z_i - z*) / z*, of whose light alpha (depth - depth*) /
/// depth* comes.
namespace gsp::detail {

KOKKOS_INLINE_FUNCTION float exp2(float x) { return Kokkos::exp2(x); }

/// A Gaussian at a pixel or a pack of them; all 0 where it does not count.
template <class P>
struct Loss {
  P weight, free;  // free: 1 where its alpha follows its opacity, 0 at alpha_max
  P light[4];      // D
  P growth;        // d ln alpha / d ln of its size
};
template <class P>
struct SweptPixel {
  P left, least;  // of the light; the exponent that an alpha must reach, infinity where the pixel is done
  P behind[4];    // light still to come
  P error[4];     // what the picture has more than the wanted one
  P depth, part;  // wanted depth, and sqrt(depth_weight) / depth, or 0
};

template <class Mem>
struct SweepPass {
  Frames<Mem> frames;
  WantedPictures<Mem> wanted;
  ExactSums<Mem> error;  // (C) adds E of each image; or empty
  float alpha_max, stop, blur;
  int first, of;  // numbers kept of a splat: where this sweep's begin, and how many there are

  KOKKOS_INLINE_FUNCTION float const* kept(int splat) const { return frames.wave.values.data() + std::int64_t(splat) * of + first; }

  /// A pixel before the first Gaussian.
  KOKKOS_INLINE_FUNCTION void begin(int image, int row, int column, SweptPixel<float>& p) const {
    p.left = 1;
    p.least = -splat_log2_255;
    p.depth = wanted.depth(image, row, column);
    p.part = p.depth > 0 ? Kokkos::sqrt(wanted.depth_weight) / p.depth : 0.f;
    for (int k = 0; k < 3; ++k) {
      p.behind[k] = frames.rgb(image, row, column, k);
      p.error[k] = p.behind[k] - wanted.rgb(image, row, column, k);
    }
    float const alpha = frames.alpha(image, row, column);
    p.behind[3] = p.part * alpha * (frames.depth(image, row, column) - p.depth);  // exactly 0 where the two are equal
    p.error[3] = p.behind[3];
  }
  /// The next Gaussian of the list, as `rasterize` blends it; `done` is set for pixels that end here.
  template <class P>
  KOKKOS_FORCEINLINE_FUNCTION auto step(SweptPixel<P>& p, P const& exponent, P const& wx, P const& wy, Splat const& s,
                                        Loss<P>& loss) const {
    constexpr float twice_ln2 = 1.38629436f, inverse_h = 1.38629436f;  // 2 ln 2; 2 / log2(e)
    auto const touched = exponent >= p.least;
    P const full = exp2(exponent), alpha = min(full, P(alpha_max)), next = p.left * (P(1.f) - alpha);
    auto const adds = touched && (next > P(stop)), stops = touched && (next <= P(stop));
    P const zero(0.f), back = select(adds, alpha / (P(1.f) - alpha), zero);
    loss.weight = select(adds, alpha * p.left, zero);
    loss.free = select(full < P(alpha_max), P(1.f), zero);
    P const across = P(s.l11) * wx, down = fma(P(s.l21), wx, P(s.l22) * wy);
    loss.growth = P(twice_ln2) * fma(P(-inverse_h * blur), fma(across, across, down * down), fma(wx, wx, wy * wy));
    P const colour[4] = {P(s.r), P(s.g), P(s.b), p.part * (P(s.depth) - p.depth)};
    for (int k = 0; k < 4; ++k) {
      P const own = loss.weight * colour[k];
      p.behind[k] = p.behind[k] - own;
      loss.light[k] = own - back * p.behind[k];
    }
    p.left = select(adds, next, p.left);
    p.least = select(stops, P(Kokkos::Experimental::infinity_v<float>), p.least);
    return stops;
  }
};

/// What is made of it (Use), copyable to the device:
///   size, passes                                  sums of an entry of a list, and how often the list is gone through
///   begin(pixel, pass)                            before a pass
///   take(pass, kept, splat, pixel, loss, sums)    one Gaussian at a pixel
///   give(frames, id, kept, sums, first, step)     sums of an entry over the pixels of a tile or a block, behind the last pass; as many
///                                                 callers as `step` share the work, of which this is number `first`
/// A CPU's: a tile a task, a row of 16 pixels a pack.
template <class Mem, class Use>
struct SweepRows {
  SweepPass<Mem> pass;
  Use use;
  static constexpr int side = 16, W = native_width<float>, packs = side / W;
  using P = Pack<float, W>;

  void operator()(int index) const {
    auto const& frames = pass.frames;
    auto const& wave = frames.wave;
    int const tiles = wave.tiles(), columns = wave.grid.columns(), image = wave.first + index / tiles, tile = index % tiles;
    if (frames.status(image) != 0) return;
    int const x0 = tile % columns * side, y0 = tile / columns * side;
    int const rows = frames.height - y0 < side ? frames.height - y0 : side, width = frames.width - x0 < side ? frames.width - x0 : side;
    SweptPixel<P> pixels[side][packs];
    P centre[packs];
    for (int k = 0; k < packs; ++k)
      for (int i = 0; i < W; ++i) centre[k].set(i, static_cast<float>(k * W + i) + 0.5f);
    for (int go = 0; go < Use::passes; ++go) {
      P squares(0.f);
      for (int row = 0; row < rows; ++row)
        for (int k = 0; k < packs; ++k) {
          begin(pixels[row][k], image, y0 + row, x0, k * W, width, go == 0);
          if (go == 0)
            for (P const& e : pixels[row][k].error) squares = fma(e, e, squares);
          use.begin(pixels[row][k], go);
        }
      if (go == 0 && pass.error.low.extent(0) > 0) pass.error.add(image, sum(squares));
      run(index, x0, y0, rows, pixels, centre, go);
    }
  }

 private:
  static float sum(P const& x) {
    float s = 0;
    for (int i = 0; i < W; ++i) s += x[i];
    return s;
  }
  void begin(SweptPixel<P>& p, int image, int row, int x0, int from, int width, bool errors) const {
    for (int i = 0; i < W; ++i) {
      SweptPixel<float> one{};
      one.least = Kokkos::Experimental::infinity_v<float>;
      if (from + i < width) pass.begin(image, row, x0 + from + i, one);
      p.left.set(i, one.left);
      p.least.set(i, one.least);
      p.depth.set(i, one.depth);
      p.part.set(i, one.part);
      for (int k = 0; k < 4; ++k) {
        p.behind[k].set(i, one.behind[k]);
        if (errors) p.error[k].set(i, one.error[k]);
      }
    }
  }
  void run(int index, int x0, int y0, int rows, SweptPixel<P> (&pixels)[side][packs], P const (&centre)[packs], int go) const {
    auto const& wave = pass.frames.wave;
    bool done[side] = {};
    int rows_done = 0;
    std::int64_t const end = wave.tile_begin(index + 1);
    for (std::int64_t e = wave.tile_begin(index); e < end && rows_done < rows; ++e) {
      int const id = wave.tile_splats(e);
      Splat const& s = wave.splats(id);
      float const* const kept = pass.kept(id);
      float const middle = s.v - static_cast<float>(y0) - 0.5f, reach = s.ye + 0.01f;  // rows as in RasterizeRows
      int const top = middle - reach > 0.f ? static_cast<int>(min(middle - reach, 16.f)) : 0;
      int const bottom = middle + reach < static_cast<float>(rows) ? static_cast<int>(max(middle + reach, -1.f)) : rows - 1;
      P const l11(s.l11);
      float const left = s.u - static_cast<float>(x0);
      P sums[Use::size];
      for (P& x : sums) x = P(0.f);
      bool met = false;
      for (int row = top; row <= bottom; ++row) {
        if (done[row]) continue;
        float const dy = static_cast<float>(y0 + row) + 0.5f - s.v, wy = s.l22 * dy;
        P const across(fma(s.l21, dy, -(s.l11 * left))), most(fma(-wy, wy, s.power));
        bool ends = false;
        for (int k = 0; k < packs; ++k) {
          auto& p = pixels[row][k];
          P const wx = fma(l11, centre[k], across), exponent = fma(-wx, wx, most);
          if (!any_lane(exponent >= p.least)) continue;
          met = true;
          Loss<P> loss;
          auto const stops = pass.step(p, exponent, wx, P(wy), s, loss);
          use.take(go, kept, s, p, loss, sums);
          ends |= any_lane(stops);
        }
        if (!ends) continue;
        bool all = true;
        for (auto const& p : pixels[row]) all &= !any_lane(p.least < P(Kokkos::Experimental::infinity_v<float>));
        done[row] = all;
        rows_done += all;
      }
      if (!met || go + 1 < Use::passes) continue;
      float totals[Use::size];
      for (int n = 0; n < Use::size; ++n) totals[n] = sum(sums[n]);
      use.give(pass.frames, id, kept, totals, 0, 1);
    }
  }
};

#if defined(KOKKOS_ENABLE_CUDA) && defined(__CUDACC__)
/// A GPU's: a warp 8 x 4 pixels of a block, one a lane, of those splats whose masks say that they touch the block.
template <class Mem, class Use>
struct SweepBlocks {
  SweepPass<Mem> pass;
  Use use;
  static constexpr unsigned all = 0xffffffffu;

  __device__ void operator()() const {
    auto const& frames = pass.frames;
    auto const& wave = frames.wave;
    HalfBlock const at(wave);
    int const image = at.image, x = at.x, y = at.y, lane = int(threadIdx.x) % 32;
    if (frames.status(image) != 0) return;
    bool const inside = x < frames.width && y < frames.height;
    if (!__any_sync(all, inside)) return;
    float const px = float(x) + 0.5f, py = float(y) + 0.5f;
    SweptPixel<float> p{};
    for (int go = 0; go < Use::passes; ++go) {
      SweptPixel<float> fresh{};
      fresh.least = Kokkos::Experimental::infinity_v<float>;
      if (inside) pass.begin(image, y, x, fresh);
      if (go > 0)
        for (int k = 0; k < 4; ++k) fresh.error[k] = p.error[k];
      p = fresh;
      if (go == 0 && pass.error.low.extent(0) > 0) {
        float squares = 0;
        for (int k = 0; k < 4; ++k) squares = fmaf(p.error[k], p.error[k], squares);
        squares = sum(squares);
        if (lane == 0) pass.error.add(image, squares);
      }
      use.begin(p, go);
      run(at.index, at.block, lane, px, py, p, go);
    }
  }

 private:
  __device__ static float sum(float x) {
    for (int step = 16; step > 0; step /= 2) x += __shfl_xor_sync(all, x, step);
    return x;
  }
  __device__ void run(int index, int block, int lane, float px, float py, SweptPixel<float>& p, int go) const {
    auto const& wave = pass.frames.wave;
    std::int64_t const begin = wave.tile_begin(index), end = wave.tile_begin(index + 1);
    for (std::int64_t chunk = 0; begin + 32 * chunk < end; ++chunk) {
      if (!__any_sync(all, p.least < Kokkos::Experimental::infinity_v<float>)) return;
      for (std::uint32_t word = wave.block_masks(begin / 32 + index + chunk, block); word != 0; word &= word - 1) {
        int const id = wave.tile_splats(begin + 32 * chunk + __ffs(int(word)) - 1);
        Splat const s = wave.splats(id);
        float const dx = px - s.u, dy = py - s.v, wx = fmaf(s.l11, dx, s.l21 * dy), wy = s.l22 * dy;
        float const exponent = fmaf(-wx, wx, fmaf(-wy, wy, s.power));
        if (!__any_sync(all, exponent >= p.least)) continue;
        float const* const kept = pass.kept(id);
        Loss<float> loss;
        pass.step(p, exponent, wx, wy, s, loss);
        float sums[Use::size] = {};
        use.take(go, kept, s, p, loss, sums);
        if (go + 1 < Use::passes) continue;
        for (float& x : sums) x = sum(x);
        use.give(pass.frames, id, kept, sums, lane, 32);
      }
    }
  }
};
template <class Blocks>
__global__ void __launch_bounds__(HalfBlock::threads) sweep_blocks_kernel(Blocks const __grid_constant__ blocks) {
  blocks();
}
#endif

template <class Exec, class Mem, class Use>
void sweep_lists(std::string const& label, Exec const& exec, SweepPass<Mem> const& pass, Use const& use) {
  int const tiles = pass.frames.wave.images * pass.frames.wave.tiles();  // frame_sizes bounds it
  if constexpr (is_device<Exec>) {
#if defined(KOKKOS_ENABLE_CUDA) && defined(__CUDACC__)
    using Blocks = SweepBlocks<Mem, Use>;
    launch_on_cuda(label, exec, [&](cudaStream_t stream) {
      sweep_blocks_kernel<<<unsigned(tiles) * HalfBlock::blocks_of_tile, HalfBlock::threads, 0, stream>>>(Blocks{pass, use});
    });
#endif
  } else {
    Kokkos::parallel_for(label, Kokkos::RangePolicy<Exec, Kokkos::Schedule<Kokkos::Dynamic>>(exec, 0, tiles, Kokkos::ChunkSize(4)),
                         SweepRows<Mem, Use>{pass, use});
  }
}

}  // namespace gsp::detail
