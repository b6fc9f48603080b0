#pragma once
#include <gsp/constraint/softness.hpp>
#include <gsp/model/state.hpp>

namespace gsp::detail {

/// How far rigid equalities hold two bodies together.
enum class Hold : signed char { none, point, all };

/// The rigid connects and welds of a model, as contacts ask for them. Cost: a pass over the equalities a contact, where any may be rigid.
template <class R, class Mem>
struct RigidJoints {
  using Indices = typename Model<R, Mem>::template Array<int>;
  int count = 0;  // equalities to look at
  Indices eq_type, eq_id1, eq_id2, eq_sites, site_body, body_last_dof;
  Kokkos::View<int**, Kokkos::LayoutRight, Mem> eq_active;
  Field<R> eq_rigid;
  RigidJoints(Model<R, Mem> const& m, State<R, Mem> const& s)
      : count(m.equalities && may_be_rigid(m.profile, m.rigid_equalities, m.eq_rigid) ? m.neq : 0),
        eq_type(m.eq_type),
        eq_id1(m.eq_id1),
        eq_id2(m.eq_id2),
        eq_sites(m.eq_sites),
        site_body(m.site_body),
        body_last_dof(m.body_last_dof),
        eq_active(s.eq_active),
        eq_rigid(m.eq_rigid) {}

  KOKKOS_INLINE_FUNCTION Hold between(int world, int a, int b) const {
    Hold most = Hold::none;
    for (int k = 0; k < count && most != Hold::all; ++k) {
      EqualityType const type = EqualityType(eq_type(k));
      if (type != EqualityType::connect && type != EqualityType::weld) continue;
      if (eq_active(world, k) == 0 || !Rigidity<R>(eq_rigid, world, k, true).hard) continue;
      int const one = body(k, eq_id1(k)), other = body(k, eq_id2(k));
      if ((is_same(a, one) && is_same(b, other)) || (is_same(a, other) && is_same(b, one)))
        most = type == EqualityType::weld ? Hold::all : Hold::point;
    }
    return most;
  }

 private:
  KOKKOS_INLINE_FUNCTION int body(int k, int id) const { return eq_sites(k) ? site_body(id) : id; }
  /// Whether the two are one, or never move against each other.
  KOKKOS_INLINE_FUNCTION bool is_same(int a, int b) const {
    return a == b || (body_last_dof(a) >= 0 && body_last_dof(a) == body_last_dof(b));
  }
};

}  // namespace gsp::detail
