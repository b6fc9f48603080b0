#pragma once
#include <array>
#include <cmath>
#include <filesystem>
#include <gsp/io/detail/mjcf_document.hpp>
#include <gsp/io/hfield.hpp>
#include <gsp/io/mesh.hpp>
#include <gsp/io/mesh_builtin.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

/// <asset>: meshes, height fields, colours of materials, models to attach. Textures and skins are not read.
namespace gsp::io::detail::mjcf {

/// A file of the model: below the model's own folder and meshdir.
inline std::filesystem::path asset_path(Document const& doc, Attributes const& a) {
  std::filesystem::path file = a.text("file");
  if (doc.strip_path) file = file.filename();
  return (doc.session.files.folders[std::size_t(doc.file)] / doc.asset_folder / file).lexically_normal();
}
inline std::string asset_name(Attributes const& a) {
  std::string const name = a.text("name");
  return name.empty() ? std::filesystem::path(a.text("file")).stem().string() : name;
}
/// What `make` returns; where it fails, the place in the document stands before the message.
template <class Make>
auto with_place(Document const& doc, Place const& place, Make const& make) {
  try {
    return make();
  } catch (Error const& e) { throw Error(doc.session.files.at(place) + e.what()); }
}
/// Reads a file of an asset. A missing one is an error, unless visuals may be left out: then it is one where something needs the asset.
template <class Parse>
auto load_asset(Document& doc, Attributes const& a, std::string const& name, Parse const& parse)
    -> std::optional<decltype(parse(Bytes{}, ""))> {
  auto const path = asset_path(doc, a);
  std::vector<std::byte> bytes;
  try {
    bytes = doc.session.files.load(a.place(), path);
  } catch (Error const& e) {
    if (!doc.session.skip_visuals && !doc.session.list_refusals)
      throw Error(std::string(e.what()) + ", or leave out geoms that are only seen with MjcfOptions::skip_visuals (--skip-visuals)");
    doc.missing[name] = e.what();
    doc.note(doc.session.skip_visuals ? Line::left_out : Line::refused, a.place(),
             "asset " + in_quotes(name) + ": " + path.string() + " cannot be read");
    return std::nullopt;
  }
  return with_place(doc, a.place(), [&] { return parse(Bytes(bytes), path.string()); });
}
inline std::vector<int> whole(Attributes const& a, std::string_view name) {
  std::vector<int> out;
  for (double x : a.list(name)) {
    if (x != std::floor(x) || std::abs(x) > 2147483647.) a.fail(name, "holds a number that is not whole; correct it");
    out.push_back(static_cast<int>(x));
  }
  return out;
}

inline void read_mesh_asset(Document& doc, Node const& node) {
  if (!doc.check(node)) return;
  if (!node.children.empty()) return doc.refuse_element(node.children[0], "<mesh> ");
  auto const a = doc.attributes(node, "mesh", "");
  std::string const name = asset_name(a), what = "mesh " + in_quotes(name);
  bool const from_file = a.own("file"), builtin = a.own("builtin");
  if (name.empty()) a.fail("name", "is missing; name the mesh or its file");
  if (!from_file && !builtin && !a.own("vertex")) a.fail("file", "is missing; name a file or a built-in mesh, or give vertex");
  if (from_file && (a.own("vertex") || a.own("face"))) a.fail("file", "stands beside vertex or face; keep one of the two");
  if (builtin && (from_file || a.own("vertex") || a.own("face"))) a.fail("builtin", "stands beside file, vertex or face; keep one of them");
  if (!builtin && a.own("params")) a.fail("params", "stands without builtin, which says what they mean; add it or remove them");
  auto inertia = MeshInertia::legacy;
  if (a.has("inertia")) {
    constexpr std::array modes{MeshInertia::convex, MeshInertia::exact, MeshInertia::legacy, MeshInertia::shell};
    inertia = modes[std::size_t(a.choice("inertia", {"convex", "exact", "legacy", "shell"}))];
  }
  MeshDescription m;
  if (from_file) {
    std::string ignored;
    auto read = load_asset(doc, a, name,
                           [&](Bytes bytes, std::string const& file) { return parse_mesh(bytes, file, a.text("content_type"), &ignored); });
    if (!read) return;
    if (!ignored.empty()) doc.note(Line::left_out, node.place, what + ": " + ignored);
    m = std::move(*read);
    m.inertia = inertia;
  } else if (builtin) {
    auto const params = a.list("params");
    m = with_place(doc, node.place, [&] { return make_builtin_mesh(a.text("builtin"), params, what, inertia); });
  } else {
    auto const vertex = a.list("vertex");
    auto const face = whole(a, "face");
    m = with_place(doc, node.place, [&] { return make_mesh(vertex, face, what); });
    m.inertia = inertia;
  }
  m.name = name;
  m.place = node.place;
  a.numbers("scale", m.scale);
  a.numbers("refpos", m.refpos);
  a.numbers("refquat", m.refquat);
  if (a.integer("maxhullvert", m.max_hull_vertices) && m.max_hull_vertices != -1 && m.max_hull_vertices < 4)
    a.fail("maxhullvert", "is below 4; give 4 or more, or -1");
  doc.draft.meshes.push_back(std::move(m));
}

inline void read_hfield_asset(Document& doc, Node const& node) {
  doc.check(node);
  auto const a = doc.attributes(node);
  std::string const name = asset_name(a), what = "hfield " + in_quotes(name);
  if (name.empty()) a.fail("name", "is missing; name the height field or its file");
  HeightFieldDescription h;
  if (a.own("file")) {
    auto read =
        load_asset(doc, a, name, [&](Bytes bytes, std::string const& file) { return parse_hfield(bytes, file, a.text("content_type")); });
    if (!read) return;
    h = std::move(*read);
  } else {
    int rows = 0, columns = 0;
    a.integer("nrow", rows);
    a.integer("ncol", columns);
    auto const elevation = a.list("elevation");
    h = with_place(doc, node.place, [&] { return make_hfield(rows, columns, elevation, what); });
  }
  h.name = name;
  h.place = node.place;
  if (!a.numbers("size", h.size)) a.fail("size", "is missing; give half x, half y, top and base");
  doc.draft.hfields.push_back(std::move(h));
}

/// <deformable>: skins move with bodies and are seen only; flexes are refused.
inline void read_deformables(Document& doc, Node const& node) {
  doc.check(node);
  for (auto const& child : node.children)
    if (!doc.refuses(child, "<deformable> ")) doc.skip_visual(child);
}

/// A <model> without a name goes by the name that the model gives itself, else by that of its file.
inline std::string name_of_model(Files const& files, Node const& node) {
  auto const path = files.resolve(node.place, *node.find("file"));
  auto const bytes = files.load(node.place, path);
  pugi::xml_document document;
  document.load_buffer(bytes.data(), bytes.size(), pugi::parse_default, pugi::encoding_utf8);
  std::string const name = document.child("mujoco").attribute("model").value();
  return name.empty() ? path.stem().string() : name;
}

inline void read_assets(Document& doc, Node const& node) {
  doc.check(node);
  for (auto const& child : node.children) {
    if (doc.refuses(child)) continue;
    if (child.name == "texture") {
      doc.check(child);
    } else if (child.name == "skin") {
      doc.skip_visual(child);
    } else if (child.name == "mesh") {
      read_mesh_asset(doc, child);
    } else if (child.name == "hfield") {
      read_hfield_asset(doc, child);
    } else if (child.name == "material") {
      doc.check_all(child);
      auto const a = doc.attributes(child, "material", "");
      std::array<double, 4> rgba{1, 1, 1, 1};
      a.numbers("rgba", rgba);
      doc.materials[a.text("name")] = {float(rgba[0]), float(rgba[1]), float(rgba[2]), float(rgba[3])};
    } else if (child.name == "model") {
      doc.check(child);
      auto const a = doc.attributes(child);
      std::string const file = a.text("file");
      if (file.empty()) a.fail("file", "is missing; name the model's file");
      std::string name = a.text("name");
      if (name.empty()) name = name_of_model(doc.session.files, child);
      if (!doc.models.emplace(name, child).second)
        a.fail("name", "is " + in_quotes(name) + ", which another <model> has; rename one of the two");
    }
  }
}

}  // namespace gsp::io::detail::mjcf
