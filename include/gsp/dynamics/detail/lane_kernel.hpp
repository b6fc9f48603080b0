#pragma once
#include <gsp/dynamics/dynamics.hpp>
#include <gsp/parallel/detail/thread_room.hpp>

namespace gsp {
template <class T, class Mem, int Workers>
struct Lane;  // dynamics/lanes.hpp
}

/// The kernel of for_lanes: gsp/dynamics/lanes.hpp, where the contract stands.
namespace gsp::detail {

/// kernel.run<Workers>(lane, nullptr, worker) for all lanes of all blocks on a GPU, `Lanes` to a block; registers for `Blocks` of them at a
/// time on a multiprocessor.
template <int Workers, int Lanes, int Blocks, class Exec, class Kernel>
void launch_lanes(char const* label, Exec const& exec, int blocks, Kernel const& kernel);

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
    LaneItems<T> const items{whole(reinterpret_cast<T*>(dynamics.items.data() + dynamics.block_offset(block)) + inside), width / W};
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
  ThreadRoom<Exec> room;
  void operator()(int i) const {
    room([&](int thread) { kernel.on_host(i, thread); });
  }
};

}  // namespace gsp::detail

#if defined(KOKKOS_ENABLE_CUDA) && defined(__CUDACC__)
#include <gsp/dynamics/detail/lanes_cuda.hpp>
#endif
