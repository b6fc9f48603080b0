#pragma once
#include <gsp/ray/ray_scene.hpp>

/// Rays of all worlds against the geoms of their world: how far, which geom, and its normal there (MuJoCo's mj_ray).
namespace gsp {

/// Rays of all worlds, in the world's frame. A direction need not be a unit vector: distances are in its lengths.
template <class R, class Mem>
struct Rays {
  using memory_space = Mem;
  template <class D>
  using View = Kokkos::View<D, Kokkos::LayoutRight, Mem>;
  View<R***> origin, direction;  // (worlds, rays, 3) [m]
};
/// What they meet first.
template <class R, class Mem>
struct RayHits {
  template <class D>
  using View = Kokkos::View<D, Kokkos::LayoutRight, Mem>;
  View<R**> distance;  // (worlds, rays) in lengths of the direction; -1: nothing
  View<int**> geom;    // (worlds, rays) number in the model; -1: nothing
  View<R***> normal;   // (worlds, rays, 3) unit, outward; of a mesh as its face is turned; 0 where there is nothing. Empty: not asked for
};
struct RaysOptions {
  int worlds = 1, count = 1;  // rays a world
  bool normals = true;        // of RayHits
};

/// Allocates, zeros. Errors: std::invalid_argument for worlds or count < 1.
template <class R, ExecutionSpace Exec>
Rays<R, typename Exec::memory_space> make_rays(Exec const& exec, RaysOptions options = {}) {
  expects(options.worlds > 0 && options.count > 0, "gsp::make_rays: worlds and count must be positive");
  using Result = Rays<R, typename Exec::memory_space>;
  auto const make = [&](char const* label) {
    return detail::allocate_zero<typename Result::template View<R***>>(exec, label, options.worlds, options.count, 3);
  };
  return {make("gsp::Rays::origin"), make("gsp::Rays::direction")};
}
template <class R, ExecutionSpace Exec>
RayHits<R, typename Exec::memory_space> make_ray_hits(Exec const& exec, RaysOptions options = {}) {
  expects(options.worlds > 0 && options.count > 0, "gsp::make_ray_hits: worlds and count must be positive");
  RayHits<R, typename Exec::memory_space> hits;
  hits.distance = detail::allocate_zero<decltype(hits.distance)>(exec, "gsp::RayHits::distance", options.worlds, options.count);
  hits.geom = detail::allocate_zero<decltype(hits.geom)>(exec, "gsp::RayHits::geom", options.worlds, options.count);
  if (options.normals)
    hits.normal = detail::allocate_zero<decltype(hits.normal)>(exec, "gsp::RayHits::normal", options.worlds, options.count, 3);
  return hits;
}

struct CastRaysOptions {
  int body_exclude = -1;  // geoms of this body alone are not met; of its children they are
};

namespace detail {
template <class R, class Mem>
struct CastRays {
  RayScene<R, Mem> scene;
  Rays<R, Mem> rays;
  RayHits<R, Mem> hits;
  int body_exclude;

  KOKKOS_FUNCTION void operator()(std::int64_t i) const {
    int const n = int(rays.origin.extent(1)), w = int(i / n), k = int(i % n), geoms = int(scene.geoms.extent(0));
    auto const read = [&](auto const& v) { return Vec3<R>{v(w, k, 0), v(w, k, 1), v(w, k, 2)}; };
    Ray<R> const ray{read(rays.origin), read(rays.direction)};
    Best best;
    ScaledRay<R> const scaled(ray);
    if (is_ray(ray)) {
      R const length = norm(scaled.ray.direction);
      for (int g = 0; g < geoms; ++g)
        if (scene.geoms(g).body != body_exclude) meet(scaled.ray, length, w, g, best);
    }
    hits.distance(w, k) = best.geom < 0 ? R(-1) : scaled.back(best.x);
    hits.geom(w, k) = best.geom < 0 ? -1 : scene.geoms(best.geom).geom;
    if (hits.normal.data()) {
      Vec3<R> const normal = best.geom < 0 ? Vec3<R>{R(0), R(0), R(0)} : normal_of(scaled.ray, w, best);
      for (int c = 0; c < 3; ++c) hits.normal(w, k, c) = normal[c];
    }
  }

 private:
  struct Best {
    R x = no_hit<R>();
    int geom = -1;      // of the scene
    int triangle = -1;  // of a mesh
    Vec3<R> normal{};   // of a height field, in its frame
  };
  /// From the world to the geom's frame. The difference of places comes first: what is far from the world's origin and near to the ray
  /// costs no digits.
  KOKKOS_INLINE_FUNCTION Ray<R> to_frame(Ray<R> const& ray, RayPlace<R> const& place) const {
    return {transpose_times(place.r, ray.origin - place.p), transpose_times(place.r, ray.direction)};
  }
  /// Whether the ray comes into the geom's ball before it has met anything.
  KOKKOS_INLINE_FUNCTION static bool comes_near(Ray<R> const& ray, R length, Vec3<R> const& centre, R radius, R most) {
    Vec3<R> const c = centre - ray.origin;
    R const along = dot(c, ray.direction) / length;  // [m]
    Vec3<R> const across = fma(-along / length, ray.direction, c);
    R const room = radius + roundings<R>(8) * (abs(along) + largest(ray.origin));  // with what rounding takes
    return dot(across, across) <= room * room && along >= -room && along - room <= most * length;
  }
  KOKKOS_INLINE_FUNCTION void meet(Ray<R> const& ray, R length, int w, int g, Best& best) const {
    RayGeom<R> const& geom = scene.geoms(g);
    RayPlace<R> const& place = scene.places(w, g);
    if (geom.type != ShapeType::plane && !comes_near(ray, length, place.p, geom.radius, best.x)) return;
    Ray<R> const own = to_frame(ray, place);
    if (geom.type == ShapeType::mesh) {
      MeshHit<R> const hit = meet_mesh(geom.nodes, geom.triangles, own, best.x);
      if (hit.x < best.x) best = {hit.x, g, hit.triangle, {}};
    } else if (geom.type == ShapeType::hfield) {
      ShapeHit<R> const hit = HeightFieldRay<R>(*geom.height_field, own, best.x).first();
      if (hit.x < best.x) best = {hit.x, g, -1, hit.normal};
    } else {
      R const x = meet_shape(geom.type, geom.size, own);
      if (x < best.x) best = {x, g, -1, {}};
    }
  }
  KOKKOS_INLINE_FUNCTION Vec3<R> normal_of(Ray<R> const& ray, int w, Best const& best) const {
    RayGeom<R> const& geom = scene.geoms(best.geom);
    RayPlace<R> const& place = scene.places(w, best.geom);
    if (geom.type == ShapeType::hfield) return place.r * best.normal;
    if (geom.type == ShapeType::mesh) {
      RayTriangle const& t = geom.triangles[best.triangle];
      return place.r * triangle_normal<R>(t.a, t.b, t.c);
    }
    return place.r * normal_where_met(geom.type, geom.size, to_frame(ray, place), best.x);
  }
};
}  // namespace detail

/// What each ray meets first, of the geoms where place_ray_geoms has put them: shapes from outside and, where a ray begins in one, from
/// inside (a height field also at z = 0, where its base begins); planes from their front; meshes from both sides. Of geoms at one distance
/// the first. A direction of 0, one that is not finite, and NaN meet nothing. Does not allocate, does not fence. Cost: about 20 flop a geom
/// that is not near, 50 a shape, 1,000 a mesh that is near. Errors: std::invalid_argument where rays, hits and scene are of other numbers
/// of worlds or rays.
template <ExecutionSpace Exec, class R, class Mem>
void cast_rays(Exec const& exec, RayScene<R, Mem> const& scene, Rays<R, Mem> const& rays, RayHits<R, Mem>& hits,
               CastRaysOptions options = {}) {
  Region const region("gsp::ray::cast_rays");
  static_assert(can_access<Exec, Mem>, "gsp::cast_rays: the scene is not accessible from this execution space");
  int const worlds = int(rays.origin.extent(0)), count = int(rays.origin.extent(1));
  expects(worlds == scene.worlds, "gsp::cast_rays: the scene has " + std::to_string(scene.worlds) + " worlds, the rays have " +
                                      std::to_string(worlds) + ": make both with the same {.worlds = n}");
  auto const fits = [&](auto const& v) { return int(v.extent(0)) == worlds && int(v.extent(1)) == count; };
  auto const fits3 = [&](auto const& v) { return fits(v) && v.extent(2) == 3; };
  expects(
      fits3(rays.origin) && fits3(rays.direction) && fits(hits.distance) && fits(hits.geom) && (!hits.normal.data() || fits3(hits.normal)),
      "gsp::cast_rays: origins, directions and hits are of other numbers of worlds or rays: make them with the same options");
  using Range = Kokkos::RangePolicy<Exec, Kokkos::IndexType<std::int64_t>>;
  Kokkos::parallel_for("gsp::ray::cast_rays", lightweight(Range(exec, 0, std::int64_t(worlds) * count)),
                       detail::CastRays<R, Mem>{scene, rays, hits, options.body_exclude});
}

}  // namespace gsp
