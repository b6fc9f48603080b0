// Projected Gauss-Seidel of 49 rows x 10 sweeps over 27 dofs, 1,024 worlds, one thread, float: the figures of a fallen humanoid, with full
// rows (no zeros).
#include <cmath>
#include <gsp/model/compile.hpp>
#include <gsp/solver/pgs.hpp>

#include "support/bench.hpp"

namespace {

/// Rows of random entries over all dofs of the one tree: 9 without friction, then contacts of three rows.
template <class R, class Mem>
void fill(gsp::Model<R, Mem> const& model, gsp::Rows<R, Mem> const& rows, int count) {
  std::uint32_t seed = 1;
  auto const next = [&] { return seed = seed * 1664525u + 1013904223u, R(int(seed >> 9)) / R(1 << 22) - R(1); };
  for (int w = 0; w < rows.worlds; ++w) {
    rows.first(w) = w * count, rows.count(w) = count;
    for (int r = 0; r < count; ++r) {
      auto& row = rows.row(w * count + r);
      int const in_contact = r < count % 3 + 9 ? 0 : (r - count % 3 - 9) % 3;
      row = {{{0, -1, model.nv, 0}, {}},
             1,
             in_contact == 0 ? -1 : r - in_contact,
             std::int64_t(w * count + r) * model.nv,
             next(),
             R(0.01),
             R(0),
             R(0),
             R(0)};
      R diagonal(0.01f);
      for (int i = 0; i < model.nv; ++i) rows.Y(row.Y + i) = next(), diagonal += rows.Y(row.Y + i) * rows.Y(row.Y + i);
      row.inverse_diagonal = R(1) / diagonal, row.upper = in_contact == 0 ? R(1e30) : R(0.8);
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
    auto const rows = gsp::make_rows(exec, model, {.worlds = worlds, .rows_per_world = c.rows, .entries_per_world = c.rows * c.dofs});
    fill(model, rows, c.rows);
    // the call includes taking the rows into lockstep; ten sweeps alone are the difference of eleven and one. Tolerance 0: calls start from
    // the impulses of those before, which would stop early
    auto const measure = [&](int sweeps) {
      return gsp_bench::measure(exec, [&] { gsp::pgs(exec, model, rows, {.iterations = sweeps, .tolerance = 0}); });
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
