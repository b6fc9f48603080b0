#include <doctest/doctest.h>

#include <gsp/io/apng.hpp>
#include <gsp/io/png.hpp>
#include <io/fixtures.hpp>

using namespace gsp::io;
using namespace gsp_test;

namespace {

/// Plays an APNG: every frame's rectangle becomes a PNG of its own, is read and put over the picture.
std::vector<Bitmap8> play(std::vector<std::byte> const& bytes, int& frames_announced) {
  std::vector<Bitmap8> shown;
  std::vector<std::byte> header;
  Bitmap8 canvas;
  int x0 = 0, y0 = 0, width = 0, height = 0;
  std::uint32_t sequence = 0;
  for (std::size_t at = 8; at < bytes.size();) {
    std::size_t const length = detail::get_be(bytes, at);
    std::string const type(detail::as_text(Bytes(bytes).subspan(at + 4, 4)));
    Bytes data = Bytes(bytes).subspan(at + 8, length);
    at += 12 + length;
    if (type == "IHDR") header.assign(data.begin(), data.end());
    if (type == "acTL") {
      frames_announced = int(detail::get_be(data, 0));
      CHECK(detail::get_be(data, 4) == 0);
    }
    if (type == "fcTL") {
      CHECK(detail::get_be(data, 0) == sequence++);
      width = int(detail::get_be(data, 4)), height = int(detail::get_be(data, 8)), x0 = int(detail::get_be(data, 12)),
      y0 = int(detail::get_be(data, 16));
      CHECK(length == 26);
      CHECK(detail::get_be(data, 20) == (1u << 16 | 12));  // 1/12 s
    }
    if (type == "fdAT") {
      CHECK(detail::get_be(data, 0) == sequence++);
      data = data.subspan(4);
    }
    if (type != "IDAT" && type != "fdAT") continue;
    auto png = bytes_of(std::string(detail::png_signature));
    auto h = header;
    for (int k = 0; k < 4; ++k) h[k] = std::byte(width >> (24 - 8 * k)), h[4 + k] = std::byte(height >> (24 - 8 * k));
    detail::put_chunk(png, "IHDR", h), detail::put_chunk(png, "IDAT", data), detail::put_chunk(png, "IEND", {});
    auto const part = parse_png8(png, "frame");
    if (shown.empty()) canvas = part;
    for (int y = 0; y < height; ++y)
      std::copy_n(&part.pixels[std::size_t(y) * width * part.channels], std::size_t(width) * part.channels,
                  &canvas.pixels[(std::size_t(y0 + y) * canvas.width + x0) * canvas.channels]);
    shown.push_back(canvas);
  }
  return shown;
}

std::vector<Bitmap8> moving_square(int frames) {
  std::vector<Bitmap8> out;
  std::mt19937 random(1);
  auto background = make_bitmap<std::uint8_t>(40, 30, 3);
  for (auto& v : background.pixels) v = static_cast<std::uint8_t>(random());
  for (int f = 0; f < frames; ++f) {
    out.push_back(background);
    for (int y = 5; y < 10; ++y)
      for (int x = 2 * (f / 2); x < 2 * (f / 2) + 5; ++x)  // every other frame repeats the one before
        for (int c = 0; c < 3; ++c) out.back().pixels[(y * 40 + x) * 3 + c] = 255;
  }
  return out;
}

}  // namespace

TEST_CASE("APNG: plays back every frame, and stores only what changes") {
  auto const frames = moving_square(10);
  ApngWriter writer({.frames_per_second = 12});
  for (auto const& f : frames) writer.add(f);
  auto const bytes = writer.finish();
  int announced = 0;
  auto const shown = play(bytes, announced);
  REQUIRE(shown.size() == 10);
  CHECK(announced == 10);
  for (std::size_t f = 0; f < 10; ++f) CHECK(shown[f].pixels == frames[f].pixels);
  CHECK(bytes.size() < format_png(frames[0]).size() + 10 * 300);
  CHECK(parse_png8(bytes, "as still").pixels == frames[0].pixels);  // viewers without animation see the first frame
  Folder folder;
  write_apng(folder.path / "a.png", frames, {.frames_per_second = 12});
  CHECK(read_file(folder.path / "a.png") == bytes);
  CHECK_THROWS_AS(write_apng(folder.path / "b.png", {}), std::invalid_argument);
  CHECK_THROWS_AS(write_apng(folder.path / "b.png", {frames[0], make_bitmap<std::uint8_t>(4, 4, 3)}), std::invalid_argument);
  CHECK(folder.files() == 1);
}
