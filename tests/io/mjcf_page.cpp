// The pages about MJCF say what the reader does: what works is its own table, and each file of the test corpus is loaded or refused as
// listed.
#include <doctest/doctest.h>

#include <gsp/io/detail/mjcf_page.hpp>
#include <gsp/io/file.hpp>
#include <gsp/io/mjcf.hpp>
#include <gsp/model/compile.hpp>
#include <gsp/model/sensor_types.hpp>
#include <map>
#include <set>
#include <sstream>
#include <support/data.hpp>
#include <support/skip.hpp>

namespace {
std::string page(std::string const& name) {
  return std::string(gsp::io::detail::as_text(gsp::io::read_file(std::string(GSP_TEST_DIR) + "/../docs/io/" + name)));
}
}  // namespace

TEST_CASE("docs/io/what_of_mjcf_works.md is what the table says: 'gsp info --schema' prints it anew") {
  CHECK(page("what_of_mjcf_works.md") == gsp::io::detail::mjcf::schema_page());
}

TEST_CASE("no attribute stands in two lists of an element, and groups exist") {
  using namespace gsp::io::detail::mjcf;
  for (auto const& e : schema) {
    std::vector<std::string> all;
    for (auto list : {e.honoured, e.visual, e.no_effect, e.refused}) {
      std::string const words = listed(list);
      CHECK(words.find('@') == std::string::npos);
      for (std::size_t at = 0; at < words.size();) {
        std::size_t const end = std::min(words.find(", ", at), words.size());
        all.push_back(words.substr(at, end - at)), at = end + 2;
      }
    }
    CAPTURE(e.element);
    std::sort(all.begin(), all.end());
    CHECK(std::adjacent_find(all.begin(), all.end()) == all.end());
  }
  CHECK(listed("b @turn a") == "a, axisangle, b, euler, quat, xyaxes, zaxis");
}

// By what fills sensordata: `Sensors::left_out` goes by the same stage (tests/sensor/constraint_sensors.cpp).
TEST_CASE("the page does not call a sensor honoured that nothing computes") {
  std::string const page = gsp::io::detail::mjcf::schema_page();
  auto const kept = page.find("## Sensors that are read and not computed");
  REQUIRE(kept != page.npos);
  for (auto const& info : gsp::sensor_types) {
    CAPTURE(info.name);
    auto const row = page.find("\n| sensor/" + std::string(info.name) + " |");
    REQUIRE(row != page.npos);
    CHECK((row > kept) == !gsp::detail::is_evaluated(info.stage));
  }
}

TEST_CASE("docs/io/mjcf.md lists every file of the corpus that MuJoCo does not load: each loads without its visuals, or is refused so" *
          doctest::test_suite("data")) {
  auto const models = gsp_test::data("models"), zoo = gsp_test::data("models/zoo.txt");
  if (!models || !zoo) {
    gsp_test::skip("models/zoo.txt is missing from GSP_DATA_DIR");
    return;
  }
  std::set<std::string> loaded_by_mujoco, others;
  std::istringstream zoo_lines(std::string(gsp::io::detail::as_text(gsp::io::read_file(*zoo))));
  for (std::string line; std::getline(zoo_lines, line);)
    if (!line.empty() && line[0] != '#') loaded_by_mujoco.insert(line.substr(0, line.find(' ')));
  for (auto const& file : std::filesystem::recursive_directory_iterator(*models)) {
    std::string const name = std::filesystem::relative(file.path(), *models).generic_string();
    if (name.ends_with(".xml") && !loaded_by_mujoco.contains(name)) others.insert(name);
  }

  std::map<std::string, std::string> listed;  // file -> the sentence that refuses it; none: it loads
  std::istringstream lines(page("mjcf.md"));
  for (std::string line; std::getline(lines, line);) {
    bool const row = line.starts_with("| ");
    if (row ? line.find(".xml |") == line.npos : line.find(".xml, ") == line.npos) continue;
    std::istringstream names(row ? line.substr(2, line.find(" |") - 2) : line.substr(0, line.size() - 1));
    for (std::string name; std::getline(names >> std::ws, name, ',');)
      CHECK_MESSAGE(listed.emplace(name, row ? line.substr(name.size() + 5, line.size() - name.size() - 7) : "").second, name,
                    " stands twice");
  }
  std::set<std::string> named;
  for (auto const& [name, why] : listed) named.insert(name);
  CHECK(named == others);

  for (auto const& [name, why] : listed) {
    std::string what;
    try {
      compile(gsp::io::read_mjcf(std::filesystem::path(*models) / name, {.skip_visuals = true}));
    } catch (gsp::Error const& error) { what = error.what(); }
    CAPTURE(name);
    CHECK(what.empty() == why.empty());
    CHECK_MESSAGE(what.find(why) != what.npos, what);
    CHECK(what.find('\n') == what.npos);
  }
}
