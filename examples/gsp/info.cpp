// gsp info: what a file holds, and what of it is not taken as it stands.
#include <cstdio>
#include <filesystem>
#include <gsp/geometry/shapes.hpp>
#include <gsp/io/detail/mjcf_page.hpp>
#include <gsp/io/detail/ply_table.hpp>
#include <gsp/io/npz.hpp>
#include <gsp/io/png.hpp>
#include <gsp/io/splats.hpp>
#include <gsp/model/archetypes.hpp>
#include <gsp/model/model_refusals.hpp>
#include <gsp/runtime/stepper.hpp>
#include <nlohmann/json.hpp>

#include "commands.hpp"
#include "files.hpp"
#include "run.hpp"

namespace gsp_cli {
namespace {

void row(char const* name, std::string const& value) { std::printf("  %-14s%s\n", name, value.c_str()); }
std::string number(double x) {
  char text[32];
  std::snprintf(text, sizeof text, "%.6g", x);
  return text;
}
/// "3 box, 2 sphere"
std::string tally(std::map<std::string, int> const& counts) {
  std::string out;
  for (auto const& [name, count] : counts) out += (out.empty() ? "" : ", ") + std::to_string(count) + " " + name;
  return out;
}

void report(std::vector<gsp::ReportLine> lines) {
  std::stable_sort(lines.begin(), lines.end(), [](auto const& a, auto const& b) { return a.kind < b.kind; });
  if (lines.empty()) return row("load report", "all of the file is taken as it stands");
  std::map<gsp::ReportLine::Kind, int> counts;
  for (auto const& l : lines) counts[l.kind] += l.count;
  std::string sum;
  for (auto const& [kind, count] : counts) sum += (sum.empty() ? "" : ", ") + std::to_string(count) + " " + gsp::text(kind);
  row("load report", sum);
  for (auto const& l : lines) {
    std::string const place = l.file + (l.line > 0 ? ":" + std::to_string(l.line) : "");
    std::printf("    %-13s %s: %s%s\n", gsp::text(l.kind), place.c_str(), l.text.c_str(),
                l.count > 1 ? (" (" + std::to_string(l.count) + " times)").c_str() : "");
  }
}

/// What `gsp sim` would say to the file, by its own functions.
struct Verdict {
  std::vector<std::string> flags;  // it needs these
  std::string refusal;             // the first reason without them, or, where none help, with them
  bool taken = false;
};

Verdict judge(std::string const& path, Arguments const& arguments, gsp::Description const* as_it_is) {
  // The first reason to refuse the file; empty: it is taken.
  auto const refusal = [&](bool skip_visuals) -> std::string {
    try {
      auto const compiled = compile_model(as_it_is && !skip_visuals ? *as_it_is : describe_model(path, arguments, false, skip_visuals));
      auto const reasons = gsp::model_refusals(compiled);
      return reasons.empty() ? "" : path + ": " + reasons.front();
    } catch (Error const& error) { return error.what(); }
  };
  Verdict v;
  v.refusal = refusal(false);
  v.taken = v.refusal.empty();
  if (v.taken) return v;
  auto const without_visuals = refusal(true);
  v.taken = without_visuals.empty();
  if (v.taken)
    v.flags.push_back("--skip-visuals");
  else
    v.refusal = without_visuals;
  return v;
}

/// In one line.
std::string text_of(Verdict const& v) {
  if (!v.taken) return "gsp sim refuses it: " + v.refusal;
  std::string flags;
  for (auto const& f : v.flags) flags += " " + f;
  return (flags.empty() ? "gsp sim takes it as it is" : "gsp sim takes it with" + flags) + (flags.empty() ? "" : "; without: " + v.refusal);
}

/// One JSON object: sizes, the report and the verdict.
void json(std::string const& path, gsp::CompiledModel const& m, Verdict const& verdict) {
  nlohmann::ordered_json out{{"file", path},     {"model", m.name},      {"nq", m.nq},           {"nv", m.nv},
                             {"nbody", m.nbody}, {"ngeom", m.ngeom},     {"nu", m.nu},           {"neq", m.neq},
                             {"na", m.na},       {"ntendon", m.ntendon}, {"nsensor", m.nsensor}, {"nkey", m.keyframes.size()},
                             {"nmesh", m.nmesh}, {"nhfield", m.nhfield}, {"nmocap", m.nmocap},   {"njnt", m.njnt},
                             {"nsite", m.nsite}, {"ncam", m.ncam},       {"ntree", m.ntree},     {"npair", m.named_pairs.size()}};
  out["geoms"] = m.geom_name;
  out["geom_bodies"] = m.geom_body;
  out["bodies"] = m.body_name;
  out["sites"] = m.site_name;
  out["report"] = report_json(m.report);
  out["taken"] = verdict.taken;
  out["flags"] = verdict.flags;
  out["verdict"] = text_of(verdict);
  std::puts(out.dump(2, ' ', false, nlohmann::json::error_handler_t::replace).c_str());
}

void model(std::string const& path, Arguments const& arguments) {
  auto const description = describe_model(path, arguments, true);
  auto const m = compile_model(description);
  bool const listed = std::any_of(m.report.begin(), m.report.end(), [](auto const& l) { return l.kind == gsp::ReportLine::Kind::refused; });
  bool const as_it_is = !listed && !arguments.has("--skip-visuals");  // it need not be read again
  auto const verdict = judge(path, arguments, as_it_is ? &description : nullptr);
  if (arguments.has("--json")) return json(path, m, verdict);
  char const* const joint_names[] = {"free", "ball", "slide", "hinge"};
  char const* const integrators[] = {"Euler", "RK4", "implicit", "implicitfast"};
  std::map<std::string, int> joints, geoms;
  for (int t : m.jnt_type) ++joints[joint_names[t]];
  int colliding = 0;
  for (int g = 0; g < m.ngeom; ++g) {
    ++geoms[gsp::shape_name(gsp::ShapeType{m.geom_type[static_cast<std::size_t>(g)]})];
    colliding += m.geom_contype[static_cast<std::size_t>(g)] || m.geom_conaffinity[static_cast<std::size_t>(g)];
  }
  double mass = 0;
  for (double b : m.body_mass) mass += b;
  std::printf("%s: %s model %s\n", path.c_str(), path.ends_with(".urdf") ? "URDF" : "MJCF", in_quotes(m.name).c_str());
  row("bodies", std::to_string(m.nbody - 1) + " and the world, " + number(mass) + " kg in all");
  row("joints", std::to_string(m.njnt) + (m.njnt ? " (" + tally(joints) + ")" : "") + "; nq " + std::to_string(m.nq) + ", nv " +
                    std::to_string(m.nv));
  row("trees",
      m.ntree == 0 ? "none: nothing moves" : std::to_string(m.ntree) + ", of " + std::to_string(gsp::find_archetypes(m).size()) + " kinds");
  row("geoms", std::to_string(m.ngeom) + (m.ngeom ? " (" + tally(geoms) + ")" : "") + "; " + std::to_string(colliding) + " collide, " +
                   std::to_string(m.pair_count()) + (m.pairs_searched ? " pairs are listed, others searched for" : " pairs may touch") +
                   (m.named_pairs.empty() ? "" : ", " + std::to_string(m.named_pairs.size()) + " of them named"));
  row("actuators", std::to_string(m.nu) + "; tendons " + std::to_string(m.ntendon) + ", equality constraints " + std::to_string(m.neq) +
                       ", sensors " + std::to_string(m.nsensor));
  row("places", std::to_string(m.nsite) + " sites, " + std::to_string(m.ncam) + " cameras, " + std::to_string(m.nmocap) +
                    " mocap bodies; " + std::to_string(m.nmesh) + " meshes, " + std::to_string(m.nhfield) + " height fields");
  std::string keys;
  for (std::size_t k = 0; k < m.keyframes.size(); ++k)
    keys += (k ? ", " : "") + std::to_string(k) + (m.keyframes[k].name.empty() ? "" : " " + in_quotes(m.keyframes[k].name));
  row("keyframes", keys.empty() ? "none" : keys);
  auto const& o = m.option;
  row("option", "timestep " + number(o.timestep) + " s, gravity " + number(o.gravity[0]) + " " + number(o.gravity[1]) + " " +
                    number(o.gravity[2]) + ", integrator " + integrators[int(o.integrator)] + ", cone " +
                    (o.cone == gsp::FrictionCone::elliptic ? "elliptic" : "pyramidal") + ", iterations " + std::to_string(o.iterations));
  report(m.report);
  row("verdict", text_of(verdict));
}

/// A PLY of points that are no Gaussians, such as `gsp scan --ply` writes.
bool is_cloud(gsp::io::Bytes bytes, std::string const& path) {
  if (!gsp::io::detail::as_text(bytes).starts_with("ply")) return false;
  gsp::io::detail::PlyTable header{};
  header.name = path;
  gsp::io::detail::parse_ply_header(bytes, header);
  auto const* const vertex = header.find("vertex");
  auto const has = [&](char const* property) { return vertex && header.find(*vertex, property); };
  return has("x") && has("y") && has("z") && !has("opacity") && !has("scale_0") && !has("rot_0") && !has("f_dc_0");
}
void cloud(gsp::io::Bytes bytes, std::string const& path) {
  auto const table = gsp::io::detail::parse_ply_table(bytes, path);
  auto const& vertex = *table.find("vertex");
  std::string properties, box;
  for (auto const& p : vertex.properties) properties += (properties.empty() ? "" : " ") + p.name;
  auto const ends = [&](char const* property) {
    auto const column = table.column(vertex, property, "PLY of points");
    double low = INFINITY, high = -INFINITY;
    for (std::size_t i = 0; i < vertex.count; ++i) {
      low = std::min(low, column(i));
      high = std::max(high, column(i));
    }
    return number(low) + " .. " + number(high);
  };
  std::printf("%s: a cloud of %zu points, no Gaussians\n", path.c_str(), static_cast<std::size_t>(vertex.count));
  row("properties", properties);
  if (vertex.count == 0) return;
  for (char const* const axis : {"x", "y", "z"}) box += (box.empty() ? "" : ", ") + std::string(axis) + " " + ends(axis);
  row("box", box);
  if (table.find(vertex, "range")) row("range", ends("range"));
}

void splats(std::string const& path) {
  auto const set = gsp::io::read_splats(path);
  std::size_t linked = 0;
  double opacity = 0;
  std::array<float, 3> low{INFINITY, INFINITY, INFINITY}, high{-INFINITY, -INFINITY, -INFINITY};
  std::vector<float> sizes;
  for (std::size_t i = 0; i < set.size(); ++i) {
    linked += set.link[i] >= 0;
    opacity += set.opacities[i];
    sizes.push_back(std::max({set.scales[3 * i], set.scales[3 * i + 1], set.scales[3 * i + 2]}));
    for (std::size_t k = 0; k < 3; ++k) {
      low[k] = std::min(low[k], set.positions[3 * i + k]);
      high[k] = std::max(high[k], set.positions[3 * i + k]);
    }
  }
  std::nth_element(sizes.begin(), sizes.begin() + static_cast<std::ptrdiff_t>(sizes.size() / 2), sizes.end());
  std::printf("%s: %zu Gaussians, SH degree %d\n", path.c_str(), set.size(), set.sh_degree);
  row("box", "x " + number(low[0]) + " .. " + number(high[0]) + ", y " + number(low[1]) + " .. " + number(high[1]) + ", z " +
                 number(low[2]) + " .. " + number(high[2]));
  row("size",
      "median of the longest deviation " + number(sizes[sizes.size() / 2]) + "; mean opacity " + number(opacity / double(set.size())));
  std::string names;
  for (std::size_t k = 0; k < set.link_names.size() && k < 12; ++k) names += (k ? ", " : "") + set.link_names[k];
  row("links", linked == 0 ? "none: all are static"
                           : std::to_string(linked) + " Gaussians on " + std::to_string(set.link_names.size()) + " links (" + names +
                                 (set.link_names.size() > 12 ? ", ..." : "") + ")");
  if (set.notes.empty()) row("load report", "all of the file is taken as it stands");
  for (auto const& n : set.notes) row("load report", n);
}

void array_line(std::string const& name, gsp::io::NpyArray const& a) {
  char const* const types[] = {"float32", "float64", "int32", "int64", "uint8", "bool"};
  std::printf("  %-13s %s %s\n", name.c_str(), types[int(a.dtype)], gsp::io::format_shape(a.shape).c_str());
}

int run(Arguments const& arguments) {
  if (arguments.has("--schema")) {
    std::fputs(gsp::io::detail::mjcf::schema_page().c_str(), stdout);
    return 0;
  }
  if (arguments.operands().empty()) arguments.fail("a file is missing; name one, or ask for --schema");
  bool first = true;
  for (auto const& path : arguments.operands()) {
    if (!first && !arguments.has("--json")) std::puts("");
    first = false;
    auto const bytes = gsp::io::read_file(path);
    auto const head = gsp::io::detail::as_text(bytes).substr(0, 512);
    if (path.ends_with(".xml") || path.ends_with(".mjcf") || path.ends_with(".urdf") ||
        head.substr(0, head.find_first_not_of(" \t\r\n") + 1).ends_with('<')) {
      model(path, arguments);
    } else if (head.starts_with("PK") && !gsp::io::has_ending(path, ".sog")) {
      auto const npz = gsp::io::parse_npz(bytes, path);
      std::printf("%s: %zu arrays\n", path.c_str(), npz.arrays.size());
      for (auto const& [name, array] : npz.arrays) array_line(name, array);
    } else if (head.starts_with("\x93NUMPY")) {
      auto const array = gsp::io::parse_npy(bytes, path);
      std::printf("%s: one array\n", path.c_str());
      array_line("", array);
    } else if (head.starts_with("\x89PNG")) {
      int depth = 0;
      auto const picture = gsp::io::parse_png16(bytes, path, &depth);
      std::printf("%s: PNG, %d x %d, %d channels of %d bits\n", path.c_str(), picture.width, picture.height, picture.channels, depth);
    } else if (is_cloud(bytes, path)) {
      cloud(bytes, path);
    } else {
      splats(path);
    }
    std::fflush(stdout);
  }
  return 0;
}

}  // namespace

Command info_command() {
  return {"info",
          "FILE...",
          "says what a file holds (MJCF, URDF, Gaussians, clouds of points, npz, npy, PNG) and lists what of a model is refused, "
          "approximated or without effect, "
          "with file and line, and says whether gsp sim takes it and with which flags",
          0,
          -1,
          {skip_visuals_option(),
           decompose_option(),
           floating_base_option(),
           package_option(),
           {"--json", "", "of a model: one JSON object with its sizes, the report and the verdict"},
           {"--schema", "", "no file: what of MJCF works, as a page in Markdown"},
           approximate_option()},
          run};
}

}  // namespace gsp_cli
