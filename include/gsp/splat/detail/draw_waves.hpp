#pragma once
#include <gsp/core/detail/views.hpp>
#include <gsp/splat/place_gaussians.hpp>
#include <string>

namespace gsp::detail {

template <class Mem>
struct ResetNeeded {
  Kokkos::View<std::int64_t[3], Kokkos::LayoutRight, Mem> needed;
  KOKKOS_FUNCTION void operator()(int) const { needed(0) = needed(1) = needed(2) = 0; }
};

/// draw(first) for the waves of all images; again, with larger buffers, for those that did not fit. Waits once at its end (the first time a
/// few times more). `worlds`: of the poses.
template <class Exec, class Mem, class Draw>
void draw_waves(std::string const& function, Exec const& exec, Frames<Mem>& frames, std::size_t worlds, Draw const& draw) {
  auto const room = [](std::int64_t n) { return std::min(n + n / 8, std::max(n, most_of_wave)); };
  // Room for the greatest wave so far; true if there was too little.
  auto const grow = [&] {
    auto const needed = to_host(exec, frames.wave.needed);
    expects(needed[2] == 0, function + ": camera " + std::to_string(needed[2] / camera_faults - 1) +
                                fault_text(CameraFault(needed[2] % camera_faults), worlds));
    bool const small = needed[0] > frames.wave.visible_capacity || needed[1] > frames.wave.pair_capacity;
    if (small)
      reserve(exec, needed[0] > frames.wave.visible_capacity ? room(needed[0]) : 0,
              needed[1] > frames.wave.pair_capacity ? room(needed[1]) : 0, frames.wave);
    return small;
  };
  Kokkos::parallel_for("gsp::splat::render_reset", Kokkos::RangePolicy<Exec>(exec, 0, 1), ResetNeeded<Mem>{frames.wave.needed});
  int first = 0;
  if (frames.wave.visible_capacity == 0 || frames.wave.pair_capacity == 0) reserve(exec, 1, 1, frames.wave);  // there was no room for more
  if (!frames.sized) {
    do draw(0);
    while (grow());
    frames.sized = true;
    first = frames.wave.batch;
  }
  for (int begin = first; begin < frames.images; begin += frames.wave.batch) draw(begin);
  while (first < frames.images && grow()) {  // repeat the waves that did not fit: few, and rarely, so their status is read on the host
    auto const status = to_host(exec, frames.status);
    for (int begin = first; begin < frames.images; begin += frames.wave.batch)
      if (status[begin] & frame_overflow) draw(begin);
  }
}

}  // namespace gsp::detail
