#pragma once
#include <gsp/model/compiled.hpp>
#include <memory>
#include <string>
#include <vector>

namespace gsp::python {

/// A model as it was read, and what a simulation of it is made with unless it says otherwise.
struct Model {
  std::shared_ptr<CompiledModel const> compiled;
  std::string file;
};

/// Names of all objects of a kind, in their order.
std::vector<std::string> names_of(Model const& model, std::string const& kind);
/// Number of an object of this kind and name. Error with the nearest names.
int id_of(Model const& model, std::string const& kind, std::string const& name);

/// A sentence of the library whose remedy is C++, in Python's words.
std::string in_python(std::string sentence);

}  // namespace gsp::python
