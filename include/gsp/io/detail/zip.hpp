#pragma once
#include <gsp/io/detail/deflate.hpp>
#include <vector>

namespace gsp::io::detail {

/// A file in a zip archive, as its directory has it; held against the archive, not unpacked.
struct ZipEntry {
  std::string label, place;  // place: for messages
  Bytes packed;
  std::size_t unpacked = 0;
  bool deflated = false;
  std::uint32_t crc = 0;
};

/// The entries of a zip archive (stored or deflated). `kind` is what messages say that the file is not, `remedy` how it should be written.
/// Throws Error where it is cut short, encrypted, zip64 (over 4 GiB), packed in another way, or where entries share data, which would let a
/// small file unpack to a huge one.
inline std::vector<ZipEntry> zip_entries(Bytes bytes, std::string const& name, std::string const& kind, std::string const& remedy) {
  // The end record is the last 22 bytes and a comment behind it.
  std::size_t end = std::string_view::npos;
  for (std::size_t comment = 0; comment <= 65535 && comment + 22 <= bytes.size(); ++comment) {
    std::size_t const at = bytes.size() - 22 - comment;
    if (starts_with(bytes.subspan(at), "PK\5\6") && load<std::uint16_t>(bytes, at + 20) == comment) {
      end = at;
      break;
    }
  }
  if (end == std::string_view::npos) fail(name, at_byte(bytes.size()), "has no zip directory at its end; it is cut short or not " + kind);
  std::size_t const entries = load<std::uint16_t>(bytes, end + 10), directory_size = load<std::uint32_t>(bytes, end + 12),
                    directory = load<std::uint32_t>(bytes, end + 16);
  if (directory == 0xffffffff || directory_size == 0xffffffff || entries == 0xffff)
    fail(name, at_byte(end), "is a zip64 archive (over 4 GiB), which is not supported; split it");
  if (directory + directory_size != end) fail(name, at_byte(end), "its zip directory is not where it should be; the file is damaged");
  std::vector<ZipEntry> list;
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
    std::string const place = name + "[" + in_quotes(label) + "]";
    if (flags & 1) fail(place, "", "is encrypted; write it without a password");
    if (method != 0 && method != 8) fail(place, "", "uses zip method " + std::to_string(method) + "; " + remedy);
    if (packed == 0xffffffff || unpacked == 0xffffffff || local == 0xffffffff)
      fail(place, "", "is a zip64 entry (over 4 GiB), which is not supported; split it");
    if (directory < 30 || local > directory - 30 || !starts_with(bytes.subspan(local), "PK\3\4"))
      fail(place, at_byte(local), "has no zip entry there; the file is damaged");
    std::size_t const data = local + 30 + load<std::uint16_t>(bytes, local + 26) + load<std::uint16_t>(bytes, local + 28);
    packed_total += packed;
    if (data > directory || packed > directory - data || packed_total > directory)
      fail(place, at_byte(local), "reaches beyond the archive; the file is damaged");
    if (method == 0 ? packed != unpacked : !can_inflate_to(packed, unpacked))
      fail(place, at_byte(local), "its packed and unpacked sizes cannot both be true; the file is damaged");
    list.push_back({std::move(label), place, bytes.subspan(data, packed), unpacked, method == 8, crc});
  }
  if (at != end) fail(name, at_byte(at), "the zip directory holds more than it announces; the file is damaged");
  return list;
}

/// The bytes of an entry: of the archive, or unpacked into `storage`. Throws Error where size or checksum are not those announced.
inline Bytes zip_content(ZipEntry const& entry, std::vector<std::byte>& storage) {
  Bytes content = entry.packed;
  if (entry.deflated) {
    Inflater inflater(content, Wrapper::raw, entry.place);
    storage = inflater.read_up_to(entry.unpacked);
    if (storage.size() != entry.unpacked || !inflater.at_end())
      fail(entry.place, "", "does not unpack to the size announced; the file is damaged");
    content = storage;
  }
  if (crc32(content) != entry.crc) fail(entry.place, "", "its checksum is wrong; the file is damaged, fetch it again");
  return content;
}

/// What is to be said of an entry that is written; sizes and place below 4 GiB.
struct ZipRecord {
  std::string label;
  std::uint32_t crc = 0;
  std::uint64_t packed = 0, unpacked = 0, offset = 0;
  bool deflated = false;
};

inline void put_le(std::string& out, std::uint64_t value, int bytes) {
  for (; bytes-- > 0; value >>= 8) out += static_cast<char>(value & 255);
}
inline std::string zip_fields(ZipRecord const& r) {  // what a local and a directory record have in common
  std::string out;
  put_le(out, 20, 2);
  put_le(out, 0, 2);
  put_le(out, r.deflated ? 8 : 0, 2);
  put_le(out, 0, 2);
  put_le(out, 0x21, 2);  // 1980-01-01, the first day of zip: no time stamps, the same content gives the same bytes
  put_le(out, r.crc, 4);
  put_le(out, r.packed, 4);
  put_le(out, r.unpacked, 4);
  put_le(out, r.label.size(), 2);
  put_le(out, 0, 2);
  return out;
}
/// What stands before the bytes of an entry.
inline std::string zip_local(ZipRecord const& r) { return "PK\3\4" + zip_fields(r) + r.label; }
/// What stands behind the last entry, at byte `at`.
inline std::string zip_tail(std::vector<ZipRecord> const& records, std::uint64_t at) {
  std::string out;
  for (auto const& r : records) {
    out += "PK\1\2";
    put_le(out, 20, 2);  // made by: version 2.0
    out += zip_fields(r);
    put_le(out, 0, 2);
    put_le(out, 0, 2);
    put_le(out, 0, 2);
    put_le(out, 0, 4);
    put_le(out, r.offset, 4);
    out += r.label;
  }
  std::string tail = "PK\5\6";
  put_le(tail, 0, 4);
  put_le(tail, records.size(), 2);
  put_le(tail, records.size(), 2);
  put_le(tail, out.size(), 4);
  put_le(tail, at, 4);
  put_le(tail, 0, 2);
  return out + tail;
}

}  // namespace gsp::io::detail
