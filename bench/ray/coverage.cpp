// How much of its field of view a unit has seen after so many seconds: Livox units, whose sequences do not repeat, beside one that turns.
// Cells of 0.2 by 0.2 degrees, evenly in solid angle; a cell is covered where a ray has fallen into it. scripts/coverage draws the lines.
//   bench_ray_coverage
#include <cmath>
#include <gsp/ray/livox_pattern.hpp>
#include <vector>

#include "support/bench.hpp"

namespace {

constexpr double cell = 0.2, degrees = 180 / M_PI;

/// Cells of the sphere, in rows of one elevation.
struct Cells {
  std::vector<int> first{0};
  std::vector<bool> covered, inside;
  template <class Field>
  explicit Cells(Field const& field) {
    for (double up = -90 + cell / 2; up < 90; up += cell) first.push_back(first.back() + columns(up));
    covered.resize(std::size_t(first.back()));
    for (std::size_t row = 0; row + 1 < first.size(); ++row) {
      double const up = -90 + cell * (double(row) + 0.5);
      int const n = columns(up);
      for (int c = 0; c < n; ++c) inside.push_back(field((c + 0.5) * 360 / n - 180, up));
    }
  }
  static int columns(double up) { return std::max(1, int(std::lround(360 * std::cos(up / degrees) / cell))); }
  void cover(gsp::Double3 const& d) {
    std::size_t const row = std::min(first.size() - 2, std::size_t((std::asin(d[2]) * degrees + 90) / cell));
    int const n = first[row + 1] - first[row], c = int((std::atan2(d[1], d[0]) * degrees + 180) / 360 * n);
    covered[std::size_t(first[row] + std::min(n - 1, c))] = true;
  }
  double share() const {
    double all = 0, seen = 0;
    for (std::size_t k = 0; k < covered.size(); ++k) {
      all += inside[k];
      seen += inside[k] && covered[k];
    }
    return seen / all;
  }
};

/// `rate`: rays a second, the pattern's over and over.
template <class Field>
void run(char const* name, gsp::RayPattern const& pattern, double rate, Field const& field) {
  Cells cells(field);
  std::size_t k = 0;
  for (int tick = 1; tick <= 40; ++tick) {
    double const time = 0.05 * tick;
    for (; double(k) < rate * time; ++k) cells.cover(pattern.direction[k % pattern.direction.size()]);
    gsp_bench::Line("ray/coverage", Kokkos::DefaultHostExecutionSpace())
        .add("pattern", name)
        .add("rays", long(k))
        .add("time", time)
        .add("covered", cells.share())
        .print();
  }
}

}  // namespace

int main(int argc, char** argv) {
  Kokkos::ScopeGuard const kokkos(argc, argv);
  auto const cone = [](double half) {
    return [half](double turn, double up) { return std::cos(turn / degrees) * std::cos(up / degrees) > std::cos(half / degrees); };
  };
  run("Mid-40", gsp::mid40_pattern(), 1e5, cone(19.2));
  run("Mid-70", gsp::mid70_pattern(), 1e5, cone(35.2));
  run("Mid-360", gsp::mid360_pattern(0, 400000), 2e5, [](double, double up) { return up > -7 && up < 52; });
  run("VLP-32C", gsp::vlp32c_pattern(), 10 * 32 * 1800, [](double, double up) { return up > -25 && up < 15; });
}
