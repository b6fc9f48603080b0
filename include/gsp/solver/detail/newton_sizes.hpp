#pragma once
#include <Kokkos_Core.hpp>
#include <cstdint>

/// How much near memory an island takes in `newton` (newton_island.hpp), and by what it takes GPUs list it.
namespace gsp::detail {

// Tiles of a matrix are of 4 x 4 numbers, and lie no closer than an odd number of fours, so that neighbouring threads of a GPU find theirs
// in different banks.
inline constexpr int newton_tile = 4, newton_tile_stride = newton_tile * newton_tile + newton_tile;
inline constexpr int newton_near_numbers = 1 << 16;  // of a host's thread: 256 kB in float, which second-level caches hold
/// Numbers of an island: of a row of Y an odd number of fours, for the same reason. What cones take is there where the island has some.
/// @tparam at_once  rows that a host takes at once: their number is filled up to a multiple of it
template <class R, int at_once>
struct NewtonSizes {
  int rows, dofs, fours, stride, tiles, filled;
  bool cones;
  KOKKOS_FORCEINLINE_FUNCTION NewtonSizes(int row_count, int dof_count, bool has_cones)
      : rows(row_count),
        dofs(dof_count),
        fours((dof_count + newton_tile - 1) / newton_tile),
        stride(newton_tile * (fours | 1)),
        tiles(fours * (fours + 1) / 2),
        filled((row_count + at_once - 1) / at_once * at_once),
        cones(has_cones) {}
  static constexpr int of_row = 6, of_cone = 7, bytes_of_row = int(sizeof(short)), bytes_of_cone = int(sizeof(short)) + 2;
  KOKKOS_FORCEINLINE_FUNCTION std::int64_t bytes() const {
    std::int64_t const numbers = std::int64_t(rows) * (stride + (cones ? of_cone : 0)) + std::int64_t(filled) * of_row +
                                 std::int64_t(tiles) * newton_tile_stride + (3 * newton_tile + 1) * fours;
    return (numbers * std::int64_t(sizeof(R)) + std::int64_t(rows) * (bytes_of_row + (cones ? bytes_of_cone : 0)) + 15) / 16 * 16;
  }
  /// So that a row has a number of 16 bits.
  KOKKOS_FORCEINLINE_FUNCTION bool fits(std::int64_t most_bytes) const { return rows < 32768 && bytes() <= most_bytes; }
};

/// GPUs: islands are listed by how much they take, so that a block has no more than they need. Bytes of an island of a list, at most;
/// the list of an island of so many.
inline constexpr int newton_lists = 14;
KOKKOS_FORCEINLINE_FUNCTION std::int64_t newton_bytes_of_list(int list) {
  constexpr std::int64_t kilobytes[newton_lists] = {4, 6, 8, 10, 12, 14, 16, 20, 24, 32, 48, 72, 112, 227};
  return 1024 * kilobytes[list];
}
KOKKOS_FORCEINLINE_FUNCTION int newton_list_of(std::int64_t bytes) {
  int list = 0;
  while (list < newton_lists - 1 && newton_bytes_of_list(list) < bytes) ++list;
  return list;
}
// Those that no near memory holds (newton_sparse.hpp): their list, and how many threads take one.
inline constexpr int newton_sparse_list = newton_lists, newton_sparse_threads = 1024;
/// Where: islands list by list, then how many there are in each, and how many are taken.
template <class Mem>
struct NewtonLists {
  Kokkos::View<int*, Kokkos::LayoutRight, Mem> items;
  int islands = 0;  // of all worlds, at most
  static constexpr int lists = newton_lists + 1;
  static std::int64_t size(std::int64_t islands) { return lists * (islands + 2); }
  struct Island {
    int number;
    bool cones;
  };
  KOKKOS_FORCEINLINE_FUNCTION Island island(int list, int i) const {
    int const item = items(std::int64_t(list) * islands + i);
    return {item / 2, item % 2 != 0};
  }
  KOKKOS_FORCEINLINE_FUNCTION int* counts() const { return items.data() + std::int64_t(lists) * islands; }  // 2 lists of them
  KOKKOS_FORCEINLINE_FUNCTION int& count(int list) const { return counts()[list]; }
  KOKKOS_FORCEINLINE_FUNCTION int& taken(int list) const { return counts()[lists + list]; }
  KOKKOS_FORCEINLINE_FUNCTION void add(int list, int number, bool cones) const {
    items(std::int64_t(list) * islands + Kokkos::atomic_fetch_add(&count(list), 1)) = 2 * number + (cones ? 1 : 0);
  }
};

}  // namespace gsp::detail
