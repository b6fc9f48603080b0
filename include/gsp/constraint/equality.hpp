#pragma once
#include <gsp/constraint/detail/tree_reader.hpp>
#include <gsp/constraint/softness.hpp>
#include <gsp/model/poses.hpp>

/// Equality constraints of MJCF as rows without bounds, soft as their solref and solimp say:
///   connect (3 rows)   two points meet                    x = p1 - p2
///   weld (6)           and two frames agree               x = torquescale * vector part of q2^-1 q1
///   joint, tendon (1)  y1 = c0 + c1 y2 + ... + c4 y2^4    x = y1 - that; y: position or length less the one in qpos0, y2 = 0 where only
///                                                         one is named
/// connect and weld hold points and frames of two bodies (the world, where only one is named), or two sites. Source: MuJoCo's
/// documentation, "Computation: equality".
namespace gsp {

/// A rigid equality closes its gap no faster than so many |g| h: two that contradict each other throw nothing away.
inline constexpr double most_closing = 1e3;

/// The equality constraints of the model; element k is the k-th of them, rows where state.eq_active(world, k). Its data (Model::eq_data):
///   connect, bodies  0-2 the point in body 1, 3-5 in body 2
///   weld, bodies     0-2 the point in body 2, 3-5 in body 1, 6-9 body 2's turn in body 1, 10 torquescale; sites: 10 alone
///   joint, tendon    0-4 c0 ... c4
/// What joins two bodies that do not move against each other has no rows. The rate of J is taken into account where points and frames are
/// held, J' v being subtracted from what the law asks for, so that what turns fast is not pulled apart.
/// Rigid ones (eq_rigid, profile stable): C = 0, zeta = -erp x / h - h J' v / 2, by which the gap after a step, x + h J v+ + h^2 J' v / 2,
/// is (1 - erp) x but for h^3.
template <class R, class Mem>
struct Equalities {
  static constexpr bool rests = true;
  using Indices = typename Model<R, Mem>::template Array<int>;
  template <class D>
  using View = Kokkos::View<D, Kokkos::LayoutRight, Mem>;
  detail::TreeReader<R, Mem> trees;
  detail::Stamps stamps;  // host: those of the dynamics
  Poses<R, Mem> poses;
  View<R**> qpos;
  View<int**> eq_active;
  Indices eq_type, eq_id1, eq_id2, eq_sites, site_body, jnt_qposadr, jnt_dofadr, tendon_tree, tendon_place;
  Field<R> eq_data, eq_solref, eq_solimp, eq_rigid, site_pos, site_quat, qpos0, tendon_length0, body_invweight0, dof_invweight0,
      tendon_invweight0, gravity;
  int elements;
  bool tendons, stable;
  Refsafe refsafe;
  Equalities(Model<R, Mem> const& m, State<R, Mem> const& s, Poses<R, Mem> const& p, Dynamics<R, Mem> const& d)
      : trees(m, d),
        stamps(d.stamps),
        poses(p),
        qpos(s.qpos),
        eq_active(s.eq_active),
        eq_type(m.eq_type),
        eq_id1(m.eq_id1),
        eq_id2(m.eq_id2),
        eq_sites(m.eq_sites),
        site_body(m.site_body),
        jnt_qposadr(m.jnt_qposadr),
        jnt_dofadr(m.jnt_dofadr),
        tendon_tree(m.tendon_tree),
        tendon_place(m.tendon_place),
        eq_data(m.eq_data),
        eq_solref(m.eq_solref),
        eq_solimp(m.eq_solimp),
        eq_rigid(m.eq_rigid),
        site_pos(m.site_pos),
        site_quat(m.site_quat),
        qpos0(m.qpos0),
        tendon_length0(m.tendon_length0),
        body_invweight0(m.body_invweight0),
        dof_invweight0(m.dof_invweight0),
        tendon_invweight0(m.tendon_invweight0),
        gravity(m.gravity),
        elements(m.equalities ? m.neq : 0),
        tendons(m.ntendon > 0),
        stable(m.profile == Profile::stable),
        refsafe(refsafe_of(m)) {}

  detail::Quantities reads() const { return elements > 0 && tendons ? detail::set_of(Quantity::tendon_length) : detail::Quantities{}; }
  KOKKOS_INLINE_FUNCTION int count(int) const { return elements; }
  KOKKOS_INLINE_FUNCTION int rows(int world, int k) const {
    if (eq_active(world, k) == 0) return 0;
    EqualityType const type = type_of(k);
    if (type == EqualityType::joint) return 1;
    if (type == EqualityType::tendon) return tendon_tree(eq_id1(k)) >= 0 || (eq_id2(k) >= 0 && tendon_tree(eq_id2(k)) >= 0);
    if (trees.body_last_dof[body(k, 0)] == trees.body_last_dof[body(k, 1)]) return 0;
    return type == EqualityType::weld ? 6 : 3;
  }
  template <class Row>
  KOKKOS_INLINE_FUNCTION R jacobian(int world, int k, int row, Row&& J) const {
    EqualityType const type = type_of(k);
    if (type == EqualityType::joint || type == EqualityType::tendon) return couple(world, k, J);
    Frames const f = frames(world, k);
    if (row < 3) {
      Vec3<R> const axis = unit(row);
      J.add_point(body(k, 0), f.point[0], axis, R(1));
      J.add_point(body(k, 1), f.point[1], axis, R(-1));
    } else {
      Vec3<R> const axis = turn_axis(world, k, row - 3, f);
      J.add_rotation(body(k, 0), axis, R(1));
      J.add_rotation(body(k, 1), axis, R(-1));
    }
    return gap(world, k, row, f);
  }
  KOKKOS_INLINE_FUNCTION RowLaw<R> law(int world, int k, int row, R x, R u, R h) const {
    EqualityType const type = type_of(k);
    if (detail::Rigidity<R> const r{eq_rigid, world, k, stable}; r.hard) {
      R const most = R(most_closing) * gravity_rate(gravity, world, h);
      return {R(0), clamp(-r.erp * x / h, -most, most) - R(0.5) * h * curvature(world, k, row)};
    }
    Softness<R> const s = detail::softness(eq_solref, eq_solimp, world, k, refsafe);
    int const id1 = eq_id1(k), id2 = eq_id2(k);
    if (type == EqualityType::joint) {
      R const second = id2 < 0 ? R(0) : dof_invweight0(world, jnt_dofadr(id2));
      return soft_law(s, x, u, h, dof_invweight0(world, jnt_dofadr(id1)) + second);
    }
    if (type == EqualityType::tendon) {
      R const second = id2 < 0 ? R(0) : tendon_invweight0(world, id2);
      return soft_law(s, x, u, h, tendon_invweight0(world, id1) + second);
    }
    Frames const f = frames(world, k);
    R sum(0);
    for (int r = 0, n = type == EqualityType::weld ? 6 : 3; r < n; ++r) sum += square(gap(world, k, r, f));
    int const turns = row < 3 ? 0 : 1;
    R const diag = body_invweight0(world, 2 * body(k, 0) + turns) + body_invweight0(world, 2 * body(k, 1) + turns);
    RowLaw<R> out = soft_law(s, impedance_of(s, sqrt(sum)), x, u, h, diag, false);
    out.zeta -= h * drift(world, k, row, f);
    return out;
  }
  KOKKOS_INLINE_FUNCTION RowBounds<R> bounds(int, int, int) const {
    return {-Kokkos::Experimental::infinity_v<R>, Kokkos::Experimental::infinity_v<R>};
  }
  KOKKOS_INLINE_FUNCTION RowId id(int, int k) const { return {std::uint32_t(k), 0}; }

 private:
  /// The two points and frames of a connect or weld, in the world.
  struct Frames {
    Vec3<R> point[2];
    Quat<R> turn[2];
  };
  KOKKOS_INLINE_FUNCTION EqualityType type_of(int k) const { return EqualityType(eq_type(k)); }
  KOKKOS_INLINE_FUNCTION R data(int world, int k, int i) const { return eq_data(world, 11 * k + i); }
  KOKKOS_INLINE_FUNCTION int body(int k, int end) const {
    int const id = end == 0 ? eq_id1(k) : eq_id2(k);
    return eq_sites(k) ? site_body(id) : id;
  }
  KOKKOS_INLINE_FUNCTION static Vec3<R> unit(int axis) { return {R(axis == 0), R(axis == 1), R(axis == 2)}; }

  KOKKOS_INLINE_FUNCTION Frames frames(int world, int k) const {
    Frames out;
    bool const weld = type_of(k) == EqualityType::weld, sites = eq_sites(k);
    for (int end = 0; end < 2; ++end) {
      int const b = body(k, end);
      Transform<R> const pose{{poses.xpos(world, b, 0), poses.xpos(world, b, 1), poses.xpos(world, b, 2)},
                              {poses.xquat(world, b, 0), poses.xquat(world, b, 1), poses.xquat(world, b, 2), poses.xquat(world, b, 3)}};
      Vec3<R> at;
      Quat<R> turn = identity_quat<R>();
      if (sites) {
        int const s = end == 0 ? eq_id1(k) : eq_id2(k);
        at = {site_pos(world, 3 * s), site_pos(world, 3 * s + 1), site_pos(world, 3 * s + 2)};
        turn = {site_quat(world, 4 * s), site_quat(world, 4 * s + 1), site_quat(world, 4 * s + 2), site_quat(world, 4 * s + 3)};
      } else {
        int const first = weld == (end == 0) ? 3 : 0;
        at = {data(world, k, first), data(world, k, first + 1), data(world, k, first + 2)};
        if (weld && end == 0) turn = {data(world, k, 6), data(world, k, 7), data(world, k, 8), data(world, k, 9)};
      }
      out.point[end] = pose * at;
      out.turn[end] = pose.q * turn;
    }
    return out;
  }
  KOKKOS_INLINE_FUNCTION R gap(int world, int k, int row, Frames const& f) const {
    if (row < 3) return (f.point[0] - f.point[1])[row];
    Quat<R> const q = conjugate(f.turn[1]) * f.turn[0];
    return data(world, k, 10) * (row == 3 ? q.x : row == 4 ? q.y : q.z);
  }
  /// The rate of the turning gaps is torquescale/2 times the vector part of q2^-1 (0, w1 - w2) q1: component c of it is axis . (w1 - w2).
  KOKKOS_INLINE_FUNCTION Vec3<R> turn_axis(int world, int k, int c, Frames const& f) const {
    R const half = R(0.5) * data(world, k, 10);
    Vec3<R> axis;
    for (int i = 0; i < 3; ++i) axis[i] = half * turned(unit(i), R(0), f)[c];
    return axis;
  }
  /// Vector part of q2^-1 (s, v) q1.
  KOKKOS_INLINE_FUNCTION static Vec3<R> turned(Vec3<R> const& v, R s, Frames const& f) {
    Quat<R> const q = conjugate(f.turn[1]) * (Quat<R>{s, v.x, v.y, v.z} * f.turn[0]);
    return {q.x, q.y, q.z};
  }
  /// The second derivative of a gap where no joint accelerates; of tendons 0 is taken for that of their lengths.
  KOKKOS_INLINE_FUNCTION R curvature(int world, int k, int row) const {
    EqualityType const type = type_of(k);
    if (type == EqualityType::connect || type == EqualityType::weld) return drift(world, k, row, frames(world, k));
    int const id = eq_id2(k);
    if (type == EqualityType::tendon || id < 0) return R(0);
    R const y = place(world, k, id), c2 = data(world, k, 2), c3 = data(world, k, 3), c4 = data(world, k, 4);
    int const dof = jnt_dofadr(id), t = trees.dof_tree[dof];
    TreeItems<R> const items = trees.tree(world, t);
    R const rate = items[items.at.qvel + dof - trees.tree_dof[t]];
    return -(R(2) * c2 + y * (R(6) * c3 + y * R(12) * c4)) * rate * rate;
  }
  /// J' v: what the gap's second derivative is where no joint accelerates. Points: a1 - a2. Frames, with w = w1 - w2 and a the difference
  /// of the angular accelerations: torquescale/2 times the vector part of q2^-1 ((0, a) + ((0, w) (0, w1) - (0, w2) (0, w))/2) q1.
  KOKKOS_INLINE_FUNCTION R drift(int world, int k, int row, Frames const& f) const {
    auto const m1 = trees.motion(world, body(k, 0)), m2 = trees.motion(world, body(k, 1));
    if (row < 3) return (m1.drift_of(f.point[0]) - m2.drift_of(f.point[1]))[row];
    Vec3<R> const w1 = m1.velocity.angular, w2 = m2.velocity.angular, w = w1 - w2;
    Vec3<R> const v = m1.drift.angular - m2.drift.angular + R(0.5) * (cross(w, w1) - cross(w2, w));
    R const s = R(0.5) * (dot(w2, w) - dot(w, w1));
    return R(0.5) * data(world, k, 10) * turned(v, s, f)[row - 3];
  }

  /// The row of a joint or tendon equality: J = dy1/dq - slope dy2/dq, slope = c1 + 2 c2 y2 + 3 c3 y2^2 + 4 c4 y2^3.
  template <class Row>
  KOKKOS_INLINE_FUNCTION R couple(int world, int k, Row&& J) const {
    int const id1 = eq_id1(k), id2 = eq_id2(k);
    R const x = place(world, k, id1) - data(world, k, 0);
    add(world, k, id1, R(1), J);
    if (id2 < 0) return x;
    R const y = place(world, k, id2), c1 = data(world, k, 1), c2 = data(world, k, 2), c3 = data(world, k, 3), c4 = data(world, k, 4);
    add(world, k, id2, -(c1 + y * (R(2) * c2 + y * (R(3) * c3 + y * R(4) * c4))), J);
    return x - y * (c1 + y * (c2 + y * (c3 + y * c4)));
  }
  /// Position of a joint, or length of a tendon, less the one in qpos0.
  KOKKOS_INLINE_FUNCTION R place(int world, int k, int id) const {
    if (type_of(k) == EqualityType::tendon)
      return tendon_tree(id) < 0 ? R(0) : trees.tendon_length(world, tendon_tree(id), tendon_place(id)) - tendon_length0(world, id);
    int const q = jnt_qposadr(id);
    return qpos(world, q) - qpos0(world, q);
  }
  template <class Row>
  KOKKOS_INLINE_FUNCTION void add(int world, int k, int id, R scale, Row&& J) const {
    if (type_of(k) == EqualityType::joint)
      J.set_dof(jnt_dofadr(id), scale);
    else if constexpr (requires { J.add_tendon(id, scale); })  // whoever takes it as a whole
      J.add_tendon(id, scale);
    else if (tendon_tree(id) >= 0)
      trees.add_tendon(world, tendon_tree(id), tendon_place(id), scale, J);
  }
};

}  // namespace gsp
