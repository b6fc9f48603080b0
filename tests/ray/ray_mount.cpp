// Units on bodies: where their rays begin and go, by hand, for each alignment; a scan of a wall and of steps from a body that is turned.
#include <doctest/doctest.h>

#include <cmath>
#include <gsp/dynamics/kinematics.hpp>
#include <gsp/model/attach.hpp>
#include <gsp/model/compile.hpp>
#include <gsp/ray/ray_mount.hpp>
#include <gsp_test_execs.hpp>

#include "support/kernels.hpp"
#include "support/kokkos_tools.hpp"

namespace {
/// A body that moves freely among: a floor, a wall at x = 3, and a step of 0.25 m from x = 0.5 on.
gsp::Description hall() {
  gsp::Description d;
  d.bodies[0].geoms.push_back({.name = "floor", .type = gsp::ShapeType::plane, .size = {0, 0, 1}});
  d.bodies[0].geoms.push_back({.name = "wall", .type = gsp::ShapeType::box, .size = {0.5, 50, 50}, .pos = {3.5, 0, 0}});
  d.bodies[0].geoms.push_back({.name = "step", .type = gsp::ShapeType::box, .size = {1, 50, 0.25}, .pos = {1.5, 0, 0}});
  int const b = gsp::add_body(d, 0, "robot", {0, 0, 1});
  d.bodies[b].sites.push_back({.name = "unit", .pos = {0.2, 0, 0.1}, .quat = {0.5, 0.5, 0.5, 0.5}});  // its x is the body's y, its y the z
  d.bodies[b].joints.push_back({.type = gsp::JointType::free});
  d.bodies[b].geoms.push_back({.name = "body", .size = {0.1, 0, 0}});
  return d;
}
}  // namespace

TEST_CASE_TEMPLATE("rays follow their body", Exec, GSP_TEST_EXECS) {
  using R = double;
  Exec const exec;
  int const worlds = 4;
  auto const compiled = gsp::compile(hall());
  auto const model = gsp::make_model<R>(exec, compiled);
  auto state = gsp::make_state(exec, model, {.worlds = worlds});
  auto poses = gsp::make_poses(exec, model, {.worlds = worlds});
  auto dynamics = gsp::make_dynamics(exec, model, {.worlds = worlds});
  auto const qpos = Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, state.qpos);
  // turned by 40 degrees (world 3: 160) about z, then, from world 1 on, nose down by 30 degrees
  auto const yaw_of = [](int w) { return (w == 3 ? 160 : 40) * M_PI / 180; };
  for (int w = 0; w < worlds; ++w) {
    double const a = 0.5 * yaw_of(w), b = w == 0 ? 0 : M_PI / 12;
    gsp::Quat<R> const q = gsp::Quat<R>{std::cos(a), 0, 0, std::sin(a)} * gsp::Quat<R>{std::cos(b), 0, std::sin(b), 0};
    R const row[] = {0.1 * w, 0.2, 1.5, q.w, q.x, q.y, q.z};
    for (int i = 0; i < 7; ++i) qpos(w, i) = row[i];
  }
  Kokkos::deep_copy(state.qpos, qpos);
  gsp::forward_kinematics(exec, model, state, poses, dynamics);

  gsp::RayPattern const ahead{{{1, 0, 0}, {0, 0, -1}}, {}};
  auto rays = gsp::make_rays<R>(exec, {.worlds = worlds, .count = 2 + 2 + 187});
  auto const body = gsp::make_ray_mount<R>(exec, compiled, ahead, {.body = "robot", .pos = {0.3, 0, 0.1}});
  auto const level =
      gsp::make_ray_mount<R>(exec, compiled, ahead, {.body_id = 1, .pos = {0.3, 0, 0.1}, .alignment = gsp::RayAlignment::yaw});
  auto const scan = gsp::make_ray_mount<R>(exec, compiled, gsp::height_scan_pattern(1.6, 1, 0.1),
                                           {.body = "robot", .pos = {0, 0, 10}, .alignment = gsp::RayAlignment::world});
  gsp_test::check_algorithm(exec, gsp_test::watch([&] {
                              gsp::mount_rays(exec, poses, body, rays);
                              gsp::mount_rays(exec, poses, level, rays, 2);
                              gsp::mount_rays(exec, poses, scan, rays, 4);
                            }));
  auto const o = Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, rays.origin);
  auto const d = Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, rays.direction);
  auto const check = [](auto const& v, int w, int k, double x, double y, double z) {
    double const expected[] = {x, y, z};
    for (int c = 0; c < 3; ++c) CHECK(std::fabs(v(w, k, c) - expected[c]) < 1e-14);
  };
  for (int w = 0; w < worlds; ++w) {
    CAPTURE(w);
    double const yaw = yaw_of(w), down = w == 0 ? 0 : M_PI / 6, c = std::cos(yaw), s = std::sin(yaw), x0 = 0.1 * w, y0 = 0.2, z0 = 1.5;
    double const out = 0.3 * std::cos(down) + 0.1 * std::sin(down), up = 0.1 * std::cos(down) - 0.3 * std::sin(down);
    check(o, w, 0, x0 + out * c, y0 + out * s, z0 + up);
    check(d, w, 0, std::cos(down) * c, std::cos(down) * s, -std::sin(down));
    check(d, w, 1, -std::sin(down) * c, -std::sin(down) * s, -std::cos(down));
    check(o, w, 2, x0 + 0.3 * c, y0 + 0.3 * s, z0 + 0.1);  // level, whatever the nose does
    check(d, w, 2, c, s, 0);
    check(d, w, 3, 0, 0, -1);
    check(o, w, 4, x0 - 0.8, y0 - 0.5, z0 + 10);
    check(d, w, 4 + 186, 0, 0, -1);
  }
  // on a site: in its frame, which has the body's x, y, z as its z, x, y
  auto const on_site = gsp::make_ray_mount<R>(exec, compiled, ahead, {.site = "unit", .pos = {0.01, 0.02, 0.3}});
  CHECK(on_site.body == 1);
  auto const& q = on_site.quat;
  double const is[] = {on_site.pos.x, on_site.pos.y, on_site.pos.z, q.w, q.x, q.y, q.z}, should[] = {0.5, 0.01, 0.12, 0.5, 0.5, 0.5, 0.5};
  for (int k = 0; k < 7; ++k) CHECK(std::fabs(is[k] - should[k]) < 1e-15);
  auto scene = gsp::make_ray_scene<R>(exec, model, compiled, {.worlds = worlds});
  auto hits = gsp::make_ray_hits<R>(exec, {.worlds = worlds, .count = 2 + 2 + 187});
  gsp::place_ray_geoms(exec, model, poses, scene);
  gsp::cast_rays(exec, scene, rays, hits, {.body_exclude = 1});
  auto const distance = Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, hits.distance);
  auto const geom = Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, hits.geom);
  // the level ray of world 0 meets the wall at x = 3; that of world 3 looks away from it and meets nothing
  CHECK(distance(0, 2) == doctest::Approx((3 - 0.3 * std::cos(yaw_of(0))) / std::cos(yaw_of(0))));
  CHECK(geom(0, 2) == 1);
  CHECK(geom(3, 2) == -1);
  for (int w = 0; w < worlds; ++w)
    for (int k = 0; k < 187; ++k) {
      double const x = 0.1 * w + 0.1 * (k % 17) - 0.8;
      if (std::fabs(x - 0.5) < 1e-6) continue;  // the edge of the step
      CHECK(distance(w, 4 + k) == doctest::Approx(11.5 - (x > 0.5 ? 0.25 : 0)));
    }

  CHECK_THROWS_WITH_AS(gsp::mount_rays(exec, poses, scan, rays, 5), doctest::Contains("rays 5 to 191 are asked for, and there are 191"),
                       std::invalid_argument);
  auto few = gsp::make_rays<R>(exec, {.worlds = 2, .count = 2});
  CHECK_THROWS_WITH_AS(gsp::mount_rays(exec, poses, body, few),
                       doctest::Contains("of 2 worlds and a unit on body 1, the poses of 4 worlds"), std::invalid_argument);
  auto const bad = [&](gsp::RayPattern const& pattern, gsp::RayMountOptions const& options, char const* part) {
    try {
      gsp::make_ray_mount<R>(exec, compiled, pattern, options);
      CHECK_MESSAGE(false, "accepted, expected: ", part);
    } catch (std::exception const& e) { CHECK_MESSAGE(std::string(e.what()).find(part) != std::string::npos, e.what()); }
  };
  bad(ahead, {.body = "robots"}, "nearest: 'robot'");
  bad(ahead, {}, "name one body");
  bad(ahead, {.body = "robot", .body_id = 1}, "name one body");
  bad(ahead, {.body = "robot", .site = "unit"}, "or one site");
  bad(ahead, {.site = "units"}, "nearest: 'unit'");
  bad(ahead, {.body_id = 2}, "has 2 bodies, not one of index 2");
  bad(ahead, {.body = "robot", .quat = {0, 0, 0, 0}}, "the rotation not 0");
  bad(ahead, {.body = "robot", .pos = {NAN, 0, 0}}, "must be finite");
  bad({}, {.body = "robot"}, "a direction for each ray");
  bad({{{1, 0, 0}}, {{0, 0, 0}, {1, 0, 0}}}, {.body = "robot"}, "an origin for each or none");
  bad({{{1, 0, 0}, {0, 0, 0}}, {}}, {.body = "robot"}, "the direction of ray 1 is not finite, or has no length");
  bad({{{1, 0, NAN}}, {}}, {.body = "robot"}, "the direction of ray 0");
  bad({{{1, 0, 0}, {1, 0, 0}}, {{0, 0, 0}, {0, INFINITY, 0}}}, {.body = "robot"}, "the origin of ray 1 is not finite");
  // metres, whatever the length of what was given
  auto const longer = gsp::make_ray_mount<R>(exec, compiled, {{{0, 3, -4}, {1e-200, 0, 0}}, {}}, {.body = "robot"});
  auto const unit = Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, longer.direction);
  CHECK(gsp::norm(unit(0) - gsp::Vec3<R>{0, 0.6, -0.8}) < 1e-15);
  CHECK(gsp::norm(unit(1) - gsp::Vec3<R>{1, 0, 0}) == 0);
}
