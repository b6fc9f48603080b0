#pragma once
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <gsp/model/compiled.hpp>
#include <gsp/model/detail/host_math.hpp>
#include <gsp/model/detail/mesh_inertia.hpp>
#include <map>
#include <numeric>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

namespace gsp::detail {

/// What can be seen to be in vain before anything moves: lines of the report, each with the place, the names and the remedy.
class ModelNotes {
 public:
  ModelNotes(Description const& d, CompiledModel& m) : d_(d), m_(m) {}
  void write() {
    for (int k = 0; k < m_.neq; ++k)
      if (m_.eq_active[k]) equality(k);
    softnesses();
    ranges();
    rigid_in_vain();
    lone_gravcomp();
    filters();
    far_centers();
    meshes();
  }

 private:
  using Kind = ReportLine::Kind;
  void note(Place const& place, Kind kind, std::string const& text, int count = 1) {
    m_.report.push_back({kind, place.file >= 0 ? d_.files[std::size_t(place.file)] : d_.name, place.line, text, count});
  }
  static std::string number(double x) {
    char text[32];
    std::snprintf(text, sizeof text, "%.3g", x);
    return text;
  }

  bool is_mocap(int body) const { return !m_.body_mocap.empty() && m_.body_mocap[body] >= 0; }
  // One end of a connect or weld: its frame in that of the body whose joints, or whose user, move it.
  struct End {
    int mover = 0;
    Pose at;
  };
  End carried(int body, Pose at) const {
    while (body > 0 && m_.body_dofnum[body] == 0 && !is_mocap(body)) {
      at = Pose{m_.body_pos[body], m_.body_quat[body]} * at;
      body = m_.body_parent[body];
    }
    return {body, at};
  }
  End end(int k, int which) const {
    auto const& data = m_.eq_data[k];
    bool const weld = m_.eq_type[k] == int(EqualityType::weld);
    int const id = which == 0 ? m_.eq_id1[k] : m_.eq_id2[k];
    if (m_.eq_sites[k]) return carried(m_.site_body[id], {m_.site_pos[id], m_.site_quat[id]});
    std::size_t const first = weld == (which == 0) ? 3 : 0;
    Pose at{{data[first], data[first + 1], data[first + 2]}, {1, 0, 0, 0}};
    if (weld && which == 0) at.q = {data[6], data[7], data[8], data[9]};
    return carried(id, at);
  }
  std::string name_of(int id, bool site) const {
    if (id == 0 && !site) return "the world";
    return "'" + (site ? m_.site_name[id] : m_.body_name[id]) + "'";
  }

  /// By its name, or by its type and what it joins.
  std::string equality_name(int k) const {
    if (!m_.eq_name[k].empty()) return "equality '" + m_.eq_name[k] + "'";
    auto const type = EqualityType(m_.eq_type[k]);
    auto const of = [&](int id) -> std::string {
      bool const joint = type == EqualityType::joint, other = joint || type == EqualityType::tendon;
      auto const& names = joint ? m_.jnt_name : other ? m_.tendon_name : m_.eq_sites[k] ? m_.site_name : m_.body_name;
      char const* const what = joint ? "joint " : other ? "tendon " : m_.eq_sites[k] ? "site " : "body ";
      if (id == 0 && !other && !m_.eq_sites[k]) return "the world";
      return what + (names[id].empty() ? std::to_string(id) : "'" + names[id] + "'");
    };
    char const* const types[] = {"connect", "weld", "joint equality", "tendon equality"};
    std::string const begin = std::string(types[int(type)]) + " of ";
    return m_.eq_id2[k] < 0 ? begin + of(m_.eq_id1[k]) : begin + of(m_.eq_id1[k]) + " and " + of(m_.eq_id2[k]);
  }

  void equality(int k) {
    auto const type = EqualityType(m_.eq_type[k]);
    auto const& place = d_.equalities[std::size_t(k)].place;
    std::string const what = equality_name(k) + " ";
    auto const contradicts = [&](int other) {
      auto const rigid = [&](int e) { return !m_.eq_rigid.empty() && m_.eq_rigid[e][0] > 0; };
      note(place, Kind::approximated,
           what + "and " + (m_.eq_name[other].empty() ? equality_name(other) : "'" + m_.eq_name[other] + "'") +
               " ask different things of the same two: " +
               (rigid(k) || rigid(other) ? "what is rigid holds, of two such the first"
                                         : "neither holds, and where they meet depends on solref and solimp"));
    };
    if (type == EqualityType::joint || type == EqualityType::tendon) {
      for (int other = 0; other < k; ++other) {
        bool const same = m_.eq_active[other] && m_.eq_type[other] == m_.eq_type[k] && m_.eq_id1[other] == m_.eq_id1[k] &&
                          m_.eq_id2[other] == m_.eq_id2[k];
        if (same && !std::equal(m_.eq_data[k].begin(), m_.eq_data[k].begin() + 5, m_.eq_data[other].begin())) contradicts(other);
      }
      if (type == EqualityType::joint && m_.eq_id2[k] < 0) beyond_range(k, what, place);
      return;
    }
    End const one = end(k, 0), two = end(k, 1);
    auto const given = [&](End const& end) { return end.mover == 0 || is_mocap(end.mover); };
    if (one.mover == two.mover || (given(one) && given(two)))
      return note(place, Kind::no_effect,
                  what + "joins " + name_of(m_.eq_id1[k], m_.eq_sites[k]) + " and " + name_of(m_.eq_id2[k], m_.eq_sites[k]) +
                      (one.mover == two.mover ? ", which do not move against each other" : ", which no joint moves"));
    for (int other = 0; other < k; ++other)
      if (m_.eq_active[other] && m_.eq_type[other] <= int(EqualityType::weld) && apart(k, one, two, other)) contradicts(other);
    if (double const gap = least_gap(one, two); gap > 0)
      note(place, Kind::approximated,
           what + "cannot close: the joints between them leave its two points at least " + number(gap) +
               " m apart, and it will pull without end: correct its points, or the bodies between them");
  }

  // A body that is to be heavier, where none is to be lighter.
  void lone_gravcomp() {
    for (auto const& body : d_.bodies) {
      if (body.gravcomp > 0) return;
    }
    for (auto const& body : d_.bodies)
      if (body.gravcomp < 0)
        note(body.place, Kind::no_effect,
             "body '" + body.name + "' has gravcomp " + number(body.gravcomp) +
                 ", which does nothing where no body has one above 0, as in MuJoCo");
  }

  // Ranges that limit nothing. A file that says so (limited="false") means it.
  void ranges() {
    auto const check = [&](Place const& place, std::string const& who, char const* flag, bool limited, std::array<double, 2> const& range) {
      if (place.file < 0 && !limited && range[0] < range[1])
        note(place, Kind::no_effect,
             who + " has a range of " + number(range[0]) + " to " + number(range[1]) + ", and " + flag + " is false: set it");
    };
    for (auto const& body : d_.bodies)
      for (auto const& j : body.joints) {
        check(j.place, "joint '" + j.name + "'", "limited", j.limited, j.range);
        check(j.place, "joint '" + j.name + "'", "actuator_force_limited", j.actuator_force_limited, j.actuator_force_range);
      }
    for (auto const& t : d_.tendons) check(t.place, "tendon '" + t.name + "'", "limited", t.limited, t.range);
    for (auto const& a : d_.actuators) {
      check(a.place, "actuator '" + a.name + "'", "ctrl_limited", a.ctrl_limited, a.ctrl_range);
      check(a.place, "actuator '" + a.name + "'", "force_limited", a.force_limited, a.force_range);
      check(a.place, "actuator '" + a.name + "'", "act_limited", a.act_limited, a.act_range);
    }
  }

  // What is rigid or bounces, and nothing is that it could. Alike ones are said once, by the first. Readers say themselves what is given
  // without hard: they alone see what stands in the file.
  void rigid_in_vain() {
    struct Said {
      Place place;
      std::string text;
      int count = 0;
    };
    std::map<std::string, Said> said;  // in an order that does not depend on the model's
    auto const say = [&](Place const& place, std::string const& who, std::string const& text) {
      auto& one = said[text];
      if (one.count++ > 0) return;
      one.place = place;
      one.text = who + text;
    };
    auto const unlimited = [&](Place const& place, std::string const& who, RigidDescription const& r, bool limited) {
      if (r.hard && !limited) say(place, who, " has a rigid limit (hardlimit) and no range that limits it: give it a range");
    };
    auto const soft = [&](Place const& place, std::string const& who, RigidDescription const& r, double erp, char const* flag) {
      if (place.file >= 0 || r.hard || (r.restitution == 0 && r.erp == erp)) return;
      say(place, who, std::string(" has a restitution or an erp, and only what is rigid asks for them: set ") + flag);
    };
    double const erp = RigidDescription{}.erp;
    for (auto const& body : d_.bodies) {
      for (auto const& j : body.joints) {
        unlimited(j.place, "joint '" + j.name + "'", j.rigid_limit, j.limited && j.type != JointType::free);
        soft(j.place, "joint '" + j.name + "'", j.rigid_limit, erp, "rigid_limit.hard");
      }
      for (auto const& g : body.geoms)
        if (!g.visual()) soft(g.place, "geom '" + g.name + "'", {g.hard, g.restitution, g.erp}, erp, "hard");
    }
    for (auto const& t : d_.tendons) {
      unlimited(t.place, "tendon '" + t.name + "'", t.rigid_limit, t.limited);
      soft(t.place, "tendon '" + t.name + "'", t.rigid_limit, erp, "rigid_limit.hard");
    }
    for (auto const& p : d_.pairs) soft(p.place, "pair '" + p.name + "'", p.rigid, erp, "rigid.hard");
    for (int k = 0; k < m_.neq; ++k) {
      auto const& e = d_.equalities[std::size_t(k)];
      soft(e.place, equality_name(k), e.rigid, EqualityDescription{}.rigid.erp, "rigid.hard");
    }
    for (auto const& [text, one] : said) note(one.place, Kind::no_effect, one.text, one.count);
  }

  // A joint that is to stand where its limits do not let it.
  void beyond_range(int k, std::string const& what, Place const& place) {
    int const j = m_.eq_id1[k];
    double const asked = m_.qpos0[m_.jnt_qposadr[j]] + m_.eq_data[k][0];
    auto const& range = m_.jnt_range[j];
    if (m_.jnt_limited[j] && (asked < range[0] || asked > range[1]))
      note(place, Kind::approximated,
           what + "asks joint '" + m_.jnt_name[j] + "' for " + number(asked) + ", outside of its range " + number(range[0]) + " to " +
               number(range[1]) + ": they pull against each other: correct one of the two");
  }

  /// Whether two of them cannot hold both. With X, Y the poses of the bodies, X a = Y b for points, X^-1 Y = (t, R) for a weld:
  ///   two connects |a - a'| = |b - b'|; with a weld a - a' = R (b - b'); two welds R = R' too
  bool apart(int k, End const& one, End const& two, int other) const {
    End first = end(other, 0), second = end(other, 1);
    if (first.mover == two.mover && second.mover == one.mover) std::swap(first, second);
    if (first.mover != one.mover || second.mover != two.mover) return false;
    auto const turn = [&](int e, End const& a, End const& b) -> std::optional<Double4> {
      if (m_.eq_type[e] != int(EqualityType::weld)) return {};
      return times(a.at.q, {b.at.q[0], -b.at.q[1], -b.at.q[2], -b.at.q[3]});
    };
    auto const own = turn(k, one, two), others = turn(other, first, second);
    Double3 const a = one.at.p - first.at.p, b = two.at.p - second.at.p;
    double const length = 1e-3 * std::max(norm(one.at.p) + norm(two.at.p), norm(first.at.p) + norm(second.at.p));
    if (own && others) {
      double const cosine =
          std::abs((*own)[0] * (*others)[0] + (*own)[1] * (*others)[1] + (*own)[2] * (*others)[2] + (*own)[3] * (*others)[3]);
      if (cosine < 1 - 1e-6) return true;  // more than 3 mrad
    }
    if (own || others) return norm(a - rotate(own ? *own : *others, b)) > length;
    return std::abs(norm(a) - norm(b)) > length;
  }

  /// How far apart its points stay whatever the joints do, at least; 0: not known to. From the one point over the anchors of the joints
  /// between to the other runs a polygon whose sides the joints keep: it closes if its longest side is no longer than all others together.
  double least_gap(End const& one, End const& two) const {
    std::vector<double> sides;  // that are kept
    double slack = 0;           // what slides add
    std::vector<int> above;     // of the first, with the world
    for (int b = one.mover; b >= 0; b = b == 0 ? -1 : m_.body_parent[b]) above.push_back(b);
    int meet = two.mover;
    while (std::find(above.begin(), above.end(), meet) == above.end()) meet = m_.body_parent[meet];
    Double3 ends[2];
    for (int which = 0; which < 2; ++which) {
      End const& from = which == 0 ? one : two;
      Double3 at = from.at.p;
      for (int b = from.mover; b != meet; b = m_.body_parent[b]) {
        if (is_mocap(b)) return 0;  // wherever the user puts it
        for (int j = m_.body_jntadr[b] + m_.body_jntnum[b] - 1; j >= m_.body_jntadr[b] && j >= 0; --j) {
          auto const type = JointType(m_.jnt_type[j]);
          if (type == JointType::free || (type == JointType::slide && !m_.jnt_limited[j])) return 0;
          if (type == JointType::slide) {
            double const rest = m_.qpos0[m_.jnt_qposadr[j]];
            slack += std::max(std::abs(m_.jnt_range[j][0] - rest), std::abs(m_.jnt_range[j][1] - rest));
          } else {
            sides.push_back(norm(at - m_.jnt_pos[j]));
            at = m_.jnt_pos[j];
          }
        }
        at = Pose{m_.body_pos[b], m_.body_quat[b]} * at;
      }
      ends[which] = at;
    }
    sides.push_back(norm(ends[0] - ends[1]));
    double const longest = *std::max_element(sides.begin(), sides.end());
    double others = slack - longest;
    for (double side : sides) others += side;
    return longest - others > 1e-3 * longest ? longest - others : 0;
  }

  // Softness that is taken for another. Values that many share are said once.
  void softnesses() {
    struct Said {
      Place place;
      std::string text;
      int count = 0;
    };
    std::map<std::string, std::size_t> known;
    std::vector<Said> said;
    auto const mixed = [](std::array<double, 2> const& solref) { return (solref[0] > 0) != (solref[1] > 0); };
    auto const neither = [&](std::string const& attribute, std::array<double, 2> const& solref, std::string const& instead) {
      return " has " + attribute + " " + number(solref[0]) + " " + number(solref[1]) +
             ", neither a time constant and a damping ratio nor -stiffness and -damping: " + instead + ": correct it";
    };
    auto const say = [&](Place const& place, std::string const& what, std::string const& text) {
      if (text.empty()) return;
      auto const [found, is_new] = known.emplace(text, said.size());
      if (is_new) said.push_back({place, what + text, 0});
      ++said[found->second].count;
    };
    auto const look = [&](Place const& place, std::string const& what, SoftnessDescription const& s) {
      std::string text;
      auto const& [d0, dw, width, mid, power] = s.solimp;
      if (d0 < 0 || d0 > 1 || dw < 0 || dw > 1 || width < 0 || mid < 0 || mid > 1 || power < 1)
        text = " has solimp " + number(d0) + " " + number(dw) + " " + number(width) + " " + number(mid) + " " + number(power) +
               ", which is taken at the nearest of 0.0001 to 0.9999 twice, 0 or more, 0.0001 to 0.9999, 1 or more: correct it";
      if (mixed(s.solref)) text += (text.empty() ? "" : "; and") + neither("solref", s.solref, "it is taken as 0.02 1");
      say(place, what, text);
    };
    for (auto const& body : d_.bodies) {
      for (auto const& j : body.joints) {
        if (j.limited) look(j.place, "joint '" + j.name + "' (limit)", j.limit);
        if (j.frictionloss > 0) look(j.place, "joint '" + j.name + "' (frictionloss)", j.friction);
      }
      for (auto const& g : body.geoms)
        if (!g.visual()) look(g.place, "geom '" + g.name + "'", g.softness);
    }
    for (auto const& t : d_.tendons) {
      if (t.limited) look(t.place, "tendon '" + t.name + "' (limit)", t.limit);
      if (t.frictionloss > 0) look(t.place, "tendon '" + t.name + "' (frictionloss)", t.friction);
    }
    for (int k = 0; k < m_.neq; ++k) look(d_.equalities[std::size_t(k)].place, equality_name(k), d_.equalities[std::size_t(k)].softness);
    for (auto const& p : d_.pairs) {
      SoftnessDescription s;
      s.solref = p.solref.value_or(s.solref);
      s.solimp = p.solimp.value_or(s.solimp);
      look(p.place, "pair '" + p.name + "'", s);
      if (p.solreffriction && mixed(*p.solreffriction))
        say(p.place, "pair '" + p.name + "'", neither("solreffriction", *p.solreffriction, "its friction is as soft as solref says"));
    }
    for (auto const& s : said) note(s.place, Kind::approximated, s.text, s.count);
  }

  // Steps of h of a' = (u - a)/T grow without bound: for h > 2 T, and of RK4, which takes filterexact as a filter, for h > 2.785 T.
  void filters() {
    bool const runge_kutta = d_.option.integrator == Integrator::rk4;
    for (auto const& a : d_.actuators) {
      double const ratio = d_.option.timestep / std::max(a.dynprm[0], 1e-15);
      bool const plain = a.dynamics == ActuatorDynamics::filter, exact = a.dynamics == ActuatorDynamics::filter_exact;
      if ((plain && ratio > 2) || (exact && runge_kutta && ratio > 2.785))
        note(a.place, Kind::approximated,
             "actuator '" + a.name + "' filters with a time constant of " + number(a.dynprm[0]) + " s, too short for steps of " +
                 number(d_.option.timestep) + (plain ? " s" : " s of RK4") + ": its activation grows without bound: give " +
                 (plain && !runge_kutta ? "dyntype=\"filterexact\"" : "another integrator and dyntype=\"filterexact\""));
    }
  }

  // Meshes whose volume is taken and that bound none: open ones, and those whose faces look inwards. Of meshes that only touch, are only
  // seen or stand still nothing hangs on it: a hull has neither.
  void meshes() {
    std::set<std::string> weigh;
    auto const& c = d_.compiler;
    for (std::size_t b = 0; b < d_.bodies.size(); ++b) {
      auto const& body = d_.bodies[b];
      bool const from_geoms = m_.body_weld[b] != 0 && !c.inertia_from_geom_never && (!body.has_inertial || c.inertia_from_geom_always);
      for (auto const& g : body.geoms) {
        bool const weighs = from_geoms && g.group >= c.inertia_group_range[0] && g.group <= c.inertia_group_range[1] &&
                            (g.has_mass ? g.mass : g.density) > 0;
        bool const fitted = g.type != ShapeType::mesh && !c.fit_aabb;  // its sizes are of the mesh's inertia
        if (!g.mesh.empty() && (g.type == ShapeType::mesh || fitted) && (weighs || fitted)) weigh.insert(g.mesh);
      }
    }
    for (auto const& mesh : d_.meshes)
      if (weigh.contains(mesh.name) && !mesh.faces.empty() && (mesh.inertia == MeshInertia::legacy || mesh.inertia == MeshInertia::exact))
        mesh_bounds(mesh);
  }
  void mesh_bounds(MeshDescription const& mesh) {
    // vertices at one place are one: files often repeat them at seams
    std::vector<int> order(mesh.vertices.size()), same(mesh.vertices.size());
    std::iota(order.begin(), order.end(), 0);
    std::sort(order.begin(), order.end(), [&](int a, int b) { return mesh.vertices[a] < mesh.vertices[b]; });
    for (std::size_t i = 0; i < order.size(); ++i)
      same[order[i]] = i > 0 && mesh.vertices[order[i]] == mesh.vertices[order[i - 1]] ? same[order[i - 1]] : order[i];
    std::vector<std::pair<int, int>> edges;
    edges.reserve(3 * mesh.faces.size());
    for (auto const& f : mesh.faces)
      for (int k = 0; k < 3; ++k)
        if (int const a = same[f[k]], b = same[f[(k + 1) % 3]]; a != b) edges.push_back(std::minmax(a, b));
    std::sort(edges.begin(), edges.end());
    int open = 0, all = 0;
    for (std::size_t i = 0, end = 0; i < edges.size(); i = end, ++all) {
      while (end < edges.size() && edges[end] == edges[i]) ++end;
      open += (end - i) % 2;
    }
    Double3 middle{0, 0, 0};  // of the faces, as mesh_solid takes it
    double area = 0, volume = 0;
    auto const each = [&](auto const& f) {
      for (auto const& face : mesh.faces) {
        Double3 x[3];
        for (int k = 0; k < 3; ++k)
          for (int i = 0; i < 3; ++i) x[k][i] = mesh.vertices[face[k]][i];
        f(mesh_triangle(x[0], x[1], x[2]));
      }
    };
    each([&](MeshTriangle const& t) {
      middle = middle + t.twice_area * t.center;
      area += t.twice_area;
    });
    if (area > 0) middle = (1 / area) * middle;
    each([&](MeshTriangle const& t) { volume += dot(t.center - middle, t.cross); });
    if (open == 0 && volume >= 0) return;
    std::string text = "mesh '" + mesh.name + "'";
    if (open > 0)
      text += " is open (" + std::to_string(open) + " of its " + std::to_string(all) +
              " edges lack a face): what its faces span with their middle is taken for its volume";
    if (volume < 0)
      text += std::string(open > 0 ? "; it" : "") + " is inside out (its faces look inwards): the absolute value of its volumes is taken";
    note(mesh.place, Kind::approximated,
         text + ", as in MuJoCo: " + (open > 0 ? "close it, or set its inertia to \"convex\" or \"shell\"" : "turn its faces over"));
  }

  // A free body's M about its frame is I + m r^2: of I, float keeps 24 bits less those of m r^2 / I.
  void far_centers() {
    for (int j = 0; j < m_.njnt; ++j) {
      if (m_.jnt_type[j] != int(JointType::free)) continue;
      int const b = m_.jnt_body[j];
      auto const& I = m_.body_inertia[b];
      double const r = norm(m_.body_ipos[b]), least = std::min({I[0], I[1], I[2]});
      if (m_.body_mass[b] * r * r > 1e5 * least)
        note(d_.bodies[std::size_t(b)].place, Kind::approximated,
             "body '" + m_.body_name[b] + "' has its centre of mass " + number(r) + " m from its frame, and turns about it with " +
                 number(least) + " kg m^2 at least, which float loses beside m r^2 = " + number(m_.body_mass[b] * r * r) +
                 ": give its free joint align=\"true\", or compute in double");
    }
  }

  Description const& d_;
  CompiledModel& m_;
};

}  // namespace gsp::detail
