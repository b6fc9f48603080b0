#pragma once
// The Stepper over Kokkos; stepper_float_kernels.cpp and stepper_double_kernels.cpp instantiate it.
#include <algorithm>
#include <cmath>
#include <cstring>
#include <gsp/collision/geom_values.hpp>
#include <gsp/constraint/contact_forces.hpp>
#include <gsp/dynamics/inverse.hpp>
#include <gsp/dynamics/jacobian.hpp>
#include <gsp/dynamics/set_constants.hpp>
#include <gsp/model/keyframe.hpp>
#include <gsp/runtime/session.hpp>
#include <gsp/runtime/stepper.hpp>
#include <gsp/sensor/cameras.hpp>
#include <gsp/sensor/read_sensors.hpp>
#include <gsp/solver/residual.hpp>
#include <gsp/step/bytes_needed.hpp>
#include <gsp/step/detail/sleep_kernels.hpp>
#include <gsp/step/snapshot.hpp>
#include <gsp/step/tiles.hpp>
#include <limits>
#include <list>
#include <optional>

#include "device.hpp"

namespace gsp::runtime {

/// position = qpos + qpos_low, from float64.
template <class R>
struct SplitPositions {
  double const* from;
  R* qpos;
  R* qpos_low;
  std::int64_t period;  // one row is given to all worlds where it is shorter than all
  KOKKOS_FUNCTION void operator()(std::int64_t i) const {
    double const q = from[i % period];
    qpos[i] = R(q);
    qpos_low[i] = R(q - double(qpos[i]));
  }
};
/// The new velocities of the last step, of worlds that it left as they were too.
template <class R, class Mem>
struct NewVelocities {
  Model<R, Mem> model;
  Dynamics<R, Mem> dynamics;
  Kokkos::View<R**, Kokkos::LayoutRight, Mem> velocity;  // (worlds, nv) out
  KOKKOS_FUNCTION void operator()(int w) const {
    for (int t = 0; t < model.ntree; ++t) {
      TreeItems<R> const items = dynamics.tree(model, w, t);
      gsp::detail::TreeRange<R, Mem> const at(model, t);
      for (int i = 0; i < at.nv; ++i) velocity(w, at.dof0 + i) = items[items.at.velocity + i];
    }
  }
};

/// The worse of two numbers: what is not finite, then what is larger; the first of equals.
inline bool is_worse(double a, double b) {
  if (!std::isfinite(b)) return false;
  return !std::isfinite(a) || std::abs(a) > std::abs(b);
}

inline SimulationOptions simulation_options(StepperOptions const& o) {
  return {.worlds = o.worlds, .cone = o.cone, .friction_time = o.friction_time};
}

/// What a name of `world_fields` stands for: a field of the model, of geoms as collisions have them, or both.
struct WorldField {
  std::optional<ModelField> of_model;
  std::optional<GeomField> of_geoms;
};
inline std::string_view geom_prefix() { return "geom_"; }
inline WorldField world_field(std::string const& name) {
  WorldField field;
  for (auto const& row : gsp::detail::geom_field_table<CollisionModel<float, Kokkos::HostSpace>>())
    if (name == std::string(geom_prefix()) + row.name) field.of_geoms = row.field;
  for (ModelField const f : model_fields())
    if (name == info(f).name && info(f).use.per_world && !info(f).use.follows) field.of_model = f;
  if (!field.of_model && !field.of_geoms)
    throw Error("no field '" + name + "' may differ from world to world: world_fields names those that may");
  return field;
}

template <class R, class Exec>
Model<R, typename Exec::memory_space> make_runtime_model(Exec const& exec, CompiledModel const& m, StepperOptions const& o) {
  auto model = make_model<R>(exec, m, {.profile = o.mujoco ? Profile::mujoco : Profile::stable, .timestep = o.timestep});
  std::vector<ModelField> fields;
  for (auto const& name : o.per_world)
    if (auto const field = world_field(name); field.of_model) fields.push_back(*field.of_model);
  if (!fields.empty()) make_per_world(exec, model, fields, o.worlds);
  return model;
}

/// Threads that find work: small worlds are stepped a pack at a time and their islands solved so, with Newton's method (profile mujoco) one
/// at a time. One more finds none, and waking it for each kernel costs more than the kernels of few worlds.
template <class R>
int useful_threads(CompiledModel const& m, StepperOptions const& o) {
  if (o.threads > 0) return o.threads;
  if (o.mujoco) return o.worlds;
  constexpr int width = native_width<R>;
  std::int64_t const islands = std::int64_t(o.worlds) * std::max(1, m.ntree);
  return m.nv <= gsp::detail::lockstep_most_dofs ? int(std::min<std::int64_t>((islands + width - 1) / width, most_threads)) : most_threads;
}
template <class R, class Exec>
Exec stepping_exec([[maybe_unused]] CompiledModel const& m, [[maybe_unused]] StepperOptions const& o) {
#ifdef KOKKOS_ENABLE_OPENMP
  if constexpr (std::is_same_v<Exec, Kokkos::OpenMP>)
    if (int const threads = useful_threads<R>(m, o); threads < Exec().concurrency()) return Exec(threads);
#endif
  return Exec();
}

inline std::string shape_of(Array const& a) {
  std::string text = "(";
  for (int k = 0; k < a.rank; ++k) text += (k == 0 ? "" : ", ") + std::to_string(a.extents[k]);
  return text + (a.dtype == Dtype::float32   ? ") float32"
                 : a.dtype == Dtype::float64 ? ") float64"
                 : a.dtype == Dtype::int32   ? ") int32"
                 : a.dtype == Dtype::int64   ? ") int64"
                                             : ") uint32");
}

template <class... Types>
constexpr int types_in(std::type_identity<ConstraintList<Types...>>) {
  return sizeof...(Types);
}
/// A view of any rank; unsigned numbers as those with a sign.
template <class Exec, class View>
Array array_of_any(View const& view) {
  using Item = typename View::value_type;
  using Signed = std::conditional_t<std::is_same_v<Item, std::uint64_t>, std::int64_t,
                                    std::conditional_t<std::is_same_v<Item, std::uint32_t>, int, Item>>;
  Array a = make_array(view.data(), dtype_of<Signed>(), device_of<Exec>(), {});
  std::int64_t step = 1;
  a.rank = static_cast<int>(view.rank());
  for (int k = a.rank; k-- > 0; step *= a.extents[k]) {
    a.extents[k] = static_cast<std::int64_t>(view.extent(k));
    a.strides[k] = step;
  }
  return a;
}
/// The arrays of a snapshot, of so many impulses. Names of constraint types are left out: they hang
/// on the compiler.
template <class Exec, class R, class Mem>
std::vector<NamedArray> arrays_of(Snapshot<R, Mem> const& s, std::int64_t rows) {
  std::vector<NamedArray> out;
  auto const add = [&](std::string const& name, auto const& view) { out.push_back({name, array_of_any<Exec>(view)}); };
  gsp::detail::each_state_view([&](char const* name, auto const& view) { add(std::string("state.") + name, view); }, s.state);
  if (s.sleep.calm.data())
    gsp::detail::each_sleep_view([&](char const* name, auto const& view) { add(std::string("sleep.") + name, view); }, s.sleep);
  auto const& i = s.impulses;
  add("impulses.first", i.first);
  add("impulses.count", i.count);
  add("impulses.kept", i.kept);
  std::size_t const pool = out.size();
  add("impulses.p", i.p);
  add("impulses.id", i.id);
  add("impulses.place", i.place);
  for (std::size_t k = pool; k < out.size(); ++k) out[k].array = out[k].array.rows(0, rows);
  return out;
}
/// Those of late sensors.
template <class Exec, class R, class Mem>
std::vector<NamedArray> arrays_of(SensorHistory<R, Mem> const& h) {
  std::vector<NamedArray> out;
  if (h.count() > 0)
    gsp::detail::each_history_view(
        [&](char const* name, auto const& view) {
          out.push_back({std::string("sensors.") + name, array_of_any<Exec>(view)});
        },
        h);
  return out;
}

template <class R, class Exec, class Mem>
CollisionModel<R, Mem> make_runtime_collision_model(Exec const& exec, Model<R, Mem> const& model, CompiledModel const& m,
                                                    StepperOptions const& o) {
  gsp::detail::expects_can_step(model, m, simulation_options(o));  // before shapes are made of it
  auto collision = make_collision_model<R>(exec, m);
  std::vector<GeomField> fields;
  for (auto const& name : o.per_world)
    if (auto const field = world_field(name); field.of_geoms) fields.push_back(*field.of_geoms);
  if (!fields.empty()) make_per_world(exec, collision, fields, o.worlds);
  return collision;
}

template <class R, class Exec>
class KokkosStepper : public Stepper {
  using Mem = typename Exec::memory_space;

 public:
  KokkosStepper(CompiledModel const& m, StepperOptions const& o)
      : exec_(stepping_exec<R, Exec>(m, o)),
        model_(make_runtime_model<R>(exec_, m, o)),
        state_(make_state(exec_, model_, {.worlds = o.worlds})),
        collision_(make_runtime_collision_model(exec_, model_, m, o)),
        tiles_(make_tiles(exec_, model_, m, collision_, state_, {.simulation = simulation_options(o)})),
        parts_(tiles_.size()),
        compiled_(m),
        per_world_(o.per_world),
        joint_of_dof_(m.dof_jnt),
        joint_qpos_(m.jnt_qposadr),
        timestep_(o.timestep > 0 ? o.timestep : m.option.timestep) {
    auto const set = [&](auto& solver) {
      if (o.iterations > 0) solver.iterations = o.iterations;
      if (o.tolerance) solver.tolerance = static_cast<float>(*o.tolerance);
    };
    if (o.mujoco)
      set(newton_);
    else
      set(solver_);
    join_tiles();
    // Late sensors measure at each step, asked or not: what they say must not hang on when somebody asks.
    auto const is_late = [](SensorDescription const& sensor) {
      return std::any_of(sensor.settings.begin(), sensor.settings.end(),
                         [](auto const& one) { return one[0] == "delay" || one[0] == "interval" || one[0] == "nsample"; });
    };
    if (std::any_of(m.sensors.begin(), m.sensors.end(), is_late)) make_sensors_once();
  }

  double timestep() const override { return timestep_; }
  int threads() const override { return gsp::is_device<Exec> ? 0 : exec_.concurrency(); }
  StateArrays state() const override {
    auto const array = [](auto const& view) { return array_of<Exec>(view); };
    return {array(state_.qpos),  array(state_.qpos_low),  array(state_.qvel),       array(state_.ctrl),
            array(state_.act),   array(state_.mocap_pos), array(state_.mocap_quat), array(state_.qfrc_applied),
            array(state_.steps), array(state_.status),    array(state_.eq_active)};
  }
  PoseArrays poses() override {
    if (stale_) pose();
    return {array_of<Exec>(poses_.xpos), array_of<Exec>(poses_.xquat), array_of<Exec>(poses_.xanchor), array_of<Exec>(poses_.xaxis)};
  }

  void set(Array const& qpos, Array const& qvel, Array const& ctrl) override {
    if (qpos) {
      expects(qpos.rank == 2 && qpos.extents[1] == model_.nq && (qpos.extents[0] == 1 || qpos.extents[0] == state_.worlds),
              "gsp::runtime::Stepper::set: qpos must be (worlds, nq), or one row for all");
      Buffer const exact = make_buffer(device_of<Exec>(), Dtype::float64, {qpos.extents[0], qpos.extents[1]});
      copy(qpos, exact.array);
      Kokkos::parallel_for("gsp::runtime::set_positions",
                           Kokkos::RangePolicy<Exec, Kokkos::IndexType<std::int64_t>>(exec_, 0, std::int64_t(state_.qpos.size())),
                           SplitPositions<R>{static_cast<double const*>(exact.array.data), state_.qpos.data(), state_.qpos_low.data(),
                                             std::max<std::int64_t>(1, qpos.size())});
      exec_.fence("gsp::runtime::Stepper::set: the positions are there");
    }
    if (qvel) copy(qvel, array_of<Exec>(state_.qvel));
    if (ctrl) copy(ctrl, array_of<Exec>(state_.ctrl));
    stale_ = true;
  }
  void get(Array qpos, Array qvel) const override {
    auto const arrays = state();
    if (qvel) copy(arrays.qvel, qvel);
    if (!qpos) return;
    expects(qpos.dtype == Dtype::float64 && qpos.device == Device::cpu && qpos.contiguous(),
            "gsp::runtime::Stepper::get: positions go into a float64 array of the host");
    copy(arrays.qpos, qpos);
    if (std::is_same_v<R, double>) return;  // there is nothing that rounding took
    std::vector<double> low(static_cast<std::size_t>(qpos.size()));
    copy(arrays.qpos_low, host_array(low.data(), {qpos.extents[0], qpos.extents[1]}));
    for (std::size_t i = 0; i < low.size(); ++i) static_cast<double*>(qpos.data)[i] += low[i];
  }

  void forward() override {
    write_what_stays();
    pose();
  }
  void reset(Array const& mask, int keyframe) override {
    expects_mask("reset", mask);
    write_what_stays();
    each_masked(mask, [&](auto& tile, Part& part, auto const& of) {
      if (keyframe >= 0)
        set_keyframe(tile.exec, tile.model, compiled_, keyframe, tile.state, of);
      else
        gsp::reset(tile.exec, tile.model, tile.state, of);
      if (part.sensors && part.sensors->history.count() > 0) reset_sensor_history(tile.exec, part.sensors->history, of);
    });
    stale_ = true;
  }
  Array world_values(std::string const& name) override {
    auto const field = per_world_field(name);
    auto const [items, components] = shape_of_field(field);
    values_ = gsp::detail::allocate<decltype(values_)>("gsp::runtime::Stepper::values", state_.worlds, items, components);
    if (values_.size() == 0) return array_of_any<Exec>(values_);
    if (field.of_model) {
      gsp::detail::copy_bytes(exec_, values_.data(), gsp::world_values(model_, *field.of_model).data(), gsp::detail::bytes_of(values_));
    } else {
      Kokkos::deep_copy(exec_, values_, std::numeric_limits<R>::quiet_NaN());
      copy_world_values(exec_, collision_, *field.of_geoms, values_);
    }
    exec_.fence("gsp::runtime::Stepper::world_values: the numbers are there");
    return array_of_any<Exec>(values_);
  }
  void set_world_values(std::string const& name, Array const& values, Array const& mask, bool scale_inertia) override {
    auto const field = per_world_field(name);
    auto const [items, components] = shape_of_field(field);
    expects_mask("set_world_values", mask);
    bool const flat = values.rank == 2 && components == 1;
    bool const fits = (values.rank == 3 || flat) && (values.extents[0] == 1 || values.extents[0] == state_.worlds) &&
                      values.extents[1] == items && (flat || values.extents[2] == components);
    if (!fits)
      throw Error("values of '" + name + "' are " + shape_of(values) + " and must be (" + std::to_string(state_.worlds) + ", " +
                  std::to_string(items) + ", " + std::to_string(components) + "), or one row for all worlds");
    auto const own = gsp::detail::allocate<decltype(values_)>("gsp::runtime::Stepper::new_values", state_.worlds, items, components);
    Array to = array_of_any<Exec>(own);
    if (flat) to.rank = 2;
    if (to.size() == 0) return;
    copy(values, to);
    if (scale_inertia && name == "body_mass") expect_masses(own, mask);
    expects(field.of_model || !scale_inertia, "gsp::runtime::Stepper::set_world_values: scale_inertia is for body_mass");
    each_masked(mask, [&](auto& tile, Part&, auto const& of) {
      auto const rows = gsp::detail::rows_of(own, tile.first, tile.worlds());
      if (field.of_model) gsp::set_world_values(tile.exec, tile.model, *field.of_model, rows, of, {.scale_inertia = scale_inertia});
      if (field.of_geoms) gsp::set_world_values(tile.exec, tile.simulation.collision, *field.of_geoms, rows, of);
      if (field.of_model && info(*field.of_model).use.decides) set_constants(tile.exec, tile.model, tile.simulation.dynamics, of);
      wake(tile.exec, tile.simulation.sleep, of);
    });
    stale_ = true;
  }
  Array mass_matrix() override {
    if (!mass_matrix_.data())
      mass_matrix_ = gsp::detail::allocate_zero<decltype(mass_matrix_)>(exec_, "gsp::runtime::Stepper::mass_matrix", state_.worlds,
                                                                        model_.nv, model_.nv);
    each_smooth([&](auto& tile) {
      auto rows = gsp::detail::rows_of(mass_matrix_, tile.first, tile.worlds());
      dense_mass_matrix(tile.exec, tile.model, tile.simulation.dynamics, rows);
    });
    exec_.fence("gsp::runtime::Stepper::mass_matrix: it is there");
    return array_of_any<Exec>(mass_matrix_);
  }
  Array smooth_forces(SmoothForces which) override {
    auto& out = smooth_[int(which)];
    if (!out.data())
      out = gsp::detail::allocate_zero<std::decay_t<decltype(out)>>(exec_, "gsp::runtime::Stepper::smooth", state_.worlds, model_.nv);
    using Items = gsp::detail::DofItems;
    Items const item = which == SmoothForces::passive    ? Items(&DynamicsLayout::passive)
                       : which == SmoothForces::actuator ? Items(&DynamicsLayout::actuator)
                       : which == SmoothForces::bias     ? Items(&DynamicsLayout::bias)
                                                         : Items(&DynamicsLayout::acceleration);
    each_smooth([&](auto& tile) {
      auto rows = gsp::detail::rows_of(out, tile.first, tile.worlds());
      copy_dofs(tile.exec, tile.model, tile.simulation.dynamics, item, rows);
    });
    exec_.fence("gsp::runtime::Stepper::smooth_forces: they are there");
    return array_of_any<Exec>(out);
  }
  Array body_jacobian(int body, std::array<double, 3> const& point) override {
    return jacobian([&](auto& tile, auto& out) {
      auto const& sim = tile.simulation;
      gsp::body_jacobian(tile.exec, tile.model, sim.poses, sim.dynamics, body, {R(point[0]), R(point[1]), R(point[2])}, out);
    });
  }
  Array site_jacobian(int site) override {
    return jacobian([&](auto& tile, auto& out) {
      gsp::site_jacobian(tile.exec, tile.model, tile.simulation.poses, tile.simulation.dynamics, site, out);
    });
  }
  Array inverse_dynamics(Array const& qacc) override {
    expects(qacc.rank == 2 && (qacc.extents[0] == 1 || qacc.extents[0] == state_.worlds) && qacc.extents[1] == model_.nv,
            "gsp::runtime::Stepper::inverse_dynamics: qacc must be (worlds, nv), or one row for all");
    for (auto* const v : {&qacc_, &qfrc_})
      if (!v->data())
        *v = gsp::detail::allocate_zero<std::decay_t<decltype(*v)>>(exec_, "gsp::runtime::Stepper::qacc", state_.worlds, model_.nv);
    if (model_.nv > 0) copy(qacc, array_of_any<Exec>(qacc_));
    each_smooth([&](auto& tile) {
      auto const in = gsp::detail::rows_of(qacc_, tile.first, tile.worlds());
      auto out = gsp::detail::rows_of(qfrc_, tile.first, tile.worlds());
      gsp::inverse_dynamics(tile.exec, tile.model, tile.simulation.dynamics, in, out);
    });
    exec_.fence("gsp::runtime::Stepper::inverse_dynamics: it is there");
    return array_of_any<Exec>(qfrc_);
  }
  std::vector<NamedArray> save() override {
    std::vector<std::vector<NamedArray>> of_tiles(tiles_.size());
    each([&](auto& tile, Part& part) {
      if (part.snapshot)
        gsp::save(tile.exec, tile.state, tile.simulation, *part.snapshot);
      else
        part.snapshot = make_snapshot(tile.exec, tile.state, tile.simulation);
      auto const& i = part.snapshot->impulses;
      auto const first = gsp::detail::to_host(tile.exec, i.first), count = gsp::detail::to_host(tile.exec, i.count),
                 kept = gsp::detail::to_host(tile.exec, i.kept);
      auto& out = of_tiles[part.index];
      out = arrays_of<Exec>(*part.snapshot, first.back() + count.back() + kept.back());
      if (!part.sensors) return;
      auto const late = arrays_of<Exec>(part.sensors->history);
      out.insert(out.end(), late.begin(), late.end());
    });
    if (tiles_.size() == 1) return of_tiles.front();
    std::vector<NamedArray> out = of_tiles.front();
    saved_.resize(out.size());
    for (std::size_t a = 0; a < out.size(); ++a) {
      std::vector<Array> pieces;
      for (auto const& one : of_tiles) pieces.push_back(one[a].array);
      out[a].array = one_after_the_other(pieces, saved_[a], 0);
      if (out[a].name == "impulses.first") place_behind(static_cast<int*>(out[a].array.data), of_tiles);
    }
    return out;
  }
  void restore(std::vector<NamedArray> const& arrays, Array const& mask) override {
    expects_mask("restore", mask);
    auto const find = [&](std::string const& name) {
      for (auto const& a : arrays)
        if (a.name == name && a.array.rank > 0) return a.array;
      throw Error("there is no array '" + name + "': give all that Stepper::save gave");
    };
    auto const begins = [](NamedArray const& a) { return a.name.starts_with("sleep."); };
    bool const sleeps = std::any_of(arrays.begin(), arrays.end(), begins);
    Simulation<R, Mem> const& like = tiles_.front().simulation;
    if (sleeps && like.sleep.worlds == 0)
      throw Error("islands may sleep there, and here they may not: make the stepper of a model with option.sleep");
    std::int64_t const worlds = find("state.qpos").extents[0], rows = find("impulses.p").extents[0];
    if (worlds != 1 && worlds != state_.worlds)
      throw Error("there are " + std::to_string(worlds) + " worlds, and here " + std::to_string(state_.worlds) +
                  ": give as many, or one for all");
    if (rows > std::numeric_limits<int>::max()) throw Error("array 'impulses.p' is longer than 2147483647: give fewer worlds");
    Snapshot<R, Mem> s;
    gsp::detail::allocate_snapshot(exec_, state_, like, static_cast<int>(worlds), rows, s);
    if (!sleeps) s.sleep = {};
    for (auto const& [name, to] : arrays_of<Exec>(s, rows)) {
      Array const from = find(name);
      bool same = from.rank == to.rank && from.dtype == to.dtype;
      for (int k = 0; k < to.rank && same; ++k) same = from.extents[k] == to.extents[k];
      if (!same)
        throw Error("array '" + name + "' is " + shape_of(from) + " and must be " + shape_of(to) + ": give what Stepper::save gave");
      copy(from, to);
    }
    expect_in_range(s, rows);
    expect_numbers(s);
    auto const late = late_of(arrays, static_cast<int>(worlds));
    auto const list = model_constraints(model_, state_, like.poses, like.dynamics, like.collision, like.contacts, like.cone);
    auto const names = gsp::detail::names_of(list);
    static_assert(types_in(std::type_identity<std::remove_const_t<decltype(list)>>()) == 8,
                  "step has other constraint types: raise snapshot_version, and this number");
    gsp::detail::upload_bytes(exec_, s.impulses.type_names.data(), names.name, std::size_t(names.count) * sizeof names.name[0]);
    write_what_stays();
    bool const all = worlds == 1 || tiles_.size() == 1;
    auto const first = all ? std::vector<int>{} : gsp::detail::to_host(exec_, s.impulses.first);
    each_masked(mask, [&](auto& tile, Part& part, auto const& of) {
      gsp::restore(tile.exec, all ? s : of_tile(tile, s, first), tile.state, tile.simulation, of);
      if (late)
        copy_sensor_history(tile.exec, all ? *late : of_tile(tile, *late), part.sensors->history, of);
      else if (part.sensors)
        reset_sensor_history(tile.exec, part.sensors->history, of);
    });
    kept_contacts_.reset();
    has_stepped_ = false;
    stale_ = true;
  }
  void step(StepOptions const& options) override {
    solver_.residual = newton_.residual = options.measure_residual;
    each([&](auto& tile, Part& part) {
      bool const late = part.sensors && part.sensors->history.count() > 0;
      for (int k = 0; k < options.steps && late; ++k) step_late(tile, part);
      if (!late)
        gsp::step(tile.exec, tile.model, tile.state, tile.simulation,
                  {.steps = options.steps, .solver = solver_, .newton = newton_, .poses = false});
    });
    kept_contacts_.reset();
    has_stepped_ = has_stepped_ || options.steps > 0;
    stale_ = true;  // poses of the end where somebody asks for them: a call of one step would pay for them each time
  }

  StepCounts counts() const override {
    StepCounts out;
    for (auto const bits : gsp::detail::to_host(exec_, state_.status)) out.failed_worlds += (bits & status::stopped) != 0;
    if (!model_.constraints) return out;
    out.residual = std::numeric_limits<double>::quiet_NaN();
    int const most = model_.profile == Profile::mujoco ? newton_.iterations : solver_.iterations;
    for (auto const& tile : tiles_) {
      auto const& sim = tile.simulation;
      out.contacts += sim.contacts.demand(exec_).contacts;
      for (int const n : gsp::detail::to_host(exec_, sim.rows.count)) out.rows += n;
      for (int const n : gsp::detail::to_host(exec_, sim.rows.kept)) out.kept += n;
      for (int const n : gsp::detail::to_host(exec_, sim.sleep.asleep)) out.asleep += n;
      for (int const n : gsp::detail::to_host(exec_, sim.solution.iterations)) {
        out.iterations = std::max(out.iterations, n);
        out.unfinished_worlds += n >= most;
        out.mean_iterations += double(n) / state_.worlds;
      }
      for (R const r : gsp::detail::to_host(exec_, sim.solution.residual)) out.residual = std::fmax(out.residual, double(r));
    }
    return out;
  }
  StepResiduals residuals() const override {
    StepResiduals out;
    using Part = StepResiduals::Part;
    if (!tiles_.front().simulation.impulses.stamp().solved) {
      double const nan = std::numeric_limits<double>::quiet_NaN();
      Part const unknown{nan, nan};
      return {unknown, unknown, unknown, unknown, unknown, unknown, nan};
    }
    std::vector<Residuals<R, Mem>> left;
    for (auto const& tile : tiles_) {
      left.push_back(make_residuals(exec_, tile.simulation.rows));
      gsp::residuals(exec_, tile.simulation.rows, tile.simulation.impulses, tile.simulation.progress, left.back());
    }
    auto const bits = gsp::detail::to_host(exec_, state_.status);
    auto const part = [&](auto const member) {
      std::vector<R> numbers;
      for (auto const& one : left)
        for (R const x : gsp::detail::to_host(exec_, one.*member)) numbers.push_back(x);
      Part p{};
      int count = 0;
      for (std::size_t w = 0; w < numbers.size(); ++w) {
        if (bits[w] & status::stopped) continue;
        double const x = double(numbers[w]);
        p.most = std::fmax(p.most, x);
        p.mean += x;
        ++count;
      }
      p.mean /= std::max(count, 1);
      return p;
    };
    out.rate = part(&Residuals<R, Mem>::rate);
    out.equality = part(&Residuals<R, Mem>::equality);
    out.complementarity = part(&Residuals<R, Mem>::complementarity);
    out.friction = part(&Residuals<R, Mem>::friction);
    out.bounds = part(&Residuals<R, Mem>::bounds);
    out.cone = part(&Residuals<R, Mem>::cone);
    out.energy = part(&Residuals<R, Mem>::energy).mean;
    return out;
  }
  std::vector<StoppedWorld> stopped(int most) const override {
    std::vector<StoppedWorld> out;
    auto const bits = gsp::detail::to_host(exec_, state_.status);
    for (int w = 0; w < state_.worlds && int(out.size()) < most; ++w)
      if (bits[w] & status::stopped) out.push_back({.world = w, .status = bits[w]});
    if (out.empty()) return out;
    auto const velocity =
        gsp::detail::allocate<Kokkos::View<R**, Kokkos::LayoutRight, Mem>>("gsp::runtime::Stepper::new_velocity", state_.worlds, model_.nv);
    for (auto const& tile : tiles_)
      Kokkos::parallel_for(
          "gsp::runtime::new_velocities", Kokkos::RangePolicy<Exec>(exec_, 0, tile.worlds()),
          NewVelocities<R, Mem>{tile.model, tile.simulation.dynamics, gsp::detail::rows_of(velocity, tile.first, tile.worlds())});
    auto const v = gsp::detail::to_host(exec_, velocity), q = gsp::detail::to_host(exec_, state_.qpos);
    auto const steps = gsp::detail::to_host(exec_, state_.steps);
    auto const bad = [](double x) { return !(std::abs(x) <= state_bound); };
    for (StoppedWorld& s : out) {
      s.steps = steps[s.world];
      for (int i = 0; i < model_.nv; ++i) {
        double const x = v[std::size_t(s.world) * model_.nv + i];
        if (!bad(x)) continue;
        if (s.dofs++ > 0 && !is_worse(x, s.number)) continue;
        s.number = x;
        s.dof = i;
        s.joint = joint_of_dof_[i];
      }
      for (int i = 0; i < model_.nq && s.dofs == 0 && !s.position; ++i) {
        double const x = q[std::size_t(s.world) * model_.nq + i];
        if (!bad(x)) continue;
        s.number = x;
        s.position = true;
        s.joint = int(std::upper_bound(joint_qpos_.begin(), joint_qpos_.end(), i) - joint_qpos_.begin()) - 1;
      }
    }
    return out;
  }
  ContactArrays contacts() override {
    if (kept_contacts_) return *kept_contacts_;
    if (!has_stepped_) return no_contacts();
    ContactArrays const found = contacts_of_step();
    exec_.fence("gsp::runtime::Stepper::contacts: the forces are there");
    return found;
  }
  Array qfrc_constraint() const override { return array_of<Exec>(qfrc_constraint_); }
  Array sensors() override {
    if (compiled_.sensors.empty()) return make_array(nullptr, dtype_of<R>(), device_of<Exec>(), {state_.worlds, 0});
    make_sensors_once();
    keep_contacts();
    each([&](auto& tile, Part& part) { evaluate(tile, part, [&] { read_all(tile, part); }); });
    exec_.fence("gsp::runtime::Stepper::sensors: the numbers are there");
    stale_ = true;
    return array_of<Exec>(sensordata_);
  }
  CameraArrays cameras(std::vector<CameraSpec> const& specs, int width, int height) override {
    auto const found = std::find_if(cameras_.begin(), cameras_.end(), [&](auto const& set) {
      return set->mounts.width == width && set->mounts.height == height && set->specs == specs;
    });
    if (found != cameras_.end()) {
      cameras_.splice(cameras_.begin(), cameras_, found);
    } else {
      std::vector<CameraMount> mounts;
      for (CameraSpec const& s : specs)
        mounts.push_back({.camera = s.camera, .body = s.body, .pos = s.pos, .quat = s.quat, .fovy = s.fovy});
      auto const set = std::make_shared<CameraSet>(CameraSet{
          specs, make_camera_mounts(exec_, model_, compiled_, mounts, {.worlds = state_.worlds, .width = width, .height = height}), {}});
      set->cameras = make_cameras(exec_, set->mounts.images());
      cameras_.push_front(set);
      if (cameras_.size() > most_camera_sets) cameras_.pop_back();
    }
    static_cast<void>(poses());
    CameraSet& set = *cameras_.front();
    cameras_of(exec_, model_, poses_, set.mounts, set.cameras);
    exec_.fence("gsp::runtime::Stepper::cameras: they are there");
    return {array_of<Exec>(set.cameras.viewmats), array_of<Exec>(set.cameras.Ks), array_of<Exec>(set.cameras.world), {}, cameras_.front()};
  }
  std::vector<std::string> sensors_left_out() override {
    if (compiled_.sensors.empty()) return {};
    make_sensors_once();
    return parts_.front().sensors->why;
  }

 private:
  /// What a tile has besides its simulation.
  struct Part {
    std::size_t index = 0;
    std::optional<Sensors<R, Mem>> sensors;
    std::optional<Snapshot<R, Mem>> snapshot, before_sensors;
    Kokkos::View<R* [6], Kokkos::LayoutRight, Mem> contact_force;
  };
  /// Poses and forces of all tiles lie in one array each: of one tile in its own.
  void join_tiles() {
    for (std::size_t k = 0; k < parts_.size(); ++k) parts_[k].index = k;
    if (tiles_.size() == 1) {
      auto const& sim = tiles_.front().simulation;
      poses_ = sim.poses;
      qfrc_constraint_ = sim.solution.qfrc_constraint;
    } else {
      poses_ = make_poses(exec_, model_, {.worlds = state_.worlds});
      poses_.stamp = {};  // the tiles' own say of which state they are
      qfrc_constraint_ =
          gsp::detail::allocate_zero<decltype(qfrc_constraint_)>(exec_, "gsp::runtime::Stepper::qfrc_constraint", state_.worlds, model_.nv);
      for (auto& tile : tiles_) {
        tile.simulation.poses = of_worlds(poses_, tile.first, tile.worlds());
        tile.simulation.solution.qfrc_constraint = gsp::detail::rows_of(qfrc_constraint_, tile.first, tile.worlds());
      }
    }
  }
  /// f(tile, part)
  template <class F>
  void each(F const& f) {
    for_tiles(exec_, tiles_, [&](auto& tile) { f(tile, parts_[std::size_t(&tile - tiles_.data())]); });
  }
  /// f(tile), of which the smooth dynamics of the state as it is are there, all of them kept.
  template <class F>
  void each_smooth(F const& f) {
    each([&](auto& tile, Part&) {
      smooth_dynamics(tile.exec, tile.model, tile.state, tile.simulation.poses, tile.simulation.dynamics, {.keep_all = true});
      f(tile);
    });
  }
  void pose() {
    each(
        [&](auto& tile, Part&) { forward_kinematics(tile.exec, tile.model, tile.state, tile.simulation.poses, tile.simulation.dynamics); });
    stale_ = false;
  }
  /// What steps read, or leave, and never write: whoever wrote into it is put right. Poses of what does not move, which contacts begin
  /// from, and forces of constraints in a model without.
  void write_what_stays() {
    each([&](auto& tile, Part&) {
      auto const& state = tile.state;
      gsp::detail::static_poses(tile.exec, tile.model, state.mocap_pos, state.mocap_quat, tile.simulation.poses);
    });
    if (!model_.constraints && !gsp::detail::has_stiff_rows(model_)) Kokkos::deep_copy(exec_, qfrc_constraint_, R(0));
  }
  /// Inertias in proportion to a mass of 0, or to none, would never be found again.
  template <class Values>
  void expect_masses(Values const& values, Array const& mask) {
    std::vector<int> chosen(std::size_t(state_.worlds), 1);
    if (mask) copy(mask, host_array(chosen.data(), {state_.worlds}));
    auto const next = gsp::detail::to_host(exec_, values);
    auto const was = gsp::detail::to_host(exec_, gsp::world_values(model_, ModelField::body_mass));
    for (std::size_t i = 0; i < next.size(); ++i) {
      std::size_t const w = i / std::size_t(model_.nbody), b = i % std::size_t(model_.nbody);
      if (chosen[w] == 0 || (std::isfinite(next[i]) && (next[i] > 0 || (next[i] == 0 && !(was[i] > 0))))) continue;
      throw Error("the mass of body '" + compiled_.body_name[b] + "' of world " + std::to_string(w) + " is " + std::to_string(next[i]) +
                  ": inertias that change in proportion need masses that are positive and finite");
    }
  }
  ContactArrays no_contacts() const {
    auto const none = [](Dtype dtype, std::int64_t components) {
      return components == 1 ? make_array(nullptr, dtype, device_of<Exec>(), {0})
                             : make_array(nullptr, dtype, device_of<Exec>(), {0, components});
    };
    Dtype const real = dtype_of<R>(), whole = Dtype::int32;
    return {none(whole, 1), none(whole, 1), none(whole, 1), none(real, 1), none(real, 3), none(real, 9), none(real, 6)};
  }
  ContactArrays contacts_of(Tile<R, Exec>& tile, Part& part) {
    auto const& sim = tile.simulation;
    auto const& c = sim.contacts;
    std::int64_t const count = c.demand(tile.exec).contacts;
    auto& force = part.contact_force;
    if (force.extent(0) < c.dist.extent(0))
      force = gsp::detail::allocate<std::decay_t<decltype(force)>>("gsp::runtime::Stepper::contact_force", c.dist.extent(0));
    contact_forces(tile.exec, tile.model, sim.collision, c, sim.rows, sim.impulses, force);
    auto const found = [&](auto const& view) { return array_of<Exec>(view).rows(0, count); };
    return {found(c.world), found(c.geom1), found(c.geom2), found(c.dist), found(c.pos), found(c.frame), found(force)};
  }
  ContactArrays contacts_of_step() {
    std::vector<ContactArrays> found(tiles_.size());
    each([&](auto& tile, Part& part) { found[part.index] = contacts_of(tile, part); });
    return tiles_.size() == 1 ? found.front() : copied(found);
  }
  /// Those of all tiles in arrays that stay until the next call.
  ContactArrays copied(std::vector<ContactArrays> const& found) {
    constexpr Array ContactArrays::*arrays[] = {&ContactArrays::world, &ContactArrays::geom1, &ContactArrays::geom2, &ContactArrays::dist,
                                                &ContactArrays::pos,   &ContactArrays::frame, &ContactArrays::force};
    ContactArrays all;
    std::int64_t room = 0;
    for (auto const& tile : tiles_) room += tile.simulation.contacts.capacity();
    for (std::size_t k = 0; k < std::size(arrays); ++k) {
      std::vector<Array> pieces;
      for (auto const& one : found) pieces.push_back(one.*arrays[k]);
      all.*arrays[k] = one_after_the_other(pieces, contact_buffers_[k], room);
    }
    if (found.size() == 1) return all;
    int* world = static_cast<int*>(all.world.data);  // several tiles are on a host
    for (std::size_t k = 0; k < found.size(); ++k)
      for (std::int64_t i = 0; i < found[k].world.extents[0]; ++i) *world++ += tiles_[k].first;
    return all;
  }
  /// Rows of the pieces, those of the first tile first, in memory of `to`, which gets room for so many rows at least where it has none for
  /// these.
  static Array one_after_the_other(std::vector<Array> const& pieces, Buffer& to, std::int64_t room) {
    Array const& like = pieces.front();
    std::int64_t rows = 0;
    for (auto const& piece : pieces) rows += piece.extents[0];
    if (!to.owner || to.array.extents[0] < rows) {
      auto const& e = like.extents;
      Device const device = device_of<Exec>();
      std::int64_t const most = std::max(room, rows);
      to = like.rank == 1   ? make_buffer(device, like.dtype, {most})
           : like.rank == 2 ? make_buffer(device, like.dtype, {most, e[1]})
                            : make_buffer(device, like.dtype, {most, e[1], e[2]});
    }
    std::int64_t at = 0;
    for (auto const& piece : pieces) {
      Array const rows_there = to.array.rows(at, piece.extents[0]);
      if constexpr (gsp::is_device<Exec>)
        copy(piece, rows_there);
      else if (piece.size() > 0)  // whole rows, one after the other: `copy` would ask all threads for each
        std::memcpy(rows_there.data, piece.data, std::size_t(piece.size() * bytes_of(piece.dtype)));
      at += piece.extents[0];
    }
    return to.array.rows(0, rows);
  }
  /// Contacts of the last step are put aside before those of the state take their place.
  void keep_contacts() {
    if (!has_stepped_ || kept_contacts_) return;
    ContactArrays const now = contacts_of_step();
    kept_contacts_ = tiles_.size() == 1 ? copied({now}) : now;
  }
  void expects_mask(char const* call, Array const& mask) const {
    expects(!mask || (mask.rank == 1 && mask.extents[0] == state_.worlds && mask.dtype == Dtype::int32),
            std::string("gsp::runtime::Stepper::") + call + ": the mask must be (worlds) int32");
  }
  /// f(tile, part, those of its worlds that are of the mask), and waits until the device has done what it launches: then the mask may go.
  template <class F>
  void each_masked(Array const& mask, F const& f) {
    Kokkos::View<int*, Mem> chosen;
    if (mask) {
      chosen = gsp::detail::allocate<decltype(chosen)>("gsp::runtime::Stepper::mask", state_.worlds);
      copy(mask, array_of<Exec>(chosen));
      each([&](auto& tile, Part& part) { f(tile, part, gsp::detail::rows_of(chosen, tile.first, tile.worlds())); });
    } else {
      each([&](auto& tile, Part& part) { f(tile, part, gsp::AllWorlds{}); });
    }
    exec_.fence("gsp::runtime::Stepper: the mask may go");
  }
  WorldField per_world_field(std::string const& name) const {
    auto const field = world_field(name);
    if (std::find(per_world_.begin(), per_world_.end(), name) == per_world_.end())
      throw Error("field '" + name + "' is the same for all worlds: name it in per_world when you make them");
    return field;
  }
  std::pair<int, int> shape_of_field(WorldField const& field) const {
    if (field.of_model) {
      auto const what = info(*field.of_model);
      return {gsp::detail::count(model_, what.item), what.components};
    }
    return {model_.ngeom, gsp::detail::geom_field_row<CollisionModel<R, Mem>>(*field.of_geoms).components};
  }
  template <class F>
  Array jacobian(F const& write) {
    if (!jacobian_.data())
      jacobian_ = gsp::detail::allocate_zero<decltype(jacobian_)>(exec_, "gsp::runtime::Stepper::jacobian", state_.worlds, 6, model_.nv);
    each_smooth([&](auto& tile) {
      auto rows = gsp::detail::rows_of(jacobian_, tile.first, tile.worlds());
      write(tile, rows);
    });
    exec_.fence("gsp::runtime::Stepper::jacobian: it is there");
    return array_of_any<Exec>(jacobian_);
  }
  /// forward, `then`, and back: forward starts and leaves impulses, and wakes who sleeps; the next step begins from those of the last one.
  template <class F>
  void evaluate(Tile<R, Exec>& tile, Part& part, F const& then) {
    auto& before = part.before_sensors;
    if (before)
      gsp::save(tile.exec, tile.state, tile.simulation, *before);
    else
      before = make_snapshot(tile.exec, tile.state, tile.simulation);
    gsp::forward(tile.exec, tile.model, tile.state, tile.simulation, {.solver = solver_, .newton = newton_});
    then();
    gsp::restore(tile.exec, *before, tile.state, tile.simulation);
  }
  void read_all(Tile<R, Exec>& tile, Part& part) {
    auto const data = gsp::detail::rows_of(sensordata_, tile.first, tile.worlds());
    Kokkos::deep_copy(tile.exec, data, std::numeric_limits<R>::quiet_NaN());
    read_sensors(tile.exec, tile.model, tile.state, tile.simulation, *part.sensors, data);
  }
  /// A step at whose start late sensors measure.
  void step_late(Tile<R, Exec>& tile, Part& part) {
    auto& exec = tile.exec;
    auto& model = tile.model;
    auto& state = tile.state;
    auto& sim = tile.simulation;
    auto const measure = [&] {
      read_all(tile, part);
      record_sensors(exec, state, part.sensors->history);
    };
    if (gsp::detail::has_runge_kutta(model)) {
      evaluate(tile, part, measure);
      gsp::step(exec, model, state, sim, {.solver = solver_, .newton = newton_, .poses = false});
      return;
    }
    gsp::forward(exec, model, state, sim, {.solver = solver_, .newton = newton_});
    measure();
    gsp::advance(exec, model, state, sim);
  }
  /// Impulses begin behind those of the tiles before.
  void place_behind(int* first, std::vector<std::vector<NamedArray>> const& of_tiles) const {
    std::int64_t before = 0;
    for (std::size_t k = 0; k < tiles_.size(); ++k) {
      for (int w = 0; w < tiles_[k].worlds(); ++w) *first++ += static_cast<int>(before);
      for (auto const& a : of_tiles[k])
        if (a.name == "impulses.p") before += a.array.extents[0];
    }
  }
  /// The tile's rows of a snapshot of all worlds, whose impulses begin at `first`.
  Snapshot<R, Mem> of_tile(Tile<R, Exec> const& tile, Snapshot<R, Mem> const& all, std::vector<int> const& first) const {
    auto const rows = [&](char const*, auto const& from, auto& to) { to = gsp::detail::rows_of(from, tile.first, tile.worlds()); };
    Snapshot<R, Mem> out;
    out.state = of_worlds(all.state, tile.first, tile.worlds());
    if (all.sleep.calm.data()) gsp::detail::each_sleep_view(rows, all.sleep, out.sleep);
    auto const& from = all.impulses;
    auto& to = out.impulses;
    rows("count", from.count, to.count);
    rows("kept", from.kept, to.kept);
    to.type_names = from.type_names;
    std::size_t const end = std::size_t(tile.first + tile.worlds());
    int const begin = first[std::size_t(tile.first)];
    int const impulses = (end < first.size() ? first[end] : int(from.p.extent(0))) - begin;
    std::vector<int> own(first.begin() + tile.first, first.begin() + std::ptrdiff_t(end));
    for (int& f : own) f -= begin;
    to.first = gsp::detail::to_device<std::decay_t<decltype(to.first)>>(tile.exec, "gsp::Snapshot::first", own);
    to.p = gsp::detail::rows_of(from.p, begin, impulses);
    to.id = gsp::detail::rows_of(from.id, begin, impulses);
    to.place = gsp::detail::rows_of(from.place, begin, impulses);
    return out;
  }
  SensorHistory<R, Mem> of_tile(Tile<R, Exec> const& tile, SensorHistory<R, Mem> const& all) const {
    auto out = all;
    out.worlds = tile.worlds();
    gsp::detail::each_history_view(
        [&](char const*, auto const& from, auto& to) { to = gsp::detail::rows_of(from, tile.first, tile.worlds()); }, all, out);
    return out;
  }
  /// What late sensors remember, of such arrays; nothing where there are none.
  std::optional<SensorHistory<R, Mem>> late_of(std::vector<NamedArray> const& arrays, int worlds) {
    if (std::none_of(arrays.begin(), arrays.end(), [](NamedArray const& a) { return a.name.starts_with("sensors."); })) return {};
    if (!compiled_.sensors.empty()) make_sensors_once();
    auto const& sensors = parts_.front().sensors;
    if (!sensors || sensors->history.count() == 0)
      throw Error("sensors keep samples there, and here none does: restore it with the model that it was saved with");
    auto late = make_sensor_history<R>(exec_, compiled_, {.worlds = worlds, .timestep = timestep_, .left_out = sensors->left_out});
    for (auto const& [name, to] : arrays_of<Exec>(late)) {
      auto const from = std::find_if(arrays.begin(), arrays.end(), [&](NamedArray const& a) { return a.name == name; });
      bool same = from != arrays.end() && from->array.rank == to.rank && from->array.dtype == to.dtype;
      for (int k = 0; k < to.rank && same; ++k) same = from->array.extents[k] == to.extents[k];
      if (!same) throw Error("array '" + name + "' is not there, or not " + shape_of(to) + ": give what Stepper::save gave");
      copy(from->array, to);
    }
    for (auto const& view :
         {gsp::detail::to_host(exec_, late.time), gsp::detail::to_host(exec_, late.due), gsp::detail::to_host(exec_, late.clock)})
      for (double const t : view)
        if (!std::isfinite(t)) throw Error("an array of 'sensors.' holds a time that is not finite: give what Stepper::save gave");
    auto const entries = gsp::detail::to_host(exec_, late.entries);
    auto const cursors = gsp::detail::to_host(exec_, late.cursor);
    for (std::size_t i = 0; i < cursors.size(); ++i)
      if (cursors[i] < 0 || cursors[i] >= entries[i % entries.size()].samples)
        throw Error("array 'sensors.cursor' holds " + std::to_string(cursors[i]) + ", which is no sample: give what Stepper::save gave");
    return late;
  }
  void make_sensors_once() {
    if (parts_.front().sensors) return;
    std::vector<std::optional<Sensors<R, Mem>>> made(tiles_.size());  // all of them, or none
    each([&](auto& tile, Part& part) {
      made[part.index] = make_sensors(tile.exec, tile.model, compiled_, {.worlds = tile.worlds(), .timestep = timestep_});
    });
    for (Part& part : parts_) part.sensors = std::move(made[part.index]);
    sensordata_ = gsp::detail::allocate_zero<decltype(sensordata_)>(exec_, "gsp::runtime::Stepper::sensordata", state_.worlds,
                                                                    parts_.front().sensors->nsensordata);
  }
  /// What kernels take for places: impulses one world after the other, and islands that there are.
  void expect_in_range(Snapshot<R, Mem> const& s, std::int64_t rows) const {
    auto const first = gsp::detail::to_host(exec_, s.impulses.first), count = gsp::detail::to_host(exec_, s.impulses.count),
               kept = gsp::detail::to_host(exec_, s.impulses.kept);
    std::int64_t at = 0;
    bool good = true;
    for (std::size_t w = 0; w < first.size() && good; ++w) {
      good = first[w] == at && count[w] >= 0 && kept[w] >= 0;
      at += std::int64_t(count[w]) + kept[w];
    }
    if (!good || at != rows)
      throw Error("array 'impulses.first', 'impulses.count' or 'impulses.kept' does not fit 'impulses.p': give what Stepper::save gave");
    for (int const calm : gsp::detail::to_host(exec_, s.sleep.calm))
      if (calm < -model_.ntree || calm > tiles_.front().simulation.sleep.steps)
        throw Error("array 'sleep.calm' holds " + std::to_string(calm) + ", and must be from " + std::to_string(-model_.ntree) + " to " +
                    std::to_string(tiles_.front().simulation.sleep.steps) + ": give what Stepper::save gave");
  }

  /// Numbers that a step could have left, in the worlds that had not stopped.
  void expect_numbers(Snapshot<R, Mem> const& s) const {
    auto const bits = gsp::detail::to_host(exec_, s.state.status);
    auto const first = gsp::detail::to_host(exec_, s.impulses.first);
    // places and rates are bounded, forces and impulses of heavy bodies need not be
    auto const expect = [&](std::string const& name, std::size_t world, R number, double most = std::numeric_limits<double>::max()) {
      if ((bits[world] & (status::not_finite | status::unbounded)) == 0 && !(std::abs(double(number)) <= most))
        throw Error("array '" + name + "' holds " + std::to_string(number) + " of world " + std::to_string(world) +
                    ", which is no number of a state" + (most == state_bound ? " (at most 1e10)" : "") + ": give what Stepper::save gave");
    };
    auto const check = [&](std::string const& name, auto const& view, double most = std::numeric_limits<double>::max()) {
      if constexpr (std::is_floating_point_v<typename std::decay_t<decltype(view)>::non_const_value_type>) {
        auto const numbers = gsp::detail::to_host(exec_, view);
        for (std::size_t i = 0; i < numbers.size(); ++i) expect(name, i / std::size_t(gsp::detail::items_of_row(view)), numbers[i], most);
      }
    };
    gsp::detail::each_state_view([&](char const* name, auto const& view) { check(std::string("state.") + name, view, state_bound); },
                                 s.state);
    check("sleep.force", s.sleep.force);
    auto const p = gsp::detail::to_host(exec_, s.impulses.p);
    for (std::size_t w = 0, r = 0; w < first.size(); ++w)
      for (std::size_t const end = w + 1 < first.size() ? std::size_t(first[w + 1]) : p.size(); r < end; ++r) expect("impulses.p", w, p[r]);
  }

  Exec exec_;
  Model<R, Mem> model_;
  State<R, Mem> state_;
  CollisionModel<R, Mem> collision_;
  Poses<R, Mem> poses_;
  Kokkos::View<R**, Kokkos::LayoutRight, Mem> qfrc_constraint_;
  std::vector<Tile<R, Exec>> tiles_;
  std::vector<Part> parts_;    // of the tiles
  std::vector<Buffer> saved_;  // what `save` gave of several tiles
  CompiledModel compiled_;
  struct CameraSet {
    std::vector<CameraSpec> specs;
    CameraMounts<R, Mem> mounts;
    Cameras<Mem> cameras;
  };
  static constexpr std::size_t most_camera_sets = 64;
  std::list<std::shared_ptr<CameraSet>> cameras_;  // that were asked for last, the last one first
  Kokkos::View<R**, Kokkos::LayoutRight, Mem> sensordata_;
  PgsOptions solver_;                           // profile stable
  NewtonOptions newton_;                        // profile mujoco
  std::optional<ContactArrays> kept_contacts_;  // in contact_buffers_
  Buffer contact_buffers_[7];
  bool has_stepped_ = false;
  std::vector<std::string> per_world_;
  Kokkos::View<R***, Kokkos::LayoutRight, Mem> values_, mass_matrix_, jacobian_;
  Kokkos::View<R**, Kokkos::LayoutRight, Mem> smooth_[4], qacc_, qfrc_;
  std::vector<int> joint_of_dof_, joint_qpos_;
  double timestep_;
  bool stale_ = true;  // the poses are not those of the state
};

template <class R>
std::unique_ptr<Stepper> make_stepper_of(Device device, CompiledModel const& model, StepperOptions const& options) {
  std::unique_ptr<Stepper> out;
  on_device(device, [&]<class Exec>(Exec const&) { out = std::make_unique<KokkosStepper<R, Exec>>(model, options); });
  return out;
}

template <class R>
std::int64_t bytes_needed_of(Device device, CompiledModel const& m, StepperOptions const& options) {
  std::int64_t bytes = 0;
  auto one = options;  // values per world are as many for each
  one.worlds = 1;
  on_device(device, [&](auto const& exec) {
    auto const model = make_runtime_model<R>(exec, m, one);
    bytes = gsp::bytes_needed(exec, model, m, simulation_options(options)) +
            options.worlds * std::int64_t(model.world_reals.size() * sizeof(R));
  });
  return bytes;
}

std::unique_ptr<Stepper> make_stepper_double(Device device, CompiledModel const& model, StepperOptions const& options);
std::int64_t bytes_needed_double(Device device, CompiledModel const& model, StepperOptions const& options);

}  // namespace gsp::runtime
