#include <doctest/doctest.h>
#include <sys/stat.h>
#include <sys/sysmacros.h>
#include <sys/wait.h>

#include <gsp/io/file.hpp>
#include <gsp/io/npz.hpp>
#include <io/fixtures.hpp>
#include <support/skip.hpp>
#include <thread>

using namespace gsp::io;
using namespace gsp_test;

TEST_CASE("a file appears whole or not at all") {
  Folder folder;
  auto const path = folder.path / "a.bin";
  write_file(path, bytes_of("first"));
  CHECK(read_file(path) == bytes_of("first"));
  {
    AtomicFile file(path);
    file.write("half of the sec");
    CHECK(folder.files() == 2);
  }
  CHECK(folder.files() == 1);
  CHECK(read_file(path) == bytes_of("first"));
  {
    AtomicFile file(path);
    file.write("seco");
    file.write("nd");
    file.commit();
  }
  CHECK(folder.files() == 1);
  CHECK(read_file(path) == bytes_of("second"));
  write_file(path, {});
  CHECK(read_file(path).empty());
  CHECK(says(error_of([&] { AtomicFile(folder.path); }), "is a folder"));
  CHECK(says(error_of([&] { AtomicFile(folder.path / "no" / "b"); }), "create it first"));
}

TEST_CASE("a symbolic link stays, and what it leads to is written") {
  namespace fs = std::filesystem;
  Folder folder;
  fs::create_directory(folder.path / "far");
  write_file(folder.path / "far" / "a", bytes_of("old"));
  fs::create_symlink("far/a", folder.path / "link");
  fs::create_symlink("link", folder.path / "link_of_link");
  write_file(folder.path / "link_of_link", bytes_of("new"));
  CHECK(fs::is_symlink(folder.path / "link"));
  CHECK(fs::is_symlink(folder.path / "link_of_link"));
  CHECK(read_file(folder.path / "far" / "a") == bytes_of("new"));
  fs::create_symlink("far/b", folder.path / "dangling");
  write_file(folder.path / "dangling", bytes_of("made"));
  CHECK(fs::is_symlink(folder.path / "dangling"));
  CHECK(read_file(folder.path / "far" / "b") == bytes_of("made"));
  fs::create_symlink("nowhere/b", folder.path / "lost");
  CHECK(says(error_of([&] { AtomicFile(folder.path / "lost"); }), "create it first"));
  fs::create_symlink("far", folder.path / "near");
  CHECK(says(error_of([&] { AtomicFile(folder.path / "near"); }), "is a folder"));
  fs::create_symlink("circle", folder.path / "circle");
  CHECK(says(error_of([&] { AtomicFile(folder.path / "circle"); }), "circle of symbolic links"));
}

TEST_CASE("the permissions of a file that is replaced are kept, and one that may not be written stays") {
  namespace fs = std::filesystem;
  Folder folder;
  auto const path = folder.path / "a";
  write_file(path, bytes_of("old"));
  fs::permissions(path, fs::perms(0640));
  write_file(path, bytes_of("new"));
  CHECK(fs::status(path).permissions() == fs::perms(0640));
  fs::permissions(path, fs::perms(0440));
  if (::access(path.c_str(), W_OK) == 0) return;  // root may do everything
  CHECK(says(error_of([&] { write_file(path, bytes_of("newer")); }), "may not be written"));
  CHECK(read_file(path) == bytes_of("new"));
}

TEST_CASE("pipes and devices are written, never replaced" * doctest::test_suite("data")) {
  namespace fs = std::filesystem;
  Folder folder;
  auto const pipe = folder.path / "pipe";
  REQUIRE(::mkfifo(pipe.c_str(), 0600) == 0);
  for (int level : {0, 6}) {  // packed or not, nothing is sought
    std::string read;
    std::thread reader([&] {
      std::ifstream in(pipe, std::ios::binary);
      read.assign(std::istreambuf_iterator<char>(in), {});
    });
    std::vector<double> const values(3000, 0.5);
    write_npz(pipe, {{"x", {{3000}, values}}, {"y", {{30, 100}, values}}}, {.level = level});
    reader.join();
    CHECK(fs::is_fifo(pipe));
    CHECK(parse_npz(bytes_of(read), "pipe").at("y").as<double>() == values);
  }
  auto const null = folder.path / "null";  // as /dev/null
  if (::mknod(null.c_str(), S_IFCHR | 0666, ::makedev(1, 3)) == 0) {
    write_file(null, bytes_of("gone"));
    CHECK(fs::is_character_file(null));
  } else {
    gsp_test::skip("only root makes devices");
  }
  CHECK(folder.files() == 1 + fs::exists(null));
}

TEST_CASE("a program that ends early leaves no unfinished file and finishes none") {
  Folder folder;
  auto const path = folder.path / "a";
  write_file(path, bytes_of("old"));
  pid_t const child = ::fork();
  REQUIRE(child >= 0);
  if (child == 0) {
    AtomicFile a(path), b(folder.path / "b");
    a.write("new");
    bool const two = folder.files() == 3;
    std::thread([] { discard_unfinished_files(); }).join();
    std::thread([&] { a.commit(); }).detach();  // would give the file its name if it could
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
    ::_exit(two ? 0 : 1);
  }
  int status = 0;
  REQUIRE(::waitpid(child, &status, 0) == child);
  CHECK(WEXITSTATUS(status) == 0);
  CHECK(folder.files() == 1);
  CHECK(read_file(path) == bytes_of("old"));
}
