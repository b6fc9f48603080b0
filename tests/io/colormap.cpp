#include <doctest/doctest.h>

#include <gsp/io/colormap.hpp>

using namespace gsp::io;

TEST_CASE("rainbow: continuous, within 0..1, each colour once, brightest in the middle") {
  auto light = [](std::array<float, 3> const& c) { return .2126f * c[0] + .7152f * c[1] + .0722f * c[2]; };
  float step = 0;
  for (int i = 0; i < 1000; ++i) {
    auto const a = rainbow(static_cast<float>(i) / 1000), b = rainbow(static_cast<float>(i + 1) / 1000);
    for (int c = 0; c < 3; ++c) {
      CHECK((a[c] >= 0 && a[c] <= 1));
      step = std::max(step, std::abs(a[c] - b[c]));
    }
    for (int j = 0; j < i - 60; ++j) {  // colours further apart than 6 % of the scale are told apart by more than 3 % in some channel
      auto const e = rainbow(static_cast<float>(j) / 1000);
      if (std::max({std::abs(a[0] - e[0]), std::abs(a[1] - e[1]), std::abs(a[2] - e[2])}) < 0.03f)
        FAIL("colours " << i << " and " << j << " are alike");
    }
  }
  CHECK(step < 0.01f);
  CHECK(light(rainbow(0.5f)) > 0.7f);
  CHECK(light(rainbow(0)) < 0.2f);
  CHECK(light(rainbow(1)) < 0.2f);
  CHECK(rainbow(NAN) == rainbow(0));
  CHECK(rainbow(5) == rainbow(1));
}

TEST_CASE("depth in colour: near red, far blue, nothing black") {
  float const depth[5] = {1, 3, 0, NAN, 2};
  auto const b = depth_to_color(depth, 5, 1);
  CHECK(b.pixels[0] > 100);
  CHECK(b.pixels[0] > b.pixels[2]);
  CHECK(b.pixels[5] > b.pixels[3]);
  for (int k = 6; k < 12; ++k) CHECK(b.pixels[k] == 0);
  auto const middle = rainbow(0.5f);
  CHECK(b.pixels[13] == to_byte(middle[1]));
  CHECK(depth_to_color(depth, 5, 1, {.near = 1, .far = 3}).pixels == b.pixels);
}
