#pragma once
#include <array>
#include <gsp/io/splat_set.hpp>
#include <gsp/runtime/stepper.hpp>
#include <gsp/splat/picture_options.hpp>

namespace gsp::runtime {

/// Sets of Gaussians, numbered in the order in which they are added; a value, cheap to copy.
class Scene {
 public:
  /// Gaussians of a file; its links are those of `model`. Returns true if it binds any to a link. `name` is what messages call it.
  bool add_set(io::SplatSet const& set, std::string const& name, CompiledModel const& model);
  /// The furnished room that the library makes.
  void add_room();
  /// Gaussians on the geoms of the model's moving bodies.
  void add_surface(CompiledModel const& model);
  std::size_t count() const;
  /// Of the Gaussians that stand, how many, and the box of their centres: along each axis from the k-th of them to the k-th from the end,
  /// k = n (1 - share) / 2, so that a few that float far off do not decide. Zeros where none stands.
  struct Bounds {
    std::size_t count = 0;
    std::array<double, 3> low{}, high{};
  };
  Bounds bounds(double share = 1) const;

  struct Sets;
  std::shared_ptr<Sets> sets;
  bool surface = false;  // add_surface was called
};

/// The furnished room that the library makes, as a set that can be written.
io::SplatSet room_set();

struct RendererOptions {
  int width = 640, height = 480;
  bool rgb = true, depth = true, alpha = true, median_depth = false, normals = false, ids = false, rgb8 = false;
  int batch = 0;                           // images a wave; 0: chosen
  float alpha_max = 0.999f, near = 0.01f;  // as of RenderOptions
};

/// float32 (ids: int32, rgb8: uint8) on the renderer's device; empty where a channel was not asked for. They hold until the next `render`,
/// which writes into the same memory; one of another number of pictures frees it, and so do `fix`, and `render` and `show_sets` after it.
struct FrameArrays {
  Array rgb;           // (C, H, W, 3)
  Array depth, alpha;  // (C, H, W)
  Array median_depth;  // (C, H, W) as splat/median_depth.hpp has it
  Array normals;       // (C, H, W, 3) as splat/normals.hpp has them, of median_depth where that is asked for, else of depth
  Array ids;   // (C, H, W) bodies as splat/id_channel.hpp has them: 0 stands still, -1 where more than half of the light comes through
  Array rgb8;  // (C, H, W, 3) rgb as splat/develop.hpp develops it
};

/// Of one call of `render`.
struct DrawOptions {
  DevelopOptions develop = {};  // of rgb8 (splat/develop.hpp)
  Array background = {};        // (1 or C, H, W, 3) floats in place of develop's colour, on any device, not of the renderer's own pictures
  JitterCamerasOptions jitter = {};  // of the cameras, which stay what they are for the caller (splat/jitter_cameras.hpp)
  /// (C, 3) int64 on any device: seed, step and number that each picture's noise, its light (exposure, contrast, brightness) and its jitter
  /// are drawn of, in place of the seed, step and first_image above, which hold where these are empty; light_chance empty: chance.
  Array chance = {}, light_chance = {}, jitter_chance = {};
};

class Renderer {
 public:
  virtual ~Renderer() = default;
  /// One picture a camera, of worlds whose bodies stand as `poses` says: arrays on the renderer's device, such as Stepper::poses(), or
  /// empty ones: nothing moves. On return the pictures are done. Errors: std::invalid_argument for arrays of other shapes, options out of
  /// their range, and develop without rgb8: options are looked at before anything is drawn; where they are refused, the pictures stay what
  /// they were.
  virtual void render(PoseArrays const& poses, CameraArrays const& cameras, DrawOptions const& options = {}) = 0;
  /// Which of the scene's sets each world shows (splat/show_sets.hpp), in the order in which they were added; empty: all of them, as at
  /// first. For the next `render` on, whose pictures come where they were.
  virtual void show_sets(std::vector<std::vector<int>> const& sets_of_world) = 0;
  /// Cameras that stand still (splat/fixed_frames.hpp): what they see of what stands is drawn once, here. `poses`: of as many worlds as
  /// there will be. Errors: those of render; std::invalid_argument for a renderer with median_depth or ids, which are of all that is seen.
  virtual void fix(PoseArrays const& poses, CameraArrays const& cameras) = 0;
  /// Their pictures of this moment, with the bits that `render` has: what moves, and the blocks of pixels that it touches or leaves. On
  /// return they are done; before the first call nothing is drawn. Errors: std::invalid_argument for poses of another number of worlds,
  /// and where `fix` was not called since the last `render` or `show_sets`.
  virtual void render_fixed(PoseArrays const& poses, DrawOptions const& options = {}) = 0;
  virtual FrameArrays frames() const = 0;
  /// A renderer of the same Gaussians, which it shares, with pictures of its own.
  virtual std::unique_ptr<Renderer> another() const = 0;
  /// Bytes that `images` pictures need on the device. Not counted: a background that lies elsewhere, or is float64, is copied once, 12
  /// bytes a pixel of it; and what `fix` keeps of each different view: a picture, and the splats and lists of what stands.
  virtual std::int64_t bytes_needed(int images) const = 0;
};

std::unique_ptr<Renderer> make_renderer(Device device, Scene const& scene, RendererOptions const& options);

}  // namespace gsp::runtime
