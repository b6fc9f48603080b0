#pragma once
#include <cstdint>

namespace gsp::runtime {

/// See free_bytes and peak_bytes (session.hpp), for the CPU.
std::uint64_t free_host_bytes();
std::uint64_t peak_host_bytes();

}  // namespace gsp::runtime
