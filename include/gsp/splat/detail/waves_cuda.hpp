#pragma once
#include <deque>
#include <gsp/parallel/detail/launch_cuda.hpp>
#include <gsp/splat/frames.hpp>
#include <vector>

namespace gsp::detail {

/// Waves that go at the same time as a frames' own, each in a stream of its own: what sorts lists waits for memory while what blends
/// pixels is bound by instructions, and the last blocks of a kernel leave most of the GPU to the next wave's.
template <class Mem>
class WavesBeside {
 public:
  WavesBeside(Kokkos::Cuda const& exec, int count)
      : waves(std::size_t(count)),
        begin_(exec.cuda_device()),
        instances_(Kokkos::Experimental::partition_space(exec, std::vector<int>(std::size_t(count), 1))) {
    for (int i = 0; i < count; ++i) done_.emplace_back(exec.cuda_device());
  }
  WavesBeside(WavesBeside const&) = delete;
  WavesBeside& operator=(WavesBeside const&) = delete;

  std::vector<SplatWave<Mem>> waves;  // as large as the frames' own
  Kokkos::Cuda const& instance(int i) const { return instances_[std::size_t(i)]; }
  /// What comes in the instances is after all that is in `exec`.
  void fork(Kokkos::Cuda const& exec) const {
    cuda_expects(cudaSetDevice(exec.cuda_device()), "gsp::render");
    cuda_expects(cudaEventRecord(begin_.event, exec.cuda_stream()), "gsp::render: an event");
    for (auto const& instance : instances_)
      cuda_expects(cudaStreamWaitEvent(instance.cuda_stream(), begin_.event), "gsp::render: an event");
  }
  /// What comes in `exec` is after all that is in the instances.
  void join(Kokkos::Cuda const& exec) const {
    for (std::size_t i = 0; i < instances_.size(); ++i) {
      cuda_expects(cudaEventRecord(done_[i].event, instances_[i].cuda_stream()), "gsp::render: an event");
      cuda_expects(cudaStreamWaitEvent(exec.cuda_stream(), done_[i].event), "gsp::render: an event");
    }
  }

 private:
  struct Event {
    cudaEvent_t event = nullptr;
    explicit Event(int device) {
      cuda_expects(cudaSetDevice(device), "gsp::make_frames");
      cuda_expects(cudaEventCreateWithFlags(&event, cudaEventDisableTiming), "gsp::make_frames: an event");
    }
    Event(Event const&) = delete;
    Event& operator=(Event const&) = delete;
    ~Event() { static_cast<void>(cudaEventDestroy(event)); }  // CUDA may be gone: what it says then is of no use
  };
  Event begin_;
  std::deque<Event> done_;
  std::vector<Kokkos::Cuda> instances_;
};

/// What another wave needed is needed; it begins anew.
template <class Mem>
struct JoinNeeded {
  Kokkos::View<std::int64_t[3], Kokkos::LayoutRight, Mem> needed, others;
  KOKKOS_FUNCTION void operator()(int) const {
    for (int k = 0; k < 3; ++k) {
      needed(k) = others(k) > needed(k) ? others(k) : needed(k);
      others(k) = 0;
    }
  }
};

/// The waves beside have the sizes of the frames' own.
template <class Mem>
void reserve_beside(Kokkos::Cuda const& exec, Frames<Mem>& frames) {
  auto const& own = frames.wave;
  for (auto& wave : frames.beside->waves) {
    if (wave.visible_capacity == own.visible_capacity && wave.pair_capacity == own.pair_capacity &&
        wave.values_a_splat == own.values_a_splat)
      continue;
    wave.values_a_splat = own.values_a_splat;
    reserve(exec, own.visible_capacity, own.pair_capacity, wave);
  }
}

/// draw(instance, frames, first) for the waves from `first` on, wave k in the buffers and the instance of k modulo how many there are.
template <class Mem, class Draw>
void side_by_side(Kokkos::Cuda const& exec, Frames<Mem>& frames, int first, Draw const& draw) {
  reserve_beside(exec, frames);
  auto& beside = *frames.beside;
  std::vector<Frames<Mem>> all{frames};
  for (auto const& wave : beside.waves) {
    all.push_back(frames);
    all.back().wave = wave;
  }
  beside.fork(exec);
  try {
    std::size_t k = 0;
    for (int begin = first; begin < frames.images; begin += frames.wave.batch) {
      draw(k == 0 ? exec : beside.instance(int(k) - 1), all[k], begin);
      k = (k + 1) % all.size();
    }
  } catch (...) {  // whoever goes on finds all of it in `exec`, and nothing needed
    beside.join(exec);
    for (auto const& wave : beside.waves) Kokkos::deep_copy(exec, wave.needed, 0);
    throw;
  }
  beside.join(exec);
  frames.wave = all[0].wave;
  for (std::size_t i = 1; i < all.size(); ++i) {
    beside.waves[i - 1] = all[i].wave;
    Kokkos::parallel_for("gsp::splat::render_needed", lightweight(Kokkos::RangePolicy<Kokkos::Cuda>(exec, 0, 1)),
                         JoinNeeded<Mem>{frames.wave.needed, all[i].wave.needed});
  }
}

}  // namespace gsp::detail
