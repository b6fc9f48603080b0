#pragma once
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <gsp/core/check.hpp>
#include <gsp/geometry/shapes.hpp>
#include <gsp/model/compiled.hpp>
#include <gsp/model/detail/host_math.hpp>
#include <gsp/model/detail/references.hpp>
#include <string>
#include <unordered_map>
#include <vector>

namespace gsp::detail {

/// What all steps of compiling share: the description, the model so far, names, and sentences for errors.
class CompilerBase {
 protected:
  explicit CompilerBase(Description const& d) : d_(d) {}

  // "FILE:LINE: kind 'name' sentence"
  [[noreturn]] void fail(Place const& place, std::string const& what, std::string const& name, std::string const& sentence) const {
    throw Error(at(place) + what + (name.empty() ? "" : " '" + name + "'") + " " + sentence);
  }
  std::string at(Place const& place) const {
    if (place.file < 0 || place.file >= int(d_.files.size())) return (d_.name.empty() ? "model: " : d_.name + ": ") + of_body_;
    return d_.files[place.file] + ":" + std::to_string(place.line) + ": ";
  }
  void note(Place const& place, ReportLine::Kind kind, std::string const& text) {
    m_.report.push_back({kind, place.file >= 0 ? d_.files[std::size_t(place.file)] : d_.name, place.line, text, 1});
  }
  static char const* kind_name(Kind kind) {
    char const* const names[] = {"item",   "body",     "joint", "geom",     "site",   "camera",
                                 "tendon", "actuator", "mesh",  "equality", "sensor", "pair"};
    return names[int(kind)];
  }
  /// Gives the name to item `index` of its kind.
  void enter(Kind kind, std::string const& name, int index, Place const& place) {
    if (!name.empty() && !names_[std::size_t(kind)].emplace(name, index).second)
      fail(place, kind_name(kind), name, "has a name that is taken already: rename one of the two");
  }
  /// The item that `what` `who` names.
  int find(Kind kind, std::string const& name, Place const& place, char const* what, std::string const& who) const {
    auto const& names = names_[std::size_t(kind)];
    auto const found = names.find(name);
    if (found == names.end())
      fail(place, what, who,
           std::string("names the ") + kind_name(kind) + (name.empty() ? std::string(" ''") : " '" + name + "'") +
               ", which does not exist: correct the name");
    return found->second;
  }
  template <class A>
  static bool finite(A const& a) {
    return std::all_of(a.begin(), a.end(), [](double x) { return std::isfinite(x); });
  }
  void require_finite(bool ok, Place const& place, char const* what, std::string const& name) const {
    if (!ok) fail(place, what, name, "holds a number that is not finite: give it a value");
  }
  /// hard, restitution and erp as numbers.
  Double3 rigid(RigidDescription const& r, Place const& place, char const* what, std::string const& name) const {
    if (!(r.restitution >= 0 && r.restitution <= 1)) fail(place, what, name, "has a restitution that is not between 0 and 1: correct it");
    if (!(r.erp >= 0 && r.erp <= 1)) fail(place, what, name, "has an erp that is not between 0 and 1: correct it");
    return {double(r.hard), r.restitution, r.erp};
  }
  Double4 unit(Double4 const& q) const { return normalized(q); }
  static void require_range(CompilerBase const& c, bool limited, std::array<double, 2> const& range, Place const& place, char const* what,
                            std::string const& name, char const* attribute) {
    if (limited && !(range[0] < range[1]))
      c.fail(place, what, name,
             std::string("is limited, but the first number of its ") + attribute + " is not below the second: order them");
  }

  Description const& d_;
  CompiledModel m_;
  std::array<std::unordered_map<std::string, int>, std::size_t(Kind::count)> names_;
  std::string of_body_;  // whose parts are read now: "body 'name': ", where there is no line to name
};

}  // namespace gsp::detail
