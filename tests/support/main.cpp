// main of every test: starts Kokkos, hands the command line to doctest. Ends with CTest's SKIP_RETURN_CODE where something was skipped and
// all that ran is right.
#define DOCTEST_CONFIG_IMPLEMENT
#include <doctest/doctest.h>

#include <Kokkos_Core.hpp>
#include <cstdio>
#include <support/skip.hpp>

int main(int argc, char** argv) {
#if defined(KOKKOS_ENABLE_CUDA)
  int devices = 0;
  if (cudaGetDeviceCount(&devices) != cudaSuccess || devices == 0) {
    std::puts("skipped: no GPU on this machine");
    return 77;  // SKIP_RETURN_CODE
  }
#endif
  Kokkos::ScopeGuard kokkos(argc, argv);
  doctest::Context context(argc, argv);
  int const failed = context.run();
  return failed == 0 && gsp_test::skipped > 0 ? 77 : failed;
}
