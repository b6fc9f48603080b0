#pragma once
#include <algorithm>
#include <cstring>
#include <gsp/core/region.hpp>
#include <gsp/splat/detail/rasterize_rows.hpp>
#include <gsp/splat/detail/still_lists.hpp>
#include <gsp/splat/fixed_frames.hpp>
#include <map>
#if defined(KOKKOS_ENABLE_CUDA) && defined(__CUDACC__)
#include <gsp/splat/detail/rasterize_fixed_cuda.hpp>
#endif

/// Buffers and launches of gsp/splat/fixed_frames.hpp, where the contract stands.
namespace gsp {

namespace detail {

/// The clusters of a cloud that `is_taken`, over the same Gaussians.
template <class Exec, class Mem, class Taken>
Gaussians<Mem> part_of(Exec const& exec, Gaussians<Mem> const& cloud, Taken const& is_taken) {
  auto const clusters = to_host(exec, cloud.clusters);
  auto sets = to_host(exec, cloud.sets);
  std::vector<GaussianCluster> taken;
  std::int64_t count = 0;
  for (GaussianSetRange& set : sets) {
    GaussianSetRange own{int(taken.size()), 0, 0};
    for (int k = set.cluster_begin; k < set.cluster_end; ++k) {
      GaussianCluster const& cluster = clusters[std::size_t(k)];
      if (!is_taken(cluster)) continue;
      taken.push_back(cluster);
      own.count += cluster.end - cluster.begin;
    }
    own.cluster_end = int(taken.size());
    count += own.count;
    set = own;
  }
  Gaussians<Mem> part = cloud;
  part.clusters = to_device<decltype(part.clusters)>(exec, "gsp::Gaussians::clusters", taken);
  part.sets = to_device<decltype(part.sets)>(exec, "gsp::Gaussians::sets", sets);
  part.most_clusters = most_clusters(sets, cloud.shown.extent(0) > 0 ? cloud.shown.extent(1) : sets.size());
  part.most_count = static_cast<int>(std::min<std::int64_t>(cloud.most_count, count));
  return part;
}

/// The views that cameras share: which each camera has, and the numbers of one camera of each.
struct FixedViews {
  std::vector<int> of_camera, world;
  std::vector<float> viewmats, Ks;
  std::vector<Lens> lenses;  // of each, or none
  int count() const { return static_cast<int>(world.size()); }
};
template <class Exec, class R, class PosesMem, class Mem>
FixedViews fixed_views(Exec const& exec, Gaussians<Mem> const& cloud, Poses<R, PosesMem> const& poses, Cameras<Mem> const& cameras) {
  auto const viewmats = to_host(exec, cameras.viewmats), Ks = to_host(exec, cameras.Ks);
  auto const lenses = to_host(exec, cameras.lenses);
  auto const world = to_host(exec, cameras.world), shown = to_host(exec, cloud.shown);
  auto const xpos = to_host(exec, poses.xpos), xquat = to_host(exec, poses.xquat);
  std::size_t const worlds = poses.xpos.extent(0), bodies = poses.xpos.extent(1), slots = cloud.shown.extent(1);
  FixedViews views;
  std::vector<Lens> different;
  std::map<std::string, int> known;
  for (std::size_t c = 0; c < std::size_t(cameras.images()); ++c) {
    int const named = world.empty() ? static_cast<int>(c % worlds) : world[c];
    expects(named >= 0 && std::size_t(named) < worlds, "gsp::make_fixed_frames: a camera is of world " + std::to_string(named) +
                                                           ", the poses have " + std::to_string(worlds) +
                                                           ": write its world, or make poses of as many");
    std::size_t const w = std::size_t(named);
    std::string key;
    auto const add = [&](auto const* from, std::size_t count) { key.append(reinterpret_cast<char const*>(from), count * sizeof *from); };
    add(&viewmats[16 * c], 16);
    add(&Ks[9 * c], 9);
    if (!lenses.empty()) {
      auto const same = std::find(different.begin(), different.end(), lenses[c]);
      auto const number = same - different.begin();
      if (same == different.end()) different.push_back(lenses[c]);
      add(&number, 1);
    }
    add(&xpos[3 * bodies * w], 3);
    add(&xquat[4 * bodies * w], 4);
    if (slots > 0) add(&shown[slots * w], slots);
    auto const [at, is_new] = known.try_emplace(key, views.count());
    views.of_camera.push_back(at->second);
    if (!is_new) continue;
    views.world.push_back(named);
    views.viewmats.insert(views.viewmats.end(), &viewmats[16 * c], &viewmats[16 * c] + 16);
    views.Ks.insert(views.Ks.end(), &Ks[9 * c], &Ks[9 * c] + 9);
    if (!lenses.empty()) views.lenses.push_back(lenses[c]);
  }
  return views;
}

/// A tile of a CPU, of which some splats move: from both lists, front to back, of one depth by source.
template <class Mem>
struct BothLists {
  StillLists<Mem> const& still;
  SplatWave<Mem> const& moving;
  std::int64_t a, a_end, b, b_end;
  bool next(Splat const*& splat, float const*&) {
    if (a == a_end && b == b_end) return false;
    bool const stands = b == b_end || (a < a_end && before(still.origins(still.tile_splats(a)), moving.origins(moving.tile_splats(b))));
    splat = stands ? &still.splats(still.tile_splats(a++)) : &moving.splats(moving.tile_splats(b++));
    return true;
  }
  static bool before(SplatOrigin const& x, SplatOrigin const& y) { return x.depth != y.depth ? x.depth < y.depth : x.source < y.source; }
};
template <class Mem, class List>
struct RasterizeFixedRows {
  RasterizeRows<Mem, List> rows;
  StillLists<Mem> still;

  void operator()(int index) const {
    auto const& wave = rows.frames.wave;
    int const tiles = wave.tiles(), image = wave.first + index / tiles, tile = index % tiles, view = still.view(image);
    if (rows.frames.status(image) != 0) return;
    std::int64_t const begin = wave.tile_begin(index), end = wave.tile_begin(index + 1), of_view = std::int64_t(view) * tiles + tile;
    if (begin < end)
      rows.tile(image, tile, BothLists<Mem>{still, wave, still.tile_begin(of_view), still.tile_begin(of_view + 1), begin, end});
    else if (still.drawn(image, tile) != 0)
      restore(image, view, tile);
    still.drawn(image, tile) = begin < end;
  }

 private:
  void restore(int image, int view, int tile) const {
    auto const& frames = rows.frames;
    auto const& grid = frames.wave.grid;
    int const x = tile % grid.columns() << grid.x_bits, y = tile / grid.columns() << grid.y_bits,
              columns = std::min(1 << grid.x_bits, grid.width - x), below = std::min(y + (1 << grid.y_bits), grid.height);
    auto const row = [&](auto const& to, auto const& from, int line, int numbers) {
      std::size_t const at = (std::size_t(line) * std::size_t(grid.width) + std::size_t(x)) * std::size_t(numbers),
                        each = std::size_t(grid.width) * std::size_t(grid.height) * std::size_t(numbers);
      if (to.extent(0) > 0)
        std::memcpy(to.data() + std::size_t(image) * each + at, from.data() + std::size_t(view) * each + at,
                    std::size_t(columns) * std::size_t(numbers) * sizeof(float));
    };
    for (int line = y; line < below; ++line) {
      row(frames.rgb, still.rgb, line, 3);
      row(frames.depth, still.depth, line, 1);
      row(frames.alpha, still.alpha, line, 1);
    }
  }
};

/// The last stage of a wave of what moves.
template <class Exec, class Mem>
void rasterize_fixed(Exec const& exec, FixedFrames<Mem> const& fixed, Frames<Mem> const& frames) {
  auto const list = picture_channels(frames);
  using List = std::remove_const_t<decltype(list)>;
  RenderOptions const& options = fixed.options;
  auto const& of = fixed.still;
  StillLists<Mem> const still{of.wave.splats, of.wave.origins, of.wave.tile_splats, of.wave.tile_begin, of.wave.block_masks, of.rgb,
                              of.depth,       of.alpha,        fixed.view,          fixed.drawn};
  if constexpr (is_device<Exec>) {
#if defined(KOKKOS_ENABLE_CUDA) && defined(__CUDACC__)
    rasterize_fixed_on_cuda(exec, RasterizeFixedBlocks<Mem, List>{{list, options.alpha_max, options.stop}, frames, still});
#else
    static_assert(!is_device<Exec>, "gsp::render_fixed: pictures are drawn on CPUs and on CUDA GPUs; compile with nvcc for CUDA");
#endif
  } else {
    auto const& wave = frames.wave;
    Kokkos::parallel_for(
        "gsp::splat::rasterize_fixed",
        Kokkos::RangePolicy<Exec, Kokkos::Schedule<Kokkos::Dynamic>>(exec, 0, wave.images * wave.tiles(), Kokkos::ChunkSize(16)),
        RasterizeFixedRows<Mem, List>{{frames, list, options.alpha_max, options.stop}, still});
  }
}

/// What only the making of lists needs.
template <class Mem>
void keep_lists_alone(SplatWave<Mem>& wave) {
  wave.image_views = {};
  wave.link_views = {};
  wave.cluster_seen = {};
  wave.seen = {};
  wave.seen_before = {};
  wave.depth_keys = {};
  wave.order = {};
  wave.pair_offset = {};
  wave.tile_keys = {};
  wave.order_scratch = {};
  wave.tile_scratch = {};
  wave.tile_count = {};
  wave.tile_order = {};
  wave.pair_pool = {};
  wave.pair_list = {};
}

}  // namespace detail

template <ExecutionSpace Exec, class R, class PosesMem, class Mem>
FixedFrames<Mem> make_fixed_frames(Exec const& exec, Gaussians<Mem> const& cloud, Poses<R, PosesMem> const& poses,
                                   Cameras<Mem> const& cameras, FrameOptions options, RenderOptions render_options) {
  Region const region("gsp::splat::make_fixed_frames");
  static_assert(can_access<Exec, Gaussians<Mem>>, "gsp::make_fixed_frames: the Gaussians are not accessible from this execution space");
  static_assert(can_access<Exec, Poses<R, PosesMem>>, "gsp::make_fixed_frames: the poses are not accessible from this execution space");
  using F = FixedFrames<Mem>;
  int const images = cameras.images(), worlds = static_cast<int>(poses.xpos.extent(0));
  expects(images > 0 && worlds > 0, "gsp::make_fixed_frames: there are no cameras, or the poses have no worlds");
  detail::check_cameras("gsp::make_fixed_frames", cameras, images, options.width, options.height);
  expects(cloud.shown.extent(0) == 0 || cloud.shown.extent(0) >= poses.xpos.extent(0),
          "gsp::make_fixed_frames: the table of shown sets has " + std::to_string(cloud.shown.extent(0)) + " worlds, the poses have " +
              std::to_string(worlds) + ": name the sets of every world in show_sets");
  F fixed;
  fixed.options = render_options;
  fixed.cameras = cameras;
  fixed.worlds = worlds;
  auto const own = [&](auto& view) {
    using View = std::remove_cvref_t<decltype(view)>;
    View copy;
    if constexpr (View::rank() == 1)
      copy = detail::allocate<View>(view.label(), view.extent(0));
    else
      copy = detail::allocate<View>(view.label(), view.extent(0), view.extent(1), view.extent(2));
    detail::copy_view(exec, view, copy);
    view = copy;
  };
  own(fixed.cameras.viewmats);
  own(fixed.cameras.Ks);
  own(fixed.cameras.lenses);

  if (cameras.world.extent(0) > 0) own(fixed.cameras.world);

  auto const views = detail::fixed_views(exec, cloud, poses, cameras);
  int const count = views.count();
  auto of_views = options;
  of_views.images = of_views.batch = count;
  of_views.visible = of_views.pairs = 1;  // drawn once, in buffers of the very size
  auto const standing = detail::part_of(exec, cloud, [](GaussianCluster const& c) { return c.body == 0; });
  fixed.still = make_frames(exec, standing, of_views);
  expects(fixed.still.wave.batch == count, "gsp::make_fixed_frames: " + std::to_string(count) + " different views are more than the " +
                                               std::to_string(fixed.still.wave.batch) + " that a wave can hold: make several");
  auto const still_cameras = make_cameras(exec, views.viewmats, views.Ks, views.world, views.lenses);
  render(exec, standing, poses, still_cameras, fixed.still, render_options);
  detail::keep_lists_alone(fixed.still.wave);

  fixed.moving = detail::part_of(exec, cloud, [](GaussianCluster const& c) { return c.body != 0; });
  options.images = images;
  fixed.frames = make_frames(exec, fixed.moving, options);
  fixed.view = detail::to_device<decltype(fixed.view)>(exec, "gsp::FixedFrames::view", views.of_camera);
  fixed.drawn = detail::allocate<decltype(fixed.drawn)>("gsp::FixedFrames::drawn", images, fixed.frames.wave.tiles());
  Kokkos::deep_copy(exec, fixed.drawn, ~std::uint32_t(0));  // nothing is there yet
  exec.fence("gsp::make_fixed_frames: done");
  return fixed;
}

template <ExecutionSpace Exec, class R, class PosesMem, class Mem>
void render_fixed(Exec const& exec, Poses<R, PosesMem> const& poses, FixedFrames<Mem>& fixed) {
  Region const region("gsp::splat::render_fixed");
  std::size_t const worlds = poses.xpos.extent(0);
  expects(int(worlds) == fixed.worlds, "gsp::render_fixed: the poses have " + std::to_string(worlds) +
                                           " worlds, the frames were made for " + std::to_string(fixed.worlds) +
                                           ": give poses of as many, or make the frames anew");
  detail::draw_waves("gsp::render_fixed", exec, fixed.frames, worlds, [&](int first) {
    place_gaussians(exec, fixed.moving, poses, fixed.cameras, first, fixed.frames);
    project(exec, fixed.moving, fixed.frames, fixed.options);
    bin_tiles(exec, fixed.frames);
    detail::rasterize_fixed(exec, fixed, fixed.frames);
  });
}

}  // namespace gsp
