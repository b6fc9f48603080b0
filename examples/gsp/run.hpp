#pragma once
#include <functional>
#include <gsp/runtime/stepper.hpp>
#include <nlohmann/json.hpp>

#include "device.hpp"
#include "files.hpp"
#include "progress.hpp"

namespace gsp_cli {

using gsp::runtime::Stepper;
using gsp::runtime::StepperOptions;

/// Starts of all worlds, or one for all, onto the device.
void set_states(Stepper& stepper, States const& states, gsp::CompiledModel const& model);
/// The same of the snapshot of a file.
void restore(Stepper& stepper, States const& states, std::string const& path);
/// Positions and velocities of all worlds, float64.
void get_states(Stepper const& stepper, std::vector<double>& qpos, std::vector<double>& qvel);
/// Activations of all worlds, float64.
void get_activations(Stepper const& stepper, std::vector<double>& act);
/// Host memory that the states of so many worlds take when they are read back.
std::uint64_t bytes_of_states(gsp::CompiledModel const& model, int worlds);

struct Timing {
  double seconds = 0;
  long long steps = 0;  // that were timed
};

struct RunOptions {
  long long steps = 0;
  long long time_from = 0;                     // steps before it are not timed
  gsp::runtime::Array controls = {};           // (K, worlds | 1, nu) on the device, one row a step; or none
  long long every = 1;                         // steps between two records
  bool record_last = false;                    // the last step is recorded too where it is none of those
  std::function<void(long long)> record = {};  // record(done)
};

/// Row k of controls (K, worlds | 1, nu), as (worlds | 1, nu).
gsp::runtime::Array row_of(gsp::runtime::Array const& controls, long long k);

/// Steps, timing those from `time_from` on.
Timing run_steps(Stepper& stepper, RunOptions const& options, Progress& progress);

/// Records after the start, with record_last.
inline long long records(long long steps, long long every) { return steps / every + (steps % every != 0); }

/// What went wrong in a world that stopped: "world 1 stopped after 3 steps (0.06 s): the new velocity of dof 4 (joint 'lift') is 1.2e+10".
std::string sentence(gsp::runtime::StoppedWorld const& s, gsp::CompiledModel const& model, double timestep);
/// Says on stderr how many worlds stopped and of the first of them why, and what to do. None: nothing.
void say_stopped(char const* command, Stepper const& stepper, gsp::CompiledModel const& model, int worlds, char const* remedy);
/// Those of --json: a list of world, steps, text.
nlohmann::ordered_json stopped_json(Stepper const& stepper, gsp::CompiledModel const& model);

/// Lines of a load report, as --json prints them: a list of kind, file, line, text, count.
nlohmann::ordered_json report_json(std::vector<gsp::ReportLine> const& lines);
/// What --json prints of steps: how fast, how large, what the last one met, and the hash of the states.
nlohmann::ordered_json steps_json(Stepper const& stepper, Device device, int worlds, Timing const& timing, double startup);

}  // namespace gsp_cli
