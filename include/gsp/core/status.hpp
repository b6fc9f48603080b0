#pragma once
#include <cstdint>
#include <string>

/// Status bits of a world, written on the device, read by the user when he likes. A world with a bit set was not stepped: nothing is
/// dropped silently.
namespace gsp::status {

inline constexpr std::uint32_t contact_overflow = 1u << 0;
inline constexpr std::uint32_t row_overflow = 1u << 1;
inline constexpr std::uint32_t not_finite = 1u << 2;
inline constexpr std::uint32_t row_refused = 1u << 3;
inline constexpr std::uint32_t unbounded = 1u << 4;
// Beside row_refused, why:
inline constexpr std::uint32_t refused_place = 1u << 8;
inline constexpr std::uint32_t refused_size = 1u << 9;
inline constexpr std::uint32_t refused_friction = 1u << 10;
inline constexpr std::uint32_t refused_bounds = 1u << 11;
inline constexpr std::uint32_t refused_law = 1u << 12;
inline constexpr std::uint32_t refused_identity = 1u << 13;
inline constexpr std::uint32_t causes = refused_place | refused_size | refused_friction | refused_bounds | refused_law | refused_identity;
/// Bits with which a world stays as it is, until somebody clears them (row_refused: until the rows are right).
inline constexpr std::uint32_t stopped = not_finite | row_refused | unbounded;

/// What the bits mean, for people.
inline std::string text(std::uint32_t bits) {
  std::string result;
  auto const add = [&](std::uint32_t bit, char const* sentence) {
    if (bits & bit) result += (result.empty() ? "" : "; ") + std::string(sentence);
  };
  add(contact_overflow,
      "the contacts of this world did not fit: call settle(exec, simulation) and repeat the step (a loop of one's own: grow contacts, "
      "rows and impulses)");
  add(row_overflow,
      "the constraint rows of this world did not fit: call settle(exec, simulation) and repeat the step (a loop of one's own: grow "
      "contacts, rows and impulses)");
  add(not_finite,
      "the new velocity, or what the step reads of a row or a geom, is NaN or infinite, and the world stays as it was before: look for "
      "numbers that are not finite in qpos, qvel, "
      "ctrl and qfrc_applied, in the model's values per world, and in what constraints and actuators of your own give, or take a smaller "
      "timestep or a softer model, then reset the world or clear the bit (state.status(w))");
  add(unbounded,
      "a position or a new velocity is beyond 1e10, where MuJoCo warns, and the world stays as it was before: start from smaller "
      "numbers, give smaller ctrl and qfrc_applied, or take a smaller timestep or a softer model, then reset the world or clear the bit "
      "(state.status(w))");
  if (!(bits & row_refused)) bits &= ~causes;
  add(bits & causes ? 0 : row_refused, "a constraint row was refused");
  add(refused_place,
      "a constraint row was refused: jacobian() touches more than two kinematic trees, or names a body or dof that is not there: split the "
      "element, or correct the number");
  add(refused_size,
      "a constraint row was refused: count() is negative, or rows() gives an element fewer than none or more than six: correct the "
      "number, or split the element");
  add(refused_friction,
      "a constraint row was refused: its bounds() name a row of friction that the element does not have, or itself, or share an ellipse "
      "with what is no friction of the same row (in profile mujoco also: friction of a row without the bounds 0 and infinity, or a second "
      "one that shares no ellipse): correct friction_of and with_next");
  add(refused_bounds,
      "a constraint row was refused: its bounds() are NaN, the lower one is above the upper one, or mu is negative or beyond 1e15 (geoms: "
      "friction): correct them");
  add(refused_law,
      "a constraint row was refused: its law() is infinite or NaN or has a negative compliance (a lambda() that grows with the gap or the "
      "rate), or a restitution that is not 0 to 1 of a rigid row that only pushes and has room for it (make_rows or make_simulation with "
      "{.impacts = true}): correct it");
  add(refused_identity,
      "a constraint row was refused: its id() has a major part of 2^27 or more: number the elements of a type from 0 on, in their order");
  return result.empty() ? "ok" : result;
}

}  // namespace gsp::status

namespace gsp {
/// Positions and velocities beyond it [m, rad, and a second] stop a world (status::unbounded): MuJoCo's mjMAXVAL, where it warns.
inline constexpr double state_bound = 1e10;
}  // namespace gsp
