#include <gsp/ray/ray_scan.hpp>
#include <gsp/runtime/scanner.hpp>
#include <gsp/splat/splat_target.hpp>
#include <optional>
#include <string>

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
        scan_(make_ray_scan<double>(exec_, m, pattern, mount, options)),
        worlds_(options.worlds),
        bodies_(m.nbody) {
    if (splats.count() > 0) splats_ = make_splat_tree(exec_, sets_of(splats));
  }

  void begin(PoseArrays const& arrays) override {
    begin_ray_scan(exec_, poses_of("begin", arrays), scan_);
    exec_.fence("gsp::runtime::Scanner::begin: done");
  }
  void scan(PoseArrays const& arrays, std::int64_t step) override {
    auto const poses = poses_of("scan", arrays);
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
  Poses<double, Mem> poses_of(std::string const& function, PoseArrays const& p) const {
    auto const fits = [&](Array const& a, int components) {
      return a.device == device_of<Exec>() && a.dtype == Dtype::float64 && a.rank == 3 && a.contiguous() && a.extents[0] == worlds_ &&
             a.extents[1] == bodies_ && a.extents[2] == components;
    };
    expects(fits(p.xpos, 3) && fits(p.xquat, 4),
            "gsp::runtime::Scanner::" + function + ": poses must lie on the scanner's device, float64, one after the other: xpos (" +
                std::to_string(worlds_) + ", " + std::to_string(bodies_) + ", 3) and xquat (" + std::to_string(worlds_) + ", " +
                std::to_string(bodies_) + ", 4), such as Kinematics gives for as many worlds");
    using View = typename Poses<double, Mem>::template View<double***>;
    Poses<double, Mem> poses;
    poses.xpos = View(static_cast<double*>(p.xpos.data), worlds_, bodies_, 3);
    poses.xquat = View(static_cast<double*>(p.xquat.data), worlds_, bodies_, 4);
    return poses;
  }

  Exec exec_;
  Model<double, Mem> model_;
  RayScene<double, Mem> scene_;
  RayScan<double, Mem> scan_;
  int worlds_, bodies_;
  std::optional<SplatTree<Mem>> splats_;
};

std::unique_ptr<Scanner> make_scanner(Device device, CompiledModel const& model, RayPattern const& pattern, RayMountOptions const& mount,
                                      RayScanOptions const& options, Scene const& splats) {
  std::unique_ptr<Scanner> out;
  on_device(device, [&]<class Exec>(Exec const&) { out = std::make_unique<KokkosScanner<Exec>>(model, pattern, mount, options, splats); });
  return out;
}

}  // namespace gsp::runtime
