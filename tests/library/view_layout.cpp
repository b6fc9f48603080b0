// Host and device must agree on the size of a View, or every kernel reads its captures from the wrong place
// (nvcc 13 and g++ 12 differ on [[no_unique_address]]; gsp::gsp switches the attribute off).
#include <doctest/doctest.h>

#include <gsp_test_execs.hpp>

namespace {

/// What a kernel captures: views of several ranks and a trailing number, whose offset shows any disagreement.
template <class Mem>
struct Captures {
  Kokkos::View<float*, Mem> a;
  Kokkos::View<double**, Kokkos::LayoutRight, Mem> b;
  Kokkos::View<float const***, Kokkos::LayoutStride, Mem> c;
  int last;
};

template <class Mem>
struct ReportSizes {
  Captures<Mem> captures;
  Kokkos::View<int*, Mem> out;
  KOKKOS_FUNCTION void operator()(int) const {
    out(0) = int(sizeof(captures.a));
    out(1) = int(sizeof(captures.b));
    out(2) = int(sizeof(captures.c));
    out(3) = int(sizeof(captures));
    out(4) = captures.last;
  }
};

}  // namespace

TEST_CASE_TEMPLATE("views have one size on host and device", Exec, GSP_TEST_EXECS) {
  using Mem = typename Exec::memory_space;
  Captures<Mem> captures;
  captures.last = 1234567;
  Kokkos::View<int*, Mem> out("out", 5);
  Exec exec;
  Kokkos::parallel_for("gsp::test::report_sizes", Kokkos::RangePolicy<Exec>(exec, 0, 1), ReportSizes<Mem>{captures, out});
  exec.fence();
  auto const seen = Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, out);
  CHECK(seen(0) == int(sizeof(captures.a)));
  CHECK(seen(1) == int(sizeof(captures.b)));
  CHECK(seen(2) == int(sizeof(captures.c)));
  CHECK(seen(3) == int(sizeof(captures)));
  CHECK(seen(4) == 1234567);
}
