#pragma once
#include <gsp/dynamics/bias_forces.hpp>

/// Trees that move as one rigid body, free or on a ball joint: their angular momentum is carried through a step (profile stable).
namespace gsp::detail {

/// Inertia of a rigid body that turns, as L^T D L is to a tree: I x and I^-1 x.
template <class T>
struct RotationalInertia {
  T xx, yy, zz, xy, xz, yz;
  T l10, l20, l21;  // of L D L^T
  Vec3<T> inverse;  // 1 / D

  GSP_FUNCTION RotationalInertia(T xx_, T yy_, T zz_, T xy_, T xz_, T yz_) : xx(xx_), yy(yy_), zz(zz_), xy(xy_), xz(xz_), yz(yz_) {
    T const least(1e-30);  // as for a singular M
    inverse.x = T(1) / max(xx, least);
    l10 = xy * inverse.x;
    l20 = xz * inverse.x;
    inverse.y = T(1) / max(fma(-l10, xy, yy), least);
    T const d21 = fma(-l20, xy, yz);
    l21 = d21 * inverse.y;
    inverse.z = T(1) / max(fma(-l21, d21, fma(-l20, xz, zz)), least);
  }
  GSP_FUNCTION Vec3<T> times(Vec3<T> const& w) const {
    return {fma(xx, w.x, fma(xy, w.y, xz * w.z)), fma(xy, w.x, fma(yy, w.y, yz * w.z)), fma(xz, w.x, fma(yz, w.y, zz * w.z))};
  }
  GSP_FUNCTION Vec3<T> solve(Vec3<T> const& m) const {
    T const y = fma(-l10, m.x, m.y), z = fma(-l21, y, fma(-l20, m.x, m.z));
    T const wz = z * inverse.z, wy = fma(-l21, wz, y * inverse.y);
    return {fma(-l20, wz, fma(-l10, wy, m.x * inverse.x)), wy, wz};
  }
  /// (I + [a]x)^-1 r = (adj(I) r + a (a . r) - (I a) x r) / (det I + a . I a), whatever a is. Scaled by the trace, so that float holds it.
  GSP_FUNCTION Vec3<T> solve_with_skew(Vec3<T> const& a, Vec3<T> const& r) const {
    T const scale = T(1) / max(xx + yy + zz, T(1e-30));
    T const sxx = scale * xx, syy = scale * yy, szz = scale * zz, sxy = scale * xy, sxz = scale * xz, syz = scale * yz;
    Vec3<T> const sa = scale * a, sr = scale * r;
    T const axx = fma(syy, szz, -(syz * syz)), ayy = fma(sxx, szz, -(sxz * sxz)), azz = fma(sxx, syy, -(sxy * sxy));
    T const axy = fma(sxz, syz, -(sxy * szz)), axz = fma(sxy, syz, -(sxz * syy)), ayz = fma(sxy, sxz, -(syz * sxx));
    Vec3<T> const ia{fma(sxx, sa.x, fma(sxy, sa.y, sxz * sa.z)), fma(sxy, sa.x, fma(syy, sa.y, syz * sa.z)),
                     fma(sxz, sa.x, fma(syz, sa.y, szz * sa.z))};
    Vec3<T> const adjugate{fma(axx, sr.x, fma(axy, sr.y, axz * sr.z)), fma(axy, sr.x, fma(ayy, sr.y, ayz * sr.z)),
                           fma(axz, sr.x, fma(ayz, sr.y, azz * sr.z))};
    T const determinant = fma(sxx, axx, fma(sxy, axy, sxz * axz)) + dot(sa, ia);
    return (T(1) / max(determinant, T(1e-30))) * (adjugate + dot(sa, sr) * sa - cross(ia, sr));
  }
};

/// q v q^-1 - v: what a rotation adds. As a small turn adds little, what it rounds is little too; velocities that go through two rotations
/// a step would drift by an ulp a hundred steps.
template <class T>
GSP_FUNCTION Vec3<T> rotation_change(Quat<T> const& q, Vec3<T> const& v) {
  Vec3<T> const u{q.x, q.y, q.z}, t = T(2) * cross(u, v);
  return q.w * t + cross(u, t);
}

/// All bodies of a rigid tree as one, in axes that are turned by `axes` from those of its root; the centre of mass from the root's origin,
/// in the root's axes.
template <class T>
struct RigidTree {
  Quat<T> axes;
  SpatialInertia<T> inertia;  // its center: see above
};
template <class L>
KOKKOS_INLINE_FUNCTION auto lanes_rigid_tree(L const& l) {
  using T = std::remove_cvref_t<decltype(l.items[0])>;
  auto const& s = l.items;
  T const zero(0);
  Vec3<T> const principal = l.constant3(l.model.body_inertia, l.body0, 0), center = l.constant3(l.model.body_ipos, l.body0, 0);
  Quat<T> const iq = l.constant4(l.model.body_iquat, l.body0, 0);
  T const mass = l.constant(l.model.body_mass, l.body0, 0);
  if (l.a.nbody == 1)  // in its principal axes: a needle would lose its smallest moment in others
    return RigidTree<T>{iq, {principal.x, principal.y, principal.z, zero, zero, zero, center, mass}};
  SpatialInertia<T> sum = spatial_inertia(mass, principal, iq, center);
  Vec3<T> const origin = s.vec3(l.at.xpos);
  Quat<T> const back = conjugate(s.quat(l.at.xquat));
  for (int b = 1; b < l.a.nbody; ++b) {
    Quat<T> const q = back * s.quat(l.at.xquat + 4 * b);
    Vec3<T> const c = rotate(back, s.vec3(l.at.xpos + 3 * b) - origin) + rotate(q, l.constant3(l.model.body_ipos, l.body0, b));
    sum = sum + spatial_inertia(l.constant(l.model.body_mass, l.body0, b), l.constant3(l.model.body_inertia, l.body0, b),
                                q * l.constant4(l.model.body_iquat, l.body0, b), c);
  }
  return RigidTree<T>{identity_quat<T>(), sum};
}

/// Such a tree as its joint turns it, from the dof `first` on, and the axes that its inertia is in.
template <class T>
struct Turning {
  bool is_free;
  int first;
  Quat<T> axes;
};
template <class L>
KOKKOS_INLINE_FUNCTION auto lanes_turning(L const& l) {
  using T = std::remove_cvref_t<decltype(l.items[0])>;
  bool const is_free = l.index(l.a.jnt_type, 0) == int(JointType::free);
  return Turning<T>{is_free, is_free ? 3 : 0, l.a.nbody == 1 ? l.constant4(l.model.body_iquat, l.body0, 0) : identity_quat<T>()};
}

/// What a step makes of a rigid body that has the angular velocity w, forces and impulses included, in the axes of the start: the frame
/// turns by exp(h x), x = w + more, and the velocity becomes w + gain in the new axes. By the midpoint rule, which keeps momentum and
/// energy:
///   I x = exp(-h x / 2) I w,   I (w + gain) = exp(-h x) I w.
/// x by Newton's method: with m = exp(-h x / 2) I w, (I - h/2 [m]x) dx = m - I x, whose matrix is never singular.
/// Source: the Lie-midpoint rule of Hairer, Lubich and Wanner, Geometric Numerical Integration (2006), ch. VII.5.
template <class T>
struct FreeTurn {
  Vec3<T> more;
  Quat<T> turn;
  Vec3<T> gain;
};
template <class T>
KOKKOS_INLINE_FUNCTION FreeTurn<T> free_turn(RotationalInertia<T> const& inertia, Vec3<T> const& w, T const& h) {
  Vec3<T> const momentum = inertia.times(w);
  Vec3<T> more{T(0), T(0), T(0)};                                         // x - w
  T const speed2 = dot(w, w), gain2 = square(T(0.125) * h * h * speed2);  // a round leaves (h |w|)^2 / 8 of what it mends
  T const enough = square(T(0.25) * T(Kokkos::Experimental::epsilon_v<real_t<T>>)) * speed2;
  auto settled = speed2 < T(0);  // nowhere; each lane by itself, whatever the others do
  for (int round = 0; round < 4; ++round) {
    Vec3<T> const change = rotation_change(exp_rotation(T(-0.5) * h * (w + more)), momentum);
    Vec3<T> const step = inertia.solve_with_skew(T(-0.5) * h * (momentum + change), change - inertia.times(more));
    more = select(settled, more, more + step);
    settled = settled || dot(step, step) * gain2 <= enough;
    if (all(settled)) break;
  }
  Quat<T> const turn = exp_rotation(h * (w + more));
  return {more, turn, inertia.solve(rotation_change(conjugate(turn), momentum))};
}

/// What constraints see of a tree that is one rigid body: x, the velocity of the middle of the step, by which the frame turns. It turns
/// about the centre of mass where it is free, about the anchor on a ball joint. velocity: of the start with all that forces add, in; with x
/// in place of w, out; push = x - w, inertia and center stay for lanes_turn. Where rows hold the joint (`held`) x - w is that of the start
/// alone: what forces add to w they take again, and a body that they hold would creep by what it would have turned.
template <class L, class Held>
KOKKOS_INLINE_FUNCTION void lanes_carry_momentum(L const& l, Held const& held) {
  using T = std::remove_cvref_t<decltype(l.items[0])>;
  auto const& s = l.items;
  auto const [is_free, first, axes] = lanes_turning(l);
  int const turning = l.at.velocity + first;  // of the dofs that turn it
  auto const tree = lanes_rigid_tree(l);
  auto const& i = tree.inertia;
  Vec3<T> const arm = is_free ? Vec3<T>{T(0), T(0), T(0)} : rotate_inverse(axes, i.center - l.constant3(l.model.jnt_pos, l.jnt0, 0));
  Vec3<T> const moment = i.mass * arm;
  T const rotor = l.constant(l.model.dof_armature, l.dof0, first);
  RotationalInertia<T> const inertia(i.xx + fma(moment.y, arm.y, fma(moment.z, arm.z, rotor)),
                                     i.yy + fma(moment.x, arm.x, fma(moment.z, arm.z, rotor)),
                                     i.zz + fma(moment.x, arm.x, fma(moment.y, arm.y, rotor)), fma(-moment.x, arm.y, i.xy),
                                     fma(-moment.x, arm.z, i.xz), fma(-moment.y, arm.z, i.yz));
  Vec3<T> const w = rotate_inverse(axes, select(held, s.vec3(l.at.qvel + first), s.vec3(turning)));
  Vec3<T> const push = rotate(axes, free_turn(inertia, w, T(l.model.timestep)).more);
  if (is_free) s.put(l.at.velocity, s.vec3(l.at.velocity) - rotate(s.quat(l.at.xquat), cross(push, i.center)));
  s.put(turning, s.vec3(turning) + push);
  s.put(l.at.push, push);
  s.put(l.at.center, i.center);
  s.put(l.at.turning_inertia, Vec3<T>{inertia.xx, inertia.yy, inertia.zz});
  s.put(l.at.turning_inertia + 3, Vec3<T>{inertia.xy, inertia.xz, inertia.yz});
}

/// The end of a step for such a tree. What the solver added acts at the start, where its Jacobians are: w = velocity - push, momentum I w
/// has what impulses gave and no more, and the body turns as it does without constraints
/// (docs/decisions/0029-constraints-see-the-middle-of-a-turn.md). The centre of mass c goes straight, and the origin of a free body round
/// it: v += x x c - exp(h x) ((w + gain) x c). Returns exp(h x), and how far the origin goes. `now`: the frame at the start.
template <class T>
struct Displacement {
  Quat<T> turn;
  Vec3<T> shift;
};
template <class L, class T>
KOKKOS_INLINE_FUNCTION Displacement<T> lanes_turn(L const& l, Quat<T> const& now) {
  auto const& s = l.items;
  T const h(l.model.timestep);
  auto const [is_free, first, axes] = lanes_turning(l);
  int const turning = l.at.velocity + first;
  Vec3<T> const diagonal = s.vec3(l.at.turning_inertia), product = s.vec3(l.at.turning_inertia + 3), center = s.vec3(l.at.center);
  RotationalInertia<T> const inertia(diagonal.x, diagonal.y, diagonal.z, product.x, product.y, product.z);
  Vec3<T> const u = s.vec3(turning), kicked = u - s.vec3(l.at.push), w = rotate_inverse(axes, kicked);
  auto const [more, own_turn, own_gain] = free_turn(inertia, w, h);
  Vec3<T> const axis = rotate(axes, Vec3<T>{own_turn.x, own_turn.y, own_turn.z}), gain = rotate(axes, own_gain), next = kicked + gain;
  Quat<T> const turn{own_turn.w, axis.x, axis.y, axis.z};
  s.put(turning, next);
  if (!is_free) return {turn, {}};
  Vec3<T> const v = s.vec3(l.at.velocity), flow = v + rotate(now, cross(u, center));  // flow: of the centre of mass
  Vec3<T> const change = cross(gain - s.vec3(l.at.push), center) + rotation_change(turn, cross(next, center));
  s.put(l.at.velocity, v - rotate(now, change));
  return {turn, h * flow - rotate(now, rotation_change(turn, center))};
}

}  // namespace gsp::detail
