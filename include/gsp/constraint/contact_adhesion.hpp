#pragma once
#include <gsp/collision/contacts.hpp>
#include <gsp/constraint/constraint_type.hpp>
#include <gsp/constraint/detail/tree_reader.hpp>
#include <gsp/dynamics/stamps.hpp>

/// What pulls the bodies of contacts together, along their normals: adhesion of geoms and of named pairs, and actuators on bodies
/// (MJCF's adhesion), which divide their force among all contacts of the body, those within the gap included. One row a contact, whose
/// impulse is given:  p = -h a. Stands before ContactRows, whose rows push from there on.
/// Source: MuJoCo's documentation, "Adhesion", and its body transmission.
namespace gsp {

template <class R, class Mem>
struct ContactAdhesion {
  static constexpr bool rests = true;
  detail::TreeReader<R, Mem> trees;  // forces of actuators
  Contacts<R, Mem> contacts;
  typename Model<R, Mem>::template Array<int> actuator_body, actuator_tree, actuator_place;
  R timestep;
  detail::Stamps stamps;  // host: those of the dynamics
  /// @param dynamics  after smooth_dynamics or actuator_forces; `assemble` counts in them among how many contacts an actuator is divided
  ContactAdhesion(Model<R, Mem> const& m, Contacts<R, Mem> const& found, Dynamics<R, Mem> const& dynamics)
      : trees(m, dynamics),
        contacts(found),
        actuator_body(m.adhesion_body),
        actuator_tree(m.adhesion_tree),
        actuator_place(m.adhesion_place),
        timestep(m.timestep),
        stamps(dynamics.stamps) {}

  /// Forces of actuators, which are left together with the rates of their activations.
  detail::Quantities reads() const {
    return actuator_body.extent(0) > 0 ? detail::set_of(Quantity::activation_rate) : detail::Quantities{};
  }
  KOKKOS_INLINE_FUNCTION int count(int world) const {
    return contacts.adhesive || actuator_body.extent(0) > 0 ? contacts.count_of(world) : 0;
  }
  /// Divides the force of each actuator among the contacts of its body.
  template <class World>
  KOKKOS_INLINE_FUNCTION void prepare(World const& world) const {
    int const w = world.rank, begin = contacts.first_of(w);
    for (int i = 0; i < int(actuator_body.extent(0)); ++i) {
      int const body = actuator_body(i);
      int const joined = world.template sum<int>(contacts.count_of(w), [&](int k) { return int(joins(begin + k, body)); });
      auto const items = trees.tree(w, actuator_tree(i));
      world.single([&] {
        items[items.at.act_share + actuator_place(i)] = joined > 0 ? items[items.at.act_force + actuator_place(i)] / R(joined) : R(0);
      });
    }
  }
  KOKKOS_INLINE_FUNCTION int rows(int world, int k) const { return pull(world, contacts.first_of(world) + k) != R(0); }
  template <class Row>
  KOKKOS_INLINE_FUNCTION R jacobian(int world, int k, int, Row&& J) const {
    int const c = contacts.first_of(world) + k;
    Vec3<R> const normal = contacts.axis(c, 0), point = contacts.point(c);
    J.add_point(contacts.body2(c), point, normal, R(1));
    J.add_point(contacts.body1(c), point, normal, R(-1));
    return R(0);
  }
  KOKKOS_INLINE_FUNCTION RowLaw<R> law(int, int, int, R, R, R) const { return {R(0), R(0)}; }
  KOKKOS_INLINE_FUNCTION RowBounds<R> bounds(int world, int k, int) const {
    R const impulse = -timestep * pull(world, contacts.first_of(world) + k);
    return {impulse, impulse};
  }
  KOKKOS_INLINE_FUNCTION RowId id(int world, int k) const {
    int const c = contacts.first_of(world) + k;
    return {std::uint32_t(contacts.pair(c)), std::uint32_t(contacts.feature(c))};
  }

 private:
  /// The two move against each other, and `body`, where one is named, is one of them.
  KOKKOS_INLINE_FUNCTION bool joins(int c, int body = -1) const {
    int const a = contacts.body1(c), b = contacts.body2(c);
    return trees.body_last_dof[a] != trees.body_last_dof[b] && (body < 0 || a == body || b == body);
  }
  /// Force with which contact c of the pool pulls [N].
  KOKKOS_INLINE_FUNCTION R pull(int world, int c) const {
    if (!joins(c)) return R(0);
    R force = contacts.adhesive ? contacts.adhesion(c) : R(0);
    for (int i = 0; i < int(actuator_body.extent(0)); ++i) {
      if (!joins(c, actuator_body(i))) continue;
      auto const items = trees.tree(world, actuator_tree(i));
      force += items[items.at.act_share + actuator_place(i)];
    }
    return force;
  }
};

}  // namespace gsp
