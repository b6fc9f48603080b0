#pragma once
#include <Kokkos_Core.hpp>
#include <gsp/core/check.hpp>
#include <gsp/core/exec.hpp>
#include <string>

/// Rooms for the work of a host's threads, one each, in what is made for kernels that need it.
namespace gsp::detail {

/// How many there are in what is made with `exec`: of one thread one, else as many as Kokkos has threads, as it may use any of them.
template <class Exec>
int thread_rooms(Exec const& exec) {
  return host_threads(exec) == 1 ? 1 : Kokkos::DefaultHostExecutionSpace().concurrency();
}

/// Which of them is the calling thread's, in a kernel on `exec`: of one thread the first, whatever number that thread has elsewhere (that
/// of a team of OpenMP, in which it may have been launched: step/tiles.hpp).
template <class Exec>
class ThreadRoom {
 public:
  /// Errors: std::invalid_argument where there is no room, or for one thread alone and `exec` has more.
  ThreadRoom(char const* where, Exec const& exec, int rooms) : one_(host_threads(exec) == 1) {
    expects(rooms > 0, std::string(where) + ": there is no room for a thread's work: what a tile has is lent to it in for_tiles");
    expects(one_ || rooms > 1, std::string(where) + ": there is room for the work of one thread, and the execution space has " +
                                   std::to_string(host_threads(exec)) + ": make what it works on with the same one");
  }
  /// f(number of the room)
  template <class F>
  void operator()(F const& f) const {
    if (one_) return f(0);
    Kokkos::Experimental::UniqueToken<Exec, Kokkos::Experimental::UniqueTokenScope::Global> const token;
    int const room = token.acquire();
    f(room);
    token.release(room);
  }

 private:
  bool one_;
};

}  // namespace gsp::detail
