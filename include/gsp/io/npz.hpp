#pragma once
#include <gsp/io/detail/deflate.hpp>
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
  // The end record is the last 22 bytes and a comment behind it.
  std::size_t end = std::string_view::npos;
  for (std::size_t comment = 0; comment <= 65535 && comment + 22 <= bytes.size(); ++comment) {
    std::size_t const at = bytes.size() - 22 - comment;
    if (starts_with(bytes.subspan(at), "PK\5\6") && load<std::uint16_t>(bytes, at + 20) == comment) {
      end = at;
      break;
    }
  }
  if (end == std::string_view::npos)
    fail(name, at_byte(bytes.size()), "has no zip directory at its end; it is cut short or not a npz file");
  std::size_t const entries = load<std::uint16_t>(bytes, end + 10), directory_size = load<std::uint32_t>(bytes, end + 12),
                    directory = load<std::uint32_t>(bytes, end + 16);
  if (directory == 0xffffffff || directory_size == 0xffffffff || entries == 0xffff)
    fail(name, at_byte(end), "is a zip64 archive (over 4 GiB), which is not supported; split it");
  if (directory + directory_size != end) fail(name, at_byte(end), "its zip directory is not where it should be; the file is damaged");
  Npz npz{name, {}};
  std::size_t at = directory, packed_total = 0;
  for (std::size_t i = 0; i < entries; ++i) {
    if (end - at < 46 || !starts_with(bytes.subspan(at), "PK\1\2"))
      fail(name, at_byte(at), "the zip directory is damaged; fetch the file again");
    unsigned const flags = load<std::uint16_t>(bytes, at + 8), method = load<std::uint16_t>(bytes, at + 10);
    std::uint32_t const crc = load<std::uint32_t>(bytes, at + 16);
    std::size_t const packed = load<std::uint32_t>(bytes, at + 20), unpacked = load<std::uint32_t>(bytes, at + 24),
                      local = load<std::uint32_t>(bytes, at + 42);
    std::size_t const label_size = load<std::uint16_t>(bytes, at + 28),
                      skip = label_size + load<std::uint16_t>(bytes, at + 30) + load<std::uint16_t>(bytes, at + 32);
    if (end - at - 46 < skip) fail(name, at_byte(at), "the zip directory is damaged; fetch the file again");
    std::string label(as_text(bytes.subspan(at + 46, label_size)));
    at += 46 + skip;
    std::string const entry = name + "[" + in_quotes(label) + "]";
    if (!label.ends_with(".npy")) fail(entry, "", "is not a .npy array; this is not a npz file");
    label.resize(label.size() - 4);
    if (flags & 1) fail(entry, "", "is encrypted; write it without a password");
    if (method != 0 && method != 8)
      fail(entry, "", "uses zip method " + std::to_string(method) + "; write it with numpy.savez or savez_compressed");
    if (packed == 0xffffffff || unpacked == 0xffffffff || local == 0xffffffff)
      fail(entry, "", "is a zip64 entry (over 4 GiB), which is not supported; split it");
    if (directory < 30 || local > directory - 30 || !starts_with(bytes.subspan(local), "PK\3\4"))
      fail(entry, at_byte(local), "has no zip entry there; the file is damaged");
    std::size_t const data = local + 30 + load<std::uint16_t>(bytes, local + 26) + load<std::uint16_t>(bytes, local + 28);
    packed_total += packed;  // entries that share data would let a small file unpack to a huge one
    if (data > directory || packed > directory - data || packed_total > directory)
      fail(entry, at_byte(local), "reaches beyond the archive; the file is damaged");
    if (method == 0 ? packed != unpacked : !can_inflate_to(packed, unpacked))
      fail(entry, at_byte(local), "its packed and unpacked sizes cannot both be true; the file is damaged");
    std::vector<std::byte> inflated;
    Bytes content = bytes.subspan(data, packed);
    if (method == 8) {
      Inflater inflater(content, Wrapper::raw, entry);
      inflated = inflater.read_up_to(unpacked);
      if (inflated.size() != unpacked || !inflater.at_end()) fail(entry, "", "does not unpack to the size announced; the file is damaged");
      content = inflated;
    }
    if (crc32(content) != crc) fail(entry, "", "its checksum is wrong; the file is damaged, fetch it again");
    if (!npz.arrays.emplace(label, parse_npy(content, entry)).second) fail(entry, "", "appears twice; write the file again");
  }
  if (at != end) fail(name, at_byte(at), "the zip directory holds more than it announces; the file is damaged");
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
  auto put = [](std::string& out, std::uint64_t value, int bytes) {
    for (; bytes-- > 0; value >>= 8) out += static_cast<char>(value & 255);
  };
  struct Sizes {
    std::uint32_t crc = 0;
    std::uint64_t packed = 0, unpacked = 0, offset = 0;
  };
  auto fields = [&](std::string const& label, Sizes const& s) {  // what a local and a directory record have in common
    std::string out;
    put(out, 20, 2);
    put(out, 0, 2);
    put(out, options.level ? 8 : 0, 2);
    put(out, 0, 2);
    put(out, 0x21, 2);  // 1980-01-01, the first day of zip
    put(out, s.crc, 4);
    put(out, s.packed, 4);
    put(out, s.unpacked, 4);
    put(out, label.size(), 2);
    put(out, 0, 2);
    return out;
  };
  AtomicFile file(path);
  std::string directory;
  std::uint64_t at = 0;
  for (auto const& e : entries) {
    std::string const label = e.name + ".npy", header = format_npy_header(e.array.dtype, e.array.shape);
    Sizes sizes{crc32(e.array.bytes, crc32(as_bytes(header))), 0, header.size() + e.array.bytes.size(), at};
    sizes.packed = sizes.unpacked;
    if (options.level == 0) {
      file.write("PK\3\4" + fields(label, sizes) + label);
      file.write(header);
      file.write(e.array.bytes);
    } else {
      // the record before the data holds their packed size, and a pipe cannot be gone back in
      std::vector<std::byte> data;
      Deflater deflater(Wrapper::raw, options.level, [&](Bytes packed) { data.insert(data.end(), packed.begin(), packed.end()); });
      deflater.write(as_bytes(header));
      deflater.write(e.array.bytes);
      deflater.finish();
      sizes.packed = data.size();
      if (at + sizes.packed > limit)
        fail(name, "array '" + e.name + "'",
             "would pass 4 GiB, the limit of zip files without zip64; write fewer worlds, entries or images to a file");
      file.write("PK\3\4" + fields(label, sizes) + label);
      file.write(data);
    }
    at += 30 + label.size() + sizes.packed;
    directory += "PK\1\2";
    put(directory, 20, 2);  // made by: version 2.0
    directory += fields(label, sizes);
    put(directory, 0, 2);
    put(directory, 0, 2);
    put(directory, 0, 2);
    put(directory, 0, 4);
    put(directory, sizes.offset, 4);
    directory += label;
  }
  if (at + directory.size() > limit) fail(name, "", "would pass 4 GiB, the limit of zip files without zip64; write fewer arrays to a file");
  std::string tail = "PK\5\6";
  put(tail, 0, 4);
  put(tail, entries.size(), 2);
  put(tail, entries.size(), 2);
  put(tail, directory.size(), 4);
  put(tail, at, 4);
  put(tail, 0, 2);
  file.write(directory + tail);
  file.commit();
}

}  // namespace gsp::io
