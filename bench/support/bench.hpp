#pragma once
// A small harness: warm up, fence, median of at least five samples, one JSON object a line.
//   int main(int argc, char** argv) {
//     Kokkos::ScopeGuard kokkos(argc, argv);
//     Kokkos::OpenMP exec;
//     auto const time = gsp_bench::measure(exec, [&] { gsp::pgs(exec, rows); });
//     gsp_bench::Line("solver/pgs", exec).add("worlds", worlds).add("profile", "stable").add("precision", "float").add(time)
//         .add("us_per_world", 1e6 * time.median / worlds).add_hash(rows.impulse).print();
//   }
#include <Kokkos_Core.hpp>
#include <algorithm>
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <string>
#include <type_traits>
#include <vector>

namespace gsp_bench {

#ifdef GSP_DATA_DIR
/// Where the robots and splats that benches read are: in $GSP_DATA_DIR, else in the CMake variable of that name.
inline std::string data_file(std::string const& name) {
  char const* const folder = std::getenv("GSP_DATA_DIR");
  return std::string(folder ? folder : GSP_DATA_DIR) + "/" + name;
}
inline std::string model_folder() { return data_file("models/"); }
#endif

struct MeasureOptions {
  int samples = 7;        // at least 5: the median of them is the result
  double seconds = 0.05;  // a sample repeats the call until it lasts this long
  int warm_up = 2;        // calls before the first sample
  long repeats = 0;       // calls a sample; 0: from `seconds`
};

/// Seconds of one call.
struct Time {
  double median = 0, fastest = 0, slowest = 0;
  int samples = 0;
  long repeats = 0;
};

/// Times f() on exec, fence included once a sample: what the calls cost back to back, as a user's loop would see it.
template <class Exec, class F>
Time measure(Exec const& exec, F const& f, MeasureOptions options = {}) {
  using clock = std::chrono::steady_clock;
  auto const sample = [&](long repeats) {
    exec.fence("gsp_bench: before");
    auto const start = clock::now();
    for (long i = 0; i < repeats; ++i) f();
    exec.fence("gsp_bench: after");
    return std::chrono::duration<double>(clock::now() - start).count();
  };
  for (int i = 0; i < options.warm_up; ++i) sample(1);
  long repeats = std::max(1L, options.repeats);
  if (options.repeats <= 0)
    for (double seconds = sample(1); seconds < options.seconds && repeats < (1L << 30); seconds = sample(repeats))
      repeats = std::max(2 * repeats, static_cast<long>(1.2 * repeats * options.seconds / std::max(seconds, 1e-9)));

  std::vector<double> seconds;
  for (int i = 0; i < std::max(5, options.samples); ++i) seconds.push_back(sample(repeats) / repeats);
  std::sort(seconds.begin(), seconds.end());
  std::size_t const n = seconds.size();
  double const median = n % 2 == 1 ? seconds[n / 2] : 0.5 * (seconds[n / 2 - 1] + seconds[n / 2]);
  return {median, seconds.front(), seconds.back(), static_cast<int>(n), repeats};
}

/// FNV-1a over the bytes of a contiguous view's values (64 bits, hex): the same state gives the same text.
template <class View>
std::string state_hash(View const& view) {
  auto const host = Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, view);
  auto const* bytes = reinterpret_cast<unsigned char const*>(host.data());
  std::uint64_t hash = 14695981039346656037ull;
  for (std::size_t i = 0; i < host.span() * sizeof(typename View::value_type); ++i) hash = (hash ^ bytes[i]) * 1099511628211ull;
  char text[17];
  std::snprintf(text, sizeof text, "%016llx", static_cast<unsigned long long>(hash));
  return text;
}

/// Mean of a view of one number a world.
template <class View>
double mean(View const& view) {
  auto const host = Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, view);
  double sum = 0;
  for (std::size_t w = 0; w < host.extent(0); ++w) sum += double(host(w));
  return sum / double(host.extent(0));
}

/// One line of output: a JSON object that grows by add().
class Line {
 public:
  template <class Exec>
  Line(char const* bench, Exec const& exec) {
    add("bench", bench).add("backend", Exec::name()).add("threads", exec.concurrency());
  }

  Line& add(char const* key, char const* value) {
    std::string text = "\"";
    for (char const* c = value; *c; ++c) {
      if (*c == '"' || *c == '\\') text += '\\';
      text += *c;
    }
    return raw(key, text + '"');
  }
  Line& add(char const* key, std::string const& value) { return add(key, value.c_str()); }
  Line& add(char const* key, bool value) { return raw(key, value ? "true" : "false"); }
  template <class T>
  requires(std::is_arithmetic_v<T> && !std::is_same_v<T, bool>) Line& add(char const* key, T value) {
    char text[40];
    if constexpr (std::is_integral_v<T>)
      std::snprintf(text, sizeof text, "%lld", static_cast<long long>(value));
    else
      std::snprintf(text, sizeof text, "%.9g", static_cast<double>(value));
    return raw(key, std::strpbrk(text, "in") ? "null" : text);  // JSON knows neither inf nor nan
  }
  Line& add(Time const& time) {
    return add("seconds", time.median)
        .add("fastest", time.fastest)
        .add("slowest", time.slowest)
        .add("samples", time.samples)
        .add("repeats", time.repeats);
  }
  template <class View>
  Line& add_hash(View const& view) {
    return add("state_hash", state_hash(view));
  }
  void print() const {
    std::printf("{%s}\n", text_.c_str());
    std::fflush(stdout);
  }

 private:
  Line& raw(char const* key, std::string const& value) {
    if (!text_.empty()) text_ += ", ";
    text_ += '"';
    text_ += key;
    text_ += "\": " + value;
    return *this;
  }
  std::string text_;
};

}  // namespace gsp_bench
