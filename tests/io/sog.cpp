#include <doctest/doctest.h>

#include <gsp/io/detail/sog_tables.hpp>
#include <gsp/io/detail/zip.hpp>
#include <gsp/io/file.hpp>
#include <gsp/io/sog.hpp>
#include <gsp/io/splat_order.hpp>
#include <io/fixtures.hpp>
#include <nlohmann/json.hpp>
#include <set>

#if defined(GSP_WITH_WEBP)
#include <webp/encode.h>
#endif

using namespace gsp::io;
using namespace gsp_test;
using Json = nlohmann::ordered_json;

namespace {
std::vector<std::byte> zip(std::vector<std::pair<std::string, std::vector<std::byte>>> const& files, bool deflated = false) {
  std::vector<std::byte> out;
  std::vector<detail::ZipRecord> records;
  for (auto const& [name, bytes] : files) {
    auto const packed = deflated ? detail::deflate(bytes, detail::Wrapper::raw) : bytes;
    records.push_back({name, detail::crc32(bytes), packed.size(), bytes.size(), out.size(), deflated});
    for (char c : detail::zip_local(records.back())) put(out, c);
    out.insert(out.end(), packed.begin(), packed.end());
  }
  for (char c : detail::zip_tail(records, out.size())) put(out, c);
  return out;
}
}  // namespace

#if defined(GSP_WITH_WEBP)
namespace {

std::vector<std::byte> webp(std::vector<std::uint8_t> const& rgba, int width) {
  std::uint8_t* data = nullptr;
  std::size_t const size = WebPEncodeLosslessRGBA(rgba.data(), width, int(rgba.size() / 4) / width, 4 * width, &data);
  auto const* const from = reinterpret_cast<std::byte const*>(data);
  std::vector<std::byte> const out(from, from + size);
  WebPFree(data);
  return out;
}

/// A file of random bytes in version 1 or 2, from the format's description, and the set that it is, in double.
struct Made {
  std::map<std::string, std::vector<std::byte>> pictures;
  Json meta;
  SplatSet set;
  std::vector<std::byte> bundle(std::string const& folder = "", bool deflated = false) const {
    std::vector<std::pair<std::string, std::vector<std::byte>>> files{{folder + "meta.json", bytes_of(meta.dump())}};
    for (auto const& [name, bytes] : pictures) files.emplace_back(folder + name, bytes);
    return zip(files, deflated);
  }
};
Made made(int version, std::size_t n, int degree, unsigned seed = 1) {
  std::mt19937 random(seed);
  Made m;
  m.set = make_splat_set(n, degree);
  int const width = 4 * int((std::size_t(std::ceil(std::sqrt(double(n)))) + 3) / 4);
  std::size_t const pixels = std::size_t(width) * ((n + std::size_t(width) - 1) / std::size_t(width) + 1);
  auto const noise = [&](std::size_t count, auto const& alpha) {
    std::vector<std::uint8_t> v(4 * count);
    for (std::size_t i = 0; i < v.size(); ++i) v[i] = i % 4 == 3 ? std::uint8_t(alpha()) : std::uint8_t(random());
    return v;
  };
  auto const opaque = [] { return 255; };
  auto const low = noise(pixels, opaque), high = noise(pixels, opaque), scales = noise(pixels, opaque);
  auto const quats = noise(pixels, [&] { return 252 + random() % 4; }), sh0 = noise(pixels, [&] { return 1 + random() % 255; });
  m.pictures = {{"l.webp", webp(low, width)},
                {"u.webp", webp(high, width)},
                {"q.webp", webp(quats, width)},
                {"s.webp", webp(scales, width)},
                {"c.webp", webp(sh0, width)}};
  double const mins[3]{-1.5, -2, 0.25}, maxs[3]{1.25, 3, 2};
  std::vector<double> scale_book, dc_book, sh_book;
  for (int k = 0; k < 256; ++k) scale_book.push_back(-9 + 0.03 * k), dc_book.push_back(-2 + 0.02 * k), sh_book.push_back(std::sin(k * 0.7));
  m.meta["means"] = {{"mins", mins}, {"maxs", maxs}, {"files", Json::array({"l.webp", "u.webp"})}};
  m.meta["quats"] = {{"files", Json::array({"q.webp"})}};
  m.meta["scales"] = {{"files", Json::array({"s.webp"})}};
  m.meta["sh0"] = {{"files", Json::array({"c.webp"})}};
  double const slow[3]{-9, -8, -7}, shigh[3]{-2, -1, 0}, clow[4]{-1, -2, -3, -4}, chigh[4]{1, 2, 3, 5};
  if (version == 1) {
    m.meta["means"]["shape"] = {n, 3};
    m.meta["scales"]["mins"] = slow, m.meta["scales"]["maxs"] = shigh;
    m.meta["sh0"]["mins"] = clow, m.meta["sh0"]["maxs"] = chigh;
  } else {
    m.meta["version"] = 2;
    m.meta["count"] = n;
    m.meta["scales"]["codebook"] = scale_book;
    m.meta["sh0"]["codebook"] = dc_book;
  }
  std::size_t const terms = m.set.sh_terms(), rest = terms - 1, groups = 130;
  std::vector<std::uint8_t> labels, centroids;
  if (degree > 0) {
    centroids = noise(64 * rest * 3, opaque);
    labels = noise(pixels, opaque);
    for (std::size_t i = 0; i < pixels; ++i) labels[4 * i] = std::uint8_t(random() % groups), labels[4 * i + 1] = 0;
    m.pictures["p.webp"] = webp(centroids, int(64 * rest));
    m.pictures["i.webp"] = webp(labels, width);
    m.meta["shN"] = {{"files", Json::array({"p.webp", "i.webp"})}};
    if (version == 1)
      m.meta["shN"]["mins"] = -1.5, m.meta["shN"]["maxs"] = 2;
    else
      m.meta["shN"]["count"] = groups, m.meta["shN"]["bands"] = degree, m.meta["shN"]["codebook"] = sh_book;
  }
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t k = 0; k < 3; ++k) {
      double const v = mins[k] + (maxs[k] - mins[k]) * (low[4 * i + k] + 256.0 * high[4 * i + k]) / 65535;
      m.set.positions[3 * i + k] = float(v < 0 ? -(std::exp(-v) - 1) : std::exp(v) - 1);
      int const s = scales[4 * i + k], c = sh0[4 * i + k];
      m.set.scales[3 * i + k] = float(std::exp(version == 1 ? slow[k] + (shigh[k] - slow[k]) * s / 255 : scale_book[std::size_t(s)]));
      m.set.sh[3 * terms * i + k] = float(version == 1 ? clow[k] + (chigh[k] - clow[k]) * c / 255 : dc_book[std::size_t(c)]);
    }
    double const a = sh0[4 * i + 3] / 255.0;
    m.set.opacities[i] = float(version == 1 ? 1 / (1 + std::exp(-(clow[3] + (chigh[3] - clow[3]) * a))) : a);
    int const largest = quats[4 * i + 3] - 252;
    double q[4], sum = 0;
    int from = 0;
    for (int k = 0; k < 4; ++k)
      if (k != largest) q[k] = (quats[4 * i + std::size_t(from++)] * 2 / 255.0 - 1) / std::sqrt(2.0), sum += q[k] * q[k];
    q[largest] = std::sqrt(std::max(0.0, 1 - sum));
    double const norm = std::sqrt(sum + q[largest] * q[largest]);
    for (int k = 0; k < 4; ++k) m.set.quats[4 * i + std::size_t(k)] = float(q[k] / norm);
    for (std::size_t j = 0; j < rest; ++j)
      for (std::size_t k = 0; k < 3; ++k) {
        std::size_t const label = labels[4 * i], row = label / 64, column = label % 64 * rest + j;
        int const b = centroids[4 * (row * 64 * rest + column) + k];
        m.set.sh[3 * (terms * i + 1 + j) + k] = float(version == 1 ? -1.5 + 3.5 * b / 255 : sh_book[std::size_t(b)]);
      }
  }
  return m;
}

}  // namespace

TEST_CASE("SOG: versions 1 and 2, SH 0-3, as a bundle and beside a meta.json") {
  Folder folder;
  for (int version = 1; version <= 2; ++version)
    for (int degree = 0; degree <= 3; ++degree) {
      auto const m = made(version, 150, degree, unsigned(10 * version + degree));
      for (auto const& [name, bytes] : m.pictures) write_file(folder.path / name, bytes);
      write_file(folder.path / "meta.json", bytes_of(m.meta.dump(2)));
      for (auto const& read :
           {parse_sog(m.bundle(), "made.sog"), parse_sog(m.bundle("inside/", true), "made.sog"), read_sog(folder.path / "meta.json")}) {
        auto const a = apart(read, m.set);  // each number is rounded to float once; exp and its inverse on top of it
        CHECK(a.position <= 20 * 0x1p-23);
        CHECK(a.log_scale <= 0x1p-22);
        CHECK(a.rotation <= 0x1p-22);
        CHECK(a.opacity <= 0x1p-23);
        CHECK(a.dc <= 0x1p-22);
        CHECK(a.sh <= 0x1p-22);
      }
    }
}

// Half of 1/65535 of the range of log(1 + |x|), times 1 + |x|; opacity half of 1/255; rotations half of 2 / (255 sqrt 2) in three
// components and sqrt 3 of that in the largest. A codebook's sum of squares is that of equal steps over the range at most: their half, as a
// root mean square.
TEST_CASE("SOG: what is written comes back within its steps") {
  Folder folder;
  for (int degree = 0; degree <= 3; ++degree) {
    auto set = random_set(3000, degree, unsigned(30 + degree));
    set.antialiased = degree == 1;
    auto const again = parse_sog(format_sog(set), "again.sog");
    auto const a = apart(again, set);
    double position = 0;
    for (std::size_t k = 0; k < 3; ++k) {
      double low = INFINITY, high = -INFINITY, most = 0;
      for (std::size_t i = 0; i < set.size(); ++i) {
        double const x = set.positions[3 * i + k], v = std::copysign(std::log1p(std::abs(x)), x);
        low = std::min(low, v), high = std::max(high, v), most = std::max(most, std::abs(x));
      }
      position = std::max(position, (1 + most) * std::expm1((high - low) / 65535 / 2));
    }
    CHECK(a.position <= position + 1e-6);
    CHECK(a.opacity <= 1. / 510 + 1e-6);
    CHECK(a.rotation <= 2 * std::sqrt(3.0) / (255 * std::sqrt(2.0)) + 1e-5);
    CHECK(again.antialiased == set.antialiased);
    auto const check_rms = [](auto const& error, auto const& value, std::size_t count) {
      double sum = 0, low = INFINITY, high = -INFINITY;
      for (std::size_t j = 0; j < count; ++j) {
        sum += error(j) * error(j);
        low = std::min(low, value(j)), high = std::max(high, value(j));
      }
      CHECK(std::sqrt(sum / double(count)) <= (high - low) / 255 / 2 + 1e-6);
      CHECK(std::sqrt(sum / double(count)) > 0);
    };
    auto const log_scale = [](SplatSet const& s, std::size_t j) { return std::log(double(s.scales[j])); };
    check_rms([&](std::size_t j) { return log_scale(again, j) - log_scale(set, j); }, [&](std::size_t j) { return log_scale(set, j); },
              3 * set.size());
    std::size_t const w = 3 * set.sh_terms();
    auto const dc = [w](SplatSet const& s, std::size_t j) { return double(s.sh[w * (j / 3) + j % 3]); };
    check_rms([&](std::size_t j) { return dc(again, j) - dc(set, j); }, [&](std::size_t j) { return dc(set, j); }, 3 * set.size());
    if (degree > 0) {  // each Gaussian has its own coefficients: what the codebook leaves
      auto const sh = [w](SplatSet const& s, std::size_t j) { return double(s.sh[w * (j / (w - 3)) + 3 + j % (w - 3)]); };
      check_rms([&](std::size_t j) { return sh(again, j) - sh(set, j); }, [&](std::size_t j) { return sh(set, j); }, (w - 3) * set.size());
    }
    write_sog(folder.path / "meta.json", set);
    CHECK(read_sog(folder.path / "meta.json").positions == again.positions);
    CHECK(format_sog(set) == format_sog(set));
  }
  SplatSet one = make_splat_set(1, 1);  // nothing varies
  one.scales = {1, 1, 1};
  CHECK(apart(parse_sog(format_sog(one), "one.sog"), one).position == 0);
}

TEST_CASE("SOG: bad input") {
  auto const good = made(2, 20, 1);
  auto refusal = [&](auto const& change) {
    auto m = good;
    change(m);
    return error_of([&] { parse_sog(m.bundle(), "bad.sog"); });
  };
  CHECK(refusal([](Made&) {}).empty());
  CHECK(accepted_truncations(good.bundle(), [](Bytes b) { parse_sog(b, "cut.sog"); }) == 0);
  CHECK(says(refusal([](Made& m) { m.meta["version"] = 3; }), "meta.json: is SOG version 3, and 1 (without the key"));
  CHECK(says(refusal([](Made& m) { m.meta["count"] = 2000000; }), "which no real ones fit in"));
  CHECK(says(refusal([](Made& m) { m.meta["count"] = 100; }), "too small for 100 Gaussians"));
  CHECK(says(refusal([](Made& m) { m.meta["count"] = 0; }), "holds no Gaussians"));
  CHECK(says(refusal([](Made& m) { m.meta["count"] = -1; }), "\"count\" must be a whole number"));
  CHECK(says(refusal([](Made& m) { m.meta.erase("quats"); }), "quats: is missing"));
  CHECK(says(refusal([](Made& m) { m.meta["means"]["mins"] = {0, 0}; }), "means: \"mins\" must be 3 finite numbers"));
  CHECK(says(refusal([](Made& m) { m.meta["means"]["maxs"][1] = 1e9; }), "position has a value that is not finite"));
  CHECK(says(refusal([](Made& m) { m.meta["scales"]["codebook"].erase(0); }), "scales: \"codebook\" must be 256 finite numbers"));
  CHECK(says(refusal([](Made& m) { m.meta["means"]["files"] = {"l.webp"}; }), "means: \"files\" must name 2 pictures"));
  CHECK(says(refusal([](Made& m) { m.meta["sh0"]["files"] = {"none.webp"}; }), "the picture 'none.webp' is not in the file"));
  CHECK(says(refusal([](Made& m) { m.meta["shN"]["bands"] = 2; }), "has 2 bands, and a picture for 1"));
  CHECK(says(refusal([](Made& m) { m.meta["shN"]["count"] = 3; }), "and there are 3"));
  CHECK(says(refusal([](Made& m) { m.pictures["p.webp"] = m.pictures["i.webp"]; }), "192, 512 or 960 wide"));
  CHECK(says(refusal([](Made& m) { m.pictures["c.webp"] = bytes_of("nothing"); }), "bad.sog['c.webp']: byte 0: is no WebP picture"));
  CHECK(says(refusal([](Made& m) { m.pictures["c.webp"].resize(m.pictures["c.webp"].size() / 2); }), "bad.sog['c.webp']"));
  CHECK(says(refusal([](Made& m) { m.pictures["q.webp"] = m.pictures["c.webp"]; }), "its rotation has the mark"));
  CHECK(says(refusal([](Made& m) { m.pictures["c.webp"] = webp(std::vector<std::uint8_t>(4 * 1000 * 1000, 255), 1000); }),
             "far too large for 20 Gaussians"));
  std::vector<std::uint8_t> const grey(4 * 400, 77);
  std::uint8_t* data = nullptr;
  std::size_t const size = WebPEncodeRGBA(grey.data(), 20, 20, 80, 50, &data);
  auto lossy = good;
  lossy.pictures["s.webp"].assign(reinterpret_cast<std::byte*>(data), reinterpret_cast<std::byte*>(data) + size);
  WebPFree(data);
  CHECK(says(error_of([&] { parse_sog(lossy.bundle(), "bad.sog"); }), "bad.sog['s.webp']: is lossy"));
  CHECK(
      says(error_of([&] { parse_sog(bytes_of(good.meta.dump()), "meta.json"); }), "names the file 'l.webp', and only one file was given"));
  auto outside = good.meta;
  outside["quats"]["files"] = {"../q.webp"};
  Folder folder;
  for (auto const& [name, bytes] : good.pictures) write_file(folder.path / name, bytes);
  CHECK(says(error_of([&] { parse_sog(bytes_of(outside.dump()), "meta.json", folder.path); }), "is no path below the file's own folder"));
  CHECK(says(error_of([&] { parse_sog(zip({{"a", {}}}), "bad.sog"); }), "holds no meta.json"));
  CHECK(says(error_of([&] { parse_sog(zip({{"meta.json", bytes_of("{")}}), "bad.sog"); }), "bad.sog: line 1: is not valid JSON"));
  auto const text = bytes_of("{}");
  CHECK(says(error_of([&] { parse_sog(zip({{"a/meta.json", text}, {"b/meta.json", text}}), "bad.sog"); }), "is a second meta.json"));
  CHECK(says(error_of([&] { write_sog(folder.path / "small_meta.json", make_splat_set(1, 0)); }), "must be called meta.json"));
}

TEST_CASE("SOG: mutated files") {
  std::vector<std::vector<std::byte>> seeds;
  for (int version = 1; version <= 2; ++version) seeds.push_back(made(version, 5, 1).bundle());
  check_mutations(seeds, 1000, [](Bytes b) { return parse_sog(b, "m.sog"); });  // most meet a checksum
  for (int version = 1; version <= 2; ++version) {  // what the checksums guard: the text, and each picture, in a sound archive
    auto const m = made(version, 5, 1);
    check_mutations({bytes_of(m.meta.dump())}, 1000, [&](Bytes b) {
      auto files = std::vector<std::pair<std::string, std::vector<std::byte>>>{{"meta.json", {b.begin(), b.end()}}};
      files.insert(files.end(), m.pictures.begin(), m.pictures.end());
      return parse_sog(zip(files), "m.sog");
    });
    for (auto const& [name, bytes] : m.pictures)
      check_mutations({bytes}, 200, [&](Bytes b) {
        auto changed = m;
        changed.pictures[name].assign(b.begin(), b.end());
        return parse_sog(changed.bundle(), "m.sog");
      });
  }
}
#else
TEST_CASE("SOG without libwebp is refused by a sentence") {
  CHECK(says(error_of([] { format_sog(random_set(3, 0)); }), "compiled without"));
  auto const meta = bytes_of(
      R"({"version": 2, "count": 1, "means": {"mins": [0, 0, 0], "maxs": [1, 1, 1], "files": ["a", "a"]}, "quats": {"files": ["a"]},
                               "scales": {"files": ["a"]}, "sh0": {"files": ["a"]}})");
  CHECK(says(error_of([&] { parse_sog(zip({{"meta.json", meta}, {"a", bytes_of("?")}}), "a.sog"); }), "compiled without"));
}
#endif

TEST_CASE("a codebook leaves less than equal steps, and 256 different values nothing") {
  std::mt19937 random(4);
  std::normal_distribution<float> normal;
  std::vector<float> values(10000);
  for (float& v : values) v = normal(random);
  values[5] = 40;  // a lone one that equal steps would waste most values on
  auto const left = [&](std::vector<float> const& book) {
    double sum = 0;
    for (float v : values) sum += std::pow(double(v) - book[detail::nearest_code(book, v)], 2);
    return sum;
  };
  auto const book = detail::make_codebook(values);
  REQUIRE(book.size() == 256);
  CHECK(std::is_sorted(book.begin(), book.end()));
  auto const [low, high] = std::minmax_element(values.begin(), values.end());
  std::vector<float> equal;
  for (int k = 0; k < 256; ++k) equal.push_back(*low + (*high - *low) * float(k) / 255);
  CHECK(left(book) < 0.05 * left(equal));
  for (std::size_t i = 0; i < values.size(); ++i) values[i] = float(i % 256 * i % 256);
  CHECK(left(detail::make_codebook(values)) < 1e-6);
  for (float v : {-1e6f, 0.f, 321.f, 1e6f}) {  // nearest, by a plain search
    std::size_t best = 0;
    for (std::size_t k = 1; k < 256; ++k)
      if (std::abs(double(v) - book[k]) < std::abs(double(v) - book[best])) best = k;
    CHECK(detail::nearest_code(book, v) == best);
  }
}

TEST_CASE("groups of rows: few leave more than many, as many as rows leave nothing") {
  auto const set = random_set(700, 2, 6);
  double before = INFINITY;
  for (std::size_t most : {1, 10, 100, 700, 900}) {
    std::vector<float> means;
    auto const group = detail::make_groups(&set.sh[3], 700, 27, 24, most, means);
    CHECK(means.size() / 24 == std::min<std::size_t>(most, 700));
    CHECK(std::set<std::uint32_t>(group.begin(), group.end()).size() == means.size() / 24);
    double error = 0;
    for (std::size_t i = 0; i < 700; ++i)
      for (std::size_t k = 0; k < 24; ++k) error += std::pow(double(set.sh[27 * i + 3 + k]) - means[24 * group[i] + k], 2);
    CHECK(error <= before);
    if (most >= 700) CHECK(error == 0);
    before = error;
  }
  std::vector<float> same(27 * 50, 0.25f), means;  // all alike: one group
  detail::make_groups(same.data(), 50, 27, 27, 20, means);
  CHECK(means.size() == 27);
}
