#pragma once
#include <algorithm>
#include <concepts>
#include <gsp/io/detail/mjcf_document.hpp>
#include <map>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

/// Copies of pieces of a model under new names, together with what refers to them: for <replicate> and <attach>.
namespace gsp::io::detail::mjcf {

/// A copy's joints and mocap bodies get numbers of their own.
inline void renumber(Session& session, BodyDraft& b) {
  for (int& id : b.joint_ids) id = session.next_id++;
  if (b.id >= 0) b.id = session.next_id++;
  for (auto& child : b.children) renumber(session, child);
}

/// Entries of the lists that name something of `names` are taken out, to be put back once for each copy. They count among the names then.
/// As in MuJoCo, actuators and equality constraints that name something else than the world, too, are lost, and tendons whose geom and
/// sidesite do not stand on the same side.
inline Lists split_lists(Document& doc, Names& names) {
  Lists taken;
  Names lost;
  Lists::for_each([&](auto list) {
    auto& all = doc.draft.lists.*list;
    std::decay_t<decltype(all)> kept;
    for (auto& entry : all) {
      auto& d = description_of(entry);
      using D = std::decay_t<decltype(d)>;
      bool any = false, only = true, broken = false;
      for_each_reference(d, [&](Kind kind, std::string const& name) {
        bool const in = names.has(kind, name);
        any = any || in;
        only = only && (in || is_world(kind, name));
        broken = broken || lost.has(kind, name);
      });
      if constexpr (std::same_as<D, TendonDescription>)
        for (auto const& item : d.path)
          broken = broken || (!item.sidesite.empty() && names.has(Kind::geom, item.name) != names.has(Kind::site, item.sidesite));
      if constexpr (std::same_as<D, ActuatorDescription> || std::same_as<D, EqualityDescription>) broken = broken || (any && !only);
      auto* name = own_name(d);
      if (broken) {
        doc.note(Line::left_out, d.place, "entries that name what is replicated and what is not, as MuJoCo does");
        if (name) lost.add(own_kind(d), *name);
        continue;
      }
      if (any && name) names.add(own_kind(d), *name);
      (any ? taken.*list : kept).push_back(std::move(entry));
    }
    all = std::move(kept);
  });
  return taken;
}

/// Puts a copy of the entries into the document. `fresh`: another one than the first, with numbers of its own.
inline void append(Document& doc, Lists lists, Names const& names, Rename const& rename, bool fresh) {
  doc.count(lists.size(), {doc.file, 1});
  Lists::for_each([&](auto list) {
    for (auto& entry : lists.*list) {
      auto& d = description_of(entry);
      if (auto* name = own_name(d)) rename(*name);
      for_each_reference(d, [&](Kind kind, std::string& name) {
        if (names.has(kind, name)) rename(name);
      });
      if constexpr (requires { entry.inheritrange; })
        if (fresh) entry.id = doc.session.next_id++;
      (doc.draft.lists.*list).push_back(std::move(entry));
    }
  });
}

inline BodyDraft const* find_body(BodyDraft const& in, std::string const& name) {
  for (auto const& child : in.children) {
    if (child.body.name == name) return &child;
    if (auto const* found = find_body(child, name)) return found;
  }
  return nullptr;
}
/// The keyframe of an attached model as values by joint, actuator and mocap body.
inline void split_key(Files const& files, ModelDraft const& model, KeyDraft& key) {
  if (key.attached) return;
  key.attached = true;
  struct Part {
    char const* what;
    std::vector<double>& all;
    std::map<int, std::vector<double>>& by_id;
    std::size_t at = 0;
  };
  auto& k = key.key;
  Part qpos{"qpos", k.qpos, key.qpos}, qvel{"qvel", k.qvel, key.qvel}, act{"act", k.act, key.act}, ctrl{"ctrl", k.ctrl, key.ctrl},
      mpos{"mpos", k.mpos, key.mpos}, mquat{"mquat", k.mquat, key.mquat};
  auto const take = [](Part& part, int id, int n) {
    if (!part.all.empty() && n > 0) {
      auto const begin = std::min(part.at, part.all.size()), end = std::min(part.at + std::size_t(n), part.all.size());
      part.by_id[id].assign(part.all.begin() + std::ptrdiff_t(begin), part.all.begin() + std::ptrdiff_t(end));
    }
    part.at += std::size_t(n);
  };
  for_each_joint(model.world, [&](int id, JointDescription const& j, BodyDescription const&) {
    take(qpos, id, qpos_size(j.type));
    take(qvel, id, qvel_size(j.type));
  });
  for (auto const& a : model.lists.actuators) {
    take(act, a.id, act_size(a.actuator));
    take(ctrl, a.id, 1);
  }
  for_each_body(model.world, [&](BodyDraft const& b) {
    if (b.body.mocap) {
      take(mpos, b.id, 3);
      take(mquat, b.id, 4);
    }
  });
  for (Part* part : {&qpos, &qvel, &act, &ctrl, &mpos, &mquat}) {
    if (!part->all.empty() && part->all.size() != part->at)
      files.fail(k.place, "<key>: attribute '" + std::string(part->what) + "' has " + std::to_string(part->all.size()) +
                              " numbers and the model needs " + std::to_string(part->at) + "; correct the list");
    part->all.clear();
  }
}
inline void prefix_assets(BodyDraft& b, Rename const& rename) {
  for (auto& g : b.body.geoms) {
    rename(g.mesh);
    rename(g.hfield);
  }
  for (auto& child : b.children) prefix_assets(child, rename);
}

/// A body of another model, or all of its world, with what refers to nothing else of it than the world's frame. `a`: of <attach>.
inline void attach(Document& doc, Attributes const& a, ModelDraft child, BodyDraft& to, Pose const& frame) {
  std::string const root = a.text("body");
  Rename const rename{a.text("prefix"), ""};
  BodyDraft const* found = &child.world;
  if (!root.empty()) found = find_body(child.world, root);
  if (!found) a.fail("body", "is " + in_quotes(root) + ", which the model does not have; correct the name");
  Names names;
  collect_names(*found, names, !root.empty());
  doc.count(size_of(*found), a.place());
  for (auto& key : child.keys) split_key(doc.session.files, child, key);
  BodyDraft piece;
  if (root.empty()) {
    piece = *found;
    piece.body.name.clear();
  } else {
    piece.children.push_back(*found);
  }
  prefix_assets(piece, rename);
  rename(piece, names);
  merge(std::move(piece), frame, to);
  auto const adopt = [&](auto& from, auto& into) {
    for (auto& x : from) {
      rename(x.name);
      bool const there = std::any_of(into.begin(), into.end(), [&](auto const& y) { return y.name == x.name; });
      names.add(Kind::mesh, x.name);
      if (!there) into.push_back(std::move(x));
    }
  };
  adopt(child.meshes, doc.draft.meshes);
  adopt(child.hfields, doc.draft.hfields);
  Lists::for_each([&](auto list) {
    for (auto& entry : child.lists.*list) {
      auto& d = description_of(entry);
      bool none = true, any = false, outside = false;
      for_each_reference(d, [&](Kind kind, std::string const& name) {
        bool const in = names.has(kind, name);
        none = false;
        any = any || in;
        outside = outside || (!in && !is_world(kind, name));
      });
      if (outside || !(any || none)) {
        doc.note(Line::left_out, d.place, "entries that name what is not attached, as MuJoCo does");
        continue;
      }
      if (auto* name = own_name(d)) {
        names.add(own_kind(d), *name);
        rename(*name);
      }
      for_each_reference(d, [&](Kind kind, std::string& name) {
        if (!is_world(kind, name)) rename(name);
      });
      (doc.draft.lists.*list).push_back(std::move(entry));
    }
  });
  for (auto key : child.keys) {
    rename(key.key.name);
    doc.draft.keys.push_back(std::move(key));
  }
}

}  // namespace gsp::io::detail::mjcf
