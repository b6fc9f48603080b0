#pragma once
#include <iterator>
#include <string_view>

/// The types of MJCF's sensors, in one table: what `compile` checks and sizes them by, and what their evaluation goes by.
namespace gsp {

/// In MuJoCo's order (mjtSensor), but for plug-ins.
enum class SensorType : int {
  touch,
  accelerometer,
  velocimeter,
  gyro,
  force,
  torque,
  magnetometer,
  rangefinder,
  cam_projection,
  joint_pos,
  joint_vel,
  tendon_pos,
  tendon_vel,
  actuator_pos,
  actuator_vel,
  actuator_force,
  joint_actuator_force,
  tendon_actuator_force,
  ball_quat,
  ball_angvel,
  joint_limit_pos,
  joint_limit_vel,
  joint_limit_force,
  tendon_limit_pos,
  tendon_limit_vel,
  tendon_limit_force,
  frame_pos,
  frame_quat,
  frame_xaxis,
  frame_yaxis,
  frame_zaxis,
  frame_linvel,
  frame_angvel,
  frame_linacc,
  frame_angacc,
  subtree_com,
  subtree_linvel,
  subtree_angmom,
  inside_site,
  distance,
  normal,
  from_to,
  contact,
  potential_energy,
  kinetic_energy,
  clock,
  tactile,
  user
};

/// What has to be known before a sensor can be evaluated.
enum class SensorStage : int {
  state,         // qpos, qvel, ctrl, the clock
  pose,          // poses of bodies: forward_kinematics
  velocity,      // spatial velocities, tendons, transmissions: smooth_dynamics
  actuation,     // forces of actuators: smooth_dynamics
  energy,        // energies
  subtree,       // subtree_com
  momentum,      // subtree_com, subtree_momentum
  constraint,    // forces of contacts and limits
  acceleration,  // accelerations of bodies and what acts between them, with the forces of constraints
  ray,           // rays against shapes
  shape,         // distances between shapes
  field,         // signed distance fields of shapes
  outside        // a function of the user's own
};

/// What a positive cutoff does to a sensor's numbers: they stay within +-cutoff; stay below it; it is refused (directions, rotations); or
/// they are not cut. Of `distance`, `normal` and `fromto` it is, besides, how far they look.
enum class SensorCutoff : int { both_sides, above, refused, ignored };

/// What a sensor is about. frame: a body, geom, site or camera, seen from another one where a reference is given; pair: two objects;
/// projection: a site as a camera sees it; any: its own settings say it.
enum class SensorObject : int { nothing, joint, ball, tendon, actuator, body, site, frame, projection, pair, any };

struct SensorInfo {
  SensorType type;
  std::string_view name;  // in MJCF
  int size;               // numbers; 0: by its settings
  SensorStage stage;
  SensorCutoff cutoff;
  SensorObject about;
};

inline constexpr SensorInfo sensor_types[] = {
    {SensorType::touch, "touch", 1, SensorStage::constraint, SensorCutoff::above, SensorObject::site},
    {SensorType::accelerometer, "accelerometer", 3, SensorStage::acceleration, SensorCutoff::both_sides, SensorObject::site},
    {SensorType::velocimeter, "velocimeter", 3, SensorStage::velocity, SensorCutoff::both_sides, SensorObject::site},
    {SensorType::gyro, "gyro", 3, SensorStage::velocity, SensorCutoff::both_sides, SensorObject::site},
    {SensorType::force, "force", 3, SensorStage::acceleration, SensorCutoff::both_sides, SensorObject::site},
    {SensorType::torque, "torque", 3, SensorStage::acceleration, SensorCutoff::both_sides, SensorObject::site},
    {SensorType::magnetometer, "magnetometer", 3, SensorStage::pose, SensorCutoff::both_sides, SensorObject::site},
    {SensorType::rangefinder, "rangefinder", 0, SensorStage::ray, SensorCutoff::both_sides, SensorObject::any},
    {SensorType::cam_projection, "camprojection", 2, SensorStage::pose, SensorCutoff::both_sides, SensorObject::projection},
    {SensorType::joint_pos, "jointpos", 1, SensorStage::state, SensorCutoff::both_sides, SensorObject::joint},
    {SensorType::joint_vel, "jointvel", 1, SensorStage::state, SensorCutoff::both_sides, SensorObject::joint},
    {SensorType::tendon_pos, "tendonpos", 1, SensorStage::velocity, SensorCutoff::both_sides, SensorObject::tendon},
    {SensorType::tendon_vel, "tendonvel", 1, SensorStage::velocity, SensorCutoff::both_sides, SensorObject::tendon},
    {SensorType::actuator_pos, "actuatorpos", 1, SensorStage::velocity, SensorCutoff::both_sides, SensorObject::actuator},
    {SensorType::actuator_vel, "actuatorvel", 1, SensorStage::velocity, SensorCutoff::both_sides, SensorObject::actuator},
    {SensorType::actuator_force, "actuatorfrc", 1, SensorStage::actuation, SensorCutoff::both_sides, SensorObject::actuator},
    {SensorType::joint_actuator_force, "jointactuatorfrc", 1, SensorStage::actuation, SensorCutoff::both_sides, SensorObject::joint},
    {SensorType::tendon_actuator_force, "tendonactuatorfrc", 1, SensorStage::actuation, SensorCutoff::both_sides, SensorObject::tendon},
    {SensorType::ball_quat, "ballquat", 4, SensorStage::state, SensorCutoff::refused, SensorObject::ball},
    {SensorType::ball_angvel, "ballangvel", 3, SensorStage::state, SensorCutoff::both_sides, SensorObject::ball},
    {SensorType::joint_limit_pos, "jointlimitpos", 1, SensorStage::constraint, SensorCutoff::both_sides, SensorObject::joint},
    {SensorType::joint_limit_vel, "jointlimitvel", 1, SensorStage::constraint, SensorCutoff::both_sides, SensorObject::joint},
    {SensorType::joint_limit_force, "jointlimitfrc", 1, SensorStage::constraint, SensorCutoff::both_sides, SensorObject::joint},
    {SensorType::tendon_limit_pos, "tendonlimitpos", 1, SensorStage::constraint, SensorCutoff::both_sides, SensorObject::tendon},
    {SensorType::tendon_limit_vel, "tendonlimitvel", 1, SensorStage::constraint, SensorCutoff::both_sides, SensorObject::tendon},
    {SensorType::tendon_limit_force, "tendonlimitfrc", 1, SensorStage::constraint, SensorCutoff::both_sides, SensorObject::tendon},
    {SensorType::frame_pos, "framepos", 3, SensorStage::pose, SensorCutoff::both_sides, SensorObject::frame},
    {SensorType::frame_quat, "framequat", 4, SensorStage::pose, SensorCutoff::refused, SensorObject::frame},
    {SensorType::frame_xaxis, "framexaxis", 3, SensorStage::pose, SensorCutoff::refused, SensorObject::frame},
    {SensorType::frame_yaxis, "frameyaxis", 3, SensorStage::pose, SensorCutoff::refused, SensorObject::frame},
    {SensorType::frame_zaxis, "framezaxis", 3, SensorStage::pose, SensorCutoff::refused, SensorObject::frame},
    {SensorType::frame_linvel, "framelinvel", 3, SensorStage::velocity, SensorCutoff::both_sides, SensorObject::frame},
    {SensorType::frame_angvel, "frameangvel", 3, SensorStage::velocity, SensorCutoff::both_sides, SensorObject::frame},
    {SensorType::frame_linacc, "framelinacc", 3, SensorStage::acceleration, SensorCutoff::both_sides, SensorObject::frame},
    {SensorType::frame_angacc, "frameangacc", 3, SensorStage::acceleration, SensorCutoff::both_sides, SensorObject::frame},
    {SensorType::subtree_com, "subtreecom", 3, SensorStage::subtree, SensorCutoff::both_sides, SensorObject::body},
    {SensorType::subtree_linvel, "subtreelinvel", 3, SensorStage::momentum, SensorCutoff::both_sides, SensorObject::body},
    {SensorType::subtree_angmom, "subtreeangmom", 3, SensorStage::momentum, SensorCutoff::both_sides, SensorObject::body},
    {SensorType::inside_site, "insidesite", 1, SensorStage::subtree, SensorCutoff::above, SensorObject::pair},
    {SensorType::distance, "distance", 1, SensorStage::shape, SensorCutoff::both_sides, SensorObject::pair},
    {SensorType::normal, "normal", 3, SensorStage::shape, SensorCutoff::ignored, SensorObject::pair},
    {SensorType::from_to, "fromto", 6, SensorStage::shape, SensorCutoff::ignored, SensorObject::pair},
    {SensorType::contact, "contact", 0, SensorStage::constraint, SensorCutoff::ignored, SensorObject::any},
    {SensorType::potential_energy, "e_potential", 1, SensorStage::energy, SensorCutoff::both_sides, SensorObject::nothing},
    {SensorType::kinetic_energy, "e_kinetic", 1, SensorStage::energy, SensorCutoff::both_sides, SensorObject::nothing},
    {SensorType::clock, "clock", 1, SensorStage::state, SensorCutoff::both_sides, SensorObject::nothing},
    {SensorType::tactile, "tactile", 0, SensorStage::field, SensorCutoff::above, SensorObject::any},
    {SensorType::user, "user", 0, SensorStage::outside, SensorCutoff::both_sides, SensorObject::any},
};

/// The table's row of a type.
constexpr SensorInfo const& sensor_info(SensorType type) { return sensor_types[int(type)]; }
/// The table's row of MJCF's name; nullptr where there is none.
constexpr SensorInfo const* find_sensor_type(std::string_view name) {
  for (auto const& info : sensor_types)
    if (info.name == name) return &info;
  return nullptr;
}

namespace detail {
/// The stages that `smooth_sensors` evaluates.
constexpr bool is_smooth(SensorStage stage) {
  switch (stage) {
    case SensorStage::state:
    case SensorStage::pose:
    case SensorStage::velocity:
    case SensorStage::actuation:
    case SensorStage::energy:
    case SensorStage::subtree:
    case SensorStage::momentum:
      return true;
    case SensorStage::constraint:
    case SensorStage::acceleration:
    case SensorStage::ray:
    case SensorStage::shape:
    case SensorStage::field:
    case SensorStage::outside:
      return false;
  }
  return false;
}
/// Whether the library evaluates it: signed distance fields there are none of, and what is outside is yours to compute.
constexpr bool is_evaluated(SensorStage stage) { return stage != SensorStage::field && stage != SensorStage::outside; }
constexpr bool sensor_types_in_order() {
  int at = 0;
  for (auto const& info : sensor_types)
    if (int(info.type) != at++) return false;
  return true;
}
static_assert(std::size(sensor_types) == int(SensorType::user) + 1 && sensor_types_in_order(),
              "gsp::sensor_types: a row for each SensorType, in the same order");
}  // namespace detail

}  // namespace gsp
