#pragma once
#include <algorithm>
#include <gsp/io/detail/mjcf_actuators.hpp>
#include <gsp/io/detail/mjcf_assets.hpp>
#include <gsp/io/detail/mjcf_body_parts.hpp>
#include <gsp/io/detail/mjcf_copies.hpp>
#include <gsp/io/detail/mjcf_lists.hpp>
#include <gsp/io/detail/mjcf_quantities.hpp>
#include <gsp/io/detail/mjcf_settings.hpp>
#include <string>
#include <tuple>
#include <utility>

/// A document from its root down. Sections are read in MuJoCo's order: settings, classes and assets first, then the lists that refer to
/// bodies by name, the bodies last, because replicating and attaching copy entries of those lists. Bodies hold bodies, and attached models
/// documents.
namespace gsp::io::detail::mjcf {

inline Document read_document(Session& session, int file, Node const& root);
inline void read_contents(Document& doc, Node const& node, BodyDraft& to, Pose const& frame, std::string const& childclass);

inline void read_body(Document& doc, Node const& node, BodyDraft& parent, Pose const& frame, std::string const& childclass) {
  doc.check(node);
  doc.count(1, node.place);
  auto const a = doc.attributes(node);
  BodyDraft draft;
  auto& b = draft.body;
  b.place = node.place;
  b.name = a.text("name");
  set_pose(b, frame * pose_of(doc, a));
  a.number("gravcomp", b.gravcomp);
  a.boolean("mocap", b.mocap);
  if (a.has("fuse")) b.fuse = a.choice("fuse", {"false", "auto"}) == 1;
  if (a.has("sleep")) {
    int const sleep = a.choice("sleep", {"auto", "never", "allowed", "init"});
    if (sleep == 3) doc.note(Line::no_effect, node.place, "<body> sleep='init': starts awake, as if it were allowed");
    b.sleep = static_cast<BodySleep>(std::min(sleep, 2));
  }
  if (b.mocap) draft.id = doc.session.next_id++;
  if (b.name == "world") a.fail("name", "is 'world', which the root has; choose another");
  read_contents(doc, node, draft, Pose{}, doc.childclass(a, childclass));
  parent.children.push_back(std::move(draft));
}

/// Copies of the contents: copy i is turned by i times the Euler angles, and stands one offset from the copy before, in that one's frame.
/// Names get a number.
inline void read_replicate(Document& doc, Node const& node, BodyDraft& to, Pose const& frame, std::string const& childclass) {
  doc.check(node);
  auto const a = doc.attributes(node);
  int copies = 0;
  if (!a.integer("count", copies) || copies < 1) a.fail("count", "is missing or below 1; give the number of copies");
  if (copies > 1'000'000) a.fail("count", "is above a million; give less");
  std::string const inner = doc.childclass(a, childclass);
  Pose pose;
  Double3 offset{}, angles{};
  a.numbers("offset", offset);
  a.numbers("euler", angles);
  BodyDraft original;
  read_contents(doc, node, original, Pose{}, inner);
  Names names;
  collect_names(original, names, false);
  auto const lists = split_lists(doc, names);
  std::size_t const size = size_of(original), width = std::to_string(copies).size();
  for (int i = 0; i < copies; ++i) {
    std::string number = std::to_string(i);
    number.insert(0, width - std::min(width, number.size()), '0');
    Rename const rename{"", a.text("sep") + number};
    BodyDraft copy = original;
    if (i > 0) {
      doc.count(size, node.place);
      renumber(doc.session, copy);
    }
    rename(copy, names);
    merge(std::move(copy), frame * pose, to);
    append(doc, lists, names, rename, i > 0);
    pose = {pose * offset, euler(doc, double(i + 1) * angles)};
  }
}

inline ModelDraft read_model(Document& doc, Node const& node) {
  if (doc.session.depth >= 10) doc.fail(node.place, "models are attached to models more than 10 deep; is there a circle?");
  auto const path = doc.session.files.resolve(node.place, *node.find("file"));
  auto const bytes = doc.session.files.load(node.place, path);
  ++doc.session.depth;
  int const file = doc.session.files.add(path.string());
  XmlReader xml(doc.session.files);
  Node const root = xml.parse(bytes, file);
  Document model = read_document(doc.session, file, root);
  --doc.session.depth;
  if (model.has_option) doc.note(Line::no_effect, root.place, "<option> of an attached model: the attaching model's holds");
  auto const key = [](CompilerDescription const& c) {
    return std::tuple(c.inertia_from_geom_always, c.inertia_from_geom_never, c.inertia_group_range, c.boundmass, c.boundinertia,
                      c.settotalmass, c.balanceinertia, c.fit_aabb);
  };
  if (key(model.draft.compiler) != key(doc.draft.compiler))
    doc.refuse(root.place,
               "an attached model has other inertia settings in <compiler> than the model that attaches it, which is not supported; make "
               "them equal");
  return std::move(model.draft);
}
inline void read_attach(Document& doc, Node const& node, BodyDraft& to, Pose const& frame) {
  if (!doc.check(node)) return;
  auto const a = doc.attributes(node);
  if (!a.own("model")) a.fail("model", "is missing; name a <model> of <asset> (attaching a model to itself is not supported)");
  auto const model = doc.models.find(a.text("model"));
  if (model == doc.models.end()) a.fail("model", "is " + in_quotes(a.text("model")) + ", which no <asset> <model> has; correct the name");
  attach(doc, a, read_model(doc, model->second), to, frame);
}

/// Everything that may stand in a body, a frame or a replicate, into `to`.
inline void read_contents(Document& doc, Node const& node, BodyDraft& to, Pose const& frame, std::string const& childclass) {
  for (auto const& child : node.children) {
    if (child.name == "body")
      read_body(doc, child, to, frame, childclass);
    else if (child.name == "joint" || child.name == "freejoint")
      read_joint(doc, child, to, frame, childclass);
    else if (child.name == "geom")
      read_geom(doc, child, to, frame, childclass);
    else if (child.name == "site")
      read_site(doc, child, to, frame, childclass);
    else if (child.name == "camera")
      read_camera(doc, child, to, frame, childclass);
    else if (child.name == "light") {
      doc.check(child);
      doc.note(Line::visual_only, child.place, "<light>");
    } else if (child.name == "inertial")
      read_inertial(doc, child, to);
    else if (child.name == "frame") {
      doc.check(child);
      auto const a = doc.attributes(child);
      std::string const inner = doc.childclass(a, childclass);
      read_contents(doc, child, to, frame * pose_of(doc, a), inner);
    } else if (child.name == "replicate")
      read_replicate(doc, child, to, frame, childclass);
    else if (child.name == "attach")
      read_attach(doc, child, to, frame);
    else
      doc.refuse_element(child);
  }
}

inline Document read_document(Session& session, int file, Node const& root) {
  Document doc{session, file};
  if (root.name != "mujoco") doc.fail(root.place, "the root element is " + in_quotes(root.name) + "; an MJCF model is <mujoco>");
  doc.check(root);
  if (auto const* name = root.find("model")) doc.draft.name = *name;
  for (auto const& node : root.children)
    if (node.name == "body") doc.note(Line::no_effect, node.place, "<body> outside <worldbody>");
  auto const each = [&](char const* section, auto const& read) {
    for (auto const& node : root.children)
      if (node.name == section) read(doc, node);
  };
  each("compiler", read_compiler);
  each("option", read_option);
  for (char const* section : {"size", "statistic", "visual", "custom"}) each(section, [](Document& d, Node const& n) { d.check_all(n); });
  each("extension", [](Document& d, Node const& n) { d.refuse_element(n); });
  each("default", [](Document& d, Node const& n) { read_defaults(d, n, "", true); });
  each("asset", read_assets);
  each("deformable", read_deformables);
  each("contact", read_contacts);
  each("equality", read_equalities);
  each("tendon", read_tendons);
  each("actuator", read_actuators);
  each("sensor", read_sensors);
  each("keyframe", read_keyframes);
  each("worldbody", [](Document& d, Node const& n) {
    d.check(n);
    read_contents(d, n, d.draft.world, Pose{}, "");
  });
  return doc;
}

}  // namespace gsp::io::detail::mjcf
