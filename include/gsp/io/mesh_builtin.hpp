#pragma once
#include <array>
#include <gsp/model/description.hpp>
#include <span>
#include <string>
#include <string_view>

/// Meshes that MJCF asks for by name and parameters (<mesh builtin="cone" params="5 0.3"/>), as MuJoCo 4.0.1 makes them: the same vertices
/// and faces in the same order. Those without faces (wedge, cone, and the volumes of dim 3) are their convex hull.
namespace gsp::io {

/// The names that make_builtin_mesh knows.
inline constexpr std::array<std::string_view, 13> builtin_meshes{"sphere",    "hemisphere", "cone", "supersphere", "supertorus",
                                                                 "wedge",     "plate",      "grid", "box",         "cylinder",
                                                                 "ellipsoid", "square",     "disc"};

/// The mesh `type` with its parameters; docs/io/mesh.md has the table of both. `inertia` is what the model asks for: meshes that enclose
/// nothing take that of a shell. `what` names the mesh in messages. At most a million vertices.
/// Throws Error("WHAT: what is wrong; remedy").
MeshDescription make_builtin_mesh(std::string_view type, std::span<double const> params, std::string const& what,
                                  MeshInertia inertia = MeshInertia::legacy);

}  // namespace gsp::io

#if !defined(GSP_COMPILED)
#include <gsp/io/detail/mesh_builtin_impl.hpp>
#endif
