#pragma once
#include <gsp/collision/contacts.hpp>
#include <gsp/constraint/contact_rows.hpp>
#include <gsp/constraint/impulses.hpp>
#include <gsp/parallel/for_worlds.hpp>

/// The kernel of `contact_forces`, and what reads the force of one contact for others.
namespace gsp::detail {

/// Force and torque of a contact of the rows that were solved, on body 2, in the contact's frame. `contact_force_of` makes it.
template <class R, class Mem>
struct ContactForce {
  CollisionModel<R, Mem> collision;
  Contacts<R, Mem> contacts;
  ElementImpulses<R, Mem> impulses;
  R inverse_timestep;
  int elements;  // of a contact
  bool pyramid;  // their rows are its edges, not along the axes themselves
  /// Of contact k of world w's list: force along the normal and the two tangents [N], torque about them [N m]. False, and zero, where it
  /// has no rows. Cost: a binary search.
  KOKKOS_INLINE_FUNCTION bool operator()(int w, int k, R (&force)[6]) const {
    int const c = contacts.first_of(w) + k, first = impulses.first_row(w, elements * k);
    for (R& f : force) f = R(0);
    if (first < 0) return false;
    R const* const p = impulses.impulses.p[impulses.impulses.parity()].data() + first;
    auto const parameters = acting_parameters(collision, contacts, w, c);
    bool const edges = pyramid && parameters.condim > 1;
    for (int r = 0; r < parameters.condim && !edges; ++r) force[r] = p[r] * inverse_timestep;
    for (int r = 1; r < parameters.condim && edges; ++r) {
      R const plus = p[2 * r - 2] * inverse_timestep, minus = p[2 * r - 1] * inverse_timestep;
      force[0] += plus + minus;
      force[r] = parameters.friction[r - 1] * (plus - minus);
    }
    force[0] -= parameters.adhesion;
    return true;
  }
};

template <class R, class Mem>
struct WriteContactForces {
  using View = Kokkos::View<R* [6], Kokkos::LayoutRight, Mem>;
  ContactForce<R, Mem> of;
  View force;
  template <class World>
  KOKKOS_FUNCTION void operator()(World const& world) const {
    int const w = world.rank, begin = of.contacts.first_of(w);
    world.each(of.contacts.count_of(w), [&](int k) {
      R own[6];
      of(w, k, own);
      for (int r = 0; r < 6; ++r) force(begin + k, r) = own[r];
    });
  }
};

/// The contacts are those of the rows, and the impulses their solution.
template <class R, class Mem>
void expects_contact_forces(char const* where, Model<R, Mem> const& model, CollisionModel<R, Mem> const& collision,
                            Contacts<R, Mem> const& contacts, Rows<R, Mem> const& rows, Impulses<R, Mem> const& impulses) {
  bool const found = contacts.stamp.data() && contacts.stamp().made;
  expects(contacts.worlds == rows.worlds && rows.nv == model.nv &&
              (!found || contacts.stamp().model == static_cast<void const*>(collision.collider_body.data())),
          where,
          "model, collision model, contacts and rows are of different models or numbers of worlds, or the collision model was made "
          "anew: give what collide and assemble had");
  expects_readable(where, rows, impulses);
  bool const known = rows.stamp.data() && contacts.stamp.data() && rows.stamp().contacts != 0;
  expects(!known || rows.stamp().contacts == contacts.stamp().made, where,
          "the contacts are not those that were assembled, or collide has written them again since: step first (or call assemble and pgs "
          "with them)");
}
template <class R, class Mem>
ContactForce<R, Mem> contact_force_of(Model<R, Mem> const& model, CollisionModel<R, Mem> const& collision, Contacts<R, Mem> const& contacts,
                                      Rows<R, Mem> const& rows, Impulses<R, Mem> const& impulses) {
  return {collision,
          contacts,
          impulses_of<ContactRows<R, Mem>>(rows, impulses),
          R(1) / model.timestep,
          rows.stamp.data() ? rows.stamp().contact_elements : 1,
          rows.stamp.data() && rows.stamp().pyramids};
}

}  // namespace gsp::detail
