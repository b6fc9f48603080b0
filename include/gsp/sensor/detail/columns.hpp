#pragma once
#include <gsp/core/check.hpp>
#include <stdexcept>
#include <string>
#include <vector>

/// Columns of views that sensors read and write.
namespace gsp::detail {

/// Columns that views must have, so that these are among them.
inline int columns_of(char const* where, std::vector<int> const& list) {
  int most = 0;
  for (int const c : list) {
    expects(c >= 0, where, "columns must not be negative");
    most = c + 1 > most ? c + 1 : most;
  }
  return most;
}
/// The same of columns that are written: each once.
inline int own_columns_of(char const* where, std::vector<int> const& list) {
  int const most = columns_of(where, list);
  std::vector<bool> taken(std::size_t(most), false);
  for (int const c : list) {
    expects(!taken[std::size_t(c)], where, "a column is named twice, and one number has one place: name each once");
    taken[std::size_t(c)] = true;
  }
  return most;
}
template <class View>
void expects_columns(char const* where, char const* what, View const& view, int columns) {
  if (int(view.extent(1)) < columns)
    throw std::invalid_argument(std::string(where) + ": " + what + " has " + std::to_string(view.extent(1)) + " columns, and " +
                                std::to_string(columns) + " are read: give the view that the columns were chosen for");
}

}  // namespace gsp::detail
