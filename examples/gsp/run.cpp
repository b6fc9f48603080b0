#include "run.hpp"

#include <chrono>

namespace gsp_cli {

Timing run_steps(Stepper& stepper, long long steps, long long time_from, bool with_controls, long long every,
                 std::function<void(long long)> const& record, std::function<void(long long)> const& progress) {
  using clock = std::chrono::steady_clock;
  Timing t;
  for (long long done = 0; done < steps;) {
    // up to the next point where something happens: the clock starts, a state is recorded, controls change, the last step (measured)
    long long next = steps - done > 1 ? steps - 1 : steps;
    if (done < time_from) next = std::min(next, time_from);
    if (record) next = std::min(next, (done / every + 1) * every);
    if (with_controls) next = done + 1;
    if (progress) next = std::min(next, done + std::max(1LL, steps / 50));
    auto const start = clock::now();
    if (with_controls) stepper.apply(static_cast<std::size_t>(done));
    stepper.step(static_cast<int>(std::min(next - done, 100000LL)), next == steps);
    double const seconds = std::chrono::duration<double>(clock::now() - start).count();
    next = std::min(next, done + 100000);
    if (done >= time_from) t.seconds += seconds, t.steps += next - done;
    done = next;
    if (record && done % every == 0) record(done);
    if (progress) progress(done);
  }
  return t;
}

nlohmann::ordered_json steps_json(Stepper& stepper, Device device, int worlds, Timing const& timing, double startup) {
  std::vector<double> qpos, qvel;
  stepper.get(qpos, qvel);
  auto const counts = stepper.counts();
  return {{"seconds", timing.seconds},
          {"steps_per_second", double(worlds) * double(timing.steps) / timing.seconds},
          {"startup_seconds", startup},
          {"peak_bytes", peak_bytes(device)},
          {"contacts", counts.contacts},
          {"rows", counts.rows},
          {"iterations", counts.iterations},
          {"residual", counts.residual},
          {"state_hash", hash_of({&qpos, &qvel})},
          {"worlds", worlds},
          {"failed_worlds", counts.failed_worlds}};
}

}  // namespace gsp_cli
