#pragma once
#include <gsp/model/description.hpp>
#include <gsp/ray/ray_noise.hpp>
#include <limits>
#include <string>

/// How a LiDAR unit stands on a model, what it does not see and what it measures. Host, no Kokkos.
namespace gsp {

/// How a unit turns with its body.
enum class RayAlignment : unsigned char {
  body,   // as its body does
  yaw,    // about the vertical alone, as the body's x axis does: height scans
  world,  // not at all
};
struct RayMountOptions {
  std::string body = "";  // a body of this name ("world": what does not move); or
  int body_id = -1;       // by index; or
  std::string site = "";  // a site of this name, on its body: pos and quat are in the site's frame
  Double3 pos{0, 0, 0};   // of the unit in the body's frame, as it is aligned [m]
  Double4 quat{1, 0, 0, 0};
  RayAlignment alignment = RayAlignment::body;
};

/// What a unit on a body does not see of its own robot.
enum class SelfFilter : unsigned char {
  none,     // it sees everything
  body,     // not its body's geoms, as MuJoCo's rangefinders
  subtree,  // not those of its body and of all that hangs on it
};
struct RayScanOptions {
  int worlds = 1;
  double timestep = 0.002;  // [s] from one scan_rays to the next
  int rays = 0;             // that are kept, the latest of each world; 0: as many as the pattern has
  double min_range = 0;     // [m] what is nearer or farther, as the unit measures it, is a miss
  double max_range = std::numeric_limits<double>::infinity();
  double miss = -1;  // range of a ray that meets nothing, or does not come back
  SelfFilter self = SelfFilter::body;
  RayNoise noise{};
  int first_world = 0;               // number of world 0, of a batch that is split: noise follows it
  bool geoms = true, points = true;  // of RayScan
  bool splats = false;               // of RayScan: where scan_rays is given Gaussians
};

}  // namespace gsp
