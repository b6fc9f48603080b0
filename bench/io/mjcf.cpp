// Reading and compiling MJCF files, meshes and all, beside MuJoCo's mj_loadXML in the same program, interleaved.   bench_io_mjcf [MODEL.xml
// ...]
#include <cstdio>
#include <gsp/io/mjcf.hpp>
#include <gsp/model/compile.hpp>
#include <string>

#include "support/bench.hpp"
#ifdef GSP_HAS_MUJOCO
#include <mujoco/mujoco.h>
#endif

int main(int argc, char** argv) {
  Kokkos::ScopeGuard kokkos(argc, argv);
  std::string const data = gsp_bench::model_folder();
  std::vector<std::string> files(argv + 1, argv + argc);
  if (files.empty()) files = {data + "mjlab/unitree_g1/g1.xml", data + "unitree/go2/go2.xml", data + "mujoco/humanoid/100_humanoids.xml"};
  Kokkos::Serial const exec;
  gsp_bench::MeasureOptions const once{.samples = 5, .warm_up = 1, .repeats = 1};
  for (auto const& file : files)
    for (int i = 0; i < 5; ++i) {
      auto const time = gsp_bench::measure(
          exec, [&] { gsp::compile(gsp::io::read_mjcf(file, {.skip_visuals = true})); }, once);
      double mujoco = 0;
#ifdef GSP_HAS_MUJOCO
      char error[1000] = "";
      mjModel* const model = mj_loadXML(file.c_str(), nullptr, error, sizeof error);
      if (!model)
        std::fprintf(stderr, "MuJoCo: %s\n", error);
      else
        mujoco = gsp_bench::measure(
                     exec,
                     [&] {
                       mj_clearCache(mj_getCache());  // as a new process finds it
                       mj_deleteModel(mj_loadXML(file.c_str(), nullptr, error, sizeof error));
                     },
                     once)
                     .median;
      mj_deleteModel(model);
#endif
      gsp_bench::Line line("io/mjcf", exec);
      line.add("model", file.substr(file.rfind('/') + 1)).add(time).add("milliseconds", 1e3 * time.median);
      if (mujoco > 0) line.add("mujoco_milliseconds", 1e3 * mujoco).add("ratio", mujoco / time.median);
      line.print();
    }
}
