// Every reader of the dynamics after every stage: the right number, or the sentence that says what to call. The right numbers are those
// that smooth_dynamics with keep_all gives of a copy of the state. On hosts a fused stage keeps a part alone, on a GPU all of it stays
// where it was: which readers are refused must not depend on that, so each stage has its list, the same on every backend.
#include <doctest/doctest.h>

#include <cmath>
#include <functional>
#include <gsp/constraint/assemble.hpp>
#include <gsp/constraint/joint_limit.hpp>
#include <gsp/dynamics/energy.hpp>
#include <gsp/dynamics/inverse.hpp>
#include <gsp/dynamics/jacobian.hpp>
#include <gsp/dynamics/runge_kutta.hpp>
#include <gsp/dynamics/set_constants.hpp>
#include <gsp/dynamics/subtree.hpp>
#include <gsp/sensor/smooth_sensors.hpp>
#include <gsp/solver/pgs.hpp>
#include <gsp_test_execs.hpp>

#include "dynamics/random_tree.hpp"
#include "support/kernels.hpp"

namespace {
using gsp::JointType;
using gsp::Profile;

/// Two trees with every joint type, sites, a string between the trees, a motor and a winch with an activation. `all`: sensors of all that
/// smooth_dynamics keeps when asked; else of what it always leaves.
gsp::CompiledModel model_of(bool all) {
  auto d = gsp_test::random_model({JointType::free, JointType::hinge}, 6, 5);
  for (auto& body : d.bodies) {
    gsp::SiteDescription site;
    site.name = body.name + "site";
    site.pos = {0.05, 0.1, -0.05};
    body.sites.push_back(site);
  }
  gsp::TendonDescription t;
  t.name = "string";
  t.stiffness = 4;
  t.path = {{gsp::WrapType::site, d.bodies[1].name + "site"}, {gsp::WrapType::site, d.bodies.back().name + "site"}};
  d.tendons.push_back(t);
  gsp::ActuatorDescription motor;
  motor.name = "motor";
  motor.target_name = "t1b1j0";
  motor.gear[0] = 3;
  d.actuators.push_back(motor);
  motor.name = "winch";
  motor.target = gsp::Transmission::tendon;
  motor.target_name = "string";
  motor.dynamics = gsp::ActuatorDynamics::filter;
  motor.dynprm[0] = 0.05;
  d.actuators.push_back(motor);
  auto const sensor = [&](char const* type, char const* object_type = "", std::string const& object = "") {
    d.sensors.push_back({.type = type, .object_type = object_type, .object = object});
  };
  std::string const site = d.bodies[2].name + "site";
  sensor("gyro", "site", site);
  sensor("framepos", "site", site);
  sensor("tendonpos", "tendon", "string");
  sensor("actuatorpos", "actuator", "winch");
  if (all) {
    sensor("e_kinetic");
    sensor("tendonvel", "tendon", "string");
    sensor("actuatorfrc", "actuator", "winch");
    sensor("jointactuatorfrc", "joint", "t1b1j0");
    sensor("subtreeangmom", "body", d.bodies[1].name);
  }
  return gsp::compile(d);
}

gsp::CompiledModel const& compiled_model(bool all) {
  static gsp::CompiledModel const models[] = {model_of(false), model_of(true)};
  return models[all];
}

template <class Exec>
struct World {
  static constexpr int worlds = 5;
  using Mem = typename Exec::memory_space;
  template <class D>
  using View = Kokkos::View<D, Kokkos::LayoutRight, Mem>;
  Exec exec;
  gsp::CompiledModel const &few, &all;
  gsp::Model<double, Mem> model;
  gsp::State<double, Mem> state;
  gsp::Dynamics<double, Mem> dynamics;
  gsp::Poses<double, Mem> poses;
  gsp::Rows<double, Mem> rows;
  gsp::Impulses<double, Mem> impulses;
  gsp::Solution<double, Mem> solution;
  gsp::Progress<Mem> progress;
  gsp::Sensors<double, Mem> few_sensors, all_sensors;
  explicit World(Profile profile)
      : few(compiled_model(false)),
        all(compiled_model(true)),
        model(gsp::make_model<double>(exec, all, {.profile = profile})),
        state(gsp::make_state(exec, model, {.worlds = worlds})),
        dynamics(gsp::make_dynamics(exec, model, {.worlds = worlds})),
        poses(gsp::make_poses(exec, model, {.worlds = worlds})),
        rows(gsp::make_rows(exec, model, {.worlds = worlds})),
        impulses(gsp::make_impulses(exec, rows)),
        solution(gsp::make_solution(exec, model, {.worlds = worlds})),
        progress(gsp::make_progress(exec)),
        few_sensors(gsp::make_sensors(exec, model, few, {.worlds = worlds})),
        all_sensors(gsp::make_sensors(exec, model, all, {.worlds = worlds})) {
    gsp_test::randomise(all, state);
    Kokkos::deep_copy(state.ctrl, 0.7);
    Kokkos::deep_copy(state.act, -0.4);
  }
  void smooth(bool keep_all) { gsp::smooth_dynamics(exec, model, state, poses, dynamics, {.keep_all = keep_all}); }
  void single(int stages) {
    if (stages > 0) gsp::forward_kinematics(exec, model, state, poses, dynamics);
    if (stages > 1) gsp::mass_matrix(exec, model, state, poses, dynamics);
    if (stages > 2) gsp::bias_forces(exec, model, state, poses, dynamics);
    if (stages > 3) gsp::passive_forces(exec, model, state, poses, dynamics);
    if (stages > 4) gsp::actuator_forces(exec, model, state, poses, dynamics);
    if (stages > 5) gsp::factor(exec, model, state, dynamics);
  }
  void step() {
    smooth(false);
    gsp::assemble(exec, model, state, dynamics, gsp::constraints(gsp::JointLimits(model, state)), rows, impulses, progress);
    gsp::pgs(exec, rows, impulses, solution, progress);
    gsp::integrate(exec, model, state, dynamics, progress, solution);
  }
};

template <class View>
std::vector<double> numbers(View const& v) {
  auto const h = gsp_test::host(v);
  return {h.data(), h.data() + h.size()};
}

template <class Exec>
struct Reader {
  std::string name;
  std::function<std::vector<double>(World<Exec>&)> read;
};
/// Readers 0-5 copy what is there, of whatever moment; the others are about the state as it is now.
template <class Exec>
std::vector<Reader<Exec>> readers() {
  using S = World<Exec>;
  using L = gsp::DynamicsLayout;
  auto const dofs = [](int L::*item) {
    return [item](S& s) {
      typename S::template View<double**> const out("out", S::worlds, s.model.nv);
      gsp::copy_dofs(s.exec, s.model, s.dynamics, item, out);
      return numbers(out);
    };
  };
  auto const sensors = [](gsp::Sensors<double, typename S::Mem> S::*table) {
    return [table](S& s) {
      typename S::template View<double**> const out("out", S::worlds, (s.*table).nsensordata);
      gsp::smooth_sensors(s.exec, s.model, s.state, s.poses, s.dynamics, s.*table, out);
      return numbers(out);
    };
  };
  return {{"dense_mass_matrix",
           [](S& s) {
             typename S::template View<double***> const out("out", S::worlds, s.model.nv, s.model.nv);
             gsp::dense_mass_matrix(s.exec, s.model, s.dynamics, out);
             return numbers(out);
           }},
          {"bias", dofs(&L::bias)},
          {"passive", dofs(&L::passive)},
          {"actuator", dofs(&L::actuator)},
          {"force", dofs(&L::force)},
          {"acceleration", dofs(&L::acceleration)},
          {"energies",
           [](S& s) {
             typename S::template View<double**> const out("out", S::worlds, 2);
             gsp::energies(s.exec, s.model, s.state, s.poses, s.dynamics, out);
             return numbers(out);
           }},
          {"inverse_dynamics",
           [](S& s) {
             typename S::template View<double**> const qacc("qacc", S::worlds, s.model.nv), out("out", S::worlds, s.model.nv);
             Kokkos::deep_copy(qacc, 0.3);
             gsp::inverse_dynamics(s.exec, s.model, s.dynamics, qacc, out);
             return numbers(out);
           }},
          {"site_jacobian",
           [](S& s) {
             typename S::template View<double***> const out("out", S::worlds, 6, s.model.nv);
             gsp::site_jacobian(s.exec, s.model, s.poses, s.dynamics, 3, out);
             return numbers(out);
           }},
          {"subtree_momentum",
           [](S& s) {
             auto out = gsp::make_subtrees(s.exec, s.model, {.worlds = S::worlds});
             gsp::subtree_com(s.exec, s.model, s.poses, out);
             gsp::subtree_momentum(s.exec, s.model, s.poses, s.dynamics, out);
             return numbers(out.angmom);
           }},
          {"sensors of what is always left", sensors(&S::few_sensors)},
          {"sensors of all", sensors(&S::all_sensors)},
          {"assemble", [](S& s) {
             gsp::assemble(s.exec, s.model, s.state, s.dynamics, gsp::constraints(gsp::JointLimits(s.model, s.state)), s.rows, s.impulses,
                           s.progress);
             return numbers(s.rows.count);
           }}};
}
constexpr int first_of_now = 6;

template <class Exec>
struct Stage {
  std::string name;
  std::function<void(World<Exec>&)> run;
  char const *stable, *mujoco;  // one letter a reader, in their order: 1 the right number, 0 the sentence
};
}  // namespace

TEST_CASE_TEMPLATE("a reader gives the right number or says what to call", Exec, GSP_TEST_EXECS) {
  using S = World<Exec>;
  char const *const none = "0000000000000", *const whole = "1111111111111", *const before = "1111110000000";
  std::vector<Stage<Exec>> const stages{
      {"nothing", [](S&) {}, none, none},
      {"forward_kinematics", [](S& s) { s.single(1); }, none, none},
      {"mass_matrix", [](S& s) { s.single(2); }, "1000000010000", "1000000010000"},
      {"bias_forces", [](S& s) { s.single(3); }, "1100000011000", "1100000011000"},
      {"passive_forces", [](S& s) { s.single(4); }, "1110001111000", "1110001111000"},
      {"actuator_forces", [](S& s) { s.single(5); }, "1111001111110", "1111001111110"},
      {"factor", [](S& s) { s.single(6); }, whole, whole},
      // M and the total force are kept for the integrator of profile mujoco
      {"smooth_dynamics", [](S& s) { s.smooth(false); }, "0000000011101", "1000101011101"},
      {"smooth_dynamics with keep_all", [](S& s) { s.smooth(true); }, whole, whole},
      {"smooth_dynamics twice", [](S& s) { s.smooth(true), s.smooth(false); }, "0000000011101", "1000101011101"},
      {"integrate",
       [](S& s) {
         s.smooth(true);
         gsp::integrate(s.exec, s.model, s.state, s.dynamics);
       },
       before, before},
      {"a step with constraints", [](S& s) { s.step(); }, none, "1000100000000"},
      {"a step and forward_kinematics",
       [](S& s) {
         s.step();
         s.single(1);
       },
       none, "1000100000000"},
      {"a step and smooth_dynamics with keep_all",
       [](S& s) {
         s.step();
         s.smooth(true);
       },
       whole, whole},
      {"reset",
       [](S& s) {
         s.smooth(true);
         gsp::reset(s.exec, s.model, s.state);
       },
       before, before},
      {"smooth_step",
       [](S& s) {
         s.smooth(true);
         gsp::smooth_step(s.exec, s.model, s.state, s.poses, s.dynamics);
       },
       none, none},
      {"runge_kutta",
       [](S& s) {
         s.smooth(true);
         auto rk = gsp::make_runge_kutta(s.exec, s.model, {.worlds = S::worlds});
         gsp::runge_kutta(s.exec, s.model, s.state, s.poses, s.dynamics, rk);
       },
       none, none},
  };
  for (Profile const profile : {Profile::stable, Profile::mujoco})
    for (auto const& stage : stages) {
      CAPTURE(int(profile));
      CAPTURE(stage.name);
      auto const all = readers<Exec>();
      for (int k = 0; k < int(all.size()); ++k) {  // on worlds of its own, as some readers write
        CAPTURE(all[k].name);
        S world(profile), reference(profile);
        stage.run(world);
        if (k >= first_of_now) {  // the state as it is now
          Kokkos::deep_copy(reference.state.qpos, world.state.qpos);
          Kokkos::deep_copy(reference.state.qvel, world.state.qvel);
          Kokkos::deep_copy(reference.state.act, world.state.act);
          Kokkos::deep_copy(reference.state.ctrl, world.state.ctrl);
        }
        if (k < first_of_now && stage.name.find("and smooth_dynamics") != std::string::npos) reference.step();
        reference.smooth(true);
        bool const expected = (profile == Profile::stable ? stage.stable : stage.mujoco)[k] == '1';
        std::string sentence;
        std::vector<double> found;
        try {
          found = all[k].read(world);
        } catch (std::invalid_argument const& e) { sentence = e.what(); }
        CAPTURE(sentence);
        CHECK(sentence.empty() == expected);
        if (!sentence.empty()) {
          CHECK(sentence.find(": call smooth_dynamics") != std::string::npos);
          continue;
        }
        auto const right = all[k].read(reference);
        REQUIRE(found.size() == right.size());
        double worst = 0;  // the same sums in the same order, a few roundings apart where stages are not fused
        for (std::size_t i = 0; i < found.size(); ++i)
          worst = std::fmax(worst, std::abs(found[i] - right[i]) / std::fmax(1., std::abs(right[i])));
        CHECK(worst <= 1e-12);
      }
    }
}

TEST_CASE_TEMPLATE("dynamics of one state say nothing of another", Exec, GSP_TEST_EXECS) {
  World<Exec> s(Profile::stable);
  auto const& exec = s.exec;
  auto other = gsp::make_state(exec, s.model, {.worlds = World<Exec>::worlds});
  typename World<Exec>::template View<double**> const energy("energy", World<Exec>::worlds, 2),
      qacc("qacc", World<Exec>::worlds, s.model.nv), qfrc("qfrc", World<Exec>::worlds, s.model.nv);
  char const* const of_another = "are of another state";
  s.smooth(true);
  CHECK_THROWS_WITH_AS(gsp::energies(exec, s.model, other, s.poses, s.dynamics, energy), doctest::Contains(of_another),
                       std::invalid_argument);
  CHECK_THROWS_WITH_AS(gsp::integrate(exec, s.model, other, s.dynamics), doctest::Contains(of_another), std::invalid_argument);
  CHECK_THROWS_WITH_AS(gsp::factor(exec, s.model, other, s.dynamics), doctest::Contains(of_another), std::invalid_argument);
  CHECK_THROWS_WITH_AS(
      gsp::assemble(exec, s.model, other, s.dynamics, gsp::constraints(gsp::JointLimits(s.model, other)), s.rows, s.impulses, s.progress),
      doctest::Contains(of_another), std::invalid_argument);
  // M of one state, forces of another
  auto copy = s.dynamics;  // copies share what they hold
  gsp::forward_kinematics(exec, s.model, other, s.poses, copy);
  gsp::mass_matrix(exec, s.model, other, s.poses, copy);
  CHECK_THROWS_WITH_AS(gsp::inverse_dynamics(exec, s.model, s.dynamics, qacc, qfrc), doctest::Contains(of_another), std::invalid_argument);
  // a step twice, factor twice in profile stable, set_constants
  s.smooth(true);
  gsp::integrate(exec, s.model, s.state, s.dynamics);
  CHECK_THROWS_WITH_AS(gsp::integrate(exec, s.model, s.state, s.dynamics), doctest::Contains("before its last step or reset"),
                       std::invalid_argument);
  s.single(6);
  CHECK_THROWS_WITH_AS(gsp::factor(exec, s.model, s.state, s.dynamics), doctest::Contains("call actuator_forces again"),
                       std::invalid_argument);
  CHECK_THROWS_WITH_AS(gsp::copy_dofs(exec, s.model, s.dynamics, &gsp::DynamicsLayout::cdof, qfrc), doctest::Contains("no vector of dofs"),
                       std::invalid_argument);
  auto own = s.model;
  gsp::make_per_world(exec, own, {gsp::ModelField::body_mass}, World<Exec>::worlds);
  gsp::set_constants(exec, own, s.dynamics);
  CHECK_THROWS_WITH_AS(gsp::copy_dofs(exec, s.model, s.dynamics, &gsp::DynamicsLayout::bias, qfrc),
                       doctest::Contains("are not in the dynamics"), std::invalid_argument);
}

// Poses are of a moment too: those of before are refused beside the state and beside the dynamics, whoever has moved the state on; poses
// that gsp has never written are taken as they are, and give the same bits. The dynamics are of the state as it is now in all cases, so
// that the poses alone are at fault.
TEST_CASE_TEMPLATE("readers of poses refuse those of another moment", Exec, GSP_TEST_EXECS) {
  using S = World<Exec>;
  using Poses = gsp::Poses<double, typename S::Mem>;
  struct Use {
    std::string name;
    std::function<std::vector<double>(S&, Poses const&)> run;
    bool joints;
  };
  auto const with = [](int reader) {
    return [reader](S& s, Poses const& poses) {
      Poses const own = s.poses;
      s.poses = poses;
      std::vector<double> result;
      std::string sentence;
      try {
        result = readers<Exec>()[reader].read(s);
      } catch (std::invalid_argument const& e) { sentence = e.what(); }
      s.poses = own;
      if (!sentence.empty()) throw std::invalid_argument(sentence);
      return result;
    };
  };
  auto const copy = [](S& s, int gsp::DynamicsLayout::*item) {
    typename S::template View<double**> const out("out", S::worlds, s.model.nv);
    gsp::copy_dofs(s.exec, s.model, s.dynamics, item, out);
    return numbers(out);
  };
  using L = gsp::DynamicsLayout;
  std::vector<Use> const uses{
      {"mass_matrix",
       [](S& s, Poses const& p) {
         gsp::mass_matrix(s.exec, s.model, s.state, p, s.dynamics);
         return readers<Exec>()[0].read(s);
       },
       true},
      {"bias_forces", [&](S& s, Poses const& p) { return gsp::bias_forces(s.exec, s.model, s.state, p, s.dynamics), copy(s, &L::bias); },
       true},
      {"passive_forces",
       [&](S& s, Poses const& p) { return gsp::passive_forces(s.exec, s.model, s.state, p, s.dynamics), copy(s, &L::passive); }, true},
      {"actuator_forces",
       [&](S& s, Poses const& p) { return gsp::actuator_forces(s.exec, s.model, s.state, p, s.dynamics), copy(s, &L::actuator); }, true},
      {"energies", with(6), false},
      {"site_jacobian", with(8), false},
      {"smooth_sensors", with(11), false},
  };
  std::vector<Stage<Exec>> const moves{
      {"integrate", [](S& s) { s.smooth(true), gsp::integrate(s.exec, s.model, s.state, s.dynamics); }, "", ""},
      {"smooth_step", [](S& s) { gsp::smooth_step(s.exec, s.model, s.state, s.poses, s.dynamics); }, "", ""},
      {"runge_kutta",
       [](S& s) {
         auto rk = gsp::make_runge_kutta(s.exec, s.model, {.worlds = S::worlds});
         gsp::runge_kutta(s.exec, s.model, s.state, s.poses, s.dynamics, rk);
       },
       "", ""},
      {"reset", [](S& s) { gsp::reset(s.exec, s.model, s.state); }, "", ""},
      {"reset of one world",
       [](S& s) {
         Kokkos::View<bool*, typename S::Mem> const mask("mask", S::worlds);
         Kokkos::deep_copy(Kokkos::subview(mask, 1), true);
         gsp::reset(s.exec, s.model, s.state, mask);
       },
       "", ""},
  };
  auto const make = [](S& s) { return gsp::make_poses(s.exec, s.model, {.worlds = S::worlds}); };
  auto const now = [](S& s, Poses& poses) {
    gsp::smooth_dynamics(s.exec, s.model, s.state, poses, s.dynamics, {.keep_all = true, .joint_poses = true});
  };
  for (auto const& move : moves) {
    CAPTURE(move.name);
    S s(Profile::stable);
    now(s, s.poses);  // a copy shares what it holds, with its stamp
    move.run(s);
    Poses const old = s.poses;
    s.poses = make(s);
    for (auto const& use : uses) {
      CAPTURE(use.name);
      now(s, s.poses);
      std::string sentence;
      try {
        use.run(s, old);
      } catch (std::invalid_argument const& e) { sentence = e.what(); }
      CAPTURE(sentence);
      bool const with_dynamics = use.name == "site_jacobian";  // is given no state: what it takes is of one moment
      CHECK(sentence.find("gsp::" + use.name + ": the poses") == 0);
      CHECK(sentence.find(with_dynamics ? "different moments" : "before its last step or reset") != std::string::npos);
      CHECK(sentence.find(with_dynamics ? ": call smooth_dynamics first" : ": call forward_kinematics first") != std::string::npos);
      Poses const mine = make(s);  // filled by hand
      Kokkos::deep_copy(mine.xpos, s.poses.xpos), Kokkos::deep_copy(mine.xquat, s.poses.xquat);
      Kokkos::deep_copy(mine.xanchor, s.poses.xanchor), Kokkos::deep_copy(mine.xaxis, s.poses.xaxis);
      auto const right = use.run(s, s.poses);
      now(s, s.poses);
      CHECK(use.run(s, mine) == right);
      now(s, s.poses);
      Poses bare;
      bare.xpos = mine.xpos, bare.xquat = mine.xquat, bare.xanchor = mine.xanchor, bare.xaxis = mine.xaxis;
      CHECK(use.run(s, bare) == right);
    }
  }
  S s(Profile::stable), other(Profile::stable);
  auto subtrees = gsp::make_subtrees(s.exec, s.model, {.worlds = S::worlds});
  now(s, s.poses), now(other, other.poses);
  CHECK_THROWS_WITH_AS(
      gsp::mass_matrix(s.exec, s.model, s.state, other.poses, s.dynamics),
      "gsp::mass_matrix: the poses (xpos, xquat) are of another state than the one given (their qpos lies elsewhere): give "
      "the poses of the simulation that steps this state (simulation.poses), or call forward_kinematics first (or "
      "smooth_dynamics)",
      std::invalid_argument);
  CHECK_THROWS_WITH_AS(gsp::subtree_momentum(s.exec, s.model, other.poses, s.dynamics, subtrees), doctest::Contains("different states"),
                       std::invalid_argument);
  CHECK_THROWS_WITH_AS(gsp::subtree_momentum(s.exec, s.model, s.poses, s.dynamics, subtrees), doctest::Contains("call subtree_com"),
                       std::invalid_argument);
  gsp::subtree_com(s.exec, s.model, other.poses, subtrees);
  CHECK_THROWS_WITH_AS(gsp::subtree_momentum(s.exec, s.model, s.poses, s.dynamics, subtrees), doctest::Contains("call subtree_com"),
                       std::invalid_argument);
  // joints' poses are written on request alone
  for (auto const& use : uses) {
    CAPTURE(use.name);
    S fresh(Profile::stable);
    fresh.smooth(true);
    if (use.joints)
      CHECK_THROWS_WITH_AS(use.run(fresh, fresh.poses),
                           doctest::Contains("(xanchor, xaxis) have not been written: call forward_kinematics"), std::invalid_argument);
    else
      use.run(fresh, fresh.poses);
    fresh.single(1);
    use.run(fresh, fresh.poses);
  }
}

// Implicit integrators take the derivatives of the forces, to which three stages add: in order, and each once.
TEST_CASE_TEMPLATE("half of the derivatives is not integrated with", Exec, GSP_TEST_EXECS) {
  auto c = model_of(false);
  c.option.integrator = gsp::Integrator::implicitfast;
  World<Exec> s(Profile::mujoco);
  s.model = gsp::make_model<double>(s.exec, c, {.profile = Profile::mujoco});
  s.dynamics = gsp::make_dynamics(s.exec, s.model, {.worlds = World<Exec>::worlds});
  auto const refused = [&] {
    CHECK_THROWS_WITH_AS(gsp::integrate(s.exec, s.model, s.state, s.dynamics), doctest::Contains("in this order"), std::invalid_argument);
  };
  s.single(5);
  gsp::passive_forces(s.exec, s.model, s.state, s.poses, s.dynamics);
  gsp::factor(s.exec, s.model, s.state, s.dynamics);
  refused();
  s.single(6);
  gsp::integrate(s.exec, s.model, s.state, s.dynamics);
  s.smooth(false);
  gsp::integrate(s.exec, s.model, s.state, s.dynamics);
}
