// Writes a few small valid files per reader under FOLDER/<reader>/, where the fuzzer starts from: make_seeds FOLDER
#include <cstdio>
#include <gsp/io/gltf.hpp>
#include <gsp/io/npz.hpp>
#include <gsp/io/ply.hpp>
#include <gsp/io/png.hpp>
#include <gsp/io/sog.hpp>
#include <gsp/io/usda.hpp>
#include <io/fixtures.hpp>
#include <io/mesh_fixtures.hpp>

using namespace gsp::io;
using namespace gsp_test;

int main(int argc, char** argv) {
  if (argc != 2) {
    std::fputs("usage: make_seeds FOLDER\n", stderr);
    return 2;
  }
  std::filesystem::path const root = argv[1];
  auto seed = [&](std::string const& reader, std::string const& name, std::vector<std::byte> const& bytes) {
    std::filesystem::create_directories(root / reader);
    write_file(root / reader / name, bytes);
  };
  for (int degree = 0; degree <= 3; ++degree) {
    std::string const d = std::to_string(degree);
    SplatSet set = random_set(2, degree);
    seed("ply", "plain" + d, format_ply(set));
    seed("sog", "bundle" + d, format_sog(random_set(2, degree)));
    for (auto const& [file, bytes] : detail::sog_files(random_set(2, degree)).files) seed("sog", file + d, bytes);
    seed("usda", "plain" + d, bytes_of(format_usda(random_set(1, degree))));
    seed("gltf", "binary" + d, format_glb(random_set(1, degree)));
    seed("gltf", "text" + d, bytes_of(format_gltf(random_set(1, degree))));
    set.link_names = {"foot", "arm"};
    set.link = {1, -1};
    seed("ply", "linked" + d, format_ply(set));
    seed("ply", "packed" + d, compressed_ply(2, 18, degree));
    for (int version = 1; version <= 3; ++version)
      seed("spz", "data" + std::to_string(version) + d, spz_data(2, version, degree)),
          seed("spz", "gzip" + std::to_string(version) + d, gzip(spz_data(2, version, degree)));
  }
  for (int degree = 0; degree <= 3; ++degree) seed("spz", "streams" + std::to_string(degree), spz4(spz_data(2, 4, degree)));
  seed("usda", "moved",
       bytes_of("#usda 1.0\n(\n doc = \"\"\"a\nb\"\"\"\n upAxis = \"Z\"\n metersPerUnit = 0.01\n)\ndef Xform \"a\" (active = true) {\n"
                "  double3 xformOp:translate = (1, 2, 3)\n  float3 xformOp:rotateXYZ = (10, 20, 30)\n  matrix4d xformOp:transform = "
                "((1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (4, 5, 6, 1))\n  uniform token[] xformOpOrder = [\"xformOp:translate\", "
                "\"xformOp:rotateXYZ\", \"xformOp:transform\"]\n  rel x = </a/b>\n  def ParticleField3DGaussianSplat \"b\" {\n"
                "    point3h[] positionsh = [(1, 2, 3)]\n    quath[] orientationsh = [(1, 0, 0, 0)]\n  }\n}\n"));
  seed("ply", "old", compressed_ply(2, 12, 0));
  std::string text = "ply\nformat ascii 1.0\nelement vertex 1\n";
  for (auto p :
       {"x", "y", "z", "f_dc_0", "f_dc_1", "f_dc_2", "opacity", "scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"})
    text += std::string("property float ") + p + "\n";
  seed("ply", "text", bytes_of(text + "end_header\n1 2.5 -3e2 0 0 0 1 -4 -4 -4 1 0 0 0\n"));
  std::vector<std::byte> splat;
  for (float v : {1.f, 2.f, 3.f, .1f, .2f, .3f}) put(splat, v);
  for (int v : {200, 100, 50, 255, 255, 128, 128, 128}) put(splat, std::uint8_t(v));
  seed("splat_file", "one", splat);
  seed("splat_links", "two",
       bytes_of(R"({"links": [{"name": "FL_foot", "first": 0, "count": 10}, {"name": "trunk", "first": 20, "count": 5}]})"));
  std::vector<double> const numbers{1, 2, 3, 4, 5, 6};
  Folder folder;
  for (int level : {0, 6}) {
    write_npz(folder.path / "a", {{"qpos", {{1, 2, 3}, numbers}}, {"t", {{6}, std::vector<float>{1, 2, 3, 4, 5, 6}}}}, {level});
    seed("npz", "level" + std::to_string(level), read_file(folder.path / "a"));
  }
  write_npy(folder.path / "b", {{2, 3}, numbers});
  seed("npy", "doubles", read_file(folder.path / "b"));
  write_npy(folder.path / "b", {{3, 1, 2}, std::vector<std::int32_t>{1, 2, 3, 4, 5, 6}});
  seed("npy", "ints", read_file(folder.path / "b"));
  std::string fortran(detail::as_text(read_file(folder.path / "b")));
  fortran.replace(fortran.find("False"), 5, "True ");
  seed("npy", "fortran", bytes_of(fortran));
  for (int channels = 1; channels <= 4; ++channels) {
    auto b = make_bitmap<std::uint8_t>(5, 4, channels, 77);
    for (std::size_t i = 0; i < b.pixels.size(); ++i) b.pixels[i] = static_cast<std::uint8_t>(i * 37);
    seed("png", "bytes" + std::to_string(channels), format_png(b));
    seed("png", "words" + std::to_string(channels), format_png(make_bitmap<std::uint16_t>(3, 2, channels, 7777)));
  }
  for (auto [depth, color] : {std::pair{1, 0}, {2, 3}, {8, 3}, {16, 2}}) {  // header and rows, for the third way in
    std::vector<std::byte> raw;
    detail::put_be(raw, 5), detail::put_be(raw, 3);
    for (int v : {depth, color, 0, 0, int(depth == 1)}) raw.push_back(std::byte(v));
    raw.resize(13 + 150);
    seed("png", "rows" + std::to_string(depth) + std::to_string(color), raw);
  }
  for (auto const& [name, soup] : {std::pair{"tetrahedron", tetrahedron()}, {"box", box_mesh(1, .5f, .25f)}, {"potato", potato(1, 4, 4)}}) {
    seed("stl", std::string("binary_") + name, stl_binary(soup));
    seed("stl", std::string("text_") + name, bytes_of(stl_text(soup)));
    seed("obj", name, bytes_of(obj_text(soup)));
    seed("msh", name, msh_binary(soup, true, true));
    seed("msh", std::string("plain_") + name, msh_binary(soup));
  }
  seed("obj", "polygons",
       bytes_of(
           "g a\nv 0 0 0\nv 1 0 .1\nv 1.2 1 -2e-1\nv -.1 1 .3\nv .2 .3 1\nvn 0 0 1\nvt 0 0\nf 1/1/1 2/1/1 3/1/1 4/1/1\nf -1 -2 -3 -4 -5\n"
           "usemtl x\nf 1//1 2//1 5//1\no b\nf 1 2 3\n"));
  seed("hfield", "binary", hfield_binary(3, 2, {1, 2, 3, 4, 5, 6}));
  auto ground = make_bitmap<std::uint8_t>(4, 3, 1, 9);
  ground.pixels[5] = 200;
  seed("hfield", "picture", format_png(ground));
}
