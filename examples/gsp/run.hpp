#pragma once
#include <functional>
#include <nlohmann/json.hpp>

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

/// What --json prints of steps: how fast, how large, what the last one met, and the hash of the states.
nlohmann::ordered_json steps_json(Stepper& stepper, Device device, int worlds, Timing const& timing, double startup);

}  // namespace gsp_cli
