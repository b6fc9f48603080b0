#pragma once
#include <array>
#include <cmath>
#include <cstdio>
#include <gsp/io/detail/load_report.hpp>
#include <gsp/io/detail/mjcf_draft.hpp>
#include <gsp/io/detail/mjcf_schema.hpp>
#include <gsp/io/detail/mjcf_values.hpp>
#include <gsp/io/detail/mjcf_xml.hpp>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <tuple>
#include <unordered_map>
#include <utility>
#include <vector>

namespace gsp::io::detail::mjcf {

using gsp::detail::axis_angle;
using gsp::detail::cross;
using gsp::detail::dot;
using gsp::detail::norm;
using gsp::detail::normalized;
using gsp::detail::Pose;
using gsp::detail::quat_of_axes;
using gsp::detail::times;
using gsp::detail::operator+;
using gsp::detail::operator-;
using gsp::detail::operator*;

/// What all files of one reading share.
struct Session {
  Files files;
  Report report;
  bool skip_visuals = false, list_refusals = false;
  int next_id = 0, depth = 0;
  std::size_t items = 0;
};

/// Reads one MJCF document into a ModelDraft. Sections are read in MuJoCo's order: settings, classes and assets first, then the lists that
/// refer to bodies by name, the bodies last, because replicating and attaching copy entries of those lists.
class Reader {
 public:
  Reader(Session& session, int file) : s_(session), file_(file) {}

  ModelDraft read(Node const& root) {
    if (root.name != "mujoco") s_.files.fail(root.place, "the root element is " + in_quotes(root.name) + "; an MJCF model is <mujoco>");
    check(root);
    if (auto const* name = root.find("model")) draft_.name = *name;
    auto const each = [&](char const* section, auto const& f) {
      for (auto const& node : root.children)
        if (node.name == section) f(node);
    };
    classes_[""];
    each("compiler", [&](Node const& n) { compiler(n); });
    each("option", [&](Node const& n) { option(n); });
    for (char const* section : {"size", "statistic", "visual", "custom"}) each(section, [&](Node const& n) { check_all(n); });
    each("extension", [&](Node const& n) { refuse(n.place, "<extension>: plug-ins are not supported; remove them"); });
    each("deformable", [&](Node const& n) { refuse(n.place, "<deformable>: flexes and skins are not supported; remove them"); });
    each("default", [&](Node const& n) { defaults(n, ""); });
    each("asset", [&](Node const& n) { assets(n); });
    each("contact", [&](Node const& n) { contacts(n); });
    each("equality", [&](Node const& n) {
      for (auto const& child : n.children)
        refuse(child.place, "<equality> <" + child.name + ">: equality constraints are not supported yet; remove it");
    });
    each("tendon", [&](Node const& n) { tendons(n); });
    each("actuator", [&](Node const& n) { actuators(n); });
    each("sensor", [&](Node const& n) { sensors(n); });
    each("keyframe", [&](Node const& n) { keyframes(n); });
    each("worldbody", [&](Node const& n) {
      check(n);
      contents(n, draft_.world, Pose{}, "");
    });
    return std::move(draft_);
  }

 private:
  using Kind = ReportLine::Kind;

  // ---- strictness

  void note(Kind kind, Place const& place, std::string const& text) {
    s_.report.add(kind, s_.files.names[std::size_t(place.file)], place.line, text);
  }
  void refuse(Place const& place, std::string const& sentence) {
    if (!s_.list_refusals) s_.files.fail(place, sentence);
    note(Kind::refused, place, sentence);
  }
  // Attributes and children of `node` against the schema of `element`; true where nothing is refused.
  bool check(Node const& node, std::string_view element) {
    auto const* e = find_schema(element);
    if (!e) s_.files.fail(node.place, "unknown element <" + node.name + ">; correct or remove it");
    bool good = true;
    for (auto const& a : node.attributes) {
      std::string const what = "<" + node.name + "> " + a.name;
      if (is_in(e->honoured, a.name)) continue;
      if (is_in(e->visual, a.name))
        note(Kind::visual_only, node.place, what);
      else if (is_in(e->no_effect, a.name))
        note(Kind::no_effect, node.place, what);
      else if (is_in(e->refused, a.name)) {
        if (is_neutral(a.value)) continue;
        refuse(node.place, what + "=" + in_quotes(a.value) + " is not supported yet; remove the attribute"), good = false;
      } else {
        s_.files.fail(node.place, "unknown attribute " + in_quotes(a.name) + " of <" + node.name + ">; correct or remove it");
      }
    }
    for (auto const& child : node.children)
      if (!is_in(e->children, child.name))
        s_.files.fail(child.place, "unknown element " + in_quotes(child.name) + " in <" + node.name + ">; correct or remove it");
    return good;
  }
  bool check(Node const& node) { return check(node, node.name); }
  void check_all(Node const& node) {
    check(node);
    for (auto const& child : node.children) check_all(child);
  }
  void count(std::size_t n, Place const& place) {
    if ((s_.items += n) > 200'000) s_.files.fail(place, "the model has more than 200,000 bodies, joints, geoms and sites; replicate less");
  }

  // ---- settings

  void compiler(Node const& node) {
    check(node);
    for (auto const& child : node.children) check(child);
    Attributes const a(s_.files, node, nullptr);
    auto& c = draft_.compiler;
    if (a.has("angle")) degrees_ = a.choice("angle", {"radian", "degree"}) == 1;
    if (a.has("coordinate")) a.choice("coordinate", {"local"});
    a.boolean("autolimits", autolimits_), a.boolean("balanceinertia", c.balanceinertia);
    a.number("boundmass", c.boundmass), a.number("boundinertia", c.boundinertia), a.number("settotalmass", c.settotalmass);
    if (a.has("inertiafromgeom")) {
      int const mode = a.choice("inertiafromgeom", {"false", "true", "auto"});
      c.inertia_from_geom_never = mode == 0, c.inertia_from_geom_always = mode == 1;
    }
    std::array<double, 2> range{0, 5};
    if (a.numbers("inertiagrouprange", range))
      c.inertia_group_range = {static_cast<int>(std::clamp(range[0], -1e6, 1e6)), static_cast<int>(std::clamp(range[1], -1e6, 1e6))};
    if (a.has("eulerseq")) {
      eulerseq_ = a.text("eulerseq");
      if (eulerseq_.size() != 3 || eulerseq_.find_first_not_of("xyzXYZ") != std::string::npos)
        a.fail("eulerseq", "is " + in_quotes(eulerseq_) + "; give three of x y z X Y Z");
    }
  }

  void option(Node const& node) {
    check(node);
    has_option_ = true;
    Attributes const a(s_.files, node, nullptr);
    auto& o = draft_.option;
    a.number("timestep", o.timestep), a.numbers("gravity", o.gravity), a.number("impratio", o.impratio), a.number("tolerance", o.tolerance);
    a.integer("iterations", o.iterations);
    if (!(o.timestep > 0)) a.fail("timestep", "is not positive; give seconds, such as 0.002");
    if (!(o.impratio > 0)) a.fail("impratio", "is not positive; give one or more");
    if (a.has("integrator")) o.integrator = static_cast<Integrator>(a.choice("integrator", {"Euler", "RK4", "implicit", "implicitfast"}));
    if (a.has("cone")) o.cone = static_cast<Cone>(a.choice("cone", {"pyramidal", "elliptic"}));
    for (char const* name : {"integrator", "cone", "impratio"})
      if (a.has(name)) note(Kind::no_effect, node.place, std::string("<option> ") + name + " (in profile stable)");
    for (auto const& flag : node.children) {
      check(flag);
      Attributes const f(s_.files, flag, nullptr);
      for (auto const& one : flag.attributes) {
        bool const on = f.choice(one.name, {"disable", "enable"}) == 1;
        std::pair<char const*, bool*> const flags[] = {{"actuation", &o.actuation},       {"clampctrl", &o.clampctrl},
                                                       {"constraint", &o.constraint},     {"contact", &o.contact},
                                                       {"damper", &o.passive_damper},     {"eulerdamp", &o.eulerdamp},
                                                       {"filterparent", &o.filterparent}, {"frictionloss", &o.frictionloss},
                                                       {"gravity", &o.gravity_on},        {"limit", &o.limit},
                                                       {"refsafe", &o.refsafe},           {"spring", &o.passive_spring},
                                                       {"warmstart", &o.warmstart}};
        for (auto const& [name, value] : flags)
          if (one.name == name) *value = on;
      }
    }
  }

  // ---- default classes: element -> attribute -> value, a copy of the parent's at that point with the class's own over it

  // What an actuator's elements say together: force = gain ctrl + bias0 + bias1 length + bias2 velocity. A positive bias2 with gain =
  // -bias1 is a damping ratio.
  struct Law {
    std::array<double, 10> gain{1}, bias{};
    std::string gaintype = "fixed", biastype = "none", dyntype = "none";
    std::string type;  // the last of motor, position, velocity; nothing after general
    double inheritrange = 0;
  };
  struct Class {
    std::map<std::string, Values, std::less<>> values;
    std::vector<Law> laws{Law{}};  // of actuators: the class's own last, before it its parent's, and so on
  };
  static bool is_actuator(std::string_view e) {
    return is_in("general motor position velocity intvelocity orientation pid damper cylinder muscle adhesion dcmotor", e);
  }

  void defaults(Node const& node, std::string const& parent) {
    check(node);
    bool const top = parent.empty() && !in_default_;
    auto const* given = node.find("class");
    std::string const name = top ? "" : given ? *given : "";
    if (!top && name.empty()) s_.files.fail(node.place, "a <default> inside another needs a class; name it");
    if (top && given) main_name_ = *given;
    if (!top && classes_.count(name))
      s_.files.fail(node.place, "default class " + in_quotes(name) + " exists already; rename one of the two");
    if (!top) {
      Class next = classes_.at(parent);
      next.laws.push_back(next.laws.back());
      classes_.emplace(name, std::move(next));
    }
    for (auto const& child : node.children) {
      if (child.name == "default") continue;
      bool const supported = find_schema(child.name) || child.name == "tendon";
      if (!supported || child.name == "pair" || child.name == "equality") {  // matters only to elements that are refused themselves
        note(Kind::no_effect, child.place, "<default> <" + child.name + ">");
        continue;
      }
      bool const actuator = is_actuator(child.name);
      if (child.name == "tendon")
        check(child, "fixed");
      else
        check(child);
      auto& own = classes_.at(name);
      for (auto const& a : child.attributes) {
        auto& values = own.values[actuator ? "actuator" : child.name];
        auto const old = values.find(a.name);
        values.insert_or_assign(a.name, Value{old == values.end() ? a.value : merged(a.name, old->second.text, a.value), child.place});
      }
      if (actuator) own.laws.back() = changed(own.laws, child);
    }
    in_default_ = true;
    for (auto const& child : node.children)
      if (child.name == "default") defaults(child, name);
    if (top) in_default_ = false;
  }
  Class const& class_of(Node const& node, std::string const& childclass) const {
    auto const* own = node.find("class");
    std::string const& name = own ? *own : childclass;
    auto const found = classes_.find(name == main_name_ ? "" : name);
    if (found == classes_.end()) s_.files.fail(node.place, "default class " + in_quotes(name) + " does not exist; correct the name");
    return found->second;
  }
  Attributes attributes(Node const& node, std::string_view element, std::string const& childclass) const {
    auto const& c = class_of(node, childclass);
    auto const found = c.values.find(element);
    return {s_.files, node, found == c.values.end() ? nullptr : &found->second};
  }

  // ---- assets

  void assets(Node const& node) {
    check(node);
    for (auto const& child : node.children) {
      if (child.name == "skin") {
        refuse(child.place, "<skin>: skins are not supported; remove it");
        continue;
      }
      if (child.name == "texture") {
        check(child);
      } else if (child.name == "mesh") {
        check(child);
        note(Kind::left_out, child.place, "<mesh>: not read");
      } else if (child.name == "hfield") {
        check(child);
        note(Kind::left_out, child.place, "<hfield>: not read");
      } else if (child.name == "material") {
        check_all(child);
        auto const a = attributes(child, "material", "");
        std::array<double, 4> rgba{1, 1, 1, 1};
        a.numbers("rgba", rgba);
        materials_[a.text("name")] = {float(rgba[0]), float(rgba[1]), float(rgba[2]), float(rgba[3])};
      } else if (child.name == "model") {
        check(child);
        Attributes const a(s_.files, child, nullptr);
        std::string const file = a.text("file");
        if (file.empty()) a.fail("file", "is missing; name the model's file");
        std::string name = a.text("name");
        if (name.empty()) name = name_of_model(child);
        if (!models_.emplace(name, child).second)
          a.fail("name", "is " + in_quotes(name) + ", which another <model> has; rename one of the two");
      }
    }
  }

  // ---- bodies

  double angle(double x) const { return degrees_ ? x * (3.14159265358979323846 / 180) : x; }
  static Double3 unit(Attributes const& a, std::string_view name, Double3 const& v) {
    double const n = norm(v);
    if (!(n > 1e-14)) a.fail(name, "is a direction of length zero; give a direction");
    return (1 / n) * v;
  }
  // Rotation by Euler angles: lower case letters turn about the moving axes, upper case about the fixed ones.
  Double4 euler(Double3 const& angles) const {
    Double4 q{1, 0, 0, 0};
    for (std::size_t k = 0; k < 3; ++k) {
      char const c = eulerseq_[k];
      bool const moving = c >= 'x';
      Double3 axis{0, 0, 0};
      axis[std::size_t(c - (moving ? 'x' : 'X'))] = 1;
      auto const turn = axis_angle(axis, angle(angles[k]));
      q = moving ? times(q, turn) : times(turn, q);
    }
    return q;
  }
  // The smallest rotation that takes z to v: about z x v, by atan2(|z x v|, v_z); about x where v points down.
  static Double4 quat_of_z(Double3 const& v) {
    Double3 const axis = cross({0, 0, 1}, v);
    double const s = norm(axis);
    return s < 1e-10 ? axis_angle({1, 0, 0}, std::atan2(s, v[2])) : axis_angle((1 / s) * axis, std::atan2(s, v[2]));
  }
  Double4 orientation(Attributes const& a, Double4 fallback = {1, 0, 0, 0}) const {
    char const* const ways[] = {"axisangle", "euler", "xyaxes", "zaxis", "quat"};
    std::string_view chosen;
    int own = 0;
    for (char const* way : ways)
      if (a.own(way)) chosen = way, ++own;
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
      return axis_angle(unit(a, "axisangle", {v[0], v[1], v[2]}), angle(v[3]));
    }
    if (chosen == "euler") {
      Double3 v{};
      a.numbers("euler", v);
      return euler(v);
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
    a.numbers("quat", fallback);
    if (!(std::abs(fallback[0]) + std::abs(fallback[1]) + std::abs(fallback[2]) + std::abs(fallback[3]) > 1e-14))
      a.fail("quat", "has length zero; give a rotation");
    return normalized(fallback);
  }

  // Everything that may stand in a body, a frame or a replicate, into `to`.
  void contents(Node const& node, BodyDraft& to, Pose const& frame, std::string const& childclass) {
    for (auto const& child : node.children) {
      if (child.name == "body")
        body(child, to, frame, childclass);
      else if (child.name == "joint" || child.name == "freejoint")
        joint(child, to, frame, childclass);
      else if (child.name == "geom")
        geom(child, to, frame, childclass);
      else if (child.name == "site")
        site(child, to, frame, childclass);
      else if (child.name == "camera")
        camera(child, to, frame, childclass);
      else if (child.name == "light")
        check(child), note(Kind::visual_only, child.place, "<light>");
      else if (child.name == "inertial")
        inertial(child, to);
      else if (child.name == "frame") {
        check(child);
        Attributes const a(s_.files, child, nullptr);
        Pose pose;
        a.numbers("pos", pose.p);
        pose.q = orientation(a);
        contents(child, to, frame * pose, a.text("childclass", childclass));
      } else if (child.name == "replicate")
        replicate(child, to, frame, childclass);
      else if (child.name == "attach")
        attach(child, to, frame);
      else
        refuse(child.place, "<" + child.name + "> is not supported; remove it");
    }
  }

  void body(Node const& node, BodyDraft& parent, Pose const& frame, std::string const& childclass) {
    check(node);
    count(1, node.place);
    Attributes const a(s_.files, node, nullptr);
    BodyDraft draft;
    auto& b = draft.body;
    b.place = node.place, b.name = a.text("name");
    Pose pose;
    a.numbers("pos", pose.p);
    pose.q = orientation(a);
    pose = frame * pose;
    b.pos = pose.p, b.quat = normalized(pose.q);
    a.number("gravcomp", b.gravcomp), a.boolean("mocap", b.mocap);
    if (b.name == "world") a.fail("name", "is 'world', which the root has; choose another");
    std::string const next = a.text("childclass", childclass);
    if (a.has("childclass") && !classes_.count(next == main_name_ ? "" : next))
      a.fail("childclass", "names the class " + in_quotes(next) + ", which does not exist; correct the name");
    contents(node, draft, Pose{}, next);
    parent.children.push_back(std::move(draft));
  }

  void inertial(Node const& node, BodyDraft& to) {
    check(node);
    Attributes const a(s_.files, node, nullptr);
    if (to.body.has_inertial) a.fail("", "is the second of its body; keep one");
    auto& i = to.body.inertial;
    to.body.has_inertial = true;
    if (!a.numbers("pos", i.pos)) a.fail("pos", "is missing; give the centre of mass");
    if (!a.number("mass", i.mass)) a.fail("mass", "is missing; give the mass");
    i.quat = orientation(a);
    Double3 diagonal{};
    bool const simple = a.numbers("diaginertia", diagonal), full = a.numbers("fullinertia", i.inertia);
    if (simple && full) a.fail("fullinertia", "stands beside diaginertia; keep one");
    if (full && (a.has("quat") || a.has("axisangle") || a.has("euler") || a.has("xyaxes") || a.has("zaxis")))
      a.fail("fullinertia", "stands beside an orientation; remove one of the two");
    if (!full) i.inertia = {diagonal[0], diagonal[1], diagonal[2], 0, 0, 0};
  }

  void softness(Attributes const& a, SoftnessDescription& s, std::string const& suffix) const {
    a.numbers("solref" + suffix, s.solref, false), a.numbers("solimp" + suffix, s.solimp, false);
  }
  // One number of a list whose further ones are coefficients of higher order.
  void linear(Attributes const& a, char const* name, double& out) {
    std::array<double, 3> v{out, 0, 0};
    a.numbers(name, v, false);
    out = v[0];
    if (v[1] != 0 || v[2] != 0)
      refuse(a.place(),
             std::string("attribute '") + name + "' has coefficients of higher order, which are not supported yet; give one number");
  }
  // limited="auto" follows from the range, if the compiler allows.
  bool limited(Attributes const& a, char const* flag, char const* range, std::array<double, 2> const& value) const {
    int const given = a.has(flag) ? a.choice(flag, {"false", "true", "auto"}) : 2;
    if (given != 2) return given == 1;
    if (!autolimits_ && a.has(range))
      a.fail(range, std::string("is given without ") + flag + " while compiler autolimits is false; give it");
    if (value[0] > value[1] || (a.own(range) && value[0] == value[1] && value[0] != 0))
      a.fail(range, "is not in increasing order; exchange its numbers");
    return value[0] < value[1];
  }

  void joint(Node const& node, BodyDraft& to, Pose const& frame, std::string const& childclass) {
    check(node);
    count(1, node.place);
    bool const freejoint = node.name == "freejoint";
    JointDescription j;
    j.place = node.place;
    auto const a = freejoint ? Attributes(s_.files, node, nullptr) : attributes(node, "joint", childclass);
    j.name = a.own("name") ? a.text("name") : "";
    a.integer("group", j.group);
    if (freejoint) {
      j.type = JointType::free;
    } else {
      if (a.has("type")) j.type = static_cast<JointType>(a.choice("type", {"free", "ball", "slide", "hinge"}));
      a.numbers("pos", j.pos), a.numbers("axis", j.axis), a.numbers("range", j.range);
      j.limited = limited(a, "limited", "range", j.range) && j.type != JointType::free;
      a.numbers("actuatorfrcrange", j.actuator_force_range);
      j.actuator_force_limited = limited(a, "actuatorfrclimited", "actuatorfrcrange", j.actuator_force_range) && j.type >= JointType::slide;
      a.number("ref", j.ref), a.number("springref", j.springref), a.number("armature", j.armature),
          a.number("frictionloss", j.frictionloss), a.number("margin", j.margin);
      linear(a, "stiffness", j.stiffness), linear(a, "damping", j.damping);
      a.numbers("springdamper", j.springdamper);
      softness(a, j.limit, "limit"), softness(a, j.friction, "friction");
      if (j.limited && j.type != JointType::slide) j.range = {angle(j.range[0]), angle(j.range[1])};
      if (j.type == JointType::hinge) j.ref = angle(j.ref), j.springref = angle(j.springref);
    }
    j.pos = frame * j.pos, j.axis = gsp::detail::rotate(frame.q, j.axis);
    to.body.joints.push_back(std::move(j)), to.joint_ids.push_back(s_.next_id++);
  }

  // pos, quat and half length of a shape between two points: local z points from the second to the first.
  bool fromto(Attributes const& a, ShapeType type, Pose& pose, Double3& size) const {
    std::array<double, 6> v{};
    if (!a.numbers("fromto", v)) return false;
    if (type != ShapeType::capsule && type != ShapeType::cylinder && type != ShapeType::box && type != ShapeType::ellipsoid)
      a.fail("fromto", "is for capsule, cylinder, box and ellipsoid; give pos and size");
    Double3 const from{v[0], v[1], v[2]}, to{v[3], v[4], v[5]}, along = from - to;
    double const length = norm(along);
    if (!(length > 1e-14)) a.fail("fromto", "has two equal points; move one");
    pose = {0.5 * (from + to), quat_of_z((1 / length) * along)};
    if (type == ShapeType::capsule || type == ShapeType::cylinder)
      size[1] = length / 2;
    else
      size[2] = length / 2, size[1] = size[0];
    return true;
  }
  static ShapeType shape(Attributes const& a, ShapeType fallback) {
    if (!a.has("type")) return fallback;
    int const k = a.choice("type", {"plane", "hfield", "sphere", "capsule", "ellipsoid", "cylinder", "box", "mesh", "sdf"});
    return k == 8 ? ShapeType::mesh : static_cast<ShapeType>(k);
  }

  void geom(Node const& node, BodyDraft& to, Pose const& frame, std::string const& childclass) {
    check(node);
    count(1, node.place);
    auto const a = attributes(node, "geom", childclass);
    GeomDescription g;
    g.place = node.place, g.name = a.own("name") ? a.text("name") : "";
    g.type = shape(a, ShapeType::sphere);
    a.integer("contype", g.contype), a.integer("conaffinity", g.conaffinity), a.integer("condim", g.condim),
        a.integer("priority", g.priority), a.integer("group", g.group);
    a.numbers("size", g.size, false), a.numbers("friction", g.friction, false);
    a.number("solmix", g.solmix), a.number("margin", g.margin), a.number("gap", g.gap), a.number("density", g.density);
    g.has_mass = a.number("mass", g.mass);
    a.boolean("shellinertia", g.shell_inertia);
    softness(a, g.softness, "");
    std::array<double, 4> rgba{0.5, 0.5, 0.5, 1};
    bool const colour = a.numbers("rgba", rgba);
    g.rgba = {float(rgba[0]), float(rgba[1]), float(rgba[2]), float(rgba[3])};
    if (a.has("material")) {
      auto const found = materials_.find(a.text("material"));
      if (found == materials_.end()) a.fail("material", "is " + in_quotes(a.text("material")) + ", which does not exist; correct the name");
      if (!colour) g.rgba = found->second;
    }
    bool const shaped_by_file = g.type == ShapeType::mesh || g.type == ShapeType::hfield || a.has("mesh") || a.has("hfield");
    if (shaped_by_file) {
      without_mesh(node, g, to);
      return;
    }
    Pose pose;
    if (!fromto(a, g.type, pose, g.size)) {
      a.numbers("pos", pose.p);
      pose.q = orientation(a);
    }
    pose = frame * pose;
    g.pos = pose.p, g.quat = normalized(pose.q);
    to.body.geoms.push_back(std::move(g));
  }
  // Geoms whose shape comes from a file: visual ones may be left out where their body does not take its inertia from them.
  void without_mesh(Node const& node, GeomDescription const& g, BodyDraft& to) {
    std::string const name = g.name.empty() ? "" : " " + in_quotes(g.name);
    if (!g.visual()) {
      refuse(
          node.place,
          "geom" + name + " collides with a mesh or height field, which is not supported yet; use plane, sphere, capsule, cylinder or box");
    } else if (!s_.skip_visuals) {
      refuse(node.place, "visual mesh geoms are not drawn yet; leave them out with --skip-visuals");
    } else {
      auto const& c = draft_.compiler;
      bool const weighs =
          (g.has_mass ? g.mass > 0 : g.density > 0) && g.group >= c.inertia_group_range[0] && g.group <= c.inertia_group_range[1];
      if (weighs) to.needs_mesh = node.place;
      note(Kind::left_out, node.place, "visual mesh geoms (--skip-visuals)");
    }
  }

  void site(Node const& node, BodyDraft& to, Pose const& frame, std::string const& childclass) {
    check(node);
    count(1, node.place);
    auto const a = attributes(node, "site", childclass);
    SiteDescription s;
    s.place = node.place, s.name = a.own("name") ? a.text("name") : "";
    s.type = shape(a, ShapeType::sphere);
    a.numbers("size", s.size, false), a.integer("group", s.group);
    Pose pose;
    if (!fromto(a, s.type, pose, s.size)) {
      a.numbers("pos", pose.p);
      pose.q = orientation(a);
    }
    pose = frame * pose;
    s.pos = pose.p, s.quat = normalized(pose.q);
    to.body.sites.push_back(std::move(s));
  }

  void camera(Node const& node, BodyDraft& to, Pose const& frame, std::string const& childclass) {
    check(node);
    count(1, node.place);
    auto const a = attributes(node, "camera", childclass);
    CameraDescription c;
    c.place = node.place, c.name = a.own("name") ? a.text("name") : "";
    double fovy = 45;
    a.number("fovy", fovy);
    c.fovy = fovy * (3.14159265358979323846 / 180);
    if (a.has("mode") && a.choice("mode", {"fixed", "track", "trackcom", "targetbody", "targetbodycom"}) != 0)
      note(Kind::approximated, node.place, "<camera> mode: cameras are fixed to their body");
    Pose pose;
    a.numbers("pos", pose.p);
    pose.q = orientation(a);
    pose = frame * pose;
    c.pos = pose.p, c.quat = normalized(pose.q);
    to.body.cameras.push_back(std::move(c));
  }

  // Copies of the contents: copy i is turned by i times the Euler angles, and stands one offset from the copy before, in that one's frame.
  // Names get a number.
  void replicate(Node const& node, BodyDraft& to, Pose const& frame, std::string const& childclass) {
    check(node);
    Attributes const a(s_.files, node, nullptr);
    int copies = 0;
    if (!a.integer("count", copies) || copies < 1) a.fail("count", "is missing or below 1; give the number of copies");
    if (copies > 1'000'000) a.fail("count", "is above a million; give less");
    Pose pose;
    Double3 offset{}, angles{};
    a.numbers("offset", offset), a.numbers("euler", angles);
    BodyDraft original;
    contents(node, original, Pose{}, a.text("childclass", childclass));
    Names names;
    collect_names(original, names, false);
    auto const lists = split_lists(names);
    std::size_t const size = size_of(original), width = std::to_string(copies).size();
    for (int i = 0; i < copies; ++i) {
      std::string number = std::to_string(i);
      number.insert(0, width - std::min(width, number.size()), '0');
      Rename const rename{"", a.text("sep") + number};
      BodyDraft copy = original;
      if (i > 0) count(size, node.place), renumber(copy);
      rename(copy);
      merge(std::move(copy), frame * pose, to);
      append(lists, names, rename, i > 0);
      pose = {pose * offset, euler(double(i + 1) * angles)};
    }
  }

  // A body of another model, or all of its world, with what refers to nothing else of it.
  void attach(Node const& node, BodyDraft& to, Pose const& frame) {
    if (!check(node)) return;
    Attributes const a(s_.files, node, nullptr);
    auto const model = models_.find(a.text("model"));
    if (model == models_.end()) a.fail("model", "is " + in_quotes(a.text("model")) + ", which no <asset> <model> has; correct the name");
    ModelDraft child = read_model(model->second);
    std::string const root = a.text("body");
    Rename const rename{a.text("prefix"), ""};

    BodyDraft const* found = &child.world;
    if (!root.empty()) found = find_body(child.world, root);
    if (!found) a.fail("body", "is " + in_quotes(root) + ", which the model does not have; correct the name");
    Names names;
    collect_names(*found, names, !root.empty());
    count(size_of(*found), node.place);
    for (auto& key : child.keys) split_key(child, key);
    BodyDraft piece;
    if (root.empty()) {
      piece = *found;
      piece.body.name.clear();
    } else {
      piece.children.push_back(*found);
    }
    rename(piece);
    merge(std::move(piece), frame, to);

    auto const inside = [](auto const& set, std::string const& name) { return set.find(name) != set.end(); };
    for (auto t : child.tendons) {
      bool all = true;
      for (auto const& term : t.terms) all = all && inside(names.joints, term.joint);
      if (!all) continue;
      if (!t.name.empty()) names.tendons.insert(t.name);
      rename(t.name);
      for (auto& term : t.terms) rename(term.joint);
      draft_.tendons.push_back(std::move(t));
    }
    for (auto act : child.actuators) {
      bool const on_joint = act.actuator.target == Transmission::joint;
      if (!inside(on_joint ? names.joints : names.tendons, act.actuator.target_name)) continue;
      rename(act.actuator.name), rename(act.actuator.target_name);
      draft_.actuators.push_back(std::move(act));
    }
    for (auto e : child.excludes) {
      if (!inside(names.bodies, e.body1) || !inside(names.bodies, e.body2)) continue;
      rename(e.body1), rename(e.body2);
      draft_.excludes.push_back(std::move(e));
    }
    for (auto key : child.keys) {
      rename(key.key.name);
      draft_.keys.push_back(std::move(key));
    }
  }

  // A <model> without a name goes by the name that the model gives itself, else by that of its file.
  std::string name_of_model(Node const& node) {
    auto const path = s_.files.resolve(node.place, *node.find("file"));
    auto const bytes = s_.files.load(node.place, path);
    pugi::xml_document document;
    document.load_buffer(bytes.data(), bytes.size(), pugi::parse_default, pugi::encoding_utf8);
    std::string const name = document.child("mujoco").attribute("model").value();
    return name.empty() ? path.stem().string() : name;
  }
  ModelDraft read_model(Node const& node) {
    if (s_.depth >= 10) s_.files.fail(node.place, "models are attached to models more than 10 deep; is there a circle?");
    auto const path = s_.files.resolve(node.place, *node.find("file"));
    auto const bytes = s_.files.load(node.place, path);
    ++s_.depth;
    int const file = s_.files.add(path.string());
    Reader reader(s_, file);
    XmlReader xml(s_.files);
    Node const root = xml.parse(bytes, file);
    ModelDraft draft = reader.read(root);
    --s_.depth;
    if (reader.has_option_) note(Kind::no_effect, root.place, "<option> of an attached model: the attaching model's holds");
    auto const key = [](CompilerDescription const& c) {
      return std::tuple(c.inertia_from_geom_always, c.inertia_from_geom_never, c.inertia_group_range, c.boundmass, c.boundinertia,
                        c.settotalmass, c.balanceinertia);
    };
    if (key(draft.compiler) != key(draft_.compiler))
      refuse(root.place,
             "an attached model has other inertia settings in <compiler> than the model that attaches it, which is not supported; make "
             "them equal");
    return draft;
  }
  static BodyDraft const* find_body(BodyDraft const& in, std::string const& name) {
    for (auto const& child : in.children) {
      if (child.body.name == name) return &child;
      if (auto const* found = find_body(child, name)) return found;
    }
    return nullptr;
  }
  void renumber(BodyDraft& b) {
    for (int& id : b.joint_ids) id = s_.next_id++;
    for (auto& child : b.children) renumber(child);
  }
  // The keyframe of an attached model as values by joint and actuator.
  void split_key(ModelDraft const& model, KeyDraft& key) const {
    if (key.attached) return;
    key.attached = true;
    auto const take = [&](std::vector<double>& all, std::size_t& at, int n) {
      std::vector<double> part;
      for (int i = 0; i < n && at < all.size(); ++i) part.push_back(all[at++]);
      return part;
    };
    auto const done = [&](std::vector<double>& all, std::size_t needed, char const* what) {
      if (!all.empty() && all.size() != needed)
        s_.files.fail(key.key.place, "<key>: attribute '" + std::string(what) + "' has " + std::to_string(all.size()) +
                                         " numbers and the model needs " + std::to_string(needed) + "; correct the list");
      all.clear();
    };
    std::size_t q = 0, v = 0, c = 0, nq = 0, nv = 0;
    for_each_joint(model.world, [&](int id, JointDescription const& j, BodyDescription const&) {
      nq += std::size_t(qpos_size(j.type)), nv += std::size_t(qvel_size(j.type));
      if (!key.key.qpos.empty()) key.qpos[id] = take(key.key.qpos, q, qpos_size(j.type));
      if (!key.key.qvel.empty()) key.qvel[id] = take(key.key.qvel, v, qvel_size(j.type));
    });
    if (!key.key.ctrl.empty())
      for (auto const& act : model.actuators) key.ctrl[act.id] = take(key.key.ctrl, c, 1);
    done(key.key.qpos, nq, "qpos"), done(key.key.qvel, nv, "qvel"), done(key.key.ctrl, model.actuators.size(), "ctrl");
  }

  // Entries of the lists that name something of `names` are taken out, to be put back once for each copy. Tendons count among the names
  // then.
  struct Lists {
    std::vector<TendonDescription> tendons;
    std::vector<ActuatorDraft> actuators;
    std::vector<ExcludeDescription> excludes;
  };
  Lists split_lists(Names& names) {
    Lists lists;
    auto const split = [](auto& all, auto& taken, auto const& test) {
      std::decay_t<decltype(all)> kept;
      for (auto& x : all) (test(x) ? taken : kept).push_back(std::move(x));
      all = std::move(kept);
    };
    split(draft_.tendons, lists.tendons, [&](TendonDescription const& t) {
      bool any = false;
      for (auto const& term : t.terms) any = any || names.joints.count(term.joint);
      if (any && !t.name.empty()) names.tendons.insert(t.name);
      return any;
    });
    split(draft_.actuators, lists.actuators, [&](ActuatorDraft const& a) {
      return (a.actuator.target == Transmission::joint ? names.joints : names.tendons).count(a.actuator.target_name) > 0;
    });
    split(draft_.excludes, lists.excludes,
          [&](ExcludeDescription const& e) { return names.bodies.count(e.body1) || names.bodies.count(e.body2); });
    return lists;
  }
  void append(Lists lists, Names const& names, Rename const& rename, bool fresh) {
    count(lists.tendons.size() + lists.actuators.size() + lists.excludes.size(), {file_, 1});
    for (auto& t : lists.tendons) {
      rename(t.name);
      for (auto& term : t.terms)
        if (names.joints.count(term.joint)) rename(term.joint);
      draft_.tendons.push_back(std::move(t));
    }
    for (auto& a : lists.actuators) {
      rename(a.actuator.name), rename(a.actuator.target_name);
      if (fresh) a.id = s_.next_id++;
      draft_.actuators.push_back(std::move(a));
    }
    for (auto& e : lists.excludes) {
      if (names.bodies.count(e.body1)) rename(e.body1);
      if (names.bodies.count(e.body2)) rename(e.body2);
      draft_.excludes.push_back(std::move(e));
    }
  }

  // ---- lists that refer to bodies and joints by name

  void contacts(Node const& node) {
    check(node);
    for (auto const& child : node.children) {
      if (child.name == "pair") {
        refuse(child.place, "<contact> <pair> is not supported yet; let contype and conaffinity choose the pairs");
        continue;
      }
      check(child);
      Attributes const a(s_.files, child, nullptr);
      if (!a.own("body1") || !a.own("body2")) a.fail("", "needs body1 and body2; give both");
      draft_.excludes.push_back({a.text("body1"), a.text("body2"), child.place});
    }
  }

  void tendons(Node const& node) {
    check(node);
    for (auto const& child : node.children) {
      if (child.name == "spatial") {
        refuse(child.place, "<tendon> <spatial> is not supported yet; use <fixed> tendons");
        continue;
      }
      check(child);
      count(1 + child.children.size(), child.place);
      auto const a = attributes(child, "tendon", "");
      TendonDescription t;
      t.place = child.place, t.name = a.own("name") ? a.text("name") : "";
      a.numbers("range", t.range);
      t.limited = limited(a, "limited", "range", t.range);
      std::array<double, 2> spring{-1, -1};
      if (a.numbers("springlength", spring, false))
        t.springlength = words(a.text("springlength")).size() == 1 ? std::array{spring[0], spring[0]} : spring;
      linear(a, "stiffness", t.stiffness), linear(a, "damping", t.damping);
      a.number("frictionloss", t.frictionloss), a.number("armature", t.armature), a.number("margin", t.margin);
      softness(a, t.limit, "limit"), softness(a, t.friction, "friction");
      for (auto const& term : child.children) {
        Attributes const b(s_.files, term, nullptr);
        for (auto const& x : term.attributes)
          if (x.name != "joint" && x.name != "coef") b.fail(x.name, "is unknown here; a joint of a tendon has joint and coef");
        if (!b.own("joint")) b.fail("joint", "is missing; name the joint");
        TendonDescription::Term entry{b.text("joint"), 1};
        if (!b.number("coef", entry.coefficient)) b.fail("coef", "is missing; give the coefficient");
        t.terms.push_back(std::move(entry));
      }
      draft_.tendons.push_back(std::move(t));
    }
  }

  void actuators(Node const& node) {
    check(node);
    for (auto const& child : node.children) {
      if (!is_in("general motor position velocity", child.name)) {
        refuse(child.place, "<actuator> <" + child.name + "> is not supported yet; use motor, position, velocity or general");
        continue;
      }
      if (!check(child)) continue;
      count(1, child.place);
      auto const a = attributes(child, "actuator", "");
      ActuatorDraft draft;
      auto& act = draft.actuator;
      draft.id = s_.next_id++;
      act.place = child.place, act.name = a.own("name") ? a.text("name") : "";
      int targets = 0;
      for (char const* target : {"joint", "jointinparent", "tendon"})
        if (a.own(target)) {
          ++targets, act.target_name = a.text(target);
          act.target = target[0] == 't' ? Transmission::tendon : Transmission::joint;
        }
      if (targets != 1) a.fail("", "needs one of joint, jointinparent and tendon; give one");
      a.numbers("gear", act.gear, false), a.integer("group", act.group);
      a.numbers("ctrlrange", act.ctrl_range), a.numbers("forcerange", act.force_range);
      act.ctrl_limited = limited(a, "ctrllimited", "ctrlrange", act.ctrl_range),
      act.force_limited = limited(a, "forcelimited", "forcerange", act.force_range);
      Law const law = changed(class_of(child, "").laws, child);
      draft.inheritrange = law.inheritrange;
      if (draft.inheritrange > 0 && a.has("ctrlrange")) a.fail("inheritrange", "stands beside ctrlrange; keep one");
      settle(law, child, act);
      draft_.actuators.push_back(std::move(draft));
    }
  }
  // motor, position and velocity are ways to write general. Each starts from its class's values; where another type than itself or general
  // set those, from the parent class's.
  Law changed(std::vector<Law> const& laws, Node const& node) const {
    Attributes const a(s_.files, node, nullptr);
    bool const general = node.name == "general";
    Law law;
    for (auto from = laws.rbegin(); from != laws.rend(); ++from)
      if (general || from->type.empty() || from->type == node.name) {
        law = *from;
        break;
      }
    a.number("inheritrange", law.inheritrange);
    law.type = general ? "" : node.name;
    if (general) {
      a.numbers("gainprm", law.gain, false), a.numbers("biasprm", law.bias, false);
      law.gaintype = a.text("gaintype", law.gaintype), law.biastype = a.text("biastype", law.biastype),
      law.dyntype = a.text("dyntype", law.dyntype);
    } else if (node.name == "motor") {
      law.gain[0] = 1, law.gaintype = "fixed", law.biastype = "none", law.dyntype = "none";
    } else if (node.name == "position") {
      double kv = 0, dampratio = 0;
      a.number("kp", law.gain[0]);
      bool const has_kv = a.number("kv", kv), has_ratio = a.number("dampratio", dampratio);
      if (has_kv && has_ratio) a.fail("dampratio", "stands beside kv; keep one");
      if (law.gain[0] < 0 || kv < 0 || dampratio < 0) a.fail("", "has a negative kp, kv or dampratio; give zero or more");
      law.bias[0] = 0, law.bias[1] = -law.gain[0];
      if (has_kv) law.bias[2] = -kv;
      if (has_ratio) law.bias[2] = dampratio;
      law.gaintype = "fixed", law.biastype = "affine", law.dyntype = "none";
    } else if (node.name == "velocity") {
      a.number("kv", law.gain[0]);
      if (law.gain[0] < 0) a.fail("kv", "is negative; give zero or more");
      law.bias = {0, 0, -law.gain[0]};
      law.gaintype = "fixed", law.biastype = "affine", law.dyntype = "none";
    }
    return law;
  }
  void settle(Law const& law, Node const& node, ActuatorDescription& act) {
    std::string const what = "<" + node.name + ">: ";
    if (law.dyntype != "none")
      refuse(node.place, what + "dyntype=" + in_quotes(law.dyntype) + ": actuators with a state are not supported yet; use dyntype='none'");
    if (law.gaintype != "fixed" && !(law.gaintype == "affine" && law.gain[1] == 0 && law.gain[2] == 0))
      refuse(node.place, what + "gaintype=" + in_quotes(law.gaintype) + " is not supported yet; use 'fixed'");
    if (law.biastype != "none" && law.biastype != "affine")
      refuse(node.place, what + "biastype=" + in_quotes(law.biastype) + " is not supported yet; use 'none' or 'affine'");
    act.gainprm[0] = law.gain[0];
    if (law.biastype != "affine") return;
    act.bias_type = ActuatorBias::affine, act.biasprm = {law.bias[0], law.bias[1], law.bias[2]};
    if (law.bias[2] > 0 && law.gain[0] == -law.bias[1]) act.dampratio = law.bias[2], act.biasprm[2] = 0;
  }

  void sensors(Node const& node) {
    for (auto const& child : node.children) {
      if (child.name == "plugin") {
        refuse(child.place, "<sensor> <plugin>: plug-ins are not supported; remove it");
        continue;
      }
      if (!is_in(sensor_tags, child.name))
        s_.files.fail(child.place, "unknown element " + in_quotes(child.name) + " in <sensor>; correct or remove it");
      for (auto const& a : child.attributes)
        if (!is_in(sensor_attributes, a.name))
          s_.files.fail(child.place, "unknown attribute " + in_quotes(a.name) + " of <" + child.name + ">; correct or remove it");
      note(Kind::left_out, child.place, "<sensor> <" + child.name + ">: not evaluated yet");
    }
  }

  void keyframes(Node const& node) {
    check(node);
    for (auto const& child : node.children) {
      check(child);
      Attributes const a(s_.files, child, nullptr);
      KeyDraft k;
      k.key.place = child.place, k.key.name = a.text("name");
      a.number("time", k.key.time);
      k.key.qpos = a.list("qpos"), k.key.qvel = a.list("qvel"), k.key.ctrl = a.list("ctrl");
      draft_.keys.push_back(std::move(k));
    }
  }

 private:
  Session& s_;
  int file_;
  ModelDraft draft_;
  bool degrees_ = true, autolimits_ = true, in_default_ = false, has_option_ = false;
  std::string eulerseq_ = "xyz", main_name_ = "main";
  std::unordered_map<std::string, Class> classes_;
  std::unordered_map<std::string, std::array<float, 4>> materials_;
  std::unordered_map<std::string, Node> models_;
};

}  // namespace gsp::io::detail::mjcf
