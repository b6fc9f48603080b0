#pragma once
#include <gsp/step/step.hpp>

namespace gsp {

/// Bytes that make_state and make_simulation allocate for `options.worlds` worlds, to be compared with what a device has before it is asked
/// for. Buffers grow by blocks of worlds (a pack's on a CPU, a warp's on a GPU), pools by worlds: one block, two, and one with what is left
/// of the worlds are made, one after the other, and let go, and give the bytes of any number. So the question takes the memory of two
/// blocks, and the time of up to five.
/// Not counted: what pools grow by beyond their first guess, which a step with many contacts may double.
/// Errors: those of make_simulation.
template <class R, ExecutionSpace Exec, class Mem>
std::int64_t bytes_needed(Exec const& exec, Model<R, Mem> const& model, CompiledModel const& compiled, SimulationOptions options = {}) {
  expects(options.worlds > 0, "gsp::bytes_needed: worlds must be positive and is " + std::to_string(options.worlds));
  auto shared = model;
  shared.value_worlds = 0;  // what is made here reads no field that is per world
  auto const bytes_of = [&](int worlds) {
    std::int64_t const before = detail::allocated_bytes();
    auto state = make_state(exec, shared, {.worlds = worlds});
    auto const simulation = make_simulation(exec, shared, compiled,
                                            {.worlds = worlds, .cone = options.cone, .sleep = options.sleep, .impacts = options.impacts});
    return detail::allocated_bytes() - before;
  };
  constexpr int block = block_width<Mem, R>;
  if (options.worlds <= block) return bytes_of(options.worlds);
  std::int64_t const one = bytes_of(block);
  std::int64_t const more = bytes_of(2 * block) - one;
  int const left = options.worlds % block;
  return one + (options.worlds / block - 1) * more + (left > 0 ? bytes_of(block + left) - one : 0);
}

}  // namespace gsp
