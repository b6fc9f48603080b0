#pragma once
#include <algorithm>
#include <cmath>
#include <gsp/io/detail/bytes.hpp>
#include <limits>
#include <map>
#include <string>
#include <vector>

namespace gsp::io {

/// Y_0^0, the constant of the first SH term: colour = 0.28209479 dc + 0.5.
inline constexpr double sh_c0 = 0.28209479177387814;

/// Gaussians on the host, as every reader delivers them. n = size(), K = sh_terms() = (sh_degree + 1)^2.
/// Axes and handedness are the file's own (3DGS captures: x right, y down, z forward); lengths in the file's unit.
struct SplatSet {
  int sh_degree = 0;             // 0-3
  std::vector<float> positions;  // (n, 3)
  std::vector<float> quats;      // (n, 4)  w, x, y, z; unit length; rotates the Gaussian's axes into the set's frame
  std::vector<float> scales;     // (n, 3)  standard deviations along its axes, linear
  std::vector<float> opacities;  // (n)     0..1
  std::vector<float> sh;         // (n, K, 3)  term-major, then r g b; term 0 is DC
  std::vector<int> link;         // (n)     -1: static (world); else an index into link_names, and the Gaussian stands in that link's frame
  std::vector<std::string> link_names;
  bool antialiased = false;  // trained with a filter of a pixel's size (Mip-Splatting): kept for files that say so, drawn as others are
  std::vector<std::string> notes;  // what the reader left out or ignored, one sentence each (the load report)

  std::size_t size() const { return opacities.size(); }
  std::size_t sh_terms() const { return static_cast<std::size_t>((sh_degree + 1) * (sh_degree + 1)); }
};

/// n Gaussians of zero size, all static: what readers and generators fill.
inline SplatSet make_splat_set(std::size_t n, int sh_degree) {
  expects(sh_degree >= 0 && sh_degree <= 3, "gsp::io::make_splat_set: sh_degree must be 0, 1, 2 or 3");
  SplatSet set;
  set.sh_degree = sh_degree;
  set.positions.resize(n * 3);
  set.quats.resize(n * 4);
  for (std::size_t i = 0; i < n; ++i) set.quats[4 * i] = 1;
  set.scales.resize(n * 3);
  set.opacities.resize(n);
  set.sh.resize(n * set.sh_terms() * 3);
  set.link.resize(n, -1);
  return set;
}

/// Throws Error unless the set is what SplatSet says: sizes agree, all finite, scales >= 0, 0 <= opacity <= 1, |q| = 1 within 1e-3,
/// links inside link_names, and names that can stand in a text file. `name` is what the message calls the set.
inline void validate(SplatSet const& set, std::string const& name) {
  using detail::fail;
  std::size_t const n = set.size(), terms = set.sh_terms();
  if (set.sh_degree < 0 || set.sh_degree > 3)
    fail(name, "", "SH degree " + std::to_string(set.sh_degree) + " is outside 0..3; drop the higher terms");
  if (set.positions.size() != 3 * n || set.quats.size() != 4 * n || set.scales.size() != 3 * n || set.sh.size() != 3 * n * terms ||
      set.link.size() != n)
    fail(name, "", "its arrays disagree about the number of Gaussians (" + std::to_string(n) + " opacities); resize them together");
  if (n == 0) fail(name, "", "holds no Gaussians; name a file that has some");
  if (n > static_cast<std::size_t>(std::numeric_limits<int>::max()))
    fail(name, "", "holds " + std::to_string(n) + " Gaussians; at most 2147483647 are supported, split it");
  for (std::size_t l = 0; l < set.link_names.size(); ++l) {
    std::string const& s = set.link_names[l];
    bool control = false;
    for (char c : s) control |= static_cast<unsigned char>(c) < 32 || c == 127;
    if (control || (!s.empty() && (s.front() == ' ' || s.back() == ' ')))
      fail(name, "link " + std::to_string(l), "its name " + detail::in_quotes(s) + " has control characters or outer spaces; rename it");
  }
  auto check = [&](std::size_t i, char const* what, float const* v, std::size_t count) {
    for (std::size_t k = 0; k < count; ++k)
      if (!std::isfinite(v[k]))
        fail(name, "Gaussian " + std::to_string(i),
             std::string(what) + " has a value that is not finite (" + std::to_string(v[k]) + "); repair or export the file again");
  };
  for (std::size_t i = 0; i < n; ++i) {
    auto const place = [&] { return "Gaussian " + std::to_string(i); };
    float const *q = &set.quats[4 * i], *s = &set.scales[3 * i];
    check(i, "position", &set.positions[3 * i], 3);
    check(i, "rotation", q, 4);
    check(i, "scale", s, 3);
    check(i, "opacity", &set.opacities[i], 1);
    check(i, "colour", &set.sh[3 * terms * i], 3 * terms);
    if (!(s[0] >= 0 && s[1] >= 0 && s[2] >= 0)) fail(name, place(), "a scale is negative; repair or export the file again");
    if (!(set.opacities[i] >= 0 && set.opacities[i] <= 1)) fail(name, place(), "opacity is outside 0..1; repair or export the file again");
    float const norm = q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3];
    if (!(std::abs(norm - 1) <= 2e-3f)) fail(name, place(), "the rotation is not a unit quaternion; normalise it");
    if (set.link[i] < -1 || (set.link[i] >= 0 && static_cast<std::size_t>(set.link[i]) >= set.link_names.size()))
      fail(name, place(),
           "link " + std::to_string(set.link[i]) + " has no name; there are " + std::to_string(set.link_names.size()) + " names");
    if (set.link[i] >= 0 && set.link_names[set.link[i]].empty())
      fail(name, place(), "link " + std::to_string(set.link[i]) + " has no name; name it");
  }
}

/// Adds the Gaussians of `from` at the end of `to`: the higher SH degree wins (missing terms are 0), links are joined by name;
/// antialiased are they together where both are.
inline void append(SplatSet& to, SplatSet const& from) {
  if (&to == &from) return append(to, SplatSet(from));
  int const degree = std::max(to.sh_degree, from.sh_degree);
  auto widened = [degree](SplatSet const& s) {  // (n, K, 3) -> (n, K', 3)
    std::size_t const terms = static_cast<std::size_t>((degree + 1) * (degree + 1)), old = s.sh_terms();
    std::vector<float> sh(s.size() * terms * 3, 0.f);
    for (std::size_t i = 0; i < s.size(); ++i) std::copy_n(&s.sh[i * old * 3], old * 3, &sh[i * terms * 3]);
    return sh;
  };
  if (to.sh_degree != degree) to.sh = widened(to);
  to.antialiased = from.antialiased && (to.antialiased || to.size() == 0);
  auto join = [](auto& a, auto const& b) { a.insert(a.end(), b.begin(), b.end()); };
  if (from.sh_degree == degree)
    join(to.sh, from.sh);
  else
    join(to.sh, widened(from));
  to.sh_degree = degree;
  join(to.positions, from.positions);
  join(to.quats, from.quats);
  join(to.scales, from.scales);
  join(to.opacities, from.opacities);
  join(to.notes, from.notes);
  std::map<std::string, int> index;
  for (std::size_t l = 0; l < to.link_names.size(); ++l) index.emplace(to.link_names[l], static_cast<int>(l));
  std::vector<int> map(from.link_names.size());
  for (std::size_t l = 0; l < from.link_names.size(); ++l) {
    auto const [entry, added] = index.emplace(from.link_names[l], static_cast<int>(to.link_names.size()));
    if (added) to.link_names.push_back(from.link_names[l]);
    map[l] = entry->second;
  }
  to.link.reserve(to.link.size() + from.size());
  for (int l : from.link) to.link.push_back(l < 0 ? -1 : map.at(l));
}

/// One set of all Gaussians, in the order given.
template <class... Sets>
SplatSet merge(SplatSet first, Sets const&... rest) {
  (append(first, rest), ...);
  return first;
}

namespace detail {

/// The last step of every reader: q / |q| in double, then `validate`. A rotation of length 0 is refused.
inline void finish(SplatSet& set, std::string const& name) {
  for (std::size_t i = 0; i < set.size(); ++i) {
    float* q = &set.quats[4 * i];
    double const norm = std::sqrt(double(q[0]) * q[0] + double(q[1]) * q[1] + double(q[2]) * q[2] + double(q[3]) * q[3]);
    if (norm == 0) fail(name, "Gaussian " + std::to_string(i), "its rotation has length 0; repair or export the file again");
    for (int k = 0; k < 4; ++k) q[k] = static_cast<float>(q[k] / norm);
  }
  validate(set, name);
}

inline float sigmoid(double x) { return static_cast<float>(1 / (1 + std::exp(-x))); }

}  // namespace detail
}  // namespace gsp::io
