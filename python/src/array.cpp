#include "array.hpp"

#include <nanobind/stl/optional.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>
#include <pthread.h>

#include <gsp/core/check.hpp>

namespace gsp::python {
namespace {

using runtime::Device;
using runtime::Dtype;

char const* name_of(Dtype dtype) {
  switch (dtype) {
    case Dtype::float32:
      return "float32";
    case Dtype::float64:
      return "float64";
    case Dtype::int32:
      return "int32";
    case Dtype::int64:
      return "int64";
    case Dtype::uint8:
      return "uint8";
    case Dtype::uint32:
      break;
  }
  return "uint32";
}
bool is_unsigned(Dtype dtype) { return dtype == Dtype::uint32 || dtype == Dtype::uint8; }
/// Kind of number as the buffer protocol's descendants write it: "<f4".
std::string typestr_of(Dtype dtype) {
  char const kind = dtype == Dtype::float32 || dtype == Dtype::float64 ? 'f' : is_unsigned(dtype) ? 'u' : 'i';
  return std::string(runtime::bytes_of(dtype) == 1 ? "|" : "<") + kind + std::to_string(runtime::bytes_of(dtype));
}
Shape shape_of(runtime::Array const& a) {
  nb::list out;
  for (int k = 0; k < a.rank; ++k) out.append(a.extents[k]);
  return nb::borrow<Shape>(nb::tuple(out));
}
std::string text_of_shape(std::int64_t const* extents, std::size_t rank) {
  std::string text = "(";
  for (std::size_t k = 0; k < rank; ++k) text += (k == 0 ? "" : ", ") + (extents[k] < 0 ? std::string("any") : std::to_string(extents[k]));
  return text + ")";
}
/// NumPy's array interface, version 3; CUDA's has the same words.
Words interface_of(Array const& self) {
  nb::dict out;
  runtime::Array const& a = self.array;
  nb::list strides;
  for (int k = 0; k < a.rank; ++k) strides.append(a.strides[k] * runtime::bytes_of(a.dtype));
  out["shape"] = shape_of(a);
  out["typestr"] = typestr_of(a.dtype);
  // What is computed NumPy shall not write; torch takes no array of a GPU that says so.
  bool const reads = a.read_only || (self.computed && a.device == Device::cpu);
  out["data"] = nb::make_tuple(reinterpret_cast<std::uintptr_t>(a.data), reads);
  out["strides"] = nb::tuple(strides);
  out["version"] = 3;
  return nb::borrow<Words>(out);
}

// DLPack (https://dmlc.github.io/dlpack/latest): the structures that its capsules hold.
struct DLDevice {
  std::int32_t type, id;
};
struct DLDataType {
  std::uint8_t code, bits;
  std::uint16_t lanes;
};
struct DLTensor {
  void* data;
  DLDevice device;
  std::int32_t ndim;
  DLDataType dtype;
  std::int64_t *shape, *strides;
  std::uint64_t byte_offset;
};
struct DLManagedTensor {
  DLTensor tensor;
  void* context;
  void (*deleter)(DLManagedTensor*);
};
struct DLManagedTensorVersioned {
  std::uint32_t major, minor;
  void* context;
  void (*deleter)(DLManagedTensorVersioned*);
  std::uint64_t flags;  // 1: read-only
  DLTensor tensor;
};
constexpr int dl_cpu = 1, dl_cuda = 2;

/// One exported array: the capsule's structure and what it points to.
template <class Managed>
struct Export {
  Managed managed;
  Array held;
  static void free(Managed* m) { delete static_cast<Export*>(m->context); }
};
template <class Managed>
constexpr char const* capsule_name = std::is_same_v<Managed, DLManagedTensor> ? "dltensor" : "dltensor_versioned";

template <class Managed>
nb::object export_capsule(Array const& self) {
  auto* const e = new Export<Managed>{{}, self};
  runtime::Array& a = e->held.array;
  Managed& m = e->managed;
  bool const is_float = a.dtype == Dtype::float32 || a.dtype == Dtype::float64;
  m.tensor = {a.data,
              {a.device == Device::cuda ? dl_cuda : dl_cpu, 0},
              a.rank,
              {static_cast<std::uint8_t>(is_float               ? 2
                                         : is_unsigned(a.dtype) ? 1
                                                                : 0),
               static_cast<std::uint8_t>(8 * runtime::bytes_of(a.dtype)), 1},
              a.extents.data(),
              a.strides.data(),
              0};
  m.context = e;
  m.deleter = &Export<Managed>::free;
  if constexpr (std::is_same_v<Managed, DLManagedTensorVersioned>) {
    m.major = 1;
    m.minor = 0;
    m.flags = a.read_only || self.computed ? 1 : 0;
  }
  PyObject* const capsule = PyCapsule_New(&m, capsule_name<Managed>, [](PyObject* own) {
    if (!PyCapsule_IsValid(own, capsule_name<Managed>)) return;  // somebody has taken it
    auto* const mine = static_cast<Managed*>(PyCapsule_GetPointer(own, capsule_name<Managed>));
    mine->deleter(mine);
  });
  if (!capsule) {
    delete e;
    nb::raise_python_error();
  }
  return nb::steal(capsule);
}

nb::object dlpack(Array const& self, std::optional<std::intptr_t> stream, nb::object const& max_version, nb::object const& dl_device,
                  nb::object const& copy) {
  if (!copy.is_none() && nb::cast<bool>(copy)) throw nb::buffer_error("gsp.Array.__dlpack__ copies nothing: give copy=None or False");
  if (!dl_device.is_none()) {
    auto const wanted = nb::cast<std::pair<int, int>>(nb::make_tuple(dl_device[0], dl_device[1]));
    if (wanted != std::pair(self.array.device == Device::cuda ? dl_cuda : dl_cpu, 0))
      throw nb::buffer_error("gsp.Array.__dlpack__: the array lies on another device, and nothing is copied: ask for its own");
  }
  // Whoever reads on `stream` reads what was launched before: None is the legacy default one, -1 asks for no order.
  if (stream.value_or(1) == 0)
    throw nb::value_error("gsp.Array.__dlpack__: stream 0 is ambiguous, says DLPack: give 1, 2 or a stream's own");
  if (stream.value_or(1) != -1) runtime::let_stream_wait(self.array.device, std::uintptr_t(stream.value_or(1)));
  bool const versioned = !max_version.is_none() && nb::cast<int>(max_version[0]) >= 1;
  if (versioned) return export_capsule<DLManagedTensorVersioned>(self);
  if (self.array.read_only)
    throw nb::buffer_error("gsp.Array.__dlpack__: the array is read-only, which the consumer's DLPack has no word for");
  return export_capsule<DLManagedTensor>(self);
}

NumpyArray as_numpy(nb::handle self) {
  if (nb::cast<Array const&>(self).array.device != Device::cpu)
    throw gsp::Error("gsp.Array: the array lies on the GPU, and NumPy reads the host's memory: use torch.from_dlpack, or array.copy()");
  return nb::borrow<NumpyArray>(nb::module_::import_("numpy").attr("asarray")(self));
}

/// Never destroyed: at the end of the process Kokkos' own statics may be gone.
std::shared_ptr<runtime::Session>& the_session = *new std::shared_ptr<runtime::Session>;
bool forked = false, ended = false;

}  // namespace

void expect_threads() {
  if (forked)
    throw gsp::Error(
        "this process was forked after the library had started its threads, which stayed behind: start processes by 'spawn' "
        "(multiprocessing.get_context('spawn'), AsyncVectorEnv(..., context='spawn')), or before the first gsp.Data");
}
std::shared_ptr<runtime::Session> session() {
  expect_threads();
  if (ended) throw gsp::Error("the interpreter ends, and the library has ended before: make gsp.Data earlier");
  if (!the_session) {
    the_session = std::make_shared<runtime::Session>();
    static bool const told =
        pthread_atfork(nullptr, nullptr, [] {
          forked = the_session != nullptr && (runtime::cpu_threads() > 1 || (runtime::has_cuda() && runtime::gpu_count() > 0));
        }) == 0;
    static_cast<void>(told);
  }
  return the_session;
}

Device device_of(std::string const& name) {
  if (name == "cpu") return Device::cpu;
  if (name != "cuda" && name != "cuda:0") throw gsp::Error("device '" + name + "' is not known: give 'cpu' or 'cuda'");
  if (!runtime::has_cuda()) throw gsp::Error("device '" + name + "': this build of gsp has no CUDA: give 'cpu', or build it with nvcc");
  if (runtime::gpu_count() == 0) throw gsp::Error("device '" + name + "': there is no GPU that answers: give 'cpu'");
  return Device::cuda;
}

NumpyArray numpy_copy(runtime::Array const& from) {
  expect_threads();
  auto const numpy = nb::module_::import_("numpy");
  auto const own = nb::borrow<NumpyArray>(numpy.attr("empty")(shape_of(from), nb::arg("dtype") = name_of(from.dtype)));
  if (from.size() == 0) return own;
  runtime::Array to = from;
  to.device = Device::cpu;
  to.read_only = false;
  to.data = reinterpret_cast<void*>(nb::cast<std::uintptr_t>(own.attr("__array_interface__")["data"][0]));
  std::int64_t step = 1;
  for (int k = to.rank; k-- > 0; step *= to.extents[std::size_t(k)]) to.strides[std::size_t(k)] = step;
  runtime::copy(from, to);
  return own;
}

runtime::Array taken(nb::handle object, char const* what, std::initializer_list<std::int64_t> extents, nb::object& keeps) {
  if (object.is_none()) return {};
  if (nb::isinstance<Array>(object)) {
    keeps = nb::borrow(object);
    runtime::Array const a = nb::cast<Array const&>(object).array;
    bool same = a.rank == static_cast<int>(extents.size());
    for (int k = 0; same && k < a.rank; ++k) same = extents.begin()[k] < 0 || a.extents[k] == extents.begin()[k];
    if (!same)
      throw gsp::Error(std::string(what) + " has shape " + text_of_shape(a.extents.data(), std::size_t(a.rank)) + " and must have " +
                       text_of_shape(extents.begin(), extents.size()));
    return a;
  }
  // What lies on a GPU says so by CUDA's array interface; all else NumPy sees where it is, or makes an array of (lists, numbers).
  bool const on_gpu = nb::hasattr(object, "__cuda_array_interface__");
  nb::object given = on_gpu ? nb::borrow(object) : nb::module_::import_("numpy").attr("asarray")(object);
  if (!on_gpu) {  // numbers of other widths become those of 32 or 64 bits that hold them
    auto const kind = nb::cast<std::string>(given.attr("dtype").attr("kind"));
    int const bytes = nb::cast<int>(given.attr("dtype").attr("itemsize"));
    if (kind == "b" || ((kind == "i" || kind == "u") && bytes < 4)) given = given.attr("astype")("int32");
    if (kind == "f" && bytes < 4) given = given.attr("astype")("float32");
    if (!nb::cast<bool>(given.attr("dtype").attr("isnative"))) given = given.attr("astype")(given.attr("dtype").attr("newbyteorder")("="));
    bool whole = nb::cast<bool>(given.attr("flags").attr("aligned"));  // steps of whole numbers
    for (nb::handle const stride : given.attr("strides"))
      whole &= nb::cast<std::int64_t>(stride) % nb::cast<int>(given.attr("itemsize")) == 0;
    if (!whole) given = nb::module_::import_("numpy").attr("ascontiguousarray")(given);
  }
  nb::dict const interface = given.attr(on_gpu ? "__cuda_array_interface__" : "__array_interface__");
  keeps = given;
  runtime::Array a;
  std::string const type = nb::cast<std::string>(interface["typestr"]);
  bool known = false;
  for (Dtype const dtype : {Dtype::float32, Dtype::float64, Dtype::int32, Dtype::int64, Dtype::uint32, Dtype::uint8}) {
    if (type != typestr_of(dtype)) continue;
    a.dtype = dtype;
    known = true;
  }
  if (!known)
    throw gsp::Error(std::string(what) + " holds " + (on_gpu ? type : nb::cast<std::string>(given.attr("dtype").attr("name"))) +
                     ": give real numbers of 64 bits or less");
  auto const shape = nb::cast<std::vector<std::int64_t>>(interface["shape"]);
  bool same = shape.size() == extents.size();
  for (std::size_t k = 0; same && k < shape.size(); ++k) same = extents.begin()[k] < 0 || shape[k] == extents.begin()[k];
  if (!same)
    throw gsp::Error(std::string(what) + " has shape " + text_of_shape(shape.data(), shape.size()) + " and must have " +
                     text_of_shape(extents.begin(), extents.size()));
  a.data = reinterpret_cast<void*>(nb::cast<std::uintptr_t>(interface["data"][0]));
  a.device = on_gpu ? Device::cuda : Device::cpu;
  if (on_gpu && interface.contains("stream") && !interface["stream"].is_none())
    runtime::wait_for_stream(a.device, nb::cast<std::uintptr_t>(interface["stream"]));
  a.read_only = true;
  a.rank = static_cast<int>(shape.size());
  std::int64_t step = 1;
  for (int k = a.rank; k-- > 0; step *= a.extents[std::size_t(k)]) {
    a.extents[std::size_t(k)] = shape[std::size_t(k)];
    a.strides[std::size_t(k)] = step;
  }
  if (interface.contains("strides") && !interface["strides"].is_none()) {
    auto const strides = nb::cast<std::vector<std::int64_t>>(interface["strides"]);
    for (int k = 0; k < a.rank; ++k) a.strides[std::size_t(k)] = strides[std::size_t(k)] / runtime::bytes_of(a.dtype);
  }
  return a;
}

namespace {
NumpyArray writable(nb::handle self) {
  if (char const* const instead = nb::cast<Array const&>(self).computed)
    throw gsp::Error(std::string("this array is for reading, as it is computed from the state, or drawn once for many pictures: ") +
                     instead);
  return as_numpy(self);
}
/// What NumPy's operators take of the other side, and what they give: also NotImplemented.
nb::object numpys(nb::handle other) { return nb::isinstance<Array>(other) ? nb::object(as_numpy(other)) : nb::borrow(other); }
NumpyArray of_numpy(nb::object const& result) { return nb::borrow<NumpyArray>(result); }
/// Number of a stream of CUDA's: of torch's, cupy's, or itself.
std::uintptr_t stream_of(nb::handle stream) {
  for (char const* const name : {"cuda_stream", "ptr"})
    if (nb::hasattr(stream, name)) return nb::cast<std::uintptr_t>(stream.attr(name));
  if (!nb::isinstance<nb::int_>(stream)) throw gsp::Error("a stream is torch's, cupy's, or its number (1: the legacy default one)");
  return nb::cast<std::uintptr_t>(stream);
}
/// Where streams are: nowhere before Kokkos runs, or without CUDA.
Device gpu() { return the_session && runtime::has_cuda() ? Device::cuda : Device::cpu; }
}  // namespace

void bind_array(nb::module_& m) {
  nb::class_<Array> c(m, "Array",
                      "Numbers that the library works on, where they lie: no copy is made. NumPy, torch, jax and cupy read and write them "
                      "through\n"
                      "`numpy.asarray(a)`, `torch.from_dlpack(a)` and their like, and keep the memory for as long as they need it.\n"
                      "`a[...]`, `a[...] = x`, operators and sums are NumPy's, of arrays on the CPU.");
  c.def_prop_ro("shape", [](Array const& a) { return shape_of(a.array); })
      .def_prop_ro("ndim", [](Array const& a) { return a.array.rank; })
      .def_prop_ro(
          "dtype",
          [](Array const& a) { return nb::borrow<NumpyDtype>(nb::module_::import_("numpy").attr("dtype")(name_of(a.array.dtype))); },
          "float32, float64, int32, int64, uint32 or uint8, as NumPy's")
      .def_prop_ro("device", [](Array const& a) { return a.array.device == Device::cuda ? "cuda:0" : "cpu"; })
      .def_prop_ro("read_only", [](Array const& a) { return a.array.read_only || a.computed != nullptr; })
      .def_prop_ro(
          "pointer", [](Array const& a) { return reinterpret_cast<std::uintptr_t>(a.array.data); }, "Address of the first number.")
      .def(
          "numpy", [](nb::handle self) { return as_numpy(self); }, "The same memory as numpy.ndarray. Error: an array on a GPU.")
      .def(
          "copy", [](Array const& a) { return numpy_copy(a.array); }, "A copy as numpy.ndarray, from the CPU or a GPU.")
      .def(
          "__array__",
          [](nb::handle self, nb::object const& dtype, nb::object const& copy) {
            nb::object const same = as_numpy(self);
            return nb::borrow<NumpyArray>(nb::module_::import_("numpy").attr("array")(same, dtype, nb::arg("copy") = copy));
          },
          nb::arg("dtype") = nb::none(), nb::arg("copy") = nb::none())
      .def("__getitem__", [](nb::handle self, Anything const& key) { return nb::borrow<Anything>(as_numpy(self)[key]); })
      .def("__setitem__", [](nb::handle self, Anything const& key, ArrayLike const& value) { writable(self)[key] = value; })
      .def("__len__", [](Array const& a) { return a.array.rank > 0 ? a.array.extents[0] : 0; })
      .def("__repr__",
           [](nb::handle self) {
             Array const& a = nb::cast<Array const&>(self);
             std::string const head = std::string("gsp.Array(shape=") + text_of_shape(a.array.extents.data(), std::size_t(a.array.rank)) +
                                      ", dtype=" + name_of(a.array.dtype) +
                                      ", device=" + (a.array.device == Device::cuda ? "cuda:0" : "cpu") + ")";
             return a.array.device == Device::cpu ? head + "\n" + nb::cast<std::string>(nb::str(as_numpy(self))) : head;
           })
      .def("__dlpack__", &dlpack, nb::kw_only(), nb::arg("stream") = nb::none(), nb::arg("max_version") = nb::none(),
           nb::arg("dl_device") = nb::none(), nb::arg("copy") = nb::none())
      .def("__dlpack_device__", [](Array const& a) { return std::pair<int, int>(a.array.device == Device::cuda ? dl_cuda : dl_cpu, 0); })
      .def_prop_ro("__array_interface__",
                   [](Array const& a) {
                     if (a.array.device != Device::cpu) throw nb::attribute_error("gsp.Array: the array lies on the GPU");
                     return interface_of(a);
                   })
      .def_prop_ro("__cuda_array_interface__", [](Array const& a) {
        if (a.array.device != Device::cuda) throw nb::attribute_error("gsp.Array: the array lies on the CPU");
        runtime::wait(Device::cuda);  // it names no stream
        return interface_of(a);
      });
  for (char const* const name : {"__eq__", "__ne__", "__lt__", "__le__", "__gt__", "__ge__"})
    c.def(
        name, [name](nb::handle self, Anything const& other) { return of_numpy(as_numpy(self).attr(name)(numpys(other))); },
        nb::arg("other").none());
  for (char const* const name :
       {"__add__", "__radd__", "__sub__",      "__rsub__",      "__mul__", "__rmul__", "__truediv__", "__rtruediv__",
        "__mod__", "__rmod__", "__floordiv__", "__rfloordiv__", "__pow__", "__rpow__", "__matmul__",  "__rmatmul__",
        "__and__", "__rand__", "__or__",       "__ror__",       "__xor__", "__rxor__"})
    c.def(
        name, [name](nb::handle self, Anything const& other) { return of_numpy(as_numpy(self).attr(name)(numpys(other))); },
        nb::arg("other").none());
  std::pair<char const*, char const*> const in_place[] = {
      {"__iadd__", "add"},       {"__isub__", "subtract"},          {"__imul__", "multiply"}, {"__itruediv__", "true_divide"},
      {"__imod__", "remainder"}, {"__ifloordiv__", "floor_divide"}, {"__ipow__", "power"},    {"__iand__", "bitwise_and"},
      {"__ior__", "bitwise_or"}, {"__ixor__", "bitwise_xor"}};
  for (auto const& [name, ufunc] : in_place)
    c.def(name, [ufunc = ufunc](nb::handle self, Anything const& other) {  // into the memory, of whatever kind `other` is
      nb::object const own = writable(self);
      nb::module_::import_("numpy").attr(ufunc)(own, numpys(other), nb::arg("out") = own);
      return nb::borrow<Anything>(self);
    });
  for (char const* const name : {"__neg__", "__pos__", "__abs__", "__invert__"})
    c.def(name, [name](nb::handle self) { return of_numpy(as_numpy(self).attr(name)()); });
  for (char const* const name : {"__bool__", "__int__", "__float__", "__index__"})  // of one number; else NumPy says what it misses
    c.def(name, [name](nb::handle self) { return nb::borrow<Anything>(as_numpy(self).attr(name)()); });
  for (char const* const name : {"sum",    "mean",    "std",     "var",   "prod",   "min",     "max",     "any",     "all",       "argmin",
                                 "argmax", "argsort", "cumsum",  "round", "clip",   "reshape", "ravel",   "flatten", "transpose", "take",
                                 "repeat", "squeeze", "nonzero", "dot",   "astype", "tolist",  "tobytes", "item"})
    c.def(name, [name](nb::handle self, nb::args const& a, nb::kwargs const& k) {
      return nb::borrow<Anything>(as_numpy(self).attr(name)(*a, **k));
    });
  c.def_prop_ro("T", [](nb::handle self) { return of_numpy(as_numpy(self).attr("T")); });
  c.def(
      "fill", [](nb::handle self, Anything const& value) { writable(self).attr("fill")(value); }, nb::arg("value"));
  c.def_prop_ro("size", [](Array const& a) { return a.array.size(); });
  c.def_prop_ro("itemsize", [](Array const& a) { return runtime::bytes_of(a.array.dtype); });
  c.def_prop_ro("nbytes", [](Array const& a) { return a.array.size() * runtime::bytes_of(a.array.dtype); });
  c.attr("__hash__") = nb::none();
  m.def(
      "wait_for_stream", [](Anything const& stream) { runtime::wait_for_stream(gpu(), stream_of(stream)); }, nb::arg("stream"),
      "What the library does on the GPU from now on comes after what is on this stream by now: torch's, cupy's, or its number. The host "
      "does\n"
      "not wait. The legacy default stream, torch's unless you take another, needs it not. Nothing without a GPU.");
  m.def(
      "let_stream_wait", [](Anything const& stream) { runtime::let_stream_wait(gpu(), stream_of(stream)); }, nb::arg("stream"),
      "The other way round: what comes on this stream from now on reads what the library was told to do on the GPU before.");
  m.def("_end", [] {
    // Threads of Python that are left behind keep what they had, which is no fault of the bindings.
    if (nb::cast<int>(nb::module_::import_("threading").attr("active_count")()) > 1) nb::set_leak_warnings(false);
    // Kokkos ends with the last who holds it, as a rule while the interpreter ends. Where arrays live on past it Kokkos does not end: the
    // process does.
    if (forked) return;  // its threads are elsewhere, and would be waited for
    ended = true;
    the_session.reset();
  });
}

}  // namespace gsp::python
