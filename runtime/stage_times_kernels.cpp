#include <Kokkos_Core.hpp>
#include <algorithm>
#include <chrono>
#include <gsp/runtime/stage_times.hpp>
#include <map>

namespace gsp::runtime {
namespace {

using clock = std::chrono::steady_clock;

/// Regions that are open, the innermost last: time goes to that one.
struct StageClock {
  bool waits = false;
  std::vector<StageTime*> open;
  std::map<std::string, StageTime> stages;
  clock::time_point since{};

  /// Gives what has passed to the stage that was the innermost.
  void pass() {
    if (waits) Kokkos::fence("gsp::runtime::stage_times: the stage is done");
    auto const now = clock::now();
    if (!open.empty()) open.back()->seconds += std::chrono::duration<double>(now - since).count();
    since = now;
  }
  void begin(std::string const& region) {
    pass();
    std::string const name = region.starts_with("gsp::") ? region.substr(5) : region;
    StageTime& stage = stages[name];
    stage.name = name;
    ++stage.calls;
    open.push_back(&stage);
  }
  void end() {
    if (open.empty()) return;
    pass();
    open.pop_back();
  }
};
StageClock* running = nullptr;

void begin_stage(char const* name) { running->begin(name); }
void end_stage() { running->end(); }

/// Connects the clock for its lifetime, in the place of a tool that is there.
class Connection {
 public:
  explicit Connection(StageClock& stages) : before_(Kokkos::Tools::Experimental::get_callbacks()) {
    running = &stages;
    Kokkos::Tools::Experimental::set_push_region_callback(begin_stage);
    Kokkos::Tools::Experimental::set_pop_region_callback(end_stage);
  }
  ~Connection() {
    Kokkos::Tools::Experimental::set_callbacks(before_);
    running = nullptr;
  }
  Connection(Connection const&) = delete;
  Connection& operator=(Connection const&) = delete;

 private:
  Kokkos::Tools::Experimental::EventSet before_;
};

}  // namespace

std::vector<StageTime> stage_times(Device device, std::function<void()> const& work) {
  StageClock stages;
  stages.waits = device == Device::cuda;
  {
    Connection const connection(stages);
    work();
  }
  std::vector<StageTime> out;
  for (auto const& [name, stage] : stages.stages) out.push_back(stage);
  std::stable_sort(out.begin(), out.end(), [](StageTime const& a, StageTime const& b) { return a.seconds > b.seconds; });
  return out;
}

}  // namespace gsp::runtime
