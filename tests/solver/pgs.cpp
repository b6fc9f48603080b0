#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <gsp/solver/detail/sweep_until_rest.hpp>
#include <gsp_test_execs.hpp>
#include <limits>
#include <memory>
#include <tuple>
#include <vector>

#include "constraint/loop.hpp"
#include "support/kokkos_tools.hpp"

using gsp_test::Loop;

namespace test_types {
/// Random rows over random dofs, fixed by the world, the element and the row: contacts of three rows (a soft normal, two of friction), or
/// single rows between bounds. Laws are random too.
struct RandomRows {
  int n;
  bool contacts;
  int dofs;
  double mu;
  int more;  // in odd worlds
  KOKKOS_FUNCTION int count(int world) const { return n + (world % 2 ? more : 0); }
  KOKKOS_FUNCTION int rows(int, int) const { return contacts ? 3 : 1; }
  template <class Row>
  KOKKOS_FUNCTION double jacobian(int world, int k, int row, Row&& J) const {
    for (int i = 0; i < dofs; ++i) J.set_dof(i, gsp_test::hashed(world, k, row, i));
    return 0;
  }
  KOKKOS_FUNCTION gsp::RowLaw<double> law(int world, int k, int row, double, double, double) const {
    return {row == 0 ? 0.02 * (1 + gsp_test::hashed(world, k, 5, 0)) : 0., row == 0 ? gsp_test::hashed(world, k, 5, 1) : 0.};
  }
  KOKKOS_FUNCTION gsp::RowBounds<double> bounds(int world, int k, int row) const {
    if (contacts && row > 0) return {0, 0, 0, mu};
    if (contacts) return {0, 1e300};
    double const a = gsp_test::hashed(world, k, 6, 0) - 0.5;
    return {a, a + 1.5 * (1 + gsp_test::hashed(world, k, 6, 1))};
  }
  KOKKOS_FUNCTION gsp::RowId id(int, int k) const { return {std::uint32_t(k), 0}; }
};

/// Elements of 1 to 6 rows, whose friction names a row anywhere in the element: (n0, n1, friction of n0), friction before its normal, two
/// normals and a friction of each, and single rows between. Rows push on random dofs; those without friction bear on one side alone.
struct MixedElements {
  int n, more;                                               // elements; more in odd worlds
  int dofs, most;                                            // rows of an element
  KOKKOS_FUNCTION static int normal_of(int kind, int row) {  // -1: a normal
    constexpr int table[6][6] = {{-1, 0, 0, 0, 0, 0},  {1, -1, 0, 0, 0, 0},  {-1, -1, 0, 0, 0, 0},
                                 {2, 2, -1, -1, 0, 0}, {-1, -1, 0, 1, 0, 0}, {-1, 0, 0, 4, -1, 4}};
    return table[kind][row];
  }
  KOKKOS_FUNCTION int count(int world) const { return n + (world % 2 ? more : 0); }
  KOKKOS_FUNCTION int rows(int world, int k) const { return (k + world) % most + 1; }
  template <class Row>
  KOKKOS_FUNCTION double jacobian(int world, int k, int row, Row&& J) const {
    for (int i = 0; i < dofs; ++i) J.set_dof(i, gsp_test::hashed(world, k, row, i));
    return 0;
  }
  KOKKOS_FUNCTION gsp::RowLaw<double> law(int world, int k, int row, double, double, double) const {
    bool const normal = normal_of(rows(world, k) - 1, row) < 0;
    return {0.05 + 0.02 * gsp_test::hashed(world, k, 7, row), normal ? 1 + gsp_test::hashed(world, k, 8, row) : 0.};
  }
  KOKKOS_FUNCTION gsp::RowBounds<double> bounds(int world, int k, int row) const {
    int const normal = normal_of(rows(world, k) - 1, row);
    if (normal < 0) return {0, 1e300};
    return {0, 0, normal, 0.1 + 0.02 * row};
  }
  KOKKOS_FUNCTION gsp::RowId id(int, int k) const { return {std::uint32_t(k), 0}; }
};
/// Elements of 3 to 6 rows with friction in ellipses: behind its normal, before it, beside a row of its own, twice in an element; and, of
/// three rows too, in a box, so that lanes of a pack differ.
struct EllipseElements {
  int n, more, dofs;
  bool mixed;                                              // else of three rows alone
  KOKKOS_FUNCTION static int normal_of(int kind, int row)  // -1: a normal
  {
    constexpr int table[5][6] = {{-1, 0, 0, 0, 0, 0}, {2, 2, -1, 0, 0, 0}, {-1, 0, 0, 0, 0, 0}, {-1, 0, 0, 0, 0, 0}, {-1, 0, 0, 0, 0, 0}};
    return table[kind][row];
  }
  KOKKOS_FUNCTION static bool with_next(int kind, int row) {
    constexpr int table[5][6] = {{0, 1, 0, 0, 0, 0}, {1, 0, 0, 0, 0, 0}, {0, 0, 0, 0, 0, 0}, {0, 1, 0, 0, 0, 0}, {0, 1, 0, 0, 1, 0}};
    return table[kind][row] != 0;
  }
  KOKKOS_FUNCTION int kind(int world, int k) const { return (k + world) % (mixed ? 5 : 3); }
  KOKKOS_FUNCTION int count(int world) const { return n + (world % 2 ? more : 0); }
  KOKKOS_FUNCTION int rows(int world, int k) const {
    constexpr int table[] = {3, 3, 3, 4, 6};
    return table[kind(world, k)];
  }
  template <class Row>
  KOKKOS_FUNCTION double jacobian(int world, int k, int row, Row&& J) const {
    for (int i = 0; i < dofs; ++i) J.set_dof(i, gsp_test::hashed(world, k, row, i));
    return 0;
  }
  KOKKOS_FUNCTION gsp::RowLaw<double> law(int world, int k, int row, double, double u, double) const {
    bool const normal = normal_of(kind(world, k), row) < 0;
    return {0.05 + 0.02 * gsp_test::hashed(world, k, 7, row), normal ? 1 + gsp_test::hashed(world, k, 8, row) : k % 2 ? u : 0.};
  }
  KOKKOS_FUNCTION gsp::RowBounds<double> bounds(int world, int k, int row) const {
    int const normal = normal_of(kind(world, k), row);
    if (normal < 0) return {0, 1e300};
    return {0, 0, normal, 0.1 + 0.5 * ((row + k) % 3), with_next(kind(world, k), row)};
  }
  KOKKOS_FUNCTION gsp::RowId id(int, int k) const { return {std::uint32_t(k), 0}; }
};
/// Elements of one row and of several, in numbers that differ by world: as many rows as small worlds may have, 128, of either kind and of
/// both, and few, one kind more than the other.
struct MostRows {
  int dofs, first_world = 0;
  struct Numbers {
    int of_one, of_several, rows;  // of each of the latter; 0: two and three in turn
  };
  KOKKOS_FUNCTION Numbers numbers(int world) const {
    constexpr Numbers table[] = {{0, 64, 2}, {128, 0, 0}, {2, 42, 3}, {3, 6, 0}, {6, 1, 3}, {6, 2, 3}, {2, 6, 3}, {44, 42, 2}, {0, 0, 0}};
    return table[(world + first_world) % 9];
  }
  KOKKOS_FUNCTION int count(int world) const { return numbers(world).of_one + numbers(world).of_several; }
  KOKKOS_FUNCTION int rows(int world, int k) const {
    auto const n = numbers(world);
    int const of_one = (world + first_world) % 2 ? k - n.of_several : n.of_one - 1 - k;  // those stand last or first
    return of_one >= 0 ? 1 : n.rows > 0 ? n.rows : 2 + k % 2;
  }
  template <class Row>
  KOKKOS_FUNCTION double jacobian(int world, int k, int row, Row&& J) const {
    for (int i = 0; i < dofs; ++i) J.set_dof(i, gsp_test::hashed(world + first_world, k, row, i) / 16);
    return 0;
  }
  template <class R>
  KOKKOS_FUNCTION gsp::RowLaw<R> law(int world, int k, int row, R, R, R) const {
    return {R(0.5), row == 0 ? R(1 + gsp_test::hashed(world + first_world, k, 8, row)) : R(0)};
  }
  KOKKOS_FUNCTION gsp::RowBounds<double> bounds(int world, int k, int row) const {
    if (row == 0) return {0, 1e300};
    return {0, 0, 0, 0.7, row == 1 && k % 2 && rows(world, k) == 3};
  }
  KOKKOS_FUNCTION gsp::RowId id(int, int k) const { return {std::uint32_t(k), 0}; }
};
/// Contacts of four islands of free bodies, those that `present` has a bit of: of 150 rows, of 39, of 120 and one that no other body is in.
struct ContactsOfIslands {
  static constexpr int islands = 4;
  unsigned present;
  KOKKOS_FUNCTION static int contacts(int island) {
    constexpr int number[islands] = {50, 13, 40, 1};
    return number[island];
  }
  /// Of its first body, and how many there are. Body 5 is in none.
  KOKKOS_FUNCTION static int dof(int island) { return 6 * (island == 3 ? 4 : island); }
  KOKKOS_FUNCTION static int dofs(int island) { return island == 2 ? 12 : 6; }
  struct Place {
    int island, contact;
  };
  KOKKOS_FUNCTION Place place(int k) const {
    int island = 0;
    for (;; ++island) {
      int const n = present >> island & 1u ? contacts(island) : 0;
      if (k < n) return {island, k};
      k -= n;
    }
  }
  KOKKOS_FUNCTION int count(int) const {
    int sum = 0;
    for (int island = 0; island < islands; ++island) sum += present >> island & 1u ? contacts(island) : 0;
    return sum;
  }
  KOKKOS_FUNCTION int rows(int, int) const { return 3; }
  template <class Row>
  KOKKOS_FUNCTION double jacobian(int, int k, int row, Row&& J) const {
    auto const [island, contact] = place(k);
    for (int i = 0; i < dofs(island); ++i) J.set_dof(dof(island) + i, gsp_test::hashed(island, contact, row, i));
    return 0;
  }
  template <class R>
  KOKKOS_FUNCTION gsp::RowLaw<R> law(int, int k, int row, R, R, R) const {
    auto const [island, contact] = place(k);
    return {R(0.1), row == 0 ? R(1 + gsp_test::hashed(island, contact, 8, 0)) : R(0)};
  }
  KOKKOS_FUNCTION gsp::RowBounds<double> bounds(int, int, int row) const {
    if (row == 0) return {0, 1e300};
    return {0, 0, 0, 0.7, row == 1};
  }
  KOKKOS_FUNCTION gsp::RowId id(int, int k) const { return {std::uint32_t(100 * place(k).island + place(k).contact), 0}; }
};
/// One island of many free bodies: rows alone on one body or between two, contacts, and elements of five rows that touch different bodies.
struct Crowd {
  int bodies, first_world = 0;
  KOKKOS_FUNCTION int count(int world) const {
    constexpr int number[] = {100, 250, 800};
    return number[(world + first_world) % 3];
  }
  KOKKOS_FUNCTION static int kind(int k) { return k * 5 % 7; }
  KOKKOS_FUNCTION int rows(int, int k) const { return kind(k) < 4 ? 1 : kind(k) < 6 ? 3 : 5; }
  KOKKOS_FUNCTION int body(int k, int other) const { return (k / 3 + other * (1 + k % 4)) % bodies; }
  template <class Row>
  KOKKOS_FUNCTION double jacobian(int world, int k, int row, Row&& J) const {
    bool const one = kind(k) < 3 || kind(k) == 6;
    for (int other = 0; other < (one ? 1 : 2); ++other) {
      int const dof = 6 * body(k, kind(k) == 6 ? row % 2 : other);
      for (int i = 0; i < 6; ++i) J.set_dof(dof + i, gsp_test::hashed(world + first_world, k, row, 6 * other + i) / 4);
    }
    return 0;
  }
  template <class R>
  KOKKOS_FUNCTION gsp::RowLaw<R> law(int world, int k, int row, R, R, R) const {
    return {R(0.5), row == 0 ? R(1 + gsp_test::hashed(world + first_world, k, 8, row)) : R(0)};
  }
  KOKKOS_FUNCTION gsp::RowBounds<double> bounds(int, int k, int row) const {
    if (row == 0) return {0, 1e300};
    return {0, 0, 0, 0.7, row == 1 && kind(k) != 6};
  }
  KOKKOS_FUNCTION gsp::RowId id(int, int k) const { return {std::uint32_t(k), 0}; }
};
/// Two rows together that push on no dof.
struct NothingToMove {
  KOKKOS_FUNCTION int count(int) const { return 1; }
  KOKKOS_FUNCTION int rows(int, int) const { return 2; }
  template <class Row>
  KOKKOS_FUNCTION double jacobian(int, int, int, Row&&) const {
    return -1;
  }
  KOKKOS_FUNCTION gsp::RowLaw<double> law(int, int, int, double, double, double) const { return {1., 1.}; }
  KOKKOS_FUNCTION gsp::RowBounds<double> bounds(int, int, int) const { return {-1, 1}; }
  KOKKOS_FUNCTION gsp::RowId id(int, int) const { return {999, 0}; }
};
/// Two rows of friction together that are none: the last of an element, of different normals, three in a row, one the other's normal.
struct WrongEllipse {
  KOKKOS_FUNCTION int count(int) const { return 1; }
  KOKKOS_FUNCTION int rows(int, int) const { return 4; }
  template <class Row>
  KOKKOS_FUNCTION double jacobian(int, int, int row, Row&& J) const {
    J.set_dof(row % 2, 1.);
    return 0;
  }
  KOKKOS_FUNCTION gsp::RowLaw<double> law(int, int, int, double, double, double) const { return {1., 0.}; }
  KOKKOS_FUNCTION gsp::RowBounds<double> bounds(int world, int, int row) const {
    constexpr int normal[5][4] = {{-1, 0, 0, 0}, {-1, -1, 0, 1}, {-1, 0, 0, 0}, {1, -1, 0, 0}, {-1, 0, 0, 0}};
    constexpr bool with_next[5][4] = {{0, 0, 0, 1}, {0, 0, 1, 0}, {0, 1, 1, 0}, {1, 0, 0, 0}, {0, 1, 0, 0}};  // the last is right
    return {0, 1, normal[world][row], .5, with_next[world][row]};
  }
  KOKKOS_FUNCTION gsp::RowId id(int, int k) const { return {std::uint32_t(k), 0}; }
};
/// One row whose friction names itself.
struct OwnFriction {
  KOKKOS_FUNCTION int count(int) const { return 1; }
  KOKKOS_FUNCTION int rows(int, int) const { return 1; }
  template <class Row>
  KOKKOS_FUNCTION double jacobian(int, int, int, Row&& J) const {
    J.set_dof(0, 1.);
    return 0;
  }
  KOKKOS_FUNCTION gsp::RowLaw<double> law(int, int, int, double, double, double) const { return {0., 0.}; }
  KOKKOS_FUNCTION gsp::RowBounds<double> bounds(int world, int, int) const { return {0, 0, world % 2 ? 0 : -1, 1.}; }
  KOKKOS_FUNCTION gsp::RowId id(int, int k) const { return {std::uint32_t(k), 0}; }
};
/// Friction that is less than none in every second world.
struct NegativeFriction : OwnFriction {
  KOKKOS_FUNCTION int rows(int, int) const { return 2; }
  template <class Row>
  KOKKOS_FUNCTION double jacobian(int, int, int row, Row&& J) const {
    J.set_dof(row, 1.);
    return 0;
  }
  KOKKOS_FUNCTION gsp::RowBounds<double> bounds(int world, int, int row) const {
    if (row == 0) return {0., Kokkos::Experimental::infinity_v<double>};
    return {0, 0, 0, world % 2 ? -0.5 : 0.5};
  }
};
}  // namespace test_types

namespace {
/// The rows of one world as a dense problem: A = Y Y^T + diag C, w = A p + b.
struct Dense {
  int n = 0;
  std::vector<double> A, b, lower, upper, mu, p;
  std::vector<int> friction_of, element_rows;
  std::vector<bool> with_next;
  double at(int i, int j) const { return A[i * n + j]; }
  double w(std::vector<double> const& x, int i) const {
    double sum = b[i];
    for (int j = 0; j < n; ++j) sum += A[i * n + j] * x[j];
    return sum;
  }
  double low(std::vector<double> const& x, int i) const { return friction_of[i] < 0 ? lower[i] : -mu[i] * std::abs(x[friction_of[i]]); }
  double high(std::vector<double> const& x, int i) const { return friction_of[i] < 0 ? upper[i] : mu[i] * std::abs(x[friction_of[i]]); }
  /// Impulse of row i, or of rows i and i + 1 of an ellipse, after a projection; step: by what rates are divided.
  struct Next {
    double p[2], step[2];
  };
  Next next(std::vector<double> const& x, int i, double relaxation = 1) const {
    if (!with_next[i]) return {{std::clamp(x[i] - relaxation * w(x, i) / at(i, i), low(x, i), high(x, i)), 0}, {1 / at(i, i), 0}};
    double const m[2] = {mu[i], mu[i + 1]};
    double const a = m[0] * m[0] * at(i, i), b = m[1] * m[1] * at(i + 1, i + 1), c = m[0] * m[1] * (at(i, i + 1));
    double const largest = (a + b + std::sqrt((a - b) * (a - b) + 4 * c * c)) / 2;
    Next out;
    double length = 0;
    for (int k = 0; k < 2; ++k) {
      out.step[k] = m[k] * m[k] / largest;
      out.p[k] = x[i + k] - relaxation * out.step[k] * w(x, i + k);
      length = std::hypot(length, out.p[k] / m[k]);
    }
    double const scale = std::fmin(1, std::abs(x[friction_of[i]]) / length);
    for (double& p : out.p) p *= scale;
    return out;
  }
};

template <class S>
Dense dense(S const& s, int world) {
  auto const row = gsp_test::host(s.rows.row);
  auto const element_rows = gsp_test::host(s.rows.element_rows);
  auto const Y = gsp_test::host(s.rows.Y);
  auto const first = gsp_test::host(s.rows.first), count = gsp_test::host(s.rows.count);
  auto const ints = gsp_test::host(s.model.ints);
  auto const p = gsp_test::host(s.impulses.p[gsp_test::host(s.impulses.parity)()]);
  Dense d;
  d.n = count(world);
  std::vector<std::vector<double>> y(d.n, std::vector<double>(s.model.nv, 0.));
  for (int i = 0, element = 0; i < d.n; ++i) {
    auto const& r = row(first(world) + i);
    int const has = element_rows(first(world) + i);
    if (has > 0) element = i;
    d.element_rows.push_back(has);
    std::int64_t at = r.first_entry;
    for (int k = 0; k < 2; ++k)
      for (int e = 0; e < r.segment[k].count; ++e, ++at)
        y[i][r.segment[k].dof0 + (r.segment[k].list < 0 ? e : ints(r.segment[k].list + e))] = Y(at);
    d.b.push_back(r.bias), d.lower.push_back(r.lower), d.upper.push_back(r.upper), d.mu.push_back(r.mu),
        d.friction_of.push_back(r.friction_of < 0 ? -1 : element + r.friction_of), d.p.push_back(p(first(world) + i));
    d.with_next.push_back(r.with_next);
  }
  d.A.resize(std::size_t(d.n) * d.n);
  for (int i = 0; i < d.n; ++i)
    for (int j = 0; j < d.n; ++j) {
      for (int k = 0; k < s.model.nv; ++k) d.A[i * d.n + j] += y[i][k] * y[j][k];
      if (i == j) d.A[i * d.n + j] += row(first(world) + i).compliance;
    }
  return d;
}

/// Solves M x = r by elimination with pivots; false where M is singular to 1e-9.
bool solve(std::vector<double> M, std::vector<double>& r) {
  int const n = int(r.size());
  for (int k = 0; k < n; ++k) {
    int best = k;
    for (int i = k + 1; i < n; ++i)
      if (std::abs(M[i * n + k]) > std::abs(M[best * n + k])) best = i;
    if (std::abs(M[best * n + k]) < 1e-9) return false;
    for (int j = 0; j < n; ++j) std::swap(M[k * n + j], M[best * n + j]);
    std::swap(r[k], r[best]);
    for (int i = 0; i < n; ++i) {
      double const f = i == k ? 0 : M[i * n + k] / M[k * n + k];
      for (int j = k; j < n && f != 0; ++j) M[i * n + j] -= f * M[k * n + j];
      r[i] -= f * r[k];
    }
  }
  for (int k = 0; k < n; ++k) r[k] /= M[k * n + k];
  return true;
}

/// All solutions: every row is inside (w = 0), at its lower or at its upper bound.
std::vector<std::vector<double>> enumerate(Dense const& d) {
  std::vector<std::vector<double>> solutions;
  int sets = 1;
  for (int i = 0; i < d.n; ++i) sets *= 3;
  for (int set = 0; set < sets; ++set) {
    std::vector<double> M(std::size_t(d.n) * d.n, 0.), x(d.n);
    std::vector<int> state(d.n);
    bool possible = true;
    for (int i = 0, s = set; i < d.n; ++i, s /= 3) {
      state[i] = s % 3;
      if (state[i] == 0) {
        for (int j = 0; j < d.n; ++j) M[i * d.n + j] = d.A[i * d.n + j];
        x[i] = -d.b[i];
      } else {
        M[i * d.n + i] = 1;
        double const bound = d.friction_of[i] >= 0 ? (state[i] == 1 ? -d.mu[i] : d.mu[i]) : state[i] == 1 ? d.lower[i] : d.upper[i];
        possible &= std::abs(bound) < 1e200;
        if (d.friction_of[i] < 0)
          x[i] = bound;
        else
          x[i] = 0, M[i * d.n + d.friction_of[i]] -= bound;
      }
    }
    if (!possible || !solve(M, x)) continue;
    for (int i = 0; i < d.n && possible; ++i) {
      double const w = d.w(x, i), e = 1e-9;
      possible = x[i] >= d.low(x, i) - e && x[i] <= d.high(x, i) + e && (state[i] == 0 || (state[i] == 1 ? w >= -e : w <= e));
    }
    if (possible) solutions.push_back(x);
  }
  return solutions;
}

/// Largest change that one more projection of a row would make to its rate.
double violation(Dense const& d) {
  double worst = 0;
  for (int i = 0; i < d.n; ++i) {
    if (i > 0 && d.with_next[i - 1]) continue;
    auto const next = d.next(d.p, i);
    for (int k = 0; k < (d.with_next[i] ? 2 : 1); ++k) worst = std::fmax(worst, std::abs(next.p[k] - d.p[i + k]) / next.step[k]);
  }
  return worst;
}

/// Projected Gauss-Seidel row by row from zero; elements of one row and of more take turns.
std::vector<double> gauss_seidel(Dense const& d, int sweeps, double relaxation = 1) {
  std::vector<int> first[2], order;
  for (int i = 0; i < d.n; ++i)
    if (d.element_rows[i] > 0) first[d.element_rows[i] > 1].push_back(i);
  for (std::size_t k = 0; k < std::max(first[0].size(), first[1].size()); ++k)
    for (auto const& list : first)
      if (k < list.size())
        for (int b = 0; b < d.element_rows[list[k]]; ++b) order.push_back(list[k] + b);
  std::vector<double> p(d.n, 0.);
  for (int sweep = 0; sweep < sweeps; ++sweep)
    for (int i : order) {
      if (i > 0 && d.with_next[i - 1]) continue;
      auto const next = d.next(p, i, relaxation);
      p[i] = next.p[0];
      if (d.with_next[i]) p[i + 1] = next.p[1];
    }
  return p;
}

gsp::CompiledModel two_trees() { return gsp::compile(gsp_test::random_model({gsp::JointType::free, gsp::JointType::hinge}, 4)); }
}  // namespace

// 20 worlds of random problems, each solved by trying all active sets. Rows between fixed bounds have one solution (A is positive
// definite); contacts with friction can have several, and ours must be one of them. Sweeps until nothing changes; tolerance: the
// enumeration's own 1e-9 over the least pivot.
TEST_CASE_TEMPLATE("impulses are those of the enumeration of active sets", Exec, GSP_TEST_EXECS) {
  int const worlds = 20;
  auto const c = two_trees();
  Loop<double, Exec> s(c, worlds);
  gsp_test::randomise(c, s.state);
  int inside = 0, bound = 0;
  for (bool contacts : {false, true}) {
    s.solver = gsp::PgsOptions{.iterations = 200000, .tolerance = 5e-12f, .residual = true};
    test_types::RandomRows const type{contacts ? 2 : 6, contacts, 6, 0.5, 0};
    s.assemble(type);
    s.solve(s.solver);
    s.exec.fence();
    auto const residual = gsp_test::host(s.solution.residual);
    for (int w = 0; w < worlds; ++w) {
      auto const d = dense(s, w);
      REQUIRE(d.n == 6);
      auto const solutions = enumerate(d);
      CAPTURE(contacts);
      CAPTURE(w);
      REQUIRE(!solutions.empty());
      double nearest = 1e9;
      for (auto const& x : solutions) {
        double off = 0;
        for (int i = 0; i < d.n; ++i) off = std::fmax(off, std::abs(x[i] - d.p[i]) / std::fmax(1, std::abs(x[i])));
        nearest = std::fmin(nearest, off);
      }
      CHECK(nearest < 1e-7);
      CHECK(residual(w) < 1e-12);
      for (int i = 0; i < d.n; ++i) (d.p[i] > d.low(d.p, i) + 1e-9 && d.p[i] < d.high(d.p, i) - 1e-9 ? inside : bound)++;
    }
    s.forget({.worlds = worlds});
  }
  MESSAGE(inside << " rows inside their bounds, " << bound << " at a bound");
  CHECK(inside > 30);
  CHECK(bound > 30);
}

// After few sweeps: the residual is the largest violation, measured densely; more sweeps, and a warm start, make it smaller.
TEST_CASE_TEMPLATE("residual", Exec, GSP_TEST_EXECS) {
  auto const c = two_trees();
  Loop<double, Exec> s(c, 3);
  gsp_test::randomise(c, s.state);
  test_types::RandomRows const type{8, false, 10, 0, 0};
  CHECK(std::isnan(gsp_test::host(s.solution.residual)(1)));  // not asked for
  s.forget({.worlds = 3});
  s.assemble(type);
  s.solve({.iterations = 1});
  CHECK(std::isnan(gsp_test::host(s.solution.residual)(1)));
  double before = std::numeric_limits<double>::infinity();
  for (int sweeps : {1, 8, 64, 512}) {
    s.forget({.worlds = 3});
    s.assemble(type);
    s.solve({.iterations = sweeps, .tolerance = 0, .residual = true});
    double const residual = gsp_test::host(s.solution.residual)(1);
    CHECK(residual == doctest::Approx(violation(dense(s, 1))).epsilon(1e-9));
    CHECK(residual < before);
    CHECK(gsp_test::host(s.solution.iterations)(1) == sweeps);
    before = residual + 1e-14;
  }
}

// Few rows and many (which a CPU solves on another path) side by side, after some sweeps: the residuals are those of the
// dense problem. Rates are sums of 200 terms below 10^3: 1e-10.
TEST_CASE_TEMPLATE("worlds of few and of many rows", Exec, GSP_TEST_EXECS) {
  auto const c = two_trees();
  Loop<double, Exec> s(c, 5);
  gsp_test::randomise(c, s.state);
  for (bool contacts : {false, true}) {
    test_types::RandomRows const type{5, contacts, 10, 0.6, 40 + 30 * !contacts};
    s.forget({.worlds = 5});
    s.assemble(type);
    if (s.grow()) s.assemble(type);
    s.solve({.iterations = 30, .tolerance = 0, .residual = true});
    auto const residual = gsp_test::host(s.solution.residual);
    for (int w = 0; w < 5; ++w) {
      auto const d = dense(s, w);
      REQUIRE(d.n == (contacts ? 3 : 1) * (5 + (w % 2 ? type.more : 0)));
      CHECK(std::abs(residual(w) - violation(d)) < 1e-10);
    }
  }
}

// Worlds of as many rows and dofs as go in lockstep, side by side, and of as many rows and more dofs, which a host sweeps over groups of
// them: six sweeps equal six sweeps row by row over the dense problem. Each of 6 x 128 impulses is a sum of 128 terms and one a dof, of its
// size: 28 roundings of each, were they all alike. And a world has the same bits alone, beside one other and among all, also after leaps:
// what its elements share a block with is its own.
TEST_CASE_TEMPLATE("the largest of small worlds, and larger ones", Exec, GSP_TEST_EXECS) {
  auto const chain_of = [](int dofs) {
    gsp::Description chain;
    for (int b = 0; b < dofs; ++b) {
      gsp::BodyDescription body;
      body.parent = b, body.has_inertial = true, body.inertial.mass = 1, body.inertial.inertia = {1, 1, 1, 0, 0, 0};
      body.joints.emplace_back();
      chain.bodies.push_back(body);
    }
    return gsp::compile(chain);
  };
  auto const check = [&](auto zero, int dofs) {
    using R = decltype(zero);
    CAPTURE(dofs);
    auto const compiled = chain_of(dofs);
    auto const solved = [&](int first, int worlds, int sweeps) {
      auto s = std::make_unique<Loop<R, Exec>>(compiled, worlds);
      test_types::MostRows const type{dofs, first};
      s->assemble(type);
      if (s->grow()) s->assemble(type);
      s->solve({.iterations = sweeps, .tolerance = 0, .residual = true});
      return s;
    };
    auto const bits = [](Loop<R, Exec> const& s, int world) {
      auto const p = gsp_test::host(s.impulses.p[gsp_test::host(s.impulses.parity)()]);
      auto const z = gsp_test::host(s.solution.z);
      int const first = gsp_test::host(s.rows.first)(world), count = gsp_test::host(s.rows.count)(world);
      std::vector<R> out{gsp_test::host(s.solution.residual)(world)};
      for (int r = 0; r < count; ++r) out.push_back(p(first + r));
      for (int i = 0; i < s.model.nv; ++i) out.push_back(z(world, i));
      return out;
    };
    int const worlds = 21;
    auto const all = solved(0, worlds, 6);
    int most = 0;
    for (int w = 0; w < worlds; ++w) {
      auto const problem = dense(*all, w);
      most = std::max(most, problem.n);
      auto const p = gauss_seidel(problem, 6);
      double worst = 0, largest = 0;
      for (int i = 0; i < problem.n; ++i) {
        worst = std::fmax(worst, std::abs(p[i] - problem.p[i]));
        largest = std::fmax(largest, std::abs(p[i]));
      }
      CAPTURE(w);
      if (problem.n > 0) CHECK(largest > 0.1);
      CHECK(worst <= (128 + dofs) * 28 * double(std::numeric_limits<R>::epsilon()) * largest);
    }
    CHECK(most == 128);
    auto const leapt = solved(0, worlds, 30);
    for (int w = 0; w < 9; ++w) {
      CAPTURE(w);
      auto const expected = bits(*leapt, w);
      CHECK(bits(*solved(w, 1, 30), 0) == expected);
      CHECK(bits(*solved(w, 2, 30), 0) == expected);
    }
    // A solution that one host backend has made room in has room for the threads of another.
    if constexpr (std::is_same_v<typename Exec::memory_space, Kokkos::HostSpace>) {
      if (dofs <= 128) return;
      Loop<R, Exec> s(compiled, worlds);
      test_types::MostRows const type{dofs, 0};
      auto const assemble = [&] {
        s.assemble(type);
        if (s.grow()) s.assemble(type);
      };
      gsp::PgsOptions const options{.iterations = 30, .tolerance = 0, .residual = true};
      assemble();
      gsp::pgs(Kokkos::DefaultHostExecutionSpace(), s.rows, s.impulses, s.solution, s.progress, options);
      auto const all_threads = std::int64_t(s.solution.island_items.extent(0));
      CHECK(all_threads >= s.solution.island_stride * Kokkos::DefaultHostExecutionSpace().concurrency());
      s.solution.island_items = {};
      assemble();
      s.solve(options);  // room of Exec's threads alone
      assemble();
      gsp::pgs(Kokkos::DefaultHostExecutionSpace(), s.rows, s.impulses, s.solution, s.progress, options);
      CHECK(std::int64_t(s.solution.island_items.extent(0)) == all_threads);
    }
  };
  for (int const dofs : {128, 140}) {
    check(0.f, dofs);
    check(0., dofs);
  }
}

// Islands of 24 bodies, of 214, 536 and 1,714 rows: a GPU has blocks of three sizes for them, and in double takes the last in the pools.
// Six sweeps equal six row by row over the dense problem (roundings as above), though what shares no body goes at the same time, and a
// world has the same bits alone, and among so many that GPUs list them.
TEST_CASE_TEMPLATE("islands whose elements go at the same time", Exec, GSP_TEST_EXECS) {
  int const bodies = 24;
  auto const compiled = gsp::compile(gsp_test::random_model(std::vector<gsp::JointType>(bodies, gsp::JointType::free), 1));
  auto const check = [&](auto zero) {
    using R = decltype(zero);
    auto const solved = [&](int first, int worlds, int sweeps) {
      auto s = std::make_unique<Loop<R, Exec>>(compiled, worlds);
      test_types::Crowd const type{bodies, first};
      s->assemble(type);
      if (s->grow()) s->assemble(type);
      s->solve({.iterations = sweeps, .tolerance = 0});
      return s;
    };
    auto const all = solved(0, 3, 6);
    auto const leapt = gsp_test::host(solved(0, 3, 30)->solution.z);
    for (int w = 0; w < 3; ++w) {
      CAPTURE(w);
      auto const problem = dense(*all, w);
      auto const p = gauss_seidel(problem, 6);
      double worst = 0, largest = 0;
      for (int i = 0; i < problem.n; ++i) {
        worst = std::fmax(worst, std::abs(p[i] - problem.p[i]));
        largest = std::fmax(largest, std::abs(p[i]));
      }
      CHECK(problem.n == (w == 0 ? 214 : w == 1 ? 536 : 1714));
      CHECK(largest > 0.1);
      CHECK(worst <= (problem.n + 6 * bodies) * 28 * double(std::numeric_limits<R>::epsilon()) * largest);
      for (int worlds : {1, 300}) {
        if (worlds == 300 && w == 2) continue;  // a third of them in the pools
        auto const alone = gsp_test::host(solved(w, worlds, 30)->solution.z);
        int differ = 0;
        for (int i = 0; i < all->model.nv; ++i) differ += alone(0, i) != leapt(w, i);
        CHECK(differ == 0);
      }
    }
  };
  check(0.f);
  check(0.);
}

// A large island, two small ones and a single contact of one world: each has the bits that it has in a world alone, and six sweeps are
// those over the dense problem of all (to 6 x 312 impulses, sums of as many terms).
TEST_CASE_TEMPLATE("an island has the same bits beside others and alone", Exec, GSP_TEST_EXECS) {
  using test_types::ContactsOfIslands;
  auto const bodies = gsp::compile(gsp_test::random_model(std::vector<gsp::JointType>(6, gsp::JointType::free), 1));
  auto const solved = [&](unsigned present, int worlds, gsp::PgsOptions const& options) {
    auto s = std::make_unique<Loop<double, Exec>>(bodies, worlds);
    ContactsOfIslands const type{present};
    s->assemble(type);
    if (s->grow()) s->assemble(type);
    s->solve(options);
    return s;
  };
  for (gsp::PgsOptions const options : {gsp::PgsOptions{.iterations = 60}, gsp::PgsOptions{.iterations = 6, .tolerance = 0}}) {
    auto const all = solved(15, 3, options);
    if (options.iterations == 6) {
      auto const problem = dense(*all, 1);
      auto const p = gauss_seidel(problem, 6);
      double worst = 0, largest = 0;
      for (int i = 0; i < problem.n; ++i) {
        worst = std::fmax(worst, std::abs(p[i] - problem.p[i]));
        largest = std::fmax(largest, std::abs(p[i]));
      }
      CHECK(problem.n == 312);
      CHECK(largest > 0.1);
      CHECK(worst <= 6 * 312 * 312 * std::numeric_limits<double>::epsilon() * largest);
    }
    auto const z = gsp_test::host(all->solution.z);
    auto const sweeps = gsp_test::host(all->solution.iterations);
    int most = 0;
    for (int island = 0; island < ContactsOfIslands::islands; ++island) {
      CAPTURE(island);
      // So many that GPUs list them, the large one (0) and the small ones.
      int const worlds = island == 0 ? 300 : island == 1 ? 2048 : 1;
      auto const alone = solved(1u << island, worlds, options);
      auto const own = gsp_test::host(alone->solution.z);
      most = std::max(most, gsp_test::host(alone->solution.iterations)(0));
      for (int i = 0; i < all->model.nv; ++i) {
        bool const moves = i >= ContactsOfIslands::dof(island) && i < ContactsOfIslands::dof(island) + ContactsOfIslands::dofs(island);
        CHECK(own(0, i) == (moves ? z(2, i) : 0));
        CHECK(own(worlds - 1, i) == own(0, i));
        if (moves) CHECK(z(2, i) != 0);
      }
    }
    for (int w = 0; w < 3; ++w) CHECK(sweeps(w) == most);
  }
}

// Rows that push on nothing are in no island, have no impulse, and leave the others alone.
TEST_CASE_TEMPLATE("rows that move nothing have no impulse", Exec, GSP_TEST_EXECS) {
  test_types::RandomRows const contacts{5, true, 6, 0.5, 0};
  for (bool const several : {false, true}) {
    auto const c = gsp::compile(gsp_test::random_model(std::vector<gsp::JointType>(several ? 2 : 1, gsp::JointType::free), 1));
    Loop<double, Exec> with(c, 2), without(c, 2);
    gsp::PgsOptions const options{.iterations = 50, .residual = true};
    with.solver = options, without.solver = options;
    with.step(3, contacts, test_types::NothingToMove{}), without.step(3, contacts);
    auto const z = gsp_test::host(with.solution.z), expected = gsp_test::host(without.solution.z);
    auto const p = gsp_test::host(with.impulses.p[gsp_test::host(with.impulses.parity)()]);
    auto const residual = gsp_test::host(with.solution.residual), without_them = gsp_test::host(without.solution.residual);
    for (int w = 0; w < 2; ++w) {
      int const end = gsp_test::host(with.rows.first)(w) + gsp_test::host(with.rows.count)(w);
      REQUIRE(gsp_test::host(with.rows.count)(w) == 17);
      CHECK(p(end - 2) == 0);
      CHECK(p(end - 1) == 0);
      CHECK(residual(w) == without_them(w));
      for (int i = 0; i < c.nv; ++i) CHECK(z(w, i) == expected(w, i));
    }
  }
}

// Elements of four rows go where six have room: what of a world that has gone wrong stands in the places that are left over is nobody's.
// Elements of at most three are lanes of a pack.
TEST_CASE_TEMPLATE("a world of NaN leaves its neighbours alone", Exec, GSP_TEST_EXECS) {
  auto const c = two_trees();
  auto const solved = [&](int most, bool wrong) {
    test_types::MixedElements const type{10, 0, 10, most};  // six: world 0 ends with four rows
    Loop<double, Exec> s(c, 3);
    gsp_test::randomise(c, s.state);
    s.assemble(type);
    if (s.grow()) s.assemble(type);
    if (wrong) {
      auto const row = gsp_test::host(s.rows.row);
      auto const Y = Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace(), s.rows.Y);
      for (int r = 0, first = gsp_test::host(s.rows.first)(0); r < gsp_test::host(s.rows.count)(0); ++r)
        for (int i = 0; i < row(first + r).segment[0].count + row(first + r).segment[1].count; ++i)
          Y(row(first + r).first_entry + i) = std::nan("");
      Kokkos::deep_copy(s.rows.Y, Y);
    }
    s.solve({.iterations = 20, .tolerance = 0, .residual = true});
    CHECK(std::isnan(gsp_test::host(s.solution.residual)(0)) == wrong);
    CHECK(!std::isnan(gsp_test::host(s.solution.residual)(1)));
    return std::array{dense(s, 1).p, dense(s, 2).p};
  };
  for (int most : {6, 3}) CHECK(solved(most, true) == solved(most, false));
}

// One rule of friction for all paths: a row's bound is mu times the impulse of the row that friction_of names, wherever the two stand in
// the element. Six sweeps equal six sweeps row by row over the dense problem, which knows nothing of elements but their order. Impulses of
// 10^2, sums of 250 terms, double: 1e-10. Where few rows converge, no condition is missed.
TEST_CASE_TEMPLATE("friction follows the row that it names", Exec, GSP_TEST_EXECS) {
  auto const c = two_trees();
  int friction = 0, ahead = 0, second = 0, held = 0;
  struct Case {
    int sweeps, most;
    float relaxation = 1;
  };
  for (auto [sweeps, most, relaxation] : {Case{6, 6}, Case{6, 3}, Case{6, 6, 0.7f}, Case{6, 3, 1.3f}, Case{200000, 6}, Case{200000, 3}}) {
    Loop<double, Exec> s(c, 6);
    gsp_test::randomise(c, s.state);
    test_types::MixedElements const type{most == 3 ? 12 : 7, sweeps > 6 ? 0 : most == 3 ? 90 : 53, 10, most};
    s.assemble(type);
    if (s.grow()) s.assemble(type);
    s.solve({.iterations = sweeps, .tolerance = sweeps == 6 ? 0.f : 5e-11f, .relaxation = relaxation, .residual = true});
    auto const residual = gsp_test::host(s.solution.residual);
    for (int w = 0; w < 6; ++w) {
      auto const d = dense(s, w);
      REQUIRE(d.n >= (w % 2 && sweeps == 6 ? 190 : 20));
      if (sweeps == 6) {
        auto const p = gauss_seidel(d, sweeps, double(relaxation));
        double worst = 0;
        for (int i = 0; i < d.n; ++i) worst = std::fmax(worst, std::abs(p[i] - d.p[i]));
        CAPTURE(w);
        CAPTURE(relaxation);
        CHECK(worst < 1e-10);
        CHECK(std::abs(residual(w) - violation(d)) < 1e-9);
        for (int i = 0; i < d.n; ++i) {
          if (d.friction_of[i] < 0) continue;
          ++friction;
          ahead += d.friction_of[i] > i;
          second += d.friction_of[i] < i && i + 1 - d.friction_of[i] > 2 && d.friction_of[d.friction_of[i] + 1] < 0;
          double const bound = d.mu[i] * std::abs(d.p[d.friction_of[i]]);
          held += std::abs(d.p[i]) >= bound;
          if (d.friction_of[i] < i) CHECK(std::abs(d.p[i]) <= bound);  // not by a rounding more
        }
      } else {
        CHECK(violation(d) < 1e-9);
      }
    }
  }
  CHECK(friction > 100);
  CHECK(ahead > 20);
  CHECK(second > 20);  // with another normal between: the last normal before it is not its own
  CHECK(held > 20);
}

// Friction in an ellipse, on all paths, in elements of 3 to 6 rows: six sweeps equal six sweeps over the dense problem (1e-10, as above).
// Converged, each ellipse has its law: rates 0 inside of it; on its edge p_i = -s mu_i^2 w_i with one s >= 0 for both rows, which is
// friction against the slip. Rates are solved to 1e-12, impulses are of 10: 1e-9.
TEST_CASE_TEMPLATE("friction in an ellipse", Exec, GSP_TEST_EXECS) {
  auto const c = two_trees();
  int inside = 0, sliding = 0;
  for (bool mixed : {false, true})
    for (auto [sweeps, elements, relaxation] :
         {std::tuple{6, 7, 1.f}, std::tuple{6, 7, 0.7f}, std::tuple{6, 7, 1.3f}, std::tuple{200000, 3, 1.f}, std::tuple{200000, 1, 1.f}}) {
      Loop<double, Exec> s(c, 6);
      gsp_test::randomise(c, s.state);
      test_types::EllipseElements const type{elements, sweeps > 6 ? 0 : 50, 10, mixed};
      s.assemble(type);
      if (s.grow()) s.assemble(type);
      s.solve({.iterations = sweeps, .tolerance = sweeps == 6 ? 0.f : 5e-11f, .relaxation = relaxation, .residual = true});
      auto const residual = gsp_test::host(s.solution.residual);
      for (int w = 0; w < 6; ++w) {
        auto const d = dense(s, w);
        CAPTURE(w);
        CAPTURE(mixed);
        REQUIRE(d.n >= (w % 2 && sweeps == 6 ? 150 : 3 * elements));
        if (sweeps == 6) {
          auto const p = gauss_seidel(d, sweeps, double(relaxation));
          double worst = 0;
          for (int i = 0; i < d.n; ++i) worst = std::fmax(worst, std::abs(p[i] - d.p[i]));
          CHECK(worst < 1e-10);
          CHECK(std::abs(residual(w) - violation(d)) < 1e-9);
          continue;
        }
        CAPTURE(gsp_test::host(s.solution.iterations)(w));
        CHECK(violation(d) < 1e-9);
        for (int i = 0; i < d.n; ++i) {
          if (!d.with_next[i]) continue;
          double const normal = std::abs(d.p[d.friction_of[i]]), m[2] = {d.mu[i], d.mu[i + 1]}, rate[2] = {d.w(d.p, i), d.w(d.p, i + 1)};
          double const length = std::hypot(d.p[i] / m[0], d.p[i + 1] / m[1]);
          CHECK(length < normal + 1e-9);
          if (length < normal - 1e-9) {
            CHECK(std::fmax(std::abs(rate[0]), std::abs(rate[1])) < 1e-9);
            ++inside;
          } else if (normal > 1e-6) {
            double const along[2] = {m[0] * m[0] * rate[0], m[1] * m[1] * rate[1]};
            CHECK(std::abs(d.p[i] * along[1] - d.p[i + 1] * along[0]) < 1e-9);
            CHECK(d.p[i] * along[0] + d.p[i + 1] * along[1] < 1e-9);
            ++sliding;
          }
        }
      }
    }
  MESSAGE(inside << " stick, " << sliding << " slide");
  CHECK(inside > 2);
  CHECK(sliding > 20);
}

TEST_CASE_TEMPLATE("rows that nobody has written are refused", Exec, GSP_TEST_EXECS) {
  Loop<double, Exec> s(two_trees(), 2);
  CHECK_THROWS_WITH_AS(s.solve({}), doctest::Contains("gsp::pgs: the rows have not been written: call assemble first"),
                       std::invalid_argument);
  s.rows.stamp = {};  // of one's own: none
  CHECK_NOTHROW(s.solve({}));
  CHECK(gsp_test::host(s.solution.iterations)(0) == 0);
}

TEST_CASE_TEMPLATE("rows together that cannot be are refused", Exec, GSP_TEST_EXECS) {
  Loop<double, Exec> s(gsp::compile(gsp_test::sliders(2, 2)), 5);
  s.step(1, test_types::WrongEllipse{});
  auto const status = gsp_test::host(s.state.status);
  for (int w = 0; w < 5; ++w) CHECK(status(w) == (w < 4 ? gsp::status::row_refused | gsp::status::refused_friction : 0u));
}

TEST_CASE_TEMPLATE("friction of a row that the element does not have is refused", Exec, GSP_TEST_EXECS) {
  Loop<double, Exec> s(gsp::compile(gsp_test::sliders(2, 2)), 4);
  s.step(2, test_types::OwnFriction{});
  auto const status = gsp_test::host(s.state.status);
  auto const steps = gsp_test::host(s.state.steps);
  for (int w = 0; w < 4; ++w) {
    CHECK(status(w) == (w % 2 ? gsp::status::row_refused | gsp::status::refused_friction : 0u));
    CHECK(steps(w) == (w % 2 ? 0 : 2));
  }
}

TEST_CASE_TEMPLATE("negative friction is refused", Exec, GSP_TEST_EXECS) {
  Loop<double, Exec> s(gsp::compile(gsp_test::sliders(2, 2)), 4);
  s.step(2, test_types::NegativeFriction{});
  auto const status = gsp_test::host(s.state.status);
  for (int w = 0; w < 4; ++w) CHECK(status(w) == (w % 2 ? gsp::status::row_refused | gsp::status::refused_bounds : 0u));
}

// The stop is each world's own, and a converged warm start needs one sweep.
TEST_CASE_TEMPLATE("a world stops when it has converged", Exec, GSP_TEST_EXECS) {
  auto const c = two_trees();
  Loop<double, Exec> s(c, 4);
  gsp_test::randomise(c, s.state);
  test_types::RandomRows const type{5, false, 8, 0, 0};
  gsp::PgsOptions const options{.iterations = 100000, .least = 1, .tolerance = 5e-8f};
  s.assemble(type);
  s.solve(options);
  auto const cold = gsp_test::snapshot(s.solution.iterations);
  s.solve(options);  // from the impulses that it left
  auto const warm = gsp_test::host(s.solution.iterations);
  bool differ = false;
  for (int w = 0; w < 4; ++w) {
    CHECK(cold(w) > 1);
    CHECK(cold(w) < 100000);
    CHECK(warm(w) == 1);
    differ |= cold(w) != cold(0);
  }
  CHECK(differ);
  CHECK_THROWS_AS(s.solve({.iterations = 0}), std::invalid_argument);
}

// An island whose sweeps are told: each changes a rate by 1 and lowers E by 1.5; a leap finds E least where p has grown by 10, and lower by
// 50 there (leap.hpp: pp = 1, bp = -11). The sweep after the ninth, on which it follows, misses by `thrown` times as much as that.
struct ToldIsland {
  double thrown;
  int* leaps;
  int* taken_back;
  mutable int sweeps = 0;
  KOKKOS_INLINE_FUNCTION gsp::detail::SweepOutcome<double> sweep(bool) const { return {1, ++sweeps == 10 ? thrown : 1, {-1.5, 0, 0}}; }
  KOKKOS_INLINE_FUNCTION void keep(bool) const {}
  KOKKOS_INLINE_FUNCTION void sum() const {}
  KOKKOS_INLINE_FUNCTION void take_back() const { ++*taken_back; }
  KOKKOS_INLINE_FUNCTION gsp::detail::LeapSums<double> leap_sums() const { return {1, 0, 1, -11, 1}; }
  KOKKOS_INLINE_FUNCTION gsp::detail::MixingSums<double> mixing_sums(bool) const { return {}; }
  KOKKOS_INLINE_FUNCTION void go_on(int, gsp::detail::Leap<double> const& leap, gsp::detail::Mixing<double> const&, bool) const {
    *leaps += leap.goes();
  }
};
TEST_CASE("a leap that throws is taken back") {
  for (bool const throws : {false, true}) {
    int leaps = 0, taken_back = 0;
    ToldIsland const island{throws ? 1.1e4 : 0.9e4, &leaps, &taken_back};
    CHECK(gsp::detail::sweep_until_rest(island, gsp::PgsOptions{.iterations = 16}, 0.5, true) == 16);
    CHECK(leaps == 1);
    CHECK(taken_back == int(throws));
  }
}

// Many worlds wait for room on a GPU, and are taken in any order; a few have a warp each. Both are the same to the bit, in a model that is
// small enough for that and in one that is not.
TEST_CASE_TEMPLATE("of many worlds each is solved as among few", Exec, GSP_TEST_EXECS) {
  constexpr int many = 4096, few = 8;
  gsp::CompiledModel const bodies = gsp::compile(gsp_test::random_model(std::vector<gsp::JointType>(23, gsp::JointType::free), 1));
  REQUIRE(bodies.nv > 128);
  for (auto const& c : {two_trees(), bodies}) {
    CAPTURE(c.nv);
    test_types::RandomRows const type{3, true, 8, 0.5, 9};
    auto const solved = [&](int worlds) {
      Loop<double, Exec> s(c, worlds);
      gsp_test::randomise(c, s.state);
      s.solver = {.iterations = 60};
      s.step(2, type);
      return std::pair(gsp_test::snapshot(s.solution.z), gsp_test::snapshot(s.solution.iterations));
    };
    auto const [z, sweeps] = solved(many);
    auto const [z_few, sweeps_few] = solved(few);
    for (int w = 0; w < few; ++w) {
      CHECK(sweeps(w) == sweeps_few(w));
      CHECK(sweeps(w) > 0);
      for (int i = 0; i < c.nv; ++i) REQUIRE(z(w, i) == z_few(w, i));
    }
  }
}
