#pragma once
#include <concepts>
#include <gsp/dynamics/world_lanes.hpp>
#include <gsp/math/dual.hpp>

/// An actuator law of one's own: the force of an actuator as a function of its control, length and velocity, in the place of MJCF's gain
/// and bias. All else of the actuator stays the model's: range of its control, activation, transmission (joint, tendon, site,
/// slider-crank), ranges of force of the actuator, its tendon and its joint, and what sensors read.
///   f = law(u, l, l'),   generalised force = J^T f,   l' = J qvel   (J: the moment of the transmission)
/// The law is evaluated where the model's own would be, at the state that is stepped, in the same kernel.
namespace gsp {

namespace detail {
template <class A>
concept LawForce = requires(A const law, WorldLane<float> const world, int actuator, float x) {
  { law.force(world, actuator, x, x, x) } -> std::convertible_to<float>;
};
}  // namespace detail

/// An actuator law: copyable to the device, with
///   template <class T, class X>
///   X force(WorldLane<T> const& world, int actuator, T control, X length, X velocity) const
///                      force [N, N m] of one of the model's actuators. `world` loads what the law needs of its own views and of the
///                      model's; T: a pack of worlds on a CPU, a number on a GPU; X: a number that carries slopes along. control: after
///                      its range, or the activation where the actuator has one; length, velocity: of the transmission
///                      [m, rad; m/s, rad/s], gear and all
/// and, where it is not for all of the model's actuators,
///   bool drives(int actuator) const
/// Its slopes by length and velocity go where those of the model's servos go: with profile `stable` what they damp and stiffen is implicit
/// for actuators of joints; implicit and implicitfast take the slope by velocity. A law on T alone (T length, T velocity) has no slopes and
/// is explicit: with a slope -b, b > 0, a step h is stable for h b J M^-1 J^T < 2.
/// It writes nothing: a step that is repeated evaluates it again.
template <class A>
concept ActuatorLaw = std::copyable<A> && detail::LawForce<A>;

namespace detail {
template <class T>
struct ActuatorForce {
  T force;
  T stiffness, damping;  // -d force / d length, velocity
};

template <class Law>
KOKKOS_INLINE_FUNCTION bool law_drives([[maybe_unused]] Law const& law, [[maybe_unused]] int actuator) {
  if constexpr (requires { law.drives(actuator); })
    return law.drives(actuator);
  else
    return true;
}

/// Force and slopes of a law, the slopes by evaluating it on duals where it is written on them.
/// @param implicit  the slopes go into the matrix, and must not take from it: one that drives on stays explicit
template <class Law, class T>
KOKKOS_INLINE_FUNCTION ActuatorForce<T> law_force(Law const& law, WorldLane<T> const& world, int actuator, T const& control,
                                                  T const& length, T const& velocity, bool implicit) {
  using X = Dual<T, 2>;
  if constexpr (requires { law.force(world, actuator, control, X(length), X(velocity)); }) {
    X const f = law.force(world, actuator, control, X::variable(length, 0), X::variable(velocity, 1));
    T const stiffness = -f.slope[0], damping = -f.slope[1];
    if (implicit) return {f.value, max(stiffness, T(0)), max(damping, T(0))};
    return {f.value, stiffness, damping};
  } else {
    return {law.force(world, actuator, control, length, velocity), T(0), T(0)};
  }
}

/// The laws of a call. Where two drive one actuator, the last one does.
template <class... Law>
struct ActuatorLaws {
  template <class L, class T>
  KOKKOS_INLINE_FUNCTION void apply(L const&, int const (&)[L::W], int, T const&, ActuatorForce<T>&) const {}
};
template <class Head, class... Tail>
struct ActuatorLaws<Head, Tail...> {
  static_assert(std::copyable<Head>, "gsp: an actuator law is copied to the device; give it views and numbers, no references");
  static_assert(
      LawForce<Head>,
      "gsp: the actuator law has no `X force(gsp::WorldLane<T> const& world, int actuator, T control, X length, X velocity) const` "
      "of any T and X: its force");
  Head head;
  ActuatorLaws<Tail...> tail;

  /// f <- the force of the tree's k-th actuator, which is actuator item[i] of the model in lane i, where a law drives it.
  template <class L, class T>
  KOKKOS_INLINE_FUNCTION void apply(L const& l, int const (&item)[L::W], int k, T const& control, ActuatorForce<T>& f) const {
    T const length = l.items[l.at.act_length + k], velocity = l.items[l.at.act_velocity + k];
    bool const stable = l.model.profile == Profile::stable;
    if constexpr (L::W == 1) {
      WorldLane<T> const world{l.world[0], 1};
      if (law_drives(head, item[0])) f = law_force(head, world, item[0], control, length, velocity, stable);
    } else if (l.uniform) {
      WorldLane<T> const world{l.world[0], l.count};
      if (law_drives(head, item[0])) f = law_force(head, world, item[0], control, length, velocity, stable);
    } else {  // the block holds several instances: robots of one world, each with actuators of its own
      using R = typename L::R;
      for (int i = 0; i < L::W; ++i) {
        if (!law_drives(head, item[i])) continue;
        WorldLane<R> const world{l.world[i], 1};
        auto const g = law_force(head, world, item[i], R(control[i]), R(length[i]), R(velocity[i]), stable);
        f.force.set(i, g.force);
        f.stiffness.set(i, g.stiffness);
        f.damping.set(i, g.damping);
      }
    }
    tail.apply(l, item, k, control, f);
  }
};

inline ActuatorLaws<> actuator_laws() { return {}; }
template <class Head, class... Tail>
ActuatorLaws<Head, Tail...> actuator_laws(Head const& head, Tail const&... tail) {
  return {head, actuator_laws(tail...)};
}

/// A law has something to drive.
template <class R, class Mem>
void expects_actuators(char const* where, Model<R, Mem> const& model, int laws) {
  if (laws == 0 || model.nu > 0) return;
  throw std::invalid_argument(std::string(where) +
                              ": an actuator law is given, and the model has no actuators: give it one, such as <motor> on the joint, "
                              "tendon or site that the law drives");
}
}  // namespace detail

}  // namespace gsp
