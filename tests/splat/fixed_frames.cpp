#include <gsp/splat/fixed_frames.hpp>
// first, so that it stands by itself
#include <doctest/doctest.h>

#include <cstring>
#include <gsp_test_execs.hpp>
#include <splat/scenes.hpp>
#include <support/kokkos_tools.hpp>

// What a camera that stands still sees has to be what `render` draws of the same poses: its pictures are the reference, bit by bit.
namespace {

template <class Mem>
struct Pictures {
  std::vector<float> rgb, depth, alpha;
  Pictures(gsp::Frames<Mem> const& f) : rgb(host(f.rgb)), depth(host(f.depth)), alpha(host(f.alpha)) {}
  template <class View>
  static std::vector<float> host(View const& v) {
    auto const copy = Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, v);
    return {copy.data(), copy.data() + copy.span()};
  }
  /// Pixels that differ in some bit.
  int differs(Pictures const& o) const {
    int count = 0;
    for (std::size_t k = 0; k < alpha.size(); ++k)
      count += std::memcmp(&rgb[3 * k], &o.rgb[3 * k], 12) != 0 || std::memcmp(&depth[k], &o.depth[k], 4) != 0 ||
               std::memcmp(&alpha[k], &o.alpha[k], 4) != 0;
    return count;
  }
};

/// n small Gaussians about the origins of bodies 1 .. bodies - 1, solid enough to hide what is behind.
gsp::GaussianSet robot(int n, int bodies, unsigned seed) {
  auto set = gsp_test::random_gaussians(n, 1, bodies - 1, seed);
  for (float& x : set.positions) x *= 0.25f;
  for (float& x : set.scales) x = std::min(x, 0.06f);
  for (int& b : set.body) ++b;
  return set;
}

/// Poses of step `k`: bodies anywhere near the origin; in every fourth step all of them far behind the cameras.
template <class Exec>
auto poses_of_step(Exec const& exec, int worlds, int bodies, int k) {
  std::vector<std::vector<gsp::Transform<double>>> unused;
  auto const poses = gsp_test::random_poses<float>(exec, worlds, bodies, unsigned(20 + k), unused);
  if (k % 4 != 3) return poses;
  auto const x = Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, poses.xpos);
  for (int w = 0; w < worlds; ++w)
    for (int b = 1; b < bodies; ++b)
      for (int i = 0; i < 3; ++i) x(w, b, i) = 1e6f;
  Kokkos::deep_copy(poses.xpos, x);
  return poses;
}

/// Cameras of `views` places, one after the other.
void cameras_in_turn(int count, int views, int width, int height, double distance, std::vector<float>& viewmats, std::vector<float>& Ks) {
  gsp_test::random_cameras(views, width, height, distance, 4, viewmats, Ks);
  for (int c = views; c < count; ++c) {
    for (int i = 0; i < 16; ++i) viewmats.push_back(viewmats[std::size_t(16 * (c - views) + i)]);
    for (int i = 0; i < 9; ++i) Ks.push_back(Ks[std::size_t(9 * (c - views) + i)]);
  }
}

}  // namespace

TEST_CASE_TEMPLATE("pictures of fixed cameras have the bits of render, step after step", Exec, GSP_TEST_EXECS) {
  Exec const exec = gsp_test::other_instance(Exec{});
  struct Case {
    int standing, moving, width, height;
    double distance;
    gsp::FrameOptions options;
  };
  // the second: lists of thousands in one tile; the third: buffers that have to grow; the fourth: few move, and blocks of whole rows of 16
  // bytes are put back; the last: nothing stands, nothing moves
  for (auto const& [standing, moving, width, height, distance, options] :
       {Case{2500, 300, 203, 117, 2.2, {.batch = 4}}, Case{9000, 4000, 64, 48, 6, {}},
        Case{2500, 300, 150, 90, 2.2, {.batch = 2, .visible = 1, .pairs = 1}}, Case{2500, 20, 204, 120, 2.2, {}},
        Case{0, 300, 70, 50, 2.2, {}}, Case{500, 0, 70, 50, 2.2, {}}}) {
    int const worlds = 3, bodies = 4, images = 6, views = 2;
    // what moves is named first, and the second half of what stands comes behind it: sources are mixed
    auto const scene = gsp_test::random_gaussians(standing / 2, 2, 1, 5), other = gsp_test::random_gaussians(standing / 2, 0, 1, 6);
    auto const cloud = gsp::make_gaussians(exec, {scene, robot(moving, bodies, 7), other});
    std::vector<float> viewmats, Ks;
    cameras_in_turn(images, views, width, height, distance, viewmats, Ks);
    auto const cameras = gsp::make_cameras(exec, viewmats, Ks);
    auto fixed = gsp::make_fixed_frames(exec, cloud, poses_of_step(exec, worlds, bodies, 0), cameras, [&] {
      auto o = options;
      o.width = width, o.height = height;
      return o;
    }());
    CHECK(fixed.still.images == views);
    CHECK(fixed.frames.images == images);
    auto frames = gsp::make_frames(exec, cloud, {.images = images, .width = width, .height = height});
    int changed = 0, blank = 0;
    for (int k = 0; k < 9; ++k) {
      auto const poses = poses_of_step(exec, worlds, bodies, k - (k == 6));  // the sixth is as the fifth
      gsp::render_fixed(exec, poses, fixed);
      gsp::render(exec, cloud, poses, cameras, frames);
      Pictures const got(fixed.frames), expected(frames);
      CHECK(got.differs(expected) == 0);
      auto const drawn = Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, fixed.drawn);
      int shows = 0;
      for (std::size_t i = 0; i < drawn.span(); ++i) shows += drawn.data()[i] != 0;
      changed += shows > 0;
      blank += shows == 0;
    }
    CHECK(changed == (moving > 0 ? 7 : 0));
    CHECK(blank == (moving > 0 ? 2 : 9));
  }
}

TEST_CASE_TEMPLATE("fixed cameras behind lenses have the bits of render, and share views of equal lenses alone", Exec, GSP_TEST_EXECS) {
  Exec const exec;
  int const worlds = 3, bodies = 4, images = 6, width = 96, height = 70;
  auto const cloud = gsp::make_gaussians(exec, {gsp_test::random_gaussians(2500, 2, 1, 5), robot(300, bodies, 7)});
  std::vector<float> viewmats, Ks;
  cameras_in_turn(images, 1, width, height, 2.2, viewmats, Ks);
  std::vector<gsp::Lens> lenses;
  for (int c = 0; c < images; ++c)  // made anew each: equal numbers, whatever lies between them
    lenses.push_back(c % 3 == 0   ? gsp::opencv_lens({-0.2, 0.05, 0.001, -0.002})
                     : c % 3 == 1 ? gsp::fisheye_lens({0.1, 0, 0, 0})
                                  : gsp::opencv_lens({-0.2, 0.05, 0.001, 0}));
  auto const cameras = gsp::make_cameras(exec, viewmats, Ks, {}, lenses);
  auto fixed = gsp::make_fixed_frames(exec, cloud, poses_of_step(exec, worlds, bodies, 0), cameras, {.width = width, .height = height});
  CHECK(fixed.still.images == 3);
  auto frames = gsp::make_frames(exec, cloud, {.images = images, .width = width, .height = height});
  for (int k = 0; k < 5; ++k) {
    auto const poses = poses_of_step(exec, worlds, bodies, k);
    gsp::render_fixed(exec, poses, fixed);
    gsp::render(exec, cloud, poses, cameras, frames);
    CHECK(Pictures(fixed.frames).differs(Pictures(frames)) == 0);
  }
}

// A link at rest with the Gaussians of the scene: every depth is there twice, and the index in the sets decides.
TEST_CASE_TEMPLATE("ties of what stands and what moves are decided as in one list", Exec, GSP_TEST_EXECS) {
  Exec const exec;
  auto const scene = gsp_test::random_gaussians(1200, 0, 1, 5);
  auto twin = scene;
  for (int& b : twin.body) b = 1;
  for (float& x : twin.sh) x = 0.4f - x;
  auto const poses = gsp::make_poses<float>(exec, 1, 2, 0);
  int const width = 130, height = 70;
  std::vector<float> viewmats, Ks;
  gsp_test::random_cameras(2, width, height, 2.2, 4, viewmats, Ks);
  auto const cameras = gsp::make_cameras(exec, viewmats, Ks);
  for (bool first : {false, true}) {
    auto const cloud = first ? gsp::make_gaussians(exec, {scene, twin}) : gsp::make_gaussians(exec, {twin, scene});
    auto fixed = gsp::make_fixed_frames(exec, cloud, poses, cameras, {.width = width, .height = height});
    gsp::render_fixed(exec, poses, fixed);
    auto frames = gsp::make_frames(exec, cloud, {.images = 2, .width = width, .height = height});
    gsp::render(exec, cloud, poses, cameras, frames);
    CHECK(Pictures(fixed.frames).differs(Pictures(frames)) == 0);
  }
}

TEST_CASE_TEMPLATE("worlds of different scenes before fixed cameras", Exec, GSP_TEST_EXECS) {
  Exec const exec;
  int const worlds = 4, bodies = 3, width = 90, height = 70;
  auto const all = gsp::make_gaussians(exec, {gsp_test::random_gaussians(900, 1, 1, 5), gsp_test::random_gaussians(700, 0, 1, 6),
                                              robot(200, bodies, 7), robot(150, bodies, 8)});
  auto const cloud = gsp::show_sets(exec, all, {{0, 2}, {1, 2}, {0, 2}, {1, 3}});
  std::vector<float> viewmats, Ks;
  cameras_in_turn(5, 1, width, height, 2.2, viewmats, Ks);
  auto const cameras = gsp::make_cameras(exec, viewmats, Ks, {0, 1, 2, 3, 1});
  auto fixed = gsp::make_fixed_frames(exec, cloud, poses_of_step(exec, worlds, bodies, 0), cameras, {.width = width, .height = height});
  CHECK(fixed.still.images == 3);  // worlds 0 and 2 show the same, and so do cameras 1 and 4
  auto frames = gsp::make_frames(exec, cloud, {.images = 5, .width = width, .height = height});
  for (int k = 0; k < 5; ++k) {
    auto const poses = poses_of_step(exec, worlds, bodies, k);
    gsp::render_fixed(exec, poses, fixed);
    gsp::render(exec, cloud, poses, cameras, frames);
    CHECK(Pictures(fixed.frames).differs(Pictures(frames)) == 0);
  }
}

TEST_CASE_TEMPLATE("after its first call render_fixed allocates nothing, and draws on its instance", Exec, GSP_TEST_EXECS) {
  Exec const exec = gsp_test::other_instance(Exec{});
  int const bodies = 3;
  auto const cloud = gsp::make_gaussians(exec, {gsp_test::random_gaussians(500, 1, 1, 2), robot(200, bodies, 7)});
  std::vector<float> viewmats, Ks;
  gsp_test::random_cameras(5, 100, 70, 2.2, 4, viewmats, Ks);
  auto const poses = poses_of_step(exec, 2, bodies, 0);
  auto fixed = gsp::make_fixed_frames(exec, cloud, poses, gsp::make_cameras(exec, viewmats, Ks), {.width = 100, .height = 70, .batch = 2});
  gsp::render_fixed(exec, poses, fixed);
  auto const seen = gsp_test::watch([&] { gsp::render_fixed(exec, poses, fixed); });
  gsp_test::check_labels(seen);
  gsp_test::check_no_allocation(seen);
  gsp_test::check_instance(exec, seen);
}

TEST_CASE("what cannot be drawn by fixed cameras is refused in a sentence") {
  Kokkos::Serial const exec;
  auto const cloud = gsp::make_gaussians(exec, gsp_test::random_gaussians(20, 0, 2, 2));
  std::vector<float> viewmats, Ks;
  gsp_test::random_cameras(2, 32, 32, 2, 4, viewmats, Ks);
  auto const poses = gsp::make_poses<float>(exec, 2, 2, 0), one = gsp::make_poses<float>(exec, 1, 2, 0);
  auto const cameras = gsp::make_cameras(exec, viewmats, Ks, {0, 1});
  CHECK_THROWS_WITH_AS(gsp::make_fixed_frames(exec, cloud, one, cameras, {.width = 32, .height = 32}),
                       doctest::Contains("a camera is of world 1, the poses have 1"), std::invalid_argument);
  auto fixed = gsp::make_fixed_frames(exec, cloud, poses, cameras, {.width = 32, .height = 32});
  CHECK_NOTHROW(gsp::render_fixed(exec, poses, fixed));
  CHECK_THROWS_WITH_AS(gsp::render_fixed(exec, one, fixed),
                       doctest::Contains("gsp::render_fixed: the poses have 1 worlds, the frames were made for 2"), std::invalid_argument);
  CHECK_NOTHROW(gsp::render_fixed(exec, poses, fixed));
  auto wide = cameras;
  wide.width = wide.height = 64;
  CHECK_THROWS_WITH_AS(gsp::make_fixed_frames(exec, cloud, poses, wide, {.width = 32, .height = 32}),
                       doctest::Contains("gsp::make_fixed_frames: the cameras are for pictures of 64 x 64 pixels, the frames have 32 x 32"),
                       std::invalid_argument);
  auto few = gsp::make_cameras(exec, viewmats, Ks, {}, {gsp::opencv_lens({0.1, 0, 0, 0})});
  Kokkos::resize(few.lenses, 1);
  CHECK_THROWS_WITH_AS(gsp::make_fixed_frames(exec, cloud, poses, few, {.width = 32, .height = 32}),
                       doctest::Contains("1 lenses for 2 cameras"), std::invalid_argument);
  CHECK_THROWS_WITH_AS(gsp::make_fixed_frames(exec, gsp::show_sets(exec, cloud, {{0}}), poses, cameras, {.width = 32, .height = 32}),
                       doctest::Contains("the table of shown sets has 1 worlds, the poses have 2"), std::invalid_argument);
  auto const unwritten = gsp::make_cameras(exec, 2);
  CHECK_THROWS_WITH_AS(gsp::make_fixed_frames(exec, cloud, poses, unwritten, {.width = 32, .height = 32}),
                       doctest::Contains("has no focal length"), std::invalid_argument);
}

TEST_CASE_TEMPLATE("a robot before a camera on the wall", Exec, GSP_TEST_EXECS) {
  Exec const exec;
  int const worlds = 3, bodies = 3;
  auto const room = gsp_test::random_gaussians(500, 0, 1, 2), arm = robot(200, bodies, 7);
  std::vector<float> viewmats, Ks;
  cameras_in_turn(worlds, 1, 64, 48, 2.2, viewmats, Ks);
  std::vector<decltype(poses_of_step(exec, worlds, bodies, 0))> steps;
  for (int k = 0; k < 3; ++k) steps.push_back(poses_of_step(exec, worlds, bodies, k));
  auto const start = steps[0];
  double light = 0;
  // example-begin fixed_frames
  auto const cloud = gsp::make_gaussians(exec, {room, arm});
  auto const cameras = gsp::make_cameras(exec, viewmats, Ks);  // camera w shows world w; they stand where they are
  auto fixed = gsp::make_fixed_frames(exec, cloud, start, cameras, {.width = 64, .height = 48});
  for (auto const& poses : steps) gsp::render_fixed(exec, poses, fixed);  // fixed.frames.rgb, depth, alpha: what render would have drawn
  // example-end fixed_frames
  for (float const x : Pictures(fixed.frames).rgb) light += x;
  CHECK(light > 0);
  CHECK(fixed.still.images == 1);
}
