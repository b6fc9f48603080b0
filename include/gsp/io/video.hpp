#pragma once
#include <gsp/io/apng.hpp>
#include <gsp/io/bitmap.hpp>
#include <gsp/io/detail/frame_rate.hpp>
#include <gsp/io/detail/program.hpp>
#include <gsp/io/file.hpp>
#include <optional>

namespace gsp::io {

struct VideoOptions {
  double frames_per_second = 25;  // 0.001 .. 1000
  int quality = 16;               // of mp4: x264's constant rate factor, 0 (large, exact but for the colours' resolution) .. 51
};

/// The program ffmpeg, in the first folder of PATH that has it; empty where none has.
inline std::filesystem::path find_ffmpeg() { return detail::find_program("ffmpeg"); }

/// The file that a video called `path` becomes: that itself, or, where it ends in .mp4 and there is no ffmpeg, the .apng of its name beside
/// it. Throws Error where it ends in none of .mp4, .apng and .png, or is nothing that VideoWriter may write (a pipe, a device): for a
/// program to ask before long work. Nothing is opened.
inline std::filesystem::path video_path(std::filesystem::path path) {
  std::string const name = path.string();
  auto const ending = path.extension();
  if (ending != ".mp4" && ending != ".apng" && ending != ".png")
    detail::fail(name, "", "is a video by no ending that is known; let it end in .mp4, or in .apng or .png for an animated PNG");
  if (ending == ".mp4" && find_ffmpeg().empty()) path.replace_extension(".apng");
  if (detail::output_target(path).direct)
    detail::fail(path.string(), "", "is a pipe or a device, and a video is written back and forth; name a file");
  return path;
}

/// Frames as a video, one after the other, none kept: an mp4 (H.264, 4:2:0, BT.709) by the program ffmpeg of PATH, which gets them through
/// a pipe, or an animated PNG where the name ends in .apng or .png. Where it ends in .mp4 and there is no ffmpeg, the animated PNG of that
/// name is written beside it, and `note` says so. The file appears when all is done (AtomicFile); what is not finished leaves nothing.
/// All members throw Error where the file cannot be written or ffmpeg ends too early: how it ended and its last line are in the sentence.
class VideoWriter {
 public:
  explicit VideoWriter(std::filesystem::path path, VideoOptions options = {})
      : name_(path.string()),
        path_(video_path(std::move(path))),
        options_(options),
        rate_(detail::frame_rate(options.frames_per_second)),
        apng_({.frames_per_second = options.frames_per_second}),
        file_(path_) {
    expects(options.quality >= 0 && options.quality <= 51, "gsp::io::VideoWriter: quality must be 0..51");
    if (path_.extension() == ".mp4") ffmpeg_ = find_ffmpeg();
  }

  /// Adds a frame of channels r g b; all must have the size of the first. mp4 has even sizes: an odd row or column at the end is there
  /// twice. Waits while ffmpeg is busy.
  void write(Bitmap8 const& frame) {
    expect_bitmap(frame, "gsp::io::VideoWriter::write");
    expects(frame.channels == 3, "gsp::io::VideoWriter::write: a frame has 3 channels, r g b");
    expects(open_, "gsp::io::VideoWriter::write: the video is finished, or has failed");
    expects(count_ == 0 || (frame.width == width_ && frame.height == height_),
            "gsp::io::VideoWriter::write: the frame differs in size from the first");
    width_ = frame.width;
    height_ = frame.height;
    if (ffmpeg_.empty()) {
      apng_.add(frame);
      if (count_ == 0) file_.write(apng_.head());
      file_.write(apng_.take());
    } else {
      if (count_ == 0) program_.emplace(ffmpeg_, words());
      std::vector<std::uint8_t> const more = width_ % 2 == 0 && height_ % 2 == 0 ? std::vector<std::uint8_t>() : padded(frame);
      if (!program_->write(std::as_bytes(std::span(more.empty() ? frame.pixels : more)))) fail(program_->finish());
    }
    ++count_;
  }

  /// Waits until all is written, and gives the file its name. There must be a frame.
  void finish() {
    expects(count_ > 0, "gsp::io::VideoWriter::finish: there are no frames; write one");
    expects(open_, "gsp::io::VideoWriter::finish: the video is finished, or has failed");
    if (program_) {
      if (auto const how = program_->finish(); !how.empty()) fail(how);
      std::error_code error;
      if (!(std::filesystem::file_size(file_.temporary(), error) > 0) || error) fail("ended well, but wrote nothing");
    } else {
      file_.write(apng_.tail());
      file_.write_at_start(apng_.head());
    }
    open_ = false;
    file_.commit();
  }

  /// What is written: the path that was asked for, or the animated PNG in its place.
  std::filesystem::path const& path() const { return path_; }
  /// One sentence where there is no ffmpeg for the mp4 that was asked for: what is written instead, and what to do for mp4. Else empty.
  std::string note() const {
    if (path_.string() == name_) return {};
    return name_ + ": there is no ffmpeg in PATH, so the video is " + path_.string() +
           ", an animated PNG, which browsers play; for mp4 install ffmpeg (Debian, Ubuntu: apt-get install ffmpeg)";
  }

 private:
  std::vector<std::string> words() const {
    auto const even = [](int size) { return std::to_string(size + size % 2); };
    return {"-hide_banner", "-loglevel", "error", "-nostdin", "-y",
            // what comes; a disk that is full at the last bytes is a failure
            "-xerror", "-f", "rawvideo", "-pix_fmt", "rgb24", "-s", even(width_) + "x" + even(height_), "-r",
            std::to_string(rate_.frames) + "/" + std::to_string(rate_.seconds), "-i", "-",
            // what becomes of it; players take colours for what the file says that they are
            "-an", "-vf", "scale=out_color_matrix=bt709:out_range=tv:flags=accurate_rnd+full_chroma_int+full_chroma_inp", "-c:v", "libx264",
            "-crf", std::to_string(options_.quality), "-pix_fmt", "yuv420p", "-colorspace", "bt709", "-color_primaries", "bt709",
            "-color_trc", "bt709", "-color_range", "tv", "-movflags", "+faststart", "-f", "mp4", "file:" + file_.temporary().string()};
  }

  /// With the last column and row again where their number is odd.
  static std::vector<std::uint8_t> padded(Bitmap8 const& frame) {
    std::size_t const row = 3 * static_cast<std::size_t>(frame.width);
    std::vector<std::uint8_t> out;
    out.reserve((row + 3) * (static_cast<std::size_t>(frame.height) + 1));
    for (int y = 0; y < frame.height + frame.height % 2; ++y) {
      auto const start = frame.pixels.begin() + static_cast<std::ptrdiff_t>(row) * std::min(y, frame.height - 1);
      out.insert(out.end(), start, start + static_cast<std::ptrdiff_t>(row));
      if (frame.width % 2 == 1)
        out.insert(out.end(), start + static_cast<std::ptrdiff_t>(row) - 3, start + static_cast<std::ptrdiff_t>(row));
    }
    return out;
  }

  [[noreturn]] void fail(std::string const& how) {
    open_ = false;
    detail::fail(name_, "",
                 ffmpeg_.string() + " " + (how.empty() ? "ended before it had all frames" : how) +
                     "; mp4 needs an ffmpeg with libx264 ('ffmpeg -encoders' lists it) and room on the disk, a name that ends in .apng "
                     "neither");
  }

  std::string name_;
  std::filesystem::path path_;
  VideoOptions options_;
  detail::FrameRate rate_;
  ApngWriter apng_;
  AtomicFile file_;
  std::filesystem::path ffmpeg_;            // empty: an animated PNG
  std::optional<detail::Program> program_;  // ends before the file that it writes
  int width_ = 0, height_ = 0;
  std::size_t count_ = 0;
  bool open_ = true;
};

}  // namespace gsp::io
