#pragma once
#include <gsp/collision/shape_assets.hpp>
#include <gsp/dynamics/energy.hpp>
#include <gsp/dynamics/object_poses.hpp>
#include <gsp/dynamics/subtree.hpp>
#include <gsp/model/archetypes.hpp>
#include <gsp/model/contact_sensor.hpp>
#include <gsp/model/detail/sizes.hpp>
#include <gsp/model/range_sensor.hpp>
#include <gsp/model/sensor_types.hpp>
#include <gsp/ray/ray_scene.hpp>
#include <gsp/sensor/accelerations.hpp>
#include <gsp/sensor/sensor_history.hpp>

/// The sensors of a model, sorted by the stage that they need: what smooth_sensors, constraint_sensors, range_sensors, distance_sensors and
/// acceleration_sensors evaluate.
namespace gsp {

/// One sensor. `object`: a world index of what its type is about; of a frame: an item of `kind`; of limits: the place in the model's list
/// of limited joints or tendons, -1: its limits do not act. tree, local: of a tendon or actuator.
template <class R>
struct SensorEntry {
  enum Kind : int { none, inertial, body, geom, site, camera };
  SensorType type;
  int adr;
  int object = 0, kind = none, reference = 0, reference_kind = none;
  int tree = 0, local = 0;
  R cutoff = R(0);     // 0: no limit
  bool above = false;  // it cuts what lies above alone
};

/// A <contact> sensor: which contacts it takes, on either side, and what it says of them.
struct ContactSensorEntry {
  enum Side : int { any, geom, body, subtree, site };  // site: a volume that the contact's point lies in
  int adr = 0;
  int side[2] = {any, any}, id[2] = {-1, -1};
  int end[2] = {0, 0};      // geom: behind it and its convex parts
  int slots = 1, size = 1;  // size: numbers of a slot
  ContactReduce reduce = ContactReduce::none;
  unsigned fields = 1;
  KOKKOS_INLINE_FUNCTION bool has(ContactField field) const { return (fields >> int(field)) & 1u; }
};

/// A rangefinder of a site or of a camera's pixels, and which of a ray's numbers it says.
template <class R>
struct RangeSensorEntry {
  int adr = 0, site = 0;
  unsigned fields = 1;
  R cutoff = R(0);  // 0: no limit
  int size = 1;     // numbers of a ray
  // of a camera
  int camera = -1, width = 1, height = 1;  // [pixel]
  R cx = R(0), cy = R(0);                  // where its axis meets the picture, from the top left [pixel]
  bool by_com = false;                     // its frame follows from a subtree's centre of mass
  KOKKOS_INLINE_FUNCTION bool has(RangeField field) const { return (fields >> int(field)) & 1u; }
};

/// A sensor of the distance between two bodies or geoms: of all pairs of the geoms first[0] ... end[0] - 1 with first[1] ... end[1] - 1 of
/// Sensors::distance_geoms.
template <class R>
struct DistanceSensorEntry {
  SensorType type;
  int adr = 0;
  int first[2] = {0, 0}, end[2] = {0, 0};
  R cutoff = R(0);  // what is farther is not seen; 0: overlaps alone
};
template <class R>
struct DistanceGeom {
  ShapeType type;
  int geom, body;
  Vec3<R> size;  // [m]
  ShapeAsset<R> const* asset;
};

/// The sensors of a model that are evaluated here, and buffers. `make_sensors` allocates it.
template <class R, class Mem>
struct Sensors {
  int worlds = 0, nsensordata = 0;
  detail::ModelSizes model{};                  // host: of which model
  Kokkos::View<SensorEntry<R>*, Mem> entries;  // of the smooth state
  Kokkos::View<SensorEntry<R>*, Mem> touches;  // of the forces of contacts
  Kokkos::View<ContactSensorEntry*, Mem> contacts;
  Kokkos::View<SensorEntry<R>*, Mem> adhesions;    // velocities of adhesion actuators: object is their body
  Kokkos::View<SensorEntry<R>*, Mem> limits;       // of joints and tendons
  Kokkos::View<SensorEntry<R>*, Mem> accelerated;  // of accelerations, and of forces between bodies
  Kokkos::View<RangeSensorEntry<R>*, Mem> ranges;  // rays from sites
  std::vector<RangeSensorEntry<R>> range_cameras;  // host: rays through cameras' pixels
  RayScene<R, Mem> scene;                          // what they may meet; empty where there are none
  Kokkos::View<DistanceSensorEntry<R>*, Mem> distances;
  Kokkos::View<DistanceGeom<R>*, Mem> distance_geoms;
  ShapeAssets<R, Mem> distance_assets;       // hulls of their meshes
  Kokkos::View<SensorEntry<R>*, Mem> users;  // `user`: adr + local numbers, which are yours to write
  Kokkos::View<int*, Mem> site_type;         // (nsite) ShapeType of their volumes
  Kokkos::View<R*, Mem> site_size;           // (3 nsite) [m]
  Vec3<R> magnetic;                          // flux, in the world frame
  Subtrees<R, Mem> subtrees;                 // empty where no sensor asks for them
  bool momenta = false;                      // any asks for more than centres of mass
  Kokkos::View<R**, Kokkos::LayoutRight, Mem> energy;
  Accelerations<R, Mem> accelerations;  // empty where no sensor asks for them; of bodies where one asks for forces
  SensorHistory<R, Mem> history;        // of those that speak late; empty where none does
  detail::Quantities needs;             // host: what the dynamics must hold for those of the smooth state
  std::vector<int> left_out;            // host: indices of the model's sensors that are not evaluated: tactile, user, or not in this model
  std::vector<std::string> why;         // host: a sentence for each of them
};

struct SensorsOptions {
  int worlds = 1;
  double timestep = 0;  // [s] of the steps, for sensors that keep samples; 0: the model's, as far as its precision has it
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
inline ContactSensorEntry contact_entry(CompiledModel const& m, SensorDescription const& d, int id1, int id2) {
  ContactSensorSettings const settings = contact_settings(d);
  ContactSensorEntry e;
  auto const side = [](std::string const& word) {
    using S = ContactSensorEntry;
    return word == "geom" ? S::geom : word == "subtree" ? S::subtree : word == "site" ? S::site : S::body;
  };
  if (id1 >= 0) e.side[0] = side(d.object_type);
  if (id2 >= 0) e.side[1] = side(d.reference_type);
  e.id[0] = id1;
  e.id[1] = id2;
  for (int k = 0; k < 2; ++k)
    if (e.side[k] == ContactSensorEntry::geom) e.end[k] = e.id[k] + 1 + (m.geom_parts.empty() ? 0 : m.geom_parts[std::size_t(e.id[k])]);
  e.slots = settings.slots;
  e.size = settings.size();
  e.reduce = settings.reduce;
  e.fields = settings.fields;
  return e;
}
/// Where an item stands in the list of those with limits, as make_model has it; -1: limits are switched off.
inline int place_among_limited(CompiledModel const& m, std::vector<int> const& limited, int id) {
  if (!m.option.limit || !m.option.constraint) return -1;
  return int(std::count_if(limited.begin(), limited.begin() + id, [](int l) { return l != 0; }));
}
template <class R>
RangeSensorEntry<R> range_entry(CompiledModel const& m, SensorDescription const& d, int adr, int object) {
  RangeSensorEntry<R> e{adr, object, range_settings(d).fields, R(d.cutoff)};
  e.size = 0;
  for (int k = 0; k < 6; ++k) e.size += e.has(RangeField(k)) ? range_sensor_fields[k].size : 0;
  if (d.object_type != "camera") return e;
  e.camera = object;
  auto const &picture = m.cam_resolution[object], &size = m.cam_sensor_size[object], &principal = m.cam_principal[object];
  e.width = int(picture[0]);
  e.height = int(picture[1]);
  bool const sized = size[0] > 0 && size[1] > 0;  // MuJoCo counts the principal point from the corner here, from the middle in pictures
  auto const centre = [&](int k) {
    return sized ? float(principal[k]) / float(size[k]) * float(picture[k]) : picture[k] / 2;
  };  // (in float)
  e.cx = R(centre(0));
  e.cy = R(centre(1));
  auto const mode = CameraMode(m.cam_mode[object]);
  e.by_com = mode == CameraMode::track_com || mode == CameraMode::target_body_com;
  return e;
}
/// Why a sensor that is evaluated in other models is not in this one; or empty.
inline std::string not_in_this_model(CompiledModel const& m, Profile profile, SensorType type, int object) {
  bool spatial = false, heavy = false, adhesive = false, stands = false;
  for (std::size_t t = 0; t < m.tendon_wrapnum.size(); ++t) {
    if (m.tendon_wrapnum[t] == 0) continue;
    spatial = true;
    heavy = heavy || m.tendon_armature[t] > 0;
    for (int k = m.tendon_wrapadr[t]; k < m.tendon_wrapadr[t] + m.tendon_wrapnum[t]; ++k) {
      bool const site = WrapType(m.wrap_type[k]) == WrapType::site;
      int const body = m.wrap_id[k] < 0 ? 0 : site ? m.site_body[m.wrap_id[k]] : m.geom_body[m.wrap_id[k]];
      stands = stands || (body > 0 && m.body_tree[body] < 0);
    }
  }
  for (int a = 0; a < int(m.act_target.size()); ++a) adhesive = adhesive || Transmission(m.act_target[a]) == Transmission::body;
  if ((type == SensorType::force || type == SensorType::torque) && spatial) {
    if (profile == Profile::stable) return "what spatial tendons pull at bodies within a step is not known in profile stable";
    if (heavy) return "what spatial tendons with armature pull at bodies is not known here";
    if (stands && m.body_tree[m.site_body[object]] < 0)
      return "what spatial tendons pull at bodies that no joint moves is not counted here";
  }
  if (type == SensorType::joint_actuator_force && adhesive) return "what adhesion actuators press with does not reach joints here";
  return "";
}
/// Why the library leaves a sensor to others.
inline std::string why_left_out(SensorDescription const& d, SensorInfo const* info, int index) {
  std::string const name = "sensor " + std::to_string(index) + " '" + d.name + "' (" + d.type + ") ";
  if (info && info->stage == SensorStage::outside)
    return name + "is yours to compute: write its numbers with gsp::sense, then call limit_user_sensors for its cutoff";
  if (info && info->stage == SensorStage::field)
    return name + "is not evaluated: it needs signed distance fields of shapes, which there are none of";
  if (info && info->stage == SensorStage::shape)
    return name + "is not evaluated: one of its bodies has a height field, which has no distance: name geoms";
  return name + "is not evaluated: what it names is of a kind that has no frame here";
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
  bool subtrees = false, energy = false, volumes = false;
  std::vector<Entry> entries, touches, adhesions, limits, accelerated, users;
  std::vector<ContactSensorEntry> contacts;
  std::vector<RangeSensorEntry<R>> ranges;
  std::vector<DistanceSensorEntry<R>> distances;
  std::vector<int> distance_geoms;
  for (int i = 0; i < compiled.nsensor; ++i) {
    auto const& d = compiled.sensors[i];
    SensorInfo const* const info = find_sensor_type(d.type);
    auto const leave_out = [&] {
      s.left_out.push_back(i);
      s.why.push_back(detail::why_left_out(d, info, i));
    };
    Entry e{};
    e.adr = compiled.sensor_adr[i];
    e.object = compiled.sensor_id[i];
    e.reference = compiled.sensor_refid[i];
    if (info) {
      e.type = info->type;
      e.above = info->cutoff == SensorCutoff::above;
      e.cutoff = info->cutoff == SensorCutoff::both_sides || e.above ? R(d.cutoff) : R(0);
    }
    if (info && info->stage == SensorStage::outside) {
      for (auto const& [key, value] : d.settings)
        if (key == "datatype") e.above = value == "positive";
      e.local = compiled.sensor_dim[i];
      if (e.local > 0 && e.cutoff > R(0)) users.push_back(e);
    }
    if (!info || !detail::is_evaluated(info->stage)) {
      leave_out();
      continue;
    }
    if (auto const fault = detail::not_in_this_model(compiled, model.profile, info->type, e.object); !fault.empty()) {
      s.left_out.push_back(i);
      s.why.push_back("sensor " + std::to_string(i) + " '" + d.name + "' (" + d.type + ") is not evaluated: " + fault);
      continue;
    }
    if (info->type == SensorType::rangefinder) {
      auto const range = detail::range_entry<R>(compiled, d, e.adr, e.object);
      (range.camera >= 0 ? s.range_cameras : ranges).push_back(range);
      subtrees |= range.by_com;
      continue;
    }
    if (info->type == SensorType::actuator_vel && Transmission(compiled.act_target[e.object]) == Transmission::body) {
      e.object = compiled.act_id[e.object];
      adhesions.push_back(e);
      continue;
    }
    if (info->stage == SensorStage::shape) {
      DistanceSensorEntry<R> distance{info->type, e.adr};
      distance.cutoff = R(d.cutoff);
      bool has_field = false;
      for (int side = 0; side < 2; ++side) {
        int const id = side == 0 ? e.object : e.reference;
        bool const of_body = (side == 0 ? d.object_type : d.reference_type) != "geom";
        int const first = of_body ? compiled.body_geomadr[id] : id, count = of_body ? compiled.body_geomnum[id] : 1;
        distance.first[side] = int(distance_geoms.size());
        for (int g = first; g < first + count; ++g) {
          distance_geoms.push_back(g);
          has_field |= ShapeType(compiled.geom_type[g]) == ShapeType::hfield;
        }
        distance.end[side] = int(distance_geoms.size());
      }
      if (has_field)
        leave_out();
      else
        distances.push_back(distance);
      continue;
    }
    if (info->type == SensorType::contact) {
      ContactSensorEntry c = detail::contact_entry(compiled, d, e.object, e.reference);
      c.adr = e.adr;
      volumes |= c.side[0] == ContactSensorEntry::site;
      contacts.push_back(c);
      continue;
    }
    bool known = true;
    if (info->about == SensorObject::site || info->about == SensorObject::frame || info->about == SensorObject::projection ||
        info->type == SensorType::inside_site) {
      e.kind = detail::frame_kind<R>(d.object_type);
      if (e.reference >= 0) e.reference_kind = detail::frame_kind<R>(d.reference_type);
      known = e.kind != Entry::none && (e.reference < 0 || e.reference_kind != Entry::none);
    }
    if (info->type == SensorType::inside_site) known = known && e.reference_kind == Entry::site;
    bool const of_limits = info->stage == SensorStage::constraint && info->type != SensorType::touch;
    if (of_limits) {
      bool const joint = info->about == SensorObject::joint;
      e.object = detail::place_among_limited(compiled, joint ? compiled.jnt_limited : compiled.tendon_limited, e.object);
    } else if (info->about == SensorObject::tendon) {
      known = locate(e.object, &ArchetypeDescription::Instance::tendon, e);
    }
    if (info->about == SensorObject::actuator) known = locate(e.object, &ArchetypeDescription::Instance::act, e);
    if (!known) {
      leave_out();
      continue;
    }
    subtrees |= by_com(e.kind, e.object) || by_com(e.reference_kind, e.reference);
    volumes |= info->type == SensorType::touch || info->type == SensorType::inside_site;
    if (info->stage == SensorStage::acceleration) {
      accelerated.push_back(e);
    } else if (info->stage == SensorStage::constraint) {
      (of_limits ? limits : touches).push_back(e);
    } else {
      s.momenta |= info->stage == SensorStage::momentum;
      subtrees |= info->stage == SensorStage::subtree || info->stage == SensorStage::momentum;
      energy |= info->stage == SensorStage::energy;
      s.needs = s.needs | detail::needs_of(*info);
      entries.push_back(e);
    }
  }
  auto const upload = [&](auto& view, char const* label, auto const& list) {
    view = detail::to_device<std::decay_t<decltype(view)>>(exec, label, list);
  };
  upload(s.entries, "gsp::Sensors::entries", entries);
  upload(s.touches, "gsp::Sensors::touches", touches);
  upload(s.adhesions, "gsp::Sensors::adhesions", adhesions);
  upload(s.contacts, "gsp::Sensors::contacts", contacts);
  upload(s.limits, "gsp::Sensors::limits", limits);
  upload(s.accelerated, "gsp::Sensors::accelerated", accelerated);
  upload(s.users, "gsp::Sensors::users", users);
  upload(s.ranges, "gsp::Sensors::ranges", ranges);
  upload(s.distances, "gsp::Sensors::distances", distances);
  if (!distances.empty()) {
    std::vector<int> index;
    s.distance_assets = make_shape_assets<R>(exec, compiled, distance_geoms, index);
    std::vector<DistanceGeom<R>> geoms;
    for (std::size_t k = 0; k < distance_geoms.size(); ++k) {
      int const g = distance_geoms[k];
      auto const& size = compiled.geom_size[g];
      geoms.push_back({ShapeType(compiled.geom_type[g]),
                       g,
                       compiled.geom_body[g],
                       {R(size[0]), R(size[1]), R(size[2])},
                       s.distance_assets.at(index[k])});
    }
    upload(s.distance_geoms, "gsp::Sensors::distance_geoms", geoms);
  }
  if (!ranges.empty() || !s.range_cameras.empty()) s.scene = make_ray_scene<R>(exec, model, compiled, {.worlds = options.worlds});
  if (volumes) {
    expects(int(compiled.site_type.size()) == compiled.nsite && int(compiled.site_size.size()) == compiled.nsite,
            "gsp::make_sensors: the compiled model has no volumes of sites (site_type, site_size): compile a description");
    upload(s.site_type, "gsp::Sensors::site_type", compiled.site_type);
    std::vector<R> sizes;
    for (auto const& size : compiled.site_size)
      for (double const x : size) sizes.push_back(R(x));
    upload(s.site_size, "gsp::Sensors::site_size", sizes);
  }
  if (subtrees) s.subtrees = make_subtrees(exec, model, {.worlds = options.worlds});
  if (energy)
    s.energy = detail::allocate_zero<Kokkos::View<R**, Kokkos::LayoutRight, Mem>>(exec, "gsp::Sensors::energy", options.worlds, 2);
  if (!accelerated.empty()) {
    bool const forces = std::any_of(accelerated.begin(), accelerated.end(),
                                    [](Entry const& e) { return e.type == SensorType::force || e.type == SensorType::torque; });
    s.accelerations = make_accelerations(exec, model, {.worlds = options.worlds, .bodies = forces});
  }
  if (!(options.timestep > 0)) {
    double const own = compiled.option.timestep;
    options.timestep = R(own) == model.timestep ? own : double(model.timestep);
  }
  s.history = make_sensor_history<R>(exec, compiled, {.worlds = options.worlds, .timestep = options.timestep, .left_out = s.left_out});
  return s;
}

}  // namespace gsp
