#include "stepper_kernels.hpp"

namespace gsp::runtime {

std::unique_ptr<Stepper> make_stepper(Device device, CompiledModel const& model, StepperOptions const& options) {
  return options.precision == Dtype::float64 ? make_stepper_double(device, model, options) : make_stepper_of<float>(device, model, options);
}
std::int64_t bytes_needed(Device device, CompiledModel const& model, StepperOptions const& options) {
  return options.precision == Dtype::float64 ? bytes_needed_double(device, model, options) : bytes_needed_of<float>(device, model, options);
}

}  // namespace gsp::runtime
