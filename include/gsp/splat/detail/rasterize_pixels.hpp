#pragma once
#include <gsp/splat/channels.hpp>
#include <gsp/splat/detail/ellipse.hpp>

namespace gsp::detail {

/// A tile on a GPU: 256 threads, a pixel each; a warp owns 8 x 4 pixels. Splats come in batches of 256: each thread fetches one and finds
/// which of the eight warps it touches; these bits are turned into one word of 32 splats a warp, and a warp walks only the bits that are
/// set.
template <class Mem, class List>
struct RasterizePixels {
  Frames<Mem> frames;
  List channels;
  float alpha_max, stop;

  static constexpr int threads = splat_tile * splat_tile, warps = threads / 32;
  struct Batch {
    Splat splats[threads];
    unsigned words[warps][threads / 32];
    unsigned char touched[threads];
    int done;
    float values[List::stored > 0 ? threads* List::stored : 1];
  };
  static constexpr int scratch_bytes() { return static_cast<int>(sizeof(Batch)) + 16; }

  template <class Member>
  KOKKOS_FUNCTION void operator()(Member const& team) const {
    auto const& wave = frames.wave;
    int const index = team.league_rank(), tiles = wave.tiles(), image = wave.first + index / tiles, tile = index % tiles;
    if (frames.status(image) != 0) return;
    Batch& batch = *static_cast<Batch*>(team.team_scratch(0).get_shmem_aligned(sizeof(Batch), 16));
    int const rank = team.team_rank(), warp = rank / 32, lane = rank % 32;
    int const x0 = tile % wave.tiles_x * splat_tile, y0 = tile / wave.tiles_x * splat_tile;
    int const x = x0 + warp % 2 * 8 + lane % 8, y = y0 + warp / 2 * 4 + lane / 8;
    float const px = static_cast<float>(x) + 0.5f, py = static_cast<float>(y) + 0.5f;
    bool const inside = x < frames.width && y < frames.height;
    bool done = !inside;
    float pixel[List::size] = {}, T = 1;
    std::int64_t const begin = wave.tile_begin(index), end = wave.tile_begin(index + 1);
    if (rank == 0) batch.done = 0;
    team.team_barrier();
    if (done) Kokkos::atomic_inc(&batch.done);

    for (std::int64_t base = begin; base < end; base += threads) {
      team.team_barrier();  // the batch before is used up, and all have said whether they are done
      if (batch.done == threads) break;
      int const count = end - base < threads ? static_cast<int>(end - base) : threads;
      if (rank < count) {
        int const id = wave.tile_splats(base + rank);
        Splat const s = wave.splats(id);
        batch.splats[rank] = s;
        for (int k = 0; k < List::stored; ++k) batch.values[rank * List::stored + k] = wave.values(std::int64_t(id) * List::stored + k);
        batch.touched[rank] = static_cast<unsigned char>(touched_warps(s, x0, y0));
      } else {
        batch.touched[rank] = 0;
      }
      team.team_barrier();
      if (rank < warps * (threads / 32)) {
        int const w = rank % warps, group = rank / warps;
        unsigned word = 0;
        for (int k = 0; k < 32; ++k) word |= (static_cast<unsigned>(batch.touched[32 * group + k]) >> w & 1u) << k;
        batch.words[w][group] = word;
      }
      team.team_barrier();
      bool const was_done = done;
      for (int group = 0; 32 * group < count && !done; ++group)
        for (unsigned word = batch.words[warp][group]; word != 0; word &= word - 1) {
          int const at = 32 * group + Kokkos::countr_zero(word);
          Splat const& s = batch.splats[at];
          float const dx = px - s.u, dy = py - s.v, wx = fma(s.l11, dx, s.l21 * dy), wy = s.l22 * dy;
          float const exponent = fma(-wx, wx, fma(-wy, wy, s.power));
          if (exponent < -splat_log2_255) continue;
          float const alpha = min(Kokkos::exp2(exponent), alpha_max), left_over = T * (1.f - alpha);
          if (left_over <= stop) {
            done = true;
            break;
          }
          channels.blend(pixel, s, batch.values + at * List::stored, Blend<float>{alpha * T, T, left_over});
          T = left_over;
        }
      if (done && !was_done) Kokkos::atomic_inc(&batch.done);
    }

    if (!inside) return;
    channels.finish(pixel, 1.f - T);
    channels.store(image, y, x, pixel);
  }

  /// Bit w: the ellipse touches the 8 x 4 pixels of warp w.
  KOKKOS_FUNCTION static unsigned touched_warps(Splat const& s, int x0, int y0) {
    Ellipse const e(s);
    PixelRange const rows = e.rows(y0, y0 + splat_tile - 1);
    unsigned bits = 0;
    for (int strip = 0; strip < 4; ++strip) {
      int const top = y0 + 4 * strip, bottom = top + 3, first = rows.first > top ? rows.first : top,
                last = rows.last < bottom ? rows.last : bottom;
      if (first > last) continue;
      PixelRange const columns = e.columns(first, last, x0, x0 + splat_tile - 1);
      if (columns.first > columns.last) continue;
      if (columns.first < x0 + 8) bits |= 1u << 2 * strip;
      if (columns.last >= x0 + 8) bits |= 2u << 2 * strip;
    }
    return bits;
  }
};

}  // namespace gsp::detail
