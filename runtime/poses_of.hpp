#pragma once
#include <gsp/model/poses.hpp>
#include <gsp/runtime/stepper.hpp>
#include <string>

#include "device.hpp"

namespace gsp::runtime {

/// The poses where they are, of arrays of R on the device of Exec. `function` is what messages call the caller.
template <class R, class Exec>
Poses<R, typename Exec::memory_space> poses_of(std::string const& function, PoseArrays const& p) {
  for (auto const* const a : {&p.xpos, &p.xquat})
    expects(a->device == device_of<Exec>() && a->dtype == dtype_of<R>() && a->rank == 3 && a->contiguous(),
            function + ": poses must lie on its device, (worlds, bodies, 3 | 4) one after the other");
  using View = typename Poses<R, typename Exec::memory_space>::template View<R***>;
  Poses<R, typename Exec::memory_space> poses;
  poses.xpos = View(static_cast<R*>(p.xpos.data), p.xpos.extents[0], p.xpos.extents[1], 3);
  poses.xquat = View(static_cast<R*>(p.xquat.data), p.xquat.extents[0], p.xquat.extents[1], 4);
  return poses;
}

}  // namespace gsp::runtime
