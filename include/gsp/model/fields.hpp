#pragma once
#include <gsp/model/compiled.hpp>
#include <gsp/model/detail/field_source.hpp>
#include <gsp/model/field.hpp>
#include <limits>
#include <span>
#include <string>
#include <vector>

/// The constants of the model that are numbers: one table, over which make_model, world values, the documentation and bindings loop. A new
/// field is a member of Model, an enumerator and a row.
namespace gsp {

template <class R, class Mem>
struct Model;

/// Fields of the model, named as in Model. MuJoCo's names differ for actuators: act_gain is actuator_gainprm, act_bias is
/// actuator_biasprm; body_ipos is the centre of mass. Their order means nothing.
enum class ModelField : int {
  gravity,
  wind,
  body_pos,
  body_quat,
  body_ipos,
  body_iquat,
  body_mass,
  body_inertia,
  body_gravcomp,
  body_slider,
  body_invweight0,
  jnt_pos,
  jnt_axis,
  jnt_range,
  jnt_stiffness,
  jnt_stiffnesspoly,
  jnt_margin,
  jnt_solref,
  jnt_solimp,
  jnt_rigid,
  jnt_actfrcrange,
  qpos0,
  qpos_spring,
  dof_armature,
  dof_damping,
  dof_dampingpoly,
  dof_frictionloss,
  dof_solref,
  dof_solimp,
  dof_invweight0,
  dof_M0,
  term_coef,
  tendon_range,
  tendon_stiffness,
  tendon_stiffnesspoly,
  tendon_damping,
  tendon_dampingpoly,
  tendon_armature,
  tendon_lengthspring,
  tendon_frictionloss,
  tendon_margin,
  tendon_solref,
  tendon_solimp,
  tendon_rigid,
  tendon_friction_solref,
  tendon_friction_solimp,
  tendon_actfrcrange,
  tendon_invweight0,
  tendon_length0,
  wrap_divisor,
  act_gear,
  act_gain,
  act_bias,
  act_dyn,
  act_ctrlrange,
  act_forcerange,
  act_actrange,
  act_lengthrange,
  act_cranklength,
  act_acc0,
  eq_data,
  eq_solref,
  eq_solimp,
  eq_rigid,
  geom_pos,
  geom_quat,
  geom_size,
  geom_fluidcoef,
  geom_addedmass,
  site_pos,
  site_quat,
  cam_pos,
  cam_quat,
  cam_pos0,
  cam_poscom0,
  cam_mat0,
  cam_focal,
  cam_resolution
};

/// What a field has a number (or `components` of them) for.
enum class ModelItem : int { world, body, joint, position, dof, term, tendon, wrap, actuator, equality, geom, site, camera };

/// What may be done with a field, and what follows from it.
struct FieldUse {
  bool per_world = false;       // may differ from world to world (world_values.hpp)
  bool keeps_infinite = false;  // an infinite end means "not limited" and stays
  bool decides = false;         // the constants of set_constants follow from it
  bool follows = false;         // is one of these: per world with what it follows from, filled by set_constants
};

/// A row of the table, for documentation and bindings.
struct ModelFieldInfo {
  ModelField field;
  char const* name;
  ModelItem item;
  int components;
  FieldUse use;
};

namespace detail {
inline std::vector<double> numbers(std::vector<double> const& v) { return v; }
template <std::size_t N>
std::vector<double> numbers(std::vector<std::array<double, N>> const& v) {
  std::vector<double> all;
  all.reserve(N * v.size());
  for (auto const& item : v) all.insert(all.end(), item.begin(), item.end());
  return all;
}
/// `values`, or `otherwise` for each of n items where the model's maker has left them empty.
template <class T>
std::vector<double> numbers(std::vector<T> const& values, int n, T const& otherwise) {
  return numbers(int(values.size()) == n ? values : std::vector<T>(n, otherwise));
}
/// Ranges; infinite where they do not limit, or are not there.
inline std::vector<double> ranges(std::vector<std::array<double, 2>> const& range, std::vector<int> const& limited, int n) {
  constexpr double infinity = std::numeric_limits<double>::infinity();
  std::vector<double> all;
  for (int i = 0; i < n; ++i) {
    bool const limits = int(range.size()) == n && int(limited.size()) == n && limited[i];
    all.push_back(limits ? range[i][0] : -infinity);
    all.push_back(limits ? range[i][1] : infinity);
  }
  return all;
}

template <class M>
struct FieldRow {
  ModelField field;
  char const* name;
  Field<typename M::real_type> M::*member;
  ModelItem item;
  int components;
  FieldUse use;
  std::vector<double> (*values)(FieldSource const&);  // empty: zeros
};

/// Rows in the order of the documentation. `R` and `Mem` matter for the members alone.
template <class M>
std::span<FieldRow<M> const> field_table() {
  using F = ModelField;
  using I = ModelItem;
  using S = FieldSource;
  constexpr FieldUse shared{}, per_world{.per_world = true}, range{.per_world = true, .keeps_infinite = true},
      decides{.per_world = true, .decides = true}, follows{.per_world = true, .follows = true};
  static constexpr FieldRow<M> rows[] = {
      {F::gravity, "gravity", &M::gravity, I::world, 3, per_world,
       [](S const& s) { return numbers(std::vector<Double3>{s.m.option.gravity_on ? s.m.option.gravity : Double3{}}); }},
      {F::wind, "wind", &M::wind, I::world, 3, shared, [](S const& s) { return numbers(std::vector<Double3>{s.m.option.wind}); }},

      {F::body_pos, "body_pos", &M::body_pos, I::body, 3, shared, [](S const& s) { return numbers(s.body_pos); }},
      {F::body_quat, "body_quat", &M::body_quat, I::body, 4, shared, [](S const& s) { return numbers(s.body_quat); }},
      {F::body_ipos, "body_ipos", &M::body_ipos, I::body, 3, decides, [](S const& s) { return numbers(s.m.body_ipos); }},
      {F::body_iquat, "body_iquat", &M::body_iquat, I::body, 4, decides, [](S const& s) { return numbers(s.m.body_iquat); }},
      {F::body_mass, "body_mass", &M::body_mass, I::body, 1, decides, [](S const& s) { return numbers(s.m.body_mass); }},
      {F::body_inertia, "body_inertia", &M::body_inertia, I::body, 3, decides, [](S const& s) { return numbers(s.m.body_inertia); }},
      {F::body_gravcomp, "body_gravcomp", &M::body_gravcomp, I::body, 1, per_world, [](S const& s) { return numbers(s.m.body_gravcomp); }},
      {F::body_slider, "body_slider", &M::body_slider, I::body, 1, shared, [](S const& s) { return numbers(s.body_slider); }},
      {F::body_invweight0, "body_invweight0", &M::body_invweight0, I::body, 2, follows,
       [](S const& s) { return numbers(s.m.body_invweight0); }},

      {F::jnt_pos, "jnt_pos", &M::jnt_pos, I::joint, 3, shared, [](S const& s) { return numbers(s.m.jnt_pos); }},
      {F::jnt_axis, "jnt_axis", &M::jnt_axis, I::joint, 3, shared, [](S const& s) { return numbers(s.m.jnt_axis); }},
      {F::jnt_range, "jnt_range", &M::jnt_range, I::joint, 2, per_world, [](S const& s) { return numbers(s.m.jnt_range); }},
      {F::jnt_stiffness, "jnt_stiffness", &M::jnt_stiffness, I::joint, 1, per_world, [](S const& s) { return numbers(s.m.jnt_stiffness); }},
      {F::jnt_stiffnesspoly, "jnt_stiffnesspoly", &M::jnt_stiffnesspoly, I::joint, 2, shared,
       [](S const& s) { return numbers(s.m.jnt_stiffnesspoly); }},
      {F::jnt_margin, "jnt_margin", &M::jnt_margin, I::joint, 1, per_world, [](S const& s) { return numbers(s.m.jnt_margin); }},
      {F::jnt_solref, "jnt_solref", &M::jnt_solref, I::joint, 2, per_world, [](S const& s) { return numbers(s.m.jnt_solref); }},
      {F::jnt_solimp, "jnt_solimp", &M::jnt_solimp, I::joint, 5, per_world, [](S const& s) { return numbers(s.m.jnt_solimp); }},
      {F::jnt_rigid, "jnt_rigid", &M::jnt_rigid, I::joint, 3, per_world,
       [](S const& s) { return numbers(s.m.jnt_rigid, s.m.njnt, Double3{}); }},
      {F::jnt_actfrcrange, "jnt_actfrcrange", &M::jnt_actfrcrange, I::joint, 2, range,
       [](S const& s) { return ranges(s.m.jnt_actfrcrange, s.m.jnt_actfrclimited, s.m.njnt); }},

      {F::qpos0, "qpos0", &M::qpos0, I::position, 1, shared, [](S const& s) { return numbers(s.m.qpos0); }},
      {F::qpos_spring, "qpos_spring", &M::qpos_spring, I::position, 1, per_world, [](S const& s) { return numbers(s.m.qpos_spring); }},

      {F::dof_armature, "dof_armature", &M::dof_armature, I::dof, 1, decides, [](S const& s) { return numbers(s.dof_armature); }},
      {F::dof_damping, "dof_damping", &M::dof_damping, I::dof, 1, per_world, [](S const& s) { return numbers(s.dof_damping); }},
      {F::dof_dampingpoly, "dof_dampingpoly", &M::dof_dampingpoly, I::dof, 2, shared,
       [](S const& s) { return numbers(s.m.dof_dampingpoly); }},
      {F::dof_frictionloss, "dof_frictionloss", &M::dof_frictionloss, I::dof, 1, per_world,
       [](S const& s) { return numbers(s.m.dof_frictionloss); }},
      {F::dof_solref, "dof_solref", &M::dof_solref, I::dof, 2, per_world, [](S const& s) { return numbers(s.m.dof_solref); }},
      {F::dof_solimp, "dof_solimp", &M::dof_solimp, I::dof, 5, per_world, [](S const& s) { return numbers(s.m.dof_solimp); }},
      {F::dof_invweight0, "dof_invweight0", &M::dof_invweight0, I::dof, 1, follows, [](S const& s) { return numbers(s.m.dof_invweight0); }},
      {F::dof_M0, "dof_M0", &M::dof_M0, I::dof, 1, follows, [](S const& s) { return numbers(s.m.dof_M0); }},

      {F::term_coef, "term_coef", &M::term_coef, I::term, 1, shared, [](S const& s) { return numbers(s.m.term_coef); }},
      {F::tendon_range, "tendon_range", &M::tendon_range, I::tendon, 2, per_world, [](S const& s) { return numbers(s.m.tendon_range); }},
      {F::tendon_stiffness, "tendon_stiffness", &M::tendon_stiffness, I::tendon, 1, per_world,
       [](S const& s) { return numbers(s.m.tendon_stiffness); }},
      {F::tendon_stiffnesspoly, "tendon_stiffnesspoly", &M::tendon_stiffnesspoly, I::tendon, 2, shared,
       [](S const& s) { return numbers(s.m.tendon_stiffnesspoly); }},
      {F::tendon_damping, "tendon_damping", &M::tendon_damping, I::tendon, 1, per_world,
       [](S const& s) { return numbers(s.tendon_damping); }},
      {F::tendon_dampingpoly, "tendon_dampingpoly", &M::tendon_dampingpoly, I::tendon, 2, shared,
       [](S const& s) { return numbers(s.m.tendon_dampingpoly); }},
      {F::tendon_armature, "tendon_armature", &M::tendon_armature, I::tendon, 1, shared,
       [](S const& s) { return numbers(s.tendon_armature); }},
      {F::tendon_lengthspring, "tendon_lengthspring", &M::tendon_lengthspring, I::tendon, 2, per_world,
       [](S const& s) { return numbers(s.m.tendon_lengthspring); }},
      {F::tendon_frictionloss, "tendon_frictionloss", &M::tendon_frictionloss, I::tendon, 1, per_world,
       [](S const& s) { return numbers(s.m.tendon_frictionloss); }},
      {F::tendon_margin, "tendon_margin", &M::tendon_margin, I::tendon, 1, per_world,
       [](S const& s) { return numbers(s.m.tendon_margin); }},
      {F::tendon_solref, "tendon_solref", &M::tendon_solref, I::tendon, 2, per_world,
       [](S const& s) { return numbers(s.m.tendon_solref_limit); }},
      {F::tendon_solimp, "tendon_solimp", &M::tendon_solimp, I::tendon, 5, per_world,
       [](S const& s) { return numbers(s.m.tendon_solimp_limit); }},
      {F::tendon_rigid, "tendon_rigid", &M::tendon_rigid, I::tendon, 3, per_world,
       [](S const& s) { return numbers(s.m.tendon_rigid, s.m.ntendon, Double3{}); }},
      {F::tendon_friction_solref, "tendon_friction_solref", &M::tendon_friction_solref, I::tendon, 2, per_world,
       [](S const& s) { return numbers(s.m.tendon_solref_friction); }},
      {F::tendon_friction_solimp, "tendon_friction_solimp", &M::tendon_friction_solimp, I::tendon, 5, per_world,
       [](S const& s) { return numbers(s.m.tendon_solimp_friction); }},
      {F::tendon_actfrcrange, "tendon_actfrcrange", &M::tendon_actfrcrange, I::tendon, 2, shared,
       [](S const& s) { return ranges(s.m.tendon_actfrcrange, s.m.tendon_actfrclimited, s.m.ntendon); }},
      {F::tendon_invweight0, "tendon_invweight0", &M::tendon_invweight0, I::tendon, 1, follows,
       [](S const& s) { return numbers(s.m.tendon_invweight0); }},
      {F::tendon_length0, "tendon_length0", &M::tendon_length0, I::tendon, 1, follows,
       [](S const& s) { return numbers(s.m.tendon_length0); }},
      {F::wrap_divisor, "wrap_divisor", &M::wrap_divisor, I::wrap, 1, shared, [](S const& s) { return numbers(s.m.wrap_divisor); }},

      {F::act_gear, "act_gear", &M::act_gear, I::actuator, 6, shared, [](S const& s) { return numbers(s.m.act_gear); }},
      {F::act_gain, "act_gain", &M::act_gain, I::actuator, 10, per_world, [](S const& s) { return numbers(s.m.act_gainprm); }},
      {F::act_bias, "act_bias", &M::act_bias, I::actuator, 10, per_world, [](S const& s) { return numbers(s.m.act_biasprm); }},
      {F::act_dyn, "act_dyn", &M::act_dyn, I::actuator, 10, shared,
       [](S const& s) { return numbers(s.m.act_dynprm, s.m.nu, std::array<double, 10>{1}); }},
      {F::act_ctrlrange, "act_ctrlrange", &M::act_ctrlrange, I::actuator, 2, range,
       [](S const& s) { return ranges(s.m.act_ctrlrange, s.m.act_ctrllimited, s.m.nu); }},
      {F::act_forcerange, "act_forcerange", &M::act_forcerange, I::actuator, 2, range,
       [](S const& s) { return ranges(s.m.act_forcerange, s.m.act_forcelimited, s.m.nu); }},
      {F::act_actrange, "act_actrange", &M::act_actrange, I::actuator, 2, shared,
       [](S const& s) { return ranges(s.m.act_actrange, s.m.act_actlimited, s.m.nu); }},
      {F::act_lengthrange, "act_lengthrange", &M::act_lengthrange, I::actuator, 2, shared,
       [](S const& s) { return numbers(s.m.act_lengthrange); }},
      {F::act_cranklength, "act_cranklength", &M::act_cranklength, I::actuator, 1, shared,
       [](S const& s) { return numbers(s.m.act_cranklength); }},
      {F::act_acc0, "act_acc0", &M::act_acc0, I::actuator, 1, follows, [](S const& s) { return numbers(s.m.act_acc0); }},

      {F::eq_data, "eq_data", &M::eq_data, I::equality, 11, per_world, [](S const& s) { return numbers(s.m.eq_data); }},
      {F::eq_solref, "eq_solref", &M::eq_solref, I::equality, 2, per_world, [](S const& s) { return numbers(s.m.eq_solref); }},
      {F::eq_solimp, "eq_solimp", &M::eq_solimp, I::equality, 5, per_world, [](S const& s) { return numbers(s.m.eq_solimp); }},
      {F::eq_rigid, "eq_rigid", &M::eq_rigid, I::equality, 3, per_world,
       [](S const& s) { return numbers(s.m.eq_rigid, s.m.neq, Double3{}); }},

      // of the smooth dynamics: tendons that wrap round geoms, fluid forces
      {F::geom_pos, "geom_pos", &M::geom_pos, I::geom, 3, decides, [](S const& s) { return numbers(s.m.geom_pos); }},
      {F::geom_quat, "geom_quat", &M::geom_quat, I::geom, 4, decides, [](S const& s) { return numbers(s.m.geom_quat); }},
      {F::geom_size, "geom_size", &M::geom_size, I::geom, 3, decides, [](S const& s) { return numbers(s.m.geom_size); }},
      {F::geom_fluidcoef, "geom_fluidcoef", &M::geom_fluidcoef, I::geom, 5, shared,
       [](S const& s) { return numbers(s.m.geom_fluidcoef, s.m.ngeom, {0.5, 0.25, 1.5, 1, 1}); }},
      {F::geom_addedmass, "geom_addedmass", &M::geom_addedmass, I::geom, 6, shared, [](S const& s) { return numbers(s.geom_addedmass); }},

      {F::site_pos, "site_pos", &M::site_pos, I::site, 3, shared, [](S const& s) { return numbers(s.m.site_pos); }},
      {F::site_quat, "site_quat", &M::site_quat, I::site, 4, shared, [](S const& s) { return numbers(s.m.site_quat); }},

      {F::cam_pos, "cam_pos", &M::cam_pos, I::camera, 3, shared, [](S const& s) { return numbers(s.m.cam_pos); }},
      {F::cam_quat, "cam_quat", &M::cam_quat, I::camera, 4, shared, [](S const& s) { return numbers(s.m.cam_quat); }},
      {F::cam_pos0, "cam_pos0", &M::cam_pos0, I::camera, 3, shared, [](S const& s) { return numbers(s.m.cam_pos0); }},
      {F::cam_poscom0, "cam_poscom0", &M::cam_poscom0, I::camera, 3, shared, [](S const& s) { return numbers(s.m.cam_poscom0); }},
      {F::cam_mat0, "cam_mat0", &M::cam_mat0, I::camera, 9, shared,
       [](S const& s) { return numbers(s.m.cam_mat0, s.m.ncam, {1, 0, 0, 0, 1, 0, 0, 0, 1}); }},
      {F::cam_focal, "cam_focal", &M::cam_focal, I::camera, 2, shared, [](S const& s) { return numbers(s.m.cam_focal, s.m.ncam, {1, 1}); }},
      {F::cam_resolution, "cam_resolution", &M::cam_resolution, I::camera, 2, shared,
       [](S const& s) { return numbers(s.m.cam_resolution, s.m.ncam, {1, 1}); }},
  };
  return rows;
}

/// How many items of a kind the model has; -1: it keeps no count of them.
template <class M>
int count(M const& model, ModelItem item) {
  switch (item) {
    case ModelItem::world:
      return 1;
    case ModelItem::body:
      return model.nbody;
    case ModelItem::joint:
      return model.njnt;
    case ModelItem::position:
      return model.nq;
    case ModelItem::dof:
      return model.nv;
    case ModelItem::tendon:
      return model.ntendon;
    case ModelItem::actuator:
      return model.nu;
    case ModelItem::equality:
      return model.neq;
    case ModelItem::geom:
      return model.ngeom;
    case ModelItem::site:
      return model.nsite;
    case ModelItem::camera:
      return model.ncam;
    case ModelItem::term:
    case ModelItem::wrap:
      break;
  }
  return -1;
}

template <class M>
FieldRow<M> const& field_row(ModelField field) {
  for (auto const& row : field_table<M>())
    if (row.field == field) return row;
  throw Error("gsp::ModelField: no such field: give one of the enumeration");
}
}  // namespace detail

}  // namespace gsp
