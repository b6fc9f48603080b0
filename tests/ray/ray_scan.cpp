// Scans of units that move: points of a room by hand at each ray's time, every ray once, whatever the steps; worlds alone and in batches;
// what a unit does not see of its robot; misses, noise, windows of long sequences, worlds that begin anew; what is refused.
#include <doctest/doctest.h>

#include <cmath>
#include <cstring>
#include <gsp/dynamics/kinematics.hpp>
#include <gsp/model/attach.hpp>
#include <gsp/model/compile.hpp>
#include <gsp/ray/livox_pattern.hpp>
#include <gsp/ray/ray_scan.hpp>
#include <gsp_test_execs.hpp>

#include "support/kernels.hpp"
#include "support/kokkos_tools.hpp"

namespace {
/// A room of 10 x 12 x 6 m, seen from inside, and in it a robot: a base that moves freely, an arm with a hand on it, and a flag apart.
gsp::Description room(bool robot = true) {
  gsp::Description d;
  d.bodies[0].geoms.push_back({.name = "room", .type = gsp::ShapeType::box, .size = {5, 6, 3}});
  int const base = gsp::add_body(d, 0, "base", {0, 0, 0});
  d.bodies[base].joints.push_back({.type = gsp::JointType::free});
  d.bodies[base].geoms.push_back({.name = "base", .type = gsp::ShapeType::box, .size = {0.05, 0.05, 0.05}});
  if (!robot) return d;
  d.bodies[base].geoms.push_back({.name = "shield", .type = gsp::ShapeType::box, .size = {0.01, 0.2, 0.2}, .pos = {0.5, 0, 0}});
  int const arm = gsp::add_body(d, base, "arm", {0, 0.5, 0});
  d.bodies[arm].joints.push_back({.type = gsp::JointType::hinge});
  d.bodies[arm].geoms.push_back({.name = "arm", .type = gsp::ShapeType::box, .size = {0.2, 0.01, 0.2}});
  int const hand = gsp::add_body(d, arm, "hand", {0, -1, 0});
  d.bodies[hand].geoms.push_back({.name = "hand", .type = gsp::ShapeType::box, .size = {0.2, 0.01, 0.2}});
  int const flag = gsp::add_body(d, 0, "flag", {-0.5, 0, 0});
  d.bodies[flag].geoms.push_back({.name = "flag", .type = gsp::ShapeType::box, .size = {0.01, 0.2, 0.2}});
  return d;
}

struct Pose {
  double p[3], q[4];
};
/// Moves at even speed and turns at an even rate about an axis that is its own.
struct Motion {
  double p[3], v[3], axis[3], rate;
  Pose at(double t) const {
    double const s = std::sin(0.5 * rate * t), c = std::cos(0.5 * rate * t);
    return {{p[0] + v[0] * t, p[1] + v[1] * t, p[2] + v[2] * t}, {c, s * axis[0], s * axis[1], s * axis[2]}};
  }
};
gsp::Vec3<double> turned(Pose const& pose, gsp::Vec3<double> const& v) {
  return gsp::rotate(gsp::Quat<double>{pose.q[0], pose.q[1], pose.q[2], pose.q[3]}, v);
}
/// From inside to the walls of the room, along a unit vector.
double to_wall(gsp::Vec3<double> const& o, gsp::Vec3<double> const& d) {
  double const half[] = {5, 6, 3};
  double least = 1e9;
  for (int c = 0; c < 3; ++c)
    if (d[c] != 0) least = std::min(least, ((d[c] > 0 ? half[c] : -half[c]) - o[c]) / d[c]);
  return least;
}

template <class R, class Exec>
struct Unit {
  Exec exec;
  int worlds;
  gsp::CompiledModel compiled;
  gsp::Model<R, typename Exec::memory_space> model;
  gsp::State<R, typename Exec::memory_space> state;
  gsp::Poses<R, typename Exec::memory_space> poses;
  gsp::Dynamics<R, typename Exec::memory_space> dynamics;
  gsp::RayScene<R, typename Exec::memory_space> scene;
  gsp::RayScan<R, typename Exec::memory_space> scan;
  std::vector<R> range, point;
  std::vector<int> geom;
  std::vector<double> time;

  Unit(gsp::Description const& description, gsp::RayPattern const& pattern, gsp::RayMountOptions const& mount,
       gsp::RayScanOptions const& options)
      : worlds(options.worlds), compiled(gsp::compile(description)), model(gsp::make_model<R>(exec, compiled)) {
    state = gsp::make_state(exec, model, {.worlds = worlds});
    poses = gsp::make_poses(exec, model, {.worlds = worlds});
    dynamics = gsp::make_dynamics(exec, model, {.worlds = worlds});
    scene = gsp::make_ray_scene<R>(exec, model, compiled, {.worlds = worlds});
    scan = gsp::make_ray_scan<R>(exec, compiled, pattern, mount, options);
    place([](int) { return Pose{{0, 0, 0}, {1, 0, 0, 0}}; });
  }
  /// The base of each world is there; geoms too.
  template <class F>
  void place(F const& pose_of) {
    auto const qpos = Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, state.qpos);
    for (int w = 0; w < worlds; ++w) {
      Pose const pose = pose_of(w);
      for (int c = 0; c < 3; ++c) qpos(w, c) = R(pose.p[c]);
      for (int c = 0; c < 4; ++c) qpos(w, 3 + c) = R(pose.q[c]);
    }
    Kokkos::deep_copy(state.qpos, qpos);
    gsp::forward_kinematics(exec, model, state, poses, dynamics);
    gsp::place_ray_geoms(exec, model, poses, scene);
  }
  void read() {
    auto const host = [](auto const& v, auto& to) {
      auto const copy = Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, v);
      to.assign(copy.data(), copy.data() + copy.size());
    };
    host(scan.range, range);
    host(scan.geom, geom);
    host(scan.point, point);
    host(scan.time, time);
  }
  template <class F>
  void run(int steps, F const& pose_of_world_at) {
    double const dt = scan.options.timestep;
    place([&](int w) { return pose_of_world_at(w, 0.); });
    gsp::begin_ray_scan(exec, poses, scan);
    for (int step = 0; step < steps; ++step) {
      place([&](int w) { return pose_of_world_at(w, (step + 1) * dt); });
      gsp::scan_rays(exec, scene, poses, scan, step);
    }
    read();
  }
};

/// A mirror across x, alone in its worlds but the first, which does not follow poses.
template <class R>
struct Mirror {
  R x;
  int hidden = -1;
  template <class Poses>
  Mirror bind(Poses const& poses, gsp::CastRaysOptions const& options) const {
    CHECK(poses.xpos.extent(0) == 3);
    return {x, options.body_exclude};
  }
  template <class T>
  KOKKOS_FUNCTION gsp::RayReturn<T> first(gsp::Ray<T> const& ray, int w, T const& most) const {
    T const at = (T(x) - ray.origin.x) / ray.direction.x;
    gsp::RayReturn<T> met{at, {}};
    for (int l = 0; l < gsp::lanes_of<T>; ++l) {
      R const one = gsp::lane_of(at, l);
      if (w > 0 && one > R(0) && one < gsp::lane_of(most, l)) met.number.set_lane(l, 10 * w + hidden);
    }
    return met;
  }
};
}  // namespace

// Rays to all sides of a room from its middle: those ahead meet the mirror at x = 2 first where its world has one.
TEST_CASE_TEMPLATE("a target of one's own beside the geoms", Exec, GSP_TEST_EXECS) {
  Unit<double, Exec> unit(room(false), gsp::rotating_pattern({0}, 37, {.rate = 0}), {.body = "base"}, {.worlds = 3, .splats = true});
  gsp::begin_ray_scan(unit.exec, unit.poses, unit.scan);
  gsp::scan_rays(unit.exec, unit.scene, unit.poses, unit.scan, 0, Mirror<double>{2});
  unit.read();
  auto const number = Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, unit.scan.splat);
  int mirrored = 0;
  for (int w = 0; w < 3; ++w)
    for (int k = 0; k < 37; ++k) {
      double const turn = 2 * 3.14159265358979323846 * k / 37;
      double const wall = to_wall({0, 0, 0}, {std::cos(turn), std::sin(turn), 0}), mirror = 2 / std::cos(turn);
      bool const nearer = w > 0 && mirror > 0 && mirror < wall;
      mirrored += nearer;
      CHECK(unit.range[std::size_t(37 * w + k)] == doctest::Approx(nearer ? mirror : wall).epsilon(1e-12));
      CHECK(number(w, k) == (nearer ? 10 * w + 1 : -1));
      CHECK(unit.geom[std::size_t(37 * w + k)] == (nearer ? -1 : 0));
    }
  CHECK(mirrored > 20);
}

// A unit that flies through a room while it turns sees skewed walls: each range is that from where the unit is at the ray's time, a point
// lies on the wall. By hand in double; in double the scan may differ by rounding of poses and sincos (1e-13 of 10 m), in float by 10
// roundings of places of up to 8 m, 10 * 6e-8 * 8 m = 5e-6, times 2 for rays that slant. Steps that are no share of a turn, too; the base
// itself, a cube about the unit, is hidden.
TEST_CASE_TEMPLATE("a unit that moves sees skewed walls", Exec, GSP_TEST_EXECS) {
  auto const run = [](auto zero, double timestep, int steps, double tolerance) {
    using R = decltype(zero);
    auto const pattern = gsp::rotating_pattern({-0.3, 0, 0.4}, 360, {.rate = 10});
    Unit<R, Exec> unit(room(false), pattern, {.body = "base", .pos = {0.02, 0.01, 0.03}},
                       {.worlds = 3, .timestep = timestep, .max_range = 100});
    auto const motion = [](int w) { return Motion{{-1, 0.5 * w, 0.2}, {2, -1, 0.5}, {0.6, 0, 0.8}, w == 0 ? 0. : w == 1 ? 3. : -7.}; };
    unit.run(steps, [&](int w, double t) { return motion(w).at(t); });
    double off = 0, skewed = 0, late = 0;
    for (int w = 0; w < 3; ++w)
      for (std::size_t k = 0; k < 1080; ++k) {
        double const t = unit.time[k];
        REQUIRE(t >= 0);
        Pose const pose = motion(w).at(t);
        auto const& from = pattern.direction[k];
        auto const d = turned(pose, {from[0], from[1], from[2]}), arm = turned(pose, {0.02, 0.01, 0.03});
        gsp::Vec3<double> const o = gsp::Vec3<double>{pose.p[0], pose.p[1], pose.p[2]} + arm;
        double const r = to_wall(o, d);
        std::size_t const i = std::size_t(w) * 1080 + k;
        REQUIRE(unit.geom[i] == 0);
        off = std::max(off, std::fabs(double(unit.range[i]) - r));
        for (int c = 0; c < 3; ++c) off = std::max(off, std::fabs(double(unit.point[3 * i + std::size_t(c)]) - (o[c] + r * d[c])));
        // beside a unit that is at the end of the last step for all of its rays
        Pose const end = motion(w).at(steps * timestep);
        skewed = std::max(skewed, std::fabs(to_wall({end.p[0], end.p[1], end.p[2]}, turned(end, {from[0], from[1], from[2]})) - r));
        late = std::max(late, steps * timestep - t);
      }
    CHECK(off < tolerance);
    CHECK(skewed > 0.1);
    CHECK(late < 0.1 + 1e-9);  // all of the last turn
    CHECK(late > 0.0995);
  };
  run(1.0, 0.002, 50, 1e-12);
  run(1.0, 0.007, 15, 1e-12);
  run(1.0, 0.05, 3, 1e-12);
  run(1.f, 0.002, 50, 1e-5);
}

// All of a step's rays in one launch or each column in its own: the poses that lie between are the same up to rounding.
TEST_CASE_TEMPLATE("long steps see what short ones do, at even speed", Exec, GSP_TEST_EXECS) {
  auto const pattern = gsp::rotating_pattern({0.1, -0.2}, 50, {.rate = 10});
  Motion const motion{{0, 0, 0}, {1, 2, 0.5}, {0, 0.6, 0.8}, 5};
  std::vector<std::vector<double>> ranges;
  for (double const timestep : {0.002, 0.1, 0.3}) {
    Unit<double, Exec> unit(room(false), pattern, {.body = "base"}, {.timestep = timestep});
    unit.run(int(std::lround(0.3 / timestep)), [&](int, double t) { return motion.at(t); });
    ranges.push_back(unit.range);
    CHECK(unit.time[0] == doctest::Approx(0.2));  // of the last turn
  }
  for (std::size_t k = 0; k < 100; ++k) {
    CHECK(std::fabs(ranges[1][k] - ranges[0][k]) < 1e-12);
    CHECK(std::fabs(ranges[2][k] - ranges[0][k]) < 1e-12);
  }
}

TEST_CASE_TEMPLATE("rays that leave all at once leave at the step's end, or at the start of a scan", Exec, GSP_TEST_EXECS) {
  auto pattern = gsp::grid_pattern(3, 1, 0.2, 0);
  auto const at = [](int, double t) { return Pose{{10 * t, 0, 0}, {1, 0, 0, 0}}; };
  Unit<double, Exec> each(room(false), pattern, {.body = "base"}, {.timestep = 0.01});
  each.run(7, at);
  CHECK(each.range[1] == doctest::Approx(5 - 0.7));
  CHECK(each.time[1] == doctest::Approx(0.07));
  pattern.period = 0.05;
  Unit<double, Exec> slow(room(false), pattern, {.body = "base"}, {.timestep = 0.01});
  slow.run(7, at);
  CHECK(slow.range[1] == doctest::Approx(5 - 0.5));
  CHECK(slow.time[1] == doctest::Approx(0.05));
}

TEST_CASE_TEMPLATE("a unit on what turns upright, and one in the world", Exec, GSP_TEST_EXECS) {
  gsp::RayPattern const ahead{{{1, 0, 0}}, {}, {0.005}, 0.01};
  // nose down by 30 degrees, turning about the vertical: level rays at half of the turn between
  auto const at = [](int, double t) {
    double const a = 0.5 * (0.2 + 30 * t), b = M_PI / 12;
    gsp::Quat<double> const q = gsp::Quat<double>{std::cos(a), 0, 0, std::sin(a)} * gsp::Quat<double>{std::cos(b), 0, std::sin(b), 0};
    return Pose{{0, 0, 1}, {q.w, q.x, q.y, q.z}};
  };
  Unit<double, Exec> level(room(false), ahead, {.body = "base", .alignment = gsp::RayAlignment::yaw}, {.timestep = 0.01});
  level.run(1, at);
  CHECK(level.range[0] == doctest::Approx(5 / std::cos(0.35)).epsilon(1e-12));
  Unit<double, Exec> fixed(room(false), ahead, {.body = "world", .pos = {1, 0, 0}}, {.timestep = 0.01});
  fixed.run(3, at);
  CHECK(fixed.geom[0] == 0);  // of the world nothing is hidden
  CHECK(fixed.range[0] == doctest::Approx(4));
}

// Ahead the shield, a geom of its own body; to the left an arm that hangs on it, to the right the hand on the arm; behind a flag that is
// not its.
TEST_CASE_TEMPLATE("what a unit does not see of its robot", Exec, GSP_TEST_EXECS) {
  gsp::RayPattern const four{{{1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {-1, 0, 0}}, {}};
  auto const geoms = [&](gsp::SelfFilter self, std::string const& body) {
    auto const compiled = gsp::compile(room());
    Unit<double, Exec> unit(room(), four, {.body = body, .pos = {0, body == "arm" ? -0.4 : 0.1, 0}}, {.self = self});
    unit.run(1, [](int, double) { return Pose{{0, 0, 0}, {1, 0, 0, 0}}; });
    // the same as a cast with what hide_self says
    auto rays = gsp::make_rays<double>(unit.exec, {.count = 4});
    auto hits = gsp::make_ray_hits<double>(unit.exec, {.count = 4});
    gsp::mount_rays(unit.exec, unit.poses, unit.scan.mount, rays);
    gsp::cast_rays(unit.exec, unit.scene, rays, hits, gsp::hide_self(compiled, unit.scan.mount.body, self));
    auto const geom = Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, hits.geom);
    for (int k = 0; k < 4; ++k) CHECK(geom(0, k) == unit.geom[std::size_t(k)]);
    return unit.geom;
  };
  // geoms: room 0, base 1, shield 2, arm 3, hand 4, flag 5; the unit stands at (0, 0.1, 0), above the edge of the base
  using Filter = gsp::SelfFilter;
  CHECK(geoms(Filter::none, "base") == std::vector<int>{2, 3, 1, 5});
  CHECK(geoms(Filter::body, "base") == std::vector<int>{0, 3, 4, 5});
  CHECK(geoms(Filter::subtree, "base") == std::vector<int>{0, 0, 0, 5});
  // on the arm, at the same place: of its subtree the hand, and its parent's geoms stay
  CHECK(geoms(Filter::body, "arm") == std::vector<int>{2, 0, 1, 5});
  CHECK(geoms(Filter::subtree, "arm") == std::vector<int>{2, 0, 1, 5});
  CHECK(geoms(Filter::none, "arm") == std::vector<int>{2, 3, 1, 5});

  auto const compiled = gsp::compile(room());
  auto const hidden = [&](int body, Filter filter) {
    auto const o = gsp::hide_self(compiled, body, filter);
    return std::pair(o.body_exclude, o.bodies);
  };
  CHECK(hidden(1, Filter::subtree) == std::pair(1, 3));
  CHECK(hidden(2, Filter::subtree) == std::pair(2, 2));
  CHECK(hidden(3, Filter::subtree) == std::pair(3, 1));
  CHECK(hidden(4, Filter::subtree) == std::pair(4, 1));
  CHECK(hidden(1, Filter::body) == std::pair(1, 1));
  CHECK(hidden(1, Filter::none) == std::pair(-1, 1));
  CHECK(hidden(0, Filter::subtree) == std::pair(-1, 1));
  CHECK_THROWS_WITH_AS(gsp::hide_self(compiled, 5, Filter::body), doctest::Contains("has 5 bodies, not one of index 5"),
                       std::invalid_argument);
}

// The numbers of noise follow the world's own number and the ray's: 64 worlds in one batch, one alone, two halves.
TEST_CASE_TEMPLATE("a world scans the same alone and in any batch, and worlds differ", Exec, GSP_TEST_EXECS) {
  auto const scan = [](int worlds, int first, double timestep) {
    Unit<float, Exec> unit(room(), gsp::mid360_pattern(0, 400), {.body = "base", .pos = {0, 0, 0.2}},
                           {.worlds = worlds,
                            .timestep = timestep,
                            .noise = {.range_sigma = 0.02, .angle_sigma = 0.003, .dropout = 0.05, .seed = 3},
                            .first_world = first});
    unit.run(int(std::lround(0.003 / timestep)), [&](int w, double t) {
      return Motion{{0.1, -0.2, 0}, {1, 0, 0}, {0, 0, 1}, 0.1 * ((first + w) / 2)}.at(t);
    });
    return unit;
  };
  auto const all = scan(64, 0, 0.0005);
  for (int const w : {0, 31, 63}) {
    auto const one = scan(1, w, 0.0005);
    CHECK(std::memcmp(one.range.data(), &all.range[std::size_t(400 * w)], 400 * sizeof(float)) == 0);
    CHECK(std::memcmp(one.point.data(), &all.point[std::size_t(1200 * w)], 1200 * sizeof(float)) == 0);
    CHECK(std::memcmp(one.geom.data(), &all.geom[std::size_t(400 * w)], 400 * sizeof(int)) == 0);
    CHECK(one.time == all.time);
  }
  auto const half = scan(32, 32, 0.0005);
  CHECK(std::memcmp(half.range.data(), &all.range[std::size_t(400 * 32)], 400 * 32 * sizeof(float)) == 0);
  // other steps: the same noise of the same rays, from poses that differ by rounding
  auto const longer = scan(64, 0, 0.0015);
  int other = 0, lost = 0;
  for (std::size_t i = 0; i < all.range.size(); ++i) {
    other += std::fabs(longer.range[i] - all.range[i]) > 1e-4f;
    lost += all.geom[i] < 0;
  }
  CHECK(other < 30);  // of 25,600: edges
  // 5 % within 5 deviations of a binomial
  CHECK(std::fabs(lost - 0.05 * 25600) < 5 * std::sqrt(0.05 * 0.95 * 25600));
  // worlds 2 and 3 move alike and have noise of their own
  int same = 0;
  for (std::size_t k = 0; k < 400; ++k) same += all.range[800 + k] == all.range[1200 + k];
  CHECK(same < 20);
}

// A wall 5 m ahead, once a step: ranges' mean and variance within 5 deviations, at the true place of the hit where only the range errs, and
// on the nominal ray where the angle does.
TEST_CASE_TEMPLATE("noise of ranges and angles, misses and limits", Exec, GSP_TEST_EXECS) {
  auto const still = [](int, double) { return Pose{{0, 0, 0}, {1, 0, 0, 0}}; };
  gsp::RayPattern ahead;
  int const n = 20000;
  ahead.direction.assign(n, {1, 0, 0});
  auto const scan = [&](gsp::RayScanOptions const& options) {
    Unit<double, Exec> unit(room(false), ahead, {.body = "base"}, options);
    unit.run(1, still);
    return unit;
  };
  {
    auto const unit = scan({.noise = {.range_sigma = 0.02, .seed = 1}});
    double sum = 0, square = 0;
    for (std::size_t k = 0; k < n; ++k) {
      sum += (unit.range[k] - 5) / 0.02;
      square += std::pow((unit.range[k] - 5) / 0.02, 2);
      CHECK(unit.point[3 * k] == unit.range[k]);
      CHECK(unit.point[3 * k + 1] == 0);
    }
    CHECK(std::fabs(sum / n) < 5 / std::sqrt(n));
    CHECK(std::fabs(square / n - 1) < 5 * std::sqrt(2. / n));
  }
  {
    // bent by a Rayleigh angle a: range 5 / cos a, of mean 5 (1 + sigma^2) and deviation 5 sigma^2; the point on the ray that was meant
    double const sigma = 0.01;
    auto const unit = scan({.noise = {.angle_sigma = sigma, .seed = 1}});
    double sum = 0;
    for (std::size_t k = 0; k < n; ++k) {
      sum += unit.range[k] - 5;
      CHECK(unit.range[k] >= 5);
      CHECK(unit.point[3 * k] == unit.range[k]);
    }
    CHECK(std::fabs(sum / n - 5 * sigma * sigma) < 5 * 5 * sigma * sigma / std::sqrt(n));
  }
  {
    auto const unit = scan({.max_range = 5, .miss = -2, .noise = {.range_sigma = 0.02, .seed = 2}});
    double lost = 0;
    for (std::size_t k = 0; k < n; ++k) {
      bool const miss = unit.geom[k] == -1;
      lost += miss;
      CHECK(miss == (unit.range[k] == -2));
      CHECK(unit.range[k] <= 5);
      if (miss) CHECK(unit.point[3 * k] == 0);
    }
    CHECK(std::fabs(lost - 0.5 * n) < 5 * std::sqrt(0.25 * n));  // the half that is measured too far
  }
  {
    // ray k of world 9 has the noise that noisy_direction and noisy_range give it, but for the rounding of a pack's cosines
    gsp::RayNoise const noise{.range_sigma = 0.02, .relative_sigma = 0.001, .angle_sigma = 0.01, .seed = 4, .unit = 3};
    auto const unit = scan({.noise = noise, .first_world = 9});
    double off = 0;
    for (std::size_t k = 0; k < n; ++k) {
      gsp::RayNumber const number{k, 9};
      double const there = 5 / gsp::noisy_direction(noise, number, gsp::Vec3<double>{1, 0, 0}).x;
      off = std::max(off, std::fabs(unit.range[k] - gsp::noisy_range(noise, number, there)));
    }
    CHECK(off < 1e-12);
  }
  CHECK(scan({.max_range = 4.99}).geom[0] == -1);
  CHECK(scan({.max_range = 5.01}).geom[0] == 0);
  CHECK(scan({.min_range = 5.01}).geom[0] == -1);
  CHECK(scan({.min_range = 4.99}).range[0] == 5);
  CHECK(std::isnan(scan({.max_range = 1, .miss = NAN}).range[0]));
  CHECK(scan({.noise = {.range_step = 0.3}}).range[0] == doctest::Approx(5.1));
  // each step of its own: the same ray later has other noise
  Unit<double, Exec> unit(room(false), ahead, {.body = "base"}, {.noise = {.range_sigma = 0.02}});
  unit.run(1, still);
  auto const before = unit.range;
  gsp::scan_rays(unit.exec, unit.scene, unit.poses, unit.scan, 1);
  unit.read();
  int same = 0;
  for (std::size_t k = 0; k < n; ++k) same += before[k] == unit.range[k];
  CHECK(same < 10);
}

TEST_CASE_TEMPLATE("a frame that rolls through a sequence, and worlds that begin anew", Exec, GSP_TEST_EXECS) {
  // 1,000 rays a frame of a sequence of 3,000, 150 a step: 20 steps a sequence
  auto const pattern = gsp::mid40_pattern(0, 3000);
  Unit<double, Exec> unit(room(false), pattern, {.body = "base"}, {.worlds = 2, .timestep = 0.0015, .rays = 1000});
  auto const still = [](int w, double) { return Pose{{w == 0 ? 0. : 2, 0, 0}, {1, 0, 0, 0}}; };
  unit.run(0, still);
  for (std::size_t k = 0; k < 1000; ++k) {
    CHECK(unit.time[k] == -1);
    CHECK(unit.range[k] == -1);
    CHECK(unit.geom[k] == -1);
  }
  unit.run(3, still);
  for (std::size_t k = 0; k < 1000; ++k) CHECK((unit.geom[k] == 0) == (k < 450));
  unit.run(27, still);  // rays 0 to 4,049: of the second round the latest 1,000 are 3,050 to 4,049
  for (std::size_t k = 0; k < 1000; ++k) {
    std::int64_t const ray = k < 50 ? 4000 + std::int64_t(k) : 3000 + std::int64_t(k);
    CHECK(unit.time[k] == doctest::Approx(1e-5 * double(ray)));
    auto const& d = pattern.direction[std::size_t(ray % 3000)];
    CHECK(unit.range[k] == doctest::Approx(to_wall({0, 0, 0}, {d[0], d[1], d[2]})));
    CHECK(unit.range[1000 + k] == doctest::Approx(to_wall({2, 0, 0}, {d[0], d[1], d[2]})));
  }
  // world 1 is put elsewhere: without begin_ray_scan it would be smeared over the way
  unit.place([](int w) { return Pose{{w == 0 ? 0. : -3, 0, 0}, {1, 0, 0, 0}}; });
  Kokkos::View<bool*, typename Exec::memory_space> mask("mask", 2);
  auto const host = Kokkos::create_mirror_view(mask);
  host(0) = false;
  host(1) = true;
  Kokkos::deep_copy(mask, host);
  gsp::begin_ray_scan(unit.exec, unit.poses, unit.scan, mask);
  unit.read();
  for (std::size_t k = 0; k < 1000; ++k) {
    CHECK(unit.geom[k] == 0);
    CHECK(unit.geom[1000 + k] == -1);
    CHECK(unit.point[3 * (1000 + k)] == 0);
  }
  gsp_test::check_algorithm(unit.exec, gsp_test::watch([&] {
                              gsp::begin_ray_scan(unit.exec, unit.poses, unit.scan, mask);
                              gsp::scan_rays(unit.exec, unit.scene, unit.poses, unit.scan, 27);
                            }));
  unit.read();
  for (std::size_t k = 50; k < 200; ++k) {
    auto const& d = pattern.direction[1000 + k];
    CHECK(unit.range[1000 + k] == doctest::Approx(to_wall({-3, 0, 0}, {d[0], d[1], d[2]})));
  }
  // more rays in a step than are kept: the last of them
  Unit<double, Exec> few(room(false), pattern, {.body = "base"}, {.timestep = 0.0333, .rays = 100, .points = false});
  few.place([](int) { return Pose{{0, 0, 0}, {1, 0, 0, 0}}; });
  gsp::begin_ray_scan(few.exec, few.poses, few.scan);
  gsp::scan_rays(few.exec, few.scene, few.poses, few.scan, 0);  // rays 0 to 3,329
  few.read();
  for (std::size_t k = 0; k < 100; ++k) CHECK(few.time[k] == doctest::Approx(1e-5 * double(k < 30 ? 3300 + k : 3200 + k)));
  CHECK(few.point.empty());
  // what is not asked for is not there
  Unit<double, Exec> bare(room(false), pattern, {.body = "base"}, {.timestep = 0.0333, .geoms = false, .points = false});
  bare.run(1, [](int, double) { return Pose{{0, 0, 0}, {1, 0, 0, 0}}; });
  CHECK(bare.geom.empty());
  CHECK(bare.range[7] == doctest::Approx(to_wall({0, 0, 0}, {pattern.direction[7][0], pattern.direction[7][1], pattern.direction[7][2]})));
}

// Back to a copy of before: all that a scan remembers is that of the first time, to the bit, in a scan that was elsewhere meanwhile too.
TEST_CASE_TEMPLATE("a scan goes on from a copy", Exec, GSP_TEST_EXECS) {
  auto const pattern = gsp::rotating_pattern({0.1, -0.2}, 90, {.rate = 10});
  gsp::RayScanOptions const options{.worlds = 3, .timestep = 0.01, .noise = {.range_sigma = 0.02, .dropout = 0.1}, .splats = true};
  Motion const motion{{0, 0, 0}, {1, 2, 0.5}, {0, 0.6, 0.8}, 5};
  Unit<float, Exec> unit(room(false), pattern, {.body = "base"}, options);
  auto const go = [&](auto& scan, int from, int to) {
    for (int step = from; step < to; ++step) {
      unit.place([&](int w) { return motion.at((step + 1) * 0.01 + w); });
      gsp::scan_rays(unit.exec, unit.scene, unit.poses, scan, step, Mirror<float>{2});
    }
  };
  auto const all = [&](auto const& scan) {
    std::vector<std::vector<double>> out;
    auto const add = [&](auto const& v) {
      auto const copy = Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, v);
      out.emplace_back(copy.data(), copy.data() + copy.size());
    };
    add(scan.range), add(scan.geom), add(scan.splat), add(scan.point), add(scan.time);
    return out;
  };
  unit.run(0, [&](int w, double) { return motion.at(w); });
  auto kept = gsp::make_ray_scan<float>(unit.exec, unit.compiled, pattern, {.body = "base"}, options);
  gsp::copy_ray_scan(unit.exec, unit.scan, kept);  // nothing yet, and any step may come
  CHECK((kept.begun && kept.next == -1));
  go(unit.scan, 0, 4);
  gsp::copy_ray_scan(unit.exec, unit.scan, kept);
  auto const at_four = all(unit.scan);
  go(unit.scan, 4, 7);
  auto const at_seven = all(unit.scan);
  CHECK(at_seven != at_four);
  gsp::copy_ray_scan(unit.exec, kept, unit.scan);
  CHECK(all(unit.scan) == at_four);
  go(unit.scan, 4, 7);
  CHECK(all(unit.scan) == at_seven);
  go(kept, 4, 7);
  CHECK(all(kept) == at_seven);
  auto bare = gsp::make_ray_scan<float>(unit.exec, unit.compiled, pattern, {.body = "base"}, {.worlds = 3, .timestep = 0.01});
  CHECK_THROWS_WITH_AS(gsp::copy_ray_scan(unit.exec, unit.scan, bare), doctest::Contains("differ in worlds, rays, geoms, splats or points"),
                       std::invalid_argument);
}

TEST_CASE_TEMPLATE("a world whose pose is no number sees nothing, and the others do not notice", Exec, GSP_TEST_EXECS) {
  Unit<float, Exec> unit(room(), gsp::vlp16_pattern(36), {.body = "base", .pos = {0, 0, 0.3}},
                         {.worlds = 2, .timestep = 0.1, .noise = {.range_sigma = 0.01, .angle_sigma = 0.01}});
  unit.place([](int) { return Pose{{0, 0, 0}, {1, 0, 0, 0}}; });
  gsp::begin_ray_scan(unit.exec, unit.poses, unit.scan);
  unit.place([](int w) { return Pose{{w == 0 ? double(NAN) : 0.1, 0, 0}, {1, 0, 0, 0}}; });
  gsp::scan_rays(unit.exec, unit.scene, unit.poses, unit.scan, 0);
  unit.read();
  int const n = 16 * 36;
  for (int k = 0; k < n; ++k) {
    CHECK(unit.geom[std::size_t(n + k)] >= 0);
    CHECK(unit.geom[std::size_t(k)] == -1);
    CHECK(unit.range[std::size_t(k)] == -1);
    CHECK(unit.point[std::size_t(3 * k)] == 0);
  }
}

TEST_CASE_TEMPLATE("scans that cannot be", Exec, GSP_TEST_EXECS) {
  Exec const exec;
  auto const compiled = gsp::compile(room());
  gsp::RayPattern const one{{{1, 0, 0}}, {}};
  auto const bad = [&](gsp::RayScanOptions const& options, char const* part) {
    CHECK_THROWS_WITH_AS(gsp::make_ray_scan<double>(exec, compiled, one, {.body = "base"}, options), doctest::Contains(part),
                         std::invalid_argument);
  };
  bad({.worlds = 0}, "worlds must be positive");
  bad({.timestep = 0}, "timestep must lie in");
  bad({.rays = -1}, "rays must lie in");
  bad({.min_range = -1}, "min_range");
  bad({.min_range = 2, .max_range = 1}, "below max_range");
  bad({.max_range = NAN}, "below max_range");
  bad({.noise = {.range_sigma = -1}}, "noise must be finite");
  bad({.noise = {.relative_sigma = NAN}}, "noise must be finite");
  bad({.noise = {.angle_sigma = INFINITY}}, "noise must be finite");
  bad({.noise = {.dropout = 1.1}}, "a probability");
  bad({.noise = {.range_step = -1}}, "noise must be finite");
  bad({.noise = {.unit = 1u << 24}}, "below 2^24");
  bad({.first_world = -1}, "first_world");
  CHECK_THROWS_AS(gsp::make_ray_scan<double>(exec, compiled, one, {.body = "bass"}), gsp::Error);
  // the timestep of a float model is that of its file
  double const own = compiled.option.timestep;
  auto const single = gsp::make_model<float>(exec, compiled);
  CHECK(double(single.timestep) != own);
  auto const steps = gsp::make_ray_scan<float>(exec, compiled, one, {.body = "base"}, {.timestep = single.timestep});
  CHECK(steps.clock.timestep == own);
  CHECK(steps.options.timestep == own);

  Unit<double, Exec> two(room(), one, {.body = "base"}, {.worlds = 2}), three(room(), one, {.body = "base"}, {.worlds = 3});
  auto const refused = [](auto const& call, char const* part) {
    CHECK_THROWS_WITH_AS(call(), doctest::Contains(part), std::invalid_argument);
  };
  refused([&] { gsp::scan_rays(exec, two.scene, three.poses, three.scan, 0); }, "the scene has 2 worlds, the scan has 3");
  refused([&] { gsp::scan_rays(exec, three.scene, two.poses, three.scan, 0); },
          "the scan is of 3 worlds and a unit on body 1, the poses of 2");
  auto fresh = gsp::make_ray_scan<double>(exec, compiled, one, {.body = "base"}, {.worlds = 3});
  gsp::begin_ray_scan(exec, three.poses, fresh, Kokkos::View<bool*, typename Exec::memory_space>("some", 3));  // not all
  refused([&] { gsp::scan_rays(exec, three.scene, three.poses, fresh, 0); },
          "call begin_ray_scan(exec, poses, scan) before the first step");
  gsp::begin_ray_scan(exec, three.poses, fresh);
  gsp::scan_rays(exec, three.scene, three.poses, fresh, 7);
  gsp::scan_rays(exec, three.scene, three.poses, fresh, 8);
  refused([&] { gsp::scan_rays(exec, three.scene, three.poses, fresh, 10); },
          "step 10 comes after step 8, and rays between them would be lost");
  for (int const step : {8, 7})  // from where the unit is now, not from where it was then
    refused([&] { gsp::scan_rays(exec, three.scene, three.poses, fresh, step); },
            "comes after step 8, and rays would leave on the way back: copy_ray_scan");
  auto nowhere = gsp::make_ray_scene<double>(exec, three.model, compiled, {.worlds = 3});
  refused([&] { gsp::scan_rays(exec, nowhere, three.poses, fresh, 9); }, "call place_ray_geoms(exec, model, poses, scene) first");
  // geoms where they were before the state moved on; those that are fixed to the world stay where they are
  auto const move_on = [&] {
    gsp::reset(exec, three.model, three.state);
    gsp::forward_kinematics(exec, three.model, three.state, three.poses, three.dynamics);
  };
  move_on();
  refused([&] { gsp::scan_rays(exec, three.scene, three.poses, fresh, 9); }, "call place_ray_geoms(exec, model, poses, scene) with these");
  gsp::place_ray_geoms(exec, three.model, three.poses, three.scene);
  gsp::scan_rays(exec, three.scene, three.poses, fresh, 9);
  auto fixed = compiled;  // what is fixed to the world is of group 0
  for (std::size_t g = 0; g < fixed.geom_group.size(); ++g) fixed.geom_group[g] = fixed.geom_body[g] == 0 ? 0 : 1;
  auto walls = gsp::make_ray_scene<double>(exec, three.model, fixed, {.worlds = 3, .groups = 1});
  gsp::place_ray_geoms(exec, three.model, three.poses, walls);
  move_on();
  gsp::scan_rays(exec, walls, three.poses, fresh, 10);
  gsp::place_ray_geoms(exec, three.model, three.poses, three.scene);
  refused([&] { gsp::scan_rays(exec, three.scene, three.poses, fresh, 12); }, "comes after step 10");
  gsp::scan_rays(exec, three.scene, three.poses, fresh, 11);  // what was refused does not count
  gsp::begin_ray_scan(exec, three.poses, fresh);
  refused([&] { gsp::scan_rays(exec, three.scene, three.poses, fresh, -1); }, "0 to 104 days");
  refused([&] { gsp::begin_ray_scan(exec, two.poses, three.scan); }, "the scan is of 3 worlds");
  Kokkos::View<bool*, typename Exec::memory_space> const mask("mask", 2);
  refused([&] { gsp::begin_ray_scan(exec, three.poses, three.scan, mask); }, "the mask has 2 worlds and the scan 3");
  auto rays = gsp::make_rays<double>(exec, {.worlds = 3});
  auto hits = gsp::make_ray_hits<double>(exec, {.worlds = 3});
  refused([&] { gsp::cast_rays(exec, three.scene, rays, hits, {.bodies = 2}); }, "take both from hide_self");
}
