#pragma once
#include <Kokkos_Core.hpp>
#include <cstddef>

namespace gsp::detail {

/// On a host: the lines that these bytes lie in are on their way into the cache, and the program goes on.
KOKKOS_INLINE_FUNCTION void prefetch([[maybe_unused]] void const* at, [[maybe_unused]] std::size_t bytes = 1) {
  KOKKOS_IF_ON_HOST((for (std::size_t i = 0; i < bytes; i += 64) __builtin_prefetch(static_cast<char const*>(at) + i);))
}

}  // namespace gsp::detail
