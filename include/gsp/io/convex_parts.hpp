#pragma once
#include <filesystem>
#include <gsp/core/check.hpp>
#include <gsp/model/description.hpp>
#include <vector>

/// Meshes that are not convex as several that are, for contacts, by CoACD (X. Wei et al., SIGGRAPH 2022), which is looked for when it is
/// needed: no library of gsp needs it.
namespace gsp::io {

struct ConvexPartsOptions {
  double threshold = 0.05;  // concavity that may be left, as a share of the mesh's size: 0.01 (many parts) to 1 (its hull)
  int most_parts = -1;      // of a mesh; -1: as many as it takes
  std::filesystem::path cache =
      {};  // where parts are kept by the content of meshes; empty: $GSP_CACHE_DIR, $XDG_CACHE_HOME/gsp, ~/.cache/gsp
};

/// The parts of a mesh, each its own convex hull, in the mesh's frame and scale. `what` names the mesh in messages. Seconds for a mesh that
/// is new, then read from the cache; a cache that cannot be written costs time alone.
/// Errors: gsp::Error where CoACD is not found, with what to install, and for a mesh that it cannot take apart.
std::vector<MeshDescription> convex_parts(MeshDescription const& mesh, std::string const& what, ConvexPartsOptions const& options = {});

/// Splits the meshes of geoms that can touch something (contype or conaffinity, or a named pair) where the centre of a triangle lies deeper
/// than a hundredth of the mesh's size inside of the hull. Such a geom stays as what is seen and weighs, and touches nothing; its parts
/// stand beside it in the same body, in group 3, without mass, and meet what it met, by name too. To be called before add_hulls. Errors:
/// those of convex_parts.
void split_into_convex_parts(Description& description, ConvexPartsOptions const& options = {});

}  // namespace gsp::io

#if !defined(GSP_COMPILED)
#include <gsp/io/detail/convex_parts_impl.hpp>
#endif
