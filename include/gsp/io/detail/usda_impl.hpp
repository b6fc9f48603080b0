#pragma once
#include <charconv>
#include <gsp/core/detail/compiled.hpp>
#include <gsp/io/detail/half_turn.hpp>
#include <gsp/io/detail/usda_layer.hpp>
#include <gsp/io/file.hpp>
#include <gsp/io/usda.hpp>

namespace gsp::io {

namespace detail {

/// The Gaussians of a prim, in its own frame. As the schema has it: float arrays before those of halves, longer ones are cut, without
/// orientations the identity, without scales and opacities 1, without coefficients grey.
inline SplatSet usda_prim_splats(UsdaPrim& prim, std::string const& name) {
  std::string const place = prim.place();
  std::vector<std::string> notes;
  for (auto const& [attribute, line] : prim.elsewhere)
    if (!attribute.starts_with("xformOp")) expect_usda_value(prim, attribute, name);
  auto const array = [&](std::string const& attribute) -> std::vector<float>* {
    for (auto const& label : {attribute, attribute + "h"})
      if (auto const at = prim.arrays.find(label); at != prim.arrays.end()) return &at->second;
    return nullptr;
  };
  auto const* const positions = array("positions");
  if (!positions || positions->empty()) fail(name, place, "has no positions; flatten the file (usdcat --flatten) or export it again");
  std::size_t const n = positions->size() / 3;
  int degree = 0;
  auto const* const sh = array("radiance:sphericalHarmonicsCoefficients");
  if (sh) {
    degree = 3;  // what the schema says
    if (auto const at = prim.ops.find("radiance:sphericalHarmonicsDegree"); at != prim.ops.end()) {
      auto const& v = at->second;
      if (v.size() != 1 || !(v[0] >= 0 && v[0] <= 3 && v[0] == std::floor(v[0])))
        fail(name, place, "radiance:sphericalHarmonicsDegree must be 0, 1, 2 or 3; save it with a lower degree");
      degree = static_cast<int>(v[0]);
    }
  }
  std::size_t const terms = static_cast<std::size_t>((degree + 1) * (degree + 1));
  auto const hold = [&](std::vector<float> const* from, std::size_t width, char const* attribute, char const* instead) {
    if (!from) notes.push_back(name + ": " + place + ": has no " + attribute + ", and gets " + instead);
    if (from && from->size() < n * width)
      fail(name, place,
           std::string(attribute) + " has " + std::to_string(from->size() / width) + " elements for " + std::to_string(n) +
               " positions; the file is damaged");
    if (from && from->size() > n * width) notes.push_back(name + ": " + place + ": " + attribute + " is longer than positions, and is cut");
  };
  auto const *const quats = array("orientations"), *const scales = array("scales"), *const opacities = array("opacities");
  hold(quats, 4, "orientations", "the identity");
  hold(scales, 3, "scales", "1");
  hold(opacities, 1, "opacities", "1");
  if (!sh) notes.push_back(name + ": " + place + ": has no coefficients of colour, and is grey");
  if (sh && sh->size() < 3 * n * terms)
    fail(name, place,
         "radiance:sphericalHarmonicsCoefficients has " + std::to_string(sh->size() / 3) + " elements where SH degree " +
             std::to_string(degree) + " of " + std::to_string(n) + " positions needs " + std::to_string(n * terms) +
             "; the file is damaged");
  if (sh && sh->size() > 3 * n * terms)
    notes.push_back(name + ": " + place + ": has more coefficients of colour than positions, and they are cut");

  SplatSet set = make_splat_set(n, degree);
  std::copy_n(positions->begin(), 3 * n, set.positions.begin());
  if (quats) std::copy_n(quats->begin(), 4 * n, set.quats.begin());
  if (scales)
    std::copy_n(scales->begin(), 3 * n, set.scales.begin());
  else
    std::fill(set.scales.begin(), set.scales.end(), 1.f);
  if (opacities)
    std::copy_n(opacities->begin(), n, set.opacities.begin());
  else
    std::fill(set.opacities.begin(), set.opacities.end(), 1.f);
  if (sh) std::copy_n(sh->begin(), 3 * n * terms, set.sh.begin());
  set.notes = std::move(notes);
  prim.arrays.clear();
  finish(set, name + ": " + place);
  return set;
}

}  // namespace detail

GSP_INLINE SplatSet parse_usda(Bytes bytes, std::string const& name) {
  using namespace detail;
  UsdaLayer layer = read_usda_layer(bytes, name);
  SplatSet set;
  auto const parent_of = [&](UsdaPrim const& prim) {
    return prim.parent < 0 ? nullptr : &layer.prims[static_cast<std::size_t>(prim.parent)];
  };
  for (auto& prim : layer.prims)
    if (prim.shown && prim.type == usda_gaussians)
      for (UsdaPrim* p = &prim; p && !p->needed; p = parent_of(*p)) p->needed = true;
  std::vector<AffineMap> maps;
  for (auto& prim : layer.prims) {
    AffineMap map = prim.parent < 0 ? AffineMap{} : maps[static_cast<std::size_t>(prim.parent)];
    if (prim.needed) {
      expect_usda_value(prim, "xformOpOrder", name);
      for (auto const& op : prim.op_order) {
        if (op == "!resetXformStack!")
          map = {};
        else
          map = map * usda_op(prim, op, name);
      }
    }
    maps.push_back(map);
    if (!prim.shown || prim.type != usda_gaussians) continue;
    auto part = usda_prim_splats(prim, name);
    if (!map.identity()) {
      auto const pose = rigid(map);
      if (!pose)
        fail(name, prim.place(),
             "it or a prim above it scales or shears its axes differently, which turns no Gaussian into a Gaussian with the same colours; "
             "apply it to the data");
      transform(part, *pose);
    }
    append(set, part);
  }
  if (set.size() == 0)
    fail(name, "",
         "holds no prim of type " + std::string(usda_gaussians) +
             " that is defined and active; flatten the file (usdcat --flatten) or export it again");
  if (layer.up_axis == "Y")
    half_turn(set, 0);
  else
    transform(set, {{0, 0, 0}, {1, 1, 0, 0}, 1});  // (x, y, z) -> (x, -z, y)
  if (layer.has_unit && layer.meters_per_unit != 1)
    set.notes.push_back(name + ": its unit of length is " + std::to_string(layer.meters_per_unit) +
                        " m (metersPerUnit), and numbers are taken as they stand");
  if (layer.other_files) set.notes.push_back(name + ": what it takes from other files or prims (references, payloads, layers) is left out");
  if (layer.variants) set.notes.push_back(name + ": its variants are left out");
  finish(set, name);
  return set;
}

GSP_INLINE SplatSet read_usda(std::filesystem::path const& path) { return parse_usda(read_file(path), path.string()); }

GSP_INLINE std::string format_usda(SplatSet const& original) {
  validate(original, "gsp::io::format_usda");
  SplatSet set = original;
  detail::half_turn(set, 0);
  std::size_t const n = set.size();
  std::string out = "#usda 1.0\n(\n    defaultPrim = \"Gaussians\"\n    metersPerUnit = 1\n    upAxis = \"Y\"\n)\n\n";
  out += "def " + std::string(detail::usda_gaussians) + " \"Gaussians\"\n{\n";
  auto const number = [&](float v) {
    std::array<char, 32> text;
    auto const end = std::to_chars(text.data(), text.data() + text.size(), v).ptr;
    out.append(text.data(), end);
  };
  auto const array = [&](char const* label, std::vector<float> const& values, std::size_t width) {
    out += "    " + std::string(label) + " = [";
    for (std::size_t i = 0; i < values.size(); ++i) {
      if (i > 0) out += ", ";
      if (width > 1 && i % width == 0) out += '(';
      number(values[i]);
      if (width > 1 && i % width == width - 1) out += ')';
    }
    out += "]\n";
  };
  // Three standard deviations along the longest axis, round each Gaussian.
  std::vector<float> extent(6);
  for (std::size_t k = 0; k < 3; ++k)
    for (std::size_t i = 0; i < n; ++i) {
      float const reach = 3 * *std::max_element(&set.scales[3 * i], &set.scales[3 * i] + 3);
      extent[k] = i == 0 ? set.positions[k] - reach : std::min(extent[k], set.positions[3 * i + k] - reach);
      extent[3 + k] = i == 0 ? set.positions[k] + reach : std::max(extent[3 + k], set.positions[3 * i + k] + reach);
    }
  bool finite = true;
  for (float v : extent) finite = finite && std::isfinite(v);
  if (finite) array("float3[] extent", extent, 3);
  array("point3f[] positions", set.positions, 3);
  array("quatf[] orientations", set.quats, 4);
  array("float3[] scales", set.scales, 3);
  array("float[] opacities", set.opacities, 1);
  out += "    uniform int radiance:sphericalHarmonicsDegree = " + std::to_string(set.sh_degree) + "\n";
  array("float3[] radiance:sphericalHarmonicsCoefficients", set.sh, 3);
  return out + "}\n";
}

GSP_INLINE void write_usda(std::filesystem::path const& path, SplatSet const& set) { write_file(path, detail::as_bytes(format_usda(set))); }

}  // namespace gsp::io
