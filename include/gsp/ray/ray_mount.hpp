#pragma once
#include <gsp/model/names.hpp>
#include <gsp/ray/cast_rays.hpp>
#include <gsp/ray/ray_pattern.hpp>
#include <gsp/ray/ray_unit.hpp>

/// Rays of a unit on a body, in all worlds: they follow from poses, on the device.
namespace gsp {

/// A unit on the device. `make_ray_mount` makes it.
template <class R, class Mem>
struct RayMount {
  using memory_space = Mem;
  int body = 0;
  RayAlignment alignment = RayAlignment::body;
  Vec3<R> pos;
  Quat<R> quat;
  Kokkos::View<Vec3<R>*, Mem> direction, origin;  // of the pattern; origin is empty where all begin at the unit
  KOKKOS_INLINE_FUNCTION int count() const { return int(direction.extent(0)); }
};

/// A unit with the rays of a pattern, whose directions are made unit: distances are metres. Allocates; fences. Errors: gsp::Error for a
/// name that is not there; std::invalid_argument for a mount that names no body or site, or two, a rotation of 0, numbers that are not
/// finite, and a pattern without rays, with another number of origins, a direction of 0 or numbers that are not finite.
template <class R, ExecutionSpace Exec>
RayMount<R, typename Exec::memory_space> make_ray_mount(Exec const& exec, CompiledModel const& compiled, RayPattern const& pattern,
                                                        RayMountOptions const& options) {
  expects(int(!options.body.empty()) + int(options.body_id >= 0) + int(!options.site.empty()) == 1,
          "gsp::make_ray_mount: name one body, by name or by index, or one site");
  expects(!pattern.direction.empty() && (pattern.origin.empty() || pattern.origin.size() == pattern.direction.size()),
          "gsp::make_ray_mount: the pattern needs a direction for each ray, and an origin for each or none");
  RayMount<R, typename Exec::memory_space> mount;
  int const site = options.site.empty() ? -1 : site_id(compiled, options.site);
  mount.body = site >= 0                 ? compiled.site_body[std::size_t(site)]
               : options.body.empty()    ? options.body_id
               : options.body == "world" ? 0
                                         : body_id(compiled, options.body);
  expects(mount.body < compiled.nbody, "gsp::make_ray_mount: the model has " + std::to_string(compiled.nbody) +
                                           " bodies, not one of index " + std::to_string(mount.body));
  auto const& q = options.quat;
  double const length = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
  double const sum = length + options.pos[0] + options.pos[1] + options.pos[2];
  expects(std::isfinite(sum) && length > 0, "gsp::make_ray_mount: pos and quat must be finite, and the rotation not 0");
  mount.alignment = options.alignment;
  Transform<double> place{{options.pos[0], options.pos[1], options.pos[2]}, {q[0] / length, q[1] / length, q[2] / length, q[3] / length}};
  if (site >= 0) {
    auto const& p = compiled.site_pos[std::size_t(site)];
    auto const& turn = compiled.site_quat[std::size_t(site)];
    place = Transform<double>{{p[0], p[1], p[2]}, {turn[0], turn[1], turn[2], turn[3]}} * place;
  }
  mount.pos = {R(place.p.x), R(place.p.y), R(place.p.z)};
  mount.quat = {R(place.q.w), R(place.q.x), R(place.q.y), R(place.q.z)};
  auto const upload = [&](char const* label, std::vector<Double3> const& from, bool unit) {
    std::vector<Vec3<R>> to;
    for (auto const& v : from) {
      double const norm = std::hypot(v[0], v[1], v[2]), by = unit ? norm : 1;
      if (!std::isfinite(norm) || by == 0)
        throw std::invalid_argument("gsp::make_ray_mount: the " + std::string(unit ? "direction" : "origin") + " of ray " +
                                    std::to_string(to.size()) + " is not finite" + (unit ? ", or has no length" : "") +
                                    ": leave that ray out of the pattern");
      to.push_back({R(v[0] / by), R(v[1] / by), R(v[2] / by)});
    }
    return detail::to_device<Kokkos::View<Vec3<R>*, typename Exec::memory_space>>(exec, label, to);
  };
  mount.direction = upload("gsp::RayMount::direction", pattern.direction, true);
  if (!pattern.origin.empty()) mount.origin = upload("gsp::RayMount::origin", pattern.origin, false);
  return mount;
}

namespace detail {
/// Where the body of a unit is, turned as the unit is aligned.
template <class R, class Mem>
KOKKOS_INLINE_FUNCTION Transform<R> aligned_body(Poses<R, Mem> const& poses, int w, int body, RayAlignment alignment) {
  R const *const x = &poses.xpos(w, body, 0), *const p = &poses.xquat(w, body, 0);
  Quat<R> const q{p[0], p[1], p[2], p[3]};
  Transform<R> place{{x[0], x[1], x[2]}, identity_quat<R>()};
  if (alignment == RayAlignment::body) place.q = q;
  if (alignment != RayAlignment::yaw) return place;
  Vec3<R> const ahead = rotate(q, Vec3<R>{R(1), R(0), R(0)});
  R const length = sqrt(fma(ahead.x, ahead.x, ahead.y * ahead.y));
  if (!(length > R(0))) return place;  // it looks straight up or down
  // cos and sin of half of the angle whose cos and sin are c and s, from the larger of the two
  R const c = ahead.x / length, s = ahead.y / length;
  if (c >= R(0)) {
    R const half = sqrt(R(0.5) * (R(1) + c));
    place.q = {half, R(0), R(0), R(0.5) * s / half};
  } else {
    R const half = sqrt(R(0.5) * (R(1) - c));
    place.q = {R(0.5) * s / half, R(0), R(0), half};
  }
  return place;
}
/// Some of the rays of a unit in one world: one on a device, on a host as many as share the way from the body's pose to the unit's.
template <class R, class Mem>
struct MountRays {
  static constexpr int rays_an_item = is_device<typename Mem::execution_space> ? 1 : 32;
  Poses<R, Mem> poses;
  RayMount<R, Mem> mount;
  Rays<R, Mem> rays;
  int first, count;
  KOKKOS_INLINE_FUNCTION static int items_of(int count) { return (count + rays_an_item - 1) / rays_an_item; }
  KOKKOS_FUNCTION void operator()(std::int64_t i) const {
    int const items = items_of(count), w = int(i / items), begin = int(i % items) * rays_an_item;
    int const end = begin + rays_an_item < count ? begin + rays_an_item : count;
    Transform<R> const unit = aligned_body(poses, w, mount.body, mount.alignment) * Transform<R>{mount.pos, mount.quat};
    bool const from_one = mount.origin.extent(0) == 0;
    for (int k = begin; k < end; ++k) {
      Vec3<R> const origin = from_one ? unit.p : unit * mount.origin(k), direction = rotate(unit.q, mount.direction(k));
      for (int c = 0; c < 3; ++c) {
        rays.origin(w, first + k, c) = origin[c];
        rays.direction(w, first + k, c) = direction[c];
      }
    }
  }
};
}  // namespace detail

/// The rays of a unit where its body is in these poses, of all worlds, to rays first ... first + mount.count() - 1 of each world.
/// @param poses  of the model that the mount was made for, after forward_kinematics or a step
/// Does not allocate, does not fence. About 40 flop a ray. Errors: std::invalid_argument for poses without that body or of another number
/// of worlds, and where there is no room for the rays.
template <ExecutionSpace Exec, class R, class Mem>
void mount_rays(Exec const& exec, Poses<R, Mem> const& poses, RayMount<R, Mem> const& mount, Rays<R, Mem>& rays, int first = 0) {
  Region const region("gsp::ray::mount_rays");
  static_assert(can_access<Exec, Mem>, "gsp::mount_rays: the rays are not accessible from this execution space");
  int const worlds = int(rays.origin.extent(0)), room = int(rays.origin.extent(1));
  expects(int(poses.xpos.extent(0)) == worlds && int(poses.xpos.extent(1)) > mount.body,
          "gsp::mount_rays: the rays are of " + std::to_string(worlds) + " worlds and a unit on body " + std::to_string(mount.body) +
              ", the poses of " + std::to_string(poses.xpos.extent(0)) + " worlds of " + std::to_string(poses.xpos.extent(1)) + " bodies");
  expects(first >= 0 && first + mount.count() <= room, "gsp::mount_rays: rays " + std::to_string(first) + " to " +
                                                           std::to_string(first + mount.count() - 1) + " are asked for, and there are " +
                                                           std::to_string(room));
  using Range = Kokkos::RangePolicy<Exec, Kokkos::IndexType<std::int64_t>>;
  Kokkos::parallel_for("gsp::ray::mount_rays",
                       lightweight(Range(exec, 0, std::int64_t(worlds) * detail::MountRays<R, Mem>::items_of(mount.count()))),
                       detail::MountRays<R, Mem>{poses, mount, rays, first, mount.count()});
}

}  // namespace gsp
