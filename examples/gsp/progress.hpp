#pragma once
#include <unistd.h>

#include <chrono>
#include <cstdio>
#include <string>

namespace gsp_cli {

/// A bar on stderr, redrawn in place up to ten times a second, where stderr is a terminal; elsewhere, and where `quiet`, nothing.
class Progress {
 public:
  Progress(std::string what, bool quiet) : what_(std::move(what)), shown_(!quiet && isatty(2) != 0) { draw(0); }
  ~Progress() {
    if (shown_ && !done_) std::fputs("\r\033[K", stderr);
  }
  bool shown() const { return shown_; }
  void show(double part) {
    if (shown_ && Clock::now() - last_ >= std::chrono::milliseconds(100)) draw(part);
  }
  /// The end; `result` stands where the bar was, nothing where it is empty.
  void finish(std::string const& result = {}) {
    done_ = true;
    if (!shown_) return;
    std::fputs("\r\033[K", stderr);
    if (!result.empty()) std::fprintf(stderr, "%-34s %s\n", what_.c_str(), result.c_str());
  }

 private:
  using Clock = std::chrono::steady_clock;
  void draw(double part) {
    if (!shown_) return;
    last_ = Clock::now();
    int const filled = static_cast<int>(part * width);
    std::fprintf(stderr, "\r%-34s [%s%s] %3d %%", what_.c_str(), std::string(static_cast<std::size_t>(filled), '#').c_str(),
                 std::string(static_cast<std::size_t>(width - filled), ' ').c_str(), static_cast<int>(100 * part));
  }

  static constexpr int width = 40;
  std::string what_;
  bool shown_;
  bool done_ = false;
  Clock::time_point last_;
};

}  // namespace gsp_cli
