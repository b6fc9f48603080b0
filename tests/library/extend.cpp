// The library extended from outside: each addition is one struct with public headers alone (a test below reads this file's includes).
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <gsp/collision/contacts.hpp>
#include <gsp/dynamics/kinematics.hpp>
#include <gsp/model/attach.hpp>
#include <gsp/model/compile.hpp>
#include <gsp/sensor/sense.hpp>
#include <gsp_test_execs.hpp>
#include <string>
#include <vector>

namespace {

// example-begin add_a_sensor
/// How far body b stands from body a [m], by packs of worlds.
template <class Mem>
struct Range {
  gsp::Poses<float, Mem> poses;
  int a, b;
  int count() const { return 1; }
  KOKKOS_FUNCTION int size() const { return 1; }
  template <class T, class Put>
  KOKKOS_FUNCTION void operator()(gsp::WorldLane<T> const& world, int, Put const& put) const {
    put(0, gsp::norm(world.load3(poses.xpos, b) - world.load3(poses.xpos, a)));
  }
};
// example-end add_a_sensor

// example-begin add_a_sensor_of_contacts
/// Contacts of each body, and the deepest of them [m]: lists differ from world to world, so one world at a time.
template <class Mem>
struct Touch {
  gsp::Contacts<float, Mem> contacts;
  int bodies;
  int count() const { return bodies; }
  KOKKOS_FUNCTION int size() const { return 2; }
  template <class Put>
  KOKKOS_FUNCTION void operator()(int world, int body, Put const& put) const {
    float found = 0, deepest = 0;
    int const first = contacts.begin_of(world);
    for (int k = first; k < first + contacts.count_of(world); ++k) {
      if (contacts.body1(k) != body && contacts.body2(k) != body) continue;
      found += 1;
      deepest = gsp::max(deepest, -contacts.dist(k));
    }
    put(0, found);
    put(1, deepest);
  }
};
// example-end add_a_sensor_of_contacts

static_assert(gsp::SensorKind<Range<Kokkos::HostSpace>> && gsp::SensorKind<Touch<Kokkos::HostSpace>>);
static_assert(!gsp::SensorKind<gsp::Poses<float, Kokkos::HostSpace>>);

/// Two balls over a floor, at (w / 4, 0, z) and (0, 3, z) in world w; the first 1 cm in the floor in odd worlds.
template <class Exec>
struct Balls {
  static constexpr int worlds = 19;  // not a multiple of any pack
  using Mem = typename Exec::memory_space;
  Exec exec;
  gsp::CompiledModel compiled = gsp::compile(description());
  gsp::Model<float, Mem> model = gsp::make_model<float>(exec, compiled);
  gsp::State<float, Mem> state = gsp::make_state(exec, model, {.worlds = worlds});
  gsp::Dynamics<float, Mem> dynamics = gsp::make_dynamics(exec, model, {.worlds = worlds});
  gsp::Poses<float, Mem> poses = gsp::make_poses(exec, model, {.worlds = worlds});
  static gsp::Description description() {
    gsp::Description d;
    gsp::GeomDescription floor;
    floor.type = gsp::ShapeType::plane;
    floor.size = {0, 0, 1};
    d.bodies[0].geoms = {floor};
    for (char const* name : {"first", "second"}) {
      int const b = gsp::add_body(d, 0, name, {0, 0, 1});
      d.bodies[b].joints.push_back({.name = name, .type = gsp::JointType::free});
      d.bodies[b].geoms.push_back({.size = {0.1, 0, 0}});
    }
    d.sensors.push_back({.type = "clock"});
    d.sensors.push_back({.name = "mine", .type = "user", .settings = {{"dim", "1"}}});
    return d;
  }
  static float low(int w) { return w % 2 ? 0.09f : 0.5f; }
  Balls() {
    auto const qpos = Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, state.qpos);
    for (int w = 0; w < worlds; ++w) {
      float const q[] = {0.25f * w, 0, low(w), 1, 0, 0, 0, 0, 3, 0.5f, 1, 0, 0, 0};
      std::copy(std::begin(q), std::end(q), &qpos(w, 0));
    }
    Kokkos::deep_copy(state.qpos, qpos);
    gsp::forward_kinematics(exec, model, state, dynamics, poses);
  }
};

}  // namespace

TEST_CASE("nothing here comes from detail") {
  std::ifstream file(std::string(GSP_TEST_DIR) + "/library/extend.cpp");
  int includes = 0;
  for (std::string line; std::getline(file, line);) {
    if (line.rfind("#include <gsp/", 0) == 0) ++includes;
    CHECK_MESSAGE(line.find(std::string("/det") + "ail/") == std::string::npos, line);
    CHECK_MESSAGE(line.find(std::string("det") + "ail::") == std::string::npos, line);
  }
  CHECK(includes > 3);
}

// Distances of a few metres in float: four roundings.
TEST_CASE_TEMPLATE("a sensor from outside", Exec, GSP_TEST_EXECS) {
  Balls<Exec> const s;
  using Mem = typename Exec::memory_space;
  Kokkos::View<float**, Kokkos::LayoutRight, Mem> const data("data", s.worlds, s.compiled.nsensordata), touch("touch", s.worlds, 8);
  Kokkos::deep_copy(data, 77.f), Kokkos::deep_copy(touch, 77.f);
  gsp::sense(s.exec, Range<Mem>{s.poses, 1, 2}, data, {.adr = s.compiled.sensor_adr[1]});
  auto const collision = gsp::make_collision_model<float>(s.exec, s.compiled);
  auto const contacts = gsp::make_contacts(s.exec, collision, {.worlds = s.worlds});
  gsp::collide(s.exec, collision, s.poses, contacts);
  gsp::sense(s.exec, Touch<Mem>{contacts, 3}, touch, {.adr = 1});
  CHECK_THROWS_WITH_AS(gsp::sense(s.exec, Touch<Mem>{contacts, 3}, touch, {.adr = 3}), doctest::Contains("do not fit into data with 8"),
                       std::invalid_argument);

  auto const found = Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, data);
  auto const touched = Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, touch);
  for (int w = 0; w < s.worlds; ++w) {
    CHECK(found(w, 0) == 77);  // the clock's
    CHECK(found(w, 1) == doctest::Approx(std::hypot(0.25 * w, 3, double(s.low(w)) - 0.5)).epsilon(2.4e-7));
    bool const inside = w % 2 == 1;
    float const want[] = {77, float(inside), inside ? 0.01f : 0.f, float(inside), inside ? 0.01f : 0.f, 0, 0, 77};
    for (int c = 0; c < 8; ++c) CHECK(touched(w, c) == doctest::Approx(want[c]).epsilon(1e-5));
  }
}
