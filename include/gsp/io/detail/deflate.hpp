#pragma once
#include <zlib.h>

#include <algorithm>
#include <gsp/io/detail/bytes.hpp>
#include <vector>

namespace gsp::io::detail {

enum class Wrapper { raw, zlib, gzip };  // zip entries, PNG, .spz

inline int window_bits(Wrapper w) { return w == Wrapper::raw ? -15 : w == Wrapper::zlib ? 15 : 31; }

/// No deflate stream grows by more than this when unpacked (258 bytes from 2 bits): the test that a size announced
/// by a header can be true, before memory is taken for it.
inline bool can_inflate_to(std::uint64_t packed, std::uint64_t unpacked) { return unpacked / 1032 <= packed; }

/// Reads a deflate stream piece by piece. Throws Error where the stream is damaged.
class Inflater {
 public:
  Inflater(Bytes packed, Wrapper wrapper, std::string name) : packed_(packed), name_(std::move(name)) {
    if (inflateInit2(&stream_, window_bits(wrapper)) != Z_OK) throw Error(name_ + ": zlib cannot start; is memory short?");
  }
  Inflater(Inflater const&) = delete;
  Inflater& operator=(Inflater const&) = delete;
  ~Inflater() { inflateEnd(&stream_); }

  /// Fills `out` as far as the stream goes, returns the number of bytes: fewer than asked means that the stream ended or was cut short.
  std::size_t read(std::span<std::byte> out) {
    std::size_t done = 0;
    while (done < out.size() && !ended_) {
      if (stream_.avail_in == 0) {
        stream_.avail_in = static_cast<uInt>(std::min<std::size_t>(packed_.size() - used_, 1u << 30));
        stream_.next_in = reinterpret_cast<Bytef*>(const_cast<std::byte*>(packed_.data() + used_));
        used_ += stream_.avail_in;
      }
      uInt const want = static_cast<uInt>(std::min<std::size_t>(out.size() - done, 1u << 30));
      stream_.next_out = reinterpret_cast<Bytef*>(out.data() + done);
      stream_.avail_out = want;
      int const rc = ::inflate(&stream_, Z_NO_FLUSH);
      done += want - stream_.avail_out;
      if (rc == Z_STREAM_END)
        ended_ = true;
      else if (rc == Z_BUF_ERROR || (rc == Z_OK && stream_.avail_in == 0 && used_ == packed_.size() && stream_.avail_out > 0))
        break;  // cut short
      else if (rc != Z_OK)
        fail(name_, at_byte(used_ - stream_.avail_in), "the compressed data is damaged; fetch the file again");
    }
    return done;
  }
  /// At most `limit` bytes; memory grows with what really comes, never with what a header promises.
  std::vector<std::byte> read_up_to(std::size_t limit) {
    std::vector<std::byte> out;
    while (out.size() < limit) {
      std::size_t const old = out.size(), next = std::min(limit, std::max<std::size_t>(2 * old, 1u << 16));
      out.resize(next);
      std::size_t const got = read(std::span(out).subspan(old));
      out.resize(old + got);
      if (old + got < next) break;
    }
    return out;
  }
  /// True when nothing follows: reaches the end mark and has checked the stream's own checksum.
  bool at_end() {
    std::byte extra;
    return read(std::span(&extra, 1)) == 0 && ended_;
  }
  bool ended() const { return ended_; }

 private:
  Bytes packed_;
  std::string name_;
  z_stream stream_{};
  std::size_t used_ = 0;
  bool ended_ = false;
};

/// Packs pieces one after another, handing the packed bytes to `sink(Bytes)`. The same input gives the same bytes (one zlib version).
template <class Sink>
class Deflater {
 public:
  Deflater(Wrapper wrapper, int level, Sink sink) : sink_(std::move(sink)), buffer_(1u << 16) {
    if (deflateInit2(&stream_, level, Z_DEFLATED, window_bits(wrapper), 8, Z_DEFAULT_STRATEGY) != Z_OK)
      throw Error("gsp::io: zlib cannot start; is memory short?");
  }
  Deflater(Deflater const&) = delete;
  Deflater& operator=(Deflater const&) = delete;
  ~Deflater() { deflateEnd(&stream_); }
  void write(Bytes bytes) {
    while (!bytes.empty()) {
      auto const piece = bytes.first(std::min<std::size_t>(bytes.size(), 1u << 30));
      run(piece, Z_NO_FLUSH);
      bytes = bytes.subspan(piece.size());
    }
  }
  void finish() { run({}, Z_FINISH); }

 private:
  void run(Bytes piece, int flush) {
    stream_.next_in = reinterpret_cast<Bytef*>(const_cast<std::byte*>(piece.data()));
    stream_.avail_in = static_cast<uInt>(piece.size());
    do {
      stream_.next_out = reinterpret_cast<Bytef*>(buffer_.data());
      stream_.avail_out = static_cast<uInt>(buffer_.size());
      ::deflate(&stream_, flush);
      sink_(Bytes(buffer_.data(), buffer_.size() - stream_.avail_out));
    } while (stream_.avail_out == 0);
  }
  Sink sink_;
  std::vector<std::byte> buffer_;
  z_stream stream_{};
};

inline std::vector<std::byte> deflate(Bytes bytes, Wrapper wrapper, int level = 6) {
  std::vector<std::byte> out;
  Deflater deflater(wrapper, level, [&](Bytes packed) { out.insert(out.end(), packed.begin(), packed.end()); });
  deflater.write(bytes);
  deflater.finish();
  return out;
}

inline std::uint32_t crc32(Bytes bytes, std::uint32_t start = 0) {
  if (bytes.empty()) return start;  // zlib begins anew at a null pointer
  return static_cast<std::uint32_t>(::crc32_z(start, reinterpret_cast<Bytef const*>(bytes.data()), bytes.size()));
}

}  // namespace gsp::io::detail
