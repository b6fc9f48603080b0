#include <doctest/doctest.h>

#include <gsp/parallel/detail/for_items.hpp>
#include <gsp/parallel/for_worlds.hpp>
#include <gsp_test_execs.hpp>
#include <vector>

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
/// What a team has to offer, in a world of so many items as `items` says; on a GPU by a warp or, where it is wide, by a block.
template <class Mem, bool by_block>
struct Team {
  static constexpr bool wide = by_block;
  static constexpr int most = 2000, keys = 5;
  KOKKOS_FUNCTION static int items(int world) {
    constexpr int table[] = {0, 1, 33, 511, 512, 513, most};
    return table[world];
  }
  Kokkos::View<float**, Kokkos::LayoutRight, Mem> before;  // running sums; behind them the sum
  Kokkos::View<int**, Kokkos::LayoutRight, Mem> at, next,
      long_before;  // where an item is placed, of its key; running sums of whole numbers
  template <class World>
  KOKKOS_FUNCTION void operator()(World const& world) const {
    int const w = world.rank, n = items(w);
    auto const self = *this;  // nested lambdas copy it
    world.single([&] { self.next(w, keys) = 7; });
    world.each(n, [&](int i) { world.add(self.next(w, keys), i); });
    world.sync();
    auto const part = [](int i) { return 1.f / float(3 * i + 1); };
    world.template scan<float>(n, part, [&](int i, float sum) { self.before(w, i) = sum; });
    world.template scan<int>(
        n, [](int i) { return i % 3; }, [&](int i, int sum) { self.long_before(w, i) = sum; });
    world.place(
        n, [](int i) { return i * 7 % (keys + 1) - 1; }, &self.next(w, 0), [&](int i, int place) { self.at(w, i) = place; });
    float const total = world.template sum<float>(n, part);
    int const whole = world.template sum<int>(n, [](int i) { return i % 3; });
    world.single([&] {
      self.before(w, most) = total;
      self.long_before(w, most) = whole;
    });
  }
};
/// to(w) = from(next(w)) + 1, by kernels of either kind; some take long, so that others are there before they have ended.
template <class Mem>
struct Shift {
  Kokkos::View<int*, Mem> from, to;
  KOKKOS_FUNCTION static int next(int w, int n) { return int((std::int64_t(w) * 7919 + 13) % n); }
  KOKKOS_FUNCTION void operator()(std::int64_t item) const {
    int const w = int(item), n = int(from.extent(0));
    unsigned x = unsigned(from(w));  // what a compiler knows takes no time
    for (int i = 0, turns = w % 97 == 0 ? 30000 : 0; i < turns; ++i) x = x * 1664525u + 1013904223u;
    to(w) = from(next(w, n)) + (x == 4000000007u ? 2 : 1);
  }
  template <class World>
  KOKKOS_FUNCTION void operator()(World const& world) const {
    auto const self = *this;
    world.single([&] { self(std::int64_t(world.rank)); });
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

// Worlds of fewer and of more items than a warp and a block have threads. Whole numbers against plain loops; sums of others, which have an
// order, to the same bits whether a block or a warp has found them.
TEST_CASE_TEMPLATE("a block a world finds what a warp does", Exec, GSP_TEST_ALL_EXECS) {
  using Mem = typename Exec::memory_space;
  Exec const exec{};
  int const worlds = 7;
  auto const run = [&](auto team) {
    using Type = decltype(team);
    team.before = decltype(team.before)("before", worlds, Type::most + 1);
    team.at = decltype(team.at)("at", worlds, Type::most);
    team.next = decltype(team.next)("next", worlds, Type::keys + 1);
    team.long_before = decltype(team.long_before)("long_before", worlds, Type::most + 1);
    exec.fence();
    gsp::for_worlds("gsp::test::team", exec, worlds, team);
    exec.fence();
    return team;
  };
  auto const narrow = run(test_types::Team<Mem, false>{});
  auto const wide = run(test_types::Team<Mem, true>{});
  auto const host = [](auto const& view) { return Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, view); };
  auto const before = host(narrow.before), wide_before = host(wide.before);
  for (auto const& team : {host(narrow.next), host(wide.next)})
    for (int w = 0; w < worlds; ++w) {
      int const n = test_types::Team<Mem, true>::items(w);
      CHECK(team(w, test_types::Team<Mem, true>::keys) == 7 + n * (n - 1) / 2);
    }
  auto const at = host(narrow.at), wide_at = host(wide.at), sums = host(narrow.long_before), wide_sums = host(wide.long_before);
  for (int w = 0; w < worlds; ++w) {
    CAPTURE(w);
    int const n = test_types::Team<Mem, true>::items(w), most = test_types::Team<Mem, true>::most;
    int next[6] = {}, sum = 0, wrong = 0;
    for (int i = 0; i < n; ++i) {
      int const key = i * 7 % 6 - 1, place = key >= 0 ? next[key]++ : 0;
      wrong += at(w, i) != place || wide_at(w, i) != place;
      wrong += sums(w, i) != sum || wide_sums(w, i) != sum;
      wrong += before(w, i) != wide_before(w, i);
      sum += i % 3;
    }
    CHECK(wrong == 0);
    CHECK(sums(w, most) == sum);
    CHECK(wide_sums(w, most) == sum);
    CHECK(before(w, most) == wide_before(w, most));
    if (n > 0) CHECK(before(w, most) >= 1.f);
  }
}

// On a GPU a kernel begins before the one before it has ended, and waits for it. Against plain loops.
TEST_CASE_TEMPLATE("a kernel reads what the one before it has written", Exec, GSP_TEST_EXECS) {
  using Mem = typename Exec::memory_space;
  Exec const exec = gsp_test::other_instance(Exec{});
  int const n = 30011, rounds = gsp::is_device<Exec> ? 200 : 4;
  Kokkos::View<int*, Mem> a("a", n), b("b", n);
  auto const host = Kokkos::create_mirror_view(Kokkos::HostSpace{}, a);
  std::vector<int> now(n), then(n);
  for (int w = 0; w < n; ++w) host(w) = now[w] = (w * 31) % 1009;
  Kokkos::deep_copy(a, host);
  Kokkos::fence("a is there");
  for (int round = 0; round < rounds; ++round) {
    gsp::for_worlds("gsp::test::shift", exec, n, test_types::Shift<Mem>{a, b});
    gsp::detail::for_items("gsp::test::shift", exec, n, test_types::Shift<Mem>{b, a});
    for (int half = 0; half < 2; ++half) {
      for (int w = 0; w < n; ++w) then[w] = now[test_types::Shift<Mem>::next(w, n)] + 1;
      now.swap(then);
    }
  }
  exec.fence();
  Kokkos::deep_copy(host, a);
  int wrong = 0;
  for (int w = 0; w < n; ++w) wrong += host(w) != now[w];
  CHECK(wrong == 0);
}
