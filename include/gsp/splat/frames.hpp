#pragma once
#include <gsp/parallel/sort_by_key.hpp>
#include <gsp/splat/detail/ellipse.hpp>
#include <gsp/splat/detail/link_view.hpp>
#include <gsp/splat/gaussians.hpp>
#include <gsp/splat/splat.hpp>

namespace gsp {

namespace detail {
/// A pair as it is found: the place in its tile's list is still without order.
struct alignas(16) PooledPair {
  std::uint32_t tile;  // image x tiles + tile
  int place, splat;
  std::uint32_t depth;  // bits of the splat's, which are as the depths themselves: these are positive
};
struct alignas(8) TilePair {
  std::uint32_t depth;
  int splat;
};

/// A CPU's tile is a row of packs; a GPU's has an 8 x 8 block for each bit of a word.
template <class Exec>
TileGrid tile_grid(int width, int height) {
  return is_device<Exec> ? TileGrid{width, height, 6, 5} : TileGrid{width, height, 4, 4};
}
}  // namespace detail

/// Where a splat comes from, and what its order and its tiles follow from.
struct alignas(16) SplatOrigin {
  int image, source;  // in the wave; of the Gaussian in the input
  float depth;        // as the splat's
  int tiles;          // that it touches
};

/// Buffers of one wave: a batch of images that go through the stages together. Their size is bounded by the batch, not by the number of
/// images.
template <class Mem>
struct SplatWave {
  using memory_space = Mem;
  template <class D>
  using View = Kokkos::View<D, Kokkos::LayoutRight, Mem>;
  int batch = 0;              // images a wave can hold
  int first = 0, images = 0;  // the images that it holds now
  detail::TileGrid grid{};    // 16 x 16 pixels a tile on a CPU, 64 x 32 on a GPU
  int words = 0;              // of 32 Gaussians each, in `seen`
  std::int64_t visible_capacity = 0, pair_capacity = 0;
  int values_a_splat = 0;  // numbers that channels keep of a Gaussian beside its splat

  View<detail::ImageView*> image_views;  // (batch)
  View<detail::LinkView**> link_views;   // (batch, body)
  View<bool**> cluster_seen;             // (batch, cluster) whether a Gaussian of it may be; read on a device
  View<std::int64_t> visible, pairs;     // how many there are; 0 where they did not fit
  View<std::int64_t[3]> needed;          // greatest number of visible and of pairs of any wave since `render` began, and which camera
                                         // cannot be drawn, and why (detail::CameraFault)
  View<Lens*> lenses;                    // (C) the cameras' own, or (0)

  View<Splat*> splats;                  // (visible) in no order
  View<SplatOrigin*> origins;           // (visible)
  View<float*> values;                  // (visible x values_a_splat)
  Kokkos::View<int*, Mem> tile_splats;  // (pairs) splat indices, by tile, front to back
  View<std::int64_t*> tile_begin;       // (batch x tiles + 1)

  // a CPU's
  View<std::uint32_t**> seen;                    // (batch, word) bit `source` says whether the image has a splat of that Gaussian
  View<int*> seen_before;                        // (batch x words + 1) how many splats there are of the words before, image after image
  Kokkos::View<std::uint32_t*, Mem> depth_keys;  // (visible) bits of the depth
  Kokkos::View<int*, Mem> order;                 // (visible) splat indices, by depth, of one depth by image and source
  View<std::int64_t*> pair_offset;               // (visible + 1)
  Kokkos::View<std::uint32_t*, Mem> tile_keys;   // (pairs) image x tiles + tile
  SortScratch<std::uint32_t, Mem> order_scratch, tile_scratch;

  // a GPU's
  View<int*> tile_count;                // (batch x tiles) pairs of each
  View<int*> tile_order;                // (batch x tiles) tiles, those with the longest lists first
  View<detail::PooledPair*> pair_pool;  // (pairs) in no order
  View<detail::TilePair*> pair_list;    // (pairs) by tile
  View<std::uint32_t**> block_masks;    // a list that begins at pair b, of tile t, has for each 32 of its splats a row from b / 32 + t on:
                                        // word k says which of them touch the tile's k-th 8 x 8 pixels (detail/block_masks_cuda.hpp)

  KOKKOS_FUNCTION int tiles() const { return grid.columns() * grid.rows(); }
};

/// What `status(c)` of an image says: the wave's buffers were too small, nothing was written to this image. `render` grows and repeats.
inline constexpr std::uint32_t frame_overflow = 1u;

/// Images, and the buffers that make them.
template <class Mem>
struct Frames {
  using memory_space = Mem;
  template <class D>
  using View = Kokkos::View<D, Kokkos::LayoutRight, Mem>;
  int images = 0, width = 0, height = 0;
  View<float****> rgb;          // (C, H, W, 3) on black, not clamped above
  View<float***> depth;         // (C, H, W) expected camera z: sum of weight x z / max(alpha, 1e-10) [m]
  View<float***> alpha;         // (C, H, W)
  View<std::uint32_t*> status;  // (C) 0, or frame_overflow
  SplatWave<Mem> wave;
  bool sized = false;  // the wave's buffers have held a wave before
};

struct FrameOptions {
  int images = 1, width = 640, height = 480;
  bool rgb = true, depth = true, alpha = true;  // which pictures to make
  int batch = 0;                                // images a wave; 0: chosen by size and backend. Results do not depend on it
  std::int64_t visible = 0,
               pairs = 0;  // first guess per image of Gaussians seen and of (Gaussian, tile) pairs; 0: by the number of Gaussians
  int values = 0;          // numbers that further channels keep of a Gaussian; `render` sees to it by itself
};

/// Makes room for `visible` Gaussians (with w.values_a_splat numbers of channels each) and `pairs` (Gaussian, tile) pairs a wave; never
/// shrinks. Throws Error where an index would pass 2^31.
template <ExecutionSpace Exec, class Mem>
void reserve(Exec const& exec, std::int64_t visible, std::int64_t pairs, SplatWave<Mem>& w);

/// Bytes that make_frames allocates for these options: the pictures, and the buffers of a wave before `render` finds that one needs more.
/// Not counted: the scratch of a device's sort, and what does not grow with images, pixels or Gaussians. Throws as make_frames does.
template <ExecutionSpace Exec, class Mem>
std::int64_t bytes_needed(Exec const&, Gaussians<Mem> const& cloud, FrameOptions const& options);

/// Images of a size, and buffers for waves of them, for Gaussians such as `cloud` (as many clusters, bodies and Gaussians).
/// Throws std::invalid_argument on sizes that are not positive, and Error where a wave would need indices over 2^31.
template <ExecutionSpace Exec, class Mem>
Frames<Mem> make_frames(Exec const& exec, Gaussians<Mem> const& cloud, FrameOptions options = {});

}  // namespace gsp

#include <gsp/splat/detail/frames_impl.hpp>
