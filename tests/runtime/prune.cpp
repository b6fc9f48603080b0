#include <doctest/doctest.h>

#include <gsp/io/gaussians.hpp>
#include <gsp/runtime/prune.hpp>
#include <gsp/splat/prune_gaussians.hpp>
#include <support/kokkos_tools.hpp>

namespace {

/// Gaussians about the origin.
gsp::io::SplatSet some_set(std::size_t n, int sh_degree) {
  auto set = gsp::io::make_splat_set(n, sh_degree);
  std::size_t const numbers = 3 * std::size_t((sh_degree + 1) * (sh_degree + 1));
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t k = 0; k < 3; ++k) {
      set.positions[3 * i + k] = 0.001f * float((i * (k + 3) * 7919) % 2000) - 1;
      set.scales[3 * i + k] = 0.05f;
    }
    set.opacities[i] = 0.2f + 0.002f * float(i % 300);
    for (std::size_t k = 0; k < numbers; ++k) set.sh[numbers * i + k] = 0.01f * float((i * (k + 1)) % 100) - 0.3f;
  }
  return set;
}

}  // namespace

// gsp::runtime::prune against the same calls of the library itself, bit for bit.
TEST_CASE("prune keeps what prune_gaussians keeps, with its links") {
  using namespace gsp::runtime;
  Kokkos::DefaultHostExecutionSpace const exec;
  auto set = some_set(300, 1);
  std::vector<float> const viewmats{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 3, 0, 0, 0, 1, 0, 0, 1, 0, 0, 1, 0, 0, -1, 0, 0, 3, 0, 0, 0, 1},
      Ks{40, 0, 20, 0, 40, 16, 0, 0, 1, 40, 0, 20, 0, 40, 16, 0, 0, 1};
  CameraArrays cameras;
  cameras.viewmats = host_array(viewmats.data(), {2, 4, 4});
  cameras.Ks = host_array(Ks.data(), {2, 3, 3});
  PruningOptions options;
  options.width = 40;
  options.height = 32;
  options.keep = 0.4;
  auto const pruned = prune(Device::cpu, set, "set", {}, {}, cameras, options);
  CHECK(pruned.set.size() == 120);
  CHECK(pruned.sweeps > pruned.rounds);
  CHECK_NOTHROW(gsp::io::validate(pruned.set, "pruned"));

  auto const gaussians = gsp::io::to_gaussian_set(set, "set");
  auto const pruned_through = [&](std::vector<gsp::Lens> const& lenses) {
    auto cloud = gsp::make_gaussians(exec, gaussians);
    auto frames = gsp::make_frames(exec, cloud, {.images = 2, .width = 40, .height = 32});
    gsp::prune_gaussians(exec, cloud, gsp::make_poses<float>(exec, 1, 1, 0), gsp::make_cameras(exec, viewmats, Ks, {}, lenses), frames,
                         {.keep = 0.4});
    return gsp::pruned_set(exec, gaussians, cloud).set;
  };
  auto const check = [](gsp::io::SplatSet const& is, gsp::GaussianSet const& want) {
    CHECK(is.positions == want.positions);
    CHECK(is.opacities == want.opacities);
    CHECK(is.sh == want.sh);
  };
  check(pruned.set, pruned_through({}));
  auto const bent = gsp::opencv_lens({-0.3, 0.1, 0, 0}), fish = gsp::fisheye_lens({0.1, 0, 0, 0});
  for (auto const& lenses : {std::vector<gsp::Lens>{bent}, std::vector<gsp::Lens>{fish, bent}}) {
    cameras.lenses = lenses;
    auto const through = prune(Device::cpu, set, "set", {}, {}, cameras, options);
    check(through.set, pruned_through(lenses));
    CHECK(through.set.sh != pruned.set.sh);
  }
  cameras.lenses.assign(3, bent);
  CHECK_THROWS_AS(prune(Device::cpu, set, "set", {}, {}, cameras, options), std::invalid_argument);
  cameras.lenses = {};

  for (std::size_t i = 0; i < 10; ++i) set.link[i] = 0;
  set.link_names = {"nowhere"};
  CHECK_THROWS_AS(prune(Device::cpu, set, "set", {}, {}, cameras, options), gsp::Error);
  cameras.viewmats.dtype = Dtype::float64;
  set.link.assign(300, -1);
  CHECK_THROWS_AS(prune(Device::cpu, set, "set", {}, {}, cameras, options), std::invalid_argument);
}

// Another route: what Kokkos says it was asked for, but for the places that each round drops.
TEST_CASE("the bytes of pruning are told before they are allocated") {
  using namespace gsp::runtime;
  std::vector<float> viewmats, Ks;
  for (int c = 0; c < 8; ++c) {
    for (float const v : {1.f, 0.f, 0.f, 0.1f * float(c), 0.f, 1.f, 0.f, 0.f, 0.f, 0.f, 1.f, 6.f, 0.f, 0.f, 0.f, 1.f})
      viewmats.push_back(v);
    for (float const v : {40.f, 0.f, 20.f, 0.f, 40.f, 16.f, 0.f, 0.f, 1.f}) Ks.push_back(v);
  }
  struct Case {
    std::size_t gaussians;
    int sh_degree, width, height;
  };
  for (auto const [gaussians, sh_degree, width, height] : {Case{1000, 3, 20, 16}, Case{1000, 0, 100, 80}, Case{1000, 0, 20, 16}}) {
    auto const set = some_set(gaussians, sh_degree);
    CameraArrays cameras;
    cameras.viewmats = host_array(viewmats.data(), {8, 4, 4});
    cameras.Ks = host_array(Ks.data(), {8, 3, 3});
    PruningOptions options;
    options.width = width;
    options.height = height;
    options.keep = 0.95;  // a round
    std::int64_t const told = bytes_to_prune(Device::cpu, set, 8, options);
    auto const seen = gsp_test::watch([&] { prune(Device::cpu, set, "set", {}, {}, cameras, options); });
    std::int64_t allocated = 0;
    for (auto const& a : seen.allocations)
      if (a.label != "gsp::prune_gaussians::places") allocated += std::int64_t(a.bytes);
    CAPTURE(sh_degree);
    CAPTURE(width);
    CHECK(told >= allocated * 97 / 100);
    CHECK(told <= allocated * 103 / 100);
  }
}
