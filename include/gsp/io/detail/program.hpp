#pragma once
#include <fcntl.h>
#include <signal.h>
#include <spawn.h>
#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <filesystem>
#include <gsp/io/file.hpp>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace gsp::io::detail {

/// The program `name` of the folders that PATH names; empty where there is none that may be run.
inline std::filesystem::path find_program(std::string const& name) {
  char const* const folders = std::getenv("PATH");
  for (std::string_view rest = folders ? folders : ""; !rest.empty();) {
    auto const end = std::min(rest.find(':'), rest.size());
    auto const program = std::filesystem::path(rest.substr(0, end)) / name;
    std::error_code error;
    if (end > 0 && std::filesystem::is_regular_file(program, error) && ::access(program.c_str(), X_OK) == 0) return program;
    rest.remove_prefix(std::min(end + 1, rest.size()));
  }
  return {};
}

/// An open file that is closed with its scope and not handed to programs, above 2 so that it is none of a program's own three.
class Descriptor {
 public:
  explicit Descriptor(int number = -1) : number_(number) {
    if (number < 0 || number > 2) return;
    number_ = ::fcntl(number, F_DUPFD_CLOEXEC, 3);
    ::close(number);
  }
  Descriptor(Descriptor&& other) noexcept : number_(std::exchange(other.number_, -1)) {}
  Descriptor& operator=(Descriptor&& other) noexcept {
    std::swap(number_, other.number_);
    return *this;
  }
  ~Descriptor() { close(); }
  int number() const { return number_; }
  void close() {
    if (number_ >= 0) ::close(number_);
    number_ = -1;
  }

 private:
  int number_;
};

/// A program that reads what it is given through a pipe, started from its name and words without a shell. It has a process group of its
/// own, so that Ctrl-C reaches it through discard_unfinished_files alone. Where it goes out of scope before `finish` it is killed.
class Program {
 public:
  /// Throws Error where it cannot be started.
  Program(std::filesystem::path const& program, std::vector<std::string> words) {
    std::string const name = program.string();
    int ends[2] = {-1, -1};
    if (::pipe2(ends, O_CLOEXEC) != 0) fail(name, "", "cannot be started: there is no pipe for it (" + reason(errno) + ")");
    Descriptor const read_end(ends[0]);
    input_ = Descriptor(ends[1]);
    said_ = Descriptor(::memfd_create("said", MFD_CLOEXEC));

    std::vector<char*> arguments{const_cast<char*>(name.c_str())};
    for (auto& word : words) arguments.push_back(word.data());
    arguments.push_back(nullptr);
    posix_spawn_file_actions_t files;
    ::posix_spawn_file_actions_init(&files);
    ::posix_spawn_file_actions_adddup2(&files, read_end.number(), 0);
    ::posix_spawn_file_actions_addopen(&files, 1, "/dev/null", O_WRONLY, 0);
    if (said_.number() >= 0)
      ::posix_spawn_file_actions_adddup2(&files, said_.number(), 2);
    else
      ::posix_spawn_file_actions_addopen(&files, 2, "/dev/null", O_WRONLY, 0);
    posix_spawnattr_t attributes;
    ::posix_spawnattr_init(&attributes);
    sigset_t none, usual;
    ::sigemptyset(&none);
    ::sigemptyset(&usual);
    ::sigaddset(&usual, SIGPIPE);
    ::posix_spawnattr_setsigmask(&attributes, &none);
    ::posix_spawnattr_setsigdefault(&attributes, &usual);
    ::posix_spawnattr_setpgroup(&attributes, 0);
    ::posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETSIGDEF | POSIX_SPAWN_SETPGROUP);
    int error = 0;
    {
      auto& unfinished = unfinished_files();
      std::lock_guard const lock(unfinished.mutex);
      error = ::posix_spawn(&process_, name.c_str(), &files, &attributes, arguments.data(), environ);
      if (error == 0) unfinished.programs.insert(process_);
    }
    ::posix_spawnattr_destroy(&attributes);
    ::posix_spawn_file_actions_destroy(&files);
    if (error == 0) return;
    process_ = -1;
    fail(name, "", "cannot be started (" + reason(error) + ")");
  }
  Program(Program const&) = delete;
  Program& operator=(Program const&) = delete;
  ~Program() {
    if (process_ < 0) return;
    ::kill(-process_, SIGKILL);  // its group: the program may be a script that has started another
    (void)finish();
  }

  /// False where the program reads no further; no SIGPIPE comes of it. Waits while the pipe is full.
  bool write(Bytes bytes) {
    sigset_t broken, before, pending;
    ::sigemptyset(&broken);
    ::sigaddset(&broken, SIGPIPE);
    ::sigpending(&pending);
    ::pthread_sigmask(SIG_BLOCK, &broken, &before);
    bool gone = false;
    while (!bytes.empty() && !gone) {
      ::ssize_t const n = ::write(input_.number(), bytes.data(), bytes.size());
      if (n >= 0) bytes = bytes.subspan(static_cast<std::size_t>(n));
      gone = n < 0 && errno != EINTR;
    }
    if (gone && ::sigismember(&pending, SIGPIPE) == 0) {  // take back the signal that this write has raised
      std::timespec const now{};
      while (::sigtimedwait(&broken, nullptr, &now) < 0 && errno == EINTR) {}
    }
    ::pthread_sigmask(SIG_SETMASK, &before, nullptr);
    return !gone;
  }

  /// Ends its input and waits until it is done. Empty where all is well, else how it ended and the last line that it said:
  /// "ended with exit status 1: Unknown encoder 'libx264'".
  std::string finish() {
    input_.close();
    ::siginfo_t end{};
    while (::waitid(P_PID, static_cast<::id_t>(process_), &end, WEXITED | WNOWAIT) != 0 && errno == EINTR) {}
    int status = 0;
    ::pid_t reaped = -1;
    {
      auto& unfinished = unfinished_files();  // what is in it has not been reaped: its number is nobody else's
      std::lock_guard const lock(unfinished.mutex);
      unfinished.programs.erase(process_);
      reaped = ::waitpid(process_, &status, 0);
    }
    process_ = -1;
    if (reaped < 0) return "ended, and how is not known, since SIGCHLD is ignored";
    if (WIFEXITED(status) && WEXITSTATUS(status) == 0) return {};
    std::string const how = WIFEXITED(status) ? "ended with exit status " + std::to_string(WEXITSTATUS(status))
                                              : "was ended by signal " + std::to_string(WTERMSIG(status));
    auto const line = last_line();
    return how + (line.empty() ? "" : ": " + line);
  }

 private:
  static std::string reason(int error) { return std::generic_category().message(error); }

  /// The last line of stderr that says something: ffmpeg's "Conversion failed!" and "Last message repeated ..." do not.
  std::string last_line() const {
    char text[4096];
    ::off_t const end = ::lseek(said_.number(), 0, SEEK_END), from = std::max<::off_t>(0, end - static_cast<::off_t>(sizeof text));
    ::ssize_t const n = ::pread(said_.number(), text, sizeof text, from);
    std::string_view rest(text, static_cast<std::size_t>(std::max<::ssize_t>(0, n)));
    while (!rest.empty()) {
      auto const start = rest.find_last_of("\r\n") + 1;  // 0 where there is none
      std::string line;
      for (char c : rest.substr(start)) line += static_cast<unsigned char>(c) < 32 ? ' ' : c;
      rest = rest.substr(0, start > 0 ? start - 1 : 0);
      line.erase(0, line.find_first_not_of(' '));
      line.erase(line.find_last_not_of(" .") + 1);
      if (!line.empty() && line != "Conversion failed!" && !line.starts_with("Last message repeated")) return line.substr(0, 400);
    }
    return {};
  }

  Descriptor input_, said_;
  ::pid_t process_ = -1;
};

}  // namespace gsp::io::detail
