#include <gsp/io/detail/write_mjcf_impl.hpp>
