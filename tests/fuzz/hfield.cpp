// Height fields: the bytes as a binary file and as a PNG; and as the sizes and elevations of a binary file that has the size it says.
#include <gsp/io/hfield.hpp>

#include "target.hpp"

namespace {
void check(gsp::HeightFieldDescription const& field) {
  gsp_fuzz::require(field.rows > 0 && field.columns > 0 && field.elevation.size() == std::size_t(field.rows) * std::size_t(field.columns));
  for (float e : field.elevation) gsp_fuzz::require(e >= 0 && e <= 1);
}
}  // namespace

extern "C" int LLVMFuzzerTestOneInput(std::uint8_t const* data, std::size_t size) {
  using namespace gsp::io;
  auto const input = std::as_bytes(std::span(data, size));
  gsp_fuzz::survive([&] { check(parse_hfield(input, "fuzz.bin")); });
  gsp_fuzz::survive([&] { check(parse_hfield(input, "fuzz.png")); });
  if (size < 6) return 0;
  std::vector<std::byte> sized(8);
  std::int32_t const columns = data[0] % 7 + 1, rows = std::int32_t((size - 1) / 4 / std::size_t(columns));
  std::memcpy(sized.data(), &rows, 4), std::memcpy(sized.data() + 4, &columns, 4);
  sized.insert(sized.end(), input.begin() + 1, input.begin() + 1 + 4 * rows * columns);
  gsp_fuzz::survive([&] { check(parse_hfield(sized, "fuzz.bin")); });
  return 0;
}
