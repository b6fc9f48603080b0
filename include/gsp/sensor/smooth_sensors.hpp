#pragma once
#include <gsp/dynamics/energy.hpp>
#include <gsp/dynamics/object_poses.hpp>
#include <gsp/dynamics/subtree.hpp>
#include <gsp/model/archetypes.hpp>
#include <map>

/// MJCF's sensors that are functions of positions, velocities and actuator forces (MuJoCo's mj_sensorPos, mj_sensorVel and part of
/// mj_sensorAcc).
namespace gsp {

enum class SensorType : int {
  clock,
  potential_energy,
  kinetic_energy,
  joint_pos,
  joint_vel,
  ball_quat,
  ball_angvel,
  tendon_pos,
  tendon_vel,
  actuator_pos,
  actuator_vel,
  actuator_force,
  joint_actuator_force,
  tendon_actuator_force,
  frame_pos,
  frame_quat,
  frame_xaxis,
  frame_yaxis,
  frame_zaxis,
  frame_linvel,
  frame_angvel,
  velocimeter,
  gyro,
  magnetometer,
  cam_projection,
  subtree_com,
  subtree_linvel,
  subtree_angmom
};

/// One sensor. `object`: a world index of what its type is about; of a frame: an item of `kind`. tree, local: of a tendon or actuator.
template <class R>
struct SensorEntry {
  enum Kind : int { none, inertial, body, geom, site, camera };
  SensorType type;
  int adr;
  int object = 0, kind = none, reference = 0, reference_kind = none;
  int tree = 0, local = 0;
  R cutoff = R(0);  // numbers stay within -cutoff .. cutoff; 0: no limit
};

/// Table of the sensors that are evaluated here, and buffers. `make_sensors` allocates it.
template <class R, class Mem>
struct Sensors {
  int worlds = 0, nsensordata = 0;
  Kokkos::View<SensorEntry<R>*, Mem> entries;
  Vec3<R> magnetic;           // flux, in the world frame
  Subtrees<R, Mem> subtrees;  // empty where no sensor asks for them
  bool momenta = false;       // any asks for more than centres of mass
  Kokkos::View<R**, Kokkos::LayoutRight, Mem> energy;
  std::vector<int> left_out;  // host: indices of the model's sensors that are not: contacts, rays, accelerations, constraints
};

struct SensorsOptions {
  int worlds = 1;
};

/// The sensors of `compiled`, of which `model` was made, for `worlds` worlds. Allocates.
template <class R, ExecutionSpace Exec, class Mem>
Sensors<R, Mem> make_sensors(Exec const& exec, Model<R, Mem> const& model, CompiledModel const& compiled, SensorsOptions options = {}) {
  expects(options.worlds > 0, "gsp::make_sensors: worlds must be positive");
  using Entry = SensorEntry<R>;
  using S = SensorType;
  static std::map<std::string, S> const types{{"clock", S::clock},
                                              {"e_potential", S::potential_energy},
                                              {"e_kinetic", S::kinetic_energy},
                                              {"jointpos", S::joint_pos},
                                              {"jointvel", S::joint_vel},
                                              {"ballquat", S::ball_quat},
                                              {"ballangvel", S::ball_angvel},
                                              {"tendonpos", S::tendon_pos},
                                              {"tendonvel", S::tendon_vel},
                                              {"actuatorpos", S::actuator_pos},
                                              {"actuatorvel", S::actuator_vel},
                                              {"actuatorfrc", S::actuator_force},
                                              {"jointactuatorfrc", S::joint_actuator_force},
                                              {"tendonactuatorfrc", S::tendon_actuator_force},
                                              {"framepos", S::frame_pos},
                                              {"framequat", S::frame_quat},
                                              {"framexaxis", S::frame_xaxis},
                                              {"frameyaxis", S::frame_yaxis},
                                              {"framezaxis", S::frame_zaxis},
                                              {"framelinvel", S::frame_linvel},
                                              {"frameangvel", S::frame_angvel},
                                              {"velocimeter", S::velocimeter},
                                              {"gyro", S::gyro},
                                              {"magnetometer", S::magnetometer},
                                              {"camprojection", S::cam_projection},
                                              {"subtreecom", S::subtree_com},
                                              {"subtreelinvel", S::subtree_linvel},
                                              {"subtreeangmom", S::subtree_angmom}};
  static std::map<std::string, int> const kinds{
      {"body", Entry::inertial}, {"xbody", Entry::body}, {"geom", Entry::geom}, {"site", Entry::site}, {"camera", Entry::camera}};
  Sensors<R, Mem> s;
  s.worlds = options.worlds, s.nsensordata = compiled.nsensordata;
  auto const& flux = compiled.option.magnetic;
  s.magnetic = {R(flux[0]), R(flux[1]), R(flux[2])};
  auto const trees = find_archetypes(compiled);
  auto const locate = [&](int id, auto const list, Entry& e) {  // the tree that holds a tendon or an actuator, and its place there
    for (auto const& t : trees)
      for (auto const& instance : t.instances)
        for (int k = 0; k < int((instance.*list).size()); ++k)
          if ((instance.*list)[k] == id) {
            e.tree = instance.tree, e.local = k;
            return true;
          }
    return false;
  };
  bool subtrees = false, energy = false;
  std::vector<Entry> entries;
  for (int i = 0; i < compiled.nsensor; ++i) {
    auto const& d = compiled.sensors[i];
    auto const type = types.find(d.type);
    bool known = type != types.end();
    Entry e{};
    if (known) {
      e.type = type->second, e.adr = compiled.sensor_adr[i], e.object = compiled.sensor_id[i], e.reference = compiled.sensor_refid[i];
      e.cutoff = R(d.cutoff);
      auto const kind = kinds.find(d.object_type), reference = kinds.find(d.reference_type);
      if (e.type >= S::frame_pos && e.type <= S::cam_projection) {
        known = kind != kinds.end() && (e.reference < 0 || reference != kinds.end());
        if (known) e.kind = kind->second, e.reference_kind = e.reference < 0 ? int(Entry::none) : reference->second;
      }
      if (e.type == S::tendon_pos || e.type == S::tendon_vel || e.type == S::tendon_actuator_force)
        known = locate(e.object, &ArchetypeDescription::Instance::tendon, e);
      if (e.type == S::actuator_pos || e.type == S::actuator_vel || e.type == S::actuator_force)
        known = locate(e.object, &ArchetypeDescription::Instance::act, e);
      auto const by_com = [&](int of, int i) {
        return of == Entry::camera && (CameraMode(compiled.cam_mode[i]) == CameraMode::track_com ||
                                       CameraMode(compiled.cam_mode[i]) == CameraMode::target_body_com);
      };
      subtrees |= e.type >= S::subtree_com || by_com(e.kind, e.object) || by_com(e.reference_kind, e.reference);
      s.momenta |= e.type == S::subtree_linvel || e.type == S::subtree_angmom;
      energy |= e.type == S::potential_energy || e.type == S::kinetic_energy;
    }
    if (known)
      entries.push_back(e);
    else
      s.left_out.push_back(i);
  }
  s.entries = detail::to_device<Kokkos::View<Entry*, Mem>>(exec, "gsp::Sensors::entries", entries);
  if (subtrees) s.subtrees = make_subtrees(exec, model, {.worlds = options.worlds});
  if (energy)
    s.energy = detail::allocate_zero<Kokkos::View<R**, Kokkos::LayoutRight, Mem>>(exec, "gsp::Sensors::energy", options.worlds, 2);
  return s;
}

namespace detail {
template <class R, class Mem, class View>
struct SmoothSensors {
  Model<R, Mem> model;
  State<R, Mem> state;
  Poses<R, Mem> poses;
  Dynamics<R, Mem> dynamics;
  Kokkos::View<SensorEntry<R>*, Mem> entries;
  Vec3<R> magnetic;
  Subtrees<R, Mem> subtrees;
  Kokkos::View<R**, Kokkos::LayoutRight, Mem> energy;
  View data;

  using Entry = SensorEntry<R>;
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
  /// Velocity of the point x of body b, in world axes.
  template <class T>
  KOKKOS_INLINE_FUNCTION Spatial<T> velocity(WorldLane<T> const& l, int b, Vec3<T> const& x) const {
    Vec3<T> const zero{T(0), T(0), T(0)};
    Spatial<T> v{zero, zero};
    int const last = model.body_last_dof(b);
    if (last < 0) return v;
    int const t = model.dof_tree(last), dof0 = model.tree_dof(t);
    Archetype const& a = model.archetypes(model.tree_archetype(t));
    DynamicsLayout const at(a);
    auto const get = [&](int i) { return l.item(model, dynamics, t, i); };
    auto const get3 = [&](int i) { return Vec3<T>{get(i), get(i + 1), get(i + 2)}; };
    for (int e = model.ints(a.row_adr + last - dof0), end = model.ints(a.row_adr + last - dof0 + 1); e < end; ++e) {
      int const dof = model.ints(a.row_col + e);
      v = fma(get(at.qvel + dof), Spatial<T>{get3(at.cdof + 6 * dof), get3(at.cdof + 6 * dof + 3)}, v);
    }
    v.linear = v.linear + cross(v.angular, x - get3(at.com + 3 * model.body_root(b)));
    return v;
  }
  template <class T>
  KOKKOS_FUNCTION void operator()(WorldLane<T> const& l, int i) const {
    using S = SensorType;
    Entry const e = entries(i);
    auto const put = [&](int c, T const& x) { l.store(data, e.adr + c, e.cutoff > R(0) ? clamp(x, T(-e.cutoff), T(e.cutoff)) : x); };
    auto const put3 = [&](Vec3<T> const& x) { put(0, x.x), put(1, x.y), put(2, x.z); };
    auto const put_axis = [&](Vec3<T> const& x) {  // directions and rotations have no cutoff
      for (int c = 0; c < 3; ++c) l.store(data, e.adr + c, x[c]);
    };
    auto const put_quat = [&](Quat<T> const& q) {
      l.store(data, e.adr, q.w), l.store(data, e.adr + 1, q.x), l.store(data, e.adr + 2, q.y), l.store(data, e.adr + 3, q.z);
    };
    auto const item = [&](int at) { return l.item(model, dynamics, e.tree, at); };
    auto const layout = [&](int tree) { return DynamicsLayout(model.archetypes(model.tree_archetype(tree))); };
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
        return put(0, l.load(state.qpos, model.jnt_qposadr(e.object)));
      case S::joint_vel:
        return put(0, l.load(state.qvel, model.jnt_dofadr(e.object)));
      case S::ball_quat: {
        int const q = model.jnt_qposadr(e.object);
        return put_quat(
            normalized(Quat<T>{l.load(state.qpos, q), l.load(state.qpos, q + 1), l.load(state.qpos, q + 2), l.load(state.qpos, q + 3)}));
      }
      case S::ball_angvel: {
        int const v = model.jnt_dofadr(e.object);
        return put3({l.load(state.qvel, v), l.load(state.qvel, v + 1), l.load(state.qvel, v + 2)});
      }
      case S::tendon_pos:
        return put(0, item(layout(e.tree).tendon_length + e.local));
      case S::tendon_vel:
        return put(0, item(layout(e.tree).tendon_velocity + e.local));
      case S::actuator_pos:
        return put(0, item(layout(e.tree).act_length + e.local));
      case S::actuator_vel:
        return put(0, item(layout(e.tree).act_velocity + e.local));
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
      case S::subtree_com:
        return put3(l.load3(subtrees.com, e.object));
      case S::subtree_linvel:
        return put3(l.load3(subtrees.linvel, e.object));
      case S::subtree_angmom:
        return put3(l.load3(subtrees.angmom, e.object));
      default:
        break;
    }
    if (e.type == S::frame_quat) {  // of a camera that tracks or looks at something: as if it did not (MuJoCo)
      Quat<T> const q = pose(l, e.kind, e.object).q;
      return put_quat(e.reference_kind != Entry::none ? conjugate(pose(l, e.reference_kind, e.reference).q) * q : q);
    }
    Frame<T> const own = frame(l, e.kind, e.object), reference = frame(l, e.reference_kind, e.reference);
    auto const seen = [&](Vec3<T> const& x) { return transpose_times(reference.r, x); };
    if (e.type == S::cam_projection) {  // pixel = c -+ f (x, y) / z of the site in the camera's frame: x right, y down from the top left
      Vec3<T> const x = seen(own.p - reference.p);
      T const z = select(abs(x.z) < T(1e-15), clamp(x.z, T(-1e-15), T(1e-15)), x.z);
      auto const half = [&](int c) { return T(0.5) * l.constant(model.cam_resolution, e.reference, 2, c); };
      auto const focal = [&](int c) { return l.constant(model.cam_focal, e.reference, 2, c); };
      return put(0, half(0) - focal(0) * x.x / z), put(1, half(1) + focal(1) * x.y / z);
    }
    if (e.type == S::frame_pos) return put3(seen(own.p - reference.p));
    if (e.type >= S::frame_xaxis && e.type <= S::frame_zaxis) return put_axis(seen(column(own.r, int(e.type) - int(S::frame_xaxis))));
    if (e.type == S::magnetometer) return put3(transpose_times(own.r, Vec3<T>{T(magnetic.x), T(magnetic.y), T(magnetic.z)}));
    Spatial<T> v = velocity(l, body_of(e.kind, e.object), own.p);
    if (e.type == S::velocimeter) return put3(transpose_times(own.r, v.linear));
    if (e.type == S::gyro) return put3(transpose_times(own.r, v.angular));
    if (e.reference_kind != Entry::none) {  // as seen from a frame that moves and turns
      Spatial<T> const of = velocity(l, body_of(e.reference_kind, e.reference), reference.p);
      v.linear = v.linear - of.linear - cross(of.angular, own.p - reference.p), v.angular = v.angular - of.angular;
    }
    put3(seen(e.type == S::frame_linvel ? v.linear : v.angular));
  }
};
}  // namespace detail

/// data (world, nsensordata): the numbers of all sensors of the table, at sensor_adr; what others have there stays as it is.
/// After smooth_dynamics with keep_all, which left `poses` and `dynamics`. Noise is not added. Cost up to 20 flop a dof above a frame.
/// Does not allocate, does not fence.
template <ExecutionSpace Exec, class R, class Mem, class View>
void smooth_sensors(Exec const& exec, Model<R, Mem> const& model, State<R, Mem> const& state, Poses<R, Mem> const& poses,
                    Dynamics<R, Mem> const& dynamics, Sensors<R, Mem> const& sensors, View const& data) {
  expects(int(data.extent(0)) == sensors.worlds && int(data.extent(1)) == sensors.nsensordata,
          "gsp::smooth_sensors: data must be (worlds, nsensordata)");
  expects(dynamics.worlds == sensors.worlds, "gsp::smooth_sensors: dynamics and sensors have different numbers of worlds");
  if (sensors.subtrees.com.data()) subtree_com(exec, model, poses, sensors.subtrees);
  if (sensors.momenta) subtree_momentum(exec, model, poses, dynamics, sensors.subtrees);
  if (sensors.energy.data()) energies(exec, model, state, poses, dynamics, sensors.energy);
  detail::for_world_lanes("gsp::sensor::smooth_sensors", exec, R(), sensors.worlds, int(sensors.entries.extent(0)),
                          detail::SmoothSensors<R, Mem, View>{model, state, poses, dynamics, sensors.entries, sensors.magnetic,
                                                              sensors.subtrees, sensors.energy, data});
}

}  // namespace gsp
