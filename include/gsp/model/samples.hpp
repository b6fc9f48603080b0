#pragma once
#include <gsp/model/description.hpp>

/// Models made in code, for first programs, tests and benches: no files needed. Metres, kilograms, radians; z up.

namespace gsp::samples {

/// A rod of half a metre with a ball at its end, on a hinge about y; hangs down at 0. Nothing collides.
Description pendulum();

/// Two such rods in a row.
Description double_pendulum();

/// A six-axis arm on a static pedestal, reach 0.9 m, 11 kg, with position servos; keyframe "home", site "tool", camera "wrist".
Description arm();

/// A four-legged robot of 12 kg with twelve hinges (per leg: abduction about x, hip and knee about y), position servos, capsule legs, ball
/// feet (geoms FL_foot, FR_foot, RL_foot, RR_foot), site "imu", camera "head". Keyframe "stand": trunk level, feet below the hips on z = 0;
/// its ctrl holds the stance. No floor.
Description quadruped();

struct ObjectOptions {
  int boxes = 6, balls = 6;
  double radius = 0.85;  // of the ring on which they stand [m]
};

/// A floor with boxes and balls of several sizes on a ring about the origin, each a free body half a millimetre above the floor: were the
/// gap zero, rounding would decide whether there is a contact in the first step, and no two backends would agree.
Description boxes_and_balls(ObjectOptions const& options = {});

/// The quadruped on a floor, standing among boxes and balls, all of them half a millimetre above it; keyframe "stand".
Description quadruped_scene(ObjectOptions const& options = {});

/// `count` cubes of 0.2 m and 8 kg on a floor, one on the other.
Description stack(int count = 10);

/// A box of 0.2 x 0.2 x 0.1 m on a plane of slope `slope` (tangent), with sliding friction `mu`; x points up the slope.
Description ramp(double slope = 0.25, double mu = 0.5);

}  // namespace gsp::samples

#if !defined(GSP_COMPILED)
#include <gsp/model/detail/samples_impl.hpp>
#endif
