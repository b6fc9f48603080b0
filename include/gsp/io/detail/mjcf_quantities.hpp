#pragma once
#include <array>
#include <cmath>
#include <gsp/io/detail/mjcf_document.hpp>
#include <string>
#include <string_view>

/// Attributes that make one quantity together, or that <compiler> has a say in.
namespace gsp::io::detail::mjcf {

using gsp::detail::axis_angle;
using gsp::detail::cross;
using gsp::detail::dot;
using gsp::detail::norm;
using gsp::detail::quat_of_axes;
using gsp::detail::quat_of_z;
using gsp::detail::times;
using gsp::detail::operator+;
using gsp::detail::operator-;

inline double angle(Document const& doc, double x) { return doc.degrees ? x * (3.14159265358979323846 / 180) : x; }
inline Double3 unit(Attributes const& a, std::string_view name, Double3 const& v) {
  double const n = norm(v);
  if (!(n > 1e-14)) a.fail(name, "is a direction of length zero; give a direction");
  return (1 / n) * v;
}
/// Rotation by Euler angles: lower case letters turn about the moving axes, upper case about the fixed ones.
inline Double4 euler(Document const& doc, Double3 const& angles) {
  Double4 q{1, 0, 0, 0};
  for (std::size_t k = 0; k < 3; ++k) {
    char const c = doc.eulerseq[k];
    bool const moving = c >= 'x';
    Double3 axis{0, 0, 0};
    axis[std::size_t(c - (moving ? 'x' : 'X'))] = 1;
    auto const turn = axis_angle(axis, angle(doc, angles[k]));
    q = moving ? times(q, turn) : times(turn, q);
  }
  return q;
}
inline Double4 orientation(Document const& doc, Attributes const& a) {
  char const* const ways[] = {"axisangle", "euler", "xyaxes", "zaxis", "quat"};
  std::string_view chosen;
  int own = 0;
  for (char const* way : ways)
    if (a.own(way)) {
      chosen = way;
      ++own;
    }
  if (own > 1) a.fail("", "has more than one of quat, axisangle, euler, xyaxes, zaxis; keep one");
  if (own == 0 || chosen == "quat")
    for (char const* way : {"axisangle", "euler", "xyaxes", "zaxis"})
      if (a.has(way)) {
        if (chosen == "quat") a.fail("quat", std::string("stands against '") + way + "' of the default class; give it in that way");
        chosen = way;
      }
  if (chosen == "axisangle") {
    Double4 v{};
    a.numbers("axisangle", v);
    return axis_angle(unit(a, "axisangle", {v[0], v[1], v[2]}), angle(doc, v[3]));
  }
  if (chosen == "euler") {
    Double3 v{};
    a.numbers("euler", v);
    return euler(doc, v);
  }
  if (chosen == "xyaxes") {
    std::array<double, 6> v{};
    a.numbers("xyaxes", v);
    Double3 const x = unit(a, "xyaxes", {v[0], v[1], v[2]}), given{v[3], v[4], v[5]};
    Double3 const y = unit(a, "xyaxes", given - dot(x, given) * x);
    return quat_of_axes(x, y, cross(x, y));
  }
  if (chosen == "zaxis") {
    Double3 v{};
    a.numbers("zaxis", v);
    return quat_of_z(unit(a, "zaxis", v));
  }
  Double4 quat{1, 0, 0, 0};
  a.numbers("quat", quat);
  if (!(std::abs(quat[0]) + std::abs(quat[1]) + std::abs(quat[2]) + std::abs(quat[3]) > 1e-14))
    a.fail("quat", "has length zero; give a rotation");
  return normalized(quat);
}

inline Pose pose_of(Document const& doc, Attributes const& a) {
  Pose pose;
  a.numbers("pos", pose.p);
  pose.q = orientation(doc, a);
  return pose;
}
template <class Part>
void set_pose(Part& part, Pose const& pose) {
  part.pos = pose.p;
  part.quat = normalized(pose.q);
}

inline void softness(Attributes const& a, SoftnessDescription& s, std::string const& suffix) {
  a.numbers("solref" + suffix, s.solref, false);
  a.numbers("solimp" + suffix, s.solimp, false);
}
/// Attributes of our own: hard, restitution, erp; of geoms also as MotrixSim calls them. The last two do nothing without the first, and
/// none does in profile mujoco: the report says so, the latter in lines that a simulation in profile stable need not show.
inline void rigidity(Document& doc, Attributes const& a, Node const& node, RigidDescription& r, std::string const& suffix, bool bounces) {
  for (std::string const& name : {"hard" + suffix, std::string("_hard")}) a.boolean(name, r.hard);
  for (std::string const& name : {"restitution" + suffix, std::string("_bounciness")})
    if (bounces) a.number(name, r.restitution);
  bool corrects = false;
  for (std::string const& name : {"erp" + suffix, std::string("_erp")}) corrects = a.number(name, r.erp) || corrects;
  std::string const what = std::string(bounces ? "restitution" + suffix + " and erp" : "erp") + suffix;
  std::string const why = node.name == "geom" ? "a soft geom has neither: " : "";
  if (!r.hard && (r.restitution != 0 || corrects))
    doc.note(Line::no_effect, node.place,
             "<" + node.name + "> " + what + " without hard" + suffix + " (" + why + "give hard" + suffix + "=\"true\")");
  if (r.hard) doc.note(Line::stable_only, node.place, "<" + node.name + "> hard" + suffix + ", " + what + " (profile mujoco does without)");
}
/// The first number of a list and the coefficients of higher order that may follow.
inline void polynomial(Attributes const& a, char const* name, double& first, std::array<double, 2>& higher) {
  std::array<double, 3> v{first, higher[0], higher[1]};
  a.numbers(name, v, false);
  first = v[0];
  higher = {v[1], v[2]};
}
/// limited="auto" follows from the range, if the compiler allows.
inline bool limited(Document const& doc, Attributes const& a, char const* flag, char const* range, std::array<double, 2> const& value) {
  int const given = a.has(flag) ? a.choice(flag, {"false", "true", "auto"}) : 2;
  if (given != 2) return given == 1;
  if (!doc.autolimits && a.has(range))
    a.fail(range, std::string("is given without ") + flag + " while compiler autolimits is false; give it");
  if (value[0] > value[1] || (a.own(range) && value[0] == value[1] && value[0] != 0))
    a.fail(range, "is not in increasing order; exchange its numbers");
  return value[0] < value[1];
}

}  // namespace gsp::io::detail::mjcf
