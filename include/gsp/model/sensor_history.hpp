#pragma once
#include <array>
#include <cmath>
#include <gsp/model/description.hpp>
#include <locale>
#include <sstream>
#include <string>
#include <string_view>

/// What MJCF's sensors say late, read from their settings: delay, interval, nsample and interp.
namespace gsp {

/// Between two samples: the earlier one; a line; a cubic (Catmull and Rom) by the samples beside them.
enum class Interpolation : int { hold, linear, cubic };
inline constexpr std::array<std::string_view, 3> interpolation_names{"zoh", "linear", "cubic"};  // in MJCF

struct SensorHistorySettings {
  double delay = 0;   // [s]
  double period = 0;  // [s] between two evaluations; 0: at each step
  double phase = 0;   // [s] when the first was due, above -period and at most 0; 0: at -period, so that the first is at time 0
  int samples = 0;    // that are kept; 0: none, and nothing of these acts
  Interpolation interpolation = Interpolation::hold;
  std::string fault;  // what is wrong with them; empty: nothing
};

/// The settings (attributes delay, interval, nsample and interp) of a sensor of any type but "user".
inline SensorHistorySettings history_settings(SensorDescription const& s) {
  SensorHistorySettings out;
  double samples = 0;
  for (auto const& [key, value] : s.settings) {
    if (key == "interp") {
      int k = 0;
      while (k < 3 && interpolation_names[k] != value) ++k;
      if (k == 3)
        out.fault = "has interp '" + value + "', which must be zoh, linear or cubic";
      else
        out.interpolation = Interpolation(k);
      continue;
    }
    if (key != "delay" && key != "interval" && key != "nsample") continue;
    std::istringstream words(value);
    words.imbue(std::locale::classic());
    double x[2] = {0, 0};
    words >> x[0];
    bool good = bool(words);
    if (key == "interval" && words >> std::ws && !words.eof()) good = good && bool(words >> x[1]);
    good = good && (words >> std::ws).eof() && std::isfinite(x[0]) && std::isfinite(x[1]);
    if (!good) out.fault = "has " + key + " '" + value + "': give " + (key == "interval" ? "a period and a phase" : "a number");
    if (key == "delay") out.delay = x[0];
    if (key == "nsample") samples = x[0];
    if (key == "interval") {
      out.period = x[0];
      out.phase = x[1];
    }
  }
  if (!out.fault.empty()) return out;
  constexpr double most = 1 << 24;
  if (!(samples >= 0 && samples <= most) || samples != std::floor(samples))
    out.fault = "has an nsample that is no whole number from 0 to 16777216: correct it";
  else if (out.delay < 0 || out.period < 0)
    out.fault = "has a negative delay or interval: give 0 or more";
  else if (out.phase > 0)
    out.fault = "has a positive phase: give one above -period and at most 0";
  else if (out.period > 0 && out.phase <= -out.period)
    out.fault = "has a phase of a whole period or more: give one above -period and at most 0";
  else if (out.delay > 0 && samples == 0)
    out.fault = "has a delay and keeps no samples: give nsample, at least delay / timestep + 1";
  else
    out.samples = int(samples);
  return out;
}

}  // namespace gsp
