#pragma once
#include <Kokkos_Core.hpp>
#include <cstddef>
#include <cstdint>

namespace gsp::detail {

/// On a host: the lines that these bytes lie in are on their way into the cache, and the program goes on.
KOKKOS_INLINE_FUNCTION void prefetch([[maybe_unused]] void const* at, [[maybe_unused]] std::size_t bytes) {
  KOKKOS_IF_ON_HOST((auto const begin = reinterpret_cast<std::uintptr_t>(at);
                     for (std::uintptr_t line = begin & ~std::uintptr_t(63); line < begin + bytes; line += 64)
                         __builtin_prefetch(reinterpret_cast<void const*>(line));))
}

}  // namespace gsp::detail
