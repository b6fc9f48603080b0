#include <doctest/doctest.h>

#include <cmath>
#include <gsp/constraint/contact_forces.hpp>
#include <gsp/constraint/joint_forces.hpp>
#include <gsp/model/compile.hpp>
#include <gsp/step/step.hpp>
#include <gsp_test_execs.hpp>

#include "dynamics/random_tree.hpp"

namespace test_types {
/// Holds poses, and has no elements.
template <class Mem>
struct Reads : gsp::OneFreeRow {
  gsp::Poses<double, Mem> poses;
  KOKKOS_FUNCTION int count(int) const { return 0; }
  KOKKOS_FUNCTION gsp::RowLaw<double> law(int, int, int, double, double, double) const { return {0, 0}; }
  template <class Row>
  KOKKOS_FUNCTION double jacobian(int, int, int, Row&& J) const {
    J.set_dof(0, 1.);
    return 0;
  }
};
}  // namespace test_types

namespace {

using gsp::Double3;

double dot(Double3 const& a, Double3 const& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

/// The two tangents that belong to a normal, as MuJoCo's mju_makeFrame chooses them: t1 is the y axis made orthogonal to the normal, the
/// z axis where the normal is within 60 degrees of y; t2 = n x t1.
struct Tangents {
  Double3 t1, t2;
};
Tangents tangents_of(Double3 const& n) {
  Double3 t = n[1] > -0.5 && n[1] < 0.5 ? Double3{0, 1, 0} : Double3{0, 0, 1};
  double const along = dot(t, n);
  for (int k = 0; k < 3; ++k) t[k] -= along * n[k];
  double const length = std::sqrt(dot(t, t));
  for (double& x : t) x /= length;
  return {t, {n[1] * t[2] - n[2] * t[1], n[2] * t[0] - n[0] * t[2], n[0] * t[1] - n[1] * t[0]}};
}

/// A box of 2 kg on a plane of normal n, which can be moved and not turned, under gravity along -n. The pair is named and has friction .3
/// along the first tangent, .7 along the second; what the geoms say is another number.
gsp::Description box_on_plane(Double3 const& n) {
  gsp::Description d;
  d.option.gravity = {-9.81 * n[0], -9.81 * n[1], -9.81 * n[2]};
  double const length = std::sqrt(2 + 2 * n[2]);
  gsp::Double4 const up_to_n{(1 + n[2]) / length, -n[1] / length, n[0] / length, 0};
  gsp::GeomDescription floor;
  floor.name = "floor";
  floor.type = gsp::ShapeType::plane;
  floor.size = {0, 0, 1};
  floor.quat = up_to_n;
  d.bodies[0].geoms.push_back(floor);
  gsp::BodyDescription body;
  body.name = "body";
  body.parent = 0;
  body.pos = {0.1 * n[0], 0.1 * n[1], 0.1 * n[2]};
  body.has_inertial = true;
  body.inertial.mass = 2;
  body.inertial.inertia = {0.1, 0.1, 0.1, 0, 0, 0};
  for (Double3 const& axis : {Double3{1, 0, 0}, Double3{0, 1, 0}, Double3{0, 0, 1}}) {
    gsp::JointDescription slide;
    slide.type = gsp::JointType::slide;
    slide.axis = axis;
    body.joints.push_back(slide);
  }
  gsp::GeomDescription box;
  box.name = "box";
  box.type = gsp::ShapeType::box;
  box.size = {0.2, 0.15, 0.1};
  box.quat = up_to_n;
  body.geoms.push_back(box);
  d.bodies.push_back(body);
  gsp::PairDescription pair;
  pair.geom1 = "box";  // the plane is geom 1 of the contact all the same: its type comes first
  pair.geom2 = "floor";
  pair.friction = std::array{0.3, 0.7, 0.005, 0.0001, 0.0001};
  d.pairs.push_back(pair);
  return d;
}

/// What a call refuses with; empty: it does not.
template <class F>
std::string refusal(F const& call) {
  try {
    call();
  } catch (std::invalid_argument const& e) { return e.what(); }
  return {};
}

/// A box on a floor in three worlds, and the stages of a step one by one.
template <class Exec>
struct Stages {
  static constexpr int worlds = 3;
  using Mem = typename Exec::memory_space;
  Exec exec;
  gsp::CompiledModel compiled;
  gsp::Model<double, Mem> model;
  gsp::State<double, Mem> state;
  gsp::Simulation<double, Mem> sim;
  Kokkos::View<double* [6], Kokkos::LayoutRight, Mem> force;
  Kokkos::View<double**, Kokkos::LayoutRight, Mem> limit, friction;
  explicit Stages(bool constraints = true, gsp::ModelOptions options = {}, gsp::Integrator integrator = gsp::Integrator::euler)
      : compiled(compiled_of(constraints, integrator)),
        model(gsp::make_model<double>(exec, compiled, options)),
        state(gsp::make_state(exec, model, {.worlds = worlds})),
        sim(gsp::make_simulation(exec, model, compiled, {.worlds = worlds})),
        force("force", 1000),
        limit("limit", worlds, model.njnt),
        friction("friction", worlds, model.nv) {}
  static gsp::CompiledModel compiled_of(bool constraints, gsp::Integrator integrator) {
    auto d = box_on_plane({0, 0, 1});
    d.option.constraint = constraints;
    d.option.integrator = integrator;
    return gsp::compile(d);
  }
  void smooth() { gsp::smooth_dynamics(exec, model, state, sim.poses, sim.dynamics); }
  void collide() { gsp::collide(exec, sim.collision, sim.poses, sim.contacts); }
  void assemble() { assemble(gsp::ContactRows(model, state, sim.collision, sim.contacts)); }
  template <class Type>
  void assemble(Type const& type) {
    gsp::assemble(exec, model, state, sim.dynamics, gsp::constraints(type), sim.rows, sim.impulses, sim.progress);
  }
  void solve() { gsp::pgs(exec, sim.rows, sim.impulses, sim.solution, sim.progress); }
  void integrate() { gsp::integrate(exec, model, state, sim.dynamics, sim.progress, sim.solution); }
  void step() { gsp::step(exec, model, state, sim); }
  std::string contact_forces() {
    return refusal([&] { gsp::contact_forces(exec, model, sim.collision, sim.contacts, sim.rows, sim.impulses, force); });
  }
  std::string joint_forces() {
    return refusal([&] { gsp::joint_forces(exec, model, sim.rows, sim.impulses, limit, friction); });
  }
  std::string impulses_of() {
    return refusal([&] { gsp::impulses_of<gsp::ContactRows<double, Mem>>(sim.rows, sim.impulses); });
  }
  bool all_read() { return contact_forces().empty() && joint_forces().empty() && impulses_of().empty(); }
  /// All three refuse, each by its name and with this.
  bool none_reads(std::string const& why) {
    auto const says = [&](std::string const& sentence, char const* who) {
      return sentence.find(std::string("gsp::") + who + ": ") == 0 && sentence.find(why) != std::string::npos;
    };
    return says(contact_forces(), "contact_forces") && says(joint_forces(), "joint_forces") && says(impulses_of(), "impulses_of");
  }
};

}  // namespace

// Contacts are of the poses that they were found at: rows are made of contacts of this state, as it is now, or of a user's own.
TEST_CASE_TEMPLATE("rows are not made of contacts of another moment", Exec, GSP_TEST_EXECS) {
  Stages<Exec> s;
  auto const refused = [&] { return refusal([&] { s.assemble(); }); };
  auto const adhesion_refused = [&] { return refusal([&] { s.assemble(gsp::ContactAdhesion(s.model, s.sim.contacts, s.sim.dynamics)); }); };
  std::string const before = "gsp::assemble: the contacts are of the state before its last step or reset: call forward_kinematics";
  s.smooth();
  CHECK(refused().find("gsp::assemble: the contacts have not been written: call collide first") == 0);
  auto const stamp = s.sim.contacts.stamp;
  s.sim.contacts.stamp = {};  // of one's own
  CHECK(refused().empty());
  s.sim.contacts.stamp = stamp;
  s.collide();
  s.assemble();
  s.solve();
  s.integrate();
  s.smooth();
  CHECK(refused().find(before) == 0);
  s.collide();
  s.assemble();
  s.solve();
  s.integrate();
  s.collide();  // at poses of the state before
  s.smooth();
  CHECK(refused().find(before) == 0);
  CHECK(adhesion_refused().find(before) == 0);
  s.collide();
  CHECK(refused().empty());
  CHECK(adhesion_refused().empty());
  // pools that grow lose what they held
  auto const large = s.sim.contacts;
  s.sim.contacts = gsp::make_contacts(s.exec, s.sim.collision,
                                      {.worlds = s.worlds, .candidates_per_world = 1, .points_per_world = 1, .contacts_per_world = 1});
  s.collide();
  gsp::ContactRows const early(s.model, s.state, s.sim.collision, s.sim.contacts);
  gsp::ContactAdhesion const early_adhesion(s.model, s.sim.contacts, s.sim.dynamics);
  CHECK(gsp::grow(s.exec, s.sim.contacts));
  std::string const lost = "gsp::assemble: the contacts were lost when their pools grew: call collide again";
  CHECK(refused() == lost);
  CHECK(adhesion_refused() == lost);
  s.collide();
  CHECK(refused().empty());
  CHECK(adhesion_refused().empty());
  while (gsp::grow(s.exec, s.sim.contacts)) s.collide();
  std::string const moved =
      "gsp::assemble: the pools of the contacts have grown since a constraint type was made of them";  // it has the old
  CHECK(refusal([&] { s.assemble(early); }).find(moved) == 0);
  CHECK(refusal([&] { s.assemble(early_adhesion); }).find(moved) == 0);
  s.sim.contacts = large;
  gsp::reset(s.exec, s.model, s.state);
  s.smooth();
  CHECK(refused().find(before) == 0);
  auto other = gsp::make_state(s.exec, s.model, {.worlds = s.worlds});
  gsp::smooth_dynamics(s.exec, s.model, other, s.sim.poses, s.sim.dynamics);
  s.collide();
  s.smooth();
  CHECK(refused().find("gsp::assemble: the contacts are of another state") == 0);
  auto const old = gsp::make_poses(s.exec, s.model, {.worlds = s.worlds});  // of the other state
  auto const with_poses = [&](auto const& poses) {
    test_types::Reads<typename Exec::memory_space> const type{{}, poses};
    return refusal([&] {
      gsp::assemble(s.exec, s.model, s.state, s.sim.dynamics, gsp::constraints(type), s.sim.rows, s.sim.impulses, s.sim.progress);
    });
  };
  auto poses_of_other = old;
  gsp::forward_kinematics(s.exec, s.model, other, poses_of_other, s.sim.dynamics);
  s.smooth();
  CHECK(with_poses(old).find("gsp::assemble: the poses (xpos, xquat) are of another state than the one given") == 0);
  CHECK(with_poses(s.sim.poses).empty());
  std::string const worlds = " worlds, and the state has " + std::to_string(s.worlds);
  auto const too_few = gsp::make_poses(s.exec, s.model, {.worlds = 1});
  CHECK(with_poses(too_few).find("gsp::assemble: a constraint type's `poses` have 1" + worlds) == 0);
  CHECK(with_poses(decltype(too_few){}).find("gsp::assemble: a constraint type's `poses` have 0" + worlds) == 0);
  gsp::ContactRows few(s.model, s.state, s.sim.collision, s.sim.contacts);
  few.contacts.worlds = 1;
  CHECK(refusal([&] { s.assemble(few); }).find("gsp::assemble: a constraint type's `contacts` have 1" + worlds) == 0);
  auto const own = gsp::make_poses(s.exec, s.model, {.worlds = s.worlds});  // filled by hand
  Kokkos::deep_copy(own.xpos, s.sim.poses.xpos);
  Kokkos::deep_copy(own.xquat, s.sim.poses.xquat);
  gsp::collide(s.exec, s.sim.collision, own, s.sim.contacts);
  s.assemble();
  s.solve();
  s.integrate();
  s.smooth();
  CHECK(refused().empty());
}

// Forces are read of the rows, the contacts and the impulses of one solve.
TEST_CASE_TEMPLATE("forces are read back after the solve that they are of", Exec, GSP_TEST_EXECS) {
  Stages<Exec> s;
  std::string const unsolved = "have not been solved for since they were last assembled: step first (or call pgs; profile mujoco: newton)",
                    anew = "gsp::contact_forces: the contacts are not those that were assembled, or collide has written them again since";
  CHECK(s.none_reads("nothing has been solved yet: step first (or collide, assemble, and pgs; profile mujoco: newton)"));
  s.smooth();
  s.collide();
  s.assemble();
  CHECK(s.none_reads(unsolved));
  s.solve();
  CHECK(s.all_read());
  s.integrate();
  CHECK(s.all_read());  // forces of the step just done
  Kokkos::View<bool*, typename Exec::memory_space> const mask("mask", s.worlds);
  gsp::reset(s.exec, s.model, s.state, mask);
  CHECK(s.all_read());
  s.smooth();
  s.collide();
  CHECK(s.contact_forces().find(anew) == 0);
  CHECK(s.joint_forces().empty());
  s.assemble();
  CHECK(s.none_reads(unsolved));
  gsp::set_solved(s.sim.rows, s.sim.impulses);  // a solver of one's own
  CHECK(s.all_read());

  auto const found = s.sim.contacts;
  s.sim.contacts = gsp::make_contacts(s.exec, s.sim.collision, {.worlds = s.worlds});
  CHECK(s.contact_forces().find(anew) == 0);  // others
  s.sim.contacts = found;
  CHECK(s.all_read());
  auto const impulses = s.sim.impulses;
  s.sim.impulses = gsp::make_impulses(s.exec, s.sim.rows);
  s.smooth();
  s.assemble();
  s.solve();
  CHECK(s.all_read());
  s.sim.impulses = impulses;
  CHECK(s.none_reads("are of other rows, or of these before they were assembled again"));
  s.step();
  CHECK(s.all_read());
  s.sim.contacts.stamp = {};  // structs of one's own have no stamps: they are taken as they are
  s.collide();
  CHECK(s.all_read());
  s.sim.rows.stamp = {};
  s.smooth();
  s.assemble();
  CHECK(s.contact_forces().empty());
}

// Before settle the host does not know whether a step has fitted: what lies there may be of the step before.
TEST_CASE_TEMPLATE("forces of steps that nobody has waited for are not read", Exec, GSP_TEST_EXECS) {
  Stages<Exec> s;
  s.step();
  CHECK(s.all_read());
  for (int i = 0; i < 2; ++i) {  // a second launch is none the wiser
    gsp::launch_step(s.exec, s.model, s.state, s.sim);
    CHECK(s.none_reads("steps were launched, and whether they have fitted is not known yet: call settle(exec, sim) first"));
  }
  REQUIRE(gsp::settle(s.exec, s.sim) == 0);
  CHECK(s.all_read());
}

TEST_CASE_TEMPLATE("impulses of a type that the list had not as often are refused", Exec, GSP_TEST_EXECS) {
  using Mem = typename Exec::memory_space;
  Stages<Exec> s;
  s.step();
  auto const refused = [&](int nth) {
    return refusal([&] { gsp::impulses_of<gsp::ContactRows<double, Mem>>(s.sim.rows, s.sim.impulses, nth); });
  };
  CHECK(refused(0).empty());
  CHECK(refused(1) ==
        "gsp::impulses_of: number 1 of this constraint type is asked for, and the list that was assembled has 1: they count from 0");
  CHECK(refused(-1).find("gsp::impulses_of: number -1 of") == 0);
  CHECK(refusal([&] { gsp::impulses_of<test_types::Reads<Mem>>(s.sim.rows, s.sim.impulses); }).empty());  // none: zeros
}

// A pool that is too small: what was launched has not happened until settle has made room and it is launched again.
TEST_CASE_TEMPLATE("forces of steps that did not fit are not read", Exec, GSP_TEST_EXECS) {
  Stages<Exec> s;
  s.sim.contacts = gsp::make_contacts(s.exec, s.sim.collision,
                                      {.worlds = s.worlds, .candidates_per_world = 1, .points_per_world = 1, .contacts_per_world = 1});
  int rounds = 0;
  for (int left = 2; left > 0;) {
    for (int i = 0; i < left; ++i) gsp::launch_step(s.exec, s.model, s.state, s.sim);
    left = gsp::settle(s.exec, s.sim);
    ++rounds;
    CHECK(s.joint_forces().empty() == (left == 0));
    CHECK(s.contact_forces().empty() == (left == 0));
  }
  CHECK(rounds > 1);
}

// Models without constraints have no rows, and no forces of them: zeros, as before; but not those of an earlier step with constraints.
TEST_CASE_TEMPLATE("steps without constraints have no forces of constraints", Exec, GSP_TEST_EXECS) {
  using Mem = typename Exec::memory_space;
  for (bool rk : {false, true}) {
    Stages<Exec> s(false, {.profile = rk ? gsp::Profile::mujoco : gsp::Profile::stable},
                   rk ? gsp::Integrator::rk4 : gsp::Integrator::euler);
    Kokkos::deep_copy(s.limit, 7.);
    for (int i = 0; i < 2; ++i) {
      s.step();
      CHECK(s.all_read());
    }
    auto const limit = gsp_test::host(s.limit);
    for (int w = 0; w < s.worlds; ++w)
      for (int j = 0; j < s.model.njnt; ++j) CHECK(limit(w, j) == 0);
  }
  Stages<Exec> with, without(false);
  with.step();
  gsp::Model<double, Mem> const own = with.model;
  with.model = without.model;
  with.step();
  CHECK(with.none_reads("have not been solved for"));
  with.model = own;
  with.step();
  CHECK(with.all_read());
}

// The law is an ellipse, (f_1 / mu_1)^2 + (f_2 / mu_2)^2 <= f_n^2, with the force of largest dissipation: on its edge
// f_i = -mu_i^2 v_i f_n / sqrt(sum (mu_j v_j)^2), v at the end of the step; or a box, |f_i| <= mu_i f_n along each tangent. At rest along
// the normal the four contacts carry the weight, sum f_n = m g = N.
//   worlds 0-3  slide, 1 m/s along (+-0.6, +-0.8) in (t1, t2): box: f_i = -mu_i f_n sign(v_i) at each contact, N (-+.3, -+.7) in all
//   worlds 4-5  at rest, pushed by +-N/2 along t1: beyond .3 N, slides, v' = +-h (1/2 - .3) N / m
//   worlds 6-7  at rest, pushed by +-N/2 along t2: below .7 N, sticks, and friction is the push
// Tolerance: 4 s are 200 time constants of a critically damped contact, what is left is rounding of the sweeps, 1e-14 m/s of rate each;
// m / h of that is 1e-11 N. Contacts that stick share a force as the sweeps find it: their sum is what is known.
TEST_CASE_TEMPLATE("friction of its own along each tangent of a named pair", Exec, GSP_TEST_EXECS) {
  using Mem = typename Exec::memory_space;
  Exec const exec;
  int const worlds = 8;
  double const m = 2, N = m * 9.81, h = 0.002, mu[2] = {0.3, 0.7};
  gsp::PgsOptions const solver{.iterations = 1000, .tolerance = 5e-13f};
  for (auto const& [n, cone] :
       {std::pair{Double3{0, 0, 1}, gsp::FrictionCone::elliptic}, std::pair{Double3{0.48, 0.6, 0.64}, gsp::FrictionCone::elliptic},
        std::pair{Double3{-0.48, 0.36, 0.8}, gsp::FrictionCone::elliptic}, std::pair{Double3{0, 0, 1}, gsp::FrictionCone::box},
        std::pair{Double3{0.48, 0.6, 0.64}, gsp::FrictionCone::box}}) {
    CAPTURE(n[0]);
    CAPTURE(n[1]);
    auto const [t1, t2] = tangents_of(n);
    auto const compiled = gsp::compile(box_on_plane(n));
    auto const model = gsp::make_model<double>(exec, compiled);
    auto state = gsp::make_state(exec, model, {.worlds = worlds});
    auto sim = gsp::make_simulation(exec, model, compiled, {.worlds = worlds, .cone = cone});
    gsp::step(exec, model, state, sim, {.steps = 2000, .solver = solver});
    auto const qvel = gsp_test::host(state.qvel);
    auto const push = gsp_test::host(state.qfrc_applied);
    double slip[worlds][2] = {}, pushed[worlds][2] = {};
    for (int w = 0; w < worlds; ++w) {
      double const sign = w % 2 == 0 ? 1 : -1;
      if (w < 4) {
        slip[w][0] = 0.6 * sign;
        slip[w][1] = w < 2 ? 0.8 : -0.8;
      } else {
        pushed[w][w < 6 ? 0 : 1] = sign * N / 2;
      }
      for (int k = 0; k < 3; ++k) {
        qvel(w, k) = slip[w][0] * t1[k] + slip[w][1] * t2[k];
        push(w, k) = pushed[w][0] * t1[k] + pushed[w][1] * t2[k];
      }
    }
    Kokkos::deep_copy(state.qvel, qvel);
    auto const before = gsp_test::snapshot(state.qvel);
    Kokkos::deep_copy(state.qfrc_applied, push);
    gsp::step(exec, model, state, sim, {.steps = 1, .solver = solver});
    Kokkos::View<double* [6], Kokkos::LayoutRight, Mem> force("force", sim.contacts.dist.extent(0));
    gsp::contact_forces(exec, model, sim.collision, sim.contacts, sim.rows, sim.impulses, force);
    auto const f = gsp_test::host(force);
    auto const after = gsp_test::host(state.qvel);
    auto const qfrc = gsp_test::host(sim.solution.qfrc_constraint);
    auto const first = gsp_test::host(sim.contacts.first);
    auto const end = gsp_test::host(sim.contacts.end);
    for (int w = 0; w < worlds; ++w) {
      CAPTURE(w);
      double expected[2];  // along t1 and t2, of all contacts together
      for (int t = 0; t < 2; ++t) {
        double const driven = w < 4 ? slip[w][t] : pushed[w][t];
        bool const slides = w < 4 || std::abs(pushed[w][t]) > mu[t] * N;
        expected[t] = slides ? -std::copysign(mu[t] * N, driven) : -pushed[w][t];
      }
      bool const turned = cone == gsp::FrictionCone::elliptic && w < 4;
      for (int i = 0; turned && i < 50; ++i) {  // the force changes the slip by 1 %: each round gains two digits
        double v[2];
        for (int t = 0; t < 2; ++t) v[t] = slip[w][t] + h / m * expected[t];
        double const length = std::hypot(mu[0] * v[0], mu[1] * v[1]);
        for (int t = 0; t < 2; ++t) expected[t] = -mu[t] * mu[t] * v[t] * N / length;
      }
      CHECK(end(w) - first(w) == 4);
      double sum[3] = {};
      for (int c = first(w); c < end(w); ++c) {
        for (int r = 0; r < 3; ++r) sum[r] += f(c, r);
        for (int r = 3; r < 6; ++r) CHECK(f(c, r) == 0);
        for (int t = 0; t < 2; ++t) {
          if (!turned && std::abs(std::abs(expected[t]) - mu[t] * N) > 1e-6) continue;  // sticks
          CHECK(std::abs(f(c, 1 + t) - expected[t] / N * f(c, 0)) < 1e-9);
        }
      }
      CHECK(std::abs(sum[0] - N) < 1e-9);
      for (int t = 0; t < 2; ++t) CHECK(std::abs(sum[1 + t] - expected[t]) < 1e-9);
      for (int k = 0; k < 3; ++k) {
        double const constraint = N * n[k] + expected[0] * t1[k] + expected[1] * t2[k];
        CHECK(std::abs(qfrc(w, k) - constraint) < 1e-9);
        double const moved = h / m * (constraint + push(w, k) - N * n[k]);
        CHECK(std::abs(after(w, k) - before(w, k) - moved) < 1e-11);
      }
    }
  }
}

// A rigid ball that slips with (1, 0.5) m/s at a gap x = 1e-6 m, which gravity closes in the step: all of J^T p / h, in the frames of the
// contacts, is what contact_forces says, also its friction. Where it is rigid (pyramids are soft) the ball reaches the plane at the end of
// the step, u+ = -x / h:
//   f_n = m (g - x / h^2) = 19.12 N,   sqrt(f_1^2 + f_2^2) = mu f_n
// Tolerance: the sweeps stop at 5e-13 |g| h; m / h of that is 1e-11 N. Gaps are differences of numbers of 0.1: 1e-17 m / h^2 of them.
TEST_CASE_TEMPLATE("what slips just above a plane rubs on it", Exec, GSP_TEST_EXECS) {
  using Mem = typename Exec::memory_space;
  Exec const exec;
  double const m = 2, h = 0.002, gap = 1e-6;
  for (auto const cone : {gsp::FrictionCone::elliptic, gsp::FrictionCone::pyramidal}) {
    auto d = box_on_plane({0, 0, 1});
    d.pairs.clear();
    d.bodies[1].pos = {0, 0, 0.1 + gap};
    auto& ball = d.bodies[1].geoms[0];
    ball.type = gsp::ShapeType::sphere;
    ball.size = {0.1, 0, 0};
    ball.friction = {0.5, 0.005, 0.0001};
    d.bodies[0].geoms[0].friction = ball.friction;
    ball.hard = cone == gsp::FrictionCone::elliptic;  // edges of pyramids are soft
    auto const compiled = gsp::compile(d);
    auto const model = gsp::make_model<double>(exec, compiled);
    auto state = gsp::make_state(exec, model);
    auto sim = gsp::make_simulation(exec, model, compiled, {.cone = cone});
    auto const qvel = gsp_test::host(state.qvel);
    qvel(0, 0) = 1;
    qvel(0, 1) = 0.5;
    Kokkos::deep_copy(state.qvel, qvel);
    gsp::step(exec, model, state, sim, {.solver = {.iterations = 1000, .tolerance = 5e-13f}});
    Kokkos::View<double* [6], Kokkos::LayoutRight, Mem> force("force", sim.contacts.dist.extent(0));
    gsp::contact_forces(exec, model, sim.collision, sim.contacts, sim.rows, sim.impulses, force);
    auto const f = gsp_test::host(force);
    auto const frame = gsp_test::host(sim.contacts.frame);
    auto const qfrc = gsp_test::host(sim.solution.qfrc_constraint);
    CAPTURE(int(cone));
    REQUIRE(sim.contacts.demand(exec).contacts == 1);
    for (int k = 0; k < 3; ++k)
      CHECK(std::abs(f(0, 0) * frame(0, k) + f(0, 1) * frame(0, 3 + k) + f(0, 2) * frame(0, 6 + k) - qfrc(0, k)) < 1e-9);
    CHECK(qfrc(0, 2) > 1);
    if (cone == gsp::FrictionCone::pyramidal) continue;
    CHECK(f(0, 0) == doctest::Approx(m * (9.81 - gap / (h * h))).epsilon(1e-9));
    CHECK(std::hypot(f(0, 1), f(0, 2)) == doctest::Approx(0.5 * f(0, 0)).epsilon(1e-9));
  }
}

// A model, its contacts and its rows go together.
TEST_CASE_TEMPLATE("forces of another model are refused", Exec, GSP_TEST_EXECS) {
  Stages<Exec> s, other;
  s.step();
  other.step();
  CHECK(s.all_read());
  auto const read = [&](auto const& model, auto const& collision, auto const& contacts) {
    return refusal([&] { gsp::contact_forces(s.exec, model, collision, contacts, s.sim.rows, s.sim.impulses, s.force); });
  };
  std::string const why = "gsp::contact_forces: model, collision model, contacts and rows are of different models";
  CHECK(read(s.model, other.sim.collision, s.sim.contacts).find(why) == 0);
  CHECK(read(s.model, other.sim.collision, other.sim.contacts).find("gsp::contact_forces: the contacts are not those") == 0);
  auto d = box_on_plane({0, 0, 1});
  d.bodies[1].joints.pop_back();
  auto const narrow = gsp::make_model<double>(s.exec, gsp::compile(d));
  CHECK(read(narrow, s.sim.collision, s.sim.contacts).find(why) == 0);
  CHECK(refusal([&] {
          gsp::joint_forces(s.exec, narrow, s.sim.rows, s.sim.impulses, s.limit, s.friction);
        }).find("gsp::joint_forces: the rows have 3 degrees of freedom and the model 2") == 0);
}
