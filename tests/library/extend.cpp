// The library extended from outside: each addition is one struct with public headers alone (a test below reads this file's includes).
#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <gsp/collision/contacts.hpp>
#include <gsp/constraint/assemble.hpp>
#include <gsp/dynamics/kinematics.hpp>
#include <gsp/dynamics/smooth.hpp>
#include <gsp/model/attach.hpp>
#include <gsp/model/compile.hpp>
#include <gsp/sensor/sense.hpp>
#include <gsp/solver/pgs.hpp>
#include <gsp/splat/render.hpp>
#include <gsp_test_execs.hpp>
#include <string>
#include <vector>

#include "support/kernels.hpp"

namespace {

// example-begin add_a_constraint
/// Ropes of one length in a row: rope k from body k to body k + 1, the first from a point of the world. A rope only pulls.
template <class R, class Mem>
struct Ropes : gsp::OneFreeRow {
  gsp::Poses<R, Mem> poses;
  gsp::Vec3<R> hook;  // [m]
  R length;           // [m]
  int ropes;
  KOKKOS_FUNCTION int count(int) const { return ropes; }
  /// The gap is what is left until the rope is taut: x = length - distance, u = dx/dt.
  template <class Row>
  KOKKOS_FUNCTION R jacobian(int world, int k, int, Row&& J) const {
    auto const at = [&](int body) {
      return gsp::Vec3<R>{poses.xpos(world, body, 0), poses.xpos(world, body, 1), poses.xpos(world, body, 2)};
    };
    gsp::Vec3<R> const upper = k == 0 ? hook : at(k), lower = at(k + 1);
    gsp::Vec3<R> const up = gsp::normalized(upper - lower);
    if (k > 0) J.add_point(k, upper, -up);
    J.add_point(k + 1, lower, up);
    return length - gsp::norm(upper - lower);
  }
  /// Taut at the end of the step at most: x + h u >= 0, so that u+ = -C p + zeta with C = 0, zeta = -x / h where the rope pulls.
  KOKKOS_FUNCTION gsp::RowLaw<R> law(int, int, int, R x, R, R h) const { return {R(0), -x / h}; }
  KOKKOS_FUNCTION gsp::RowBounds<R> bounds(int, int, int) const { return {R(0), Kokkos::Experimental::infinity_v<R>}; }
};
// example-end add_a_constraint

// example-begin add_an_actuator
/// DC motors: the voltage drives a current against the back-EMF, up to what the driver gives.
///   i = (U - k w) / R within +-limit,   torque = k i
struct DcMotor {
  double k, resistance, limit;  // [N m/A = V s/rad], [Ohm], [A]
  template <class T, class X>
  KOKKOS_FUNCTION X force(gsp::WorldLane<T> const&, int, T voltage, X, X velocity) const {
    X const current = (voltage - k * velocity) / resistance;
    return k * gsp::clamp(current, X(T(-limit)), X(T(limit)));
  }
};
// example-end add_an_actuator

// example-begin add_a_learned_actuator
/// A small network for one actuator: of the error now, the error one step ago and the velocity. What it remembers is a view of its own.
template <class Mem>
struct Network {
  static constexpr int hidden = 4;
  Kokkos::View<double[hidden][3], Kokkos::LayoutRight, Mem> inner;  // weights of the hidden layer
  Kokkos::View<double[hidden], Kokkos::LayoutRight, Mem> outer;     // weights of the force [N m]
  Kokkos::View<double**, Kokkos::LayoutRight, Mem> errors;          // (world, 1) [rad] of the step before
  KOKKOS_FUNCTION bool drives(int actuator) const { return actuator == 1; }
  template <class T, class X>
  KOKKOS_FUNCTION X force(gsp::WorldLane<T> const& world, int, T target, X angle, X velocity) const {
    X const error = target - angle;
    T const before = world.load(errors, 0);
    X sum(T(0));
    for (int i = 0; i < hidden; ++i) {
      X const x = inner(i, 0) * error + inner(i, 1) * before + inner(i, 2) * velocity;
      sum += outer(i) * x / gsp::sqrt(1 + x * x);
    }
    return sum;
  }
};
// example-end add_a_learned_actuator

// example-begin add_a_sensor
/// How far body b stands from body a [m], by packs of worlds.
template <class Mem>
struct Range {
  gsp::Poses<float, Mem> poses;
  int a, b;
  int count() const { return 1; }
  KOKKOS_FUNCTION int size() const { return 1; }
  template <class T, class Put>
  KOKKOS_FUNCTION void operator()(gsp::WorldLane<T> const& world, int, Put const& put) const {
    put(0, gsp::norm(world.load3(poses.xpos, b) - world.load3(poses.xpos, a)));
  }
};
// example-end add_a_sensor

// example-begin add_a_sensor_of_contacts
/// Contacts of each body, and the deepest of them [m]: lists differ from world to world, so one world at a time.
template <class Mem>
struct Touch {
  gsp::Contacts<float, Mem> contacts;
  int bodies;
  int count() const { return bodies; }
  KOKKOS_FUNCTION int size() const { return 2; }
  template <class Put>
  KOKKOS_FUNCTION void operator()(int world, int body, Put const& put) const {
    float found = 0, deepest = 0;
    int const first = contacts.first_of(world);
    for (int k = first; k < first + contacts.count_of(world); ++k) {
      if (contacts.body1(k) != body && contacts.body2(k) != body) continue;
      found += 1;
      deepest = gsp::max(deepest, -contacts.dist(k));
    }
    put(0, found);
    put(1, deepest);
  }
};
// example-end add_a_sensor_of_contacts

// example-begin add_a_picture_channel
/// Camera z of the Gaussian behind which half of the light is left [m], 0 where more comes through. What every splat carries is enough.
template <class Mem>
struct MedianDepth {
  Kokkos::View<float***, Kokkos::LayoutRight, Mem> image;  // (C, H, W)
  static constexpr int size = 1;
  KOKKOS_FUNCTION void value(gsp::Splat const& s, float* out) const { out[0] = s.depth; }
  template <class P>
  KOKKOS_FUNCTION void blend(P* pixel, float const* value, gsp::Blend<P> const& b) const {
    pixel[0] = gsp::select(b.before > P(0.5f) && b.left <= P(0.5f), P(value[0]), pixel[0]);
  }
  KOKKOS_FUNCTION void store(int c, int row, int column, float const* pixel) const { image(c, row, column) = pixel[0]; }
};
// example-end add_a_picture_channel

// example-begin add_a_channel_of_gaussians
/// A label of one's own a Gaussian and its shortest axis in the camera's frame, blended as colours are; stored in half the bits.
template <class Mem>
struct LabelAndNormal {
  Kokkos::View<float*, Mem> labels;                                                // (Gaussians, in the order of the sets)
  Kokkos::View<Kokkos::Experimental::half_t****, Kokkos::LayoutRight, Mem> image;  // (C, H, W, 4)
  static constexpr int size = 4;
  template <class Seen>
  KOKKOS_FUNCTION void value(Seen const& g, float* out) const {
    gsp::Vec3<float> const s = g.scale();
    int const axis = s.x < s.y ? (s.x < s.z ? 0 : 2) : (s.y < s.z ? 1 : 2);
    gsp::Vec3<float> const n = g.to_camera() * gsp::column(gsp::to_matrix(g.quat()), axis);
    float const sign = n.z > 0 ? -1.f : 1.f;  // towards the camera
    out[0] = labels(g.index());
    for (int k = 0; k < 3; ++k) out[1 + k] = sign * n[k];
  }
  KOKKOS_FUNCTION void store(int c, int row, int column, float const* pixel) const {
    for (int k = 0; k < size; ++k) image(c, row, column, k) = Kokkos::Experimental::half_t(pixel[k]);
  }
};
// example-end add_a_channel_of_gaussians

static_assert(gsp::PictureChannel<MedianDepth<Kokkos::HostSpace>> && gsp::PictureChannel<LabelAndNormal<Kokkos::HostSpace>>);
static_assert(gsp::PictureChannel<gsp::RgbChannel<Kokkos::HostSpace>> && !gsp::PictureChannel<gsp::Splat>);

// example-begin read_a_force
/// The forces of the ropes [N]: impulses of the last step over its length. A sensor reads them on the device, one world at a time.
template <class R, class Mem>
struct Pulls {
  gsp::ElementImpulses<R, Mem> impulses;
  R timestep;
  int count() const { return 2; }
  KOKKOS_FUNCTION int size() const { return 1; }
  template <class Put>
  KOKKOS_FUNCTION void operator()(int world, int k, Put const& put) const {
    put(0, impulses(world, k) / timestep);
  }
};
// example-end read_a_force

static_assert(gsp::ConstraintType<Ropes<float, Kokkos::HostSpace>> && !gsp::ConstraintType<gsp::OneFreeRow>);

static_assert(gsp::ActuatorLaw<DcMotor> && gsp::ActuatorLaw<Network<Kokkos::HostSpace>> && !gsp::ActuatorLaw<gsp::Splat>);

static_assert(gsp::SensorKind<Range<Kokkos::HostSpace>> && gsp::SensorKind<Touch<Kokkos::HostSpace>>);
static_assert(!gsp::SensorKind<gsp::Poses<float, Kokkos::HostSpace>>);

/// Two balls over a floor, at (w / 4, 0, z) and (0, 3, z) in world w; the first 1 cm in the floor in odd worlds.
template <class Exec>
struct Balls {
  static constexpr int worlds = 19;  // not a multiple of any pack
  using Mem = typename Exec::memory_space;
  Exec exec;
  gsp::CompiledModel compiled = gsp::compile(description());
  gsp::Model<float, Mem> model = gsp::make_model<float>(exec, compiled);
  gsp::State<float, Mem> state = gsp::make_state(exec, model, {.worlds = worlds});
  gsp::Dynamics<float, Mem> dynamics = gsp::make_dynamics(exec, model, {.worlds = worlds});
  gsp::Poses<float, Mem> poses = gsp::make_poses(exec, model, {.worlds = worlds});
  static gsp::Description description() {
    gsp::Description d;
    gsp::GeomDescription floor;
    floor.type = gsp::ShapeType::plane;
    floor.size = {0, 0, 1};
    d.bodies[0].geoms = {floor};
    for (char const* name : {"first", "second"}) {
      int const b = gsp::add_body(d, 0, name, {0, 0, 1});
      d.bodies[b].joints.push_back({.name = name, .type = gsp::JointType::free});
      d.bodies[b].geoms.push_back({.size = {0.1, 0, 0}});
    }
    d.sensors.push_back({.type = "clock"});
    d.sensors.push_back({.name = "mine", .type = "user", .settings = {{"dim", "1"}}});
    return d;
  }
  static float low(int w) { return w % 2 ? 0.09f : 0.5f; }
  Balls() {
    auto const qpos = Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, state.qpos);
    for (int w = 0; w < worlds; ++w) {
      float const q[] = {0.25f * w, 0, low(w), 1, 0, 0, 0, 0, 3, 0.5f, 1, 0, 0, 0};
      std::copy(std::begin(q), std::end(q), &qpos(w, 0));
    }
    Kokkos::deep_copy(state.qpos, qpos);
    gsp::forward_kinematics(exec, model, state, poses, dynamics);
  }
};

/// Two wheels on axles of the world, each with an actuator that says nothing but what it acts on.
gsp::Description wheels(double inertia) {
  gsp::Description d;
  for (char const* name : {"first", "second"}) {
    int const b = gsp::add_body(d, 0, name, {0, 0, 1});
    d.bodies[b].joints.push_back({.name = name, .type = gsp::JointType::hinge});
    d.bodies[b].has_inertial = true;
    d.bodies[b].inertial.mass = 1, d.bodies[b].inertial.inertia = {inertia, inertia, inertia, 0, 0, 0};
    d.actuators.push_back({.name = name, .target_name = name});
  }
  return d;
}

}  // namespace

TEST_CASE("nothing here comes from detail") {
  std::ifstream file(std::string(GSP_TEST_DIR) + "/library/extend.cpp");
  int includes = 0;
  for (std::string line; std::getline(file, line);) {
    if (line.rfind("#include <gsp/", 0) == 0) ++includes;
    CHECK_MESSAGE(line.find(std::string("/det") + "ail/") == std::string::npos, line);
    CHECK_MESSAGE(line.find(std::string("det") + "ail::") == std::string::npos, line);
  }
  CHECK(includes > 3);
}

// Two balls hang below each other on two ropes; in odd worlds the lower one first falls 0.2 m until its rope is taut.
//   at rest: lower rope m g, upper rope 2 m g; while the lower ball falls: 0 and m g
// Heights are rounded by 4e-16 m, which a step makes good by a force of m x / h^2: 4e-16 / (g h^2) = 4e-13 of the weight a rope.
TEST_CASE_TEMPLATE("a constraint from outside", Exec, GSP_TEST_EXECS) {
  using Mem = typename Exec::memory_space;
  Exec const exec;
  int const worlds = 19;
  double const length = 1, top = 3, h = 0.01;
  auto const compiled = gsp::compile(Balls<Exec>::description());
  auto const model = gsp::make_model<double>(exec, compiled, {.timestep = h});
  auto state = gsp::make_state(exec, model, {.worlds = worlds});
  auto dynamics = gsp::make_dynamics(exec, model, {.worlds = worlds});
  auto poses = gsp::make_poses(exec, model, {.worlds = worlds});
  auto rows = gsp::make_rows(exec, model, {.worlds = worlds});
  auto impulses = gsp::make_impulses(exec, rows);
  auto solution = gsp::make_solution(exec, model, {.worlds = worlds});
  auto progress = gsp::make_progress(exec);
  auto const qpos = Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, state.qpos);
  for (int w = 0; w < worlds; ++w) {
    double const q[] = {0, 0, top - length, 1, 0, 0, 0, 0, 0, top - 2 * length + 0.2 * (w % 2), 1, 0, 0, 0};
    std::copy(std::begin(q), std::end(q), &qpos(w, 0));
  }
  Kokkos::deep_copy(state.qpos, qpos);

  using Mine = Ropes<double, Mem>;
  Mine const ropes{{}, poses, {0, 0, top}, length, 2};
  Kokkos::View<double**, Kokkos::LayoutRight, Mem> const force("force", worlds, 2);
  double const weight = compiled.body_mass[1] * 9.81;
  for (int t = 0; t < 40;) {  // it falls for 0.2 s
    gsp::smooth_dynamics(exec, model, state, poses, dynamics);
    gsp::assemble(exec, model, state, dynamics, gsp::constraints(ropes), rows, impulses, progress);
    gsp::pgs(exec, rows, impulses, solution, progress, {.iterations = 100, .tolerance = 0});
    gsp::integrate(exec, model, state, dynamics, progress, solution);
    if (gsp::grow(exec, rows, impulses, progress)) continue;
    ++t;
    if (t != 10 && t != 40) continue;
    Pulls<double, Mem> const pulls{gsp::impulses_of<Mine>(rows, impulses), h};
    gsp::sense(exec, pulls, force);
    auto const found = Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, force);
    for (int w = 0; w < worlds; ++w) {
      bool const falls = w % 2 == 1 && t == 10;
      CHECK(found(w, 0) == doctest::Approx(falls ? weight : 2 * weight).epsilon(1e-11));
      CHECK(found(w, 1) == doctest::Approx(falls ? 0 : weight).epsilon(1e-11));
    }
  }

  // at rest the last step's impulses are right; from zero each sweep halves what is left of h g = 0.1 m/s, to 3e-3 m/s after five; then
  // the differences of the last sweeps are mixed, which span all that is left of two ropes, and one more sweep finds it done
  auto const sweeps = [&](gsp::Impulses<double, Mem>& start) {
    gsp::smooth_dynamics(exec, model, state, poses, dynamics);
    gsp::assemble(exec, model, state, dynamics, gsp::constraints(ropes), rows, start, progress);
    gsp::pgs(exec, rows, start, solution, progress, {.least = 1, .tolerance = 1e-5f});
    return Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, solution.iterations)(worlds - 1);
  };
  auto cold = gsp::make_impulses(exec, rows);
  CHECK(sweeps(impulses) <= 2);
  CHECK(sweeps(cold) == 6);
}

// A motor on a wheel: while its current is limited, w+ = w + h k limit / I; then the implicit Euler step, w+ = w + h k (U - k w+) / (R I).
// A hundred steps from numbers of up to 20: 100 x 20 x 2e-16 = 4e-13. The network holds its wheel to what the same formula gives on the
// host; both in turn, so that the second wheel shows that the last law named counts.
TEST_CASE_TEMPLATE("actuator laws from outside", Exec, GSP_TEST_EXECS) {
  using Mem = typename Exec::memory_space;
  Exec const exec;
  int const worlds = 19;
  double const inertia = 0.02, h = 0.01, k = 0.5, resistance = 2, limit = 3;
  auto const compiled = gsp::compile(wheels(inertia));
  auto const model = gsp::make_model<double>(exec, compiled, {.timestep = h});
  auto state = gsp::make_state(exec, model, {.worlds = worlds});
  auto dynamics = gsp::make_dynamics(exec, model, {.worlds = worlds});
  auto poses = gsp::make_poses(exec, model, {.worlds = worlds});
  auto const ctrl = Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, state.ctrl);
  for (int w = 0; w < worlds; ++w) ctrl(w, 0) = 0.5 * w, ctrl(w, 1) = 0.1 * w;
  Kokkos::deep_copy(state.ctrl, ctrl);

  DcMotor const motor{k, resistance, limit};
  Network<Mem> network{decltype(Network<Mem>::inner)("inner"), decltype(Network<Mem>::outer)("outer"), {"errors", worlds, 1}};
  double const inner[4][3] = {{2, -1, -0.1}, {1, 1, -0.2}, {0.5, 0, -0.5}, {3, -3, 0}}, outer[4] = {0.3, 0.5, 0.2, 0.1};
  auto const weights = Kokkos::create_mirror_view(network.inner);
  auto const sums = Kokkos::create_mirror_view(network.outer);
  auto const errors = Kokkos::create_mirror_view(network.errors);
  for (int i = 0; i < 4; ++i) {
    sums(i) = outer[i];
    for (int c = 0; c < 3; ++c) weights(i, c) = inner[i][c];
  }
  Kokkos::deep_copy(network.inner, weights), Kokkos::deep_copy(network.outer, sums);

  std::vector<double> speed(worlds, 0.), angle(worlds, 0.), rate(worlds, 0.), before(worlds, 0.);
  int limited = 0, free = 0;
  for (int t = 0; t < 100; ++t) {
    gsp::smooth_dynamics(exec, model, state, poses, dynamics, {}, motor, network);
    gsp::integrate(exec, model, state, dynamics);
    for (int w = 0; w < worlds; ++w) {
      double const U = ctrl(w, 0);
      bool const full = (U - k * speed[w]) / resistance > limit;
      ++(full ? limited : free);
      speed[w] = full ? speed[w] + h * k * limit / inertia
                      : (speed[w] + h * k * U / (resistance * inertia)) / (1 + h * k * k / (resistance * inertia));
      double const error = ctrl(w, 1) - angle[w];
      double torque = 0, stiffness = 0, damping = 0;
      for (int i = 0; i < 4; ++i) {
        double const x = inner[i][0] * error + inner[i][1] * before[w] + inner[i][2] * rate[w], root = std::sqrt(1 + x * x);
        torque += outer[i] * x / root;
        stiffness += outer[i] * inner[i][0] / (root * root * root);
        damping -= outer[i] * inner[i][2] / (root * root * root);
      }
      rate[w] += h * (torque - h * stiffness * rate[w]) / (inertia + h * damping + h * h * stiffness);
      angle[w] += h * rate[w];
      before[w] = errors(w, 0) = error;
    }
    Kokkos::deep_copy(network.errors, errors);  // one's own memory moves on after the step
  }
  auto const qvel = Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, state.qvel);
  for (int w = 0; w < worlds; ++w) {
    CHECK(std::abs(qvel(w, 0) - speed[w]) < 4e-13);
    CHECK(std::abs(qvel(w, 1) - rate[w]) < 4e-13);
  }
  CHECK(limited > 10);
  CHECK(free > 100);
}

// Distances of a few metres in float: four roundings.
TEST_CASE_TEMPLATE("a sensor from outside", Exec, GSP_TEST_EXECS) {
  Balls<Exec> const s;
  using Mem = typename Exec::memory_space;
  Kokkos::View<float**, Kokkos::LayoutRight, Mem> const data("data", s.worlds, s.compiled.nsensordata), touch("touch", s.worlds, 8);
  Kokkos::deep_copy(data, 77.f), Kokkos::deep_copy(touch, 77.f);
  gsp::sense(s.exec, Range<Mem>{s.poses, 1, 2}, data, {.adr = s.compiled.sensor_adr[1]});
  auto const collision = gsp::make_collision_model<float>(s.exec, s.compiled);
  auto contacts = gsp::make_contacts(s.exec, collision, {.worlds = s.worlds});
  gsp::collide(s.exec, collision, s.poses, contacts);
  gsp::sense(s.exec, Touch<Mem>{contacts, 3}, touch, {.adr = 1});
  CHECK_THROWS_WITH_AS(gsp::sense(s.exec, Touch<Mem>{contacts, 3}, touch, {.adr = 3}), doctest::Contains("do not fit into data with 8"),
                       std::invalid_argument);
  for (int rows : {s.worlds - 1, s.worlds + 1}) {
    Kokkos::View<float**, Kokkos::LayoutRight, Mem> const other("other", rows, 8);
    std::string const start = "gsp::sense: data has " + std::to_string(rows) + " rows, and the sensor's ";
    CHECK_THROWS_WITH_AS(gsp::sense(s.exec, Range<Mem>{s.poses, 1, 2}, other), doctest::Contains((start + "`poses` 19 worlds").c_str()),
                         std::invalid_argument);
    CHECK_THROWS_WITH_AS(gsp::sense(s.exec, Touch<Mem>{contacts, 3}, other), doctest::Contains((start + "`contacts` 19 worlds").c_str()),
                         std::invalid_argument);
  }

  auto const found = Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, data);
  auto const touched = Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, touch);
  for (int w = 0; w < s.worlds; ++w) {
    CHECK(found(w, 0) == 77);  // the clock's
    CHECK(found(w, 1) == doctest::Approx(std::hypot(0.25 * w, 3, double(s.low(w)) - 0.5)).epsilon(2.4e-7));
    bool const inside = w % 2 == 1;
    float const want[] = {77, float(inside), inside ? 0.01f : 0.f, float(inside), inside ? 0.01f : 0.f, 0, 0, 77};
    for (int c = 0; c < 8; ++c) CHECK(touched(w, c) == doctest::Approx(want[c]).epsilon(1e-5));
  }
}

// Three flat walls across the view, 2, 3 and 4 m before the camera: opacities 0.3, 0.5 and 0.9 all over the middle of the picture, each one
// Gaussian of 100 m. The wall at 3 m is carried by body 1, which is turned by 180 degrees about the camera's axis and lies 1 m ahead.
//   light: 1 -> 0.7 -> 0.35 -> 0.035; weights 0.3, 0.35, 0.315; the light falls below a half at 3 m
TEST_CASE_TEMPLATE("picture channels from outside", Exec, GSP_TEST_EXECS) {
  using Mem = typename Exec::memory_space;
  Exec const exec;
  gsp::GaussianSet set;
  float const depth[] = {4, 3, 2}, opacity[] = {0.9f, 0.5f, 0.3f}, red[] = {0.25f, 0.5f, 1.f};
  for (int i = 0; i < 3; ++i) {
    bool const carried = i == 1;
    float const c0 = (red[i] - 0.5f) / 0.28209479f;
    set.positions.insert(set.positions.end(), {0, 0, depth[i] - float(carried)});
    set.quats.insert(set.quats.end(), {1, 0, 0, 0});
    set.scales.insert(set.scales.end(), {100, 100, 0.001f});
    set.opacities.push_back(opacity[i]);
    set.sh.insert(set.sh.end(), {c0, 0, 0});
    set.body.push_back(carried);
  }
  auto const cloud = gsp::make_gaussians(exec, set);
  int const width = 21, height = 19;
  auto poses = gsp::make_poses<float>(exec, 1, 2, 0);
  auto const xpos = Kokkos::create_mirror_view(poses.xpos), xquat = Kokkos::create_mirror_view(poses.xquat);
  Kokkos::deep_copy(xpos, poses.xpos), Kokkos::deep_copy(xquat, poses.xquat);
  xpos(0, 1, 2) = 1;
  xquat(0, 1, 0) = 0;
  xquat(0, 1, 3) = 1;
  Kokkos::deep_copy(poses.xpos, xpos), Kokkos::deep_copy(poses.xquat, xquat);
  std::vector<float> const view{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1}, K{20, 0, 10.5f, 0, 20, 9.5f, 0, 0, 1};
  auto const cameras = gsp::make_cameras(exec, view, K);
  auto plain = gsp::make_frames(exec, cloud, {.width = width, .height = height});
  gsp::render(exec, cloud, poses, cameras, plain);

  MedianDepth<Mem> const median{Kokkos::View<float***, Kokkos::LayoutRight, Mem>("median", 1, height, width)};
  LabelAndNormal<Mem> label{Kokkos::View<float*, Mem>("labels", 3),
                            Kokkos::View<Kokkos::Experimental::half_t****, Kokkos::LayoutRight, Mem>("label", 1, height, width, 4)};
  auto const labels = Kokkos::create_mirror_view(label.labels);
  for (int i = 0; i < 3; ++i) labels(i) = red[i];
  Kokkos::deep_copy(label.labels, labels);
  auto frames = gsp::make_frames(exec, cloud, {.width = width, .height = height});
  CHECK_THROWS_WITH_AS(gsp::project(exec, cloud, frames, {}, median, label), doctest::Contains("keep 4 numbers of each Gaussian"),
                       std::invalid_argument);
  for (auto const& [images, rows, columns] : {std::array{1, 5, 7}, std::array{2, height, width}, std::array{0, 0, 0}}) {
    MedianDepth<Mem> const other{Kokkos::View<float***, Kokkos::LayoutRight, Mem>("other", images, rows, columns)};
    auto const wrong = doctest::Contains("and the pictures are (images, height, width) = (1, 19, 21)");
    CHECK_THROWS_WITH_AS(gsp::render(exec, cloud, poses, cameras, frames, {}, other), wrong, std::invalid_argument);
    CHECK_THROWS_WITH_AS(gsp::rasterize(exec, frames, {}, other), wrong, std::invalid_argument);
  }
  gsp::render(exec, cloud, poses, cameras, frames, {}, median, label);

  auto const host = [](auto const& v) { return Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, v); };
  auto const rgb = host(frames.rgb), rgb0 = host(plain.rgb);
  auto const z = host(frames.depth), z0 = host(plain.depth), alpha = host(frames.alpha), alpha0 = host(plain.alpha);
  auto const median_z = host(median.image);
  auto const numbers = host(label.image);
  bool same = true;
  for (int row = 0; row < height; ++row)
    for (int column = 0; column < width; ++column) {
      same = same && z(0, row, column) == z0(0, row, column) && alpha(0, row, column) == alpha0(0, row, column);
      for (int k = 0; k < 3; ++k) same = same && rgb(0, row, column, k) == rgb0(0, row, column, k);
      // the walls fade by less than 2e-4 towards the corners of the picture; half_t rounds by 5e-4
      CHECK(median_z(0, row, column) == 3);
      CHECK(alpha(0, row, column) == doctest::Approx(0.965).epsilon(5e-4));
      CHECK(float(numbers(0, row, column, 0)) == doctest::Approx(rgb(0, row, column, 0)).epsilon(6e-4));
      CHECK(rgb(0, row, column, 0) == doctest::Approx(0.3 * 1 + 0.35 * 0.5 + 0.315 * 0.25).epsilon(1e-3));
      CHECK(float(numbers(0, row, column, 3)) == doctest::Approx(-0.965).epsilon(1e-3));
      CHECK(std::abs(float(numbers(0, row, column, 1))) + std::abs(float(numbers(0, row, column, 2))) < 1e-3);
    }
  CHECK(same);  // further channels change nothing of the others
}
