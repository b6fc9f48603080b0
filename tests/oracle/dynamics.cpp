#include <doctest/doctest.h>

#include <cmath>
#include <cstring>
#include <gsp/dynamics/integrate.hpp>
#include <gsp/dynamics/smooth.hpp>
#include <gsp/io/mjcf.hpp>
#include <gsp/io/write_mjcf.hpp>
#include <gsp/model/compile.hpp>
#include <gsp/model/samples.hpp>

#include "dynamics/random_tree.hpp"
#include "oracle/load.hpp"
#include "support/data.hpp"

// Smooth dynamics against MuJoCo, profile `mujoco`, double, constraints disabled in both. Relative error: max norm of the difference over
// max(1, max norm). Bounds are those of the project: 1e-10 for quantities of a state, 1e-11 for one step, max(1e-10, 100 x MuJoCo's own
// response to 1e-15) for trajectories.
namespace {

using Exec = Kokkos::DefaultHostExecutionSpace;
using Mem = Exec::memory_space;

struct Pair {
  gsp_test::Oracle oracle;
  gsp::CompiledModel compiled;
};

/// `text`: what MuJoCo reads instead of the file.
Pair load(std::string const& path, std::string const& text, gsp::Description const& description) {
  Pair p;
  p.oracle = gsp_test::load_oracle(path, text);
  p.oracle.m()->opt.disableflags |= mjDSBL_CONSTRAINT | mjDSBL_AUTORESET;
  p.oracle.m()->opt.enableflags &= ~mjENBL_SLEEP;
  p.compiled = gsp::compile(description);
  p.compiled.option.constraint = false;
  REQUIRE(p.compiled.nq == p.oracle.m()->nq);
  REQUIRE(p.compiled.nv == p.oracle.m()->nv);
  REQUIRE(p.compiled.nu == p.oracle.m()->nu);
  return p;
}

/// Random state around qpos0: joints within +-0.5, free bodies within 1 m of their place and turned at random, velocities within +-2, full
/// controls.
void randomise(mjModel const* m, mjData* d, gsp_test::Random& r) {
  mj_resetData(m, d);
  for (int j = 0; j < m->njnt; ++j) {
    int q = m->jnt_qposadr[j];
    if (m->jnt_type[j] == mjJNT_FREE)
      for (int c = 0; c < 3; ++c, ++q) d->qpos[q] = m->qpos0[q] + r();
    if (m->jnt_type[j] == mjJNT_FREE || m->jnt_type[j] == mjJNT_BALL) {
      auto const quat = gsp_test::random_quat(r);
      for (int c = 0; c < 4; ++c) d->qpos[q + c] = quat[c];
    } else {
      d->qpos[q] = m->qpos0[q] + 0.5 * r();
    }
  }
  for (int i = 0; i < m->nv; ++i) d->qvel[i] = 2 * r();
  for (int i = 0; i < m->nu; ++i) {
    double const lo = m->actuator_ctrllimited[i] ? m->actuator_ctrlrange[2 * i] : -1,
                 hi = m->actuator_ctrllimited[i] ? m->actuator_ctrlrange[2 * i + 1] : 1;
    d->ctrl[i] = lo + (hi - lo) * (0.5 + 0.6 * r());  // beyond the range now and then: clamping is part of it
  }
}

struct Error {
  double difference = 0, reference = 1;
  void add(double value, double ref) {
    difference = std::fmax(difference, std::isfinite(value) ? std::fabs(value - ref) : INFINITY),
    reference = std::fmax(reference, std::fabs(ref));
  }
  double relative() const { return difference / reference; }
};

struct Side {
  Exec exec;
  gsp::Model<double, Mem> model;
  gsp::State<double, Mem> state;
  gsp::Dynamics<double, Mem> dynamics;
  gsp::Poses<double, Mem> poses;
  Side(gsp::CompiledModel const& c, int worlds)
      : model(gsp::make_model<double>(exec, c, {.profile = gsp::Profile::mujoco})),
        state(gsp::make_state(exec, model, {.worlds = worlds})),
        dynamics(gsp::make_dynamics(exec, model, {.worlds = worlds})),
        poses(gsp::make_poses(exec, model, {.worlds = worlds})) {}
  void set(int w, mjData const* d) {
    for (int i = 0; i < model.nq; ++i) state.qpos(w, i) = d->qpos[i];
    for (int i = 0; i < model.nv; ++i) state.qvel(w, i) = d->qvel[i];
    for (int i = 0; i < model.nu; ++i) state.ctrl(w, i) = d->ctrl[i];
  }
  void step() {
    gsp::smooth_dynamics(exec, model, state, dynamics, poses);
    gsp::integrate(exec, model, dynamics, state);
    exec.fence();
  }
};

void check_quantities(Pair const& p, gsp_test::Random& r, double (&worst)[7]) {
  int const worlds = 10;
  mjModel const* m = p.oracle.m();
  mjData* d = p.oracle.d();
  Side s(p.compiled, worlds);
  struct Reference {
    std::vector<double> xpos, xquat, M, bias, passive, actuator, acceleration;
  };
  std::vector<Reference> reference(worlds);
  std::size_t const nv = m->nv;
  for (int w = 0; w < worlds; ++w) {
    randomise(m, d, r);
    s.set(w, d);
    mj_forward(m, d);
    auto& ref = reference[w];
    ref.xpos.assign(d->xpos, d->xpos + 3 * m->nbody), ref.xquat.assign(d->xquat, d->xquat + 4 * m->nbody);
    ref.M.resize(nv * nv);
    mj_fullM(m, d, ref.M.data());
    ref.bias.assign(d->qfrc_bias, d->qfrc_bias + nv), ref.passive.assign(d->qfrc_passive, d->qfrc_passive + nv);
    ref.actuator.assign(d->qfrc_actuator, d->qfrc_actuator + nv), ref.acceleration.assign(d->qacc_smooth, d->qacc_smooth + nv);
  }
  gsp::smooth_dynamics(s.exec, s.model, s.state, s.dynamics, s.poses, {.keep_all = true});
  Kokkos::View<double***, Kokkos::LayoutRight, Mem> M("M", worlds, nv, nv);
  Kokkos::View<double**, Kokkos::LayoutRight, Mem> bias("bias", worlds, nv), passive("passive", worlds, nv),
      actuator("actuator", worlds, nv), acceleration("acceleration", worlds, nv);
  gsp::dense_mass_matrix(s.exec, s.model, s.dynamics, M);
  gsp::copy_dofs(s.exec, s.model, s.dynamics, &gsp::DynamicsLayout::bias, bias);
  gsp::copy_dofs(s.exec, s.model, s.dynamics, &gsp::DynamicsLayout::passive, passive);
  gsp::copy_dofs(s.exec, s.model, s.dynamics, &gsp::DynamicsLayout::actuator, actuator);
  gsp::copy_dofs(s.exec, s.model, s.dynamics, &gsp::DynamicsLayout::acceleration, acceleration);
  s.exec.fence();
  for (int w = 0; w < worlds; ++w) {
    auto const& ref = reference[w];
    Error e[7];
    for (int b = 0; b < m->nbody; ++b) {
      double dot = 0;
      for (int c = 0; c < 3; ++c) e[0].add(s.poses.xpos(w, b, c), ref.xpos[3 * b + c]);
      for (int c = 0; c < 4; ++c) dot += s.poses.xquat(w, b, c) * ref.xquat[4 * b + c];
      for (int c = 0; c < 4; ++c) e[1].add((dot < 0 ? -1 : 1) * s.poses.xquat(w, b, c), ref.xquat[4 * b + c]);
    }
    for (std::size_t i = 0; i < nv; ++i)
      for (std::size_t j = 0; j < nv; ++j) e[2].add(M(w, i, j), ref.M[i * nv + j]);
    for (std::size_t i = 0; i < nv; ++i)
      e[3].add(bias(w, i), ref.bias[i]), e[4].add(passive(w, i), ref.passive[i]), e[5].add(actuator(w, i), ref.actuator[i]),
          e[6].add(acceleration(w, i), ref.acceleration[i]);
    for (int k = 0; k < 7; ++k) worst[k] = std::fmax(worst[k], e[k].relative());
  }
}

void check_single_steps(Pair const& p) {
  int const worlds = 1000;
  mjModel const* m = p.oracle.m();
  mjData* d = p.oracle.d();
  Side s(p.compiled, worlds);
  gsp_test::Random r{0x1234567};
  std::vector<double> next(std::size_t(worlds) * (m->nq + m->nv));
  for (int w = 0; w < worlds; ++w) {  // states that the oracle visits: a new start every 50 steps
    if (w % 50 == 0) randomise(m, d, r);
    s.set(w, d);
    mj_step(m, d);
    std::memcpy(&next[std::size_t(w) * (m->nq + m->nv)], d->qpos, sizeof(double) * m->nq);
    std::memcpy(&next[std::size_t(w) * (m->nq + m->nv) + m->nq], d->qvel, sizeof(double) * m->nv);
  }
  s.step();
  double worst = 0;
  for (int w = 0; w < worlds; ++w) {
    double const* const ref = &next[std::size_t(w) * (m->nq + m->nv)];
    Error e;
    for (int i = 0; i < m->nq; ++i) e.add(s.state.qpos(w, i), ref[i]);
    for (int i = 0; i < m->nv; ++i) e.add(s.state.qvel(w, i), ref[m->nq + i]);
    worst = std::fmax(worst, e.relative());
  }
  MESSAGE("one step " << worst);
  CHECK(worst <= 1e-11);
}

void check_trajectories(Pair const& p) {
  int const starts = 10, steps = 1000;
  mjModel const* m = p.oracle.m();
  Side s(p.compiled, starts);
  std::vector<gsp_test::Oracle> a(starts), b(starts);
  gsp_test::Random r{0xabcdef};
  for (int w = 0; w < starts; ++w) {
    a[w].data.reset(mj_makeData(m)), b[w].data.reset(mj_makeData(m));
    randomise(m, a[w].d(), r);
    s.set(w, a[w].d());
    mj_copyData(b[w].d(), m, a[w].d());
    for (int i = 0; i < m->nq; ++i) b[w].d()->qpos[i] += 1e-15 * r();
  }
  std::vector<bool> open(starts, true);
  std::vector<int> until(starts, steps);
  double worst = 0;
  for (int t = 1; t <= steps; ++t) {
    s.step();
    for (int w = 0; w < starts; ++w) {
      if (!open[w]) continue;
      mj_step(m, a[w].d()), mj_step(m, b[w].d());
      Error own, ours;
      for (int i = 0; i < m->nq; ++i) own.add(b[w].d()->qpos[i], a[w].d()->qpos[i]), ours.add(s.state.qpos(w, i), a[w].d()->qpos[i]);
      for (int i = 0; i < m->nv; ++i) own.add(b[w].d()->qvel[i], a[w].d()->qvel[i]), ours.add(s.state.qvel(w, i), a[w].d()->qvel[i]);
      if (!(own.relative() <= 1e-6)) {
        open[w] = false, until[w] = t;
        continue;
      }
      double const bound = std::fmax(1e-10, 100 * own.relative());
      if (ours.relative() > bound) {
        CAPTURE(w);
        CAPTURE(t);
        CAPTURE(own.relative());
        CHECK(ours.relative() <= bound);
        open[w] = false, until[w] = -t;
      }
      worst = std::fmax(worst, ours.relative() / bound);
    }
  }
  std::string lengths;
  for (int w = 0; w < starts; ++w) lengths += std::to_string(until[w]) + " ";
  MESSAGE("worst error over bound " << worst << "; compared up to steps " << lengths);
}

void check(Pair const& p) {
  double worst[7] = {};
  gsp_test::Random r;
  for (int i = 0; i < 10; ++i) check_quantities(p, r, worst);
  std::string const names[] = {"xpos", "xquat", "M", "bias", "passive", "actuator", "acceleration"};
  for (int k = 0; k < 7; ++k) {
    MESSAGE(names[k] << " " << worst[k]);
    CHECK(worst[k] <= 1e-10);
  }
  check_single_steps(p);
  check_trajectories(p);
}

void check(std::string const& name) {
  auto const path = gsp_test::data(name);
  if (!path) {
    MESSAGE("skipped: " << name << " is missing from GSP_DATA_DIR");
    return;
  }
  bool const meshes = name.find("go2") != std::string::npos;
  check(load(*path, meshes ? gsp_test::without_meshes(*path) : std::string(),
             gsp::io::read_mjcf(*path, {.skip_visuals = true, .approximate = true})));
}

}  // namespace

TEST_CASE("sample quadruped, written as MJCF") {
  auto const quadruped = gsp::samples::quadruped();
  check(load("quadruped.xml", gsp::io::format_mjcf(quadruped), quadruped));
}
TEST_CASE("humanoid") { check("models/mujoco/humanoid/humanoid.xml"); }
TEST_CASE("go2") { check("models/unitree/go2/go2.xml"); }
TEST_CASE("22 humanoids") { check("models/mujoco/humanoid/22_humanoids.xml"); }
