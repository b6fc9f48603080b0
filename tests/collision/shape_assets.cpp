// The pool of meshes and height fields: on every backend shapes answer as on the host from the model's own arrays.
#include <doctest/doctest.h>

#include <gsp/collision/collision_model.hpp>
#include <gsp/geometry/shapes.hpp>
#include <gsp_test_execs.hpp>

using namespace gsp;

namespace {
/// A box, two geoms of one mesh, a mesh without a hull, a height field.
CompiledModel some_geoms() {
  CompiledModel m;
  m.ngeom = 5;
  m.geom_type = {int(ShapeType::box), int(ShapeType::mesh), int(ShapeType::mesh), int(ShapeType::mesh), int(ShapeType::hfield)};
  m.geom_data = {-1, 0, 1, 0, 0};
  m.geom_size = {{0.1, 0.2, 0.3}, {1, 1, 1}, {2, 2, 2}, {1, 1, 1}, {0.5, 0.4, 0.2}};
  m.mesh_vertices = {{{0.f, 0.f, 1.f}, {1.f, 0.f, 0.f}, {-1.f, 0.5f, 0.f}, {-1.f, -0.5f, 0.f}, {0.f, 0.f, 0.1f}},
                     {{2.f, 0.f, 0.f}, {0.f, 2.f, 0.f}, {0.f, 0.f, 2.f}, {0.f, 0.f, 0.f}}};
  m.mesh_faces = {{{0, 1, 2}, {0, 2, 3}, {0, 3, 1}, {1, 3, 2}}, {{0, 1, 2}, {0, 2, 3}, {0, 3, 1}, {1, 3, 2}}};
  m.mesh_hull = {{0, 1, 2, 3}, {}};
  m.hfields = {{"h", 2, 3, {0.5, 0.4, 0.6, 0.1}, {0, 0.2f, 1, 0.5f, 0, 0.3f}, {}}};
  return m;
}
template <class Mem>
struct Ask {
  ShapeAssets<double, Mem> pool;
  Kokkos::View<int* [2], Mem> geom;  // type, asset
  Kokkos::View<double*[3], Mem> size, found;
  Kokkos::View<double*, Mem> distance;
  KOKKOS_FUNCTION void operator()(int i) const {
    ShapeData<double> const shape{{size(i, 0), size(i, 1), size(i, 2)}, pool.at(geom(i, 1))};
    ShapeType const type{geom(i, 0)};
    Vec3<double> const s = support(type, shape, Vec3<double>{0.3, -0.2, 0.5});
    for (int k = 0; k < 3; ++k) found(i, k) = s[k];
    distance(i) = ray(type, shape, Vec3<double>{0.05, 0.04, 5}, Vec3<double>{0, 0, -2});
  }
};
}  // namespace

TEST_CASE_TEMPLATE("assets lie in a pool, each once, and shapes find theirs", Exec, GSP_TEST_EXECS) {
  using Mem = typename Exec::memory_space;
  Exec const exec;
  auto const m = some_geoms();
  std::vector<int> index;
  auto const pool = make_shape_assets<double>(exec, m, {0, 1, 2, 3, 4}, index);
  CHECK(index == std::vector<int>{-1, 0, 1, 0, 2});
  REQUIRE(pool.assets.extent(0) == 3);
  Ask<Mem> ask{pool, Kokkos::View<int* [2], Mem>("geom", 5), Kokkos::View<double* [3], Mem>("size", 5),
               Kokkos::View<double* [3], Mem>("found", 5), Kokkos::View<double*, Mem>("distance", 5)};
  auto const geom = Kokkos::create_mirror_view(ask.geom);
  auto const size = Kokkos::create_mirror_view(ask.size);
  for (int i = 0; i < 5; ++i) {
    geom(i, 0) = m.geom_type[i], geom(i, 1) = index[i];
    for (int k = 0; k < 3; ++k) size(i, k) = m.geom_size[i][k];
  }
  Kokkos::deep_copy(ask.geom, geom);
  Kokkos::deep_copy(ask.size, size);
  Kokkos::parallel_for("test", Kokkos::RangePolicy<Exec>(exec, 0, 5), ask);
  auto const found = Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, ask.found);
  auto const distance = Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, ask.distance);
  // along (0.3, -0.2, 0.5), by hand: the box's corner; the mesh's top (0.5 against 0.3 and less); the other's (0 0 2); the field's corner
  // (0.5, -0.4) of height 0.6: 0.15 + 0.08 + 0.3
  double const support_of[5][3] = {{0.1, -0.2, 0.3}, {0, 0, 1}, {0, 0, 2}, {0, 0, 1}, {0.5, -0.4, 0.6}};
  for (int i = 0; i < 5; ++i)
    for (int k = 0; k < 3; ++k) CHECK(found(i, k) == doctest::Approx(support_of[i][k]));
  CHECK(distance(0) == doctest::Approx((5 - 0.3) / 2));
  CHECK(distance(1) == distance(3));
  CHECK(distance(2) > 0);
  CHECK(distance(4) > 0);
  // the plane through (0 0 1), (1 0 0), (-1 .5 0) at (0.05, 0.04): z = 1 - x - 4 y = 0.79
  CHECK(distance(1) == doctest::Approx((5 - 0.79) / 2));
  // the plane x + y + z = 2
  CHECK(distance(2) == doctest::Approx((5 - 1.91) / 2));
}
