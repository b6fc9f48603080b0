#include <doctest/doctest.h>

#include <gsp/io/file.hpp>
#include <gsp/io/splats.hpp>
#include <io/fixtures.hpp>

using namespace gsp::io;
using namespace gsp_test;

TEST_CASE("read_splats knows the format by content") {
  Folder folder;
  SplatSet const set = random_set(40, 2);
  write_ply(folder.path / "a.anything", set);
  write_file(folder.path / "b", gzip(spz_data(20, 2, 1)));
  write_file(folder.path / "c.ply", compressed_ply(10, 18, 0));
  write_file(folder.path / "d.splat", std::vector<std::byte>(64, std::byte(60)));
  CHECK(read_splats(folder.path / "a.anything").size() == 40);
  CHECK(read_splats(folder.path / "b").size() == 20);
  CHECK(read_splats(folder.path / "c.ply").size() == 10);
  CHECK(read_splats(folder.path / "d.splat").size() == 2);
  write_file(folder.path / "e.xml", bytes_of("<mujoco/>"));
  CHECK(says(error_of([&] { read_splats(folder.path / "e.xml"); }), "e.xml: byte 0: is no file of Gaussians"));
  write_file(folder.path / "f.ply", {});
  CHECK(says(error_of([&] { read_splats(folder.path / "f.ply"); }), "empty"));
  CHECK(says(error_of([&] { read_splats(folder.path / "g.ply"); }), "no such file"));
}

TEST_CASE("a sidecar binds ranges to links") {
  Folder folder;
  write_ply(folder.path / "go2.ply", random_set(10, 0));
  write_file(
      folder.path / "go2.links.json",
      bytes_of(
          R"({"links": [{"name": "FL_foot", "first": 2, "count": 3}, {"name": "trunk", "first": 8, "count": 2}, {"name": "FL_foot", "first": 0, "count": 1}]})"));
  SplatSet const set = read_splats(folder.path / "go2.ply");
  CHECK(set.link_names == std::vector<std::string>{"FL_foot", "trunk"});
  CHECK(set.link == std::vector<int>{0, -1, 0, 0, 0, -1, -1, -1, 1, 1});
  write_file(folder.path / "go2.links.json", bytes_of(R"({"links": [{"name": "FL_foot", "first": 2, "count": 9}]})"));
  CHECK(says(error_of([&] { read_splats(folder.path / "go2.ply"); }),
             "go2.links.json: links[0] ('FL_foot'): first 2 and count 9 leave the 10 Gaussians"));
}

TEST_CASE("sidecar: bad input") {
  auto refusal = [](std::string const& text) {
    return error_of([&] {
      SplatSet set = random_set(10, 0);
      bind_links(set, parse_links(bytes_of(text), "s.json"), "s.json");
    });
  };
  std::string const good = R"({"links": [{"name": "a", "first": 0, "count": 4}]})";
  CHECK(refusal(good).empty());
  CHECK(accepted_truncations(bytes_of(good), [](Bytes b) { parse_links(b, "cut.json"); }) == 0);
  CHECK(says(refusal("{\"links\":\n [}"), "s.json: line 2: is not valid JSON"));
  CHECK(says(refusal("[]"), "must be {\"links\""));
  CHECK(says(refusal(R"({"links": [], "more": 1})"), "must be {\"links\""));
  CHECK(says(refusal(R"({"links": [{"name": "a", "first": 0}]})"), "links[0]: must have exactly"));
  CHECK(says(refusal(R"({"links": [{"name": "", "first": 0, "count": 1}]})"), "\"name\""));
  CHECK(says(refusal(R"({"links": [{"name": "a", "first": -1, "count": 1}]})"), "\"first\" must be a whole number"));
  CHECK(says(refusal(R"({"links": [{"name": "a", "first": 0, "count": 1.5}]})"), "\"count\" must be a whole number"));
  CHECK(says(refusal(R"({"links": [{"name": "a", "first": 18446744073709551615, "count": 18446744073709551615}]})"), "leave the 10"));
  CHECK(says(refusal(R"({"links": [{"name": "a", "first": 0, "count": 4}, {"name": "b", "first": 3, "count": 1}]})"),
             "Gaussian 3 is already bound to 'a'"));
  CHECK(says(refusal(R"({"links": [{"name": "a\nb", "first": 0, "count": 4}]})"), "control characters"));
  CHECK(says(refusal(std::string(100000, '[')), "is not valid JSON"));
  CHECK(says(refusal(R"({"links": [{"name": "a", "first": 1E11111, "count": 1}]})"), "s.json: has a number that no double can hold"));
}

TEST_CASE("write_splats: each format by its ending, links beside it, and what is left out is said") {
  Folder folder;
  auto set = random_set(300, 1, 21);
  set.link_names = {"arm", "foot"};
  for (std::size_t i = 10; i < 20; ++i) set.link[i] = 1;
  for (std::size_t i = 20; i < 30; ++i) set.link[i] = 0;
  set.antialiased = true;
  auto const plain = [](SplatSet s) {
    s.link.assign(s.size(), -1), s.link_names.clear();
    return s;
  };
  CHECK(write_splats(folder.path / "a.ply", set).empty());
  auto again = read_splats(folder.path / "a.ply");
  CHECK(again.link == set.link);
  CHECK(again.antialiased);
  CHECK(!std::filesystem::exists(folder.path / "a.links.json"));
  CHECK(write_splats(folder.path / "b.spz", set, {.spz = {.version = 3}}).empty());
  again = read_splats(folder.path / "b.spz");
  CHECK(again.link_names == std::vector<std::string>{"foot", "arm"});  // as they come
  CHECK(again.link[10] == 0);
  CHECK(again.link[29] == 1);
  CHECK(again.link[30] == -1);
  auto const notes = write_splats(folder.path / "c.splat", set);
  REQUIRE(notes.size() == 2);
  CHECK(says(notes[0], "c.splat: the flag 'antialiased' is left out"));
  CHECK(says(notes[1], "SH terms above degree 0 are left out"));
  again = read_splats(folder.path / "c.splat");
  CHECK(again.sh_degree == 0);
  CHECK(again.link[15] == 0);
  CHECK(write_splats(folder.path / "d.compressed.ply", set).empty());
  again = read_splats(folder.path / "d.compressed.ply");
  CHECK(again.size() == 300);
  CHECK(std::count(again.link.begin(), again.link.end(), 1) == 10);

  for (char const* file : {"f.glb", "f.gltf", "f.usda"}) {
    CHECK(write_splats(folder.path / file, set).size() == 1);  // the flag
    again = read_splats(folder.path / file);
    CHECK(again.positions == set.positions);
    CHECK(again.link[10] == 0);
  }

#if defined(GSP_WITH_WEBP)
  CHECK(write_splats(folder.path / "g.sog", set).empty());
  again = read_splats(folder.path / "g.sog");
  CHECK(again.antialiased);
  CHECK(std::count(again.link.begin(), again.link.end(), 0) == 10);
  CHECK(std::count(again.link.begin(), again.link.end(), 1) == 10);
  std::filesystem::create_directory(folder.path / "sog");
  CHECK(write_splats(folder.path / "sog" / "meta.json", set).empty());
  CHECK(read_splats(folder.path / "sog" / "meta.json").positions == again.positions);
#endif

  // a sidecar that would bind others
  CHECK(says(error_of([&] { write_splats(folder.path / "b.ply", plain(set)); }), "b.links.json: would bind the Gaussians of"));
  CHECK(says(error_of([&] { write_splats(folder.path / "b.spz", plain(set)); }), "b.links.json: would bind"));
  CHECK(write_splats(folder.path / "b.spz", set, {.spz = {.version = 2}}).empty());  // the same links
  set.link[0] = 0;
  CHECK(says(error_of([&] { write_splats(folder.path / "b.spz", set); }), "b.links.json: would bind"));
  CHECK(says(error_of([&] { write_splats(folder.path / "b.ksplat", set); }), "its ending names no format of Gaussians"));
  CHECK(says(error_of([&] { expect_splats_writable(folder.path / "none" / "b.ply"); }), "its folder does not exist"));
  set.link_names[0] = "\xff";
  CHECK(says(error_of([&] { write_splats(folder.path / "e.splat", set); }), "is not UTF-8"));
}

TEST_CASE("sets are antialiased together where both are") {
  auto one = random_set(2, 0), other = random_set(2, 0);
  one.antialiased = true;
  CHECK(!merge(one, other).antialiased);
  CHECK(!merge(other, one).antialiased);
  other.antialiased = true;
  CHECK(merge(one, other).antialiased);
  CHECK(merge(SplatSet{}, one).antialiased);
}

TEST_CASE("ranges of a set, written and read") {
  auto set = random_set(9, 0);
  set.link_names = {"a", "b \"c\""};
  set.link = {0, 0, -1, 1, 1, 0, -1, -1, 1};
  auto const text = format_links(link_ranges(set));
  auto again = random_set(9, 0);
  bind_links(again, parse_links(bytes_of(text), "t.json"), "t.json");
  CHECK(again.link == set.link);
  CHECK(again.link_names == set.link_names);
}
