#pragma once
#include <gsp/constraint/islands.hpp>
#include <gsp/dynamics/lanes.hpp>

/// Constraint rows of many worlds in one pool, whitened with the matrix M^ = L^T D L that moves the robot:
///   Y = J L^-1 D^-1/2,   z = sum Y^T p,   J v+ = J v^ + Y z,   v+ = v^ + L^-1 D^-1/2 z
/// so that J M^^-1 J^T = Y Y^T is never formed: a row costs 4 flop an entry and sweep, and has the sparsity of J (L keeps ancestors).
/// A row touches one or two trees. On each its entries stand for the ancestors of one dof (a chain: contacts, limits) or for all dofs of
/// the tree (two branches of one robot, tendons).
/// The rows of an element (a contact, a limit: 1-6 rows) lie side by side; what the solver takes at a time is an element.
namespace gsp {

inline constexpr int most_element_rows = 6;
inline constexpr int most_constraint_types = 32;

/// Bounds beyond it are none: a solver's infinity, in any precision [N s].
template <class R>
KOKKOS_INLINE_FUNCTION bool is_no_bound(R bound) {
  return abs(bound) >= R(1e30);
}

/// Entries of a row on one tree: for the dofs dof0 + dof_lists(list + i) of the world, or dof0 + i where list < 0. dof0 is the tree's
/// first.
struct RowSegment {
  int list, count, dof0;
};

/// Which impulses a row may have: between lower and upper; or, where friction_of >= 0, +-mu times the absolute impulse of row `friction_of`
/// of the same element, which may stand before or after it; or, where it goes with the next row, which names the same `friction_of`, the
/// two together in an ellipse, a disc where their mu are equal:
///   (p_r / mu_r)^2 + (p_{r+1} / mu_{r+1})^2 <= p_{friction_of}^2
template <class R>
struct RowBounds {
  R lower, upper;
  int friction_of = -1;
  R mu = R(0);
  bool with_next = false;
  // Friction that is bounded by itself, which `noslip` lets stick: between lower and upper; or where it pushes alone one of two rows side
  // by side, of one element or of two, over the same dofs, of which it keeps the sum (opposing edges of a pyramid).
  bool dry = false;
  KOKKOS_INLINE_FUNCTION static RowBounds dry_between(R lower, R upper) {
    RowBounds bounds{lower, upper};
    bounds.dry = true;
    return bounds;
  }
  /// Any impulse: an equality, a spring.
  KOKKOS_INLINE_FUNCTION bool is_free() const {
    return friction_of < 0 && lower < R(0) && is_no_bound(lower) && upper > R(0) && is_no_bound(upper);
  }
  /// p >= 0
  KOKKOS_INLINE_FUNCTION bool pushes_alone() const { return friction_of < 0 && lower == R(0) && upper > R(0) && is_no_bound(upper); }
};

template <class R>
struct alignas(16) Row {     // GPUs load four numbers at once
  RowSegment segment[2];     // without entries (count = 0) where it touches fewer trees
  std::int64_t first_entry;  // in Rows::Y
  R bias, compliance;        // w = Y z + C p + b
  R inverse_diagonal;        // 1 / (|Y|^2 + C), of two rows together: a step for both; 0: rigid, and nothing that it touches can move
  R lower, upper, mu;        // mu < 0: without friction
  int element;               // k of its type
  unsigned char type;        // place of the element's type in the list of types
  signed char friction_of;   // row of the element, -1: lower and upper
  bool with_next : 1;        // bounded together with the next row
  bool dry : 1;              // RowBounds::dry
  bool same_segments : 1;    // first row of an element: whether all of its rows have the segments of the first
  bool eliminated : 1;       // solvers leave it out (constraint/eliminate.hpp)
};
static_assert(sizeof(Row<float>) == 64, "one cache line");

/// What `impacts` (solver/impacts.hpp) knows of a row.
template <class R>
struct RowImpact {
  R restitution;  // share of the rate of an impact that comes back; 0: none
  R rate;         // J v at the start of the step, and after the impacts that were found
  R target;       // zeta
  R forces;       // half of what the step's forces make of the rate
};

namespace detail {
/// Names of the types, in the order of the list.
struct TypeNames {
  std::uint32_t name[most_constraint_types] = {};
  int count = 0;
};
struct RowsStamp {
  std::uint64_t made = 0;      // which `assemble` has written them; 0: none
  std::uint64_t contacts = 0;  // and which contacts it has read (ContactsStamp::made); 0: none that gsp has found
  int contact_elements = 1;    // of each of them (ContactRows::elements)
  bool pyramids = false;       // whose rows are edges
  bool impacts_left = false;   // rows may bounce, and `impacts` has not been called
  bool sleeps = false;         // those of islands that sleep are left out
  Stamp state = {};            // of which state they are
  TypeNames types = {};        // of the list
};
}  // namespace detail

/// What `assemble` writes.
template <class R, class Mem>
struct Rows {
  using real_type = R;
  using memory_space = Mem;
  template <class D>
  using View = Kokkos::View<D, Kokkos::LayoutRight, Mem>;
  int worlds = 0, nv = 0;
  Profile profile = Profile::stable;         // of the model: whose problem they are
  int most_eliminated = 0;                   // rows that are eliminated in a world, at most; 0: none is
  double friction_time = 0;                  // RowsOptions
  View<int*> first, count;                   // (worlds) rows of a world
  View<int*> kept;                           // (worlds) after them, rows of islands that sleep: type, element and impulse alone
  View<int*> largest_element;                // (worlds) most rows of an element, at least 3: what solvers make room for
  View<int*> eliminated;                     // (worlds) rows that are eliminated
  View<R*> rate_scale;                       // (worlds) what gravity does in a step, |g| h [m/s]; of standard gravity where there is none
  View<R**> tree_mass;                       // (worlds, ntree) mass of a tree, of the first of an island that of the island [kg]
  View<std::int64_t*> first_entry, entries;  // (worlds) of Y
  View<Row<R>*> row;                         // (capacity)
  View<RowImpact<R>*> impact;                // (capacity) empty where no row has a restitution
  View<signed char*> element_rows;           // (capacity) rows of the element that begins here; 0 inside of one
  View<int*> world_of;                       // GPUs, (capacity) the world of a row
  View<int*> laid_out;                       // GPUs, (capacity) where the elements that are laid out begin, in any order
  Kokkos::View<int, Mem> laid_out_count;     // GPUs: how many these are
  View<R*> Y;  // (capacity of entries) an element's couplings Y_b . Y_a, a < b: b (b - 1) / 2 + a, then its rows' entries; last
               // of a world what eliminated rows do to all, (most_eliminated, count)
  View<std::int64_t*> demand;  // (2) rows and entries that the last step needed, or one since they grew that needed more than there is
  View<int const*> dof_lists;  // what the segments' lists lie in
  Islands<Mem> islands;        // which trees are one, and room to list what each island has, for solvers
  detail::SharedStamp<detail::RowsStamp> stamp;  // host: which call has written them (dynamics/stamps.hpp)

  KOKKOS_INLINE_FUNCTION int capacity() const { return int(row.extent(0)); }
  /// Mass of the island that row r of world w belongs to [kg]; 0 where its first segment has no dof.
  KOKKOS_INLINE_FUNCTION R island_mass(int w, Row<R> const& r) const {
    return r.segment[0].count > 0 ? tree_mass(w, islands.label(w)[islands.dof_tree(r.segment[0].dof0)]) : R(0);
  }
};

struct RowsOptions {
  int worlds = 1;
  int rows_per_world = 0, entries_per_world = 0;  // hints, 0: a guess from the model; the pools grow
  bool eliminate = true;                          // equality constraints inside of a tree, in profile stable (constraint/eliminate.hpp)
  bool impacts = false;                           // some rows may have a restitution, in profile stable (solver/impacts.hpp)
  // Profile stable: friction of contacts holds as a spring on which a mass of 1 / |Y|^2 swings once in 2 pi times so long [s], without
  // creep: with 1.5e-3 crowded worlds take fewer sweeps (docs/decisions/0025). 0: it sticks at once.
  double friction_time = 0;
};

namespace detail {
/// There are some: what a tile that shares has (step/tiles.hpp) is lent to it.
template <class R, class Mem>
void expects_room(char const* where, Rows<R, Mem> const& rows) {
  if (rows.worlds == 0)
    throw std::invalid_argument(std::string(where) +
                                ": the rows have no worlds: make_rows (or make_simulation); what tiles share they have in for_tiles alone");
}
/// At least n items; what there was is kept.
template <class Exec, class View>
void enlarge(Exec const& exec, View& v, char const* label, std::int64_t n) {
  if (std::int64_t(v.extent(0)) >= n) return;
  auto const next = allocate_zero<View>(exec, label, n);
  copy_bytes(exec, next.data(), v.data(), bytes_of(v));
  v = next;
}
template <class R, class Mem, class Exec>
void allocate_rows(Exec const& exec, Rows<R, Mem>& r, std::int64_t rows, std::int64_t entries) {
  if (rows > std::numeric_limits<int>::max())
    throw Error("gsp::Rows: more than 2147483647 constraint rows are asked for: use fewer worlds a batch");
  enlarge(exec, r.element_rows, "gsp::Rows::element_rows", rows);
  if (is_device<Exec>) {
    enlarge(exec, r.world_of, "gsp::Rows::world_of", rows);
    enlarge(exec, r.laid_out, "gsp::Rows::laid_out", rows);
  }
  if (r.impact.data()) enlarge(exec, r.impact, "gsp::Rows::impact", rows);
  enlarge(exec, r.islands.elements, "gsp::Islands::elements", rows);
  enlarge(exec, r.islands.keys, "gsp::Islands::keys", rows);
  enlarge(exec, r.Y, "gsp::Rows::Y", entries);
  enlarge(exec, r.row, "gsp::Rows::row", rows);  // last: it says how much room there is, and each of these may throw
}
}  // namespace detail

/// Pools for the rows of `worlds` worlds. Allocates. Errors: std::invalid_argument for worlds < 1, a friction_time that is negative, NaN or
/// of profile mujoco; gsp::Error for pools of 2^31 rows or more.
template <class R, ExecutionSpace Exec, class Mem>
Rows<R, Mem> make_rows(Exec const& exec, Model<R, Mem> const& model, RowsOptions options = {}) {
  static_assert(can_access<Exec, Kokkos::View<R*, Mem>>, "gsp::make_rows: the model is not accessible from this execution space");
  expects(options.worlds > 0, "gsp::make_rows: worlds must be positive and is " + std::to_string(options.worlds));
  expects(options.friction_time >= 0, "gsp::make_rows: friction_time must be a number, 0 or more");
  expects(options.friction_time == 0 || model.profile == Profile::stable,
          "gsp::make_rows: friction_time is of profile stable: leave it out, friction of profile mujoco is soft as the file says");
  Rows<R, Mem> r;
  int const n = options.worlds;
  auto const make = [&](auto& v, char const* label, int items) {
    v = detail::allocate_zero<std::decay_t<decltype(v)>>(exec, label, items);
  };
  r.worlds = n;
  r.nv = model.nv;
  r.profile = model.profile;
  r.friction_time = options.friction_time;
  r.most_eliminated = options.eliminate ? model.closing_rows : 0;
  r.dof_lists = model.ints;
  r.islands = detail::make_islands(exec, model, n);
  r.stamp = detail::make_stamp<detail::RowsStamp>("gsp::Rows::stamp");
  make(r.first, "gsp::Rows::first", n);
  make(r.count, "gsp::Rows::count", n);
  make(r.kept, "gsp::Rows::kept", n);
  make(r.largest_element, "gsp::Rows::largest_element", n);
  make(r.eliminated, "gsp::Rows::eliminated", n);
  make(r.rate_scale, "gsp::Rows::rate_scale", n);
  r.tree_mass = detail::allocate_zero<decltype(r.tree_mass)>(exec, "gsp::Rows::tree_mass", n, model.ntree);
  make(r.first_entry, "gsp::Rows::first_entry", n);
  make(r.entries, "gsp::Rows::entries", n);
  make(r.demand, "gsp::Rows::demand", 2);
  if (is_device<Exec>) r.laid_out_count = detail::allocate_zero<decltype(r.laid_out_count)>(exec, "gsp::Rows::laid_out_count");
  if (options.impacts && model.profile == Profile::stable) make(r.impact, "gsp::Rows::impact", 1);
  bool const stiff = detail::any_archetype(model, [](Archetype const& a) { return a.stiff; });
  std::int64_t const rows =
      options.rows_per_world > 0
          ? options.rows_per_world
          : 12 * model.ntree + int(model.limited_joints.extent(0) + model.friction_dofs.extent(0)) + (stiff ? model.nu + model.ntendon : 0);
  std::int64_t const entries = options.entries_per_world > 0 ? options.entries_per_world : rows * std::max(8, std::min(model.nv + 1, 12));
  detail::allocate_rows(exec, r, std::max<std::int64_t>(rows, 1) * n, std::max<std::int64_t>(entries, 1) * n);
  return r;
}

}  // namespace gsp
