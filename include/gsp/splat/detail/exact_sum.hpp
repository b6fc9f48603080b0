#pragma once
#include <Kokkos_Core.hpp>
#include <cstdint>

/// Sums that hang on no order, so that whole pictures add to a Gaussian's numbers by atomics and the same bits come from any number of
/// threads, any batch: of multiples of 2^-30, in 64 bits. A term is rounded once, by 5e-10; a sum holds 8e9.
namespace gsp::detail {

KOKKOS_INLINE_FUNCTION std::int64_t to_exact(float x) {
  constexpr float unit = 1073741824.f, most = 4.6e18f;  // 2^30; below 2^62
  float const scaled = x * unit;
  if (!(scaled < most)) return static_cast<std::int64_t>(most);
  return scaled > -most ? static_cast<std::int64_t>(Kokkos::nearbyint(scaled)) : -static_cast<std::int64_t>(most);
}
KOKKOS_INLINE_FUNCTION double from_exact(std::int64_t sum) { return static_cast<double>(sum) * 0x1p-30; }

}  // namespace gsp::detail
