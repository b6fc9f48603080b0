#pragma once
#include <gsp/core/region.hpp>
#include <gsp/math/quat.hpp>
#include <gsp/model/poses.hpp>
#include <gsp/ray/cast_rays.hpp>
#include <gsp/splat/detail/splats_met.hpp>
#include <gsp/splat/splat.hpp>
#include <gsp/splat/splat_tree.hpp>

/// Rays of all worlds through Gaussians, static and on links: where half of a ray has been taken.
namespace gsp {

/// Where rays return from. Ray k of world w passes the Gaussians that it meets in the order of x, where each of them responds most,
///   alpha_i = min(alpha_max, opacity exp(-d^2 / 2)), d: how near the ray comes to the centre, in standard deviations;
///   left out below 1/255;   T_i = prod_{j <= i} (1 - alpha_j),
/// and returns from the first at which T_i <= options.left. Of two at one x the first of the sets comes first.
template <class R, class Mem>
struct SplatHits {
  template <class D>
  using View = Kokkos::View<D, Kokkos::LayoutRight, Mem>;
  View<R**> distance;    // (worlds, rays) in lengths of the direction; -1: nothing
  View<int**> gaussian;  // (worlds, rays) index in the sets that make_splat_tree was given; -1: none
  View<R**> opacity;     // (worlds, rays) 1 - T of what it has passed, where it returns from or all there is. Empty: not asked for
};
struct CastSplatsOptions {
  float left = 0.5f;         // a ray returns where no more than this is left of it
  float alpha_max = 0.999f;  // of one Gaussian, as in pictures
  CastRaysOptions hidden{};  // bodies whose Gaussians are not met: hide_self gives it
};

/// Allocates, zeros. Errors: std::invalid_argument for worlds or count < 1.
template <class R, ExecutionSpace Exec>
SplatHits<R, typename Exec::memory_space> make_splat_hits(Exec const& exec, RaysOptions options = {}) {
  expects(options.worlds > 0 && options.count > 0, "gsp::make_splat_hits: worlds and count must be positive");
  SplatHits<R, typename Exec::memory_space> hits;
  hits.distance = detail::allocate_zero<decltype(hits.distance)>(exec, "gsp::SplatHits::distance", options.worlds, options.count);
  hits.gaussian = detail::allocate_zero<decltype(hits.gaussian)>(exec, "gsp::SplatHits::gaussian", options.worlds, options.count);
  hits.opacity = detail::allocate_zero<decltype(hits.opacity)>(exec, "gsp::SplatHits::opacity", options.worlds, options.count);
  return hits;
}

namespace detail {
/// Who counts what a ray costs: nobody.
struct UncountedRays {
  GSP_FUNCTION void pass() const {}
  GSP_FUNCTION void look_at(int) const {}
};
/// What rays return from; T is one ray's number or those of a pack of rays of a world, which go through the trees together.
template <class T>
struct SplatReturns {
  T distance;             // in lengths of the direction; infinity: none
  T left;                 // of the ray
  LaneIndex<T> gaussian;  // -1: none
};
/// What rays of a world return from, of the Gaussians of all bodies where they are in these poses.
template <class R, class Mem, int room = 24>
struct SplatCaster {
  SplatTree<Mem> tree;
  Poses<R, Mem> poses;
  CastSplatsOptions options;

  /// Of the places before `most`. Where it is negative or NaN, and of what is no ray: nothing.
  template <class T, class Count = UncountedRays>
  KOKKOS_FUNCTION SplatReturns<T> first(Ray<T> const& given, int w, T const& most, Count const& count = {}) const {
    constexpr int lanes = lanes_of<T>;
    R const stop = R(options.left);
    T const zero(R(0)), one(R(1));
    auto const there = is_ray(given);
    Ray<T> const ray{select(there, given.origin, Vec3<T>{zero, zero, zero}), select(there, given.direction, Vec3<T>{one, zero, zero})};
    ScaledRay<T> const scaled(ray);
    T const end = select(there && most >= zero, most / scaled.scale, T(R(-1)));
    Pass<T> pass;
    pass.limit = end;
    pass.from = zero;
    for (int l = 0; l < lanes; ++l) {
      pass.met[l].begin(R(1), stop, lane_of(end, l));
      pass.from_source[l] = Kokkos::Experimental::finite_max_v<int>;  // what it meets at 0 is behind it
    }
    SplatReturns<T> result{no_hit<T>(), one, {}};
    bool again = any(end >= zero);
    while (again) {
      count.pass();
      for (int b = 0; b < int(tree.bodies.extent(0)); ++b) go_through(tree.bodies(b), scaled.ray, w, pass, count);
      again = false;
      for (int l = 0; l < lanes; ++l) {
        auto& met = pass.met[l];
        if (met.empty()) {  // it has met all, in this pass or in one before
          set_lane_of(pass.limit, l, R(-1));
          continue;
        }
        R const left = met.left();
        set_lane_of(result.left, l, left);
        R next = R(-1);
        if (left <= stop) {
          R const distance = met.last() * lane_of(scaled.scale, l);
          set_lane_of(result.distance, l, distance);
          if (distance < no_hit<R>()) result.gaussian.set_lane(l, met.last_source());
        } else if (met.full()) {
          next = lane_of(end, l);
          set_lane_of(pass.from, l, met.last());
          pass.from_source[l] = met.last_source();
          again = true;
        }
        set_lane_of(pass.limit, l, next);
        met.begin(left, stop, next);
      }
    }
    return result;
  }

 private:
  /// Rays on their way once through all trees.
  template <class T>
  struct Pass {
    T from, limit;  // what is not between them counts no more
    int from_source[lanes_of<T>];
    SplatsMet<R, room> met[lanes_of<T>];
  };
  template <class T, class Count>
  KOKKOS_FUNCTION void go_through(SplatTreeBody const& body, Ray<T> const& ray, int w, Pass<T>& pass, Count const& count) const {
    if (options.hidden.hides(body.body)) return;
    R const *const p = &poses.xpos(w, body.body, 0), *const q = &poses.xquat(w, body.body, 0);
    Vec3<T> const o = ray.origin - Vec3<T>{T(p[0]), T(p[1]), T(p[2])};
    if (!any(comes_near(o, ray, T(R(body.radius)), pass.limit))) return;
    Mat3<R> const turn = to_matrix(Quat<R>{q[0], q[1], q[2], q[3]});
    Mat3<T> r;
    for (int k = 0; k < 9; ++k) r.m[k] = T(turn.m[k]);
    Ray<T> const own{transpose_times(r, o), transpose_times(r, ray.direction)};
    RaySplat const* const splats = tree.splats.data() + body.splat;
    R const alpha_max = R(options.alpha_max);
    auto const take = [&](int begin, int end) {
      count.look_at(end - begin);
      for (int i = begin; i < end; ++i) {
        RaySplat const& s = splats[i];
        Vec3<T> const v = own.origin - Vec3<T>{T(s.centre.x), T(s.centre.y), T(s.centre.z)};
        auto const whitened = [&](Vec3<T> const& a) {
          return Vec3<T>{fma(T(s.axes[0]), a.x, fma(T(s.axes[1]), a.y, T(s.axes[2]) * a.z)),
                         fma(T(s.axes[3]), a.x, fma(T(s.axes[4]), a.y, T(s.axes[5]) * a.z)),
                         fma(T(s.axes[6]), a.x, fma(T(s.axes[7]), a.y, T(s.axes[8]) * a.z))};
        };
        Vec3<T> const u = whitened(v), d = whitened(own.direction), across = cross(u, d);
        T const inverse = T(R(1)) / dot(d, d), exponent = fma(T(-s.sharpness) * inverse, dot(across, across), T(s.power));
        T const x = -dot(u, d) * inverse;
        std::uint32_t responds = bits_of(exponent >= T(-splat_log2_255) && x >= pass.from && x <= pass.limit);
        for (; responds != 0; responds &= responds - 1) {
          int const l = lanes_of<T> == 1 ? 0 : Kokkos::countr_zero(responds);
          R const at = lane_of(x, l);
          if (at == lane_of(pass.from, l) && s.source <= pass.from_source[l]) continue;
          pass.met[l].add(at, s.source, R(1) - min(Kokkos::exp2(lane_of(exponent, l)), alpha_max));
          set_lane_of(pass.limit, l, pass.met[l].most());
        }
      }
    };
    visit_leaves(
        tree.nodes.data() + body.node, BoxRay<T>(own, pass.from), [&] { return pass.limit; }, take);
  }
  /// Whether the ray, which begins at o from the body's frame, comes into its ball before it has come to `most`.
  template <class T>
  KOKKOS_INLINE_FUNCTION static auto comes_near(Vec3<T> const& o, Ray<T> const& ray, T const& radius, T const& most) {
    T const inverse_length = T(R(1)) / norm(ray.direction), along = -dot(o, ray.direction) * inverse_length;
    Vec3<T> const across = fma(along * inverse_length, ray.direction, o);
    T const wide = radius + roundings<T>(8) * (abs(along) + largest(ray.origin));
    return dot(across, across) <= wide * wide && along >= -wide && (along - wide) * inverse_length <= most;
  }
};

template <class R, class Mem>
void check_splats_for_rays(std::string const& function, SplatTree<Mem> const& tree, Poses<R, Mem> const& poses, int worlds,
                           CastSplatsOptions const& options) {
  int const has = int(poses.xpos.extent(0)), bodies = int(poses.xpos.extent(1));
  expects(has == worlds, function + ": the rays are of " + std::to_string(worlds) + " worlds, the poses of " + std::to_string(has) +
                             ": make both with the same {.worlds = n}");
  expects(bodies >= tree.named, function + ": the Gaussians name " + std::to_string(tree.named) + " bodies but the poses have " +
                                    std::to_string(bodies) + ": give poses of the model that the Gaussians were bound to");
  expects_hidden(function, options.hidden);
  expects(options.left >= 0 && options.left <= 1 && options.alpha_max >= 0 && options.alpha_max <= 1,
          function + ": left and alpha_max must lie in 0 to 1");
}

template <class R, class Mem>
struct CastSplats {
  SplatCaster<R, Mem> caster;
  Rays<R, Mem> rays;
  Kokkos::View<R const**, Kokkos::LayoutRight, Mem> before;
  SplatHits<R, Mem> hits;
  using Pack = RayCaster<R, Mem>;  // one ray on a device, as many as a pack has lanes on a host
  using T = typename Pack::T;
  KOKKOS_FUNCTION void operator()(std::int64_t i) const {
    int const n = int(rays.origin.extent(1)), items = Pack::items_of(n), w = int(i / items), first = int(i % items) * Pack::width;
    int const count = n - first < Pack::width ? n - first : Pack::width;
    T most = no_hit<T>();
    for (int l = 0; l < count && before.data(); ++l)
      if (before(w, first + l) >= R(0)) set_lane_of(most, l, before(w, first + l));
    for (int l = count; l < Pack::width; ++l) set_lane_of(most, l, R(-1));
    auto const met =
        caster.first(Ray<T>{Pack::read(&rays.origin(w, first, 0), count), Pack::read(&rays.direction(w, first, 0), count)}, w, most);
    for (int l = 0; l < count; ++l) {
      int const k = first + l;
      R const nearer = before.data() ? before(w, k) : R(-1);
      hits.distance(w, k) = met.gaussian[l] >= 0 ? lane_of(met.distance, l) : nearer;
      hits.gaussian(w, k) = met.gaussian[l];
      if (hits.opacity.data()) hits.opacity(w, k) = R(1) - lane_of(met.left, l);
    }
  }
};
}  // namespace detail

/// What each ray returns from (SplatHits), of the Gaussians whose bodies stand as `poses` says, and before what it has met already: with
/// the distances of cast_rays the nearer of both wins, as a ray ends at a geom. A ray that begins in a Gaussian does not meet it where its
/// middle is behind. Rays that lose less return from nothing: a LiDAR unit drops them.
/// @param before  (worlds, rays) in lengths of the direction, -1: nothing, such as RayHits::distance; it may be hits.distance. Empty: no
///                ray has met anything
/// @param hits    out; distance: of the Gaussian, or `before` where gaussian is -1
/// A direction of 0, one that is not finite, and NaN meet nothing, nor does a ray whose distance no R holds. However many Gaussians lie on
/// a ray, none is lost: it is gone through again from the last one that there was room for. The same bits for any batch, order of rays, and
/// number of threads. Does not allocate, does not fence. Cost: on a captured room about 100 nodes of the tree and 90 Gaussians a ray.
/// Errors: std::invalid_argument where rays, hits, before and poses are of other numbers of worlds or rays, for poses of fewer bodies than
/// the sets name, for bodies without body_exclude, and for left or alpha_max that are not within 0 to 1.
template <ExecutionSpace Exec, class R, class Mem>
void cast_splats(Exec const& exec, SplatTree<Mem> const& tree, Poses<R, Mem> const& poses, Rays<R, Mem> const& rays,
                 std::type_identity_t<Kokkos::View<R const**, Kokkos::LayoutRight, Mem>> const& before, SplatHits<R, Mem>& hits,
                 CastSplatsOptions options = {}) {
  Region const region("gsp::splat::cast_splats");
  static_assert(can_access<Exec, Mem>, "gsp::cast_splats: the Gaussians are not accessible from this execution space");
  int const worlds = int(rays.origin.extent(0)), count = int(rays.origin.extent(1));
  detail::check_splats_for_rays("gsp::cast_splats", tree, poses, worlds, options);
  auto const fits = [&](auto const& v) { return int(v.extent(0)) == worlds && int(v.extent(1)) == count; };
  expects(int(rays.direction.extent(0)) == worlds && int(rays.direction.extent(1)) == count && rays.origin.extent(2) == 3 &&
              rays.direction.extent(2) == 3 && fits(hits.distance) && fits(hits.gaussian) && (!hits.opacity.data() || fits(hits.opacity)) &&
              (!before.data() || fits(before)),
          "gsp::cast_splats: origins, directions, distances and hits are of other numbers of worlds or rays: make them with the same "
          "options");
  using Range = Kokkos::RangePolicy<Exec, Kokkos::IndexType<std::int64_t>>;
  Kokkos::parallel_for("gsp::splat::cast_splats",
                       lightweight(Range(exec, 0, std::int64_t(worlds) * detail::RayCaster<R, Mem>::items_of(count))),
                       detail::CastSplats<R, Mem>{{tree, poses, options}, rays, before, hits});
}
/// Of rays that have met nothing yet.
template <ExecutionSpace Exec, class R, class Mem>
void cast_splats(Exec const& exec, SplatTree<Mem> const& tree, Poses<R, Mem> const& poses, Rays<R, Mem> const& rays,
                 SplatHits<R, Mem>& hits, CastSplatsOptions options = {}) {
  cast_splats(exec, tree, poses, rays, {}, hits, options);
}

}  // namespace gsp
