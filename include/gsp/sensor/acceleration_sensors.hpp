#pragma once
#include <gsp/core/region.hpp>
#include <gsp/dynamics/detail/dofs_above.hpp>
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
  using Frames::model;
  using Frames::poses;
  using Entry = SensorEntry<R>;
  Dynamics<R, Mem> dynamics;
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
  /// Of the point x of body b, in world axes: how it accelerates, less gravity (a body that nothing moves rests). Along the dofs i that
  /// move the body, from the root, with S_i their motion vectors about the tree's centre of mass,
  ///   A <- A + v x S_i qvel_i + S_i qacc_i,   v <- v + S_i qvel_i,   a = A_linear + A_angular x r + w x (v_linear + w x r)
  template <class T>
  KOKKOS_INLINE_FUNCTION Spatial<T> acceleration(WorldLane<T> const& l, int b, Vec3<T> const& x) const {
    Vec3<T> const zero{T(0), T(0), T(0)};
    Spatial<T> v{zero, zero}, before = v, acc{zero, T(-1) * l.constant3(model.gravity, 0)};
    DofsAbove<T, R, Mem> const dofs(l, model, dynamics, b);
    if (dofs.none()) return acc;
    Archetype const& a = dofs.archetype();
    dofs.each([&](int i, Spatial<T> const& motion) {
      int const j = model.ints(a.dof_jnt + i), place = i - model.ints(a.jnt_dofadr + j);
      bool const free = JointType(model.ints(a.jnt_type + j)) == JointType::free;
      T const rate = dofs.rate(i);
      if (place == (free ? 3 : 0)) before = v;  // the three axes of a ball turn with the frame before it
      if (!free || place >= 3) acc = fma(rate, cross_motion(before, motion), acc);  // world axes do not turn
      acc = fma(l.load(of.qacc, dofs.in_world(i)), motion, acc);
      v = fma(rate, motion, v);
    });
    Vec3<T> const r = x - dofs.center();
    acc.linear = acc.linear + cross(acc.angular, r) + cross(v.angular, v.linear + cross(v.angular, r));
    return acc;
  }
  template <class T, class Put>
  KOKKOS_FUNCTION void operator()(WorldLane<T> const& l, int i, Put const& put) const {
    using S = SensorType;
    Entry const e = entries(i);
    int const b = body_of(e.kind, e.object);
    auto const put3 = [&](Vec3<T> const& x) {
      for (int c = 0; c < 3; ++c) put(c, x[c]);
    };
    Frame<T> const own = frame(l, e.kind, e.object);
    if (e.type == S::force || e.type == S::torque) {
      auto const inside = [&](int first) {
        return Vec3<T>{l.load(of.inside, b, 6, first), l.load(of.inside, b, 6, first + 1), l.load(of.inside, b, 6, first + 2)};
      };
      Vec3<T> const force = inside(0);
      if (e.type == S::force) return put3(transpose_times(own.r, force));
      return put3(transpose_times(own.r, inside(3) - cross(own.p - l.load3(poses.xpos, b), force)));
    }
    Spatial<T> const a = acceleration(l, b, own.p);
    put3(e.type == S::frame_angacc ? a.angular : e.type == S::accelerometer ? transpose_times(own.r, a.linear) : a.linear);
  }
};
}  // namespace detail

/// data (world, nsensordata): the numbers of accelerometers, force, torque, framelinacc and frameangacc sensors, at sensor_adr; what others
/// have there stays as it is. Accelerations are less gravity, those of frames in world axes whatever their reference is (MuJoCo); force and
/// torque are what the parent of the site's body exerts on it, at the site, in its axes.
/// @param dynamics  as `accelerations` was given them
/// @param sensors   sensors.accelerations as `accelerations` has left it, of this state as it is
/// @param has_com   smooth_sensors has just been called with these poses: sensors.subtrees are theirs, and are not computed again
/// Cost 60 flop a dof above a frame. Does not allocate, does not fence; one launch. Errors: std::invalid_argument where the accelerations,
/// the dynamics or the poses are not of this state as it is now.
template <ExecutionSpace Exec, class R, class Mem, class View>
void acceleration_sensors(Exec const& exec, Model<R, Mem> const& model, State<R, Mem> const& state, Poses<R, Mem> const& poses,
                          Dynamics<R, Mem> const& dynamics, Sensors<R, Mem>& sensors, View& data, bool has_com = false) {
  Region const region("gsp::sensor::acceleration_sensors");
  constexpr char const* where = "gsp::acceleration_sensors";
  detail::expects_sensors(where, model, sensors, data);
  if (sensors.accelerated.extent(0) == 0) return;
  auto const& of = sensors.accelerations;
  if (of.stamp.data() && !of.stamp().is_of(state))
    throw std::invalid_argument(std::string(where) + ": the accelerations " + of.stamp().fault(state.qpos.data()) +
                                ": call accelerations(..., sensors.accelerations) first");
  detail::expects_fit(where, model, state, dynamics, poses);
  detail::expects_of(where, dynamics, state, detail::set_of(Quantity::motion, Quantity::velocity));
  detail::expects_poses_of(where, poses, state);
  if (sensors.subtrees.com.data() && !has_com) subtree_com(exec, model, poses, sensors.subtrees);
  sense(exec, detail::AccelerationSensors<R, Mem>{{model, poses, sensors.subtrees}, dynamics, of, sensors.accelerated, sensors.nsensordata},
        data, {.label = "gsp::sensor::acceleration_sensors"});
}

}  // namespace gsp
