// A scanner of gsp::runtime beside the closed form: a ball that stands elsewhere in each world, and what is refused.
#include <doctest/doctest.h>

#include <cmath>
#include <gsp/model/attach.hpp>
#include <gsp/model/compile.hpp>
#include <gsp/runtime/scanner.hpp>
#include <gsp/runtime/session.hpp>

using namespace gsp::runtime;

namespace {
std::vector<Device> devices() {
  if (has_cuda() && gpu_count() > 0) return {Device::cpu, Device::cuda};
  return {Device::cpu};
}
/// A ball of radius 0.5 that moves, and a box that does not.
gsp::CompiledModel ball_and_box() {
  gsp::Description d;
  d.bodies[0].geoms.push_back({.name = "box", .type = gsp::ShapeType::box, .size = {0.5, 0.5, 0.5}, .pos = {0, 4, 0}});
  int const ball = gsp::add_body(d, 0, "ball", {0, 0, 0});
  d.bodies[ball].joints.push_back({.type = gsp::JointType::free});
  d.bodies[ball].geoms.push_back({.name = "ball", .size = {0.5, 0, 0}});
  return gsp::compile(d);
}
template <class T>
std::vector<T> on_host(Array const& a) {
  std::vector<T> out(std::size_t(a.size()));
  Array to = a.rank == 1   ? host_array(out.data(), {a.extents[0]})
             : a.rank == 2 ? host_array(out.data(), {a.extents[0], a.extents[1]})
                           : host_array(out.data(), {a.extents[0], a.extents[1], a.extents[2]});
  copy(a, to);
  return out;
}
}  // namespace

// Rays along x and y from the world's origin: the ball at x = 3 and 5 begins at 2.5 and 4.5, the box at y = 3.5. Closed forms to 1e-6.
TEST_CASE("a scanner measures, in every world, how far the surfaces are") {
  auto const model = ball_and_box();
  gsp::RayPattern pattern;
  pattern.direction = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  for (Device const device : devices()) {
    auto const scanner = make_scanner(device, model, pattern, {.body_id = 0}, {.worlds = 2});
    auto const kinematics = make_kinematics(device, model);
    std::vector<double> const qpos{3, 0, 0, 1, 0, 0, 0, 5, 0, 0, 1, 0, 0, 0};
    auto const poses = kinematics->poses(host_array(qpos.data(), {2, 7}));
    scanner->begin(poses);
    CHECK(on_host<double>(scanner->arrays().range) == std::vector<double>(6, -1));
    scanner->scan(poses, 0);
    auto const range = on_host<double>(scanner->arrays().range), point = on_host<double>(scanner->arrays().point);
    auto const geom = on_host<int>(scanner->arrays().geom);
    double const expected[6] = {2.5, 3.5, -1, 4.5, 3.5, -1};
    int const met[6] = {1, 0, -1, 1, 0, -1};
    for (std::size_t k = 0; k < 6; ++k) {
      CHECK(range[k] == doctest::Approx(expected[k]).epsilon(1e-6));
      CHECK(geom[k] == met[k]);
      for (std::size_t c = 0; c < 3; ++c)
        CHECK(std::fabs(point[3 * k + c] - (met[k] < 0 ? 0 : expected[k] * pattern.direction[k % 3][c])) < 1e-6);
    }
    CHECK(on_host<double>(scanner->arrays().time) == std::vector<double>(3, 0.002));  // at the end of the first step
  }
}

TEST_CASE("mocap bodies of a model without joints stand where it has them") {
  gsp::Description d;
  gsp::add_body(d, 0, "fixed", {1, 2, 3});
  int const mocap = gsp::add_body(d, 0, "mocap", {4, 5, 6});
  d.bodies[std::size_t(mocap)].mocap = true;
  gsp::add_body(d, mocap, "on it", {0, 0, 1});
  auto const model = gsp::compile(d);
  auto const kinematics = make_kinematics(Device::cpu, model);
  CHECK(on_host<double>(kinematics->poses(host_array(model.qpos0.data(), {1, 0})).xpos) ==
        std::vector<double>{0, 0, 0, 1, 2, 3, 4, 5, 6, 4, 5, 7});
}

TEST_CASE("a scanner refuses poses of other worlds, and of another precision") {
  auto const model = ball_and_box();
  gsp::RayPattern pattern;
  pattern.direction = {{1, 0, 0}};
  auto const scanner = make_scanner(Device::cpu, model, pattern, {.body_id = 0}, {.worlds = 2});
  auto const kinematics = make_kinematics(Device::cpu, model);
  std::vector<double> const qpos{3, 0, 0, 1, 0, 0, 0};
  auto const one = kinematics->poses(host_array(qpos.data(), {1, 7}));
  CHECK_THROWS_AS(scanner->begin(one), std::invalid_argument);
  CHECK_THROWS_AS(scanner->scan(one, 0), std::invalid_argument);
  std::vector<float> const places(2 * 2 * 4);
  PoseArrays narrow;
  narrow.xpos = host_array(places.data(), {2, 2, 3});
  narrow.xquat = host_array(places.data(), {2, 2, 4});
  CHECK_THROWS_WITH_AS(scanner->scan(narrow, 0), doctest::Contains("float64"), std::invalid_argument);
  // each extent of both, too few and too many
  std::vector<double> const numbers(3 * 3 * 5);
  auto const of = [&](std::int64_t const(&pos)[3], std::int64_t const(&quat)[3]) {
    PoseArrays p;
    p.xpos = host_array(numbers.data(), {pos[0], pos[1], pos[2]});
    p.xquat = host_array(numbers.data(), {quat[0], quat[1], quat[2]});
    return p;
  };
  std::int64_t pos[] = {2, 2, 3}, quat[] = {2, 2, 4};
  scanner->begin(of(pos, quat));
  for (auto* const extents : {pos, quat})
    for (int k = 0; k < 3; ++k)
      for (int const by : {-1, 1}) {
        extents[k] += by;
        CHECK_THROWS_WITH_AS(scanner->begin(of(pos, quat)), doctest::Contains("Scanner::begin: poses must lie"), std::invalid_argument);
        CHECK_THROWS_WITH_AS(scanner->scan(of(pos, quat), 0), doctest::Contains("xpos (2, 2, 3) and xquat (2, 2, 4)"),
                             std::invalid_argument);
        extents[k] -= by;
      }
  CHECK_THROWS_AS(make_scanner(Device::cpu, model, {}, {.body_id = 0}, {}), std::invalid_argument);
  CHECK_THROWS_AS(make_scanner(Device::cpu, model, pattern, {.body_id = 7}, {}), std::invalid_argument);
}
