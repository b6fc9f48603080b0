#pragma once
#include <algorithm>
#include <gsp/parallel/detail/launch_cuda.hpp>
#include <gsp/parallel/detail/worlds_cuda.hpp>
#include <gsp/solver/detail/newton_island.hpp>
#include <gsp/solver/detail/newton_until_rest.hpp>
#include <gsp/solver/detail/newton_world.hpp>

/// The kernels of newton_island.hpp: a warp or some warps an island, which stays in shared memory until it is solved.
namespace gsp::detail {

inline constexpr std::int64_t newton_warp_bytes = 16 * 1024;  // of what one warp solves, at most
inline constexpr int newton_many_warps = 4;
inline constexpr int newton_warps = 20;  // of a multiprocessor: as many registers as leave room for as many islands as its memory has

/// Blocks take the islands of a list in turn.
template <class R, class Mem, int warps>
__global__ void __launch_bounds__(32 * warps, newton_warps / warps)
    newton_kernel(NewtonWorld<R, Mem> const __grid_constant__ solver, int list, bool beside) {
  using Threads = std::conditional_t<warps == 1, WarpWorld, SomeWarps<warps>>;
  follow(beside);
  extern __shared__ __align__(32) char shared_memory[];
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
    NewtonIsland<R, Mem, Threads> own(solver, threads, island_rows(rows, w, island.number % islands_of_world(rows)), island.cones,
                                      shared_memory);
    int const iterations = newton_until_rest<R>(own, solver.iterations, solver.tolerance);
    R const worst = own.write();
    threads.single([&] {
      atomicMax(&solver.solution.iterations(w), iterations);
      using Bits =
          std::conditional_t<sizeof(R) == 4, unsigned, unsigned long long>;  // they grow with what is 0 or more; NaN's are the most
      if (solver.residual) atomicMax(reinterpret_cast<Bits*>(&solver.solution.residual(w)), *reinterpret_cast<Bits const*>(&worst));
    });
  }
  end_beside(beside);
}

template <class Exec, class R, class Mem>
void launch_newton(Exec const& exec, NewtonWorld<R, Mem> solver) {
  auto const& device = exec.cuda_device_prop();
  constexpr std::int64_t own_bytes = 1024;  // what a kernel has besides, and more
  std::int64_t const most = std::int64_t(device.sharedMemPerBlockOptin) - own_bytes;
  int const islands = solver.lists.islands;
  solver.near_bytes = std::min({solver.near_bytes, most, newton_bytes_of_list(newton_lists - 1)});
  launch_on_cuda("gsp::solver::list_newton", exec, [&](cudaStream_t stream) {
    cuda_expects(cudaMemsetAsync(solver.lists.counts(), 0, 2 * newton_lists * sizeof(int), stream), "gsp::solver::list_newton");
  });
  for_worlds("gsp::solver::newton", exec, solver.rows.worlds, solver);
  auto const launch = [&](cudaStream_t stream, int i, bool beside) {
    int const list = newton_lists - 1 - i;  // what is long begins first
    std::int64_t const bytes = std::min(newton_bytes_of_list(list), most);
    int const fit =
        std::clamp(int(std::int64_t(device.sharedMemPerMultiprocessor) / (bytes + std::int64_t(device.reservedSharedMemPerBlock))), 1, 32);
    auto const one = [&](auto* kernel, int warps) {
      if (bytes + own_bytes > std::int64_t(device.sharedMemPerBlock))
        cuda_expects(cudaFuncSetAttribute(kernel, cudaFuncAttributeMaxDynamicSharedMemorySize, int(most)), "gsp::solver::newton");
      launch_kernel(stream, kernel, std::min(islands, fit * device.multiProcessorCount), 32 * warps, std::size_t(bytes), solver, list,
                    beside);
    };
    if (bytes <= newton_warp_bytes)
      one(newton_kernel<R, Mem, 1>, 1);
    else
      one(newton_kernel<R, Mem, newton_many_warps>, newton_many_warps);
  };
  if (islands <= device.multiProcessorCount)  // few: one after the other, each on the other's heels
    return launch_on_cuda("gsp::solver::newton_islands", exec, [&](cudaStream_t stream) {
      for (int i = 0; i < newton_lists; ++i) launch(stream, i, i > 0);
    });
  launch_side_by_side("gsp::solver::newton_islands", exec, newton_lists, [&](int i, cudaStream_t stream) { launch(stream, i, false); });
}

}  // namespace gsp::detail
