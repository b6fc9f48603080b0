#pragma once
#include <gsp/model/description.hpp>
#include <gsp/model/detail/host_math.hpp>
#include <iterator>
#include <map>
#include <set>
#include <string>
#include <vector>

/// A model while it is read: the body tree, and the lists that refer to it by name. Replicating and attaching copy pieces of it.
namespace gsp::io::detail::mjcf {

struct BodyDraft {
  BodyDescription body;
  std::vector<int> joint_ids;  // unique in a reading, so that keyframes of attached models find their joints
  std::vector<BodyDraft> children;
  Place needs_mesh;  // a mesh geom with mass that was left out
};
struct ActuatorDraft {
  ActuatorDescription actuator;
  int id = 0;
  double inheritrange = 0;
};
/// A keyframe of the whole model as it stands, or of an attached model: values by joint and actuator.
struct KeyDraft {
  KeyframeDescription key;
  bool attached = false;
  std::map<int, std::vector<double>> qpos, qvel, ctrl;
};
struct ModelDraft {
  std::string name;
  OptionDescription option;
  CompilerDescription compiler;
  BodyDraft world{BodyDescription::world(), {}, {}, {}};
  std::vector<TendonDescription> tendons;
  std::vector<ActuatorDraft> actuators;
  std::vector<KeyDraft> keys;
  std::vector<ExcludeDescription> excludes;
};

/// What a subtree holds, by name.
struct Names {
  std::set<std::string, std::less<>> bodies, joints, tendons;
};
inline void collect_names(BodyDraft const& from, Names& names, bool itself) {
  if (itself && !from.body.name.empty()) names.bodies.insert(from.body.name);
  for (auto const& j : from.body.joints)
    if (!j.name.empty()) names.joints.insert(j.name);
  for (auto const& child : from.children) collect_names(child, names, true);
}
inline std::size_t size_of(BodyDraft const& b) {
  std::size_t n = 1 + b.body.joints.size() + b.body.geoms.size() + b.body.sites.size() + b.body.cameras.size();
  for (auto const& child : b.children) n += size_of(child);
  return n;
}

/// Puts `prefix` and `suffix` around a name that is not empty.
struct Rename {
  std::string prefix, suffix;
  void operator()(std::string& name) const {
    if (!name.empty()) name = prefix + name + suffix;
  }
  void operator()(BodyDraft& b) const {
    (*this)(b.body.name);
    for (auto& x : b.body.joints) (*this)(x.name);
    for (auto& x : b.body.geoms) (*this)(x.name);
    for (auto& x : b.body.sites) (*this)(x.name);
    for (auto& x : b.body.cameras) (*this)(x.name);
    for (auto& x : b.children) (*this)(x);
  }
};

/// Joints in the order in which they will stand in qpos.
template <class F>
void for_each_joint(BodyDraft const& b, F const& f) {
  for (std::size_t i = 0; i < b.body.joints.size(); ++i) f(b.joint_ids[i], b.body.joints[i], b.body);
  for (auto const& child : b.children) for_each_joint(child, f);
}
inline int qpos_size(JointType type) { return type == JointType::free ? 7 : type == JointType::ball ? 4 : 1; }
inline int qvel_size(JointType type) { return type == JointType::free ? 6 : type == JointType::ball ? 3 : 1; }

/// Moves the contents of `from` (a body that exists only while it is read) into `to`, posed in its frame.
inline void merge(BodyDraft from, gsp::detail::Pose const& frame, BodyDraft& to) {
  using gsp::detail::Pose;
  auto const place = [&](Double3& pos, Double4& quat) {
    Pose const p = frame * Pose{pos, quat};
    pos = p.p, quat = gsp::detail::normalized(p.q);
  };
  for (auto& x : from.body.joints) x.pos = frame * x.pos, x.axis = gsp::detail::rotate(frame.q, x.axis);
  for (auto& x : from.body.geoms) place(x.pos, x.quat);
  for (auto& x : from.body.sites) place(x.pos, x.quat);
  for (auto& x : from.body.cameras) place(x.pos, x.quat);
  for (auto& x : from.children) place(x.body.pos, x.body.quat);
  auto const append = [](auto& a, auto& b) { a.insert(a.end(), std::make_move_iterator(b.begin()), std::make_move_iterator(b.end())); };
  if (from.needs_mesh.file >= 0) to.needs_mesh = from.needs_mesh;
  append(to.body.joints, from.body.joints), append(to.joint_ids, from.joint_ids), append(to.body.geoms, from.body.geoms);
  append(to.body.sites, from.body.sites), append(to.body.cameras, from.body.cameras), append(to.children, from.children);
}

}  // namespace gsp::io::detail::mjcf
