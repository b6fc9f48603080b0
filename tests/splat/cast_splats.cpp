// Rays through Gaussians beside all Gaussians of the world, in double, sorted; and beside pictures of the same Gaussians.
#include <doctest/doctest.h>

#include <algorithm>
#include <cstring>
#include <gsp/io/gaussians.hpp>
#include <gsp/io/splats.hpp>
#include <gsp/model/attach.hpp>
#include <gsp/model/compile.hpp>
#include <gsp/splat/cast_splats.hpp>
#include <gsp/splat/median_depth.hpp>
#include <gsp/splat/render.hpp>
#include <gsp/splat/splat_target.hpp>
#include <gsp_test_execs.hpp>
#include <splat/scenes.hpp>
#include <support/data.hpp>
#include <support/kokkos_tools.hpp>
#include <support/skip.hpp>

namespace {

using Places = std::vector<std::vector<gsp::Transform<double>>>;  // of worlds, of bodies

/// What a ray returns from, of all Gaussians of a world. By another route than the kernel's: in the world's frame, and how near the ray
/// comes from the point of greatest response itself.
struct Reference {
  gsp::GaussianSet const& set;
  double left = 0.5, alpha_max = 0.999;
  struct Return {
    double distance = -1, left = 1;
    int gaussian = -1;
    double margin = 1;  // how near to `left` any product came, relatively: where it is little, rounding decides
    int met = 0;
  };
  struct Met {
    double x, alpha;
    int index;
  };
  std::vector<Met> all(std::vector<gsp::Transform<double>> const& bodies, gsp::Ray<double> const& ray, double most) const {
    std::vector<Met> met;
    for (std::size_t i = 0; i < set.size(); ++i) {
      gsp::Transform<double> const& body = bodies[std::size_t(set.body[i])];
      float const *const q = &set.quats[4 * i], *const p = &set.positions[3 * i], *const s = &set.scales[3 * i];
      auto const turn = body.q * gsp::normalized(gsp::Quat<double>{q[0], q[1], q[2], q[3]});
      auto const whitened = [&](gsp::Vec3<double> const& v) {
        auto const own = rotate_inverse(turn, v);
        return gsp::Vec3<double>{own.x / s[0], own.y / s[1], own.z / s[2]};
      };
      auto const u = whitened(ray.origin - body * gsp::Vec3<double>{p[0], p[1], p[2]}), d = whitened(ray.direction);
      double const x = -dot(u, d) / dot(d, d);
      auto const nearest = u + x * d;
      double const alpha = std::min(set.opacities[i] * std::exp(-0.5 * dot(nearest, nearest)), alpha_max);
      if (alpha >= 1 / 255. && x > 0 && x < most) met.push_back({x, alpha, int(i)});
    }
    std::sort(met.begin(), met.end(), [](Met const& a, Met const& b) { return a.x != b.x ? a.x < b.x : a.index < b.index; });
    return met;
  }
  Return first(std::vector<gsp::Transform<double>> const& bodies, gsp::Ray<double> const& ray, double most = INFINITY) const {
    Return r;
    for (auto const& m : all(bodies, ray, most)) {
      ++r.met;
      r.left *= 1 - m.alpha;
      r.margin = std::min(r.margin, std::abs(r.left / left - 1));
      if (r.left > left) continue;
      r.distance = m.x;
      r.gaussian = m.index;
      return r;
    }
    return r;
  }
};

/// Rays from about the origin, of any length of direction.
template <class R, class Exec>
auto random_rays(Exec const& exec, int worlds, int count, double from, unsigned seed) {
  auto const rays = gsp::make_rays<R>(exec, {.worlds = worlds, .count = count});
  auto const o = Kokkos::create_mirror_view(rays.origin), d = Kokkos::create_mirror_view(rays.direction);
  for (int w = 0; w < worlds; ++w) {
    gsp_test::Random random(seed + unsigned(w));
    for (int k = 0; k < count; ++k) {
      double const length = std::exp(random.uniform(-3, 3));
      for (int c = 0; c < 3; ++c) {
        o(w, k, c) = R(random.uniform(-from, from));
        d(w, k, c) = R(length * random.uniform(-1, 1));
      }
    }
  }
  Kokkos::deep_copy(rays.origin, o);
  Kokkos::deep_copy(rays.direction, d);
  return rays;
}
template <class View>
auto on_host(View const& v) {
  return Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, v);
}
template <class Rays>
gsp::Ray<double> ray_of(Rays const& o, Rays const& d, int w, int k) {
  return {{double(o(w, k, 0)), double(o(w, k, 1)), double(o(w, k, 2))}, {double(d(w, k, 0)), double(d(w, k, 1)), double(d(w, k, 2))}};
}
template <class View>
bool same_bits(View const& a, View const& b) {
  return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof(typename View::value_type)) == 0;
}

/// A Gaussian as round as a disc or a ball is, in the world.
void add(gsp::GaussianSet& set, gsp::Vec3<double> const& at, gsp::Quat<double> const& turn, gsp::Vec3<double> const& sigma,
         double opacity) {
  for (int c = 0; c < 3; ++c) {
    set.positions.push_back(float(at[c]));
    set.scales.push_back(float(sigma[c]));
    set.sh.push_back(0);
  }
  for (double const x : {turn.w, turn.x, turn.y, turn.z}) set.quats.push_back(float(x));
  set.opacities.push_back(float(opacity));
  set.body.push_back(0);
}
/// Turns z to n.
gsp::Quat<double> facing(gsp::Vec3<double> const& n) {
  return gsp::normalized(n.z > -0.999 ? gsp::Quat<double>{1 + n.z, -n.y, n.x, 0} : gsp::Quat<double>{0, 1, 0, 0});
}

/// Of the ball about `middle` of radius `radius`, a disc at a time.
gsp::GaussianSet ball_of_discs(gsp::Vec3<double> const& middle, double radius, int count, double wide, double thick) {
  gsp::GaussianSet set;
  for (int k = 0; k < count; ++k) {  // Fibonacci's lattice
    double const z = 1 - (2 * k + 1.) / count, r = std::sqrt(1 - z * z), a = 2.399963 * k;
    gsp::Vec3<double> const n{r * std::cos(a), r * std::sin(a), z};
    add(set, middle + radius * n, facing(n), {wide, wide, thick}, 0.95);
  }
  return set;
}

struct Agreement {
  int pixels = 0, same_hit = 0, hits = 0, within_1 = 0, within_5 = 0;
};
/// Rays through the middles of a picture's pixels, beside its median depth.
template <class Exec>
Agreement beside_picture(gsp::GaussianSet const& set, gsp::Vec3<double> const& eye, double yaw, double pitch, float blur) {
  using Mem = typename Exec::memory_space;
  Exec const exec;
  int const width = 160, height = 120;
  float const f = 0.8f * width;
  std::vector<float> viewmats;
  gsp_test::room_camera(eye, yaw, pitch, viewmats);
  auto const cloud = gsp::make_gaussians(exec, set);
  auto const poses = gsp::make_poses<float>(exec, 1, 1, 0);
  auto const cameras = gsp::make_cameras(exec, viewmats, {f, 0, width / 2.f, 0, f, height / 2.f, 0, 0, 1});
  auto frames = gsp::make_frames(exec, cloud, {.images = 1, .width = width, .height = height});
  gsp::MedianDepthChannel<Mem> const median{Kokkos::View<float***, Kokkos::LayoutRight, Mem>("median", 1, height, width)};
  gsp::render(exec, cloud, poses, cameras, frames, {.blur = blur}, median);
  auto const rays = gsp::make_rays<float>(exec, {.count = width * height});
  auto const o = Kokkos::create_mirror_view(rays.origin), d = Kokkos::create_mirror_view(rays.direction);
  for (int k = 0; k < width * height; ++k) {  // of camera z 1, so that distances are camera z
    float const x = (float(k % width) + 0.5f - width / 2.f) / f, y = (float(k / width) + 0.5f - height / 2.f) / f;
    for (int c = 0; c < 3; ++c) {
      o(0, k, c) = float(eye[c]);
      d(0, k, c) = x * viewmats[std::size_t(c)] + y * viewmats[std::size_t(4 + c)] + viewmats[std::size_t(8 + c)];
    }
  }
  Kokkos::deep_copy(rays.origin, o);
  Kokkos::deep_copy(rays.direction, d);
  auto const tree = gsp::make_splat_tree(exec, set);
  auto hits = gsp::make_splat_hits<float>(exec, {.count = width * height});
  gsp::cast_splats(exec, tree, poses, rays, hits);
  auto const range = on_host(hits.distance);
  auto const depth = on_host(median.image);
  Agreement a;
  for (int k = 0; k < width * height; ++k) {
    float const z = depth(0, k / width, k % width), x = range(0, k);
    ++a.pixels;
    a.same_hit += (z > 0) == (x >= 0);
    if (!(z > 0) || !(x >= 0)) continue;
    ++a.hits;
    a.within_1 += std::abs(x - z) <= 0.01f * z;
    a.within_5 += std::abs(x - z) <= 0.05f * z;
  }
  return a;
}

}  // namespace

// Records are float: 6e-8 of axes and opacities. In double nothing else is rounded, so products are known to about 1e-7 a Gaussian, and
// returns are the same where none comes as near to the half. In float alphas have errors of 1e-7 range / width, here up to 1e-4.
TEST_CASE_TEMPLATE("rays return from what all Gaussians, sorted, say", Exec, GSP_TEST_EXECS) {
  Exec const exec;
  auto const check = [&]<class R>(R, double distance_error, double margin) {
    int const worlds = 3, count = 500, bodies = 4;
    auto const set = gsp_test::random_gaussians(4000, 0, bodies, 5);
    Places places;
    auto const poses = gsp_test::random_poses<R>(exec, worlds, bodies, 7, places);
    auto const tree = gsp::make_splat_tree(exec, set);
    CHECK(tree.left_out == std::count_if(set.opacities.begin(), set.opacities.end(), [](float x) { return x * 255 < 1; }));
    auto const rays = random_rays<R>(exec, worlds, count, 1.5, 3);
    auto hits = gsp::make_splat_hits<R>(exec, {.worlds = worlds, .count = count});
    gsp_test::check_algorithm(exec, gsp_test::watch([&] { gsp::cast_splats(exec, tree, poses, rays, hits); }));
    auto const o = on_host(rays.origin), d = on_host(rays.direction);
    auto const distance = on_host(hits.distance), opacity = on_host(hits.opacity);
    auto const gaussian = on_host(hits.gaussian);
    Reference const reference{set};
    int met = 0, other = 0, doubtful = 0, most = 0;
    for (int w = 0; w < worlds; ++w)
      for (int k = 0; k < count; ++k) {
        auto const want = reference.first(places[std::size_t(w)], ray_of(o, d, w, k));
        met += want.gaussian >= 0;
        most = std::max(most, want.met);
        if (want.margin < margin) {
          ++doubtful;
          continue;
        }
        if (gaussian(w, k) != want.gaussian) {
          ++other;
          continue;
        }
        if (want.gaussian >= 0)
          CHECK(double(distance(w, k)) == doctest::Approx(want.distance).epsilon(distance_error));
        else
          CHECK(distance(w, k) == R(-1));
        CHECK(std::abs(double(opacity(w, k)) - (1 - want.left)) < 10 * margin);
      }
    CHECK(met > 300);
    CHECK(met < worlds * count - 300);
    CHECK(most > 16);
    CHECK(other == 0);
    CHECK(doubtful < 10);
  };
  check(double(), 1e-6, 1e-6);
  check(float(), 1e-5, 1e-4);
}

TEST_CASE("however little room there is, what a ray returns is the same to the bit, haze and ties too") {
  using Exec = Kokkos::DefaultHostExecutionSpace;
  using Mem = Kokkos::HostSpace;
  Exec const exec;
  // 400 balls of haze along x, two and two at one place, so that which is met first is decided by the index; behind a thin cloud
  gsp::GaussianSet set = gsp_test::random_gaussians(300, 0, 1, 9);
  for (float& x : set.opacities) x *= 0.3f;
  for (int k = 0; k < 400; ++k) add(set, {2 + 0.01 * ((k * 7 % 400) / 2), 0, 0}, {1, 0, 0, 0}, {0.3, 0.3, 0.3}, 0.006);
  auto const tree = gsp::make_splat_tree(exec, set);
  auto const poses = gsp::make_poses<float>(exec, 1, 1, 0);
  auto const caster = [&]<int room>(std::integral_constant<int, room>, float left) {
    return gsp::detail::SplatCaster<float, Mem, room>{tree, poses, {.left = left}};
  };
  struct Count {
    long* passes;
    KOKKOS_FUNCTION void pass() const { ++*passes; }
    KOKKOS_FUNCTION void look_at(int) const {}
  };
  gsp_test::Random random(1);
  long few = 0, many = 0;
  for (int k = 0; k < 500; ++k) {
    gsp::Ray<float> ray{{-2, 0, 0}, {1, float(random.uniform(-.1, .1)), float(random.uniform(-.1, .1))}};
    if (k % 5 == 0) ray = {{1.2f, 0, 0}, {2, 0, 0}};
    float const left = k % 3 == 0 ? 0.5f : k % 3 == 1 ? 0.05f : 0.2f;
    auto const a = caster(std::integral_constant<int, 1>(), left).first(ray, 0, float(INFINITY), Count{&few});
    auto const c = caster(std::integral_constant<int, 1000>(), left).first(ray, 0, float(INFINITY), Count{&many});
    REQUIRE(a.gaussian[0] == c.gaussian[0]);
    REQUIRE(std::memcmp(&a.distance, &c.distance, 4) == 0);
    REQUIRE(std::memcmp(&a.left, &c.left, 4) == 0);
  }
  CHECK(many == 500);  // passes
  CHECK(few > 40 * many);
  // In closed form: along the middle of the haze alone. (1 - 0.006)^n <= 1/2 for n = 116 of 400; the 116th in the order of place and index
  // is the second of the 58th place.
  gsp::GaussianSet haze;
  for (int k = 0; k < 400; ++k) add(haze, {2 + 0.01 * ((k * 7 % 400) / 2), 0, 0}, {1, 0, 0, 0}, {0.3, 0.3, 0.3}, 0.006);
  CHECK(std::pow(1 - double(0.006f), 115) > 0.5);
  CHECK(std::pow(1 - double(0.006f), 116) < 0.5);
  std::vector<int> at;
  for (int k = 0; k < 400; ++k)
    if ((k * 7 % 400) / 2 == 57) at.push_back(k);
  REQUIRE(at.size() == 2);
  auto const haze_tree = gsp::make_splat_tree(exec, haze);
  auto const met = gsp::detail::SplatCaster<float, Mem>{haze_tree, poses, {}}.first(gsp::Ray<float>{{1, 0, 0}, {0.5f, 0, 0}}, 0, INFINITY);
  CHECK(met.gaussian[0] == at[1]);
  CHECK(met.distance == doctest::Approx(2 * (1 + 0.57)).epsilon(1e-6));
}

// One ray of a pack goes through haze again and again; the others pass it by, within its boxes and beyond where it responds: they are
// through after one pass, so the pack looks at no more than both alone.
TEST_CASE("rays of a pack that meet nothing are not asked again") {
  using Exec = Kokkos::DefaultHostExecutionSpace;
  using Mem = Kokkos::HostSpace;
  using T = gsp::Pack<float, gsp::native_width<float>>;
  Exec const exec;
  gsp::GaussianSet haze;
  for (int k = 0; k < 400; ++k) add(haze, {2 + 0.01 * k, 0, 0}, {1, 0, 0, 0}, {0.3, 0.3, 0.3}, 0.006);
  auto const tree = gsp::make_splat_tree(exec, haze);
  auto const poses = gsp::make_poses<float>(exec, 1, 1, 0);
  struct Count {
    long *passes, *looks;
    KOKKOS_FUNCTION void pass() const { ++*passes; }
    KOKKOS_FUNCTION void look_at(int n) const { *looks += n; }
  };
  struct Cost {
    long passes = 0, looks = 0;
  };
  auto const cost = [&](auto const& aside) {  // of lane l from the middle [m]
    T off;
    for (int l = 0; l < T::width; ++l) off.set(l, aside(l));
    Cost c;
    auto const met = gsp::detail::SplatCaster<float, Mem, 2>{tree, poses, {}}.first(
        gsp::Ray<T>{{T(0.f), off, off}, {T(1.f), T(0.f), T(0.f)}}, 0, gsp::detail::no_hit<T>(), Count{&c.passes, &c.looks});
    for (int l = 0; l < T::width; ++l) CHECK((met.gaussian[l] >= 0) == (aside(l) == 0));
    return c;
  };
  auto const through = cost([](int) { return 0.f; }), by = cost([](int) { return 0.25f; }),
             both = cost([](int l) { return l == 0 ? 0.f : 0.25f; });
  CHECK(by.passes == 1);
  CHECK(by.looks > 100);
  CHECK(through.passes > 50);
  CHECK(both.passes == through.passes);
  CHECK(both.looks <= through.looks + by.looks);
}

// A disc is as wide as discs lie apart, so that about ten are met at any place: what is met first lies within its thickness, and what a
// ball of radius 1 falls away beside a disc's middle, 3 sigma^2 / 2.
TEST_CASE_TEMPLATE("what is opaque is met on its surface", Exec, GSP_TEST_EXECS) {
  Exec const exec;
  double const wide = 0.02, thick = 0.001;
  auto set = ball_of_discs({3, 0, 0}, 1, 40000, wide, thick);
  int const on_ball = int(set.size());
  for (int i = -100; i <= 100; ++i)
    for (int j = -100; j <= 100; ++j) add(set, {0.02 * i, 0.02 * j, -2}, {1, 0, 0, 0}, {wide, wide, thick}, 0.95);
  auto const tree = gsp::make_splat_tree(exec, set);
  auto const poses = gsp::make_poses<float>(exec, 1, 1, 0);
  int const count = 4000;
  auto const rays = gsp::make_rays<float>(exec, {.count = count});
  auto const o = Kokkos::create_mirror_view(rays.origin), d = Kokkos::create_mirror_view(rays.direction);
  gsp_test::Random random(2);
  for (int k = 0; k < count; ++k) {  // half to the ball, within 60 degrees of its front, half to the plane
    double const a = random.uniform(0, 6.28), r = 0.28 * std::sqrt(random.uniform(0, 1));
    gsp::Vec3<double> const to =
        k % 2 ? gsp::Vec3<double>{1, r * std::cos(a), r * std::sin(a)} : gsp::Vec3<double>{0.7 * std::cos(a), 0.7 * std::sin(a), -1};
    for (int c = 0; c < 3; ++c) {
      o(0, k, c) = 0;
      d(0, k, c) = float(to[c]);
    }
  }
  Kokkos::deep_copy(rays.origin, o);
  Kokkos::deep_copy(rays.direction, d);
  auto hits = gsp::make_splat_hits<float>(exec, {.count = count});
  gsp::cast_splats(exec, tree, poses, rays, hits);
  auto const distance = on_host(hits.distance);
  auto const gaussian = on_host(hits.gaussian);
  double worst_ball = 0, worst_plane = 0;
  for (int k = 0; k < count; ++k) {
    auto const ray = ray_of(o, d, 0, k);
    REQUIRE(gaussian(0, k) >= 0);
    REQUIRE((gaussian(0, k) < on_ball) == (k % 2 == 1));
    auto const at = ray.at(double(distance(0, k)));
    if (k % 2)
      worst_ball = std::max(worst_ball, std::abs(norm(at - gsp::Vec3<double>{3, 0, 0}) - 1));
    else
      worst_plane = std::max(worst_plane, std::abs(at.z + 2));
  }
  CHECK(worst_plane < thick);
  CHECK(worst_ball < thick + 1.5 * wide * wide);
}

// The turn by 90 degrees and places in 64ths are exact, so what was moved before is the same set; what is left is rounding in double.
TEST_CASE_TEMPLATE("Gaussians move with their link, the nearer of Gaussians and of what was met before wins, a body can be left out", Exec,
                   GSP_TEST_EXECS) {
  Exec const exec;
  int const count = 1500;
  gsp::GaussianSet own = gsp_test::random_gaussians(400, 0, 1, 21), moved = own, both = own;
  for (int& b : own.body) b = 2;
  for (std::size_t i = 0; i < own.size(); ++i) {  // (x, y, z) to (1/4 - y, 1/2 + x, 1/64 + z), x, y and z in 64ths
    float* const p = &own.positions[3 * i];
    for (int c = 0; c < 3; ++c) p[c] = std::round(64 * p[c]) / 64;
    float const to[3] = {0.25f - p[1], 0.5f + p[0], 1 / 64.f + p[2]};
    for (int c = 0; c < 3; ++c) moved.positions[3 * i + std::size_t(c)] = to[c];
    // sigma along x and y of an axis-parallel Gaussian change places
    for (int c = 0; c < 4; ++c) own.quats[4 * i + std::size_t(c)] = moved.quats[4 * i + std::size_t(c)] = c == 0;
    std::swap(moved.scales[3 * i], moved.scales[3 * i + 1]);
  }
  double const half = std::sqrt(0.5);
  auto const poses = gsp::make_poses<double>(exec, 1, 3, 0);
  auto const x = on_host(poses.xpos), q = on_host(poses.xquat);
  x(0, 2, 0) = 0.25, x(0, 2, 1) = 0.5, x(0, 2, 2) = 1 / 64.;
  q(0, 2, 0) = q(0, 2, 3) = half;
  Kokkos::deep_copy(poses.xpos, x);
  Kokkos::deep_copy(poses.xquat, q);
  auto const rays = random_rays<double>(exec, 1, count, 1, 4);
  auto a = gsp::make_splat_hits<double>(exec, {.count = count}), b = gsp::make_splat_hits<double>(exec, {.count = count});
  auto const on_link = gsp::make_splat_tree(exec, own), at_rest = gsp::make_splat_tree(exec, moved);
  gsp::cast_splats(exec, on_link, poses, rays, a);
  gsp::cast_splats(exec, at_rest, poses, rays, b);
  auto const xa = on_host(a.distance), xb = on_host(b.distance);
  auto const ga = on_host(a.gaussian), gb = on_host(b.gaussian);
  int met = 0;
  for (int k = 0; k < count; ++k) {
    CHECK(ga(0, k) == gb(0, k));
    CHECK(xa(0, k) == doctest::Approx(xb(0, k)).epsilon(1e-11));
    met += ga(0, k) >= 0;
  }
  CHECK(met > 100);

  // What was met before, a little nearer, a little farther, or nothing.
  auto mixed = gsp::make_splat_hits<double>(exec, {.count = count});
  auto const before = on_host(mixed.distance);
  for (int k = 0; k < count; ++k) before(0, k) = k % 3 == 0 || ga(0, k) < 0 ? -1 : (k % 3 == 1 ? 0.999 : 1.001) * xa(0, k);
  Kokkos::deep_copy(mixed.distance, before);
  gsp::cast_splats(exec, on_link, poses, rays, mixed.distance, mixed);
  auto const xm = on_host(mixed.distance), om = on_host(mixed.opacity), oa = on_host(a.opacity);
  auto const gm = on_host(mixed.gaussian);
  for (int k = 0; k < count; ++k) {
    bool const geom = k % 3 == 1 && ga(0, k) >= 0;
    CHECK(gm(0, k) == (geom ? -1 : ga(0, k)));
    CHECK(xm(0, k) == (geom ? before(0, k) : xa(0, k)));
    CHECK((geom ? om(0, k) < 0.5 : om(0, k) == oa(0, k)));
  }
  gsp::cast_splats(exec, on_link, poses, rays, b, {.hidden = {.body_exclude = 1, .bodies = 2}});
  auto const x_hidden = on_host(b.distance), o_hidden = on_host(b.opacity);
  auto const g_hidden = on_host(b.gaussian);
  for (int k = 0; k < count; ++k)
    CHECK((x_hidden(0, k) == -1 && g_hidden(0, k) == -1 && o_hidden(0, k) == 0));    // which 100 and more had met
  gsp::cast_splats(exec, on_link, poses, rays, b, {.hidden = {.body_exclude = 1}});  // another body's
  CHECK(same_bits(on_host(b.distance), xa));
  // of every other one on the link the rest is left, as if the link's were not there
  auto rest = both;
  for (std::size_t i = 1; i < both.size(); i += 2) both.body[i] = 2, rest.opacities[i] = 0;
  gsp::cast_splats(exec, gsp::make_splat_tree(exec, rest), poses, rays, a);
  auto const tree = gsp::make_splat_tree(exec, both);
  gsp::cast_splats(exec, tree, poses, rays, b);
  CHECK(!same_bits(on_host(b.gaussian), on_host(a.gaussian)));
  gsp::cast_splats(exec, tree, poses, rays, b, {.hidden = {.body_exclude = 2}});
  CHECK(same_bits(on_host(b.distance), on_host(a.distance)));
  CHECK(same_bits(on_host(b.gaussian), on_host(a.gaussian)));
  CHECK(same_bits(on_host(b.opacity), on_host(a.opacity)));
}

TEST_CASE_TEMPLATE("a world's rays return what they return alone and in any order; what is no ray, and no Gaussians", Exec,
                   GSP_TEST_EXECS) {
  Exec const exec;
  int const worlds = 7, count = 301;
  auto const set = gsp_test::random_gaussians(500, 0, 3, 13);
  auto const tree = gsp::make_splat_tree(exec, set);
  Places places;
  auto const poses = gsp_test::random_poses<float>(exec, worlds, 3, 17, places);
  auto const rays = random_rays<float>(exec, worlds, count, 1, 19);
  auto hits = gsp::make_splat_hits<float>(exec, {.worlds = worlds, .count = count});
  gsp::cast_splats(exec, tree, poses, rays, hits);
  auto const all = on_host(hits.distance), opacity = on_host(hits.opacity);
  auto const o = on_host(rays.origin), d = on_host(rays.direction);
  auto const x = on_host(poses.xpos), q = on_host(poses.xquat);
  for (int const w : {0, 4}) {
    auto const one = gsp::make_poses<float>(exec, 1, 3, 0);
    auto const ox = on_host(one.xpos), oq = on_host(one.xquat);
    for (int b = 0; b < 3; ++b)
      for (int c = 0; c < 4; ++c) {
        if (c < 3) ox(0, b, c) = x(w, b, c);
        oq(0, b, c) = q(w, b, c);
      }
    Kokkos::deep_copy(one.xpos, ox);
    Kokkos::deep_copy(one.xquat, oq);
    auto const turned = gsp::make_rays<float>(exec, {.count = count});  // the last first
    auto const to = on_host(turned.origin), td = on_host(turned.direction);
    for (int k = 0; k < count; ++k)
      for (int c = 0; c < 3; ++c) {
        to(0, count - 1 - k, c) = o(w, k, c);
        td(0, count - 1 - k, c) = d(w, k, c);
      }
    Kokkos::deep_copy(turned.origin, to);
    Kokkos::deep_copy(turned.direction, td);
    auto alone = gsp::make_splat_hits<float>(exec, {.count = count});
    gsp::cast_splats(exec, tree, one, turned, alone);
    auto const ax = on_host(alone.distance), ao = on_host(alone.opacity);
    int differ = 0;
    for (int k = 0; k < count; ++k)
      differ += std::memcmp(&ax(0, count - 1 - k), &all(w, k), 4) != 0 || std::memcmp(&ao(0, count - 1 - k), &opacity(w, k), 4) != 0;
    CHECK(differ == 0);
  }
  for (int k = 0; k < 6; ++k) {
    float const bad[] = {0, NAN, INFINITY};
    for (int c = 0; c < 3; ++c) (k < 3 ? d : o)(2, k, c) = k == 3 ? 0 : bad[k % 3];
  }
  for (int c = 0; c < 3; ++c) d(2, 3, c) = 0;
  Kokkos::deep_copy(rays.origin, o);
  Kokkos::deep_copy(rays.direction, d);
  auto const nowhere = on_host(poses.xpos);  // a world that has no poses meets nothing
  for (int b = 0; b < 3; ++b) nowhere(5, b, 0) = NAN;
  Kokkos::deep_copy(poses.xpos, nowhere);
  gsp::cast_splats(exec, tree, poses, rays, hits);
  auto const gaussian = on_host(hits.gaussian);
  for (int k = 0; k < 6; ++k) CHECK(gaussian(2, k) == -1);
  for (int k = 0; k < count; ++k) CHECK(gaussian(5, k) == -1);
  CHECK(on_host(hits.distance)(2, 0) == -1);

  auto const empty = gsp::make_splat_tree(exec, std::vector<gsp::GaussianSet>{});
  gsp::cast_splats(exec, empty, poses, rays, hits);
  CHECK(on_host(hits.gaussian)(1, 1) == -1);
  CHECK(on_host(hits.opacity)(1, 1) == 0);

  // A disc without thickness, a needle without width, a point.
  gsp::GaussianSet flat;
  add(flat, {2, 0, 0}, {1, 0, 0, 0}, {0, 0, 0}, 1);
  add(flat, {3, 0, 0}, {1, 0, 0, 0}, {0, 0.1, 0.1}, 1);
  add(flat, {1, 0, 0}, {1, 0, 0, 0}, {0, 0, 1}, 0.003);
  auto const disc = gsp::make_splat_tree(exec, flat);
  CHECK(disc.left_out == 2);
  auto const still = gsp::make_poses<float>(exec, 1, 1, 0);
  auto const ahead = gsp::make_rays<float>(exec, {.count = 1});
  auto const ad = on_host(ahead.direction);
  ad(0, 0, 0) = 1, ad(0, 0, 1) = 0.01f;
  Kokkos::deep_copy(ahead.direction, ad);
  auto one = gsp::make_splat_hits<float>(exec);
  gsp::cast_splats(exec, disc, still, ahead, one);
  CHECK(on_host(one.gaussian)(0, 0) == 1);
  CHECK(on_host(one.distance)(0, 0) == doctest::Approx(3).epsilon(1e-6));

  // 3 m are 3e38 lengths of 1e-38 m, and of 1e-39 m more than a float holds: as cast_rays has it, a miss.
  for (float const length : {1e-38f, 1e-39f}) {
    ad(0, 0, 0) = length, ad(0, 0, 1) = 0.01f * length;
    Kokkos::deep_copy(ahead.direction, ad);
    gsp::cast_splats(exec, disc, still, ahead, one);
    CHECK(on_host(one.gaussian)(0, 0) == (length > 5e-39f ? 1 : -1));
    double const distance = on_host(one.distance)(0, 0);
    if (length > 5e-39f)
      CHECK(distance == doctest::Approx(3 / double(length)).epsilon(1e-6));
    else
      CHECK(distance == -1);
  }

  CHECK_THROWS_WITH_AS(gsp::cast_splats(exec, tree, still, ahead, one), doctest::Contains("name 3 bodies but the poses have 1"),
                       std::invalid_argument);
  CHECK_THROWS_WITH_AS(gsp::cast_splats(exec, disc, poses, ahead, one), doctest::Contains("of 1 worlds, the poses of 7"),
                       std::invalid_argument);
  CHECK_THROWS_AS(gsp::cast_splats(exec, disc, still, ahead, hits), std::invalid_argument);
  CHECK_THROWS_AS(gsp::cast_splats(exec, disc, still, ahead, one, {.left = 2}), std::invalid_argument);
  CHECK_THROWS_AS(gsp::cast_splats(exec, disc, still, ahead, one, {.hidden = {.bodies = 2}}), std::invalid_argument);
  gsp::GaussianSet broken = flat;
  broken.quats[4] = 0;
  CHECK_THROWS_WITH_AS(gsp::make_splat_tree(exec, broken), doctest::Contains("gsp::make_splat_tree: set 0: the rotation of Gaussian 1"),
                       std::invalid_argument);
}

TEST_CASE_TEMPLATE("a unit scans Gaussians and geoms, the nearer wins, and does not see its own body", Exec, GSP_TEST_EXECS) {
  Exec const exec;
  gsp::Description d;
  d.bodies[0].geoms.push_back({.name = "wall", .type = gsp::ShapeType::box, .size = {0.5, 9, 9}, .pos = {4.5, 0, 0}});
  int const base = gsp::add_body(d, 0, "base", {0, 0, 0});
  d.bodies[base].geoms.push_back({.name = "base", .size = {0.1, 0, 0}});
  auto const compiled = gsp::compile(d);
  auto const model = gsp::make_model<float>(exec, compiled);
  int const worlds = 2;
  auto const poses = gsp::make_poses<float>(exec, worlds, 2, 0);  // in world 1 the unit is 1 m to the left
  auto const x = on_host(poses.xpos);
  x(1, 1, 1) = 1;
  Kokkos::deep_copy(poses.xpos, x);
  gsp::GaussianSet set;  // discs across x: before the wall, behind the wall, thin, and two on the unit's body
  double const wide = 0.05;
  for (gsp::Vec3<double> const& at : {gsp::Vec3<double>{2, 0, 0}, {5, 1, 0}, {2, 1, 0}, {1, 0, 1}, {0, 0, -1}})
    add(set, at, facing({1, 0, 0}), {wide, wide, 0.001}, at.y == 1 && at.x == 2 ? 0.4 : 0.99);
  set.body[3] = set.body[4] = 1;
  auto const tree = gsp::make_splat_tree(exec, set);
  auto scene = gsp::make_ray_scene<float>(exec, model, compiled, {.worlds = worlds});
  gsp::place_ray_geoms(exec, model, poses, scene);
  gsp::RayPattern pattern;
  double const s = std::sqrt(0.5);
  pattern.direction = {{1, 0, 0}, {s, 0, s}, {-1, 0, 0}};
  for (auto const self : {gsp::SelfFilter::body, gsp::SelfFilter::none}) {
    auto unit = gsp::make_ray_scan<float>(exec, compiled, pattern, {.body = "base"},
                                          {.worlds = worlds, .min_range = 0.2, .max_range = 10, .self = self, .splats = true});
    gsp::begin_ray_scan(exec, poses, unit);
    auto const target = gsp::splat_target(tree);
    gsp_test::check_algorithm(exec, gsp_test::watch([&] { gsp::scan_rays(exec, scene, poses, unit, 0, target); }));
    auto const range = on_host(unit.range);
    auto const geom = on_host(unit.geom), splat = on_host(unit.splat);
    auto const point = on_host(unit.point);
    // a ray that sees the unit's own ball of 0.1 m is nearer than min_range: a miss
    bool const own = self == gsp::SelfFilter::none;
    double const wanted[2][3] = {{2, 4 / s, -1}, {4, 4 / s, -1}};
    for (int w = 0; w < worlds; ++w)
      for (int k = 0; k < 3; ++k) {
        double const want = own ? -1 : wanted[w][k];
        CHECK(double(range(w, k)) == doctest::Approx(want).epsilon(1e-5));
        bool const is_splat = !own && w == 0 && k == 0;
        CHECK(splat(w, k) == (is_splat ? 0 : -1));
        CHECK(geom(w, k) == (want < 0 || is_splat ? -1 : 0));
        CHECK(double(point(w, k, 0)) == doctest::Approx(want < 0 ? 0 : want * pattern.direction[std::size_t(k)][0]).epsilon(1e-5));
      }
    gsp::begin_ray_scan(exec, poses, unit);
    CHECK(on_host(unit.splat)(0, 0) == -1);
    CHECK(on_host(unit.range)(0, 0) == -1);
  }
  // Without a geom of its own in the way the unit sees the disc on its body.
  auto bare = gsp::make_ray_scene<float>(exec, model, compiled, {.worlds = worlds, .groups = 0});
  auto unit = gsp::make_ray_scan<float>(exec, compiled, pattern, {.body = "base"}, {.worlds = worlds, .self = gsp::SelfFilter::none});
  gsp::begin_ray_scan(exec, poses, unit);
  gsp::scan_rays(exec, bare, poses, unit, 0, gsp::splat_target(tree));
  auto const range = on_host(unit.range);
  CHECK(double(range(1, 1)) == doctest::Approx(std::sqrt(2.)).epsilon(1e-5));
  CHECK(double(range(1, 0)) == doctest::Approx(5).epsilon(1e-5));  // through the thin one
  // Bodies are hidden by the target's options or by the scan's self filter: one of them.
  gsp::begin_ray_scan(exec, poses, unit);
  gsp::scan_rays(exec, bare, poses, unit, 0, gsp::splat_target(tree, {.hidden = {.body_exclude = 1}}));
  CHECK(on_host(unit.range)(1, 1) == -1);
  CHECK(double(on_host(unit.range)(1, 0)) == doctest::Approx(5).epsilon(1e-5));
  auto filtered = gsp::make_ray_scan<float>(exec, compiled, pattern, {.body = "base"}, {.worlds = worlds});
  gsp::begin_ray_scan(exec, poses, filtered);
  CHECK_THROWS_WITH_AS(gsp::scan_rays(exec, bare, poses, filtered, 0, gsp::splat_target(tree, {.hidden = {.body_exclude = 0}})),
                       doctest::Contains("both splat_target's options and the scan's self filter hide bodies"), std::invalid_argument);
  set.body[4] = 2;
  CHECK_THROWS_WITH_AS(gsp::scan_rays(exec, bare, poses, unit, 1, gsp::splat_target(gsp::make_splat_tree(exec, set))),
                       doctest::Contains("gsp::scan_rays: the Gaussians name 3 bodies but the poses have 2"), std::invalid_argument);
}

// Pictures order Gaussians by the depth of their middles and take that for their depth; a ray takes the place where they respond most. On
// discs that are small beside the range the two are within 2 sigma of each other.
TEST_CASE_TEMPLATE("a scan and the median depth of a picture agree to 1 % on fine splats", Exec, GSP_TEST_EXECS) {
  auto const a = beside_picture<Exec>(ball_of_discs({0, 0, 0}, 3, 150000, 0.012, 0.001), {0.3, -0.2, 0.1}, 0.4, 0.1, 0);
  MESSAGE(a.pixels, " pixels; hit or miss as in the picture: ", a.same_hit, "; within 1 %: ", a.within_1, " of ", a.hits);
  CHECK(a.hits == a.pixels);
  CHECK(a.same_hit >= 0.9999 * a.pixels);
  CHECK(a.within_1 >= 0.99 * a.hits);
}

// What the issue of a captured room asks of rays: hit or miss as all Gaussians in double say for 99.99 % of rays, ranges to 1e-5; the rest
// is left to where a product comes within rounding of the half. Beside pictures: whether there is a return at all; depths only as well as a
// picture's are known, which order by middles (docs/splat/cast_splats.md has the figures).
TEST_CASE("rays in the kitchen" * doctest::test_suite("data")) {
  auto const path = gsp_test::data("splats/kitchen.spz");
  if (!path) return gsp_test::skip("splats/kitchen.spz is missing from GSP_DATA_DIR");
  using Exec = Kokkos::DefaultHostExecutionSpace;
  Exec const exec;
  auto const set = gsp::io::to_gaussian_set(gsp::io::read_splats(*path), *path);
  auto const tree = gsp::make_splat_tree(exec, set);
  auto const poses = gsp::make_poses<float>(exec, 1, 1, 0);
  auto const fine = gsp::make_poses<double>(exec, 1, 1, 0);
  gsp::detail::SplatCaster<float, Kokkos::HostSpace> const in_float{tree, poses, {}};
  gsp::detail::SplatCaster<double, Kokkos::HostSpace> const in_double{tree, fine, {}};
  std::vector<gsp::Transform<double>> const world{{{0, 0, 0}, gsp::identity_quat<double>()}};
  Reference const reference{set};
  gsp_test::Random random(8);
  int const count = 300;
  int met = 0;
  for (int k = 0; k < count; ++k) {
    gsp::Ray<float> const ray{{float(random.uniform(-1, 1)), float(random.uniform(-1.7, -1)), float(random.uniform(-.5, .5))},
                              {float(random.uniform(-1, 1)), float(random.uniform(-.3, .6)), float(random.uniform(-1, 1))}};
    auto const wide = [](gsp::Vec3<float> const& v) { return gsp::Vec3<double>{v.x, v.y, v.z}; };
    gsp::Ray<double> const same{wide(ray.origin), wide(ray.direction)};
    auto const want = reference.first(world, same);
    auto const a = in_double.first(same, 0, double(INFINITY));
    auto const b = in_float.first(ray, 0, float(INFINITY));
    met += want.gaussian >= 0;
    // records are rounded to float: 1e-6 of alphas
    if (want.margin > 1e-5) {
      CHECK(a.gaussian[0] == want.gaussian);
      if (want.gaussian >= 0) CHECK(a.distance == doctest::Approx(want.distance).epsilon(1e-6));
    }
    if (want.margin > 1e-4) {
      CHECK((b.gaussian[0] >= 0) == (want.gaussian >= 0));
      if (want.gaussian >= 0) CHECK(double(b.distance) == doctest::Approx(want.distance).epsilon(1e-5));
    }
  }
  CHECK(met > count / 3);
  // The picture's alphas are those of its projection, which is linear about each centre; without blur they are the ray's but for that.
  for (double const yaw : {0., 1.3, 2.7, 4.4}) {
    auto const a = beside_picture<Exec>(set, {0, -1.3, 0}, yaw, 0.15, 0);
    MESSAGE("yaw ", yaw, ": ", a.pixels, " pixels; hit or miss as in the picture: ", a.same_hit, "; within 1 %: ", a.within_1,
            ", 5 %: ", a.within_5, " of ", a.hits);
    CHECK(a.same_hit >= 0.995 * a.pixels);
    CHECK(a.within_1 >= 0.99 * a.hits);
    CHECK(a.within_5 >= 0.999 * a.hits);
  }
}

// Discs across x at 1 and 2 m, the second on a link that stands 1 m ahead; a wall at 4 m.
TEST_CASE("rays through Gaussians, as docs/splat/cast_splats.md has them") {
  using Exec = Kokkos::DefaultExecutionSpace;
  Exec const exec;
  int const worlds = 2;
  gsp::Description d;
  d.bodies[0].geoms.push_back({.name = "wall", .type = gsp::ShapeType::box, .size = {0.5, 9, 9}, .pos = {4.5, 0, 0}});
  int const link = gsp::add_body(d, 0, "link", {1, 0, 0});
  auto const compiled = gsp::compile(d);
  auto const model = gsp::make_model<float>(exec, compiled);
  auto const poses = gsp::make_poses<float>(exec, worlds, 2, 0);
  auto const x = on_host(poses.xpos);
  for (int w = 0; w < worlds; ++w) x(w, 1, 0) = 1;
  Kokkos::deep_copy(poses.xpos, x);
  gsp::GaussianSet room, robot;
  add(room, {2, 0, 0}, facing({1, 0, 0}), {0.05, 0.05, 0.001}, 0.99);
  add(robot, {0, 0, 0}, facing({1, 0, 0}), {0.05, 0.05, 0.001}, 0.99);
  robot.body[0] = link;
  // example-begin cast_splats
  auto const tree = gsp::make_splat_tree(exec, {room, robot});                    // once, of the sets that make_gaussians was given
  auto const rays = gsp::make_rays<float>(exec, {.worlds = worlds, .count = 3});  // write origin and direction, or mount_rays
  auto hits = gsp::make_splat_hits<float>(exec, {.worlds = worlds, .count = 3});
  // example-end cast_splats
  auto const o = on_host(rays.origin), way = on_host(rays.direction);
  for (int w = 0; w < worlds; ++w)
    for (int k = 0; k < 3; ++k) {
      way(w, k, 0) = 1;
      if (k == 1) o(w, k, 0) = 1.5f;
      if (k == 2) o(w, k, 1) = 1;
    }
  Kokkos::deep_copy(rays.origin, o);
  Kokkos::deep_copy(rays.direction, way);
  auto scene = gsp::make_ray_scene<float>(exec, model, compiled, {.worlds = worlds});
  gsp::place_ray_geoms(exec, model, poses, scene);
  auto met = gsp::make_ray_hits<float>(exec, {.worlds = worlds, .count = 3});
  // example-begin cast_splats_step
  gsp::cast_splats(exec, tree, poses, rays, hits);  // hits.distance, .gaussian; -1: nothing; .opacity

  gsp::cast_rays(exec, scene, rays, met);                         // and geoms:
  gsp::cast_splats(exec, tree, poses, rays, met.distance, hits);  // the nearer wins: hits.distance, of a geom where hits.gaussian is -1
  // example-end cast_splats_step
  auto const distance = on_host(hits.distance);
  auto const gaussian = on_host(hits.gaussian);
  float const wanted[] = {1, 0.5f, 4};
  for (int w = 0; w < worlds; ++w)
    for (int k = 0; k < 3; ++k) {
      CHECK(distance(w, k) == doctest::Approx(wanted[k]).epsilon(1e-6));
      CHECK(gaussian(w, k) == (k == 0 ? 1 : k == 1 ? 0 : -1));
    }
}
