#pragma once
// Worlds of a model with all that a step needs: what tests of steps derive theirs from.
#include <doctest/doctest.h>

#include <gsp/model/compile.hpp>
#include <gsp/step/step.hpp>

#include "dynamics/random_tree.hpp"

namespace gsp_test {

inline gsp::GeomDescription geom(gsp::ShapeType type, gsp::Double3 size, double mass = 0) {
  gsp::GeomDescription g;
  g.type = type;
  g.size = size;
  g.has_mass = mass > 0;
  g.mass = mass;
  return g;
}
/// A body of one geom, free.
inline void add_free(gsp::Description& d, gsp::Double3 pos, gsp::GeomDescription const& g) {
  gsp::BodyDescription b;
  b.parent = 0;
  b.pos = pos;
  b.joints.emplace_back().type = gsp::JointType::free;
  b.geoms.push_back(g);
  d.bodies.push_back(b);
}

template <class R, class Exec>
struct World {
  using Mem = typename Exec::memory_space;
  Exec exec;
  gsp::CompiledModel compiled;
  gsp::Model<R, Mem> model;
  gsp::State<R, Mem> state;
  gsp::Simulation<R, Mem> sim;
  explicit World(gsp::CompiledModel const& c, int worlds = 1, gsp::ModelOptions options = {}, Exec const& on = Exec{})
      : exec(on),
        compiled(c),
        model(gsp::make_model<R>(exec, c, options)),
        state(gsp::make_state(exec, model, {.worlds = worlds})),
        sim(gsp::make_simulation(exec, model, c, {.worlds = worlds})) {}
  bool may_stop = false;  // worlds may: what is said of them must not hold because they stand still
  void step(int n, gsp::PgsOptions solver = {}) {
    gsp::step(exec, model, state, sim, {.steps = n, .solver = solver});
    auto const status = host(state.status);
    for (int w = 0; w < state.worlds && !may_stop; ++w) REQUIRE(status(w) == 0);
  }
  auto qpos() const { return host(state.qpos); }
  auto qvel() const { return host(state.qvel); }
};

}  // namespace gsp_test
