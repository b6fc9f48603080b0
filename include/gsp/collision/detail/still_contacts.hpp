#pragma once
#include <gsp/collision/shapes.hpp>
#include <gsp/model/model.hpp>

/// What `collide` takes over from its last call: contacts of pairs that have not moved since.
namespace gsp {

/// Trees that are where they were at the last `collide` of these contacts, to the bit. Empty: none is known.
template <class R, class Mem>
struct StillTrees {
  using Indices = typename Model<R, Mem>::template Array<int>;
  Kokkos::View<int**, Kokkos::LayoutRight, Mem> still;  // (worlds, ntree) 1: it is
  Indices body_tree, body_mocap;                        // the model's
};

namespace detail {
template <class R, class Mem>
struct StillContacts {
  StillTrees<R, Mem> trees;
  Kokkos::View<int*, Kokkos::LayoutRight, Mem> first, end, pair, feature;  // the pool that the last call has left
  Kokkos::View<R*, Kokkos::LayoutRight, Mem> dist;
  Kokkos::View<R* [3], Kokkos::LayoutRight, Mem> pos;
  Kokkos::View<R* [9], Kokkos::LayoutRight, Mem> frame;

  /// The points of a pair of these bodies to `slot`, at most so many; their number, 0: they have to be found.
  KOKKOS_INLINE_FUNCTION int copy(int w, int number, int body1, int body2, ContactPoint<R>* slot, int most) const {
    if (!trees.still.data() || !(moves_not(w, body1) && moves_not(w, body2))) return 0;
    int const capacity = int(dist.extent(0)), last = end(w) < capacity ? end(w) : capacity;
    int low = first(w);
    for (int high = last; low < high;) {
      int const middle = low + (high - low) / 2;
      if (pair(middle) < number)
        low = middle + 1;
      else
        high = middle;
    }
    int count = 0;
    for (int i = low; i < last && count < most && pair(i) == number; ++i)
      slot[count++] = {{pos(i, 0), pos(i, 1), pos(i, 2)}, dist(i), {frame(i, 0), frame(i, 1), frame(i, 2)}, feature(i)};
    return count;
  }

 private:
  KOKKOS_INLINE_FUNCTION bool moves_not(int w, int body) const {
    int const t = trees.body_tree(body);
    return t < 0 ? trees.body_mocap(body) < 0 : trees.still(w, t) != 0;
  }
};
}  // namespace detail
}  // namespace gsp
