#pragma once
// Scenes that several tests of steps share and that are files (support/data.hpp): what they are, without what is asked of them.
#include <cmath>
#include <filesystem>
#include <fstream>
#include <gsp/io/mjcf.hpp>
#include <regex>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

namespace gsp_test {

/// A file on a floor, without its assets, whose meshes and pictures are missing, and without what an expression finds.
inline gsp::Description without(std::string const& path, std::string const& what) {
  std::ostringstream file;
  file << std::ifstream(path).rdbuf();
  auto d = gsp::io::parse_mjcf(std::regex_replace(file.str(), std::regex("<asset>[^]*?</asset>|" + what), ""), path);
  gsp::GeomDescription floor;
  floor.type = gsp::ShapeType::plane;
  floor.size = {0, 0, 0.05};
  d.bodies[0].geoms.push_back(floor);
  return d;
}

/// MotrixSim's store on a floor, without pictures and the cones of 15 bottles, whose meshes are missing: boxes and cylinders; every free
/// body weighs 0.35 kg, shared among its geoms by volume.
inline gsp::Description store(std::string const& path) {
  auto d = without(path, R"(<default class="C_Mesh[^]*?</default>|<geom class="(C_Mesh|visual)[^>]*/>)");
  d.option.timestep = 0.01;
  d.option.gravity = {0, 0, -9.8};
  for (auto& body : d.bodies) {
    if (body.joints.empty()) continue;
    body.has_inertial = false;
    double volume = 0;
    auto const of = [](gsp::GeomDescription const& g) {
      return g.type == gsp::ShapeType::box ? 8 * g.size[0] * g.size[1] * g.size[2] : 2 * M_PI * g.size[0] * g.size[0] * g.size[1];
    };
    for (auto const& g : body.geoms) volume += of(g);
    for (auto& g : body.geoms) g.has_mass = true, g.mass = 0.35 * of(g) / volume;
  }
  return d;
}

/// MotrixSim's Spot without meshes, which are missing, on a floor.
inline gsp::Description spot(std::string const& path) { return without(path, R"(<geom [^>]*mesh="[^>]*/>)"); }

/// phys-bench's Panda over an object, grasp_xml/mjx_pick_OBJECT.xml.
inline gsp::Description grasp(std::string const& path) {
  // the files that it names lie in grasp/xml at their source, two folders below assets
  auto const read = [](std::filesystem::path const& file) {
    std::string name = file.lexically_normal().string(), from = "/models/assets/";
    if (auto const at = name.find(from); at != std::string::npos) name.replace(at, from.size(), "/models/phys_bench/assets/");
    std::ifstream in(name, std::ios::binary);
    if (!in) throw std::runtime_error("no " + name);
    std::vector<std::byte> bytes(std::filesystem::file_size(name));
    in.read(reinterpret_cast<char*>(bytes.data()), std::streamsize(bytes.size()));
    return bytes;
  };
  return gsp::io::read_mjcf(path, {.skip_visuals = true, .read = read});
}

}  // namespace gsp_test
