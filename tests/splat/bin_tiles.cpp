#include <doctest/doctest.h>

#include <algorithm>
#include <gsp/splat/render.hpp>
#include <gsp_test_execs.hpp>
#include <numeric>
#include <set>
#include <splat/scenes.hpp>
#include <tuple>

namespace test_types {
struct TileRows {  // first and last tile of each row of tiles
  int *first, *last;
  KOKKOS_FUNCTION void operator()(int ty, int first_tile, int last_tile) const { first[ty] = first_tile, last[ty] = last_tile; }
};
}  // namespace test_types

namespace {
/// f(tile_x, tile_y) for the tiles that the splat touches.
template <class F>
void for_tiles(gsp::Splat const& splat, gsp::detail::TileGrid const& grid, F const& f) {
  int first[10], last[10];
  std::fill_n(first, 10, 0), std::fill_n(last, 10, -1);
  REQUIRE(grid.rows() <= 10);
  gsp::detail::for_tile_rows(splat, grid, test_types::TileRows{first, last});
  for (int ty = 0; ty < 10; ++ty)
    for (int tx = first[ty]; tx <= last[ty]; ++tx) f(tx, ty);
}

gsp::Splat random_splat(gsp_test::Random& random, int width, int height, int kind) {
  // a covariance from two axes, needles among them, centre inside or far outside
  double const far = kind % 3 == 0 ? 3 : 0.2, u = random.uniform(-far, 1 + far) * width, v = random.uniform(-far, 1 + far) * height;
  double const a = std::exp(random.uniform(-1, kind % 4 == 0 ? 7 : 3.5)), b = std::exp(random.uniform(-1, 2)),
               angle = random.uniform(0, 3.14159265);
  double const c = std::cos(angle), s = std::sin(angle), xx = c * c * a * a + s * s * b * b + .3, yy = s * s * a * a + c * c * b * b + .3,
               xy = c * s * (a * a - b * b);
  double const det = a * a * b * b + .3 * (a * a + b * b) + .09, h = 0.5 / std::log(2.), power = std::log2(random.uniform(0.004, 1)),
               reach = power + std::log2(255.);
  return {float(u),
          float(v),
          float(std::sqrt(h * yy / det)),
          float(-xy * std::sqrt(h / (det * yy))),
          float(std::sqrt(h / yy)),
          float(power),
          float(std::sqrt(reach * xx / h)),
          float(std::sqrt(reach * yy / h)),
          1,
          1,
          1,
          1};
}

// Least of (l11 dx + l21 dy)^2 + (l22 dy)^2 over a rectangle of offsets: 0 inside, else on an edge, where it is a parabola.
double least_over(gsp::Splat const& s, double x0, double x1, double y0, double y1) {
  if (x0 <= 0 && x1 >= 0 && y0 <= 0 && y1 >= 0) return 0;
  double const a = double(s.l11) * s.l11, b = double(s.l11) * s.l21, c = double(s.l21) * s.l21 + double(s.l22) * s.l22;
  auto const q = [&](double x, double y) { return a * x * x + 2 * b * x * y + c * y * y; };
  double best = 1e300;
  for (double y : {y0, y1}) best = std::min(best, q(std::clamp(-b * y / a, x0, x1), y));
  for (double x : {x0, x1}) best = std::min(best, q(x, std::clamp(-b * x / c, y0, y1)));
  return best;
}

}  // namespace

TEST_CASE("tiles of an ellipse: none missed, none too many, against all tiles and all pixels") {
  int const width = 203, height = 149;  // no multiples of 16, 32 or 64
  for (auto const& [x_bits, y_bits] : {std::pair(4, 4), std::pair(6, 5)}) {
    gsp::detail::TileGrid const grid{width, height, x_bits, y_bits};
    int const columns = grid.columns(), rows_of_tiles = grid.rows(), wide = 1 << x_bits, high = 1 << y_bits;
    gsp_test::Random random(5);
    int missed = 0, extra = 0, listed = 0, boxed = 0;
    for (int k = 0; k < 4000; ++k) {
      gsp::Splat const s = random_splat(random, width, height, k);
      std::set<int> tiles;
      for_tiles(s, grid, [&](int tx, int ty) { tiles.insert(ty * columns + tx); });
      CHECK(gsp::detail::count_tiles(s, grid) == int(tiles.size()));
      listed += int(tiles.size());
      double const reach = double(s.power) + std::log2(255.);
      for (int ty = 0; ty < rows_of_tiles; ++ty)
        for (int tx = 0; tx < columns; ++tx) {
          int const x0 = tx * wide, x1 = std::min(width, x0 + wide), y0 = ty * high, y1 = std::min(height, y0 + high);
          bool const has = tiles.count(ty * columns + tx) > 0;
          double const box_x = s.xe, box_y = s.ye;
          boxed += s.u + box_x >= x0 && s.u - box_x <= x1 && s.v + box_y >= y0 && s.v - box_y <= y1;
          bool touched = false;  // the rasteriser's own test, in float, at every pixel
          for (int y = y0; y < y1 && !touched; ++y)
            for (int x = x0; x < x1 && !touched; ++x) {
              float const dx = x + 0.5f - s.u, dy = y + 0.5f - s.v, wx = gsp::fma(s.l11, dx, s.l21 * dy), wy = s.l22 * dy;
              touched = gsp::fma(-wx, wx, gsp::fma(-wy, wy, s.power)) >= -gsp::splat_log2_255;
            }
          missed += touched && !has;
          // too many: the ellipse, grown by the margin that covers rounding (0.001 pixel, and 1e-6 of its size and place; twice that here),
          // misses the centres
          double const grow = 2e-3 + 2e-6 * (std::abs(s.u) + std::abs(s.v) + s.xe + s.ye);
          extra +=
              has && least_over(s, x0 + .5 - grow - s.u, x1 - .5 + grow - s.u, y0 + .5 - grow - s.v, y1 - .5 + grow - s.v) > reach * 1.0001;
        }
    }
    MESSAGE(listed, " tiles listed, ", boxed, " in the boxes");
    CHECK(missed == 0);
    CHECK(extra == 0);
    CHECK(listed < boxed);
  }
}

namespace {
struct Listed {
  int ties, longest;         // pairs of equal depth among neighbours of the whole order; the longest list
  std::vector<int> lengths;  // of the lists
};
/// Draws, and holds the lists of the last wave beside all splats in order; and the masks of a GPU's beside every pixel.
template <class Exec>
Listed check_lists(Exec const& exec, gsp::GaussianSet const& set, int width, int height, std::vector<float> const& viewmats,
                   std::vector<float> const& Ks) {
  int const images = int(viewmats.size() / 16);
  auto const cloud = gsp::make_gaussians(exec, set);
  auto const cameras = gsp::make_cameras(exec, viewmats, Ks);
  auto poses = gsp::make_poses<float>(exec, 1, 1, 0);
  auto frames = gsp::make_frames(exec, cloud, {.images = images, .width = width, .height = height, .batch = images});
  gsp::render(exec, cloud, poses, cameras, frames);
  auto const& wave = frames.wave;
  REQUIRE(wave.images == images);
  Kokkos::HostSpace const host;
  auto const splats = Kokkos::create_mirror_view_and_copy(host, wave.splats);
  auto const origins = Kokkos::create_mirror_view_and_copy(host, wave.origins);
  auto const begins = Kokkos::create_mirror_view_and_copy(host, wave.tile_begin);
  auto const list = Kokkos::create_mirror_view_and_copy(host, wave.tile_splats);
  auto const masks = Kokkos::create_mirror_view_and_copy(host, wave.block_masks);
  auto const visible = Kokkos::create_mirror_view_and_copy(host, wave.visible),
             pairs = Kokkos::create_mirror_view_and_copy(host, wave.pairs);
  REQUIRE(visible() > 0);
  std::vector<int> order(static_cast<std::size_t>(visible()));
  std::iota(order.begin(), order.end(), 0);
  auto const key = [&](int i) { return std::tuple(origins(i).depth, origins(i).image, origins(i).source); };
  std::sort(order.begin(), order.end(), [&](int a, int b) { return key(a) < key(b); });
  std::vector<std::vector<int>> expected(images * wave.tiles());
  Listed found{0, 0, {}};
  int tiles = 0;
  for (std::size_t i = 0; i < order.size(); ++i) {
    gsp::SplatOrigin const own = origins(order[i]);
    CHECK(own.depth == splats(order[i]).depth);
    found.ties += i > 0 && origins(order[i - 1]).depth == own.depth;
    tiles += own.tiles;
    for_tiles(splats(order[i]), wave.grid,
              [&](int tx, int ty) { expected[own.image * wave.tiles() + ty * wave.grid.columns() + tx].push_back(order[i]); });
  }
  std::int64_t wrong = 0, missed = 0;
  for (std::size_t t = 0; t < expected.size(); ++t) {
    std::vector<int> const got(list.data() + begins(t), list.data() + begins(t + 1));
    wrong += got != expected[t];
    found.longest = std::max(found.longest, int(got.size()));
    found.lengths.push_back(int(got.size()));
    if (masks.extent(0) == 0) continue;
    int const x0 = int(t) % wave.tiles() % wave.grid.columns() * 64, y0 = int(t) % wave.tiles() / wave.grid.columns() * 32;
    for (std::size_t k = 0; k < got.size(); ++k)
      for (int y = y0; y < std::min(height, y0 + 32); ++y)
        for (int x = x0; x < std::min(width, x0 + 64); ++x) {
          gsp::Splat const& s = splats(got[k]);
          float const dx = float(x) + 0.5f - s.u, dy = float(y) + 0.5f - s.v, wx = gsp::fma(s.l11, dx, s.l21 * dy), wy = s.l22 * dy;
          bool const shown = gsp::fma(-wx, wx, gsp::fma(-wy, wy, s.power)) >= -gsp::splat_log2_255;
          int const block = (y - y0) / 8 * 8 + (x - x0) / 8;
          missed += shown && !(masks(begins(t) / 32 + std::int64_t(t) + std::int64_t(k) / 32, block) >> k % 32 & 1u);
        }
  }
  CHECK(wrong == 0);
  CHECK(missed == 0);
  CHECK(begins(expected.size()) == pairs());
  CHECK(tiles == pairs());
  return found;
}
}  // namespace

TEST_CASE_TEMPLATE("lists of the tiles hold each splat that touches them once, front to back, ties by source", Exec, GSP_TEST_EXECS) {
  int const width = 203, height = 149, n = 2000;
  auto set = gsp_test::random_gaussians(n, 0, 1, 3);
  for (int i = n / 2; i < n; ++i)  // pairs of equal depth: the same place, other colours
    for (int k = 0; k < 3; ++k) set.positions[3 * i + k] = set.positions[3 * (i - n / 2) + k];
  std::vector<float> viewmats, Ks;
  gsp_test::random_cameras(3, width, height, 2, 4, viewmats, Ks);
  CHECK(check_lists(Exec(), set, width, height, viewmats, Ks).ties > n / 10);
}

TEST_CASE_TEMPLATE("long lists, and walls that face the camera, are in order", Exec, GSP_TEST_EXECS) {
  int const width = 61, height = 30;  // one tile of a GPU
  std::vector<float> viewmats, Ks;
  for (double z : {3., 3.25}) {
    for (double x : {1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1., z, 0., 0., 0., 1.}) viewmats.push_back(float(x));
    for (double x : {40., 0., 30., 0., 40., 15., 0., 0., 1.}) Ks.push_back(float(x));
  }
  for (int n : {300, 3000, 12000})
    for (int wall : {0, 40, n / 2, n}) {
      CAPTURE(n);
      CAPTURE(wall);
      auto set = gsp_test::random_gaussians(n, 0, 1, 7);
      for (int i = 0; i < wall; ++i) set.positions[3 * (n - 1 - i) + 2] = 0;
      for (float& x : set.opacities) x = std::max(x, 0.1f);  // all are seen
      for (int i = 0; i < n; ++i) set.positions[3 * i] *= 0.6f, set.positions[3 * i + 1] *= 0.3f;
      auto const found = check_lists(Exec(), set, width, height, viewmats, Ks);
      CHECK(found.ties >= 2 * (wall > 0 ? wall - 1 : 0));
      if (gsp::is_device<Exec>) CHECK(found.longest > n / 2);
    }
}

// More long lists than a GPU sorts at once, and some of the length that is the last of the short ones, which stand among them in the order.
TEST_CASE_TEMPLATE("hundreds of long lists are in order", Exec, GSP_TEST_EXECS) {
  int const width = 61, height = 30, images = gsp::is_device<Exec> ? 450 : 9, few = 1024, n = few + 1300;
  auto set = gsp_test::random_gaussians(n, 0, 1, 8);
  for (float& x : set.opacities) x = std::max(x, 0.1f);
  for (int i = 0; i < n; ++i)
    for (int k = 0; k < 3; ++k) set.positions[3 * i + k] = 0.15f * set.positions[3 * i + k] - (k == 2 && i >= few ? 100.f : 0.f);
  std::vector<float> viewmats, Ks;
  for (int c = 0; c < images; ++c) {  // the first 1,024 alone, the others alone, all
    float const turn = c % 3 == 1 ? -1.f : 1.f, z = c % 3 == 0 ? 3.f : c % 3 == 1 ? -97.f : 110.f;
    viewmats.insert(viewmats.end(), {turn, 0, 0, 0, 0, 1, 0, 0, 0, 0, turn, z, 0, 0, 0, 1});
    Ks.insert(Ks.end(), {40, 0, 30, 0, 40, 15, 0, 0, 1});
  }
  auto const found = check_lists(Exec(), set, width, height, viewmats, Ks);
  if (gsp::is_device<Exec>)
    for (int length : {few, n - few, n}) CHECK(std::count(found.lengths.begin(), found.lengths.end(), length) == images / 3);
}
