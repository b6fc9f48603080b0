#pragma once
#include <array>
#include <concepts>
#include <gsp/io/detail/mjcf_document.hpp>
#include <gsp/io/detail/mjcf_quantities.hpp>
#include <gsp/io/detail/mjcf_sensors.hpp>
#include <gsp/model/sensor_types.hpp>
#include <string>
#include <type_traits>
#include <utility>

/// The lists that refer to bodies, joints and the like by name: contacts, equality constraints, tendons, sensors; and keyframes.
namespace gsp::io::detail::mjcf {

inline void read_contacts(Document& doc, Node const& node) {
  doc.check(node);
  for (auto const& child : node.children) {
    if (!doc.check(child)) continue;
    doc.count(1, child.place);
    if (child.name == "pair") {
      auto const a = doc.attributes(child, "pair", "");
      PairDescription p;
      p.place = child.place;
      p.name = a.own("name") ? a.text("name") : "";
      if (!a.own("geom1") || !a.own("geom2")) a.fail("", "needs geom1 and geom2; give both");
      p.geom1 = a.text("geom1");
      p.geom2 = a.text("geom2");
      auto const optional = [&](char const* name, auto& to) {
        if (!a.has(name)) return;
        if constexpr (requires { to->size(); }) {
          to.emplace();
          a.numbers(name, *to, false);
        } else if constexpr (std::same_as<std::decay_t<decltype(*to)>, int>)
          a.integer(name, to.emplace());
        else
          a.number(name, to.emplace());
      };
      optional("condim", p.condim);
      optional("margin", p.margin);
      optional("gap", p.gap);
      optional("adhesion", p.adhesion);
      optional("solreffriction", p.solreffriction);
      if (a.has("solref")) {
        p.solref = SoftnessDescription{}.solref;
        a.numbers("solref", *p.solref, false);
      }
      if (a.has("friction")) {
        p.friction = {1, 1, 0.005, 0.0001, 0.0001};
        a.numbers("friction", *p.friction, false);
      }
      if (a.has("solimp")) {
        p.solimp = SoftnessDescription{}.solimp;
        a.numbers("solimp", *p.solimp, false);
      }
      rigidity(doc, a, child, p.rigid, "", true);
      doc.draft.lists.pairs.push_back(std::move(p));
      continue;
    }
    auto const a = doc.attributes(child);
    if (!a.own("body1") || !a.own("body2")) a.fail("", "needs body1 and body2; give both");
    doc.draft.lists.excludes.push_back({a.text("body1"), a.text("body2"), child.place});
  }
}

inline void read_equalities(Document& doc, Node const& node) {
  doc.check(node);
  for (auto const& child : node.children) {
    if (doc.refuses(child, "<equality> ")) continue;
    doc.check(child, "equality/" + child.name);
    doc.count(1, child.place);
    auto const a = doc.attributes(child, "equality", "");
    EqualityDescription e;
    e.place = child.place;
    e.name = a.own("name") ? a.text("name") : "";
    a.boolean("active", e.active);
    softness(a, e.softness, "");
    rigidity(doc, a, child, e.rigid, "", false);
    e.data[10] = 1;
    auto const two = [&](std::string const& kind) {
      if (!a.own(kind + "1")) a.fail(kind + "1", "is missing; name the first " + kind);
      e.name1 = a.text(kind + "1");
      e.name2 = a.text(kind + "2");
    };
    if (child.name == "joint" || child.name == "tendon") {
      e.type = child.name == "joint" ? EqualityType::joint : EqualityType::tendon;
      two(child.name);
      e.data[1] = 1;
      a.numbers("polycoef", e.data.data(), 5, false);
    } else {
      bool const weld = child.name == "weld";
      e.type = weld ? EqualityType::weld : EqualityType::connect;
      e.sites = a.own("site1") || a.own("site2");
      if (e.sites && (a.own("body1") || a.own("body2") || a.own("anchor") || a.own("relpose")))
        a.fail("site1", "stands beside bodies, anchor or relpose; give two sites, or bodies");
      two(e.sites ? "site" : "body");
      if (e.sites && e.name2.empty()) a.fail("site2", "is missing; name the second site");
      bool const anchor = a.numbers("anchor", e.data.data(), 3);
      if (!weld && !e.sites && !anchor) a.fail("anchor", "is missing; give the point in the frame of body1");
      if (weld && e.sites) e.data[1] = 1;  // of no use, but MuJoCo's
      if (weld) {
        a.numbers("relpose", e.data.data() + 3, 7);
        a.number("torquescale", e.data[10]);
      }
    }
    doc.draft.lists.equalities.push_back(std::move(e));
  }
}

inline void read_tendons(Document& doc, Node const& node) {
  doc.check(node);
  for (auto const& child : node.children) {
    if (!doc.check(child)) continue;
    doc.count(1 + child.children.size(), child.place);
    auto const a = doc.attributes(child, "tendon", "");
    TendonDescription t;
    t.place = child.place;
    t.name = a.own("name") ? a.text("name") : "";
    a.numbers("range", t.range);
    a.numbers("actuatorfrcrange", t.actuator_force_range);
    t.limited = limited(doc, a, "limited", "range", t.range);
    t.actuator_force_limited = limited(doc, a, "actuatorfrclimited", "actuatorfrcrange", t.actuator_force_range);
    std::array<double, 2> spring{-1, -1};
    if (a.numbers("springlength", spring, false))
      t.springlength = words(a.text("springlength")).size() == 1 ? std::array{spring[0], spring[0]} : spring;
    polynomial(a, "stiffness", t.stiffness, t.stiffness_poly);
    polynomial(a, "damping", t.damping, t.damping_poly);
    a.number("frictionloss", t.frictionloss);
    a.number("armature", t.armature);
    a.number("margin", t.margin);
    softness(a, t.limit, "limit");
    softness(a, t.friction, "friction");
    rigidity(doc, a, child, t.rigid_limit, "limit", true);
    for (auto const& part : child.children) {
      doc.check(part, child.name + "/" + part.name);
      auto const b = doc.attributes(part);
      auto const named = [&](std::string const& attribute) {
        if (!b.own(attribute)) b.fail(attribute, "is missing; name the " + attribute);
        return b.text(attribute);
      };
      if (part.name == "joint") {
        TendonDescription::Term entry{named("joint"), 1};
        if (!b.number("coef", entry.coefficient)) b.fail("coef", "is missing; give the coefficient");
        t.terms.push_back(std::move(entry));
      } else if (part.name == "pulley") {
        TendonDescription::PathItem item{WrapType::pulley, "", "", 1};
        if (!b.number("divisor", item.divisor)) b.fail("divisor", "is missing; give what the branch's length is divided by");
        t.path.push_back(std::move(item));
      } else if (part.name == "site") {
        t.path.push_back({WrapType::site, named("site"), "", 1});
      } else {  // whether the geom is a sphere or a cylinder is seen by compile
        t.path.push_back({WrapType::sphere, named("geom"), b.text("sidesite"), 1});
      }
    }
    if (t.terms.empty() && t.path.empty())
      a.fail("", child.name == "fixed" ? "has no joints; add at least one" : "has no path; add at least two sites");
    doc.draft.lists.tendons.push_back(std::move(t));
  }
}

inline void read_sensors(Document& doc, Node const& node) {
  for (auto const& child : node.children) {
    if (doc.refuses(child, "<sensor> ")) continue;
    if (!find_schema("sensor/" + child.name))
      doc.fail(child.place, "unknown element " + in_quotes(child.name) + " in <sensor>; correct or remove it");
    if (!doc.check(child, "sensor/" + child.name)) continue;
    doc.count(1, child.place);
    doc.draft.lists.sensors.push_back(read_sensor(doc.attributes(child), child.name));
    for (char const* const name : {"interval", "interp"})
      if (child.find(name) && !child.find("nsample"))
        doc.note(Line::no_effect, child.place, child.name + ": " + name + " acts where samples are kept alone; give nsample, or remove it");
    if (SensorInfo const* const info = find_sensor_type(child.name);
        info && info->stage != SensorStage::outside && !gsp::detail::is_evaluated(info->stage))
      doc.note(Line::no_effect, child.place,
               child.name +
                   ": what asks for signed distance fields is not computed, and its columns of sensordata stay as they are "
                   "(Sensors::left_out, Sensors::why)");
  }
}

inline void read_keyframes(Document& doc, Node const& node) {
  doc.check(node);
  for (auto const& child : node.children) {
    doc.check(child);
    auto const a = doc.attributes(child);
    KeyDraft k;
    k.key.place = child.place;
    k.key.name = a.text("name");
    a.number("time", k.key.time);
    k.key.qpos = a.list("qpos");
    k.key.qvel = a.list("qvel");
    k.key.act = a.list("act");
    k.key.ctrl = a.list("ctrl");
    k.key.mpos = a.list("mpos");
    k.key.mquat = a.list("mquat");
    doc.draft.keys.push_back(std::move(k));
  }
}

}  // namespace gsp::io::detail::mjcf
