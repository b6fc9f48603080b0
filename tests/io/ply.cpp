#include <doctest/doctest.h>

#include <cstdio>
#include <gsp/io/detail/ply_table.hpp>
#include <gsp/io/file.hpp>
#include <gsp/io/ply.hpp>
#include <io/fixtures.hpp>

using namespace gsp::io;
using namespace gsp_test;

namespace {

constexpr double ulp = 0x1p-24;  // half a unit in the last place of a float near 1, relative

/// Positions, SH and links bit by bit; opacity passes the logit x (error 2^-24 |x|, and s'(x) |x| <= 0.23), scale the logarithm, the
/// rotation a second normalisation.
void check_same(SplatSet const& a, SplatSet const& b) {
  REQUIRE(a.size() == b.size());
  CHECK(a.sh_degree == b.sh_degree);
  CHECK(a.positions == b.positions);
  CHECK(a.sh == b.sh);
  CHECK(a.link == b.link);
  CHECK(a.link_names == b.link_names);
  double opacity = 0, scale = 0, quat = 0;
  for (std::size_t i = 0; i < a.opacities.size(); ++i) opacity = std::max(opacity, std::abs(double(a.opacities[i]) - b.opacities[i]));
  for (std::size_t i = 0; i < a.scales.size(); ++i)
    scale = std::max(scale, std::abs(double(a.scales[i]) - b.scales[i]) / a.scales[i] / (std::abs(std::log(a.scales[i])) + 2));
  for (std::size_t i = 0; i < a.quats.size(); ++i) quat = std::max(quat, std::abs(double(a.quats[i]) - b.quats[i]));
  CHECK(opacity <= 1.5 * ulp);
  CHECK(scale <= ulp);
  CHECK(quat <= 3 * ulp);
}

/// The same rows as text, 17 digits.
std::string as_text_ply(std::vector<std::byte> const& binary) {
  auto const table = detail::parse_ply_table(binary, "binary");
  auto const& vertex = *table.find("vertex");
  std::string text(detail::as_text(binary).substr(0, detail::as_text(binary).find("end_header\n") + 11));
  text.replace(text.find("binary_little_endian"), 20, "ascii");
  for (std::size_t i = 0; i < vertex.count; ++i) {
    for (auto const& p : vertex.properties) {
      char number[40];
      std::snprintf(number, sizeof number, "%.17g ", table.column(vertex, p)(i));
      text += number;
    }
    text += '\n';
  }
  return text;
}

std::string replaced(std::string text, std::string const& what, std::string const& with) {
  REQUIRE(text.find(what) != std::string::npos);
  return text.replace(text.find(what), what.size(), with);
}

}  // namespace

TEST_CASE("3DGS PLY: what is written comes back, SH 0-3, binary and text, with links") {
  for (int degree = 0; degree <= 3; ++degree) {
    SplatSet set = random_set(300, degree, 10 + degree);
    set.link_names = {"trunk", "", "front left foot"};
    for (std::size_t i = 0; i < set.size(); ++i) set.link[i] = i % 3 == 0 ? -1 : i % 3 == 1 ? 0 : 2;
    set.opacities[0] = 0, set.opacities[1] = 1;
    auto const bytes = format_ply(set);
    check_same(set, parse_ply(bytes, "set.ply"));
    check_same(set, parse_ply(bytes_of(as_text_ply(bytes)), "text.ply"));
  }
}

TEST_CASE("3DGS PLY: layout of the authors") {
  // One Gaussian of SH 1 written out by hand: f_rest is channel-major (3 red, 3 green, 3 blue), opacity a logit, scale a logarithm,
  // rotation unnormalised w x y z.
  std::string text = "ply\r\nformat ascii 1.0\r\ncomment made by hand\r\nelement vertex 1\r\n";
  for (auto p : {"x",        "y",        "z",        "f_dc_0",   "f_dc_1",   "f_dc_2",   "f_rest_0", "f_rest_1",
                 "f_rest_2", "f_rest_3", "f_rest_4", "f_rest_5", "f_rest_6", "f_rest_7", "f_rest_8", "opacity",
                 "scale_0",  "scale_1",  "scale_2",  "rot_0",    "rot_1",    "rot_2",    "rot_3",    "red"})
    text += std::string("property ") + (p[0] == 'r' && p[1] == 'e' ? "uchar " : "float ") + p + "\r\n";
  text += "end_header\r\n1 2 3  .1 .2 .3  11 12 13 21 22 23 31 32 33  0  0 -1 -2  0 0 0 -2 255\r\n";
  SplatSet const s = parse_ply(bytes_of(text), "hand.ply");
  REQUIRE(s.size() == 1);
  CHECK(s.sh == std::vector<float>{.1f, .2f, .3f, 11, 21, 31, 12, 22, 32, 13, 23, 33});
  CHECK(s.quats == std::vector<float>{0, 0, 0, -1});
  CHECK(s.opacities[0] == 0.5f);
  CHECK(s.scales[1] == doctest::Approx(std::exp(-1.0)).epsilon(1e-7));
  CHECK(s.link[0] == -1);
  REQUIRE(s.notes.size() == 1);
  CHECK(s.notes[0] == "hand.ply: line 28: property 'red' is without effect");
}

TEST_CASE("3DGS PLY: every cut is refused") {
  SplatSet set = random_set(2, 1);
  set.link_names = {"foot"};
  set.link[1] = 0;
  auto const bytes = format_ply(set);
  auto const parse = [](Bytes b) { parse_ply(b, "cut.ply"); };
  CHECK(accepted_truncations(bytes, parse) == 0);
  CHECK(accepted_truncations(bytes_of(as_text_ply(bytes)), [&](Bytes b) {
          auto const t = detail::as_text(b);  // all but the last blank: "-1 \n" without its line end is complete
          if (t.size() > 4 && t.ends_with(' ') && t.find("end_header") != t.npos) throw gsp::Error("left out of the count");
          parse(b);
        }) == 0);
}

TEST_CASE("3DGS PLY: faults are named with place and remedy") {
  SplatSet const set = random_set(3, 0);
  std::string const good(detail::as_text(format_ply(set)));
  auto const refusal = [](std::string const& text) { return error_of([&] { parse_ply(bytes_of(text), "bad.ply"); }); };
  CHECK(refusal(good).empty());
  CHECK(says(refusal("solid cube\n"), "line 1: the first line is not 'ply'"));
  CHECK(says(refusal(replaced(good, "little", "big")), "line 2: format 'format binary_big_endian 1.0' is not supported; save it"));
  CHECK(says(refusal(replaced(good, "vertex 3", "vertex 4")),
             "line 3: element 'vertex' announces 4 rows of 68 bytes, but only 204 bytes follow"));
  CHECK(says(refusal(replaced(good, "vertex 3", "vertex 18446744073709551615")), "announces 18446744073709551615 rows"));
  CHECK(says(refusal(replaced(good, "vertex 3", "vertex 2")), "68 bytes follow the last row"));
  CHECK(says(refusal(replaced(good, "vertex 3", "vertex -3")), "is not 'element NAME COUNT'"));
  CHECK(says(refusal(replaced(good, "vertex 3", "vertex 0").substr(0, good.size() - 204)), "no Gaussians"));
  CHECK(says(refusal(replaced(good, "vertex", "vertices")), "no element 'vertex'"));
  CHECK(says(refusal(replaced(good, "f_dc_1", "green_")), "no property 'f_dc_1'; this is not a 3DGS PLY"));
  CHECK(says(refusal(replaced(good, "nx", "f_rest_0")), "1 properties f_rest_* are no SH degree"));
  CHECK(says(refusal(replaced(good, "property float nx", "property list uchar int nx")), "list"));
  CHECK(says(refusal(replaced(good, "property float nx", "property half nx")), "known type"));
  CHECK(says(refusal(replaced(good, "property float nx", "property float x")), "declared twice"));
  CHECK(says(refusal(replaced(good, "property float nx", "texture nx")), "unknown header word"));
  CHECK(says(refusal(replaced(good, "end_header", "end_headed")), "unknown header word"));
  CHECK(says(refusal(replaced(good, "vertex 3", "vertex 99999999999999999999")), "is not 'element NAME COUNT'"));
  std::string const typed = as_text_ply(bytes_of(good));
  auto const first = typed.find("end_header\n") + 11, blank = typed.find(' ', first);
  auto const begins = [&](std::string const& number) { return std::string(typed).replace(first, blank - first, number); };
  CHECK(says(refusal(begins("1e400")), "'1e400' is beyond the largest number, 1.8e308; repair the file"));
  CHECK(parse_ply(bytes_of(begins("1e-400")), "small.ply").positions[0] == 0);
  for (float value : {NAN, INFINITY, -INFINITY}) {
    std::string bad = good;
    std::memcpy(&bad[bad.size() - 68 + 9 * 4], &value, 4);  // opacity of the third
    CHECK(says(refusal(bad), "Gaussian 2: property 'opacity' is not finite"));
  }
  std::string zero = good;
  std::memset(&zero[zero.size() - 16], 0, 16);
  CHECK(says(refusal(zero), "Gaussian 2: its rotation has length 0"));

  SplatSet bound = set;
  bound.link_names = {"foot"};
  bound.link = {0, -1, 0};
  std::string const linked(detail::as_text(format_ply(bound)));
  CHECK(
      says(refusal(replaced(linked, "comment link 0 foot\n", "")), "row 0: link 0 has no name; add the header line 'comment link 0 NAME'"));
  CHECK(says(refusal(replaced(linked, "comment link 0", "comment link 99999999")), "line 3"));
  CHECK(says(refusal(replaced(linked, "property int link", "property float link")), "integer"));
  CHECK(refusal(replaced(linked, "comment link 0", "comment link to http://x\ncomment link 0")).empty());
  std::string const text = as_text_ply(format_ply(set));
  CHECK(says(refusal(text.substr(0, text.find("end_header")) + "end_header\n1 2 x"), "announces 3 rows of at least 34 bytes"));
  CHECK(
      says(refusal(text.substr(0, text.find("end_header")) + "end_header\n1 2 x" + std::string(200, ' ')), "line 22: 'x' is not a number"));
}

TEST_CASE("write_ply leaves nothing behind when it fails") {
  Folder folder;
  SplatSet set = random_set(3, 2);
  write_ply(folder.path / "a.ply", set);
  check_same(set, read_ply(folder.path / "a.ply"));
  set.positions[0] = NAN;
  CHECK(says(error_of([&] { write_ply(folder.path / "b.ply", set); }), "not finite"));
  CHECK(says(error_of([&] { write_ply(folder.path / "none" / "b.ply", random_set(1, 0)); }), "its folder does not exist; create it"));
  CHECK(folder.files() == 1);
  CHECK(says(error_of([&] { read_ply(folder.path / "none.ply"); }), "there is no such file"));
  CHECK(says(error_of([&] { read_ply(folder.path); }), "not a regular file"));
}
