#pragma once
#include <gsp/core/exec.hpp>
#include <gsp/math/pack.hpp>

/// Kernels compiled once. The target gsp::kernels brings a library with the host's kernels in float and double, and defines GSP_KERNELS as
/// the bytes of a pack in it. A file that is compiled for that width takes them from there (`extern template`); one of another width, of
/// another backend, or with types of its own compiles what it needs (docs/decisions/0009-kernels-are-compiled-once.md).
/// A list is a macro list(word, Exec, Mem, numbers...) of explicit instantiations: C++ has no loop over them.
#define GSP_HOST_KERNELS(list, word, ...) list(word, Kokkos::DefaultHostExecutionSpace, Kokkos::HostSpace __VA_OPT__(, ) __VA_ARGS__)
#if defined(GSP_KERNELS) && GSP_KERNELS == GSP_PACK_BYTES
#define GSP_EXTERN_KERNELS(list, ...) GSP_HOST_KERNELS(list, extern template __VA_OPT__(, ) __VA_ARGS__)
#else
#define GSP_EXTERN_KERNELS(list, ...)
#if defined(GSP_KERNELS) && !defined(__CUDA_ARCH__)
#pragma message(                                                                                                                               \
    "gsp::kernels has vectors of another width than this file, which therefore compiles all kernels by itself (a minute instead of seconds): " \
    "compile it with the -march that gsp was built with (the presets: -march=native), or link gsp::gsp instead of gsp::kernels")
#endif
#endif
