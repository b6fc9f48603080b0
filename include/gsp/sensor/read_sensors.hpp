#pragma once
#include <gsp/sensor/acceleration_sensors.hpp>
#include <gsp/sensor/constraint_sensors.hpp>
#include <gsp/sensor/distance_sensors.hpp>
#include <gsp/sensor/range_sensors.hpp>
#include <gsp/sensor/smooth_sensors.hpp>
#include <gsp/step/step.hpp>

/// All sensors of a model at once, from a simulation.
namespace gsp {

namespace detail {
template <class R, class Mem>
void expects_forward(char const* where, State<R, Mem> const& state, Dynamics<R, Mem> const& dynamics) {
  if (!dynamics.stamps(int(Quantity::motion)).is_of(state))
    throw std::invalid_argument(std::string(where) +
                                ": the simulation holds nothing of this state as it is now: call forward(exec, model, "
                                "state, sim) first");
}
}  // namespace detail

/// data (world, nsensordata): the numbers of all sensors of the table, of the state as it is: smooth_sensors, constraint_sensors,
/// range_sensors, distance_sensors, accelerations and acceleration_sensors, of those that the model has; sensors with a delay or an
/// interval say what they have measured (sensor/sensor_history.hpp). What sensors.left_out names stays as it is.
/// @param sim  after forward(exec, model, state, sim)
/// Does not allocate, does not fence. Errors: std::invalid_argument where forward has not been called with this state as it is now.
template <ExecutionSpace Exec, class R, class Mem, class View>
void read_sensors(Exec const& exec, Model<R, Mem> const& model, State<R, Mem> const& state, Simulation<R, Mem>& sim,
                  Sensors<R, Mem>& sensors, View& data) {
  Region const region("gsp::sensor::read_sensors");
  detail::expects_forward("gsp::read_sensors", state, sim.dynamics);
  smooth_sensors(exec, model, state, sim.poses, sim.dynamics, sensors, data);
  constraint_sensors(exec, model, state, sim.poses, sim.dynamics, sim.collision, sim.contacts, sim.rows, sim.impulses, sensors, data);
  range_sensors(exec, model, state, sim.poses, sensors, data, true);
  distance_sensors(exec, model, state, sim.poses, sensors, data);
  if (sensors.accelerated.extent(0) > 0) {
    accelerations(exec, model, state, sim.poses, sim.dynamics, sim.collision, sim.contacts, sim.rows, sim.impulses, sim.solution,
                  sensors.accelerations, sim.sleep.islands);
    acceleration_sensors(exec, model, state, sim.poses, sim.dynamics, sensors, data, true);
  }
  say_late(exec, state, sensors.history, data);
}

namespace detail {
template <class R, class Mem, class View>
struct LimitUserSensors {
  Kokkos::View<SensorEntry<R>*, Mem> entries;
  View data;
  KOKKOS_FUNCTION void operator()(int item) const {
    int const users = int(entries.extent(0)), w = item / users;
    SensorEntry<R> const e = entries(item % users);
    for (int c = e.adr; c < e.adr + e.local; ++c) data(w, c) = cut(e, data(w, c));
  }
};
}  // namespace detail

/// Keeps what you have written to the columns of `user` sensors within their cutoffs: above it alone where the datatype is positive. One
/// launch; does not allocate, does not fence. Errors: std::invalid_argument for data of other sizes.
template <ExecutionSpace Exec, class R, class Mem, class View>
void limit_user_sensors(Exec const& exec, Model<R, Mem> const& model, Sensors<R, Mem> const& sensors, View& data) {
  Region const region("gsp::sensor::limit_user_sensors");
  detail::expects_sensors("gsp::limit_user_sensors", model, sensors, data);
  Kokkos::parallel_for("gsp::sensor::limit_user_sensors", Kokkos::RangePolicy<Exec>(exec, 0, sensors.worlds * int(sensors.users.extent(0))),
                       detail::LimitUserSensors<R, Mem, View>{sensors.users, data});
}

}  // namespace gsp
