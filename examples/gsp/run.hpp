#pragma once
#include <functional>

#include "stepper.hpp"

namespace gsp_cli {

struct Timing {
  double seconds = 0;
  long long steps = 0;  // that were timed
};

/// Steps, timing those from `time_from` on; calls record(done) after every `every` steps and progress(done) some fifty times, where they
/// are given.
Timing run_steps(Stepper& stepper, long long steps, long long time_from, bool with_controls, long long every,
                 std::function<void(long long)> const& record, std::function<void(long long)> const& progress);

}  // namespace gsp_cli
