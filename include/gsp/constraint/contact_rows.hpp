#pragma once
#include <gsp/collision/contacts.hpp>
#include <gsp/constraint/softness.hpp>

/// Contacts as rows: a soft normal as solref and solimp say, then friction, which is rigid: it sticks exactly. By condim
///   1  none
///   3  two rows along the tangents
///   4  and one about the normal: torsion, |p| <= mu_torsion p_n
///   6  and two about the tangents: rolling
/// J = J(body 2) - J(body 1) along, from the fourth row on about, the rows of the contact frame.
namespace gsp {

/// Which impulses two rows of friction may have together. Two rows: those along the tangents, and those of rolling.
enum class FrictionCone {
  elliptic,  // in an ellipse, a disc of radius mu p_n where friction is the same along both: slides against the slip
  box        // each by itself within +-mu p_n (the paper's): up to sqrt(2) stronger between the tangents, and steers
};

template <class R, class Mem>
struct ContactRows {
  typename Model<R, Mem>::template Array<int> body_last_dof;
  Field<R> body_invweight0;
  CollisionModel<R, Mem> collision;
  Contacts<R, Mem> contacts;
  FrictionCone cone;
  ContactRows(Model<R, Mem> const& m, CollisionModel<R, Mem> const& c, Contacts<R, Mem> const& found,
              FrictionCone friction_cone = FrictionCone::elliptic)
      : body_last_dof(m.body_last_dof), body_invweight0(m.body_invweight0), collision(c), contacts(found), cone(friction_cone) {}

  KOKKOS_INLINE_FUNCTION int count(int world) const { return contacts.count_of(world); }
  KOKKOS_INLINE_FUNCTION std::uint32_t status(int world) const { return contacts.status(world); }
  KOKKOS_INLINE_FUNCTION int rows(int world, int k) const {
    int const c = contacts.first_of(world) + k;
    if (!(contacts.dist(c) < contacts.includemargin(c))) return 0;
    // Equal last dofs, or none: the two do not move against each other (named pairs may be of such bodies), and J would be zero.
    if (body_last_dof(contacts.body1(c)) == body_last_dof(contacts.body2(c))) return 0;
    return parameters(world, c).condim;
  }
  template <class Row>
  KOKKOS_INLINE_FUNCTION R jacobian(int world, int k, int row, Row&& J) const {
    int const c = contacts.first_of(world) + k;
    Vec3<R> const point{contacts.pos(c, 0), contacts.pos(c, 1), contacts.pos(c, 2)};
    int const axis = 3 * (row % 3);
    Vec3<R> const direction{contacts.frame(c, axis), contacts.frame(c, axis + 1), contacts.frame(c, axis + 2)};
    if (row < 3) {
      J.add_point(contacts.body2(c), point, direction, R(1));
      J.add_point(contacts.body1(c), point, direction, R(-1));
    } else {
      J.add_rotation(contacts.body2(c), direction, R(1));
      J.add_rotation(contacts.body1(c), direction, R(-1));
    }
    return row == 0 ? contacts.dist(c) : R(0);
  }
  KOKKOS_INLINE_FUNCTION RowLaw<R> law(int world, int k, int row, R x, R u, R h) const {
    if (row > 0) return {R(0), R(0)};
    int const c = contacts.first_of(world) + k;
    auto const p = parameters(world, c);
    Softness<R> s;
    for (int i = 0; i < 2; ++i) s.solref[i] = p.solref[i];
    for (int i = 0; i < 5; ++i) s.solimp[i] = p.solimp[i];
    R const diag = body_invweight0(world, 2 * contacts.body1(c)) + body_invweight0(world, 2 * contacts.body2(c));
    return soft_law(s, x - contacts.includemargin(c), u, h, diag);
  }
  KOKKOS_INLINE_FUNCTION RowBounds<R> bounds(int world, int k, int row) const {
    if (row == 0) return {R(0), Kokkos::Experimental::infinity_v<R>};
    bool const first_of_two = row == 1 || row == 4;
    return {R(0), R(0), 0, parameters(world, contacts.first_of(world) + k).friction[row - 1],
            first_of_two && cone == FrictionCone::elliptic};
  }
  KOKKOS_INLINE_FUNCTION RowId id(int world, int k) const {
    int const c = contacts.first_of(world) + k;
    return {std::uint32_t(contacts.pair(c)), std::uint32_t(contacts.feature(c))};
  }

 private:
  KOKKOS_INLINE_FUNCTION ContactParameters<R> parameters(int world, int c) const {
    return collision.parameters_of(world, contacts.pair(c));
  }
};

}  // namespace gsp
