// Steps launched one by one and as a graph (StepGraph), the sample quadruped among objects on a floor, float, profile stable, few worlds:
// where launches, not the work, take the time of a GPU. Ten steps a call, which waits at its end.
#include <gsp/model/compile.hpp>
#include <gsp/model/samples.hpp>
#include <gsp/step/step_graph.hpp>

#include "support/bench.hpp"

namespace {

template <class Exec>
void run(Exec const& exec, int worlds) {
  auto const compiled = gsp::compile(gsp::samples::quadruped_scene());
  auto const model = gsp::make_model<float>(exec, compiled);
  auto state = gsp::make_state(exec, model, {.worlds = worlds});
  auto sim = gsp::make_simulation(exec, model, compiled, {.worlds = worlds});
  gsp::step(exec, model, state, sim, {.steps = 1000});  // they lie
  gsp::StepGraph graph(exec, model, state, sim);
  int const steps = 10;
  auto const line = [&](char const* how, auto const& f) {
    auto const time = gsp_bench::measure(exec, f, {.samples = 5, .repeats = 5});
    gsp_bench::Line("step/step_graph", exec)
        .add("worlds", worlds)
        .add("launched", how)
        .add(time)
        .add("us_per_step", 1e6 * time.median / steps)
        .add("steps_per_second", steps * worlds / time.median)
        .print();
  };
  for (int turn = 0; turn < 3; ++turn) {
    line("one by one", [&] { gsp::step(exec, model, state, sim, {.steps = steps, .poses = false}); });
    line("as a graph", [&] { graph.step(steps, false); });
  }
}

}  // namespace

int main(int argc, char** argv) {
  Kokkos::ScopeGuard const kokkos(argc, argv);
  for (int const worlds : {1, 64, 1024, 8192}) run(Kokkos::DefaultExecutionSpace(), worlds);
}
