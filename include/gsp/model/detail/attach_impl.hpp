#pragma once
#include <algorithm>
#include <gsp/core/check.hpp>
#include <gsp/core/detail/compiled.hpp>
#include <gsp/model/attach.hpp>
#include <gsp/model/description.hpp>
#include <gsp/model/detail/host_math.hpp>
#include <gsp/model/detail/references.hpp>
#include <iterator>
#include <string>
#include <utility>
#include <vector>

namespace gsp {

GSP_INLINE int add_body(Description& d, int parent, std::string name, Double3 const& pos) {
  expects(parent >= 0 && parent < int(d.bodies.size()), "gsp::add_body: there is no body " + std::to_string(parent) +
                                                            " to be the parent of '" + name + "'; the description has " +
                                                            std::to_string(d.bodies.size()) + ", from 0, the world, on");
  BodyDescription body;
  body.name = std::move(name);
  body.parent = parent;
  body.pos = pos;
  d.bodies.push_back(std::move(body));
  return int(d.bodies.size()) - 1;
}

GSP_INLINE std::vector<double> initial_qpos(Description const& d) {
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

GSP_INLINE void attach(Description& to, Description const& piece, AttachOptions const& options) {
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
    pos = p.p;
    quat = detail::normalized(p.q);
  };
  int const files = int(to.files.size());
  auto const adopt = [&](std::string& name, Place& from) {
    if (!name.empty()) name = options.prefix + name;
    if (from.file >= 0) from.file += files;
  };
  to.files.insert(to.files.end(), piece.files.begin(), piece.files.end());
  auto bodies = piece.bodies;
  auto const prefixed = [&](std::string& name) {
    if (!name.empty()) name = options.prefix + name;
  };
  for (auto& b : bodies) {
    adopt(b.name, b.place);
    for (auto& x : b.joints) {
      adopt(x.name, x.place);
      if (x.type == JointType::free && target != 0)
        throw Error("attach: body '" + b.name + "' has a free joint and would hang on body '" + options.body +
                    "': attach it to the world or remove the joint");
    }
    for (auto& x : b.geoms) {
      adopt(x.name, x.place);
      prefixed(x.mesh);
      prefixed(x.hfield);
    }
    for (auto& x : b.sites) adopt(x.name, x.place);
    for (auto& x : b.cameras) {
      adopt(x.name, x.place);
      if (x.target != "world") prefixed(x.target);
    }
    if (b.mocap && target != 0)
      throw Error("attach: body '" + b.name + "' is a mocap body and would hang on body '" + options.body + "': attach it to the world");
    if (b.parent == 0) move(b.pos, b.quat);
    b.parent = b.parent == 0 ? target : b.parent + end - 1;
  }
  auto& world = bodies[0];
  for (auto& x : world.geoms) move(x.pos, x.quat);
  for (auto& x : world.sites) move(x.pos, x.quat);
  for (auto& x : world.cameras) move(x.pos, x.quat);
  auto const append = [](auto& a, auto& b) { a.insert(a.end(), std::make_move_iterator(b.begin()), std::make_move_iterator(b.end())); };
  auto& host = to.bodies[target];
  append(host.geoms, world.geoms);
  append(host.sites, world.sites);
  append(host.cameras, world.cameras);

  Description moved;  // the piece where it now stands, for its initial qpos
  moved.bodies = bodies;
  auto const piece_q = initial_qpos(moved), host_q = initial_qpos(to);
  int const piece_v = [&] {
    int n = 0;
    for (auto const& b : piece.bodies)
      for (auto const& j : b.joints) n += j.type == JointType::free ? 6 : j.type == JointType::ball ? 3 : 1;
    return n;
  }();
  struct Sizes {
    std::size_t u = 0, na = 0, mocap = 0;  // controls, activations, mocap bodies
  };
  auto const sizes_of = [](Description const& d, std::size_t bodies) {
    Sizes n{d.actuators.size(), 0, 0};
    for (auto const& a : d.actuators) n.na += a.dynamics != ActuatorDynamics::none;
    for (std::size_t b = 0; b < bodies; ++b) n.mocap += d.bodies[b].mocap;
    return n;
  };
  Sizes const mine = sizes_of(to, to.bodies.size()), guest = sizes_of(piece, piece.bodies.size());
  std::size_t const mocap_at = sizes_of(to, std::size_t(end)).mocap;
  auto const mocap_poses = [](std::vector<BodyDescription> const& of) {
    std::array<std::vector<double>, 2> all;
    for (auto const& b : of)
      if (b.mocap) {
        auto const q = detail::normalized(b.quat);
        all[0].insert(all[0].end(), b.pos.begin(), b.pos.end());
        all[1].insert(all[1].end(), q.begin(), q.end());
      }
    return all;
  };
  auto const piece_mocap = mocap_poses(bodies), host_mocap = mocap_poses(to.bodies);

  int const added = int(bodies.size()) - 1;
  for (int b = end; b < int(to.bodies.size()); ++b)
    if (to.bodies[b].parent >= end) to.bodies[b].parent += added;
  to.bodies.insert(to.bodies.begin() + end, std::make_move_iterator(bodies.begin() + 1), std::make_move_iterator(bodies.end()));

  auto const adopt_all = [&](auto const& from, auto& into) {
    for (auto entry : from) {
      if (entry.place.file >= 0) entry.place.file += files;
      if (auto* name = detail::own_name(entry)) prefixed(*name);
      detail::for_each_reference(entry, [&](detail::Kind kind, std::string& name) {
        if (!detail::is_world(kind, name)) prefixed(name);
      });
      into.push_back(std::move(entry));
    }
  };
  adopt_all(piece.tendons, to.tendons);
  adopt_all(piece.actuators, to.actuators);
  adopt_all(piece.excludes, to.excludes);
  adopt_all(piece.equalities, to.equalities);
  adopt_all(piece.pairs, to.pairs);
  adopt_all(piece.sensors, to.sensors);
  auto const adopt_assets = [&](auto const& from, auto& into) {
    for (auto asset : from) {
      adopt(asset.name, asset.place);
      if (std::none_of(into.begin(), into.end(), [&](auto const& x) { return x.name == asset.name; })) into.push_back(std::move(asset));
    }
  };
  adopt_assets(piece.meshes, to.meshes);
  adopt_assets(piece.hfields, to.hfields);
  auto const insert = [](std::vector<double>& into, int at, std::vector<double> const& what) {
    if (!into.empty()) into.insert(into.begin() + at, what.begin(), what.end());
  };
  auto const zeros = [](std::size_t n) { return std::vector<double>(n, 0.); };
  for (auto& k : to.keyframes) {
    insert(k.qpos, q_at, piece_q);
    insert(k.qvel, v_at, zeros(std::size_t(piece_v)));
    insert(k.ctrl, int(mine.u), zeros(guest.u));
    insert(k.act, int(mine.na), zeros(guest.na));
    insert(k.mpos, int(3 * mocap_at), piece_mocap[0]);
    insert(k.mquat, int(4 * mocap_at), piece_mocap[1]);
  }
  for (auto k : piece.keyframes) {
    adopt(k.name, k.place);
    auto const around = [](std::vector<double>& mine, std::vector<double> all, int at) {
      if (mine.empty()) return;
      all.insert(all.begin() + at, mine.begin(), mine.end());
      mine = std::move(all);
    };
    around(k.qpos, host_q, q_at);
    around(k.qvel, zeros(std::size_t(nv)), v_at);
    around(k.ctrl, zeros(mine.u), int(mine.u));
    around(k.act, zeros(mine.na), int(mine.na));
    around(k.mpos, host_mocap[0], int(3 * mocap_at));
    around(k.mquat, host_mocap[1], int(4 * mocap_at));
    to.keyframes.push_back(std::move(k));
  }
}

}  // namespace gsp
