#pragma once
#include <gsp/dynamics/lanes.hpp>

/// Constraint rows of many worlds in one pool, whitened with the matrix M^ = L^T D L that moves the robot:
///   Y = J L^-1 D^-1/2,   z = sum Y^T p,   J v+ = J v^ + Y z,   v+ = v^ + L^-1 D^-1/2 z
/// so that J M^^-1 J^T = Y Y^T is never formed: a row costs 4 flop an entry and sweep, and has the sparsity of J (L keeps ancestors).
/// A row touches one or two trees. On each its entries stand for the ancestors of one dof (a chain: contacts, limits) or for all dofs of
/// the tree (two branches of one robot, tendons).
namespace gsp {

/// Entries of a row on one tree: for the dofs dof0 + ints[list + i] of the world, or dof0 + i where list < 0.
struct RowSegment {
  int tree, list, count, dof0;
};

/// Which dofs a row may hold impulses for. friction_of >= 0: +-mu times the impulse of row `friction_of` of the same element.
template <class R>
struct RowBounds {
  R lower, upper;
  int friction_of = -1;
  R mu = R(0);
};

template <class R>
struct Row {
  RowSegment segment[2];
  int segments;
  int friction_of;                                     // row of this world, -1: fixed bounds
  std::int64_t Y;                                      // first entry
  R bias, compliance, inverse_diagonal, lower, upper;  // w = Y z + C p + b;  friction: upper = mu
};

template <class R, class Mem>
struct Rows {
  using real_type = R;
  using memory_space = Mem;
  template <class D>
  using View = Kokkos::View<D, Kokkos::LayoutRight, Mem>;
  int worlds = 0;
  View<int*> first, count;                   // (worlds) rows of a world
  View<std::int64_t*> first_entry, entries;  // (worlds) of Y
  View<Row<R>*> row;                         // (capacity)
  View<R*> Y;                                // (capacity of entries)
  View<R*> impulse[2];                       // (capacity) p [N s], by parity: the last step's are the warm start
  View<std::uint64_t*> id[2];                // (capacity) type, element, feature: survives steps
  View<int*> first_of[2], count_of[2];       // (worlds) where a world's impulses lie, by parity
  View<R**> z;                               // (world, nv) whitened sum of impulses
  View<R*> residual;                         // (worlds) largest violation after the last sweep [m/s, rad/s] (pgs.hpp)
  View<int*> iterations;                     // (worlds) sweeps done
  View<int> parity, solved;                  // parity of this step's impulses; whether they have been solved for
  View<int> completed;                       // steps solved since somebody set it to 0
  View<int> halt;                            // not zero: something did not fit, the step has to be repeated
  View<std::int64_t*> demand;                // (2) rows and entries that the last step needed
  View<R*> thread_items;                     // hosts: room for a block of worlds a thread (solver/detail/pgs_lockstep.hpp)
  std::int64_t thread_stride = 0;

  KOKKOS_INLINE_FUNCTION int capacity() const { return int(row.extent(0)); }
};

struct RowsOptions {
  int worlds = 1;
  int rows_per_world = 0, entries_per_world = 0;  // hints, 0: a guess from the model; the pools grow
};

namespace detail {
// On hosts, worlds of at most so many rows and dofs are solved a pack at a time (solver/detail/pgs_lockstep.hpp).
inline constexpr int lockstep_most_rows = 128, lockstep_most_dofs = 128;
inline constexpr int lockstep_rows = 4;  // that go together
/// Packs that a block of such worlds needs: z by whole groups of four dofs, and Y. 0: the model has too many dofs.
inline std::int64_t lockstep_packs(int nv) {
  std::int64_t const width = (nv + 3) / 4 * 4;
  return nv > lockstep_most_dofs ? 0 : width + lockstep_most_rows * width;
}

template <class R, class Mem, class Exec>
void allocate_rows(Exec const& exec, Rows<R, Mem>& r, std::int64_t rows, std::int64_t entries) {
  if (rows > std::numeric_limits<int>::max())
    throw Error("gsp::Rows: more than 2147483647 constraint rows are asked for: use fewer worlds a batch");
  auto const grow = [&](auto& v, std::string const& label, std::int64_t n, bool keep) {
    if (std::int64_t(v.extent(0)) >= n) return;
    auto const next = allocate_zero<std::decay_t<decltype(v)>>(exec, label, n);
    if (keep) copy_bytes(exec, next.data(), v.data(), bytes_of(v));
    v = next;
  };
  grow(r.row, "gsp::Rows::row", rows, false), grow(r.Y, "gsp::Rows::Y", entries, false);
  for (int k = 0; k < 2; ++k) grow(r.impulse[k], "gsp::Rows::impulse", rows, true), grow(r.id[k], "gsp::Rows::id", rows, true);
}
}  // namespace detail

/// Pools for the rows of `worlds` worlds. Allocates.
template <class R, ExecutionSpace Exec, class Mem>
Rows<R, Mem> make_rows(Exec const& exec, Model<R, Mem> const& model, RowsOptions options = {}) {
  static_assert(can_access<Exec, Kokkos::View<R*, Mem>>, "gsp::make_rows: the model is not accessible from this execution space");
  expects(options.worlds > 0, "gsp::make_rows: worlds must be positive");
  using Out = Rows<R, Mem>;
  Out r;
  int const n = r.worlds = options.worlds;
  auto const make = [&](auto& v, std::string const& label, auto... extents) {
    v = detail::allocate_zero<std::decay_t<decltype(v)>>(exec, label, extents...);
  };
  make(r.first, "gsp::Rows::first", n), make(r.count, "gsp::Rows::count", n), make(r.first_entry, "gsp::Rows::first_entry", n),
      make(r.entries, "gsp::Rows::entries", n);
  for (int k = 0; k < 2; ++k) make(r.first_of[k], "gsp::Rows::first_of", n), make(r.count_of[k], "gsp::Rows::count_of", n);
  make(r.z, "gsp::Rows::z", n, model.nv), make(r.residual, "gsp::Rows::residual", n), make(r.iterations, "gsp::Rows::iterations", n);
  make(r.parity, "gsp::Rows::parity"), make(r.solved, "gsp::Rows::solved"), make(r.completed, "gsp::Rows::completed"),
      make(r.halt, "gsp::Rows::halt"), make(r.demand, "gsp::Rows::demand", 2);
  if constexpr (!is_device<Exec>) {
    r.thread_stride = detail::lockstep_packs(model.nv) * native_width<R>;
    make(r.thread_items, "gsp::Rows::thread_items", r.thread_stride * Kokkos::DefaultHostExecutionSpace().concurrency());
  }
  std::int64_t const rows = options.rows_per_world > 0
                                ? options.rows_per_world
                                : 12 * model.ntree + int(model.limited_joints.extent(0) + model.friction_dofs.extent(0));
  std::int64_t const entries = options.entries_per_world > 0 ? options.entries_per_world : rows * std::max(8, std::min(model.nv, 12));
  detail::allocate_rows(exec, r, std::max<std::int64_t>(rows, 1) * n, std::max<std::int64_t>(entries, 1) * n);
  return r;
}

/// Enlarges the pools by half beyond what the last `assemble` needed, where it did not fit, and lets the step be repeated (halt = 0).
/// Impulses for the warm start are kept. Fences `exec`. Returns whether anything grew.
template <ExecutionSpace Exec, class R, class Mem>
bool grow(Exec const& exec, Rows<R, Mem>& rows) {
  auto const demand = detail::to_host(exec, rows.demand);
  detail::zero(exec, rows.halt);
  bool const more_rows = demand[0] > rows.capacity(), more_entries = demand[1] > std::int64_t(rows.Y.extent(0));
  if (!more_rows && !more_entries) return false;
  detail::allocate_rows(exec, rows, more_rows ? demand[0] + demand[0] / 2 : 0, more_entries ? demand[1] + demand[1] / 2 : 0);
  return true;
}

}  // namespace gsp
