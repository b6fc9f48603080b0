#pragma once
#include <gsp/io/detail/zip.hpp>
#include <gsp/io/npy.hpp>
#include <map>

namespace gsp::io {

/// The arrays of a npz file by name.
struct Npz {
  std::string name;  // of the file, for messages
  std::map<std::string, NpyArray> arrays;
  bool contains(std::string const& key) const { return arrays.contains(key); }
  /// Throws Error that lists what is there.
  NpyArray const& at(std::string const& key) const {
    if (auto const it = arrays.find(key); it != arrays.end()) return it->second;
    std::string there;
    for (auto const& [k, array] : arrays) there += (there.empty() ? "" : ", ") + k;
    detail::fail(name, "", "has no array '" + key + "' (it has: " + (there.empty() ? "none" : there) + "); add it");
  }
};

/// All arrays of a npz file (zip of npy; stored or deflated, as numpy.savez and savez_compressed write). Throws Error where the archive is
/// cut short, damaged (CRC), encrypted, zip64 (over 4 GiB), or holds anything but npy arrays.
inline Npz parse_npz(Bytes bytes, std::string const& name) {
  using namespace detail;
  Npz npz{name, {}};
  for (auto const& entry : zip_entries(bytes, name, "a npz file", "write it with numpy.savez or savez_compressed")) {
    if (!entry.label.ends_with(".npy")) fail(entry.place, "", "is not a .npy array; this is not a npz file");
    std::vector<std::byte> storage;
    Bytes const content = zip_content(entry, storage);
    if (!npz.arrays.emplace(entry.label.substr(0, entry.label.size() - 4), parse_npy(content, entry.place)).second)
      fail(entry.place, "", "appears twice; write the file again");
  }
  return npz;
}
inline Npz read_npz(std::filesystem::path const& path) { return parse_npz(read_file(path), path.string()); }

struct NpzEntry {
  std::string name;
  NpyView array;
};
struct NpzOptions {
  int level = 0;  // 0: stored (fast, what numpy.savez does); 1-9: deflate
};

/// Writes a npz file, all or nothing, array by array, without a copy of them where they are not packed. No time stamps: the same arrays
/// give the same bytes. Throws Error where an array or the file passes 4 GiB (zip64 is not written), std::invalid_argument where shape and
/// data disagree or a name comes twice.
inline void write_npz(std::filesystem::path const& path, std::vector<NpzEntry> const& entries, NpzOptions options = {}) {
  using namespace detail;
  constexpr std::uint64_t limit = 0xfffffffe;
  std::string const name = path.string();
  expects(options.level >= 0 && options.level <= 9, "gsp::io::write_npz: level must be 0..9");
  expects(entries.size() < 65535, "gsp::io::write_npz: at most 65534 arrays");
  std::map<std::string, int> seen;
  std::uint64_t sum = 0;
  for (auto const& e : entries) {
    check_npy_view(e.array, e.name);
    expects(!e.name.empty() && e.name.size() < 60000 && seen.emplace(e.name, 0).second,
            "gsp::io::write_npz: array name '" + e.name + "' is empty, too long, or comes twice");
    std::uint64_t const size = e.array.bytes.size() + 70000;
    if (size > limit || (options.level == 0 && (sum += size) > limit))
      fail(name, "array '" + e.name + "'",
           "would pass 4 GiB, the limit of zip files without zip64; write fewer worlds, entries or images to a file");
  }
  AtomicFile file(path);
  std::vector<ZipRecord> records;
  std::uint64_t at = 0, names = 0;
  for (auto const& e : entries) {
    std::string const header = format_npy_header(e.array.dtype, e.array.shape);
    ZipRecord r{e.name + ".npy",  crc32(e.array.bytes, crc32(as_bytes(header))), 0, header.size() + e.array.bytes.size(), at,
                options.level > 0};
    r.packed = r.unpacked;
    if (options.level == 0) {
      file.write(zip_local(r));
      file.write(header);
      file.write(e.array.bytes);
    } else {
      // the record before the data holds their packed size, and a pipe cannot be gone back in
      std::vector<std::byte> data;
      Deflater deflater(Wrapper::raw, options.level, [&](Bytes packed) { data.insert(data.end(), packed.begin(), packed.end()); });
      deflater.write(as_bytes(header));
      deflater.write(e.array.bytes);
      deflater.finish();
      r.packed = data.size();
      if (at + r.packed > limit)
        fail(name, "array '" + e.name + "'",
             "would pass 4 GiB, the limit of zip files without zip64; write fewer worlds, entries or images to a file");
      file.write(zip_local(r));
      file.write(data);
    }
    at += 30 + r.label.size() + r.packed;
    names += 46 + r.label.size();
    records.push_back(std::move(r));
  }
  if (at + names > limit) fail(name, "", "would pass 4 GiB, the limit of zip files without zip64; write fewer arrays to a file");
  file.write(zip_tail(records, at));
  file.commit();
}

}  // namespace gsp::io
