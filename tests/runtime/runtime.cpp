#include <doctest/doctest.h>

#include <chrono>
#include <cmath>
#include <cstring>
#include <gsp/model/compile.hpp>
#include <gsp/model/keyframe.hpp>
#include <gsp/model/samples.hpp>
#include <gsp/runtime/renderer.hpp>
#include <gsp/runtime/session.hpp>
#include <gsp/runtime/stage_times.hpp>
#include <gsp/splat/develop.hpp>
#include <gsp/splat/id_channel.hpp>
#include <gsp/splat/jitter_cameras.hpp>
#include <gsp/splat/median_depth.hpp>
#include <gsp/splat/normals.hpp>
#include <gsp/splat/render.hpp>
#include <gsp/splat/sample_surface.hpp>
#include <gsp/step/step.hpp>
#include <map>
#include <support/kokkos_tools.hpp>

// gsp::runtime against the same calls of the library itself, bit for bit, on the CPU and on a GPU where there is one. (The tests' main
// holds Kokkos, so no Session is made here; tests/program/*.sh go through it.)

using namespace gsp::runtime;
using namespace gsp_test;

namespace {

std::vector<Device> devices() {
  if (has_cuda() && gpu_count() > 0) return {Device::cpu, Device::cuda};
  return {Device::cpu};
}

template <class T>
std::vector<T> on_host(Array const& a) {
  std::vector<T> out(std::size_t(a.size()));
  Array to = a;
  to.data = out.data();
  to.device = Device::cpu;
  to.dtype = dtype_of<T>();
  std::int64_t step = 1;
  for (int k = a.rank; k-- > 0; step *= a.extents[k]) to.strides[k] = step;
  copy(a, to);
  return out;
}

}  // namespace

TEST_CASE("copy: any device, precision and stride; one row for all") {
  std::vector<double> const numbers{1, 2, 3, 4, 5, 6.25};
  Array const a = host_array(numbers.data(), {3, 2});
  CHECK(a.read_only);
  for (Device const device : devices()) {
    Buffer const there = make_buffer(device, Dtype::float32, {3, 2});
    copy(a, there.array);
    CHECK(on_host<float>(there.array) == std::vector<float>{1, 2, 3, 4, 5, 6.25f});
    CHECK(on_host<double>(there.array) == numbers);
    CHECK(on_host<float>(there.array.rows(1, 1)) == std::vector<float>{3, 4});
    Array across = there.array;  // (2, 3), the transposed
    std::swap(across.extents[0], across.extents[1]);
    std::swap(across.strides[0], across.strides[1]);
    CHECK_FALSE(across.contiguous());
    CHECK(on_host<double>(across) == std::vector<double>{1, 3, 5, 2, 4, 6.25});
    copy(a.rows(2, 1), there.array);
    CHECK(on_host<double>(there.array) == std::vector<double>{5, 6.25, 5, 6.25, 5, 6.25});
    Buffer const back = make_buffer(device, Dtype::float64, {2, 3});
    copy(across, back.array);  // on one device
    CHECK(on_host<double>(back.array) == std::vector<double>{5, 5, 5, 6.25, 6.25, 6.25});
    copy(host_array(numbers.data(), {2, 3}), across);
    CHECK(on_host<double>(there.array) == std::vector<double>{1, 4, 2, 5, 3, 6.25});
  }
  std::vector<float> few(4);
  CHECK_THROWS_WITH_AS(copy(a, host_array(few.data(), {2, 2})), doctest::Contains("(3, 2) and (2, 2)"), std::invalid_argument);
  CHECK_THROWS_AS(copy(host_array(few.data(), {2, 2}), host_array(numbers.data(), {2, 2})), std::invalid_argument);  // read-only
  std::vector<int> whole(6);
  CHECK_THROWS_AS(copy(a, host_array(whole.data(), {3, 2})), std::invalid_argument);
  CHECK_THROWS_AS((void)a.rows(2, 2), std::invalid_argument);
}

// Sweeps of pgs that know no tolerance are as many as were asked for; Newton's method takes more iterations to 1e-10 of the impulses than
// to all of them.
TEST_CASE("iterations and tolerance are those of the profile's solver") {
  auto const compiled = gsp::compile(gsp::samples::quadruped_scene());
  auto const iterations = [&](Device device, StepperOptions options) {
    auto const stepper = make_stepper(device, compiled, options);
    std::vector<double> qpos = compiled.keyframes.at(0).qpos;
    stepper->set(host_array(qpos.data(), {1, compiled.nq}), {}, {});
    stepper->step({.steps = 20});
    return stepper->counts().iterations;
  };
  for (Device const device : devices()) {
    StepperOptions stable;
    stable.iterations = 7;
    stable.tolerance = 0.;
    CHECK(iterations(device, stable) == 7);
    StepperOptions mujoco;
    mujoco.mujoco = true;
    mujoco.precision = Dtype::float64;
    int const fine = iterations(device, mujoco);
    mujoco.tolerance = 1.;
    CHECK(iterations(device, mujoco) < fine);
  }
}

// The first dof that is not finite, else the one farthest beyond 1e10; where none is, the joint whose position is.
TEST_CASE("a stepper says which worlds stopped, when and at which joint") {
  gsp::Description d;
  for (char const* const name : {"a", "b", "c"}) {
    gsp::BodyDescription body;
    body.parent = 0;
    body.joints.emplace_back().name = name;
    body.joints[0].type = gsp::JointType::slide;
    body.has_inertial = true;
    body.inertial.mass = 1;
    body.inertial.inertia = {1, 1, 1, 0, 0, 0};
    d.bodies.push_back(body);
  }
  auto const compiled = gsp::compile(d);
  constexpr double nan = std::numeric_limits<double>::quiet_NaN();
  for (Device const device : devices()) {
    StepperOptions options;
    options.worlds = 5;
    options.precision = Dtype::float64;
    auto const stepper = make_stepper(device, compiled, options);
    CHECK(stepper->stopped(5).empty());
    std::vector<double> qpos(15, 0.), qvel(15, 0.);
    qvel[3 * 1 + 0] = 2e10, qvel[3 * 1 + 2] = -3e10;
    qvel[3 * 2 + 0] = 2e10, qvel[3 * 2 + 1] = nan;
    qpos[3 * 3 + 1] = -4e10;
    qvel[3 * 4 + 2] = 9e9;  // world 4 goes on for one step
    qpos[3 * 4 + 2] = 9.99e9;
    stepper->set(host_array(qpos.data(), {5, 3}), host_array(qvel.data(), {5, 3}), {});
    stepper->step({.steps = 10});
    auto const stopped = stepper->stopped(9);
    CHECK(stepper->counts().failed_worlds == 4);
    REQUIRE(stopped.size() == 4);
    CHECK(stopped[0].world == 1);
    CHECK(stopped[0].steps == 0);
    CHECK(stopped[0].status == gsp::status::unbounded);
    CHECK(stopped[0].dof == 2);
    CHECK(stopped[0].joint == 2);
    CHECK(stopped[0].dofs == 2);
    CHECK(stopped[0].number == doctest::Approx(-3e10));
    CHECK(stopped[1].dof == 1);
    CHECK(std::isnan(stopped[1].number));
    CHECK((stopped[1].status & gsp::status::not_finite) != 0);
    CHECK(stopped[2].position);
    CHECK(stopped[2].joint == 1);
    CHECK(stopped[2].dof == -1);
    CHECK(stopped[2].number == -4e10);
    CHECK(stopped[3].steps == 1);
    CHECK(stopped[3].joint == 2);
    CHECK(stepper->stopped(2).size() == 2);
  }
}

// --keyframe of the program sets float64 numbers of the host through the stepper.
TEST_CASE("set_keyframe starts with the bits that a stepper starts with") {
  using Exec = Kokkos::DefaultHostExecutionSpace;
  Exec const exec;
  auto scene = gsp::samples::quadruped_scene();
  scene.keyframes.at(0).qpos[0] = 0.1;  // no float
  scene.keyframes.at(0).qpos[8] = 0.1;  // of a hinge
  auto const compiled = gsp::compile(scene);
  auto const& key = compiled.keyframes.at(0);
  auto const stepper = make_stepper(Device::cpu, compiled, {});
  stepper->set(host_array(key.qpos.data(), {1, compiled.nq}), host_array(key.qvel.data(), {1, compiled.nv}),
               host_array(key.ctrl.data(), {1, compiled.nu}));
  auto const model = gsp::make_model<float>(exec, compiled);
  auto state = gsp::make_state(exec, model, {.worlds = 1});
  gsp::set_keyframe(exec, model, compiled, 0, state);
  CHECK(state.qpos_low(0, 0) != 0);
  auto simulation = gsp::make_simulation(exec, model, compiled, {.worlds = 1});
  for (int t = 0; t < 2; ++t) {
    CHECK(gsp::detail::to_host(exec, state.qpos) == on_host<float>(stepper->state().qpos));
    CHECK(gsp::detail::to_host(exec, state.qvel) == on_host<float>(stepper->state().qvel));
    CHECK(gsp::detail::to_host(exec, state.ctrl) == on_host<float>(stepper->state().ctrl));
    gsp::step(exec, model, state, simulation, {.steps = 5});
    stepper->step({.steps = 5});
    CHECK(gsp::detail::to_host(exec, state.qpos_low) == on_host<float>(stepper->state().qpos_low));
  }
}

TEST_CASE("a stepper is the library's step, and gives back every digit that it was given") {
  auto const compiled = gsp::compile(gsp::samples::quadruped_scene());
  for (Device const device : devices()) {
    StepperOptions options;
    options.worlds = 3;
    auto const stepper = make_stepper(device, compiled, options);
    std::vector<double> qpos = compiled.keyframes.at(0).qpos;
    qpos[0] += 1e-9;  // no float
    std::vector<double> const qvel(std::size_t(compiled.nv), 0.);
    std::vector<double> const ctrl = compiled.keyframes.at(0).ctrl;
    stepper->set(host_array(qpos.data(), {1, compiled.nq}), host_array(qvel.data(), {1, compiled.nv}),
                 ctrl.empty() ? Array{} : host_array(ctrl.data(), {1, compiled.nu}));
    std::vector<double> q(3 * qpos.size());
    std::vector<double> v(3 * qvel.size());
    stepper->get(host_array(q.data(), {3, compiled.nq}), host_array(v.data(), {3, compiled.nv}));
    for (std::size_t i = 0; i < q.size(); ++i) {
      double const given = qpos[i % qpos.size()];
      CHECK(std::abs(q[i] - given) <= 1e-14 * std::max(1., std::abs(given)));  // two floats hold 48 bits
    }
    // The poses are those of the state, brought up to date when they are asked for; a body of a free joint stands where qpos says.
    auto const poses = stepper->poses();
    CHECK(poses.worlds() == 3);
    auto const xpos = on_host<double>(poses.xpos);
    CHECK(std::abs(xpos[3] - qpos[0]) < 1e-6);
    CHECK(xpos[3] == xpos[3 + std::size_t(3 * compiled.nbody)]);

    auto const state = stepper->state();
    CHECK(std::isnan(stepper->residuals().rate.most));  // nothing has been solved
    stepper->step({.steps = 20, .measure_residual = true});
    CHECK(stepper->state().qpos.data == state.qpos.data);  // the arrays stay where they are
    CHECK(stepper->poses().xpos.data == poses.xpos.data);
    CHECK(on_host<std::int64_t>(state.steps) == std::vector<std::int64_t>{20, 20, 20});
    auto const counts = stepper->counts();
    CHECK(counts.contacts > 0);
    CHECK(counts.rows > 0);
    CHECK(counts.failed_worlds == 0);
    CHECK(counts.residual >= 0);
    CHECK(counts.mean_iterations > 0);
    CHECK(counts.mean_iterations <= counts.iterations);
    auto const left = stepper->residuals();
    CHECK(std::abs(left.rate.most - counts.residual) < 1e-5);  // float
    CHECK(left.rate.most == std::max({left.equality.most, left.complementarity.most, left.friction.most}));
    CHECK(left.rate.mean <= left.rate.most);
    CHECK(left.bounds.most == 0);
    CHECK(left.cone.most < 1e-6);
    CHECK(left.energy < 0);
    {  // contacts by world; those that act push
      auto const met = stepper->contacts();
      auto const world = on_host<int>(met.world);
      CHECK(std::is_sorted(world.begin(), world.end()));
      auto const force = on_host<double>(met.force);
      double normal = 0;
      for (std::size_t c = 0; c < world.size(); ++c) {
        CHECK(force[6 * c] >= 0);
        normal += force[6 * c];
      }
      CHECK(normal > 0);
    }
    if (device == Device::cpu) {  // as many threads as there are packs of islands; one gives the same bits
      constexpr int width = gsp::native_width<float>;
      CHECK(stepper->threads() == std::min((3 * compiled.ntree + width - 1) / width, Kokkos::DefaultHostExecutionSpace().concurrency()));
      options.threads = 1;
      auto const other = make_stepper(device, compiled, options);
      CHECK(other->threads() == 1);
      other->set(host_array(qpos.data(), {1, compiled.nq}), host_array(qvel.data(), {1, compiled.nv}),
                 ctrl.empty() ? Array{} : host_array(ctrl.data(), {1, compiled.nu}));
      other->step({.steps = 20});
      CHECK(on_host<float>(other->state().qpos) == on_host<float>(state.qpos));
      CHECK(on_host<float>(other->state().qvel) == on_host<float>(state.qvel));
      CHECK(std::isnan(other->counts().residual));  // not asked for
    }
    if (device == Device::cpu) {  // the same by hand
      Kokkos::DefaultHostExecutionSpace const exec;
      auto const model = gsp::make_model<float>(exec, compiled);
      auto mine = gsp::make_state(exec, model, {.worlds = 3});
      auto simulation = gsp::make_simulation(exec, model, compiled, {.worlds = 3});
      for (int w = 0; w < 3; ++w) {
        for (int i = 0; i < compiled.nq; ++i) {
          mine.qpos(w, i) = float(qpos[std::size_t(i)]);
          mine.qpos_low(w, i) = float(qpos[std::size_t(i)] - double(mine.qpos(w, i)));
        }
        for (std::size_t i = 0; i < ctrl.size(); ++i) mine.ctrl(w, i) = float(ctrl[i]);
      }
      gsp::step(exec, model, mine, simulation, {.steps = 20});
      CHECK(std::memcmp(mine.qpos.data(), state.qpos.data, mine.qpos.span() * sizeof(float)) == 0);
      CHECK(std::memcmp(mine.qvel.data(), state.qvel.data, mine.qvel.span() * sizeof(float)) == 0);
      gsp::forward_kinematics(exec, model, mine, simulation.poses, simulation.dynamics);
      CHECK(std::memcmp(simulation.poses.xpos.data(), stepper->poses().xpos.data, simulation.poses.xpos.span() * sizeof(float)) == 0);
      auto const met = stepper->contacts();  // of the same step
      REQUIRE(met.dist.extents[0] == counts.contacts);
      CHECK(std::memcmp(simulation.contacts.pos.data(), met.pos.data, std::size_t(met.pos.size()) * sizeof(float)) == 0);
      CHECK(std::memcmp(simulation.solution.qfrc_constraint.data(), stepper->qfrc_constraint().data,
                        simulation.solution.qfrc_constraint.span() * sizeof(float)) == 0);
    }
  }
}

// What rounding takes of a start is kept where steps go on with it, and nowhere else: a hinge that starts at 1000.1 rad is off by 2e-5 rad,
// and would be by the same wherever it turns.
TEST_CASE("no digit of a free body's place is lost, and none of a hinge's start stays") {
  gsp::Description d;
  for (auto const type : {gsp::JointType::free, gsp::JointType::hinge}) {
    gsp::BodyDescription b;
    b.parent = 0;
    b.joints.emplace_back().type = type;
    b.geoms.emplace_back().size = {0.1, 0, 0};
    d.bodies.push_back(b);
  }
  d.option.gravity = {0, 0, 0};
  auto const compiled = gsp::compile(d);
  for (Device const device : devices()) {
    auto const stepper = make_stepper(device, compiled, {});
    std::vector<double> const start{1000.1, 0.1, 0.2, 1, 0, 0, 0, 1000.1};
    std::vector<double> const rates{0, 0, 0, 0, 0, 0, -1000};
    stepper->set(host_array(start.data(), {1, 8}), host_array(rates.data(), {1, 7}), {});
    stepper->step({.steps = 500});  // a second
    std::vector<double> q(8);
    stepper->get(host_array(q.data(), {1, 8}), {});
    CHECK(std::abs(q[0] - 1000.1) < 1e-11);
    CHECK(q[7] == double(float(q[7])));
  }
}

// Ten on a line, one far off, one on a link: the box of 75 % leaves out the k = 1 at either end.
TEST_CASE("a scene says where what stands in it is") {
  auto const compiled = gsp::compile(gsp::samples::quadruped_scene());
  Scene scene;
  CHECK(scene.bounds().count == 0);
  auto set = gsp::io::make_splat_set(11, 0);
  for (std::size_t i = 0; i < 11; ++i) {
    set.positions[3 * i] = i == 9 ? 1000.f : float(i);
    set.positions[3 * i + 2] = 2;
    set.opacities[i] = 1;
  }
  set.link_names = {compiled.body_name[1]};
  set.link[10] = 0;
  CHECK(scene.add_set(set, "line", compiled));
  auto const all = scene.bounds();
  CHECK(all.count == 10);
  CHECK(all.low == std::array<double, 3>{0, 0, 2});
  CHECK(all.high == std::array<double, 3>{1000, 0, 2});
  auto const middle = scene.bounds(0.75);
  CHECK(middle.low[0] == 1);
  CHECK(middle.high[0] == 8);
  CHECK_THROWS_AS(static_cast<void>(scene.bounds(0)), std::invalid_argument);
}

// What a stepper gives, another goes on from to the bit, of as many worlds or of one for all.
TEST_CASE("a stepper goes on from what another saved") {
  auto compiled = gsp::compile(gsp::samples::quadruped_scene());
  compiled.option.sleep = true;
  for (Device const device : devices()) {
    for (Dtype const precision : {Dtype::float32, Dtype::float64}) {
      StepperOptions options;
      options.worlds = 2;
      options.precision = precision;
      auto const stepper = make_stepper(device, compiled, options);
      stepper->step({.steps = 40});
      auto const arrays = stepper->save();
      auto const fresh = make_stepper(device, compiled, options);
      fresh->restore(arrays);
      stepper->step({.steps = 40});
      fresh->step({.steps = 40});
      CHECK(on_host<double>(fresh->state().qpos) == on_host<double>(stepper->state().qpos));
      CHECK(on_host<double>(fresh->state().qvel) == on_host<double>(stepper->state().qvel));
      CHECK(on_host<std::int64_t>(fresh->state().steps) == std::vector<std::int64_t>{80, 80});
      options.worlds = 1;
      auto const one = make_stepper(device, compiled, options);
      one->step({.steps = 40});
      auto const of_one = one->save();
      fresh->restore(of_one);
      CHECK(on_host<double>(fresh->poses().xpos.rows(1, 1)) == on_host<double>(one->poses().xpos));  // brought up to date
      one->step({.steps = 40});
      fresh->step({.steps = 40});
      CHECK(on_host<double>(fresh->state().qvel.rows(1, 1)) == on_host<double>(one->state().qvel));
      int const second[] = {0, 1};
      auto const before = on_host<double>(stepper->state().qvel.rows(0, 1));
      stepper->restore(of_one, gsp::runtime::host_array(second, {2}));
      CHECK(on_host<double>(stepper->state().qvel.rows(0, 1)) == before);
      CHECK(on_host<std::int64_t>(stepper->state().steps) == std::vector<std::int64_t>{80, 40});
      auto const alone = make_stepper(device, compiled, options);
      alone->restore(of_one);
      stepper->step({.steps = 40});
      alone->step({.steps = 40});
      CHECK(on_host<double>(stepper->state().qvel.rows(1, 1)) == on_host<double>(alone->state().qvel));
      CHECK_THROWS_WITH_AS(one->restore(arrays), doctest::Contains("there are 2 worlds, and here 1"), gsp::Error);
      options.precision = precision == Dtype::float32 ? Dtype::float64 : Dtype::float32;
      auto const other = make_stepper(device, compiled, options);
      CHECK_THROWS_WITH_AS(other->restore(of_one), doctest::Contains("array 'state.qpos' is (1, "), gsp::Error);
      auto awake = compiled;
      awake.option.sleep = false;
      options.precision = precision;
      CHECK_THROWS_WITH_AS(make_stepper(device, awake, options)->restore(of_one), doctest::Contains("islands may sleep"), gsp::Error);
    }
  }
}

// A clock that is 2 steps late: its number is known; steps are those of a stepper that nobody asks for sensors, to the bit, with RK4 too.
TEST_CASE("late sensors measure at each step, and go on from what was saved") {
  auto compiled_of = [](gsp::Integrator integrator) {
    auto robot = gsp::samples::quadruped_scene();
    robot.option.integrator = integrator;
    double const h = robot.option.timestep;
    robot.sensors = {{.name = "late", .type = "clock", .settings = {{"delay", std::to_string(2 * h)}, {"nsample", "4"}}}};
    return gsp::compile(robot);
  };
  for (Device const device : devices())
    for (auto const integrator : {gsp::Integrator::euler, gsp::Integrator::rk4}) {
      auto const compiled = compiled_of(integrator);
      double const h = compiled.option.timestep;
      StepperOptions options;
      options.precision = Dtype::float64;
      auto const stepper = make_stepper(device, compiled, options), plain = make_stepper(device, compiled, options);
      auto const late = [](Stepper& s) { return on_host<double>(s.sensors())[0]; };
      CHECK(late(*stepper) == 0);
      stepper->step({.steps = 7});
      plain->step({.steps = 7});
      CHECK(std::abs(late(*stepper) - 5 * h) < 1e-15);
      CHECK(on_host<double>(stepper->state().qpos) == on_host<double>(plain->state().qpos));
      CHECK(on_host<double>(stepper->state().qvel) == on_host<double>(plain->state().qvel));
      auto arrays = stepper->save();
      options.worlds = 2;
      auto const fresh = make_stepper(device, compiled, options);
      fresh->restore(arrays);
      stepper->step({.steps = 1});
      fresh->step({.steps = 1});
      CHECK(std::abs(late(*stepper) - 6 * h) < 1e-15);
      CHECK(on_host<double>(fresh->sensors()) == std::vector<double>(2, late(*stepper)));
      auto without = gsp::samples::quadruped_scene();
      without.option.integrator = integrator;
      options.worlds = 1;
      CHECK_THROWS_WITH_AS(make_stepper(device, gsp::compile(without), options)->restore(arrays),
                           doctest::Contains("sensors keep samples there, and here none does"), gsp::Error);
      std::erase_if(arrays, [](auto const& a) { return a.name == "sensors.time"; });
      CHECK_THROWS_WITH_AS(stepper->restore(arrays), doctest::Contains("array 'sensors.time' is not there"), gsp::Error);
      std::erase_if(arrays, [](auto const& a) { return a.name.starts_with("sensors."); });
      stepper->restore(arrays);  // it has measured nothing
      CHECK(late(*stepper) == 0);
    }
}

// Worlds that were reset go on as a new stepper does, to the bit; the others as if nothing had been.
TEST_CASE("a stepper resets some worlds, to a keyframe too, and what their late sensors remember") {
  auto robot = gsp::samples::quadruped_scene();
  double const h = robot.option.timestep;
  robot.sensors = {{.name = "late", .type = "clock", .settings = {{"delay", std::to_string(2 * h)}, {"nsample", "4"}}}};
  auto const compiled = gsp::compile(robot);
  for (Device const device : devices()) {
    auto const make = [&](int worlds) {
      auto s = make_stepper(device, compiled, {.worlds = worlds});
      s->reset({}, 0);
      s->sensors();
      return s;
    };
    auto const some = make(3), none = make(3), fresh = make(1), first = make_stepper(device, compiled, {});
    some->step({.steps = 9});
    none->step({.steps = 9});
    std::vector<int> const mask = {0, 1, 0};
    some->reset(host_array(mask.data(), {3}), 0);
    auto const qpos = [](Stepper& s, int w) { return on_host<float>(s.state().qpos.rows(w, 1)); };
    CHECK(on_host<std::int64_t>(some->state().steps) == std::vector<std::int64_t>{9, 0, 9});
    for (Stepper* const s : {some.get(), none.get(), fresh.get()}) s->step({.steps = 4});
    CHECK(qpos(*some, 0) == qpos(*none, 0));
    CHECK(qpos(*some, 1) == qpos(*fresh, 0));
    CHECK(qpos(*some, 2) == qpos(*none, 2));
    auto const late = on_host<float>(some->sensors());
    CHECK(late[1] == doctest::Approx(2 * h));
    CHECK(late[2] == doctest::Approx(11 * h));
    some->reset({}, -1);
    CHECK(qpos(*some, 2) == qpos(*first, 0));  // the model's own start
    CHECK_THROWS_WITH_AS(some->reset(host_array(mask.data(), {1, 3}), 0), doctest::Contains("must be (worlds) int32"),
                         std::invalid_argument);
    CHECK_THROWS_WITH_AS(some->reset({}, 7), doctest::Contains("number 7 is asked for"), std::invalid_argument);
  }
}

// Contacts of the floor begin from row 0 of the poses, which steps never write.
TEST_CASE("poses of what does not move are written anew by reset, restore and forward") {
  auto const compiled = gsp::compile(gsp::samples::quadruped_scene());
  for (Device const device : devices()) {
    StepperOptions options;
    options.worlds = 2;
    options.precision = Dtype::float64;
    auto const stepper = make_stepper(device, compiled, options), other = make_stepper(device, compiled, options);
    auto const saved = other->save();
    std::vector<double> const below{0, 0, -1};
    auto const place = on_host<double>(other->poses().xpos);
    auto const check = [&] {
      CHECK(on_host<double>(stepper->poses().xpos) == place);
      for (auto const& s : {stepper.get(), other.get()}) s->step({.steps = 20});
      CHECK(on_host<double>(stepper->state().qpos) == on_host<double>(other->state().qpos));
      for (auto const& s : {stepper.get(), other.get()}) s->reset({}, -1);
    };
    Array row = stepper->poses().xpos;
    row.extents[1] = 1;  // the world's, in all worlds
    auto const spoil = [&] { copy(host_array(below.data(), {1, 1, 3}), row); };
    spoil();
    stepper->forward();
    check();
    spoil();
    stepper->reset({}, -1);
    check();
    spoil();
    stepper->restore(saved);
    check();
  }
}

TEST_CASE("masses that inertias cannot follow are refused, and cameras of old lists let go") {
  auto const compiled = gsp::compile(gsp::samples::quadruped_scene());
  for (Device const device : devices()) {
    StepperOptions options;
    options.per_world = {"body_mass", "body_inertia"};
    auto const stepper = make_stepper(device, compiled, options);
    auto const inertia = on_host<float>(stepper->world_values("body_inertia"));
    for (float const bad : {0.f, -1.f, std::nanf(""), INFINITY}) {
      auto mass = on_host<float>(stepper->world_values("body_mass"));
      mass[1] = bad;
      auto const set = [&] { stepper->set_world_values("body_mass", host_array(mass.data(), {1, compiled.nbody}), {}, true); };
      CHECK_THROWS_WITH_AS(set(), doctest::Contains("masses that are positive and finite"), gsp::Error);
    }
    CHECK(on_host<float>(stepper->world_values("body_inertia")) == inertia);
    auto const of = [&](double x) { return stepper->cameras({{.body = "world", .pos = {x, 0, 0}}}, 16, 16); };
    auto const first = of(0);
    auto const numbers = on_host<float>(first.viewmats);
    std::weak_ptr<void> unwanted = of(1).owner;
    CHECK(of(0).viewmats.data == first.viewmats.data);
    CHECK_FALSE(unwanted.expired());
    for (int k = 2; k < 70; ++k) static_cast<void>(of(k));
    CHECK(unwanted.expired());
    CHECK(on_host<float>(first.viewmats) == numbers);
    CHECK(of(0).viewmats.data != first.viewmats.data);
  }
}

TEST_CASE("pictures of the simulation's poses, where they lie") {
  auto const compiled = gsp::compile(gsp::samples::quadruped_scene());
  std::vector<float> viewmats{1, 0, 0, 0, 0, 0, -1, 0.3f, 0, 1, 0, 2, 0, 0, 0, 1};  // from -y, 2 m away
  std::vector<float> Ks{60, 0, 32, 0, 60, 24, 0, 0, 1};
  for (Device const device : devices()) {
    StepperOptions options;
    options.worlds = 4;
    auto const stepper = make_stepper(device, compiled, options);
    stepper->step({.steps = 5});
    Scene scene;
    scene.add_surface(compiled);
    RendererOptions pictures;
    pictures.width = 64;
    pictures.height = 48;
    pictures.alpha = false;
    auto const renderer = make_renderer(device, scene, pictures);
    std::vector<float> four_views;
    std::vector<float> four_Ks;
    for (int c = 0; c < 4; ++c) {
      four_views.insert(four_views.end(), viewmats.begin(), viewmats.end());
      four_Ks.insert(four_Ks.end(), Ks.begin(), Ks.end());
    }
    // Cameras on the device, so that nothing has to be copied.
    Buffer const views = make_buffer(device, Dtype::float32, {4, 4, 4});
    Buffer const lenses = make_buffer(device, Dtype::float32, {4, 3, 3});
    copy(host_array(four_views.data(), {4, 4, 4}), views.array);
    copy(host_array(four_Ks.data(), {4, 3, 3}), lenses.array);
    CameraArrays const cameras{views.array, lenses.array, {}};
    renderer->render(stepper->poses(), cameras);  // buffers find their size
    auto const seen = watch([&] {
      stepper->step({.steps = 3});
      renderer->render(stepper->poses(), cameras);
    });
    check_no_allocation(seen);
    check_labels(seen);
    auto const frames = renderer->frames();
    CHECK_FALSE(frames.alpha);
    auto const rgb = on_host<float>(frames.rgb);
    double sum = 0;
    for (float const x : rgb) sum += x;
    CHECK(sum > 1);
    if (device == Device::cpu) {
      Kokkos::DefaultHostExecutionSpace const exec;
      auto const cloud = gsp::make_gaussians(exec, {gsp::sample_surface(compiled, {.count = 30000, .world = false})});
      auto const poses = stepper->poses();
      gsp::Poses<float, Kokkos::HostSpace> mine;
      mine.xpos = decltype(mine.xpos)(static_cast<float*>(poses.xpos.data), 4, compiled.nbody, 3);
      mine.xquat = decltype(mine.xquat)(static_cast<float*>(poses.xquat.data), 4, compiled.nbody, 4);
      auto by_hand = gsp::make_frames(exec, cloud, {.images = 4, .width = 64, .height = 48, .alpha = false});
      gsp::render(exec, cloud, mine, gsp::make_cameras(exec, four_views, four_Ks), by_hand);
      CHECK(std::memcmp(by_hand.rgb.data(), frames.rgb.data, by_hand.rgb.span() * sizeof(float)) == 0);
      CHECK(std::memcmp(by_hand.depth.data(), frames.depth.data, by_hand.depth.span() * sizeof(float)) == 0);
      auto bent = cameras;
      bent.lenses = {gsp::opencv_lens({-0.2, 0.02, 0, 0})};
      renderer->render(poses, bent);
      check_no_allocation(watch([&] { renderer->render(poses, bent); }));
      gsp::render(exec, cloud, mine, gsp::make_cameras(exec, four_views, four_Ks, {}, bent.lenses), by_hand);
      CHECK(std::memcmp(by_hand.rgb.data(), renderer->frames().rgb.data, by_hand.rgb.span() * sizeof(float)) == 0);
      CHECK(on_host<float>(renderer->frames().rgb) != rgb);
      bent.lenses.resize(3);
      CHECK_THROWS_WITH_AS(renderer->render(poses, bent), doctest::Contains("3 lenses for 4 cameras"), std::invalid_argument);
      renderer->render(poses, cameras);
      CHECK(on_host<float>(renderer->frames().rgb) == rgb);
    }
    renderer->show_sets({{0}, {}, {0}, {}});
    renderer->render(stepper->poses(), cameras);
    auto const shown = on_host<float>(renderer->frames().rgb);
    std::size_t const each = rgb.size() / 4;
    CHECK(std::memcmp(shown.data(), rgb.data(), each * sizeof(float)) == 0);
    CHECK(std::all_of(shown.begin() + std::ptrdiff_t(each), shown.begin() + std::ptrdiff_t(2 * each), [](float x) { return x == 0; }));
    renderer->show_sets({});
    renderer->render(stepper->poses(), cameras);
    CHECK(on_host<float>(renderer->frames().rgb) == rgb);
    CHECK(renderer->frames().rgb.data == frames.rgb.data);
    {  // from a small set to all: buffers grow, and the pictures stay where they are
      Scene two = scene;
      two.add_room();
      auto const all = make_renderer(device, two, pictures);
      auto const grows = make_renderer(device, two, pictures);
      all->render(stepper->poses(), cameras);
      grows->show_sets({{0}, {0}, {0}, {0}});
      grows->render(stepper->poses(), cameras);
      auto const first = grows->frames();
      CHECK(on_host<float>(first.rgb) == rgb);
      grows->show_sets({});
      grows->render(stepper->poses(), cameras);
      CHECK(grows->frames().rgb.data == first.rgb.data);
      CHECK(grows->frames().depth.data == first.depth.data);
      CHECK(on_host<float>(grows->frames().rgb) == on_host<float>(all->frames().rgb));
      CHECK(on_host<float>(first.rgb) != rgb);
    }
    // Kinematics of the same positions in float64 give the same pictures but for rounding.
    auto const kinematics = make_kinematics(device, compiled);
    std::vector<double> q(std::size_t(4 * compiled.nq));
    std::vector<double> v(std::size_t(4 * compiled.nv));
    stepper->get(host_array(q.data(), {4, compiled.nq}), host_array(v.data(), {4, compiled.nv}));
    renderer->render(kinematics->poses(host_array(q.data(), {4, compiled.nq})), cameras);
    auto const again = on_host<float>(renderer->frames().rgb);
    double difference = 0;
    for (std::size_t i = 0; i < rgb.size(); ++i) difference += std::abs(double(rgb[i]) - double(again[i]));
    CHECK(difference / double(rgb.size()) < 1e-4);  // poses differ by some 1e-7 m, a Gaussian is some mm wide
    CHECK_THROWS_AS(renderer->render(stepper->poses(), {host_array(four_views.data(), {4, 4, 4}), host_array(Ks.data(), {1, 3, 3}), {}}),
                    std::invalid_argument);
  }
}

// two cameras of 64 x 48 pixels
static std::vector<float> const viewmats{1, 0, 0, 0, 0, 0, -1, 0.3f, 0, 1, 0, 2, 0, 0, 0, 1,   // from -y, 2 m away
                                         1, 0, 0, 0, 0, 0, -1, 0.3f, 0, 1, 0, 1, 0, 0, 0, 1};  // and 1 m
static std::vector<float> const Ks{60, 0, 32, 0, 60, 24, 0, 0, 1, 60, 0, 32, 0, 60, 24, 0, 0, 1};

TEST_CASE("cameras that stand still have the bits of render") {
  auto const compiled = gsp::compile(gsp::samples::quadruped_scene());
  for (Device const device : devices()) {
    StepperOptions options;
    options.worlds = 2;
    auto const stepper = make_stepper(device, compiled, options), other = make_stepper(device, compiled, {});
    Scene scene;
    scene.add_room();
    scene.add_surface(compiled);
    RendererOptions pictures{.width = 64, .height = 48};
    pictures.normals = true;
    pictures.rgb8 = true;
    auto const renderer = make_renderer(device, scene, pictures), fixed = renderer->another();
    CameraArrays const cameras{host_array(viewmats.data(), {2, 4, 4}), host_array(Ks.data(), {2, 3, 3}), {}};
    auto const refused = [&](auto const& call, char const* why) {
      CHECK_THROWS_WITH_AS(call(), doctest::Contains(why), std::invalid_argument);
    };
    refused([&] { fixed->render_fixed(stepper->poses()); }, "no cameras are fixed: call fix first");
    fixed->fix(stepper->poses(), cameras);
    gsp::runtime::DrawOptions draw;
    draw.develop.noise = 0.02f;
    auto const equal = [&] {
      renderer->render(stepper->poses(), cameras, draw);
      auto const a = renderer->frames(), b = fixed->frames();
      CHECK(on_host<float>(a.rgb) == on_host<float>(b.rgb));
      CHECK(on_host<float>(a.depth) == on_host<float>(b.depth));
      CHECK(on_host<float>(a.alpha) == on_host<float>(b.alpha));
      CHECK(on_host<float>(a.normals) == on_host<float>(b.normals));
      CHECK(on_host<std::uint8_t>(a.rgb8) == on_host<std::uint8_t>(b.rgb8));
      return on_host<float>(a.rgb);
    };
    std::vector<float> last;
    for (int k = 0; k < 3; ++k) {
      stepper->step({.steps = 20});
      draw.develop.step = k;
      fixed->render_fixed(stepper->poses(), draw);
      auto const now = equal();
      CHECK(now != last);
      last = now;
    }
    auto const at = fixed->frames().rgb.data;
    check_no_allocation(watch([&] { fixed->render_fixed(stepper->poses(), draw); }));
    CHECK(fixed->frames().rgb.data == at);
    refused([&] { fixed->render_fixed(other->poses()); }, "the poses have 1 worlds, the frames were made for 2");
    draw.jitter.position = 0.1f;
    refused([&] { fixed->render_fixed(stepper->poses(), draw); }, "have no jitter");
    draw.jitter = {};
    fixed->render(stepper->poses(), cameras, draw);  // as any renderer
    equal();
    refused([&] { fixed->render_fixed(stepper->poses()); }, "call fix first, and after render and show_sets");
    fixed->fix(stepper->poses(), cameras);
    fixed->show_sets({{1}, {0}});
    refused([&] { fixed->render_fixed(stepper->poses()); }, "call fix first");
    fixed->fix(stepper->poses(), cameras);
    fixed->render_fixed(stepper->poses(), draw);
    renderer->show_sets({{1}, {0}});
    equal();
    pictures.ids = true;
    refused([&] { make_renderer(device, scene, pictures)->fix(stepper->poses(), cameras); }, "no median_depth and no ids");
  }
}

TEST_CASE("normals, ids, 8-bit pictures and jittered cameras are those of the headers") {
  auto const compiled = gsp::compile(gsp::samples::quadruped_scene());
  for (Device const device : devices()) {
    StepperOptions options;
    options.worlds = 2;
    auto const stepper = make_stepper(device, compiled, options);
    stepper->step({.steps = 5});
    Scene scene;
    scene.add_surface(compiled);
    RendererOptions pictures;
    pictures.width = 64;
    pictures.height = 48;
    pictures.rgb = false;
    pictures.median_depth = true;
    pictures.normals = true;
    pictures.ids = true;
    pictures.rgb8 = true;
    auto const renderer = make_renderer(device, scene, pictures);
    CHECK(renderer->bytes_needed(2) > std::int64_t(2) * 64 * 48 * (4 * (3 + 1 + 1 + 1 + 3 + 1) + 3));
    Buffer const views = make_buffer(device, Dtype::float32, {2, 4, 4});
    Buffer const intrinsics = make_buffer(device, Dtype::float32, {2, 3, 3});
    copy(host_array(viewmats.data(), {2, 4, 4}), views.array);
    copy(host_array(Ks.data(), {2, 3, 3}), intrinsics.array);
    CameraArrays const cameras{views.array, intrinsics.array, {}};
    gsp::runtime::DrawOptions draw;
    draw.develop = {.exposure = 0.5f, .contrast = 0.2f, .brightness = 0.1f, .noise = 0.02f, .background = {0.6f, 0.7f, 0.9f}, .seed = 1};
    draw.develop.step = 7;
    draw.jitter = {.position = 0.02f, .rotation = 0.01f, .focal = 0.02f, .principal = 2, .seed = 3, .step = 1, .first_image = 5};
    renderer->render(stepper->poses(), cameras, draw);  // buffers find their size
    auto const before = renderer->frames();
    auto const seen = watch([&] { renderer->render(stepper->poses(), cameras, draw); });
    check_no_allocation(seen);
    check_labels(seen);
    auto const frames = renderer->frames();
    CHECK_FALSE(frames.rgb);
    CHECK(frames.normals.data == before.normals.data);
    CHECK(frames.ids.data == before.ids.data);
    CHECK(frames.rgb8.data == before.rgb8.data);
    CHECK(on_host<float>(views.array) == viewmats);
    auto const developed = on_host<std::uint8_t>(frames.rgb8);
    CHECK(developed.size() == std::size_t(2 * 48 * 64 * 3));
    auto const ids = on_host<int>(frames.ids);
    CHECK(*std::max_element(ids.begin(), ids.end()) > 0);
    CHECK(*std::max_element(ids.begin(), ids.end()) < compiled.nbody);
    CHECK(*std::min_element(ids.begin(), ids.end()) == -1);
    if (device == Device::cpu) {
      using Host = Kokkos::HostSpace;
      Kokkos::DefaultHostExecutionSpace const exec;
      auto const cloud = gsp::make_gaussians(exec, {gsp::sample_surface(compiled, {.count = 30000, .world = false})});
      auto const poses = stepper->poses();
      gsp::Poses<float, Host> mine;
      mine.xpos = decltype(mine.xpos)(static_cast<float*>(poses.xpos.data), 2, compiled.nbody, 3);
      mine.xquat = decltype(mine.xquat)(static_cast<float*>(poses.xquat.data), 2, compiled.nbody, 4);
      auto by_hand = gsp::make_frames(exec, cloud, {.images = 2, .width = 64, .height = 48});
      auto jittered = gsp::make_cameras(exec, 2);
      gsp::jitter_cameras(exec, gsp::make_cameras(exec, viewmats, Ks), jittered,
                          {.position = 0.02f, .rotation = 0.01f, .focal = 0.02f, .principal = 2, .seed = 3, .step = 1, .first_image = 5});
      gsp::MedianDepthChannel<Host> const median{Kokkos::View<float***, Kokkos::LayoutRight, Host>("median", 2, 48, 64)};
      gsp::IdChannel<Host> const bodies{{}, Kokkos::View<int***, Kokkos::LayoutRight, Host>("bodies", 2, 48, 64)};
      Kokkos::View<float****, Kokkos::LayoutRight, Host> const normals("normals", 2, 48, 64, 3);
      Kokkos::View<std::uint8_t****, Kokkos::LayoutRight, Host> const bytes("bytes", 2, 48, 64, 3);
      gsp::RenderOptions render;
      render.alpha_max = pictures.alpha_max;
      gsp::render(exec, cloud, mine, jittered, by_hand, render, median, bodies);
      gsp::normals_of_depth(exec, median.image, jittered, normals);
      gsp::DevelopOptions numbers{.exposure = 0.5f, .contrast = 0.2f, .brightness = 0.1f, .noise = 0.02f, .background = {0.6f, 0.7f, 0.9f}};
      numbers.seed = 1;
      numbers.step = 7;
      gsp::develop(exec, by_hand, bytes, numbers);
      auto const same = [](auto const& view, Array const& array) {
        return std::memcmp(view.data(), array.data, view.span() * sizeof(*view.data())) == 0;
      };
      CHECK(same(by_hand.depth, frames.depth));
      CHECK(same(median.image, frames.median_depth));
      CHECK(same(bodies.image, frames.ids));
      CHECK(same(normals, frames.normals));
      CHECK(same(bytes, frames.rgb8));
      std::vector<float> const colours(std::size_t(48 * 64 * 3), 0.5f);
      draw.background = host_array(colours.data(), {1, 48, 64, 3});
      renderer->render(poses, cameras, draw);
      check_no_allocation(watch([&] { renderer->render(poses, cameras, draw); }));
      numbers.background = {0.5f, 0.5f, 0.5f};
      gsp::develop(exec, by_hand, bytes, numbers);
      CHECK(same(bytes, renderer->frames().rgb8));
    }
    draw.background = {};
    draw.develop.contrast = 2;
    CHECK_THROWS_WITH_AS(renderer->render(stepper->poses(), cameras, draw),
                         doctest::Contains("contrast is 2: give a number of 0 or more, at most 1"), std::invalid_argument);
    draw.develop.contrast = 0;
    draw.jitter.focal = 1;
    CHECK_THROWS_WITH_AS(renderer->render(stepper->poses(), cameras, draw),
                         doctest::Contains("focal is 1: give a number of 0 or more, below 1"), std::invalid_argument);
  }
}

// Each stage of a step is called once a step, and what stages took by themselves is no more than the whole: nothing is counted twice.
TEST_CASE("stages of steps and their times") {
  auto const compiled = gsp::compile(gsp::samples::quadruped_scene());
  for (Device const device : devices()) {
    StepperOptions options;
    options.worlds = 3;
    options.threads = 1;  // of several a stage is called once a tile: tests/runtime/tiles.cpp
    auto const stepper = make_stepper(device, compiled, options);
    stepper->step({.steps = 2});  // pools find their size
    double whole = 0;
    auto const stages = gsp::runtime::stage_times(device, [&] {
      auto const start = std::chrono::steady_clock::now();
      stepper->step({.steps = 5});
      whole = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    });
    std::map<std::string, long> calls;
    double sum = 0;
    for (auto const& stage : stages) {
      calls[stage.name] = stage.calls;
      sum += stage.seconds;
      CHECK(stage.seconds > 0);
    }
    for (char const* name : {"step::launch_step", "dynamics::smooth_dynamics", "collision::collide", "constraint::assemble", "solver::pgs",
                             "dynamics::integrate"})
      CHECK_MESSAGE(calls[name] == 5, name);
    CHECK(sum <= whole);
    CHECK(sum > 0.5 * whole);  // what lies outside of all stages is a call a step
    CHECK(std::is_sorted(stages.begin(), stages.end(), [](auto const& a, auto const& b) { return a.seconds > b.seconds; }));
    stepper->step({.steps = 1});  // nobody listens any more
  }
}

TEST_CASE("what make_stepper refuses, and the machine's memory is a number") {
  auto compiled = gsp::compile(gsp::samples::quadruped_scene());
  StepperOptions options;
  CHECK(bytes_needed(Device::cpu, compiled, options) > 0);
  options.mujoco = true;
  std::int64_t const bytes = bytes_needed(Device::cpu, compiled, options);
  CHECK(bytes > 0);
  options.cone = gsp::FrictionCone::box;
  CHECK_THROWS_WITH_AS(
      make_stepper(Device::cpu, compiled, options),
      "gsp::make_simulation: profile mujoco has no box of friction: choose FrictionCone::elliptic or pyramidal, or profile stable",
      gsp::Error);
  for (Device const device : devices()) {
    CHECK(free_bytes(device) > (std::uint64_t(1) << 20));
    CHECK(free_bytes(device) < (std::uint64_t(1) << 50));
  }
}
