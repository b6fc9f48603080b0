#include "stepper_kernels.hpp"

namespace gsp::runtime {
std::unique_ptr<Stepper> make_stepper_double(Device device, CompiledModel const& model, StepperOptions const& options) {
  return make_stepper_of<double>(device, model, options);
}
std::int64_t bytes_needed_double(Device device, CompiledModel const& model, StepperOptions const& options) {
  return bytes_needed_of<double>(device, model, options);
}
}  // namespace gsp::runtime
