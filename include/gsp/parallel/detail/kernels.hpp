#pragma once
#include <gsp/core/exec.hpp>
#include <gsp/math/pack.hpp>

/// Kernels compiled once. The target gsp::kernels brings a library with the host's kernels in float and double, and defines GSP_KERNELS as
/// the bytes of a pack in it. A file that is compiled for that width takes them from there (`extern template`); one of another width, of
/// another backend, or with types of its own compiles what it needs (docs/decisions/0009-kernels-are-compiled-once.md).
/// A list is a macro list(word, Exec, Mem, R) of explicit instantiations: C++ has no loop over them.
/// The library says with a symbol which width it was compiled for: a wrong GSP_KERNELS ends at the linker.
#if defined(GSP_KERNELS) && GSP_KERNELS == GSP_PACK_BYTES
#define GSP_EXTERN_KERNELS(list) GSP_HOST_KERNELS(list, extern template)
namespace gsp {
inline namespace GSP_PACK_NAMESPACE {
extern int const kernels_width;
[[gnu::used]] inline int const* const kernels_are_of_this_width = &kernels_width;
}  // namespace GSP_PACK_NAMESPACE
}  // namespace gsp
#else
#define GSP_EXTERN_KERNELS(list)
#endif
#define GSP_HOST_KERNELS(list, word)                                      \
  list(word, Kokkos::DefaultHostExecutionSpace, Kokkos::HostSpace, float) \
      list(word, Kokkos::DefaultHostExecutionSpace, Kokkos::HostSpace, double)
