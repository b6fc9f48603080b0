#pragma once
#include <gsp/constraint/rows.hpp>
#include <gsp/parallel/detail/thread_room.hpp>
#include <gsp/solver/detail/lockstep_sizes.hpp>
#include <limits>

namespace gsp {

/// What a solver finds for the rows of each world, and room for its work.
template <class R, class Mem>
struct Solution {
  using real_type = R;
  using memory_space = Mem;
  template <class D>
  using View = Kokkos::View<D, Kokkos::LayoutRight, Mem>;
  int worlds = 0, nv = 0;
  View<R**> z;                // (world, nv) whitened sum of impulses, Y^T p
  View<R**> z_before;         // (world, nv) a solver's own: z before its last sweep, or a list of `impacts`
  View<R**> qfrc_constraint;  // (world, nv) J^T p / h, written by `integrate` [N, N m]
  View<R*> residual;          // (worlds) largest change of a rate that one more projection would make [m/s, rad/s]; NaN where the solver
                              // was not asked for it (PgsOptions::residual, NewtonOptions::residual)
  View<int*> iterations;      // (worlds) sweeps done; of newton its iterations
  // Of islands, worlds * trees of them at most, numbered through all worlds (constraint/islands.hpp):
  View<int**> listed;           // small ones, list by list; hosts: (2, islands) of a round of sweeps and of the next; GPUs: (1, islands)
  View<int**> list_counts;      // (lists + 3, 5) what stands in them (detail/list_islands.hpp)
  View<signed char*> goes_on;   // hosts, (islands): into another round of sweeps
  View<signed char*> was_long;  // GPUs, (worlds of several trees): the last step took many sweeps
  View<signed char*> left;      // GPUs, (islands): too large for shared memory; of those that pgs_delassus_kernel does not take
  View<R*> thread_items;        // hosts: room for a pack of islands a thread (detail/pgs_lockstep.hpp)
  std::int64_t thread_stride = 0;
  View<R*> island_items;  // hosts: room for a large island a thread (detail/pgs_grouped.hpp), which pgs enlarges
  std::int64_t island_stride = 0;
  int thread_rooms = 0;                              // hosts: threads that both have room for
  detail::SharedStamp<detail::SolutionStamp> stamp;  // host: of which state it is (dynamics/stamps.hpp)
};

struct SolutionOptions {
  int worlds = 1;
};

namespace detail {
template <class R, class Mem>
struct NotMeasured {
  Kokkos::View<R*, Kokkos::LayoutRight, Mem> residual;
  KOKKOS_FUNCTION void operator()(int w) const { residual(w) = Kokkos::Experimental::quiet_NaN_v<R>; }
};
}  // namespace detail

/// Room for what is found in `worlds` worlds. Allocates. Errors: std::invalid_argument for worlds < 1.
template <class R, ExecutionSpace Exec, class Mem>
Solution<R, Mem> make_solution(Exec const& exec, Model<R, Mem> const& model, SolutionOptions options = {}) {
  static_assert(can_access<Exec, Kokkos::View<R*, Mem>>, "gsp::make_solution: the model is not accessible from this execution space");
  expects(options.worlds > 0, "gsp::make_solution: worlds must be positive and is " + std::to_string(options.worlds));
  std::int64_t const islands = std::int64_t(options.worlds) * std::max(1, model.ntree);
  expects(islands <= std::numeric_limits<int>::max(), "gsp::make_solution: " + std::to_string(options.worlds) + " worlds of " +
                                                          std::to_string(model.ntree) +
                                                          " trees are more islands than an int counts; take fewer worlds a batch");
  Solution<R, Mem> s;
  auto const make = [&](auto& v, char const* label, auto... items) {
    v = detail::allocate_zero<std::decay_t<decltype(v)>>(exec, label, items...);
  };
  s.worlds = options.worlds;
  s.nv = model.nv;
  s.stamp = detail::make_stamp<detail::SolutionStamp>("gsp::Solution::stamp");
  make(s.z, "gsp::Solution::z", s.worlds, s.nv);
  make(s.z_before, "gsp::Solution::z_before", s.worlds, s.nv);
  make(s.qfrc_constraint, "gsp::Solution::qfrc_constraint", s.worlds, s.nv);
  make(s.residual, "gsp::Solution::residual", s.worlds);
  Kokkos::parallel_for("gsp::solver::make_solution", Kokkos::RangePolicy<Exec>(exec, 0, s.worlds), detail::NotMeasured<R, Mem>{s.residual});
  make(s.iterations, "gsp::Solution::iterations", s.worlds);
  make(s.list_counts, "gsp::Solution::list_counts", detail::island_lists + 3, 5);
  if constexpr (is_device<Exec>)
    make(s.left, "gsp::Solution::left", islands);
  else
    s.thread_rooms = detail::thread_rooms(exec);
  if (!detail::any_small(model.ntree, model.nv)) return s;
  make(s.listed, "gsp::Solution::listed", is_device<Exec> ? 1 : 2, islands);
  if constexpr (is_device<Exec>) {
    if (model.ntree > 1) make(s.was_long, "gsp::Solution::was_long", s.worlds);
  } else {
    make(s.goes_on, "gsp::Solution::goes_on", islands);
    s.thread_stride = detail::lockstep_packs(s.nv) * native_width<R>;
    make(s.thread_items, "gsp::Solution::thread_items", s.thread_stride * s.thread_rooms);
  }
  return s;
}

}  // namespace gsp
