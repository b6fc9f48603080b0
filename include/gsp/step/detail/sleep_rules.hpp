#pragma once
#include <algorithm>
#include <cmath>
#include <gsp/math/quat.hpp>
#include <gsp/model/compiled.hpp>
#include <vector>

/// What MuJoCo's compiler decides of sleep: which trees may, and how long a radian is. On the host.
namespace gsp::detail {

enum class SleepPolicy : int { never, allowed, with_actuators };  // with_actuators: woken by any control of the world

/// Of trees. Where their body does not say: those that an actuator moves never sleep, the others may.
inline std::vector<int> sleep_policies(CompiledModel const& m) {
  std::vector<int> actuated(m.ntree, 0), policy(m.ntree, int(SleepPolicy::allowed));
  auto const moves = [&](int body) {
    if (body >= 0 && m.body_tree[body] >= 0) actuated[m.body_tree[body]] = 1;
  };
  for (int u = 0; u < m.nu; ++u) {
    int const id = m.act_id[u], ref = m.act_ref[u];
    switch (Transmission(m.act_target[u])) {
      case Transmission::joint:
      case Transmission::joint_in_parent:
        moves(m.jnt_body[id]);
        break;
      case Transmission::tendon:
        if (m.tendon_tree[id] >= 0) actuated[m.tendon_tree[id]] = 1;
        break;
      case Transmission::body:
        moves(id);
        break;
      default:  // sites
        moves(m.site_body[id]);
        if (ref >= 0) moves(m.site_body[ref]);
    }
  }
  for (int t = 0; t < m.ntree; ++t) {
    int const body = m.tree_bodyadr[t];
    BodySleep const says = body < int(m.body_sleep.size()) ? BodySleep(m.body_sleep[body]) : BodySleep::automatic;
    bool const never = says == BodySleep::never || (says == BodySleep::automatic && actuated[t]);
    policy[t] = int(never ? SleepPolicy::never : actuated[t] ? SleepPolicy::with_actuators : SleepPolicy::allowed);
  }
  return policy;
}

/// Of dofs [m]: of a translation 1; of a rotation how far the body reaches from its centre of mass: to the anchors of its joints and of its
/// children's, and round its geoms (mjModel.dof_length).
template <class R>
std::vector<R> dof_lengths(CompiledModel const& m) {
  using Point = Vec3<double>;
  auto const point = [](Double3 const& p) { return Point{p[0], p[1], p[2]}; };
  std::vector<double> reach(m.nbody, 0);
  auto const at_least = [&](int body, Point const& p) { reach[body] = std::max(reach[body], norm(p - point(m.body_ipos[body]))); };
  for (int j = 0; j < m.njnt; ++j) {
    int const b = m.jnt_body[j];
    Point const anchor = JointType(m.jnt_type[j]) == JointType::free ? Point{0, 0, 0} : point(m.jnt_pos[j]);
    at_least(b, anchor);
    auto const& q = m.body_quat[b];
    at_least(m.body_parent[b], point(m.body_pos[b]) + rotate(Quat<double>{q[0], q[1], q[2], q[3]}, anchor));
  }
  for (int g = 0; g < m.ngeom; ++g) {
    int const b = m.geom_body[g];
    if (m.geom_rbound[g] > 0) reach[b] = std::max(reach[b], m.geom_rbound[g] + norm(point(m.geom_pos[g]) - point(m.body_ipos[b])));
  }
  std::vector<R> length(m.nv, R(1));
  for (int i = 0; i < m.nv; ++i) {
    auto const type = JointType(m.jnt_type[m.dof_jnt[i]]);
    bool const turns =
        type == JointType::ball || type == JointType::hinge || (type == JointType::free && i - m.jnt_dofadr[m.dof_jnt[i]] >= 3);
    if (turns) length[i] = R(std::max(reach[m.dof_body[i]], 1e-5));
  }
  return length;
}

}  // namespace gsp::detail
