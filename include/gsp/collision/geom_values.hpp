#pragma once
#include <gsp/collision/collision_model.hpp>
#include <gsp/model/world_values.hpp>
#include <span>

/// Shapes, poses and contact parameters of geoms that differ from world to world, as model/world_values.hpp has it for the model.
namespace gsp {

/// Fields of geoms, by MuJoCo's geom index. Sizes: (worlds, geoms, components).
enum class GeomField : int { pos, quat, size, friction, solref, solimp };

namespace detail {
template <class C>
struct GeomFieldRow {
  GeomField field;
  char const* name;
  Field<typename C::real_type> C::*member;
  int stride, first, components;  // of a collider in the member
  bool mixes;                     // a parameter of contacts, which are then mixed where a contact is met
};
template <class C>
std::span<GeomFieldRow<C> const> geom_field_table() {
  using F = GeomField;
  static constexpr GeomFieldRow<C> rows[] = {
      {F::pos, "pos", &C::collider_pose, 7, 0, 3, false},        {F::quat, "quat", &C::collider_pose, 7, 3, 4, false},
      {F::size, "size", &C::collider_size, 3, 0, 3, false},      {F::friction, "friction", &C::collider_friction, 3, 0, 3, true},
      {F::solref, "solref", &C::collider_solref, 2, 0, 2, true}, {F::solimp, "solimp", &C::collider_solimp, 5, 0, 5, true},
  };
  return rows;
}
template <class C>
GeomFieldRow<C> const& geom_field_row(GeomField field) {
  for (auto const& row : geom_field_table<C>())
    if (row.field == field) return row;
  throw Error("gsp::GeomField: no such field: give one of the enumeration");
}

template <class R, class Mem, class Values, class Mask>
struct SetGeoms {
  typename CollisionModel<R, Mem>::template Array<int const*> collider_geom;
  R* out;
  Values values;
  Mask mask;
  int colliders, stride, first, components;
  KOKKOS_FUNCTION void operator()(std::int64_t i) const {
    int const w = int(i / colliders), c = int(i % colliders), g = collider_geom(c);
    if (!mask(w)) return;
    R* const to = out + i * stride + first;
    for (int k = 0; k < components; ++k) {
      if constexpr (Values::rank() == 3)
        to[k] = R(values(w, g, k));
      else
        to[k] = R(values(w, components * g + k));
    }
    if (stride == 7 && first == 3) {  // quaternions of any length
      R const n = Kokkos::sqrt(to[0] * to[0] + to[1] * to[1] + to[2] * to[2] + to[3] * to[3]);
      for (int k = 0; k < 4; ++k) to[k] = n == R(0) ? R(k == 0) : to[k] / n;
    }
  }
};
template <class R, class Mem, class Out>
struct CopyGeoms {
  typename CollisionModel<R, Mem>::template Array<int const*> collider_geom;
  Field<R> field;
  Out out;
  int colliders, stride, first, components;
  KOKKOS_FUNCTION void operator()(std::int64_t i) const {
    int const w = int(i / colliders), c = int(i % colliders), g = collider_geom(c);
    for (int k = 0; k < components; ++k) {
      R const value = field(w, c * stride + first + k);
      if constexpr (Out::rank() == 3)
        out(w, g, k) = value;
      else
        out(w, components * g + k) = value;
    }
  }
};
/// The row of a field that is per world and lies in the model's own memory.
template <class R, class Mem, class Values>
GeomFieldRow<CollisionModel<R, Mem>> const& own_geom_field(char const* where, CollisionModel<R, Mem> const& model, GeomField field,
                                                           Values const& values) {
  static_assert(Values::rank() == 2 || Values::rank() == 3, "values are (worlds, geoms, components) or (worlds, geoms * components)");
  auto const& f = geom_field_row<CollisionModel<R, Mem>>(field);
  auto const& own = model.*f.member;
  if (own.stride == 0)
    throw std::invalid_argument(std::string(where) + ": geom " + f.name + " is not per world; call make_per_world first");
  if (!in_buffer(own, model.world_reals))
    throw std::invalid_argument(std::string(where) + ": geom " + f.name + " points at an array of your own: read and write that");
  expects_values(where, f.name, values, model.value_worlds, model.geoms, f.components);
  return f;
}
}  // namespace detail

/// Gives each of `worlds` worlds its own values of these fields of the geoms that collide, at first the shared ones. Parameters of contacts
/// (friction, solref, solimp) are then mixed where a contact is met; models that share them keep the table. They have no effect
/// on named pairs (<pair>), whose parameters are their own, nor where flag override says what they are. The model keeps the memory.
/// Allocates; fences. Errors: std::invalid_argument where fields are per world already for another number of worlds.
template <ExecutionSpace Exec, class R, class Mem>
void make_per_world(Exec const& exec, CollisionModel<R, Mem>& model, std::vector<GeomField> const& fields, int worlds) {
  using C = CollisionModel<R, Mem>;
  static_assert(can_access<Exec, C>, "gsp::make_per_world: the collision model is not accessible from this execution space");
  expects(worlds > 0, "gsp::make_per_world: worlds must be positive and is " + std::to_string(worlds));
  detail::expects_as_many_worlds(model, worlds);
  if (model.colliders == 0) return;
  std::size_t size = model.world_reals.extent(0);
  std::vector<detail::GeomFieldRow<C>> added;
  for (auto const field : fields) {
    auto const& f = detail::geom_field_row<C>(field);
    bool const known = (model.*f.member).stride > 0 ||
                       std::any_of(added.begin(), added.end(), [&](auto const& other) { return other.member == f.member; });
    if (!known) {
      added.push_back(f);
      size += std::size_t(worlds) * model.colliders * f.stride;
    }
    model.mixes_per_world |= f.mixes && !model.overridden;
  }
  if (added.empty()) return;
  auto const next = detail::allocate<Kokkos::View<R*, Mem>>("gsp::CollisionModel::world_reals", size);
  R* const out = next.data();
  detail::copy_bytes(exec, out, model.world_reals.data(), model.world_reals.extent(0) * sizeof(R));
  for (auto const& row : detail::geom_field_table<C>()) {
    auto& field = model.*row.member;
    bool const moves = detail::in_buffer(field, model.world_reals);  // once, though pos and quat share a member
    if (moves) field.data = out + (field.data - model.world_reals.data());
  }
  std::size_t at = model.world_reals.extent(0);
  for (auto const& f : added) {
    auto& field = model.*f.member;
    int const row = model.colliders * f.stride;
    detail::repeat_row(exec, field.data, out + at, row, worlds);
    field = {out + at, row};
    at += std::size_t(worlds) * row;
  }
  exec.fence("gsp::make_per_world: the old buffer may go");
  model.world_reals = next;
  model.value_worlds = worlds;
}

/// Sets a field of the geoms for the worlds of the mask, from `values` (worlds, geoms, components) or (worlds, geoms * components); geoms
/// that take part in no pair are passed over. Sizes must be those of the geom's shape. Does not allocate, does not fence.
/// @param mask  (worlds) callable with a world, such as a View<bool*>; the others keep what they have
/// Errors: std::invalid_argument where the field is not per world, or for other extents, of the mask too.
template <ExecutionSpace Exec, class R, class Mem, class Values, class Mask = AllWorlds>
void set_world_values(Exec const& exec, CollisionModel<R, Mem>& model, GeomField field, Values const& values, Mask const& mask = {}) {
  static_assert(can_access<Exec, Values>, "gsp::set_world_values: the values are not accessible from this execution space");
  if (model.colliders == 0) return;
  auto const& f = detail::own_geom_field("gsp::set_world_values", model, field, values);
  detail::expects_mask("gsp::set_world_values", mask, "values", model.value_worlds);
  auto const& own = model.*f.member;
  Kokkos::parallel_for(
      "gsp::collision::set_world_values",
      Kokkos::RangePolicy<Exec, Kokkos::IndexType<std::int64_t>>(exec, 0, std::int64_t(model.value_worlds) * model.colliders),
      detail::SetGeoms<R, Mem, Values, Mask>{model.collider_geom, const_cast<R*>(own.data), values, mask, model.colliders, f.stride,
                                             f.first, f.components});
}
/// The present values of a field, to `out` (worlds, geoms, components) or (worlds, geoms * components): copy, change what is to change, and
/// give it to set_world_values. Geoms that take part in no pair are passed over: they keep what `out` has. Does not allocate, does not
/// fence. Errors: as of set_world_values.
template <ExecutionSpace Exec, class R, class Mem, class Out>
void copy_world_values(Exec const& exec, CollisionModel<R, Mem> const& model, GeomField field, Out& out) {
  static_assert(can_access<Exec, Out>, "gsp::copy_world_values: the values are not accessible from this execution space");
  if (model.colliders == 0) return;
  auto const& f = detail::own_geom_field("gsp::copy_world_values", model, field, out);
  Kokkos::parallel_for(
      "gsp::collision::copy_world_values",
      Kokkos::RangePolicy<Exec, Kokkos::IndexType<std::int64_t>>(exec, 0, std::int64_t(model.value_worlds) * model.colliders),
      detail::CopyGeoms<R, Mem, Out>{model.collider_geom, model.*f.member, out, model.colliders, f.stride, f.first, f.components});
}

namespace detail {
/// The field of the model that holds the same; only friction and softness have none.
inline bool model_field_of(GeomField field, ModelField& same) {
  switch (field) {
    case GeomField::pos:
      same = ModelField::geom_pos;
      return true;
    case GeomField::quat:
      same = ModelField::geom_quat;
      return true;
    case GeomField::size:
      same = ModelField::geom_size;
      return true;
    case GeomField::friction:
    case GeomField::solref:
    case GeomField::solimp:
      break;
  }
  return false;
}
}  // namespace detail

/// The same for the model and its collision model at once: poses and sizes of geoms are in both (tendons wrap round geoms, fluids act on
/// them), and set together they stay the same.
template <ExecutionSpace Exec, class R, class Mem>
void make_per_world(Exec const& exec, Model<R, Mem>& model, CollisionModel<R, Mem>& collision, std::vector<GeomField> const& fields,
                    int worlds) {
  std::vector<ModelField> also;
  for (auto const field : fields)
    if (ModelField same; detail::model_field_of(field, same)) also.push_back(same);
  make_per_world(exec, collision, fields, worlds);
  make_per_world(exec, model, also, worlds);
}
template <ExecutionSpace Exec, class R, class Mem, class Values, class Mask = AllWorlds>
void set_world_values(Exec const& exec, Model<R, Mem>& model, CollisionModel<R, Mem>& collision, GeomField field, Values const& values,
                      Mask const& mask = {}) {
  set_world_values(exec, collision, field, values, mask);
  if (ModelField same; detail::model_field_of(field, same)) set_world_values(exec, model, same, values, mask);
}

}  // namespace gsp
