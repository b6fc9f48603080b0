// npy
#include <gsp/io/npy.hpp>

#include "target.hpp"

extern "C" int LLVMFuzzerTestOneInput(std::uint8_t const* data, std::size_t size) {
  gsp_fuzz::survive([&] {
    auto const array = gsp::io::parse_npy(std::as_bytes(std::span(data, size)), "fuzz.npy");
    std::size_t n = 1;
    for (std::size_t k : array.shape) n *= k;
    gsp_fuzz::require(n == array.size() && array.as<double>().size() == n);
    gsp_fuzz::survive([&] { (void)array.as<int>(); });
    gsp_fuzz::survive([&] { (void)array.as<std::uint8_t>(); });
    gsp_fuzz::survive([&] { gsp::io::expect_finite(array, "fuzz.npy"); });
  });
  return 0;
}
