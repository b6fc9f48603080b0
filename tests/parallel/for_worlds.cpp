#include <doctest/doctest.h>

#include <gsp/parallel/for_worlds.hpp>
#include <gsp_test_execs.hpp>

#include "support/kokkos_tools.hpp"

namespace test_types {
/// World w has 3 w items: i + w each. Sums, running sums and a count of `single` in integers, so that the order does not matter.
template <class Mem>
struct Sums {
  Kokkos::View<long*, Mem> total, after, ones;
  Kokkos::View<long**, Kokkos::LayoutRight, Mem> item, before;
  template <class World>
  KOKKOS_FUNCTION void operator()(World const& world) const {
    int const w = world.rank, n = 3 * w;
    auto const self = *this;  // nested lambdas copy it
    world.each(n, [&](int i) { self.item(w, i) = i + w; });
    world.sync();
    long const sum = world.template sum<long>(n, [&](int i) { return self.item(w, i); });
    world.template scan<long>(
        n, [&](int i) { return self.item(w, i); }, [&](int i, long before) { self.before(w, i) = before; });
    world.single([&] { self.total(w) = sum, self.ones(w) += 1; });
    world.sync();
    long const later = world.template sum<long>(n, [&](int i) { return self.before(w, i); });
    world.single([&] { self.after(w) = later; });
  }
};
}  // namespace test_types

// Worlds of 0 to 120 items, fewer and more than a warp. Closed forms: sum = n (n - 1) / 2 + n w, running sum likewise.
TEST_CASE_TEMPLATE("each world loops, sums and scans by itself", Exec, GSP_TEST_ALL_EXECS) {
  using Mem = typename Exec::memory_space;
  Exec const exec = gsp_test::other_instance(Exec{});
  int const worlds = 41;
  test_types::Sums<Mem> const s{Kokkos::View<long*, Mem>("total", worlds), Kokkos::View<long*, Mem>("after", worlds),
                                Kokkos::View<long*, Mem>("ones", worlds),
                                Kokkos::View<long**, Kokkos::LayoutRight, Mem>("item", worlds, 3 * worlds),
                                Kokkos::View<long**, Kokkos::LayoutRight, Mem>("before", worlds, 3 * worlds)};
  exec.fence();
  gsp_test::check_algorithm(exec, gsp_test::watch([&] { gsp::for_worlds("gsp::test::sums", exec, worlds, s); }));
  exec.fence();
  auto const total = Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, s.total),
             ones = Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, s.ones),
             after = Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, s.after);
  auto const before = Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, s.before);
  for (int w = 0; w < worlds; ++w) {
    long const n = 3 * w;
    long sum = 0;
    CHECK(total(w) == n * (n - 1) / 2 + n * w);
    CHECK(ones(w) == 1);
    for (long i = 0; i < n; ++i) {
      CHECK(before(w, i) == i * (i - 1) / 2 + i * w);
      sum += i * (i - 1) / 2 + i * w;
    }
    CHECK(after(w) == sum);
  }
}
