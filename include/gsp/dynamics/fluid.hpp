#pragma once
#include <gsp/dynamics/bias_forces.hpp>
#include <gsp/geometry/shapes.hpp>

/// Forces of a medium that has no state of its own (docs/dynamics/passive_forces.md): drag and viscosity of the box of equal inertia, or of
/// the ellipsoids of geoms that ask for it, with added mass and lift. Laws: MuJoCo's documentation, chapter "Fluid forces".
namespace gsp {

namespace detail {
/// Force of a fluid in the body's own axes at velocity (w, v), and its derivative: rows torque then force, columns w then v.
template <class T>
struct FluidForce {
  Vec3<T> torque, force;
  T derivative[6][6];
};

template <class T>
KOKKOS_INLINE_FUNCTION void add_cross(T (&d)[6][6], int row, int column, Vec3<T> const& a) {  // + [a]x
  d[row][column + 1] -= a.z;
  d[row][column + 2] += a.y;
  d[row + 1][column] += a.z;
  d[row + 1][column + 2] -= a.x;
  d[row + 2][column] -= a.y;
  d[row + 2][column + 1] += a.x;
}
/// - [a]x diag(b)
template <class T>
KOKKOS_INLINE_FUNCTION void subtract_cross_diagonal(T (&d)[6][6], int row, int column, Vec3<T> const& a, Vec3<T> const& b) {
  d[row][column + 1] += a.z * b.y;
  d[row][column + 2] -= a.y * b.z;
  d[row + 1][column] -= a.z * b.x;
  d[row + 1][column + 2] += a.x * b.z;
  d[row + 2][column] += a.y * b.x;
  d[row + 2][column + 1] -= a.x * b.y;
}
template <class T>
KOKKOS_INLINE_FUNCTION Vec3<T> times(Vec3<T> const& a, Vec3<T> const& b) {
  return {a.x * b.x, a.y * b.y, a.z * b.z};
}

/// Box with the body's mass and inertia: quadratic drag on its faces, viscosity of the sphere of its mean diameter.
template <class T>
KOKKOS_INLINE_FUNCTION void box_fluid(T mass, Vec3<T> const& inertia, T density, T viscosity, Vec3<T> const& w, Vec3<T> const& v,
                                      FluidForce<T>& f) {
  T const pi(3.14159265358979323846), least(1e-15), k = T(6) / max(mass, least);
  auto const edge = [&](T a, T b, T c) { return sqrt(max(b + c - a, least) * k); };
  Vec3<T> const box{edge(inertia.x, inertia.y, inertia.z), edge(inertia.y, inertia.x, inertia.z), edge(inertia.z, inertia.x, inertia.y)};
  T const diameter = (box.x + box.y + box.z) / T(3), own = select(mass < least, T(0), T(1));
  T const turn = -(own * pi * diameter * diameter * diameter * viscosity), move = -(own * T(3) * pi * diameter * viscosity);
  for (int i = 0; i < 3; ++i) {
    T const a = box[i], b = box[(i + 1) % 3], c = box[(i + 2) % 3];
    T const face = own * T(0.5) * density * b * c, blade = own * density * a * (square(b * b) + square(c * c)) * T(1. / 64);
    f.force[i] = fma(move, v[i], -(face * abs(v[i]) * v[i]));
    f.torque[i] = fma(turn, w[i], -(blade * abs(w[i]) * w[i]));
    f.derivative[i][i] = turn - T(2) * blade * abs(w[i]);
    f.derivative[3 + i][3 + i] = move - T(2) * face * abs(v[i]);
  }
}

/// Ellipsoid of half axes r: added mass, Magnus and Kutta lift, drag, viscosity. c: blunt drag, slender drag, angular drag, Kutta, Magnus.
/// derivative: all of it, else what slows down alone.
template <class T>
KOKKOS_INLINE_FUNCTION void ellipsoid_fluid(Vec3<T> const& r, T const (&c)[5], Vec3<T> const& added_mass, Vec3<T> const& added_inertia,
                                            T density, T viscosity, Vec3<T> const& w, Vec3<T> const& v, bool derivative, FluidForce<T>& f) {
  T const pi(3.14159265358979323846), least(sizeof(real_t<T>) == 4 ? 1e-36 : 1e-280);
  auto& d = f.derivative;
  // added mass: force p x w, torque p x v + l x w, with the momenta p, l of the fluid
  Vec3<T> const mass = density * added_mass, inertia = density * added_inertia, p = times(mass, v), l = times(inertia, w);
  f.force = cross(p, w);
  f.torque = cross(p, v) + cross(l, w);
  // Magnus: proportional to the volume
  T const magnus = c[4] * density * T(4. / 3) * pi * r.x * r.y * r.z;
  f.force += magnus * cross(w, v);
  // area seen along v: A = pi sqrt(den / num), n the (not normalised) normal of the outline
  Vec3<T> const b{square(r.y * r.z), square(r.z * r.x), square(r.x * r.y)}, n = times(b, v);
  T const num = dot(n, v), den = dot(n, n), speed = norm(v), speed2 = dot(v, v);
  T const area = pi * sqrt(den / max(num, least));
  T const kutta = c[3] * density * area * (num / max(speed * den, least));
  f.force += kutta * (num * v - speed2 * n);  // (n x v) x v
  // drag
  T const longest = max(r.x, max(r.y, r.z)), shortest = min(r.x, min(r.y, r.z)), middle = r.x + r.y + r.z - longest - shortest;
  T const largest = pi * longest * middle, sphere = T(2. / 3) * (r.x + r.y + r.z);
  T const profile = area * c[0] + c[1] * (largest - area);
  T const move = fma(viscosity, T(3) * pi * sphere, density * speed * profile);
  f.force -= move * v;
  T const most = T(8. / 15) * pi * middle * square(longest * longest);
  auto const moment = [&](T a, T x, T y) {
    T const own = T(8. / 15) * pi * a * square(square(max(x, y)));
    return c[2] * own + c[1] * (most - own);
  };
  Vec3<T> const moments{moment(r.x, r.y, r.z), moment(r.y, r.z, r.x), moment(r.z, r.x, r.y)}, swirl = times(moments, w);
  T const turbulence = norm(swirl), turn = fma(viscosity, pi * sphere * sphere * sphere, density * turbulence);
  f.torque -= turn * w;
  if (!derivative) {  // what slows down, at the drag of this speed: a part that never speeds up
    for (int i = 0; i < 3; ++i) {
      d[i][i] = -turn;
      d[3 + i][3 + i] = -move;
    }
    return;
  }

  add_cross(d, 3, 0, p);
  subtract_cross_diagonal(d, 3, 3, w, mass);
  add_cross(d, 0, 3, p);
  subtract_cross_diagonal(d, 0, 3, v, mass);
  add_cross(d, 0, 0, l);
  subtract_cross_diagonal(d, 0, 0, w, inertia);
  add_cross(d, 3, 3, magnus * w);
  add_cross(d, 3, 0, -(magnus * v));
  // kutta = k num^1/2 den^-1/2 / |v|
  Vec3<T> const lift = num * v - speed2 * n, bn = times(b, n);
  T const k = c[3] * density * pi / max(sqrt(den) * sqrt(num) * speed, least);  // kutta = k num
  Vec3<T> const slope = k * (n - (num / max(den, least)) * bn - (num / max(speed2, least)) * v);
  Vec3<T> const dmove_area = (area / max(den, least)) * bn - (area / max(num, least)) * n;  // dA/dv
  Vec3<T> const dmove = (density * profile / max(speed, least)) * v + (density * speed * (c[0] - c[1])) * dmove_area;
  Vec3<T> const dturn = (density / max(turbulence, least)) * times(moments, swirl);
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) {
      T entry = lift[i] * slope[j] + k * num * (T(2) * v[i] * n[j] - T(2) * n[i] * v[j]) - v[i] * dmove[j];
      T turning = -(w[i] * dturn[j]);
      if (i == j) {
        entry = entry + k * num * (num - speed2 * b[i]) - move;
        turning = turning - turn;
      }
      d[3 + i][3 + j] = d[3 + i][3 + j] + entry;
      d[i][j] = d[i][j] + turning;
    }
}

/// derivative += J^T B J for the dofs that move body b: B in the axes q at the point p of body b. implicitfast takes the symmetric part of
/// B, and the lower triangle alone. Profile stable: drag -= J^T B J.
template <class L, class T>
KOKKOS_INLINE_FUNCTION void lanes_add_fluid_derivative(L const& l, int b, Transform<T> const& frame, FluidForce<T>& f) {
  auto const& a = l.a;
  auto const& s = l.items;
  while (b >= 0 && l.index(a.body_dofnum, b) == 0) b = l.index(a.body_parent, b);
  if (b < 0) return;
  int const last = l.index(a.body_dofadr, b) + l.index(a.body_dofnum, b) - 1;
  int const adr = l.index(a.row_adr, last), n = l.index(a.row_adr, last + 1) - adr;
  int const to = a.drag ? l.at.drag : l.at.derivative;
  T const sign(a.drag ? -1 : 1);
  if (!a.drag && !lanes_full_derivative(l, b))
    for (int i = 0; i < 6; ++i)
      for (int j = 0; j < i; ++j) f.derivative[i][j] = f.derivative[j][i] = T(0.5) * (f.derivative[i][j] + f.derivative[j][i]);
  Vec3<T> const arm = frame.p - l.com_of_body(b);
  auto const local = [&](int dof, T(&x)[6]) {  // motion of the frame that the dof gives, in its axes
    Spatial<T> const c = s.spatial(l.at.cdof + 6 * dof);
    Vec3<T> const w = rotate_inverse(frame.q, c.angular), v = rotate_inverse(frame.q, c.linear + cross(c.angular, arm));
    x[0] = w.x;
    x[1] = w.y;
    x[2] = w.z;
    x[3] = v.x;
    x[4] = v.y;
    x[5] = v.z;
  };
  for (int p = 0; p < n; ++p) {
    int const row = l.index(a.row_col, adr + p), entries = l.index(a.row_adr, row);
    T ji[6], left[6], right[6];
    local(row, ji);
    for (int j = 0; j < 6; ++j) {
      left[j] = right[j] = T(0);
      for (int i = 0; i < 6; ++i) {
        left[j] = fma(ji[i], f.derivative[i][j], left[j]);
        right[j] = fma(f.derivative[j][i], ji[i], right[j]);
      }
    }
    for (int q = 0; q <= p; ++q) {  // dof q of the chain is column q of the row
      T jj[6];
      local(l.index(a.row_col, adr + q), jj);
      T lower(0), upper(0);
      for (int j = 0; j < 6; ++j) {
        lower = fma(left[j], jj[j], lower);
        upper = fma(jj[j], right[j], upper);
      }
      s[to + entries + q] = fma(sign, lower, s[to + entries + q]);
      if (a.derivative == 2) s[l.at.derivative + a.nM + entries + q] = s[l.at.derivative + a.nM + entries + q] + upper;
    }
  }
}

/// passive += the fluid's forces; derivative too where the integrator asks for it. Needs cvel (of the full velocity) and com; uses cfrc.
template <class L>
KOKKOS_INLINE_FUNCTION void lanes_fluid(L const& l) {
  using T = std::remove_cvref_t<decltype(l.items[0])>;
  auto const& a = l.a;
  auto const& s = l.items;
  auto const& m = l.model;
  Vec3<T> const zero{T(0), T(0), T(0)};
  int const origin[L::W] = {};
  Vec3<T> const wind = l.constant3(m.wind, origin, 0);
  T const density(m.density), viscosity(m.viscosity);
  bool const derivative = a.derivative != 0 || a.drag;
  for (int e = 0; a.drag && e < a.nM; ++e) s[l.at.drag + e] = T(0);
  for (int b = 0; b < a.nbody; ++b) {
    if (l.index(a.body_parent, b) == parent_of::none) continue;
    s.put(l.at.cfrc + 6 * b, Spatial<T>{zero, zero});
    Spatial<T> const motion = s.spatial(l.at.cvel + 6 * b);
    Vec3<T> const x = s.vec3(l.at.xpos + 3 * b), com = l.com_of_body(b);
    Quat<T> const q = s.quat(l.at.xquat + 4 * b);
    T const mass = l.constant(m.body_mass, l.body0, b);
    auto const apply = [&](Transform<T> const& frame, auto const& law) {
      Vec3<T> const arm = frame.p - com;
      Vec3<T> const w = rotate_inverse(frame.q, motion.angular),
                    v = rotate_inverse(frame.q, motion.linear + cross(motion.angular, arm) - wind);
      FluidForce<T> f;
      for (int i = 0; i < 6; ++i)
        for (int j = 0; j < 6; ++j) f.derivative[i][j] = T(0);
      law(w, v, f);
      Vec3<T> const force = rotate(frame.q, f.force), torque = rotate(frame.q, f.torque);
      s.put(l.at.cfrc + 6 * b, s.spatial(l.at.cfrc + 6 * b) + Spatial<T>{torque + cross(arm, force), force});
      if (derivative) lanes_add_fluid_derivative(l, b, frame, f);
    };
    int const first = l.index(a.body_fluidadr, b), end = l.index(a.body_fluidadr, b + 1);
    for (int g = first; g < end; ++g) {
      int item[L::W];
      l.listed_items(a.instance_fluid, a.nfluid, g, item);
      Vec3<T> const r = half_axes(ShapeType(l.index(a.fluid_type, g)), l.constant3(m.geom_size, item, 0));
      T c[5];
      for (int i = 0; i < 5; ++i) c[i] = l.constant(m.geom_fluidcoef, item, 0, 5, i);
      Vec3<T> const added{l.constant(m.geom_addedmass, item, 0, 6, 0), l.constant(m.geom_addedmass, item, 0, 6, 1),
                          l.constant(m.geom_addedmass, item, 0, 6, 2)};
      Vec3<T> const turning{l.constant(m.geom_addedmass, item, 0, 6, 3), l.constant(m.geom_addedmass, item, 0, 6, 4),
                            l.constant(m.geom_addedmass, item, 0, 6, 5)};
      apply(Transform<T>{x, q} * Transform<T>{l.constant3(m.geom_pos, item, 0), l.constant4(m.geom_quat, item, 0)},
            [&](Vec3<T> const& w, Vec3<T> const& v, FluidForce<T>& f) {
              ellipsoid_fluid(r, c, added, turning, density, viscosity, w, v, a.derivative != 0, f);
            });
    }
    if (first == end)
      apply(Transform<T>{x, q} * Transform<T>{l.constant3(m.body_ipos, l.body0, b), l.constant4(m.body_iquat, l.body0, b)},
            [&](Vec3<T> const& w, Vec3<T> const& v, FluidForce<T>& f) {
              box_fluid(mass, l.constant3(m.body_inertia, l.body0, b), density, viscosity, w, v, f);
            });
  }
  lanes_project_forces(l, l.at.passive);
}
}  // namespace detail

}  // namespace gsp
