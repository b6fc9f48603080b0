#pragma once
#include <gsp/model/contact_sensor.hpp>

/// What MJCF's rangefinders say of a ray, read from their settings.
namespace gsp {

/// In the order in which a ray's numbers stand.
struct RangeSensorField {
  std::string_view name;  // in MJCF's attribute data
  int size;
};
inline constexpr RangeSensorField range_sensor_fields[] = {{"dist", 1},  {"dir", 3},    {"origin", 3},
                                                           {"point", 3}, {"normal", 3}, {"depth", 1}};
enum class RangeField : int { dist, dir, origin, point, normal, depth };

struct RangeSensorSettings {
  unsigned fields = 1u << int(RangeField::dist);  // bit k: the k-th of range_sensor_fields
  std::string fault;                              // what is wrong with them; empty: nothing

  /// Numbers of a ray.
  int size() const { return detail::size_of_fields(range_sensor_fields, fields); }
};

/// The settings (attribute data) of a sensor of type "rangefinder": dist where data is not given, or empty (MuJoCo).
inline RangeSensorSettings range_settings(SensorDescription const& s) {
  RangeSensorSettings out;
  for (auto const& [key, value] : s.settings) {
    if (key != "data") continue;
    auto const fields = detail::read_fields(range_sensor_fields, value);
    if (!fields)
      out.fault = "has data '" + value + "': name each once, in the order dist dir origin point normal depth";
    else if (*fields != 0)
      out.fields = *fields;
  }
  return out;
}

}  // namespace gsp
