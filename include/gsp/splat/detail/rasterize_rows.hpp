#pragma once
#include <gsp/core/detail/prefetch.hpp>
#include <gsp/splat/channels.hpp>
#include <gsp/splat/detail/lanes.hpp>

namespace gsp::detail {

/// A tile's list of a wave, front to back.
template <class Mem>
struct TileList {
  SplatWave<Mem> const& wave;
  std::int64_t at, end;
  int stored;  // numbers that channels keep of a splat
  static constexpr int ahead = 8;
  bool next(Splat const*& splat, float const*& values) {
    if (at == end) return false;
    if (at + ahead < end) prefetch(&wave.splats(wave.tile_splats(at + ahead)), sizeof(Splat));  // by depth they lie anywhere
    int const id = wave.tile_splats(at++);
    splat = &wave.splats(id);
    values = wave.values.data() + std::int64_t(id) * stored;
    return true;
  }
};

/// A tile on a CPU: 16 rows of 16 pixels, a row is one pack (or two, or four, where packs are narrower). A splat goes over two rows at a
/// time: neither waits for the other, and one branch decides for both.
template <class Mem, class List>
struct RasterizeRows {
  Frames<Mem> frames;
  List channels;
  float alpha_max, stop;

  static constexpr int side = 16, W = native_width<float>, packs = side / W, rows_at_once = 2;
  using P = Pack<float, W>;
  static_assert(side % W == 0);

  struct Pixels {  // of one pack
    P numbers[List::size], T;
    P least;  // the exponent that an alpha must reach: -log2(255), or infinity where the pixel is done
  };

  void operator()(int index) const {
    auto const& wave = frames.wave;
    int const tiles = wave.tiles(), image = wave.first + index / tiles;
    if (frames.status(image) == 0)
      tile(image, index % tiles, TileList<Mem>{wave, wave.tile_begin(index), wave.tile_begin(index + 1), List::stored});
  }

  /// Of the splats that `list` gives one after the other, front to back.
  template <class Splats>
  void tile(int image, int tile, Splats list) const {
    int const columns_of_tiles = frames.wave.grid.columns();
    int const x0 = tile % columns_of_tiles * side, y0 = tile / columns_of_tiles * side;
    Pixels pixels[side + rows_at_once - 1][packs];
    int const rows = frames.height - y0 < side ? frames.height - y0 : side;
    int rows_done = 0;
    P centre[packs];  // of the pixels, from the left edge of the tile
    constexpr float infinity = std::numeric_limits<float>::infinity();
    for (int k = 0; k < packs; ++k)
      for (int i = 0; i < W; ++i) centre[k].set(i, static_cast<float>(k * W + i) + 0.5f);
    for (auto& row : pixels)
      for (int k = 0; k < packs; ++k) {
        for (P& x : row[k].numbers) x = P(0.f);
        row[k].T = P(1.f);
        row[k].least = P(-splat_log2_255);
        row[k].least = select(centre[k] < P(static_cast<float>(frames.width - x0)), row[k].least, P(infinity));
      }
    for (int r = rows; r < side + rows_at_once - 1; ++r)  // below the picture, or the tile
      for (int k = 0; k < packs; ++k) pixels[r][k].least = P(infinity);

    Splat const* splat = nullptr;
    float const* values = nullptr;
    while (rows_done < rows && list.next(splat, values)) {
      Splat const& s = *splat;
      // rows with a centre in [v - ye, v + ye], a little more for rounding
      float const middle = s.v - static_cast<float>(y0) - 0.5f, reach = s.ye + 0.01f;
      int const top = middle - reach > 0.f ? static_cast<int>(min(middle - reach, 16.f)) : 0;
      int const bottom = middle + reach < static_cast<float>(rows) ? static_cast<int>(max(middle + reach, -1.f)) : rows - 1;
      P const l11(s.l11);
      float const left = s.u - static_cast<float>(x0);
      bool finished = false;
      for (int row = top; row <= bottom; row += rows_at_once) {
        P exponent[rows_at_once][packs];
        decltype(P() < P()) touched[rows_at_once][packs];
        bool any = false;
        for (int r = 0; r < rows_at_once; ++r) {
          float const dy = static_cast<float>(y0 + row + r) + 0.5f - s.v, wy = s.l22 * dy;
          P const across(fma(s.l21, dy, -(s.l11 * left))), most(fma(-wy, wy, s.power));
          for (int k = 0; k < packs; ++k) {
            P const wx = fma(l11, centre[k], across);
            exponent[r][k] = fma(-wx, wx, most);
            touched[r][k] = exponent[r][k] >= pixels[row + r][k].least;
            any |= any_lane(touched[r][k]);
          }
        }
        if (!any) continue;
        for (int r = 0; r < rows_at_once; ++r)
          for (int k = 0; k < packs; ++k) {
            Pixels& p = pixels[row + r][k];
            P const alpha = min(exp2(exponent[r][k]), P(alpha_max)), left_over = p.T * (P(1.f) - alpha);
            auto const stops = touched[r][k] && (left_over <= P(stop)), adds = touched[r][k] && (left_over > P(stop));
            Blend<P> const b{select(adds, alpha * p.T, P(0.f)), p.T, select(adds, left_over, p.T)};
            channels.blend(p.numbers, s, values, b);
            p.T = b.left;
            p.least = select(stops, P(infinity), p.least);
            finished |= any_lane(stops);
          }
      }
      if (!finished) continue;
      rows_done = 0;
      for (int row = 0; row < rows; ++row) {
        bool all_done = true;
        for (int k = 0; k < packs; ++k) all_done &= !any_lane(pixels[row][k].least < P(infinity));
        rows_done += all_done;
      }
    }

    int const columns = frames.width - x0 < side ? frames.width - x0 : side;
    for (int row = 0; row < rows; ++row)
      for (int k = 0; k < packs; ++k) {
        Pixels& p = pixels[row][k];
        channels.finish(p.numbers, P(1.f) - p.T);
        for (int i = 0; i < W && k * W + i < columns; ++i) {
          float pixel[List::size];
          for (int n = 0; n < List::size; ++n) pixel[n] = p.numbers[n][i];
          channels.store(image, y0 + row, x0 + k * W + i, pixel);
        }
      }
  }
};

}  // namespace gsp::detail
