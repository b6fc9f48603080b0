#pragma once
#include <gsp/core/region.hpp>
#include <gsp/sensor/cameras.hpp>
#include <gsp/splat/id_channel.hpp>
#include <gsp/splat/render.hpp>

/// Cameras as sensors: RGB, depth and what each pixel shows, of all worlds in one call.
namespace gsp {

struct CameraSensorOptions {
  int worlds = 1;
  int width = 0, height = 0;  // of the pictures [pixel]; 0: the resolution of the model's cameras
  bool rgb = true, depth = true, alpha = false, id = false;
  int batch = 0;  // images a wave; 0: chosen (FrameOptions)
};

/// Image world * count() + k is what camera k of that world sees.
template <class R, class Mem>
struct CameraSensor {
  using memory_space = Mem;
  CameraMounts<R, Mem> mounts;
  Cameras<Mem> cameras;
  Frames<Mem> frames;                                 // rgb, depth, alpha: those that were asked for
  Kokkos::View<int***, Kokkos::LayoutRight, Mem> id;  // (images, height, width) body, or label; -1: nothing. Empty: not asked for
  Kokkos::View<int*, Mem> label;                      // of each Gaussian, in place of its body (IdChannel); yours to set, empty at first
  int count() const { return mounts.count(); }
};

namespace detail {
/// The one resolution of the model's cameras among the mounts.
inline void take_resolution(CompiledModel const& compiled, std::vector<CameraMount> const& mounts, CameraSensorOptions& options) {
  for (std::size_t k = 0; k < mounts.size(); ++k) {
    std::string const place = "gsp::make_camera_sensor: mount " + std::to_string(k);
    int const c = mounts[k].camera.empty() ? mounts[k].camera_id : camera_id(compiled, mounts[k].camera);
    if (c < 0 || c >= compiled.ncam) throw Error(place + " is no camera of the model and has no resolution: give width and height");
    int const width = int(compiled.cam_resolution[std::size_t(c)][0]), height = int(compiled.cam_resolution[std::size_t(c)][1]);
    if (width <= 1 && height <= 1) throw Error(place + ": its camera has no resolution: give it one, or width and height here");
    if (k > 0 && (width != options.width || height != options.height))
      throw Error(place + ": its camera has " + std::to_string(width) + " x " + std::to_string(height) + " pixels, those before it " +
                  std::to_string(options.width) + " x " + std::to_string(options.height) +
                  ": make a sensor of each size, or give width and height");
    options.width = width;
    options.height = height;
  }
}
}  // namespace detail

/// Cameras of a model, or on its links, that look at the Gaussians of `cloud`.
/// @param mounts  which, in this order; empty: all cameras of the model, in its order
/// Allocates. Errors: those of make_camera_mounts and make_frames; gsp::Error where no size is given and the cameras have no resolution, or
/// several; std::invalid_argument for a model without cameras and no mounts.
template <class R, ExecutionSpace Exec, class Mem>
CameraSensor<R, Mem> make_camera_sensor(Exec const& exec, Model<R, Mem> const& model, CompiledModel const& compiled,
                                        Gaussians<Mem> const& cloud, std::vector<CameraMount> mounts = {},
                                        CameraSensorOptions options = {}) {
  expects((options.width > 0) == (options.height > 0) && options.width >= 0 && options.height >= 0,
          "gsp::make_camera_sensor: give width and height of the pictures, or neither: then they are the cameras' resolution");
  if (mounts.empty()) {
    expects(compiled.ncam > 0, "gsp::make_camera_sensor: the model has no cameras: name a body as a mount");
    for (int c = 0; c < compiled.ncam; ++c) mounts.push_back({.camera_id = c});
  }
  if (options.width == 0) detail::take_resolution(compiled, mounts, options);
  CameraSensor<R, Mem> sensor;
  sensor.mounts =
      make_camera_mounts(exec, model, compiled, mounts, {.worlds = options.worlds, .width = options.width, .height = options.height});
  sensor.cameras = make_cameras(exec, sensor.mounts.images());
  FrameOptions frames;
  frames.images = sensor.mounts.images();
  frames.width = options.width;
  frames.height = options.height;
  frames.rgb = options.rgb;
  frames.depth = options.depth;
  frames.alpha = options.alpha;
  frames.batch = options.batch;
  frames.values = options.id ? IdChannel<Mem>::size : 0;
  sensor.frames = make_frames(exec, cloud, frames);
  if (options.id)
    sensor.id = detail::allocate_zero<decltype(sensor.id)>(exec, "gsp::CameraSensor::id", frames.images, frames.height, frames.width);
  return sensor;
}

/// What the cameras see of all worlds in these poses: sensor.frames, and sensor.id where it was asked for.
/// @param poses     of as many worlds as the sensor, after forward_kinematics or a step
/// @param cloud     that the sensor was made for, or one of no more Gaussians
/// @param channels  further picture channels (channels.hpp)
/// Waits once at its end and allocates where buffers have to grow, as `render` does. Cost: that of render and cameras_of. Errors: theirs,
/// and std::invalid_argument for labels of another number than the Gaussians.
template <ExecutionSpace Exec, class R, class Mem, class... Channels>
void see(Exec const& exec, Model<R, Mem> const& model, Poses<R, Mem> const& poses, Gaussians<Mem> const& cloud,
         CameraSensor<R, Mem>& sensor, RenderOptions options = {}, Channels const&... channels) {
  Region const region("gsp::sensor::see");
  expects(sensor.label.extent(0) == 0 || int(sensor.label.extent(0)) == cloud.count,
          "gsp::see: there are " + std::to_string(sensor.label.extent(0)) + " labels for " + std::to_string(cloud.count) +
              " Gaussians: give one a Gaussian, in the order of the sets, or none");
  cameras_of(exec, model, poses, sensor.mounts, sensor.cameras);
  if (sensor.id.data())
    render(exec, cloud, poses, sensor.cameras, sensor.frames, options, IdChannel<Mem>{sensor.label, sensor.id}, channels...);
  else
    render(exec, cloud, poses, sensor.cameras, sensor.frames, options, channels...);
}

}  // namespace gsp
