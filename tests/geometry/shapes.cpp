// What each shape says of itself against points drawn on its surface. Nothing here needs Kokkos: the compiler of models is one of the
// readers.
#include <doctest/doctest.h>

#include <algorithm>
#include <fstream>
#include <gsp/geometry/shape_pairs.hpp>
#include <gsp/geometry/shapes.hpp>
#include <random>
#include <sstream>
#include <string>
#include <vector>

using namespace gsp;

#if defined(KOKKOS_MACROS_HPP) && !defined(__CUDACC__)
#error "geometry/ includes Kokkos"
#endif

namespace {
constexpr ShapeType primitives[] = {ShapeType::sphere, ShapeType::capsule, ShapeType::ellipsoid, ShapeType::cylinder, ShapeType::box};

struct Random {
  std::mt19937 engine{7};
  double operator()() { return std::uniform_real_distribution<double>(-1, 1)(engine); }
  double size() { return 0.25 + 0.15 * (*this)(); }
  Vec3<double> vector() { return {(*this)(), (*this)(), (*this)()}; }
  Mat3<double> turn() {
    std::normal_distribution<double> n;
    return to_matrix(normalized(Quat<double>{n(engine), n(engine), n(engine), n(engine)}));
  }
};

std::vector<Vec3<double>> surface(ShapeType type, Vec3<double> const& size, int n) {
  std::vector<Vec3<double>> points;
  for (int i = 0; i < n; ++i) {  // an even grid of (t, w), turned: no point is left out for its area here
    double const t = (i + 0.5) / n;
    double const w = 0.6180339887498949 * i;
    points.push_back(surface_point(type, {size.x, size.y, size.z}, t, w - std::floor(w)).p);
  }
  return points;
}

/// A mesh and a height field of random numbers.
struct Assets {
  std::vector<Vec3<double>> vertices;
  std::vector<int> triangles, hull;
  std::vector<double> elevation;
  ShapeAsset<double> mesh, field;
  Vec3<double> mesh_size{0, 0, 0};
  Assets(Assets const&) = delete;
  explicit Assets(Random& random) {
    for (int i = 0; i < 40; ++i) {
      vertices.push_back(random.vector());
      for (int k = 0; k < 3; ++k) mesh_size[k] = std::max(mesh_size[k], std::abs(vertices.back()[k]));
      hull.push_back(i);  // a list that holds the hull serves as well
    }
    for (int i = 0; i + 2 < 40; ++i) triangles.insert(triangles.end(), {i, i + 1, i + 2});
    mesh.vertices = vertices.data(), mesh.triangles = triangles.data(), mesh.hull = hull.data();
    mesh.vertex_count = mesh.hull_count = 40, mesh.triangle_count = 38;
    field.rows = 5, field.columns = 7;
    for (int i = 0; i < 35; ++i) elevation.push_back(0.5 + 0.5 * random());
    field.elevation = elevation.data();
    field.extent[0] = 0.8, field.extent[1] = 0.5, field.extent[2] = 0.4, field.extent[3] = 0.1;
  }
  std::vector<Vec3<double>> points_of_field() const {
    std::vector<Vec3<double>> points;
    for (int r = 0; r < 5; ++r)
      for (int c = 0; c < 7; ++c) points.push_back({0.8 * (c / 3. - 1), 0.5 * (r / 2. - 1), 0.4 * elevation[7 * r + c]});
    for (double x : {-0.8, 0.8})
      for (double y : {-0.5, 0.5}) points.push_back({x, y, -0.1});
    return points;
  }
};

double farthest(std::vector<Vec3<double>> const& points, Vec3<double> const& d) {
  double most = -1e300;
  for (auto const& p : points) most = std::max(most, dot(p, d));
  return most;
}
}  // namespace

TEST_CASE("support: no point of the surface lies farther, and one lies there") {
  Random random;
  for (ShapeType type : primitives)
    for (int k = 0; k < 20; ++k) {
      Vec3<double> const size{random.size(), random.size(), random.size()};
      int const n = 20000;
      auto const points = surface(type, size, n);
      // a disc of the area of one sample has the radius sqrt(A / n / pi): no gap between samples of such an even set is three times as wide
      double const gap = 3 * std::sqrt(surface_area(type, {size.x, size.y, size.z}) / n);
      for (int i = 0; i < 20; ++i) {
        Vec3<double> const d = normalized(random.vector());
        Vec3<double> const at = support(type, ShapeData<double>{size}, d);
        double const most = farthest(points, d);
        CAPTURE(shape_name(type));
        CHECK(dot(at, d) >= most - 1e-12);
        CHECK(dot(at, d) <= most + gap);
        CHECK(norm(at) <= bounding_radius(type, {size.x, size.y, size.z}) + 1e-12);
        Vec3<double> const again = support(type, ShapeData<double>{size}, 37. * d);  // of any length
        CHECK(norm(again - at) <= 1e-12);
        Vec3<float> const single =
            support(type, ShapeData<float>{{float(size.x), float(size.y), float(size.z)}}, Vec3<float>{float(d.x), float(d.y), float(d.z)});
        // a rounding of d turns it by 1e-7, and the value of a support is as steep as the shape is wide
        CHECK(std::abs(double(single.x) * d.x + double(single.y) * d.y + double(single.z) * d.z - dot(at, d)) <= 1e-6);
      }
    }
}

TEST_CASE("support of meshes, height fields and planes") {
  Random random;
  Assets const a(random);
  auto const field = a.points_of_field();
  for (int i = 0; i < 500; ++i) {
    Vec3<double> const d = random.vector();
    CHECK(dot(support(ShapeType::mesh, ShapeData<double>{a.mesh_size, &a.mesh}, d), d) == farthest(a.vertices, d));
    double const far = dot(support(ShapeType::hfield, ShapeData<double>{{}, &a.field}, d), d);
    CHECK(std::abs(far - farthest(field, d)) <= 1e-15);
    CHECK(dot(support(ShapeType::plane, ShapeData<double>{}, d), d) > 1e25);  // but straight up it ends
  }
  CHECK(support(ShapeType::plane, ShapeData<double>{}, Vec3<double>{0, 0, 3}).z == 0);
}

TEST_CASE("bounds hold the shape and touch it") {
  Random random;
  for (ShapeType type : primitives)
    for (int k = 0; k < 40; ++k) {
      CAPTURE(shape_name(type));
      Vec3<double> const size{random.size(), random.size(), random.size()};
      ShapeData<double> const shape{size};
      auto const points = surface(type, size, 3000);
      Mat3<double> const R = random.turn();
      Vec3<double> const e = half_extents(type, shape, R);
      for (int i = 0; i < 3; ++i) {
        Vec3<double> const d{R(i, 0), R(i, 1), R(i, 2)};  // world axis i in the shape's frame
        CHECK(farthest(points, d) <= e[i] + 1e-12);
        CHECK(farthest(points, -1. * d) <= e[i] + 1e-12);
        CHECK(std::abs(dot(support(type, shape, d), d) - e[i]) <= 1e-12);  // touches
      }
    }
  Assets const a(random);
  auto const field = a.points_of_field();
  Mat3<double> const still{{1, 0, 0, 0, 1, 0, 0, 0, 1}};
  for (int k = 0; k < 40; ++k) {
    Mat3<double> const R = k ? random.turn() : still;
    Vec3<double> const e = half_extents(ShapeType::mesh, ShapeData<double>{a.mesh_size, &a.mesh}, R);
    Vec3<double> const f = half_extents(ShapeType::hfield, ShapeData<double>{{}, &a.field}, R);
    for (int i = 0; i < 3; ++i) {
      Vec3<double> const d{R(i, 0), R(i, 1), R(i, 2)};
      double const mesh = std::max(farthest(a.vertices, d), farthest(a.vertices, -1. * d));
      double const ground = std::max(farthest(field, d), farthest(field, -1. * d));
      CHECK(mesh <= e[i] + 1e-12);
      CHECK(ground <= f[i] + 1e-12);
      if (k == 0) CHECK(mesh == doctest::Approx(e[i]).epsilon(1e-12));
      if (k == 0 && i < 2) CHECK(ground == doctest::Approx(f[i]).epsilon(1e-12));
    }
  }
  CHECK(half_extents(ShapeType::plane, ShapeData<float>{}, Mat3<float>{}).x == 1e30f);
}

TEST_CASE("areas and moments against points of the surface, as shells") {
  Random random;
  for (ShapeType type : {ShapeType::sphere, ShapeType::capsule, ShapeType::cylinder, ShapeType::box}) {
    CAPTURE(shape_name(type));
    std::array<double, 3> const size{random.size(), random.size(), random.size()};
    auto const shell = shape_inertia(type, size, true);
    CHECK(shell.measure == doctest::Approx(surface_area(type, size)).epsilon(1e-12));
    int const n = 200000;
    std::array<double, 3> sum{};
    for (auto const& p : surface(type, {size[0], size[1], size[2]}, n)) {
      sum[0] += (p.y * p.y + p.z * p.z) / n;
      sum[1] += (p.x * p.x + p.z * p.z) / n;
      sum[2] += (p.x * p.x + p.y * p.y) / n;
    }
    for (int i = 0; i < 3; ++i)
      CHECK(shell.moments[i] == doctest::Approx(sum[i]).epsilon(1e-3));  // a set as even as that: 1/sqrt(n) and better
  }
  CHECK_THROWS_AS(shape_inertia(ShapeType::mesh, {1, 1, 1}, false), std::logic_error);
  CHECK_THROWS_AS(surface_area(ShapeType::hfield, {1, 1, 1}), std::logic_error);
  CHECK(has_surface(ShapeType::plane));
  CHECK(!has_surface(ShapeType::mesh));
}

TEST_CASE("the table of pairs") {
  int covered = 0;
  for (int a = 0; a < shape_types; ++a)
    for (int b = 0; b < shape_types; ++b) {
      ShapeType const ta{a}, tb{b};
      CHECK(can_collide(ta, tb) == can_collide(tb, ta));
      if (a > b) CHECK(pair_kind(ta, tb) == PairKind::none);
      if (a <= b) CHECK(can_collide(ta, tb) == (pair_kind(ta, tb) != PairKind::none));
      covered += pair_kind(ta, tb) != PairKind::none;
    }
  CHECK(covered == pair_kinds);
  CHECK(max_points(PairKind::box_box) == 8);
  CHECK(max_points(PairKind::none) == 0);
  CHECK(is_among(detail::plane_kinds, PairKind::plane_box));
  CHECK(!is_among(detail::plane_kinds, PairKind::sphere_sphere));
  CHECK(is_among(detail::along_b_kinds, PairKind::plane_capsule));
  CHECK(is_among(detail::convex_kinds, PairKind::mesh_mesh));
  CHECK(!is_among(detail::convex_kinds, PairKind::plane_mesh));
  for (auto const& pair : shape_pairs) {
    CHECK(first_type(pair.kind) == pair.a);
    CHECK(second_type(pair.kind) == pair.b);
  }
}

TEST_CASE("docs/collision/narrowphase.md has the table as it is") {
  std::string table = "| |";
  for (int b = 0; b < shape_types; ++b) table += std::string(" ") + shape_name(ShapeType{b}) + " |";
  table += "\n| --- |";
  for (int b = 0; b < shape_types; ++b) table += " --- |";
  table += "\n";
  for (int a = 0; a < shape_types; ++a) {
    table += std::string("| ") + shape_name(ShapeType{a}) + " |";
    for (int b = 0; b < shape_types; ++b) {
      ShapeType const ta{a}, tb{b};
      auto const kind = pair_kind(std::min(ta, tb), std::max(ta, tb));
      table += !can_collide(ta, tb) ? " x |" : kind == PairKind::none ? " - |" : " " + std::to_string(max_points(kind)) + " |";
    }
    table += "\n";
  }
  std::ifstream file(std::string(GSP_TEST_DIR) + "/../docs/collision/narrowphase.md");
  std::stringstream page;
  page << file.rdbuf();
  CHECK_MESSAGE(page.str().find(table) != std::string::npos, "the page should hold\n", table);
}
