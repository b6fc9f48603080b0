// Projected Gauss-Seidel of 49 rows x 10 sweeps over 27 dofs, 1,024 worlds, one thread, float: the figures of a fallen humanoid, with full
// rows (no zeros).
#include <cmath>
#include <gsp/model/compile.hpp>
#include <gsp/solver/pgs.hpp>

#include "support/bench.hpp"

namespace {

/// Rows of random entries over all dofs of the one tree: 9 without friction, then contacts of three rows.
template <class R, class Mem>
void fill(gsp::Rows<R, Mem> const& rows, int count) {
  int const nv = rows.nv, singles = count % 3 + 9, entries = count * nv + (count - singles);  // and three couplings a contact
  std::uint32_t seed = 1;
  auto const next = [&] { return seed = seed * 1664525u + 1013904223u, R(int(seed >> 9)) / R(1 << 22) - R(1); };
  for (int w = 0; w < rows.worlds; ++w) {
    rows.first(w) = w * count, rows.count(w) = count;
    for (int r = 0; r < count; ++r) {
      auto& row = rows.row(w * count + r);
      int const in_contact = r < singles ? 0 : (r - singles) % 3, contact = r - in_contact;
      row = {};
      row.segment[0] = {-1, nv, 0};
      rows.element_rows(w * count + r) = in_contact > 0 ? 0 : r < singles ? 1 : 3;
      row.friction_of = in_contact > 0 ? 0 : -1;
      row.element = r;
      row.same_segments = in_contact == 0;
      row.first_entry = std::int64_t(w) * entries + std::int64_t(r) * nv + (r < singles ? 0 : contact - singles + 3);
      row.bias = next(), row.compliance = R(0.01), row.upper = R(1e30), row.mu = in_contact > 0 ? R(0.8) : R(-1);
      R diagonal(0.01f);
      for (int i = 0; i < nv; ++i)
        rows.Y(row.first_entry + i) = next(), diagonal += rows.Y(row.first_entry + i) * rows.Y(row.first_entry + i);
      row.inverse_diagonal = R(1) / diagonal;
      for (int a = 0; a < in_contact; ++a) {  // before the entries of the contact's three rows
        auto const& other = rows.row(w * count + contact + a);
        R sum(0);
        for (int i = 0; i < nv; ++i) sum += rows.Y(row.first_entry + i) * rows.Y(other.first_entry + i);
        rows.Y(rows.row(w * count + contact).first_entry - 3 + in_contact * (in_contact - 1) / 2 + a) = sum;
      }
    }
  }
}

gsp::CompiledModel chain(int nv) {
  gsp::Description d;
  for (int b = 0; b < nv; ++b) {
    gsp::BodyDescription body;
    body.parent = b, body.has_inertial = true, body.inertial.mass = 1, body.inertial.inertia = {1, 1, 1, 0, 0, 0};
    body.joints.emplace_back();
    d.bodies.push_back(body);
  }
  return gsp::compile(d);
}

}  // namespace

int main(int argc, char** argv) {
  Kokkos::ScopeGuard kokkos(argc, argv);
  Kokkos::Serial const exec;
  struct Case {
    int dofs, rows;
  };
  for (Case c : {Case{27, 49}, Case{18, 32}, Case{35, 64}}) {
    int const worlds = 1024;
    auto const model = gsp::make_model<float>(exec, chain(c.dofs));
    auto rows = gsp::make_rows(exec, model, {.worlds = worlds, .rows_per_world = c.rows, .entries_per_world = c.rows * (c.dofs + 1)});
    fill(rows, c.rows);
    rows.stamp = {};
    auto impulses = gsp::make_impulses(exec, rows);
    auto solution = gsp::make_solution(exec, model, {.worlds = worlds});
    auto progress = gsp::make_progress(exec);
    // the call includes taking the rows into lockstep; ten sweeps alone are the difference of eleven and one. Tolerance 0: calls start from
    // the impulses of those before, which would stop early
    auto const measure = [&](int sweeps) {
      return gsp_bench::measure(exec, [&] { gsp::pgs(exec, rows, impulses, solution, progress, {.iterations = sweeps, .tolerance = 0}); });
    };
    for (int i = 0; i < 3; ++i) {
      auto const one = measure(1), ten = measure(10), eleven = measure(11);
      gsp_bench::Line("solver/pgs", exec)
          .add("rows", c.rows)
          .add("dofs", c.dofs)
          .add("sweeps", 10)
          .add("worlds", worlds)
          .add("precision", "float")
          .add(ten)
          .add("call_us_per_world", 1e6 * ten.median / worlds)
          .add("sweeps_us_per_world", 1e6 * (eleven.median - one.median) / worlds)
          .print();
    }
  }
}
