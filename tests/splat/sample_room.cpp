#include <doctest/doctest.h>

#include <gsp/io/splat_set.hpp>
#include <gsp/splat/sample_room.hpp>

using namespace gsp;

namespace {

/// What a ray from `eye` lets through: every Gaussian counted with its greatest weight along the ray, which is what splatting approximates.
double transmittance(io::SplatSet const& s, Vec3<double> const& eye, Vec3<double> const& direction) {
  double through = 1;
  for (std::size_t i = 0; i < s.size(); ++i) {
    Vec3<double> const d = Vec3<double>{s.positions[3 * i], s.positions[3 * i + 1], s.positions[3 * i + 2]} - eye;
    double const along = dot(d, direction);
    if (along < 0.05 || dot(d, d) - along * along > 0.12) continue;
    Quat<double> const q{s.quats[4 * i], s.quats[4 * i + 1], s.quats[4 * i + 2], s.quats[4 * i + 3]};
    auto o = rotate_inverse(q, -d), r = rotate_inverse(q, direction);
    for (int k = 0; k < 3; ++k) o[k] /= s.scales[3 * i + k], r[k] /= s.scales[3 * i + k];
    double const t = -dot(o, r) / dot(r, r);
    auto const nearest = o + t * r;
    through *= 1 - s.opacities[i] * std::exp(-0.5 * dot(nearest, nearest));
  }
  return through;
}

}  // namespace

TEST_CASE("sample_room: what its page promises") {
  auto const room = sample_room<io::SplatSet>();
  CHECK_NOTHROW(io::validate(room, "room"));
  CHECK(room.size() >= 100000);
  CHECK(room.size() < 300000);
  CHECK(room.sh_degree == 1);
  MESSAGE(room.size() << " Gaussians");

  std::size_t glossy = 0;
  for (std::size_t i = 0; i < room.size(); ++i) {
    float const *p = &room.positions[3 * i], *h = &room.sh[12 * i];
    REQUIRE((std::abs(p[0]) < 3.1f && std::abs(p[1]) < 2.68f && p[2] > -0.01f && p[2] < 2.75f));
    if (p[2] > 0.02f && p[2] < 2.6f) REQUIRE(std::hypot(p[0], p[1]) > 1.15f);  // clear in the middle: 1.2 m less what a disc reaches
    glossy += h[3] != 0 || h[6] != 0 || h[9] != 0;
    for (int k = 0; k < 3; ++k) {  // colours of the first order stay small beside the middle
      float const first = std::hypot(h[3 + k], h[6 + k], h[9 + k]) * 0.4886f;
      REQUIRE(first <= 0.45f);
    }
  }
  CHECK(glossy > room.size() / 10);

  // Closed: no ray from inside leaves the room. Directions on a spiral.
  double worst = 0;
  for (Vec3<double> const eye : {Vec3<double>{0, 0, 0.5}, Vec3<double>{1.3, -0.9, 1.6}})
    for (int i = 0; i < 150; ++i) {
      double const z = 1 - (2 * i + 1.) / 150, r = std::sqrt(1 - z * z), a = 2.399963 * i;
      worst = std::max(worst, transmittance(room, eye, {r * std::cos(a), r * std::sin(a), z}));
    }
  CHECK(worst < 0.05);
}

TEST_CASE("sample_room: light comes from the window, furniture casts shadows, sheen follows the eye") {
  auto const room = sample_room<io::SplatSet>({.detail = 0.5});
  auto mean = [&](double x0, double x1, double y0, double y1) {  // mean green of the floor in a rectangle
    double sum = 0;
    int n = 0;
    for (std::size_t i = 0; i < room.size(); ++i) {
      float const* p = &room.positions[3 * i];
      if (p[2] == 0 && p[0] > x0 && p[0] < x1 && p[1] > y0 && p[1] < y1) sum += 0.5 + 0.28209479 * room.sh[12 * i + 1], ++n;
    }
    REQUIRE(n > 3);
    return sum / n;
  };
  double const sunny = mean(-0.6, 0.6, 1.0, 1.5), open = mean(1.3, 2.4, 0.2, 0.7), under_sofa = mean(-0.9, 0.3, -2.3, -1.8);
  CHECK(sunny > open + 0.1);
  CHECK(open > under_sofa + 0.1);

  // The floor seen against the window is brighter than seen along it.
  double against = 0, along = 0;
  for (std::size_t i = 0; i < room.size(); ++i) {
    float const *p = &room.positions[3 * i], *h = &room.sh[12 * i];
    if (p[2] != 0 || std::abs(p[0]) > 2 || p[1] < 1) continue;
    auto sheen = [&](double dy, double dz) { return 0.48860251 * (-dy * h[4] + dz * h[7]); };
    against += sheen(0.8, -0.6), along += sheen(-0.8, -0.6);
  }
  CHECK(against > along);
}

TEST_CASE("sample_room: the same options give the same Gaussians; detail and seed change them; nonsense is refused") {
  SampleRoomOptions const small{.detail = 0.3};
  auto const a = sample_room<io::SplatSet>(small), b = sample_room<io::SplatSet>(small),
             c = sample_room<io::SplatSet>({.detail = 0.3, .seed = 2});
  CHECK(a.positions == b.positions);
  CHECK(a.quats == b.quats);
  CHECK(a.scales == b.scales);
  CHECK(a.sh == b.sh);
  CHECK(a.sh != c.sh);
  CHECK(a.size() < sample_room<io::SplatSet>({.detail = 0.6}).size());
  CHECK_THROWS_AS(sample_room<io::SplatSet>({.detail = 0}), std::invalid_argument);
  CHECK_THROWS_AS(sample_room<io::SplatSet>({.detail = NAN}), std::invalid_argument);
}
