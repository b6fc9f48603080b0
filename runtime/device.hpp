#pragma once
#include <Kokkos_Core.hpp>
#include <gsp/runtime/array.hpp>

namespace gsp::runtime {

/// f(exec) with the default instance of the device's execution space, which all of gsp::runtime works on.
template <class F>
void on_device(Device device, F const& f) {
#ifdef KOKKOS_ENABLE_CUDA
  if (device == Device::cuda) return f(Kokkos::Cuda());
#else
  expects(device == Device::cpu, "gsp::runtime: this library was built without CUDA: give Device::cpu");
#endif
  f(Kokkos::DefaultHostExecutionSpace());
}

template <class Exec>
constexpr Device device_of() {
  return std::is_same_v<Exec, Kokkos::DefaultHostExecutionSpace> ? Device::cpu : Device::cuda;
}

/// The array that a view of `Exec`'s memory is.
template <class Exec, class View>
Array array_of(View const& v) {
  Array a;
  a.data = const_cast<typename View::non_const_value_type*>(v.data());
  a.dtype = dtype_of<typename View::value_type>();
  a.device = device_of<Exec>();
  a.read_only = std::is_const_v<typename View::value_type>;
  a.rank = static_cast<int>(View::rank());
  for (int k = 0; k < a.rank; ++k) {
    a.extents[k] = static_cast<std::int64_t>(v.extent(k));
    a.strides[k] = static_cast<std::int64_t>(v.stride(k));
  }
  return a;
}

}  // namespace gsp::runtime
