#pragma once
/// GSP_FUNCTION marks a function for host and device, as KOKKOS_INLINE_FUNCTION does, in headers that plain C++ includes without Kokkos
/// (math/, geometry/): a CUDA build's host-only files cannot include it. docs/decisions/0006 says why there is a macro of our own.
/// GSP_FORCEINLINE_FUNCTION: the same, inlined whatever the compiler counts, as KOKKOS_FORCEINLINE_FUNCTION.
#if defined(__CUDACC__) || defined(__HIPCC__)
#define GSP_FUNCTION __host__ __device__ inline
#define GSP_FORCEINLINE_FUNCTION __host__ __device__ __forceinline__
#else
#define GSP_FUNCTION inline
#define GSP_FORCEINLINE_FUNCTION inline __attribute__((always_inline))
#endif
