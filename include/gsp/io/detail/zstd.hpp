#pragma once
#include <gsp/io/detail/bytes.hpp>
#include <vector>
#if defined(GSP_WITH_ZSTD)
#include <zstd.h>
#endif

namespace gsp::io::detail {

#if defined(GSP_WITH_ZSTD)

/// Fills `out` from a zstd stream that unpacks to exactly its size; false where it does not, or is damaged. Takes no memory by what the
/// stream says of itself.
inline bool zstd_unpack(Bytes packed, std::span<std::byte> out, std::string const&) {
  std::size_t const size = ZSTD_decompress(out.data(), out.size(), packed.data(), packed.size());
  return !ZSTD_isError(size) && size == out.size();
}

inline std::vector<std::byte> zstd_pack(Bytes bytes, int level, std::string const& name) {
  std::vector<std::byte> out(ZSTD_compressBound(bytes.size()));
  std::size_t const size = ZSTD_compress(out.data(), out.size(), bytes.data(), bytes.size(), level);
  if (ZSTD_isError(size)) fail(name, "", "zstd cannot pack " + std::to_string(bytes.size()) + " bytes; is memory short?");
  out.resize(size);
  return out;
}

#else

[[noreturn]] inline void no_zstd(std::string const& name) {
  fail(name, "",
       ".spz version 4 needs zstd, which this gsp was compiled without; install it (libzstd-dev) and compile gsp again, or use version 3");
}
inline bool zstd_unpack(Bytes, std::span<std::byte>, std::string const& name) { no_zstd(name); }
inline std::vector<std::byte> zstd_pack(Bytes, int, std::string const& name) { no_zstd(name); }

#endif

}  // namespace gsp::io::detail
