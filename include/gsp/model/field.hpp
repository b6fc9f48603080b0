#pragma once
#include <Kokkos_Core.hpp>
#include <cstdint>
#include <gsp/core/check.hpp>
#include <string>

namespace gsp {

/// One model constant: `stride` 0 means one value for all worlds, else each world has its own row. Layout (world, item, component).
template <class R>
struct Field {
  R const* data = nullptr;
  int stride = 0;
  KOKKOS_INLINE_FUNCTION R const* row(int world) const { return data + std::int64_t(world) * stride; }
  KOKKOS_INLINE_FUNCTION R operator()(int world, int i) const { return row(world)[i]; }
};

namespace detail {
/// All fields that are per world have rows for the same worlds. A field cannot be given more: copies of the model may read the rows.
template <class Model>
void expects_as_many_worlds(Model const& model, int worlds) {
  if (model.value_worlds == 0 || model.value_worlds == worlds) return;
  std::string const there = std::to_string(model.value_worlds), asked = std::to_string(worlds);
  throw std::invalid_argument("gsp::make_per_world: other fields are per world already, for " + there + " worlds and not " + asked +
                              ": give " + there + ", or make the model anew (of geoms: the collision model) and call make_per_world with " +
                              asked);
}
/// The fields of a Model or CollisionModel that are per world have a row for each of `worlds` worlds.
template <class Model>
void expects_values(char const* where, Model const& model, int worlds) {
  if (model.value_worlds > 0 && model.value_worlds < worlds)
    throw std::invalid_argument(std::string(where) + ": the model has values for " + std::to_string(model.value_worlds) + " worlds, and " +
                                std::to_string(worlds) +
                                " are asked for: make the model anew (of geoms: the collision model), and call make_per_world with " +
                                std::to_string(worlds) + " worlds");
}
/// A Model or CollisionModel whose fields that are per world begin with this world's rows, and end with `count` worlds. Errors:
/// std::invalid_argument for worlds that have none.
/// @param table  of its fields (field_table, geom_field_table); several of its rows may name one member
template <class Model, class Table>
Model with_rows_from(Model const& model, Table const& table, int first, int count) {
  expects(first >= 0 && count >= 0, "gsp::of_worlds: worlds begin with 0");
  expects_values("gsp::of_worlds", model, first + count);
  Model part = model;
  for (auto const& row : table) (part.*row.member).data = (model.*row.member).row(first);
  if (model.value_worlds > 0) part.value_worlds = count;
  return part;
}
}  // namespace detail

}  // namespace gsp
