#pragma once
// A step without collision, from public functions: what tests of constraints and of the solver need, and quick to compile.
#include <gsp/constraint/assemble.hpp>
#include <gsp/dynamics/integrate.hpp>
#include <gsp/dynamics/smooth.hpp>
#include <gsp/solver/pgs.hpp>

#include "dynamics/random_tree.hpp"
#include "support/kernels.hpp"

namespace gsp_test {

/// A number in [-1, 1) that its arguments fix: entries, laws and bounds of random rows, on any backend.
KOKKOS_INLINE_FUNCTION double hashed(int world, int k, int row, int i, int seed = 1) {
  std::uint64_t s = 0x9e3779b97f4a7c15u * (std::uint64_t(seed) + std::uint64_t(world) + 1000 * std::uint64_t(k) +
                                           100000 * std::uint64_t(row) + 10000000 * std::uint64_t(i));
  for (int j = 0; j < 4; ++j) s ^= s << 13, s ^= s >> 7, s ^= s << 17;
  return double(s >> 11) / 4503599627370496. - 1;
}

template <class R, class Exec>
struct Loop {
  using Mem = typename Exec::memory_space;
  Exec exec;
  gsp::Model<R, Mem> model;
  gsp::State<R, Mem> state;
  gsp::Dynamics<R, Mem> dynamics;
  gsp::Poses<R, Mem> poses;
  gsp::Rows<R, Mem> rows;
  gsp::Impulses<R, Mem> impulses;
  gsp::Solution<R, Mem> solution;
  gsp::Progress<Mem> progress;
  gsp::PgsOptions solver{.iterations = 1000, .tolerance = 0};

  Loop(gsp::CompiledModel const& c, int worlds, gsp::ModelOptions options = {}, Exec const& on = Exec{})
      : exec(on),
        model(gsp::make_model<R>(exec, c, options)),
        state(gsp::make_state(exec, model, {.worlds = worlds})),
        dynamics(gsp::make_dynamics(exec, model, {.worlds = worlds})),
        poses(gsp::make_poses(exec, model, {.worlds = worlds})),
        rows(gsp::make_rows(exec, model, {.worlds = worlds})),
        impulses(gsp::make_impulses(exec, rows)),
        solution(gsp::make_solution(exec, model, {.worlds = worlds})),
        progress(gsp::make_progress(exec)) {}
  /// New pools, without impulses of before.
  void forget(gsp::RowsOptions const& options) {
    rows = gsp::make_rows(exec, model, options);
    impulses = gsp::make_impulses(exec, rows);
  }
  void solve(gsp::PgsOptions const& options) { gsp::pgs(exec, rows, impulses, solution, progress, options); }
  bool grow() { return gsp::grow(exec, rows, impulses, progress); }

  template <class... Types>
  void assemble(Types const&... types) {
    gsp::smooth_dynamics(exec, model, state, poses, dynamics);
    gsp::assemble(exec, model, state, dynamics, gsp::constraints(types...), rows, impulses, progress);
  }
  /// Ends the step; true if it has to be repeated.
  bool finish() {
    solve(solver);
    gsp::integrate(exec, model, state, dynamics, progress, solution);
    return grow();
  }
  template <class... Types>
  void step(int n, Types const&... types) {
    for (int i = 0; i < n;) {
      assemble(types...);
      if (!finish()) ++i;
    }
  }
  void set(int w, std::vector<double> const& qpos, std::vector<double> const& qvel) {
    auto const q = host(state.qpos), v = host(state.qvel);
    for (std::size_t i = 0; i < qpos.size(); ++i) q(w, i) = R(qpos[i]);
    for (std::size_t i = 0; i < qvel.size(); ++i) v(w, i) = R(qvel[i]);
    Kokkos::deep_copy(state.qpos, q), Kokkos::deep_copy(state.qvel, v);
  }
  void push(int w, std::vector<double> const& force) {
    auto const f = host(state.qfrc_applied);
    for (std::size_t i = 0; i < force.size(); ++i) f(w, i) = R(force[i]);
    Kokkos::deep_copy(state.qfrc_applied, f);
  }
};

/// `count` bodies of `mass` kg, each on a slide along x from the world: dof i of the model is tree i.
inline gsp::Description sliders(int count, double mass) {
  gsp::Description d;
  d.option.gravity = {0, 0, 0};
  for (int i = 0; i < count; ++i) {
    gsp::BodyDescription b;
    b.parent = 0, b.name = std::string("b").append(std::to_string(i)), b.pos = {0, double(i), 0}, b.has_inertial = true;
    b.inertial.mass = mass, b.inertial.inertia = {0.1, 0.1, 0.1, 0, 0, 0};
    b.joints.emplace_back().type = gsp::JointType::slide, b.joints[0].name = std::string("j").append(std::to_string(i)),
    b.joints[0].axis = {1, 0, 0};
    d.bodies.push_back(b);
  }
  return d;
}

}  // namespace gsp_test
