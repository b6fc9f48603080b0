// A tool of Kokkos (KOKKOS_TOOLS_LIBS) that counts what it is told, for a test that reads the counts in the same process.
#include <cstdint>
#include <cstring>

namespace {
struct Space {  // Kokkos_Profiling_SpaceHandle
  char name[64];
};
long counts[3] = {};  // allocations, copies, bytes copied between the host and a device
}  // namespace

extern "C" {
void kokkosp_allocate_data(Space, char const* label, void const*, std::uint64_t) {
  if (std::strncmp(label, "Kokkos::", 8) != 0) ++counts[0];  // Kokkos' own scratch grows once
}
void kokkosp_begin_deep_copy(Space to, char const*, void const*, Space from, char const* source, void const*, std::uint64_t bytes) {
  ++counts[1];
  bool const fills = std::strcmp(source, "(none)") == 0;  // with one number
  if (!fills && std::strcmp(to.name, from.name) != 0) counts[2] += long(bytes);
}
long gsp_count(int which) { return counts[which]; }
}
