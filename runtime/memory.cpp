#include "memory.hpp"

#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <fstream>
#include <limits>
#include <sstream>
#include <string>

namespace gsp::runtime {
namespace {

constexpr std::uint64_t no_limit = std::numeric_limits<std::uint64_t>::max();

/// The number behind `word` in a file of lines "word number"; without `word`: the first number of the file. no_limit where there is none.
std::uint64_t number_in(std::string const& file, std::string const& word = {}) {
  std::ifstream in(file);
  std::uint64_t value = 0;
  if (word.empty()) return in >> value ? value : no_limit;  // "max" is none
  for (std::string line; std::getline(in, line);) {
    std::istringstream words(line);
    std::string first;
    if (words >> first && first == word) return words >> value ? value : no_limit;
  }
  return no_limit;
}

/// What is left of the limit of one control group: limit - used, where used leaves out files that the system keeps in memory as long as
/// nobody needs it.
std::uint64_t left_of_group(std::string const& limit_file, std::string const& used_file, std::string const& stat_file,
                            std::string const& cache_word) {
  std::uint64_t const limit = number_in(limit_file);
  std::uint64_t used = number_in(used_file);
  if (limit == no_limit || used == no_limit) return no_limit;
  std::uint64_t const cache = number_in(stat_file, cache_word);
  if (cache != no_limit) used -= std::min(used, cache);
  return limit - std::min(limit, used);
}

/// The least of the group of this process and those above it; `folder` holds the groups, `group` is as /proc/self/cgroup says.
std::uint64_t left_of_groups(std::string const& folder, std::string group, bool second_version) {
  std::uint64_t least = no_limit;
  while (true) {
    std::string const at = folder + group + "/";
    least = std::min(least, second_version ? left_of_group(at + "memory.max", at + "memory.current", at + "memory.stat", "inactive_file")
                                           : left_of_group(at + "memory.limit_in_bytes", at + "memory.usage_in_bytes", at + "memory.stat",
                                                           "total_inactive_file"));
    auto const slash = group.rfind('/');
    if (slash == std::string::npos) return least;
    group.resize(slash);
  }
}

}  // namespace

std::uint64_t free_host_bytes() {
  std::uint64_t least = number_in("/proc/meminfo", "MemAvailable:");
  if (least != no_limit) least *= 1024;
  std::ifstream groups("/proc/self/cgroup");
  for (std::string line; std::getline(groups, line);) {  // "0::/a/b" (version 2) or "5:memory:/a/b"
    auto const first = line.find(':');
    auto const second = line.find(':', first + 1);
    if (first == std::string::npos || second == std::string::npos) continue;
    std::string controllers(1, ',');
    controllers.append(line, first + 1, second - first - 1).push_back(',');
    std::string const group = line.substr(second + 1) == "/" ? "" : line.substr(second + 1);
    if (controllers == ",,") least = std::min(least, left_of_groups("/sys/fs/cgroup", group, true));
    if (controllers.find(",memory,") != std::string::npos) least = std::min(least, left_of_groups("/sys/fs/cgroup/memory", group, false));
  }
  rlimit space{};  // ulimit -v
  if (getrlimit(RLIMIT_AS, &space) == 0 && space.rlim_cur != RLIM_INFINITY) {
    std::uint64_t const pages = number_in("/proc/self/statm");
    std::uint64_t const used = pages == no_limit ? 0 : pages * static_cast<std::uint64_t>(sysconf(_SC_PAGESIZE));
    least = std::min<std::uint64_t>(least, space.rlim_cur - std::min<std::uint64_t>(space.rlim_cur, used));
  }
  return least;
}

std::uint64_t peak_host_bytes() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<std::uint64_t>(usage.ru_maxrss) * 1024;
}

}  // namespace gsp::runtime
