#pragma once
#include <algorithm>
#include <functional>
#include <gsp/model/model.hpp>
#include <string>
#include <vector>

/// Values of the model that differ from world to world: `make_per_world` gives a field room for each world, `set_world_values` fills it on
/// the device. Colliding geoms: collision/world_values.hpp. What follows from masses: dynamics/set_constants.hpp.
namespace gsp {

/// Fields of the model that can be per world, named as in Model. MuJoCo's names differ for actuators: act_gain is actuator_gainprm,
/// act_bias is actuator_biasprm; body_ipos is the centre of mass.
enum class ModelField : int {
  gravity,
  body_mass,
  body_ipos,
  body_iquat,
  body_inertia,
  body_gravcomp,
  jnt_range,
  jnt_stiffness,
  jnt_margin,
  jnt_solref,
  jnt_solimp,
  jnt_actfrcrange,
  qpos_spring,
  dof_armature,
  dof_damping,
  dof_frictionloss,
  dof_solref,
  dof_solimp,
  tendon_range,
  tendon_stiffness,
  tendon_damping,
  tendon_lengthspring,
  tendon_frictionloss,
  tendon_margin,
  tendon_solref,
  tendon_solimp,
  tendon_friction_solref,
  tendon_friction_solimp,
  act_gain,
  act_bias,
  act_ctrlrange,
  act_forcerange,
  geom_pos,  // of the smooth dynamics: tendons that wrap round geoms, fluid forces
  geom_quat,
  geom_size,
  // derived: made per world with what they follow from, filled by set_constants
  body_invweight0,
  dof_invweight0,
  dof_M0,
  tendon_invweight0,
  act_acc0,
};

namespace detail {
template <class T, class Class>
using MemberOf = T Class::*;
template <class M>
struct ModelFieldInfo {
  char const* name;
  MemberOf<Field<typename M::real_type>, M> member;
  MemberOf<int, M> items;  // null: one
  int components;
  bool keeps_infinite = false;  // an infinite end means "not limited" and stays
  bool weighs = false;          // the derived fields follow from it
};
template <class M>
ModelFieldInfo<M> model_field(ModelField field) {
  using F = ModelField;
  switch (field) {
    case F::gravity:
      return {"gravity", &M::gravity, nullptr, 3};
    case F::body_mass:
      return {"body_mass", &M::body_mass, &M::nbody, 1, false, true};
    case F::body_ipos:
      return {"body_ipos", &M::body_ipos, &M::nbody, 3, false, true};
    case F::body_iquat:
      return {"body_iquat", &M::body_iquat, &M::nbody, 4, false, true};
    case F::body_inertia:
      return {"body_inertia", &M::body_inertia, &M::nbody, 3, false, true};
    case F::body_gravcomp:
      return {"body_gravcomp", &M::body_gravcomp, &M::nbody, 1};
    case F::jnt_range:
      return {"jnt_range", &M::jnt_range, &M::njnt, 2};
    case F::jnt_stiffness:
      return {"jnt_stiffness", &M::jnt_stiffness, &M::njnt, 1};
    case F::jnt_margin:
      return {"jnt_margin", &M::jnt_margin, &M::njnt, 1};
    case F::jnt_solref:
      return {"jnt_solref", &M::jnt_solref, &M::njnt, 2};
    case F::jnt_solimp:
      return {"jnt_solimp", &M::jnt_solimp, &M::njnt, 5};
    case F::jnt_actfrcrange:
      return {"jnt_actfrcrange", &M::jnt_actfrcrange, &M::njnt, 2, true};
    case F::qpos_spring:
      return {"qpos_spring", &M::qpos_spring, &M::nq, 1};
    case F::dof_armature:
      return {"dof_armature", &M::dof_armature, &M::nv, 1, false, true};
    case F::dof_damping:
      return {"dof_damping", &M::dof_damping, &M::nv, 1};
    case F::dof_frictionloss:
      return {"dof_frictionloss", &M::dof_frictionloss, &M::nv, 1};
    case F::dof_solref:
      return {"dof_solref", &M::dof_solref, &M::nv, 2};
    case F::dof_solimp:
      return {"dof_solimp", &M::dof_solimp, &M::nv, 5};
    case F::tendon_range:
      return {"tendon_range", &M::tendon_range, &M::ntendon, 2};
    case F::tendon_stiffness:
      return {"tendon_stiffness", &M::tendon_stiffness, &M::ntendon, 1};
    case F::tendon_damping:
      return {"tendon_damping", &M::tendon_damping, &M::ntendon, 1};
    case F::tendon_lengthspring:
      return {"tendon_lengthspring", &M::tendon_lengthspring, &M::ntendon, 2};
    case F::tendon_frictionloss:
      return {"tendon_frictionloss", &M::tendon_frictionloss, &M::ntendon, 1};
    case F::tendon_margin:
      return {"tendon_margin", &M::tendon_margin, &M::ntendon, 1};
    case F::tendon_solref:
      return {"tendon_solref", &M::tendon_solref, &M::ntendon, 2};
    case F::tendon_solimp:
      return {"tendon_solimp", &M::tendon_solimp, &M::ntendon, 5};
    case F::tendon_friction_solref:
      return {"tendon_friction_solref", &M::tendon_friction_solref, &M::ntendon, 2};
    case F::tendon_friction_solimp:
      return {"tendon_friction_solimp", &M::tendon_friction_solimp, &M::ntendon, 5};
    case F::act_gain:
      return {"act_gain", &M::act_gain, &M::nu, 10};
    case F::act_bias:
      return {"act_bias", &M::act_bias, &M::nu, 10};
    case F::act_ctrlrange:
      return {"act_ctrlrange", &M::act_ctrlrange, &M::nu, 2, true};
    case F::act_forcerange:
      return {"act_forcerange", &M::act_forcerange, &M::nu, 2, true};
    case F::geom_pos:
      return {"geom_pos", &M::geom_pos, &M::ngeom, 3, false, true};
    case F::geom_quat:
      return {"geom_quat", &M::geom_quat, &M::ngeom, 4, false, true};
    case F::geom_size:
      return {"geom_size", &M::geom_size, &M::ngeom, 3, false, true};
    case F::body_invweight0:
      return {"body_invweight0", &M::body_invweight0, &M::nbody, 2};
    case F::dof_invweight0:
      return {"dof_invweight0", &M::dof_invweight0, &M::nv, 1};
    case F::dof_M0:
      return {"dof_M0", &M::dof_M0, &M::nv, 1};
    case F::tendon_invweight0:
      return {"tendon_invweight0", &M::tendon_invweight0, &M::ntendon, 1};
    case F::act_acc0:
      return {"act_acc0", &M::act_acc0, &M::nu, 1};
  }
  throw Error("gsp::ModelField: no such field: give one of the enumeration");
}
inline constexpr int model_fields = int(ModelField::act_acc0) + 1;

template <class R>
struct RepeatRow {
  R const* row;
  R* out;
  int size;
  KOKKOS_FUNCTION void operator()(std::int64_t i) const { out[i] = row[i % size]; }
};
template <ExecutionSpace Exec, class R>
void repeat_row(Exec const& exec, R const* row, R* out, int size, int worlds) {
  Kokkos::parallel_for("gsp::model::repeat_row",
                       Kokkos::RangePolicy<Exec, Kokkos::IndexType<std::int64_t>>(exec, 0, std::int64_t(size) * worlds),
                       RepeatRow<R>{row, out, size});
}

/// `out` (world, row) <- values where the mask says so.
template <class R, class Values, class Mask>
struct SetRows {
  R* out;
  Values values;
  Mask mask;
  int row, components;
  bool keeps_infinite;
  KOKKOS_FUNCTION void operator()(std::int64_t i) const {
    int const w = int(i / row), k = int(i % row);
    if (!mask(w) || (keeps_infinite && Kokkos::isinf(out[i]))) return;
    if constexpr (Values::rank() == 3)
      out[i] = R(values(w, k / components, k % components));
    else
      out[i] = R(values(w, k));
  }
};
/// Masses, and moments of inertia in proportion.
template <class R, class Values, class Mask>
struct SetMasses {
  R *mass, *inertia;
  Values values;
  Mask mask;
  int nbody;
  KOKKOS_FUNCTION void operator()(std::int64_t i) const {
    int const w = int(i / nbody), b = int(i % nbody);
    if (!mask(w)) return;
    R next;
    if constexpr (Values::rank() == 3)
      next = R(values(w, b, 0));
    else
      next = R(values(w, b));
    R const scale = mass[i] > R(0) ? next / mass[i] : R(1);
    mass[i] = next;
    for (int c = 0; c < 3; ++c) inertia[3 * i + c] *= scale;
  }
};

/// True for a field that is per world in the model's own buffer; others are shared, or point at an array of the user's own.
template <class R, class Buffer>
bool in_buffer(Field<R> const& field, Buffer const& buffer) {
  std::less<R const*> const less;
  return field.stride > 0 && buffer.data() && !less(field.data, buffer.data()) && less(field.data, buffer.data() + buffer.extent(0));
}

/// What was zero for all worlds may now be more in some: terms that `make_model` left out take part.
template <ExecutionSpace Exec, class R, class Mem>
void allow_world_values(Exec const& exec, Model<R, Mem>& model, std::vector<ModelField> const& fields) {
  using F = ModelField;
  auto const has = [&](auto... f) { return std::any_of(fields.begin(), fields.end(), [&](F x) { return ((x == f) || ...); }); };
  if (has(F::dof_damping)) model.damped = true;
  if (has(F::dof_frictionloss, F::tendon_frictionloss) && model.frictionloss) {  // a row for each: bounds of zero give no force
    std::vector<int> all(std::max(model.nv, model.ntendon));
    for (int i = 0; i < int(all.size()); ++i) all[i] = i;
    if (!model.all_items.data()) model.all_items = to_device<Kokkos::View<int*, Mem>>(exec, "gsp::Model::all_items", all);
    if (has(F::dof_frictionloss)) model.friction_dofs = {model.all_items.data(), std::size_t(model.nv)};
    if (has(F::tendon_frictionloss)) model.friction_tendons = {model.all_items.data(), std::size_t(model.ntendon)};
  }
  bool const tendons = has(F::tendon_stiffness, F::tendon_damping) && (model.springs || model.dampers);
  bool gravcomp = has(F::body_gravcomp) && (model.springs || model.dampers);
  if (has(F::gravity) && !gravcomp && (model.springs || model.dampers)) {
    std::vector<R> values(model.nbody);
    download_bytes(exec, values.data(), model.body_gravcomp.data, values.size() * sizeof(R));
    exec.fence("gsp::make_per_world: the host reads");
    gravcomp = std::any_of(values.begin(), values.end(), [](R x) { return x != R(0); });
  }
  if (!tendons && !gravcomp) return;
  std::vector<Archetype> archetypes(model.host_archetypes.data(), model.host_archetypes.data() + model.narchetype);
  bool changed = false;
  for (auto& a : archetypes) {
    changed |= (tendons && !a.tendon_passive) || (gravcomp && !a.gravcomp);
    a.tendon_passive |= tendons;
    a.gravcomp |= gravcomp;
  }
  if (!changed) return;  // dynamics that were made before keep their layout
  model.archetypes = to_device<Kokkos::View<Archetype*, Mem>>(exec, "gsp::Model::archetypes", archetypes);
  model.host_archetypes = to_device<Kokkos::View<Archetype*, Kokkos::HostSpace>>(Kokkos::DefaultHostExecutionSpace{},
                                                                                 "gsp::Model::host_archetypes", archetypes);
}
}  // namespace detail

/// The mask of all worlds.
struct AllWorlds {
  KOKKOS_INLINE_FUNCTION bool operator()(int) const { return true; }
};

/// Gives each of `worlds` worlds its own values of these fields, at first the shared ones. Fields that masses and geometry decide
/// (body_invweight0, dof_invweight0, dof_M0, tendon_invweight0, act_acc0) come along with what they follow from.
/// Call it before make_dynamics and make_simulation, whose layout depends on what is there: what was zero for all may now be more, and then
/// dynamics that were made before are refused. The model keeps the memory; copies of it made before keep theirs. A field that you have
/// pointed at an array of your own stays there. Kernels read a field that is per world by a gather; the others stay as they are. Allocates;
/// fences. Errors: std::invalid_argument where fields are per world already for another number of worlds.
template <ExecutionSpace Exec, class R, class Mem>
void make_per_world(Exec const& exec, Model<R, Mem>& model, std::vector<ModelField> fields, int worlds) {
  using M = Model<R, Mem>;
  static_assert(can_access<Exec, Kokkos::View<R*, Mem>>, "gsp::make_per_world: the model is not accessible from this execution space");
  expects(worlds > 0, "gsp::make_per_world: worlds must be positive");
  expects(model.value_worlds == 0 || model.value_worlds == worlds, "gsp::make_per_world: other fields are per world already, for " +
                                                                       std::to_string(model.value_worlds) + " worlds and not " +
                                                                       std::to_string(worlds));
  bool weighs = false;
  for (auto const f : fields) weighs |= detail::model_field<M>(f).weighs;
  if (weighs)
    for (int f = int(ModelField::body_invweight0); f < detail::model_fields; ++f) fields.push_back(ModelField(f));
  // one buffer holds all that is per world: the old, then the new
  auto const row_of = [&](detail::ModelFieldInfo<M> const& f) { return (f.items ? model.*f.items : 1) * f.components; };
  std::vector<detail::ModelFieldInfo<M>> added;
  std::size_t size = model.world_reals.extent(0);
  for (auto const field : fields) {
    auto const f = detail::model_field<M>(field);
    bool const known = (model.*f.member).stride > 0 ||
                       std::any_of(added.begin(), added.end(), [&](auto const& other) { return other.member == f.member; });
    if (!known && row_of(f) > 0) added.push_back(f), size += std::size_t(worlds) * row_of(f);
  }
  if (added.empty()) return;
  auto const next = detail::allocate<Kokkos::View<R*, Mem>>("gsp::Model::world_reals", size);
  R* const out = next.data();
  detail::copy_bytes(exec, out, model.world_reals.data(), model.world_reals.extent(0) * sizeof(R));
  for (int i = 0; i < detail::model_fields; ++i) {
    auto& field = model.*detail::model_field<M>(ModelField(i)).member;
    if (detail::in_buffer(field, model.world_reals)) field.data = out + (field.data - model.world_reals.data());
  }
  std::size_t at = model.world_reals.extent(0);
  for (auto const& f : added) {
    auto& field = model.*f.member;
    int const row = row_of(f);
    detail::repeat_row(exec, field.data, out + at, row, worlds);
    field = {out + at, row};
    at += std::size_t(worlds) * row;
  }
  exec.fence("gsp::make_per_world: the old buffer may go");
  model.world_reals = next, model.value_worlds = worlds;
  detail::allow_world_values(exec, model, fields);
}

/// The values of a field, (worlds, items * components), to read or to write in kernels of your own; after writing what weighs, call
/// set_constants. Errors: std::invalid_argument where the field is not per world, or points at an array of your own.
template <class R, class Mem>
Kokkos::View<R**, Kokkos::LayoutRight, Mem, Kokkos::MemoryTraits<Kokkos::Unmanaged>> world_values(Model<R, Mem> const& model,
                                                                                                  ModelField field) {
  auto const f = detail::model_field<Model<R, Mem>>(field);
  auto const& own = model.*f.member;
  expects(own.stride > 0, std::string("gsp::world_values: ") + f.name + " is not per world; call make_per_world first");
  expects(detail::in_buffer(own, model.world_reals),
          std::string("gsp::world_values: ") + f.name + " points at an array of your own: read and write that");
  return {const_cast<R*>(own.data), std::size_t(model.value_worlds), std::size_t(own.stride)};  // memory of Model::world_reals
}

struct WorldValuesOptions {
  bool scale_inertia = false;  // body_mass alone: body_inertia changes in proportion (a denser body), else it stays (a load at the centre)
};

/// Sets a field for the worlds of the mask, from `values` (worlds, items, components) or (worlds, items * components).
/// @param mask  callable with a world, such as a View<bool*>; the others keep what they have
/// Ends of ranges that do not limit (act_ctrlrange, act_forcerange, jnt_actfrcrange of what is not limited) stay as they are; whether a
/// joint or tendon has a limit is not per world. dof_armature and dof_damping hold what actuators add. After fields that masses or geometry
/// enter, call set_constants once. Does not allocate, does not fence. Errors: std::invalid_argument for other extents.
template <ExecutionSpace Exec, class R, class Mem, class Values, class Mask = AllWorlds>
void set_world_values(Exec const& exec, Model<R, Mem> const& model, ModelField field, Values const& values, Mask const& mask = {},
                      WorldValuesOptions options = {}) {
  static_assert(Values::rank() == 2 || Values::rank() == 3,
                "gsp::set_world_values: values are (worlds, items, components) or (worlds, items * components)");
  static_assert(can_access<Exec, Values>, "gsp::set_world_values: the values are not accessible from this execution space");
  auto const f = detail::model_field<Model<R, Mem>>(field);
  auto const out = world_values(model, field);
  int const row = int(out.extent(1)), worlds = model.value_worlds;
  bool fits = int(values.extent(0)) == worlds;
  if constexpr (Values::rank() == 3)
    fits = fits && int(values.extent(1)) * f.components == row && int(values.extent(2)) == f.components;
  else
    fits = fits && int(values.extent(1)) == row;
  expects(fits, std::string("gsp::set_world_values: values of ") + f.name + " must be (" + std::to_string(worlds) + ", " +
                    std::to_string(row / f.components) + ", " + std::to_string(f.components) + ")");
  expects(!options.scale_inertia || field == ModelField::body_mass, "gsp::set_world_values: scale_inertia is for body_mass");
  using Range = Kokkos::RangePolicy<Exec, Kokkos::IndexType<std::int64_t>>;
  if (options.scale_inertia) {
    auto const inertia = world_values(model, ModelField::body_inertia);
    Kokkos::parallel_for("gsp::model::set_masses", Range(exec, 0, std::int64_t(worlds) * row),
                         detail::SetMasses<R, Values, Mask>{out.data(), inertia.data(), values, mask, row});
    return;
  }
  Kokkos::parallel_for("gsp::model::set_world_values", Range(exec, 0, std::int64_t(worlds) * row),
                       detail::SetRows<R, Values, Mask>{out.data(), values, mask, row, f.components, f.keeps_infinite});
}

}  // namespace gsp
