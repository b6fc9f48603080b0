#pragma once
// Derivatives of what follows from a state: duals beside central differences.
#include <algorithm>
#include <cmath>
#include <gsp/dynamics/smooth.hpp>
#include <gsp/math/dual.hpp>
#include <stdexcept>
#include <tuple>
#include <utility>

namespace gsp_test {

/// Worlds that all stand where one world of `from` does. `acceleration`: inputs or results of a test.
template <class R>
struct Copies {
  using real_type = R;
  using View2 = Kokkos::View<R**, Kokkos::LayoutRight, Kokkos::HostSpace>;
  Kokkos::DefaultHostExecutionSpace exec;
  gsp::Model<R, Kokkos::HostSpace> model;
  gsp::State<R, Kokkos::HostSpace> state;
  gsp::Dynamics<R, Kokkos::HostSpace> dynamics;
  gsp::Poses<R, Kokkos::HostSpace> poses;
  View2 acceleration;  // (worlds, nv)
  Copies(gsp::CompiledModel const& c, int worlds, gsp::Profile profile, gsp::State<double, Kokkos::HostSpace> const& from, int world)
      : model(gsp::make_model<R>(exec, c, {.profile = profile})),
        state(gsp::make_state(exec, model, {.worlds = worlds})),
        dynamics(gsp::make_dynamics(exec, model, {.worlds = worlds})),
        poses(gsp::make_poses(exec, model, {.worlds = worlds})),
        acceleration("acceleration", worlds, model.nv) {
    for (int w = 0; w < worlds; ++w) {
      for (int i = 0; i < model.nq; ++i) state.qpos(w, i) = from.qpos(world, i);
      for (int i = 0; i < model.nv; ++i) state.qvel(w, i) = from.qvel(world, i), acceleration(w, i) = std::sin(i + 1.);
      for (int i = 0; i < model.nu; ++i) state.ctrl(w, i) = from.ctrl(world, i);
      for (int i = 0; i < model.na; ++i) state.act(w, i) = from.act(world, i);
    }
  }
  /// Positions, velocities, controls, activations and accelerations, counted through.
  R& variable(int w, int i) const {
    View2 const views[] = {state.qpos, state.qvel, state.ctrl, state.act, acceleration};
    for (auto const& view : views) {
      if (i < int(view.extent(1))) return view(w, i);
      i -= int(view.extent(1));
    }
    throw std::out_of_range("gsp_test::Copies: no such variable");
  }
  int variables() const { return model.nq + 2 * model.nv + model.nu + model.na; }
};

/// Derivatives, by all variables of one world, of what evaluate(Copies) gives, a tuple of views (worlds, ...): the largest difference
/// between duals and central differences, over the largest derivative of the same view. Central differences of step s = 1e-5 have the error
/// s^2 |f'''| / 6 + eps |f| / s: where |f| < 1e3 and |f'''| < 1e4 times the largest derivative, below 2e-7 of that; the tests' bar is 1e-6.
template <class Evaluate>
double derivative_error(gsp::CompiledModel const& c, gsp::Profile profile, gsp::State<double, Kokkos::HostSpace> const& from, int world,
                        Evaluate const& evaluate) {
  constexpr int N = 8;
  double const s = 1e-5;
  int const variables = Copies<double>(c, 1, profile, from, world).variables();
  Copies<gsp::Dual<double, N>> exact(c, (variables + N - 1) / N, profile, from, world);
  Copies<double> shifted(c, 2 * variables, profile, from, world);
  for (int i = 0; i < variables; ++i) {
    exact.variable(i / N, i).slope[i % N] = 1;
    shifted.variable(2 * i, i) -= s, shifted.variable(2 * i + 1, i) += s;
  }
  double worst = 0;
  auto const compare = [&](auto const& duals, auto const& values) {
    std::size_t const n = values.size() / values.extent(0);
    double difference = 0, largest = 0;
    for (std::size_t i = 0; i < std::size_t(variables); ++i)
      for (std::size_t k = 0; k < n; ++k) {
        double const slope = duals.data()[i / N * n + k].slope[i % N];
        double const expected = (values.data()[(2 * i + 1) * n + k] - values.data()[2 * i * n + k]) / (2 * s);
        difference = std::max(difference, std::isfinite(slope) ? std::abs(slope - expected) : INFINITY);
        largest = std::max(largest, std::abs(expected));
      }
    worst = std::max(worst, largest > 0 ? difference / largest : INFINITY);  // what depends on nothing tests nothing
  };
  auto const duals = evaluate(exact);
  auto const values = evaluate(shifted);
  [&]<std::size_t... view>(std::index_sequence<view...>) { (compare(std::get<view>(duals), std::get<view>(values)), ...); }
  (std::make_index_sequence<std::tuple_size_v<std::remove_cvref_t<decltype(values)>>>{});
  return worst;
}

}  // namespace gsp_test
