#pragma once
#include <gsp/core/check.hpp>
#include <gsp/splat/detail/painted_scene.hpp>

/// A furnished room of Gaussians made in code: for first programs, tests and benches that need a scene and have no file.
namespace gsp {

struct SampleRoomOptions {
  double detail = 1;  // discs per length: 1 gives about 210,000 Gaussians, 2 four times as many
  int seed = 1;       // colours and order of the books, grain of the wood
};

namespace detail {

/// Boards of wood along u: each with its own tint, grain along it, dark seams.
inline Painter boards(double width, double length, Point base, double gloss, int seed) {
  return [=](double u, double v) {
    int const row = static_cast<int>(std::floor(v / width));
    double const shifted = u + length * hash01(row, 0, seed);
    int const column = static_cast<int>(std::floor(shifted / length));
    double const tint = 0.80 + 0.38 * hash01(row, column, seed + 1), warm = hash01(row, column, seed + 2) - 0.5;
    double const grain = fractal_noise(1.3 * u + 17 * row, 34 * v + 5.1 * column, seed + 3) - 0.5;
    double const end = std::abs(std::remainder(shifted, length)) < 0.010 ? 0.62 : 1;
    return Paint{end * tint * (1 + 0.55 * grain) * mul(base, Point{1 + 0.10 * warm, 1, 1 - 0.16 * warm}), gloss};
  };
}
inline Painter wood(Point base, double gloss, int seed) {
  return [=](double u, double v) {
    return Paint{(0.85 + 0.5 * (fractal_noise(2.5 * u, 2.5 * v, seed) - 0.5) + 0.3 * (noise(7 * u, 60 * v, seed + 4) - 0.5)) * base, gloss};
  };
}
inline Painter cloth(Point base, int seed) {
  return [=](double u, double v) {
    return Paint{(0.88 + 0.24 * noise(90 * u, 90 * v, seed) + 0.16 * (fractal_noise(5 * u, 5 * v, seed + 1) - 0.5)) * base};
  };
}
inline Painter plaster(Point base, int seed) {
  return [=](double u, double v) { return Paint{(0.97 + 0.06 * fractal_noise(3 * u, 3 * v, seed)) * base}; };
}

/// Paintings: hills under a sun; rectangles; circles.
inline Painter painting(int which, double half_u, double half_v) {
  return [=](double u, double v) {
    double const x = u / half_u, y = v / half_v;
    Paint p{{0.82, 0.79, 0.72}, 0.03};
    if (std::abs(x) > 0.78 || std::abs(y) > 0.80) return p;  // the mount
    if (which == 0) {
      p.albedo = mix({0.86, 0.52, 0.26}, {0.20, 0.36, 0.55}, smooth_step(-0.1, 0.8, y));
      if (std::hypot((x - 0.25) * half_u, (y - 0.22) * half_v) < 0.26 * half_v) p.albedo = {0.95, 0.80, 0.42};
      Point const hills[3] = {{0.30, 0.28, 0.42}, {0.16, 0.24, 0.30}, {0.06, 0.13, 0.14}};
      for (int k = 0; k < 3; ++k)
        if (y < 0.08 - 0.28 * k + 0.40 * (noise(2.2 * x + 9 * k, 0.5, 40 + k) - 0.4)) p.albedo = hills[k];
    } else if (which == 1) {
      Point const colors[6] = {{0.78, 0.10, 0.07}, {0.88, 0.66, 0.08}, {0.06, 0.16, 0.45},
                               {0.86, 0.85, 0.80}, {0.86, 0.85, 0.80}, {0.05, 0.05, 0.06}};
      double const cut_x[5] = {-0.78, -0.30, 0.18, 0.55, 0.80}, cut_y[5] = {-0.82, -0.42, 0.10, 0.50, 0.82};
      int i = 0, j = 0;
      while (i < 3 && x > cut_x[i + 1]) ++i;
      while (j < 3 && y > cut_y[j + 1]) ++j;
      p.albedo = colors[static_cast<int>(6 * hash01(i, j, 77))];
      for (double c : cut_x)
        if (std::abs(x - c) < 0.025) p.albedo = {0.03, 0.03, 0.03};
      for (double c : cut_y)
        if (std::abs(y - c) < 0.02) p.albedo = {0.03, 0.03, 0.03};
    } else {
      p.albedo = {0.14, 0.25, 0.26};
      for (int k = 0; k < 7; ++k) {
        double const cx = 1.2 * (hash01(k, 1, 90) - 0.5), cy = 1.2 * (hash01(k, 2, 90) - 0.5), r = 0.14 + 0.22 * hash01(k, 3, 90);
        double const d = std::hypot(x - cx, (y - cy) * half_v / half_u);
        if (d < r)
          p.albedo =
              mix(p.albedo, Point{0.30 + 0.65 * hash01(k, 4, 90), 0.25 + 0.45 * hash01(k, 5, 90), 0.20 + 0.3 * hash01(k, 6, 90)}, 0.8);
        if (std::abs(d - r) < 0.03) p.albedo = {0.90, 0.85, 0.70};
      }
    }
    return p;
  };
}

inline Painter rug(double half_u, double half_v) {
  return [=](double u, double v) {
    Point const red{0.42, 0.075, 0.055}, navy{0.045, 0.065, 0.14}, cream{0.68, 0.58, 0.43}, gold{0.55, 0.33, 0.10};
    double const edge = std::min(half_u - std::abs(u), half_v - std::abs(v));
    Point c = red;
    if (edge < 0.07)
      c = navy;
    else if (edge < 0.10)
      c = cream;
    else if (edge < 0.26) {  // border of small diamonds
      double const along = half_u - std::abs(u) < half_v - std::abs(v) ? v : u;
      double const d = std::abs(std::remainder(along, 0.16)) / 0.08 + std::abs(edge - 0.18) / 0.08;
      c = d < 0.45 ? gold : d < 0.80 ? cream : navy;
    } else if (edge < 0.29)
      c = gold;
    else {
      double const d = std::abs(std::remainder(u, 0.44)) / 0.22 + std::abs(std::remainder(v, 0.40)) / 0.20;
      double const medallion = std::abs(u) / 0.62 + std::abs(v) / 0.42;
      if (medallion < 1)
        c = medallion < 0.35   ? cream
            : medallion < 0.42 ? navy
            : medallion < 0.72 ? mix(navy, red, d < 0.6 ? 0.0 : 0.55)
            : medallion < 0.84 ? gold
                               : navy;
      else if (d < 0.22)
        c = cream;
      else if (d < 0.40)
        c = navy;
      else if (std::abs(d - 1) < 0.09)
        c = gold;
    }
    return Paint{(0.82 + 0.36 * noise(130 * u, 130 * v, 5)) * c};
  };
}

/// A leaf: discs along a bending line.
inline void add_leaf(PaintedScene& scene, Point from, double azimuth, double rise, double length, double width, Point green, int seed) {
  int const n = std::max(3, static_cast<int>(length / (0.9 * width)));
  Point const flat{std::cos(azimuth), std::sin(azimuth), 0}, side{-flat.y, flat.x, 0};
  for (int i = 0; i < n; ++i) {
    double const t = (i + 0.5) / n, slope = rise - 1.7 * t;
    Point const along = normalized(flat + slope * Point{0, 0, 1});
    double const shape = std::sin(std::numbers::pi * std::min(0.97, 0.12 + 0.88 * t));
    Point const normal = normalized(cross(along, side) + 0.15 * (hash01(i, seed, 3) - 0.5) * side);
    Point const at = from + 0.5 * length / n * along;
    if (std::abs(at.x) > 2.95 || std::abs(at.y) > 2.45) break;  // the wall
    scene.disc(at, normal, along, 0.46 * length / n, 0.36 * width * (0.25 + 0.75 * shape),
               {(0.75 + 0.5 * hash01(i, seed, 1)) * green, 0.05});
    from += length / n * along;
  }
}
inline void add_plant(PaintedScene& scene, Point base, double size, Point pot, int leaves, int seed) {
  scene.frustum(base, 0.11 * size, 0.15 * size, 0.26 * size, 0.016, plain(pot, 0.05), false);
  scene.frustum(base + Point{0, 0, 0.22 * size}, 0.13 * size, 0.13 * size, 0.005, 0.016, plain({0.05, 0.03, 0.02}), true, false);
  for (int k = 0; k < leaves; ++k) {
    double const azimuth = 2.399963 * k + 0.4 * hash01(k, seed, 6), rise = 0.6 + 2.1 * hash01(k, seed, 7),
                 length = size * (0.42 + 0.40 * hash01(k, seed, 8));
    Point const green = mix({0.045, 0.16, 0.035}, {0.16, 0.33, 0.07}, hash01(k, seed, 9));
    add_leaf(scene, base + Point{0.03 * size * std::cos(azimuth), 0.03 * size * std::sin(azimuth), 0.23 * size}, azimuth, rise, length,
             0.075 * size, green, seed + k);
  }
  scene.block({Blocker::Kind::ellipsoid, base + Point{0, 0, 0.55 * size}, {0.22 * size, 0.22 * size, 0.26 * size}});
}

/// Leaves out what stands behind things that hang on the surface: Gaussians are sorted by their centres, so that a wall's wide discs would
/// shine through.
struct Hole {
  double u, v, half_u, half_v;
};
inline Painter with_holes(Painter painter, std::vector<Hole> holes) {
  return [=](double u, double v) {
    Paint p = painter(u, v);
    for (auto const& h : holes) p.none = p.none || (std::abs(u - h.u) < h.half_u - 0.03 && std::abs(v - h.v) < h.half_v - 0.03);
    return p;
  };
}

inline void add_shell(PaintedScene& s, int seed) {  // floor, walls, ceiling, window, door
  using F = PaintedScene;
  Point const X{1, 0, 0}, Y{0, 1, 0}, Z{0, 0, 1};
  Point const paint{0.70, 0.67, 0.60}, accent{0.20, 0.30, 0.29}, white{0.80, 0.79, 0.76}, oak{0.36, 0.205, 0.105};
  double const rug_u = 1.25, rug_v = 0.9;
  Painter const floor = boards(0.12, 1.45, oak, 0.16, seed);
  s.rectangle({0, 0, 0}, X, Y, 3, 2.5, {0.06, 0.0149, 0.06, false, 0.985}, [=](double u, double v) {
    Paint p = floor(u, v);
    p.none = std::abs(u) < rug_u - 0.08 && std::abs(v + 0.05) < rug_v - 0.08;
    return p;
  });
  for (int row = -20; row <= 20; ++row)
    for (int i = 0; i < 86; ++i) {  // seams
      double const x = -3 + 6 * (i + 0.5) / 86, y = 0.12 * row;
      if (std::abs(y) > 2.5 || (std::abs(x) < rug_u && std::abs(y + 0.05) < rug_v)) continue;
      s.disc({x, y, 0.001}, Z, X, 0.045, 0.0022, {0.30 * oak, 0}, 0.85);
    }
  s.rectangle({0, -0.05, 0.004}, X, Y, rug_u, rug_v, {0.0185, 0.0185, 0.05, true, 0.985}, rug(rug_u, rug_v));
  for (int side = -1; side <= 1; side += 2)
    for (int i = 0; i < 90; ++i)  // fringe
      s.disc({side * (rug_u + 0.035), -0.05 - rug_v + 2 * rug_v * (i + 0.5) / 90, 0.003}, Z,
             normalized(Point{1, 0.3 * (hash01(i, side, 4) - 0.5), 0}), 0.018, 0.0035, {{0.62, 0.54, 0.42}}, 0.9);

  Hole const skirting{0, -1.32, 9, 0.075};
  F::Grid const wall{0.062, 0.062, 0.12, false, 0.99, 0.85};
  s.rectangle({0, 0, 2.7}, X, -Y, 3, 2.5, {0.085, 0.085, 0.2, false, 0.99, 0.85}, plaster({0.80, 0.79, 0.77}, 20));
  s.rectangle({-3, 0, 1.35}, Y, Z, 2.5, 1.35, wall,
              with_holes(plaster(accent, 21), {{1.35, 0.27, 0.47, 0.35}, {-1.05, -0.30, 0.68, 1.02}, skirting}));  // picture, shelf
  s.rectangle({0, -2.5, 1.35}, -X, Z, 3, 1.35, wall,
              with_holes(plaster(paint, 23),
                         {{0.95, 0.27, 0.43, 0.31}, {-0.15, 0.31, 0.35, 0.35}, {-0.98, 0.23, 0.25, 0.33}, skirting}));  // pictures
  s.rectangle({3, 0, 1.35}, -Y, Z, 2.5, 1.35, wall,
              with_holes(plaster(paint, 22), {{0.30, -0.10, 0.62, 0.36}, {-1.55, -0.33, 0.47, 1.06}, skirting}));  // screen, door
  // The wall y = 2.5 round the window x in [-0.5, 1.7], z in [0.75, 2.35].
  s.rectangle({-1.75, 2.5, 1.35}, X, Z, 1.25, 1.35, wall, with_holes(plaster(paint, 24), {skirting}));
  s.rectangle({2.35, 2.5, 1.35}, X, Z, 0.65, 1.35, wall, with_holes(plaster(paint, 25), {skirting}));
  s.rectangle({0.6, 2.5, 0.375}, X, Z, 1.1, 0.375, wall, plaster(paint, 26));
  s.rectangle({0.6, 2.5, 2.525}, X, Z, 1.1, 0.175, wall, plaster(paint, 27));
  for (auto& p : {Point{-3, 0, 0}, Point{3, 0, 0}, Point{0, -2.5, 0}, Point{0, 2.5, 0}}) {  // skirting
    bool const along_y = p.x != 0;
    s.box({p.x * 0.9975, p.y * 0.997, 0.05}, along_y ? Point{0.008, 2.5, 0.05} : Point{3, 0.008, 0.05}, 0, 0.03, plain(white, 0.04),
          F::all & ~F::bottom, false);
  }
  // Window: reveal, frame and bars, the garden outside.
  Point const c{0.6, 2.5, 1.55};
  double const wx = 1.1, wz = 0.8;
  auto const bar = [&](double x, double z, double hx, double hz, double depth = 0.03) {
    s.box({c.x + x, c.y + 0.06, c.z + z}, {hx, depth, hz}, 0, 0.022, plain(white, 0.05), F::all, false);
  };
  bar(0, wz - 0.03, wx, 0.03);
  bar(0, -wz + 0.03, wx, 0.03);
  bar(wx - 0.03, 0, 0.03, wz);
  bar(-wx + 0.03, 0, 0.03, wz);
  bar(0, 0, 0.03, wz);
  bar(0, 0.28, wx, 0.025, 0.02);
  s.box({c.x, 2.46, 0.735}, {wx + 0.08, 0.10, 0.018}, 0, 0.025, plain(white, 0.08));  // sill
  for (double e : {-1., 1.}) {
    s.rectangle({c.x + e * wx, 2.58, c.z}, -e * Y, Z, 0.08, wz, {0.03, 0.03, 0.1, false, 0.99}, plain(white));
    s.rectangle({c.x, 2.58, c.z + e * wz}, -e * X, Y, wx, 0.08, {0.03, 0.03, 0.1, false, 0.99}, plain(white));
  }
  s.rectangle({c.x, 2.665, c.z}, X, Z, 1.16, 0.86, {0.026, 0.026, 5, false, 0.99, 0.72}, [=](double x, double z) {
    double const u = 1.5 * x, v = 1.5 * z;
    Point glow = mix({1.9, 2.1, 2.3}, {0.85, 1.35, 2.2}, smooth_step(-0.1, 1.0, v));
    glow = mix(glow, {2.6, 2.6, 2.6}, smooth_step(0.52, 0.75, fractal_noise(1.3 * u + 3, 2.6 * v, 61)));  // clouds
    double const tree = -0.15 + 0.55 * fractal_noise(1.1 * u + 1, 0.3, 62) + 0.25 * (fractal_noise(5 * u, 5 * v, 63) - 0.5);
    if (v < tree) glow = mix({0.10, 0.26, 0.06}, {0.45, 0.78, 0.20}, smooth_step(0.35, 0.75, fractal_noise(7 * u, 7 * v, 64)));
    if (v < -0.45 + 0.05 * noise(2 * u, 1, 65)) glow = (0.9 + 0.4 * noise(12 * u, 40 * v, 66)) * Point{0.42, 0.68, 0.22};
    return Paint{{0, 0, 0}, 0, glow};
  });
  for (int side = -1; side <= 1; side += 2) {  // curtains, in folds
    double const x0 = c.x + side * 1.38, half = 0.30;
    for (int j = 0; j < 66; ++j)
      for (int i = 0; i < 44; ++i) {
        double const u = -half + 2 * half * (i + 0.5) / 44, fold = 2 * std::numbers::pi * u / 0.12 + 0.5 * std::sin(3. * j / 66 + side),
                     z = 0.06 + 2.44 * (j + 0.5) / 66;
        double const y = 2.40 + 0.035 * std::sin(fold), slope = 0.035 * 2 * std::numbers::pi / 0.12 * std::cos(fold);
        s.disc({x0 + u, y, z}, normalized(Point{slope, -1, 0}), Z, 0.027, 0.0145,
               {(0.9 + 0.2 * noise(50 * u, 8 * z, 31)) * Point{0.62, 0.47, 0.25}}, 0.985);
      }
    s.next_group();
    s.block({Blocker::Kind::box, {x0, 2.40, 1.28}, {half, 0.03, 1.22}});
  }
  s.next_group();
  s.box({c.x, 2.40, 2.53}, {1.80, 0.012, 0.012}, 0, 0.02, plain({0.05, 0.045, 0.04}, 0.1), F::all, false);
  // Door in the wall x = 3.
  s.next_group();
  s.box(
      {2.985, 1.55, 1.02}, {0.02, 0.43, 1.02}, 0, 0.022,
      [=](double u, double v) {
        double const a = std::abs(u), panel_v = v > 0 ? v - 0.45 : v + 0.48, edge = std::min(0.30 - a, 0.36 - std::abs(panel_v));
        return Paint{(edge > -0.016 && edge < 0.016 ? 0.62 : edge > 0 ? 0.94 : 1.0) * Point{0.72, 0.69, 0.63}, 0.08};
      },
      F::left | F::front | F::back | F::top, false);
  for (double y : {1.08, 2.02})
    s.box({2.98, y, 1.05}, {0.03, 0.045, 1.05}, 0, 0.025, plain(white, 0.05), F::all & ~F::bottom & ~F::right, false);
  s.box({2.98, 1.55, 2.095}, {0.03, 0.515, 0.045}, 0, 0.025, plain(white, 0.05), F::all & ~F::right, false);
  s.rounded({2.93, 1.23, 1.02}, {0.03, 0.03, 0.03}, 2, 0, 0, 0.008, plain({0.55, 0.43, 0.20}, 0.4), false);
}

inline void add_sofa(PaintedScene& s, Point at, Point color) {
  Painter const fabric = cloth(color, 50);
  s.next_group();
  s.rounded(at + Point{0, 0.02, 0.21}, {1.04, 0.43, 0.12}, 8, 0, 0, 0.032, fabric);
  for (double x : {-0.50, 0.50}) {
    s.rounded(at + Point{x, 0.06, 0.39}, {0.495, 0.40, 0.10}, 6, 0, 0, 0.030, fabric);
    s.rounded(at + Point{x, -0.30, 0.62}, {0.485, 0.12, 0.26}, 5, 0, 0.16, 0.030, fabric);
  }
  for (double x : {-1.08, 1.08}) s.rounded(at + Point{x, 0.0, 0.34}, {0.10, 0.46, 0.26}, 6, 0, 0, 0.030, fabric);
  for (double x : {-1.0, 1.0})
    for (double y : {-0.36, 0.36}) s.frustum(at + Point{x, y, 0}, 0.015, 0.022, 0.10, 0.012, plain({0.10, 0.06, 0.03}), false, false);
  s.rounded(at + Point{-0.72, -0.02, 0.63}, {0.21, 0.085, 0.20}, 3, 0.25, 0.35, 0.015, [](double u, double v) {
    return Paint{std::fmod(std::floor(7 * u + 100) + std::floor(9 * v + 100), 2) == 0 ? Point{0.75, 0.42, 0.07} : Point{0.80, 0.72, 0.56}};
  });
  s.rounded(at + Point{0.70, -0.03, 0.62}, {0.20, 0.08, 0.19}, 3, -0.3, 0.38, 0.015, cloth({0.05, 0.16, 0.20}, 55));
  s.rounded(at + Point{0.40, -0.06, 0.60}, {0.17, 0.07, 0.165}, 3, 0.1, 0.42, 0.015, cloth({0.62, 0.28, 0.16}, 56));
}

inline void add_table_and_chairs(PaintedScene& s, Point at) {
  Point const walnut{0.20, 0.105, 0.05}, beech{0.46, 0.30, 0.16};
  Painter const top = wood(walnut, 0.20, 70);
  s.next_group();
  s.box(at + Point{0, 0, 0.735}, {0.70, 0.42, 0.016}, 0, 0.016, top, PaintedScene::all, true, 2.5);
  for (double x : {-0.62, 0.62})
    for (double y : {-0.35, 0.35}) s.box(at + Point{x, y, 0.36}, {0.028, 0.028, 0.36}, 0, 0.014, top, PaintedScene::sides, true, 2.5);
  s.box(at + Point{0, 0, 0.69}, {0.60, 0.33, 0.025}, 0, 0.02, top, PaintedScene::sides, true, 2.5);
  s.rounded(at + Point{0.1, 0.02, 0.80}, {0.16, 0.16, 0.05}, 2, 0, 0, 0.012, plain({0.68, 0.66, 0.60}, 0.2));  // bowl with fruit
  for (int k = 0; k < 5; ++k)
    s.rounded(at + Point{0.1 + 0.075 * std::cos(1.3 * k), 0.02 + 0.075 * std::sin(1.3 * k), 0.845 + 0.012 * (k & 1)}, {0.042, 0.042, 0.040},
              2, 0, 0, 0.009,
              plain(k % 3 == 0   ? Point{0.55, 0.06, 0.03}
                    : k % 3 == 1 ? Point{0.70, 0.30, 0.03}
                                 : Point{0.25, 0.40, 0.05},
                    0.12));
  auto const chair = [&](double x, double y, double yaw) {
    s.next_group();
    Painter const w = wood(beech, 0.08, 80 + static_cast<int>(10 * x));
    double const cs = std::cos(yaw), sn = std::sin(yaw);
    auto const place = [&](double px, double py, double pz) { return at + Point{x + cs * px - sn * py, y + sn * px + cs * py, pz}; };
    s.box(place(0, 0, 0.45), {0.20, 0.20, 0.014}, yaw, 0.015, w, PaintedScene::all, true, 2);
    for (double a : {-0.175, 0.175}) {
      s.box(place(a, 0.175, 0.22), {0.017, 0.017, 0.22}, yaw, 0.012, w, PaintedScene::sides, true, 2);
      s.box(place(a, -0.175, 0.46), {0.017, 0.017, 0.46}, yaw, 0.012, w, PaintedScene::all & ~PaintedScene::bottom, true, 2);
    }
    for (double z : {0.60, 0.72, 0.85}) s.box(place(0, -0.178, z), {0.16, 0.010, 0.035}, yaw, 0.014, w, PaintedScene::all, true, 2);
  };
  chair(-0.30, -0.62, 0);
  chair(0.32, -0.66, 0.15);
  chair(-0.34, 0.62, std::numbers::pi);
  chair(0.95, 0.05, std::numbers::pi / 2);
}

inline void add_shelf(PaintedScene& s, Point at, int seed) {  // against the wall x = -3, open towards +x; 0.30 deep, 1.4 wide, 2.1 high
  Point const oak{0.40, 0.24, 0.12};
  Painter const w = wood(oak, 0.05, 90);
  using F = PaintedScene;
  s.next_group();
  for (double y : {-0.69, 0.69}) s.box(at + Point{0.15, y, 1.05}, {0.15, 0.012, 1.05}, 0, 0.02, w, F::all & ~F::bottom, true, 2);
  s.box(at + Point{0.008, 0, 1.05}, {0.008, 0.68, 1.05}, 0, 0.03, w, F::right);
  for (int row = 0; row <= 6; ++row) {
    double const z = 0.05 + 0.34 * row;
    s.box(at + Point{0.15, 0, z}, {0.15, 0.68, 0.012}, 0, 0.02, w, F::top | F::bottom | F::right, true, 2);
    if (row == 6) break;
    s.block({Blocker::Kind::box, at + Point{0.10, 0, z + 0.13}, {0.09, 0.6, 0.11}});
    double y = -0.66;
    for (int k = 0; y < 0.62; ++k) {
      double const r = hash01(row, k, seed), width = 0.018 + 0.032 * hash01(row, k, seed + 1),
                   height = 0.19 + 0.10 * hash01(row, k, seed + 2), depth = 0.085 + 0.025 * hash01(row, k, seed + 3);
      if (hash01(row, k, seed + 4) < 0.06) {  // a gap, with a vase
        if (y < 0.5)
          s.rounded(at + Point{0.15, y + 0.09, z + 0.10}, {0.055, 0.055, 0.085}, 2, 0, 0, 0.012,
                    plain({0.25 + 0.4 * r, 0.30, 0.50 - 0.3 * r}, 0.25), false);
        y += 0.18;
        continue;
      }
      Point const covers[8] = {{0.42, 0.06, 0.05}, {0.06, 0.14, 0.30}, {0.07, 0.22, 0.12}, {0.60, 0.42, 0.14},
                               {0.66, 0.62, 0.54}, {0.20, 0.08, 0.20}, {0.08, 0.08, 0.09}, {0.55, 0.24, 0.10}};
      Point const cover = (0.7 + 0.6 * hash01(row, k, seed + 5)) * covers[static_cast<int>(8 * r)];
      s.box(
          at + Point{0.016 + depth, y + width / 2, z + 0.012 + height / 2}, {depth, 0.47 * width, height / 2}, 0, 0.0125,
          [=](double, double v) {
            bool const band = std::abs(std::abs(v) - 0.34 * height) < 0.009;  // gilt lines
            return Paint{band ? Point{0.75, 0.55, 0.20} : cover, 0.05};
          },
          F::right | F::top, false);
      // Its sides, which show only beside a lower book or a gap, more coarsely.
      s.box(at + Point{0.016 + depth, y + width / 2, z + 0.012 + height / 2}, {depth, 0.47 * width, height / 2}, 0, 0.04, plain(cover),
            F::front | F::back, false);
      y += width;
    }
  }
}

}  // namespace detail

/// The room as Gaussians in any structure with the vectors of gsp::io::SplatSet (positions, quats, scales, opacities, sh, link or body,
/// sh_degree), appended to nothing: `Set` starts empty. Metres, z up, floor at z = 0, room 6 x 5 x 2.7 about the z axis, window in the wall
/// y = 2.5; free of furniture within 1.2 m of the axis. SH degree 1: the first order holds the window's reflection, which moves with the
/// eye. All Gaussians are static. Flat discs, 1.2 mm thick. The same options give the same Gaussians. Under a second at detail 1. Throws
/// std::invalid_argument unless 0.1 <= detail <= 10.
template <class Set>
Set sample_room(SampleRoomOptions options = {}) {
  using namespace detail;
  expects(options.detail >= 0.1 && options.detail <= 10, "gsp::sample_room: detail must be 0.1..10");
  int const seed = 100 * options.seed;
  Lighting light;
  light.lamps = {{{1.62, -2.02, 1.62}, {0.42, 0.30, 0.16}},
                 {{-0.3, 0.55, 0.25}, {0.16, 0.125, 0.085}}};  // the floor lamp; what the sunlit floor throws back
  PaintedScene s(light, options.detail);
  using F = PaintedScene;
  add_shell(s, seed + 3);
  add_sofa(s, {-0.30, -1.98, 0}, {0.13, 0.20, 0.27});
  add_table_and_chairs(s, {-1.95, 1.30, 0});
  add_shelf(s, {-3, -1.05, 0}, seed + 7);
  // Sideboard with a screen over it, at the wall x = 3.
  s.next_group();
  Painter const teak = wood({0.27, 0.14, 0.065}, 0.12, 95);
  s.box(
      {2.76, -0.30, 0.33}, {0.22, 0.85, 0.25}, 0, 0.022,
      [=](double u, double v) {
        Paint p = teak(v, u);
        if (std::abs(std::abs(u) - 0.283) < 0.005) p.albedo = 0.35 * p.albedo;  // gaps between the doors
        return p;
      },
      F::all, true, 2);
  for (double y : {-1.05, 0.45})
    for (double x : {2.60, 2.92}) s.frustum({x, y, 0}, 0.012, 0.02, 0.08, 0.01, plain({0.05, 0.04, 0.03}), false);
  s.next_group();
  s.box({2.965, -0.30, 1.25}, {0.02, 0.62, 0.36}, 0, 0.03, [](double u, double v) {
    bool const rim = std::abs(u) > 0.605 || std::abs(v) > 0.345;
    return Paint{rim ? Point{0.02, 0.02, 0.02} : Point{0.006, 0.007, 0.009}, rim ? 0.05 : 0.30};
  });
  s.next_group();
  s.rounded({2.74, 0.36, 0.72}, {0.09, 0.09, 0.14}, 2, 0, 0, 0.012, plain({0.10, 0.24, 0.30}, 0.30));
  add_plant(s, {2.74, -0.98, 0.58}, 0.55, {0.62, 0.60, 0.56}, 26, 311);
  s.next_group();
  add_plant(s, {-0.98, 2.12, 0}, 1.25, {0.46, 0.20, 0.11}, 44, 312);
  s.next_group();
  add_plant(s, {2.52, -2.05, 0}, 1.45, {0.60, 0.58, 0.54}, 48, 313);
  // Floor lamp.
  s.next_group();
  s.frustum({1.62, -2.02, 0}, 0.14, 0.14, 0.02, 0.015, plain({0.05, 0.05, 0.05}, 0.1));
  s.frustum({1.62, -2.02, 0.02}, 0.011, 0.011, 1.42, 0.012, plain({0.30, 0.24, 0.12}, 0.3), false);
  s.frustum(
      {1.62, -2.02, 1.42}, 0.22, 0.15, 0.30, 0.018,
      [](double, double v) {
        return Paint{{0.55, 0.50, 0.42}, 0, (1.0 - 1.6 * std::abs(v)) * Point{1.25, 0.92, 0.52}};
      },
      false, false);
  // Pendant over the table.
  s.next_group();
  s.frustum({-1.95, 1.30, 1.92}, 0.006, 0.006, 0.78, 0.012, plain({0.03, 0.03, 0.03}), false, false);
  s.frustum({-1.95, 1.30, 1.72}, 0.24, 0.05, 0.22, 0.016, plain({0.62, 0.30, 0.07}, 0.2), true, true);
  // Pictures.
  auto const picture = [&](Point c, Point u, double hu, double hv, int which) {
    s.next_group();
    Point const n = cross(u, Point{0, 0, 1});
    s.rectangle(c + 0.02 * n, u, {0, 0, 1}, hu, hv, {0.0125, 0.0125, 0.1, true, 0.985}, painting(which, hu, hv));
    double const yaw = std::atan2(u.y, u.x);
    Painter const frame = plain({0.06, 0.045, 0.035}, 0.08);
    for (double e : {-1., 1.}) {
      s.box(c + e * (hu + 0.012) * u + 0.015 * n, {0.014, 0.018, hv + 0.026}, yaw, 0.014, frame, F::all, false, 2);
      s.box(c + Point{0, 0, e * (hv + 0.012)} + 0.015 * n, {hu, 0.018, 0.014}, yaw, 0.014, frame, F::all, false, 2);
    }
  };
  picture({-0.95, -2.5, 1.62}, {-1, 0, 0}, 0.42, 0.30, 0);
  picture({0.15, -2.5, 1.66}, {-1, 0, 0}, 0.34, 0.34, 1);
  picture({0.98, -2.5, 1.58}, {-1, 0, 0}, 0.24, 0.32, 2);
  picture({-3, 1.35, 1.62}, {0, 1, 0}, 0.46, 0.34, 2);
  // Things on the floor at the side: a footstool, a basket.
  s.next_group();
  s.rounded({1.45, -1.25, 0.20}, {0.26, 0.26, 0.17}, 4, 0.3, 0, 0.018, cloth({0.55, 0.33, 0.12}, 58));
  s.next_group();
  s.frustum(
      {2.55, 0.95, 0}, 0.15, 0.19, 0.32, 0.013,
      [](double u, double v) {
        bool const over = std::fmod(std::floor(u / 0.03 + 1000) + std::floor(v / 0.022 + 1000), 2) == 0;
        return Paint{over ? Point{0.46, 0.32, 0.17} : Point{0.30, 0.19, 0.09}};
      },
      false);

  std::vector<Disc> const discs = s.lit();
  Set set;
  set.sh_degree = 1;
  constexpr double c0 = 0.28209479177387814, c1 = 0.48860251190291992;
  for (Disc const& d : discs) {
    for (int k = 0; k < 3; ++k) set.positions.push_back(static_cast<float>(d.position[k]));
    Point const t = normalized(d.tangent - dot(d.tangent, d.normal) * d.normal);
    auto const q = from_axes(t, cross(d.normal, t), d.normal);
    for (double v : {q.w, q.x, q.y, q.z}) set.quats.push_back(static_cast<float>(v));
    for (double v : {d.extent_u, d.extent_v, d.extent_n}) set.scales.push_back(static_cast<float>(v));
    set.opacities.push_back(static_cast<float>(d.opacity));
    Point const a = d.sheen, l = d.sheen_direction;  // colour(dir) = color + a (dir . l); Y_1 = c1 (-y, z, -x)
    for (int k = 0; k < 3; ++k) set.sh.push_back(static_cast<float>((d.color[k] - 0.5) / c0));
    for (double v : {-l.y, l.z, -l.x})
      for (int k = 0; k < 3; ++k) set.sh.push_back(static_cast<float>(a[k] * v / c1));
    if constexpr (requires { set.body; })
      set.body.push_back(0);
    else
      set.link.push_back(-1);
  }
  return set;
}

}  // namespace gsp
