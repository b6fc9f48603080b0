#pragma once
#include <algorithm>
#include <array>
#include <cmath>
#include <gsp/model/compiled.hpp>
#include <gsp/model/detail/host_math.hpp>
#include <gsp/model/detail/wrap.hpp>
#include <utility>
#include <vector>

namespace gsp::detail {

/// A row of a Jacobian over the model's degrees of freedom.
struct SparseRow {
  std::vector<std::pair<int, double>> entries;
  void add(int dof, double value) {
    for (auto e = entries.rbegin(); e != entries.rend(); ++e)
      if (e->first == dof) {
        e->second += value;
        return;
      }
    entries.emplace_back(dof, value);
  }
};
struct LengthAndRow {
  double length = 0;
  SparseRow row{};
};

/// Poses of a compiled model at given qpos, on the host in double, and what follows from them: lengths and moment arms of tendons and
/// actuators. Plain and complete rather than fast: `compile` needs it twice (and a search for lengths a few thousand times), and it shares
/// nothing with the kernels, so that each can check the other.
class InitialPose {
 public:
  InitialPose(CompiledModel const& m, std::vector<double> const& qpos) : m_(m), q_(qpos) {
    body_.resize(m.nbody);
    com_.resize(m.nbody);
    axis_.resize(m.nv);
    anchor_.resize(m.nv);
    turns_.assign(m.nv, 0);
    for (int b = 0; b < m.nbody; ++b) {
      Pose x = b == 0 ? Pose{m.body_pos[0], m.body_quat[0]} : body_[m.body_parent[b]] * Pose{m.body_pos[b], m.body_quat[b]};
      for (int j = m.body_jntadr[b], end = j + m.body_jntnum[b]; j < end; ++j) joint(j, x);
      x.q = normalized(x.q);
      body_[b] = x;
      com_[b] = x * m.body_ipos[b];
    }
    // centres of mass of subtrees; a body's own where it has no mass
    std::vector<double> mass(m.body_mass);
    subtree_.resize(m.nbody);
    for (int b = 0; b < m.nbody; ++b) subtree_[b] = m.body_mass[b] * com_[b];
    for (int b = m.nbody - 1; b > 0; --b) {
      mass[m.body_parent[b]] += mass[b];
      subtree_[m.body_parent[b]] = subtree_[m.body_parent[b]] + subtree_[b];
    }
    for (int b = 0; b < m.nbody; ++b) subtree_[b] = mass[b] < 1e-15 ? com_[b] : (1 / mass[b]) * subtree_[b];
  }

  Pose const& body(int b) const { return body_[b]; }
  Double3 const& com(int b) const { return com_[b]; }
  Double3 const& subtree_com(int b) const { return subtree_[b]; }
  Pose site(int s) const { return body_[m_.site_body[s]] * Pose{m_.site_pos[s], m_.site_quat[s]}; }
  Pose geom(int g) const { return body_[m_.geom_body[g]] * Pose{m_.geom_pos[g], m_.geom_quat[g]}; }
  Pose camera(int c) const { return body_[m_.cam_body[c]] * Pose{m_.cam_pos[c], m_.cam_quat[c]}; }

  /// Dofs that move a body, from the root down.
  std::vector<int> dofs_of(int b) const {
    std::vector<int> dofs;
    while (b > 0 && m_.body_dofnum[b] == 0) b = m_.body_parent[b];
    if (b == 0) return dofs;
    for (int d = m_.body_dofadr[b] + m_.body_dofnum[b] - 1; d >= 0; d = m_.dof_parent[d]) dofs.push_back(d);
    std::reverse(dofs.begin(), dofs.end());
    return dofs;
  }
  Double3 angular(int dof) const { return turns_[dof] ? axis_[dof] : Double3{0, 0, 0}; }
  Double3 linear(int dof, Double3 const& at) const { return turns_[dof] ? cross(axis_[dof], at - anchor_[dof]) : axis_[dof]; }

  /// Length and moment arms of a tendon.
  LengthAndRow tendon(int t) const {
    LengthAndRow out;
    for (int e = m_.tendon_termadr[t], end = e + m_.tendon_termnum[t]; e < end; ++e) {
      out.length += m_.term_coef[e] * q_[m_.jnt_qposadr[m_.term_jnt[e]]];
      out.row.add(m_.jnt_dofadr[m_.term_jnt[e]], m_.term_coef[e]);
    }
    double divisor = 1;
    for (int w = m_.tendon_wrapadr[t], end = w + m_.tendon_wrapnum[t]; w < end - 1;) {
      auto const kind = [&](int i) { return WrapType(m_.wrap_type[i]); };
      if (kind(w) == WrapType::pulley) divisor = m_.wrap_divisor[w];
      if (kind(w) == WrapType::pulley || kind(w + 1) == WrapType::pulley) {
        ++w;
        continue;
      }
      bool const round = kind(w + 1) == WrapType::sphere || kind(w + 1) == WrapType::cylinder;
      int const first = m_.wrap_id[w], last = m_.wrap_id[w + (round ? 2 : 1)], b0 = m_.site_body[first], b1 = m_.site_body[last];
      Double3 const x = site(first).p, y = site(last).p;
      std::optional<Wrap> wrap;
      if (round) {
        int const g = m_.wrap_id[w + 1], s = m_.wrap_side[w + 1];
        Double3 const side = s >= 0 ? site(s).p : Double3{};
        wrap = wrapped(x, y, geom(g), m_.geom_size[g][0], kind(w + 1) == WrapType::cylinder, s >= 0 ? &side : nullptr);
      }
      auto const straight = [&](int from, Double3 const& a, int to, Double3 const& b) {
        Double3 const d = b - a;
        double const length = norm(d);
        out.length += length / divisor;
        if (from == to) return;
        Double3 const along = length < 1e-15 ? Double3{1, 0, 0} : (1 / length) * d;
        point(out.row, to, b, along, 1 / divisor);
        point(out.row, from, a, along, -1 / divisor);
      };
      if (wrap) {
        int const g = m_.geom_body[m_.wrap_id[w + 1]];
        straight(b0, x, g, wrap->first);
        straight(g, wrap->second, b1, y);
        out.length += wrap->length / divisor;
      } else {
        straight(b0, x, b1, y);
      }
      w += round ? 2 : 1;
    }
    return out;
  }

  /// Length and moment of an actuator.
  LengthAndRow actuator(int a) const {
    LengthAndRow out;
    int const id = m_.act_id[a], ref = m_.act_ref[a];
    auto const& gear = m_.act_gear[a];
    Double3 const force{gear[0], gear[1], gear[2]}, torque{gear[3], gear[4], gear[5]};
    switch (Transmission(m_.act_target[a])) {
      case Transmission::joint:
      case Transmission::joint_in_parent: {
        int const d = m_.jnt_dofadr[id], q = m_.jnt_qposadr[id];
        bool const parent = Transmission(m_.act_target[a]) == Transmission::joint_in_parent;
        auto const turn = [&](int at, Double3 const& v) {
          return parent ? rotate_inverse(normalized({q_[at], q_[at + 1], q_[at + 2], q_[at + 3]}), v) : v;
        };
        if (m_.jnt_type[id] == int(JointType::free)) {
          auto const axis = turn(q + 3, torque);
          for (int k = 0; k < 3; ++k) {
            out.row.add(d + k, gear[k]);
            out.row.add(d + 3 + k, axis[k]);
          }
        } else if (m_.jnt_type[id] == int(JointType::ball)) {
          auto const axis = turn(q, force);
          out.length = dot(rotation_vector(normalized({q_[q], q_[q + 1], q_[q + 2], q_[q + 3]})), axis);
          for (int k = 0; k < 3; ++k) out.row.add(d + k, axis[k]);
        } else {
          out.length = q_[q] * gear[0];
          out.row.add(d, gear[0]);
        }
        break;
      }
      case Transmission::tendon:
        out = tendon(id);
        out.length *= gear[0];
        for (auto& e : out.row.entries) e.second *= gear[0];
        break;
      case Transmission::slider_crank: {
        // length = a.v - sqrt((a.v)^2 + r^2 - v.v): v from the slider's site to the crank's, a the slider's axis, r the rod
        Pose const crank = site(id), slider = site(ref);
        Double3 const axis = rotate(slider.q, {0, 0, 1}), v = crank.p - slider.p;
        double const av = dot(v, axis), det = av * av + m_.act_cranklength[a] * m_.act_cranklength[a] - dot(v, v);
        Double3 by_v = axis, by_axis = v;
        out.length = av;
        if (det > 0) {
          double const root = std::sqrt(det);
          out.length = av - root;
          by_v = (1 - av / root) * axis + (1 / root) * v;
          by_axis = (1 - av / root) * v;
        }
        point(out.row, m_.site_body[id], crank.p, by_v, gear[0]);
        point(out.row, m_.site_body[ref], slider.p, by_v, -gear[0]);
        for (int d : dofs_of(m_.site_body[ref])) out.row.add(d, gear[0] * dot(by_axis, cross(angular(d), axis)));
        out.length *= gear[0];
        break;
      }
      case Transmission::site: {
        Pose const x = site(id), frame = ref >= 0 ? site(ref) : x;
        Double3 const push = rotate(frame.q, force), turn = rotate(frame.q, torque);
        auto const own = dofs_of(m_.site_body[id]), other = ref >= 0 ? dofs_of(m_.site_body[ref]) : std::vector<int>{};
        if (ref >= 0) {
          auto const relative = times({frame.q[0], -frame.q[1], -frame.q[2], -frame.q[3]}, x.q);
          out.length = dot(rotate_inverse(frame.q, x.p - frame.p), force) + dot(rotation_vector(normalized(relative)), torque);
        }
        auto const common = [](std::vector<int> const& of, int d) { return std::find(of.begin(), of.end(), d) != of.end(); };
        for (int d : own)
          if (!common(other, d)) out.row.add(d, dot(push, linear(d, x.p)) + dot(turn, angular(d)));
        for (int d : other)
          if (!common(own, d)) out.row.add(d, -dot(push, linear(d, frame.p)) - dot(turn, angular(d)));
        break;
      }
      case Transmission::body:  // acts at contacts, of which there are none yet
        break;
    }
    return out;
  }

  /// Axis times angle of a rotation, angle in (-pi, pi].
  static Double3 rotation_vector(Double4 const& q) {
    Double3 const v{q[1], q[2], q[3]};
    double const s = norm(v);
    if (s < 1e-15) return {0, 0, 0};
    double angle = 2 * std::atan2(s, q[0]);
    if (angle > 3.14159265358979323846) angle -= 2 * 3.14159265358979323846;
    return (angle / s) * v;
  }

 private:
  void joint(int j, Pose& x) {
    int const d = m_.jnt_dofadr[j], q = m_.jnt_qposadr[j];
    auto const unit = [](int k) { return Double3{k == 0 ? 1. : 0., k == 1 ? 1. : 0., k == 2 ? 1. : 0.}; };
    auto const put = [&](int k, Double3 const& direction, Double3 const& anchor, bool turns) {
      axis_[k] = direction;
      anchor_[k] = anchor;
      turns_[k] = turns;
    };
    switch (JointType(m_.jnt_type[j])) {
      case JointType::free:
        x = {{q_[q], q_[q + 1], q_[q + 2]}, normalized({q_[q + 3], q_[q + 4], q_[q + 5], q_[q + 6]})};
        for (int k = 0; k < 3; ++k) {
          put(d + k, unit(k), x.p, false);
          put(d + 3 + k, rotate(x.q, unit(k)), x.p, true);
        }
        break;
      case JointType::ball: {
        Double3 const anchor = x * m_.jnt_pos[j];
        x.q = times(x.q, normalized({q_[q], q_[q + 1], q_[q + 2], q_[q + 3]}));
        x.p = anchor - rotate(x.q, m_.jnt_pos[j]);
        for (int k = 0; k < 3; ++k) put(d + k, rotate(x.q, unit(k)), anchor, true);
        break;
      }
      case JointType::slide: {
        Double3 const axis = rotate(x.q, m_.jnt_axis[j]);
        put(d, axis, x * m_.jnt_pos[j], false);
        x.p = x.p + (q_[q] - m_.qpos0[q]) * axis;
        break;
      }
      case JointType::hinge: {
        Double3 const axis = rotate(x.q, m_.jnt_axis[j]), anchor = x * m_.jnt_pos[j];
        put(d, axis, anchor, true);
        if (double const angle = q_[q] - m_.qpos0[q]; angle != 0) {
          x.q = times(x.q, axis_angle(m_.jnt_axis[j], angle));
          x.p = anchor - rotate(x.q, m_.jnt_pos[j]);
        }
        break;
      }
    }
  }
  void point(SparseRow& row, int b, Double3 const& at, Double3 const& direction, double scale) const {
    for (int d : dofs_of(b)) row.add(d, scale * dot(direction, linear(d, at)));
  }

  CompiledModel const& m_;
  std::vector<double> const& q_;
  std::vector<Pose> body_;
  std::vector<Double3> com_, subtree_, axis_, anchor_;  // world frame
  std::vector<char> turns_;
};

}  // namespace gsp::detail
