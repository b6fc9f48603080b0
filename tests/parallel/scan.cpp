#include <doctest/doctest.h>

#include <gsp/parallel/scan.hpp>
#include <gsp_test_execs.hpp>
#include <random>
#include <support/kokkos_tools.hpp>

TEST_CASE_TEMPLATE("an exclusive scan is the running sum, with the total behind it", Exec, GSP_TEST_ALL_EXECS) {
  using Mem = typename Exec::memory_space;
  Exec const exec = gsp_test::other_instance(Exec{});
  std::mt19937 random(3);
  for (int n : {0, 1, 2, 31, 1000, 100003}) {
    Kokkos::View<int*, Mem> const in("in", n);
    Kokkos::View<std::int64_t*, Mem> const out("out", n + 1);
    auto const host = Kokkos::create_mirror_view(in);
    for (int i = 0; i < n; ++i) host(i) = static_cast<int>(random() % 2000000000u);  // the sum passes 2^31: it must be taken in 64 bits
    Kokkos::deep_copy(in, host);
    gsp::exclusive_scan(exec, in, out, gsp::make_scan_scratch(exec, n));
    exec.fence();
    auto const result = Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, out);
    std::int64_t sum = 0;
    int wrong = 0;
    for (int i = 0; i < n; ++i) wrong += result(i) != sum, sum += host(i);
    CHECK(wrong == 0);
    CHECK(result(n) == sum);
  }
}

TEST_CASE_TEMPLATE("exclusive_scan keeps an algorithm's promises and refuses a short output", Exec, GSP_TEST_ALL_EXECS) {
  using Mem = typename Exec::memory_space;
  Exec const exec = gsp_test::other_instance(Exec{});
  Kokkos::View<int*, Mem> const in("in", 5000);
  Kokkos::View<std::int64_t*, Mem> const out("out", 5001), small("small", 5000);
  auto const scratch = gsp::make_scan_scratch(exec, 5000);
  gsp::exclusive_scan(exec, in, out, scratch);
  exec.fence();
  gsp_test::check_algorithm(exec, gsp_test::watch([&] { gsp::exclusive_scan(exec, in, out, scratch); }));
  CHECK_THROWS_AS(gsp::exclusive_scan(exec, in, small, scratch), std::invalid_argument);
  if constexpr (gsp::is_device<Exec>) CHECK_THROWS_AS(gsp::exclusive_scan(exec, in, out, gsp::ScanScratch<Mem>{}), std::invalid_argument);
}

namespace test_types {
struct TwoSums {
  std::int64_t a = 0, b = 0;
  KOKKOS_INLINE_FUNCTION TwoSums& operator+=(TwoSums const& o) {
    a += o.a;
    b += o.b;
    return *this;
  }
};
/// Item i adds i and i^2.
template <class Mem>
struct AddNumbers {
  using value_type = TwoSums;
  Kokkos::View<std::int64_t* [2], Kokkos::LayoutRight, Mem> before;
  KOKKOS_FUNCTION void operator()(std::int64_t i, TwoSums& sum, bool last) const {
    if (last) {
      before(i, 0) = sum.a;
      before(i, 1) = sum.b;
    }
    sum.a += i;
    sum.b += i * i;
  }
};
}  // namespace test_types

// On a GPU a block scans up to detail::most_by_block items, Kokkos more. Closed forms.
TEST_CASE_TEMPLATE("items are scanned in their order, few and many", Exec, GSP_TEST_ALL_EXECS) {
  using Mem = typename Exec::memory_space;
  Exec const exec = gsp_test::other_instance(Exec{});
  for (int n : {0, 1, 31, 511, 512, 513, 1023, 1024, 1025, 30000}) {
    test_types::AddNumbers<Mem> const add{Kokkos::View<std::int64_t* [2], Kokkos::LayoutRight, Mem>("before", n)};
    exec.fence();
    auto const seen = gsp_test::watch([&] { gsp::detail::scan_items("gsp::test::scan", exec, n, add); });
    if (n > 0) gsp_test::check_algorithm(exec, seen);
    exec.fence();
    auto const before = Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, add.before);
    int wrong = 0;
    for (std::int64_t i = 0; i < n; ++i) wrong += before(i, 0) != i * (i - 1) / 2 || before(i, 1) != (i - 1) * i * (2 * i - 1) / 6;
    CHECK(wrong == 0);
  }
}
