// Frames per second of whole pictures: kitchen.spz (GSP_DATA_DIR/splats), 640 x 480, RGB + expected depth + alpha, every camera different.
//   bench_splat_render [--images N] [--batch B] [--scene FILE] [--width W --height H] [--cameras F.npz] [--npz F.npz] [--png
//   FOLDER]
// --cameras: viewmats and Ks, of which the first N are taken; --npz: the pictures, for bench/peers/compare_with_gsplat.py.
// Each backend that was compiled in runs; on a device as many images as fit its memory well.
#include <filesystem>
#include <gsp/io/colormap.hpp>
#include <gsp/io/gaussians.hpp>
#include <gsp/io/npz.hpp>
#include <gsp/io/png.hpp>
#include <gsp/splat/render.hpp>
#include <random>
#include <support/bench.hpp>

namespace {

struct Arguments {
  int images = 0, batch = 0, width = 640, height = 480;
  std::string scene, png, cameras, npz;
};

// Random places in a box of a y-down room, looking around, a little down: as a robot's cameras in the kitchen.
void room_cameras(int count, int width, int height, std::vector<float>& viewmats, std::vector<float>& Ks) {
  std::mt19937 random(7);
  auto const uniform = [&](double a, double b) { return a + (b - a) * (random() / 4294967296.); };
  for (int c = 0; c < count; ++c) {
    gsp::Vec3<double> const eye{uniform(-1, 1), uniform(-1.7, -1), uniform(-.5, .5)};
    double const yaw = uniform(0, 6.283185307179586), pitch = uniform(-.1, .5);
    gsp::Vec3<double> const forward{std::cos(yaw) * std::cos(pitch), std::sin(pitch), std::sin(yaw) * std::cos(pitch)};
    gsp::Vec3<double> const right = gsp::normalized(gsp::cross(gsp::Vec3<double>{0, 1, 0}, forward)), down = gsp::cross(forward, right);
    for (auto const& axis : {right, down, forward})
      for (double x : {axis.x, axis.y, axis.z, -gsp::dot(axis, eye)}) viewmats.push_back(static_cast<float>(x));
    for (float x : {0.f, 0.f, 0.f, 1.f}) viewmats.push_back(x);
    float const f = static_cast<float>(.5 * height / std::tan(.5236));
    for (float x : {f, 0.f, .5f * width, 0.f, f, .5f * height, 0.f, 0.f, 1.f}) Ks.push_back(x);
  }
}

template <class Exec>
void run(Exec const& exec, Arguments const& a, gsp::GaussianSet const& scene) {
  int const images = a.images > 0 ? a.images : gsp::is_device<Exec> ? 256 : 8;
  std::vector<float> viewmats, Ks;
  if (a.cameras.empty()) {
    room_cameras(images, a.width, a.height, viewmats, Ks);
  } else {
    auto const file = gsp::io::read_npz(a.cameras);
    viewmats = file.at("viewmats").as<float>();
    Ks = file.at("Ks").as<float>();
    viewmats.resize(std::size_t(images) * 16);
    Ks.resize(std::size_t(images) * 9);
  }
  auto const cloud = gsp::make_gaussians(exec, scene);
  auto const cameras = gsp::make_cameras(exec, viewmats, Ks);
  auto poses = gsp::make_poses<float>(exec, 1, cloud.bodies, 0);
  auto frames = gsp::make_frames(exec, cloud, {.images = images, .width = a.width, .height = a.height, .batch = a.batch});
  gsp::render(exec, cloud, poses, cameras, frames);
  auto const all = gsp_bench::measure(exec, [&] { gsp::render(exec, cloud, poses, cameras, frames); }, {.seconds = 0.5});

  // the last wave, stage by stage
  auto const& wave = frames.wave;
  int const first = (images - 1) / wave.batch * wave.batch;
  gsp::RenderOptions const options;
  auto const stage = [&](auto const& f) { return gsp_bench::measure(exec, f, {.seconds = 0.05}).median / wave.images; };
  double const place = stage([&] { gsp::place_gaussians(exec, cloud, poses, cameras, first, frames); });
  double const project = stage([&] { gsp::project(exec, cloud, frames, options); });
  double const projected_and_binned = stage([&] { gsp::project(exec, cloud, frames, options), gsp::bin_tiles(exec, frames); });
  double const rasterize = stage([&] { gsp::rasterize(exec, frames, options); });
  std::int64_t needed[3];
  Kokkos::deep_copy(Kokkos::View<std::int64_t[3], Kokkos::HostSpace, Kokkos::MemoryUnmanaged>(needed), wave.needed);

  double const per_visible = sizeof(gsp::Splat) + sizeof(gsp::SplatOrigin) + 2 * 8 + 8, per_pair = gsp::is_device<Exec> ? 20 : 16;
  gsp_bench::Line("splat/render", exec)
      .add("scene", std::filesystem::path(a.scene).filename().string())
      .add("gaussians", cloud.count)
      .add("images", images)
      .add("batch", wave.batch)
      .add("width", a.width)
      .add("height", a.height)
      .add("precision", "float")
      .add(all)
      .add("frames_per_second", images / all.median)
      .add("us_place", 1e6 * place)
      .add("us_project", 1e6 * project)
      .add("us_bin", 1e6 * (projected_and_binned - project))
      .add("us_rasterize", 1e6 * rasterize)
      .add("visible_in_fullest_wave", needed[0])
      .add("pairs_in_fullest_wave", needed[1])
      .add("wave_bytes", per_visible * wave.visible_capacity + per_pair * wave.pair_capacity)
      .add_hash(frames.rgb)
      .print();

  if (!a.npz.empty()) {
    std::size_t const n = std::size_t(images), h = std::size_t(a.height), w = std::size_t(a.width);
    auto const host = [](auto const& view) {
      auto const copy = Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, view);
      return std::vector<float>(copy.data(), copy.data() + copy.size());
    };
    gsp::io::write_npz(a.npz, {{"rgb", {{n, h, w, 3}, host(frames.rgb)}},
                               {"depth", {{n, h, w}, host(frames.depth)}},
                               {"alpha", {{n, h, w}, host(frames.alpha)}}});
  }
  if (a.png.empty()) return;
  auto const rgb = Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, frames.rgb);
  auto const depth = Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, frames.depth);
  std::filesystem::create_directories(a.png);
  for (int c = 0; c < std::min(images, 8); ++c) {
    std::string const name = a.png + "/" + Exec::name() + std::to_string(c);
    gsp::io::write_png(name + ".png", gsp::io::to_bitmap8(&rgb(c, 0, 0, 0), a.width, a.height, 3));
    gsp::io::write_png(name + "_depth.png", gsp::io::depth_to_color(&depth(c, 0, 0), a.width, a.height));
  }
}

}  // namespace

int main(int argc, char** argv) {
  Kokkos::ScopeGuard kokkos(argc, argv);
  Arguments a;
  a.scene = gsp_bench::data_file("splats/kitchen.spz");
  for (int i = 1; i + 1 < argc; i += 2) {
    std::string const key = argv[i], value = argv[i + 1];
    if (key == "--images") a.images = std::atoi(value.c_str());
    if (key == "--batch") a.batch = std::atoi(value.c_str());
    if (key == "--width") a.width = std::atoi(value.c_str());
    if (key == "--height") a.height = std::atoi(value.c_str());
    if (key == "--scene") a.scene = value;
    if (key == "--png") a.png = value;
    if (key == "--cameras") a.cameras = value;
    if (key == "--npz") a.npz = value;
  }
  if (!std::filesystem::exists(a.scene)) {
    std::printf("skipped: %s is missing; set GSP_DATA_DIR\n", a.scene.c_str());
    return 0;
  }
  auto const scene = gsp::io::to_gaussian_set(gsp::io::read_splats(a.scene), a.scene);
#if defined(KOKKOS_ENABLE_CUDA)
  run(Kokkos::Cuda{}, a, scene);
  if (a.images > 16) return 0;  // that many are meant for the device
#endif
  run(Kokkos::OpenMP{}, a, scene);
}
