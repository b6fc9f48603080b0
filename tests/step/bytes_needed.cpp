#include <doctest/doctest.h>

#include <gsp/model/compile.hpp>
#include <gsp/model/samples.hpp>
#include <gsp/model/world_values.hpp>
#include <gsp/splat/frames.hpp>
#include <gsp/splat/sample_surface.hpp>
#include <gsp/step/bytes_needed.hpp>
#include <gsp_test_execs.hpp>
#include <support/kokkos_tools.hpp>

using namespace gsp_test;

// Another route: what Kokkos says it was asked for. What a scan allocates, some kB of labels and scratch, follows its own steps.
std::int64_t bytes_of(Watched const& seen) {
  std::int64_t sum = 0;
  for (auto const& a : seen.allocations) sum += std::int64_t(a.bytes);
  return sum;
}

TEST_CASE_TEMPLATE("the bytes of a simulation are told before they are allocated", Exec, GSP_TEST_EXECS) {
  Exec const exec;
  auto const compiled = gsp::compile(gsp::samples::quadruped_scene());
  auto const model = gsp::make_model<float>(exec, compiled);
  for (int worlds : {1, 9, 17, 33, 64, 1000, 3000}) {
    gsp::SimulationOptions const options{.worlds = worlds, .sleep = worlds == 1000};
    std::int64_t const told = gsp::bytes_needed(exec, model, compiled, options);
    auto const seen = watch([&] {
      auto state = gsp::make_state(exec, model, {.worlds = worlds});
      auto const simulation = gsp::make_simulation(exec, model, compiled, options);
    });
    std::int64_t const allocated = bytes_of(seen);
    CAPTURE(worlds);
    CHECK(std::abs(told - allocated) <= 16384 + allocated / 1000);
  }
  CHECK(gsp::bytes_needed(exec, model, compiled, {.worlds = 1 << 24}) > (std::int64_t(1) << 35));  // no overflow, nothing allocated
}

TEST_CASE_TEMPLATE("the bytes of a simulation with values for few worlds are told", Exec, GSP_TEST_EXECS) {
  Exec const exec;
  auto const compiled = gsp::compile(gsp::samples::quadruped_scene());
  auto model = gsp::make_model<float>(exec, compiled);
  auto const shared = gsp::bytes_needed(exec, model, compiled, {.worlds = 3});
  gsp::make_per_world(exec, model, {gsp::ModelField::body_mass}, 3);
  CHECK(gsp::bytes_needed(exec, model, compiled, {.worlds = 3}) == shared);
}

TEST_CASE_TEMPLATE("the bytes of pictures are told before they are allocated", Exec, GSP_TEST_EXECS) {
  Exec const exec;
  auto const compiled = gsp::compile(gsp::samples::quadruped_scene());
  auto const cloud = gsp::make_gaussians(exec, {gsp::sample_surface(compiled, {.count = 30000})});
  for (gsp::FrameOptions const options : {gsp::FrameOptions{.images = 40, .width = 320, .height = 240},
                                          gsp::FrameOptions{.images = 3, .width = 1000, .height = 700, .rgb = false},
                                          gsp::FrameOptions{.images = 64, .width = 64, .height = 48, .alpha = false, .batch = 64}}) {
    std::int64_t const told = gsp::bytes_needed(exec, cloud, options);
    auto const seen = watch([&] { auto const frames = gsp::make_frames(exec, cloud, options); });
    std::int64_t const allocated = bytes_of(seen);
    std::int64_t const fixed = std::int64_t(2) * exec.concurrency() * 256 * 8 + 4096;  // histograms of two sorts, and the small arrays
    CAPTURE(options.images);
    CHECK(told <= allocated);
    CHECK(told + fixed >= (gsp::is_device<Exec> ? allocated * 9 / 10 : allocated));  // the device's sort has scratch of its own
  }
}
