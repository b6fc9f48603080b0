#include <gsp/io/detail/convex_parts_impl.hpp>
#include <gsp/io/detail/hfield_impl.hpp>
#include <gsp/io/detail/mesh_builtin_impl.hpp>
#include <gsp/io/detail/mesh_hull_impl.hpp>
#include <gsp/io/detail/mesh_impl.hpp>
