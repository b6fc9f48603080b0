#pragma once
#include <algorithm>
#include <array>
#include <cmath>
#include <gsp/io/detail/mjcf_document.hpp>
#include <string>
#include <utility>

/// What holds for the whole document: <compiler>, <option> and <default>.
namespace gsp::io::detail::mjcf {

inline void read_compiler(Document& doc, Node const& node) {
  doc.check(node);
  auto const a = doc.attributes(node);
  auto& c = doc.draft.compiler;
  if (a.has("angle")) doc.degrees = a.choice("angle", {"radian", "degree"}) == 1;
  if (a.has("coordinate")) a.choice("coordinate", {"local"});
  a.boolean("autolimits", doc.autolimits);
  a.boolean("balanceinertia", c.balanceinertia);
  a.number("boundmass", c.boundmass);
  a.number("boundinertia", c.boundinertia);
  a.number("settotalmass", c.settotalmass);
  a.boolean("fitaabb", c.fit_aabb);
  a.boolean("discardvisual", c.discard_visual);
  a.boolean("fusestatic", c.fuse_static);
  a.boolean("alignfree", c.align_free);
  a.boolean("strippath", doc.strip_path);
  if (a.has("assetdir")) doc.asset_folder = a.text("assetdir");
  if (a.has("meshdir")) doc.asset_folder = a.text("meshdir");
  if (a.has("inertiafromgeom")) {
    int const mode = a.choice("inertiafromgeom", {"false", "true", "auto"});
    c.inertia_from_geom_never = mode == 0;
    c.inertia_from_geom_always = mode == 1;
  }
  std::array<double, 2> range{0, 5};
  if (a.numbers("inertiagrouprange", range))
    c.inertia_group_range = {static_cast<int>(std::clamp(range[0], -1e6, 1e6)), static_cast<int>(std::clamp(range[1], -1e6, 1e6))};
  if (a.has("eulerseq")) {
    doc.eulerseq = a.text("eulerseq");
    if (doc.eulerseq.size() != 3 || doc.eulerseq.find_first_not_of("xyzXYZ") != std::string::npos)
      a.fail("eulerseq", "is " + in_quotes(doc.eulerseq) + "; give three of x y z X Y Z");
  }
  for (auto const& child : node.children) {
    doc.check(child);
    auto const b = doc.attributes(child);
    auto& range = c.length_range;
    if (b.has("mode")) range.mode = static_cast<LengthRangeMode>(b.choice("mode", {"none", "muscle", "muscleuser", "all"}));
    b.boolean("useexisting", range.use_existing);
    b.boolean("uselimit", range.use_limit);
    for (auto const& [name, to] : {std::pair{"accel", &range.accel},
                                   {"maxforce", &range.max_force},
                                   {"timeconst", &range.time_constant},
                                   {"timestep", &range.timestep},
                                   {"inttotal", &range.total},
                                   {"interval", &range.interval},
                                   {"tolrange", &range.tolerance}})
      if (b.number(name, *to) && *to < 0) b.fail(name, "is negative; give zero or more");
  }
}

inline void read_option(Document& doc, Node const& node) {
  doc.check(node);
  doc.has_option = true;
  auto const a = doc.attributes(node);
  auto& o = doc.draft.option;
  a.number("timestep", o.timestep);
  a.numbers("gravity", o.gravity);
  a.number("impratio", o.impratio);
  a.number("tolerance", o.tolerance);
  a.number("sleep_tolerance", o.sleep_tolerance);
  a.number("density", o.density);
  a.number("viscosity", o.viscosity);
  a.numbers("wind", o.wind);
  a.numbers("magnetic", o.magnetic);
  a.number("o_margin", o.o_margin);
  a.numbers("o_solref", o.o_softness.solref, false);
  a.numbers("o_solimp", o.o_softness.solimp, false);
  a.numbers("o_friction", o.o_friction, false);
  a.integer("iterations", o.iterations);
  a.integer("noslip_iterations", o.noslip_iterations);
  a.number("noslip_tolerance", o.noslip_tolerance);
  if (!(o.timestep > 0)) a.fail("timestep", "is not positive; give seconds, such as 0.002");
  if (!(o.sleep_tolerance >= 0)) a.fail("sleep_tolerance", "is negative; give metres a second, such as 0.001");
  if (!(o.impratio > 0)) a.fail("impratio", "is not positive; give one or more");
  for (double group : a.list("actuatorgroupdisable")) {
    if (group != std::floor(group) || group < 0 || group > 30)
      a.fail("actuatorgroupdisable", "holds a group other than 0 .. 30; correct it");
    o.disabled_actuator_groups |= 1 << static_cast<int>(group);
  }
  if (a.text("integrator") == "discrete")
    doc.refuse(node.place, "<option> integrator='discrete' is not supported; use implicitfast");
  else if (a.has("integrator"))
    o.integrator = static_cast<Integrator>(a.choice("integrator", {"Euler", "RK4", "implicit", "implicitfast"}));
  if (a.has("cone")) o.cone = static_cast<FrictionCone>(a.choice("cone", {"pyramidal", "elliptic"}));
  for (char const* name : {"integrator", "cone", "impratio", "noslip_iterations", "noslip_tolerance"})
    if (a.has(name)) doc.note(Line::mujoco_only, node.place, std::string("<option> ") + name + " (profile stable does without)");
  for (auto const& flag : node.children) {
    doc.check(flag);
    auto const f = doc.attributes(flag);
    for (auto const& one : flag.attributes) {
      bool const on = f.choice(one.name, {"disable", "enable"}) == 1;
      for (auto const& [name, value] : option_flags)
        if (one.name == name) o.*value = on;
    }
  }
}

/// A <default> and those inside it; `top`: the outermost.
inline void read_defaults(Document& doc, Node const& node, std::string const& parent, bool top) {
  doc.check(node);
  auto const* given = node.find("class");
  std::string const name = top ? "" : given ? *given : "";
  if (!top && name.empty()) doc.fail(node.place, "a <default> inside another needs a class; name it");
  if (top && given) doc.main_class = *given;
  if (!top && doc.classes.count(name)) doc.fail(node.place, "default class " + in_quotes(name) + " exists already; rename one of the two");
  if (!top) {
    Class next = doc.classes.at(parent);
    next.laws.push_back(next.laws.back());
    doc.classes.emplace(name, std::move(next));
  }
  for (auto const& child : node.children) {
    if (child.name == "default") continue;
    for (auto const* before = &node.children.front(); before != &child; ++before)
      if (before->name == child.name) doc.fail(child.place, "<" + child.name + "> stands twice in one <default>; keep one");
    if (find_refused(child.name)) {  // matters only to elements that are refused themselves
      doc.note(Line::no_effect, child.place, "<default> <" + child.name + ">");
      continue;
    }
    bool const actuator = is_in("general motor position velocity intvelocity damper cylinder muscle adhesion", child.name);
    doc.check(child, child.name == "tendon" ? "spatial" : child.name == "equality" ? "default/equality" : child.name);
    auto& own = doc.classes.at(name);
    for (auto const& a : child.attributes) {
      auto& values = own.values[actuator ? "actuator" : child.name];
      auto const old = values.find(a.name);
      values.insert_or_assign(a.name, Value{old == values.end() ? a.value : merged(a.name, old->second.text, a.value), child.place});
    }
    if (actuator) own.laws.back() = changed_law(own.laws, doc.session.files, child);
  }
  for (auto const& child : node.children)
    if (child.name == "default") read_defaults(doc, child, name, false);
}

}  // namespace gsp::io::detail::mjcf
