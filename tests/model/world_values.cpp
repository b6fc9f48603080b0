// Per-world values on every backend: masks, memory, shared fields, and the same numbers as a model that was made with the values.
#include <doctest/doctest.h>

#include <gsp/collision/geom_values.hpp>
#include <gsp/dynamics/energy.hpp>
#include <gsp/dynamics/object_poses.hpp>
#include <gsp/dynamics/set_constants.hpp>
#include <gsp/model/names.hpp>
#include <gsp/model/samples.hpp>
#include <gsp/step/step.hpp>
#include <gsp_test_execs.hpp>

#include "dynamics/random_tree.hpp"

using gsp::GeomField;
using gsp::ModelField;

namespace {
template <class Exec>
using Memory = typename Exec::memory_space;
template <class Exec>
using Values = Kokkos::View<double**, Kokkos::LayoutRight, Memory<Exec>>;

/// (worlds, row) on the device.
template <class Exec>
Values<Exec> to_values(Exec const& exec, std::vector<double> const& v, int worlds) {
  Values<Exec> const out("values", worlds, v.size() / worlds);
  gsp::detail::upload_bytes(exec, out.data(), v.data(), v.size() * sizeof(double));
  exec.fence();
  return out;
}
template <class Exec>
Kokkos::View<bool*, Memory<Exec>> to_mask(Exec const& exec, std::vector<int> const& v) {
  Kokkos::View<bool*, Memory<Exec>> const out("mask", v.size());
  std::unique_ptr<bool[]> const host(new bool[v.size()]);
  for (std::size_t i = 0; i < v.size(); ++i) host[i] = v[i] != 0;
  gsp::detail::upload_bytes(exec, out.data(), host.get(), v.size());
  exec.fence();
  return out;
}
template <class Exec, class R, class Mem>
std::vector<R> read(Exec const& exec, gsp::Model<R, Mem> const& model, ModelField field) {
  return gsp::detail::to_host(exec, gsp::world_values(model, field));
}
gsp::CompiledModel robots() { return gsp::compile(gsp::samples::quadruped_scene()); }
}  // namespace

TEST_CASE_TEMPLATE("values of the masked worlds change, all others stay", Exec, GSP_TEST_EXECS) {
  Exec const exec;
  auto const compiled = robots();
  int const worlds = 11, n = compiled.nbody;
  auto model = gsp::make_model<double>(exec, compiled);
  gsp::make_per_world(exec, model, {ModelField::body_mass}, worlds);
  auto const start = read(exec, model, ModelField::body_mass);
  for (int i = 0; i < worlds * n; ++i) CHECK(start[i] == compiled.body_mass[i % n]);
  std::vector<double> values(worlds * n);
  std::vector<int> mask(worlds);
  for (int w = 0; w < worlds; ++w) mask[w] = w % 3 == 1;
  for (int i = 0; i < worlds * n; ++i) values[i] = 1 + i;
  gsp::set_world_values(exec, model, ModelField::body_mass, to_values(exec, values, worlds), to_mask(exec, mask));
  auto const set = read(exec, model, ModelField::body_mass);
  for (int i = 0; i < worlds * n; ++i) CHECK(set[i] == (mask[i / n] ? values[i] : start[i]));

  // another field: the first keeps its values though the buffer moved; the shared ones stay shared
  auto const* before = model.body_mass.data;
  gsp::make_per_world(exec, model, {ModelField::dof_damping, ModelField::gravity, ModelField::body_mass}, worlds);
  CHECK(model.body_mass.data != before);
  CHECK(read(exec, model, ModelField::body_mass) == set);
  CHECK(model.dof_damping.stride == compiled.nv);
  CHECK(model.gravity.stride == 3);
  CHECK(model.jnt_range.stride == 0);
  gsp::set_world_values(exec, model, ModelField::body_mass, to_values(exec, values, worlds));
  CHECK(read(exec, model, ModelField::body_mass) == values);
}

TEST_CASE_TEMPLATE("moments of inertia in proportion, when asked", Exec, GSP_TEST_EXECS) {
  Exec const exec;
  auto const compiled = robots();
  int const worlds = 3, n = compiled.nbody;
  auto model = gsp::make_model<double>(exec, compiled);
  gsp::make_per_world(exec, model, {ModelField::body_mass, ModelField::body_inertia}, worlds);
  std::vector<double> values;
  for (int w = 0; w < worlds; ++w)
    for (int b = 0; b < n; ++b) values.push_back((w + 2) * compiled.body_mass[b]);
  gsp::set_world_values(exec, model, ModelField::body_mass, to_values(exec, values, worlds));
  auto inertia = read(exec, model, ModelField::body_inertia);
  for (int i = 0; i < 3 * worlds * n; ++i) CHECK(inertia[i] == compiled.body_inertia[i / 3 % n][i % 3]);
  for (double& x : values) x *= 3;
  gsp::set_world_values(exec, model, ModelField::body_mass, to_values(exec, values, worlds), gsp::AllWorlds{}, {.scale_inertia = true});
  inertia = read(exec, model, ModelField::body_inertia);
  for (int i = 0; i < 3 * worlds * n; ++i) CHECK(inertia[i] == doctest::Approx(3 * compiled.body_inertia[i / 3 % n][i % 3]).epsilon(1e-14));
}

TEST_CASE_TEMPLATE("what is not limited stays so", Exec, GSP_TEST_EXECS) {
  Exec const exec;
  auto compiled = robots();
  REQUIRE(compiled.nu > 1);
  for (int k = 0; k < compiled.nu; ++k) compiled.act_ctrllimited[k] = k % 2, compiled.act_ctrlrange[k] = {-1, 1};
  int const worlds = 2;
  auto model = gsp::make_model<double>(exec, compiled);
  gsp::make_per_world(exec, model, {ModelField::act_ctrlrange}, worlds);
  gsp::set_world_values(exec, model, ModelField::act_ctrlrange,
                        to_values(exec, std::vector<double>(worlds * compiled.nu * 2, 0.5), worlds));
  auto const range = read(exec, model, ModelField::act_ctrlrange);
  for (int i = 0; i < int(range.size()); ++i) {
    bool const limited = i / 2 % compiled.nu % 2;
    CHECK(limited == !std::isinf(range[i]));
    if (limited) CHECK(range[i] == 0.5);
  }
}

// A model made with other masses, armatures, frictions and sizes, and the same values set in one world of a model that shares them: the
// same steps. The constants come from the lanes on one side and from compile's dense matrices on the other, so the numbers agree to
// rounding: 1e-12 grows by less than 1e3 over 20 steps with contacts.
TEST_CASE_TEMPLATE("a world steps as a model of its own", Exec, GSP_TEST_EXECS) {
  Exec const exec;
  auto const base = gsp::samples::quadruped_scene();
  auto heavy = base;
  for (auto& body : heavy.bodies) {
    for (auto& g : body.geoms) g.has_mass ? g.mass *= 1.5 : g.density *= 1.5;
    if (body.has_inertial) {
      body.inertial.mass *= 1.5;
      for (double& x : body.inertial.inertia) x *= 1.5;
    }
    for (auto& j : body.joints) {
      j.damping += 0.02;
      if (j.type == gsp::JointType::hinge) j.armature += 0.01;
      if (j.type == gsp::JointType::hinge) j.frictionloss += 0.05;
    }
    for (auto& g : body.geoms) g.friction[0] *= 0.7;
  }
  auto const shared = gsp::compile(base), own = gsp::compile(heavy);
  int const worlds = 5, special = 3;
  auto const model_own = gsp::make_model<double>(exec, own);
  auto model = gsp::make_model<double>(exec, shared);
  gsp::make_per_world(
      exec, model,
      {ModelField::body_mass, ModelField::body_inertia, ModelField::dof_damping, ModelField::dof_armature, ModelField::dof_frictionloss},
      worlds);
  auto sim = gsp::make_simulation(exec, model, shared, {.worlds = worlds});
  gsp::make_per_world(exec, sim.collision, {GeomField::friction, GeomField::size}, worlds);
  std::vector<int> mask(worlds, 0);
  mask[special] = 1;
  auto const on = to_mask(exec, mask);
  auto const spread = [&](std::vector<double> const& row) {
    std::vector<double> all;
    for (int w = 0; w < worlds; ++w) all.insert(all.end(), row.begin(), row.end());
    return to_values(exec, all, worlds);
  };
  std::vector<double> friction, size;
  for (int g = 0; g < own.ngeom; ++g)
    for (int c = 0; c < 3; ++c) friction.push_back(own.geom_friction[g][c]), size.push_back(own.geom_size[g][c]);
  // (masses by option, so that the moments follow: they are 1.5 times as much in both)
  gsp::set_world_values(exec, model, ModelField::body_mass, spread(own.body_mass), on, {.scale_inertia = true});
  gsp::set_world_values(exec, model, ModelField::dof_damping, spread(own.dof_damping), on);
  gsp::set_world_values(exec, model, ModelField::dof_armature, spread(own.dof_armature), on);
  gsp::set_world_values(exec, model, ModelField::dof_frictionloss, spread(own.dof_frictionloss), on);
  gsp::set_world_values(exec, sim.collision, GeomField::friction, spread(friction), on);
  gsp::set_world_values(exec, sim.collision, GeomField::size, spread(size), on);
  auto const constants_before = read(exec, model, ModelField::dof_invweight0);
  gsp::set_constants(exec, model, sim.dynamics, on);
  auto const constants = read(exec, model, ModelField::dof_invweight0);
  for (int i = 0; i < worlds * shared.nv; ++i) {
    if (i / shared.nv == special)
      CHECK(constants[i] == doctest::Approx(own.dof_invweight0[i % shared.nv]).epsilon(1e-11));
    else
      CHECK(constants[i] == constants_before[i]);
  }

  auto const run = [&](auto const& m, auto& s, int n) {
    auto state = gsp::make_state(exec, m, {.worlds = n});
    gsp::step(exec, m, state, s, {.steps = 20, .solver = {.iterations = 2000, .tolerance = 5e-12f}});
    return gsp::detail::to_host(exec, state.qvel);
  };
  auto sim_own = gsp::make_simulation(exec, model_own, own, {.worlds = 1});
  auto sim_shared = gsp::make_simulation(exec, gsp::make_model<double>(exec, shared), shared, {.worlds = 1});
  auto const mixed = run(model, sim, worlds), alone = run(model_own, sim_own, 1),
             plain = run(gsp::make_model<double>(exec, shared), sim_shared, 1);
  double worst = 0, other = 0, change = 0;
  for (int i = 0; i < shared.nv; ++i) {
    worst = std::fmax(worst, std::fabs(mixed[special * shared.nv + i] - alone[i]));
    other = std::fmax(other, std::fabs(mixed[i] - plain[i]));
    change = std::fmax(change, std::fabs(alone[i] - plain[i]));
  }
  CHECK(worst < 1e-9);
  CHECK(other < 1e-9);
  CHECK(change > 1e-3);
}

TEST_CASE_TEMPLATE("sizes and poses of geoms reach the model and the collision model", Exec, GSP_TEST_EXECS) {
  Exec const exec;
  auto const compiled = robots();
  int const worlds = 3, n = compiled.ngeom;
  auto model = gsp::make_model<double>(exec, compiled);
  auto collision = gsp::make_collision_model<double>(exec, compiled);
  gsp::make_per_world(exec, model, collision, {GeomField::pos, GeomField::quat, GeomField::size, GeomField::friction}, worlds);
  std::vector<double> values;
  for (int i = 0; i < worlds * n * 3; ++i) values.push_back(0.01 * (i + 1));
  auto const mask = to_mask(exec, {0, 1, 1});
  for (auto const field : {GeomField::pos, GeomField::size, GeomField::friction})
    gsp::set_world_values(exec, model, collision, field, to_values(exec, values, worlds), mask);
  auto const size = read(exec, model, ModelField::geom_size), pos = read(exec, model, ModelField::geom_pos);
  auto const geom = gsp::detail::to_host(exec, collision.collider_geom);
  std::vector<double> collider_size(std::size_t(worlds) * collision.colliders * 3),
      collider_pose(std::size_t(worlds) * collision.colliders * 7);
  gsp::detail::download_bytes(exec, collider_size.data(), collision.collider_size.data, collider_size.size() * sizeof(double));
  gsp::detail::download_bytes(exec, collider_pose.data(), collision.collider_pose.data, collider_pose.size() * sizeof(double));
  exec.fence();
  for (int w = 0; w < worlds; ++w)
    for (int c = 0; c < collision.colliders; ++c)
      for (int k = 0; k < 3; ++k) {
        int const at = 3 * (w * n + geom[c]) + k;
        CHECK(size[at] == (w == 0 ? compiled.geom_size[geom[c]][k] : values[at]));
        CHECK(collider_size[3 * (w * collision.colliders + c) + k] == size[at]);
        CHECK(collider_pose[7 * (w * collision.colliders + c) + k] == pos[at]);
      }
}

TEST_CASE_TEMPLATE("misuse is refused in one sentence", Exec, GSP_TEST_EXECS) {
  Exec const exec;
  auto const compiled = robots();
  auto model = gsp::make_model<double>(exec, compiled);
  auto dynamics = gsp::make_dynamics(exec, model, {.worlds = 2});
  CHECK_THROWS_WITH_AS(gsp::world_values(model, ModelField::body_mass), doctest::Contains("body_mass is not per world"),
                       std::invalid_argument);
  CHECK_THROWS_WITH_AS(gsp::set_constants(exec, model, dynamics), doctest::Contains("call make_per_world"), std::invalid_argument);
  CHECK_THROWS_AS(gsp::make_per_world(exec, model, {ModelField::body_mass}, 0), std::invalid_argument);
  gsp::make_per_world(exec, model, {ModelField::body_mass}, 4);
  CHECK_THROWS_WITH_AS(gsp::make_per_world(exec, model, {ModelField::gravity}, 5),
                       doctest::Contains("for 4 worlds and not 5: give 4, or make the model anew"), std::invalid_argument);
  CHECK_THROWS_WITH_AS(gsp::set_constants(exec, model, dynamics), doctest::Contains("2 worlds and the model's values 4: make both"),
                       std::invalid_argument);
  CHECK_THROWS_WITH_AS(gsp::set_world_values(exec, model, ModelField::body_mass, Values<Exec>("v", 4, 1)),
                       doctest::Contains(("must be (4, " + std::to_string(compiled.nbody) + ", 1) and are (4, 1)").c_str()),
                       std::invalid_argument);
  CHECK_THROWS_WITH_AS(gsp::set_world_values(exec, model, ModelField::body_mass, Values<Exec>("v", 4, compiled.nbody), gsp::AllWorlds{},
                                             {.scale_inertia = true}),
                       doctest::Contains("scale_inertia changes body_inertia, which is not per world"), std::invalid_argument);
  auto collision = gsp::make_collision_model<double>(exec, compiled);
  CHECK_THROWS_WITH_AS(gsp::set_world_values(exec, collision, GeomField::size, Values<Exec>("v", 4, 3 * compiled.ngeom)),
                       doctest::Contains("geom size is not per world"), std::invalid_argument);
  gsp::make_per_world(exec, collision, {GeomField::size}, 4);
  Kokkos::View<bool*, typename Exec::memory_space> const mask("mask", 3);
  char const* const refused = "the mask has 3 worlds and the values 4: make them equal";
  CHECK_THROWS_WITH_AS(gsp::set_world_values(exec, collision, GeomField::size, Values<Exec>("v", 4, 3 * compiled.ngeom), mask),
                       doctest::Contains(refused), std::invalid_argument);
  CHECK_THROWS_WITH_AS(gsp::set_world_values(exec, model, ModelField::body_mass, Values<Exec>("v", 4, compiled.nbody), mask),
                       doctest::Contains(refused), std::invalid_argument);
  auto four = gsp::make_dynamics(exec, model, {.worlds = 4});
  CHECK_THROWS_WITH_AS(gsp::set_constants(exec, model, four, mask), doctest::Contains("the mask has 3 worlds and the dynamics 4"),
                       std::invalid_argument);
}

TEST_CASE_TEMPLATE("what does not fit together is refused where it meets", Exec, GSP_TEST_EXECS) {
  Exec const exec;
  auto const compiled = robots();
  auto model = gsp::make_model<double>(exec, compiled);
  auto const shared = model;
  auto state = gsp::make_state(exec, model, {.worlds = 4});
  auto poses = gsp::make_poses(exec, model, {.worlds = 4});
  auto simulation = gsp::make_simulation(exec, model, compiled, {.worlds = 4});
  auto& dynamics = simulation.dynamics;
  Values<Exec> const out("out", 4, model.nv);
  // every stage that takes dynamics, with this state, these dynamics and these poses
  auto const refused = [&](auto const& m, auto& s, auto& d, auto& p, char const* why) {
    Values<Exec> energy("energy", d.worlds, 2);
    auto const check = [&](auto const& call) { CHECK_THROWS_WITH_AS(call(), doctest::Contains(why), std::invalid_argument); };
    check([&] { gsp::forward_kinematics(exec, m, s, p, d); });
    check([&] { gsp::mass_matrix(exec, m, s, p, d); });
    check([&] { gsp::bias_forces(exec, m, s, p, d); });
    check([&] { gsp::passive_forces(exec, m, s, p, d); });
    check([&] { gsp::actuator_forces(exec, m, s, p, d); });
    check([&] { gsp::smooth_dynamics(exec, m, s, p, d); });
    check([&] { gsp::smooth_step(exec, m, s, p, d); });
    check([&] { gsp::energies(exec, m, s, p, d, energy); });
  };
  auto const refused_without_poses = [&](auto const& m, auto& s, auto& d, char const* why) {
    CHECK_THROWS_WITH_AS(gsp::factor(exec, m, s, d), doctest::Contains(why), std::invalid_argument);
    CHECK_THROWS_WITH_AS(gsp::integrate(exec, m, s, d), doctest::Contains(why), std::invalid_argument);
  };

  // gravity compensation, which no body has, becomes a term: it lengthens the layout
  gsp::make_per_world(exec, model, {ModelField::body_gravcomp}, 4);
  char const* const layout = "call make_dynamics (or make_simulation) after make_per_world";
  refused(model, state, dynamics, poses, layout);
  refused_without_poses(model, state, dynamics, layout);
  CHECK_THROWS_WITH_AS(gsp::copy_dofs(exec, model, dynamics, &gsp::DynamicsLayout::bias, out), doctest::Contains(layout),
                       std::invalid_argument);
  CHECK_THROWS_WITH_AS(gsp::step(exec, model, state, simulation), doctest::Contains(layout), std::invalid_argument);
  auto longer = gsp::make_dynamics(exec, model, {.worlds = 4});
  gsp::smooth_dynamics(exec, model, state, poses, longer);
  // a field that lengthens nothing may come later, and another model of the same robot has the same layout
  gsp::make_per_world(exec, model, {ModelField::dof_damping}, 4);
  gsp::smooth_dynamics(exec, model, state, poses, longer);
  gsp::smooth_dynamics(exec, gsp::make_model<double>(exec, compiled), state, poses, dynamics);

  // values for fewer worlds than there are
  auto few = shared;
  gsp::make_per_world(exec, few, {ModelField::dof_damping}, 2);
  char const* const values = "values for 2 worlds, and 4 are asked for: make the model anew (of geoms: the collision model)";
  refused(few, state, dynamics, poses, values);
  refused_without_poses(few, state, dynamics, values);
  CHECK_THROWS_WITH_AS(gsp::reset(exec, few, state), doctest::Contains(values), std::invalid_argument);
  CHECK_THROWS_WITH_AS(gsp::make_state(exec, few, {.worlds = 4}), doctest::Contains(values), std::invalid_argument);
  CHECK_THROWS_WITH_AS(gsp::make_dynamics(exec, few, {.worlds = 4}), doctest::Contains(values), std::invalid_argument);
  CHECK_THROWS_WITH_AS(gsp::step(exec, few, state, simulation), doctest::Contains(values), std::invalid_argument);
  Kokkos::View<double***, Kokkos::LayoutRight, Memory<Exec>> x("x", 4, few.ngeom, 3), q("q", 4, few.ngeom, 4);
  CHECK_THROWS_WITH_AS(gsp::geom_poses(exec, few, poses, x, q), doctest::Contains(values), std::invalid_argument);
  auto collision = simulation.collision;
  gsp::make_per_world(exec, collision, {GeomField::size}, 2);
  CHECK_THROWS_WITH_AS(gsp::collide(exec, collision, poses, simulation.contacts), doctest::Contains(values), std::invalid_argument);
  gsp::make_per_world(exec, few, {ModelField::gravity}, 2);
  auto two = gsp::make_state(exec, few, {.worlds = 2});  // fewer worlds than values: those of the first worlds
  auto two_poses = gsp::make_poses(exec, few, {.worlds = 2});
  auto two_dynamics = gsp::make_dynamics(exec, few, {.worlds = 2});
  gsp::smooth_dynamics(exec, few, two, two_poses, two_dynamics);

  // other numbers of worlds, other models
  refused(shared, two, dynamics, poses, "the state has 2 worlds and the dynamics 4");
  refused_without_poses(shared, two, dynamics, "the state has 2 worlds and the dynamics 4");
  auto three_poses = gsp::make_poses(exec, shared, {.worlds = 3});
  refused(shared, state, dynamics, three_poses, "call make_poses with this model and as many worlds");
  auto const pendulum = gsp::make_model<double>(exec, gsp::compile(gsp::samples::pendulum()));
  auto other = gsp::make_state(exec, pendulum, {.worlds = 4});
  refused(shared, other, dynamics, poses, "state.qpos is (4, 1)");
  refused_without_poses(shared, other, dynamics, "state.qpos is (4, 1)");
  auto other_poses = gsp::make_poses(exec, pendulum, {.worlds = 4});
  refused(pendulum, other, dynamics, other_poses, "made for another model");
  CHECK_THROWS_WITH_AS(gsp::integrate(exec, shared, state, dynamics, {.z = Values<Exec>("z", 4, 2)}), doctest::Contains("z is (4, 2)"),
                       std::invalid_argument);
}

// A field may be pointed at an array of the user's own, with a row for each world.
TEST_CASE_TEMPLATE("a field stays at a user's own array", Exec, GSP_TEST_EXECS) {
  Exec const exec;
  auto const compiled = robots();
  int const worlds = 3, n = compiled.nbody;
  auto model = gsp::make_model<double>(exec, compiled);
  std::vector<double> masses;
  for (int i = 0; i < worlds * n; ++i) masses.push_back(1 + i);
  auto const mine = to_values(exec, masses, worlds);
  model.body_mass.data = mine.data();
  model.body_mass.stride = n;
  gsp::make_per_world(exec, model, {ModelField::gravity, ModelField::body_mass}, worlds);
  gsp::make_per_world(exec, model, {ModelField::dof_damping}, worlds);
  CHECK(model.body_mass.data == mine.data());
  CHECK(model.body_mass.stride == n);
  CHECK(gsp::detail::to_host(exec, mine) == masses);
  char const* const own = "points at an array of your own";
  CHECK_THROWS_WITH_AS(gsp::world_values(model, ModelField::body_mass), doctest::Contains(own), std::invalid_argument);
  CHECK_THROWS_WITH_AS(gsp::set_world_values(exec, model, ModelField::body_mass, mine), doctest::Contains(own), std::invalid_argument);
  // what follows from it follows from the array: each mass k times the compiled one gives 1 / k of the inverse weights of a lone slider
  auto slider = gsp::make_model<double>(exec, gsp::compile(gsp::samples::pendulum()));
  std::vector<double> heavier;
  for (int w = 0; w < worlds; ++w) heavier.insert(heavier.end(), {0., w + 1.});
  auto const heavy = to_values(exec, heavier, worlds);
  slider.body_mass.data = heavy.data();
  slider.body_mass.stride = 2;
  gsp::make_per_world(exec, slider, {ModelField::body_mass}, worlds);
  auto dynamics = gsp::make_dynamics(exec, slider, {.worlds = worlds});
  gsp::set_constants(exec, slider, dynamics);
  CHECK(slider.body_mass.data == heavy.data());
  auto const M0 = read(exec, slider, ModelField::dof_M0);
  CHECK(M0[2] - M0[1] == doctest::Approx(M0[1] - M0[0]).epsilon(1e-12));  // I + m l^2
  CHECK(M0[1] > M0[0]);
}

// What is read back is what was set, of each geom that collides; one of them is changed, and no other.
TEST_CASE_TEMPLATE("geoms' values are read back", Exec, GSP_TEST_EXECS) {
  Exec const exec;
  int const worlds = 3;
  auto const compiled = gsp::compile(gsp::samples::quadruped_scene());
  auto collision = gsp::make_collision_model<double>(exec, compiled);
  std::vector<bool> collides(std::size_t(compiled.ngeom), false);
  auto const of_collider = gsp_test::host(collision.collider_geom);
  for (int c = 0; c < collision.colliders; ++c) collides[std::size_t(of_collider(c))] = true;
  struct Case {
    GeomField field;
    int components;
  };
  for (auto const& [field, components] : {Case{GeomField::pos, 3}, Case{GeomField::quat, 4}, Case{GeomField::size, 3},
                                          Case{GeomField::friction, 3}, Case{GeomField::solref, 2}, Case{GeomField::solimp, 5}}) {
    CAPTURE(int(field));
    Kokkos::View<double***, Kokkos::LayoutRight, Memory<Exec>> values("values", worlds, compiled.ngeom, components);
    if (field != GeomField::quat)  // which comes with pos
      CHECK_THROWS_WITH_AS(gsp::copy_world_values(exec, collision, field, values), doctest::Contains("make_per_world first"),
                           std::invalid_argument);
    gsp::make_per_world(exec, collision, {field}, worlds);
    gsp::copy_world_values(exec, collision, field, values);
    exec.fence();
    auto const first = gsp_test::host(values);
    int const g = gsp::geom_id(compiled, "FL_foot"), w = 1;
    REQUIRE(collides[std::size_t(g)]);
    if (field == GeomField::friction)
      for (int c = 0; c < 3; ++c) CHECK(first(w, g, c) == compiled.geom_friction[std::size_t(g)][c]);
    auto const changed = gsp_test::host(values);
    for (int c = 0; c < components; ++c) changed(w, g, c) = field == GeomField::quat ? 0.5 : 0.01 * (c + 1);
    Kokkos::deep_copy(values, changed);
    gsp::set_world_values(exec, collision, field, values);
    Kokkos::deep_copy(values, -1.);
    gsp::copy_world_values(exec, collision, field, values);
    exec.fence();
    auto const found = gsp_test::host(values);
    for (int world = 0; world < worlds; ++world)
      for (int geom = 0; geom < compiled.ngeom; ++geom)
        for (int c = 0; c < components; ++c) CHECK(found(world, geom, c) == (collides[std::size_t(geom)] ? changed(world, geom, c) : -1.));
    Kokkos::View<double**, Kokkos::LayoutRight, Memory<Exec>> few("few", worlds, 2);
    CHECK_THROWS_WITH_AS(gsp::copy_world_values(exec, collision, field, few), doctest::Contains("must be (3, "), std::invalid_argument);
  }
}
