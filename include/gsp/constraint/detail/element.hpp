#pragma once
#include <concepts>
#include <gsp/constraint/constraint_type.hpp>

/// An element of a constraint type, as the kernels ask for it. Types of the library whose rows are made of the same things read them once:
/// they have an `element(world, k)` of their own, and `alike` where all rows of an element touch the same dofs, which is taken at its word.
namespace gsp::detail {

/// Element k of a world, by the members of its type.
template <class Type>
struct ElementByMembers {
  Type const& type;
  int world, k;
  KOKKOS_INLINE_FUNCTION int rows() const { return type.rows(world, k); }
  template <class Row>
  KOKKOS_INLINE_FUNCTION auto jacobian(int row, Row&& J) const {
    return type.jacobian(world, k, row, J);
  }
  KOKKOS_INLINE_FUNCTION auto bounds(int row) const { return type.bounds(world, k, row); }
  /// u+ = -C p + zeta of a row.
  /// @param limits  in, out: a force that nothing changes is held between bounds that meet
  template <class R>
  KOKKOS_INLINE_FUNCTION RowLaw<R> law(int row, R x, R u, R h, RowBounds<R>& limits) const {
    return row_law(type, world, k, row, x, u, h, limits);
  }
};
/// A type of the library's kind: members of these names that a user's type has for itself are not asked.
template <class Type>
concept MakesElements = requires(Type const& type) {
  { type.element(0, 0).rows() } -> std::same_as<int>;
  type.element(0, 0).bounds(0);
};
template <class Type>
KOKKOS_INLINE_FUNCTION auto element_of(Type const& type, int world, int k) {
  if constexpr (MakesElements<Type>)
    return type.element(world, k);
  else
    return ElementByMembers<Type>{type, world, k};
}
/// Whether all rows of an element touch the same dofs.
template <class Type>
KOKKOS_INLINE_FUNCTION constexpr bool rows_are_alike() {
  if constexpr (MakesElements<Type> && requires { Type::alike; })
    return Type::alike;
  else
    return false;
}

}  // namespace gsp::detail
