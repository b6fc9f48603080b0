#pragma once
#include <gsp/io/splat_set.hpp>

namespace gsp::io {

/// Puts the Gaussians into the order of a Z-order curve through their box, 21 bits an axis: neighbours in the set are neighbours in space,
/// which chunks with bounds (compressed PLY) and pictures (SOG) live on. Equal cells keep their order. Links go with them.
void sort_splats(SplatSet& set);

}  // namespace gsp::io

#if !defined(GSP_COMPILED)
#include <gsp/io/detail/splat_order_impl.hpp>
#endif
