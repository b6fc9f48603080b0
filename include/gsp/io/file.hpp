#pragma once
#include <unistd.h>

#include <atomic>
#include <filesystem>
#include <fstream>
#include <gsp/io/detail/bytes.hpp>
#include <string>
#include <system_error>
#include <vector>

namespace gsp::io {

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

/// A file that appears under its name only when it is complete: written under a temporary name in the same folder, renamed by
/// `commit`, removed when it goes out of scope without. Throws Error where the folder is missing or the disk is full.
class AtomicFile {
 public:
  explicit AtomicFile(std::filesystem::path path) : path_(std::move(path)) {
    static std::atomic<unsigned> counter{0};
    std::error_code error;
    if (std::filesystem::is_directory(path_, error)) detail::fail(path_.string(), "", "is a folder; name a file");
    auto const folder = path_.has_parent_path() ? path_.parent_path() : std::filesystem::path(".");
    if (!std::filesystem::is_directory(folder, error)) detail::fail(path_.string(), "", "its folder does not exist; create it first");
    temporary_ = path_;
    temporary_ += ".partial-" + std::to_string(::getpid()) + "-" + std::to_string(counter++);
    out_.open(temporary_, std::ios::binary | std::ios::trunc);
    if (!out_) detail::fail(path_.string(), "", "cannot be written; check the permissions of its folder");
  }
  AtomicFile(AtomicFile const&) = delete;
  AtomicFile& operator=(AtomicFile const&) = delete;
  ~AtomicFile() {
    if (committed_) return;
    out_.close();
    std::error_code error;
    std::filesystem::remove(temporary_, error);
  }

  void write(Bytes bytes) {
    out_.write(reinterpret_cast<char const*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
    if (!out_) detail::fail(path_.string(), "", "cannot be written further; is the disk full?");
  }
  void write(std::string_view text) { write(detail::as_bytes(text)); }
  /// Where the next `write` goes; used to fill in a header whose numbers are known only later.
  void seek(std::uint64_t offset) { out_.seekp(static_cast<std::streamoff>(offset)); }

  void commit() {
    out_.close();
    if (!out_) detail::fail(path_.string(), "", "cannot be written to its end; is the disk full?");
    std::error_code error;
    std::filesystem::rename(temporary_, path_, error);
    if (error)
      detail::fail(path_.string(), "", "cannot take its final name (" + error.message() + "); check the permissions of its folder");
    committed_ = true;
  }

 private:
  std::filesystem::path path_, temporary_;
  std::ofstream out_;
  bool committed_ = false;
};

/// Writes `bytes` under `path`, all or nothing.
inline void write_file(std::filesystem::path const& path, Bytes bytes) {
  AtomicFile file(path);
  file.write(bytes);
  file.commit();
}

}  // namespace gsp::io
