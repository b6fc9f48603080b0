#pragma once
// A scene that has something of all that a step does, and worlds of it that differ in all that a user may give.
#include <cmath>
#include <gsp/model/samples.hpp>

#include "step/world.hpp"

namespace gsp_test {

/// A robot with servos that falls among boxes and balls, a servo with an activation, a ball on a weld, and a body that the user moves.
inline gsp::CompiledModel everything() {
  auto d = gsp::samples::quadruped_scene({.boxes = 3, .balls = 2});
  d.keyframes.clear();
  d.actuators[0].dynamics = gsp::ActuatorDynamics::filter;
  d.actuators[0].dynprm[0] = 0.05;
  add_free(d, {0, 0, 2}, geom(gsp::ShapeType::sphere, {0.1, 0, 0}, 1));
  d.bodies.back().name = "hung";
  d.equalities.push_back({.type = gsp::EqualityType::weld, .name1 = "hung", .data = {0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1}});
  gsp::BodyDescription hand;
  hand.parent = 0;
  hand.name = "hand";
  hand.pos = {3, 0, 1};
  hand.mocap = true;
  hand.geoms.push_back(geom(gsp::ShapeType::box, {0.2, 0.2, 0.1}));
  d.bodies.push_back(hand);
  add_free(d, {3, 0, 1.21}, geom(gsp::ShapeType::box, {0.1, 0.1, 0.1}, 1));
  return gsp::compile(d);
}
/// Worlds that differ, in everything that a user may give.
template <class W>
void start(W& w) {
  auto const set = [](auto const& view, int world, int i, double value) {
    auto const h = snapshot(view);
    h(world, i) = value;
    Kokkos::deep_copy(view, h);
  };
  for (int i = 0; i < w.state.worlds; ++i) {
    set(w.state.qpos, i, 2, 0.6);                                                                      // dropped
    for (int k = 0; k < w.model.nv; ++k) set(w.state.qvel, i, k, 2 * std::sin(1. + 1.7 * k + 3 * i));  // what lies there tumbles
    for (int k = 0; k < 12; ++k) set(w.state.ctrl, i, k, 0.3 * std::cos(2. * k + i));
    set(w.state.qfrc_applied, i, 0, 5 + i);
  }
  auto const mocap = snapshot(w.state.mocap_pos);
  mocap(0, 0, 0) += 0.05;
  Kokkos::deep_copy(w.state.mocap_pos, mocap);
  auto const active = snapshot(w.state.eq_active);
  active(w.state.worlds - 1, 0) = 0;
  Kokkos::deep_copy(w.state.eq_active, active);
}

}  // namespace gsp_test
