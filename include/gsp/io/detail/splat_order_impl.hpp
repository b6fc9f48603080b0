#pragma once
#include <array>
#include <gsp/core/detail/compiled.hpp>
#include <gsp/core/detail/spread_bits.hpp>
#include <gsp/io/splat_order.hpp>
#include <utility>

namespace gsp::io {

GSP_INLINE void sort_splats(SplatSet& set) {
  validate(set, "gsp::io::sort_splats");
  std::size_t const n = set.size();
  std::array<double, 3> low, high;
  for (std::size_t k = 0; k < 3; ++k) low[k] = high[k] = set.positions[k];
  for (std::size_t i = 0; i < n; ++i)
    for (std::size_t k = 0; k < 3; ++k) {
      low[k] = std::min(low[k], double(set.positions[3 * i + k]));
      high[k] = std::max(high[k], double(set.positions[3 * i + k]));
    }
  std::vector<std::pair<std::uint64_t, std::size_t>> order(n);
  for (std::size_t i = 0; i < n; ++i) {
    std::uint64_t code = 0;
    for (std::size_t k = 0; k < 3; ++k) {
      double const t = high[k] > low[k] ? (set.positions[3 * i + k] - low[k]) / (high[k] - low[k]) : 0;
      code |= gsp::detail::spread_bits(static_cast<std::uint64_t>(t * 0x1fffff)) << k;
    }
    order[i] = {code, i};
  }
  std::sort(order.begin(), order.end());
  auto const permute = [&](auto& values, std::size_t width) {
    auto const old = std::move(values);
    values.resize(n * width);
    for (std::size_t i = 0; i < n; ++i) std::copy_n(&old[order[i].second * width], width, &values[i * width]);
  };
  permute(set.positions, 3);
  permute(set.quats, 4);
  permute(set.scales, 3);
  permute(set.opacities, 1);
  permute(set.sh, 3 * set.sh_terms());
  permute(set.link, 1);
}

}  // namespace gsp::io
