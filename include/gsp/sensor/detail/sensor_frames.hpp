#pragma once
#include <gsp/dynamics/object_poses.hpp>
#include <gsp/sensor/sensor_table.hpp>

/// Frames that sensors of several stages are about.
namespace gsp::detail {

template <class R, class Mem>
struct SensorFrames {
  using Entry = SensorEntry<R>;
  Model<R, Mem> model;
  Poses<R, Mem> poses;
  Subtrees<R, Mem> subtrees;

  KOKKOS_INLINE_FUNCTION int body_of(int kind, int i) const {
    return kind == Entry::geom     ? model.geom_body(i)
           : kind == Entry::site   ? model.site_body(i)
           : kind == Entry::camera ? model.cam_body(i)
                                   : i;
  }
  /// Pose of what is fixed to its body; a camera's as if it were.
  template <class T>
  KOKKOS_INLINE_FUNCTION Transform<T> pose(WorldLane<T> const& l, int kind, int i) const {
    if (kind == Entry::none) return {{T(0), T(0), T(0)}, identity_quat<T>()};
    int const b = body_of(kind, i);
    Transform<T> const body{l.load3(poses.xpos, b), l.load4(poses.xquat, b)};
    if (kind == Entry::inertial) return body * Transform<T>{l.constant3(model.body_ipos, b), l.constant4(model.body_iquat, b)};
    if (kind == Entry::geom) return body * Transform<T>{l.constant3(model.geom_pos, i), l.constant4(model.geom_quat, i)};
    if (kind == Entry::site) return body * Transform<T>{l.constant3(model.site_pos, i), l.constant4(model.site_quat, i)};
    if (kind == Entry::camera) return body * Transform<T>{l.constant3(model.cam_pos, i), l.constant4(model.cam_quat, i)};
    return body;
  }
  template <class T>
  KOKKOS_INLINE_FUNCTION Frame<T> frame(WorldLane<T> const& l, int kind, int i) const {
    if (kind == Entry::camera) return camera_frame(l, model, poses, subtrees.com, i);
    Transform<T> const x = pose(l, kind, i);
    return {x.p, to_matrix(x.q)};
  }
};

/// Where geom or site i of a body is, with fields of its pose there, one world at a time.
template <class R, class Mem>
KOKKOS_INLINE_FUNCTION Transform<R> pose_on_body(Poses<R, Mem> const& poses, Field<R> const& pos, Field<R> const& quat, int w, int b,
                                                 int i) {
  Transform<R> const body{{poses.xpos(w, b, 0), poses.xpos(w, b, 1), poses.xpos(w, b, 2)},
                          {poses.xquat(w, b, 0), poses.xquat(w, b, 1), poses.xquat(w, b, 2), poses.xquat(w, b, 3)}};
  return body * Transform<R>{{pos(w, 3 * i), pos(w, 3 * i + 1), pos(w, 3 * i + 2)},
                             {quat(w, 4 * i), quat(w, 4 * i + 1), quat(w, 4 * i + 2), quat(w, 4 * i + 3)}};
}

/// Where sites are, one world at a time.
template <class R, class Mem>
struct SitePoses {
  Poses<R, Mem> poses;
  typename Model<R, Mem>::template Array<int> site_body;
  Field<R> site_pos, site_quat;
  SitePoses(Model<R, Mem> const& model, Poses<R, Mem> const& of)
      : poses(of), site_body(model.site_body), site_pos(model.site_pos), site_quat(model.site_quat) {}
  KOKKOS_INLINE_FUNCTION Transform<R> operator()(int w, int s) const {
    return pose_on_body(poses, site_pos, site_quat, w, site_body(s), s);
  }
};

/// Sensors of this model, and room for their numbers.
template <class R, class Mem, class View>
void expects_sensors(char const* where, Model<R, Mem> const& model, Sensors<R, Mem> const& sensors, View const& data) {
  if (int(data.extent(0)) != sensors.worlds || int(data.extent(1)) != sensors.nsensordata)
    throw std::invalid_argument(std::string(where) + ": data is (" + std::to_string(data.extent(0)) + ", " +
                                std::to_string(data.extent(1)) + ") and must be (worlds, nsensordata), here (" +
                                std::to_string(sensors.worlds) + ", " + std::to_string(sensors.nsensordata) + ")");
  expects(sensors.model == sizes_of(model), where, "the sensors were made for another model: make_sensors with this");
}

/// What becomes of a number on its way.
template <class R, class T>
KOKKOS_INLINE_FUNCTION T cut(SensorEntry<R> const& e, T const& x) {
  if (!(e.cutoff > R(0))) return x;
  return e.above ? min(x, T(e.cutoff)) : clamp(x, T(-e.cutoff), T(e.cutoff));
}

/// A point of a site's frame that lies inside of its volume, and not on its surface.
template <class T>
KOKKOS_INLINE_FUNCTION auto inside_volume(ShapeType type, Vec3<T> const& size, Vec3<T> const& p) {
  switch (type) {
    case ShapeType::sphere:
      return dot(p, p) < square(size.x);
    case ShapeType::capsule: {
      T const z = p.z - clamp(p.z, -size.y, size.y);
      return p.x * p.x + p.y * p.y + z * z < square(size.x);
    }
    case ShapeType::ellipsoid:
      return square(p.x / size.x) + square(p.y / size.y) + square(p.z / size.z) < T(1);
    case ShapeType::cylinder:
      return (abs(p.z) < size.y) && (p.x * p.x + p.y * p.y < square(size.x));
    case ShapeType::box:
      return (abs(p.x) < size.x) && (abs(p.y) < size.y) && (abs(p.z) < size.z);
    case ShapeType::plane:
    case ShapeType::hfield:
    case ShapeType::mesh:
      break;
  }
  return p.x < p.x;  // nowhere
}

}  // namespace gsp::detail
