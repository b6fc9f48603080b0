// The shape of include/gsp, read from its sources: who may include whom, and which outside headers stay out of programs that did not ask
// for them.
#include <doctest/doctest.h>

#include <algorithm>
#include <cctype>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <set>
#include <string>
#include <vector>

namespace {
namespace fs = std::filesystem;

struct Header {
  std::string name;  // "gsp/solver/pgs.hpp"
  std::string area;  // "solver"; empty for gsp.hpp and fwd.hpp
  std::vector<std::string> includes;
  bool pragma_once = false, names_kokkos = false;
};

std::string area_of(std::string const& name) {
  auto const first = name.find('/') + 1, second = name.find('/', first);
  return second == std::string::npos ? "" : name.substr(first, second - first);
}

std::vector<Header> read_headers() {
  fs::path const root = fs::path(GSP_TEST_DIR).parent_path() / "include";
  std::vector<Header> headers;
  for (auto const& entry : fs::recursive_directory_iterator(root)) {
    if (entry.path().extension() != ".hpp") continue;
    Header h;
    h.name = entry.path().lexically_relative(root).generic_string();
    h.area = area_of(h.name);
    std::ifstream file(entry.path());
    for (std::string line; std::getline(file, line);) {
      auto const start = line.find_first_not_of(" \t");
      if (start == std::string::npos) continue;
      if (line.compare(start, 12, "#pragma once") == 0) h.pragma_once = true;
      if (line.compare(start, 2, "//") != 0 && (line.find("Kokkos::") != line.npos || line.find("KOKKOS_") != line.npos))
        h.names_kokkos = true;
      if (line.compare(start, 8, "#include") != 0) continue;
      auto const open = line.find_first_of("<\"", start + 8);
      if (open == std::string::npos) continue;
      auto const close = line.find_first_of(">\"", open + 1);
      std::string target = line.substr(open + 1, close - open - 1);
      if (line[open] == '"') {  // relative to the header itself
        target = fs::path(h.name).parent_path().append(target).lexically_normal().generic_string();
      }
      h.includes.push_back(target);
    }
    headers.push_back(h);
  }
  return headers;
}

bool starts_with(std::string const& text, std::string const& start) { return text.rfind(start, 0) == 0; }

}  // namespace

TEST_CASE("headers exist, guard themselves, and name what they include in full") {
  auto const headers = read_headers();
  REQUIRE(!headers.empty());
  std::set<std::string> names;
  for (auto const& h : headers) names.insert(h.name);
  for (auto const& h : headers) {
    CHECK_MESSAGE(h.pragma_once, h.name, " has no #pragma once");
    for (auto const& i : h.includes)
      if (starts_with(i, "gsp/")) CHECK_MESSAGE(names.count(i) == 1, h.name, " includes ", i, ", which does not exist");
  }
}

TEST_CASE("a header that names Kokkos includes it, itself or through others") {  // test_library_headers compiles with Kokkos at hand
  auto const headers = read_headers();
  std::set<std::string> reach{"Kokkos_Core.hpp", "Kokkos_Macros.hpp"};
  for (bool more = true; more;) {
    more = false;
    for (auto const& h : headers)
      for (auto const& i : h.includes)
        if (reach.count(i) == 1) more |= reach.insert(h.name).second;
  }
  int named = 0;
  for (auto const& h : headers) {
    if (!h.names_kokkos) continue;
    ++named;
    CHECK_MESSAGE(reach.count(h.name) == 1, h.name, " names Kokkos and does not include it");
  }
  CHECK(named > 30);
}

TEST_CASE("what plain C++ reads in a CUDA build knows no Kokkos") {  // docs/decisions/0006
  auto const headers = read_headers();
  std::map<std::string, Header const*> by_name;
  for (auto const& h : headers) by_name[h.name] = &h;
  for (auto const& h : headers) {
    bool const plain = h.area == "geometry" || h.area == "math" || h.name == "gsp/model/compile.hpp" || h.name == "gsp/io/mjcf.hpp" ||
                       h.name == "gsp/io/urdf.hpp";
    if (!plain) continue;
    std::set<std::string> seen{h.name};
    for (std::vector<std::string> next{h.name}; !next.empty();) {
      auto const name = next.back();
      next.pop_back();
      auto const found = by_name.find(name);
      if (found == by_name.end()) continue;
      CHECK_MESSAGE(!found->second->names_kokkos, h.name, " includes ", name, ", which names Kokkos");
      for (auto const& i : found->second->includes)
        if (seen.insert(i).second) next.push_back(i);
    }
  }
}

TEST_CASE("an area includes only areas above it") {
  std::vector<std::string> const order = {"core", "math",       "geometry", "parallel", "model", "dynamics", "collision",
                                          "ray",  "constraint", "solver",   "step",     "splat", "sensor",   "ik"};
  // Beyond the order: who must stay usable alone.
  std::map<std::string, std::set<std::string>> const never = {{"splat", {"dynamics", "collision", "constraint", "solver", "step"}},
                                                              {"solver", {"collision"}}};
  auto const rank = [&](std::string const& area) { return std::find(order.begin(), order.end(), area) - order.begin(); };
  for (auto const& h : read_headers()) {
    if (h.area.empty()) continue;  // gsp.hpp, fwd.hpp
    for (auto const& i : h.includes) {
      if (!starts_with(i, "gsp/")) continue;
      CHECK_MESSAGE(i != "gsp/gsp.hpp", h.name, " includes the umbrella header");
      auto const area = area_of(i);
      if (area.empty()) continue;
      if (h.area == "io" || h.area == "runtime") continue;  // readers may use everything, and so may what is compiled once
      CHECK_MESSAGE(area != "io", h.name, " includes ", i, ": io is host only and stands apart");
      CHECK_MESSAGE(rank(h.area) < long(order.size()), h.name, ": the area ", h.area, " is not in the list");
      CHECK_MESSAGE(rank(area) <= rank(h.area), h.name, " includes ", i, " from an area below its own");
      if (auto const n = never.find(h.area); n != never.end()) CHECK_MESSAGE(n->second.count(area) == 0, h.name, " must not include ", i);
    }
  }
}

TEST_CASE("outside headers stay where they belong") {
  for (auto const& h : read_headers()) {
    bool const io = h.area == "io", cuda_detail = h.name.find("_cuda.hpp") != std::string::npos;
    for (auto const& i : h.includes) {
      if (!io) {
        CHECK_MESSAGE((!starts_with(i, "Eigen/") || h.name == "gsp/math/eigen.hpp"), h.name, " includes ", i);
        for (char const* name : {"iostream", "regex", "pugixml.hpp", "zlib.h", "nlohmann/", "stb/", "libqhull", "zstd.h", "webp/"})
          CHECK_MESSAGE(!starts_with(i, name), h.name, " includes ", i);
      }
      CHECK_MESSAGE(i != "iostream", h.name, " includes <iostream>");
      CHECK_MESSAGE(i != "regex", h.name, " includes <regex>");
      CHECK_MESSAGE(i != "Kokkos_Sort.hpp", h.name, " includes Kokkos_Sort.hpp, which doubles the time to compile");
      if (starts_with(i, "cub/") || starts_with(i, "thrust/"))
        CHECK_MESSAGE(cuda_detail, h.name, " includes ", i, ": only <area>/detail/*_cuda.hpp may");
      if (h.name == "gsp/fwd.hpp") CHECK_MESSAGE(i != "Kokkos_Core.hpp", "gsp/fwd.hpp names types only; Kokkos_Core_fwd.hpp will do");
    }
  }
}

TEST_CASE("gsp.hpp includes every public header") {
  auto const headers = read_headers();
  std::set<std::string> all;
  for (auto const& h : headers)
    if (h.name == "gsp/gsp.hpp") all.insert(h.includes.begin(), h.includes.end());
  REQUIRE(!all.empty());
  for (auto const& h : headers) {
    bool const direct = std::count(h.name.begin(), h.name.end(), '/') == 2;  // gsp/<area>/<name>.hpp
    if (h.area == "runtime") continue;                                       // instead of the headers, not beside them
    if (direct && h.name != "gsp/io/compressed_ply.hpp") CHECK_MESSAGE(all.count(h.name) == 1, "gsp/gsp.hpp does not include ", h.name);
  }
}

TEST_CASE("a region bears the name of its area and of the function that opens it") {
  fs::path const root = fs::path(GSP_TEST_DIR).parent_path() / "include";
  int regions = 0;
  for (auto const& h : read_headers()) {
    std::ifstream file(root / h.name);
    std::string before, line;
    for (; std::getline(file, line); before += line + "\n") {
      auto const at = line.find("Region const region(\"");
      if (at == line.npos) continue;
      ++regions;
      auto const open = line.find('"', at) + 1;
      auto const label = line.substr(open, line.find('"', open) - open);
      CHECK_MESSAGE(starts_with(label, "gsp::" + h.area + "::"), h.name, " opens ", label);
      auto const function = label.substr(label.rfind(':') + 1);
      CHECK_MESSAGE(before.find(" " + function + "(Exec const& exec") != before.npos, h.name, " opens ", label, " in another function");
    }
  }
  CHECK(regions >= 18);
}

// A page may be about several headers; pairs of shapes and shapes have a table each (docs/collision/narrowphase.md,
// docs/geometry/shapes.md). It names one by its path, <area>/<name>.hpp: splat/cameras.hpp does not stand for sensor/cameras.hpp. Or it is
// docs/<area>/<name>.md.
TEST_CASE("a page names each public header") {
  std::string pages;
  std::set<std::string> names;  // of the pages: area/name
  fs::path const docs = fs::path(GSP_TEST_DIR).parent_path() / "docs";
  for (auto const& entry : fs::recursive_directory_iterator(docs)) {
    if (entry.path().extension() != ".md") continue;
    names.insert(entry.path().lexically_relative(docs).replace_extension().generic_string());
    std::ifstream file(entry.path());
    pages.append(std::istreambuf_iterator<char>(file), {});
  }
  for (auto const& h : read_headers()) {
    bool const family = starts_with(h.name, "gsp/collision/narrowphase/") || starts_with(h.name, "gsp/geometry/shapes/");
    if (family || h.name.find("/detail/") != h.name.npos) continue;
    std::string const path = h.name.substr(4);  // behind gsp/
    bool found = names.count(fs::path(path).replace_extension().generic_string()) == 1;
    for (auto at = pages.find(path); at != pages.npos && !found; at = pages.find(path, at + 1)) {
      char const before = at == 0 ? ' ' : pages[at - 1];
      found = !std::isalnum(static_cast<unsigned char>(before)) && before != '_';
    }
    CHECK_MESSAGE(found, "no page below docs/ names ", path, ": write that path into the page that is about it, or docs/", h.area,
                  "/<name>.md");
  }
}

// Each public header has a test: tests/<area>/<name>.cpp, or one that is about several headers of one idea. That a test names what the
// header declares at all is what can be held here.
TEST_CASE("a test names what each public header declares") {
  fs::path const tests(GSP_TEST_DIR), include = tests.parent_path() / "include";
  auto const each_word = [](std::string const& line, auto const& f) {
    for (std::size_t i = 0, end = 0; i < line.size(); i = end + 1) {
      for (end = i; end < line.size() && (std::isalnum(static_cast<unsigned char>(line[end])) || line[end] == '_');) ++end;
      if (end > i) f(line.substr(i, end - i), line.substr(end));
    }
  };
  std::set<std::string> used;
  for (auto const& entry : fs::recursive_directory_iterator(tests)) {
    auto const ending = entry.path().extension();
    if ((ending != ".cpp" && ending != ".hpp") || entry.path().filename() == "include_rules.cpp") continue;
    std::ifstream file(entry.path());
    for (std::string line; std::getline(file, line);)
      each_word(line.substr(0, line.find("//")), [&](std::string const& word, std::string const&) { used.insert(word); });
  }
  std::set<std::string> const kinds = {"struct", "class", "concept", "using", "bool"};
  int checked = 0;
  for (auto const& h : read_headers()) {
    if (h.name.find("/detail/") != h.name.npos || std::count(h.name.begin(), h.name.end(), '/') != 2) continue;
    if (fs::exists(tests / fs::path(h.name.substr(4)).replace_extension(".cpp"))) continue;
    std::ifstream file(include / h.name);
    bool detail = false, named = false, any = false;
    for (std::string line; std::getline(file, line);) {
      detail = (detail || starts_with(line, "namespace detail {")) && !starts_with(line, "}  // namespace detail");
      if (detail || line.empty() || line[0] == ' ' || line[0] == '#' || line[0] == '/') continue;
      std::string before;
      each_word(line, [&](std::string const& word, std::string const& rest) {
        if (word != "alignas" && (kinds.count(before) == 1 || rest[0] == '(')) {
          any = true;
          named = named || used.count(word) == 1;
        }
        before = word;
      });
    }
    ++checked;
    CHECK_MESSAGE((named || !any), "no test names what ", h.name, " declares: write tests/", h.name.substr(4, h.name.size() - 7), "cpp");
  }
  CHECK(checked > 40);
}
