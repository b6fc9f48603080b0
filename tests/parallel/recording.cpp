#include <doctest/doctest.h>

#include <gsp/parallel/for_worlds.hpp>
#include <gsp/parallel/recording.hpp>
#include <gsp_test_execs.hpp>
#include <stdexcept>

namespace test_types {
template <class Mem>
struct Add {
  Kokkos::View<int*, Mem> to;
  int number;
  template <class World>
  KOKKOS_FUNCTION void operator()(World const& world) const {
    world.single([&] { to(world.rank) = 3 * to(world.rank) + number; });
  }
};
}  // namespace test_types

// Where there is a recording, each launch of it does what its launches would have done, in their order and in that of the instance; where
// there is none, nothing has been done.
TEST_CASE_TEMPLATE("launches are recorded, and launched together", Exec, GSP_TEST_ALL_EXECS) {
  using Mem = typename Exec::memory_space;
  Exec const exec{};
  Kokkos::View<int*, Mem> const numbers("numbers", 100);
  auto const add = [&](int number) { gsp::for_worlds("test::add", exec, 100, test_types::Add<Mem>{numbers, number}); };
  auto const first = [&] { return Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, numbers)(99); };
  gsp::Recording<Exec> recording;
  CHECK(!recording.exists());
  bool const recorded = recording.record(exec, [&] {
    add(1);
    add(2);
  });
  CHECK(recorded == gsp::is_device<Exec>);
  CHECK(recording.exists() == recorded);
  exec.fence();
  CHECK(first() == 0);
  if constexpr (gsp::is_device<Exec>) {
    recording.launch(exec);
    add(3);
    recording.launch(exec);
    exec.fence();
    int n = 0;
    for (int const number : {1, 2, 3, 1, 2}) n = 3 * n + number;
    CHECK(first() == n);
    auto moved = std::move(recording);
    CHECK(!recording.exists());
    CHECK(moved.exists());

    // what would read the host's memory later is not recorded, and an exception leaves the instance as it was
    int const number = 5;
    CHECK(
        !moved.record(exec, [&] { cudaMemcpyAsync(numbers.data(), &number, sizeof number, cudaMemcpyHostToDevice, exec.cuda_stream()); }));
    CHECK(!moved.exists());
    CHECK_THROWS_AS(moved.record(exec, [] { throw std::runtime_error("test"); }), std::runtime_error);
    CHECK(!moved.exists());
    add(1);
    exec.fence();
    CHECK(first() == 3 * n + 1);
  }
}
