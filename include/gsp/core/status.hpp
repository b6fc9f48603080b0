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
      "the new velocity is NaN or infinite, and the world stays as it was before: look for numbers that are not finite in qpos, qvel, "
      "ctrl and qfrc_applied, in the model's values per world, and in what constraints and actuators of your own give, or take a smaller "
      "timestep or a softer model, then clear the bit");
  add(unbounded,
      "a position or a new velocity is beyond 1e10, where MuJoCo warns, and the world stays as it was before: start from smaller "
      "numbers, give smaller ctrl and qfrc_applied, or take a smaller timestep or a softer model, then clear the bit");
  add(row_refused,
      "a constraint row touches more than two kinematic trees, an element has more than six rows, a row names a body or dof that is not "
      "there, or a friction row a row that its element does not have (in profile mujoco: one without the bounds 0 and infinity, "
      "or two friction rows of one row that share no ellipse), or a law or bounds are no numbers that a row can have (compliance and zeta "
      "are finite, compliance is not negative: no lambda() that grows with the gap or the rate; bounds are not NaN and the lower one not "
      "above the upper, a restitution is 0 to 1, and of "
      "rigid rows that only push and have room "
      "for it, make_rows or make_simulation with {.impacts = true}): split the element, or correct jacobian(), law(), lambda() or "
      "bounds()");
  return result.empty() ? "ok" : result;
}

}  // namespace gsp::status

namespace gsp {
/// Positions and velocities beyond it [m, rad, and a second] stop a world (status::unbounded): MuJoCo's mjMAXVAL, where it warns.
inline constexpr double state_bound = 1e10;
}  // namespace gsp
