#include <doctest/doctest.h>

#include <gsp/model/compile.hpp>
#include <gsp/model/detail/host_math.hpp>
#include <gsp/model/samples.hpp>

using namespace gsp;
using gsp::detail::Pose;

namespace {
/// World poses of the bodies at qpos, for models of free and hinge joints at their bodies' origins.
std::vector<Pose> poses(CompiledModel const& m, std::vector<double> const& q) {
  std::vector<Pose> x(std::size_t(m.nbody));
  for (int b = 1; b < m.nbody; ++b) {
    x[b] = x[m.body_parent[b]] * Pose{m.body_pos[b], m.body_quat[b]};
    for (int k = 0; k < m.body_jntnum[b]; ++k) {
      int const j = m.body_jntadr[b] + k, a = m.jnt_qposadr[j];
      if (m.jnt_type[j] == int(JointType::free))
        x[b] = {{q[a], q[a + 1], q[a + 2]}, {q[a + 3], q[a + 4], q[a + 5], q[a + 6]}};
      else
        x[b].q = gsp::detail::times(x[b].q, gsp::detail::axis_angle(m.jnt_axis[j], q[a] - m.qpos0[a]));
    }
  }
  return x;
}
double total(std::vector<double> const& v) {
  double sum = 0;
  for (double x : v) sum += x;
  return sum;
}
}  // namespace

TEST_CASE("the quadruped stands on its feet with its weight between them") {
  auto const m = compile(samples::quadruped());
  CHECK(m.nq == 19);
  CHECK(m.nv == 18);
  CHECK(m.nu == 12);
  CHECK(m.ntree == 1);
  CHECK(total(m.body_mass) == doctest::Approx(12).epsilon(1e-12));
  REQUIRE(m.keyframes.size() == 1);
  auto const& q = m.keyframes[0].qpos;
  auto const x = poses(m, q);
  Double3 com{0, 0, 0};
  for (int b = 1; b < m.nbody; ++b) com = gsp::detail::operator+(com, gsp::detail::operator*(m.body_mass[b] / 12, x[b] * m.body_ipos[b]));
  int feet = 0;
  double reach = 0;
  for (int g = 0; g < m.ngeom; ++g) {
    Double3 const at = x[m.geom_body[g]] * m.geom_pos[g];
    if (m.geom_name[g].find("_foot") == std::string::npos) continue;
    ++feet, reach += at[0] / 4;
    CHECK(at[2] == doctest::Approx(m.geom_size[g][0]).epsilon(1e-12));  // touches z = 0
  }
  CHECK(feet == 4);
  CHECK(std::abs(com[0] - reach) < 0.03);
  CHECK(std::abs(com[1]) < 1e-12);
  for (int a = 0; a < m.nu; ++a) {  // the stance is inside the limits and is what the servos are told
    int const j = m.act_id[a];
    double const target = m.keyframes[0].ctrl[a];
    CHECK(target == q[m.jnt_qposadr[j]]);
    CHECK(target > m.jnt_range[j][0]);
    CHECK(target < m.jnt_range[j][1]);
  }
}

TEST_CASE("every sample compiles, and its contacts are covered") {
  CHECK(compile(samples::pendulum()).nv == 1);
  CHECK(compile(samples::double_pendulum()).nv == 2);
  auto const arm = compile(samples::arm());
  CHECK(arm.nv == 6);
  CHECK(arm.keyframes.at(0).name == "home");
  CHECK(compile(samples::stack(10)).ntree == 10);
  CHECK(compile(samples::ramp()).nv == 6);
  auto const objects = compile(samples::boxes_and_balls({.boxes = 3, .balls = 5}));
  CHECK(objects.ntree == 8);
  int boxes = 0;
  for (int t : objects.geom_type) boxes += t == int(ShapeType::box);
  CHECK(boxes == 3);
}

TEST_CASE("the scene keeps the robot's keyframe and gives the objects their places") {
  auto const m = compile(samples::quadruped_scene({.boxes = 2, .balls = 3}));
  CHECK(m.ntree == 6);
  CHECK(m.nq == 19 + 5 * 7);
  auto const& q = m.keyframes.at(0).qpos;
  auto const alone = compile(samples::quadruped());
  for (int i = 0; i < 19; ++i) CHECK(q[i] == alone.keyframes[0].qpos[i] + (i == 2 ? 0.0005 : 0));
  for (int i = 19; i < m.nq; ++i) CHECK(q[i] == m.qpos0[i]);
  for (int t = 1; t < 6; ++t) {  // nothing starts inside the floor or within reach of the robot
    double const* p = &q[m.tree_qposadr[t]];
    CHECK(std::hypot(p[0], p[1]) == doctest::Approx(0.85));
    CHECK(p[2] > 0);
  }
}
