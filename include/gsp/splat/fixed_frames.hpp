#pragma once
#include <gsp/splat/render.hpp>
#include <gsp/splat/show_sets.hpp>

/// Cameras that stand still before what moves: a scene is drawn once, then only what robots cover or uncover.
namespace gsp {

/// Pictures of cameras that stand still. `make_fixed_frames` makes it, `render_fixed` draws it.
template <class Mem>
struct FixedFrames {
  using memory_space = Mem;
  template <class D>
  using View = Kokkos::View<D, Kokkos::LayoutRight, Mem>;
  Frames<Mem> frames;           // the pictures, one a camera, to be read only: what is not drawn anew is what was drawn last
  Frames<Mem> still;            // one a view: what a camera sees of what stands, its picture and its lists
  Gaussians<Mem> moving;        // those of the cloud that are not of body 0; all arrays but that of clusters are the cloud's
  Cameras<Mem> cameras;         // as many as pictures
  View<int*> view;              // (C) cameras that stand in one place before the same sets share a view
  View<std::uint32_t**> drawn;  // (C, tiles) which 8 x 8 blocks of a tile show what moves (a CPU's tile: all or none)
  RenderOptions options;
  int worlds = 0;  // of the poses
};

/// Pictures for these cameras and Gaussians, and what each of them sees of the Gaussians of body 0. Cameras of equal viewmats, Ks and
/// lenses whose worlds show the same sets share that.
/// @param poses    of as many worlds as there will be; of body 0 alone, which stays where it is
/// @param cameras  copied
/// @param options  images is set to the number of cameras; batch, visible and pairs are of what moves
/// Allocates: the pictures, for each view one more picture and its splats and lists, and a wave for what moves. Fences. Errors: those of
/// make_frames and render; std::invalid_argument where there are more views than a wave can hold.
template <ExecutionSpace Exec, class R, class PosesMem, class Mem>
FixedFrames<Mem> make_fixed_frames(Exec const& exec, Gaussians<Mem> const& cloud, Poses<R, PosesMem> const& poses,
                                   Cameras<Mem> const& cameras, FrameOptions options = {}, RenderOptions render_options = {});

/// The pictures of this moment, bit by bit those of `render`: what moves is projected and put into lists, blocks of pixels that it touches
/// are blended anew from both lists, and those that it has left get back the picture of what stands.
/// @param poses  of the worlds that the pictures were made for
/// @param fixed  out: fixed.frames.rgb, depth, alpha
/// Waits for the device once, at its end (the first call a few times more), and allocates where the wave has to grow, as `render` does.
/// Where body 0, the table of shown sets or the Gaussians themselves have changed, make the frames anew. Errors: std::invalid_argument for
/// poses of another number of worlds, and those of render. Cost: of what moves, and of the blocks that it touches.
template <ExecutionSpace Exec, class R, class PosesMem, class Mem>
void render_fixed(Exec const& exec, Poses<R, PosesMem> const& poses, FixedFrames<Mem>& fixed);

}  // namespace gsp

#include <gsp/splat/detail/fixed_frames_impl.hpp>
