#pragma once
// Pictures for the commands: a scene of Gaussians, a model that carries some, cameras. No word of Kokkos here.
#include <gsp/io/splat_transform.hpp>
#include <gsp/model/compiled.hpp>
#include <memory>
#include <string>
#include <vector>

#include "device.hpp"

namespace gsp_cli {

/// Sets of Gaussians that are drawn together.
class Scene {
 public:
  /// Gaussians of a file; its links are those of `model`. Returns true if it binds any to a link. `name` is what messages call it.
  bool add_set(gsp::io::SplatSet const& set, std::string const& name, gsp::CompiledModel const& model);
  /// The furnished room that the library makes.
  void add_room();
  /// Gaussians on the geoms of the model's moving bodies.
  void add_surface(gsp::CompiledModel const& model);
  std::size_t count() const;

  struct Sets;
  std::shared_ptr<Sets> sets;
};

/// The furnished room that the library makes, as a set that can be written.
gsp::io::SplatSet room_set();

struct RendererOptions {
  int width = 640, height = 480;
  bool rgb = true, depth = true, alpha = true;
  int batch = 0;  // images a wave; 0: chosen
  float alpha_max = 0.999f;
};

/// States and cameras of some pictures: picture c shows world c % worlds.
struct Shots {
  int worlds = 1;
  std::vector<double> qpos;         // (worlds, nq)
  std::vector<float> viewmats, Ks;  // (C, 4, 4), (C, 3, 3)
  std::size_t count() const { return viewmats.size() / 16; }
};

struct Pictures {
  std::vector<float> rgb, depth, alpha;  // (C, H, W, 3), (C, H, W), (C, H, W); empty where not asked for
};

class Renderer {
 public:
  virtual ~Renderer() = default;
  /// Puts the model's links where qpos says, draws all pictures `repeat` times; returns the seconds of the drawing, poses not included.
  virtual double render(Shots const& shots, int repeat) = 0;
  /// The pictures of the last `render`.
  virtual void read(Pictures& pictures) = 0;
};

/// `model` may be empty (nq 0, no bodies): a scene without a robot.
std::unique_ptr<Renderer> make_renderer(Device device, Scene const& scene, gsp::CompiledModel const& model, RendererOptions const& options);

}  // namespace gsp_cli
