#pragma once
#include <Kokkos_Core.hpp>
#include <cstdint>

/// Kernels over (rows, n) items, whose number may be beyond an int's.
namespace gsp::detail {

/// Items 0 .. rows n - 1.
template <class Exec>
using LongRange = Kokkos::RangePolicy<Exec, Kokkos::IndexType<std::int64_t>>;
template <class Exec>
LongRange<Exec> long_range(Exec const& exec, int rows, int n) {
  return {exec, 0, std::int64_t(rows) * n};
}

/// item = row n + column.
struct RowColumn {
  int row, column;
};
KOKKOS_INLINE_FUNCTION RowColumn row_column(std::int64_t item, int n) {
  if (item >> 32 == 0) {  // a GPU divides 32 bits in a few instructions, 64 in a hundred
    auto const i = std::uint32_t(item), row = i / std::uint32_t(n);
    return {int(row), int(i - row * std::uint32_t(n))};
  }
  std::int64_t const row = item / n;
  return {int(row), int(item - row * n)};
}

}  // namespace gsp::detail
