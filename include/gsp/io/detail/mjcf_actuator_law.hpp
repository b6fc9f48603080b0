#pragma once
#include <array>
#include <gsp/io/detail/mjcf_values.hpp>
#include <gsp/model/description.hpp>
#include <string>
#include <vector>

/// What an actuator's elements say together about its force: MuJoCo's shortcuts (motor, position, muscle ...) as the law of <general>.
namespace gsp::io::detail::mjcf {

/// force = gain(length, velocity) * (control or activation) + bias(length, velocity). A positive bias[2] with gain[0] = -bias[1] is a
/// damping ratio.
struct Law {
  std::array<double, 10> gain{1}, bias{}, dyn{1};
  std::string gaintype = "fixed", biastype = "none", dyntype = "none";
  std::string type;  // the shortcut that wrote it; nothing after general
  double inheritrange = 0;
  bool ctrl_limited = false;  // the element asks for a limit by itself
};

/// The law of `node`. Each shortcut starts from its class's values; where another shortcut than itself or general set those, from the
/// parent class's (laws: of the outermost class first, its own last), and otherwise from MuJoCo's defaults.
inline Law changed_law(std::vector<Law> const& laws, Files const& files, Node const& node) {
  Attributes const a(files, node, nullptr);
  std::string const& type = node.name;
  bool const general = type == "general";
  Law law;
  for (auto from = laws.rbegin(); from != laws.rend(); ++from)
    if (general || from->type.empty() || from->type == type) {
      law = *from;
      break;
    }
  a.number("inheritrange", law.inheritrange);
  auto const kind = [&](char const* dyn, char const* gain, char const* bias) {
    law.dyntype = dyn, law.gaintype = gain, law.biastype = bias;
  };
  auto const negative = [&](char const* attribute, double value) {
    if (value < 0) a.fail(attribute, "is negative; give zero or more");
  };
  bool const own = law.type == type;  // of the same shortcut
  law.ctrl_limited = false;
  law.type = general ? "" : type;
  if (general) {
    a.numbers("gainprm", law.gain, false), a.numbers("biasprm", law.bias, false), a.numbers("dynprm", law.dyn, false);
    law.gaintype = a.text("gaintype", law.gaintype), law.biastype = a.text("biastype", law.biastype),
    law.dyntype = a.text("dyntype", law.dyntype);
  } else if (type == "motor") {
    law.gain = {1}, law.bias = {}, law.dyn = {1};
    kind("none", "fixed", "none");
  } else if (type == "position" || type == "intvelocity") {
    double kv = 0, dampratio = 0, timeconst = 0;
    a.number("kp", law.gain[0]);
    bool const has_kv = a.number("kv", kv), has_ratio = a.number("dampratio", dampratio);
    if (has_kv && has_ratio) a.fail("dampratio", "stands beside kv; keep one");
    if (law.gain[0] < 0 || kv < 0 || dampratio < 0) a.fail("", "has a negative kp, kv or dampratio; give zero or more");
    law.bias[0] = 0, law.bias[1] = -law.gain[0];
    if (has_kv) law.bias[2] = -kv;
    if (has_ratio) law.bias[2] = dampratio;
    bool filtered = own && law.dyntype == "filterexact";
    if (a.number("timeconst", timeconst)) negative("timeconst", timeconst), filtered = timeconst > 0, law.dyn[0] = timeconst;
    kind(type == "intvelocity" ? "integrator" : filtered ? "filterexact" : "none", "fixed", "affine");
  } else if (type == "velocity") {
    a.number("kv", law.gain[0]), negative("kv", law.gain[0]);
    law.bias = {0, 0, -law.gain[0]};
    kind("none", "fixed", "affine");
  } else if (type == "damper") {
    double kv = law.gaintype == "affine" ? -law.gain[2] : 1;
    a.number("kv", kv), negative("kv", kv);
    law.gain = {0, 0, -kv}, law.ctrl_limited = true;
    kind("none", "affine", "none");
  } else if (type == "cylinder") {
    double diameter = -1;
    Double3 bias{law.bias[0], law.bias[1], law.bias[2]};
    a.number("timeconst", law.dyn[0]), a.number("area", law.gain[0]), a.numbers("bias", bias);
    if (a.number("diameter", diameter) && diameter >= 0) law.gain[0] = 3.14159265358979323846 / 4 * diameter * diameter;
    std::copy(bias.begin(), bias.end(), law.bias.begin());
    kind("filter", "fixed", "affine");
  } else if (type == "muscle") {
    // values that still are <general>'s defaults become the muscle's
    auto const instead = [](double& x, double before, double now) { x = x == before ? now : x; };
    instead(law.dyn[0], 1, 0.01), instead(law.dyn[1], 0, 0.04), instead(law.gain[0], 1, 0.75);
    double const usual[] = {0.75, 1.05, -1, 200, 0.5, 1.6, 1.5, 1.3, 1.2};
    for (std::size_t i = 1; i < 9; ++i) instead(law.gain[i], 0, usual[i]);
    std::array<double, 2> timeconst{-1, -1}, range{-1, -1};
    a.numbers("timeconst", timeconst), a.numbers("range", range);
    if (a.number("tausmooth", law.dyn[2])) negative("tausmooth", law.dyn[2]);
    for (std::size_t i = 0; i < 2; ++i) {
      if (timeconst[i] >= 0) law.dyn[i] = timeconst[i];
      if (range[i] >= 0) law.gain[i] = range[i];
    }
    char const* const names[] = {"force", "scale", "lmin", "lmax", "vmax", "fpmax", "fvmax"};
    for (std::size_t i = 0; i < 7; ++i)
      if (double x = -1; a.number(names[i], x) && x >= 0) law.gain[i + 2] = x;
    std::copy(law.gain.begin(), law.gain.begin() + 9, law.bias.begin());
    kind("muscle", "muscle", "muscle");
  } else if (type == "adhesion") {
    a.number("gain", law.gain[0]), negative("gain", law.gain[0]);
    law.ctrl_limited = true;
    kind("none", "fixed", "none");
  }
  return law;
}

/// The law as the fields of a description. Errors: types that ask for code of the user's, or have several controls.
inline void settle(Law const& law, Attributes const& a, ActuatorDescription& act) {
  auto const index = [&](char const* attribute, std::string const& word, std::vector<std::string_view> const& known) {
    for (std::size_t i = 0; i < known.size(); ++i)
      if (known[i] == word) return static_cast<int>(i);
    std::string list;
    for (auto k : known) list += (list.empty() ? "" : ", ") + std::string(k);
    a.fail(attribute, "is " + in_quotes(word) + ", which is not supported; use one of: " + list);
  };
  act.dynamics = static_cast<ActuatorDynamics>(index("dyntype", law.dyntype, {"none", "integrator", "filter", "filterexact", "muscle"}));
  act.gain_type = static_cast<ActuatorGain>(index("gaintype", law.gaintype, {"fixed", "affine", "muscle"}));
  act.bias_type = static_cast<ActuatorBias>(index("biastype", law.biastype, {"none", "affine", "muscle"}));
  act.gainprm = law.gain, act.biasprm = law.bias, act.dynprm = law.dyn;
  if (law.gain[0] == -law.bias[1] && law.bias[2] > 0 && act.bias_type == ActuatorBias::affine)
    act.dampratio = law.bias[2], act.biasprm[2] = 0;
}

}  // namespace gsp::io::detail::mjcf
