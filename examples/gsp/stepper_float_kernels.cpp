#include "stepper_kernels.hpp"

namespace gsp_cli {
std::unique_ptr<Stepper> make_stepper_double(Device device, gsp::CompiledModel const& model,
                                             StepperOptions const& options);  // stepper_double_kernels.cpp

std::unique_ptr<Stepper> make_stepper(Device device, bool in_double, gsp::CompiledModel const& model, StepperOptions const& options) {
  return in_double ? make_stepper_double(device, model, options) : make_stepper_of<float>(device, model, options);
}
}  // namespace gsp_cli
