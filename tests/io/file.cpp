#include <doctest/doctest.h>

#include <gsp/io/file.hpp>
#include <io/fixtures.hpp>

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
    file.write("....nd");
    file.seek(0);
    file.write("seco");
    file.commit();
  }
  CHECK(folder.files() == 1);
  CHECK(read_file(path) == bytes_of("second"));
  write_file(path, {});
  CHECK(read_file(path).empty());
  CHECK(says(error_of([&] { AtomicFile(folder.path); }), "is a folder"));
  CHECK(says(error_of([&] { AtomicFile(folder.path / "no" / "b"); }), "create it first"));
}
