#pragma once
#include <algorithm>
#include <functional>
#include <gsp/model/detail/world_values_kernels.hpp>
#include <gsp/model/model.hpp>
#include <gsp/model/state.hpp>
#include <string>
#include <vector>

/// Values of the model that differ from world to world: `make_per_world` gives a field room for each world, `set_world_values` fills it on
/// the device. Which fields: fields.hpp. Colliding geoms: collision/geom_values.hpp. What follows from masses: dynamics/set_constants.hpp.
namespace gsp {

/// The mask of all worlds.
using AllWorlds = detail::AllWorlds;

/// Gives each of `worlds` worlds its own values of these fields, at first the shared ones. Fields that masses and geometry decide
/// (body_invweight0, dof_invweight0, dof_M0, tendon_invweight0, tendon_length0, act_acc0) come along with what they follow from.
/// Call it before make_dynamics and make_simulation, whose layout depends on what is there: what was zero for all may now be more, and then
/// dynamics that were made before are refused. The model keeps the memory; copies of it made before keep theirs. A field that you have
/// pointed at an array of your own stays there. Kernels read a field that is per world by a gather; the others stay as they are. Allocates;
/// fences. Errors: std::invalid_argument for a field that cannot be per world (FieldUse::per_world), and where fields are per world already
/// for another number of worlds.
template <ExecutionSpace Exec, class R, class Mem>
void make_per_world(Exec const& exec, Model<R, Mem>& model, std::vector<ModelField> const& fields, int worlds) {
  using M = Model<R, Mem>;
  static_assert(can_access<Exec, Kokkos::View<R*, Mem>>, "gsp::make_per_world: the model is not accessible from this execution space");
  expects(worlds > 0, "gsp::make_per_world: worlds must be positive and is " + std::to_string(worlds));
  detail::expects_as_many_worlds(model, worlds);
  bool decides = false;
  std::vector<detail::FieldRow<M>> added;
  auto const row_of = [&](detail::FieldRow<M> const& f) { return detail::count(model, f.item) * f.components; };
  std::size_t size = model.world_reals.extent(0);
  auto const add = [&](detail::FieldRow<M> const& f) {
    bool const known =
        (model.*f.member).stride > 0 || std::any_of(added.begin(), added.end(), [&](auto const& other) { return other.field == f.field; });
    if (known || row_of(f) == 0) return;
    added.push_back(f);
    size += std::size_t(worlds) * row_of(f);
  };
  for (auto const field : fields) {
    auto const& f = detail::field_row<M>(field);
    expects(f.use.per_world, std::string("gsp::make_per_world: ") + f.name +
                                 " is the same for all worlds: what follows from it is computed once, when the model is made");
    decides |= f.use.decides;
    add(f);
  }
  for (auto const& f : detail::field_table<M>())
    if (decides && f.use.follows) add(f);
  // one buffer holds all that is per world: the old, then the new
  if (added.empty()) return;
  auto const next = detail::allocate<Kokkos::View<R*, Mem>>("gsp::Model::world_reals", size);
  R* const out = next.data();
  detail::copy_bytes(exec, out, model.world_reals.data(), model.world_reals.extent(0) * sizeof(R));
  for (auto const& row : detail::field_table<M>()) {
    auto& field = model.*row.member;
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
  model.world_reals = next;
  model.value_worlds = worlds;
  detail::allow_world_values(exec, model, fields);
}

/// The values of a field, (worlds, items * components), to read or to write in kernels of your own; after writing what weighs, call
/// set_constants. Errors: std::invalid_argument where the field is not per world, or points at an array of your own.
template <class R, class Mem>
Kokkos::View<R**, Kokkos::LayoutRight, Mem, Kokkos::MemoryTraits<Kokkos::Unmanaged>> world_values(Model<R, Mem> const& model,
                                                                                                  ModelField field) {
  auto const& f = detail::field_row<Model<R, Mem>>(field);
  auto const& own = model.*f.member;
  expects(own.stride > 0, std::string("gsp::world_values: ") + f.name + " is not per world; call make_per_world first");
  expects(detail::in_buffer(own, model.world_reals),
          std::string("gsp::world_values: ") + f.name + " points at an array of your own: read and write that");
  return {const_cast<R*>(own.data), std::size_t(model.value_worlds), std::size_t(own.stride)};  // memory of Model::world_reals
}

namespace detail {
/// (worlds, items, components) or (worlds, items * components).
/// @param field  whose values they are
template <class Values>
void expects_values(char const* where, char const* field, Values const& values, int worlds, int items, int components) {
  bool fits = int(values.extent(0)) == worlds;
  if constexpr (Values::rank() == 3)
    fits = fits && int(values.extent(1)) == items && int(values.extent(2)) == components;
  else
    fits = fits && int(values.extent(1)) == items * components;
  if (fits) return;
  std::string given;
  for (unsigned k = 0; k < Values::rank(); ++k) given += (k ? ", " : "") + std::to_string(values.extent(k));
  throw std::invalid_argument(std::string(where) + ": values of " + field + " must be (" + std::to_string(worlds) + ", " +
                              std::to_string(items) + ", " + std::to_string(components) + ") and are (" + given + ")");
}
}  // namespace detail

struct WorldValuesOptions {
  bool scale_inertia = false;  // body_mass alone: body_inertia changes in proportion (a denser body), else it stays (a load at the centre)
};

/// Sets a field for the worlds of the mask, from `values` (worlds, items, components) or (worlds, items * components).
/// @param mask  (worlds) callable with a world, such as a View<bool*>; the others keep what they have
/// Ends of ranges that do not limit (act_ctrlrange, act_forcerange, jnt_actfrcrange of what is not limited) stay as they are; whether a
/// joint or tendon has a limit is not per world. dof_armature and dof_damping hold what actuators add. After fields that masses or geometry
/// enter, call set_constants once. Does not allocate, does not fence. Errors: std::invalid_argument for other extents, of the mask too.
template <ExecutionSpace Exec, class R, class Mem, class Values, class Mask = AllWorlds>
void set_world_values(Exec const& exec, Model<R, Mem>& model, ModelField field, Values const& values, Mask const& mask = {},
                      WorldValuesOptions options = {}) {
  static_assert(Values::rank() == 2 || Values::rank() == 3,
                "gsp::set_world_values: values are (worlds, items, components) or (worlds, items * components)");
  static_assert(can_access<Exec, Values>, "gsp::set_world_values: the values are not accessible from this execution space");
  auto const& f = detail::field_row<Model<R, Mem>>(field);
  auto const out = world_values(model, field);
  int const row = int(out.extent(1)), worlds = model.value_worlds;
  detail::expects_values("gsp::set_world_values", f.name, values, worlds, row / f.components, f.components);
  detail::expects_mask("gsp::set_world_values", mask, "values", worlds);
  expects(!options.scale_inertia || field == ModelField::body_mass, "gsp::set_world_values: scale_inertia is for body_mass");
  using Range = Kokkos::RangePolicy<Exec, Kokkos::IndexType<std::int64_t>>;
  if (options.scale_inertia) {
    expects(model.body_inertia.stride > 0,
            "gsp::set_world_values: scale_inertia changes body_inertia, which is not per world; name it in make_per_world too");
    auto const inertia = world_values(model, ModelField::body_inertia);
    Kokkos::parallel_for("gsp::model::set_masses", Range(exec, 0, std::int64_t(worlds) * row),
                         detail::SetMasses<R, Values, Mask>{out.data(), inertia.data(), values, mask, row});
    return;
  }
  Kokkos::parallel_for("gsp::model::set_world_values", Range(exec, 0, std::int64_t(worlds) * row),
                       detail::SetRows<R, Values, Mask>{out.data(), values, mask, row, f.components, f.use.keeps_infinite});
}

}  // namespace gsp
