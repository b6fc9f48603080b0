#pragma once
#include <algorithm>
#include <cmath>
#include <gsp/core/detail/views.hpp>
#include <gsp/splat/frames.hpp>
#include <string>

/// Buffers of gsp/splat/frames.hpp, where the contract stands.
namespace gsp {

namespace detail {
/// Of splats or pairs: places and the next 1,024 behind them are whole numbers of 32 bits.
inline constexpr std::int64_t most_of_wave = (std::int64_t(1) << 31) - 4096;
/// Rows of block_masks: a list that begins at pair b, of tile t, has those from b / 32 + t on, one for every 32 of its splats.
inline std::int64_t mask_rows(std::int64_t pairs, std::int64_t tiles) { return pairs / 32 + tiles + 1; }
}  // namespace detail

template <ExecutionSpace Exec, class Mem>
void reserve(Exec const& exec, std::int64_t visible, std::int64_t pairs, SplatWave<Mem>& w) {
  using Wave = SplatWave<Mem>;
  constexpr std::int64_t most = detail::most_of_wave;
  if (visible > most || pairs > most)
    throw Error("gsp::reserve: a wave of " + std::to_string(w.batch) + " images needs " + std::to_string(visible) + " splats and " +
                std::to_string(pairs) + " tile pairs, over 2^31; make the frames with a smaller batch");
  if (visible > w.visible_capacity) {
    // let go of the old buffers first: the peak is the new size, not the sum; should there be no room, there is none at all
    w.visible_capacity = 0;
    w.values = {};
    w.splats = {};
    w.origins = {};
    w.depth_keys = {};
    w.order = {};
    w.pair_offset = {};
    w.order_scratch = {};
    w.splats = detail::allocate<typename Wave::template View<Splat*>>("gsp::SplatWave::splats", visible);
    w.origins = detail::allocate<typename Wave::template View<SplatOrigin*>>("gsp::SplatWave::origins", visible);
    if constexpr (!is_device<Exec>) {
      w.depth_keys = detail::allocate<Kokkos::View<std::uint32_t*, Mem>>("gsp::SplatWave::depth_keys", visible);
      w.order = detail::allocate<Kokkos::View<int*, Mem>>("gsp::SplatWave::order", visible);
      w.pair_offset = detail::allocate<typename Wave::template View<std::int64_t*>>("gsp::SplatWave::pair_offset", visible + 1);
      w.order_scratch = make_sort_scratch<std::uint32_t>(exec, visible);
    }
    w.visible_capacity = visible;
  }
  std::size_t const values = static_cast<std::size_t>(w.visible_capacity) * static_cast<std::size_t>(w.values_a_splat);
  if (values > w.values.extent(0)) {
    std::int64_t const capacity = w.visible_capacity;
    w.visible_capacity = 0;  // as above
    w.values = {};
    w.values = detail::allocate<typename Wave::template View<float*>>("gsp::SplatWave::values", std::int64_t(values));
    w.visible_capacity = capacity;
  }
  if (visible > 0 || pairs > 0) {  // the lists of the last wave are gone
    Kokkos::deep_copy(exec, w.visible, 0);
    Kokkos::deep_copy(exec, w.pairs, 0);
    Kokkos::deep_copy(exec, w.tile_begin, 0);
  }
  if (pairs > w.pair_capacity) {
    w.pair_capacity = 0;
    w.tile_splats = {};
    w.tile_keys = {};
    w.tile_scratch = {};
    w.pair_pool = {};
    w.pair_list = {};
    w.block_masks = {};
    w.tile_splats = detail::allocate<Kokkos::View<int*, Mem>>("gsp::SplatWave::tile_splats", pairs);
    if constexpr (is_device<Exec>) {
      w.pair_pool = detail::allocate<typename Wave::template View<detail::PooledPair*>>("gsp::SplatWave::pair_pool", pairs);
      w.pair_list = detail::allocate<typename Wave::template View<detail::TilePair*>>("gsp::SplatWave::pair_list", pairs);
      w.block_masks = detail::allocate<typename Wave::template View<std::uint32_t**>>(
          "gsp::SplatWave::block_masks", detail::mask_rows(pairs, std::int64_t(w.batch) * w.tiles()), 32);
    } else {
      w.tile_keys = detail::allocate<Kokkos::View<std::uint32_t*, Mem>>("gsp::SplatWave::tile_keys", pairs);
      w.tile_scratch = make_sort_scratch<std::uint32_t>(exec, pairs);
    }
    w.pair_capacity = pairs;
  }
}

namespace detail {
/// What make_frames makes for these options.
struct FrameSizes {
  TileGrid grid;
  std::int64_t batch, visible, pairs;      // images, Gaussians and (Gaussian, tile) pairs of a wave
  std::int64_t words;                      // of 32 Gaussians
  std::int64_t an_image, a_splat, a_pair;  // bytes
};

template <class Exec, class Mem>
FrameSizes frame_sizes(Gaussians<Mem> const& cloud, FrameOptions const& options) {
  expects(options.images > 0 && options.width > 0 && options.height > 0,
          "gsp::make_frames: images, width and height must be positive, not " + std::to_string(options.images) + ", " +
              std::to_string(options.width) + ", " + std::to_string(options.height));
  expects(options.width <= 65536 && options.height <= 65536, "gsp::make_frames: width and height are at most 65536");
  expects(options.batch >= 0 && options.visible >= 0 && options.pairs >= 0 && options.values >= 0,
          "gsp::make_frames: batch, values and hints must not be negative");
  std::int64_t constexpr most = most_of_wave, wave_bytes = std::int64_t(5) << 28;
  FrameSizes s{};
  s.grid = tile_grid<Exec>(options.width, options.height);
  std::int64_t const tiles = std::int64_t(s.grid.columns()) * s.grid.rows(), clusters = cloud.most_clusters;
  s.words = (cloud.count + 31) / 32;
  s.an_image = sizeof(ImageView) + cloud.bodies * std::int64_t(sizeof(LinkView)) + clusters + 8 * tiles +
               (is_device<Exec> ? (128 + 4 + 4) * tiles : 8 * s.words);
  s.a_splat = sizeof(Splat) + sizeof(SplatOrigin) + 4 * options.values + (is_device<Exec> ? 0 : 2 * (4 + 4) + 8);  // a sort's, twice
  s.a_pair = is_device<Exec> ? sizeof(PooledPair) + sizeof(TilePair) + 4 + 4 : 2 * (4 + 4);
  // an eighth of a captured room is seen by a camera in it; a splat touches more tiles the larger the picture
  double const pixels = double(options.width) * options.height;
  std::int64_t const visible =
      options.visible > 0 ? options.visible : std::min(cloud.most_count, cloud.most_count / (is_device<Exec> ? 8 : 5) + 1024);
  std::int64_t const pairs = options.pairs > 0 ? options.pairs
                             : is_device<Exec> ? static_cast<std::int64_t>(double(visible) * (1 + std::sqrt(pixels) / 300))
                                               : 7 * visible;
  if (options.batch > 0) {
    s.batch = options.batch;
  } else if (is_device<Exec>) {  // as many pixels as 256 of 640 x 480: fewer leave the GPU idle at the ends of kernels
    double const images = std::clamp(256 * 307200. / pixels, 1., 1024.);
    std::int64_t const bytes = s.an_image + visible * s.a_splat + pairs * s.a_pair;
    s.batch = std::max<std::int64_t>(1, std::min(std::int64_t(images), wave_bytes / bytes));
  } else {
    s.batch = static_cast<std::int64_t>(std::clamp(2 * 307200. / pixels, 1., 64.));
  }
  s.batch = std::min<std::int64_t>(
      {s.batch, options.images, most / 16 / tiles, most / std::max<std::int64_t>(1, clusters), most / std::max<std::int64_t>(1, s.words)});
  expects(s.batch > 0, "gsp::make_frames: pictures of this size have more tiles than a launch has blocks; make them smaller");
  // waves of one size: a short one at the end costs nearly as much as a full one
  auto const parts = [](std::int64_t n, std::int64_t size) { return (n + size - 1) / size; };
  if (options.batch == 0) s.batch = parts(options.images, parts(options.images, s.batch));
  s.visible = std::min(most, std::max<std::int64_t>(1, s.batch * visible));
  s.pairs = std::min(most, std::max<std::int64_t>(1, s.batch * pairs));
  return s;
}

template <class Exec, class Mem>
SplatWave<Mem> make_wave(Exec const& exec, Gaussians<Mem> const& cloud, FrameSizes const& sizes, int values) {
  using Wave = SplatWave<Mem>;
  Wave wave;
  wave.values_a_splat = values;
  wave.grid = sizes.grid;
  wave.words = static_cast<int>(sizes.words);
  wave.batch = static_cast<int>(sizes.batch);
  std::int64_t const batch = sizes.batch;
  wave.image_views = allocate<typename Wave::template View<ImageView*>>("gsp::SplatWave::image_views", batch);
  wave.link_views = allocate<typename Wave::template View<LinkView**>>("gsp::SplatWave::link_views", batch, cloud.bodies);
  wave.cluster_seen = allocate<typename Wave::template View<bool**>>("gsp::SplatWave::cluster_seen", batch, cloud.most_clusters);
  if constexpr (is_device<Exec>) {
    wave.tile_count = allocate<typename Wave::template View<int*>>("gsp::SplatWave::tile_count", batch * wave.tiles());
    wave.tile_order = allocate_zero<typename Wave::template View<int*>>(exec, "gsp::SplatWave::tile_order", batch * wave.tiles());
  } else {
    wave.seen = allocate<typename Wave::template View<std::uint32_t**>>("gsp::SplatWave::seen", batch, wave.words);
    wave.seen_before = allocate<typename Wave::template View<int*>>("gsp::SplatWave::seen_before", batch * wave.words + 1);
  }
  wave.visible = allocate_zero<typename Wave::template View<std::int64_t>>(exec, "gsp::SplatWave::visible");
  wave.pairs = allocate_zero<typename Wave::template View<std::int64_t>>(exec, "gsp::SplatWave::pairs");
  wave.needed = allocate_zero<typename Wave::template View<std::int64_t[3]>>(exec, "gsp::SplatWave::needed");
  wave.tile_begin = allocate<typename Wave::template View<std::int64_t*>>("gsp::SplatWave::tile_begin", batch * wave.tiles() + 1);
  reserve(exec, sizes.visible, sizes.pairs, wave);
  return wave;
}
}  // namespace detail

template <ExecutionSpace Exec, class Mem>
std::int64_t bytes_needed(Exec const&, Gaussians<Mem> const& cloud, FrameOptions const& options) {
  auto const s = detail::frame_sizes<Exec>(cloud, options);
  std::int64_t const channels = (options.rgb ? 3 : 0) + (options.depth ? 1 : 0) + (options.alpha ? 1 : 0);
  std::int64_t const pixels = std::int64_t(options.images) * options.width * options.height;
  return 4 * channels * pixels + s.batch * s.an_image + s.visible * s.a_splat + s.pairs * s.a_pair;
}

template <ExecutionSpace Exec, class Mem>
Frames<Mem> make_frames(Exec const& exec, Gaussians<Mem> const& cloud, FrameOptions options) {
  static_assert(can_access<Exec, Gaussians<Mem>>, "gsp::make_frames: the Gaussians are not accessible from this execution space");
  using F = Frames<Mem>;
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

  f.wave = detail::make_wave(exec, cloud, sizes, options.values);
  return f;
}

}  // namespace gsp
