// Videos: what ffmpeg is given (a script in its place writes it down), what is said and left where it is missing, fails or is killed; and,
// where a real one is there, the frames that come back.
#include <doctest/doctest.h>
#include <sys/stat.h>
#include <sys/wait.h>

#include <cmath>
#include <gsp/io/png.hpp>
#include <gsp/io/video.hpp>
#include <io/fixtures.hpp>
#include <numeric>
#include <support/skip.hpp>
#include <thread>

using namespace gsp::io;
using namespace gsp_test;
namespace fs = std::filesystem;

namespace {

/// PATH as it was, at the end of the scope.
struct Path {
  std::string before = std::getenv("PATH");
  explicit Path(fs::path const& now) { ::setenv("PATH", now.c_str(), 1); }
  ~Path() { ::setenv("PATH", before.c_str(), 1); }
};

/// A folder for PATH with a program `ffmpeg` of these lines of shell; $out is the file that it is to write, $here the folder.
struct Fake {
  Folder folder;
  Path path{folder.path};
  explicit Fake(std::string const& lines) {
    auto const program = folder.path / "ffmpeg";
    write_file(program, bytes_of("#!/bin/sh\nPATH=/usr/bin:/bin\nhere=$(dirname \"$0\")\nfor out; do :; done\nout=${out#file:}\n" + lines));
    fs::permissions(program, fs::perms::owner_all);
  }
  std::vector<std::string> lines(char const* name) const {
    std::string const text(detail::as_text(read_file(folder.path / name)));
    std::vector<std::string> out;
    for (std::size_t at = 0, end; (end = text.find('\n', at)) != text.npos; at = end + 1) out.push_back(text.substr(at, end - at));
    return out;
  }
};
char const* const records = "for a; do echo \"$a\"; done > \"$here/arguments\"\ncat > \"$here/stdin\"\necho video > \"$out\"\n";

/// Smooth colours that move, as renderings have them: coded video is not for noise.
Bitmap8 frame_of(int t, int width = 64, int height = 48) {
  auto out = make_bitmap<std::uint8_t>(width, height, 3);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      double const color[3] = {std::sin(0.1 * (x + 2 * t)), std::cos(0.13 * y - 0.2 * t), std::sin(0.05 * (x + y))};
      for (int c = 0; c < 3; ++c)
        out.pixels[(static_cast<std::size_t>(y) * width + x) * 3 + c] = static_cast<std::uint8_t>(127.5 + 120 * color[c]);
    }
  return out;
}

bool has(std::vector<std::string> const& words, std::string const& option, std::string const& value) {
  for (std::size_t i = 0; i + 1 < words.size(); ++i)
    if (words[i] == option && words[i + 1] == value) return true;
  return false;
}

std::string video_error(fs::path const& path, int frames) {
  return error_of([&] {
    VideoWriter video(path);
    for (int t = 0; t < frames; ++t) video.write(frame_of(t, 640, 480));
    video.finish();
  });
}

}  // namespace

TEST_CASE("video: ffmpeg gets every frame, its size and rate, and a name that no shell reads") {
  Fake const fake(records);
  Folder folder;
  auto const path = folder.path / "a 'b' $(touch c)\";.mp4";
  VideoWriter video(path, {.frames_per_second = 100. / 3, .quality = 20});
  std::vector<std::uint8_t> sent;
  for (int t = 0; t < 5; ++t) {
    auto const frame = frame_of(t);
    video.write(frame);
    sent.insert(sent.end(), frame.pixels.begin(), frame.pixels.end());
  }
  CHECK(!fs::exists(path));
  video.finish();
  CHECK(folder.files() == 1);
  CHECK(video.path() == path);
  CHECK(video.note().empty());
  CHECK(read_file(path) == bytes_of("video\n"));
  auto const got = read_file(fake.folder.path / "stdin");
  CHECK(got == std::vector<std::byte>(std::as_bytes(std::span(sent)).begin(), std::as_bytes(std::span(sent)).end()));
  auto const words = fake.lines("arguments");
  CHECK(std::count(words.begin(), words.end(), "-xerror") == 1);  // without, a disk that is full at the end goes unnoticed
  CHECK(has(words, "-f", "rawvideo"));
  CHECK(has(words, "-pix_fmt", "rgb24"));
  CHECK(has(words, "-s", "64x48"));
  CHECK(has(words, "-r", "100/3"));
  CHECK(has(words, "-i", "-"));
  CHECK(has(words, "-c:v", "libx264"));
  CHECK(has(words, "-crf", "20"));
  CHECK(has(words, "-pix_fmt", "yuv420p"));
  CHECK(words.back().starts_with("file:" + path.string() + ".partial-"));
  CHECK_THROWS_AS(video.write(frame_of(0)), std::invalid_argument);
  CHECK_THROWS_AS(video.finish(), std::invalid_argument);
}

TEST_CASE("video: odd sizes have their last row and column twice") {
  Fake const fake(records);
  Folder folder;
  VideoWriter video(folder.path / "a.mp4");
  auto const frame = frame_of(0, 5, 3);
  video.write(frame);
  video.finish();
  CHECK(has(fake.lines("arguments"), "-s", "6x4"));
  auto const got = read_file(fake.folder.path / "stdin");
  REQUIRE(got.size() == 6 * 4 * 3);
  for (int y = 0; y < 4; ++y)
    for (int x = 0; x < 6; ++x)
      for (int c = 0; c < 3; ++c)
        CHECK(std::uint8_t(got[static_cast<std::size_t>(6 * y + x) * 3 + c]) ==
              frame.pixels[static_cast<std::size_t>(5 * std::min(y, 2) + std::min(x, 4)) * 3 + c]);
}

TEST_CASE("video: without ffmpeg an animated PNG stands beside the name, and a sentence says so") {
  Folder empty, folder;
  Path const nowhere(empty.path);
  CHECK(find_ffmpeg().empty());
  auto const frames = {frame_of(0), frame_of(1), frame_of(1), frame_of(2)};
  VideoWriter video(folder.path / "a.mp4", {.frames_per_second = 62.5});
  for (auto const& f : frames) video.write(f);
  video.finish();
  CHECK(video.path() == folder.path / "a.apng");
  CHECK(video_path(folder.path / "a.mp4") == video.path());
  CHECK(says(video.note(), "a.mp4: there is no ffmpeg in PATH"));
  CHECK(says(video.note(), "a.apng"));
  CHECK(says(video.note(), "install"));
  CHECK(folder.files() == 1);
  write_apng(folder.path / "b.png", frames, {.frames_per_second = 62.5});  // written in parts, the same file
  CHECK(read_file(folder.path / "a.apng") == read_file(folder.path / "b.png"));
  CHECK(parse_png8(read_file(video.path()), "first").pixels == frame_of(0).pixels);
  // that was asked for: no sentence, and odd sizes as they are
  VideoWriter asked(folder.path / "c.png");
  asked.write(frame_of(0, 5, 3));
  asked.finish();
  CHECK(asked.note().empty());
  CHECK(read_png8(folder.path / "c.png").width == 5);
}

TEST_CASE("video: an ffmpeg that fails is named with its status and last line, and nothing is left") {
  Folder folder;
  auto const path = folder.path / "a.mp4";
  write_file(path, bytes_of("old"));
  auto const as_it_was = [&] { return folder.files() == 1 && read_file(path) == bytes_of("old"); };
  struct Case {
    char const *lines, *says;
    int frames;
  };
  for (auto const& [lines, wanted, frames] : {
           Case{"echo first >&2\necho \"Unknown encoder 'libx264'\" >&2\nexit 3\n", "ended with exit status 3: Unknown encoder 'libx264';",
                3},
           Case{"cat > \"$out\"\necho 'file: No space left on device' >&2\necho '    Last message repeated 4 times' >&2\necho 'Conversion "
                "failed!' >&2\nexit 1\n",
                "ended with exit status 1: file: No space left on device;", 3},
           Case{"head -c 1000 > \"$out\"\nkill -9 $$\n", "was ended by signal 9;", 3},
           Case{"head -c 1000 > \"$out\"\n", "ended before it had all frames;", 3},
           Case{"cat > /dev/null\n", "ended well, but wrote nothing;", 1},
           Case{"cat > /dev/null\nexit 7\n", "ended with exit status 7;", 1},
           Case{"yes 'an error' | head -c 900000 >&2\ncat > /dev/null\nexit 1\n", "ended with exit status 1: an error;",
                1},  // more than a pipe holds
       }) {
    Fake const fake(lines);
    auto const error = video_error(path, frames);
    INFO(error);
    CHECK(says(error, "a.mp4: "));
    CHECK(says(error, wanted));
    CHECK(says(error, "libx264"));
    CHECK(as_it_was());
  }
  Fake const unfit("");
  write_file(unfit.folder.path / "ffmpeg", bytes_of("#!/nowhere/sh\n"));
  fs::permissions(unfit.folder.path / "ffmpeg", fs::perms::owner_all);
  CHECK(says(video_error(path, 1), "cannot be started"));
  CHECK(as_it_was());
}

TEST_CASE("video: one that is not finished ends its ffmpeg and leaves nothing; signals too") {
  Fake const fake("echo $$ > \"$here/pid\"\nwhile :; do echo more >> \"$out\"; sleep 0.01; done\n");  // makes its file anew if it can
  Folder folder;
  auto const pid_of_fake = [&] {
    for (int i = 0; i < 1000 && (!fs::exists(fake.folder.path / "pid") || fake.lines("pid").empty()); ++i)
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    return std::stoi(fake.lines("pid").at(0));
  };
  {
    VideoWriter video(folder.path / "a.mp4");
    video.write(frame_of(0, 16, 16));
    CHECK(::kill(pid_of_fake(), 0) == 0);
  }
  CHECK(::kill(pid_of_fake(), 0) != 0);
  CHECK(folder.files() == 0);
  fs::remove(fake.folder.path / "pid");
  pid_t const child = ::fork();
  REQUIRE(child >= 0);
  if (child == 0) {
    VideoWriter video(folder.path / "a.mp4");
    video.write(frame_of(0, 16, 16));
    (void)pid_of_fake();
    std::thread([] { discard_unfinished_files(); }).join();
    ::_exit(0);
  }
  int status = 0;
  REQUIRE(::waitpid(child, &status, 0) == child);
  CHECK(WIFEXITED(status));
  std::this_thread::sleep_for(std::chrono::milliseconds(100));  // time for what lives to make its file anew
  CHECK(folder.files() == 0);
}

TEST_CASE("video: what makes none is refused") {
  Folder folder;
  CHECK(says(error_of([&] { VideoWriter(folder.path / "a.avi"); }), "let it end in .mp4"));
  CHECK(says(error_of([&] { VideoWriter(folder.path / "no" / "a.mp4"); }), "create it first"));
  REQUIRE(::mkfifo((folder.path / "pipe.png").c_str(), 0600) == 0);
  CHECK(says(error_of([&] { VideoWriter(folder.path / "pipe.png"); }), "name a file"));
  CHECK_THROWS_AS(VideoWriter(folder.path / "a.png", {.frames_per_second = 0}), std::invalid_argument);
  CHECK_THROWS_AS(VideoWriter(folder.path / "a.png", {.quality = 52}), std::invalid_argument);
  VideoWriter video(folder.path / "a.png");
  CHECK_THROWS_AS(video.finish(), std::invalid_argument);
  CHECK_THROWS_AS(video.write(make_bitmap<std::uint8_t>(4, 4, 1)), std::invalid_argument);
  video.write(frame_of(0));
  CHECK_THROWS_AS(video.write(frame_of(0, 4, 4)), std::invalid_argument);
}

TEST_CASE("video: rates are the nearest fractions") {
  auto const is = [](double rate, int frames, int seconds) {
    auto const r = detail::frame_rate(rate);
    return r.frames == frames && r.seconds == seconds;
  };
  CHECK(is(25, 25, 1));
  CHECK(is(1 / (0.3 - 0.26), 25, 1));  // times are rounded
  CHECK(is(100. / 3, 100, 3));
  CHECK(is(30000. / 1001, 30000, 1001));
  CHECK(is(0.001, 1, 1000));
  CHECK(is(1000, 1000, 1));
}

// 35 dB: what is hardly told from the frames. Measured at 25 frames a second, quality 16: above 39 dB, where the colours' resolution
// and rounding alone leave 49. (ffmpeg's quick way back to rgb, without these flags, is 35 dB at best.)
TEST_CASE("video: what a real ffmpeg has coded comes back, every frame of it" * doctest::test_suite("data")) {
  if (find_ffmpeg().empty()) return gsp_test::skip("there is no ffmpeg in PATH");
  Folder folder;
  auto const path = folder.path / "a.mp4";
  int const frames = 100, width = 161, height = 119;
  VideoWriter video(path, {.frames_per_second = 25});
  for (int t = 0; t < frames; ++t) video.write(frame_of(t, width, height));
  auto const error = error_of([&] { video.finish(); });
  if (says(error, "libx264'")) return gsp_test::skip("this ffmpeg is without libx264");
  REQUIRE(error == "");
  CHECK(folder.files() == 1);
  std::string const command =
      "ffmpeg -v error -i '" + path.string() + "' -vf scale=flags=bicubic+accurate_rnd+full_chroma_int -f rawvideo -pix_fmt rgb24 -";
  std::string got;
  FILE* const pipe = popen(command.c_str(), "r");
  REQUIRE(pipe);
  char buffer[65536];
  for (std::size_t n; (n = std::fread(buffer, 1, sizeof buffer, pipe)) > 0;) got.append(buffer, n);
  CHECK(pclose(pipe) == 0);
  std::size_t const row = static_cast<std::size_t>(width + 1) * 3, size = row * (height + 1);
  REQUIRE(got.size() == size * frames);
  for (int t = 0; t < frames; ++t) {
    auto const frame = frame_of(t, width, height);
    double sum = 0;
    for (int y = 0; y < height; ++y)
      for (int i = 0; i < 3 * width; ++i) {
        auto const there = static_cast<std::uint8_t>(got[size * static_cast<std::size_t>(t) + row * static_cast<std::size_t>(y) + i]);
        double const off = double(there) - frame.pixels[static_cast<std::size_t>(y) * 3 * width + i];
        sum += off * off;
      }
    CHECK(10 * std::log10(255 * 255 / (sum / (3. * width * height))) > 35);
  }
}
