#pragma once
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <queue>
#include <vector>

namespace gsp::io::detail {

/// At most 256 values, ascending, that stand for all of `values`: Lloyd's iterations from equal steps over their range. A value that none
/// is nearest to moves to the end of the cell with the greatest sum of squares, so that no iteration makes that sum greater.
inline std::vector<float> make_codebook(std::vector<float> values, int iterations = 24) {
  std::sort(values.begin(), values.end());
  std::size_t const n = values.size(), size = 256;
  std::vector<double> sum(n + 1), square(n + 1);
  double const shift = values[n / 2];
  for (std::size_t i = 0; i < n; ++i) {
    double const v = values[i] - shift;
    sum[i + 1] = sum[i] + v;
    square[i + 1] = square[i] + v * v;
  }
  std::vector<double> centre(size);
  for (std::size_t k = 0; k < size; ++k) centre[k] = values.front() + (double(values.back()) - values.front()) * double(k) / (size - 1);
  std::vector<std::size_t> first(size + 1);
  for (int step = 0; step < iterations; ++step) {
    first[size] = n;
    for (std::size_t k = 1; k < size; ++k)
      first[k] = static_cast<std::size_t>(std::lower_bound(values.begin(), values.end(), (centre[k - 1] + centre[k]) / 2) - values.begin());
    std::priority_queue<std::pair<double, std::size_t>> worst;
    for (std::size_t k = 0; k < size; ++k) {
      auto const count = static_cast<double>(first[k + 1]) - static_cast<double>(first[k]);
      if (count <= 0) continue;
      double const mean = (sum[first[k + 1]] - sum[first[k]]) / count;
      centre[k] = mean + shift;
      worst.emplace(square[first[k + 1]] - square[first[k]] - count * mean * mean, k);
    }
    for (std::size_t k = 0; k < size && !worst.empty(); ++k) {
      if (first[k + 1] > first[k]) continue;
      std::size_t const from = worst.top().second;
      worst.pop();
      double const low = values[first[from]], high = values[first[from + 1] - 1];
      centre[k] = centre[from] - low > high - centre[from] ? low : high;
    }
    std::sort(centre.begin(), centre.end());
  }
  return {centre.begin(), centre.end()};
}

/// The index of the value nearest to `v`.
inline std::uint8_t nearest_code(std::vector<float> const& codebook, float v) {
  auto const above = std::lower_bound(codebook.begin(), codebook.end(), v);
  if (above == codebook.begin()) return 0;
  auto const k = static_cast<std::size_t>(above - codebook.begin());
  if (above == codebook.end()) return static_cast<std::uint8_t>(k - 1);
  return static_cast<std::uint8_t>(double(v) - codebook[k - 1] <= double(codebook[k]) - v ? k - 1 : k);
}

/// Rows of `width` numbers in at most `most` groups: the group with the greatest sum of squares is split at its mean along the number that
/// varies most, until there are enough. Returns the group of each row; `means` takes their means, (groups, width).
/// Cost: rows x width x (log2 of the groups, or a few times that).
inline std::vector<std::uint32_t> make_groups(float const* rows, std::size_t count, std::size_t stride, std::size_t width, std::size_t most,
                                              std::vector<float>& means) {
  std::vector<std::uint32_t> order(count), group(count);
  for (std::size_t i = 0; i < count; ++i) order[i] = static_cast<std::uint32_t>(i);
  struct Group {
    double error;
    std::size_t first, last, axis;
    double middle;
    bool operator<(Group const& b) const { return error != b.error ? error < b.error : first > b.first; }
  };
  std::vector<double> sum(width), square(width);
  auto const measure = [&](std::size_t first, std::size_t last) {
    std::fill(sum.begin(), sum.end(), 0.);
    std::fill(square.begin(), square.end(), 0.);
    for (std::size_t i = first; i < last; ++i) {
      float const* const row = rows + order[i] * stride;
      for (std::size_t k = 0; k < width; ++k) {
        sum[k] += row[k];
        square[k] += double(row[k]) * row[k];
      }
    }
    Group g{0, first, last, 0, 0};
    double greatest = -1;
    for (std::size_t k = 0; k < width; ++k) {
      double const mean = sum[k] / double(last - first), error = std::max(0., square[k] - sum[k] * mean);
      g.error += error;
      if (error <= greatest) continue;
      greatest = error;
      g.axis = k;
      g.middle = mean;
    }
    return g;
  };
  std::priority_queue<Group> open;
  std::vector<Group> done;
  open.push(measure(0, count));
  while (!open.empty() && open.size() + done.size() < most) {
    Group const g = open.top();
    open.pop();
    auto const at =
        std::stable_partition(order.begin() + static_cast<std::ptrdiff_t>(g.first), order.begin() + static_cast<std::ptrdiff_t>(g.last),
                              [&](std::uint32_t i) { return rows[i * stride + g.axis] < g.middle; });
    auto const middle = static_cast<std::size_t>(at - order.begin());
    if (middle == g.first || middle == g.last) {  // all alike, to rounding
      done.push_back(g);
      continue;
    }
    open.push(measure(g.first, middle));
    open.push(measure(middle, g.last));
  }
  for (; !open.empty(); open.pop()) done.push_back(open.top());
  std::sort(done.begin(), done.end(), [](Group const& a, Group const& b) { return a.first < b.first; });
  means.assign(done.size() * width, 0.f);
  for (std::size_t j = 0; j < done.size(); ++j) {
    measure(done[j].first, done[j].last);
    for (std::size_t k = 0; k < width; ++k) means[j * width + k] = static_cast<float>(sum[k] / double(done[j].last - done[j].first));
    for (std::size_t i = done[j].first; i < done[j].last; ++i) group[order[i]] = static_cast<std::uint32_t>(j);
  }
  return group;
}

}  // namespace gsp::io::detail
