#pragma once
#include <gsp/model/description.hpp>
#include <gsp/model/detail/host_math.hpp>
#include <gsp/model/detail/references.hpp>
#include <iterator>
#include <map>
#include <string>
#include <utility>
#include <vector>

/// A model while it is read: the body tree, and the lists that refer to it by name. Replicating and attaching copy pieces of it.
namespace gsp::io::detail::mjcf {

using gsp::detail::for_each_reference;
using gsp::detail::is_world;
using gsp::detail::Kind;
using gsp::detail::normalized;
using gsp::detail::own_kind;
using gsp::detail::own_name;
using gsp::detail::Pose;
using gsp::detail::operator*;
using Names = gsp::detail::NameSet;

struct BodyDraft {
  BodyDescription body;
  int id = -1;                 // of a mocap body, unique in a reading, so that keyframes of attached models find it
  std::vector<int> joint_ids;  // likewise
  std::vector<BodyDraft> children;
  Place needs_mesh;  // a mesh geom with mass that was left out
};
struct ActuatorDraft {
  ActuatorDescription actuator;
  int id = 0;
  double inheritrange = 0;
};
/// A keyframe of the whole model as it stands, or of an attached model: values by joint, actuator and mocap body.
struct KeyDraft {
  KeyframeDescription key;
  bool attached = false;
  std::map<int, std::vector<double>> qpos, qvel, act, ctrl, mpos, mquat;
};
/// The lists that refer to others by name, in the order in which they may refer to each other.
struct Lists {
  std::vector<TendonDescription> tendons;
  std::vector<ActuatorDraft> actuators;
  std::vector<PairDescription> pairs;
  std::vector<ExcludeDescription> excludes;
  std::vector<EqualityDescription> equalities;
  std::vector<SensorDescription> sensors;
  template <class F>
  static void for_each(F const& f) {  // each list as a member
    f(&Lists::tendons);
    f(&Lists::actuators);
    f(&Lists::pairs);
    f(&Lists::excludes);
    f(&Lists::equalities);
    f(&Lists::sensors);
  }
  std::size_t size() const {
    return tendons.size() + actuators.size() + pairs.size() + excludes.size() + equalities.size() + sensors.size();
  }
};
struct ModelDraft {
  std::string name;
  OptionDescription option;
  CompilerDescription compiler;
  BodyDraft world{BodyDescription::world(), -1, {}, {}, {}};
  std::vector<MeshDescription> meshes;
  std::vector<HeightFieldDescription> hfields;
  Lists lists;
  std::vector<KeyDraft> keys;
};

inline auto& description_of(ActuatorDraft& a) { return a.actuator; }
inline auto const& description_of(ActuatorDraft const& a) { return a.actuator; }
template <class T>
T& description_of(T& entry) {
  return entry;
}

/// What a subtree holds, by name.
inline void collect_names(BodyDraft const& from, Names& names, bool itself) {
  if (itself) names.add(Kind::body, from.body.name);
  for (auto const& x : from.body.joints) names.add(Kind::joint, x.name);
  for (auto const& x : from.body.geoms) names.add(Kind::geom, x.name);
  for (auto const& x : from.body.sites) names.add(Kind::site, x.name);
  for (auto const& x : from.body.cameras) names.add(Kind::camera, x.name);
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
  /// All that the subtree holds, and the camera targets inside it.
  void operator()(BodyDraft& b, Names const& inside) const {
    (*this)(b.body.name);
    for (auto& x : b.body.joints) (*this)(x.name);
    for (auto& x : b.body.geoms) (*this)(x.name);
    for (auto& x : b.body.sites) (*this)(x.name);
    for (auto& x : b.body.cameras) {
      (*this)(x.name);
      if (inside.has(Kind::body, x.target)) (*this)(x.target);
    }
    for (auto& x : b.children) (*this)(x, inside);
  }
};

/// Bodies in the order of the model, joints in the order in which they will stand in qpos.
template <class F>
void for_each_body(BodyDraft const& b, F const& f) {
  f(b);
  for (auto const& child : b.children) for_each_body(child, f);
}
template <class F>
void for_each_joint(BodyDraft const& b, F const& f) {
  for_each_body(b, [&](BodyDraft const& x) {
    for (std::size_t i = 0; i < x.body.joints.size(); ++i) f(x.joint_ids[i], x.body.joints[i], x.body);
  });
}
inline int qpos_size(JointType type) { return type == JointType::free ? 7 : type == JointType::ball ? 4 : 1; }
inline int qvel_size(JointType type) { return type == JointType::free ? 6 : type == JointType::ball ? 3 : 1; }
inline int act_size(ActuatorDescription const& a) { return a.dynamics == ActuatorDynamics::none ? 0 : 1; }

/// Moves the contents of `from` (a body that exists only while it is read) into `to`, posed in its frame.
inline void merge(BodyDraft from, Pose const& frame, BodyDraft& to) {
  auto const place = [&](Double3& pos, Double4& quat) {
    Pose const p = frame * Pose{pos, quat};
    pos = p.p;
    quat = normalized(p.q);
  };
  for (auto& x : from.body.joints) {
    x.pos = frame * x.pos;
    x.axis = gsp::detail::rotate(frame.q, x.axis);
  }
  for (auto& x : from.body.geoms) place(x.pos, x.quat);
  for (auto& x : from.body.sites) place(x.pos, x.quat);
  for (auto& x : from.body.cameras) place(x.pos, x.quat);
  for (auto& x : from.children) place(x.body.pos, x.body.quat);
  auto const append = [](auto& a, auto& b) { a.insert(a.end(), std::make_move_iterator(b.begin()), std::make_move_iterator(b.end())); };
  if (from.needs_mesh.file >= 0) to.needs_mesh = from.needs_mesh;
  append(to.body.joints, from.body.joints);
  append(to.joint_ids, from.joint_ids);
  append(to.body.geoms, from.body.geoms);
  append(to.body.sites, from.body.sites);
  append(to.body.cameras, from.body.cameras);
  append(to.children, from.children);
}

}  // namespace gsp::io::detail::mjcf
