#include <gsp/core/check.hpp>
#include <stdexcept>

#include "array.hpp"
#include "model.hpp"

/// What `import gsp` finds compiled (python/gsp/__init__.py).
NB_MODULE(_gsp, m) {
  nanobind::exception<gsp::Error> const error(m, "Error", PyExc_ValueError);
  nanobind::register_exception_translator(  // what functions expect of their caller: one kind of error for Python
      [](std::exception_ptr const& thrown, void* type) {
        try {
          std::rethrow_exception(thrown);
        } catch (std::invalid_argument const& e) {
          PyErr_SetString(static_cast<PyObject*>(type), gsp::python::in_python(e.what()).c_str());
        } catch (gsp::Error const& e) {
          PyErr_SetString(static_cast<PyObject*>(type), gsp::python::in_python(e.what()).c_str());
        } catch (std::bad_cast const&) {
          PyErr_SetString(PyExc_TypeError, "an argument, or what it holds, is of another kind than the function takes: see its help()");
        }
      },
      error.ptr());
  gsp::python::bind_array(m);
  gsp::python::bind_model(m);
  gsp::python::bind_data(m);
  gsp::python::bind_renderer(m);
}
