// Values that differ from world to world against MuJoCo, whose mjModel gets the same arrays, and mj_setConst. Profile `mujoco`, double.
// Each field alone and all together, in worlds of a random mask; the others must give what the model as it was gives. Bound: 1e-10 of the
// max norm (or of 1), for derived constants, forces and one step with constraints (Newton solver at tolerance 0 against sweeps until none
// changes a rate by 1e-14; every contact condim 1 on both sides, as tests/oracle/constraints.cpp).
#include <doctest/doctest.h>

#include <cmath>
#include <functional>
#include <gsp/collision/geom_values.hpp>
#include <gsp/dynamics/set_constants.hpp>
#include <gsp/io/mjcf.hpp>
#include <gsp/model/compile.hpp>
#include <gsp/step/step.hpp>

#include "dynamics/random_tree.hpp"
#include "oracle/load.hpp"

namespace {

using Exec = Kokkos::DefaultExecutionSpace;  // the device where there is one
using Mem = Exec::memory_space;
using gsp::GeomField;
using gsp::ModelField;

// Joints of all types, limits, springs, dry friction, a tendon with a spring, servos; free bodies that lie on the floor; a lone slider.
char const* const scene = R"(<mujoco><option timestep="0.004" density="0"/><worldbody><geom type="plane" size="5 5 1"/>
    <body pos="0 0 0.6"><freejoint/><geom type="box" size=".1 .2 .05"/>
      <body pos=".15 0 0"><joint name="a" axis="0 1 0" range="-30 40" frictionloss="6" damping=".1" stiffness="3" springref="10" solreflimit=".03 .8"/><geom type="capsule" size=".03 .1" pos=".02 .01 .1"/>
        <body pos="0 0 .2"><joint name="b" axis="1 0 0" range="-20 20" frictionloss="4" armature=".01" solimpfriction=".8 .9 .002"/><geom type="capsule" size=".03 .1" pos="0 .02 .1"/></body></body>
      <body pos="-.15 0 0"><joint name="c" type="ball" range="0 25" damping=".05" stiffness="1"/><geom type="sphere" size=".06" pos=".01 0 .12"/><geom type="sphere" size=".03" pos=".1 .05 .12"/></body>
    </body>
    <body pos="1 0 .1"><freejoint/><geom type="sphere" size=".1"/><geom type="sphere" size=".05" pos=".1 .02 0"/></body>
    <body pos="1 1 .1"><freejoint/><geom type="sphere" size=".1"/><geom type="sphere" size=".05" pos=".1 .02 0"/></body>
    <body pos="3 0 1"><joint name="s" type="slide" axis="0 0 1" range="-.3 .3" damping="2"/><geom type="sphere" size=".1" mass="2"/></body>
    <body pos="-2 0 1"><joint name="d" type="hinge" axis="0 1 0" damping=".3"/><geom type="capsule" size=".04 .2" pos=".1 0 -.2"/>
      <body pos="0 0 -.4"><joint name="e" type="slide" axis="0 0 1" range="-.1 .2" frictionloss=".1"/><geom type="box" size=".05 .05 .1" pos="0 .02 -.1"/></body></body>
    </worldbody>
    <tendon><fixed name="t" limited="true" range="-.2 .3" frictionloss="5" stiffness="4" damping=".2"><joint joint="a" coef="1"/><joint joint="b" coef="-.7"/></fixed>
      <fixed name="u" range="-.3 .3" stiffness="2"><joint joint="d" coef=".5"/><joint joint="e" coef="1"/></fixed></tendon>
    <actuator><position name="pa" joint="a" kp="5" kv=".2" ctrlrange="-.3 .3"/><motor name="mb" joint="b" gear="2" forcerange="-.5 .5"/><motor name="mt" tendon="t"/>
      <general name="gd" joint="d" gainprm="3" biastype="affine" biasprm=".1 -2 -.3"/></actuator></mujoco>)";

// Tendons through sites and round geoms, also across trees and to a mocap body; muscles, servos on a site and on a ball joint, gravity
// compensation, tendon armature. No contacts: the geoms that tendons wrap round change too.
char const* const tendon_scene =
    R"(<mujoco><option timestep="0.004"><flag contact="disable"/></option><worldbody><site name="w" pos="0 0 1.5"/>
    <body name="m" mocap="true" pos=".3 .4 1.2"><site name="ms"/></body>
    <body pos="0 0 1" gravcomp=".5"><joint name="a" axis="0 1 0" range="-30 40" damping=".1"/><geom type="capsule" size=".03 .1" pos=".02 .01 -.15"/><site name="a1" pos=".05 0 -.1"/>
      <geom name="knee" type="cylinder" size=".03 .05" pos="0 0 -.3" euler="90 0 0" contype="0" conaffinity="0" mass="0"/><site name="front" pos=".06 0 -.3"/>
      <body pos="0 0 -.3"><joint name="b" axis="0 1 0" range="-60 10" armature=".01"/><geom type="capsule" size=".03 .1" pos="0 .02 -.15"/><site name="b1" pos=".05 0 -.12"/>
        <body pos="0 0 -.3"><joint name="c" type="ball" damping=".05"/><geom type="box" size=".06 .03 .02" pos=".03 0 0"/><site name="c1" pos=".06 0 0"/></body></body></body>
    <body pos=".6 0 1"><joint name="d" axis="1 0 0" damping=".2"/><geom name="drum" type="sphere" size=".08" pos="0 0 -.2"/><site name="d1" pos="0 .2 -.2"/>
      <body pos="0 0 -.4"><joint name="e" type="slide" axis="0 0 1"/><geom type="sphere" size=".05" pos=".01 0 0"/><site name="e1" pos="0 .1 0"/></body></body>
    <body pos="0 2 1"><freejoint name="f"/><geom type="box" size=".1 .05 .02"/><geom type="sphere" size=".03" pos=".1 .05 0"/><site name="f1" pos=".1 0 0"/></body>
    </worldbody>
    <tendon><spatial name="round" stiffness="20" damping=".3"><site site="a1"/><geom geom="knee" sidesite="front"/><site site="b1"/></spatial>
      <spatial name="across" stiffness="5" springlength=".3"><site site="b1"/><site site="d1"/></spatial>
      <spatial name="straight" armature=".2"><site site="w"/><site site="a1"/></spatial>
      <spatial name="drum" stiffness="3" damping=".1"><site site="w"/><geom geom="drum"/><site site="e1"/><pulley divisor="2"/><site site="d1"/><site site="ms"/></spatial></tendon>
    <actuator><muscle name="mu" tendon="round" lengthrange=".1 .5"/><muscle name="mj" joint="a" lengthrange="-.5 .7" scale="50"/><motor name="ball" joint="c" gear="1 .5 .2"/>
      <motor name="thrust" site="f1" gear="0 0 1 .1 0 0"/><position name="pt" tendon="across" kp="3"/><motor name="rel" site="c1" refsite="f1" gear="1 0 0 0 0 0"/></actuator></mujoco>)";

/// Where MuJoCo keeps a field, and a random value of it.
struct Source {
  ModelField field;
  mjtNum* (*data)(mjModel*);
  int (*items)(mjModel const*);
  int components;
  std::function<void(gsp_test::Random&, double const* base, double* out)> draw;
};
/// base (1 + spread r) + offset r
auto around(double spread, double offset, int n) {
  return [=](gsp_test::Random& r, double const* base, double* out) {
    for (int c = 0; c < n; ++c) out[c] = base[c] * (1 + spread * r()) + offset * r();
  };
}
void solref(gsp_test::Random& r, double const*, double* out) { out[0] = 0.03 + 0.01 * r(), out[1] = 1 + 0.2 * r(); }
void solimp(gsp_test::Random& r, double const*, double* out) {
  out[0] = 0.85 + 0.05 * r(), out[1] = 0.94 + 0.03 * r(), out[2] = 0.002 + 0.001 * r(), out[3] = 0.5 + 0.1 * r(), out[4] = 2 + 0.5 * r();
}
void quaternion(gsp_test::Random& r, double const*, double* out) {
  auto const q = gsp_test::random_quat(r);
  std::copy(q.begin(), q.end(), out);
}
void tilt(gsp_test::Random& r, double const* base, double* out) {
  double norm = 0;
  for (int c = 0; c < 4; ++c) out[c] = base[c] + 0.1 * r(), norm += out[c] * out[c];
  for (int c = 0; c < 4; ++c) out[c] /= std::sqrt(norm);
}
void positive(gsp_test::Random& r, double const*, double* out) { out[0] = 0.3 + 0.25 * r(); }

int bodies(mjModel const* m) { return m->nbody; }
int joints(mjModel const* m) { return m->njnt; }
int dofs(mjModel const* m) { return m->nv; }
int tendons(mjModel const* m) { return m->ntendon; }
int actuators(mjModel const* m) { return m->nu; }
int geoms(mjModel const* m) { return m->ngeom; }

std::vector<Source> sources() {
  using F = ModelField;
  return {
      {F::gravity, [](mjModel* m) -> mjtNum* { return m->opt.gravity; }, [](mjModel const*) { return 1; }, 3, around(0.1, 2, 3)},
      {F::body_mass, [](mjModel* m) { return m->body_mass; }, bodies, 1, around(0.4, 0, 1)},
      {F::body_ipos, [](mjModel* m) { return m->body_ipos; }, bodies, 3, around(0.3, 0.02, 3)},
      {F::body_iquat, [](mjModel* m) { return m->body_iquat; }, bodies, 4, quaternion},
      {F::body_inertia, [](mjModel* m) { return m->body_inertia; }, bodies, 3, around(0.2, 0, 3)},
      {F::body_gravcomp, [](mjModel* m) { return m->body_gravcomp; }, bodies, 1, positive},
      {F::jnt_range, [](mjModel* m) { return m->jnt_range; }, joints, 2, around(0.4, 0, 2)},
      {F::jnt_stiffness, [](mjModel* m) { return m->jnt_stiffness; }, joints, 1, positive},
      {F::jnt_margin, [](mjModel* m) { return m->jnt_margin; }, joints, 1, around(0, 0.02, 1)},
      {F::jnt_solref, [](mjModel* m) { return m->jnt_solref; }, joints, 2, solref},
      {F::jnt_solimp, [](mjModel* m) { return m->jnt_solimp; }, joints, 5, solimp},
      {F::dof_armature, [](mjModel* m) { return m->dof_armature; }, dofs, 1, positive},
      {F::dof_damping, [](mjModel* m) { return m->dof_damping; }, dofs, 1, positive},
      {F::dof_frictionloss, [](mjModel* m) { return m->dof_frictionloss; }, dofs, 1, positive},
      {F::dof_solref, [](mjModel* m) { return m->dof_solref; }, dofs, 2, solref},
      {F::dof_solimp, [](mjModel* m) { return m->dof_solimp; }, dofs, 5, solimp},
      {F::tendon_range, [](mjModel* m) { return m->tendon_range; }, tendons, 2, around(0.5, 0, 2)},
      {F::tendon_stiffness, [](mjModel* m) { return m->tendon_stiffness; }, tendons, 1, positive},
      {F::tendon_damping, [](mjModel* m) { return m->tendon_damping; }, tendons, 1, positive},
      {F::tendon_lengthspring, [](mjModel* m) { return m->tendon_lengthspring; }, tendons, 2,
       [](gsp_test::Random& r, double const*, double* out) { out[0] = -0.1 + 0.1 * r(), out[1] = out[0] + 0.05; }},
      {F::tendon_frictionloss, [](mjModel* m) { return m->tendon_frictionloss; }, tendons, 1, positive},
      {F::tendon_margin, [](mjModel* m) { return m->tendon_margin; }, tendons, 1, around(0, 0.02, 1)},
      {F::tendon_solref, [](mjModel* m) { return m->tendon_solref_lim; }, tendons, 2, solref},
      {F::tendon_solimp, [](mjModel* m) { return m->tendon_solimp_lim; }, tendons, 5, solimp},
      {F::tendon_friction_solref, [](mjModel* m) { return m->tendon_solref_fri; }, tendons, 2, solref},
      {F::tendon_friction_solimp, [](mjModel* m) { return m->tendon_solimp_fri; }, tendons, 5, solimp},
      {F::act_gain, [](mjModel* m) { return m->actuator_gainprm; }, actuators, 10, around(0.3, 0, 10)},
      {F::act_bias, [](mjModel* m) { return m->actuator_biasprm; }, actuators, 10, around(0.3, 0, 10)},
      {F::act_ctrlrange, [](mjModel* m) { return m->actuator_ctrlrange; }, actuators, 2, around(0.3, 0, 2)},
      {F::act_forcerange, [](mjModel* m) { return m->actuator_forcerange; }, actuators, 2, around(0.3, 0, 2)},
      {F::geom_pos, [](mjModel* m) { return m->geom_pos; }, geoms, 3, around(0, 0.005, 3)},
      {F::geom_quat, [](mjModel* m) { return m->geom_quat; }, geoms, 4, tilt},
      {F::geom_size, [](mjModel* m) { return m->geom_size; }, geoms, 3, around(0.1, 0, 3)},
  };
}

struct GeomSource {
  GeomField field;
  mjtNum* (*data)(mjModel*);
  int components;
  std::function<void(gsp_test::Random&, double const* base, double* out)> draw;
};
std::vector<GeomSource> geom_sources() {
  using F = GeomField;
  return {{F::pos, [](mjModel* m) { return m->geom_pos; }, 3, around(0.2, 0.01, 3)},
          {F::quat, [](mjModel* m) { return m->geom_quat; }, 4, tilt},
          {F::size, [](mjModel* m) { return m->geom_size; }, 3, around(0.2, 0, 3)},
          {F::friction, [](mjModel* m) { return m->geom_friction; }, 3, around(0.5, 0, 3)},
          {F::solref, [](mjModel* m) { return m->geom_solref; }, 2, solref},
          {F::solimp, [](mjModel* m) { return m->geom_solimp; }, 5, solimp}};
}

struct Error {
  double difference = 0, reference = 1;
  void add(double value, double ref) {
    difference = std::fmax(difference, std::isfinite(value) ? std::fabs(value - ref) : INFINITY),
    reference = std::fmax(reference, std::fabs(ref));
  }
  double relative() const { return difference / reference; }
};

struct Worst {
  double constants = 0, forces = 0, step = 0, contacts = 0;
  double influence = 0;  // how much MuJoCo's own constants, velocities and contacts change with the values
  int contact_count = 0;
};

using Values = Kokkos::View<double***, Kokkos::LayoutRight, Mem>;

/// A field as the host reads it: f(world, i), of n values a world.
struct HostField {
  std::vector<double> values;
  std::size_t stride;
  HostField(gsp::Field<double> const& f, int worlds, int n)
      : values(f.stride > 0 ? std::size_t(worlds - 1) * f.stride + n : n), stride(f.stride) {
    Kokkos::View<double const*, Mem, Kokkos::MemoryTraits<Kokkos::Unmanaged>> const from(f.data, values.size());
    Kokkos::deep_copy(Kokkos::View<double*, Kokkos::HostSpace, Kokkos::MemoryTraits<Kokkos::Unmanaged>>(values.data(), values.size()),
                      from);
  }
  double operator()(int w, int i) const { return values[w * stride + i]; }
};

/// geom1, geom2, friction, solimp and solref of the contacts of each world.
template <class Simulation>
struct ContactParameters {
  static constexpr int most = 64;
  Simulation sim;
  Kokkos::View<double***, Kokkos::LayoutRight, Mem> out;  // (world, most, 14)
  Kokkos::View<int*, Mem> count;
  KOKKOS_FUNCTION void operator()(int w) const {
    int const first = sim.contacts.first_of(w);
    count(w) = sim.contacts.count_of(w);
    for (int k = 0; k < count(w) && k < most; ++k) {
      out(w, k, 0) = sim.contacts.geom1(first + k), out(w, k, 1) = sim.contacts.geom2(first + k);
      auto const p = sim.collision.parameters_of(w, sim.contacts.pair(first + k));
      for (int i = 0; i < 5; ++i) out(w, k, 2 + i) = p.friction[i], out(w, k, 7 + i) = p.solimp[i];
      for (int i = 0; i < 2; ++i) out(w, k, 12 + i) = p.solref[i];
    }
  }
};

/// Takes MuJoCo's shortcuts for bodies whose frames agree out of a model whose frames change; the lone slider keeps its own. (A free body
/// whose inertia is diagonal at compile time has a diagonal M in MuJoCo for good: the scenes have none.)
void general_frames(mjModel* m) {
  for (int b = 0; b < m->nbody; ++b) {
    m->body_sameframe[b] = 0;
    if (m->body_simple[b] == 2) continue;
    m->body_simple[b] = 0;
    for (int i = m->body_dofadr[b], end = i + m->body_dofnum[b]; i < end; ++i) m->dof_simplenum[i] = 0;
  }
  for (int g = 0; g < m->ngeom; ++g) m->geom_sameframe[g] = 0, m->geom_rbound[g] = m->geom_type[g] == mjGEOM_PLANE ? 0 : 2;
}

Worst compare(char const* text, std::vector<Source> const& fields, std::vector<GeomSource> const& geom_fields, bool scale_inertia = false) {
  int const worlds = 21;
  Exec const exec;
  auto const oracle = gsp_test::load_oracle("model.xml", text);
  mjModel* const base = oracle.m();
  base->opt.solver = mjSOL_NEWTON, base->opt.iterations = 200, base->opt.tolerance = 0, base->opt.ls_iterations = 200,
  base->opt.ls_tolerance = 1e-12;
  base->opt.disableflags |= mjDSBL_AUTORESET | mjDSBL_WARMSTART | mjDSBL_MIDPHASE;
  base->opt.enableflags &= ~mjENBL_SLEEP;
  base->ngravcomp = base->nbody;  // looked for in all bodies
  for (int g = 0; g < base->ngeom; ++g) base->geom_condim[g] = 1;
  general_frames(base);
  auto compiled = gsp::compile(gsp::io::parse_mjcf(text, "model.xml"));
  for (int& condim : compiled.geom_condim) condim = 1;
  auto model = gsp::make_model<double>(exec, compiled, {.profile = gsp::Profile::mujoco});
  REQUIRE(model.nv == base->nv);
  REQUIRE(compiled.ngeom == base->ngeom);

  std::vector<ModelField> names;
  for (auto const& f : fields) names.push_back(f.field);
  if (scale_inertia) names.push_back(ModelField::body_inertia);
  gsp::make_per_world(exec, model, names, worlds);
  auto sim = gsp::make_simulation(exec, model, compiled, {.worlds = worlds});
  std::vector<GeomField> geom_names;
  for (auto const& f : geom_fields) geom_names.push_back(f.field);
  gsp::make_per_world(exec, sim.collision, geom_names, worlds);
  auto state = gsp::make_state(exec, model, {.worlds = worlds});

  gsp_test::Random r;
  std::vector<std::shared_ptr<mjModel>> theirs;
  Kokkos::View<bool*, Mem> const device_mask("mask", worlds);
  auto const mask = Kokkos::create_mirror_view(device_mask);
  for (int w = 0; w < worlds; ++w) theirs.emplace_back(mj_copyModel(nullptr, base), mj_deleteModel), mask(w) = r() > -0.2;
  Kokkos::deep_copy(device_mask, mask);
  auto const draw = [&](auto const& f, int items) {
    auto const values = Kokkos::create_mirror_view(Values("values", worlds, items, f.components));
    std::vector<double> const start(f.data(base), f.data(base) + std::size_t(items) * f.components);
    for (int w = 0; w < worlds; ++w)
      for (int i = 0; i < items; ++i) {
        f.draw(r, &start[std::size_t(i) * f.components], &values(w, i, 0));
        for (int c = 0; c < f.components && mask(w); ++c) f.data(theirs[w].get())[i * f.components + c] = values(w, i, c);
      }
    return values;
  };
  auto const on_device = [&](auto const& values) { return Kokkos::create_mirror_view_and_copy(Mem{}, values); };
  for (auto const& f : fields) {
    auto const values = draw(f, f.items(base));
    bool const frames = f.field == ModelField::body_ipos || f.field == ModelField::body_iquat;
    if (frames)  // the lone slider stays what it is
      for (int b = 0; b < base->nbody; ++b)
        if (base->body_simple[b] == 2)
          for (int w = 0; w < worlds; ++w)
            for (int c = 0; c < f.components; ++c)
              f.data(theirs[w].get())[b * f.components + c] = values(w, b, c) = f.data(base)[b * f.components + c];
    if (scale_inertia)
      for (int w = 0; w < worlds; ++w)
        for (int b = 1; b < base->nbody && mask(w); ++b)
          for (int c = 0; c < 3; ++c) theirs[w]->body_inertia[3 * b + c] *= values(w, b, 0) / base->body_mass[b];
    gsp::set_world_values(exec, model, f.field, on_device(values), device_mask, {.scale_inertia = scale_inertia});
  }
  for (auto const& f : geom_fields) gsp::set_world_values(exec, sim.collision, f.field, on_device(draw(f, base->ngeom)), device_mask);
  if (model.body_invweight0.stride > 0) gsp::set_constants(exec, model, sim.dynamics, device_mask);
  exec.fence();
  HostField const body_invweight0(model.body_invweight0, worlds, 2 * model.nbody), dof_invweight0(model.dof_invweight0, worlds, model.nv),
      dof_M0(model.dof_M0, worlds, model.nv), tendon_invweight0(model.tendon_invweight0, worlds, model.ntendon),
      tendon_length0(model.tendon_length0, worlds, model.ntendon), act_acc0(model.act_acc0, worlds, model.nu);
  auto const qpos = gsp_test::host(state.qpos), qvel = gsp_test::host(state.qvel), ctrl = gsp_test::host(state.ctrl),
             act = gsp_test::host(state.act);

  Worst worst;
  struct Reference {
    std::vector<double> bias, passive, actuator, smooth, next;
    std::vector<mjContact> contacts;
  };
  std::vector<Reference> reference(worlds);
  for (int w = 0; w < worlds; ++w) {
    mjModel* m = theirs[w].get();
    std::shared_ptr<mjData> const data(mj_makeData(m), mj_deleteData);
    mjData* d = data.get();
    mj_setConst(m, d);
    Error constants;
    for (int b = 1; b < m->nbody; ++b)
      for (int c = 0; c < 2; ++c) constants.add(body_invweight0(w, 2 * b + c), m->body_invweight0[2 * b + c]);
    for (int i = 0; i < m->nv; ++i) constants.add(dof_invweight0(w, i), m->dof_invweight0[i]);
    for (int i = 0; i < m->nv && model.dof_M0.stride > 0; ++i) constants.add(dof_M0(w, i), m->dof_M0[i]);
    for (int t = 0; t < m->ntendon; ++t) {
      constants.add(tendon_invweight0(w, t), m->tendon_invweight0[t]);
      constants.add(tendon_length0(w, t), m->tendon_length0[t]);
    }
    for (int k = 0; k < m->nu && model.act_acc0.stride > 0; ++k) constants.add(act_acc0(w, k), m->actuator_acc0[k]);
    worst.constants = std::fmax(worst.constants, constants.relative());

    mj_resetData(m, d);
    for (int j = 0; j < m->njnt; ++j) {
      int const q = m->jnt_qposadr[j];
      if (m->jnt_type[j] == mjJNT_FREE) {
        d->qpos[q + 2] = (j == 0 ? 0.3 : 0.1) * (1 + 0.5 * r());
        auto const quat = gsp_test::random_quat(r);
        for (int c = 0; c < 4; ++c) d->qpos[q + 3 + c] = quat[c];
      } else if (m->jnt_type[j] == mjJNT_BALL) {
        auto const quat = gsp_test::random_quat(r);
        for (int c = 0; c < 4; ++c) d->qpos[q + c] = quat[c] + (c == 0 ? 3 : 0);
        mju_normalize4(d->qpos + q);
      } else {
        d->qpos[q] = 0.6 * r();
      }
    }
    for (int i = 0; i < m->nv; ++i) d->qvel[i] = r();
    for (int i = 0; i < m->nu; ++i) d->ctrl[i] = 0.5 * r();
    for (int i = 0; i < m->nq; ++i) qpos(w, i) = d->qpos[i];
    for (int i = 0; i < m->nv; ++i) qvel(w, i) = d->qvel[i];
    for (int i = 0; i < m->nu; ++i) ctrl(w, i) = d->ctrl[i];
    for (int i = 0; i < m->na; ++i) act(w, i) = d->act[i] = 0.5 + 0.4 * r();
    if (mask(w)) {  // the same state in the model as it was
      std::shared_ptr<mjData> const before(mj_makeData(base), mj_deleteData);
      mj_copyState(base, d, before.get(), mjSTATE_FULLPHYSICS | mjSTATE_CTRL);
      mj_step(base, before.get()), mj_step(m, d);
      for (int i = 0; i < m->nv; ++i) worst.influence = std::fmax(worst.influence, std::fabs(before->qvel[i] - d->qvel[i]));
      for (int i = 0; i < std::min(d->ncon, before->ncon); ++i)
        for (int k = 0; k < 5; ++k)
          worst.influence = std::fmax(worst.influence, std::fabs(d->contact[i].friction[k] - before->contact[i].friction[k]));
    } else {
      mj_step(m, d);
    }
    auto& ref = reference[w];
    std::size_t const nv = m->nv;
    ref.bias.assign(d->qfrc_bias, d->qfrc_bias + nv), ref.passive.assign(d->qfrc_passive, d->qfrc_passive + nv);
    ref.actuator.assign(d->qfrc_actuator, d->qfrc_actuator + nv), ref.smooth.assign(d->qacc_smooth, d->qacc_smooth + nv);
    ref.next.assign(d->qvel, d->qvel + nv), ref.contacts.assign(d->contact, d->contact + d->ncon);
  }

  int const nv = model.nv;
  Kokkos::deep_copy(state.qpos, qpos), Kokkos::deep_copy(state.qvel, qvel), Kokkos::deep_copy(state.ctrl, ctrl);
  Kokkos::deep_copy(state.act, act);
  gsp::smooth_dynamics(exec, model, state, sim.poses, sim.dynamics, {.keep_all = true});
  Kokkos::View<double**, Kokkos::LayoutRight, Mem> bias("bias", worlds, nv), passive("passive", worlds, nv),
      actuator("actuator", worlds, nv), acceleration("acceleration", worlds, nv);
  gsp::copy_dofs(exec, model, sim.dynamics, &gsp::DynamicsLayout::bias, bias);
  gsp::copy_dofs(exec, model, sim.dynamics, &gsp::DynamicsLayout::passive, passive);
  gsp::copy_dofs(exec, model, sim.dynamics, &gsp::DynamicsLayout::actuator, actuator);
  gsp::copy_dofs(exec, model, sim.dynamics, &gsp::DynamicsLayout::acceleration, acceleration);
  gsp::step(exec, model, state, sim);
  ContactParameters<decltype(sim)> const parameters{
      sim, {"parameters", worlds, ContactParameters<decltype(sim)>::most, 14}, {"count", worlds}};
  Kokkos::parallel_for("gsp::test::contact_parameters", Kokkos::RangePolicy<Exec>(exec, 0, worlds), parameters);
  exec.fence();
  auto const biases = gsp_test::host(bias), passives = gsp_test::host(passive), actuators = gsp_test::host(actuator),
             accelerations = gsp_test::host(acceleration), velocities = gsp_test::host(state.qvel);
  auto const status = gsp_test::host(state.status);
  auto const contact_counts = gsp_test::host(parameters.count);
  auto const contacts = gsp_test::host(parameters.out);
  for (int w = 0; w < worlds; ++w) {
    auto const& ref = reference[w];
    Error e[4], step, contact;
    for (int i = 0; i < nv; ++i)
      e[0].add(biases(w, i), ref.bias[i]), e[1].add(passives(w, i), ref.passive[i]), e[2].add(actuators(w, i), ref.actuator[i]),
          e[3].add(accelerations(w, i), ref.smooth[i]), step.add(velocities(w, i), ref.next[i]);
    for (auto const& x : e) worst.forces = std::fmax(worst.forces, x.relative());
    CHECK(status(w) == 0);
    REQUIRE(contact_counts(w) <= parameters.most);
    worst.step = std::fmax(worst.step, step.relative());
    // the parameters of contacts, pair by pair
    for (int i = 0; i < contact_counts(w); ++i)
      for (auto const& c : ref.contacts) {
        int const g1 = int(contacts(w, i, 0)), g2 = int(contacts(w, i, 1));
        if (std::minmax(c.geom[0], c.geom[1]) != std::minmax(g1, g2)) continue;
        for (int k = 0; k < 5; ++k) contact.add(contacts(w, i, 2 + k), c.friction[k]), contact.add(contacts(w, i, 7 + k), c.solimp[k]);
        for (int k = 0; k < 2; ++k) contact.add(contacts(w, i, 12 + k), c.solref[k]);
        ++worst.contact_count;
      }
    worst.contacts = std::fmax(worst.contacts, contact.relative());
  }
  return worst;
}

void check(std::string const& name, Worst const& w, int contacts = 20, double influence = 1e-6) {
  MESSAGE(name << ": constants " << w.constants << ", forces " << w.forces << ", step " << w.step << ", contact parameters " << w.contacts
               << "; influence " << w.influence);
  CHECK(w.influence >= influence);
  CHECK(w.constants <= 1e-10);
  CHECK(w.forces <= 1e-10);
  CHECK(w.step <= 1e-10);
  CHECK(w.contacts <= 1e-10);
  CHECK(w.contact_count >= contacts);
}

std::string name_of(ModelField field) { return gsp::info(field).name; }

}  // namespace

TEST_CASE("each field of the model") {
  for (auto const& f : sources())
    if (gsp::info(f.field).item != gsp::ModelItem::geom) check(name_of(f.field), compare(scene, {f}, {}));
}

TEST_CASE("each field of a model with spatial tendons, muscles and mocap") {
  for (auto const& f : sources()) {
    using F = ModelField;
    // what has no effect here has one in the other scene
    bool const mild = f.field == F::dof_solref || f.field == F::dof_solimp || f.field == F::jnt_margin || f.field == F::act_ctrlrange ||
                      f.field == F::act_forcerange || f.field == F::tendon_margin || f.field == F::tendon_solref ||
                      f.field == F::tendon_solimp || f.field == F::tendon_friction_solref || f.field == F::tendon_friction_solimp ||
                      f.field == F::tendon_range;
    check(name_of(f.field), compare(tendon_scene, {f}, {}), 0, mild ? 0 : 1e-6);
  }
}

TEST_CASE("each field of colliding geoms") {
  for (auto const& f : geom_sources())
    check(gsp::detail::geom_field_row<gsp::CollisionModel<double, Mem>>(f.field).name, compare(scene, {}, {f}));
}

TEST_CASE("all at once") {
  check("all of the tendon scene", compare(tendon_scene, sources(), {}), 0);
  auto fields = sources();
  fields.resize(fields.size() - 3);  // the geoms' shapes come from the collision model's own fields
  check("all", compare(scene, fields, geom_sources()));
}

TEST_CASE("inertia in proportion to mass") {
  check("scale_inertia", compare(scene, {sources()[1]}, {}, true));
  check("scale_inertia", compare(tendon_scene, {sources()[1]}, {}, true), 0);
}
