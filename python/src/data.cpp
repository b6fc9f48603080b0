#include "data.hpp"

#include <nanobind/stl/array.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <gsp/core/status.hpp>
#include <gsp/model/detail/host_math.hpp>
#include <gsp/model/sensor_types.hpp>

#include "array.hpp"
#include "named.hpp"
#include "others_run.hpp"

namespace gsp::python {

namespace {
[[noreturn]] void refuse_second(char const* what) {
  throw Error(std::string("another thread of Python, or the call that a signal came into, is at ") + what +
              ": wait for it, or give each thread its own");
}
}  // namespace
runtime::Stepper& stepper_of(Data const& data) {
  expect_threads();
  if (*data.busy) refuse_second("these data");
  return *data.stepper;
}
Use::Use(std::shared_ptr<std::atomic<bool>> busy, char const* what) : busy_(std::move(busy)) {
  expect_threads();
  if (busy_->exchange(true)) refuse_second(what);
}
Use::Use(Data const& data) : Use(data.busy, "these data") {}
namespace {
/// Keeps the positions as they are. Returns true if they are not those that were kept.
bool keep_positions(Data const& data) {
  auto& kept = data.posed->positions;
  auto const s = data.stepper->state();
  std::size_t at = 0;
  bool same = true;
  for (runtime::Array const& a : {s.qpos, s.qpos_low, s.mocap_pos, s.mocap_quat}) {
    auto const size = std::size_t(a.size()) * std::size_t(runtime::bytes_of(a.dtype));
    if (size == 0) continue;
    if (kept.size() < at + size) {
      kept.resize(at + size);
      same = false;
    }
    same = same && std::memcmp(kept.data() + at, a.data, size) == 0;
    if (!same) std::memcpy(kept.data() + at, a.data, size);
    at += size;
  }
  return !same;
}
}  // namespace
void freshen(Data const& data) {
  if (!data.posed->given) return;
  // On a GPU comparing, and waiting for the answer, takes longer than the poses.
  if (data.device != runtime::Device::cpu || keep_positions(data)) data.stepper->set({}, {}, {});  // the poses are stale
}

void expect_free(std::string const& what, double needed, double free, runtime::Device device, std::string const& remedy) {
  if (needed <= free) return;
  char text[96];
  std::snprintf(text, sizeof text, " %.3g GB, and %.3g GB are free", needed / 1e9, free / 1e9);
  throw Error(what + text + (device == runtime::Device::cuda ? " on the GPU" : "") + ": " + remedy);
}

namespace {

/// What keeps a stepper's arrays: the stepper, and behind it Kokkos.
struct Keeper {
  std::shared_ptr<runtime::Session> session;
  std::shared_ptr<runtime::Stepper> stepper;
};
/// Of cameras, which the stepper may let go of.
struct CameraKeeper {
  std::shared_ptr<runtime::Session> session;
  std::shared_ptr<void> cameras;
};
Array held(Data const& d, runtime::Array const& a, char const* computed = nullptr) {
  return {a, std::make_shared<Keeper>(Keeper{d.session, d.stepper}), computed};
}
constexpr char const* write_positions = "write data.qpos";
/// Positions, which whoever has them may write from now on.
Array given(Data const& d, runtime::Array const& a) {
  d.posed->given = true;
  return held(d, a);
}
/// The stepper with poses of the positions as they are, and for what leaves its own poses behind.
runtime::Stepper& fresh(Data const& d) {
  runtime::Stepper& stepper = stepper_of(d);
  freshen(d);
  return stepper;
}
runtime::Stepper& poser(Data const& d) {
  runtime::Stepper& stepper = stepper_of(d);
  d.posed->positions.clear();
  return stepper;
}
/// A copy of what lies in a pool that may grow: it is Python's own.
Array copied(Data const& d, runtime::Array const& a) {
  auto buffer = runtime::make_buffer(a.device, a.dtype, {a.extents[0], a.rank > 1 ? a.extents[1] : 1, a.rank > 2 ? a.extents[2] : 1});
  buffer.array.rank = a.rank;
  if (a.size() > 0) runtime::copy(a, buffer.array);
  struct Own {
    std::shared_ptr<runtime::Session> session;
    std::shared_ptr<void> memory;
  };
  return {buffer.array, std::make_shared<Own>(Own{d.session, buffer.owner})};
}

Data* make_data(Model const& model, int worlds, std::string const& device, std::string const& profile, std::string const& precision,
                double timestep, int iterations, std::optional<double> tolerance, int threads, std::vector<std::string> const& per_world) {
  if (worlds < 1) throw Error("gsp.Data: worlds must be positive and is " + std::to_string(worlds));
  if (!(timestep >= 0 && timestep < 1e6))
    throw Error("gsp.Data: timestep is " + std::to_string(timestep) + " and must be seconds, or 0 for the model's");
  if (threads < 0 || iterations < 0)
    throw Error("gsp.Data: threads and iterations are 0 (the library's own) or more, not " + std::to_string(std::min(threads, iterations)));
  if (tolerance && !(*tolerance >= 0 && std::isfinite(*tolerance)))
    throw Error("gsp.Data: tolerance is " + std::to_string(*tolerance) + " and must be 0 or more, or None for the library's own");
  if (profile != "stable" && profile != "mujoco")
    throw Error("gsp.Data: profile '" + profile + "' is not known: give 'stable' or 'mujoco'");
  if (precision != "float32" && precision != "float64")
    throw Error("gsp.Data: precision '" + precision + "' is not known: give 'float32' or 'float64'");
  runtime::StepperOptions const options{.worlds = worlds,
                                        .precision = precision == "float64" ? runtime::Dtype::float64 : runtime::Dtype::float32,
                                        .timestep = timestep,
                                        .mujoco = profile == "mujoco",
                                        .iterations = iterations,
                                        .tolerance = tolerance,
                                        .threads = threads,
                                        .per_world = per_world};
  auto* const d = new Data{session(), model, device_of(device), worlds, nullptr};
  d->python_model = nb::find(model);
  d->moves_geoms = std::any_of(per_world.begin(), per_world.end(), [](std::string const& field) {
    return field == "geom_size" || field == "geom_pos" || field == "geom_quat";
  });
  try {
    expect_free("gsp.Data: " + std::to_string(worlds) + " worlds need", double(runtime::bytes_needed(d->device, *model.compiled, options)),
                double(runtime::free_bytes(d->device)), d->device, "make fewer worlds, or free what others hold");
    d->stepper = runtime::make_stepper(d->device, *model.compiled, options);
  } catch (...) {
    delete d;
    throw;
  }
  bool const sized = std::find(per_world.begin(), per_world.end(), "geom_size") != per_world.end();
  auto const by_model = [](SensorDescription const& s) {
    SensorInfo const* const info = find_sensor_type(s.type);
    return info && (info->stage == SensorStage::ray || info->stage == SensorStage::shape);
  };
  auto const& sensors = model.compiled->sensors;
  if (sized && std::any_of(sensors.begin(), sensors.end(), by_model) &&
      PyErr_WarnEx(PyExc_UserWarning,
                   "gsp.Data: rangefinders and sensors of distances keep the model's sizes of geoms: geom_size of per_world is what "
                   "contacts see; leave these sensors out where it matters",
                   1) != 0) {
    delete d;
    throw nb::python_error();
  }
  if (int const found = d->stepper->threads(); threads > found && found > 0) {
    std::string const text = "gsp.Data: threads=" + std::to_string(threads) + " were asked for, and there are " + std::to_string(found) +
                             ": set OMP_NUM_THREADS before the first gsp.Data, which starts them";
    if (PyErr_WarnEx(PyExc_UserWarning, text.c_str(), 1) != 0) {
      delete d;
      throw nb::python_error();
    }
  }
  return d;
}

/// A camera's rotation in its body's frame, looking along -z from `pos` to `target`, with y up as far as it goes.
std::array<double, 4> looking(std::array<double, 3> const& pos, std::array<double, 3> const& target, std::string const& mount) {
  Double3 const back{pos[0] - target[0], pos[1] - target[1], pos[2] - target[2]};
  double const far = gsp::detail::norm(back), across = std::hypot(back[0], back[1]);
  if (!(far > 0 && std::isfinite(far))) throw Error(mount + ": pos and target are one point, or no numbers: move one of them");
  // straight up or down: the body's x is to the right
  Double3 const x = across > 1e-9 * far ? Double3{-back[1] / across, back[0] / across, 0} : Double3{1, 0, 0},
                z{back[0] / far, back[1] / far, back[2] / far};
  auto const q = gsp::detail::quat_of_axes(x, gsp::detail::cross(z, x), z);
  return {q[0], q[1], q[2], q[3]};
}

/// Camera k as Python says it: a name, or a dict of what CameraSpec has, fovy in degrees, `target` in place of quat.
runtime::CameraSpec spec_of(nb::handle mount, std::size_t k) {
  std::string const where = "gsp.Data.cameras: ";
  if (nb::isinstance<nb::str>(mount)) return {.camera = nb::cast<std::string>(mount)};
  if (!nb::isinstance<nb::dict>(mount))
    throw Error(where + "a mount is the name of a camera of the model, or dict(body=..., pos=..., quat=..., fovy=...)");
  auto const read = [&](std::string const& name, nb::handle value, auto& to, char const* remedy) {
    bool const several =
        !std::is_arithmetic_v<std::decay_t<decltype(to)>> && !nb::isinstance<nb::str>(value) && PySequence_Check(value.ptr());
    nb::object const list = several ? nb::steal(PySequence_List(value.ptr())) : nb::borrow(value);  // NumPy's arrays too
    PyErr_Clear();
    if (!list.is_valid() || !nb::try_cast(list, to))
      throw Error(where + name + " of mount " + std::to_string(k) + " is " + nb::cast<std::string>(nb::repr(value)) + ": give " + remedy);
  };
  constexpr double degree = 3.14159265358979323846 / 180;
  runtime::CameraSpec spec;
  std::optional<std::array<double, 3>> target;
  bool turned = false;
  double fovy = spec.fovy / degree;
  for (auto const& [key, value] : nb::borrow<nb::dict>(mount)) {
    std::string const name = nb::cast<std::string>(nb::str(key));
    if (name == "body")
      read(name, value, spec.body, "its name, 'world' for what does not move");
    else if (name == "pos")
      read(name, value, spec.pos, "3 numbers [m]");
    else if (name == "quat")
      turned = true, read(name, value, spec.quat, "4 numbers, w x y z");
    else if (name == "target")
      read(name, value, target.emplace(), "3 numbers [m]");
    else if (name == "fovy")
      read(name, value, fovy, "a number of degrees");
    else
      throw Error(where + "a mount has body, pos, quat or target, and fovy, and no '" + name + "'");
  }
  if (target && turned) throw Error(where + "mount " + std::to_string(k) + " has quat and target, which both say where it looks: give one");
  if (target) spec.quat = looking(spec.pos, *target, where + "mount " + std::to_string(k));
  if (!(fovy > 0 && fovy < 180)) throw Error(where + "fovy must lie between 0 and 180 degrees and is " + std::to_string(fovy));
  spec.fovy = fovy * degree;
  if (spec.body.empty()) throw Error(where + "a mount has no body: say which, 'world' for what does not move");
  return spec;
}
std::vector<runtime::CameraSpec> specs_of(nb::handle mounts) {
  bool const several = !nb::isinstance<nb::str>(mounts) && !nb::isinstance<nb::dict>(mounts) && PySequence_Check(mounts.ptr());
  nb::object const list = several ? nb::steal(PySequence_List(mounts.ptr())) : nb::object();
  PyErr_Clear();
  if (!list.is_valid())
    throw Error(
        "gsp.Data.cameras: the mounts are a list: give [dict(body='world', pos=(0, -3, 1), quat=(1, 0, 0, 0), fovy=60)], or ['name']");
  std::vector<runtime::CameraSpec> specs;
  for (nb::handle const mount : nb::borrow<nb::list>(list)) specs.push_back(spec_of(mount, specs.size()));
  return specs;
}

void expect_model(Model const& model, Data const& d, char const* call) {
  if (model.compiled != d.model.compiled)
    throw Error(std::string(call) + ": the data are of another model: give the one that they were made of, data.model");
}

/// Steps in parts, between which Ctrl-C is heard.
void step(Data const& d, int n) {
  if (n < 0) throw Error("gsp.step: n must be 0 or more and is " + std::to_string(n));
  using Clock = std::chrono::steady_clock;
  Use const use(d);
  int& part = *d.at_once;  // from call to call: threads go through as many steps before they wait for each other
  while (n > 0) {
    int const now = std::min(part, n);
    auto const begin = Clock::now();
    {
      OthersRun const others_run;
      d.stepper->step({.steps = now});
    }
    n -= now;
    double const seconds = std::chrono::duration<double>(Clock::now() - begin).count();
    if (seconds < 0.05 && now == part) part *= 2;
    if (seconds > 0.2) part = std::max(1, part / 2);
    if (PyErr_CheckSignals() != 0) nb::raise_python_error();
  }
}

std::string text_of(nb::handle object) { return nb::cast<std::string>(nb::steal(PyObject_Str(object.ptr()))); }
/// What Python gave, in the shape of `to`: NumPy's rules of broadcasting, but for what lies on a GPU, which has it already or is one row
/// of it.
runtime::Array shaped_as(runtime::Array const& to, char const* what, nb::handle value, nb::object& keeps) {
  if (nb::isinstance<Array>(value) || nb::hasattr(value, "__cuda_array_interface__")) {
    bool const all = nb::cast<int>(value.attr("ndim")) == to.rank;
    runtime::Array from = to.rank == 1          ? taken(value, what, {-1}, keeps)
                          : all && to.rank == 2 ? taken(value, what, {-1, to.extents[1]}, keeps)
                          : all                 ? taken(value, what, {-1, to.extents[1], to.extents[2]}, keeps)
                          : to.rank == 2        ? taken(value, what, {to.extents[1]}, keeps)
                                                : taken(value, what, {to.extents[1], to.extents[2]}, keeps);
    if (from.rank < to.rank) {
      for (int k = from.rank; k-- > 0;) {
        from.extents[std::size_t(k) + 1] = from.extents[std::size_t(k)];
        from.strides[std::size_t(k) + 1] = from.strides[std::size_t(k)];
      }
      from.extents[0] = 1;
      from.strides[0] = 0;
      ++from.rank;
    }
    if (from.extents[0] != 1 && from.extents[0] != to.extents[0])
      throw Error(std::string(what) + " has " + std::to_string(from.extents[0]) + " rows and must have one, or one for each of the " +
                  std::to_string(to.extents[0]) + " worlds");
    return from;
  }
  nb::object const numpy = nb::module_::import_("numpy");
  nb::object given = numpy.attr("asarray")(value);
  std::string const kind = nb::cast<std::string>(given.attr("dtype").attr("kind"));
  if (kind != "f" || nb::cast<int>(given.attr("dtype").attr("itemsize")) != 4) {
    if (std::string("fiub").find(kind) == std::string::npos)
      throw Error(std::string(what) + " holds " + text_of(nb::object(given.attr("dtype"))) + ": give real numbers");
    given = given.attr("astype")("float64", nb::arg("copy") = false);
  }
  nb::list shape;
  for (int k = 0; k < to.rank; ++k) shape.append(to.extents[std::size_t(k)]);
  try {
    keeps = numpy.attr("broadcast_to")(given, nb::tuple(shape));
  } catch (nb::python_error const&) {
    throw Error(std::string(what) + " has shape " + text_of(nb::object(given.attr("shape"))) + " and must have " +
                text_of(nb::tuple(shape)) + ", or one that NumPy makes it of");
  }
  nb::object own;
  runtime::Array const from = to.rank == 1   ? taken(keeps, what, {-1}, own)
                              : to.rank == 2 ? taken(keeps, what, {-1, -1}, own)
                                             : taken(keeps, what, {-1, -1, -1}, own);
  keeps = nb::make_tuple(keeps, own);
  return from;
}
/// Of some numbers of Python's, an array of NumPy's of real ones, or what lies on a GPU.
nb::object shaped(nb::handle value) {
  bool const on_gpu = nb::isinstance<Array>(value) ? nb::cast<Array const&>(value).array.device != runtime::Device::cpu
                                                   : nb::hasattr(value, "__cuda_array_interface__");
  if (on_gpu) return nb::borrow(value);
  nb::object const given = nb::module_::import_("numpy").attr("asarray")(value);
  std::string const kind = nb::cast<std::string>(given.attr("dtype").attr("kind"));
  if (std::string("fiub").find(kind) == std::string::npos)
    throw Error("gsp.Data.set: the values hold " + text_of(nb::object(given.attr("dtype"))) + ": give real numbers");
  return kind == "f" ? given : nb::object(given.attr("astype")("float64"));
}
int rank_of(nb::object const& given) { return nb::cast<int>(given.attr("ndim")); }

/// Worlds of a mask of bool or whole numbers, or none: all.
runtime::Array mask_of(Data const& d, nb::handle mask, std::string const& where, nb::object& keeps) {
  nb::object whole = nb::borrow(mask);
  if (nb::isinstance<Array>(mask)) {
    if (nb::cast<Array const&>(mask).array.dtype != runtime::Dtype::int32)
      throw Error(where + ": a mask that is a gsp.Array must hold int32");
  } else if (!mask.is_none() && nb::hasattr(mask, "__cuda_array_interface__")) {
    whole = nb::hasattr(mask, "int") ? mask.attr("int")() : mask.attr("astype")("int32");  // torch's, cupy's
  } else if (!mask.is_none()) {
    whole = nb::module_::import_("numpy").attr("asarray")(mask);
    std::string const kind = nb::cast<std::string>(whole.attr("dtype").attr("kind"));
    if (kind != "b" && kind != "i" && kind != "u") throw Error(where + ": the mask must hold bool or whole numbers, one for each world");
    nb::object const other = whole.attr("astype")("bool").attr("__ne__")(whole);  // a number that is neither 0 nor 1
    if (PyObject_IsTrue(other.attr("any")().ptr()) == 1)
      throw Error(where + ": the mask holds other numbers than 0 and 1: it says yes or no of each world, and names none by its number");
    whole = whole.attr("astype")("int32", nb::arg("copy") = false);
  }
  runtime::Array const given = taken(whole, (where + ": mask").c_str(), {d.worlds}, keeps);
  if (given && given.dtype != runtime::Dtype::int32) throw Error(where + ": a mask on a GPU must hold int32, one for each world");
  return given;
}

void reset(Data const& d, nb::handle mask, nb::handle keyframe) {
  nb::object keeps;
  runtime::Array const given = mask_of(d, mask, "gsp.reset", keeps);
  int key = -1;
  if (!keyframe.is_none()) {
    auto const& keys = d.model.compiled->keyframes;
    if (nb::isinstance<nb::str>(keyframe)) {
      std::string const name = nb::cast<std::string>(keyframe);
      std::string known;
      for (std::size_t k = 0; k < keys.size(); ++k) {
        if (keys[k].name == name) key = static_cast<int>(k);
        known += (known.empty() ? "" : ", ") + keys[k].name;
      }
      if (key < 0) throw Error("gsp.reset: the model has no keyframe '" + name + "'" + (known.empty() ? "" : ": it has " + known));
    } else {
      key = nb::cast<int>(keyframe);
      if (key < 0 || key >= static_cast<int>(keys.size()))
        throw Error("gsp.reset: keyframe " + std::to_string(key) + " is asked for, and the model has " + std::to_string(keys.size()));
    }
  }
  Use const use(d);
  OthersRun const others_run;
  d.stepper->reset(given, key);
}

/// Numbers of the model that a field has in all worlds at first, where a number that is not 0 there must be positive; none: zero or more.
struct Bounded {
  char const* field;
  double (*of_model)(CompiledModel const& m, std::size_t item, std::size_t component);
};
constexpr Bounded bounded[] = {
    {"body_mass", [](CompiledModel const& m, std::size_t i, std::size_t) { return m.body_mass[i]; }},
    {"body_inertia", [](CompiledModel const& m, std::size_t i, std::size_t k) { return m.body_inertia[i][k]; }},
    {"geom_size", [](CompiledModel const& m, std::size_t i, std::size_t k) { return m.geom_size[i][k]; }},
    {"geom_friction", nullptr},
    {"dof_armature", nullptr},
    {"dof_frictionloss", nullptr},
    {"tendon_frictionloss", nullptr},
};
/// "body 'torso'", "dof 3"
std::string item_text(Model const& model, std::string const& field, std::size_t item) {
  constexpr std::array<std::array<char const*, 2>, 6> kinds{
      {{"body_", "body"}, {"jnt_", "joint"}, {"geom_", "geom"}, {"tendon_", "tendon"}, {"act_", "actuator"}, {"eq_", "equality"}}};
  for (auto const& [prefix, kind] : kinds) {
    if (field.rfind(prefix, 0) != 0) continue;
    auto const names = names_of(model, kind);
    bool const named = item < names.size() && !names[item].empty();
    return std::string(kind) + " " + (named ? "'" + names[item] + "'" : std::to_string(item));
  }
  return (field.rfind("dof_", 0) == 0 ? "dof " : "item ") + std::to_string(item);
}
/// Of each number of a field what it may be besides finite, as it was in some world when somebody first asked: 'n' NaN, of geoms that touch
/// nothing, 'i' infinite, of ranges that do not limit.
std::string const& not_finite_of(Data const& d, std::string const& field) {
  auto const found = d.not_finite->find(field);
  if (found != d.not_finite->end()) return found->second;
  auto const values = nb::object(numpy_copy(stepper_of(d).world_values(field)).attr("astype")("float64"));
  nb::object keeps;
  auto const now = taken(values, field.c_str(), {d.worlds, -1, -1}, keeps);
  std::int64_t const count = now.extents[1] * now.extents[2];
  std::string kinds(std::size_t(count), ' ');
  for (std::int64_t i = 0; i < now.size(); ++i) {
    double const x = static_cast<double const*>(now.data)[i];
    if (!std::isfinite(x)) kinds[std::size_t(i % count)] = std::isnan(x) ? 'n' : 'i';
  }
  return (*d.not_finite)[field] = kinds;
}
/// Refuses what MJCF refuses, in worlds of the mask: what is not finite, unless it is what is there, and masses, inertias, sizes and
/// friction of no body. Says nothing of shapes: who takes the values does.
/// @param v  (worlds | 1, items, components) of the host, float64, one after the other
void expect_values(Data const& d, std::string const& field, runtime::Array const& v, int const* mask) {
  auto const* const rule = std::find_if(std::begin(bounded), std::end(bounded), [&](Bounded const& b) { return field == b.field; });
  bool const ruled = rule != std::end(bounded);
  auto const items = std::size_t(v.extents[1]), parts = std::size_t(v.rank == 2 ? 1 : v.extents[2]), count = items * parts;
  CompiledModel const& m = *d.model.compiled;
  std::vector<char> positive(count, 0);
  if (ruled && rule->of_model) {
    bool const of_bodies = field.rfind("body_", 0) == 0;
    if (items != std::size_t(of_bodies ? m.nbody : m.ngeom) || parts != (field == "body_mass" ? 1u : 3u)) return;
    for (std::size_t at = 0; at < count; ++at) positive[at] = rule->of_model(m, at / parts, at % parts) > 0;
  }
  for (std::size_t w = 0; w < std::size_t(d.worlds); ++w) {
    if (mask && mask[w] == 0) continue;
    double const* const row = static_cast<double const*>(v.data) + (v.extents[0] == 1 ? 0 : w * count);
    for (std::size_t at = 0; at < count; ++at) {
      double const x = row[at];
      auto const refuse = [&](std::string const& what) {
        throw Error("gsp.Data.set: '" + field + "' of world " + std::to_string(w) + ", " + item_text(d.model, field, at / parts) + ", is " +
                    text_of(nb::float_(x)) + " and must be " + what);
      };
      if (!std::isfinite(x)) {
        auto const& kinds = not_finite_of(d, field);
        if (kinds.size() != count) return;
        if (kinds[at] != (std::isnan(x) ? 'n' : 'i')) refuse("finite");
        continue;
      }
      if (ruled && (x < 0 || (positive[at] && x == 0))) refuse(positive[at] ? "positive" : "0 or more");
    }
  }
}

void set(Data const& d, std::string const& field, nb::handle values, nb::handle mask, bool scale_inertia) {
  nb::object keeps_values, keeps_mask;
  nb::object given = shaped(values);
  if (field == "gravity" && rank_of(given) < 3 && rank_of(given) > 0 && nb::cast<std::int64_t>(given.attr("shape")[-1]) == 3)
    given = given.attr("reshape")(-1, 1, 3);  // the world's own: there is one of it
  int const rank = rank_of(given);
  if (rank != 2 && rank != 3)
    throw Error("gsp.Data.set: values of '" + field + "' have " + std::to_string(rank) +
                " dimensions and must be (worlds, items, components), or (worlds, items) of one component");
  runtime::Array const worlds = mask_of(d, mask, "gsp.Data.set", keeps_mask);
  nb::object const numpy = nb::module_::import_("numpy");
  bool const on_gpu = nb::isinstance<Array>(given) ? nb::cast<Array const&>(given).array.device != runtime::Device::cpu
                                                   : nb::hasattr(given, "__cuda_array_interface__");
  // Rows of the worlds of the mask alone go where they belong.
  auto const rows = nb::cast<std::int64_t>(given.attr("shape")[0]);
  if (worlds && rows != 1 && rows != d.worlds) {
    nb::object const chosen = nb::object(numpy_copy(worlds)).attr("astype")("bool");
    auto const count = nb::cast<std::int64_t>(nb::int_(chosen.attr("sum")()));
    if (rows != count)
      throw Error("gsp.Data.set: values of '" + field + "' have " + std::to_string(rows) + " rows and must have " +
                  std::to_string(d.worlds) + ", one for each world, or " + std::to_string(count) +
                  ", one for each world of the mask, or one for all of them");
    nb::list shape;
    for (nb::handle const n : given.attr("shape")) shape.append(n);
    shape[0] = d.worlds;
    if (on_gpu && !nb::hasattr(given, "new_zeros"))
      throw Error("gsp.Data.set: rows of the mask's worlds alone are taken from torch and NumPy: give values of all worlds");
    nb::object const rows_given = on_gpu ? given : nb::object(numpy.attr("asarray")(given));
    nb::object const all =
        on_gpu ? given.attr("new_zeros")(nb::tuple(shape)) : nb::object(numpy.attr("zeros")(nb::tuple(shape), rows_given.attr("dtype")));
    all[chosen] = rows_given;
    given = all;
  }
  runtime::Array const from =
      rank == 2 ? taken(given, field.c_str(), {-1, -1}, keeps_values) : taken(given, field.c_str(), {-1, -1, -1}, keeps_values);
  nb::object keeps_numbers;
  if (!on_gpu && d.device == runtime::Device::cpu && (from.extents[0] == 1 || from.extents[0] == d.worlds)) {
    keeps_numbers = numpy.attr("ascontiguousarray")(given, nb::arg("dtype") = "float64");
    nb::object own[2], mask_there = nb::none();
    if (worlds) mask_there = numpy_copy(worlds);
    auto const numbers =
        rank == 2 ? taken(keeps_numbers, field.c_str(), {-1, -1}, own[0]) : taken(keeps_numbers, field.c_str(), {-1, -1, -1}, own[0]);
    auto const chosen = taken(mask_there, "gsp.Data.set: mask", {d.worlds}, own[1]);
    expect_values(d, field, numbers, static_cast<int const*>(chosen.data));
  }
  Use const use(d);
  OthersRun const others_run;
  d.stepper->set_world_values(field, from, worlds, scale_inertia);
}

/// One world of what `save` gives, as arrays of one world.
nb::dict world_of(nb::dict const& saved, int world) {
  nb::object const numpy = nb::module_::import_("numpy");
  auto const number = [&](char const* name) { return nb::cast<std::int64_t>(nb::int_(nb::object(saved[name])[world])); };
  std::int64_t const first = number("impulses.first"), end = first + number("impulses.count") + number("impulses.kept");
  nb::dict out;
  for (auto const& [key, array] : saved) {
    auto const name = nb::cast<std::string>(key);
    bool const pool = name == "impulses.p" || name == "impulses.id" || name == "impulses.place";
    nb::object const rows = pool ? nb::object(nb::slice(nb::int_(first), nb::int_(end), nb::none()))
                                 : nb::object(nb::slice(nb::int_(world), nb::int_(world + 1), nb::none()));
    out[key] = name == "version" ? nb::borrow(array) : nb::object(nb::borrow(array)[rows].attr("copy")());
  }
  nb::object const zero_at = out["impulses.first"];
  zero_at[nb::int_(0)] = 0;
  return out;
}

/// First byte, and the one behind the last, of what the array may read.
std::pair<std::uintptr_t, std::uintptr_t> bytes_of(runtime::Array const& a) {
  std::int64_t first = 0, last = 0;
  for (int k = 0; k < a.rank; ++k)
    (a.strides[std::size_t(k)] < 0 ? first : last) += (a.extents[std::size_t(k)] - 1) * a.strides[std::size_t(k)];
  auto const at = reinterpret_cast<std::uintptr_t>(a.data);
  std::int64_t const size = runtime::bytes_of(a.dtype);
  return {at + std::uintptr_t(first * size), at + std::uintptr_t((last + 1) * size)};
}
bool share_memory(runtime::Array const& a, runtime::Array const& b) {
  auto const p = bytes_of(a), q = bytes_of(b);
  return a.device == b.device && a.size() > 0 && b.size() > 0 && p.first < q.second && q.first < p.second;
}
bool are_one(runtime::Array const& a, runtime::Array const& b) {
  return a.data == b.data && a.device == b.device && a.dtype == b.dtype && a.rank == b.rank && a.extents == b.extents &&
         a.strides == b.strides;
}
/// f(numbers that `to` may take): of those that lie in its own memory a copy, and nothing if they are `to` itself, as after
/// `data.qvel += x`, which has written already.
template <class F>
void assign(runtime::Array const& to, runtime::Array const& from, F const& f) {
  if (to.size() == 0 || are_one(to, from)) return;
  if (!share_memory(to, from)) return f(from);
  auto const between = runtime::make_buffer(from.device, from.dtype,
                                            {from.extents[0], from.rank > 1 ? from.extents[1] : 1, from.rank > 2 ? from.extents[2] : 1});
  runtime::Array own = between.array;
  own.rank = from.rank;
  runtime::copy(from, own);
  f(own);
}

}  // namespace

void bind_data(nb::module_& m) {
  nb::class_<runtime::StepCounts>(m, "StepCounts", "What the last step met.")
      .def_ro("contacts", &runtime::StepCounts::contacts, "Of all worlds.")
      .def_ro("rows", &runtime::StepCounts::rows, "Constraint rows of all worlds.")
      .def_ro("iterations", &runtime::StepCounts::iterations, "Most of any world.")
      .def_ro("mean_iterations", &runtime::StepCounts::mean_iterations)
      .def_ro("unfinished_worlds", &runtime::StepCounts::unfinished_worlds, "Whose solver made all the iterations that it may.")
      .def_ro("failed_worlds", &runtime::StepCounts::failed_worlds, "That stopped; data.status says why.")
      .def("__repr__", [](runtime::StepCounts const& n) {
        return "gsp.StepCounts(contacts=" + std::to_string(n.contacts) + ", rows=" + std::to_string(n.rows) +
               ", iterations=" + std::to_string(n.iterations) + ", mean_iterations=" + text_of(nb::float_(n.mean_iterations)) +
               ", unfinished_worlds=" + std::to_string(n.unfinished_worlds) + ", failed_worlds=" + std::to_string(n.failed_worlds) + ")";
      });
  struct Contacts {
    Array world, geom1, geom2, dist, pos, frame, force;
  };
  nb::class_<Contacts>(m, "Contacts", "Contacts of the last step, those of world 0 first; copies that stay as they are.")
      .def_ro("world", &Contacts::world, "(n) int32")
      .def_ro("geom1", &Contacts::geom1, "(n) int32")
      .def_ro("geom2", &Contacts::geom2, "(n) int32")
      .def_ro("dist", &Contacts::dist, "(n) [m], negative inside")
      .def_ro("pos", &Contacts::pos, "(n, 3) [m]")
      .def_ro("frame", &Contacts::frame, "(n, 9) rows normal (geom1 to geom2), two tangents")
      .def_ro("force", &Contacts::force, "(n, 6) on geom2 along the frame's rows [N], about them [N m]")
      .def("__len__", [](Contacts const& c) { return c.world.array.extents[0]; })
      .def("__repr__", [](Contacts const& c) { return "gsp.Contacts(" + std::to_string(c.world.array.extents[0]) + ")"; });

  auto c = nb::class_<Data>(m, "Data", "Worlds of a model: every array is the memory that the kernels work on, its first index the world.");
  c.def(
      "__init__",
      [](Data* self, Model const& model, int worlds, std::string const& device, std::string const& profile, std::string const& precision,
         double timestep, int iterations, std::optional<double> tolerance, int threads, Names const& names) {
        if (nb::isinstance<nb::str>(names)) throw Error("gsp.Data: per_world is a list of names: give ['body_mass']");
        auto const per_world = nb::cast<std::vector<std::string>>(names);
        std::unique_ptr<Data> const made(
            make_data(model, worlds, device, profile, precision, timestep, iterations, tolerance, threads, per_world));
        new (self) Data(std::move(*made));
      },
      nb::arg("model"), nb::arg("worlds") = 1, nb::arg("device") = "cpu", nb::kw_only(), nb::arg("profile") = "stable",
      nb::arg("precision") = "float32", nb::arg("timestep") = 0., nb::arg("iterations") = 0, nb::arg("tolerance") = nb::none(),
      nb::arg("threads") = 0, nb::arg("per_world") = std::vector<std::string>{},
      "profile: 'stable', which holds still, or 'mujoco', MuJoCo's numbers. timestep [s], iterations, tolerance of the solver, threads of\n"
      "the CPU: 0 (tolerance: None) is the model's or the library's own. per_world: names of gsp.world_fields() whose values may differ "
      "from world "
      "to\n"
      "world, at first the model's: `set` changes them.");
  c.def_ro("worlds", &Data::worlds, "How many.");
  c.def_prop_ro(
      "model", [](Data const& d) { return nb::typed<nb::object, Model>(d.python_model); }, "gsp.Model that they are of.");
  c.def_prop_ro(
      "timestep", [](Data const& d) { return d.stepper->timestep(); }, "[s]");
  c.def_prop_ro(
      "threads", [](Data const& d) { return d.stepper->threads(); }, "Of the CPU that step; 0: a GPU does.");
  auto const of_state = [&](char const* name, runtime::Array runtime::StateArrays::*member, char const* what, bool positions = false) {
    c.def_prop_rw(
        name,
        [member, positions](Data const& d) {
          runtime::Array const a = d.stepper->state().*member;
          return positions ? given(d, a) : held(d, a);
        },
        [member, name](Data const& d, ArrayLike const& value) {
          runtime::Stepper& stepper = stepper_of(d);
          nb::object keeps;
          runtime::Array const to = stepper.state().*member;
          if (to.dtype == runtime::Dtype::int32 && to.device == runtime::Device::cpu && !nb::isinstance<Array>(value))
            nb::cast(held(d, to)).attr("__setitem__")(nb::ellipsis(), value);  // flags of whatever kind, as NumPy takes them
          else
            assign(to, shaped_as(to, name, value, keeps), [&](runtime::Array const& from) { runtime::copy(from, to); });
          stepper.set({}, {}, {});  // poses are brought up to date when they are asked for
        },
        nb::for_getter(what));
  };
  using S = runtime::StateArrays;
  c.def_prop_rw(
      "qpos", [](Data const& d) { return given(d, d.stepper->state().qpos); },
      [](Data const& d, ArrayLike const& value) {
        runtime::Stepper& stepper = stepper_of(d);
        nb::object keeps;
        runtime::Array const to = stepper.state().qpos, from = shaped_as(to, "qpos", value, keeps);
        assign(to, from, [&](runtime::Array const& other) { stepper.set(other, {}, {}); });
        stepper.set({}, {}, {});
      },
      nb::for_getter(
          "(worlds, nq) positions; quaternions w x y z. `data.qpos = x` takes float64 to its last digit (qpos_low); `data.qpos[...] = x`\n"
          "leaves qpos_low what it was: positions are qpos + qpos_low."));
  of_state("qpos_low", &S::qpos_low, "(worlds, nq) what rounding took from the positions, which are qpos + qpos_low.", true);
  of_state("qvel", &S::qvel, "(worlds, nv) velocities.");
  of_state("ctrl", &S::ctrl, "(worlds, nu) what the actuators are told.");
  of_state("act", &S::act, "(worlds, na) activations.");
  of_state("mocap_pos", &S::mocap_pos, "(worlds, nmocap, 3) of mocap bodies [m]; a reset puts them back.", true);
  of_state("mocap_quat", &S::mocap_quat, "(worlds, nmocap, 4)", true);
  of_state("qfrc_applied", &S::qfrc_applied, "(worlds, nv) forces of yours on the degrees of freedom [N, N m].");
  of_state("eq_active", &S::eq_active, "(worlds, neq) int32, not 0: this equality constraint acts. What sleeps is not woken by it.");
  c.def_prop_ro(
      "steps", [](Data const& d) { return held(d, d.stepper->state().steps); }, "(worlds) int64, steps done: time is steps * timestep.");
  c.def_prop_ro(
      "status", [](Data const& d) { return held(d, d.stepper->state().status); },
      "(worlds) uint32, 0: all is well. A world that stopped stays as it was: gsp.status_text says why, gsp.reset starts it again.");
  auto const of_poses = [&](char const* name, runtime::Array runtime::PoseArrays::*member, char const* what) {
    c.def_prop_ro(
        name, [member](Data const& d) { return held(d, fresh(d).poses().*member, write_positions); }, what);
  };
  using P = runtime::PoseArrays;
  of_poses("xpos", &P::xpos, "(worlds, nbody, 3) where bodies are [m], of the positions as they are when it is asked for.");
  of_poses("xquat", &P::xquat, "(worlds, nbody, 4)");
  of_poses("xanchor", &P::xanchor, "(worlds, njnt, 3) [m]");
  of_poses("xaxis", &P::xaxis, "(worlds, njnt, 3)");
  c.def_prop_ro(
      "qfrc_constraint", [](Data const& d) { return held(d, d.stepper->qfrc_constraint(), "write data.qfrc_applied"); },
      "(worlds, nv) what all constraints did in the last step [N, N m].");
  c.def_prop_ro(
      "sensordata", [](Data const& d) { return held(d, stepper_of(d).sensors(), "write data.qpos, or into a copy"); },
      "(worlds, nsensordata) in MuJoCo's layout, of the state as it is, evaluated when it is asked for. NaN where nobody evaluates a\n"
      "sensor: data.sensors_left_out says which.");
  c.def_prop_ro(
      "sensors_left_out",
      [](Data const& d) {
        std::vector<std::string> out;
        for (auto& sentence : stepper_of(d).sensors_left_out()) out.push_back(in_python(std::move(sentence)));
        return out;
      },
      "A sentence for each sensor that nobody evaluates, which says why; its numbers in sensordata are NaN.");
  c.def_prop_ro(
      "contacts",
      [](Data const& d) {
        auto const a = stepper_of(d).contacts();
        return Contacts{copied(d, a.world), copied(d, a.geom1), copied(d, a.geom2), copied(d, a.dist),
                        copied(d, a.pos),   copied(d, a.frame), copied(d, a.force)};
      },
      "Of the last step, at its start; none before the first step, and after `restore`. Worlds that were reset since have those of "
      "before.");
  c.def_prop_ro(
      "time",
      [](Data const& d) {
        nb::object const time = numpy_copy(d.stepper->state().steps) * nb::float_(d.stepper->timestep());
        time.attr("flags").attr("writeable") = false;
        return nb::borrow<NumpyArray>(time);
      },
      "(worlds) [s], steps * timestep; NumPy's own, for reading: data.steps is the kernels'.");
  c.def(
      "values",
      [](Data const& d, std::string const& field) {
        Array a = copied(d, stepper_of(d).world_values(field));
        a.array.read_only = true;  // `set` changes them
        return a;
      },
      nb::arg("field"),
      "(worlds, items, components) a copy, for reading, of the values of a field of per_world. Friction and softness of geoms that touch "
      "nothing: NaN.");
  c.def(
      "set",
      [](Data const& d, std::string const& field, ArrayLike const& values, ArrayLike const& mask, bool scale_inertia) {
        set(d, field, values, mask, scale_inertia);
      },
      nb::arg("field"), nb::arg("values"), nb::arg("mask").none() = nb::none(), nb::kw_only(), nb::arg("scale_inertia") = false,
      "Values of a field of per_world, (rows, items, components), or (rows, items) of one component, in the worlds of the mask (None: "
      "all):\n"
      "a row for each world, for each world of the mask, or one for all; and what follows from masses and geometry. scale_inertia: "
      "body_mass alone, whose body_inertia, per world too, changes\n"
      "in proportion. Pictures keep sizes and poses of the model, rangefinders its sizes. Resets leave the values alone.\n"
      "What MJCF refuses is an error; on a GPU nobody looks, and a bad value stops its world.");
  auto const of_dynamics = [&](char const* name, runtime::SmoothForces which, char const* what) {
    c.def_prop_ro(
        name, [which](Data const& d) { return copied(d, poser(d).smooth_forces(which)); }, what);
  };
  using F = runtime::SmoothForces;
  of_dynamics("qfrc_passive", F::passive,
              "(worlds, nv) springs, dampers, fluids, gravity compensation, of the state as it is [N, N m]; a copy.");
  of_dynamics("qfrc_actuator", F::actuator, "(worlds, nv) what the actuators do, of the state and controls as they are [N, N m]; a copy.");
  of_dynamics("qfrc_bias", F::bias, "(worlds, nv) Coriolis, centrifugal and gravity forces, of the state as it is [N, N m]; a copy.");
  of_dynamics("qacc_smooth", F::acceleration,
              "(worlds, nv) acceleration without constraints; profile 'stable': of the implicit step [m/s^2, rad/s^2]; a copy.");
  c.def(
      "mass_matrix", [](Data const& d) { return copied(d, poser(d).mass_matrix()); }, "(worlds, nv, nv) of the state as it is; a copy.");
  c.def(
      "jacobian",
      [](Data const& d, NameOrNumber const& body, NameOrNumber const& site, std::array<double, 3> const& point) {
        if (body.is_none() == site.is_none()) throw Error("gsp.Data.jacobian: give a body or a site, by name or number");
        if (!site.is_none() && point != std::array<double, 3>{})
          throw Error("gsp.Data.jacobian: a point is of a body; a site is one already");
        for (double const x : point)
          if (!std::isfinite(x)) throw Error("gsp.Data.jacobian: the point has a number that is not finite");
        bool const of_body = site.is_none();
        nb::handle const which = of_body ? body : site;
        int const id =
            nb::isinstance<nb::str>(which) ? id_of(d.model, of_body ? "body" : "site", nb::cast<std::string>(which)) : nb::cast<int>(which);
        return copied(d, of_body ? poser(d).body_jacobian(id, point) : poser(d).site_jacobian(id));
      },
      nb::kw_only(), nb::arg("body").none() = nb::none(), nb::arg("site").none() = nb::none(), nb::arg("point") = std::array<double, 3>{},
      "(worlds, 6, nv) of a point of a body, in its frame, or of a site: rows 0-2 velocity of the point, 3-5 angular, in world axes; a "
      "copy.");
  c.def(
      "inverse",
      [](Data const& d, ArrayLike const& qacc) {
        nb::object keeps;
        runtime::Array to = d.stepper->state().qvel;
        return copied(d, poser(d).inverse_dynamics(shaped_as(to, "gsp.Data.inverse: qacc", qacc, keeps)));
      },
      nb::arg("qacc"),
      "(worlds, nv) what actuators and applied forces must sum to for the accelerations qacc (worlds or 1, nv) without constraints:\n"
      "M qacc + qfrc_bias - qfrc_passive [N, N m]; a copy.");
  c.def(
      "cameras",
      [](Data const& d, Mounts const& mounts, int width, int height) {
        auto const specs = specs_of(mounts);
        if (width < 1 || height < 1) throw Error("gsp.Data.cameras: width and height must be positive");
        auto const a = named("gsp.Data.cameras", [&] { return fresh(d).cameras(specs, width, height); });
        auto const own = std::make_shared<CameraKeeper>(CameraKeeper{d.session, a.owner});
        Array Ks{a.Ks, own};
        Ks.picture = {width, height};
        return std::tuple(Array{a.viewmats, own}, Ks, Array{a.world, own});
      },
      nb::arg("mounts").none(), nb::arg("width") = 640, nb::arg("height") = 480,
      "What Renderer.render takes, (viewmats, Ks, world), for cameras of the model by name, or on bodies: dict(body='head', pos=(0.1, 0, "
      "0),\n"
      "quat=(1, 0, 0, 0), fovy=60), as MJCF has them: looking along -z, y up, fovy in degrees; target=(x, y, z) in place of quat: it "
      "looks\n"
      "at that point of the body's frame, z up. All worlds, in their poses as they are, on the data's device: image world * len(mounts) + "
      "k is of mount k. Each list of mounts of one size has arrays of its\n"
      "own, which the next call for the same writes, if it is one of the last 64 that were asked for.");
  c.def_prop_ro(
      "counts", [](Data const& d) { return stepper_of(d).counts(); }, "StepCounts of the last step.");
  c.def(
      "save",
      [](Data const& d, std::optional<int> world) {
        if (world && (*world < 0 || *world >= d.worlds))
          throw Error("gsp.Data.save: there is no world " + std::to_string(*world) + ": there are " + std::to_string(d.worlds) +
                      ", numbered from 0");
        nb::dict out;
        for (auto const& [name, array] : stepper_of(d).save()) out[name.c_str()] = numpy_copy(array);
        out["version"] = nb::module_::import_("numpy").attr("asarray")(runtime::snapshot_version);
        return nb::borrow<NumpyArrays>(world ? world_of(out, *world) : out);
      },
      nb::arg("world") = nb::none(),
      "All that the next step starts from, as a dict of NumPy arrays: state.qpos and its like, impulses, who sleeps, samples of late "
      "sensors.\n"
      "Not the values of per_world: `values` gives those. world: of this one alone.");
  c.def(
      "restore",
      [](Data const& d, Anything const& arrays, ArrayLike const& mask) {
        nb::object keeps_mask;
        runtime::Array const worlds = mask_of(d, mask, "gsp.Data.restore", keeps_mask);
        std::vector<runtime::NamedArray> list;
        nb::object const list_of = nb::module_::import_("builtins").attr("dict")(arrays);
        std::vector<nb::object> keeps;
        nb::object const numpy = nb::module_::import_("numpy");
        for (auto const& [name, value] : nb::borrow<nb::dict>(list_of)) {
          if (!nb::isinstance<nb::str>(name)) throw Error("gsp.Data.restore: the names are those that save gave, and one is no text");
          if (nb::cast<std::string>(name) == "version") {
            if (nb::cast<int>(nb::int_(value)) != runtime::snapshot_version)
              throw Error("gsp.Data.restore: another version of the library has saved this, with other constraints: save it anew");
            continue;
          }
          keeps.push_back(numpy.attr("ascontiguousarray")(value));
          nb::object own;
          std::vector<std::int64_t> const shape = nb::cast<std::vector<std::int64_t>>(keeps.back().attr("shape"));
          runtime::Array a;
          if (shape.size() == 1)
            a = taken(keeps.back(), nb::cast<std::string>(name).c_str(), {-1}, own);
          else if (shape.size() == 2)
            a = taken(keeps.back(), nb::cast<std::string>(name).c_str(), {-1, -1}, own);
          else
            a = taken(keeps.back(), nb::cast<std::string>(name).c_str(), {-1, -1, -1}, own);
          list.push_back({nb::cast<std::string>(name), a});
        }
        stepper_of(d).restore(list, worlds);
      },
      nb::arg("arrays"), nb::arg("mask").none() = nb::none(),
      "Goes on from what `save` gave, a dict or what numpy.load reads of a file: what follows is what would have followed, to the bit, "
      "where\n"
      "values of per_world are the same, which it leaves alone. Arrays of one world are given to all; mask (worlds): to these worlds "
      "alone,\n"
      "world k from row k. No world has contacts of the last step then.");
  c.def("__repr__", [](Data const& d) {
    return "gsp.Data(worlds=" + std::to_string(d.worlds) + ", device=" + (d.device == runtime::Device::cuda ? "cuda:0" : "cpu") + ")";
  });

  m.def(
      "step",
      [](Model const& model, Data const& d, int n) {
        expect_model(model, d, "gsp.step");
        step(d, n);
      },
      nb::arg("model"), nb::arg("data"), nb::arg("n") = 1,
      "n steps of all worlds. Other threads of Python run meanwhile; Ctrl-C ends it between two steps.");
  m.def(
      "forward",
      [](Model const& model, Data const& d) {
        expect_model(model, d, "gsp.forward");
        Use const use(d);
        OthersRun const others_run;
        d.stepper->forward();
        if (d.posed->given && d.device == runtime::Device::cpu) keep_positions(d);
      },
      nb::arg("model"), nb::arg("data"),
      "Poses of the state as it is, into the memory of data.xpos and its like, for who holds views of it: who asks data.xpos has them "
      "anyway.");
  m.def(
      "reset",
      [](Model const& model, Data const& d, ArrayLike const& mask, NameOrNumber const& keyframe) {
        expect_model(model, d, "gsp.reset");
        reset(d, mask, keyframe);
      },
      nb::arg("model"), nb::arg("data"), nb::arg("mask").none() = nb::none(), nb::arg("keyframe").none() = nb::none(),
      "Worlds of the mask (worlds; None: all) to the model's initial positions, or a keyframe's, by name or number: at rest, time 0, the\n"
      "status cleared.");
  m.def("world_fields", &runtime::world_fields, "Names of the fields that Data(..., per_world=[...]) takes.");
  m.def(
      "status_text", [](std::uint32_t bits) { return in_python(status::text(bits)); }, nb::arg("bits"), "What bits of data.status mean.");
}

}  // namespace gsp::python
