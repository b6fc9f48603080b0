#include <doctest/doctest.h>

#include <gsp/io/detail/png_chunks.hpp>
#include <gsp/io/detail/png_passes.hpp>
#include <gsp/io/file.hpp>
#include <gsp/io/png.hpp>
#include <io/fixtures.hpp>
#define STB_IMAGE_STATIC
#define STB_IMAGE_IMPLEMENTATION
#define STBI_ONLY_PNG
#if defined(__GNUC__)
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wunused-function"
#pragma GCC diagnostic ignored "-Wsign-compare"
#endif
#include <stb/stb_image.h>
#if defined(__GNUC__)
#pragma GCC diagnostic pop
#endif

using namespace gsp::io;
using namespace gsp_test;

namespace {

template <class T>
Bitmap<T> picture(int width, int height, int channels, unsigned seed = 1) {
  std::mt19937 random(seed);
  auto b = make_bitmap<T>(width, height, channels);
  for (std::size_t i = 0; i < b.pixels.size(); ++i)
    b.pixels[i] = static_cast<T>(i * 977 / channels + (random() & 7));  // smooth, with some noise
  return b;
}

/// A PNG of any type from filtered rows, so that the reader meets what the writer never makes.
std::vector<std::byte> raw_png(int width, int height, int depth, int color, int interlace, std::vector<std::byte> const& rows,
                               std::vector<std::byte> const& palette = {}) {
  std::vector<std::byte> out = bytes_of(std::string(detail::png_signature)), h;
  detail::put_be(h, width), detail::put_be(h, height);
  for (int v : {depth, color, 0, 0, interlace}) h.push_back(std::byte(v));
  detail::put_chunk(out, "IHDR", h);
  if (!palette.empty()) detail::put_chunk(out, "PLTE", palette);
  detail::put_chunk(out, "tEXt", bytes_of("Comment"));
  auto const packed = detail::deflate(rows, detail::Wrapper::zlib);
  detail::put_chunk(out, "IDAT", Bytes(packed).first(packed.size() / 2));
  detail::put_chunk(out, "IDAT", Bytes(packed).subspan(packed.size() / 2));
  detail::put_chunk(out, "IEND", {});
  return out;
}

}  // namespace

TEST_CASE_TEMPLATE("PNG: what is written comes back, here and in stb", T, std::uint8_t, std::uint16_t) {
  for (int channels = 1; channels <= 4; ++channels)
    for (auto [width, height] : {std::pair{1, 1}, {7, 5}, {64, 48}}) {
      auto const b = picture<T>(width, height, channels);
      auto const bytes = format_png(b);
      CHECK(bytes == format_png(b));
      int depth = 0;
      auto const wide = parse_png16(bytes, "a.png", &depth);
      CHECK(depth == 8 * int(sizeof(T)));
      CHECK(wide.channels == channels);
      int w = 0, h = 0, c = 0;
      if constexpr (sizeof(T) == 2) {
        CHECK(wide.pixels == b.pixels);
        auto* const stb = stbi_load_16_from_memory(reinterpret_cast<stbi_uc const*>(bytes.data()), int(bytes.size()), &w, &h, &c, 0);
        REQUIRE(stb);
        CHECK(std::equal(b.pixels.begin(), b.pixels.end(), stb));
        stbi_image_free(stb);
      } else {
        CHECK(parse_png8(bytes, "a.png").pixels == b.pixels);
        for (std::size_t i = 0; i < b.pixels.size(); ++i) CHECK(wide.pixels[i] == 257 * b.pixels[i]);
        auto* const stb = stbi_load_from_memory(reinterpret_cast<stbi_uc const*>(bytes.data()), int(bytes.size()), &w, &h, &c, 0);
        REQUIRE(stb);
        CHECK(std::equal(b.pixels.begin(), b.pixels.end(), stb));
        stbi_image_free(stb);
      }
      CHECK((w == width && h == height && c == channels));
    }
}

TEST_CASE("PNG: types that we read but do not write agree with stb") {
  std::mt19937 random(5);
  for (auto [depth, color] : {std::pair{1, 0},
                              {2, 0},
                              {4, 0},
                              {8, 0},
                              {16, 0},
                              {8, 2},
                              {16, 2},
                              {1, 3},
                              {2, 3},
                              {4, 3},
                              {8, 3},
                              {8, 4},
                              {16, 4},
                              {8, 6},
                              {16, 6}})
    for (int interlace : {0, 1})
      for (auto [width, height] : {std::pair{1, 1}, {3, 2}, {13, 9}, {16, 16}}) {
        std::vector<std::byte> palette(color == 3 ? 3u << depth : 0u);
        for (auto& v : palette) v = std::byte(random());
        detail::PngInfo const info{std::uint32_t(width), std::uint32_t(height), depth, color, std::array{1, 0, 3, 1, 2, 0, 4}[color],
                                   interlace == 1};
        std::vector<std::byte> rows;
        for (auto const& pass : detail::png_passes(info))
          for (std::size_t j = 0; pass.columns(info) && j < pass.rows(info); ++j) {
            rows.push_back(std::byte(random() % 5));
            for (std::size_t x = 0; x < info.row_bytes(pass.columns(info)); ++x) rows.push_back(std::byte(random()));
          }
        auto const bytes = raw_png(width, height, depth, color, interlace, rows, palette);
        auto const mine = parse_png16(bytes, "a.png");
        int w = 0, h = 0, c = 0;
        auto const* const data = reinterpret_cast<stbi_uc const*>(bytes.data());
        std::vector<int> theirs;
        if (depth == 16) {
          auto* const p = stbi_load_16_from_memory(data, int(bytes.size()), &w, &h, &c, 0);
          REQUIRE(p);
          theirs.assign(p, p + w * h * c);
          stbi_image_free(p);
        } else {
          auto* const p = stbi_load_from_memory(data, int(bytes.size()), &w, &h, &c, 0);
          REQUIRE(p);
          for (int i = 0; i < w * h * c; ++i) theirs.push_back(257 * p[i]);
          stbi_image_free(p);
        }
        CHECK((w == mine.width && h == mine.height && c == mine.channels));
        CHECK(std::equal(theirs.begin(), theirs.end(), mine.pixels.begin(), mine.pixels.end()));
      }
}

TEST_CASE("PNG: bad input") {
  auto const good = format_png(picture<std::uint8_t>(5, 4, 3));
  CHECK(accepted_truncations(good, [](Bytes b) { parse_png16(b, "cut.png"); }) == 0);
  int accepted = 0;
  for (std::size_t i = 0; i < good.size(); ++i) {
    auto damaged = good;
    damaged[i] ^= std::byte(4);
    accepted += error_of([&] { parse_png16(damaged, "bad.png"); }).empty();
  }
  CHECK(accepted == 0);
  auto refusal = [](std::vector<std::byte> const& bytes) { return error_of([&] { parse_png16(bytes, "bad.png"); }); };
  std::vector<std::byte> const row(4, std::byte(0));
  CHECK(refusal(raw_png(3, 1, 8, 0, 0, row)).empty());
  CHECK(says(refusal(raw_png(0, 1, 8, 0, 0, row)), "width or height"));
  CHECK(says(refusal(raw_png(3, 1, 8, 5, 0, row)), "no PNG format"));
  CHECK(says(refusal(raw_png(3, 1, 16, 3, 0, row)), "no PNG format"));
  CHECK(says(refusal(raw_png(3, 1, 8, 3, 0, row)), "no palette"));
  CHECK(says(refusal(raw_png(3, 1, 8, 3, 0, {row[0], row[0], row[0], std::byte(9)}, bytes_of("abc"))), "colour 9 of a palette of 1"));
  CHECK(says(refusal(raw_png(3, 2, 8, 0, 0, row)), "does not fill the 3 x 2 pixels"));
  CHECK(says(refusal(raw_png(2, 1, 8, 0, 0, row)), "does not fill"));  // more than there should be
  CHECK(says(refusal(raw_png(2000000000, 2000000000, 16, 6, 0, row)), "over 1 TB"));
  CHECK(says(refusal(raw_png(100000, 100000, 8, 0, 0, row)), "does not fill"));
  CHECK(says(refusal(raw_png(3, 1, 8, 0, 0, {std::byte(7), row[0], row[0], row[0]})), "filter 7"));
  CHECK(says(refusal(bytes_of("JFIF")), "does not start as a PNG"));
  CHECK_THROWS_AS(format_png(Bitmap8{2, 2, 3, {1}}), std::invalid_argument);
  Folder folder;
  CHECK_THROWS_WITH_AS(
      write_png(folder.path / "a.png", Bitmap8{}),
      "gsp::io::write_png: the bitmap is 0 x 0 x 0 and has 0 values: it needs a positive size, 1 to 4 channels and width * "
      "height * channels values; make_bitmap and to_bitmap8 give one",
      std::invalid_argument);
  CHECK_THROWS(write_png(folder.path / "a.png", Bitmap8{2, 2, 3, {1}}));
  CHECK(folder.files() == 0);
  write_png(folder.path / "a.png", picture<std::uint16_t>(9, 9, 1));
  CHECK(read_png16(folder.path / "a.png").pixels == picture<std::uint16_t>(9, 9, 1).pixels);
}
