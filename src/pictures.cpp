#include <gsp/io/detail/png_impl.hpp>
