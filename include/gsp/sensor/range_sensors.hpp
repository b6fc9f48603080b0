#pragma once
#include <gsp/core/region.hpp>
#include <gsp/ray/cast_rays.hpp>
#include <gsp/sensor/detail/sensor_frames.hpp>
#include <gsp/sensor/sense.hpp>
#include <gsp/sensor/sensor_table.hpp>

/// MJCF's rangefinders of sites.
namespace gsp {

namespace detail {
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
  KOKKOS_INLINE_FUNCTION R limit(int i, R const& x) const {
    R const most = entries(i).cutoff;
    return most > R(0) ? clamp(x, -most, most) : x;
  }
  template <class Put>
  KOKKOS_FUNCTION void operator()(int w, int i, Put const& put) const {
    RangeSensorEntry<R> const& e = entries(i);
    Transform<R> const site = sites(w, e.site);
    Vec3<R> const from = site.p, along = rotate(site.q, Vec3<R>{R(0), R(0), R(1)}), zero{R(0), R(0), R(0)};
    RayCaster<R, Mem> const caster{scene, {.body_exclude = sites.site_body(e.site)}};
    R const origin[3] = {from.x, from.y, from.z}, direction[3] = {along.x, along.y, along.z};
    auto const met = caster.first({caster.read(origin, 1), caster.read(direction, 1)}, w);
    bool const hit = caster.geom_of(met, 0) >= 0;
    R const distance = hit ? caster.distance_of(met, 0) : R(-1);
    int at = 0;
    auto const put3 = [&](Vec3<R> const& v) {
      for (int c = 0; c < 3; ++c) put(at++, v[c]);
    };
    if (e.has(RangeField::dist)) put(at++, distance);
    if (e.has(RangeField::dir)) put3(hit ? along : zero);
    if (e.has(RangeField::origin)) put3(from);
    if (e.has(RangeField::point)) put3(hit ? fma(distance, along, from) : zero);
    if (e.has(RangeField::normal)) put3(caster.normal_of(w, met, 0));
    if (e.has(RangeField::depth)) put(at++, distance);
  }
};
}  // namespace detail

/// data (world, nsensordata): what rangefinders of sites say, at sensor_adr; what others have there stays as it is. Of data, in this order:
/// dist [m], -1 where nothing is met; dir, the ray's direction, 0 where nothing is met; origin; point; normal; depth, which is dist. All in
/// the world. Its cutoff bounds each number, on both sides (MuJoCo).
/// @param poses  of this state as it is
/// Geoms of all groups are met, also those that are only seen, but for the site's own body's and transparent ones. Does not allocate, does
/// not fence; two launches. Cost: a ray each (ray/cast_rays.hpp); a host's pack has one alone. Errors: std::invalid_argument where the
/// poses are not of this state as it is now.
template <ExecutionSpace Exec, class R, class Mem, class View>
void range_sensors(Exec const& exec, Model<R, Mem> const& model, State<R, Mem> const& state, Poses<R, Mem> const& poses,
                   Sensors<R, Mem>& sensors, View& data) {
  Region const region("gsp::sensor::range_sensors");
  constexpr char const* where = "gsp::range_sensors";
  detail::expects_sensors(where, model, sensors, data);
  if (sensors.ranges.extent(0) == 0) return;
  detail::expects_poses_of(where, poses, state);
  place_ray_geoms(exec, model, poses, sensors.scene);
  sense(exec, detail::RangeSensors<R, Mem>{sensors.scene, {model, poses}, sensors.ranges, sensors.nsensordata}, data,
        {.label = "gsp::sensor::range_sensors"});
}

}  // namespace gsp
