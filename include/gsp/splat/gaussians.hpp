#pragma once
#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <gsp/core/check.hpp>
#include <gsp/core/detail/spread_bits.hpp>
#include <gsp/core/detail/views.hpp>
#include <limits>
#include <numeric>
#include <string>
#include <tuple>
#include <vector>

namespace gsp {

/// Gaussians on the host, editable. n = size(), K = (sh_degree + 1)^2. Each stands in the frame of its body.
struct GaussianSet {
  int sh_degree = 0;             // 0-3
  std::vector<float> positions;  // (n, 3) [m]
  std::vector<float> quats;      // (n, 4) w x y z, unit; turns the Gaussian's axes into the body's frame
  std::vector<float> scales;     // (n, 3) standard deviations along its axes [m]
  std::vector<float> opacities;  // (n)    0..1
  std::vector<float> sh;  // (n, K, 3) term-major, then r g b; colour = 1/2 + sum_k sh_k Y_k(direction from the eye, in the body's frame)
  std::vector<int> body;  // (n)    body index of the model; 0: the world, static

  std::size_t size() const { return opacities.size(); }
};

/// Up to 256 neighbouring Gaussians of one set and body: what is culled together. Bounds stand in the body's frame.
struct GaussianCluster {
  int begin, end, body;
  float x, y, z, radius;  // ball around the centres
  float scale;            // greatest standard deviation
};

/// What one of the sets of make_gaussians became.
struct GaussianSetRange {
  int cluster_begin, cluster_end;
  int count;  // of Gaussians
};

/// Gaussians on a device: one copy for all worlds. Those of body 0 are static, the others move with their link, also in one copy: nothing
/// is stored per world but, if it is wanted, which sets it shows (show_sets.hpp). Stored by set and body, along a Z-order curve, in
/// clusters; `source` names the index that each had in the input, which decides ties of depth. Made by `make_gaussians`.
template <class Mem>
struct Gaussians {
  using memory_space = Mem;
  template <class D>
  using View = Kokkos::View<D, Kokkos::LayoutRight, Mem>;
  static constexpr int padding = 16;        // a CPU loads a pack at a time
  static constexpr int cluster_size = 256;  // at most
  int count = 0, sh_degree = 0;
  int bodies = 1;  // one more than the greatest body index
  // component first, so that neighbours stand together; rows are longer than n = count by `padding` (power -infinity: never seen)
  View<float**> positions;  // (3, n + padding)
  View<float**> quats;      // (4, n + padding)
  View<float**> scales;     // (3, n + padding)
  View<float*> power;       // (n + padding) log2 of the opacity
  View<float**> sh;         // (3 K, n + padding): row 3 k + channel
  View<int*> source;        // (n)
  View<GaussianCluster*> clusters;
  View<GaussianSetRange*> sets;
  View<int**> shown;      // (world, slot) the sets that a world shows, ascending, each once; -1: none. (0, 0): every world shows all
  int most_clusters = 0;  // no world shows more, whatever the table holds
  int most_count = 0;     // Gaussians that a world shows, at most, when the table was made: a hint

  /// The k-th cluster that a world shows, for k < most_clusters; -1 where it has fewer.
  KOKKOS_INLINE_FUNCTION int cluster_of(int world, int k) const {
    if (shown.extent(0) == 0) return k;
    for (int slot = 0; slot < int(shown.extent(1)); ++slot) {
      int const s = shown(world, slot);
      if (s < 0 || s >= int(sets.extent(0))) continue;
      GaussianSetRange const range = sets(s);
      int const own = range.cluster_end - range.cluster_begin;
      if (k < own) return range.cluster_begin + k;
      k -= own;
    }
    return -1;
  }
};

namespace detail {

inline void check_gaussian_set(std::string const& function, GaussianSet const& s, std::size_t which) {
  std::string const name = function + ": set " + std::to_string(which);
  std::size_t const n = s.size();
  expects(s.sh_degree >= 0 && s.sh_degree <= 3, name + " has SH degree " + std::to_string(s.sh_degree) + "; it must be 0, 1, 2 or 3");
  std::size_t const terms = static_cast<std::size_t>((s.sh_degree + 1) * (s.sh_degree + 1));
  expects(s.positions.size() == 3 * n && s.quats.size() == 4 * n && s.scales.size() == 3 * n && s.sh.size() == 3 * terms * n &&
              s.body.size() == n,
          name + ": its arrays disagree about the number of Gaussians (" + std::to_string(n) + " opacities); resize them together");
  // sentences are made of what is wrong alone: a set has millions of numbers
  auto const all = [&](std::size_t count, auto const& fine, auto const& sentence) {
    for (std::size_t i = 0; i < count; ++i)
      if (!fine(i)) expects(false, name + ": " + sentence(i));
  };
  auto const numbered = [](std::size_t i) { return "Gaussian " + std::to_string(i); };
  auto const finite = [&](std::vector<float> const& v, std::string const& what) {
    all(
        v.size(), [&](std::size_t i) { return std::isfinite(v[i]); },
        [&](std::size_t i) { return numbered(i * n / v.size()) + " has a " + what + " that is not finite; remove it"; });
  };
  finite(s.positions, "position");
  finite(s.quats, "rotation");
  finite(s.scales, "scale");
  all(
      s.scales.size(), [&](std::size_t i) { return s.scales[i] >= 0; },
      [&](std::size_t i) { return numbered(i / 3) + " has a negative scale; a deviation is 0 or more"; });
  finite(s.opacities, "opacity");
  finite(s.sh, "colour");
  all(
      n, [&](std::size_t i) { return s.body[i] >= 0; },
      [&](std::size_t i) { return numbered(i) + " has body " + std::to_string(s.body[i]) + "; 0 is the world, links follow"; });
  all(
      n, [&](std::size_t i) { return s.opacities[i] >= 0 && s.opacities[i] <= 1; },
      [&](std::size_t i) { return numbered(i) + " has an opacity outside 0..1; repair it"; });
  auto const turns = [&](std::size_t i) {
    float const* const q = &s.quats[4 * i];
    return q[0] != 0 || q[1] != 0 || q[2] != 0 || q[3] != 0;
  };
  all(n, turns, [&](std::size_t i) { return "the rotation of " + numbered(i) + " has length 0; set it to 1 0 0 0"; });
}

}  // namespace detail

/// Takes sets of Gaussians to the device as one: scenes, robots, objects. The higher SH degree wins (missing terms are 0).
/// Throws std::invalid_argument where arrays disagree, a value is not finite, or a body is negative. Host cost: a sort, about 0.1 s per
/// million.
template <ExecutionSpace Exec>
Gaussians<typename Exec::memory_space> make_gaussians(Exec const& exec, std::vector<GaussianSet> const& sets) {
  using Mem = typename Exec::memory_space;
  using G = Gaussians<Mem>;
  std::size_t total = 0;
  G g;
  for (std::size_t s = 0; s < sets.size(); ++s) {
    detail::check_gaussian_set("gsp::make_gaussians", sets[s], s);
    total += sets[s].size();
    g.sh_degree = std::max(g.sh_degree, sets[s].sh_degree);
    for (int b : sets[s].body) g.bodies = std::max(g.bodies, b + 1);
  }
  expects(total < (std::size_t(1) << 30), "gsp::make_gaussians: at most 2^30 Gaussians are supported, not " + std::to_string(total));
  int const n = g.count = static_cast<int>(total), terms = (g.sh_degree + 1) * (g.sh_degree + 1);

  // order: set, body, then along the curve, then as given
  struct Item {
    std::uint64_t curve;
    int body, set, local, source;
  };
  std::vector<Item> items;
  items.reserve(total);
  for (std::size_t s = 0; s < sets.size(); ++s)
    for (std::size_t i = 0; i < sets[s].size(); ++i) items.push_back({0, sets[s].body[i], int(s), int(i), int(items.size())});
  auto const at = [&](Item const& k) { return &sets[k.set].positions[3 * std::size_t(k.local)]; };
  constexpr float infinity = std::numeric_limits<float>::infinity();
  std::vector<std::array<float, 6>> boxes(sets.size() * std::size_t(g.bodies),
                                          {infinity, infinity, infinity, -infinity, -infinity, -infinity});
  auto const box_of = [&](Item const& k) -> std::array<float, 6>& {
    return boxes[std::size_t(k.set) * std::size_t(g.bodies) + std::size_t(k.body)];
  };
  for (auto const& k : items) {
    auto& b = box_of(k);
    for (int c = 0; c < 3; ++c) {
      b[c] = std::min(b[c], at(k)[c]);
      b[3 + c] = std::max(b[3 + c], at(k)[c]);
    }
  }
  for (auto& k : items) {
    auto const& b = box_of(k);
    double const side = std::max({double(b[3]) - b[0], double(b[4]) - b[1], double(b[5]) - b[2], 1e-30});
    for (int c = 0; c < 3; ++c)
      k.curve |= detail::spread_bits(static_cast<std::uint64_t>((double(at(k)[c]) - b[c]) / side * 0x1fffff)) << c;
  }
  std::sort(items.begin(), items.end(), [](Item const& a, Item const& b) {
    return std::tie(a.set, a.body, a.curve, a.source) < std::tie(b.set, b.body, b.curve, b.source);
  });

  auto const fresh = [](std::string const& label) { return Kokkos::view_alloc(Kokkos::WithoutInitializing, label); };
  g.positions = typename G::template View<float**>(fresh("gsp::Gaussians::positions"), 3, n + G::padding);
  g.quats = typename G::template View<float**>(fresh("gsp::Gaussians::quats"), 4, n + G::padding);
  g.scales = typename G::template View<float**>(fresh("gsp::Gaussians::scales"), 3, n + G::padding);
  g.power = typename G::template View<float*>(fresh("gsp::Gaussians::power"), n + G::padding);
  g.sh = typename G::template View<float**>(fresh("gsp::Gaussians::sh"), 3 * terms, n + G::padding);
  g.source = typename G::template View<int*>(fresh("gsp::Gaussians::source"), n);
  Kokkos::HostSpace const host;
  auto const positions = Kokkos::create_mirror_view(host, g.positions), quats = Kokkos::create_mirror_view(host, g.quats),
             scales = Kokkos::create_mirror_view(host, g.scales), sh = Kokkos::create_mirror_view(host, g.sh);
  auto const power = Kokkos::create_mirror_view(host, g.power);
  auto const source = Kokkos::create_mirror_view(host, g.source);
  std::vector<GaussianCluster> clusters;
  std::vector<GaussianSetRange> ranges(sets.size());
  for (int i = 0; i < n; ++i) {
    auto const& k = items[i];
    auto const& s = sets[k.set];
    std::size_t const j = static_cast<std::size_t>(k.local), old = static_cast<std::size_t>((s.sh_degree + 1) * (s.sh_degree + 1));
    float const* q = &s.quats[4 * j];
    double const norm = std::sqrt(double(q[0]) * q[0] + double(q[1]) * q[1] + double(q[2]) * q[2] + double(q[3]) * q[3]);
    for (int c = 0; c < 3; ++c) {
      positions(c, i) = s.positions[3 * j + c];
      scales(c, i) = s.scales[3 * j + c];
    }
    for (int c = 0; c < 4; ++c) quats(c, i) = static_cast<float>(q[c] / norm);
    power(i) = static_cast<float>(std::log2(double(s.opacities[j])));
    for (int t = 0; t < 3 * terms; ++t) sh(t, i) = t < int(3 * old) ? s.sh[3 * old * j + t] : 0.f;
    source(i) = k.source;
    auto& range = ranges[k.set];
    if (range.count++ == 0) range.cluster_begin = int(clusters.size());
    if (range.count == 1 || clusters.back().body != k.body || clusters.back().end - clusters.back().begin == G::cluster_size)
      clusters.push_back({i, i, k.body, 0, 0, 0, 0, 0});
    clusters.back().end = i + 1;
    range.cluster_end = int(clusters.size());
  }
  for (int i = n; i < n + G::padding; ++i) {
    for (int c = 0; c < 3; ++c) {
      positions(c, i) = 0;
      scales(c, i) = 0;
    }
    for (int c = 0; c < 4; ++c) quats(c, i) = c == 0;
    for (int t = 0; t < 3 * terms; ++t) sh(t, i) = 0;
    power(i) = -infinity;
  }
  for (auto& c : clusters) {
    float low[3]{infinity, infinity, infinity}, high[3]{-infinity, -infinity, -infinity};
    for (int i = c.begin; i < c.end; ++i)
      for (int a = 0; a < 3; ++a) {
        low[a] = std::min(low[a], positions(a, i));
        high[a] = std::max(high[a], positions(a, i));
        c.scale = std::max(c.scale, scales(a, i));
      }
    c.x = 0.5f * low[0] + 0.5f * high[0];
    c.y = 0.5f * low[1] + 0.5f * high[1];
    c.z = 0.5f * low[2] + 0.5f * high[2];
    double radius = 0;
    for (int i = c.begin; i < c.end; ++i) {
      double const dx = double(positions(0, i)) - c.x, dy = double(positions(1, i)) - c.y, dz = double(positions(2, i)) - c.z;
      radius = std::max(radius, std::sqrt(dx * dx + dy * dy + dz * dz));
    }
    c.radius = std::nextafter(static_cast<float>(radius), infinity);
  }
  g.clusters = typename G::template View<GaussianCluster*>(fresh("gsp::Gaussians::clusters"), clusters.size());
  g.sets = typename G::template View<GaussianSetRange*>(fresh("gsp::Gaussians::sets"), ranges.size());
  g.most_clusters = int(clusters.size());
  g.most_count = n;
  auto const upload = [&](auto const& to, auto const* from) { detail::upload_bytes(exec, to.data(), from, detail::bytes_of(to)); };
  upload(g.positions, positions.data());
  upload(g.quats, quats.data());
  upload(g.scales, scales.data());
  upload(g.power, power.data());
  upload(g.sh, sh.data());
  upload(g.source, source.data());
  upload(g.clusters, clusters.data());
  upload(g.sets, ranges.data());
  exec.fence("gsp::make_gaussians: the host arrays go away");
  return g;
}

template <ExecutionSpace Exec>
Gaussians<typename Exec::memory_space> make_gaussians(Exec const& exec, GaussianSet const& set) {
  return make_gaussians(exec, std::vector<GaussianSet>{set});
}

}  // namespace gsp
