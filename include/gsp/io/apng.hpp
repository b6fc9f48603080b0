#pragma once
#include <gsp/io/detail/frame_rate.hpp>
#include <gsp/io/detail/png_chunks.hpp>
#include <gsp/io/file.hpp>
#include <utility>

namespace gsp::io {

struct ApngOptions {
  double frames_per_second = 25;  // 0.001 .. 1000; the nearest fraction of 16-bit numbers is what is shown
  int loops = 0;                  // 0: for ever
  int level = 6;                  // zlib's, 0..9
};

/// An animation as APNG: a PNG whose further frames viewers without animation skip. Each frame stores only the rectangle that differs from
/// the one before, so a still background costs nothing. Frames are packed as they come; `finish` gives the file. One that is too long to
/// keep is written in parts: `head`, after each `add` what `take` gives, `tail`, and at last `head` again over the first, with their
/// number.
class ApngWriter {
 public:
  explicit ApngWriter(ApngOptions options = {}) : options_(options), rate_(detail::frame_rate(options.frames_per_second)) {
    expects(options.loops >= 0 && options.level >= 0 && options.level <= 9, "gsp::io::ApngWriter: loops must not be negative, level 0..9");
  }

  /// All frames must have the size and channels of the first.
  void add(Bitmap8 const& frame) {
    expect_bitmap(frame, "gsp::io::ApngWriter::add");
    int x0 = 0, y0 = 0, x1 = frame.width, y1 = frame.height;
    if (count_ > 0) {
      expects(frame.width == last_.width && frame.height == last_.height && frame.channels == last_.channels,
              "gsp::io::ApngWriter::add: the frame differs in size from the first");
      std::size_t const c = static_cast<std::size_t>(frame.channels);
      x0 = frame.width;
      y0 = frame.height;
      x1 = y1 = 0;
      for (int y = 0; y < frame.height; ++y)
        for (int x = 0; x < frame.width; ++x) {
          std::size_t const at = (static_cast<std::size_t>(y) * frame.width + x) * c;
          if (!std::equal(&frame.pixels[at], &frame.pixels[at] + c, &last_.pixels[at])) {
            x0 = std::min(x0, x);
            x1 = std::max(x1, x + 1);
            y0 = std::min(y0, y);
            y1 = y + 1;
          }
        }
      if (x1 == 0) {  // nothing changed: a frame needs a pixel
        x0 = y0 = 0;
        x1 = y1 = 1;
      }
    }
    auto rectangle = make_bitmap<std::uint8_t>(x1 - x0, y1 - y0, frame.channels);
    std::size_t const row = static_cast<std::size_t>(x1 - x0) * frame.channels;
    for (int y = y0; y < y1; ++y)
      std::copy_n(&frame.pixels[(static_cast<std::size_t>(y) * frame.width + x0) * frame.channels], row, &rectangle.pixels[(y - y0) * row]);
    auto const packed = detail::deflate(detail::filter_rows(detail::png_rows(rectangle), row, static_cast<std::size_t>(frame.channels)),
                                        detail::Wrapper::zlib, options_.level);

    std::vector<std::byte> control;
    for (int v : {sequence_++, x1 - x0, y1 - y0, x0, y0}) detail::put_be(control, static_cast<std::uint32_t>(v));
    detail::put_be(control, static_cast<std::uint32_t>(rate_.seconds), 2);
    detail::put_be(control, static_cast<std::uint32_t>(rate_.frames), 2);
    detail::put_be(control, 0, 2);  // leave the frame when it is over; write over what was there
    detail::put_chunk(body_, "fcTL", control);
    if (count_ == 0) {
      detail::put_chunk(body_, "IDAT", packed);
    } else {
      std::vector<std::byte> data;
      detail::put_be(data, static_cast<std::uint32_t>(sequence_++));
      data.insert(data.end(), packed.begin(), packed.end());
      detail::put_chunk(body_, "fdAT", data);
    }
    last_ = frame;
    ++count_;
  }

  std::vector<std::byte> finish() const {
    expects(!taken_, "gsp::io::ApngWriter::finish: frames were taken; write head, what take gave, and tail");
    auto out = head();
    auto const end = tail();
    out.insert(out.end(), body_.begin(), body_.end());
    out.insert(out.end(), end.begin(), end.end());
    return out;
  }

  /// The start of the file, of the same length for any number of frames.
  std::vector<std::byte> head() const {
    expects(count_ > 0, "gsp::io::ApngWriter: there are no frames; add one");
    std::vector<std::byte> out, control;
    for (char c : detail::png_signature) out.push_back(static_cast<std::byte>(c));
    detail::put_chunk(out, "IHDR", detail::png_header(last_.width, last_.height, last_.channels, 8));
    detail::put_be(control, static_cast<std::uint32_t>(count_));
    detail::put_be(control, static_cast<std::uint32_t>(options_.loops));
    detail::put_chunk(out, "acTL", control);
    return out;
  }
  /// The frames that were added and not taken yet, as they stand in the file.
  std::vector<std::byte> take() {
    taken_ = true;
    return std::exchange(body_, {});
  }
  /// The end of the file.
  static std::vector<std::byte> tail() {
    std::vector<std::byte> out;
    detail::put_chunk(out, "IEND", {});
    return out;
  }

 private:
  ApngOptions options_;
  detail::FrameRate rate_;
  Bitmap8 last_;
  std::vector<std::byte> body_;
  int count_ = 0, sequence_ = 0;
  bool taken_ = false;
};

/// Writes an animated PNG, all or nothing.
inline void write_apng(std::filesystem::path const& path, std::vector<Bitmap8> const& frames, ApngOptions options = {}) {
  ApngWriter writer(options);
  for (auto const& frame : frames) writer.add(frame);
  write_file(path, writer.finish());
}

}  // namespace gsp::io
