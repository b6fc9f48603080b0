#pragma once
#include <gsp/parallel/detail/kernels.hpp>
#include <gsp/step/step.hpp>

/// What gsp::kernels holds of a simulation's loop: step.hpp declares it, kernels/physics_*.cpp instantiate it.
// clang-format off
#define GSP_PHYSICS_KERNELS(word, Exec, Mem, R) \
  namespace gsp { \
  word Model<R, Mem> make_model<R>(Exec const&, CompiledModel const&, ModelOptions); \
  word State<R, Mem> make_state(Exec const&, Model<R, Mem> const&, StateOptions); \
  word void reset(Exec const&, Model<R, Mem> const&, State<R, Mem>&); \
  word Dynamics<R, Mem> make_dynamics(Exec const&, Model<R, Mem> const&, DynamicsOptions); \
  word Poses<R, Mem> make_poses(Exec const&, Model<R, Mem> const&, PosesOptions); \
  word CollisionModel<R, Mem> make_collision_model<R>(Exec const&, CompiledModel const&); \
  word Contacts<R, Mem> make_contacts(Exec const&, CollisionModel<R, Mem> const&, ContactsOptions); \
  word Rows<R, Mem> make_rows(Exec const&, Model<R, Mem> const&, RowsOptions); \
  word Impulses<R, Mem> make_impulses(Exec const&, Rows<R, Mem> const&); \
  word Solution<R, Mem> make_solution(Exec const&, Model<R, Mem> const&, SolutionOptions); \
  word Simulation<R, Mem> make_simulation(Exec const&, Model<R, Mem> const&, CompiledModel const&, SimulationOptions); \
  word void forward_kinematics(Exec const&, Model<R, Mem> const&, State<R, Mem> const&, Poses<R, Mem>&, Dynamics<R, Mem>&); \
  word void smooth_dynamics(Exec const&, Model<R, Mem> const&, State<R, Mem> const&, Poses<R, Mem>&, Dynamics<R, Mem>&, SmoothOptions); \
  word void smooth_step(Exec const&, Model<R, Mem> const&, State<R, Mem>&, Poses<R, Mem>&, Dynamics<R, Mem>&); \
  word void runge_kutta(Exec const&, Model<R, Mem> const&, State<R, Mem>&, Poses<R, Mem>&, Dynamics<R, Mem>&, RungeKutta<R, Mem>&); \
  word void collide(Exec const&, CollisionModel<R, Mem> const&, Poses<R, Mem> const&, Contacts<R, Mem>&, \
                    StillTrees<R, Mem> const&); \
  word bool grow(Exec const&, Contacts<R, Mem>&); \
  word void assemble(Exec const&, Model<R, Mem> const&, State<R, Mem>&, Dynamics<R, Mem> const&, \
                     ModelConstraints<R, Mem> const&, \
                     Rows<R, Mem>&, Impulses<R, Mem>&, Progress<Mem>&, SleepingIslands<Mem> const&); \
  word bool grow(Exec const&, Rows<R, Mem>&, Impulses<R, Mem>&, Progress<Mem>&); \
  word void impacts(Exec const&, Progress<Mem> const&, Rows<R, Mem>&, Impulses<R, Mem>&, Solution<R, Mem>&, ImpactOptions); \
  word void pgs(Exec const&, Rows<R, Mem> const&, Impulses<R, Mem>&, Solution<R, Mem>&, Progress<Mem>&, PgsOptions); \
  word Newton<R, Mem> make_newton(Exec const&, Rows<R, Mem> const&); \
  word bool grow(Exec const&, Rows<R, Mem> const&, Newton<R, Mem>&); \
  word void newton(Exec const&, Rows<R, Mem> const&, Impulses<R, Mem>&, Solution<R, Mem>&, Newton<R, Mem>&, Progress<Mem>&, NewtonOptions); \
  word void noslip(Exec const&, Rows<R, Mem> const&, Impulses<R, Mem>&, Solution<R, Mem>&, Progress<Mem> const&, NoslipOptions); \
  word void integrate(Exec const&, Model<R, Mem> const&, State<R, Mem>&, Dynamics<R, Mem>&, ConstraintOutcome<R, Mem>); \
  word Sleep<R, Mem> make_sleep(Exec const&, Model<R, Mem> const&, CompiledModel const&, SleepOptions); \
  word void wake_changed(Exec const&, Model<R, Mem> const&, State<R, Mem> const&, Dynamics<R, Mem> const&, Sleep<R, Mem>&); \
  word void fall_asleep(Exec const&, Model<R, Mem> const&, Rows<R, Mem> const&, Progress<Mem> const&, State<R, Mem>&, \
                        Dynamics<R, Mem>&, Kokkos::View<R**, Kokkos::LayoutRight, Mem>&, Sleep<R, Mem>&); \
  word void launch_step(Exec const&, Model<R, Mem> const&, State<R, Mem>&, Simulation<R, Mem>&, LaunchOptions const&); \
  word int settle(Exec const&, Simulation<R, Mem>&); \
  word void step(Exec const&, Model<R, Mem> const&, State<R, Mem>&, Simulation<R, Mem>&, StepOptions); \
  word void forward(Exec const&, Model<R, Mem> const&, State<R, Mem>&, Simulation<R, Mem>&, LaunchOptions const&); \
  word void advance(Exec const&, Model<R, Mem> const&, State<R, Mem>&, Simulation<R, Mem>&); \
  }
// clang-format on

GSP_EXTERN_KERNELS(GSP_PHYSICS_KERNELS, float)
GSP_EXTERN_KERNELS(GSP_PHYSICS_KERNELS, double)
