#pragma once
#include <array>
#include <cmath>
#include <gsp/core/status.hpp>
#include <gsp/io/detail/mjcf_document.hpp>
#include <gsp/io/detail/mjcf_quantities.hpp>
#include <gsp/model/detail/principal_axes.hpp>
#include <string>
#include <utility>

/// What stands in a body and holds no bodies itself: joints, geoms, sites, cameras and the inertial.
/// `frame`: the pose of the <frame>s around it; `childclass`: the class of what names none.
namespace gsp::io::detail::mjcf {

inline void read_joint(Document& doc, Node const& node, BodyDraft& to, Pose const& frame, std::string const& childclass) {
  doc.check(node);
  doc.count(1, node.place);
  bool const freejoint = node.name == "freejoint";
  JointDescription j;
  j.place = node.place;
  auto const a = freejoint ? doc.attributes(node) : doc.attributes(node, "joint", childclass);
  j.name = a.own("name") ? a.text("name") : "";
  a.integer("group", j.group);
  if (freejoint) {
    j.type = JointType::free;
    if (a.has("align"))
      if (int const align = a.choice("align", {"false", "true", "auto"}); align != 2) j.align = align == 1;
  } else {
    if (a.has("type")) j.type = static_cast<JointType>(a.choice("type", {"free", "ball", "slide", "hinge"}));
    a.numbers("pos", j.pos);
    a.numbers("axis", j.axis);
    a.numbers("range", j.range);
    j.limited = limited(doc, a, "limited", "range", j.range) && j.type != JointType::free;
    a.numbers("actuatorfrcrange", j.actuator_force_range);
    j.actuator_force_limited =
        limited(doc, a, "actuatorfrclimited", "actuatorfrcrange", j.actuator_force_range) && j.type >= JointType::slide;
    a.number("ref", j.ref);
    a.number("springref", j.springref);
    a.number("armature", j.armature);
    a.number("frictionloss", j.frictionloss);
    a.number("margin", j.margin);
    a.boolean("actuatorgravcomp", j.actuator_gravcomp);
    polynomial(a, "stiffness", j.stiffness, j.stiffness_poly);
    polynomial(a, "damping", j.damping, j.damping_poly);
    a.numbers("springdamper", j.springdamper);
    softness(a, j.limit, "limit");
    softness(a, j.friction, "friction");
    rigidity(doc, a, node, j.rigid_limit, "limit", true);
    if (j.limited && j.type != JointType::slide) j.range = {angle(doc, j.range[0]), angle(doc, j.range[1])};
    if (j.type == JointType::hinge) {
      j.ref = angle(doc, j.ref);
      j.springref = angle(doc, j.springref);
    }
  }
  j.pos = frame * j.pos;
  j.axis = gsp::detail::rotate(frame.q, j.axis);
  to.body.joints.push_back(std::move(j));
  to.joint_ids.push_back(doc.session.next_id++);
}

inline void read_inertial(Document& doc, Node const& node, BodyDraft& to) {
  doc.check(node);
  auto const a = doc.attributes(node);
  if (to.body.has_inertial) a.fail("", "is the second of its body; keep one");
  auto& i = to.body.inertial;
  to.body.has_inertial = true;
  if (!a.numbers("pos", i.pos)) a.fail("pos", "is missing; give the centre of mass");
  if (!a.number("mass", i.mass)) a.fail("mass", "is missing; give the mass");
  i.quat = orientation(doc, a);
  Double3 diagonal{};
  bool const simple = a.numbers("diaginertia", diagonal), full = a.numbers("fullinertia", i.inertia);
  if (simple && full) a.fail("fullinertia", "stands beside diaginertia; keep one");
  if (full && (a.has("quat") || a.has("axisangle") || a.has("euler") || a.has("xyaxes") || a.has("zaxis")))
    a.fail("fullinertia", "stands beside an orientation; remove one of the two");
  if (!full) i.inertia = {diagonal[0], diagonal[1], diagonal[2], 0, 0, 0};
  if (full && i.inertia[3] == 0 && i.inertia[4] == 0 &&
      i.inertia[5] == 0) {  // its frame is sorted all the same; that of diaginertia is not
    auto const axes = gsp::detail::principal_axes(i.inertia);
    i.inertia = {axes.moments[0], axes.moments[1], axes.moments[2], 0, 0, 0};
    i.quat = axes.quat;
  }
}

/// The pose of a shape; between two points also its half length, and local z points from the second to the first.
inline Pose shape_pose(Document const& doc, Attributes const& a, ShapeType type, Double3& size) {
  std::array<double, 6> v{};
  if (!a.numbers("fromto", v)) return pose_of(doc, a);
  if (type != ShapeType::capsule && type != ShapeType::cylinder && type != ShapeType::box && type != ShapeType::ellipsoid)
    a.fail("fromto", "is for capsule, cylinder, box and ellipsoid; give pos and size");
  Double3 pos{};
  a.numbers("pos", pos);
  if (pos != Double3{}) a.fail("fromto", "stands beside pos; keep one");
  Double3 const from{v[0], v[1], v[2]}, to{v[3], v[4], v[5]}, along = from - to;
  double const length = norm(along);
  if (!(length > 1e-14)) a.fail("fromto", "has two equal points; move one");
  if (type == ShapeType::capsule || type == ShapeType::cylinder)
    size[1] = length / 2;
  else {
    size[2] = length / 2;
    size[1] = size[0];
  }
  return {0.5 * (from + to), quat_of_z((1 / length) * along)};
}
inline ShapeType shape_type(Attributes const& a, ShapeType fallback) {
  if (!a.has("type")) return fallback;
  int const k = a.choice("type", {"plane", "hfield", "sphere", "capsule", "ellipsoid", "cylinder", "box", "mesh", "sdf"});
  return k == 8 ? ShapeType::mesh : static_cast<ShapeType>(k);
}

/// Geoms whose file is missing: visual ones may be left out where their body does not take its inertia from them.
inline void without_shape(Document& doc, Node const& node, GeomDescription const& g, BodyDraft& to, std::string const& why) {
  std::string const name = g.name.empty() ? "" : " " + in_quotes(g.name);
  if (!g.visual()) {
    if (!doc.session.list_refusals) throw Error(why);
    doc.note(Line::refused, node.place, "geom" + name + " collides with a shape whose file is missing");
  } else if (doc.session.skip_visuals) {
    auto const& c = doc.draft.compiler;
    bool const weighs =
        (g.has_mass ? g.mass > 0 : g.density > 0) && g.group >= c.inertia_group_range[0] && g.group <= c.inertia_group_range[1];
    if (weighs) to.needs_mesh = node.place;
    doc.note(Line::left_out, node.place, "visual geoms whose mesh is missing (MjcfOptions::skip_visuals, --skip-visuals)");
  } else {
    doc.note(Line::refused, node.place,
             "visual geoms whose mesh is missing; leave them out with MjcfOptions::skip_visuals (--skip-visuals)");
  }
}
inline void read_geom(Document& doc, Node const& node, BodyDraft& to, Pose const& frame, std::string const& childclass) {
  doc.check(node);
  for (auto const& child : node.children) doc.refuse_element(child, "<geom> ");
  doc.count(1, node.place);
  auto const a = doc.attributes(node, "geom", childclass);
  GeomDescription g;
  g.place = node.place;
  g.name = a.own("name") ? a.text("name") : "";
  g.type = shape_type(a, ShapeType::sphere);
  if (a.text("type") == "sdf")
    doc.refuse(node.place, "<geom> type='sdf': signed distance fields are not supported; use mesh or a primitive");
  a.integer("contype", g.contype);
  a.integer("conaffinity", g.conaffinity);
  a.integer("condim", g.condim);
  a.integer("priority", g.priority);
  a.integer("group", g.group);
  a.numbers("size", g.size, false);
  a.numbers("friction", g.friction, false);
  a.number("solmix", g.solmix);
  a.number("margin", g.margin);
  a.number("gap", g.gap);
  a.number("density", g.density);
  a.numbers("surfacevel", g.surface_velocity, false);
  for (double const v : g.surface_velocity)
    if (std::abs(v) > gsp::state_bound) a.fail("surfacevel", "is beyond 1e10 m/s or rad/s, where worlds stop; give less");
  a.number("adhesion", g.adhesion);
  a.number("fitscale", g.fitscale);
  if (a.has("fluidshape")) g.fluid_ellipsoid = a.choice("fluidshape", {"none", "ellipsoid"}) == 1;
  a.numbers("fluidcoef", g.fluid_coef, false);
  g.has_mass = a.number("mass", g.mass);
  a.boolean("shellinertia", g.shell_inertia);
  softness(a, g.softness, "");
  RigidDescription rigid{g.hard, g.restitution, g.erp};
  rigidity(doc, a, node, rigid, "", true);
  g.hard = rigid.hard;
  g.restitution = rigid.restitution;
  g.erp = rigid.erp;
  std::array<double, 4> rgba{0.5, 0.5, 0.5, 1};
  bool const colour = a.numbers("rgba", rgba);
  g.rgba = {float(rgba[0]), float(rgba[1]), float(rgba[2]), float(rgba[3])};
  if (a.has("material")) {
    auto const found = doc.materials.find(a.text("material"));
    if (found == doc.materials.end())
      a.fail("material", "is " + in_quotes(a.text("material")) + ", which does not exist; correct the name");
    if (!colour) g.rgba = found->second;
    g.material_alpha = found->second[3];
  }
  g.mesh = a.text("mesh");
  g.hfield = a.text("hfield");
  if (auto const lost = doc.missing.find(g.mesh.empty() ? g.hfield : g.mesh); lost != doc.missing.end()) {
    without_shape(doc, node, g, to, lost->second);
    return;
  }
  if (g.type == ShapeType::plane && !(g.size[2] > 0))
    a.fail("size", "has no positive third number, as a plane's must be (the spacing of its grid lines); write size=\"0 0 1\"");
  set_pose(g, frame * shape_pose(doc, a, g.type, g.size));
  to.body.geoms.push_back(std::move(g));
}

inline void read_site(Document& doc, Node const& node, BodyDraft& to, Pose const& frame, std::string const& childclass) {
  doc.check(node);
  doc.count(1, node.place);
  auto const a = doc.attributes(node, "site", childclass);
  SiteDescription s;
  s.place = node.place;
  s.name = a.own("name") ? a.text("name") : "";
  s.type = shape_type(a, ShapeType::sphere);
  a.numbers("size", s.size, false);
  a.integer("group", s.group);
  set_pose(s, frame * shape_pose(doc, a, s.type, s.size));
  to.body.sites.push_back(std::move(s));
}

inline void read_camera(Document& doc, Node const& node, BodyDraft& to, Pose const& frame, std::string const& childclass) {
  doc.check(node);
  doc.count(1, node.place);
  auto const a = doc.attributes(node, "camera", childclass);
  CameraDescription c;
  c.place = node.place;
  c.name = a.own("name") ? a.text("name") : "";
  c.target = a.text("target");
  double constexpr pi = 3.14159265358979323846;
  double fovy = 45;
  a.number("fovy", fovy);
  if (!(fovy < 180)) a.fail("fovy", "is 180 degrees or more; give less");
  c.fovy = fovy * (pi / 180);
  // fovy of a sensor: 2 atan(half height / focal length), as MuJoCo in float
  std::array<double, 2> sensor{0, 0}, focal{0, 0}, focal_pixel{0, 0}, principal{0, 0}, principal_pixel{0, 0}, resolution{1, 1};
  a.numbers("sensorsize", sensor);
  a.numbers("focal", focal);
  a.numbers("focalpixel", focal_pixel);
  a.numbers("resolution", resolution);
  a.numbers("principal", principal);
  a.numbers("principalpixel", principal_pixel);
  for (int k = 0; k < 2; ++k) {
    if (!(resolution[k] >= 1 && resolution[k] <= 1e6) || resolution[k] != std::floor(resolution[k]))
      a.fail("resolution", "is not two whole numbers from 1 to 1000000; correct it");
    c.resolution[k] = int(resolution[k]);
  }
  if (a.own("fovy") && a.own("sensorsize")) a.fail("fovy", "stands beside sensorsize, which says it too; remove one");
  bool const sized = sensor[0] > 0 && sensor[1] > 0;
  if (!sized && (focal[0] != 0 || focal[1] != 0 || focal_pixel[0] != 0 || focal_pixel[1] != 0))
    a.fail("focal", "needs sensorsize; give both");
  if (!sized && (principal[0] != 0 || principal[1] != 0 || principal_pixel[0] != 0 || principal_pixel[1] != 0))
    a.fail("principal", "needs sensorsize; give both");
  if (sized) {
    if (!a.has("resolution")) a.fail("sensorsize", "needs a resolution; give both");
    for (int k = 0; k < 2; ++k) {
      float const size = float(sensor[k]), density = float(resolution[k]) / size;
      c.sensor_size[k] = size;
      c.focal[k] = focal_pixel[k] != 0 ? float(focal_pixel[k]) / density : float(focal[k]);
      c.principal[k] = principal_pixel[k] != 0 ? float(principal_pixel[k]) / density : float(principal[k]);
    }
    if (!(c.focal[1] > 0)) a.fail("sensorsize", "needs a focal length above 0; give focal or focalpixel");
    c.fovy = std::atan2(float(c.sensor_size[1]) / 2, float(c.focal[1])) * 2;
  }
  if (a.has("projection") && a.choice("projection", {"perspective", "orthographic"}) == 1)
    doc.refuse(node.place, "<camera> projection='orthographic' is not supported; use perspective");
  if (a.has("mode")) c.mode = static_cast<CameraMode>(a.choice("mode", {"fixed", "track", "trackcom", "targetbody", "targetbodycom"}));
  set_pose(c, frame * pose_of(doc, a));
  to.body.cameras.push_back(std::move(c));
}

}  // namespace gsp::io::detail::mjcf
