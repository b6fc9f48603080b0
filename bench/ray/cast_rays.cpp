// Rays of a rotating unit of 64 rings by 1,719 columns, float, beside MuJoCo's mj_multiRay with the same rays in the same program, one
// thread, in turn: three shapes on a floor; 43 shapes; a ring of triangles; a humanoid. On a GPU 256 worlds, without MuJoCo.
//   bench_ray_cast_rays
#include <cmath>
#include <cstdio>
#include <gsp/dynamics/kinematics.hpp>
#include <gsp/io/mjcf.hpp>
#include <gsp/model/compile.hpp>
#include <gsp/ray/cast_rays.hpp>
#include <string>

#include "support/bench.hpp"
#ifdef GSP_HAS_MUJOCO
#include <mujoco/mujoco.h>
#endif

namespace {

constexpr int rings = 64, columns = 1719;

/// So many boxes, balls, capsules and cylinders on a floor.
std::string shapes(int count) {
  std::string text = "<mujoco><worldbody><geom type='plane' size='0 0 1'/>";
  char const* const type[] = {"box", "sphere", "capsule", "cylinder"};
  for (int k = 0; k < count; ++k) {
    double const angle = 2.4 * k, away = 2 + 0.25 * k;
    text += std::string("<geom type='") + type[k % 4] + "' size='.3 .4 .5' pos='" + std::to_string(away * std::cos(angle)) + " " +
            std::to_string(away * std::sin(angle)) + " .5' euler='" + std::to_string(20 * k) + " 10 0'/>";
  }
  return text + "</worldbody></mujoco>";
}

/// A ring of 6,400 triangles around the unit.
std::string ring() {
  std::string vertices, faces;
  int const around = 80, across = 40;
  for (int i = 0; i < around; ++i)
    for (int j = 0; j < across; ++j) {
      double const a = 2 * M_PI * i / around, b = 2 * M_PI * j / across, r = 3 + 0.6 * std::cos(b);
      vertices +=
          std::to_string(r * std::cos(a)) + " " + std::to_string(r * std::sin(a)) + " " + std::to_string(1 + 0.6 * std::sin(b)) + " ";
      int const n = i * across + j, up = i * across + (j + 1) % across, next = (i + 1) % around * across + j,
                both = (i + 1) % around * across + (j + 1) % across;
      for (int const v : {n, next, up, next, both, up}) faces += std::to_string(v) + " ";
    }
  return "<mujoco><asset><mesh name='ring' vertex='" + vertices + "' face='" + faces +
         "'/></asset><worldbody><geom type='plane' size='0 0 1'/><geom type='mesh' mesh='ring'/></worldbody></mujoco>";
}

template <class Exec>
void run(std::string const& name, std::string const& text, std::string const& path, int worlds) {
  Exec const exec;
  auto const compiled = gsp::compile(path.empty() ? gsp::io::parse_mjcf(text, name) : gsp::io::read_mjcf(path));
  auto const model = gsp::make_model<float>(exec, compiled);
  auto state = gsp::make_state(exec, model, {.worlds = worlds});
  auto dynamics = gsp::make_dynamics(exec, model, {.worlds = worlds});
  auto poses = gsp::make_poses(exec, model, {.worlds = worlds});
  gsp::forward_kinematics(exec, model, state, poses, dynamics);
  auto scene = gsp::make_ray_scene<float>(exec, model, compiled, {.worlds = worlds});
  gsp::place_ray_geoms(exec, model, poses, scene);
  gsp::RaysOptions const many{.worlds = worlds, .count = rings * columns, .normals = false};
  auto const rays = gsp::make_rays<float>(exec, many);
  auto hits = gsp::make_ray_hits<float>(exec, many);
  auto const origin = rays.origin, direction = rays.direction;
  float const eye[3] = {path.empty() ? 0.f : 0.9f, 0.1f, path.empty() ? 1.f : 0.5f};
  Kokkos::parallel_for(
      "gsp_bench::pattern", Kokkos::RangePolicy<Exec, Kokkos::IndexType<std::int64_t>>(exec, 0, std::int64_t(worlds) * rings * columns),
      KOKKOS_LAMBDA(std::int64_t i) {
        int const k = int(i % (rings * columns)), w = int(i / (rings * columns));
        float const up = (-24.8f + 26.8f * float(k % rings) / (rings - 1)) * 0.01745329f, turn = 6.2831853f * float(k / rings) / columns;
        for (int c = 0; c < 3; ++c) origin(w, k, c) = eye[c];
        direction(w, k, 0) = Kokkos::cos(up) * Kokkos::cos(turn);
        direction(w, k, 1) = Kokkos::cos(up) * Kokkos::sin(turn);
        direction(w, k, 2) = Kokkos::sin(up);
      });
  auto const own = [&] { gsp::cast_rays(exec, scene, rays, hits); };
  double peer_rate = 0;
  long found = 0, triangles = long(scene.triangles.extent(0));
  auto const time = gsp_bench::measure(exec, own);
  auto const geom = Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, Kokkos::subview(hits.geom, 0, Kokkos::ALL));
  for (int k = 0; k < rings * columns; ++k) found += geom(k) >= 0;
#ifdef GSP_HAS_MUJOCO
  if constexpr (!gsp::is_device<Exec>) {
    char error[1000] = "";
    mjSpec* const spec = path.empty() ? mj_parseXMLString(text.c_str(), nullptr, error, sizeof error)
                                      : mj_parseXML(path.c_str(), nullptr, error, sizeof error);
    mjModel* const m = spec ? mj_compile(spec, nullptr) : nullptr;
    if (m) {
      mjData* const d = mj_makeData(m);
      mj_kinematics(m, d);
      mj_comPos(m, d);
      std::vector<double> v(std::size_t(3 * rings * columns)), x(std::size_t(rings * columns));
      std::vector<int> id(std::size_t(rings * columns));
      for (int k = 0; k < rings * columns; ++k)
        for (int c = 0; c < 3; ++c) v[std::size_t(3 * k + c)] = double(direction(0, k, c));
      double const p[3] = {double(eye[0]), double(eye[1]), double(eye[2])};
      auto const peer = gsp_bench::measure(Kokkos::Serial(), [&] {
        mj_multiRay(m, d, p, v.data(), nullptr, 1, -1, id.data(), x.data(), nullptr, rings * columns, mjMAXVAL);
      });
      peer_rate = rings * columns / peer.median;
      mj_deleteData(d);
      mj_deleteModel(m);
    }
    mj_deleteSpec(spec);
  }
#endif
  double const rate = double(worlds) * rings * columns / time.median;
  gsp_bench::Line line("ray/cast_rays", exec);
  line.add("scene", name).add("worlds", worlds).add("geoms", scene.count()).add("triangles", triangles).add("precision", "float").add(time);
  line.add("mrays_per_second", 1e-6 * rate).add("hits", double(found) / (rings * columns));
  if (peer_rate > 0) line.add("mujoco_mrays_per_second", 1e-6 * peer_rate).add("ratio", rate / peer_rate);
  line.print();
}

template <class Exec>
void run_all(int worlds) {
  run<Exec>("3 shapes", shapes(3), "", worlds);
  run<Exec>("43 shapes", shapes(43), "", worlds);
  run<Exec>("ring of 6,400 triangles", ring(), "", worlds);
  std::string const humanoid = gsp_bench::model_folder() + "mujoco/humanoid/humanoid.xml";
  if (std::FILE* const file = std::fopen(humanoid.c_str(), "r")) {
    std::fclose(file);
    run<Exec>("humanoid", "", humanoid, worlds);
  }
}

}  // namespace

int main(int argc, char** argv) {
  Kokkos::ScopeGuard const kokkos(argc, argv);
#ifdef KOKKOS_ENABLE_CUDA
  run_all<Kokkos::Cuda>(256);
#endif
  run_all<Kokkos::DefaultHostExecutionSpace>(1);
}
