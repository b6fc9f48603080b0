// simulation FILE: steps a robot of the library's own in three worlds, draws it, and writes all that came out, bit by bit, to FILE. The
// same source is compiled with gsp::kernels and with gsp::gsp alone; both must write the same.
#include <Kokkos_Core.hpp>
#include <cstdio>
#include <gsp/model/compile.hpp>
#include <gsp/model/samples.hpp>
#include <gsp/splat/look_at.hpp>
#include <gsp/splat/render.hpp>
#include <gsp/splat/sample_surface.hpp>
#include <gsp/step/step.hpp>
#include <vector>

#if defined(WITH_KERNELS)
static_assert(GSP_KERNELS == GSP_PACK_BYTES,
              "this file is compiled for another width of packs than gsp::kernels: it would use nothing of it");
#elif defined(GSP_KERNELS)
#error "gsp::gsp alone stays header-only"
#endif

template <class View>
bool write(std::FILE* file, View const& view) {
  auto const host = Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, view);
  return std::fwrite(host.data(), sizeof(typename View::value_type), host.size(), file) == host.size();
}

int main(int argc, char** argv) {
  Kokkos::ScopeGuard const kokkos(argc, argv);
  if (argc != 2) return 2;
  Kokkos::DefaultExecutionSpace const exec;
  int const worlds = 3, width = 64, height = 48;

  auto const compiled = gsp::compile(gsp::samples::quadruped_scene());
  auto const model = gsp::make_model<float>(exec, compiled);
  auto state = gsp::make_state(exec, model, {.worlds = worlds});
  auto sim = gsp::make_simulation(exec, model, compiled, {.worlds = worlds});
  auto const& stand = compiled.keyframes.at(0);
  auto const qpos = Kokkos::create_mirror_view(Kokkos::HostSpace{}, state.qpos);
  auto const ctrl = Kokkos::create_mirror_view(Kokkos::HostSpace{}, state.ctrl);
  for (int w = 0; w < worlds; ++w) {
    for (int i = 0; i < model.nq; ++i) qpos(w, i) = float(stand.qpos[i]);
    for (int i = 0; i < model.nu; ++i) ctrl(w, i) = float(stand.ctrl[i]) * (1 + 0.2f * float(w));
  }
  Kokkos::deep_copy(state.qpos, qpos);
  Kokkos::deep_copy(state.ctrl, ctrl);
  gsp::step(exec, model, state, sim, {.steps = 100});

  auto const cloud = gsp::make_gaussians(exec, {gsp::sample_surface(compiled)});
  std::vector<float> viewmats, Ks;
  for (int w = 0; w < worlds; ++w) {
    auto const view = gsp::look_at<double>({1.3, -1.1, 0.7}, {0.05, 0, 0.2}).matrix();
    auto const K = gsp::pinhole(width, height, {.focal = 56});
    viewmats.insert(viewmats.end(), view.begin(), view.end());
    Ks.insert(Ks.end(), K.begin(), K.end());
  }
  auto frames = gsp::make_frames(exec, cloud, {.images = worlds, .width = width, .height = height});
  gsp::render(exec, cloud, sim.poses, gsp::make_cameras(exec, viewmats, Ks), frames);

  auto const alpha = Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, frames.alpha);
  int seen = 0;
  for (std::size_t i = 0; i < alpha.size(); ++i) seen += alpha.data()[i] > 0.5f;
  std::FILE* const file = std::fopen(argv[1], "wb");
  bool written = file != nullptr;
  written = written && write(file, state.qpos) && write(file, state.qvel) && write(file, sim.solution.qfrc_constraint);
  written = written && write(file, frames.rgb) && write(file, frames.depth) && write(file, frames.alpha);
  written = file != nullptr && std::fclose(file) == 0 && written;
  std::printf("simulation: %d pixels of %d show something\n", seen, int(alpha.size()));
  return written && seen > 100 ? 0 : 1;  // a robot, not an empty picture
}
