#include <gsp/math/pack.hpp>

namespace gsp {
inline namespace GSP_PACK_NAMESPACE {
extern int const kernels_width;
int const kernels_width = GSP_PACK_BYTES;
}  // namespace GSP_PACK_NAMESPACE
}  // namespace gsp
