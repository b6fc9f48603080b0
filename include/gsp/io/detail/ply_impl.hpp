#pragma once
#include <gsp/core/detail/compiled.hpp>
#include <gsp/io/compressed_ply.hpp>
#include <gsp/io/detail/splat_bounds.hpp>
#include <gsp/io/file.hpp>
#include <gsp/io/ply.hpp>

namespace gsp::io {

namespace detail {

/// The layout of the 3DGS authors: x y z, [nx ny nz], f_dc_0..2, f_rest_* channel-major, opacity as logit, scale as logarithm, rot_0..3 = w
/// x y z of any length.
inline SplatSet parse_gaussian_ply(PlyTable const& table) {
  static char const* const what = "3DGS PLY";
  std::string const& name = table.name;
  PlyElement const& vertex = *table.find("vertex");
  std::size_t rest = 0;
  for (auto const& p : vertex.properties) rest += p.name.starts_with("f_rest_");
  int const degree = sh_degree_of(rest, name, vertex.line);

  std::vector<std::string> labels{"x",     "y",     "z",     "scale_0", "scale_1", "scale_2", "rot_0",
                                  "rot_1", "rot_2", "rot_3", "opacity", "f_dc_0",  "f_dc_1",  "f_dc_2"};
  for (std::size_t k = 0; k < rest; ++k) labels.push_back("f_rest_" + std::to_string(k));
  std::vector<PlyColumn> columns;
  for (auto const& label : labels) columns.push_back(table.column(vertex, label, what));

  SplatSet set = make_splat_set(vertex.count, degree);
  std::size_t const terms = set.sh_terms();
  std::vector<float> row(labels.size());
  for (std::size_t i = 0; i < set.size(); ++i) {
    for (std::size_t k = 0; k < row.size(); ++k) {
      row[k] = static_cast<float>(columns[k](i));
      if (!std::isfinite(row[k]))
        fail(name, "Gaussian " + std::to_string(i),
             "property '" + labels[k] + "' is not finite (" + std::to_string(row[k]) + "); repair or export the file again");
    }
    for (std::size_t k = 0; k < 3; ++k) {
      set.positions[3 * i + k] = row[k];
      set.scales[3 * i + k] = static_cast<float>(std::exp(double(row[3 + k])));
      set.sh[3 * terms * i + k] = row[11 + k];
    }
    for (std::size_t k = 0; k < 4; ++k) set.quats[4 * i + k] = row[6 + k];
    set.opacities[i] = sigmoid(row[10]);
    for (std::size_t k = 0; k < rest; ++k) set.sh[(i * terms + 1 + k % (terms - 1)) * 3 + k / (terms - 1)] = row[14 + k];
  }
  read_ply_links(table, vertex, set);
  read_ply_mode(table, set);
  note_unused(table, vertex, set, [&](std::string_view p) {
    return p == "link" || p == "nx" || p == "ny" || p == "nz" || std::find(labels.begin(), labels.end(), p) != labels.end();
  });
  finish(set, name);
  return set;
}

}  // namespace detail

GSP_INLINE SplatSet parse_ply(Bytes bytes, std::string const& name) {
  auto const table = detail::parse_ply_table(bytes, name);
  auto const* vertex = table.find("vertex");
  if (!vertex) detail::fail(name, detail::at_line(1), "has no element 'vertex'; this is not a PLY of Gaussians");
  return table.find(*vertex, "packed_position") ? detail::parse_compressed_ply(table) : detail::parse_gaussian_ply(table);
}

GSP_INLINE SplatSet read_ply(std::filesystem::path const& path) { return parse_ply(read_file(path), path.string()); }

GSP_INLINE std::vector<std::byte> format_ply(SplatSet const& set) {
  validate(set, "gsp::io::format_ply");
  std::size_t const n = set.size(), terms = set.sh_terms(), rest = 3 * (terms - 1);
  bool const links = !set.link_names.empty();
  std::string header = "ply\nformat binary_little_endian 1.0\n" + detail::ply_comments(set);
  header += "element vertex " + std::to_string(n) + "\n";
  auto property = [&](std::string const& label) { header += "property float " + label + "\n"; };
  for (char const* label : {"x", "y", "z", "nx", "ny", "nz", "f_dc_0", "f_dc_1", "f_dc_2"}) property(label);
  for (std::size_t k = 0; k < rest; ++k) property("f_rest_" + std::to_string(k));
  for (char const* label : {"opacity", "scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"}) property(label);
  if (links) header += "property int link\n";
  header += "end_header\n";

  std::size_t const floats = 17 + rest, stride = 4 * floats + (links ? 4 : 0);
  std::vector<std::byte> bytes(header.size() + n * stride);
  std::memcpy(bytes.data(), header.data(), header.size());
  std::vector<float> row(floats);
  for (std::size_t i = 0; i < n; ++i) {
    float* out = row.data();
    out = std::copy_n(&set.positions[3 * i], 3, out);
    out = std::fill_n(out, 3, 0.f);
    out = std::copy_n(&set.sh[3 * terms * i], 3, out);
    for (std::size_t k = 0; k < rest; ++k) *out++ = set.sh[(i * terms + 1 + k % (terms - 1)) * 3 + k / (terms - 1)];
    double const o = set.opacities[i];
    *out++ = static_cast<float>(std::clamp(std::log(o) - std::log1p(-o), -104.0, 20.0));
    for (std::size_t k = 0; k < 3; ++k)
      *out++ = static_cast<float>(std::log(std::max(double(set.scales[3 * i + k]), detail::ply_least_scale)));
    std::copy_n(&set.quats[4 * i], 4, out);
    std::byte* const to = bytes.data() + header.size() + i * stride;
    std::memcpy(to, row.data(), 4 * floats);
    if (links) std::memcpy(to + 4 * floats, &set.link[i], 4);
  }
  return bytes;
}

GSP_INLINE void write_ply(std::filesystem::path const& path, SplatSet const& set) { write_file(path, format_ply(set)); }

}  // namespace gsp::io
