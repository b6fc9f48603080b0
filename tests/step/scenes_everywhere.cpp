// The scenes of the project in double: a GPU steps them as a CPU does, to 1e-9 after 100 steps, and on a CPU no bit depends on the number
// of threads or on the batch.
//
// Devices round differently (fused multiplications, sines), so what parts them is a few epsilon a step, times what the scene makes of it.
// That a scene makes little of it is looked at on the host: a shadow starts 1e-13 beside the state (450 epsilon of 1: more than 100 steps
// of a few roundings each) and has to stay within 1e-9 of it, over as many steps as devices are compared for. Places to 1e-9 m and rad;
// velocities to 1e-7: an error of v is one of h v in the place one step later, h = 10 ms.
//
// All go on from what one thread of the host makes of the scene in 50 steps (`settling`), with its impulses; what is thrown is in the air
// then. Geoms of files touch exactly, and at a distance of 0 laws of contacts jump, in both profiles: what comes near stops within the step
// at +0, and is braked over a time constant at -0 (of a speed of 4 mm/s 3 mm/s are left after a step of 2 ms), so that the last bit of a
// place would decide. 50 steps later all lie in their contacts. A step that takes all 100 sweeps is known to what it leaves unsolved:
// without impulses, or while the hand still closes, the grasp is such a scene. Where scenes go on to meet at 0, or have several answers,
// they say so (`chaotic`), and are compared for as long as the shadow, whose error is larger than what a device rounds, stays with the
// state.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <functional>
#include <gsp/model/samples.hpp>
#include <gsp/step/snapshot.hpp>
#include <gsp_test_execs.hpp>
#include <optional>

#include "constraint/four_bar.hpp"
#include "step/scene_files.hpp"
#include "step/scenes.hpp"
#include "step/world.hpp"
#include "support/data.hpp"
#include "support/kernels.hpp"
#include "support/skip.hpp"

namespace {
using Host = Kokkos::DefaultHostExecutionSpace;
constexpr int worlds = 5, steps = 100;

struct Scene {
  std::string name;
  gsp::CompiledModel model;
  std::vector<double> qpos{}, qvel{}, ctrl{};  // of the start; empty: the model's, 0, 0
  double timestep = 0;
  int settling = 50;     // steps of the host before
  bool chaotic[2] = {};  // in profile stable, in profile mujoco: devices agree until the shadow parts from the state, not for all steps
};

gsp::CompiledModel mjcf(std::string const& text) { return gsp::compile(gsp::io::parse_mjcf(text, "scene.xml")); }

/// A chain over a floor whose joints are coupled by tendons that are limited, one of them round a cylinder.
gsp::CompiledModel tendons() {
  return mjcf(R"(<mujoco><option timestep="0.004"/><worldbody><geom type="plane" size="5 5 1"/><site name="s0" pos="0 0 1.2"/>
    <body pos="0 0 1"><joint name="a" axis="0 1 0" damping=".02"/><geom type="capsule" size=".03" fromto="0 0 0 .3 0 0"/>
      <geom name="drum" type="cylinder" size=".05 .1" pos=".3 0 0" euler="90 0 0" contype="0" conaffinity="0"/>
      <body pos=".3 0 0"><joint name="b" axis="0 1 0" damping=".02"/><geom type="capsule" size=".03" fromto="0 0 0 .3 0 0"/><site name="s1" pos=".2 0 .05"/>
        <body pos=".3 0 0"><joint name="c" axis="0 .6 .8"/><geom type="sphere" size=".08"/></body></body></body></worldbody>
    <tendon><fixed name="t" limited="true" range="-.05 .1"><joint joint="b" coef="1"/><joint joint="c" coef="-.7"/></fixed>
      <spatial name="rope" limited="true" range="0 .62"><site site="s0"/><geom geom="drum"/><site site="s1"/></spatial></tendon></mujoco>)");
}

std::vector<Scene> scenes_of_code() {
  std::vector<Scene> all;
  all.push_back({"cradle", gsp::compile(gsp_test::cradle()), {0.2, 0, 0, 0, 0}, {-2, 0, 0, 0, 0}});  // meets the second after 100 steps
  all.back().chaotic[1] = true;  // the others hang beside each other, at a distance of 0
  all.push_back({"pyramid of 55 boxes", gsp::compile(gsp_test::pyramid(5))});
  std::vector<double> const spin{0, 0, 0, 0, 0.3, 50};
  all.push_back({"gyroscope", gsp::compile(gsp_test::gyroscope(1, 50, 0.3, 2.1, 4, 0.314159, 0.01)), {}, spin});
  all.push_back({"gyroscope with friction", gsp::compile(gsp_test::gyroscope(4, 50, 0.3, 2.1, 4, 0.314159, 0.01)), {}, spin});
  all.push_back({"gyroscope in space", gsp::compile(gsp_test::gyroscope_in_space()), {}, {0, 0, 0, 0.1, 10, 0.1}});
  all.push_back({"ramp, stuck", gsp::compile(gsp::samples::ramp(0.25, 0.5))});
  all.push_back({"ramp, slides", gsp::compile(gsp::samples::ramp(0.25, 0.1))});
  all.push_back({"capsule in a V", gsp::compile(gsp_test::capsule_in_v(0.01))});
  all.push_back({"four-bar", gsp_test::four_bar(), gsp_test::four_bar_closed(), {3, 0, 0}});
  all.push_back({"tendons", tendons()});
  // The quadruped among boxes and balls that are thrown: what lands on edges slides and rolls, and most steps take tens of sweeps, mixed
  // and with leaps.
  Scene s{"quadruped, objects thrown", gsp::compile(gsp::samples::quadruped_scene())};
  auto const& m = s.model;
  s.qpos = m.keyframes.at(0).qpos, s.ctrl = m.keyframes.at(0).ctrl, s.qvel.resize(std::size_t(m.nv));
  for (std::size_t j = 1; j < m.jnt_type.size(); ++j) {  // joint 0 is the robot's own
    if (m.jnt_type[j] != int(gsp::JointType::free)) continue;
    double* const q = &s.qpos[std::size_t(m.jnt_qposadr[j])];
    double* const v = &s.qvel[std::size_t(m.jnt_dofadr[j])];
    q[2] += 0.02 * double(j % 5);
    for (int k = 0; k < 2; ++k) v[k] = -q[k] + 0.3 * std::sin(double(3 * j) + k);
    for (int k = 3; k < 6; ++k) v[k] = 2.5 * std::sin(double(7 * j) + 2. * k);
  }
  s.settling = 20;
  all.push_back(s);
  return all;
}

std::optional<std::vector<Scene>> scenes_of_files() {
  auto const spot = gsp_test::data("models/motrix/spot/spot.xml"), store = gsp_test::data("models/motrix/store/store.xml"),
             grasp = gsp_test::data("models/phys_bench/grasp_xml/mjx_pick_cube.xml"),
             humanoid = gsp_test::data("models/mujoco/humanoid/humanoid.xml");
  if (!spot || !store || !grasp || !humanoid) return std::nullopt;
  std::vector<Scene> all;
  Scene s{"Spot", gsp::compile(gsp_test::spot(*spot))};
  s.qpos = s.model.keyframes.at(0).qpos, s.ctrl = s.model.keyframes.at(0).ctrl, s.timestep = 0.01;
  all.push_back(s);
  // what is free beyond the first 60 stands where it is
  auto d = gsp_test::store(*store);
  int bodies = 0;
  for (auto& b : d.bodies)
    if (!b.joints.empty() && ++bodies > 60) b.joints.clear();
  all.push_back({"shelf", gsp::compile(d)});
  all.back().settling = 250;
  all.back().chaotic[0] = true;  // rigid friction has several answers where bodies lie on many points, and sweeps end near one of them
  // around the cube, which the fingers close upon
  s = {"grasp", gsp::compile(gsp_test::grasp(*grasp))};
  s.timestep = 0.01;
  s.settling = 150;     // until its steps take fewer sweeps than there are
  s.chaotic[1] = true;  // servos that are explicit shake the hand at 10 ms: the fingers come to the cube and leave it all the time
  s.ctrl = {-1.0104, 1.5623, 1.3601, -1.6840, -1.5863, 1.7810, 1.4598, 0};
  s.qpos = s.model.qpos0;
  std::copy(s.ctrl.begin(), s.ctrl.end() - 1, s.qpos.begin());
  s.qpos[7] = s.qpos[8] = 0.04;
  all.push_back(s);
  all.push_back({"humanoid, falls", gsp::compile(gsp::io::read_mjcf(*humanoid))});
  return all;
}

template <class Exec>
struct World : gsp_test::World<double, Exec> {
  using Base = gsp_test::World<double, Exec>;
  using Base::model, Base::sim, Base::state;
  World(Scene const& s, gsp::Profile profile, int count = worlds, Exec const& on = Exec{})
      : Base(s.model, count, {.profile = profile, .timestep = s.timestep}, on) {}
  /// World 0 as the scene is, each other with a push of its own.
  void start(Scene const& s) {
    auto const q = this->qpos(), v = this->qvel(), u = gsp_test::host(state.ctrl);
    for (int w = 0; w < state.worlds; ++w) {
      for (std::size_t i = 0; i < s.qpos.size(); ++i) q(w, int(i)) = s.qpos[i];
      for (std::size_t i = 0; i < s.qvel.size(); ++i) v(w, int(i)) = s.qvel[i];
      for (std::size_t i = 0; i < s.ctrl.size(); ++i) u(w, int(i)) = s.ctrl[i];
      for (int i = 0; i < model.nv; ++i) v(w, i) += 1e-3 * w * std::sin(1.7 * i + 0.9 * w);
    }
    Kokkos::deep_copy(state.qpos, q), Kokkos::deep_copy(state.qvel, v), Kokkos::deep_copy(state.ctrl, u);
  }
  /// From worlds first, first + 1, ... of another; `shadow`: beside them.
  template <class Other>
  void go_on(Other const& from, int first = 0, double shadow = 0) {
    start(from, first, shadow);
    this->step(1);  // so that a snapshot knows its types of rows
    start(from, first, shadow);
    auto const theirs = gsp::make_snapshot(from.exec, from.state, from.sim).impulses;
    auto snapshot = gsp::make_snapshot(this->exec, state, sim);
    auto& own = snapshot.impulses;
    gsp::detail::make_room(this->exec, std::int64_t(theirs.p.extent(0)), own);
    std::pair<std::size_t, std::size_t> const rows{0, theirs.p.extent(0)}, from_worlds{first, first + state.worlds},
        own_worlds{0, state.worlds};
    Kokkos::deep_copy(Kokkos::subview(own.p, rows), theirs.p), Kokkos::deep_copy(Kokkos::subview(own.id, rows), theirs.id);
    Kokkos::deep_copy(Kokkos::subview(own.place, rows, Kokkos::ALL), theirs.place);
    auto const of_worlds = [&](auto const& to, auto const& view) {
      Kokkos::deep_copy(Kokkos::subview(to, own_worlds), Kokkos::subview(view, from_worlds));
    };
    of_worlds(own.first, theirs.first), of_worlds(own.count, theirs.count), of_worlds(own.kept, theirs.kept);
    Kokkos::View<bool*, typename Base::Mem> const all("all", state.worlds);
    Kokkos::deep_copy(all, true);
    gsp::restore(this->exec, snapshot, state, sim, all);
  }
  /// The same without its impulses.
  template <class Other>
  void start(Other const& from, int first = 0, double shadow = 0) {
    auto const q = this->qpos(), v = this->qvel(), low = gsp_test::host(state.qpos_low), u = gsp_test::host(state.ctrl),
               act = gsp_test::host(state.act);
    auto const& other = from.state;  // on the host
    for (int w = 0; w < state.worlds; ++w) {
      gsp_test::Random r;
      for (int i = 0; i < model.nq; ++i) q(w, i) = other.qpos(first + w, i) + shadow * r();
      for (int i = 0; i < int(low.extent(1)); ++i) low(w, i) = other.qpos_low(first + w, i);
      for (int i = 0; i < model.nv; ++i) v(w, i) = other.qvel(first + w, i) + shadow * r();
      for (int i = 0; i < model.nu; ++i) u(w, i) = other.ctrl(first + w, i);
      for (int i = 0; i < int(act.extent(1)); ++i) act(w, i) = other.act(first + w, i);
    }
    Kokkos::deep_copy(state.qpos, q), Kokkos::deep_copy(state.qpos_low, low), Kokkos::deep_copy(state.qvel, v);
    Kokkos::deep_copy(state.ctrl, u), Kokkos::deep_copy(state.act, act);
  }
};

/// A state of all worlds, as the host reads it.
struct Shot {
  Kokkos::View<double**, Kokkos::LayoutRight, Kokkos::HostSpace> qpos, low, qvel;
  std::vector<unsigned> status;
  template <class W>
  explicit Shot(W const& w)
      : qpos("q", w.state.worlds, w.model.nq), low("l", w.state.worlds, w.state.qpos_low.extent(1)), qvel("v", w.state.worlds, w.model.nv) {
    auto const q = gsp_test::snapshot(w.state.qpos), l = gsp_test::snapshot(w.state.qpos_low), v = gsp_test::snapshot(w.state.qvel);
    auto const bits = gsp_test::snapshot(w.state.status);
    for (int k = 0; k < w.state.worlds; ++k) {
      for (int i = 0; i < w.model.nq; ++i) qpos(k, i) = q(k, i);
      for (int i = 0; i < int(low.extent(1)); ++i) low(k, i) = l(k, i);
      for (int i = 0; i < w.model.nv; ++i) qvel(k, i) = v(k, i);
      status.push_back(bits(k));
    }
  }
};
template <class V>
bool same_row(V const& a, int row_a, V const& b, int row_b) {
  return a.extent(1) == 0 || std::memcmp(&a(row_a, 0), &b(row_b, 0), sizeof(double) * a.extent(1)) == 0;
}
bool same(Shot const& a, int row_a, Shot const& b, int row_b) {
  return same_row(a.qpos, row_a, b.qpos, row_b) && same_row(a.low, row_a, b.low, row_b) && same_row(a.qvel, row_a, b.qvel, row_b) &&
         a.status[std::size_t(row_a)] == b.status[std::size_t(row_b)];
}
/// How far apart world w of both is, in units of what is allowed: 1e-9 m and rad, 1e-7 m/s and rad/s.
double apart(Shot const& a, Shot const& b, int w) {
  double worst = 0;
  auto const raise = [&](double off) { worst = std::fmax(worst, std::isfinite(off) ? off : INFINITY); };
  for (int i = 0; i < int(a.qpos.extent(1)); ++i) raise(std::abs(a.qpos(w, i) - b.qpos(w, i)) / 1e-9);
  for (int i = 0; i < int(a.qvel.extent(1)); ++i) raise(std::abs(a.qvel(w, i) - b.qvel(w, i)) / 1e-7);
  return worst;
}

template <class Exec>
void compare(Scene const& s) {
  INFO(s.name);
  constexpr int few = 30;  // steps of the runs that are about bits alone: from no impulses, so that sweeps run out in some
  for (auto const profile : {gsp::Profile::stable, gsp::Profile::mujoco}) {
    CAPTURE(int(profile));
#if defined(KOKKOS_ENABLE_OPENMP)
    Kokkos::OpenMP const one(1);
#else
    Host const one{};
#endif
    World<Host> before(s, profile, worlds, one), reference(s, profile, worlds, one), shadow(s, profile, worlds, one);
    World<Exec> other(s, profile);
    before.start(s);
    before.step(s.settling);
    World<Host> brief(s, profile, worlds, one);
    reference.go_on(before), other.go_on(before), shadow.go_on(before, 0, 1e-13), brief.start(before);
    brief.step(few);
    Shot const early(brief);
    for (int w = 0; w < worlds; ++w) CHECK(early.status[std::size_t(w)] == 0);
    World<Host> alone(s, profile, 1, one);
    alone.start(before, 3);
    alone.step(few);
    CHECK(same(Shot(alone), 0, early, 3));
#if defined(KOKKOS_ENABLE_OPENMP)
    for (int const threads : {2, 16}) {
      CAPTURE(threads);
      if (threads > Kokkos::OpenMP().concurrency()) continue;  // Kokkos has room for no more: CTest runs this with 16
      World<Host> many(s, profile, worlds, Kokkos::OpenMP(threads));
      many.start(before);
      many.step(few);
      Shot const shot(many);
      for (int w = 0; w < worlds; ++w) CHECK(same(shot, w, early, w));
    }
#endif
    int horizon = steps;
    if (s.chaotic[int(profile)]) {
      World<Host> one_by_one(s, profile, worlds, one), beside(s, profile, worlds, one);
      one_by_one.go_on(before), beside.go_on(before, 0, 1e-13);
      auto const parted = [&] {
        one_by_one.step(1), beside.step(1);
        Shot const a(one_by_one), b(beside);
        double most = 0;
        for (int w = 0; w < worlds; ++w) most = std::fmax(most, apart(a, b, w));
        return most > 1;
      };
      for (horizon = 0; horizon < steps && !parted();) ++horizon;
      CHECK(horizon > 0);
    }
    reference.step(horizon), other.step(horizon), shadow.step(horizon);
    Shot const expected(reference), found(other), beside(shadow);
    double grown = 0, worst = 0, moved = 0;
    for (int w = 0; w < worlds; ++w) {
      CAPTURE(w);
      grown = std::fmax(grown, apart(expected, beside, w)), worst = std::fmax(worst, apart(expected, found, w));
      CHECK(expected.status[std::size_t(w)] == 0);
      CHECK(apart(expected, beside, w) <= 1);
      CHECK(apart(expected, found, w) <= 1);
      if (std::is_same_v<Exec, Host>) CHECK(same(found, w, expected, w));
      for (int i = 0; i < reference.model.nv; ++i) moved = std::fmax(moved, std::abs(expected.qvel(w, i)));
    }
    int const rows = gsp_test::host(reference.sim.rows.count)(0);
    MESSAGE(s.name << ", " << (profile == gsp::Profile::stable ? "stable" : "mujoco") << ", " << horizon << " steps: 1e-13 grows to "
                   << grown << " of the bar, devices are " << worst << " of it apart; " << rows << " rows at the end, up to " << moved
                   << " m/s or rad/s");
  }
}
}  // namespace

TEST_CASE_TEMPLATE("scenes of code go alike on every device, in any batch, on any number of threads", Exec, GSP_TEST_EXECS) {
  for (auto const& s : scenes_of_code()) compare<Exec>(s);
}

TEST_CASE_TEMPLATE("scenes of files go alike on every device, in any batch, on any number of threads" * doctest::test_suite("data"), Exec,
                   GSP_TEST_EXECS) {
  auto const all = scenes_of_files();
  if (!all) return gsp_test::skip("models of motrix, phys_bench or mujoco/humanoid are missing from GSP_DATA_DIR");
  for (auto const& s : *all) compare<Exec>(s);
}
