// Rays of a rotating unit of 64 rings by 1,719 columns through the Gaussians of a file (kitchen.spz of GSP_DATA_DIR/splats), float: from
// one place a world, anywhere in the middle of the room; a GPU 64 worlds. What a ray costs is counted on the host, with every 101st ray.
//   bench_splat_cast_splats [--columns N] [--worlds N] [--count-only] [FILE]
#include <cstdlib>
#include <gsp/io/gaussians.hpp>
#include <gsp/io/splats.hpp>
#include <gsp/splat/cast_splats.hpp>

#include "support/bench.hpp"

namespace {

struct Arguments {
  std::string file;
  int columns = 1719, worlds = 0;
  bool count_only = false;
};
constexpr int rings = 64;

struct Counts {
  long *passes, *gaussians;
  void pass() const { ++*passes; }
  void look_at(int n) const { *gaussians += n; }
};

/// A kernel, not a lambda: it is in a template's function.
template <class Mem>
struct Pattern {
  gsp::Rays<float, Mem> rays;
  int columns;
  KOKKOS_FUNCTION void operator()(std::int64_t i) const {
    int const count = rings * columns, k = int(i % count), w = int(i / count);
    float const up = (-24.8f + 26.8f * float(k % rings) / (rings - 1)) * 0.01745329f, turn = 6.2831853f * float(k / rings) / float(columns);
    // y is down in captures
    float const eye[3] = {Kokkos::sin(2.4f * w), -1.3f - 0.3f * Kokkos::cos(1.7f * w), 0.5f * Kokkos::sin(3.1f * w)};
    for (int c = 0; c < 3; ++c) rays.origin(w, k, c) = eye[c];
    rays.direction(w, k, 0) = Kokkos::cos(up) * Kokkos::cos(turn);
    rays.direction(w, k, 1) = -Kokkos::sin(up);
    rays.direction(w, k, 2) = Kokkos::cos(up) * Kokkos::sin(turn);
  }
};

template <class Exec>
void run(gsp::GaussianSet const& set, Arguments const& a, int worlds) {
  using Mem = typename Exec::memory_space;
  Exec const exec;
  int const count = rings * a.columns;
  auto const tree = gsp::make_splat_tree(exec, set);
  auto const poses = gsp::make_poses<float>(exec, worlds, 1, 0);
  auto const rays = gsp::make_rays<float>(exec, {.worlds = worlds, .count = count});
  Kokkos::parallel_for("gsp_bench::pattern",
                       Kokkos::RangePolicy<Exec, Kokkos::IndexType<std::int64_t>>(exec, 0, std::int64_t(worlds) * count),
                       Pattern<Mem>{rays, a.columns});
  auto hits = gsp::make_splat_hits<float>(exec, {.worlds = worlds, .count = count});
  auto const cast = [&] { gsp::cast_splats(exec, tree, poses, rays, hits); };
  cast();
  gsp_bench::Line line("splat/cast_splats", exec);
  line.add("gaussians", set.size()).add("worlds", worlds).add("rays", count).add("precision", "float");
  auto const gaussian = Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, hits.gaussian);
  long found = 0;
  for (int w = 0; w < worlds; ++w)
    for (int k = 0; k < count; ++k) found += gaussian(w, k) >= 0;
  line.add("hits", double(found) / worlds / count);
  if constexpr (!gsp::is_device<Exec>) {
    gsp::detail::SplatCaster<float, Mem> const caster{tree, poses, {}};
    long passes = 0, gaussians = 0, again = 0, counted = 0;
    for (int w = 0; w < worlds; ++w)
      for (int k = 0; k < count; k += 101, ++counted) {
        long const before = passes;
        float const *const o = &rays.origin(w, k, 0), *const d = &rays.direction(w, k, 0);
        caster.first(gsp::Ray<float>{{o[0], o[1], o[2]}, {d[0], d[1], d[2]}}, w, INFINITY, Counts{&passes, &gaussians});
        again += passes > before + 1;
      }
    line.add("gaussians_a_ray", double(gaussians) / counted)
        .add("passes_a_ray", double(passes) / counted)
        .add("rays_again", double(again) / counted);
  }
  if (!a.count_only) {
    auto const time = gsp_bench::measure(exec, cast);
    line.add(time).add("mrays_per_second", 1e-6 * worlds * count / time.median);
  }
  line.add_hash(hits.distance).print();
}

}  // namespace

int main(int argc, char** argv) {
  Kokkos::ScopeGuard const kokkos(argc, argv);
  Arguments a;
  a.file = gsp_bench::data_file("splats/kitchen.spz");
  for (int i = 1; i < argc; ++i) {
    std::string const word = argv[i];
    if (word == "--count-only")
      a.count_only = true;
    else if (word == "--columns" && i + 1 < argc)
      a.columns = std::max(1, std::atoi(argv[++i]));
    else if (word == "--worlds" && i + 1 < argc)
      a.worlds = std::max(1, std::atoi(argv[++i]));
    else
      a.file = word;
  }
  auto const set = gsp::io::to_gaussian_set(gsp::io::read_splats(a.file), a.file);
#ifdef KOKKOS_ENABLE_CUDA
  run<Kokkos::Cuda>(set, a, a.worlds > 0 ? a.worlds : 64);
#endif
  run<Kokkos::DefaultHostExecutionSpace>(set, a, a.worlds > 0 ? a.worlds : 1);
}
