#pragma once
#include <filesystem>
#include <gsp/io/detail/bytes.hpp>
#include <gsp/model/description.hpp>
#include <span>
#include <string>

/// Triangle meshes from files and from numbers in a model, by MuJoCo's rules (docs/io/mesh.md). What comes out is as the file has it:
/// scale, refpos and refquat are set by the caller and applied by `compile`.

namespace gsp::io {

enum class MeshFormat { stl, obj, msh };

/// By content type ("model/stl", "model/obj", "model/vnd.mujoco.msh") where one is given, else by the extension of the file.
MeshFormat mesh_format(std::string const& file, std::string const& content_type = {});

/// A mesh from the bytes of a file. `file` is named in messages, lends its stem as the mesh's name, and tells the format. `note`, where
/// given, takes a sentence "FILE: line N: what" when part of the file is ignored. Cost: one pass; equal vertices of STL files are merged by
/// hash. Throws Error("FILE: line or byte: what is wrong; remedy").
MeshDescription parse_mesh(Bytes bytes, std::string const& file, std::string const& content_type = {}, std::string* note = nullptr);

MeshDescription read_mesh(std::filesystem::path const& path, std::string const& content_type = {}, std::string* note = nullptr);

/// A mesh from lists as they stand in a model: x y z of each vertex, three vertices of each face (none: the convex hull). `what` names it
/// in messages. Coordinates are rounded to float.
MeshDescription make_mesh(std::span<double const> vertices, std::span<int const> faces, std::string const& what);

}  // namespace gsp::io

#if !defined(GSP_COMPILED)
#include <gsp/io/detail/mesh_impl.hpp>
#endif
