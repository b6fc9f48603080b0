#pragma once
#include <gsp/io/detail/bytes.hpp>
#include <vector>
#if defined(GSP_WITH_WEBP)
#include <webp/decode.h>
#include <webp/encode.h>
#endif

namespace gsp::io::detail {

/// Pixels of 4 bytes, r g b a, row by row.
struct Pixels {
  std::uint64_t width = 0, height = 0;
  std::vector<std::uint8_t> rgba;
  std::uint64_t count() const { return width * height; }
};

#if defined(GSP_WITH_WEBP)

/// A lossless WebP. `fits(width, height)` is asked before memory is taken, and throws where the size cannot be.
template <class Fits>
Pixels parse_webp(Bytes bytes, std::string const& name, Fits const& fits) {
  auto const* const data = reinterpret_cast<std::uint8_t const*>(bytes.data());
  WebPBitstreamFeatures features;
  if (WebPGetFeatures(data, bytes.size(), &features) != VP8_STATUS_OK)
    fail(name, at_byte(0), "is no WebP picture, or cut short; fetch the file again");
  if (features.has_animation) fail(name, "", "is an animation; SOG needs a single picture");
  if (features.format != 2) fail(name, "", "is lossy, and its pixels are numbers; write it as lossless WebP");
  Pixels p{static_cast<std::uint64_t>(features.width), static_cast<std::uint64_t>(features.height), {}};
  fits(p.width, p.height);
  p.rgba.resize(4 * p.count());
  if (!WebPDecodeRGBAInto(data, bytes.size(), p.rgba.data(), p.rgba.size(), 4 * features.width))
    fail(name, "", "the picture is damaged or cut short; fetch the file again");
  return p;
}

/// Lossless, and exact where alpha is 0. The same picture gives the same bytes (one version of libwebp).
inline std::vector<std::byte> format_webp(Pixels const& p, std::string const& name) {
  WebPConfig config;
  WebPPicture picture;
  bool good = WebPConfigInit(&config) && WebPConfigLosslessPreset(&config, 4) && WebPPictureInit(&picture);
  if (!good) fail(name, "", "libwebp cannot start; is it of another version than its headers?");
  config.exact = 1;
  picture.use_argb = 1;
  picture.width = static_cast<int>(p.width);
  picture.height = static_cast<int>(p.height);
  WebPMemoryWriter writer;
  WebPMemoryWriterInit(&writer);
  picture.writer = WebPMemoryWrite;
  picture.custom_ptr = &writer;
  good = WebPPictureImportRGBA(&picture, p.rgba.data(), static_cast<int>(4 * p.width)) && WebPEncode(&config, &picture);
  std::vector<std::byte> out;
  if (good) {
    auto const* const from = reinterpret_cast<std::byte const*>(writer.mem);
    out.assign(from, from + writer.size);
  }
  WebPPictureFree(&picture);
  WebPMemoryWriterClear(&writer);
  if (!good)
    fail(name, "", "libwebp cannot pack a picture of " + std::to_string(p.width) + " x " + std::to_string(p.height) + "; is memory short?");
  return out;
}

#else

[[noreturn]] inline void no_webp(std::string const& name) {
  fail(name, "",
       "SOG needs libwebp, which this gsp was compiled without; install it (libwebp-dev) and compile gsp again, or convert the file to "
       ".ply");
}
template <class Fits>
Pixels parse_webp(Bytes, std::string const& name, Fits const&) {
  no_webp(name);
}
inline std::vector<std::byte> format_webp(Pixels const&, std::string const& name) { no_webp(name); }

#endif

}  // namespace gsp::io::detail
