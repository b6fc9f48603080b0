#pragma once
#include <algorithm>
#include <filesystem>
#include <functional>
#include <gsp/io/detail/bytes.hpp>
#include <gsp/model/description.hpp>
#include <pugixml.hpp>
#include <set>
#include <string>
#include <string_view>
#include <vector>

/// XML as a plain tree whose nodes know file and line; in MJCF with <include> already put in place. URDF is read with it too.
namespace gsp::io::detail::mjcf {

struct Attribute {
  std::string name, value;
};
struct Node {
  std::string name;
  Place place;
  std::vector<Attribute> attributes;
  std::vector<Node> children;
  std::string const* find(std::string_view attribute) const {
    for (auto const& a : attributes)
      if (a.name == attribute) return &a.value;
    return nullptr;
  }
};

/// Files as they are met; Place::file points into `names`.
struct Files {
  using Read = std::function<std::vector<std::byte>(std::filesystem::path const&)>;
  std::vector<std::string> names;
  std::vector<std::filesystem::path> folders;
  Read read;
  std::size_t nodes = 0;
  std::vector<Place> stray_text;  // text between elements, which means nothing

  std::string at(Place const& place) const { return names[static_cast<std::size_t>(place.file)] + ":" + std::to_string(place.line) + ": "; }
  [[noreturn]] void fail(Place const& place, std::string const& sentence) const { throw Error(at(place) + sentence); }
  int add(std::string name) {
    if (names.size() >= 1000)
      throw Error(name + ": is the thousandth file of this model; includes and attached models go in circles or must be joined");
    folders.push_back(std::filesystem::path(name).parent_path());
    names.push_back(std::move(name));
    return static_cast<int>(names.size()) - 1;
  }
  /// A path of a file as the one at `place` names it: relative to that file's folder, else to the first file's.
  std::filesystem::path resolve(Place const& place, std::string const& file) const {
    std::filesystem::path const path = file;
    if (path.is_absolute()) return path;
    auto const near = folders[static_cast<std::size_t>(place.file)] / path;
    std::error_code error;
    if (folders[0] != folders[static_cast<std::size_t>(place.file)] && !std::filesystem::exists(near, error)) return folders[0] / path;
    return near;
  }
  std::vector<std::byte> load(Place const& place, std::filesystem::path const& path) const {
    try {
      return read(path);
    } catch (Error const& e) { throw Error(at(place) + e.what()); }
  }
};

class XmlReader {
 public:
  /// `includes`: <include> means what it means in MJCF; else it is an element like others.
  explicit XmlReader(Files& files, bool includes = true) : files_(files), includes_(includes) {}

  /// The root element of a document. Limits that no real file meets keep hostile ones from exhausting stack and memory.
  Node parse(Bytes bytes, int file, int depth = 0) {
    auto const text = as_text(bytes);
    std::vector<std::size_t> breaks;
    for (std::size_t i = 0; i < text.size(); ++i)
      if (text[i] == '\n') breaks.push_back(i);
    auto const line = [&](std::ptrdiff_t offset) {
      return 1 + static_cast<int>(
                     std::lower_bound(breaks.begin(), breaks.end(), static_cast<std::size_t>(std::max<std::ptrdiff_t>(offset, 0))) -
                     breaks.begin());
    };
    pugi::xml_document document;
    auto const result = document.load_buffer(text.data(), text.size(), pugi::parse_default, pugi::encoding_utf8);
    if (!result)
      files_.fail({file, line(result.offset)},
                  std::string("is not XML here (") + result.description() + "); correct the file, or give one of MJCF or URDF");
    pugi::xml_node root;
    for (auto const& child : document.children()) {
      if (child.type() != pugi::node_element) continue;
      if (root) files_.fail({file, line(child.offset_debug())}, "a second root element " + in_quotes(child.name()) + "; keep one");
      root = child;
    }
    if (!root) files_.fail({file, 1}, "holds no XML element; is this a model file?");
    return convert(root, file, line, depth);
  }

 private:
  template <class Line>
  Node convert(pugi::xml_node const& from, int file, Line const& line, int depth) {
    Node node;
    node.name = from.name();
    node.place = {file, line(from.offset_debug())};
    if (depth > 100) files_.fail(node.place, "elements are nested more than 100 deep; flatten the file");
    if (++files_.nodes > 2'000'000) files_.fail(node.place, "the model has more than 2 million elements; split it");
    for (auto const& a : from.attributes()) {
      if (node.find(a.name())) files_.fail(node.place, "attribute " + in_quotes(a.name()) + " is given twice; keep one");
      node.attributes.push_back({a.name(), a.value()});
    }
    for (auto const& child : from.children()) {
      if (child.type() == pugi::node_pcdata || child.type() == pugi::node_cdata)
        files_.stray_text.push_back({file, line(child.offset_debug())});
      if (child.type() != pugi::node_element) continue;
      if (includes_ && std::string_view(child.name()) == "include")
        include(child, {file, line(child.offset_debug())}, node, depth);
      else
        node.children.push_back(convert(child, file, line, depth + 1));
    }
    return node;
  }

  // The children of the included root take the place of <include>. Each file at most once, as in MuJoCo, which also rules out circles.
  void include(pugi::xml_node const& from, Place const& place, Node& parent, int depth) {
    std::string const name = from.attribute("file").value();
    if (name.empty() || from.first_attribute().next_attribute() || from.first_child())
      files_.fail(place, "<include> takes the one attribute 'file' and nothing inside; correct it");
    auto const path = files_.resolve(place, name);
    if (!included_.insert(path.lexically_normal().string()).second)
      files_.fail(place, "file " + in_quotes(name) + " is included a second time; include it once");
    auto const bytes = files_.load(place, path);
    int const file = files_.add(path.string());
    Node root = parse(bytes, file, depth + 1);
    if (root.name != "mujoco" && root.name != "mujocoinclude")
      files_.fail(root.place, "the root of an included file is " + in_quotes(root.name) + "; make it <mujocoinclude>");
    for (auto& child : root.children) parent.children.push_back(std::move(child));
  }

  Files& files_;
  bool includes_;
  std::set<std::string> included_;
};

}  // namespace gsp::io::detail::mjcf
