#pragma once
// Rigid bodies in plain double on the host, dense and by another route than the library's recursions: Jacobians of centres of mass and of
// rotations from anchors and axes, M = sum m Jv^T Jv + Jw^T I Jw, and bias forces from the numerical rate of those Jacobians along the
// motion.
#include <cmath>
#include <gsp/math/quat.hpp>
#include <gsp/model/compiled.hpp>
#include <vector>

namespace gsp_reference {

using V = gsp::Vec3<double>;
using Q = gsp::Quat<double>;

struct RigidBodies {
  std::vector<V> x, center;            // (nbody) origin, centre of mass
  std::vector<Q> q;                    // (nbody)
  std::vector<std::vector<V>> Jv, Jw;  // (nbody, nv)

  RigidBodies(gsp::CompiledModel const& m, std::vector<double> const& qpos)
      : x(m.nbody, V{0, 0, 0}), center(x), q(m.nbody, Q{1, 0, 0, 0}), Jv(m.nbody, std::vector<V>(m.nv, V{0, 0, 0})), Jw(Jv) {
    std::vector<V> axis(m.nv), anchor(m.nv);
    std::vector<bool> turns(m.nv);
    auto const vec = [](gsp::Double3 const& a) { return V{a[0], a[1], a[2]}; };
    auto const quat = [](double const* a) { return Q{a[0], a[1], a[2], a[3]}; };
    for (int b = 1; b < m.nbody; ++b) {
      int const p = m.body_parent[b];
      x[b] = x[p] + rotate(q[p], vec(m.body_pos[b])), q[b] = q[p] * quat(m.body_quat[b].data());
      for (int j = m.body_jntadr[b]; j < m.body_jntadr[b] + m.body_jntnum[b]; ++j) {
        auto const type = gsp::JointType(m.jnt_type[j]);
        int const a = m.jnt_qposadr[j];
        int d = m.jnt_dofadr[j];
        if (type == gsp::JointType::free) {
          x[b] = {qpos[a], qpos[a + 1], qpos[a + 2]}, q[b] = quat(&qpos[a + 3]);
          for (int c = 0; c < 3; ++c, ++d) axis[d] = {double(c == 0), double(c == 1), double(c == 2)}, turns[d] = false;
        }
        V const place = x[b] + (type == gsp::JointType::free ? V{0, 0, 0} : rotate(q[b], vec(m.jnt_pos[j])));
        if (type == gsp::JointType::hinge || type == gsp::JointType::slide) {
          axis[d] = rotate(q[b], vec(m.jnt_axis[j])), anchor[d] = place, turns[d] = type == gsp::JointType::hinge;
          double const by = qpos[a] - m.qpos0[a];
          if (turns[d]) {  // turn the world about the anchor
            Q const turn{std::cos(by / 2), std::sin(by / 2) * axis[d].x, std::sin(by / 2) * axis[d].y, std::sin(by / 2) * axis[d].z};
            q[b] = turn * q[b], x[b] = place + rotate(turn, x[b] - place);
          } else {
            x[b] += by * axis[d];
          }
          continue;
        }
        if (type == gsp::JointType::ball) {
          q[b] = q[b] * quat(&qpos[a]);
          x[b] = place - rotate(q[b], vec(m.jnt_pos[j]));
        }
        for (int c = 0; c < 3; ++c)
          axis[d + c] = rotate(q[b], V{double(c == 0), double(c == 1), double(c == 2)}), anchor[d + c] = place, turns[d + c] = true;
      }
      center[b] = x[b] + rotate(q[b], vec(m.body_ipos[b]));
      for (int a = b; a > 0; a = m.body_parent[a])
        for (int d = m.body_dofadr[a]; d < m.body_dofadr[a] + m.body_dofnum[a]; ++d) {
          Jv[b][d] = turns[d] ? cross(axis[d], center[b] - anchor[d]) : axis[d];
          if (turns[d]) Jw[b][d] = axis[d];
        }
    }
  }
  /// I v in world axes, I about the centre of mass of body b
  V inertia_times(gsp::CompiledModel const& m, int b, V const& v) const {
    auto const& iq = m.body_iquat[b];
    auto const& i = m.body_inertia[b];
    Q const frame = q[b] * Q{iq[0], iq[1], iq[2], iq[3]};
    V const u = rotate_inverse(frame, v);
    return rotate(frame, V{i[0] * u.x, i[1] * u.y, i[2] * u.z});
  }
};

/// (nv, nv)
inline std::vector<double> mass_matrix(gsp::CompiledModel const& m, RigidBodies const& at) {
  std::vector<double> M(std::size_t(m.nv) * m.nv, 0.);
  for (int i = 0; i < m.nv; ++i) M[i * m.nv + i] = m.dof_armature[i];
  for (int b = 1; b < m.nbody; ++b)
    for (int i = 0; i < m.nv; ++i) {
      V const turn = at.inertia_times(m, b, at.Jw[b][i]);
      for (int j = 0; j < m.nv; ++j) M[i * m.nv + j] += m.body_mass[b] * dot(at.Jv[b][i], at.Jv[b][j]) + dot(turn, at.Jw[b][j]);
    }
  return M;
}

/// Positions after moving for the time t with the velocities v.
inline std::vector<double> moved(gsp::CompiledModel const& m, std::vector<double> qpos, std::vector<double> const& v, double t) {
  for (int j = 0; j < m.njnt; ++j) {
    int a = m.jnt_qposadr[j], d = m.jnt_dofadr[j];
    auto const type = gsp::JointType(m.jnt_type[j]);
    for (int c = 0, n = type == gsp::JointType::free ? 3 : type == gsp::JointType::ball ? 0 : 1; c < n; ++c) qpos[a++] += t * v[d++];
    if (type != gsp::JointType::free && type != gsp::JointType::ball) continue;
    double const n = std::sqrt(v[d] * v[d] + v[d + 1] * v[d + 1] + v[d + 2] * v[d + 2]), s = n > 0 ? std::sin(t * n / 2) / n : 0;
    Q const r = Q{qpos[a], qpos[a + 1], qpos[a + 2], qpos[a + 3]} * Q{std::cos(t * n / 2), s * v[d], s * v[d + 1], s * v[d + 2]};
    qpos[a] = r.w, qpos[a + 1] = r.x, qpos[a + 2] = r.y, qpos[a + 3] = r.z;
  }
  return qpos;
}

/// sum Jv^T m (Jv' v - g) + Jw^T (I Jw' v + w x I w), the rates by central differences over 2e = 2e-6: error about e^2 |v|^4 + eps |v| / e
/// = 1e-9 relative.
inline std::vector<double> bias_forces(gsp::CompiledModel const& m, std::vector<double> const& qpos, std::vector<double> const& v) {
  double const e = 1e-6;
  RigidBodies const at(m, qpos), after(m, moved(m, qpos, v, e)), before(m, moved(m, qpos, v, -e));
  auto const& g = m.option.gravity;
  std::vector<double> bias(m.nv, 0.);
  for (int b = 1; b < m.nbody; ++b) {
    V a{-g[0], -g[1], -g[2]}, turn{0, 0, 0}, w{0, 0, 0};
    for (int i = 0; i < m.nv; ++i)
      a += v[i] / (2 * e) * (after.Jv[b][i] - before.Jv[b][i]), turn += v[i] / (2 * e) * (after.Jw[b][i] - before.Jw[b][i]),
          w += v[i] * at.Jw[b][i];
    V const torque = at.inertia_times(m, b, turn) + cross(w, at.inertia_times(m, b, w));
    for (int i = 0; i < m.nv; ++i) bias[i] += m.body_mass[b] * dot(at.Jv[b][i], a) + dot(at.Jw[b][i], torque);
  }
  return bias;
}

}  // namespace gsp_reference
