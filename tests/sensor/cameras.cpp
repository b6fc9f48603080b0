// Cameras from poses against closed forms. (Cameras of MJCF in all modes against MuJoCo: tests/oracle/cameras.cpp.)
#include <doctest/doctest.h>

#include <cmath>
#include <gsp/dynamics/kinematics.hpp>
#include <gsp/model/attach.hpp>
#include <gsp/model/compile.hpp>
#include <gsp/model/samples.hpp>
#include <gsp/sensor/camera_sensor.hpp>
#include <gsp/splat/render.hpp>
#include <gsp_test_execs.hpp>
#include <numbers>

#include "support/kernels.hpp"
#include "support/kokkos_tools.hpp"

namespace {
using V = gsp::Vec3<double>;

/// Where a camera sees a point: pixel and depth, as conventions.md says it.
V seen(float const* viewmat, float const* K, V const& x) {
  double y[3];
  for (int r = 0; r < 3; ++r) y[r] = viewmat[4 * r] * x.x + viewmat[4 * r + 1] * x.y + viewmat[4 * r + 2] * x.z + viewmat[4 * r + 3];
  return {K[0] * y[0] / y[2] + K[2], K[4] * y[1] / y[2] + K[5], y[2]};
}

/// A mast that turns about z, with a camera of MJCF on it that looks along its x.
gsp::Description mast() {
  gsp::Description d;
  int const b = gsp::add_body(d, 0, "mast", {0, 0, 1});
  d.bodies[b].joints.push_back({.name = "turn", .axis = {0, 0, 1}});
  d.bodies[b].geoms.push_back({.size = {0.1, 0, 0}});
  gsp::CameraDescription c;
  c.name = "eye";
  c.pos = {0.5, 0, 0};
  c.quat = {0.5, 0.5, -0.5, -0.5};  // its x is -y of the mast, its y the mast's z: it looks along x
  c.fovy = 1;
  d.bodies[b].cameras = {c};
  return d;
}
}  // namespace

TEST_CASE("look_at and pinhole") {
  auto const view = gsp::look_at<double>({1, 2, 3}, {1, 5, 3}).matrix();
  float const want[] = {1, 0, 0, -1, 0, 0, -1, 3, 0, 1, 0, -2, 0, 0, 0, 1};  // x right, -z down, y forward
  for (int i = 0; i < 16; ++i) CHECK(view[i] == want[i]);
  for (V target : {V{1, 2, 8}, V{1, 2, -8}}) {  // straight up and down: still a rotation
    auto const m = gsp::look_at<double>({1, 2, 3}, target);
    V const forward{m.r(2, 0), m.r(2, 1), m.r(2, 2)}, right{m.r(0, 0), m.r(0, 1), m.r(0, 2)};
    CHECK(forward.z == (target.z > 3 ? 1 : -1));
    CHECK(gsp::norm(right) == doctest::Approx(1));
    CHECK(gsp::dot(right, forward) == 0);
  }
  auto const K = gsp::pinhole(640, 480, {.fovy = 2 * std::atan(0.5)});
  CHECK(K[0] == doctest::Approx(480));
  CHECK(K[4] == K[0]);
  CHECK(K[2] == 320);
  CHECK(K[5] == 240);
  CHECK(gsp::pinhole(640, 480, {.fovx = 2 * std::atan(0.5)})[4] == doctest::Approx(640));
  CHECK(gsp::pinhole(640, 480, {.focal = 500})[0] == 500);
  CHECK_THROWS_AS(gsp::pinhole(640, 480, {}), std::invalid_argument);
  CHECK_THROWS_AS(gsp::pinhole(640, 480, {.fovx = 1, .fovy = 1}), std::invalid_argument);
}

// float matrices of unit size and metres: pixels of f 200 within 200 x 4 roundings of 6e-8.
TEST_CASE_TEMPLATE("cameras of a model and on its links, in all worlds", Exec, GSP_TEST_EXECS) {
  Exec const exec;
  int const worlds = 5, width = 200, height = 100;
  auto const compiled = gsp::compile(mast());
  auto const model = gsp::make_model<double>(exec, compiled);
  auto state = gsp::make_state(exec, model, {.worlds = worlds});
  auto dynamics = gsp::make_dynamics(exec, model, {.worlds = worlds});
  auto poses = gsp::make_poses(exec, model, {.worlds = worlds});
  auto const qpos = Kokkos::create_mirror_view(state.qpos);
  for (int w = 0; w < worlds; ++w) qpos(w, 0) = 0.7 * w;
  Kokkos::deep_copy(state.qpos, qpos);
  gsp::forward_kinematics(exec, model, state, poses, dynamics);

  auto mounts = gsp::make_camera_mounts(exec, model, compiled,
                                        {{.camera = "eye"},
                                         {.body = "mast", .pos = {0, 0.25, 0}, .look_at = gsp::Double3{0, 2, 0}, .fovy = 1.2},
                                         {.body_id = 0, .pos = {0, 0, 5}, .quat = {2, 0, 0, 0}, .fovy = 0.8}},
                                        {.worlds = worlds, .width = width, .height = height});
  CHECK(mounts.images() == 15);
  auto cameras = gsp::make_cameras(exec, mounts.images());
  gsp_test::check_algorithm(exec, gsp_test::watch([&] { gsp::cameras_of(exec, model, poses, mounts, cameras); }));
  auto const host = [](auto const& v) { return Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, v); };
  auto const views = host(cameras.viewmats), Ks = host(cameras.Ks);
  auto const world = host(cameras.world);
  auto const check = [](V const& a, V const& b) {
    CHECK(a.x == doctest::Approx(b.x).epsilon(1e-6));
    CHECK(a.y == doctest::Approx(b.y).epsilon(1e-6));
    CHECK(a.z == doctest::Approx(b.z).epsilon(1e-6));
  };
  for (int w = 0; w < worlds; ++w) {
    double const c = std::cos(0.7 * w), s = std::sin(0.7 * w);
    auto const place = [&](double ahead, double left, double up) { return V{c * ahead - s * left, s * ahead + c * left, 1 + up}; };
    for (int k = 0; k < 3; ++k) CHECK(world(3 * w + k) == w);
    // "eye": 0.5 before the axis, looking ahead: 2 m ahead of it, 0.3 left, 0.1 up is left and above of the centre
    double const f = 50 / std::tan(0.5), g = 50 / std::tan(0.6), h = 50 / std::tan(0.4);
    check(seen(&views(3 * w, 0, 0), &Ks(3 * w, 0, 0), place(2.5, 0.3, 0.1)), {100 - f * 0.15, 50 - f * 0.05, 2});
    // to the left: ahead is to its right
    check(seen(&views(3 * w + 1, 0, 0), &Ks(3 * w + 1, 0, 0), place(0.3, 1.25, 0.1)), {100 + g * 0.3, 50 - g * 0.1, 1});
    // of the world, looking down from 5 m with y up in the picture; its quaternion is of any length
    check(seen(&views(3 * w + 2, 0, 0), &Ks(3 * w + 2, 0, 0), {0.4, 0.2, 1}), {100 + h * 0.1, 50 - h * 0.05, 4});
  }

  auto const bad = [&](gsp::CameraMount const& mount, char const* part) {
    try {
      gsp::make_camera_mounts(exec, model, compiled, {mount}, {.worlds = worlds});
      CHECK_MESSAGE(false, "accepted, expected: ", part);
    } catch (std::exception const& e) { CHECK_MESSAGE(std::string(e.what()).find(part) != std::string::npos, e.what()); }
  };
  bad({.camera = "eyes"}, "no camera 'eyes'; nearest: 'eye'");
  bad({}, "mount 0: name one camera or one body");
  bad({.camera = "eye", .body = "mast"}, "mount 0: name one camera or one body");
  bad({.camera_id = 1}, "has 1 cameras, not one of index 1");
  bad({.body_id = 2}, "has 2 bodies, not one of index 2");
  bad({.body = "mast", .quat = {0, 0, 0, 0}}, "the rotation not 0");
  bad({.body = "mast", .pos = {1, 0, 0}, .look_at = gsp::Double3{1, 0, 0}}, "must not look at itself");
  bad({.body = "mast", .pos = {NAN, 0, 0}}, "must be finite");
  bad({.body = "mast", .fovy = 60}, "mount 0: CameraMount::fovy is 60.000000 and must lie between 0 and pi: it is in radians");
  bad({.body = "mast", .fovy = 0}, "CameraMount::fovy is 0.000000");
  CHECK_THROWS_WITH_AS(gsp::make_camera_mounts(exec, model, gsp::compile(gsp::samples::quadruped()), {{.body_id = 1}}),
                       doctest::Contains("give the one that the model was made from"), std::invalid_argument);
  gsp::GaussianSet one;
  one.positions = {0, 0, 0};
  one.body = {0};
  one.quats = {1, 0, 0, 0};
  one.scales = {0.1f, 0.1f, 0.1f};
  one.opacities = {0.5f};
  one.sh = {1, 1, 1};
  auto const cloud = gsp::make_gaussians(exec, one);
  auto frames = gsp::make_frames(exec, cloud, {.images = 15, .width = width, .height = height / 2});
  CHECK_THROWS_WITH_AS(gsp::render(exec, cloud, poses, cameras, frames), doctest::Contains("200 x 100 pixels, the frames have 200 x 50"),
                       std::invalid_argument);
  auto three = gsp::make_cameras(exec, 3);
  CHECK_THROWS_WITH_AS(gsp::cameras_of(exec, model, poses, mounts, three), doctest::Contains("make_cameras(exec, mounts.images())"),
                       std::invalid_argument);
  auto fewer = gsp::make_poses(exec, model, {.worlds = 4});
  auto const other = gsp::make_model<double>(exec, gsp::compile(gsp::samples::quadruped()));
  CHECK_THROWS_WITH_AS(gsp::cameras_of(exec, other, poses, mounts, cameras),
                       doctest::Contains("the mounts were made for another model: make_camera_mounts with this"), std::invalid_argument);
  auto blind = mast();
  for (auto& body : blind.bodies) body.cameras.clear();
  auto const without = gsp::make_model<double>(exec, gsp::compile(blind));  // of the same bodies
  CHECK_THROWS_WITH_AS(gsp::cameras_of(exec, without, poses, mounts, cameras), doctest::Contains("made for another model"),
                       std::invalid_argument);
  CHECK_THROWS_WITH_AS(gsp::make_camera_mounts(exec, without, compiled, {{.camera = "eye"}}),
                       doctest::Contains("sites and 0 cameras, the compiled model"), std::invalid_argument);
  CHECK_THROWS_WITH_AS(gsp::cameras_of(exec, model, fewer, mounts, cameras), doctest::Contains("mounts are for 5 worlds"),
                       std::invalid_argument);
}

// A sensor beside pictures by hand: cameras from look_at and pinhole in the mast's closed form, drawn by render alone. Both round views to
// float, 6e-8 of 3 m at 50 pixels a metre: 1e-5 pixels, over an edge of half a pixel, of colours and metres.
TEST_CASE_TEMPLATE("what the cameras of a model see, in all worlds", Exec, GSP_TEST_EXECS) {
  Exec const exec;
  int const worlds = 3, width = 60, height = 40;
  auto d = mast();
  d.bodies[1].cameras[0].resolution = {width, height};
  auto second = d.bodies[1].cameras[0];
  second.name = "back";
  second.pos = {-0.5, 0, 0};
  second.quat = {0.5, 0.5, 0.5, 0.5};  // it looks along -x
  d.bodies[1].cameras.push_back(second);
  auto const compiled = gsp::compile(d);
  auto const model = gsp::make_model<float>(exec, compiled);
  auto state = gsp::make_state(exec, model, {.worlds = worlds});
  auto dynamics = gsp::make_dynamics(exec, model, {.worlds = worlds});
  auto poses = gsp::make_poses(exec, model, {.worlds = worlds});
  auto const qpos = Kokkos::create_mirror_view(state.qpos);
  for (int w = 0; w < worlds; ++w) qpos(w, 0) = 0.2f * float(w);
  Kokkos::deep_copy(state.qpos, qpos);
  gsp::forward_kinematics(exec, model, state, poses, dynamics);

  // a ball before each camera on the mast, and one that stands still behind the first
  gsp::GaussianSet set;
  float const place[3][3] = {{2, 0.1f, 0}, {-1.5f, 0, 0.1f}, {4, 0.5f, 1}};
  for (int i = 0; i < 3; ++i) {
    set.positions.insert(set.positions.end(), place[i], place[i] + 3);
    set.body.push_back(i < 2 ? 1 : 0);
    for (float const q : {1.f, 0.f, 0.f, 0.f}) set.quats.push_back(q);
    for (int c = 0; c < 3; ++c) set.scales.push_back(i < 2 ? 0.1f : 0.5f);
    set.opacities.push_back(0.95f);
    for (int c = 0; c < 3; ++c) set.sh.push_back(c == i ? 1.7f : 0.f);
  }
  auto const cloud = gsp::make_gaussians(exec, set);
  // example-begin camera_sensor
  // cameras whose file has a resolution; of others add .width = 128, .height = 96
  auto sensor = gsp::make_camera_sensor(exec, model, compiled, cloud, {}, {.worlds = worlds, .alpha = true, .id = true});
  gsp::see(exec, model, poses, cloud, sensor);  // sensor.frames.rgb, .depth, .alpha, sensor.id: image world * sensor.count() + camera
  // example-end camera_sensor
  REQUIRE(sensor.count() == 2);
  REQUIRE(sensor.frames.width == width);
  REQUIRE(sensor.frames.height == height);

  std::vector<float> viewmats, Ks;
  auto const K = gsp::pinhole(width, height, {.fovy = 1});
  for (int w = 0; w < worlds; ++w)
    for (double const ahead : {1., -1.}) {
      double const c = ahead * std::cos(0.2 * w), s = ahead * std::sin(0.2 * w);
      auto const view = gsp::look_at<double>({0.5 * c, 0.5 * s, 1}, {2 * c, 2 * s, 1}).matrix();
      viewmats.insert(viewmats.end(), view.begin(), view.end());
      Ks.insert(Ks.end(), K.begin(), K.end());
    }
  std::vector<int> world;
  for (int image = 0; image < 2 * worlds; ++image) world.push_back(image / 2);
  auto const cameras = gsp::make_cameras(exec, viewmats, Ks, world);
  auto frames = gsp::make_frames(exec, cloud, {.images = 2 * worlds, .width = width, .height = height});
  gsp::render(exec, cloud, poses, cameras, frames);
  auto const host = [](auto const& v) { return Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, v); };
  auto const rgb = host(frames.rgb), seen_rgb = host(sensor.frames.rgb);
  auto const depth = host(frames.depth), seen_depth = host(sensor.frames.depth), alpha = host(frames.alpha);
  auto id = host(sensor.id);
  int shown[3] = {0, 0, 0};  // nothing, the world, the mast
  for (int image = 0; image < 2 * worlds; ++image)
    for (int r = 0; r < height; ++r)
      for (int c = 0; c < width; ++c) {
        float worst = 0;
        for (int k = 0; k < 3; ++k) worst = std::max(worst, std::abs(rgb(image, r, c, k) - seen_rgb(image, r, c, k)));
        if (worst > 1e-4f || !(std::abs(depth(image, r, c) - seen_depth(image, r, c)) <= 1e-4f * 4)) FAIL_CHECK("image " << image);
        // what lets less than half of the light through is seen; of two that do so together, the second
        if (std::abs(alpha(image, r, c) - 0.5f) > 1e-4f) CHECK((id(image, r, c) >= 0) == (alpha(image, r, c) > 0.5f));
        if (id(image, r, c) == 0 && image % 2 == 1) FAIL_CHECK("the still ball is before the mast's other side");
        ++shown[id(image, r, c) + 1];
      }
  for (int const n : shown) CHECK(n > 100);
  CHECK(id(0, height / 2, width / 2 - 3) == 1);  // a tenth of a metre to the left
  CHECK(std::abs(seen_depth(1, height / 2, width / 2) - 1) < 1e-3f);

  // a lens before the first camera, none before the second
  auto const barrel = gsp::opencv_lens({-0.3, 0.05, 0.002, 0});
  auto const none = gsp::opencv_lens({0, 0, 0, 0});
  auto behind =
      gsp::make_camera_sensor(exec, model, compiled, cloud, {{.camera = "eye", .lens = barrel}, {.camera = "back"}}, {.worlds = worlds});
  gsp::see(exec, model, poses, cloud, behind);
  std::vector<gsp::Lens> lenses;
  for (int w = 0; w < worlds; ++w) lenses.insert(lenses.end(), {barrel, none});
  gsp::render(exec, cloud, poses, gsp::make_cameras(exec, viewmats, Ks, world, lenses), frames);
  auto const bent = host(frames.rgb), seen_bent = host(behind.frames.rgb);
  float worst = 0, moved = 0;
  for (std::size_t i = 0; i < bent.size(); ++i) {
    worst = std::max(worst, std::abs(bent.data()[i] - seen_bent.data()[i]));
    moved = std::max(moved, std::abs(bent.data()[i] - seen_rgb.data()[i]));
  }
  CHECK(worst < 1e-4f);
  CHECK(moved > 0.05f);
  gsp::cameras_of(exec, model, poses, sensor.mounts, behind.cameras);  // of mounts without lenses
  CHECK(behind.cameras.lenses.extent(0) == 0);

  // labels in place of bodies; the first ball is before the third
  auto const label = Kokkos::create_mirror_view(Kokkos::HostSpace{}, Kokkos::View<int*, typename Exec::memory_space>("label", 3));
  int const labels[] = {(1 << 24) + 1, 2147483647, -7};  // more than a float's digits hold, the largest int, and less than none
  for (int i = 0; i < 3; ++i) label(i) = labels[i];
  sensor.label = Kokkos::create_mirror_view_and_copy(typename Exec::memory_space{}, label);
  gsp::see(exec, model, poses, cloud, sensor);
  auto const named = host(sensor.id);
  CHECK(named(0, height / 2, width / 2 - 3) == labels[0]);
  CHECK(named(1, height / 2, width / 2) == labels[1]);
  int others = 0;
  for (int r = 0; r < height; ++r)
    for (int c = 0; c < width; ++c) others += named(0, r, c) == labels[2];
  CHECK(others > 20);
  sensor.label = Kokkos::View<int*, typename Exec::memory_space>("label", 2);
  CHECK_THROWS_WITH_AS(gsp::see(exec, model, poses, cloud, sensor), doctest::Contains("2 labels for 3 Gaussians"), std::invalid_argument);

  auto const refuses = [&](std::vector<gsp::CameraMount> const& mounts, gsp::CameraSensorOptions const& options, char const* part) {
    try {
      gsp::make_camera_sensor(exec, model, compiled, cloud, mounts, options);
      CHECK_MESSAGE(false, "accepted, expected: ", part);
    } catch (std::exception const& e) { CHECK_MESSAGE(std::string(e.what()).find(part) != std::string::npos, e.what()); }
  };
  refuses({}, {.width = 10}, "give width and height of the pictures, or neither");
  refuses({{.camera = "eye"}, {.body = "mast"}}, {}, "mount 1 is no camera of the model and has no resolution");
  refuses({{.camera = "ear"}}, {}, "no camera 'ear'");
  d.bodies[1].cameras[1].resolution = {width, 50};
  auto const uneven = gsp::compile(d);
  CHECK_THROWS_WITH_AS(gsp::make_camera_sensor(exec, model, uneven, cloud), doctest::Contains("60 x 50 pixels, those before it 60 x 40"),
                       gsp::Error);
  d.bodies[1].cameras[0].resolution = {1, 1};
  CHECK_THROWS_WITH_AS(gsp::make_camera_sensor(exec, model, gsp::compile(d), cloud),
                       doctest::Contains("mount 0: its camera has no resolution"), gsp::Error);
}
