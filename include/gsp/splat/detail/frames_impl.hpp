#pragma once
#include <algorithm>
#include <bit>
#include <gsp/core/detail/views.hpp>
#include <gsp/splat/frames.hpp>
#include <string>

/// Buffers of gsp/splat/frames.hpp, where the contract stands.
namespace gsp {

template <ExecutionSpace Exec, class Mem>
void reserve(Exec const& exec, std::int64_t visible, std::int64_t pairs, SplatWave<Mem>& w) {
  using Wave = SplatWave<Mem>;
  constexpr std::int64_t most = (std::int64_t(1) << 31) - 2;
  if (visible > most || pairs > most)
    throw Error("gsp::reserve: a wave of " + std::to_string(w.batch) + " images needs " + std::to_string(visible) + " splats and " +
                std::to_string(pairs) + " tile pairs, over 2^31; make the frames with a smaller batch");
  if (visible > w.visible_capacity) {
    // let go of the old buffers first: the peak is the new size, not the sum
    w.values = {};
    w.splats = {};
    w.splat_tiles = {};
    w.order_keys = {};
    w.order = {};
    w.pair_offset = {};
    w.order_scratch = {};
    w.splats = detail::allocate<typename Wave::template View<Splat*>>("gsp::SplatWave::splats", visible);
    w.splat_tiles = detail::allocate<typename Wave::template View<int*>>("gsp::SplatWave::splat_tiles", visible);
    w.order_keys = detail::allocate<Kokkos::View<std::uint64_t*, Mem>>("gsp::SplatWave::order_keys", visible);
    w.order = detail::allocate<Kokkos::View<int*, Mem>>("gsp::SplatWave::order", visible);
    w.pair_offset = detail::allocate<typename Wave::template View<std::int64_t*>>("gsp::SplatWave::pair_offset", visible + 1);
    w.order_scratch = make_sort_scratch<std::uint64_t>(exec, visible);
    w.visible_capacity = visible;
  }
  std::size_t const values = static_cast<std::size_t>(w.visible_capacity) * static_cast<std::size_t>(w.values_a_splat);
  if (values > w.values.extent(0)) {
    w.values = {};
    w.values = detail::allocate<typename Wave::template View<float*>>("gsp::SplatWave::values", std::int64_t(values));
  }
  if (pairs > w.pair_capacity) {
    w.tile_keys = {};
    w.tile_splats = {};
    w.tile_scratch = {};
    w.tile_keys = detail::allocate<Kokkos::View<std::uint32_t*, Mem>>("gsp::SplatWave::tile_keys", pairs);
    w.tile_splats = detail::allocate<Kokkos::View<int*, Mem>>("gsp::SplatWave::tile_splats", pairs);
    w.tile_scratch = make_sort_scratch<std::uint32_t>(exec, pairs);
    w.pair_capacity = pairs;
  }
}

namespace detail {
/// What make_frames makes for these options.
struct FrameSizes {
  int tiles_x, tiles_y, index_bits;
  std::int64_t batch, visible, pairs;  // images, Gaussians and (Gaussian, tile) pairs of a wave
};

template <class Exec, class Mem>
FrameSizes frame_sizes(Gaussians<Mem> const& cloud, FrameOptions const& options) {
  expects(options.images > 0 && options.width > 0 && options.height > 0,
          "gsp::make_frames: images, width and height must be positive, not " + std::to_string(options.images) + ", " +
              std::to_string(options.width) + ", " + std::to_string(options.height));
  expects(options.width <= 65536 && options.height <= 65536, "gsp::make_frames: width and height are at most 65536");
  expects(options.batch >= 0 && options.visible >= 0 && options.pairs >= 0 && options.values >= 0,
          "gsp::make_frames: batch, values and hints must not be negative");
  FrameSizes s{};
  s.tiles_x = (options.width + splat_tile - 1) / splat_tile;
  s.tiles_y = (options.height + splat_tile - 1) / splat_tile;
  s.index_bits = std::max(1, int(std::bit_width(static_cast<unsigned>(std::max(cloud.count, 1) - 1))));
  double const vga = 307200. / (double(options.width) * options.height);
  s.batch =
      options.batch > 0 ? options.batch : std::int64_t(std::clamp((is_device<Exec> ? 32 : 2) * vga, 1., is_device<Exec> ? 512. : 64.));
  s.batch = std::min<std::int64_t>({s.batch, options.images, (std::int64_t(1) << (32 - s.index_bits)) - 1,
                                    ((std::int64_t(1) << 32) - 1) / (std::int64_t(s.tiles_x) * s.tiles_y)});
  expects(s.batch > 0, "gsp::make_frames: images of this size with this many Gaussians do not fit into sort keys; make them smaller");
  std::int64_t const clusters = static_cast<std::int64_t>(cloud.clusters.extent(0));
  s.batch = std::max<std::int64_t>(1, std::min(s.batch, ((std::int64_t(1) << 31) - 2) / std::max<std::int64_t>(1, clusters)));
  std::int64_t const visible = options.visible > 0 ? options.visible : std::min(cloud.count, cloud.count / 5 + 1024);
  std::int64_t const pairs = options.pairs > 0 ? options.pairs : 7 * visible;
  std::int64_t constexpr most = (std::int64_t(1) << 31) - 2;
  s.visible = std::min(most, std::max<std::int64_t>(1, s.batch * visible));
  s.pairs = std::min(most, std::max<std::int64_t>(1, s.batch * pairs));
  return s;
}
}  // namespace detail

template <ExecutionSpace Exec, class Mem>
std::int64_t bytes_needed(Exec const&, Gaussians<Mem> const& cloud, FrameOptions const& options) {
  auto const s = detail::frame_sizes<Exec>(cloud, options);
  std::int64_t const channels = (options.rgb ? 3 : 0) + (options.depth ? 1 : 0) + (options.alpha ? 1 : 0);
  std::int64_t const pixels = std::int64_t(options.images) * options.width * options.height;
  std::int64_t const clusters = static_cast<std::int64_t>(cloud.clusters.extent(0));
  std::int64_t const an_image = sizeof(detail::ImageView) + cloud.bodies * std::int64_t(sizeof(detail::LinkView)) + 12 * clusters +
                                8 * std::int64_t(s.tiles_x) * s.tiles_y;
  std::int64_t const a_splat =
      sizeof(Splat) + 4 * options.values + 4 + 2 * (8 + 4) + 8;  // its channels, tiles, key and index (twice: sorting), offset of its pairs
  return 4 * channels * pixels + s.batch * an_image + s.visible * a_splat + s.pairs * 2 * (4 + 4);
}

template <ExecutionSpace Exec, class Mem>
Frames<Mem> make_frames(Exec const& exec, Gaussians<Mem> const& cloud, FrameOptions options) {
  static_assert(can_access<Exec, Gaussians<Mem>>, "gsp::make_frames: the Gaussians are not accessible from this execution space");
  using F = Frames<Mem>;
  using Wave = SplatWave<Mem>;
  auto const sizes = detail::frame_sizes<Exec>(cloud, options);
  F f;
  f.images = options.images;
  f.width = options.width;
  f.height = options.height;
  int const c = f.images;
  int const h = f.height;
  int const w = f.width;
  if (options.rgb) f.rgb = detail::allocate<typename F::template View<float****>>("gsp::Frames::rgb", c, h, w, 3);
  if (options.depth) f.depth = detail::allocate<typename F::template View<float***>>("gsp::Frames::depth", c, h, w);
  if (options.alpha) f.alpha = detail::allocate<typename F::template View<float***>>("gsp::Frames::alpha", c, h, w);
  f.status = detail::allocate_zero<typename F::template View<std::uint32_t*>>(exec, "gsp::Frames::status", c);

  Wave& wave = f.wave;
  wave.values_a_splat = options.values;
  wave.tiles_x = sizes.tiles_x;
  wave.tiles_y = sizes.tiles_y;
  wave.index_bits = sizes.index_bits;
  wave.batch = static_cast<int>(sizes.batch);
  std::int64_t const batch = sizes.batch;
  std::int64_t const clusters = static_cast<std::int64_t>(cloud.clusters.extent(0));
  wave.image_views = detail::allocate<typename Wave::template View<detail::ImageView*>>("gsp::SplatWave::image_views", batch);
  wave.link_views = detail::allocate<typename Wave::template View<detail::LinkView**>>("gsp::SplatWave::link_views", batch, cloud.bodies);
  wave.cluster_visible = detail::allocate<typename Wave::template View<int*>>("gsp::SplatWave::cluster_visible", batch * clusters);
  wave.cluster_offset =
      detail::allocate<typename Wave::template View<std::int64_t*>>("gsp::SplatWave::cluster_offset", batch * clusters + 1);
  wave.visible = detail::allocate_zero<typename Wave::template View<std::int64_t>>(exec, "gsp::SplatWave::visible");
  wave.pairs = detail::allocate_zero<typename Wave::template View<std::int64_t>>(exec, "gsp::SplatWave::pairs");
  wave.needed = detail::allocate_zero<typename Wave::template View<std::int64_t[3]>>(exec, "gsp::SplatWave::needed");
  wave.tile_begin = detail::allocate<typename Wave::template View<std::int64_t*>>("gsp::SplatWave::tile_begin", batch * wave.tiles() + 1);
  reserve(exec, sizes.visible, sizes.pairs, wave);
  return f;
}

}  // namespace gsp
