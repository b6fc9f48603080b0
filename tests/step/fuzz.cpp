// Worlds that nobody would build (step/random_scene.hpp) from starts that overlap: after 500 steps each is finite, or has a status bit that
// says why it is not; none hangs; one thread and two give the same bits. CTest runs a slice. All 10,000 worlds take an hour:
//   OMP_NUM_THREADS=2 test_step_fuzz --no-skip -ts=long
// GSP_FUZZ_FIRST and GSP_FUZZ_SCENES say which seeds; GSP_FUZZ_KEEP=FOLDER writes the scenes of worlds that stopped there, each with the
// start as its keyframe, for gsp sim --keyframe and for MuJoCo.
#include <doctest/doctest.h>

#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <gsp/io/mjcf.hpp>
#include <gsp/io/write_mjcf.hpp>
#include <gsp/model/compile.hpp>
#include <gsp/step/step.hpp>
#include <string>

#include "step/random_scene.hpp"
#include "step/world.hpp"
#include "support/kernels.hpp"

namespace {
using Host = Kokkos::DefaultHostExecutionSpace;
constexpr int worlds = 8, steps = 500;

struct Tally {
  int scenes = 0, refused = 0, worlds = 0, stopped = 0;
};

int number(char const* name, int otherwise) {
  char const* const text = std::getenv(name);
  return text ? std::atoi(text) : otherwise;
}

/// Starts: near the model's own, so that bodies overlap, at up to 3 m/s and 3 rad/s, under any control.
template <class State>
void start(gsp::CompiledModel const& m, State const& s, std::uint64_t seed) {
  gsp_test::Dice r(seed * 31 + 7);
  for (int w = 0; w < s.worlds; ++w) {
    for (int j = 0; j < m.njnt; ++j) {
      auto const type = gsp::JointType(m.jnt_type[j]);
      int q = m.jnt_qposadr[j];
      if (type >= gsp::JointType::slide) s.qpos(w, q) += 0.5 * r();
      if (type == gsp::JointType::free)
        for (int c = 0; c < 3; ++c) s.qpos(w, q++) += 0.3 * r();
      if (type <= gsp::JointType::ball) {
        auto const quat = gsp_test::random_quat(r);
        for (int c = 0; c < 4; ++c) s.qpos(w, q + c) = quat[c];
      }
    }
    for (int i = 0; i < m.nv; ++i) s.qvel(w, i) = 3 * r();
    for (int i = 0; i < m.nu; ++i) s.ctrl(w, i) = r();
  }
}

template <class R>
struct Batch {
  gsp::Model<R, Kokkos::HostSpace> model;
  gsp::State<R, Kokkos::HostSpace> state;
  gsp::Simulation<R, Kokkos::HostSpace> sim;
  Batch(Host const& exec, gsp::CompiledModel const& m, gsp::Profile profile, std::uint64_t seed)
      : model(gsp::make_model<R>(exec, m, {.profile = profile})),
        state(gsp::make_state(exec, model, {.worlds = worlds})),
        sim(gsp::make_simulation(exec, model, m, {.worlds = worlds})) {
    start(m, state, seed);
  }
};

template <class V>
bool same(V const& a, V const& b) {
  return a.span() == 0 || std::memcmp(a.data(), b.data(), a.span() * sizeof *a.data()) == 0;
}
template <class V>
bool finite(V const& v, int w) {
  for (int i = 0; i < int(v.extent(1)); ++i)
    if (!std::isfinite(double(v(w, i)))) return false;
  return true;
}

void keep(gsp::Description d, gsp::CompiledModel const& m, std::uint64_t seed, int w, std::string const& what) {
  char const* const folder = std::getenv("GSP_FUZZ_KEEP");
  if (!folder) return;
  auto const model = gsp::make_model<double>(Host{}, m);
  auto const s = gsp::make_state(Host{}, model, {.worlds = worlds});
  start(m, s, seed);
  gsp::KeyframeDescription key;
  key.name = "start";
  for (int i = 0; i < m.nq; ++i) key.qpos.push_back(s.qpos(w, i));
  for (int i = 0; i < m.nv; ++i) key.qvel.push_back(s.qvel(w, i));
  for (int i = 0; i < m.nu; ++i) key.ctrl.push_back(s.ctrl(w, i));
  d.keyframes.push_back(key);
  gsp::io::write_mjcf(std::string(folder) + "/" + what + ".xml", d);
}

template <class R>
void run(std::uint64_t seed, gsp::Profile profile, bool threads_too, Tally& tally) {
  auto const d = gsp_test::random_scene(seed);
  std::string const what =
      std::to_string(seed) + (profile == gsp::Profile::stable ? "_stable" : "_mujoco") + (sizeof(R) == 4 ? "_float" : "_double");
  INFO(what);
  ++tally.scenes;
  gsp::CompiledModel m;
  try {
    m = gsp::compile(d);
  } catch (gsp::Error const& error) {  // one sentence; the generator means to avoid it
    ++tally.refused;
    MESSAGE(what, " is refused: ", error.what());
    return;
  }
  Host const exec{};
  Batch<R> batch(exec, m, profile, seed);
  gsp::step(exec, batch.model, batch.state, batch.sim, {.steps = steps});
  for (int w = 0; w < worlds; ++w, ++tally.worlds) {
    INFO("world ", w);
    auto const bits = batch.state.status(w);
    CHECK(finite(batch.state.qpos, w));
    CHECK(finite(batch.state.qvel, w));
    CHECK(finite(batch.state.act, w));
    CHECK((bits & ~(gsp::status::not_finite | gsp::status::unbounded)) == 0);  // what did not fit was repeated, and no row is refused
    CHECK((bits != 0 || batch.state.steps(w) == steps));                       // no step is left out in silence
    if (bits == 0) continue;
    ++tally.stopped;
    std::printf("%s world %d of %g s: step %d: %.40s\n", what.c_str(), w, d.option.timestep, int(batch.state.steps(w)),
                gsp::status::text(bits).c_str());
    keep(d, m, seed, w, what + "_" + std::to_string(w));
  }
  if (!threads_too) return;
#if defined(KOKKOS_ENABLE_OPENMP)
  Kokkos::OpenMP const one(1);
  Batch<R> alone(one, m, profile, seed);
  gsp::step(one, alone.model, alone.state, alone.sim, {.steps = steps});
  CHECK(same(alone.state.qpos, batch.state.qpos));
  CHECK(same(alone.state.qvel, batch.state.qvel));
  CHECK(same(alone.state.status, batch.state.status));
#endif
}

/// Each precision and profile takes every fourth seed.
void run_all(std::uint64_t first, int scenes, int compare_every, Tally& tally) {
  for (std::uint64_t seed = first; seed < first + std::uint64_t(scenes); ++seed) {
    auto const profile = seed % 2 ? gsp::Profile::mujoco : gsp::Profile::stable;
    bool const threads_too = (seed / 4) % std::uint64_t(compare_every) == 0;
    if (seed / 2 % 2)
      run<double>(seed, profile, threads_too, tally);
    else
      run<float>(seed, profile, threads_too, tally);
  }
  std::printf("%d scenes: %d refused; %d worlds, of which %d stopped\n", tally.scenes, tally.refused, tally.worlds, tally.stopped);
}
}  // namespace

TEST_CASE("random worlds end finite or say why not, with the same bits for any number of threads") {
  Tally tally;
  run_all(1, 8, 2, tally);
  CHECK(tally.refused == 0);
}

// The starting files of the fuzzer (tests/fuzz/seeds/mjcf): meshes that are flat, open, inside out, one point; height fields of one row;
// solimp out of range; welds that contradict each other, loops that cannot close. Each is refused in one sentence, stops with a status bit,
// or stays finite for 200 steps.
TEST_CASE("files that ask for what cannot be end in a sentence, a status bit or numbers") {
  int files = 0, refused = 0, stopped = 0;
  for (auto const& entry : std::filesystem::directory_iterator(std::filesystem::path(GSP_TEST_DIR) / "fuzz/seeds/mjcf")) {
    auto const name = entry.path().filename().string();
    INFO(name);
    ++files;
    gsp::CompiledModel m;
    auto const step = [&](auto zero, gsp::Profile profile) {
      using R = decltype(zero);
      Host const exec{};
      auto const model = gsp::make_model<R>(exec, m, {.profile = profile});
      auto state = gsp::make_state(exec, model);
      auto sim = gsp::make_simulation(exec, model, m);
      gsp::step(exec, model, state, sim, {.steps = 200});
      CHECK(finite(state.qpos, 0));
      CHECK(finite(state.qvel, 0));
      CHECK((state.status(0) & ~(gsp::status::not_finite | gsp::status::unbounded)) == 0);
      CHECK((state.status(0) != 0 || state.steps(0) == 200));
      stopped += state.status(0) != 0;
      if (state.status(0) != 0) std::printf("%s: %s\n", name.c_str(), gsp::status::text(state.status(0)).c_str());
    };
    try {
      auto d = gsp::io::read_mjcf(entry.path());
      m = gsp::compile(d);
      for (auto const profile : {gsp::Profile::stable, gsp::Profile::mujoco}) step(0.f, profile), step(0., profile);
    } catch (gsp::Error const& error) {
      std::string const text = error.what();
      ++refused;
      std::printf("%s is refused: %s\n", name.c_str(), text.c_str());
      CHECK(text.size() > 20);
      CHECK(text.find('\n') == std::string::npos);
    }
  }
  std::printf("%d files: %d refused; %d runs stopped\n", files, refused, stopped);
  CHECK(files > 15);
}

TEST_CASE("10,000 random worlds end finite or say why not" * doctest::test_suite("long") * doctest::skip()) {
  Tally tally;
  run_all(std::uint64_t(number("GSP_FUZZ_FIRST", 1000)), number("GSP_FUZZ_SCENES", 10000 / worlds), 8, tally);
}
