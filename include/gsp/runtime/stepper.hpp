#pragma once
#include <array>
#include <gsp/model/compiled.hpp>
#include <gsp/runtime/array.hpp>
#include <gsp/splat/lens.hpp>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace gsp::runtime {

struct StepperOptions {
  int worlds = 1;
  Dtype precision = Dtype::float32;    // or float64
  double timestep = 0;                 // [s]; 0: the model's own
  bool mujoco = false;                 // profile mujoco instead of stable
  int iterations = 0;                  // at most, of the profile's solver (PgsOptions, NewtonOptions); 0: the library's default
  std::optional<double> tolerance;     // of the same; empty: the library's default
  std::optional<FrictionCone> cone;    // SimulationOptions::cone
  double friction_time = 0;            // SimulationOptions::friction_time [s]
  int threads = 0;                     // of the CPU; 0: all, but no more than such worlds have work for
  std::vector<std::string> per_world;  // fields whose values differ from world to world, of `world_fields`
};

/// The names of all fields that may differ from world to world: the model's (model/fields.hpp), and "geom_pos", "geom_quat", "geom_size",
/// "geom_friction", "geom_solref", "geom_solimp" (collision/geom_values.hpp).
std::vector<std::string> world_fields();

/// Of a call of `Stepper::step`.
struct StepOptions {
  int steps = 1;
  bool measure_residual = false;  // counts().residual is that of the last step; else NaN
};

/// The state itself (model/state.hpp): what is written there is what the next step starts from.
struct StateArrays {
  Array qpos;          // (worlds, nq)
  Array qpos_low;      // (worlds, nq) what rounding took from the positions, which are qpos + qpos_low
  Array qvel;          // (worlds, nv)
  Array ctrl;          // (worlds, nu)
  Array act;           // (worlds, na)
  Array mocap_pos;     // (worlds, nmocap, 3)
  Array mocap_quat;    // (worlds, nmocap, 4)
  Array qfrc_applied;  // (worlds, nv)
  Array steps;         // (worlds) int64
  Array status;        // (worlds) uint32
  Array eq_active;     // (worlds, neq) int32, not 0: this equality constraint acts
};

/// Poses of bodies and joints (model/poses.hpp).
struct PoseArrays {
  Array xpos, xquat;     // (worlds, nbody, 3 | 4)
  Array xanchor, xaxis;  // (worlds, njnt, 3)
  int worlds() const { return static_cast<int>(xpos.extents[0]); }
  /// Those of worlds first ... first + count - 1.
  PoseArrays of_worlds(int first, int count) const {
    return {xpos.rows(first, count), xquat.rows(first, count), xanchor.rows(first, count), xaxis.rows(first, count)};
  }
};

/// What the last step met.
struct StepCounts {
  std::int64_t contacts = 0, rows = 0;  // of all worlds
  int iterations = 0;                   // most sweeps of any world
  double mean_iterations = 0;           // of all worlds
  int unfinished_worlds = 0;            // worlds whose solver made all the iterations that it may, so may not be at rest
  double residual = 0;                  // greatest of any world [m/s, rad/s] where it was measured, else NaN
  std::int64_t asleep = 0, kept = 0;    // of all worlds: trees that sleep after it, their rows, which were not solved for
  int failed_worlds = 0;                // worlds that stopped (status::stopped): not finite, unbounded, or with a row that was refused
};

/// What the solver has left unsolved in the last step, by parts (solver/residual.hpp), in worlds that have not stopped. NaN before the
/// first step; 0 where there are no constraints.
struct StepResiduals {
  struct Part {
    double most = 0, mean = 0;  // of these worlds
  };
  Part rate, equality, complementarity, friction;  // [m/s, rad/s]
  Part bounds, cone;                               // [N s]
  double energy = 0;                               // mean [J]
};

/// A world that stopped, and the first degree of freedom to blame: of those with a bad number the first that is not finite, else the one
/// farthest beyond state_bound.
struct StoppedWorld {
  int world = 0;
  std::int64_t steps = 0;    // done before it stopped
  std::uint32_t status = 0;  // bits of core/status.hpp
  int joint = -1, dof = -1;  // -1: no velocity or position of the last step says which
  int dofs = 0;              // that have such a number
  bool position = false;     // the number is a position of the joint: else the new velocity of the dof
  double number = 0;         // [m, rad, and a second]
};

/// The contacts of the last step (collision/contacts.hpp) and what they did (constraint/contact_forces.hpp), those of world 0 first.
struct ContactArrays {
  Array world, geom1, geom2;  // (contacts) int32; MuJoCo's order: the type of geom1 is the lesser
  Array dist;                 // (contacts) [m], negative inside
  Array pos;                  // (contacts, 3) midway between the surfaces [m]
  Array frame;                // (contacts, 9) rows normal (geom1 to geom2), two tangents
  Array force;                // (contacts, 6) on geom2 along the frame's rows [N], about them [N m]; zero where it did not act
};

/// One of the arrays that a stepper goes on from, by name: "state.qpos", "impulses.p", "sleep.calm" (step/snapshot.hpp).
struct NamedArray {
  std::string name;
  Array array;  // float32 or float64, as the stepper's precision; int32 or int64
};
/// Of what `Stepper::save` gives: another number where names or meaning of the arrays are others, the order of the constraint types among
/// it.
inline constexpr int snapshot_version = 1;

/// Of the smooth dynamics. In profile mujoco M acceleration = passive - bias + actuator + applied; in profile stable the acceleration is
/// that of the implicit step.
enum class SmoothForces { passive, actuator, bias, acceleration };

/// float32, on any device; on a renderer's own they are read where they are.
struct CameraArrays {
  Array viewmats;                    // (C, 4, 4) world to camera
  Array Ks;                          // (C, 3, 3)
  Array world;                       // (C) int32, or empty: camera c shows world c % worlds
  std::vector<Lens> lenses{};        // (C), one for all, or empty: pinholes (splat/lens.hpp)
  std::shared_ptr<void> owner = {};  // keeps the arrays where somebody may let go of them: `Stepper::cameras`
};
/// A camera of the model by name, or one on a body ("world": what does not move), as MJCF has them: sensor/cameras.hpp.
struct CameraSpec {
  std::string camera = "";  // or
  std::string body = "";    // with all below
  std::array<double, 3> pos{0, 0, 0};
  std::array<double, 4> quat{1, 0, 0, 0};  // looks along -z, y up, x right
  double fovy = 0.7853981633974483;        // [rad] from the picture's top to its bottom
  bool operator==(CameraSpec const&) const = default;
};

/// Many worlds of one model on a device.
class Stepper {
 public:
  virtual ~Stepper() = default;
  virtual double timestep() const = 0;
  /// Threads of the CPU that step; 0: a GPU does.
  virtual int threads() const = 0;
  /// The state, and poses of it: both stay where they are as long as the stepper lives. `poses` brings them up to date after `set` and
  /// `step`; whoever writes into the state's arrays calls `forward`.
  virtual StateArrays state() const = 0;
  virtual PoseArrays poses() = 0;
  /// Sets positions (qpos and qpos_low, so that no digit of a float64 is lost), velocities and controls, each from (worlds | 1, n) on any
  /// device in any precision; one row is given to all worlds, an empty array leaves what is there.
  virtual void set(Array const& qpos, Array const& qvel, Array const& ctrl) = 0;
  /// Positions (qpos + qpos_low) and velocities into float64 arrays of the host, (worlds, n).
  virtual void get(Array qpos, Array qvel) const = 0;
  virtual void forward() = 0;
  /// Worlds of the mask, (worlds) int32 on any device, not 0: to the model's initial positions, or those of a keyframe (index; -1: none):
  /// at rest, time 0, status cleared, no impulses of the last step (model/keyframe.hpp). Without data: all worlds. Allocates; waits.
  /// Errors: std::invalid_argument for a mask of another shape or kind, and a keyframe that is not there.
  virtual void reset(Array const& mask, int keyframe) = 0;
  /// Copies all that the next step starts from: state, impulses, who sleeps. The arrays hold until the next call. Waits; allocates at
  /// first, and where there may be more impulses than before.
  virtual std::vector<NamedArray> save() = 0;
  /// Goes on from such arrays, on any device, of as many worlds or of one, which is given to all: with the same model and options, on the
  /// same device, what follows is what would have followed, to the bit. Without those of "sleep." all worlds are awake, without those of
  /// "sensors." sensors that keep samples have measured nothing. Worlds outside of the mask, as `reset` takes it, do not notice, but that
  /// no world has contacts of the last step. Allocates; waits.
  /// Errors: gsp::Error that names an array which is missing, or of other shape, kind or range than `save` gives.
  virtual void restore(std::vector<NamedArray> const& arrays, Array const& mask = {}) = 0;
  /// (worlds, items, components) a copy of the values of a field of StepperOptions::per_world, which holds until the next call of this.
  /// Friction and softness of geoms that take part in no pair are NaN. Allocates; waits. Errors: gsp::Error for a field that is the same
  /// for all worlds.
  virtual Array world_values(std::string const& field) = 0;
  /// Sets them in the worlds of the mask, as `reset` takes it, from (worlds | 1, items, components) or, of one component, (worlds | 1,
  /// items), on any device in any precision, and then what follows from masses and geometry (dynamics/set_constants.hpp): of several fields
  /// each time, so it belongs to resets. Who sleeps is woken. Pictures, and rays of a Scanner, keep sizes and
  /// poses of the compiled model; rangefinders its sizes.
  /// @param scale_inertia  body_mass alone: inertia changes in proportion (then body_inertia is per world too), else it stays
  /// Allocates; waits. Errors: gsp::Error for another shape, and for a field that is the same for all worlds.
  virtual void set_world_values(std::string const& field, Array const& values, Array const& mask, bool scale_inertia) = 0;
  /// Of the state as it is, each in an array of its own that holds until the next call of the same: M (worlds, nv, nv); the forces and the
  /// acceleration without constraints (dynamics/smooth.hpp, copy_dofs), (worlds, nv); the Jacobian (worlds, 6, nv) of a point of a body, or
  /// of a site (point of {0, 0, 0}), rows 0-2 of its velocity, 3-5 angular, in world axes; qfrc = M qacc + bias - passive of qacc (worlds,
  /// nv) on any device. Residuals of the last step are lost. Allocates at first; waits.
  virtual Array mass_matrix() = 0;
  virtual Array smooth_forces(SmoothForces which) = 0;
  virtual Array body_jacobian(int body, std::array<double, 3> const& point) = 0;
  virtual Array site_jacobian(int site) = 0;
  virtual Array inverse_dynamics(Array const& qacc) = 0;
  /// Waits until the steps are done.
  virtual void step(StepOptions const& options) = 0;
  virtual StepCounts counts() const = 0;
  /// Of the last step, whatever `measure_residual` was: computed here from what the solver has left, so steps cost the same without. RK4:
  /// of its last evaluation. Allocates; waits.
  virtual StepResiduals residuals() const = 0;
  /// The first `most` of the worlds that stopped, after the steps of the last call of `step`. Allocates; waits.
  virtual std::vector<StoppedWorld> stopped(int most) const = 0;
  /// The contacts of the last step, found at its start (RK4: of its last evaluation), where they lie. The arrays hold until the next call
  /// of `step`, `sensors` or `contacts`. The forces are computed here, so steps cost the same without. None before the first step, and
  /// after `restore`. Allocates where there may be more contacts than before; waits.
  virtual ContactArrays contacts() = 0;
  /// (worlds, nv) what all constraints together did to the degrees of freedom in the last step [N, N m]; where it stays.
  virtual Array qfrc_constraint() const = 0;
  /// (worlds, nsensordata) all sensors of the model, of the state as it is (sensor/read_sensors.hpp), evaluated here: steps cost the same
  /// without, and what follows is to the bit what would have followed; counts, contacts and forces of the last step are lost. NaN where
  /// nobody evaluates a sensor. Where it stays; allocates at first; waits.
  /// Sensors with a delay or an interval (sensor/sensor_history.hpp) measure at each step, and a step then costs their evaluation too.
  virtual Array sensors() = 0;
  /// A sentence for each sensor that nobody evaluates.
  virtual std::vector<std::string> sensors_left_out() = 0;
  /// What these cameras see in the state as it is, for pictures of one size: image world x specs.size() + k is of spec k of that world. On
  /// the stepper's device, as a renderer reads them; each of the 64 lists of specs (of one size) that were asked for last has arrays of its
  /// own, which the next call for the same writes; who wants those of an older list keeps their owner. Allocates for a new list; waits.
  /// Errors: those of make_camera_mounts.
  virtual CameraArrays cameras(std::vector<CameraSpec> const& specs, int width, int height) = 0;
};

/// Errors: those of make_model and make_simulation.
std::unique_ptr<Stepper> make_stepper(Device device, CompiledModel const& model, StepperOptions const& options);
/// Bytes that make_stepper will allocate on the device (step/bytes_needed.hpp).
std::int64_t bytes_needed(Device device, CompiledModel const& model, StepperOptions const& options);

/// Poses for positions that come from elsewhere (a file): kinematics alone, in float64.
class Kinematics {
 public:
  virtual ~Kinematics() = default;
  /// qpos (worlds, nq) on any device. The arrays hold until the next call.
  virtual PoseArrays poses(Array const& qpos) = 0;
  /// What the model's camera of this index (`camera_id`) sees of the worlds of the last `poses`, one camera a world, for pictures of this
  /// size (sensor/cameras.hpp). The arrays hold until the next call. Error: no camera of that index, or a model in which nothing moves.
  virtual CameraArrays cameras(int camera, int width, int height) = 0;
};
/// `model` may have no dofs, or be empty: then one body, the world.
std::unique_ptr<Kinematics> make_kinematics(Device device, CompiledModel const& model);

}  // namespace gsp::runtime
