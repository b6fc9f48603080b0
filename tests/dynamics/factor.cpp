#include <doctest/doctest.h>

#include <gsp/dynamics/smooth.hpp>
#include <gsp_test_execs.hpp>

#include "dynamics/random_tree.hpp"
#include "support/kernels.hpp"

// L^T D L = M (+ implicit terms): M times the solved acceleration gives back the force. Tolerance: the residual of a backward stable solve,
// n^2 eps |M| |x| with n <= 30 dofs; |M|, |x| < 100 here.
TEST_CASE_TEMPLATE("factor and solve give back the force", Exec, GSP_TEST_EXECS) {
  using R = double;
  Exec const exec;
  auto const compiled = gsp::compile(gsp_test::random_model({gsp::JointType::free, gsp::JointType::hinge, gsp::JointType::free}, 8));
  auto const model = gsp::make_model<R>(exec, compiled, {.profile = gsp::Profile::mujoco});
  REQUIRE(model.narchetype == 2);
  for (int worlds : {1, 3, 40}) {
    auto state = gsp::make_state(exec, model, {.worlds = worlds});
    auto dynamics = gsp::make_dynamics(exec, model, {.worlds = worlds});
    auto poses = gsp::make_poses(exec, model, {.worlds = worlds});
    gsp_test::randomise(compiled, state);
    gsp::smooth_dynamics(exec, model, state, poses, dynamics, {.keep_all = true});
    Kokkos::View<R***, Kokkos::LayoutRight, typename Exec::memory_space> M("M", worlds, model.nv, model.nv);
    Kokkos::View<R**, Kokkos::LayoutRight, typename Exec::memory_space> force("force", worlds, model.nv),
        acceleration("acceleration", worlds, model.nv);
    gsp::dense_mass_matrix(exec, model, dynamics, M);
    gsp::copy_dofs(exec, model, dynamics, &gsp::DynamicsLayout::force, force);
    gsp::copy_dofs(exec, model, dynamics, &gsp::DynamicsLayout::acceleration, acceleration);
    exec.fence();
    auto const m = gsp_test::host(M);
    auto const f = gsp_test::host(force), x = gsp_test::host(acceleration);
    for (int w = 0; w < worlds; ++w)
      for (int i = 0; i < model.nv; ++i) {
        double sum = 0;
        for (int j = 0; j < model.nv; ++j) sum += m(w, i, j) * x(w, j);
        REQUIRE(std::abs(sum - f(w, i)) < 900 * 2.3e-16 * 1e4);
      }
  }
}
