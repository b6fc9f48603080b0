#pragma once
#include <gsp/io/detail/ply_table.hpp>
#include <gsp/io/splat_set.hpp>

namespace gsp::io::detail {

/// The optional binding of Gaussians to links: an integer property `link` (-1: static) and header lines `comment link 3 FL_foot`.
inline void read_ply_links(PlyTable const& table, PlyElement const& vertex, SplatSet& set) {
  for (auto const& [text, line] : table.comments) {
    auto const w = words(text);
    if (w.size() < 2 || w[0] != "link") continue;
    int index = -1;
    auto const [end, error] = std::from_chars(w[1].data(), w[1].data() + w[1].size(), index);
    if (error != std::errc{} || end != w[1].data() + w[1].size()) continue;  // a sentence that happens to start with "link"
    if (index < 0 || index > 65535 || w.size() < 3)
      fail(table.name, at_line(line),
           in_quotes("comment " + text) + " is not 'comment link INDEX NAME' with an index in 0..65535; repair the header");
    std::string_view const label(w[2].data(), static_cast<std::size_t>(w.back().data() + w.back().size() - w[2].data()));
    if (set.link_names.size() <= static_cast<std::size_t>(index)) set.link_names.resize(index + 1);
    if (!set.link_names[index].empty())
      fail(table.name, at_line(line), "link " + std::to_string(index) + " is named twice; repair the header");
    set.link_names[index] = label;
  }
  PlyProperty const* property = table.find(vertex, "link");
  if (!property) return;
  if (property->type == PlyType::f32 || property->type == PlyType::f64)
    fail(table.name, at_line(property->line), "property 'link' must be an integer type; write 'property int link'");
  auto const column = table.column(vertex, *property);
  auto const last = static_cast<long long>(set.link_names.size()) - 1;
  for (std::size_t i = 0; i < set.size(); ++i) {
    set.link[i] = static_cast<int>(as_integer(column(i), -1, std::max(last, 65535LL), table.name, i, "property 'link'"));
    if (set.link[i] >= 0 && (set.link[i] > last || set.link_names[set.link[i]].empty()))
      fail(table.name, "row " + std::to_string(i),
           "link " + std::to_string(set.link[i]) + " has no name; add the header line 'comment link " + std::to_string(set.link[i]) +
               " NAME'");
  }
}

/// Header lines by which files say that they were trained antialiased: `comment SplatRenderMode: mip` (Brush), `comment antialiased 1`
/// (Postshot). The last one counts.
inline void read_ply_mode(PlyTable const& table, SplatSet& set) {
  for (auto const& [text, line] : table.comments) {
    auto const w = words(text);
    if (w.size() != 2) continue;
    if (w[0] == "SplatRenderMode:") set.antialiased = w[1] == "mip";
    if (w[0] == "antialiased" && (w[1] == "0" || w[1] == "1")) set.antialiased = w[1] == "1";
  }
}

/// The header lines for what these two read.
inline std::string ply_comments(SplatSet const& set) {
  std::string lines = set.antialiased ? "comment SplatRenderMode: mip\n" : "";
  for (std::size_t l = 0; l < set.link_names.size(); ++l)
    if (!set.link_names[l].empty()) lines += "comment link " + std::to_string(l) + " " + set.link_names[l] + "\n";
  return lines;
}

/// Number of f_rest_* properties -> SH degree.
inline int sh_degree_of(std::size_t rest, std::string const& name, std::size_t line) {
  for (int degree = 0; degree <= 3; ++degree)
    if (rest == 3u * ((degree + 1) * (degree + 1) - 1)) return degree;
  fail(name, at_line(line),
       std::to_string(rest) + " properties f_rest_* are no SH degree 0, 1, 2 or 3 (0, 9, 24 or 45); export the file with one of these");
}

/// Notes for the load report: properties that nothing reads.
inline void note_unused(PlyTable const& table, PlyElement const& e, SplatSet& set, auto const& used) {
  for (auto const& p : e.properties)
    if (!used(std::string_view(p.name)))
      set.notes.push_back(table.name + ": line " + std::to_string(p.line) + ": property " + in_quotes(p.name) + " is without effect");
}

}  // namespace gsp::io::detail
