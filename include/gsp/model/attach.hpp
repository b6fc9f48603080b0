#pragma once
#include <algorithm>
#include <gsp/core/check.hpp>
#include <gsp/model/description.hpp>
#include <gsp/model/detail/host_math.hpp>
#include <iterator>
#include <string>
#include <utility>
#include <vector>

namespace gsp {

/// Adds an empty body below `parent` (an index) at the end of the tree and returns its index. Depth-first order asks that `parent` is the
/// last body or one of its ancestors. The reference to the body itself (description.bodies[index]) holds until the next one is added.
inline int add_body(Description& d, int parent, std::string name, Double3 const& pos = {0, 0, 0}) {
  BodyDescription body;
  body.name = std::move(name), body.parent = parent, body.pos = pos;
  d.bodies.push_back(std::move(body));
  return int(d.bodies.size()) - 1;
}

/// qpos of the initial pose: free joints take their body's pose, ball joints the identity, others their `ref`. MuJoCo's order.
inline std::vector<double> initial_qpos(Description const& d) {
  std::vector<double> q;
  for (auto const& body : d.bodies)
    for (auto const& joint : body.joints) {
      if (joint.type == JointType::free) q.insert(q.end(), body.pos.begin(), body.pos.end());
      auto const turn = joint.type == JointType::free ? detail::normalized(body.quat) : Double4{1, 0, 0, 0};
      if (joint.type <= JointType::ball)
        q.insert(q.end(), turn.begin(), turn.end());
      else
        q.push_back(joint.ref);
    }
  return q;
}

struct AttachOptions {
  std::string body = "world";  // what it hangs on
  std::string prefix = "";     // put before every name of the piece
  Double3 pos{0, 0, 0};        // of the piece's world in the frame of `body`
  Double4 quat{1, 0, 0, 0};
};

/// Puts all of `piece` into `to`: its bodies below the body named, its world's geoms, sites and cameras into that body. Its settings are
/// left behind. Keyframes of both stay: each keeps its own part and gives the other's part its initial values. Cost O(size of both).
/// Errors: gsp::Error where the body does not exist, or a free joint would end up below a body other than the world.
inline void attach(Description& to, Description const& piece, AttachOptions const& options = {}) {
  auto const place = std::find_if(to.bodies.begin(), to.bodies.end(), [&](auto const& b) { return b.name == options.body; });
  if (place == to.bodies.end()) throw Error("attach: there is no body '" + options.body + "' to attach to: correct the name");
  int const target = int(place - to.bodies.begin());
  int end = target + 1;  // behind the target's subtree
  while (end < int(to.bodies.size()) && to.bodies[end].parent >= target) ++end;

  auto const size_before = [&](int bodies) {
    std::array<int, 2> n{0, 0};
    for (int b = 0; b < bodies; ++b)
      for (auto const& j : to.bodies[b].joints) {
        n[0] += j.type == JointType::free ? 7 : j.type == JointType::ball ? 4 : 1;
        n[1] += j.type == JointType::free ? 6 : j.type == JointType::ball ? 3 : 1;
      }
    return n;
  };
  auto const [q_at, v_at] = size_before(end);
  auto const [nq, nv] = size_before(int(to.bodies.size()));
  (void)nq;

  detail::Pose const frame{options.pos, detail::normalized(options.quat)};
  auto const move = [&](Double3& pos, Double4& quat) {
    auto const p = frame * detail::Pose{pos, quat};
    pos = p.p, quat = detail::normalized(p.q);
  };
  int const files = int(to.files.size());
  auto const adopt = [&](std::string& name, Place& from) {
    if (!name.empty()) name = options.prefix + name;
    if (from.file >= 0) from.file += files;
  };
  to.files.insert(to.files.end(), piece.files.begin(), piece.files.end());
  auto bodies = piece.bodies;
  for (auto& b : bodies) {
    adopt(b.name, b.place);
    for (auto& x : b.joints) {
      adopt(x.name, x.place);
      if (x.type == JointType::free && target != 0)
        throw Error("attach: body '" + b.name + "' has a free joint and would hang on body '" + options.body +
                    "': attach it to the world or remove the joint");
    }
    for (auto& x : b.geoms) adopt(x.name, x.place);
    for (auto& x : b.sites) adopt(x.name, x.place);
    for (auto& x : b.cameras) adopt(x.name, x.place);
    if (b.parent == 0) move(b.pos, b.quat);
    b.parent = b.parent == 0 ? target : b.parent + end - 1;
  }
  auto& world = bodies[0];
  for (auto& x : world.geoms) move(x.pos, x.quat);
  for (auto& x : world.sites) move(x.pos, x.quat);
  for (auto& x : world.cameras) move(x.pos, x.quat);
  auto const append = [](auto& a, auto& b) { a.insert(a.end(), std::make_move_iterator(b.begin()), std::make_move_iterator(b.end())); };
  auto& host = to.bodies[target];
  append(host.geoms, world.geoms), append(host.sites, world.sites), append(host.cameras, world.cameras);

  Description moved;  // the piece where it now stands, for its initial qpos
  moved.bodies = bodies;
  auto const piece_q = initial_qpos(moved), host_q = initial_qpos(to);
  int const piece_v = [&] {
    int n = 0;
    for (auto const& b : piece.bodies)
      for (auto const& j : b.joints) n += j.type == JointType::free ? 6 : j.type == JointType::ball ? 3 : 1;
    return n;
  }();
  std::size_t const host_u = to.actuators.size(), piece_u = piece.actuators.size();

  int const added = int(bodies.size()) - 1;
  for (int b = end; b < int(to.bodies.size()); ++b)
    if (to.bodies[b].parent >= end) to.bodies[b].parent += added;
  to.bodies.insert(to.bodies.begin() + end, std::make_move_iterator(bodies.begin() + 1), std::make_move_iterator(bodies.end()));

  for (auto t : piece.tendons) {
    adopt(t.name, t.place);
    for (auto& term : t.terms) term.joint = options.prefix + term.joint;
    to.tendons.push_back(std::move(t));
  }
  for (auto a : piece.actuators) {
    adopt(a.name, a.place), a.target_name = options.prefix + a.target_name;
    to.actuators.push_back(std::move(a));
  }
  for (auto e : piece.excludes) {
    adopt(e.body1, e.place), e.body2 = options.prefix + e.body2;
    to.excludes.push_back(std::move(e));
  }
  auto const insert = [](std::vector<double>& into, int at, std::vector<double> const& what) {
    if (!into.empty()) into.insert(into.begin() + at, what.begin(), what.end());
  };
  for (auto& k : to.keyframes) {
    insert(k.qpos, q_at, piece_q), insert(k.qvel, v_at, std::vector<double>(std::size_t(piece_v), 0.));
    insert(k.ctrl, int(host_u), std::vector<double>(piece_u, 0.));
  }
  for (auto k : piece.keyframes) {
    adopt(k.name, k.place);
    auto const around = [](std::vector<double>& mine, std::vector<double> all, int at) {
      if (mine.empty()) return;
      all.insert(all.begin() + at, mine.begin(), mine.end());
      mine = std::move(all);
    };
    around(k.qpos, host_q, q_at), around(k.qvel, std::vector<double>(std::size_t(nv), 0.), v_at),
        around(k.ctrl, std::vector<double>(host_u, 0.), int(host_u));
    to.keyframes.push_back(std::move(k));
  }
}

}  // namespace gsp
