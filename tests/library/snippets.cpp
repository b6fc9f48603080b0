// Code in the pages is code that is compiled: a block behind `<!-- snippet: FILE NAME -->` is what stands in FILE between the lines
// `// example-begin NAME` and `// example-end NAME`. With GSP_WRITE_SNIPPETS=1 in the environment this test writes the blocks into the
// pages. Links between the pages lead somewhere.
#include <doctest/doctest.h>

#include <cctype>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

namespace {
namespace fs = std::filesystem;

fs::path root() { return fs::path(GSP_TEST_DIR).parent_path(); }

std::vector<std::string> lines_of(fs::path const& path) {
  std::ifstream file(path);
  std::vector<std::string> lines;
  for (std::string line; std::getline(file, line);) lines.push_back(line);
  return lines;
}

/// The lines between the marks, moved left by what they all are indented.
std::vector<std::string> example(fs::path const& path, std::string const& name) {
  std::vector<std::string> out;
  bool inside = false;
  for (auto const& line : lines_of(path)) {
    auto const start = line.find_first_not_of(' ');
    std::string const text = start == line.npos ? "" : line.substr(start);
    if (text == "// example-end " + name) inside = false;
    if (inside) out.push_back(line);
    if (text == "// example-begin " + name) inside = true;
  }
  std::size_t indent = 1000;
  for (auto const& line : out)
    if (auto const start = line.find_first_not_of(' '); start != line.npos) indent = std::min(indent, start);
  for (auto& line : out) line = line.size() > indent ? line.substr(indent) : "";
  return out;
}
/// A heading as GitHub names it in links.
std::string anchor_of(std::string const& heading) {
  std::string out;
  for (char const c : heading) {
    if (std::isalnum(static_cast<unsigned char>(c)) || c == '-' || c == '_') out += char(std::tolower(static_cast<unsigned char>(c)));
    if (c == ' ') out += '-';
  }
  return out;
}
std::vector<fs::path> all_pages() {
  std::vector<fs::path> pages{root() / "README.md", root() / "CONTRIBUTING.md", root() / "CHANGELOG.md"};
  for (auto const& entry : fs::recursive_directory_iterator(root() / "docs"))
    if (entry.path().extension() == ".md") pages.push_back(entry.path());
  return pages;
}
}  // namespace

// Links name files that are there; and where they name a heading, the page has it, and is one whose headings the API site knows by name
// (scripts/detail/doxygen.awk).
TEST_CASE("links of the pages lead somewhere") {
  std::string known;
  for (auto const& line : lines_of(root() / "scripts/detail/doxygen.awk"))
    if (line.find("/^## /") != line.npos) known = line;
  int found = 0;
  for (auto const& page : all_pages()) {
    bool fence = false;
    for (auto const& line : lines_of(page)) {
      if (line.starts_with("```")) fence = !fence;
      for (std::size_t at = 0; !fence && (at = line.find("](", at)) != line.npos;) {
        at += 2;
        std::string const link = line.substr(at, line.find(')', at) - at), file = link.substr(0, link.find('#'));
        if (link.find("://") != link.npos) continue;
        CAPTURE(page.string());
        CAPTURE(link);
        fs::path const target = file.empty() ? page : page.parent_path() / file;
        CHECK_MESSAGE(fs::exists(target), "no such file");
        ++found;
        if (file.size() == link.size()) continue;
        bool has = false;
        for (auto const& heading : lines_of(target))
          has |= heading.starts_with("## ") && anchor_of(heading.substr(3)) == link.substr(file.size() + 1);
        CHECK_MESSAGE(has, "no such heading");
        CHECK_MESSAGE(known.find(target.stem().string()) != known.npos,
                      "scripts/detail/doxygen.awk does not name the headings of this page");
      }
    }
  }
  CHECK(found > 100);
}

TEST_CASE("snippets of the pages are those of the tests") {
  bool const write = std::getenv("GSP_WRITE_SNIPPETS") != nullptr;
  int found = 0;
  for (auto const& page : all_pages()) {
    if (page.filename() == "CONTRIBUTING.md") continue;  // says how such a line looks
    auto const lines = lines_of(page);
    std::vector<std::string> out;
    for (std::size_t i = 0; i < lines.size(); ++i) {
      out.push_back(lines[i]);
      auto const mark = lines[i].find("<!-- snippet: ");
      if (mark == std::string::npos) continue;
      ++found;
      std::istringstream words(lines[i].substr(mark + 14));
      std::string file, name;
      words >> file >> name;
      CAPTURE(page.string());
      CAPTURE(name);
      auto const code = example(root() / file, name);
      CHECK_MESSAGE(!code.empty(), "no lines between the marks of this name in " << file);
      REQUIRE(i + 1 < lines.size());
      REQUIRE(lines[i + 1] == "```cpp");
      std::size_t end = i + 2;
      while (end < lines.size() && lines[end] != "```") ++end;
      REQUIRE(end < lines.size());
      std::vector<std::string> const block(lines.begin() + long(i) + 2, lines.begin() + long(end));
      CHECK_MESSAGE((write || block == code), "the page differs from " << file << "; GSP_WRITE_SNIPPETS=1 writes it");
      out.push_back("```cpp");
      out.insert(out.end(), code.begin(), code.end());
      out.push_back("```");
      i = end;
    }
    if (write && out != lines) {
      std::ofstream file(page);
      for (auto const& line : out) file << line << "\n";
    }
  }
  CHECK(found > 0);
}
