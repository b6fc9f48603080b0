#pragma once
// The machine that does the work: options, memory, time.
#include <gsp/runtime/session.hpp>
#include <string>

#include "arguments.hpp"

namespace gsp_cli {

using gsp::runtime::Device;
using gsp::runtime::device_name;
using gsp::runtime::peak_bytes;

Option device_option();
Option threads_option();
Option quiet_option();

/// --device, or CUDA where the program was built with it. Throws where the build has no CUDA or the machine no GPU.
Device choose_device(Arguments const& arguments);
/// --threads, 0: not given.
int threads_of(Arguments const& arguments);
/// Neither progress nor notes: --quiet, or --json where the command has it.
bool quiet(Arguments const& arguments);

/// Throws, in one sentence, where the device or the host has less memory free than is needed. what: "1000 worlds of robot.xml";
/// remedy: what to give less of.
void expect_memory(std::string const& what, Device device, std::uint64_t device_bytes, std::uint64_t host_bytes, std::string const& remedy);

/// Since the process started [s].
double seconds_since_start();

}  // namespace gsp_cli
