#pragma once
#include <array>
#include <gsp/core/check.hpp>
#include <gsp/geometry/shapes.hpp>
#include <gsp/math/quat.hpp>
#include <gsp/model/archetypes.hpp>
#include <gsp/model/compiled.hpp>
#include <gsp/model/detail/added_mass.hpp>
#include <gsp/model/detail/slider.hpp>
#include <string>
#include <vector>

namespace gsp {

/// World poses of the bodies that are fixed to the world (others: identity), (nbody, 7); of bodies that are fixed to a mocap body: in its
/// frame. Host, double.
inline std::vector<double> static_poses(CompiledModel const& m) {
  std::vector<double> pose(std::size_t(m.nbody) * 7, 0.);
  for (int b = 0; b < m.nbody; ++b) {
    double* p = &pose[std::size_t(b) * 7];
    p[3] = 1;
    if (b == 0 || m.body_tree[b] >= 0 || detail::item_or(m.body_mocap, b, -1) >= 0) continue;
    double const* q = &pose[std::size_t(m.body_parent[b]) * 7];
    Transform<double> const parent{{q[0], q[1], q[2]}, {q[3], q[4], q[5], q[6]}};
    auto const& x = m.body_pos[b];
    auto const& r = m.body_quat[b];
    auto const t = parent * Transform<double>{{x[0], x[1], x[2]}, {r[0], r[1], r[2], r[3]}};
    p[0] = t.p.x;
    p[1] = t.p.y;
    p[2] = t.p.z;
    p[3] = t.q.w;
    p[4] = t.q.x;
    p[5] = t.q.y;
    p[6] = t.q.z;
  }
  return pose;
}

namespace detail {
/// Where the fields of the model come from: the compiled model, and what make_model computes of it.
struct FieldSource {
  CompiledModel const& m;
  std::vector<double> fixed;      // static_poses
  std::vector<Double3> body_pos;  // of roots: in the world (or the mocap body's frame), as what they hang on is folded in
  std::vector<Double4> body_quat;
  std::vector<double> body_slider;
  std::vector<double> dof_damping, dof_armature, tendon_damping, tendon_armature;  // with what actuators add
  std::vector<std::array<double, 6>> geom_addedmass;
};

/// What actuators add to the damping and armature of their joint or tendon: gear^2 times their own.
inline void add_of_actuators(FieldSource& s) {
  auto const& m = s.m;
  for (int k = 0; k < m.nu; ++k) {
    double const square = m.act_gear[k][0] * m.act_gear[k][0];
    double const damping = square * item_or(m.act_damping, k, 0.), armature = square * item_or(m.act_armature, k, 0.);
    int const id = m.act_id[k];
    auto const target = Transmission(m.act_target[k]);
    if (target == Transmission::tendon) {
      s.tendon_damping[id] += damping;
      s.tendon_armature[id] += armature;
    }
    if (target != Transmission::joint && target != Transmission::joint_in_parent) continue;
    constexpr int dofs[] = {6, 3, 1, 1};
    for (int i = m.jnt_dofadr[id], end = i + dofs[m.jnt_type[id]]; i < end; ++i) {
      s.dof_damping[i] += damping;
      s.dof_armature[i] += armature;
    }
  }
}

/// A root hangs on a static body, whose world pose is folded into the root's own.
inline void fold_static_poses(FieldSource& s) {
  auto const& m = s.m;
  for (int b = 1; b < m.nbody; ++b) {
    if (m.body_tree[b] < 0 || m.body_tree[m.body_parent[b]] >= 0) continue;  // (on a mocap body: in its frame)
    double const* q = &s.fixed[std::size_t(m.body_parent[b]) * 7];
    auto const& x = m.body_pos[b];
    auto const& r = m.body_quat[b];
    auto const t =
        Transform<double>{{q[0], q[1], q[2]}, {q[3], q[4], q[5], q[6]}} * Transform<double>{{x[0], x[1], x[2]}, {r[0], r[1], r[2], r[3]}};
    s.body_pos[b] = {t.p.x, t.p.y, t.p.z};
    s.body_quat[b] = {t.q.w, t.q.x, t.q.y, t.q.z};
  }
}

inline FieldSource field_source(CompiledModel const& m) {
  FieldSource s{m,
                static_poses(m),
                m.body_pos,
                m.body_quat,
                std::vector<double>(m.nbody, 0.),
                m.dof_damping,
                m.dof_armature,
                m.tendon_damping,
                m.tendon_armature,
                std::vector<std::array<double, 6>>(m.ngeom)};
  add_of_actuators(s);
  fold_static_poses(s);
  for (int b = 1; b < m.nbody; ++b) s.body_slider[b] = m.body_tree[b] >= 0 && m.tree_bodyadr[m.body_tree[b]] == b && is_slider(m, b);
  for (int g = 0; g < m.ngeom; ++g)
    if (item_or(m.geom_fluid, g, 0)) {
      auto const& size = m.geom_size[g];
      auto const r = half_axes(ShapeType(m.geom_type[g]), Vec3<double>{size[0], size[1], size[2]});
      s.geom_addedmass[g] = added_mass(r.x, r.y, r.z);
    }
  return s;
}
}  // namespace detail

}  // namespace gsp
