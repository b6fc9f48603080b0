// Kinematics, mass matrix, bias forces, factorisation and one solve of the humanoid, one thread, 1,024 worlds, float: beside MuJoCo's own
// functions for the same in the same program, interleaved.   bench_dynamics_smooth [MODEL.xml]
#include <cstdio>
#include <gsp/dynamics/smooth.hpp>
#include <gsp/io/mjcf.hpp>
#include <gsp/model/compile.hpp>
#include <string>

#include "support/bench.hpp"
#ifdef GSP_HAS_MUJOCO
#include <mujoco/mujoco.h>
#endif

namespace {

/// What the bar names and no more: no passive or actuator forces.
template <class State>
struct Core {
  State state;
  template <class L>
  KOKKOS_FUNCTION void operator()(L const& l) const {
    gsp::detail::lanes_kinematics(l, state);
    gsp::detail::lanes_load_velocity(l, state.qvel);
    gsp::detail::lanes_inertia(l);
    gsp::detail::lanes_bias(l);
    gsp::detail::lanes_mass_matrix(l);
    gsp::detail::lanes_factor(l, [](int) { return 0.f; });
    for (int i = 0; i < l.a.nv; ++i) l.items[l.at.acceleration + i] = l.items[l.at.bias + i];
    gsp::detail::lanes_solve(l, l.at.acceleration);
    for (int i = 0; i < l.a.nv; ++i) l.items[l.at.velocity + i] = l.items[l.at.acceleration + i];  // kept, as all that constraints need
  }
  KOKKOS_INLINE_FUNCTION int kept(gsp::Archetype const&, gsp::DynamicsLayout const& at) const { return at.mass; }
};

template <class Exec>
void run(std::string const& path, int worlds, double mujoco_us) {
  Exec const exec;
  auto const compiled = gsp::compile(gsp::io::read_mjcf(path, {.skip_visuals = true}));
  auto const model = gsp::make_model<float>(exec, compiled, {.profile = gsp::Profile::mujoco});
  auto state = gsp::make_state(exec, model, {.worlds = worlds});
  auto dynamics = gsp::make_dynamics(exec, model, {.worlds = worlds});
  auto poses = gsp::make_poses(exec, model, {.worlds = worlds});
  using S = std::remove_cvref_t<decltype(state)>;
  auto const qvel = state.qvel;
  Kokkos::parallel_for(
      "gsp_bench::velocities", Kokkos::RangePolicy<Exec>(exec, 0, worlds * model.nv),
      KOKKOS_LAMBDA(int i) { qvel(i / model.nv, i % model.nv) = 0.01f * float(i % 37); });
  auto const core = gsp_bench::measure(exec, [&] { gsp::for_lanes("gsp_bench::core", exec, model, dynamics, Core<S>{state}); });
  auto const all = gsp_bench::measure(exec, [&] { gsp::smooth_dynamics(exec, model, state, poses, dynamics); });
  gsp_bench::Line line("dynamics/smooth", exec);
  line.add("model", path.substr(path.rfind('/') + 1))
      .add("worlds", worlds)
      .add("precision", "float")
      .add(core)
      .add("us_per_world", 1e6 * core.median / worlds);
  line.add("all_us_per_world", 1e6 * all.median / worlds);
  if (mujoco_us > 0) line.add("mujoco_us_per_world", mujoco_us).add("ratio", mujoco_us / (1e6 * core.median / worlds));
  line.print();
}

}  // namespace

int main(int argc, char** argv) {
  Kokkos::ScopeGuard kokkos(argc, argv);
  std::string const path = argc > 1 ? argv[1] : gsp_bench::model_folder() + "mujoco/humanoid/humanoid.xml";
  auto const mujoco = [&]() -> double {  // microseconds a world; 0 where MuJoCo is missing
#ifdef GSP_HAS_MUJOCO
    char error[1000] = "";
    mjModel* m = mj_loadXML(path.c_str(), nullptr, error, sizeof error);
    if (!m) return std::fprintf(stderr, "MuJoCo: %s\n", error), 0.;
    mjData* d = mj_makeData(m);
    for (int i = 0; i < m->nv; ++i) d->qvel[i] = 0.01 * i;
    auto const time = gsp_bench::measure(Kokkos::Serial(), [&] {
      mj_kinematics(m, d), mj_comPos(m, d), mj_crb(m, d), mj_factorM(m, d), mj_comVel(m, d), mj_rne(m, d, 0, d->qfrc_bias),
          mj_solveM(m, d, d->qacc, d->qfrc_bias, 1);
    });
    mj_deleteData(d), mj_deleteModel(m);
    return 1e6 * time.median;
#else
    return 0.;
#endif
  };
  for (int i = 0; i < 5; ++i) run<Kokkos::Serial>(path, 1024, mujoco());
#ifdef KOKKOS_ENABLE_CUDA
  for (int worlds : {1024, 8192, 32768}) run<Kokkos::Cuda>(path, worlds, 0);
#endif
}
