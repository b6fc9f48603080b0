#pragma once
#include <algorithm>
#include <array>
#include <cmath>
#include <gsp/model/compiled.hpp>
#include <gsp/model/detail/host_math.hpp>
#include <gsp/model/detail/initial_inertia.hpp>
#include <gsp/model/detail/initial_pose.hpp>
#include <optional>
#include <utility>
#include <vector>

/// The range of an actuator's length by simulation, as MuJoCo's mj_setLengthRange finds it: from qpos0 the actuator is pulled together,
/// then apart, by a force along its moment arms,
///   f = -+ accel m / |M^-1 m|,   |f| <= max_force,
/// while limits and equality constraints hold, and nothing else acts (no gravity, springs, dampers, friction, contacts, actuators). Each
/// step begins with v <- exp(-h / time constant) v, so that what is limited comes to rest. The ends are the shortest and the longest length
/// of the last `interval`. On the host, plain rather than fast: a pose, a mass matrix and a dense problem of the active constraints a step.
namespace gsp::detail {

/// A soft constraint J a = aref - R f with force f, which only pushes (f >= 0) or also pulls.
struct HeldRow {
  SparseRow J;
  double aref = 0, R = 0;
  bool pushes = true;
};

/// (A + R) f = c with f >= 0 where the row only pushes, and there (A + R) f >= c: by principal pivoting (Judice and Pires 1994), which
/// flips all rows of wrong sign at once and, where that does not help, the last one alone; finite, as A + R is positive definite. `matrix`
/// is A + R, (n, n). Nothing where rounding keeps it from ending.
inline std::optional<std::vector<double>> held_forces(std::vector<double> const& matrix, std::vector<double> const& c,
                                                      std::vector<char> const& pushes) {
  std::size_t const n = c.size();
  auto const at = [&](std::size_t i, std::size_t k) { return matrix[i * n + k]; };
  std::vector<char> active(n);
  double scale = 0;
  for (std::size_t i = 0; i < n; ++i) {
    active[i] = !pushes[i] || c[i] > 0;
    scale = std::max(scale, std::abs(c[i]));
  }
  std::size_t fewest = n + 1;
  int patience = 3;
  std::vector<double> f;
  std::vector<double> L;
  std::vector<std::size_t> list;
  std::vector<std::size_t> wrong;
  for (int round = 0; round < 1000; ++round) {
    list.clear();
    for (std::size_t i = 0; i < n; ++i)
      if (active[i]) list.push_back(i);
    std::size_t const k = list.size();
    L.assign(k * k, 0.);
    std::vector<double> y(k);
    for (std::size_t i = 0; i < k; ++i) {  // Cholesky, and L y = c on the way
      for (std::size_t j = 0; j <= i; ++j) {
        double sum = at(list[i], list[j]);
        for (std::size_t e = 0; e < j; ++e) sum -= L[i * k + e] * L[j * k + e];
        L[i * k + j] = i == j ? std::sqrt(std::max(sum, 1e-300)) : sum / L[j * k + j];
      }
      y[i] = c[list[i]];
      for (std::size_t e = 0; e < i; ++e) y[i] -= L[i * k + e] * y[e];
      y[i] /= L[i * k + i];
    }
    f.assign(n, 0.);
    for (std::size_t i = k; i-- > 0;) {
      double sum = y[i];
      for (std::size_t e = i + 1; e < k; ++e) sum -= L[e * k + i] * f[list[e]];
      f[list[i]] = sum / L[i * k + i];
    }
    wrong.clear();
    for (std::size_t i = 0; i < n; ++i) {
      if (!pushes[i]) continue;
      double rate = -c[i];
      for (std::size_t j : list) rate += at(i, j) * f[j];
      if (active[i] ? f[i] < 0 : rate < -1e-13 * scale) wrong.push_back(i);
    }
    if (wrong.empty()) return f;
    if (wrong.size() < fewest) {
      fewest = wrong.size();
      patience = 3;
    } else if (patience > 0) {
      --patience;
    } else {
      wrong = {wrong.back()};
    }
    for (std::size_t i : wrong) active[i] = !active[i];
  }
  return std::nullopt;
}

class PulledModel {
 public:
  PulledModel(CompiledModel const& m, LengthRangeDescription const& options) : m_(m), options_(options), armature_(m.dof_armature) {
    h_ = options.timestep > 0 ? options.timestep : m.option.timestep;
    for (int d = 0; d < m.nv; ++d) armature_[d] += actuator_armature(m, false, m.dof_jnt[d]);
    for (int t = 0; t < m.ntendon; ++t)
      if (double const a = m.tendon_armature[t] + actuator_armature(m, true, t); a != 0) heavy_.emplace_back(t, a);
  }

  double timestep() const { return h_; }

  /// Shortest and longest length of an actuator that is pulled together (`sign` -1) or apart (1), over the last interval. Nothing where a
  /// number grows beyond all bounds.
  std::optional<std::array<double, 2>> pull(int actuator, int sign) {
    q_ = m_.qpos0;
    v_.assign(std::size_t(m_.nv), 0.);
    std::optional<std::array<double, 2>> ends;
    for (double time = 0; time < options_.total;) {
      auto const length = step(actuator, sign);
      if (!length) return std::nullopt;
      time += h_;
      if (time <= options_.total - options_.interval) continue;
      if (!ends) ends = {*length, *length};
      ends->at(0) = std::min(ends->at(0), *length);
      ends->at(1) = std::max(ends->at(1), *length);
    }
    return ends;
  }

 private:
  using Inertias = std::vector<InitialInertia>;

  /// One step; returns the length at its start.
  std::optional<double> step(int actuator, int sign) {
    double const decay = std::exp(-h_ / std::max(0.01, options_.time_constant));
    for (double& v : v_) v *= decay;
    InitialPose const pose(m_, q_);
    std::vector<std::pair<double, SparseRow>> heavy;
    for (auto const& [t, inertia] : heavy_) heavy.emplace_back(inertia, pose.tendon(t).row);
    Inertias inertia;
    inertia.reserve(std::size_t(m_.ntree));
    for (int t = 0; t < m_.ntree; ++t) inertia.emplace_back(m_, pose, t, armature_, heavy);

    auto const arm = pose.actuator(actuator);
    std::vector<double> force(std::size_t(m_.nv), 0.);
    for (auto const& [d, x] : arm.row.entries) force[std::size_t(d)] += x;
    double const scale = sign * options_.accel / std::max(1e-15, norm(solve(inertia, force)));
    for (double& f : force) f *= scale;
    if (double const size = norm(force); options_.max_force > 0 && size > options_.max_force)
      for (double& f : force) f *= options_.max_force / size;
    move(pose);
    add_bias(pose, force);
    add_tendon_bias(heavy, force);
    auto acceleration = solve(inertia, force);
    if (!hold(pose, inertia, acceleration)) return std::nullopt;

    for (int d = 0; d < m_.nv; ++d) v_[std::size_t(d)] += h_ * acceleration[std::size_t(d)];
    advance(q_, h_);
    auto const good = [](std::vector<double> const& list) {
      return std::all_of(list.begin(), list.end(), [](double x) { return std::abs(x) < 1e10; });  // MuJoCo's bound
    };
    if (!good(q_) || !good(v_) || !good(acceleration)) return std::nullopt;
    return arm.length;
  }

  static double norm(std::vector<double> const& a) {
    double sum = 0;
    for (double x : a) sum += x * x;
    return std::sqrt(sum);
  }
  /// M^-1 a, tree by tree.
  std::vector<double> solve(Inertias const& inertia, std::vector<double> const& a) const {
    std::vector<double> out(a.size(), 0.);
    for (int t = 0; t < m_.ntree; ++t) {
      auto const first = m_.tree_dofadr[t];
      auto const from = a.begin() + first;
      std::vector<double> part(from, from + m_.tree_dofnum[t]);
      if (std::all_of(part.begin(), part.end(), [](double x) { return x == 0; })) continue;
      part = inertia[std::size_t(t)].solve(std::move(part));
      std::copy(part.begin(), part.end(), out.begin() + first);
    }
    return out;
  }
  double dot_row(SparseRow const& row, std::vector<double> const& a) const {
    double sum = 0;
    for (auto const& [d, x] : row.entries) sum += x * a[std::size_t(d)];
    return sum;
  }

  /// How a body turns, and how its point at the world's origin moves: angular and linear velocity or acceleration.
  struct Motion {
    Double3 w{}, v{};
  };
  /// Velocities V, and accelerations A for zero joint accelerations: an axis S moves with the frame that it is fixed to, A += V x S v.
  void move(InitialPose const& pose) {
    velocity_.assign(static_cast<std::size_t>(m_.nbody), {});
    drift_.assign(static_cast<std::size_t>(m_.nbody), {});
    for (int b = 1; b < m_.nbody; ++b) {
      Motion V = velocity_[std::size_t(m_.body_parent[b])];
      Motion A = drift_[std::size_t(m_.body_parent[b])];
      for (int j = m_.body_jntadr[b], end = j + m_.body_jntnum[b]; j < end; ++j) {
        auto const type = JointType(m_.jnt_type[j]);
        int const dofs = type == JointType::free ? 6 : type == JointType::ball ? 3 : 1;
        Motion frame = V;  // what the axes move with
        for (int k = 0; k < dofs; ++k) {
          int const d = m_.jnt_dofadr[j] + k;
          bool const world_axis = type == JointType::free && k < 3;
          if (type == JointType::free && k == 3) frame = V;
          double const rate = v_[std::size_t(d)];
          Double3 const w = pose.angular(d);
          Double3 const v = pose.linear(d, {0, 0, 0});
          if (!world_axis) {
            A.w = A.w + rate * cross(frame.w, w);
            A.v = A.v + rate * (cross(frame.w, v) + cross(frame.v, w));
          }
          V.w = V.w + rate * w;
          V.v = V.v + rate * v;
        }
      }
      velocity_[std::size_t(b)] = V;
      drift_[std::size_t(b)] = A;
    }
  }
  /// Acceleration of a point of a body for zero joint accelerations: A_v + A_w x p + w x (v + w x p).
  Double3 drift(int b, Double3 const& p) const {
    auto const& V = velocity_[std::size_t(b)];
    auto const& A = drift_[std::size_t(b)];
    return A.v + cross(A.w, p) + cross(V.w, V.v + cross(V.w, p));
  }

  /// Minus the forces that velocity asks for, without gravity: of a body f = m a, n = I alpha + w x I w at its centre of mass.
  void add_bias(InitialPose const& pose, std::vector<double>& force) const {
    for (int b = 1; b < m_.nbody; ++b) {
      auto const& V = velocity_[std::size_t(b)];
      auto const& A = drift_[std::size_t(b)];
      Double3 const c = pose.com(b);
      Double3 const f = m_.body_mass[b] * drift(b, c);
      auto const frame = times(pose.body(b).q, m_.body_iquat[b]);
      auto const turned = [&](Double3 const& x) {
        Double3 const y = rotate_inverse(frame, x);
        auto const& I = m_.body_inertia[b];
        return rotate(frame, {I[0] * y[0], I[1] * y[1], I[2] * y[2]});
      };
      Double3 const n = turned(A.w) + cross(V.w, turned(V.w));
      for (int d : pose.dofs_of(b)) force[std::size_t(d)] -= dot(pose.linear(d, c), f) + dot(pose.angular(d), n);
    }
  }

  /// A tendon's armature a resists its acceleration J qacc + (dJ/dt) v: minus a J^T (dJ/dt) v, dJ/dt by a central difference along v, whose
  /// error is of the order 1e-10.
  void add_tendon_bias(std::vector<std::pair<double, SparseRow>> const& heavy, std::vector<double>& force) const {
    if (heavy.empty()) return;
    double const step = 1e-5;
    auto before = q_;
    auto after = q_;
    advance(before, -step);
    advance(after, step);
    InitialPose const first(m_, before);
    InitialPose const second(m_, after);
    for (std::size_t i = 0; i < heavy.size(); ++i) {
      int const t = heavy_[i].first;
      double const rate = (dot_row(second.tendon(t).row, v_) - dot_row(first.tendon(t).row, v_)) / (2 * step);
      for (auto const& [d, x] : heavy[i].second.entries) force[std::size_t(d)] -= heavy[i].first * rate * x;
    }
  }

  /// MuJoCo's soft constraint of gap x less margin: impedance between solimp[0] and solimp[1] by |x|, aref = -b u - k imp x, R = (1 - imp)
  /// / imp times the approximate diagonal of J M^-1 J^T. `size`: the gap that the impedance sees.
  void add_row(std::vector<HeldRow>& rows, SparseRow J, double x, double size, std::array<double, 2> solref, std::array<double, 5> solimp,
               double diagonal, bool pushes) const {
    if ((solref[0] > 0) != (solref[1] > 0)) solref = {0.02, 1};
    if (solref[0] > 0) solref[0] = std::max(solref[0], 2 * h_);
    for (int i : {0, 1, 3}) solimp[std::size_t(i)] = std::clamp(solimp[std::size_t(i)], 1e-4, 0.9999);
    double const width = std::max(solimp[2], 0.);
    double const power = std::max(solimp[4], 1.);
    double impedance = 0.5 * (solimp[0] + solimp[1]);
    if (solimp[0] != solimp[1] && width > 1e-15) {
      double const r = std::abs(size) / width;
      double const middle = solimp[3];
      double y = 1;
      if (r < 1)
        y = r <= middle ? std::pow(r, power) / std::pow(middle, power - 1) : 1 - std::pow(1 - r, power) / std::pow(1 - middle, power - 1);
      impedance = solimp[0] + y * (solimp[1] - solimp[0]);
    }
    double const dw = solimp[1];
    bool const standard = solref[0] > 0;
    auto const at_least = [](double a) { return std::max(1e-15, a); };
    double const stiffness =
        standard ? 1 / at_least(dw * dw * solref[0] * solref[0] * solref[1] * solref[1]) : -solref[0] / at_least(dw * dw);
    double const damping = standard ? 2 / at_least(dw * solref[0]) : -solref[1] / at_least(dw);
    HeldRow row;
    row.aref = -damping * dot_row(J, v_) - stiffness * impedance * x;
    row.R = at_least((1 - impedance) / impedance * diagonal);
    row.pushes = pushes;
    row.J = std::move(J);
    rows.push_back(std::move(row));
  }

  static SparseRow scaled(SparseRow row, double by) {
    for (auto& e : row.entries) e.second *= by;
    return row;
  }

  void add_limits(InitialPose const& pose, std::vector<HeldRow>& rows) const {
    for (int j = 0; j < m_.njnt; ++j) {
      if (!m_.jnt_limited[j]) continue;
      int const d = m_.jnt_dofadr[j];
      int const at = m_.jnt_qposadr[j];
      auto const& range = m_.jnt_range[j];
      auto const add = [&](SparseRow J, double gap) {
        double const x = gap - m_.jnt_margin[j];
        if (x < 0) add_row(rows, std::move(J), x, x, m_.jnt_solref[j], m_.jnt_solimp[j], m_.dof_invweight0[d], true);
      };
      if (m_.jnt_type[j] == int(JointType::ball)) {
        auto const turn = InitialPose::rotation_vector(normalized({q_[at], q_[at + 1], q_[at + 2], q_[at + 3]}));
        double const angle = gsp::detail::norm(turn);
        SparseRow J;
        for (int k = 0; k < 3; ++k) J.add(d + k, angle > 0 ? -turn[k] / angle : k == 0 ? -1. : 0.);
        add(J, std::max(range[0], range[1]) - angle);
      } else if (m_.jnt_type[j] >= int(JointType::slide)) {
        for (int side : {-1, 1}) {
          SparseRow J;
          J.add(d, -side);
          add(J, side * (range[side > 0] - q_[at]));
        }
      }
    }
    for (int t = 0; t < m_.ntendon; ++t) {
      if (!m_.tendon_limited[t]) continue;
      auto const rope = pose.tendon(t);
      for (int side : {-1, 1}) {
        double const x = side * (m_.tendon_range[t][side > 0] - rope.length) - m_.tendon_margin[t];
        if (x < 0)
          add_row(rows, scaled(rope.row, -side), x, x, m_.tendon_solref_limit[t], m_.tendon_solimp_limit[t], m_.tendon_invweight0[t], true);
      }
    }
  }

  void add_equalities(InitialPose const& pose, std::vector<HeldRow>& rows) const {
    for (int e = 0; e < m_.neq; ++e) {
      if (!m_.eq_active[e]) continue;
      auto const type = EqualityType(m_.eq_type[e]);
      if (type == EqualityType::joint || type == EqualityType::tendon)
        add_coupling(pose, e, rows);
      else
        add_connection(pose, e, type == EqualityType::weld, rows);
    }
  }
  /// x1 = p0 + p1 x2 + p2 x2^2 + ..., x: positions of joints or lengths of tendons, from where they are in qpos0.
  void add_coupling(InitialPose const& pose, int e, std::vector<HeldRow>& rows) const {
    bool const joints = EqualityType(m_.eq_type[e]) == EqualityType::joint;
    auto const& p = m_.eq_data[e];
    auto const part = [&](int id) {
      LengthAndRow out;
      if (joints) {
        int const at = m_.jnt_qposadr[id];
        out.length = q_[at] - m_.qpos0[at];
        out.row.add(m_.jnt_dofadr[id], 1);
      } else {
        out = pose.tendon(id);
        out.length -= m_.tendon_length0[id];
      }
      return out;
    };
    auto const weight = [&](int id) { return joints ? m_.dof_invweight0[m_.jnt_dofadr[id]] : m_.tendon_invweight0[id]; };
    auto one = part(m_.eq_id1[e]);
    double x = one.length - p[0];
    double diagonal = weight(m_.eq_id1[e]);
    if (int const id = m_.eq_id2[e]; id >= 0) {
      auto const two = part(id);
      double const y = two.length;
      x -= y * (p[1] + y * (p[2] + y * (p[3] + y * p[4])));
      double const slope = p[1] + y * (2 * p[2] + y * (3 * p[3] + y * 4 * p[4]));
      for (auto const& [d, value] : two.row.entries) one.row.add(d, -slope * value);
      diagonal += weight(id);
    }
    add_row(rows, one.row, x, x, m_.eq_solref[e], m_.eq_solimp[e], diagonal, false);
  }
  /// connect: two points meet. weld: besides, the frames agree: torquescale times the vector part of q2^-1 q1 is zero, whose rate is half
  /// of that of q2^-1 (0, w1 - w2) q1. The part of its second derivative that velocity makes is taken from aref:
  ///   connect: a1 - a2 for zero joint accelerations;  weld: half of q2^-1 ((0, alpha1 - alpha2) + (dw w1 - w2 dw) / 2) q1, dw = w1 - w2.
  void add_connection(InitialPose const& pose, int e, bool weld, std::vector<HeldRow>& rows) const {
    auto const& data = m_.eq_data[e];
    bool const sites = m_.eq_sites[e] != 0;
    int const body[2] = {sites ? m_.site_body[m_.eq_id1[e]] : m_.eq_id1[e], sites ? m_.site_body[m_.eq_id2[e]] : m_.eq_id2[e]};
    Double3 const anchor[2] = {{data[0], data[1], data[2]}, {data[3], data[4], data[5]}};
    Pose frame[2];
    for (int k = 0; k < 2; ++k) {
      if (sites)
        frame[k] = pose.site(k == 0 ? m_.eq_id1[e] : m_.eq_id2[e]);
      else
        frame[k] = {pose.body(body[k]) * anchor[weld ? 1 - k : k], pose.body(body[k]).q};
    }
    if (weld && !sites) frame[0].q = times(frame[0].q, {data[6], data[7], data[8], data[9]});
    double const scale = data[10];
    Double4 const inverse{frame[1].q[0], -frame[1].q[1], -frame[1].q[2], -frame[1].q[3]};
    auto const difference = times(inverse, frame[0].q);
    std::array<double, 6> x{};
    for (int k = 0; k < 3; ++k) {
      x[std::size_t(k)] = frame[0].p[k] - frame[1].p[k];
      if (weld) x[std::size_t(3 + k)] = scale * difference[std::size_t(1 + k)];
    }
    std::array<SparseRow, 6> J;
    for (int k = 0; k < 2; ++k) {
      double const sign = k == 0 ? 1 : -1;
      for (int d : pose.dofs_of(body[k])) {
        Double3 const v = pose.linear(d, frame[k].p);
        Double3 const w = pose.angular(d);
        auto const turn = times(times(inverse, {0, w[0], w[1], w[2]}), frame[0].q);
        for (int c = 0; c < 3; ++c) {
          J[std::size_t(c)].add(d, sign * v[c]);
          if (weld) J[std::size_t(3 + c)].add(d, sign * 0.5 * scale * turn[std::size_t(1 + c)]);
        }
      }
    }
    std::array<double, 6> known{};
    Double3 const apart = drift(body[0], frame[0].p) - drift(body[1], frame[1].p);
    Double3 const w1 = velocity_[std::size_t(body[0])].w;
    Double3 const w2 = velocity_[std::size_t(body[1])].w;
    Double3 const dw = w1 - w2;
    Double3 const alpha = drift_[std::size_t(body[0])].w - drift_[std::size_t(body[1])].w;
    auto const pure = [](Double3 const& a) { return Double4{0, a[0], a[1], a[2]}; };
    auto const one = times(pure(dw), pure(w1));
    auto const two = times(pure(w2), pure(dw));
    Double4 middle = pure(alpha);
    for (std::size_t k = 0; k < 4; ++k) middle[k] += 0.5 * (one[k] - two[k]);
    auto const turning = times(times(inverse, middle), frame[0].q);
    for (std::size_t k = 0; k < 3; ++k) {
      known[k] = apart[k];
      known[3 + k] = 0.5 * scale * turning[1 + k];
    }
    int const n = weld ? 6 : 3;
    double size = 0;
    for (double a : x) size += a * a;
    size = std::sqrt(size);
    for (int k = 0; k < n; ++k) {
      int const which = k < 3 ? 0 : 1;  // weight of translations, of rotations
      double const diagonal = m_.body_invweight0[body[0]][which] + m_.body_invweight0[body[1]][which];
      if (J[std::size_t(k)].entries.empty()) continue;
      add_row(rows, J[std::size_t(k)], x[std::size_t(k)], size, m_.eq_solref[e], m_.eq_solimp[e], diagonal, false);
      rows.back().aref -= known[std::size_t(k)];
    }
  }

  /// Adds what limits and equality constraints do to the acceleration: M^-1 J^T f with (J M^-1 J^T + R) f = aref - J a.
  bool hold(InitialPose const& pose, Inertias const& inertia, std::vector<double>& acceleration) const {
    std::vector<HeldRow> rows;
    add_equalities(pose, rows);
    add_limits(pose, rows);
    std::size_t const n = rows.size();
    if (n == 0) return true;
    std::vector<std::vector<double>> moved;
    std::vector<double> matrix(n * n);
    std::vector<double> c(n);
    std::vector<char> pushes(n);
    for (std::size_t i = 0; i < n; ++i) {
      std::vector<double> dense(std::size_t(m_.nv), 0.);
      for (auto const& [d, x] : rows[i].J.entries) dense[std::size_t(d)] += x;
      moved.push_back(solve(inertia, dense));
      for (std::size_t k = 0; k <= i; ++k) matrix[i * n + k] = matrix[k * n + i] = dot_row(rows[k].J, moved[i]);
      matrix[i * n + i] += rows[i].R;
      c[i] = rows[i].aref - dot_row(rows[i].J, acceleration);
      pushes[i] = rows[i].pushes;
    }
    auto const forces = held_forces(matrix, c, pushes);
    if (!forces) return false;
    for (std::size_t i = 0; i < n; ++i)
      for (int d = 0; d < m_.nv; ++d) acceleration[std::size_t(d)] += (*forces)[i] * moved[i][std::size_t(d)];
    return true;
  }

  /// Positions after a time at the present velocity.
  void advance(std::vector<double>& positions, double time) const {
    for (int j = 0; j < m_.njnt; ++j) {
      auto const type = JointType(m_.jnt_type[j]);
      double* q = &positions[std::size_t(m_.jnt_qposadr[j])];
      double const* v = &v_[std::size_t(m_.jnt_dofadr[j])];
      if (type == JointType::hinge || type == JointType::slide) {
        q[0] += time * v[0];
        continue;
      }
      if (type == JointType::free) {
        for (int k = 0; k < 3; ++k) q[k] += time * v[k];
        q += 3;
        v += 3;
      }
      Double3 const turn{time * v[0], time * v[1], time * v[2]};
      double const angle = gsp::detail::norm(turn);
      Double4 next{q[0], q[1], q[2], q[3]};
      if (angle > 0) next = times(normalized(next), axis_angle((1 / angle) * turn, angle));
      next = normalized(next);
      std::copy(next.begin(), next.end(), q);
    }
  }

  CompiledModel const& m_;
  LengthRangeDescription const& options_;
  std::vector<double> armature_;
  std::vector<std::pair<int, double>> heavy_;  // tendons with armature
  double h_ = 0;
  std::vector<double> q_, v_;
  std::vector<Motion> velocity_, drift_;  // of the bodies
};

}  // namespace gsp::detail
