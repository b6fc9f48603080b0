#pragma once
#include <algorithm>
#include <functional>
#include <gsp/model/model.hpp>
#include <string>
#include <vector>

/// Kernels of gsp/model/world_values.hpp, where the contract stands.
namespace gsp::detail {

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

}  // namespace gsp::detail
