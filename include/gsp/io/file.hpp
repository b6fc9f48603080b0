#pragma once
#include <fcntl.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <gsp/io/detail/bytes.hpp>
#include <memory>
#include <mutex>
#include <set>
#include <string>
#include <string_view>
#include <system_error>
#include <vector>

namespace gsp::io {

/// Does a file's name end so, in small letters or capitals (of ASCII)?
inline bool has_ending(std::string const& path, std::string_view ending) {
  auto const small = [](char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c; };
  return path.size() >= ending.size() && std::equal(ending.begin(), ending.end(), path.end() - static_cast<std::ptrdiff_t>(ending.size()),
                                                    [&](char a, char b) { return small(a) == small(b); });
}

/// The whole file. Throws Error where it is missing, not a regular file, or cannot be read to its end.
inline std::vector<std::byte> read_file(std::filesystem::path const& path) {
  std::string const name = path.string();
  std::error_code error;
  auto const status = std::filesystem::status(path, error);
  if (status.type() == std::filesystem::file_type::not_found) detail::fail(name, "", "there is no such file; check the path");
  if (!std::filesystem::is_regular_file(status)) detail::fail(name, "", "is not a regular file; name a file");
  auto const size = std::filesystem::file_size(path, error);
  std::ifstream in(path, std::ios::binary);
  if (error || !in) detail::fail(name, "", "cannot be opened; check its permissions");
  std::vector<std::byte> bytes(size);
  in.read(reinterpret_cast<char*>(bytes.data()), static_cast<std::streamsize>(size));
  if (static_cast<std::uintmax_t>(in.gcount()) != size)
    detail::fail(name, detail::at_byte(in.gcount()), "cannot be read further; check the disk");
  return bytes;
}

namespace detail {

/// Temporary files of this process that are not finished yet. Never destroyed: a thread may outlive `main`.
struct UnfinishedFiles {
  std::mutex mutex;
  std::set<std::filesystem::path> paths;
  std::set<::pid_t> programs;  // that write some of them, and were not waited for yet
  unsigned count = 0;          // of all so far: no two have one name
};
inline UnfinishedFiles& unfinished_files() {
  static auto* const files = new UnfinishedFiles;
  return *files;
}

/// Where output that is called `path` goes.
struct OutputTarget {
  std::filesystem::path path;                                            // behind all symbolic links
  bool direct = false;                                                   // no regular file: it is opened and written, never replaced
  std::filesystem::perms permissions = std::filesystem::perms::unknown;  // of the file that is there
};

/// A file's name and, where that is a symbolic link, those that it leads to, in turn; at most 41, which a circle has, and a last link that
/// cannot be followed stays the last.
inline std::vector<std::filesystem::path> names_of_file(std::filesystem::path const& path) {
  namespace fs = std::filesystem;
  std::error_code error;
  std::vector<fs::path> names{path};
  while (names.size() <= 40 && fs::is_symlink(fs::symlink_status(names.back(), error))) {
    auto const next = fs::read_symlink(names.back(), error);
    if (error) break;
    names.push_back(names.back().parent_path() / next);  // an absolute `next` stands for itself
  }
  return names;
}

inline OutputTarget output_target(std::filesystem::path const& path) {
  namespace fs = std::filesystem;
  std::error_code error;
  auto const status = fs::status(path, error);  // follows symbolic links, the kernel's own (/dev/stdout) too
  std::string const name = path.string();
  if (status.type() == fs::file_type::directory) fail(name, "", "is a folder; name a file");
  if (status.type() == fs::file_type::block) fail(name, "", "is a disk; name a file");
  if (status.type() == fs::file_type::socket) fail(name, "", "is a socket; name a file or a pipe");
  if (status.type() == fs::file_type::character || status.type() == fs::file_type::fifo) return {path, true};
  auto const names = names_of_file(path);
  for (auto const& at : names) {
    auto const folder = at.parent_path();
    // an open file of a process (/dev/stdout > f): it is not replaced either, others hold it
    if (fs::is_symlink(fs::symlink_status(at, error)) && folder.filename() == "fd" && folder.string().starts_with("/proc/"))
      return {path, true};
  }
  OutputTarget target{names.back()};
  if (fs::is_symlink(fs::symlink_status(target.path, error)))
    fail(name, "",
         names.size() > 40 ? "is a circle of symbolic links; name a file" : "is a symbolic link that cannot be followed; name a file");
  auto const folder = target.path.has_parent_path() ? target.path.parent_path() : fs::path(".");
  if (!fs::is_directory(folder, error)) fail(name, "", "its folder does not exist; create it first");
  if (!fs::exists(status)) return target;
  if (::access(target.path.c_str(), W_OK) != 0) fail(name, "", "may not be written; check its permissions");
  target.permissions = status.permissions();
  return target;
}

}  // namespace detail

/// Throws Error unless `path` is something that AtomicFile may write; for a program to ask before long work. Nothing is opened.
inline void expect_writable(std::filesystem::path const& path) { (void)detail::output_target(path); }

/// Removes what unfinished files have written, and lets no file of this process be finished any more: for a program that is about to end
/// because a signal says so. Programs that write such files (VideoWriter) are killed first. From any thread, but not from a signal handler.
inline void discard_unfinished_files() {
  auto& files = detail::unfinished_files();
  files.mutex.lock();  // for good
  for (::pid_t const program : files.programs) {
    ::kill(-program, SIGKILL);  // its group (Program)
    ::siginfo_t end{};
    ::waitid(P_PID, static_cast<::id_t>(program), &end, WEXITED | WNOWAIT);  // a dead program makes no file anew
  }
  std::error_code error;
  for (auto const& path : files.paths) std::filesystem::remove(path, error);
}

/// A file that appears under its name only when it is complete: written under a temporary name beside it, renamed by `commit`, removed when
/// it goes out of scope without. Symbolic links are followed, and the permissions of a file that is replaced are kept. A pipe or a device
/// is never replaced: its bytes go there as they come. Throws Error where the folder is missing or the disk is full.
class AtomicFile {
 public:
  explicit AtomicFile(std::filesystem::path path) : path_(std::move(path)), target_(detail::output_target(path_)) {
    if (target_.direct) {
      open(path_, O_APPEND);
      return;
    }
    {
      auto& files = detail::unfinished_files();
      std::lock_guard const lock(files.mutex);
      temporary_ = target_.path;
      temporary_ += ".partial-" + std::to_string(::getpid()) + "-" + std::to_string(files.count++);
      files.paths.insert(temporary_);
    }
    try {
      open(temporary_, O_CREAT | O_TRUNC);
    } catch (...) {
      forget();
      throw;
    }
    std::error_code error;  // permissions that cannot be kept are no reason to fail
    if (target_.permissions != std::filesystem::perms::unknown) std::filesystem::permissions(temporary_, target_.permissions, error);
  }
  AtomicFile(AtomicFile const&) = delete;
  AtomicFile& operator=(AtomicFile const&) = delete;
  ~AtomicFile() {
    if (temporary_.empty()) return;
    out_.reset();
    std::error_code error;
    std::filesystem::remove(temporary_, error);
    forget();
  }

  void write(Bytes bytes) {
    if (std::fwrite(bytes.data(), 1, bytes.size(), out_.get()) != bytes.size())
      detail::fail(path_.string(), "", "cannot be written further; is the disk full?");
  }
  void write(std::string_view text) { write(detail::as_bytes(text)); }

  /// Writes over what stands at the start. Not for pipes and devices.
  void write_at_start(Bytes bytes) {
    if (std::fseek(out_.get(), 0, SEEK_SET) != 0) detail::fail(path_.string(), "", "cannot be written from its start; name a file");
    write(bytes);
  }

  /// The temporary file, for another program to write until `commit`; empty for a pipe or a device.
  std::filesystem::path const& temporary() const { return temporary_; }

  void commit() {
    if (std::fclose(out_.release()) != 0) detail::fail(path_.string(), "", "cannot be written to its end; is the disk full?");
    if (target_.direct) return;
    auto& files = detail::unfinished_files();
    std::lock_guard const lock(files.mutex);
    std::error_code error;
    std::filesystem::rename(temporary_, target_.path, error);
    if (error)
      detail::fail(path_.string(), "", "cannot take its final name (" + error.message() + "); check the permissions of its folder");
    files.paths.erase(temporary_);
    temporary_.clear();
  }

 private:
  struct Close {
    void operator()(std::FILE* file) const { std::fclose(file); }
  };
  void open(std::filesystem::path const& path, int flags) {
    int const descriptor = ::open(path.c_str(), O_WRONLY | O_CLOEXEC | flags, 0666);
    if (descriptor >= 0) out_.reset(::fdopen(descriptor, "wb"));
    if (!out_) detail::fail(path_.string(), "", "cannot be written; check its permissions and those of its folder");
  }
  void forget() {
    auto& files = detail::unfinished_files();
    std::lock_guard const lock(files.mutex);
    files.paths.erase(temporary_);
  }

  std::filesystem::path path_;
  detail::OutputTarget target_;
  std::filesystem::path temporary_;  // empty: there is none (any more)
  std::unique_ptr<std::FILE, Close> out_;
};

/// Writes `bytes` under `path`, all or nothing.
inline void write_file(std::filesystem::path const& path, Bytes bytes) {
  AtomicFile file(path);
  file.write(bytes);
  file.commit();
}

}  // namespace gsp::io
