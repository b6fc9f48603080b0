#pragma once
#include <gsp/collision/collision_model.hpp>

/// Trees of boxes (BoxTreeShape): eight children a block, low[axis][child], high[axis][child]. Which leaf stands where is for the caller to
/// say; neighbours in space should be neighbours in the tree. A child that is not there, or is NaN, has an empty box, which is near
/// nothing.
namespace gsp::detail {

inline constexpr int block_reals = 48;

template <class R>
KOKKOS_INLINE_FUNCTION void clear_block(R* block) {
  for (int i = 0; i < 24; ++i) {
    block[i] = Kokkos::Experimental::infinity_v<R>;
    block[24 + i] = -Kokkos::Experimental::infinity_v<R>;
  }
}

/// Block `j` of a level above the leaves from those below it.
template <class R>
KOKKOS_INLINE_FUNCTION void join_blocks(BoxTreeShape const& shape, R* tree, int level, int j) {
  R* const block = tree + block_reals * (shape.first[level] + j);
  clear_block(block);
  for (int c = 0; c < 8 && 8 * j + c < shape.blocks_of(level - 1); ++c) {
    R const* const below = tree + block_reals * (shape.first[level - 1] + 8 * j + c);
    for (int i = 0; i < 3; ++i)
      for (int k = 0; k < 8; ++k) {
        R const low = below[8 * i + k], high = below[24 + 8 * i + k];
        block[8 * i + c] = low < block[8 * i + c] ? low : block[8 * i + c];
        block[24 + 8 * i + c] = high > block[24 + 8 * i + c] ? high : block[24 + 8 * i + c];
      }
  }
}

/// Calls f(leaf) for each leaf whose box meets that from `low` to `high`, in an order that hangs on the tree.
template <class R, class F>
KOKKOS_INLINE_FUNCTION void for_leaves_near(BoxTreeShape const& shape, R const* tree, R const* low, R const* high, F const& f) {
  if (shape.levels == 0) return;
  int stack[64];  // a block takes one place and gives up to eight, on at most eight levels
  int top = 0;
  stack[top++] = (shape.levels - 1) << 26;
  while (top > 0) {
    int const at = stack[--top], level = at >> 26, j = at & 0x3ffffff;
    R const* const block = tree + block_reals * (shape.first[level] + j);
    unsigned near[8], bits = 0;
    for (int c = 0; c < 8; ++c)
      near[c] = unsigned(block[c] <= high[0]) & unsigned(block[8 + c] <= high[1]) & unsigned(block[16 + c] <= high[2]) &
                unsigned(block[24 + c] >= low[0]) & unsigned(block[32 + c] >= low[1]) & unsigned(block[40 + c] >= low[2]);
    for (int c = 0; c < 8; ++c) bits |= near[c] << c;
    for (; bits != 0; bits &= bits - 1) {
      int const child = 8 * j + Kokkos::countr_zero(bits);
      if (level == 0)
        f(child);
      else
        stack[top++] = (level - 1) << 26 | child;
    }
  }
}

}  // namespace gsp::detail
