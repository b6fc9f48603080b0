#pragma once
#include <nanobind/nanobind.h>

#include <chrono>
#include <thread>

namespace gsp::python {

/// Other threads of Python run for as long as this lives. One that comes back while the interpreter ends never gets on again: Python up to
/// 3.13 tells it to end by unwinding its stack, where destructors of C++ must not let that through and the process was aborted. It sleeps
/// until the process is gone, as Python's own do from 3.14 on.
class OthersRun {
 public:
  OthersRun() : thread_(PyEval_SaveThread()) {}
  ~OthersRun() {
    try {
      PyEval_RestoreThread(thread_);
    } catch (...) {  // leaving this block would go on with the unwinding
      for (;;) std::this_thread::sleep_for(std::chrono::hours(1));
    }
  }
  OthersRun(OthersRun const&) = delete;
  OthersRun& operator=(OthersRun const&) = delete;

 private:
  PyThreadState* const thread_;
};

}  // namespace gsp::python
