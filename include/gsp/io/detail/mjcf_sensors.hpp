#pragma once
#include <gsp/io/detail/mjcf_values.hpp>
#include <gsp/model/sensor_history.hpp>
#include <string>
#include <string_view>

namespace gsp::io::detail::mjcf {

/// Attributes that name what a sensor is about, and the type of what they name; `second`: what it is relative to. The first of a type's
/// that is given counts.
struct SensorTarget {
  std::string_view attribute, type;
  bool second;
};
inline constexpr SensorTarget sensor_targets[] = {
    {"site", "site", false}, {"joint", "joint", false},     {"tendon", "tendon", false}, {"actuator", "actuator", false},
    {"body", "body", false}, {"body1", "body", false},      {"geom1", "geom", false},    {"subtree1", "subtree", false},
    {"mesh", "mesh", false}, {"camera", "camera", false},   {"body2", "body", true},     {"geom2", "geom", true},
    {"geom", "geom", true},  {"subtree2", "subtree", true},
};
inline constexpr std::string_view sensor_settings = "data num reduce enclosed datatype dim needstage delay interval nsample interp";

/// A <sensor>'s child as a description. Where a site or camera stands beside another object, the second is what it is relative to
/// (camprojection: the camera; insidesite: the site).
inline SensorDescription read_sensor(Attributes const& a, std::string const& type) {
  SensorDescription s;
  s.place = a.place();
  s.type = type;
  s.name = a.text("name");
  a.number("cutoff", s.cutoff);
  a.number("noise", s.noise);
  auto const put = [](std::string& to_type, std::string& to, std::string_view given_type, std::string given) {
    to_type = given_type;
    to = std::move(given);
  };
  for (std::string const what : {"obj", "ref"})
    if (a.own(what + "type") != a.own(what + "name")) a.fail(what + "name", "and '" + what + "type' go together; give both");
  if (a.own("objname")) put(s.object_type, s.object, a.text("objtype"), a.text("objname"));
  if (a.own("refname")) put(s.reference_type, s.reference, a.text("reftype"), a.text("refname"));
  for (auto const& t : sensor_targets) {
    if (!a.own(t.attribute)) continue;
    bool const first = type == "contact" || t.attribute.ends_with('1');  // sides say which is which
    bool const second = t.second || (!s.object.empty() && !first);
    if (second ? !s.reference.empty() : !s.object.empty()) a.fail(t.attribute, "names one object too many; keep what the sensor is about");
    if (second)
      put(s.reference_type, s.reference, t.type, a.text(t.attribute));
    else
      put(s.object_type, s.object, t.type, a.text(t.attribute));
  }
  bool const alone = type == "clock" || type == "e_potential" || type == "e_kinetic" || type == "contact" || type == "user";
  if (s.object.empty() && !alone) a.fail("", "does not say what it measures; name the object");
  if (type == "user" && !a.own("dim")) a.fail("dim", "is missing; give how many numbers the sensor has");
  if (a.own("datatype")) a.choice("datatype", {"real", "positive", "axis", "quaternion"});
  if (a.own("needstage")) a.choice("needstage", {"pos", "vel", "acc"});
  double delay = 0;
  std::array<double, 2> interval{};
  int samples = 0;
  a.number("delay", delay);
  a.numbers("interval", interval, false);
  a.integer("nsample", samples);
  if (a.own("interp")) a.choice("interp", {interpolation_names.begin(), interpolation_names.end()});
  for (auto word : words(sensor_settings))
    if (a.own(word)) s.settings.push_back({std::string(word), a.text(word)});
  return s;
}

}  // namespace gsp::io::detail::mjcf
