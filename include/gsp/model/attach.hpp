#pragma once
#include <gsp/core/check.hpp>
#include <gsp/model/description.hpp>
#include <string>
#include <vector>

namespace gsp {

/// Adds an empty body below `parent` (an index) at the end of the tree and returns its index. Depth-first order asks that `parent` is the
/// last body or one of its ancestors; std::invalid_argument where there is no such body. The reference to the body itself
/// (description.bodies[index]) holds until the next one is added.
int add_body(Description& d, int parent, std::string name, Double3 const& pos = {0, 0, 0});

/// qpos of the initial pose: free joints take their body's pose, ball joints the identity, others their `ref`. MuJoCo's order.
std::vector<double> initial_qpos(Description const& d);

struct AttachOptions {
  std::string body = "world";  // what it hangs on
  std::string prefix = "";     // put before every name of the piece
  Double3 pos{0, 0, 0};        // of the piece's world in the frame of `body`
  Double4 quat{1, 0, 0, 0};
};

/// Puts all of `piece` into `to`: its bodies below the body named, its world's geoms, sites and cameras into that body. Its settings are
/// left behind; meshes and height fields of the same name are taken to be the same. Keyframes of both stay: each keeps its own part and
/// gives the other's part its initial values. Cost O(size of both).
/// Errors: gsp::Error where the body does not exist, or a free joint would end up below a body other than the world.
void attach(Description& to, Description const& piece, AttachOptions const& options = {});

}  // namespace gsp

#if !defined(GSP_COMPILED)
#include <gsp/model/detail/attach_impl.hpp>
#endif
