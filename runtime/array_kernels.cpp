#include <Kokkos_Core.hpp>
#include <cstring>
#include <gsp/core/detail/views.hpp>
#include <gsp/runtime/array.hpp>

#include "device.hpp"

namespace gsp::runtime {

std::int64_t bytes_of(Dtype dtype) {
  if (dtype == Dtype::uint8) return 1;
  return dtype == Dtype::float64 || dtype == Dtype::int64 ? 8 : 4;
}

Array make_array(void* data, Dtype dtype, Device device, std::initializer_list<std::int64_t> extents) {
  Array a;
  expects(extents.size() <= a.extents.size(), "gsp::runtime::make_array: an array has at most four indices");
  a.data = data;
  a.dtype = dtype;
  a.device = device;
  a.rank = static_cast<int>(extents.size());
  std::copy(extents.begin(), extents.end(), a.extents.begin());
  std::int64_t step = 1;
  for (int k = a.rank; k-- > 0; step *= a.extents[k]) a.strides[k] = step;
  return a;
}

Array Array::rows(std::int64_t first, std::int64_t count) const {
  expects(rank > 0 && first >= 0 && count >= 0 && first + count <= extents[0],
          "gsp::runtime::Array::rows: rows " + std::to_string(first) + " to " + std::to_string(first + count) + " of " +
              std::to_string(rank > 0 ? extents[0] : 0) + " are asked for");
  Array part = *this;
  part.data = static_cast<char*>(data) + first * strides[0] * bytes_of(dtype);
  part.extents[0] = count;
  return part;
}

/// to = from by strides, item i of `to` in its own order.
template <class To, class From>
struct CopyItems {
  To* to;
  From const* from;
  std::int64_t extents[4], to_strides[4], from_strides[4];
  KOKKOS_FUNCTION void operator()(std::int64_t i) const {
    std::int64_t at_to = 0;
    std::int64_t at_from = 0;
    for (int k = 3; k >= 0; --k) {
      std::int64_t const index = i % extents[k];
      i /= extents[k];
      at_to += index * to_strides[k];
      at_from += index * from_strides[k];
    }
    to[at_to] = static_cast<To>(from[at_from]);
  }
};

namespace {

/// A memory of Exec that lives while somebody refers to it.
template <class Exec>
std::shared_ptr<void> allocate(Exec const& exec, std::int64_t bytes) {
  using Memory = Kokkos::View<std::uint64_t*, typename Exec::memory_space>;
  auto const memory = std::make_shared<Memory>(gsp::detail::allocate_zero<Memory>(exec, "gsp::runtime::Buffer", (bytes + 7) / 8));
  return std::shared_ptr<void>(memory, memory->data());
}

template <class To, class From, class Exec>
void copy_items(Exec const& exec, Array const& from, Array const& to) {
  CopyItems<To, From> items{static_cast<To*>(to.data), static_cast<From const*>(from.data), {1, 1, 1, 1}, {}, {}};
  for (int k = 0; k < to.rank; ++k) {
    items.extents[k] = to.extents[k];
    items.to_strides[k] = to.strides[k];
    items.from_strides[k] = k == 0 && from.extents[0] == 1 ? 0 : from.strides[k];
  }
  Kokkos::parallel_for("gsp::runtime::copy", Kokkos::RangePolicy<Exec, Kokkos::IndexType<std::int64_t>>(exec, 0, to.size()), items);
}

/// Both on the device of `exec`.
template <class Exec>
void copy_there(Exec const& exec, Array const& from, Array const& to) {
  if (to.size() == 0) return;
  if (from.dtype == Dtype::float32 && to.dtype == Dtype::float64)
    copy_items<double, float>(exec, from, to);
  else if (from.dtype == Dtype::float64 && to.dtype == Dtype::float32)
    copy_items<float, double>(exec, from, to);
  else if (bytes_of(from.dtype) == 8)
    copy_items<std::uint64_t, std::uint64_t>(exec, from, to);
  else if (bytes_of(from.dtype) == 1)
    copy_items<std::uint8_t, std::uint8_t>(exec, from, to);
  else
    copy_items<std::uint32_t, std::uint32_t>(exec, from, to);
}

/// A place for the numbers of `like`, one after the other, on a device; with the rows that it has.
Buffer staging(Device device, Dtype dtype, Array const& like) {
  Buffer b;
  b.array = like;
  b.array.dtype = dtype;
  b.array.device = device;
  b.array.read_only = false;  // whatever `like` is
  std::int64_t step = 1;
  for (int k = like.rank; k-- > 0; step *= like.extents[k]) b.array.strides[k] = step;
  on_device(device, [&](auto const& exec) { b.owner = allocate(exec, like.size() * bytes_of(dtype)); });
  b.array.data = b.owner.get();
  return b;
}

}  // namespace

Buffer make_buffer(Device device, Dtype dtype, std::initializer_list<std::int64_t> extents) {
  return staging(device, dtype, make_array(nullptr, dtype, device, extents));
}

void copy(Array const& from, Array to) {
  bool same = from.rank == to.rank;
  for (int k = 0; k < to.rank && same; ++k) same = from.extents[k] == to.extents[k] || (k == 0 && from.extents[0] == 1);
  auto const shape = [](Array const& a) {
    std::string text = "(";
    for (int k = 0; k < a.rank; ++k) text += (k == 0 ? "" : ", ") + std::to_string(a.extents[k]);
    return text + ")";
  };
  expects(same, "gsp::runtime::copy: the shapes " + shape(from) + " and " + shape(to) + " differ; give the same, or one row for all");
  auto const is_float = [](Dtype d) { return d == Dtype::float32 || d == Dtype::float64; };
  expects(from.dtype == to.dtype || (is_float(from.dtype) && is_float(to.dtype)),
          "gsp::runtime::copy: an integer array is copied to one of the same kind alone");
  expects(!to.read_only, "gsp::runtime::copy: the array to be written is read-only");
  if (to.size() == 0) return;
  if (from.device == to.device) {
    on_device(to.device, [&](auto const& exec) { copy_there(exec, from, to); });
    if (to.device == Device::cpu) Kokkos::DefaultHostExecutionSpace().fence("gsp::runtime::copy: done");
    return;
  }
  // By bytes from one device to the other, with numbers one after the other and of the kind that is wanted; the device does the changes.
  Device const device = from.device == Device::cpu ? to.device : from.device;
  on_device(device, [&](auto const& exec) {
    if (from.device == Device::cpu) {
      Buffer packed;
      Array source = from;
      if (!from.contiguous()) {
        packed = staging(Device::cpu, from.dtype, from);
        copy(from, packed.array);
        source = packed.array;
      }
      bool const direct = to.contiguous() && from.dtype == to.dtype && from.extents == to.extents;
      Buffer const there = direct ? Buffer{} : staging(device, from.dtype, from);
      gsp::detail::upload_bytes(exec, direct ? to.data : there.array.data, source.data, std::size_t(from.size() * bytes_of(from.dtype)));
      if (!direct) copy_there(exec, there.array, to);
      exec.fence("gsp::runtime::copy: the host's array may go");
    } else {
      bool const direct = from.contiguous() && from.dtype == to.dtype && from.extents == to.extents;
      Buffer const there = direct ? Buffer{} : staging(device, to.dtype, to);
      if (!direct) copy_there(exec, from, there.array);
      Buffer const packed = to.contiguous() ? Buffer{} : staging(Device::cpu, to.dtype, to);
      gsp::detail::download_bytes(exec, to.contiguous() ? to.data : packed.array.data, direct ? from.data : there.array.data,
                                  std::size_t(to.size() * bytes_of(to.dtype)));
      exec.fence("gsp::runtime::copy: the host reads");
      if (!to.contiguous()) copy(packed.array, to);
    }
  });
}

}  // namespace gsp::runtime
