#pragma once
#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <concepts>
#include <gsp/io/file.hpp>
#include <limits>
#include <memory>
#include <string_view>
#include <utility>
#include <vector>

namespace gsp::io {

enum class Dtype { f4, f8, i4, i8, u1, b1 };

namespace detail {
struct DtypeInfo {
  std::string_view descr;  // numpy's word for it
  std::size_t size;
};
inline constexpr std::array<DtypeInfo, 6> dtype_infos{{{"<f4", 4}, {"<f8", 8}, {"<i4", 4}, {"<i8", 8}, {"|u1", 1}, {"|b1", 1}}};
inline DtypeInfo const& info(Dtype d) { return dtype_infos[static_cast<std::size_t>(d)]; }
}  // namespace detail

/// The Dtype that stores T: float, double, int32, int64, uint8 and bool have one.
template <class T>
constexpr Dtype dtype_of() {
  if constexpr (std::same_as<T, float>)
    return Dtype::f4;
  else if constexpr (std::same_as<T, double>)
    return Dtype::f8;
  else if constexpr (std::same_as<T, bool>)
    return Dtype::b1;
  else if constexpr (std::signed_integral<T> && sizeof(T) == 4)
    return Dtype::i4;
  else if constexpr (std::signed_integral<T> && sizeof(T) == 8)
    return Dtype::i8;
  else {
    static_assert(std::same_as<T, unsigned char>, "gsp::io: npy files here hold float, double, int32, int64, uint8 or bool");
    return Dtype::u1;
  }
}

/// "(2, 3)", as Python writes a shape.
inline std::string format_shape(std::span<std::size_t const> shape) {
  std::string out = "(";
  for (std::size_t k = 0; k < shape.size(); ++k) out += (k ? ", " : "") + std::to_string(shape[k]);
  return out + (shape.size() == 1 ? ",)" : ")");
}

/// An array in C order.
struct NpyArray {
  Dtype dtype = Dtype::f8;
  std::vector<std::size_t> shape;
  std::vector<std::byte> bytes;

  std::size_t size() const { return bytes.size() / detail::info(dtype).size; }

  /// Its values as T, whatever they are stored as. Throws Error where T cannot hold one: to an integer only whole numbers in its range.
  template <class T>
  std::vector<T> as(std::string const& name = "npy array") const {
    static_assert(std::is_arithmetic_v<T> && !std::same_as<T, bool>, "gsp::io::NpyArray::as: ask for a number type");
    std::vector<T> out(size());
    auto convert = [&]<class S>(S) {
      for (std::size_t i = 0; i < out.size(); ++i) {
        S const value = detail::load<S>(bytes, i * sizeof(S));
        if constexpr (std::integral<T> && std::floating_point<S>) {
          // the largest value may not exist in S, so the bound is the power of two above it, left out
          S const bound = std::ldexp(S(1), std::numeric_limits<T>::digits), low = std::signed_integral<T> ? -bound : S(0);
          if (!(value >= low && value < bound && value == std::trunc(value)))
            detail::fail(name, "value " + std::to_string(i), std::to_string(value) + " is not a whole number in range; store integers");
        } else if constexpr (std::integral<T>) {
          if (!std::in_range<T>(value))
            detail::fail(name, "value " + std::to_string(i), std::to_string(value) + " is out of range; use a wider type");
        }
        out[i] = static_cast<T>(value);
      }
    };
    switch (dtype) {
      case Dtype::f4:
        convert(float{});
        break;
      case Dtype::f8:
        convert(double{});
        break;
      case Dtype::i4:
        convert(std::int32_t{});
        break;
      case Dtype::i8:
        convert(std::int64_t{});
        break;
      default:
        convert(std::uint8_t{});
    }
    return out;
  }
};

/// An array to be written: somebody else's, which has to be there still when it is, or a temporary, which it keeps.
struct NpyView {
  Dtype dtype = Dtype::f8;
  std::vector<std::size_t> shape;
  Bytes bytes;
  std::shared_ptr<void const> kept;
  NpyView() = default;
  NpyView(NpyArray const& a) : dtype(a.dtype), shape(a.shape), bytes(a.bytes) {}  // NOLINT: an array is a view of itself
  NpyView(NpyArray&& a) : dtype(a.dtype), shape(std::move(a.shape)) {             // NOLINT
    auto const owned = std::make_shared<std::vector<std::byte> const>(std::move(a.bytes));
    bytes = *owned;
    kept = owned;
  }
  template <class T>
  NpyView(std::vector<std::size_t> s, std::span<T const> values)
      : dtype(dtype_of<T>()), shape(std::move(s)), bytes(std::as_bytes(values)) {}
  template <class T>
  NpyView(std::vector<std::size_t> s, std::vector<T> const& values) : NpyView(std::move(s), std::span<T const>(values)) {}
  template <class T>
  NpyView(std::vector<std::size_t> s, std::vector<T>&& values)
      : NpyView(std::move(s), std::make_shared<std::vector<T> const>(std::move(values))) {}

 private:
  template <class T>
  NpyView(std::vector<std::size_t> s, std::shared_ptr<std::vector<T> const> values) : NpyView(std::move(s), std::span<T const>(*values)) {
    kept = std::move(values);
  }
};

/// Owns a copy of `values`.
template <class T>
NpyArray make_npy(std::vector<std::size_t> shape, std::vector<T> const& values) {
  NpyView const view(std::move(shape), values);
  return {view.dtype, view.shape, {view.bytes.begin(), view.bytes.end()}};
}

/// Throws Error unless the array has this shape; -1 stands for any length. `name` says which array of which file.
inline void expect_shape(NpyArray const& array, std::vector<long long> const& shape, std::string const& name) {
  bool ok = array.shape.size() == shape.size();
  std::string wanted;
  for (std::size_t k = 0; k < shape.size(); ++k) {
    ok = ok && (shape[k] < 0 || array.shape[k] == static_cast<std::size_t>(shape[k]));
    wanted += (k ? ", " : "") + (shape[k] < 0 ? std::string(1, static_cast<char>('A' + k)) : std::to_string(shape[k]));
  }
  if (!ok) detail::fail(name, "", "has shape " + format_shape(array.shape) + ", expected (" + wanted + "); reshape it");
}

/// Throws Error where a value is NaN or infinite.
inline void expect_finite(NpyArray const& array, std::string const& name) {
  auto const check = [&]<class S>(S) {
    for (std::size_t i = 0; i < array.size(); ++i)
      if (!std::isfinite(detail::load<S>(array.bytes, i * sizeof(S))))
        detail::fail(name, "value " + std::to_string(i), "is not finite; repair the file");
  };
  if (array.dtype == Dtype::f4) check(float{});
  if (array.dtype == Dtype::f8) check(double{});
}

namespace detail {

/// Number of bytes that dtype and shape ask for, or nothing where that passes `limit`.
inline bool npy_bytes(Dtype dtype, std::span<std::size_t const> shape, std::size_t limit, std::size_t& bytes) {
  bytes = std::find(shape.begin(), shape.end(), 0u) == shape.end() ? info(dtype).size : 0;
  for (std::size_t n : shape) {
    if (n != 0 && bytes > limit / n) return false;
    bytes *= n;
  }
  return bytes <= limit;
}

/// The dictionary of a npy header: {'descr': '<f8', 'fortran_order': False, 'shape': (3, 4), }
class NpyHeader {
 public:
  Dtype dtype{};
  bool fortran = false;
  std::vector<std::size_t> shape;

  NpyHeader(std::string_view text, std::string const& name) : text_(text), name_(name) {
    expect('{');
    int seen = 0;
    while (!accept('}')) {
      auto const key = string();
      expect(':');
      int const bit = key == "descr" ? 1 : key == "fortran_order" ? 2 : key == "shape" ? 4 : 0;
      if (bit == 0 || (seen & bit)) broken();
      seen |= bit;
      if (bit == 1)
        read_dtype();
      else if (bit == 2)
        read_order();
      else
        read_shape();
      if (!accept(',')) {
        expect('}');
        break;
      }
    }
    if (seen != 7 || peek() != '\0') broken();
  }

 private:
  [[noreturn]] void broken() const { fail(name_, at_byte(10 + at_), "the npy header is damaged; write the file again with numpy.save"); }
  char peek() {
    while (at_ < text_.size() && (text_[at_] == ' ' || text_[at_] == '\n')) ++at_;
    return at_ < text_.size() ? text_[at_] : '\0';
  }
  bool accept(char c) { return peek() == c && ++at_; }
  void expect(char c) {
    if (!accept(c)) broken();
  }
  std::string_view string() {
    char const quote = peek();
    if (quote != '\'' && quote != '"') broken();
    std::size_t const begin = ++at_, end = text_.find(quote, begin);
    if (end == std::string_view::npos) broken();
    at_ = end + 1;
    return text_.substr(begin, end - begin);
  }
  void read_dtype() {
    if (peek() == '[') fail(name_, at_byte(10 + at_), "record arrays are not supported; save a plain array");
    auto const word = string();
    for (std::size_t d = 0; d < dtype_infos.size(); ++d)
      if (word == dtype_infos[d].descr ||
          (dtype_infos[d].size == 1 && word.size() == 3 && word.substr(1) == dtype_infos[d].descr.substr(1))) {
        dtype = static_cast<Dtype>(d);
        return;
      }
    fail(name_, at_byte(10 + at_),
         "dtype " + in_quotes(word) + " is not supported; save it as float32, float64, int32, int64, uint8 or bool, little endian");
  }
  void read_order() {
    peek();
    auto const rest = text_.substr(at_);
    fortran = rest.starts_with("True");
    if (!fortran && !rest.starts_with("False")) broken();
    at_ += fortran ? 4 : 5;
  }
  void read_shape() {
    expect('(');
    while (!accept(')')) {
      peek();
      std::size_t n = 0;
      auto const [end, error] = std::from_chars(text_.data() + at_, text_.data() + text_.size(), n);
      if (error != std::errc{} || shape.size() == 32) broken();
      at_ = static_cast<std::size_t>(end - text_.data());
      shape.push_back(n);
      if (!accept(',')) {
        expect(')');
        break;
      }
    }
  }
  std::string_view text_;
  std::string const& name_;
  std::size_t at_ = 0;
};

/// First index fastest -> last index fastest.
inline std::vector<std::byte> from_fortran_order(Bytes bytes, std::size_t item, std::vector<std::size_t> const& shape) {
  std::vector<std::byte> out(bytes.size());
  std::vector<std::size_t> index(shape.size(), 0), stride(shape.size(), item);
  for (std::size_t k = 1; k < shape.size(); ++k) stride[k] = stride[k - 1] * shape[k - 1];
  for (std::size_t to = 0, from = 0; to < out.size(); to += item) {
    std::memcpy(&out[to], &bytes[from], item);
    for (std::size_t k = shape.size(); k-- > 0;) {  // next index in C order, its address kept alongside
      from += stride[k];
      if (++index[k] < shape[k]) break;
      from -= stride[k] * shape[k];
      index[k] = 0;
    }
  }
  return out;
}

inline std::string format_npy_header(Dtype dtype, std::span<std::size_t const> shape) {
  std::string dict = "{'descr': '" + std::string(info(dtype).descr) + "', 'fortran_order': False, 'shape': " + format_shape(shape) + ", }";
  dict.append(63 - (10 + dict.size()) % 64, ' ');  // with the line end, header and data start are multiples of 64
  dict += '\n';
  std::string out("\x93NUMPY\x01\x00", 8);
  out += static_cast<char>(dict.size() & 255);
  out += static_cast<char>(dict.size() >> 8);
  return out + dict;
}

/// Throws std::invalid_argument where bytes and shape of what shall be written disagree.
inline void check_npy_view(NpyView const& array, std::string const& name) {
  std::size_t bytes = 0;
  expects(array.shape.size() <= 32 && npy_bytes(array.dtype, array.shape, std::numeric_limits<std::size_t>::max(), bytes) &&
              bytes == array.bytes.size(),
          "gsp::io: array '" + name + "' has " + std::to_string(array.bytes.size()) + " bytes, which is not its shape " +
              format_shape(array.shape) + " of " + std::string(info(array.dtype).descr));
}

}  // namespace detail

/// An array of a npy file, versions 1-3: float32, float64, int32, int64, uint8, bool; little endian; Fortran order is turned into C order.
/// Throws Error for anything else, and where the data is shorter or longer than dtype and shape say.
inline NpyArray parse_npy(Bytes bytes, std::string const& name) {
  using namespace detail;
  if (bytes.size() < 10 || !starts_with(bytes, "\x93NUMPY"))
    fail(name, at_byte(0), "does not start with a npy header; write it with numpy.save");
  int const version = int(bytes[6]);
  std::size_t const prefix = version == 1 ? 10 : 12;
  if (version < 1 || version > 3 || bytes.size() < prefix)
    fail(name, at_byte(6),
         "npy version " + std::to_string(version) + " is not supported or the file is cut short; write it again with numpy.save");
  std::size_t const length = version == 1 ? load<std::uint16_t>(bytes, 8) : load<std::uint32_t>(bytes, 8);
  if (length > bytes.size() - prefix) fail(name, at_byte(8), "the npy header is cut short; fetch the file again");
  NpyHeader const header(as_text(bytes.subspan(prefix, length)), name);
  Bytes const data = bytes.subspan(prefix + length);
  std::size_t wanted = 0;
  if (!npy_bytes(header.dtype, header.shape, data.size(), wanted) || wanted != data.size())
    fail(name, at_byte(prefix + length),
         "shape " + format_shape(header.shape) + " of " + std::string(info(header.dtype).descr) + " does not fit the " +
             std::to_string(data.size()) + " bytes of data; the file is cut short or damaged");
  NpyArray array{header.dtype, header.shape, {}};
  array.bytes = header.fortran && header.shape.size() > 1 ? from_fortran_order(data, info(header.dtype).size, header.shape)
                                                          : std::vector<std::byte>(data.begin(), data.end());
  return array;
}
inline NpyArray read_npy(std::filesystem::path const& path) { return parse_npy(read_file(path), path.string()); }

/// Writes a npy file (version 1, C order), all or nothing. The same array gives the same bytes.
inline void write_npy(std::filesystem::path const& path, NpyView const& array) {
  detail::check_npy_view(array, path.string());
  AtomicFile file(path);
  file.write(detail::format_npy_header(array.dtype, array.shape));
  file.write(array.bytes);
  file.commit();
}

}  // namespace gsp::io
