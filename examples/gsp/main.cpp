// gsp: simulates and renders from the command line. Each command stands in a file of its own.
#include <signal.h>
#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <gsp/io/file.hpp>
#include <new>
#include <thread>

#include "commands.hpp"

namespace {

using namespace gsp_cli;

std::vector<Command> commands() {
  return {info_command(),    sim_command(),   scan_command(),  render_command(),
          convert_command(), prune_command(), bench_command(), quickstart_command()};
}

int print_help() {
  std::puts("gsp: Gaussian splats and physics, many worlds at once, on CPU and GPU\n");
  for (auto const& c : commands()) std::printf("  gsp %-10s  %s\n", c.name.c_str(), wrapped(c.summary, 18, 18).c_str());
  std::puts(
      "\n'gsp COMMAND --help' explains a command. Exit codes: 0 done, 2 bad input (one sentence says what, where and the remedy), 130 "
      "stopped by Ctrl-C (143 by SIGTERM), 1 anything else.");
  return 0;
}

int run(int argc, char** argv) {
  if (argc < 2) return print_help();
  std::string const name = argv[1];
  if (name == "--help" || name == "-h" || name == "help") return print_help();
  if (name == "--version") {
    std::puts("gsp 0.1.0");
    return 0;
  }
  std::vector<std::string> names;
  for (auto const& command : commands()) {
    names.push_back(command.name);
    if (command.name != name) continue;
    std::vector<std::string> words(argv + 2, argv + argc);
    for (auto const& w : words)
      if (w == "--help" || w == "-h") {
        std::fputs(help(command).c_str(), stdout);
        return 0;
      }
    return command.run(Arguments(command, words));
  }
  auto const hint = did_you_mean(name, names);
  throw Error(in_quotes(name) + " is no command" + (hint.empty() ? "; 'gsp --help' lists them" : hint));
}

}  // namespace

/// GNU's OpenMP lets threads that wait spin for milliseconds, which on a machine that is busy with other things makes a step a hundred
/// times slower; it reads its settings before main, so the program starts itself again with a short spin, unless the user has said what he
/// wants.
static void spin_briefly(char** argv) {
  if (std::getenv("OMP_WAIT_POLICY") || std::getenv("GOMP_SPINCOUNT")) return;
  setenv("GOMP_SPINCOUNT", "5000", 1);
  std::error_code error;
  auto const program = std::filesystem::read_symlink("/proc/self/exe", error);  // by its own name, which is what ps shows
  if (!error) execv(program.c_str(), argv);
  execv("/proc/self/exe", argv);  // on failure: go on as we are
}

/// From here on Ctrl-C, SIGTERM and the end of the terminal end the program from a thread of its own, which first removes the files that
/// are not complete. Signals that whoever started the program ignores (nohup, a job in the background of a script) stay ignored.
static void end_on_signals() {
  sigset_t signals;
  sigemptyset(&signals);
  for (int s : {SIGINT, SIGTERM, SIGHUP}) {
    struct sigaction now {};
    if (sigaction(s, nullptr, &now) == 0 && now.sa_handler != SIG_IGN) sigaddset(&signals, s);
  }
  pthread_sigmask(SIG_BLOCK, &signals, nullptr);  // threads that start later inherit it, so that the signals reach the one below
  std::thread([signals] {
    int caught = 0;
    if (sigwait(&signals, &caught) != 0) return;
    gsp::io::discard_unfinished_files();
    std::fprintf(stderr, "%sgsp: stopped by %s before it was done; files that were not complete are removed\n", isatty(2) ? "\n" : "",
                 caught == SIGINT    ? "Ctrl-C"
                 : caught == SIGTERM ? "SIGTERM"
                                     : "the end of its terminal (SIGHUP)");
    _exit(128 + caught);
  }).detach();
}

static int not_enough_memory() {
  std::fputs("gsp: there is not enough memory for this; give fewer worlds, smaller images or a smaller --batch\n", stderr);
  return gsp_cli::bad_input;
}

int main(int argc, char** argv) {
  spin_briefly(argv);
  end_on_signals();
  try {
    return run(argc, argv);
  } catch (gsp::Error const& error) {
    std::fprintf(stderr, "gsp: %s\n", error.what());
    return bad_input;
  } catch (std::invalid_argument const& error) {
    std::fprintf(stderr, "gsp: %s\n", error.what());
    return bad_input;
  } catch (std::bad_alloc const&) { return not_enough_memory(); } catch (std::exception const& error) {
    if (std::strstr(error.what(), "failed to allocate")) return not_enough_memory();  // Kokkos' allocators throw runtime_error
    std::fprintf(stderr, "gsp: %s\n", error.what());
    return 1;
  }
}
