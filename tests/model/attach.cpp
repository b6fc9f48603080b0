#include <doctest/doctest.h>

#include <cmath>
#include <gsp/model/attach.hpp>
#include <gsp/model/compile.hpp>
#include <gsp/model/samples.hpp>

using namespace gsp;

TEST_CASE("a piece is put below a body in the middle of the tree, names, references and keyframes follow") {
  auto to = samples::double_pendulum();
  int const last = add_body(to, 0, "last");
  to.bodies[last].joints.push_back(to.bodies[1].joints[0]);
  to.bodies[last].joints[0].name = "last";
  to.bodies[last].geoms = to.bodies[1].geoms;
  to.keyframes.push_back({.name = "k", .qpos = {0.1, 0.2, 0.3}, .qvel = {1, 2, 3}});

  auto const piece = samples::arm();
  attach(to, piece, {.body = "rod1", .prefix = "a_", .pos = {0, 0, -0.5}, .quat = {0, 1, 0, 0}});
  auto const m = compile(to);
  CHECK(m.nv == 9);
  CHECK(m.body_name == std::vector<std::string>{"world", "rod0", "rod1", "a_pedestal", "a_turn", "a_shoulder", "a_elbow", "a_roll",
                                                "a_pitch", "a_flange", "last"});
  CHECK(m.body_parent == std::vector<int>{0, 0, 1, 2, 3, 4, 5, 6, 7, 8, 0});
  CHECK(m.act_name[0] == "a_turn");
  CHECK(m.jnt_name[m.act_id[0]] == "a_turn");
  REQUIRE(m.keyframes.size() == 2);
  CHECK(m.keyframes[0].qpos == std::vector<double>{0.1, 0.2, 0, 0, 0, 0, 0, 0, 0.3});
  CHECK(m.keyframes[0].qvel == std::vector<double>{1, 2, 0, 0, 0, 0, 0, 0, 3});
  CHECK(m.keyframes[1].name == "a_home");
  CHECK(m.keyframes[1].qpos == std::vector<double>{0, 0, 0, 0.4, 1.2, 0, 1.2, 0, 0});
  CHECK(m.keyframes[1].ctrl == std::vector<double>{0, 0.4, 1.2, 0, 1.2, 0});
  CHECK(m.body_pos[3] == Double3{0, 0, -0.5});
  CHECK(m.body_quat[3] == Double4{0, 1, 0, 0});
}

TEST_CASE("the world's geoms go to the body, posed; a free joint below the world is refused") {
  auto to = samples::pendulum();
  Description piece;
  GeomDescription ball;
  ball.size = {0.1, 0, 0};
  ball.pos = {1, 0, 0};
  piece.bodies[0].geoms = {ball};
  attach(to, piece, {.body = "rod0", .pos = {0, 0, 2}, .quat = {std::sqrt(0.5), 0, 0, std::sqrt(0.5)}});
  auto const& g = to.bodies[1].geoms.back();
  CHECK(g.pos[0] == doctest::Approx(0));
  CHECK(g.pos[1] == doctest::Approx(1));
  CHECK(g.pos[2] == doctest::Approx(2));
  CHECK_THROWS_WITH_AS(attach(to, samples::quadruped(), {.body = "rod0"}), doctest::Contains("free joint"), Error);
  CHECK_THROWS_WITH_AS(attach(to, samples::arm(), {.body = "nowhere"}), doctest::Contains("no body 'nowhere'"), Error);
}

TEST_CASE("a model in code") {
  // example-begin
  gsp::Description d;
  int const b = gsp::add_body(d, 0, "ball", {0, 0, 1});
  d.bodies[b].joints.push_back({.name = "free", .type = gsp::JointType::free});
  d.bodies[b].geoms.push_back({.size = {0.1, 0, 0}});  // a sphere
  gsp::attach(d, gsp::samples::quadruped(), {.prefix = "a_", .pos = {1, 0, 0}});
  gsp::CompiledModel const m = gsp::compile(d);
  // example-end
  CHECK(m.ntree == 2);
  CHECK(m.body_name[2] == "a_trunk");
  CHECK(m.qpos0[7] == 1);
}
