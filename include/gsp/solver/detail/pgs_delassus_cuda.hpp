#pragma once
#include <gsp/parallel/detail/launch_cuda.hpp>
#include <gsp/solver/detail/delassus_island_cuda.hpp>
#include <gsp/solver/detail/pgs_sparse_cuda.hpp>

/// The kernels of pgs_delassus.hpp: which islands are taken by which, and when.
namespace gsp::detail {

/// Where a list begins.
template <class R, class Mem>
__device__ int delassus_begin(Solution<R, Mem> const& solution, int list) {
  int begin = 0;
  for (int k = list + 1; k <= large_island; ++k) begin += solution.list_counts(k, many_sweeps) + solution.list_counts(k, few_sweeps);
  return begin;
}

template <class R, class Mem>
__global__ void list_delassus_kernel(PgsDelassus<R, Mem> const __grid_constant__ solver, bool place) {
  follow();
  if (solver.halt()) return;
  auto const& rows = solver.rows;
  auto const& solution = solver.solution;
  auto const& counts = solution.list_counts;
  int const of_world = islands_of_world(rows), number = blockIdx.x * blockDim.x + threadIdx.x, w = number / of_world;
  if (w >= rows.worlds || !is_island(rows, w, number % of_world)) return;
  Island const island = island_of(rows, w, number % of_world);
  int const list = delassus_takes(rows, island) ? list_of_rows(island.rows) : large_island;
  bool const few = !(of_world > 1 ? solution.was_long(w) : solution.iterations(w) >= long_solve);
  int const at = atomicAdd(&counts(list, place ? (few ? few_listed : many_listed) : (few ? few_sweeps : many_sweeps)), 1);
  if (place) solution.listed(0, delassus_begin(solution, list) + (few ? counts(list, many_sweeps) : 0) + at) = number;
}
template <class R, class Mem, int S, bool triangle>
__device__ __forceinline__ void take_delassus(PgsDelassus<R, Mem> const& solver, int list) {
  extern __shared__ __align__(32) char shared_memory[];
  if (solver.halt()) return;
  auto const& rows = solver.rows;
  auto const& solution = solver.solution;
  int const of_world = islands_of_world(rows);
  auto const solve = [&](Island const& own) {
    DelassusIsland<R, Mem, S, triangle> island(solver, own, shared_memory);
    R const tolerance = R(solver.options.tolerance) * rows.rate_scale(own.world);
    island.write(sweep_until_rest<R>(island, solver.options, tolerance, own.rows > 0));
  };
  if (list < 0) {
    int const w = blockIdx.x / of_world, i = blockIdx.x % of_world;
    if (!is_island(rows, w, i)) return;
    Island const own = island_of(rows, w, i);
    if (delassus_takes(rows, own) && (rows_of_list(list_of_rows(own.rows)) + 31) / 32 == S) solve(own);
    return;
  }
  int const begin = delassus_begin(solution, list),
            count = solution.list_counts(list, many_sweeps) + solution.list_counts(list, few_sweeps);
  for (;;) {
    int at = threadIdx.x == 0 ? atomicAdd(&solution.list_counts(list, taken), 1) : 0;
    at = __shfl_sync(0xffffffffu, at, 0);
    if (at >= count) return;
    int const number = solution.listed(0, begin + at);
    solve(island_of(rows, number / of_world, number % of_world));
  }
}
/// @param list    of islands; -1: an island a block, its number is the block's, where it has as many rows a thread
/// @param beside  begins while the kernel before runs, of which it reads nothing (`follow`)
template <class R, class Mem, int S, bool triangle>
__global__ void __launch_bounds__(32) pgs_delassus_kernel(PgsDelassus<R, Mem> const __grid_constant__ solver, int list, bool beside) {
  follow(beside);
  take_delassus<R, Mem, S, triangle>(solver, list);
  end_beside(beside);
}

template <class Exec, class R, class Mem>
void launch_pgs_delassus(Exec const& exec, PgsDelassus<R, Mem> const& solver) {
  int const nv = solver.rows.nv;
  std::int64_t const islands = std::int64_t(solver.rows.worlds) * islands_of_world(solver.rows);
  auto const& device = exec.cuda_device_prop();
  std::int64_t const fit = std::max<std::int64_t>(std::int64_t(device.sharedMemPerBlockOptin), sparse_some_bytes);
  // Islands that are not small, in three sizes: a block of each has what it needs, so that as many fit as can.
  constexpr int sparse_sizes = 3;
  auto const launch_sparse = [&](cudaStream_t stream, int size, bool listed, bool beside) {
    std::int64_t const sizes[] = {0, sparse_few_bytes, sparse_some_bytes, fit}, least = sizes[size], most = sizes[size + 1];
    if (least == most) return;
    int const grid = int(std::min<std::int64_t>(islands, (listed ? 1 : 8) * blocks_at_once(device, most))),
              list = listed ? large_island + size : -1;
    auto const one = [&](auto* kernel, int warps) {
      allow_shared(device, kernel, most, fit);
      launch_kernel(stream, kernel, grid, 32 * warps, std::size_t(most), solver, list, least, most, fit, beside);
    };
    if (most <= sparse_some_bytes)
      one(pgs_sparse_kernel<R, Mem, sparse_few_warps>, sparse_few_warps);
    else
      one(pgs_sparse_kernel<R, Mem, sparse_many_warps>, sparse_many_warps);
  };
  if (!any_small(solver.rows.islands.ntree, nv))
    return launch_side_by_side("gsp::solver::pgs_sparse", exec, sparse_sizes,
                               [&](int i, cudaStream_t stream) { launch_sparse(stream, sparse_sizes - 1 - i, false, false); });
  auto const launch = [&](cudaStream_t stream, int size, int list, bool beside) {
    std::int64_t const full = delassus_bytes_of_list<R>(size, nv);
    if (full > delassus_most_bytes) return;
    int const rows = rows_of_list(size);
    bool const triangle = rows > 64 && islands > 2 * blocks_at_once(device, full);
    auto const bytes = std::size_t(delassus_bytes_of_list<R>(size, nv, triangle));
    int const grid = int(list < 0 ? islands : std::min<std::int64_t>(islands, blocks_at_once(device, std::int64_t(bytes))));
    auto const one = [&](auto* kernel) {
      allow_shared(device, kernel, std::int64_t(bytes), delassus_most_bytes);
      launch_kernel(stream, kernel, grid, 32, bytes, solver, list, beside);
    };
    if (rows <= 32)
      one(pgs_delassus_kernel<R, Mem, 1, false>);
    else if (rows <= 64)
      one(pgs_delassus_kernel<R, Mem, 2, false>);
    else if (rows <= 96)
      one(triangle ? pgs_delassus_kernel<R, Mem, 3, true> : pgs_delassus_kernel<R, Mem, 3, false>);
    else
      one(triangle ? pgs_delassus_kernel<R, Mem, 4, true> : pgs_delassus_kernel<R, Mem, 4, false>);
  };
  constexpr int largest[] = {list_of_rows(32), list_of_rows(64), list_of_rows(96), list_of_rows(lockstep_most_rows)};
  // Few: each has a warp of its own, of up to 64 rows at once.
  if (islands <= blocks_at_once(device, delassus_bytes_of_list<R>(largest[1], nv)))
    return launch_on_cuda("gsp::solver::pgs_delassus", exec, [&](cudaStream_t stream) {
      for (int const list : largest) launch(stream, list, -1, list != largest[0]);
      for (int size = sparse_sizes; size-- > 0;) launch_sparse(stream, size, false, true);
    });
  launch_on_cuda("gsp::solver::list_delassus", exec, [&](cudaStream_t stream) {
    auto const& counts = solver.solution.list_counts;
    cuda_expects(cudaMemsetAsync(counts.data(), 0, counts.span() * sizeof(int), stream), "gsp::solver::list_delassus");
    unsigned const blocks = unsigned((islands + 255) / 256);
    for (bool const place : {false, true}) launch_kernel(stream, list_delassus_kernel<R, Mem>, blocks, 256, 0, solver, place);
  });
  launch_side_by_side("gsp::solver::pgs_delassus", exec, sparse_sizes + island_lists, [&](int i, cudaStream_t stream) {
    if (i < sparse_sizes) return launch_sparse(stream, sparse_sizes - 1 - i, true, false);
    int const list = island_lists + sparse_sizes - 1 - i;  // what is long begins first
    launch(stream, list, list, false);
  });
}

}  // namespace gsp::detail
