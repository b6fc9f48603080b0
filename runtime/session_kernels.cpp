#include <Kokkos_Core.hpp>
#include <atomic>
#include <cstdlib>
#include <cstring>
#include <gsp/runtime/session.hpp>
#include <system_error>
#include <thread>
#ifdef KOKKOS_ENABLE_OPENMP
#include <omp.h>
#endif

#include "device.hpp"
#include "memory.hpp"

namespace gsp::runtime {
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

#if defined(KOKKOS_ENABLE_OPENMP) && KOKKOS_VERSION < 50000
static_assert(most_threads <= Kokkos::Impl::OpenMPTraits::MAX_THREAD_COUNT, "the pool of Kokkos is smaller than gsp::runtime thinks");
#endif

/// What Kokkos would take, and who says so.
void expect_threads(int& threads) {
  auto const expect = [](long wanted, std::string const& who) {
    if (wanted > most_threads)
      throw Error(who + " asks for " + std::to_string(wanted) + " threads, and Kokkos has room for " + std::to_string(most_threads) +
                  "; give fewer");
  };
  if (threads > 0) return expect(threads, "gsp::runtime::Session");
  if (char const* const text = std::getenv("KOKKOS_NUM_THREADS")) return expect(std::atol(text), "KOKKOS_NUM_THREADS");
#ifdef KOKKOS_ENABLE_OPENMP
  if (std::getenv("OMP_NUM_THREADS")) return expect(omp_get_max_threads(), "OMP_NUM_THREADS");
  if (omp_get_max_threads() > most_threads) threads = most_threads;  // a machine with more
#endif
}

#ifdef KOKKOS_ENABLE_CUDA
/// What start_gpu began; it ends before CUDA does, whose first call comes before this function's.
std::jthread& gpu_start() {
  static std::jthread thread;
  return thread;
}

/// `then` goes on where `first` has come to by now.
void follows(cudaStream_t then, cudaStream_t first) {
  auto const expect = [](cudaError_t error) {
    if (error != cudaSuccess) throw Error(std::string("CUDA does not know this stream: ") + cudaGetErrorString(error));
  };
  cudaEvent_t event;
  expect(cudaEventCreateWithFlags(&event, cudaEventDisableTiming));
  cudaError_t const recorded = cudaEventRecord(event, first),
                    waits = recorded == cudaSuccess ? cudaStreamWaitEvent(then, event, 0) : recorded;
  cudaEventDestroy(event);  // once it has happened
  expect(waits);
}
cudaStream_t stream_of(std::uintptr_t number) {
  return number == 1 ? cudaStreamLegacy : number == 2 ? cudaStreamPerThread : reinterpret_cast<cudaStream_t>(number);
}
#endif

}  // namespace

Session::Session(int threads) {
#ifdef KOKKOS_ENABLE_CUDA
  if (gpu_start().joinable()) gpu_start().join();  // before all else: it reads the environment, which is written below
#endif
  expect_threads(threads);
  setenv("OMP_PROC_BIND", "false", 0);  // threads move freely unless the user pins them; Kokkos warns when this is not said
  Kokkos::Tools::Experimental::set_allocate_data_callback(allocated);
  Kokkos::Tools::Experimental::set_deallocate_data_callback(freed);
  Kokkos::InitializationSettings settings;
  if (threads > 0) settings.set_num_threads(threads);
  settings.set_disable_warnings(true);
  Kokkos::initialize(settings);
}
Session::~Session() { Kokkos::finalize(); }

bool has_cuda() {
#ifdef KOKKOS_ENABLE_CUDA
  return true;
#else
  return false;
#endif
}

int gpu_count() {
  int count = 0;
#ifdef KOKKOS_ENABLE_CUDA
  if (cudaGetDeviceCount(&count) != cudaSuccess) count = 0;
#endif
  return count;
}

void start_gpu() {
#ifdef KOKKOS_ENABLE_CUDA
  // one process of several, or told which GPU: Kokkos chooses another than the first
  for (char const* const chooses :
       {"KOKKOS_DEVICE_ID", "KOKKOS_VISIBLE_DEVICES", "KOKKOS_MAP_DEVICE_ID_BY", "OMPI_COMM_WORLD_LOCAL_RANK", "MV2_COMM_WORLD_LOCAL_RANK",
        "MPI_LOCALRANKID", "SLURM_LOCALID", "PMI_LOCAL_RANK", "FLUX_TASK_LOCAL_ID"})
    if (std::getenv(chooses) != nullptr) return;
  try {
    if (gpu_count() > 0 && !gpu_start().joinable()) gpu_start() = std::jthread([] { cudaFree(nullptr); });
  } catch (std::system_error const&) {}  // no thread to be had: the Session starts the GPU
#endif
}

int cpu_threads() { return Kokkos::DefaultHostExecutionSpace().concurrency(); }

std::string device_name(Device device, int threads) {
#ifdef KOKKOS_ENABLE_CUDA
  if (device == Device::cuda) return Kokkos::Cuda().cuda_device_prop().name;
#endif
  (void)device;
  if (threads == 0) threads = Kokkos::DefaultHostExecutionSpace().concurrency();
  return "CPU, " + std::to_string(threads) + (threads == 1 ? " thread" : " threads");
}

void wait(Device device) {
  on_device(device, [](auto const& exec) { exec.fence("gsp::runtime::wait"); });
}

void wait_for_stream([[maybe_unused]] Device device, [[maybe_unused]] std::uintptr_t stream) {
#ifdef KOKKOS_ENABLE_CUDA
  if (device == Device::cuda) follows(Kokkos::Cuda().cuda_stream(), stream_of(stream));
#endif
}
void let_stream_wait([[maybe_unused]] Device device, [[maybe_unused]] std::uintptr_t stream) {
#ifdef KOKKOS_ENABLE_CUDA
  if (device == Device::cuda) follows(stream_of(stream), Kokkos::Cuda().cuda_stream());
#endif
}

std::uint64_t peak_bytes(Device device) { return device == Device::cuda ? device_peak.load() : peak_host_bytes(); }

std::uint64_t free_bytes(Device device) {
#ifdef KOKKOS_ENABLE_CUDA
  std::size_t free = 0;
  std::size_t total = 0;
  if (device == Device::cuda && cudaMemGetInfo(&free, &total) == cudaSuccess) return free;
#endif
  (void)device;
  return free_host_bytes();
}

}  // namespace gsp::runtime
