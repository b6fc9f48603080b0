#include <gsp/io/detail/compressed_ply_impl.hpp>
#include <gsp/io/detail/ply_impl.hpp>
#include <gsp/io/detail/splat_file_impl.hpp>
#include <gsp/io/detail/splat_links_impl.hpp>
#include <gsp/io/detail/splat_order_impl.hpp>
#include <gsp/io/detail/splat_transform_impl.hpp>
#include <gsp/io/detail/splats_impl.hpp>
#include <gsp/io/detail/spz_impl.hpp>
