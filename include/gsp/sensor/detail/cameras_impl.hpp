#pragma once
#include <algorithm>
#include <cmath>
#include <gsp/core/detail/views.hpp>
#include <gsp/model/names.hpp>
#include <gsp/sensor/cameras.hpp>
#include <gsp/splat/look_at.hpp>
#include <string>
#include <vector>

/// Mounts of gsp/sensor/cameras.hpp, where the contract stands.
namespace gsp {

template <class R, ExecutionSpace Exec, class Mem>
CameraMounts<R, Mem> make_camera_mounts(Exec const& exec, Model<R, Mem> const& model, CompiledModel const& compiled,
                                        std::vector<CameraMount> const& mounts, CameraMountsOptions options) {
  expects(options.worlds > 0, "gsp::make_camera_mounts: worlds must be positive and is " + std::to_string(options.worlds));
  expects(!mounts.empty(), "gsp::make_camera_mounts: no mount is given: name at least one body or camera");
  expects(options.width > 0 && options.height > 0, "gsp::make_camera_mounts: width and height must be positive");
  detail::expects_made_of("gsp::make_camera_mounts", model, compiled);
  CameraMounts<R, Mem> m;
  m.worlds = options.worlds;
  m.model = detail::sizes_of(model);
  m.width = options.width;
  m.height = options.height;
  bool by_com = false;
  std::vector<detail::MountEntry<R>> entries;
  for (std::size_t k = 0; k < mounts.size(); ++k) {
    CameraMount const& mount = mounts[k];
    std::string const place = "gsp::make_camera_mounts: mount " + std::to_string(k);
    expects(!mount.camera.empty() + (mount.camera_id >= 0) + !mount.body.empty() + (mount.body_id >= 0) == 1,
            place + ": name one camera or one body, by name or by index");
    detail::MountEntry<R> e{};
    e.camera = mount.camera.empty() ? mount.camera_id : camera_id(compiled, mount.camera);
    e.body = mount.body.empty() ? mount.body_id : body_id(compiled, mount.body);
    if (e.camera >= 0) {
      expects(e.camera < compiled.ncam,
              place + ": the model has " + std::to_string(compiled.ncam) + " cameras, not one of index " + std::to_string(e.camera));
      auto const mode = CameraMode(compiled.cam_mode[e.camera]);
      by_com = by_com || mode == CameraMode::track_com || mode == CameraMode::target_body_com;
      auto const& size = compiled.cam_sensor_size[e.camera];
      if (size[0] > 0) {
        auto const& focal = compiled.cam_focal[e.camera];  // of a picture of its own resolution
        auto const& resolution = compiled.cam_resolution[e.camera];
        auto const& principal = compiled.cam_principal[e.camera];
        e.fx = float(focal[0] / resolution[0] * options.width);
        e.fy = float(focal[1] / resolution[1] * options.height);
        e.cx = float(options.width * (0.5 - principal[0] / size[0]));
        e.cy = float(options.height * (0.5 + principal[1] / size[1]));
      }
    } else {
      expects(e.body < compiled.nbody,
              place + ": the model has " + std::to_string(compiled.nbody) + " bodies, not one of index " + std::to_string(e.body));
      expects(mount.fovy > 0 && mount.fovy < 3.141592, place + ": CameraMount::fovy is " + std::to_string(mount.fovy) +
                                                           " and must lie between 0 and pi: it is in radians, degrees times pi / 180");
      auto const& p = mount.pos;
      auto const& q = mount.quat;
      double way = q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3];
      if (mount.look_at) way = norm(Vec3<double>{(*mount.look_at)[0] - p[0], (*mount.look_at)[1] - p[1], (*mount.look_at)[2] - p[2]});
      expects(way > 0 && std::isfinite(way + p[0] + p[1] + p[2]),
              place + ": its place and rotation must be finite, the rotation not 0, and it must not look at itself");
      Mat3<double> axes = to_matrix(normalized(Quat<double>{q[0], q[1], q[2], q[3]}));
      if (mount.look_at) {
        auto const& t = *mount.look_at;
        axes = gsp::look_at<double>({p[0], p[1], p[2]}, {t[0], t[1], t[2]}).r;  // rows right, down, forward
        axes = {{axes(0, 0), -axes(1, 0), -axes(2, 0), axes(0, 1), -axes(1, 1), -axes(2, 1), axes(0, 2), -axes(1, 2), -axes(2, 2)}};
      }
      for (int c = 0; c < 9; ++c) e.axes.m[c] = R(axes.m[c]);
      e.pos = {R(p[0]), R(p[1]), R(p[2])};
    }
    if (e.fx == 0) {
      auto const K = pinhole(options.width, options.height, {.fovy = e.camera >= 0 ? compiled.cam_fovy[e.camera] : mount.fovy});
      e.fx = K[0];
      e.fy = K[4];
      e.cx = K[2];
      e.cy = K[5];
    }
    entries.push_back(e);
  }
  m.entries = detail::to_device<Kokkos::View<detail::MountEntry<R>*, Mem>>(exec, "gsp::CameraMounts::entries", entries);
  bool const lensed = std::any_of(mounts.begin(), mounts.end(), [](CameraMount const& mount) { return mount.lens.has_value(); });
  if (lensed) {
    Lens const none = opencv_lens({0, 0, 0, 0});
    std::vector<Lens> lenses;
    for (int w = 0; w < options.worlds; ++w)
      for (auto const& mount : mounts) lenses.push_back(mount.lens.value_or(none));
    m.lenses = detail::to_device<decltype(m.lenses)>(exec, "gsp::CameraMounts::lenses", lenses);
  }
  if (by_com) m.subtrees = make_subtrees(exec, model, {.worlds = options.worlds});
  return m;
}

}  // namespace gsp
