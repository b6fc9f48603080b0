#pragma once
#include <gsp/runtime/stepper.hpp>
#include <memory>
#include <string>

#include "model.hpp"

namespace gsp::runtime {
class Session;
}

namespace gsp::python {

/// Many worlds of a model. Arrays that Python has keep what owns their memory.
struct Data {
  std::shared_ptr<runtime::Session> session;  // ends after what follows
  Model model;
  runtime::Device device;
  int worlds;
  std::shared_ptr<runtime::Stepper> stepper;
};

}  // namespace gsp::python
