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

std::vector<std::string> names_of(Model const& model, std::string const& kind) { return names_of(*model.compiled, kind); }
int id_of(Model const& model, std::string const& kind, std::string const& name) { return id_of(*model.compiled, kind, name); }

std::string in_python(std::string sentence) {
  constexpr std::array<std::array<std::string_view, 2>, 17> words{
      {{"MjcfOptions::skip_visuals (--skip-visuals)", "skip_visuals=True"},
       {"MjcfOptions::skip_visuals, --skip-visuals", "skip_visuals=True"},
       {"write its numbers with gsp::sense, then call limit_user_sensors for its cutoff", "data.sensordata has NaN in its place"},
       {"Stepper::save", "Data.save"},
       {"make the stepper of a model with option.sleep", "read the model with option flag sleep=\"enable\""},
       {"name it in make_per_world too", "name it in per_world too"},
       {"world_fields names those that may", "gsp.world_fields() names those that may, of an actuator act_gain and act_bias"},
       {"name it in per_world when you make them", "name it in per_world of gsp.Data"},
       {"; body_id(compiled, name) finds one", "; model.id('body', name) finds one"},
       {"; site_id(compiled, name) finds one", "; model.id('site', name) finds one"},
       {"write its world, or make poses and mounts with the same {.worlds = n}", "give worlds from 0 to one less than data.worlds"},
       {" (state.status(w))", " of data.status"},
       {"call settle(exec, simulation) and repeat the step (a loop of one's own: grow contacts, rows and impulses)", "reset the world"},
       {"gsp::io::transform", "gsp.Scene.add_splats"},
       {"gsp::set_world_values", "gsp.Data.set"},
       {": RendererOptions::rgb8", ": gsp.Renderer(..., rgb8=True)"},
       {"gsp::render:", "gsp.Renderer.render:"}}};
  for (auto const& [from, to] : words)
    if (auto const at = sentence.find(from); at != sentence.npos) sentence.replace(at, from.size(), to);
  if (sentence.rfind("gsp::runtime::Stepper::", 0) == 0) sentence.replace(0, 23, "gsp.Data.");
  if (sentence.rfind("gsp::runtime::Renderer::", 0) == 0) sentence.replace(0, 24, "gsp.Renderer.");
  if (sentence.rfind("gsp::", 0) == 0)  // the function that found it: "gsp::camera_id: the model has no ..."
    if (auto const end = sentence.find(": "); end != sentence.npos && end < sentence.find(' ')) sentence.erase(0, end + 2);
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
  c.def(
      "__init__",
      [](Model*, nb::args const&, nb::kwargs const&) {
        throw Error("gsp.Model: models come of files: gsp.Model.from_xml(path), from_string or from_urdf");
      },
      "Raises: models come of from_xml, from_string and from_urdf.");
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
  auto const whole = [&](char const* name, std::vector<int> CompiledModel::*member, char const* what) {
    c.def_prop_ro(
        name, [member](Model const& model) { return numbers((*model.compiled).*member); }, what);
  };
  auto const reals = [&](char const* name, std::vector<double> CompiledModel::*member, char const* what) {
    c.def_prop_ro(
        name, [member](Model const& model) { return numbers((*model.compiled).*member); }, what);
  };
  auto const rows = [&]<std::size_t n>(char const* name, std::vector<std::array<double, n>> CompiledModel::*member, char const* what) {
    c.def_prop_ro(
        name, [member](Model const& model) { return numbers<std::array<double, n>, n>((*model.compiled).*member); }, what);
  };
  using M = CompiledModel;
  whole("body_parentid", &M::body_parent, "(nbody)");
  rows("body_pos", &M::body_pos, "(nbody, 3) in the parent's frame [m]");
  rows("body_quat", &M::body_quat, "(nbody, 4) in the parent's frame");
  rows("body_ipos", &M::body_ipos, "(nbody, 3) centre of mass in the body's frame [m]");
  reals("body_mass", &M::body_mass, "(nbody) [kg]");
  rows("body_inertia", &M::body_inertia, "(nbody, 3) principal moments [kg m^2]");
  whole("jnt_bodyid", &M::jnt_body, "(njnt)");
  whole("jnt_qposadr", &M::jnt_qposadr, "(njnt) first number in qpos");
  whole("jnt_dofadr", &M::jnt_dofadr, "(njnt) first number in qvel");
  rows("jnt_axis", &M::jnt_axis, "(njnt, 3) in the body's frame");
  rows("jnt_range", &M::jnt_range, "(njnt, 2) [m, rad]");
  whole("dof_bodyid", &M::dof_body, "(nv)");
  whole("dof_jntid", &M::dof_jnt, "(nv)");
  reals("dof_damping", &M::dof_damping, "(nv) with what actuators add [N s/m, N m s/rad]");
  reals("dof_armature", &M::dof_armature, "(nv) with what actuators add [kg, kg m^2]");
  whole("geom_bodyid", &M::geom_body, "(ngeom)");
  whole("geom_type", &M::geom_type, "(ngeom) 0 plane, 1 hfield, 2 sphere, 3 capsule, 4 ellipsoid, 5 cylinder, 6 box, 7 mesh: MuJoCo's.");
  rows("geom_size", &M::geom_size, "(ngeom, 3) [m]");
  rows("geom_pos", &M::geom_pos, "(ngeom, 3) in the body's frame [m]");
  rows("geom_quat", &M::geom_quat, "(ngeom, 4) in the body's frame");
  rows("geom_friction", &M::geom_friction, "(ngeom, 3) sliding, torsional [m], rolling [m]");
  whole("site_bodyid", &M::site_body, "(nsite)");
  rows("site_pos", &M::site_pos, "(nsite, 3) in the body's frame [m]");
  rows("site_quat", &M::site_quat, "(nsite, 4) in the body's frame");
  rows("actuator_ctrlrange", &M::act_ctrlrange, "(nu, 2)");
  rows("actuator_gear", &M::act_gear, "(nu, 6)");
  c.def_prop_ro(
      "key_qpos",
      [](Model const& model) {
        CompiledModel const& m = *model.compiled;
        std::vector<double> all;
        for (auto const& key : m.keyframes) {
          auto const& qpos = key.qpos.empty() ? m.qpos0 : key.qpos;
          all.insert(all.end(), qpos.begin(), qpos.end());
        }
        return nb::borrow<NumpyArray>(numbers(all).attr("reshape")(m.keyframes.size(), m.nq));
      },
      "(nkey, nq) positions of the keyframes.");
  c.def_prop_ro(
      "sensor_adr", [](Model const& model) { return numbers(model.compiled->sensor_adr); }, "(nsensor) first number in sensordata.");
  c.def_prop_ro(
      "sensor_dim", [](Model const& model) { return numbers(model.compiled->sensor_dim); }, "(nsensor) how many numbers.");
  c.def("__repr__", [](Model const& model) {
    CompiledModel const& a = *model.compiled;
    return "gsp.Model('" + model.file + "', nq=" + std::to_string(a.nq) + ", nv=" + std::to_string(a.nv) + ", nu=" + std::to_string(a.nu) +
           ", nbody=" + std::to_string(a.nbody) + ")";
  });
}

}  // namespace gsp::python
