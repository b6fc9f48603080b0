#pragma once
#include <gsp/collision/contacts.hpp>
#include <gsp/constraint/detail/rigid_joints.hpp>
#include <gsp/constraint/soft_friction.hpp>

/// Contacts as rows: a normal, soft as solref and solimp say or rigid (hard), then friction. By condim
///   1  none
///   3  two rows along the tangents
///   4  and one about the normal: torsion, |p| <= mu_torsion p_n
///   6  and two about the tangents: rolling
/// J = J(body 2) - J(body 1) along, from the fourth row on about, the rows of the contact frame.
/// What pulls (adhesion a) pushes from there on, p >= 0 being what it pushes and h a together: zeta += C h a of the normal, while
/// ContactAdhesion, which stands before, pulls with h a. Within the gap it is a normal alone. Where a surface moves at s relative to the
/// other (surfacevel) the rate of friction is u + s.
/// Bodies that a rigid weld holds together have none: nothing moves them against each other, and what overlaps would be squeezed without
/// end. Those that a rigid connect holds are as soft as the file says, whatever they carry.
/// In profile stable they are rows from before they touch on (act_early), give the less the more they carry
/// (docs/constraint/contact_rows.md), and friction is rigid: it sticks exactly. In profile mujoco it is as soft as impratio says
/// (constraint/soft_friction.hpp).
namespace gsp {

namespace detail {
/// A contact is hardened for its load until its overlap pushes with so many times that: more is not what bears the load, and what is jammed
/// deeply would be pushed with thousands of times its weight, which sweeps do not solve, and be thrown.
inline constexpr double most_lift = 20;
}  // namespace detail

template <class R, class Mem>
struct ContactRows {
  static constexpr bool rests = true, alike = true;
  Field<R> body_invweight0;
  CollisionModel<R, Mem> collision;
  Contacts<R, Mem> contacts;
  FrictionCone cone;
  SoftFriction<R> soft;
  bool pyramid;  // edges in place of a normal and friction
  int elements;  // of a contact: more than six edges are two
  Field<R> gravity;
  detail::RigidJoints<R, Mem> joints;
  ContactRows(Model<R, Mem> const& m, State<R, Mem> const& s, CollisionModel<R, Mem> const& c, Contacts<R, Mem> const& found,
              FrictionCone friction_cone = FrictionCone::elliptic)
      : body_invweight0(m.body_invweight0),
        collision(c),
        contacts(found),
        cone(friction_cone),
        soft{m.profile == Profile::mujoco, m.impratio, m.refsafe ? Refsafe::two_steps : Refsafe::off},
        pyramid(friction_cone == FrictionCone::pyramidal && c.most_edges > 1),
        elements(pyramid ? (c.most_edges + most_element_rows - 1) / most_element_rows : 1),
        gravity(m.gravity),
        joints(m, s) {}

  KOKKOS_INLINE_FUNCTION int count(int world) const { return elements * contacts.count_of(world); }
  bool bounces() const { return collision.bounces && !soft.as_mujoco; }
  /// Contact c, or some edges of its pyramid, with what its rows are made of.
  struct Element {
    ContactRows const& type;
    int world, k, c;
    bool acts;               // below its margin
    detail::Hold hold;       // of the two bodies by rigid equalities; all: it has no rows
    ContactParameters<R> p;  // where it has some
    int count;               // rows
    KOKKOS_INLINE_FUNCTION Element(ContactRows const& of, int w, int element)
        : type(of),
          world(w),
          k(element),
          c(of.contact_of(w, element)),
          acts(contact_acts(of.collision, of.contacts, w, c)),
          hold(hold_of_bodies()),
          p(hold == detail::Hold::all ? ContactParameters<R>{} : acting_parameters(of.collision, of.contacts, w, c, acts)),
          count(hold == detail::Hold::all ? 0
                : !of.pyramid             ? p.condim
                                          : edges_from(first_edge())) {}
    KOKKOS_INLINE_FUNCTION bool is_pyramid() const { return type.pyramid && p.condim > 1; }
    KOKKOS_INLINE_FUNCTION int rows() const { return count; }
    template <class Row>
    KOKKOS_INLINE_FUNCTION R jacobian(int row, Row&& J) const {
      if (is_pyramid()) {
        type.add_edge(c, axis_of(row), edge_friction(row), J);
        return type.contacts.dist(c);
      }
      type.add_axis(c, row, R(1), J);
      return row == 0 ? type.contacts.dist(c) : R(0);
    }
    KOKKOS_INLINE_FUNCTION RowLaw<R> law(int row, R gap, R u, R h, RowBounds<R>&) const {
      R const surface = surface_rate(row), adhesion = type.adhesion_of(c);
      RowLaw<R> law = law_at_rest(row, gap, u + surface, h);
      law.zeta -= surface;
      bool const edge = is_pyramid();
      if ((row == 0 || edge) && adhesion != R(0)) law.zeta += law.compliance * h * adhesion / R(edge ? 2 * (p.condim - 1) : 1);
      return law;
    }
    /// Of surfaces that neither move nor pull.
    KOKKOS_INLINE_FUNCTION RowLaw<R> law_at_rest(int row, R dist, R u, R h) const {
      auto const& soft = type.soft;
      auto const& contacts = type.contacts;
      bool const edge = is_pyramid();
      bool const friction = row > 0 && !edge;
      if (friction && !soft.as_mujoco) return {R(0), R(0)};
      R const diag = type.body_invweight0(world, 2 * contacts.body1(c)) + type.body_invweight0(world, 2 * contacts.body2(c));
      // dist has what rounding has taken from places; MuJoCo's has not, and that of an edge has its tangents' part too
      R const gap = (soft.as_mujoco || type.pyramid ? contacts.dist(c) : dist) - contacts.includemargin(c);
      R const spring = soft.as_mujoco ? gap : min(gap, R(0));
      if (friction) return soft.tangent(p, row - 1, gap, u, h, diag);
      if (p.hard && !soft.as_mujoco && !edge) return hard_law(gap, h, p.erp, p.restitution, diag);
      RowLaw<R> law = edge ? soft.edge(p, spring, u, h, diag) : soft_law(type.softness(p), spring, u, h, diag);
      if (soft.as_mujoco) return law;
      if (gap > R(0)) law.zeta = min(-gap / h, law.zeta);  // no spring at a gap: it may close within the step
      if (!edge && hold == detail::Hold::none)
        law.most_yield = max(law.compliance / diag * gravity_rate(type.gravity, world, h), law.zeta / R(detail::most_lift));
      return law;
    }
    KOKKOS_INLINE_FUNCTION RowBounds<R> bounds(int row) const {
      if (row == 0 || is_pyramid()) return {R(0), Kokkos::Experimental::infinity_v<R>, -1, R(0), false, is_pyramid()};
      bool const first_of_two = row == 1 || row == 4;
      return {R(0), R(0), 0, p.friction[row - 1], first_of_two && type.cone == FrictionCone::elliptic};
    }
    /// Rate of the surfaces along a row.
    KOKKOS_INLINE_FUNCTION R surface_rate(int row) const {
      if (!type.contacts.moving) return R(0);
      int const axis = is_pyramid() ? axis_of(row) : row;
      if (axis < 1 || axis > 3) return R(0);
      return (is_pyramid() ? edge_friction(row) : R(1)) * type.contacts.surfacevel(c, axis - 1);
    }
    KOKKOS_INLINE_FUNCTION int first_edge() const { return most_element_rows * (k % type.elements); }
    /// Edges of the element, the first of them given; a contact without friction is a normal.
    KOKKOS_INLINE_FUNCTION int edges_from(int first) const {
      int const all = p.condim > 1 ? 2 * (p.condim - 1) : 1, left = all - first;
      return left < 0 ? 0 : left < most_element_rows ? left : most_element_rows;
    }
    /// Two by two the edges lie along an axis, there and back.
    static_assert(most_element_rows % 2 == 0);
    KOKKOS_INLINE_FUNCTION int axis_of(int row) const { return 1 + (first_edge() + row) / 2; }
    KOKKOS_INLINE_FUNCTION R edge_friction(int row) const {
      R const mu = p.friction[axis_of(row) - 1];
      return row % 2 ? -mu : mu;
    }
    /// All where nothing moves the two against each other, or pushes or pulls.
    KOKKOS_INLINE_FUNCTION detail::Hold hold_of_bodies() const {
      if (!acts && type.adhesion_of(c) == R(0)) return detail::Hold::all;
      // Equal last dofs, or none: the two do not move against each other (named pairs may be of such bodies), and J would be zero.
      int const body1 = type.contacts.body1(c), body2 = type.contacts.body2(c);
      if (type.joints.body_last_dof(body1) == type.joints.body_last_dof(body2)) return detail::Hold::all;
      return type.joints.between(world, body1, body2);
    }
  };
  KOKKOS_INLINE_FUNCTION Element element(int world, int k) const { return {*this, world, k}; }
  KOKKOS_INLINE_FUNCTION int rows(int world, int k) const { return element(world, k).rows(); }
  template <class Row>
  KOKKOS_INLINE_FUNCTION R jacobian(int world, int k, int row, Row&& J) const {
    return element(world, k).jacobian(row, J);
  }
  KOKKOS_INLINE_FUNCTION RowLaw<R> law(int world, int k, int row, R gap, R u, R h) const {
    RowBounds<R> limits{};
    return element(world, k).law(row, gap, u, h, limits);
  }
  KOKKOS_INLINE_FUNCTION RowBounds<R> bounds(int world, int k, int row) const { return element(world, k).bounds(row); }
  KOKKOS_INLINE_FUNCTION RowId id(int world, int k) const {
    int const c = contact_of(world, k);
    return {std::uint32_t(contacts.pair(c)), std::uint32_t(elements) * std::uint32_t(contacts.feature(c)) + std::uint32_t(k % elements)};
  }
  /// Where it acts: a point that is new starts from the impulses of those near it that are gone.
  KOKKOS_INLINE_FUNCTION Vec3<R> place(int world, int k) const { return contacts.point(contact_of(world, k)); }
  /// Direction of row 1 + i, by which friction of the last step is turned into this one's frame.
  KOKKOS_INLINE_FUNCTION Vec3<R> tangent(int world, int k, int i) const { return contacts.axis(contact_of(world, k), 1 + i); }
  /// Edges keep what they had: none of them is a tangent's alone.
  KOKKOS_INLINE_FUNCTION bool turns() const { return !pyramid; }

 private:
  KOKKOS_INLINE_FUNCTION int contact_of(int world, int k) const { return contacts.first_of(world) + k / elements; }
  /// Profile `stable` takes MuJoCo's default solref, (0.02, 1), as (0.0125, 1): its sweeps bear it, and what rests sinks in by 0.4 as much.
  /// What a file says itself rests where it says at any timestep; the default gives more where steps are long, as piles rest with it.
  KOKKOS_INLINE_FUNCTION Softness<R> softness(ContactParameters<R> const& p) const {
    Softness<R> s = softness_of(p, soft.refsafe);
    if (soft.as_mujoco) return s;
    bool const by_default = s.solref[0] == R(0.02) && s.solref[1] == R(1);
    if (by_default) s.solref[0] = R(0.0125);
    if (!by_default && s.refsafe == Refsafe::two_steps) s.refsafe = Refsafe::keeps_rest;
    return s;
  }
  /// J of axis `axis` of the contact: along the rows of its frame, then about them.
  template <class Row>
  KOKKOS_INLINE_FUNCTION void add_axis(int c, int axis, R scale, Row&& J) const {
    Vec3<R> const direction = scale * contacts.axis(c, axis % 3);
    if (axis < 3)
      add_force(c, axis > 0 && contacts.steady ? contacts.point(c) + contacts.lift(c) * contacts.axis(c, 0) : contacts.point(c), direction,
                J);
    else
      add_torque(c, direction, J);
  }
  /// J of an edge of its pyramid: of the normal, and mu times that of an axis.
  template <class Row>
  KOKKOS_INLINE_FUNCTION void add_edge(int c, int axis, R mu, Row&& J) const {
    if (axis < 3 && !contacts.steady) return add_force(c, contacts.point(c), fma(mu, contacts.axis(c, axis), contacts.axis(c, 0)), J);
    add_axis(c, 0, R(1), J);
    add_axis(c, axis, mu, J);
  }
  template <class Row>
  KOKKOS_INLINE_FUNCTION void add_force(int c, Vec3<R> const& point, Vec3<R> const& direction, Row&& J) const {
    J.add_point(contacts.body2(c), point, direction);
    J.add_point(contacts.body1(c), point, direction, R(-1));
  }
  template <class Row>
  KOKKOS_INLINE_FUNCTION void add_torque(int c, Vec3<R> const& direction, Row&& J) const {
    J.add_rotation(contacts.body2(c), direction);
    J.add_rotation(contacts.body1(c), direction, R(-1));
  }
  KOKKOS_INLINE_FUNCTION R adhesion_of(int c) const { return contacts.adhesive ? contacts.adhesion(c) : R(0); }
};

}  // namespace gsp
