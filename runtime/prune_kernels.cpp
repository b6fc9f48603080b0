#include <gsp/io/gaussians.hpp>
#include <gsp/runtime/prune.hpp>
#include <gsp/splat/prune_gaussians.hpp>

#include "poses_of.hpp"

namespace gsp::runtime {

namespace {
template <class T>
std::vector<T> numbers_of(Array const& a) {
  expects(!a || (a.device == Device::cpu && a.dtype == dtype_of<T>() && a.contiguous()),
          "gsp::runtime::prune: cameras are float32 on the host, their worlds int32");
  T const* const from = static_cast<T const*>(a.data);
  return a ? std::vector<T>(from, from + a.size()) : std::vector<T>{};
}

FrameOptions frame_options(int images, PruningOptions const& options) {
  FrameOptions o;
  o.images = images;
  o.width = options.width;
  o.height = options.height;
  o.batch = options.batch;
  o.values = detail::StepOfGaussian<Kokkos::HostSpace>::size;
  return o;
}

/// Those of `index`, with what is fitted.
io::SplatSet chosen(io::SplatSet const& all, PrunedSet const& left) {
  io::SplatSet out = io::make_splat_set(left.index.size(), all.sh_degree);
  for (std::size_t i = 0; i < left.index.size(); ++i) out.link[i] = all.link[std::size_t(left.index[i])];
  out.link_names = all.link_names;
  out.antialiased = all.antialiased;
  out.notes = all.notes;
  out.positions = left.set.positions;
  out.quats = left.set.quats;
  out.scales = left.set.scales;
  out.opacities = left.set.opacities;
  out.sh = left.set.sh;
  return out;
}
}  // namespace

Pruning prune(Device device, io::SplatSet const& set, std::string const& name, CompiledModel const& model, PoseArrays const& poses,
              CameraArrays const& arrays, PruningOptions const& options) {
  GaussianSet const gaussians = io::to_gaussian_set(set, model, name);
  Pruning out;
  on_device(device, [&]<class Exec>(Exec const& exec) {
    auto cloud = make_gaussians(exec, gaussians);
    auto const cameras =
        make_cameras(exec, numbers_of<float>(arrays.viewmats), numbers_of<float>(arrays.Ks), numbers_of<int>(arrays.world), arrays.lenses);
    auto frames = make_frames(exec, cloud, frame_options(cameras.images(), options));
    gsp::PruneOptions o;
    o.keep = options.keep;
    o.depth_weight = options.depth_weight;
    o.render.alpha_max = options.alpha_max;
    o.render.near = options.near;
    auto const with = [&](auto const& p) {
      auto const report = prune_gaussians(exec, cloud, p, cameras, frames, o);
      out.rounds = report.rounds;
      out.sweeps = report.sweeps;
    };
    if (!poses.xpos)
      with(make_poses<float>(exec, 1, std::max(1, cloud.bodies), 0));
    else if (poses.xpos.dtype == Dtype::float64)
      with(poses_of<double, Exec>("gsp::runtime::prune", poses));
    else
      with(poses_of<float, Exec>("gsp::runtime::prune", poses));
    out.set = chosen(set, pruned_set(exec, gaussians, cloud));
  });
  return out;
}

std::int64_t bytes_to_prune(Device device, io::SplatSet const& set, int cameras, PruningOptions const& options) {
  std::int64_t const n = std::int64_t(set.size()), unknowns = detail::unknowns_of(set.sh_degree);
  std::int64_t bytes = n * (unknowns * (3 * 8 + 4 * 4 + 2 * 4) + 64) + std::int64_t(16) * cameras * options.width * options.height;
  on_device(device, [&]<class Exec>(Exec const& exec) {
    Gaussians<typename Exec::memory_space> of;  // sizes alone
    of.count = of.most_count = int(n);
    of.bodies = 1 + int(set.link_names.size());
    of.most_clusters = int(n / of.cluster_size) + of.bodies;
    bytes += bytes_needed(exec, of, frame_options(cameras, options));
  });
  return bytes;
}

}  // namespace gsp::runtime
