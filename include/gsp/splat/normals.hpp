#pragma once
#include <gsp/core/region.hpp>
#include <gsp/math/vec3.hpp>
#include <gsp/splat/cameras.hpp>

namespace gsp {

namespace detail {
template <class Mem>
struct NormalsOfDepth {
  Kokkos::View<float const***, Kokkos::LayoutRight, Mem> depth;
  Cameras<Mem> cameras;
  Kokkos::View<float****, Kokkos::LayoutRight, Mem> normals;

  KOKKOS_FUNCTION void operator()(std::int64_t i) const {
    int const width = int(depth.extent(2)), height = int(depth.extent(1));
    int const x = int(i % width), y = int(i / width % height), c = int(i / width / height);
    Vec3<float> normal{0, 0, 0};
    bool whole = x > 0 && y > 0 && x + 1 < width && y + 1 < height && depth(c, y, x) > 0;
    for (int k = -1; k <= 1 && whole; k += 2) whole = depth(c, y, x + k) > 0 && depth(c, y + k, x) > 0;
    auto const at = [&](int column, int row) {  // where the pixel's ray is so deep
      float const z = depth(c, row, column);
      if (cameras.lenses.extent(0) > 0) {
        LensPoint<double> ray;
        whole &= undistorted(cameras.lenses(c), (column + 0.5 - double(cameras.Ks(c, 0, 2))) / double(cameras.Ks(c, 0, 0)),
                             (row + 0.5 - double(cameras.Ks(c, 1, 2))) / double(cameras.Ks(c, 1, 1)), ray);
        return Vec3<float>{static_cast<float>(z * ray.x), static_cast<float>(z * ray.y), z};
      }
      return Vec3<float>{z * (float(column) + 0.5f - cameras.Ks(c, 0, 2)) / cameras.Ks(c, 0, 0),
                         z * (float(row) + 0.5f - cameras.Ks(c, 1, 2)) / cameras.Ks(c, 1, 1), z};
    };
    if (whole) {
      Vec3<float> const n = cross(at(x, y + 1) - at(x, y - 1), at(x + 1, y) - at(x - 1, y));
      bool const mirrored = (cameras.Ks(c, 0, 0) < 0) != (cameras.Ks(c, 1, 1) < 0);
      float const length = mirrored ? -norm(n) : norm(n);  // towards the camera
      auto const& v = cameras.viewmats;
      if (whole && length != 0)  // `at` may not have found a ray
        for (int k = 0; k < 3; ++k) normal[k] = (v(c, 0, k) * n.x + v(c, 1, k) * n.y + v(c, 2, k) * n.z) / length;
    }
    for (int k = 0; k < 3; ++k) normals(c, y, x, k) = normal[k];
  }
};
}  // namespace detail

/// Normals of what a depth picture shows, in world axes, towards the camera: of the plane through the pixel's four neighbours,
///   n ~ (p(x, y + 1) - p(x, y - 1)) x (p(x + 1, y) - p(x - 1, y)),   p(x, y) = z ((x + 1/2 - cx) / fx, (y + 1/2 - cy) / fy, 1)
/// and behind a lens (x/z, y/z) of the ray that comes to the pixel (`undistorted`).
/// 0 at the picture's edge, where it, or a neighbour, shows nothing (a depth that is not positive), and where no ray comes to a neighbour.
/// @param depth    (C, H, W) camera z [m]: Frames::depth, or MedianDepthChannel's, which mixes nothing that lies behind
/// @param cameras  of these pictures
/// @param normals  out: (C, H, W, 3)
/// Neither allocates nor fences. Cost: reads five depths and writes three numbers a pixel; behind lenses four rays a pixel beside. Errors:
/// std::invalid_argument for other sizes, lenses among them.
template <ExecutionSpace Exec, class Mem>
void normals_of_depth(Exec const& exec, std::type_identity_t<Kokkos::View<float const***, Kokkos::LayoutRight, Mem>> const& depth,
                      Cameras<Mem> const& cameras, Kokkos::View<float****, Kokkos::LayoutRight, Mem> const& normals) {
  Region const region("gsp::splat::normals_of_depth");
  static_assert(can_access<Exec, Cameras<Mem>>, "gsp::normals_of_depth: the cameras are not accessible from this execution space");
  expects(int(depth.extent(0)) == cameras.images(), "gsp::normals_of_depth: there are " + std::to_string(depth.extent(0)) +
                                                        " pictures of " + std::to_string(cameras.images()) +
                                                        " cameras: give those that drew them");
  auto const is_for = [](int pixels, std::size_t has) { return pixels == 0 || std::size_t(pixels) == has; };
  expects(is_for(cameras.width, depth.extent(2)) && is_for(cameras.height, depth.extent(1)),
          "gsp::normals_of_depth: the depth is of " + std::to_string(depth.extent(2)) + " x " + std::to_string(depth.extent(1)) +
              " pixels, the cameras are for " + std::to_string(cameras.width) + " x " + std::to_string(cameras.height) +
              ": give those that drew it");
  detail::check_cameras("gsp::normals_of_depth", cameras);
  expects(normals.extent(0) == depth.extent(0) && normals.extent(1) == depth.extent(1) && normals.extent(2) == depth.extent(2) &&
              normals.extent(3) == 3,
          "gsp::normals_of_depth: `normals` must be (images, height, width, 3) as the depth is");
  Kokkos::parallel_for("gsp::splat::normals_of_depth",
                       lightweight(Kokkos::RangePolicy<Exec, Kokkos::IndexType<std::int64_t>>(exec, 0, std::int64_t(depth.size()))),
                       detail::NormalsOfDepth<Mem>{depth, cameras, normals});
}

}  // namespace gsp
