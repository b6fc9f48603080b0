#pragma once
#include <Kokkos_Core.hpp>
#include <cstdint>
#include <gsp/constraint/rows.hpp>

/// Which islands are small, and go together through the sweeps (pgs_lockstep.hpp on hosts, pgs_delassus.hpp on GPUs), and the room of a
/// pack of them.
namespace gsp::detail {

// Islands of at most so many rows and dofs.
inline constexpr int lockstep_most_rows = 128, lockstep_most_dofs = 128;
// A pack in which no element has more rows than these goes in blocks for so many (pgs_lockstep.hpp); others in blocks for all elements.
inline constexpr int lockstep_few_rows = 3, lockstep_rows = most_element_rows;
// Blocks have an element of one row and one of more; one of more; or four of one row. An island has at most half as many of more as rows;
// and where one of a pack has the most elements of two rows and another the most of one, there is room for both.
inline constexpr int lockstep_most_blocks = lockstep_most_rows / 2 + lockstep_most_rows / 4;
KOKKOS_INLINE_FUNCTION constexpr int lockstep_most_block_rows(int of_element) {
  return lockstep_most_rows / 2 * of_element + lockstep_most_rows / 2 + lockstep_most_rows;
}
// What is known of a block but its entries: 16 numbers a row and the products of its rows; all else takes 6 of the narrowest packs.
KOKKOS_INLINE_FUNCTION constexpr int lockstep_block_packs(int rows) { return 16 * rows + rows * (rows - 1) / 2 + 6; }
// Islands are sorted by their rows, so that those that go together are alike: into lists of up to so many.
inline constexpr int island_lists = 10;
KOKKOS_INLINE_FUNCTION constexpr int rows_of_list(int list) {
  constexpr int most[island_lists] = {16, 24, 32, 40, 52, 64, 80, 96, 112, lockstep_most_rows};
  return most[list];
}
KOKKOS_INLINE_FUNCTION constexpr int list_of_rows(int rows) {
  int list = 0;
  while (rows_of_list(list) < rows) ++list;
  return list;
}
/// An island takes this path by what it is alone.
KOKKOS_INLINE_FUNCTION bool is_small(int rows, int dofs) { return rows <= lockstep_most_rows && dofs <= lockstep_most_dofs; }
/// Whether a world of so many trees and dofs may have any: a world of one tree is one island.
KOKKOS_INLINE_FUNCTION constexpr bool any_small(int ntree, int nv) { return ntree > 1 || nv <= lockstep_most_dofs; }
/// Packs that such islands need in a model of nv dofs: z, twice, and the entries by whole groups of four dofs, and the blocks.
inline std::int64_t lockstep_packs(int nv) {
  nv = nv < lockstep_most_dofs ? nv : lockstep_most_dofs;
  return std::int64_t(nv + 3) / 4 * 4 * (2 + lockstep_most_block_rows(lockstep_rows)) +
         lockstep_most_blocks * lockstep_block_packs(1 + lockstep_rows);
}

}  // namespace gsp::detail
