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
      folder.path / "go2.ply.links.json",
      bytes_of(
          R"({"links": [{"name": "FL_foot", "first": 2, "count": 3}, {"name": "trunk", "first": 8, "count": 2}, {"name": "FL_foot", "first": 0, "count": 1}]})"));
  SplatSet const set = read_splats(folder.path / "go2.ply");
  CHECK(set.link_names == std::vector<std::string>{"FL_foot", "trunk"});
  CHECK(set.link == std::vector<int>{0, -1, 0, 0, 0, -1, -1, -1, 1, 1});
  write_file(folder.path / "go2.ply.links.json", bytes_of(R"({"links": [{"name": "FL_foot", "first": 2, "count": 9}]})"));
  CHECK(says(error_of([&] { read_splats(folder.path / "go2.ply"); }),
             "go2.ply.links.json: links[0] ('FL_foot'): first 2 and count 9 leave the 10 Gaussians"));
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
  for (float& v : set.sh) v = std::clamp(v, -0.9f, 0.9f);  // within what all formats hold
  for (float& v : set.scales) v = std::max(v, 0.02f);
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
  CHECK(!std::filesystem::exists(folder.path / "a.ply.links.json"));
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

  // a sidecar is one file's, and goes with it
  CHECK(write_splats(folder.path / "b.ply", plain(set)).empty());
  CHECK(read_splats(folder.path / "b.ply").link_names.empty());
  CHECK(write_splats(folder.path / "b.spz", plain(set)).empty());
  CHECK(read_splats(folder.path / "b.spz").link_names.empty());
  set.link[0] = 0;
  CHECK(write_splats(folder.path / "b.spz", set, {.spz = {.version = 2}}).empty());
  CHECK(read_splats(folder.path / "b.spz").link[0] == 0);
  write_file(folder.path / "b.ply.links.json", bytes_of(R"({"links": [{"name": "hand", "first": 0, "count": 300}]})"));
  CHECK(read_splats(folder.path / "b.ply").link_names == std::vector<std::string>{"hand"});
  CHECK(write_splats(folder.path / "b.ply", set).empty());
  CHECK(!std::filesystem::exists(folder.path / "b.ply.links.json"));  // they stand in the file
  again = read_splats(folder.path / "b.ply");
  CHECK(again.link_names[std::size_t(again.link[10])] == set.link_names[std::size_t(set.link[10])]);
  CHECK(again.link[30] == -1);
  write_file(folder.path / "a.links.json", bytes_of(R"({"links": []})"));
  CHECK(says(error_of([&] { read_splats(folder.path / "a.ply"); }),
             "a.links.json: does not say which file its links are of; rename it '" + (folder.path / "a.ply.links.json").string() + "'"));
  CHECK(says(error_of([&] { write_splats(folder.path / "a.spz", set); }), "a.spz.links.json' if they are this file's"));
  CHECK(!std::filesystem::exists(folder.path / "a.spz"));
  CHECK(says(error_of([&] { write_splats(folder.path / "a.compressed.ply", set); }), "a.compressed.ply.links.json' if they are"));
  std::filesystem::create_directory(folder.path / "old");
  std::filesystem::create_symlink(folder.path / "a.ply", folder.path / "old" / "through.ply");
  CHECK(says(error_of([&] { read_splats(folder.path / "old" / "through.ply"); }), "a.links.json: does not say which file"));
  CHECK(write_splats(folder.path / "old" / "b.compressed.ply", set).empty());
  write_file(folder.path / "old" / "b.compressed.links.json", bytes_of(R"({"links": []})"));
  CHECK(says(error_of([&] { read_splats(folder.path / "old" / "b.compressed.ply"); }), "b.compressed.links.json: does not say"));
  // of the file that a symbolic link leads to
  CHECK(write_splats(folder.path / "h.spz", set).empty());
  std::filesystem::create_symlink(folder.path / "h.spz", folder.path / "link.spz");
  CHECK(read_splats(folder.path / "link.spz").link == read_splats(folder.path / "h.spz").link);
  CHECK(write_splats(folder.path / "link.spz", plain(set)).empty());
  CHECK(read_splats(folder.path / "h.spz").link_names.empty());
  CHECK(!std::filesystem::exists(folder.path / "link.spz.links.json"));
  // those beside the name that is read come first, as in caches whose names lead into a store of files named by their hashes
  std::filesystem::create_directory(folder.path / "store");
  CHECK(write_splats(folder.path / "store" / "1f3a.spz", plain(set)).empty());
  write_file(folder.path / "store" / "77c0", bytes_of(R"({"links": [{"name": "hand", "first": 0, "count": 300}]})"));
  std::filesystem::create_symlink("store/1f3a.spz", folder.path / "room.spz");
  std::filesystem::create_symlink("store/77c0", folder.path / "room.spz.links.json");
  CHECK(read_splats(folder.path / "room.spz").link_names == std::vector<std::string>{"hand"});
  CHECK(write_splats(folder.path / "room.spz", set).empty());
  CHECK(read_splats(folder.path / "room.spz").link == set.link);
  CHECK(read_splats(folder.path / "store" / "1f3a.spz").link == set.link);
  CHECK(std::filesystem::exists(folder.path / "store" / "77c0"));
  // a link in between has what was beside it taken away, and is looked at
  std::filesystem::create_symlink("room.spz", folder.path / "top.spz");
  write_file(folder.path / "room.spz.links.json", bytes_of(R"({"links": [{"name": "old", "first": 0, "count": 300}]})"));
  CHECK(read_splats(folder.path / "top.spz").link_names == std::vector<std::string>{"old"});
  CHECK(write_splats(folder.path / "top.spz", set).empty());
  for (char const* name : {"top.spz", "room.spz", "store/1f3a.spz"}) CHECK(read_splats(folder.path / name).link == set.link);
  std::filesystem::create_symlink("nowhere", folder.path / "top.spz.links.json");
  CHECK(says(error_of([&] { read_splats(folder.path / "top.spz"); }), "top.spz.links.json: there is no such file"));
  CHECK(std::filesystem::remove(folder.path / "top.spz.links.json"));
  // one that cannot be taken away is told
  std::filesystem::create_directories(folder.path / "top.spz.links.json" / "full");
  CHECK(says(error_of([&] { write_splats(folder.path / "top.spz", set); }), "top.spz.links.json: is of the Gaussians that were there"));
  std::filesystem::remove_all(folder.path / "top.spz.links.json");
#if defined(GSP_WITH_WEBP)
  std::filesystem::create_directory(folder.path / "views");  // the pictures of SOG go where its meta.json goes
  std::filesystem::create_symlink("../sog/meta.json", folder.path / "views" / "meta.json");
  CHECK(write_splats(folder.path / "views" / "meta.json", plain(random_set(40, 1))).empty());
  CHECK(read_splats(folder.path / "sog" / "meta.json").size() == 40);
  CHECK(read_splats(folder.path / "views" / "meta.json").positions == read_splats(folder.path / "sog" / "meta.json").positions);
#endif
  std::filesystem::create_symlink("store/later.spz", folder.path / "later.spz");  // to a file that is not there yet
  CHECK(write_splats(folder.path / "later.spz", set).empty());
  CHECK(read_splats(folder.path / "later.spz").link == set.link);
  CHECK(read_splats(folder.path / "store" / "later.spz").link == set.link);
  // room.spz's are not of room.spz.ply
  CHECK(write_splats(folder.path / "h.spz.ply", set).empty());
  CHECK(read_splats(folder.path / "h.spz.ply").link == set.link);
  CHECK(says(error_of([&] { write_splats(folder.path / "b.ksplat", set); }), "its ending names no format of Gaussians"));
  CHECK(says(error_of([&] { expect_splats_writable(folder.path / "none" / "b.ply"); }), "its folder does not exist"));
  set.link_names[0] = "\xff";
  CHECK(says(error_of([&] { write_splats(folder.path / "e.splat", set); }), "is not UTF-8"));
}

// By hand, of each bound: numbers within it, at it, and a step of it beyond.
TEST_CASE("what a format clips is said, with how many Gaussians have it") {
  Folder folder;
  auto const notes = [&](char const* file, SplatSet const& set) { return write_splats(folder.path / file, set); };
  auto within = random_set(50, 2);
  for (float& v : within.sh) v = std::clamp(v, -0.9f, 0.9f);
  for (char const* file : {"a.ply", "a.compressed.ply", "a.spz", "a.glb", "a.usda"}) CHECK(notes(file, within).empty());

  auto set = within;
  set.sh[0] = 1.78f, set.sh[2] = -9, set.sh[27] = 3.4f, set.sh[54] = -3.33f;  // Gaussians 0, 1 and 2; their red and blue
  auto said = notes("b.splat", set);
  REQUIRE(said.size() == 2);
  CHECK(says(said[1], "b.splat: 3 Gaussians have colours (f_dc) beyond +-1.772, all that the format holds; clipped"));
  said = notes("b.spz", set);
  REQUIRE(said.size() == 1);
  CHECK(says(said[0], "b.spz: 2 Gaussians have colours (f_dc) beyond +-3.333"));
  for (char const* file : {"b.ply", "b.glb", "b.usda"}) CHECK(notes(file, set).empty());
  said = notes("b.compressed.ply", set);  // which holds them, and costs the neighbours theirs
  REQUIRE(said.size() == 1);
  CHECK(says(said[0], "b.compressed.ply: colours of "));

  set = within;
  set.sh[27 * 7 + 26] = -4.1f, set.sh[27 * 7 + 25] = 5, set.sh[27 * 9 + 3] = 1.3f;
  said = notes("c.compressed.ply", set);
  REQUIRE(said.size() == 1);
  CHECK(says(said[0], "1 Gaussian has SH terms above degree 0 beyond +-4"));
  said = notes("c.spz", set);
  REQUIRE(said.size() == 1);
  CHECK(says(said[0], "2 Gaussians have SH terms above degree 0 beyond +-1"));
  CHECK(notes("c.ply", set).empty());

  set = within;
  set.scales[3] = 4e-5f, set.scales[7] = 1e-9f, set.scales[8] = 1e-10f, set.scales[20] = 0;
  said = notes("d.spz", set);
  REQUIRE(said.size() == 1);
  CHECK(says(said[0], "3 Gaussians have scales below 4.54e-05"));
  said = notes("d.compressed.ply", set);
  REQUIRE(said.size() == 1);
  CHECK(says(said[0], "2 Gaussians have scales below 2.06e-09"));
  said = notes("d.ply", set);
  REQUIRE(said.size() == 1);
  CHECK(says(said[0], "1 Gaussian has scales below 1.2e-38"));
  CHECK(notes("d.glb", set).empty());
#if defined(GSP_WITH_WEBP)
  CHECK(notes("a.sog", within).empty());
  CHECK(says(notes("d.sog", set).at(0), "2 Gaussians have scales below 2.06e-09"));
#endif

  // what comes back from a format is within it
  for (auto const& [from, to] : {std::pair{"b.splat", "e.splat"},
                                 {"b.spz", "e.spz"},
                                 {"d.spz", "f.spz"},
                                 {"c.compressed.ply", "e.compressed.ply"},
                                 {"d.compressed.ply", "f.compressed.ply"},
                                 {"d.ply", "f.ply"}})
    CHECK(notes(to, read_splats(folder.path / from)).empty());

  // the faintest and the densest opacity come back from a PLY
  set = within;
  set.opacities[0] = 0, set.opacities[1] = 1e-40f, set.opacities[2] = 1, set.opacities[3] = 1e-12f;
  CHECK(notes("g.ply", set).empty());
  auto const again = read_splats(folder.path / "g.ply");
  CHECK(again.opacities[0] == 0);
  CHECK(again.opacities[1] == doctest::Approx(1e-40).epsilon(1e-4).scale(1e-40));
  CHECK(again.opacities[2] == 1);
  CHECK(std::abs(again.opacities[3] / 1e-12 - 1) < 1e-5);
}

TEST_CASE("a Gaussian far off, which costs its chunk their places, is said") {
  Folder folder;
  auto set = random_set(1000, 0);
  for (float& v : set.scales) v = std::max(v, 0.02f);  // more than a step of bounds of 20 m
  CHECK(write_splats(folder.path / "a.compressed.ply", set).empty());
  set.positions[0] = 1e4f;
  auto const said = write_splats(folder.path / "b.compressed.ply", set);
  REQUIRE(said.size() == 1);
  CHECK(says(said[0], "b.compressed.ply: places of "));
  CHECK(says(said[0], "are off by more than their size, up to 2.4"));
  // as many as that, by the file itself
  sort_splats(set);
  auto const again = read_splats(folder.path / "b.compressed.ply");
  int coarse = 0;
  double worst = 0;
  for (std::size_t i = 0; i < set.size(); ++i) {
    double sum = 0;
    for (std::size_t k = 0; k < 3; ++k) sum += std::pow(double(again.positions[3 * i + k]) - set.positions[3 * i + k], 2);
    if (std::sqrt(sum) > *std::max_element(&set.scales[3 * i], &set.scales[3 * i] + 3)) ++coarse, worst = std::max(worst, std::sqrt(sum));
  }
  CHECK(worst > 2);
  CHECK(says(said[0], ("places of " + std::to_string(coarse) + " Gaussians").c_str()));
  CHECK(write_splats(folder.path / "b.ply", set).empty());

  // nothing far off, and smaller than a step of what neighbours share
  set = random_set(1000, 0);
  for (float& v : set.scales) v = 1e-4f;
  auto const sparse = write_splats(folder.path / "s.compressed.ply", set);
  REQUIRE(sparse.size() == 1);
  CHECK(says(sparse[0], ": 256 neighbours share bounds; write another format, or leave out those that are far off, if any are"));

  // the same of colours
  set = random_set(1000, 0);
  for (float& v : set.scales) v = std::max(v, 0.02f);
  for (float& v : set.sh) v = std::clamp(v, -0.9f, 0.9f);
  set.sh[0] = 100;
  auto const bright = write_splats(folder.path / "e.compressed.ply", set);
  REQUIRE(bright.size() == 1);
  CHECK(says(bright[0], "e.compressed.ply: colours of "));
  CHECK(says(bright[0], "are off by more than 1/255, up to 0.05"));

  // .spz: 24 bits for all; at 10 km a step of 1 / 512 m costs nobody here their place, at 2,000 km one of 1/4 m does
  set = random_set(1000, 0);
  for (float& v : set.scales) v = std::max(v, 0.02f);
  set.positions[0] = 1e4f;
  CHECK(write_splats(folder.path / "c.spz", set).empty());
  set.positions[0] = 2e6f;
  auto const far = write_splats(folder.path / "d.spz", set);
  REQUIRE(far.size() == 1);
  CHECK(says(far[0], "are off by more than their size, up to 0."));
  CHECK(says(far[0], "24 bits reach as far as the farthest; write another format, or leave out those that are far off"));

  // Nothing far off, and smaller than the step: sqrt 3 / 2 steps, 2.1e-4 at most.
  set = random_set(1000, 0);
  for (float& v : set.scales) v = 1e-4f;
  auto const fine = write_splats(folder.path / "f.spz", set);
  REQUIRE(fine.size() == 1);
  double const most = std::stod(fine[0].substr(fine[0].find("up to ") + 6));
  CHECK(most > 1.5e-4);
  CHECK(most < 2.12e-4);
  CHECK(says(fine[0], ": a step is 1/4096 of a unit; scale the set up, or write another format"));
  CHECK(!says(fine[0], "far off"));
  for (float& v : set.positions) v *= 4;  // which is what it says
  for (float& v : set.scales) v *= 4;
  CHECK(write_splats(folder.path / "g.spz", set).empty());

#if defined(GSP_WITH_WEBP)
  // SOG: 16 bits of log(1 + |x|); one at 1,000 km makes a step 14 / 65535 of 1 + |x|, the count by the file itself
  set = random_set(1000, 0);
  for (float& v : set.scales) v = 1e-3f;
  CHECK(write_splats(folder.path / "h.sog", set).empty());
  set.positions[0] = 1e6f;
  auto const wide = write_splats(folder.path / "i.sog", set);
  sort_splats(set);
  auto const back = read_splats(folder.path / "i.sog");
  std::size_t off = 0;
  for (std::size_t i = 0; i < set.size(); ++i)
    off += std::hypot(back.positions[3 * i] - set.positions[3 * i], back.positions[3 * i + 1] - set.positions[3 * i + 1],
                      back.positions[3 * i + 2] - set.positions[3 * i + 2]) > 1e-3f;
  REQUIRE(wide.size() == 1);
  CHECK(off > 1);
  CHECK(says(wide[0], ("places of " + std::to_string(off) + " Gaussians are off by more than their size").c_str()));
  CHECK(says(wide[0], "16 bits reach as far as the farthest"));
#endif
}

TEST_CASE("endings in capitals are understood") {
  Folder folder;
  auto const set = random_set(20, 0);
  for (char const* file : {
         "A.PLY", "B.Compressed.Ply", "C.SPLAT", "D.SPZ", "E.GLB", "F.GLTF", "G.USDA",
#if defined(GSP_WITH_WEBP)
             "H.SOG"
#endif
       }) {
    CHECK(write_splats(folder.path / file, set).empty());
    CHECK(read_splats(folder.path / file).size() == 20);
  }
  CHECK(detail::starts_with(read_file(folder.path / "F.GLTF"), "{"));
  CHECK(detail::starts_with(read_file(folder.path / "E.GLB"), "glTF"));
  CHECK(read_file(folder.path / "B.Compressed.Ply").size() < read_file(folder.path / "A.PLY").size() * 2 / 3);
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
