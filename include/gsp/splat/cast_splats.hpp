#pragma once
#include <gsp/core/region.hpp>
#include <gsp/math/quat.hpp>
#include <gsp/model/poses.hpp>
#include <gsp/ray/cast_rays.hpp>
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
  int body_exclude = -1;     // Gaussians of this body are not met; of its children they are, but
  int bodies = 1;            // of so many bodies from body_exclude on none are: hide_self gives both
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
/// The Gaussians that a ray meets, in order, up to where no more of it is left than `stop`, or as many as there is room for. Products are
/// formed in that order and only become less where one comes between, so what lies behind the end is never needed, and nothing hangs on the
/// order in which they came.
template <class R, int room>
class SplatsMet {
 public:
  GSP_FUNCTION SplatsMet(R coming, R stop, R most) : coming_(coming), stop_(stop), most_(most) {}
  /// What is not before this place counts no more.
  GSP_FUNCTION R most() const { return most_; }
  GSP_FUNCTION void add(R x, int source, R through) {
    if (!(x < most_ || (x == most_ && source < most_source_))) return;
    int at = count_ < room ? count_++ : room - 1;
    for (; at > 0 && (x < met_[at - 1].x || (x == met_[at - 1].x && source < met_[at - 1].source)); --at) met_[at] = met_[at - 1];
    R left = at > 0 ? met_[at - 1].left : coming_;
    left = left * through;
    met_[at] = {x, through, left, source};
    for (++at; at < count_ && left > stop_; ++at) {
      left = left * met_[at].through;
      met_[at].left = left;
    }
    count_ = at;
    if (left <= stop_ || count_ == room) {
      most_ = met_[count_ - 1].x;
      most_source_ = met_[count_ - 1].source;
    }
  }
  GSP_FUNCTION bool full() const { return count_ == room; }
  GSP_FUNCTION R left() const { return count_ > 0 ? met_[count_ - 1].left : coming_; }
  GSP_FUNCTION R last() const { return met_[count_ - 1].x; }
  GSP_FUNCTION int last_source() const { return met_[count_ - 1].source; }

 private:
  struct alignas(4 * sizeof(R)) Met {
    R x, through, left;
    int source;
  };
  Met met_[room];
  R coming_, stop_, most_;
  int most_source_ = -1, count_ = 0;
};

/// Who counts what a ray costs: nobody.
struct UncountedRays {
  GSP_FUNCTION void pass() const {}
  GSP_FUNCTION void look_at(int) const {}
};
/// What a ray of a world returns from, of the Gaussians of all bodies where they are in these poses.
template <class R, class Mem, int room = 24>
struct SplatCaster {
  SplatTree<Mem> tree;
  Poses<R, Mem> poses;
  CastSplatsOptions options;

  struct Return {
    R distance;    // in lengths of the direction; infinity: none
    R left;        // of the ray
    int gaussian;  // -1: none
  };
  /// Of the places before `most`.
  template <class Count = UncountedRays>
  KOKKOS_FUNCTION Return first(Ray<R> const& given, int w, R most, Count const& count = {}) const {
    if (!is_ray(given)) return {no_hit<R>(), R(1), -1};
    ScaledRay<R> const scaled(given);
    R const end = most / scaled.scale;
    R left = R(1), from = R(0);
    int from_source = std::numeric_limits<int>::max();  // what it meets at 0 is behind it
    for (;;) {
      count.pass();
      SplatsMet<R, room> met(left, R(options.left), end);
      for (int b = 0; b < int(tree.bodies.extent(0)); ++b) pass(tree.bodies(b), scaled.ray, w, from, from_source, met, count);
      left = met.left();
      if (left <= R(options.left)) return {scaled.back(met.last()), left, met.last_source()};
      if (!met.full()) return {no_hit<R>(), left, -1};
      from = met.last();
      from_source = met.last_source();
    }
  }

 private:
  template <class Count>
  KOKKOS_FUNCTION void pass(SplatTreeBody const& body, Ray<R> const& ray, int w, R from, int from_source, SplatsMet<R, room>& met,
                            Count const& count) const {
    if (unsigned(body.body - options.body_exclude) < unsigned(options.bodies)) return;
    R const *const p = &poses.xpos(w, body.body, 0), *const q = &poses.xquat(w, body.body, 0);
    Vec3<R> const o = ray.origin - Vec3<R>{p[0], p[1], p[2]};
    if (!comes_near(o, ray, R(body.radius), met.most())) return;
    Mat3<R> const turn = to_matrix(Quat<R>{q[0], q[1], q[2], q[3]});
    Ray<R> const own{transpose_times(turn, o), transpose_times(turn, ray.direction)};
    RaySplat const* const splats = tree.splats.data() + body.splat;
    R const least = R(-splat_log2_255), alpha_max = R(options.alpha_max);
    auto const take = [&](int begin, int end) {
      count.look_at(end - begin);
      for (int i = begin; i < end; ++i) {
        RaySplat const& s = splats[i];
        Vec3<R> const v = own.origin - Vec3<R>{R(s.centre.x), R(s.centre.y), R(s.centre.z)};
        auto const whitened = [&](Vec3<R> const& a) {
          return Vec3<R>{fma(R(s.axes[0]), a.x, fma(R(s.axes[1]), a.y, R(s.axes[2]) * a.z)),
                         fma(R(s.axes[3]), a.x, fma(R(s.axes[4]), a.y, R(s.axes[5]) * a.z)),
                         fma(R(s.axes[6]), a.x, fma(R(s.axes[7]), a.y, R(s.axes[8]) * a.z))};
        };
        Vec3<R> const u = whitened(v), d = whitened(own.direction), across = cross(u, d);
        R const inverse = R(1) / dot(d, d), exponent = fma(-R(s.sharpness) * inverse, dot(across, across), R(s.power));
        if (!(exponent >= least)) continue;
        R const x = -dot(u, d) * inverse;
        if (!(x > from || (x == from && s.source > from_source))) continue;
        met.add(x, s.source, R(1) - min(Kokkos::exp2(exponent), alpha_max));
      }
    };
    visit_leaves(
        tree.nodes.data() + body.node, BoxRay<R>(own, from), [&] { return met.most(); }, take);
  }
  /// Whether the ray, which begins at o from the body's frame, comes into its ball before it has come to `most`.
  KOKKOS_INLINE_FUNCTION static bool comes_near(Vec3<R> const& o, Ray<R> const& ray, R radius, R most) {
    R const inverse_length = R(1) / norm(ray.direction), along = -dot(o, ray.direction) * inverse_length;
    Vec3<R> const across = fma(along * inverse_length, ray.direction, o);
    R const room_ = radius + roundings<R>(8) * (abs(along) + largest(ray.origin));
    return dot(across, across) <= room_ * room_ && along >= -room_ && (along - room_) * inverse_length <= most;
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
  expects(options.bodies == 1 || (options.bodies > 0 && options.body_exclude >= 0),
          function + ": bodies counts from body_exclude on: take both from hide_self");
  expects(options.left >= 0 && options.left <= 1 && options.alpha_max >= 0 && options.alpha_max <= 1,
          function + ": left and alpha_max must lie in 0 to 1");
}

template <class R, class Mem>
struct CastSplats {
  SplatCaster<R, Mem> caster;
  Rays<R, Mem> rays;
  Kokkos::View<R const**, Kokkos::LayoutRight, Mem> before;
  SplatHits<R, Mem> hits;
  KOKKOS_FUNCTION void operator()(std::int64_t i) const {
    int const n = int(rays.origin.extent(1)), w = int(i / n), k = int(i % n);
    R const *const o = &rays.origin(w, k, 0), *const d = &rays.direction(w, k, 0);
    R const nearer = before.data() ? before(w, k) : R(-1);
    auto const met = caster.first({{o[0], o[1], o[2]}, {d[0], d[1], d[2]}}, w, nearer >= R(0) ? nearer : no_hit<R>());
    hits.distance(w, k) = met.gaussian >= 0 ? met.distance : nearer;
    hits.gaussian(w, k) = met.gaussian;
    if (hits.opacity.data()) hits.opacity(w, k) = R(1) - met.left;
  }
};
}  // namespace detail

/// What each ray returns from (SplatHits), of the Gaussians whose bodies stand as `poses` says, and before what it has met already: with
/// the distances of cast_rays the nearer of both wins, as a ray ends at a geom. A ray that begins in a Gaussian does not meet it where its
/// middle is behind. Rays that lose less return from nothing: a LiDAR unit drops them.
/// @param before  (worlds, rays) in lengths of the direction, -1: nothing, such as RayHits::distance; it may be hits.distance. Empty: no
///                ray has met anything
/// @param hits    out; distance: of the Gaussian, or `before` where gaussian is -1
/// A direction of 0, one that is not finite, and NaN meet nothing. However many Gaussians lie on a ray, none is lost: it is gone through
/// again from the last one that there was room for. The same bits for any batch, order of rays, and number of threads. Does not allocate,
/// does not fence. Cost: on a captured room about 60 nodes of the tree and 40 Gaussians a ray. Errors: std::invalid_argument where rays,
/// hits, before and poses are of other numbers of worlds or rays, for poses of fewer bodies than the sets name, for bodies without
/// body_exclude, and for left or alpha_max that are not within 0 to 1.
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
  Kokkos::parallel_for("gsp::splat::cast_splats", lightweight(Range(exec, 0, std::int64_t(worlds) * count)),
                       detail::CastSplats<R, Mem>{{tree, poses, options}, rays, before, hits});
}
/// Of rays that have met nothing yet.
template <ExecutionSpace Exec, class R, class Mem>
void cast_splats(Exec const& exec, SplatTree<Mem> const& tree, Poses<R, Mem> const& poses, Rays<R, Mem> const& rays,
                 SplatHits<R, Mem>& hits, CastSplatsOptions options = {}) {
  cast_splats(exec, tree, poses, rays, {}, hits, options);
}

}  // namespace gsp
