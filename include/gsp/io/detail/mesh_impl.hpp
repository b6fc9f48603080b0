#pragma once
#include <filesystem>
#include <gsp/core/detail/compiled.hpp>
#include <gsp/io/detail/msh.hpp>
#include <gsp/io/detail/obj.hpp>
#include <gsp/io/detail/stl.hpp>
#include <gsp/io/file.hpp>
#include <gsp/io/mesh.hpp>
#include <span>

namespace gsp::io {

GSP_INLINE MeshFormat mesh_format(std::string const& file, std::string const& content_type) {
  std::string kind = content_type.empty() ? std::filesystem::path(file).extension().string() : content_type;
  for (char& c : kind) c = c >= 'A' && c <= 'Z' ? static_cast<char>(c + 32) : c;
  if (kind == ".stl" || kind == "model/stl") return MeshFormat::stl;
  if (kind == ".obj" || kind == "model/obj") return MeshFormat::obj;
  if (kind == ".msh" || kind == "model/vnd.mujoco.msh") return MeshFormat::msh;
  detail::fail(file, "", "is not read as a mesh; convert it to STL, OBJ or MSH");
}

GSP_INLINE MeshDescription parse_mesh(Bytes bytes, std::string const& file, std::string const& content_type, std::string* note) {
  auto const format = mesh_format(file, content_type);
  auto mesh = format == MeshFormat::stl   ? detail::parse_stl(bytes, file)
              : format == MeshFormat::obj ? detail::parse_obj(bytes, file, note)
                                          : detail::parse_msh(bytes, file);
  if (mesh.vertices.size() < 4)
    detail::fail(file, "",
                 "holds " + std::to_string(mesh.vertices.size()) + " different vertices and a mesh needs at least 4; export it again");
  mesh.name = std::filesystem::path(file).stem().string();
  return mesh;
}

GSP_INLINE MeshDescription read_mesh(std::filesystem::path const& path, std::string const& content_type, std::string* note) {
  return parse_mesh(read_file(path), path.string(), content_type, note);
}

GSP_INLINE MeshDescription make_mesh(std::span<double const> vertices, std::span<int const> faces, std::string const& what) {
  MeshDescription mesh;
  if (vertices.size() % 3 != 0 || vertices.size() < 12)
    detail::fail(what, "", "has " + std::to_string(vertices.size()) + " numbers for its vertices; give three for each, of at least 4");
  if (faces.size() % 3 != 0) detail::fail(what, "", "has " + std::to_string(faces.size()) + " numbers for its faces; give three for each");
  for (std::size_t i = 0; i < vertices.size(); i += 3) {
    mesh.vertices.push_back({static_cast<float>(vertices[i]), static_cast<float>(vertices[i + 1]), static_cast<float>(vertices[i + 2])});
    if (!detail::is_vertex(mesh.vertices.back())) detail::fail_vertex(what, "vertex " + std::to_string(i / 3));
  }
  for (std::size_t i = 0; i < faces.size(); i += 3) {
    for (std::size_t k = i; k < i + 3; ++k)
      if (faces[k] < 0 || static_cast<std::size_t>(faces[k]) >= mesh.vertices.size())
        detail::fail(what, "face " + std::to_string(i / 3),
                     "names vertex " + std::to_string(faces[k]) + " of " + std::to_string(mesh.vertices.size()) + "; they count from 0");
    mesh.faces.push_back({faces[i], faces[i + 1], faces[i + 2]});
  }
  return mesh;
}

}  // namespace gsp::io
