#pragma once
#include <gsp/dynamics/dynamics.hpp>

/// What constraint types read of the dynamics besides cdof: lengths and moment arms of tendons, and how bodies move. Plain pointers: a type
/// is an argument of kernels, and should be small.
namespace gsp::detail {

/// How a body moves: its velocity, and its acceleration at zero joint accelerations, about `center`.
template <class R>
struct BodyMotion {
  Vec3<R> center;
  Spatial<R> velocity, drift;
  /// Acceleration, at zero joint accelerations, of the body's point that is now at p: a + alpha x r + w x (v + w x r).
  KOKKOS_INLINE_FUNCTION Vec3<R> drift_of(Vec3<R> const& p) const {
    Vec3<R> const r = p - center;
    return drift.linear + cross(drift.angular, r) + cross(velocity.angular, velocity.linear + cross(velocity.angular, r));
  }
};

/// Reads the items of the trees of a world, as Dynamics::tree does.
template <class R, class Mem>
struct TreeReader {
  static constexpr int width = Dynamics<R, Mem>::width;
  R* values;
  std::int64_t const* block_offset;
  int const *archetype_block, *tree_archetype, *tree_instance, *tree_dof, *dof_tree, *body_last_dof, *body_root, *ints;
  Archetype const* archetypes;
  DynamicsLayout const* layouts;
  Field<R> term_coef;
  int padded_worlds;
  bool carries;  // profile stable: the centre of mass of a lone rigid body goes straight, not its frame's origin (dynamics/factor.hpp)
  TreeReader(Model<R, Mem> const& m, Dynamics<R, Mem> const& d)
      : values(d.items.data()),
        block_offset(d.block_offset.data()),
        archetype_block(d.archetype_block.data()),
        tree_archetype(m.tree_archetype.data()),
        tree_instance(m.tree_instance.data()),
        tree_dof(m.tree_dof.data()),
        dof_tree(m.dof_tree.data()),
        body_last_dof(m.body_last_dof.data()),
        body_root(m.body_root.data()),
        ints(m.ints.data()),
        archetypes(m.archetypes.data()),
        layouts(d.layouts.data()),
        term_coef(m.term_coef),
        padded_worlds(d.padded_worlds),
        carries(m.profile == Profile::stable) {}

  KOKKOS_INLINE_FUNCTION Archetype const& archetype(int t) const { return archetypes[tree_archetype[t]]; }
  KOKKOS_INLINE_FUNCTION TreeItems<R> tree(int w, int t) const {
    int const k = tree_archetype[t], lane = tree_instance[t] * padded_worlds + w;
    return {{whole(values + block_offset[archetype_block[k] + lane / width] + lane % width), width}, layouts[k]};
  }

  /// Length of tendon `place` of tree t [m, rad].
  KOKKOS_INLINE_FUNCTION R tendon_length(int w, int t, int place) const {
    TreeItems<R> const items = tree(w, t);
    return items[items.at.tendon_length + place];
  }
  /// J += scale * (its moment arm dlength/dq)
  template <class Row>
  KOKKOS_INLINE_FUNCTION void add_tendon(int w, int t, int place, R scale, Row&& J) const {
    Archetype const& a = archetype(t);
    TreeItems<R> const items = tree(w, t);
    int const dof0 = tree_dof[t], terms = a.instance_term + tree_instance[t] * a.nterm;
    for (int e = ints[a.tendon_termadr + place], end = ints[a.tendon_termadr + place + 1]; e < end; ++e)
      J.set_dof(dof0 + ints[a.jnt_dofadr + ints[a.term_jnt + e]], scale * term_coef(w, ints[terms + e]));
    for (int e = ints[a.tendon_jadr + place], end = ints[a.tendon_jadr + place + 1]; e < end; ++e)
      J.set_dof(dof0 + ints[a.tendon_jdof + e], scale * items[items.at.tendon_J + e]);
  }
  /// Rate of its length [m/s, rad/s].
  KOKKOS_INLINE_FUNCTION R tendon_rate(int w, int t, int place) const {
    RateOf rate{tree(w, t), tree_dof[t]};
    add_tendon(w, t, place, R(1), rate);
    return rate.sum;
  }

  /// J += (moment of actuator `place` of tree t), its gear in it
  template <class Row>
  KOKKOS_INLINE_FUNCTION void add_actuator(int w, int t, int place, R gear, Row&& J) const {
    Archetype const& a = archetype(t);
    auto const kind = ActuatorKind(ints[a.act_kind + place]);
    int const dof0 = tree_dof[t], id = ints[a.act_id + place];
    if (kind == ActuatorKind::scalar_joint) {
      J.set_dof(dof0 + ints[a.jnt_dofadr + id], gear);
    } else if (kind == ActuatorKind::tendon) {
      add_tendon(w, t, id, gear, J);
    } else {
      TreeItems<R> const items = tree(w, t);
      for (int e = ints[a.act_madr + place], end = ints[a.act_madr + place + 1]; e < end; ++e)
        J.set_dof(dof0 + ints[a.act_mdof + e], items[items.at.act_moment + e]);
    }
  }

  /// In place of a row: J v of one tree.
  struct RateOf {
    TreeItems<R> items;
    int dof0;
    R sum = R(0);
    KOKKOS_INLINE_FUNCTION void set_dof(int dof, R value) { sum = fma(value, items[items.at.qvel + dof - dof0], sum); }
  };

  /// Motion of a body, dof by dof from its root: V = sum S v and A = sum (V_S x S) v, V_S the velocity of the frame that S is fixed to: of
  /// a ball's and a free joint's axes the one before the joint turns, of a free joint's translations the world's. A lone rigid body that
  /// carries its momentum turns about its centre of mass.
  KOKKOS_INLINE_FUNCTION BodyMotion<R> motion(int w, int body) const {
    Vec3<R> const zero{R(0), R(0), R(0)};
    BodyMotion<R> out{zero, {zero, zero}, {zero, zero}};
    int const dof = body_last_dof[body];
    if (dof < 0) return out;
    int const t = dof_tree[dof], last = dof - tree_dof[t];
    Archetype const& a = archetype(t);
    TreeItems<R> const items = tree(w, t);
    out.center = items.vec3(items.at.com + 3 * body_root[body]);
    Spatial<R> frame = out.velocity;
    for (int p = ints[a.row_adr + last], end = ints[a.row_adr + last + 1]; p < end; ++p) {
      int const i = ints[a.row_col + p], j = ints[a.dof_jnt + i], k = i - ints[a.jnt_dofadr + j];
      bool const free = JointType(ints[a.jnt_type + j]) == JointType::free;
      if (k == 0 || (free && k == 3)) frame = out.velocity;
      Spatial<R> const axis = items.spatial(items.at.cdof + 6 * i);
      R const rate = items[items.at.qvel + i];
      if (!free || k > 2) out.drift = fma(rate, cross_motion(frame, axis), out.drift);
      out.velocity = fma(rate, axis, out.velocity);
    }
    if (carries && a.njnt == 1 && JointType(ints[a.jnt_type]) == JointType::free)  // drift_of(centre) = 0
      out.drift.linear = cross(out.velocity.linear, out.velocity.angular);
    return out;
  }
};

}  // namespace gsp::detail
