#include "device.hpp"

#include <time.h>

#include <cstdio>

namespace gsp_cli {
namespace {

double now() {
  timespec t{};
  clock_gettime(CLOCK_MONOTONIC, &t);
  return double(t.tv_sec) + 1e-9 * double(t.tv_nsec);
}
double const program_start = now();

std::string gigabytes(std::uint64_t bytes) {
  char text[32];
  std::snprintf(text, sizeof text, bytes < 10'000'000 ? "%.2g GB" : "%.3g GB", 1e-9 * double(bytes));
  return text;
}

}  // namespace

Option device_option() {
  return {"--device", "cpu|cuda", "where to compute; without it CUDA if this program was built with it, else the CPU"};
}
Option threads_option() {
  return {"--threads", "T", "threads of the CPU, up to 512; without it as many as find work, of all (also OMP_NUM_THREADS)"};
}
Option quiet_option() { return {"--quiet", "", "neither progress nor notes on stderr"}; }

Device choose_device(Arguments const& arguments) {
  if (!gsp::runtime::has_cuda()) {
    if (arguments.choice("--device", {"cpu", "cuda"}, "cpu") == "cuda")
      arguments.fail(
          "--device cuda: this program was built without CUDA; build it with scripts/quickstart --cuda --build-only, or give --device cpu");
    return Device::cpu;
  }
  auto const choice = arguments.choice("--device", {"cpu", "cuda"}, "cuda");
  if (gsp::runtime::gpu_count() == 0)
    arguments.fail(
        "this program was built for CUDA and finds no GPU; run it on a machine with one, or the build without CUDA (scripts/quickstart "
        "--cpu)");
  if (choice == "cpu") return Device::cpu;
  gsp::runtime::start_gpu();
  return Device::cuda;
}

int threads_of(Arguments const& arguments) { return static_cast<int>(arguments.integer("--threads", 0, 1, gsp::runtime::most_threads)); }

bool quiet(Arguments const& arguments) { return arguments.has("--quiet") || arguments.has("--json"); }

void expect_memory(std::string const& what, Device device, std::uint64_t device_bytes, std::uint64_t host_bytes,
                   std::string const& remedy) {
  auto const expect = [&](std::uint64_t needed, Device where) {
    std::uint64_t const free = gsp::runtime::free_bytes(where);
    if (needed > free)
      throw Error(what + " need " + gigabytes(needed) + " of memory " + (where == Device::cuda ? "on the GPU" : "on the host") + ", and " +
                  gigabytes(free) + " are free; give " + remedy);
  };
  if (device == Device::cuda) {
    expect(device_bytes, Device::cuda);
    expect(host_bytes, Device::cpu);
  } else {
    expect(device_bytes + host_bytes, Device::cpu);
  }
}

double seconds_since_start() { return now() - program_start; }

}  // namespace gsp_cli
