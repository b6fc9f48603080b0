#pragma once
#include <algorithm>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <gsp/io/file.hpp>
#include <gsp/model/description.hpp>
#include <gsp/model/detail/principal_axes.hpp>
#include <string>
#include <string_view>
#include <vector>

namespace gsp::io {

namespace detail::mjcf {

/// XML text, an element a line; attributes that hold the format's default are left away.
class Writer {
 public:
  std::string run(Description const& d) {
    open("mujoco").text("model", d.name).into();
    auto const& c = d.compiler;
    open("compiler")
        .word("angle", "radian")
        .word("autolimits", "false")
        .number("boundmass", c.boundmass, 0)
        .number("boundinertia", c.boundinertia, 0);
    number("settotalmass", c.settotalmass, -1).flag("balanceinertia", c.balanceinertia, false);
    if (c.inertia_from_geom_always || c.inertia_from_geom_never) word("inertiafromgeom", c.inertia_from_geom_always ? "true" : "false");
    list("inertiagrouprange", c.inertia_group_range, {0, 5}).close();
    option(d.option);
    open("worldbody").into();
    bodies(d);
    leave("worldbody");
    if (!d.excludes.empty()) {
      open("contact").into();
      for (auto const& e : d.excludes) open("exclude").text("body1", e.body1).text("body2", e.body2).close();
      leave("contact");
    }
    tendons(d);
    actuators(d);
    if (!d.keyframes.empty()) {
      open("keyframe").into();
      for (auto const& k : d.keyframes)
        open("key")
            .text("name", k.name)
            .number("time", k.time, 0)
            .list("qpos", k.qpos, {})
            .list("qvel", k.qvel, {})
            .list("ctrl", k.ctrl, {})
            .close();
      leave("keyframe");
    }
    leave("mujoco");
    return std::move(out_);
  }

 private:
  Writer& open(char const* element) {
    out_.append(depth_ * 2, ' ');
    out_ += '<';
    out_ += element;
    return *this;
  }
  void close() { out_ += "/>\n"; }
  void into() { out_ += ">\n", ++depth_; }
  void leave(char const* element) {
    --depth_;
    out_.append(depth_ * 2, ' ');
    out_ += "</", out_ += element, out_ += ">\n";
  }
  Writer& word(char const* name, std::string_view value) {
    out_ += ' ', out_ += name, out_ += "=\"";
    for (char ch : value) switch (ch) {
        case '&':
          out_ += "&amp;";
          break;
        case '<':
          out_ += "&lt;";
          break;
        case '"':
          out_ += "&quot;";
          break;
        default:
          out_ += ch;
      }
    out_ += '"';
    return *this;
  }
  Writer& text(char const* name, std::string const& value) { return value.empty() ? *this : word(name, value); }
  Writer& flag(char const* name, bool value, bool standard) { return value == standard ? *this : word(name, value ? "true" : "false"); }
  template <class T>
  static std::string digits(T x) {  // the shortest that reads back as the same number
    char buffer[32];
    return {buffer, std::to_chars(buffer, buffer + sizeof buffer, x).ptr};
  }
  template <class A>
  Writer& list(char const* name, A const& values, A const& standard) {
    if (values == standard) return *this;
    std::string all;
    for (auto x : values) {
      if (!all.empty()) all += ' ';
      all += digits(x);
    }
    return word(name, all);
  }
  Writer& number(char const* name, double value, double standard) { return value == standard ? *this : word(name, digits(value)); }
  Writer& pose(Double3 const& pos, Double4 const& quat) { return list("pos", pos, {0, 0, 0}).list("quat", quat, {1, 0, 0, 0}); }
  Writer& softness(SoftnessDescription const& s, std::string const& suffix) {
    SoftnessDescription const standard;
    return list(("solref" + suffix).c_str(), s.solref, standard.solref).list(("solimp" + suffix).c_str(), s.solimp, standard.solimp);
  }
  Writer& range(char const* name, char const* limited, std::array<double, 2> const& r, bool is_limited) {
    return list(name, r, {0, 0}).word(limited, is_limited ? "true" : "false");
  }

  void option(OptionDescription const& o) {
    OptionDescription const standard;
    char const* const integrators[] = {"Euler", "RK4", "implicit", "implicitfast"};
    open("option")
        .number("timestep", o.timestep, standard.timestep)
        .list("gravity", o.gravity, standard.gravity)
        .number("impratio", o.impratio, 1);
    number("tolerance", o.tolerance, standard.tolerance).number("iterations", o.iterations, standard.iterations);
    if (o.integrator != Integrator::euler) word("integrator", integrators[int(o.integrator)]);
    if (o.cone == Cone::elliptic) word("cone", "elliptic");
    std::pair<char const*, bool> const flags[] = {
        {"actuation", o.actuation},   {"clampctrl", o.clampctrl}, {"constraint", o.constraint},     {"contact", o.contact},
        {"damper", o.passive_damper}, {"eulerdamp", o.eulerdamp}, {"filterparent", o.filterparent}, {"frictionloss", o.frictionloss},
        {"gravity", o.gravity_on},    {"limit", o.limit},         {"refsafe", o.refsafe},           {"spring", o.passive_spring},
        {"warmstart", o.warmstart}};
    if (std::all_of(std::begin(flags), std::end(flags), [](auto const& f) { return f.second; })) return close();
    into();
    open("flag");
    for (auto const& [name, on] : flags)
      if (!on) word(name, "disable");
    close();
    leave("option");
  }

  void bodies(Description const& d) {
    std::vector<int> path{0};
    contents(d.bodies[0]);
    for (int b = 1; b < int(d.bodies.size()); ++b) {
      auto const& body = d.bodies[b];
      while (path.size() > 1 && path.back() != body.parent) path.pop_back(), leave("body");
      path.push_back(b);
      open("body")
          .text("name", body.name)
          .pose(body.pos, body.quat)
          .number("gravcomp", body.gravcomp, 0)
          .flag("mocap", body.mocap, false)
          .into();
      if (body.has_inertial) inertial(body.inertial);
      contents(body);
    }
    while (path.size() > 1) path.pop_back(), leave("body");
  }
  void inertial(InertialDescription const& i) {
    auto const& t = i.inertia;
    open("inertial").list("pos", i.pos, {}).number("mass", i.mass, -1);
    if (i.pos == Double3{}) word("pos", "0 0 0");
    if (t[3] == 0 && t[4] == 0 && t[5] == 0) {
      list("quat", i.quat, {1, 0, 0, 0}).word("diaginertia", digits(t[0]) + " " + digits(t[1]) + " " + digits(t[2])).close();
    } else {  // fullinertia takes no orientation: the tensor is turned into the body's frame by its principal axes
      auto const axes = gsp::detail::principal_axes(t);
      auto const turned = gsp::detail::rotated_diagonal(gsp::detail::times(gsp::detail::normalized(i.quat), axes.quat), axes.moments);
      list("fullinertia", turned, {}).close();
    }
  }
  void contents(BodyDescription const& body) {
    char const* const joint_types[] = {"free", "ball", "slide", "hinge"};
    char const* const shapes[] = {"plane", "hfield", "sphere", "capsule", "ellipsoid", "cylinder", "box", "mesh"};
    for (auto const& j : body.joints) {
      open("joint")
          .text("name", j.name)
          .word("type", joint_types[int(j.type)])
          .list("pos", j.pos, {0, 0, 0})
          .list("axis", j.axis, {0, 0, 1});
      number("group", j.group, 0)
          .number("ref", j.ref, 0)
          .number("springref", j.springref, 0)
          .number("stiffness", j.stiffness, 0)
          .number("damping", j.damping, 0);
      number("armature", j.armature, 0)
          .number("frictionloss", j.frictionloss, 0)
          .number("margin", j.margin, 0)
          .list("springdamper", j.springdamper, {0, 0});
      softness(j.limit, "limit").softness(j.friction, "friction");
      if (j.type != JointType::free) range("range", "limited", j.range, j.limited);
      if (j.actuator_force_limited) range("actuatorfrcrange", "actuatorfrclimited", j.actuator_force_range, true);
      close();
    }
    for (auto const& g : body.geoms) {
      open("geom").text("name", g.name).word("type", shapes[int(g.type)]);
      Double3 size = g.size;
      if (g.type == ShapeType::plane && !(size[2] > 0)) size[2] = 1;  // the spacing of drawn lines must be positive
      list("size", size, {})
          .pose(g.pos, g.quat)
          .number("contype", g.contype, 1)
          .number("conaffinity", g.conaffinity, 1)
          .number("condim", g.condim, 3);
      number("priority", g.priority, 0)
          .number("group", g.group, 0)
          .list("friction", g.friction, {1, 0.005, 0.0001})
          .number("solmix", g.solmix, 1);
      number("margin", g.margin, 0).number("gap", g.gap, 0).softness(g.softness, "").flag("shellinertia", g.shell_inertia, false);
      if (g.has_mass)
        number("mass", g.mass, -1);
      else
        number("density", g.density, 1000);
      list("rgba", g.rgba, {0.5f, 0.5f, 0.5f, 1}).close();
    }
    for (auto const& s : body.sites)
      open("site")
          .text("name", s.name)
          .word("type", shapes[int(s.type)])
          .list("size", s.size, {0.005, 0.005, 0.005})
          .pose(s.pos, s.quat)
          .number("group", s.group, 0)
          .close();
    for (auto const& c : body.cameras)
      open("camera").text("name", c.name).pose(c.pos, c.quat).number("fovy", c.fovy * (180 / 3.14159265358979323846), 45).close();
  }

  void tendons(Description const& d) {
    if (d.tendons.empty()) return;
    open("tendon").into();
    for (auto const& t : d.tendons) {
      open("fixed")
          .text("name", t.name)
          .number("stiffness", t.stiffness, 0)
          .number("damping", t.damping, 0)
          .number("frictionloss", t.frictionloss, 0);
      number("armature", t.armature, 0).number("margin", t.margin, 0).list("springlength", t.springlength, {-1, -1});
      softness(t.limit, "limit").softness(t.friction, "friction").range("range", "limited", t.range, t.limited).into();
      for (auto const& term : t.terms)
        open("joint").text("joint", term.joint).number("coef", term.coefficient, std::nextafter(0., 1.)).close();
      leave("fixed");
    }
    leave("tendon");
  }
  void actuators(Description const& d) {
    if (d.actuators.empty()) return;
    open("actuator").into();
    for (auto const& a : d.actuators) {
      open("general")
          .text("name", a.name)
          .text(a.target == Transmission::joint ? "joint" : "tendon", a.target_name)
          .number("group", a.group, 0);
      list("gear", a.gear, {1, 0, 0, 0, 0, 0}).number("gainprm", a.gainprm[0], 1);
      Double3 bias{a.biasprm[0], a.biasprm[1], a.biasprm[2]};
      if (a.dampratio > 0) bias[2] = a.dampratio;  // a positive number there is a damping ratio
      if (bias != Double3{}) word("biastype", "affine").list("biasprm", bias, {});
      range("ctrlrange", "ctrllimited", a.ctrl_range, a.ctrl_limited)
          .range("forcerange", "forcelimited", a.force_range, a.force_limited)
          .close();
    }
    leave("actuator");
  }

  std::string out_;
  std::size_t depth_ = 0;
};

}  // namespace detail::mjcf

/// A description as MJCF text, which MuJoCo and read_mjcf load to the same numbers: no default classes, angles in radians, every number in
/// the shortest form that reads back the same. Joints and bodies that tendons, actuators and excludes name need names. O(size). Not
/// written, as MJCF has no word for them: CompilerDescription::approximate, the report.
inline std::string format_mjcf(Description const& description) { return detail::mjcf::Writer().run(description); }

/// Writes it under `path`, all or nothing.
inline void write_mjcf(std::filesystem::path const& path, Description const& description) {
  write_file(path, detail::as_bytes(format_mjcf(description)));
}

}  // namespace gsp::io
