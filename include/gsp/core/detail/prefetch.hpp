#pragma once
#include <Kokkos_Core.hpp>

namespace gsp::detail {

/// On a host: the line that `at` lies in is on its way into the cache, and the program goes on.
KOKKOS_INLINE_FUNCTION void prefetch([[maybe_unused]] void const* at) { KOKKOS_IF_ON_HOST((__builtin_prefetch(at);)) }

}  // namespace gsp::detail
