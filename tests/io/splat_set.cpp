#include <doctest/doctest.h>

#include <gsp/io/splat_set.hpp>
#include <io/fixtures.hpp>

using namespace gsp::io;
using namespace gsp_test;

TEST_CASE("merge: order kept, SH widened with zeros, links joined by name") {
  SplatSet a = random_set(5, 1, 1), b = random_set(3, 3, 2);
  a.link_names = {"foot", "arm"};
  a.link = {-1, 0, 1, 1, 0};
  b.link_names = {"arm", "head"};
  b.link = {0, 1, -1};
  SplatSet const m = merge(a, b);
  REQUIRE(m.size() == 8);
  CHECK(m.sh_degree == 3);
  CHECK(m.link_names == std::vector<std::string>{"foot", "arm", "head"});
  CHECK(m.link == std::vector<int>{-1, 0, 1, 1, 0, 1, 2, -1});
  for (std::size_t i = 0; i < 5; ++i)
    for (std::size_t k = 0; k < 48; ++k) CHECK(m.sh[48 * i + k] == (k < 12 ? a.sh[12 * i + k] : 0.f));
  CHECK(std::equal(b.sh.begin(), b.sh.end(), m.sh.begin() + 5 * 48));
  CHECK(std::equal(b.positions.begin(), b.positions.end(), m.positions.begin() + 15));
  CHECK_NOTHROW(validate(m, "m"));
  append(a, a);
  CHECK(a.size() == 10);
  CHECK(a.link[9] == 0);
  CHECK_NOTHROW(validate(a, "a"));
}

TEST_CASE("validate names the first fault") {
  auto refused = [](auto const& change) {
    SplatSet set = random_set(4, 1);
    set.link_names = {"a"};
    change(set);
    return error_of([&] { validate(set, "scene"); });
  };
  CHECK(refused([](SplatSet&) {}).empty());
  CHECK(says(refused([](SplatSet& s) { s.positions[7] = NAN; }), "scene: Gaussian 2: position"));
  CHECK(says(refused([](SplatSet& s) { s.scales[9] = INFINITY; }), "Gaussian 3: scale"));
  CHECK(says(refused([](SplatSet& s) { s.scales[0] = -1; }), "Gaussian 0: a scale is negative"));
  CHECK(says(refused([](SplatSet& s) { s.opacities[1] = 1.5f; }), "Gaussian 1: opacity"));
  CHECK(says(refused([](SplatSet& s) { s.quats[0] = 2; }), "unit quaternion"));
  CHECK(says(refused([](SplatSet& s) { s.sh[13] = NAN; }), "Gaussian 1: colour"));
  CHECK(says(refused([](SplatSet& s) { s.link[2] = 1; }), "link 1 has no name"));
  CHECK(says(refused([](SplatSet& s) { s.link_names[0] = "a\nb"; }), "control characters"));
  CHECK(says(refused([](SplatSet& s) { s.sh.pop_back(); }), "disagree"));
  CHECK(says(refused([](SplatSet& s) { s = make_splat_set(0, 0); }), "no Gaussians"));
  CHECK_THROWS_AS(make_splat_set(1, 4), std::invalid_argument);
}
