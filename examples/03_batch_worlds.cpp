// Many worlds: 500 boxes, each in a world of its own, pushed along a floor at different speeds. The state is plain views: write starts,
// read results, reduce.
#include <cmath>
#include <cstdio>
#include <gsp/model/compile.hpp>
#include <gsp/model/samples.hpp>
#include <gsp/step/step.hpp>

int main(int argc, char** argv) {
  Kokkos::ScopeGuard const kokkos(argc, argv);
  using Exec = Kokkos::DefaultExecutionSpace;
  Exec const exec;
  int const worlds = 500;
  float const mu = 0.5f;

  auto const compiled = gsp::compile(gsp::samples::ramp(0, mu));  // a ramp without slope
  auto const model = gsp::make_model<float>(exec, compiled);
  auto state = gsp::make_state(exec, model, {.worlds = worlds});
  auto sim = gsp::make_simulation(exec, model, compiled, {.worlds = worlds});

  auto const qpos = state.qpos, qvel = state.qvel;
  gsp::step(exec, model, state, sim, {.steps = 100});  // settle
  Kokkos::parallel_for(
      "push", Kokkos::RangePolicy<Exec>(exec, 0, worlds), KOKKOS_LAMBDA(int w) {
        qpos(w, 0) = 0;
        qvel(w, 0) = 2.f * float(w) / float(worlds);  // [m/s]
      });
  gsp::step(exec, model, state, sim, {.steps = 300});

  // each has slid v^2 / (2 mu g), less half a step's way
  double worst = 0, sum = 0;
  int stopped = 0;
  float const way = float(model.timestep);
  Kokkos::parallel_reduce(
      "compare", Kokkos::RangePolicy<Exec>(exec, 0, worlds),
      KOKKOS_LAMBDA(int w, double& most, double& total, int& still) {
        double const v = 2. * w / worlds, expected = v * v / (2 * mu * 9.81) - v * way / 2, error = Kokkos::abs(qpos(w, 0) - expected);
        most = error > most ? error : most;
        total += qpos(w, 0);
        still += Kokkos::abs(qvel(w, 0)) < 1e-5f;
      },
      Kokkos::Max<double>(worst), Kokkos::Sum<double>(sum), Kokkos::Sum<int>(stopped));
  std::printf("%d of %d boxes have come to rest, after %.3f m on average; worst difference from v^2 / (2 mu g): %.2f mm\n", stopped, worlds,
              sum / worlds, 1000 * worst);
  return stopped == worlds && worst < 1e-3 ? 0 : 1;
}
