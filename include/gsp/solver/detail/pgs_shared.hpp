#pragma once
#include <gsp/constraint/impulses.hpp>
#include <gsp/solver/detail/leap.hpp>
#include <gsp/solver/detail/pgs_options.hpp>
#include <gsp/solver/detail/row_vectors.hpp>
#include <gsp/solver/project_element.hpp>
#include <gsp/solver/solution.hpp>

/// Projected Gauss-Seidel for small worlds on a GPU: eight threads a world, four worlds a warp, with rows, entries, impulses and z in
/// shared memory from the first sweep to the last. What bounds a sweep is the chain from z to z of one element after the other; four worlds
/// share the instructions of it. Eight threads whose world has ended take the next one, whatever their neighbours do. A world takes this
/// path by its own rows alone, and nothing that it computes hangs on when, where or beside which others it is solved.
namespace gsp::detail {

// A world has so much shared memory at most, four of them what a block may have on all GPUs since Ampere (99 kB). The worlds of a size are
// solved by a launch whose blocks have room for four of them: smaller ones leave room for more at a time.
inline constexpr int shared_most_bytes = 24576;
inline constexpr int shared_rows = 3;  // of an element, at most
KOKKOS_INLINE_FUNCTION constexpr int shared_size(int size_class) {
  constexpr int size[shared_sizes] = {1792, 2560, 3584, 4352, 5120, 7168, 12288, shared_most_bytes};
  return size[size_class];
}

/// What is known of a row but its entries and its numbers.
struct alignas(8) SharedRow {
  unsigned short entry;     // the first of its entries, and of the list of their dofs
  unsigned char count;      // entries
  signed char friction_of;  // as in Row
  unsigned char rows;       // of the element that begins here
  bool with_next : 1, same_segments : 1;
  bool simple : 1;  // of this row, between bounds of its own, and none or two in its ellipse, all with the same segments
};
static_assert(sizeof(SharedRow) == 8);
template <class R>
struct alignas(4 * sizeof(R)) SharedNumbers {
  R bias, compliance, inverse_diagonal, diagonal;  // 1 / inverse_diagonal, 0 where that is 0
  R lower, upper;                                  // where friction_of >= 0: lower is mu
  R p, before;                                     // impulse, and that before the last sweep
};

/// Bytes of a world: SharedNumbers, z and z before the last sweep, entries; SharedRow, the order of the elements, dofs of entries.
template <class R, class Mem>
KOKKOS_INLINE_FUNCTION std::int64_t shared_bytes(Rows<R, Mem> const& rows, int w) {
  std::int64_t const count = rows.count(w), entries = rows.entries(w) - rows.most_eliminated * count;
  return (count * std::int64_t(sizeof(SharedNumbers<R>) + sizeof(SharedRow) + 1) + entries * std::int64_t(sizeof(R) + 1) +
          2 * std::int64_t(sizeof(R)) * rows.nv + 64) /
         32 * 32;
}
/// Whether a world is solved this way, rather than by a whole warp (pgs_world.hpp).
template <class R, class Mem>
KOKKOS_INLINE_FUNCTION bool fits_shared(Rows<R, Mem> const& rows, int w) {
  return rows.nv <= lockstep_most_dofs && goes_in_lockstep(rows, w) && rows.largest_element(w) <= shared_rows &&
         shared_bytes(rows, w) <= shared_most_bytes;
}
/// The least size that has room for so many bytes.
KOKKOS_INLINE_FUNCTION int shared_size_of(std::int64_t bytes) {
  int c = 0;
  while (shared_size(c) < bytes) ++c;
  return c;
}

template <class R, class Mem>
struct PgsShared {
  Rows<R, Mem> rows;
  Impulses<R, Mem> impulses;
  Solution<R, Mem> solution;
  PgsOptions options;
  Kokkos::View<int, Mem> halt;
};

/// All worlds that fit.
template <class Exec, class R, class Mem>
void launch_pgs_shared(Exec const& exec, PgsShared<R, Mem> const& solver);

}  // namespace gsp::detail

#if defined(KOKKOS_ENABLE_CUDA) && defined(__CUDACC__)
#include <gsp/solver/detail/pgs_shared_cuda.hpp>
#endif
