// Newton's method alone, from nothing and from its own solution: rows of the sample quadruped among objects, 100 steps after its start
// without control (contacts with pyramids, limits), profile mujoco, float; 1,024 worlds on one thread and on all, 8,192 on a GPU.
#include <gsp/model/compile.hpp>
#include <gsp/model/samples.hpp>
#include <gsp/step/step.hpp>

#include "support/bench.hpp"

namespace {

template <class Exec>
void run(Exec const& exec, int worlds) {
  auto const compiled = gsp::compile(gsp::samples::quadruped_scene());
  auto const model = gsp::make_model<float>(exec, compiled, {.profile = gsp::Profile::mujoco});
  auto state = gsp::make_state(exec, model, {.worlds = worlds});
  auto sim = gsp::make_simulation(exec, model, compiled, {.worlds = worlds});
  gsp::step(exec, model, state, sim, {.steps = 100});
  for (bool const warm : {false, true}) {
    auto const time = gsp_bench::measure(
        exec, [&] { gsp::newton(exec, sim.rows, sim.impulses, sim.solution, sim.newton, sim.progress, {.warm = warm}); });
    gsp_bench::Line("solver/newton", exec)
        .add("worlds", worlds)
        .add("dofs", model.nv)
        .add("profile", "mujoco")
        .add("precision", "float")
        .add("warm", warm)
        .add("rows_per_world", gsp_bench::mean(sim.rows.count))
        .add("iterations", gsp_bench::mean(sim.solution.iterations))
        .add(time)
        .add("us_per_world", 1e6 * time.median / worlds)
        .add_hash(sim.solution.z)
        .print();
  }
}

}  // namespace

int main(int argc, char** argv) {
  Kokkos::ScopeGuard const kokkos(argc, argv);
  run(Kokkos::Serial(), 1024);
#ifdef KOKKOS_ENABLE_OPENMP
  run(Kokkos::OpenMP(), 1024);
#endif
#ifdef KOKKOS_ENABLE_CUDA
  run(Kokkos::Cuda(), 8192);
#endif
}
