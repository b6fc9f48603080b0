#pragma once
#include <array>
#include <deque>
#include <functional>
#include <gsp/core/detail/compiled.hpp>
#include <gsp/io/detail/file_beside.hpp>
#include <gsp/io/detail/json_text.hpp>
#include <gsp/io/detail/shared_bounds.hpp>
#include <gsp/io/detail/sog_tables.hpp>
#include <gsp/io/detail/webp.hpp>
#include <gsp/io/detail/zip.hpp>
#include <gsp/io/file.hpp>
#include <gsp/io/sog.hpp>
#include <map>
#include <optional>

namespace gsp::io {

namespace detail {

/// Whether a text can be the meta.json of SOG.
inline bool is_sog_meta(Bytes bytes) {
  auto const text = as_text(bytes);
  return starts_with(bytes, "{") && text.find("\"means\"") != text.npos && text.find("\"quats\"") != text.npos;
}

/// meta.json, and the pictures that it names.
class SogFile {
 public:
  SogFile(Bytes bytes, std::string name, std::filesystem::path folder) : name_(std::move(name)), folder_(std::move(folder)) {
    std::vector<std::byte> storage;
    if (starts_with(bytes, "PK")) {
      std::string const label = "meta.json";
      for (auto& entry : zip_entries(bytes, name_, "a .sog file", "write it stored or deflated"))
        if (!entries_.emplace(entry.label, entry).second) fail(entry.place, "", "appears twice; write the file again");
      for (auto const& [path, entry] : entries_) {
        if (path != label && !path.ends_with("/" + label)) continue;
        if (meta_) fail(entry.place, "", "is a second meta.json beside " + in_quotes(meta_->label) + "; take them apart into two files");
        meta_ = &entry;
      }
      if (!meta_) fail(name_, "", "holds no meta.json; this is no .sog file");
      inside_ = meta_->label.substr(0, meta_->label.size() - label.size());
      bytes = zip_content(*meta_, storage);
    }
    root_ = parse_json(as_text(bytes), name_);
    if (!root_.is_object()) fail(name_, "", "its meta.json is no object; this is not SOG");
  }
  std::string const& name() const { return name_; }
  Json const& root() const { return root_; }
  Json const& object(char const* key) const {
    auto const at = root_.find(key);
    if (at == root_.end() || !at->is_object()) fail(name_, key, "is missing from meta.json, or no object; write the file again");
    return *at;
  }
  /// Numbers of a list: `least` to `most` of them, finite.
  std::vector<double> numbers(char const* part, char const* key, std::size_t least, std::size_t most) const {
    Json const& object = this->object(part);
    auto const at = object.find(key);
    std::vector<double> out;
    bool good = at != object.end() && at->is_array() && at->size() >= least && at->size() <= most;
    for (std::size_t k = 0; good && k < at->size(); ++k) {
      good = (*at)[k].is_number();
      if (good) out.push_back((*at)[k].get<double>());
      good = good && std::isfinite(out.back());
    }
    if (!good)
      fail(name_, part,
           "\"" + std::string(key) + "\" must be " +
               (least == most ? std::to_string(least) : std::to_string(least) + " to " + std::to_string(most)) +
               " finite numbers; write the file again");
    return out;
  }
  double number(char const* part, char const* key) const {
    Json const& object = this->object(part);
    auto const at = object.find(key);
    if (at == object.end() || !at->is_number() || !std::isfinite(at->get<double>()))
      fail(name_, part, "\"" + std::string(key) + "\" must be a finite number; write the file again");
    return at->get<double>();
  }
  std::uint64_t count(Json const& object, char const* part, char const* key) const {
    auto const at = object.find(key);
    if (at == object.end() || !at->is_number_unsigned())
      fail(name_, part, "\"" + std::string(key) + "\" must be a whole number, not negative; write the file again");
    return at->get<std::uint64_t>();
  }
  /// Takes the bytes of all pictures; returns how many they are, as they are packed.
  std::uint64_t fetch(std::vector<std::pair<char const*, std::size_t>> const& parts) {
    std::uint64_t size = 0;
    for (auto const& [part, files] : parts) {
      auto const at = object(part).find("files");
      if (at == object(part).end() || !at->is_array() || at->size() != files)
        fail(name_, part, "\"files\" must name " + std::to_string(files) + " pictures; write the file again");
      for (auto const& item : *at) {
        if (!item.is_string()) fail(name_, part, "\"files\" must hold names of pictures; write the file again");
        auto& list = pictures_[part];
        list.push_back({item.get<std::string>(), {}, {}});
        auto& picture = list.back();
        if (meta_) {
          auto const entry = entries_.find(inside_ + picture.file);
          if (entry == entries_.end()) fail(name_, part, "the picture " + in_quotes(picture.file) + " is not in the file; write it again");
          picture.bytes = zip_content(entry->second, picture.storage);
          size += entry->second.packed.size();
        } else {
          picture.storage = read_file(file_beside(folder_, picture.file, name_, part));
          picture.bytes = picture.storage;
          size += picture.bytes.size();
        }
      }
    }
    return size;
  }
  template <class Fits>
  Pixels picture(char const* part, std::size_t k, Fits const& fits) const {
    auto const& p = pictures_.at(part)[k];
    std::string const place = name_ + "[" + in_quotes(p.file) + "]";
    return parse_webp(p.bytes, place, [&](std::uint64_t width, std::uint64_t height) {
      if (auto const problem = fits(width, height); !problem.empty())
        fail(place, "",
             "is a picture of " + std::to_string(width) + " x " + std::to_string(height) + " pixels, " + problem + "; the file is damaged");
    });
  }
  /// A picture with a pixel for each of n Gaussians; writers round up its sides.
  Pixels pixels(char const* part, std::size_t k, std::uint64_t n) const {
    return picture(part, k, [&](std::uint64_t width, std::uint64_t height) -> std::string {
      if (width * height < n) return "too small for " + std::to_string(n) + " Gaussians";
      if (width * height > 2 * n + 65536) return "far too large for " + std::to_string(n) + " Gaussians";
      return "";
    });
  }

 private:
  struct Picture {
    std::string file;
    std::vector<std::byte> storage;
    Bytes bytes;
  };
  std::string name_, inside_;  // inside_: the folder of meta.json in the bundle
  std::filesystem::path folder_;
  std::map<std::string, ZipEntry> entries_;
  ZipEntry const* meta_ = nullptr;
  Json root_;
  std::map<std::string, std::vector<Picture>> pictures_;
};

/// Pixel (alpha a) 252-255: which of w x y z is largest; r g b: the others in order, v = (2 b / 255 - 1) / sqrt 2.
inline void unpack_sog_rotation(std::uint8_t const* pixel, float* q) {
  double sum = 0;
  std::size_t const largest = pixel[3] - 252u;
  for (std::size_t k = 0, from = 0; k < 4; ++k) {
    if (k == largest) continue;
    double const v = (pixel[from++] / 127.5 - 1) / std::sqrt(2.0);
    q[k] = static_cast<float>(v);
    sum += v * v;
  }
  q[largest] = static_cast<float>(std::sqrt(std::max(0., 1 - sum)));
}

}  // namespace detail

GSP_INLINE SplatSet parse_sog(Bytes bytes, std::string const& name, std::filesystem::path const& folder) {
  using namespace detail;
  SogFile file(bytes, name, folder);
  Json const& root = file.root();
  bool const first_version = !root.contains("version");
  if (auto const version = first_version ? 1 : file.count(root, "meta.json", "version"); !first_version && version != 2)
    fail(name, "meta.json",
         "is SOG version " + std::to_string(version) + ", and 1 (without the key \"version\") and 2 are read; write it as version 2");
  std::uint64_t n = 0;
  if (first_version) {
    auto const shape = file.numbers("means", "shape", 1, 4);
    if (!(shape[0] >= 0 && shape[0] <= 1e9 && shape[0] == std::floor(shape[0])))
      fail(name, "means", "\"shape\" must begin with the number of Gaussians; write the file again");
    n = static_cast<std::uint64_t>(shape[0]);
  } else {
    n = file.count(root, "meta.json", "count");
  }
  if (n == 0) fail(name, "", "holds no Gaussians; name a file that has some");
  bool const has_sh = root.contains("shN");
  std::vector<std::pair<char const*, std::size_t>> parts{{"means", 2}, {"quats", 1}, {"scales", 1}, {"sh0", 1}};
  if (has_sh) parts.emplace_back("shN", 2);
  auto const size = file.fetch(parts);
  if (n > 64 * size)  // lossless WebP can pack a plain picture of any size into some bytes
    fail(name, "",
         "announces " + std::to_string(n) + " Gaussians in pictures of " + std::to_string(size) +
             " bytes, which no real ones fit in; the count is wrong");

  int degree = 0;
  std::uint64_t palette = 0;
  Pixels centroids, labels;
  if (has_sh) {
    std::uint64_t width = 0;
    centroids = file.picture("shN", 0, [&](std::uint64_t w, std::uint64_t h) -> std::string {
      width = w;
      return h > 1024 || (w != 192 && w != 512 && w != 960) ? "where SH of degree 1, 2 or 3 are 192, 512 or 960 wide and at most 1024 high"
                                                            : "";
    });
    degree = width == 192 ? 1 : width == 512 ? 2 : 3;
    palette = 64 * centroids.height;
    if (!first_version) {
      palette = std::min(palette, file.count(file.object("shN"), "shN", "count"));
      if (auto const bands = file.count(file.object("shN"), "shN", "bands"); bands != static_cast<std::uint64_t>(degree))
        fail(name, "shN", "has " + std::to_string(bands) + " bands, and a picture for " + std::to_string(degree) + "; the file is damaged");
    }
    labels = file.pixels("shN", 1, n);
  }
  std::size_t const coefficients = static_cast<std::size_t>((degree + 1) * (degree + 1) - 1);
  auto const low = file.numbers("means", "mins", 3, 3), high = file.numbers("means", "maxs", 3, 3);
  Pixels lower = file.pixels("means", 0, n), upper = file.pixels("means", 1, n);  // a count that these hold may have its memory
  SplatSet set = make_splat_set(n, degree);
  std::size_t const terms = set.sh_terms();

  {
    for (std::size_t i = 0; i < n; ++i)
      for (std::size_t k = 0; k < 3; ++k) {
        double const t = (lower.rgba[4 * i + k] + 256 * upper.rgba[4 * i + k]) / 65535.0, v = low[k] + (high[k] - low[k]) * t;
        set.positions[3 * i + k] = static_cast<float>(symexp(v));
      }
    lower = upper = {};
  }
  {
    Pixels const quats = file.pixels("quats", 0, n);
    for (std::size_t i = 0; i < n; ++i) {
      if (quats.rgba[4 * i + 3] < 252)
        fail(name, "Gaussian " + std::to_string(i),
             "its rotation has the mark " + std::to_string(quats.rgba[4 * i + 3]) +
                 " where 252 to 255 say which component is left out; the file is damaged");
      unpack_sog_rotation(&quats.rgba[4 * i], &set.quats[4 * i]);
    }
  }
  // A byte as a number: of a table (version 2), or between bounds, those of component k (version 1).
  struct Decode {
    std::vector<double> table, low, high;
    double operator()(std::uint8_t b, std::size_t k) const { return table.empty() ? low[k] + (high[k] - low[k]) * (b / 255.0) : table[b]; }
  };
  auto const decode = [&](char const* part, std::size_t bounds) {
    Decode d;
    if (first_version) {
      d.low = file.numbers(part, "mins", bounds, bounds);
      d.high = file.numbers(part, "maxs", bounds, bounds);
    } else {
      d.table = file.numbers(part, "codebook", 256, 256);
    }
    return d;
  };
  {
    auto const value = decode("scales", 3);
    Pixels const scales = file.pixels("scales", 0, n);
    for (std::size_t i = 0; i < n; ++i)
      for (std::size_t k = 0; k < 3; ++k) set.scales[3 * i + k] = static_cast<float>(std::exp(value(scales.rgba[4 * i + k], k)));
  }
  {
    auto const value = decode("sh0", 4);
    Pixels const sh0 = file.pixels("sh0", 0, n);
    for (std::size_t i = 0; i < n; ++i) {
      for (std::size_t k = 0; k < 3; ++k) set.sh[3 * terms * i + k] = static_cast<float>(value(sh0.rgba[4 * i + k], k));
      std::uint8_t const a = sh0.rgba[4 * i + 3];
      set.opacities[i] = first_version ? sigmoid(value(a, 3)) : a / 255.f;
    }
  }
  if (has_sh) {
    Decode value;
    if (first_version) {
      value.low.assign(1, file.number("shN", "mins"));
      value.high.assign(1, file.number("shN", "maxs"));
    } else {
      value = decode("shN", 1);
    }
    for (std::size_t i = 0; i < n; ++i) {
      std::uint64_t const label = labels.rgba[4 * i] + 256u * labels.rgba[4 * i + 1];
      if (label >= palette)
        fail(name, "Gaussian " + std::to_string(i),
             "its SH have the number " + std::to_string(label) + ", and there are " + std::to_string(palette) + "; the file is damaged");
      std::uint8_t const* const from = &centroids.rgba[4 * (label / 64 * centroids.width + label % 64 * coefficients)];
      for (std::size_t j = 0; j < coefficients; ++j)
        for (std::size_t k = 0; k < 3; ++k) set.sh[3 * (terms * i + 1 + j) + k] = static_cast<float>(value(from[4 * j + k], 0));
    }
  }
  auto const model = root.find("model"), antialias = root.find("antialias");
  set.antialiased = (model != root.end() && *model == "antialiased") || (antialias != root.end() && *antialias == true);
  if (set.antialiased) set.notes.push_back(name + ": its flag 'antialiased' is kept, but has no effect on pictures");
  if (model != root.end() && *model == "2dgs") set.notes.push_back(name + ": its Gaussians are flat ('2dgs'), and drawn as others are");
  finish(set, name);
  return set;
}

GSP_INLINE SplatSet read_sog(std::filesystem::path const& path) {
  return parse_sog(read_file(path), path.string(), path.has_parent_path() ? path.parent_path() : ".");
}

namespace detail {

struct SogFiles {
  std::vector<std::pair<std::string, std::vector<std::byte>>> files;  // pictures, then meta.json
};

inline SogFiles sog_files(SplatSet const& set) {
  std::string const name = "gsp::io::format_sog";
  validate(set, name);
  std::size_t const n = set.size(), terms = set.sh_terms(), coefficients = terms - 1;
  auto const rounded_up = [](double x) { return static_cast<std::uint64_t>(std::ceil(x / 4)) * 4; };
  std::uint64_t const width = rounded_up(std::sqrt(double(n))), height = rounded_up(std::ceil(double(n) / double(width)));
  if (width > 16383 || height > 16383)
    fail(name, "", std::to_string(n) + " Gaussians pass the largest WebP picture (16383 x 16383); write fewer to a file");
  auto const blank = [&] { return Pixels{width, height, std::vector<std::uint8_t>(4 * width * height)}; };
  SogFiles out;
  auto const add = [&](std::string const& file, Pixels const& pixels) { out.files.emplace_back(file, format_webp(pixels, name)); };
  auto const byte = [](double v) { return static_cast<std::uint8_t>(std::clamp(std::round(v), 0., 255.)); };
  nlohmann::ordered_json meta{{"version", 2}, {"asset", {{"generator", "gsp"}}}, {"count", n}};
  if (set.antialiased) {
    meta["antialias"] = true;
    meta["model"] = "antialiased";
  }

  {
    std::array<double, 3> low, high;
    std::array<SharedBounds, 3> const bounds{sog_bounds(set, 0), sog_bounds(set, 1), sog_bounds(set, 2)};
    for (std::size_t k = 0; k < 3; ++k) {
      low[k] = bounds[k].low;
      high[k] = bounds[k].high;
    }
    Pixels lower = blank(), upper = blank();
    for (std::size_t i = 0; i < n; ++i) {
      for (std::size_t k = 0; k < 3; ++k) {
        auto const v = bounds[k].pack(symlog(set.positions[3 * i + k]));
        lower.rgba[4 * i + k] = static_cast<std::uint8_t>(v & 255);
        upper.rgba[4 * i + k] = static_cast<std::uint8_t>(v >> 8);
      }
      lower.rgba[4 * i + 3] = upper.rgba[4 * i + 3] = 255;
    }
    add("means_l.webp", lower);
    add("means_u.webp", upper);
    meta["means"] = {{"mins", low}, {"maxs", high}, {"files", {"means_l.webp", "means_u.webp"}}};
  }
  {
    std::vector<float> logs(3 * n);
    for (std::size_t j = 0; j < 3 * n; ++j)
      logs[j] = static_cast<float>(std::log(std::max(double(set.scales[j]), std::exp(detail::packed_least_log_scale))));
    auto const codebook = make_codebook(logs);
    Pixels pixels = blank();
    for (std::size_t i = 0; i < n; ++i) {
      for (std::size_t k = 0; k < 3; ++k) pixels.rgba[4 * i + k] = nearest_code(codebook, logs[3 * i + k]);
      pixels.rgba[4 * i + 3] = 255;
    }
    add("scales.webp", pixels);
    meta["scales"] = {{"codebook", codebook}, {"files", {"scales.webp"}}};
  }
  {
    Pixels pixels = blank();
    for (std::size_t i = 0; i < n; ++i) {
      float const* const q = &set.quats[4 * i];
      std::size_t largest = 0;
      for (std::size_t k = 1; k < 4; ++k)
        if (std::abs(q[k]) > std::abs(q[largest])) largest = k;
      double const sign = q[largest] < 0 ? -1 : 1;
      for (std::size_t k = 0, to = 0; k < 4; ++k)
        if (k != largest) pixels.rgba[4 * i + to++] = byte(127.5 * (1 + sign * std::sqrt(2.0) * q[k]));
      pixels.rgba[4 * i + 3] = static_cast<std::uint8_t>(252 + largest);
    }
    add("quats.webp", pixels);
    meta["quats"] = {{"files", {"quats.webp"}}};
  }
  {
    std::vector<float> dc(3 * n);
    for (std::size_t i = 0; i < n; ++i) std::copy_n(&set.sh[3 * terms * i], 3, &dc[3 * i]);
    auto const codebook = make_codebook(dc);
    Pixels pixels = blank();
    for (std::size_t i = 0; i < n; ++i) {
      for (std::size_t k = 0; k < 3; ++k) pixels.rgba[4 * i + k] = nearest_code(codebook, dc[3 * i + k]);
      pixels.rgba[4 * i + 3] = byte(255.0 * set.opacities[i]);
    }
    add("sh0.webp", pixels);
    meta["sh0"] = {{"codebook", codebook}, {"files", {"sh0.webp"}}};
  }
  if (coefficients > 0) {
    std::vector<float> means;
    auto const label = make_groups(&set.sh[3], n, 3 * terms, 3 * coefficients, 65536, means);
    std::size_t const groups = means.size() / (3 * coefficients);
    auto const codebook = make_codebook(means);
    Pixels centroids{64 * coefficients, (groups + 63) / 64, {}}, labels = blank();
    centroids.rgba.resize(4 * centroids.count());
    for (std::size_t j = 0; j < groups * coefficients; ++j) {  // rows of 64 groups follow each other without a gap
      for (std::size_t k = 0; k < 3; ++k) centroids.rgba[4 * j + k] = nearest_code(codebook, means[3 * j + k]);
      centroids.rgba[4 * j + 3] = 255;
    }
    for (std::size_t i = 0; i < n; ++i) {
      labels.rgba[4 * i] = static_cast<std::uint8_t>(label[i] & 255);
      labels.rgba[4 * i + 1] = static_cast<std::uint8_t>(label[i] >> 8);
      labels.rgba[4 * i + 3] = 255;
    }
    add("shN_centroids.webp", centroids);
    add("shN_labels.webp", labels);
    meta["shN"] = {
        {"count", groups}, {"bands", set.sh_degree}, {"codebook", codebook}, {"files", {"shN_centroids.webp", "shN_labels.webp"}}};
  }
  auto const text = meta.dump();
  auto const b = as_bytes(text);
  out.files.emplace_back("meta.json", std::vector<std::byte>(b.begin(), b.end()));
  return out;
}

}  // namespace detail

GSP_INLINE std::vector<std::byte> format_sog(SplatSet const& set) {
  using namespace detail;
  auto const parts = sog_files(set);
  std::vector<std::byte> out;
  std::vector<ZipRecord> records;
  auto const put = [&](Bytes bytes) { out.insert(out.end(), bytes.begin(), bytes.end()); };
  for (auto const& [file, bytes] : parts.files) {
    records.push_back({file, crc32(bytes), bytes.size(), bytes.size(), out.size(), false});
    put(as_bytes(zip_local(records.back())));
    put(bytes);
  }
  if (out.size() > 0xffff0000)
    fail("gsp::io::format_sog", "", "the file would pass 4 GiB, the most of a zip; write fewer Gaussians to a file");
  put(as_bytes(zip_tail(records, out.size())));
  return out;
}

GSP_INLINE void write_sog(std::filesystem::path const& path, SplatSet const& set) {
  if (path.extension() != ".json") return write_file(path, format_sog(set));
  auto const parts = detail::sog_files(set);
  if (path.filename() != "meta.json")  // the pictures have fixed names
    detail::fail(path.string(), "", "must be called meta.json: two others in a folder would share their pictures");
  std::deque<AtomicFile> files;                                        // all are written before one gets its name; meta.json is the last
  auto const folder = detail::output_target(path).path.parent_path();  // behind symbolic links, as meta.json is
  for (auto const& [file, bytes] : parts.files) files.emplace_back(folder / file).write(bytes);
  for (auto& file : files) file.commit();
}

}  // namespace gsp::io
