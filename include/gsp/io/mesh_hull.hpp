#pragma once
#include <gsp/core/check.hpp>
#include <gsp/model/description.hpp>
#include <string>

// qhull's headers define macros without a prefix; what they leave behind is no concern of those who include this one.

/// Convex hulls of meshes, by qhull with MuJoCo's options.

namespace gsp::io {

/// Fills mesh.hull with the triangles of the convex hull of its vertices, seen from outside counter-clockwise. `what` names the mesh in
/// messages. At most mesh.max_hull_vertices vertices where that is not -1. Cost: O(n log n) for n vertices.
void add_hull(MeshDescription& mesh, std::string const& what);

/// Adds the hull to every mesh that needs one: those of mesh geoms that can touch something (contype or conaffinity, or a named pair),
/// those that take the inertia of their hull, and those without faces. To be called once a description is complete.
void add_hulls(Description& description);

}  // namespace gsp::io

#if !defined(GSP_COMPILED)
#include <gsp/io/detail/mesh_hull_impl.hpp>
#endif
