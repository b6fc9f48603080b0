#pragma once
#include <algorithm>
#include <cmath>
#include <gsp/math/quat.hpp>
#include <gsp/model/archetypes.hpp>
#include <gsp/model/compiled.hpp>
#include <vector>

namespace gsp {
/// Whether a tree may sleep.
enum class SleepPolicy : int { never, allowed, with_actuators };  // with_actuators: it may, and any control of the world wakes it
}  // namespace gsp

/// What MuJoCo's compiler decides of sleep: which trees may, and how long a radian is. On the host.
namespace gsp::detail {

/// Of the file's trees. Where their body does not say: those that an actuator moves never sleep, the others may.
inline std::vector<SleepPolicy> file_policies(CompiledModel const& m) {
  std::vector<bool> actuated(m.ntree);
  for (auto const& trees : find_couplings(m).actuator)
    for (int const t : trees) actuated[t] = true;
  std::vector<SleepPolicy> policy;
  for (int t = 0; t < m.ntree; ++t) {
    auto const says = BodySleep(item_or(m.body_sleep, m.tree_bodyadr[t], int(BodySleep::automatic)));
    bool const never = says == BodySleep::never || (says == BodySleep::automatic && actuated[t]);
    policy.push_back(never ? SleepPolicy::never : actuated[t] ? SleepPolicy::with_actuators : SleepPolicy::allowed);
  }
  return policy;
}

/// Of the model's trees, each one or several of the file's: what most keeps one of them awake.
inline std::vector<int> sleep_policies(CompiledModel const& m) {
  auto const of_file = file_policies(m);
  std::vector<int> result;
  for (TreeGroup const group : group_trees(m, find_couplings(m))) {
    auto const first = of_file.begin() + group.first, end = of_file.begin() + group.last + 1;
    auto const any = [&](SleepPolicy policy) { return std::find(first, end, policy) != end; };
    result.push_back(int(first == end || any(SleepPolicy::never) ? SleepPolicy::never
                         : any(SleepPolicy::with_actuators)      ? SleepPolicy::with_actuators
                                                                 : SleepPolicy::allowed));
  }
  return result;
}

/// Whether a mocap body that moves may move one of the model's trees, or its rows, though nothing of its own changes and no row names the
/// mocap body: what hangs on one; and everything where a tendon or an actuator reaches one.
inline std::vector<int> hang_on_mocap(CompiledModel const& m) {
  auto const couplings = find_couplings(m);
  auto const mocap_root = mocap_roots(m);
  std::vector<int> result;
  for (TreeGroup const group : group_trees(m, couplings)) {
    bool hangs = couplings.on_mocap;
    for (int t = group.first; t <= group.last; ++t) hangs = hangs || mocap_root[m.body_parent[m.tree_bodyadr[t]]] >= 0;
    result.push_back(hangs);
  }
  return result;
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
