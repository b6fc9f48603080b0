#pragma once
#include <gsp/model/detail/compile_base.hpp>
#include <gsp/model/detail/mesh_geoms.hpp>
#include <gsp/model/detail/principal_axes.hpp>
#include <optional>
#include <string>
#include <vector>

namespace gsp::detail {

/// The tree of bodies with their joints, shapes, sites and cameras, and their masses.
class BodyCompiler : public CompilerBase {
 protected:
  using CompilerBase::CompilerBase;

  void check_numbers() const {
    if (!(d_.option.timestep > 0) || !std::isfinite(d_.option.timestep))
      throw Error(at({}) + "option timestep is not positive: give seconds, such as 0.002");
    if (!(d_.option.density >= 0 && d_.option.viscosity >= 0 && std::isfinite(d_.option.density + d_.option.viscosity)))
      throw Error(at({}) + "option density and viscosity are not both zero or more: correct them");
    for (double f : d_.option.o_friction)
      if (d_.option.override_contacts && !(f >= 0)) throw Error(at({}) + "option o_friction is negative: give zero or more");
    if (!finite(d_.option.gravity)) throw Error(at({}) + "option gravity is not finite: give three numbers");
    if (d_.bodies.empty() || d_.bodies[0].parent != -1)
      throw Error(at({}) + "the first body of a Description is the world, with parent -1: start from a default Description");
    if (!d_.bodies[0].joints.empty())
      fail(d_.bodies[0].joints[0].place, "joint", d_.bodies[0].joints[0].name,
           "stands in the world, which cannot move: put it into a body");
  }

  void assets() {
    shapes_.emplace(d_, [this](auto const&... what) { fail(what...); });
    for (auto& mesh : shapes_->meshes()) {
      m_.mesh_vertices.push_back(std::move(mesh.vertices));
      m_.mesh_faces.push_back(std::move(mesh.faces));
      m_.mesh_hull.push_back(std::move(mesh.hull));
      m_.mesh_hull_faces.push_back(std::move(mesh.hull_faces));
      m_.mesh_pos.push_back(mesh.pos);
      m_.mesh_quat.push_back(mesh.quat);
      m_.mesh_name.push_back(d_.meshes[m_.nmesh++].name);
    }
    m_.hfields = shapes_->hfields();
    m_.nhfield = int(m_.hfields.size());
  }
  GeomShape shape_of(GeomDescription const& g) const {
    return (*shapes_)(g, [this](auto const&... what) { fail(what...); });
  }

  void bodies() {
    std::vector<int> path;  // from the world to the body before
    for (int b = 0; b < int(d_.bodies.size()); ++b) {
      auto const& body = d_.bodies[b];
      while (b > 0 && !path.empty() && path.back() != body.parent) path.pop_back();
      if (b > 0 && path.empty())
        fail(body.place, "body", body.name,
             "does not follow its parent depth first: list every body right after its parent or an earlier child's last descendant");
      path.push_back(b);
      enter(Kind::body, body.name, b, body.place);
      require_finite(finite(body.pos) && finite(body.quat) && std::isfinite(body.gravcomp), body.place, "body", body.name);
      if (body.inertial.mass != 0 && !body.has_inertial)
        fail(body.place, "body", body.name, "has an inertial, and has_inertial is false: set it, or leave the inertial away");
      if (body.mocap && (body.parent != 0 || !body.joints.empty()))
        fail(body.place, "body", body.name,
             "is a mocap body but has joints or stands below another body: make it a fixed child of the world");
      if (body.sleep != BodySleep::automatic && (body.joints.empty() || (b > 0 && m_.body_weld[body.parent] != 0)))
        fail(body.place, "body", body.name, "says whether it may sleep and is not the root of a tree: say it at the root, which moves");
      m_.body_sleep.push_back(int(body.sleep));
      m_.body_mocap.push_back(body.mocap ? m_.nmocap++ : -1);
      m_.body_parent.push_back(std::max(body.parent, 0));
      m_.body_name.push_back(body.name);
      m_.body_pos.push_back(body.pos);
      m_.body_quat.push_back(unit(body.quat));
      m_.body_gravcomp.push_back(body.gravcomp);
      m_.body_weld.push_back(b == 0 ? 0 : body.joints.empty() && !body.mocap ? m_.body_weld[body.parent] : b);
      m_.body_jntadr.push_back(body.joints.empty() ? -1 : m_.njnt);
      m_.body_jntnum.push_back(int(body.joints.size()));
      m_.body_dofadr.push_back(body.joints.empty() ? -1 : m_.nv);
      of_body_ = "body " + (body.name.empty() ? std::to_string(b) : "'" + body.name + "'") + ": ";
      for (auto const& j : body.joints) {
        enter(Kind::joint, j.name, m_.njnt, j.place);
        joint(body, b, j);
      }
      m_.body_dofnum.push_back(body.joints.empty() ? 0 : m_.nv - m_.body_dofadr[b]);
      m_.body_geomadr.push_back(body.geoms.empty() ? -1 : m_.ngeom);
      m_.body_geomnum.push_back(int(body.geoms.size()));
      for (auto const& g : body.geoms) {
        enter(Kind::geom, g.name, m_.ngeom, g.place);
        geom(b, g);
      }
      for (auto const& s : body.sites) {
        enter(Kind::site, s.name, m_.nsite, s.place);
        require_finite(finite(s.pos) && finite(s.quat) && finite(s.size), s.place, "site", s.name);
        m_.site_body.push_back(b);
        m_.site_type.push_back(int(s.type));
        m_.site_size.push_back(s.size);
        m_.site_pos.push_back(s.pos);
        m_.site_quat.push_back(unit(s.quat));
        m_.site_name.push_back(s.name);
        ++m_.nsite;
      }
      for (auto const& c : body.cameras) {
        enter(Kind::camera, c.name, m_.ncam, c.place);
        require_finite(
            finite(c.pos) && finite(c.quat) && finite(c.sensor_size) && finite(c.focal) && finite(c.principal) && std::isfinite(c.fovy),
            c.place, "camera", c.name);
        if (!(c.fovy < 3.14159265358979323846)) fail(c.place, "camera", c.name, "has a fovy of pi or more: give less, in radians");
        bool const sized = c.sensor_size[0] > 0 && c.sensor_size[1] > 0;
        if (!(c.resolution[0] > 0 && c.resolution[1] > 0)) fail(c.place, "camera", c.name, "has no positive resolution: give its pixels");
        if (!sized && (c.sensor_size[0] != 0 || c.sensor_size[1] != 0))
          fail(c.place, "camera", c.name, "has a sensor without area: give a positive width and height, or none");
        auto& focal = m_.cam_focal.emplace_back();
        for (int k = 0; k < 2; ++k)  // those of a sensor as MuJoCo in float
          focal[k] =
              sized ? float(c.focal[k]) / float(c.sensor_size[k]) * float(c.resolution[k]) : 0.5 / std::tan(c.fovy / 2) * c.resolution[1];
        m_.cam_sensor_size.push_back(sized ? c.sensor_size : std::array<double, 2>{0, 0});
        m_.cam_principal.push_back(sized ? c.principal : std::array<double, 2>{0, 0});
        m_.cam_resolution.push_back({double(c.resolution[0]), double(c.resolution[1])});
        m_.cam_body.push_back(b);
        m_.cam_pos.push_back(c.pos);
        m_.cam_quat.push_back(unit(c.quat));
        m_.cam_fovy.push_back(c.fovy);
        m_.cam_name.push_back(c.name);
        m_.cam_mode.push_back(int(c.mode));
        ++m_.ncam;
      }
      of_body_.clear();
    }
    m_.nbody = int(d_.bodies.size());
    if (std::none_of(m_.body_gravcomp.begin(), m_.body_gravcomp.end(), [](double x) { return x > 0; }))  // as MuJoCo (ModelNotes)
      std::fill(m_.body_gravcomp.begin(), m_.body_gravcomp.end(), 0.);
    for (auto const& body : d_.bodies)
      for (auto const& c : body.cameras) {
        m_.cam_target.push_back(c.target.empty() ? -1 : find(Kind::body, c.target, c.place, "camera", c.name));
      }
  }

  void joint(BodyDescription const& body, int b, JointDescription const& j) {
    require_finite(finite(j.pos) && finite(j.axis) && finite(j.range) && finite(j.actuator_force_range) && finite(j.limit.solref) &&
                       finite(j.limit.solimp) && finite(j.friction.solref) && finite(j.friction.solimp) && finite(j.springdamper) &&
                       finite(j.stiffness_poly) && finite(j.damping_poly) &&
                       finite(std::array{j.ref, j.springref, j.stiffness, j.damping, j.armature, j.frictionloss, j.margin}),
                   j.place, "joint", j.name);
    auto const& damper = j.springdamper;
    if ((damper[0] != 0 || damper[1] != 0) && !(damper[0] > 0 && damper[1] > 0))
      fail(j.place, "joint", j.name,
           "has a springdamper that is not two positive numbers: give a time constant and a damping ratio, or none");
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
    if (j.armature < 0) fail(j.place, "joint", j.name, "has a negative armature: give zero or more");
    if (j.frictionloss < 0) fail(j.place, "joint", j.name, "has a negative frictionloss: give zero or more");
    bool const limited = j.limited && !is_free;
    if (is_ball && limited && (j.range[0] != 0 || j.range[1] < 0))
      fail(j.place, "joint", j.name, "is a limited ball joint, whose range is '0 angle': set the first number to 0");
    require_range(*this, limited && !is_ball, j.range, j.place, "joint", j.name, "range");
    require_range(*this, j.actuator_force_limited, j.actuator_force_range, j.place, "joint", j.name, "actuatorfrcrange");
    int const dofs = is_free ? 6 : is_ball ? 3 : 1, id = m_.njnt++;
    double const length = norm(j.axis);
    if (dofs == 1 && !(length > 1e-14)) fail(j.place, "joint", j.name, "has an axis of length zero: give a direction");
    m_.jnt_type.push_back(int(j.type));
    m_.jnt_body.push_back(b);
    m_.jnt_name.push_back(j.name);
    m_.jnt_qposadr.push_back(m_.nq);
    m_.jnt_dofadr.push_back(m_.nv);
    m_.jnt_pos.push_back(is_free ? Double3{0, 0, 0} : j.pos);
    m_.jnt_axis.push_back(dofs == 1 ? (1 / length) * j.axis : Double3{0, 0, 1});
    m_.jnt_limited.push_back(limited);
    m_.jnt_actfrclimited.push_back(j.actuator_force_limited);
    m_.jnt_range.push_back(j.range);
    m_.jnt_actfrcrange.push_back(j.actuator_force_range);
    m_.jnt_stiffness.push_back(j.stiffness);
    m_.jnt_margin.push_back(j.margin);
    m_.jnt_stiffnesspoly.push_back(j.stiffness_poly);
    m_.jnt_actgravcomp.push_back(j.actuator_gravcomp);
    m_.jnt_solref.push_back(j.limit.solref);
    m_.jnt_solimp.push_back(j.limit.solimp);
    m_.jnt_rigid.push_back(rigid(j.rigid_limit, j.place, "joint", j.name));
    for (int k = 0; k < dofs; ++k) {
      bool const first_of_body = b > 0 && m_.nv == m_.body_dofadr[b];
      int parent = m_.nv - 1;
      if (first_of_body) {
        int p = m_.body_parent[b];
        while (p > 0 && m_.body_jntnum[p] == 0) p = m_.body_parent[p];
        parent = p > 0 ? m_.body_dofadr[p] + m_.body_dofnum[p] - 1 : -1;
      }
      m_.dof_parent.push_back(parent);
      m_.dof_body.push_back(b);
      m_.dof_jnt.push_back(id);
      m_.dof_armature.push_back(j.armature);
      m_.dof_damping.push_back(j.damping);
      m_.dof_frictionloss.push_back(j.frictionloss);
      m_.dof_dampingpoly.push_back(j.damping_poly);
      m_.dof_solref.push_back(j.friction.solref);
      m_.dof_solimp.push_back(j.friction.solimp);
      ++m_.nv;
    }
    std::vector<double> rest, spring;
    if (is_free) {
      auto const q = unit(body.quat);
      rest = {body.pos[0], body.pos[1], body.pos[2], q[0], q[1], q[2], q[3]};
      spring = rest;
    } else if (is_ball) {
      rest = spring = {1, 0, 0, 0};
    } else {
      rest = {j.ref};
      spring = {j.springref};
    }
    m_.qpos0.insert(m_.qpos0.end(), rest.begin(), rest.end());
    m_.qpos_spring.insert(m_.qpos_spring.end(), spring.begin(), spring.end());
    m_.nq = int(m_.qpos0.size());
  }

  /// In the frame that a mesh has moved the geom to: v + w x r and w about its origin, r from the one to the other.
  static std::array<double, 6> surface_velocity(GeomDescription const& g, GeomShape const& shape) {
    auto const& s = g.surface_velocity;
    if (g.type != ShapeType::mesh || s == std::array<double, 6>{}) return s;
    Double4 const own = normalized(g.quat), turned = normalized(shape.quat);
    auto const turn = [&](Double3 const& v) { return rotate_inverse(turned, rotate(own, v)); };
    Double3 const w{s[3], s[4], s[5]}, r = rotate_inverse(own, shape.pos - g.pos);
    Double3 const linear = turn(Double3{s[0], s[1], s[2]} + cross(w, r)), angular = turn(w);
    return {linear[0], linear[1], linear[2], angular[0], angular[1], angular[2]};
  }

  void geom(int b, GeomDescription const& g) {
    require_finite(finite(g.pos) && finite(g.quat) && finite(g.size) && finite(g.friction) && finite(g.softness.solref) &&
                       finite(g.softness.solimp) && finite(std::array{g.solmix, g.margin, g.gap, g.mass, g.density, g.adhesion}) &&
                       finite(g.surface_velocity),
                   g.place, "geom", g.name);
    if (g.mass != 0 && !g.has_mass) fail(g.place, "geom", g.name, "has a mass, and has_mass is false: set it, or leave the mass 0");
    auto const shape = shape_of(g);
    if (g.condim != 1 && g.condim != 3 && g.condim != 4 && g.condim != 6)
      fail(g.place, "geom", g.name, "has a condim other than 1, 3, 4, 6: choose one of them");
    for (double f : g.friction)
      if (f < 0) fail(g.place, "geom", g.name, "has a negative friction: give zero or more");
    int const sizes = positive_sizes(g.type);
    for (int k = 0; k < sizes; ++k)
      if (!(shape.size[k] > 0))
        fail(g.place, "geom", g.name,
             "has size[" + std::to_string(k) + "] <= 0, and a " + shape_name(g.type) + " needs " + std::to_string(sizes) +
                 (sizes == 1 ? " positive size: give it" : " positive sizes: give them"));
    if (g.type == ShapeType::plane && (g.size[0] < 0 || g.size[1] < 0))
      fail(g.place, "geom", g.name, "is a plane with a negative size: give zero (infinite) or more");
    if (g.type == ShapeType::plane && m_.body_weld[b] != 0)
      fail(g.place, "geom", g.name, "is a plane in a body that moves: planes belong to the world, use a box");
    if (g.type == ShapeType::ellipsoid && g.shell_inertia)
      fail(g.place, "geom", g.name, "is an ellipsoid with shellinertia, which is not supported: give its body an inertial");
    for (auto const& [value, name] : {std::pair{g.restitution, "restitution"}, std::pair{g.erp, "erp"}})
      if (!(value >= 0 && value <= 1)) fail(g.place, "geom", g.name, std::string("has a ") + name + " outside of 0 to 1: give one of them");
    if (g.has_mass ? g.mass < 0 : g.density < 0) {
      if (b > 0) fail(g.place, "geom", g.name, "has a negative mass or density: give zero or more");
      note(g.place, ReportLine::Kind::no_effect,
           (g.name.empty() ? "a geom" : "geom '" + g.name + "'") +
               " of the world has a negative mass or density, and the world weighs nothing");
    }
    m_.geom_type.push_back(int(g.type));
    m_.geom_body.push_back(b);
    m_.geom_name.push_back(g.name);
    m_.geom_contype.push_back(g.contype);
    m_.geom_conaffinity.push_back(g.conaffinity);
    m_.geom_condim.push_back(g.condim);
    m_.geom_priority.push_back(g.priority);
    m_.geom_group.push_back(g.group);
    m_.geom_size.push_back(shape.size);
    m_.geom_pos.push_back(shape.pos);
    m_.geom_quat.push_back(shape.quat);
    m_.geom_friction.push_back(g.friction);
    m_.geom_solmix.push_back(g.solmix);
    m_.geom_margin.push_back(g.margin);
    m_.geom_gap.push_back(g.gap);
    rigid({g.hard, g.restitution, g.erp}, g.place, "geom", g.name);
    m_.geom_hard.push_back(g.hard);
    m_.geom_restitution.push_back(g.restitution);
    m_.geom_erp.push_back(g.erp);
    m_.geom_solref.push_back(g.softness.solref);
    m_.geom_solimp.push_back(g.softness.solimp);
    m_.geom_rgba.push_back(g.rgba);
    m_.geom_material_alpha.push_back(g.material_alpha);
    m_.geom_parts.push_back(g.parts);
    m_.geom_rbound.push_back(shape.rbound);
    m_.geom_data.push_back(shape.data);
    m_.geom_fluid.push_back(g.fluid_ellipsoid);
    m_.geom_fluidcoef.push_back(g.fluid_coef);
    m_.geom_surfacevel.push_back(surface_velocity(g, shape));
    m_.geom_adhesion.push_back(g.adhesion);
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
        m_.tree_bodyadr.push_back(b);
        m_.tree_jntadr.push_back(m_.body_jntadr[b]);
        m_.tree_dofadr.push_back(m_.body_dofadr[b]);
        m_.tree_qposadr.push_back(m_.jnt_qposadr[m_.body_jntadr[b]]);
        m_.tree_bodynum.push_back(0);
        m_.tree_jntnum.push_back(0);
        m_.tree_dofnum.push_back(0);
        m_.tree_qposnum.push_back(0);
      }
      int const t = m_.body_tree[b];
      if (t < 0) continue;
      ++m_.tree_bodynum[t];
      m_.tree_jntnum[t] += m_.body_jntnum[b];
      m_.tree_dofnum[t] += m_.body_dofnum[b];
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
    for (auto const& p : parts) {
      sum.mass += p.mass;
      sum.pos = sum.pos + p.mass * p.pos;
    }
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

  static std::string in_numbers(double mass, Double3 const& moments) {
    char text[160];
    std::snprintf(text, sizeof text, " mass %.3g and moments %.3g %.3g %.3g", mass, moments[0], moments[1], moments[2]);
    return text;
  }

  void masses() {
    auto const& c = d_.compiler;
    std::vector<std::string> weighed;  // what a body weighs, and says who: for what moves and weighs nothing
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
        } else {  // an arbitrary point, but MuJoCo's, and the body's inverse weight is taken there
          mass.pos = body.pos;
          mass.quat = unit(body.quat);
        }
        if (mass.mass < 0 || *std::min_element(mass.moments.begin(), mass.moments.end()) < 0)
          note(body.place, ReportLine::Kind::approximated,
               (body.name.empty() ? "a body" : "body '" + body.name + "'") +
                   " has a negative mass or moment of inertia, which is taken as 0, or as boundmass and boundinertia say: correct its "
                   "inertial");
        weighed.push_back(shapes ? "its geoms give it" : body.has_inertial ? "its inertial gives it" : "");
        if (!weighed.back().empty()) weighed.back() += in_numbers(mass.mass, mass.moments);
        mass.mass = std::max({mass.mass, c.boundmass, 0.});
        for (double& i : mass.moments) i = std::max({i, c.boundinertia, 0.});
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
      if (b == 0) weighed.emplace_back();
      require_finite(std::isfinite(mass.mass) && finite(mass.moments), body.place, "body", body.name);
      m_.body_mass.push_back(mass.mass);
      m_.body_inertia.push_back(mass.moments);
      m_.body_ipos.push_back(mass.pos);
      m_.body_iquat.push_back(mass.quat);
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
             "moves but has no mass or inertia" +
                 (weighed[b].empty() ? ": give it a geom with density or mass, an inertial, or set compiler boundmass and boundinertia"
                                     : " (" + weighed[b] +
                                           ", and each has to be above 1e-15): correct them, or set compiler boundmass and "
                                           "boundinertia"));
    }
  }

  // A free body without children may take its inertial frame as its own: the same motion, and M stays diagonal. What it carries keeps its
  // place.
  void align_free_bodies() {
    for (int b = 1; b < m_.nbody; ++b) {
      auto const& body = d_.bodies[b];
      bool const leaf = b + 1 == m_.nbody || m_.body_parent[b + 1] != b;
      if (body.joints.size() != 1 || body.joints[0].type != JointType::free || !leaf) continue;
      if (!body.joints[0].align.value_or(d_.compiler.align_free)) continue;
      Pose const inertial{m_.body_ipos[b], m_.body_iquat[b]};
      Double4 const back{inertial.q[0], -inertial.q[1], -inertial.q[2], -inertial.q[3]};
      Pose const inverse{-1. * rotate(back, inertial.p), back};
      auto const move = [&](Double3& pos, Double4& quat) {
        Pose const x = inverse * Pose{pos, quat};
        pos = x.p;
        quat = normalized(x.q);
      };
      Pose const frame = Pose{m_.body_pos[b], m_.body_quat[b]} * inertial;
      m_.body_pos[b] = frame.p;
      m_.body_quat[b] = normalized(frame.q);
      m_.body_ipos[b] = {0, 0, 0};
      m_.body_iquat[b] = {1, 0, 0, 0};
      for (int g = 0; g < m_.body_geomnum[b]; ++g) move(m_.geom_pos[m_.body_geomadr[b] + g], m_.geom_quat[m_.body_geomadr[b] + g]);
      for (int s = 0; s < m_.nsite; ++s)
        if (m_.site_body[s] == b) move(m_.site_pos[s], m_.site_quat[s]);
      for (int c = 0; c < m_.ncam; ++c)
        if (m_.cam_body[c] == b) move(m_.cam_pos[c], m_.cam_quat[c]);
      double* q = &m_.qpos0[m_.jnt_qposadr[m_.body_jntadr[b]]];
      std::copy(m_.body_pos[b].begin(), m_.body_pos[b].end(), q);
      std::copy(m_.body_quat[b].begin(), m_.body_quat[b].end(), q + 3);
      std::copy(q, q + 7, &m_.qpos_spring[m_.jnt_qposadr[m_.body_jntadr[b]]]);
    }
  }

  std::vector<Place> places_;         // of geoms
  std::optional<GeomShapes> shapes_;  // meshes and height fields, compiled
};

}  // namespace gsp::detail
