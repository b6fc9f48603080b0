#pragma once
#include <cstring>
#include <gsp/ray/ray_scene.hpp>
#include <gsp/ray/ray_unit.hpp>

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
  int body_exclude = -1;  // geoms of this body are not met; of its children they are, but
  int bodies = 1;         // of so many bodies from body_exclude on none are: hide_self gives both
  KOKKOS_INLINE_FUNCTION bool hides(int body) const { return unsigned(body - body_exclude) < unsigned(bodies); }
};
/// The options by which cast_rays hides these: of the world nothing, which is no robot. Errors: std::invalid_argument for a body that the
/// model does not have.
inline CastRaysOptions hide_self(CompiledModel const& compiled, int body, SelfFilter filter) {
  expects(body >= 0 && body < compiled.nbody,
          "gsp::hide_self: the model has " + std::to_string(compiled.nbody) + " bodies, not one of index " + std::to_string(body));
  if (filter == SelfFilter::none || body == 0) return {};
  int end = body + 1;  // bodies are listed depth first, so a subtree is without gaps
  while (filter == SelfFilter::subtree && end < compiled.nbody && compiled.body_parent[std::size_t(end)] >= body) ++end;
  return {.body_exclude = body, .bodies = end - body};
}

namespace detail {
inline void expects_hidden(std::string const& where, CastRaysOptions const& options) {
  expects(options.bodies == 1 || (options.bodies > 0 && options.body_exclude >= 0),
          where + ": bodies counts from body_exclude on: take both from hide_self");
}
/// What rays of a world meet first: one on a device, as many as a pack has lanes on a host.
template <class R, class Mem>
struct RayCaster {
  using T = std::conditional_t<is_device<typename Mem::execution_space>, R, Pack<R, native_width<R>>>;
  static constexpr int width = is_device<typename Mem::execution_space> ? 1 : native_width<R>;
  RayScene<R, Mem> scene;
  CastRaysOptions options;

  /// So many kernel items have `rays` rays of a world.
  KOKKOS_INLINE_FUNCTION static int items_of(int rays) { return (rays + width - 1) / width; }
  struct Met {
    ScaledRay<T> scaled;
    T x;                              // in lengths of the scaled ray
    LaneIndex<T> geom{}, triangle{};  // of the scene; of a mesh; -1: none
    Vec3<T> normal{};                 // of a height field, in its frame
  };
  /// Of lanes 0 ... count - 1. What is no ray meets nothing: it goes along as one that has met something before all, as other lanes do.
  KOKKOS_INLINE_FUNCTION Met first(Ray<T> const& given, int w, int count) const {
    auto const there = is_ray(given);
    T const zero(R(0)), one(R(1));
    Ray<T> const ray{select(there, given.origin, Vec3<T>{zero, zero, zero}), select(there, given.direction, Vec3<T>{one, zero, zero})};
    Met best{ScaledRay<T>(ray), select(there, no_hit<T>(), T(R(-1)))};
    for (int l = count; l < width; ++l) set_lane_of(best.x, l, R(-1));
    if (!any(there)) return best;
    T const inverse_length = one / norm(best.scaled.ray.direction);
    int const geoms = int(scene.geoms.extent(0));
    if constexpr (width == 1) {
      for (int g = 0; g < geoms; ++g) meet(best.scaled.ray, inverse_length, w, g, best);
    } else {
      Cone const cone(best.scaled.ray, inverse_length, there);
      for (int g = 0; g < geoms; g += width)
        for (std::uint32_t near = cone.meets(scene, w, g); near != 0; near &= near - 1)
          meet(best.scaled.ray, inverse_length, w, g + Kokkos::countr_zero(near), best);
    }
    return best;
  }
  /// Number in the model of what lane l has met, -1: nothing, or at a distance that no R holds; where, in lengths of the ray that was
  /// given; and its normal.
  KOKKOS_INLINE_FUNCTION int geom_of(Met const& met, int l) const {
    int const g = met.geom[l];
    return g >= 0 && distance_of(met, l) < no_hit<R>() ? scene.geoms(g).geom : -1;
  }
  KOKKOS_INLINE_FUNCTION static R distance_of(Met const& met, int l) { return lane_of(met.scaled.back(met.x), l); }
  KOKKOS_INLINE_FUNCTION Vec3<R> normal_of(int w, Met const& met, int l) const {
    int const g = met.geom[l];
    if (g < 0) return {R(0), R(0), R(0)};
    RayGeom<R> const& geom = scene.geoms(g);
    Mat3<R> const& turn = scene.turn(w, g);
    if (geom.type == ShapeType::hfield) return turn * lane_of(met.normal, l);
    if (geom.type == ShapeType::mesh) {
      RayTriangle const& t = geom.triangles[met.triangle[l]];
      return turn * triangle_normal<R>(t.a, t.b, t.c);
    }
    return turn * normal_where_met(geom.type, geom.size, lane_of(to_frame(met.scaled.ray, w, g), l), lane_of(met.x, l));
  }

  /// Vectors from[0] ... from[count - 1]; lanes beyond have the last.
  KOKKOS_INLINE_FUNCTION static Vec3<T> read(R const* from, int count) {
    if constexpr (width == 1) {
      return {from[0], from[1], from[2]};
    } else {
      auto const component = [&](int c) { return T::of([&](int l) { return from[3 * (l < count ? l : count - 1) + c]; }); };
      auto const component_of_all = [&](int c) { return T::of([&](int l) { return from[3 * l + c]; }); };
      if (count == width) return {component_of_all(0), component_of_all(1), component_of_all(2)};
      return {component(0), component(1), component(2)};
    }
  }

 private:
  /// What all rays of a pack lie in: a cone about the ray in the middle, and a ball about its origin that theirs lie in. A ball of radius r
  /// about c, v = c - origin, u = v . axis, is clear of it where   |v - u axis| cos - u sin > r.
  struct Cone {
    Vec3<R> origin, axis;
    R cosine = R(1), sine, reach = R(0);
    KOKKOS_INLINE_FUNCTION Cone(Ray<T> const& ray, T const& inverse_length, typename T::mask_type there) {
      int middle = width / 2;
      while (!there[middle]) middle = middle + 1 < width ? middle + 1 : 0;
      Vec3<T> const d = inverse_length * ray.direction;
      axis = lane_of(d, middle);
      origin = lane_of(ray.origin, middle);
      T const along = select(there, dot(d, broadcast(axis)), T(R(1)));
      Vec3<T> const apart = ray.origin - broadcast(origin);
      T const away = select(there, dot(apart, apart), T(R(0)));
      for (int l = 0; l < width; ++l) {
        cosine = min(cosine, along[l]);
        reach = max(reach, away[l]);
      }
      cosine = cosine - roundings<R>(16);
      sine = sqrt(max(R(1) - cosine * cosine, R(0)));
      reach = sqrt(reach);
    }
    /// Bit k: geom first + k may be met; those that are not there are.
    KOKKOS_INLINE_FUNCTION std::uint32_t meets(RayScene<R, Mem> const& scene, int w, int first) const {
      int const count = scene.count() - first;
      std::uint32_t const there = count >= width ? std::uint32_t((std::uint64_t(1) << width) - 1) : (std::uint32_t(1) << count) - 1;
      if (!(cosine > R(0))) return there;
      auto const load = [](R const* from) {
        T x;
        std::memcpy(&x, from, sizeof x);
        return x;
      };
      Vec3<T> const p{load(&scene.place(w, 0, first)), load(&scene.place(w, 1, first)), load(&scene.place(w, 2, first))};
      Vec3<T> const v = p - broadcast(origin);
      T const u = dot(v, broadcast(axis));
      Vec3<T> const across = fma(-u, broadcast(axis), v);
      T const rounding = roundings<R>(16) * (largest(v) + largest(origin));
      T const clear = norm(across) * T(cosine) - u * T(sine) - (load(&scene.radius(first)) + T(reach) + rounding);
      return there & ~lane_bits(clear > T(R(0)));
    }
  };
  KOKKOS_INLINE_FUNCTION static Vec3<T> broadcast(Vec3<R> const& v) { return {T(v.x), T(v.y), T(v.z)}; }
  /// From the world to the geom's frame. The difference of places comes first: what is far from the world's origin and near to the ray
  /// costs no digits.
  KOKKOS_INLINE_FUNCTION Ray<T> to_frame(Ray<T> const& ray, int w, int g) const {
    Mat3<R> const& turn = scene.turn(w, g);
    Mat3<T> r;
    for (int k = 0; k < 9; ++k) r.m[k] = T(turn.m[k]);
    return {transpose_times(r, ray.origin - broadcast(place_of(w, g))), transpose_times(r, ray.direction)};
  }
  KOKKOS_INLINE_FUNCTION Vec3<R> place_of(int w, int g) const { return {scene.place(w, 0, g), scene.place(w, 1, g), scene.place(w, 2, g)}; }
  /// Whether the ray comes into the geom's ball before it has met anything.
  KOKKOS_INLINE_FUNCTION static auto comes_near(Ray<T> const& ray, T const& inverse_length, Vec3<R> const& centre, R radius,
                                                T const& most) {
    Vec3<T> const c = broadcast(centre) - ray.origin;
    T const along = dot(c, ray.direction) * inverse_length;  // [m]
    Vec3<T> const across = fma(-along * inverse_length, ray.direction, c);
    T const room = radius + roundings<T>(8) * (abs(along) + largest(ray.origin));  // with what rounding takes
    return dot(across, across) <= room * room && along >= -room && (along - room) * inverse_length <= most;
  }
  KOKKOS_INLINE_FUNCTION void meet(Ray<T> const& ray, T const& inverse_length, int w, int g, Met& best) const {
    RayGeom<R> const& geom = scene.geoms(g);
    if (options.hides(geom.body)) return;
    if (geom.type != ShapeType::plane && !any(comes_near(ray, inverse_length, place_of(w, g), scene.radius(g), best.x))) return;
    Ray<T> const own = to_frame(ray, w, g);
    if (geom.type == ShapeType::mesh) {
      TrianglesMet<T> const met = meet_triangles(geom.nodes, geom.triangles, own, best.x);
      auto const nearer = met.x < best.x;
      best.x = select(nearer, met.x, best.x);
      best.geom.set(nearer, g);
      best.triangle.take(nearer, met.triangle);
    } else if (geom.type == ShapeType::hfield) {
      auto const alive = best.x > T(R(0));
      if (!any(alive && !is_upright(own))) {  // a height scan
        ShapeHit<T> const hit = UprightRay<T>(*geom.height_field, own, best.x).first();
        auto const nearer = alive && hit.x < best.x;
        best.x = select(nearer, hit.x, best.x);
        best.geom.set(nearer, g);
        best.normal = select(nearer, hit.normal, best.normal);
        return;
      }
      for (int l = 0; l < width; ++l) {
        R const most = lane_of(best.x, l);
        if (!(most > R(0))) continue;
        ShapeHit<R> const hit = meet_height_field(*geom.height_field, lane_of(own, l), most);
        if (!(hit.x < most)) continue;
        set_lane_of(best.x, l, hit.x);
        best.geom.set_lane(l, g);
        for (int c = 0; c < 3; ++c) set_lane_of(best.normal[c], l, hit.normal[c]);
      }
    } else {
      T const x = meet_shape(geom.type, broadcast(geom.size), own);
      auto const nearer = x < best.x;
      best.x = select(nearer, x, best.x);
      best.geom.set(nearer, g);
    }
  }
};

template <class R, class Mem>
struct CastRays {
  RayCaster<R, Mem> caster;
  Rays<R, Mem> rays;
  RayHits<R, Mem> hits;
  KOKKOS_FUNCTION void operator()(std::int64_t i) const {
    int const n = int(rays.origin.extent(1)), items = caster.items_of(n), w = int(i / items), first = int(i % items) * caster.width;
    int const count = n - first < caster.width ? n - first : caster.width;
    auto const met =
        caster.first({caster.read(&rays.origin(w, first, 0), count), caster.read(&rays.direction(w, first, 0), count)}, w, count);
    for (int l = 0; l < count; ++l) {
      int const k = first + l, g = caster.geom_of(met, l);
      hits.distance(w, k) = g < 0 ? R(-1) : caster.distance_of(met, l);
      hits.geom(w, k) = g;
      if (!hits.normal.data()) continue;
      Vec3<R> const normal = g < 0 ? Vec3<R>{R(0), R(0), R(0)} : caster.normal_of(w, met, l);
      for (int c = 0; c < 3; ++c) hits.normal(w, k, c) = normal[c];
    }
  }
};
}  // namespace detail

/// What each ray meets first, of the geoms where place_ray_geoms has put them: shapes from outside and, where a ray begins in one, from
/// inside (a height field also at z = 0, where its base begins); planes from their front; meshes from both sides. Of geoms at one distance
/// the first. A direction of 0, one that is not finite, and NaN meet nothing, nor does a ray whose distance no R holds. Does not allocate,
/// does not fence. Cost: about 20 flop a geom that is not near, 50 a shape, 1,000 a mesh that is near. Errors: std::invalid_argument where
/// rays, hits and scene are of other numbers of worlds or rays, for geoms that have not been placed, and for bodies without body_exclude.
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
  detail::expects_hidden("gsp::cast_rays", options);
  detail::expects_placed("gsp::cast_rays", scene);
  using Range = Kokkos::RangePolicy<Exec, Kokkos::IndexType<std::int64_t>>;
  detail::RayCaster<R, Mem> const caster{scene, options};
  Kokkos::parallel_for("gsp::ray::cast_rays", lightweight(Range(exec, 0, std::int64_t(worlds) * caster.items_of(count))),
                       detail::CastRays<R, Mem>{caster, rays, hits});
}

}  // namespace gsp
