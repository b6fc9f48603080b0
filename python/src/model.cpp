#include "model.hpp"

#include <nanobind/stl/array.h>
#include <nanobind/stl/filesystem.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <array>
#include <gsp/io/mjcf.hpp>
#include <gsp/io/urdf.hpp>
#include <gsp/model/compile.hpp>
#include <gsp/model/names.hpp>
#include <string_view>

#include "array.hpp"

namespace gsp::python {
namespace {

Model model_of(Description description, std::string const& file, std::vector<std::string> const& disable = {}) {
  for (auto const& flag : disable) {
    bool known = false;
    std::string names;
    for (auto const& [name, on] : option_flags) {
      names += (names.empty() ? "" : ", ") + std::string(name);
      if (flag != name) continue;
      known = true;
      description.option.*on = false;
    }
    if (!known) throw Error("there is no flag '" + flag + "' to disable: give " + names);
  }
  return {std::make_shared<CompiledModel const>(compile(description)), file};
}

/// Names of all objects of a kind, in their order.
std::vector<std::string> names_of(CompiledModel const& m, std::string const& kind) {
  auto const of = [](auto const& described) {
    std::vector<std::string> out;
    for (auto const& one : described) out.push_back(one.name);
    return out;
  };
  if (kind == "body") return m.body_name;
  if (kind == "joint") return m.jnt_name;
  if (kind == "geom") return m.geom_name;
  if (kind == "site") return m.site_name;
  if (kind == "camera") return m.cam_name;
  if (kind == "actuator") return m.act_name;
  if (kind == "tendon") return m.tendon_name;
  if (kind == "equality") return m.eq_name;
  if (kind == "mesh") return m.mesh_name;
  if (kind == "sensor") return of(m.sensors);
  if (kind == "keyframe") return of(m.keyframes);
  throw Error("there is no kind of object '" + kind +
              "': give 'body', 'joint', 'geom', 'site', 'camera', 'actuator', 'tendon', 'equality', 'mesh', 'sensor' or 'keyframe'");
}
int id_of(CompiledModel const& m, std::string const& kind, std::string const& name) {
  try {
    return detail::id_in(kind.c_str(), names_of(m, kind), name);
  } catch (Error const& e) {
    std::string const text = e.what(), function = "gsp::" + kind + "_id: ";
    throw Error(text.rfind(function, 0) == 0 ? text.substr(function.size()) : text);
  }
}

/// A copy of numbers of the model as a read-only array of NumPy.
template <class Item, std::size_t n = 1>
NumpyArray numbers(std::vector<Item> const& from) {
  using R = std::conditional_t<std::is_same_v<Item, int>, int, double>;
  std::vector<R> flat;
  for (auto const& item : from)
    if constexpr (n == 1)
      flat.push_back(item);
    else
      for (auto const x : item) flat.push_back(x);
  nb::object const numpy = nb::module_::import_("numpy");
  nb::object a = numpy.attr("array")(flat, nb::arg("dtype") = std::is_same_v<R, int> ? "int32" : "float64");
  if constexpr (n > 1) a = a.attr("reshape")(-1, n);
  a.attr("flags").attr("writeable") = false;
  return nb::borrow<NumpyArray>(a);
}

}  // namespace

int id_of(Model const& model, std::string const& kind, std::string const& name) { return id_of(*model.compiled, kind, name); }

std::string in_python(std::string sentence) {
  constexpr std::array<std::array<std::string_view, 2>, 3> words{
      {{"MjcfOptions::skip_visuals (--skip-visuals)", "skip_visuals=True"},
       {"MjcfOptions::skip_visuals, --skip-visuals", "skip_visuals=True"},
       {"write its numbers with gsp::sense, then call limit_user_sensors for its cutoff", "data.sensordata has NaN in its place"}}};
  for (auto const& [from, to] : words)
    if (auto const at = sentence.find(from); at != sentence.npos) sentence.replace(at, from.size(), to);
  return sentence;
}

void bind_model(nb::module_& m) {
  nb::class_<ReportLine>(m, "ReportLine", "What the reader left out, approximated or found without effect.")
      .def_prop_ro("kind", [](ReportLine const& l) { return text(l.kind); })
      .def_ro("file", &ReportLine::file)
      .def_ro("line", &ReportLine::line)
      .def_prop_ro("text", [](ReportLine const& l) { return in_python(l.text); })
      .def_ro("count", &ReportLine::count, "How often.")
      .def("__repr__", [](ReportLine const& l) {
        return l.file + ":" + std::to_string(l.line) + ": " + text(l.kind) + ": " + in_python(l.text) +
               (l.count > 1 ? " (" + std::to_string(l.count) + " times)" : "");
      });
  auto c = nb::class_<Model>(m, "Model", "A robot or a scene, compiled by MuJoCo's rules. Sizes and arrays have MuJoCo's names and order.");
  c.def_static(
      "from_xml",
      [](std::filesystem::path const& path, std::vector<std::string> const& disable, bool skip_visuals, bool convex_decomposition) {
        std::string const text = path.string();
        auto const begin = text.find_first_not_of(" \t\r\n");
        if (begin != std::string::npos && text[begin] == '<')
          throw Error("gsp.Model.from_xml takes the path of a file: give XML text to gsp.Model.from_string");
        io::MjcfOptions const options{.skip_visuals = skip_visuals, .convex_decomposition = convex_decomposition};
        return model_of(io::read_mjcf(path, options), path.string(), disable);
      },
      nb::arg("path"), nb::kw_only(), nb::arg("disable") = std::vector<std::string>{}, nb::arg("skip_visuals") = false,
      nb::arg("convex_decomposition") = false,
      "Reads an MJCF file.\n\ndisable: names of MJCF's <flag> that are switched off whatever the file says, such as ['contact'];\n"
      "skip_visuals: leave out visual geoms whose mesh is missing; convex_decomposition: meshes that are not convex touch as their\n"
      "convex parts, not as their hull. Error: gsp.Error \"FILE:LINE: what is wrong; remedy\".");
  c.def_static(
      "from_string",
      [](std::string const& xml, std::string const& name, std::vector<std::string> const& disable, bool skip_visuals,
         bool convex_decomposition) {
        io::MjcfOptions const options{.skip_visuals = skip_visuals, .convex_decomposition = convex_decomposition};
        return model_of(io::parse_mjcf(xml, name, options), name, disable);
      },
      nb::arg("xml"), nb::arg("name") = "model.xml", nb::kw_only(), nb::arg("disable") = std::vector<std::string>{},
      nb::arg("skip_visuals") = false, nb::arg("convex_decomposition") = false,
      "The same of MJCF text; files that it names are looked for in the folder of `name`.");
  c.def_static(
      "from_urdf",
      [](std::filesystem::path const& path, std::vector<std::string> const& disable, bool floating_base, bool skip_visuals) {
        return model_of(io::read_urdf(path, {.floating_base = floating_base, .skip_visuals = skip_visuals}), path.string(), disable);
      },
      nb::arg("path"), nb::kw_only(), nb::arg("disable") = std::vector<std::string>{}, nb::arg("floating_base") = false,
      nb::arg("skip_visuals") = false,
      "Reads a URDF file, which has no actuators: data.qfrc_applied drives its joints. floating_base: the root link is free;\n"
      "disable, skip_visuals: as of from_xml.");
  auto const size = [&](char const* name, int CompiledModel::*member) {
    c.def_prop_ro(name, [member](Model const& model) { return (*model.compiled).*member; });
  };
  size("nq", &CompiledModel::nq);
  size("nv", &CompiledModel::nv);
  size("nu", &CompiledModel::nu);
  size("na", &CompiledModel::na);
  size("nbody", &CompiledModel::nbody);
  size("njnt", &CompiledModel::njnt);
  size("ngeom", &CompiledModel::ngeom);
  size("nsite", &CompiledModel::nsite);
  size("ncam", &CompiledModel::ncam);
  size("ntendon", &CompiledModel::ntendon);
  size("neq", &CompiledModel::neq);
  size("nmocap", &CompiledModel::nmocap);
  size("nsensor", &CompiledModel::nsensor);
  size("nsensordata", &CompiledModel::nsensordata);
  c.def_prop_ro("nkey", [](Model const& model) { return model.compiled->keyframes.size(); });
  c.def_prop_ro(
      "timestep", [](Model const& model) { return model.compiled->option.timestep; }, "[s]");
  c.def_prop_ro(
      "gravity",
      [](Model const& model) {
        auto const& g = model.compiled->option.gravity;
        return numbers(std::vector<double>(g.begin(), g.end()));
      },
      "(3) [m/s^2]");
  c.def_prop_ro(
      "jnt_type", [](Model const& model) { return numbers(model.compiled->jnt_type); },
      "(njnt) 0 free, 1 ball, 2 slide, 3 hinge: MuJoCo's.");
  c.def_prop_ro(
      "report", [](Model const& model) { return model.compiled->report; }, "What the reader has to say: list of ReportLine.");
  c.def(
      "names", [](Model const& model, std::string const& kind) { return names_of(*model.compiled, kind); }, nb::arg("kind"),
      "Names of all objects of a kind, in their order: 'body', 'joint', 'geom', 'site', 'camera', 'actuator', 'tendon', 'equality',\n"
      "'mesh', 'sensor' or 'keyframe'.");
  c.def(
      "id", [](Model const& model, std::string const& kind, std::string const& name) { return id_of(model, kind, name); }, nb::arg("kind"),
      nb::arg("name"), "Number of an object of this kind and name. Error: gsp.Error with the nearest names.");
  c.def_prop_ro(
      "qpos0", [](Model const& model) { return numbers(model.compiled->qpos0); }, "(nq) initial positions.");
  c.def_prop_ro("body_parentid", [](Model const& model) { return numbers(model.compiled->body_parent); });
  c.def_prop_ro(
      "body_mass", [](Model const& model) { return numbers(model.compiled->body_mass); }, "(nbody) [kg]");
  c.def_prop_ro("jnt_qposadr", [](Model const& model) { return numbers(model.compiled->jnt_qposadr); });
  c.def_prop_ro("jnt_dofadr", [](Model const& model) { return numbers(model.compiled->jnt_dofadr); });
  c.def_prop_ro(
      "jnt_range", [](Model const& model) { return numbers<std::array<double, 2>, 2>(model.compiled->jnt_range); }, "(njnt, 2) [m, rad]");
  c.def_prop_ro("geom_bodyid", [](Model const& model) { return numbers(model.compiled->geom_body); });
  c.def_prop_ro(
      "actuator_ctrlrange", [](Model const& model) { return numbers<std::array<double, 2>, 2>(model.compiled->act_ctrlrange); }, "(nu, 2)");
  c.def_prop_ro(
      "sensor_adr", [](Model const& model) { return numbers(model.compiled->sensor_adr); }, "(nsensor) first number in sensordata.");
  c.def_prop_ro("sensor_dim", [](Model const& model) { return numbers(model.compiled->sensor_dim); });
  c.def("__repr__", [](Model const& model) {
    CompiledModel const& a = *model.compiled;
    return "gsp.Model('" + model.file + "', nq=" + std::to_string(a.nq) + ", nv=" + std::to_string(a.nv) + ", nu=" + std::to_string(a.nu) +
           ", nbody=" + std::to_string(a.nbody) + ")";
  });
}

}  // namespace gsp::python
