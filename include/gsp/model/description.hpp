#pragma once
#include <array>
#include <gsp/geometry/shape.hpp>
#include <optional>
#include <string>
#include <vector>

/// A model as its author describes it: bodies in a tree with joints, shapes, sites, cameras, and what acts on them. Host only, editable, in
/// double. Readers (gsp/io/mjcf.hpp) and code (samples.hpp) make it; `compile` (compile.hpp) turns it into the flat arrays that kernels
/// use. Units: metres, kilograms, seconds, radians. Quaternions w, x, y, z. All poses are relative to the parent body's frame. Defaults,
/// `frame`s, `replicate`s, angle units and fromto are resolved by the readers: a Description holds plain values only.
namespace gsp {

using Double3 = std::array<double, 3>;
using Double4 = std::array<double, 4>;

enum class JointType : int { free = 0, ball = 1, slide = 2, hinge = 3 };  // MuJoCo's numbering
enum class Integrator : int { euler = 0, rk4 = 1, implicit = 2, implicitfast = 3 };
/// Which impulses the rows of friction of a contact may have together. Files name the first two.
enum class FrictionCone : int {
  pyramidal = 0,  // MuJoCo's: 2 (condim - 1) soft edges J_n +- mu_k J_k that push
  // Those along the tangents in an ellipse, a disc of radius mu p_n where friction is the same along both, and so those of rolling: slides
  // against the slip. In profile mujoco all of them in one ellipsoid.
  elliptic = 1,
  box = 2  // profile stable: each by itself within +-mu p_n (the paper's): up to sqrt(2) stronger between the tangents, and steers
};

/// Where an item came from, for messages: an index into Description::files (-1: made in code) and a line.
struct Place {
  int file = -1, line = 0;
};

enum class WrapType : int { none = 0, joint = 1, pulley = 2, site = 3, sphere = 4, cylinder = 5 };
enum class Transmission : int { joint = 0, joint_in_parent = 1, slider_crank = 2, tendon = 3, site = 4, body = 5 };
enum class ActuatorDynamics : int { none = 0, integrator = 1, filter = 2, filter_exact = 3, muscle = 4 };
enum class ActuatorGain : int { fixed = 0, affine = 1, muscle = 2 };
enum class ActuatorBias : int { none = 0, affine = 1, muscle = 2 };
enum class EqualityType : int { connect = 0, weld = 1, joint = 2, tendon = 3 };
enum class CameraMode : int { fixed = 0, track = 1, track_com = 2, target_body = 3, target_body_com = 4 };
/// Whether a tree may sleep (step/sleep.hpp), at its root: automatic: unless an actuator moves it.
enum class BodySleep : int { automatic = 0, never = 1, allowed = 2 };
enum class MeshInertia : int { legacy = 0, exact = 1, convex = 2, shell = 3 };

/// Softness of a constraint as MuJoCo has it (physics: docs/conventions.md).
struct SoftnessDescription {
  std::array<double, 2> solref{0.02, 1};
  std::array<double, 5> solimp{0.9, 0.95, 0.001, 0.5, 2};
};

/// Instead of soft, in profile stable: rigid, with the share of a gap that a step takes back and, of what pushes, the share of the speed
/// that comes back (docs/constraint/softness.md).
struct RigidDescription {
  bool hard = false;
  double restitution = 0, erp = 0.2;
};

struct JointDescription {
  std::string name = "";
  JointType type = JointType::hinge;
  Double3 pos{0, 0, 0}, axis{0, 0, 1};  // anchor and axis in the body frame; the axis is normalised by compile
  bool limited = false;
  std::array<double, 2> range{0, 0};  // [rad] or [m]
  bool actuator_force_limited = false;
  std::array<double, 2> actuator_force_range{0, 0};
  double ref = 0, springref = 0;  // position in the model's initial pose; of the spring
  double stiffness = 0, damping = 0, armature = 0, frictionloss = 0, margin = 0;
  std::array<double, 2> stiffness_poly{0, 0}, damping_poly{0, 0};  // force -x (k + k1 |x| + k2 x^2), docs/dynamics/passive_forces.md
  bool actuator_gravcomp = false;                                  // gravity compensation counts as an actuator's force
  std::array<double, 2> springdamper{
      0, 0};  // time constant [s] and damping ratio; both positive: compile chooses stiffness and damping from the inertia
  std::optional<bool> align{};  // a free joint's body frame becomes its inertial frame; empty: as CompilerDescription::align_free says
  SoftnessDescription limit{}, friction{};
  RigidDescription rigid_limit{};
  int group = 0;
  Place place{};
};

struct GeomDescription {
  std::string name = "";
  ShapeType type = ShapeType::sphere;
  Double3 size{0, 0, 0};  // plane: half x, half y (0: infinite), spacing; sphere: r; capsule, cylinder: r, half length; box: half sizes
  Double3 pos{0, 0, 0};
  Double4 quat{1, 0, 0, 0};
  int contype = 1, conaffinity = 1, condim = 3, priority = 0, group = 0;
  Double3 friction{1, 0.005, 0.0001};  // sliding, torsional [m], rolling [m]
  double solmix = 1, margin = 0, gap = 0;
  SoftnessDescription softness{};
  // Profile stable: contacts that are rigid in place of `softness`. restitution: share of the speed of an impact that comes back; erp:
  // share of an overlap that a step takes back. Both 0 to 1.
  bool hard = false;
  double restitution = 0, erp = 0.2;
  bool has_mass = false;  // mass given; else density * volume
  double mass = 0, density = 1000;
  bool shell_inertia = false;
  std::string mesh = "", hfield = "";  // name of the asset; a primitive type with a mesh is fitted to it
  double fitscale = 1;
  std::array<double, 6> surface_velocity{};  // of its surface in its own frame, for contacts: linear [m/s], angular [rad/s]
  double adhesion = 0;                       // force that each contact may pull with [N]
  bool fluid_ellipsoid = false;
  std::array<double, 5> fluid_coef{0.5, 0.25, 1.5, 1, 1};  // blunt drag, slender drag, angular drag, Kutta lift, Magnus lift
  std::array<float, 4> rgba{0.5f, 0.5f, 0.5f, 1};
  float material_alpha = -1;  // of its material, -1: it has none. Rays see through 0, of the material or else of rgba (MuJoCo's mj_ray)
  int parts = 0;              // of a mesh that was taken apart: so many geoms behind it in its body touch in its place
  Place place{};
  bool visual() const { return contype == 0 && conaffinity == 0; }
};

struct SiteDescription {
  std::string name = "";
  Double3 pos{0, 0, 0}, size{0.005, 0.005, 0.005};
  Double4 quat{1, 0, 0, 0};
  ShapeType type = ShapeType::sphere;
  int group = 0;
  Place place{};
};

struct CameraDescription {
  std::string name = "";
  Double3 pos{0, 0, 0};
  Double4 quat{1, 0, 0, 0};                              // MuJoCo's camera frame: looks along -z, y up
  double fovy = 0.7853981633974483;                      // [rad]
  std::array<int, 2> resolution{1, 1};                   // [pixel]
  std::array<double, 2> sensor_size{0, 0}, focal{0, 0};  // [m] where the camera is given by them, and fovy follows; else 0
  std::array<double, 2> principal{0, 0};                 // [m] of the sensor: where the picture's centre lies off the axis, right and up
  CameraMode mode = CameraMode::fixed;
  std::string target = "";  // body that it looks at
  Place place{};
};

struct InertialDescription {
  Double3 pos{0, 0, 0};
  Double4 quat{1, 0, 0, 0};
  double mass = 0;
  std::array<double, 6> inertia{};  // xx yy zz xy xz yz about pos, in the frame of quat
};

struct BodyDescription {
  std::string name = "";
  int parent = -1;  // index into Description::bodies, smaller than its own; -1 for the world (body 0) alone
  Double3 pos{0, 0, 0};
  Double4 quat{1, 0, 0, 0};
  bool has_inertial = false;
  InertialDescription inertial;
  double gravcomp = 0;
  bool mocap = false;
  BodySleep sleep = BodySleep::automatic;
  bool fuse = true;  // may be fused with its parent where CompilerDescription::fuse_static asks for that
  std::vector<JointDescription> joints;
  std::vector<GeomDescription> geoms;
  std::vector<SiteDescription> sites;
  std::vector<CameraDescription> cameras;
  Place place{};

  static BodyDescription world() {
    BodyDescription body;
    body.name = "world";
    return body;
  }
};

/// Fixed tendon: length = sum of coefficient * joint position (hinge and slide joints). Spatial tendon (path not empty): the shortest way
/// through sites and round geoms, its branches divided by pulleys.
struct TendonDescription {
  struct PathItem {
    WrapType type = WrapType::site;  // site, sphere or cylinder (a geom), pulley
    std::string name = "", sidesite = "";
    double divisor = 1;
  };
  struct Term {
    std::string joint = "";
    double coefficient = 1;
  };
  std::string name = "";
  std::vector<Term> terms{};
  std::vector<PathItem> path{};
  bool actuator_force_limited = false;
  std::array<double, 2> actuator_force_range{0, 0};
  std::array<double, 2> stiffness_poly{0, 0}, damping_poly{0, 0};
  bool limited = false;
  std::array<double, 2> range{0, 0};
  std::array<double, 2> springlength{-1, -1};  // dead band; -1: the length at the springs' rest
  double stiffness = 0, damping = 0, frictionloss = 0, armature = 0, margin = 0;
  SoftnessDescription limit{}, friction{};
  RigidDescription rigid_limit{};
  Place place{};
};

/// force = gain(length, velocity) * ctrl (or activation) + bias(length, velocity), then clamped (MuJoCo's motor: gain 1; position: gain kp,
/// bias (0, -kp, -kv), affine).
struct ActuatorDescription {
  std::string name = "";
  Transmission target = Transmission::joint;
  std::string target_name = "", reference_name = "";  // reference: refsite of a site; of a slider-crank (target: cranksite) the slidersite
  double crank_length = 0;
  std::array<double, 6> gear{1, 0, 0, 0, 0, 0};  // the first scales length and force; free and ball joints and sites use six and three
  // fixed: p0; affine: p0 + p1 length + p2 velocity; muscle: MuJoCo's curves
  ActuatorDynamics dynamics = ActuatorDynamics::none;
  ActuatorGain gain_type = ActuatorGain::fixed;
  ActuatorBias bias_type = ActuatorBias::none;
  std::array<double, 10> dynprm{1}, gainprm{1}, biasprm{};
  bool act_early = false, act_limited = false, has_length_range = false;
  std::array<double, 2> act_range{0, 0}, length_range{0, 0};
  double damping = 0, armature = 0;  // added to the joint or tendon that it drives
  double dampratio = 0;              // > 0: bias2 = -2 dampratio sqrt(-bias1 * inertia), chosen by compile
  bool ctrl_limited = false, force_limited = false;
  std::array<double, 2> ctrl_range{0, 0}, force_range{0, 0};
  int group = 0;
  Place place{};
};

struct EqualityDescription {
  std::string name = "";
  EqualityType type = EqualityType::connect;
  std::string name1 = "", name2 = "";  // bodies (connect, weld; or sites), joints or tendons; the second may be empty
  bool sites = false, active = true;
  std::array<double, 11> data{0, 0, 0, 0, 0, 0,
                              0, 0, 0, 0, 1};  // connect: anchor; weld: anchor, relative pose, torquescale; joint, tendon: polynomial
  SoftnessDescription softness{};
  RigidDescription rigid{.erp = 1};  // without restitution
  Place place{};
};

/// What a sensor is called in MJCF, and what it is about.
struct SensorDescription {
  std::string name = "", type = "";                 // "gyro", "framepos" ...
  std::string object_type = "", object = "";        // "site", "body", "joint" ...
  std::string reference_type = "", reference = "";  // frame sensors: what they are relative to
  double cutoff = 0, noise = 0;
  std::vector<std::array<std::string, 2>> settings{};  // other attributes, as written: {"data", "found force"}, {"delay", "0.02"} ...
  Place place{};
};

/// Two geoms that may touch whatever their contype says, with parameters of their own.
struct PairDescription {
  std::string name = "", geom1 = "", geom2 = "";
  std::optional<int> condim{};  // what is empty takes MJCF's default (condim 3, friction 1 ..., no margin): nothing comes from the geoms
  std::optional<std::array<double, 5>> friction{}, solimp{};
  std::optional<std::array<double, 2>> solref{}, solreffriction{};
  std::optional<double> margin{}, gap{}, adhesion{};
  RigidDescription rigid{};
  Place place{};
};

/// Triangles as a file or the model gives them, before scaling. Vertices in float, as MuJoCo keeps them.
struct MeshDescription {
  std::string name = "";
  std::vector<std::array<float, 3>> vertices{};
  std::vector<std::array<int, 3>> faces{};  // empty: the convex hull of the vertices
  std::vector<std::array<int, 3>> hull{};   // faces of the convex hull where it is needed (gsp/io/mesh_hull.hpp), outward before scaling
  Double3 scale{1, 1, 1}, refpos{0, 0, 0};
  Double4 refquat{1, 0, 0, 0};
  MeshInertia inertia = MeshInertia::legacy;
  int max_hull_vertices = -1;
  Place place{};
};

struct HeightFieldDescription {
  std::string name = "";
  int rows = 0, columns = 0;
  std::array<double, 4> size{};    // half x, half y, top, base [m]
  std::vector<float> elevation{};  // (rows, columns) 0..1
  Place place{};
};

struct KeyframeDescription {
  std::string name = "";
  double time = 0;
  std::vector<double> qpos{}, qvel{}, act{}, ctrl{}, mpos{}, mquat{};  // empty: the model's initial values
  Place place{};
};

struct ExcludeDescription {
  std::string body1 = "", body2 = "";
  Place place{};
};

struct OptionDescription {
  double timestep = 0.002;
  Double3 gravity{0, 0, -9.81};
  Integrator integrator = Integrator::euler;
  FrictionCone cone = FrictionCone::pyramidal;
  double density = 0, viscosity = 0;  // of the medium [kg/m^3, Pa s]
  Double3 wind{0, 0, 0}, magnetic{0, -0.5, 0};
  bool override_contacts = false;  // o_margin, o_solref, o_solimp, o_friction replace what geoms and pairs say
  double o_margin = 0;
  SoftnessDescription o_softness{};
  std::array<double, 5> o_friction{1, 1, 0.005, 0.0001, 0.0001};
  int disabled_actuator_groups = 0;  // bits
  double impratio = 1, tolerance = 1e-8, noslip_tolerance = 1e-6;
  int iterations = 100, noslip_iterations = 0;
  bool sleep = false;  // islands that rest sleep (step/sleep.hpp), where their speed was below the tolerance [m/s]
  double sleep_tolerance = 1e-3;
  bool equality = true, eulerdamp = true, contact = true, constraint = true, limit = true, frictionloss = true, passive_spring = true,
       passive_damper = true, gravity_on = true, actuation = true, clampctrl = true, filterparent = true, refsafe = true, warmstart = true;
};

/// The switches of OptionDescription by the names that MJCF's <flag> gives them.
struct OptionFlag {
  char const* name;
  bool OptionDescription::*on;
};
inline constexpr OptionFlag option_flags[] = {{"actuation", &OptionDescription::actuation},
                                              {"clampctrl", &OptionDescription::clampctrl},
                                              {"constraint", &OptionDescription::constraint},
                                              {"contact", &OptionDescription::contact},
                                              {"damper", &OptionDescription::passive_damper},
                                              {"equality", &OptionDescription::equality},
                                              {"eulerdamp", &OptionDescription::eulerdamp},
                                              {"filterparent", &OptionDescription::filterparent},
                                              {"frictionloss", &OptionDescription::frictionloss},
                                              {"gravity", &OptionDescription::gravity_on},
                                              {"limit", &OptionDescription::limit},
                                              {"override", &OptionDescription::override_contacts},
                                              {"refsafe", &OptionDescription::refsafe},
                                              {"sleep", &OptionDescription::sleep},
                                              {"spring", &OptionDescription::passive_spring},
                                              {"warmstart", &OptionDescription::warmstart}};

enum class LengthRangeMode : int { none = 0, muscle = 1, muscle_user = 2, all = 3 };

/// How the range of an actuator's length becomes known: given, the limits of what it drives, or by pulling it to both ends in a simulation
/// without gravity, from the initial pose (docs/model/compile.md).
struct LengthRangeDescription {
  LengthRangeMode mode = LengthRangeMode::muscle;  // of which actuators it must be known
  bool use_existing = true, use_limit = false;
  double accel = 20;         // norm of the accelerations of the dofs that the pull asks for
  double max_force = 0;      // of its norm; 0: no bound
  double time_constant = 1;  // velocities decay with it [s], at least 0.01
  double timestep = 0.01;    // [s]; 0: the model's
  double total = 10;         // time for each end [s]
  double interval = 2;       // of which the last part counts [s]
  double tolerance = 0.05;   // largest change of the length in it, as a share of the range
};

struct CompilerDescription {
  LengthRangeDescription length_range{};
  bool inertia_from_geom_always = false, inertia_from_geom_never = false;
  std::array<int, 2> inertia_group_range{0, 5};
  double boundmass = 0, boundinertia = 0, settotalmass = -1;
  bool balanceinertia = false;
  bool fit_aabb = false, discard_visual = false, fuse_static = false, align_free = false;
};

/// What was refused, approximated or without effect, one line each, for people.
struct ReportLine {
  /// stable_only, mujoco_only: what the one profile takes and the other does without; nothing to a simulation in the one that it names.
  enum class Kind : int { refused, approximated, no_effect, visual_only, left_out, stable_only, mujoco_only };
  Kind kind = Kind::no_effect;
  std::string file;
  int line = 0;
  std::string text;
  int count = 1;
};
/// "left out", "no effect", ...: what a line of the report starts with for people.
inline char const* text(ReportLine::Kind kind) {
  using Kind = ReportLine::Kind;
  switch (kind) {
    case Kind::refused:
      return "refused";
    case Kind::approximated:
      return "approximated";
    case Kind::no_effect:
      return "no effect";
    case Kind::visual_only:
      return "visual only";
    case Kind::stable_only:
      return "stable only";
    case Kind::mujoco_only:
      return "mujoco only";
    default:
      return "left out";
  }
}

struct Description {
  std::string name = "";
  std::vector<std::string> files;  // what Place::file points into
  OptionDescription option;
  CompilerDescription compiler;
  std::vector<BodyDescription> bodies{
      BodyDescription::world()};  // depth first, as MuJoCo orders them: parents before children, subtrees contiguous
  std::vector<MeshDescription> meshes;
  std::vector<HeightFieldDescription> hfields;
  std::vector<TendonDescription> tendons;
  std::vector<EqualityDescription> equalities;
  std::vector<SensorDescription> sensors;
  std::vector<PairDescription> pairs;
  std::vector<ActuatorDescription> actuators;
  std::vector<KeyframeDescription> keyframes;
  std::vector<ExcludeDescription> excludes;
  std::vector<ReportLine> report;
};

}  // namespace gsp
