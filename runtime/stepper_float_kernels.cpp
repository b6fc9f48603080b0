#include "stepper_kernels.hpp"

namespace gsp::runtime {

std::unique_ptr<Stepper> make_stepper(Device device, CompiledModel const& model, StepperOptions const& options) {
  return options.precision == Dtype::float64 ? make_stepper_double(device, model, options) : make_stepper_of<float>(device, model, options);
}
std::int64_t bytes_needed(Device device, CompiledModel const& model, StepperOptions const& options) {
  return options.precision == Dtype::float64 ? bytes_needed_double(device, model, options) : bytes_needed_of<float>(device, model, options);
}
std::vector<std::string> world_fields() {
  std::vector<std::string> names;
  for (ModelField const f : model_fields())
    if (info(f).use.per_world && !info(f).use.follows) names.push_back(info(f).name);
  for (auto const& row : gsp::detail::geom_field_table<CollisionModel<float, Kokkos::HostSpace>>()) {
    std::string const name = std::string(geom_prefix()) + row.name;
    if (std::find(names.begin(), names.end(), name) == names.end()) names.push_back(name);
  }
  return names;
}

}  // namespace gsp::runtime
