#pragma once
#include <gsp/model/description.hpp>
#include <string>
#include <string_view>

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

/// Bit k: the k-th of range_sensor_fields, of a sensor of type "rangefinder"; dist where the attribute data is not given.
inline unsigned range_fields(SensorDescription const& s) {
  unsigned fields = 1u << int(RangeField::dist);
  for (auto const& [key, value] : s.settings) {
    if (key != "data") continue;
    fields = 0;
    std::string const list = " " + value + " ";
    for (int k = 0; k < 6; ++k)
      fields |= unsigned(list.find(" " + std::string(range_sensor_fields[k].name) + " ") != std::string::npos) << k;
  }
  return fields;
}

}  // namespace gsp
