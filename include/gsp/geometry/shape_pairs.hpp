#pragma once
#include <array>
#include <cstdint>
#include <gsp/geometry/shape.hpp>

/// The one table of pairs of shapes, all that can meet: the compiler of models, the broad and narrow phase, the tests and
/// docs/collision/narrowphase.md read it.
namespace gsp {

/// The pairs of shapes that have a narrow-phase function (collision/narrowphase.hpp).
enum class PairKind : int {
  plane_sphere,
  plane_capsule,
  plane_cylinder,
  plane_box,
  sphere_sphere,
  sphere_capsule,
  sphere_cylinder,
  sphere_box,
  capsule_capsule,
  capsule_cylinder,
  capsule_box,
  box_box,
  plane_ellipsoid,
  plane_mesh,
  sphere_ellipsoid,
  sphere_mesh,
  capsule_ellipsoid,
  capsule_mesh,
  ellipsoid_ellipsoid,
  ellipsoid_cylinder,
  ellipsoid_box,
  ellipsoid_mesh,
  cylinder_cylinder,
  cylinder_box,
  cylinder_mesh,
  box_mesh,
  mesh_mesh,
  hfield_sphere,
  hfield_capsule,
  hfield_ellipsoid,
  hfield_cylinder,
  hfield_box,
  hfield_mesh,
  none
};

struct ShapePair {
  ShapeType a, b;  // type of a <= type of b
  PairKind kind;
  char const* function;
  int points;            // the most that it gives
  bool reduces = false;  // a patch of points with one normal: contacts may keep the four that support best (collision/manifold.hpp)
  bool along_b = false;  // the first tangent of its contacts lies along the z axis of b; else as mju_makeFrame chooses
  bool convex = false;   // found by the convex routine (narrowphase/convex.hpp), which needs a stack of some kB: a kernel of its own
};

inline constexpr ShapePair shape_pairs[] = {
    {ShapeType::plane, ShapeType::sphere, PairKind::plane_sphere, "plane_sphere", 1},
    {ShapeType::plane, ShapeType::capsule, PairKind::plane_capsule, "plane_capsule", 2, false, true},
    {ShapeType::plane, ShapeType::cylinder, PairKind::plane_cylinder, "plane_cylinder", 4},
    {ShapeType::plane, ShapeType::box, PairKind::plane_box, "plane_box", 4},
    {ShapeType::sphere, ShapeType::sphere, PairKind::sphere_sphere, "sphere_sphere", 1},
    {ShapeType::sphere, ShapeType::capsule, PairKind::sphere_capsule, "sphere_capsule", 1},
    {ShapeType::sphere, ShapeType::cylinder, PairKind::sphere_cylinder, "sphere_cylinder", 1},
    {ShapeType::sphere, ShapeType::box, PairKind::sphere_box, "sphere_box", 1},
    {ShapeType::capsule, ShapeType::capsule, PairKind::capsule_capsule, "capsule_capsule", 2},
    {ShapeType::capsule, ShapeType::cylinder, PairKind::capsule_cylinder, "capsule_cylinder", 3},
    {ShapeType::capsule, ShapeType::box, PairKind::capsule_box, "capsule_box", 3},
    {ShapeType::box, ShapeType::box, PairKind::box_box, "box_box", 8, true},
    {ShapeType::plane, ShapeType::ellipsoid, PairKind::plane_ellipsoid, "plane_ellipsoid", 1},
    {ShapeType::plane, ShapeType::mesh, PairKind::plane_mesh, "plane_mesh", 4},
    {ShapeType::sphere, ShapeType::ellipsoid, PairKind::sphere_ellipsoid, "convex_convex", 1, false, false, true},
    {ShapeType::sphere, ShapeType::mesh, PairKind::sphere_mesh, "convex_convex", 1, false, false, true},
    {ShapeType::capsule, ShapeType::ellipsoid, PairKind::capsule_ellipsoid, "convex_convex", 1, false, false, true},
    {ShapeType::capsule, ShapeType::mesh, PairKind::capsule_mesh, "convex_convex", 3, false, false, true},
    {ShapeType::ellipsoid, ShapeType::ellipsoid, PairKind::ellipsoid_ellipsoid, "convex_convex", 1, false, false, true},
    {ShapeType::ellipsoid, ShapeType::cylinder, PairKind::ellipsoid_cylinder, "convex_convex", 1, false, false, true},
    {ShapeType::ellipsoid, ShapeType::box, PairKind::ellipsoid_box, "convex_convex", 1, false, false, true},
    {ShapeType::ellipsoid, ShapeType::mesh, PairKind::ellipsoid_mesh, "convex_convex", 1, false, false, true},
    {ShapeType::cylinder, ShapeType::cylinder, PairKind::cylinder_cylinder, "convex_convex", 4, false, false, true},
    {ShapeType::cylinder, ShapeType::box, PairKind::cylinder_box, "convex_convex", 4, false, false, true},
    {ShapeType::cylinder, ShapeType::mesh, PairKind::cylinder_mesh, "convex_convex", 4, false, false, true},
    {ShapeType::box, ShapeType::mesh, PairKind::box_mesh, "convex_convex", 4, false, false, true},
    {ShapeType::mesh, ShapeType::mesh, PairKind::mesh_mesh, "convex_convex", 4, false, false, true},
    {ShapeType::hfield, ShapeType::sphere, PairKind::hfield_sphere, "height_field", 8, false, false, true},
    {ShapeType::hfield, ShapeType::capsule, PairKind::hfield_capsule, "height_field", 8, false, false, true},
    {ShapeType::hfield, ShapeType::ellipsoid, PairKind::hfield_ellipsoid, "height_field", 8, false, false, true},
    {ShapeType::hfield, ShapeType::cylinder, PairKind::hfield_cylinder, "height_field", 8, false, false, true},
    {ShapeType::hfield, ShapeType::box, PairKind::hfield_box, "height_field", 8, false, false, true},
    {ShapeType::hfield, ShapeType::mesh, PairKind::hfield_mesh, "height_field", 8, false, false, true},
};
inline constexpr int pair_kinds = int(sizeof(shape_pairs) / sizeof(shape_pairs[0]));

namespace detail {
constexpr bool shape_pairs_are_in_order() {
  for (int k = 0; k < pair_kinds; ++k)
    if (int(shape_pairs[k].kind) != k || shape_pairs[k].a > shape_pairs[k].b) return false;
  return true;
}
static_assert(pair_kinds == int(PairKind::none), "gsp::shape_pairs: one row for each PairKind");
static_assert(shape_pairs_are_in_order(), "gsp::shape_pairs: rows in the order of PairKind, type of a <= type of b");

/// The kind of two types, and the most points of a kind, as constants that kernels can index.
struct PairTable {
  std::uint8_t kind[shape_types][shape_types], points[pair_kinds + 1];
};
constexpr PairTable make_pair_table() {
  PairTable table{};
  for (auto& row : table.kind)
    for (auto& kind : row) kind = std::uint8_t(PairKind::none);
  for (auto const& pair : shape_pairs) {
    table.kind[int(pair.a)][int(pair.b)] = std::uint8_t(pair.kind);
    table.points[int(pair.kind)] = std::uint8_t(pair.points);
  }
  return table;
}
inline constexpr PairTable pair_table = make_pair_table();

/// The kinds for which `f(row)` holds, as bits: kernels read this constant, not the table.
template <class F>
constexpr std::uint64_t kinds_where(F const& f) {
  static_assert(pair_kinds <= 64);
  std::uint64_t bits = 0;
  for (auto const& pair : shape_pairs)
    if (f(pair)) bits |= std::uint64_t(1) << int(pair.kind);
  return bits;
}
inline constexpr std::uint64_t plane_kinds = kinds_where([](ShapePair const& p) { return p.a == ShapeType::plane; });
inline constexpr std::uint64_t reducing_kinds = kinds_where([](ShapePair const& p) { return p.reduces; });
inline constexpr std::uint64_t along_b_kinds = kinds_where([](ShapePair const& p) { return p.along_b; });
inline constexpr std::uint64_t convex_kinds = kinds_where([](ShapePair const& p) { return p.convex; });
inline constexpr std::uint64_t asset_kinds = kinds_where([](ShapePair const& p) {
  return p.a == ShapeType::hfield || p.a == ShapeType::mesh || p.b == ShapeType::hfield || p.b == ShapeType::mesh;
});

/// The types of a kind, as constants that kernels can index.
struct KindTypes {
  std::uint8_t a[pair_kinds], b[pair_kinds];
};
constexpr KindTypes make_kind_types() {
  KindTypes types{};
  for (int k = 0; k < pair_kinds; ++k) {
    types.a[k] = std::uint8_t(shape_pairs[k].a);
    types.b[k] = std::uint8_t(shape_pairs[k].b);
  }
  return types;
}
inline constexpr KindTypes kind_types = make_kind_types();
}  // namespace detail

/// The types of the shapes a and b of a pair of this kind, not `none`.
GSP_FUNCTION ShapeType first_type(PairKind kind) {
  constexpr detail::KindTypes types = detail::kind_types;
  return ShapeType(types.a[int(kind)]);
}
GSP_FUNCTION ShapeType second_type(PairKind kind) {
  constexpr detail::KindTypes types = detail::kind_types;
  return ShapeType(types.b[int(kind)]);
}

/// Whether `kind` is among `kinds`.
GSP_FUNCTION constexpr bool is_among(std::uint64_t kinds, PairKind kind) { return (kinds >> int(kind) & 1) != 0; }

/// The kind of a pair, or `none`: the two cannot collide, or their order is not that of the types.
GSP_FUNCTION constexpr PairKind pair_kind(ShapeType a, ShapeType b) {
  constexpr detail::PairTable table = detail::pair_table;
  return PairKind(table.kind[int(a)][int(b)]);
}

/// The most points that a pair of this kind gives; 0 for none.
GSP_FUNCTION constexpr int max_points(PairKind kind) {
  constexpr detail::PairTable table = detail::pair_table;
  return table.points[int(kind)];
}

/// Planes and height fields: they have no box, or one that is near everything.
GSP_FUNCTION constexpr bool is_wide(ShapeType type) { return type <= ShapeType::hfield; }
/// Planes and height fields do not meet each other: MuJoCo defines no contact there.
constexpr bool can_collide(ShapeType a, ShapeType b) { return !is_wide(a) || !is_wide(b); }

namespace detail {
constexpr bool shape_pairs_are_complete() {
  for (int a = 0; a < shape_types; ++a)
    for (int b = a; b < shape_types; ++b)
      if (can_collide(ShapeType(a), ShapeType(b)) != (pair_kind(ShapeType(a), ShapeType(b)) != PairKind::none)) return false;
  return true;
}
static_assert(shape_pairs_are_complete(), "gsp::shape_pairs: two shapes that can meet have a row");
}  // namespace detail

}  // namespace gsp
