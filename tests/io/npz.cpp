#include <doctest/doctest.h>

#include <gsp/io/npz.hpp>
#include <io/fixtures.hpp>
#include <support/skip.hpp>

using namespace gsp::io;
using namespace gsp_test;

namespace {
std::vector<std::byte> written(std::vector<NpzEntry> const& entries, NpzOptions options = {}) {
  Folder folder;
  write_npz(folder.path / "a.npz", entries, options);
  CHECK(folder.files() == 1);
  return read_file(folder.path / "a.npz");
}
std::vector<double> const poses{1, 2, 3, 4, 5, 6};
std::vector<float> const image(3000, 0.25f);
std::vector<NpzEntry> entries() { return {{"qpos", {{1, 2, 3}, poses}}, {"rgb", {{10, 100, 3}, image}}}; }
}  // namespace

TEST_CASE("npz: what is written comes back, stored and deflated, the same bytes each time") {
  for (int level : {0, 1, 9}) {
    auto const bytes = written(entries(), {level});
    CHECK(bytes == written(entries(), {level}));
    CHECK((bytes.size() < 2000) == (level > 0));
    Npz const npz = parse_npz(bytes, "a.npz");
    CHECK(npz.arrays.size() == 2);
    CHECK(npz.at("qpos").shape == std::vector<std::size_t>{1, 2, 3});
    CHECK(npz.at("qpos").as<double>() == poses);
    CHECK(npz.at("rgb").as<float>() == image);
    std::vector<double> const none;
    auto const nothing = written({{"none", {{0, 3}, none}}, {"qpos", {{6}, poses}}}, {level});
    CHECK(parse_npz(nothing, "b.npz").at("none").shape == std::vector<std::size_t>{0, 3});
    CHECK(says(error_of([&] { npz.at("depth"); }), "a.npz: has no array 'depth' (it has: qpos, rgb); add it"));
  }
  CHECK(parse_npz(written({}), "none").arrays.empty());
}

TEST_CASE("npz: temporaries are kept until they are written") {
  std::vector<NpzEntry> list;
  for (int i = 0; i < 3; ++i) {
    list.push_back({"v" + std::to_string(i), {{1000}, std::vector<double>(1000, i)}});
    list.push_back({"a" + std::to_string(i), make_npy({1000}, std::vector<double>(1000, 10 + i))});
  }
  auto const copy = list;
  list.clear();
  Npz const npz = parse_npz(written(copy), "a.npz");
  for (int i = 0; i < 3; ++i) {
    CHECK(npz.at("v" + std::to_string(i)).as<double>() == std::vector<double>(1000, i));
    CHECK(npz.at("a" + std::to_string(i)).as<double>() == std::vector<double>(1000, 10 + i));
  }
}

TEST_CASE("npz: a failed write leaves nothing") {
  Folder folder;
  auto const path = folder.path / "a.npz";
  CHECK_THROWS_AS(write_npz(path, {{"a", {{2}, poses}}}), std::invalid_argument);
  CHECK_THROWS_AS(write_npz(path, {{"a", {{6}, poses}}, {"a", {{6}, poses}}}), std::invalid_argument);
  NpyView huge;  // claims 5 GiB that are never touched: the size is refused first
  huge.dtype = Dtype::u1;
  huge.shape = {5ull << 30};
  huge.bytes = Bytes(reinterpret_cast<std::byte const*>(poses.data()), 5ull << 30);
  CHECK(says(error_of([&] { write_npz(path, {{"rgb", huge}}); }), "would pass 4 GiB"));
  CHECK(folder.files() == 0);
}

TEST_CASE("npz: bad input") {
  auto const parse = [](Bytes b) { parse_npz(b, "bad.npz"); };
  for (int level : {0, 6}) {
    auto const good = written({{"a", {{6}, poses}}, {"b", {{2, 3}, poses}}}, {level});
    CHECK(accepted_truncations(good, parse) == 0);
    // Every damaged byte is noticed, or the arrays are unharmed (time stamps, version fields and the like).
    auto const intact = parse_npz(good, "good.npz");
    int harmed = 0;
    for (std::size_t i = 0; i < good.size(); ++i)
      for (int bit : {1, 16, 128}) {
        auto damaged = good;
        damaged[i] ^= std::byte(bit);
        error_of([&] {
          auto const npz = parse_npz(damaged, "bad.npz");
          for (auto const& [name, array] : npz.arrays) {
            bool same = false;
            for (auto const& [other, b] : intact.arrays) same |= array.bytes == b.bytes && array.shape == b.shape;
            harmed += !same;
          }
        });
      }
    CHECK(harmed == 0);
  }
  auto patched = [&](char const* magic, std::size_t offset, std::uint32_t value, std::size_t size) {
    auto bytes = written({{"a", {{6}, poses}}});
    std::string_view const text(reinterpret_cast<char const*>(bytes.data()), bytes.size());
    std::memcpy(&bytes[text.rfind(magic) + offset], &value, size);
    return error_of([&] { parse(bytes); });
  };
  CHECK(says(patched("PK\1\2", 8, 1, 2), "encrypted"));
  CHECK(says(patched("PK\1\2", 10, 12, 2), "zip method 12"));
  CHECK(says(patched("PK\1\2", 24, 0xffffffff, 4), "zip64"));
  CHECK(says(patched("PK\5\6", 16, 0xffffffff, 4), "zip64"));
  CHECK(says(patched("PK\1\2", 42, 1, 4), "no zip entry there"));
  CHECK(says(patched("PK\1\2", 46, 0x78787878, 4), "not a .npy array"));
  CHECK(says(patched("PK\1\2", 16, 0, 4), "checksum"));
  CHECK(says(patched("PK\5\6", 10, 2, 2), "zip directory is damaged"));
  CHECK(says(error_of([&] { parse(bytes_of("not a zip at all, but longer than its end record")); }), "no zip directory"));
}

TEST_CASE("npz: numpy reads ours and we read numpy's" * doctest::test_suite("data")) {
  Folder folder;
  write_npz(folder.path / "stored.npz", entries());
  write_npz(folder.path / "packed.npz", entries(), {6});
  bool ok = false;
  std::string const p = folder.path.string();
  if (!run_numpy("import numpy as n\nfor f in ('stored', 'packed'):\n  a = n.load('" + p +
                     "/' + f + '.npz'); assert sorted(a.files) == ['qpos', 'rgb'] and a['qpos'].tolist() == [[[1, 2, 3], [4, 5, 6]]] and "
                     "a['rgb'].shape == (10, 100, 3) and (a['rgb'] == .25).all()\n" +
                     "n.savez('" + p + "/a', viewmats=n.eye(4)[None], Ks=n.ones((1, 3, 3), n.float32)); n.savez_compressed('" + p +
                     "/b', qpos=n.arange(1000.).reshape(10, 10, 10).T)",
                 ok)) {
    gsp_test::skip("python3 has no numpy (GSP_PYTHON names another python)");
    return;
  }
  REQUIRE(ok);
  auto const a = read_npz(folder.path / "a.npz");
  CHECK_NOTHROW(expect_shape(a.at("viewmats"), {-1, 4, 4}, "a"));
  CHECK(a.at("viewmats").as<float>()[5] == 1);
  CHECK(a.at("Ks").dtype == Dtype::f4);
  auto const b = read_npz(folder.path / "b.npz").at("qpos").as<double>();
  CHECK(b[1] == 100);
  CHECK(b[100] == 1);
}
