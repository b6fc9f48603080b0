#pragma once
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <gsp/core/check.hpp>
#include <gsp/geometry/shapes.hpp>
#include <gsp/model/compiled.hpp>
#include <string>
#include <vector>

namespace gsp::detail {

/// The surface of a geom in its frame: a closed form of its shape, or the triangles of its mesh, or of the top of its height field.
class GeomSurface {
 public:
  GeomSurface(CompiledModel const& model, int geom, double plane_half)
      : type_(ShapeType(model.geom_type[geom])), size_(model.geom_size[geom]) {
    if (type_ == ShapeType::plane)
      for (int k = 0; k < 2; ++k)
        if (!(size_[k] > 0)) size_[k] = plane_half;
    if (type_ == ShapeType::mesh) {
      auto const& vertices = model.mesh_vertices[model.geom_data[geom]];
      auto const at = [&](int v) { return Vec3<double>{vertices[v][0], vertices[v][1], vertices[v][2]}; };
      for (auto const& face : model.mesh_faces[model.geom_data[geom]]) add(at(face[0]), at(face[1]), at(face[2]));
    } else if (type_ == ShapeType::hfield)
      add_top(model.hfields[model.geom_data[geom]]);
    else if (!has_surface(type_))
      throw Error("gsp::sample_surface: geom " + std::to_string(geom) + " ('" + model.geom_name[geom] + "') is a " + shape_name(type_) +
                  ", which has neither a closed form nor triangles: choose other groups");
  }
  /// [m^2]
  double area() const { return has_surface(type_) ? surface_area(type_, size_) : up_to_.empty() ? 0 : up_to_.back(); }
  /// Half of the least width, about [m].
  double thickness() const {
    if (has_surface(type_)) return gsp::thickness(type_, size_);
    return 0.5 * std::min({most_.x - least_.x, most_.y - least_.y, most_.z - least_.z});
  }
  /// The point for (t, w) in [0, 1)^2, even by area: t chooses the triangle, and with w the place in it.
  SurfacePoint point(double t, double w) const {
    if (has_surface(type_)) return surface_point(type_, size_, t, w);
    double const at = t * area();
    auto const i = std::min<std::size_t>(std::upper_bound(up_to_.begin(), up_to_.end(), at) - up_to_.begin(), up_to_.size() - 1);
    auto const& [a, b, c] = triangle_[i];
    double const before = i > 0 ? up_to_[i - 1] : 0, share = std::clamp((at - before) / (up_to_[i] - before), 0., 1.);
    double const u = std::sqrt(share);  // from a to the side opposite of it: as many points on each half of the area
    auto const normal = cross(b - a, c - a);
    return {a + u * (b - a) + u * w * (c - b), (1 / norm(normal)) * normal};
  }

 private:
  using Point = Vec3<double>;
  void add(Point const& a, Point const& b, Point const& c) {
    double const area = 0.5 * norm(cross(b - a, c - a));
    if (!(area > 0)) return;
    triangle_.push_back({a, b, c});
    up_to_.push_back((up_to_.empty() ? 0 : up_to_.back()) + area);
    for (Point const& p : {a, b, c}) {
      least_ = {std::min(least_.x, p.x), std::min(least_.y, p.y), std::min(least_.z, p.z)};
      most_ = {std::max(most_.x, p.x), std::max(most_.y, p.y), std::max(most_.z, p.z)};
    }
  }
  void add_top(HeightFieldDescription const& field) {
    std::vector<double> const elevation(field.elevation.begin(), field.elevation.end());
    ShapeAsset<double> asset;
    asset.elevation = elevation.data();
    asset.rows = field.rows;
    asset.columns = field.columns;
    std::copy(field.size.begin(), field.size.end(), asset.extent);
    auto const at = [&](int row, int column) { return HfieldShape::point(asset, row, column); };
    for (int r = 0; r + 1 < field.rows; ++r)
      for (int c = 0; c + 1 < field.columns; ++c) {
        add(at(r, c), at(r, c + 1), at(r + 1, c));
        add(at(r + 1, c + 1), at(r + 1, c), at(r, c + 1));
      }
    least_.z = -field.size[3];  // what it stands on
  }

  ShapeType type_;
  Double3 size_;
  std::vector<std::array<Point, 3>> triangle_;
  std::vector<double> up_to_;  // area of the triangles up to each
  Point least_{1e300, 1e300, 1e300}, most_{-1e300, -1e300, -1e300};
};

}  // namespace gsp::detail
