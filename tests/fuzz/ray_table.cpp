// Tables of rays, as CSV and as NPY.
#include <gsp/io/ray_table.hpp>

#include "target.hpp"

namespace {
void check(gsp::RayPattern const& pattern) {
  gsp_fuzz::require(!pattern.direction.empty() && (pattern.time.empty() || pattern.time.size() == pattern.direction.size()));
  for (auto const& d : pattern.direction) gsp_fuzz::require(std::abs(std::hypot(d[0], d[1], d[2]) - 1) < 1e-12);
  double before = 0;
  for (double const time : pattern.time) {
    gsp_fuzz::require(time >= before && time < pattern.period);
    before = time;
  }
}
}  // namespace

extern "C" int LLVMFuzzerTestOneInput(std::uint8_t const* data, std::size_t size) {
  auto const input = std::as_bytes(std::span(data, size));
  gsp_fuzz::survive([&] { check(gsp::io::parse_ray_csv(input, "fuzz.csv")); });
  gsp_fuzz::survive([&] { check(gsp::io::parse_ray_npy(input, "fuzz.npy", {.rate = 1000})); });
  return 0;
}
