#pragma once
#include <gsp/constraint/detail/row_structure.hpp>
#include <gsp/constraint/detail/whiten_rows.hpp>

/// Rows of a world that a host makes together, one a lane of a pack: what `jacobian` says of a row is kept as forces on bodies, and one
/// pass over the dofs of their tree, from the leaves to the root, makes J, its products with the velocities, and Y of all lanes.
///   J_d = F_d . c_d,   F_d the forces on all that dof d moves, c_d its motion (cdof): a force goes from dof to parent, not to each
///   ancestor
/// A lane sees nothing of the others: what they touch and it does not stays 0.
namespace gsp::detail {

/// What a row's `jacobian` says, on a host.
template <class R, class Mem>
struct RowForces {
  static constexpr int most = 4;  // a contact has two forces, a ball joint three dofs; what comes after goes to the row's entries
  struct Force {
    int dof;  // of the world: the last that moves the body; it acts on this one and all before
    Spatial<R> force;
  };
  struct Entry {
    int dof;
    R value;
  };
  int count = 0, set = 0;
  Force force[most];
  Entry entry[most];
  bool entries = false;  // whether the row's entries in the pool hold a part of J
};

/// What `jacobian` writes it with (AnyRow).
template <class R, class Mem>
class ForceWriter {
 public:
  /// @param keeps  forces, or else all becomes entries
  KOKKOS_INLINE_FUNCTION ForceWriter(Model<R, Mem> const& model, Dynamics<R, Mem> const& dynamics, Row<R> const& row, R* J, int world,
                                     RowForces<R, Mem>& forces, bool keeps)
      : entries_{model, dynamics, row, J, world}, forces_(forces), keeps_(keeps) {
    forces_.count = forces_.set = 0;
    forces_.entries = false;
  }
  KOKKOS_INLINE_FUNCTION void set_dof(int dof, R value) const {
    if (keeps_ && forces_.set < forces_.most) {
      forces_.entry[forces_.set++] = {dof, value};
      return;
    }
    begin_entries();
    entries_.set_dof(dof, value);
  }
  KOKKOS_INLINE_FUNCTION void add_point(int body, Vec3<R> const& point, Vec3<R> const& direction, R scale = R(1)) const {
    int const dof = entries_.model.body_last_dof(body);
    if (dof < 0) return;
    if (!keeps_ || forces_.count == forces_.most) {
      begin_entries();
      return entries_.add_point(body, point, direction, scale);
    }
    auto const items = entries_.dynamics.factored(entries_.model, entries_.world, entries_.model.dof_tree(dof));
    Vec3<R> const arm = point - items.vec3(items.at.com + 3 * entries_.model.body_root(body)), f = scale * direction;
    forces_.force[forces_.count++] = {dof, {cross(arm, f), f}};
  }
  KOKKOS_INLINE_FUNCTION void add_rotation(int body, Vec3<R> const& direction, R scale = R(1)) const {
    int const dof = entries_.model.body_last_dof(body);
    if (dof < 0) return;
    if (!keeps_ || forces_.count == forces_.most) {
      begin_entries();
      return entries_.add_rotation(body, direction, scale);
    }
    forces_.force[forces_.count++] = {dof, {scale * direction, {R(0), R(0), R(0)}}};
  }

 private:
  KOKKOS_INLINE_FUNCTION void begin_entries() const {
    if (forces_.entries) return;
    for (int i = 0; i < entries_.row.segment[0].count + entries_.row.segment[1].count; ++i) entries_.J[i] = R(0);
    forces_.entries = true;
  }
  RowWriter<R, Mem> entries_;
  RowForces<R, Mem>& forces_;
  bool keeps_;
};

/// Segments of one tree, of up to as many rows as a pack has lanes. Rows get their entries and RowSums.
template <class R, class Mem>
class RowLanes {
 public:
  static constexpr int W = native_width<R>;
  using T = Pack<R, W>;
  static constexpr int most_dofs = 128;

  KOKKOS_INLINE_FUNCTION RowLanes(Model<R, Mem> const& model, Dynamics<R, Mem> const& dynamics, R* entries, int world)
      : model_(model), dynamics_(dynamics), entries_(entries), world_(world) {
    for (bool& t : touched_) t = false;
    for (bool& f : forced_) f = false;
  }
  /// Whether rows that touch it are kept as forces; entries of larger ones are made one after the other.
  KOKKOS_INLINE_FUNCTION static bool takes(Archetype const& a) { return a.nv <= most_dofs; }
  /// Takes segment s of a row in.
  KOKKOS_INLINE_FUNCTION void add(Row<R>& row, int s, RowForces<R, Mem> const& forces) {
    RowSegment const& segment = row.segment[s];
    int const tree = model_.dof_tree(segment.dof0);
    if (count_ == W || (count_ > 0 && tree != tree_)) finish();
    if (count_ == 0) begin(tree);
    int const lane = count_++;
    segment_[lane] = segment;
    y_[lane] = entries_ + row.first_entry + (s > 0 ? row.segment[0].count : 0);
    row_[lane] = &row;
    if (!takes(*archetype_)) return;
    if (lane == 0 || segment.list != segment_[lane - 1].list || segment.count != segment_[lane - 1].count)
      for (int i = 0; i < segment.count; ++i) touch(dof(segment, i));
    for (int k = 0; k < forces.count; ++k)
      if (int const d = forces.force[k].dof - segment.dof0; model_.dof_tree(forces.force[k].dof) == tree) {
        if (!forced_[d]) clear(force_[d]);
        forced_[d] = true;
        Spatial<R> const& f = forces.force[k].force;
        add_to(force_[d].angular, lane, f.angular);
        add_to(force_[d].linear, lane, f.linear);
      }
    if (forces.entries)
      for (int i = 0; i < segment.count; ++i) J_[dof(segment, i)].set(lane, y_[lane][i]);
    for (int k = 0; k < forces.set; ++k)
      if (int const d = forces.entry[k].dof; model_.dof_tree(d) == tree) {
        T& J = J_[d - segment.dof0];
        J.set(lane, J[lane] + forces.entry[k].value);
      }
  }
  /// What was taken in: entries are those of Y then, and sums are complete.
  KOKKOS_INLINE_FUNCTION void finish() {
    if (count_ == 0) return;
    FactorItems<R> const items = dynamics_.factored(model_, world_, tree_);
    if (takes(*archetype_))
      together(items);
    else
      for (int k = 0; k < count_; ++k) one(items, k);
    count_ = 0;
  }

 private:
  KOKKOS_INLINE_FUNCTION int dof(RowSegment const& segment, int i) const { return segment.list < 0 ? i : model_.ints(segment.list + i); }
  KOKKOS_INLINE_FUNCTION void begin(int tree) {
    tree_ = tree;
    archetype_ = &model_.archetypes(model_.tree_archetype(tree));
  }
  KOKKOS_INLINE_FUNCTION void touch(int d) {
    if (touched_[d]) return;
    touched_[d] = true;
    y_of_[d] = J_[d] = T(R(0));
  }
  KOKKOS_INLINE_FUNCTION static void clear(Spatial<T>& f) {
    T const zero(R(0));
    f = {{zero, zero, zero}, {zero, zero, zero}};
  }
  KOKKOS_INLINE_FUNCTION static void add_to(Vec3<T>& to, int lane, Vec3<R> const& v) {
    for (int c = 0; c < 3; ++c) to[c].set(lane, to[c][lane] + v[c]);
  }
  KOKKOS_INLINE_FUNCTION void one(FactorItems<R> const& items, int k) const {
    Row<R>& to = *row_[k];
    RowSums<R> sums = RowSums<R>::of(to);
    whiten(model_, items, tree_, segment_[k], y_[k], sums);
    sums.leave_in(to);
  }
  /// y <- (J + y) L^-1 D^-1/2, each dof leaving its share to its ancestors, as in whiten.
  KOKKOS_INLINE_FUNCTION void together(FactorItems<R> const& items) {
    Archetype const& a = *archetype_;
    int const* const ints = model_.ints.data();
    T gap(R(0)), rate(R(0)), free_rate(R(0)), diagonal(R(0));
    for (int k = 0; k < count_; ++k) {
      RowSums<R> const sums = RowSums<R>::of(*row_[k]);
      gap.set(k, sums.gap);
      rate.set(k, sums.rate);
      free_rate.set(k, sums.free_rate);
      diagonal.set(k, sums.diagonal);
    }
    for (int d = a.nv; d-- > 0;) {
      if (!touched_[d]) continue;  // and so are its ancestors, where it is
      int const adr = ints[a.row_adr + d], n = ints[a.row_adr + d + 1] - adr - 1;
      T J = J_[d];
      if (forced_[d]) {
        forced_[d] = false;
        int const c = items.at.cdof + 6 * d;
        Spatial<T> const& f = force_[d];
        J = J + fma(f.linear.z, T(items[c + 5]),
                    fma(f.linear.y, T(items[c + 4]),
                        fma(f.linear.x, T(items[c + 3]),
                            fma(f.angular.z, T(items[c + 2]), fma(f.angular.y, T(items[c + 1]), f.angular.x * T(items[c]))))));
        if (n > 0) pass_on(f, ints[a.row_col + adr + n - 1]);
      }
      gap = fma(J, T(items[items.at.low + d]), gap);
      rate = fma(J, T(items[items.at.qvel + d]), rate);
      free_rate = fma(J, T(items[items.at.velocity + d]), free_rate);
      T const value = y_of_[d] + J;
      for (int p = 0; p < n; ++p) {
        T& to = y_of_[ints[a.row_col + adr + p]];
        to = fma(T(-items[items.at.factor + adr + p]), value, to);
      }
      T const y = value * T(sqrt(items[items.at.inverse_diagonal + d]));
      diagonal = fma(y, y, diagonal);
      y_of_[d] = y;
      touched_[d] = false;
    }
    for (int k = 0; k < count_; ++k) {
      for (int i = 0; i < segment_[k].count; ++i) y_[k][i] = y_of_[dof(segment_[k], i)][k];
      RowSums<R>{gap[k], rate[k], free_rate[k], diagonal[k]}.leave_in(*row_[k]);
    }
  }
  KOKKOS_INLINE_FUNCTION void pass_on(Spatial<T> const& f, int parent) {
    force_[parent] = forced_[parent] ? force_[parent] + f : f;
    forced_[parent] = true;
  }

  Model<R, Mem> const& model_;
  Dynamics<R, Mem> const& dynamics_;
  R* entries_;
  int world_, count_ = 0, tree_ = -1;
  Archetype const* archetype_ = nullptr;
  RowSegment segment_[W];
  R* y_[W];
  Row<R>* row_[W];
  bool touched_[most_dofs], forced_[most_dofs];  // by what was taken in: y_of_ and J_ are numbers; force_ is
  T y_of_[most_dofs], J_[most_dofs];
  Spatial<T> force_[most_dofs];
};

}  // namespace gsp::detail
