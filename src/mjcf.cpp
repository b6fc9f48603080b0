#include <gsp/io/detail/mjcf_impl.hpp>
