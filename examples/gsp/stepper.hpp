#pragma once
// Many worlds of one model, stepped on a device in float or double. No word of Kokkos here.
#include <gsp/model/compiled.hpp>
#include <memory>
#include <vector>

#include "device.hpp"
#include "files.hpp"

namespace gsp_cli {

struct StepperOptions {
  int worlds = 1;
  double timestep = 0;       // 0: the model's own
  bool mujoco = false;       // profile mujoco instead of stable
  bool approximate = false;  // profile mujoco: what it does not cover is approximated
  int iterations = 0;        // sweeps of the solver, 0: the library's default
};

/// What the last step met.
struct StepCounts {
  std::int64_t contacts = 0, rows = 0;  // of all worlds
  int iterations = 0;                   // most sweeps of any world
  double residual = 0;                  // greatest of any world [m/s, rad/s]
  int failed_worlds = 0;                // worlds that stopped because their state was not finite
};

class Stepper {
 public:
  virtual ~Stepper() = default;
  virtual void set(States const& states) = 0;       // qpos (worlds, nq), qvel (worlds, nv), ctrl (worlds, nu) or empty
  virtual void load(Controls const& controls) = 0;  // takes them to the device
  virtual void apply(std::size_t step) = 0;         // ctrl = the controls of this step
  virtual void step(int steps, bool measure) = 0;   // waits until they are done; measure: the last step's residual too
  virtual void get(std::vector<double>& qpos, std::vector<double>& qvel) = 0;
  virtual StepCounts counts() = 0;
  virtual double timestep() const = 0;
};

std::unique_ptr<Stepper> make_stepper(Device device, bool in_double, gsp::CompiledModel const& model, StepperOptions const& options);

}  // namespace gsp_cli
