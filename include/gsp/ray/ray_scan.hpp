#pragma once
#include <cmath>
#include <gsp/model/world_values.hpp>
#include <gsp/ray/ray_clock.hpp>
#include <gsp/ray/ray_mount.hpp>
#include <gsp/ray/ray_noise.hpp>
#include <limits>

/// A LiDAR unit: its rays leave one after the other while it moves, and what they meet is gathered over steps, with the unit's errors.
namespace gsp {

/// What rays meet that is no geom: how far, and which. T is one ray's number (on a device) or those of a pack of rays (ray/lane_index.hpp).
template <class T>
struct RayReturn {
  T distance;           // in lengths of the direction
  LaneIndex<T> number;  // -1: nothing
};
/// What rays meet beside geoms: nothing. What else there is, such as Gaussians (splat/splat_target.hpp), has
///   bind(Poses<R, Mem> poses, CastRaysOptions hidden) const   on the host, in each call: what is copied to the device, in these poses and
///                                                             without hidden bodies; throws where they do not fit
/// and what bind returns has, for T = R on a device and a pack of R on a host,
///   first(Ray<T> ray, int w, T most) const   a RayReturn<T>: what rays of world w meet before `most`, in lengths of their directions;
///                                            where it is negative nothing is asked for
struct NothingElse {
  template <class P>
  NothingElse bind(P const&, CastRaysOptions const&) const {
    return {};
  }
};

/// Ray n (ray/ray_clock.hpp) is in place n % rays, until ray n + rays comes.
template <class R, class Mem>
struct RayScan {
  using memory_space = Mem;
  template <class D>
  using View = Kokkos::View<D, Kokkos::LayoutRight, Mem>;
  View<R**> range;     // (worlds, rays) [m]; options.miss: nothing
  View<int**> geom;    // (worlds, rays) number in the model; -1: nothing, or no geom. Empty: not asked for
  View<int**> splat;   // (worlds, rays) index of the Gaussian that returned the ray (geom is -1); -1: none. Empty: not asked for
  View<R***> point;    // (worlds, rays, 3) [m] in the world, along the ray as the unit takes it to be; 0: nothing. Empty: not asked for
  View<double*> time;  // (rays) [s] from the beginning of step 0, when each left; -1: none has yet

  bool begun = false;     // host: begin_ray_scan has said where the unit is, in all worlds
  std::int64_t next = 0;  // host: the step that scan_rays takes next; -1: any, all worlds have just begun

  RayMount<R, Mem> mount;
  RayClock clock;  // host
  RayScanOptions options;
  CastRaysOptions hidden;
  Kokkos::View<std::int64_t*, Mem> tick;    // of clock
  Kokkos::View<Transform<R>*, Mem> before;  // (worlds) where the body was when rays were last scanned, as the unit is aligned
};

/// A unit with the rays of a pattern on a body. Allocates; fences. All is a miss, and its body at the world's origin: begin_ray_scan comes
/// next. A timestep that is the model's, or whole steps of it, rounded to a float is taken for what it was (unrounded_timestep). Errors: as
/// make_ray_mount and make_ray_clock; std::invalid_argument for worlds < 1, rays that are negative or more than most_rays, ranges that are
/// not 0 <= min_range < max_range, a negative first_world, and noise that is negative, not finite, of a probability above 1 or of a unit
/// beyond 2^24.
template <class R, ExecutionSpace Exec>
RayScan<R, typename Exec::memory_space> make_ray_scan(Exec const& exec, CompiledModel const& compiled, RayPattern const& pattern,
                                                      RayMountOptions const& mount, RayScanOptions const& options = {}) {
  expects(options.worlds > 0, "gsp::make_ray_scan: worlds must be positive");
  expects(options.rays >= 0 && options.rays <= most_rays, "gsp::make_ray_scan: rays must lie in 0 to 16,777,216");
  expects(options.min_range >= 0 && options.min_range < options.max_range,
          "gsp::make_ray_scan: min_range must not be negative, and below max_range");
  expects(options.first_world >= 0, "gsp::make_ray_scan: first_world must not be negative");
  RayNoise const& noise = options.noise;
  for (double const x : {noise.range_sigma, noise.relative_sigma, noise.angle_sigma, noise.dropout, noise.range_step})
    expects(std::isfinite(x) && x >= 0, "gsp::make_ray_scan: noise must be finite and not negative");
  expects(noise.dropout <= 1, "gsp::make_ray_scan: dropout is a probability, 0 to 1");
  expects(noise.unit < 1u << 24, "gsp::make_ray_scan: the noise's unit must be below 2^24");
  using Result = RayScan<R, typename Exec::memory_space>;
  Result scan;
  double const timestep = unrounded_timestep(options.timestep, compiled.option.timestep);
  scan.clock = make_ray_clock(pattern, timestep);
  scan.mount = make_ray_mount<R>(exec, compiled, pattern, mount);
  scan.hidden = hide_self(compiled, scan.mount.body, options.self);
  scan.options = options;
  scan.options.timestep = timestep;
  int const rays = options.rays > 0 ? options.rays : scan.clock.rays;
  scan.options.rays = rays;
  scan.tick = detail::to_device<decltype(scan.tick)>(exec, "gsp::RayScan::tick", scan.clock.tick);
  scan.range = detail::allocate_zero<decltype(scan.range)>(exec, "gsp::RayScan::range", options.worlds, rays);
  if (options.geoms) scan.geom = detail::allocate_zero<decltype(scan.geom)>(exec, "gsp::RayScan::geom", options.worlds, rays);
  if (options.splats) scan.splat = detail::allocate_zero<decltype(scan.splat)>(exec, "gsp::RayScan::splat", options.worlds, rays);
  if (options.points) scan.point = detail::allocate_zero<decltype(scan.point)>(exec, "gsp::RayScan::point", options.worlds, rays, 3);
  scan.time = detail::allocate_zero<decltype(scan.time)>(exec, "gsp::RayScan::time", rays);
  scan.before = detail::allocate_zero<decltype(scan.before)>(exec, "gsp::RayScan::before", options.worlds);
  Kokkos::deep_copy(exec, scan.range, R(options.miss));
  if (options.geoms) Kokkos::deep_copy(exec, scan.geom, -1);
  if (options.splats) Kokkos::deep_copy(exec, scan.splat, -1);
  Kokkos::deep_copy(exec, scan.time, -1.);
  Kokkos::deep_copy(exec, scan.before, Transform<R>{{R(0), R(0), R(0)}, identity_quat<R>()});
  return scan;
}

namespace detail {
/// Where the unit is when a step begins.
template <class R, class Mem>
struct NoteUnit {
  Poses<R, Mem> poses;
  Kokkos::View<Transform<R>*, Mem> before;
  int body;
  RayAlignment alignment;
  KOKKOS_FUNCTION void operator()(int w) const { before(w) = aligned_body(poses, w, body, alignment); }
};
template <class R, class Mem, class Mask>
struct BeginRayScan {
  NoteUnit<R, Mem> note;
  Kokkos::View<R**, Kokkos::LayoutRight, Mem> range;
  Kokkos::View<int**, Kokkos::LayoutRight, Mem> geom, splat;
  Kokkos::View<R***, Kokkos::LayoutRight, Mem> point;
  R miss;
  Mask mask;
  KOKKOS_FUNCTION void operator()(std::int64_t i) const {
    int const rays = int(range.extent(1)), w = int(i / rays), k = int(i % rays);
    if (!mask(w)) return;
    if (k == 0) note(w);
    range(w, k) = miss;
    if (geom.data()) geom(w, k) = -1;
    if (splat.data()) splat(w, k) = -1;
    if (point.data())
      for (int c = 0; c < 3; ++c) point(w, k, c) = R(0);
  }
};

template <class R, class Mem, class Also>
struct ScanRays {
  RayCaster<R, Mem> caster;
  Also also;
  Poses<R, Mem> poses;
  RayMount<R, Mem> mount;
  Kokkos::View<std::int64_t*, Mem> tick;
  Kokkos::View<Transform<R>*, Mem> before;
  Kokkos::View<R**, Kokkos::LayoutRight, Mem> range;
  Kokkos::View<int**, Kokkos::LayoutRight, Mem> geom, splat;
  Kokkos::View<R***, Kokkos::LayoutRight, Mem> point;
  Kokkos::View<double*, Kokkos::LayoutRight, Mem> time;
  RayNoise noise;
  R min_range, max_range, miss;
  std::uint32_t first_world;
  int count, first_ray, first_place;  // of this step: ray first_ray of the pattern comes first, and to that place
  std::int64_t first;                 // its number
  std::int64_t scan_begin, period;    // [ns] of its scan
  std::int64_t begin, length;         // [ns] of the step
  bool at_end;                        // all leave at the step's end

  using Caster = RayCaster<R, Mem>;
  using T = typename Caster::T;
  static constexpr int width = Caster::width;

  KOKKOS_FUNCTION void operator()(std::int64_t i) const {
    int const items = Caster::items_of(count), w = int(i / items), j = int(i % items) * width, n = count - j < width ? count - j : width;
    Transform<R> const body = aligned_body(poses, w, mount.body, mount.alignment);
    Ray<T> const meant = rays_of(at_end ? all_of(body) : moving(w, body, j, n), j, n);
    Ray<T> const sent{meant.origin, noise.angle_sigma > 0 ? bent(noise, spread(words(w, j, n, 0)), meant.direction) : meant.direction};
    auto const met = caster.first(sent, w, n);
    T measured = select(met.geom.is_there(), met.scaled.back(met.x), no_hit<T>());
    LaneIndex<T> other{};
    if constexpr (!std::is_same_v<Also, NothingElse>) {
      for (int l = n; l < width; ++l) set_lane_of(measured, l, R(-1));
      auto const nearer = also.first(sent, w, measured);
      measured = select(nearer.number.is_there(), nearer.distance, measured);
      other = nearer.number;
    }
    if (has_range_noise(noise)) {
      Words const drawn = words(w, j, n, 1);
      measured = with_noise(noise, spread(drawn), drawn.uniform[2], measured);
    }
    for (int l = 0; l < n; ++l)
      write(w, j + l, lane_of(meant, l), in_steps(noise, lane_of(measured, l)), other[l] < 0 ? caster.geom_of(met, l) : -1, other[l]);
  }

 private:
  struct Words {
    T uniform[3];
  };
  /// f(l) in lane l; lanes from n on have the last one's.
  template <class F>
  KOKKOS_INLINE_FUNCTION static T lanes(int n, F const& f) {
    return of_lanes<T>([&](int l) { return f(l < n ? l : n - 1); });
  }
  KOKKOS_INLINE_FUNCTION static Vec3<T> all_of(Vec3<R> const& v) { return {T(v.x), T(v.y), T(v.z)}; }
  KOKKOS_INLINE_FUNCTION static Quat<T> all_of(Quat<R> const& q) { return {T(q.w), T(q.x), T(q.y), T(q.z)}; }
  KOKKOS_INLINE_FUNCTION static Transform<T> all_of(Transform<R> const& t) { return {all_of(t.p), all_of(t.q)}; }
  KOKKOS_INLINE_FUNCTION static Vec3<T> gather(Kokkos::View<Vec3<R>*, Mem> const& from, int const (&k)[width]) {
    Vec3<T> v;
    for (int l = 0; l < width; ++l) {
      Vec3<R> const one = from(k[l]);
      set_lane_of(v.x, l, one.x);
      set_lane_of(v.y, l, one.y);
      set_lane_of(v.z, l, one.z);
    }
    return v;
  }
  /// Of the j-th ray of this step: which it is of the pattern, and when it has left [ns].
  KOKKOS_INLINE_FUNCTION int ray_of(int j) const { return (first_ray + j) % mount.count(); }
  KOKKOS_INLINE_FUNCTION std::int64_t left_at(int j) const {
    return scan_begin + period * ((first_ray + j) / mount.count()) + (tick.extent(0) > 0 ? tick(ray_of(j)) : 0);
  }
  /// Where the body is when rays j ... j + n - 1 leave: from where it was, along a line and about one axis at even speed.
  KOKKOS_INLINE_FUNCTION Transform<T> moving(int w, Transform<R> const& now, int j, int n) const {
    Transform<R> const then = before(w);
    T const t = lanes(n, [&](int l) { return R(left_at(j + l) - begin) / R(length); });
    Vec3<T> const turn = all_of(log_rotation(conjugate(then.q) * now.q));
    return {fma(t, all_of(now.p - then.p), all_of(then.p)), all_of(then.q) * exp_rotation(t * turn)};
  }
  KOKKOS_INLINE_FUNCTION Ray<T> rays_of(Transform<T> const& body, int j, int n) const {
    Transform<T> const unit = body * Transform<T>{all_of(mount.pos), all_of(mount.quat)};
    int k[width];
    for (int l = 0; l < width; ++l) k[l] = ray_of(j + (l < n ? l : n - 1));
    return {mount.origin.extent(0) > 0 ? unit * gather(mount.origin, k) : unit.p, rotate(unit.q, gather(mount.direction, k))};
  }
  /// Uniform numbers of rays j ... j + n - 1.
  KOKKOS_INLINE_FUNCTION Words words(int w, int j, int n, std::uint32_t stream) const {
    Words drawn;
    for (int l = 0; l < width; ++l) {
      RayNumber const number{std::uint64_t(first + j + (l < n ? l : n - 1)), first_world + std::uint32_t(w)};
      Philox const four = noise_words(noise, number, stream);
      for (int c = 0; c < 3; ++c) set_lane_of(drawn.uniform[c], l, uniform_of<R>(four.word[c]));
    }
    return drawn;
  }
  KOKKOS_INLINE_FUNCTION static Spread<T> spread(Words const& drawn) { return Spread<T>::of_uniform(drawn.uniform[0], drawn.uniform[1]); }
  KOKKOS_INLINE_FUNCTION void write(int w, int j, Ray<R> const& ray, R measured, int g, int s) const {
    int const place = (first_place + j) % int(range.extent(1));
    bool const hit = (g >= 0 || s >= 0) && measured >= min_range && measured <= max_range && measured < no_hit<R>();
    range(w, place) = hit ? measured : miss;
    if (geom.data()) geom(w, place) = hit ? g : -1;
    if (splat.data()) splat(w, place) = hit ? s : -1;
    if (point.data()) {
      Vec3<R> const p = hit ? ray.at(measured) : Vec3<R>{R(0), R(0), R(0)};
      for (int c = 0; c < 3; ++c) point(w, place, c) = p[c];
    }
    if (w == 0) time(place) = 1e-9 * double(at_end ? begin + length : left_at(j));
  }
};
template <class R, class Mem>
void expects_poses_of(char const* where, Poses<R, Mem> const& poses, RayScan<R, Mem> const& scan) {
  expects(int(poses.xpos.extent(0)) == scan.options.worlds && int(poses.xpos.extent(1)) > scan.mount.body,
          std::string(where) + ": the scan is of " + std::to_string(scan.options.worlds) + " worlds and a unit on body " +
              std::to_string(scan.mount.body) + ", the poses of " + std::to_string(poses.xpos.extent(0)) + " worlds of " +
              std::to_string(poses.xpos.extent(1)) + " bodies");
}
}  // namespace detail

/// The unit is where its body is in these poses, in the worlds of the mask, and has seen nothing: in all worlds before the first scan_rays,
/// and in those that were reset, whose unit has jumped. Times stay, they are those of all worlds. Does not allocate, does not fence.
/// Errors: std::invalid_argument for poses or a mask of another number of worlds, and poses without that body.
/// @param mask  callable with a world, such as a View<bool*> on the device
template <ExecutionSpace Exec, class R, class Mem, class Mask>
requires requires(Mask const& mask) { bool(mask(0)); }
void begin_ray_scan(Exec const& exec, Poses<R, Mem> const& poses, RayScan<R, Mem>& scan, Mask const& mask) {
  Region const region("gsp::ray::begin_ray_scan");
  static_assert(can_access<Exec, Mem>, "gsp::begin_ray_scan: the scan is not accessible from this execution space");
  detail::expects_poses_of("gsp::begin_ray_scan", poses, scan);
  detail::expects_mask("gsp::begin_ray_scan", mask, "scan", scan.options.worlds);
  if (std::is_same_v<Mask, AllWorlds>) {
    scan.begun = true;
    scan.next = -1;
  }
  using Range = Kokkos::RangePolicy<Exec, Kokkos::IndexType<std::int64_t>>;
  Kokkos::parallel_for("gsp::ray::begin_ray_scan", lightweight(Range(exec, 0, std::int64_t(scan.range.size()))),
                       detail::BeginRayScan<R, Mem, Mask>{{poses, scan.before, scan.mount.body, scan.mount.alignment},
                                                          scan.range,
                                                          scan.geom,
                                                          scan.splat,
                                                          scan.point,
                                                          R(scan.options.miss),
                                                          mask});
}
/// In all worlds.
template <ExecutionSpace Exec, class R, class Mem>
void begin_ray_scan(Exec const& exec, Poses<R, Mem> const& poses, RayScan<R, Mem>& scan) {
  begin_ray_scan(exec, poses, scan, AllWorlds{});
}

/// The rays that leave in step `step`, from step * timestep on until before (step + 1) * timestep, in all worlds: each from where the unit
/// is at its time, at even speed from the pose of the last call to that in `poses`, against the geoms where place_ray_geoms has put them.
/// What they measure goes to their places in range, geom, point and time; all others stay. Of rays more than the scan keeps the last are
/// cast. Geoms stand still within the step, where they are at its end, those of the unit's own robot too.
/// @param poses  at the end of the step, after forward_kinematics or a step
/// @param also   what rays meet beside the geoms, such as splat_target(tree): the nearer wins (NothingElse says what it has)
/// Does not allocate, does not fence. Two launches. Cost: cast_rays of the rays that leave, and about 200 flop each. Errors:
/// std::invalid_argument before begin_ray_scan, for a scene or poses of another number of worlds, a scene whose geoms have not been placed,
/// or by poses of another moment, poses without that body, steps that are not within 0 to 104 days, and one that does not follow the last
/// but where all worlds have begun anew.
template <ExecutionSpace Exec, class R, class Mem, class Also = NothingElse>
void scan_rays(Exec const& exec, RayScene<R, Mem> const& scene, Poses<R, Mem> const& poses, RayScan<R, Mem>& scan, std::int64_t step,
               Also const& also = {}) {
  Region const region("gsp::ray::scan_rays");
  static_assert(can_access<Exec, Mem>, "gsp::scan_rays: the scan is not accessible from this execution space");
  int const worlds = scan.options.worlds, places = scan.options.rays;
  expects(worlds == scene.worlds, "gsp::scan_rays: the scene has " + std::to_string(scene.worlds) + " worlds, the scan has " +
                                      std::to_string(worlds) + ": make both with the same {.worlds = n}");
  detail::expects_poses_of("gsp::scan_rays", poses, scan);
  detail::expects_placed_with("gsp::scan_rays", scene, poses);
  expects(scan.begun,
          "gsp::scan_rays: where the unit was before is not known: call begin_ray_scan(exec, poses, scan) before the first step");
  if (scan.next >= 0 && step != scan.next)
    throw std::invalid_argument("gsp::scan_rays: step " + std::to_string(step) + " comes after step " + std::to_string(scan.next - 1) +
                                (step > scan.next
                                     ? ", and rays between them would be lost: call it for each step, or "
                                     : ", and rays would leave on the way back: copy_ray_scan a copy of before that step, or ") +
                                "begin_ray_scan of all worlds first");
  RayClock const& clock = scan.clock;
  RayPhase phase = rays_of_step(clock, step);
  std::int64_t const more = phase.count > places ? phase.count - places : 0;
  phase.first += more;
  phase.count -= more;
  using Range = Kokkos::RangePolicy<Exec, Kokkos::IndexType<std::int64_t>>;
  if (phase.count > 0) {
    std::int64_t const begin = tick_of_step(clock, step), end = tick_of_step(clock, step + 1), turn = phase.first / clock.rays;
    auto const& o = scan.options;
    auto const bound = also.bind(poses, scan.hidden);
    detail::ScanRays<R, Mem, std::decay_t<decltype(bound)>> const cast{{scene, scan.hidden},
                                                                       bound,
                                                                       poses,
                                                                       scan.mount,
                                                                       scan.tick,
                                                                       scan.before,
                                                                       scan.range,
                                                                       scan.geom,
                                                                       scan.splat,
                                                                       scan.point,
                                                                       scan.time,
                                                                       o.noise,
                                                                       R(o.min_range),
                                                                       R(o.max_range),
                                                                       R(o.miss),
                                                                       std::uint32_t(o.first_world),
                                                                       int(phase.count),
                                                                       int(phase.first % clock.rays),
                                                                       int(phase.first % places),
                                                                       phase.first,
                                                                       turn * clock.period,
                                                                       clock.period,
                                                                       begin,
                                                                       end - begin,
                                                                       clock.period == 0};
    Kokkos::parallel_for("gsp::ray::scan_rays", lightweight(Range(exec, 0, std::int64_t(worlds) * cast.caster.items_of(int(phase.count)))),
                         cast);
  }
  Kokkos::parallel_for("gsp::ray::scan_rays, pose", Kokkos::RangePolicy<Exec>(exec, 0, worlds),
                       detail::NoteUnit<R, Mem>{poses, scan.before, scan.mount.body, scan.mount.alignment});
  scan.next = step + 1;
}

/// `to` goes on as `from` would have, to the bit: what has been measured, where the unit was, which step comes next, of all worlds. Beside
/// `save` and `restore` of a simulation. Does not allocate, does not fence a device. Errors: std::invalid_argument for scans of other
/// sizes, or of which one has no geoms, splats or points.
template <ExecutionSpace Exec, class R, class Mem>
void copy_ray_scan(Exec const& exec, RayScan<R, Mem> const& from, RayScan<R, Mem>& to) {
  Region const region("gsp::ray::copy_ray_scan");
  static_assert(can_access<Exec, Mem>, "gsp::copy_ray_scan: the scans are not accessible from this execution space");
  expects(from.range.extent(0) == to.range.extent(0) && from.range.extent(1) == to.range.extent(1) && from.geom.size() == to.geom.size() &&
              from.splat.size() == to.splat.size() && from.point.size() == to.point.size(),
          "gsp::copy_ray_scan: the two differ in worlds, rays, geoms, splats or points: make both with the same options");
  auto const copy = [&](auto const& a, auto const& b) { detail::copy_view(exec, a, b); };
  copy(from.range, to.range);
  copy(from.geom, to.geom);
  copy(from.splat, to.splat);
  copy(from.point, to.point);
  copy(from.time, to.time);
  copy(from.before, to.before);
  to.begun = from.begun;
  to.next = from.next;
}

}  // namespace gsp
