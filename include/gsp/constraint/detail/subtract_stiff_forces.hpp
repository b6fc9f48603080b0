#pragma once
#include <gsp/constraint/impulses.hpp>
#include <gsp/parallel/for_worlds.hpp>

/// The kernel of `subtract_stiff_forces` (constraint/stiff_forces.hpp).
namespace gsp::detail {

template <class Types, class R, class Mem>
struct SubtractStiffForces {
  Types types;
  ElementImpulses<R, Mem> impulses;
  Kokkos::View<int, Mem> halt;
  Kokkos::View<R**, Kokkos::LayoutRight, Mem> qfrc;
  struct Entries {
    R* qfrc;
    R force;
    KOKKOS_INLINE_FUNCTION void set_dof(int dof, R value) const { qfrc[dof] -= force * value; }
  };
  template <class World>
  KOKKOS_FUNCTION void operator()(World const& world) const {
    int const w = world.rank, type = impulses.type();
    if (halt() || type < 0 || types.left_step[w] < 0) return;
    world.single([&] {  // rows of a type stand together
      auto const& rows = impulses.rows;
      int const end = rows.first(w) + rows.count(w);
      for (int r = impulses.lower_row(w, type, 0); r < end && rows.row(r).type == type; ++r)
        types.jacobian(w, rows.row(r).element, 0,
                       Entries{&qfrc(w, 0), impulses.impulses.p[impulses.impulses.parity()](r) / types.timestep});
    });
  }
};

}  // namespace gsp::detail
