#pragma once
#include <cstring>

namespace gsp::detail {

/// to[i][k] = from[k][i] for i, k < 4: four numbers at once, where one by one took a load and a store each. Nothing need be aligned. Hosts
/// only.
template <class R>
void transpose4(R const* const (&from)[4], R* const (&to)[4]) {
  using Four [[gnu::vector_size(4 * sizeof(R))]] = R;
  Four row[4];
  for (int k = 0; k < 4; ++k) std::memcpy(&row[k], from[k], sizeof(Four));
  Four const a = __builtin_shufflevector(row[0], row[1], 0, 4, 1, 5), b = __builtin_shufflevector(row[2], row[3], 0, 4, 1, 5);
  Four const c = __builtin_shufflevector(row[0], row[1], 2, 6, 3, 7), d = __builtin_shufflevector(row[2], row[3], 2, 6, 3, 7);
  Four const column[4] = {__builtin_shufflevector(a, b, 0, 1, 4, 5), __builtin_shufflevector(a, b, 2, 3, 6, 7),
                          __builtin_shufflevector(c, d, 0, 1, 4, 5), __builtin_shufflevector(c, d, 2, 3, 6, 7)};
  for (int i = 0; i < 4; ++i) std::memcpy(to[i], &column[i], sizeof(Four));
}

}  // namespace gsp::detail
