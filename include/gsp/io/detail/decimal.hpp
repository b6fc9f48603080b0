#pragma once
#include <algorithm>
#include <charconv>
#include <limits>
#include <optional>
#include <string_view>

namespace gsp::io::detail {

/// `word` as a number, with or without a sign, in any locale: infinity of its sign where it is too large for a double, 0 where it is too
/// small; empty where it is no number. std::from_chars leaves both out, and its value at what it was.
inline std::optional<double> decimal(std::string_view word) {
  if (!word.empty() && word[0] == '+') {
    word.remove_prefix(1);
    if (!word.empty() && word[0] == '-') return std::nullopt;
  }
  double value = 0;
  char const* const last = word.data() + word.size();
  auto const [end, error] = std::from_chars(word.data(), last, value);
  if (word.empty() || end != last || error == std::errc::invalid_argument) return std::nullopt;
  if (error != std::errc::result_out_of_range) return value;

  // 0.d1 d2 .. 10^power, d1 not 0: far from 1 to one side, so that the sign of `power` says to which
  bool const negative = word[0] == '-';
  auto const mantissa = word.substr(negative, word.find_first_of("eE") - negative);
  auto const point = std::min(mantissa.find('.'), mantissa.size());
  auto const first = mantissa.find_first_of("123456789");
  if (first == mantissa.npos) return value;  // 0e999
  long long power = static_cast<long long>(point) - static_cast<long long>(first) + (first > point);
  if (auto const e = word.find_first_of("eE"); e != word.npos) {
    auto exponent = word.substr(e + 1);
    bool const down = exponent[0] == '-';
    if (down || exponent[0] == '+') exponent.remove_prefix(1);
    long long size = 0;
    for (char const c : exponent) size = std::min(10 * size + (c - '0'), 1'000'000'000'000'000LL);
    power += down ? -size : size;
  }
  value = power > 0 ? std::numeric_limits<double>::infinity() : 0.;
  return negative ? -value : value;
}

}  // namespace gsp::io::detail
