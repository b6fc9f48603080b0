// Time of one pair in the narrow phase, by kind, one thread: 4,096 random placements of which most touch.
#include <gsp/collision/narrowphase.hpp>
#include <random>
#include <support/bench.hpp>
#include <vector>

using namespace gsp;

namespace {
struct Case {
  char const* name;
  ShapeType a, b;
};
template <class R>
struct Placement {
  Transform<R> a, b;
  Vec3<R> size_a, size_b;
};

template <class R>
void run(Case const& c, char const* precision) {
  int const n = 4096;
  std::mt19937 random(1);
  std::uniform_real_distribution<double> uniform(-1, 1);
  std::normal_distribution<double> gauss;
  auto const pose = [&](double spread) {
    auto const q = normalized(Quat<double>{gauss(random), gauss(random), gauss(random), gauss(random)});
    return Transform<R>{{R(spread * uniform(random)), R(spread * uniform(random)), R(spread * uniform(random))},
                        {R(q.w), R(q.x), R(q.y), R(q.z)}};
  };
  std::vector<Placement<R>> placements;
  for (int i = 0; i < n; ++i) placements.push_back({pose(0.05), pose(0.25), {R(0.2), R(0.3), R(0.25)}, {R(0.25), R(0.2), R(0.3)}});
  Kokkos::Serial const exec;
  auto const kind = pair_kind(c.a, c.b);
  long points = 0;
  double depth = 0;
  auto const time = gsp_bench::measure(exec, [&] {
    points = 0, depth = 0;
    for (auto const& p : placements) {
      ContactPoints<R, 8> out;
      gsp::narrowphase(kind, make_shape(p.a, p.size_a), make_shape(p.b, p.size_b), R(0), out);
      points += out.count;
      for (int i = 0; i < out.count; ++i) depth += out.point[i].dist;
    }
  });
  gsp_bench::Line("collision/narrowphase", exec)
      .add("pair", c.name)
      .add("precision", precision)
      .add(time)
      .add("ns_per_pair", 1e9 * time.median / n)
      .add("points_per_pair", double(points) / n)
      .add("mean_depth", depth / std::max(1L, points))
      .print();
}
}  // namespace

int main(int argc, char** argv) {
  Kokkos::ScopeGuard kokkos(argc, argv);
  using S = ShapeType;
  for (Case const& c :
       {Case{"plane-sphere", S::plane, S::sphere}, Case{"plane-capsule", S::plane, S::capsule},
        Case{"plane-cylinder", S::plane, S::cylinder}, Case{"plane-box", S::plane, S::box}, Case{"sphere-sphere", S::sphere, S::sphere},
        Case{"sphere-capsule", S::sphere, S::capsule}, Case{"sphere-cylinder", S::sphere, S::cylinder},
        Case{"sphere-box", S::sphere, S::box}, Case{"capsule-capsule", S::capsule, S::capsule},
        Case{"capsule-cylinder", S::capsule, S::cylinder}, Case{"capsule-box", S::capsule, S::box}, Case{"box-box", S::box, S::box}}) {
    run<float>(c, "float");
    run<double>(c, "double");
  }
}
