#pragma once
#include <nanobind/nanobind.h>

#include <array>
#include <gsp/runtime/array.hpp>
#include <gsp/runtime/session.hpp>
#include <memory>
#include <string>

namespace gsp::python {

namespace nb = nanobind;

/// What Python gives and gets, by the names that its type checkers know (stubs.txt).
constexpr bool any_object(PyObject*) { return true; }  // it is looked at where it is used
#define GSP_PYTHON_TYPE(Type, text, is)   \
  class Type : public nb::object {        \
    NB_OBJECT(Type, nb::object, text, is) \
  }
GSP_PYTHON_TYPE(ArrayLike, "ArrayLike", any_object);                 // what numpy.asarray takes
GSP_PYTHON_TYPE(NumpyArray, "NDArray[typing.Any]", any_object);      // numpy.ndarray
GSP_PYTHON_TYPE(NumpyDtype, "numpy.dtype[typing.Any]", any_object);  // numpy.dtype
GSP_PYTHON_TYPE(NumpyArrays, "dict[str, NDArray[typing.Any]]", PyDict_Check);
GSP_PYTHON_TYPE(Words, "dict[str, typing.Any]", PyDict_Check);
GSP_PYTHON_TYPE(Mounts, "collections.abc.Sequence[str | dict[str, typing.Any]]", any_object);
GSP_PYTHON_TYPE(GivenWords, "dict[str, typing.Any]", any_object);
GSP_PYTHON_TYPE(Shape, "tuple[int, ...]", PyTuple_Check);
GSP_PYTHON_TYPE(NameOrNumber, "str | int", any_object);
GSP_PYTHON_TYPE(Names, "collections.abc.Sequence[str]", any_object);
GSP_PYTHON_TYPE(Anything, "typing.Any", any_object);
#undef GSP_PYTHON_TYPE

/// Kokkos, from the first object that needs it on: whoever holds memory of the library holds it.
std::shared_ptr<runtime::Session> session();
/// "cpu", "cuda", "cuda:0". Errors: gsp::Error for another, and where there is no GPU or the library was built without CUDA.
runtime::Device device_of(std::string const& name);

/// Error where this process was forked from one in which the library had started threads: they stayed behind, and it would wait for them.
void expect_threads();

/// Memory of the library as Python has it: the array, and what keeps it.
struct Array {
  runtime::Array array;
  std::shared_ptr<void> owner;
  char const* computed = nullptr;    // it follows from the state, or is drawn once: what to write in its place; NumPy gets it for reading
  std::array<int, 2> picture{0, 0};  // Ks for pictures of this width and height; 0: nobody knows
};

/// What Python gave, read where it lies; `what` names it in messages. None: an array without data.
/// @param extents  that it must have; -1: any
runtime::Array taken(nb::handle object, char const* what, std::initializer_list<std::int64_t> extents, nb::object& keeps);

/// A copy in NumPy's own memory, from the CPU or a GPU.
NumpyArray numpy_copy(runtime::Array const& from);

void bind_array(nb::module_& m);
void bind_model(nb::module_& m);
void bind_data(nb::module_& m);
void bind_renderer(nb::module_& m);

}  // namespace gsp::python
