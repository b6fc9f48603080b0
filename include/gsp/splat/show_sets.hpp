#pragma once
#include <algorithm>
#include <gsp/splat/gaussians.hpp>

namespace gsp {

namespace detail {
/// No world that names so many sets shows more clusters, whichever they are.
inline int most_clusters(std::vector<GaussianSetRange> const& sets, std::size_t slots) {
  std::vector<int> clusters;
  for (auto const& s : sets) clusters.push_back(s.cluster_end - s.cluster_begin);
  std::sort(clusters.rbegin(), clusters.rend());
  int most = 0;
  for (std::size_t k = 0; k < std::min(slots, clusters.size()); ++k) most += clusters[k];
  return most;
}
}  // namespace detail

/// Many scenes in one batch: the same Gaussians, and a table of which of make_gaussians' sets each world shows. What a world does not show
/// is left out before anything is asked of it, so a picture costs what its own sets cost, and it has the bits that it would have of a cloud
/// of those sets alone.
/// @param sets_of_world  (worlds, of any length) numbers of sets, in the order in which make_gaussians was given them; empty: every world
///                       shows all again
/// The result shares all arrays with `cloud` but the table, `shown` (worlds, slots; 4 bytes each): render, see and the stages take it in
/// the place of `cloud`. A kernel may write the table anew, ascending, as when a world begins again in another scene.
/// Allocates the table; fences. Errors: std::invalid_argument for a number of no set, and one that a world names twice.
template <ExecutionSpace Exec, class Mem>
Gaussians<Mem> show_sets(Exec const& exec, Gaussians<Mem> const& cloud, std::vector<std::vector<int>> const& sets_of_world) {
  static_assert(can_access<Exec, Gaussians<Mem>>, "gsp::show_sets: the Gaussians are not accessible from this execution space");
  using View = typename Gaussians<Mem>::template View<int**>;
  auto const sets = detail::to_host(exec, cloud.sets);
  Gaussians<Mem> out = cloud;
  std::size_t const worlds = sets_of_world.size();
  if (worlds == 0) {
    out.shown = View();
    out.most_clusters = static_cast<int>(cloud.clusters.extent(0));
    out.most_count = cloud.count;
    return out;
  }
  std::size_t slots = 1;
  for (auto const& row : sets_of_world) slots = std::max(slots, row.size());
  std::vector<int> table(worlds * slots, -1);
  std::int64_t most_count = 0;
  for (std::size_t w = 0; w < worlds; ++w) {
    auto row = sets_of_world[w];
    std::sort(row.begin(), row.end());
    std::int64_t count = 0;
    for (std::size_t k = 0; k < row.size(); ++k) {
      std::string const place = "gsp::show_sets: world " + std::to_string(w) + " names set " + std::to_string(row[k]);
      expects(row[k] >= 0 && std::size_t(row[k]) < sets.size(),
              place + ", and there are " + std::to_string(sets.size()) + ", numbered from 0 as they were given");
      expects(k == 0 || row[k] != row[k - 1], place + " twice");
      table[w * slots + k] = row[k];
      count += sets[std::size_t(row[k])].count;
    }
    most_count = std::max(most_count, count);
  }
  out.most_clusters = detail::most_clusters(sets, slots);  // whatever a kernel writes there
  out.most_count = static_cast<int>(most_count);
  out.shown = detail::allocate<View>("gsp::Gaussians::shown", worlds, slots);
  detail::upload_bytes(exec, out.shown.data(), table.data(), detail::bytes_of(out.shown));
  exec.fence("gsp::show_sets: the host's table goes away");
  return out;
}

}  // namespace gsp
