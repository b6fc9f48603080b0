#pragma once
#include <array>
#include <cmath>
#include <gsp/model/detail/host_math.hpp>
#include <gsp/model/detail/principal_axes.hpp>
#include <utility>
#include <vector>

/// Volume, centre of mass and inertia of triangle meshes by MuJoCo's rules, summed in its order, per unit of density.
namespace gsp::detail {

struct MeshSolid {
  double measure = 0;    // volume [m^3]; of a shell its area [m^2]; negative where the faces look inwards
  Double3 com{0, 0, 0};  // [m]
  Symmetric3 inertia{};  // about com
  double surface = 0;    // area of all faces, whatever was asked for
};

/// A face's middle and (b - a) x (c - a): along its normal, twice as long as its area is large. Zero where under 1e-15, as MuJoCo ignores
/// such faces.
struct MeshTriangle {
  Double3 center, cross;
  double twice_area;
};
inline MeshTriangle mesh_triangle(Double3 const& a, Double3 const& b, Double3 const& c) {
  auto const n = cross(b - a, c - a);
  double const length = norm(n);
  Double3 const center{(a[0] + b[0] + c[0]) / 3, (a[1] + b[1] + c[1]) / 3, (a[2] + b[2] + c[2]) / 3};
  if (!(length >= 1e-15)) return {center, {0, 0, 0}, 0};
  return {center, n, length};
}

/// The solid between the faces, or the faces as a thin shell. `surface` gives the point from which volumes are measured (the faces' centre
/// of area), `faces` what encloses the mass (they differ where a mesh takes the inertia of its hull).
///   volume of a pyramid (apex at the centre of area, base a face):  v = (center - apex) . ((b - a) x (c - a)) / 6;  `legacy` takes |v|
///   its centre of mass:  3/4 center + 1/4 apex
///   second moments of a tetrahedron with one corner at the origin and the others d, e, f (a triangle: v = area and 12 instead of 20):
///     integral x_i x_j dV = v / 20 (2 (d_i d_j + e_i e_j + f_i f_j) + d_i e_j + d_j e_i + d_i f_j + d_j f_i + e_i f_j + e_j f_i)
inline MeshSolid mesh_solid(std::vector<Double3> const& vertices, std::vector<std::array<int, 3>> const& surface,
                            std::vector<std::array<int, 3>> const& faces, MeshInertia kind) {
  bool const shell = kind == MeshInertia::shell, legacy = kind == MeshInertia::legacy;
  MeshSolid solid;
  Double3 apex{0, 0, 0};
  for (auto const& f : surface) {
    auto const t = mesh_triangle(vertices[f[0]], vertices[f[1]], vertices[f[2]]);
    double const area = 0.5 * t.twice_area;
    apex = apex + area * t.center;
    solid.surface += area;
  }
  if (solid.surface < 1e-15) return solid;
  apex = {apex[0] / solid.surface, apex[1] / solid.surface, apex[2] / solid.surface};
  auto const weight = [&](MeshTriangle const& t, Double3 const& from) {
    double const v = shell ? 0.5 * t.twice_area : dot(t.center - from, t.cross) / 6;
    return legacy ? std::abs(v) : v;
  };
  for (auto const& f : faces) {
    auto const t = mesh_triangle(vertices[f[0]], vertices[f[1]], vertices[f[2]]);
    double const v = weight(t, apex);
    solid.measure += v;
    solid.com = solid.com + v * (0.75 * t.center + 0.25 * apex);
  }
  if (solid.measure < 1e-15) return solid;
  solid.com = {solid.com[0] / solid.measure, solid.com[1] / solid.measure, solid.com[2] / solid.measure};
  constexpr int pairs[6][2] = {{0, 0}, {1, 1}, {2, 2}, {0, 1}, {0, 2}, {1, 2}};
  double second[6] = {};
  solid.measure = 0;
  for (auto const& face : faces) {
    auto const d = vertices[face[0]] - solid.com, e = vertices[face[1]] - solid.com, f = vertices[face[2]] - solid.com;
    double const v = weight(mesh_triangle(d, e, f), {0, 0, 0});
    solid.measure += v;
    for (int k = 0; k < 6; ++k) {
      int const i = pairs[k][0], j = pairs[k][1];
      second[k] += v / (shell ? 12 : 20) *
                   (2 * (d[i] * d[j] + e[i] * e[j] + f[i] * f[j]) + d[i] * e[j] + d[j] * e[i] + d[i] * f[j] + d[j] * f[i] + e[i] * f[j] +
                    e[j] * f[i]);
    }
  }
  solid.inertia = {second[1] + second[2], second[0] + second[2], second[0] + second[1], -second[3], -second[4], -second[5]};
  return solid;
}

/// Principal axes as MuJoCo chooses them: Jacobi rotations of at most 45 degrees from the given axes on, then 90 degree turns that order
/// the moments from large to small. Entries, and differences of moments, under 1e-7 of the largest given diagonal count as zero: a mesh
/// that is symmetric but for its float vertices keeps its axes. What is left beside the diagonal is lost, as there, so that moments and
/// fitted sizes agree closely with MuJoCo's though both are off by up to 1e-7. (principal_axes is exact to rounding.)
inline PrincipalAxes mesh_axes(Symmetric3 const& s) {
  double const tiny = 1e-7 * std::fmax(s[0], std::fmax(s[1], s[2]));
  PrincipalAxes axes{{s[0], s[1], s[2]}, {1, 0, 0, 0}};
  auto const unit = [](int k) { return Double3{k == 0 ? 1. : 0., k == 1 ? 1. : 0., k == 2 ? 1. : 0.}; };
  for (int iteration = 0; iteration < 500; ++iteration) {
    Double3 const column[3] = {rotate(axes.quat, unit(0)), rotate(axes.quat, unit(1)), rotate(axes.quat, unit(2))};
    auto const entry = [&](int i, int j) {  // of R^T S R
      auto const &a = column[i], &b = column[j];
      return a[0] * (s[0] * b[0] + s[3] * b[1] + s[4] * b[2]) + a[1] * (s[3] * b[0] + s[1] * b[1] + s[5] * b[2]) +
             a[2] * (s[4] * b[0] + s[5] * b[1] + s[2] * b[2]);
    };
    for (int k = 0; k < 3; ++k) axes.moments[k] = entry(k, k);
    double const off[3] = {entry(1, 2), entry(0, 2), entry(0, 1)};  // by the axis that removes them
    int axis = std::abs(off[1]) > std::abs(off[0]) ? 1 : 0;
    if (std::abs(off[2]) > std::abs(off[1]) && std::abs(off[2]) > std::abs(off[0])) axis = 2;
    if (!(std::abs(off[axis]) >= tiny) || off[axis] == 0) break;
    int const i = axis == 0 ? 1 : 0, j = axis == 2 ? 1 : 2;  // the plane that is turned, i < j
    double const tau = (axes.moments[j] - axes.moments[i]) / (2 * off[axis]), angle = 0.5 * std::atan2(1., std::abs(tau));
    double const sign = (tau >= 0 ? -1 : 1) * (axis == 1 ? -1 : 1);  // tan(2 angle) = -1 / tau; about y the plane (x, z) turns backwards
    axes.quat = normalized(times(axes.quat, axis_angle(unit(axis), sign * angle)));
  }
  for (int first : {0, 1, 0})
    if (axes.moments[first] + tiny < axes.moments[first + 1]) {
      std::swap(axes.moments[first], axes.moments[first + 1]);
      axes.quat = normalized(times(axes.quat, {std::sqrt(0.5), first == 1 ? std::sqrt(0.5) : 0, 0, first == 0 ? std::sqrt(0.5) : 0}));
    }
  return axes;
}

}  // namespace gsp::detail
