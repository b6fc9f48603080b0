#pragma once
#include <algorithm>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <gsp/core/detail/compiled.hpp>
#include <gsp/geometry/shapes.hpp>
#include <gsp/io/file.hpp>
#include <gsp/io/write_mjcf.hpp>
#include <gsp/model/description.hpp>
#include <gsp/model/detail/principal_axes.hpp>
#include <map>
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
    list("inertiagrouprange", c.inertia_group_range, {0, 5}).flag("fitaabb", c.fit_aabb, false);
    flag("discardvisual", c.discard_visual, false).flag("fusestatic", c.fuse_static, false).flag("alignfree", c.align_free, false);
    into();
    char const* const modes[] = {"none", "muscle", "muscleuser", "all"};
    auto const& range = c.length_range;
    LengthRangeDescription const usual;
    open("lengthrange").word("mode", modes[int(range.mode)]);
    flag("useexisting", range.use_existing, true).flag("uselimit", range.use_limit, false);
    number("accel", range.accel, usual.accel).number("maxforce", range.max_force, usual.max_force);
    number("timeconst", range.time_constant, usual.time_constant).number("timestep", range.timestep, usual.timestep);
    number("inttotal", range.total, usual.total).number("interval", range.interval, usual.interval);
    number("tolrange", range.tolerance, usual.tolerance).close();
    leave("compiler");
    option(d.option);
    assets(d);
    open("worldbody").into();
    bodies(d);
    leave("worldbody");
    contacts(d);
    equalities(d);
    tendons(d);
    actuators(d);
    sensors(d);
    if (!d.keyframes.empty()) {
      open("keyframe").into();
      for (auto const& k : d.keyframes) {
        open("key").text("name", k.name).number("time", k.time, 0).list("qpos", k.qpos, {}).list("qvel", k.qvel, {});
        list("act", k.act, {}).list("ctrl", k.ctrl, {}).list("mpos", k.mpos, {}).list("mquat", k.mquat, {}).close();
      }
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
  void into() {
    out_ += ">\n";
    ++depth_;
  }
  void leave(char const* element) {
    --depth_;
    out_.append(depth_ * 2, ' ');
    out_ += "</";
    out_ += element;
    out_ += ">\n";
  }
  Writer& word(char const* name, std::string_view value) {
    out_ += ' ';
    out_ += name;
    out_ += "=\"";
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
  Writer& rigidity(RigidDescription const& r, std::string const& suffix, RigidDescription const& standard = {}) {
    return flag(("hard" + suffix).c_str(), r.hard, false)
        .number(("restitution" + suffix).c_str(), r.restitution, 0)
        .number(("erp" + suffix).c_str(), r.erp, standard.erp);
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
    number("density", o.density, 0).number("viscosity", o.viscosity, 0).list("wind", o.wind, standard.wind);
    list("magnetic", o.magnetic, standard.magnetic).number("o_margin", o.o_margin, 0).list("o_friction", o.o_friction, standard.o_friction);
    list("o_solref", o.o_softness.solref, standard.o_softness.solref).list("o_solimp", o.o_softness.solimp, standard.o_softness.solimp);
    std::vector<int> groups;
    for (int k = 0; k < 31; ++k)
      if (o.disabled_actuator_groups >> k & 1) groups.push_back(k);
    list("actuatorgroupdisable", groups, {});
    number("sleep_tolerance", o.sleep_tolerance, standard.sleep_tolerance);
    number("tolerance", o.tolerance, standard.tolerance).number("iterations", o.iterations, standard.iterations);
    number("noslip_tolerance", o.noslip_tolerance, standard.noslip_tolerance);
    number("noslip_iterations", o.noslip_iterations, standard.noslip_iterations);
    if (o.integrator != Integrator::euler) word("integrator", integrators[int(o.integrator)]);
    if (o.cone == FrictionCone::elliptic) word("cone", "elliptic");
    auto const differs = [&](OptionFlag const& f) { return o.*f.on != standard.*f.on; };
    if (std::none_of(std::begin(option_flags), std::end(option_flags), differs)) return close();
    into();
    open("flag");
    for (auto const& f : option_flags)
      if (differs(f)) word(f.name, o.*f.on ? "enable" : "disable");
    close();
    leave("option");
  }

  void bodies(Description const& d) {
    std::vector<int> path{0};
    contents(d.bodies[0]);
    for (int b = 1; b < int(d.bodies.size()); ++b) {
      auto const& body = d.bodies[b];
      while (path.size() > 1 && path.back() != body.parent) {
        path.pop_back();
        leave("body");
      }
      path.push_back(b);
      open("body").text("name", body.name).pose(body.pos, body.quat).number("gravcomp", body.gravcomp, 0).flag("mocap", body.mocap, false);
      if (!body.fuse) word("fuse", "false");
      if (body.sleep != BodySleep::automatic) word("sleep", body.sleep == BodySleep::never ? "never" : "allowed");
      into();
      if (body.has_inertial) inertial(body.inertial);
      contents(body);
    }
    while (path.size() > 1) {
      path.pop_back();
      leave("body");
    }
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
    for (auto const& j : body.joints) {
      if (j.align) {  // <joint> has no word for it
        open("freejoint").text("name", j.name).number("group", j.group, 0).flag("align", *j.align, !*j.align).close();
        continue;
      }
      open("joint")
          .text("name", j.name)
          .word("type", joint_types[int(j.type)])
          .list("pos", j.pos, {0, 0, 0})
          .list("axis", j.axis, {0, 0, 1});
      number("group", j.group, 0)
          .number("ref", j.ref, 0)
          .number("springref", j.springref, 0)
          .polynomial("stiffness", j.stiffness, j.stiffness_poly)
          .polynomial("damping", j.damping, j.damping_poly)
          .flag("actuatorgravcomp", j.actuator_gravcomp, false);
      number("armature", j.armature, 0)
          .number("frictionloss", j.frictionloss, 0)
          .number("margin", j.margin, 0)
          .list("springdamper", j.springdamper, {0, 0});
      softness(j.limit, "limit").softness(j.friction, "friction").rigidity(j.rigid_limit, "limit");
      if (j.type != JointType::free) range("range", "limited", j.range, j.limited);
      if (j.actuator_force_limited) range("actuatorfrcrange", "actuatorfrclimited", j.actuator_force_range, true);
      close();
    }
    for (auto const& g : body.geoms) {
      open("geom").text("name", g.name).word("type", shape_name(g.type));
      Double3 size = g.size;
      if (g.type == ShapeType::plane && !(size[2] > 0)) size[2] = 1;  // the spacing of drawn lines must be positive
      bool const from_asset = !g.mesh.empty() || !g.hfield.empty();   // gives the size
      if (!from_asset) list("size", size, {});
      text("mesh", g.mesh).text("hfield", g.hfield).number("fitscale", g.fitscale, 1);
      if (g.fluid_ellipsoid) word("fluidshape", "ellipsoid").list("fluidcoef", g.fluid_coef, {});
      list("surfacevel", g.surface_velocity, {}).number("adhesion", g.adhesion, 0);
      pose(g.pos, g.quat).number("contype", g.contype, 1).number("conaffinity", g.conaffinity, 1).number("condim", g.condim, 3);
      number("priority", g.priority, 0)
          .number("group", g.group, 0)
          .list("friction", g.friction, {1, 0.005, 0.0001})
          .number("solmix", g.solmix, 1);
      number("margin", g.margin, 0).number("gap", g.gap, 0).softness(g.softness, "").flag("shellinertia", g.shell_inertia, false);
      rigidity({g.hard, g.restitution, g.erp}, "");
      if (g.has_mass)
        number("mass", g.mass, -1);
      else
        number("density", g.density, 1000);
      if (auto const material = material_of(g); !material.empty())
        text("material", material).list("rgba", g.rgba, {}).close();
      else
        list("rgba", g.rgba, {0.5f, 0.5f, 0.5f, 1}).close();
    }
    for (auto const& s : body.sites)
      open("site")
          .text("name", s.name)
          .word("type", s.type == ShapeType::mesh || s.type == ShapeType::hfield ? "sphere" : shape_name(s.type))
          .list("size", s.size, {0.005, 0.005, 0.005})
          .pose(s.pos, s.quat)
          .number("group", s.group, 0)
          .close();
    char const* const modes[] = {"fixed", "track", "trackcom", "targetbody", "targetbodycom"};
    for (auto const& c : body.cameras) {
      open("camera").text("name", c.name).pose(c.pos, c.quat);
      if (c.sensor_size[0] > 0)
        list("sensorsize", c.sensor_size, {}).list("focal", c.focal, {}).list("principal", c.principal, {0, 0});
      else
        number("fovy", c.fovy * (180 / 3.14159265358979323846), 45);
      list("resolution", std::array<double, 2>{double(c.resolution[0]), double(c.resolution[1])}, {1, 1});
      if (c.mode != CameraMode::fixed) word("mode", modes[int(c.mode)]);
      text("target", c.target).close();
    }
  }

  Writer& polynomial(char const* name, double first, std::array<double, 2> const& higher) {
    if (higher == std::array<double, 2>{}) return number(name, first, 0);
    return list(name, std::array{first, higher[0], higher[1]}, {});
  }

  /// Rays go by the alpha of the material: one is written where they would not see the same by the geom's own. Empty: none is needed.
  static std::string material_of(GeomDescription const& g) {
    bool const differs = g.material_alpha >= 0 && (g.material_alpha == 0) != (g.rgba[3] == 0);
    return differs ? "alpha_" + digits(g.material_alpha) : "";
  }

  // Meshes and height fields stand in the text: no file is written or needed.
  void assets(Description const& d) {
    std::map<std::string, float> materials;
    for (auto const& body : d.bodies)
      for (auto const& g : body.geoms)
        if (auto const material = material_of(g); !material.empty()) materials[material] = g.material_alpha;
    if (d.meshes.empty() && d.hfields.empty() && materials.empty()) return;
    char const* const inertias[] = {"legacy", "exact", "convex", "shell"};
    open("asset").into();
    for (auto const& [name, alpha] : materials)
      open("material").text("name", name).list("rgba", std::array{1.f, 1.f, 1.f, alpha}, {}).close();
    for (auto const& m : d.meshes) {
      open("mesh").text("name", m.name).list("scale", m.scale, {1, 1, 1}).list("refpos", m.refpos, {0, 0, 0});
      list("refquat", m.refquat, {1, 0, 0, 0}).number("maxhullvert", m.max_hull_vertices, -1);
      if (m.inertia != MeshInertia::legacy) word("inertia", inertias[int(m.inertia)]);
      std::vector<float> vertex;
      for (auto const& v : m.vertices) vertex.insert(vertex.end(), v.begin(), v.end());
      std::vector<int> face;
      for (auto const& f : m.faces) face.insert(face.end(), f.begin(), f.end());
      list("vertex", vertex, {}).list("face", face, {}).close();
    }
    for (auto const& h : d.hfields) {
      std::vector<float> elevation;  // from the top, +y, down
      for (int r = h.rows - 1; r >= 0; --r)
        elevation.insert(elevation.end(), h.elevation.begin() + std::ptrdiff_t(r) * h.columns,
                         h.elevation.begin() + std::ptrdiff_t(r + 1) * h.columns);
      open("hfield").text("name", h.name).number("nrow", h.rows, 0).number("ncol", h.columns, 0).list("size", h.size, {});
      list("elevation", elevation, {}).close();
    }
    leave("asset");
  }
  void contacts(Description const& d) {
    if (d.excludes.empty() && d.pairs.empty()) return;
    open("contact").into();
    auto const optional = [&](char const* name, auto const& value) {
      if (!value) return;
      if constexpr (requires { value->size(); })
        list(name, *value, {});
      else
        word(name, digits(*value));
    };
    for (auto const& p : d.pairs) {
      open("pair").text("name", p.name).text("geom1", p.geom1).text("geom2", p.geom2);
      optional("condim", p.condim);
      optional("friction", p.friction);
      optional("solref", p.solref);
      optional("solreffriction", p.solreffriction);
      optional("solimp", p.solimp);
      optional("margin", p.margin);
      optional("gap", p.gap);
      optional("adhesion", p.adhesion);
      rigidity(p.rigid, "").close();
    }
    for (auto const& e : d.excludes) open("exclude").text("body1", e.body1).text("body2", e.body2).close();
    leave("contact");
  }
  void equalities(Description const& d) {
    if (d.equalities.empty()) return;
    open("equality").into();
    char const* const types[] = {"connect", "weld", "joint", "tendon"};
    for (auto const& e : d.equalities) {
      auto const& x = e.data;
      std::string const kind = e.type >= EqualityType::joint ? types[int(e.type)] : e.sites ? "site" : "body";
      open(types[int(e.type)]).text("name", e.name).flag("active", e.active, true).softness(e.softness, "");
      rigidity(e.rigid, "", EqualityDescription{}.rigid);
      text((kind + "1").c_str(), e.name1).text((kind + "2").c_str(), e.name2);
      if (e.type >= EqualityType::joint) list("polycoef", std::array{x[0], x[1], x[2], x[3], x[4]}, {0, 1, 0, 0, 0});
      if (kind == "body") word("anchor", digits(x[0]) + " " + digits(x[1]) + " " + digits(x[2]));
      if (e.type == EqualityType::weld) {
        std::array<double, 7> const pose{x[3], x[4], x[5], x[6], x[7], x[8], x[9]};
        if (kind == "body" && pose != std::array<double, 7>{}) list("relpose", pose, {});
        number("torquescale", x[10], 1);
      }
      close();
    }
    leave("equality");
  }
  void tendons(Description const& d) {
    if (d.tendons.empty()) return;
    open("tendon").into();
    for (auto const& t : d.tendons) {
      char const* const element = t.path.empty() ? "fixed" : "spatial";
      open(element)
          .text("name", t.name)
          .polynomial("stiffness", t.stiffness, t.stiffness_poly)
          .polynomial("damping", t.damping, t.damping_poly);
      number("frictionloss", t.frictionloss, 0);
      number("armature", t.armature, 0).number("margin", t.margin, 0).list("springlength", t.springlength, {-1, -1});
      if (t.actuator_force_limited) range("actuatorfrcrange", "actuatorfrclimited", t.actuator_force_range, true);
      softness(t.limit, "limit").softness(t.friction, "friction").rigidity(t.rigid_limit, "limit");
      range("range", "limited", t.range, t.limited).into();
      for (auto const& term : t.terms) open("joint").text("joint", term.joint).word("coef", digits(term.coefficient)).close();
      for (auto const& item : t.path) {
        if (item.type == WrapType::pulley)
          open("pulley").word("divisor", digits(item.divisor)).close();
        else if (item.type == WrapType::site)
          open("site").text("site", item.name).close();
        else
          open("geom").text("geom", item.name).text("sidesite", item.sidesite).close();
      }
      leave(element);
    }
    leave("tendon");
  }
  void actuators(Description const& d) {
    if (d.actuators.empty()) return;
    open("actuator").into();
    char const* const targets[] = {"joint", "jointinparent", "cranksite", "tendon", "site", "body"};
    char const* const dynamics[] = {"none", "integrator", "filter", "filterexact", "muscle"};
    char const* const laws[] = {"fixed", "affine", "muscle"};
    char const* const biases[] = {"none", "affine", "muscle"};
    for (auto const& a : d.actuators) {
      open("general").text("name", a.name).text(targets[int(a.target)], a.target_name).number("group", a.group, 0);
      if (a.target == Transmission::slider_crank) text("slidersite", a.reference_name).number("cranklength", a.crank_length, 0);
      if (a.target == Transmission::site) text("refsite", a.reference_name);
      list("gear", a.gear, {1, 0, 0, 0, 0, 0}).number("damping", a.damping, 0).number("armature", a.armature, 0);
      auto bias = a.biasprm;
      if (a.dampratio > 0) bias[2] = a.dampratio;  // a positive number there is a damping ratio
      word("dyntype", dynamics[int(a.dynamics)]).word("gaintype", laws[int(a.gain_type)]).word("biastype", biases[int(a.bias_type)]);
      list("dynprm", a.dynprm, {1}).list("gainprm", a.gainprm, {1}).list("biasprm", bias, {}).flag("actearly", a.act_early, false);
      list("lengthrange", a.length_range, {0, 0});
      range("ctrlrange", "ctrllimited", a.ctrl_range, a.ctrl_limited).range("forcerange", "forcelimited", a.force_range, a.force_limited);
      if (a.dynamics != ActuatorDynamics::none) range("actrange", "actlimited", a.act_range, a.act_limited);
      close();
    }
    leave("actuator");
  }
  void sensors(Description const& d) {
    if (d.sensors.empty()) return;
    open("sensor").into();
    for (auto const& s : d.sensors) {
      open(s.type.c_str()).text("name", s.name).number("cutoff", s.cutoff, 0).number("noise", s.noise, 0);
      bool const frame = s.type.starts_with("frame"),
                 two = s.type == "distance" || s.type == "normal" || s.type == "fromto" || s.type == "contact";
      auto const name = [&](std::string const& type, std::string const& item, char const* number) {
        if (!item.empty()) text((type == "site" ? type : type + number).c_str(), item);
      };
      if (frame || s.type == "user" || s.type == "insidesite") {
        if (!s.object.empty()) text("objtype", s.object_type).text("objname", s.object);
        if (!frame)
          name(s.reference_type, s.reference, "");
        else if (!s.reference.empty())
          text("reftype", s.reference_type).text("refname", s.reference);
      } else {
        name(s.object_type, s.object, two ? "1" : "");
        name(s.reference_type, s.reference, two ? "2" : "");
      }
      for (auto const& [key, value] : s.settings) word(key.c_str(), value);
      close();
    }
    leave("sensor");
  }

  std::string out_;
  std::size_t depth_ = 0;
};

}  // namespace detail::mjcf

GSP_INLINE std::string format_mjcf(Description const& description) { return detail::mjcf::Writer().run(description); }

GSP_INLINE void write_mjcf(std::filesystem::path const& path, Description const& description) {
  write_file(path, detail::as_bytes(format_mjcf(description)));
}

}  // namespace gsp::io
