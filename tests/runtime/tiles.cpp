// A stepper of several threads, whose worlds lie in tiles (step/tiles.hpp), beside one of one thread: all that it says and takes, bit for
// bit.
#include <doctest/doctest.h>

#include <cmath>
#include <gsp/model/compile.hpp>
#include <gsp/model/samples.hpp>
#include <gsp/runtime/stage_times.hpp>
#include <gsp/runtime/stepper.hpp>
#include <limits>

using namespace gsp::runtime;

namespace {

constexpr int worlds = 71;  // tiles of a pack each; the last is smaller

/// All numbers, of whatever kind; NaN as a number that no other is.
std::vector<double> numbers(Array const& a) {
  std::vector<double> out(std::size_t(a.size()));
  if (out.empty()) return out;
  auto const each = [&]<class T>(T) {
    std::vector<T> own(out.size());
    Array to = host_array(own.data(), {std::int64_t(own.size())});
    to.rank = a.rank;
    std::int64_t step = 1;
    for (int k = a.rank; k-- > 0; step *= a.extents[k]) {
      to.extents[k] = a.extents[k];
      to.strides[k] = step;
    }
    copy(a, to);
    for (std::size_t i = 0; i < own.size(); ++i) out[i] = double(own[i]);
  };
  if (a.dtype == Dtype::int32)
    each(0);
  else if (a.dtype == Dtype::int64)
    each(std::int64_t(0));
  else if (a.dtype == Dtype::uint32)
    each(std::uint32_t(0));
  else
    each(0.);
  for (double& x : out)
    if (std::isnan(x)) x = std::numeric_limits<double>::infinity();
  return out;
}

gsp::CompiledModel scene(bool late) {
  auto d = gsp::samples::quadruped_scene();
  d.option.sleep = true;
  if (late) d.sensors.push_back({.name = "late", .type = "clock", .settings = {{"delay", "0.004"}, {"nsample", "4"}}});
  return gsp::compile(d);
}

/// Of as many threads.
std::unique_ptr<Stepper> make(gsp::CompiledModel const& m, StepperOptions options, int threads) {
  options.worlds = worlds;
  options.threads = threads;
  auto out = make_stepper(Device::cpu, m, options);
  auto const& key = m.keyframes.at(0);
  std::vector<double> qpos, qvel(std::size_t(worlds) * std::size_t(m.nv), 0.), ctrl;
  for (int w = 0; w < worlds; ++w) {
    qpos.insert(qpos.end(), key.qpos.begin(), key.qpos.end());
    qpos[qpos.size() - std::size_t(m.nq) + 2] += 0.002 * w;
    qvel[std::size_t(w) * std::size_t(m.nv)] = 0.05 * (w % 7);
    for (double const c : key.ctrl) ctrl.push_back(c + 0.01 * (w % 5));
  }
  out->set(host_array(qpos.data(), {worlds, m.nq}), host_array(qvel.data(), {worlds, m.nv}), host_array(ctrl.data(), {worlds, m.nu}));
  return out;
}

using Pair = std::array<std::unique_ptr<Stepper>, 2>;
Pair make_pair(gsp::CompiledModel const& m, StepperOptions const& options) {
  Pair both{make(m, options, 1), make(m, options, 4)};
  REQUIRE(both[0]->threads() == 1);
  REQUIRE(both[1]->threads() == 4);
  return both;
}
template <class F>
void check_same(Pair const& both, F const& of) {
  CHECK(of(*both[0]) == of(*both[1]));
}
void check_states(Pair const& both) {
  check_same(both, [](Stepper& s) { return numbers(s.state().qpos); });
  check_same(both, [](Stepper& s) { return numbers(s.state().qvel); });
  check_same(both, [](Stepper& s) { return numbers(s.state().steps); });
  check_same(both, [](Stepper& s) { return numbers(s.state().status); });
}
void check_contacts(Pair const& both) {
  constexpr Array ContactArrays::*arrays[] = {&ContactArrays::world, &ContactArrays::geom1, &ContactArrays::geom2, &ContactArrays::dist,
                                              &ContactArrays::pos,   &ContactArrays::frame, &ContactArrays::force};
  for (auto const array : arrays) check_same(both, [&](Stepper& s) { return numbers(s.contacts().*array); });
}
void check_saved(Pair const& both) {
  auto const one = both[0]->save(), other = both[1]->save();
  REQUIRE(one.size() == other.size());
  for (std::size_t a = 0; a < one.size(); ++a) {
    CAPTURE(one[a].name);
    CHECK(one[a].name == other[a].name);
    CHECK(one[a].array.extents == other[a].array.extents);
    if (one[a].name != "impulses.place") CHECK(numbers(one[a].array) == numbers(other[a].array));  // elements without one leave what was
  }
}
template <class F>
void each_option(F const& f) {
  for (bool const mujoco : {false, true})
    for (Dtype const precision : {Dtype::float32, Dtype::float64}) {
      StepperOptions options;
      options.mujoco = mujoco;
      options.precision = precision;
      CAPTURE(mujoco);
      CAPTURE(int(precision));
      f(options);
    }
}

}  // namespace

TEST_CASE("steps of tiles, and what is read of them") {
  auto const m = scene(false);
  each_option([&](StepperOptions const& options) {
    auto const both = make_pair(m, options);
    check_same(both, [](Stepper& s) { return numbers(s.poses().xpos); });
    CHECK(both[1]->contacts().world.extents[0] == 0);
    for (auto const& s : both) {
      s->step({.steps = 30});
      s->step({.steps = 1, .measure_residual = true});
    }
    check_states(both);
    check_same(both, [](Stepper& s) { return numbers(s.poses().xquat); });
    check_same(both, [](Stepper& s) { return numbers(s.poses().xanchor); });
    check_same(both, [](Stepper& s) { return numbers(s.qfrc_constraint()); });
    check_contacts(both);
    CHECK(both[1]->contacts().world.extents[0] > 0);
    auto const one = both[0]->counts(), other = both[1]->counts();
    CHECK(one.contacts == other.contacts);
    CHECK(one.rows == other.rows);
    CHECK(one.iterations == other.iterations);
    CHECK(one.mean_iterations == other.mean_iterations);
    CHECK(one.unfinished_worlds == other.unfinished_worlds);
    CHECK(one.residual == other.residual);
    CHECK(one.asleep == other.asleep);
    CHECK(one.kept == other.kept);
    auto const left = both[0]->residuals(), other_left = both[1]->residuals();
    CHECK(left.rate.most == other_left.rate.most);
    CHECK(left.friction.mean == other_left.friction.mean);
    CHECK(left.energy == other_left.energy);
    check_same(both, [](Stepper& s) { return numbers(s.mass_matrix()); });
    for (auto const which : {SmoothForces::passive, SmoothForces::actuator, SmoothForces::bias, SmoothForces::acceleration})
      check_same(both, [&](Stepper& s) { return numbers(s.smooth_forces(which)); });
    check_same(both, [](Stepper& s) { return numbers(s.body_jacobian(2, {0.1, 0.2, 0.3})); });
    std::vector<double> qacc(std::size_t(worlds) * std::size_t(m.nv));
    for (std::size_t i = 0; i < qacc.size(); ++i) qacc[i] = 0.1 * double(i % 17);
    check_same(both, [&](Stepper& s) { return numbers(s.inverse_dynamics(host_array(qacc.data(), {worlds, m.nv}))); });
    CameraSpec camera;
    camera.body = m.body_name.at(1);
    check_same(both, [&](Stepper& s) { return numbers(s.cameras({camera}, 32, 24).viewmats); });
    check_same(both, [&](Stepper& s) { return numbers(s.sensors()); });
    check_contacts(both);  // those of the step are kept
    for (auto const& s : both) s->step({.steps = 3});
    check_states(both);
  });
}

TEST_CASE("worlds of tiles are reset, saved, restored and stopped") {
  auto const m = scene(true);
  each_option([&](StepperOptions const& options) {
    auto const both = make_pair(m, options);
    for (auto const& s : both) s->step({.steps = 12});
    check_saved(both);
    check_same(both, [](Stepper& s) { return numbers(s.sensors()); });
    std::vector<int> mask(worlds, 0);
    for (int w = 0; w < worlds; w += 3) mask[std::size_t(w)] = 1;
    for (auto const& s : both) {
      s->reset(host_array(mask.data(), {worlds}), 0);
      s->step({.steps = 5});
    }
    check_states(both);
    check_saved(both);
    // what one saved the other goes on from, in some worlds and in all
    auto const fresh = make_pair(m, options);
    fresh[0]->restore(both[1]->save());
    fresh[1]->restore(both[0]->save());
    for (auto const* pair : {&both, &fresh})
      for (auto const& s : *pair) s->step({.steps = 7});
    check_states(fresh);
    CHECK(numbers(fresh[1]->state().qvel) == numbers(both[0]->state().qvel));
    check_saved(fresh);
    StepperOptions of_one = options;
    auto const single = make_stepper(Device::cpu, m, of_one);
    single->step({.steps = 9});
    for (auto const& s : both) {
      s->restore(single->save(), host_array(mask.data(), {worlds}));
      s->step({.steps = 4});
    }
    check_states(both);
    check_saved(both);
    single->step({.steps = 4});
    CHECK(numbers(both[1]->state().qvel.rows(3, 1)) == numbers(single->state().qvel));
    // a world that stops says so
    for (auto const& s : both) {
      std::vector<double> qvel(std::size_t(worlds) * std::size_t(m.nv), 0.);
      qvel[std::size_t(29 * m.nv + 4)] = std::numeric_limits<double>::quiet_NaN();
      s->set({}, host_array(qvel.data(), {worlds, m.nv}), {});
      s->step({.steps = 2});
      auto const stopped = s->stopped(5);
      REQUIRE(stopped.size() == 1);
      CHECK(stopped[0].world == 29);
      CHECK(stopped[0].dof == both[0]->stopped(5)[0].dof);
      CHECK(s->counts().failed_worlds == 1);
    }
    check_states(both);
  });
}

TEST_CASE("values of each world lie with their tiles") {
  auto const m = scene(false);
  StepperOptions options;
  options.per_world = {"body_mass", "body_inertia", "geom_friction", "dof_damping"};
  auto const both = make_pair(m, options);
  std::vector<int> mask(worlds, 1);
  mask[7] = mask[20] = 0;
  for (std::string const field : {"body_mass", "geom_friction", "dof_damping"}) {
    auto values = numbers(both[0]->world_values(field));
    Array const shape = both[0]->world_values(field);
    for (std::size_t i = 0; i < values.size(); ++i)
      values[i] = std::isfinite(values[i]) ? values[i] * (1 + 0.01 * double(i % 13)) : std::numeric_limits<double>::quiet_NaN();
    for (auto const& s : both)
      s->set_world_values(field, host_array(values.data(), {worlds, shape.extents[1], shape.extents[2]}), host_array(mask.data(), {worlds}),
                          field == "body_mass");
    check_same(both, [&](Stepper& s) { return numbers(s.world_values(field)); });
  }
  check_same(both, [](Stepper& s) { return numbers(s.world_values("body_inertia")); });
  for (auto const& s : both) s->step({.steps = 20});
  check_states(both);
  check_contacts(both);
  check_same(both, [](Stepper& s) { return numbers(s.mass_matrix()); });
}

// A clock hears one thread, so all tiles are stepped on it: the same bits.
TEST_CASE("stages of tiles are timed") {
  auto const m = scene(false);
  auto const both = make_pair(m, {});
  both[0]->step({.steps = 4});
  auto const times = stage_times(Device::cpu, [&] { both[1]->step({.steps = 4}); });
  check_states(both);
  int calls = 0;
  for (auto const& t : times)
    if (t.name == "collision::collide") calls = t.calls;
  CHECK(calls > 4);
  CHECK(calls % 4 == 0);
}

TEST_CASE("what a tile throws reaches the caller") {
  auto const m = scene(false);
  auto const both = make_pair(m, {});
  CHECK_THROWS_WITH_AS(both[1]->step({.steps = -1}), doctest::Contains("steps must not be negative"), std::invalid_argument);
  CHECK_THROWS_AS(both[1]->reset({}, 7), std::invalid_argument);
}
