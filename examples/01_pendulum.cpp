// A pendulum: a description, a model, a state, steps. Its period is known in closed form, and its energy does not drift.
#include <cmath>
#include <cstdio>
#include <gsp/model/compile.hpp>
#include <gsp/model/samples.hpp>
#include <gsp/step/step.hpp>

int main(int argc, char** argv) {
  Kokkos::ScopeGuard const kokkos(argc, argv);
  Kokkos::DefaultExecutionSpace const exec;
  double const h = 0.001, swing = 1.2;  // timestep [s], amplitude [rad]

  auto const compiled = gsp::compile(gsp::samples::pendulum());                 // flat arrays on the host
  auto const model = gsp::make_model<double>(exec, compiled, {.timestep = h});  // constant, on the device
  auto state = gsp::make_state(exec, model, {.worlds = 1});                     // what changes
  auto sim = gsp::make_simulation(exec, model, compiled, {.worlds = 1});        // buffers
  Kokkos::deep_copy(exec, state.qpos, swing);

  // I q'' = -m g d sin q;  period = 4 K(sin(swing / 2)) sqrt(I / (m g d)), K by the arithmetic-geometric mean
  double const m = compiled.body_mass[1], d = -compiled.body_ipos[1][2], I = compiled.body_inertia[1][0] + m * d * d,
               w0 = std::sqrt(m * 9.81 * d / I);
  double a = 1, b = std::cos(swing / 2);
  for (int i = 0; i < 6; ++i) {
    double const mean = (a + b) / 2;
    b = std::sqrt(a * b);
    a = mean;
  }
  double const period = 2 * std::acos(-1.) / (a * w0);

  auto const energy = [&](double q, double v) { return I * v * v / 2 + m * 9.81 * d * (1 - std::cos(q)); };
  double const start = energy(swing, 0);
  double before = swing, first = 0, last = 0, spread = 0;
  int crossings = 0;
  for (int t = 1; t <= 12000; ++t) {
    gsp::step(exec, model, state, sim);
    auto const qpos = Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, state.qpos);
    auto const qvel = Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, state.qvel);
    double const q = qpos(0, 0);
    if (before > 0 && q <= 0) {  // downwards through 0: once a period
      last = h * (t - q / (q - before));
      if (crossings++ == 0) first = last;
    }
    before = q;
    spread = std::fmax(spread, std::fabs(energy(q, qvel(0, 0)) / start - 1));
  }
  double const measured = (last - first) / (crossings - 1);
  std::printf("period %.6f s, in closed form %.6f s\nenergy stays within %.2f %% for %d swings (a first-order method: h w0 = %.2f %%)\n",
              measured, period, 100 * spread, crossings, 100 * h * w0);
  // semi-implicit Euler keeps an energy that is h/2 v dV/dq away, and its period is (h w)^2 / 24 off
  return std::fabs(measured / period - 1) < h * h * w0 * w0 && spread < h * w0 ? 0 : 1;
}
