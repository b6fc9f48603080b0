#pragma once
#include <gsp/core/detail/compiled.hpp>
#include <gsp/io/detail/json_text.hpp>
#include <gsp/io/file.hpp>
#include <gsp/io/splat_links.hpp>
#include <gsp/io/splat_set.hpp>

namespace gsp::io {

GSP_INLINE std::vector<LinkRange> parse_links(Bytes bytes, std::string const& name) {
  using detail::fail;
  using detail::Json;
  Json const root = detail::parse_json(detail::as_text(bytes), name);
  if (!root.is_object() || root.size() != 1 || !root.contains("links") || !root["links"].is_array())
    fail(name, "", R"(must be {"links": [{"name": "...", "first": 0, "count": 1}, ...]}; write it so)");
  std::vector<LinkRange> ranges;
  for (auto const& item : root["links"]) {
    std::string const place = "links[" + std::to_string(ranges.size()) + "]";
    if (!item.is_object() || item.size() != 3 || !item.contains("name") || !item.contains("first") || !item.contains("count"))
      fail(name, place, R"(must have exactly the keys "name", "first" and "count"; write it so)");
    if (!item["name"].is_string() || item["name"].get_ref<std::string const&>().empty())
      fail(name, place, "\"name\" must be the name of a link; give it one");
    for (char const* key : {"first", "count"})
      if (!item[key].is_number_unsigned())
        fail(name, place, "\"" + std::string(key) + "\" must be a whole number, not negative; write it so");
    ranges.push_back({item["name"].get<std::string>(), item["first"].get<std::size_t>(), item["count"].get<std::size_t>()});
  }
  return ranges;
}

GSP_INLINE std::vector<LinkRange> read_links(std::filesystem::path const& path) { return parse_links(read_file(path), path.string()); }

GSP_INLINE std::vector<LinkRange> link_ranges(SplatSet const& set) {
  std::vector<LinkRange> ranges;
  for (std::size_t i = 0; i < set.size(); ++i) {
    if (set.link[i] < 0) continue;
    if (i > 0 && set.link[i - 1] == set.link[i])
      ++ranges.back().count;
    else
      ranges.push_back({set.link_names.at(static_cast<std::size_t>(set.link[i])), i, 1});
  }
  return ranges;
}

GSP_INLINE std::string format_links(std::vector<LinkRange> const& ranges) {
  auto list = nlohmann::ordered_json::array();
  for (auto const& r : ranges) list.push_back({{"name", r.name}, {"first", r.first}, {"count", r.count}});
  try {
    return nlohmann::ordered_json{{"links", list}}.dump() + "\n";
  } catch (nlohmann::json::type_error const&) {
    throw Error("gsp::io::format_links: a link's name is not UTF-8, as JSON must be; rename it");
  }
}

GSP_INLINE void bind_links(SplatSet& set, std::vector<LinkRange> const& ranges, std::string const& name) {
  std::vector<int> link(set.size(), -1);
  std::vector<std::string> names;
  std::map<std::string, int> index;
  for (std::size_t r = 0; r < ranges.size(); ++r) {
    auto const& [label, first, count] = ranges[r];
    std::string const place = "links[" + std::to_string(r) + "] (" + detail::in_quotes(label) + ")";
    if (first > set.size() || count > set.size() - first)
      detail::fail(name, place,
                   "first " + std::to_string(first) + " and count " + std::to_string(count) + " leave the " + std::to_string(set.size()) +
                       " Gaussians; correct them");
    auto const [entry, added] = index.emplace(label, static_cast<int>(names.size()));
    if (added) names.push_back(label);
    for (std::size_t i = first; i < first + count; ++i) {
      if (link[i] >= 0)
        detail::fail(
            name, place,
            "Gaussian " + std::to_string(i) + " is already bound to " + detail::in_quotes(names[link[i]]) + "; ranges must not overlap");
      link[i] = entry->second;
    }
  }
  set.link = std::move(link);
  set.link_names = std::move(names);
  validate(set, name);
}

}  // namespace gsp::io
