#pragma once
#include <gsp/splat/lens.hpp>

/// What `place_gaussians` leaves of cameras and links for `project`, kept in SplatWave.
namespace gsp::detail {

/// A camera as `project` reads it.
struct ImageView {
  double fx, fy, cx, cy;
  float x_low, x_high, y_low, y_high;  // limits of x/z and y/z in the derivative of the projection
  int world;                           // that it shows
  Lens const* lens;                    // null: a pinhole; what follows is about it
  float beyond, seen;                  // [pixel]; the radius in the plane z = 1 outside of which the picture is further than that
  float stretch, grows, reach;         // the lens's within `seen`, outside of it, and within the limits
};
/// A link as a camera sees it: camera <- link (rows of rotation | translation), and the eye in the link's frame.
struct LinkView {
  double m[12];
  float eye[3];
};

}  // namespace gsp::detail
