#include <doctest/doctest.h>

#include <algorithm>
#include <gsp/parallel/sort_by_key.hpp>
#include <gsp_test_execs.hpp>
#include <numeric>
#include <random>
#include <support/kokkos_tools.hpp>

namespace {

// Sorts n random keys of `bits` bits, in buffers of n + spare, and compares with std::stable_sort.
template <class Key, class Exec>
void check_sort(Exec const& exec, int n, int spare, int bits, unsigned distinct) {
  using Mem = typename Exec::memory_space;
  int const capacity = n + spare;
  Key const all = static_cast<Key>(~Key(0)) >> (8 * sizeof(Key) - bits);
  Kokkos::View<Key*, Mem> keys("keys", capacity);
  Kokkos::View<int*, Mem> values("values", capacity);
  Kokkos::View<std::int64_t, Mem> const count("count");
  Kokkos::deep_copy(count, n);
  Kokkos::View<Key*, Kokkos::HostSpace> const k("input keys", capacity);  // not mirrors: those may be the buffers themselves
  Kokkos::View<int*, Kokkos::HostSpace> const v("input values", capacity);
  std::mt19937_64 random(static_cast<unsigned>(n + bits));
  for (int i = 0; i < capacity; ++i) {
    k(i) = i < n ? static_cast<Key>((random() % distinct) * Key(0x9e3779b97f4a7c15ull)) & all : all;
    v(i) = i;
  }
  Kokkos::deep_copy(keys, k);
  Kokkos::deep_copy(values, v);
  auto scratch = gsp::make_sort_scratch<Key>(exec, capacity);
  gsp::sort_by_key(exec, keys, values, scratch, count, {.bits = bits});
  exec.fence();
  std::vector<int> order(n);
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(), [&](int a, int b) { return k(a) < k(b); });
  auto const sorted_keys = Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, keys);
  auto const sorted_values = Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, values);
  int wrong = 0;
  for (int i = 0; i < n; ++i) wrong += sorted_values(i) != order[i] || sorted_keys(i) != k(order[i]);
  CHECK_MESSAGE(wrong == 0, n, " keys of ", bits, " bits, ", distinct, " distinct");
}

}  // namespace

TEST_CASE_TEMPLATE("sorting is std::stable_sort, for any number of keys, bits and ties", Exec, GSP_TEST_ALL_EXECS) {
  Exec const exec = gsp_test::other_instance(Exec{});
  for (int n : {1, 2, 255, 4095, 4096, 50000})
    for (int spare : {0, 777})
      for (unsigned distinct : {1u, 7u, 4000000000u}) {
        for (int bits : {1, 8, 17, 32}) check_sort<std::uint32_t>(exec, n, spare, bits, distinct);
        for (int bits : {9, 40, 64}) check_sort<std::uint64_t>(exec, n, spare, bits, distinct);
      }
}

TEST_CASE_TEMPLATE("sort_by_key keeps an algorithm's promises and refuses buffers that do not fit", Exec, GSP_TEST_ALL_EXECS) {
  using Mem = typename Exec::memory_space;
  Exec const exec = gsp_test::other_instance(Exec{});
  Kokkos::View<std::uint32_t*, Mem> keys("keys", 10000);
  Kokkos::View<int*, Mem> values("values", 10000);
  Kokkos::View<std::int64_t, Mem> const count("count");
  auto scratch = gsp::make_sort_scratch<std::uint32_t>(exec, 10000);
  auto const seen = gsp_test::watch([&] { gsp::sort_by_key(exec, keys, values, scratch, count); });
  gsp_test::check_labels(seen), gsp_test::check_no_allocation(seen), gsp_test::check_no_fence(seen), gsp_test::check_instance(exec, seen);
  auto small = gsp::make_sort_scratch<std::uint32_t>(exec, 5000);
  CHECK_THROWS_AS(gsp::sort_by_key(exec, keys, values, small, count), std::invalid_argument);
  CHECK_THROWS_AS(gsp::sort_by_key(exec, keys, values, scratch, count, {.bits = 33}), std::invalid_argument);
}
