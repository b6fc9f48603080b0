// gsp scan: what a LiDAR unit on a model measures, in one pose or along a trace, as arrays, a cloud of points and a picture of it.
#include <chrono>
#include <cmath>
#include <cstdio>
#include <gsp/io/draw_points.hpp>
#include <gsp/io/npz.hpp>
#include <gsp/io/png.hpp>
#include <gsp/io/ray_table.hpp>
#include <gsp/model/names.hpp>
#include <gsp/ray/livox_pattern.hpp>
#include <gsp/ray/ray_clock.hpp>
#include <gsp/runtime/scanner.hpp>
#include <gsp/runtime/session.hpp>
#include <nlohmann/json.hpp>
#include <numbers>
#include <sstream>

#include "commands.hpp"
#include "device.hpp"
#include "files.hpp"
#include "progress.hpp"

namespace gsp_cli {
namespace {

constexpr double radian = std::numbers::pi / 180;

std::string short_number(double x) {
  char text[32];
  std::snprintf(text, sizeof text, "%.6g", x);
  return text;
}

/// Units by name; `rate`: turns a second of those that turn.
struct NamedPattern {
  std::string name;
  gsp::RayPattern (*make)(double rate);
};
std::vector<NamedPattern> const patterns{
    {"vlp16", [](double rate) { return gsp::vlp16_pattern(1800, rate); }},
    {"vlp32c", [](double rate) { return gsp::vlp32c_pattern(1800, rate); }},
    {"hdl64e", [](double rate) { return gsp::hdl64e_pattern(1719, rate); }},
    {"xt32", [](double rate) { return gsp::xt32_pattern(2000, rate); }},
    {"os0", [](double rate) { return gsp::ouster_pattern(128, 1024, 90 * radian, rate); }},
    {"os1", [](double rate) { return gsp::ouster_pattern(128, 1024, 45 * radian, rate); }},
    {"os2", [](double rate) { return gsp::ouster_pattern(128, 1024, 22.5 * radian, rate); }},
    {"mid40", [](double) { return gsp::mid40_pattern(); }},
    {"mid70", [](double) { return gsp::mid70_pattern(); }},
    {"avia", [](double) { return gsp::avia_pattern(); }},
    {"mid360", [](double) { return gsp::mid360_pattern(); }},
    {"grid", [](double) { return gsp::grid_pattern(160, 120, 60 * radian, 45 * radian); }},
    {"sphere", [](double) { return gsp::spherical_pattern(720, 360); }},
    {"height", [](double) { return gsp::height_scan_pattern(1.6, 1, 0.1); }},
};
gsp::RayPattern pattern_of(Arguments const& a, double rate) {
  std::string const text = *a.text("--pattern");
  std::vector<std::string> names;
  for (auto const& p : patterns) {
    if (p.name == text) return p.make(rate);
    names.push_back(p.name);
  }
  if (text.ends_with(".csv") || text.ends_with(".npy")) return gsp::io::read_ray_table(text, {.rate = a.real("--table-rate", 0, 0, 1e9)});
  auto const hint = did_you_mean(text, names);
  std::string all;
  for (auto const& name : names) all += (all.empty() ? "" : ", ") + name;
  a.fail("--pattern " + in_quotes(text) + " is no unit" + (hint.empty() ? "; give one of " + all + ", or a .csv or .npy file" : hint));
}

/// A site, a body, or seven numbers in the world, or after a body's name in its frame.
gsp::RayMountOptions mount_of(Arguments const& a, gsp::CompiledModel const& m, std::string const& file) {
  std::string const text = *a.text("--mount");
  std::istringstream in(text);
  std::vector<std::string> words;
  for (std::string word; in >> word;) words.push_back(word);
  std::vector<double> numbers;
  auto const is_in = [&](std::vector<std::string> const& names) { return std::find(names.begin(), names.end(), text) != names.end(); };
  bool const whole = is_in(m.site_name) || is_in(m.body_name);  // names may hold spaces
  std::size_t const named = words.size() >= 8 ? words.size() - 7 : 0;
  for (std::size_t k = named; !whole && words.size() >= 7 && k < words.size(); ++k) {
    double x = 0;
    auto const [end, error] = std::from_chars(words[k].data(), words[k].data() + words[k].size(), x);
    if (error != std::errc() || end != words[k].data() + words[k].size() || !std::isfinite(x))
      a.fail("--mount " + in_quotes(text) + ": " + in_quotes(words[k]) + " is no number; give \"x y z qw qx qy qz\"");
    if (std::abs(x) > 1e10) a.fail("--mount " + in_quotes(text) + ": " + words[k] + " is beyond 1e10; give smaller numbers");
    numbers.push_back(x);
  }
  gsp::RayMountOptions mount;
  if (numbers.empty() && !whole && words.size() != 1)
    a.fail("--mount " + in_quotes(text) + " has " + std::to_string(words.size()) +
           " words; give a site, a body, or \"x y z qw qx qy qz\", with a body's name before it or none");
  if (!numbers.empty()) {
    mount.pos = {numbers[0], numbers[1], numbers[2]};
    mount.quat = {numbers[3], numbers[4], numbers[5], numbers[6]};
    double length = 0;
    for (double const x : mount.quat) length = std::hypot(length, x);
    if (!(length > 1e-10)) a.fail("--mount " + in_quotes(text) + ": the quaternion is 0; give 1 0 0 0 for no rotation");
  }
  std::string name = numbers.empty() ? text : named > 0 ? words[0] : "world";
  for (std::size_t k = 1; !numbers.empty() && k < named; ++k) name += " " + words[k];
  if (name == "world") {
    mount.body_id = 0;
    return mount;
  }
  for (std::size_t s = 0; numbers.empty() && s < m.site_name.size(); ++s)
    if (m.site_name[s] == name) {
      mount.body_id = m.site_body[s];
      mount.pos = m.site_pos[s];
      mount.quat = m.site_quat[s];
      return mount;
    }
  std::vector<std::string> names = m.body_name;
  if (numbers.empty()) names.insert(names.end(), m.site_name.begin(), m.site_name.end());
  for (std::size_t b = 0; b < m.body_name.size(); ++b)
    if (m.body_name[b] == name) mount.body_id = static_cast<int>(b);
  if (mount.body_id < 0) {
    auto const hint = did_you_mean(name, names);
    throw Error(file + ": has no " + (numbers.empty() ? "site or body " : "body ") + in_quotes(name) + " for --mount" +
                (hint.empty() ? "; give one of those that 'gsp info --json' lists, or \"x y z qw qx qy qz\"" : hint));
  }
  return mount;
}

/// Ranges, points, geoms and Gaussians of all entries.
struct Scans {
  std::size_t entries = 0, worlds = 0, rays = 0;
  std::vector<float> range, point;  // (T, N, R), (T, N, R, 3)
  std::vector<int> geom, splat;     // (T, N, R); splat: or empty
  std::vector<double> time;         // (T, R)
};

/// What was met of world 0 in the last entry.
struct Cloud {
  std::vector<std::array<float, 3>> point;
  std::vector<float> range;
  std::vector<int> geom;  // -1: a Gaussian
};
Cloud last_cloud(Scans const& s, std::size_t world) {
  Cloud cloud;
  std::size_t const begin = ((s.entries - 1) * s.worlds + world) * s.rays;
  for (std::size_t k = begin; k < begin + s.rays; ++k) {
    if (s.geom[k] < 0 && (s.splat.empty() || s.splat[k] < 0)) continue;
    cloud.point.push_back({s.point[3 * k], s.point[3 * k + 1], s.point[3 * k + 2]});
    cloud.range.push_back(s.range[k]);
    cloud.geom.push_back(s.geom[k]);
  }
  return cloud;
}
int run(Arguments const& a) {
  std::string const path = a.operands().front();
  if (!a.has("--pattern")) a.fail("needs --pattern NAME|FILE: which rays the unit sends");
  if (!a.has("--mount")) a.fail("needs --mount SITE|BODY|\"x y z qw qx qy qz\": where the unit stands");
  a.exclusive("--keyframe", "--trace", "both say where the model stands");
  a.needs("--hz", "--trace", "rays leave one after the other while the model moves");
  auto const splats = a.all("--splat"), splat_poses = a.all("--splat-pose");
  if (splat_poses.size() > splats.size())
    a.fail("--splat-pose is given " + std::to_string(splat_poses.size()) + " times for " + std::to_string(splats.size()) +
           " --splat; the k-th pose belongs to the k-th file, leave the others out");
  auto const npz = a.text("--npz"), ply = a.text("--ply"), png = a.text("--png"), trace_file = a.text("--trace");
  double const hz = a.real("--hz", 0, 0, 1e6);
  gsp::RayScanOptions options;
  options.min_range = a.real_from("--min-range", 0, 0, 1e9);
  options.max_range = a.real("--max-range", std::numeric_limits<double>::infinity(), 0, 1e9);
  if (!(options.min_range < options.max_range))
    a.fail("--min-range " + a.text("--min-range").value_or("0") + " is not below --max-range " + *a.text("--max-range") +
           "; give a smaller one");
  auto const self = a.choice("--self-filter", {"none", "body", "subtree"}, "body");
  options.self = self == "none" ? gsp::SelfFilter::none : self == "body" ? gsp::SelfFilter::body : gsp::SelfFilter::subtree;
  options.noise.range_sigma = a.real_from("--range-noise", 0, 0, 1e3);
  options.noise.angle_sigma = radian * a.real_from("--angle-noise", 0, 0, 90);
  options.noise.dropout = a.real_from("--dropout", 0, 0, 1);
  options.noise.seed = static_cast<std::uint64_t>(a.integer("--seed", 0, 0, std::numeric_limits<long long>::max()));
  int const threads = threads_of(a);
  Device const device = choose_device(a);
  std::vector<NamedFile> inputs{{"MODEL", path}}, outputs;
  if (trace_file) inputs.push_back({"--trace", *trace_file});
  for (auto const& file : splats) inputs.push_back({"--splat", file});
  bool const table = a.text("--pattern")->ends_with(".csv") || a.text("--pattern")->ends_with(".npy");
  if (table) inputs.push_back({"--pattern", *a.text("--pattern")});
  if (a.has("--table-rate") && !a.text("--pattern")->ends_with(".npy"))
    a.fail("--table-rate is of a .npy file, which has no times; leave it out");
  for (auto const& [file, option] : {std::pair{npz, "--npz"}, {ply, "--ply"}, {png, "--png"}})
    if (file) {
      expect_writable(*file, option);
      outputs.push_back({option, *file});
    }
  expect_apart(inputs, outputs);

  auto model = load_model(path, a);
  Trace trace;
  if (trace_file) {
    trace = read_trace(*trace_file, model);
    for (std::size_t i = 0; i < trace.qpos.size(); ++i)
      if (!(std::abs(trace.qpos[i]) <= 1e10))
        throw Error(*trace_file + ": array 'qpos': value " + std::to_string(i) + " is " + std::to_string(trace.qpos[i]) +
                    ", and bodies stand within 1e10; correct it");
  } else {
    auto const s = initial_state(model, path, a.text("--keyframe"));
    trace.entries = trace.worlds = 1;
    trace.qpos = s.qpos;
    trace.time = {s.time};
    place_mocap(model, s);
  }
  if (auto const s = summary(model); !s.empty() && !quiet(a))
    std::fprintf(stderr, "%s: %s ('gsp info' lists them)\n", path.c_str(), s.c_str());
  auto pattern = pattern_of(a, hz);
  auto mount = mount_of(a, model, path);
  if (*a.text("--pattern") == "height") mount.alignment = gsp::RayAlignment::yaw;  // straight down, whatever the body does
  std::size_t const worlds = trace.worlds;
  if (static_cast<std::size_t>(a.integer("--world", 0, 0, 1 << 24)) >= worlds)
    a.fail("--world " + *a.text("--world") + ": there are " + std::to_string(worlds) + " worlds; give 0 to " + std::to_string(worlds - 1));
  auto const world = static_cast<std::size_t>(a.integer("--world", 0, 0, 1 << 24));
  options.worlds = static_cast<int>(worlds);
  std::size_t rays = pattern.direction.size();
  if (hz > 0) {
    if (trace.entries < 2)
      throw Error(*trace_file + ": has one entry, and --hz needs the time between two; take the trace with --every E and more --steps");
    double const step = (trace.time.back() - trace.time.front()) / double(trace.entries - 1);
    for (std::size_t k = 1; k < trace.entries; ++k)
      if (!(step > 0) || std::abs(trace.time[k] - trace.time[k - 1] - step) > 1e-6 * step + 1e-9 * trace.time.back())
        throw Error(*trace_file + ": entry " + std::to_string(k) +
                    " does not follow the one before it by as much as others do, and --hz needs even steps; take it with an --every that "
                    "--steps is a multiple of");
    if (!(step >= 1e-9 && step <= 1e6))
      throw Error(*trace_file + ": its entries are " + short_number(step) + " s apart, and --hz takes 1e-9 to 1e6; correct its times");
    options.timestep = step;
    if (table && pattern.period != 0 && !(pattern.period >= 1e-6 && pattern.period <= 1e6))
      throw Error(*a.text("--pattern") + ": its rays repeat every " + short_number(pattern.period) +
                  " s, and --hz takes tables of 1e-6 to 1e6 s; are its times in seconds?");
    if (pattern.period == 0) pattern.period = 1 / hz;
    if (double(rays) / (hz * pattern.period) > double(rays) * (1 + 1e-9))
      a.fail("--hz " + *a.text("--hz") + " asks for more rays a scan than the pattern has, which repeats every " +
             short_number(pattern.period) + " s; give at least " + short_number(1 / pattern.period));
    rays = static_cast<std::size_t>(std::clamp(std::llround(double(rays) / (hz * pattern.period)), 1LL, static_cast<long long>(rays)));
    options.rays = static_cast<int>(rays);
  } else {
    pattern.time.clear();  // all from one pose
    pattern.period = 0;
  }
  std::size_t const all = trace.entries * worlds * rays;
  if (npz && double(all) * 12 >= 4.2e9)
    throw Error(*npz + ": " + std::to_string(all) + " points pass 4 GiB, the limit of npz files here; scan fewer entries or worlds");

  gsp::runtime::Scene scene;
  for (std::size_t i = 0; i < splats.size(); ++i)
    scene.add_set(load_splats(splats[i], i < splat_poses.size() ? gsp::io::parse_splat_pose(splat_poses[i]) : gsp::io::SplatPose{}),
                  splats[i], model);
  gsp::runtime::Session const session(threads);  // once all is read: a GPU starts meanwhile
  options.splats = !splats.empty();
  for (std::size_t i = splat_poses.size(); i < splats.size() && !quiet(a); ++i)
    std::fprintf(stderr, "gsp scan: %s stands as its file has it, often on its side: --splat-pose turns it\n", splats[i].c_str());
  expect_memory(std::to_string(worlds) + " worlds of " + std::to_string(rays) + " rays", device,
                std::uint64_t(worlds) * rays * 48 + std::uint64_t(scene.count()) * 96,
                std::uint64_t(npz ? all : worlds * rays) * 24 + std::uint64_t(worlds) * rays * 40, "fewer worlds or entries");
  auto const scanner = gsp::runtime::make_scanner(device, model, pattern, mount, options, scene);
  auto const kinematics = gsp::runtime::make_kinematics(device, model);
  double const startup = seconds_since_start();
  Scans scans;
  scans.worlds = worlds;
  scans.rays = rays;
  if (npz) {
    scans.range.reserve(all);
    scans.point.reserve(3 * all);
    scans.geom.reserve(all);
    if (options.splats) scans.splat.reserve(all);
    scans.time.reserve(trace.entries * rays);
  }
  std::vector<double> range(worlds * rays), point(3 * worlds * rays), left(rays), xpos, xquat;
  std::vector<int> geom(worlds * rays), splat(options.splats ? worlds * rays : 0);
  Progress progress("scanning", quiet(a));
  double seconds = 0, cast = 0;  // cast: rays of all worlds
  auto const clock = gsp::make_ray_clock(pattern, options.timestep);
  std::vector<double> time;
  auto const n = static_cast<std::int64_t>(worlds), r = static_cast<std::int64_t>(rays);
  for (std::size_t t = 0; t < trace.entries; ++t) {
    auto const poses = kinematics->poses(gsp::runtime::host_array(trace.qpos.data() + t * worlds * std::size_t(model.nq), {n, model.nq}));
    if (t + 1 == trace.entries) {
      xpos.resize(std::size_t(poses.xpos.size()));
      xquat.resize(std::size_t(poses.xquat.size()));
      gsp::runtime::copy(poses.xpos, gsp::runtime::host_array(xpos.data(), {n, poses.xpos.extents[1], 3}));
      gsp::runtime::copy(poses.xquat, gsp::runtime::host_array(xquat.data(), {n, poses.xquat.extents[1], 4}));
    }
    if (t == 0) scanner->begin(poses);
    if (t == 0 && hz > 0) continue;  // step t - 1 ends at entry t
    auto const start = std::chrono::steady_clock::now();
    auto const step = static_cast<std::int64_t>(hz > 0 ? t - 1 : t);
    scanner->scan(poses, step);
    seconds += std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    cast += double(worlds) * double(std::min(gsp::rays_of_step(clock, step).count, r));
    auto const arrays = scanner->arrays();
    gsp::runtime::copy(arrays.range, gsp::runtime::host_array(range.data(), {n, r}));
    gsp::runtime::copy(arrays.geom, gsp::runtime::host_array(geom.data(), {n, r}));
    gsp::runtime::copy(arrays.point, gsp::runtime::host_array(point.data(), {n, r, 3}));
    if (options.splats) gsp::runtime::copy(arrays.splat, gsp::runtime::host_array(splat.data(), {n, r}));
    gsp::runtime::copy(arrays.time, gsp::runtime::host_array(left.data(), {r}));
    if (!npz) scans = {0, worlds, rays, {}, {}, {}, {}, {}};  // the last alone
    scans.range.insert(scans.range.end(), range.begin(), range.end());
    scans.point.insert(scans.point.end(), point.begin(), point.end());
    scans.geom.insert(scans.geom.end(), geom.begin(), geom.end());
    scans.splat.insert(scans.splat.end(), splat.begin(), splat.end());
    for (double const x : left) scans.time.push_back(x < 0 ? x : hz > 0 ? trace.time.front() + x : trace.time[t]);
    time.push_back(trace.time[t]);
    ++scans.entries;
    progress.show(double(t + 1) / double(trace.entries));
  }
  Cloud const cloud = last_cloud(scans, world);
  if (npz) {
    std::vector<gsp::io::NpzEntry> entries{{"time", {{scans.entries}, time}},
                                           {"range", {{scans.entries, worlds, rays}, scans.range}},
                                           {"point", {{scans.entries, worlds, rays, 3}, scans.point}},
                                           {"geom", {{scans.entries, worlds, rays}, scans.geom}},
                                           {"ray_time", {{scans.entries, rays}, scans.time}}};
    if (options.splats) entries.push_back({"splat", {{scans.entries, worlds, rays}, scans.splat}});
    gsp::io::write_npz(*npz, entries);
  }
  if (ply) gsp::io::write_points(*ply, cloud.point, cloud.range, cloud.geom);
  if (png) {
    std::size_t const body = world * std::size_t(model.nbody) + std::size_t(mount.body_id);
    double const *const x = &xpos[3 * body], *const q = &xquat[4 * body];
    gsp::Transform<double> const on{{x[0], x[1], x[2]}, {q[0], q[1], q[2], q[3]}};
    auto const& p = mount.pos;
    auto const& turn = mount.quat;
    double const length = std::sqrt(turn[0] * turn[0] + turn[1] * turn[1] + turn[2] * turn[2] + turn[3] * turn[3]);
    gsp::Transform<double> const in{{p[0], p[1], p[2]}, {turn[0] / length, turn[1] / length, turn[2] / length, turn[3] / length}};
    gsp::io::write_png(*png, gsp::io::draw_points(cloud.point, cloud.range, on * in));
  }
  progress.finish();
  auto const share = double(cloud.point.size()) / double(rays);
  double const rate = cast / seconds;
  std::FILE* const say = text_beside(npz);
  if (a.has("--json")) {
    nlohmann::ordered_json json{{"seconds", seconds},
                                {"rays_per_second", rate},
                                {"startup_seconds", startup},
                                {"peak_bytes", peak_bytes(device)},
                                {"scans", time.size()},
                                {"worlds", worlds},
                                {"rays", rays},
                                {"hits", share},
                                {"gaussians", scene.count()},
                                {"device", device_name(device)}};
    std::fprintf(say, "%s\n", json.dump().c_str());
  } else {
    std::fprintf(say,
                 "%zu scans of %zu worlds, %zu rays each, on %s: %.4g s, %.4g rays/s; %.1f %% of the last scan of world %zu met something; "
                 "%.2f s to start; %.3g MB\n",
                 time.size(), worlds, rays, device_name(device).c_str(), seconds, rate, 100 * share, world, startup,
                 1e-6 * double(peak_bytes(device)));
  }
  return 0;
}

}  // namespace

Command scan_command() {
  return {
      "scan",
      "MODEL",
      "what a LiDAR unit on a model measures, in a pose or along a trace",
      1,
      1,
      {{"--pattern", "NAME|FILE",
        "vlp16, vlp32c, hdl64e, xt32, os0, os1, os2, mid40, mid70, avia, mid360, grid, sphere, height; or rays of a .csv (time, azimuth, "
        "zenith in "
        "degrees) or .npy file (N,2: azimuth, elevation in radians)"},
       {"--mount", "SITE|BODY|\"x y z qw qx qy qz\"",
        "where the unit stands, its x axis ahead and z up: a site, a body, or a pose in the world; after a body's name, in its frame"},
       {"--splat", "FILE",
        "Gaussians: .ply (3DGS, SuperSplat), .splat, .spz, .sog, glTF, .usda; a ray returns from where half of it is taken, or from a geom "
        "that is nearer; "
        "may "
        "come several times",
        true},
       {"--splat-pose", "\"x y z qw qx qy qz scale\"", "where the scene of the k-th --splat stands in the world", true},
       skip_visuals_option(),
       decompose_option(),
       floating_base_option(),
       package_option(),
       {"--keyframe", "NAME|INDEX", "where the model stands; without it (and --trace) its initial pose"},
       {"--trace", "F.npz", "a trace of gsp sim: a scan of every world at every entry"},
       {"--hz", "H",
        "scans a second: rays leave one after the other, each from where the unit is then, and an entry holds the latest that make a scan; "
        "without it all leave at the entry"},
       {"--table-rate", "R", "rays a second of a .npy file, which has no times"},
       {"--self-filter", "none|body|subtree", "what of its own robot the unit does not see; body"},
       {"--min-range", "M", "[m] what is nearer is a miss, 0"},
       {"--max-range", "M", "[m] what is farther is a miss; without it nothing is"},
       {"--range-noise", "S", "[m] deviation of ranges, 0"},
       {"--angle-noise", "S", "[degrees] deviation of directions, 0"},
       {"--dropout", "P", "share of rays that do not come back, 0"},
       {"--seed", "N", "of the noise, 0"},
       {"--world", "W", "of --ply and --png, 0"},
       device_option(),
       threads_option(),
       quiet_option(),
       {"--npz", "F",
        "write time (T), range (T,N,R), -1 where nothing is met, point (T,N,R,3) in the world, geom (T,N,R), ray_time (T,R); with "
        "--splat also splat (T,N,R), the Gaussian, -1 of a geom"},
       {"--ply", "F", "write the last scan as points, in colours of their range"},
       {"--png", "F",
        "draw the last scan: from above, out to where nine of ten points lie, and around the unit, its front in the middle; near red, far "
        "blue"},
       {"--json", "", "print one JSON object: seconds, rays_per_second, startup_seconds, peak_bytes, hits, ..."}},
      run};
}

}  // namespace gsp_cli
