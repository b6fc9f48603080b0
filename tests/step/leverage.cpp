// Rows that nothing can move, or next to nothing, and rows that differ by next to nothing: contacts across a rail, welds and contacts of
// what turns about its centre, the edges of a pyramid of little friction.
#include <doctest/doctest.h>

#include <cmath>
#include <gsp/constraint/contact_forces.hpp>
#include <gsp/io/mjcf.hpp>

#include "step/world.hpp"
#include "support/kernels.hpp"

namespace {

template <class R>
struct World : gsp_test::World<R, Kokkos::DefaultHostExecutionSpace> {
  using Base = gsp_test::World<R, Kokkos::DefaultHostExecutionSpace>;
  World(std::string const& text, gsp::Profile profile)
      : Base(gsp::compile(gsp::io::parse_mjcf("<mujoco>" + text + "</mujoco>", "model.xml")), 1, {.profile = profile}) {}
  double speed() const {
    auto const v = Base::qvel();
    double worst = 0;
    for (int i = 0; i < Base::model.nv; ++i) worst = std::fmax(worst, v(0, i) == v(0, i) ? std::abs(double(v(0, i))) : INFINITY);
    return worst;
  }
  unsigned status() const { return gsp_test::host(Base::state.status)(0); }
};

}  // namespace

// Edges n +- mu t are as soft as mu^2: 1e-8 of |Y|^2 and less, so that rounding of a sum of them is more than the 1 that the Hessian has
// where nothing holds. The box lies still: it sinks by |g| / K (1 - d) / d times mu^2, nothing.
TEST_CASE_TEMPLATE("a box lies on pyramids of little friction", R, float, double) {
  struct Case {
    double mu, impratio;
  };
  for (auto const [mu, impratio] : {Case{0, 1}, Case{1e-4, 1}, Case{1e-3, 1}, Case{1e-2, 100}, Case{1, 1e6}}) {
    std::string const friction = " friction='" + std::to_string(mu) + "'";
    World<R> w("<option impratio='" + std::to_string(impratio) + "'/><worldbody><geom type='plane' size='5 5 .1'" + friction +
                   "/><body pos='0 0 .1'><freejoint/><geom type='box' size='.1 .1 .1'" + friction + "/></body></worldbody>",
               gsp::Profile::mujoco);
    w.step(1000);
    CAPTURE(mu);
    CHECK(w.status() == 0);
    CHECK(w.speed() < 5e-4);  // g h = 0.02; a rounding of 0.1 m in a step is 3e-6 m/s, over an arm of 0.1 m 3e-5 rad/s
    CHECK(std::abs(double(w.qpos()(0, 2)) - 0.1) < 1e-4);
  }
}

// A ball on a hinge through its centre, welded 0.1 m off: its inverse inertia at the centre is 0, and MuJoCo makes all rows as soft as each
// other, 1e-15. So the rows that ask for different rates weigh by the square of their leverage: w = -sum Y b / sum Y^2, the number that
// MuJoCo has.
TEST_CASE_TEMPLATE("rows of a weld weigh by their leverage", R, float, double) {
  World<R> w(
      "<worldbody><body name='b' pos='.378 -.338 .112'><joint/><geom size='.28' density='193'/></body></worldbody>"
      "<equality><weld body1='b' relpose='.1 0 .1 .9 .1 .2 .3'/></equality>",
      gsp::Profile::mujoco);
  auto const q = gsp_test::host(w.state.qpos);
  q(0, 0) = R(0.035);
  Kokkos::deep_copy(w.state.qpos, q);
  w.step(1);
  CHECK(double(w.qvel()(0, 0)) == doctest::Approx(18.47475238).epsilon(std::is_same_v<R, float> ? 1e-4 : 1e-7));
}

// A ball on a hinge through its centre, pressed against another: the normal has no leverage but by rounding.
TEST_CASE_TEMPLATE("a ball on an axis does not turn where it is pressed", R, float, double) {
  std::string const text =
      "<worldbody><geom size='.3' pos='-1.2987520098439185 -0.5638235120658672 0.2834645284076248'/>"
      "<body pos='-0.9363221409373843 -0.6706116870041745 0.24295680299952704' euler='-27.836697474557518 77.05463282380634 "
      "36.7945923462359'>"
      "<joint axis='0.6350314368921064 2.383144774863942 0.9444794869904138'/><geom size='.1'/></body></worldbody>";
  World<R> w(text, gsp::Profile::mujoco);
  double worst = 0;
  for (int i = 0; i < 200; ++i) {
    w.step(1);
    worst = std::fmax(worst, w.speed());
  }
  CHECK(worst < 1e-3);
}

// A contact across a rail: its normal moves nothing and carries what its softness makes of the overlap x = -1 mm, at an impedance d = 0.95
//   N = -zeta / (h C) = K d x d / ((1 - d) diag),   K = 1 / (0.95 * 0.0125)^2,   diag = 1 / m
// and friction mu N stops the box: a quarter of it each of four corners.
TEST_CASE_TEMPLATE("what slides on a rail is pressed into the floor", R, float, double) {
  for (char const* const tilt : {"0", "1e-12"}) {
    World<R> w("<worldbody><geom type='plane' size='5 5 .1' euler='0 " + std::string(tilt) +
                   " 0'/><body pos='0 0 .099'><joint type='slide' axis='1 0 0'/><geom type='box' size='.1 .1 .1' mass='1'/></body>"
                   "</worldbody>",
               gsp::Profile::stable);
    auto const v = gsp_test::host(w.state.qvel);
    v(0, 0) = R(10);
    Kokkos::deep_copy(w.state.qvel, v);
    double const d = 0.95, K = 1 / (0.95 * 0.95 * 0.0125 * 0.0125), N = 4 * K * d * 0.001 * d / (1 - d);
    w.step(1);
    CHECK(double(w.qvel()(0, 0)) == doctest::Approx(10 - 0.002 * N).epsilon(1e-5));
    w.step(100);
    CHECK(w.speed() < 1e-6);
  }
}

// A rigid contact across a rail that is tilted as its floor is: of |Y|^2 rounding is left, 1e-15 in float, by which the overlap of 1 mm
// would throw the ball (1e6 m/s and more in the first step). Nothing can move it: it bears nothing, and the ball slides as g sin(tilt)
// makes it, but for rounding of each of 100 steps.
TEST_CASE_TEMPLATE("what is jammed across its rail is not thrown", R, float, double) {
  constexpr double radian = 0.017453292519943295;
  for (int const tilt : {7, 23, 37, 61, 79}) {
    std::string const euler = " euler='0 " + std::to_string(tilt) + " 0'";
    std::string const x = std::to_string(0.099 * std::sin(tilt * radian)), z = std::to_string(0.099 * std::cos(tilt * radian));
    World<R> w("<worldbody><geom type='plane' size='5 5 .1' hard='true' condim='1'" + euler + "/><body pos='" + x + " 0 " + z + "'" +
                   euler + "><joint type='slide' axis='1 0 0'/><geom size='.1' mass='3' hard='true' condim='1'/></body></worldbody>",
               gsp::Profile::stable);
    w.step(100);
    CAPTURE(tilt);
    CHECK(w.status() == 0);
    CHECK(double(w.qvel()(0, 0)) == doctest::Approx(9.81 * std::sin(tilt * radian) * 0.2).epsilon(1e-5));
  }
}

// A tendon between two bodies that are welded to each other cannot give way, whatever its limit asks for: its row is 0 but for rounding,
// and as soft as MuJoCo's least, 1e-15, so that it bears 1e13 N s and more. The body swings as without it: 100 roundings of 10 rad/s apart.
TEST_CASE_TEMPLATE("a tendon between bodies that are one moves nothing", R, float, double) {
  for (int const angle : {10, 50, 130, -130}) {
    auto const profile = angle < 100 && angle > 0 ? gsp::Profile::stable : gsp::Profile::mujoco;
    std::string const body = "<worldbody><body euler='" + std::to_string(angle) +
                             " 20 30'><joint axis='.3 .5 .8' pos='.2 -.1 .15'/><geom size='.1' mass='1' pos='.13 .2 .07'/>"
                             "<body pos='.02 .25 .2' euler='20 -80 10'><joint type='ball' pos='-.13 -.17 .17'/><geom size='.1' mass='.1'/>"
                             "<site name='a' pos='-.16 .11 -.05'/><body pos='.03 .08 -.11' euler='50 10 -40'><geom size='.05' mass='.2'/>"
                             "<site name='b' pos='0 -.03 -.12'/></body></body></body></worldbody>";
    World<R> with(body + "<tendon><spatial limited='true' range='0 .01'><site site='a'/><site site='b'/></spatial></tendon>", profile);
    World<R> without(body, profile);
    for (World<R>* w : {&with, &without}) {
      auto const v = gsp_test::host(w->state.qvel);
      for (int i = 0; i < 4; ++i) v(0, i) = R(i - 1.5);
      Kokkos::deep_copy(w->state.qvel, v);
      w->step(100);
    }
    CAPTURE(angle);
    CHECK(with.status() == 0);
    for (int i = 0; i < 4; ++i) CHECK(std::abs(double(with.qvel()(0, i)) - double(without.qvel()(0, i))) < 100 * 1.2e-7 * 10);
  }
}

// A floor tilted against its rail by 1e-4 rad sees 1e8 m, of which a rigid contact takes for its overlap x what all bodies weigh, m:
//   v+ = 1e-4 p / m,   p = |u| / 1e-8 m + m (1e3 |g| h + |zeta|),   zeta = -erp x / h,   u = -1e-4 v
// where all of it would be zeta / 1e-4, 1 km/s: so what slides into the wedge is stopped, however fast. Tolerance: x to 1e-8 of 1e-3.
TEST_CASE_TEMPLATE("a rigid contact in a wedge is stopped, and not thrown by its overlap", R, float, double) {
  double const h = 0.002, zeta = 0.2 * 0.001 / h, push = 1e-4 * (1e3 * 9.81 * h + zeta);
  for (double const v : {0., -50.}) {
    World<R> w(
        "<worldbody><geom type='plane' size='5 5 .1' hard='true' condim='1' euler='0 .005729577951308232 0'/><body pos='0 0 .099'>"
        "<joint type='slide' axis='1 0 0'/><geom size='.1' mass='3' hard='true' condim='1'/></body></worldbody>",
        gsp::Profile::stable);
    auto const start = gsp_test::host(w.state.qvel);
    start(0, 0) = R(v);
    Kokkos::deep_copy(w.state.qvel, start);
    w.step(1);
    CAPTURE(v);
    CHECK(std::abs(double(w.qvel()(0, 0)) - push) < 1e-4 * push + 1e-5 * std::abs(v));
  }
}
