#pragma once
#include <array>
#include <cstdint>
#include <gsp/core/check.hpp>
#include <initializer_list>
#include <memory>

/// gsp::runtime: the library compiled once, float and double, CPU and CUDA, behind plain structs and virtual calls. Its headers name no
/// Kokkos, so that programs and language bindings are plain C++ in a CUDA build too.
namespace gsp::runtime {

enum class Device { cpu, cuda };
enum class Dtype { float32, float64, int32, int64, uint32, uint8 };

std::int64_t bytes_of(Dtype dtype);

template <class T>
constexpr Dtype dtype_of() {
  using Item = std::remove_const_t<T>;
  if constexpr (std::is_same_v<Item, float>)
    return Dtype::float32;
  else if constexpr (std::is_same_v<Item, double>)
    return Dtype::float64;
  else if constexpr (std::is_same_v<Item, int>)
    return Dtype::int32;
  else if constexpr (std::is_same_v<Item, std::int64_t>)
    return Dtype::int64;
  else if constexpr (std::is_same_v<Item, std::uint32_t>)
    return Dtype::uint32;
  else {
    static_assert(std::is_same_v<Item, std::uint8_t>,
                  "gsp::runtime: arrays hold float, double, int, std::int64_t, std::uint32_t or std::uint8_t");
    return Dtype::uint8;
  }
}

/// Numbers on a device (or the host, Device::cpu) that somebody else owns: the very memory that kernels work on. data == nullptr: none.
struct Array {
  void* data = nullptr;
  Dtype dtype = Dtype::float32;
  Device device = Device::cpu;
  bool read_only = false;
  int rank = 0;
  std::array<std::int64_t, 4> extents{};  // the first is the world (or picture)
  std::array<std::int64_t, 4> strides{};  // in numbers, not bytes; rows one after the other unless somebody else says otherwise

  explicit operator bool() const { return data != nullptr; }
  std::int64_t size() const {
    std::int64_t n = 1;
    for (int k = 0; k < rank; ++k) n *= extents[k];
    return n;
  }
  /// True if the numbers lie one after the other, the last index fastest.
  bool contiguous() const {
    std::int64_t step = 1;
    for (int k = rank; k-- > 0; step *= extents[k])
      if (extents[k] != 1 && strides[k] != step) return false;
    return true;
  }
  /// Rows first ... first + count - 1: a part of this very memory.
  Array rows(std::int64_t first, std::int64_t count) const;
};

/// Numbers at `data`, one after the other.
Array make_array(void* data, Dtype dtype, Device device, std::initializer_list<std::int64_t> extents);
template <class T>
Array host_array(T* data, std::initializer_list<std::int64_t> extents) {
  Array a = make_array(const_cast<std::remove_const_t<T>*>(data), dtype_of<T>(), Device::cpu, extents);
  a.read_only = std::is_const_v<T>;
  return a;
}

/// An array and what keeps its memory.
struct Buffer {
  Array array;
  std::shared_ptr<void> owner;
};
/// Allocates, zeros. A Session must be there (session.hpp).
Buffer make_buffer(Device device, Dtype dtype, std::initializer_list<std::int64_t> extents);

/// to = from, between any two devices, float32 and float64 into one another (the integers as they are). Shapes are equal; a `from` whose
/// first extent is 1 is given to all rows of `to`. On one GPU it is launched after what was launched before and not waited for; where
/// the host takes part it is done on return. Between devices it allocates where numbers have to change or do not lie one after the other.
void copy(Array const& from, Array to);

}  // namespace gsp::runtime
