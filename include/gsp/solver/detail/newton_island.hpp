#pragma once
#include <algorithm>
#include <cstring>
#include <gsp/constraint/islands.hpp>
#include <gsp/math/pack.hpp>
#include <gsp/parallel/for_worlds.hpp>
#include <gsp/solver/detail/newton_problem.hpp>
#include <gsp/solver/detail/newton_sizes.hpp>
#include <gsp/solver/detail/newton_tiles.hpp>
#include <type_traits>

/// What `newton` does with an island that fits into near memory: a GPU's shared memory, or room that stays in a core's second-level cache.
/// Its rows are full there (zeros and all), by fours of dofs; H lies in tiles of 4 x 4 (newton_tiles.hpp). An iteration takes what it
/// computes:
///   H = 1 + Y^T B Y   a tile a thread, 16 multiply-adds and two loads of four numbers a row that has a curvature
///   H = L L^T
/// What does not fit keeps its rows where they lie (newton_sparse.hpp).
namespace gsp::detail {

/// An element whose laws lie in arrays, as soft_element.hpp takes it.
template <class R>
struct SoftElementView {
  int rows;
  R const *compliance, *lower, *upper, *mu, *cone_mu;
  signed char const* normal;
};

/// For newton_until_rest. All threads of an island call all members together.
/// @tparam Threads  SerialWorld, or what has its sync, single, one, each, sum and list
template <class R, class Mem, class Threads>
class NewtonIsland {
  static constexpr int N = most_element_rows, T = newton_tile;
  using Factor = TiledCholesky<R, Threads>;
  static constexpr bool one_thread = Factor::one_thread;
  static constexpr int at_once = one_thread ? native_width<R> : 1;
  using Sizes = NewtonSizes<R, at_once>;
  using Part = std::conditional_t<one_thread, Pack<R, at_once>, R>;  // a number of the rows that are taken at once
  using Four = typename Factor::Four;
  using Wide = Pack<R, std::max(T, native_width<R>)>;  // one thread: what it takes of a row at once
  static_assert(N * (N + 1) / 2 <= 4 * N, "the curvatures of an element lie in four numbers a row");
  using Problem = NewtonProblem<R, Mem>;

 public:
  /// @param cones   whether some row has a cone of friction (NewtonProblem::has_cones)
  /// @param memory  Sizes::bytes of it, aligned for a Four
  KOKKOS_FORCEINLINE_FUNCTION NewtonIsland(Problem const& problem, Threads const& threads, IslandRows const& island, bool cones,
                                           void* memory)
      : k_(problem),
        threads_(threads),
        l_(problem.lists_of(threads.rank, island)),
        size_(island.count, island.dofs, cones),
        m_(island.count),
        Y_(static_cast<R*>(memory)),
        z_(Y_ + m_ * size_.stride),
        d_(z_ + T * size_.fours),
        H_(threads, size_.fours, d_ + T * size_.fours),
        room_(H_.diagonal()) {
    R* next = H_.end();
    auto const take = [&](int count) {
      R* const own = next;
      next += count;
      return own;
    };
    w_ = take(size_.filled);
    p_ = take(size_.filled);
    change_ = take(size_.filled);
    stiffness_ = take(size_.filled);
    lower_ = take(size_.filled);
    upper_ = take(size_.filled);
    int const coned = size_.cones ? m_ : 0;
    compliance_ = take(coned);
    mu_ = take(coned);
    cone_mu_ = take(coned);
    curve_ = take(4 * coned);
    active_ = reinterpret_cast<short*>(next);
    active_cones_ = active_ + m_;
    cone_rows_ = reinterpret_cast<signed char*>(active_cones_ + coned);
    normal_ = cone_rows_ + coned;
  }

  /// Rows and laws from the pools; z = Y^T p of the impulses given, or 0 where that costs less; w = Y z + b.
  KOKKOS_FORCEINLINE_FUNCTION void begin() {
    read();
    if (!k_.warm) return;
    R const none = cost();
    R const* const before = impulses();
    threads_.each(m_, [&](int r) { p_[r] = before[l_.island.row(r)]; });
    pull(z_);
    threads_.each(m_, [&](int r) { w_[r] += row_dot(r, z_); });
    R const given = cost() + R(0.5) * dot(z_, z_);
    if (given < none) return;
    threads_.sync();
    threads_.each(T * size_.fours, [&](int i) { z_[i] = R(0); });
    threads_.each(m_, [&](int r) { w_[r] = bias(r); });
  }
  KOKKOS_FORCEINLINE_FUNCTION R gradient() {
    set_impulses([&](int r, SoftElementView<R> const& e) {
      R B[N][N];
      soft_curvature(e, w_ + r, B);
      for (int b = 0; b < e.rows; ++b)
        for (int a = 0; a <= b; ++a) curve_[4 * r + b * (b + 1) / 2 + a] = B[b][a];
    });
    pull(d_);
    threads_.each(T * size_.fours, [&](int i) { d_[i] -= z_[i]; });
    return dot(d_, d_);
  }
  KOKKOS_FORCEINLINE_FUNCTION R solve() {
    find_active();
    assemble();
    if (!H_.factor(d_, R(newton_pivot))) {
      gradient();  // d anew
      factor_rows();
      H_.forward(d_);
    }
    R const decrement = dot(d_, d_);
    H_.back(d_);
    return decrement;
  }
  KOKKOS_FORCEINLINE_FUNCTION R size() const { return dot(z_, z_); }
  /// | |Y^T| |p| |^2: what rounding of the gradient is measured by.
  KOKKOS_FORCEINLINE_FUNCTION R summed() const {
    each_dof(
        [&]<class X>(X, int i) {
          X sum(R(0));
          for (int r = 0; r < m_; ++r) sum = fma(abs(load_as<X>(Y_ + r * size_.stride + i)), X(abs(p_[r])), sum);
          return sum;
        },
        room_);
    return dot(room_, room_);
  }
  KOKKOS_FORCEINLINE_FUNCTION void look_along() {
    threads_.each(m_, [&](int r) { change_[r] = row_dot(r, d_); });
    zd_ = dot(z_, d_);
    dd_ = dot(d_, d_);
  }
  KOKKOS_FORCEINLINE_FUNCTION R slope(R alpha) const {
    R const pull = sum_rows([&](int r) { return load(change_ + r) * between_bounds(r, fma(Part(alpha), load(change_ + r), load(w_ + r))); },
                            [&](int r, SoftElementView<R> const& e) { return soft_pull(e, w_ + r, change_ + r, alpha); });
    return zd_ + alpha * dd_ - pull;
  }
  KOKKOS_FORCEINLINE_FUNCTION void go(R alpha) {
    threads_.each(T * size_.fours, [&](int i) { z_[i] = fma(alpha, d_[i], z_[i]); });
    threads_.each(m_, [&](int r) { w_[r] = fma(alpha, change_[r], w_[r]); });
  }
  /// z and p(w) to where they belong. Returns the largest change of a rate, where it is asked for.
  KOKKOS_FORCEINLINE_FUNCTION R write() {
    auto const& e = l_.island;
    R* const z = k_.solution.z.data() + std::int64_t(threads_.rank) * k_.rows.nv;
    R* const p = impulses();
    threads_.each(e.dofs, [&](int i) { z[e.dof(i)] = z_[i]; });
    set_impulses([](int, SoftElementView<R> const&) {});
    threads_.each(m_, [&](int r) { p[e.row(r)] = p_[r]; });
    if (!k_.residual) return R(0);
    pull(d_);
    threads_.each(m_, [&](int r) { change_[r] = abs(row_dot(r, d_) + bias(r) - w_[r]); });
    R worst(0);
    for (int r = 0; r < m_; ++r) worst = max_or_nan(worst, change_[r]);
    threads_.sync();
    return worst;
  }

 private:
  KOKKOS_FORCEINLINE_FUNCTION static Four& four(R* p) { return Factor::four(p); }
  /// Packs that are longer than a four need not be aligned.
  template <class X>
  KOKKOS_FORCEINLINE_FUNCTION static X load_as(R const* p) {
    if constexpr (std::is_same_v<X, Four>) {
      return *reinterpret_cast<Four const*>(p);
    } else {
      X x;
      std::memcpy(&x, p, sizeof x);
      return x;
    }
  }
  KOKKOS_FORCEINLINE_FUNCTION static Part load(R const* p) {
    Part x;
    std::memcpy(&x, p, sizeof x);
    return x;
  }
  KOKKOS_FORCEINLINE_FUNCTION static void store(R* p, Part const& x) { std::memcpy(p, &x, sizeof x); }
  KOKKOS_FORCEINLINE_FUNCTION R* impulses() const { return k_.impulses.p[k_.impulses.parity()].data() + l_.first; }
  KOKKOS_FORCEINLINE_FUNCTION R bias(int r) const { return l_.row[l_.island.row(r)].bias; }
  KOKKOS_FORCEINLINE_FUNCTION SoftElementView<R> element(int r, int n) const {
    return {n, compliance_ + r, lower_ + r, upper_ + r, mu_ + r, cone_mu_ + r, normal_ + r};
  }
  /// What rows between bounds answer to rates w; 0 where a row is of an element with a cone, or none.
  KOKKOS_FORCEINLINE_FUNCTION Part between_bounds(int r, Part const& w) const {
    Part const stiffness = load(stiffness_ + r);
    return select(stiffness == R(0), Part(R(0)), clamp(-w * stiffness, load(lower_ + r), load(upper_ + r)));
  }
  /// The sum of of_rows(r) over the rows, as many at once as a Part has, and of of_cone(r, element) over the elements with a cone.
  template <class OfRows, class OfCone>
  KOKKOS_FORCEINLINE_FUNCTION R sum_rows(OfRows const& of_rows, OfCone const& of_cone) const {
    if constexpr (one_thread) {
      Part sums(R(0));
      for (int r = 0; r < m_; r += at_once) sums = sums + of_rows(r);
      R sum(0);
      for (int k = 0; k < at_once; ++k) sum += sums[k];
      if (size_.cones)
        for (int r = 0; r < m_; ++r)
          if (cone_rows_[r] > 0) sum += of_cone(r, element(r, cone_rows_[r]));
      return sum;
    } else {
      return threads_.template sum<R>(m_, [&](int r) {
        R const own = of_rows(r);
        return size_.cones && cone_rows_[r] > 0 ? of_cone(r, element(r, cone_rows_[r])) : own;
      });
    }
  }
  KOKKOS_FORCEINLINE_FUNCTION R dot(R const* a, R const* b) const {
    return threads_.template sum<R>(T * size_.fours, [&](int i) { return a[i] * b[i]; });
  }
  /// p(w). @param of_cone  what else is to be done for an element with a cone, which begins at row r
  template <class OfCone>
  KOKKOS_FORCEINLINE_FUNCTION void set_impulses(OfCone const& of_cone) {
    threads_.each(size_.filled / at_once, [&](int i) {
      int const r = at_once * i;
      store(p_ + r, between_bounds(r, load(w_ + r)));
    });
    if (!size_.cones) return;
    threads_.each(m_, [&](int r) {
      if (cone_rows_[r] == 0) return;
      auto const e = element(r, cone_rows_[r]);
      soft_impulses(e, w_ + r, p_ + r);
      of_cone(r, e);
    });
  }
  /// to[i] = of(X(), i) for all dofs: of one, or of as many as X has, from i on.
  template <class Of>
  KOKKOS_FORCEINLINE_FUNCTION void each_dof(Of const& of, R* to) const {
    if constexpr (one_thread) {
      for (int i = 0; i < T * size_.fours; i += Wide::width) {
        Wide const x = of(Wide(), i);
        for (int a = 0; a < Wide::width && i + a < T * size_.fours; ++a) to[i + a] = x[a];
      }
    } else {
      threads_.each(T * size_.fours, [&](int i) { to[i] = of(R(), i); });
    }
  }
  /// to = Y^T p
  KOKKOS_FORCEINLINE_FUNCTION void pull(R* to) const {
    each_dof(
        [&]<class X>(X, int i) {
          X sum(R(0));
          for (int r = 0; r < m_; ++r) sum = fma(load_as<X>(Y_ + r * size_.stride + i), X(p_[r]), sum);
          return sum;
        },
        to);
  }
  /// Y x of row r.
  KOKKOS_FORCEINLINE_FUNCTION R row_dot(int r, R* x) const {
    Four sum(R(0));
    for (int b = 0; b < size_.fours; ++b) sum = fma(four(Y_ + r * size_.stride + T * b), four(x + T * b), sum);
    return sum_of(sum);
  }
  KOKKOS_FORCEINLINE_FUNCTION static R sum_of(Four const& x) { return (x[0] + x[1]) + (x[2] + x[3]); }
  KOKKOS_FORCEINLINE_FUNCTION R cost() const {
    return sum_rows(
        [&](int r) {
          Part const w = load(w_ + r), p = between_bounds(r, w), stiffness = load(stiffness_ + r);
          return select(stiffness == R(0), Part(R(0)), -p * fma(Part(R(0.5)) / stiffness, p, w));
        },
        [&](int r, SoftElementView<R> const& e) {
          R p[N];
          soft_impulses(e, w_ + r, p);
          return soft_cost(e, w_ + r, p);
        });
  }

  KOKKOS_FORCEINLINE_FUNCTION void read() {
    auto const& e = l_.island;
    auto const& rows = k_.rows;
    threads_.each(m_ * (size_.stride / T), [&](int i) { four(Y_ + T * i) = Four(R(0)); });
    threads_.each(T * size_.fours, [&](int i) { z_[i] = R(0); });
    threads_.each(m_, [&](int r) {
      Row<R> const& row = l_.row[e.row(r)];
      typename Problem::Shifts const shifts(k_, l_, row);
      R* const to = Y_ + r * size_.stride;
      R const* const from = &rows.Y(row.first_entry);
      read_segment(row.segment[0], shifts.first, from, to);
      read_segment(row.segment[1], shifts.second, from + row.segment[0].count, to);
      w_[r] = row.bias;
      if (size_.cones) cone_rows_[r] = 0;
    });
    threads_.each(size_.filled - m_, [&](int i) {
      int const r = m_ + i;
      w_[r] = change_[r] = stiffness_[r] = lower_[r] = upper_[r] = R(0);
    });
    R* const most = room_;
    each_dof(
        [&]<class X>(X, int i) {
          X on_dof(R(0));
          for (int r = 0; r < m_; ++r) on_dof = max(on_dof, square(load_as<X>(Y_ + r * size_.stride + i)));
          return on_dof;
        },
        most);
    R* const least = change_;
    threads_.each(m_, [&](int r) {
      Four others(R(0)), own(R(0));
      for (int b = 0; b < size_.fours; ++b) {
        Four const y = four(Y_ + r * size_.stride + T * b);
        others = others + select(y == Four(R(0)), Four(R(0)), four(most + T * b));
        own = fma(y, y, own);
      }
      least[r] = Problem::least_of(l_.row[e.row(r)].compliance, sum_of(others), sum_of(own));
    });
    if (size_.cones)
      threads_.each(m_, [&](int r) { read_element(r, least); });
    else
      threads_.each(m_, [&](int r) {
        Row<R> const& row = l_.row[e.row(r)];
        read_row(r, max(row.compliance, least[r]), row.friction_of < 0, row.lower, row.upper);
      });
  }
  /// Entries of a row on one tree.
  KOKKOS_FORCEINLINE_FUNCTION void read_segment(RowSegment const& segment, int shift, R const* from, R* to) const {
    to += segment.dof0 + shift;
    if (segment.list < 0) {
      for (int i = 0; i < segment.count; ++i) to[i] = from[i];
    } else {
      int const* const dof = &k_.rows.dof_lists(segment.list);
      for (int i = 0; i < segment.count; ++i) to[dof[i]] = from[i];
    }
  }
  /// @param some  it is no friction that there is none of
  KOKKOS_FORCEINLINE_FUNCTION void read_row(int r, R compliance, bool some, R lower, R upper) {
    stiffness_[r] = R(1) / compliance;
    lower_[r] = some ? lower : R(0);
    upper_[r] = some ? upper : R(0);
  }
  /// The laws of the element that row r begins, where some of the island have a cone.
  KOKKOS_FORCEINLINE_FUNCTION void read_element(int r, R const* least) {
    int const first = l_.island.row(r), n = l_.element_rows[first];
    if (n == 0) return;
    auto const own = soft_element(l_.row + first, n, least + r);
    bool cone = false;
    for (int b = 0; b < n; ++b) cone = cone || own.cone_mu[b] > R(0);
    for (int b = 0; b < n; ++b) {
      read_row(r + b, own.compliance[b], own.normal[b] < 0 || own.mu[b] > R(0), own.lower[b], own.upper[b]);
      if (cone) stiffness_[r + b] = R(0);
      compliance_[r + b] = own.compliance[b];
      mu_[r + b] = own.mu[b];
      cone_mu_[r + b] = own.cone_mu[b];
      normal_[r + b] = own.normal[b];
    }
    if (cone) cone_rows_[r] = static_cast<signed char>(n);
  }

  /// Which rows between bounds, and which elements with a cone, have a curvature.
  KOKKOS_FORCEINLINE_FUNCTION void find_active() {
    active_count_ = threads_.list(m_, active_, [&](int r) {
      R const free = -w_[r] * stiffness_[r];
      return stiffness_[r] > R(0) && free > lower_[r] && free < upper_[r];
    });
    if (size_.cones)
      cone_count_ = threads_.list(m_, active_cones_, [&](int r) { return cone_rows_[r] > 0 && has_curvature(r, cone_rows_[r]); });
    threads_.sync();
  }
  KOKKOS_FORCEINLINE_FUNCTION bool has_curvature(int r, int n) const {
    for (int b = 0; b < n; ++b)
      if (curve_[4 * r + b * (b + 1) / 2 + b] != R(0)) return true;
    return false;
  }
  /// Curvature b, a of the unit that begins at row r.
  KOKKOS_FORCEINLINE_FUNCTION R curvature(int r, int b, int a) const {
    return curve_[4 * r + (a <= b ? b * (b + 1) / 2 + a : a * (a + 1) / 2 + b)];
  }

  /// H = 1 + Y^T B Y
  KOKKOS_FORCEINLINE_FUNCTION void assemble() {
    if constexpr (one_thread) {
      constexpr int wide = Wide::width / T;  // tiles of a column at once; what they have beyond the last one stays unused
      for (int j = 0; j < size_.fours; ++j)
        for (int i = j; i < size_.fours; i += wide) {
          Wide sum[T];
          sum_products(i, j, sum);
          for (int q = 0; q < wide && i + q < size_.fours; ++q) {
            Four part[T];
            for (int b = 0; b < T; ++b) part[b] = Four::of([&](int a) { return sum[b][T * q + a]; });
            H_.put(i + q, j, part);
          }
        }
    } else {
      threads_.each(size_.tiles, [&](int t) {
        int const i = Factor::row_of_triangle(t), j = t - i * (i + 1) / 2;
        Four sum[T];
        sum_products(i, j, sum);
        H_.put(i, j, sum);
      });
    }
  }
  /// Columns 4 j ... 4 j + 3 of Y^T B Y, from row 4 i on.
  template <class X>
  KOKKOS_FORCEINLINE_FUNCTION void sum_products(int i, int j, X (&sum)[T]) const {
    R const *const x = Y_ + T * i, *const y = Y_ + T * j;
    Columns<X> sums;
    auto const add_row = [&](Columns<X>& to, int r) {
      to.add(load_as<X>(x + r * size_.stride) * X(stiffness_[r]), load_as<Four>(y + r * size_.stride));
    };
    int k = 0;
    if constexpr (one_thread) {  // two at a time: each column waits for the row before
      Columns<X> others;
      for (; k + 1 < active_count_; k += 2) {
        add_row(sums, active_[k]);
        add_row(others, active_[k + 1]);
      }
      sums.add(others);
    }
    for (; k < active_count_; ++k) add_row(sums, active_[k]);
    for (int c = 0; c < cone_count_; ++c) {
      int const r = active_cones_[c], n = cone_rows_[r];
      for (int b = 0; b < n; ++b) {
        X u(R(0));
        for (int a = 0; a < n; ++a) u = fma(X(curvature(r, b, a)), load_as<X>(x + (r + a) * size_.stride), u);
        sums.add(u, load_as<Four>(y + (r + b) * size_.stride));
      }
    }
    sums.leave_in(sum);
  }
  /// Four columns by name: what is indexed, and handed on, hosts keep in memory.
  template <class X>
  struct Columns {
    X a = X(R(0)), b = X(R(0)), c = X(R(0)), d = X(R(0));
    KOKKOS_FORCEINLINE_FUNCTION void add(X const& u, Four const& v) {
      static_assert(T == 4);
      a = fma(u, X(v[0]), a);
      b = fma(u, X(v[1]), b);
      c = fma(u, X(v[2]), c);
      d = fma(u, X(v[3]), d);
    }
    KOKKOS_FORCEINLINE_FUNCTION void add(Columns const& o) {
      a = a + o.a;
      b = b + o.b;
      c = c + o.c;
      d = d + o.d;
    }
    KOKKOS_FORCEINLINE_FUNCTION void leave_in(X (&to)[T]) const {
      to[0] = a;
      to[1] = b;
      to[2] = c;
      to[3] = d;
    }
  };
  /// L without the sum, row by row, as in newton_sparse.hpp.
  KOKKOS_FORCEINLINE_FUNCTION void factor_rows() {
    threads_.sync();
    H_.set_identity();
    R G[N][N];
    for (int k = 0; k < active_count_; ++k) {
      G[0][0] = stiffness_[active_[k]];
      add_unit(active_[k], 1, G);
    }
    for (int k = 0; k < cone_count_; ++k) {
      int const r = active_cones_[k], n = cone_rows_[r];
      for (int b = 0; b < n; ++b)
        for (int a = 0; a <= b; ++a) G[b][a] = curvature(r, b, a);
      add_unit(r, n, G);
    }
    H_.invert_diagonal();
  }
  /// L L^T <- L L^T + Y^T B Y of a row between bounds or an element. @param G  B, which is overwritten
  KOKKOS_FORCEINLINE_FUNCTION void add_unit(int r, int n, R (&G)[N][N]) {
    R* const u = room_;
    for (int c = 0; c < n; ++c) {
      if (!Problem::next_column(G, n, c)) continue;
      threads_.sync();  // all have read what u was
      threads_.each(T * size_.fours, [&](int i) {
        R sum(0);
        for (int b = c; b < n; ++b) sum = fma(G[b][c], Y_[(r + b) * size_.stride + i], sum);
        u[i] = sum;
      });
      H_.add(u);
    }
  }
  Problem const& k_;
  Threads threads_;
  typename Problem::Lists l_;
  Sizes size_;
  int m_, active_count_ = 0, cone_count_ = 0;
  R *Y_, *z_, *d_;
  Factor H_;
  R* room_;                                             // a number a dof; the diagonal of H until it is factored
  R *w_, *p_, *change_, *stiffness_, *lower_, *upper_;  // stiffness: 1 / C; 0 of elements with a cone
  R *compliance_, *mu_, *cone_mu_, *curve_;             // where there are cones
  short *active_, *active_cones_;                       // rows that have a curvature: between bounds, and the first of cones
  signed char *cone_rows_, *normal_;  // rows of the element with a cone that begins here, else 0; the normal of a friction row
  R zd_, dd_;
};

}  // namespace gsp::detail
