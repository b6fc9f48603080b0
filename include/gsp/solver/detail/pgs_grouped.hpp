#pragma once
#include <algorithm>
#include <gsp/constraint/rows.hpp>
#include <gsp/parallel/for_worlds.hpp>
#include <gsp/solver/detail/grouped_element.hpp>
#include <gsp/solver/detail/row_vectors.hpp>
#include <gsp/solver/detail/sweep_until_rest.hpp>

/// Large islands on a CPU: before its sweeps an island is copied into a thread's own memory, its elements side by side in the
/// order in which a sweep visits them. Dofs come by groups of as many as a pack has, each tree's from a whole group on, and an element has
/// its entries in the groups that any of its rows touches, zeros between them: a product of rows and z is a fma a row and group and a sum
/// over lanes, and nothing is gathered inside a sweep. What a sweep waits for is the way from one element's z to the next one's.
namespace gsp::detail {

/// A world on a host, and its thread's room.
struct RoomyWorld : SerialWorld {
  char* room;
};

/// Bytes that an island may take which has so many rows and entries of Y, as the constructor takes them:
///   z, before a leap        2 reals a dof, each tree's last group filled up
///   places, groups' slots   an int a dof, and one a group (counted as one a dof)
///   vectors of the rows     10 reals a row, up to a whole pack: p, before, bias, C, 1/diagonal, diagonal and 4 of mixtures
///   rows, elements          an int a row and what an element of one row holds (its rows and theirs of others are no larger each)
///   groups                  a number each, and a pack for each row of the element: a row's entries are 2 segments of a tree each at most
///   alignment               16 packs: one for each array
template <class R, class Mem>
std::int64_t grouped_bytes(Rows<R, Mem> const& rows, std::int64_t row_count, std::int64_t entries, int largest_element,
                           int most_tree_dofs) {
  constexpr std::int64_t G = group_dofs<R>, pack = sizeof(Pack<R, G>), each = sizeof(GroupedElement<R, 1>) + pack;
  std::int64_t const dofs = rows.nv + (G - 1) * rows.islands.ntree;
  std::int64_t const groups = std::min(entries, 2 * row_count * ((most_tree_dofs + G - 1) / G));
  return 2 * dofs * std::int64_t(sizeof(R)) + (rows.nv + dofs) * std::int64_t(sizeof(int)) +
         10 * (row_count + G) * std::int64_t(sizeof(R)) + row_count * (std::int64_t(sizeof(int)) + each) +
         groups * (std::int64_t(sizeof(int)) + largest_element * pack) + 16 * pack;
}

/// An island in a thread's own memory.
template <class R, class Mem>
class GroupedIsland {
  static constexpr int G = group_dofs<R>;
  using T = Pack<R, G>;

 public:
  /// @param room         grouped_bytes, from a whole pack on
  /// @param row_count    rows of the island
  /// @param dofs, dof    its dofs, and number k of them, trees one after the other
  /// @param elements     elements(f): f(r, n) for each element in the order of a sweep, n rows from row r of the world on
  template <class Dof, class Elements>
  KOKKOS_INLINE_FUNCTION GroupedIsland(Rows<R, Mem> const& rows, int w, R relaxation, char* room, R const* p, int row_count, int dofs,
                                       Dof const& dof, Elements const& elements)
      : rows_(rows), relaxation_(relaxation), room_(room) {
    place_ = take<int>(rows.nv);
    each_dof(dofs, dof, [&](int i, int at) { place_[i] = at; });
    packs_ = (dofs_ + G - 1) / G;
    z_ = take<R>(packs_ * G);
    z_before_ = take<R>(packs_ * G);
    slot_ = take<int>(packs_);
    for (int k = 0; k < packs_; ++k) slot_[k] = -1;
    for (int k = 0; k < packs_; ++k) at(z_, k) = T(R(0));
    row_packs_ = (row_count + G - 1) / G;
    for (R** v : {&p_, &before_, &bias_, &compliance_, &inverse_, &diagonal_, &mixing_[0], &mixing_[1], &mixing_[2], &mixing_[3]}) {
      *v = take<R>(row_packs_ * G);
      if (row_packs_ > 0) at(*v, row_packs_ - 1) = T(R(0));  // beyond the last row
    }
    row_ = take<int>(row_count);
    elements_ = room_;
    int const first = rows.first(w);
    elements([&](int r, int n) {
      for (int b = 0; b < n; ++b, ++count_) {
        Row<R> const& row = rows.row(first + r + b);
        row_[count_] = r + b;
        p_[count_] = p[r + b];
        bias_[count_] = row.bias;
        compliance_[count_] = row.compliance;
        inverse_[count_] = row.inverse_diagonal;
      }
      of_rows(n, [&](auto m) { add_element<m>(&rows.row(first + r)); });
    });
    for (int k = 0; k < row_packs_; ++k) {
      auto const movable = at(inverse_, k) > T(R(0));
      at(diagonal_, k) = select(movable, T(R(1)) / select(movable, at(inverse_, k), T(R(1))), T(R(0)));
    }
    sum();
  }
  template <class Dof>
  KOKKOS_INLINE_FUNCTION void store(int dofs, Dof const& dof, R* z, R* p) {
    each_dof(dofs, dof, [&](int i, int at) { z[i] = z_[at]; });
    for (int r = 0; r < count_; ++r) p[row_[r]] = p_[r];
  }
  KOKKOS_INLINE_FUNCTION SweepOutcome<R> sweep(bool leaps) const {
    SweepOutcome<R> to;
    each_element([&](auto const& e, int r) { leaps ? pass<true>(e, r, to) : pass<false>(e, r, to); });
    return to;
  }
  KOKKOS_INLINE_FUNCTION void keep(bool leaps) const {
    if (leaps) copy(z_, z_before_, packs_);
    copy(p_, before_, row_packs_);
  }
  KOKKOS_INLINE_FUNCTION void take_back() const {
    copy(mixing_[0], p_, row_packs_);
    sum();
  }
  /// z = Y^T p
  KOKKOS_INLINE_FUNCTION void sum() const {
    for (int k = 0; k < packs_; ++k) at(z_, k) = T(R(0));
    each_element([&](auto const& e, int r) { e.push(z_, p_ + r); });
  }
  KOKKOS_INLINE_FUNCTION LeapSums<R> leap_sums() const {
    LeapSums<T> s{};
    for (int k = 0; k < packs_; ++k) s.add_dof(at(z_, k), at(z_, k) - at(z_before_, k));
    for (int k = 0; k < row_packs_; ++k)
      s.add_row(at(p_, k), at(p_, k) - at(before_, k), at(compliance_, k), at(bias_, k), at(inverse_, k));
    return {sum_of_lanes(s.pp), sum_of_lanes(s.pd), sum_of_lanes(s.dd), sum_of_lanes(s.bp), sum_of_lanes(s.yy)};
  }
  KOKKOS_INLINE_FUNCTION MixingSums<R> mixing_sums(bool both) const {
    MixingSums<T> s{};
    for (int k = 0; k < row_packs_; ++k)
      s.add_row(at(diagonal_, k), at(p_, k) - at(before_, k), at(mixing_[3], k), at(mixing_[1], k), everywhere(both));
    return {sum_of_lanes(s.dd11), sum_of_lanes(s.dd12), sum_of_lanes(s.dd22), sum_of_lanes(s.df1), sum_of_lanes(s.df2)};
  }
  /// Keeps p and d of the last sweep; p goes on to where a leap or a mixture leads.
  KOKKOS_INLINE_FUNCTION void go_on(int side, Leap<R> const& leap, Mixing<R> const& mixing, bool both) const {
    Leap<T> const leap_of_all{T(leap.growth), T(leap.sweeps)};
    Mixing<T> const of_all{T(mixing.gamma1), T(mixing.gamma2)};
    for (int k = 0; k < row_packs_; ++k) {
      T const now = at(p_, k), d = now - at(before_, k);
      if (leap.goes()) at(p_, k) = leap_of_all.of(now, d);
      if (mixing.helps()) at(p_, k) = of_all.of(now, at(mixing_[2], k), at(mixing_[0], k), everywhere(both));
      at(mixing_[2 * side], k) = now;
      at(mixing_[2 * side + 1], k) = d;
    }
  }

 private:
  template <class Item>
  KOKKOS_INLINE_FUNCTION Item* take(std::int64_t n) {
    Item* const items = reinterpret_cast<Item*>(room_);
    room_ += (n * std::int64_t(sizeof(Item)) + std::int64_t(sizeof(T)) - 1) / std::int64_t(sizeof(T)) * std::int64_t(sizeof(T));
    return items;
  }
  KOKKOS_INLINE_FUNCTION static Mask<R, G> everywhere(bool b) { return T(R(b)) > T(R(0)); }
  KOKKOS_INLINE_FUNCTION static void copy(R* from, R* to, int packs) {
    for (int k = 0; k < packs; ++k) at(to, k) = at(from, k);
  }
  KOKKOS_INLINE_FUNCTION static T& at(R* v, int k) { return reinterpret_cast<T*>(v)[k]; }
  /// f(dof, its place here)
  template <class Dof, class F>
  KOKKOS_INLINE_FUNCTION void each_dof(int dofs, Dof const& dof, F const& f) {
    dofs_ = 0;
    for (int k = 0, tree = -1; k < dofs; ++k) {
      int const i = dof(k);
      if (int const own = rows_.islands.dof_tree(i); own != tree) {
        tree = own;
        dofs_ = (dofs_ + G - 1) / G * G;
      }
      f(i, dofs_++);
    }
  }
  /// f(element, its first row here)
  template <class F>
  KOKKOS_INLINE_FUNCTION void each_element(F const& f) const {
    char* next = elements_;
    for (int r = 0; r < count_;) {
      int const n = *reinterpret_cast<int const*>(next);
      of_rows(n, [&](auto m) {
        auto& e = *reinterpret_cast<GroupedElement<R, m>*>(next);
        f(e, r);
        next = reinterpret_cast<char*>(e.entries() + m * e.groups);
      });
      r += n;
    }
  }
  template <int M>
  KOKKOS_INLINE_FUNCTION void add_element(Row<R> const* row) {
    auto& e = *reinterpret_cast<GroupedElement<R, M>*>(room_);
    e.rows = M;
    e.groups = 0;
    R const* const Y = rows_.Y.data();
    for (int c = 0; c < M * (M - 1) / 2; ++c) e.coupling[c] = Y[row->first_entry - M * (M - 1) / 2 + c];
    auto const add_group = [&](int g) {
      if (slot_[g] >= 0) return;
      slot_[g] = e.groups;
      e.group()[e.groups++] = g * G;
    };
    for (int b = 0; b < M; ++b) {
      set_law(e.law, b, row[b]);
      if (b > 0 && row->same_segments) continue;
      each_segment(row[b], [&](RowSegment const& s, int first, int const* list) {
        if (list)
          for (int i = 0; i < s.count; ++i) add_group(first + list[i] / G);
        else
          for (int i = 0; i < s.count; i += G) add_group(first + i / G);
      });
    }
    T* const entries = e.entries();
    for (int k = 0; k < M * e.groups; ++k) entries[k] = T(R(0));
    for (int b = 0; b < M; ++b) {
      R const* y = Y + row[b].first_entry;
      each_segment(row[b], [&](RowSegment const& s, int first, int const* list) {
        auto const of_group = [&](int g) { return reinterpret_cast<R*>(entries + slot_[g] * M + b); };
        if (list)
          for (int i = 0; i < s.count; ++i) of_group(first + list[i] / G)[list[i] % G] += y[i];
        else
          for (int i = 0; i < s.count; i += G) {
            R* const to = of_group(first + i / G);
            for (int l = 0; l < G && i + l < s.count; ++l) to[l] += y[i + l];
          }
        y += s.count;
      });
    }
    for (int g = 0; g < e.groups; ++g) slot_[e.group()[g] / G] = -1;
    room_ = reinterpret_cast<char*>(entries + M * e.groups);
  }
  /// f(segment, group of its tree's first dof, list)
  template <class F>
  KOKKOS_INLINE_FUNCTION void each_segment(Row<R> const& row, F const& f) const {
    for (int s = 0; s < 2 && row.segment[s].count > 0; ++s)
      f(row.segment[s], place_[row.segment[s].dof0] / G, list_of(rows_, row.segment[s]));
  }
  /// One pass over an element, from row r on: rates, projection, z.
  template <bool leaps, int M>
  KOKKOS_INLINE_FUNCTION void pass(GroupedElement<R, M> const& e, int r, SweepOutcome<R>& to) const {
    R rate[M], before[M], now[M], d[M];
    e.product(z_, rate);
    unrolled<M>([&](auto b) {
      now[b] = p_[r + b];
      before[b] = rate[b] = fma(compliance_[r + b], now[b], bias_[r + b]) + rate[b];
    });
    auto const coupling = [&](int b, int a) { return e.coupling[b * (b - 1) / 2 + a]; };
    project_element<M>(e.law, 0, coupling, relaxation_, rate, now, d);
    bool any = false;
    R change(0), misses(0);  // of the element: what `to` has so far is waited for once
    unrolled<M>([&](auto b) {
      R const of_row = d[b] * diagonal_[r + b];
      any = any || d[b] != R(0);
      change = max(change, abs(of_row));
      misses = fma(d[b], of_row, misses);
      p_[r + b] = now[b];
      if constexpr (leaps) {
        unrolled<b>([&](auto a) { before[b] = fma(coupling(b, a), d[a], before[b]); });
        R together(0);
        if constexpr (b > 0) together = e.law.with_next[b - 1] * (coupling(b, b - 1) * d[b - 1]);
        to.work.template add_row<R>(now[b], d[b], before[b], of_row, e.law.inverse_diagonal[b], together);
      }
    });
    to.change = max(to.change, change);
    to.misses += misses;
    if (any) e.push(z_, d);
  }

  Rows<R, Mem> const& rows_;
  R relaxation_;
  char* room_;
  int dofs_ = 0, packs_ = 0, count_ = 0, row_packs_ = 0;  // places of dofs, rows
  int *place_, *slot_, *row_;                             // of a tree's first dof; of a group in an element; row of the world
  R *z_, *z_before_, *p_, *before_, *bias_, *compliance_, *inverse_, *diagonal_, *mixing_[4];
  char* elements_;
};

}  // namespace gsp::detail
