#pragma once
#include <gsp/core/region.hpp>
#include <gsp/sensor/detail/sensor_frames.hpp>
#include <gsp/sensor/sense.hpp>
#include <gsp/sensor/sensor_table.hpp>

/// MJCF's sensors of accelerations, and of what bodies exert on each other.
namespace gsp {

namespace detail {
template <class R, class Mem>
struct AccelerationSensors : SensorFrames<R, Mem> {
  using Frames = SensorFrames<R, Mem>;
  using Frames::body_of;
  using Frames::frame;
  using Frames::poses;
  using Entry = SensorEntry<R>;
  Accelerations<R, Mem> of;
  Kokkos::View<SensorEntry<R>*, Mem> entries;
  int nsensordata;
  int count() const { return int(entries.extent(0)); }
  KOKKOS_INLINE_FUNCTION int size() const { return 3; }
  KOKKOS_INLINE_FUNCTION int adr(int i) const { return entries(i).adr; }
  int columns() const { return nsensordata; }
  template <class T>
  KOKKOS_INLINE_FUNCTION T limit(int i, T const& x) const {
    return cut(entries(i), x);
  }
  template <class T, class Put>
  KOKKOS_FUNCTION void operator()(WorldLane<T> const& l, int i, Put const& put) const {
    using S = SensorType;
    Entry const e = entries(i);
    int const b = body_of(e.kind, e.object);
    auto const part = [&](auto const& view, int first) {
      return Vec3<T>{l.load(view, b, 6, first), l.load(view, b, 6, first + 1), l.load(view, b, 6, first + 2)};
    };
    auto const put3 = [&](Vec3<T> const& x) {
      for (int c = 0; c < 3; ++c) put(c, x[c]);
    };
    Frame<T> const own = frame(l, e.kind, e.object);
    Vec3<T> const arm = own.p - l.load3(poses.xpos, b);
    if (e.type == S::force) return put3(transpose_times(own.r, part(of.inside, 0)));
    if (e.type == S::torque) return put3(transpose_times(own.r, part(of.inside, 3) - cross(arm, part(of.inside, 0))));
    Vec3<T> const turns = part(of.acceleration, 3), w = part(of.velocity, 3);
    if (e.type == S::frame_angacc) return put3(turns);
    Vec3<T> const a = part(of.acceleration, 0) + cross(turns, arm) + cross(w, cross(w, arm));
    put3(e.type == S::accelerometer ? transpose_times(own.r, a) : a);
  }
};
}  // namespace detail

/// data (world, nsensordata): the numbers of accelerometers, force, torque, framelinacc and frameangacc sensors, at sensor_adr; what others
/// have there stays as it is. Accelerations are less gravity, those of frames in world axes whatever their reference is (MuJoCo); force and
/// torque are what the parent of the site's body exerts on it, at the site, in its axes.
/// @param sensors  sensors.accelerations as `accelerations` has left it, of this state as it is
/// Does not allocate, does not fence; one launch. Errors: std::invalid_argument where the accelerations or the poses are not of this state
/// as it is now.
template <ExecutionSpace Exec, class R, class Mem, class View>
void acceleration_sensors(Exec const& exec, Model<R, Mem> const& model, State<R, Mem> const& state, Poses<R, Mem> const& poses,
                          Sensors<R, Mem>& sensors, View& data) {
  Region const region("gsp::sensor::acceleration_sensors");
  constexpr char const* where = "gsp::acceleration_sensors";
  detail::expects_sensors(where, model, sensors, data);
  if (sensors.accelerated.extent(0) == 0) return;
  auto const& of = sensors.accelerations;
  if (of.stamp.data() && !of.stamp().is_of(state))
    throw std::invalid_argument(std::string(where) + ": the accelerations " + of.stamp().fault(state.qpos.data()) +
                                ": call accelerations(..., sensors.accelerations) first");
  detail::expects_poses_of(where, poses, state);
  if (sensors.subtrees.com.data()) subtree_com(exec, model, poses, sensors.subtrees);
  sense(exec, detail::AccelerationSensors<R, Mem>{{model, poses, sensors.subtrees}, of, sensors.accelerated, sensors.nsensordata}, data,
        {.label = "gsp::sensor::acceleration_sensors"});
}

}  // namespace gsp
