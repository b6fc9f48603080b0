#include <gsp/splat/show_sets.hpp>
// first, so that it stands by itself
#include <doctest/doctest.h>

#include <cstring>
#include <gsp/splat/id_channel.hpp>
#include <gsp/splat/render.hpp>
#include <gsp_test_execs.hpp>
#include <splat/scenes.hpp>
#include <support/kokkos_tools.hpp>

namespace {

using Bytes = std::vector<float>;
template <class Mem>
Bytes image(gsp::Frames<Mem> const& frames, int c) {
  Bytes out;
  auto const add = [&](auto const& view) {
    auto const host = Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, view);
    std::size_t const each = host.span() / host.extent(0);
    out.insert(out.end(), host.data() + std::size_t(c) * each, host.data() + std::size_t(c + 1) * each);
  };
  add(frames.rgb);
  add(frames.depth);
  add(frames.alpha);
  return out;
}
bool same_bits(Bytes const& a, Bytes const& b) {
  return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof(float)) == 0;
}
double light(Bytes const& a) {
  double sum = 0;
  for (float x : a) sum += x;
  return sum;
}

/// Two scenes of different degree, a robot, an object, and the first scene again in other colours: all its depths are ties.
std::vector<gsp::GaussianSet> five_sets() {
  std::vector<gsp::GaussianSet> sets{gsp_test::random_gaussians(900, 2, 1, 5), gsp_test::random_gaussians(700, 0, 1, 6),
                                     gsp_test::random_gaussians(400, 1, 3, 7), gsp_test::random_gaussians(300, 0, 1, 8)};
  for (int& b : sets[2].body) b += b == 0;
  for (int& b : sets[3].body) b = 2;
  sets.push_back(sets[0]);
  for (float& x : sets[4].sh) x = 0.5f - x;
  return sets;
}

struct WriteRow {
  Kokkos::View<int**, Kokkos::LayoutRight, Kokkos::DefaultExecutionSpace::memory_space> table;
  KOKKOS_FUNCTION void operator()(int) const {
    table(0, 0) = 1;
    table(0, 1) = 3;
  }
};

}  // namespace

TEST_CASE_TEMPLATE("a world's picture has the bits of the cloud of its sets alone", Exec, GSP_TEST_EXECS) {
  Exec const exec = gsp_test::other_instance(Exec{});
  int const width = 150, height = 90;
  auto const sets = five_sets();
  std::vector<std::vector<int>> const table{{0, 2}, {3, 1, 2}, {}, {3}, {4, 0}, {0, 1, 2, 3, 4}};
  int const worlds = int(table.size()), bodies = 3;
  std::vector<float> viewmats, Ks;
  gsp_test::random_cameras(worlds, width, height, 2, 4, viewmats, Ks);
  std::vector<std::vector<gsp::Transform<double>>> unused;
  auto const poses = gsp_test::random_poses<float>(exec, worlds, bodies, 9, unused);
  auto const cameras = gsp::make_cameras(exec, viewmats, Ks);
  auto const all = gsp::make_gaussians(exec, sets), cloud = gsp::show_sets(exec, all, table);
  CHECK(cloud.positions.data() == all.positions.data());  // shared
  for (int batch : {0, 4}) {
    auto frames = gsp::make_frames(exec, cloud, {.images = worlds, .width = width, .height = height, .batch = batch});
    gsp::render(exec, cloud, poses, cameras, frames);
    auto whole = gsp::make_frames(exec, all, {.images = worlds, .width = width, .height = height, .batch = batch});
    gsp::render(exec, all, poses, cameras, whole);
    CHECK(same_bits(image(whole, 5), image(frames, 5)));  // what shows all is what has no table
    CHECK(!same_bits(image(whole, 0), image(frames, 0)));
    gsp::render(exec, cloud, poses, cameras, whole);  // frames for all have room for some
    for (int w = 0; w < worlds; ++w) {
      std::vector<gsp::GaussianSet> own;
      for (std::size_t s = 0; s < sets.size(); ++s)
        if (std::find(table[w].begin(), table[w].end(), int(s)) != table[w].end()) own.push_back(sets[s]);
      auto const alone = gsp::make_gaussians(exec, own);
      auto one = gsp::make_frames(exec, alone, {.images = 1, .width = width, .height = height});
      auto const camera = gsp::make_cameras(exec, {viewmats.begin() + 16 * w, viewmats.begin() + 16 * w + 16},
                                            {Ks.begin() + 9 * w, Ks.begin() + 9 * w + 9}, {w});
      gsp::render(exec, alone, poses, camera, one);
      CHECK(same_bits(image(one, 0), image(frames, w)));
      CHECK(same_bits(image(one, 0), image(whole, w)));
      CHECK((light(image(one, 0)) > 0) == (w != 2));
    }
  }
}

TEST_CASE_TEMPLATE("a world asks for no cluster of a set that it does not show", Exec, GSP_TEST_EXECS) {
  Exec const exec;
  std::vector<gsp::GaussianSet> sets;
  for (int k = 0; k < 100; ++k) sets.push_back(gsp_test::random_gaussians(600 + k, 0, 1, unsigned(k)));
  sets.push_back(gsp_test::random_gaussians(300, 0, 2, 100));
  sets.push_back({});
  auto const all = gsp::make_gaussians(exec, sets);
  std::vector<std::vector<int>> table;
  for (int w = 0; w < 300; ++w) table.push_back({w % 100, 100, 101});
  auto const cloud = gsp::show_sets(exec, all, table);
  CHECK(all.most_clusters >= 302);  // three of each scene, and two bodies
  CHECK(cloud.most_clusters <= 9);  // of the three largest sets
  CHECK(cloud.most_count == 999);
  auto const clusters = gsp::detail::to_host(exec, cloud.clusters);
  auto const ranges = gsp::detail::to_host(exec, cloud.sets);
  gsp::Gaussians<Kokkos::HostSpace> host;
  host.shown = Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, cloud.shown);
  host.sets = Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, cloud.sets);
  std::vector<int> first{0};  // source, of each set
  for (auto const& s : sets) first.push_back(first.back() + int(s.size()));
  auto const source = gsp::detail::to_host(exec, cloud.source);
  for (int w = 0; w < 300; w += 37) {
    std::vector<int> seen(std::size_t(all.count), 0);
    for (int k = 0; k < cloud.most_clusters; ++k) {
      int const c = host.cluster_of(w, k);
      if (c < 0) continue;
      for (int i = clusters[std::size_t(c)].begin; i < clusters[std::size_t(c)].end; ++i) ++seen[std::size_t(source[std::size_t(i)])];
    }
    int wrong = 0;
    for (int i = 0; i < all.count; ++i) {
      bool const own = (i >= first[std::size_t(w % 100)] && i < first[std::size_t(w % 100) + 1]) || i >= first[100];
      wrong += seen[std::size_t(i)] != int(own);
    }
    CHECK(wrong == 0);
  }
  // buffers are for what is shown: a hundred scenes take as much as one
  auto const one = gsp::make_gaussians(exec, {sets[99], sets[100]});
  gsp::FrameOptions const options{.images = 64, .width = 64, .height = 64, .rgb = false, .depth = false, .alpha = false, .batch = 64};
  if (gsp::is_device<Exec>) CHECK(gsp::bytes_needed(exec, cloud, options) <= gsp::bytes_needed(exec, one, options) + 64 * 8);
  auto const again = gsp::show_sets(exec, cloud, {});
  CHECK(again.most_clusters == all.most_clusters);
  CHECK(again.most_count == all.count);
}

TEST_CASE("a kernel gives a world another scene") {
  Kokkos::DefaultExecutionSpace const exec;
  auto const all = gsp::make_gaussians(exec, five_sets());
  auto const cloud = gsp::show_sets(exec, all, {{0, 2}, {0, 2}}), other = gsp::show_sets(exec, all, {{1, 3}, {0, 2}});
  std::vector<float> viewmats, Ks;
  gsp_test::random_cameras(2, 64, 48, 2, 4, viewmats, Ks);
  std::vector<std::vector<gsp::Transform<double>>> unused;
  auto const poses = gsp_test::random_poses<float>(exec, 2, 3, 9, unused);
  auto const cameras = gsp::make_cameras(exec, viewmats, Ks);
  auto a = gsp::make_frames(exec, cloud, {.images = 2, .width = 64, .height = 48}),
       b = gsp::make_frames(exec, other, {.images = 2, .width = 64, .height = 48});
  gsp::render(exec, cloud, poses, cameras, a);
  gsp::render(exec, other, poses, cameras, b);
  CHECK(!same_bits(image(a, 0), image(b, 0)));
  Kokkos::parallel_for("gsp_test::write", Kokkos::RangePolicy<Kokkos::DefaultExecutionSpace>(exec, 0, 1), WriteRow{cloud.shown});
  gsp::render(exec, cloud, poses, cameras, a);
  CHECK(same_bits(image(a, 0), image(b, 0)));
  CHECK(same_bits(image(a, 1), image(b, 1)));
}

TEST_CASE("tables that cannot be are refused in a sentence") {
  Kokkos::Serial const exec;
  auto const all = gsp::make_gaussians(exec, five_sets());
  CHECK_THROWS_WITH_AS(gsp::show_sets(exec, all, {{0}, {1, 5}}),
                       doctest::Contains("world 1 names set 5, and there are 5, numbered from 0 as they were given"),
                       std::invalid_argument);
  CHECK_THROWS_WITH_AS(gsp::show_sets(exec, all, {{-1}}), doctest::Contains("world 0 names set -1"), std::invalid_argument);
  CHECK_THROWS_WITH_AS(gsp::show_sets(exec, all, {{2, 0, 2}}), doctest::Contains("world 0 names set 2 twice"), std::invalid_argument);
  auto const cloud = gsp::show_sets(exec, all, {{0}, {1}});
  std::vector<float> viewmats, Ks;
  gsp_test::random_cameras(3, 32, 32, 2, 4, viewmats, Ks);
  auto frames = gsp::make_frames(exec, cloud, {.images = 3, .width = 32, .height = 32});
  auto const poses = gsp::make_poses<float>(exec, 3, 3, 0);
  CHECK_THROWS_WITH_AS(gsp::render(exec, cloud, poses, gsp::make_cameras(exec, viewmats, Ks), frames),
                       doctest::Contains("the table of shown sets has 2 worlds, the poses have 3"), std::invalid_argument);
  CHECK_THROWS_AS(gsp::render(exec, all, poses, gsp::make_cameras(exec, viewmats, Ks), frames), std::invalid_argument);  // too small
}

TEST_CASE_TEMPLATE("scenes and robots of a batch", Exec, GSP_TEST_EXECS) {
  Exec const exec;
  auto const kitchen = gsp_test::random_gaussians(500, 0, 1, 1), office = gsp_test::random_gaussians(500, 0, 1, 2),
             robot = gsp_test::random_gaussians(200, 0, 3, 3);
  auto const poses = gsp::make_poses<float>(exec, 4, 3, 0);
  std::vector<float> viewmats, Ks;
  gsp_test::random_cameras(4, 64, 48, 2, 4, viewmats, Ks);
  auto const cameras = gsp::make_cameras(exec, viewmats, Ks);
  // example-begin show_sets
  auto const all = gsp::make_gaussians(exec, {kitchen, office, robot});                   // sets 0, 1 and 2
  auto const cloud = gsp::show_sets(exec, all, {{0, 2}, {1, 2}, {0, 2}, {1, 2}});         // of each world
  auto frames = gsp::make_frames(exec, cloud, {.images = 4, .width = 64, .height = 48});  // image w shows world w
  gsp::render(exec, cloud, poses, cameras, frames);
  // example-end show_sets
  CHECK(light(image(frames, 0)) > 0);
}
