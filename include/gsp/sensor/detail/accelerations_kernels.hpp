#pragma once
#include <gsp/constraint/detail/write_contact_forces.hpp>
#include <gsp/constraint/equality.hpp>
#include <gsp/constraint/tendon.hpp>
#include <gsp/dynamics/detail/bias_forces_lanes.hpp>
#include <gsp/dynamics/detail/factor_lanes.hpp>
#include <gsp/dynamics/detail/passive_forces_lanes.hpp>
#include <gsp/dynamics/world_lanes.hpp>

/// Kernels of gsp/sensor/accelerations.hpp, where the contract stands.
namespace gsp::detail {

/// In place of a row: what force along it does to bodies, about the origins of their frames. What acts on dofs acts inside. What acts on
/// tendons is put down as with how much they push, where that is asked for.
template <class R, class Mem>
struct ForceOnBodies {
  using View3 = Kokkos::View<R***, Kokkos::LayoutRight, Mem>;
  View3 xpos, outside;
  Kokkos::View<R**, Kokkos::LayoutRight, Mem> push;
  int world;
  R force;
  KOKKOS_INLINE_FUNCTION void add(int body, Vec3<R> const& f, Vec3<R> const& torque) const {
    for (int c = 0; c < 3; ++c) {
      outside(world, body, c) += f[c];
      outside(world, body, 3 + c) += torque[c];
    }
  }
  KOKKOS_INLINE_FUNCTION void add_point(int body, Vec3<R> const& point, Vec3<R> const& direction, R scale) const {
    Vec3<R> const f = (scale * force) * direction;
    add(body, f, cross(point - Vec3<R>{xpos(world, body, 0), xpos(world, body, 1), xpos(world, body, 2)}, f));
  }
  KOKKOS_INLINE_FUNCTION void add_rotation(int body, Vec3<R> const& direction, R scale) const {
    add(body, {R(0), R(0), R(0)}, (scale * force) * direction);
  }
  KOKKOS_INLINE_FUNCTION void set_dof(int, R) const {}
  KOKKOS_INLINE_FUNCTION void add_tendon(int tendon, R scale) const {
    if (push.data()) push(world, tendon) += scale * force;
  }
};

/// What contacts, connects and welds exert on bodies, and constraints on tendons, one world at a time, in the order of their lists.
template <class R, class Mem>
struct OutsideForces {
  Equalities<R, Mem> equalities;
  TendonLimits<R, Mem> limits;
  TendonFriction<R, Mem> friction;
  ElementImpulses<R, Mem> held, limited, rubbed;
  ContactForce<R, Mem> contact_force;
  typename ForceOnBodies<R, Mem>::View3 xpos, outside;
  Kokkos::View<R**, Kokkos::LayoutRight, Mem> push;  // (world, tendon) out; empty: not asked for
  bool solved;
  KOKKOS_INLINE_FUNCTION R force_of(ElementImpulses<R, Mem> const& of, int w, int k) const {
    int const first = of.first_row(w, k);
    return first < 0 ? R(0) : of.impulses.p[of.impulses.parity()](first) * contact_force.inverse_timestep;
  }
  KOKKOS_FUNCTION void operator()(int w) const {
    for (int b = 0; b < int(outside.extent(1)); ++b)
      for (int c = 0; c < 6; ++c) outside(w, b, c) = R(0);
    for (int t = 0; t < int(push.extent(1)); ++t) push(w, t) = R(0);
    if (!solved) return;
    auto const& contacts = contact_force.contacts;
    int const begin = contacts.first_of(w);
    for (int k = 0; k < contacts.count_of(w); ++k) {
      R force[6];
      if (!contact_force(w, k, force)) continue;
      int const c = begin + k, bodies[2] = {contacts.body1(c), contacts.body2(c)};
      for (int r = 0; r < 6; ++r) {
        Vec3<R> const axis = contacts.axis(c, r % 3);
        Vec3<R> point = contacts.point(c);
        if (contacts.steady && r > 0) point = point + contacts.lift(c) * contacts.axis(c, 0);  // where friction acts
        ForceOnBodies<R, Mem> const on{xpos, outside, push, w, force[r]};
        for (int end = 0; end < 2; ++end) {
          R const side(end == 0 ? -1 : 1);
          if (r < 3)
            on.add_point(bodies[end], point, axis, side);
          else
            on.add_rotation(bodies[end], axis, side);
        }
      }
    }
    for (int k = 0; k < equalities.count(w); ++k) {
      int const first = held.first_row(w, k);
      if (first < 0) continue;
      R const* const p = held.impulses.p[held.impulses.parity()].data() + first;
      for (int r = 0; r < held.rows.element_rows(first); ++r)
        equalities.jacobian(w, k, r, ForceOnBodies<R, Mem>{xpos, outside, push, w, p[r] * contact_force.inverse_timestep});
    }
    if (!push.data()) return;
    for (int k = 0; k < limits.count(w); ++k)
      push(w, limits.limited_tendons(k / 2)) += (k % 2 == 0 ? R(1) : R(-1)) * force_of(limited, w, k);
    for (int k = 0; k < friction.count(w); ++k) push(w, friction.friction_tendons(k)) += force_of(rubbed, w, k);
  }
};

/// Accelerations of dofs.
template <class R, class Mem>
struct JointAccelerationStage {
  Kokkos::View<R**, Kokkos::LayoutRight, Mem> z, qacc;
  Kokkos::View<int**, Kokkos::LayoutRight, Mem> island;  // SleepingIslands; empty: nothing sleeps

  /// 0 where the lane's tree sleeps, else 1.
  template <class L>
  KOKKOS_INLINE_FUNCTION auto awake(L const& l) const {
    using T = std::remove_cvref_t<decltype(l.items[0])>;
    T out(1);
    for (int k = 0; k < L::W && island.data(); ++k) {
      if (island(l.world[k], l.model.body_tree(l.body0[k])) < 0) continue;
      if constexpr (L::W == 1)
        out = T(0);
      else
        out.set(k, 0);
    }
    return out;
  }
  /// impulse <- qacc
  template <class L>
  KOKKOS_INLINE_FUNCTION void joint_accelerations(L const& l) const {
    using T = std::remove_cvref_t<decltype(l.items[0])>;
    auto const& s = l.items;
    int const nv = l.a.nv, x = l.at.impulse, turning = l.at.cfrc;  // cfrc: room for the six dofs of a rigid tree
    T const rate = T(1) / T(l.model.timestep);
    for (int i = 0; i < nv; ++i) s[x + i] = z.data() ? l.load(z, l.dof0, i) * sqrt(s[l.at.inverse_diagonal + i]) : T(0);
    lanes_solve_lower(l, x);
    for (int i = 0; i < nv; ++i) s[x + i] = fma(rate, s[x + i], s[l.at.acceleration + i]);
    if (carries_momentum(l)) {
      for (int i = 0; i < nv; ++i) s[turning + i] = s[l.at.turning_bias + i];
      lanes_solve(l, turning);
      for (int i = 0; i < nv; ++i) s[x + i] = s[x + i] - s[turning + i];
    }
    T const moves = awake(l);
    for (int i = 0; i < nv; ++i) {
      s[x + i] = select(moves > T(0), s[x + i], T(0));
      l.store(qacc, l.dof0, i, s[x + i]);
    }
  }
  template <class L>
  KOKKOS_FUNCTION void operator()(L const& l) const {
    joint_accelerations(l);
  }
};

/// Those, and what bodies do and what acts on them.
template <class R, class Mem>
struct AccelerationStage : JointAccelerationStage<R, Mem> {
  using View3 = Kokkos::View<R***, Kokkos::LayoutRight, Mem>;
  State<R, Mem> state;
  View3 xpos, xquat;
  View3 velocity, acceleration, outside, inside;
  Kokkos::View<R**, Kokkos::LayoutRight, Mem> push;  // (world, tendon) of constraints on tendons; empty: tendons act inside

  template <class L>
  KOKKOS_INLINE_FUNCTION auto load3(L const& l, View3 const& view, int b, int components, int first) const {
    using T = std::remove_cvref_t<decltype(l.items[0])>;
    return Vec3<T>{l.load(view, l.body0, b, components, first), l.load(view, l.body0, b, components, first + 1),
                   l.load(view, l.body0, b, components, first + 2)};
  }
  template <class L, class T>
  KOKKOS_INLINE_FUNCTION void store6(L const& l, View3 const& view, int b, Vec3<T> const& linear, Vec3<T> const& angular) const {
    for (int c = 0; c < 3; ++c) {
      l.store(view, l.body0, b, linear[c], 6, c);
      l.store(view, l.body0, b, angular[c], 6, 3 + c);
    }
  }
  /// outside += what spatial tendons do to the bodies of the tree: springs and dampers, actuators and constraints, along the path.
  template <class L>
  KOKKOS_INLINE_FUNCTION void tendon_forces(L const& l) const {
    using T = std::remove_cvref_t<decltype(l.items[0])>;
    auto const& a = l.a;
    for (int k = 0; k < a.ntendon; ++k) {
      if (l.index(a.tendon_kind, k) == int(TendonKind::fixed)) continue;
      int item[L::W];
      l.listed_items(a.instance_tendon, a.ntendon, k, item);
      T force = l.load(push, item, 0) + lanes_tendon_force(l, k);
      for (int i = 0; i < a.nact; ++i)
        if (l.index(a.act_kind, i) == int(ActuatorKind::tendon) && l.index(a.act_id, i) == k)
          force = fma(l.listed(l.model.act_gear, a.instance_act, a.nact, i, 6, 0), l.items[l.at.act_force + i], force);
      lanes_tendon_path(l, state, k, [&](int j, Vec3<T> const& point, Vec3<T> const& unit) {
        int const b = l.index(a.path_ref, j);
        if (b < 0) return;
        Vec3<T> const f = force * unit, torque = cross(point - l.items.vec3(l.at.xpos + 3 * b), f);
        store6(l, outside, b, load3(l, outside, b, 6, 0) + f, load3(l, outside, b, 6, 3) + torque);
      });
    }
  }
  template <class L>
  KOKKOS_FUNCTION void operator()(L const& l) const {
    using T = std::remove_cvref_t<decltype(l.items[0])>;
    auto const& a = l.a;
    auto const& s = l.items;
    auto const skipped = [&](int b) { return l.index(a.body_parent, b) == parent_of::none; };
    this->joint_accelerations(l);
    for (int b = 0; b < a.nbody; ++b) {
      if (skipped(b)) continue;
      s.put(l.at.xpos + 3 * b, load3(l, xpos, b, 3, 0));
      s.put(l.at.xquat + 4 * b, Quat<T>{l.load(xquat, l.body0, b, 4, 0), l.load(xquat, l.body0, b, 4, 1), l.load(xquat, l.body0, b, 4, 2),
                                        l.load(xquat, l.body0, b, 4, 3)});
    }
    lanes_centers(l);
    lanes_body_inertias(l);
    if (push.data()) tendon_forces(l);
    auto const arm = [&](int b) { return s.vec3(l.at.xpos + 3 * b) - l.com_of_body(b); };
    lanes_newton_euler(
        l, false, [&](int i) { return s[l.at.impulse + i]; },
        [&](int b, Spatial<T> const& f) {
          Vec3<T> const push = load3(l, outside, b, 6, 0), torque = load3(l, outside, b, 6, 3);
          return Spatial<T>{f.angular - torque - cross(arm(b), push), f.linear - push};
        });
    for (int b = 0; b < a.nbody; ++b) {
      if (skipped(b)) continue;
      Vec3<T> const r = arm(b);
      Spatial<T> const v = s.spatial(l.at.cvel + 6 * b), acc = s.spatial(l.at.cacc + 6 * b), f = s.spatial(l.at.cfrc + 6 * b);
      Vec3<T> const moves = v.linear + cross(v.angular, r);
      store6(l, velocity, b, moves, v.angular);
      store6(l, acceleration, b, acc.linear + cross(acc.angular, r) + cross(v.angular, moves), acc.angular);
      store6(l, inside, b, f.linear, f.angular - cross(r, f.linear));
    }
  }
};

/// Bodies that no joint moves: their weight, and what stands on them.
template <class R, class Mem>
struct StandingForces {
  using View3 = Kokkos::View<R***, Kokkos::LayoutRight, Mem>;
  Model<R, Mem> model;
  Poses<R, Mem> poses;
  View3 velocity, acceleration, outside, inside;
  template <class T>
  KOKKOS_INLINE_FUNCTION static Vec3<T> part(WorldLane<T> const& l, View3 const& v, int b, int first) {
    return {l.load(v, b, 6, first), l.load(v, b, 6, first + 1), l.load(v, b, 6, first + 2)};
  }
  template <class T>
  KOKKOS_INLINE_FUNCTION static void put(WorldLane<T> const& l, View3 const& v, int b, Vec3<T> const& linear, Vec3<T> const& angular) {
    for (int c = 0; c < 3; ++c) {
      l.store(v, b, linear[c], 6, c);
      l.store(v, b, angular[c], 6, 3 + c);
    }
  }
  template <class T>
  KOKKOS_FUNCTION void operator()(WorldLane<T> const& l, int) const {
    Vec3<T> const zero{T(0), T(0), T(0)}, up = T(-1) * l.constant3(model.gravity, 0);
    for (int b = 0; b < model.nbody; ++b) {
      if (model.body_tree(b) >= 0) continue;
      put(l, velocity, b, zero, zero);
      put(l, acceleration, b, up, zero);
      if (b == 0) {  // nothing holds the world
        put(l, inside, b, zero, zero);
        continue;
      }
      Vec3<T> const weight = l.constant(model.body_mass, b) * up;
      Vec3<T> const arm = rotate(l.load4(poses.xquat, b), l.constant3(model.body_ipos, b));
      put(l, inside, b, weight - part(l, outside, b, 0), cross(arm, weight) - part(l, outside, b, 3));
    }
    for (int b = model.nbody - 1; b > 0; --b) {
      int const parent = model.body_parent(b);
      if (model.body_tree(parent) >= 0) continue;
      Vec3<T> const force = part(l, inside, b, 0), arm = l.load3(poses.xpos, b) - l.load3(poses.xpos, parent);
      put(l, inside, parent, part(l, inside, parent, 0) + force, part(l, inside, parent, 3) + part(l, inside, b, 3) + cross(arm, force));
    }
  }
};

}  // namespace gsp::detail
