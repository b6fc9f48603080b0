#include <doctest/doctest.h>

#include <cstring>
#include <gsp/io/gaussians.hpp>
#include <gsp/splat/id_channel.hpp>
#include <gsp/splat/median_depth.hpp>
#include <gsp/splat/render.hpp>
#include <gsp_test_execs.hpp>
#include <splat/scenes.hpp>
#include <support/data.hpp>
#include <support/kokkos_tools.hpp>
#include <support/skip.hpp>
#include <utility>

namespace {

template <class Mem>
auto to_host(gsp::Frames<Mem> const& f) {
  gsp::Frames<Kokkos::HostSpace> h;
  h.images = f.images, h.width = f.width, h.height = f.height;
  h.rgb = Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, f.rgb);
  h.depth = Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, f.depth);
  h.alpha = Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, f.alpha);
  h.status = Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, f.status);
  return h;
}

bool same_bits(gsp::Frames<Kokkos::HostSpace> const& a, gsp::Frames<Kokkos::HostSpace> const& b) {
  auto const same = [](auto const& x, auto const& y) {
    return x.span() == y.span() && std::memcmp(x.data(), y.data(), x.span() * sizeof(float)) == 0;
  };
  return same(a.rgb, b.rgb) && same(a.depth, b.depth) && same(a.alpha, b.alpha);
}

// The bars: RGB and alpha 99.9 % within 1e-4, none beyond 2e-2; expected depth, where alpha > 0.5, 99.9 % within 1e-3 relative. Pixels
// whose reference comes within 3e-6 relative of the stop (the bar allows 1e-5) are left out and counted, at most 1e-5 of all. 1e-4 is about
// 1000 float roundings of 1; a pixel blends 10-100 Gaussians with errors of a few roundings each. 2e-2: one Gaussian of alpha 1/255 more or
// less, of colour up to 5.
struct Tally {
  std::int64_t values = 0, off = 0, depths = 0, depths_off = 0, pixels = 0, left_out = 0;
  double worst = 0, sum = 0;
  void add(gsp::Frames<Kokkos::HostSpace> const& f, int image, gsp_reference::Picture const& p) {
    for (int y = 0; y < p.height; ++y)
      for (int x = 0; x < p.width; ++x) {
        std::size_t const k = static_cast<std::size_t>(y) * p.width + x;
        ++pixels;
        if (p.near_stop[k]) {
          ++left_out;
          continue;
        }
        double const error[4] = {f.rgb(image, y, x, 0) - p.rgb[3 * k], f.rgb(image, y, x, 1) - p.rgb[3 * k + 1],
                                 f.rgb(image, y, x, 2) - p.rgb[3 * k + 2], f.alpha(image, y, x) - p.alpha[k]};
        for (double e : error)
          ++values, off += !(std::abs(e) <= 1e-4), worst = std::max(worst, std::isfinite(e) ? std::abs(e) : 1e30), sum += std::abs(e);
        if (p.alpha[k] > 0.5) ++depths, depths_off += !(std::abs(f.depth(image, y, x) / p.depth[k] - 1) <= 1e-3);
      }
  }
  void check() const {
    MESSAGE(pixels, " pixels, mean error ", sum / values, ", worst ", worst, "; beyond 1e-4: ", off, " of ", values,
            "; depth beyond 1e-3: ", depths_off, " of ", depths, "; left out: ", left_out);
    CHECK(off <= values / 1000);
    CHECK(worst <= 2e-2);
    CHECK(depths > 0);
    CHECK(depths_off <= depths / 1000);
    CHECK(left_out <= 1 + pixels / 100000);
  }
};

}  // namespace

TEST_CASE_TEMPLATE("pictures are those of the plain double reference: SH 0-3, moved and turned links, several worlds", Exec,
                   GSP_TEST_EXECS) {
  Exec const exec = gsp_test::other_instance(Exec{});
  for (int degree = 0; degree <= 3; ++degree) {
    // a GPU writes pixels otherwise where rows begin at whole 16 bytes: in the second and third they do, in the last pictures do not
    int const bodies = 3, worlds = 2, images = 5, width = degree == 0 ? 203 : 204, height = 117;
    auto const set = gsp_test::random_gaussians(1500, degree, bodies, 11 + degree);
    std::vector<float> viewmats, Ks;
    gsp_test::random_cameras(images, width, height, 2.2, 5 + degree, viewmats, Ks);
    std::vector<std::vector<gsp::Transform<double>>> host_poses;
    auto const poses = gsp_test::random_poses<float>(exec, worlds, bodies, 9, host_poses);
    auto const cloud = gsp::make_gaussians(exec, set);
    auto const cameras = gsp::make_cameras(exec, viewmats, Ks);
    auto frames = gsp::make_frames(exec, cloud, {.images = images, .width = width, .height = height});
    using Mem = typename Exec::memory_space;
    Kokkos::View<float*, Mem> const room("room", degree == 3 ? std::size_t(images) * height * width * 3 + 1 : 0);
    if (degree == 3) frames.rgb = typename gsp::Frames<Mem>::template View<float****>(room.data() + 1, images, height, width, 3);
    gsp::render(exec, cloud, poses, cameras, frames);
    auto const got = to_host(frames);
    Tally tally;
    for (int c = 0; c < images; ++c) {
      CHECK(got.status(c) == 0);
      tally.add(got, c, gsp_reference::rasterize(set, host_poses[c % worlds], &viewmats[16 * c], &Ks[9 * c], width, height));
    }
    tally.check();
  }
}

TEST_CASE_TEMPLATE("pictures of the kitchen are those of the plain double reference" * doctest::test_suite("data"), Exec, GSP_TEST_EXECS) {
  auto const path = gsp_test::data("splats/kitchen.spz");
  if (!path) {
    gsp_test::skip("splats/kitchen.spz is missing from GSP_DATA_DIR");
    return;
  }
  Exec const exec;
  auto const set = gsp::io::to_gaussian_set(gsp::io::read_splats(*path), *path);
  int const images = 3, width = 640, height = 480;
  std::vector<float> viewmats, Ks;
  double const eyes[3][5] = {{0.3, -1.3, 0.2, 1.6, 0.2}, {-0.6, -1.1, 0., 3.6, 0.3}, {0.8, -1.6, -0.4, 5.0, 0.45}};  // place, yaw, pitch
  for (auto const& e : eyes) {
    gsp_test::room_camera({e[0], e[1], e[2]}, e[3], e[4], viewmats);
    float const k[9] = {415.692f, 0.f, 320.f, 0.f, 415.692f, 240.f, 0.f, 0.f, 1.f};
    Ks.insert(Ks.end(), k, k + 9);
  }
  auto const cloud = gsp::make_gaussians(exec, set);
  auto const cameras = gsp::make_cameras(exec, viewmats, Ks);
  auto poses = gsp::make_poses<float>(exec, 1, 1, 0);
  auto frames = gsp::make_frames(exec, cloud, {.images = images, .width = width, .height = height});
  gsp::render(exec, cloud, poses, cameras, frames);
  auto const got = to_host(frames);
  std::vector<gsp::Transform<double>> const world{gsp::Transform<double>{gsp::Vec3<double>{0, 0, 0}, gsp::identity_quat<double>()}};
  Tally tally;
  for (int c = 0; c < images; ++c) tally.add(got, c, gsp_reference::rasterize(set, world, &viewmats[16 * c], &Ks[9 * c], width, height));
  tally.check();
}

TEST_CASE_TEMPLATE("the same bits for any batch, any guess of sizes, any number of images, and on every host backend", Exec,
                   GSP_TEST_EXECS) {
  Exec const exec = gsp_test::other_instance(Exec{});
  int const bodies = 3, worlds = 2, images = 7, width = 150, height = 90;
  auto const set = gsp_test::random_gaussians(3000, 1, bodies, 3);
  std::vector<float> viewmats, Ks;
  gsp_test::random_cameras(images, width, height, 2, 4, viewmats, Ks);
  auto const draw = [&](auto const& on, gsp::FrameOptions options, int count) {
    std::vector<std::vector<gsp::Transform<double>>> unused;
    auto const poses = gsp_test::random_poses<float>(on, worlds, bodies, 9, unused);
    auto const cloud = gsp::make_gaussians(on, set);
    auto const cameras = gsp::make_cameras(on, {viewmats.begin(), viewmats.begin() + 16 * count}, {Ks.begin(), Ks.begin() + 9 * count});
    options.images = count, options.width = width, options.height = height;
    auto frames = gsp::make_frames(on, cloud, options);
    gsp::render(on, cloud, poses, cameras, frames);
    return to_host(frames);
  };
  auto const whole = draw(exec, {}, images);
  for (int batch : {1, 2, 3, 7}) CHECK(same_bits(whole, draw(exec, {.batch = batch}, images)));
  for (int batch : {1, 2, 3}) CHECK(same_bits(whole, draw(exec, {.batch = batch, .visible = 1, .pairs = 1}, images)));  // grows and repeats
  CHECK(same_bits(whole, draw(exec, {.visible = 3000, .pairs = 20}, images)));
  auto const one = draw(exec, {}, 1);
  CHECK(std::memcmp(one.rgb.data(), whole.rgb.data(), one.rgb.span() * sizeof(float)) == 0);
  if constexpr (!gsp::is_device<Exec>) CHECK(same_bits(whole, draw(Kokkos::Serial{}, {}, images)));
}

TEST_CASE_TEMPLATE("a turned link with SH 3 looks like the scene baked anew in the world", Exec, GSP_TEST_EXECS) {
  Exec const exec = gsp_test::other_instance(Exec{});
  int const width = 160, height = 120;
  auto set = gsp_test::random_gaussians(800, 3, 1, 21);
  gsp_test::Random random(8);
  auto const q = random.rotation();
  gsp::io::SplatSet baked = gsp::io::make_splat_set(set.size(), 3);
  baked.positions = set.positions, baked.quats = set.quats, baked.scales = set.scales, baked.opacities = set.opacities, baked.sh = set.sh;
  gsp::io::transform(baked, {{0.1, -0.2, 0.3}, {q.w, q.x, q.y, q.z}, 1});
  std::vector<float> viewmats, Ks;
  gsp_test::random_cameras(2, width, height, 2.5, 4, viewmats, Ks);
  auto const cameras = gsp::make_cameras(exec, viewmats, Ks);
  auto const draw = [&](gsp::GaussianSet const& s, bool move) {
    auto const cloud = gsp::make_gaussians(exec, s);
    auto poses = gsp::make_poses<double>(exec, 1, 2, 0);
    if (move) {
      exec.fence();
      auto const x = Kokkos::create_mirror_view(poses.xpos);
      auto const r = Kokkos::create_mirror_view(poses.xquat);
      double const p[3] = {0.1, -0.2, 0.3}, o[4] = {q.w, q.x, q.y, q.z};
      for (int k = 0; k < 4; ++k) r(0, 0, k) = k == 0, r(0, 1, k) = o[k];
      for (int k = 0; k < 3; ++k) x(0, 0, k) = 0, x(0, 1, k) = p[k];
      Kokkos::deep_copy(poses.xpos, x);
      Kokkos::deep_copy(poses.xquat, r);
    }
    auto frames = gsp::make_frames(exec, cloud, {.images = 2, .width = width, .height = height});
    gsp::render(exec, cloud, poses, cameras, frames);
    return to_host(frames);
  };
  for (int& b : set.body) b = 1;
  auto const moved = draw(set, true), still = draw(gsp::io::to_gaussian_set(baked, "baked"), false);
  double worst = 0, sum = 0;
  int far = 0;
  for (std::size_t i = 0; i < moved.rgb.span(); ++i) {
    double const e = std::abs(moved.rgb.data()[i] - still.rgb.data()[i]);
    worst = std::max(worst, e), sum += e, far += e > 1e-4;
  }
  MESSAGE("mean ", sum / moved.rgb.span(), ", worst ", worst);
  CHECK(far <= int(moved.rgb.span() / 1000));  // baking rounds positions and turned coefficients to float once more
  CHECK(worst <= 2e-2);
}

TEST_CASE_TEMPLATE("after its first call render allocates nothing; its stages never fence", Exec, GSP_TEST_EXECS) {
  Exec const exec = gsp_test::other_instance(Exec{});
  auto const cloud = gsp::make_gaussians(exec, gsp_test::random_gaussians(500, 1, 1, 2));
  std::vector<float> viewmats, Ks;
  gsp_test::random_cameras(5, 100, 70, 2, 4, viewmats, Ks);
  auto const cameras = gsp::make_cameras(exec, viewmats, Ks);
  auto poses = gsp::make_poses<float>(exec, 1, 1, 0);
  auto frames = gsp::make_frames(exec, cloud, {.images = 5, .width = 100, .height = 70, .batch = 2});
  gsp::render(exec, cloud, poses, cameras, frames);
  auto const all = gsp_test::watch([&] { gsp::render(exec, cloud, poses, cameras, frames); });
  gsp_test::check_labels(all), gsp_test::check_no_allocation(all), gsp_test::check_instance(exec, all);
  gsp_test::check_algorithm(exec, gsp_test::watch([&] {
                              gsp::place_gaussians(exec, cloud, poses, cameras, 2, frames);
                              gsp::project(exec, cloud, frames);
                              gsp::bin_tiles(exec, frames);
                              gsp::rasterize(exec, frames);
                            }));
}

// x -> width - x of every number that is drawn: the same to the rounding of centres, 1e-5 pixels.
TEST_CASE_TEMPLATE("a mirrored camera draws the mirrored picture", Exec, GSP_TEST_EXECS) {
  Exec const exec;
  int const width = 61, height = 47;
  auto const cloud = gsp::make_gaussians(exec, gsp_test::random_gaussians(3000, 0, 1, 11));
  std::vector<float> viewmats, Ks;
  gsp_test::random_cameras(1, width, height, 1.2, 4, viewmats, Ks);
  auto const poses = gsp::make_poses<float>(exec, 1, 1, 0);
  auto const drawn = [&] {
    auto frames = gsp::make_frames(exec, cloud, {.images = 1, .width = width, .height = height});
    gsp::render(exec, cloud, poses, gsp::make_cameras(exec, viewmats, Ks), frames);
    return Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, frames.rgb);
  };
  auto const plain = drawn();
  Ks[0] = -Ks[0], Ks[2] = float(width) - Ks[2];
  auto const mirrored = drawn();
  double sum = 0, light = 0;
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x)
      for (int k = 0; k < 3; ++k) {
        sum += std::abs(double(plain(0, y, x, k)) - double(mirrored(0, y, width - 1 - x, k)));
        light += double(plain(0, y, x, k));
      }
  CHECK(light > 0.1 * width * height);
  CHECK(sum / (3 * width * height) < 1e-5);
}

// A camera that sees nothing, whose buffers a device makes small, then one that looks into the scene; frames used with several channels.
TEST_CASE_TEMPLATE("pictures do not hang on what was drawn before", Exec, GSP_TEST_EXECS) {
  using Mem = typename Exec::memory_space;
  Exec const exec;
  int const images = 5, width = 70, height = 41;
  auto const cloud = gsp::make_gaussians(exec, gsp_test::random_gaussians(4000, 0, 1, 12));
  std::vector<float> viewmats, Ks;
  gsp_test::random_cameras(images, width, height, 1.2, 4, viewmats, Ks);
  auto const cameras = gsp::make_cameras(exec, viewmats, Ks);
  auto away = viewmats;
  for (int c = 0; c < images; ++c) {
    for (int k = 0; k < 16; ++k) away[std::size_t(16 * c + k)] = k % 5 == 0;
    away[std::size_t(16 * c + 11)] = -100;  // all is behind it
  }
  auto const poses = gsp::make_poses<float>(exec, 1, 1, 0);
  gsp::FrameOptions const options{.images = images, .width = width, .height = height, .batch = 2};
  auto fresh = gsp::make_frames(exec, cloud, options), used = gsp::make_frames(exec, cloud, options);
  gsp::render(exec, cloud, poses, cameras, fresh);
  gsp::render(exec, cloud, poses, gsp::make_cameras(exec, away, Ks), used);
  CHECK(to_host(used).alpha(0, 0, 0) == 0);
  gsp::render(exec, cloud, poses, cameras, used);
  CHECK(same_bits(to_host(used), to_host(fresh)));
  gsp::IdChannel<Mem> const id{{}, Kokkos::View<int***, Kokkos::LayoutRight, Mem>("id", images, height, width)};
  gsp::MedianDepthChannel<Mem> const median{Kokkos::View<float***, Kokkos::LayoutRight, Mem>("median", images, height, width)},
      again{Kokkos::View<float***, Kokkos::LayoutRight, Mem>("median", images, height, width)};
  gsp::render(exec, cloud, poses, cameras, used, {}, median);
  gsp::render(exec, cloud, poses, cameras, used, {}, id, again);  // behind one that keeps a number
  auto const a = Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, median.image),
             b = Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, again.image);
  CHECK(std::memcmp(a.data(), b.data(), a.span() * sizeof(float)) == 0);
  CHECK(same_bits(to_host(used), to_host(fresh)));
  auto thin = gsp::make_frames(exec, cloud, {.images = 1, .width = 1, .height = 300});
  gsp::render(exec, cloud, poses,
              gsp::make_cameras(exec, std::vector<float>(viewmats.begin(), viewmats.begin() + 16), {60, 0, 0.5f, 0, 60, 150, 0, 0, 1}),
              thin, {.blur = 0, .stop = 0});
  CHECK(to_host(thin).alpha(0, 150, 0) >= 0);
}

TEST_CASE("input that cannot be is refused in a sentence") {
  Kokkos::Serial const exec;
  auto set = gsp_test::random_gaussians(20, 0, 2, 2);
  auto const cloud = gsp::make_gaussians(exec, set);
  std::vector<float> viewmats, Ks;
  gsp_test::random_cameras(2, 32, 32, 2, 4, viewmats, Ks);
  auto const cameras = gsp::make_cameras(exec, viewmats, Ks);
  auto poses = gsp::make_poses<float>(exec, 1, 2, 0), short_poses = gsp::make_poses<float>(exec, 1, 1, 0);
  auto frames = gsp::make_frames(exec, cloud, {.images = 2, .width = 32, .height = 32}),
       three = gsp::make_frames(exec, cloud, {.images = 3, .width = 32, .height = 32});
  CHECK_NOTHROW(gsp::render(exec, cloud, poses, cameras, frames));
  CHECK_THROWS_WITH_AS(gsp::render(exec, cloud, short_poses, cameras, frames),
                       doctest::Contains("name 2 bodies but the poses have 1: give poses of the model that the Gaussians were bound to"),
                       std::invalid_argument);
  CHECK_THROWS_WITH_AS(gsp::render(exec, cloud, poses, cameras, three),
                       doctest::Contains("2 cameras for 3 images: make_frames with {.images = 2}"), std::invalid_argument);
  auto unwritten = gsp::make_cameras(exec, 2);
  for (bool second : {false, true}) {
    CHECK_THROWS_WITH_AS(gsp::render(exec, cloud, poses, unwritten, frames),
                         doctest::Contains(second ? "camera 0 has no focal length: write its viewmat and K, or call cameras_of"
                                                  : "camera 1 has no focal length"),
                         std::invalid_argument);
    for (int i = 0; i < 3; ++i) unwritten.Ks(1, i, i) = i < 2 ? 30 : 1;
    if (!second)
      CHECK_THROWS_WITH_AS(gsp::render(exec, cloud, poses, unwritten, frames), doctest::Contains("camera 1 has a viewmat of zeros"),
                           std::invalid_argument);
    for (int i = 0; i < 16; ++i) unwritten.viewmats(1, i / 4, i % 4) = cameras.viewmats(1, i / 4, i % 4);
  }
  auto const refused = [&](auto const& numbers, int at, float number, char const* sentence) {
    float& it = numbers.data()[at];
    float const before = std::exchange(it, number);
    CHECK_THROWS_WITH_AS(gsp::render(exec, cloud, poses, cameras, frames), doctest::Contains(sentence), std::invalid_argument);
    it = before;
  };
  char const* const not_rigid = "camera 1 has a viewmat that is no rigid motion";
  refused(cameras.viewmats, 16 + 0, 2, not_rigid);
  refused(cameras.viewmats, 16 + 5, cameras.viewmats(1, 1, 1) + 0.1f, not_rigid);
  refused(cameras.viewmats, 16 + 12, 1, not_rigid);
  refused(cameras.viewmats, 16 + 15, 5, not_rigid);
  for (int c = 0; c < 3; ++c) cameras.viewmats(1, 0, c) *= -1;
  refused(cameras.viewmats, 0, cameras.viewmats(0, 0, 0), not_rigid);
  for (int c = 0; c < 3; ++c) cameras.viewmats(1, 0, c) *= -1;
  for (int at : {1, 3, 6, 7}) refused(cameras.Ks, 9 + at, 30, "camera 1 has a K that is not fx 0 cx");
  refused(cameras.Ks, 9 + 8, 2, "camera 1 has a K that is not fx 0 cx");
  auto elsewhere = cameras;
  elsewhere.world = decltype(elsewhere.world)("world", 2);
  for (int world : {-1, 1}) {
    elsewhere.world(1) = world;
    CHECK_THROWS_WITH_AS(gsp::render(exec, cloud, poses, elsewhere, frames),
                         doctest::Contains("camera 1 is of a world that the poses do not have (they have 1): write its world"),
                         std::invalid_argument);
  }
  CHECK_NOTHROW(gsp::render(exec, cloud, poses, cameras, frames));
  CHECK_THROWS_AS(gsp::render(exec, cloud, poses, cameras, frames, {.near = -1}), std::invalid_argument);
  CHECK_THROWS_AS(gsp::render(exec, cloud, poses, cameras, frames, {.alpha_max = 1}), std::invalid_argument);
  CHECK_THROWS_AS(gsp::make_frames(exec, cloud, {.images = 0}), std::invalid_argument);
  auto const more = gsp::make_gaussians(exec, gsp_test::random_gaussians(2000, 0, 2, 2));
  CHECK_THROWS_AS(gsp::render(exec, more, poses, cameras, frames), std::invalid_argument);
  set.positions[4] = std::numeric_limits<float>::quiet_NaN();
  CHECK_THROWS_AS(gsp::make_gaussians(exec, set), std::invalid_argument);
  set.positions.pop_back();
  CHECK_THROWS_AS(gsp::make_gaussians(exec, set), std::invalid_argument);
  CHECK_THROWS_AS(gsp::make_cameras(exec, {1.f, 2.f}, {}), std::invalid_argument);
}

TEST_CASE_TEMPLATE("no Gaussians, or none in sight, give black pictures", Exec, GSP_TEST_EXECS) {
  Exec const exec = gsp_test::other_instance(Exec{});
  std::vector<float> viewmats, Ks;
  gsp_test::random_cameras(2, 40, 30, -5, 4, viewmats, Ks);  // the scene is behind the cameras
  auto const cameras = gsp::make_cameras(exec, viewmats, Ks);
  for (int n : {0, 300}) {
    auto const cloud = gsp::make_gaussians(exec, gsp_test::random_gaussians(n, 0, 1, 2));
    auto poses = gsp::make_poses<float>(exec, 1, 1, 0);
    auto frames = gsp::make_frames(exec, cloud, {.images = 2, .width = 40, .height = 30});
    Kokkos::deep_copy(frames.rgb, 7.f), Kokkos::deep_copy(frames.depth, 7.f), Kokkos::deep_copy(frames.alpha, 7.f);
    gsp::render(exec, cloud, poses, cameras, frames);
    auto const got = to_host(frames);
    float sum = 0;
    for (std::size_t i = 0; i < got.alpha.span(); ++i) sum += got.alpha.data()[i] + got.depth.data()[i] + got.rgb.data()[3 * i];
    CHECK(sum == 0);
  }
}
