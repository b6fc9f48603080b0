#include "run.hpp"

#include <chrono>
#include <cmath>
#include <cstdio>
#include <gsp/core/status.hpp>

namespace gsp_cli {

using gsp::runtime::Array;
using gsp::runtime::host_array;

void set_states(Stepper& stepper, States const& s, gsp::CompiledModel const& model) {
  auto const rows = [&](std::vector<double> const& v, int n) { return v.empty() ? Array{} : host_array(v.data(), {s.worlds, n}); };
  auto const state = stepper.state();
  if (!s.act.empty()) copy(host_array(s.act.data(), {s.worlds, model.na}), state.act);
  if (!s.mocap_pos.empty()) copy(host_array(s.mocap_pos.data(), {1, model.nmocap, 3}), state.mocap_pos);
  if (!s.mocap_quat.empty()) copy(host_array(s.mocap_quat.data(), {1, model.nmocap, 4}), state.mocap_quat);
  stepper.set(rows(s.qpos, model.nq), rows(s.qvel, model.nv), rows(s.ctrl, model.nu));
}

void restore(Stepper& stepper, States const& states, std::string const& path) {
  using gsp::runtime::Dtype;
  std::map<gsp::io::Dtype, Dtype> const dtypes{{gsp::io::Dtype::f4, Dtype::float32},
                                               {gsp::io::Dtype::f8, Dtype::float64},
                                               {gsp::io::Dtype::i4, Dtype::int32},
                                               {gsp::io::Dtype::i8, Dtype::int64}};
  std::vector<gsp::runtime::NamedArray> arrays;
  for (auto const& [name, from] : states.snapshot) {
    if (!dtypes.contains(from.dtype) || from.shape.empty() || from.shape.size() > 4) continue;  // none that a stepper gives
    Array a = gsp::runtime::make_array(const_cast<std::byte*>(from.bytes.data()), dtypes.at(from.dtype), Device::cpu, {});
    a.read_only = true;
    a.rank = static_cast<int>(from.shape.size());
    std::int64_t step = 1;
    for (std::size_t k = from.shape.size(); k-- > 0; step *= a.extents[k]) {
      a.extents[k] = static_cast<std::int64_t>(from.shape[k]);
      a.strides[k] = step;
    }
    arrays.push_back({name, a});
  }
  try {
    stepper.restore(arrays);
  } catch (Error const& error) { throw Error(path + ": " + error.what() + " (--save writes such files)"); }
  // The state is there twice, as a start of one entry and whole: what was changed in one alone would be lost.
  std::vector<double> qpos, qvel, act;
  get_states(stepper, qpos, qvel);
  get_activations(stepper, act);
  auto const expect_same = [&](char const* name, std::vector<double> const& given, std::vector<double> const& taken) {
    for (std::size_t i = 0; i < given.size() && i < taken.size(); ++i)
      if (given[i] != taken[i] && !(std::isnan(given[i]) && std::isnan(taken[i])))
        throw Error(path + ": '" + name + "' is not that of 'state." + name + "', from which a saved simulation goes on: for a start of " +
                    "your own keep time, qpos, qvel and act alone");
  };
  expect_same("qpos", states.qpos, qpos);
  expect_same("qvel", states.qvel, qvel);
  expect_same("act", states.act, act);
}

void get_states(Stepper const& stepper, std::vector<double>& qpos, std::vector<double>& qvel) {
  auto const state = stepper.state();
  qpos.resize(static_cast<std::size_t>(state.qpos.size()));
  qvel.resize(static_cast<std::size_t>(state.qvel.size()));
  stepper.get(host_array(qpos.data(), {state.qpos.extents[0], state.qpos.extents[1]}),
              host_array(qvel.data(), {state.qvel.extents[0], state.qvel.extents[1]}));
}

void get_activations(Stepper const& stepper, std::vector<double>& act) {
  auto const from = stepper.state().act;
  act.resize(static_cast<std::size_t>(from.size()));
  if (!act.empty()) copy(from, host_array(act.data(), {from.extents[0], from.extents[1]}));
}

std::uint64_t bytes_of_states(gsp::CompiledModel const& model, int worlds) {
  return sizeof(double) * static_cast<std::uint64_t>(worlds) * static_cast<std::uint64_t>(2 * model.nq + model.nv + model.na);
}

Array row_of(Array const& controls, long long k) {
  Array row = controls.rows(k, 1);  // (1, worlds | 1, nu)
  row.rank = 2;
  for (std::size_t d = 0; d < 2; ++d) {
    row.extents[d] = row.extents[d + 1];
    row.strides[d] = row.strides[d + 1];
  }
  return row;
}

Timing run_steps(Stepper& stepper, RunOptions const& o, Progress& progress) {
  using clock = std::chrono::steady_clock;
  Timing t;
  long long at_once = 1;  // where progress is shown: as many as take about a quarter of a second
  for (long long done = 0; done < o.steps;) {
    // up to the next point where something happens: the clock starts, a state is recorded, controls change, the last step (measured)
    long long next = o.steps - done > 1 ? o.steps - 1 : o.steps;
    if (done < o.time_from) next = std::min(next, o.time_from);
    if (o.record) next = std::min(next, (done / o.every + 1) * o.every);
    if (o.controls) next = done + 1;
    if (progress.shown()) next = std::min(next, done + at_once);
    next = std::min(next, done + 100000);
    auto const start = clock::now();
    if (o.controls) gsp::runtime::copy(row_of(o.controls, done), stepper.state().ctrl);
    stepper.step({.steps = static_cast<int>(next - done), .measure_residual = next == o.steps});
    double const seconds = std::chrono::duration<double>(clock::now() - start).count();
    at_once = seconds < 0.1 ? 2 * at_once : seconds > 0.4 ? std::max(1LL, at_once / 2) : at_once;
    if (done >= o.time_from) {
      t.seconds += seconds;
      t.steps += next - done;
    }
    done = next;
    if (o.record && (done % o.every == 0 || (o.record_last && done == o.steps))) o.record(done);
    progress.show(double(done) / double(o.steps));
  }
  return t;
}

nlohmann::ordered_json report_json(std::vector<gsp::ReportLine> const& lines) {
  auto report = nlohmann::ordered_json::array();
  for (auto const& l : lines)
    report.push_back({{"kind", gsp::text(l.kind)}, {"file", l.file}, {"line", l.line}, {"text", l.text}, {"count", l.count}});
  return report;
}

namespace {
nlohmann::ordered_json residuals_json(gsp::runtime::StepResiduals const& left) {
  auto const part = [](gsp::runtime::StepResiduals::Part const& p) { return nlohmann::ordered_json{{"max", p.most}, {"mean", p.mean}}; };
  return {{"rate", part(left.rate)},          {"equality", part(left.equality)}, {"complementarity", part(left.complementarity)},
          {"friction", part(left.friction)},  {"bounds", part(left.bounds)},     {"cone", part(left.cone)},
          {"energy", {{"mean", left.energy}}}};
}
}  // namespace

nlohmann::ordered_json steps_json(Stepper const& stepper, Device device, int worlds, Timing const& timing, double startup) {
  std::vector<double> qpos, qvel;
  get_states(stepper, qpos, qvel);
  auto const counts = stepper.counts();
  return {{"seconds", timing.seconds},
          {"steps_per_second", double(worlds) * double(timing.steps) / timing.seconds},
          {"startup_seconds", startup},
          {"peak_bytes", gsp::runtime::peak_bytes(device)},
          {"contacts", counts.contacts},
          {"rows", counts.rows},
          {"asleep", counts.asleep},
          {"kept_rows", counts.kept},
          {"iterations", counts.iterations},
          {"mean_iterations", counts.mean_iterations},
          {"unfinished_worlds", counts.unfinished_worlds},
          {"residual", counts.residual},
          {"residuals", residuals_json(stepper.residuals())},
          {"state_hash", hash_of({&qpos, &qvel})},
          {"worlds", worlds},
          {"failed_worlds", counts.failed_worlds}};
}

namespace {
constexpr int most_named = 8;  // worlds that stopped, of which it is said why: the others' reason is most often the same

std::string short_number(double x) {
  char buffer[32];
  std::snprintf(buffer, sizeof buffer, "%.6g", x);
  return buffer;
}
}  // namespace

std::string sentence(gsp::runtime::StoppedWorld const& s, gsp::CompiledModel const& model, double timestep) {
  std::string out = "world " + std::to_string(s.world) + " stopped after " + std::to_string(s.steps) + " steps" + " (" +
                    short_number(double(s.steps) * timestep) + " s): ";
  if (s.joint < 0) return out + gsp::status::text(s.status);
  std::string const& name = model.jnt_name[std::size_t(s.joint)];
  std::string const joint = name.empty() ? "joint " + std::to_string(s.joint) + " of body '" +
                                               model.body_name[std::size_t(model.jnt_body[std::size_t(s.joint)])] + "'"
                                         : "joint '" + name + "'";
  std::string const number = std::isnan(s.number) ? "NaN" : short_number(s.number);
  if (s.position) return out + "a position of " + joint + " is " + number + ", beyond 1e10";
  out += "the new velocity of dof " + std::to_string(s.dof) + " (" + joint + ") is " + number;
  if (std::isfinite(s.number)) out += ", beyond 1e10";
  if (s.dofs > 1) out += ", and of " + std::to_string(s.dofs - 1) + " more dofs it is no better";
  return out;
}

void say_stopped(char const* command, Stepper const& stepper, gsp::CompiledModel const& model, int worlds, char const* remedy) {
  int const failed = stepper.counts().failed_worlds;
  if (failed == 0) return;
  std::fprintf(stderr, "gsp: %s: %d of %d worlds stopped, and stay as they were before; %s\n", command, failed, worlds, remedy);
  for (auto const& s : stepper.stopped(most_named)) std::fprintf(stderr, "  %s\n", sentence(s, model, stepper.timestep()).c_str());
  if (failed > most_named) std::fprintf(stderr, "  and %d more\n", failed - most_named);
}

nlohmann::ordered_json stopped_json(Stepper const& stepper, gsp::CompiledModel const& model) {
  auto list = nlohmann::ordered_json::array();
  for (auto const& s : stepper.stopped(most_named))
    list.push_back({{"world", s.world},
                    {"steps", s.steps},
                    {"joint", s.joint < 0 ? "" : model.jnt_name[std::size_t(s.joint)]},
                    {"dof", s.dof},
                    {"text", sentence(s, model, stepper.timestep())}});
  return list;
}

}  // namespace gsp_cli
