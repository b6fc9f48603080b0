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

/// The law of `node`. Each shortcut starts from its class's values where it set them itself, or general did with the gaintype that it
/// makes; else from those of the parent class (laws: of the outermost class first, its own last), and otherwise from MuJoCo's defaults. All
/// that it does not say is set as MuJoCo's table of the shortcut says.
inline Law changed_law(std::vector<Law> const& laws, Files const& files, Node const& node) {
  Attributes const a(files, node, nullptr);
  std::string const& type = node.name;
  bool const general = type == "general";
  Law law;
  std::string const gaintype = type == "damper" ? "affine" : type == "muscle" ? "muscle" : "fixed";
  for (auto from = laws.rbegin(); from != laws.rend(); ++from)
    if (general || from->type == type || (from->type.empty() && from->gaintype == gaintype)) {
      law = *from;
      break;
    }
  a.number("inheritrange", law.inheritrange);
  auto const kind = [&](char const* dyn, char const* gain, char const* bias) {
    law.dyntype = dyn;
    law.gaintype = gain;
    law.biastype = bias;
  };
  auto const negative = [&](char const* attribute, double value) {
    if (value < 0) a.fail(attribute, "is negative; give zero or more");
  };
  double const gain = law.gain[0];
  law.ctrl_limited = false;
  law.type = general ? "" : type;
  if (general) {
    a.numbers("gainprm", law.gain, false);
    a.numbers("biasprm", law.bias, false);
    a.numbers("dynprm", law.dyn, false);
    law.gaintype = a.text("gaintype", law.gaintype);
    law.biastype = a.text("biastype", law.biastype);
    law.dyntype = a.text("dyntype", law.dyntype);
  } else if (type == "motor") {
    law.gain = {1};
    law.bias = {};
    law.dyn = {1};
    kind("none", "fixed", "none");
  } else if (type == "position" || type == "intvelocity") {
    double kp = gain, kv = 0, dampratio = 0, timeconst = 0;
    bool const was_filtered = law.dyntype == "filterexact";
    a.number("kp", kp);
    bool const has_kv = a.number("kv", kv), has_ratio = a.number("dampratio", dampratio);
    if (has_kv && has_ratio) a.fail("dampratio", "stands beside kv; keep one");
    if (kp < 0 || kv < 0 || dampratio < 0) a.fail("", "has a negative kp, kv or dampratio; give zero or more");
    bool const has_timeconst = a.number("timeconst", timeconst);
    negative("timeconst", timeconst);
    if (!has_timeconst && was_filtered) timeconst = law.dyn[0];
    bool const filtered = type == "position" && timeconst > 0;
    law.bias = {0, -kp, has_kv ? -kv : has_ratio ? dampratio : law.bias[2]};
    law.gain = {kp};
    law.dyn = {has_timeconst || was_filtered ? timeconst : 1};
    kind(type == "intvelocity" ? "integrator" : filtered ? "filterexact" : "none", "fixed", "affine");
  } else if (type == "velocity") {
    double kv = gain;
    a.number("kv", kv);
    negative("kv", kv);
    law.gain = {kv};
    law.bias = {0, 0, -kv};
    law.dyn = {1};
    kind("none", "fixed", "affine");
  } else if (type == "damper") {
    double kv = law.gaintype == "affine" ? -law.gain[2] : 0;  // MuJoCo's own default, whatever its page says
    a.number("kv", kv);
    negative("kv", kv);
    law.gain = {0, 0, -kv};
    law.bias = {};
    law.dyn = {1};
    law.ctrl_limited = true;
    kind("none", "affine", "none");
  } else if (type == "cylinder") {
    double timeconst = law.dyn[0], area = gain, diameter = -1;
    Double3 bias{law.bias[0], law.bias[1], law.bias[2]};
    a.number("timeconst", timeconst);
    a.number("area", area);
    a.numbers("bias", bias);
    if (a.number("diameter", diameter) && diameter >= 0) area = 3.14159265358979323846 / 4 * diameter * diameter;
    law.gain = {area};
    law.bias = {bias[0], bias[1], bias[2]};
    law.dyn = {timeconst};
    kind("filter", "fixed", "affine");
  } else if (type == "muscle") {
    if (law.gaintype != "muscle") {
      law.dyn = {0.01, 0.04};
      law.gain = {0.75, 1.05, -1, 200, 0.5, 1.6, 1.5, 1.3, 1.2};
    }
    std::array<double, 2> timeconst{-1, -1}, range{-1, -1};
    a.numbers("timeconst", timeconst);
    a.numbers("range", range);
    if (a.number("tausmooth", law.dyn[2])) negative("tausmooth", law.dyn[2]);
    for (std::size_t i = 0; i < 2; ++i) {
      if (timeconst[i] >= 0) law.dyn[i] = timeconst[i];
      if (range[i] >= 0) law.gain[i] = range[i];
    }
    char const* const names[] = {"force", "scale", "lmin", "lmax", "vmax", "fpmax", "fvmax"};
    for (std::size_t i = 0; i < 7; ++i)
      if (double x = -1; a.number(names[i], x) && x >= 0) law.gain[i + 2] = x;
    law.bias = law.gain;
    kind("muscle", "muscle", "muscle");
  } else if (type == "adhesion") {
    double force = gain;
    a.number("gain", force);
    negative("gain", force);
    law.gain = {force};
    law.bias = {};
    law.dyn = {1};
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
  act.gainprm = law.gain;
  act.biasprm = law.bias;
  act.dynprm = law.dyn;
  bool const affine = act.bias_type == ActuatorBias::affine;
  if (law.gain[0] == -law.bias[1] && law.bias[2] > 0 && (affine || law.gain[0] > 0)) {
    act.dampratio = law.bias[2];
    act.biasprm[2] = 0;
  }
}

}  // namespace gsp::io::detail::mjcf
