// A loop of single steps as a program of one's own would write it, float, for bench/step/loop.py, which runs the same from Python beside
// it.
//   bench_step_loop SCENE.xml [WORLDS [STEPS [DEVICE]]]
// The scene's first keyframe where it has one; 100 steps before, STEPS (1,000) then, without control.
#include <cstdlib>
#include <gsp/io/mjcf.hpp>
#include <gsp/model/compile.hpp>
#include <gsp/model/keyframe.hpp>
#include <gsp/step/step.hpp>

#include "support/bench.hpp"

namespace {

template <class Exec>
void run(Exec const& exec, std::string const& path, int worlds, int steps) {
  auto const compiled = gsp::compile(gsp::io::read_mjcf(path, {.skip_visuals = true}));
  auto const model = gsp::make_model<float>(exec, compiled);
  auto state = gsp::make_state(exec, model, {.worlds = worlds});
  auto sim = gsp::make_simulation(exec, model, compiled, {.worlds = worlds});
  if (!compiled.keyframes.empty()) gsp::set_keyframe(exec, model, compiled, 0, state);
  gsp::step(exec, model, state, sim, {.steps = 100});
  exec.fence();
  auto const begin = std::chrono::steady_clock::now();
  for (int i = 0; i < steps; ++i) gsp::step(exec, model, state, sim);
  exec.fence();
  double const seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  gsp_bench::Line("step/loop", exec)
      .add("worlds", worlds)
      .add("steps", steps)
      .add("seconds", seconds)
      .add("steps_per_second", double(steps) * worlds / seconds)
      .add_hash(state.qpos)
      .print();
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 2) {
    std::printf("bench_step_loop SCENE.xml [WORLDS [STEPS [cpu|cuda]]]\n");
    return 2;
  }
  Kokkos::ScopeGuard const kokkos(argc, argv);
  int const worlds = argc > 2 ? std::atoi(argv[2]) : 1024, steps = argc > 3 ? std::atoi(argv[3]) : 1000;
#ifdef KOKKOS_ENABLE_CUDA
  if (argc > 4 && std::string(argv[4]) == "cuda") {
    run(Kokkos::Cuda(), argv[1], worlds, steps);
    return 0;
  }
#endif
  run(Kokkos::DefaultHostExecutionSpace(), argv[1], worlds, steps);
}
