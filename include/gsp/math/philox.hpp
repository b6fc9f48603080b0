#pragma once
#include <cstdint>
#include <gsp/math/scalar.hpp>

/// Random numbers that have no state: Philox4x32-10 (Salmon, Moraes, Dror and Shaw, Parallel random numbers: as easy as 1, 2, 3, SC 2011)
/// makes four numbers of a key and a counter. The counter says what they are for, world, step, ray, so the same come wherever and in
/// whatever order they are asked for, on every backend. No Kokkos.
namespace gsp {

/// Four 32-bit numbers.
struct Philox {
  std::uint32_t word[4];
};

/// Of a seed and a counter of four numbers. Cost about 60 integer operations.
GSP_FUNCTION Philox philox(std::uint64_t seed, Philox counter) {
  std::uint32_t key0 = std::uint32_t(seed), key1 = std::uint32_t(seed >> 32);
  std::uint32_t(&c)[4] = counter.word;
  for (int round = 0; round < 10; ++round) {
    std::uint64_t const a = std::uint64_t(0xD2511F53u) * c[0], b = std::uint64_t(0xCD9E8D57u) * c[2];
    std::uint32_t const next[4] = {std::uint32_t(b >> 32) ^ c[1] ^ key0, std::uint32_t(b), std::uint32_t(a >> 32) ^ c[3] ^ key1,
                                   std::uint32_t(a)};
    for (int k = 0; k < 4; ++k) c[k] = next[k];
    key0 += 0x9E3779B9u;
    key1 += 0xBB67AE85u;
  }
  return counter;
}
/// Uniform in (0, 1): never 0, never 1; by the 23 upper bits.
template <class T = float>
GSP_FUNCTION T uniform_of(std::uint32_t word) {
  return (T(word >> 9) + T(0.5)) * T(1.0 / 8388608);
}
/// Two numbers by which a point is spread about 0 in the plane: its distance r (Rayleigh) and its angle [rad]; r cos and r sin of it are
/// independent and normal, of mean 0 and deviation 1 (Box and Muller, A note on the generation of random normal deviates, 1958). Of so many
/// bits r is 5.8 at most; a normal number beyond it comes once in 10^8.
template <class T>
struct Spread {
  T r, angle;
  /// Of two uniform numbers.
  GSP_FUNCTION static Spread of_uniform(T const& a, T const& b) {
    constexpr real_t<T> turn = real_t<T>(6.28318530717958647693);
    return {sqrt(T(-2) * log(a)), T(turn) * b};
  }
  GSP_FUNCTION static Spread of(std::uint32_t word, std::uint32_t other) { return of_uniform(uniform_of<T>(word), uniform_of<T>(other)); }
  /// A normal number.
  GSP_FUNCTION T normal() const { return r * cos(angle); }
};

}  // namespace gsp
