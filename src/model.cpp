#include <gsp/model/detail/archetypes_impl.hpp>
#include <gsp/model/detail/attach_impl.hpp>
#include <gsp/model/detail/samples_impl.hpp>
