#include <nanobind/stl/array.h>
#include <nanobind/stl/filesystem.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <gsp/io/colormap.hpp>
#include <gsp/io/png.hpp>
#include <gsp/io/splat_transform.hpp>
#include <gsp/io/splats.hpp>
#include <gsp/runtime/renderer.hpp>
#include <limits>
#include <map>

#include "array.hpp"
#include "data.hpp"
#include "named.hpp"
#include "others_run.hpp"

namespace gsp::python {
namespace {

struct Scene {
  Model model;
  std::shared_ptr<runtime::Scene> sets = std::make_shared<runtime::Scene>();  // which renderers look at
};

std::string size_text(int width, int height) { return std::to_string(width) + " x " + std::to_string(height); }
/// A camera that was made for pictures of another size draws a part of what it should, or nothing.
void expect_size(std::string const& where, ArrayLike const& Ks, runtime::Array const& there, runtime::RendererOptions const& o) {
  if (nb::isinstance<Array>(Ks)) {
    auto const [width, height] = nb::cast<Array const&>(Ks).picture;
    if (width > 0 && (width != o.width || height != o.height))
      throw Error(where + ": the cameras are for pictures of " + size_text(width, height) + ", and the renderer makes " +
                  size_text(o.width, o.height) + ": give both the same width and height");
  }
  if (there.device != runtime::Device::cpu || there.dtype != runtime::Dtype::float32) return;
  for (std::int64_t c = 0; c < there.extents[0]; ++c) {
    auto const at = [&](int i, int j) {
      return static_cast<float const*>(there.data)[c * there.strides[0] + i * there.strides[1] + j * there.strides[2]];
    };
    float const x = at(0, 2), y = at(1, 2);
    if ((x > 0 && x < float(o.width) && y > 0 && y < float(o.height)) || !(std::abs(x) < 1e9f && std::abs(y) < 1e9f)) continue;
    std::string const text = where + ": camera " + std::to_string(c) + " looks past its picture: K has the centre at (" +
                             std::to_string(int(x)) + ", " + std::to_string(int(y)) + "), and the renderer makes " +
                             size_text(o.width, o.height) + ": give gsp.pinhole the renderer's width and height";
    if (PyErr_WarnEx(PyExc_UserWarning, text.c_str(), 1) != 0) throw nb::python_error();
    return;
  }
}

std::string short_text(double x) {
  char text[32];
  std::snprintf(text, sizeof text, "%g", x);
  return text;
}
/// Pictures that do not fit are refused, as a host gives more than it has and then ends the process. held: how many are let go for them.
void expect_memory(std::string const& where, runtime::Renderer const& renderer, runtime::Device device, std::int64_t pictures,
                   std::int64_t held = 0) {
  auto const bytes = [&](std::int64_t n) {
    return n > 0 ? double(named(where, [&] { return renderer.bytes_needed(static_cast<int>(n)); })) : 0.;
  };
  expect_free(where + ": " + std::to_string(pictures) + (pictures == 1 ? " picture needs" : " pictures need"), bytes(pictures),
              double(runtime::free_bytes(device)) + bytes(held), device, "draw smaller ones, or fewer cameras at a time");
}

/// The first of the numbers, one after the other, that is not finite; -1: none.
template <class R>
std::int64_t first_not_finite(runtime::Array const& a) {
  auto const* const x = static_cast<R const*>(a.data);
  int bad = 0;
  for (std::int64_t i = 0; i < a.size(); ++i) bad |= !(std::abs(x[i]) <= std::numeric_limits<R>::max());
  return bad ? std::find_if(x, x + a.size(), [](R v) { return !std::isfinite(v); }) - x : -1;
}
/// Bodies that are nowhere are in no picture. On a GPU nobody waits for an answer.
void warn_of_lost_bodies(std::string const& where, runtime::PoseArrays const& poses, CompiledModel const& model) {
  for (runtime::Array const& a : {poses.xpos, poses.xquat}) {
    if (a.device != runtime::Device::cpu) return;
    auto const at = a.dtype == runtime::Dtype::float64 ? first_not_finite<double>(a) : first_not_finite<float>(a);
    if (at < 0) continue;
    auto const row = at / a.extents[2];
    std::string const text = where + ": the pose of body '" + model.body_name[std::size_t(row % a.extents[1])] + "' of world " +
                             std::to_string(row / a.extents[1]) +
                             " is not finite, and no picture shows it: look at data.qpos, or reset the world";
    if (PyErr_WarnEx(PyExc_UserWarning, text.c_str(), 1) != 0) throw nb::python_error();
    return;
  }
}

/// Lenses of the last `render` that had some: one takes 0.4 ms to make, and they are the same from picture to picture as a rule.
struct KeptLenses {
  bool fisheye = false;
  std::vector<std::vector<double>> coefficients{};
  std::vector<Lens> lenses{};
};

/// Pictures of one scene. Where another number of them is asked for while Python has some, a renderer of its own makes them: arrays of the
/// one before stay what they are.
struct Renderer {
  std::shared_ptr<runtime::Session> session;
  std::shared_ptr<CompiledModel const> model;  // the scene's
  runtime::Device device;
  std::shared_ptr<runtime::Scene> scene;
  runtime::RendererOptions options;
  std::int64_t images = 0;                        // in `own`; 0: none yet
  std::vector<std::vector<int>> shown{};          // `show`: of each world
  std::shared_ptr<runtime::Scene::Sets> drawn{};  // what `own` has on the device: where the scene has more by now, it is made anew
  std::shared_ptr<runtime::Renderer> own{};
  bool told = false;  // that it draws the model's geoms
  KeptLenses kept{};
  std::shared_ptr<std::atomic<bool>> busy = std::make_shared<std::atomic<bool>>(false);
};
struct Keeper {
  std::shared_ptr<runtime::Session> session;
  std::shared_ptr<runtime::Renderer> renderer;
};
struct Frames {
  Array rgb, depth, alpha, median_depth, normals, ids, rgb8;
};

/// One whose pictures are not those that Python has, of what the scene has by now.
std::unique_ptr<runtime::Renderer> another(Renderer const& self) {
  if (self.scene->count() == 0) throw Error("gsp.Renderer: the scene is empty: add_room(), add_surface() or add_splats(path) to it first");
  if (self.own && self.drawn == self.scene->sets) return self.own->another();
  auto own = runtime::make_renderer(self.device, *self.scene, self.options);
  if (!self.shown.empty()) own->show_sets(self.shown);
  return own;
}

/// `own` has what the scene has by now.
void keep_up(Renderer& self) {
  if (self.own && self.drawn == self.scene->sets) return;
  self.own = another(self);
  self.drawn = self.scene->sets;
  self.images = 0;
}

/// OpenCV's coefficients, (C, n), or (1, n) or (n) for all.
std::vector<Lens> const& lenses_of(std::string const& where, KeptLenses& kept, nb::object const& distortion, bool fisheye,
                                   std::int64_t cameras) {
  nb::object const rows = nb::module_::import_("numpy").attr("array")(distortion, nb::arg("dtype") = "float64", nb::arg("ndmin") = 2);
  auto lists = nb::cast<std::vector<std::vector<double>>>(rows.attr("tolist")());
  if (lists.size() != 1 && std::int64_t(lists.size()) != cameras)
    throw Error(where + ": distortion has " + std::to_string(lists.size()) + " rows for " + std::to_string(cameras) +
                " cameras: give one a camera, or one for all");
  if (kept.fisheye == fisheye && kept.coefficients == lists) return kept.lenses;
  // the map holds no NaN, of which no lens is made, and has an order; a list with NaN may be found in it as any other
  std::map<std::vector<double>, Lens> made;
  if (kept.fisheye == fisheye)
    for (std::size_t i = 0; i < kept.lenses.size(); ++i) made.emplace(kept.coefficients[i], kept.lenses[i]);
  std::vector<Lens> lenses;
  for (auto const& list : lists) {
    auto const there = made.find(list);
    if (there != made.end() && there->first == list) {
      lenses.push_back(there->second);
    } else {
      lenses.push_back(named(where + ": distortion", [&] { return fisheye ? fisheye_lens(list) : opencv_lens(list); }));
      made.emplace(list, lenses.back());
    }
  }
  kept = {fisheye, std::move(lists), std::move(lenses)};
  return kept.lenses;
}

/// Worlds of cameras, which a cast would make others of; on a GPU the kernels look whether they are there.
nb::object worlds_of(std::string const& of, nb::handle world, int worlds) {
  std::string const where = of + ": world";
  bool const on_gpu = nb::isinstance<Array>(world) ? nb::cast<Array const&>(world).array.device != runtime::Device::cpu
                                                   : nb::hasattr(world, "__cuda_array_interface__");
  if (on_gpu) return nb::borrow(world);
  nb::object const numpy = nb::module_::import_("numpy"), given = numpy.attr("asarray")(world);
  auto const text = [](nb::object const& x) { return nb::cast<std::string>(nb::str(x)); };
  std::string const kind = nb::cast<std::string>(given.attr("dtype").attr("kind"));
  if (kind != "i" && kind != "u") throw Error(where + " holds " + text(given.attr("dtype")) + ": give a whole number for each camera");
  if (nb::cast<std::int64_t>(given.attr("size")) > 0)
    for (char const* const end : {"min", "max"})
      if (nb::object const number = given.attr(end)(); number < nb::int_(0) || number >= nb::int_(worlds))
        throw Error(where + " names world " + text(number) + ", and the data have " + std::to_string(worlds) + ", numbered from 0");
  return numpy.attr("ascontiguousarray")(given, nb::arg("dtype") = "int32");
}

/// One for all `count`.
runtime::Array all_of(runtime::Array a, std::int64_t count) {
  for (int d = a.rank; d > 0; --d) {
    a.extents[std::size_t(d)] = a.extents[std::size_t(d - 1)];
    a.strides[std::size_t(d)] = a.strides[std::size_t(d - 1)];
  }
  ++a.rank;
  a.extents[0] = count;
  a.strides[0] = 0;
  return a;
}

/// A dict that `render` takes, such as develop=dict(noise=0.02): who reads a word crosses it off, and what is left nobody knows.
class Given {
 public:
  Given(nb::handle words, std::string where) : where_(std::move(where)) {
    if (!PyDict_Check(words.ptr())) throw Error(where_ + " is " + text(words) + ": give a dict, such as dict(seed=1)");
    left_ = nb::cast<nb::dict>(words.attr("copy")());
  }
  /// What is said of `name`, or nothing.
  nb::object take(char const* name) {
    names_ += (names_.empty() ? "" : ", ") + std::string(name);
    return left_.attr("pop")(name, nb::none());
  }
  void number(char const* name, float& to) {
    nb::object const given = take(name);
    if (!given.is_none()) to = number_of(given, name);
  }
  float number_of(nb::handle given, char const* name) const {
    double const x = PyFloat_AsDouble(given.ptr());
    if (PyErr_Occurred() == nullptr) return static_cast<float>(x);
    PyErr_Clear();
    throw Error(where_ + ": " + name + " is " + text(given) + ": give a number of 0 or more");
  }
  template <class T>
  void whole(char const* name, T& to) {
    nb::object const given = take(name);
    if (given.is_none()) return;
    nb::object const number = nb::steal(PyNumber_Index(given.ptr()));
    PyErr_Clear();
    if (!number.is_valid() || !nb::try_cast(number, to))
      throw Error(where_ + ": " + name + " is " + text(given) + ": give a whole number of 64 bits, 0 or more");
  }
  /// What chance is drawn of, one for all pictures; false where nothing is said.
  template <class Options>
  bool chance(Options& o) {
    std::size_t const before = left_.size();
    whole("seed", o.seed);
    whole("step", o.step);
    whole("first_image", o.first_image);
    return left_.size() < before;
  }
  void end() const {
    for (auto const& [name, value] : left_) throw Error(where_ + " has no " + text(name) + ": give " + names_);
  }

 private:
  static std::string text(nb::handle x) { return nb::cast<std::string>(nb::repr(x)); }
  std::string where_, names_;
  nb::dict left_;
};

/// Rows of seed, step and number, (C, 3), in place of a seed and a step for all. alone: nothing says those.
runtime::Array chance_of(nb::handle given, std::string const& where, bool alone, nb::object& keeps) {
  if (given.is_none()) return {};
  if (!alone) throw Error(where + " says seed, step and number of each picture: leave seed, step and first_image out");
  if (nb::isinstance<Array>(given) || nb::hasattr(given, "__cuda_array_interface__")) return taken(given, where.c_str(), {-1, 3}, keeps);
  nb::object const rows = nb::module_::import_("numpy").attr("asarray")(given);
  auto const text = [](nb::object const& x) { return nb::cast<std::string>(nb::str(x)); };
  std::string const kind = nb::cast<std::string>(rows.attr("dtype").attr("kind"));
  if ((kind != "i" && kind != "u") || nb::cast<int>(rows.attr("ndim")) != 2)
    throw Error(where + " is " + text(rows.attr("dtype")) + " of shape " + text(rows.attr("shape")) +
                ": give (C, 3) whole numbers, seed, step and number of each picture");
  constexpr std::int64_t most[] = {0, (std::int64_t(1) << 56) - 1, (std::int64_t(1) << 32) - 1};
  constexpr char const* names[] = {"seed", "step", "number"};
  runtime::Array const a = taken(rows.attr("astype")("int64"), where.c_str(), {-1, 3}, keeps);
  for (std::int64_t i = 0; i < a.extents[0]; ++i)
    for (int k = 1; k < 3; ++k)  // all bits of a seed are its own
      if (auto const x = static_cast<std::int64_t const*>(a.data)[i * a.strides[0] + k * a.strides[1]]; x < 0 || x > most[k])
        throw Error(where + ": the " + names[k] + " of picture " + std::to_string(i) + " is " + std::to_string(x) +
                    ": give a whole number from 0 to " + std::to_string(most[k]));
  return a;
}

/// What DrawOptions look at.
struct Kept {
  nb::object background, chance, light_chance, jitter_chance;
};

void develop_of(nb::handle words, std::string const& of, runtime::RendererOptions const& o, runtime::DrawOptions& to, Kept& keeps) {
  if (!o.rgb8) throw Error(of + ": develop is of rgb8, which this renderer does not make: gsp.Renderer(..., rgb8=True)");
  Given given(words, of + ": develop");
  given.number("exposure", to.develop.exposure);
  given.number("contrast", to.develop.contrast);
  given.number("brightness", to.develop.brightness);
  given.number("noise", to.develop.noise);
  nb::object background = given.take("background");
  nb::object const chance = given.take("chance"), light = given.take("light_chance");
  bool const alone = !given.chance(to.develop);
  given.end();
  to.chance = chance_of(chance, of + ": develop: chance", alone, keeps.chance);
  to.light_chance = chance_of(light, of + ": develop: light_chance", true, keeps.light_chance);
  if (background.is_none()) return;
  std::string const where = of + ": develop: background";
  if (!nb::isinstance<Array>(background) && !nb::hasattr(background, "__cuda_array_interface__"))
    background = nb::module_::import_("numpy").attr("asarray")(background);
  int const rank = nb::cast<int>(background.attr("ndim"));
  if (rank == 1) {
    nb::list const colour = nb::cast<nb::list>(background.attr("tolist")());
    if (colour.size() != 3) throw Error(where + " has " + std::to_string(colour.size()) + " numbers: give a colour of 3");
    for (std::size_t k = 0; k < 3; ++k) {
      float const c = to.develop.background[int(k)] = given.number_of(colour[k], "background");
      if (c > 1) throw Error(where + " is " + short_text(c) + ": give numbers of 0 to 1 (those of 8 bits divided by 255)");
    }
    return;
  }
  to.background = rank == 3 ? all_of(taken(background, where.c_str(), {o.height, o.width, 3}, keeps.background), 1)
                            : taken(background, where.c_str(), {-1, o.height, o.width, 3}, keeps.background);
  if (to.background.dtype != runtime::Dtype::float32 && to.background.dtype != runtime::Dtype::float64)
    throw Error(where + " holds whole numbers: give real ones of 0 to 1 (those of 8 bits divided by 255)");
  if (to.background.device != runtime::Device::cpu || to.background.size() == 0) return;  // on a GPU nobody waits for an answer
  nb::object const numpy = nb::module_::import_("numpy"), numbers = numpy.attr("asarray")(background);
  double const least = nb::cast<double>(numbers.attr("min")()), most = nb::cast<double>(numbers.attr("max")());
  if (!(least >= 0 && std::isfinite(most)))  // light may be above 1
    throw Error(where + " holds " + short_text(least >= 0 ? most : least) + ": give numbers of 0 and above, 1 for full light");
}

void jitter_of(nb::handle words, runtime::DrawOptions& to, Kept& keeps) {
  Given given(words, "gsp.Renderer.render: jitter");
  JitterCamerasOptions& out = to.jitter;
  given.number("position", out.position);
  given.number("rotation", out.rotation);
  given.number("focal", out.focal);
  given.number("principal", out.principal);
  nb::object const chance = given.take("chance");
  bool const alone = !given.chance(out);
  given.end();
  to.jitter_chance = chance_of(chance, "gsp.Renderer.render: jitter: chance", alone, keeps.jitter_chance);
}

/// Cameras that were given, and what holds their memory.
struct GivenCameras {
  runtime::CameraArrays arrays;
  nb::object keeps[3];
  std::int64_t count() const { return arrays.viewmats.extents[0]; }
};
GivenCameras cameras_of(std::string const& where, Renderer& self, Data const& data, ArrayLike const& viewmats, ArrayLike const& Ks,
                        ArrayLike const& world, ArrayLike const& distortion, bool fisheye) {
  if (data.model.compiled != self.model) throw Error(where + ": the data are of another model than the scene: make both of one gsp.Model");
  if (data.device != self.device) throw Error(where + ": the data and the renderer are on different devices: make both on one");
  GivenCameras given;
  nb::object const numpy = nb::module_::import_("numpy");
  auto const floats = [&](nb::handle x) -> nb::object {
    if (nb::isinstance<Array>(x) || nb::hasattr(x, "__cuda_array_interface__")) return nb::borrow(x);
    return numpy.attr("ascontiguousarray")(x, nb::arg("dtype") = "float32");
  };
  auto& [cameras, keeps] = given;
  nb::object const v = floats(viewmats), k = floats(Ks);
  auto const one = [](nb::object const& x) { return nb::cast<int>(x.attr("ndim")) == 2; };
  cameras.viewmats = one(v) ? all_of(taken(v, (where + ": viewmats").c_str(), {4, 4}, keeps[0]), 1)
                            : taken(v, (where + ": viewmats").c_str(), {-1, 4, 4}, keeps[0]);
  std::int64_t const n = cameras.viewmats.extents[0];
  if (n == 0) throw Error(where + ": viewmats are of no camera: give one or more");
  cameras.Ks =
      one(k) ? all_of(taken(k, (where + ": Ks").c_str(), {3, 3}, keeps[1]), n) : taken(k, (where + ": Ks").c_str(), {-1, 3, 3}, keeps[1]);
  if (auto& Ks = cameras.Ks; Ks.extents[0] == 1) {
    Ks.extents[0] = n;
    Ks.strides[0] = 0;
  } else if (Ks.extents[0] != n) {
    throw Error(where + ": there are " + std::to_string(Ks.extents[0]) + " Ks for " + std::to_string(n) +
                " cameras: give one a camera, or one for all");
  }
  if (!world.is_none()) {
    cameras.world = taken(worlds_of(where, world, data.worlds), (where + ": world").c_str(), {n}, keeps[2]);
    if (cameras.world.dtype != runtime::Dtype::int32) throw Error(where + ": world on a GPU must hold int32, one for each camera");
  }
  if (data.moves_geoms && self.scene->surface && !self.told) {
    self.told = true;
    if (PyErr_WarnEx(
            PyExc_UserWarning,
            "gsp.Renderer: Gaussians of add_surface keep the model's sizes and poses of geoms: geom_size, geom_pos and geom_quat of "
            "per_world are what contacts see, and no picture shows them",
            1) != 0)
      throw nb::python_error();
  }
  if (!distortion.is_none())
    cameras.lenses = lenses_of(where, self.kept, nb::borrow(distortion), fisheye, n);
  else if (fisheye)
    throw Error(where + ": fisheye=True needs distortion=[k1, k2, k3, k4]; zeros are the ideal fisheye");
  expect_size(where, Ks, cameras.Ks, self.options);
  return given;
}

/// Drawn by a renderer that is held: what Python has of it.
Frames frames_of(std::shared_ptr<runtime::Session> const& session, std::shared_ptr<runtime::Renderer> const& own) {
  auto const f = own->frames();
  auto const owner = std::make_shared<Keeper>(Keeper{session, own});
  return {{f.rgb, owner}, {f.depth, owner}, {f.alpha, owner}, {f.median_depth, owner}, {f.normals, owner}, {f.ids, owner}, {f.rgb8, owner}};
}

Frames render(Renderer& self, Data const& data, ArrayLike const& viewmats, ArrayLike const& Ks, ArrayLike const& world,
              ArrayLike const& distortion, bool fisheye, GivenWords const& develop, GivenWords const& jitter) {
  auto const cameras = cameras_of("gsp.Renderer.render", self, data, viewmats, Ks, world, distortion, fisheye);
  std::int64_t const n = cameras.count();
  Kept keeps;
  runtime::DrawOptions options;
  if (!develop.is_none()) develop_of(develop, "gsp.Renderer.render", self.options, options, keeps);
  if (!jitter.is_none()) jitter_of(jitter, options, keeps);
  Use const use(data), use_renderer(self.busy, "this renderer");
  // pictures that Python still has stay what they are
  bool const anew = !self.own || (self.images != n && self.images > 0 && self.own.use_count() > 1) || self.drawn != self.scene->sets;
  std::shared_ptr<runtime::Renderer> const own = anew ? another(self) : self.own;
  if (anew || self.images != n) {
    expect_memory("gsp.Renderer.render", *own, self.device, n, anew ? 0 : self.images);
    if (!anew) self.images = 0;  // they are let go before the new ones are there
  }
  freshen(data);
  auto const poses = data.stepper->poses();
  warn_of_lost_bodies("gsp.Renderer.render", poses, *self.model);
  {
    OthersRun const others_run;
    named("gsp.Renderer.render", [&] { own->render(poses, cameras.arrays, options); });
  }
  self.own = own;  // where a call is refused, the pictures of the one before stay in their place
  self.drawn = self.scene->sets;
  self.images = n;
  return frames_of(self.session, self.own);
}

/// Pictures of cameras that stand still.
struct FixedRenderer {
  std::shared_ptr<runtime::Session> session;
  std::shared_ptr<CompiledModel const> model;
  runtime::Device device;
  runtime::RendererOptions options;
  int worlds;
  std::shared_ptr<runtime::Renderer> own;
  std::shared_ptr<std::atomic<bool>> busy = std::make_shared<std::atomic<bool>>(false);
};
FixedRenderer fixed(Renderer& self, Data const& data, ArrayLike const& viewmats, ArrayLike const& Ks, ArrayLike const& world,
                    ArrayLike const& distortion, bool fisheye) {
  if (self.options.median_depth || self.options.ids)
    throw Error(
        "gsp.Renderer.fixed: cameras that stand still have no median_depth and no ids: make a Renderer without them, or draw with render");
  auto const cameras = cameras_of("gsp.Renderer.fixed", self, data, viewmats, Ks, world, distortion, fisheye);
  Use const use(data), use_renderer(self.busy, "this renderer");
  freshen(data);
  auto const poses = data.stepper->poses();
  warn_of_lost_bodies("gsp.Renderer.fixed", poses, *self.model);
  keep_up(self);
  FixedRenderer out{self.session, self.model, self.device, self.options, data.worlds, self.own->another()};
  expect_memory("gsp.Renderer.fixed", *out.own, self.device, cameras.count());
  {
    OthersRun const others_run;
    named("gsp.Renderer.fixed", [&] { out.own->fix(poses, cameras.arrays); });
  }
  return out;
}
Frames render_fixed(FixedRenderer& self, Data const& data, GivenWords const& develop) {
  if (data.model.compiled != self.model || data.worlds != self.worlds)
    throw Error("gsp.FixedRenderer.render: the data are not of the model and the " + std::to_string(self.worlds) +
                " worlds that it was made for: make another, gsp.Renderer.fixed");
  if (data.device != self.device)
    throw Error("gsp.FixedRenderer.render: the data and the renderer are on different devices: make both on one");
  runtime::DrawOptions options;
  Kept keeps;
  if (!develop.is_none()) develop_of(develop, "gsp.FixedRenderer.render", self.options, options, keeps);
  Use const use(data), use_renderer(self.busy, "this renderer");
  freshen(data);
  auto const poses = data.stepper->poses();
  warn_of_lost_bodies("gsp.FixedRenderer.render", poses, *self.model);
  {
    OthersRun const others_run;
    named("gsp.FixedRenderer.render", [&] { self.own->render_fixed(poses, options); });
  }
  auto frames = frames_of(self.session, self.own);
  for (Array* a : {&frames.rgb, &frames.depth, &frames.alpha}) a->computed = "copy() it, and write into that";
  return frames;
}

Array asked_for(Array const& channel, std::string const& name) {
  if (!channel.array)
    throw Error("the pictures have no " + name + ": ask for it, gsp.Renderer(..., " + name + "=True)" +
                (name == "ids" || name == "median_depth" ? "; cameras that stand still have none" : ""));
  return channel;
}

}  // namespace

void bind_renderer(nb::module_& m) {
  nb::class_<Scene>(m, "Scene", "Sets of Gaussians that are drawn together: rooms that stand, and what moves with the links of a model.")
      .def(
          "__init__", [](Scene* self, Model const& model) { new (self) Scene{model}; }, nb::arg("model"))
      .def(
          "add_splats",
          [](Scene& s, std::filesystem::path const& path, std::array<double, 3> const& pos, std::array<double, 4> const& quat, double scale,
             std::string const& body) {
            auto set = io::read_splats(path);
            if (!body.empty() && std::any_of(set.link.begin(), set.link.end(), [](int link) { return link >= 0; }))
              throw Error("gsp.Scene.add_splats: " + path.string() + " says itself which link its Gaussians move with: leave body out");
            io::SplatPose const pose{pos, quat, scale};
            if (pos != std::array<double, 3>{} || quat != std::array<double, 4>{1, 0, 0, 0} || scale != 1)
              named("gsp.Scene.add_splats", [&] { io::transform(set, pose); });
            if (!body.empty() && id_of(s.model, "body", body) > 0) {
              set.link_names = {body};
              set.link.assign(set.size(), 0);
            }
            s.sets->add_set(set, path.string(), *s.model.compiled);
            return &s;
          },
          nb::arg("path"), nb::kw_only(), nb::arg("pos") = std::array<double, 3>{0, 0, 0},
          nb::arg("quat") = std::array<double, 4>{1, 0, 0, 0}, nb::arg("scale") = 1., nb::arg("body") = "",
          nb::rv_policy::reference_internal,
          "Gaussians of a file (PLY, SPZ, SOG, splat, glTF, USD); its links are those of the model. body: all of them move with this one, "
          "and\n"
          "pos and quat are in its frame. What is bound to none stands at x -> scale R x + pos, R of "
          "the\n"
          "quaternion w x y z: captures have y down as a rule, which quat=(0.5**0.5, -0.5**0.5, 0, 0) turns to z up.")
      .def(
          "add_room",
          [](Scene& s) {
            s.sets->add_room();
            return &s;
          },
          nb::rv_policy::reference_internal,
          "The furnished room that the library makes: 6 m x 5.2 m, its floor at z = 0 and its middle at the origin, 2.7 m high.")
      .def(
          "add_surface",
          [](Scene& s) {
            s.sets->add_surface(*s.model.compiled);
            return &s;
          },
          nb::rv_policy::reference_internal, "Gaussians on the geoms of the model's moving bodies.")
      .def(
          "bounds",
          [](Scene const& s, double share) {
            if (!(share > 0 && share <= 1))
              throw Error("gsp.Scene.bounds: share is above 0 and at most 1, and is " + std::to_string(share));
            auto const b = s.sets->bounds(share);
            if (b.count == 0) throw Error("gsp.Scene.bounds: the scene has no Gaussians that stand: add_room() or add_splats(path) first");
            return nb::borrow<NumpyArray>(nb::module_::import_("numpy").attr("array")(nb::make_tuple(b.low, b.high)));
          },
          nb::arg("share") = 1.,
          "(2, 3) least and greatest coordinates [m] of the Gaussians that stand, those on links left out. share: of this part of them "
          "along each\n"
          "axis, the middle one, as captures have some that float far off: bounds(0.98).")
      .def("__len__", [](Scene const& s) { return s.sets->count(); })
      .def("__repr__", [](Scene const& s) {
        auto const b = s.sets->bounds(0.98);
        std::string text = "gsp.Scene(" + std::to_string(s.sets->count()) + " Gaussians";
        if (b.count == 0) return text + ")";
        auto const point = [](std::array<double, 3> const& p) {
          char buffer[96];
          std::snprintf(buffer, sizeof buffer, "(%.2f, %.2f, %.2f)", p[0], p[1], p[2]);
          return std::string(buffer);
        };
        return text + ", " + std::to_string(b.count) + " of them stand, 98 % from " + point(b.low) + " to " + point(b.high) + " m)";
      });
  nb::class_<Frames>(
      m, "Frames",
      "Pictures, float32 (ids int32, rgb8 uint8); they hold until the next `render`, which writes into the same memory, after `show` too.\n"
      "With another number of cameras, and once the scene has got more Gaussians, it makes new arrays: take them of what it returns;\n"
      "those from before keep what they show.")
      .def_prop_ro(
          "rgb", [](Frames const& f) { return asked_for(f.rgb, "rgb"); }, "(C, H, W, 3) on black, 0 and above")
      .def_prop_ro(
          "depth", [](Frames const& f) { return asked_for(f.depth, "depth"); }, "(C, H, W) expected depth [m]")
      .def_prop_ro(
          "median_depth", [](Frames const& f) { return asked_for(f.median_depth, "median_depth"); },
          "(C, H, W) depth at which half of a pixel's light is taken, as a LiDAR returns; 0: more comes through [m]")
      .def_prop_ro(
          "normals", [](Frames const& f) { return asked_for(f.normals, "normals"); },
          "(C, H, W, 3) unit normals in world axes, towards the camera, of median_depth where that is asked for, else of depth, which at "
          "edges\n"
          "mixes what lies behind; 0: the picture's edge, and where the pixel or a neighbour shows nothing")
      .def_prop_ro(
          "ids", [](Frames const& f) { return asked_for(f.ids, "ids"); },
          "(C, H, W) int32, body behind which half of a pixel's light is left or less, model.names('body')[i]; 0: what stands, the world; "
          "-1: more\n"
          "comes through")
      .def_prop_ro(
          "rgb8", [](Frames const& f) { return asked_for(f.rgb8, "rgb8"); },
          "(C, H, W, 3) uint8, rgb as `develop` of render changes it, from 0 to 255")
      .def_prop_ro(
          "alpha", [](Frames const& f) { return asked_for(f.alpha, "alpha"); }, "(C, H, W)")
      .def("__repr__", [](Frames const& f) {
        std::string text = "gsp.Frames(";
        std::pair<char const*, Array const*> const channels[] = {
            {"rgb", &f.rgb},   {"depth", &f.depth}, {"median_depth", &f.median_depth}, {"normals", &f.normals}, {"ids", &f.ids},
            {"rgb8", &f.rgb8}, {"alpha", &f.alpha}};
        for (auto const& [name, a] : channels) {
          if (!a->array) continue;
          text += (text.back() == '(' ? "" : ", ") + std::string(name) + " (";
          for (int k = 0; k < a->array.rank; ++k) text += (k == 0 ? "" : ", ") + std::to_string(a->array.extents[std::size_t(k)]);
          text += ")";
        }
        return text + ")";
      });
  nb::class_<FixedRenderer>(
      m, "FixedRenderer",
      "Pictures of cameras that stand still, bit by bit those of gsp.Renderer.render, which makes it: gsp.Renderer.fixed. Only what\n"
      "moves is drawn, and the blocks of pixels that it touches or has left.")
      .def_prop_ro("width", [](FixedRenderer const& r) { return r.options.width; })
      .def_prop_ro("height", [](FixedRenderer const& r) { return r.options.height; })
      .def("__repr__",
           [](FixedRenderer const& r) {
             return "gsp.FixedRenderer(" + size_text(r.options.width, r.options.height) + ", " + std::to_string(r.worlds) + " worlds)";
           })
      .def("render", &render_fixed, nb::arg("data"), nb::kw_only(), nb::arg("develop").none() = nb::none(),
           "The pictures of this moment; develop as of gsp.Renderer.render. Arrays are to be read: what nothing moves over is not written "
           "again.");
  nb::class_<Renderer>(m, "Renderer", "Pictures of a scene of Gaussians, one a camera, of all worlds in one call.")
      .def(
          "__init__",
          [](Renderer* self, Scene const& scene, int width, int height, std::string const& device, bool rgb, bool depth, bool alpha,
             bool median_depth, bool normals, bool ids, bool rgb8) {
            if (width < 1 || height < 1 || width > 65536 || height > 65536)
              throw Error("gsp.Renderer: width and height must be positive, 65536 at most, and are " + std::to_string(width) + " and " +
                          std::to_string(height));
            new (self) Renderer{session(),
                                scene.model.compiled,
                                device_of(device),
                                scene.sets,
                                {.width = width,
                                 .height = height,
                                 .rgb = rgb,
                                 .depth = depth,
                                 .alpha = alpha,
                                 .median_depth = median_depth,
                                 .normals = normals,
                                 .ids = ids,
                                 .rgb8 = rgb8}};
          },
          nb::arg("scene"), nb::arg("width") = 640, nb::arg("height") = 480, nb::arg("device") = "cpu", nb::kw_only(),
          nb::arg("rgb") = true, nb::arg("depth") = true, nb::arg("alpha") = true, nb::arg("median_depth") = false,
          nb::arg("normals") = false, nb::arg("ids") = false, nb::arg("rgb8") = false,
          "Pictures of width x height pixels; rgb, depth, alpha, median_depth, normals, ids, rgb8: which to make, as gsp.Frames has them.")
      .def_prop_ro("width", [](Renderer const& r) { return r.options.width; })
      .def_prop_ro("height", [](Renderer const& r) { return r.options.height; })
      .def("__repr__",
           [](Renderer const& r) {
             return "gsp.Renderer(" + size_text(r.options.width, r.options.height) +
                    ", device=" + (r.device == runtime::Device::cuda ? "cuda:0" : "cpu") + ")";
           })
      .def(
          "show",
          [](Renderer& self, std::vector<std::vector<int>> const& sets) {
            Use const use_renderer(self.busy, "this renderer");
            keep_up(self);
            named("gsp.Renderer.show", [&] { self.own->show_sets(sets); });
            self.shown = sets;
          },
          nb::arg("sets"),
          "Which sets of the scene each world shows from the next `render` on: a list of numbers for each world, 0 for what was added to "
          "the\n"
          "scene first. They are stored once, however many worlds show them. [] shows all of them everywhere, as at first.\n"
          "Pictures come into the memory in which they were.")
      .def("fixed", &fixed, nb::arg("data"), nb::arg("viewmats"), nb::arg("Ks"), nb::arg("world").none() = nb::none(),
           nb::arg("distortion").none() = nb::none(), nb::arg("fisheye") = false,
           "A gsp.FixedRenderer: these cameras stand still, and what they see of what stands is drawn once, here: Gaussians of the world,\n"
           "while bodies that are welded to it count as moving. Cameras of one place share that. It shows the scene's sets as they are\n"
           "shown now, to as many worlds as data has. The arguments are those of render.")
      .def("render", &render, nb::arg("data"), nb::arg("viewmats"), nb::arg("Ks"), nb::arg("world").none() = nb::none(),
           nb::arg("distortion").none() = nb::none(), nb::arg("fisheye") = false, nb::kw_only(), nb::arg("develop").none() = nb::none(),
           nb::arg("jitter").none() = nb::none(),
           "viewmats: (C, 4, 4), or (4, 4), world to camera, x right, y down, z ahead; Ks: (C, 3, 3), or (3, 3) or (1, 3, 3) for all "
           "[pixel];\n"
           "world: (C) int32, or None: camera c shows world c % worlds; distortion: OpenCV's coefficients, (C, n), or (n) or (1, n) for "
           "all,\n"
           "n = 4, 5 or 8: k1 k2 p1 p2 k3 k4 k5 k6, or None: pinholes; fisheye: they are k1 k2 k3 k4 of OpenCV's fisheye, whose zeros are\n"
           "the ideal one.\n"
           "develop: how rgb8 comes of rgb: dict(exposure=0.5, contrast=0.2, brightness=0.1, noise=0.02, background=(0.6, 0.7, 0.9), "
           "seed=1,\n"
           "step=k), all 0 unless given: c += (1 - alpha) background; c *= 2^e; c = (c - 1/2)(1 + k) + 1/2 + b + n, cut to 0 to 1; e, k "
           "and b\n"
           "uniform from -x to x of exposure, contrast (at most 1) and brightness for each picture, n normal noise of that deviation for "
           "each\n"
           "number, drawn of seed, step and the picture's number, counted from first_image, or, where chance is given, (C, 3) whole "
           "numbers, of\n"
           "each picture's own seed, step and number (gsp.Task.chance makes them), and e, k and b of light_chance, where that is; "
           "background: a colour, or a picture (H, W, 3), "
           "or\n"
           "(C, H, W, 3), of real numbers, 1 for full light.\n"
           "jitter: cameras that are not quite where they are said to be: dict(position=0.01, rotation=0.01, focal=0.02, principal=3, "
           "seed=1,\n"
           "step=k): each camera is moved along its axes [m], turned by a rotation vector [rad], its focal length changed by a share "
           "(below\n"
           "1) and its centre [pixel], by numbers of its own from -x to x, drawn of seed, step (of an episode, or of a picture where it\n"
           "shakes) and the picture's number, or of chance, (C, 3), as above; arrays that you gave stay what they are.");
  m.def("_depth_to_rgb", [](nb::bytes const& depth, int width, int height, float near, float far) {
    auto const bitmap = io::depth_to_color(reinterpret_cast<float const*>(depth.c_str()), width, height, {.near = near, .far = far});
    return nb::bytes(reinterpret_cast<char const*>(bitmap.pixels.data()), bitmap.pixels.size());
  });
  // (height, width, channels) of uint8, or of float32, four times as many bytes
  m.def("_write_png", [](std::string const& path, nb::bytes const& pixels, int width, int height, int channels) {
    auto const* const first = reinterpret_cast<std::uint8_t const*>(pixels.c_str());
    std::size_t const count = std::size_t(width) * std::size_t(height) * std::size_t(channels);
    if (pixels.size() == count) return io::write_png(path, io::Bitmap8{width, height, channels, {first, first + count}});
    io::write_png(path, io::to_bitmap8(reinterpret_cast<float const*>(first), width, height, channels));
  });
}

}  // namespace gsp::python
