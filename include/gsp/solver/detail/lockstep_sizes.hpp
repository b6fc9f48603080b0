#pragma once
#include <Kokkos_Core.hpp>
#include <cstdint>
#include <gsp/constraint/rows.hpp>

/// Which worlds are small, and go together through the sweeps (pgs_lockstep.hpp on hosts, pgs_delassus.hpp on GPUs), and the room of a pack
/// of them.
namespace gsp::detail {

// Worlds of at most so many rows and dofs.
inline constexpr int lockstep_most_rows = 128, lockstep_most_dofs = 128;
// A pack in which no element has more rows than these goes in blocks for so many (pgs_lockstep.hpp); others in blocks for all elements.
inline constexpr int lockstep_few_rows = 3, lockstep_rows = most_element_rows;
// Blocks have an element of one row and one of more; one of more; or four of one row. A world has at most half as many of more as rows; and
// where one world of a pack has the most elements of two rows and another the most of one, there is room for both.
inline constexpr int lockstep_most_blocks = lockstep_most_rows / 2 + lockstep_most_rows / 4;
KOKKOS_INLINE_FUNCTION constexpr int lockstep_most_block_rows(int of_element) {
  return lockstep_most_rows / 2 * of_element + lockstep_most_rows / 2 + lockstep_most_rows;
}
// What is known of a block but its entries: 16 numbers a row and the products of its rows; all else takes 6 of the narrowest packs.
KOKKOS_INLINE_FUNCTION constexpr int lockstep_block_packs(int rows) { return 16 * rows + rows * (rows - 1) / 2 + 6; }
// GPUs sort worlds by the room that they need (pgs_delassus.hpp).
inline constexpr int delassus_lists = 10;
/// A world takes this path by its own rows alone.
template <class Rows>
KOKKOS_INLINE_FUNCTION bool goes_in_lockstep(Rows const& rows, int world) {
  return rows.count(world) <= lockstep_most_rows;
}
/// Whether small worlds may be solved as a whole, all trees stopping together: where some may sleep, the bits of the others would hang on
/// them.
template <class Rows>
KOKKOS_INLINE_FUNCTION bool goes_as_a_whole(Rows const& rows) {
  return !rows.may_sleep || rows.islands.ntree <= 1;
}
/// Packs that such worlds need: z, twice, and the entries by whole groups of four dofs, and the blocks.
inline std::int64_t lockstep_packs(int nv) {
  return std::int64_t(nv + 3) / 4 * 4 * (2 + lockstep_most_block_rows(lockstep_rows)) +
         lockstep_most_blocks * lockstep_block_packs(1 + lockstep_rows);
}

}  // namespace gsp::detail
