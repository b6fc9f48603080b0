#pragma once
#include <array>
#include <gsp/io/detail/mjcf_document.hpp>
#include <gsp/io/detail/mjcf_quantities.hpp>
#include <string>
#include <utility>

namespace gsp::io::detail::mjcf {

inline void read_actuators(Document& doc, Node const& node) {
  doc.check(node);
  for (auto const& child : node.children) {
    if (doc.refuses(child, "<actuator> ")) continue;
    if (!doc.check(child)) continue;
    doc.count(1, child.place);
    auto const a = doc.attributes(child, "actuator", "");
    ActuatorDraft draft;
    auto& act = draft.actuator;
    draft.id = doc.session.next_id++;
    act.place = child.place;
    act.name = a.own("name") ? a.text("name") : "";
    constexpr std::pair<char const*, Transmission> targets[] = {
        {"joint", Transmission::joint}, {"jointinparent", Transmission::joint_in_parent}, {"tendon", Transmission::tendon},
        {"site", Transmission::site},   {"cranksite", Transmission::slider_crank},        {"body", Transmission::body}};
    int given = 0;
    for (auto const& [word, target] : targets)
      if (a.own(word)) {
        ++given;
        act.target = target;
        act.target_name = a.text(word);
      }
    if (given != 1) a.fail("", "needs one of joint, jointinparent, tendon, site, cranksite and body; give one");
    a.number("cranklength", act.crank_length);
    if (act.target == Transmission::slider_crank) {
      act.reference_name = a.text("slidersite");
      if (act.reference_name.empty()) a.fail("slidersite", "is missing; name the site whose z axis the slider moves along");
      if (!(act.crank_length > 0)) a.fail("cranklength", "is not positive; give the length of the rod");
    } else if (a.own("slidersite") || a.own("cranklength")) {
      a.fail("slidersite", "is for a transmission by cranksite; remove slidersite and cranklength");
    }
    if (act.target == Transmission::site)
      act.reference_name = a.text("refsite");
    else if (a.own("refsite"))
      a.fail("refsite", "is for a transmission by site; remove it");
    a.numbers("gear", act.gear, false);
    a.integer("group", act.group);
    a.number("armature", act.armature);
    std::array<double, 2> higher{0, 0};
    polynomial(a, "damping", act.damping, higher);
    if (higher != std::array<double, 2>{})
      doc.refuse(child.place,
                 "<" + child.name + "> damping has coefficients of higher order, which are not supported yet; give one number");
    Law const law = changed_law(doc.class_of(child, "").laws, doc.session.files, child);
    // A class may hand it to what is no servo, where it does nothing. A range given here comes before that of the class, but not in
    // general, which MuJoCo lets inherit all the same.
    bool const range_given = a.own("ctrlrange") || a.own("actrange"), general = child.name == "general";
    bool const servo = law.gaintype == "fixed" && law.biastype == "affine" && law.gain[0] == -law.bias[1];
    draft.inheritrange = !servo || (range_given && !general && !a.own("inheritrange")) ? 0 : law.inheritrange;
    std::string const own_range = law.dyntype == "integrator" ? "actrange" : "ctrlrange";
    bool const is_inherited = draft.inheritrange > 0;
    if (is_inherited && a.own(own_range)) {
      if (a.own("inheritrange")) a.fail("inheritrange", "stands beside " + own_range + "; keep one");
      doc.note(Line::no_effect, child.place, own_range + " of <general>, whose class has inheritrange");
    }
    auto const range = [&](char const* name, char const* flag, std::array<double, 2>& r) {
      if (is_inherited && own_range == name) return true;  // comes from the target
      a.numbers(name, r);
      return limited(doc, a, flag, name, r);
    };
    act.ctrl_limited = range("ctrlrange", "ctrllimited", act.ctrl_range) || law.ctrl_limited;
    act.force_limited = range("forcerange", "forcelimited", act.force_range);
    act.act_limited = range("actrange", "actlimited", act.act_range);
    act.has_length_range = a.numbers("lengthrange", act.length_range);
    if (general) a.boolean("actearly", act.act_early);  // no shortcut takes it over
    settle(law, a, act);
    int actdim = -1;
    if (general && a.integer("actdim", actdim) && actdim >= 0 && actdim != act_size(act))
      a.fail("actdim", "is not the number of activations of this dyntype; remove it");
    if (law.ctrl_limited && (act.ctrl_range[0] < 0 || act.ctrl_range[1] < 0))
      a.fail("ctrlrange", "has a negative number; give zero or more");
    if (act.act_limited && act.dynamics == ActuatorDynamics::none) a.fail("actrange", "is for actuators with an activation; set dyntype");
    doc.draft.lists.actuators.push_back(std::move(draft));
  }
}

}  // namespace gsp::io::detail::mjcf
