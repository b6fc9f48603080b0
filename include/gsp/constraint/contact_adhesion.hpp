#pragma once
#include <gsp/collision/contacts.hpp>
#include <gsp/constraint/constraint_type.hpp>
#include <gsp/constraint/detail/tree_reader.hpp>
#include <gsp/core/status.hpp>

/// What pulls the bodies of contacts together, along their normals: adhesion of geoms and of named pairs, and actuators on bodies
/// (MJCF's adhesion), which divide their force among all contacts of the body, those within the gap included. One row a contact, whose
/// impulse is given:  p = -h a. Stands before ContactRows, whose rows push from there on.
/// Source: MuJoCo's documentation, "Adhesion", and its body transmission.
namespace gsp {

template <class R, class Mem>
struct ContactAdhesion {
  detail::TreeReader<R, Mem> trees;                         // forces of actuators
  int const *first, *end, *pair, *feature, *body1, *body2;  // of the contacts: plain pointers, since ContactRows holds them already
  std::uint32_t const* contact_status;
  R const *pos, *frame, *adhesion;  // adhesion: null where no pair of the model has any
  typename Model<R, Mem>::template Array<int> actuator_body, actuator_tree, actuator_place;
  R timestep;
  /// @param dynamics  after smooth_dynamics or actuator_forces
  ContactAdhesion(Model<R, Mem> const& m, Contacts<R, Mem> const& found, Dynamics<R, Mem> const& dynamics)
      : trees(m, dynamics),
        first(found.first.data()),
        end(found.end.data()),
        pair(found.pair.data()),
        feature(found.feature.data()),
        body1(found.body1.data()),
        body2(found.body2.data()),
        contact_status(found.status.data()),
        pos(found.pos.data()),
        frame(found.frame.data()),
        adhesion(found.adhesive ? found.adhesion.data() : nullptr),
        actuator_body(m.adhesion_body),
        actuator_tree(m.adhesion_tree),
        actuator_place(m.adhesion_place),
        timestep(m.timestep) {}

  KOKKOS_INLINE_FUNCTION int count(int world) const {
    return (adhesion || actuator_body.extent(0) > 0) && (contact_status[world] & status::contact_overflow) == 0 ? end[world] - first[world]
                                                                                                                : 0;
  }
  KOKKOS_INLINE_FUNCTION int rows(int world, int k) const { return pull(world, first[world] + k) != R(0); }
  template <class Row>
  KOKKOS_INLINE_FUNCTION R jacobian(int world, int k, int, Row&& J) const {
    int const c = first[world] + k;
    Vec3<R> const normal{frame[9 * c], frame[9 * c + 1], frame[9 * c + 2]}, point{pos[3 * c], pos[3 * c + 1], pos[3 * c + 2]};
    J.add_point(body2[c], point, normal, R(1));
    J.add_point(body1[c], point, normal, R(-1));
    return R(0);
  }
  KOKKOS_INLINE_FUNCTION RowLaw<R> law(int, int, int, R, R, R) const { return {R(0), R(0)}; }
  KOKKOS_INLINE_FUNCTION RowBounds<R> bounds(int world, int k, int) const {
    R const impulse = -timestep * pull(world, first[world] + k);
    return {impulse, impulse};
  }
  KOKKOS_INLINE_FUNCTION RowId id(int world, int k) const {
    int const c = first[world] + k;
    return {std::uint32_t(pair[c]), std::uint32_t(feature[c])};
  }

 private:
  /// The two move against each other, and `body`, where one is named, is one of them.
  KOKKOS_INLINE_FUNCTION bool joins(int c, int body = -1) const {
    int const a = body1[c], b = body2[c];
    return trees.body_last_dof[a] != trees.body_last_dof[b] && (body < 0 || a == body || b == body);
  }
  /// Force with which contact c of the pool pulls [N].
  KOKKOS_INLINE_FUNCTION R pull(int world, int c) const {
    if (!joins(c)) return R(0);
    R force = adhesion ? adhesion[c] : R(0);
    for (int i = 0; i < int(actuator_body.extent(0)); ++i) {
      int const body = actuator_body(i);
      if (!joins(c, body)) continue;
      int shares = 0;
      for (int other = first[world]; other < end[world]; ++other) shares += joins(other, body);
      auto const items = trees.tree(world, actuator_tree(i));
      force += items[items.at.act_force + actuator_place(i)] / R(shares);
    }
    return force;
  }
};

}  // namespace gsp
