#pragma once
#include <array>
#include <cmath>
#include <cstdio>
#include <gsp/io/detail/load_report.hpp>
#include <gsp/io/detail/mjcf_actuator_law.hpp>
#include <gsp/io/detail/mjcf_draft.hpp>
#include <gsp/io/detail/mjcf_schema.hpp>
#include <gsp/io/detail/mjcf_sensors.hpp>
#include <gsp/io/detail/mjcf_values.hpp>
#include <gsp/io/detail/mjcf_xml.hpp>
#include <gsp/io/hfield.hpp>
#include <gsp/io/mesh.hpp>
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
using gsp::detail::quat_of_z;
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
    for (auto const& node : root.children)
      if (node.name == "body") note(Line::no_effect, node.place, "<body> outside <worldbody>");
    auto const each = [&](char const* section, auto const& f) {
      for (auto const& node : root.children)
        if (node.name == section) f(node);
    };
    classes_[""];
    each("compiler", [&](Node const& n) { compiler(n); });
    each("option", [&](Node const& n) { option(n); });
    for (char const* section : {"size", "statistic", "visual", "custom"}) each(section, [&](Node const& n) { check_all(n); });
    for (char const* section : {"extension", "deformable"}) each(section, [&](Node const& n) { refuse_element(n); });
    each("default", [&](Node const& n) { defaults(n, ""); });
    each("asset", [&](Node const& n) { assets(n); });
    each("contact", [&](Node const& n) { contacts(n); });
    each("equality", [&](Node const& n) { equalities(n); });
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
  using Line = ReportLine::Kind;

  // ---- strictness

  void note(Line kind, Place const& place, std::string const& text) {
    s_.report.add(kind, s_.files.names[std::size_t(place.file)], place.line, text);
  }
  void refuse(Place const& place, std::string const& sentence) {
    if (!s_.list_refusals) s_.files.fail(place, sentence);
    note(Line::refused, place, sentence);
  }
  void refuse_element(Node const& node, std::string const& parent = "") {
    auto const* e = find_refused(node.name);
    refuse(node.place, parent + "<" + node.name + ">: " + (e ? std::string(e->sentence) : "is not supported; remove it"));
  }
  // Attributes and children of `node` against the schema of `element`; true where nothing is refused.
  bool check(Node const& node, std::string const& element) {
    auto const* e = find_schema(element);
    if (!e) s_.files.fail(node.place, "unknown element <" + node.name + ">; correct or remove it");
    bool good = true;
    for (auto const& a : node.attributes) {
      std::string const what = "<" + node.name + "> " + a.name;
      if (is_in(e->honoured, a.name)) continue;
      if (is_in(e->visual, a.name))
        note(Line::visual_only, node.place, what);
      else if (is_in(e->no_effect, a.name))
        note(Line::no_effect, node.place, what);
      else if (is_in(e->refused, a.name)) {
        if (is_neutral(a.value)) continue;
        refuse(node.place, what + "=" + in_quotes(a.value) + " is not supported yet; remove the attribute"), good = false;
      } else {
        s_.files.fail(node.place, "unknown attribute " + in_quotes(a.name) + " of <" + node.name + ">; correct or remove it");
      }
    }
    for (auto const& child : node.children)
      if (!is_in(e->children, child.name) && !find_refused(child.name))
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
    Attributes const a(s_.files, node, nullptr);
    auto& c = draft_.compiler;
    if (a.has("angle")) degrees_ = a.choice("angle", {"radian", "degree"}) == 1;
    if (a.has("coordinate")) a.choice("coordinate", {"local"});
    a.boolean("autolimits", autolimits_), a.boolean("balanceinertia", c.balanceinertia);
    a.number("boundmass", c.boundmass), a.number("boundinertia", c.boundinertia), a.number("settotalmass", c.settotalmass);
    a.boolean("fitaabb", c.fit_aabb), a.boolean("discardvisual", c.discard_visual), a.boolean("fusestatic", c.fuse_static);
    a.boolean("alignfree", c.align_free), a.boolean("strippath", strip_path_);
    if (a.has("assetdir")) mesh_folder_ = a.text("assetdir");
    if (a.has("meshdir")) mesh_folder_ = a.text("meshdir");
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
    for (auto const& child : node.children) {
      check(child);
      Attributes const b(s_.files, child, nullptr);
      if (b.has("mode")) c.length_range = static_cast<LengthRangeMode>(b.choice("mode", {"none", "muscle", "muscleuser", "all"}));
      b.boolean("useexisting", c.length_range_use_existing), b.boolean("uselimit", c.length_range_use_limit);
    }
  }

  void option(Node const& node) {
    check(node);
    has_option_ = true;
    Attributes const a(s_.files, node, nullptr);
    auto& o = draft_.option;
    a.number("timestep", o.timestep), a.numbers("gravity", o.gravity), a.number("impratio", o.impratio), a.number("tolerance", o.tolerance);
    a.number("density", o.density), a.number("viscosity", o.viscosity), a.numbers("wind", o.wind), a.numbers("magnetic", o.magnetic);
    a.number("o_margin", o.o_margin), a.numbers("o_solref", o.o_softness.solref, false), a.numbers("o_solimp", o.o_softness.solimp, false),
        a.numbers("o_friction", o.o_friction, false);
    a.integer("iterations", o.iterations);
    if (!(o.timestep > 0)) a.fail("timestep", "is not positive; give seconds, such as 0.002");
    if (!(o.impratio > 0)) a.fail("impratio", "is not positive; give one or more");
    for (double group : a.list("actuatorgroupdisable")) {
      if (group != std::floor(group) || group < 0 || group > 30)
        a.fail("actuatorgroupdisable", "holds a group other than 0 .. 30; correct it");
      o.disabled_actuator_groups |= 1 << static_cast<int>(group);
    }
    if (a.text("integrator") == "discrete")
      refuse(node.place, "<option> integrator='discrete' is not supported; use implicitfast");
    else if (a.has("integrator"))
      o.integrator = static_cast<Integrator>(a.choice("integrator", {"Euler", "RK4", "implicit", "implicitfast"}));
    if (a.has("cone")) o.cone = static_cast<Cone>(a.choice("cone", {"pyramidal", "elliptic"}));
    for (char const* name : {"integrator", "cone", "impratio"})
      if (a.has(name)) note(Line::no_effect, node.place, std::string("<option> ") + name + " (in profile stable)");
    for (auto const& flag : node.children) {
      check(flag);
      Attributes const f(s_.files, flag, nullptr);
      for (auto const& one : flag.attributes) {
        bool const on = f.choice(one.name, {"disable", "enable"}) == 1;
        std::pair<char const*, bool*> const flags[] = {{"actuation", &o.actuation},
                                                       {"clampctrl", &o.clampctrl},
                                                       {"constraint", &o.constraint},
                                                       {"contact", &o.contact},
                                                       {"damper", &o.passive_damper},
                                                       {"equality", &o.equality},
                                                       {"eulerdamp", &o.eulerdamp},
                                                       {"filterparent", &o.filterparent},
                                                       {"frictionloss", &o.frictionloss},
                                                       {"gravity", &o.gravity_on},
                                                       {"limit", &o.limit},
                                                       {"override", &o.override_contacts},
                                                       {"refsafe", &o.refsafe},
                                                       {"spring", &o.passive_spring},
                                                       {"warmstart", &o.warmstart}};
        for (auto const& [name, value] : flags)
          if (one.name == name) *value = on;
      }
    }
  }

  // ---- default classes: element -> attribute -> value, a copy of the parent's at that point with the class's own over it

  struct Class {
    std::map<std::string, Values, std::less<>> values;
    std::vector<Law> laws{Law{}};  // of actuators: the class's own last, before it its parent's, and so on
  };
  static bool is_actuator(std::string_view e) {
    return is_in("general motor position velocity intvelocity damper cylinder muscle adhesion", e);
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
      if (find_refused(child.name)) {  // matters only to elements that are refused themselves
        note(Line::no_effect, child.place, "<default> <" + child.name + ">");
        continue;
      }
      bool const actuator = is_actuator(child.name);
      check(child, child.name == "tendon" ? "spatial" : child.name == "equality" ? "default/equality" : child.name);
      auto& own = classes_.at(name);
      for (auto const& a : child.attributes) {
        auto& values = own.values[actuator ? "actuator" : child.name];
        auto const old = values.find(a.name);
        values.insert_or_assign(a.name, Value{old == values.end() ? a.value : merged(a.name, old->second.text, a.value), child.place});
      }
      if (actuator) own.laws.back() = changed_law(own.laws, s_.files, child);
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

  // A file of the model: below the model's own folder and meshdir.
  std::filesystem::path asset_path(Attributes const& a) const {
    std::filesystem::path file = a.text("file");
    if (strip_path_) file = file.filename();
    return (s_.files.folders[std::size_t(file_)] / mesh_folder_ / file).lexically_normal();
  }
  std::string asset_name(Attributes const& a) const {
    std::string const name = a.text("name");
    return name.empty() ? std::filesystem::path(a.text("file")).stem().string() : name;
  }
  // Reads a file of an asset. A missing one is an error, unless visuals may be left out: then it is one where something needs the asset.
  template <class Parse>
  auto load_asset(Attributes const& a, std::string const& name, Parse const& parse) -> std::optional<decltype(parse(Bytes{}, ""))> {
    auto const path = asset_path(a);
    std::vector<std::byte> bytes;
    try {
      bytes = s_.files.load(a.place(), path);
    } catch (Error const& e) {
      if (!s_.skip_visuals && !s_.list_refusals) throw;
      missing_[name] = e.what();
      note(s_.skip_visuals ? Line::left_out : Line::refused, a.place(),
           "asset " + in_quotes(name) + ": " + path.string() + " cannot be read");
      return std::nullopt;
    }
    try {
      return parse(Bytes(bytes), path.string());
    } catch (Error const& e) { throw Error(s_.files.at(a.place()) + e.what()); }
  }
  static std::vector<int> whole(Attributes const& a, std::string_view name) {
    std::vector<int> out;
    for (double x : a.list(name)) {
      if (x != std::floor(x) || std::abs(x) > 2147483647.) a.fail(name, "holds a number that is not whole; correct it");
      out.push_back(static_cast<int>(x));
    }
    return out;
  }

  void mesh(Node const& node) {
    if (!check(node)) return;
    auto const a = attributes(node, "mesh", "");
    std::string const name = asset_name(a), what = "mesh " + in_quotes(name);
    bool const from_file = a.own("file");
    if (name.empty()) a.fail("name", "is missing; name the mesh or its file");
    if (!from_file && !a.own("vertex")) a.fail("file", "is missing; name a file or give vertex");
    if (from_file && (a.own("vertex") || a.own("face"))) a.fail("file", "stands beside vertex or face; keep one of the two");
    MeshDescription m;
    if (from_file) {
      std::string ignored;
      auto read = load_asset(
          a, name, [&](Bytes bytes, std::string const& file) { return parse_mesh(bytes, file, a.text("content_type"), &ignored); });
      if (!read) return;
      if (!ignored.empty()) note(Line::left_out, node.place, what + ": " + ignored);
      m = std::move(*read);
    } else {
      auto const vertex = a.list("vertex");
      auto const face = whole(a, "face");
      try {
        m = make_mesh(vertex, face, what);
      } catch (Error const& e) { throw Error(s_.files.at(node.place) + e.what()); }
    }
    m.name = name, m.place = node.place;
    a.numbers("scale", m.scale), a.numbers("refpos", m.refpos), a.numbers("refquat", m.refquat);
    if (a.has("inertia")) {
      constexpr std::array modes{MeshInertia::convex, MeshInertia::exact, MeshInertia::legacy, MeshInertia::shell};
      m.inertia = modes[std::size_t(a.choice("inertia", {"convex", "exact", "legacy", "shell"}))];
    }
    if (a.integer("maxhullvert", m.max_hull_vertices) && m.max_hull_vertices != -1 && m.max_hull_vertices < 4)
      a.fail("maxhullvert", "is below 4; give 4 or more, or -1");
    draft_.meshes.push_back(std::move(m));
  }

  void hfield(Node const& node) {
    check(node);
    Attributes const a(s_.files, node, nullptr);
    std::string const name = asset_name(a), what = "hfield " + in_quotes(name);
    if (name.empty()) a.fail("name", "is missing; name the height field or its file");
    HeightFieldDescription h;
    if (a.own("file")) {
      auto read =
          load_asset(a, name, [&](Bytes bytes, std::string const& file) { return parse_hfield(bytes, file, a.text("content_type")); });
      if (!read) return;
      h = std::move(*read);
    } else {
      int rows = 0, columns = 0;
      a.integer("nrow", rows), a.integer("ncol", columns);
      auto const elevation = a.list("elevation");
      try {
        h = make_hfield(rows, columns, elevation, what);
      } catch (Error const& e) { throw Error(s_.files.at(node.place) + e.what()); }
    }
    h.name = name, h.place = node.place;
    if (!a.numbers("size", h.size)) a.fail("size", "is missing; give half x, half y, top and base");
    draft_.hfields.push_back(std::move(h));
  }

  void assets(Node const& node) {
    check(node);
    for (auto const& child : node.children) {
      if (find_refused(child.name)) {
        refuse_element(child);
      } else if (child.name == "texture") {
        check(child);
      } else if (child.name == "mesh") {
        mesh(child);
      } else if (child.name == "hfield") {
        hfield(child);
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
        check(child), note(Line::visual_only, child.place, "<light>");
      else if (child.name == "inertial")
        inertial(child, to);
      else if (child.name == "frame") {
        check(child);
        Attributes const a(s_.files, child, nullptr);
        if (a.has("childclass")) require_class(a, a.text("childclass"));
        Pose pose;
        a.numbers("pos", pose.p);
        pose.q = orientation(a);
        contents(child, to, frame * pose, a.text("childclass", childclass));
      } else if (child.name == "replicate")
        replicate(child, to, frame, childclass);
      else if (child.name == "attach")
        attach(child, to, frame);
      else
        refuse_element(child);
    }
  }

  void require_class(Attributes const& a, std::string const& name) const {
    if (!classes_.count(name == main_name_ ? "" : name))
      a.fail("childclass", "names the class " + in_quotes(name) + ", which does not exist; correct the name");
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
    if (a.has("fuse")) b.fuse = a.choice("fuse", {"false", "auto"}) == 1;
    if (b.mocap) draft.id = s_.next_id++;
    if (b.name == "world") a.fail("name", "is 'world', which the root has; choose another");
    std::string const next = a.text("childclass", childclass);
    if (a.has("childclass")) require_class(a, next);
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
  // The first number of a list and the coefficients of higher order that may follow.
  static void polynomial(Attributes const& a, char const* name, double& first, std::array<double, 2>& higher) {
    std::array<double, 3> v{first, higher[0], higher[1]};
    a.numbers(name, v, false);
    first = v[0], higher = {v[1], v[2]};
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
      if (a.has("align"))
        if (int const align = a.choice("align", {"false", "true", "auto"}); align != 2) j.align = align == 1;
    } else {
      if (a.has("type")) j.type = static_cast<JointType>(a.choice("type", {"free", "ball", "slide", "hinge"}));
      a.numbers("pos", j.pos), a.numbers("axis", j.axis), a.numbers("range", j.range);
      j.limited = limited(a, "limited", "range", j.range) && j.type != JointType::free;
      a.numbers("actuatorfrcrange", j.actuator_force_range);
      j.actuator_force_limited = limited(a, "actuatorfrclimited", "actuatorfrcrange", j.actuator_force_range) && j.type >= JointType::slide;
      a.number("ref", j.ref), a.number("springref", j.springref), a.number("armature", j.armature),
          a.number("frictionloss", j.frictionloss), a.number("margin", j.margin);
      a.boolean("actuatorgravcomp", j.actuator_gravcomp);
      polynomial(a, "stiffness", j.stiffness, j.stiffness_poly), polynomial(a, "damping", j.damping, j.damping_poly);
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
    for (auto const& child : node.children) refuse_element(child, "<geom> ");
    count(1, node.place);
    auto const a = attributes(node, "geom", childclass);
    GeomDescription g;
    g.place = node.place, g.name = a.own("name") ? a.text("name") : "";
    g.type = shape(a, ShapeType::sphere);
    if (a.text("type") == "sdf") refuse(node.place, "<geom> type='sdf': signed distance fields are not supported; use mesh or a primitive");
    a.integer("contype", g.contype), a.integer("conaffinity", g.conaffinity), a.integer("condim", g.condim),
        a.integer("priority", g.priority), a.integer("group", g.group);
    a.numbers("size", g.size, false), a.numbers("friction", g.friction, false);
    a.number("solmix", g.solmix), a.number("margin", g.margin), a.number("gap", g.gap), a.number("density", g.density);
    a.numbers("surfacevel", g.surface_velocity, false), a.number("adhesion", g.adhesion), a.number("fitscale", g.fitscale);
    if (g.adhesion != 0) note(Line::approximated, node.place, "<geom> adhesion: contacts push only");
    if (g.surface_velocity != std::array<double, 6>{}) note(Line::approximated, node.place, "<geom> surfacevel: surfaces are at rest");
    if (a.has("fluidshape")) g.fluid_ellipsoid = a.choice("fluidshape", {"none", "ellipsoid"}) == 1;
    a.numbers("fluidcoef", g.fluid_coef, false);
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
    g.mesh = a.text("mesh"), g.hfield = a.text("hfield");
    if (auto const lost = missing_.find(g.mesh.empty() ? g.hfield : g.mesh); lost != missing_.end()) {
      without_shape(node, g, to, lost->second);
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
  // Geoms whose file is missing: visual ones may be left out where their body does not take its inertia from them.
  void without_shape(Node const& node, GeomDescription const& g, BodyDraft& to, std::string const& why) {
    std::string const name = g.name.empty() ? "" : " " + in_quotes(g.name);
    if (!g.visual()) {
      if (!s_.list_refusals) throw Error(why);
      note(Line::refused, node.place, "geom" + name + " collides with a shape whose file is missing");
    } else if (s_.skip_visuals) {
      auto const& c = draft_.compiler;
      bool const weighs =
          (g.has_mass ? g.mass > 0 : g.density > 0) && g.group >= c.inertia_group_range[0] && g.group <= c.inertia_group_range[1];
      if (weighs) to.needs_mesh = node.place;
      note(Line::left_out, node.place, "visual geoms whose mesh is missing (--skip-visuals)");
    } else {
      note(Line::refused, node.place, "visual geoms whose mesh is missing; leave them out with --skip-visuals");
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
    c.place = node.place, c.name = a.own("name") ? a.text("name") : "", c.target = a.text("target");
    double constexpr pi = 3.14159265358979323846;
    double fovy = 45;
    a.number("fovy", fovy);
    if (!(fovy < 180)) a.fail("fovy", "is 180 degrees or more; give less");
    c.fovy = fovy * (pi / 180);
    // fovy of a sensor: 2 atan(half height / focal length), as MuJoCo in float
    std::array<double, 2> sensor{0, 0}, focal{0, 0}, focal_pixel{0, 0}, resolution{1, 1};
    a.numbers("sensorsize", sensor), a.numbers("focal", focal), a.numbers("focalpixel", focal_pixel), a.numbers("resolution", resolution);
    for (int k = 0; k < 2; ++k) {
      if (!(resolution[k] >= 1 && resolution[k] <= 1e6) || resolution[k] != std::floor(resolution[k]))
        a.fail("resolution", "is not two whole numbers from 1 to 1000000; correct it");
      c.resolution[k] = int(resolution[k]);
    }
    bool const sized = sensor[0] > 0 && sensor[1] > 0;
    if (!sized && (focal[0] != 0 || focal[1] != 0 || focal_pixel[0] != 0 || focal_pixel[1] != 0))
      a.fail("focal", "needs sensorsize; give both");
    if (sized) {
      if (!a.has("resolution")) a.fail("sensorsize", "needs a resolution; give both");
      for (int k = 0; k < 2; ++k) {
        float const size = float(sensor[k]), density = float(resolution[k]) / size;
        c.sensor_size[k] = size, c.focal[k] = focal_pixel[k] != 0 ? float(focal_pixel[k]) / density : float(focal[k]);
      }
      c.fovy = std::atan2(float(c.sensor_size[1]) / 2, float(c.focal[1])) * 2;
    }
    if (a.has("projection") && a.choice("projection", {"perspective", "orthographic"}) == 1)
      refuse(node.place, "<camera> projection='orthographic' is not supported; use perspective");
    if (a.has("mode")) c.mode = static_cast<CameraMode>(a.choice("mode", {"fixed", "track", "trackcom", "targetbody", "targetbodycom"}));
    Pose pose;
    a.numbers("pos", pose.p);
    pose.q = orientation(a);
    pose = frame * pose;
    c.pos = pose.p, c.quat = normalized(pose.q);
    to.body.cameras.push_back(std::move(c));
  }

  // ---- copies

  // Copies of the contents: copy i is turned by i times the Euler angles, and stands one offset from the copy before, in that one's frame.
  // Names get a number.
  void replicate(Node const& node, BodyDraft& to, Pose const& frame, std::string const& childclass) {
    check(node);
    Attributes const a(s_.files, node, nullptr);
    int copies = 0;
    if (!a.integer("count", copies) || copies < 1) a.fail("count", "is missing or below 1; give the number of copies");
    if (copies > 1'000'000) a.fail("count", "is above a million; give less");
    if (a.has("childclass")) require_class(a, a.text("childclass"));
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
      rename(copy, names);
      merge(std::move(copy), frame * pose, to);
      append(lists, names, rename, i > 0);
      pose = {pose * offset, euler(double(i + 1) * angles)};
    }
  }
  void renumber(BodyDraft& b) {
    for (int& id : b.joint_ids) id = s_.next_id++;
    if (b.id >= 0) b.id = s_.next_id++;
    for (auto& child : b.children) renumber(child);
  }
  // Entries of the lists that name something of `names` are taken out, to be put back once for each copy. They count among the names then.
  // As in MuJoCo, actuators and equality constraints that name something else, too, are lost, and tendons whose geom and sidesite do not
  // stand on the same side.
  Lists split_lists(Names& names) {
    Lists taken;
    Names lost;
    Lists::for_each([&](auto list) {
      auto& all = draft_.lists.*list;
      std::decay_t<decltype(all)> kept;
      for (auto& entry : all) {
        auto& d = description_of(entry);
        using D = std::decay_t<decltype(d)>;
        bool any = false, only = true, broken = false;
        for_each_reference(d, [&](Kind kind, std::string const& name) {
          bool const in = names.has(kind, name);
          any = any || in, only = only && in, broken = broken || lost.has(kind, name);
        });
        if constexpr (std::same_as<D, TendonDescription>)
          for (auto const& item : d.path)
            broken = broken || (!item.sidesite.empty() && names.has(Kind::geom, item.name) != names.has(Kind::site, item.sidesite));
        if constexpr (std::same_as<D, ActuatorDescription> || std::same_as<D, EqualityDescription>) broken = broken || (any && !only);
        auto* name = own_name(d);
        if (broken) {
          note(Line::left_out, d.place, "entries that name what is replicated and what is not, as MuJoCo does");
          if (name) lost.add(own_kind(d), *name);
          continue;
        }
        if (any && name) names.add(own_kind(d), *name);
        (any ? taken.*list : kept).push_back(std::move(entry));
      }
      all = std::move(kept);
    });
    return taken;
  }
  void append(Lists lists, Names const& names, Rename const& rename, bool fresh) {
    count(lists.size(), {file_, 1});
    Lists::for_each([&](auto list) {
      for (auto& entry : lists.*list) {
        auto& d = description_of(entry);
        if (auto* name = own_name(d)) rename(*name);
        for_each_reference(d, [&](Kind kind, std::string& name) {
          if (names.has(kind, name)) rename(name);
        });
        if constexpr (requires { entry.inheritrange; })
          if (fresh) entry.id = s_.next_id++;
        (draft_.lists.*list).push_back(std::move(entry));
      }
    });
  }

  // A body of another model, or all of its world, with what refers to nothing else of it.
  void attach(Node const& node, BodyDraft& to, Pose const& frame) {
    if (!check(node)) return;
    Attributes const a(s_.files, node, nullptr);
    if (!a.own("model")) a.fail("model", "is missing; name a <model> of <asset> (attaching a model to itself is not supported)");
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
    prefix_assets(piece, rename);
    rename(piece, names);
    merge(std::move(piece), frame, to);
    auto const adopt = [&](auto& from, auto& into) {
      for (auto& x : from) {
        rename(x.name);
        bool const there = std::any_of(into.begin(), into.end(), [&](auto const& y) { return y.name == x.name; });
        names.add(Kind::mesh, x.name);
        if (!there) into.push_back(std::move(x));
      }
    };
    adopt(child.meshes, draft_.meshes), adopt(child.hfields, draft_.hfields);

    Lists::for_each([&](auto list) {
      for (auto& entry : child.lists.*list) {
        auto& d = description_of(entry);
        bool all = true;
        for_each_reference(d, [&](Kind kind, std::string const& name) { all = all && names.has(kind, name); });
        if (!all) continue;
        if (auto* name = own_name(d)) names.add(own_kind(d), *name), rename(*name);
        for_each_reference(d, [&](Kind, std::string& name) { rename(name); });
        (draft_.lists.*list).push_back(std::move(entry));
      }
    });
    for (auto key : child.keys) {
      rename(key.key.name);
      draft_.keys.push_back(std::move(key));
    }
  }
  static void prefix_assets(BodyDraft& b, Rename const& rename) {
    for (auto& g : b.body.geoms) rename(g.mesh), rename(g.hfield);
    for (auto& child : b.children) prefix_assets(child, rename);
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
    if (reader.has_option_) note(Line::no_effect, root.place, "<option> of an attached model: the attaching model's holds");
    auto const key = [](CompilerDescription const& c) {
      return std::tuple(c.inertia_from_geom_always, c.inertia_from_geom_never, c.inertia_group_range, c.boundmass, c.boundinertia,
                        c.settotalmass, c.balanceinertia, c.fit_aabb);
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
  // The keyframe of an attached model as values by joint, actuator and mocap body.
  void split_key(ModelDraft const& model, KeyDraft& key) const {
    if (key.attached) return;
    key.attached = true;
    struct Part {
      char const* what;
      std::vector<double>& all;
      std::map<int, std::vector<double>>& by_id;
      std::size_t at = 0;
    };
    auto& k = key.key;
    Part qpos{"qpos", k.qpos, key.qpos}, qvel{"qvel", k.qvel, key.qvel}, act{"act", k.act, key.act}, ctrl{"ctrl", k.ctrl, key.ctrl},
        mpos{"mpos", k.mpos, key.mpos}, mquat{"mquat", k.mquat, key.mquat};
    auto const take = [](Part& part, int id, int n) {
      if (!part.all.empty() && n > 0) {
        auto const begin = std::min(part.at, part.all.size()), end = std::min(part.at + std::size_t(n), part.all.size());
        part.by_id[id].assign(part.all.begin() + std::ptrdiff_t(begin), part.all.begin() + std::ptrdiff_t(end));
      }
      part.at += std::size_t(n);
    };
    for_each_joint(model.world, [&](int id, JointDescription const& j, BodyDescription const&) {
      take(qpos, id, qpos_size(j.type)), take(qvel, id, qvel_size(j.type));
    });
    for (auto const& a : model.lists.actuators) take(act, a.id, act_size(a.actuator)), take(ctrl, a.id, 1);
    for_each_body(model.world, [&](BodyDraft const& b) {
      if (b.body.mocap) take(mpos, b.id, 3), take(mquat, b.id, 4);
    });
    for (Part* part : {&qpos, &qvel, &act, &ctrl, &mpos, &mquat}) {
      if (!part->all.empty() && part->all.size() != part->at)
        s_.files.fail(k.place, "<key>: attribute '" + std::string(part->what) + "' has " + std::to_string(part->all.size()) +
                                   " numbers and the model needs " + std::to_string(part->at) + "; correct the list");
      part->all.clear();
    }
  }

  // ---- lists that refer to bodies and joints by name

  void contacts(Node const& node) {
    check(node);
    for (auto const& child : node.children) {
      if (!check(child)) continue;
      count(1, child.place);
      if (child.name == "pair") {
        auto const a = attributes(child, "pair", "");
        PairDescription p;
        p.place = child.place, p.name = a.own("name") ? a.text("name") : "";
        if (!a.own("geom1") || !a.own("geom2")) a.fail("", "needs geom1 and geom2; give both");
        p.geom1 = a.text("geom1"), p.geom2 = a.text("geom2");
        auto const optional = [&](char const* name, auto& to) {
          if (!a.has(name)) return;
          if constexpr (requires { to->size(); })
            to.emplace(), a.numbers(name, *to, false);
          else if constexpr (std::same_as<std::decay_t<decltype(*to)>, int>)
            a.integer(name, to.emplace());
          else
            a.number(name, to.emplace());
        };
        optional("condim", p.condim), optional("margin", p.margin), optional("gap", p.gap);
        optional("solreffriction", p.solreffriction);
        if (a.has("solref")) p.solref = SoftnessDescription{}.solref, a.numbers("solref", *p.solref, false);
        if (a.has("friction")) p.friction = {1, 1, 0.005, 0.0001, 0.0001}, a.numbers("friction", *p.friction, false);
        if (a.has("solimp")) p.solimp = SoftnessDescription{}.solimp, a.numbers("solimp", *p.solimp, false);
        draft_.lists.pairs.push_back(std::move(p));
        continue;
      }
      Attributes const a(s_.files, child, nullptr);
      if (!a.own("body1") || !a.own("body2")) a.fail("", "needs body1 and body2; give both");
      draft_.lists.excludes.push_back({a.text("body1"), a.text("body2"), child.place});
    }
  }

  void equalities(Node const& node) {
    check(node);
    for (auto const& child : node.children) {
      if (find_refused(child.name)) {
        refuse_element(child, "<equality> ");
        continue;
      }
      check(child, "equality/" + child.name);
      count(1, child.place);
      auto const a = attributes(child, "equality", "");
      EqualityDescription e;
      e.place = child.place, e.name = a.own("name") ? a.text("name") : "";
      a.boolean("active", e.active), softness(a, e.softness, "");
      e.data[10] = 1;
      auto const two = [&](std::string const& kind) {
        if (!a.own(kind + "1")) a.fail(kind + "1", "is missing; name the first " + kind);
        e.name1 = a.text(kind + "1"), e.name2 = a.text(kind + "2");
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
        if (weld) a.numbers("relpose", e.data.data() + 3, 7), a.number("torquescale", e.data[10]);
      }
      draft_.lists.equalities.push_back(std::move(e));
    }
  }

  void tendons(Node const& node) {
    check(node);
    for (auto const& child : node.children) {
      if (!check(child)) continue;
      count(1 + child.children.size(), child.place);
      auto const a = attributes(child, "tendon", "");
      TendonDescription t;
      t.place = child.place, t.name = a.own("name") ? a.text("name") : "";
      a.numbers("range", t.range), a.numbers("actuatorfrcrange", t.actuator_force_range);
      t.limited = limited(a, "limited", "range", t.range);
      t.actuator_force_limited = limited(a, "actuatorfrclimited", "actuatorfrcrange", t.actuator_force_range);
      std::array<double, 2> spring{-1, -1};
      if (a.numbers("springlength", spring, false))
        t.springlength = words(a.text("springlength")).size() == 1 ? std::array{spring[0], spring[0]} : spring;
      polynomial(a, "stiffness", t.stiffness, t.stiffness_poly), polynomial(a, "damping", t.damping, t.damping_poly);
      a.number("frictionloss", t.frictionloss), a.number("armature", t.armature), a.number("margin", t.margin);
      softness(a, t.limit, "limit"), softness(a, t.friction, "friction");
      for (auto const& part : child.children) {
        check(part, child.name + "/" + part.name);
        Attributes const b(s_.files, part, nullptr);
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
      draft_.lists.tendons.push_back(std::move(t));
    }
  }

  void actuators(Node const& node) {
    check(node);
    for (auto const& child : node.children) {
      if (find_refused(child.name)) {
        refuse_element(child, "<actuator> ");
        continue;
      }
      if (!check(child)) continue;
      count(1, child.place);
      auto const a = attributes(child, "actuator", "");
      ActuatorDraft draft;
      auto& act = draft.actuator;
      draft.id = s_.next_id++;
      act.place = child.place, act.name = a.own("name") ? a.text("name") : "";
      constexpr std::pair<char const*, Transmission> targets[] = {
          {"joint", Transmission::joint}, {"jointinparent", Transmission::joint_in_parent}, {"tendon", Transmission::tendon},
          {"site", Transmission::site},   {"cranksite", Transmission::slider_crank},        {"body", Transmission::body}};
      int given = 0;
      for (auto const& [word, target] : targets)
        if (a.own(word)) ++given, act.target = target, act.target_name = a.text(word);
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
      a.numbers("gear", act.gear, false), a.integer("group", act.group), a.number("armature", act.armature);
      std::array<double, 2> higher{0, 0};
      polynomial(a, "damping", act.damping, higher);
      if (higher != std::array<double, 2>{})
        refuse(child.place, "<" + child.name + "> damping has coefficients of higher order, which are not supported yet; give one number");
      Law const law = changed_law(class_of(child, "").laws, s_.files, child);
      bool const range_given = a.own("ctrlrange") || a.own("actrange");
      draft.inheritrange = range_given && !a.own("inheritrange") ? 0 : law.inheritrange;
      std::string const own_range = law.dyntype == "integrator" ? "actrange" : "ctrlrange";
      if (draft.inheritrange > 0 && a.own(own_range)) a.fail("inheritrange", "stands beside " + own_range + "; keep one");
      bool const is_inherited = draft.inheritrange > 0;
      auto const range = [&](char const* name, char const* flag, std::array<double, 2>& r) {
        if (is_inherited && own_range == name) return true;  // comes from the target
        a.numbers(name, r);
        return limited(a, flag, name, r);
      };
      act.ctrl_limited = range("ctrlrange", "ctrllimited", act.ctrl_range) || law.ctrl_limited;
      act.force_limited = range("forcerange", "forcelimited", act.force_range);
      act.act_limited = range("actrange", "actlimited", act.act_range);
      act.has_length_range = a.numbers("lengthrange", act.length_range);
      a.boolean("actearly", act.act_early);
      settle(law, a, act);
      int actdim = -1;
      if (a.integer("actdim", actdim) && actdim >= 0 && actdim != act_size(act))
        a.fail("actdim", "is not the number of activations of this dyntype; remove it");
      if (law.ctrl_limited && (act.ctrl_range[0] < 0 || act.ctrl_range[1] < 0))
        a.fail("ctrlrange", "has a negative number; give zero or more");
      if (act.act_limited && act.dynamics == ActuatorDynamics::none) a.fail("actrange", "is for actuators with an activation; set dyntype");
      draft_.lists.actuators.push_back(std::move(draft));
    }
  }

  void sensors(Node const& node) {
    for (auto const& child : node.children) {
      if (find_refused(child.name)) {
        refuse_element(child, "<sensor> ");
        continue;
      }
      if (!find_schema("sensor/" + child.name))
        s_.files.fail(child.place, "unknown element " + in_quotes(child.name) + " in <sensor>; correct or remove it");
      if (!check(child, "sensor/" + child.name)) continue;
      count(1, child.place);
      draft_.lists.sensors.push_back(read_sensor(Attributes(s_.files, child, nullptr), child.name));
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
      k.key.qpos = a.list("qpos"), k.key.qvel = a.list("qvel"), k.key.act = a.list("act"), k.key.ctrl = a.list("ctrl");
      k.key.mpos = a.list("mpos"), k.key.mquat = a.list("mquat");
      draft_.keys.push_back(std::move(k));
    }
  }

 private:
  Session& s_;
  int file_;
  ModelDraft draft_;
  bool degrees_ = true, autolimits_ = true, in_default_ = false, has_option_ = false, strip_path_ = false;
  std::string eulerseq_ = "xyz", main_name_ = "main", mesh_folder_;
  std::unordered_map<std::string, Class> classes_;
  std::unordered_map<std::string, std::array<float, 4>> materials_;
  std::unordered_map<std::string, std::string> missing_;  // assets whose file cannot be read, and why
  std::unordered_map<std::string, Node> models_;
};

}  // namespace gsp::io::detail::mjcf
