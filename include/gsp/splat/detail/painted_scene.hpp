#pragma once
#include <cmath>
#include <cstdint>
#include <functional>
#include <gsp/math/quat.hpp>
#include <limits>
#include <numbers>
#include <vector>

/// Scenes that are painted: surfaces (rectangles, boxes, frustums, ellipsoids, leaves) covered by flat Gaussians, lit once by a window, the
/// sun through it, lamps and the sky that a point can see, with shadows by rays against analytic shapes. Host, double, no randomness but
/// hashes: the same scene everywhere.
namespace gsp::detail {

using Point = Vec3<double>;

inline Point mul(Point const& a, Point const& b) { return {a.x * b.x, a.y * b.y, a.z * b.z}; }
inline Point mix(Point const& a, Point const& b, double t) { return a + t * (b - a); }
inline double saturate(double x) { return x < 0 ? 0 : x > 1 ? 1 : x; }
inline double smooth_step(double a, double b, double x) {
  double const t = saturate((x - a) / (b - a));
  return t * t * (3 - 2 * t);
}

/// A number in [0, 1) for an integer triple.
inline double hash01(int x, int y, int seed) {
  std::uint32_t h = static_cast<std::uint32_t>(x) * 0x9e3779b1u ^ static_cast<std::uint32_t>(y) * 0x85ebca77u ^
                    static_cast<std::uint32_t>(seed) * 0xc2b2ae3du;
  h ^= h >> 15;
  h *= 0x2c1b3c6du;
  h ^= h >> 12;
  h *= 0x297a2d39u;
  h ^= h >> 15;
  return h * (1. / 4294967296.);
}
/// Smooth noise in [0, 1), cells of size 1.
inline double noise(double x, double y, int seed) {
  double const fx = std::floor(x), fy = std::floor(y), u = smooth_step(0, 1, x - fx), v = smooth_step(0, 1, y - fy);
  int const i = static_cast<int>(fx), j = static_cast<int>(fy);
  double const a = hash01(i, j, seed), b = hash01(i + 1, j, seed), c = hash01(i, j + 1, seed), d = hash01(i + 1, j + 1, seed);
  return a + u * (b - a) + v * (c - a + u * (a - b - c + d));
}
inline double fractal_noise(double x, double y, int seed) {
  return 0.5333 * noise(x, y, seed) + 0.2667 * noise(2.03 * x, 2.03 * y, seed + 1) + 0.1333 * noise(4.1 * x, 4.1 * y, seed + 2) +
         0.0667 * noise(8.2 * x, 8.2 * y, seed + 3);
}

/// What a point of a surface looks like. Colours are linear, 0..1 (albedo) or beyond (glow).
struct Paint {
  Point albedo{.5, .5, .5};
  double gloss = 0;  // strength of the window's reflection
  Point glow{0, 0, 0};
  bool none = false;  // leave the point out
};
using Painter = std::function<Paint(double u, double v)>;  // coordinates in the surface [m], from its middle
inline Painter plain(Point albedo, double gloss = 0) {
  return [=](double, double) { return Paint{albedo, gloss}; };
}

/// Casts shadows: a box, ellipsoid or upright cylinder, turned about z.
struct Blocker {
  enum class Kind { box, ellipsoid, cylinder } kind;
  Point center, half;
  double cosine = 1, sine = 0;
};

/// Distance along the ray to the blocker, or infinity. d need not be of unit length.
inline double hit(Blocker const& b, Point origin, Point direction) {
  constexpr double infinity = std::numeric_limits<double>::infinity();
  auto const turn = [&](Point const& p) { return Point{b.cosine * p.x + b.sine * p.y, b.cosine * p.y - b.sine * p.x, p.z}; };
  Point o = turn(origin - b.center), d = turn(direction);
  double enter = 0, leave = infinity;
  auto const slab = [&](double x, double dx, double half) {
    if (std::abs(dx) < 1e-12) {
      if (std::abs(x) > half) leave = -1;
      return;
    }
    double const a = (-half - x) / dx, c = (half - x) / dx;
    enter = std::max(enter, std::min(a, c));
    leave = std::min(leave, std::max(a, c));
  };
  if (b.kind == Blocker::Kind::box) {
    slab(o.x, d.x, b.half.x);
    slab(o.y, d.y, b.half.y);
    slab(o.z, d.z, b.half.z);
    return enter <= leave ? enter : infinity;
  }
  o = {o.x / b.half.x, o.y / b.half.y, o.z / b.half.z};
  d = {d.x / b.half.x, d.y / b.half.y, d.z / b.half.z};
  if (b.kind == Blocker::Kind::cylinder) {
    slab(o.z, d.z, 1);
    o.z = d.z = 0;
  }
  double const a = dot(d, d), h = dot(o, d), c = dot(o, o) - 1;
  if (a < 1e-12) return c <= 0 && enter <= leave ? enter : infinity;
  double const q = h * h - a * c;
  if (q < 0) return infinity;
  enter = std::max(enter, (-h - std::sqrt(q)) / a);
  leave = std::min(leave, (-h + std::sqrt(q)) / a);
  return enter <= leave ? enter : infinity;
}

/// Where light comes from. The room is a box of half sizes `half` about (0, 0, half.z); the window is a rectangle of its wall y = half.y.
struct Lighting {
  Point room_half{3, 2.5, 1.35};
  Point window_center{0.6, 2.5, 1.55};
  double window_half_x = 1.1, window_half_z = 0.8, bars = 2;  // bars: panes across
  Point sky{2.1, 2.3, 2.6}, sun{5.2, 4.6, 3.6}, sun_direction{0.28, 0.74, 0.61};
  Point ambient{0.40, 0.38, 0.35};
  struct Lamp {
    Point position, power;
  };
  std::vector<Lamp> lamps;
};

struct Light {
  Point radiance{0, 0, 0};
  double window = 0;  // the part of the window that is seen
};

/// The rotation whose matrix has the columns x, y, z (orthonormal, right-handed), by the largest of the four candidates (Shepperd 1978).
inline Quat<double> from_axes(Point const& x, Point const& y, Point const& z) {
  double const trace = x.x + y.y + z.z;
  Quat<double> q;
  if (trace > 0)
    q = {1 + trace, y.z - z.y, z.x - x.z, x.y - y.x};
  else if (x.x > y.y && x.x > z.z)
    q = {y.z - z.y, 1 + x.x - y.y - z.z, y.x + x.y, z.x + x.z};
  else if (y.y > z.z)
    q = {z.x - x.z, y.x + x.y, 1 - x.x + y.y - z.z, z.y + y.z};
  else
    q = {x.y - y.x, z.x + x.z, z.y + y.z, 1 - x.x - y.y + z.z};
  return normalized(q);
}

/// A Gaussian of the scene, lit: what the room generator stores.
struct Disc {
  Point position, normal, tangent;
  double extent_u, extent_v, extent_n;  // standard deviations [m]
  double opacity;
  Point color;  // as displayed, 0..1
  Point sheen;  // colour change per unit of (view direction . sheen direction)
  Point sheen_direction;
};

/// Collects surfaces and blockers, then lights them.
class PaintedScene {
 public:
  explicit PaintedScene(Lighting lighting, double detail) : light_(std::move(lighting)), detail_(detail) {
    light_.sun_direction = normalized(light_.sun_direction);
    for (int i = 0; i < hemisphere_count; ++i) {  // cosine-distributed: a spiral on the unit disc, lifted
      double const r = std::sqrt((i + 0.5) / hemisphere_count), angle = i * std::numbers::pi * (3 - std::sqrt(5.));
      hemisphere_.push_back({r * std::cos(angle), r * std::sin(angle), std::sqrt(1 - r * r)});
    }
  }

  struct Grid {
    double step_u = 0.03, step_v = 0.03;  // distance of discs [m]
    double map_step = 0.06;               // distance of the points where light is computed
    bool inset = true;  // its silhouette ends where the rectangle does; false: discs reach a little beyond (walls, which close corners)
    double opacity = 0.985;
    double spread =
        0.68;  // standard deviation of a disc in steps: four neighbours leave 3 % open in their middle, the ring round them half of that
  };

  /// A rectangle: unit vectors u, v, half lengths. Its front is u x v.
  void rectangle(Point const& center, Point const& u, Point const& v, double half_u, double half_v, Grid const& grid,
                 Painter const& painter) {
    patches_.push_back({center, u, v, half_u, half_v, grid, painter});
  }

  enum Faces { top = 1, bottom = 2, front = 4, back = 8, left = 16, right = 32, all = 63, sides = 60 };
  /// A box turned by yaw about z: front is its -y side. Also casts a shadow unless told not to.
  void box(Point const& c, Point const& h, double yaw, double step, Painter const& painter, int faces = all & ~bottom, bool shadow = true,
           double stretch = 1) {
    double const cs = std::cos(yaw), sn = std::sin(yaw);
    Point const x{cs, sn, 0}, y{-sn, cs, 0}, z{0, 0, 1};
    auto const face = [&](bool wanted, Point const& n, Point const& u, Point const& v, double hn, double hu, double hv) {
      if (!wanted) return;
      Grid grid{step, step, std::max(0.07, std::min({0.14, hu, hv}))};
      (hu > hv ? grid.step_u : grid.step_v) *= stretch;  // long grain
      rectangle(c + hn * n, u, v, hu, hv, grid, painter);
    };
    face(faces & top, z, x, y, h.z, h.x, h.y);
    face(faces & bottom, -z, y, x, h.z, h.y, h.x);
    face(faces & front, -y, x, z, h.y, h.x, h.z);
    face(faces & back, y, -x, z, h.y, h.x, h.z);
    face(faces & left, -x, -y, z, h.x, h.y, h.z);
    face(faces & right, x, y, z, h.x, h.y, h.z);
    if (shadow) block({Blocker::Kind::box, c, h, cs, sn});
  }

  /// Upright frustum on `base`: radii at its foot and top, height. u runs round it, v up from the middle.
  void frustum(Point const& base, double r0, double r1, double height, double step, Painter const& painter, bool cap_top = true,
               bool shadow = true) {
    double const slope = (r0 - r1) / height, length = std::sqrt(height * height + (r0 - r1) * (r0 - r1));
    int const rows = count(length, step);
    for (int j = 0; j < rows; ++j) {
      double const t = (j + 0.5) / rows, r = r0 + t * (r1 - r0);
      int const n = std::max(8, count(2 * std::numbers::pi * r, step));
      for (int i = 0; i < n; ++i) {
        double const a = 2 * std::numbers::pi * (i + 0.5 * (j & 1)) / n;
        Point const out{std::cos(a), std::sin(a), 0}, tangent{-out.y, out.x, 0};
        free_disc(base + Point{r * out.x, r * out.y, t * height}, normalized(out + Point{0, 0, slope}), tangent,
                  spread * 2 * std::numbers::pi * r / n, spread * length / rows, painter(a * r, (t - 0.5) * height));
      }
    }
    if (cap_top) {
      int const rings = std::max(1, count(r1, step));
      for (int j = 0; j < rings; ++j) {
        double const r = (j + 0.35) * r1 / rings;
        int const n = std::max(3, count(2 * std::numbers::pi * r, step));
        for (int i = 0; i < n; ++i) {
          double const a = 2 * std::numbers::pi * (i + 0.5 * (j & 1)) / n;
          Point const at{r * std::cos(a), r * std::sin(a), height};
          free_disc(base + at, {0, 0, 1}, {1, 0, 0}, spread * r1 / rings, spread * r1 / rings, painter(at.x, at.y));
        }
      }
    }
    if (shadow) block({Blocker::Kind::cylinder, base + Point{0, 0, height / 2}, {0.5 * (r0 + r1), 0.5 * (r0 + r1), height / 2}});
  }

  /// Rounded box |x/a|^e + |y/b|^e + |z/c|^e = 1 (e = 2: ellipsoid), turned by yaw and then tilted about its own x axis. u, v: longitude
  /// and latitude [rad].
  void rounded(Point const& center, Point const& half, double exponent, double yaw, double tilt, double step, Painter const& painter,
               bool shadow = true) {
    double const cs = std::cos(yaw), sn = std::sin(yaw), ct = std::cos(tilt), st = std::sin(tilt);
    auto const turn = [&](Point const& p) {
      Point const q{p.x, ct * p.y - st * p.z, st * p.y + ct * p.z};
      return Point{cs * q.x - sn * q.y, sn * q.x + cs * q.y, q.z};
    };
    // A spiral of directions, pushed out to the surface; density follows from r^2 / cos(normal, direction), so discs get their size from
    // it.
    double const mean = std::cbrt(half.x * half.y * half.z), area = 4 * std::numbers::pi * mean * mean * (exponent > 2 ? 1.9 : 1.25);
    int const n = std::max(24, static_cast<int>(area * detail_ * detail_ / (step * step)));
    for (int i = 0; i < n; ++i) {
      double const z = 1 - (2 * i + 1.) / n, r = std::sqrt(1 - z * z), a = i * std::numbers::pi * (3 - std::sqrt(5.));
      Point const d = mul({r * std::cos(a), r * std::sin(a), z}, half);  // directions stretched with the shape
      double const k = std::pow(std::pow(std::abs(d.x / half.x), exponent) + std::pow(std::abs(d.y / half.y), exponent) +
                                    std::pow(std::abs(d.z / half.z), exponent),
                                -1 / exponent);
      Point const p = k * d;
      auto const slope = [&](double x, double h) { return std::copysign(std::pow(std::abs(x / h), exponent - 1) / h, x); };
      Point const normal = normalized(Point{slope(p.x, half.x), slope(p.y, half.y), slope(p.z, half.z)});
      double const patch = 4 * std::numbers::pi / n * half.x * half.y * half.z * k * k * k /
                           std::max(0.15 * norm(p), dot(p, normal));  // area that the disc stands for
      Point const tangent = normalized(cross(std::abs(normal.z) < 0.9 ? Point{0, 0, 1} : Point{1, 0, 0}, normal));
      double const size = spread * std::sqrt(patch) * 1.05;
      free_disc(center + turn(p), turn(normal), turn(tangent), size, size, painter(std::atan2(p.y, p.x), std::asin(z)));
    }
    // The blocker keeps inside the surface, else it would darken it; blockers do not tilt.
    if (shadow)
      block({exponent > 2 && tilt == 0 ? Blocker::Kind::box : Blocker::Kind::ellipsoid, center,
             (exponent == 2               ? 1.
              : exponent > 4 && tilt == 0 ? 0.88
                                          : 0.78) *
                 half,
             cs, sn});
  }

  /// One disc of its own (leaves, fringes, lines).
  void disc(Point const& p, Point const& normal, Point const& tangent, double extent_u, double extent_v, Paint const& paint,
            double opacity = 0.97) {
    free_.push_back({p, normal, tangent, extent_u, extent_v, opacity, paint});
  }

  void block(Blocker const& b) {
    if (groups_.empty() || closed_) {
      groups_.push_back({{}, 0, static_cast<int>(blockers_.size()), 0});
      closed_ = false;
    }
    blockers_.push_back(b);
    ++groups_.back().count;
  }
  /// Blockers that follow stand together (a piece of furniture): rays that miss their bounding sphere miss them all.
  void next_group() { closed_ = true; }

  /// All discs with their light.
  std::vector<Disc> lit() {
    bound_groups();
    std::vector<Disc> out;
    for (auto const& p : patches_) light_patch(p, out);
    for (auto const& f : free_)
      shade(f.position, f.normal, f.tangent, f.extent_u, f.extent_v, f.opacity, f.paint,
            light_at(f.position + 0.004 * f.normal, f.normal, 12), out);
    return out;
  }

 private:
  static constexpr double spread = 0.68;
  static constexpr int hemisphere_count = 40;
  struct Patch {
    Point center, u, v;
    double half_u, half_v;
    Grid grid;
    Painter painter;
  };
  struct Free {
    Point position, normal, tangent;
    double extent_u, extent_v, opacity;
    Paint paint;
  };
  struct Group {
    Point center;
    double radius;
    int first, count;
  };

  int count(double length, double step) const { return std::max(1, static_cast<int>(std::lround(length * detail_ / step))); }
  void free_disc(Point const& p, Point const& n, Point const& t, double su, double sv, Paint const& paint) {
    if (!paint.none) disc(p, n, t, su, sv, paint, 0.985);
  }

  void bound_groups() {
    for (auto& g : groups_) {
      Point low{1e9, 1e9, 1e9}, high{-1e9, -1e9, -1e9};
      for (int i = g.first; i < g.first + g.count; ++i) {
        auto const& b = blockers_[i];
        double const x = std::abs(b.cosine) * b.half.x + std::abs(b.sine) * b.half.y,
                     y = std::abs(b.sine) * b.half.x + std::abs(b.cosine) * b.half.y;
        Point const h{x, y, b.half.z};
        for (int k = 0; k < 3; ++k) {
          low[k] = std::min(low[k], b.center[k] - h[k]);
          high[k] = std::max(high[k], b.center[k] + h[k]);
        }
      }
      g.center = 0.5 * (low + high);
      g.radius = 0.5 * norm(high - low);
    }
  }

  /// Groups that rays from o into the half space of n can meet within reach.
  void near_groups(Point const& o, Point const& n, double reach, std::vector<Group>& out) const {
    out.clear();
    for (auto const& g : groups_) {
      Point const m = g.center - o;
      if (dot(m, n) > -g.radius && dot(m, m) < (reach + g.radius) * (reach + g.radius)) out.push_back(g);
    }
  }

  /// Distance to the nearest blocker of these groups along the unit direction, `reach` where there is none before; any: the first that is
  /// found.
  double distance(std::vector<Group> const& groups, Point const& o, Point const& d, double reach, bool any = false) const {
    for (auto const& g : groups) {
      Point const m = g.center - o;
      double const along = dot(m, d), off = dot(m, m) - along * along;
      if (off > g.radius * g.radius || along < -g.radius || along - g.radius > reach) continue;
      for (int i = g.first; i < g.first + g.count; ++i) {
        auto const& b = blockers_[i];
        Point const c = b.center - o;
        double const on = dot(c, d);
        if (dot(c, c) - on * on > dot(b.half, b.half)) continue;
        double const t = hit(b, o, d);
        if (t < reach) {
          if (any) return t;
          reach = t;
        }
      }
    }
    return reach;
  }

  double to_room(Point const& o, Point const& d) const {
    double t = 1e9;
    Point const low{-light_.room_half.x, -light_.room_half.y, 0}, high{light_.room_half.x, light_.room_half.y, 2 * light_.room_half.z};
    for (int k = 0; k < 3; ++k)
      if (std::abs(d[k]) > 1e-9) t = std::min(t, std::max(0., ((d[k] > 0 ? high[k] : low[k]) - o[k]) / d[k]));
    return t;
  }

  /// Light that falls on a point (irradiance / pi): window by samples, sky by cosine-distributed rays that count near hits as dark, lamps.
  Light light_at(Point const& p, Point const& n, int samples_x) {
    Light out;
    int const nx = samples_x > 12 ? 8 : 5, nz = samples_x > 12 ? 5 : 4;
    double const area = 4 * light_.window_half_x * light_.window_half_z, reach = 1.6;
    near_groups(p, n, 100, near_);
    for (int i = 0; i < nx; ++i)
      for (int j = 0; j < nz; ++j) {
        Point const s =
            light_.window_center + Point{light_.window_half_x * ((2 * i + 1.) / nx - 1), 0, light_.window_half_z * ((2 * j + 1.) / nz - 1)};
        Point const d = s - p;
        double const r = norm(d), cosine = dot(d, n) / r, cosine_window = d.y / r;
        if (cosine <= 0 || cosine_window <= 0 || r < 0.05) continue;
        if (distance(near_, p, (1 / r) * d, r, true) < r) continue;
        out.window += 1. / (nx * nz);
        out.radiance += (cosine * cosine_window * area / (std::numbers::pi * std::max(r * r, 0.15) * nx * nz)) * light_.sky;
      }
    Point const t = normalized(cross(std::abs(n.z) < 0.9 ? Point{0, 0, 1} : Point{1, 0, 0}, n)), b = cross(n, t);
    double open = 0;
    near_groups(p, n, reach, near_);
    for (auto const& h : hemisphere_) {
      Point const d = h.x * t + h.y * b + h.z * n;
      double const seen = distance(near_, p, d, std::min(reach, to_room(p, d)));
      open += 0.22 + 0.78 * smooth_step(0, reach, seen);
    }
    out.radiance += (open / hemisphere_count * (1 + 0.12 * n.z)) * light_.ambient;
    for (auto const& lamp : light_.lamps) {
      Point const d = lamp.position - p;
      double const r2 = dot(d, d), cosine = dot(d, n) / std::sqrt(r2);
      out.radiance += (std::max(0., 0.25 + 0.75 * cosine) / (r2 + 0.12)) * lamp.power;
    }
    return out;
  }

  /// The sun at a point: through the panes of the window, not behind anything.
  double sun_at(Point const& p, Point const& n) const {
    Point const s = light_.sun_direction;
    double const cosine = dot(s, n);
    if (cosine <= 0) return 0;
    double const t = (light_.window_center.y - p.y) / s.y;
    if (t <= 0) return 0;
    double const x = p.x + t * s.x - light_.window_center.x, z = p.z + t * s.z - light_.window_center.z;
    double const soft = 0.006 + 0.004 * t;
    auto const inside = [&](double d) { return smooth_step(-soft, soft, d); };
    double pane = inside(light_.window_half_x - std::abs(x)) * inside(light_.window_half_z - std::abs(z));
    double const width = 2 * light_.window_half_x / light_.bars, off = std::abs(std::remainder(x + light_.window_half_x, width));
    pane *= inside(off - 0.03) * inside(std::abs(z - 0.28) - 0.025);  // the bars
    if (pane <= 0 || distance(groups_, p, s, t, true) < t) return 0;
    return pane * cosine;
  }

  void shade(Point const& p, Point const& n, Point const& t, double su, double sv, double opacity, Paint const& paint, Light const& light,
             std::vector<Disc>& out) const {
    Point const sun = sun_at(p + 0.004 * n, n) * light_.sun;
    Point const linear = mul(paint.albedo, light.radiance + sun) + paint.glow;
    auto const display = [](double x) { return std::pow(1 - std::exp(-1.35 * x), 1 / 2.2); };  // soft shoulder, then gamma
    Disc d{p, n, t, su, sv, 0.0012, opacity, {display(linear.x), display(linear.y), display(linear.z)}, {0, 0, 0}, {0, 0, 1}};
    if (paint.gloss > 0) {
      // Mirrored view direction r = d - 2 (d.n) n towards the window's direction l: r.l = d.l', l' = l - 2 (l.n) n. Linear in d, which SH
      // of degree 1 holds exactly.
      Point const l = normalized(light_.window_center - p);
      d.sheen_direction = l - (2 * dot(l, n)) * n;
      d.sheen = (paint.gloss * (0.15 + 0.85 * light.window)) * Point{0.95, 1, 1.06};
    }
    out.push_back(d);
  }

  void light_patch(Patch const& patch, std::vector<Disc>& out) {
    Point const n = cross(patch.u, patch.v);
    auto const& g = patch.grid;
    int const mu = std::max(1, static_cast<int>(std::ceil(2 * patch.half_u / g.map_step))),
              mv = std::max(1, static_cast<int>(std::ceil(2 * patch.half_v / g.map_step)));
    std::vector<Light> map(static_cast<std::size_t>(mu + 1) * (mv + 1));
    double const in_u = std::max(0.5 * patch.half_u, patch.half_u - 0.012), in_v = std::max(0.5 * patch.half_v, patch.half_v - 0.012);
    for (int j = 0; j <= mv; ++j)
      for (int i = 0; i <= mu; ++i)
        map[static_cast<std::size_t>(j) * (mu + 1) + i] =
            light_at(patch.center + (in_u * (2. * i / mu - 1)) * patch.u + (in_v * (2. * j / mv - 1)) * patch.v + 0.006 * n, n, 40);
    auto const at = [&](double u, double v) {
      double const x = std::clamp(0.5 * mu * (u / in_u + 1), 0., mu - 1e-9), y = std::clamp(0.5 * mv * (v / in_v + 1), 0., mv - 1e-9);
      int const i = static_cast<int>(x), j = static_cast<int>(y);
      double const a = x - i, b = y - j;
      auto const& m00 = map[static_cast<std::size_t>(j) * (mu + 1) + i];
      auto const &m10 = (&m00)[1], &m01 = (&m00)[mu + 1], &m11 = (&m00)[mu + 2];
      return Light{mix(mix(m00.radiance, m10.radiance, a), mix(m01.radiance, m11.radiance, a), b),
                   (1 - b) * ((1 - a) * m00.window + a * m10.window) + b * ((1 - a) * m01.window + a * m11.window)};
    };
    int const nu = count(2 * patch.half_u, g.step_u), nv = count(2 * patch.half_v, g.step_v);
    // Half of a disc's alpha is reached 1.18 deviations out, 0.8 steps: beyond the edge by 0.3 steps, so the outer discs move in by that.
    double const du0 = 2 * patch.half_u / nu, dv0 = 2 * patch.half_v / nv;
    double const hu = g.inset ? patch.half_u - std::min(0.3 * du0, 0.3 * patch.half_u) : patch.half_u,
                 hv = g.inset ? patch.half_v - std::min(0.3 * dv0, 0.3 * patch.half_v) : patch.half_v;
    double const du = 2 * hu / nu, dv = 2 * hv / nv;
    for (int j = 0; j < nv; ++j)
      for (int i = 0; i < nu; ++i) {
        double const jitter_u = 0.16 * (hash01(i, j, 11) - 0.5), jitter_v = 0.16 * (hash01(i, j, 12) - 0.5);
        double const u = -hu + (i + 0.5 + jitter_u) * du, v = -hv + (j + 0.5 + jitter_v) * dv;
        Paint const paint = patch.painter(u, v);
        if (paint.none) continue;
        shade(patch.center + u * patch.u + v * patch.v, n, patch.u, g.spread * du, g.spread * dv, g.opacity, paint, at(u, v), out);
      }
  }

  Lighting light_;
  double detail_;
  std::vector<Point> hemisphere_;
  std::vector<Patch> patches_;
  std::vector<Free> free_;
  std::vector<Blocker> blockers_;
  std::vector<Group> groups_, near_;
  bool closed_ = true;
};

}  // namespace gsp::detail
