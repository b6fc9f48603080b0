#pragma once
#include <gsp/core/region.hpp>
#include <gsp/dynamics/detail/dofs_above.hpp>
#include <gsp/sensor/detail/sensor_frames.hpp>
#include <gsp/sensor/sense.hpp>
#include <gsp/sensor/sensor_table.hpp>

/// MJCF's sensors that are functions of positions, velocities and actuator forces (MuJoCo's mj_sensorPos, mj_sensorVel and part of
/// mj_sensorAcc).
namespace gsp {

namespace detail {
/// MJCF's smooth sensors as a SensorKind.
template <class R, class Mem>
struct SmoothSensors : SensorFrames<R, Mem> {
  using Frames = SensorFrames<R, Mem>;
  using Frames::body_of;
  using Frames::frame;
  using Frames::model;
  using Frames::pose;
  using Frames::poses;
  using Frames::subtrees;
  State<R, Mem> state;
  Dynamics<R, Mem> dynamics;
  Kokkos::View<SensorEntry<R>*, Mem> entries;
  Vec3<R> magnetic;
  Kokkos::View<R**, Kokkos::LayoutRight, Mem> energy;
  Kokkos::View<int*, Mem> site_type;
  Kokkos::View<R*, Mem> site_size;
  int nsensordata;

  using Entry = SensorEntry<R>;
  int count() const { return int(entries.extent(0)); }
  KOKKOS_INLINE_FUNCTION int size() const { return 4; }  // at most
  KOKKOS_INLINE_FUNCTION int adr(int i) const { return entries(i).adr; }
  int columns() const { return nsensordata; }
  template <class T>
  KOKKOS_INLINE_FUNCTION T limit(int i, T const& x) const {
    return cut(entries(i), x);
  }
  /// Velocity of the point x of body b, in world axes.
  template <class T>
  KOKKOS_INLINE_FUNCTION Spatial<T> velocity(WorldLane<T> const& l, int b, Vec3<T> const& x) const {
    Vec3<T> const zero{T(0), T(0), T(0)};
    Spatial<T> v{zero, zero};
    DofsAbove<T, R, Mem> const dofs(l, model, dynamics, b);
    if (dofs.none()) return v;
    dofs.each([&](int i, Spatial<T> const& motion) { v = fma(dofs.rate(i), motion, v); });
    v.linear = v.linear + cross(v.angular, x - dofs.center());
    return v;
  }
  template <class T, class Put>
  KOKKOS_FUNCTION void operator()(WorldLane<T> const& l, int i, Put const& put) const {
    using S = SensorType;
    Entry const e = entries(i);
    auto const put3 = [&](Vec3<T> const& x) {
      for (int c = 0; c < 3; ++c) put(c, x[c]);
    };
    auto const put_quat = [&](Quat<T> const& q) {
      put(0, q.w);
      put(1, q.x);
      put(2, q.y);
      put(3, q.z);
    };
    auto const item = [&](int at) { return l.item(model, dynamics, e.tree, at); };
    auto const position = [&](int i) { return l.load(state.qpos, i) + l.load(state.qpos_low, i); };
    auto const layout = [&](int tree) { return dynamics.layouts(model.tree_archetype(tree)); };
    switch (e.type) {
      case S::clock: {
        T time(R(0));
        if constexpr (WorldLane<T>::W == 1)
          time = T(state.steps(l.first)) * model.timestep;
        else
          for (int k = 0; k < WorldLane<T>::W; ++k) time.set(k, R(state.steps(l.world(k))) * model.timestep);
        return put(0, time);
      }
      case S::potential_energy:
      case S::kinetic_energy:
        return put(0, l.load(energy, e.type == S::kinetic_energy));
      case S::joint_pos:
        return put(0, position(model.jnt_qposadr(e.object)));
      case S::joint_vel:
        return put(0, l.load(state.qvel, model.jnt_dofadr(e.object)));
      case S::ball_quat: {
        int const q = model.jnt_qposadr(e.object);
        return put_quat(normalized(Quat<T>{position(q), position(q + 1), position(q + 2), position(q + 3)}));
      }
      case S::ball_angvel: {
        int const v = model.jnt_dofadr(e.object);
        return put3({l.load(state.qvel, v), l.load(state.qvel, v + 1), l.load(state.qvel, v + 2)});
      }
      case S::tendon_pos: {  // that of qpos, and J q_low
        Archetype const& a = model.archetypes(model.tree_archetype(e.tree));
        DynamicsLayout const at(a);
        T length = item(at.tendon_length + e.local);
        int const terms = a.instance_term + model.tree_instance(e.tree) * a.nterm;
        for (int k = model.ints(a.tendon_termadr + e.local), end = model.ints(a.tendon_termadr + e.local + 1); k < end; ++k)
          length = fma(l.constant(model.term_coef, model.ints(terms + k)),
                       item(at.low + model.ints(a.jnt_dofadr + model.ints(a.term_jnt + k))), length);
        for (int k = model.ints(a.tendon_jadr + e.local), end = model.ints(a.tendon_jadr + e.local + 1); k < end; ++k)
          length = fma(item(at.tendon_J + k), item(at.low + model.ints(a.tendon_jdof + k)), length);
        return put(0, length);
      }
      case S::tendon_vel:
        return put(0, item(layout(e.tree).tendon_velocity + e.local));
      case S::actuator_pos:
        return put(0, item(layout(e.tree).act_length + e.local));
      case S::actuator_vel:
        return put(0, model.actuation ? item(layout(e.tree).act_velocity + e.local) : T(0));  // as MuJoCo
      case S::actuator_force:
        return put(0, item(layout(e.tree).act_force + e.local));
      case S::joint_actuator_force: {
        int const dof = model.jnt_dofadr(e.object), t = model.dof_tree(dof);
        return put(0, l.item(model, dynamics, t, layout(t).actuator + dof - model.tree_dof(t)));
      }
      case S::tendon_actuator_force: {
        Archetype const& a = model.archetypes(model.tree_archetype(e.tree));
        T sum(R(0));
        for (int k = 0; k < a.nact; ++k)
          if (model.ints(a.act_kind + k) == int(ActuatorKind::tendon) && model.ints(a.act_id + k) == e.local)
            sum = sum + item(layout(e.tree).act_force + k);
        return put(0, sum);
      }
      case S::inside_site:
        return put(0, inside_site(l, e));
      case S::subtree_com:
        return put3(l.load3(subtrees.com, e.object));
      case S::subtree_linvel:
        return put3(l.load3(subtrees.linvel, e.object));
      case S::subtree_angmom:
        return put3(l.load3(subtrees.angmom, e.object));
      default:
        return frame_sensor(l, e, put, put3, put_quat);
    }
  }

  /// 1 where the object lies in the site's volume, else 0. Of a body without mass on which others hang, but the world, it is their centre
  /// of mass (MuJoCo).
  template <class T>
  KOKKOS_INLINE_FUNCTION T inside_site(WorldLane<T> const& l, Entry const& e) const {
    Transform<T> const site = pose(l, Entry::site, e.reference);
    Vec3<T> p = frame(l, e.kind, e.object).p;
    if (e.kind == Entry::inertial && e.object > 0) {
      auto const empty = l.constant(model.body_mass, e.object) < T(1e-15) && !(l.load(subtrees.mass, e.object) < T(1e-15));
      p = select(empty, l.load3(subtrees.com, e.object), p);
    }
    Vec3<T> const size{T(site_size(3 * e.reference)), T(site_size(3 * e.reference + 1)), T(site_size(3 * e.reference + 2))};
    return select(inside_volume(ShapeType(site_type(e.reference)), size, rotate_inverse(site.q, p - site.p)), T(1), T(0));
  }
  /// Those that are about one frame, or two.
  template <class T, class Put, class Put3, class PutQuat>
  KOKKOS_INLINE_FUNCTION void frame_sensor(WorldLane<T> const& l, Entry const& e, Put const& put, Put3 const& put3,
                                           PutQuat const& put_quat) const {
    using S = SensorType;
    if (e.type == S::frame_quat) {  // of a camera that tracks or looks at something: as if it did not (MuJoCo)
      Quat<T> const q = pose(l, e.kind, e.object).q;
      return put_quat(e.reference_kind != Entry::none ? conjugate(pose(l, e.reference_kind, e.reference).q) * q : q);
    }
    Frame<T> const own = frame(l, e.kind, e.object), reference = frame(l, e.reference_kind, e.reference);
    auto const seen = [&](Vec3<T> const& x) { return transpose_times(reference.r, x); };
    auto const moving = [&] { return velocity(l, body_of(e.kind, e.object), own.p); };
    auto const relative = [&] {  // as seen from a frame that moves and turns
      Spatial<T> v = moving();
      if (e.reference_kind != Entry::none) {
        Spatial<T> const of = velocity(l, body_of(e.reference_kind, e.reference), reference.p);
        v.linear = v.linear - of.linear - cross(of.angular, own.p - reference.p);
        v.angular = v.angular - of.angular;
      }
      return v;
    };
    switch (e.type) {
      case S::frame_pos:
        return put3(seen(own.p - reference.p));
      case S::frame_xaxis:
        return put3(seen(column(own.r, 0)));
      case S::frame_yaxis:
        return put3(seen(column(own.r, 1)));
      case S::frame_zaxis:
        return put3(seen(column(own.r, 2)));
      case S::frame_linvel:
        return put3(seen(relative().linear));
      case S::frame_angvel:
        return put3(seen(relative().angular));
      case S::velocimeter:
        return put3(transpose_times(own.r, moving().linear));
      case S::gyro:
        return put3(transpose_times(own.r, moving().angular));
      case S::magnetometer:
        return put3(transpose_times(own.r, Vec3<T>{T(magnetic.x), T(magnetic.y), T(magnetic.z)}));
      case S::cam_projection: {  // pixel = c -+ f (x, y) / z of the site in the camera's frame: x right, y down from the top left
        Vec3<T> const x = seen(own.p - reference.p);
        T const z = select(abs(x.z) < T(1e-15), select(x.z < T(0), T(-1e-15), T(1e-15)), x.z);  // beside the camera: far, and finite
        auto const half = [&](int c) { return T(0.5) * l.constant(model.cam_resolution, e.reference, 2, c); };
        auto const focal = [&](int c) { return l.constant(model.cam_focal, e.reference, 2, c); };
        put(0, half(0) - focal(0) * x.x / z);
        put(1, half(1) + focal(1) * x.y / z);
        return;
      }
      default:
        return;
    }
  }
};
}  // namespace detail

/// data (world, nsensordata): the numbers of all sensors of the table, at sensor_adr; what others have there stays as it is.
/// After smooth_dynamics with keep_all, which left `poses` and `dynamics`. Noise is not added. Cost up to 20 flop a dof above a frame.
/// Does not allocate, does not fence. Errors: std::invalid_argument where the dynamics do not hold what these sensors read, of this state
/// as it is now (without keep_all: energies, velocities of tendons, velocities and forces of actuators), or the poses are of before.
template <ExecutionSpace Exec, class R, class Mem, class View>
void smooth_sensors(Exec const& exec, Model<R, Mem> const& model, State<R, Mem> const& state, Poses<R, Mem> const& poses,
                    Dynamics<R, Mem>& dynamics, Sensors<R, Mem>& sensors, View& data) {
  Region const region("gsp::sensor::smooth_sensors");
  detail::expects_sensors("gsp::smooth_sensors", model, sensors, data);
  detail::expects_as_many("gsp::smooth_sensors", "worlds", "make both with the same {.worlds = n}",
                          detail::Count{"dynamics", dynamics.worlds}, detail::Count{"sensors", sensors.worlds});
  detail::expects_fit("gsp::smooth_sensors", model, state, dynamics, poses);
  detail::expects_of("gsp::smooth_sensors", dynamics, state, sensors.needs);
  detail::expects_poses_of("gsp::smooth_sensors", poses, state);
  if (sensors.subtrees.com.data()) subtree_com(exec, model, poses, sensors.subtrees);
  if (sensors.momenta) subtree_momentum(exec, model, poses, dynamics, sensors.subtrees);
  if (sensors.energy.data()) energies(exec, model, state, poses, dynamics, sensors.energy);
  sense(exec,
        detail::SmoothSensors<R, Mem>{{model, poses, sensors.subtrees},
                                      state,
                                      dynamics,
                                      sensors.entries,
                                      sensors.magnetic,
                                      sensors.energy,
                                      sensors.site_type,
                                      sensors.site_size,
                                      sensors.nsensordata},
        data, {.label = "gsp::sensor::smooth_sensors"});
}

}  // namespace gsp
