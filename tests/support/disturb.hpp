#pragma once
#include <gsp/step/snapshot.hpp>

namespace gsp_test {
/// All that steps leave of a state to sevens.
template <class R, class Mem>
void disturb(gsp::State<R, Mem> const& state) {
  gsp::detail::each_state_view(
      [](char const*, auto const& view) {
        using Item = typename std::decay_t<decltype(view)>::value_type;
        Kokkos::deep_copy(view, Item(7));
      },
      state);
}
}  // namespace gsp_test
