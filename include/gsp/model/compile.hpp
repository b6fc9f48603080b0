#pragma once
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <gsp/core/check.hpp>
#include <gsp/model/compiled.hpp>
#include <gsp/model/detail/initial_inertia.hpp>
#include <gsp/model/detail/mesh_geoms.hpp>
#include <gsp/model/detail/principal_axes.hpp>
#include <gsp/model/detail/shape_inertia.hpp>
#include <optional>
#include <set>
#include <string>
#include <unordered_map>
#include <utility>
#include <vector>

namespace gsp {

struct CompileOptions {
  bool approximate = false;  // besides Description::compiler.approximate: see there
};

namespace detail {

inline char const* shape_name(ShapeType type) {
  char const* const names[] = {"plane", "hfield", "sphere", "capsule", "ellipsoid", "cylinder", "box", "mesh"};
  return names[int(type)];
}
/// Contacts between these two shapes are computed (collision/): plane, sphere and capsule against all five, and two boxes.
inline bool is_covered_pair(int a, int b) {
  auto const simple = [](int t) { return t == int(ShapeType::plane) || t == int(ShapeType::sphere) || t == int(ShapeType::capsule); };
  auto const known = [&](int t) { return simple(t) || t == int(ShapeType::cylinder) || t == int(ShapeType::box); };
  return (simple(a) && known(b)) || (simple(b) && known(a)) || (a == int(ShapeType::box) && b == int(ShapeType::box));
}

class Compiler {
 public:
  Compiler(Description const& d, CompileOptions const& o) : d_(d), approximate_(o.approximate || d.compiler.approximate) {}
  CompiledModel run() {
    m_.name = d_.name, m_.option = d_.option, m_.report = d_.report;
    check_numbers();
    assets();
    bodies();
    trees();
    masses();
    tendons();
    actuators();
    constants();
    pairs();
    keyframes();
    return std::move(m_);
  }

 private:
  // "FILE:LINE: kind 'name' sentence"
  [[noreturn]] void fail(Place const& place, std::string const& what, std::string const& name, std::string const& sentence) const {
    throw Error(at(place) + what + (name.empty() ? "" : " '" + name + "'") + " " + sentence);
  }
  std::string at(Place const& place) const {
    if (place.file < 0 || place.file >= int(d_.files.size())) return d_.name.empty() ? "model: " : d_.name + ": ";
    return d_.files[place.file] + ":" + std::to_string(place.line) + ": ";
  }
  using Names = std::unordered_map<std::string, int>;
  void enter(Names& names, std::string const& name, Place const& place, char const* what) const {
    if (!name.empty() && !names.emplace(name, int(names.size())).second)
      fail(place, what, name, "has a name that is taken already: rename one of the two");
  }
  template <class A>
  static bool finite(A const& a) {
    return std::all_of(a.begin(), a.end(), [](double x) { return std::isfinite(x); });
  }
  void require_finite(bool ok, Place const& place, char const* what, std::string const& name) const {
    if (!ok) fail(place, what, name, "holds a number that is not finite: give it a value");
  }
  Double4 unit(Double4 const& q) const { return normalized(q); }
  static void require_range(Compiler const& c, bool limited, std::array<double, 2> const& range, Place const& place, char const* what,
                            std::string const& name, char const* attribute) {
    if (limited && !(range[0] < range[1]))
      c.fail(place, what, name,
             std::string("is limited, but the first number of its ") + attribute + " is not below the second: order them");
  }

  void check_numbers() const {
    if (!(d_.option.timestep > 0) || !std::isfinite(d_.option.timestep))
      throw Error(at({}) + "option timestep is not positive: give seconds, such as 0.002");
    if (!finite(d_.option.gravity)) throw Error(at({}) + "option gravity is not finite: give three numbers");
    if (d_.bodies.empty() || d_.bodies[0].parent != -1)
      throw Error(at({}) + "the first body of a Description is the world, with parent -1: start from a default Description");
    if (!d_.bodies[0].joints.empty())
      fail(d_.bodies[0].joints[0].place, "joint", d_.bodies[0].joints[0].name,
           "stands in the world, which cannot move: put it into a body");
  }

  void assets() {
    shapes_.emplace(d_, [this](auto const&... what) { fail(what...); });
    for (auto const& mesh : shapes_->meshes()) {
      m_.mesh_vertices.push_back(mesh.vertices), m_.mesh_faces.push_back(mesh.faces), m_.mesh_hull.push_back(mesh.hull);
      m_.mesh_pos.push_back(mesh.pos), m_.mesh_quat.push_back(mesh.quat), m_.mesh_name.push_back(d_.meshes[m_.nmesh++].name);
    }
    m_.hfields = shapes_->hfields(), m_.nhfield = int(m_.hfields.size());
  }
  GeomShape shape_of(GeomDescription const& g) const {
    return (*shapes_)(g, [this](auto const&... what) { fail(what...); });
  }

  void bodies() {
    std::vector<int> path;  // from the world to the body before
    Names body_names, joint_names, geom_names, site_names, camera_names;
    for (int b = 0; b < int(d_.bodies.size()); ++b) {
      auto const& body = d_.bodies[b];
      while (b > 0 && !path.empty() && path.back() != body.parent) path.pop_back();
      if (b > 0 && path.empty())
        fail(body.place, "body", body.name,
             "does not follow its parent depth first: list every body right after its parent or an earlier child's last descendant");
      path.push_back(b);
      enter(body_names, body.name, body.place, "body");
      require_finite(finite(body.pos) && finite(body.quat) && std::isfinite(body.gravcomp), body.place, "body", body.name);
      if (body.mocap) fail(body.place, "body", body.name, "is a mocap body, which is not supported yet: remove the attribute mocap");
      m_.body_parent.push_back(std::max(body.parent, 0)), m_.body_name.push_back(body.name);
      m_.body_pos.push_back(body.pos), m_.body_quat.push_back(unit(body.quat)), m_.body_gravcomp.push_back(body.gravcomp);
      m_.body_weld.push_back(b == 0 ? 0 : body.joints.empty() ? m_.body_weld[body.parent] : b);
      m_.body_jntadr.push_back(body.joints.empty() ? -1 : m_.njnt), m_.body_jntnum.push_back(int(body.joints.size()));
      m_.body_dofadr.push_back(body.joints.empty() ? -1 : m_.nv);
      for (auto const& j : body.joints) enter(joint_names, j.name, j.place, "joint"), joint(body, b, j);
      m_.body_dofnum.push_back(body.joints.empty() ? 0 : m_.nv - m_.body_dofadr[b]);
      m_.body_geomadr.push_back(body.geoms.empty() ? -1 : m_.ngeom), m_.body_geomnum.push_back(int(body.geoms.size()));
      for (auto const& g : body.geoms) enter(geom_names, g.name, g.place, "geom"), geom(b, g);
      for (auto const& s : body.sites) {
        enter(site_names, s.name, s.place, "site");
        require_finite(finite(s.pos) && finite(s.quat), s.place, "site", s.name);
        m_.site_body.push_back(b), m_.site_pos.push_back(s.pos), m_.site_quat.push_back(unit(s.quat)), m_.site_name.push_back(s.name),
            ++m_.nsite;
      }
      for (auto const& c : body.cameras) {
        enter(camera_names, c.name, c.place, "camera");
        require_finite(finite(c.pos) && finite(c.quat) && std::isfinite(c.fovy), c.place, "camera", c.name);
        m_.cam_body.push_back(b), m_.cam_pos.push_back(c.pos), m_.cam_quat.push_back(unit(c.quat)), m_.cam_fovy.push_back(c.fovy),
            m_.cam_name.push_back(c.name);
        ++m_.ncam;
      }
    }
    m_.nbody = int(d_.bodies.size());
  }

  void joint(BodyDescription const& body, int b, JointDescription const& j) {
    require_finite(finite(j.pos) && finite(j.axis) && finite(j.range) && finite(j.actuator_force_range) && finite(j.limit.solref) &&
                       finite(j.limit.solimp) && finite(j.friction.solref) && finite(j.friction.solimp) && finite(j.springdamper) &&
                       finite(std::array{j.ref, j.springref, j.stiffness, j.damping, j.armature, j.frictionloss, j.margin}),
                   j.place, "joint", j.name);
    bool const is_free = j.type == JointType::free, is_ball = j.type == JointType::ball, turns_one = j.type == JointType::hinge;
    if (is_free && body.joints.size() > 1)
      fail(j.place, "joint", j.name, "is free, which leaves nothing for the other joints of its body: keep one of them");
    if (is_free && body.parent != 0)
      fail(j.place, "joint", j.name, "is free but its body is not a child of the world: move the body to the top level");
    if (is_ball || turns_one)
      for (auto const& other : body.joints) {
        if (&other == &j) break;
        if (other.type == JointType::ball) fail(j.place, "joint", j.name, "turns a body that a ball joint turns already: keep one of them");
      }
    if (is_ball)
      for (auto const& other : body.joints)
        if (&other != &j && other.type == JointType::hinge)
          fail(j.place, "joint", j.name, "is a ball joint beside a hinge of the same body: keep one of them");
    if (j.armature < 0) fail(j.place, "joint", j.name, "has a negative armature: give zero or more");
    bool const limited = j.limited && !is_free;
    if (is_ball && limited && (j.range[0] != 0 || j.range[1] < 0))
      fail(j.place, "joint", j.name, "is a limited ball joint, whose range is '0 angle': set the first number to 0");
    require_range(*this, limited && !is_ball, j.range, j.place, "joint", j.name, "range");
    require_range(*this, j.actuator_force_limited, j.actuator_force_range, j.place, "joint", j.name, "actuatorfrcrange");
    int const dofs = is_free ? 6 : is_ball ? 3 : 1, id = m_.njnt++;
    double const length = norm(j.axis);
    if (dofs == 1 && !(length > 1e-14)) fail(j.place, "joint", j.name, "has an axis of length zero: give a direction");
    m_.jnt_type.push_back(int(j.type)), m_.jnt_body.push_back(b), m_.jnt_name.push_back(j.name);
    m_.jnt_qposadr.push_back(m_.nq), m_.jnt_dofadr.push_back(m_.nv);
    m_.jnt_pos.push_back(is_free ? Double3{0, 0, 0} : j.pos);
    m_.jnt_axis.push_back(dofs == 1 ? (1 / length) * j.axis : Double3{0, 0, 1});
    m_.jnt_limited.push_back(limited), m_.jnt_actfrclimited.push_back(j.actuator_force_limited);
    m_.jnt_range.push_back(j.range), m_.jnt_actfrcrange.push_back(j.actuator_force_range);
    m_.jnt_stiffness.push_back(j.stiffness), m_.jnt_margin.push_back(j.margin);
    m_.jnt_solref.push_back(j.limit.solref), m_.jnt_solimp.push_back(j.limit.solimp);
    for (int k = 0; k < dofs; ++k) {
      bool const first_of_body = b > 0 && m_.nv == m_.body_dofadr[b];
      int parent = m_.nv - 1;
      if (first_of_body) {
        int p = m_.body_parent[b];
        while (p > 0 && m_.body_jntnum[p] == 0) p = m_.body_parent[p];
        parent = p > 0 ? m_.body_dofadr[p] + m_.body_dofnum[p] - 1 : -1;
      }
      m_.dof_parent.push_back(parent), m_.dof_body.push_back(b), m_.dof_jnt.push_back(id);
      m_.dof_armature.push_back(j.armature), m_.dof_damping.push_back(j.damping), m_.dof_frictionloss.push_back(j.frictionloss);
      m_.dof_solref.push_back(j.friction.solref), m_.dof_solimp.push_back(j.friction.solimp);
      ++m_.nv;
    }
    std::vector<double> rest, spring;
    if (is_free) {
      auto const q = unit(body.quat);
      rest = {body.pos[0], body.pos[1], body.pos[2], q[0], q[1], q[2], q[3]}, spring = rest;
    } else if (is_ball) {
      rest = spring = {1, 0, 0, 0};
    } else {
      rest = {j.ref}, spring = {j.springref};
    }
    m_.qpos0.insert(m_.qpos0.end(), rest.begin(), rest.end()), m_.qpos_spring.insert(m_.qpos_spring.end(), spring.begin(), spring.end());
    m_.nq = int(m_.qpos0.size());
  }

  void geom(int b, GeomDescription const& g) {
    require_finite(finite(g.pos) && finite(g.quat) && finite(g.size) && finite(g.friction) && finite(g.softness.solref) &&
                       finite(g.softness.solimp) && finite(std::array{g.solmix, g.margin, g.gap, g.mass, g.density}),
                   g.place, "geom", g.name);
    auto const shape = shape_of(g);
    if (g.condim != 1 && g.condim != 3 && g.condim != 4 && g.condim != 6)
      fail(g.place, "geom", g.name, "has a condim other than 1, 3, 4, 6: choose one of them");
    int const sizes[] = {0, 0, 1, 2, 3, 2, 3, 0};
    for (int k = 0; k < sizes[int(g.type)]; ++k)
      if (!(shape.size[k] > 0))
        fail(g.place, "geom", g.name,
             "has size[" + std::to_string(k) + "] <= 0, and a " + shape_name(g.type) + " needs " + std::to_string(sizes[int(g.type)]) +
                 " positive sizes: give them");
    if (g.type == ShapeType::plane && (g.size[0] < 0 || g.size[1] < 0))
      fail(g.place, "geom", g.name, "is a plane with a negative size: give zero (infinite) or more");
    if (g.type == ShapeType::plane && m_.body_weld[b] != 0)
      fail(g.place, "geom", g.name, "is a plane in a body that moves: planes belong to the world, use a box");
    if (g.type == ShapeType::ellipsoid && g.shell_inertia)
      fail(g.place, "geom", g.name, "is an ellipsoid with shellinertia, which is not supported: give its body an inertial");
    if (g.has_mass ? g.mass < 0 : g.density < 0) fail(g.place, "geom", g.name, "has a negative mass or density: give zero or more");
    m_.geom_type.push_back(int(g.type)), m_.geom_body.push_back(b), m_.geom_name.push_back(g.name);
    m_.geom_contype.push_back(g.contype), m_.geom_conaffinity.push_back(g.conaffinity), m_.geom_condim.push_back(g.condim);
    m_.geom_priority.push_back(g.priority), m_.geom_group.push_back(g.group);
    m_.geom_size.push_back(shape.size), m_.geom_pos.push_back(shape.pos), m_.geom_quat.push_back(shape.quat),
        m_.geom_friction.push_back(g.friction);
    m_.geom_solmix.push_back(g.solmix), m_.geom_margin.push_back(g.margin), m_.geom_gap.push_back(g.gap);
    m_.geom_solref.push_back(g.softness.solref), m_.geom_solimp.push_back(g.softness.solimp), m_.geom_rgba.push_back(g.rgba);
    m_.geom_rbound.push_back(shape.rbound), m_.geom_data.push_back(shape.data);
    places_.push_back(g.place);
    ++m_.ngeom;
  }

  // A tree starts at a body that moves and whose ancestors do not; depth-first order makes it contiguous.
  void trees() {
    m_.body_tree.assign(m_.nbody, -1);
    for (int b = 1; b < m_.nbody; ++b) {
      int const parent = m_.body_tree[m_.body_parent[b]];
      if (parent >= 0) {
        m_.body_tree[b] = parent;
      } else if (m_.body_jntnum[b] > 0) {
        m_.body_tree[b] = m_.ntree++;
        m_.tree_bodyadr.push_back(b), m_.tree_jntadr.push_back(m_.body_jntadr[b]), m_.tree_dofadr.push_back(m_.body_dofadr[b]);
        m_.tree_qposadr.push_back(m_.jnt_qposadr[m_.body_jntadr[b]]);
        m_.tree_bodynum.push_back(0), m_.tree_jntnum.push_back(0), m_.tree_dofnum.push_back(0), m_.tree_qposnum.push_back(0);
      }
      int const t = m_.body_tree[b];
      if (t < 0) continue;
      ++m_.tree_bodynum[t], m_.tree_jntnum[t] += m_.body_jntnum[b], m_.tree_dofnum[t] += m_.body_dofnum[b];
    }
    for (int t = 0; t < m_.ntree; ++t) m_.tree_qposnum[t] = (t + 1 < m_.ntree ? m_.tree_qposadr[t + 1] : m_.nq) - m_.tree_qposadr[t];
  }

  struct Mass {
    double mass = 0;
    Double3 pos{0, 0, 0};
    Double4 quat{1, 0, 0, 0};
    Double3 moments{};
  };
  static Mass principal(double mass, Double3 const& pos, Double4 const& frame, Symmetric3 const& tensor) {
    if (tensor[3] == 0 && tensor[4] == 0 && tensor[5] == 0) return {mass, pos, frame, {tensor[0], tensor[1], tensor[2]}};
    auto const axes = principal_axes(tensor);
    return {mass, pos, normalized(times(frame, axes.quat)), axes.moments};
  }

  // Mass of a body from its geoms: one geom lends its frame; several are summed about their common centre of mass (parallel axis theorem).
  std::optional<Mass> from_geoms(BodyDescription const& body) const {
    std::vector<Mass> parts;
    for (auto const& g : body.geoms) {
      if (g.group < d_.compiler.inertia_group_range[0] || g.group > d_.compiler.inertia_group_range[1]) continue;
      auto const shape = shape_of(g);
      double const mass = shape.inertia.measure == 0 ? 0 : g.has_mass ? g.mass : g.density * shape.inertia.measure;
      if (!(mass > 1e-14)) continue;
      parts.push_back({mass, shape.pos, shape.quat, mass * shape.inertia.moments});
    }
    if (parts.size() < 2) return parts.empty() ? std::nullopt : std::optional(parts[0]);
    Mass sum;
    for (auto const& p : parts) sum.mass += p.mass, sum.pos = sum.pos + p.mass * p.pos;
    sum.pos = (1 / sum.mass) * sum.pos;
    Symmetric3 tensor{};
    for (auto const& p : parts) {
      auto const own = rotated_diagonal(p.quat, p.moments);
      auto const r = p.pos - sum.pos;
      double const rr = dot(r, r);
      Symmetric3 const moved{rr - r[0] * r[0], rr - r[1] * r[1], rr - r[2] * r[2], -r[0] * r[1], -r[0] * r[2], -r[1] * r[2]};
      for (int k = 0; k < 6; ++k) tensor[k] += own[k] + p.mass * moved[k];
    }
    auto const axes = principal_axes(tensor);
    return Mass{sum.mass, sum.pos, axes.quat, axes.moments};
  }

  void masses() {
    auto const& c = d_.compiler;
    for (int b = 0; b < m_.nbody; ++b) {
      auto const& body = d_.bodies[b];
      Mass mass;
      if (b > 0) {
        auto const& given = body.inertial;
        bool const from_shapes = !c.inertia_from_geom_never && (!body.has_inertial || c.inertia_from_geom_always);
        std::optional<Mass> const shapes = from_shapes ? from_geoms(body) : std::nullopt;
        if (shapes) {
          mass = *shapes;
        } else if (body.has_inertial) {
          require_finite(finite(given.pos) && finite(given.quat) && finite(given.inertia) && std::isfinite(given.mass), body.place, "body",
                         body.name);
          mass = principal(given.mass, given.pos, normalized(given.quat), given.inertia);
        } else {
          mass.pos = body.pos,
          mass.quat = unit(body.quat);  // an arbitrary point, but MuJoCo's, and the body's inverse weight is taken there
        }
        if (mass.mass < 0 || *std::min_element(mass.moments.begin(), mass.moments.end()) < 0)
          fail(body.place, "body", body.name, "has a negative mass or moment of inertia: correct its inertial");
        mass.mass = std::max(mass.mass, c.boundmass);
        for (double& i : mass.moments) i = std::max(i, c.boundinertia);
        auto& i = mass.moments;
        if (i[0] + i[1] < i[2] || i[0] + i[2] < i[1] || i[1] + i[2] < i[0]) {
          if (!c.balanceinertia)
            fail(body.place, "body", body.name,
                 "has moments of inertia of which one exceeds the sum of the others, so that no such body exists: correct its inertial or "
                 "set compiler balanceinertia=\"true\"");
          double const mean = (i[0] + i[1] + i[2]) / 3;
          i = {mean, mean, mean};
        }
      }
      require_finite(std::isfinite(mass.mass) && finite(mass.moments), body.place, "body", body.name);
      m_.body_mass.push_back(mass.mass), m_.body_inertia.push_back(mass.moments);
      m_.body_ipos.push_back(mass.pos), m_.body_iquat.push_back(mass.quat);
    }
    if (c.settotalmass > 0) {
      double total = 0;
      for (double mass : m_.body_mass) total += mass;
      double const scale = total > 0 ? c.settotalmass / total : 1;
      for (int b = 1; b < m_.nbody; ++b) {
        m_.body_mass[b] *= scale;
        for (double& i : m_.body_inertia[b]) i *= scale;
      }
    }
    // what moves must have mass and inertia, of its own or of a body that is fixed to it
    std::vector<char> heavy(m_.nbody, 0);
    for (int b = m_.nbody - 1; b > 0; --b) {
      auto const& i = m_.body_inertia[b];
      if (m_.body_mass[b] >= 1e-15 && i[0] >= 1e-15 && i[1] >= 1e-15 && i[2] >= 1e-15) heavy[b] = 1;
      if (m_.body_jntnum[b] == 0 && heavy[b]) heavy[m_.body_parent[b]] = 1;
      if (m_.body_jntnum[b] > 0 && !heavy[b])
        fail(d_.bodies[b].place, "body", d_.bodies[b].name,
             "moves but has no mass or inertia: give it a geom with density or mass, an inertial, or set compiler boundmass and "
             "boundinertia");
    }
  }

  void tendons() {
    Names joints, names;
    for (int j = 0; j < m_.njnt; ++j)
      if (!m_.jnt_name[j].empty()) joints[m_.jnt_name[j]] = j;
    for (auto const& t : d_.tendons) {
      enter(names, t.name, t.place, "tendon");
      require_finite(finite(t.range) && finite(t.springlength) && finite(t.limit.solref) && finite(t.limit.solimp) &&
                         finite(t.friction.solref) && finite(t.friction.solimp) &&
                         finite(std::array{t.stiffness, t.damping, t.frictionloss, t.armature, t.margin}),
                     t.place, "tendon", t.name);
      if (t.terms.empty()) fail(t.place, "tendon", t.name, "has no joints: add at least one");
      if (t.armature < 0) fail(t.place, "tendon", t.name, "has a negative armature: give zero or more");
      require_range(*this, t.limited, t.range, t.place, "tendon", t.name, "range");
      int tree = -1;
      double length = 0, spring = 0;
      m_.tendon_termadr.push_back(int(m_.term_jnt.size())), m_.tendon_termnum.push_back(int(t.terms.size()));
      for (auto const& term : t.terms) {
        auto const found = joints.find(term.joint);
        if (found == joints.end())
          fail(t.place, "tendon", t.name, "names the joint '" + term.joint + "', which does not exist: correct the name");
        int const j = found->second;
        if (m_.jnt_type[j] < int(JointType::slide))
          fail(t.place, "tendon", t.name,
               "names the joint '" + term.joint + "', which is a ball or free joint: only hinge and slide joints have one coordinate");
        require_finite(std::isfinite(term.coefficient), t.place, "tendon", t.name);
        m_.term_jnt.push_back(j), m_.term_coef.push_back(term.coefficient);
        length += term.coefficient * m_.qpos0[m_.jnt_qposadr[j]], spring += term.coefficient * m_.qpos_spring[m_.jnt_qposadr[j]];
        int const of_joint = m_.body_tree[m_.jnt_body[j]];
        tree = &term == &t.terms[0] || tree == of_joint ? of_joint : -1;
      }
      m_.tendon_tree.push_back(tree), m_.tendon_limited.push_back(t.limited), m_.tendon_name.push_back(t.name);
      m_.tendon_stiffness.push_back(t.stiffness), m_.tendon_damping.push_back(t.damping), m_.tendon_frictionloss.push_back(t.frictionloss);
      m_.tendon_armature.push_back(t.armature), m_.tendon_margin.push_back(t.margin), m_.tendon_length0.push_back(length),
          m_.tendon_invweight0.push_back(0);
      m_.tendon_range.push_back(t.range);
      bool const rest = t.springlength[0] == -1 && t.springlength[1] == -1;
      m_.tendon_lengthspring.push_back(rest ? std::array{spring, spring} : t.springlength);
      m_.tendon_solref_limit.push_back(t.limit.solref), m_.tendon_solref_friction.push_back(t.friction.solref);
      m_.tendon_solimp_limit.push_back(t.limit.solimp), m_.tendon_solimp_friction.push_back(t.friction.solimp);
      ++m_.ntendon;
    }
  }

  void actuators() {
    Names joints, tendons, names;
    for (int j = 0; j < m_.njnt; ++j)
      if (!m_.jnt_name[j].empty()) joints[m_.jnt_name[j]] = j;
    for (int t = 0; t < m_.ntendon; ++t)
      if (!m_.tendon_name[t].empty()) tendons[m_.tendon_name[t]] = t;
    for (auto const& a : d_.actuators) {
      enter(names, a.name, a.place, "actuator");
      require_finite(finite(a.gear) && finite(a.gainprm) && finite(a.biasprm) && finite(a.ctrl_range) && finite(a.force_range) &&
                         std::isfinite(a.dampratio),
                     a.place, "actuator", a.name);
      require_range(*this, a.ctrl_limited, a.ctrl_range, a.place, "actuator", a.name, "ctrlrange");
      require_range(*this, a.force_limited, a.force_range, a.place, "actuator", a.name, "forcerange");
      bool const on_joint = a.target == Transmission::joint;
      auto const& known = on_joint ? joints : tendons;
      auto const found = known.find(a.target_name);
      if (found == known.end())
        fail(a.place, "actuator", a.name,
             std::string("acts on the ") + (on_joint ? "joint" : "tendon") + " '" + a.target_name +
                 "', which does not exist: correct the name");
      m_.act_target.push_back(int(a.target)), m_.act_id.push_back(found->second), m_.act_ref.push_back(-1), m_.act_name.push_back(a.name);
      m_.act_ctrllimited.push_back(a.ctrl_limited), m_.act_forcelimited.push_back(a.force_limited);
      m_.act_gear.push_back(a.gear), m_.act_gainprm.push_back(a.gainprm), m_.act_biasprm.push_back(a.biasprm);
      m_.act_ctrlrange.push_back(a.ctrl_range), m_.act_forcerange.push_back(a.force_range);
      ++m_.nu;
    }
  }

  // What follows from the mass matrix in the initial pose.
  void constants() {
    m_.body_invweight0.assign(m_.nbody, {0, 0}), m_.dof_invweight0.assign(m_.nv, 0);
    for (int t = 0; t < m_.ntree; ++t) {
      int const n = m_.tree_dofnum[t], d0 = m_.tree_dofadr[t];
      if (n > 3000)
        fail(d_.bodies[m_.tree_bodyadr[t]].place, "body", m_.body_name[m_.tree_bodyadr[t]],
             "carries a tree of " + std::to_string(n) + " degrees of freedom, and at most 3000 are supported: split it");
      InitialInertia const inertia(m_, t);
      for (int b = m_.tree_bodyadr[t], end = b + m_.tree_bodynum[t]; b < end; ++b)
        m_.body_invweight0[b] = inertia.body_inverse_weight(m_, b);
      for (int d = d0; d < d0 + n; ++d) {
        std::vector<double> unit(n, 0.);
        unit[d - d0] = 1;
        m_.dof_invweight0[d] = inertia.inverse_weight(std::move(unit));
      }
      for (int j = m_.tree_jntadr[t], end = j + m_.tree_jntnum[t]; j < end; ++j)  // the three of a translation or a ball share their mean
        for (int first = 0, dofs = m_.jnt_type[j] == 0 ? 6 : m_.jnt_type[j] == 1 ? 3 : 0; first < dofs; first += 3) {
          double* w = &m_.dof_invweight0[m_.jnt_dofadr[j] + first];
          w[0] = w[1] = w[2] = (w[0] + w[1] + w[2]) / 3;
        }
      if (int const root = m_.tree_bodyadr[t]; is_slider(root)) {
        m_.body_invweight0[root] = {1 / m_.body_mass[root], 0};
        for (int d = d0; d < d0 + n; ++d) m_.dof_invweight0[d] = 1 / m_.body_mass[root];
      }
      for (int k = 0; k < m_.ntendon; ++k) {
        if (m_.tendon_tree[k] != t) continue;
        m_.tendon_invweight0[k] = inertia.inverse_weight(tendon_row(k, t));
      }
    }
    for (int k = 0; k < m_.ntendon; ++k)  // a tendon across trees: M is block diagonal, so the blocks add up
      if (m_.tendon_tree[k] < 0) {
        if (m_.tendon_armature[k] != 0)
          fail(d_.tendons[k].place, "tendon", m_.tendon_name[k],
               "has armature and joints of two kinematic trees, which is not supported: give each tree a tendon of its own");
        for (int t = 0; t < m_.ntree; ++t) {
          auto row = tendon_row(k, t);
          if (std::any_of(row.begin(), row.end(), [](double x) { return x != 0; }))
            m_.tendon_invweight0[k] += InitialInertia(m_, t).inverse_weight(std::move(row));
        }
      }
    for (int b = 1; b < m_.nbody; ++b)
      for (std::size_t k = 0; k < d_.bodies[b].joints.size(); ++k) {
        auto const& spring = d_.bodies[b].joints[k].springdamper;
        int const j = m_.body_jntadr[b] + int(k), dofs = m_.jnt_type[j] == 0 ? 6 : m_.jnt_type[j] == 1 ? 3 : 1, d = m_.jnt_dofadr[j];
        if (!(spring[0] > 0 && spring[1] > 0)) continue;
        double weight = 0;
        for (int i = d; i < d + dofs; ++i) weight += m_.dof_invweight0[i];
        double const inertia = dofs / std::max(weight, 1e-15);
        m_.jnt_stiffness[j] = inertia / (spring[0] * spring[0] * spring[1] * spring[1]);
        for (int i = d; i < d + dofs; ++i) m_.dof_damping[i] = 2 * inertia / spring[0];
      }
    for (int a = 0; a < m_.nu; ++a) {
      double const ratio = d_.actuators[a].dampratio, kp = -m_.act_biasprm[a][1];
      if (!(ratio > 0)) continue;
      if (!(kp > 0)) fail(d_.actuators[a].place, "actuator", m_.act_name[a], "has dampratio but no stiffness: give kp");
      int const id = m_.act_id[a];
      bool const on_joint = m_.act_target[a] == int(Transmission::joint);
      if (on_joint && m_.jnt_type[id] < int(JointType::slide))
        fail(d_.actuators[a].place, "actuator", m_.act_name[a], "has dampratio on a ball or free joint, which is not supported: give kv");
      double const weight = on_joint ? m_.dof_invweight0[m_.jnt_dofadr[id]] : m_.tendon_invweight0[id], gear = m_.act_gear[a][0];
      double const reflected = 1 / std::max(gear * gear * weight, 1e-15);  // the inertia that the actuator feels
      m_.act_biasprm[a][2] = -2 * ratio * std::sqrt(kp * reflected);
    }
  }
  // A lone body on slides along its own axes, with its centre of mass at its origin, for which MuJoCo takes 1 / mass, without armature.
  bool is_slider(int b) const {
    int const parent = m_.body_parent[b];
    bool const near_world = parent == 0 || m_.body_parent[parent] == 0;
    bool const childless = b + 1 == m_.nbody || m_.body_parent[b + 1] != b;
    auto const zero = [](double x) { return std::abs(x) < 1e-14; };
    auto const& p = m_.body_ipos[b];
    auto const& q = m_.body_iquat[b];
    if (!near_world || !childless || !zero(norm(p)) || !zero(q[1]) || !zero(q[2]) || !zero(q[3])) return false;
    for (int j = m_.body_jntadr[b], end = j + m_.body_jntnum[b]; j < end; ++j) {
      auto const& axis = m_.jnt_axis[j];
      if (m_.jnt_type[j] != int(JointType::slide) || !zero(norm(m_.jnt_pos[j])) || zero(axis[0]) + zero(axis[1]) + zero(axis[2]) != 2)
        return false;
    }
    return true;
  }
  std::vector<double> tendon_row(int k, int tree) const {
    std::vector<double> row(m_.tree_dofnum[tree], 0.);
    for (int e = m_.tendon_termadr[k], end = e + m_.tendon_termnum[k]; e < end; ++e)
      if (m_.body_tree[m_.jnt_body[m_.term_jnt[e]]] == tree) row[m_.jnt_dofadr[m_.term_jnt[e]] - m_.tree_dofadr[tree]] += m_.term_coef[e];
    return row;
  }

  std::string geom_text(int g) const {
    return std::string(shape_name(ShapeType(m_.geom_type[g]))) +
           (m_.geom_name[g].empty() ? " of body '" + m_.body_name[m_.geom_body[g]] + "'" : " '" + m_.geom_name[g] + "'");
  }
  // Two geoms may touch when a bit of contype meets one of conaffinity and their bodies are not welded together, not parent and child
  // (unless one is the world), and not excluded.
  void pairs() {
    Names bodies;
    for (int b = 0; b < m_.nbody; ++b)
      if (!m_.body_name[b].empty()) bodies[m_.body_name[b]] = b;
    std::set<std::pair<int, int>> excluded;
    for (auto const& e : d_.excludes) {
      auto const a = bodies.find(e.body1), b = bodies.find(e.body2);
      if (a == bodies.end() || b == bodies.end())
        fail(e.place, "exclude", "",
             "names the body '" + (a == bodies.end() ? e.body1 : e.body2) + "', which does not exist: correct the name");
      excluded.emplace(std::min(a->second, b->second), std::max(a->second, b->second));
    }
    std::vector<int> colliding;
    for (int g = 0; g < m_.ngeom; ++g)
      if (m_.geom_contype[g] != 0 || m_.geom_conaffinity[g] != 0) colliding.push_back(g);
    int left_out = 0, wide = 0;
    std::optional<std::array<int, 2>> first_left_out;
    for (std::size_t i = 0; i < colliding.size(); ++i) {
      int const a = colliding[i], body_a = m_.geom_body[a], weld_a = m_.body_weld[body_a];
      int const above_a = m_.body_weld[m_.body_parent[weld_a]];
      for (std::size_t k = i + 1; k < colliding.size(); ++k) {
        int const b = colliding[k], body_b = m_.geom_body[b], weld_b = m_.body_weld[body_b];
        if (weld_a == weld_b) continue;
        if (!((m_.geom_contype[a] & m_.geom_conaffinity[b]) || (m_.geom_contype[b] & m_.geom_conaffinity[a]))) continue;
        if (d_.option.filterparent && weld_a != 0 && weld_b != 0 && (weld_a == m_.body_weld[m_.body_parent[weld_b]] || weld_b == above_a))
          continue;
        if (!excluded.empty() && excluded.count({std::min(body_a, body_b), std::max(body_a, body_b)})) continue;
        std::array<int, 2> const pair = m_.geom_type[a] <= m_.geom_type[b] ? std::array{a, b} : std::array{b, a};
        if (m_.geom_type[pair[1]] == int(ShapeType::plane)) continue;  // two planes: no contact is defined
        if (!is_covered_pair(m_.geom_type[pair[0]], m_.geom_type[pair[1]])) {
          if (!approximate_)
            throw Error(at(places_[a]) + geom_text(a) + " can meet " + geom_text(b) + " (" + at(places_[b]) +
                        "see there), and contact between these two shapes is not supported: keep them apart with contype and conaffinity "
                        "or exclude, use other shapes, or leave such pairs out with --approximate");
          if (!left_out++) first_left_out = {a, b};
          continue;
        }
        int const condim = m_.geom_priority[a] == m_.geom_priority[b] ? std::max(m_.geom_condim[a], m_.geom_condim[b])
                                                                      : m_.geom_condim[m_.geom_priority[a] > m_.geom_priority[b] ? a : b];
        if (condim > 3 && !approximate_) {
          int const g = m_.geom_condim[a] == condim ? a : b;
          throw Error(
              at(places_[g]) + geom_text(g) + " has condim " + std::to_string(condim) +
              ", and torsional and rolling friction are not supported yet: use condim 3, or let it be taken as 3 with --approximate");
        }
        wide += condim > 3;
        m_.pairs.push_back(pair);
        if (m_.pairs.size() > 50'000'000)
          throw Error(at({}) + "more than 50 million pairs of geoms can meet: keep geoms apart with contype and conaffinity");
      }
    }
    auto const note = [&](int g, std::string const& text, int count, ReportLine::Kind kind) {
      auto const& place = places_[g];
      m_.report.push_back({kind, place.file >= 0 ? d_.files[place.file] : d_.name, place.line, text, count});
    };
    if (left_out)
      note((*first_left_out)[0],
           "pairs of geoms whose contact is not supported are left out, first " + geom_text((*first_left_out)[0]) + " with " +
               geom_text((*first_left_out)[1]),
           left_out, ReportLine::Kind::left_out);
    if (approximate_) {
      int changed = 0, first = -1;
      for (int g = 0; g < m_.ngeom; ++g)
        if (m_.geom_condim[g] > 3) m_.geom_condim[g] = 3, first = changed++ ? first : g;
      if (wide)
        note(first,
             "geoms with condim 4 or 6 are taken as condim 3: no torsional or rolling friction (" + std::to_string(wide) +
                 " pairs of geoms)",
             changed, ReportLine::Kind::approximated);
    }
  }

  void keyframes() {
    Names names;
    for (auto key : d_.keyframes) {
      enter(names, key.name, key.place, "key");
      auto const fill = [&](std::vector<double>& v, std::vector<double> const& initial, char const* attribute) {
        if (v.empty()) v = initial;
        if (v.size() != initial.size())
          fail(key.place, "key", key.name,
               std::string("has ") + std::to_string(v.size()) + " numbers in " + attribute + ", and the model needs " +
                   std::to_string(initial.size()) + ": correct the list");
        require_finite(finite(v), key.place, "key", key.name);
      };
      fill(key.qpos, m_.qpos0, "qpos");
      fill(key.qvel, std::vector<double>(m_.nv, 0.), "qvel");
      fill(key.ctrl, std::vector<double>(m_.nu, 0.), "ctrl");
      for (int j = 0; j < m_.njnt; ++j) {
        if (m_.jnt_type[j] > 1) continue;
        double* q = &key.qpos[m_.jnt_qposadr[j] + (m_.jnt_type[j] == 0 ? 3 : 0)];
        auto const n = unit({q[0], q[1], q[2], q[3]});
        std::copy(n.begin(), n.end(), q);
      }
      m_.keyframes.push_back(std::move(key));
    }
  }

  Description const& d_;
  bool approximate_;
  CompiledModel m_;
  std::vector<Place> places_;         // of geoms
  std::optional<GeomShapes> shapes_;  // meshes and height fields, compiled
};

}  // namespace detail

/// Turns a description into flat arrays by MuJoCo's rules: masses and principal axes of inertia from geoms, weld groups, initial pose,
/// order of degrees of freedom, trees, pairs of geoms that may touch, and what follows from the mass matrix in the initial pose
/// (invweight0, springdamper, dampratio). Host, double. Cost: O(pairs of colliding geoms) + O(n^3) for each tree of n degrees of freedom.
/// Errors: gsp::Error "FILE:LINE: what is wrong: remedy"; shapes that can meet and are not covered, and condim 4 and 6, unless
/// `approximate`.
inline CompiledModel compile(Description const& description, CompileOptions const& options = {}) {
  return detail::Compiler(description, options).run();
}

}  // namespace gsp
