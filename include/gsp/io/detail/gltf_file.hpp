#pragma once
#include <algorithm>
#include <filesystem>
#include <gsp/io/detail/base64.hpp>
#include <gsp/io/detail/file_beside.hpp>
#include <gsp/io/detail/json_text.hpp>
#include <gsp/io/file.hpp>
#include <map>
#include <vector>

namespace gsp::io::detail {

/// A glTF file: its JSON and buffers, with every number held against what is there.
class GltfFile {
 public:
  GltfFile(Bytes bytes, std::string name, std::filesystem::path folder)
      : name_(std::move(name)), folder_(std::move(folder)), size_(bytes.size()) {
    std::string_view text = as_text(bytes);
    if (starts_with(bytes, "glTF")) {
      text = as_text(chunks(bytes));
    } else if (text.starts_with("\xef\xbb\xbf")) {
      text.remove_prefix(3);
    }
    root_ = parse_json(text, name_);
    if (!root_.is_object()) fail(name_, "", "its JSON is no object; this is not a glTF file");
    auto const asset = root_.find("asset");
    auto const version = asset != root_.end() && asset->is_object() ? asset->find("version") : root_.end();
    if (asset == root_.end() || !asset->is_object() || version == asset->end() || !version->is_string() ||
        !version->get_ref<std::string const&>().starts_with("2."))
      fail(name_, "asset", "does not say glTF version 2; export it as glTF 2.0");
  }

  std::string const& name() const { return name_; }
  Json const& root() const { return root_; }
  /// Of the file and its buffers: what is read out of them is held against it.
  std::uint64_t size() const { return size_; }

  /// Element `index` of the array `key` at the top, an object.
  Json const& element(char const* key, std::uint64_t index, std::string const& place) const {
    auto const list = root_.find(key);
    std::size_t const count = list != root_.end() && list->is_array() ? list->size() : 0;
    if (index >= count)
      fail(name_, place,
           "refers to " + std::string(key) + "[" + std::to_string(index) + "], and there are " + std::to_string(count) +
               "; the file is damaged");
    Json const& element = (*list)[static_cast<std::size_t>(index)];
    if (!element.is_object()) fail(name_, std::string(key) + "[" + std::to_string(index) + "]", "must be an object; the file is damaged");
    return element;
  }
  /// A whole number >= 0.
  std::uint64_t number(Json const& object, char const* key, std::string const& place, std::optional<std::uint64_t> otherwise = {}) const {
    auto const at = object.find(key);
    if (at == object.end() && otherwise) return *otherwise;
    if (at == object.end() || !at->is_number_unsigned())
      fail(name_, place, "\"" + std::string(key) + "\" must be a whole number, not negative; the file is damaged");
    return at->get<std::uint64_t>();
  }
  std::string text(Json const& object, char const* key, std::string const& place, std::string const& otherwise) const {
    auto const at = object.find(key);
    if (at == object.end()) return otherwise;
    if (!at->is_string()) fail(name_, place, "\"" + std::string(key) + "\" must be a text; the file is damaged");
    return at->get<std::string>();
  }
  /// An object, or null where the key is missing.
  Json const* object(Json const& parent, char const* key, std::string const& place) const {
    auto const at = parent.find(key);
    if (at == parent.end()) return nullptr;
    if (!at->is_object()) fail(name_, place, "\"" + std::string(key) + "\" must be an object; the file is damaged");
    return &*at;
  }
  /// `count` finite numbers, or `otherwise`.
  template <std::size_t count>
  std::array<double, count> numbers(Json const& object, char const* key, std::string const& place,
                                    std::array<double, count> otherwise) const {
    auto const at = object.find(key);
    if (at == object.end()) return otherwise;
    bool good = at->is_array() && at->size() == count;
    for (std::size_t k = 0; good && k < count; ++k) {
      good = (*at)[k].is_number();
      if (good) otherwise[k] = (*at)[k].template get<double>();
      good = good && std::isfinite(otherwise[k]);
    }
    if (!good) fail(name_, place, "\"" + std::string(key) + "\" must be " + std::to_string(count) + " finite numbers; the file is damaged");
    return otherwise;
  }

  /// The bytes of a buffer view. `stride`, where given, takes its byteStride, or stays.
  Bytes view(std::uint64_t index, std::string const& from, std::uint64_t* stride = nullptr) {
    std::string const place = "bufferViews[" + std::to_string(index) + "]";
    Json const& view = element("bufferViews", index, from);
    if (auto const* extensions = object(view, "extensions", place); extensions && !extensions->empty())
      fail(name_, place, "is packed by " + in_quotes(extensions->begin().key()) + ", which is not read here; export it without");
    Bytes const bytes = buffer(number(view, "buffer", place), place);
    auto const offset = number(view, "byteOffset", place, 0), length = number(view, "byteLength", place);
    if (offset > bytes.size() || length > bytes.size() - offset)
      fail(name_, place,
           "its " + std::to_string(length) + " bytes from " + std::to_string(offset) + " leave the buffer of " +
               std::to_string(bytes.size()) + "; the file is cut short or damaged");
    if (stride) *stride = number(view, "byteStride", place, *stride);
    return bytes.subspan(offset, length);
  }

 private:
  /// The chunks of a .glb: returns that of JSON, keeps the binary one.
  Bytes chunks(Bytes bytes) {
    if (bytes.size() < 20) fail(name_, at_byte(bytes.size()), "the .glb header is cut short; fetch the file again");
    if (auto const version = load<std::uint32_t>(bytes, 4); version != 2)
      fail(name_, at_byte(4), "is .glb version " + std::to_string(version) + "; export it as glTF 2.0");
    if (auto const length = load<std::uint32_t>(bytes, 8); length != bytes.size())
      fail(name_, at_byte(8),
           "announces " + std::to_string(length) + " bytes and has " + std::to_string(bytes.size()) +
               "; it is cut short or something was appended");
    Bytes json;
    std::size_t at = 12;
    for (int k = 0; at < bytes.size(); ++k) {
      if (bytes.size() - at < 8) fail(name_, at_byte(at), "a chunk's header is cut short; the file is damaged");
      auto const length = load<std::uint32_t>(bytes, at), type = load<std::uint32_t>(bytes, at + 4);
      if (length > bytes.size() - at - 8)
        fail(name_, at_byte(at),
             "a chunk of " + std::to_string(length) + " bytes reaches beyond the end; the file is cut short or damaged");
      if (k == 0 && type != 0x4e4f534a) fail(name_, at_byte(at + 4), "its first chunk is not JSON; the file is damaged");
      if (k == 0) json = bytes.subspan(at + 8, length);
      if (k == 1 && type == 0x004e4942) binary_ = bytes.subspan(at + 8, length);
      at += 8 + length;
    }
    return json;
  }
  Bytes buffer(std::uint64_t index, std::string const& from) {
    std::string const place = "buffers[" + std::to_string(index) + "]";
    Json const& buffer = element("buffers", index, from);
    auto const length = number(buffer, "byteLength", place);
    auto const uri = text(buffer, "uri", place, "");
    auto [at, added] = buffers_.try_emplace(uri);
    if (added) {
      if (uri.empty()) {
        at->second.bytes = binary_;
      } else {
        if (uri.starts_with("data:")) {
          auto const comma = uri.find(";base64,");
          auto data = comma == uri.npos ? std::nullopt : from_base64(std::string_view(uri).substr(comma + 8));
          if (!data) fail(name_, place, "its data URI is no base64; the file is damaged");
          at->second.owned = std::move(*data);
        } else {
          at->second.owned = read_file(file_beside(folder_, uri, name_, place));
          size_ += at->second.owned.size();
        }
        at->second.bytes = at->second.owned;
      }
    }
    if (length > at->second.bytes.size())
      fail(name_, place,
           "announces " + std::to_string(length) + " bytes, and there are " + std::to_string(at->second.bytes.size()) +
               "; the file is cut short or damaged");
    return at->second.bytes.first(length);
  }

  struct Buffer {
    std::vector<std::byte> owned;
    Bytes bytes;
  };
  std::string name_;
  std::filesystem::path folder_;
  std::uint64_t size_;
  Bytes binary_;
  Json root_;
  std::map<std::string, Buffer> buffers_;  // by uri; "": the chunk of a .glb
};

/// Numbers of an accessor as doubles, by element and component.
struct GltfNumbers {
  Bytes bytes;
  std::uint64_t count = 0, size = 0, stride = 0;  // bytes of an element, and to the next
  int type = 0;                                   // glTF's: 5120 signed byte, 5121 byte, 5122 signed short, 5123 short, 5126 float
  bool normalized = false;
  std::uint64_t packed() const { return count * size; }

  double operator()(std::uint64_t i, std::size_t k) const {
    std::size_t const size = type == 5126 ? 4 : type >= 5122 ? 2 : 1, at = static_cast<std::size_t>(i * stride) + k * size;
    switch (type) {
      case 5120:
        return normalized ? std::max(load<std::int8_t>(bytes, at) / 127.0, -1.0) : load<std::int8_t>(bytes, at);
      case 5121:
        return load<std::uint8_t>(bytes, at) / (normalized ? 255.0 : 1.0);
      case 5122:
        return normalized ? std::max(load<std::int16_t>(bytes, at) / 32767.0, -1.0) : load<std::int16_t>(bytes, at);
      case 5123:
        return load<std::uint16_t>(bytes, at) / (normalized ? 65535.0 : 1.0);
      default:
        return load<float>(bytes, at);
    }
  }
};

inline GltfNumbers gltf_numbers(GltfFile& file, std::uint64_t index, std::size_t width, std::string const& attribute,
                                std::string const& from) {
  std::string const place = "accessors[" + std::to_string(index) + "]";
  Json const& accessor = file.element("accessors", index, from);
  GltfNumbers n;
  std::string const types[] = {"SCALAR", "VEC2", "VEC3", "VEC4"};
  if (auto const type = file.text(accessor, "type", place, ""); type != types[width - 1])
    fail(file.name(), place, "is " + in_quotes(type) + " where " + attribute + " is " + types[width - 1] + "; export the file again");
  auto const type = file.number(accessor, "componentType", place);
  if (type != 5120 && type != 5121 && type != 5122 && type != 5123 && type != 5126)
    fail(file.name(), place,
         "has component type " + std::to_string(type) + ", which " + attribute + " may not have; export it as float (5126)");
  n.type = static_cast<int>(type);
  if (auto const flag = accessor.find("normalized"); flag != accessor.end() && flag->is_boolean()) n.normalized = flag->get<bool>();
  if (accessor.contains("sparse")) fail(file.name(), place, "is sparse, which is not read here; export it whole");
  if (!accessor.contains("bufferView"))
    fail(file.name(), place,
         "has no bufferView: " + attribute + " holds zeros or is packed by an extension that is not read here; export it without");
  n.count = file.number(accessor, "count", place);
  std::uint64_t const size = n.size = width * (n.type == 5126 ? 4 : n.type >= 5122 ? 2 : 1);
  n.stride = size;
  n.bytes = file.view(file.number(accessor, "bufferView", place), place, &n.stride);
  auto const offset = file.number(accessor, "byteOffset", place, 0);
  if (n.stride < size || n.stride > 252)
    fail(file.name(), place,
         "has the stride " + std::to_string(n.stride) + " for elements of " + std::to_string(size) + " bytes; the file is damaged");
  if (n.count == 0 || offset > n.bytes.size() || n.count - 1 > n.bytes.size() / n.stride ||
      (n.count - 1) * n.stride + size > n.bytes.size() - offset)
    fail(file.name(), place,
         "its " + std::to_string(n.count) + " elements of " + std::to_string(size) + " bytes do not lie in the " +
             std::to_string(n.bytes.size()) + " of its view; the file is cut short or damaged");
  n.bytes = n.bytes.subspan(offset);
  return n;
}

}  // namespace gsp::io::detail
