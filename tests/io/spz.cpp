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

#if defined(GSP_WITH_ZSTD)
TEST_CASE(".spz: version 4, SH 0-3") {
  for (int degree = 0; degree <= 3; ++degree) {
    auto const data = spz_data(200, 4, degree, 3 + degree);
    auto const plain = decode(data, 200, 4, degree, 12);
    compare(parse_spz(spz4(data), "made.spz"), turned(plain, degree), plain);
  }
}

TEST_CASE(".spz version 4: bad input") {
  auto const good = spz4(spz_data(3, 4, 1));
  auto refusal = [](std::vector<std::byte> const& bytes) { return error_of([&] { parse_spz(bytes, "bad.spz"); }); };
  auto with = [&](std::size_t at, std::uint64_t value, std::size_t size) {
    auto bytes = good;
    std::memcpy(&bytes[at], &value, size);
    return refusal(bytes);
  };
  CHECK(refusal(good).empty());
  CHECK(accepted_truncations(good, [](Bytes b) { parse_spz(b, "cut.spz"); }) == 0);
  CHECK(says(with(4, 3, 4), "byte 4: .spz version 3 without gzip"));
  CHECK(says(with(4, 5, 4), "byte 4: .spz version 5 is not supported"));
  CHECK(says(with(8, 0xffffffff, 4), "announces 4294967295 Gaussians"));
  CHECK(says(with(8, 4, 4), "stream 0 announces 27 bytes where 4 Gaussians need 36"));
  CHECK(says(with(12, 4, 1), "SH degree 4"));
  CHECK(says(with(15, 5, 1), "has 5 streams where SH degree 1 needs 6"));
  CHECK(says(with(16, 31, 4), "byte 16: its table of streams"));
  CHECK(says(with(16, 0xffffffff, 4), "byte 16: its table of streams"));
  CHECK(says(with(32, ~0ull, 8), "byte 32: stream 0 of 18446744073709551615 bytes reaches beyond"));
  CHECK(says(with(40, 28, 8), "byte 40: stream 0 announces 28 bytes"));
  CHECK(says(with(32 + 96 + 6, 0xff, 1), "byte 128: stream 0 is damaged"));
  auto longer = good;
  longer.push_back({});
  CHECK(says(refusal(longer), "bytes follow the last stream"));
  // a million zeros pack to 40 bytes: no file as small as that is so many Gaussians
  std::vector<std::byte> zeros(16 + 1000000 * 20);
  std::uint32_t const head[3]{0x5053474e, 4, 1000000};
  std::memcpy(zeros.data(), head, 12);
  CHECK(says(refusal(spz4(zeros)), "announces 1000000 Gaussians (20000016 bytes unpacked), which a file of"));
  std::vector<std::byte> records;
  auto const record = [&](std::uint32_t type, std::uint32_t value) { put(records, type), put(records, 4u), put(records, value); };
  record(0xADBE0002, 7), record(0xADBE0003, 4);
  auto extended = spz_data(3, 4, 1, 1, 3);
  auto const set = parse_spz(spz4(extended, records), "e.spz");
  CHECK(set.notes.size() == 2);
  CHECK(set.antialiased);
  record(0xADBE0003, 7);
  CHECK(says(refusal(spz4(extended, records)), "SPZ_ADOBE_coordinate_system: its axes have number 7"));
  auto old = spz_data(3, 3, 1, 1, 2);
  old.insert(old.end(), records.begin(), records.end());
  CHECK(says(refusal(gzip(old)), "its axes have number 7"));
  // axes behind a long record of somebody else
  for (std::uint32_t const size : {70000u, 1u << 20}) {
    auto hidden = spz_data(3, 3, 1, 1, 2);
    put(hidden, 0x12345678u);
    put(hidden, size);
    hidden.resize(hidden.size() + size);
    hidden.insert(hidden.end(), records.begin(), records.end());
    CHECK(says(refusal(gzip(hidden)), size == 70000 ? "its axes have number 7" : "extensions: are more than 1 MiB"));
  }
}
#else
TEST_CASE(".spz version 4 without zstd is refused by a sentence") {
  auto bytes = spz_data(3, 4, 0);
  bytes[15] = std::byte(5);
  std::uint32_t const table = 32;
  std::vector<std::byte> file(32 + 80);
  std::copy_n(bytes.begin(), 16, file.begin());
  std::memcpy(&file[16], &table, 4);
  std::uint64_t const sizes[5]{27, 3, 9, 9, 12};
  for (std::size_t k = 0; k < 5; ++k) std::memcpy(&file[40 + 16 * k], &sizes[k], 8);
  CHECK(says(error_of([&] { parse_spz(file, "v4.spz"); }), "compiled without"));
}
#endif

// What a step of each field leaves, as format_spz says, and 1e-6 for floats.
TEST_CASE(".spz: what is written comes back within its steps") {
  for (int version = 2; version <= 4; ++version) {
#if !defined(GSP_WITH_ZSTD)
    if (version == 4) continue;
#endif
    for (int degree = 0; degree <= 3; ++degree) {
      auto set = random_set(300, degree, 5);
      set.antialiased = degree == 2;
      for (float& v : set.sh) v = std::clamp(v, -1.f, 1.f);
      if (degree == 3)
        for (float& v : set.positions) v *= 1000;  // fewer fraction bits
      SpzOptions const options{.version = version, .sh1_bits = 5 + degree, .sh_bits = 4 + degree};
      auto const bytes = format_spz(set, options);
      auto const again = parse_spz(bytes, "again.spz");
      REQUIRE(again.size() == set.size());
      CHECK(again.sh_degree == degree);
      CHECK(again.antialiased == set.antialiased);
      double most = 0, position = 0, scale = 0, opacity = 0, dc = 0, sh1 = 0, sh = 0, rotation = 0;
      for (std::size_t i = 0; i < set.positions.size(); ++i) {
        most = std::max(most, std::abs(double(set.positions[i])));
        position = std::max(position, std::abs(double(again.positions[i]) - set.positions[i]));
        scale = std::max(scale, std::abs(std::log(double(again.scales[i]) / set.scales[i])));
      }
      std::size_t const terms = set.sh_terms();
      for (std::size_t i = 0; i < set.size(); ++i) {
        opacity = std::max(opacity, std::abs(double(again.opacities[i]) - set.opacities[i]));
        for (std::size_t k = 0; k < 3 * terms; ++k) {
          double& worst = k < 3 ? dc : k < 12 ? sh1 : sh;
          worst = std::max(worst, std::abs(double(again.sh[3 * terms * i + k]) - set.sh[3 * terms * i + k]));
        }
        double plus = 0, minus = 0;  // q and -q are one rotation
        for (std::size_t k = 0; k < 4; ++k) {
          double const a = again.quats[4 * i + k], b = set.quats[4 * i + k];
          plus += (a - b) * (a - b), minus += (a + b) * (a + b);
        }
        rotation = std::max(rotation, std::sqrt(std::min(plus, minus)));
      }
      int bits = 12;
      while (most * std::pow(2.0, bits) > 8388607) --bits;
      CHECK((bits < 12) == (degree == 3));
      CHECK(position <= std::pow(2.0, -bits - 1) + 1e-6 * most);
      CHECK(scale <= 1. / 32 + 1e-6);
      CHECK(opacity <= 1. / 510 + 1e-6);
      CHECK(dc <= 1 / (2 * 255 * 0.15) + 1e-6);
      CHECK(sh1 <= (std::pow(2.0, 8 - options.sh1_bits) + 1) / 256 + 1e-6);
      CHECK(sh <= (std::pow(2.0, 8 - options.sh_bits) + 1) / 256 + 1e-6);
      // half a step e = 1 / (2 511 sqrt 2) in three components, |e| <= sqrt 3 e; the largest, >= 1/2, errs by at most sqrt 3 |e|
      CHECK(rotation <= (version == 2 ? 0.12 : 2 * std::sqrt(3.0) / (2 * 511 * std::sqrt(2.0)) + 1e-5));
    }
  }
  auto far = random_set(2, 0);
  far.positions[0] = 9e6f;
  CHECK(says(error_of([&] { format_spz(far, {.version = 3}); }), "passes 2^23"));
  far = random_set(2, 0);
  far.scales[3] = 500;
  CHECK(says(error_of([&] { format_spz(far, {.version = 3}); }), "Gaussian 1: has the scale 500"));
  far.scales[3] = std::exp(5.968f);  // within half a step of 255
  CHECK(std::abs(std::log(parse_spz(format_spz(far, {.version = 3}), "far.spz").scales[3]) - 5.968) <= 1. / 32 + 1e-6);
  far.scales[3] = std::exp(5.98f);
  CHECK(says(error_of([&] { format_spz(far, {.version = 3}); }), ".spz holds at most 391"));
  Folder folder;
  CHECK(says(error_of([&] { write_spz(folder.path / "far.spz", far); }), "far.spz: Gaussian 1: has the scale"));
  CHECK_THROWS_AS(format_spz(random_set(2, 0), {.version = 1}), std::invalid_argument);
  CHECK_THROWS_AS(format_spz(random_set(2, 0), {.version = 3, .sh_bits = 0}), std::invalid_argument);
}

TEST_CASE(".spz: mutated files") {
  std::vector<std::vector<std::byte>> seeds;
  for (int version = 1; version <= 3; ++version) seeds.push_back(gzip(spz_data(4, version, 1)));
#if defined(GSP_WITH_ZSTD)
  for (int degree = 0; degree <= 3; ++degree) seeds.push_back(spz4(spz_data(4, 4, degree)));
#endif
  check_mutations(seeds, 4000, [](Bytes b) { return parse_spz(b, "m.spz"); });
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
  CHECK(says(with(4, 5, 4), "byte 4: .spz version 5 is not supported; save it as version 2, 3 or 4"));
  CHECK(says(with(8, 0xffffffff, 4), "announces 4294967295 Gaussians"));
  CHECK(says(with(8, 4, 4), "announces 4 Gaussians"));
  CHECK(says(with(8, 2, 4), "goes on behind its last Gaussian"));
  CHECK(says(with(8, 0, 4), "no Gaussians"));
  CHECK(says(with(12, 4, 1), "SH degree 4"));
  CHECK(says(with(13, 31, 1), "fractional bits"));
  CHECK(says(error_of([&] { parse_spz(good, "plain.spz"); }), "version 3 without gzip"));
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
