#pragma once
#include "arguments.hpp"

namespace gsp_cli {

inline constexpr int bad_input = 2;  // exit code; 0 is success, 1 a fault of the program or the machine

Command info_command();
Command sim_command();
Command render_command();
Command scan_command();
Command bench_command();
Command quickstart_command();
Command convert_command();
Command prune_command();

}  // namespace gsp_cli
