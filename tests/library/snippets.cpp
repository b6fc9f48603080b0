// Code in the pages is code that is compiled: a block behind `<!-- snippet: FILE NAME -->` is what stands in FILE between the lines
// `// example-begin NAME` and `// example-end NAME`. With GSP_WRITE_SNIPPETS=1 in the environment this test writes the blocks into the
// pages.
#include <doctest/doctest.h>

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
}  // namespace

TEST_CASE("snippets of the pages are those of the tests") {
  bool const write = std::getenv("GSP_WRITE_SNIPPETS") != nullptr;
  int found = 0;
  std::vector<fs::path> pages{root() / "README.md"};
  for (auto const& entry : fs::recursive_directory_iterator(root() / "docs"))
    if (entry.path().extension() == ".md") pages.push_back(entry.path());
  for (auto const& page : pages) {
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
