#pragma once
#include <algorithm>
#include <gsp/parallel/detail/launch_cuda.hpp>
#include <gsp/parallel/detail/worlds_cuda.hpp>
#include <gsp/solver/detail/newton_island.hpp>
#include <gsp/solver/detail/newton_until_rest.hpp>
#include <gsp/solver/detail/newton_world.hpp>

/// The kernels of newton_island.hpp, a warp or some warps an island, which stays in shared memory until it is solved; and of
/// newton_sparse.hpp, as many threads an island as a block may have.
namespace gsp::detail {

inline constexpr std::int64_t newton_warp_bytes = 16 * 1024;  // of what one warp solves, at most
inline constexpr int newton_many_warps = 4;
inline constexpr int newton_warps = 20;  // of a multiprocessor: as many registers as leave room for as many islands as its memory has

/// Blocks take the islands of a list in turn.
/// @param solve  of(threads, island, cones): NewtonIsland, or what is as it
template <class Threads, class R, class Mem, class Of>
__device__ __forceinline__ void take_islands(NewtonWorld<R, Mem> const& solver, int list, Of const& of) {
  __shared__ int taken;
  auto const& rows = solver.rows;
  for (int const count = solver.lists.count(list);;) {
    if (threadIdx.x == 0) taken = count > 0 ? atomicAdd(&solver.lists.taken(list), 1) : 0;
    __syncthreads();
    int const at = taken;
    __syncthreads();
    if (at >= count) break;
    auto const island = solver.lists.island(list, at);
    int const w = island.number / islands_of_world(rows);
    Threads const threads{w};
    auto own = of(threads, island_rows(rows, w, island.number % islands_of_world(rows)), island.cones);
    int const iterations = newton_until_rest<R>(own, solver.iterations, solver.tolerance);
    R const worst = own.write();
    threads.single([&] {
      atomicMax(&solver.solution.iterations(w), iterations);
      using Bits =
          std::conditional_t<sizeof(R) == 4, unsigned, unsigned long long>;  // they grow with what is 0 or more; NaN's are the most
      if (solver.residual) atomicMax(reinterpret_cast<Bits*>(&solver.solution.residual(w)), *reinterpret_cast<Bits const*>(&worst));
    });
  }
}
template <class R, class Mem, int warps>
__global__ void __launch_bounds__(32 * warps, newton_warps / warps)
    newton_kernel(NewtonWorld<R, Mem> const __grid_constant__ solver, int list, bool beside) {
  using Threads = std::conditional_t<warps == 1, WarpWorld, SomeWarps<warps>>;
  follow(beside);
  extern __shared__ __align__(32) char shared_memory[];
  take_islands<Threads>(solver, list, [&](Threads const& threads, IslandRows const& island, bool cones) {
    return NewtonIsland<R, Mem, Threads>(solver, threads, island, cones, shared_memory);
  });
  end_beside(beside);
}
/// @param bytes  of shared memory
template <class R, class Mem>
__global__ void __launch_bounds__(newton_sparse_threads, 1)
    newton_sparse_kernel(NewtonWorld<R, Mem> const __grid_constant__ solver, int bytes, bool beside) {
  using Threads = SomeWarps<newton_sparse_threads / 32>;
  follow(beside);
  extern __shared__ __align__(32) char shared_memory[];
  take_islands<Threads>(solver, newton_sparse_list, [&](Threads const& threads, IslandRows const& island, bool) {
    return NewtonSparse<R, Mem, Threads>(solver, threads, island, solver.work.data() + blockIdx.x * solver.stride,
                                         reinterpret_cast<R*>(shared_memory), bytes / int(sizeof(R)));
  });
  end_beside(beside);
}

/// Of shared memory, beside what the kernel has of its own: each kind of sum has a number a warp.
template <class Exec>
std::int64_t newton_sparse_bytes(Exec const& exec) {
  return std::int64_t(exec.cuda_device_prop().sharedMemPerBlockOptin) - 2048;
}
template <class Exec>
int newton_sparse_blocks(Exec const& exec) {
  return blocks_at_once(exec.cuda_device_prop(), newton_sparse_bytes(exec));
}

template <class Exec, class R, class Mem>
void launch_newton(Exec const& exec, NewtonWorld<R, Mem> solver, int rooms) {
  auto const& device = exec.cuda_device_prop();
  constexpr std::int64_t own_bytes = 1024;  // what a kernel has besides, and more
  std::int64_t const most = std::int64_t(device.sharedMemPerBlockOptin) - own_bytes;
  int const islands = solver.lists.islands;
  solver.near_bytes = std::min({solver.near_bytes, most, newton_bytes_of_list(newton_lists - 1)});
  int const sparse_most = int(newton_sparse_bytes(exec)), sparse_bytes = std::min(int(solver.near_bytes), sparse_most) / 32 * 32;
  launch_on_cuda("gsp::solver::list_newton", exec, [&](cudaStream_t stream) {
    cuda_expects(cudaMemsetAsync(solver.lists.counts(), 0, 2 * NewtonLists<Mem>::lists * sizeof(int), stream), "gsp::solver::list_newton");
  });
  for_worlds("gsp::solver::newton", exec, solver.rows.worlds, solver);
  auto const launch = [&](cudaStream_t stream, int i, bool beside) {
    int const list = newton_lists - i;  // what is long begins first
    if (list == newton_sparse_list) {
      auto* const kernel = newton_sparse_kernel<R, Mem>;
      allow_shared(device, kernel, sparse_most, sparse_most);
      int const blocks = std::min({islands, rooms, newton_sparse_blocks(exec)});
      return launch_kernel(stream, kernel, blocks, newton_sparse_threads, std::size_t(sparse_most), solver, sparse_bytes, beside);
    }
    std::int64_t const bytes = std::min(newton_bytes_of_list(list), most);
    auto const one = [&](auto* kernel, int warps) {
      allow_shared(device, kernel, bytes, most);
      launch_kernel(stream, kernel, std::min(islands, blocks_at_once(device, bytes)), 32 * warps, std::size_t(bytes), solver, list, beside);
    };
    if (bytes <= newton_warp_bytes)
      one(newton_kernel<R, Mem, 1>, 1);
    else
      one(newton_kernel<R, Mem, newton_many_warps>, newton_many_warps);
  };
  if (islands <= device.multiProcessorCount)  // few: one after the other, each on the other's heels
    return launch_on_cuda("gsp::solver::newton_islands", exec, [&](cudaStream_t stream) {
      for (int i = 0; i <= newton_lists; ++i) launch(stream, i, i > 0);
    });
  launch_side_by_side("gsp::solver::newton_islands", exec, newton_lists + 1, [&](int i, cudaStream_t stream) { launch(stream, i, false); });
}

}  // namespace gsp::detail
