#pragma once
#include <gsp/dynamics/detail/lane_kernel.hpp>
#include <gsp/dynamics/detail/lane_memory.hpp>
#include <gsp/dynamics/dynamics.hpp>
#include <utility>

/// Lanes: one tree of one world each. All lanes of an archetype run the same branch-free program; only numbers differ. On a CPU the number
/// type is a `Pack` and a block of W lanes goes through the program together; on a GPU a lane is a thread, and a block is a warp.
namespace gsp {

namespace detail {
/// Views (world, item[, components]) that lanes load from and store to: worlds are rows, items lie one after the other.
template <class View>
KOKKOS_FORCEINLINE_FUNCTION constexpr void expects_rows() {
  if constexpr (Kokkos::is_view_v<View>)
    static_assert(
        View::rank() < 2 || std::is_same_v<typename View::array_layout, Kokkos::LayoutRight>,
        "gsp: load and store of a lane take views of Kokkos::LayoutRight, of another layout they would touch other items: say so in "
        "the view's type, `Kokkos::View<float**, Kokkos::LayoutRight, Mem>` (a device's default is LayoutLeft)");
}
}  // namespace detail

inline constexpr int device_workers = tree_parts;  // warps that share the work of a block on a GPU, in the stages that are written for it
/// The number type that a kernel on `Exec` computes with.
template <class Exec, class R>
using lane_number = std::conditional_t<is_device<Exec> || !Scalar<R>, R, Pack<R, native_width<R>>>;

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

  /// f(lane), by all workers, out of line as with `single`.
  template <class F>
  KOKKOS_FORCEINLINE_FUNCTION void seldom(F const& f) const {
#ifdef __CUDA_ARCH__
    detail::out_of_line(Lane(*this), f);
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
    detail::expects_rows<View>();
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
    detail::expects_rows<View>();
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
    detail::ThreadRoom<Exec> const room(label, exec, detail::FusedStage<Stage> ? dynamics.thread_rooms : detail::host_threads(exec));
    Kokkos::parallel_for(label, Kokkos::RangePolicy<Exec>(exec, 0, dynamics.blocks * threads),
                         detail::HostLanes<Exec, Kernel>{{model, dynamics, std::move(stage)}, room});
  }
}
template <ExecutionSpace Exec, class R, class Mem, class Stage>
void for_lanes(char const* label, Exec const& exec, Model<R, Mem> const& model, Dynamics<R, Mem> const& dynamics, Stage stage) {
  for_lanes<lane_number<Exec, R>>(label, exec, model, dynamics, std::move(stage));
}

}  // namespace gsp
