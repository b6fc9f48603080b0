#pragma once
#include <gsp/dynamics/detail/one_width.hpp>
#include <gsp/dynamics/stamps.hpp>
#include <gsp/math/pack.hpp>
#include <gsp/math/spatial.hpp>
#include <gsp/model/poses.hpp>
#include <gsp/model/state.hpp>

/// Scratch of the smooth dynamics: which items a tree has, and where they lie. A lane is one tree of one world; a block is as many lanes of
/// one archetype as a pack has numbers (CPU) or a warp has threads (GPU), and item i of its lanes lies together. What runs over lanes:
/// lanes.hpp.
namespace gsp {

inline constexpr int device_block = 32;  // lanes in a block on a GPU: a warp
/// Lanes in a block.
template <class Mem, class R>
inline constexpr int block_width = !bool(Kokkos::SpaceAccessibility<Kokkos::HostSpace, Mem>::accessible) ? device_block
                                   : Scalar<R>                                                           ? native_width<R>
                                                                                                         : 1;

namespace detail {
/// Lanes in a number, and what memory holds of one lane: a pack goes to and from plain numbers, all others are stored as they are.
template <class T>
struct width_of {
  static constexpr int value = 1;
  using stored = T;
};
template <class R, int W>
struct width_of<Pack<R, W>> {
  static constexpr int value = W;
  using stored = R;
};
/// The same pointer, as a number that a GPU's compiler keeps: it would else take the sum that it is apart, and find each item's address
/// anew in four instructions, where one or none will do.
template <class T>
KOKKOS_FORCEINLINE_FUNCTION T* whole(T* p) {
#ifdef __CUDA_ARCH__
  asm("" : "+l"(p));
  __builtin_assume(__isGlobal(p));
#endif
  return p;
}
}  // namespace detail

/// Items of one lane at base[i * stride], or of a whole block, one pack after the other (stride 1).
template <class T>
struct LaneItems {
  T* base;
  int stride;
  KOKKOS_INLINE_FUNCTION T& operator[](int i) const {
#ifdef __CUDA_ARCH__
    return base[i * device_block];  // known to the compiler, which folds it into addresses
#else
    if constexpr (detail::width_of<T>::value == 1)
      return base[std::int64_t(i) * stride];
    else
      return base[i];
#endif
  }
  KOKKOS_INLINE_FUNCTION Vec3<T> vec3(int i) const { return {(*this)[i], (*this)[i + 1], (*this)[i + 2]}; }
  KOKKOS_INLINE_FUNCTION Quat<T> quat(int i) const { return {(*this)[i], (*this)[i + 1], (*this)[i + 2], (*this)[i + 3]}; }
  KOKKOS_INLINE_FUNCTION Spatial<T> spatial(int i) const { return {vec3(i), vec3(i + 3)}; }
  KOKKOS_INLINE_FUNCTION SpatialInertia<T> inertia(int i) const {
    return {(*this)[i], (*this)[i + 1], (*this)[i + 2], (*this)[i + 3], (*this)[i + 4], (*this)[i + 5], vec3(i + 6), (*this)[i + 9]};
  }
  KOKKOS_INLINE_FUNCTION void put(int i, Vec3<T> const& v) const {
    (*this)[i] = v.x;
    (*this)[i + 1] = v.y;
    (*this)[i + 2] = v.z;
  }
  KOKKOS_INLINE_FUNCTION void put(int i, Quat<T> const& q) const {
    (*this)[i] = q.w;
    (*this)[i + 1] = q.x;
    (*this)[i + 2] = q.y;
    (*this)[i + 3] = q.z;
  }
  KOKKOS_INLINE_FUNCTION void put(int i, Spatial<T> const& s) const {
    put(i, s.angular);
    put(i + 3, s.linear);
  }
  KOKKOS_INLINE_FUNCTION void put(int i, SpatialInertia<T> const& s) const {
    (*this)[i] = s.xx;
    (*this)[i + 1] = s.yy;
    (*this)[i + 2] = s.zz;
    (*this)[i + 3] = s.xy;
    (*this)[i + 4] = s.xz;
    (*this)[i + 5] = s.yz;
    put(i + 6, s.center);
    (*this)[i + 9] = s.mass;
  }
};

namespace detail {
/// Whether d bias / d qvel is taken: profile stable where nothing damps, and implicit integrators.
KOKKOS_INLINE_FUNCTION bool takes_bias_derivative(Archetype const& a) { return a.gyroscopic || a.derivative == 2; }
}  // namespace detail

/// What every constraint row needs of a tree, and where it lies: first.
struct FactorLayout {
  int com, cdof, factor, inverse_diagonal, qvel, low, velocity;  // com: of each root's bodies; low: State::qpos_low as a motion of the
                                                                 // dofs; velocity: free, then new
  KOKKOS_INLINE_FUNCTION explicit FactorLayout(Archetype const& a)
      : com(0),
        cdof(3 * a.nroot),
        factor(cdof + 6 * a.nv),
        inverse_diagonal(factor + a.nM),
        qvel(inverse_diagonal + a.nv),
        low(qvel + a.nv),
        velocity(low + a.nv) {}
};

/// Where the dynamics of a tree keep their items: offsets for its archetype. First what the constraints and the integrator need, then other
/// results (vectors of dofs; force = passive - bias + actuator + applied; stiffness, damping: what the factored matrix takes implicitly),
/// then what is needed within one stage only.
struct DynamicsLayout : FactorLayout {
  int push, center, turning_inertia, act_dot;           // all but act_dot: of a tree that is one rigid body (detail/rigid_tree_lanes.hpp)
  int tendon_J, tendon_length, act_length, act_moment;  // tendon_J: of spatial tendons
  int act_share;                                        // of actuators on bodies: force on each contact (constraint/contact_adhesion.hpp)
  int act_row, tendon_row;  // what is left to rows (constraint/stiff_forces.hpp): (slope, intercept, lower, upper), (slope, intercept)
  int mass, derivative;     // derivative of the forces by velocity, lower triangle as M, then the upper (by rows of the transpose)
  int force, passive, actuator, bias, stiffness, damping, acceleration, impulse, gravcomp;
  int turning_bias;  // of a tree that carries its momentum: what `bias` is without, for those who read it
  int tendon_velocity, act_velocity, act_force, act_slope, act_law, energy;  // act_law: force before its limits, -d/d length, -d/d velocity
  int drag;                                                                  // what a fluid damps: -d force / d qvel, as M
  int xpos, xquat, xanchor, xaxis, cinert, cvel, cacc, cfrc, both_triangles, sigma, velocity_terms;
  int size;
  int dof_columns, body_columns, body_rates;  // of a device: what rows are made of (constraint/detail/whiten_trees.hpp), in the place of
                                              // what one stage alone needs, from xanchor on
  int device_size;
  KOKKOS_INLINE_FUNCTION explicit DynamicsLayout(Archetype const& a) : FactorLayout(a) {
    int n = velocity + a.nv;
    auto const reserve = [&n](int& at, int items) {
      at = n;
      n += items;
    };
    bool const may_be_rigid = a.njnt == 1;
    reserve(push, may_be_rigid ? 3 : 0);
    reserve(center, may_be_rigid ? 3 : 0);
    reserve(turning_inertia, may_be_rigid ? 6 : 0);
    reserve(act_dot, a.nstate);
    reserve(tendon_J, a.ntendonJ);
    reserve(tendon_length, a.ntendon);
    reserve(act_length, a.nact);
    if (a.adhesion) reserve(act_force, a.nact);
    reserve(act_share, a.adhesion ? a.nact : 0);
    reserve(act_moment, a.nmoment);
    reserve(act_row, a.stiff ? 4 * a.nact : 0);
    reserve(tendon_row, a.stiff ? 2 * a.ntendon : 0);
    reserve(mass, a.nM);
    bool const bias_derivative = detail::takes_bias_derivative(a);
    reserve(derivative, (bias_derivative ? 2 : a.derivative) * a.nM);
    reserve(force, a.nv);
    reserve(passive, a.nv);
    reserve(actuator, a.nv);
    reserve(bias, a.nv);
    reserve(stiffness, a.nv);
    reserve(damping, a.nv);
    reserve(acceleration, a.nv);
    reserve(impulse, a.nv);
    reserve(gravcomp, a.gravcomp ? a.nv : 0);
    reserve(turning_bias, may_be_rigid ? a.nv : 0);
    reserve(tendon_velocity, a.ntendon);
    reserve(act_velocity, a.nact);
    if (!a.adhesion) reserve(act_force, a.nact);
    reserve(act_slope, a.derivative ? a.nact : 0);
    reserve(act_law, a.stiff ? 3 * a.nact : 0);
    reserve(energy, 2);
    reserve(drag, a.drag ? a.nM : 0);
    reserve(xpos, 3 * a.nbody);
    reserve(xquat, 4 * a.nbody);
    reserve(xanchor, 3 * a.njnt);
    reserve(xaxis, 3 * a.njnt);
    reserve(cinert, 10 * a.nbody);
    reserve(cvel, 6 * a.nbody);
    reserve(cacc, 6 * a.nbody);
    reserve(cfrc, 6 * a.nbody);
    reserve(both_triangles, a.gyroscopic ? 2 * a.nM + a.nv : 0);
    reserve(sigma, bias_derivative ? 6 * a.nv : 0);
    reserve(velocity_terms, bias_derivative ? 12 * a.nbody : 0);
    size = n;
    dof_columns = xanchor;
    body_columns = dof_columns + a.nM;
    body_rates = body_columns + 6 * a.nM;
    device_size = n > body_rates + 18 * a.nv ? n : body_rates + 18 * a.nv;
  }
};

/// One tree of one world, for kernels that go world by world (constraints): its items in the blocked scratch.
template <class R>
struct TreeItems : LaneItems<R> {
  DynamicsLayout at;
};

/// The first of them.
template <class R>
struct FactorItems : LaneItems<R> {
  FactorLayout at;
};

/// Scratch of the smooth dynamics, blocked by lanes, and the table of its blocks. `make_dynamics` allocates it.
template <class R, class Mem>
struct Dynamics {
  using real_type = R;
  using memory_space = Mem;
  static constexpr int width = block_width<Mem, R>;
  int worlds = 0, blocks = 0;
  int padded_worlds = 0;  // lane = instance * padded_worlds + world: a block holds one instance wherever there are enough worlds
  Kokkos::View<R*, Mem> items;
  Kokkos::View<R*, Mem> thread_items;  // hosts: room for one block a thread, where a fused stage works in cache
  int thread_stride = 0, thread_rooms = 0;
  Kokkos::View<int*, Mem> block_archetype;                 // (blocks)
  Kokkos::View<std::int64_t*, Mem> block_offset;           // (blocks) first item of the block
  Kokkos::View<int*, Mem> archetype_block;                 // (archetypes) first block
  Kokkos::View<DynamicsLayout*, Mem> layouts;              // (archetypes)
  Kokkos::View<std::int64_t*, Mem> left_step;              // (worlds) the last step (State::steps) that left forces to rows
  Kokkos::View<Archetype*, Kokkos::HostSpace> archetypes;  // host: the model's when it was made, which decided the layout
  detail::Stamps stamps;                                   // host: what the items hold, and of which state (stamps.hpp)

  KOKKOS_INLINE_FUNCTION R& item(Model<R, Mem> const& m, int w, int t, int at) const {
    int const k = m.tree_archetype(t), lane = m.tree_instance(t) * padded_worlds + w;
    return items(block_offset(archetype_block(k) + lane / width) + lane % width + std::int64_t(at) * width);
  }
  /// Items of tree `t` of world `w`.
  KOKKOS_INLINE_FUNCTION TreeItems<R> tree(Model<R, Mem> const& m, int w, int t) const {
    return {lane_items(m, w, t), layouts(m.tree_archetype(t))};
  }
  KOKKOS_INLINE_FUNCTION FactorItems<R> factored(Model<R, Mem> const& m, int w, int t) const {
    return {lane_items(m, w, t), layouts(m.tree_archetype(t))};
  }

 private:
  KOKKOS_INLINE_FUNCTION LaneItems<R> lane_items(Model<R, Mem> const& m, int w, int t) const {
    int const lane = m.tree_instance(t) * padded_worlds + w, block = archetype_block(m.tree_archetype(t)) + lane / width;
    return {detail::whole(items.data() + block_offset(block) + lane % width), width};
  }
};

struct DynamicsOptions {
  int worlds = 1;
};

/// Scratch for the dynamics of `worlds` worlds: 35 numbers a body, 18 a dof (19 in trees of one joint), 6 a joint and two mass matrices;
/// 12, 7 and four more in trees with a joint that nothing damps; 7 an actuator and 2 a tendon where there may be stiff rows, and a mass
/// matrix in a fluid (profile stable). Allocates; fences. Errors: std::invalid_argument for worlds < 1, and for more than the model has
/// values for.
template <class R, ExecutionSpace Exec, class Mem>
Dynamics<R, Mem> make_dynamics(Exec const& exec, Model<R, Mem> const& model, DynamicsOptions options = {});

}  // namespace gsp

#include <gsp/dynamics/detail/dynamics_impl.hpp>
