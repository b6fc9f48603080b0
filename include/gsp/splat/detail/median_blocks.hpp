#pragma once
#include <gsp/splat/channels.hpp>
#include <gsp/splat/detail/lanes.hpp>
#include <gsp/splat/detail/splats_met.hpp>
#if defined(KOKKOS_ENABLE_CUDA) && defined(__CUDACC__)
#include <gsp/parallel/detail/launch_cuda.hpp>
#include <gsp/splat/detail/block_masks_cuda.hpp>
#endif

/// Kernels of gsp/splat/median_depth.hpp, where the contract stands.
namespace gsp::detail {

/// Where rays meet a Gaussian: z = numerator / denominator, a linear and a quadratic function of the pixel, written about the splat's
/// centre so that neither cancels. S^-1 is scaled by the least variance, which z does not see. Behind a lens they are functions of the
/// ray's place in the plane z = 1: since S^-1 mu = mu_z S^-1 d of the centre's ray d, six numbers say both, and the centre takes the
/// others.
/// S holds the blur of the picture too, as a ball: what a pixel shows of a Gaussian that is smaller than it is not where the Gaussian's
/// plane goes on to, far outside of it. A pixel's area in the plane of mu_z is mu_z^2 / (fx fy det J), J the lens's slope there, and
/// mu_z/|mu| of that across the ray.
struct RayDepth {
  static constexpr int size = 9;
  template <class Seen>
  KOKKOS_INLINE_FUNCTION static void of(Seen const& g, float* out) {
    Mat3<float> const turn = g.to_camera(), own = to_matrix(g.quat());
    Vec3<float> s = g.scale();
    Vec3<float> const p = g.position();
    double const* const m = g.link.m;
    Vec3<float> mu;
    for (int r = 0; r < 3; ++r)
      mu[r] = static_cast<float>(m[4 * r] * double(p.x) + m[4 * r + 1] * double(p.y) + m[4 * r + 2] * double(p.z) + m[4 * r + 3]);
    Vec3<float> const d = (1.f / mu.z) * mu;
    float area = mu.z * mu.z * static_cast<float>(1. / Kokkos::fabs(g.view.fx * g.view.fy)) / Kokkos::sqrt(dot(d, d));
    if constexpr (Seen::lensed) {
      LensSlope<float> const slope = distortion_slope(*g.view.lens, d.x, d.y);
      area /= max(fma(slope.xx, slope.yy, -slope.xy * slope.xy), 1e-6f);  // bounded where the disc of the lens ends: det J -> 0
    }
    float const blur = g.blur * area;
    for (int k = 0; k < 3; ++k) s[k] = Kokkos::sqrt(fma(s[k], s[k], blur));
    float const most = max(s.x, max(s.y, s.z));
    // without blur: a disc without thickness, as in splat_tree.hpp; a point, which rays do not meet: a ball
    for (int k = 0; k < 3; ++k) s[k] = most >= 1e-15f ? max(s[k], 1e-6f * most) : 1.f;
    float const least = min(s.x, min(s.y, s.z));
    Mat3<float> inverse;  // S^-1
    for (int k = 0; k < 9; ++k) inverse.m[k] = 0;
    for (int k = 0; k < 3; ++k) {
      Vec3<float> const axis = turn * column(own, k);
      float const w = least / s[k];
      for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j) inverse(i, j) = fma(w * w * axis[i], axis[j], inverse(i, j));
    }
    Vec3<float> const up = inverse * mu, down = inverse * d;
    if constexpr (Seen::lensed) {
      float const kept[size] = {dot(down, d), down.x, down.y, inverse(0, 0), 2.f * inverse(0, 1), inverse(1, 1), d.x, d.y, mu.z};
      for (int k = 0; k < size; ++k) out[k] = kept[k];
      return;
    }
    float const fx = static_cast<float>(1. / g.view.fx), fy = static_cast<float>(1. / g.view.fy);
    out[0] = dot(up, d);
    out[1] = up.x * fx;
    out[2] = up.y * fy;
    out[3] = dot(down, d);
    out[4] = 2.f * down.x * fx;
    out[5] = 2.f * down.y * fy;
    out[6] = inverse(0, 0) * fx * fx;
    out[7] = 2.f * inverse(0, 1) * fx * fy;
    out[8] = inverse(1, 1) * fy * fy;
  }
  /// Of a pixel (or a pack of them) so far from the centre.
  template <class P>
  KOKKOS_INLINE_FUNCTION static P at(float const* v, P const& dx, P const& dy) {
    P const numerator = fma(P(v[1]), dx, fma(P(v[2]), dy, P(v[0])));
    P const denominator = fma(dx, fma(P(v[6]), dx, fma(P(v[7]), dy, P(v[4]))), fma(dy, fma(P(v[8]), dy, P(v[5])), P(v[3])));
    return numerator / denominator;
  }
  /// Of a ray (or a pack of them) through that place, behind a lens.
  template <class P>
  KOKKOS_INLINE_FUNCTION static P along(float const* v, P const& x, P const& y) {
    P const dx = x - P(v[6]), dy = y - P(v[7]), half = fma(P(v[1]), dx, fma(P(v[2]), dy, P(v[0])));
    P const rest = fma(dx, fma(P(v[3]), dx, fma(P(v[4]), dy, P(v[1]))), dy * fma(P(v[5]), dy, P(v[2])));
    return P(v[8]) * half / (half + rest);
  }
};

/// The ray of a pixel behind a lens; not there where none comes to it.
struct PixelRay {
  float x = 0, y = 0;
  bool there = true;
  KOKKOS_INLINE_FUNCTION static PixelRay of(ImageView const& view, int column, int row) {
    LensPoint<double> ray;
    bool const there = undistorted(*view.lens, (column + 0.5 - view.cx) / view.fx, (row + 0.5 - view.cy) / view.fy, ray);
    return {static_cast<float>(ray.x), static_cast<float>(ray.y), there};
  }
};

/// A pixel on its way through its list: what it has met of those behind `from`, in order.
struct MedianPixel {
  static constexpr int room = 8;
  SplatsMet<float, room> met;
  float left = 1, from = 0, depth = 0;
  int from_source = Kokkos::Experimental::finite_max_v<int>;  // at 0: behind the eye
  bool done = false;

  KOKKOS_INLINE_FUNCTION void begin() { met.begin(left, 0.5f, Kokkos::Experimental::infinity_v<float>); }
  KOKKOS_INLINE_FUNCTION void add(float z, int source, float through) {
    if (z > from || (z == from && source > from_source)) met.add(z, source, through);
  }
  /// At the end of the list: does it have to go through it again?
  KOKKOS_INLINE_FUNCTION void end() {
    bool const taken = !met.empty() && met.left() <= 0.5f;
    if (taken) depth = met.last();
    done = taken || !met.full();
    if (done) return;
    left = met.left();
    from = met.last();
    from_source = met.last_source();
    begin();
  }
};

template <class Mem>
struct MedianPass {
  Frames<Mem> frames;
  Kokkos::View<float***, Kokkos::LayoutRight, Mem> image;
  float alpha_max;
  int first, of;  // numbers kept of a splat: where this channel's begin, and how many there are

  KOKKOS_INLINE_FUNCTION float const* kept(int splat) const { return frames.wave.values.data() + std::int64_t(splat) * of + first; }
};

/// A CPU's: a tile a task, a row of 16 pixels at a time.
template <class Mem, bool lensed>
struct MedianRows {
  MedianPass<Mem> pass;
  static constexpr int side = 16, W = native_width<float>, packs = side / W;
  using P = Pack<float, W>;

  void operator()(int index) const {
    auto const& frames = pass.frames;
    auto const& wave = frames.wave;
    int const tiles = wave.tiles(), columns = wave.grid.columns(), image = wave.first + index / tiles, tile = index % tiles;
    if (frames.status(image) != 0) return;
    int const x0 = tile % columns * side, y0 = tile / columns * side;
    for (int row = 0; row < side && y0 + row < frames.height; ++row)
      for (int k = 0; k < packs && x0 + k * W < frames.width; ++k) go(index, image, x0 + k * W, y0 + row);
  }

 private:
  void go(int index, int image, int x, int y) const {
    auto const& wave = pass.frames.wave;
    MedianPixel pixels[W];
    P centre;
    for (int i = 0; i < W; ++i) centre.set(i, static_cast<float>(x + i) + 0.5f);
    int const count = pass.frames.width - x < W ? pass.frames.width - x : W;
    for (int i = 0; i < count; ++i) pixels[i].begin();
    std::uint32_t open = count < 32 ? (std::uint32_t(1) << count) - 1 : ~std::uint32_t(0);
    P ray_x(0.f), ray_y(0.f);
    if constexpr (lensed)
      for (int i = 0; i < count; ++i) {
        PixelRay const ray = PixelRay::of(wave.image_views(image - wave.first), x + i, y);
        ray_x.set(i, ray.x);
        ray_y.set(i, ray.y);
        if (!ray.there) open &= ~(std::uint32_t(1) << i);
      }
    while (open != 0) {
      for (std::int64_t e = wave.tile_begin(index); e < wave.tile_begin(index + 1); ++e) {
        int const id = wave.tile_splats(e);
        Splat const& s = wave.splats(id);
        float const dy = static_cast<float>(y) + 0.5f - s.v, wy = s.l22 * dy;
        P const dx = centre - P(s.u), wx = fma(P(s.l11), dx, P(s.l21 * dy)), exponent = fma(-wx, wx, P(fma(-wy, wy, s.power)));
        std::uint32_t touched = lane_bits(exponent >= P(-splat_log2_255)) & open;
        if (touched == 0) continue;
        P const z = lensed ? RayDepth::along(pass.kept(id), ray_x, ray_y) : RayDepth::at(pass.kept(id), dx, P(dy)),
                through = P(1.f) - min(exp2(exponent), P(pass.alpha_max));
        for (; touched != 0; touched &= touched - 1) {
          int const i = Kokkos::countr_zero(touched);
          pixels[i].add(z[i], wave.origins(id).source, through[i]);
        }
      }
      for (std::uint32_t bits = open; bits != 0; bits &= bits - 1) {
        int const i = Kokkos::countr_zero(bits);
        pixels[i].end();
        if (pixels[i].done) open &= ~(std::uint32_t(1) << i);
      }
    }
    for (int i = 0; i < count; ++i) pass.image(image, y, x + i) = pixels[i].depth;
  }
};

#if defined(KOKKOS_ENABLE_CUDA) && defined(__CUDACC__)
/// A GPU's: a warp 8 x 4 pixels of a block, one a lane, of those splats whose masks say that they touch the block.
template <class Mem, bool lensed>
struct MedianBlocks {
  MedianPass<Mem> pass;

  __device__ void operator()() const {
    auto const& frames = pass.frames;
    auto const& wave = frames.wave;
    HalfBlock const at(wave);
    int const index = at.index, image = at.image, x = at.x, y = at.y;
    if (frames.status(image) != 0) return;
    bool const inside = x < frames.width && y < frames.height;
    PixelRay ray;
    if constexpr (lensed) ray = PixelRay::of(wave.image_views(image - wave.first), x, y);
    float const px = float(x) + 0.5f, py = float(y) + 0.5f;
    MedianPixel pixel;
    pixel.begin();
    pixel.done = !inside || !ray.there;
    std::int64_t const begin = wave.tile_begin(index), end = wave.tile_begin(index + 1);
    while (__any_sync(0xffffffffu, !pixel.done)) {
      for (std::int64_t chunk = 0; begin + 32 * chunk < end; ++chunk)
        for (std::uint32_t word = wave.block_masks(begin / 32 + index + chunk, at.block); word != 0; word &= word - 1) {
          int const id = wave.tile_splats(begin + 32 * chunk + __ffs(int(word)) - 1);
          Splat const s = wave.splats(id);
          float const dx = px - s.u, dy = py - s.v, wx = fmaf(s.l11, dx, s.l21 * dy), wy = s.l22 * dy;
          float const exponent = fmaf(-wx, wx, fmaf(-wy, wy, s.power));
          if (pixel.done || !(exponent >= -splat_log2_255)) continue;
          float const z = lensed ? RayDepth::along(pass.kept(id), ray.x, ray.y) : RayDepth::at(pass.kept(id), dx, dy);
          pixel.add(z, wave.origins(id).source, 1.f - fminf(exp2f(exponent), pass.alpha_max));
        }
      if (!pixel.done) pixel.end();
    }
    if (inside) pass.image(image, y, x) = pixel.depth;
  }
};
template <class Blocks>
__global__ void __launch_bounds__(HalfBlock::threads) median_blocks_kernel(Blocks const __grid_constant__ blocks) {
  blocks();
}
#endif

template <bool lensed, class Exec, class Mem>
void launch_medians(Exec const& exec, MedianPass<Mem> const& pass) {
  int const tiles = pass.frames.wave.images * pass.frames.wave.tiles();  // frame_sizes bounds it
  if constexpr (is_device<Exec>) {
#if defined(KOKKOS_ENABLE_CUDA) && defined(__CUDACC__)
    using Blocks = MedianBlocks<Mem, lensed>;
    launch_on_cuda("gsp::splat::median_depth", exec, [&](cudaStream_t stream) {
      median_blocks_kernel<<<unsigned(tiles) * HalfBlock::blocks_of_tile, HalfBlock::threads, 0, stream>>>(Blocks{pass});
    });
#endif
  } else {
    Kokkos::parallel_for("gsp::splat::median_depth",
                         Kokkos::RangePolicy<Exec, Kokkos::Schedule<Kokkos::Dynamic>>(exec, 0, tiles, Kokkos::ChunkSize(4)),
                         MedianRows<Mem, lensed>{pass});
  }
}
template <class Exec, class Mem>
void draw_medians(Exec const& exec, MedianPass<Mem> const& pass) {
  if (pass.frames.wave.lenses.extent(0) > 0)
    launch_medians<true>(exec, pass);
  else
    launch_medians<false>(exec, pass);
}

}  // namespace gsp::detail
