#include <chrono>
#include <gsp/dynamics/kinematics.hpp>
#include <gsp/io/gaussians.hpp>
#include <gsp/splat/render.hpp>
#include <gsp/splat/sample_room.hpp>
#include <gsp/splat/sample_surface.hpp>
#include <optional>

#include "renderer.hpp"

namespace gsp_cli {

struct Scene::Sets {
  std::vector<gsp::GaussianSet> list;
};
namespace {
gsp::GaussianSet& add(Scene& scene, gsp::GaussianSet set) {
  if (!scene.sets) scene.sets = std::make_shared<Scene::Sets>();
  return scene.sets->list.emplace_back(std::move(set));
}
}  // namespace

bool Scene::add_set(gsp::io::SplatSet const& set, std::string const& name, gsp::CompiledModel const& model) {
  bool linked = false;
  for (int l : set.link) linked |= l >= 0;
  add(*this, gsp::io::to_gaussian_set(set, model, name));
  return linked;
}
void Scene::add_room() { add(*this, gsp::sample_room<gsp::GaussianSet>()); }
void Scene::add_surface(gsp::CompiledModel const& model) {
  add(*this, gsp::sample_surface(model, {.count = 30000, .world = false}));
}  // floors and walls: the scene has its own
gsp::io::SplatSet room_set() { return gsp::sample_room<gsp::io::SplatSet>(); }
std::size_t Scene::count() const {
  std::size_t n = 0;
  if (sets)
    for (auto const& s : sets->list) n += s.size();
  return n;
}

namespace {

template <class Exec>
class KokkosRenderer : public Renderer {
  using Mem = typename Exec::memory_space;

 public:
  KokkosRenderer(Scene const& scene, gsp::CompiledModel const& model, RendererOptions const& options)
      : options_(options), cloud_(gsp::make_gaussians(exec_, scene.sets->list)), nbody_(std::max(1, model.nbody)) {
    if (model.nv > 0)
      model_ = gsp::make_model<double>(exec_, model);
    else if (model.nbody > 0)
      fixed_ = gsp::static_poses(model);
  }

  double render(Shots const& shots, int repeat) override {
    place(shots);
    auto const cameras = gsp::make_cameras(exec_, shots.viewmats, shots.Ks);
    int const images = static_cast<int>(shots.count());
    if (frames_.images != images) {
      frames_ = {};  // the old buffers go before the new ones come
      frames_ = gsp::make_frames(exec_, cloud_,
                                 {.images = images,
                                  .width = options_.width,
                                  .height = options_.height,
                                  .rgb = options_.rgb,
                                  .depth = options_.depth,
                                  .alpha = options_.alpha,
                                  .batch = options_.batch});
    }
    gsp::RenderOptions draw;
    draw.alpha_max = options_.alpha_max;
    if (repeat > 1) gsp::render(exec_, cloud_, *poses_, cameras, frames_, draw);  // buffers find their size
    exec_.fence("gsp: before drawing");
    auto const start = std::chrono::steady_clock::now();
    for (int r = 0; r < repeat; ++r) gsp::render(exec_, cloud_, *poses_, cameras, frames_, draw);
    exec_.fence("gsp: after drawing");
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  }

  void read(Pictures& p) override {
    auto const fetch = [&](auto const& view, std::vector<float>& out) {
      out.resize(view.size());
      if (view.size() == 0) return;
      using Flat = Kokkos::View<float const*, Mem, Kokkos::MemoryUnmanaged>;
      Kokkos::deep_copy(exec_, Kokkos::View<float*, Kokkos::HostSpace, Kokkos::MemoryUnmanaged>(out.data(), out.size()),
                        Flat(view.data(), view.size()));
      exec_.fence("gsp: pictures are here");
    };
    fetch(frames_.rgb, p.rgb), fetch(frames_.depth, p.depth), fetch(frames_.alpha, p.alpha);
  }

 private:
  void place(Shots const& shots) {
    if (!poses_ || worlds_ != shots.worlds) {
      worlds_ = shots.worlds;
      if (model_) {
        state_ = gsp::make_state(exec_, *model_, {.worlds = worlds_});
        dynamics_ = gsp::make_dynamics(exec_, *model_, {.worlds = worlds_});
        poses_ = gsp::make_poses(exec_, *model_, {.worlds = worlds_});
      } else {
        poses_ = gsp::make_poses<double>(exec_, worlds_, nbody_, 0);
        if (!fixed_.empty()) put_static_bodies();
      }
    }
    if (!model_) return;
    Kokkos::deep_copy(exec_, state_->qpos,
                      Kokkos::View<double const**, Kokkos::LayoutRight, Kokkos::HostSpace, Kokkos::MemoryUnmanaged>(shots.qpos.data(),
                                                                                                                    worlds_, model_->nq));
    gsp::forward_kinematics(exec_, *model_, *state_, *dynamics_, *poses_);
  }
  void put_static_bodies() {
    auto const pos = Kokkos::create_mirror_view(Kokkos::HostSpace{}, poses_->xpos),
               quat = Kokkos::create_mirror_view(Kokkos::HostSpace{}, poses_->xquat);
    for (int w = 0; w < worlds_; ++w)
      for (int b = 0; b < nbody_; ++b) {
        for (int k = 0; k < 3; ++k) pos(w, b, k) = fixed_[7 * std::size_t(b) + k];
        for (int k = 0; k < 4; ++k) quat(w, b, k) = fixed_[7 * std::size_t(b) + 3 + k];
      }
    Kokkos::deep_copy(poses_->xpos, pos), Kokkos::deep_copy(poses_->xquat, quat);
  }

  Exec exec_;
  RendererOptions options_;
  gsp::Gaussians<Mem> cloud_;
  int nbody_, worlds_ = 0;
  std::vector<double> fixed_;  // poses of a model in which nothing moves
  std::optional<gsp::Model<double, Mem>> model_;
  std::optional<gsp::State<double, Mem>> state_;
  std::optional<gsp::Dynamics<double, Mem>> dynamics_;
  std::optional<gsp::Poses<double, Mem>> poses_;
  gsp::Frames<Mem> frames_;
};

}  // namespace

std::unique_ptr<Renderer> make_renderer(Device device, Scene const& scene, gsp::CompiledModel const& model,
                                        RendererOptions const& options) {
#ifdef KOKKOS_ENABLE_CUDA
  if (device == Device::cuda) return std::make_unique<KokkosRenderer<Kokkos::Cuda>>(scene, model, options);
#endif
  (void)device;
  return std::make_unique<KokkosRenderer<Kokkos::DefaultHostExecutionSpace>>(scene, model, options);
}

}  // namespace gsp_cli
