#pragma once
#include <gsp/ray/ray_pattern.hpp>
#include <gsp/ray/ray_unit.hpp>
#include <gsp/runtime/renderer.hpp>
#include <gsp/runtime/stepper.hpp>

namespace gsp::runtime {

/// What a LiDAR unit has measured, on the scanner's device (ray/ray_scan.hpp).
struct ScanArrays {
  Array range;  // (worlds, rays) float64 [m]; RayScanOptions::miss: nothing
  Array geom;   // (worlds, rays) int32, number in the model; -1: nothing, or a Gaussian
  Array point;  // (worlds, rays, 3) float64 [m] in the world; 0: nothing
  Array time;   // (rays) float64 [s] when each left; -1: none has yet
  Array
      splat;  // (worlds, rays) int32, index of the Gaussian, of the scene's sets one after the other; -1: none. With RayScanOptions::splats
};

/// A LiDAR unit on a model, in many worlds.
class Scanner {
 public:
  virtual ~Scanner() = default;
  /// The unit has seen nothing, and is where its body is in these poses: float64 arrays on the scanner's device, such as Kinematics gives.
  /// On return it is done. Errors, in scan too: std::invalid_argument for poses of other worlds, bodies, numbers or places.
  virtual void begin(PoseArrays const& poses) = 0;
  /// The rays of step `step`, one more than the last or, after `begin`, any, of worlds whose bodies stand at its end as `poses` says. On
  /// return they are done.
  virtual void scan(PoseArrays const& poses, std::int64_t step) = 0;
  /// They stay where they are.
  virtual ScanArrays arrays() const = 0;
};

/// @param splats  Gaussians that rays meet beside the model's geoms (splat/cast_splats.hpp), bound to links of this model
/// Errors: those of make_ray_scene, make_ray_scan and make_splat_tree.
std::unique_ptr<Scanner> make_scanner(Device device, CompiledModel const& model, RayPattern const& pattern, RayMountOptions const& mount,
                                      RayScanOptions const& options, Scene const& splats = {});

}  // namespace gsp::runtime
