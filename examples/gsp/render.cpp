// gsp render: pictures and videos of Gaussians, of a model's links in any pose, from cameras of a file.
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <gsp/io/colormap.hpp>
#include <gsp/io/npz.hpp>
#include <gsp/io/png.hpp>
#include <gsp/io/video.hpp>
#include <gsp/model/names.hpp>
#include <nlohmann/json.hpp>
#include <set>

#include "commands.hpp"
#include "device.hpp"
#include "files.hpp"
#include "progress.hpp"

namespace gsp_cli {
namespace {

constexpr int tile_padding = 2;  // between pictures of one frame

/// Pictures on the host; empty where a channel was not asked for.
struct Pictures {
  std::vector<float> rgb, depth, alpha;  // (C, H, W, 3), (C, H, W), (C, H, W)
};

std::string numbered(std::string const& folder, char const* kind, std::size_t i, std::size_t count) {
  std::string number = std::to_string(i);
  number.insert(0, std::max<std::size_t>(4, std::to_string(count - 1).size()) - number.size(), '0');
  return (std::filesystem::path(folder) / (std::string(kind) + "_" + number + ".png")).string();
}

/// Writes the pictures of `some`, the first of which is number `first` of `total`.
void write_pngs(std::string const& folder, Pictures const& some, std::size_t first, std::size_t total, int width, int height,
                Progress& progress) {
  std::size_t const pixels = static_cast<std::size_t>(width) * height,
                    n = std::max({some.rgb.size() / 3, some.depth.size(), some.alpha.size()}) / pixels;
  for (std::size_t i = 0; i < n; ++i) {
    if (!some.rgb.empty())
      gsp::io::write_png(numbered(folder, "rgb", first + i, total), gsp::io::to_bitmap8(&some.rgb[3 * pixels * i], width, height, 3));
    if (!some.depth.empty()) {
      gsp::io::write_png(numbered(folder, "depth", first + i, total), gsp::io::depth_to_bitmap16(&some.depth[pixels * i], width, height));
      gsp::io::write_png(numbered(folder, "depth_color", first + i, total),
                         gsp::io::depth_to_color(&some.depth[pixels * i], width, height));
    }
    if (!some.alpha.empty())
      gsp::io::write_png(numbered(folder, "alpha", first + i, total), gsp::io::to_bitmap8(&some.alpha[pixels * i], width, height, 1));
    progress.show(double(first + i + 1) / double(total));
  }
}

/// One camera n times.
CameraFile same_camera(CameraFile const& one, std::size_t n) {
  CameraFile out;
  for (std::size_t i = 0; i < n; ++i) out.add(one, 0);
  return out;
}

/// Cameras first, first + step, first + 2 step ...
CameraFile every_camera(CameraFile const& all, std::size_t first, std::size_t step) {
  CameraFile out;
  for (std::size_t i = first; i < all.count; i += step) out.add(all, i);
  return out;
}

/// How much faster than in its middle the lens grows outwards in the corners of the picture that camera i makes, at most; corners that no
/// ray comes to aside.
double growth_in_corners(CameraFile const& cameras, std::size_t i, int width, int height) {
  auto const& lens = cameras.lenses[cameras.lenses.size() > 1 ? i : 0];
  float const* const K = &cameras.Ks[9 * i];
  double most = 0;
  for (double const column : {0., double(width)})
    for (double const row : {0., double(height)}) {
      gsp::LensPoint<double> ray;
      if (!gsp::undistorted(lens, (column - K[2]) / K[0], (row - K[5]) / K[4], ray)) continue;
      double const r = ray.x * ray.x + ray.y * ray.y;
      auto const J = gsp::distortion_slope(lens, ray.x, ray.y);
      if (r > 0) most = std::max(most, (ray.x * ray.x * J.xx + 2 * ray.x * ray.y * J.xy + ray.y * ray.y * J.yy) / r);
    }
  return most;
}

/// A Gaussian takes the slope that the lens has at its centre: says so where that is another by far in the corners.
void tell_of_lenses(CameraFile const& cameras, std::string const& path, int width, int height) {
  std::size_t steep = 0, first = 0;
  double worst = 0;
  for (std::size_t i = 0; i < cameras.count && !cameras.lenses.empty(); ++i) {
    if (cameras.lenses[cameras.lenses.size() > 1 ? i : 0].model == gsp::Lens::Model::fisheye) continue;
    double const grows = growth_in_corners(cameras, i, width, height);
    if (!(grows > 2)) continue;
    if (steep++ == 0) first = i;
    worst = std::max(worst, grows);
  }
  if (steep > 0)
    std::fprintf(
        stderr,
        "%s[distortion]: the lens of camera %zu%s grows up to %.2g times as fast in the corners as in the middle, so near Gaussians "
        "smear there; calibrate it as a fisheye (docs/splat/lens.md)\n",
        path.c_str(), first, steep > 1 ? (" and of " + std::to_string(steep - 1) + " more").c_str() : "", worst);
}

/// Adds the numbers of those of `some` that show no Gaussian; the first of them is picture `first`. Black ones show in alpha and depth
/// alone.
void note_empty(Pictures const& some, std::size_t first, std::size_t n, std::vector<std::size_t>& empty) {
  auto const& numbers = !some.alpha.empty() ? some.alpha : !some.depth.empty() ? some.depth : some.rgb;
  std::size_t const each = numbers.size() / n;
  for (std::size_t i = 0; i < n; ++i)
    if (shows_nothing(&numbers[i * each], each)) empty.push_back(first + i);
}
/// camera: its name, or empty where the pictures are told by their numbers.
void tell_of_empty(std::vector<std::size_t> const& empty, std::size_t count, std::string const& camera) {
  if (empty.empty()) return;
  std::string which = camera.empty() ? empty.size() > 1 ? "pictures " : "picture " : camera + " sees no Gaussian in ";
  std::size_t const most = 8;  // enough to see which
  for (std::size_t k = 0; k < std::min(most, empty.size()) && camera.empty(); ++k) which += (k ? ", " : "") + std::to_string(empty[k]);
  if (!camera.empty())
    which += std::to_string(empty.size()) + " of " + std::to_string(count) + " pictures";
  else
    which += std::string(empty.size() > most ? " ..." : "") + " of " + std::to_string(count) + (empty.size() > 1 ? " show" : " shows") +
             " no Gaussian" + (empty.size() > most ? " (" + std::to_string(empty.size()) + ")" : "");
  std::fprintf(stderr, "%s: turn the camera to the scene, or let --splat-pose say where that stands\n", which.c_str());
}

/// Notes links with geoms that no file has Gaussians of, while others have some: they are not drawn.
void tell_of_bare_links(std::set<std::string> const& carried, std::string const& path, gsp::CompiledModel const& model) {
  std::string names;
  std::size_t bare = 0;
  for (int b = 1; b < model.nbody; ++b) {
    std::string const& name = model.body_name[static_cast<std::size_t>(b)];
    if (carried.count(name) || std::find(model.geom_body.begin(), model.geom_body.end(), b) == model.geom_body.end()) continue;
    if (bare++ < 3) names += (names.empty() ? "'" : ", '") + name + "'";
  }
  if (bare > 3) names += ", ...";
  if (bare > 0)
    std::fprintf(stderr, "%s: no file of --splat has Gaussians of %s (links with geoms: %zu), which no picture shows; bind some to %s\n",
                 path.c_str(), names.c_str(), bare, bare == 1 ? "it" : "them");
}

/// Notes cameras whose axis is more than a fifth of the picture from its middle, as where K was made for pictures of another size.
void tell_of_sizes(CameraFile const& cameras, std::string const& path, int width, int height) {
  std::size_t others = 0;
  for (std::size_t c = 0; c < cameras.count; ++c) {
    float const *K = &cameras.Ks[9 * c], u = K[2] / static_cast<float>(width), v = K[5] / static_cast<float>(height);
    others += !(u > 0.3f && u < 0.7f && v > 0.3f && v < 0.7f);
  }
  if (others > 0)
    std::fprintf(stderr,
                 "%s: the axis of %zu of %zu cameras is more than a fifth of the picture from the middle of %d x %d: if their Ks are of "
                 "another size, give that as --width and --height\n",
                 path.c_str(), others, cameras.count, width, height);
}

/// Entries of a trace a second: by the median of the times between them, since the last of them may be shorter than the others.
double frames_per_second(Trace const& trace, std::string const& path) {
  std::vector<double> steps;
  for (std::size_t t = 1; t < trace.entries; ++t) steps.push_back(trace.time[t] - trace.time[t - 1]);
  if (steps.empty()) return 25;
  auto const middle = steps.begin() + static_cast<std::ptrdiff_t>(steps.size() / 2);
  std::nth_element(steps.begin(), middle, steps.end());
  char seconds[32];
  std::snprintf(seconds, sizeof seconds, "%.4g", *middle);
  if (!(*middle >= 0.999e-3 && *middle <= 1000))
    throw Error(path + "[time]: entries are " + seconds +
                " s apart, of which no video of 0.001 to 1000 frames a second comes; give --fps, or take a trace with another --every");
  return std::round(1e6 * std::min(1000., 1 / *middle)) / 1e6;  // times are rounded
}

/// World `world` of a trace, alone.
Trace of_world(Trace const& all, std::size_t world, std::size_t nq) {
  Trace one;
  one.entries = all.entries;
  one.worlds = 1;
  one.time = all.time;
  for (std::size_t t = 0; t < all.entries; ++t) {
    auto const start = all.qpos.begin() + static_cast<std::ptrdiff_t>((t * all.worlds + world) * nq);
    one.qpos.insert(one.qpos.end(), start, start + static_cast<std::ptrdiff_t>(nq));
  }
  return one;
}

/// Writes the pictures of `some` as frames, each of as many side by side as there are worlds; `tiles` keeps those of an entry that has not
/// come as a whole yet.
void write_frames(gsp::io::VideoWriter& video, std::vector<gsp::io::Bitmap8>& tiles, std::vector<float> const& rgb, std::size_t worlds,
                  int columns, int width, int height) {
  std::size_t const numbers = 3 * static_cast<std::size_t>(width) * height;
  for (std::size_t i = 0; i < rgb.size() / numbers; ++i) {
    tiles.push_back(gsp::io::to_bitmap8(&rgb[numbers * i], width, height, 3));
    if (tiles.size() < worlds) continue;
    video.write(worlds == 1 ? tiles.front() : gsp::io::contact_sheet(tiles, columns, tile_padding));
    tiles.clear();
  }
}

int run(Arguments const& a) {
  if (!a.has("--splat")) a.fail("needs --splat FILE: the Gaussians to draw (.ply, .spz, ...; gsp convert names all)");
  if (!a.has("--cameras") && !a.has("--camera"))
    a.fail("needs --cameras C.npz: viewmats (C,4,4) and Ks (C,3,3); or --camera NAME|INDEX, one of the model's");
  a.exclusive("--cameras", "--camera", "both say where the camera stands");
  a.needs("--camera", "--model", "it is one of the model's");
  a.exclusive("--keyframe", "--trace", "both say where the model stands");
  a.needs("--keyframe", "--model", "a keyframe belongs to a model");
  a.needs("--trace", "--model", "a trace belongs to a model");
  a.needs("--skip-visuals", "--model", "it is about a model's geoms");
  a.needs("--world", "--trace", "it is one of the trace's worlds");
  a.needs("--fps", "--video", "it is about its frames");
  auto const files = a.all("--splat"), poses = a.all("--splat-pose");
  if (poses.size() > files.size())
    a.fail("--splat-pose is given " + std::to_string(poses.size()) + " times for " + std::to_string(files.size()) +
           " --splat; the k-th pose belongs to the k-th file, leave the others out");
  gsp::runtime::RendererOptions options;
  options.width = static_cast<int>(a.integer("--width", 640, 1, 16384));
  options.height = static_cast<int>(a.integer("--height", 480, 1, 16384));
  options.batch = static_cast<int>(a.integer("--batch", 0, 1, 65536));
  options.alpha_max = static_cast<float>(a.real("--alpha-max", 0.999, 0, 1));
  if (!(options.alpha_max < 1)) a.fail("--alpha-max is 1: some light must come through; give a number below 1, such as 0.999");
  bool const video_alone = a.has("--video") && !a.has("--out") && !a.has("--npz");
  auto const channels = a.list("--channels", {"rgb", "depth", "alpha"},
                               video_alone ? std::vector<std::string>{"rgb"} : std::vector<std::string>{"rgb", "depth"});
  auto const wanted = [&](char const* c) { return std::find(channels.begin(), channels.end(), c) != channels.end(); };
  options.rgb = wanted("rgb");
  options.depth = wanted("depth");
  options.alpha = wanted("alpha");
  if (a.has("--video") && !options.rgb) a.fail("--video shows rgb, and --channels is without; add rgb to it");
  double const fps = a.real_from("--fps", 0, 0.001, 1000);
  int const repeat = static_cast<int>(a.integer("--repeat", 1, 1, 1000000));
  int const threads = threads_of(a);
  auto const out = a.text("--out"), npz = a.text("--npz"), video = a.text("--video");
  Device const device = choose_device(a);
  if (npz || video) {
    std::vector<NamedFile> inputs, outputs;
    if (npz) {
      expect_writable(*npz, "--npz");
      outputs.push_back({"--npz", *npz});
    }
    if (video) {
      auto const written = gsp::io::video_path(*video).string();
      expect_writable(written, "--video");
      outputs.push_back({"--video", written});
    }
    for (char const* option : {"--splat", "--cameras", "--model", "--trace"})
      for (auto const& file : a.all(option)) inputs.push_back({option, file});
    expect_apart(inputs, outputs);
  }

  // All input is read before anything is written.
  gsp::CompiledModel model;
  Trace trace;
  if (auto const path = a.text("--model")) {
    model = load_model(*path, a);
    if (auto const file = a.text("--trace")) {
      trace = read_trace(*file, model);
    } else {
      auto const s = initial_state(model, *path, a.text("--keyframe"));
      trace.entries = 1;
      trace.worlds = 1;
      trace.qpos = s.qpos;
      place_mocap(model, s);
    }
    if (auto const s = summary(model); !s.empty() && !quiet(a))
      std::fprintf(stderr, "%s: %s ('gsp info' lists them)\n", path->c_str(), s.c_str());
  } else {
    trace.entries = trace.worlds = 1;
  }
  auto const of_model = a.text("--camera");
  int const camera = of_model ? named_or_index(*a.text("--model"), "camera", model.cam_name, *of_model) : -1;
  CameraFile cameras = of_model ? CameraFile{} : read_cameras(*a.text("--cameras"), quiet(a));
  if (a.has("--world")) {
    auto const world = static_cast<std::size_t>(a.integer("--world", 0, 0, 1 << 24));
    if (world >= trace.worlds)
      a.fail("--world " + *a.text("--world") + ": there are " + std::to_string(trace.worlds) + " worlds; give 0 to " +
             std::to_string(trace.worlds - 1));
    if (cameras.count == trace.entries * trace.worlds) cameras = every_camera(cameras, world, trace.worlds);
    trace = of_world(trace, world, static_cast<std::size_t>(model.nq));
  }
  if (!of_model && !quiet(a)) tell_of_lenses(cameras, *a.text("--cameras"), options.width, options.height);
  std::size_t const states = trace.entries * trace.worlds;
  if (!of_model && a.has("--trace") && cameras.count != states && cameras.count != 1)
    throw Error(*a.text("--cameras") + ": holds " + std::to_string(cameras.count) + " cameras, but the trace has " +
                std::to_string(trace.entries) + " entries of " + std::to_string(trace.worlds) + " worlds; write " + std::to_string(states) +
                " cameras (picture t*N+w shows world w at entry t), or one for all");
  std::size_t const count = a.has("--trace") || of_model ? states : cameras.count;
  std::size_t const channel_count = (options.rgb ? 3u : 0u) + (options.depth ? 1u : 0u) + (options.alpha ? 1u : 0u),
                    bytes_each = static_cast<std::size_t>(options.width) * options.height * channel_count * sizeof(float);
  if (npz && count * static_cast<std::size_t>(options.width) * options.height * 12 >= 0xff000000ull && options.rgb)
    throw Error(*npz + ": " + std::to_string(count) + " pictures of " + std::to_string(options.width) + " x " +
                std::to_string(options.height) + " pass 4 GiB, the limit of npz files here; render fewer at a time or use --out");

  std::size_t const tiles = a.has("--trace") ? trace.worlds : 1;  // of a frame
  int const columns = gsp::io::sheet_columns(static_cast<int>(tiles), options.width, options.height);
  double rate = fps;
  if (video) {
    if (rate == 0) rate = a.has("--trace") ? frames_per_second(trace, *a.text("--trace")) : 25;
    int const most = 16384;  // H.264's
    int const rows = (static_cast<int>(tiles) + columns - 1) / columns;
    if (columns * (options.width + tile_padding) > most || rows * (options.height + tile_padding) > most)
      throw Error(*video + ": " + std::to_string(tiles) + " worlds of " + std::to_string(options.width) + " x " +
                  std::to_string(options.height) + " on one sheet pass " + std::to_string(most) +
                  " pixels, the most that a video has; give --world W, or a smaller --width and --height");
  }

  gsp::runtime::Scene scene;
  std::set<std::string> carried;  // links with Gaussians of files
  for (std::size_t i = 0; i < files.size(); ++i) {
    auto const set = load_splats(files[i], i < poses.size() ? gsp::io::parse_splat_pose(poses[i]) : gsp::io::SplatPose{});
    scene.add_set(set, files[i], model);
    for (int const link : set.link)
      if (link >= 0) carried.insert(set.link_names[static_cast<std::size_t>(link)]);
  }
  if (!carried.empty() && !quiet(a)) tell_of_bare_links(carried, *a.text("--model"), model);
  gsp::runtime::Session const session(threads);  // once all is read: a GPU starts meanwhile
  if (model.nbody > 1 && carried.empty()) scene.add_surface(model);
  auto const renderer = gsp::runtime::make_renderer(device, scene, options);
  auto const kinematics = gsp::runtime::make_kinematics(device, model);

  // Pictures go through in portions, so that memory does not grow with their number.
  // A video alone takes small ones: the first is drawn twice, and ffmpeg works while the next is drawn.
  std::size_t const budget = (device == Device::cuda ? std::size_t(16) << 30 : std::size_t(1) << 30) / (video_alone ? 16 : 1);
  std::size_t const portion = std::clamp<std::size_t>(budget / bytes_each, 1, count);
  expect_memory(std::to_string(portion) + (portion == count ? "" : " of " + std::to_string(count)) + " pictures of " +
                    std::to_string(options.width) + " x " + std::to_string(options.height),
                device, static_cast<std::uint64_t>(renderer->bytes_needed(static_cast<int>(portion))),
                (out || npz || video ? portion : 0) * bytes_each + (npz ? count * bytes_each : 0) +
                    (video ? tiles * 6 * static_cast<std::size_t>(options.width) * options.height : 0),
                "smaller ones, fewer cameras or --out in place of --npz");
  if (out) make_folder(*out, "--out");
  std::optional<gsp::io::VideoWriter> film;
  std::vector<gsp::io::Bitmap8> frame_tiles;
  if (video) film.emplace(*video, gsp::io::VideoOptions{.frames_per_second = rate});
  double const startup = seconds_since_start();
  Pictures all;
  std::vector<std::size_t> empty;
  double seconds = 0;
  std::size_t const nq = static_cast<std::size_t>(model.nq);
  Progress progress("drawing", quiet(a));
  for (std::size_t first = 0; first < count; first += portion) {
    std::size_t const n = std::min(portion, count - first);
    bool const moves = a.has("--trace");  // picture i shows entry i of the trace, else all show the one state
    auto const poses = kinematics->poses(
        gsp::runtime::host_array(trace.qpos.data() + (moves ? first * nq : 0), {moves ? static_cast<std::int64_t>(n) : 1, model.nq}));
    auto const views = cameras.count == 1 ? same_camera(cameras, n) : cameras;
    auto const arrays =
        of_model ? kinematics->cameras(camera, options.width, options.height) : views.arrays(cameras.count == 1 ? 0 : first, n);
    if (repeat > 1 || first == 0) renderer->render(poses, arrays);  // untimed: buffers find their size
    auto const start = std::chrono::steady_clock::now();
    for (int r = 0; r < repeat; ++r) {
      renderer->render(poses, arrays);
      progress.show((double(first) + double(n) * double(r + 1) / repeat * (out || video ? 0.1 : 1)) / double(count));
    }
    seconds += std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    if (!out && !npz && !video) continue;
    auto const frames = renderer->frames();
    Pictures const some{fetch(frames.rgb), fetch(frames.depth), fetch(frames.alpha)};
    note_empty(some, first, n, empty);
    if (out) write_pngs(*out, some, first, count, options.width, options.height, progress);
    if (film) write_frames(*film, frame_tiles, some.rgb, tiles, columns, options.width, options.height);
    progress.show(double(first + n) / double(count));
    if (npz) {
      auto const join = [](std::vector<float>& to, std::vector<float> const& from) { to.insert(to.end(), from.begin(), from.end()); };
      join(all.rgb, some.rgb);
      join(all.depth, some.depth);
      join(all.alpha, some.alpha);
    }
  }
  if (npz) {
    std::size_t const h = static_cast<std::size_t>(options.height), w = static_cast<std::size_t>(options.width);
    std::vector<gsp::io::NpzEntry> entries;
    if (options.rgb) entries.push_back({"rgb", {{count, h, w, 3}, all.rgb}});
    if (options.depth) entries.push_back({"depth", {{count, h, w}, all.depth}});
    if (options.alpha) entries.push_back({"alpha", {{count, h, w}, all.alpha}});
    gsp::io::write_npz(*npz, entries);
  }
  if (film) film->finish();
  progress.finish();
  if (!out && !npz && !video && !quiet(a)) std::fprintf(stderr, "nothing is written; --out, --npz or --video say what to keep\n");
  if (film && !film->note().empty()) std::fprintf(stderr, "%s\n", film->note().c_str());  // with --quiet too: no mp4 is there
  if (!of_model && !quiet(a)) tell_of_sizes(cameras, *a.text("--cameras"), options.width, options.height);
  if (!quiet(a)) tell_of_empty(empty, count, of_model ? camera_name(model, camera) : "");
  std::FILE* const say = text_beside(npz);
  double const frames = double(count) * repeat;
  if (a.has("--json")) {
    nlohmann::ordered_json json{{"seconds", seconds},
                                {"frames_per_second", frames / seconds},
                                {"startup_seconds", startup},
                                {"peak_bytes", peak_bytes(device)},
                                {"images", count},
                                {"width", options.width},
                                {"height", options.height},
                                {"gaussians", scene.count()},
                                {"device", device_name(device)}};
    if (film) json.update({{"video", film->path().string()}, {"video_frames", count / tiles}, {"video_frames_per_second", rate}});
    std::fprintf(say, "%s\n", json.dump().c_str());
  } else {
    std::fprintf(say, "%zu pictures of %d x %d, %zu Gaussians, on %s: %.4g s, %.4g frames/s; %.2f s to start; %.3g MB\n", count,
                 options.width, options.height, scene.count(), device_name(device).c_str(), seconds, frames / seconds, startup,
                 1e-6 * double(peak_bytes(device)));
    if (film)
      std::fprintf(say, "%s: %zu frames, %.6g a second%s\n", film->path().string().c_str(), count / tiles, rate,
                   tiles > 1 ? (", of " + std::to_string(tiles) + " worlds each").c_str() : "");
  }
  return 0;
}

}  // namespace

Command render_command() {
  return {"render",
          "",
          "draws Gaussians and the links of a model, as RGB, expected depth and alpha, and videos of them",
          0,
          0,
          {{"--splat", "FILE", "Gaussians: .ply (3DGS, SuperSplat), .splat, .spz, .sog, glTF, .usda; may come several times", true},
           {"--splat-pose", "\"x y z qw qx qy qz scale\"", "where the scene of the k-th --splat stands in the world", true},
           {"--model", "M.xml",
            "a MJCF model; its links carry the Gaussians that are bound to them, or, where none are, Gaussians on its geoms"},
           skip_visuals_option(),
           decompose_option(),
           approximate_option(),
           floating_base_option(),
           package_option(),
           {"--keyframe", "NAME|INDEX", "where the model stands; without it (and --trace) its initial pose"},
           {"--trace", "F.npz", "a trace of gsp sim: picture t*N+w shows world w at entry t"},
           {"--world", "W", "this world of the trace alone: picture t shows entry t"},
           {"--camera", "NAME|INDEX",
            "in place of --cameras: the model's camera of this name or index, with its mode and intrinsics, in every world and entry"},
           {"--cameras", "C.npz",
            "viewmats (C,4,4) world-to-camera, x right, y down, z forward; Ks (C,3,3) in pixels, or one for all; and, of lenses, OpenCV's "
            "coefficients: "
            "distortion (C,4|5|8) or fisheye (C,4), or one row for all"},
           {"--width", "W", "of the pictures, 640"},
           {"--height", "H", "of the pictures, 480"},
           {"--channels", "rgb,depth,alpha", "which of them to make; rgb,depth, and of --video alone rgb"},
           {"--alpha-max", "A", "greatest alpha of a Gaussian, .999"},
           {"--batch", "B", "pictures that go through the stages together; changes memory and speed, never the pictures"},
           {"--repeat", "R", "draw everything R times (after once untimed) and time that"},
           device_option(),
           threads_option(),
           quiet_option(),
           {"--out", "DIR", "write PNGs: rgb, depth in 16-bit millimetres, depth in colour, alpha"},
           {"--npz", "F", "write arrays rgb (C,H,W,3), depth (C,H,W), alpha (C,H,W), float32, unclamped, on black"},
           {"--video", "F.mp4",
            "write rgb as an mp4 by ffmpeg, a frame for each entry of the trace (its worlds on one sheet), else for each camera; without "
            "ffmpeg in PATH, or where F ends in .apng or .png, as an animated PNG"},
           {"--fps", "R", "frames of --video a second; those of the trace's times, else 25"},
           {"--json", "", "print one JSON object: seconds, frames_per_second, startup_seconds, peak_bytes, ..."}},
          run};
}

}  // namespace gsp_cli
