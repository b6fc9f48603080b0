#pragma once
#include <array>
#include <cctype>
#include <cmath>
#include <filesystem>
#include <gsp/io/detail/decimal.hpp>
#include <gsp/io/file.hpp>
#include <gsp/io/npy.hpp>
#include <gsp/ray/ray_pattern.hpp>
#include <numbers>
#include <string>
#include <string_view>

/// Patterns of rays from files: what makers of LiDAR units publish, and what was measured (docs/io/ray_table.md).
namespace gsp::io {

struct RayTableOptions {
  double rate = 0;  // [rays/s] of a NPY file, which has no times: ray k leaves at k / rate; 0: all at once
};

namespace detail {

/// Lines of a text with their numbers, from 1 on, without what ends them and blanks around them. The last line has its end too.
template <class F>
void for_lines(std::string_view text, std::string const& name, F const& f) {
  std::size_t number = 1;
  for (; !text.empty(); ++number) {
    auto const end = text.find('\n');
    if (end == text.npos) fail(name, at_line(number), "has no line end, so the file may be cut short; fetch it again, or end the line");
    auto line = text.substr(0, end);
    text.remove_prefix(end + 1);
    while (!line.empty() && std::isspace(static_cast<unsigned char>(line.back()))) line.remove_suffix(1);
    while (!line.empty() && std::isspace(static_cast<unsigned char>(line.front()))) line.remove_prefix(1);
    if (!line.empty()) f(number, line);
  }
}

/// A table of time, azimuth and zenith, line by line.
class RayCsv {
 public:
  explicit RayCsv(std::string const& name) : name_(name) {}
  void line(std::size_t number, std::string_view text) {
    auto const words = split(number, text);
    if (!begun_ && !decimal(words[0])) {
      begun_ = true;
      expect_names(number, words);
      return;
    }
    begun_ = true;
    double const time = value(number, words[0], "time", 0, 1e6, "seconds, from 0 to 1e6"),
                 azimuth = value(number, words[1], "azimuth", -360, 360, "degrees, from -360 to 360"),
                 zenith = value(number, words[2], "zenith", 0, 180, "degrees from straight up, from 0 to 180");
    auto& times = pattern_.time;
    if (!times.empty() && time < times.back())
      fail(name_, at_line(number), "time " + in_quotes(words[0]) + " is before that of the row above; sort the rows by time");
    if (times.size() == std::size_t(most_rays)) fail(name_, at_line(number), "there are more than 16,777,216 rays; split the file");
    moments_ += times.empty() || time > times.back();
    times.push_back(time);
    constexpr double radians = std::numbers::pi / 180;
    pattern_.direction.push_back(ray_direction(azimuth * radians, (90 - zenith) * radians));
  }
  RayPattern take() {
    auto& times = pattern_.time;
    if (times.empty()) fail(name_, "", "holds no rays; each row has time, azimuth and zenith");
    double const first = times.front(), length = times.back() - first;
    for (double& time : times) time -= first;
    pattern_.period = moments_ > 1 ? length * moments_ / (moments_ - 1) : 0;
    if (moments_ == 1) times.clear();
    return std::move(pattern_);
  }

 private:
  std::array<std::string_view, 3> split(std::size_t number, std::string_view line) const {
    std::array<std::string_view, 3> words;
    std::size_t count = 0;
    for (bool more = true; more; ++count) {
      auto const comma = line.find(',');
      more = comma != line.npos;
      auto word = line.substr(0, comma);
      while (!word.empty() && word.back() == ' ') word.remove_suffix(1);
      while (!word.empty() && word.front() == ' ') word.remove_prefix(1);
      if (count < 3) words[count] = word;
      line.remove_prefix(more ? comma + 1 : 0);
    }
    if (count != 3)
      fail(name_, at_line(number),
           "has " + std::to_string(count) + " columns; give three: time [s], azimuth [degrees], zenith [degrees], with commas between");
    return words;
  }
  void expect_names(std::size_t number, std::array<std::string_view, 3> const& words) const {
    char const* const names[] = {"time", "azimuth", "zenith"};
    for (std::size_t c = 0; c < 3; ++c) {
      std::string lower;
      for (char const letter : words[c]) lower += char(std::tolower(static_cast<unsigned char>(letter)));
      if (lower.find(names[c]) == lower.npos)
        fail(name_, at_line(number),
             "column " + std::to_string(c + 1) + " is called " + in_quotes(words[c]) + ", expected " + names[c] +
                 "; put the columns in the order time, azimuth, zenith");
    }
  }
  double value(std::size_t number, std::string_view word, char const* what, double low, double high, char const* wanted) const {
    auto const got = decimal(word);
    if (!got) fail(name_, at_line(number), std::string(what) + " " + in_quotes(word) + " is not a number; repair the row");
    if (!(*got >= low && *got <= high))
      fail(name_, at_line(number), std::string(what) + " " + in_quotes(word) + " is out of range; give " + wanted);
    return *got;
  }

  std::string const& name_;
  RayPattern pattern_;
  double moments_ = 0;  // different times
  bool begun_ = false;
};

}  // namespace detail

/// A pattern from a table as Livox publishes them: rows of time [s], azimuth [degrees, from ahead to the left] and zenith [degrees from
/// straight up], with commas between, and a line of their names or none. The first ray leaves at 0; a scan takes one mean step of time more
/// than from the first to the last. Rows of one time all leave at once. Throws Error("FILE: line N: what is wrong; remedy") for other
/// columns, what is no number, NaN, infinite or out of range, times that fall, no rows, and a last line without an end, which may be cut
/// short.
inline RayPattern parse_ray_csv(Bytes bytes, std::string const& name) {
  detail::RayCsv table(name);
  detail::for_lines(detail::as_text(bytes), name, [&](std::size_t number, std::string_view line) { table.line(number, line); });
  return table.take();
}
/// A pattern from a NPY array (N, 2) of float32 or float64: azimuth from ahead to the left and elevation upward [rad]. Throws
/// Error("FILE: row N: what is wrong; remedy") for another shape or type, no rows, and angles that are not finite or out of range;
/// std::invalid_argument for a rate that is negative or not finite.
inline RayPattern parse_ray_npy(Bytes bytes, std::string const& name, RayTableOptions options = {}) {
  expects(std::isfinite(options.rate) && options.rate >= 0, "gsp::io::parse_ray_npy: the rate must be finite and not negative");
  auto const array = parse_npy(bytes, name);
  if (array.dtype != Dtype::f4 && array.dtype != Dtype::f8)
    detail::fail(name, "", "holds integers; save azimuth and elevation in radians as float32 or float64");
  expect_shape(array, {-1, 2}, name);
  std::size_t const rows = array.shape[0];
  if (rows == 0) detail::fail(name, "", "holds no rays; each row has azimuth and elevation");
  if (rows > std::size_t(most_rays)) detail::fail(name, "", "there are more than 16,777,216 rays; split the file");
  auto const angles = array.as<double>(name);
  RayPattern pattern;
  for (std::size_t k = 0; k < rows; ++k) {
    double const azimuth = angles[2 * k], elevation = angles[2 * k + 1];
    // float32 rounds pi beyond itself
    bool const ok = std::abs(azimuth) <= 2 * std::numbers::pi + 1e-6 && std::abs(elevation) <= 0.5 * std::numbers::pi + 1e-6;
    if (!ok)
      detail::fail(name, "row " + std::to_string(k),
                   "(" + std::to_string(azimuth) + ", " + std::to_string(elevation) +
                       ") is no azimuth and elevation in radians, within 2 pi and pi / 2; convert the angles");
    pattern.direction.push_back(ray_direction(azimuth, elevation));
    if (options.rate > 0) pattern.time.push_back(double(k) / options.rate);
  }
  pattern.period = options.rate > 0 ? double(rows) / options.rate : 0;
  return pattern;
}
/// By the ending: .csv or .npy. Throws Error where the file cannot be read, and for another ending.
inline RayPattern read_ray_table(std::filesystem::path const& path, RayTableOptions options = {}) {
  auto const ending = path.extension();
  if (ending == ".npy") return parse_ray_npy(read_file(path), path.string(), options);
  if (ending != ".csv") detail::fail(path.string(), "", "tables of rays end in .csv (time, azimuth, zenith) or .npy (azimuth, elevation)");
  return parse_ray_csv(read_file(path), path.string());
}

}  // namespace gsp::io
