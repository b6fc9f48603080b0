#include <doctest/doctest.h>

#include <gsp/io/splat_order.hpp>
#include <io/fixtures.hpp>
#include <map>

using namespace gsp::io;
using namespace gsp_test;

TEST_CASE("sort_splats permutes whole Gaussians, along a Z-order curve") {
  SplatSet set = random_set(5000, 2, 3);
  set.link_names = {"a"};
  for (std::size_t i = 0; i < 5000; i += 7) set.link[i] = 0;
  SplatSet sorted = set;
  sort_splats(sorted);
  validate(sorted, "sorted");
  std::map<float, std::size_t> index;  // by x, which is different for each
  for (std::size_t i = 0; i < 5000; ++i) index[set.positions[3 * i]] = i;
  REQUIRE(index.size() == 5000);
  bool same = true;
  for (std::size_t j = 0; j < 5000; ++j) {
    std::size_t const i = index.at(sorted.positions[3 * j]);
    for (std::size_t k = 0; k < 3; ++k) same &= sorted.scales[3 * j + k] == set.scales[3 * i + k];
    for (std::size_t k = 0; k < 4; ++k) same &= sorted.quats[4 * j + k] == set.quats[4 * i + k];
    for (std::size_t k = 0; k < 27; ++k) same &= sorted.sh[27 * j + k] == set.sh[27 * i + k];
    same &= sorted.opacities[j] == set.opacities[i] && sorted.link[j] == set.link[i];
  }
  CHECK(same);

  // A grid of 8 x 8 x 8: eight in a row are a cube of 2 x 2 x 2, 64 one of 4 x 4 x 4.
  SplatSet grid = make_splat_set(512, 0);
  for (std::size_t i = 0; i < 512; ++i)
    for (std::size_t k = 0; k < 3; ++k) grid.positions[3 * i + k] = float((i * 37 % 512) >> 3 * k & 7);
  sort_splats(grid);
  for (std::size_t size : {8, 64})
    for (std::size_t first = 0; first < 512; first += size)
      for (std::size_t k = 0; k < 3; ++k) {
        float low = 8, high = 0;
        for (std::size_t i = first; i < first + size; ++i)
          low = std::min(low, grid.positions[3 * i + k]), high = std::max(high, grid.positions[3 * i + k]);
        CHECK(high - low == (size == 8 ? 1 : 3));
      }

  SplatSet flat = make_splat_set(3, 0);  // one place: as it was
  flat.opacities = {.1f, .2f, .3f};
  sort_splats(flat);
  CHECK(flat.opacities == std::vector<float>{.1f, .2f, .3f});
}
