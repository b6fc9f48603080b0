#pragma once
#include <algorithm>
#include <filesystem>
#include <functional>
#include <gsp/io/convex_parts.hpp>
#include <gsp/io/detail/load_report.hpp>
#include <gsp/io/detail/mjcf_values.hpp>
#include <gsp/io/detail/mjcf_xml.hpp>
#include <gsp/io/detail/urdf_options.hpp>
#include <gsp/io/detail/urdf_schema.hpp>
#include <gsp/io/mesh.hpp>
#include <gsp/io/mesh_hull.hpp>
#include <gsp/model/description.hpp>
#include <gsp/model/detail/host_math.hpp>
#include <limits>
#include <map>
#include <set>
#include <string>
#include <utility>
#include <vector>

namespace gsp::io {

namespace detail::urdf {

using mjcf::Attributes;
using mjcf::Node;

/// A document becomes a Description: links are bodies in depth-first order, a joint belongs to the body of its child link.
class Reader {
 public:
  Reader(mjcf::Files& files, UrdfOptions const& options) : files_(files), options_(options) {}

  Description run(Node const& root) {
    if (root.name != "robot") files_.fail(root.place, "the root element is " + in_quotes(root.name) + "; a URDF model is <robot>");
    check(root);
    if (auto const* name = root.find("name")) d_.name = *name;
    d_.compiler.inertia_from_geom_never = true;  // URDF: a link without <inertial> weighs nothing
    colours(root);
    for (auto const& n : root.children)
      if (n.name == "mujoco") compiler(n);
    tree(root);
    bodies();
    mimics();
    d_.files = files_.names;
    if (options_.convex_decomposition) split_into_convex_parts(d_);
    add_hulls(d_);
    for (auto const& place : files_.stray_text) note(Kind::no_effect, place, "text between elements");
    d_.report = report_.take();
    return std::move(d_);
  }

 private:
  using Kind = ReportLine::Kind;
  struct Link {
    Node const* node = nullptr;
    Node const* joint = nullptr;  // that moves it; none: the root
    std::vector<int> children{};
    int body = -1;
  };

  // ---- strictness

  void note(Kind kind, Place const& place, std::string const& text) {
    report_.add(kind, files_.names[std::size_t(place.file)], place.line, text);
  }
  void refuse(Place const& place, std::string const& sentence) {
    if (!options_.list_refusals) files_.fail(place, sentence);
    note(Kind::refused, place, sentence);
  }
  void check(Node const& node) {
    auto const* e = find_schema(node.name);
    for (auto const& a : node.attributes) {
      if (mjcf::is_in(e->honoured, a.name)) continue;
      if (!mjcf::is_in(e->no_effect, a.name) && a.name.find(':') == std::string::npos && a.name != "xmlns")
        files_.fail(node.place, "unknown attribute " + in_quotes(a.name) + " of <" + node.name + ">; correct or remove it");
      note(Kind::no_effect, node.place, "<" + node.name + "> " + a.name);
    }
    for (auto const& child : node.children) {
      if (mjcf::is_in(e->children, child.name)) {
        check(child);
        continue;
      }
      if (child.name.rfind("xacro:", 0) == 0)
        files_.fail(child.place, "<" + child.name + "> is a macro that is not expanded; run xacro over the file first");
      if (!mjcf::is_in(e->ignored, child.name) && child.name.find(':') == std::string::npos)
        files_.fail(child.place, "unknown element " + in_quotes(child.name) + " in <" + node.name + ">; correct or remove it");
      note(child.name == "texture" ? Kind::visual_only : Kind::no_effect, child.place, "<" + node.name + "> <" + child.name + ">");
    }
  }
  // The child of that name; none: nullptr.
  Node const* one(Node const& node, std::string_view name) const {
    Node const* found = nullptr;
    for (auto const& child : node.children) {
      if (child.name != name) continue;
      if (found) files_.fail(child.place, "a second <" + std::string(name) + "> in one <" + node.name + ">; keep one");
      found = &child;
    }
    return found;
  }
  Attributes of(Node const& node) const { return {files_, node, nullptr}; }
  double required(Node const& node, std::string_view name) const {
    auto const a = of(node);
    double value = 0;
    if (!a.number(name, value)) a.fail(name, "is missing; give a number");
    return value;
  }
  std::string required_text(Node const& node, std::string_view name) const {
    auto const* text = node.find(name);
    if (!text || text->empty()) of(node).fail(name, "is missing; give it");
    return *text;
  }
  std::string required_link(Node const& joint, char const* end) const {
    auto const* node = one(joint, end);
    if (!node) of(joint).fail("", std::string("has no <") + end + ">; name the link");
    return required_text(*node, "link");
  }

  // ---- parts of links

  // Rotation by roll, pitch, yaw about the fixed axes x, y, z; or a quaternion x y z w.
  gsp::detail::Pose origin(Node const& node) const {
    gsp::detail::Pose pose;
    auto const* n = one(node, "origin");
    if (!n) return pose;
    auto const a = of(*n);
    Double3 rpy{0, 0, 0};
    Double4 q{0, 0, 0, 1};
    a.numbers("xyz", pose.p);
    if (a.numbers("quat_xyzw", q)) {
      if (a.own("rpy")) a.fail("quat_xyzw", "stands beside rpy; keep one");
      if (!(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3] > 1e-20)) a.fail("quat_xyzw", "is zero; give a rotation");
      pose.q = gsp::detail::normalized({q[3], q[0], q[1], q[2]});
    } else if (a.numbers("rpy", rpy)) {
      using gsp::detail::axis_angle;
      using gsp::detail::times;
      pose.q = times(axis_angle({0, 0, 1}, rpy[2]), times(axis_angle({0, 1, 0}, rpy[1]), axis_angle({1, 0, 0}, rpy[0])));
    }
    return pose;
  }

  using Colour = std::array<float, 4>;
  Colour colour(Node const& node) const {
    std::array<double, 4> rgba{};
    auto const a = of(node);
    if (!a.numbers("rgba", rgba)) a.fail("rgba", "is missing; give red green blue alpha");
    return {float(rgba[0]), float(rgba[1]), float(rgba[2]), float(rgba[3])};
  }
  // Materials that are given a colour anywhere: the robot's, then those of links.
  void colours(Node const& root) {
    auto const add = [&](Node const& n) {
      auto const* name = n.find("name");
      auto const* c = one(n, "color");
      bool const texture = std::any_of(n.children.begin(), n.children.end(), [](auto const& x) { return x.name == "texture"; });
      if (name && !name->empty() && (c || texture)) colours_.emplace(*name, c ? colour(*c) : GeomDescription{}.rgba);
    };
    for (auto const& n : root.children)
      if (n.name == "material") add(n);
    for (auto const& link : root.children)
      for (auto const& visual : link.children)
        for (auto const& n : visual.children)
          if (link.name == "link" && visual.name == "visual" && n.name == "material") add(n);
  }
  void compiler(Node const& node) {
    for (auto const& n : node.children) {
      if (n.name != "compiler") continue;
      auto const a = of(n);
      a.boolean("balanceinertia", d_.compiler.balanceinertia);
      a.number("boundmass", d_.compiler.boundmass);
      a.number("boundinertia", d_.compiler.boundinertia);
    }
  }

  void inertial(Node const& node, BodyDescription& body) const {
    auto const pose = origin(node);
    auto const *mass = one(node, "mass"), *inertia = one(node, "inertia");
    if (!mass) of(node).fail("", "has no <mass>; give its value in kg");
    if (!inertia) of(node).fail("", "has no <inertia>; give ixx ixy ixz iyy iyz izz in kg m^2");
    body.has_inertial = true;
    auto& i = body.inertial;
    i.pos = pose.p;
    i.quat = pose.q;
    i.mass = required(*mass, "value");
    char const* const names[] = {"ixx", "iyy", "izz", "ixy", "ixz", "iyz"};
    for (std::size_t k = 0; k < 6; ++k) i.inertia[k] = required(*inertia, names[k]);
    if (i.mass < 0) of(*mass).fail("value", "is negative; give kg");
  }

  void geom(Node const& node, BodyDescription& body) {
    bool const visual = node.name == "visual";
    auto const* geometry = one(node, "geometry");
    if (!geometry || geometry->children.size() != 1) of(node).fail("", "needs one <geometry> with one shape; give it");
    GeomDescription g;
    g.place = node.place;
    auto const pose = origin(node);
    g.pos = pose.p;
    g.quat = pose.q;
    g.has_mass = true;
    g.mass = 0;  // <inertial> says all
    if (visual) {
      g.contype = g.conaffinity = 0;
      g.group = 1;
    }
    auto const& shape = geometry->children[0];
    if (shape.name == "box") {
      Double3 size{};
      if (!of(shape).numbers("size", size)) of(shape).fail("size", "is missing; give three lengths");
      g.type = ShapeType::box;
      g.size = {size[0] / 2, size[1] / 2, size[2] / 2};
    } else if (shape.name == "sphere") {
      g.type = ShapeType::sphere;
      g.size = {required(shape, "radius"), 0, 0};
    } else if (shape.name == "mesh") {
      if (!mesh(shape, visual, g)) return;
    } else {
      g.type = shape.name == "cylinder" ? ShapeType::cylinder : ShapeType::capsule;
      g.size = {required(shape, "radius"), required(shape, "length") / 2, 0};
    }
    if (auto const* m = visual ? one(node, "material") : nullptr) {
      auto const* name = m->find("name");
      if (auto const* c = one(*m, "color"))
        g.rgba = colour(*c);
      else if (auto const found = colours_.find(name ? *name : ""); found != colours_.end())
        g.rgba = found->second;
      else if (std::none_of(m->children.begin(), m->children.end(), [](auto const& x) { return x.name == "texture"; }))
        of(*m).fail("", "has neither a color nor the name of a material that has one; give one of the two");
    }
    if (auto const* name = node.find("name"); name && !name->empty()) {  // collisions and visuals may share names in URDF
      if (geom_names_.insert(*name).second)
        g.name = *name;
      else
        note(Kind::no_effect, node.place, "<" + node.name + "> name: one that is taken already");
    }
    body.geoms.push_back(std::move(g));
  }

  // ---- meshes

  std::filesystem::path resolve(Node const& node, std::string const& name) const {
    if (name.rfind("file://", 0) == 0) return name.substr(7);
    bool const package = name.rfind("package://", 0) == 0, model = name.rfind("model://", 0) == 0;
    if (!package && !model) return files_.resolve(node.place, name);
    std::string const rest = name.substr(package ? 10 : 8);
    auto const slash = rest.find('/');
    std::string const who = rest.substr(0, slash), inside = slash == std::string::npos ? "" : rest.substr(slash + 1);
    if (auto const found = options_.packages.find(who); found != options_.packages.end()) return found->second / inside;
    std::error_code error;
    auto folder = std::filesystem::absolute(files_.folders[0], error).lexically_normal();
    for (int up = 0; up < 64 && !error; ++up, folder = folder.parent_path()) {
      if (folder.filename() == who) return folder / inside;
      if (std::error_code e; std::filesystem::is_directory(folder / who, e)) return folder / who / inside;
      if (folder == folder.parent_path()) break;
    }
    files_.fail(node.place,
                "<mesh> names the package " + in_quotes(who) +
                    ", which is no folder above the file or beside one of them; say where it is with --package (UrdfOptions::packages)");
  }
  // One asset for each file and scale. A visual one that cannot be read is left out with skip_visuals, or listed with list_refusals.
  bool mesh(Node const& node, bool visual, GeomDescription& g) {
    std::string const name = required_text(node, "filename");
    Double3 scale{1, 1, 1};
    of(node).numbers("scale", scale);
    g.type = ShapeType::mesh;
    auto const known = meshes_.find({name, scale});
    if (known != meshes_.end()) {
      g.mesh = known->second;
      return !g.mesh.empty();
    }
    auto& asset = meshes_[{name, scale}];
    try {
      auto const path = resolve(node, name);
      std::string ignored;
      auto mesh = parse_mesh(files_.load(node.place, path), path.string(), {}, &ignored);
      if (!ignored.empty()) note(Kind::left_out, node.place, "mesh " + in_quotes(name) + ": " + ignored);
      mesh.scale = scale;
      mesh.place = node.place;
      std::string const stem = path.stem().string().empty() ? "mesh" : path.stem().string();
      mesh.name = stem;
      for (int k = 2; !mesh_names_.insert(mesh.name).second; ++k) mesh.name = stem + "_" + std::to_string(k);
      asset = g.mesh = mesh.name;
      d_.meshes.push_back(std::move(mesh));
      return true;
    } catch (Error const& error) {
      std::string const what = error.what(), place = files_.at(node.place);
      std::string const sentence = what.rfind(place, 0) == 0 ? what.substr(place.size()) : what;
      if (visual && options_.skip_visuals)
        note(Kind::left_out, node.place, "visual mesh " + in_quotes(name) + " (" + sentence + ")");
      else
        refuse(node.place, sentence);
    }
    return false;
  }

  // ---- tree and joints

  void tree(Node const& root) {
    std::map<std::string, int, std::less<>> names;
    for (auto const& n : root.children) {
      if (n.name != "link") continue;
      if (!names.emplace(required_text(n, "name"), int(links_.size())).second)
        of(n).fail("name", "is " + in_quotes(*n.find("name")) + ", which another link has; rename one of the two");
      links_.push_back({&n});
      if (links_.size() > 100'000) files_.fail(n.place, "the model has more than 100,000 links; split it");
    }
    if (links_.empty()) files_.fail(root.place, "the robot has no <link>; give at least one");
    std::vector<int> parent(links_.size(), -1);
    for (auto const& n : root.children) {
      if (n.name != "joint") continue;
      std::string const name = required_text(n, "name");
      if (!joints_.emplace(name, &n).second)
        of(n).fail("name", "is " + in_quotes(name) + ", which another joint has; rename one of the two");
      auto const link = [&](char const* end) {
        std::string const which = required_link(n, end);
        auto const found = names.find(which);
        if (found == names.end())
          of(n).fail("", std::string("has the ") + end + " link " + in_quotes(which) + ", which does not exist; correct the name");
        return found->second;
      };
      int const from = link("parent"), to = link("child");
      auto& child = links_[std::size_t(to)];
      if (child.joint)
        of(n).fail("", "moves the link " + in_quotes(*child.node->find("name")) + ", which joint " + in_quotes(*child.joint->find("name")) +
                           " moves already; URDF knows trees only, remove one");
      child.joint = &n;
      parent[std::size_t(to)] = from;
    }
    for (int i = 0; i < int(links_.size()); ++i) {
      if (links_[std::size_t(i)].joint) {
        links_[std::size_t(parent[std::size_t(i)])].children.push_back(i);
        continue;
      }
      if (root_ >= 0)
        of(*links_[std::size_t(i)].node)
            .fail("", "and link " + in_quotes(*links_[std::size_t(root_)].node->find("name")) +
                          " are both without a joint above them; join them, a robot has one root");
      root_ = i;
    }
    if (root_ < 0) files_.fail(root.place, "every link has a joint above it, so the joints go in a circle; a robot has one root");
  }

  void bodies() {
    std::vector<std::pair<int, int>> todo{{root_, 0}};  // link and the body above it
    while (!todo.empty()) {
      auto const [index, above] = todo.back();
      todo.pop_back();
      auto& link = links_[std::size_t(index)];
      auto const& node = *link.node;
      bool const is_world = !link.joint && *node.find("name") == "world";
      if (is_world && options_.floating_base)
        of(node).fail("", "is the root and stands for the world, which cannot float; leave out floating_base");
      if (is_world) {
        link.body = 0;
      } else {
        link.body = int(d_.bodies.size());
        d_.bodies.emplace_back();
      }
      auto& body = d_.bodies[std::size_t(link.body)];
      body.place = node.place;
      if (!is_world) {
        body.name = *node.find("name");
        body.parent = above;
        if (body.name == "world") of(node).fail("name", "is the world's and not the root's; rename the link");
        if (auto const* n = one(node, "inertial")) inertial(*n, body);
      } else if (one(node, "inertial")) {
        note(Kind::no_effect, node.place, "<inertial> of the world");
      }
      if (link.joint)
        joint(*link.joint, body);
      else if (options_.floating_base)
        add(body, node, "floating_base", JointType::free, {0, 0, 1});
      for (auto const& n : node.children)
        if (n.name == "collision" || n.name == "visual") geom(n, body);
      for (auto child = link.children.rbegin(); child != link.children.rend(); ++child) todo.emplace_back(*child, link.body);
      ++reached_;
    }
    if (reached_ < links_.size())
      for (auto const& link : links_)
        if (link.body < 0) of(*link.node).fail("", "hangs on a circle of joints; a robot is a tree");
    // what moves needs mass, its own or that of links fixed to it
    std::vector<char> weighs(d_.bodies.size(), 0);
    for (std::size_t b = d_.bodies.size() - 1; b > 0; --b) {
      auto const& body = d_.bodies[b];
      weighs[b] = weighs[b] || body.inertial.mass > 0;
      if (body.joints.empty())
        weighs[std::size_t(body.parent)] |= weighs[b];
      else if (!weighs[b])
        files_.fail(body.place, "link " + in_quotes(body.name) + " moves and has no " + (body.has_inertial ? "mass" : "<inertial>") +
                                    ", nor has a link that is fixed to it; give it one");
    }
  }

  JointDescription& add(BodyDescription& body, Node const& node, std::string name, JointType type, Double3 const& axis) {
    JointDescription j;
    j.name = std::move(name);
    j.type = type;
    j.axis = axis;
    j.place = node.place;
    body.joints.push_back(std::move(j));
    return body.joints.back();
  }

  void joint(Node const& node, BodyDescription& body) {
    auto const pose = origin(node);
    body.pos = pose.p;
    body.quat = pose.q;
    std::string const& name = *node.find("name");
    int const kind = of(node).choice("type", {"fixed", "revolute", "continuous", "prismatic", "floating", "planar"});
    bool const single = kind >= 1 && kind <= 3;
    auto const *limit = one(node, "limit"), *dynamics = one(node, "dynamics"), *mimic = one(node, "mimic"), *axis_node = one(node, "axis");
    Double3 axis{1, 0, 0};
    if (axis_node) {
      of(*axis_node).numbers("xyz", axis);
      double const n = gsp::detail::norm(axis);
      if (kind != 0 && kind != 4) {
        if (!(n > 1e-9)) of(*axis_node).fail("xyz", "is a direction of length zero; give a direction");
        axis = {axis[0] / n, axis[1] / n, axis[2] / n};
      }
    }
    if (!single) {
      for (auto const* n : {limit, dynamics, kind == 5 ? nullptr : axis_node})
        if (n) note(Kind::no_effect, n->place, "<" + n->name + "> of a fixed, floating or planar joint");
      if (mimic) of(*mimic).fail("", "is of a joint that is not revolute, continuous or prismatic; remove it");
    }
    if (kind == 0) return;
    if (kind == 4 && body.parent == 0) {
      add(body, node, name, JointType::free, {0, 0, 1});
      return;
    }
    if (kind >= 4) {  // below a body that moves or is fixed: slides and a ball or a hinge
      auto const turn = kind == 4 ? Double4{1, 0, 0, 0} : gsp::detail::quat_of_z(axis);
      char const* const suffix[] = {"_TX", "_TY", "_TZ"};
      for (std::size_t k = 0; k < (kind == 4 ? 3u : 2u); ++k) {
        Double3 along{0, 0, 0};
        along[k] = 1;
        add(body, node, name + suffix[k], JointType::slide, gsp::detail::rotate(turn, along));
      }
      if (kind == 4)
        add(body, node, name + "_R", JointType::ball, {0, 0, 1});
      else
        add(body, node, name + "_RZ", JointType::hinge, axis);
      return;
    }
    auto& j = add(body, node, name, kind == 3 ? JointType::slide : JointType::hinge, axis);
    if (!limit && kind != 2)
      of(node).fail("", "is " + *node.find("type") + " and has no <limit>; give lower and upper, or make it continuous");
    if (limit) {
      auto const a = of(*limit);
      double effort = 0;
      a.number("lower", j.range[0]);
      a.number("upper", j.range[1]);
      if (kind == 2) {
        if (a.own("lower") || a.own("upper")) note(Kind::no_effect, limit->place, "<limit> lower and upper of a continuous joint");
        j.range = {0, 0};
      } else {
        if (!(j.range[0] < j.range[1]))
          a.fail("", "of joint " + in_quotes(name) + " leaves no way between lower and upper; order them, or make the joint fixed");
        j.limited = true;
      }
      if (a.number("effort", effort)) {
        if (effort < 0) a.fail("effort", "is negative; give N or N m");
        if (effort > 0) {
          j.actuator_force_limited = true;
          j.actuator_force_range = {-effort, effort};
        } else
          note(Kind::no_effect, limit->place, "<limit> effort of zero");
      }
    }
    if (dynamics) {
      auto const a = of(*dynamics);
      a.number("damping", j.damping);
      a.number("friction", j.frictionloss);
      if (j.damping < 0 || j.frictionloss < 0) a.fail("", "of joint " + in_quotes(name) + " is negative; give zero or more");
    }
    if (mimic) mimics_.push_back(&node);
  }

  // q = offset + multiplier q_other
  void mimics() {
    for (auto const* node : mimics_) {
      auto const& mimic = *one(*node, "mimic");
      EqualityDescription e;
      e.type = EqualityType::joint;
      e.name1 = *node->find("name");
      e.name2 = required_text(mimic, "joint");
      e.place = mimic.place;
      auto const found = joints_.find(e.name2);
      if (found == joints_.end() || e.name2 == e.name1)
        of(mimic).fail("joint", "is " + in_quotes(e.name2) + ", which is no other joint; correct the name");
      std::string const* type = found->second->find("type");
      if (*type != "revolute" && *type != "continuous" && *type != "prismatic")
        of(mimic).fail("joint",
                       "is " + in_quotes(e.name2) + ", which is " + *type + "; name one that is revolute, continuous or prismatic");
      double multiplier = 1, offset = 0;
      of(mimic).number("multiplier", multiplier);
      of(mimic).number("offset", offset);
      e.data = {offset, multiplier};
      d_.equalities.push_back(std::move(e));
    }
  }

  mjcf::Files& files_;
  UrdfOptions const& options_;
  Report report_;
  Description d_;
  std::map<std::string, Colour, std::less<>> colours_;
  std::set<std::string> geom_names_, mesh_names_;
  std::map<std::pair<std::string, Double3>, std::string> meshes_;  // file as written and scale -> asset, empty: left out
  std::vector<Link> links_;
  std::map<std::string, Node const*, std::less<>> joints_;
  std::vector<Node const*> mimics_;
  int root_ = -1;
  std::size_t reached_ = 0;
};

}  // namespace detail::urdf
}  // namespace gsp::io
