#pragma once
#include <cmath>
#include <gsp/io/mesh.hpp>
#include <gsp/io/mesh_hull.hpp>
#include <gsp/model/compile.hpp>

#include "target.hpp"

namespace gsp_fuzz {
/// A file read as a mesh must be sound; what compile makes of it, as a mesh that collides and as a fitted box, must be numbers.
inline void try_mesh(gsp::io::Bytes bytes, std::string const& file) {
  survive([&] {
    auto const mesh = gsp::io::parse_mesh(bytes, file);
    for (auto const& v : mesh.vertices)
      for (float x : v) require(std::isfinite(x));
    for (auto const& f : mesh.faces)
      for (int v : f) require(v >= 0 && v < int(mesh.vertices.size()));
    for (int kind = 0; kind < 4; ++kind)
      survive([&] {
        gsp::Description d;
        d.meshes.push_back(mesh);
        d.meshes[0].name = "m", d.meshes[0].inertia = gsp::MeshInertia(kind), d.meshes[0].scale = {1, kind == 1 ? -1. : 1., .5};
        gsp::BodyDescription body;
        body.parent = 0;
        body.joints.push_back({.type = gsp::JointType::free});
        body.geoms.push_back({.type = gsp::ShapeType::mesh, .mesh = "m"});
        body.geoms.push_back({.type = gsp::ShapeType::box, .mesh = "m"});
        d.bodies.push_back(body);
        gsp::io::add_hulls(d);
        auto const m = gsp::compile(d);
        require(std::isfinite(m.body_mass[1]) && m.body_mass[1] > 0 && std::isfinite(m.geom_rbound[0]) &&
                std::isfinite(m.body_inertia[1][0]));
        for (auto const& v : m.mesh_vertices[0])
          for (float x : v) require(std::isfinite(x));
        require(m.mesh_hull[0].size() >= 4);
      });
  });
}
}  // namespace gsp_fuzz
