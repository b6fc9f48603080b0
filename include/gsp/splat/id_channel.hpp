#pragma once
#include <gsp/splat/channels.hpp>

namespace gsp {

/// What a pixel shows: the number of the Gaussian behind which half of the light is left or less, -1 where more comes through. Numbers are
/// those of bodies, or the labels that are given: geoms, objects, classes. Any int: pixels carry the bits of number + 1, which nothing
/// rounds.
template <class Mem>
struct IdChannel {
  Kokkos::View<int*, Mem> label;                         // (Gaussians, in the order of the sets of make_gaussians); empty: their bodies
  Kokkos::View<int***, Kokkos::LayoutRight, Mem> image;  // (C, H, W)
  static constexpr int size = 1;
  template <class Seen>
  KOKKOS_INLINE_FUNCTION void value(Seen const& g, float* out) const {
    out[0] = Kokkos::bit_cast<float>(std::uint32_t(label.extent(0) > 0 ? label(g.index()) : g.body) + 1);
  }
  template <class P>
  KOKKOS_INLINE_FUNCTION void blend(P* pixel, float const* value, Blend<P> const& b) const {
    pixel[0] = select(b.before > P(0.5f) && b.left <= P(0.5f), P(value[0]), pixel[0]);
  }
  KOKKOS_INLINE_FUNCTION void store(int c, int row, int column, float const* pixel) const {
    image(c, row, column) = int(Kokkos::bit_cast<std::uint32_t>(pixel[0]) - 1);
  }
};

}  // namespace gsp
