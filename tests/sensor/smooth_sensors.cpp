// Each kind of sensor against public functions that give the same in another way: poses, Jacobians times velocities, M. (Against MuJoCo:
// tests/oracle/sensors.cpp.)
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <gsp/dynamics/jacobian.hpp>
#include <gsp/dynamics/smooth.hpp>
#include <gsp/sensor/smooth_sensors.hpp>
#include <gsp_test_execs.hpp>

#include "dynamics/random_tree.hpp"
#include "sensor/sensor_scene.hpp"
#include "support/kernels.hpp"

namespace {
using gsp::JointType;

/// Two trees with every joint type; a site on each body, two cameras, a tendon, motors.
gsp::Description description() {
  auto d = gsp_test::random_model({JointType::free, JointType::hinge}, 7, 7);
  d.option.magnetic = {0.3, -0.5, 0.2};
  gsp_test::Random r;
  for (auto& body : d.bodies) {
    gsp::SiteDescription site;
    site.name = body.name, site.pos = {0.1 * r(), 0.1 * r(), 0.1 * r()}, site.quat = gsp_test::random_quat(r);
    body.sites.push_back(site);
  }
  gsp::CameraDescription fixed, tracking;
  fixed.name = "fixed", fixed.pos = {0.1, 0.2, 0.3}, fixed.quat = gsp_test::random_quat(r), fixed.resolution = {640, 480};
  tracking.name = "tracking", tracking.mode = gsp::CameraMode::track_com, tracking.pos = {0, -2, 0.5};
  d.bodies[3].cameras = {fixed, tracking};
  gsp::TendonDescription t;
  t.name = "t", t.terms = {{"t1b0j0", 0.7}, {"t1b1j0", -1.3}};
  d.tendons.push_back(t);
  gsp::ActuatorDescription a;
  a.name = a.target_name = "t1b1j0", a.gear[0] = 2;
  d.actuators.push_back(a);
  return d;
}

struct Sensed {
  char const *type, *object_type = "", *object = "", *reference_type = "", *reference = "";
  double cutoff = 0;
};
Sensed const sensed[] = {{"clock"},
                         {"e_potential"},
                         {"e_kinetic"},
                         {"touch", "site", "t0b1"},
                         {"jointpos", "joint", "t1b1j0"},
                         {"jointvel", "joint", "t1b1j0"},
                         {"ballquat", "joint", "t1b6j0"},
                         {"ballangvel", "joint", "t1b6j0"},
                         {"tendonpos", "tendon", "t"},
                         {"tendonvel", "tendon", "t"},
                         {"actuatorpos", "actuator", "t1b1j0"},
                         {"actuatorvel", "actuator", "t1b1j0"},
                         {"actuatorfrc", "actuator", "t1b1j0"},
                         {"jointactuatorfrc", "joint", "t1b1j0"},
                         {"tendonactuatorfrc", "tendon", "t"},
                         {"framepos", "site", "t0b3", "site", "t1b2"},
                         {"framepos", "site", "t0b3", "camera", "tracking"},
                         {"framequat", "site", "t0b3", "site", "t1b2"},
                         {"framexaxis", "site", "t0b3", "site", "t1b2"},
                         {"frameyaxis", "camera", "tracking"},
                         {"framelinvel", "site", "t0b3", "site", "t1b2"},
                         {"frameangvel", "site", "t0b3", "site", "t1b2"},
                         {"velocimeter", "site", "t0b3", "", "", 0.25},
                         {"gyro", "site", "t1b2"},
                         {"magnetometer", "site", "t1b2"},
                         {"camprojection", "site", "t0b3", "camera", "fixed"},
                         {"subtreecom", "body", "t0b1"},
                         {"subtreelinvel", "body", "t0b1"},
                         {"subtreeangmom", "body", "t0b1"}};

template <class Exec>
struct Worlds {
  static constexpr int worlds = 19;
  using Mem = typename Exec::memory_space;
  template <class D>
  using View = Kokkos::View<D, Kokkos::LayoutRight, Mem>;
  Exec exec;
  gsp::CompiledModel compiled;
  gsp::Model<double, Mem> model;
  gsp::State<double, Mem> state;
  gsp::Dynamics<double, Mem> dynamics;
  gsp::Poses<double, Mem> poses;
  explicit Worlds(gsp::Description const& d)
      : compiled(gsp::compile(d)),
        model(gsp::make_model<double>(exec, compiled, {.profile = gsp::Profile::mujoco})),
        state(gsp::make_state(exec, model, {.worlds = worlds})),
        dynamics(gsp::make_dynamics(exec, model, {.worlds = worlds})),
        poses(gsp::make_poses(exec, model, {.worlds = worlds})) {
    gsp_test::randomise(compiled, state);
    auto const ctrl = gsp_test::host(state.ctrl);
    auto const steps = gsp_test::host(state.steps);
    auto const low = gsp_test::host(state.qpos_low);  // which lengths have, too
    for (int w = 0; w < worlds; ++w) {
      ctrl(w, 0) = std::sin(w), steps(w) = 3 * w;
      for (int j = 0; j < compiled.njnt; ++j)
        if (compiled.jnt_type[j] >= int(gsp::JointType::slide)) low(w, compiled.jnt_qposadr[j]) = 1e-3 * std::cos(w + j);
    }
    Kokkos::deep_copy(state.ctrl, ctrl), Kokkos::deep_copy(state.steps, steps), Kokkos::deep_copy(state.qpos_low, low);
    gsp::smooth_dynamics(exec, model, state, poses, dynamics, {.keep_all = true});
  }
  int site(std::string const& name) const {
    return int(std::find(compiled.site_name.begin(), compiled.site_name.end(), name) - compiled.site_name.begin());
  }
  /// (world, 6): linear and angular velocity of a site.
  std::vector<std::array<double, 6>> velocity(int site) const {
    View<double***> J("J", worlds, 6, model.nv);
    gsp::site_jacobian(exec, model, poses, dynamics, site, J);
    auto const j = gsp_test::host(J);
    auto const v = gsp_test::host(state.qvel);
    std::vector<std::array<double, 6>> out(worlds);
    for (int w = 0; w < worlds; ++w)
      for (int c = 0; c < 6; ++c)
        for (int i = 0; i < model.nv; ++i) out[w][c] += j(w, c, i) * v(w, i);
    return out;
  }
};
using V = gsp::Vec3<double>;
}  // namespace

// A hundred roundings of numbers below 10; a pixel is 1e3 times a quotient whose divisor is above 0.1 in these worlds.
TEST_CASE_TEMPLATE("sensors give what poses, Jacobians and forces give", Exec, GSP_TEST_EXECS) {
  auto d = description();
  for (auto const& s : sensed)
    d.sensors.push_back({.type = s.type,
                         .object_type = s.object_type,
                         .object = s.object,
                         .reference_type = s.reference_type,
                         .reference = s.reference,
                         .cutoff = s.cutoff});
  using Set = Worlds<Exec>;
  Set s(d);
  auto const& c = s.compiled;
  int const n = Set::worlds;
  auto sensors = gsp::make_sensors(s.exec, s.model, c, {.worlds = n});
  CHECK(sensors.left_out.empty());
  typename Set::template View<double**> const data("data", n, c.nsensordata), energy("energy", n, 2), actuator("actuator", n, c.nv);
  Kokkos::deep_copy(data, 77.);
  gsp::smooth_sensors(s.exec, s.model, s.state, s.poses, s.dynamics, sensors, data);
  typename Set::template View<double**> const narrow("narrow", n, 1);
  std::string const sizes = "data is (" + std::to_string(n) + ", 1) and must be (worlds, nsensordata), here (" + std::to_string(n) + ", " +
                            std::to_string(c.nsensordata) + ")";
  CHECK_THROWS_WITH_AS(gsp::smooth_sensors(s.exec, s.model, s.state, s.poses, s.dynamics, sensors, narrow),
                       doctest::Contains(sizes.c_str()), std::invalid_argument);
  auto fewer = d;
  fewer.sensors.clear();
  fewer.actuators.clear();
  auto const elsewhere = gsp::make_model<double>(s.exec, gsp::compile(fewer));
  CHECK_THROWS_WITH_AS(gsp::smooth_sensors(s.exec, elsewhere, s.state, s.poses, s.dynamics, sensors, data),
                       doctest::Contains("the sensors were made for another model: make_sensors with this"), std::invalid_argument);

  typename Set::template View<double***> const x("x", n, c.nsite, 3), q("q", n, c.nsite, 4), cam("cam", n, c.ncam, 3),
      mat("mat", n, c.ncam, 9), M("M", n, c.nv, c.nv);
  auto subtrees = gsp::make_subtrees(s.exec, s.model, {.worlds = n});
  gsp::subtree_com(s.exec, s.model, s.poses, subtrees), gsp::subtree_momentum(s.exec, s.model, s.poses, s.dynamics, subtrees);
  gsp::site_poses(s.exec, s.model, s.poses, x, q), gsp::camera_poses(s.exec, s.model, s.poses, subtrees.com, cam, mat);
  gsp::dense_mass_matrix(s.exec, s.model, s.dynamics, M), gsp::energies(s.exec, s.model, s.state, s.poses, s.dynamics, energy);
  gsp::copy_dofs(s.exec, s.model, s.dynamics, &gsp::DynamicsLayout::actuator, actuator);
  int const a = s.site("t0b3"), b = s.site("t1b2"), body = c.site_body[s.site("t0b1")];
  auto const va = s.velocity(a), vb = s.velocity(b);

  auto const found = gsp_test::host(data), energies = gsp_test::host(energy), force = gsp_test::host(actuator);
  auto const xs = gsp_test::host(x), qs = gsp_test::host(q), cams = gsp_test::host(cam), mats = gsp_test::host(mat), Ms = gsp_test::host(M);
  auto const com = gsp_test::host(subtrees.com), linvel = gsp_test::host(subtrees.linvel), angmom = gsp_test::host(subtrees.angmom);
  auto const qpos = gsp_test::host(s.state.qpos), low = gsp_test::host(s.state.qpos_low), qvel = gsp_test::host(s.state.qvel),
             ctrl = gsp_test::host(s.state.ctrl);
  auto const joint = [&](char const* name) { return int(std::find(c.jnt_name.begin(), c.jnt_name.end(), name) - c.jnt_name.begin()); };
  int const h0 = joint("t1b0j0"), h1 = joint("t1b1j0"), ball = joint("t1b6j0"), dof = c.jnt_dofadr[h1];
  double worst = 0;
  for (int w = 0; w < n; ++w) {
    auto const row3 = [&](auto const& v, int i) { return V{v(w, i, 0), v(w, i, 1), v(w, i, 2)}; };
    auto const turn = [&](int i) { return gsp::Quat<double>{qs(w, i, 0), qs(w, i, 1), qs(w, i, 2), qs(w, i, 3)}; };
    auto const turned = [&](int i) {  // axes of a camera
      gsp::Mat3<double> r;
      for (int k = 0; k < 9; ++k) r.m[k] = mats(w, i, k);
      return r;
    };
    auto const angle = [&](int j) { return qpos(w, c.jnt_qposadr[j]) + low(w, c.jnt_qposadr[j]); };
    double kinetic = 0;
    for (int i = 0; i < c.nv; ++i)
      for (int j = 0; j < c.nv; ++j) kinetic += 0.5 * qvel(w, i) * Ms(w, i, j) * qvel(w, j);
    auto const Ra = gsp::to_matrix(turn(a)), Rb = gsp::to_matrix(turn(b));
    V const xa = row3(xs, a), xb = row3(xs, b), la{va[w][0], va[w][1], va[w][2]}, lb{vb[w][0], vb[w][1], vb[w][2]},
            wa{va[w][3], va[w][4], va[w][5]}, wb{vb[w][3], vb[w][4], vb[w][5]};
    V const seen = gsp::transpose_times(turned(0), xa - row3(cams, 0));
    double const focal = 240 / std::tan(0.7853981633974483 / 2);
    std::vector<double> want;
    auto const add = [&](double v) { want.push_back(v); };
    auto const add3 = [&](V const& v) { add(v.x), add(v.y), add(v.z); };
    auto const clamped = [](double v) { return std::fmin(std::fmax(v, -0.25), 0.25); };
    add(3 * w * c.option.timestep), add(energies(w, 0)), add(kinetic), add(77);
    add(angle(h1)), add(qvel(w, dof));
    for (int k = 0; k < 4; ++k) add(qpos(w, c.jnt_qposadr[ball] + k));
    for (int k = 0; k < 3; ++k) add(qvel(w, c.jnt_dofadr[ball] + k));
    add(0.7 * angle(h0) - 1.3 * angle(h1)), add(0.7 * qvel(w, c.jnt_dofadr[h0]) - 1.3 * qvel(w, dof));
    add(2 * angle(h1)), add(2 * qvel(w, dof)), add(ctrl(w, 0)), add(force(w, dof)), add(0);
    add3(gsp::transpose_times(Rb, xa - xb)), add3(gsp::transpose_times(turned(1), xa - row3(cams, 1)));
    auto const qa = turn(a), qb = turn(b);  // R_b^T R_a: its quaternion from products of the two
    add(qb.w * qa.w + qb.x * qa.x + qb.y * qa.y + qb.z * qa.z), add(qb.w * qa.x - qb.x * qa.w - qb.y * qa.z + qb.z * qa.y);
    add(qb.w * qa.y + qb.x * qa.z - qb.y * qa.w - qb.z * qa.x), add(qb.w * qa.z - qb.x * qa.y + qb.y * qa.x - qb.z * qa.w);
    add3(gsp::transpose_times(Rb, gsp::column(Ra, 0))), add3(gsp::column(turned(1), 1));
    add3(gsp::transpose_times(Rb, la - lb - gsp::cross(wb, xa - xb))), add3(gsp::transpose_times(Rb, wa - wb));
    V const own = gsp::transpose_times(Ra, la);
    add(clamped(own.x)), add(clamped(own.y)), add(clamped(own.z));
    add3(gsp::transpose_times(Rb, wb)), add3(gsp::transpose_times(Rb, V{0.3, -0.5, 0.2}));
    add(320 - focal * seen.x / seen.z), add(240 + focal * seen.y / seen.z);
    add3(row3(com, body)), add3(row3(linvel, body)), add3(row3(angmom, body));
    REQUIRE(int(want.size()) == c.nsensordata);
    CHECK(std::abs(seen.z) > 0.1);
    for (int i = 0; i < c.nsensordata; ++i) worst = std::fmax(worst, std::abs(found(w, i) - want[i]) / std::fmax(1, std::abs(want[i])));
  }
  CHECK(worst < 1e-11);
}

// Columns of wider rows, and worlds that run fastest: the same bits, and what lies beside them stays.
TEST_CASE_TEMPLATE("numbers go to views of any layout", Exec, GSP_TEST_EXECS) {
  auto d = description();
  d.sensors = {{.type = "gyro", .object_type = "site", .object = "t1b2"}, {.type = "jointpos", .object_type = "joint", .object = "t1b1j0"}};
  using Set = Worlds<Exec>;
  Set s(d);
  int const n = Set::worlds, columns = s.compiled.nsensordata;
  REQUIRE(columns == 4);
  auto sensors = gsp::make_sensors(s.exec, s.model, s.compiled, {.worlds = n});
  auto const read = [&](auto const& data) { gsp::smooth_sensors(s.exec, s.model, s.state, s.poses, s.dynamics, sensors, data); };
  typename Set::template View<double**> const plain("plain", n, columns), wide("wide", n, columns + 5);
  Kokkos::View<double**, Kokkos::LayoutLeft, typename Set::Mem> const left("left", n, columns), wide_left("wide_left", n + 2, columns + 5);
  Kokkos::deep_copy(wide, 77.), Kokkos::deep_copy(wide_left, 77.);
  read(plain), read(left);
  read(Kokkos::subview(wide, Kokkos::ALL, std::pair(2, 2 + columns)));
  read(Kokkos::subview(wide_left, std::pair(1, 1 + n), std::pair(2, 2 + columns)));
  auto const want = gsp_test::host(plain), found = gsp_test::host(wide);
  auto const of_left = gsp_test::host(left), of_wide = gsp_test::host(wide_left);
  for (int w = 0; w < n; ++w) {
    for (int c = 0; c < columns; ++c) {
      CHECK(of_left(w, c) == want(w, c));
      CHECK(found(w, 2 + c) == want(w, c));
      CHECK(of_wide(1 + w, 2 + c) == want(w, c));
    }
    for (int const c : {0, 1, columns + 2, columns + 4}) CHECK((found(w, c) == 77 && of_wide(1 + w, c) == 77));
  }
  for (int c = 0; c < columns + 5; ++c) CHECK((of_wide(0, c) == 77 && of_wide(n + 1, c) == 77));
}

// MuJoCo's 1e-15 m in place of a depth of 0, away from the camera's back: pixel = 3/2 - f x / 1e-15, f = 2 / (2 tan(fovy / 2)) pixels of a
// picture of 2 rows.
TEST_CASE_TEMPLATE("a site in the plane of the camera is far out in the picture, and a number", Exec, GSP_TEST_EXECS) {
  gsp_test::SensedWorld<Exec> s(
      R"(<mujoco><worldbody><camera name="c" pos="0 0 1" resolution="3 2"/><site name="s" pos=".05 0 1"/><site name="same" pos="0 0 1"/><body pos="0 0 3"><joint/><geom size=".1"/></body></worldbody>
      <sensor><camprojection name="beside" site="s" camera="c"/><camprojection name="same" site="same" camera="c"/><camprojection name="cut" site="s" camera="c" cutoff="10"/></sensor></mujoco>)",
      gsp::Profile::stable);
  s.read();
  double const focal = 1 / std::tan(22.5 * 3.14159265358979323846 / 180);
  CHECK(std::abs(s("beside")[0] / (-focal * .05 / 1e-15) - 1) < 1e-12);
  CHECK(s("beside")[1] == 1);
  CHECK(gsp_test::away(s("same"), {1.5, 1}) == 0);
  CHECK(gsp_test::away(s("cut"), {-10, 1}) == 0);
}
