#include <doctest/doctest.h>

#include <gsp/io/detail/splat_rotation.hpp>
#include <gsp/io/splat_transform.hpp>
#include <io/fixtures.hpp>

using namespace gsp::io;
using namespace gsp_test;

namespace {

std::array<double, 4> random_quat(unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  std::array<double, 4> q{};
  double norm = 0;
  for (double& v : q) v = normal(random), norm += v * v;
  for (double& v : q) v /= std::sqrt(norm);
  return q;
}
std::array<double, 3> rotated(std::array<double, 4> const& q, std::array<double, 3> const& v) {
  auto const r = detail::rotation_matrix(q);
  return {r[0] * v[0] + r[1] * v[1] + r[2] * v[2], r[3] * v[0] + r[4] * v[1] + r[5] * v[2], r[6] * v[0] + r[7] * v[1] + r[8] * v[2]};
}
std::array<double, 3> random_direction(unsigned seed) { return rotated(random_quat(seed), {0, 0, 1}); }

/// Colour channel c of Gaussian i seen along d.
double colour(SplatSet const& s, std::size_t i, int c, std::array<double, 3> const& d) {
  auto const basis = detail::sh_basis(d[0], d[1], d[2]);
  double sum = 0;
  for (std::size_t k = 0; k < s.sh_terms(); ++k) sum += basis[k] * s.sh[(i * s.sh_terms() + k) * 3 + c];
  return sum;
}
/// R S S^T R^T
std::array<double, 9> covariance(SplatSet const& s, std::size_t i) {
  auto const r = detail::rotation_matrix({s.quats[4 * i], s.quats[4 * i + 1], s.quats[4 * i + 2], s.quats[4 * i + 3]});
  std::array<double, 9> c{};
  for (int a = 0; a < 3; ++a)
    for (int b = 0; b < 3; ++b)
      for (int k = 0; k < 3; ++k) c[3 * a + b] += r[3 * a + k] * r[3 * b + k] * std::pow(s.scales[3 * i + k], 2);
  return c;
}

}  // namespace

// The basis constants carry 14-16 digits and 28 products are summed: 1e-13 is ten times that.
TEST_CASE("SH rotation is orthogonal, composes, and is the identity for no rotation") {
  auto const identity = sh_rotation({1, 0, 0, 0});
  auto const a = random_quat(1), b = random_quat(2);
  std::array<double, 4> const ab{
      a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3], a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
      a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1], a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0]};
  auto const da = sh_rotation(a), db = sh_rotation(b), dab = sh_rotation(ab);
  double not_identity = 0, not_orthogonal = 0, not_composed = 0;
  for (int i = 0; i < 16; ++i)
    for (int j = 0; j < 16; ++j) {
      double dot = 0, product = 0;
      for (int k = 0; k < 16; ++k) dot += da[i][k] * da[j][k], product += da[i][k] * db[k][j];
      not_identity = std::max(not_identity, std::abs(identity[i][j] - (i == j)));
      not_orthogonal = std::max(not_orthogonal, std::abs(dot - (i == j)));
      not_composed = std::max(not_composed, std::abs(product - dab[i][j]));
    }
  CHECK(not_identity < 1e-13);
  CHECK(not_orthogonal < 1e-13);
  CHECK(not_composed < 1e-13);
}

TEST_CASE("a moved set looks the same to an eye that moves with it") {
  for (int degree = 0; degree <= 3; ++degree) {
    SplatSet const before = random_set(20, degree, 3);
    SplatSet after = before;
    SplatPose const pose{{1, -2, 0.5}, random_quat(4), 2.5};
    transform(after, pose);
    validate(after, "after");
    double colour_error = 0, covariance_error = 0, position_error = 0;
    for (std::size_t i = 0; i < before.size(); ++i) {
      for (unsigned seed = 0; seed < 10; ++seed) {
        auto const d = random_direction(100 + seed);
        for (int c = 0; c < 3; ++c)
          colour_error = std::max(colour_error, std::abs(colour(before, i, c, d) - colour(after, i, c, rotated(pose.quat, d))));
      }
      auto const c0 = covariance(before, i), c1 = covariance(after, i), r = detail::rotation_matrix(pose.quat);
      double const trace = c0[0] + c0[4] + c0[8];
      for (int a = 0; a < 3; ++a)
        for (int b = 0; b < 3; ++b) {
          double expected = 0;
          for (int k = 0; k < 3; ++k)
            for (int l = 0; l < 3; ++l) expected += r[3 * a + k] * c0[3 * k + l] * r[3 * b + l];
          covariance_error = std::max(covariance_error, std::abs(c1[3 * a + b] - 6.25 * expected) / trace);
        }
      auto const p = rotated(pose.quat, {before.positions[3 * i], before.positions[3 * i + 1], before.positions[3 * i + 2]});
      for (int k = 0; k < 3; ++k)
        position_error = std::max(position_error, std::abs(after.positions[3 * i + k] - (2.5 * p[k] + pose.position[k])));
    }
    // Float storage: 15 terms below 2 times a basis below 3 times 2^-24; covariance 6.25 x 6 products; positions below 40.
    CHECK(colour_error < 15 * 2 * 3 * 6e-8);
    CHECK(covariance_error < 6.25 * 6 * 6e-8);
    CHECK(position_error < 40 * 6e-8);
  }
}

TEST_CASE("Gaussians of links stay unless asked, and a wrong pose is refused") {
  SplatSet set = random_set(2, 1);
  set.link_names = {"arm"};
  set.link = {0, -1};
  SplatSet const before = set;
  transform(set, {{1, 0, 0}});
  CHECK(set.positions[0] == before.positions[0]);
  CHECK(set.positions[3] == before.positions[3] + 1);
  transform(set, {{1, 0, 0}}, {.links = true});
  CHECK(set.positions[0] == before.positions[0] + 1);
  CHECK_THROWS_AS(transform(set, {{0, 0, 0}, {0, 0, 0, 0}}), std::invalid_argument);
  CHECK_THROWS_AS(transform(set, {{0, 0, 0}, {1, 0, 0, 0}, -1}), std::invalid_argument);
  CHECK_THROWS_AS(transform(set, {{NAN, 0, 0}}), std::invalid_argument);
  auto const places = set.positions;
  for (SplatPose const& far : {SplatPose{{0, 0, 1e60}}, SplatPose{.scale = 1e60}})
    CHECK_THROWS_WITH_AS(transform(set, far), doctest::Contains("beyond what a float holds"), std::invalid_argument);
  CHECK(set.positions == places);
}

TEST_CASE("a pose as text") {
  SplatPose const p = parse_splat_pose(" 1 -2.5 3e-1  0.5 0.5 0.5 0.5 2");
  CHECK(p.position == std::array<double, 3>{1, -2.5, 0.3});
  CHECK(p.quat == std::array<double, 4>{0.5, 0.5, 0.5, 0.5});
  CHECK(p.scale == 2);
  CHECK(parse_splat_pose("1e-400 0 0 1 0 0 0 1").position[0] == 0);
  for (auto bad : {"", "1 2 3", "0 0 0 1 0 0 0", "0 0 0 1 0 0 0 1 1", "0 0 0 1 0 0 0 0", "0 0 0 1 0 0 0 -1", "0 0 0 0 0 0 0 1",
                   "0 0 x 1 0 0 0 1", "0 0 nan 1 0 0 0 1", "0 0 0 1 0 0 0 1e999", "0,0 0 1 0 0 0 1"})
    CHECK_MESSAGE(says(error_of([&] { parse_splat_pose(bad); }), "must be eight numbers"), bad);
}
