#pragma once
#include <algorithm>
#include <gsp/collision/contacts.hpp>
#include <string>

/// Pools of gsp/collision/contacts.hpp, where the contract stands.
namespace gsp {

namespace detail {
template <class R, class Mem>
void allocate_contacts(Contacts<R, Mem>& c, std::int64_t candidates, std::int64_t points, std::int64_t contacts) {
  constexpr std::int64_t most = 2147483647;  // contacts are counted in 32 bits
  if (candidates > most || points > most || contacts > most)
    throw Error("gsp::Contacts: more than " + std::to_string(most) + " contact points are asked for: use fewer worlds a batch");
  auto const make = [&](auto& v, std::string const& label, std::int64_t n) {
    if (std::int64_t(v.extent(0)) < n) v = allocate<std::decay_t<decltype(v)>>(label, n);
  };
  make(c.scratch.candidates, "gsp::Contacts::candidates", candidates);
  make(c.scratch.points, "gsp::Contacts::points", points);
  make(c.world, "gsp::Contacts::world", contacts);
  make(c.pair, "gsp::Contacts::pair", contacts);
  make(c.geom1, "gsp::Contacts::geom1", contacts);
  make(c.geom2, "gsp::Contacts::geom2", contacts);
  make(c.body1, "gsp::Contacts::body1", contacts);
  make(c.body2, "gsp::Contacts::body2", contacts);
  make(c.pos, "gsp::Contacts::pos", contacts);
  make(c.frame, "gsp::Contacts::frame", contacts);
  make(c.includemargin, "gsp::Contacts::includemargin", contacts);
  make(c.feature, "gsp::Contacts::feature", contacts);
  if (c.steady) make(c.lift, "gsp::Contacts::lift", contacts);
  if (c.adhesive) make(c.adhesion, "gsp::Contacts::adhesion", contacts);
  if (c.moving) make(c.surfacevel, "gsp::Contacts::surfacevel", contacts);
  make(c.dist, "gsp::Contacts::dist", contacts);  // last: it says how much room there is, and each of these may throw
}
}  // namespace detail

template <ExecutionSpace Exec, class R, class Mem>
Contacts<R, Mem> make_contacts(Exec const& exec, CollisionModel<R, Mem> const& model, ContactsOptions options) {
  expects(options.worlds > 0, "gsp::make_contacts: worlds must be positive and is " + std::to_string(options.worlds));
  expects(options.points_per_box_pair == 4 || options.points_per_box_pair == 8, "gsp::make_contacts: points_per_box_pair must be 4 or 8");
  Contacts<R, Mem> c;
  c.points_per_box_pair = options.points_per_box_pair;
  c.steady = options.steady;
  c.stamp = detail::make_stamp<detail::ContactsStamp>("gsp::Contacts::stamp");
  int const worlds = c.worlds = options.worlds;
  c.adhesive = model.adhesive;
  c.moving = model.collider_surface.extent(0) > 0;
  auto const make = [&](auto& v, std::string const& label, std::size_t n) {
    v = detail::allocate_zero<std::decay_t<decltype(v)>>(exec, label, n);
  };
  make(c.first, "gsp::Contacts::first", worlds);
  make(c.end, "gsp::Contacts::end", worlds);
  make(c.status, "gsp::Contacts::status", worlds);
  auto& bounds = c.scratch.bounds;
  auto const make_bounds = [&](auto& v, std::string const& label, auto... extents) {
    v = detail::allocate_zero<std::decay_t<decltype(v)>>(exec, label, worlds, extents...);
  };
  make_bounds(bounds.pose, "gsp::Contacts::collider_pose", model.colliders);
  make_bounds(bounds.box, "gsp::Contacts::collider_box", 6, model.colliders + bounds.box_room);
  make_bounds(bounds.group, "gsp::Contacts::group_box", 6, model.groups + bounds.box_room);
  std::size_t const items = std::size_t(model.chunks) * worlds;
  make(c.scratch.mask, "gsp::Contacts::mask", items);
  make(c.scratch.first, "gsp::Contacts::item_first", items + std::size_t(model.movers) * worlds);
  make(c.scratch.lost, "gsp::Contacts::lost", worlds);
  make(c.scratch.total, "gsp::Contacts::total", 3);
  make(c.scratch.most, "gsp::Contacts::most", 3);
  c.search = detail::make_pair_search(exec, model, worlds);
  // Guess: a collider is near two others, half of a candidate's room is used. Where pairs are searched for, a mover is near eight, which
  // give four points.
  std::int64_t const listed = std::min<std::int64_t>(model.pairs, 2 * (model.movers > 0 ? model.movers : model.colliders) + 8);
  std::int64_t const near = listed + 8 * model.movers;
  std::int64_t const room = (model.pairs > 0 ? (listed * model.slots + model.pairs - 1) / model.pairs : 0) + 32 * model.movers;
  std::int64_t const w = worlds;
  std::int64_t const candidates = w * (options.candidates_per_world > 0 ? options.candidates_per_world : near);
  std::int64_t const points = w * (options.points_per_world > 0 ? options.points_per_world : room);
  detail::allocate_contacts(c, candidates, points, w * (options.contacts_per_world > 0 ? options.contacts_per_world : (room + 1) / 2));
  return c;
}

template <ExecutionSpace Exec, class R, class Mem>
bool grow(Exec const& exec, Contacts<R, Mem>& contacts) {
  auto const most = detail::to_host(exec, contacts.scratch.most);
  std::size_t const have[3] = {contacts.scratch.candidates.extent(0), contacts.scratch.points.extent(0), contacts.dist.extent(0)};
  std::int64_t room[3];
  bool grows = false;
  for (int i = 0; i < 3; ++i) {
    room[i] = std::max(std::int64_t(have[i]), most[i] + most[i] / 2);
    grows |= most[i] > std::int64_t(have[i]);
  }
  if (!grows) return false;
  detail::allocate_contacts(contacts, room[0], room[1], room[2]);
  detail::zero(exec, contacts.scratch.most);
  if (contacts.stamp.data()) {
    contacts.stamp().made = detail::next_moment();
    contacts.stamp().lost = true;
  }
  return true;
}

}  // namespace gsp
