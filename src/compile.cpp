#include <gsp/model/detail/compile_impl.hpp>
