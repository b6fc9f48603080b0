#pragma once
#include <gsp/constraint/rows.hpp>

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
  View<R**> z_before;         // (world, nv) z before the last sweep
  View<R**> qfrc_constraint;  // (world, nv) J^T p / h, written by `integrate` [N, N m]
  View<R*> residual;          // (worlds) largest violation after the last sweep [m/s, rad/s] (pgs.hpp); NaN where it was not asked for
                              // (PgsOptions::residual)
  View<int*> iterations;      // (worlds) sweeps done
  View<R*> thread_items;      // hosts: room for a pack of worlds a thread (detail/pgs_lockstep.hpp)
  std::int64_t thread_stride = 0;
};

struct SolutionOptions {
  int worlds = 1;
};

namespace detail {
// On hosts, worlds of at most so many rows and dofs, and elements of so many rows, are solved a pack at a time (detail/pgs_lockstep.hpp).
inline constexpr int lockstep_most_rows = 128, lockstep_most_dofs = 128, lockstep_rows = 3;
// So many elements of one row, or one of two or three, make a block: room for the longest list of either in any world of a pack.
inline constexpr int lockstep_single_rows = 4;
inline constexpr int lockstep_most_blocks = lockstep_most_rows / lockstep_single_rows + lockstep_most_rows / 2;
inline constexpr int lockstep_most_block_rows = lockstep_most_rows + lockstep_most_rows / 2 * lockstep_rows;
// What is known of a block but its entries: 11 numbers a row and the products of its rows; all else takes 6 of the narrowest packs.
inline constexpr int lockstep_block_packs = 11 * lockstep_single_rows + lockstep_single_rows * (lockstep_single_rows - 1) / 2 + 6;
/// A world takes this path by its own rows alone.
template <class Rows>
KOKKOS_INLINE_FUNCTION bool goes_in_lockstep(Rows const& rows, int world) {
  return rows.count(world) <= lockstep_most_rows && rows.largest_element(world) <= lockstep_rows;
}
/// Whether small worlds may be solved as a whole, all trees stopping together: where some may sleep, the bits of the others would hang on
/// them.
template <class Rows>
KOKKOS_INLINE_FUNCTION bool goes_as_a_whole(Rows const& rows) {
  return !rows.may_sleep || rows.islands.ntree <= 1;
}
/// Packs that such worlds need: z, twice, and the entries by whole groups of four dofs, and the blocks.
inline std::int64_t lockstep_packs(int nv) {
  return std::int64_t(nv + 3) / 4 * 4 * (2 + lockstep_most_block_rows) + lockstep_most_blocks * lockstep_block_packs;
}
template <class R, class Mem>
struct NotMeasured {
  Kokkos::View<R*, Kokkos::LayoutRight, Mem> residual;
  KOKKOS_FUNCTION void operator()(int w) const { residual(w) = Kokkos::Experimental::quiet_NaN_v<R>; }
};
}  // namespace detail

/// Room for what is found in `worlds` worlds. Allocates.
template <class R, ExecutionSpace Exec, class Mem>
Solution<R, Mem> make_solution(Exec const& exec, Model<R, Mem> const& model, SolutionOptions options = {}) {
  static_assert(can_access<Exec, Kokkos::View<R*, Mem>>, "gsp::make_solution: the model is not accessible from this execution space");
  expects(options.worlds > 0, "gsp::make_solution: worlds must be positive and is " + std::to_string(options.worlds));
  Solution<R, Mem> s;
  auto const make = [&](auto& v, char const* label, auto... items) {
    v = detail::allocate_zero<std::decay_t<decltype(v)>>(exec, label, items...);
  };
  s.worlds = options.worlds;
  s.nv = model.nv;
  make(s.z, "gsp::Solution::z", s.worlds, s.nv);
  make(s.z_before, "gsp::Solution::z_before", s.worlds, s.nv);
  make(s.qfrc_constraint, "gsp::Solution::qfrc_constraint", s.worlds, s.nv);
  make(s.residual, "gsp::Solution::residual", s.worlds);
  Kokkos::parallel_for("gsp::solver::make_solution", Kokkos::RangePolicy<Exec>(exec, 0, s.worlds), detail::NotMeasured<R, Mem>{s.residual});
  make(s.iterations, "gsp::Solution::iterations", s.worlds);
  if constexpr (!is_device<Exec>)
    if (s.nv <= detail::lockstep_most_dofs) {
      s.thread_stride = detail::lockstep_packs(s.nv) * native_width<R>;
      make(s.thread_items, "gsp::Solution::thread_items", s.thread_stride * Kokkos::DefaultHostExecutionSpace().concurrency());
    }
  return s;
}

}  // namespace gsp
