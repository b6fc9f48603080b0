#pragma once
#include <gsp/io/detail/mesh_files.hpp>

/// MuJoCo's own binary meshes: four counts (vertices, normals, texture coordinates, faces: int32), then that many float32 x 3, x 3, x 2 and
/// int32 x 3. Normals and texture coordinates are not kept.
namespace gsp::io::detail {

inline MeshDescription parse_msh(Bytes bytes, std::string const& file) {
  if (bytes.size() < 16) fail(file, at_byte(bytes.size()), "is too short for the header of an MSH file; fetch it again");
  std::int64_t const vertices = load<std::int32_t>(bytes, 0), normals = load<std::int32_t>(bytes, 4),
                     texcoords = load<std::int32_t>(bytes, 8), faces = load<std::int32_t>(bytes, 12);
  if (vertices < 4 || faces < 0 || (normals != 0 && normals != vertices) || (texcoords != 0 && texcoords != vertices))
    fail(file, at_byte(0),
         "announces " + std::to_string(vertices) + " vertices, " + std::to_string(normals) + " normals, " + std::to_string(texcoords) +
             " texture coordinates and " + std::to_string(faces) + " faces, which no mesh has; it is damaged or not MSH");
  std::int64_t const expected = 16 + 12 * vertices + 12 * normals + 8 * texcoords + 12 * faces;
  if (expected != static_cast<std::int64_t>(bytes.size()))
    fail(file, at_byte(0),
         "its counts ask for " + std::to_string(expected) + " bytes and it has " + std::to_string(bytes.size()) +
             "; it is cut short or not MSH");
  MeshDescription mesh;
  mesh.vertices.resize(static_cast<std::size_t>(vertices));
  mesh.faces.resize(static_cast<std::size_t>(faces));
  std::memcpy(mesh.vertices.data(), bytes.data() + 16, mesh.vertices.size() * sizeof(Vertex));
  std::size_t const at_faces = bytes.size() - mesh.faces.size() * sizeof(Triangle);
  if (!mesh.faces.empty()) std::memcpy(mesh.faces.data(), bytes.data() + at_faces, mesh.faces.size() * sizeof(Triangle));
  for (std::size_t i = 0; i < mesh.vertices.size(); ++i)
    if (!is_vertex(mesh.vertices[i])) fail_vertex(file, at_byte(16 + i * sizeof(Vertex)));
  for (std::size_t i = 0; i < mesh.faces.size(); ++i)
    for (int v : mesh.faces[i])
      if (v < 0 || v >= vertices)
        fail(file, at_byte(at_faces + i * sizeof(Triangle)),
             "a face names vertex " + std::to_string(v) + " of " + std::to_string(vertices) + "; the file is damaged");
  return mesh;
}

}  // namespace gsp::io::detail
