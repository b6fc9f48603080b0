#pragma once
#include <gsp/collision/narrowphase/box_box.hpp>
#include <gsp/collision/narrowphase/capsule_box.hpp>
#include <gsp/collision/narrowphase/capsule_capsule.hpp>
#include <gsp/collision/narrowphase/capsule_cylinder.hpp>
#include <gsp/collision/narrowphase/convex.hpp>
#include <gsp/collision/narrowphase/height_field.hpp>
#include <gsp/collision/narrowphase/plane_box.hpp>
#include <gsp/collision/narrowphase/plane_capsule.hpp>
#include <gsp/collision/narrowphase/plane_cylinder.hpp>
#include <gsp/collision/narrowphase/plane_ellipsoid.hpp>
#include <gsp/collision/narrowphase/plane_mesh.hpp>
#include <gsp/collision/narrowphase/plane_sphere.hpp>
#include <gsp/collision/narrowphase/sphere_box.hpp>
#include <gsp/collision/narrowphase/sphere_capsule.hpp>
#include <gsp/collision/narrowphase/sphere_cylinder.hpp>
#include <gsp/collision/narrowphase/sphere_sphere.hpp>

namespace gsp {

/// Contact points of a and b with dist <= margin, by the kind of the pair; `out.add(pos, dist, normal, feature)` takes them
/// (ContactPoints). This one: the kinds with a function of their own; none for the others.
/// @param steady  nearly parallel capsules touch at two points (capsule_capsule), and a height field pushes along normals of its surface
///                alone (height_field)
template <class T, class Out>
KOKKOS_INLINE_FUNCTION void closed_narrowphase(PairKind kind, Shape<T> const& a, Shape<T> const& b, T margin, Out& out,
                                               bool steady = false) {
  switch (kind) {
    case PairKind::plane_sphere:
      return plane_sphere(a, b, margin, out);
    case PairKind::plane_capsule:
      return plane_capsule(a, b, margin, out);
    case PairKind::plane_cylinder:
      return plane_cylinder(a, b, margin, out);
    case PairKind::plane_box:
      return plane_box(a, b, margin, out);
    case PairKind::sphere_sphere:
      return sphere_sphere(a, b, margin, out);
    case PairKind::sphere_capsule:
      return sphere_capsule(a, b, margin, out);
    case PairKind::sphere_cylinder:
      return sphere_cylinder(a, b, margin, out);
    case PairKind::sphere_box:
      return sphere_box(a, b, margin, out);
    case PairKind::capsule_capsule:
      return capsule_capsule(a, b, margin, out, steady);
    case PairKind::capsule_cylinder:
      return capsule_cylinder(a, b, margin, out);
    case PairKind::capsule_box:
      return capsule_box(a, b, margin, out);
    case PairKind::box_box:
      return box_box(a, b, margin, out);
    case PairKind::plane_ellipsoid:
      return plane_ellipsoid(a, b, margin, out);
    case PairKind::plane_mesh:
      return plane_mesh(a, b, margin, out);
    default:
      return;
  }
}

/// The kinds that the convex routine serves (`detail::convex_kinds`), which needs a stack of some kB.
template <class T, class Out>
KOKKOS_INLINE_FUNCTION void convex_narrowphase(PairKind kind, Shape<T> const& a, Shape<T> const& b, T margin, Out& out,
                                               bool steady = false) {
  ShapeType const type_b = second_type(kind);
  if (first_type(kind) == ShapeType::hfield) return height_field(a, type_b, b, margin, out, steady);
  convex_convex(first_type(kind), a, type_b, b, margin, out);
}

/// Any kind.
template <class T, class Out>
KOKKOS_INLINE_FUNCTION void narrowphase(PairKind kind, Shape<T> const& a, Shape<T> const& b, T margin, Out& out, bool steady = false) {
  if (kind == PairKind::none) return;
  if (is_among(detail::convex_kinds, kind)) return convex_narrowphase(kind, a, b, margin, out, steady);
  closed_narrowphase(kind, a, b, margin, out, steady);
}

}  // namespace gsp
