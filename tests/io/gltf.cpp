#include <doctest/doctest.h>

#include <gsp/io/detail/base64.hpp>
#include <gsp/io/detail/splat_rotation.hpp>
#include <gsp/io/file.hpp>
#include <gsp/io/gltf.hpp>
#include <gsp/io/splat_transform.hpp>
#include <io/fixtures.hpp>
#include <nlohmann/json.hpp>

using namespace gsp::io;
using namespace gsp_test;
using Json = nlohmann::ordered_json;

namespace {

std::vector<std::byte> glb(Json const& json, std::vector<std::byte> const& buffer) {
  std::string text = json.dump();
  while (text.size() % 4) text += ' ';
  std::vector<std::byte> out;
  put(out, std::uint32_t(0x46546c67)), put(out, std::uint32_t(2)), put(out, std::uint32_t(28 + text.size() + buffer.size()));
  put(out, std::uint32_t(text.size())), put(out, std::uint32_t(0x4e4f534a));
  for (char c : text) put(out, c);
  put(out, std::uint32_t(buffer.size())), put(out, std::uint32_t(0x004e4942));
  out.insert(out.end(), buffer.begin(), buffer.end());
  return out;
}

/// A file made by hand: interleaved floats in the axes of glTF, `stride` bytes a Gaussian, SH of `degree`.
struct Made {
  Json json;
  std::vector<std::byte> buffer;
  std::vector<std::byte> bytes() const { return glb(json, buffer); }
};
Made made(SplatSet const& s) {
  Made m;
  std::size_t const terms = s.sh_terms(), floats = 11 + 3 * terms;
  std::vector<std::pair<std::string, std::size_t>> columns{
      {"POSITION", 3}, {"KHR_gaussian_splatting:ROTATION", 4}, {"KHR_gaussian_splatting:SCALE", 3}, {"KHR_gaussian_splatting:OPACITY", 1}};
  for (int l = 0; l <= s.sh_degree; ++l)
    for (int k = 0; k <= 2 * l; ++k)
      columns.emplace_back("KHR_gaussian_splatting:SH_DEGREE_" + std::to_string(l) + "_COEF_" + std::to_string(k), 3);
  for (std::size_t i = 0; i < s.size(); ++i) {
    for (std::size_t k = 0; k < 3; ++k) put(m.buffer, s.positions[3 * i + k]);
    for (std::size_t k : {1, 2, 3, 0}) put(m.buffer, s.quats[4 * i + k]);
    for (std::size_t k = 0; k < 3; ++k) put(m.buffer, s.scales[3 * i + k]);
    put(m.buffer, s.opacities[i]);
    for (std::size_t k = 0; k < 3 * terms; ++k) put(m.buffer, s.sh[3 * terms * i + k]);
  }
  Json attributes, accessors = Json::array();
  std::size_t at = 0;
  for (auto const& [name, width] : columns) {
    attributes[name] = accessors.size();
    accessors.push_back({{"bufferView", 0},
                         {"byteOffset", 4 * at},
                         {"componentType", 5126},
                         {"count", s.size()},
                         {"type", width == 1 ? "SCALAR" : "VEC" + std::to_string(width)}});
    at += width;
  }
  m.json = Json::parse(
      R"({"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}], "meshes": [{"primitives": [
      {"mode": 0, "extensions": {"KHR_gaussian_splatting": {"kernel": "ellipse", "colorSpace": "srgb_rec709_display"}}}]}]})");
  m.json["meshes"][0]["primitives"][0]["attributes"] = attributes;
  m.json["accessors"] = accessors;
  m.json["bufferViews"] = Json::array({Json{{"buffer", 0}, {"byteLength", m.buffer.size()}, {"byteStride", 4 * floats}}});
  m.json["buffers"] = Json::array({Json{{"byteLength", m.buffer.size()}}});
  return m;
}

/// What the set is in right-down-forward, by a general turn instead of signs: half a turn about z, then `pose` first.
SplatSet turned(SplatSet s, SplatPose const& pose = {}) {
  transform(s, pose);
  transform(s, {{0, 0, 0}, {0, 0, 0, 1}, 1});
  return s;
}
/// The half turn of `turned` gives q the factor k; signs alone give q turned on both sides: the same Gaussian, its own axes turned. So
/// rotations are compared by the covariance.
double covariance_error(SplatSet const& a, SplatSet const& b) {
  double worst = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    double total = 0;
    std::array<double, 9> c[2]{};
    for (int which = 0; which < 2; ++which) {
      SplatSet const& s = which ? b : a;
      auto const r = detail::rotation_matrix({s.quats[4 * i], s.quats[4 * i + 1], s.quats[4 * i + 2], s.quats[4 * i + 3]});
      for (int u = 0; u < 3; ++u)
        for (int v = 0; v < 3; ++v)
          for (int k = 0; k < 3; ++k) c[which][3 * u + v] += r[3 * u + k] * r[3 * v + k] * std::pow(double(s.scales[3 * i + k]), 2);
    }
    for (int k = 0; k < 3; ++k) total += c[0][4 * k];
    for (int k = 0; k < 9; ++k) worst = std::max(worst, std::abs(c[0][k] - c[1][k]) / total);
  }
  return worst;
}
void check_same(SplatSet const& a, SplatSet const& b, double tolerance) {
  auto const d = apart(a, b);
  CHECK(d.position <= 20 * tolerance);
  CHECK(d.log_scale <= 20 * tolerance);
  CHECK(d.opacity == 0);
  CHECK(d.dc == 0);
  CHECK(d.sh <= 20 * tolerance);
  CHECK(covariance_error(a, b) <= 20 * tolerance);
}
constexpr double rounding = 0x1p-24;

}  // namespace

TEST_CASE("glTF: float attributes, interleaved, SH 0-3, axes changed") {
  for (int degree = 0; degree <= 3; ++degree) {
    auto const set = random_set(100, degree, 3);
    auto const read = parse_gltf(made(set).bytes(), "made.glb");
    check_same(read, turned(set), rounding);
    CHECK(read.positions[0] == -set.positions[0]);
    CHECK(read.positions[1] == -set.positions[1]);
    CHECK(read.positions[2] == set.positions[2]);
  }
}

TEST_CASE("glTF: what is written comes back, from both kinds of file") {
  Folder folder;
  for (int degree = 0; degree <= 3; ++degree) {
    auto const set = random_set(50, degree, 4);
    write_gltf(folder.path / "a.glb", set);
    write_gltf(folder.path / "a.gltf", set);
    for (char const* file : {"a.glb", "a.gltf"}) {
      auto const again = read_gltf(folder.path / file);
      CHECK(again.positions == set.positions);
      CHECK(again.scales == set.scales);
      CHECK(again.opacities == set.opacities);
      CHECK(again.sh == set.sh);
      CHECK(apart(again, set).rotation <= 2 * rounding);
    }
  }
}

TEST_CASE("glTF: nodes move what they show, one below the other") {
  auto const set = random_set(40, 3, 5);
  auto m = made(set);
  m.json["nodes"] = Json::parse(R"([{"children": [1], "translation": [1, 2, 3], "rotation": [0, 0.6, 0, 0.8], "scale": [2, 2, 2]},
                                    {"mesh": 0, "matrix": [0, 0.5, 0, 0, -0.5, 0, 0, 0, 0, 0, 0.5, 0, 4, 5, 6, 1]}])");
  auto expected = set;
  transform(expected, {{4, 5, 6}, {std::sqrt(0.5), 0, 0, std::sqrt(0.5)}, 0.5});
  check_same(parse_gltf(m.bytes(), "nodes.glb"), turned(expected, {{1, 2, 3}, {0.8, 0, 0.6, 0}, 2}), 4 * rounding);

  m.json["nodes"] = Json::parse(R"([{"mesh": 0}, {"mesh": 0, "translation": [0, 0, 1]}])");
  m.json["scenes"][0]["nodes"] = {0, 1};
  auto const twice = parse_gltf(m.bytes(), "twice.glb");
  REQUIRE(twice.size() == 80);
  CHECK(twice.positions[122] == doctest::Approx(twice.positions[2] + 1));
  m.json.erase("scenes"), m.json.erase("scene");  // then all nodes are shown
  CHECK(parse_gltf(m.bytes(), "twice.glb").size() == 80);

  // turns of 170 degrees about many axes: each of the four ways to a quaternion
  for (int k = 0; k < 12; ++k) {
    auto one = made(set);
    double const a = k * 0.7, b = k * 1.3, s = std::sin(1.48),
                 q[4] = {s * std::cos(a) * std::cos(b), s * std::cos(a) * std::sin(b), s * std::sin(a), std::cos(1.48)};
    one.json["nodes"][0]["rotation"] = q;
    check_same(parse_gltf(one.bytes(), "one.glb"), turned(set, {{0, 0, 0}, {q[3], q[0], q[1], q[2]}, 1}), 4 * rounding);
  }
}

TEST_CASE("glTF: normalised whole numbers") {
  Made m;
  m.json = made(random_set(1, 0)).json;
  auto& b = m.buffer;
  for (int v : {100, -200, 300}) put(b, std::int16_t(v));  // 0: POSITION
  put(b, std::int16_t(0));
  for (int v : {0, 127, 0, -127}) put(b, std::int8_t(v));  // 8: ROTATION x y z w
  for (int v : {255, 51, 0, 0}) put(b, std::uint8_t(v));   // 12: SCALE
  put(b, std::uint16_t(13107)), put(b, std::uint16_t(0));  // 16: OPACITY 0.2
  for (float v : {.1f, .2f, .3f}) put(b, v);               // 20: DC
  m.json["buffers"][0]["byteLength"] = 32;
  m.json["bufferViews"] = Json::array({Json{{"buffer", 0}, {"byteLength", 32}}});
  m.json["accessors"] = Json::parse(
      R"([{"byteOffset": 0, "componentType": 5122, "type": "VEC3"}, {"byteOffset": 8, "componentType": 5120, "normalized": true, "type": "VEC4"},
      {"byteOffset": 12, "componentType": 5121, "normalized": true, "type": "VEC3"}, {"byteOffset": 16, "componentType": 5123, "normalized": true, "type": "SCALAR"},
      {"byteOffset": 20, "componentType": 5126, "type": "VEC3"}])");
  for (auto& a : m.json["accessors"]) a["count"] = 1, a["bufferView"] = 0;
  m.json["extensionsRequired"] = {"KHR_mesh_quantization", "KHR_gaussian_splatting"};
  auto const s = parse_gltf(m.bytes(), "q.glb");
  CHECK(s.positions == std::vector<float>{-100, 200, 300});
  CHECK(s.scales == std::vector<float>{1, .2f, 0});
  CHECK(s.opacities[0] == doctest::Approx(0.2));
  CHECK(s.quats[0] == doctest::Approx(-std::sqrt(0.5)));
  CHECK(s.quats[2] == doctest::Approx(-std::sqrt(0.5)));
  CHECK(s.sh == std::vector<float>{.1f, .2f, .3f});
}

TEST_CASE("glTF: Gaussians packed as .spz") {
  // The bytes of the .spz are in the axes of the mesh.
  auto const data = spz_data(30, 2, 2, 8);
  Made m;
  m.json = made(random_set(1, 0)).json;
  m.buffer = gzip(data);
  m.json["buffers"][0]["byteLength"] = m.buffer.size();
  m.json["bufferViews"] = Json::array({Json{{"buffer", 0}, {"byteLength", m.buffer.size()}}});
  m.json.erase("accessors");
  auto const s = [&] {
    m.json["meshes"][0]["primitives"][0]["extensions"]["KHR_gaussian_splatting"]["extensions"] = {
        {"KHR_gaussian_splatting_compression_spz_2", {{"bufferView", 0}}}};
    m.json["extensionsRequired"] = {"KHR_gaussian_splatting", "KHR_gaussian_splatting_compression_spz_2"};
    return parse_gltf(m.bytes(), "spz.glb");
  }();
  REQUIRE(s.size() == 30);
  int x = std::to_integer<int>(data[16]) | std::to_integer<int>(data[17]) << 8 | std::to_integer<int>(data[18]) << 16;
  if (x >= 1 << 23) x -= 1 << 24;
  CHECK(s.positions[0] == doctest::Approx(-x / 4096.0));
  CHECK(s.sh_degree == 2);
}

TEST_CASE("glTF: buffers in files of their own") {
  Folder folder;
  auto const set = random_set(5, 1);
  auto m = made(set);
  m.json["buffers"][0]["uri"] = "my%20data.bin";
  write_file(folder.path / "my data.bin", m.buffer);
  write_file(folder.path / "a.gltf", bytes_of(m.json.dump(1)));
  check_same(read_gltf(folder.path / "a.gltf"), turned(set), rounding);
  CHECK(says(error_of([&] { parse_gltf(bytes_of(m.json.dump()), "a.gltf"); }),
             "buffers[0]: names the file 'my%20data.bin', and only one file was given"));
  for (char const* uri : {"../data.bin", "/etc/passwd", "http://x/y", "a/../../b", "%2e%2e/b"}) {
    m.json["buffers"][0]["uri"] = uri;
    CHECK(says(error_of([&] { parse_gltf(bytes_of(m.json.dump()), "a.gltf", folder.path); }), "is no path below the file's own folder"));
  }
  m.json["buffers"][0]["uri"] = "none.bin";
  CHECK(says(error_of([&] { parse_gltf(bytes_of(m.json.dump()), "a.gltf", folder.path); }), "no such file"));
  m.json["buffers"][0]["uri"] = "data:application/octet-stream;base64,AAAA!";
  CHECK(says(error_of([&] { parse_gltf(bytes_of(m.json.dump()), "a.gltf"); }), "is no base64"));
  std::vector<std::byte> bytes;
  for (int n = 0; n < 9; ++n) {
    auto const text = detail::base64(bytes);
    CHECK(text.size() == (bytes.size() + 2) / 3 * 4);
    CHECK(*detail::from_base64(text) == bytes);
    bytes.push_back(std::byte(n * 71 + 200));
  }
  CHECK(detail::base64(bytes_of("Man")) == "TWFu");
  CHECK(detail::base64(bytes_of("Ma")) == "TWE=");
  CHECK(!detail::from_base64("TWFuT"));
}

TEST_CASE("glTF: bad input") {
  auto const good = made(random_set(4, 1));
  auto refusal = [&](auto const& change) {
    auto m = good;
    change(m.json);
    return error_of([&] { parse_gltf(m.bytes(), "bad.glb"); });
  };
  CHECK(refusal([](Json&) {}).empty());
  CHECK(accepted_truncations(good.bytes(), [](Bytes b) { parse_gltf(b, "cut.glb"); }) == 0);
  auto const primitive = [](Json& j) -> Json& { return j["meshes"][0]["primitives"][0]; };
  auto const splats = [&](Json& j) -> Json& { return primitive(j)["extensions"]["KHR_gaussian_splatting"]; };
  CHECK(says(refusal([](Json& j) { j["asset"]["version"] = "1.0"; }), "does not say glTF version 2"));
  CHECK(says(refusal([](Json& j) { j["asset"] = 2; }), "does not say glTF version 2"));
  CHECK(says(refusal([&](Json& j) { primitive(j)["mode"] = 4; }), "meshes[0].primitives[0]: Gaussians must have mode 0"));
  CHECK(says(refusal([&](Json& j) { splats(j)["kernel"] = "box"; }), "has the kernel 'box'"));
  CHECK(says(refusal([&](Json& j) { splats(j)["colorSpace"] = "aces"; }), "has the colour space 'aces'"));
  CHECK(says(refusal([&](Json& j) { splats(j)["extensions"]["X"] = 1; }), "needs the extension 'X'"));
  CHECK(says(refusal([&](Json& j) { primitive(j)["attributes"].erase("KHR_gaussian_splatting:OPACITY"); }),
             "has no attribute KHR_gaussian_splatting:OPACITY"));
  CHECK(says(refusal([&](Json& j) { primitive(j)["attributes"].erase("KHR_gaussian_splatting:SH_DEGREE_1_COEF_1"); }),
             "has no attribute KHR_gaussian_splatting:SH_DEGREE_1_COEF_1"));
  CHECK(says(refusal([](Json& j) { j["extensionsRequired"] = {"EXT_meshopt_compression"}; }), "the file needs 'EXT_meshopt_compression'"));
  CHECK(says(refusal([](Json& j) { j["accessors"][0]["count"] = 5; }), "accessors[0]: its 5 elements of 12 bytes do not lie"));
  CHECK(says(refusal([](Json& j) { j["accessors"][0]["count"] = 0xffffffffffffffffull; }), "do not lie"));
  CHECK(says(refusal([](Json& j) { j["accessors"][0]["count"] = 0; }), "do not lie"));
  CHECK(says(refusal([](Json& j) { j["accessors"][1]["count"] = 3; }), "ROTATION has 3 elements and POSITION 4"));
  CHECK(says(refusal([](Json& j) { j["accessors"][0]["count"] = -1; }), "\"count\" must be a whole number"));
  CHECK(says(refusal([](Json& j) { j["accessors"][0]["type"] = "VEC4"; }), "is 'VEC4' where POSITION is VEC3"));
  CHECK(says(refusal([](Json& j) { j["accessors"][0]["componentType"] = 5125; }), "component type 5125"));
  CHECK(says(refusal([](Json& j) { j["accessors"][0]["byteOffset"] = 0xffffffffffffffffull; }), "do not lie"));
  CHECK(says(refusal([](Json& j) { j["accessors"][0]["sparse"] = Json::object(); }), "is sparse"));
  CHECK(says(refusal([](Json& j) { j["accessors"][0].erase("bufferView"); }), "has no bufferView"));
  CHECK(says(refusal([](Json& j) { j["bufferViews"][0]["byteLength"] = 1 << 20; }), "leave the buffer"));
  CHECK(says(refusal([](Json& j) { j["bufferViews"][0]["byteStride"] = 8; }), "has the stride 8"));
  CHECK(says(refusal([](Json& j) { j["bufferViews"][0]["extensions"]["EXT_meshopt_compression"] = Json::object(); }),
             "is packed by 'EXT_meshopt_compression'"));
  CHECK(says(refusal([](Json& j) { j["buffers"][0]["byteLength"] = 1 << 20; }), "announces 1048576 bytes"));
  CHECK(says(refusal([](Json& j) { j["nodes"][0]["mesh"] = 1; }), "nodes[0]: refers to meshes[1], and there are 1"));
  CHECK(says(refusal([](Json& j) { j["nodes"][0]["children"] = {0}; }), "nodes[0]: is shown twice"));
  CHECK(says(refusal([](Json& j) { j["nodes"][0]["scale"] = {1, 1, 2}; }), "nodes[0]: scales or shears"));
  CHECK(says(refusal([](Json& j) { j["nodes"][0]["scale"] = {1, 1, -1}; }), "nodes[0]: scales or shears"));
  CHECK(says(refusal([](Json& j) { j["nodes"][0]["scale"] = {0, 0, 0}; }), "nodes[0]: scales or shears"));
  CHECK(says(refusal([](Json& j) { j["nodes"][0]["rotation"] = {0, 0, 0, 0}; }), "its rotation has length 0"));
  CHECK(says(refusal([](Json& j) { j["nodes"][0]["translation"] = {0, 0}; }), "must be 3 finite numbers"));
  CHECK(says(refusal([](Json& j) { j["nodes"][0].erase("mesh"); }), "no node of its scene shows"));
  auto many = made(random_set(4, 1));
  for (int k = 1; k < 400; ++k) many.json["nodes"][std::size_t(k)] = {{"mesh", 0}}, many.json["scenes"][0]["nodes"].push_back(k);
  CHECK(says(error_of([&] { parse_gltf(many.bytes(), "many.glb"); }), "more than 16 times the file's bytes"));
  CHECK(says(error_of([&] { parse_gltf(bytes_of("{\"asset\":\n[}"), "a.gltf"); }), "a.gltf: line 2: is not valid JSON"));
  CHECK(says(error_of([&] { parse_gltf(bytes_of(std::string(100000, '[')), "a.gltf"); }), "is not valid JSON"));
  auto nan = good;
  float const v = NAN;
  std::memcpy(&nan.buffer[4], &v, 4);
  CHECK(says(error_of([&] { parse_gltf(nan.bytes(), "nan.glb"); }),
             "meshes[0].primitives[0]: Gaussian 0: position has a value that is not finite"));
  auto opaque = good;
  float const two = 2;
  std::memcpy(&opaque.buffer[40], &two, 4);
  CHECK(says(error_of([&] { parse_gltf(opaque.bytes(), "o.glb"); }), "Gaussian 0: opacity is outside 0..1"));
  CHECK(parse_gltf(
            [&] {
              auto m = good;
              splats(m.json)["colorSpace"] = "lin_rec709_display";
              return m.bytes();
            }(),
            "l.glb")
            .notes.size() == 1);
}

TEST_CASE("glTF: mutated files") {
  std::vector<std::vector<std::byte>> seeds{made(random_set(2, 1)).bytes(), format_glb(random_set(2, 0)),
                                            bytes_of(format_gltf(random_set(1, 1)))};
  check_mutations(seeds, 3000, [](Bytes b) { return parse_gltf(b, "m.glb"); });
}
