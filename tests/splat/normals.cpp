#include <doctest/doctest.h>

#include <cmath>
#include <gsp/splat/normals.hpp>
#include <gsp_test_execs.hpp>
#include <splat/scenes.hpp>
#include <support/kokkos_tools.hpp>

namespace {
template <class View>
auto on_host(View const& v) {
  return Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, v);
}
}  // namespace

// Planes n . p = h before random cameras: the depth of a pixel has the closed form h' / (n' . d), n', h' of the camera.
TEST_CASE_TEMPLATE("normals of planes are theirs, and 0 where nothing shows", Exec, GSP_TEST_ALL_EXECS) {
  using Mem = typename Exec::memory_space;
  Exec const exec = gsp_test::other_instance(Exec{});
  int const images = 6, width = 33, height = 27;
  std::vector<float> viewmats, Ks;
  gsp_test::random_cameras(images, width, height, 3, 8, viewmats, Ks);
  Ks[9 * 1] *= -1;  // image 1 is mirrored, 2 upside down, 3 both
  Ks[9 * 2 + 4] *= -1;
  Ks[9 * 3] *= -1, Ks[9 * 3 + 4] *= -1;
  auto cameras = gsp::make_cameras(exec, viewmats, Ks);
  Kokkos::View<float***, Kokkos::LayoutRight, Mem> const depth("depth", images, height, width);
  Kokkos::View<float****, Kokkos::LayoutRight, Mem> const normals("normals", images, height, width, 3),
      few("few", images, height, width, 2);
  auto const z = on_host(depth);
  gsp_test::Random random(6);
  std::vector<gsp::Vec3<double>> want;
  for (int c = 0; c < images; ++c) {
    float const *v = &viewmats[std::size_t(16 * c)], *K = &Ks[std::size_t(9 * c)];
    // facing the camera, up to 60 degrees aside, 3 m away
    gsp::Vec3<double> const n = gsp::normalized(gsp::Vec3<double>{random.uniform(-1, 1), random.uniform(-1, 1), -1});
    for (int y = 0; y < height; ++y)
      for (int x = 0; x < width; ++x) {
        gsp::Vec3<double> const d{(x + 0.5 - K[2]) / K[0], (y + 0.5 - K[5]) / K[4], 1};
        double const at = 3 * n.z / dot(n, d);
        z(c, y, x) = at > 0 ? float(at) : 0.f;
      }
    z(c, 11, 12) = c % 2 ? 0.f : -1.f;  // a hole
    want.push_back({v[0] * n.x + v[4] * n.y + v[8] * n.z, v[1] * n.x + v[5] * n.y + v[9] * n.z, v[2] * n.x + v[6] * n.y + v[10] * n.z});
  }
  Kokkos::deep_copy(depth, z);
  gsp_test::check_algorithm(exec, gsp_test::watch([&] { gsp::normals_of_depth(exec, depth, cameras, normals); }));
  auto const is = on_host(normals);
  int shown = 0;
  for (int c = 0; c < images; ++c)
    for (int y = 0; y < height; ++y)
      for (int x = 0; x < width; ++x) {
        bool const inner = x > 0 && y > 0 && x + 1 < width && y + 1 < height;
        bool const whole = inner && z(c, y, x) > 0 && z(c, y, x - 1) > 0 && z(c, y, x + 1) > 0 && z(c, y - 1, x) > 0 && z(c, y + 1, x) > 0;
        shown += whole;
        for (int k = 0; k < 3; ++k) {
          // depths are rounded to 6e-8 of them, over a step of about a fiftieth of them
          if (whole)
            REQUIRE(std::abs(is(c, y, x, k) - want[std::size_t(c)][k]) < 3e-5);
          else
            REQUIRE(is(c, y, x, k) == 0);
        }
      }
  CHECK(shown > images * width * height / 2);
  CHECK_THROWS_AS(gsp::normals_of_depth(exec, depth, cameras, few), std::invalid_argument);
  cameras.width = width, cameras.height = height;
  gsp::normals_of_depth(exec, depth, cameras, normals);
  cameras.height = height + 1;
  CHECK_THROWS_WITH_AS(gsp::normals_of_depth(exec, depth, cameras, normals),
                       doctest::Contains("33 x 27 pixels, the cameras are for 33 x 28"), std::invalid_argument);
  CHECK_THROWS_AS(gsp::normals_of_depth(exec, depth, gsp::make_cameras(exec, images + 1), normals), std::invalid_argument);
}
