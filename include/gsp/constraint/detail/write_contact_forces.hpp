#pragma once
#include <gsp/collision/contacts.hpp>
#include <gsp/constraint/impulses.hpp>
#include <gsp/parallel/for_worlds.hpp>

/// The kernel of `contact_forces`.
namespace gsp::detail {

template <class R, class Mem>
struct WriteContactForces {
  using View = Kokkos::View<R* [6], Kokkos::LayoutRight, Mem>;
  CollisionModel<R, Mem> collision;
  Contacts<R, Mem> contacts;
  ElementImpulses<R, Mem> impulses;
  View force;
  R inverse_timestep;
  int edges;  // of a pyramid; 1: rows along the axes themselves
  template <class World>
  KOKKOS_FUNCTION void operator()(World const& world) const {
    int const w = world.rank, begin = contacts.first_of(w);
    world.each(contacts.count_of(w), [&](int k) {
      int const c = begin + k, first = impulses.first_row(w, edges * k);
      R const* const p = impulses.impulses.p[impulses.impulses.parity()].data() + first;
      for (int r = 0; r < 6; ++r) force(c, r) = R(0);
      if (first < 0) return;
      auto const parameters = acting_parameters(collision, contacts, w, c);
      bool const pyramid = edges > 1 && parameters.condim > 1;
      for (int r = 0; r < parameters.condim && !pyramid; ++r) force(c, r) = p[r] * inverse_timestep;
      for (int r = 1; r < parameters.condim && pyramid; ++r) {
        R const plus = p[2 * r - 2] * inverse_timestep, minus = p[2 * r - 1] * inverse_timestep;
        force(c, 0) += plus + minus;
        force(c, r) = parameters.friction[r - 1] * (plus - minus);
      }
      force(c, 0) -= parameters.adhesion;
    });
  }
};

}  // namespace gsp::detail
