#pragma once
#include <algorithm>
#include <array>
#include <cstdint>
#include <gsp/collision/collision_model.hpp>
#include <gsp/core/detail/views.hpp>
#include <gsp/model/detail/meeting_geoms.hpp>
#include <string>
#include <utility>
#include <vector>

/// The part of a collision model by which pairs are searched for.
namespace gsp::detail {

inline BoxTreeShape box_tree_shape(int leaves) {
  BoxTreeShape t;
  t.leaves = leaves;
  for (int n = leaves; n > 0; n = n > 8 ? (n + 7) / 8 : 0) {
    t.first[t.levels] = t.blocks;
    t.blocks += (n + 7) / 8;
    ++t.levels;
  }
  for (int level = t.levels; level < 9; ++level) t.first[level] = t.blocks;
  return t;
}

/// Along a curve that stays near what it has passed: the bits of three numbers below 1,024 in turn.
KOKKOS_INLINE_FUNCTION std::uint32_t interleave(std::uint32_t x, std::uint32_t y, std::uint32_t z) {
  auto const spread = [](std::uint32_t v) {
    v = (v | v << 16) & 0x030000ffu;
    v = (v | v << 8) & 0x0300f00fu;
    v = (v | v << 4) & 0x030c30c3u;
    return (v | v << 2) & 0x09249249u;
  };
  return spread(x) | spread(y) << 1 | spread(z) << 2;
}
/// Where a point is on that curve through a cube from `low`, `scale` cells a metre. No number is at 0.
template <class R>
KOKKOS_INLINE_FUNCTION std::uint32_t place_on_curve(R const* p, R const* low, R scale) {
  std::uint32_t cell[3];
  for (int i = 0; i < 3; ++i) {
    R const x = (p[i] - low[i]) * scale;
    cell[i] = x > R(0) ? (x < R(1023) ? std::uint32_t(x) : 1023u) : 0u;
  }
  return interleave(cell[0], cell[1], cell[2]);
}

template <class R>
class PairSearchMaker {
 public:
  PairSearchMaker(CompiledModel const& m, bool on) : m_(m), on_(on && m.pairs_searched) {}
  /// used[g] <- 1 for geoms of pairs that are searched for.
  void add_used(std::vector<char>& used) const {
    if (!on_) return;
    MeetingGeoms const meeting(m_);
    for (int const g : meeting.colliding())
      if (meeting.meets_any(g)) used[std::size_t(g)] = 1;
  }
  /// @param order, collider  geoms by collider, colliders by geom (-1: none)
  /// @param geom_set         which of `sets` sets of parameters a geom has
  /// @param mix              (g1, g2): which of the model's parameters a pair of such geoms has
  template <class Exec, class Mix>
  void make(Exec const& exec, std::vector<int> const& order, std::vector<int> const& collider, std::vector<int> const& geom_set, int sets,
            Mix const& mix, CollisionModel<R, typename Exec::memory_space>& c) const {
    if (!on_) return;
    int const n = int(order.size());
    while (c.movers < n && tree(order[std::size_t(c.movers)]) >= 0) ++c.movers;
    for (int i = 0; i < c.movers; ++i) c.moving_groups += i == 0 || tree(order[std::size_t(i)]) != tree(order[std::size_t(i) - 1]);
    if (std::int64_t const numbers = c.pairs + std::int64_t(c.movers) * n; numbers >= most_pairs)
      throw Error("gsp::make_collision_model: " + std::to_string(c.movers) + " geoms that move among " + std::to_string(n) +
                  " that collide are " + std::to_string(numbers) + " pairs, and contacts are numbered up to " + std::to_string(most_pairs) +
                  ": keep geoms apart with contype and conaffinity 0, or use fewer");
    c.moving_tree = box_tree_shape(c.movers);
    c.still_tree = box_tree_shape(n - c.movers);
    upload(exec, "filter", filters(order, collider, geom_set, exec, c), c.filter);
    upload(exec, "still_order", still_order(order, c.movers), c.still_order);
    std::vector<int> bodies;
    for (int i = c.movers; i < n; ++i) bodies.push_back(m_.geom_body[order[std::size_t(i)]]);
    std::sort(bodies.begin(), bodies.end());
    bodies.erase(std::unique(bodies.begin(), bodies.end()), bodies.end());
    upload(exec, "still_body", bodies, c.still_body);
    parameters(exec, order, geom_set, sets, mix, c);
    for (int const g : order) {
      c.most_edges = std::max(c.most_edges, 2 * (m_.geom_condim[std::size_t(g)] - 1));
      c.adhesive |= item_or(m_.geom_adhesion, g, 0.) != 0;
    }
    std::array<bool, shape_types> moves{}, is{};
    for (int i = 0; i < n; ++i) {
      int const type = m_.geom_type[std::size_t(order[std::size_t(i)])];
      is[std::size_t(type)] = true;
      moves[std::size_t(type)] |= i < c.movers;
    }
    for (auto const& pair : shape_pairs)
      if (!is_wide(pair.a) && is[std::size_t(pair.a)] && is[std::size_t(pair.b)] &&
          (moves[std::size_t(pair.a)] || moves[std::size_t(pair.b)]))
        c.has_convex_pairs |= pair.convex;
  }

 private:
  static constexpr std::int64_t most_pairs = std::int64_t(1) << 27;  // RowId::major
  static constexpr int most_sets = 128;

  int tree(int geom) const { return m_.body_tree[std::size_t(m_.geom_body[std::size_t(geom)])]; }
  template <class Exec, class T, class View>
  static void upload(Exec const& exec, char const* name, std::vector<T> const& values, View& view) {
    view = to_device<View>(exec, std::string("gsp::CollisionModel::") + name, values);
  }

  template <class Exec>
  std::vector<ColliderFilter> filters(std::vector<int> const& order, std::vector<int> const& collider, std::vector<int> const& geom_set,
                                      Exec const& exec, CollisionModel<R, typename Exec::memory_space>& c) const {
    std::vector<std::vector<int>> bodies(std::size_t(m_.nbody)), named(order.size());
    for (auto const& [a, b] : m_.excluded_bodies) {
      bodies[std::size_t(a)].push_back(b);
      bodies[std::size_t(b)].push_back(a);
    }
    for (auto const& pair : m_.named_pairs) {
      int const a = collider[std::size_t(pair.geom1)], b = collider[std::size_t(pair.geom2)];
      named[std::size_t(a)].push_back(b);
      named[std::size_t(b)].push_back(a);
    }
    std::vector<int> avoided;
    auto const append = [&](std::vector<int>& list, int& first, int& end) {
      std::sort(list.begin(), list.end());
      list.erase(std::unique(list.begin(), list.end()), list.end());
      first = int(avoided.size());
      avoided.insert(avoided.end(), list.begin(), list.end());
      end = int(avoided.size());
    };
    std::vector<std::array<int, 2>> body_list(std::size_t(m_.nbody));
    for (int b = 0; b < m_.nbody; ++b) append(bodies[std::size_t(b)], body_list[std::size_t(b)][0], body_list[std::size_t(b)][1]);
    std::vector<ColliderFilter> result;
    for (std::size_t i = 0; i < order.size(); ++i) {
      auto const g = std::size_t(order[i]), body = std::size_t(m_.geom_body[g]);
      int const weld = m_.body_weld[body], parent = m_.body_weld[std::size_t(m_.body_parent[std::size_t(weld)])];
      bool const filtered = m_.option.filterparent && weld != 0 && parent != 0;
      ColliderFilter f{m_.geom_contype[g], m_.geom_conaffinity[g], weld, filtered ? parent : -1,
                       body_list[body][0], body_list[body][1],     0,    0,
                       geom_set[g]};
      append(named[i], f.named_first, f.named_end);
      result.push_back(f);
    }
    upload(exec, "avoided", avoided, c.avoided);
    return result;
  }

  /// Those that no tree moves, in the order of the curve through where they are at first.
  std::vector<int> still_order(std::vector<int> const& order, int movers) const {
    std::vector<Transform<double>> poses;
    for (std::size_t b = 0; b < std::size_t(m_.nbody); ++b) {
      auto const& p = m_.body_pos[b];
      auto const& q = m_.body_quat[b];
      Transform<double> const own{{p[0], p[1], p[2]}, {q[0], q[1], q[2], q[3]}};
      poses.push_back(b == 0 ? own : poses[std::size_t(m_.body_parent[b])] * own);
    }
    std::vector<Vec3<double>> places;
    for (std::size_t i = std::size_t(movers); i < order.size(); ++i) {
      auto const g = std::size_t(order[i]);
      auto const& p = m_.geom_pos[g];
      places.push_back(poses[std::size_t(m_.geom_body[g])] * Vec3<double>{p[0], p[1], p[2]});
    }
    double low[3] = {}, size = 0;
    for (int i = 0; i < 3; ++i) {
      auto const less = [i](auto const& a, auto const& b) { return a[i] < b[i]; };
      if (places.empty()) break;
      low[i] = (*std::min_element(places.begin(), places.end(), less))[i];
      size = std::max(size, (*std::max_element(places.begin(), places.end(), less))[i] - low[i]);
    }
    std::vector<std::pair<std::uint32_t, int>> keys;
    for (auto const& p : places) {
      double const at[3] = {p.x, p.y, p.z};
      keys.emplace_back(place_on_curve(at, low, size > 0 ? 1024 / size : 0.), movers + int(keys.size()));
    }
    std::sort(keys.begin(), keys.end());
    std::vector<int> result;
    for (auto const& [key, c] : keys) result.push_back(c);
    return result;
  }

  /// margin + gap a collider, and the parameters of pairs: by their sets where those are few. With flag override they are in any case, as
  /// the option says the rest.
  template <class Exec, class Mix>
  void parameters(Exec const& exec, std::vector<int> const& order, std::vector<int> const& geom_set, int sets, Mix const& mix,
                  CollisionModel<R, typename Exec::memory_space>& c) const {
    std::vector<R> reach;
    for (int const g : order) {
      double const margin = m_.option.override_contacts ? m_.option.o_margin / 2 : m_.geom_margin[std::size_t(g)];
      reach.push_back(R(margin + m_.geom_gap[std::size_t(g)]));
    }
    upload(exec, "collider_reach", reach, c.collider_reach);
    if (sets > most_sets && !c.overridden) return;
    std::vector<int> first_of(std::size_t(sets), -1), table;
    for (int const g : order)
      if (int& first = first_of[std::size_t(geom_set[std::size_t(g)])]; first < 0) first = g;
    for (int const a : first_of)
      for (int const b : first_of) table.push_back(mix(a, b));
    c.sets = sets;
    upload(exec, "set_parameters", table, c.set_parameters);
  }

  CompiledModel const& m_;
  bool on_;
};

}  // namespace gsp::detail
