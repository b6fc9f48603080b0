#include <sys/resource.h>
#include <time.h>

#include <Kokkos_Core.hpp>
#include <algorithm>
#include <atomic>
#include <cstdlib>
#include <cstring>
#include <map>
#include <mutex>

#include "device.hpp"

namespace gsp_cli {
namespace {

std::atomic<std::uint64_t> device_bytes{0}, device_peak{0};

void allocated(Kokkos_Profiling_SpaceHandle space, char const*, void const*, std::uint64_t bytes) {
  if (std::strcmp(space.name, "Cuda") != 0) return;
  std::uint64_t const now = device_bytes += bytes;
  for (std::uint64_t peak = device_peak; now > peak && !device_peak.compare_exchange_weak(peak, now);) {}
}
void freed(Kokkos_Profiling_SpaceHandle space, char const*, void const*, std::uint64_t bytes) {
  if (std::strcmp(space.name, "Cuda") == 0) device_bytes -= bytes;
}

double now() {
  timespec t{};
  clock_gettime(CLOCK_MONOTONIC, &t);
  return double(t.tv_sec) + 1e-9 * double(t.tv_nsec);
}
double const program_start = now();

}  // namespace

Option device_option() {
  return {"--device", "cpu|cuda", "where to compute; without it CUDA if this program was built with it, else the CPU"};
}
Option threads_option() { return {"--threads", "T", "threads of the CPU; without it all (also OMP_NUM_THREADS)"}; }

Device choose_device(Arguments const& arguments) {
#ifdef KOKKOS_ENABLE_CUDA
  auto const choice = arguments.choice("--device", {"cpu", "cuda"}, "cuda");
  int count = 0;
  if (cudaGetDeviceCount(&count) != cudaSuccess || count == 0)
    arguments.fail(
        "this program was built for CUDA and finds no GPU; run it on a machine with one, or the build without CUDA (scripts/quickstart "
        "--cpu)");
  return choice == "cuda" ? Device::cuda : Device::cpu;
#else
  auto const choice = arguments.choice("--device", {"cpu", "cuda"}, "cpu");
  if (choice == "cuda")
    arguments.fail(
        "--device cuda: this program was built without CUDA; build it with scripts/quickstart --cuda --build-only, or give --device cpu");
  return Device::cpu;
#endif
}

Session::Session(Device, int threads) {
  setenv("OMP_PROC_BIND", "false", 0);  // threads move freely unless the user pins them; Kokkos warns when this is not said
  Kokkos::Tools::Experimental::set_allocate_data_callback(allocated);
  Kokkos::Tools::Experimental::set_deallocate_data_callback(freed);
  Kokkos::InitializationSettings settings;
  if (threads > 0) settings.set_num_threads(threads);
  settings.set_disable_warnings(true);
  Kokkos::initialize(settings);
}
Session::~Session() { Kokkos::finalize(); }

std::string device_name(Device device) {
#ifdef KOKKOS_ENABLE_CUDA
  if (device == Device::cuda) return Kokkos::Cuda().cuda_device_prop().name;
#endif
  (void)device;
  int const threads = Kokkos::DefaultHostExecutionSpace().concurrency();
  return "CPU, " + std::to_string(threads) + (threads == 1 ? " thread" : " threads");
}

std::uint64_t peak_bytes(Device device) {
  if (device == Device::cuda) return device_peak;
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<std::uint64_t>(usage.ru_maxrss) * 1024;
}

double seconds_since_start() { return now() - program_start; }

}  // namespace gsp_cli
