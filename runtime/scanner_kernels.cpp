#include <gsp/ray/ray_scan.hpp>
#include <gsp/runtime/scanner.hpp>
#include <gsp/splat/splat_target.hpp>
#include <optional>

#include "device.hpp"
#include "scene_sets.hpp"

namespace gsp::runtime {

template <class Exec>
class KokkosScanner : public Scanner {
  using Mem = typename Exec::memory_space;

 public:
  KokkosScanner(CompiledModel const& m, RayPattern const& pattern, RayMountOptions const& mount, RayScanOptions const& options,
                Scene const& splats)
      : model_(make_model<double>(exec_, m)),
        scene_(make_ray_scene<double>(exec_, model_, m, {.worlds = options.worlds})),
        scan_(make_ray_scan<double>(exec_, m, pattern, mount, options)) {
    if (splats.count() > 0) splats_ = make_splat_tree(exec_, sets_of(splats));
  }

  void begin(PoseArrays const& arrays) override { begin_ray_scan(exec_, poses_of(arrays), scan_); }
  void scan(PoseArrays const& arrays, std::int64_t step) override {
    auto const poses = poses_of(arrays);
    place_ray_geoms(exec_, model_, poses, scene_);
    if (splats_)
      scan_rays(exec_, scene_, poses, scan_, step, splat_target(*splats_));
    else
      scan_rays(exec_, scene_, poses, scan_, step);
    exec_.fence("gsp::runtime::Scanner::scan: done");
  }
  ScanArrays arrays() const override {
    ScanArrays arrays{array_of<Exec>(scan_.range), array_of<Exec>(scan_.geom), array_of<Exec>(scan_.point), array_of<Exec>(scan_.time), {}};
    if (scan_.splat.data()) arrays.splat = array_of<Exec>(scan_.splat);
    return arrays;
  }

 private:
  Poses<double, Mem> poses_of(PoseArrays const& p) const {
    for (auto const* const a : {&p.xpos, &p.xquat})
      expects(a->device == device_of<Exec>() && a->dtype == Dtype::float64 && a->rank == 3 && a->contiguous(),
              "gsp::runtime::Scanner::scan: poses must lie on the scanner's device, float64 (worlds, bodies, 3 | 4) one after the other");
    using View = typename Poses<double, Mem>::template View<double***>;
    Poses<double, Mem> poses;
    poses.xpos = View(static_cast<double*>(p.xpos.data), p.xpos.extents[0], p.xpos.extents[1], 3);
    poses.xquat = View(static_cast<double*>(p.xquat.data), p.xquat.extents[0], p.xquat.extents[1], 4);
    return poses;
  }

  Exec exec_;
  Model<double, Mem> model_;
  RayScene<double, Mem> scene_;
  RayScan<double, Mem> scan_;
  std::optional<SplatTree<Mem>> splats_;
};

std::unique_ptr<Scanner> make_scanner(Device device, CompiledModel const& model, RayPattern const& pattern, RayMountOptions const& mount,
                                      RayScanOptions const& options, Scene const& splats) {
  std::unique_ptr<Scanner> out;
  on_device(device, [&]<class Exec>(Exec const&) { out = std::make_unique<KokkosScanner<Exec>>(model, pattern, mount, options, splats); });
  return out;
}

}  // namespace gsp::runtime
