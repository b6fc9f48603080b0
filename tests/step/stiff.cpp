// What is too stiff for a step, in profile stable with its default settings: servos on tendons, ball joints and sites, springs and dampers
// of tendons, servos at the limit of their force, thick fluids. Each at steps of 2, 20 and 50 ms beside its closed form: where the forces
// balance, or the speed at which they do. Explicit they explode (the products h (h k + b) / m are 10 to 1e8, 2 is the bound), or swing for
// ever.
#include <doctest/doctest.h>

#include <cmath>
#include <gsp/model/compile.hpp>
#include <gsp/step/step.hpp>
#include <gsp_test_execs.hpp>

#include "step/world.hpp"

namespace test_types {
/// A user's springs and dampers between points of bodies, the law of a spatial tendon: tether k from `from[k]` of body a[k] to `to[k]` of
/// b[k].
template <class R, class Mem>
struct Tethers : gsp::OneFreeRow {
  gsp::Poses<R, Mem> poses;
  R stiffness, damping, length;
  gsp::Vec3<R> from[2], to[2];
  int a[2], b[2];
  KOKKOS_FUNCTION int count(int) const { return 2; }
  KOKKOS_FUNCTION gsp::Vec3<R> at(int world, int body, gsp::Vec3<R> const& p) const {
    gsp::Quat<R> const q{poses.xquat(world, body, 0), poses.xquat(world, body, 1), poses.xquat(world, body, 2),
                         poses.xquat(world, body, 3)};
    return gsp::Vec3<R>{poses.xpos(world, body, 0), poses.xpos(world, body, 1), poses.xpos(world, body, 2)} + gsp::rotate(q, p);
  }
  template <class T>
  KOKKOS_FUNCTION T lambda(int, int, int, T x, T u) const {
    return -(stiffness * x + damping * u);
  }
  template <class Row>
  KOKKOS_FUNCTION R jacobian(int world, int k, int, Row&& J) const {
    gsp::Vec3<R> const p = at(world, a[k], from[k]), q = at(world, b[k], to[k]), along = gsp::normalized(q - p);
    if (a[k] > 0) J.add_point(a[k], p, -along);
    J.add_point(b[k], q, along);
    return gsp::norm(q - p) - length;
  }
};
}  // namespace test_types

namespace {

constexpr double gravity = 9.81;
constexpr double all_steps[] = {0.002, 0.02, 0.05};

/// A ball of 1 kg and inertia 0.01 on joints of this type and these axes.
gsp::BodyDescription body(int parent, gsp::Double3 const& pos, gsp::Double3 const& center, double mass = 1, double inertia = 0.01) {
  gsp::BodyDescription b;
  b.parent = parent;
  b.pos = pos;
  b.has_inertial = true;
  b.inertial.pos = center;
  b.inertial.mass = mass;
  b.inertial.inertia = {inertia, inertia, inertia, 0, 0, 0};
  return b;
}
gsp::JointDescription& joint(gsp::BodyDescription& b, gsp::JointType type, gsp::Double3 const& axis, std::string const& name) {
  auto& j = b.joints.emplace_back();
  j.type = type;
  j.axis = axis;
  j.name = name;
  return j;
}
gsp::ActuatorDescription& servo(gsp::Description& d, gsp::Transmission target, std::string const& name, double kp, double kv,
                                double limit = 0) {
  auto& a = d.actuators.emplace_back();
  a.target = target;
  a.target_name = name;
  a.bias_type = gsp::ActuatorBias::affine;
  a.gainprm[0] = kp;
  a.biasprm[1] = -kp;
  a.biasprm[2] = -kv;
  a.force_limited = limit > 0;
  a.force_range = {-limit, limit};
  return a;
}
/// A pendulum of 1 kg: its centre `arm` from the hinge, straight down at 0.
gsp::BodyDescription pendulum(std::string const& name, double arm, double x = 0, int parent = 0) {
  auto b = body(parent, {x, 0, 0}, {0, 0, -arm});
  joint(b, gsp::JointType::hinge, {0, 1, 0}, name);
  return b;
}

template <class R, class Exec>
struct World : gsp_test::World<R, Exec> {
  using Base = gsp_test::World<R, Exec>;
  using Base::exec, Base::model, Base::state, Base::sim;
  World(gsp::Description const& d, double h, int worlds = 1) : Base(gsp::compile(d), worlds, {.timestep = h}) {}
  template <class View>
  void put(View const& view, std::vector<double> const& values) {
    auto const h = gsp_test::host(view);
    for (int w = 0; w < state.worlds; ++w)
      for (std::size_t i = 0; i < values.size(); ++i) h(w, i) = R(values[i]);
    Kokkos::deep_copy(view, h);
  }
  void run(double seconds) { gsp::step(exec, model, state, sim, {.steps = int(std::lround(seconds / double(model.timestep)))}); }
  double q(int i, int world = 0) const { return double(gsp_test::host(state.qpos)(world, i)); }
  double speed() const {
    auto const v = gsp_test::host(state.qvel);
    double most = 0;
    for (int w = 0; w < state.worlds; ++w)
      for (int i = 0; i < model.nv; ++i) most = std::max(most, std::isfinite(double(v(w, i))) ? std::abs(double(v(w, i))) : INFINITY);
    return most;
  }
};

/// Angle at which a torque kp (target - q) holds a pendulum's weight m g l sin q.
double hanging(double kp, double target, double weight) {
  double q = target;
  for (int i = 0; i < 100; ++i) q -= (kp * (target - q) - weight * std::sin(q)) / (-kp - weight * std::cos(q));
  return q;
}

}  // namespace

// Two sliders side by side, up and down: the tendon x - y / 2 pulls both. Servo and springs (k) of the sliders balance:
//   f = kp (u - x + y / 2),   k x = f - m g,   k y = -f / 2 - m g
TEST_CASE_TEMPLATE("a servo on a tendon of two branches comes to its target", Exec, GSP_TEST_EXECS) {
  double const kp = 1e8, k = 100, target = 0.3;
  auto const run = [&](auto real, double h, double kv) {
    using R = decltype(real);
    gsp::Description d;
    for (int i = 0; i < 2; ++i) {
      auto b = body(0, {double(i), 0, 0}, {0, 0, 0});
      auto& j = joint(b, gsp::JointType::slide, {0, 0, 1}, i == 0 ? "x" : "y");
      j.stiffness = k;
      j.damping = 20;
      d.bodies.push_back(b);
    }
    auto& t = d.tendons.emplace_back();
    t.name = "t";
    t.terms = {{"x", 1}, {"y", -0.5}};
    servo(d, gsp::Transmission::tendon, "t", kp, kv);
    World<R, Exec> w(d, h);
    w.put(w.state.ctrl, {target});
    w.run(4);
    double const f = kp * (target + gravity / k * 0.5) / (1 + kp * 1.25 / k);
    CAPTURE(h);
    CAPTURE(kv);
    double const tolerance = sizeof(R) == 4 ? 2e-5 : 1e-6;
    CHECK(w.q(0) == doctest::Approx((f - gravity) / k).epsilon(tolerance));
    CHECK(w.q(1) == doctest::Approx((-f / 2 - gravity) / k).epsilon(tolerance));
    CHECK(w.speed() < tolerance);
  };
  for (double h : all_steps)
    for (double kv : {0., 1e3}) {
      run(1., h, kv);
      run(1.f, h, kv);
    }
}

// A weight on two strings, ends of a spatial tendon: a spring of 1e6 with a damper of 1e5, and a servo of 1e8 beside it.
TEST_CASE_TEMPLATE("springs, dampers and servos of spatial tendons hold a weight", Exec, GSP_TEST_EXECS) {
  auto const run = [&](auto real, double h, bool driven) {
    using R = decltype(real);
    gsp::Description d;
    d.bodies[0].sites.emplace_back().name = "top";
    auto b = body(0, {0, 0, -1}, {0, 0, 0}, 2);
    for (int c = 0; c < 3; ++c)
      joint(b, gsp::JointType::slide, {double(c == 0), double(c == 1), double(c == 2)}, std::string(1, char('x' + c)));
    b.joints[0].damping = b.joints[1].damping = 5;
    b.sites.emplace_back().name = "hook";
    d.bodies.push_back(b);
    auto& t = d.tendons.emplace_back();
    t.name = "t";
    t.path = {{gsp::WrapType::site, "top"}, {gsp::WrapType::site, "hook"}};
    if (driven)
      servo(d, gsp::Transmission::tendon, "t", 1e8, 0);
    else {
      t.stiffness = 1e6;
      t.damping = 1e5;
      t.springlength = {0.8, 0.8};
    }
    World<R, Exec> w(d, h);
    w.put(w.state.ctrl, {0.8});
    w.put(w.state.qvel, {0.5, 0, 0});
    w.run(8);
    double const length = 0.8 + 2 * gravity / (driven ? 1e8 : 1e6);
    CAPTURE(h);
    CAPTURE(driven);
    CHECK(w.q(2) == doctest::Approx(1 - length).epsilon(1e-5));
    CHECK(std::abs(w.q(0)) < 1e-3);
    CHECK(w.speed() < 5e-3);
  };
  for (double h : all_steps)
    for (bool driven : {false, true}) {
      run(1., h, driven);
      run(1.f, h, driven);
    }
}

// A spatial tendon's spring and damper, and the same law as a constraint of a user's own (docs/add_a_constraint.md): from the world to a
// body on slides, and from there to a corner of a free body, thrown. Both are rows with one law, C = 1 / (h (h k + b)), so the problem that
// is solved is the same, and its solution unique: solved to 1e-12 |g| h a rate, 4e-14 m/s a step, and rounding, k eps of places in forces,
// 2e-10 N, of which the law itself gives back all but h b / (h k + b) a step. 200 steps of both: 1e-10 m, 1e-8 m/s. They start where the
// springs are out of balance, so that it is a motion that is compared.
TEST_CASE_TEMPLATE("a user's tether is a spatial tendon's spring", Exec, GSP_TEST_EXECS) {
  double const k = 1e6, damping = 3e3, length = 0.8;
  auto const scene = [&](bool tendons) {
    gsp::Description d;
    d.bodies[0].sites.emplace_back().name = "top";
    auto b = body(0, {0, 0, -1}, {0, 0, 0}, 2);
    for (int c = 0; c < 3; ++c)
      joint(b, gsp::JointType::slide, {double(c == 0), double(c == 1), double(c == 2)}, std::string(1, char('x' + c)));
    b.sites.emplace_back().name = "hook";
    d.bodies.push_back(b);
    auto free = body(0, {0.2, 0.1, -1.7}, {0, 0, 0}, 1, 0.02);
    free.joints.emplace_back().type = gsp::JointType::free;
    auto& corner = free.sites.emplace_back();
    corner.name = "corner", corner.pos = {0.1, -0.05, 0.1};
    d.bodies.push_back(free);
    for (auto const& [from, to] : {std::pair{"top", "hook"}, {"hook", "corner"}}) {
      if (!tendons) continue;
      auto& t = d.tendons.emplace_back();
      t.name = to;
      t.path = {{gsp::WrapType::site, from}, {gsp::WrapType::site, to}};
      t.stiffness = k, t.damping = damping, t.springlength = {length, length};
    }
    return d;
  };
  World<double, Exec> a(scene(true), 0.002), b(scene(false), 0.002);
  test_types::Tethers<double, typename Exec::memory_space> tethers{};
  tethers.poses = b.sim.poses, tethers.stiffness = k, tethers.damping = damping, tethers.length = length;
  tethers.to[1] = {0.1, -0.05, 0.1};
  tethers.a[0] = 0, tethers.b[0] = 1, tethers.a[1] = 1, tethers.b[1] = 2;
  std::vector<double> const push{0.5, 0, 0, 0, 0.3, 0, 1, 2, -1};
  a.put(a.state.qvel, push), b.put(b.state.qvel, push);
  gsp::PgsOptions const solver{.iterations = 100000, .tolerance = 1e-12f};
  double places = 0, rates = 0, most = 0;
  for (int i = 0; i < 200; ++i) {
    gsp::step(a.exec, a.model, a.state, a.sim, {.steps = 1, .solver = solver});
    gsp::step(b.exec, b.model, b.state, b.sim, {.steps = 1, .solver = solver}, tethers);
    auto const qa = a.qpos(), qb = b.qpos(), va = a.qvel(), vb = b.qvel();
    for (int c = 0; c < a.model.nq; ++c) places = std::fmax(places, std::abs(qa(0, c) - qb(0, c)));
    for (int c = 0; c < a.model.nv; ++c)
      rates = std::fmax(rates, std::abs(va(0, c) - vb(0, c))), most = std::fmax(most, std::abs(va(0, c)));
  }
  MESSAGE("apart by " << places << " m, " << rates << " m/s; fastest " << most << " m/s or rad/s");
  CHECK(places < 1e-10);
  CHECK(rates < 1e-8);
  CHECK(most > 1);
}

// A pendulum on a ball joint, servos on the three parts of its rotation vector: where kp (target - q) balances the weight about y.
TEST_CASE_TEMPLATE("servos on a ball joint come to their target", Exec, GSP_TEST_EXECS) {
  double const kp = 1e5;
  auto const run = [&](auto real, double h, gsp::Double3 const& target, double kv, bool below) {
    using R = decltype(real);
    gsp::Description d;
    auto b = body(0, {0, 0, 0}, {0, 0, -0.3});
    b.inertial.inertia = {0.02, 0.01, 0.015, 0, 0, 0};
    joint(b, gsp::JointType::ball, {0, 0, 1}, "ball");
    d.bodies.push_back(b);
    if (below) {  // a link more: the tree is no rigid body
      auto c = body(1, {0, 0, -0.3}, {0, 0, -0.1}, 0.2, 0.001);
      auto& knee = joint(c, gsp::JointType::hinge, {0, 1, 0}, "knee");
      knee.damping = 0.05;
      knee.stiffness = 0.5;
      d.bodies.push_back(c);
    }
    for (int c = 0; c < 3; ++c) {
      auto& a = servo(d, gsp::Transmission::joint, "ball", kp, kv);
      a.gear = {double(c == 0), double(c == 1), double(c == 2), 0, 0, 0};
    }
    World<R, Exec> w(d, h);
    w.put(w.state.ctrl, {target[0], target[1], target[2]});
    w.run(h > 0.03 ? 8 : 3);
    CAPTURE(h);
    CAPTURE(kv);
    CAPTURE(below);
    CAPTURE(target[0]);
    CAPTURE(target[1]);
    double const angle = std::sqrt(target[0] * target[0] + target[1] * target[1] + target[2] * target[2]);
    for (int c = 0; c < 3; ++c)  // within what a torque of 5 N m bends
      CHECK(w.q(1 + c) == doctest::Approx(std::sin(angle / 2) * target[c] / angle).scale(1).epsilon(1e-4));
    CHECK(w.speed() < 1e-3);
  };
  for (double h : all_steps)
    for (double kv : {0., 1e3})
      for (auto const& target :
           {gsp::Double3{0, 0.8, 0}, gsp::Double3{0.5, -0.6, 0.3}, gsp::Double3{1.2, 0.6, 0.8}, gsp::Double3{2, 1, -0.5}})
        for (bool below : {false, true}) {
          run(1., h, target, kv, below);
          run(1.f, h, target, kv, below);
        }
}

// A hinge pendulum whose servo may push with 20 N m alone: it comes to kp (target - q) = m g l sin q as long as that is less than 20,
// however far it has to go. The same by the joint's range, by a gear of -2, and by a tendon.
TEST_CASE_TEMPLATE("a servo at the limit of its force comes to its target", Exec, GSP_TEST_EXECS) {
  double const kp = 1e5, kv = 1e3, limit = 20;
  enum class Way { actuator, joint, gear, tendon, tendon_range, two };
  auto const run = [&](auto real, double h, Way way, double target) {
    using R = decltype(real);
    gsp::Description d;
    d.bodies.push_back(pendulum("j", 0.3));
    if (way == Way::tendon || way == Way::tendon_range) {
      auto& t = d.tendons.emplace_back();
      t.name = "t";
      t.terms = {{"j", 1}};
      if (way == Way::tendon_range) {
        t.actuator_force_limited = true;
        t.actuator_force_range = {-limit, limit};
      }
      servo(d, gsp::Transmission::tendon, "t", kp, kv, way == Way::tendon ? limit : 0);
    } else {
      double const gear = way == Way::gear ? -2 : 1;
      auto& a =
          servo(d, gsp::Transmission::joint, "j", kp / (gear * gear), kv / (gear * gear), way == Way::joint ? 0 : limit / std::abs(gear));
      a.gear[0] = gear;
      if (way == Way::joint) {
        d.bodies[1].joints[0].actuator_force_limited = true;
        d.bodies[1].joints[0].actuator_force_range = {-limit, limit};
      }
      if (way == Way::two) {  // spring and damper apart, MuJoCo's idiom: 20 each
        d.actuators[0].biasprm[2] = 0;
        auto& velocity = servo(d, gsp::Transmission::joint, "j", 0, 10, limit);  // it goes with 1.5 to 2 rad/s
        velocity.gainprm[0] = 10;
      }
    }
    World<R, Exec> w(d, h);
    std::vector<double> ctrl{way == Way::gear ? -2 * target : target};
    ctrl.resize(std::size_t(w.model.nu));
    w.put(w.state.ctrl, ctrl);
    w.put(w.state.qvel, {5});
    w.run(5);
    CAPTURE(h);
    CAPTURE(int(way));
    CAPTURE(target);
    CHECK(w.q(0) == doctest::Approx(hanging(kp, target, 0.3 * gravity)).epsilon(1e-5));
    CHECK(w.speed() < 1e-4);
  };
  for (double h : all_steps)
    for (auto way : {Way::actuator, Way::joint, Way::gear, Way::tendon, Way::tendon_range, Way::two})
      for (double target : {0.01, 1., -2.5}) {
        run(1., h, way, target);
        run(1.f, h, way, target);
      }
}

// Two strings of 1e8 pull a pendulum to 0.4 and -0.2, each with the tension of the other: it comes to 0.1 less what its weight bends.
TEST_CASE_TEMPLATE("strings that pull against each other meet in the middle", Exec, GSP_TEST_EXECS) {
  for (double h : all_steps)
    for (double kp : {1e4, 1e8}) {
      gsp::Description d;
      d.bodies.push_back(pendulum("j", 0.3));
      for (int k = 0; k < 2; ++k) {
        auto& t = d.tendons.emplace_back();
        t.name = std::string(1, char('a' + k));
        t.terms = {{"j", k == 0 ? 1. : -1.}};
        servo(d, gsp::Transmission::tendon, t.name, kp, 0);
      }
      World<double, Exec> w(d, h);
      w.put(w.state.ctrl, {0.4, 0.2});
      w.run(3);
      CAPTURE(h);
      CAPTURE(kp);
      CHECK(w.q(0) == doctest::Approx(hanging(2 * kp, 0.1, 0.3 * gravity)).epsilon(1e-7));
      CHECK(w.speed() < 1e-6);
    }
}

// A ball of 1 kg, inertia 0.01, that sinks in a fluid of viscosity 1e2 or 1e4 is as fast as its drag holds its weight: m g = 3 pi D
// viscosity v, D the edge of the cube of equal inertia, I = m D^2 / 6. A chain of three links hardly moves.
TEST_CASE_TEMPLATE("a thick fluid holds back what moves in it", Exec, GSP_TEST_EXECS) {
  auto const run = [&](auto real, double h, double viscosity) {
    using R = decltype(real);
    CAPTURE(h);
    CAPTURE(viscosity);
    double const drag = 3 * M_PI * std::sqrt(6 * 0.01) * viscosity;
    {
      gsp::Description d;
      d.option.viscosity = viscosity;
      auto b = body(0, {0, 0, 0}, {0, 0, 0.1});
      b.joints.emplace_back().type = gsp::JointType::free;
      d.bodies.push_back(b);
      World<R, Exec> w(d, h);
      w.put(w.state.qvel, {0, 0, 0, 3, 20, 1});
      w.run(1);
      auto const v = gsp_test::host(w.state.qvel);
      CHECK(double(v(0, 2)) == doctest::Approx(-gravity / drag).epsilon(1e-4));
      CHECK(w.speed() < 1.001 * gravity / drag);
    }
    {
      gsp::Description d;
      d.option.viscosity = viscosity;
      for (int i = 0; i < 3; ++i) {
        d.bodies.push_back(pendulum("j" + std::to_string(i), 0.2, 0, i));
        if (i > 0) d.bodies.back().pos = {0, 0, -0.3};
      }
      World<R, Exec> w(d, h);
      w.put(w.state.qpos, {1, 0.5, -0.5});
      w.put(w.state.qvel, {30, -50, 20});
      w.run(1);
      CHECK(w.speed() < 0.1);
    }
  };
  for (double h : all_steps)
    for (double viscosity : {1e2, 1e4}) {
      run(1., h, viscosity);
      run(1.f, h, viscosity);
    }
}

// A disc of inertia I (a hinge, no weight) and a servo of at most F: the energy I v^2 / 2 + V(e), V' = clamp(kp e, -F, F), falls in every
// step of the implicit law, however long: V is convex, and the clamp monotone. And of two sliders on a tendon, all springs in it. Solved to
// 1e-4 of what gravity does in a step: what a row misses is less than 1e-6 of the energy at the start.
TEST_CASE_TEMPLATE("stiff springs and servos at their limit make no energy", Exec, GSP_TEST_EXECS) {
  for (double h : all_steps)
    for (double kv : {0., 1e3})
      for (double start : {-5., 0., 40.}) {
        double const kp = 1e5, limit = 20, inertia = 0.01;
        gsp::Description d;
        auto b = body(0, {0, 0, 0}, {0, 0, 0}, 1, inertia);
        joint(b, gsp::JointType::hinge, {0, 0, 1}, "j");
        d.bodies.push_back(b);
        servo(d, gsp::Transmission::joint, "j", kp, kv, limit);
        World<double, Exec> w(d, h);
        w.put(w.state.qvel, {start});
        w.put(w.state.ctrl, {1});
        auto const energy = [&] {
          double const e = std::abs(w.q(0) - 1), v = w.speed(), near = limit / kp;
          return inertia * v * v / 2 + (e < near ? kp * e * e / 2 : limit * (e - near / 2));
        };
        double before = energy(), most = before, least = 0;
        for (int i = 0; i < 500; ++i) {
          w.run(h);
          double const now = energy();
          least = std::max(least, (now - before) / most);
          before = now;
        }
        CAPTURE(h);
        CAPTURE(kv);
        CAPTURE(start);
        CHECK(least < 1e-6);
        CHECK(before < 1e-6 * most);
      }
  for (double h : all_steps) {
    double const k = 1e6, m = 1;
    gsp::Description d;
    for (int i = 0; i < 2; ++i) {
      auto b = body(0, {double(i), 0, 0}, {0, 0, 0}, m);
      joint(b, gsp::JointType::slide, {0, 0, 1}, i == 0 ? "x" : "y");
      d.bodies.push_back(b);
    }
    auto& t = d.tendons.emplace_back();
    t.terms = {{"x", 1}, {"y", 1}};
    t.stiffness = k;
    t.springlength = {0, 0};
    d.option.gravity = {0, 0, 0};
    World<double, Exec> w(d, h);
    w.put(w.state.qpos, {0.2, 0.1});
    w.put(w.state.qvel, {-1, 3});
    double before = 1e300;
    for (int i = 0; i < 500; ++i) {
      w.run(h);
      auto const v = gsp_test::host(w.state.qvel);
      double const stretch = w.q(0) + w.q(1), now = m * (v(0, 0) * v(0, 0) + v(0, 1) * v(0, 1)) / 2 + k * stretch * stretch / 2;
      CHECK(now < before * (1 + 1e-9) + 1e-9);
      before = now;
    }
    auto const v = gsp_test::host(w.state.qvel);
    CHECK(v(0, 0) - v(0, 1) == doctest::Approx(-4));  // what the tendon does not see
    CHECK(std::abs(v(0, 0) + v(0, 1)) < 1e-3);
  }
}

namespace {
/// A servo at its limit, one on a tendon, and a free ball that falls: two trees of three kinds of forces.
gsp::Description mixed() {
  gsp::Description d;
  d.bodies.push_back(pendulum("j", 0.3));
  d.bodies.push_back(pendulum("k", 0.2, 1));
  d.bodies.push_back(pendulum("l", 0.2, 2));
  auto& t = d.tendons.emplace_back();
  t.name = "t";
  t.terms = {{"k", 1}, {"l", 1}};
  t.stiffness = 1e4;
  servo(d, gsp::Transmission::joint, "j", 1e5, 1e3, 20);
  servo(d, gsp::Transmission::tendon, "t", 1e6, 0, 5);
  return d;
}
template <class W>
void start(W& w, int first, double step = 0.1) {
  auto const q = gsp_test::host(w.state.qpos), u = gsp_test::host(w.state.ctrl);
  for (int i = 0; i < w.state.worlds; ++i)
    for (int c = 0; c < 3; ++c) {
      q(i, c) = float(std::sin(step * double(first + i) + c));
      u(i, c % 2) = float(0.5 * std::cos(2.0 * double(first + i)));
    }
  Kokkos::deep_copy(w.state.qpos, q);
  Kokkos::deep_copy(w.state.ctrl, u);
}
}  // namespace

// Which worlds have rows differs from world to world, and in a pack from lane to lane.
TEST_CASE_TEMPLATE("a world with stiff forces steps as it does alone", Exec, GSP_TEST_EXECS) {
  int const n = 37;
  World<float, Exec> all(mixed(), 0.02, n);
  start(all, 0);
  int most = 0, least = 1000;
  for (int i = 0; i < 40; ++i) {
    all.run(0.02);
    auto const count = gsp_test::host(all.sim.rows.count);
    for (int w = 0; w < n; ++w) {
      most = std::max(most, count(w));
      least = std::min(least, count(w));
    }
  }
  CHECK(most == 3);
  CHECK(least < 3);
  auto const together = gsp_test::host(all.state.qpos);
  for (int w = 0; w < n; w += 5) {
    World<float, Exec> one(mixed(), 0.02);
    start(one, w);
    one.run(0.8);
    auto const alone = gsp_test::host(one.state.qpos);
    for (int c = 0; c < 3; ++c) CHECK(alone(0, c) == together(w, c));
  }
}

// The force of a row is bounded, counts as the actuator's and not as a constraint's, and can be read; without stiff_rows, or without the
// rows, nothing is lost in silence.
TEST_CASE_TEMPLATE("stiff forces in a loop of one's own", Exec, GSP_TEST_EXECS) {
  World<double, Exec> ready(mixed(), 0.02), own(mixed(), 0.02),
      disabled(
          [] {
            auto d = mixed();
            d.option.constraint = false;
            return d;
          }(),
          0.02);
  for (auto* w : {&ready, &own, &disabled}) start(*w, 3);  // the servo is at its limit
  auto& [exec, compiled, model, state, sim, may_stop] = own;
  for (int i = 0; i < 30; ++i) {
    ready.run(0.02);
    disabled.run(0.02);
    if (i % 2 == 0) {
      gsp::smooth_dynamics(exec, model, state, sim.poses, sim.dynamics, {.stiff_rows = true});
    } else {
      gsp::forward_kinematics(exec, model, state, sim.poses, sim.dynamics);
      gsp::mass_matrix(exec, model, state, sim.poses, sim.dynamics);
      gsp::bias_forces(exec, model, state, sim.poses, sim.dynamics);
      gsp::passive_forces(exec, model, state, sim.poses, sim.dynamics);
      gsp::actuator_forces(exec, model, state, sim.poses, sim.dynamics);
      gsp::factor(exec, model, state, sim.dynamics, {.stiff_rows = true});
    }
    auto const none = gsp::constraints();
    CHECK_THROWS_WITH_AS(gsp::assemble(exec, model, state, sim.dynamics, none, sim.rows, sim.impulses, sim.progress),
                         doctest::Contains("add StiffForces(model, state, dynamics)"), std::invalid_argument);
    CHECK_THROWS_WITH_AS(gsp::integrate(exec, model, state, sim.dynamics), doctest::Contains("no rows have been solved"),
                         std::invalid_argument);
    gsp::StiffForces const stiff(model, state, sim.dynamics);
    auto const list = gsp::constraints(stiff);
    gsp::assemble(exec, model, state, sim.dynamics, list, sim.rows, sim.impulses, sim.progress);
    gsp::pgs(exec, sim.rows, sim.impulses, sim.solution, sim.progress);
    gsp::integrate(exec, model, state, sim.dynamics, sim.progress, sim.solution);
    auto const before = gsp_test::host(sim.solution.qfrc_constraint);
    gsp::subtract_stiff_forces(exec, stiff, sim.rows, sim.impulses, sim.progress, sim.solution.qfrc_constraint);
    auto const after = gsp_test::host(sim.solution.qfrc_constraint), qfrc = gsp_test::host(ready.sim.solution.qfrc_constraint);
    for (int c = 0; c < 3; ++c) {
      CHECK(std::abs(after(0, c)) < 1e-9);
      CHECK(std::abs(qfrc(0, c)) < 1e-9);
      CHECK(ready.q(c) == doctest::Approx(own.q(c)).epsilon(1e-12));
      CHECK(ready.q(c) == disabled.q(c));
    }
    CHECK(std::abs(before(0, 0)) <= 20 * (1 + 1e-12));  // the servo's limit
  }
}
