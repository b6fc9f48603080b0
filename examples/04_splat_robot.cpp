// A robot that carries Gaussians, in a room of Gaussians: stepped, rendered, written as a picture. With files: gsp::io::read_mjcf and
// read_splats instead.
#include <cmath>
#include <cstdio>
#include <gsp/io/bitmap.hpp>
#include <gsp/io/png.hpp>
#include <gsp/model/compile.hpp>
#include <gsp/model/keyframe.hpp>
#include <gsp/model/samples.hpp>
#include <gsp/splat/render.hpp>
#include <gsp/splat/sample_room.hpp>
#include <gsp/splat/sample_surface.hpp>
#include <gsp/step/step.hpp>

int main(int argc, char** argv) {
  Kokkos::ScopeGuard const kokkos(argc, argv);
  Kokkos::DefaultExecutionSpace const exec;
  int const worlds = 2, width = 480, height = 320;

  auto const compiled = gsp::compile(gsp::samples::quadruped_scene());
  auto const model = gsp::make_model<float>(exec, compiled);
  auto state = gsp::make_state(exec, model, {.worlds = worlds});
  auto sim = gsp::make_simulation(exec, model, compiled, {.worlds = worlds});

  // a stance for world 0, a deeper one for world 1
  gsp::set_keyframe(exec, model, compiled, 0, state);
  auto const ctrl = Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, state.ctrl);
  for (int i = 0; i < model.nu; ++i) ctrl(1, i) *= i % 3 != 0 ? 1.4f : 1.f;
  Kokkos::deep_copy(state.ctrl, ctrl);
  gsp::step(exec, model, state, sim, {.steps = 250});

  auto const room = gsp::sample_room<gsp::GaussianSet>();
  auto const robot = gsp::sample_surface(compiled, {.world = false});  // the room has a floor of its own
  auto const cloud = gsp::make_gaussians(exec, {room, robot});
  std::vector<float> viewmats, Ks;
  for (int w = 0; w < worlds; ++w) {
    auto const view = gsp::look_at<double>({1.3, -1.1, 0.7}, {0.05, 0, 0.2}).matrix();
    auto const K = gsp::pinhole(width, height, {.focal = 420});
    viewmats.insert(viewmats.end(), view.begin(), view.end());
    Ks.insert(Ks.end(), K.begin(), K.end());
  }
  auto frames = gsp::make_frames(exec, cloud, {.images = worlds, .width = width, .height = height});
  gsp::render(exec, cloud, sim.poses, gsp::make_cameras(exec, viewmats, Ks), frames);  // image w shows world w

  auto const rgb = Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, frames.rgb);
  auto const depth = Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, frames.depth);
  gsp::io::write_png("04_splat_robot.png", gsp::io::to_bitmap8(rgb.data(), width, worlds * height, 3));  // one below the other

  // the trunk of the robot, from world and camera to the picture: its depth there must be that of its surface, not of the wall behind it
  auto const xpos = Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, sim.poses.xpos);
  bool right = true;
  for (int w = 0; w < worlds; ++w) {
    float p[3];
    for (int r = 0; r < 3; ++r)
      p[r] = viewmats[16 * w + 4 * r + 3] + viewmats[16 * w + 4 * r] * xpos(w, 1, 0) + viewmats[16 * w + 4 * r + 1] * xpos(w, 1, 1) +
             viewmats[16 * w + 4 * r + 2] * xpos(w, 1, 2);
    int const column = int(width / 2 + 420 * p[0] / p[2]), row = int(height / 2 + 420 * p[1] / p[2]);
    float const seen = depth(w, row, column);
    std::printf("world %d: trunk %.3f m above the floor, %.2f m from the camera; the picture's depth there is %.2f m\n", w, xpos(w, 1, 2),
                p[2], seen);
    right = right && seen < p[2] && seen > p[2] - 0.25f;  // the trunk is 0.38 m long
  }
  std::printf("04_splat_robot.png: %zu Gaussians of the room, %zu of the robot and what lies around it\n", room.size(), robot.size());
  return right && xpos(1, 1, 2) < xpos(0, 1, 2) - 0.02f ? 0 : 1;
}
