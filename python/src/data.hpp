#pragma once
#include <nanobind/nanobind.h>

#include <atomic>
#include <cstddef>
#include <gsp/runtime/stepper.hpp>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "model.hpp"

namespace gsp::runtime {
class Session;
}

namespace gsp::python {

/// Whether the poses are those of the state. Arrays of positions that Python was given it may write at any time, so where there are such
/// the positions are compared with those of the last poses: less than a tenth of the poses' own time.
struct Posed {
  bool given = false;
  std::vector<std::byte> positions;  // empty: poses are computed anew
};

/// Many worlds of a model. Arrays that Python has keep what owns their memory.
struct Data {
  std::shared_ptr<runtime::Session> session;  // ends after what follows
  Model model;
  runtime::Device device;
  int worlds;
  std::shared_ptr<runtime::Stepper> stepper;
  nanobind::object python_model{};                                                       // that Python gave
  bool moves_geoms = false;                                                              // sizes or poses of geoms are of each world
  std::shared_ptr<std::atomic<bool>> busy = std::make_shared<std::atomic<bool>>(false);  // somebody steps, and has let go of the GIL
  std::shared_ptr<int> at_once = std::make_shared<int>(1);                               // steps between which Ctrl-C is heard
  std::shared_ptr<Posed> posed = std::make_shared<Posed>();
  std::shared_ptr<std::map<std::string, std::string>> not_finite = std::make_shared<std::map<std::string, std::string>>();  // by field
};

/// Asked before, as a host gives more than it has and then ends the process. what: "gsp.Data: 3 worlds need".
void expect_free(std::string const& what, double needed, double free, runtime::Device device, std::string const& remedy);
/// The stepper, for calls that run kernels. Error where another thread of Python is at it, and in a process that was forked.
runtime::Stepper& stepper_of(Data const& data);
/// From here on `poses` and `cameras` of the stepper are of the positions as they are, whoever wrote them.
void freshen(Data const& data);
/// Nobody else for as long as this lives: `what`, say "these data", is in use. Made while the GIL is held, which may then be let go of.
class Use {
 public:
  Use(std::shared_ptr<std::atomic<bool>> busy, char const* what);
  explicit Use(Data const& data);
  ~Use() { *busy_ = false; }
  Use(Use const&) = delete;
  Use& operator=(Use const&) = delete;

 private:
  std::shared_ptr<std::atomic<bool>> const busy_;
};

}  // namespace gsp::python
