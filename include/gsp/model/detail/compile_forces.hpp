#pragma once
#include <gsp/model/contact_sensor.hpp>
#include <gsp/model/detail/compile_bodies.hpp>
#include <gsp/model/range_sensor.hpp>
#include <gsp/model/sensor_history.hpp>
#include <gsp/model/sensor_types.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace gsp::detail {

/// What acts on the bodies and what measures them: tendons, actuators, equality constraints, sensors; their names resolved.
class ForceCompiler : public BodyCompiler {
 protected:
  using BodyCompiler::BodyCompiler;
  std::vector<int> unknown_ranges_;  // actuators whose range of length is found by simulation

  void tendons() {
    for (auto const& t : d_.tendons) {
      auto const refuse = [&](std::string const& sentence) { fail(t.place, "tendon", t.name, sentence); };
      enter(Kind::tendon, t.name, m_.ntendon, t.place);
      require_finite(finite(t.range) && finite(t.springlength) && finite(t.limit.solref) && finite(t.limit.solimp) &&
                         finite(t.friction.solref) && finite(t.friction.solimp) && finite(t.actuator_force_range) &&
                         finite(t.stiffness_poly) && finite(t.damping_poly) &&
                         finite(std::array{t.stiffness, t.damping, t.frictionloss, t.armature, t.margin}),
                     t.place, "tendon", t.name);
      if (t.terms.empty() == t.path.empty())
        refuse(t.terms.empty() ? "has neither joints nor a path: add joints, or sites"
                               : "has both joints and a path: make two tendons of it");
      if (t.armature < 0) refuse("has a negative armature: give zero or more");
      if (t.frictionloss < 0) refuse("has a negative frictionloss: give zero or more");
      if (t.springlength[0] > t.springlength[1]) refuse("has a springlength whose first number is above the second: order them");
      require_range(*this, t.limited, t.range, t.place, "tendon", t.name, "range");
      require_range(*this, t.actuator_force_limited, t.actuator_force_range, t.place, "tendon", t.name, "actuatorfrcrange");
      std::vector<int> bodies;  // that it touches
      m_.tendon_termadr.push_back(int(m_.term_jnt.size()));
      m_.tendon_termnum.push_back(int(t.terms.size()));
      for (auto const& term : t.terms) {
        int const j = find(Kind::joint, term.joint, t.place, "tendon", t.name);
        if (m_.jnt_type[j] < int(JointType::slide))
          refuse("names the joint '" + term.joint + "', which is a ball or free joint: only hinge and slide joints have one coordinate");
        require_finite(std::isfinite(term.coefficient), t.place, "tendon", t.name);
        for (int e = m_.tendon_termadr.back(); e < int(m_.term_jnt.size()); ++e)
          if (m_.term_jnt[e] == j) refuse("names the joint '" + term.joint + "' twice: add the coefficients up");
        m_.term_jnt.push_back(j);
        m_.term_coef.push_back(term.coefficient);
        bodies.push_back(m_.jnt_body[j]);
      }
      path(t, bodies);
      int tree = -1;  // the one that all of it belongs to; what is fixed to the world does not count
      bool several = false;
      for (int b : bodies)
        if (int const of = m_.body_tree[b]; of >= 0) {
          several = several || (tree >= 0 && tree != of);
          tree = of;
        }
      m_.tendon_tree.push_back(several ? -1 : tree);
      m_.tendon_limited.push_back(t.limited);
      m_.tendon_name.push_back(t.name);
      m_.tendon_stiffness.push_back(t.stiffness);
      m_.tendon_damping.push_back(t.damping);
      m_.tendon_frictionloss.push_back(t.frictionloss);
      m_.tendon_stiffnesspoly.push_back(t.stiffness_poly);
      m_.tendon_dampingpoly.push_back(t.damping_poly);
      m_.tendon_armature.push_back(t.armature);
      m_.tendon_margin.push_back(t.margin);
      m_.tendon_range.push_back(t.range);
      m_.tendon_lengthspring.push_back(t.springlength);
      m_.tendon_actfrclimited.push_back(t.actuator_force_limited);
      m_.tendon_actfrcrange.push_back(t.actuator_force_range);
      m_.tendon_solref_limit.push_back(t.limit.solref);
      m_.tendon_rigid.push_back(rigid(t.rigid_limit, t.place, "tendon", t.name));
      m_.tendon_solref_friction.push_back(t.friction.solref);
      m_.tendon_solimp_limit.push_back(t.limit.solimp);
      m_.tendon_solimp_friction.push_back(t.friction.solimp);
      ++m_.ntendon;
    }
  }

  void actuators() {
    for (auto const& a : d_.actuators) {
      auto const refuse = [&](std::string const& sentence) { fail(a.place, "actuator", a.name, sentence); };
      enter(Kind::actuator, a.name, m_.nu, a.place);
      require_finite(finite(a.gear) && finite(a.gainprm) && finite(a.biasprm) && finite(a.dynprm) && finite(a.ctrl_range) &&
                         finite(a.force_range) && finite(a.act_range) && finite(a.length_range) &&
                         finite(std::array{a.dampratio, a.crank_length, a.damping, a.armature}),
                     a.place, "actuator", a.name);
      require_range(*this, a.ctrl_limited, a.ctrl_range, a.place, "actuator", a.name, "ctrlrange");
      require_range(*this, a.force_limited, a.force_range, a.place, "actuator", a.name, "forcerange");
      require_range(*this, a.act_limited, a.act_range, a.place, "actuator", a.name, "actrange");
      std::vector<std::pair<Kind, std::string>> named;
      for_each_reference(a, [&](Kind kind, std::string const& name) { named.emplace_back(kind, name); });
      int const id = find(named[0].first, named[0].second, a.place, "actuator", a.name);
      int const ref = named.size() > 1 ? find(Kind::site, a.reference_name, a.place, "actuator", a.name) : -1;
      if (a.target == Transmission::slider_crank && (ref < 0 || !(a.crank_length > 0)))
        refuse("is a slider-crank without the slider's site or a positive crank length: give both");
      bool const geared = a.target == Transmission::joint || a.target == Transmission::joint_in_parent || a.target == Transmission::tendon;
      if (!geared && (a.damping != 0 || a.armature != 0)) refuse("has damping or armature, which are for joints and tendons: remove them");
      if (a.target == Transmission::body &&
          ((a.gain_type == ActuatorGain::affine && a.gainprm[2] != 0) || (a.bias_type == ActuatorBias::affine && a.biasprm[2] != 0)))
        refuse(
            "acts at the contacts of a body and depends on their velocity, which is not supported: make the third number of gainprm and "
            "biasprm 0");
      bool const stateful = a.dynamics != ActuatorDynamics::none;
      if (a.act_limited && !stateful) refuse("limits an activation but has none: set its dynamics");
      for (auto const& [type, p] :
           {std::pair{a.gain_type == ActuatorGain::muscle, &a.gainprm}, {a.bias_type == ActuatorBias::muscle, &a.biasprm}})
        if (type && (!((*p)[0] < (*p)[1]) || !((*p)[4] < 1) || !((*p)[5] > 1) || !((*p)[3] > 0) || !((*p)[6] > 0) || !((*p)[7] > 0) ||
                     !((*p)[8] > 0)))
          refuse(
              "is a muscle whose numbers do not fit (range[0] < range[1], lmin < 1 < lmax, scale, vmax, fpmax, fvmax above 0): correct "
              "them");
      m_.act_target.push_back(int(a.target));
      m_.act_id.push_back(id);
      m_.act_ref.push_back(ref);
      m_.act_name.push_back(a.name);
      m_.act_ctrllimited.push_back(a.ctrl_limited);
      m_.act_forcelimited.push_back(a.force_limited);
      m_.act_actlimited.push_back(a.act_limited);
      m_.act_actearly.push_back(a.act_early);
      m_.act_group.push_back(a.group);
      m_.act_dyntype.push_back(int(a.dynamics));
      m_.act_gaintype.push_back(int(a.gain_type));
      m_.act_biastype.push_back(int(a.bias_type));
      m_.act_actadr.push_back(stateful ? m_.na : -1);
      m_.act_actnum.push_back(stateful);
      m_.na += stateful;
      m_.act_gear.push_back(a.gear);
      m_.act_gainprm.push_back(a.gainprm);
      m_.act_biasprm.push_back(a.biasprm);
      m_.act_dynprm.push_back(a.dynprm);
      m_.act_cranklength.push_back(a.crank_length);
      m_.act_damping.push_back(a.damping);
      m_.act_armature.push_back(a.armature);
      m_.act_ctrlrange.push_back(a.ctrl_range);
      m_.act_forcerange.push_back(a.force_range);
      m_.act_actrange.push_back(a.act_range);
      auto const range = length_range(a, id);
      m_.act_lengthrange.push_back(range.value_or(std::array{0., 0.}));
      if (!range) unknown_ranges_.push_back(m_.nu);
      ++m_.nu;
    }
  }

  void equalities() {
    for (auto const& e : d_.equalities) {
      enter(Kind::equality, e.name, m_.neq, e.place);
      require_finite(finite(e.data) && finite(e.softness.solref) && finite(e.softness.solimp), e.place, "equality", e.name);
      std::vector<std::pair<Kind, std::string>> named;
      for_each_reference(e, [&](Kind kind, std::string const& name) { named.emplace_back(kind, name); });
      bool const bodies = named[0].first == Kind::body;
      int ids[2] = {-1, bodies ? 0 : -1};  // a missing body is the world
      for (std::size_t k = 0; k < named.size(); ++k) ids[k] = find(named[k].first, named[k].second, e.place, "equality", e.name);
      if (named[0].first == Kind::site && ids[1] < 0) fail(e.place, "equality", e.name, "names one site: give two");
      if (ids[0] == ids[1]) fail(e.place, "equality", e.name, "names '" + e.name1 + "' twice: name two different ones");
      if (e.type == EqualityType::joint)
        for (int j : ids)
          if (j >= 0 && m_.jnt_type[j] < int(JointType::slide))
            fail(e.place, "equality", e.name, "names a ball or free joint: only hinge and slide joints have one coordinate");
      m_.eq_type.push_back(int(e.type));
      m_.eq_id1.push_back(ids[0]);
      m_.eq_id2.push_back(ids[1]);
      m_.eq_sites.push_back(e.sites);
      m_.eq_active.push_back(e.active);
      m_.eq_data.push_back(e.data);
      m_.eq_name.push_back(e.name);
      m_.eq_solref.push_back(e.softness.solref);
      m_.eq_solimp.push_back(e.softness.solimp);
      m_.eq_rigid.push_back(rigid(e.rigid, e.place, "equality", e.name));
      ++m_.neq;
    }
  }

  void sensors() {
    for (auto const& s : d_.sensors) {
      enter(Kind::sensor, s.name, m_.nsensor, s.place);
      require_finite(std::isfinite(s.cutoff) && std::isfinite(s.noise), s.place, "sensor", s.name);
      auto const id = [&](std::string const& type, std::string const& name) {
        if (name.empty()) return -1;
        Kind const kind = kind_of(type);
        if (kind == Kind::none)
          fail(s.place, "sensor", s.name,
               "is about a '" + type + "', which is not supported: name a body, geom, site, camera, joint, tendon or actuator");
        return find(kind, name, s.place, "sensor", s.name);
      };
      m_.sensor_id.push_back(id(s.object_type, s.object));
      m_.sensor_refid.push_back(id(s.reference_type, s.reference));
      SensorInfo const* const info = find_sensor_type(s.type);
      if (!info) fail(s.place, "sensor", s.name, "has the type '" + s.type + "', which is not one of MJCF's: correct it, or use 'user'");
      check_sensor(s, *info, m_.sensor_id.back(), m_.sensor_refid.back());
      int const dim = info->size > 0 ? info->size : sensor_size(s, info->type);
      m_.sensor_dim.push_back(dim);
      m_.sensor_adr.push_back(m_.nsensordata);
      m_.nsensordata += std::max(dim, 0);
      m_.sensors.push_back(s);
      ++m_.nsensor;
    }
  }

 private:
  // What a sensor's type can be about.
  void check_sensor(SensorDescription const& s, SensorInfo const& info, int object, int reference) {
    using O = SensorObject;
    auto const require = [&](bool good, std::string const& sentence) {
      if (!good) fail(s.place, "sensor", s.name, "of type '" + s.type + "' " + sentence);
    };
    require(s.cutoff >= 0 && s.noise >= 0, "has a negative cutoff or noise: give 0 or more");
    require(s.cutoff == 0 || info.cutoff != SensorCutoff::refused, "gives a direction or a rotation, which has no cutoff: leave it out");
    require(info.type != SensorType::rangefinder || reference < 0, "is about a site or a camera, not both: name one");
    auto const history = history_settings(s);
    require(history.fault.empty(), history.fault);
    auto const word = info.about == O::joint || info.about == O::ball        ? "joint"
                      : info.about == O::tendon                              ? "tendon"
                      : info.about == O::actuator                            ? "actuator"
                      : info.about == O::body                                ? "body"
                      : info.about == O::site || info.about == O::projection ? "site"
                                                                             : "";
    if (*word) require(object >= 0 && kind_of(s.object_type) == kind_of(word), std::string("is about a ") + word + ": name one");
    bool const of_limit = info.stage == SensorStage::constraint;  // balls have limits too
    if (info.about == O::joint && !(of_limit && JointType(m_.jnt_type[object]) == JointType::ball))
      require(JointType(m_.jnt_type[object]) >= JointType::slide, "is about a hinge or slide joint: name one");
    if (info.about == O::ball) require(JointType(m_.jnt_type[object]) == JointType::ball, "is about a ball joint: name one");
    bool const limit = info.stage == SensorStage::constraint;
    if (limit && info.about == O::joint) require(m_.jnt_limited[object], "is about the limits of a joint that has none: give it a range");
    if (limit && info.about == O::tendon)
      require(m_.tendon_limited[object], "is about the limits of a tendon that has none: give it a range");
    if (info.about == O::projection) require(reference >= 0 && kind_of(s.reference_type) == Kind::camera, "needs a camera: name one");
    auto const framed = [](std::string const& type) {
      Kind const kind = type == "subtree" ? Kind::none : kind_of(type);
      return kind == Kind::body || kind == Kind::geom || kind == Kind::site || kind == Kind::camera;
    };
    if (info.about == O::frame) {
      require(object >= 0 && framed(s.object_type), "is about a body, geom, site or camera: name one");
      require(reference < 0 || framed(s.reference_type), "is seen from a body, geom, site or camera: name one, or none");
    }
    if (info.about == O::pair) require(object >= 0 && reference >= 0, "needs two objects: name both");
    if (info.type == SensorType::inside_site)
      require(framed(s.object_type) && s.reference_type == "site", "is about a body, geom, site or camera, and a site: name them");
    if (info.stage == SensorStage::shape) {
      Kind const kinds[2] = {kind_of(s.object_type), kind_of(s.reference_type)};
      int const ids[2] = {object, reference};
      for (int k = 0; k < 2; ++k) {
        require(kinds[k] == Kind::geom || kinds[k] == Kind::body, "is about geoms or bodies: name two of them");
        require(kinds[k] != Kind::geom || ShapeType(m_.geom_type[ids[k]]) != ShapeType::hfield,
                "names the height field '" + (k == 0 ? s.object : s.reference) + "', which has no distance: name another geom");
      }
      for (int k = 0; k < 2; ++k) {
        bool has_field = false;
        for (int g = 0; kinds[k] == Kind::body && g < m_.body_geomnum[ids[k]]; ++g)
          has_field = has_field || ShapeType(m_.geom_type[m_.body_geomadr[ids[k]] + g]) == ShapeType::hfield;
        if (has_field)
          note(s.place, ReportLine::Kind::no_effect,
               "sensor '" + s.name + "' of type '" + s.type + "': body '" + (k == 0 ? s.object : s.reference) +
                   "' has a height field, which has no distance, and nothing is computed; name geoms");
      }
      require(kinds[0] != kinds[1] || object != reference, "names '" + s.object + "' twice: name two different ones");
    }
  }
  // A spatial tendon's path: geoms between two sites, branches that begin with a pulley.
  void path(TendonDescription const& t, std::vector<int>& bodies) {
    auto const refuse = [&](std::size_t at, std::string const& sentence) {
      fail(t.place, "tendon", t.name, sentence + " (item " + std::to_string(at + 1) + " of its path)");
    };
    m_.tendon_wrapadr.push_back(int(m_.wrap_type.size()));
    m_.tendon_wrapnum.push_back(int(t.path.size()));
    if (t.path.size() == 1) fail(t.place, "tendon", t.name, "has a path of one item: give at least two sites");
    auto const type = [&](std::size_t i) {
      return i < t.path.size() ? t.path[i].type : WrapType::pulley;
    };  // behind both ends: as a pulley
    for (std::size_t i = 0; i < t.path.size(); ++i) {
      auto const& item = t.path[i];
      WrapType kind = item.type;
      int id = -1, side = -1;
      double divisor = 1;
      if (kind == WrapType::pulley) {
        divisor = item.divisor;
        if (!(divisor > 0) || !std::isfinite(divisor)) refuse(i, "has a pulley whose divisor is not positive: correct it");
        if (i + 1 == t.path.size() || t.path[i + 1].type == WrapType::pulley)
          refuse(i, "has a pulley without a branch behind it: remove it");
      } else if (kind == WrapType::site) {
        id = find(Kind::site, item.name, t.place, "tendon", t.name);
        if (type(i - 1) == WrapType::pulley && type(i + 1) == WrapType::pulley) refuse(i, "has a branch of one site: give two");
        if (type(i + 1) == WrapType::site && t.path[i + 1].name == item.name) refuse(i, "names a site twice in a row: remove one");
        bodies.push_back(m_.site_body[id]);
      } else {
        id = find(Kind::geom, item.name, t.place, "tendon", t.name);
        if (type(i - 1) != WrapType::site || type(i + 1) != WrapType::site)
          refuse(i, "has a geom that does not stand between two sites: add them");
        bool const sphere = m_.geom_type[id] == int(ShapeType::sphere);
        if (!sphere && m_.geom_type[id] != int(ShapeType::cylinder))
          refuse(i, "goes round a geom that is neither sphere nor cylinder: use one");
        if (t.armature > 0) refuse(i, "goes round a geom and has armature, which MuJoCo does not define: remove one of the two");
        kind = sphere ? WrapType::sphere : WrapType::cylinder;
        if (!item.sidesite.empty()) side = find(Kind::site, item.sidesite, t.place, "tendon", t.name);
        bodies.push_back(m_.geom_body[id]);
      }
      m_.wrap_type.push_back(int(kind));
      m_.wrap_id.push_back(id);
      m_.wrap_side.push_back(side);
      m_.wrap_divisor.push_back(divisor);
    }
  }

  // The range of an actuator's length: given, or the limits of what it drives; nothing where a simulation has to find it.
  std::optional<std::array<double, 2>> length_range(ActuatorDescription const& a, int id) const {
    auto const& c = d_.compiler.length_range;
    bool const muscle = a.gain_type == ActuatorGain::muscle || a.bias_type == ActuatorBias::muscle;
    if (c.mode == LengthRangeMode::none || (c.mode != LengthRangeMode::all && !muscle)) return a.length_range;
    if (c.use_existing && a.length_range[0] < a.length_range[1]) return a.length_range;
    if (c.use_limit) {
      bool const joint = a.target == Transmission::joint || a.target == Transmission::joint_in_parent;
      if (joint && m_.jnt_limited[id]) return m_.jnt_range[id];
      if (a.target == Transmission::tendon && m_.tendon_limited[id]) return m_.tendon_range[id];
    }
    return std::nullopt;
  }

  // How many numbers a sensor gives whose settings say it; -1 where that is not known here.
  int sensor_size(SensorDescription const& s, SensorType type) const {
    auto const setting = [&](std::string_view name) -> std::string {
      for (auto const& [key, value] : s.settings)
        if (key == name) return value;
      return "";
    };
    if (type == SensorType::contact) {
      ContactSensorSettings const settings = contact_settings(s);
      if (!settings.fault.empty()) fail(s.place, "sensor", s.name, "of type 'contact' " + settings.fault);
      return no_more_than_there_may_be(s, double(settings.slots) * settings.size(), "ask for fewer slots");
    }
    if (type == SensorType::rangefinder) {
      RangeSensorSettings const settings = range_settings(s);
      if (!settings.fault.empty()) fail(s.place, "sensor", s.name, "of type 'rangefinder' " + settings.fault);
      if (s.object_type != "camera") return settings.size();
      auto const& picture = m_.cam_resolution[m_.sensor_id.back()];
      return no_more_than_there_may_be(s, settings.size() * picture[0] * picture[1], "lower the resolution of its camera");
    }
    if (type == SensorType::tactile) return 3 * int(m_.mesh_vertices[m_.sensor_id.back()].size());
    std::string const text = setting("dim"), datatype = setting("datatype");
    if (text.empty()) return -1;
    int const dim = read_whole(text).value_or(-1);
    if (dim < 0) fail(s.place, "sensor", s.name, "has dim '" + text + "', which must be a whole number, 0 or more");
    if ((datatype == "axis" && dim != 3) || (datatype == "quaternion" && dim != 4))
      fail(s.place, "sensor", s.name, "of datatype '" + datatype + "' has dim " + text + ": an axis has 3 numbers, a quaternion 4");
    return no_more_than_there_may_be(s, dim, "lower its dim");
  }
  int no_more_than_there_may_be(SensorDescription const& s, double numbers, char const* remedy) const {
    if (!(m_.nsensordata + numbers < 1e9))
      fail(s.place, "sensor", s.name, "makes 1e9 numbers or more of all sensors: " + std::string(remedy));
    return int(numbers);
  }
};

}  // namespace gsp::detail
