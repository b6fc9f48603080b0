#pragma once
#include <nanobind/nanobind.h>

#include <gsp/runtime/array.hpp>
#include <gsp/runtime/session.hpp>
#include <memory>
#include <string>

namespace gsp::python {

namespace nb = nanobind;

/// Kokkos, from the first object that needs it on: whoever holds memory of the library holds it.
std::shared_ptr<runtime::Session> session();
/// "cpu", "cuda", "cuda:0". Errors: gsp::Error for another, and where there is no GPU or the library was built without CUDA.
runtime::Device device_of(std::string const& name);

/// Memory of the library as Python has it: the array, and what keeps it.
struct Array {
  runtime::Array array;
  std::shared_ptr<void> owner;
};

/// What Python gave, read where it lies; `what` names it in messages. None: an array without data.
/// @param extents  that it must have; -1: any
runtime::Array taken(nb::handle object, char const* what, std::initializer_list<std::int64_t> extents, nb::object& keeps);

void bind_array(nb::module_& m);
void bind_model(nb::module_& m);
void bind_data(nb::module_& m);
void bind_renderer(nb::module_& m);

}  // namespace gsp::python
