#pragma once
#include <cstdio>
#include <cstdlib>
#include <gsp/math/pack.hpp>

/// Buffers are laid out by the width of a pack, and kernels of templates are shared by all files of a program that use the same types.
/// Files of different widths would take each other's: such a program ends before main, with a sentence.
/// gsp::kernels does not count: files of another width take nothing from it (the linker may load it all the same, for what the standard
/// library left in it). What it tells them to be its width is checked where it is compiled.
#if defined(GSP_KERNELS_HERE)
static_assert(GSP_KERNELS_HERE == GSP_PACK_BYTES, "cmake/GspKernels.cmake has found another width than this file is compiled for");
#else
namespace gsp {
namespace detail {
inline int width_of_program = 0;  // bytes of a pack in the first file that was initialised
}
inline namespace GSP_PACK_NAMESPACE {
struct OneWidth {
  OneWidth() {
    if (detail::width_of_program == 0) detail::width_of_program = GSP_PACK_BYTES;
    if (detail::width_of_program == GSP_PACK_BYTES) return;
    std::fprintf(stderr,
                 "gsp: files of this program were compiled for vectors of %d and of %d bytes: give all files that include gsp, and its "
                 "libraries, the same -march\n",
                 detail::width_of_program, GSP_PACK_BYTES);
    std::abort();
  }
};
inline OneWidth const one_width;
}  // namespace GSP_PACK_NAMESPACE
}  // namespace gsp
#endif
