#include <doctest/doctest.h>

#include <gsp/io/gaussians.hpp>
#include <gsp/runtime/prune.hpp>
#include <gsp/splat/prune_gaussians.hpp>
#include <support/kokkos_tools.hpp>

// gsp::runtime::prune against the same calls of the library itself, bit for bit.
TEST_CASE("prune keeps what prune_gaussians keeps, with its links") {
  using namespace gsp::runtime;
  Kokkos::DefaultHostExecutionSpace const exec;
  auto set = gsp::io::make_splat_set(300, 1);
  for (std::size_t i = 0; i < set.size(); ++i) {
    for (std::size_t k = 0; k < 3; ++k) {
      set.positions[3 * i + k] = 0.001f * float((i * (k + 3) * 7919) % 2000) - 1;
      set.scales[3 * i + k] = 0.05f;
    }
    set.opacities[i] = 0.2f + 0.002f * float(i);
    for (std::size_t k = 0; k < 12; ++k) set.sh[12 * i + k] = 0.01f * float((i * (k + 1)) % 100) - 0.3f;
  }
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
  CHECK(bytes_to_prune(Device::cpu, set, 2, options) > 0);
  CHECK_NOTHROW(gsp::io::validate(pruned.set, "pruned"));

  auto const gaussians = gsp::io::to_gaussian_set(set, "set");
  auto cloud = gsp::make_gaussians(exec, gaussians);
  auto frames = gsp::make_frames(exec, cloud, {.images = 2, .width = 40, .height = 32});
  gsp::prune_gaussians(exec, cloud, gsp::make_poses<float>(exec, 1, 1, 0), gsp::make_cameras(exec, viewmats, Ks), frames, {.keep = 0.4});
  auto const want = gsp::pruned_set(exec, gaussians, cloud);
  CHECK(pruned.set.positions == want.set.positions);
  CHECK(pruned.set.opacities == want.set.opacities);
  CHECK(pruned.set.sh == want.set.sh);

  for (std::size_t i = 0; i < 10; ++i) set.link[i] = 0;
  set.link_names = {"nowhere"};
  CHECK_THROWS_AS(prune(Device::cpu, set, "set", {}, {}, cameras, options), gsp::Error);
  cameras.viewmats.dtype = Dtype::float64;
  set.link.assign(300, -1);
  CHECK_THROWS_AS(prune(Device::cpu, set, "set", {}, {}, cameras, options), std::invalid_argument);
}
