#pragma once
#include <gsp/core/region.hpp>
#include <gsp/dynamics/energy.hpp>
#include <gsp/dynamics/object_poses.hpp>
#include <gsp/dynamics/subtree.hpp>
#include <gsp/model/archetypes.hpp>
#include <gsp/model/detail/sizes.hpp>
#include <gsp/model/sensor_types.hpp>
#include <gsp/sensor/sense.hpp>

/// MJCF's sensors that are functions of positions, velocities and actuator forces (MuJoCo's mj_sensorPos, mj_sensorVel and part of
/// mj_sensorAcc).
namespace gsp {

/// One sensor. `object`: a world index of what its type is about; of a frame: an item of `kind`. tree, local: of a tendon or actuator.
template <class R>
struct SensorEntry {
  enum Kind : int { none, inertial, body, geom, site, camera };
  SensorType type;
  int adr;
  int object = 0, kind = none, reference = 0, reference_kind = none;
  int tree = 0, local = 0;
  R cutoff = R(0);  // 0: no limit
};

/// The sensors of a model that are evaluated here, and buffers. `make_sensors` allocates it.
template <class R, class Mem>
struct Sensors {
  int worlds = 0, nsensordata = 0;
  detail::ModelSizes model{};  // host: of which model
  Kokkos::View<SensorEntry<R>*, Mem> entries;
  Vec3<R> magnetic;           // flux, in the world frame
  Subtrees<R, Mem> subtrees;  // empty where no sensor asks for them
  bool momenta = false;       // any asks for more than centres of mass
  Kokkos::View<R**, Kokkos::LayoutRight, Mem> energy;
  detail::Quantities needs;   // host: what the dynamics must hold
  std::vector<int> left_out;  // host: indices of the model's sensors that are not: contacts, rays, accelerations, constraints
};

struct SensorsOptions {
  int worlds = 1;
};

namespace detail {
/// What a sensor reads of the dynamics.
inline Quantities needs_of(SensorInfo const& info) {
  switch (info.stage) {
    case SensorStage::energy:
      return set_of(Quantity::mass, Quantity::velocity, Quantity::tendon_length);
    case SensorStage::momentum:
      return set_of(Quantity::motion, Quantity::velocity);
    case SensorStage::actuation:
      return set_of(Quantity::actuator);
    case SensorStage::velocity:
      if (info.type == SensorType::tendon_pos) return set_of(Quantity::tendon_length, Quantity::velocity);
      if (info.type == SensorType::tendon_vel) return set_of(Quantity::tendon_velocity);
      if (info.type == SensorType::actuator_pos) return set_of(Quantity::act_length);
      if (info.type == SensorType::actuator_vel) return set_of(Quantity::actuator);
      return set_of(Quantity::motion, Quantity::velocity);
    default:
      return {};  // of the state and the poses
  }
}
/// What a frame stands on, by MJCF's word: SensorEntry::Kind.
template <class R>
int frame_kind(std::string_view word) {
  using Entry = SensorEntry<R>;
  if (word == "body") return Entry::inertial;
  if (word == "xbody") return Entry::body;
  if (word == "geom") return Entry::geom;
  if (word == "site") return Entry::site;
  if (word == "camera") return Entry::camera;
  return Entry::none;
}
}  // namespace detail

/// The sensors of `compiled`, of which `model` was made, for `worlds` worlds. Allocates.
template <class R, ExecutionSpace Exec, class Mem>
Sensors<R, Mem> make_sensors(Exec const& exec, Model<R, Mem> const& model, CompiledModel const& compiled, SensorsOptions options = {}) {
  expects(options.worlds > 0, "gsp::make_sensors: worlds must be positive and is " + std::to_string(options.worlds));
  detail::expects_made_of("gsp::make_sensors", model, compiled);
  using Entry = SensorEntry<R>;
  Sensors<R, Mem> s;
  s.worlds = options.worlds;
  s.model = detail::sizes_of(model);
  s.nsensordata = compiled.nsensordata;
  auto const& flux = compiled.option.magnetic;
  s.magnetic = {R(flux[0]), R(flux[1]), R(flux[2])};
  auto const trees = find_archetypes(compiled);
  auto const locate = [&](int id, auto const list, Entry& e) {  // the tree that holds a tendon or an actuator, and its place there
    for (auto const& t : trees)
      for (auto const& instance : t.instances)
        for (int k = 0; k < int((instance.*list).size()); ++k)
          if ((instance.*list)[k] == id) {
            e.tree = instance.tree;
            e.local = k;
            return true;
          }
    return false;
  };
  auto const by_com = [&](int kind, int i) {  // a camera whose frame follows from a subtree's centre of mass
    if (kind != Entry::camera) return false;
    auto const mode = CameraMode(compiled.cam_mode[i]);
    return mode == CameraMode::track_com || mode == CameraMode::target_body_com;
  };
  bool subtrees = false, energy = false;
  std::vector<Entry> entries;
  for (int i = 0; i < compiled.nsensor; ++i) {
    auto const& d = compiled.sensors[i];
    SensorInfo const* const info = find_sensor_type(d.type);
    if (!info || !detail::is_smooth(info->stage)) {
      s.left_out.push_back(i);
      continue;
    }
    Entry e{};
    e.type = info->type;
    e.adr = compiled.sensor_adr[i];
    e.object = compiled.sensor_id[i];
    e.reference = compiled.sensor_refid[i];
    e.cutoff = info->cutoff == SensorCutoff::both_sides ? R(d.cutoff) : R(0);
    bool known = true;
    if (info->about == SensorObject::site || info->about == SensorObject::frame || info->about == SensorObject::projection) {
      e.kind = detail::frame_kind<R>(d.object_type);
      if (e.reference >= 0) e.reference_kind = detail::frame_kind<R>(d.reference_type);
      known = e.kind != Entry::none && (e.reference < 0 || e.reference_kind != Entry::none);
    }
    if (info->about == SensorObject::tendon) known = locate(e.object, &ArchetypeDescription::Instance::tendon, e);
    if (info->about == SensorObject::actuator) known = locate(e.object, &ArchetypeDescription::Instance::act, e);
    if (!known) {
      s.left_out.push_back(i);
      continue;
    }
    s.momenta |= info->stage == SensorStage::momentum;
    subtrees |= info->stage == SensorStage::subtree || info->stage == SensorStage::momentum;
    subtrees |= by_com(e.kind, e.object) || by_com(e.reference_kind, e.reference);
    energy |= info->stage == SensorStage::energy;
    s.needs = s.needs | detail::needs_of(*info);
    entries.push_back(e);
  }
  s.entries = detail::to_device<Kokkos::View<Entry*, Mem>>(exec, "gsp::Sensors::entries", entries);
  if (subtrees) s.subtrees = make_subtrees(exec, model, {.worlds = options.worlds});
  if (energy)
    s.energy = detail::allocate_zero<Kokkos::View<R**, Kokkos::LayoutRight, Mem>>(exec, "gsp::Sensors::energy", options.worlds, 2);
  return s;
}

namespace detail {
/// MJCF's smooth sensors as a SensorKind.
template <class R, class Mem>
struct SmoothSensors {
  Model<R, Mem> model;
  State<R, Mem> state;
  Poses<R, Mem> poses;
  Dynamics<R, Mem> dynamics;
  Kokkos::View<SensorEntry<R>*, Mem> entries;
  Vec3<R> magnetic;
  Subtrees<R, Mem> subtrees;
  Kokkos::View<R**, Kokkos::LayoutRight, Mem> energy;
  int nsensordata;

  using Entry = SensorEntry<R>;
  int count() const { return int(entries.extent(0)); }
  KOKKOS_INLINE_FUNCTION int size() const { return 4; }  // at most
  KOKKOS_INLINE_FUNCTION int adr(int i) const { return entries(i).adr; }
  int columns() const { return nsensordata; }
  template <class T>
  KOKKOS_INLINE_FUNCTION T limit(int i, T const& x) const {
    R const cutoff = entries(i).cutoff;
    return cutoff > R(0) ? clamp(x, T(-cutoff), T(cutoff)) : x;
  }

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
        T const z = select(abs(x.z) < T(1e-15), clamp(x.z, T(-1e-15), T(1e-15)), x.z);
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
  expects(int(data.extent(0)) == sensors.worlds && int(data.extent(1)) == sensors.nsensordata,
          "gsp::smooth_sensors: data is (" + std::to_string(data.extent(0)) + ", " + std::to_string(data.extent(1)) +
              ") and must be (worlds, nsensordata), here (" + std::to_string(sensors.worlds) + ", " + std::to_string(sensors.nsensordata) +
              ")");
  expects(sensors.model == detail::sizes_of(model), "gsp::smooth_sensors: the sensors were made for another model: make_sensors with this");
  detail::expects_as_many("gsp::smooth_sensors", "worlds", "make both with the same {.worlds = n}",
                          detail::Count{"dynamics", dynamics.worlds}, detail::Count{"sensors", sensors.worlds});
  detail::expects_fit("gsp::smooth_sensors", model, state, dynamics, poses);
  detail::expects_of("gsp::smooth_sensors", dynamics, state, sensors.needs);
  detail::expects_poses_of("gsp::smooth_sensors", poses, state);
  if (sensors.subtrees.com.data()) subtree_com(exec, model, poses, sensors.subtrees);
  if (sensors.momenta) subtree_momentum(exec, model, poses, dynamics, sensors.subtrees);
  if (sensors.energy.data()) energies(exec, model, state, poses, dynamics, sensors.energy);
  sense(exec,
        detail::SmoothSensors<R, Mem>{model, state, poses, dynamics, sensors.entries, sensors.magnetic, sensors.subtrees, sensors.energy,
                                      sensors.nsensordata},
        data, {.label = "gsp::sensor::smooth_sensors"});
}

}  // namespace gsp
