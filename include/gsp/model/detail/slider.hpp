#pragma once
#include <cmath>
#include <gsp/model/compiled.hpp>
#include <gsp/model/detail/host_math.hpp>

namespace gsp::detail {

/// A lone body on slides along its own axes, with its centre of mass at its origin, for which MuJoCo takes 1 / mass, without armature.
inline bool is_slider(CompiledModel const& m, int b) {
  int const parent = m.body_parent[b];
  bool const near_world = parent == 0 || m.body_parent[parent] == 0;
  bool const childless = b + 1 == m.nbody || m.body_parent[b + 1] != b;
  auto const zero = [](double x) { return std::abs(x) < 1e-14; };
  auto const& p = m.body_ipos[b];
  auto const& q = m.body_iquat[b];
  if (!near_world || !childless || !zero(norm(p)) || !zero(q[1]) || !zero(q[2]) || !zero(q[3])) return false;
  for (int j = m.body_jntadr[b], end = j + m.body_jntnum[b]; j < end; ++j) {
    auto const& axis = m.jnt_axis[j];
    if (m.jnt_type[j] != int(JointType::slide) || !zero(norm(m.jnt_pos[j])) || zero(axis[0]) + zero(axis[1]) + zero(axis[2]) != 2)
      return false;
  }
  return true;
}

}  // namespace gsp::detail
