#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <gsp/dynamics/energy.hpp>
#include <gsp/dynamics/inverse.hpp>
#include <gsp/dynamics/jacobian.hpp>
#include <gsp/dynamics/object_poses.hpp>
#include <gsp/dynamics/runge_kutta.hpp>
#include <gsp/dynamics/subtree.hpp>
#include <gsp/io/mjcf.hpp>
#include <gsp/io/write_mjcf.hpp>
#include <gsp/model/compile.hpp>
#include <gsp/model/samples.hpp>
#include <gsp/step/step.hpp>
#include <map>
#include <sstream>
#include <utility>

#include "dynamics/random_tree.hpp"
#include "oracle/everything.hpp"
#include "oracle/from_mujoco.hpp"
#include "oracle/load.hpp"
#include "support/data.hpp"
#include "support/kernels.hpp"
#include "support/skip.hpp"

// Smooth dynamics against MuJoCo, profile `mujoco`, constraints disabled in both, on every model of the zoo; the compiled model is taken
// from MuJoCo's own, so that kernels alone are compared. Relative error: max norm of the difference over max(1, max norm). Bounds are those
// of the project: 1e-10 for quantities of a state (1e-6 where a tendon wraps inside), 1e-11 for one step, and in float 1e-4 (qacc_smooth:
// max(1e-4, 2e9 x MuJoCo's own response to one rounding of q and v)). A step that misses 1e-11 must be within 10 x that response, the
// most of eight roundings at random of the many that a step makes; it is said how many those are.
namespace {

using Exec = Kokkos::DefaultHostExecutionSpace;
using Mem = Exec::memory_space;

struct Worst {
  std::map<std::string, double> value;
  void add(std::string const& name, double relative) {
    auto& v = value[name];
    v = std::fmax(v, std::isfinite(relative) ? relative : INFINITY);
  }
};

struct Error {
  double difference = 0, reference = 1;
  void add(double value, double ref) {
    difference = std::fmax(difference, std::isfinite(value) ? std::fabs(value - ref) : INFINITY),
    reference = std::fmax(reference, std::fabs(ref));
  }
  double relative() const { return difference / reference; }
};

/// Random state around qpos0: joints within +-0.5, free bodies within 1 m of their place and turned at random, velocities within +-2, full
/// controls and beyond, activations within their range.
void randomise(mjModel const* m, mjData* d, gsp_test::Random& r) {
  mj_resetData(m, d);
  for (int j = 0; j < m->njnt; ++j) {
    int q = m->jnt_qposadr[j];
    if (m->jnt_type[j] == mjJNT_FREE)
      for (int c = 0; c < 3; ++c, ++q) d->qpos[q] = m->qpos0[q] + r();
    if (m->jnt_type[j] == mjJNT_FREE || m->jnt_type[j] == mjJNT_BALL) {
      auto const quat = gsp_test::random_quat(r);
      for (int c = 0; c < 4; ++c) d->qpos[q + c] = quat[c];
    } else {
      d->qpos[q] = m->qpos0[q] + 0.5 * r();
    }
  }
  for (int i = 0; i < m->nv; ++i) d->qvel[i] = 2 * r();
  for (int i = 0; i < m->nu; ++i) {
    double const lo = m->actuator_ctrllimited[i] ? m->actuator_ctrlrange[2 * i] : -1,
                 hi = m->actuator_ctrllimited[i] ? m->actuator_ctrlrange[2 * i + 1] : 1;
    d->ctrl[i] = lo + (hi - lo) * (0.5 + 0.6 * r());  // beyond the range now and then: clamping is part of it
  }
  for (int k = 0; k < m->nactuator; ++k)
    if (int const a = m->actuator_actadr[k]; a >= 0) {
      bool const limited = m->actuator_actlimited[k];
      double const lo = limited ? m->actuator_actrange[2 * k] : 0, hi = limited ? m->actuator_actrange[2 * k + 1] : 1;
      d->act[a] = lo + (hi - lo) * (0.5 + 0.5 * r());
    }
  for (int i = 0; i < m->nmocap; ++i) {
    for (int c = 0; c < 3; ++c) d->mocap_pos[3 * i + c] += 0.3 * r();
    auto const quat = gsp_test::random_quat(r);
    for (int c = 0; c < 4; ++c) d->mocap_quat[4 * i + c] = 1.5 * quat[c];
  }
}

/// qpos0, every keyframe, then random states. False where there is no such state.
bool start(mjModel const* m, mjData* d, int index, gsp_test::Random& r) {
  if (index == 0)
    mj_resetData(m, d);
  else if (index <= m->nkey)
    mj_resetDataKeyframe(m, d, index - 1);
  else
    randomise(m, d, r);
  return true;
}

template <class R>
struct Side {
  Exec exec;
  gsp::Model<R, Mem> model;
  gsp::State<R, Mem> state;
  gsp::Dynamics<R, Mem> dynamics;
  gsp::Poses<R, Mem> poses;
  Side(gsp::CompiledModel const& c, int worlds)
      : model(gsp::make_model<R>(exec, c, {.profile = gsp::Profile::mujoco})),
        state(gsp::make_state(exec, model, {.worlds = worlds})),
        dynamics(gsp::make_dynamics(exec, model, {.worlds = worlds})),
        poses(gsp::make_poses(exec, model, {.worlds = worlds})) {}
  void set(int w, mjData const* d) {
    auto const copy = [](auto const& to, int w, mjtNum const* from) {
      for (int i = 0, n = int(to.extent(1)); i < n; ++i) to(w, i) = R(from[i]);
    };
    copy(state.qpos, w, d->qpos), copy(state.qvel, w, d->qvel), copy(state.ctrl, w, d->ctrl), copy(state.act, w, d->act);
    for (int i = 0; i < model.nmocap; ++i) {
      for (int c = 0; c < 3; ++c) state.mocap_pos(w, i, c) = R(d->mocap_pos[3 * i + c]);
      for (int c = 0; c < 4; ++c) state.mocap_quat(w, i, c) = R(d->mocap_quat[4 * i + c]);
    }
  }
  /// One item of one tree's vector, by the name in the layout.
  R item(int w, int tree, int at) const {
    auto const items = dynamics.tree(model, w, tree);
    return items[at];
  }
};

struct Reference {
  std::vector<double> xpos, xquat, M, bias, passive, actuator, acceleration, length, velocity, act_length, act_velocity, act_force;
  std::vector<double> tendon_J, moment, geom_xpos, geom_xmat, site_xpos, site_xmat, cam_xpos, cam_xmat, com, linvel, angmom, energy, jac,
      inverse;
  bool finite = true;
  double response = 0;  // own relative change of qacc_smooth under a change of q and v by one rounding
  Reference(mjModel const* m, mjData const* d) {
    auto const take = [](std::vector<double>& to, mjtNum const* from, std::size_t n) { to.assign(from, from + n); };
    std::size_t const nv = m->nv;
    take(xpos, d->xpos, 3 * m->nbody), take(xquat, d->xquat, 4 * m->nbody);
    if (nv < 1500) M.resize(nv * nv), mj_fullM(m, d, M.data());
    take(bias, d->qfrc_bias, nv), take(passive, d->qfrc_passive, nv), take(actuator, d->qfrc_actuator, nv);
    take(acceleration, d->qacc_smooth, nv), take(length, d->ten_length, m->ntendon), take(velocity, d->ten_velocity, m->ntendon);
    take(act_length, d->actuator_length, m->nout), take(act_velocity, d->actuator_velocity, m->nout),
        take(act_force, d->actuator_force, m->nout);
    take(geom_xpos, d->geom_xpos, 3 * m->ngeom), take(geom_xmat, d->geom_xmat, 9 * m->ngeom), take(site_xpos, d->site_xpos, 3 * m->nsite);
    take(site_xmat, d->site_xmat, 9 * m->nsite), take(cam_xpos, d->cam_xpos, 3 * m->ncam), take(cam_xmat, d->cam_xmat, 9 * m->ncam);
    take(com, d->subtree_com, 3 * m->nbody), take(linvel, d->subtree_linvel, 3 * m->nbody), take(angmom, d->subtree_angmom, 3 * m->nbody);
    take(energy, d->energy, 2);
    tendon_J.assign(m->ntendon * nv, 0), moment.assign(m->nout * nv, 0);
    for (int t = 0; t < m->ntendon; ++t)
      for (int e = m->ten_J_rowadr[t]; e < m->ten_J_rowadr[t] + m->ten_J_rownnz[t]; ++e)
        tendon_J[t * nv + m->ten_J_colind[e]] = d->ten_J[e];
    for (int k = 0; k < m->nout; ++k)
      for (int e = d->moment_rowadr[k]; e < d->moment_rowadr[k] + d->moment_rownnz[k]; ++e)
        moment[k * nv + d->moment_colind[e]] = d->actuator_moment[e];
  }
};

template <class R>
void compare(Side<R>& s, mjModel const* m, std::vector<Reference> const& reference, Worst& worst, bool inside) {
  int const worlds = int(reference.size());
  std::size_t const nv = m->nv;
  using View = Kokkos::View<R**, Kokkos::LayoutRight, Mem>;
  View bias("bias", worlds, nv), passive("passive", worlds, nv), actuator("actuator", worlds, nv), acceleration("acceleration", worlds, nv);
  using L = gsp::DynamicsLayout;
  gsp::copy_dofs(s.exec, s.model, s.dynamics, &L::bias, bias), gsp::copy_dofs(s.exec, s.model, s.dynamics, &L::passive, passive);
  gsp::copy_dofs(s.exec, s.model, s.dynamics, &L::actuator, actuator),
      gsp::copy_dofs(s.exec, s.model, s.dynamics, &L::acceleration, acceleration);
  Kokkos::View<R***, Kokkos::LayoutRight, Mem> M;
  if (!reference[0].M.empty()) {
    M = Kokkos::View<R***, Kokkos::LayoutRight, Mem>("M", worlds, nv, nv);
    gsp::dense_mass_matrix(s.exec, s.model, s.dynamics, M);
  }
  using View3 = Kokkos::View<R***, Kokkos::LayoutRight, Mem>;
  View3 geom_xpos("x", worlds, m->ngeom, 3), geom_xquat("q", worlds, m->ngeom, 4), site_xpos("x", worlds, m->nsite, 3),
      site_xquat("q", worlds, m->nsite, 4), cam_xpos("x", worlds, m->ncam, 3), cam_xmat("r", worlds, m->ncam, 9);
  auto subtrees = gsp::make_subtrees(s.exec, s.model, {.worlds = worlds});
  View energy("energy", worlds, 2), qacc("qacc", worlds, nv), inverse("inverse", worlds, nv);
  View3 J("J", worlds, 6, nv);
  for (int w = 0; w < worlds; ++w)
    for (std::size_t i = 0; i < nv; ++i) qacc(w, i) = R(reference[w].inverse[i]);
  gsp::geom_poses(s.exec, s.model, s.poses, geom_xpos, geom_xquat), gsp::site_poses(s.exec, s.model, s.poses, site_xpos, site_xquat);
  gsp::subtree_com(s.exec, s.model, s.poses, subtrees), gsp::camera_poses(s.exec, s.model, s.poses, subtrees.com, cam_xpos, cam_xmat);
  gsp::subtree_momentum(s.exec, s.model, s.poses, s.dynamics, subtrees);
  gsp::com_jacobian(s.exec, s.model, s.poses, s.dynamics, int(m->nbody) - 1, J);
  gsp::inverse_dynamics(s.exec, s.model, s.dynamics, qacc, inverse);
  gsp::energies(s.exec, s.model, s.state, s.poses, s.dynamics, energy);
  s.exec.fence();
  auto const& ints = s.model.ints;
  for (int w = 0; w < worlds; ++w) {
    auto const& ref = reference[w];
    std::map<std::string, Error> e;
    for (int b = 0; b < m->nbody; ++b) {
      double dot = 0;
      for (int c = 0; c < 3; ++c) e["xpos"].add(s.poses.xpos(w, b, c), ref.xpos[3 * b + c]);
      for (int c = 0; c < 4; ++c) dot += s.poses.xquat(w, b, c) * ref.xquat[4 * b + c];
      for (int c = 0; c < 4; ++c) e["xquat"].add((dot < 0 ? -1 : 1) * s.poses.xquat(w, b, c), ref.xquat[4 * b + c]);
    }
    if (!ref.M.empty())
      for (std::size_t i = 0; i < nv; ++i)
        for (std::size_t j = 0; j < nv; ++j) e["M"].add(M(w, i, j), ref.M[i * nv + j]);
    auto const add = [&](char const* name, auto const& view, std::vector<double> const& expected) {
      R const* const from = view.data() + w * view.stride(0);
      for (std::size_t i = 0; i < expected.size(); ++i) e[name].add(from[i], expected[i]);
    };
    auto const add_quats = [&](char const* name, View3 const& view, std::vector<double> const& mats) {
      for (std::size_t k = 0; k < mats.size() / 9; ++k) {
        auto const r = gsp::to_matrix(gsp::Quat<double>{view(w, k, 0), view(w, k, 1), view(w, k, 2), view(w, k, 3)});
        for (int c = 0; c < 9; ++c) e[name].add(r.m[c], mats[9 * k + c]);
      }
    };
    add("geom pos", geom_xpos, ref.geom_xpos), add_quats("geom rotation", geom_xquat, ref.geom_xmat),
        add("site pos", site_xpos, ref.site_xpos);
    add_quats("site rotation", site_xquat, ref.site_xmat), add("camera pos", cam_xpos, ref.cam_xpos),
        add("camera rotation", cam_xmat, ref.cam_xmat);
    add("subtree com", subtrees.com, ref.com), add("subtree velocity", subtrees.linvel, ref.linvel),
        add("subtree momentum", subtrees.angmom, ref.angmom);
    add("energy", energy, ref.energy), add("jacobian", J, ref.jac);
    for (std::size_t i = 0; i < nv; ++i) e["inverse"].add(inverse(w, i), ref.inverse[nv + i]);
    for (std::size_t i = 0; i < nv; ++i)
      e["bias"].add(bias(w, i), ref.bias[i]), e["passive"].add(passive(w, i), ref.passive[i]),
          e["qfrc_actuator"].add(actuator(w, i), ref.actuator[i]), e["qacc_smooth"].add(acceleration(w, i), ref.acceleration[i]);
    for (int t = 0; t < s.model.ntree; ++t) {
      auto const items = s.dynamics.tree(s.model, w, t);
      auto const& at = items.at;
      auto const& a = s.model.archetypes(s.model.tree_archetype(t));
      int const instance = s.model.tree_instance(t), dof0 = s.model.tree_dof(t);
      for (int k = 0; k < a.ntendon; ++k) {
        int const id = ints(a.instance_tendon + instance * a.ntendon + k);
        e["tendon length"].add(items[at.tendon_length + k], ref.length[id]),
            e["tendon velocity"].add(items[at.tendon_velocity + k], ref.velocity[id]);
        std::vector<double> J(nv, 0.);
        for (int i = ints(a.tendon_jadr + k); i < ints(a.tendon_jadr + k + 1); ++i)
          J[dof0 + ints(a.tendon_jdof + i)] = items[at.tendon_J + i];
        if (ints(a.tendon_kind + k) != 0)
          for (std::size_t i = 0; i < nv; ++i) e["tendon moment"].add(J[i], ref.tendon_J[id * nv + i]);
      }
      for (int k = 0; k < a.nact; ++k) {
        int const id = ints(a.instance_act + instance * a.nact + k), out = m->actuator_outadr[id];
        e["actuator length"].add(items[at.act_length + k], ref.act_length[out]),
            e["actuator velocity"].add(items[at.act_velocity + k], ref.act_velocity[out]);
        e["actuator force"].add(items[at.act_force + k], ref.act_force[out]);
        if (ints(a.act_madr + k + 1) == ints(a.act_madr + k)) continue;
        std::vector<double> arm(nv, 0.);
        for (int i = ints(a.act_madr + k); i < ints(a.act_madr + k + 1); ++i) arm[dof0 + ints(a.act_mdof + i)] = items[at.act_moment + i];
        for (std::size_t i = 0; i < nv; ++i) e["actuator moment"].add(arm[i], ref.moment[out * nv + i]);
      }
    }
    for (auto const& [name, error] : e) {
      double const bound = sizeof(R) == 8          ? (name.substr(0, 6) == "tendon" && inside ? 1e-6 : 1e-10)
                           : name == "qacc_smooth" ? std::fmax(1e-4, 2e9 * ref.response)
                                                   : 1e-4;
      if (sizeof(R) == 8 && name == "qacc_smooth" && 100 * ref.response > bound) continue;  // M is singular
      worst.add(name, error.relative() / bound);
    }
  }
}

/// MuJoCo's model with constraints, automatic resets and sleep off.
void without_constraints(mjModel* m) {
  m->opt.disableflags |= mjDSBL_CONSTRAINT | mjDSBL_AUTORESET | mjDSBL_SENSOR;
  m->opt.enableflags &= ~(mjENBL_SLEEP | mjENBL_SPECULATIVE);
}

/// MuJoCo's data with q and v changed by one rounding, up or down at random: its own response to that.
struct Copies {
  std::vector<std::unique_ptr<mjData, void (*)(mjData*)>> data;
  Copies(mjModel const* m, mjData const* d, gsp_test::Random& r, int n = 8) {
    for (int k = 0; k < n; ++k) {
      data.emplace_back(mj_copyData(nullptr, m, d), mj_deleteData);
      for (int i = 0; i < m->nq; ++i) data[k]->qpos[i] *= 1 + (r() < 0 ? -1 : 1) * 2.2e-16;
      for (int i = 0; i < m->nv; ++i) data[k]->qvel[i] *= 1 + (r() < 0 ? -1 : 1) * 2.2e-16;
    }
  }
};

void check_states(mjModel const* m, mjData* d, gsp::CompiledModel const& c, Worst& exact, Worst& single) {
  int const worlds = 1 + m->nkey + (m->nv > 1000 ? 2 : 20);
  Side<double> s(c, worlds);
  Side<float> f(c, worlds);
  std::vector<Reference> reference;
  gsp_test::Random r;
  for (int w = 0; w < worlds; ++w) {
    start(m, d, w, r);
    s.set(w, d), f.set(w, d);
    Copies const copies(m, d, r);
    mj_forward(m, d);
    mj_energyPos(m, d), mj_energyVel(m, d), mj_subtreeVel(m, d);
    auto& ref = reference.emplace_back(m, d);
    for (auto const& copy : copies.data) {
      mj_forward(m, copy.get());
      Error own;
      for (int i = 0; i < m->nv; ++i) own.add(copy->qacc_smooth[i], d->qacc_smooth[i]);
      ref.response = std::fmax(ref.response, own.relative());
    }
    ref.jac.resize(6 * m->nv), mj_jacBodyCom(m, d, ref.jac.data(), ref.jac.data() + 3 * m->nv, m->nbody - 1);
    for (int i = 0; i < m->nv; ++i) d->qacc[i] = r();
    ref.inverse.assign(d->qacc, d->qacc + m->nv);
    mj_inverse(m, d);
    ref.inverse.insert(ref.inverse.end(), d->qfrc_inverse, d->qfrc_inverse + m->nv);
  }
  gsp::smooth_dynamics(s.exec, s.model, s.state, s.poses, s.dynamics, {.keep_all = true});
  gsp::smooth_dynamics(f.exec, f.model, f.state, f.poses, f.dynamics, {.keep_all = true});
  bool inside = false;  // a tendon that may pass through a geom
  mj_resetData(m, d), mj_forward(m, d);
  for (int w = 0; w < m->nwrap; ++w)
    if ((m->wrap_type[w] == mjWRAP_SPHERE || m->wrap_type[w] == mjWRAP_CYLINDER) && m->wrap_prm[w] >= 0)
      inside |= mju_dist3(d->site_xpos + 3 * int(m->wrap_prm[w]), d->geom_xpos + 3 * m->wrap_objid[w]) < m->geom_size[3 * m->wrap_objid[w]];
  compare(s, m, reference, exact, inside), compare(f, m, reference, single, inside);
}

/// Positions, velocities and activations one after the other.
std::vector<double> values_of(mjModel const* m, mjData const* d) {
  std::vector<double> values(d->qpos, d->qpos + m->nq);
  values.insert(values.end(), d->qvel, d->qvel + m->nv), values.insert(values.end(), d->act, d->act + m->na);
  return values;
}
double relative_error(std::vector<double> const& values, std::vector<double> const& reference) {
  Error e;
  for (std::size_t i = 0; i < values.size(); ++i) e.add(values[i], reference[i]);
  return e.relative();
}

/// One step from each of 1,000 states of MuJoCo's own trajectories (where nv > 60, of 60,000 / nv, unless GSP_ALL_STATES is set): ten steps
/// from qpos0, from each keyframe, and from random states. A step that ends at a place or speed beyond 1e4 has left what a state can be,
/// and is not compared. Returns the part of the steps that is.
double check_steps(mjModel const* m, mjData* d, std::string const& name, Worst& worst) {
  int const worlds = std::getenv("GSP_ALL_STATES") ? 1000 : std::min(1000, std::max(4, 60000 / int(m->nv)));
  Side<double> s(gsp_test::from_mujoco(m), worlds);
  gsp_test::Random r{0x1234567};
  std::vector<std::vector<double>> next(worlds), saved(worlds, std::vector<double>(mj_stateSize(m, mjSTATE_INTEGRATION)));
  int starts = 0;
  for (int w = 0; w < worlds; ++w) {
    bool fresh = w % 10 == 0;
    for (int i = 0; i < m->nv; ++i) fresh |= !(std::fabs(d->qvel[i]) < 1e4);
    if (fresh) start(m, d, starts++, r);
    s.set(w, d);
    mj_getState(m, d, saved[w].data(), mjSTATE_INTEGRATION);
    mj_step(m, d);
    next[w] = values_of(m, d);
  }
  if (m->opt.integrator == mjINT_RK4) {
    auto rk = gsp::make_runge_kutta(s.exec, s.model, {.worlds = worlds});
    gsp::runge_kutta(s.exec, s.model, s.state, s.poses, s.dynamics, rk);
  } else {
    gsp::smooth_dynamics(s.exec, s.model, s.state, s.poses, s.dynamics);
    gsp::integrate(s.exec, s.model, s.state, s.dynamics);
  }
  s.exec.fence();
  int compared = 0, missed = 0;
  double furthest = 0;
  for (int w = 0; w < worlds; ++w) {
    if (!std::all_of(next[w].begin(), next[w].end(), [](double x) { return std::fabs(x) < 1e4; })) continue;
    ++compared;
    std::vector<double> ours;
    for (int i = 0; i < m->nq; ++i) ours.push_back(s.state.qpos(w, i));
    for (int i = 0; i < m->nv; ++i) ours.push_back(s.state.qvel(w, i));
    for (int i = 0; i < m->na; ++i) ours.push_back(s.state.act(w, i));
    double const error = relative_error(ours, next[w]);
    double bound = 1e-11;
    if (!(error <= bound)) {
      ++missed, furthest = std::fmax(furthest, error);
      mj_setState(m, d, saved[w].data(), mjSTATE_INTEGRATION);
      for (auto const& copy : Copies(m, d, r).data)
        mj_step(m, copy.get()), bound = std::fmax(bound, 10 * relative_error(values_of(m, copy.get()), next[w]));
    }
    worst.add(name, error / bound);
  }
  if (missed > 0) MESSAGE(name << ": " << missed << " of " << compared << " states beyond 1e-11, up to " << furthest);
  return double(compared) / worlds;
}

/// Each integrator with the model's step, or a shorter one where most steps explode: without contacts, and with explicit RK4 above all.
void check_steps(mjModel* m, mjData* d, Worst& worst, bool singular) {
  for (auto const& [integrator, name] : {std::pair{mjINT_EULER, "Euler"}, std::pair{mjINT_RK4, "RK4"},
                                         std::pair{mjINT_IMPLICITFAST, "implicitfast"}, std::pair{mjINT_IMPLICIT, "implicit"}}) {
    if (singular && integrator == mjINT_IMPLICIT) continue;  // its unsymmetric factor has a pivot of pure rounding
    m->opt.integrator = integrator;
    double const timestep = m->opt.timestep;
    double compared = 0;
    for (int k = 0; k < 4 && compared < 0.5; ++k, m->opt.timestep /= 10) compared = check_steps(m, d, name, worst);
    m->opt.timestep = timestep;
    CHECK_MESSAGE(compared > 0, std::string(name) << ": no step can be compared");
  }
}

std::vector<std::string> zoo() {
  std::vector<std::string> names;
  auto const list = gsp_test::data("models/zoo.txt");
  if (!list) return names;
  std::ifstream file(*list);
  char const* const only = std::getenv("GSP_ZOO_ONLY");
  for (std::string line; std::getline(file, line);) {
    auto const name = line.substr(0, line.find(' '));
    if (!line.empty() && line[0] != '#' && (!only || name.find(only) != std::string::npos)) names.push_back(name);
  }
  return names;
}

/// All of the above for one model.
void check(std::string const& name, mjModel* m, mjData* d) {
  without_constraints(m);
  CAPTURE(name);
  Worst exact, single, steps;
  check_states(m, d, gsp_test::from_mujoco(m), exact, single);
  double diagonal = 0, least = 1e300;  // a singular M has no implicit step that can be compared
  mj_resetData(m, d), mj_forward(m, d);
  for (int i = 0; i < m->nv; ++i) diagonal = std::fmax(diagonal, 1 / d->qLDiagInv[i]), least = std::fmin(least, 1 / d->qLDiagInv[i]);
  check_steps(m, d, steps, least <= 1e-15 * std::fmax(1, diagonal));
  for (auto const& [what, value] : exact.value) CHECK_MESSAGE(value <= 1, what << ": " << value << " of its bound");
  for (auto const& [what, value] : single.value) CHECK_MESSAGE(value <= 1, "float: " << what << ": " << value << " of its bound");
  for (auto const& [what, value] : steps.value) CHECK_MESSAGE(value <= 1, "one step, " << what << ": " << value << " of its bound");
}

/// Trajectories within max(1e-10, 100 x MuJoCo's own response to 1e-15) for as long as that response is below 1e-6.
void check_trajectories(mjModel* m) {
  int const starts = 10, steps = 1000;
  Side<double> s(gsp_test::from_mujoco(m), starts);
  std::vector<gsp_test::Oracle> a(starts), b(starts);
  gsp_test::Random r{0xabcdef};
  for (int w = 0; w < starts; ++w) {
    a[w].data.reset(mj_makeData(m)), b[w].data.reset(mj_makeData(m));
    randomise(m, a[w].d(), r);
    s.set(w, a[w].d());
    mj_copyData(b[w].d(), m, a[w].d());
    for (int i = 0; i < m->nq; ++i) b[w].d()->qpos[i] += 1e-15 * r();
  }
  auto rk = gsp::make_runge_kutta(s.exec, s.model, {.worlds = starts});
  std::vector<bool> open(starts, true);
  std::vector<int> until(starts, steps);
  double worst = 0;
  for (int t = 1; t <= steps; ++t) {
    if (m->opt.integrator == mjINT_RK4)
      gsp::runge_kutta(s.exec, s.model, s.state, s.poses, s.dynamics, rk);
    else
      gsp::smooth_dynamics(s.exec, s.model, s.state, s.poses, s.dynamics), gsp::integrate(s.exec, s.model, s.state, s.dynamics);
    s.exec.fence();
    for (int w = 0; w < starts; ++w) {
      if (!open[w]) continue;
      mj_step(m, a[w].d()), mj_step(m, b[w].d());
      Error own, ours;
      double farthest = 0;  // beyond mjMAXVAL MuJoCo warns and starts again, and we stop
      for (int i = 0; i < m->nq; ++i) farthest = std::fmax(farthest, std::fabs(a[w].d()->qpos[i]));
      for (int i = 0; i < m->nv; ++i) farthest = std::fmax(farthest, std::fabs(a[w].d()->qvel[i]));
      for (int i = 0; i < m->nq; ++i) own.add(b[w].d()->qpos[i], a[w].d()->qpos[i]), ours.add(s.state.qpos(w, i), a[w].d()->qpos[i]);
      for (int i = 0; i < m->nv; ++i) own.add(b[w].d()->qvel[i], a[w].d()->qvel[i]), ours.add(s.state.qvel(w, i), a[w].d()->qvel[i]);
      if (!(own.relative() <= 1e-6) || farthest > mjMAXVAL) {
        open[w] = false, until[w] = t;
        continue;
      }
      double const bound = std::fmax(1e-10, 100 * own.relative());
      if (ours.relative() > bound) {
        CAPTURE(w);
        CAPTURE(t);
        CAPTURE(own.relative());
        CHECK(ours.relative() <= bound);
        open[w] = false, until[w] = -t;
      }
      worst = std::fmax(worst, ours.relative() / bound);
    }
  }
  std::string lengths;
  for (int w = 0; w < starts; ++w) lengths += std::to_string(until[w]) + " ";
  MESSAGE("worst error over bound " << worst << "; compared up to steps " << lengths);
}
}  // namespace

TEST_CASE("a model with everything that the zoo has not") {
  auto const oracle = gsp_test::load_oracle("everything.xml", gsp_test::everything);
  check("everything", oracle.m(), oracle.d());
}

// A free body with bodies welded to it turns as one: implicitfast takes the derivative of its gyroscopic forces too, but not where a joint
// hangs on it, however far.
TEST_CASE("free bodies with bodies welded to them") {
  std::string const geom = "<geom type='box' size='.3 .1 .05' pos='.1 .2 .03' euler='20 30 40'/>";
  for (std::string const children :
       {"", "<body pos='.3 0 .1' euler='10 20 30'>G</body>",
        "<body pos='.3 0 .1'>G<body pos='0 .2 0'>G</body></body><body pos='0 0 1'>G</body>",
        "<body pos='.3 0 .1'>G<body pos='0 .2 0'><joint axis='0 1 0' damping='.1'/>G</body></body><body pos='0 0 1'>G</body>"}) {
    std::string text =
        "<mujoco><option density='1.2' viscosity='.3'/><worldbody><body><freejoint/>G" + children + "</body></worldbody></mujoco>";
    for (std::size_t at; (at = text.find('G')) != std::string::npos;) text.replace(at, 1, geom);
    auto const oracle = gsp_test::load_oracle("welded.xml", text);
    check(text, oracle.m(), oracle.d());
  }
}

TEST_CASE("every model of the zoo" * doctest::test_suite("data")) {
  auto const names = zoo();
  if (names.empty()) {
    gsp_test::skip("models/zoo.txt is missing from GSP_DATA_DIR");
    return;
  }
  int compared = 0;
  for (auto const& name : names) {
    auto const oracle = gsp_test::load_oracle(*gsp_test::data("models/" + name));
    mjModel* m = oracle.m();
    if (auto const reason = gsp_test::out_of_scope(m); !reason.empty() || m->nv == 0) {
      MESSAGE(name << ": skipped, " << (reason.empty() ? "no degrees of freedom" : reason));
      continue;
    }
    check(name, m, oracle.d());
    ++compared;
  }
  MESSAGE(compared << " models compared");
}

TEST_CASE("trajectories of 1,000 steps" * doctest::test_suite("data")) {
  for (std::string const name :
       {"mujoco/humanoid/humanoid.xml", "unitree/go2/go2.xml", "mujoco/humanoid/22_humanoids.xml", "mujoco/mjx/actuator/arm21.xml",
        "mujoco/balloons/balloons.xml", "mujoco/slider_crank/slider_crank.xml", "dm_control/suite/fish.xml", "mujoco/car/car.xml",
        "dm_control/suite/quadruped.xml", "mujoco/mjx/tendon/pulley_site_wrap.xml"}) {
    auto const path = gsp_test::data("models/" + name);
    if (!path) {
      gsp_test::skip(std::string(name) + " is missing from GSP_DATA_DIR");
      continue;
    }
    auto const oracle =
        gsp_test::load_oracle(*path, name.find("go2") != std::string::npos ? gsp_test::without_meshes(*path) : std::string());
    without_constraints(oracle.m());
    CAPTURE(name);
    MESSAGE(name);
    for (int integrator : {mjINT_EULER, mjINT_RK4, mjINT_IMPLICIT, mjINT_IMPLICITFAST})
      if (integrator == mjINT_EULER || name.find("22_") == std::string::npos)
        oracle.m()->opt.integrator = integrator, check_trajectories(oracle.m());
  }
}

namespace {
/// Our own reader and compiler in front of the kernels.
void check_read(std::string const& path, std::string const& text, gsp::Description const& description) {
  auto const oracle = gsp_test::load_oracle(path, text);
  without_constraints(oracle.m());
  auto c = gsp::compile(description);
  c.option.constraint = false;
  REQUIRE(c.nq == oracle.m()->nq);
  REQUIRE(c.nv == oracle.m()->nv);
  REQUIRE(c.nu == oracle.m()->nu);
  CAPTURE(path);
  Worst exact, single;
  check_states(oracle.m(), oracle.d(), c, exact, single);
  for (auto const& [what, value] : exact.value) CHECK_MESSAGE(value <= 1, what << ": " << value << " of its bound");
}
}  // namespace

TEST_CASE("models that our reader has read") {
  auto const quadruped = gsp::samples::quadruped();
  check_read("quadruped.xml", gsp::io::format_mjcf(quadruped), quadruped);
  for (std::string const name : {"mujoco/humanoid/humanoid.xml", "mujoco/humanoid/22_humanoids.xml", "unitree/go2/go2.xml"})
    if (auto const path = gsp_test::data("models/" + name))
      check_read(*path, name.find("go2") != std::string::npos ? gsp_test::without_meshes(*path) : std::string(),
                 gsp::io::read_mjcf(*path, {.skip_visuals = true}));
}

namespace {
/// Activations after five steps beside MuJoCo's. They hang on nothing that moves here, so profile `stable` has those of Euler's method.
void check_activations(std::string const& option, std::string const& rest) {
  for (auto const& [integrator, profile] : {std::pair{"Euler", gsp::Profile::mujoco}, std::pair{"implicit", gsp::Profile::mujoco},
                                            std::pair{"implicitfast", gsp::Profile::mujoco}, std::pair{"RK4", gsp::Profile::mujoco},
                                            std::pair{"Euler", gsp::Profile::stable}}) {
    INFO(integrator << ", profile " << int(profile));
    std::string const text = "<mujoco><option integrator='" + std::string(integrator) + "'>" + option + "</option>" + rest + "</mujoco>";
    auto const oracle = gsp_test::load_oracle("act.xml", text);
    mjData* const d = oracle.d();
    auto const compiled = gsp::compile(gsp::io::parse_mjcf(text, "act.xml"));
    Exec const exec;
    auto const model = gsp::make_model<double>(exec, compiled, {.profile = profile});
    auto state = gsp::make_state(exec, model, {.worlds = 2});
    auto sim = gsp::make_simulation(exec, model, compiled, {.worlds = 2});
    REQUIRE(model.na == oracle.m()->na);
    for (int i = 0; i < model.na; ++i) d->act[i] = state.act(1, i) = 2 - 0.5 * i;
    for (int i = 0; i < model.nu; ++i) d->ctrl[i] = state.ctrl(1, i) = 1;
    for (int k = 0; k < 5; ++k) mj_step(oracle.m(), d);
    gsp::step(exec, model, state, sim, {.steps = 5});
    exec.fence();
    CHECK(state.steps(1) == 5);
    CHECK(state.status(1) == 0);
    for (int i = 0; i < model.na; ++i) {
      CHECK_MESSAGE(std::abs(state.act(1, i) - d->act[i]) <= 1e-14,
                    "activation " << i << ": " << state.act(1, i) << ", MuJoCo " << d->act[i]);
      CHECK(state.act(0, i) == 0);
    }
  }
}
}  // namespace

TEST_CASE("activations of a model that has no joints") {
  check_activations(
      "", R"(<worldbody><site name="o" pos="1 0 0"/><body name="b"><geom size=".1"/><site name="s" euler="10 20 30"/></body></worldbody>
    <tendon><spatial name="t"><site site="s"/><site site="o"/></spatial></tendon>
    <actuator><general site="s" dyntype="integrator"/><general site="s" dyntype="filter" dynprm=".1"/><motor site="s"/><general tendon="t" dyntype="filterexact" dynprm=".1" actrange="0 .005"/>
      <intvelocity site="s" refsite="o" kp="3" gear="0 0 0 1 0 0" actrange="-9 9"/><general site="s" dyntype="integrator" actearly="true" actrange="0 1"/></actuator>)");
}
// The filter of a servo follows the control that is nearest to its activation, modulo a full turn, here 1.26.
TEST_CASE("filters of servos of a rotation take the nearest turn") {
  check_activations(
      "", R"(<worldbody><site name="w"/><body><joint name="j" type="ball"/><geom size=".1" pos=".1 0 0"/><site name="s"/></body></worldbody>
    <actuator><position joint="j" gear=".2 0 0" kp=".01" timeconst=".1"/><general joint="j" gear="0 .2 0" dyntype="filter" dynprm=".1" gainprm=".01" biastype="affine" biasprm="0 -.01 0"/>
      <general joint="j" gear="0 0 .2" dyntype="filter" dynprm=".1" gainprm=".01" biastype="affine" biasprm="0 -.02 0"/><general site="s" refsite="w" gear="0 0 0 .2 0 0" dyntype="filterexact" dynprm=".1" gainprm=".01" biastype="affine" biasprm="0 -.01 0"/></actuator>)");
}
TEST_CASE("activations where actuators are disabled: they stay, within their ranges or not") {
  std::string const rest = R"(<worldbody><body><joint name="j"/><geom size=".1"/></body></worldbody>
    <actuator><general joint="j" dyntype="integrator" actrange="0 1"/><general joint="j" dyntype="filterexact" dynprm=".1" actrange="0 .5"/><general joint="j" dyntype="filter" dynprm=".1"/><intvelocity joint="j" actrange="0 .1" kp="3"/></actuator>)";
  check_activations("<flag actuation='disable'/>", rest);
  check_activations("", rest);
}

// A ball joint may come after hinges and slides of its body (not before a hinge: MuJoCo and we refuse that). Armatures keep M regular.
TEST_CASE("a ball joint after hinges of the same body") {
  for (std::string const joints :
       {"<joint axis='1 2 0' pos='.1 0 .2' armature='.2' damping='.1'/><joint type='ball' pos='0 .1 0' stiffness='2' armature='.1'/>",
        "<joint axis='0 1 0' pos='0 0 .3' armature='.1'/><joint type='slide' axis='1 0 1'/><joint axis='0 0 1' "
        "armature='.3'/><joint type='ball' armature='.2' damping='.3'/>"}) {
    std::string const text = "<mujoco><worldbody><body pos='0 0 1'>" + joints +
                             "<geom type='box' size='.3 .1 .05' pos='.1 .2 .03' euler='20 30 40'/><body pos='.3 0 0'><joint axis='0 1 1'/>"
                             "<geom type='capsule' size='.05 .2'/></body></body></worldbody></mujoco>";
    auto const oracle = gsp_test::load_oracle("ball.xml", text);
    check("ball.xml", oracle.m(), oracle.d());
    check_read("ball.xml", text, gsp::io::parse_mjcf(text, "ball.xml"));
  }
}
