// Where stiff forces come to rest: profile stable at 2, 20 and 50 ms beside MuJoCo at 0.05 ms (implicitfast), 20 s each. Both solve the
// same equations of rest. What still creeps then is a solution of q' = v(q), of which implicit Euler's differs by h / 2 v ln(v / v_1), v_1
// where the creep began (the error e of q' = v(q) grows by v'(q) e + h / 2 q'', and q'' = v' v): taken twice, v_1 after 1 s. Beside it
// 1e-12, 1e4 roundings, in double. In float positions are sums of two floats, and a spring's length is known to 1e-7 of 1 m: 1e-6; 1e-4 of
// a link that only its weight holds (0.44 N m/rad) below a spring of 1e6 N/m, whose rounding shakes it.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <gsp/io/mjcf.hpp>
#include <gsp/model/compile.hpp>
#include <gsp/step/step.hpp>

#include "oracle/load.hpp"

namespace {

struct Case {
  char const* name;
  std::string xml;  // of worldbody on
  std::vector<double> ctrl, qvel;
  double rounded = 1e-6;  // bound in float
};
std::string const ball = R"(<inertial pos="0 0 -.3" mass="1" diaginertia=".02 .01 .015"/>)";
std::vector<Case> const cases = {
    {"servo on a tendon of two branches",
     R"(<worldbody><body><joint name="x" type="slide" axis="0 0 1" stiffness="100" damping="20"/><geom size=".1" mass="1"/></body>
        <body pos="1 0 0"><joint name="y" type="slide" axis="0 0 1" stiffness="100" damping="20"/><geom size=".1" mass="1"/></body></worldbody>
        <tendon><fixed name="t"><joint joint="x" coef="1"/><joint joint="y" coef="-.5"/></fixed></tendon>
        <actuator><position tendon="t" kp="1e8"/></actuator>)",
     {0.3},
     {}},
    {"spring and damper of a tendon round a drum",
     R"(<worldbody><site name="s" pos=".3 0 .5"/><geom name="drum" type="cylinder" size=".1 .2" euler="90 0 0" contype="0" conaffinity="0"/>
        <body pos="0 0 0"><joint axis="0 1 0" damping=".5"/><geom type="capsule" fromto="0 0 0 -.6 0 0" size=".02" mass="1" contype="0" conaffinity="0"/><site name="e" pos="-.5 0 .02"/>
          <body pos="-.6 0 0"><joint axis="0 1 0" damping=".5"/><geom type="capsule" fromto="0 0 0 -.3 0 0" size=".02" mass=".3" contype="0" conaffinity="0"/></body></body></worldbody>
        <tendon><spatial stiffness="1e6" damping="1e5" springlength=".9"><site site="s"/><geom geom="drum"/><site site="e"/></spatial></tendon>)",
     {},
     {1, -3},
     1e-4},
    {"servos on a ball joint",
     "<worldbody><body><joint name='b' type='ball'/>" + ball + R"(</body></worldbody>
        <actuator><position joint="b" kp="1e5" kv="1e3" gear="1 0 0"/><position joint="b" kp="1e5" kv="1e3" gear="0 1 0"/><position joint="b" kp="1e5" kv="1e3" gear="0 0 1"/></actuator>)",
     {0.5, -0.6, 0.3},
     {}},
    {"servo at its limit",
     "<worldbody><body><joint name='h' axis='0 1 0'/>" + ball + R"(</body></worldbody>
        <actuator><position joint="h" kp="1e5" kv="1e3" forcerange="-20 20"/></actuator>)",
     {-2.5},
     {4}},
    {"servo between two sites",
     "<worldbody><site name='w'/><body><joint axis='0 1 0' damping='.1'/>" + ball + R"(<site name="a" pos="0 0 -.5"/></body></worldbody>
        <actuator><general site="a" refsite="w" gear="1 0 0 0 0 0" gainprm="1e5" biastype="affine" biasprm="0 -1e5 -1e3"/></actuator>)",
     {0.3},
     {}},
    {"a chain in a thick fluid",
     R"(<option viscosity="1e4"/><worldbody><body><joint axis="0 1 0"/><geom type="capsule" fromto="0 0 0 .3 0 0" size=".05"/>
          <body pos=".3 0 0"><joint axis="0 1 0"/><geom type="capsule" fromto="0 0 0 .3 0 0" size=".05"/></body></body></worldbody>)",
     {},
     {20, -30}},
};

template <class R>
std::vector<double> rest(Case const& c, double h) {
  Kokkos::DefaultHostExecutionSpace const exec;
  auto const compiled = gsp::compile(gsp::io::parse_mjcf("<mujoco>" + c.xml + "</mujoco>", "stiff.xml"));
  auto const model = gsp::make_model<R>(exec, compiled, {.timestep = h});
  auto state = gsp::make_state(exec, model);
  auto sim = gsp::make_simulation(exec, model, compiled);
  for (int i = 0; i < int(c.ctrl.size()); ++i) state.ctrl(0, i) = R(c.ctrl[i]);
  for (int i = 0; i < int(c.qvel.size()); ++i) state.qvel(0, i) = R(c.qvel[i]);
  gsp::step(exec, model, state, sim, {.steps = int(std::lround(20 / h))});
  CHECK(state.status(0) == 0);
  std::vector<double> q;
  for (int i = 0; i < model.nq; ++i) q.push_back(double(state.qpos(0, i)) + double(state.qpos_low(0, i)));
  return q;
}

}  // namespace

TEST_CASE("stiff forces come to rest where MuJoCo's do at 0.05 ms") {
  for (auto const& c : cases) {
    CAPTURE(c.name);
    auto const oracle = gsp_test::load_oracle("stiff", "<mujoco>" + c.xml + "</mujoco>");
    mjModel* const m = oracle.m();
    mjData* const d = oracle.d();
    m->opt.timestep = 5e-5;
    m->opt.integrator = mjINT_IMPLICITFAST;
    for (int i = 0; i < int(c.ctrl.size()); ++i) d->ctrl[i] = c.ctrl[i];
    for (int i = 0; i < int(c.qvel.size()); ++i) d->qvel[i] = c.qvel[i];
    std::vector<double> creep(std::size_t(m->nv));
    for (int i = 0; i < 400000; ++i) {
      mj_step(m, d);
      if (i == 20000) std::copy(d->qvel, d->qvel + m->nv, creep.begin());
    }
    auto const lag = [&](int i, double h) {  // of the coordinate i
      if (m->nq != m->nv || std::abs(d->qvel[i]) < 1e-9) return 0.;
      return h * std::abs(d->qvel[i] * std::log(std::abs(d->qvel[i] / creep[std::size_t(i)])));
    };
    for (double h : {0.002, 0.02, 0.05}) {
      CAPTURE(h);
      auto const exact = rest<double>(c, h), rounded = rest<float>(c, h);
      for (int i = 0; i < m->nq; ++i) {
        CAPTURE(i);
        CHECK(std::abs(exact[i] - d->qpos[i]) < 1e-12 + lag(i, h));
        CHECK(std::abs(rounded[i] - d->qpos[i]) < c.rounded + lag(i, h));
      }
    }
  }
}
