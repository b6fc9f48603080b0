#pragma once
#include <cstring>
#include <gsp/parallel/recording.hpp>
#include <gsp/step/step.hpp>

namespace gsp {

namespace detail {
/// The host's stamps of what a step leaves (dynamics/stamps.hpp), taken after one and set again after one that the host did not launch
/// stage by stage: of the state before its last step, as after `launch_step`.
template <class R, class Mem>
class StepStamps {
 public:
  void take(Simulation<R, Mem> const& sim) {
    quantities_.assign(sim.dynamics.stamps.data(), sim.dynamics.stamps.data() + sim.dynamics.stamps.extent(0));
    each(sim, [](auto& own, auto& of_sim) { own = of_sim; });
  }
  void set(Simulation<R, Mem> const& sim, State<R, Mem>& state) {
    std::copy(quantities_.begin(), quantities_.end(), sim.dynamics.stamps.data());
    each(sim, [](auto& own, auto& of_sim) { of_sim = own; });
    moves_on(state);
  }

 private:
  template <class F>
  void each(Simulation<R, Mem> const& sim, F const& f) {
    auto const one = [&](auto& own, auto const& view) {
      if (view.data()) f(own, view());
    };
    one(poses_, sim.poses.stamp);
    one(contacts_, sim.contacts.stamp);
    one(rows_, sim.rows.stamp);
    one(impulses_, sim.impulses.stamp);
    one(solution_, sim.solution.stamp);
  }
  std::vector<Stamp> quantities_;
  PosesStamp poses_;
  ContactsStamp contacts_;
  RowsStamp rows_;
  ImpulsesStamp impulses_;
  SolutionStamp solution_;
};
}  // namespace detail

/// A step that is launched with one call: on CUDA its twenty-odd kernels are recorded as a graph, which takes their launches, some
/// microseconds each, from the host; elsewhere it is `launch_step`. The bits are those of `step`.
/// The first step is launched as usual, the second is recorded, and so are those after anything that the graph was given has become
/// another: a pool that has grown, a buffer that was replaced, a field that has values per world now, a number of the model, an option.
/// (Views and numbers are compared, some 20 kB, not what the views show, which kernels read as they run.) Types and laws of your own are
/// kept as they are at the beginning.
/// @param model, state, sim  kept by reference: they must live as long
/// @param more  constraint types and actuator laws of your own, as for launch_step
/// Nothing is recorded where a profiling tool listens, or where a kernel of yours reads the host's memory.
template <ExecutionSpace Exec, class R, class Mem, class... More>
class StepGraph {
 public:
  LaunchOptions options;  // may change between steps

  StepGraph(Exec const& exec, Model<R, Mem> const& model, State<R, Mem>& state, Simulation<R, Mem>& sim,
            LaunchOptions const& launch_options = {}, More const&... more)
      : options(launch_options), exec_(exec), model_(&model), state_(&state), sim_(&sim), more_(more...) {}

  /// Launches so many steps and does not wait; `settle` says how many of them have to be launched again.
  void launch(int steps = 1) {
    expects(steps >= 0, "gsp::StepGraph: steps must not be negative");
    for (; steps > 0; --steps) {
      bool const same = is_as_before(), listened = Kokkos::Tools::profileLibraryLoaded();
      if (!same) {
        recording_.clear();
        may_record_ = true;
      }
      if (recording_.exists() && !listened) {
        recording_.launch(exec_);
        stamps_.set(*sim_, *state_);
        continue;
      }
      if (same && may_record_ && !listened && recording_.record(exec_, [&] { launch_one(); })) {
        ++recorded_;
        recording_.launch(exec_);
        stamps_.take(*sim_);
      } else {
        if (same && !listened) may_record_ = false;  // it could not be done: not again before something changes
        launch_one();
      }
      keep();
    }
  }
  /// As `gsp::step`: waits at its end, and does again what did not fit.
  /// @param poses  leave simulation.poses of the end
  void step(int steps = 1, bool poses = true) {
    expects(steps >= 0, "gsp::StepGraph: steps must not be negative");
    if (steps == 0 && poses) forward_kinematics(exec_, *model_, *state_, sim_->poses, sim_->dynamics);
    for (int left = steps; left > 0; left = settle(exec_, *sim_)) {
      launch(left);
      if (poses) forward_kinematics(exec_, *model_, *state_, sim_->poses, sim_->dynamics);
    }
  }
  /// How often a step has been recorded.
  int recorded() const { return recorded_; }

 private:
  void launch_one() {
    std::apply([&](auto const&... one) { launch_step(exec_, *model_, *state_, *sim_, options, one...); }, more_);
  }
  /// f(bytes, count) for all that kernels are given.
  template <class F>
  void each_part(F const& f) const {
    f(static_cast<void const*>(model_), sizeof *model_);
    f(static_cast<void const*>(state_), sizeof *state_);
    f(static_cast<void const*>(sim_), sizeof *sim_);
    f(static_cast<void const*>(&options), sizeof options);
  }
  void keep() {
    if constexpr (is_device<Exec>) {
      kept_.clear();
      each_part([&](void const* part, std::size_t size) {
        auto const* const bytes = static_cast<unsigned char const*>(part);
        kept_.insert(kept_.end(), bytes, bytes + size);
      });
    }
  }
  bool is_as_before() const {
    std::size_t at = 0;
    bool same = !kept_.empty();
    if (same)
      each_part([&](void const* part, std::size_t size) {
        same = same && std::memcmp(kept_.data() + at, part, size) == 0;
        at += size;
      });
    return same;
  }

  Exec exec_;
  Model<R, Mem> const* model_;
  State<R, Mem>* state_;
  Simulation<R, Mem>* sim_;
  std::tuple<More...> more_;
  Recording<Exec> recording_;
  detail::StepStamps<R, Mem> stamps_;
  std::vector<unsigned char> kept_;  // what the last step was given
  bool may_record_ = true;
  int recorded_ = 0;
};

}  // namespace gsp
