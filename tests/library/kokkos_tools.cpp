// The watcher that other tests lean on finds what it should find: kernels with their labels and instance, allocations, fences, copies.
#include "support/kokkos_tools.hpp"

#include <gsp_test_execs.hpp>

namespace {
template <class Mem>
struct Increment {
  Kokkos::View<int*, Mem> x;
  KOKKOS_FUNCTION void operator()(int i) const { x(i) += 1; }
};
template <class Mem>
struct Sum {
  Kokkos::View<int*, Mem> x;
  KOKKOS_FUNCTION void operator()(int i, int& sum) const { sum += x(i); }
};
}  // namespace

TEST_CASE_TEMPLATE("watch sees kernels, allocations, fences and copies", Exec, GSP_TEST_EXECS) {
  using Mem = typename Exec::memory_space;
  Exec const exec = gsp_test::other_instance(Exec{});
  Kokkos::View<int*, Mem> x("x", 16);
  Kokkos::View<int, Mem> sum("sum");

  SUBCASE("a clean algorithm") {
    auto const seen = gsp_test::watch([&] {
      Kokkos::parallel_for("gsp::test::increment", Kokkos::RangePolicy<Exec>(exec, 0, 16), Increment<Mem>{x});
      Kokkos::parallel_reduce("gsp::test::sum", Kokkos::RangePolicy<Exec>(exec, 0, 16), Sum<Mem>{x}, sum);
    });
    REQUIRE(seen.kernels.size() == 2);
    CHECK(seen.kernels[0].label == "gsp::test::increment");
    CHECK(seen.kernels[1].label == "gsp::test::sum");
    gsp_test::check_algorithm(exec, seen);
  }
  SUBCASE("a label of someone else") {
    auto const seen = gsp_test::watch([&] { Kokkos::parallel_for("mine", Kokkos::RangePolicy<Exec>(exec, 0, 16), Increment<Mem>{x}); });
    REQUIRE(seen.kernels.size() == 1);
    CHECK(seen.kernels[0].label == "mine");
  }
  SUBCASE("an allocation") {
    auto const seen = gsp_test::watch([&] { Kokkos::View<double*, Mem> y("scratch", 100); });
    REQUIRE(seen.allocations.size() == 1);
    CHECK(seen.allocations[0].label == "scratch");
    CHECK(seen.allocations[0].bytes >= 800);
  }
  SUBCASE("a fence") {
    auto const seen = gsp_test::watch([&] { exec.fence("wait"); });
    bool found = false;
    for (auto const& fence : seen.fences) found = found || fence.label == "wait";
    CHECK(found);
  }
  SUBCASE("a copy") {
    auto const seen = gsp_test::watch([&] {
      auto const host = Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, x);
      Kokkos::deep_copy(exec, x, 3);
    });
    CHECK((seen.copies.size() + seen.kernels.size() + seen.fences.size()) > 0);
  }
  SUBCASE("nothing after the call") {
    auto const seen = gsp_test::watch([] {});
    Kokkos::parallel_for("later", Kokkos::RangePolicy<Exec>(exec, 0, 16), Increment<Mem>{x});
    exec.fence();
    CHECK(seen.kernels.empty());
  }
}

#if defined(KOKKOS_ENABLE_OPENMP) && defined(KOKKOS_ENABLE_SERIAL)
TEST_CASE("work on another backend has another device id") {
  CHECK(Kokkos::Tools::Experimental::device_id(Kokkos::Serial{}) != Kokkos::Tools::Experimental::device_id(Kokkos::OpenMP{}));
}
#endif
