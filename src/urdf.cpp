#include <gsp/io/detail/urdf_impl.hpp>
