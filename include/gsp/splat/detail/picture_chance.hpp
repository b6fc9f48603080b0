#pragma once
#include <Kokkos_Core.hpp>
#include <gsp/math/philox.hpp>
#include <stdexcept>
#include <string>

/// What the random numbers of pictures are drawn of, for gsp/splat/develop.hpp and jitter_cameras.hpp.
namespace gsp::detail {

/// Streams that no noise of rays or sensors has: the first two are develop's, the others jitter_cameras'.
enum class PictureStream : std::uint32_t { light = 16, noise, position, rotation, intrinsics };

/// Of what `name` is called.
inline void expects_rows(char const* where, char const* name, std::int64_t rows, int images) {
  if (rows != images)
    throw std::invalid_argument(std::string(where) + ": " + name + " has " + std::to_string(rows) + " rows for " + std::to_string(images) +
                                " images: give each a seed, a step and a number");
}

/// Of each image a seed, a step and a number: those of `rows`, or, where there are none, one seed and step, and numbers in a row.
template <class Mem>
struct PictureChance {
  Kokkos::View<std::int64_t const* [3], Kokkos::LayoutRight, Mem> rows;
  std::uint64_t seed = 0;
  std::int64_t step = 0, first_image = 0;

  template <class Options>
  static PictureChance of(Options const& o, Kokkos::View<std::int64_t const* [3], Kokkos::LayoutRight, Mem> const& rows) {
    return {rows, o.seed, o.step, o.first_image};
  }
  KOKKOS_FUNCTION Philox words(int image, std::uint32_t pixel, PictureStream stream) const {
    bool const own = rows.data() != nullptr;
    std::uint64_t const key = own ? std::uint64_t(rows(image, 0)) : seed, time = std::uint64_t(own ? rows(image, 1) : step);
    // 24 bits of the upper half of the step, and the stream
    return philox(key, {{pixel, std::uint32_t(own ? rows(image, 2) : first_image + image), std::uint32_t(time),
                         std::uint32_t(time >> 32) << 8 | std::uint32_t(stream)}});
  }
};

}  // namespace gsp::detail
