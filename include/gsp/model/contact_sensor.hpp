#pragma once
#include <algorithm>
#include <array>
#include <cstdlib>
#include <gsp/model/description.hpp>
#include <optional>
#include <sstream>
#include <string>
#include <string_view>

/// What MJCF's <contact> sensors say of contacts, read from their settings.
namespace gsp {

/// In the order in which a slot holds them.
struct ContactSensorField {
  std::string_view name;  // in MJCF's attribute data
  int size;
};
inline constexpr ContactSensorField contact_sensor_fields[] = {{"found", 1},  {"force", 3},   {"torque", 3}, {"dist", 1},  {"pos", 3},
                                                               {"normal", 3}, {"tangent", 3}, {"linvel", 3}, {"angvel", 3}};
enum class ContactField : int { found, force, torque, dist, pos, normal, tangent, linvel, angvel };

/// Which of the contacts that match fill the slots: the first of the list; the deepest; those of the largest force; one that does what all
/// do together.
enum class ContactReduce : int { none, mindist, maxforce, netforce };

struct ContactSensorSettings {
  int slots = 1;
  ContactReduce reduce = ContactReduce::none;
  unsigned fields = 1u << int(ContactField::found);  // bit k: the k-th of contact_sensor_fields
  std::string fault;                                 // what is wrong with them; empty: nothing

  bool has(ContactField field) const { return (fields >> int(field)) & 1u; }
  /// Numbers of a slot.
  int size() const {
    int sum = 0;
    for (int k = 0; k < int(std::size(contact_sensor_fields)); ++k)
      if ((fields >> k) & 1u) sum += contact_sensor_fields[k].size;
    return sum;
  }
};

/// The settings (attributes num, reduce and data) of a sensor of type "contact".
inline ContactSensorSettings contact_settings(SensorDescription const& s) {
  ContactSensorSettings out;
  constexpr std::array<std::string_view, 4> reduces{"none", "mindist", "maxforce", "netforce"};
  for (auto const& [key, value] : s.settings) {
    if (key == "num") {
      out.slots = std::atoi(value.c_str());
      if (out.slots < 1) out.fault = "has no slots: num must be 1 or more";
    }
    if (key == "reduce") {
      auto const at = std::find(reduces.begin(), reduces.end(), value);
      if (at == reduces.end())
        out.fault = "has reduce '" + value + "', which must be none, mindist, maxforce or netforce";
      else
        out.reduce = ContactReduce(at - reduces.begin());
    }
    if (key == "data") {
      out.fields = 0;
      std::istringstream words(value);
      int last = -1;
      for (std::string word; words >> word;) {
        int k = 0;
        while (k < int(std::size(contact_sensor_fields)) && contact_sensor_fields[k].name != word) ++k;
        if (k == int(std::size(contact_sensor_fields)) || k <= last) {
          out.fault = "has data '" + value + "': name each once, in the order found force torque dist pos normal tangent linvel angvel";
          break;
        }
        last = k;
        out.fields |= 1u << k;
      }
    }
  }
  if (out.fault.empty() && out.fields == 0) out.fault = "has empty data: name at least one of found force torque dist pos ...";
  if (out.fault.empty() && out.reduce == ContactReduce::netforce && (out.has(ContactField::linvel) || out.has(ContactField::angvel)))
    out.fault = "asks for velocities of a net force, which has none: leave linvel and angvel out, or take another reduce";
  return out;
}

}  // namespace gsp
