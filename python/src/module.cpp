#include <gsp/core/check.hpp>

#include "array.hpp"

/// What `import gsp` finds compiled (python/gsp/__init__.py).
NB_MODULE(_gsp, m) {
  nanobind::exception<gsp::Error>(m, "Error", PyExc_ValueError);
  gsp::python::bind_array(m);
  gsp::python::bind_model(m);
  gsp::python::bind_data(m);
  gsp::python::bind_renderer(m);
}
