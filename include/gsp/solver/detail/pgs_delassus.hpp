#pragma once
#include <algorithm>
#include <gsp/constraint/impulses.hpp>
#include <gsp/constraint/islands.hpp>
#include <gsp/solver/detail/pgs_options.hpp>
#include <gsp/solver/detail/row_vectors.hpp>
#include <gsp/solver/solution.hpp>

/// Projected Gauss-Seidel for small islands on a GPU: a warp each, over their Delassus matrix,
///   w = A p + b,   A = Y Y^T + C
/// in shared memory from the first sweep to the last. What bounds a sweep is the chain from one element to the next; here it is shorter
/// than over whitened rows (docs/decisions/0030). An island takes this path by its own rows and dofs alone, and nothing that it computes
/// hangs on when, where or beside which others it is solved.
namespace gsp::detail {

/// What is known of a row beside its numbers, in the order of the sweeps.
struct alignas(4) DelassusRow {
  unsigned char rows;       // of the element that begins here
  signed char friction_of;  // as in Row
  bool with_next : 1;
  bool contact : 1;  // of this row, which pushes, and two in its ellipse: what has a function of its own
};
template <class R>
struct alignas(4 * sizeof(R)) DelassusLaw {
  R step;          // -relaxation / (|Y|^2 + C), or that of two rows together
  R lower, upper;  // of friction: mu in place of lower
  R p;             // impulse
};

/// 1 / sqrt(x) of x > 0; of less than the least normal number, as of that: it is spared what CUDA does to be right there.
template <class R>
KOKKOS_FORCEINLINE_FUNCTION R inverse_root(R x) {
#ifdef __CUDA_ARCH__
  if constexpr (std::is_same_v<R, float>) {
    float root;
    asm("rsqrt.approx.ftz.f32 %0, %1;" : "=f"(root) : "f"(fmaxf(x, Kokkos::Experimental::norm_min_v<float>)));
    return root;
  }
#endif
  return Kokkos::rsqrt(x);
}
/// Two impulses of friction back into their ellipse, as project_ellipse takes them.
/// @param normal  absolute impulse of the row that they hang on
template <class R>
KOKKOS_FORCEINLINE_FUNCTION void into_ellipse(R mu1, R mu2, R normal, R& p1, R& p2) {
  R const q1 = p1 * mu2, q2 = p2 * mu1, r2 = fma(q1, q1, q2 * q2), radius = mu1 * mu2 * normal;
  if (!(r2 > radius * radius)) return;
  R const scale = radius * inverse_root(r2);
  p1 = scale * p1;
  p2 = scale * p2;
}

inline constexpr int delassus_beyond = lockstep_most_rows;  // numbers behind the matrix that threads without a row read
// What a block may have on all GPUs since Ampere: 128 rows of float, 96 of double.
inline constexpr std::int64_t delassus_most_bytes = 99 * 1024;

/// Dofs of Y that are there at a time: islands of many rows leave room for the matrices of others.
KOKKOS_INLINE_FUNCTION constexpr int delassus_dofs(int rows, int nv) {
  int const most = rows > 64 ? 8 : 32;
  return nv < most ? nv : most;
}
/// Numbers from one row of the matrix to the next.
KOKKOS_INLINE_FUNCTION constexpr int delassus_stride(int rows) { return (rows + 3) / 4 * 4; }
/// A is symmetric. Where islands of many rows wait, twice as many as fit, they keep its lower triangle alone, line by line, and a line of
/// zeros for threads without a row: nearly twice as many fit, which is worth the arithmetic that finds an entry. The numbers are the same.
KOKKOS_INLINE_FUNCTION constexpr int triangle_line(int row) { return row * (row + 1) / 2; }
/// Numbers of the matrix: whole groups of four.
KOKKOS_INLINE_FUNCTION constexpr int delassus_matrix(int rows, bool triangle) {
  return triangle ? (triangle_line(rows + 1) + 3) / 4 * 4 : delassus_stride(rows) * rows + delassus_beyond;
}
/// Shared memory of an island: laws, the matrix, Y of some dofs, DelassusRow and one beyond the last.
template <class R>
KOKKOS_INLINE_FUNCTION constexpr std::int64_t delassus_bytes(int rows, int nv, bool triangle = false) {
  return (delassus_stride(rows) * std::int64_t(4 + delassus_dofs(rows, nv)) + delassus_matrix(rows, triangle)) * std::int64_t(sizeof(R)) +
         (rows + 1) * std::int64_t(sizeof(DelassusRow));
}
/// Of a list: blocks have room for its largest (lockstep_sizes.hpp).
template <class R>
KOKKOS_INLINE_FUNCTION constexpr std::int64_t delassus_bytes_of_list(int list, int nv, bool triangle = false) {
  return delassus_bytes<R>(rows_of_list(list), nv < lockstep_most_dofs ? nv : lockstep_most_dofs, triangle);
}
template <class R, class Mem>
KOKKOS_INLINE_FUNCTION bool delassus_takes(Rows<R, Mem> const& rows, Island const& island) {
  return is_small(island.rows, island.dofs) && delassus_bytes_of_list<R>(list_of_rows(island.rows), rows.nv) <= delassus_most_bytes;
}

/// Islands of list k stand in Solution::listed behind those of the lists before, which have more rows: first those of worlds whose last
/// step took many sweeps, as they may again: what is long begins first. Solution::list_counts(k): how many of either kind there are, how
/// many have been listed, and how many have been taken. Behind the lists of small ones, that of all others, and two more for what is
/// taken of it by blocks that take larger ones (pgs_sparse_cuda.hpp).
enum DelassusCount { many_sweeps, few_sweeps, many_listed, few_listed, taken };

template <class R, class Mem>
struct PgsDelassus {
  Rows<R, Mem> rows;
  Impulses<R, Mem> impulses;
  Solution<R, Mem> solution;
  PgsOptions options;
  Kokkos::View<int, Mem> halt;
};

/// All islands that it takes, and those that pgs_sparse_cuda.hpp takes. Solution::left says which are left.
template <class Exec, class R, class Mem>
void launch_pgs_delassus(Exec const& exec, PgsDelassus<R, Mem> const& solver);

}  // namespace gsp::detail

#if defined(KOKKOS_ENABLE_CUDA) && defined(__CUDACC__)
#include <gsp/solver/detail/pgs_delassus_cuda.hpp>
#endif
