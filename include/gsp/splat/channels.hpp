#pragma once
#include <concepts>
#include <gsp/math/pack.hpp>
#include <gsp/math/quat.hpp>
#include <gsp/splat/frames.hpp>

/// What a picture shows: a channel says which numbers a Gaussian gives, how a pixel blends them front to back, and where they go.
/// Projection, order, tiles and transmittance are not its business. RGB, expected depth and alpha are channels as those of a user are.
namespace gsp {

/// A Gaussian as an image sees it, before it becomes a splat: what values of a channel may follow from.
template <class Mem>
struct SeenGaussian {
  Gaussians<Mem> const& cloud;
  detail::LinkView const& link;
  Splat const& splat;  // centre, depth, colour, opacity in the picture
  int place;           // in the cloud
  int image, body;
  detail::ImageView const& view;
  float blur;                            // variance that the picture adds in x and y [pixel^2]
  static constexpr bool lensed = false;  // a pinhole sees it, in all pictures of the wave

  /// Index in the sets that `make_gaussians` was given, one set after the other.
  KOKKOS_INLINE_FUNCTION int index() const { return cloud.source(place); }
  /// Centre and standard deviations [m], rotation, in the frame of its body.
  KOKKOS_INLINE_FUNCTION Vec3<float> position() const {
    return {cloud.positions(0, place), cloud.positions(1, place), cloud.positions(2, place)};
  }
  KOKKOS_INLINE_FUNCTION Vec3<float> scale() const { return {cloud.scales(0, place), cloud.scales(1, place), cloud.scales(2, place)}; }
  KOKKOS_INLINE_FUNCTION Quat<float> quat() const {
    return {cloud.quats(0, place), cloud.quats(1, place), cloud.quats(2, place), cloud.quats(3, place)};
  }
  /// Turns the frame of its body into camera axes (x right, y down, z forward).
  KOKKOS_INLINE_FUNCTION Mat3<float> to_camera() const {
    Mat3<float> r;
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) r(i, j) = static_cast<float>(link.m[4 * i + j]);
    return r;
  }
};

/// One Gaussian at a pixel, or at a pack of pixels (P): where it does not count, weight is 0 and left == before.
template <class P>
struct Blend {
  P weight;        // alpha x before: the light that it sends
  P before, left;  // light that comes through to it, and through it
};

namespace detail {
/// Behind a lens: what follows from the rays of pixels is another matter.
template <class Mem>
struct LensedGaussian : SeenGaussian<Mem> {
  static constexpr bool lensed = true;
};

template <class C>
concept ChannelOfSplat = requires(C const c, Splat const s, float* out) {
  c.value(s, out);
};
template <class C>
concept ChannelOfGaussian = requires(C const c, SeenGaussian<Kokkos::HostSpace> const g, float* out) {
  c.value(g, out);
};
template <class C>
concept ChannelStores = requires(C const c, int image, int row, int column, float const* pixel) {
  c.store(image, row, column, pixel);
};
template <class C>
concept ChannelSize = requires {
  requires int(C::size) > 0;
};
}  // namespace detail

/// A picture channel: copyable to the device, with
///   static constexpr int size         numbers of a pixel
///   value(g, float* out) const        the numbers of a Gaussian: of a `Splat` (what every splat carries), or of any SeenGaussian<Mem> (a
///                                     template; then they are stored beside the splats when it is projected, 4 bytes each)
///   store(image, row, column, float const* pixel) const   takes a pixel's numbers: into a view of any type; one that is called `image`,
///                                     of three dimensions or more, must be (images, height, width, ...) as the frames are
/// and, if they are wanted,
///   draw(exec, Frames<Mem> const& frames, RenderOptions const& options, int first, int of) const   a pass of its own behind the others,
///   over
///                                     the lists of bin_tiles; the numbers kept of splat s are frames.wave.values(s x of + first ...).
///                                     MedianDepthChannel (median_depth.hpp) is one
///   blend(P* pixel, float const* value, Blend<P> const& b) const   one Gaussian; else pixel += weight value. Pixels begin with 0.
///                                     P is float or a pack: select(mask, a, b) in place of a branch
///   finish(P* pixel, P const& alpha) const   once, behind the last Gaussian
template <class C>
concept PictureChannel = std::copyable<C> && detail::ChannelSize<C> && detail::ChannelStores<C> &&
    (detail::ChannelOfSplat<C> || detail::ChannelOfGaussian<C>);

/// sum w c on black, not clamped above.
template <class Mem>
struct RgbChannel {
  Kokkos::View<float****, Kokkos::LayoutRight, Mem> image;  // (C, H, W, 3); empty: not wanted
  static constexpr int size = 3;
  KOKKOS_INLINE_FUNCTION void value(Splat const& s, float* out) const {
    out[0] = s.r;
    out[1] = s.g;
    out[2] = s.b;
  }
  KOKKOS_INLINE_FUNCTION void store(int c, int row, int column, float const* pixel) const {
    if (image.extent(0) == 0) return;
    float* const to = &image(c, row, column, 0);
    to[0] = pixel[0];
    to[1] = pixel[1];
    to[2] = pixel[2];
  }
};
/// Expected camera z: sum w z / max(alpha, 1e-10) [m].
template <class Mem>
struct DepthChannel {
  Kokkos::View<float***, Kokkos::LayoutRight, Mem> image;  // (C, H, W); empty: not wanted
  static constexpr int size = 1;
  KOKKOS_INLINE_FUNCTION void value(Splat const& s, float* out) const { out[0] = s.depth; }
  template <class P>
  KOKKOS_INLINE_FUNCTION void finish(P* pixel, P const& alpha) const {
    pixel[0] = pixel[0] / max(alpha, P(1e-10f));
  }
  KOKKOS_INLINE_FUNCTION void store(int c, int row, int column, float const* pixel) const {
    if (image.extent(0) > 0) image(c, row, column) = pixel[0];
  }
};
/// 1 - what is left of the light.
template <class Mem>
struct AlphaChannel {
  Kokkos::View<float***, Kokkos::LayoutRight, Mem> image;  // (C, H, W); empty: not wanted
  static constexpr int size = 1;
  KOKKOS_INLINE_FUNCTION void value(Splat const&, float*) const {}
  template <class P>
  KOKKOS_INLINE_FUNCTION void blend(P*, float const*, Blend<P> const&) const {}
  template <class P>
  KOKKOS_INLINE_FUNCTION void finish(P* pixel, P const& alpha) const {
    pixel[0] = alpha;
  }
  KOKKOS_INLINE_FUNCTION void store(int c, int row, int column, float const* pixel) const {
    if (image.extent(0) > 0) image(c, row, column) = pixel[0];
  }
};

namespace detail {
template <int n, class P>
KOKKOS_FORCEINLINE_FUNCTION void add_weighted(P* pixel, float const* value, P const& weight) {
  if constexpr (n > 0) {
    add_weighted<n - 1>(pixel, value, weight);
    pixel[n - 1] = fma(weight, P(value[n - 1]), pixel[n - 1]);
  }
}

/// Channels one after the other: their numbers of a pixel, and of a splat those that are stored.
template <class... C>
struct ChannelList {
  static constexpr int size = 0, stored = 0;
  template <class Seen>
  KOKKOS_FORCEINLINE_FUNCTION void values(Seen const&, float*) const {}
  template <class P>
  KOKKOS_FORCEINLINE_FUNCTION void blend(P*, Splat const&, float const*, Blend<P> const&) const {}
  template <class P>
  KOKKOS_FORCEINLINE_FUNCTION void finish(P*, P const&) const {}
  KOKKOS_FORCEINLINE_FUNCTION void store(int, int, int, float const*) const {}
};
template <class C, class... Rest>
struct ChannelList<C, Rest...> {
  static_assert(std::copyable<C>, "gsp: a picture channel is copied to the device; give it views and numbers, no references");
  static_assert(ChannelSize<C>, "gsp: the picture channel has no `static constexpr int size` > 0: the numbers of a pixel");
  static_assert(
      ChannelOfSplat<C> || ChannelOfGaussian<C>,
      "gsp: the picture channel has no `value(gsp::Splat const&, float* out) const`, nor one of any gsp::SeenGaussian: the numbers of a "
      "Gaussian");
  static_assert(
      ChannelStores<C>,
      "gsp: the picture channel has no `store(int image, int row, int column, float const* pixel) const`: where a pixel's numbers go");
  static constexpr int own = ChannelOfGaussian<C> ? C::size : 0;
  static constexpr int size = C::size + ChannelList<Rest...>::size, stored = own + ChannelList<Rest...>::stored;
  C channel;
  ChannelList<Rest...> rest;

  /// What is kept of a Gaussian beside its splat.
  template <class Seen>
  KOKKOS_FORCEINLINE_FUNCTION void values(Seen const& g, float* out) const {
    if constexpr (own > 0) channel.value(g, out);
    rest.values(g, out + own);
  }
  template <class P>
  KOKKOS_FORCEINLINE_FUNCTION void blend(P* pixel, Splat const& s, float const* kept, Blend<P> const& b) const {
    if constexpr (own > 0) {
      blend_value(pixel, kept, b);
    } else {
      float value[C::size];
      channel.value(s, value);
      blend_value(pixel, value, b);
    }
    rest.blend(pixel + C::size, s, kept + own, b);
  }
  template <class P>
  KOKKOS_FORCEINLINE_FUNCTION void blend_value(P* pixel, float const* value, Blend<P> const& b) const {
    if constexpr (requires { channel.blend(pixel, value, b); })
      channel.blend(pixel, value, b);
    else
      add_weighted<C::size>(pixel, value, b.weight);
  }
  template <class P>
  KOKKOS_FORCEINLINE_FUNCTION void finish(P* pixel, P const& alpha) const {
    if constexpr (requires { channel.finish(pixel, alpha); }) channel.finish(pixel, alpha);
    rest.finish(pixel + C::size, alpha);
  }
  KOKKOS_FORCEINLINE_FUNCTION void store(int image, int row, int column, float const* pixel) const {
    channel.store(image, row, column, pixel);
    rest.store(image, row, column, pixel + C::size);
  }
};

/// The passes of channels that have one of their own.
template <class Exec, class Mem, class Options>
void draw_passes(Exec const&, Frames<Mem> const&, Options const&, int, int, ChannelList<> const&) {}
template <class Exec, class Mem, class Options, class C, class... Rest>
void draw_passes(Exec const& exec, Frames<Mem> const& frames, Options const& options, int first, int of,
                 ChannelList<C, Rest...> const& list) {
  if constexpr (requires { list.channel.draw(exec, frames, options, first, of); }) list.channel.draw(exec, frames, options, first, of);
  draw_passes(exec, frames, options, first + ChannelList<C, Rest...>::own, of, list.rest);
}

inline auto channel_list() { return ChannelList<>{}; }
template <class C, class... Rest>
ChannelList<C, Rest...> channel_list(C const& channel, Rest const&... rest) {
  return {channel, channel_list(rest...)};
}
/// The pictures of the frames themselves, then `more`.
template <class Mem, class... More>
auto picture_channels(Frames<Mem> const& frames, More const&... more) {
  return channel_list(RgbChannel<Mem>{frames.rgb}, DepthChannel<Mem>{frames.depth}, AlphaChannel<Mem>{frames.alpha}, more...);
}

/// A further channel's own pictures are as many and as large as the frames: it stores every pixel.
template <class Mem, class C>
void check_image(char const* function, Frames<Mem> const& frames, C const& channel) {
  if constexpr (requires {
                  channel.image.rank();
                  channel.image.extent(0);
                }) {
    if constexpr (std::remove_cvref_t<decltype(channel.image)>::rank() >= 3) {
      auto const text = [](auto a, auto b, auto c) {
        return "(" + std::to_string(a) + ", " + std::to_string(b) + ", " + std::to_string(c) + ")";
      };
      auto const& image = channel.image;
      expects(int(image.extent(0)) == frames.images && int(image.extent(1)) == frames.height && int(image.extent(2)) == frames.width,
              std::string(function) + ": a channel's `image` is " + text(image.extent(0), image.extent(1), image.extent(2)) +
                  ", and the pictures are (images, height, width) = " + text(frames.images, frames.height, frames.width) +
                  ": make the two of one size");
    }
  }
}

/// Is there room for what the channels keep beside each splat?
template <class List, class Mem>
void check_values(char const* function, Frames<Mem> const& frames) {
  expects(frames.wave.values.extent(0) >= std::size_t(List::stored) * std::size_t(frames.wave.visible_capacity),
          std::string(function) + ": the channels keep " + std::to_string(List::stored) +
              " numbers of each Gaussian, for which the frames have no room: make_frames with .values, or call render, which makes it");
}
}  // namespace detail

}  // namespace gsp
