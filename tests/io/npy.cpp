#include <doctest/doctest.h>

#include <gsp/io/npy.hpp>
#include <io/fixtures.hpp>
#include <support/skip.hpp>

using namespace gsp::io;
using namespace gsp_test;

namespace {
std::vector<std::byte> npy(std::string const& dict, std::vector<std::byte> const& data) {
  std::string header("\x93NUMPY\x01\x00", 8);
  header += static_cast<char>(dict.size() & 255);
  header += static_cast<char>(dict.size() >> 8);
  auto out = bytes_of(header + dict);
  out.insert(out.end(), data.begin(), data.end());
  return out;
}
std::vector<std::byte> written(NpyView const& view) {
  Folder folder;
  write_npy(folder.path / "a.npy", view);
  CHECK(folder.files() == 1);
  return read_file(folder.path / "a.npy");
}
}  // namespace

TEST_CASE_TEMPLATE("npy: what is written comes back", T, float, double, std::int32_t, std::int64_t, std::uint8_t) {
  std::vector<T> values(24);
  for (std::size_t i = 0; i < values.size(); ++i) values[i] = static_cast<T>(3 * i + 1);
  for (auto const& shape : std::vector<std::vector<std::size_t>>{{24}, {2, 3, 4}, {24, 1}, {1, 1, 1, 24}}) {
    auto const bytes = written({shape, values});
    CHECK((bytes.size() - sizeof(T) * 24) % 64 == 0);
    auto const a = parse_npy(bytes, "a.npy");
    CHECK(a.dtype == dtype_of<T>());
    CHECK(a.shape == shape);
    CHECK(a.template as<T>() == values);
    CHECK(a.template as<double>() == std::vector<double>(values.begin(), values.end()));
  }
  CHECK(parse_npy(written({{}, std::vector<T>{7}}), "scalar").template as<T>() == std::vector<T>{7});
  CHECK(parse_npy(written({{3, 0, 2}, std::vector<T>{}}), "empty").size() == 0);
  CHECK_THROWS_AS(written({{5, 5}, values}), std::invalid_argument);
}

TEST_CASE("npy: headers that other writers make") {
  std::vector<std::byte> six;
  for (float v : {1.f, 2.f, 3.f, 4.f, 5.f, 6.f}) put(six, v);
  // Fortran order: (2, 3) stored by columns
  auto const f = parse_npy(npy("{'shape': (2, 3), 'fortran_order': True, 'descr': '<f4'}\n", six), "f");
  CHECK(f.as<float>() == std::vector<float>{1, 3, 5, 2, 4, 6});
  auto const g = parse_npy(npy("{ \"descr\" : \"<f4\",'fortran_order':False,'shape':(1,3,2,),}", six), "g");
  CHECK(g.shape == std::vector<std::size_t>{1, 3, 2});
  std::vector<std::byte> bools(3, std::byte(1));
  CHECK(parse_npy(npy("{'descr': '|b1', 'fortran_order': False, 'shape': (3,), }\n", bools), "b").as<float>() ==
        std::vector<float>{1, 1, 1});
  auto v2 = bytes_of(std::string("\x93NUMPY\x02\x00\x38\x00\x00\x00", 12) + "{'descr': '<f4', 'fortran_order': False, 'shape': (6,)}\n");
  v2.insert(v2.end(), six.begin(), six.end());
  REQUIRE(v2.size() == 12 + 56 + 24);
  CHECK(parse_npy(v2, "v2").size() == 6);
}

TEST_CASE("npy: conversion refuses what does not fit") {
  auto convert = [](auto const& values, auto to) {
    return error_of([&] { make_npy({values.size()}, values).template as<decltype(to)>("a.npy"); });
  };
  CHECK(convert(std::vector<double>{1, -2, 3}, int{}).empty());
  CHECK(says(convert(std::vector<double>{1, 2.5}, int{}), "a.npy: value 1: 2.500000 is not a whole number"));
  CHECK(!convert(std::vector<double>{2147483648.0}, std::int32_t{}).empty());
  CHECK(convert(std::vector<double>{-2147483648.0}, std::int32_t{}).empty());
  CHECK(!convert(std::vector<double>{NAN}, std::int64_t{}).empty());
  CHECK(!convert(std::vector<float>{9.3e18f}, std::int64_t{}).empty());
  CHECK(!convert(std::vector<std::int64_t>{-1}, std::uint8_t{}).empty());
  CHECK(!convert(std::vector<std::int64_t>{1ll << 40}, std::int32_t{}).empty());
  auto const a = make_npy({2, 2}, std::vector<double>{1, 2, NAN, 4});
  CHECK(says(error_of([&] { expect_finite(a, "cams.npz: Ks"); }), "cams.npz: Ks: value 2: is not finite"));
  CHECK(says(error_of([&] { expect_shape(a, {-1, 3, 3}, "cams.npz: Ks"); }), "cams.npz: Ks: has shape (2, 2), expected (A, 3, 3)"));
  CHECK_NOTHROW(expect_shape(a, {-1, 2}, "x"));
}

TEST_CASE("npy: bad input") {
  std::vector<std::byte> const data(24, std::byte(0));
  auto refusal = [&](std::string const& dict) { return error_of([&] { parse_npy(npy(dict, data), "bad.npy"); }); };
  CHECK(refusal("{'descr': '<f8', 'fortran_order': False, 'shape': (3,), }").empty());
  CHECK(says(refusal("{'descr': '>f8', 'fortran_order': False, 'shape': (3,), }"), "dtype '>f8' is not supported; save it as"));
  CHECK(says(refusal("{'descr': '|O', 'fortran_order': False, 'shape': (3,), }"), "dtype '|O'"));
  CHECK(says(refusal("{'descr': [('a', '<f8')], 'fortran_order': False, 'shape': (3,), }"), "record arrays"));
  CHECK(says(refusal("{'descr': '<f8', 'fortran_order': False, 'shape': (4,), }"), "shape (4,) of <f8 does not fit the 24 bytes"));
  CHECK(says(refusal("{'descr': '<f8', 'fortran_order': False, 'shape': (2,), }"), "does not fit"));
  CHECK(
      says(refusal("{'descr': '<f8', 'fortran_order': False, 'shape': (4611686018427387904, 4611686018427387904, 3), }"), "does not fit"));
  CHECK(says(refusal("{'descr': '<f8', 'fortran_order': False, 'shape': (18446744073709551616,), }"), "header is damaged"));
  CHECK(says(refusal("{'descr': '<f8', 'fortran_order': False, 'shape': (-3,), }"), "header is damaged"));
  for (auto dict : {"", "{", "{}", "{'descr'}", "{'descr': '<f8'}", "{'descr': '<f8', 'fortran_order': Maybe, 'shape': (3,)}",
                    "{'descr': '<f8', 'fortran_order': False, 'shape': (3,)} x",
                    "{'descr': '<f8', 'descr': '<f8', 'fortran_order': False, 'shape': (3,)}", "{'shape': (3", "{'a': 1}"})
    CHECK_MESSAGE(says(refusal(dict), "header is damaged"), dict);
  auto const good = npy("{'descr': '<f8', 'fortran_order': False, 'shape': (3,), }", data);
  CHECK(accepted_truncations(good, [](Bytes b) { parse_npy(b, "cut.npy"); }) == 0);
  auto longer = good;
  longer.push_back(std::byte(0));
  CHECK(says(error_of([&] { parse_npy(longer, "long.npy"); }), "does not fit the 25 bytes"));
}

TEST_CASE("npy: numpy reads ours and we read numpy's" * doctest::test_suite("data")) {
  Folder folder;
  write_npy(folder.path / "ours.npy", NpyView({2, 3}, std::vector<double>{1, 2, 3, 4, 5, 6.5}));
  bool ok = false;
  if (!run_numpy("import numpy as n; a = n.load('" + (folder.path / "ours.npy").string() +
                     "'); assert a.dtype == n.float64 and a.tolist() == [[1, 2, 3], [4, 5, 6.5]]; p = '" + folder.path.string() +
                     "/'; n.save(p + 'f', n.asfortranarray(n.arange(24, dtype=n.int32).reshape(2, 3, 4))); n.save(p + 'b', n.array([True, "
                     "False])); n.save(p + 's', n.float32(2.5)); n.save(p + 'z', n.zeros((0, 3)))",
                 ok)) {
    gsp_test::skip("python3 has no numpy (GSP_PYTHON names another python)");
    return;
  }
  REQUIRE(ok);
  auto const f = read_npy(folder.path / "f.npy");
  CHECK(f.shape == std::vector<std::size_t>{2, 3, 4});
  auto const values = f.as<int>();
  for (int i = 0; i < 24; ++i) CHECK(values[i] == i);
  CHECK(read_npy(folder.path / "b.npy").as<int>() == std::vector<int>{1, 0});
  CHECK(read_npy(folder.path / "s.npy").as<float>() == std::vector<float>{2.5f});
  CHECK(read_npy(folder.path / "z.npy").shape == std::vector<std::size_t>{0, 3});
}
