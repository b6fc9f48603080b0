#pragma once
// MuJoCo 4.0.1 beside gsp in one program: its library is opened while the program runs, with --mujoco FILE or $GSP_MUJOCO, and nothing of
// it is needed to build. Models and data stay opaque: states go through mj_getState and mj_setState.
#include <gsp/model/description.hpp>
#include <memory>
#include <string>
#include <vector>

#include "files.hpp"

namespace gsp_cli {

struct PeerOptions {
  std::string solver = "newton";  // newton, cg: 100 iterations; pgs: 10
  int threads = 1;                // each steps worlds of its own
};

/// Worlds of a description, stepped by MuJoCo.
class Peer {
 public:
  virtual ~Peer() = default;
  /// All worlds at their start, as given.
  virtual void start(States const& states) = 0;
  /// Steps all worlds, each all of its steps before the next one. ctrl: (worlds + period - 1, nu), of world w at step k row w + k mod
  /// period; or empty.
  virtual void step(long long steps, std::vector<double> const& ctrl, long long period) = 0;
  /// What the next step starts from, kept and gone back to.
  virtual void save() = 0;
  virtual void restore() = 0;
  virtual void get(std::vector<double>& qpos, std::vector<double>& qvel) const = 0;
  /// The first warning since the library was opened; empty: none. States that are not finite are reset by MuJoCo, which warns.
  virtual std::string warning() const = 0;
};

/// The library's file: --mujoco, else $GSP_MUJOCO. Throws where neither is given.
std::string mujoco_file(Arguments const& arguments);
/// Opens the library and makes `worlds` worlds. Errors: gsp::Error where the file is no MuJoCo 4.0.1, or it refuses the model.
std::unique_ptr<Peer> make_mujoco(std::string const& library, gsp::Description const& description, int worlds, PeerOptions const& options);

}  // namespace gsp_cli
