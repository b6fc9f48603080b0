// The recipes of docs/how_to.md: each case is one of them, and checks that what the page claims happens.
#include <doctest/doctest.h>
#include <unistd.h>

#include <cmath>
#include <cstring>
#include <gsp/gsp.hpp>
#include <numeric>

#include "dynamics/random_tree.hpp"

namespace {
using Exec = Kokkos::DefaultExecutionSpace;
using Mem = Exec::memory_space;

template <class A, class B>
bool same_row(A const& a, B const& b, int w) {
  return std::memcmp(&a(w, 0), &b(w, 0), sizeof(a(0, 0)) * a.extent(1)) == 0;
}
gsp::GeomDescription geom(gsp::ShapeType type, gsp::Double3 const& size) {
  gsp::GeomDescription g;
  g.type = type;
  g.size = size;
  return g;
}
}  // namespace

TEST_CASE("the start of all recipes, and a keyframe in all worlds") {
  // example-begin start
  Kokkos::DefaultExecutionSpace const exec;
  int const worlds = 16;
  auto const compiled = gsp::compile(gsp::samples::quadruped_scene());  // or of gsp::io::read_mjcf("robot.xml")
  auto const model = gsp::make_model<float>(exec, compiled);
  auto state = gsp::make_state(exec, model, {.worlds = worlds});
  auto sim = gsp::make_simulation(exec, model, compiled, {.worlds = worlds});

  gsp::set_keyframe(exec, model, compiled, "stand", state);
  gsp::step(exec, model, state, sim, {.steps = 100});
  // example-end start
  auto const qpos = gsp_test::host(state.qpos);
  for (int w = 0; w < worlds; ++w) CHECK(std::abs(qpos(w, 2) - compiled.keyframes[0].qpos[2]) < 0.05);  // it still stands

  // example-begin keyframe
  gsp::set_keyframe(exec, model, compiled, "stand", state);
  auto const places = Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, state.qpos);
  for (int w = 0; w < worlds; ++w) places(w, 2) += 0.01f * float(w);  // dropped from different heights
  Kokkos::deep_copy(state.qpos, places);
  // example-end keyframe
  gsp::step(exec, model, state, sim, {.steps = 1});
  auto const dropped = gsp_test::host(state.qpos);
  for (int w = 0; w < worlds; ++w) CHECK(std::abs(dropped(w, 2) - compiled.keyframes[0].qpos[2] - 0.01 * w) < 0.002);
}

TEST_CASE("names and indices") {
  auto const compiled = gsp::compile(gsp::samples::quadruped_scene());
  // example-begin names
  int const knee = gsp::joint_id(compiled, "FL_knee");  // body_id, geom_id ...: an unknown name throws, and tells the nearest
  int const position = compiled.jnt_qposadr[knee], velocity = compiled.jnt_dofadr[knee];  // its columns in qpos and qvel
  int const shank = compiled.jnt_body[knee];
  std::string const& name = compiled.body_name[shank];  // and back: body_name, jnt_name, geom_name, site_name, act_name ...; "": none
  // example-end names
  CHECK(name == "FL_shank");
  CHECK(compiled.jnt_name[knee] == "FL_knee");
  CHECK(velocity == compiled.jnt_dofadr[knee]);
  CHECK(compiled.qpos0[position] == compiled.qpos0[7 + 2]);
  CHECK_THROWS_WITH_AS(gsp::joint_id(compiled, "FL_kne"), doctest::Contains("nearest: 'FL_knee'"), gsp::Error);
}

// A body of its own archetype sleeps by its tree: the boxes of a stack do, the world has none.
TEST_CASE("who sleeps") {
  Exec const exec;
  int const worlds = 3;
  auto const compiled = gsp::compile(gsp::samples::stack(3));
  auto const model = gsp::make_model<float>(exec, compiled);
  auto state = gsp::make_state(exec, model, {.worlds = worlds});
  auto sim = gsp::make_simulation(exec, model, compiled, {.worlds = worlds, .sleep = true});
  gsp::step(exec, model, state, sim, {.steps = 1000});
  // example-begin body_sleeps
  int const tree = compiled.body_tree[gsp::body_id(compiled, "box1")];  // -1: fixed to the world
  Kokkos::View<bool*, Mem> const rests("rests", worlds);
  auto const sleep = sim.sleep.state;
  Kokkos::parallel_for(
      "rests", Kokkos::RangePolicy<Exec>(exec, 0, worlds), KOKKOS_LAMBDA(int w) { rests(w) = sleep.sleeps(w, tree); });
  // example-end body_sleeps
  CHECK(compiled.body_tree[0] == -1);
  for (int w = 0; w < worlds; ++w) CHECK(gsp_test::host(rests)(w));
}

// What the solver leaves is told where it is asked for: more sweeps and a smaller tolerance leave less.
TEST_CASE("options of the solver") {
  Exec const exec;
  auto const compiled = gsp::compile(gsp::samples::stack(5));
  auto const model = gsp::make_model<float>(exec, compiled);
  auto state = gsp::make_state(exec, model);
  auto sim = gsp::make_simulation(exec, model, compiled);
  // example-begin solver
  gsp::PgsOptions solver;    // profile stable; in profile mujoco: gsp::NewtonOptions, {.newton = ...}
  solver.iterations = 200;   // sweeps at most (100)
  solver.tolerance = 1e-5f;  // a world stops when no rate changes by more than this share of what gravity does in a step (1e-4)
  solver.residual = true;    // measure what is left
  gsp::step(exec, model, state, sim, {.steps = 100, .solver = solver});
  auto const sweeps = Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, sim.solution.iterations);  // (worlds) of the last step
  auto const left = Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, sim.solution.residual);      // (worlds) [m/s, rad/s]
  // example-end solver
  CHECK(sweeps(0) >= solver.least);
  CHECK(sweeps(0) <= solver.iterations);
  CHECK(left(0) < 1e-4f);
}

// A box on a belt comes to the belt's speed.
TEST_CASE("belts") {
  Exec const exec;
  gsp::Description d;
  // example-begin belt
  gsp::GeomDescription belt;  // in MJCF: <geom type="box" size="2 .3 .05" surfacevel="0.5 0 0"/>
  belt.type = gsp::ShapeType::box;
  belt.size = {2, 0.3, 0.05};
  belt.surface_velocity = {0.5, 0, 0, 0, 0, 0};  // of its surface in the geom's frame: linear [m/s], angular [rad/s] (a turntable)
  // example-end belt
  d.bodies[0].geoms.push_back(belt);
  gsp::BodyDescription parcel;
  parcel.name = "parcel", parcel.parent = 0, parcel.pos = {-1, 0, 0.15};
  parcel.joints.emplace_back().type = gsp::JointType::free;
  parcel.geoms.push_back(geom(gsp::ShapeType::box, {0.1, 0.1, 0.1}));
  d.bodies.push_back(parcel);
  auto const compiled = gsp::compile(d);
  auto const model = gsp::make_model<float>(exec, compiled);
  auto state = gsp::make_state(exec, model);
  auto sim = gsp::make_simulation(exec, model, compiled);
  gsp::step(exec, model, state, sim, {.steps = 500});
  CHECK(std::abs(gsp_test::host(state.qvel)(0, 0) - 0.5) < 1e-3);
}

// A cup that presses with 20 N holds a kilogram under it, and lets go where it is told to.
TEST_CASE("suction") {
  Exec const exec;
  gsp::Description d;
  gsp::BodyDescription cup;
  cup.name = "cup", cup.parent = 0, cup.pos = {0, 0, 1};
  cup.geoms.push_back(geom(gsp::ShapeType::box, {0.1, 0.1, 0.05}));
  gsp::BodyDescription load;
  load.name = "load", load.parent = 0, load.pos = {0, 0, 0.9};
  load.joints.emplace_back().type = gsp::JointType::free;
  load.geoms.push_back(geom(gsp::ShapeType::box, {0.05, 0.05, 0.05}));
  load.geoms[0].has_mass = true, load.geoms[0].mass = 1;
  d.bodies.push_back(cup);
  d.bodies.push_back(load);
  // example-begin suction
  gsp::ActuatorDescription suction;  // in MJCF: <adhesion name="suction" body="cup" gain="20" ctrlrange="0 1"/>
  suction.name = "suction";
  suction.target = gsp::Transmission::body;  // all contacts of the body share the force
  suction.target_name = "cup";
  suction.gainprm = {20};  // [N] at ctrl 1
  suction.ctrl_limited = true, suction.ctrl_range = {0, 1};
  d.actuators.push_back(suction);
  // example-end suction
  auto const compiled = gsp::compile(d);
  auto const model = gsp::make_model<float>(exec, compiled);
  auto state = gsp::make_state(exec, model);
  auto sim = gsp::make_simulation(exec, model, compiled);
  Kokkos::deep_copy(state.ctrl, 1.f);
  gsp::step(exec, model, state, sim, {.steps = 500});
  CHECK(std::abs(gsp_test::host(state.qpos)(0, 2) - 0.9) < 2e-3);
  Kokkos::deep_copy(state.ctrl, 0.f);
  gsp::step(exec, model, state, sim, {.steps = 500});
  CHECK(gsp_test::host(state.qpos)(0, 2) < -3);
}

// A ball that hangs on a connect: its force is the weight.
TEST_CASE("forces of equalities") {
  Exec const exec;
  int const worlds = 2;
  gsp::Description d;
  gsp::BodyDescription lamp;
  lamp.name = "lamp", lamp.parent = 0, lamp.pos = {0, 0, 1};
  lamp.joints.emplace_back().type = gsp::JointType::free;
  lamp.geoms.push_back(geom(gsp::ShapeType::sphere, {0.1, 0, 0}));
  lamp.geoms[0].has_mass = true, lamp.geoms[0].mass = 2;
  d.bodies.push_back(lamp);
  d.equalities.push_back({.name = "hook", .type = gsp::EqualityType::connect, .name1 = "lamp"});
  auto const compiled = gsp::compile(d);
  auto const model = gsp::make_model<float>(exec, compiled);
  auto state = gsp::make_state(exec, model, {.worlds = worlds});
  auto sim = gsp::make_simulation(exec, model, compiled, {.worlds = worlds});
  gsp::step(exec, model, state, sim, {.steps = 1000});
  // example-begin equality_forces
  int const hook = gsp::equality_id(compiled, "hook");
  auto const impulse = gsp::impulses_of<gsp::Equalities<float, Mem>>(sim.rows, sim.impulses);  // again after each step
  Kokkos::View<float* [3], Kokkos::LayoutRight, Mem> const pull("pull", worlds);               // [N] on body 1, world axes
  float const h = float(model.timestep);
  Kokkos::parallel_for(
      "pull", Kokkos::RangePolicy<Exec>(exec, 0, worlds), KOKKOS_LAMBDA(int w) {
        for (int row = 0; row < 3; ++row) pull(w, row) = impulse(w, hook, row) / h;
      });
  // example-end equality_forces
  for (int w = 0; w < worlds; ++w) {
    CHECK(std::abs(gsp_test::host(pull)(w, 2) - 2 * 9.81) < 0.02);
    CHECK(std::abs(gsp_test::host(pull)(w, 0)) < 0.02);
  }
}

TEST_CASE("reset of single worlds") {
  Exec const exec;
  int const worlds = 16;
  auto const compiled = gsp::compile(gsp::samples::quadruped_scene());
  auto const model = gsp::make_model<float>(exec, compiled);
  auto state = gsp::make_state(exec, model, {.worlds = worlds});
  auto sim = gsp::make_simulation(exec, model, compiled, {.worlds = worlds});
  gsp::set_keyframe(exec, model, compiled, "stand", state);
  auto const lifted = gsp_test::host(state.qpos);
  for (int w = 0; w < worlds; w += 3) lifted(w, 4) = 0.9f;  // some stand badly: turned about x
  Kokkos::deep_copy(state.qpos, lifted);
  gsp::step(exec, model, state, sim, {.steps = 150});
  auto const before = gsp_test::snapshot(state.qpos), speed_before = gsp_test::snapshot(state.qvel);

  // example-begin reset
  auto start = gsp::make_state(exec, model, {.worlds = 1});  // once: where an episode begins
  gsp::set_keyframe(exec, model, compiled, "stand", start);
  Kokkos::View<bool*, Mem> const done("done", worlds);

  auto const qpos = state.qpos;
  auto const status = state.status;
  Kokkos::parallel_for(
      "fallen", Kokkos::RangePolicy<Exec>(exec, 0, worlds), KOKKOS_LAMBDA(int w) {
        float const x = qpos(w, 4), y = qpos(w, 5);  // height of the body's z axis: 1 - 2 (x^2 + y^2)
        done(w) = 1 - 2 * (x * x + y * y) < 0.5f || status(w) != 0;
      });
  gsp::reset(exec, model, state, done, start);
  // example-end reset

  auto const now = gsp_test::host(state.qpos), speed = gsp_test::host(state.qvel), began = gsp_test::host(start.qpos);
  auto const chosen = gsp_test::host(done);
  int resets = 0;
  for (int w = 0; w < worlds; ++w) {
    resets += chosen(w);
    if (chosen(w)) {
      CHECK(std::memcmp(&now(w, 0), &began(0, 0), sizeof(float) * now.extent(1)) == 0);
      CHECK(speed(w, 0) == 0);
      CHECK(gsp_test::host(state.steps)(w) == 0);
    } else {
      CHECK(same_row(now, before, w));
      CHECK(same_row(speed, speed_before, w));
      CHECK(gsp_test::host(state.steps)(w) == 150);
    }
  }
  CHECK(resets > 0);
  CHECK(resets < worlds);
}

// What follows is the same to the bit, in all worlds and in chosen ones; the others keep what they have.
TEST_CASE("save and restore") {
  Exec const exec;
  int const worlds = 8;
  auto const compiled = gsp::compile(gsp::samples::quadruped_scene());
  auto const model = gsp::make_model<float>(exec, compiled);
  auto state = gsp::make_state(exec, model, {.worlds = worlds});
  auto sim = gsp::make_simulation(exec, model, compiled, {.worlds = worlds});
  gsp::set_keyframe(exec, model, compiled, "stand", state);
  Kokkos::View<bool*, Mem> const done("done", worlds);
  auto const chosen = Kokkos::create_mirror_view(done);
  for (int w = 0; w < worlds; ++w) chosen(w) = w % 3 == 0;
  Kokkos::deep_copy(done, chosen);
  // example-begin snapshot
  gsp::step(exec, model, state, sim, {.steps = 200});  // until the robot stands
  auto stands = gsp::make_snapshot(exec, state, sim);  // allocates; into the same memory again: gsp::save(exec, state, sim, stands)
  gsp::step(exec, model, state, sim, {.steps = 50});
  gsp::restore(exec, stands, state, sim);  // all worlds: what follows is what followed, bit for bit
  gsp::step(exec, model, state, sim, {.steps = 50});
  gsp::restore(exec, stands, state, sim, done);  // those of a mask, a View<bool*>
  // example-end snapshot
  auto const now = gsp_test::snapshot(state.qpos), then = gsp_test::host(stands.state.qpos);
  gsp::restore(exec, stands, state, sim);
  gsp::step(exec, model, state, sim, {.steps = 50});
  auto const after = gsp_test::host(state.qpos);
  for (int w = 0; w < worlds; ++w) {
    CHECK(same_row(now, chosen(w) ? then : after, w));
    CHECK(!same_row(then, after, w));
  }
}

TEST_CASE("step on many cores") {
  Exec const exec;
  int const worlds = 64;
  auto const compiled = gsp::compile(gsp::samples::quadruped_scene());
  auto const model = gsp::make_model<float>(exec, compiled);
  auto state = gsp::make_state(exec, model, {.worlds = worlds});
  auto other = gsp::make_state(exec, model, {.worlds = worlds});
  Kokkos::View<int*, Mem> const done("done", worlds);
  Kokkos::parallel_for(
      "every_third", Kokkos::RangePolicy<Exec>(exec, 0, worlds), KOKKOS_LAMBDA(int w) { done(w) = w % 3 == 0; });

  // example-begin tiles
  auto const shapes = gsp::make_collision_model<float>(exec, compiled);
  auto tiles = gsp::make_tiles(exec, model, compiled, shapes, state);  // rows of `state`, a simulation each; allocates
  gsp::step(exec, tiles, {.steps = 20});
  gsp::for_tiles(exec, tiles, [&](auto& tile) {  // what one simulation does, by the worlds of a tile
    auto const of_tile = Kokkos::subview(done, std::pair(tile.first, tile.first + tile.worlds()));
    gsp::reset(tile.exec, tile.model, tile.state, of_tile);
    gsp::step(tile.exec, tile.model, tile.state, tile.simulation, {.steps = 20});
  });
  // example-end tiles

  auto sim = gsp::make_simulation(exec, model, compiled, {.worlds = worlds});
  gsp::step(exec, model, other, sim, {.steps = 20});
  gsp::reset(exec, model, other, done);
  gsp::step(exec, model, other, sim, {.steps = 20});
  auto const q = gsp_test::host(state.qpos), expected = gsp_test::host(other.qpos);
  for (int w = 0; w < worlds; ++w) CHECK(same_row(q, expected, w));
}

// Dropped from H = 1 m a ball comes with v = sqrt(2 g H) and goes with e v: it rises to e^2 H. Tolerance: v to what gravity does in a step,
// 0.02 m/s of 4.4, twice that of its square, and the top between two steps.
TEST_CASE("bodies that bounce") {
  Exec const exec;
  // example-begin bounce
  gsp::GeomDescription ball;  // in MJCF: <geom size="0.1" hard="true" restitution="0.8"/>
  ball.size = {0.1, 0, 0};
  ball.hard = true;        // without it the contact is a soft one, and restitution and erp do nothing
  ball.restitution = 0.8;  // the share of an impact's speed that comes back; of two hard geoms the greater one
  ball.erp = 0.2;          // the share of an overlap that is taken back in a step
  // example-end bounce
  gsp::Description d;
  d.bodies[0].geoms.push_back(geom(gsp::ShapeType::plane, {0, 0, 1}));
  for (bool const hard : {true, false}) {
    gsp::BodyDescription b;
    b.parent = 0;
    b.pos = {hard ? 0. : 1., 0, 1.1};
    b.joints.emplace_back().type = gsp::JointType::free;
    ball.hard = hard;
    b.geoms.push_back(ball);
    d.bodies.push_back(b);
  }
  auto const compiled = gsp::compile(d);
  auto const model = gsp::make_model<float>(exec, compiled);
  auto state = gsp::make_state(exec, model);
  auto sim = gsp::make_simulation(exec, model, compiled);
  double top[2] = {0, 0};
  for (int t = 0; t < 500; ++t) {
    gsp::step(exec, model, state, sim);
    auto const q = gsp_test::host(state.qpos);
    for (int b = 0; b < 2; ++b)
      if (t > 250) top[b] = std::fmax(top[b], q(0, 7 * b + 2) - 0.1);  // after 0.45 s it is down
  }
  CHECK(top[0] == doctest::Approx(0.64).epsilon(0.02));
  CHECK(top[1] < 0.05);
}

TEST_CASE("sleep") {
  Exec const exec;
  int const worlds = 4;
  auto const compiled = gsp::compile(gsp::samples::stack(3));
  auto const model = gsp::make_model<float>(exec, compiled);
  auto state = gsp::make_state(exec, model, {.worlds = worlds});
  // example-begin sleep
  auto sim = gsp::make_simulation(exec, model, compiled, {.worlds = worlds, .sleep = true});  // or <flag sleep="enable"/> in the file
  gsp::step(exec, model, state, sim, {.steps = 1000});

  auto const asleep = Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, sim.sleep.asleep);  // (worlds) trees that sleep
  int sleepers = 0;
  for (int w = 0; w < worlds; ++w) sleepers += asleep(w);
  // example-end sleep
  CHECK(sleepers == 3 * worlds);
  CHECK(gsp_test::host(sim.rows.count)(0) == 0);
  auto const before = gsp_test::snapshot(state.qpos);
  gsp::step(exec, model, state, sim, {.steps = 100});
  for (int w = 0; w < worlds; ++w) CHECK(same_row(gsp_test::host(state.qpos), before, w));
  // example-begin wake
  gsp::wake(exec, sim.sleep);  // or of the worlds of a mask: after changes that nobody can see, such as another friction
  // example-end wake
  gsp::step(exec, model, state, sim);
  CHECK(gsp_test::host(sim.sleep.asleep)(0) == 0);
  CHECK(gsp_test::host(sim.rows.count)(0) > 0);
}

// At rest the floor carries all: sum of the forces' z = m g in every world. What the solver leaves is a change of rates of at most its
// tolerance a sweep, 1e-6 m/s: m 1e-6 / h = 0.012 N for 24 kg, and float's rounding of velocities adds as much.
TEST_CASE("contact forces") {
  Exec const exec;
  int const worlds = 5;
  auto const compiled = gsp::compile(gsp::samples::stack(3));
  auto const model = gsp::make_model<float>(exec, compiled);
  auto state = gsp::make_state(exec, model, {.worlds = worlds});
  auto sim = gsp::make_simulation(exec, model, compiled, {.worlds = worlds});
  gsp::step(exec, model, state, sim, {.steps = 1000});

  // example-begin contact_forces
  Kokkos::View<float* [6], Kokkos::LayoutRight, Mem> force("force", sim.contacts.capacity());  // again after the pool has grown
  gsp::contact_forces(exec, model, sim.collision, sim.contacts, sim.rows, sim.impulses, force);

  Kokkos::View<float*, Mem> const on_floor("on_floor", worlds);  // [N]
  auto const contacts = sim.contacts;
  auto const status = state.status;
  Kokkos::parallel_for(
      "weight", Kokkos::RangePolicy<Exec>(exec, 0, worlds), KOKKOS_LAMBDA(int w) {
        int const first = contacts.first_of(w), end = first + contacts.count_of(w);
        if (status(w) & gsp::status::stopped) return;  // impulses may be NaN
        for (int c = first; c < end; ++c) {
          if (contacts.body1(c) != 0) continue;                                                   // not with the floor
          for (int r = 0; r < 3; ++r) on_floor(w) += contacts.frame(c, 3 * r + 2) * force(c, r);  // z of axis r in the world
        }
      });
  // example-end contact_forces

  int const world = 3;
  double carried = 0;
  // example-begin contacts_on_host
  auto const host = [](auto const& view) { return Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, view); };
  auto const first = host(contacts.first), end = host(contacts.end), geom1 = host(contacts.geom1), geom2 = host(contacts.geom2);
  auto const pos = host(contacts.pos);
  auto const dist = host(contacts.dist);
  auto const forces = host(force);
  for (int c = first(world); c < end(world); ++c) {  // those of one world lie side by side
    std::printf("%s on %s at (%.2f, %.2f, %.2f), %.1e m apart: %.2f N along the normal\n", compiled.geom_name[geom2(c)].c_str(),
                compiled.geom_name[geom1(c)].c_str(), pos(c, 0), pos(c, 1), pos(c, 2), dist(c), forces(c, 0));
  }
  // example-end contacts_on_host
  for (int c = first(world); c < end(world); ++c) carried += geom1(c) == 0 ? forces(c, 0) : 0;
  CHECK(end(world) - first(world) == 12);

  double const weight = std::accumulate(compiled.body_mass.begin(), compiled.body_mass.end(), 0.) * 9.81;
  CHECK(std::abs(carried - weight) < 0.03);
  auto const found = gsp_test::host(on_floor);
  for (int w = 0; w < worlds; ++w) {
    MESSAGE("on the floor " << found(w) << " N of " << weight);
    CHECK(std::abs(found(w) - weight) < 0.03);
  }
}

// Standing feet carry the robot: their mean normal forces sum to m g. The friction of four feet that press inwards changes no normal's
// sum; what is left is that of the contact forces above, of a robot that still settles by less than 1e-3 of its weight.
TEST_CASE("forces on feet over a control step") {
  Exec const exec;
  int const worlds = 3, decimation = 4;
  auto robot = gsp::samples::quadruped();
  robot.bodies[0].geoms.push_back(geom(gsp::ShapeType::plane, {5, 5, 1}));
  auto const compiled = gsp::compile(robot);
  auto const model = gsp::make_model<float>(exec, compiled);
  auto state = gsp::make_state(exec, model, {.worlds = worlds});
  auto sim = gsp::make_simulation(exec, model, compiled, {.worlds = worlds});
  gsp::set_keyframe(exec, model, compiled, "stand", state);
  gsp::step(exec, model, state, sim, {.steps = 1000});
  Kokkos::View<float* [6], Kokkos::LayoutRight, Mem> force("force", sim.contacts.capacity());

  // example-begin feet
  char const* const feet[] = {"FL_foot", "FR_foot", "RL_foot", "RR_foot"};
  Kokkos::View<int*, Mem> const foot_of("foot_of", model.ngeom);  // of a geom, -1: none
  auto const of_geom = Kokkos::create_mirror_view(foot_of);
  Kokkos::deep_copy(of_geom, -1);
  for (int k = 0; k < 4; ++k) of_geom(gsp::geom_id(compiled, feet[k])) = k;
  Kokkos::deep_copy(foot_of, of_geom);

  Kokkos::View<float**, Kokkos::LayoutRight, Mem> const normal("normal", worlds, 4);  // [N], mean over the control step
  Kokkos::View<bool**, Kokkos::LayoutRight, Mem> const touched("touched", worlds, 4);
  for (int t = 0; t < decimation; ++t) {
    gsp::step(exec, model, state, sim, {.poses = false});  // forces are read between steps: each is waited for
    if (force.extent(0) < std::size_t(sim.contacts.capacity())) Kokkos::realloc(force, sim.contacts.capacity());
    gsp::contact_forces(exec, model, sim.collision, sim.contacts, sim.rows, sim.impulses, force);
    auto const contacts = sim.contacts;  // its pool may have grown
    Kokkos::parallel_for(
        "feet", Kokkos::RangePolicy<Exec>(exec, 0, worlds), KOKKOS_LAMBDA(int w) {
          for (int c = contacts.first_of(w), end = c + contacts.count_of(w); c < end; ++c) {
            int const a = foot_of(contacts.geom1(c)), b = foot_of(contacts.geom2(c)), foot = a > b ? a : b;
            if (foot < 0 || !(force(c, 0) > 0)) continue;  // contacts within the margin that do not act are listed too
            normal(w, foot) += force(c, 0) / decimation;
            touched(w, foot) = true;
          }
        });
  }
  // example-end feet

  double const weight = std::accumulate(compiled.body_mass.begin(), compiled.body_mass.end(), 0.) * 9.81;
  auto const mean = gsp_test::host(normal);
  auto const touch = gsp_test::host(touched);
  for (int w = 0; w < worlds; ++w) {
    double sum = 0;
    for (int k = 0; k < 4; ++k) {
      sum += mean(w, k);
      CHECK(touch(w, k));
    }
    CHECK(std::abs(sum - weight) < 1e-3 * weight);
  }
}

// The stages of profile mujoco in a loop of one's own: the same bits as step, where the loop starts from the impulses of before as it does.
TEST_CASE("a loop of one's own in profile mujoco") {
  Exec const exec;
  int const worlds = 2, steps = 50;
  auto const compiled = gsp::compile(gsp::samples::quadruped_scene());
  auto const model = gsp::make_model<float>(exec, compiled, {.profile = gsp::Profile::mujoco});
  auto state = gsp::make_state(exec, model, {.worlds = worlds}), other = gsp::make_state(exec, model, {.worlds = worlds});
  gsp::set_keyframe(exec, model, compiled, "stand", state), gsp::set_keyframe(exec, model, compiled, "stand", other);

  // example-begin mujoco_loop
  auto const collision = gsp::make_collision_model<float>(exec, compiled);
  auto dynamics = gsp::make_dynamics(exec, model, {.worlds = worlds});
  auto poses = gsp::make_poses(exec, model, {.worlds = worlds});
  auto contacts = gsp::make_contacts(exec, collision, gsp::contacts_options(model, worlds));
  auto rows = gsp::make_rows(exec, model, gsp::rows_options(model, collision, worlds));
  auto impulses = gsp::make_impulses(exec, rows);
  auto solution = gsp::make_solution(exec, model, {.worlds = worlds});
  auto buffers = gsp::make_newton(exec, rows);
  auto progress = gsp::make_progress(exec);
  gsp::NoslipOptions const noslip = gsp::noslip_options(compiled);
  for (int t = 0; t < steps;) {
    gsp::smooth_dynamics(exec, model, state, poses, dynamics);
    gsp::collide(exec, collision, poses, contacts);
    auto const types = gsp::model_constraints(model, state, poses, dynamics, collision, contacts, compiled.option.cone);
    gsp::assemble(exec, model, state, dynamics, types, rows, impulses, progress);
    gsp::newton(exec, rows, impulses, solution, buffers, progress);
    if (noslip.iterations > 0) gsp::noslip(exec, rows, impulses, solution, progress, noslip);
    gsp::integrate(exec, model, state, dynamics, progress, solution);
    bool const more_contacts = gsp::grow(exec, contacts), more_rows = gsp::grow(exec, rows, impulses, progress);
    gsp::grow(exec, rows, buffers);
    t += !more_contacts && !more_rows;  // else something did not fit, and nothing has moved
  }
  // example-end mujoco_loop

  auto sim = gsp::make_simulation(exec, model, compiled, {.worlds = worlds});
  gsp::step(exec, model, other, sim, {.steps = steps});
  auto const a = gsp_test::host(state.qpos), b = gsp_test::host(other.qpos);
  for (int w = 0; w < worlds; ++w) CHECK(same_row(a, b, w));
}

// On a slope with tangent 0.25: sticks where mu > 0.25, else it slides with a = g (sin - mu cos). Starting from a fall of half a
// millimetre costs at most a few steps of the 500.
TEST_CASE("friction per world") {
  Exec const exec;
  int const worlds = 6;
  auto const compiled = gsp::compile(gsp::samples::ramp(0.25, 0.5));
  auto const model = gsp::make_model<float>(exec, compiled);
  auto state = gsp::make_state(exec, model, {.worlds = worlds});
  auto sim = gsp::make_simulation(exec, model, compiled, {.worlds = worlds});

  // example-begin friction
  gsp::make_per_world(exec, sim.collision, {gsp::GeomField::friction}, worlds);  // once
  Kokkos::View<float***, Kokkos::LayoutRight, Mem> const friction("friction", worlds, model.ngeom, 3);
  Kokkos::parallel_for(
      "draw", Kokkos::RangePolicy<Exec>(exec, 0, worlds * model.ngeom), KOKKOS_LAMBDA(int i) {
        int const w = i / int(friction.extent(1)), g = i % int(friction.extent(1));
        friction(w, g, 0) = 0.1f * float(w + 1);  // sliding; of the geom of higher priority, else the greater one
        friction(w, g, 1) = 0.005f;               // torsional [m]
        friction(w, g, 2) = 0.0001f;              // rolling [m]
      });
  gsp::set_world_values(exec, sim.collision, gsp::GeomField::friction, friction);
  // example-end friction

  int const steps = 500;
  gsp::step(exec, model, state, sim, {.steps = steps});
  auto const qvel = gsp_test::host(state.qvel);
  double const angle = std::atan(0.25), t = steps * compiled.option.timestep;
  for (int w = 0; w < worlds; ++w) {
    double const mu = 0.1 * (w + 1), v = std::sqrt(qvel(w, 0) * qvel(w, 0) + qvel(w, 2) * qvel(w, 2));
    double const expected = mu < 0.25 ? 9.81 * (std::sin(angle) - mu * std::cos(angle)) * t : 0;
    CHECK(std::abs(v - expected) < (mu < 0.25 ? 0.02 * expected : 1e-4));
  }
}

// Twice the load, twice the force that holds it.
TEST_CASE("masses per world") {
  Exec const exec;
  int const worlds = 4;
  auto const compiled = gsp::compile(gsp::samples::stack(1));
  // example-begin masses
  auto model = gsp::make_model<float>(exec, compiled);
  gsp::make_per_world(exec, model, {gsp::ModelField::body_mass}, worlds);  // before make_dynamics and make_simulation
  auto state = gsp::make_state(exec, model, {.worlds = worlds});
  auto sim = gsp::make_simulation(exec, model, compiled, {.worlds = worlds});

  auto const masses = gsp::world_values(model, gsp::ModelField::body_mass);  // (worlds, bodies) of the model itself
  int const box = gsp::body_id(compiled, "box0");
  Kokkos::parallel_for(
      "load", Kokkos::RangePolicy<Exec>(exec, 0, worlds), KOKKOS_LAMBDA(int w) { masses(w, box) *= float(w + 1); });
  gsp::set_constants(exec, model, sim.dynamics);  // what follows from masses: how soft a contact is, for one
  // example-end masses

  gsp::step(exec, model, state, sim, {.steps = 1000});
  auto const force = gsp_test::host(sim.solution.qfrc_constraint);
  for (int w = 0; w < worlds; ++w) CHECK(force(w, 2) == doctest::Approx(8 * 9.81 * (w + 1)).epsilon(2e-4));
}

// The energy of a pendulum without friction: Runge-Kutta keeps it to O(h^4) while the semi-implicit scheme lets it swing by O(h).
TEST_CASE("integrators and profiles") {
  Exec const exec;
  double lost[2];
  for (bool rk : {false, true}) {
    auto description = gsp::samples::pendulum();
    // example-begin integrator
    if (rk) description.option.integrator = gsp::Integrator::rk4;  // what <option integrator="RK4"/> reads as
    auto const compiled = gsp::compile(description);
    auto const model = gsp::make_model<float>(exec, compiled, {.profile = gsp::Profile::mujoco, .timestep = 0.01});
    // example-end integrator
    auto state = gsp::make_state(exec, model);
    auto sim = gsp::make_simulation(exec, model, compiled);
    auto const q = gsp_test::host(state.qpos);
    q(0, 0) = 1.2f;
    Kokkos::deep_copy(state.qpos, q);
    double const m = compiled.body_mass[1], d = -compiled.body_ipos[1][2], I = compiled.body_inertia[1][0] + m * d * d;
    double const begin = m * 9.81 * d * (1 - std::cos(1.2));
    lost[rk] = 0;
    for (int t = 0; t < 300; ++t) {
      gsp::step(exec, model, state, sim);
      double const x = gsp_test::host(state.qpos)(0, 0), v = gsp_test::host(state.qvel)(0, 0);
      lost[rk] = std::fmax(lost[rk], std::abs((I * v * v / 2 + m * 9.81 * d * (1 - std::cos(x))) / begin - 1));
    }
  }
  MESSAGE("energy off by " << lost[0] << " (Euler), " << lost[1] << " (RK4)");
  double const hw = 0.01 * std::sqrt(9.81 / 0.35);  // h w0, the pendulum being about 0.35 m long
  CHECK(lost[0] > 0.1 * hw);
  CHECK(lost[1] < hw * hw * hw);  // of order 4, and float rounds by 1e-7 a step

  // example-begin profile
  auto const compiled = gsp::compile(gsp::samples::quadruped_scene());
  auto const model = gsp::make_model<float>(exec, compiled, {.profile = gsp::Profile::mujoco});
  auto state = gsp::make_state(exec, model);
  auto sim = gsp::make_simulation(exec, model, compiled);  // or with another cone than the file's: {.cone = gsp::FrictionCone::elliptic}
  gsp::step(exec, model, state, sim, {.steps = 500});
  // example-end profile
  auto const quiet = gsp_test::host(state.qvel);
  for (int i = 0; i < model.nv; ++i) CHECK(std::abs(quiet(0, i)) < 5);  // it has fallen, and lies
  CHECK(gsp_test::host(state.status)(0) == 0);
}

// The imu's site has the axes of the trunk: the gyro shows qvel's angular velocity, to the roundings of one rotation there and back.
TEST_CASE("sensors") {
  Exec const exec;
  int const worlds = 3;
  // example-begin sensors
  auto robot = gsp::samples::quadruped_scene();  // MJCF's <sensor> gives the same
  robot.sensors.push_back({.name = "turning", .type = "gyro", .object_type = "site", .object = "imu"});
  robot.sensors.push_back({.name = "trunk", .type = "framepos", .object_type = "xbody", .object = "trunk"});
  auto const compiled = gsp::compile(robot);
  auto const model = gsp::make_model<float>(exec, compiled);
  auto state = gsp::make_state(exec, model, {.worlds = worlds});
  auto sim = gsp::make_simulation(exec, model, compiled, {.worlds = worlds});
  auto sensors = gsp::make_sensors(exec, model, compiled, {.worlds = worlds});
  Kokkos::View<float**, Kokkos::LayoutRight, Mem> const data("data", worlds, compiled.nsensordata);

  gsp::step(exec, model, state, sim, {.steps = 20, .poses = false});
  gsp::smooth_dynamics(exec, model, state, sim.poses, sim.dynamics, {.keep_all = true});  // of the state as it is now
  gsp::smooth_sensors(exec, model, state, sim.poses, sim.dynamics, sensors, data);
  int const gyro = compiled.sensor_adr[gsp::sensor_id(compiled, "turning")];  // its columns: gyro .. gyro + 2
  // example-end sensors
  auto const found = gsp_test::host(data), qvel = gsp_test::host(state.qvel), qpos = gsp_test::host(state.qpos);
  int const trunk = compiled.sensor_adr[gsp::sensor_id(compiled, "trunk")];
  for (int w = 0; w < worlds; ++w)
    for (int c = 0; c < 3; ++c) {
      CHECK(std::abs(found(w, gyro + c) - qvel(w, 3 + c)) < 1e-6 * (1 + std::abs(qvel(w, 3 + c))));
      CHECK(std::abs(found(w, trunk + c) - qpos(w, c)) < 1e-6);
    }
}

// At rest after two seconds: the feet carry the robot, the imu feels gravity, within what float and the solver leave.
TEST_CASE("all sensors") {
  Exec const exec;
  int const worlds = 2;
  auto robot = gsp::samples::quadruped_scene({.boxes = 0, .balls = 0});
  robot.sensors.push_back({.name = "felt", .type = "accelerometer", .object_type = "site", .object = "imu"});
  robot.sensors.push_back({.name = "ground",
                           .type = "contact",
                           .object_type = "body",
                           .object = "world",
                           .reference_type = "subtree",
                           .reference = "trunk",
                           .settings = {{"data", "found force"}, {"reduce", "netforce"}}});
  auto const compiled = gsp::compile(robot);
  auto const model = gsp::make_model<float>(exec, compiled);
  auto state = gsp::make_state(exec, model, {.worlds = worlds});
  auto sim = gsp::make_simulation(exec, model, compiled, {.worlds = worlds});
  auto sensors = gsp::make_sensors(exec, model, compiled, {.worlds = worlds});
  Kokkos::View<float**, Kokkos::LayoutRight, Mem> const data("data", worlds, compiled.nsensordata);
  // example-begin all_sensors
  gsp::step(exec, model, state, sim, {.steps = 1000, .poses = false});
  gsp::forward(exec, model, state, sim);  // contacts and forces of the state as it is now
  gsp::read_sensors(exec, model, state, sim, sensors, data);
  // example-end all_sensors
  auto const found = gsp_test::host(data);
  int const felt = compiled.sensor_adr[gsp::sensor_id(compiled, "felt")], ground = compiled.sensor_adr[gsp::sensor_id(compiled, "ground")];
  double mass = 0;
  for (double const m : compiled.body_mass) mass += m;
  double const acceleration = std::hypot(found(1, felt), found(1, felt + 1), found(1, felt + 2));
  CHECK(acceleration == doctest::Approx(9.81).epsilon(0.01));
  CHECK(found(1, ground) >= 3);
  CHECK(found(1, ground + 3) == doctest::Approx(9.81 * mass).epsilon(0.01));
}

// A turn of 50 steps from a robot that stands: the floor's points lie at 0, within 5 deviations of the noise along rays that go down.
TEST_CASE("a LiDAR unit") {
  Exec const exec;
  int const worlds = 2;
  auto const compiled = gsp::compile(gsp::samples::quadruped_scene());
  auto const model = gsp::make_model<float>(exec, compiled);
  auto state = gsp::make_state(exec, model, {.worlds = worlds});
  auto sim = gsp::make_simulation(exec, model, compiled, {.worlds = worlds});
  gsp::set_keyframe(exec, model, compiled, "stand", state);
  int const steps = 50;
  // example-begin lidar
  auto lidar = gsp::make_ray_scan<float>(exec, compiled, gsp::ouster_pattern(32, 512, 0.8),  // or vlp16_pattern(), mid360_pattern() ...
                                         {.body = "trunk", .pos = {0, 0, 0.15}},             // or {.site = "imu"}
                                         {.worlds = worlds,
                                          .timestep = compiled.option.timestep,
                                          .min_range = 0.2,
                                          .max_range = 30,
                                          .self = gsp::SelfFilter::subtree,
                                          .noise = {.range_sigma = 0.01, .dropout = 0.01}});
  auto scene = gsp::make_ray_scene<float>(exec, model, compiled, {.worlds = worlds});
  gsp::forward_kinematics(exec, model, state, sim.poses, sim.dynamics);
  gsp::begin_ray_scan(exec, sim.poses, lidar);
  for (int k = 0; k < steps; ++k) {
    gsp::step(exec, model, state, sim);
    gsp::place_ray_geoms(exec, model, sim.poses, scene);
    gsp::scan_rays(exec, scene, sim.poses, lidar, k);  // the rays that leave in this step, each from where the unit is then
  }
  // example-end lidar
  auto const range = gsp_test::host(lidar.range);
  auto const point = gsp_test::host(lidar.point);
  auto const geom = gsp_test::host(lidar.geom);
  REQUIRE(lidar.options.rays == 32 * 512);
  int floor = 0, back = 0;
  for (int w = 0; w < worlds; ++w)
    for (int k = 0; k < lidar.options.rays; ++k) {
      if (geom(w, k) < 0) continue;
      ++back;
      CHECK(range(w, k) >= 0.2f);
      if (gsp::ShapeType(compiled.geom_type[std::size_t(geom(w, k))]) != gsp::ShapeType::plane) continue;
      ++floor;
      CHECK(std::abs(point(w, k, 2)) < 0.06);
    }
  CHECK(floor > worlds * 1000);
  CHECK(back >= floor);
}

// A step of 0.25 m before a robot that stands on the floor; where a scan reaches beyond the ground, -1 is lower than any of it.
TEST_CASE("a height scan") {
  Exec const exec;
  int const worlds = 2;
  auto description = gsp::samples::quadruped_scene({.boxes = 0, .balls = 0});
  auto step = geom(gsp::ShapeType::box, {1, 5, 0.25});
  step.pos = {1.35, 0, 0};
  description.bodies[0].geoms.push_back(step);
  auto const compiled = gsp::compile(description);
  auto const model = gsp::make_model<float>(exec, compiled);
  auto state = gsp::make_state(exec, model, {.worlds = worlds});
  auto sim = gsp::make_simulation(exec, model, compiled, {.worlds = worlds});
  gsp::set_keyframe(exec, model, compiled, "stand", state);
  // example-begin height_scan
  auto const unit = gsp::make_ray_mount<float>(exec, compiled, gsp::height_scan_pattern(1.6, 1.0, 0.1),
                                               {.body = "trunk", .pos = {0, 0, 1}, .alignment = gsp::RayAlignment::yaw});
  auto scene = gsp::make_ray_scene<float>(exec, model, compiled, {.worlds = worlds});
  int const points = unit.count();  // 17 along x, fastest, by 11 along y
  auto rays = gsp::make_rays<float>(exec, {.worlds = worlds, .count = points});
  auto hits = gsp::make_ray_hits<float>(exec, {.worlds = worlds, .count = points});
  Kokkos::View<float**, Kokkos::LayoutRight, Mem> const heights("heights", worlds, points);  // [m] in the world

  gsp::step(exec, model, state, sim);
  gsp::mount_rays(exec, sim.poses, unit, rays);
  gsp::place_ray_geoms(exec, model, sim.poses, scene);
  gsp::cast_rays(exec, scene, rays, hits, gsp::hide_self(compiled, gsp::body_id(compiled, "trunk"), gsp::SelfFilter::subtree));
  // example-end height_scan
  // example-begin heights
  auto const origin = rays.origin;
  auto const distance = hits.distance;
  Kokkos::parallel_for(
      "heights", Kokkos::RangePolicy<Exec>(exec, 0, worlds * points), KOKKOS_LAMBDA(int i) {
        int const w = i / points, k = i % points;
        float const d = distance(w, k);  // -1: nothing is below
        heights(w, k) = d < 0 ? -1.f : origin(w, k, 2) - d;
      });
  // example-end heights
  auto const found = gsp_test::host(heights);
  auto const from = gsp_test::host(rays.origin);
  auto const place = gsp_test::host(sim.poses.xpos);
  REQUIRE(points == 187);
  for (int w = 0; w < worlds; ++w)
    for (int k = 0; k < points; ++k) {
      CHECK(std::abs(from(w, k, 2) - place(w, gsp::body_id(compiled, "trunk"), 2) - 1) < 1e-6);  // level, however the trunk is tilted
      float const x = from(w, k, 0);
      if (std::abs(x - 0.35f) < 1e-3f) continue;  // the step's edge
      CHECK(std::abs(found(w, k) - (x > 0.35f ? 0.25f : 0.f)) < 1e-5);
    }
}

// After it worlds that are done stand where an episode begins, at time 0, the others have gone on by the steps asked for; sensors and
// poses are of what the state is now.
TEST_CASE("a control step") {
  Exec const exec;
  int const worlds = 6, decimation = 4;
  auto robot = gsp::samples::quadruped_scene();
  robot.sensors.push_back({.name = "trunk", .type = "framepos", .object_type = "xbody", .object = "trunk"});
  auto const compiled = gsp::compile(robot);
  auto const model = gsp::make_model<float>(exec, compiled);
  auto state = gsp::make_state(exec, model, {.worlds = worlds});
  auto start = gsp::make_state(exec, model, {.worlds = 1});
  auto sim = gsp::make_simulation(exec, model, compiled, {.worlds = worlds});
  auto sensors = gsp::make_sensors(exec, model, compiled, {.worlds = worlds});
  Kokkos::View<float**, Kokkos::LayoutRight, Mem> data("data", worlds, compiled.nsensordata);
  Kokkos::View<bool*, Mem> const done("done", worlds);
  auto const chosen = Kokkos::create_mirror_view(done);
  for (int w = 0; w < worlds; ++w) chosen(w) = w % 2 == 1;
  Kokkos::deep_copy(done, chosen);
  gsp::set_keyframe(exec, model, compiled, "stand", start);
  gsp::set_keyframe(exec, model, compiled, "stand", state);

  // example-begin control_step
  for (int left = decimation; left > 0; left = gsp::settle(exec, sim))  // what did not fit is launched again
    for (int i = 0; i < left; ++i) gsp::launch_step(exec, model, state, sim);
  gsp::reset(exec, model, state, done, start);                                            // worlds whose episode has ended
  gsp::smooth_dynamics(exec, model, state, sim.poses, sim.dynamics, {.keep_all = true});  // poses, and what sensors read
  gsp::smooth_sensors(exec, model, state, sim.poses, sim.dynamics, sensors, data);
  // example-end control_step

  auto const steps = gsp_test::host(state.steps);
  auto const found = gsp_test::host(data), qpos = gsp_test::host(state.qpos), began = gsp_test::host(start.qpos);
  auto const xpos = gsp_test::host(sim.poses.xpos);
  int const trunk = gsp::body_id(compiled, "trunk");
  for (int w = 0; w < worlds; ++w) {
    CHECK(steps(w) == (chosen(w) ? 0 : decimation));
    for (int c = 0; c < 3; ++c) {
      CHECK(std::abs(found(w, c) - qpos(w, c)) < 1e-6);
      CHECK(xpos(w, trunk, c) == found(w, c));
      if (chosen(w)) CHECK(qpos(w, c) == began(0, c));
    }
  }
}

// A wall 3 m ahead of the trunk's middle, across the view: depth is camera z, so 3 m less where the camera sits, all over the picture.
// The wall's Gaussians are flat discs on both faces of a plate of 2 mm: within 2 mm and rounding.
TEST_CASE("cameras on a robot") {
  Exec const exec;
  int const worlds = 2;
  auto robot = gsp::samples::quadruped();
  auto wall = geom(gsp::ShapeType::box, {0.001, 4, 4});
  wall.pos = {3.001, 0, 0};
  robot.bodies[0].geoms.push_back(wall);
  auto const compiled = gsp::compile(robot);
  auto const model = gsp::make_model<float>(exec, compiled);
  auto state = gsp::make_state(exec, model, {.worlds = worlds});
  auto sim = gsp::make_simulation(exec, model, compiled, {.worlds = worlds});
  gsp::set_keyframe(exec, model, compiled, "stand", state);
  auto const qpos = gsp_test::host(state.qpos);
  qpos(1, 0) = 0.5f;  // the robot of world 1 stands half a metre nearer
  Kokkos::deep_copy(state.qpos, qpos);
  gsp::forward_kinematics(exec, model, state, sim.poses, sim.dynamics);

  // example-begin camera
  int const width = 64, height = 48;
  auto mounts = gsp::make_camera_mounts(exec, model, compiled,
                                        {{.camera = "head"},  // of the model
                                         {.body = "trunk", .pos = {0.3, 0, 0.1}, .look_at = gsp::Double3{1, 0, 0.1}, .fovy = 0.9}},
                                        {.worlds = worlds, .width = width, .height = height});
  auto cameras = gsp::make_cameras(exec, mounts.images());
  auto const cloud = gsp::make_gaussians(exec, gsp::sample_surface(compiled, {.count = 60000}));  // a scene: add it to the list
  auto frames = gsp::make_frames(exec, cloud, {.images = mounts.images(), .width = width, .height = height});

  gsp::cameras_of(exec, model, sim.poses, mounts, cameras);  // each time that poses have changed
  gsp::render(exec, cloud, sim.poses, cameras, frames);      // image 2 w + k: what mount k of world w sees
  // example-end camera

  auto const depth = gsp_test::host(frames.depth), alpha = gsp_test::host(frames.alpha);
  float const stands_at[] = {0.28f, 0.3f};
  for (int w = 0; w < worlds; ++w)
    for (int k = 0; k < 2; ++k) {
      CHECK(alpha(2 * w + k, height / 2, width / 2) > 0.95f);
      CHECK(std::abs(depth(2 * w + k, height / 2, width / 2) - (3 - stands_at[k] - qpos(w, 0))) < 3e-3);
    }
}

// A servo at rest: kp (ctrl - q) = m g d sin q, solved by Newton's method.
TEST_CASE("actuators") {
  Exec const exec;
  int const worlds = 7;
  double const kp = 60;
  auto description = gsp::samples::pendulum();
  gsp::ActuatorDescription servo;
  servo.name = "servo";
  servo.target_name = "hinge0";
  servo.gainprm[0] = kp;
  servo.bias_type = gsp::ActuatorBias::affine;
  servo.biasprm = {0, -kp, -12};
  description.actuators.push_back(servo);
  auto const compiled = gsp::compile(description);
  auto const model = gsp::make_model<float>(exec, compiled);
  auto state = gsp::make_state(exec, model, {.worlds = worlds});
  auto sim = gsp::make_simulation(exec, model, compiled, {.worlds = worlds});

  // example-begin actuators
  int const u = gsp::actuator_id(compiled, "servo");
  auto const ctrl = state.ctrl;
  Kokkos::parallel_for(
      "policy", Kokkos::RangePolicy<Exec>(exec, 0, worlds), KOKKOS_LAMBDA(int w) { ctrl(w, u) = 0.2f * float(w) - 0.6f; });
  gsp::step(exec, model, state, sim, {.steps = 4000});  // ctrl holds until it is written again
  // example-end actuators

  auto const qpos = gsp_test::host(state.qpos);
  double const m = compiled.body_mass[1], d = -compiled.body_ipos[1][2];
  for (int w = 0; w < worlds; ++w) {
    double const target = 0.2 * w - 0.6;
    double q = target;
    for (int i = 0; i < 20; ++i) q -= (kp * (q - target) + m * 9.81 * d * std::sin(q)) / (kp + m * 9.81 * d * std::cos(q));
    CHECK(qpos(w, 0) == doctest::Approx(q).epsilon(2e-6));
  }
}

// A free body of 2 kg without gravity: force f at its centre for n steps gives n h f / m, a torque about a principal axis n h t / I, to the
// roundings of n additions in float.
TEST_CASE("forces of one's own") {
  Exec const exec;
  int const worlds = 3;
  gsp::Description description;
  description.option.gravity = {0, 0, 0};
  int const b = gsp::add_body(description, 0, "ship", {0, 0, 1});
  description.bodies[b].joints.push_back({.name = "ship", .type = gsp::JointType::free});
  description.bodies[b].has_inertial = true;
  description.bodies[b].inertial = {.mass = 2, .inertia = {0.1, 0.2, 0.3, 0, 0, 0}};
  auto const compiled = gsp::compile(description);
  auto const model = gsp::make_model<float>(exec, compiled);
  auto state = gsp::make_state(exec, model, {.worlds = worlds});
  auto sim = gsp::make_simulation(exec, model, compiled, {.worlds = worlds});

  // example-begin forces
  int const body = gsp::body_id(compiled, "ship");
  Kokkos::View<float***, Kokkos::LayoutRight, Mem> const J("J", worlds, 6, model.nv);  // made once
  Kokkos::View<float**, Kokkos::LayoutRight, Mem> const wrench("wrench", worlds, 6);   // force [N], torque [N m], world axes
  auto const applied = state.qfrc_applied;                                             // (worlds, nv) [N, N m], held until it is changed
  auto const push = [&] {                                                              // before each step: the body has moved
    gsp::smooth_dynamics(exec, model, state, sim.poses, sim.dynamics);
    gsp::com_jacobian(exec, model, sim.poses, sim.dynamics, body, J);
    Kokkos::parallel_for(
        "push", Kokkos::RangePolicy<Exec>(exec, 0, worlds * int(applied.extent(1))), KOKKOS_LAMBDA(int i) {
          int const w = i / int(applied.extent(1)), dof = i % int(applied.extent(1));
          applied(w, dof) = 0;
          for (int c = 0; c < 6; ++c) applied(w, dof) += J(w, c, dof) * wrench(w, c);  // J^T (f, t)
        });
  };
  // example-end forces
  auto const set = gsp_test::host(wrench);
  for (int w = 0; w < worlds; ++w) {
    set(w, 0) = 4;
    set(w, 5) = 0.6f * float(w);
  }
  Kokkos::deep_copy(wrench, set);
  int const n = 50;
  for (int t = 0; t < n; ++t) {
    push();
    gsp::step(exec, model, state, sim);
  }
  auto const v = gsp_test::host(state.qvel);
  double const h = 0.002;
  for (int w = 0; w < worlds; ++w) {
    CHECK(v(w, 0) == doctest::Approx(n * h * 4 / 2).epsilon(n * 6e-8));
    CHECK(v(w, 5) == doctest::Approx(n * h * 0.6 * w / 0.3).epsilon(n * 6e-8));
    CHECK(std::abs(v(w, 1)) + std::abs(v(w, 3)) < 1e-6);
  }
}

// An instance is a queue of its own (on a GPU a stream): what runs on one does not change what another gives.
TEST_CASE("control in task space") {
  Exec const exec;
  int const worlds = 5;
  auto description = gsp::samples::arm();
  description.actuators.clear();  // torques instead of its servos
  description.keyframes.clear();
  auto const compiled = gsp::compile(description);
  auto const model = gsp::make_model<float>(exec, compiled);
  auto state = gsp::make_state(exec, model, {.worlds = worlds});
  auto sim = gsp::make_simulation(exec, model, compiled, {.worlds = worlds});
  auto const q = gsp_test::host(state.qpos);
  for (int w = 0; w < worlds; ++w) {
    q(w, 1) = 0.4f;
    q(w, 2) = q(w, 4) = 1.2f;
  }
  Kokkos::deep_copy(state.qpos, q);
  Kokkos::View<float**, Kokkos::LayoutRight, Mem> const goal("goal", worlds, 3);  // [m]
  auto const goals = gsp_test::host(goal);
  for (int w = 0; w < worlds; ++w) {
    goals(w, 0) = 0.35f + 0.02f * float(w);
    goals(w, 1) = 0.05f * float(w) - 0.1f;
    goals(w, 2) = 0.3f;
  }
  Kokkos::deep_copy(goal, goals);

  // example-begin task_space
  int const tool = gsp::site_id(compiled, "tool"), nv = model.nv;
  Kokkos::View<float***, Kokkos::LayoutRight, Mem> J("J", worlds, 6, nv), place("place", worlds, model.nsite, 3),
      turn("turn", worlds, model.nsite, 4);
  Kokkos::View<float**, Kokkos::LayoutRight, Mem> bias("bias", worlds, nv);  // Coriolis, centrifugal, gravity [N, N m]
  auto const applied = state.qfrc_applied, qvel = state.qvel;
  auto const reach = [&] {  // before each step: tau = bias + J^T (k (goal - x) - d dx/dt) - c qvel
    gsp::smooth_dynamics(exec, model, state, sim.poses, sim.dynamics, {.keep_all = true});
    gsp::copy_dofs(exec, model, sim.dynamics, &gsp::DynamicsLayout::bias, bias);
    gsp::site_jacobian(exec, model, sim.poses, sim.dynamics, tool, J);
    gsp::site_poses(exec, model, sim.poses, place, turn);
    Kokkos::parallel_for(
        "reach", Kokkos::RangePolicy<Exec>(exec, 0, worlds), KOKKOS_LAMBDA(int w) {
          for (int i = 0; i < nv; ++i) applied(w, i) = bias(w, i) - 2 * qvel(w, i);
          for (int c = 0; c < 3; ++c) {
            float rate = 0;
            for (int i = 0; i < nv; ++i) rate += J(w, c, i) * qvel(w, i);
            float const force = 800 * (goal(w, c) - place(w, tool, c)) - 80 * rate;
            for (int i = 0; i < nv; ++i) applied(w, i) += J(w, c, i) * force;
          }
        });
  };
  // example-end task_space
  for (int t = 0; t < 2500; ++t) {
    reach();
    gsp::step(exec, model, state, sim);
  }
  reach();
  auto const at = gsp_test::host(place);
  for (int w = 0; w < worlds; ++w)
    for (int c = 0; c < 3; ++c) CHECK(std::abs(at(w, tool, c) - goals(w, c)) < 1e-3f);
}

TEST_CASE("instances of an execution space") {
  if (Kokkos::DefaultExecutionSpace{}.concurrency() < 2) {
    MESSAGE("not tested: one thread cannot be divided");
    return;
  }
  auto const compiled = gsp::compile(gsp::samples::quadruped_scene());
  int const worlds = 4, steps = 30;
  // example-begin instances
  auto const instances = Kokkos::Experimental::partition_space(Kokkos::DefaultExecutionSpace{}, 1, 1);
  std::vector<gsp::Model<float, Mem>> models;
  std::vector<gsp::State<float, Mem>> states;
  std::vector<gsp::Simulation<float, Mem>> sims;
  for (auto const& exec : instances) {  // buffers of its own for each: nothing is shared
    models.push_back(gsp::make_model<float>(exec, compiled));
    states.push_back(gsp::make_state(exec, models.back(), {.worlds = worlds}));
    sims.push_back(gsp::make_simulation(exec, models.back(), compiled, {.worlds = worlds}));
    exec.fence();  // what was made is there before another instance uses it
  }
  std::vector<int> left(2, steps);
  while (left[0] > 0 || left[1] > 0) {
    for (int i = 0; i < 2; ++i)  // both queues are filled, and nobody waits
      for (int t = 0; t < left[i]; ++t) gsp::launch_step(instances[i], models[i], states[i], sims[i]);
    for (int i = 0; i < 2; ++i) left[i] = gsp::settle(instances[i], sims[i]);  // then each is waited for
  }
  // example-end instances
  Exec const exec;
  auto const model = gsp::make_model<float>(exec, compiled);
  auto state = gsp::make_state(exec, model, {.worlds = worlds});
  auto sim = gsp::make_simulation(exec, model, compiled, {.worlds = worlds});
  gsp::step(exec, model, state, sim, {.steps = steps});
  auto const alone = gsp_test::host(state.qpos);
  for (int i = 0; i < 2; ++i) {
    auto const qpos = gsp_test::host(states[i].qpos);
    for (int w = 0; w < worlds; ++w) CHECK(same_row(qpos, alone, w));
  }
}

#if defined(GSP_IO)
TEST_CASE("files of one's own") {
  Exec const exec;
  auto const folder = std::filesystem::temp_directory_path() / ("gsp_how_to_" + std::to_string(::getpid()));
  std::filesystem::create_directories(folder);
  struct Remove {
    std::filesystem::path path;
    ~Remove() { std::filesystem::remove_all(path); }
  } const remove{folder};
  gsp::io::write_mjcf(folder / "robot.xml", gsp::samples::quadruped_scene());
  {
    gsp::io::SplatSet capture = gsp::io::make_splat_set(2, 0);  // y down: 1.2 m below the camera, and bound to a link
    capture.positions = {0, 1.2f, 3, 0, 0, 0.1f};
    capture.scales = {0.1f, 0.1f, 0.01f, 0.1f, 0.1f, 0.1f};
    capture.opacities = {0.9f, 0.9f};
    capture.link_names = {"trunk"};
    capture.link = {-1, 0};
    gsp::io::write_ply(folder / "kitchen.ply", capture);
  }
  std::string const robot_file = (folder / "robot.xml").string(), scene_file = (folder / "kitchen.ply").string();

  // example-begin files
  auto const description = gsp::io::read_mjcf(robot_file);  // or read_urdf
  for (auto const& line : description.report)               // what is approximated, left out or without effect
    std::printf("%s:%d: %s: %s\n", line.file.c_str(), line.line, gsp::text(line.kind), line.text.c_str());
  auto const compiled = gsp::compile(description);

  auto scene = gsp::io::read_splats(scene_file);                                                // .ply, .splat, .spz, .sog, .glb, .usda
  gsp::io::transform(scene, {.position = {0, 0, 1.2}, .quat = {0.7071068, -0.7071068, 0, 0}});  // a capture has y down: z is up now
  auto const cloud = gsp::make_gaussians(exec, {gsp::io::to_gaussian_set(scene, compiled, scene_file),  // bound to links by their names
                                                gsp::sample_surface(compiled, {.world = false})});      // and a skin for the robot
  // example-end files
  CHECK(compiled.nq == gsp::compile(gsp::samples::quadruped_scene()).nq);
  auto const set = gsp::io::to_gaussian_set(scene, compiled, scene_file);
  CHECK(std::abs(set.positions[0]) + std::abs(set.positions[1] - 3) + std::abs(set.positions[2]) < 1e-5);  // on the floor, 3 m ahead in y
  CHECK(set.body == std::vector<int>{0, gsp::body_id(compiled, "trunk")});
  CHECK(set.positions[5] == 0.1f);  // in the link's frame: a move of the scene leaves it alone
  CHECK(cloud.count > 2);
}

TEST_CASE("traces for Python") {
  Exec const exec;
  int const worlds = 3, entries = 5;
  auto const compiled = gsp::compile(gsp::samples::pendulum());
  auto const model = gsp::make_model<float>(exec, compiled);
  auto state = gsp::make_state(exec, model, {.worlds = worlds});
  auto sim = gsp::make_simulation(exec, model, compiled, {.worlds = worlds});
  Kokkos::deep_copy(state.qpos, 0.5f);
  auto const path = (std::filesystem::temp_directory_path() / ("gsp_trace_" + std::to_string(::getpid()) + ".npz")).string();
  // example-begin trace
  std::vector<float> time, positions, velocities;  // (entries), (entries, worlds, nq), (entries, worlds, nv)
  auto const keep = [&](std::vector<float>& to, auto const& view) {
    auto const host = Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, view);
    to.insert(to.end(), host.data(), host.data() + host.size());
  };
  for (int t = 0; t < entries; ++t) {
    gsp::step(exec, model, state, sim, {.steps = 10});
    time.push_back(float((t + 1) * 10 * model.timestep));
    keep(positions, state.qpos);
    keep(velocities, state.qvel);
  }
  auto const T = std::size_t(entries), N = std::size_t(worlds), nq = std::size_t(model.nq), nv = std::size_t(model.nv);
  gsp::io::write_npz(path, {{"time", {{T}, time}}, {"qpos", {{T, N, nq}, positions}}, {"qvel", {{T, N, nv}, velocities}}});
  // example-end trace
  auto const back = gsp::io::read_npz(path);
  CHECK(back.at("qpos").shape == std::vector<std::size_t>{T, N, nq});
  CHECK(back.at("qvel").shape == std::vector<std::size_t>{T, N, nv});
  CHECK(back.at("qpos").as<float>() == positions);
  CHECK(back.at("time").as<float>().back() == doctest::Approx(50 * model.timestep));
  CHECK(positions.back() < positions.front());
  std::filesystem::remove(path);
}
#endif
