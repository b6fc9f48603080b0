#pragma once
// What a machine may lack (data that is not part of the project, numpy, root): a case that needs it says so and returns,
//   TEST_CASE("the kitchen" * doctest::test_suite("data")) {
//     auto const path = gsp_test::data("splats/kitchen.spz");
//     if (!path) return gsp_test::skip("splats/kitchen.spz is missing from GSP_DATA_DIR");
// Cases of the suite "data" are a CTest test of their own, test_<area>_<name>_data, which ends as Skipped where any of them was skipped.
#include <doctest/doctest.h>

#include <string>

namespace gsp_test {
inline int skipped = 0;  // cases, or parts of cases, of this run

inline void skip(std::string const& why) {
  ++skipped;
  MESSAGE("skipped: ", why);
}
}  // namespace gsp_test
