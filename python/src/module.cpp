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
        } catch (std::runtime_error const& e) {
          std::string const text = e.what();  // of Kokkos, which says of what memory how much was asked for, and for what
          if (text.find("failed to allocate") == text.npos) throw;
          auto const kokkos = text.rfind("Kokkos ERROR: ", 0) == 0 ? std::size_t(14) : 0;
          PyErr_SetString(static_cast<PyObject*>(type),
                          ("there is not enough memory (" + text.substr(kokkos, text.find_last_not_of(". \n") + 1 - kokkos) +
                           "): make fewer worlds or pictures, or free what others hold")
                              .c_str());
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
