#pragma once
#include <algorithm>
#include <gsp/io/detail/mjcf_schema.hpp>
#include <gsp/model/sensor_types.hpp>
#include <string>
#include <string_view>
#include <vector>

namespace gsp::io::detail::mjcf {

/// The words of a list, groups expanded, in alphabetical order, with commas.
inline std::string listed(std::string_view list) {
  std::vector<std::string> all;
  auto const add = [&](auto const& self, std::string_view words) -> void {
    for (std::size_t at = 0; at < words.size();) {
      std::size_t end = std::min(words.find(' ', at), words.size());
      auto const word = words.substr(at, end - at);
      bool group = false;
      for (auto const& g : attribute_groups)
        if (g.name == word) {
          self(self, g.words);
          group = true;
        }
      if (!group && !word.empty()) all.emplace_back(word);
      at = end + 1;
    }
  };
  add(add, list);
  std::sort(all.begin(), all.end());
  std::string out;
  for (auto const& word : all) out += (out.empty() ? "" : ", ") + word;
  return out;
}

/// Whether it is a sensor whose numbers nothing of the library computes.
inline bool is_kept_alone(std::string_view element) {
  constexpr std::string_view place = "sensor/";
  if (!element.starts_with(place)) return false;
  auto const* const info = find_sensor_type(element.substr(place.size()));
  return info && !gsp::detail::is_evaluated(info->stage);
}

/// The page "What of MJCF works", in Markdown, from the table that the reader itself obeys. `gsp info --schema` prints it.
inline std::string schema_page() {
  std::string page =
      "# What of MJCF works\n\n"
      "Printed by `gsp info --schema` from the reader's own table; a test compares the two. The grammar is that of MuJoCo 4.0.1. Each "
      "attribute is\n"
      "**honoured** (read, with MuJoCo's meaning), **seen only** (pictures of MuJoCo's viewer: a line of the load report), **without "
      "effect** (settings of\n"
      "what this library does in another way, or does not need: a line, too), or **refused** with a sentence unless its value asks for "
      "nothing (0, false,\n"
      "none, auto, disable). What stands in no list is unknown, and an error.\n\n"
      "## Elements that are refused\n\n| element | why |\n| --- | --- |\n";
  for (auto const& e : refused_elements) page += "| " + std::string(e.element) + " | " + std::string(e.sentence) + " |\n";
  page +=
      "\nRefused by value: geom type `sdf`, camera projection `orthographic`, option integrator `discrete`, dyntype, gaintype and biastype "
      "`user`, `pid`, `so3`\n"
      "and `dcmotor`, coefficients of higher order of an actuator's damping, muscles whose length range is not given and that the\n"
      "simulation of `<lengthrange>` pulls without end.\n\n"
      "## Elements and their attributes\n\n| element | honoured | seen only | without effect | refused |\n| --- | --- | --- | --- | --- "
      "|\n";
  for (auto const& e : schema) {
    if (is_kept_alone(e.element)) continue;
    if (e.honoured.empty() && e.visual.empty() && e.no_effect.empty() && e.refused.empty()) continue;
    page += "| " + std::string(e.element);
    for (auto list : {e.honoured, e.visual, e.no_effect, e.refused}) page += " | " + listed(list);
    page += " |\n";
  }
  page +=
      "\n## Sensors that are read and not computed\n\n"
      "What asks for signed distance fields is not computed: these are read, checked, kept and written, with their\n"
      "place in sensordata, whose numbers stay as they are (`Sensors::left_out`); a line of the load report names each type. Those of "
      "`user` "
      "are yours to\n"
      "compute ([a sensor of one's own](../add_a_sensor.md)), and no line.\n\n"
      "| element | read and kept | without effect | refused |\n| --- | --- | --- | --- |\n";
  for (auto const& e : schema) {
    if (!is_kept_alone(e.element)) continue;
    page += "| " + std::string(e.element);
    for (auto list : {e.honoured, e.no_effect, e.refused}) page += " | " + listed(list);
    page += " |\n";
  }
  return page;
}

}  // namespace gsp::io::detail::mjcf
