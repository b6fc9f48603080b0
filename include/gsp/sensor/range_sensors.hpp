#pragma once
#include <gsp/core/region.hpp>
#include <gsp/ray/cast_rays.hpp>
#include <gsp/sensor/detail/sensor_frames.hpp>
#include <gsp/sensor/sense.hpp>
#include <gsp/sensor/sensor_table.hpp>

/// MJCF's rangefinders, of sites and of cameras.
namespace gsp {

namespace detail {
/// What a rangefinder says of lane l of a caster's rays: put(first ...). depth: its part along a camera's axis; of a site 1.
template <class R, class Mem, class Put>
KOKKOS_INLINE_FUNCTION void put_ray(RangeSensorEntry<R> const& e, RayCaster<R, Mem> const& caster,
                                    typename RayCaster<R, Mem>::Met const& met, int l, int w, Vec3<R> const& from, Vec3<R> const& along,
                                    R depth, int first, Put const& put) {
  bool const hit = caster.geom_of(met, l) >= 0;
  R const distance = hit ? caster.distance_of(met, l) : R(-1);
  Vec3<R> const zero{R(0), R(0), R(0)};
  int at = first;
  auto const put3 = [&](Vec3<R> const& v) {
    for (int c = 0; c < 3; ++c) put(at++, v[c]);
  };
  if (e.has(RangeField::dist)) put(at++, distance);
  if (e.has(RangeField::dir)) put3(hit ? along : zero);
  if (e.has(RangeField::origin)) put3(from);
  if (e.has(RangeField::point)) put3(hit ? fma(distance, along, from) : zero);
  if (e.has(RangeField::normal)) put3(caster.normal_of(w, met, l));
  if (e.has(RangeField::depth)) put(at++, hit ? depth * distance : distance);
}
template <class R>
KOKKOS_INLINE_FUNCTION R limit_range(RangeSensorEntry<R> const& e, R const& x) {
  return e.cutoff > R(0) ? clamp(x, -e.cutoff, e.cutoff) : x;
}

/// A ray along the z axis of a site, which meets all geoms but those of the site's own body.
template <class R, class Mem>
struct RangeSensors {
  RayScene<R, Mem> scene;
  SitePoses<R, Mem> sites;
  Kokkos::View<RangeSensorEntry<R>*, Mem> entries;
  int nsensordata;
  int count() const { return int(entries.extent(0)); }
  KOKKOS_INLINE_FUNCTION int size() const { return nsensordata; }  // at most
  KOKKOS_INLINE_FUNCTION int adr(int i) const { return entries(i).adr; }
  int columns() const { return nsensordata; }
  KOKKOS_INLINE_FUNCTION R limit(int i, R const& x) const { return limit_range(entries(i), x); }
  template <class Put>
  KOKKOS_FUNCTION void operator()(int w, int i, Put const& put) const {
    RangeSensorEntry<R> const& e = entries(i);
    Transform<R> const site = sites(w, e.site);
    Vec3<R> const from = site.p, along = rotate(site.q, Vec3<R>{R(0), R(0), R(1)});
    RayCaster<R, Mem> const caster{scene, {.body_exclude = sites.site_body(e.site)}};
    R const origin[3] = {from.x, from.y, from.z}, direction[3] = {along.x, along.y, along.z};
    auto const met = caster.first({caster.read(origin, 1), caster.read(direction, 1)}, w, 1);
    put_ray(e, caster, met, 0, w, from, along, R(1), 0, put);
  }
};

/// A ray through the middle of each pixel of one camera, row by row from the top; its "sensors" are as many pixels as a caster takes.
/// With (x, y) the pixel's place from the camera's axis, right and down, and R the camera's axes (it looks along -z, y up),
///   direction = R (x / fx, -y / fy, -1) normalised,   depth = the part of the distance along the camera's axis
template <class R, class Mem>
struct CameraRangeSensors {
  RayScene<R, Mem> scene;
  SensorFrames<R, Mem> frames;
  RangeSensorEntry<R> e;
  int nsensordata;
  static constexpr int width = RayCaster<R, Mem>::width;
  int count() const { return (e.width * e.height + width - 1) / width; }
  KOKKOS_INLINE_FUNCTION int size() const { return width * e.size; }
  KOKKOS_INLINE_FUNCTION int adr(int i) const { return e.adr + i * size(); }
  int columns() const { return nsensordata; }
  KOKKOS_INLINE_FUNCTION R limit(int, R const& x) const { return limit_range(e, x); }
  template <class Put>
  KOKKOS_FUNCTION void operator()(int w, int i, Put const& put) const {
    Frame<R> const camera = frames.frame(WorldLane<R>{w, 1}, SensorEntry<R>::camera, e.camera);
    R const fx = frames.model.cam_focal(w, 2 * e.camera), fy = frames.model.cam_focal(w, 2 * e.camera + 1);
    int const first = i * width, rest = e.width * e.height - first, rays = rest < width ? rest : width;
    R origin[3 * width], direction[3 * width], depth[width];
    for (int l = 0; l < rays; ++l) {
      int const row = (first + l) / e.width, column = (first + l) % e.width;
      Vec3<R> const own{(R(column) + R(0.5) - e.cx) / fx, -(R(row) + R(0.5) - e.cy) / fy, R(-1)};
      depth[l] = R(1) / norm(own);
      Vec3<R> const along = camera.r * (depth[l] * own);
      for (int c = 0; c < 3; ++c) {
        origin[3 * l + c] = camera.p[c];
        direction[3 * l + c] = along[c];
      }
    }
    RayCaster<R, Mem> const caster{scene, {.body_exclude = frames.model.cam_body(e.camera)}};
    auto const met = caster.first({caster.read(origin, rays), caster.read(direction, rays)}, w, rays);
    for (int l = 0; l < rays; ++l) {
      Vec3<R> const along{direction[3 * l], direction[3 * l + 1], direction[3 * l + 2]};
      put_ray(e, caster, met, l, w, camera.p, along, depth[l], l * e.size, put);
    }
  }
};
}  // namespace detail

/// data (world, nsensordata): what rangefinders say, at sensor_adr; what others have there stays as it is. Of data, in this order: dist
/// [m], -1 where nothing is met; dir, the ray's direction, 0 where nothing is met; origin; point; normal; depth, of a site dist, of a
/// camera its part along the axis. All in the world; of a camera for each of its pixels, row by row from the top. Its cutoff bounds each
/// number, on both sides (MuJoCo).
/// @param poses    of this state as it is
/// @param has_com  smooth_sensors has just been called with these poses: sensors.subtrees are theirs, and are not computed again
/// Geoms of all groups are met, also those that are only seen, but for the site's or camera's own body's and transparent ones. Does not
/// allocate, does not fence; one launch, one for all sites and one for each camera. Cost: a ray each (ray/cast_rays.hpp); a host's pack has
/// one alone of a site, of a camera as many pixels as it has numbers. Errors: std::invalid_argument where the poses are not of this state
/// as it is now.
template <ExecutionSpace Exec, class R, class Mem, class View>
void range_sensors(Exec const& exec, Model<R, Mem> const& model, State<R, Mem> const& state, Poses<R, Mem> const& poses,
                   Sensors<R, Mem>& sensors, View& data, bool has_com = false) {
  Region const region("gsp::sensor::range_sensors");
  constexpr char const* where = "gsp::range_sensors";
  detail::expects_sensors(where, model, sensors, data);
  if (sensors.ranges.extent(0) == 0 && sensors.range_cameras.empty()) return;
  detail::expects_poses_of(where, poses, state);
  place_ray_geoms(exec, model, poses, sensors.scene);
  if (sensors.ranges.extent(0) > 0)
    sense(exec, detail::RangeSensors<R, Mem>{sensors.scene, {model, poses}, sensors.ranges, sensors.nsensordata}, data,
          {.label = "gsp::sensor::range_sensors"});
  bool by_com = false;
  for (auto const& e : sensors.range_cameras) by_com = by_com || e.by_com;
  if (by_com && !has_com) subtree_com(exec, model, poses, sensors.subtrees);
  for (auto const& e : sensors.range_cameras)
    sense(exec, detail::CameraRangeSensors<R, Mem>{sensors.scene, {model, poses, sensors.subtrees}, e, sensors.nsensordata}, data,
          {.label = "gsp::sensor::camera_range_sensors"});
}

}  // namespace gsp
