#pragma once
#include <algorithm>
#include <array>
#include <gsp/model/description.hpp>
#include <locale>
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

namespace detail {
/// Bit k: the k-th of a list of fields, by the words of an attribute that names each once, in their order; or nothing.
template <class Fields>
std::optional<unsigned> read_fields(Fields const& fields, std::string const& text) {
  unsigned found = 0;
  int const count = int(std::size(fields));
  int last = -1;
  std::istringstream words(text);
  for (std::string word; words >> word;) {
    int k = 0;
    while (k < count && fields[k].name != word) ++k;
    if (k == count || k <= last) return {};
    last = k;
    found |= 1u << k;
  }
  return found;
}
/// Numbers that the chosen ones have together.
template <class Fields>
int size_of_fields(Fields const& fields, unsigned chosen) {
  int sum = 0;
  for (int k = 0; k < int(std::size(fields)); ++k)
    if ((chosen >> k) & 1u) sum += fields[k].size;
  return sum;
}
/// A whole number, and nothing else; or nothing.
inline std::optional<int> read_whole(std::string const& text) {
  int number = 0;
  std::istringstream in(text);
  in.imbue(std::locale::classic());
  if (!(in >> number) || !(in >> std::ws).eof()) return {};
  return number;
}
}  // namespace detail

struct ContactSensorSettings {
  int slots = 1;
  ContactReduce reduce = ContactReduce::none;
  unsigned fields = 1u << int(ContactField::found);  // bit k: the k-th of contact_sensor_fields
  std::string fault;                                 // what is wrong with them; empty: nothing

  bool has(ContactField field) const { return (fields >> int(field)) & 1u; }
  /// Numbers of a slot.
  int size() const { return detail::size_of_fields(contact_sensor_fields, fields); }
};

/// The settings (attributes num, reduce and data) of a sensor of type "contact".
inline ContactSensorSettings contact_settings(SensorDescription const& s) {
  ContactSensorSettings out;
  constexpr std::array<std::string_view, 4> reduces{"none", "mindist", "maxforce", "netforce"};
  for (auto const& [key, value] : s.settings) {
    if (key == "num") {
      out.slots = detail::read_whole(value).value_or(0);
      if (out.slots < 1) out.fault = "has num '" + value + "', which must be a whole number, 1 or more";
    }
    if (key == "reduce") {
      auto const at = std::find(reduces.begin(), reduces.end(), value);
      if (at == reduces.end())
        out.fault = "has reduce '" + value + "', which must be none, mindist, maxforce or netforce";
      else
        out.reduce = ContactReduce(at - reduces.begin());
    }
    if (key == "data") {
      auto const fields = detail::read_fields(contact_sensor_fields, value);
      if (!fields)
        out.fault = "has data '" + value + "': name each once, in the order found force torque dist pos normal tangent linvel angvel";
      else if (*fields != 0)
        out.fields = *fields;
    }
  }
  if (out.fault.empty() && out.reduce == ContactReduce::netforce && (out.has(ContactField::linvel) || out.has(ContactField::angvel)))
    out.fault = "asks for velocities of a net force, which has none: leave linvel and angvel out, or take another reduce";
  return out;
}

}  // namespace gsp
