#pragma once
#include <array>
#include <functional>
#include <gsp/io/detail/load_report.hpp>
#include <gsp/io/detail/mjcf_actuator_law.hpp>
#include <gsp/io/detail/mjcf_draft.hpp>
#include <gsp/io/detail/mjcf_schema.hpp>
#include <gsp/io/detail/mjcf_values.hpp>
#include <gsp/io/detail/mjcf_xml.hpp>
#include <map>
#include <string>
#include <string_view>
#include <unordered_map>
#include <vector>

/// What all parts of the MJCF reader need: the document so far, strictness, and attributes with those of default classes.
namespace gsp::io::detail::mjcf {

using Line = ReportLine::Kind;

/// What all files of one reading share.
struct Session {
  Files files;
  Report report;
  bool skip_visuals = false, list_refusals = false;
  int next_id = 0, depth = 0;
  std::size_t items = 0;
};

/// What a default class says: element -> attribute -> value, a copy of the parent's at that point with the class's own over it.
struct Class {
  std::map<std::string, Values, std::less<>> values;
  std::vector<Law> laws{Law{}};  // of actuators: the class's own last, before it its parent's, and so on
};

/// One MJCF document while it is read.
struct Document {
  Session& session;
  int file;
  ModelDraft draft = {};
  bool degrees = true, autolimits = true, strip_path = false;  // of <compiler>
  std::string eulerseq = "xyz", asset_folder = {};
  bool has_option = false;
  std::string main_class = "main";  // the name of the outermost default class, which holds where no class is named
  std::unordered_map<std::string, Class> classes = {{"", Class{}}};
  std::unordered_map<std::string, std::array<float, 4>> materials = {};
  std::unordered_map<std::string, std::string> missing = {};  // assets whose file cannot be read, and why
  std::unordered_map<std::string, Node> models = {};          // of <asset>, by name

  [[noreturn]] void fail(Place const& place, std::string const& sentence) const { session.files.fail(place, sentence); }
  void note(Line kind, Place const& place, std::string const& text) {
    session.report.add(kind, session.files.names[std::size_t(place.file)], place.line, text);
  }
  void refuse(Place const& place, std::string const& sentence) {
    if (!session.list_refusals) fail(place, sentence);
    note(Line::refused, place, sentence);
  }
  void refuse_element(Node const& node, std::string const& parent = "") {
    auto const* e = find_refused(node.name);
    refuse(node.place, parent + "<" + node.name + ">: " + (e ? std::string(e->sentence) : "is not supported; remove it"));
  }
  /// Refuses `node` if elements of its name are; returns whether.
  bool refuses(Node const& node, std::string const& parent = "") {
    if (!find_refused(node.name)) return false;
    refuse_element(node, parent);
    return true;
  }
  /// Attributes and children of `node` against the schema of `element`; true where nothing is refused. Attributes that are seen only or
  /// have no effect become lines of the report, if `lines`.
  bool check(Node const& node, std::string const& element, bool lines = true) {
    auto const* e = find_schema(element);
    if (!e) fail(node.place, "unknown element <" + node.name + ">; correct or remove it");
    bool good = true;
    for (auto const& a : node.attributes) {
      std::string const what = "<" + node.name + "> " + a.name;
      if (is_in(e->honoured, a.name)) continue;
      if (is_in(e->visual, a.name)) {
        if (lines) note(Line::visual_only, node.place, what);
      } else if (is_in(e->no_effect, a.name)) {
        if (lines) note(Line::no_effect, node.place, what);
      } else if (is_in(e->refused, a.name)) {
        if (is_neutral(a.value)) continue;
        refuse(node.place, what + "=" + in_quotes(a.value) + " is not supported yet; remove the attribute");
        good = false;
      } else {
        fail(node.place, "unknown attribute " + in_quotes(a.name) + " of <" + node.name + ">; correct or remove it");
      }
    }
    for (auto const& child : node.children)
      if (!is_in(e->children, child.name) && !find_refused(child.name))
        fail(child.place, "unknown element " + in_quotes(child.name) + " in <" + node.name + ">; correct or remove it");
    return good;
  }
  bool check(Node const& node) { return check(node, node.name); }
  void check_all(Node const& node, bool lines = true) {
    check(node, node.name, lines);
    for (auto const& child : node.children) check_all(child, lines);
  }
  /// One line for what is seen only, however much stands in it.
  void skip_visual(Node const& node) {
    check_all(node, false);
    note(Line::visual_only, node.place, "<" + node.name + ">");
  }
  /// Holds replicates and attached models in bounds.
  void count(std::size_t n, Place const& place) {
    if ((session.items += n) > 200'000) fail(place, "the model has more than 200,000 bodies, joints, geoms and sites; replicate less");
  }

  /// The attributes of `node` as they stand; or over those of its class, which is `childclass` where it names none.
  Attributes attributes(Node const& node) const { return {session.files, node, nullptr}; }
  Attributes attributes(Node const& node, std::string_view element, std::string const& childclass) const {
    auto const& c = class_of(node, childclass);
    auto const found = c.values.find(element);
    return {session.files, node, found == c.values.end() ? nullptr : &found->second};
  }
  Class const& class_of(Node const& node, std::string const& childclass) const {
    auto const* own = node.find("class");
    std::string const& name = own ? *own : childclass;
    auto const found = classes.find(name == main_class ? "" : name);
    if (found == classes.end()) fail(node.place, "default class " + in_quotes(name) + " does not exist; correct the name");
    return found->second;
  }
  /// The class of what stands in an element: its childclass, else that of where it stands itself.
  std::string childclass(Attributes const& a, std::string const& outer) const {
    std::string const name = a.text("childclass", outer);
    if (a.has("childclass") && !classes.count(name == main_class ? "" : name))
      a.fail("childclass", "names the class " + in_quotes(name) + ", which does not exist; correct the name");
    return name;
  }
};

}  // namespace gsp::io::detail::mjcf
