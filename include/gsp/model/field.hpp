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
/// The fields of a Model or CollisionModel that are per world have a row for each of `worlds` worlds.
template <class Model>
void expects_values(char const* where, Model const& model, int worlds) {
  if (model.value_worlds > 0 && model.value_worlds < worlds)
    throw std::invalid_argument(std::string(where) + ": the model has values for " + std::to_string(model.value_worlds) + " worlds, and " +
                                std::to_string(worlds) + " are asked for: call make_per_world for as many worlds as there are");
}
}  // namespace detail

}  // namespace gsp
