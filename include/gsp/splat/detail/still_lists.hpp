#pragma once
#include <gsp/splat/frames.hpp>

namespace gsp::detail {

/// What cameras that stand still keep (fixed_frames.hpp), as kernels take it: lists and pictures of the views, and what was drawn over
/// them.
template <class Mem>
struct StillLists {
  template <class D>
  using View = Kokkos::View<D, Kokkos::LayoutRight, Mem>;
  View<Splat*> splats;
  View<SplatOrigin*> origins;
  Kokkos::View<int*, Mem> tile_splats;
  View<std::int64_t*> tile_begin;     // (views x tiles + 1)
  View<std::uint32_t**> block_masks;  // a GPU's
  View<float****> rgb;                // (view, H, W, 3)
  View<float***> depth, alpha;        // (view, H, W)
  View<int*> view;                    // (C)
  View<std::uint32_t**> drawn;        // (C, tiles)
};

}  // namespace gsp::detail
