#pragma once
#include <array>
#include <gsp/core/detail/compiled.hpp>
#include <gsp/io/detail/gltf_file.hpp>
#include <gsp/io/detail/half_turn.hpp>
#include <gsp/io/detail/rigid_matrix.hpp>
#include <gsp/io/gltf.hpp>
#include <gsp/io/splat_transform.hpp>
#include <gsp/io/spz.hpp>
#include <tuple>

namespace gsp::io {

namespace detail {

inline constexpr char const* gltf_splats = "KHR_gaussian_splatting";

/// What is read out of a file, all primitives and places together, may be 16 times the file: several nodes may show one mesh, and
/// accessors may share bytes, which would let a small file become a huge set.
class GltfBudget {
 public:
  void take(GltfFile const& file, std::uint64_t bytes, std::string const& place) {
    if (bytes > 16 * file.size() - used_)
      fail(file.name(), place,
           "with it, more than 16 times the file's bytes are shown, by nodes or accessors that share them; show each once");
    used_ += bytes;
  }

 private:
  std::uint64_t used_ = 0;
};

/// The Gaussians of one primitive, in the frame of its mesh.
inline SplatSet parse_gltf_primitive(GltfFile& file, Json const& primitive, Json const& splats, std::string const& place,
                                     GltfBudget& budget) {
  std::string const& name = file.name();
  if (file.number(primitive, "mode", place, 4) != 0) fail(name, place, "Gaussians must have mode 0 (POINTS); export the file again");
  if (auto const kernel = file.text(splats, "kernel", place, "ellipse"); kernel != "ellipse")
    fail(name, place, "has the kernel " + in_quotes(kernel) + ", and only 'ellipse' is drawn; export it so");
  auto const colour = file.text(splats, "colorSpace", place, "srgb_rec709_display");
  if (colour != "srgb_rec709_display" && colour != "lin_rec709_display")
    fail(name, place, "has the colour space " + in_quotes(colour) + ", which is not known here; export it as 'srgb_rec709_display'");
  std::string const note = colour == "lin_rec709_display"
                               ? name + ": " + place + ": its colours are linear (lin_rec709_display), and are taken as they stand"
                               : "";
  auto const noted = [&](SplatSet set) {
    if (!note.empty()) set.notes.push_back(note);
    return set;
  };

  if (Json const* extensions = file.object(splats, "extensions", place))
    for (auto const& [key, value] : extensions->items()) {
      if (key != "KHR_gaussian_splatting_compression_spz" && key != "KHR_gaussian_splatting_compression_spz_2")
        fail(name, place, "needs the extension " + in_quotes(key) + ", which is not read here; export it without");
      if (!value.is_object()) fail(name, place, in_quotes(key) + " must be an object; the file is damaged");
      Bytes const packed = file.view(file.number(value, "bufferView", place), place);
      auto set = parse_spz(packed, name + ": " + place);
      budget.take(file, packed.size() + set.size(), place);
      half_turn(set, 0);  // back to the axes of the .spz, which here are those of the mesh
      return noted(std::move(set));
    }

  Json const* const attributes = file.object(primitive, "attributes", place);
  if (!attributes) fail(name, place, "has no attributes; the file is damaged");
  std::uint64_t count = 0, bytes = 0;
  auto const column = [&](std::string const& attribute, std::size_t width) {
    if (!attributes->contains(attribute)) fail(name, place, "has no attribute " + attribute + "; export the file again");
    auto const numbers = gltf_numbers(file, file.number(*attributes, attribute.c_str(), place), width, attribute, place);
    if (count == 0) count = numbers.count;
    if (numbers.count != count)
      fail(name, place,
           attribute + " has " + std::to_string(numbers.count) + " elements and POSITION " + std::to_string(count) +
               "; the file is damaged");
    bytes += numbers.packed();
    return numbers;
  };
  std::string const prefix = std::string(gltf_splats) + ":";
  auto const coefficient = [&](int l, int n) { return prefix + "SH_DEGREE_" + std::to_string(l) + "_COEF_" + std::to_string(n); };
  auto const positions = column("POSITION", 3), quats = column(prefix + "ROTATION", 4), scales = column(prefix + "SCALE", 3),
             opacities = column(prefix + "OPACITY", 1);
  int degree = 0;
  for (int l = 1; l <= 3; ++l)
    for (int n = 0; n <= 2 * l; ++n)
      if (attributes->contains(coefficient(l, n))) degree = l;  // all of this degree and those below are asked for
  std::vector<GltfNumbers> sh;
  for (int l = 0; l <= degree; ++l)
    for (int n = 0; n <= 2 * l; ++n) sh.push_back(column(coefficient(l, n), 3));
  budget.take(file, bytes, place);

  SplatSet set = make_splat_set(count, degree);
  auto const fill = [&](std::vector<float>& out, GltfNumbers const& from, std::size_t width, std::size_t stride, std::size_t first) {
    for (std::size_t i = 0; i < count; ++i)
      for (std::size_t k = 0; k < width; ++k) out[stride * i + first + k] = static_cast<float>(from(i, k));
  };
  fill(set.positions, positions, 3, 3, 0);
  fill(set.scales, scales, 3, 3, 0);
  fill(set.opacities, opacities, 1, 1, 0);
  for (std::size_t i = 0; i < count; ++i)
    for (std::size_t k = 0; k < 4; ++k) set.quats[4 * i + (k + 1) % 4] = static_cast<float>(quats(i, k));  // x y z w
  for (std::size_t t = 0; t < sh.size(); ++t) fill(set.sh, sh[t], 3, 3 * sh.size(), 3 * t);
  finish(set, name + ": " + place);
  return noted(std::move(set));
}

/// Where a node puts what it shows, in the frame of its parent.
inline AffineMap gltf_node_map(GltfFile const& file, Json const& node, std::string const& place) {
  if (!node.contains("matrix")) {
    auto const t = file.numbers<3>(node, "translation", place, {0, 0, 0}), s = file.numbers<3>(node, "scale", place, {1, 1, 1});
    auto const q = file.numbers<4>(node, "rotation", place, {0, 0, 0, 1});  // x y z w
    if (q == std::array<double, 4>{}) fail(file.name(), place, "its rotation has length 0; repair or export the file again");
    return affine_map(t, {q[3], q[0], q[1], q[2]}, s);
  }
  auto const m = file.numbers<16>(node, "matrix", place, {});  // column by column
  AffineMap map;
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) map.m[3 * i + j] = m[4 * j + i];
    map.t[i] = m[12 + i];
  }
  return map;
}

}  // namespace detail

GSP_INLINE SplatSet parse_gltf(Bytes bytes, std::string const& name, std::filesystem::path const& folder) {
  using namespace detail;
  GltfFile file(bytes, name, folder);
  Json const& root = file.root();
  auto const list = [&](Json const& object, char const* key, std::string const& place) {
    std::vector<std::uint64_t> out;
    auto const at = object.find(key);
    if (at == object.end()) return out;
    if (!at->is_array()) fail(name, place, "\"" + std::string(key) + "\" must be a list; the file is damaged");
    for (auto const& item : *at) {
      if (!item.is_number_unsigned())
        fail(name, place, "\"" + std::string(key) + "\" must hold whole numbers, not negative; the file is damaged");
      out.push_back(item.get<std::uint64_t>());
    }
    return out;
  };
  if (auto const required = root.find("extensionsRequired"); required != root.end() && required->is_array())
    for (auto const& item : *required) {
      std::string const text = item.is_string() ? item.get<std::string>() : "?";
      if (!text.starts_with(gltf_splats) && text != "KHR_mesh_quantization")
        fail(name, "extensionsRequired", "the file needs " + in_quotes(text) + ", which is not read here; export it without");
    }

  // Nodes of the scene, each behind its parent and its earlier siblings. One that comes a second time would make a circle, or two places.
  std::size_t const nodes = root.contains("nodes") && root["nodes"].is_array() ? root["nodes"].size() : 0;
  std::vector<char> seen(nodes, 0);
  std::vector<std::tuple<std::uint64_t, AffineMap>> open;
  if (root.contains("scenes")) {
    auto const scene = file.number(root, "scene", "scene", 0);
    for (auto n : list(file.element("scenes", scene, "scene"), "nodes", "scenes[" + std::to_string(scene) + "]"))
      open.emplace_back(n, AffineMap{});
  } else {
    std::vector<char> child(nodes, 0);
    for (std::size_t n = 0; n < nodes; ++n)
      for (auto c : list(file.element("nodes", n, "nodes"), "children", "nodes[" + std::to_string(n) + "]"))
        if (c < nodes) child[c] = 1;
    for (std::size_t n = 0; n < nodes; ++n)
      if (!child[n]) open.emplace_back(n, AffineMap{});
  }
  std::reverse(open.begin(), open.end());

  SplatSet set;
  GltfBudget budget;
  std::size_t other = 0;
  while (!open.empty()) {
    auto const [n, parent] = open.back();
    open.pop_back();
    std::string const place = "nodes[" + std::to_string(n) + "]";
    Json const& node = file.element("nodes", n, place);
    if (std::exchange(seen[n], 1)) fail(name, place, "is shown twice, by two parents or itself; the file is damaged");
    auto const map = parent * gltf_node_map(file, node, place);
    auto const children = list(node, "children", place);
    for (auto c = children.rbegin(); c != children.rend(); ++c) open.emplace_back(*c, map);
    if (!node.contains("mesh")) continue;
    auto const m = file.number(node, "mesh", place);
    Json const& mesh = file.element("meshes", m, place);
    auto const primitives = mesh.find("primitives");
    if (primitives == mesh.end() || !primitives->is_array())
      fail(name, "meshes[" + std::to_string(m) + "]", "has no primitives; the file is damaged");
    for (std::size_t p = 0; p < primitives->size(); ++p) {
      std::string const where = "meshes[" + std::to_string(m) + "].primitives[" + std::to_string(p) + "]";
      Json const& primitive = (*primitives)[p];
      if (!primitive.is_object()) fail(name, where, "must be an object; the file is damaged");
      budget.take(file, 8, where);
      Json const* const extensions = file.object(primitive, "extensions", where);
      Json const* const splats = extensions ? file.object(*extensions, gltf_splats, where) : nullptr;
      if (!splats) {
        ++other;
        continue;
      }
      auto part = parse_gltf_primitive(file, primitive, *splats, where, budget);
      if (!map.identity()) {
        auto const pose = rigid(map);
        if (!pose)
          fail(
              name, place,
              "scales or shears its axes differently, which turns no Gaussian into a Gaussian with the same colours; apply it to the data");
        transform(part, *pose);
      }
      append(set, part);
    }
  }
  if (set.size() == 0)
    fail(name, "", std::string("no node of its scene shows a mesh with ") + gltf_splats + "; export Gaussians with that extension");
  half_turn(set, 2);
  set.notes.erase(std::unique(set.notes.begin(), set.notes.end()), set.notes.end());
  if (other > 0) set.notes.push_back(name + ": " + std::to_string(other) + " mesh primitives that are no Gaussians are left out");
  if (root.contains("animations")) set.notes.push_back(name + ": its animations are without effect");
  finish(set, name);
  return set;
}

GSP_INLINE SplatSet read_gltf(std::filesystem::path const& path) {
  auto const folder = path.has_parent_path() ? path.parent_path() : std::filesystem::path(".");
  return parse_gltf(read_file(path), path.string(), folder);
}

namespace detail {

struct GltfParts {
  nlohmann::ordered_json json;  // without the size and place of its buffer
  std::vector<std::byte> buffer;
};

inline GltfParts gltf_parts(SplatSet set) {
  using Ordered = nlohmann::ordered_json;
  validate(set, "gsp::io::format_gltf");
  half_turn(set, 2);
  std::size_t const n = set.size(), terms = set.sh_terms();
  GltfParts parts;
  auto views = Ordered::array(), accessors = Ordered::array();
  auto attributes = Ordered::object();
  auto const add = [&](std::string const& attribute, std::size_t width, auto const& value) {
    std::size_t const first = parts.buffer.size();
    parts.buffer.resize(first + 4 * n * width);
    for (std::size_t i = 0; i < n; ++i)
      for (std::size_t k = 0; k < width; ++k) {
        float const v = value(i, k);
        std::memcpy(parts.buffer.data() + first + 4 * (width * i + k), &v, 4);
      }
    char const* const types[] = {"SCALAR", "VEC2", "VEC3", "VEC4"};
    attributes[attribute] = accessors.size();
    accessors.push_back({{"bufferView", views.size()}, {"componentType", 5126}, {"count", n}, {"type", types[width - 1]}});
    views.push_back({{"buffer", 0}, {"byteOffset", first}, {"byteLength", 4 * n * width}, {"target", 34962}});
  };
  std::string const prefix = std::string(gltf_splats) + ":";
  add("POSITION", 3, [&](std::size_t i, std::size_t k) { return set.positions[3 * i + k]; });
  std::array<float, 3> low{}, high{};
  for (std::size_t k = 0; k < 3; ++k) {
    low[k] = high[k] = set.positions[k];
    for (std::size_t i = 0; i < n; ++i) {
      low[k] = std::min(low[k], set.positions[3 * i + k]);
      high[k] = std::max(high[k], set.positions[3 * i + k]);
    }
  }
  accessors[0]["min"] = low;
  accessors[0]["max"] = high;
  add(prefix + "ROTATION", 4, [&](std::size_t i, std::size_t k) { return set.quats[4 * i + (k + 1) % 4]; });
  add(prefix + "SCALE", 3, [&](std::size_t i, std::size_t k) { return set.scales[3 * i + k]; });
  add(prefix + "OPACITY", 1, [&](std::size_t i, std::size_t) { return set.opacities[i]; });
  for (std::size_t l = 0, t = 0; t < terms; ++l)
    for (std::size_t m = 0; m <= 2 * l; ++m, ++t)
      add(prefix + "SH_DEGREE_" + std::to_string(l) + "_COEF_" + std::to_string(m), 3,
          [&](std::size_t i, std::size_t k) { return set.sh[3 * (terms * i + t) + k]; });
  Ordered const splats{
      {"kernel", "ellipse"}, {"colorSpace", "srgb_rec709_display"}, {"projection", "perspective"}, {"sortingMethod", "cameraDistance"}};
  Ordered const primitive{{"attributes", attributes}, {"mode", 0}, {"extensions", {{gltf_splats, splats}}}};
  parts.json["asset"] = {{"version", "2.0"}, {"generator", "gsp"}};
  parts.json["extensionsUsed"] = Ordered::array({gltf_splats});
  parts.json["scene"] = 0;
  parts.json["scenes"] = Ordered::array({Ordered{{"nodes", Ordered::array({0})}}});
  parts.json["nodes"] = Ordered::array({Ordered{{"mesh", 0}}});
  parts.json["meshes"] = Ordered::array({Ordered{{"primitives", Ordered::array({primitive})}}});
  parts.json["buffers"] = Ordered::array({Ordered{{"byteLength", parts.buffer.size()}}});
  parts.json["bufferViews"] = std::move(views);
  parts.json["accessors"] = std::move(accessors);
  return parts;
}

}  // namespace detail

GSP_INLINE std::vector<std::byte> format_glb(SplatSet const& set) {
  auto const [json, buffer] = detail::gltf_parts(set);
  std::string text = json.dump();
  text.resize((text.size() + 3) / 4 * 4, ' ');
  std::uint64_t const total = 12 + 8 + text.size() + 8 + buffer.size();
  if (total > 0xffffffff)
    detail::fail("gsp::io::format_glb", "", "the file would pass 4 GiB, the most that .glb may have; write fewer Gaussians to a file");
  auto const word = [](std::uint64_t v) { return static_cast<std::uint32_t>(v); };
  std::array<std::uint32_t, 5> const head{0x46546c67, 2, word(total), word(text.size()), 0x4e4f534a};
  std::array<std::uint32_t, 2> const chunk{word(buffer.size()), 0x004e4942};
  std::vector<std::byte> out;
  out.reserve(total);
  for (Bytes part :
       std::initializer_list<Bytes>{std::as_bytes(std::span(head)), detail::as_bytes(text), std::as_bytes(std::span(chunk)), Bytes(buffer)})
    out.insert(out.end(), part.begin(), part.end());
  return out;
}

GSP_INLINE std::string format_gltf(SplatSet const& set) {
  auto parts = detail::gltf_parts(set);
  parts.json["buffers"][0]["uri"] = "data:application/octet-stream;base64," + detail::base64(parts.buffer);
  return parts.json.dump() + "\n";
}

GSP_INLINE void write_gltf(std::filesystem::path const& path, SplatSet const& set) {
  if (has_ending(path.string(), ".gltf"))
    write_file(path, detail::as_bytes(format_gltf(set)));
  else
    write_file(path, format_glb(set));
}

}  // namespace gsp::io
