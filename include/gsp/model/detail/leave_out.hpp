#pragma once
#include <gsp/core/check.hpp>
#include <gsp/model/compiled.hpp>
#include <gsp/model/detail/host_math.hpp>
#include <gsp/model/detail/principal_axes.hpp>
#include <gsp/model/detail/references.hpp>
#include <string>
#include <utility>
#include <vector>

/// Descriptions without what compiler discardvisual and fusestatic leave out: the same motion with less.
namespace gsp::detail {

/// All names that lists and cameras mention.
inline NameSet mentioned(Description const& d) {
  NameSet names;
  auto const add = [&](Kind kind, std::string const& name) { names.add(kind, name); };
  auto const all = [&](auto const& list) {
    for (auto const& entry : list) for_each_reference(entry, add);
  };
  all(d.tendons);
  all(d.actuators);
  all(d.equalities);
  all(d.sensors);
  all(d.pairs);
  all(d.excludes);
  for (auto const& b : d.bodies)
    for (auto const& c : b.cameras) names.add(Kind::body, c.target);
  return names;
}

/// The inertial that compile found for a body, in the body's frame.
inline InertialDescription inertial_of(CompiledModel const& m, int b) {
  auto const& i = m.body_inertia[b];
  return {m.body_ipos[b], m.body_iquat[b], m.body_mass[b], {i[0], i[1], i[2], 0, 0, 0}};
}

/// Without geoms that are only seen: no contact, no fluid, named by nothing. Bodies that took their mass from one get it as an inertial.
inline Description without_visuals(Description d, CompiledModel const& m) {
  auto const names = mentioned(d);
  auto const& c = d.compiler;
  for (int b = 0; b < int(d.bodies.size()); ++b) {
    auto& body = d.bodies[b];
    bool weighs = false;
    std::erase_if(body.geoms, [&](GeomDescription const& g) {
      if (!g.visual() || g.parts > 0 || g.fluid_ellipsoid || names.has(Kind::geom, g.name)) return false;
      bool const counts =
          (g.has_mass ? g.mass > 0 : g.density > 0) && g.group >= c.inertia_group_range[0] && g.group <= c.inertia_group_range[1];
      weighs = weighs || counts;
      return true;
    });
    bool const inferred = b > 0 && !c.inertia_from_geom_never && (c.inertia_from_geom_always || !body.has_inertial);
    if (!weighs || !inferred || m.body_mass[b] == 0) continue;
    if (c.inertia_from_geom_always)
      throw Error(
          "body '" + body.name +
          "': a visual geom has mass, which compiler discardvisual would lose while inertiafromgeom is true: give the geom mass=\"0\" or "
          "set inertiafromgeom to auto");
    body.has_inertial = true;
    body.inertial = inertial_of(m, b);
  }
  NameSet used = names;
  for (auto const& b : d.bodies)
    for (auto const& g : b.geoms) used.add(Kind::mesh, g.mesh);
  std::erase_if(d.meshes, [&](MeshDescription const& mesh) { return !used.has(Kind::mesh, mesh.name); });
  return d;
}

/// The sum of two inertials, in the frame of the first; the second stands at `at` there.
inline InertialDescription sum_of_inertials(InertialDescription const& a, InertialDescription const& b, Pose const& at) {
  Double3 const pb = at * b.pos;
  auto const tensor_of = [](InertialDescription const& i, Double4 const& frame) {
    auto const axes = principal_axes(i.inertia);
    return rotated_diagonal(normalized(times(times(frame, normalized(i.quat)), axes.quat)), axes.moments);
  };
  Symmetric3 const ta = tensor_of(a, {1, 0, 0, 0}), tb = tensor_of(b, at.q);
  InertialDescription sum;
  sum.mass = a.mass + b.mass;
  sum.pos = (1 / sum.mass) * (a.mass * a.pos + b.mass * pb);
  auto const moved = [&](Symmetric3 const& t, double mass, Double3 const& from) {
    Double3 const r = from - sum.pos;
    double const rr = dot(r, r);
    return Symmetric3{t[0] + mass * (rr - r[0] * r[0]), t[1] + mass * (rr - r[1] * r[1]), t[2] + mass * (rr - r[2] * r[2]),
                      t[3] - mass * r[0] * r[1],        t[4] - mass * r[0] * r[2],        t[5] - mass * r[1] * r[2]};
  };
  auto const one = moved(ta, a.mass, a.pos), two = moved(tb, b.mass, pb);
  for (std::size_t k = 0; k < 6; ++k) sum.inertia[k] = one[k] + two[k];
  return sum;
}

/// Without bodies that do not move against their parents: what they carry goes to the parent. Kept are those that something names, that
/// carry the site of a force or torque sensor, whose fuse is false, or whose gravity compensation or drag would change (which what
/// stands in the world has none of).
inline Description without_static_bodies(Description d, CompiledModel const& m) {
  auto const names = mentioned(d);
  NameSet measured;
  for (auto const& s : d.sensors)
    if (s.type == "force" || s.type == "torque") measured.add(Kind::site, s.object);
  auto const& c = d.compiler;
  bool const fluid = d.option.density != 0 || d.option.viscosity != 0;
  bool const adjusts = c.boundmass > 0 || c.boundinertia > 0 || c.balanceinertia;
  int const n = int(d.bodies.size());
  std::vector<InertialDescription> inertial;
  for (int b = 0; b < n; ++b) inertial.push_back(inertial_of(m, b));
  std::vector<char> gone(std::size_t(n), 0);
  for (int b = 1; b < n; ++b) {
    auto& body = d.bodies[b];
    auto& parent = d.bodies[body.parent];
    bool const heavy = inertial[b].mass >= 1e-15, below_world = body.parent == 0;
    bool keep = !body.joints.empty() || body.mocap || !body.fuse || names.has(Kind::body, body.name);
    for (auto const& s : body.sites) keep = keep || (!s.name.empty() && measured.has(Kind::site, s.name));
    bool const feels = (heavy && (fluid || body.gravcomp != parent.gravcomp)) || (c.inertia_from_geom_always && adjusts);
    keep = keep || (feels && !below_world);
    for (auto const& g : body.geoms) keep = keep || (fluid && g.fluid_ellipsoid && !below_world);
    if (keep) continue;
    Pose const at{body.pos, normalized(body.quat)};
    if (heavy && !below_world) inertial[body.parent] = sum_of_inertials(inertial[body.parent], inertial[b], at);
    bool const carries = heavy || body.has_inertial || !body.geoms.empty();
    if (carries && !below_world && !c.inertia_from_geom_always) parent.has_inertial = true;
    auto const move = [&](auto& items, auto& to) {
      for (auto& x : items) {
        Pose const p = at * Pose{x.pos, normalized(x.quat)};
        x.pos = p.p;
        x.quat = normalized(p.q);
        to.push_back(std::move(x));
      }
    };
    move(body.geoms, parent.geoms);
    move(body.sites, parent.sites);
    move(body.cameras, parent.cameras);
    for (int child = b + 1; child < n; ++child) {
      auto& x = d.bodies[child];
      if (x.parent != b) continue;
      Pose const p = at * Pose{x.pos, normalized(x.quat)};
      x.pos = p.p;
      x.quat = normalized(p.q);
      x.parent = body.parent;
    }
    gone[b] = 1;
  }
  std::vector<int> index(std::size_t(n), 0);
  std::vector<BodyDescription> kept;
  for (int b = 0; b < n; ++b) {
    if (gone[b]) continue;
    index[b] = int(kept.size());
    auto& body = kept.emplace_back(std::move(d.bodies[b]));
    if (b > 0) body.parent = index[body.parent];
    if (b > 0 && body.has_inertial && !c.inertia_from_geom_always) body.inertial = inertial[b];
  }
  d.bodies = std::move(kept);
  return d;
}

/// Both, as the compiler's settings say. `bodies_of` compiles bodies and masses. The flags are cleared, so that the result compiles as it
/// is.
template <class BodiesOf>
Description left_out(Description d, BodiesOf const& bodies_of) {
  bool const visuals = std::exchange(d.compiler.discard_visual, false), fuse = std::exchange(d.compiler.fuse_static, false);
  double const total = std::exchange(d.compiler.settotalmass, -1);  // scales what is left, last
  if (visuals) d = without_visuals(d, bodies_of(d));
  if (fuse) d = without_static_bodies(d, bodies_of(d));
  d.compiler.settotalmass = total;
  return d;
}

}  // namespace gsp::detail
