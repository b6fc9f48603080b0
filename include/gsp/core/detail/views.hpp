#pragma once
#include <cstdint>
#include <cstring>
#include <gsp/core/exec.hpp>
#include <string>
#include <utility>
#include <vector>

/// Allocating, zeroing and copying views by their bytes, so that it compiles once for all of them: Kokkos' functions for this are
/// instantiated for every type of view and execution space, which was half of what a user's file compiled. Views here are contiguous.
namespace gsp::detail {

/// Bytes that `allocate` has handed out on this thread so far; differences of it are what a piece of code needs (step/bytes_needed.hpp).
inline std::int64_t& allocated_bytes() {
  thread_local std::int64_t bytes = 0;
  return bytes;
}
/// Without values.
template <class View>
View allocate(std::string const& label, auto... extents) {
  View const view(Kokkos::view_alloc(label, Kokkos::WithoutInitializing), extents...);
  allocated_bytes() += std::int64_t(view.span() * sizeof(typename View::value_type));
  return view;
}

struct ZeroWords {
  char* data;
  std::int64_t bytes;
  bool aligned;  // allocations are; a state's views may be parts of a user's arrays
  KOKKOS_FUNCTION void operator()(std::int64_t word) const {
    std::int64_t const at = 8 * word, end = at + 8 < bytes ? at + 8 : bytes;
    if (aligned && at + 8 <= bytes)
      *reinterpret_cast<std::uint64_t*>(data + at) = 0;
    else
      for (std::int64_t i = at; i < end; ++i) data[i] = 0;
  }
};
template <class Exec>
void zero_bytes(Exec const& exec, void* data, std::int64_t bytes) {
  Kokkos::parallel_for("gsp::core::zero", Kokkos::RangePolicy<Exec, Kokkos::IndexType<std::int64_t>>(exec, 0, (bytes + 7) / 8),
                       ZeroWords{static_cast<char*>(data), bytes, reinterpret_cast<std::uintptr_t>(data) % 8 == 0});
}
/// In the order of `exec`: after what was launched before, and there once `exec` is fenced (on a host at once).
template <class To, class From, class Exec>
void transfer_bytes(Exec const& exec, void* to, void const* from, std::size_t bytes) {
  if (bytes == 0) return;
  if constexpr (is_device<Exec>) {
    using Unmanaged = Kokkos::MemoryTraits<Kokkos::Unmanaged>;
    Kokkos::deep_copy(exec, Kokkos::View<char*, To, Unmanaged>(static_cast<char*>(to), bytes),
                      Kokkos::View<char const*, From, Unmanaged>(static_cast<char const*>(from), bytes));
  } else {
    exec.fence("gsp::core::copy: what was launched before uses the old values");
    std::memcpy(to, from, bytes);
  }
}
/// From the host to the memory of `exec`; the host's side must stay as it is until `exec` is fenced.
template <class Exec>
void upload_bytes(Exec const& exec, void* to, void const* from, std::size_t bytes) {
  transfer_bytes<typename Exec::memory_space, Kokkos::HostSpace>(exec, to, from, bytes);
}
template <class Exec>
void download_bytes(Exec const& exec, void* to, void const* from, std::size_t bytes) {
  transfer_bytes<Kokkos::HostSpace, typename Exec::memory_space>(exec, to, from, bytes);
}
/// Within the memory of `exec`.
template <class Exec>
void copy_bytes(Exec const& exec, void* to, void const* from, std::size_t bytes) {
  transfer_bytes<typename Exec::memory_space, typename Exec::memory_space>(exec, to, from, bytes);
}

/// Rows first ... first + count - 1, of which the view keeps the whole.
template <class View>
View rows_of(View const& view, int first, int count) {
  std::pair<int, int> const rows(first, first + count);
  if constexpr (View::rank() == 1)
    return Kokkos::subview(view, rows);
  else if constexpr (View::rank() == 2)
    return Kokkos::subview(view, rows, Kokkos::ALL);
  else
    return Kokkos::subview(view, rows, Kokkos::ALL, Kokkos::ALL);
}
template <class View>
std::size_t bytes_of(View const& v) {
  return v.span() * sizeof(typename View::value_type);
}
/// All of `from`, within the memory of `exec`, to a view of the same layout.
template <class Exec, class From, class To>
void copy_view(Exec const& exec, From const& from, To const& to) {
  copy_bytes(exec, to.data(), from.data(), bytes_of(from));
}
template <class Exec, class View>
void zero(Exec const& exec, View const& v) {
  zero_bytes(exec, v.data(), std::int64_t(bytes_of(v)));
}
template <class View, class Exec>
View allocate_zero(Exec const& exec, std::string const& label, auto... extents) {
  auto const v = allocate<View>(label, extents...);
  zero(exec, v);
  return v;
}
/// A view that holds what `v` holds. Fences.
template <class View, class T, class Exec>
View to_device(Exec const& exec, std::string const& label, std::vector<T> const& v) {
  static_assert(std::is_same_v<T, typename View::value_type>);
  auto const result = allocate<View>(label, v.size());
  upload_bytes(exec, result.data(), v.data(), v.size() * sizeof(T));
  exec.fence("gsp::core::to_device: the host array may go now");
  return result;
}
/// What the view holds now. Fences.
template <class Exec, class View>
std::vector<typename View::non_const_value_type> to_host(Exec const& exec, View const& v) {
  std::vector<typename View::non_const_value_type> result(v.span());
  download_bytes(exec, result.data(), v.data(), bytes_of(v));
  exec.fence("gsp::core::to_host: the host reads");
  return result;
}

}  // namespace gsp::detail
