#pragma once
#include <Kokkos_Core.hpp>
#include <atomic>
#include <cstdint>
#include <string>

/// Stamps: of which state, and of which moment of it, a quantity is (docs/dynamics/stamps.md). Host integers alone, in views so that copies
/// of a struct share them: no allocation, no launch, no wait in a check.
namespace gsp::detail {

/// A number that nothing has had before.
inline std::uint64_t next_moment() {
  static std::atomic<std::uint64_t> last{0};
  return ++last;
}

/// A state at a moment, which changes whenever gsp moves the state on. A state without a counter has moment 0.
struct Stamp {
  void const* qpos = nullptr;  // null: nothing there
  std::uint64_t moment = 0;
  int level = 0;                                           // of what several stages add to: how many have
  Kokkos::View<std::uint64_t, Kokkos::HostSpace> counter;  // the state's
  bool is_same(Stamp const& o) const { return qpos == o.qpos && moment == o.moment; }
  bool is_past() const { return counter.data() && counter() != moment; }
  template <class State>
  bool is_of(State const& state) const {
    return qpos == state.qpos.data() && moment == (state.moment.data() ? state.moment() : 0);
  }
  template <class State>
  void set(State const& state) {
    qpos = state.qpos.data();
    moment = state.moment.data() ? state.moment() : 0;
    level = 0;
    if (counter.data() != state.moment.data()) counter = state.moment;
  }
  /// What is wrong where it is not of the state whose positions are these.
  char const* fault(void const* positions) const {
    if (!qpos) return "have not been written";
    return qpos == positions ? "are of the state before its last step or reset" : "are of another state";
  }
};

/// Of which state's rows a solution is; of rows that gsp has not written, a user's own: taken as it is.
struct SolutionStamp {
  Stamp state = {};
  bool own = false;
};

/// The stamp of a struct that is written as a whole. Without data (a struct filled by hand): what it holds is taken as it is.
template <class S>
using SharedStamp = Kokkos::View<S, Kokkos::HostSpace>;
template <class S>
SharedStamp<S> make_stamp(char const* label) {
  return SharedStamp<S>(Kokkos::view_alloc(std::string(label), Kokkos::SequentialHostInit));
}

}  // namespace gsp::detail
