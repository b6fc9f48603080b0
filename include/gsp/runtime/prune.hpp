#pragma once
#include <gsp/runtime/renderer.hpp>

namespace gsp::runtime {

struct PruningOptions {
  int width = 320, height = 240;  // of the pictures that are kept alike
  double keep = 0.3;              // share of the Gaussians
  float depth_weight = 0.1f, alpha_max = 0.999f;
  float near = 0.01f;  // camera z before which nothing is seen, in the file's unit
  int batch = 0;       // images a wave; 0: chosen
};
struct Pruning {
  io::SplatSet set;            // what is left, with other colours, opacities and sizes
  int rounds = 0, sweeps = 0;  // of dropping; how often all pictures were drawn
};

/// What splat/prune_gaussians.hpp does with a file's Gaussians, whose links are those of `model`; `name` is what messages call the set.
/// @param poses    on the device, such as Kinematics gives them, or empty: nothing moves
/// @param cameras  float32 on the host: where pictures are taken from, each of its `world` of the poses, or c of c % worlds, and through
///                 its lens
/// Errors: those of prune_gaussians, and as Scene::add_set and Renderer::render.
Pruning prune(Device device, io::SplatSet const& set, std::string const& name, CompiledModel const& model, PoseArrays const& poses,
              CameraArrays const& cameras, PruningOptions const& options);
/// Bytes that it needs on the device, for so many cameras.
std::int64_t bytes_to_prune(Device device, io::SplatSet const& set, int cameras, PruningOptions const& options);

}  // namespace gsp::runtime
