#pragma once
#include <gsp/constraint/contact_forces.hpp>
#include <gsp/constraint/joint_limit.hpp>
#include <gsp/constraint/tendon.hpp>
#include <gsp/core/region.hpp>
#include <gsp/sensor/accelerations.hpp>
#include <gsp/sensor/detail/constraint_sensors_kernels.hpp>
#include <gsp/sensor/sense.hpp>
#include <gsp/sensor/sensor_table.hpp>

/// MJCF's sensors of what constraints do: touch, contact, jointlimitpos, jointlimitvel, jointlimitfrc and those of tendons; actuatorvel of
/// adhesion actuators.
namespace gsp {

/// data (world, nsensordata): their numbers, at sensor_adr; what others have there stays as it is.
///   touch    sum of the normal forces > 0 of contacts of the site's own body whose point, or whose line outward along the normal, meets
///            the site's volume [N]
///   contact  slots of the contacts that match, as MuJoCo's documentation of <contact> says; force and torque in the contact's frame, pos,
///            normal and tangent in the world; turned round where it is the other way about. linvel and angvel: of side 2 relative to side
///            1 at pos, in the contact's frame. netforce: the force and torque, in world axes, that do at pos, their centre, what all do
///            together
///   actuatorvel of adhesion  with which the contacts of the actuator's body close, their mean along their normals [m/s]; 0: it has none
///   limits   of the first of the joint's (or tendon's) ends that acts: its gap less the margin, its rate, its force >= 0; 0: none acts
/// @param state, poses, dynamics, collision, contacts, rows, impulses  after `forward` (or smooth_dynamics, collide, assemble and the
///        solver), before the state moves on
/// One launch a kind, of a thread a sensor and world. A contact sensor goes through the world's contacts once for each slot: a binary
/// search a contact where it asks for forces. Does not allocate, does not fence. Errors: std::invalid_argument where dynamics, poses, rows
/// or contacts are of another moment, or nothing was solved.
template <ExecutionSpace Exec, class R, class Mem, class View>
void constraint_sensors(Exec const& exec, Model<R, Mem> const& model, State<R, Mem> const& state, Poses<R, Mem> const& poses,
                        Dynamics<R, Mem> const& dynamics, CollisionModel<R, Mem> const& collision, Contacts<R, Mem> const& contacts,
                        Rows<R, Mem> const& rows, Impulses<R, Mem> const& impulses, Sensors<R, Mem> const& sensors, View& data) {
  Region const region("gsp::sensor::constraint_sensors");
  constexpr char const* where = "gsp::constraint_sensors";
  detail::expects_sensors(where, model, sensors, data);
  detail::expects_as_many(where, "worlds", "make all with the same {.worlds = n}", detail::Count{"rows", rows.worlds},
                          detail::Count{"sensors", sensors.worlds}, detail::Count{"state", state.worlds});
  detail::expects_fit(where, model, state, dynamics, poses);
  detail::expects_of(where, dynamics, state, detail::set_of(Quantity::motion, Quantity::velocity, Quantity::tendon_length));
  detail::expects_poses_of(where, poses, state);
  detail::expects_contact_forces(where, model, collision, contacts, rows, impulses);
  detail::expects_forces_of(where, state, rows, impulses);
  detail::ContactSensorBase<R, Mem> const base{detail::contact_force_of(model, collision, contacts, rows, impulses),
                                               {model, poses},
                                               model.body_parent,
                                               sensors.site_type,
                                               sensors.site_size,
                                               detail::has_solution(rows, impulses)};
  if (sensors.touches.extent(0) > 0)
    sense(exec, detail::TouchSensors<R, Mem>{base, sensors.touches, sensors.nsensordata}, data, {.label = "gsp::sensor::touch_sensors"});
  if (sensors.adhesions.extent(0) > 0)
    sense(exec,
          detail::AdhesionVelocities<R, Mem>{base, detail::TreeReader<R, Mem>(model, dynamics), sensors.adhesions, sensors.nsensordata,
                                             model.actuation},
          data, {.label = "gsp::sensor::adhesion_velocities"});
  if (sensors.contacts.extent(0) > 0)
    sense(exec, detail::ContactSensors<R, Mem>{base, detail::TreeReader<R, Mem>(model, dynamics), sensors.contacts, sensors.nsensordata},
          data, {.label = "gsp::sensor::contact_sensors"});
  if (sensors.limits.extent(0) > 0)
    sense(exec,
          detail::LimitSensors<R, Mem>{JointLimits<R, Mem>(model, state), TendonLimits<R, Mem>(model, dynamics),
                                       impulses_of<JointLimits<R, Mem>>(rows, impulses), impulses_of<TendonLimits<R, Mem>>(rows, impulses),
                                       detail::TreeReader<R, Mem>(model, dynamics), sensors.limits, R(1) / model.timestep,
                                       sensors.nsensordata, detail::has_solution(rows, impulses)},
          data, {.label = "gsp::sensor::limit_sensors"});
}

}  // namespace gsp
