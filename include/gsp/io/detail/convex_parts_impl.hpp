#pragma once
#include <dlfcn.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <gsp/core/detail/compiled.hpp>
#include <gsp/io/convex_parts.hpp>
#include <gsp/io/detail/bytes.hpp>
#include <gsp/io/file.hpp>
#include <gsp/io/mesh_hull.hpp>
#include <gsp/model/detail/host_math.hpp>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

namespace gsp::io {

namespace detail::coacd {

/// The C interface of CoACD 1.0.14, which comes without a header.
struct Mesh {
  double* vertices;
  std::uint64_t vertex_count;
  int* triangles;
  std::uint64_t triangle_count;
};
struct Meshes {
  Mesh* meshes;
  std::uint64_t count;
};
struct Library {
  Meshes (*run)(Mesh const*, double threshold, int most_parts, int prepare, int prepare_resolution, int resolution, int nodes,
                int iterations, int depth, bool pca, bool merge, bool decimate, int most_vertices, bool extrude, double extrude_margin,
                int shape, unsigned seed, bool real_metric);
  void (*free)(Meshes);
  void (*set_log_level)(char const*);
};
inline Library find_library(std::string const& what) {
#if defined(GSP_COACD_LIBRARY)
  std::string path = GSP_COACD_LIBRARY;
#else
  std::string path;
#endif
  if (char const* const own = std::getenv("GSP_COACD")) path = own;
  void* const handle = path.empty() ? nullptr : dlopen(path.c_str(), RTLD_NOW | RTLD_LOCAL);
  if (handle == nullptr) {
    std::string const reason = path.empty() ? "" : std::string(" (") + dlerror() + ")";
    fail(what, "",
         "is not convex, and its parts are asked for, but CoACD was not found" + reason +
             "; pip install coacd==1.0.14 and set GSP_COACD to its lib_coacd.so, or configure gsp with -DGSP_WITH_COACD=ON");
  }
  auto const find = [&](auto& function, char const* name) {
    function = reinterpret_cast<std::decay_t<decltype(function)>>(dlsym(handle, name));
    if (function == nullptr) fail(what, "", "is to be taken apart by " + path + ", which has no " + name + "; use that of CoACD 1.0.14");
  };
  // The C functions say nothing of what they take; the C++ function does, with std::string of before C++11 or of today.
  if (dlsym(handle, "_ZN5coacd5CoACDERKNS_4MeshEdiSsiiiiibbbibdSsjb") == nullptr &&
      dlsym(handle, "_ZN5coacd5CoACDERKNS_4MeshEdiNSt7__cxx1112basic_stringIcSt11char_traitsIcESaIcEEEiiiiibbbibdS8_jb") == nullptr)
    fail(what, "", "is to be taken apart by " + path + ", which is of another version; use that of CoACD 1.0.14");
  Library library{};
  find(library.run, "CoACD_run");
  find(library.free, "CoACD_freeMeshArray");
  find(library.set_log_level, "CoACD_setLogLevel");
  return library;
}

inline std::filesystem::path cache_folder(ConvexPartsOptions const& options) {
  if (!options.cache.empty()) return options.cache;
  if (char const* const own = std::getenv("GSP_CACHE_DIR")) return std::filesystem::path(own) / "convex_parts";
  if (char const* const all = std::getenv("XDG_CACHE_HOME")) return std::filesystem::path(all) / "gsp" / "convex_parts";
  if (char const* const home = std::getenv("HOME")) return std::filesystem::path(home) / ".cache" / "gsp" / "convex_parts";
  return {};
}

/// What decides the parts, and its hash: 128 bits of FNV-1a from two starts.
struct Key {
  std::string bytes = "gsp convex parts 1, coacd 1.0.14";
  template <class T>
  void add(T const* values, std::size_t count) {
    bytes.append(reinterpret_cast<char const*>(values), count * sizeof(T));
  }
  std::string name() const {
    std::string text;
    for (std::uint64_t hash : {14695981039346656037ull, 1099511628211ull}) {
      for (char const c : bytes) hash = (hash ^ std::uint8_t(c)) * 1099511628211ull;
      for (int digit = 60; digit >= 0; digit -= 4) text += "0123456789abcdef"[hash >> digit & 15];
    }
    return text;
  }
};

using Parts = std::vector<std::pair<std::vector<std::array<float, 3>>, std::vector<std::array<int, 3>>>>;

/// Counts and numbers one after the other; what is not complete is none.
inline std::optional<Parts> read_parts(std::filesystem::path const& path) {
  std::error_code none;
  if (path.empty() || !std::filesystem::is_regular_file(path, none)) return {};
  auto const bytes = read_file(path);
  std::size_t at = 0;
  bool whole = true;
  auto const take = [&](auto& values, std::size_t count) {
    whole = whole && count <= (bytes.size() - at) / sizeof(values[0]);
    if (!whole) return;
    values.resize(count);
    std::memcpy(values.data(), bytes.data() + at, count * sizeof(values[0]));
    at += count * sizeof(values[0]);
  };
  std::vector<std::uint64_t> count;
  take(count, 1);
  Parts parts(whole ? std::min<std::uint64_t>(count[0], bytes.size()) : 0);
  for (auto& [vertices, faces] : parts) {
    take(count, 2);
    if (!whole) return {};
    std::uint64_t const triangles = count[1];
    take(vertices, count[0]);
    take(faces, triangles);
    for (auto const& face : faces)
      for (int const corner : face) whole = whole && corner >= 0 && std::size_t(corner) < vertices.size();
  }
  if (!whole || at != bytes.size() || parts.empty()) return {};
  return parts;
}
inline void write_parts(std::filesystem::path const& path, Parts const& parts) {
  if (path.empty()) return;
  std::vector<std::byte> bytes;
  auto const add = [&](auto const* values, std::size_t count) {
    auto const* const first = reinterpret_cast<std::byte const*>(values);
    bytes.insert(bytes.end(), first, first + count * sizeof(*values));
  };
  std::uint64_t const count = parts.size();
  add(&count, 1);
  for (auto const& [vertices, faces] : parts) {
    std::uint64_t const counts[2] = {vertices.size(), faces.size()};
    add(counts, 2);
    add(vertices.data(), vertices.size());
    add(faces.data(), faces.size());
  }
  try {
    std::filesystem::create_directories(path.parent_path());
    write_file(path, bytes);
  } catch (std::exception const&) {  // then it is computed again
  }
}

inline Parts compute(MeshDescription const& mesh, std::string const& what, ConvexPartsOptions const& options) {
  std::vector<double> vertices;
  std::vector<int> triangles;
  for (auto const& v : mesh.vertices) vertices.insert(vertices.end(), v.begin(), v.end());
  for (auto const& f : mesh.faces) triangles.insert(triangles.end(), f.begin(), f.end());
  Library const library = find_library(what);
  library.set_log_level("error");
  Mesh const input{vertices.data(), mesh.vertices.size(), triangles.data(), mesh.faces.size()};
  // The library's own defaults, but the seed: said here, as they are part of what the cache keeps.
  Meshes found{};
  try {
    found = library.run(&input, options.threshold, options.most_parts, 0, 50, 2000, 20, 150, 3, false, true, false, 256, false, 0.01, 0, 1,
                        false);
  } catch (std::exception const& e) {
    fail(what, "", std::string("cannot be taken apart by CoACD (") + e.what() + "); mend the mesh or give it contype and conaffinity 0");
  } catch (...) { fail(what, "", "cannot be taken apart by CoACD; mend the mesh or give it contype and conaffinity 0"); }
  Parts parts;
  for (std::uint64_t i = 0; i < found.count; ++i) {
    Mesh const& m = found.meshes[i];
    auto& [points, faces] = parts.emplace_back();
    for (std::uint64_t k = 0; k < m.vertex_count; ++k)
      points.push_back({float(m.vertices[3 * k]), float(m.vertices[3 * k + 1]), float(m.vertices[3 * k + 2])});
    for (std::uint64_t k = 0; k < m.triangle_count; ++k)
      faces.push_back({m.triangles[3 * k], m.triangles[3 * k + 1], m.triangles[3 * k + 2]});
  }
  library.free(found);
  return parts;
}

/// Whether the centre of a triangle lies deeper than `share` of the mesh's size below all faces of its hull. The depth is concave over a
/// triangle, so at its centre it is a third of the greatest at least; corners would not do, as those of a notch may all lie on the hull.
inline bool is_concave(MeshDescription mesh, std::string const& what, double share) {
  using namespace gsp::detail;
  if (mesh.faces.empty()) return false;
  mesh.max_hull_vertices = -1;
  if (mesh.hull.empty()) add_hull(mesh, what);
  auto const at = [&](int i) {
    auto const& v = mesh.vertices[std::size_t(i)];
    return Double3{v[0], v[1], v[2]};
  };
  std::vector<std::pair<Double3, double>> planes;
  double size = 0;
  for (auto const& f : mesh.hull) {
    Double3 const n = cross(at(f[1]) - at(f[0]), at(f[2]) - at(f[0]));
    double const length = norm(n);
    for (int const corner : f) size = std::max(size, norm(at(corner) - at(mesh.hull[0][0])));
    if (length > 0) planes.emplace_back((1 / length) * n, dot((1 / length) * n, at(f[0])));
  }
  return std::any_of(mesh.faces.begin(), mesh.faces.end(), [&](auto const& f) {
    Double3 const centre = (1. / 3) * (at(f[0]) + at(f[1]) + at(f[2]));
    return std::all_of(planes.begin(), planes.end(), [&](auto const& p) { return p.second - dot(p.first, centre) > share * size; });
  });
}

}  // namespace detail::coacd

GSP_INLINE std::vector<MeshDescription> convex_parts(MeshDescription const& mesh, std::string const& what,
                                                     ConvexPartsOptions const& options) {
  expects(options.threshold >= 0.01 && options.threshold <= 1,
          "gsp::io::convex_parts: threshold is " + std::to_string(options.threshold) + "; give 0.01 to 1");
  expects(options.most_parts == -1 || options.most_parts > 0,
          "gsp::io::convex_parts: most_parts is " + std::to_string(options.most_parts) + "; give 1 or more, or -1 for as many as it takes");
  for (auto const& face : mesh.faces)
    for (int const corner : face)
      if (corner < 0 || std::size_t(corner) >= mesh.vertices.size())
        detail::fail(what, "", "has a triangle with vertex " + std::to_string(corner) + ", which is not there; correct it");
  detail::coacd::Key key;
  key.add(&options.threshold, 1);
  key.add(&options.most_parts, 1);
  key.add(mesh.vertices.data(), mesh.vertices.size());
  key.add(mesh.faces.data(), mesh.faces.size());
  auto const folder = detail::coacd::cache_folder(options);
  auto const path = folder.empty() ? folder : folder / key.name();
  auto parts = detail::coacd::read_parts(path);
  if (!parts) {
    parts = detail::coacd::compute(mesh, what, options);
    if (parts->empty()) detail::fail(what, "", "has no convex parts that CoACD finds; mend the mesh or give it contype and conaffinity 0");
    detail::coacd::write_parts(path, *parts);
  }
  std::vector<MeshDescription> result;
  for (auto& [vertices, faces] : *parts) {
    MeshDescription part = mesh;
    part.name += ".part" + std::to_string(result.size());
    part.vertices = std::move(vertices);
    part.faces = std::move(faces);
    part.hull.clear();
    part.inertia = MeshInertia::convex;
    result.push_back(std::move(part));
  }
  return result;
}

GSP_INLINE void split_into_convex_parts(Description& description, ConvexPartsOptions const& options) {
  std::set<std::string> paired, names;  // of geoms
  for (auto const& body : description.bodies)
    for (auto const& g : body.geoms) names.insert(g.name);
  for (auto const& pair : description.pairs) {
    paired.insert(pair.geom1);
    paired.insert(pair.geom2);
  }
  auto const place_of = [&](Place const& place) {
    bool const has_file = place.file >= 0 && place.file < int(description.files.size());
    return has_file                   ? description.files[std::size_t(place.file)] + ":" + std::to_string(place.line) + ": "
           : description.name.empty() ? std::string("model: ")
                                      : description.name + ": ";
  };
  std::map<std::string, std::size_t> mesh_of;
  for (std::size_t i = 0; i < description.meshes.size(); ++i) mesh_of[description.meshes[i].name] = i;
  std::map<std::string, std::vector<std::string>> parts_of, geoms_of;  // by mesh: names of meshes; by geom: of geoms
  auto const parts_named = [&](std::string const& name) -> std::vector<std::string> const& {
    auto const [known, is_new] = parts_of.try_emplace(name);
    auto const found = mesh_of.find(name);
    if (!is_new || found == mesh_of.end()) return known->second;
    MeshDescription const mesh = description.meshes[found->second];
    auto const what = place_of(mesh.place) + "mesh '" + name + "'";
    if (!detail::coacd::is_concave(mesh, what, 0.01)) return known->second;
    for (auto& part : convex_parts(mesh, what, options)) {
      if (mesh_of.count(part.name)) detail::fail(what, "", "has parts, and a mesh is called '" + part.name + "' already; rename that one");
      known->second.push_back(part.name);
      description.meshes.push_back(std::move(part));
    }
    return known->second;
  };
  for (auto& body : description.bodies) {
    std::vector<GeomDescription> geoms;
    for (auto& g : body.geoms) {
      bool const touches = !g.visual() || (!g.name.empty() && paired.count(g.name));
      auto const& parts = g.type == ShapeType::mesh && touches ? parts_named(g.mesh) : parts_of[""];
      std::vector<GeomDescription> own;
      for (std::size_t i = 0; i < parts.size(); ++i) {
        auto part = g;
        part.name = g.name.empty() ? "" : g.name + ".part" + std::to_string(i);
        if (!part.name.empty() && names.count(part.name))
          detail::fail(place_of(g.place) + "geom '" + g.name + "'", "",
                       "is taken apart, and a geom is called '" + part.name + "' already; rename that one");
        part.mesh = parts[i];
        part.group = 3;
        part.material_alpha = 0;  // rays see through it: they meet the mesh
        part.has_mass = true;
        part.mass = 0;
        part.fluid_ellipsoid = false;
        if (!g.name.empty()) geoms_of[g.name].push_back(part.name);
        own.push_back(std::move(part));
      }
      if (!own.empty()) {
        g.contype = 0;
        g.conaffinity = 0;
        g.parts = int(own.size());
      }
      geoms.push_back(std::move(g));
      geoms.insert(geoms.end(), own.begin(), own.end());
    }
    body.geoms = std::move(geoms);
  }
  std::vector<PairDescription> pairs;
  for (auto const& pair : description.pairs) {
    auto const all = [&](std::string const& name) {
      auto const found = geoms_of.find(name);
      return found == geoms_of.end() ? std::vector{name} : found->second;
    };
    auto const first = all(pair.geom1), second = all(pair.geom2);
    for (auto const& a : first)
      for (auto const& b : second) {
        auto own = pair;
        if (first.size() * second.size() > 1 && !own.name.empty()) own.name += ".part" + std::to_string(pairs.size());
        own.geom1 = a;
        own.geom2 = b;
        pairs.push_back(std::move(own));
      }
  }
  description.pairs = std::move(pairs);
}

}  // namespace gsp::io
