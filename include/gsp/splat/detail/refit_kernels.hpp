#pragma once
#include <gsp/splat/detail/spherical_harmonics.hpp>
#include <gsp/splat/detail/sweep_lists.hpp>

/// Kernels of gsp/splat/refit_gaussians.hpp, where the contract stands. Unknowns of Gaussian `place`: row 3 k + channel its SH, row 3 K its
/// opacity, row 3 K + 1 the logarithm of its size; number row x n + place.
namespace gsp::detail {

KOKKOS_INLINE_FUNCTION int colours_of(int sh_degree) { return 3 * (sh_degree + 1) * (sh_degree + 1); }
KOKKOS_INLINE_FUNCTION int unknowns_of(int sh_degree) { return colours_of(sh_degree) + 2; }

/// What is kept of a Gaussian in an image: where its unknowns stand, and what the direction of a step changes of it.
template <class Mem>
struct StepOfGaussian {
  Kokkos::View<float*, Kokkos::LayoutRight, Mem> direction;  // of all unknowns; empty: none
  static constexpr int size = 10;  // place, 1 / opacity, its relative change, change of r g b, view (x y z), change of size
  template <class Seen>
  KOKKOS_INLINE_FUNCTION void of(Seen const& g, float* out) const {
    int const degree = g.cloud.sh_degree, n = g.cloud.count, colours = colours_of(degree);
    Vec3<float> d = g.position() - Vec3<float>{g.link.eye[0], g.link.eye[1], g.link.eye[2]};
    if (degree > 0) d = normalized(d);
    out[0] = Kokkos::bit_cast<float>(g.place);
    out[1] = exp2(-g.cloud.power(g.place));
    for (int k = 2; k < 6; ++k) out[k] = 0;
    for (int k = 0; k < 3; ++k) out[6 + k] = d[k];
    out[9] = 0;
    if (direction.extent(0) == 0) return;
    auto const along = [&](int row) { return direction(std::int64_t(row) * n + g.place); };
    out[2] = along(colours) * out[1];
    out[9] = along(colours + 1);
    each_sh_term(degree, d, [&](int k, float y) {
      for (int c = 0; c < 3; ++c) out[3 + c] = fma(y, along(3 * k + c), out[3 + c]);
    });
    float const lit[3] = {g.splat.r, g.splat.g, g.splat.b};
    for (int c = 0; c < 3; ++c) out[3 + c] = lit[c] > 0 ? out[3 + c] : 0.f;  // what stands at 0 stays there
  }
};

/// d colour / d SH, d alpha / d opacity and d alpha / d ln size of a Gaussian in an image: f(number of the unknown, which of r, g, b,
/// opacity and size, derivative).
template <class F>
KOKKOS_INLINE_FUNCTION void each_unknown(int degree, int n, Splat const& s, float const* kept, int first, int step, F const& f) {
  float Y[16];
  each_sh_term(degree, Vec3<float>{kept[6], kept[7], kept[8]}, [&](int k, float y) { Y[k] = y; });
  int const place = Kokkos::bit_cast<int>(kept[0]), colours = colours_of(degree);
  for (int row = first; row < colours + 2; row += step) {
    int const which = row < colours ? row % 3 : 3 + row - colours;
    float const lit = which == 0 ? s.r : which == 1 ? s.g : which == 2 ? s.b : 1.f;
    if (lit > 0) f(std::int64_t(row) * n + place, which, which < 3 ? Y[row / 3] : which == 3 ? kept[1] : 1.f);
  }
}

/// J^T e, and the diagonal of J^T J.
template <class Mem>
struct GradientUse {
  using Sums = Kokkos::View<std::int64_t*, Kokkos::LayoutRight, Mem>;
  Sums gradient, diagonal;
  int degree, n;
  static constexpr int size = 8, passes = 1;  // of r g b, opacity and size; squares of light, opacity and size
  template <class P>
  KOKKOS_INLINE_FUNCTION void begin(SweptPixel<P>&, int) const {}
  template <class P>
  KOKKOS_FORCEINLINE_FUNCTION void take(int, float const*, Splat const&, SweptPixel<P> const& p, Loss<P> const& l, P* sums) const {
    for (int k = 0; k < 3; ++k) sums[k] = fma(l.weight, p.error[k], sums[k]);
    sums[5] = fma(l.weight, l.weight, sums[5]);
    for (int k = 0; k < 4; ++k) {
      P const change = l.free * l.light[k], grown = l.growth * change;
      sums[3] = fma(change, p.error[k], sums[3]);
      sums[4] = fma(grown, p.error[k], sums[4]);
      sums[6] = fma(change, change, sums[6]);
      sums[7] = fma(grown, grown, sums[7]);
    }
  }
  KOKKOS_INLINE_FUNCTION void give(Frames<Mem> const& frames, int id, float const* kept, float const* sums, int first, int step) const {
    each_unknown(degree, n, frames.wave.splats(id), kept, first, step, [&](std::int64_t number, int which, float slope) {
      Kokkos::atomic_add(&gradient(number), to_exact(slope * sums[which]));
      Kokkos::atomic_add(&diagonal(number), to_exact(slope * slope * sums[which < 3 ? 5 : 3 + which]));
    });
  }
};

/// J^T J times a direction: the first pass finds what the picture changes by, the second what that is to each unknown.
template <class Mem>
struct ProductUse {
  Kokkos::View<std::int64_t*, Kokkos::LayoutRight, Mem> product;
  int degree, n;
  static constexpr int size = 5, passes = 2;
  template <class P>
  KOKKOS_INLINE_FUNCTION void begin(SweptPixel<P>& p, int pass) const {
    for (int k = 0; k < 4 && pass == 0; ++k) p.error[k] = P(0.f);
  }
  template <class P>
  KOKKOS_FORCEINLINE_FUNCTION void take(int pass, float const* kept, Splat const&, SweptPixel<P>& p, Loss<P> const& l, P* sums) const {
    P const change = l.free * fma(l.growth, P(kept[9]), P(kept[2]));
    if (pass == 0) {
      for (int k = 0; k < 3; ++k) p.error[k] = fma(l.weight, P(kept[3 + k]), p.error[k]);
      for (int k = 0; k < 4; ++k) p.error[k] = fma(change, l.light[k], p.error[k]);
      return;
    }
    for (int k = 0; k < 3; ++k) sums[k] = fma(l.weight, p.error[k], sums[k]);
    for (int k = 0; k < 4; ++k) {
      P const both = l.free * l.light[k] * p.error[k];
      sums[3] = sums[3] + both;
      sums[4] = fma(l.growth, both, sums[4]);
    }
  }
  KOKKOS_INLINE_FUNCTION void give(Frames<Mem> const& frames, int id, float const* kept, float const* sums, int first, int step) const {
    each_unknown(degree, n, frames.wave.splats(id), kept, first, step,
                 [&](std::int64_t number, int which, float slope) { Kokkos::atomic_add(&product(number), to_exact(slope * sums[which])); });
  }
};

/// Draws nothing; its pass is a sweep of unknowns.
template <class Mem, class Use>
struct RefitChannel {
  WantedPictures<Mem> wanted;
  ExactSums<Mem> error;
  StepOfGaussian<Mem> step;
  Use use;
  static constexpr int size = StepOfGaussian<Mem>::size;
  template <class Seen>
  KOKKOS_INLINE_FUNCTION void value(Seen const& g, float* out) const {
    step.of(g, out);
  }
  template <class P>
  KOKKOS_INLINE_FUNCTION void blend(P*, float const*, Blend<P> const&) const {}
  KOKKOS_INLINE_FUNCTION void store(int, int, int, float const*) const {}
  template <ExecutionSpace Exec>
  void draw(Exec const& exec, Frames<Mem> const& frames, RenderOptions const& options, int first, int of) const {
    sweep_lists("gsp::splat::refit_gaussians", exec,
                SweepPass<Mem>{frames, wanted, error, options.alpha_max, options.stop, options.blur, first, of}, use);
  }
};

/// Conjugate gradients for (J^T J + damping D + floor) x = -J^T e, D the diagonal of J^T J, with the diagonal as preconditioner.
template <class Mem>
struct RefitVectors {
  template <class T>
  using View = Kokkos::View<T*, Kokkos::LayoutRight, Mem>;
  View<std::int64_t> gradient, diagonal, product;  // exact sums; beyond 8.5e9 they wrap, and E judges what they led to
  View<float> change, left, direction, inverse;    // x, the residual, where to go, of the preconditioner (0: stands still)

  KOKKOS_INLINE_FUNCTION double square_left(std::int64_t i) const { return double(left(i)) * left(i) * inverse(i); }
};
template <class Mem>
struct BeginRefit {
  RefitVectors<Mem> v;
  Gaussians<Mem> cloud;
  bool colours, opacities, sizes;
  double damping, floor;
  float least;  // opacity
  KOKKOS_FUNCTION void operator()(std::int64_t i) const {
    int const n = cloud.count, place = int(i % n), row = int(i / n) - colours_of(cloud.sh_degree);
    bool const of_opacity = row == 0;
    double const g = from_exact(v.gradient(i)), d = from_exact(v.diagonal(i));
    bool stands = row < 0 ? !colours : of_opacity ? !opacities : !sizes;
    if (of_opacity) {  // at an end of its range, and pushed beyond
      float const o = exp2(cloud.power(place));
      stands = stands || (o >= 1 && g < 0) || (o <= least && g > 0);
    }
    v.inverse(i) = stands || !(d > 0) ? 0.f : static_cast<float>(1 / (d * (1 + damping) + floor));
    v.change(i) = 0;
    v.left(i) = static_cast<float>(-g);
    v.direction(i) = v.left(i) * v.inverse(i);
  }
};
/// Sums of 256 neighbours each, in order; the host adds those in order.
template <class Mem, class Term>
struct PartialSums {
  Term term;
  Kokkos::View<double*, Kokkos::LayoutRight, Mem> sums;
  std::int64_t n;
  static constexpr std::int64_t run = 256;
  KOKKOS_FUNCTION void operator()(std::int64_t i) const {
    std::int64_t const end = (i + 1) * run < n ? (i + 1) * run : n;
    double s = 0;
    for (std::int64_t k = i * run; k < end; ++k) s += term(k);
    sums(i) = s;
  }
};
template <class Mem>
struct LeftTerm {
  RefitVectors<Mem> v;
  KOKKOS_INLINE_FUNCTION double operator()(std::int64_t i) const { return v.square_left(i); }
};
template <class Mem>
struct CurvatureTerm {
  RefitVectors<Mem> v;
  double damping, floor;
  KOKKOS_INLINE_FUNCTION double image(std::int64_t i) const {
    return from_exact(v.product(i)) + (damping * from_exact(v.diagonal(i)) + floor) * double(v.direction(i));
  }
  KOKKOS_INLINE_FUNCTION double operator()(std::int64_t i) const { return v.inverse(i) > 0 ? double(v.direction(i)) * image(i) : 0.; }
};
template <class Mem>
struct GoAlong {
  CurvatureTerm<Mem> of;
  double far;
  KOKKOS_FUNCTION void operator()(std::int64_t i) const {
    auto const& v = of.v;
    v.change(i) = static_cast<float>(v.change(i) + far * v.direction(i));
    v.left(i) = static_cast<float>(v.left(i) - far * of.image(i));
  }
};
template <class Mem>
struct TurnDirection {
  RefitVectors<Mem> v;
  float keep;
  KOKKOS_FUNCTION void operator()(std::int64_t i) const { v.direction(i) = fma(keep, v.direction(i), v.left(i) * v.inverse(i)); }
};
/// The Gaussians after the step. An opacity goes to a quarter or to fourfold at most, and stays what pictures show; a size to e^(+-0.3).
template <class Mem>
struct TakeStep {
  RefitVectors<Mem> v;
  Gaussians<Mem> cloud;
  float least;
  KOKKOS_FUNCTION void operator()(std::int64_t i) const {
    int const n = cloud.count, place = int(i % n), row = int(i / n), colours = colours_of(cloud.sh_degree);
    if (v.inverse(i) == 0) return;
    if (row < colours) {
      cloud.sh(row, place) += v.change(i);
      return;
    }
    if (row > colours) {
      float const by = Kokkos::exp(clamp(v.change(i), -0.3f, 0.3f));
      for (int k = 0; k < 3; ++k) cloud.scales(k, place) *= by;
      return;
    }
    float const o = exp2(cloud.power(place)), low = max(min(o, least), 0.25f * o);
    cloud.power(place) = Kokkos::log2(min(1.f, min(4.f * o, max(low, o + v.change(i)))));
  }
};
/// What is culled together, as large as it is now.
template <class Mem>
struct MeasureClusters {
  Gaussians<Mem> cloud;
  KOKKOS_FUNCTION void operator()(int c) const {
    GaussianCluster& cluster = cloud.clusters(c);
    float most = 0;
    for (int i = cluster.begin; i < cluster.end; ++i)
      for (int k = 0; k < 3; ++k) most = max(most, cloud.scales(k, i));
    cluster.scale = most;
  }
};

}  // namespace gsp::detail
