#pragma once
#include <cmath>
#include <gsp/model/compile.hpp>
#include <string>
#include <utility>
#include <vector>

namespace gsp_test {

struct FourBar {
  double damping = 0.01;
  bool rigid = false;
  double timestep = 0.002;
};
/// Crank 0.1, rod 0.3, rocker 0.25, ground 0.3 m, closed by an equality as stiff as a step of 2 ms allows, or rigid. The loop is closed at
/// four_bar_closed(), not at 0.
inline gsp::CompiledModel four_bar(FourBar const& options = {}) {
  gsp::Description d;
  d.option.timestep = options.timestep;
  auto const link = [&](std::string name, int parent, gsp::Double3 pos, double length) {
    gsp::BodyDescription b;
    b.parent = parent, b.name = std::move(name), b.pos = pos, b.has_inertial = true;
    b.inertial.mass = length, b.inertial.pos = {length / 2, 0, 0}, b.inertial.inertia = {1e-4, 1e-3, 1e-3, 0, 0, 0};
    b.joints.emplace_back().name = b.name;
    b.joints[0].axis = {0, -1, 0}, b.joints[0].damping = options.damping;
    d.bodies.push_back(b);
    return int(d.bodies.size()) - 1;
  };
  int const crank = link("crank", 0, {0, 0, 0}, 0.1);
  link("rod", crank, {0.1, 0, 0}, 0.3);
  link("rocker", 0, {0.3, 0, 0}, 0.25);
  gsp::EqualityDescription loop;
  loop.name = "loop", loop.type = gsp::EqualityType::connect, loop.name1 = "rod", loop.name2 = "rocker";
  loop.data[0] = 0.3, loop.softness.solref = {0.004, 1}, loop.rigid.hard = options.rigid;
  d.equalities = {loop};
  auto compiled = gsp::compile(d);
  for (int c = 0; c < 3; ++c) compiled.eq_data[0][3 + std::size_t(c)] = c == 0 ? 0.25 : 0;  // the rocker's end, which qpos0 has elsewhere
  return compiled;
}
/// Its angles with the crank at 0: the rod's end on circles of 0.3 about (0.1, 0) and 0.25 about (0.3, 0).
inline std::vector<double> four_bar_closed() {
  double const x = (0.09 - 0.0625 - 0.01 + 0.09) / 0.4, z = std::sqrt(0.09 - (x - 0.1) * (x - 0.1));
  return {0, std::atan2(z, x - 0.1), std::atan2(z, x - 0.3)};
}

}  // namespace gsp_test
