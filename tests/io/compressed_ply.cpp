#include <doctest/doctest.h>

#include <gsp/io/compressed_ply.hpp>
#include <gsp/io/file.hpp>
#include <gsp/io/ply.hpp>
#include <io/fixtures.hpp>
#include <support/data.hpp>
#include <support/skip.hpp>

using namespace gsp::io;
using namespace gsp_test;

namespace {

struct Errors {
  double position = 0, scale = 0, colour = 0, opacity = 0, rotation = 0, sh = 0;
};

/// The format read a second time, straight from its description: a fixed layout after the header, arithmetic in double.
Errors compare(std::vector<std::byte> const& bytes, SplatSet const& set, int bounds, int degree) {
  std::string_view const text(reinterpret_cast<char const*>(bytes.data()), bytes.size());
  std::byte const* const body = bytes.data() + text.find("end_header\n") + 11;
  std::size_t const n = set.size(), chunks = (n + 255) / 256, rest = 3u * ((degree + 1) * (degree + 1) - 1), terms = rest / 3;
  std::vector<float> chunk(chunks * bounds);
  std::vector<std::uint32_t> packed(4 * n);
  std::memcpy(chunk.data(), body, chunk.size() * 4);
  std::memcpy(packed.data(), body + chunk.size() * 4, packed.size() * 4);
  auto const* const sh = reinterpret_cast<std::uint8_t const*>(body + chunk.size() * 4 + packed.size() * 4);
  REQUIRE(body + chunk.size() * 4 + packed.size() * 4 + n * rest == bytes.data() + bytes.size());
  Errors e;
  auto worst = [](double& max, double a, double b) { max = std::max(max, std::abs(a - b) / std::max(1.0, std::abs(b))); };
  for (std::size_t i = 0; i < n; ++i) {
    float const* const c = &chunk[i / 256 * bounds];
    std::uint32_t const p = packed[4 * i], q = packed[4 * i + 1], s = packed[4 * i + 2], rgba = packed[4 * i + 3];
    double const up[3] = {(p >> 21) / 2047.0, (p >> 11 & 1023) / 1023.0, (p & 2047) / 2047.0},
                 us[3] = {(s >> 21) / 2047.0, (s >> 11 & 1023) / 1023.0, (s & 2047) / 2047.0};
    for (int k = 0; k < 3; ++k) {
      worst(e.position, set.positions[3 * i + k], c[k] + (double(c[3 + k]) - c[k]) * up[k]);
      worst(e.scale, std::log(set.scales[3 * i + k]), c[6 + k] + (double(c[9 + k]) - c[6 + k]) * us[k]);
      double rgb = (rgba >> (24 - 8 * k) & 255) / 255.0;
      if (bounds == 18) rgb = c[12 + k] + (double(c[15 + k]) - c[12 + k]) * rgb;
      worst(e.colour, 0.5 + 0.28209479177387814 * set.sh[(terms + 1) * 3 * i + k], rgb);
    }
    worst(e.opacity, set.opacities[i], (rgba & 255) / 255.0);
    double r[4], sum = 0;
    int const largest = q >> 30;
    for (int k = 0, field = 0; k < 4; ++k)
      if (k != largest) r[k] = ((q >> (20 - 10 * field++) & 1023) / 1023.0 - 0.5) * 1.4142135623730951, sum += r[k] * r[k];
    r[largest] = std::sqrt(std::max(0.0, 1 - sum));
    double const norm = std::sqrt(sum + r[largest] * r[largest]);
    for (int k = 0; k < 4; ++k) worst(e.rotation, set.quats[4 * i + k], r[k] / norm);
    for (std::size_t channel = 0; channel < 3; ++channel)
      for (std::size_t t = 0; t < terms; ++t)
        worst(e.sh, set.sh[((terms + 1) * i + 1 + t) * 3 + channel], (sh[i * rest + channel * terms + t] / 256.0 - 0.5) * 8);
  }
  return e;
}

// Each number is rounded to float once (2^-24 relative to max(1, |x|)); the logarithm undoes an exponential: |log s| <= 10, so 10 x 2^-24
// and its own rounding.
void check(Errors const& e) {
  CHECK(e.position <= 0x1p-24);
  CHECK(e.scale <= 10 * 0x1p-24);
  CHECK(e.colour <= 0x1p-23);
  CHECK(e.opacity <= 0x1p-24);
  CHECK(e.rotation <= 0x1p-22);  // float before and after the normalisation
  CHECK(e.sh == 0);              // steps of 1/32 are floats
}

}  // namespace

TEST_CASE("compressed PLY: both chunk layouts, with and without SH") {
  for (int bounds : {12, 18})
    for (int degree = 0; degree <= 3; ++degree) {
      auto const bytes = compressed_ply(600, bounds, degree, 7 + degree);
      auto const set = parse_ply(bytes, "made.compressed.ply");
      REQUIRE(set.size() == 600);
      CHECK(set.sh_degree == degree);
      check(compare(bytes, set, bounds, degree));
    }
}

TEST_CASE("compressed PLY: real captures" * doctest::test_suite("data")) {
  struct File {
    char const* name;
    std::size_t count;
  };
  for (auto const& file : {File{"biker", 152746}, {"guitar", 90854}, {"banana", 30680}}) {
    auto const path = data("splats/" + std::string(file.name) + ".compressed.ply");
    if (!path) {
      gsp_test::skip(std::string("splats/") + file.name + ".compressed.ply is missing from GSP_DATA_DIR");
      continue;
    }
    auto const bytes = read_file(*path);
    auto const set = parse_ply(bytes, *path);
    CHECK(set.size() == file.count);
    CHECK(set.sh_degree == 0);
    check(compare(bytes, set, 18, 0));
  }
}

TEST_CASE("compressed PLY: every cut and wrong counts are refused") {
  auto const bytes = compressed_ply(3, 18, 1);
  CHECK(accepted_truncations(bytes, [](Bytes b) { parse_ply(b, "cut.ply"); }) == 0);
  auto refusal = [&](std::string const& what, std::string const& with) {
    std::string text(reinterpret_cast<char const*>(bytes.data()), bytes.size());
    text.replace(text.find(what), what.size(), with);
    return error_of([&] { parse_ply(bytes_of(text), "bad.ply"); });
  };
  CHECK(says(refusal("element chunk 1", "element chunk 0"), "bytes follow the last row"));
  CHECK(says(refusal("element chunk 1", "element chunk 9"), "announces"));
  CHECK(says(refusal("element chunk", "element junk_"), "need an element 'chunk'"));
  CHECK(says(refusal("element sh 3", "element sh 2"), "bytes follow"));
  CHECK(says(refusal("property float max_y", "property float mix_y"), "no property 'max_y'"));
  CHECK(says(refusal("packed_scale", "packed_stale"), "no property 'packed_scale'"));
  CHECK(says(refusal("f_rest_8", "f_best_8"), "no property 'f_rest_8'"));
  std::string bad(reinterpret_cast<char const*>(bytes.data()), bytes.size());
  float const nan = NAN;
  bad.replace(bad.find("end_header\n") + 11 + 8, 4, reinterpret_cast<char const*>(&nan), 4);
  CHECK(says(error_of([&] { parse_ply(bytes_of(bad), "bad.ply"); }), "chunk 0: the bounds of 'z' are not finite"));
}

TEST_CASE("compressed PLY: rotations that are a little too long stay in their bits") {
  for (float const sign : {1.f, -1.f}) {
    SplatSet set = make_splat_set(1, 0);
    set.scales = {1, 1, 1};
    set.quats = {0.7078f, 0.7078f * sign, 0, 0};  // of length 1.001, as `validate` takes it: 1023.5 or -0.5 of 1023 steps
    auto const q = parse_ply(format_compressed_ply(set), "long.ply").quats;
    CHECK(q[0] * std::sqrt(0.5) + q[1] * sign * std::sqrt(0.5) > 0.9999);
  }
}

// Half a step of each field, as format_compressed_ply says, of the range of all Gaussians, which bounds that of any chunk; 1e-5 for floats.
TEST_CASE("compressed PLY: what is written comes back within its steps") {
  for (int degree = 0; degree <= 3; ++degree) {
    auto set = random_set(600, degree, 11);
    for (float& v : set.sh) v = std::clamp(v, -3.9f, 3.9f);
    set.antialiased = degree == 1;
    if (degree == 2) {
      set.link_names = {"arm", "foot"};
      for (std::size_t i = 0; i < 600; ++i) set.link[i] = int(i % 3) - 1;
    }
    auto const bytes = format_compressed_ply(set);
    auto const again = parse_ply(bytes, "again.ply");
    check(compare(degree == 2 ? format_compressed_ply([&] {
                    auto s = set;
                    s.link_names.clear(), s.link.assign(600, -1);
                    return s;
                  }())
                              : bytes,
                  again, 18, degree));
    auto const a = apart(again, set);
    auto const range = [](auto const& v, auto const& f) {
      auto const [low, high] = std::minmax_element(v.begin(), v.end());
      return double(f(*high)) - f(*low);
    };
    CHECK(a.position <= range(set.positions, [](float x) { return x; }) / 2046 + 1e-5);
    CHECK(a.log_scale <= range(set.scales, [](float x) { return std::log(x); }) / 2046 + 1e-5);
    CHECK(a.dc <= range(set.sh, [](float x) { return x; }) / 510 + 1e-5);
    CHECK(a.opacity <= 1. / 510 + 1e-5);
    CHECK(a.sh <= 1. / 64 + 1e-5);
    // e = sqrt 2 / 2046 in three components, the largest by at most sqrt 3 of their length
    CHECK(a.rotation <= 2 * std::sqrt(3.0) * std::sqrt(2.0) / 2046 + 1e-5);
    CHECK(again.antialiased == set.antialiased);
    CHECK(again.link == set.link);
    CHECK(again.link_names == set.link_names);
  }
}

// The chunks and the words once more, straight from the page: bounds of 256 as floats, rounded steps between them. Rotations and opacities
// are the file's own (their test is above).
TEST_CASE("compressed PLY: bounds and steps, to the bit") {
  auto set = random_set(600, 0, 5);
  set.scales[7] = 0;                                                                   // below the least
  for (std::size_t i = 256; i < 512; ++i) set.positions[3 * i + 1] = 2.5f;             // no range
  set.positions[3 * 40] = -3e5f, set.sh[3 * 513] = 1e4f, set.scales[3 * 599] = 3e20f;  // far off
  auto const bytes = format_compressed_ply(set);
  std::string_view const text(reinterpret_cast<char const*>(bytes.data()), bytes.size());
  std::byte const* const body = bytes.data() + text.find("end_header\n") + 11;
  std::vector<float> chunk(3 * 18);
  std::vector<std::uint32_t> words(4 * 600);
  std::memcpy(chunk.data(), body, 4 * chunk.size());
  std::memcpy(words.data(), body + 4 * chunk.size(), 4 * words.size());
  auto const value = [&](std::size_t i, std::size_t group, std::size_t k) -> float {
    if (group == 0) return set.positions[3 * i + k];
    if (group == 1) return float(std::log(std::max(double(set.scales[3 * i + k]), std::exp(-20.0))));
    return float(0.5 + 0.28209479177387814 * set.sh[3 * i + k]);
  };
  for (std::size_t c = 0; c < 3; ++c)
    for (std::size_t group = 0; group < 3; ++group)
      for (std::size_t k = 0; k < 3; ++k) {
        std::size_t const first = 256 * c, last = std::min<std::size_t>(600, first + 256);
        float low = value(first, group, k), high = low;
        for (std::size_t i = first; i < last; ++i) low = std::min(low, value(i, group, k)), high = std::max(high, value(i, group, k));
        CHECK(chunk[18 * c + 6 * group + k] == low);
        CHECK(chunk[18 * c + 6 * group + 3 + k] == high);
        int const shift = group == 2 ? 24 - 8 * int(k) : k == 0 ? 21 : k == 1 ? 11 : 0;
        std::uint32_t const most = group == 2 ? 255 : k == 1 ? 1023 : 2047;
        std::size_t wrong = 0;
        for (std::size_t i = first; i < last; ++i) {
          double const t = high > low ? (double(value(i, group, k)) - low) / (double(high) - low) * most : 0;
          wrong += (words[4 * i + (group == 0 ? 0 : group + 1)] >> shift & most) != std::uint32_t(std::round(t));
        }
        CHECK(wrong == 0);
      }
}
