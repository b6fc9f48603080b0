// A constraint of one's own: a law and a Jacobian. Storage, warm start and solving are not its business.
#include <cmath>
#include <cstdio>
#include <gsp/model/compile.hpp>
#include <gsp/model/samples.hpp>
#include <gsp/step/step.hpp>

using Exec = Kokkos::DefaultExecutionSpace;
using Mem = Exec::memory_space;

// example-begin spring
/// Spring and damper that pull the first degree of freedom to `rest`. The law is written once, on any number type: a dual number finds its
/// slopes.
struct Tether : gsp::OneFreeRow {
  float stiffness, damping, rest;  // [N m/rad], [N m s/rad], [rad]
  gsp::State<float, Mem>::View<float**> qpos;

  KOKKOS_FUNCTION int count(int) const { return 1; }
  template <class T>
  KOKKOS_FUNCTION T lambda(int, int, int, T x, T u) const {
    return -(stiffness * x + damping * u);
  }
  template <class Row>
  KOKKOS_FUNCTION float jacobian(int world, int, int, Row&& J) const {
    J.set_dof(0, 1.f);
    return qpos(world, 0) - rest;
  }
};
// example-end spring

int main(int argc, char** argv) {
  Kokkos::ScopeGuard const kokkos(argc, argv);
  Exec const exec;
  float const h = 0.02f, k = 20000, rest = 1;

  auto const compiled = gsp::compile(gsp::samples::pendulum());
  auto const model = gsp::make_model<float>(exec, compiled, {.timestep = h});
  auto state = gsp::make_state(exec, model);
  auto sim = gsp::make_simulation(exec, model, compiled);

  gsp::step(exec, model, state, sim, {.steps = 100}, Tether{{}, k, 5, rest, state.qpos});  // taken implicitly: stable at any stiffness
  auto const qpos = Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, state.qpos);
  auto const low = Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, state.qpos_low);  // what float has no room for
  double const reached = double(qpos(0, 0)) + low(0, 0);

  // it rests where the spring carries the weight: k (rest - q) = m g d sin q
  double const m = compiled.body_mass[1], d = -compiled.body_ipos[1][2], I = compiled.body_inertia[1][0] + m * d * d;
  double q = rest;
  for (int i = 0; i < 20; ++i) q = rest - m * 9.81 * d * std::sin(q) / k;
  std::printf("pulled up to %.6f rad, in closed form %.6f rad\nsteps of %.0f ms; an explicit spring would explode above %.1f ms\n", reached,
              q, 1000. * h, 2000 * std::sqrt(I / k));
  return std::fabs(reached - q) < 1e-6 ? 0 : 1;  // ten roundings of 1 in float
}
