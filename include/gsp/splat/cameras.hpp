#pragma once
#include <gsp/core/check.hpp>
#include <gsp/core/detail/views.hpp>
#include <gsp/splat/lens.hpp>
#include <gsp/splat/look_at.hpp>
#include <string>
#include <vector>

namespace gsp {

/// Cameras, one an image: pinholes, or behind lenses. Image c shows world `world(c)`, or c % worlds where `world` is empty.
template <class Mem>
struct Cameras {
  using memory_space = Mem;
  template <class D>
  using View = Kokkos::View<D, Kokkos::LayoutRight, Mem>;
  View<float***> viewmats;    // (C, 4, 4) world to camera, rigid; camera axes: x right, y down, z forward
  View<float***> Ks;          // (C, 3, 3) fx 0 cx, 0 fy cy, 0 0 1 [pixel]; the centre of pixel (row i, column j) is (j + 0.5, i + 0.5)
  View<int*> world;           // (C) or (0)
  View<Lens*> lenses;         // (C) or (0): pinholes
  int width = 0, height = 0;  // of the pictures that they are for [pixel]; 0: of any
  int images() const { return static_cast<int>(viewmats.extent(0)); }
};

/// Room for `images` cameras, their numbers not yet set. Allocates.
template <ExecutionSpace Exec>
Cameras<typename Exec::memory_space> make_cameras(Exec const& exec, int images) {
  using Cam = Cameras<typename Exec::memory_space>;
  expects(images > 0, "gsp::make_cameras: the number of images must be positive");
  Cam cameras;
  cameras.viewmats = detail::allocate_zero<typename Cam::template View<float***>>(exec, "gsp::Cameras::viewmats", images, 4, 4);
  cameras.Ks = detail::allocate_zero<typename Cam::template View<float***>>(exec, "gsp::Cameras::Ks", images, 3, 3);
  cameras.world = detail::allocate_zero<typename Cam::template View<int*>>(exec, "gsp::Cameras::world", images);
  return cameras;
}

/// Cameras from host arrays: viewmats (C, 4, 4) and Ks (C, 3, 3), row-major; `world` (C), or empty; `lenses` (C), one for all, or empty.
template <ExecutionSpace Exec>
Cameras<typename Exec::memory_space> make_cameras(Exec const& exec, std::vector<float> const& viewmats, std::vector<float> const& Ks,
                                                  std::vector<int> const& world = {}, std::vector<Lens> const& lenses = {}) {
  using Cam = Cameras<typename Exec::memory_space>;
  std::size_t const n = viewmats.size() / 16;
  expects(viewmats.size() == 16 * n && Ks.size() == 9 * n, "gsp::make_cameras: viewmats must hold C x 16 numbers and Ks C x 9, not " +
                                                               std::to_string(viewmats.size()) + " and " + std::to_string(Ks.size()));
  expects(world.empty() || world.size() == n, "gsp::make_cameras: `world` must name one world a camera, or be empty");
  expects(lenses.size() <= 1 || lenses.size() == n, "gsp::make_cameras: `lenses` must hold one lens a camera, one for all, or be empty");
  auto const fresh = [](std::string const& label) { return Kokkos::view_alloc(Kokkos::WithoutInitializing, label); };
  Cam cameras;
  cameras.viewmats = typename Cam::template View<float***>(fresh("gsp::Cameras::viewmats"), n, 4, 4);
  cameras.Ks = typename Cam::template View<float***>(fresh("gsp::Cameras::Ks"), n, 3, 3);
  cameras.world = typename Cam::template View<int*>(fresh("gsp::Cameras::world"), world.size());
  auto const upload = [&](auto const& to, auto const& from) { detail::upload_bytes(exec, to.data(), from.data(), detail::bytes_of(to)); };
  upload(cameras.viewmats, viewmats);
  upload(cameras.Ks, Ks);
  upload(cameras.world, world);
  if (!lenses.empty()) {
    std::vector<Lens> const each = lenses.size() == n ? lenses : std::vector<Lens>(n, lenses.front());
    cameras.lenses = detail::to_device<typename Cam::template View<Lens*>>(exec, "gsp::Cameras::lenses", each);
  }
  exec.fence("gsp::make_cameras: the host arrays may go away");
  return cameras;
}

namespace detail {
/// Has each camera all that belongs to it?
template <class Mem>
void check_cameras(std::string const& function, Cameras<Mem> const& cameras) {
  auto const count = [](auto const& view) { return static_cast<int>(view.extent(0)); };
  auto const text = [](int n) { return std::to_string(n); };
  int const images = cameras.images();
  expects(count(cameras.Ks) == images,
          function + ": there are " + text(count(cameras.Ks)) + " Ks for " + text(images) + " cameras: give one a camera");
  expects(count(cameras.world) == 0 || count(cameras.world) >= images, function + ": there are worlds of " + text(count(cameras.world)) +
                                                                           " cameras for " + text(images) + ": give one a camera, or none");
  expects(count(cameras.lenses) == 0 || count(cameras.lenses) == images,
          function + ": there are " + text(count(cameras.lenses)) + " lenses for " + text(images) + " cameras: give one a camera, or none");
}
/// And are there as many as pictures, of their size?
template <class Mem>
void check_cameras(std::string const& function, Cameras<Mem> const& cameras, int images, int width, int height) {
  auto const text = [](int n) { return std::to_string(n); };
  check_cameras(function, cameras);
  expects(cameras.images() == images, function + ": there are " + text(cameras.images()) + " cameras for " + text(images) +
                                          " images: make_frames with {.images = " + text(cameras.images()) +
                                          "}, or as many cameras as images");
  expects(cameras.width == 0 || (cameras.width == width && cameras.height == height),
          function + ": the cameras are for pictures of " + text(cameras.width) + " x " + text(cameras.height) +
              " pixels, the frames have " + text(width) + " x " + text(height) + ": make mounts and frames with one size");
}
}  // namespace detail

}  // namespace gsp
