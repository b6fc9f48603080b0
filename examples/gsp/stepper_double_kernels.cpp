#include "stepper_kernels.hpp"

namespace gsp_cli {
std::unique_ptr<Stepper> make_stepper_double(Device device, gsp::CompiledModel const& model, StepperOptions const& options) {
  return make_stepper_of<double>(device, model, options);
}
}  // namespace gsp_cli
