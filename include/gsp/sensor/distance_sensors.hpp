#pragma once
#include <gsp/collision/shape_distance.hpp>
#include <gsp/core/region.hpp>
#include <gsp/sensor/detail/sensor_frames.hpp>
#include <gsp/sensor/sense.hpp>
#include <gsp/sensor/sensor_table.hpp>

/// MJCF's sensors of distances between geoms or bodies: distance, normal, fromto.
namespace gsp {

namespace detail {
/// The nearest pair of the geoms of two objects; of equally near ones the first.
template <class R, class Mem>
struct DistanceSensors {
  Poses<R, Mem> poses;
  Field<R> geom_pos, geom_quat;
  Kokkos::View<DistanceSensorEntry<R>*, Mem> entries;
  Kokkos::View<DistanceGeom<R>*, Mem> geoms;
  int nsensordata;
  int count() const { return int(entries.extent(0)); }
  KOKKOS_INLINE_FUNCTION int size() const { return 6; }  // at most
  KOKKOS_INLINE_FUNCTION int adr(int i) const { return entries(i).adr; }
  int columns() const { return nsensordata; }
  KOKKOS_INLINE_FUNCTION Shape<R> shape(int w, DistanceGeom<R> const& g) const {
    return make_shape(pose_on_body(poses, geom_pos, geom_quat, w, g.body, g.geom), g.size, g.asset);
  }
  template <class Put>
  KOKKOS_FUNCTION void operator()(int w, int i, Put const& put) const {
    DistanceSensorEntry<R> const& e = entries(i);
    Vec3<R> const zero{R(0), R(0), R(0)};
    ShapeDistance<R> nearest{false, e.cutoff, zero, zero};
    for (int k = e.first[0]; k < e.end[0]; ++k) {
      Shape<R> const a = shape(w, geoms(k));
      for (int l = e.first[1]; l < e.end[1]; ++l) {
        auto const found = shape_distance(geoms(k).type, a, geoms(l).type, shape(w, geoms(l)), nearest.dist);
        if (found.near) nearest = found;
      }
    }
    if (e.type == SensorType::distance) return put(0, e.cutoff > R(0) ? max(nearest.dist, -e.cutoff) : nearest.dist);
    auto const put3 = [&](int first, Vec3<R> const& v) {
      for (int c = 0; c < 3; ++c) put(first + c, v[c]);
    };
    Vec3<R> const way = nearest.to - nearest.from;
    R const length = norm(way);
    if (e.type == SensorType::normal) return put3(0, length > R(0) ? (R(1) / length) * way : zero);
    put3(0, nearest.from);
    put3(3, nearest.to);
  }
};
}  // namespace detail

/// data (world, nsensordata): the numbers of sensors of distances, at sensor_adr; what others have there stays as it is. Of the nearest
/// pair of a geom of the one object and a geom of the other, if it is nearer than the sensor's cutoff (which is 0 where none is given: then
/// overlaps alone are seen):
///   distance  the distance, negative inside, at least -cutoff; the cutoff where none is so near [m]
///   normal    unit, from the point of the first to that of the second: where they overlap from the second outward; 0 where none is near
///   fromto    the two points, in the world; 0 where none is near
/// @param poses  of this state as it is
/// Points and distances: collision/shape_distance.hpp. Sizes of geoms are those of the compiled model in all worlds. One launch, of a
/// thread a sensor and world. Does not allocate, does not fence. Errors: std::invalid_argument where the poses are not of this state as it
/// is now.
template <ExecutionSpace Exec, class R, class Mem, class View>
void distance_sensors(Exec const& exec, Model<R, Mem> const& model, State<R, Mem> const& state, Poses<R, Mem> const& poses,
                      Sensors<R, Mem> const& sensors, View& data) {
  Region const region("gsp::sensor::distance_sensors");
  constexpr char const* where = "gsp::distance_sensors";
  detail::expects_sensors(where, model, sensors, data);
  if (sensors.distances.extent(0) == 0) return;
  detail::expects_poses_of(where, poses, state);
  sense(exec,
        detail::DistanceSensors<R, Mem>{poses, model.geom_pos, model.geom_quat, sensors.distances, sensors.distance_geoms,
                                        sensors.nsensordata},
        data, {.label = "gsp::sensor::distance_sensors"});
}

}  // namespace gsp
