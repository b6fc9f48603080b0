// Worlds in tiles that share what a step finds (TilesOptions::share): steps/s and bytes a world, everything counted, of humanoids that fall
// and lie (from step 100 on) on the default execution space, float.
//   bench_step_tiles [worlds, 8192 on a GPU, 1024 on a CPU]
#include <gsp/io/mjcf.hpp>
#include <gsp/model/compile.hpp>
#include <gsp/step/tiles.hpp>

#include "support/bench.hpp"
#include "support/peak_bytes.hpp"

namespace {

void run(gsp::CompiledModel const& compiled, int worlds, int each, bool share) {
  using Exec = Kokkos::DefaultExecutionSpace;
  using Mem = Exec::memory_space;
  Exec const exec;
  gsp_bench::PeakBytes<Mem> peak;
  auto const model = gsp::make_model<float>(exec, compiled);
  auto const collision = gsp::make_collision_model<float>(exec, compiled);
  auto state = gsp::make_state(exec, model, {.worlds = worlds});
  gsp::TilesOptions options;
  options.worlds = each;
  options.share = share;
  auto tiles = gsp::make_tiles(exec, model, compiled, collision, state, options);
  gsp::step(exec, tiles, {.steps = 100});
  int const steps = 20;
  auto const time =
      gsp_bench::measure(exec, [&] { gsp::step(exec, tiles, {.steps = steps, .poses = false}); }, {.samples = 5, .repeats = 1});
  gsp_bench::Line("step/tiles", exec)
      .add("worlds", worlds)
      .add("tile", each)
      .add("share", share ? 1 : 0)
      .add("precision", "float")
      .add(time)
      .add("steps_per_second", steps * worlds / time.median)
      .add("bytes_per_world", double(peak.stop()) / worlds)
      .add_hash(state.qpos)
      .print();
}

}  // namespace

int main(int argc, char** argv) {
  Kokkos::ScopeGuard const kokkos(argc, argv);
  auto const compiled = gsp::compile(gsp::io::read_mjcf(gsp_bench::data_file("models/mujoco/humanoid/humanoid.xml")));
  int const worlds = argc > 1 ? std::atoi(argv[1]) : gsp::is_device<Kokkos::DefaultExecutionSpace> ? 8192 : 1024;
  run(compiled, worlds, worlds, false);
  for (int parts : {2, 4, 8}) run(compiled, worlds, worlds / parts, true);
}
