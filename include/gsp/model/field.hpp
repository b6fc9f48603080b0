#pragma once
#include <Kokkos_Core.hpp>
#include <cstdint>

namespace gsp {

/// One model constant: `stride` 0 means one value for all worlds, else each world has its own row. Layout (world, item, component).
template <class R>
struct Field {
  R const* data = nullptr;
  int stride = 0;
  KOKKOS_INLINE_FUNCTION R const* row(int world) const { return data + std::int64_t(world) * stride; }
  KOKKOS_INLINE_FUNCTION R operator()(int world, int i) const { return row(world)[i]; }
};

}  // namespace gsp
