#pragma once
#include <Kokkos_Core.hpp>
#include <string>

/// As many threads of a device as the functor says there, which may read what an earlier kernel has counted.
namespace gsp::detail {

/// f(thread, i) for i < f.count(), which the device calls; `thread` has `near` (threads_cuda.hpp).
template <class Exec, class F>
void launch_threads(std::string const& label, Exec const& exec, F const& f);

}  // namespace gsp::detail

#if defined(KOKKOS_ENABLE_CUDA) && defined(__CUDACC__)
#include <gsp/parallel/detail/threads_cuda.hpp>
#endif
