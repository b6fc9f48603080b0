#pragma once
#include <gsp/model/compiled.hpp>
#include <memory>
#include <string>

namespace gsp::python {

/// A model as it was read, and what a simulation of it is made with unless it says otherwise.
struct Model {
  std::shared_ptr<CompiledModel const> compiled;
  std::string file;
};

}  // namespace gsp::python
