// A tool of Kokkos (KOKKOS_TOOLS_LIBS) that counts what it is told, for a test that reads the counts in the same process.
#include <cstdint>
#include <cstring>

namespace {
struct Space {  // Kokkos_Profiling_SpaceHandle
  char name[64];
};
long counts[3] = {};  // allocations, copies, copies between spaces
}  // namespace

extern "C" {
void kokkosp_allocate_data(Space, char const* label, void const*, std::uint64_t) {
  if (std::strncmp(label, "Kokkos::", 8) != 0) ++counts[0];  // Kokkos' own scratch grows once
}
void kokkosp_begin_deep_copy(Space to, char const*, void const*, Space from, char const*, void const*, std::uint64_t) {
  ++counts[1];
  if (std::strcmp(to.name, from.name) != 0) ++counts[2];
}
long gsp_count(int which) { return counts[which]; }
}
