#pragma once
#include <algorithm>
#include <cmath>
#include <gsp/geometry/shapes.hpp>
#include <gsp/model/detail/mesh_compile.hpp>
#include <string>
#include <unordered_map>

namespace gsp::detail {

/// What a geom is once its asset is known. A mesh lends its frame and inertia; a primitive that names a mesh is fitted to it; a height
/// field weighs as the box about its middle.
struct GeomShape {
  Double3 size{0, 0, 0}, pos{0, 0, 0};
  Double4 quat{1, 0, 0, 0};
  int data = -1;  // index of the mesh or height field that it keeps
  double rbound = 0;
  ShapeInertia inertia{};
};

/// The smallest rule of MuJoCo's that gives a primitive the mesh's inertia (its box), or with fitaabb its bounds.
inline Double3 fitted_size(ShapeType type, CompiledMesh const& mesh, bool aabb, Double3 size) {
  auto const extent = 0.5 * (mesh.high - mesh.low);
  auto const& s = aabb ? extent : mesh.box;
  double const across = aabb ? std::max(s[0], s[1]) : (s[0] + s[1]) / 2;
  switch (type) {
    case ShapeType::sphere:
      size[0] = aabb ? std::max(across, s[2]) : (s[0] + s[1] + s[2]) / 3;
      break;
    case ShapeType::capsule:
      size[0] = across;
      size[1] = aabb ? s[2] - across : std::max(0., s[2] - across / 2);
      break;
    case ShapeType::cylinder:
      size[0] = across;
      size[1] = s[2];
      break;
    default:
      size = s;
  }
  return size;
}

/// The meshes and height fields of a description, compiled once, by name; and what geoms become with them.
class GeomShapes {
 public:
  template <class Fail>  // fail(place, what, name, sentence) throws
  GeomShapes(Description const& d, Fail const& fail) : fit_aabb_(d.compiler.fit_aabb), hfields_(d.hfields) {
    auto const enter = [&](auto& names, auto const& item, char const* what, int index) {
      if (item.name.empty()) fail(item.place, what, item.name, "has no name, so that no geom can use it: name it");
      if (!names.emplace(item.name, index).second)
        fail(item.place, what, item.name, "has a name that is taken already: rename one of the two");
    };
    for (auto const& mesh : d.meshes) {
      enter(mesh_at_, mesh, "mesh", int(meshes_.size()));
      meshes_.push_back(compile_mesh(mesh, [&](std::string const& sentence) { fail(mesh.place, "mesh", mesh.name, sentence); }));
    }
    for (int i = 0; i < int(hfields_.size()); ++i) {
      auto& h = hfields_[i];
      enter(hfield_at_, h, "hfield", i);
      for (double s : h.size)
        if (!(s > 0) || !std::isfinite(s))
          fail(h.place, "hfield", h.name, "has a size that is not positive: give half x, half y, top and base");
      if (h.rows < 2 || h.columns < 2)
        fail(h.place, "hfield", h.name,
             "has " + std::to_string(h.rows) + " rows of " + std::to_string(h.columns) +
                 ": give 2 or more of each, between which its surface lies");
      if (h.elevation.size() != std::size_t(h.rows) * std::size_t(h.columns))
        fail(h.place, "hfield", h.name,
             "has " + std::to_string(h.elevation.size()) + " elevations for " + std::to_string(h.rows) + " rows of " +
                 std::to_string(h.columns) + ": give one for each");
      for (float e : h.elevation)
        if (!std::isfinite(e)) fail(h.place, "hfield", h.name, "has an elevation that is not finite: correct it");
      normalize_elevation(h.elevation);
    }
  }
  std::vector<CompiledMesh>& meshes() { return meshes_; }  // geoms need neither vertices nor faces: they may be moved away
  std::vector<HeightFieldDescription> const& hfields() const { return hfields_; }

  template <class Fail>
  GeomShape operator()(GeomDescription const& g, Fail const& fail) const {
    auto const refuse = [&](std::string const& sentence) { fail(g.place, "geom", g.name, sentence); };
    GeomShape shape{g.size, g.pos, normalized(g.quat)};
    bool const is_mesh = g.type == ShapeType::mesh, is_hfield = g.type == ShapeType::hfield;
    if (is_mesh && g.mesh.empty()) refuse("is a mesh but names none: set its mesh");
    if (is_hfield != !g.hfield.empty())
      refuse(is_hfield ? "is a height field but names none: set its hfield"
                       : "names the hfield '" + g.hfield + "' but has another type: set type=\"hfield\"");
    if (!g.mesh.empty()) {
      auto const found = mesh_at_.find(g.mesh);
      if (found == mesh_at_.end()) refuse("uses the mesh '" + g.mesh + "', which does not exist: correct the name");
      auto const& mesh = meshes_[found->second];
      Double3 center{0, 0, 0};
      if (is_mesh) {
        if (g.shell_inertia) refuse("is a mesh with shellinertia, which belongs to the asset: set inertia=\"shell\" on the mesh");
        for (int k = 0; k < 3; ++k) shape.size[k] = std::max(std::abs(mesh.low[k]), std::abs(mesh.high[k]));
        shape.data = found->second;
        auto const& b = mesh.box;
        shape.inertia = {mesh.measure, {(b[1] * b[1] + b[2] * b[2]) / 3, (b[0] * b[0] + b[2] * b[2]) / 3, (b[0] * b[0] + b[1] * b[1]) / 3}};
      } else {
        if (g.type == ShapeType::plane || is_hfield) refuse("cannot be fitted to a mesh: use sphere, capsule, cylinder, ellipsoid or box");
        if (!std::isfinite(g.fitscale)) refuse("has a fitscale that is not finite: give it a value");
        if (fit_aabb_) center = 0.5 * (mesh.low + mesh.high);
        shape.size = g.fitscale * fitted_size(g.type, mesh, fit_aabb_, g.size);
      }
      shape.pos = shape.pos + rotate(shape.quat, mesh.pos + rotate(mesh.quat, center));
      shape.quat = normalized(times(shape.quat, mesh.quat));
    }
    if (is_hfield) {
      auto const found = hfield_at_.find(g.hfield);
      if (found == hfield_at_.end()) refuse("uses the hfield '" + g.hfield + "', which does not exist: correct the name");
      auto const& s = hfields_[found->second].size;
      shape.data = found->second;
      shape.size = {s[0], s[1], 0.25 * s[2] + 0.5 * s[3]};
      shape.rbound = std::hypot(s[0], s[1], std::max(s[2], s[3]));
      shape.inertia = shape_inertia(ShapeType::box, shape.size, g.shell_inertia);
    } else {
      shape.rbound = is_mesh ? norm(shape.size) : bounding_radius(g.type, shape.size);
      if (!is_mesh) shape.inertia = shape_inertia(g.type, shape.size, g.shell_inertia);
    }
    return shape;
  }

 private:
  bool fit_aabb_;
  std::vector<CompiledMesh> meshes_;
  std::vector<HeightFieldDescription> hfields_;
  std::unordered_map<std::string, int> mesh_at_, hfield_at_;
};

}  // namespace gsp::detail
