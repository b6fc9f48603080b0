#pragma once
#include <unistd.h>

#include <cstdio>
#include <string>

namespace gsp_cli {

/// A bar on stderr, redrawn in place where stderr is a terminal; elsewhere one line when it is done.
class Progress {
 public:
  explicit Progress(std::string what) : what_(std::move(what)), terminal_(isatty(2)) { show(0); }
  ~Progress() {
    if (!done_ && terminal_) std::fputc('\n', stderr);
  }
  void show(double part) {
    int const filled = static_cast<int>(part * width);
    if (!terminal_ || filled == filled_) return;
    filled_ = filled;
    std::fprintf(stderr, "\r%-34s [%s%s] %3d %%", what_.c_str(), std::string(static_cast<std::size_t>(filled), '#').c_str(),
                 std::string(static_cast<std::size_t>(width - filled), ' ').c_str(), static_cast<int>(100 * part));
  }
  /// The end; `result` stands where the bar was.
  void finish(std::string const& result) {
    done_ = true;
    std::fprintf(stderr, terminal_ ? "\r%-34s %-50s\n" : "%-34s %s\n", what_.c_str(), result.c_str());
  }

 private:
  static constexpr int width = 40;
  std::string what_;
  bool terminal_, done_ = false;
  int filled_ = -1;
};

}  // namespace gsp_cli
