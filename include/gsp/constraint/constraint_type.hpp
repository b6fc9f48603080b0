#pragma once
#include <concepts>
#include <gsp/constraint/rows.hpp>
#include <gsp/math/dual.hpp>

/// What a constraint is: a law and a Jacobian. Storage, islands, warm start and solving are not its business.
///   An element k of world w has 1-6 rows. A row has a gap x, a rate u = J v, a law lambda(x, u) for its force, bounds, and its element has
///   an identity that survives steps. The law is evaluated at the gap predicted for the end of the step, x + h u, and made linear in the
///   new rate:
///     s = h dlambda/dx + dlambda/du,   C = -1/(h s),   zeta = u + h C lambda(x + h u, u),   u+ = -C p + zeta      (paper, eq. 2-4; p the
///     impulse)
///   A linear spring and damper gives exactly the implicit Euler step. Where the slope s is 0 (a slack rope, a constant force) nothing
///   changes the force, and the impulse is h lambda.
namespace gsp {

/// Identity of an element within its type: warm starts find last step's impulses by it.
struct RowId {
  std::uint32_t major = 0;  // below 2^27, non-decreasing with the element's index
  std::uint32_t minor = 0;
};
/// The linear law itself, for types that know it better than `lambda` can say (hard rows, MuJoCo's softness): u+ = -C p + zeta.
template <class R>
struct RowLaw {
  R compliance, zeta;
  R most_yield = Kokkos::Experimental::infinity_v<R>;  // C p of its load at most [m/s]: C is less where it carries more (assemble)
  R restitution = R(0);  // 0 ... 1: share of the rate of an impact that comes back (solver/impacts.hpp); of rigid rows that push alone
  R mass = Kokkos::Experimental::infinity_v<R>;  // of rigid rows that push: about what they move [kg, kg m^2] (detail::most_weights)
};

/// What `jacobian` writes a row to: by dof, by (body, point, direction) or by (body, direction); entries add up. World frame.
struct AnyRow {
  KOKKOS_INLINE_FUNCTION void set_dof(int /*dof*/, float /*value*/) const {}
  template <class R>
  KOKKOS_INLINE_FUNCTION void add_point(int /*body*/, Vec3<R> const& /*point*/, Vec3<R> const& /*direction*/, R /*scale*/ = R(1)) const {}
  template <class R>
  KOKKOS_INLINE_FUNCTION void add_rotation(int /*body*/, Vec3<R> const& /*direction*/, R /*scale*/ = R(1)) const {}
};

/// Base of types whose elements are one row without bounds, numbered in order.
struct OneFreeRow {
  KOKKOS_INLINE_FUNCTION int rows(int, int) const { return 1; }
  KOKKOS_INLINE_FUNCTION RowBounds<float> bounds(int, int, int) const {
    return {-Kokkos::Experimental::infinity_v<float>, Kokkos::Experimental::infinity_v<float>};
  }
  KOKKOS_INLINE_FUNCTION RowId id(int, int k) const { return {std::uint32_t(k), 0}; }
};

namespace detail {
template <class C>
concept ConstraintCount = requires(C const c, int world) {
  { c.count(world) } -> std::convertible_to<int>;
};
template <class C>
concept ConstraintRows = requires(C const c, int world, int k) {
  { c.rows(world, k) } -> std::convertible_to<int>;
};
template <class C>
concept ConstraintJacobian = requires(C const c, int world, int k, int row) {
  { c.jacobian(world, k, row, AnyRow{}) } -> std::floating_point;
};
template <class C>
concept ConstraintBounds = requires(C const c, int world, int k, int row) {
  { c.bounds(world, k, row).friction_of } -> std::convertible_to<int>;
};
template <class C>
concept ConstraintId = requires(C const c, int world, int k) {
  { c.id(world, k) } -> std::same_as<RowId>;
};
template <class C>
concept ConstraintLaw = requires(C const c) {
  c.lambda(0, 0, 0, Dual<float, 2>(), Dual<float, 2>());
}
|| requires(C const c) { c.law(0, 0, 0, 0.f, 0.f, 0.f); }
|| requires(C const c) { c.law(0, 0, 0, 0., 0., 0.); };
/// It has at least one of them: what lacks the others is meant as one.
template <class C>
concept LikeConstraint =
    ConstraintCount<C> || ConstraintRows<C> || ConstraintJacobian<C> || ConstraintBounds<C> || ConstraintId<C> || ConstraintLaw<C>;
}  // namespace detail

/// A constraint type: copyable to the device, with
///   count(world)                        elements of the world; those with rows() == 0 are not active
///   rows(world, k)                      rows of element k, 0-6
///   jacobian(world, k, row, J) -> gap   writes J, returns the gap x at the start of the step
///   lambda(world, k, row, x, u)         force law, written once on T (a number or a Dual), or
///   law(world, k, row, x, u, h)         the linear law RowLaw itself
///   bounds(world, k, row), id(world, k)
/// and, where a type has them,
///   place(world, k)                     where an element acts [m]: new ones start from what those near by had that are gone
///   tangent(world, k, i)                directions of rows 1 and 2 (i = 0, 1), and of rows 4 and 5 about them, orthogonal: what they start
///                                       from is turned as these have turned since the last step
///   turns()                             false where the rows are not along tangent(), so that nothing is turned
///   prepare(world)                      finds out once what all elements of a world need; its threads run it together before they are
///                                       counted (parallel/for_worlds.hpp says what a world is)
///   rests                               static constexpr bool true: rows and laws stay the same as long as the trees that they touch
///                                       lie still and their controls are the same; else those trees do not sleep (step/sleep.hpp)
///   bounces()                           on the host: whether some law may have a restitution; rows without room for it are refused then
///   poses, contacts                     members that hold what the type reads: assemble refuses them of another moment than the state, and
///                                       no world is stepped while the pool of these contacts is too small
///   reads() and stamps                  on the host: which quantities are read from the dynamics, and of which state those are
/// Two types of the library are known by name: rows remember which ContactRows they are of, for contact_forces; and dynamics that left
/// stiff forces to rows are refused without StiffForces.
template <class C>
concept ConstraintType = std::copyable<C> && detail::ConstraintCount<C> && detail::ConstraintRows<C> && detail::ConstraintJacobian<C> &&
    detail::ConstraintBounds<C> && detail::ConstraintId<C> && detail::ConstraintLaw<C>;

namespace detail {
/// u+ = -C p + zeta of one row.
/// @param bounds  in, out: a force that nothing changes is held between bounds that meet
template <class C, class R>
KOKKOS_INLINE_FUNCTION RowLaw<R> row_law(C const& c, int world, int k, int row, R x, R u, R h, RowBounds<R>& bounds) {
  if constexpr (requires { c.law(world, k, row, x, u, h); }) {
    return c.law(world, k, row, x, u, h);
  } else {
    using D = Dual<R, 2>;
    D const f = c.lambda(world, k, row, D::variable(x + h * u, 0), D::variable(u, 1));
    R slope = h * f.slope[0] + f.slope[1];
    R const least = max(Kokkos::Experimental::epsilon_v<R> * abs(f.value), R(1e-20));  // a rate of 1 changes the force by its last digit
    if (abs(slope) < least) {
      slope = -least;
      bounds.lower = bounds.upper = clamp(h * f.value, bounds.lower, bounds.upper);
    }
    R const compliance = R(-1) / (h * slope);
    return {compliance, u + h * compliance * f.value};
  }
}
}  // namespace detail

}  // namespace gsp
