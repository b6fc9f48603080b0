#pragma once
#include <Kokkos_Core.hpp>
#include <type_traits>

/// Execution spaces and what may be accessed from them.
namespace gsp {

template <class E>
concept ExecutionSpace = Kokkos::is_execution_space_v<E>;

/// True where `Exec` runs on a device with threads of its own (one lane a thread); false on hosts (one pack of lanes a loop iteration).
template <class Exec>
inline constexpr bool is_device = !bool(Kokkos::SpaceAccessibility<Exec, Kokkos::HostSpace>::accessible);

/// True if `Exec` may dereference memory of `Mem` (a memory space, or a View).
template <class Exec, class Mem>
inline constexpr bool can_access = bool(Kokkos::SpaceAccessibility<Exec, typename Mem::memory_space>::accessible);

namespace detail {
/// Threads of an instance of a host. (Within a parallel region Kokkos says how many the region has.)
template <class Exec>
int host_threads(Exec const& exec) {
#ifdef KOKKOS_ENABLE_OPENMP
  if constexpr (std::is_same_v<Exec, Kokkos::OpenMP>) return exec.impl_internal_space_instance()->thread_pool_size();
#endif
  return exec.concurrency();
}
}  // namespace detail

/// The policy, with the kernel's functor travelling with the launch. By itself Kokkos puts functors of more than 512 bytes into a constant
/// buffer of the device, and the host then waits at each launch for the kernel before.
template <class Policy>
auto lightweight(Policy const& policy) {
  if constexpr (is_device<typename Policy::execution_space>)
    return Kokkos::Experimental::require(policy, Kokkos::Experimental::WorkItemProperty::HintLightWeight);
  else
    return policy;
}

}  // namespace gsp
