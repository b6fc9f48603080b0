// All stages of a step together: the sample quadruped among objects on a floor (contacts, limits, friction), both profiles, float, 1,024
// worlds on one thread and on all, 8,192 on a GPU. The worlds settle first; the steps measured go on from there.
#include <gsp/model/compile.hpp>
#include <gsp/model/samples.hpp>
#include <gsp/step/step.hpp>

#include "support/bench.hpp"

namespace {

template <class Exec>
void run(Exec const& exec, gsp::Profile profile, int worlds) {
  auto const compiled = gsp::compile(gsp::samples::quadruped_scene());
  auto const model = gsp::make_model<float>(exec, compiled, {.profile = profile});
  auto state = gsp::make_state(exec, model, {.worlds = worlds});
  auto sim = gsp::make_simulation(exec, model, compiled, {.worlds = worlds});
  auto const& stand = compiled.keyframes.at(0);
  auto const qpos = Kokkos::create_mirror_view(Kokkos::HostSpace{}, state.qpos),
             ctrl = Kokkos::create_mirror_view(Kokkos::HostSpace{}, state.ctrl);
  for (int w = 0; w < worlds; ++w) {
    for (int i = 0; i < model.nq; ++i) qpos(w, i) = float(stand.qpos[i]);
    for (int i = 0; i < model.nu; ++i) ctrl(w, i) = float(stand.ctrl[i]);
    qpos(w, 2) += 0.05f * float(w) / float(worlds);
  }
  Kokkos::deep_copy(state.qpos, qpos);
  Kokkos::deep_copy(state.ctrl, ctrl);
  gsp::step(exec, model, state, sim, {.steps = 100});
  int const steps = 10;
  auto const time =
      gsp_bench::measure(exec, [&] { gsp::step(exec, model, state, sim, {.steps = steps, .poses = false}); }, {.samples = 5, .repeats = 5});
  gsp_bench::Line("step/step", exec)
      .add("worlds", worlds)
      .add("profile", profile == gsp::Profile::mujoco ? "mujoco" : "stable")
      .add("precision", "float")
      .add("rows_per_world", gsp_bench::mean(sim.rows.count))
      .add("iterations", gsp_bench::mean(sim.solution.iterations))
      .add(time)
      .add("us_per_world", 1e6 * time.median / (steps * worlds))
      .add("steps_per_second", steps * worlds / time.median)
      .add_hash(state.qpos)
      .print();
}

}  // namespace

int main(int argc, char** argv) {
  Kokkos::ScopeGuard const kokkos(argc, argv);
  for (auto const profile : {gsp::Profile::stable, gsp::Profile::mujoco}) {
    run(Kokkos::Serial(), profile, 1024);
#ifdef KOKKOS_ENABLE_OPENMP
    run(Kokkos::OpenMP(), profile, 1024);
#endif
#ifdef KOKKOS_ENABLE_CUDA
    run(Kokkos::Cuda(), profile, 8192);
#endif
  }
}
