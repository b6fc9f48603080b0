// The page of what works is the reader's own table.
#include <doctest/doctest.h>

#include <gsp/io/detail/mjcf_page.hpp>
#include <gsp/io/file.hpp>

TEST_CASE("docs/io/what_of_mjcf_works.md is what the table says: 'gsp info --schema' prints it anew") {
  auto const bytes = gsp::io::read_file(std::string(GSP_TEST_DIR) + "/../docs/io/what_of_mjcf_works.md");
  CHECK(std::string(gsp::io::detail::as_text(bytes)) == gsp::io::detail::mjcf::schema_page());
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
