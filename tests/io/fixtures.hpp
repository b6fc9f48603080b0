#pragma once
// Small Gaussian files and helpers that the tests and the fuzz targets of gsp::io share. The encoders here are written from the format's
// description, not from the readers.
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <gsp/io/detail/deflate.hpp>
#include <gsp/io/detail/zstd.hpp>
#include <gsp/io/splat_set.hpp>
#include <random>
#include <stdexcept>
#include <string>
#include <vector>

namespace gsp_test {

using gsp::io::Bytes;
using gsp::io::SplatSet;

/// A folder that disappears with its scope.
struct Folder {
  std::filesystem::path path =
      std::filesystem::temp_directory_path() / ("gsp-io-" + std::to_string(::getpid()) + "-" + std::to_string(std::random_device{}()));
  Folder() { std::filesystem::create_directories(path); }
  ~Folder() {
    std::error_code error;
    std::filesystem::remove_all(path, error);
  }
  Folder(Folder const&) = delete;
  Folder& operator=(Folder const&) = delete;
  std::size_t files() const {
    return static_cast<std::size_t>(std::distance(std::filesystem::directory_iterator(path), std::filesystem::directory_iterator{}));
  }
};

/// What gsp::Error says when `f` throws one, else nothing; any other exception passes.
template <class F>
std::string error_of(F const& f) {
  try {
    f();
  } catch (gsp::Error const& e) { return e.what(); }
  return {};
}
inline bool says(std::string const& text, std::string const& part) { return text.find(part) != std::string::npos; }

/// How many proper beginnings of `bytes` do NOT make `parse` throw gsp::Error (other exceptions and crashes are not caught here). Each one
/// is read from memory of exactly its size.
template <class Parse>
int accepted_truncations(std::vector<std::byte> const& bytes, Parse const& parse) {
  int accepted = 0;
  for (std::size_t n = 0; n < bytes.size(); ++n) {
    std::vector<std::byte> const cut(bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(n));
    accepted += error_of([&] { parse(Bytes(cut)); }).empty();
  }
  return accepted;
}

inline std::vector<std::byte> bytes_of(std::string const& text) {
  auto const b = std::as_bytes(std::span(text));
  return {b.begin(), b.end()};
}
template <class T>
void put(std::vector<std::byte>& out, T value) {
  auto const b = std::as_bytes(std::span(&value, 1));
  out.insert(out.end(), b.begin(), b.end());
}

inline SplatSet random_set(std::size_t n, int degree, unsigned seed = 1) {
  std::mt19937 random(seed);
  std::normal_distribution<float> normal;
  std::uniform_real_distribution<float> unit(0.f, 1.f);
  SplatSet set = gsp::io::make_splat_set(n, degree);
  for (float& v : set.positions) v = 3 * normal(random);
  for (float& v : set.scales) v = std::exp(normal(random) - 4);
  for (float& v : set.opacities) v = unit(random);
  for (float& v : set.sh) v = 0.5f * normal(random);
  for (std::size_t i = 0; i < n; ++i) {
    double q[4], norm = 0;
    for (double& v : q) v = normal(random), norm += v * v;
    for (int k = 0; k < 4; ++k) set.quats[4 * i + k] = static_cast<float>(q[k] / std::sqrt(norm));
  }
  return set;
}

/// How far two sets are apart, at most: lengths and numbers as they are, scales by their logarithm, rotations as quaternions of one sign.
struct Apart {
  double position = 0, log_scale = 0, rotation = 0, opacity = 0, dc = 0, sh = 0;
};
inline Apart apart(SplatSet const& a, SplatSet const& b) {
  if (a.size() != b.size() || a.sh_degree != b.sh_degree) throw std::logic_error("apart: sets of different sizes");
  Apart m;
  auto const worst = [](double& most, double x) { most = std::max(most, std::abs(x)); };
  std::size_t const width = 3 * a.sh_terms();
  for (std::size_t i = 0; i < a.size(); ++i) {
    double plus = 0, minus = 0;
    for (std::size_t k = 0; k < 4; ++k) {
      plus += std::pow(double(a.quats[4 * i + k]) - b.quats[4 * i + k], 2);
      minus += std::pow(double(a.quats[4 * i + k]) + b.quats[4 * i + k], 2);
    }
    worst(m.rotation, std::sqrt(std::min(plus, minus)));
    worst(m.opacity, double(a.opacities[i]) - b.opacities[i]);
    for (std::size_t k = 0; k < 3; ++k) {
      worst(m.position, double(a.positions[3 * i + k]) - b.positions[3 * i + k]);
      worst(m.log_scale, std::log(double(a.scales[3 * i + k])) - std::log(double(b.scales[3 * i + k])));
    }
    for (std::size_t k = 0; k < width; ++k) worst(k < 3 ? m.dc : m.sh, double(a.sh[width * i + k]) - b.sh[width * i + k]);
  }
  return m;
}

/// .spz of random bytes, unpacked: version 1-4, SH degree 0-3. Version 1 gets finite half floats.
inline std::vector<std::byte> spz_data(std::uint32_t n, int version, int degree, unsigned seed = 1, int flags = 0) {
  std::mt19937 random(seed);
  std::vector<std::byte> out;
  put(out, 0x5053474eu), put(out, std::uint32_t(version)), put(out, n);
  for (int v : {degree, 12, flags, 0}) put(out, std::uint8_t(v));
  for (std::uint32_t i = 0; i < 3 * n; ++i) {
    if (version == 1)
      put(out, std::uint16_t(random() & 0xbfff));
    else
      for (int k = 0; k < 3; ++k) put(out, std::uint8_t(random()));
  }
  std::size_t const rest = n * (1 + 3 + 3 + (version >= 3 ? 4 : 3) + 3 * ((degree + 1) * (degree + 1) - 1));
  for (std::size_t i = 0; i < rest; ++i) put(out, std::uint8_t(random()));
  return out;
}
inline std::vector<std::byte> gzip(std::vector<std::byte> const& bytes) {
  return gsp::io::detail::deflate(bytes, gsp::io::detail::Wrapper::gzip);
}

/// The container of version 4 round such data: header, `records` of vendors, table, a zstd stream for each array.
inline std::vector<std::byte> spz4(std::vector<std::byte> const& data, std::vector<std::byte> const& records = {}) {
  std::uint32_t n;
  std::memcpy(&n, &data[8], 4);
  int const degree = int(data[12]);
  std::vector<std::size_t> sizes{9u * n, n, 3u * n, 3u * n, 4u * n};
  if (degree) sizes.push_back(3u * n * std::size_t((degree + 1) * (degree + 1) - 1));
  std::vector<std::byte> out(data.begin(), data.begin() + 15), streams;
  put(out, std::uint8_t(sizes.size())), put(out, std::uint32_t(32 + records.size()));
  out.resize(32);
  out.insert(out.end(), records.begin(), records.end());
  std::size_t at = 16;
  for (auto size : sizes) {
    auto const packed = gsp::io::detail::zstd_pack(Bytes(data).subspan(at, size), 3, "spz4");
    put(out, std::uint64_t(packed.size())), put(out, std::uint64_t(size));
    streams.insert(streams.end(), packed.begin(), packed.end());
    at += size;
  }
  out.insert(out.end(), streams.begin(), streams.end());
  return out;
}

/// Calls `f` with `runs` copies of `seeds` in which bytes are changed, swapped, left out or doubled; the same for the same `seed`.
template <class F>
void each_mutation(std::vector<std::vector<std::byte>> const& seeds, int runs, unsigned seed, F const& f) {
  std::mt19937 random(seed);
  auto const below = [&](std::size_t n) { return static_cast<std::ptrdiff_t>(random() % n); };
  for (int run = 0; run < runs; ++run) {
    auto bytes = seeds[static_cast<std::size_t>(run) % seeds.size()];
    for (auto edits = 1 + below(4); edits > 0 && !bytes.empty(); --edits) {
      auto const at = bytes.begin() + below(bytes.size());
      auto const end = at + 1 + below(std::min<std::size_t>(16, static_cast<std::size_t>(bytes.end() - at)));
      switch (below(7)) {
        case 0:
          *at ^= std::byte(1 << below(8));
          break;
        case 1:
          *at = std::byte(random());
          break;
        case 2:
          std::fill(at, end, std::byte(below(2) ? 0 : 255));
          break;
        case 3:
          bytes.erase(at, end);
          break;
        case 4: {
          std::vector<std::byte> const piece(at, end);
          bytes.insert(bytes.begin() + below(bytes.size()), piece.begin(), piece.end());
          break;
        }
        case 5:
          std::iter_swap(at, bytes.begin() + below(bytes.size()));
          break;
        default:
          bytes.resize(static_cast<std::size_t>(at - bytes.begin()));
          break;
      }
    }
    f(Bytes(bytes));
  }
}

/// What a mutated file may do: be refused by one line, or be a valid set.
template <class Parse>
void check_mutations(std::vector<std::vector<std::byte>> const& seeds, int runs, Parse const& parse) {
  int wrong = 0, read = 0;
  each_mutation(seeds, runs, 1, [&](Bytes bytes) {
    try {
      gsp::io::validate(parse(bytes), "mutated");
      ++read;
    } catch (gsp::Error const& error) {
      std::string const text = error.what();
      wrong += text.find('\n') != text.npos || text.size() < 10 || text.starts_with("mutated");
    }
  });
  if (wrong > 0 || read == runs)
    throw std::logic_error("check_mutations: " + std::to_string(wrong) + " wrong refusals, " + std::to_string(read) + " read");
}

/// SuperSplat compressed PLY of random packed values; `bounds` 12 or 18 floats a chunk, `degree` > 0 adds the element sh.
inline std::vector<std::byte> compressed_ply(std::uint32_t n, int bounds, int degree, unsigned seed = 1) {
  std::mt19937 random(seed);
  std::uint32_t const chunks = (n + 255) / 256;
  int const rest = 3 * ((degree + 1) * (degree + 1) - 1);
  std::string header = "ply\nformat binary_little_endian 1.0\ncomment by a test\nelement chunk " + std::to_string(chunks) + "\n";
  for (auto axes : {std::vector{"x", "y", "z"}, {"scale_x", "scale_y", "scale_z"}, {"r", "g", "b"}}) {
    if (bounds == 12 && axes[0] == std::string("r")) break;
    for (auto side : {"min_", "max_"})
      for (auto axis : axes) header += std::string("property float ") + side + axis + "\n";
  }
  header += "element vertex " + std::to_string(n) +
            "\nproperty uint packed_position\nproperty uint packed_rotation\nproperty uint packed_scale\nproperty uint packed_color\n";
  if (rest) header += "element sh " + std::to_string(n) + "\n";
  for (int k = 0; k < rest; ++k) header += "property uchar f_rest_" + std::to_string(k) + "\n";
  auto out = bytes_of(header + "end_header\n");
  std::uniform_real_distribution<float> unit(0.f, 1.f);
  for (std::uint32_t c = 0; c < chunks; ++c)
    for (int group = 0; group < bounds / 6; ++group)
      for (int side = 0; side < 2; ++side)
        for (int k = 0; k < 3; ++k) put(out, (group == 1 ? -6.f : -1.f) + 2.f * side + unit(random));
  for (std::uint32_t i = 0; i < 4 * n; ++i) put(out, std::uint32_t(random()));
  for (std::uint32_t i = 0; i < n * rest; ++i) put(out, std::uint8_t(random()));
  return out;
}

/// Runs a Python script with numpy; false where there is none. `ok` takes whether it left with 0.
inline bool run_numpy(std::string const& script, bool& ok) {
  char const* const set = std::getenv("GSP_PYTHON");
  std::string const python = set ? set : "python3";
  if (std::system((python + " -c 'import numpy' >/dev/null 2>&1").c_str()) != 0) return false;
  ok = std::system((python + " -c \"" + script + "\"").c_str()) == 0;
  return true;
}

}  // namespace gsp_test
