#pragma once
// Watches what Kokkos is asked to do while a callable runs, through the Kokkos Tools callbacks:
//   auto const seen = gsp_test::watch([&] { gsp::pgs(exec, rows); });
//   gsp_test::check_algorithm(exec, seen);        // labels start with "gsp::", no allocation, no fence, all on exec's instance
// The single checks can be called by themselves where an algorithm may, say, allocate.
// Kokkos numbers instances per CUDA stream but gives one number to all of Serial and one to all of OpenMP: there the check still finds
// work on another backend. Use other_instance(exec) as the instance under test, so that on CUDA the default stream is found out.
#include <doctest/doctest.h>

#include <Kokkos_Core.hpp>
#include <string>
#include <vector>

namespace gsp_test {

/// What happened, in order of each kind.
struct Watched {
  struct Kernel {
    std::string label;
    std::uint32_t device;  // Kokkos::Tools::Experimental::device_id of the instance
  };
  struct Allocation {
    std::string space, label;
    std::uint64_t bytes;
  };
  std::vector<Kernel> kernels;          // parallel_for, _reduce, _scan
  std::vector<Allocation> allocations;  // View and kokkos_malloc, any memory space
  std::vector<Kernel> fences;           // host waits for one instance or for all
  std::vector<std::string> copies;      // deep copies between views, "destination <- source"
};

namespace detail {
inline Watched* watched = nullptr;  // callbacks are plain functions, so what they write to is global

inline void kernel(char const* label, std::uint32_t device, std::uint64_t* id) {
  *id = 0;
  if (watched) watched->kernels.push_back({label, device});
}
inline void fence(char const* label, std::uint32_t device, std::uint64_t* id) {
  *id = 0;
  std::string const name = label;
  if (watched && name.rfind("Kokkos::Tools::", 0) != 0) watched->fences.push_back({name, device});  // not those of this very tool
}
inline void allocation(Kokkos_Profiling_SpaceHandle space, char const* label, void const*, std::uint64_t bytes) {
  std::string const name = label;
  if (watched && name.rfind("Kokkos::", 0) != 0)
    watched->allocations.push_back({space.name, name, bytes});  // Kokkos' own scratch grows once
}
inline void copy(Kokkos_Profiling_SpaceHandle, char const* to, void const*, Kokkos_Profiling_SpaceHandle, char const* from, void const*,
                 std::uint64_t) {
  if (watched) watched->copies.push_back(std::string(to) + " <- " + from);
}
}  // namespace detail

/// Runs f() and returns what it made Kokkos do. Callbacks that were set before are put back, also when f throws.
template <class F>
Watched watch(F const& f) {
  namespace tools = Kokkos::Tools::Experimental;
  Watched result;
  struct Restore {
    tools::EventSet before = tools::get_callbacks();
    ~Restore() {
      detail::watched = nullptr;
      tools::set_callbacks(before);
    }
  } restore;
  detail::watched = &result;
  tools::set_begin_parallel_for_callback(detail::kernel);
  tools::set_begin_parallel_reduce_callback(detail::kernel);
  tools::set_begin_parallel_scan_callback(detail::kernel);
  tools::set_begin_fence_callback(detail::fence);
  tools::set_allocate_data_callback(detail::allocation);
  tools::set_begin_deep_copy_callback(detail::copy);
  f();
  return result;
}

/// Every kernel carries a label "gsp::...".
inline void check_labels(Watched const& seen) {
  for (auto const& kernel : seen.kernels) CHECK_MESSAGE(kernel.label.rfind("gsp::", 0) == 0, "kernel without a gsp label: ", kernel.label);
}

/// Nothing was allocated in any memory space that Kokkos manages.
inline void check_no_allocation(Watched const& seen) {
  for (auto const& a : seen.allocations) CHECK_MESSAGE(false, "allocated ", a.bytes, " bytes in ", a.space, " for ", a.label);
}

/// The host waited for nothing.
inline void check_no_fence(Watched const& seen) {
  for (auto const& fence : seen.fences) CHECK_MESSAGE(false, "fenced: ", fence.label);
}

/// Every kernel ran on this execution space instance.
template <class Exec>
void check_instance(Exec const& exec, Watched const& seen) {
  for (auto const& kernel : seen.kernels)
    CHECK_MESSAGE(kernel.device == Kokkos::Tools::Experimental::device_id(exec), "not on the given instance: ", kernel.label);
}

/// The four promises of an algorithm, and that it did something at all.
template <class Exec>
void check_algorithm(Exec const& exec, Watched const& seen) {
  CHECK(!seen.kernels.empty());
  check_labels(seen);
  check_no_allocation(seen);
  check_no_fence(seen);
  check_instance(exec, seen);
}

/// An instance with a stream of its own where the backend has streams, else the given one.
template <class Exec>
Exec other_instance(Exec const& exec) {
#if defined(KOKKOS_ENABLE_CUDA)
  if constexpr (std::is_same_v<Exec, Kokkos::Cuda>) return Kokkos::Experimental::partition_space(exec, 1)[0];
#endif
  return exec;
}

}  // namespace gsp_test
