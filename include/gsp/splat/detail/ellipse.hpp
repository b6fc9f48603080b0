#pragma once
#include <gsp/math/scalar.hpp>
#include <gsp/splat/detail/lanes.hpp>
#include <gsp/splat/splat.hpp>

/// Which tiles an ellipse touches, exactly: slab by slab, from its extreme points (the SnugBox/AccuTile idea of Speedy-Splat, arXiv
/// 2412.00578).
///   {d : (l11 dx + l21 dy)^2 + (l22 dy)^2 <= reach}
/// Every multiply-add is an explicit fma, so that counting and emitting kernels cannot round differently.
namespace gsp::detail {

struct PixelRange {
  int first, last;  // inclusive; empty where last < first
};

/// Pixels whose centres lie in [low, high], of 0 .. count - 1.
KOKKOS_INLINE_FUNCTION PixelRange pixels_within(float low, float high, int first, int last) {
  float const a = Kokkos::ceil(low - 0.5f), b = Kokkos::floor(high - 0.5f);
  float const f = static_cast<float>(first), l = static_cast<float>(last);
  if (!(b >= f) || !(a <= l)) return {first, first - 1};  // also where a value is not a number
  return {a > f ? static_cast<int>(a) : first, b < l ? static_cast<int>(b) : last};
}

/// The ellipse of a splat, with what its slabs need. Grown by a thousandth of a pixel and by the rounding of far centres, so that no pixel
/// that the rasteriser would shade is lost; pixels themselves are decided by the rasteriser.
struct Ellipse {
  float u, v, slope, inverse_l11, l22, reach, xe, ye, y_right, pad;

  KOKKOS_INLINE_FUNCTION explicit Ellipse(Splat const& s) : u(s.u), v(s.v), l22(s.l22), xe(s.xe), ye(s.ye) {
    inverse_l11 = reciprocal(s.l11);
    slope = s.l21 * inverse_l11;
    reach = (s.power + splat_log2_255) * 1.00001f;
    y_right = -(s.l11 * s.l21) * xe * reciprocal(fma(s.l21, s.l21, s.l22 * s.l22));
    pad = fma(1e-6f, Kokkos::fabs(u) + Kokkos::fabs(v) + xe + ye, 1e-3f);
  }

  /// Rows of pixels that it may touch, of first .. last.
  KOKKOS_INLINE_FUNCTION PixelRange rows(int first, int last) const { return pixels_within(v - (ye + pad), v + (ye + pad), first, last); }

  /// Columns that it may touch within the rows `first_row` .. `last_row`, of first .. last.
  KOKKOS_INLINE_FUNCTION PixelRange columns(int first_row, int last_row, int first, int last) const {
    float const low = max(static_cast<float>(first_row) + 0.5f - v - pad, -ye),
                high = min(static_cast<float>(last_row) + 0.5f - v + pad, ye);
    float const right_y = clamp(y_right, low, high), left_y = clamp(-y_right, low, high);
    float const wr = l22 * right_y, wl = l22 * left_y;
    float const right = fma(-slope, right_y, near_sqrt(max(0.f, fma(-wr, wr, reach))) * inverse_l11);
    float const left = fma(-slope, left_y, -(near_sqrt(max(0.f, fma(-wl, wl, reach))) * inverse_l11));
    return pixels_within(u + (left - pad), u + (right + pad), first, last);
  }
};

/// A picture [pixel], and its tiles of 2^x_bits by 2^y_bits pixels.
struct TileGrid {
  int width, height, x_bits = 4, y_bits = 4;
  KOKKOS_INLINE_FUNCTION int columns() const { return ((width - 1) >> x_bits) + 1; }
  KOKKOS_INLINE_FUNCTION int rows() const { return ((height - 1) >> y_bits) + 1; }

  /// Rows of tiles that the ellipse may touch, of those rows of pixels.
  KOKKOS_INLINE_FUNCTION PixelRange rows_of(PixelRange const& rows) const { return {rows.first >> y_bits, rows.last >> y_bits}; }
  /// The tiles of row `ty` that the ellipse touches, of its rows of pixels `rows`; empty where last < first.
  KOKKOS_INLINE_FUNCTION PixelRange touched(Ellipse const& e, PixelRange const& rows, int ty) const {
    int const top = ty << y_bits, bottom = top + (1 << y_bits) - 1;
    PixelRange const pixels = e.columns(rows.first > top ? rows.first : top, rows.last < bottom ? rows.last : bottom, 0, width - 1);
    return pixels.first <= pixels.last ? PixelRange{pixels.first >> x_bits, pixels.last >> x_bits} : PixelRange{0, -1};
  }
};

/// Calls f(tile_y, first tile_x, last tile_x) for each row of tiles with at least one tile that the splat touches, top to bottom.
template <class F>
KOKKOS_INLINE_FUNCTION void for_tile_rows(Splat const& splat, TileGrid const& grid, F const& f) {
  Ellipse const e(splat);
  PixelRange const pixels = e.rows(0, grid.height - 1);
  if (pixels.last < pixels.first) return;
  PixelRange const rows = grid.rows_of(pixels);
  for (int ty = rows.first; ty <= rows.last; ++ty) {
    PixelRange const tiles = grid.touched(e, pixels, ty);
    if (tiles.first <= tiles.last) f(ty, tiles.first, tiles.last);
  }
}

KOKKOS_INLINE_FUNCTION int count_tiles(Splat const& splat, TileGrid const& grid) {
  int count = 0;
  for_tile_rows(splat, grid, [&](int, int first, int last) { count += last - first + 1; });
  return count;
}

}  // namespace gsp::detail
