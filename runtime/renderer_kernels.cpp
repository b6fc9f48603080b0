#include <algorithm>
#include <cstring>
#include <functional>
#include <gsp/io/gaussians.hpp>
#include <gsp/runtime/renderer.hpp>
#include <gsp/splat/develop.hpp>
#include <gsp/splat/fixed_frames.hpp>
#include <gsp/splat/id_channel.hpp>
#include <gsp/splat/jitter_cameras.hpp>
#include <gsp/splat/median_depth.hpp>
#include <gsp/splat/normals.hpp>
#include <gsp/splat/render.hpp>
#include <gsp/splat/sample_room.hpp>
#include <gsp/splat/sample_surface.hpp>
#include <gsp/splat/show_sets.hpp>
#include <optional>

#include "poses_of.hpp"
#include "scene_sets.hpp"

namespace gsp::runtime {

namespace {
void add(Scene& scene, GaussianSet set) {
  auto next = std::make_shared<Scene::Sets>();  // scenes that share the old list keep it
  if (scene.sets) *next = *scene.sets;
  next->list.push_back(std::move(set));
  scene.sets = next;
}
}  // namespace

bool Scene::add_set(io::SplatSet const& set, std::string const& name, CompiledModel const& model) {
  bool linked = false;
  for (int const link : set.link) linked |= link >= 0;
  add(*this, io::to_gaussian_set(set, model, name));
  return linked;
}
void Scene::add_room() { add(*this, sample_room<GaussianSet>()); }
void Scene::add_surface(CompiledModel const& model) {
  add(*this, sample_surface(model, {.count = 30000, .world = false}));  // floors and walls: the scene has its own
  surface = true;
}
io::SplatSet room_set() { return sample_room<io::SplatSet>(); }
std::size_t Scene::count() const {
  std::size_t n = 0;
  if (sets)
    for (auto const& s : sets->list) n += s.size();
  return n;
}
Scene::Bounds Scene::bounds(double share) const {
  expects(share > 0 && share <= 1, "gsp::runtime::Scene::bounds: the share must be above 0 and at most 1");
  std::vector<float> along[3];
  if (sets)
    for (auto const& s : sets->list)
      for (std::size_t i = 0; i < s.size(); ++i)
        for (std::size_t k = 0; k < 3 && s.body[i] == 0; ++k) along[k].push_back(s.positions[3 * i + k]);
  Bounds out{.count = along[0].size()};
  if (out.count == 0) return out;
  std::size_t const cut = std::min(static_cast<std::size_t>(double(out.count) * (1 - share) / 2), (out.count - 1) / 2);
  for (std::size_t k = 0; k < 3; ++k) {
    auto const nth = [&](std::size_t n) {
      std::nth_element(along[k].begin(), along[k].begin() + std::ptrdiff_t(n), along[k].end());
      return double(along[k][n]);
    };
    out.low[k] = nth(cut);
    out.high[k] = nth(out.count - 1 - cut);
  }
  return out;
}

template <class Exec>
class KokkosRenderer : public Renderer {
  using Mem = typename Exec::memory_space;
  using Background = Kokkos::View<float const****, Kokkos::LayoutRight, Mem>;
  using Chance = Kokkos::View<std::int64_t const* [3], Kokkos::LayoutRight, Mem>;
  /// What develop takes beside its numbers.
  struct Developing {
    Background background;
    Chance chance, light;
  };

 public:
  KokkosRenderer(Scene const& scene, RendererOptions const& options) : options_(options), cloud_(make_gaussians(exec_, sets_of(scene))) {
    render_.alpha_max = options.alpha_max;
    render_.near = options.near;
  }
  KokkosRenderer(RendererOptions const& options, RenderOptions const& render, Gaussians<Mem> const& cloud)
      : options_(options), render_(render), cloud_(cloud) {}

  std::unique_ptr<Renderer> another() const override { return std::make_unique<KokkosRenderer>(options_, render_, cloud_); }

  void render(PoseArrays const& poses, CameraArrays const& arrays, DrawOptions const& options) override {
    constexpr char const* where = "gsp::runtime::Renderer::render";
    auto const cameras = jittered(where, cameras_of(where, arrays), options);
    int const images = cameras.images();
    auto const developing = checked(where, options, images);
    if (frames_.images != images || fixed_) {
      make_pictures(images);
      frames_ = make_frames(exec_, cloud_, frame_options(images));                 // last: it says for how many there is room
    } else if (int(frames_.wave.cluster_seen.extent(1)) < cloud_.most_clusters) {  // of other sets: the pictures stay where they are
      auto wave_alone = frame_options(images);
      wave_alone.rgb = wave_alone.depth = wave_alone.alpha = false;
      frames_.wave = {};
      frames_.sized = false;
      frames_.wave = make_frames(exec_, cloud_, wave_alone).wave;
    }
    with_poses(poses, where, [&](auto const& p) {
      with_channels([&](auto const&... channels) { gsp::render(exec_, cloud_, p, cameras, frames_, render_, channels...); });
    });
    finish_pictures(where, cameras, options.develop, developing);
  }

  void fix(PoseArrays const& poses, CameraArrays const& arrays) override {
    constexpr char const* where = "gsp::runtime::Renderer::fix";
    expects(!options_.median_depth && !options_.ids, where,
            "cameras that stand still have no median_depth and no ids: leave them out, or draw with render");
    auto const cameras = cameras_of(where, arrays);
    make_pictures(cameras.images());
    with_poses(poses, where,
               [&](auto const& p) { fixed_ = make_fixed_frames(exec_, cloud_, p, cameras, frame_options(cameras.images()), render_); });
    frames_ = fixed_->frames;
    frames_.wave = {};
  }

  void render_fixed(PoseArrays const& poses, DrawOptions const& options) override {
    constexpr char const* where = "gsp::runtime::Renderer::render_fixed";
    expects(fixed_.has_value(), where, "no cameras are fixed: call fix first, and after render and show_sets");
    expects(!options.jitter.moves_cameras(), where, "cameras that stand still have no jitter: draw with render");
    auto const developing = checked(where, options, frames_.images);
    with_poses(poses, where, [&](auto const& p) { gsp::render_fixed(exec_, p, *fixed_); });
    finish_pictures(where, fixed_->cameras, options.develop, developing);
  }

  void show_sets(std::vector<std::vector<int>> const& sets_of_world) override {
    cloud_ = gsp::show_sets(exec_, cloud_, sets_of_world);
    if (fixed_) make_pictures(0);
  }

  FrameArrays frames() const override {
    FrameArrays out;
    if (options_.rgb) out.rgb = array_of<Exec>(frames_.rgb);
    if (options_.depth) out.depth = array_of<Exec>(frames_.depth);
    if (options_.alpha) out.alpha = array_of<Exec>(frames_.alpha);
    if (options_.median_depth) out.median_depth = array_of<Exec>(median_.image);
    if (options_.ids) out.ids = array_of<Exec>(ids_.image);
    if (options_.normals) out.normals = array_of<Exec>(normals_);
    if (options_.rgb8) out.rgb8 = array_of<Exec>(rgb8_);
    return out;
  }
  std::int64_t bytes_needed(int images) const override {
    std::int64_t const pixels = std::int64_t(images) * options_.width * options_.height;
    std::int64_t const of_pixel =
        (options_.median_depth ? 4 : 0) + (options_.ids ? 4 : 0) + (options_.normals ? 12 : 0) + (options_.rgb8 ? 3 : 0);
    return gsp::bytes_needed(exec_, cloud_, frame_options(images)) + of_pixel * pixels;
  }

 private:
  /// f(channels that were asked for...)
  template <class F>
  void with_channels(F const& f) const {
    with(f, std::pair{options_.median_depth, &median_}, std::pair{options_.ids, &ids_});
  }
  template <class F>
  static void with(F const& f) {
    f();
  }
  template <class F, class Channel, class... Rest>
  static void with(F const& f, std::pair<bool, Channel const*> const& first, Rest const&... rest) {
    with([&](auto const&... more) { first.first ? f(*first.second, more...) : f(more...); }, rest...);
  }

  /// f(poses of the arrays)
  template <class F>
  void with_poses(PoseArrays const& poses, char const* where, F const& f) {
    if (!poses.xpos)
      f(make_poses<float>(exec_, 1, std::max(1, cloud_.bodies), 0));
    else if (poses.xpos.dtype == Dtype::float64)
      f(poses_of<double, Exec>(where, poses));
    else
      f(poses_of<float, Exec>(where, poses));
  }

  /// Room for so many pictures, but for the frames themselves. The old buffers go before the new ones come.
  void make_pictures(int images) {
    fixed_.reset();
    frames_ = {};
    median_ = {};
    ids_ = {};
    normals_ = {};
    rgb8_ = {};
    auto const room = [&]<class View>(bool wanted, View& view, char const* name, auto... numbers) {
      if (wanted) view = gsp::detail::allocate<View>(name, images, options_.height, options_.width, numbers...);
    };
    room(options_.median_depth, median_.image, "gsp::runtime::Renderer::median_depth");
    room(options_.ids, ids_.image, "gsp::runtime::Renderer::ids");
    room(options_.normals, normals_, "gsp::runtime::Renderer::normals", 3);
    room(options_.rgb8, rgb8_, "gsp::runtime::Renderer::rgb8", 3);
  }

  /// Normals and 8-bit pictures of what is drawn; waits until all of it is there.
  void finish_pictures(char const* where, Cameras<Mem> const& cameras, DevelopOptions const& develop_options, Developing const& with) {
    if (options_.normals) normals_of_depth(exec_, options_.median_depth ? median_.image : frames_.depth, cameras, normals_);
    if (options_.rgb8) develop(exec_, frames_, rgb8_, develop_options, with.background, with.chance, with.light);
    exec_.fence(std::string(where) + ": done");
  }

  /// The cameras as they are drawn.
  Cameras<Mem> jittered(std::string const& where, Cameras<Mem> const& cameras, DrawOptions const& options) {
    JitterCamerasOptions const& j = options.jitter;
    std::string const of = where + ": jitter";
    gsp::detail::check_options(of.c_str(), j, cameras.images());
    expect_chance(of.c_str(), "chance", options.jitter_chance, cameras.images());
    if (!j.moves_cameras()) return cameras;
    if (jittered_.images() != cameras.images()) jittered_ = make_cameras(exec_, cameras.images());
    jitter_cameras(exec_, cameras, jittered_, j, rows_of(options.jitter_chance, jitter_chance_));
    return jittered_;
  }

  static void expect_chance(char const* where, char const* name, Array const& a, int images) {
    if (!a) return;
    expects(a.rank == 2 && a.extents[1] == 3 && a.dtype == Dtype::int64, where, "rows of chance are int64, (C, 3): seed, step and number");
    gsp::detail::expects_rows(where, name, a.extents[0], images);
  }
  Chance rows_of(Array const& a, Buffer& buffer) {
    return a ? Chance(static_cast<std::int64_t const*>(here(a, buffer, Dtype::int64)), std::size_t(a.extents[0])) : Chance();
  }

  /// What develop takes, when all of it is right: nothing is copied or drawn before. A background in memory that is drawn into would show
  /// what is drawn now.
  Developing checked(char const* where, DrawOptions const& options, int images) {
    Array const& a = options.background;
    expects(options_.rgb8 || (options.develop.is_default() && !a && !options.chance && !options.light_chance), where,
            "develop is of rgb8, which this renderer does not make: RendererOptions::rgb8");
    expects(!a || a.rank == 4, where, "the background picture is (1 or C, H, W, 3)");
    auto const at = [&](void const* numbers) {
      auto const extent = [&](std::size_t k) { return static_cast<std::size_t>(a.extents[k]); };
      return a ? Background(static_cast<float const*>(numbers), extent(0), extent(1), extent(2), extent(3)) : Background();
    };
    std::string const of = std::string(where) + ": develop";
    gsp::detail::check_develop(of.c_str(), options.develop, at(a.data), images, options_.height, options_.width);
    expect_chance(of.c_str(), "chance", options.chance, images);
    expect_chance(of.c_str(), "light_chance", options.light_chance, images);
    auto const f = frames();
    std::less<> const before{};
    auto const* const begin = static_cast<char const*>(a.data);
    for (Array const* own : {&f.rgb, &f.depth, &f.alpha, &f.median_depth, &f.normals, &f.ids, &f.rgb8}) {
      auto const* const first = static_cast<char const*>(own->data);
      std::int64_t const bytes = *own ? own->size() * bytes_of(own->dtype) : 0;
      expects(!a || before(begin, first) || !before(begin, first + bytes), where,
              "the background lies in the pictures that are to be drawn: copy() it first");
    }
    return {a ? at(here(a, background_, Dtype::float32)) : Background(), rows_of(options.chance, chance_),
            rows_of(options.light_chance, light_chance_)};
  }

  FrameOptions frame_options(int images) const {
    FrameOptions o;
    o.images = images;
    o.width = options_.width;
    o.height = options_.height;
    o.rgb = options_.rgb || options_.rgb8;
    o.depth = options_.depth || (options_.normals && !options_.median_depth);
    o.alpha = options_.alpha || options_.rgb8;  // behind which a background shows
    o.batch = options_.batch;
    with_channels([&](auto const&... channels) { o.values = (0 + ... + std::decay_t<decltype(channels)>::size); });
    return o;
  }

  /// The numbers of `a` where they are, or a copy of those that lie elsewhere.
  void* here(Array const& a, Buffer& buffer, Dtype dtype) {
    if (a.device == device_of<Exec>() && a.contiguous() && a.dtype == dtype) return a.data;
    if (!buffer.array || buffer.array.extents != a.extents) {
      if (a.rank == 4)
        buffer = make_buffer(device_of<Exec>(), dtype, {a.extents[0], a.extents[1], a.extents[2], a.extents[3]});
      else if (a.rank == 3)
        buffer = make_buffer(device_of<Exec>(), dtype, {a.extents[0], a.extents[1], a.extents[2]});
      else if (a.rank == 2)
        buffer = make_buffer(device_of<Exec>(), dtype, {a.extents[0], a.extents[1]});
      else
        buffer = make_buffer(device_of<Exec>(), dtype, {a.extents[0]});
    }
    copy(a, buffer.array);
    return buffer.array.data;
  }

  /// Cameras where they are, or copies of those that lie elsewhere; two cameras of one renderer share the place of the copies.
  Cameras<Mem> cameras_of(char const* where, CameraArrays const& c) {
    expects(c.viewmats.rank == 3 && c.Ks.rank == 3 && c.viewmats.extents[0] == c.Ks.extents[0] && c.viewmats.extents[1] == 4 &&
                c.viewmats.extents[2] == 4 && c.Ks.extents[1] == 3 && c.Ks.extents[2] == 3 && c.viewmats.extents[0] > 0,
            where, "cameras are viewmats (C, 4, 4) and Ks (C, 3, 3)");
    std::int64_t const n = c.viewmats.extents[0];
    expects(!c.world || (c.world.rank == 1 && c.world.extents[0] == n && c.world.dtype == Dtype::int32), where,
            "the cameras' worlds are int32 (C)");
    using Out = Cameras<Mem>;
    Out cameras;
    cameras.viewmats = typename Out::template View<float***>(static_cast<float*>(here(c.viewmats, viewmats_, Dtype::float32)), n, 4, 4);
    cameras.Ks = typename Out::template View<float***>(static_cast<float*>(here(c.Ks, Ks_, Dtype::float32)), n, 3, 3);
    expects(c.lenses.size() <= 1 || std::int64_t(c.lenses.size()) == n,
            std::string(where) + ": there are " + std::to_string(c.lenses.size()) + " lenses for " + std::to_string(n) +
                " cameras: give one a camera, one for all, or none");
    if (c.lenses != lenses_ || (!c.lenses.empty() && std::int64_t(lens_views_.extent(0)) != n)) {
      lenses_ = c.lenses;
      lens_views_ = {};
      std::vector<Lens> const each = lenses_.size() == 1 ? std::vector<Lens>(std::size_t(n), lenses_.front()) : lenses_;
      if (!each.empty()) lens_views_ = gsp::detail::to_device<decltype(lens_views_)>(exec_, "gsp::runtime::Renderer::lenses", each);
    }
    cameras.lenses = lens_views_;
    if (c.world) cameras.world = typename Out::template View<int*>(static_cast<int*>(here(c.world, world_, Dtype::int32)), n);
    return cameras;
  }

  Exec exec_;
  RendererOptions options_;
  RenderOptions render_;
  Gaussians<Mem> cloud_;
  Frames<Mem> frames_;
  std::optional<FixedFrames<Mem>> fixed_;  // `fix`: its pictures are those of frames_
  MedianDepthChannel<Mem> median_;
  IdChannel<Mem> ids_;
  Kokkos::View<float****, Kokkos::LayoutRight, Mem> normals_;
  Kokkos::View<std::uint8_t****, Kokkos::LayoutRight, Mem> rgb8_;
  Buffer viewmats_, Ks_, world_, background_, chance_, light_chance_, jitter_chance_;
  Cameras<Mem> jittered_;
  std::vector<Lens> lenses_;  // as they were given last, and on the device, one an image
  typename Cameras<Mem>::template View<Lens*> lens_views_;
};

std::unique_ptr<Renderer> make_renderer(Device device, Scene const& scene, RendererOptions const& options) {
  std::unique_ptr<Renderer> out;
  on_device(device, [&]<class Exec>(Exec const&) { out = std::make_unique<KokkosRenderer<Exec>>(scene, options); });
  return out;
}

}  // namespace gsp::runtime
