#pragma once
#include <algorithm>
#include <gsp/model/compiled.hpp>
#include <map>
#include <tuple>
#include <vector>

namespace gsp::detail {

/// Which geoms can meet by their filters and by what moves them: a bit of contype meets one of conaffinity, their bodies are not welded
/// together, and one of them moves. Geoms of equal filters form a group, so that what cannot meet is never compared one by one: 100,000
/// geoms that stand still cost nothing.
class MeetingGeoms {
 public:
  explicit MeetingGeoms(CompiledModel const& m) : m_(m), group_of_(std::size_t(m.ngeom), -1) {
    std::map<std::tuple<int, int, bool>, int> known;
    for (int g = 0; g < m.ngeom; ++g) {
      if (m.geom_contype[g] == 0 && m.geom_conaffinity[g] == 0) continue;
      bool const moves = m.body_dofnum[weld(g)] > 0;  // mocap bodies do not
      auto const [place, is_new] = known.try_emplace({m.geom_contype[g], m.geom_conaffinity[g], moves}, int(groups_.size()));
      if (is_new) groups_.push_back({m.geom_contype[g], m.geom_conaffinity[g], moves, {}, {}, {}});
      group_of_[std::size_t(g)] = place->second;
      groups_[std::size_t(place->second)].geoms.push_back(g);
      colliding_.push_back(g);
    }
    for (Group& group : groups_) {
      for (int k = 0; k < int(groups_.size()); ++k)
        if (can_meet(group, groups_[std::size_t(k)])) group.others.push_back(k);
      group.run_end.resize(group.geoms.size());
      for (std::size_t i = group.geoms.size(); i-- > 0;) {
        bool const last = i + 1 == group.geoms.size() || weld(group.geoms[i]) != weld(group.geoms[i + 1]);
        group.run_end[i] = last ? i + 1 : group.run_end[i + 1];
      }
    }
  }
  /// All geoms with a filter that lets them meet anything, in order.
  std::vector<int> const& colliding() const { return colliding_; }
  /// Whether it can meet any.
  bool meets_any(int a) const {
    int const group = group_of_[std::size_t(a)];
    return group >= 0 && !groups_[std::size_t(group)].others.empty();
  }
  /// later <- the geoms after `a` that it can meet, in order. Cost: what it finds, and a search a group.
  void find_later(int a, std::vector<int>& later) const { find_later(a, a, later); }
  /// later <- the geoms after `after` that `a` can meet, in order.
  void find_later(int after, int a, std::vector<int>& later) const {
    later.clear();
    int found_in = 0;
    for (int const k : groups_[std::size_t(group_of_[std::size_t(a)])].others) {
      Group const& group = groups_[std::size_t(k)];
      std::size_t const before = later.size();
      auto const first = std::upper_bound(group.geoms.begin(), group.geoms.end(), after);
      for (std::size_t i = std::size_t(first - group.geoms.begin()); i < group.geoms.size();) {
        std::size_t const end = group.run_end[i];
        if (weld(group.geoms[i]) != weld(a)) later.insert(later.end(), group.geoms.begin() + long(i), group.geoms.begin() + long(end));
        i = end;
      }
      found_in += later.size() > before;
    }
    if (found_in > 1) std::sort(later.begin(), later.end());
  }

 private:
  struct Group {
    int contype, conaffinity;
    bool moves;
    std::vector<int> geoms;            // in order
    std::vector<std::size_t> run_end;  // one past the geoms that follow each and are welded to it
    std::vector<int> others;           // groups that it can meet
  };
  static bool can_meet(Group const& a, Group const& b) {
    return (a.moves || b.moves) && ((a.contype & b.conaffinity) || (b.contype & a.conaffinity));
  }
  int weld(int geom) const { return m_.body_weld[m_.geom_body[geom]]; }

  CompiledModel const& m_;
  std::vector<int> colliding_, group_of_;
  std::vector<Group> groups_;
};

}  // namespace gsp::detail
