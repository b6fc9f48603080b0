// Sweeps that a step takes from the impulses of the step before (warm) beside those from none (cold), of one world of a model, float,
// profile stable: one line every so many steps. `bench_step_sweeps MODEL.xml STEPS EVERY`; scripts/stability draws them. The cold step is
// done besides, from the same state, and may take a hundred times as many sweeps as the warm one.
#include <cstdlib>
#include <gsp/io/mjcf.hpp>
#include <gsp/model/compile.hpp>
#include <gsp/step/step.hpp>

#include "support/bench.hpp"

int main(int argc, char** argv) {
  if (argc != 4) {
    std::fprintf(stderr, "bench_step_sweeps MODEL.xml STEPS EVERY\n");
    return 2;
  }
  Kokkos::ScopeGuard const kokkos(argc, argv);
  Kokkos::DefaultExecutionSpace const exec;
  auto const compiled = gsp::compile(gsp::io::read_mjcf(argv[1]));
  auto const model = gsp::make_model<float>(exec, compiled);
  auto state = gsp::make_state(exec, model, {.worlds = 1}), other = gsp::make_state(exec, model, {.worlds = 1});
  auto warm = gsp::make_simulation(exec, model, compiled, {.worlds = 1}), cold = gsp::make_simulation(exec, model, compiled, {.worlds = 1});
  gsp::PgsOptions const solver, patient{.iterations = 100 * solver.iterations};
  int const steps = std::atoi(argv[2]), every = std::atoi(argv[3]);
  Kokkos::View<bool*, Kokkos::DefaultExecutionSpace> const all("all", 1);
  Kokkos::deep_copy(exec, all, true);
  for (int done = 1; done <= steps; ++done) {
    bool const seen = done % every == 0;
    if (seen) {
      gsp::reset(exec, model, other, all, state);
      gsp::step(exec, model, other, cold, {.solver = patient});
    }
    gsp::step(exec, model, state, warm, {.solver = solver});
    if (seen)
      gsp_bench::Line("step/sweeps", exec)
          .add("time", done * compiled.option.timestep)
          .add("warm", int(gsp_bench::mean(warm.solution.iterations)))
          .add("cold", int(gsp_bench::mean(cold.solution.iterations)))
          .add_hash(state.qpos)
          .print();
  }
}
