// The whole smooth step (everything of forward without constraints, Euler) of go1, the humanoid and G1, float: on one and two threads
// beside MuJoCo's mj_step with constraints disabled in the same program, interleaved; on a GPU by itself, in both profiles.
//   bench_dynamics_smooth_step [MODEL.xml ...]
#include <cstdio>
#include <gsp/dynamics/smooth.hpp>
#include <gsp/io/mjcf.hpp>
#include <gsp/io/write_mjcf.hpp>
#include <gsp/model/compile.hpp>
#include <string>
#include <thread>

#include "support/bench.hpp"
#ifdef GSP_HAS_MUJOCO
#include <mujoco/mujoco.h>
#endif

namespace {

char const* name_of(gsp::Profile profile) { return profile == gsp::Profile::mujoco ? "mujoco" : "stable"; }

template <class Exec>
double run(Exec const& exec, std::string const& name, gsp::CompiledModel const& compiled, gsp::Profile profile, int worlds,
           double mujoco_us) {
  auto const model = gsp::make_model<float>(exec, compiled, {.profile = profile});
  auto state = gsp::make_state(exec, model, {.worlds = worlds});
  auto dynamics = gsp::make_dynamics(exec, model, {.worlds = worlds});
  auto poses = gsp::make_poses(exec, model, {.worlds = worlds});
  auto const time = gsp_bench::measure(exec, [&] { gsp::smooth_step(exec, model, state, poses, dynamics); });
  double const us = 1e6 * time.median / worlds;
  gsp_bench::Line line("dynamics/smooth_step", exec);
  line.add("model", name).add("worlds", worlds).add("profile", name_of(profile)).add("precision", "float").add(time);
  line.add("us_per_world", us).add("steps_per_second", worlds / time.median);
  if (mujoco_us > 0) line.add("mujoco_us_per_world", mujoco_us).add("ratio", mujoco_us / us);
  line.print();
  return us;
}

/// Microseconds of a step and world with `threads` threads, each with an mjData of its own; 0 where MuJoCo is missing.
double mujoco(std::string const& file, int threads) {
#ifdef GSP_HAS_MUJOCO
  char error[1000] = "";
  mjModel* const m = mj_loadXML(file.c_str(), nullptr, error, sizeof error);
  if (!m) return std::fprintf(stderr, "MuJoCo: %s\n", error), 0.;
  m->opt.disableflags |= mjDSBL_CONSTRAINT | mjDSBL_SENSOR;
  int const steps = 500;
  auto const work = [&] {
    mjData* const d = mj_makeData(m);
    for (int i = 0; i < steps; ++i) mj_step(m, d);
    mj_deleteData(d);
  };
  auto const time = gsp_bench::measure(Kokkos::Serial(), [&] {
    std::vector<std::thread> others;
    for (int i = 1; i < threads; ++i) others.emplace_back(work);
    work();
    for (auto& t : others) t.join();
  });
  mj_deleteModel(m);
  return 1e6 * time.median / (steps * threads);
#else
  return (void)file, 0. * threads;
#endif
}

}  // namespace

int main(int argc, char** argv) {
  Kokkos::ScopeGuard kokkos(argc, argv);
  std::string const data = gsp_bench::model_folder();
  std::vector<std::string> files(argv + 1, argv + argc);
  if (files.empty()) files = {data + "mjlab/unitree_go1/go1.xml", data + "mujoco/humanoid/humanoid.xml", data + "mjlab/unitree_g1/g1.xml"};
  for (auto const& file : files) {
    auto robot = gsp::io::read_mjcf(file, {.skip_visuals = true});
    robot.option.integrator = gsp::Integrator::euler;
    auto const compiled = gsp::compile(robot);
    std::string const name = file.substr(file.rfind('/') + 1),
                      copy = "bench_dynamics_smooth_step_" + name;  // without what only viewers need
    gsp::io::write_mjcf(copy, robot);
    for (int i = 0; i < 5; ++i) {
      run(Kokkos::Serial(), name, compiled, gsp::Profile::mujoco, 1024, mujoco(copy, 1));
#ifdef KOKKOS_ENABLE_OPENMP
      run(Kokkos::OpenMP(), name, compiled, gsp::Profile::mujoco, 1024, mujoco(copy, Kokkos::OpenMP().concurrency()));
#endif
    }
    std::remove(copy.c_str());
#ifdef KOKKOS_ENABLE_CUDA
    for (auto profile : {gsp::Profile::mujoco, gsp::Profile::stable})
      for (int worlds : {1024, 8192, 32768}) run(Kokkos::Cuda(), name, compiled, profile, worlds, 0);
#endif
  }
}
