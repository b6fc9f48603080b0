#pragma once
#include <gsp/constraint/contact_rows.hpp>
#include <gsp/constraint/detail/write_contact_forces.hpp>
#include <gsp/core/region.hpp>

namespace gsp {

/// The force and torque of every contact of the last step, on body 2, in the contact's frame (MuJoCo's mj_contactForce): with adhesion the
/// normal force may be negative; what adhesion actuators press with is not in it.
/// @param collision, contacts  as they were assembled
/// @param rows, impulses     after `pgs` (or `step`), before the next `assemble`
/// @param force              out (contact, 6): along the normal and the two tangents [N], about them (torsion, rolling) [N m]; zero
///                           where the contact did not act, and along what nothing that it touches can move (where MuJoCo reports what its
///                           regularisation gives). At least as many rows as contacts.dist. Of a world that stopped (state.status) they
///                           are what stopped it, NaN perhaps; of one that was reset, those of its last step
/// Cost: a binary search a contact. Does not allocate, does not fence. Errors: std::invalid_argument where nothing has been solved since
/// the rows were last assembled, where steps were launched and not settled, or the contacts are others than those that were assembled, or
/// were found anew since, or are of another model (also of a collision model that was made anew).
template <ExecutionSpace Exec, class R, class Mem>
void contact_forces(Exec const& exec, Model<R, Mem> const& model, CollisionModel<R, Mem> const& collision, Contacts<R, Mem> const& contacts,
                    Rows<R, Mem> const& rows, Impulses<R, Mem> const& impulses, Kokkos::View<R* [6], Kokkos::LayoutRight, Mem>& force) {
  Region const region("gsp::constraint::contact_forces");
  if (force.extent(0) < contacts.dist.extent(0))
    throw std::invalid_argument("gsp::contact_forces: room for " + std::to_string(force.extent(0)) +
                                " contacts is given, and there may be " + std::to_string(contacts.dist.extent(0)) +
                                ": give as many rows as contacts.dist has");
  detail::expects_contact_forces("gsp::contact_forces", model, collision, contacts, rows, impulses);
  for_worlds("gsp::constraint::contact_forces", exec, rows.worlds,
             detail::WriteContactForces<R, Mem>{detail::contact_force_of(model, collision, contacts, rows, impulses), force});
}

}  // namespace gsp
