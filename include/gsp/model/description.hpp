#pragma once
#include <array>
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
enum class ShapeType : int { plane = 0, hfield = 1, sphere = 2, capsule = 3, ellipsoid = 4, cylinder = 5, box = 6, mesh = 7 };
enum class Integrator : int { euler = 0, rk4 = 1, implicit = 2, implicitfast = 3 };
enum class Cone : int { pyramidal = 0, elliptic = 1 };

/// Where an item came from, for messages: an index into Description::files (-1: made in code) and a line.
struct Place {
  int file = -1, line = 0;
};

/// Softness of a constraint as MuJoCo has it (physics: docs/conventions.md).
struct SoftnessDescription {
  std::array<double, 2> solref{0.02, 1};
  std::array<double, 5> solimp{0.9, 0.95, 0.001, 0.5, 2};
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
  std::array<double, 2> springdamper{
      0, 0};  // time constant [s] and damping ratio; both positive: compile chooses stiffness and damping from the inertia
  SoftnessDescription limit{}, friction{};
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
  bool has_mass = false;  // mass given; else density * volume
  double mass = 0, density = 1000;
  bool shell_inertia = false;
  std::array<float, 4> rgba{0.5f, 0.5f, 0.5f, 1};
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
  Double4 quat{1, 0, 0, 0};          // MuJoCo's camera frame: looks along -z, y up
  double fovy = 0.7853981633974483;  // [rad]
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

/// Fixed tendon: length = sum of coefficient * joint position (hinge and slide joints).
struct TendonDescription {
  struct Term {
    std::string joint = "";
    double coefficient = 1;
  };
  std::string name = "";
  std::vector<Term> terms{};
  bool limited = false;
  std::array<double, 2> range{0, 0};
  std::array<double, 2> springlength{-1, -1};  // dead band; -1: the length at the springs' rest
  double stiffness = 0, damping = 0, frictionloss = 0, armature = 0, margin = 0;
  SoftnessDescription limit{}, friction{};
  Place place{};
};

/// force = gain * ctrl + bias0 + bias1 * length + bias2 * velocity, then clamped (MuJoCo's motor: gain 1; position: kp, (0, -kp, -kv)).
struct ActuatorDescription {
  enum class Target : int { joint, tendon };
  std::string name = "";
  Target target = Target::joint;
  std::string target_name = "";
  std::array<double, 6> gear{1, 0, 0, 0, 0, 0};  // the first scales length and force; free and ball joints use six and three
  double gain = 1;
  Double3 bias{0, 0, 0};
  double dampratio = 0;  // > 0: bias2 = -2 dampratio sqrt(-bias1 * inertia), chosen by compile
  bool ctrl_limited = false, force_limited = false;
  std::array<double, 2> ctrl_range{0, 0}, force_range{0, 0};
  int group = 0;
  Place place{};
};

struct KeyframeDescription {
  std::string name = "";
  double time = 0;
  std::vector<double> qpos{}, qvel{}, ctrl{};  // empty: the model's initial values
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
  Cone cone = Cone::pyramidal;
  double impratio = 1, tolerance = 1e-8;
  int iterations = 100;
  bool eulerdamp = true, contact = true, constraint = true, limit = true, frictionloss = true, passive_spring = true, passive_damper = true,
       gravity_on = true, actuation = true, clampctrl = true, filterparent = true, refsafe = true, warmstart = true;
};

struct CompilerDescription {
  bool inertia_from_geom_always = false, inertia_from_geom_never = false;
  std::array<int, 2> inertia_group_range{0, 5};
  double boundmass = 0, boundinertia = 0, settotalmass = -1;
  bool balanceinertia = false;
  bool approximate = false;  // condim 4 and 6 become 3, and pairs of shapes that are not covered are left out; else both are refused
};

/// What was refused, approximated or without effect, one line each, for people.
struct ReportLine {
  enum class Kind : int { refused, approximated, no_effect, visual_only, left_out };
  Kind kind = Kind::no_effect;
  std::string file;
  int line = 0;
  std::string text;
  int count = 1;
};

struct Description {
  std::string name = "";
  std::vector<std::string> files;  // what Place::file points into
  OptionDescription option;
  CompilerDescription compiler;
  std::vector<BodyDescription> bodies{
      BodyDescription::world()};  // depth first, as MuJoCo orders them: parents before children, subtrees contiguous
  std::vector<TendonDescription> tendons;
  std::vector<ActuatorDescription> actuators;
  std::vector<KeyframeDescription> keyframes;
  std::vector<ExcludeDescription> excludes;
  std::vector<ReportLine> report;
};

}  // namespace gsp
