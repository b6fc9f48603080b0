#pragma once
// The most bytes that were allocated at once in a memory space, through the Kokkos Tools callbacks: views, and Kokkos' own scratch.
#include <Kokkos_Core.hpp>
#include <cstdint>
#include <cstring>

namespace gsp_bench {

namespace detail {
struct CountedBytes {
  char const* space = nullptr;
  std::int64_t now = 0, peak = 0;
};
inline CountedBytes counted;  // callbacks are plain functions, so what they write to is global

inline void allocated(Kokkos_Profiling_SpaceHandle space, char const*, void const*, std::uint64_t bytes) {
  if (std::strcmp(space.name, counted.space) != 0) return;
  counted.now += std::int64_t(bytes);
  counted.peak = counted.now > counted.peak ? counted.now : counted.peak;
}
inline void freed(Kokkos_Profiling_SpaceHandle space, char const*, void const*, std::uint64_t bytes) {
  if (std::strcmp(space.name, counted.space) == 0) counted.now -= std::int64_t(bytes);
}
}  // namespace detail

/// Counts from here until `stop`, which gives the peak above what there was here. One at a time; callbacks that were set are put back.
template <class Mem>
class PeakBytes {
 public:
  PeakBytes() : before_(Kokkos::Tools::Experimental::get_callbacks()) {
    detail::counted = {Mem::name(), 0, 0};
    Kokkos::Tools::Experimental::set_allocate_data_callback(detail::allocated);
    Kokkos::Tools::Experimental::set_deallocate_data_callback(detail::freed);
  }
  PeakBytes(PeakBytes const&) = delete;
  PeakBytes& operator=(PeakBytes const&) = delete;
  ~PeakBytes() { Kokkos::Tools::Experimental::set_callbacks(before_); }
  std::int64_t stop() {
    Kokkos::Tools::Experimental::set_callbacks(before_);
    return detail::counted.peak;
  }

 private:
  Kokkos::Tools::Experimental::EventSet before_;
};

}  // namespace gsp_bench
