#include <doctest/doctest.h>

#include <gsp/io/detail/splat_rotation.hpp>
#include <gsp/io/splat_transform.hpp>
#include <gsp/io/spz.hpp>
#include <io/fixtures.hpp>
#include <support/data.hpp>
#include <support/skip.hpp>

using namespace gsp::io;
using namespace gsp_test;

namespace {

/// The unpacked data read a second time from the format's description, in the file's own axes (right-up-back), double.
struct Plain {
  std::vector<double> position, rotation, log_scale, colour, sh, opacity;  // rotation x y z w, normalised
};
Plain decode(std::vector<std::byte> const& data, std::size_t n, int version, int degree, int fraction_bits) {
  auto const* at = reinterpret_cast<std::uint8_t const*>(data.data()) + 16;
  Plain p;
  for (std::size_t i = 0; i < 3 * n; ++i) {
    if (version == 1) {
      unsigned const h = at[0] | at[1] << 8, e = h >> 10 & 31, m = h & 1023;
      p.position.push_back((h >> 15 ? -1 : 1) * (e ? (1 + m / 1024.0) * std::pow(2.0, int(e) - 15) : m * std::pow(2.0, -24)));
      at += 2;
    } else {
      int v = at[0] + 256 * at[1] + 65536 * at[2];
      if (v >= 8388608) v -= 16777216;
      p.position.push_back(v / std::pow(2.0, fraction_bits));
      at += 3;
    }
  }
  for (std::size_t i = 0; i < n; ++i) p.opacity.push_back(*at++ / 255.0);
  for (std::size_t i = 0; i < 3 * n; ++i) p.colour.push_back((*at++ / 255.0 - 0.5) / 0.15);
  for (std::size_t i = 0; i < 3 * n; ++i) p.log_scale.push_back(*at++ / 16.0 - 10);
  for (std::size_t i = 0; i < n; ++i) {
    double q[4] = {};
    int largest = 3;
    if (version < 3) {
      for (int k = 0; k < 3; ++k) q[k] = *at++ / 127.5 - 1;
    } else {
      std::uint32_t const packed = at[0] | at[1] << 8 | at[2] << 16 | std::uint32_t(at[3]) << 24;
      largest = packed >> 30;
      int order[3], count = 0;
      for (int k = 0; k < 4; ++k)
        if (k != largest) order[count++] = k;
      for (int f = 0; f < 3; ++f) {
        unsigned const field = packed >> (20 - 10 * f) & 1023;
        q[order[f]] = (field & 512 ? -1.0 : 1.0) * (field & 511) / 511.0 / std::sqrt(2.0);
      }
      at += 4;
    }
    double sum = 0;
    for (double v : q) sum += v * v;
    q[largest] = std::sqrt(std::max(0.0, 1 - sum));
    double const norm = std::sqrt(sum + q[largest] * q[largest]);
    for (double v : q) p.rotation.push_back(v / norm);
  }
  for (std::size_t i = 0; i < n * 3 * ((degree + 1) * (degree + 1) - 1); ++i) p.sh.push_back((*at++ - 128) / 128.0);
  REQUIRE(at == reinterpret_cast<std::uint8_t const*>(data.data()) + data.size());
  return p;
}

/// The set that the data is in its own axes; turning it by half a turn about x must give what the reader gives: right-up-back ->
/// right-down-forward.
SplatSet turned(Plain const& p, int degree) {
  SplatSet s = make_splat_set(p.opacity.size(), degree);
  std::size_t const terms = s.sh_terms();
  for (std::size_t i = 0; i < s.size(); ++i) {
    for (int k = 0; k < 3; ++k) {
      s.positions[3 * i + k] = float(p.position[3 * i + k]);
      s.scales[3 * i + k] = float(std::exp(p.log_scale[3 * i + k]));
      s.sh[3 * terms * i + k] = float(p.colour[3 * i + k]);
    }
    s.opacities[i] = float(p.opacity[i]);
    for (int k = 0; k < 4; ++k) s.quats[4 * i + k] = float(p.rotation[4 * i + (k + 3) % 4]);
    for (std::size_t k = 0; k < 3 * (terms - 1); ++k) s.sh[3 * terms * i + 3 + k] = float(p.sh[3 * (terms - 1) * i + k]);
  }
  transform(s, {{0, 0, 0}, {0, 1, 0, 0}, 1});
  return s;
}

// `turned` multiplies by a matrix that is exact up to 1e-15 and rounds to float once more: 2^-23 relative; its half turn also gives q the
// factor i, so that (w, x, y, z) -> (-x, w, -z, y), the same orientation times a turn of the Gaussian's own axes, hence rotations are
// compared as matrices.
void compare(SplatSet const& set, SplatSet const& expected, Plain const& p) {
  REQUIRE(set.size() == expected.size());
  double position = 0, scale = 0, opacity = 0, sh = 0, rotation = 0;
  for (std::size_t i = 0; i < set.positions.size(); ++i)
    position = std::max(
        position, std::abs(double(set.positions[i]) - expected.positions[i]) / std::max(1.0, std::abs(double(expected.positions[i]))));
  for (std::size_t i = 0; i < set.scales.size(); ++i) scale = std::max(scale, std::abs(double(set.scales[i]) / expected.scales[i] - 1));
  for (std::size_t i = 0; i < set.size(); ++i) opacity = std::max(opacity, std::abs(double(set.opacities[i]) - expected.opacities[i]));
  for (std::size_t i = 0; i < set.sh.size(); ++i)
    sh = std::max(sh, std::abs(double(set.sh[i]) - expected.sh[i]) / std::max(1.0, std::abs(double(expected.sh[i]))));
  for (std::size_t i = 0; i < set.size(); ++i)  // x y z w of the file -> w x -y -z
    for (int k = 0; k < 4; ++k)
      rotation = std::max(rotation, std::abs(set.quats[4 * i + k] - (k > 1 ? -1 : 1) * p.rotation[4 * i + (k + 3) % 4]));
  CHECK(position <= 0x1p-23);
  CHECK(scale <= 0x1p-23);
  CHECK(opacity == 0);
  CHECK(sh <= 0x1p-23);
  CHECK(rotation <= 0x1p-22);
}

}  // namespace

TEST_CASE(".spz: versions 1-3, SH 0-3, turned into the axes of 3DGS PLY") {
  for (int version = 1; version <= 3; ++version)
    for (int degree = 0; degree <= 3; ++degree) {
      auto const data = spz_data(200, version, degree, 3 + degree);
      auto const set = parse_spz(gzip(data), "made.spz");
      CHECK(set.sh_degree == degree);
      auto const plain = decode(data, 200, version, degree, 12);
      compare(set, turned(plain, degree), plain);
    }
}

TEST_CASE(".spz: a rotated Gaussian keeps its shape under the change of axes") {
  // x -> (x, -y, -z) as a matrix F: R' S S R'^T = F R S S R^T F, which negating q.y and q.z gives.
  auto const data = spz_data(50, 2, 0, 9);
  auto const set = parse_spz_data(data, "made.spz");
  auto const plain = decode(data, 50, 2, 0, 12);
  double worst = 0;
  for (std::size_t i = 0; i < 50; ++i) {
    auto const r = detail::rotation_matrix({set.quats[4 * i], set.quats[4 * i + 1], set.quats[4 * i + 2], set.quats[4 * i + 3]});
    auto const o =
        detail::rotation_matrix({plain.rotation[4 * i + 3], plain.rotation[4 * i], plain.rotation[4 * i + 1], plain.rotation[4 * i + 2]});
    double s2[3];
    for (int k = 0; k < 3; ++k) s2[k] = std::exp(2 * plain.log_scale[3 * i + k]);
    double const total = s2[0] + s2[1] + s2[2];
    for (int a = 0; a < 3; ++a)
      for (int b = 0; b < 3; ++b) {
        double mine = 0, theirs = 0;
        for (int k = 0; k < 3; ++k) mine += r[3 * a + k] * r[3 * b + k] * s2[k], theirs += o[3 * a + k] * o[3 * b + k] * s2[k];
        worst = std::max(worst, std::abs(mine - theirs * (a ? -1 : 1) * (b ? -1 : 1)) / total);
      }
  }
  CHECK(worst < 1e-6);  // float quaternions: 4 x 2^-24 x 2
}

TEST_CASE(".spz: the kitchen" * doctest::test_suite("data")) {
  auto const path = data("splats/kitchen.spz");
  if (!path) {
    gsp_test::skip("splats/kitchen.spz is missing from GSP_DATA_DIR");
    return;
  }
  auto const set = read_spz(*path);
  CHECK(set.size() == 213944);
  CHECK(set.sh_degree == 0);
  std::string command = "gzip -dc '" + *path + "'";
  FILE* const pipe = popen(command.c_str(), "r");
  REQUIRE(pipe);
  std::vector<std::byte> data(16 + 213944 * 19 + 1);
  data.resize(std::fread(data.data(), 1, data.size(), pipe));
  pclose(pipe);
  REQUIRE(data.size() == 16 + 213944 * 19);
  auto const plain = decode(data, 213944, 2, 0, std::to_integer<int>(data[13]));
  compare(set, turned(plain, 0), plain);
}

TEST_CASE(".spz: bad input") {
  auto const good = spz_data(3, 3, 1);
  auto refusal = [](std::vector<std::byte> const& data) { return error_of([&] { parse_spz(gzip(data), "bad.spz"); }); };
  auto with = [&](std::size_t at, std::uint32_t value, std::size_t size) {
    auto data = good;
    std::memcpy(&data[at], &value, size);
    return refusal(data);
  };
  CHECK(refusal(good).empty());
  CHECK(accepted_truncations(gzip(good), [](Bytes b) { parse_spz(b, "cut.spz"); }) == 0);
  CHECK(accepted_truncations(good, [](Bytes b) { parse_spz_data(b, "cut.spz"); }) == 0);
  for (std::size_t n = 0; n < good.size(); ++n) CHECK(!refusal({good.begin(), good.begin() + static_cast<std::ptrdiff_t>(n)}).empty());
  CHECK(says(with(0, 0, 4), "does not start with 'NGSP'"));
  CHECK(says(with(4, 4, 4), "byte 4: .spz version 4 is not supported; save it as version 2 or 3"));
  CHECK(says(with(8, 0xffffffff, 4), "announces 4294967295 Gaussians"));
  CHECK(says(with(8, 4, 4), "announces 4 Gaussians"));
  CHECK(says(with(8, 2, 4), "goes on behind its last Gaussian"));
  CHECK(says(with(8, 0, 4), "no Gaussians"));
  CHECK(says(with(12, 4, 1), "SH degree 4"));
  CHECK(says(with(13, 31, 1), "fractional bits"));
  CHECK(says(error_of([&] { parse_spz(good, "plain.spz"); }), "version 4 (not gzip)"));
  CHECK(says(error_of([&] { parse_spz(bytes_of("hello"), "bad.spz"); }), "is not gzip data"));
  auto damaged = gzip(good);
  damaged[damaged.size() / 2] ^= std::byte(0x55);
  CHECK(!error_of([&] { parse_spz(damaged, "bad.spz"); }).empty());
  auto nan = spz_data(3, 1, 0);
  nan[17] = std::byte(0x7e), nan[16] = std::byte(1);
  CHECK(says(refusal(nan), "Gaussian 0: position has a value that is not finite"));
  auto extended = spz_data(3, 3, 1, 1, 3);
  for (int i = 0; i < 10000; ++i) put(extended, std::uint8_t(i));
  CHECK(parse_spz(gzip(extended), "e.spz").notes.size() == 2);
}
