#pragma once
#include <gsp/collision/broadphase.hpp>
#include <gsp/parallel/detail/launch_cuda.hpp>

/// Colliders of a group by eight neighbouring threads of a GPU: one thread went through a humanoid's nineteen in 50 us, whatever else there
/// was to do. The least and the greatest of numbers have no order.
namespace gsp::detail {

inline constexpr int threads_of_group = 8;

template <class T>
__device__ __forceinline__ void join_threads(GroupBox<T>& box) {
#pragma unroll
  for (int step = threads_of_group / 2; step > 0; step /= 2) {
#pragma unroll
    for (int i = 0; i < 3; ++i) {
      box.lo[i] = min(box.lo[i], __shfl_xor_sync(0xffffffffu, box.lo[i], step));
      box.hi[i] = max(box.hi[i], __shfl_xor_sync(0xffffffffu, box.hi[i], step));
    }
    box.broken = box.broken + __shfl_xor_sync(0xffffffffu, box.broken, step);
  }
}

template <class F>
__global__ void __launch_bounds__(128) place_colliders_kernel(F const __grid_constant__ f, std::int64_t items) {
  follow();
  std::int64_t const item = (std::int64_t(blockIdx.x) * blockDim.x + threadIdx.x) / threads_of_group;
  int const own = int(threadIdx.x) % threads_of_group, groups = f.model.groups, w = int(item / groups), g = int(item % groups);
  GroupBox<typename F::real_type> box;
  if (item < items) {
    if (own == 0) f.begin(item);
    for (int c = f.model.group_first(g) + own; c < f.model.group_first(g + 1); c += threads_of_group) f.place_one(w, c, box);
  }
  join_threads(box);
  if (item < items && own == 0) f.leave(w, g, box);
}

template <class Exec, class F>
void launch_groups(std::string const& label, Exec const& exec, std::int64_t items, F const& f) {
  if (items == 0) return;
  constexpr int threads = 128, of_block = threads / threads_of_group;
  launch_on_cuda(label, exec, [&](cudaStream_t stream) {
    launch_kernel(stream, place_colliders_kernel<F>, unsigned((items + of_block - 1) / of_block), threads, 0, f, items);
  });
}

}  // namespace gsp::detail
