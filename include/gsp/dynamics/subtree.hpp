#pragma once
#include <gsp/core/region.hpp>
#include <gsp/dynamics/world_lanes.hpp>

/// Centre of mass, velocity and angular momentum of every body's subtree (MuJoCo's mj_comPos, mj_subtreeVel).
namespace gsp {

template <class R, class Mem>
struct Subtrees {
  template <class D>
  using View = Kokkos::View<D, Kokkos::LayoutRight, Mem>;
  View<R**> mass;                                 // (world, body) [kg]; body 0: all
  View<R***> com;                                 // (world, body, 3) [m]
  View<R***> linvel;                              // (world, body, 3) [m/s] of the centre of mass
  View<R***> angmom;                              // (world, body, 3) [kg m^2/s] about it
  detail::SharedStamp<detail::Stamp> stamp = {};  // host: of which state mass and com are; empty, or not set: taken as they are
};

struct SubtreesOptions {
  int worlds = 1;
};

/// Buffers for `worlds` worlds. Allocates.
template <class R, ExecutionSpace Exec, class Mem>
Subtrees<R, Mem> make_subtrees(Exec const& exec, Model<R, Mem> const& model, SubtreesOptions options = {}) {
  expects(options.worlds > 0, "gsp::make_subtrees: worlds must be positive and is " + std::to_string(options.worlds));
  using S = Subtrees<R, Mem>;
  auto const view = [&](char const* label) {
    return detail::allocate_zero<typename S::template View<R***>>(exec, label, options.worlds, model.nbody, 3);
  };
  return {detail::allocate_zero<typename S::template View<R**>>(exec, "gsp::Subtrees::mass", options.worlds, model.nbody),
          view("gsp::Subtrees::com"), view("gsp::Subtrees::linvel"), view("gsp::Subtrees::angmom"),
          detail::make_stamp<detail::Stamp>("gsp::Subtrees::stamp")};
}

namespace detail {
template <class R, class Mem>
struct SubtreeCom {
  Model<R, Mem> model;
  Poses<R, Mem> poses;
  Subtrees<R, Mem> s;
  template <class T>
  KOKKOS_INLINE_FUNCTION Vec3<T> center(WorldLane<T> const& l, int b) const {
    return l.load3(poses.xpos, b) + rotate(l.load4(poses.xquat, b), l.constant3(model.body_ipos, b));
  }
  template <class T>
  KOKKOS_FUNCTION void operator()(WorldLane<T> const& l, int) const {
    for (int b = 0; b < model.nbody; ++b) {
      T const mass = l.constant(model.body_mass, b);
      l.store(s.mass, b, mass);
      l.store3(s.com, b, mass * center(l, b));
    }
    for (int b = model.nbody - 1; b >= 0; --b) {
      T const mass = l.load(s.mass, b);
      Vec3<T> const sum = l.load3(s.com, b);
      if (b > 0) {
        int const parent = model.body_parent(b);
        l.store(s.mass, parent, l.load(s.mass, parent) + mass);
        l.store3(s.com, parent, l.load3(s.com, parent) + sum);
      }
      l.store3(s.com, b, select(mass < T(1e-15), center(l, b), (T(1) / max(mass, T(1e-15))) * sum));
    }
  }
};

/// linvel and angmom hold each body's spatial velocity, then its own momentum, then those of the subtree.
template <class R, class Mem>
struct SubtreeMomentum {
  Model<R, Mem> model;
  Poses<R, Mem> poses;
  Dynamics<R, Mem> dynamics;
  Subtrees<R, Mem> s;
  template <class T>
  KOKKOS_FUNCTION void operator()(WorldLane<T> const& l, int) const {
    auto const& ints = model.ints;
    Vec3<T> const zero{T(0), T(0), T(0)};
    for (int b = 0; b < model.nbody; ++b) {
      int const t = model.body_tree(b);
      Vec3<T> w = zero, v = zero;
      if (t >= 0) {
        Archetype const& a = model.archetypes(model.tree_archetype(t));
        DynamicsLayout const at(a);
        auto const item = [&](int i) { return l.item(model, dynamics, t, i); };
        int const parent = model.body_parent(b), local = b - model.tree_body(t);
        if (model.body_tree(parent) == t) {
          w = l.load3(s.angmom, parent);
          v = l.load3(s.linvel, parent);
        }
        int const d0 = ints(a.body_dofadr + local);
        for (int i = d0, end = d0 + ints(a.body_dofnum + local); i < end; ++i) {
          T const qdot = item(at.qvel + i);
          int const c = at.cdof + 6 * i;
          w = fma(qdot, Vec3<T>{item(c), item(c + 1), item(c + 2)}, w);
          v = fma(qdot, Vec3<T>{item(c + 3), item(c + 4), item(c + 5)}, v);
        }
      }
      l.store3(s.angmom, b, w);
      l.store3(s.linvel, b, v);
    }
    for (int b = 0; b < model.nbody; ++b) {
      int const t = model.body_tree(b);
      if (t < 0) continue;
      DynamicsLayout const at(model.archetypes(model.tree_archetype(t)));
      int const c = at.com + 3 * model.body_root(b);
      auto const item = [&](int i) { return l.item(model, dynamics, t, i); };
      Quat<T> const q = l.load4(poses.xquat, b), iq = q * l.constant4(model.body_iquat, b);
      Vec3<T> const center = l.load3(poses.xpos, b) + rotate(q, l.constant3(model.body_ipos, b)), w = l.load3(s.angmom, b);
      Vec3<T> const v = l.load3(s.linvel, b) + cross(w, center - Vec3<T>{item(c), item(c + 1), item(c + 2)});
      Vec3<T> const p = l.constant(model.body_mass, b) * v, inertia = l.constant3(model.body_inertia, b), own = rotate_inverse(iq, w);
      l.store3(s.linvel, b, p);
      l.store3(s.angmom, b,
               rotate(iq, Vec3<T>{inertia.x * own.x, inertia.y * own.y, inertia.z * own.z}) + cross(center - l.load3(s.com, b), p));
    }
    for (int b = model.nbody - 1; b >= 0; --b) {
      Vec3<T> const p = l.load3(s.linvel, b);
      if (b > 0) {
        int const parent = model.body_parent(b);
        l.store3(s.linvel, parent, l.load3(s.linvel, parent) + p);
        l.store3(s.angmom, parent, l.load3(s.angmom, parent) + l.load3(s.angmom, b) + cross(l.load3(s.com, b) - l.load3(s.com, parent), p));
      }
      l.store3(s.linvel, b, (T(1) / max(l.load(s.mass, b), T(1e-15))) * p);
    }
  }
};
}  // namespace detail

/// Mass and centre of mass of every body's subtree (s.mass, s.com), of these poses. After forward_kinematics. Cost about 50 flop a body.
/// Does not allocate, does not fence. Errors: std::invalid_argument for poses and subtrees of other sizes.
template <ExecutionSpace Exec, class R, class Mem>
void subtree_com(Exec const& exec, Model<R, Mem> const& model, Poses<R, Mem> const& poses, Subtrees<R, Mem>& s) {
  Region const region("gsp::dynamics::subtree_com");
  int const worlds = int(s.com.extent(0));
  detail::expects_fit("gsp::subtree_com", model, poses, worlds);
  detail::expects_rows("gsp::subtree_com", "subtrees.com", s.com, worlds, model.nbody);
  if (s.stamp.data()) s.stamp() = poses.stamp.data() ? poses.stamp().bodies : detail::Stamp{};
  for_world_lanes<R>("gsp::dynamics::subtree_com", exec, worlds, 1, detail::SubtreeCom<R, Mem>{model, poses, s});
}
/// Velocity of the centre of mass and angular momentum about it, of every body's subtree (s.linvel, s.angmom). After subtree_com and
/// smooth_dynamics (or mass_matrix and bias_forces). Cost about 150 flop a body. Does not allocate, does not fence. Errors:
/// std::invalid_argument where the dynamics do not hold motions and velocities of one state, or those of the state before its last step, or
/// the poses or the centres of mass are of another moment.
template <ExecutionSpace Exec, class R, class Mem>
void subtree_momentum(Exec const& exec, Model<R, Mem> const& model, Poses<R, Mem> const& poses, Dynamics<R, Mem> const& dynamics,
                      Subtrees<R, Mem>& s) {
  Region const region("gsp::dynamics::subtree_momentum");
  detail::expects_fit("gsp::subtree_momentum", model, dynamics, poses);
  detail::expects_together("gsp::subtree_momentum", dynamics, detail::set_of(Quantity::motion, Quantity::velocity));
  detail::expects_poses_with("gsp::subtree_momentum", poses, dynamics);
  detail::expects_rows("gsp::subtree_momentum", "subtrees.com", s.com, dynamics.worlds, model.nbody);
  if (detail::is_stamped(poses) && s.stamp.data() && !s.stamp().is_same(poses.stamp().bodies))
    throw std::invalid_argument(
        "gsp::subtree_momentum: the centres of mass have not been computed of these poses: call subtree_com with them first");
  for_world_lanes<R>("gsp::dynamics::subtree_momentum", exec, dynamics.worlds, 1,
                     detail::SubtreeMomentum<R, Mem>{model, poses, dynamics, s});
}

}  // namespace gsp
