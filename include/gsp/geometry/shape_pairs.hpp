#pragma once
#include <array>
#include <cstdint>
#include <gsp/geometry/shape.hpp>

/// The one table of pairs of shapes whose contacts are computed: the compiler of models, the broad and narrow phase, the tests and
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
  none
};

struct ShapePair {
  ShapeType a, b;  // type of a <= type of b
  PairKind kind;
  char const* function;
  int points;            // the most that it gives
  bool reduces = false;  // a patch of points with one normal: contacts may keep the four that support best (collision/manifold.hpp)
  bool along_b = false;  // the first tangent of its contacts lies along the z axis of b; else as mju_makeFrame chooses
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

constexpr std::array<std::array<PairKind, shape_types>, shape_types> make_pair_table() {
  std::array<std::array<PairKind, shape_types>, shape_types> table{};
  for (auto& row : table)
    for (auto& kind : row) kind = PairKind::none;
  for (auto const& pair : shape_pairs) table[int(pair.a)][int(pair.b)] = pair.kind;
  return table;
}
inline constexpr auto pair_table = make_pair_table();

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
inline constexpr std::uint64_t asset_kinds = kinds_where([](ShapePair const& p) {
  return p.a == ShapeType::hfield || p.a == ShapeType::mesh || p.b == ShapeType::hfield || p.b == ShapeType::mesh;
});
}  // namespace detail

/// Whether `kind` is among `kinds`.
GSP_FUNCTION constexpr bool is_among(std::uint64_t kinds, PairKind kind) { return (kinds >> int(kind) & 1) != 0; }

/// The kind of a pair, or `none`: it is not covered, or its order is not that of the types. Host.
constexpr PairKind pair_kind(ShapeType a, ShapeType b) { return detail::pair_table[int(a)][int(b)]; }

/// The most points that a pair of this kind gives. Host.
constexpr int max_points(PairKind kind) { return kind == PairKind::none ? 0 : shape_pairs[int(kind)].points; }

/// Contacts between these two shapes are computed, in whatever order they stand.
constexpr bool is_covered_pair(ShapeType a, ShapeType b) { return (a <= b ? pair_kind(a, b) : pair_kind(b, a)) != PairKind::none; }

/// Planes and height fields do not meet each other: MuJoCo defines no contact there.
constexpr bool can_collide(ShapeType a, ShapeType b) { return a > ShapeType::hfield || b > ShapeType::hfield; }

}  // namespace gsp
