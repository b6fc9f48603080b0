// gsp prune: the Gaussians of a file that the pictures of some cameras need, the others left out.
#include <chrono>
#include <cstdio>
#include <gsp/io/picture_error.hpp>
#include <gsp/io/splats.hpp>
#include <gsp/math/quat.hpp>
#include <gsp/runtime/prune.hpp>
#include <nlohmann/json.hpp>
#include <sstream>

#include "commands.hpp"
#include "device.hpp"
#include "files.hpp"
#include "progress.hpp"
#include "view.hpp"

namespace gsp_cli {
namespace {

using Vec3 = gsp::Vec3<double>;

/// What cameras see, one after the other: through which of them, and which state of the model.
struct Views {
  CameraFile cameras;
  std::vector<int> state, camera;
  std::size_t count() const { return state.size(); }
  void add(Views const& from, std::size_t i) {
    cameras.add(from.cameras, i);
    state.push_back(from.state[i]);
    camera.push_back(from.camera[i]);
  }
  /// Views first ... first + n - 1 for the renderer; they hold as long as this does.
  gsp::runtime::CameraArrays arrays(std::size_t first, std::size_t n) const {
    auto out = cameras.arrays(first, n);
    out.world = gsp::runtime::host_array(&state[first], {static_cast<std::int64_t>(n)});
    return out;
  }
  gsp::runtime::CameraArrays arrays() const { return arrays(0, count()); }
};

/// The camera moved by up to `metres` along each of its axes and turned by up to `angle` [rad] about each, by numbers of (i, seed).
void jitter(float* viewmat, double metres, double angle, int i, int seed) {
  Vec3 const turn{angle * scatter(i, seed), angle * scatter(i, seed + 1), angle * scatter(i, seed + 2)},
      shift{metres * scatter(i, seed + 3), metres * scatter(i, seed + 4), metres * scatter(i, seed + 5)};
  double const size = gsp::norm(turn), part = size > 0 ? std::sin(size / 2) / size : 0.5;
  auto const R = gsp::to_matrix(gsp::Quat<double>{std::cos(size / 2), part * turn.x, part * turn.y, part * turn.z});
  for (int column = 0; column < 4; ++column) {
    Vec3 const old{viewmat[column], viewmat[4 + column], viewmat[8 + column]};
    Vec3 const now = R * old + (column == 3 ? shift : Vec3{0, 0, 0});
    for (int row = 0; row < 3; ++row) viewmat[4 * row + column] = static_cast<float>(now[row]);
  }
}

/// `count` of `views`, each at least once where there are no more of them, moved and turned a little.
Views drawn(Views const& views, std::size_t count, double metres, double angle, int seed) {
  Views out;
  for (std::size_t i = 0; i < count; ++i) {
    out.add(views, i * views.count() / count);
    jitter(&out.cameras.viewmats[16 * i], metres, angle, static_cast<int>(i), seed);
  }
  return out;
}

/// The cameras as they stand in the frame of a file whose scene has this pose: V P, with lengths in the file's unit. What they see of the
/// file is what cameras of the world see of the scene, from a `near` in that unit on.
void stand_in_file(CameraFile& cameras, gsp::io::SplatPose const& pose) {
  auto const& q = pose.quat;
  double const size = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
  auto const R = gsp::to_matrix(gsp::Quat<double>{q[0] / size, q[1] / size, q[2] / size, q[3] / size});
  for (std::size_t i = 0; i < cameras.count; ++i)
    for (int row = 0; row < 3; ++row) {
      float* const v = &cameras.viewmats[16 * i + 4 * static_cast<std::size_t>(row)];
      std::array<double, 4> now{0, 0, 0, v[3] / pose.scale};
      for (int k = 0; k < 3; ++k) {
        for (int column = 0; column < 3; ++column) now[static_cast<std::size_t>(column)] += v[k] * R(k, column);
        now[3] += v[k] * pose.position[static_cast<std::size_t>(k)] / pose.scale;
      }
      for (std::size_t k = 0; k < 4; ++k) v[k] = static_cast<float>(now[k]);
    }
}

/// Cameras round the Gaussians, looking at their middle from 1.3 to 2.3 times the distance within which 95 of 100 are.
Views round_views(gsp::io::SplatSet const& set, std::size_t count, int width, int height) {
  std::array<std::vector<double>, 3> x;
  for (std::size_t i = 0; i < set.size(); ++i)
    for (std::size_t k = 0; k < 3; ++k) x[k].push_back(set.positions[3 * i + k]);
  auto const at = [](std::vector<double> v, double share) {
    auto const place = v.begin() + static_cast<std::ptrdiff_t>(share * static_cast<double>(v.size() - 1));
    std::nth_element(v.begin(), place, v.end());
    return *place;
  };
  std::array<double, 3> const middle{at(x[0], 0.5), at(x[1], 0.5), at(x[2], 0.5)};
  std::vector<double> far;
  for (std::size_t i = 0; i < set.size(); ++i) far.push_back(std::hypot(x[0][i] - middle[0], x[1][i] - middle[1], x[2][i] - middle[2]));
  double const reach = std::max(at(far, 0.95), 1e-3);
  Views out;
  for (std::size_t i = 0; i < count; ++i) {
    double const high = 0.9 * (2 * (double(i) + 0.5) / double(count) - 1), across = std::sqrt(1 - high * high), yaw = 2.399963 * double(i);
    double const distance = reach * (1.8 + 0.5 * scatter(static_cast<int>(i), 11));
    std::array<double, 3> const eye{middle[0] + distance * across * std::cos(yaw), middle[1] + distance * across * std::sin(yaw),
                                    middle[2] + distance * high};
    add_camera(out.cameras, eye, middle, 70 * std::numbers::pi / 180, width, height);
    out.state.push_back(0);
    out.camera.push_back(0);
  }
  return out;
}

/// What the model's cameras see of every state.
Views model_views(gsp::runtime::Kinematics& kinematics, std::vector<int> const& cameras, std::size_t states, int width, int height) {
  Views out;
  for (std::size_t c = 0; c < cameras.size(); ++c) {
    auto const arrays = kinematics.cameras(cameras[c], width, height);
    Views one;
    one.cameras.viewmats = fetch(arrays.viewmats);
    one.cameras.Ks = fetch(arrays.Ks);
    one.cameras.count = states;
    one.camera.assign(states, static_cast<int>(c));
    for (std::size_t s = 0; s < states; ++s) one.state.push_back(static_cast<int>(s));
    for (std::size_t s = 0; s < states; ++s) out.add(one, s);
  }
  return out;
}

/// m of the numbers 0 ... n - 1: one of each of m equal parts, at a place in it that goes on by the golden ratio, so that it keeps to no
/// world and no rhythm of a trace. Places of another `phase` are others.
std::vector<std::size_t> spread(std::size_t n, std::size_t m, double phase) {
  std::vector<std::size_t> out;
  for (std::size_t k = 0; k < m; ++k) {
    std::size_t const first = k * n / m, length = (k + 1) * n / m - first;
    double const turns = phase + 0.618034 * static_cast<double>(k);
    out.push_back(first + static_cast<std::size_t>((turns - std::floor(turns)) * static_cast<double>(length)));
  }
  return out;
}

/// Views that are fitted to, of each camera at least one, and views that judge, of each camera where there are enough. Where all
/// are fitted to and cameras are moved, jitter alone sets those apart which judge: a view that is left out would be lost from what is kept
/// alike. Else they are other views, for each camera at other entries.
struct Split {
  Views fitted, held;
  bool same = false;  // jitter alone sets them apart
};
Split split(Views const& all, std::size_t most, std::size_t most_held, bool moves) {
  std::size_t const cameras = static_cast<std::size_t>(all.camera.back()) + 1, each = all.count() / cameras;
  bool const same = moves && all.count() <= most;
  Split out;
  out.same = same;
  for (std::size_t c = 0; c < cameras; ++c) {
    auto const share = [&](std::size_t n) { return (c + 1) * n / cameras - c * n / cameras; };
    std::size_t const fitted = share(most), spare = each > fitted ? each - fitted : 0,
                      held = std::min(share(most_held), same ? each : std::max({std::size_t(1), each / 4, spare})),
                      taken = same ? each : std::min(each, fitted + held);
    double const phase = 0.5 + double(c) / double(cameras);
    std::vector<bool> judges(taken);
    for (std::size_t const k : spread(taken, held, phase)) judges[k] = true;
    auto const chosen = spread(each, taken, phase);
    for (std::size_t k = 0; k < taken; ++k) {
      if (judges[k]) out.held.add(all, c * each + chosen[k]);
      if (same || !judges[k]) out.fitted.add(all, c * each + chosen[k]);
    }
  }
  return out;
}

struct Quality {
  double psnr = 0, ssim = 0, depth = 0;  // [dB], 1: the same, [m]
};
struct Seen {
  std::vector<float> rgb, depth, alpha;
};
Seen seen(Device device, gsp::io::SplatSet const& set, std::string const& name, gsp::CompiledModel const& model,
          gsp::runtime::PoseArrays const& poses, Views const& views, gsp::runtime::RendererOptions const& options) {
  gsp::runtime::Scene scene;
  scene.add_set(set, name, model);
  auto const renderer = gsp::runtime::make_renderer(device, scene, options);
  renderer->render(poses, views.arrays());
  auto const frames = renderer->frames();
  return {fetch(frames.rgb), fetch(frames.depth), fetch(frames.alpha)};
}

/// Of each camera: in how many of the views no Gaussian is seen, and how many views there are.
std::vector<std::array<std::size_t, 2>> unseeing(gsp::runtime::Renderer& renderer, gsp::runtime::PoseArrays const& poses,
                                                 Views const& views) {
  std::vector<std::array<std::size_t, 2>> out(static_cast<std::size_t>(views.camera.back()) + 1);
  std::size_t const portion = 16;  // pictures on the host
  for (std::size_t first = 0; first < views.count(); first += portion) {
    std::size_t const n = std::min(portion, views.count() - first);
    renderer.render(poses, views.arrays(first, n));
    auto const alpha = fetch(renderer.frames().alpha);
    for (std::size_t i = 0; i < n; ++i) {
      auto& [none, of] = out[static_cast<std::size_t>(views.camera[first + i])];
      none += shows_nothing(&alpha[i * alpha.size() / n], alpha.size() / n);
      ++of;
    }
  }
  return out;
}

/// "0.02 3": metres and degrees.
std::array<double, 2> jitter_of(Arguments const& a) {
  std::array<double, 2> out{0.02, 3};
  if (auto const text = a.text("--jitter")) {
    std::istringstream words(*text);
    std::string rest;
    if (!(words >> out[0] >> out[1]) || words >> rest || !(out[0] >= 0 && out[0] <= 1e3) || !(out[1] >= 0 && out[1] <= 180))
      a.fail("--jitter is " + in_quotes(*text) +
             "; give metres (0 to 1000) and degrees (0 to 180), such as \"0.02 3\", or \"0 0\" for none");
  }
  out[1] *= std::numbers::pi / 180;
  return out;
}

int run(Arguments const& a) {
  std::string const& from = a.operands()[0];
  if (!a.has("--out")) a.fail("needs --out P: the file to write, in the format that its ending names (.ply, .spz, ...)");
  std::string const to = *a.text("--out");
  a.exclusive("--cameras", "--camera", "both say where the cameras stand");
  a.exclusive("--keyframe", "--trace", "both say where the model stands");
  a.needs("--camera", "--model", "it is one of the model's");
  a.needs("--keyframe", "--model", "a keyframe belongs to a model");
  a.needs("--trace", "--model", "a trace belongs to a model");
  a.needs("--skip-visuals", "--model", "it is about a model's geoms");
  double const keep = a.real("--keep", 0.3, 0, 1);
  auto const most = static_cast<std::size_t>(a.integer("--views", 256, 1, 65536));
  auto most_held = static_cast<std::size_t>(a.integer("--held-out", 32, 1, 65536));
  gsp::runtime::RendererOptions options;
  options.width = static_cast<int>(a.integer("--width", 640, 11, 16384));
  options.height = static_cast<int>(a.integer("--height", 480, 11, 16384));
  options.batch = static_cast<int>(a.integer("--batch", 0, 1, 65536));
  int const shrink = static_cast<int>(a.integer("--shrink", 2, 1, 64));
  auto const moved = jitter_of(a);
  auto const pose = a.has("--splat-pose") ? gsp::io::parse_splat_pose(*a.text("--splat-pose")) : gsp::io::SplatPose{};
  int const threads = threads_of(a);
  Device const device = choose_device(a);
  gsp::io::expect_splats_writable(to);
  std::vector<NamedFile> inputs{{"SPLAT", from}};
  for (char const* option : {"--cameras", "--model", "--trace"})
    if (a.has(option)) inputs.push_back({option, *a.text(option)});
  expect_apart(inputs, {{"--out", to}});

  // All input is read before anything is computed.
  gsp::CompiledModel model;
  Trace trace;
  trace.entries = trace.worlds = 1;
  if (auto const path = a.text("--model")) {
    model = load_model(*path, a);
    if (auto const file = a.text("--trace")) {
      trace = read_trace(*file, model);
    } else {
      auto const s = initial_state(model, *path, a.text("--keyframe"));
      trace.qpos = s.qpos;
      place_mocap(model, s);
    }
  }
  std::size_t const states = trace.entries * trace.worlds;
  auto const set = gsp::io::read_splats(from);
  bool const linked = std::any_of(set.link.begin(), set.link.end(), [](int link) { return link >= 0; });
  if (linked && a.has("--splat-pose"))
    throw Error(from + ": has Gaussians on links, which stand where the model has them, so that a pose would part them from the others; " +
                "leave out --splat-pose");
  std::vector<int> of_model;
  for (auto const& name : a.all("--camera")) of_model.push_back(named_or_index(*a.text("--model"), "camera", model.cam_name, name));
  if (a.has("--model") && !a.has("--cameras") && of_model.empty())
    for (std::size_t k = 0; k < model.cam_name.size(); ++k) of_model.push_back(static_cast<int>(k));
  if (a.has("--model") && !a.has("--cameras") && of_model.empty())
    throw Error(*a.text("--model") + ": has no camera; give --cameras C.npz, or a model with a <camera> where the robot has one");
  bool const moves = moved[0] > 0 || moved[1] > 0;
  bool const from_all_round = !a.has("--cameras") && of_model.empty();
  Views all;
  if (auto const file = a.text("--cameras")) {
    all.cameras = read_cameras(*file, quiet(a));
    if (a.has("--trace") && all.cameras.count != states)
      throw Error(*file + ": holds " + std::to_string(all.cameras.count) + " cameras, but the trace has " + std::to_string(trace.entries) +
                  " entries of " + std::to_string(trace.worlds) + " worlds; write " + std::to_string(states) +
                  " cameras (camera t*N+w sees world w at entry t)");
    // along a trace one that moves; else as many cameras, or, where not all can be fitted to, one that has been in as many places
    bool const one = a.has("--trace") || !moves || all.cameras.count > most;
    for (std::size_t i = 0; i < all.cameras.count; ++i) {
      all.state.push_back(a.has("--trace") ? static_cast<int>(i) : 0);
      all.camera.push_back(one ? 0 : static_cast<int>(i));
    }
  } else if (from_all_round) {
    if (linked) throw Error(from + ": has Gaussians on links, and nothing says where those stand; give --model");
    auto placed = set;
    if (a.has("--splat-pose")) gsp::io::transform(placed, pose);
    all = round_views(placed, most + most_held, options.width, options.height);
  }

  std::size_t const cameras = of_model.empty() ? static_cast<std::size_t>(all.camera.back()) + 1 : of_model.size();
  std::size_t const each = of_model.empty() ? all.count() / cameras : states;
  if (!moves && each < (a.has("--cameras") && !a.has("--trace") ? 4 : 2))
    a.fail("--jitter \"0 0\" makes no further views of the " + std::to_string(each) + " that " +
           (cameras == 1 ? "there are" : "each camera has") +
           ", and some must be left to judge by; give a jitter, more cameras, or a trace along which there are more");
  if (cameras > most)
    a.fail("--views " + std::to_string(most) + " is less than one for each of " + std::to_string(cameras) + " cameras; give --views " +
           std::to_string(cameras) + " or more, or fewer cameras");
  if (!a.has("--held-out")) most_held = std::max(most_held, cameras);
  if (cameras > most_held)
    a.fail("--held-out " + std::to_string(most_held) + " is less than one for each of " + std::to_string(cameras) +
           " cameras; give --held-out " + std::to_string(cameras) + " or more, or fewer cameras");

  gsp::runtime::Session const session(threads);
  auto const kinematics = gsp::runtime::make_kinematics(device, model);
  auto const poses = kinematics->poses(gsp::runtime::host_array(trace.qpos.data(), {static_cast<std::int64_t>(states), model.nq}));
  if (!of_model.empty()) all = model_views(*kinematics, of_model, states, options.width, options.height);
  auto const parts = split(all, most, most_held, moves);
  auto fitted = drawn(parts.fitted, moves ? most : std::min(most, parts.fitted.count()), moved[0], moved[1], 100);
  auto held = drawn(parts.held, moves ? most_held : std::min(most_held, parts.held.count()), moved[0], moved[1], 200);
  if (a.has("--splat-pose"))  // so that what is written stays where it is in its file
    for (auto* views : {&fitted, &held}) stand_in_file(views->cameras, pose);
  gsp::runtime::PruningOptions pruning;
  options.near = pruning.near = static_cast<float>(double(options.near) / pose.scale);
  pruning.keep = keep;
  pruning.width = std::max(1, options.width / shrink);
  pruning.height = std::max(1, options.height / shrink);
  pruning.batch = options.batch;
  for (std::size_t i = 0; i < fitted.count(); ++i)  // of pictures that are so much smaller
    for (std::size_t k = 0; k < 6; ++k)
      fitted.cameras.Ks[9 * i + k] *= k < 3 ? float(pruning.width) / float(options.width) : float(pruning.height) / float(options.height);
  std::size_t const held_bytes = 20 * held.count() * static_cast<std::size_t>(options.width) * static_cast<std::size_t>(options.height);
  expect_memory("pruning with " + std::to_string(fitted.count()) + " pictures of " + std::to_string(pruning.width) + " x " +
                    std::to_string(pruning.height),
                device,
                std::max(static_cast<std::uint64_t>(gsp::runtime::bytes_to_prune(device, set, static_cast<int>(fitted.count()), pruning)),
                         static_cast<std::uint64_t>(held_bytes)),
                3 * held_bytes, "fewer --views or --held-out, or smaller pictures");

  {
    gsp::runtime::Scene scene;
    scene.add_set(set, from, model);
    gsp::runtime::RendererOptions small;
    small.width = pruning.width;
    small.height = pruning.height;
    small.batch = pruning.batch;
    small.near = pruning.near;
    small.rgb = small.depth = false;
    small.alpha = true;
    auto const none = unseeing(*gsp::runtime::make_renderer(device, scene, small), poses, fitted);
    std::size_t blind = 0, said = 0;
    for (auto const& [views, of] : none) blind += views;
    if (blind == fitted.count())
      throw Error(from + ": no camera sees any Gaussian in " + std::to_string(blind) +
                  " views; let --splat-pose say where the scene stands, or give cameras that look at it");
    for (std::size_t c = 0; c < none.size() && !quiet(a); ++c) {
      auto const& [views, of] = none[c];
      if (views == 0 || ++said > 8) continue;  // a few are enough to see what is wrong
      std::string const name = !of_model.empty() ? camera_name(model, of_model[c]) : "camera " + std::to_string(c);
      std::fprintf(stderr, "%s sees no Gaussian in %zu of %zu views: turn it to the scene, or let --splat-pose say where that stands\n",
                   name.c_str(), views, of);
    }
    if (said > 8) std::fprintf(stderr, "and %zu more cameras\n", said - 8);
  }
  Progress progress("pruning", quiet(a));
  auto const start = std::chrono::steady_clock::now();
  auto const result = gsp::runtime::prune(device, set, from, model, poses, fitted.arrays(), pruning);
  double const seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  auto notes = set.notes;
  for (auto const& n : gsp::io::write_splats(to, result.set)) notes.push_back(n);
  Quality q;
  {  // of what was written, with what its format rounds
    auto const before = seen(device, set, from, model, poses, held, options),
               after = seen(device, gsp::io::read_splats(to), to, model, poses, held, options);
    q.psnr = gsp::io::psnr(before.rgb, after.rgb);
    q.ssim = gsp::io::ssim(before.rgb, after.rgb, options.width, options.height, 3);
    q.depth = pose.scale * gsp::io::median_error(before.depth, after.depth, before.alpha, 0.5f);  // of the file's unit
  }
  progress.finish();
  if (a.has("--json")) {
    nlohmann::ordered_json const json{{"gaussians", set.size()},
                                      {"kept", result.set.size()},
                                      {"psnr", std::isfinite(q.psnr) ? nlohmann::ordered_json(q.psnr) : nlohmann::ordered_json()},
                                      {"ssim", q.ssim},
                                      {"depth_error_median", q.depth},
                                      {"seconds", seconds},
                                      {"views", fitted.count()},
                                      {"views_held_out", held.count()},
                                      {"views_held_out_are_fitted_ones_moved", parts.same},
                                      {"rounds", result.rounds},
                                      {"sweeps", result.sweeps},
                                      {"peak_bytes", peak_bytes(device)},
                                      {"device", device_name(device)}};
    std::printf("%s\n", json.dump().c_str());
    return 0;
  }
  std::printf("%s -> %s: %zu of %zu Gaussians, fitted to %zu pictures on %s in %.4g s\n", from.c_str(), to.c_str(), result.set.size(),
              set.size(), fitted.count(), device_name(device).c_str(), seconds);
  std::printf("beside all of them, on %zu views%s: PSNR %.2f dB, SSIM %.4f, median error of depth %.2g m\n", held.count(),
              parts.same ? " that are moved otherwise than those it was fitted to" : " that it was not fitted to", q.psnr, q.ssim, q.depth);
  if (!a.has("--quiet") && !from_all_round) std::printf("  what these cameras never see is not kept: other views may show holes\n");
  if (!a.has("--quiet"))
    for (auto const& n : notes) std::printf("  %s\n", n.c_str());
  return 0;
}

}  // namespace

Command prune_command() {
  return {"prune",
          "SPLAT",
          "leaves out the Gaussians that pictures need least, of a robot's cameras along a trace, of a file's, or from all round, fits the "
          "colours, opacities and sizes of the others, and says how much the pictures change on other views of these cameras",
          1,
          1,
          {{"--out", "P", "the file to write, in the format that its ending names (gsp convert)"},
           {"--splat-pose", "\"x y z qw qx qy qz scale\"",
            "where the scene of SPLAT stands in the world that cameras are in, as of gsp render; P stays in the frame of SPLAT"},
           {"--keep", "K", "share of the Gaussians that is left, above 0 and up to 1; 0.3"},
           {"--model", "M.xml", "a MJCF model: its links carry the Gaussians that are bound to them, and its cameras look at them"},
           skip_visuals_option(),
           decompose_option(),
           approximate_option(),
           floating_base_option(),
           package_option(),
           {"--keyframe", "NAME|INDEX", "where the model stands; without it (and --trace) its initial pose"},
           {"--trace", "T.npz", "a trace of gsp sim: where the model goes"},
           {"--camera", "NAME|INDEX", "this camera of the model; may come several times; without it all of them", true},
           {"--cameras", "C.npz",
            "in place of the model's: viewmats (C,4,4) world-to-camera, Ks (C,3,3) in pixels, or one for all; with --trace one for each "
            "entry and world. Without a camera at all: views from all round"},
           {"--jitter", "\"metres degrees\"", "how far cameras are moved and turned at random; \"0.02 3\""},
           {"--views", "N", "pictures that are kept alike, at most: of each camera as many, taken evenly, several times with jitter; 256"},
           {"--held-out", "N",
            "views that judge, of each camera as many: the fitted ones, with another jitter, where --views takes all, else others; 32, or "
            "one a camera where there are more"},
           {"--width", "W", "of the pictures, 640"},
           {"--height", "H", "of the pictures, 480"},
           {"--shrink", "S", "fitted to pictures that are so many times smaller in width and height; 2"},
           {"--batch", "B", "pictures that go through the stages together; changes memory and speed, never the result"},
           device_option(),
           threads_option(),
           quiet_option(),
           {"--json", "", "print one JSON object: kept, psnr, ssim, depth_error_median, seconds, ..."}},
          run};
}

}  // namespace gsp_cli
