// A loop of one's own from public functions: what gsp::step does in profile stable, stage by stage. Put your own stages between them, or
// leave some out.
#include <cmath>
#include <cstdio>
#include <gsp/model/compile.hpp>
#include <gsp/model/keyframe.hpp>
#include <gsp/model/samples.hpp>
#include <gsp/step/sleep.hpp>
#include <gsp/step/step.hpp>

int main(int argc, char** argv) {
  Kokkos::ScopeGuard const kokkos(argc, argv);
  Kokkos::DefaultExecutionSpace const exec;
  int const worlds = 8, steps = 200;

  auto const compiled = gsp::compile(gsp::samples::quadruped_scene());
  auto const model = gsp::make_model<float>(exec, compiled);
  auto collision = gsp::make_collision_model<float>(exec, compiled);
  gsp::act_early(model, collision);  // contacts act from before they touch, as profile stable has it
  auto dynamics = gsp::make_dynamics(exec, model, {.worlds = worlds});
  auto poses = gsp::make_poses(exec, model, {.worlds = worlds});
  auto contacts = gsp::make_contacts(exec, collision, gsp::contacts_options(model, worlds));
  auto rows = gsp::make_rows(exec, model, gsp::rows_options(model, collision, worlds));
  auto impulses = gsp::make_impulses(exec, rows);
  auto solution = gsp::make_solution(exec, model, {.worlds = worlds});
  auto progress = gsp::make_progress(exec);
  auto sleep = gsp::make_sleep(exec, model, compiled, {.worlds = worlds});  // what rests; without it leave out its four lines below

  auto const start = [&] {
    auto state = gsp::make_state(exec, model, {.worlds = worlds});
    gsp::set_keyframe(exec, model, compiled, 0, state);
    auto const qpos = Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, state.qpos);
    for (int w = 0; w < worlds; ++w) qpos(w, 2) += 0.01f * float(w);  // dropped from different heights
    Kokkos::deep_copy(state.qpos, qpos);
    return state;
  };

  auto state = start();
  int repeated = 0;
  for (int t = 0; t < steps;) {
    gsp::forward_kinematics(exec, model, state, poses, dynamics);
    gsp::mass_matrix(exec, model, state, poses, dynamics);
    gsp::bias_forces(exec, model, state, poses, dynamics);
    gsp::passive_forces(exec, model, state, poses, dynamics);
    gsp::actuator_forces(exec, model, state, poses, dynamics);
    gsp::factor(exec, model, state, dynamics, {.stiff_rows = true});
    gsp::wake_changed(exec, model, state, dynamics, sleep);
    gsp::collide(exec, collision, poses, contacts, gsp::still_trees(model, contacts, sleep));
    auto const types = gsp::model_constraints(model, state, poses, dynamics, collision, contacts);
    gsp::assemble(exec, model, state, dynamics, types, rows, impulses, progress, sleep.islands);
    gsp::impacts(exec, progress, rows, impulses, solution);  // of geoms with a restitution
    gsp::pgs(exec, rows, impulses, solution, progress, {.iterations = 100});
    gsp::integrate(exec, model, state, dynamics, progress, solution);
    // solution.qfrc_constraint: without stiff springs and servos, where a model has some
    gsp::subtract_stiff_forces(exec, gsp::StiffForces(model, state, dynamics), rows, impulses, progress, solution.qfrc_constraint);
    gsp::fall_asleep(exec, model, rows, progress, state, dynamics, solution.qfrc_constraint, sleep);
    // this loop asks after every step
    bool const more_contacts = gsp::grow(exec, contacts), more_rows = gsp::grow(exec, rows, impulses, progress);
    if (more_contacts || more_rows)
      ++repeated;  // something did not fit, and nothing has moved
    else
      ++t;
  }

  auto other = start();
  auto sim = gsp::make_simulation(exec, model, compiled, {.worlds = worlds, .sleep = true});
  gsp::step(exec, model, other, sim, {.steps = steps});

  auto const a = Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, state.qpos),
             b = Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, other.qpos);
  double difference = 0, height = 0;
  for (int w = 0; w < worlds; ++w) {
    for (int i = 0; i < model.nq; ++i) difference = std::fmax(difference, std::fabs(double(a(w, i)) - b(w, i)));
    height += a(w, 2) / worlds;
  }
  std::printf("%d steps of %d quadrupeds, %d of them repeated with larger pools; they stand at %.3f m; difference from gsp::step: %g\n",
              steps, worlds, repeated, height, difference);
  return difference <= 1e-6 && std::fabs(height - compiled.keyframes[0].qpos[2]) < 0.03 ? 0 : 1;
}
