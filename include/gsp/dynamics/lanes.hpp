#pragma once
#include <gsp/dynamics/detail/one_width.hpp>
#include <gsp/dynamics/stamps.hpp>
#include <gsp/math/pack.hpp>
#include <gsp/math/spatial.hpp>
#include <gsp/model/poses.hpp>
#include <gsp/model/state.hpp>
#include <utility>
namespace gsp::detail {
/// kernel.run<Workers>(lane, nullptr, worker) for all lanes of all blocks on a GPU, `Lanes` to a block; registers for `Blocks` of them at a
/// time on a multiprocessor.
template <int Workers, int Lanes, int Blocks, class Exec, class Kernel>
void launch_lanes(char const* label, Exec const& exec, int blocks, Kernel const& kernel);
}  // namespace gsp::detail
#if defined(KOKKOS_ENABLE_CUDA) && defined(__CUDACC__)
#include <gsp/dynamics/detail/lanes_cuda.hpp>
#endif

/// Lanes: one tree of one world each. All lanes of an archetype run the same branch-free program; only numbers differ. On a CPU the number
/// type is a `Pack` and a block of W lanes goes through the program together; on a GPU a lane is a thread, and a block is a warp.
namespace gsp {

inline constexpr int device_block = 32;            // lanes in a block on a GPU: a warp
inline constexpr int device_workers = tree_parts;  // warps that share the work of a block on a GPU, in the stages that are written for it
/// Lanes in a block, and the number type that a kernel on `Exec` computes with.
template <class Mem, class R>
inline constexpr int block_width = !bool(Kokkos::SpaceAccessibility<Kokkos::HostSpace, Mem>::accessible) ? device_block
                                   : Scalar<R>                                                           ? native_width<R>
                                                                                                         : 1;
template <class Exec, class R>
using lane_number = std::conditional_t<is_device<Exec> || !Scalar<R>, R, Pack<R, native_width<R>>>;

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
template <class T>
KOKKOS_INLINE_FUNCTION T get_lane(T const& x, int) {
  return x;
}
template <class R, int W>
KOKKOS_INLINE_FUNCTION R get_lane(Pack<R, W> const& x, int i) {
  return x[i];
}

// Packs from and to plain memory. Not inlined: they are called often, and are loops.
// Lane i at data[world[i] * stride + first[i] * components + offset]:
template <class T>
[[gnu::noinline]] KOKKOS_FUNCTION T gather(real_t<T> const* data, std::int64_t stride, int const* world, int const* first, int components,
                                           int offset) {
  alignas(T) real_t<T> x[T::width];
  for (int i = 0; i < T::width; ++i) x[i] = data[world[i] * stride + first[i] * components + offset];
  return *reinterpret_cast<T const*>(x);
}
template <class T>
[[gnu::noinline]] KOKKOS_FUNCTION void scatter(real_t<T>* data, std::int64_t stride, int const* world, int const* first, int components,
                                               int offset, T const& x, int count) {
  for (int i = 0; i < count; ++i) data[world[i] * stride + first[i] * components + offset] = x[i];
}
// Lane i at data[i * stride], where a block is one instance in consecutive worlds:
template <class T>
[[gnu::noinline]] KOKKOS_FUNCTION T gather_consecutive(real_t<T> const* data, std::int64_t stride) {
  alignas(T) real_t<T> x[T::width];
  for (int i = 0; i < T::width; ++i, data += stride) x[i] = *data;
  return *reinterpret_cast<T const*>(x);
}
template <class T>
[[gnu::noinline]] KOKKOS_FUNCTION void scatter_consecutive(real_t<T>* data, std::int64_t stride, T const& x) {
  alignas(T) real_t<T> values[T::width];
  *reinterpret_cast<T*>(values) = x;
  for (int i = 0; i < T::width; ++i, data += stride) *data = values[i];
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

/// Where the dynamics of a tree keep their items: offsets for its archetype. First what the constraints and the integrator need, then other
/// results (vectors of dofs; force = passive - bias + actuator + applied; stiffness, damping: what the factored matrix takes implicitly;
/// velocity: free, then new), then what is needed within one stage only.
struct DynamicsLayout {
  int com, cdof, factor, inverse_diagonal, qvel, velocity, spin,
      act_dot;                              // com: of each root's bodies; spin: of a free body, see factor.hpp
  int tendon_J, tendon_length, act_length;  // tendon_J: of spatial tendons
  int mass, derivative;  // derivative of the forces by velocity, lower triangle as M, then the upper (by rows of the transpose)
  int force, passive, actuator, bias, stiffness, damping, acceleration, impulse, gravcomp;
  int tendon_velocity, act_velocity, act_force, act_slope, act_moment, energy;
  int xpos, xquat, xanchor, xaxis, cinert, cvel, cacc, cfrc, dvel, dacc;
  int size;
  KOKKOS_INLINE_FUNCTION explicit DynamicsLayout(Archetype const& a) {
    int n = 0;
    auto const reserve = [&n](int& at, int items) {
      at = n;
      n += items;
    };
    reserve(com, 3 * a.nroot);
    reserve(cdof, 6 * a.nv);
    reserve(factor, a.nM);
    reserve(inverse_diagonal, a.nv);
    reserve(qvel, a.nv);
    reserve(velocity, a.nv);
    reserve(spin, 3);
    reserve(act_dot, a.nstate);
    reserve(tendon_J, a.ntendonJ);
    reserve(tendon_length, a.ntendon);
    reserve(act_length, a.nact);
    reserve(mass, a.nM);
    reserve(derivative, a.derivative * a.nM);
    reserve(force, a.nv);
    reserve(passive, a.nv);
    reserve(actuator, a.nv);
    reserve(bias, a.nv);
    reserve(stiffness, a.nv);
    reserve(damping, a.nv);
    reserve(acceleration, a.nv);
    reserve(impulse, a.nv);
    reserve(gravcomp, a.gravcomp ? a.nv : 0);
    reserve(tendon_velocity, a.ntendon);
    reserve(act_velocity, a.nact);
    reserve(act_force, a.nact);
    reserve(act_slope, a.derivative ? a.nact : 0);
    reserve(act_moment, a.nmoment);
    reserve(energy, 2);
    reserve(xpos, 3 * a.nbody);
    reserve(xquat, 4 * a.nbody);
    reserve(xanchor, 3 * a.njnt);
    reserve(xaxis, 3 * a.njnt);
    reserve(cinert, 10 * a.nbody);
    reserve(cvel, 6 * a.nbody);
    reserve(cacc, 6 * a.nbody);
    reserve(cfrc, 6 * a.nbody);
    reserve(dvel, a.derivative == 2 ? 6 * a.nbody : 0);
    reserve(dacc, a.derivative == 2 ? 6 * a.nbody : 0);
    size = n;
  }
};

/// One tree of one world, for kernels that go world by world (constraints): its items in the blocked scratch.
template <class R>
struct TreeItems : LaneItems<R> {
  DynamicsLayout at;
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
  int thread_stride = 0;
  Kokkos::View<int*, Mem> block_archetype;                 // (blocks)
  Kokkos::View<std::int64_t*, Mem> block_offset;           // (blocks) first item of the block
  Kokkos::View<int*, Mem> archetype_block;                 // (archetypes) first block
  Kokkos::View<Archetype*, Kokkos::HostSpace> archetypes;  // host: the model's when it was made, which decided the layout
  detail::Stamps stamps;                                   // host: what the items hold, and of which state (stamps.hpp)

  KOKKOS_INLINE_FUNCTION R& item(Model<R, Mem> const& m, int w, int t, int at) const {
    int const k = m.tree_archetype(t), lane = m.tree_instance(t) * padded_worlds + w;
    return items(block_offset(archetype_block(k) + lane / width) + lane % width + std::int64_t(at) * width);
  }
  /// Items of tree `t` of world `w`.
  KOKKOS_INLINE_FUNCTION TreeItems<R> tree(Model<R, Mem> const& m, int w, int t) const {
    int const k = m.tree_archetype(t), lane = m.tree_instance(t) * padded_worlds + w;
    int const block = archetype_block(k) + lane / width;
    return {{items.data() + block_offset(block) + lane % width, width}, DynamicsLayout(m.archetypes(k))};
  }
};

struct DynamicsOptions {
  int worlds = 1;
};

/// Scratch for the dynamics of `worlds` worlds: 35 numbers a body, 17 a dof, 6 a joint and two mass matrices. Allocates.
template <class R, ExecutionSpace Exec, class Mem>
Dynamics<R, Mem> make_dynamics(Exec const& exec, Model<R, Mem> const& model, DynamicsOptions options = {}) {
  static_assert(can_access<Exec, Kokkos::View<R*, Mem>>, "gsp::make_dynamics: the model is not accessible from this execution space");
  expects(options.worlds > 0, "gsp::make_dynamics: worlds must be positive");
  detail::expects_values("gsp::make_dynamics", model, options.worlds);
  Dynamics<R, Mem> d;
  constexpr int W = Dynamics<R, Mem>::width;
  d.worlds = options.worlds;
  d.archetypes = model.host_archetypes;
  d.stamps = detail::make_stamps();
  d.padded_worlds = d.worlds < W ? d.worlds : (d.worlds + W - 1) / W * W;
  std::vector<int> archetype, first;
  std::vector<std::int64_t> offset;
  std::int64_t size = 0;
  for (int k = 0; k < model.narchetype; ++k) {
    Archetype const& a = model.host_archetypes(k);
    int const blocks = int((std::int64_t(a.ninstance) * d.padded_worlds + W - 1) / W);
    first.push_back(int(archetype.size()));
    for (int b = 0; b < blocks; ++b) {
      archetype.push_back(k);
      offset.push_back(size);
      size += std::int64_t(DynamicsLayout(a).size) * W;
    }
  }
  d.blocks = int(archetype.size());
  if constexpr (!is_device<Exec>) {
    int most = 0;
    for (int k = 0; k < model.narchetype; ++k) most = std::max(most, DynamicsLayout(model.host_archetypes(k)).size);
    d.thread_stride = most * W;
    d.thread_items = detail::allocate_zero<Kokkos::View<R*, Mem>>(
        exec, "gsp::Dynamics::thread_items", std::size_t(d.thread_stride) * Kokkos::DefaultHostExecutionSpace().concurrency());
  }
  d.items = detail::allocate_zero<Kokkos::View<R*, Mem>>(exec, "gsp::Dynamics::items", size);
  d.block_archetype = detail::to_device<Kokkos::View<int*, Mem>>(exec, "gsp::Dynamics::block_archetype", archetype);
  d.block_offset = detail::to_device<Kokkos::View<std::int64_t*, Mem>>(exec, "gsp::Dynamics::block_offset", offset);
  d.archetype_block = detail::to_device<Kokkos::View<int*, Mem>>(exec, "gsp::Dynamics::archetype_block", first);
  return d;
}

namespace detail {
/// True where want(archetype) for any of the model's.
template <class R, class Mem, class Want>
bool any_archetype(Model<R, Mem> const& model, Want const& want) {
  for (int k = 0; k < model.narchetype; ++k)
    if (want(model.host_archetypes(k))) return true;
  return false;
}
// What meets in a call belongs together. Host integers alone: no allocation, no launch, no wait.

/// The dynamics have the layout that the model asks for, and the model values for all of their worlds.
template <class R, class Mem>
void expects_fit(char const* where, Model<R, Mem> const& model, Dynamics<R, Mem> const& dynamics) {
  expects_values(where, model, dynamics.worlds);
  if (dynamics.archetypes.data() == model.host_archetypes.data()) return;
  bool fits = int(dynamics.archetypes.extent(0)) == model.narchetype;
  for (int k = 0; k < model.narchetype && fits; ++k) {
    Archetype const& then = dynamics.archetypes(k);
    Archetype const& now = model.host_archetypes(k);
    fits = then.ninstance == now.ninstance && DynamicsLayout(then).size == DynamicsLayout(now).size;
  }
  if (!fits)
    throw std::invalid_argument(std::string(where) +
                                ": the dynamics were made for another model, or before make_per_world gave this one more terms: call "
                                "make_dynamics (or make_simulation) after make_per_world");
}
template <class R, class Mem>
void expects_fit(char const* where, Model<R, Mem> const& model, Poses<R, Mem> const& poses, int worlds) {
  expects_values(where, model, worlds);
  auto const fits = [&](auto const& view, int items, char const* name) {
    if (int(view.extent(1)) == items && (items == 0 || int(view.extent(0)) == worlds)) return;
    throw std::invalid_argument(std::string(where) + ": poses." + name + " are (" + std::to_string(view.extent(0)) + ", " +
                                std::to_string(view.extent(1)) + "), and the model and the worlds ask for (" + std::to_string(worlds) +
                                ", " + std::to_string(items) + "): call make_poses with this model and as many worlds");
  };
  fits(poses.xpos, model.nbody, "xpos");
  fits(poses.xquat, model.nbody, "xquat");
  fits(poses.xanchor, model.njnt, "xanchor");
  fits(poses.xaxis, model.njnt, "xaxis");
}
template <class R, class Mem>
void expects_fit(char const* where, Model<R, Mem> const& model, Dynamics<R, Mem> const& dynamics, Poses<R, Mem> const& poses) {
  expects_fit(where, model, dynamics);
  expects_fit(where, model, poses, dynamics.worlds);
}
template <class R, class Mem>
void expects_fit(char const* where, Model<R, Mem> const& model, State<R, Mem> const& state, Dynamics<R, Mem> const& dynamics) {
  if (state.worlds != dynamics.worlds)
    throw std::invalid_argument(std::string(where) + ": the state has " + std::to_string(state.worlds) + " worlds and the dynamics " +
                                std::to_string(dynamics.worlds) + ": make both for the same number");
  expects_fit(where, model, state);
  expects_fit(where, model, dynamics);
}
template <class R, class Mem>
void expects_fit(char const* where, Model<R, Mem> const& model, State<R, Mem> const& state, Dynamics<R, Mem> const& dynamics,
                 Poses<R, Mem> const& poses) {
  expects_fit(where, model, state, dynamics);
  expects_fit(where, model, poses, dynamics.worlds);
}
/// Buffers (world, items) that a call takes besides.
template <class View>
void expects_rows(char const* where, char const* what, View const& view, int worlds, int items) {
  if (int(view.extent(1)) == items && (items == 0 || int(view.extent(0)) == worlds)) return;
  throw std::invalid_argument(std::string(where) + ": " + what + " is (" + std::to_string(view.extent(0)) + ", " +
                              std::to_string(view.extent(1)) + ") and must be (" + std::to_string(worlds) + ", " + std::to_string(items) +
                              ")");
}

/// put(i, get(i)) for i < n. On a GPU eight at a time: the compiler cannot know that what is put is not what is got next, and a thread
/// would wait for memory item by item.
template <class Get, class Put>
KOKKOS_FORCEINLINE_FUNCTION void each_batched(int n, Get const& get, Put const& put) {
#ifdef __CUDA_ARCH__
  constexpr int batch = 8;
  for (int i = 0; i < n; i += batch) {
    decltype(get(0)) v[batch];
#pragma unroll
    for (int k = 0; k < batch; ++k)
      if (i + k < n) v[k] = get(i + k);
#pragma unroll
    for (int k = 0; k < batch; ++k)
      if (i + k < n) put(i + k, v[k]);
  }
#else
  for (int i = 0; i < n; ++i) put(i, get(i));
#endif
}
template <class L, class F>
[[gnu::noinline]] KOKKOS_FUNCTION void out_of_line(L const& l, F const& f) {
  f(l);
}
}  // namespace detail

/// Items `at` .. at + n of every lane of a block to its world's row of a plain view (world, ...), from `first` on, where want(world): 16 at
/// a time through shared memory, so that neighbouring threads write neighbouring numbers. False where lanes store one by one: on hosts,
/// in blocks that hold several instances, in stages of one worker, and of duals, which would fill shared memory.
template <class L, class View, class Want>
KOKKOS_FORCEINLINE_FUNCTION bool store_block([[maybe_unused]] L const& l, [[maybe_unused]] int at, [[maybe_unused]] int n,
                                             [[maybe_unused]] View const& out, [[maybe_unused]] int first,
                                             [[maybe_unused]] Want const& want) {
#ifdef __CUDA_ARCH__
  using T = std::remove_cvref_t<decltype(l.items[0])>;
  if constexpr (L::workers > 1 && sizeof(T) <= 8) {
    if (l.block_world < 0) return false;
    constexpr int chunk = 16;
    __shared__ T tiles[L::workers][chunk][device_block + 1];
    auto& tile = tiles[l.worker];
    std::int64_t const stride = std::int64_t(out.extent(1)) * out.extent(2);
    int const thread = int(threadIdx.x) % device_block, world = l.block_world + thread / chunk, e = thread % chunk;
    for (int begin = l.worker * chunk; begin < n; begin += L::workers * chunk) {
      int const count = n - begin < chunk ? n - begin : chunk;
#pragma unroll
      for (int k = 0; k < chunk; ++k)
        if (k < count) tile[k][thread] = l.items[at + begin + k];
      __syncwarp();
      for (int w = 0; w < device_block; w += device_block / chunk)
        if (world + w < l.worlds && e < count && want(world + w))
          out.data()[(world + w) * stride + first + begin + e] = tile[e][thread / chunk + w];
      __syncwarp();
    }
    return true;
  }
#endif
  return false;
}

/// What a stage sees: one lane (GPU) or a block of lanes (CPU), its topology, constants, and items. On a GPU several workers, threads of
/// different warps, may share a lane: each runs the stage, takes its part of every loop that goes through `each`, `each_batched`, `down` or
/// `up`, and waits there for the others. What stands outside of these is done by every worker, so it must not change what others read.
template <class T, class Mem, int Workers = 1>
struct Lane {
  using R = typename detail::width_of<T>::stored;
  static constexpr int workers = Workers;
  static constexpr int W = detail::width_of<T>::value;
  Model<R, Mem> const& model;
  Archetype const& a;
  int const* ints;  // topology: ints[a.body_parent + b] ...
  LaneItems<T> items;
  DynamicsLayout at;
  bool uniform = true;  // all lanes are the same instance (of different worlds)
  int count = W;        // lanes below it are worlds of their own; the rest repeat the last one and store nothing
  int world[W], body0[W], jnt0[W], dof0[W], qpos0[W], instance[W];
  int worker = 0;
  int worlds = 0, block_world = -1;  // GPU: first world of the block, whose lanes are worlds that follow each other; -1: they do not

  KOKKOS_FORCEINLINE_FUNCTION Lane(Model<R, Mem> const& model_, Archetype const& a_, LaneItems<T> items_, int first_lane, int padded_worlds,
                                   int worlds_, int worker_ = 0)
      : model(model_), a(a_), ints(model_.ints.data()), items(items_), at(a_), worker(worker_), worlds(worlds_) {
    if (W == 1 && padded_worlds >= device_block) block_world = first_lane / device_block * device_block % padded_worlds;
    int const lanes = a.ninstance * padded_worlds;
    count = 0;
    for (int i = 0; i < W; ++i) {
      int lane = first_lane + i < lanes ? first_lane + i : lanes - 1;
      int const own = lane % padded_worlds < worlds;
      instance[i] = lane / padded_worlds;
      world[i] = own ? lane % padded_worlds : worlds - 1;
      if (first_lane + i < lanes && own) count = i + 1;
      uniform &= instance[i] == instance[0];
      body0[i] = ints[a.instance_body + instance[i]];
      jnt0[i] = ints[a.instance_jnt + instance[i]];
      dof0[i] = ints[a.instance_dof + instance[i]];
      qpos0[i] = ints[a.instance_qpos + instance[i]];
    }
  }
  /// The same lane for one worker.
  template <int N>
  KOKKOS_FORCEINLINE_FUNCTION explicit Lane(Lane<T, Mem, N> const& l)
      : model(l.model), a(l.a), ints(l.ints), items(l.items), at(l.at), uniform(l.uniform), count(l.count) {
    for (int i = 0; i < W; ++i) {
      world[i] = l.world[i];
      body0[i] = l.body0[i];
      jnt0[i] = l.jnt0[i];
      dof0[i] = l.dof0[i];
      qpos0[i] = l.qpos0[i];
      instance[i] = l.instance[i];
    }
  }
  KOKKOS_FORCEINLINE_FUNCTION int index(int array, int i) const { return ints[array + i]; }

  /// What all workers have written so far can be read by all of them after it.
  KOKKOS_FORCEINLINE_FUNCTION void sync() const {
#ifdef __CUDA_ARCH__
    if constexpr (Workers > 1) __syncthreads();
#endif
  }
  /// f(i) for i < n, in no order.
  template <class F>
  KOKKOS_FORCEINLINE_FUNCTION void each(int n, F const& f) const {
    for (int i = worker; i < n; i += Workers) f(i);
    sync();
  }
  /// put(i, get(i)) for i < n, in no order; neither may read what another i puts.
  template <class Get, class Put>
  KOKKOS_FORCEINLINE_FUNCTION void each_batched(int n, Get const& get, Put const& put) const {
    detail::each_batched((n - worker + Workers - 1) / Workers, [&](int k) { return get(worker + k * Workers); },
                         [&](int k, auto const& v) { put(worker + k * Workers, v); });
    sync();
  }
  /// f(body), parents before their children: f reads what its parent has and writes what is the body's own.
  template <class F>
  KOKKOS_FORCEINLINE_FUNCTION void down(F const& f) const {
    if constexpr (Workers == 1) {
      for (int b = 0; b < a.nbody; ++b) f(b);
    } else {
      static_assert(Workers == tree_parts);
      for (int own = 0; own < 2; ++own) {  // the trunk, then the limbs
        int const part = own ? 1 + worker : worker == 0 ? 0 : -1;
        for (int k = part < 0 ? 0 : index(a.part_adr, part), end = part < 0 ? 0 : index(a.part_adr, part + 1); k < end; ++k)
          f(index(a.part_body, k));
        sync();
      }
    }
  }
  /// f(body), children before their parents: f reads what its descendants have and writes what is the body's own.
  template <class F>
  KOKKOS_FORCEINLINE_FUNCTION void up(F const& f) const {
    if constexpr (Workers == 1) {
      for (int b = a.nbody - 1; b >= 0; --b) f(b);
    } else {
      for (int own = 1; own >= 0; --own) {
        int const part = own ? 1 + worker : worker == 0 ? 0 : -1;
        for (int k = part < 0 ? -1 : index(a.part_adr, part + 1) - 1, first = part < 0 ? 0 : index(a.part_adr, part); k >= first; --k)
          f(index(a.part_body, k));
        sync();
      }
    }
  }
  /// f(child) for all children of b, the last one first.
  template <class F>
  KOKKOS_FORCEINLINE_FUNCTION void children(int b, F const& f) const {
    for (int c = index(a.body_child, b); c >= 0; c = index(a.body_sibling, c)) f(c);
  }
  /// f(lane), by one worker: what few models have. On a GPU out of line, so that what a model lacks costs nothing: f gets a copy of the
  /// lane, which else would have to stand in memory.
  template <class F>
  KOKKOS_FORCEINLINE_FUNCTION void single(F const& f) const {
#ifdef __CUDA_ARCH__
    if (worker == 0) detail::out_of_line(Lane<T, Mem>(*this), f);
    sync();
#else
    f(*this);
#endif
  }

  /// Constant `component` of item `i` (counted from `first` of each lane): one broadcast where all lanes share it, else a gather.
  KOKKOS_FORCEINLINE_FUNCTION T constant(Field<R> const& f, int const* first, int i, int components = 1, int component = 0) const {
    if constexpr (W == 1) {
      return f(world[0], (first[0] + i) * components + component);
    } else {
      if (uniform && f.stride == 0) return T(f.data[(first[0] + i) * components + component]);
      return detail::gather<T>(f.data, f.stride, world, first, components, i * components + component);
    }
  }
  KOKKOS_FORCEINLINE_FUNCTION Vec3<T> constant3(Field<R> const& f, int const* first, int i) const {
    return {constant(f, first, i, 3, 0), constant(f, first, i, 3, 1), constant(f, first, i, 3, 2)};
  }
  KOKKOS_FORCEINLINE_FUNCTION Quat<T> constant4(Field<R> const& f, int const* first, int i) const {
    return {constant(f, first, i, 4, 0), constant(f, first, i, 4, 1), constant(f, first, i, 4, 2), constant(f, first, i, 4, 3)};
  }
  /// Constant of the tree's k-th tendon, term or actuator, which are listed by world index.
  KOKKOS_FORCEINLINE_FUNCTION T listed(Field<R> const& f, int list, int n, int k, int components = 1, int component = 0) const {
    if constexpr (W == 1) {
      return f(world[0], index(list, instance[0] * n + k) * components + component);
    } else {
      if (uniform && f.stride == 0) return T(f(world[0], index(list, instance[0] * n + k) * components + component));
      int item[W];
      for (int l = 0; l < W; ++l) item[l] = index(list, instance[l] * n + k);
      return constant(f, item, 0, components, component);
    }
  }
  KOKKOS_FORCEINLINE_FUNCTION Vec3<T> gravity() const {
    int const zero[W] = {};
    return constant3(model.gravity, zero, 0);
  }
  /// World indices of the tree's k-th item of a list, for constant(field, item, 0, ...) and load(view, item, 0, ...).
  KOKKOS_FORCEINLINE_FUNCTION void listed_items(int list, int n, int k, int (&item)[W]) const {
    item[0] = index(list, instance[0] * n + k);
    for (int i = 1; i < W; ++i) item[i] = uniform ? item[0] : index(list, instance[i] * n + k);
  }
  /// Reference point of spatial vectors: the centre of mass of all bodies that hang on the same root.
  KOKKOS_FORCEINLINE_FUNCTION Vec3<T> com(int root) const { return items.vec3(at.com + 3 * root); }
  KOKKOS_FORCEINLINE_FUNCTION Vec3<T> com_of_body(int b) const { return com(index(a.body_root, b)); }

  /// Item `first + i` of a plain view (world, item), or its component of (world, item, components).
  template <class View>
  KOKKOS_FORCEINLINE_FUNCTION T load(View const& v, int const* first, int i, int components = 1, int component = 0) const {
    std::int64_t const stride = std::int64_t(v.extent(1)) * components;
    if constexpr (W == 1)
      return v.data()[world[0] * stride + (first[0] + i) * components + component];
    else if (uniform && count == W)
      return detail::gather_consecutive<T>(v.data() + world[0] * stride + (first[0] + i) * components + component, stride);
    else
      return detail::gather<T>(v.data(), stride, world, first, components, i * components + component);
  }
  template <class View>
  KOKKOS_FORCEINLINE_FUNCTION void store(View const& v, int const* first, int i, T const& x, int components = 1, int component = 0) const {
    std::int64_t const stride = std::int64_t(v.extent(1)) * components;
    if constexpr (W == 1) {
      if (count > 0) v.data()[world[0] * stride + (first[0] + i) * components + component] = x;
    } else if (uniform && count == W) {
      detail::scatter_consecutive<T>(v.data() + world[0] * stride + (first[0] + i) * components + component, stride, x);
    } else {
      detail::scatter<T>(v.data(), stride, world, first, components, i * components + component, x, count);
    }
  }
};

namespace detail {
/// A stage that needs nothing of the block's items but fills them: it has kept(archetype, layout), the number of items that it leaves.
template <class Stage>
concept FusedStage = requires(Stage const s, Archetype const& a, DynamicsLayout const& at) {
  s.kept(a, at);
};

/// A stage that is written for several workers, and runs that many blocks at a time on a multiprocessor.
template <class Stage>
concept SharedStage = Stage::shared_blocks >
0;
template <class Stage>
inline constexpr int stage_blocks = 1;
template <SharedStage Stage>
inline constexpr int stage_blocks<Stage> = Stage::shared_blocks;

template <class T, class R, class Mem, class Stage>
struct LaneKernel {
  Model<R, Mem> model;
  Dynamics<R, Mem> dynamics;
  Stage stage;
  template <int Workers = 1>
  KOKKOS_FORCEINLINE_FUNCTION void run(int i, T* scratch, int worker = 0) const {
    constexpr int width = Dynamics<R, Mem>::width, W = width_of<T>::value;
    static_assert(W == 1 || W == width);
    int const block = i / (width / W), inside = i % (width / W);
    int const k = dynamics.block_archetype(block);
    Archetype const& a = model.archetypes(k);
    LaneItems<T> const items{reinterpret_cast<T*>(dynamics.items.data() + dynamics.block_offset(block)) + inside, width / W};
    Lane<T, Mem, Workers> const lane(model, a, scratch ? LaneItems<T>{scratch, 1} : items,
                                     (block - dynamics.archetype_block(k)) * width + inside, dynamics.padded_worlds, dynamics.worlds,
                                     worker);
    if (Workers == 1 && lane.count == 0) return;  // several meet at barriers, and such a lane stores nothing
    stage(lane);
    if constexpr (FusedStage<Stage>)
      for (int e = 0, n = scratch ? stage.kept(a, lane.at) : 0; e < n; ++e) items[e] = scratch[e];
  }
  [[gnu::noinline]] void on_host(int i, int thread) const {  // one copy of the code for all host backends
    if constexpr (FusedStage<Stage>)
      run(i, reinterpret_cast<T*>(dynamics.thread_items.data() + std::size_t(thread) * dynamics.thread_stride));
    else
      run(i, nullptr);
  }
};
template <class Exec, class Kernel>
struct HostLanes {
  Kernel kernel;
  void operator()(int i) const {
    Kokkos::Experimental::UniqueToken<Exec, Kokkos::Experimental::UniqueTokenScope::Global> const token;
    int const thread = token.acquire();
    kernel.on_host(i, thread);
    token.release(thread);
  }
};
}  // namespace detail

/// Runs `stage(lane)` for all lanes: one launch for all archetypes. `stage` is a functor with a template <class Lane> operator()(Lane
/// const&) const. On a host with T = R, lanes go one by one (the reference of tests); by default packs.
/// Errors: std::invalid_argument where the dynamics do not fit the model (made before make_per_world changed the layout, or for more worlds
/// than the model has values for).
template <class T, ExecutionSpace Exec, class R, class Mem, class Stage>
void for_lanes(char const* label, Exec const& exec, Model<R, Mem> const& model, Dynamics<R, Mem> const& dynamics, Stage stage) {
  detail::expects_fit(label, model, dynamics);
  static_assert(can_access<Exec, Kokkos::View<R*, Mem>>, "gsp::for_lanes: the model is not accessible from this execution space");
  constexpr int threads = Dynamics<R, Mem>::width / detail::width_of<T>::value;
  using Kernel = detail::LaneKernel<T, R, Mem, Stage>;
  if constexpr (is_device<Exec>) {  // few warps a multiprocessor: a block of lanes works in 200 kB, the first-level cache
    static_assert(Dynamics<R, Mem>::width == device_block);
    detail::launch_lanes<detail::SharedStage<Stage> ? device_workers : 1, device_block, detail::stage_blocks<Stage>>(
        label, exec, dynamics.blocks, Kernel{model, dynamics, std::move(stage)});
  } else {
    Kokkos::parallel_for(label, Kokkos::RangePolicy<Exec>(exec, 0, dynamics.blocks * threads),
                         detail::HostLanes<Exec, Kernel>{{model, dynamics, std::move(stage)}});
  }
}
template <ExecutionSpace Exec, class R, class Mem, class Stage>
void for_lanes(char const* label, Exec const& exec, Model<R, Mem> const& model, Dynamics<R, Mem> const& dynamics, Stage stage) {
  for_lanes<lane_number<Exec, R>>(label, exec, model, dynamics, std::move(stage));
}

}  // namespace gsp
