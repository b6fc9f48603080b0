#include "files.hpp"

#include <sys/stat.h>

#include <cstdio>
#include <filesystem>
#include <gsp/core/status.hpp>
#include <gsp/io/mjcf.hpp>
#include <gsp/io/splats.hpp>
#include <gsp/io/urdf.hpp>
#include <gsp/model/compile.hpp>
#include <gsp/model/detail/host_math.hpp>
#include <map>

namespace gsp_cli {

using gsp::io::detail::fail;

Option skip_visuals_option() { return {"--skip-visuals", "", "leave out visual geoms whose meshes are not read (colliding ones never)"}; }
Option decompose_option() {
  return {"--decompose", "", "meshes that are not convex touch as their convex parts, found by CoACD and kept in the cache"};
}
std::string const approximate_note = "--approximate is without effect: what it was given for is computed; leave it out";
Option approximate_option() { return {"--approximate", "", "without effect: nothing has to be approximated any more; old scripts say it"}; }
Option floating_base_option() {
  return {"--floating-base", "", "the root link of a URDF file moves freely (else it is fixed to the world)"};
}
Option package_option() {
  return {"--package", "NAME=FOLDER",
          "where package://NAME of a URDF file is; may come several times (else: the nearest such folder above the file)", true};
}

gsp::CompiledModel load_model(std::string const& path, Arguments const& arguments) {
  auto description = describe_model(path, arguments, false);
  auto& o = description.option;
  std::map<std::string, bool*> const flags{{"constraint", &o.constraint}, {"contact", &o.contact},       {"limit", &o.limit},
                                           {"equality", &o.equality},     {"friction", &o.frictionloss}, {"sleep", &o.sleep}};
  std::vector<std::string> names;
  for (auto const& [name, flag] : flags) names.push_back(name);
  for (auto const& name : arguments.list("--disable", names, {})) {
    if (name == "sleep" && arguments.has("--sleep")) arguments.fail("--sleep and --disable sleep contradict each other; leave one out");
    *flags.at(name) = false;
  }
  return compile_model(description);
}
gsp::Description describe_model(std::string const& path, Arguments const& arguments, bool list_refusals) {
  return describe_model(path, arguments, list_refusals, arguments.has("--skip-visuals"));
}
gsp::Description describe_model(std::string const& path, Arguments const& arguments, bool list_refusals, bool skip_visuals) {
  if (path.ends_with(".urdf")) {
    gsp::io::UrdfOptions options;
    options.floating_base = arguments.has("--floating-base");
    options.skip_visuals = skip_visuals;
    options.list_refusals = list_refusals;
    options.convex_decomposition = arguments.has("--decompose");
    for (auto const& text : arguments.all("--package")) {
      auto const equal = text.find('=');
      if (equal == 0 || equal == std::string::npos) arguments.fail("--package is " + in_quotes(text) + "; give NAME=FOLDER");
      options.packages[text.substr(0, equal)] = text.substr(equal + 1);
    }
    return gsp::io::read_urdf(path, options);
  }
  gsp::io::MjcfOptions options;
  options.skip_visuals = skip_visuals;
  options.list_refusals = list_refusals;
  options.convex_decomposition = arguments.has("--decompose");
  return gsp::io::read_mjcf(path, options);
}
gsp::CompiledModel compile_model(gsp::Description const& description) { return gsp::compile(description); }

gsp::io::SplatSet load_splats(std::string const& path, gsp::io::SplatPose const& pose) {
  auto set = gsp::io::read_splats(path);
  try {
    gsp::io::transform(set, pose);
  } catch (std::invalid_argument const& e) { throw Error(path + ": " + e.what()); }
  return set;
}

bool add_floor(gsp::Description& d) {
  std::vector<bool> moves(d.bodies.size());
  for (std::size_t b = 0; b < d.bodies.size(); ++b) {
    moves[b] = !d.bodies[b].joints.empty() || (b > 0 && moves[static_cast<std::size_t>(d.bodies[b].parent)]);
    if (moves[b]) continue;
    for (auto const& g : d.bodies[b].geoms)
      if (!g.visual()) return false;
  }
  gsp::GeomDescription plane;
  plane.type = gsp::ShapeType::plane;
  plane.size = {0, 0, 1};
  plane.name = "quickstart_floor";
  d.bodies[0].geoms.push_back(plane);
  return true;
}

namespace {
bool is_motor(gsp::ActuatorDescription const& a) {
  bool const limited = a.force_limited || a.ctrl_limited;
  return limited && a.target == gsp::Transmission::joint && a.biasprm == std::array<double, 10>{} && a.gainprm[0] != 0;
}
}  // namespace

int motors_to_servos(gsp::Description& d) {
  std::map<std::string, gsp::JointType> joints;
  for (auto const& b : d.bodies)
    for (auto const& j : b.joints) joints[j.name] = j.type;
  for (auto const& a : d.actuators)  // all or none: a robot that holds half of its joints is of no use
    if (!is_motor(a) || !joints.contains(a.target_name) || joints[a.target_name] < gsp::JointType::slide || a.gear[0] == 0) return 0;
  for (auto& a : d.actuators) {
    double const strength = a.ctrl_limited ? std::abs(a.gainprm[0]) * std::max(std::abs(a.ctrl_range[0]), std::abs(a.ctrl_range[1]))
                                           : std::max(std::abs(a.force_range[0]), std::abs(a.force_range[1]));
    double const stiffness = strength / (0.3 * std::abs(a.gear[0]));  // of the length gear q
    if (!a.force_limited) {
      a.force_limited = true;
      a.force_range = {-strength, strength};
    }
    a.gainprm[0] = stiffness;
    a.bias_type = gsp::ActuatorBias::affine;
    a.biasprm = {0, -stiffness, -0.03 * stiffness};
    a.ctrl_limited = false;
  }
  return static_cast<int>(d.actuators.size());
}

void hold(gsp::CompiledModel const& model, int servos, States& states) {
  if (servos == 0) return;
  states.ctrl.assign(static_cast<std::size_t>(states.worlds) * model.nu, 0.);
  for (int w = 0; w < states.worlds; ++w)
    for (std::size_t k = 0; k < static_cast<std::size_t>(model.nu); ++k)
      states.ctrl[static_cast<std::size_t>(w) * model.nu + k] =
          model.act_gear[k][0] * states.qpos[static_cast<std::size_t>(w) * model.nq +
                                             static_cast<std::size_t>(model.jnt_qposadr[static_cast<std::size_t>(model.act_id[k])])];
}

bool concerns(gsp::ReportLine const& line, bool mujoco) {
  using Kind = gsp::ReportLine::Kind;
  return line.kind != (mujoco ? Kind::mujoco_only : Kind::stable_only);
}
std::string summary(gsp::CompiledModel const& model, bool mujoco) {
  std::map<gsp::ReportLine::Kind, int> counts;
  for (auto const& line : model.report)
    if (concerns(line, mujoco)) counts[line.kind] += line.count;
  std::string out;
  for (auto const& [kind, count] : counts) out += (out.empty() ? "" : ", ") + std::to_string(count) + " " + gsp::text(kind);
  return out;
}

namespace {
/// A state beyond what a world is stepped with (status::unbounded) is no start; items: numbers of a world.
void expect_bounded(std::vector<double> const& values, int items, std::string const& what) {
  for (std::size_t i = 0; i < values.size(); ++i)
    if (std::abs(values[i]) > gsp::state_bound) {
      auto const n = static_cast<std::size_t>(items);
      char text[32];
      std::snprintf(text, sizeof text, "%.4g", values[i]);
      fail(what, "",
           "number " + std::to_string(i % n) + " of world " + std::to_string(i / n) + " is " + text +
               ", and worlds stop beyond 1e10; give smaller numbers (angles modulo 2 pi, quaternions of length 1)");
    }
}
}  // namespace

int named_or_index(std::string const& file, std::string const& what, std::vector<std::string> const& names, std::string const& text) {
  if (auto const found = std::find(names.begin(), names.end(), text); found != names.end() && !text.empty())
    return static_cast<int>(found - names.begin());
  int number = -1;
  int const n = static_cast<int>(names.size());
  auto const [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (error == std::errc{} && end == text.data() + text.size() && number >= 0 && number < n) return number;
  std::string there;
  for (auto const& name : names)
    if (!name.empty()) there += (there.empty() ? "" : ", ") + name;
  fail(file, "",
       "has no " + what + " " + in_quotes(text) +
           (n == 0 ? " (it has none); leave out --" + what
                   : "; it has " + std::to_string(n) + (there.empty() ? "" : " (" + there + ")") +
                         ", give one of their names or an index from 0"));
}

std::string camera_name(gsp::CompiledModel const& model, int camera) {
  auto const& name = model.cam_name[static_cast<std::size_t>(camera)];
  return "camera " + (name.empty() ? std::to_string(camera) : in_quotes(name));
}

States initial_state(gsp::CompiledModel const& model, std::string const& file, std::optional<std::string> const& keyframe) {
  States s;
  s.qpos = model.qpos0;
  s.qvel.assign(static_cast<std::size_t>(model.nv), 0.);
  if (!keyframe) return s;
  std::vector<std::string> names;
  for (auto const& k : model.keyframes) names.push_back(k.name);
  auto const& k = model.keyframes[static_cast<std::size_t>(named_or_index(file, "keyframe", names, *keyframe))];
  if (!k.qpos.empty()) s.qpos = k.qpos;
  if (!k.qvel.empty()) s.qvel = k.qvel;
  s.ctrl = k.ctrl;
  s.act = k.act;
  s.mocap_pos = k.mpos;
  s.mocap_quat = k.mquat;
  s.time = k.time;
  std::string const name = file + ": keyframe " + in_quotes(*keyframe) + ": ";
  expect_bounded(s.qpos, model.nq, name + "qpos");
  expect_bounded(s.qvel, model.nv, name + "qvel");
  expect_bounded(s.act, model.na, name + "act");
  expect_bounded(s.mocap_pos, 3 * model.nmocap, name + "mpos");
  return s;
}

void place_mocap(gsp::CompiledModel& model, States const& s) {
  for (std::size_t b = 0; b < model.body_mocap.size(); ++b) {
    int const i = model.body_mocap[b];
    if (i < 0) continue;
    if (!s.mocap_pos.empty()) std::copy_n(&s.mocap_pos[3 * std::size_t(i)], 3, model.body_pos[b].begin());
    if (s.mocap_quat.empty()) continue;
    std::copy_n(&s.mocap_quat[4 * std::size_t(i)], 4, model.body_quat[b].begin());
    model.body_quat[b] = gsp::detail::normalized(model.body_quat[b]);
  }
}

namespace {
/// The sizes of a world are the model's: no other shape of the numbers would make them this model's.
void expect_of_model(gsp::io::Npz const& npz, std::string const& path, gsp::CompiledModel const& model) {
  std::string others;
  auto const compare = [&](char const* array, std::size_t rank, std::size_t axis, char const* size, int here) {
    if (!npz.contains(array) || npz.at(array).shape.size() != rank) return;
    std::size_t const there = npz.at(array).shape[axis];
    if (there != static_cast<std::size_t>(here))
      others += (others.empty() ? "" : ", ") + std::string(size) + " " + std::to_string(there) + " instead of " + std::to_string(here);
  };
  compare("qpos", 3, 2, "nq", model.nq);
  compare("qvel", 3, 2, "nv", model.nv);
  compare("act", 3, 2, "na", model.na);
  compare("state.ctrl", 2, 1, "nu", model.nu);
  compare("state.mocap_pos", 3, 1, "nmocap", model.nmocap);
  compare("state.eq_active", 2, 1, "neq", model.neq);
  if (!others.empty()) fail(path, "", "was saved from another model (" + others + "); give the model that it was saved from");
}
Trace trace_of(gsp::io::Npz const& npz, std::string const& path, gsp::CompiledModel const& model) {
  auto const &time = npz.at("time"), &qpos = npz.at("qpos"), &qvel = npz.at("qvel");
  auto const key = [&](char const* name) { return path + "[" + name + "]"; };
  expect_of_model(npz, path, model);
  gsp::io::expect_shape(qpos, {-1, -1, model.nq}, key("qpos"));
  long long const entries = static_cast<long long>(qpos.shape[0]), worlds = static_cast<long long>(qpos.shape[1]);
  gsp::io::expect_shape(qvel, {entries, worlds, model.nv}, key("qvel"));
  gsp::io::expect_shape(time, {entries}, key("time"));
  if (entries == 0 || worlds == 0)
    fail(key("qpos"), "", "has shape " + gsp::io::format_shape(qpos.shape) + ", which holds no state; write at least one");
  for (auto const* array : {&time, &qpos, &qvel})
    gsp::io::expect_finite(*array, array == &time ? key("time") : array == &qpos ? key("qpos") : key("qvel"));
  Trace trace{qpos.shape[0], qpos.shape[1], time.as<double>(), qpos.as<double>(), qvel.as<double>(), {}};
  if (npz.contains("act")) {
    auto const& act = npz.at("act");
    gsp::io::expect_shape(act, {entries, worlds, model.na}, key("act"));
    gsp::io::expect_finite(act, key("act"));
    trace.act = act.as<double>();
  }
  return trace;
}
/// Arrays of a snapshot have a point in their names.
bool is_of_snapshot(std::string const& name) { return name.find('.') != std::string::npos; }
}  // namespace

Trace read_trace(std::string const& path, gsp::CompiledModel const& model) { return trace_of(gsp::io::read_npz(path), path, model); }

States read_start(std::string const& path, gsp::CompiledModel const& model) {
  auto npz = gsp::io::read_npz(path);
  Trace const t = trace_of(npz, path, model);
  States s;
  if (npz.contains("snapshot")) {
    auto const version = npz.at("snapshot").as<int>(path + "[snapshot]");
    if (version != std::vector<int>{gsp::runtime::snapshot_version})
      fail(path + "[snapshot]", "",
           "is of another version of gsp, which goes on from other arrays; leave out 'snapshot', or save the file anew (--save)");
    if (npz.contains("options")) s.saved_with = npz.at("options").as<double>(path + "[options]");
    for (auto& [name, array] : npz.arrays)
      if (is_of_snapshot(name)) s.snapshot.emplace(name, std::move(array));
  }
  s.worlds = static_cast<int>(t.worlds);
  s.time = t.time.back();
  s.qpos.assign(t.qpos.end() - static_cast<std::ptrdiff_t>(t.worlds) * model.nq, t.qpos.end());
  s.qvel.assign(t.qvel.end() - static_cast<std::ptrdiff_t>(t.worlds) * model.nv, t.qvel.end());
  if (!t.act.empty()) s.act.assign(t.act.end() - static_cast<std::ptrdiff_t>(t.worlds) * model.na, t.act.end());
  expect_bounded(s.qpos, model.nq, path + "[qpos], last entry");
  expect_bounded(s.qvel, model.nv, path + "[qvel], last entry");
  expect_bounded(s.act, model.na, path + "[act], last entry");
  return s;
}

namespace {
/// What constraints are left out (--disable), as bits.
double disabled(gsp::CompiledModel const& m) {
  auto const& o = m.option;
  int bits = 0, at = 0;
  for (bool const on : {o.constraint, o.contact, o.limit, o.equality, o.frictionloss}) bits |= int(!on) << at++;
  return bits;
}
/// A number for all of the model that steps read, but for names and what other options say: FNV-1a, of which a double holds 53 bits.
double number_of(gsp::CompiledModel const& m) {
  std::uint64_t hash = 14695981039346656037ull;
  auto const one = [&](auto const& x) {
    auto const* bytes = reinterpret_cast<unsigned char const*>(&x);
    for (std::size_t i = 0; i < sizeof x; ++i) hash = (hash ^ bytes[i]) * 1099511628211ull;
  };
  auto const list = [&](auto const& values) {
    one(values.size());
    for (auto const& x : values) one(x);
  };
  auto const all = [&](auto const&... values) { (list(values), ...); };
  auto const& o = m.option;
  for (bool const flag : {o.override_contacts, o.eulerdamp, o.passive_spring, o.passive_damper, o.gravity_on, o.actuation, o.clampctrl,
                          o.filterparent, o.refsafe, o.warmstart})
    one(flag);
  all(o.gravity, o.wind, o.magnetic, o.o_softness.solref, o.o_softness.solimp, o.o_friction);
  for (double const x : {o.density, o.viscosity, o.o_margin, o.impratio, o.noslip_tolerance, o.sleep_tolerance}) one(x);
  for (int const x : {int(o.integrator), o.disabled_actuator_groups, o.noslip_iterations}) one(x);
  all(m.body_parent, m.body_pos, m.body_quat, m.body_ipos, m.body_iquat, m.body_mass, m.body_inertia, m.body_gravcomp, m.body_mocap,
      m.body_sleep);
  all(m.jnt_type, m.jnt_body, m.jnt_limited, m.jnt_actfrclimited, m.jnt_actgravcomp, m.jnt_pos, m.jnt_axis, m.jnt_stiffness, m.jnt_margin,
      m.jnt_stiffnesspoly, m.jnt_range, m.jnt_actfrcrange, m.jnt_solref, m.jnt_solimp, m.jnt_rigid);
  all(m.dof_armature, m.dof_damping, m.dof_frictionloss, m.dof_dampingpoly, m.dof_solref, m.dof_solimp, m.qpos_spring);
  all(m.geom_type, m.geom_body, m.geom_contype, m.geom_conaffinity, m.geom_condim, m.geom_priority, m.geom_size, m.geom_pos, m.geom_quat,
      m.geom_friction, m.geom_solmix, m.geom_margin, m.geom_gap, m.geom_solref, m.geom_solimp, m.geom_hard, m.geom_restitution, m.geom_erp,
      m.geom_surfacevel, m.geom_adhesion, m.geom_data, m.geom_fluid, m.geom_fluidcoef);
  for (auto const& vertices : m.mesh_vertices) list(vertices);
  for (auto const& h : m.hfields) all(h.size, h.elevation);
  all(m.pairs, m.excluded_bodies);
  for (auto const& p : m.named_pairs) {
    all(std::array{p.geom1, p.geom2, p.condim}, p.friction, p.solimp, p.solref, p.solreffriction);
    all(std::array{p.margin, p.gap, p.adhesion, double(p.rigid.hard), p.rigid.restitution, p.rigid.erp});
  }
  all(m.site_body, m.site_pos, m.site_quat, m.wrap_type, m.wrap_id, m.wrap_side, m.wrap_divisor, m.term_jnt, m.term_coef);
  all(m.tendon_wrapnum, m.tendon_termnum, m.tendon_limited, m.tendon_actfrclimited, m.tendon_actfrcrange, m.tendon_stiffness,
      m.tendon_stiffnesspoly, m.tendon_damping, m.tendon_dampingpoly, m.tendon_frictionloss, m.tendon_armature, m.tendon_margin,
      m.tendon_range, m.tendon_lengthspring, m.tendon_solref_limit, m.tendon_solref_friction, m.tendon_solimp_limit,
      m.tendon_solimp_friction, m.tendon_rigid);
  all(m.act_target, m.act_id, m.act_ref, m.act_ctrllimited, m.act_forcelimited, m.act_actlimited, m.act_actearly, m.act_dyntype,
      m.act_gaintype, m.act_biastype, m.act_dynprm, m.act_gainprm, m.act_biasprm, m.act_cranklength, m.act_damping, m.act_armature,
      m.act_actrange, m.act_lengthrange, m.act_gear, m.act_ctrlrange, m.act_forcerange);
  all(m.eq_type, m.eq_id1, m.eq_id2, m.eq_sites, m.eq_data, m.eq_solref, m.eq_solimp, m.eq_rigid);
  return double(hash >> 11);
}
constexpr std::size_t at_disabled = 5, at_model = 6;
}  // namespace

std::vector<double> options_in_numbers(gsp::CompiledModel const& model, gsp::runtime::StepperOptions const& options) {
  return {options.timestep > 0 ? options.timestep : model.option.timestep,
          double(options.mujoco),
          options.cone ? double(int(*options.cone)) : -1.,
          double(options.iterations),
          options.tolerance.value_or(-1),
          disabled(model),
          number_of(model),
          options.friction_time};
}
std::string other_options(States& states, std::vector<double> const& now) {
  char const* const names[] = {"--timestep", "--profile", "--cone", "--iterations", "--tolerance", "--disable", "model", "--friction-time"};
  std::string others;
  for (std::size_t k = 0; k < now.size() && k < states.saved_with.size(); ++k)
    if (states.saved_with[k] != now[k]) others += (others.empty() ? "" : ", ") + std::string(names[k]);
  if (others.empty()) return others;
  bool woken = false;
  auto const is_other = [&](std::size_t k) { return k < states.saved_with.size() && states.saved_with[k] != now[k]; };
  if (is_other(at_disabled) || is_other(at_model))  // what carried the sleepers may be gone, and nothing would wake them
    woken = std::erase_if(states.snapshot, [](auto const& entry) { return entry.first.starts_with("sleep."); }) > 0;
  return "was saved with another " + others + ": it goes on" + (woken ? ", with all awake" : "") + ", but not to the bit as it would have";
}

void write_snapshot(std::string const& path, gsp::runtime::Stepper& stepper, double time, gsp::CompiledModel const& model,
                    gsp::runtime::StepperOptions const& options) {
  using gsp::runtime::Dtype;
  auto const state = stepper.state();
  auto const worlds = static_cast<std::size_t>(state.qpos.extents[0]);
  auto const nq = static_cast<std::size_t>(model.nq), nv = static_cast<std::size_t>(model.nv), na = static_cast<std::size_t>(model.na);
  std::vector<double> const times{time};
  std::vector<double> qpos(worlds * nq), qvel(worlds * nv), act(worlds * na);
  stepper.get(gsp::runtime::host_array(qpos.data(), {state.qpos.extents[0], model.nq}),
              gsp::runtime::host_array(qvel.data(), {state.qpos.extents[0], model.nv}));
  if (na > 0) copy(state.act, gsp::runtime::host_array(act.data(), {state.qpos.extents[0], model.na}));
  std::vector<int> const version{gsp::runtime::snapshot_version};
  std::vector<gsp::io::NpzEntry> entries{{"time", {{1}, times}}, {"qpos", {{1, worlds, nq}, qpos}}, {"qvel", {{1, worlds, nv}, qvel}}};
  if (na > 0) entries.push_back({"act", {{1, worlds, na}, act}});
  entries.push_back({"snapshot", {{1}, version}});
  auto const with = options_in_numbers(model, options);
  entries.push_back({"options", {{with.size()}, with}});
  std::vector<gsp::io::NpyArray> arrays;
  auto const saved = stepper.save();
  arrays.reserve(saved.size());  // entries refer to them
  for (auto const& [name, from] : saved) {
    auto& array = arrays.emplace_back();
    array.dtype = from.dtype == Dtype::float32   ? gsp::io::Dtype::f4
                  : from.dtype == Dtype::float64 ? gsp::io::Dtype::f8
                  : from.dtype == Dtype::int32   ? gsp::io::Dtype::i4
                                                 : gsp::io::Dtype::i8;
    for (int k = 0; k < from.rank; ++k) array.shape.push_back(static_cast<std::size_t>(from.extents[k]));
    array.bytes.resize(static_cast<std::size_t>(from.size() * gsp::runtime::bytes_of(from.dtype)));
    auto to = from;
    to.data = array.bytes.data();
    to.device = gsp::runtime::Device::cpu;
    copy(from, to);
    entries.push_back({name, array});
  }
  gsp::io::write_npz(path, entries);
}

void expect_goes_on(States const& s, bool in_double, bool sleep, std::string const& path) {
  if (s.snapshot.empty()) return;
  auto const qpos = s.snapshot.find("state.qpos");
  bool const has_double = qpos != s.snapshot.end() && qpos->second.dtype == gsp::io::Dtype::f8;
  if (has_double != in_double)
    throw Error(path + ": was saved in " + (has_double ? "double" : "float") + "; give --precision " + (has_double ? "double" : "float"));
  if (s.snapshot.contains("sleep.calm") && !sleep) throw Error(path + ": was saved with islands that may sleep; give --sleep");
}

void expect_worlds(States const& states, int worlds, std::string const& what) {
  if (states.worlds != worlds && states.worlds != 1)
    throw Error(what + ": holds " + std::to_string(states.worlds) + " worlds but --worlds is " + std::to_string(worlds) +
                "; give --worlds " + std::to_string(states.worlds) + " or a file with one world");
}

States spread(States const& states, int worlds) {
  if (states.worlds == worlds) return states;
  States out;
  out.worlds = worlds;
  out.time = states.time;
  auto const repeat = [&](std::vector<double> const& from, std::vector<double>& to) {
    to.reserve(from.size() * static_cast<std::size_t>(worlds));
    for (int w = 0; w < worlds; ++w) to.insert(to.end(), from.begin(), from.end());
  };
  repeat(states.qpos, out.qpos);
  repeat(states.qvel, out.qvel);
  repeat(states.ctrl, out.ctrl);
  repeat(states.act, out.act);
  out.mocap_pos = states.mocap_pos;
  out.mocap_quat = states.mocap_quat;
  return out;
}

void write_trace(std::string const& path, Trace const& t, gsp::CompiledModel const& model) {
  std::size_t const nq = static_cast<std::size_t>(model.nq), nv = static_cast<std::size_t>(model.nv);
  std::vector<gsp::io::NpzEntry> entries{
      {"time", {{t.entries}, t.time}}, {"qpos", {{t.entries, t.worlds, nq}, t.qpos}}, {"qvel", {{t.entries, t.worlds, nv}, t.qvel}}};
  if (model.na > 0) entries.push_back({"act", {{t.entries, t.worlds, static_cast<std::size_t>(model.na)}, t.act}});
  gsp::io::write_npz(path, entries);
}

void write_sensors(std::string const& path, std::vector<double> const& time, std::vector<double> const& sensordata, int worlds,
                   gsp::CompiledModel const& m) {
  std::string names;
  for (auto const& sensor : m.sensors) names += (&sensor == &m.sensors.front() ? "" : "\n") + sensor.name;
  std::vector<std::uint8_t> const letters(names.begin(), names.end());
  std::size_t const sensors = m.sensors.size();
  gsp::io::write_npz(path, {{"time", {{time.size()}, time}},
                            {"sensordata", {{time.size(), std::size_t(worlds), std::size_t(m.nsensordata)}, sensordata}},
                            {"adr", {{sensors}, m.sensor_adr}},
                            {"dim", {{sensors}, m.sensor_dim}},
                            {"names", {{letters.size()}, letters}}});
}

namespace {
template <class T>
std::vector<T> on_host(gsp::runtime::Array const& from) {
  std::vector<T> numbers(static_cast<std::size_t>(from.size()));
  if (from.rank == 1)
    copy(from, gsp::runtime::host_array(numbers.data(), {from.extents[0]}));
  else
    copy(from, gsp::runtime::host_array(numbers.data(), {from.extents[0], from.extents[1]}));
  return numbers;
}
/// Files hold no unsigned integers of 32 bits.
std::vector<int> status_bits(gsp::runtime::Array const& status) {
  auto const bits = on_host<std::uint32_t>(status);
  return {bits.begin(), bits.end()};
}
}  // namespace

void write_contacts(std::string const& path, gsp::runtime::ContactArrays const& c, gsp::runtime::Array const& status) {
  auto const count = static_cast<std::size_t>(c.dist.extents[0]);
  auto const world = on_host<int>(c.world), geom1 = on_host<int>(c.geom1), geom2 = on_host<int>(c.geom2);
  auto const dist = on_host<double>(c.dist), pos = on_host<double>(c.pos), frame = on_host<double>(c.frame),
             force = on_host<double>(c.force);
  auto const bits = status_bits(status);
  gsp::io::write_npz(path, {{"status", {{bits.size()}, bits}},
                            {"world", {{count}, world}},
                            {"geom1", {{count}, geom1}},
                            {"geom2", {{count}, geom2}},
                            {"dist", {{count}, dist}},
                            {"pos", {{count, 3}, pos}},
                            {"frame", {{count, 9}, frame}},
                            {"force", {{count, 6}, force}}});
}

void write_forces(std::string const& path, gsp::runtime::Array const& qfrc_constraint, gsp::runtime::Array const& status) {
  auto const numbers = on_host<double>(qfrc_constraint);
  auto const bits = status_bits(status);
  gsp::io::write_npz(
      path, {{"status", {{bits.size()}, bits}},
             {"qfrc_constraint",
              {{static_cast<std::size_t>(qfrc_constraint.extents[0]), static_cast<std::size_t>(qfrc_constraint.extents[1])}, numbers}}});
}

Controls read_controls(std::string const& path, gsp::CompiledModel const& model, int worlds) {
  if (model.nu == 0) fail(path, "", "is given as --ctrl, and the model has no actuators; leave out --ctrl, or give the model some");
  auto const array = gsp::io::read_npy(path);
  std::size_t const nu = static_cast<std::size_t>(model.nu), n = static_cast<std::size_t>(worlds);
  bool const shared = array.shape.size() == 2 && array.shape[1] == nu;
  bool const own = array.shape.size() == 3 && array.shape[2] == nu && (array.shape[1] == n || array.shape[1] == 1);
  if ((!shared && !own) || array.shape[0] == 0)
    fail(path, "",
         "has shape " + gsp::io::format_shape(array.shape) + ", expected (K, " + std::to_string(nu) + ") or (K, " + std::to_string(n) +
             ", " + std::to_string(nu) + ") with K > 0 for " + std::to_string(nu) + " actuators; reshape it");
  Controls const c{array.shape[0], own ? array.shape[1] : 1, array.as<double>(path)};
  for (std::size_t i = 0; i < c.values.size(); ++i)
    if (!(std::abs(c.values[i]) <= gsp::state_bound)) {
      char number[32];
      std::snprintf(number, sizeof number, "%.4g", c.values[i]);
      fail(path, "step " + std::to_string(i / (nu * c.worlds)),
           (own ? "the control of world " + std::to_string(i / nu % c.worlds) + " for" : "the control for") + " actuator " +
               std::to_string(i % nu) + " (" + in_quotes(model.act_name[i % nu]) + ") is " +
               (std::isnan(c.values[i])   ? "NaN; write finite numbers"
                : std::isinf(c.values[i]) ? "infinite; write finite numbers"
                                          : number + std::string(", beyond 1e10; write smaller numbers")));
    }
  return c;
}

namespace {
/// OpenCV's coefficients of a camera file, (C, n), or (n) or (1, n) for all.
std::vector<gsp::Lens> read_lenses(gsp::io::NpyArray const& array, std::string const& name, std::size_t count, bool fisheye) {
  bool const one = array.shape.size() == 1 || (array.shape.size() == 2 && array.shape[0] == 1);
  std::size_t const n = array.shape.empty() ? 0 : array.shape.back();
  if (!(one || (array.shape.size() == 2 && array.shape[0] == count)) || !(n == 4 || (!fisheye && (n == 5 || n == 8))))
    fail(name, "",
         "has shape " + gsp::io::format_shape(array.shape) + ", expected (" + std::to_string(count) +
             ", n), or (n) or (1, n) for all, with " +
             (fisheye ? "n = 4 coefficients k1 k2 k3 k4" : "n = 4, 5 or 8 coefficients k1 k2 p1 p2 k3 k4 k5 k6") + "; reshape it");
  gsp::io::expect_finite(array, name);
  auto const numbers = array.as<double>(name);
  std::vector<gsp::Lens> lenses;
  auto const row = [&](std::size_t i) {
    auto const from = numbers.begin() + static_cast<std::ptrdiff_t>(i * n);
    return std::vector<double>(from, from + static_cast<std::ptrdiff_t>(n));
  };
  for (std::size_t i = 0; i < (one ? 1 : count); ++i) {
    if (i > 0 && row(i) == row(i - 1)) {
      lenses.push_back(lenses.back());
      continue;
    }
    try {
      lenses.push_back(fisheye ? gsp::fisheye_lens(row(i)) : gsp::opencv_lens(row(i)));
    } catch (std::invalid_argument const& e) { fail(name, "", e.what()); }
  }
  return lenses;
}
}  // namespace

void CameraFile::add(CameraFile const& from, std::size_t i) {
  auto const part = [i](std::vector<float>& to, std::vector<float> const& all, std::size_t n) {
    to.insert(to.end(), all.begin() + static_cast<std::ptrdiff_t>(i * n), all.begin() + static_cast<std::ptrdiff_t>((i + 1) * n));
  };
  part(viewmats, from.viewmats, 16);
  part(Ks, from.Ks, 9);
  if (from.lenses.size() > 1)
    lenses.push_back(from.lenses[i]);
  else
    lenses = from.lenses;
  ++count;
}

std::vector<float> fetch(gsp::runtime::Array const& array) {
  std::vector<float> out(array ? static_cast<std::size_t>(array.size()) : 0);
  if (array)
    gsp::runtime::copy(array,
                       array.rank == 4
                           ? gsp::runtime::host_array(out.data(), {array.extents[0], array.extents[1], array.extents[2], array.extents[3]})
                           : gsp::runtime::host_array(out.data(), {array.extents[0], array.extents[1], array.extents[2]}));
  return out;
}

bool shows_nothing(float const* numbers, std::size_t n) {
  return std::all_of(numbers, numbers + n, [](float x) { return x == 0; });
}

CameraFile read_cameras(std::string const& path, bool quiet) {
  auto const npz = gsp::io::read_npz(path);
  auto const &views = npz.at("viewmats"), &intrinsics = npz.at("Ks");
  auto const key = [&](char const* name) { return path + "[" + name + "]"; };
  gsp::io::expect_shape(views, {-1, 4, 4}, key("viewmats"));
  auto const& shape = intrinsics.shape;
  bool const one = shape == std::vector<std::size_t>{3, 3} || shape == std::vector<std::size_t>{1, 3, 3};
  if (!one && shape != std::vector<std::size_t>{views.shape[0], 3, 3})
    fail(key("Ks"), "",
         "has shape " + gsp::io::format_shape(shape) + ", expected (" + std::to_string(views.shape[0]) +
             ", 3, 3), or (3, 3) or (1, 3, 3) for all; write one for each of viewmats, or one for all");
  if (views.shape[0] == 0) fail(key("viewmats"), "", "holds no cameras; write at least one");
  gsp::io::expect_finite(views, key("viewmats"));
  gsp::io::expect_finite(intrinsics, key("Ks"));
  CameraFile c{views.shape[0], views.as<float>(), intrinsics.as<float>(), {}};
  for (std::size_t i = 1; one && i < c.count; ++i)
    for (std::size_t j = 0; j < 9; ++j) c.Ks.push_back(c.Ks[j]);
  if (npz.contains("distortion") && npz.contains("fisheye"))
    fail(path, "", "has both distortion and fisheye, of which a lens is one; leave one out");
  std::string unused;
  for (auto const& [name, array] : npz.arrays)
    if (name != "viewmats" && name != "Ks" && name != "distortion" && name != "fisheye") unused += (unused.empty() ? "" : ", ") + name;
  if (!unused.empty() && !quiet)
    std::fprintf(stderr, "%s: arrays that are not of cameras: %s (viewmats, Ks, distortion or fisheye are)\n", path.c_str(),
                 unused.c_str());
  for (char const* name : {"distortion", "fisheye"})
    if (npz.contains(name)) c.lenses = read_lenses(npz.at(name), key(name), c.count, name[0] == 'f');
  for (std::size_t i = 0; i < c.count; ++i) {
    float const *v = &c.viewmats[16 * i], *k = &c.Ks[9 * i];
    double worst = 0;  // R R^T = 1
    for (int a = 0; a < 3; ++a)
      for (int b = 0; b < 3; ++b) {
        double sum = 0;
        for (int j = 0; j < 3; ++j) sum += double(v[4 * a + j]) * v[4 * b + j];
        worst = std::max(worst, std::abs(sum - (a == b)));
      }
    double const det = double(v[0]) * (double(v[5]) * v[10] - double(v[6]) * v[9]) -
                       double(v[1]) * (double(v[4]) * v[10] - double(v[6]) * v[8]) +
                       double(v[2]) * (double(v[4]) * v[9] - double(v[5]) * v[8]);
    if (!(worst < 1e-3) || !(det > 0))
      fail(key("viewmats"), "camera " + std::to_string(i),
           "its upper left 3 x 3 is no rotation; write world-to-camera matrices with rows x right, y down, z forward");
    if (v[12] != 0 || v[13] != 0 || v[14] != 0 || v[15] != 1)
      fail(key("viewmats"), "camera " + std::to_string(i), "its last row is not 0 0 0 1; write row-major world-to-camera matrices");
    if (!(k[0] > 0) || !(k[4] > 0))
      fail(key("Ks"), "camera " + std::to_string(i), "a focal length is not positive; write fx 0 cx, 0 fy cy, 0 0 1 in pixels");
    if (k[1] != 0 || k[3] != 0 || k[6] != 0 || k[7] != 0 || k[8] != 1)
      fail(key("Ks"), "camera " + std::to_string(i), "has skew or a last row other than 0 0 1; write fx 0 cx, 0 fy cy, 0 0 1");
  }
  return c;
}

void expect_writable(std::string const& path, char const* option) {
  std::error_code error;
  if (std::filesystem::is_directory(path, error)) throw Error(path + ": " + option + " names a folder; name a file");
  auto const parent = std::filesystem::path(path).parent_path();
  if (!parent.empty() && !std::filesystem::is_directory(parent, error))
    throw Error(path + ": the folder that " + option + " names does not exist; create it first");
  gsp::io::expect_writable(path);
}

namespace {
/// Where bytes that are written to `path` end up: behind all links, of files that are not there yet too.
std::filesystem::path destination(std::filesystem::path path) {
  namespace fs = std::filesystem;
  std::error_code error;
  if (fs::exists(path, error)) return fs::canonical(path, error);
  for (int links = 0; links < 40 && fs::is_symlink(fs::symlink_status(path, error)); ++links)
    path = path.parent_path() / fs::read_symlink(path, error);
  return fs::weakly_canonical(fs::absolute(path, error), error);
}
bool one_file(std::string const& a, std::string const& b) {
  std::error_code error;
  if (std::filesystem::is_character_file(a, error)) return false;
  return std::filesystem::equivalent(a, b, error) || destination(a) == destination(b);
}
}  // namespace
void expect_apart(std::vector<NamedFile> const& inputs, std::vector<NamedFile> const& outputs) {
  for (std::size_t i = 0; i < outputs.size(); ++i) {
    auto const& [option, path] = outputs[i];
    for (auto const& input : inputs)
      if (one_file(path, input.path))
        throw Error(path + ": " + option + " would replace what " + input.option + " names (" + input.path + "); name another file");
    for (std::size_t k = 0; k < i; ++k)
      if (one_file(path, outputs[k].path))
        throw Error(path + ": " + option + " would replace what " + outputs[k].option + " writes; name two files");
  }
}
std::FILE* text_beside(std::optional<std::string> const& output) {
  struct stat file {
  }, standard{};
  bool const same = output && ::stat(output->c_str(), &file) == 0 && ::fstat(1, &standard) == 0 && file.st_dev == standard.st_dev &&
                    file.st_ino == standard.st_ino;
  return same ? stderr : stdout;
}

void make_folder(std::string const& path, char const* option) {
  std::error_code error;
  std::filesystem::create_directories(path, error);
  if (!std::filesystem::is_directory(path))
    throw Error(path + ": the folder that " + option + " names cannot be made" + (error ? " (" + error.message() + ")" : "") +
                "; name another");
}

std::string hash_of(std::vector<std::vector<double> const*> const& parts) {
  std::uint64_t hash = 14695981039346656037ull;
  for (auto const* part : parts) {
    auto const* bytes = reinterpret_cast<unsigned char const*>(part->data());
    for (std::size_t i = 0; i < part->size() * sizeof(double); ++i) hash = (hash ^ bytes[i]) * 1099511628211ull;
  }
  char text[17];
  std::snprintf(text, sizeof text, "%016llx", static_cast<unsigned long long>(hash));
  return text;
}

}  // namespace gsp_cli
