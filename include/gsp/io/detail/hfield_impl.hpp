#pragma once
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <gsp/core/detail/compiled.hpp>
#include <gsp/io/file.hpp>
#include <gsp/io/hfield.hpp>
#include <gsp/io/png.hpp>
#include <gsp/model/detail/mesh_compile.hpp>
#include <span>

namespace gsp::io {

namespace detail {

inline HeightFieldDescription finish_hfield(int rows, int columns, std::vector<float> elevation) {
  HeightFieldDescription field;
  field.rows = rows;
  field.columns = columns;
  field.elevation = std::move(elevation);
  gsp::detail::normalize_elevation(field.elevation);
  return field;
}

inline void expect_elevation(float e, std::string const& file, std::string const& place) {
  if (!(std::abs(e) <= 1e10f)) fail(file, place, "an elevation is not finite or beyond 1e10; correct it");
}

/// Grey pictures as they are (16 bits: the high byte, as MuJoCo has it), of colour ones the red channel; the first row lies at +y.
inline HeightFieldDescription parse_hfield_png(Bytes bytes, std::string const& file) {
  auto const picture = parse_png8(bytes, file);
  std::vector<float> elevation;
  elevation.reserve(std::size_t(picture.width) * std::size_t(picture.height));
  for (int row = picture.height - 1; row >= 0; --row)
    for (int column = 0; column < picture.width; ++column)
      elevation.push_back(
          picture.pixels[(std::size_t(row) * std::size_t(picture.width) + std::size_t(column)) * std::size_t(picture.channels)]);
  return finish_hfield(picture.height, picture.width, std::move(elevation));
}

/// int32 rows, int32 columns, float32 elevations, the row at -y first.
inline HeightFieldDescription parse_hfield_binary(Bytes bytes, std::string const& file) {
  if (bytes.size() < 8) fail(file, at_byte(bytes.size()), "is too short for the header of a height field; fetch it again");
  std::int64_t const rows = load<std::int32_t>(bytes, 0), columns = load<std::int32_t>(bytes, 4);
  if (rows < 1 || columns < 1 || rows > std::int64_t(bytes.size()) || columns > std::int64_t(bytes.size()) ||
      8 + 4 * rows * columns != std::int64_t(bytes.size()))
    fail(file, at_byte(0),
         "announces " + std::to_string(rows) + " rows of " + std::to_string(columns) +
             " elevations, for which it does not have the size; it is cut short or no height field");
  std::vector<float> elevation(static_cast<std::size_t>(rows * columns));
  std::memcpy(elevation.data(), bytes.data() + 8, 4 * elevation.size());
  for (std::size_t i = 0; i < elevation.size(); ++i) expect_elevation(elevation[i], file, at_byte(8 + 4 * i));
  return finish_hfield(int(rows), int(columns), std::move(elevation));
}

}  // namespace detail

GSP_INLINE HeightFieldDescription parse_hfield(Bytes bytes, std::string const& file, std::string const& content_type) {
  std::string kind = content_type.empty() ? std::filesystem::path(file).extension().string() : content_type;
  for (char& c : kind) c = c >= 'A' && c <= 'Z' ? static_cast<char>(c + 32) : c;
  if (!content_type.empty() && kind != "image/png" && kind != "image/vnd.mujoco.hfield")
    detail::fail(file, "", "has a content type that is not read as a height field; use image/png or image/vnd.mujoco.hfield");
  auto field = kind == ".png" || kind == "image/png" ? detail::parse_hfield_png(bytes, file) : detail::parse_hfield_binary(bytes, file);
  field.name = std::filesystem::path(file).stem().string();
  return field;
}

GSP_INLINE HeightFieldDescription read_hfield(std::filesystem::path const& path, std::string const& content_type) {
  return parse_hfield(read_file(path), path.string(), content_type);
}

GSP_INLINE HeightFieldDescription make_hfield(int rows, int columns, std::span<double const> elevation, std::string const& what) {
  if (rows < 2 || columns < 2 || std::int64_t(rows) * columns > 100'000'000)
    detail::fail(
        what, "",
        "has " + std::to_string(rows) + " rows of " + std::to_string(columns) + "; give 2 or more of each, at most 100 million together");
  std::size_t const n = std::size_t(rows) * std::size_t(columns);
  if (!elevation.empty() && elevation.size() != n)
    detail::fail(what, "",
                 "has " + std::to_string(elevation.size()) + " elevations for " + std::to_string(rows) + " rows of " +
                     std::to_string(columns) + "; give one for each");
  std::vector<float> flipped(n, 0.f);
  for (std::size_t i = 0; i < elevation.size(); ++i) {
    auto const e = static_cast<float>(elevation[i]);
    detail::expect_elevation(e, what, "elevation " + std::to_string(i));
    flipped[(std::size_t(rows) - 1 - i / std::size_t(columns)) * std::size_t(columns) + i % std::size_t(columns)] = e;
  }
  return detail::finish_hfield(rows, columns, std::move(flipped));
}

}  // namespace gsp::io
