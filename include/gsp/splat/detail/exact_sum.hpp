#pragma once
#include <Kokkos_Core.hpp>
#include <cstdint>
#include <gsp/core/detail/views.hpp>

/// Sums that hang on no order, so that whole pictures add to a Gaussian's numbers by atomics and the same bits come from any number of
/// threads, any batch: of multiples of 2^-30. A term is rounded once, by 5e-10, and counts as 4.2e9 at most.
namespace gsp::detail {

/// Of NaN it is 0.
KOKKOS_INLINE_FUNCTION std::int64_t to_exact(float x) {
  constexpr float unit = 1073741824.f, most = 4.6e18f;  // 2^30; below 2^62
  float const scaled = x * unit;
  if (!(scaled < most)) return scaled >= most ? static_cast<std::int64_t>(most) : 0;
  return scaled > -most ? static_cast<std::int64_t>(Kokkos::nearbyint(scaled)) : -static_cast<std::int64_t>(most);
}
KOKKOS_INLINE_FUNCTION double from_exact(std::int64_t sum) { return static_cast<double>(sum) * 0x1p-30; }

/// Sums that do not wrap, of fewer than 2^32 terms: each is low + 2^32 high, and few terms are so large (2) that they add to both.
template <class Mem>
struct ExactSums {
  using View = Kokkos::View<std::int64_t*, Kokkos::LayoutRight, Mem>;
  View low;   // (n)
  View high;  // (n + 1), the last: how many terms were not finite

  KOKKOS_INLINE_FUNCTION void add(std::int64_t i, float x) const {
    std::int64_t const term = to_exact(x), upper = (term + (std::int64_t(1) << 31)) >> 32;
    Kokkos::atomic_add(&low(i), term - upper * (std::int64_t(1) << 32));
    if (upper != 0) Kokkos::atomic_add(&high(i), upper);
    if (!Kokkos::isfinite(x)) Kokkos::atomic_add(&high(std::int64_t(low.extent(0))), std::int64_t(1));
  }
};

/// What is beyond 8.5e9 stays there.
KOKKOS_INLINE_FUNCTION std::int64_t saturated(std::int64_t low, std::int64_t high) {
  constexpr std::int64_t most = 9200000000000000000;  // below 2^63
  double const about = static_cast<double>(low) + 0x1p32 * static_cast<double>(high);
  if (about >= double(most)) return most;
  return about > -double(most) ? static_cast<std::int64_t>(std::uint64_t(low) + (std::uint64_t(high) << 32)) : -most;
}
template <class Mem>
struct SettleSums {
  ExactSums<Mem> sums;
  KOKKOS_FUNCTION void operator()(std::int64_t i) const { sums.low(i) = saturated(sums.low(i), sums.high(i)); }
};
template <class Exec, class Mem>
void zero(Exec const& exec, ExactSums<Mem> const& sums) {
  zero(exec, sums.low);
  zero(exec, sums.high);
}
/// Makes `low` the sums. Returns whether all terms were finite. Waits.
template <class Exec, class Mem>
bool settle(Exec const& exec, ExactSums<Mem> const& sums) {
  std::size_t const n = sums.low.extent(0);
  Kokkos::parallel_for("gsp::splat::settle_sums",
                       lightweight(Kokkos::RangePolicy<Exec, Kokkos::IndexType<std::int64_t>>(exec, 0, std::int64_t(n))),
                       SettleSums<Mem>{sums});
  std::int64_t unfit = 0;
  download_bytes(exec, &unfit, sums.high.data() + n, sizeof unfit);
  exec.fence("gsp::splat::settle_sums: the host reads");
  return unfit == 0;
}
template <class Exec, class Mem>
void make_sums(Exec const& exec, ExactSums<Mem>& sums, std::string const& label, std::int64_t n) {
  using View = typename ExactSums<Mem>::View;
  sums.low = allocate_zero<View>(exec, label, n);
  sums.high = allocate_zero<View>(exec, label + "_high", n + 1);
}

}  // namespace gsp::detail
