// gsp sim: steps many worlds of a model and says how fast that was.
#include <algorithm>
#include <cstdio>
#include <limits>
#include <nlohmann/json.hpp>

#include "commands.hpp"
#include "run.hpp"

namespace gsp_cli {

namespace {

std::optional<gsp::FrictionCone> cone_of(Arguments const& a) {
  std::map<std::string, gsp::FrictionCone> const cones{
      {"box", gsp::FrictionCone::box}, {"elliptic", gsp::FrictionCone::elliptic}, {"pyramidal", gsp::FrictionCone::pyramidal}};
  if (!a.has("--cone")) return {};
  return cones.at(a.choice("--cone", {"box", "elliptic", "pyramidal"}, ""));
}

int run(Arguments const& a) {
  std::string const path = a.operands().front();
  a.exclusive("--keyframe", "--start", "both say where the worlds start");
  if (a.has("--every") && !a.has("--trace") && !a.has("--sensors"))
    a.fail("--every needs --trace or --sensors: it says how often they take the state");
  StepperOptions options;
  auto const start_file = a.text("--start"), ctrl_file = a.text("--ctrl"), trace_file = a.text("--trace"),
             contacts_file = a.text("--contacts"), forces_file = a.text("--forces"), save_file = a.text("--save"),
             sensors_file = a.text("--sensors");
  options.worlds = static_cast<int>(a.integer("--worlds", 1, 1, 1 << 24));
  options.timestep = a.real("--timestep", 0, 0, 10);
  options.iterations = static_cast<int>(a.integer("--iterations", 0, 1, 1000000));
  if (a.has("--tolerance")) options.tolerance = a.real_from("--tolerance", 0, 0, 1);
  options.cone = cone_of(a);
  options.friction_time = a.real("--friction-time", 0, 0, 1);
  options.threads = threads_of(a);
  options.mujoco = a.choice("--profile", {"mujoco", "stable"}, "stable") == "mujoco";
  if (options.mujoco && options.cone == gsp::FrictionCone::box)
    a.fail("--cone box is of profile stable; give pyramidal or elliptic, or leave it out");
  if (options.mujoco && options.friction_time > 0)
    a.fail("--friction-time is of profile stable; leave it out: friction of profile mujoco is soft as the file says");
  bool const in_double = a.choice("--precision", {"float", "double"}, "float") == "double";
  if (in_double) options.precision = gsp::runtime::Dtype::float64;
  long long steps = a.integer("--steps", 1000, 1, 1LL << 40), every = a.integer("--every", 1, 1, 1LL << 40),
            time_from = a.integer("--time-from", 0, 0, 1LL << 40);
  Device const device = choose_device(a);
  std::vector<NamedFile> inputs{{"MODEL", path}}, outputs;
  if (start_file) inputs.push_back({"--start", *start_file});
  if (ctrl_file) inputs.push_back({"--ctrl", *ctrl_file});
  std::optional<std::string> written;  // one of them may be stdout
  for (auto const& [file, option] : {std::pair{trace_file, "--trace"},
                                     {contacts_file, "--contacts"},
                                     {forces_file, "--forces"},
                                     {save_file, "--save"},
                                     {sensors_file, "--sensors"}}) {
    if (!file) continue;
    expect_writable(*file, option);
    outputs.push_back({option, *file});
    if (!written || text_beside(file) == stderr) written = file;
  }
  expect_apart(inputs, outputs);

  auto model = load_model(path, a);
  if (a.has("--sleep")) model.option.sleep = true;
  States start = start_file ? read_start(*start_file, model) : initial_state(model, path, a.text("--keyframe"));
  if (start_file && !a.has("--worlds")) options.worlds = start.worlds;
  expect_worlds(start, options.worlds, start_file ? *start_file : path);
  std::vector<std::string> notes;
  if (a.has("--approximate")) notes.push_back(approximate_note);
  if (auto const others = other_options(start, options_in_numbers(model, options)); !others.empty())
    notes.push_back(*start_file + ": " + others);
  expect_goes_on(start, in_double, model.option.sleep, start_file ? *start_file : path);
  for (auto const& note : notes)
    if (!a.has("--quiet")) std::fprintf(stderr, "%s\n", note.c_str());
  Controls controls;
  if (ctrl_file) {
    controls = read_controls(*ctrl_file, model, options.worlds);
    if (!a.has("--steps")) steps = static_cast<long long>(controls.steps);
    if (steps > static_cast<long long>(controls.steps))
      throw Error(*ctrl_file + ": holds controls for " + std::to_string(controls.steps) + " steps, fewer than --steps " +
                  std::to_string(steps) + "; give --steps " + std::to_string(controls.steps) + " or less");
  }
  if (time_from >= steps)
    a.fail("--time-from " + std::to_string(time_from) + " leaves none of the " + std::to_string(steps) +
           " steps to be timed; give less than --steps");
  if (auto const s = summary(model, options.mujoco); !s.empty() && !quiet(a))
    std::fprintf(stderr, "%s: %s ('gsp info' lists them)\n", path.c_str(), s.c_str());
  std::size_t const worlds = static_cast<std::size_t>(options.worlds);
  if (trace_file && (static_cast<double>(records(steps, every)) + 1) * double(worlds) * std::max({model.nq, model.na, 1}) * 8 > 4e9)
    throw Error(*trace_file +
                ": the trace would pass 4 GiB, the limit of npz files here; give a larger --every, fewer --steps or fewer --worlds");

  if (sensors_file && model.sensors.empty()) throw Error(path + ": the model has no sensors, which --sensors would write; leave it out");
  if (sensors_file && (static_cast<double>(records(steps, every)) + 1) * double(worlds) * model.nsensordata * 8 > 4e9)
    throw Error(*sensors_file +
                ": what sensors say would pass 4 GiB, the limit of npz files here; give a larger --every, fewer --steps or fewer --worlds");
  gsp::runtime::Session const session(options.threads);
  std::uint64_t bytes = 0;
  try {
    bytes = static_cast<std::uint64_t>(gsp::runtime::bytes_needed(device, model, options));
  } catch (Error const& error) {  // what the dynamics do not cover: say which file
    throw Error(path + ": " + error.what());
  }
  std::uint64_t const entries = trace_file ? static_cast<std::uint64_t>(records(steps, every)) + 1 : 0;
  expect_memory(
      std::to_string(worlds) + " worlds of " + path + (trace_file ? " with " + std::to_string(entries) + " entries of a trace" : ""),
      device, bytes + controls.values.size() * (in_double ? 8 : 4), (entries + 1) * bytes_of_states(model, options.worlds),
      trace_file ? "fewer --worlds or a larger --every" : "fewer --worlds");
  auto const stepper = gsp::runtime::make_stepper(device, model, options);
  if (start.snapshot.empty())
    set_states(*stepper, start, model);
  else
    restore(*stepper, start, *start_file);
  gsp::runtime::Buffer there;
  if (ctrl_file) {
    auto const k = static_cast<std::int64_t>(controls.steps);
    auto const n = static_cast<std::int64_t>(controls.worlds);
    there = gsp::runtime::make_buffer(device, options.precision, {k, n, model.nu});
    gsp::runtime::copy(gsp::runtime::host_array(controls.values.data(), {k, n, model.nu}), there.array);
  }
  Trace trace;
  std::vector<double> qpos, qvel, act;
  auto const record = [&](long long done) {
    get_states(*stepper, qpos, qvel);
    trace.time.push_back(start.time + double(done) * stepper->timestep());
    trace.qpos.insert(trace.qpos.end(), qpos.begin(), qpos.end());
    trace.qvel.insert(trace.qvel.end(), qvel.begin(), qvel.end());
    get_activations(*stepper, act);
    trace.act.insert(trace.act.end(), act.begin(), act.end());
    ++trace.entries;
  };
  std::vector<double> sensor_time, sensordata;
  std::vector<std::int64_t> steps_before(worlds);  // that the stepper's clock counts from
  gsp::runtime::copy(stepper->state().steps, gsp::runtime::host_array(steps_before.data(), {options.worlds}));
  double const clock_from = start.time - double(steps_before[0]) * stepper->timestep();
  auto const sense = [&](long long done) {
    auto const now = stepper->sensors();
    std::size_t const at = sensordata.size(), columns = static_cast<std::size_t>(now.extents[1]);
    sensordata.resize(at + static_cast<std::size_t>(now.size()));
    gsp::runtime::copy(now, gsp::runtime::host_array(sensordata.data() + at, {now.extents[0], now.extents[1]}));
    for (std::size_t i = 0; clock_from != 0 && i < model.sensors.size(); ++i) {
      if (model.sensors[i].type != "clock") continue;
      double const most = model.sensors[i].cutoff > 0 ? model.sensors[i].cutoff : std::numeric_limits<double>::infinity();
      for (std::size_t w = 0; w < worlds; ++w) {
        double& x = sensordata[at + w * columns + static_cast<std::size_t>(model.sensor_adr[i])];
        x = std::clamp(x + clock_from, -most, most);
      }
    }
    sensor_time.push_back(start.time + double(done) * stepper->timestep());
  };
  if (sensors_file) {
    for (auto const& why : stepper->sensors_left_out()) {
      notes.push_back(path + ": " + why + "; --sensors has NaN there");
      if (!quiet(a)) std::fprintf(stderr, "%s\n", notes.back().c_str());
    }
    sense(0);
  }
  trace.worlds = worlds;
  if (trace_file) {  // the start as it was given, not as the precision has it
    start = spread(start, options.worlds);
    trace.time.reserve(entries);
    trace.qpos.reserve(entries * start.qpos.size());
    trace.qvel.reserve(entries * start.qvel.size());
    trace.time = {start.time};
    trace.qpos = start.qpos;
    trace.qvel = start.qvel;
    trace.act = start.act;
    if (trace.act.empty()) get_activations(*stepper, trace.act);
    trace.entries = 1;
  }
  double const startup = seconds_since_start();
  RunOptions run_options;
  run_options.steps = steps;
  run_options.time_from = time_from;
  run_options.controls = there.array;
  run_options.every = every;
  run_options.record_last = true;
  if (trace_file || sensors_file)
    run_options.record = [&](long long done) {
      if (trace_file) record(done);
      if (sensors_file && done < steps) sense(done);  // of the last state at the end: counts and contacts are of the last step until then
    };
  Progress progress("stepping", quiet(a));
  auto const timing = run_steps(*stepper, run_options, progress);
  progress.finish();
  auto const counts = stepper->counts();
  get_states(*stepper, qpos, qvel);
  if (trace_file) write_trace(*trace_file, trace, model);
  if (contacts_file) write_contacts(*contacts_file, stepper->contacts(), stepper->state().status);
  if (save_file) write_snapshot(*save_file, *stepper, start.time + double(steps) * stepper->timestep(), model, options);
  if (forces_file) write_forces(*forces_file, stepper->qfrc_constraint(), stepper->state().status);

  std::FILE* const say = text_beside(written);
  double const rate = double(worlds) * double(timing.steps) / timing.seconds;
  say_stopped("sim", *stepper, model, options.worlds, "give a smaller --timestep, or more --iterations");
  auto const write_last = [&] {
    if (!sensors_file) return;
    sense(steps);
    write_sensors(*sensors_file, sensor_time, sensordata, options.worlds, model);
  };
  if (a.has("--json")) {
    std::vector<gsp::ReportLine> lines;
    for (auto const& line : model.report)
      if (concerns(line, options.mujoco)) lines.push_back(line);
    auto json = steps_json(*stepper, device, options.worlds, timing, startup);
    json.update({{"steps", steps},
                 {"timed_steps", timing.steps},
                 {"timestep", stepper->timestep()},
                 {"profile", options.mujoco ? "mujoco" : "stable"},
                 {"precision", in_double ? "double" : "float"},
                 {"device", device_name(device, stepper->threads())},
                 {"notes", notes},
                 {"stopped", stopped_json(*stepper, model)},
                 {"report", report_json(lines)}});
    std::fprintf(say, "%s\n", json.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace).c_str());
  } else {
    double const megabytes = 1e-6 * double(peak_bytes(device));
    auto const left = stepper->residuals();
    std::fprintf(say, "%d worlds x %lld steps of %g s, profile %s, %s, on %s\n", options.worlds, steps, stepper->timestep(),
                 options.mujoco ? "mujoco" : "stable", in_double ? "double" : "float", device_name(device, stepper->threads()).c_str());
    std::fprintf(say, "  %.4g s for %lld steps: %.4g steps/s (%.4g x real time a world)\n", timing.seconds, timing.steps, rate,
                 double(timing.steps) * stepper->timestep() / timing.seconds);
    std::fprintf(say, "  last step: %lld contacts, %lld rows, %d iterations, residual %.3g\n", static_cast<long long>(counts.contacts),
                 static_cast<long long>(counts.rows), counts.iterations, counts.residual);
    if (counts.unfinished_worlds > 0)
      std::fprintf(
          say, "  in %d of %d worlds the solver made all the iterations that it may: --iterations allows more, --friction-time softens\n",
          counts.unfinished_worlds, options.worlds);
    std::fprintf(
        say, "  left unsolved, at most: equalities %.3g, bounded rows %.3g, friction %.3g m/s; outside of bounds %.3g, cones %.3g N s\n",
        left.equality.most, left.complementarity.most, left.friction.most, left.bounds.most, left.cone.most);
    if (model.option.sleep)
      std::fprintf(say, "  %lld of %lld trees sleep, and %lld rows of theirs were not solved for\n", static_cast<long long>(counts.asleep),
                   static_cast<long long>(options.worlds) * model.ntree, static_cast<long long>(counts.kept));
    std::fprintf(say, "  %.2f s to start, %.4g MB, state %s\n", startup, megabytes, hash_of({&qpos, &qvel}).c_str());
    if (trace_file) std::fprintf(say, "  %s: %zu states of %zu worlds\n", trace_file->c_str(), trace.entries, trace.worlds);
    if (sensors_file)
      std::fprintf(say, "  %s: sensordata of %zu states of %zu worlds\n", sensors_file->c_str(), sensor_time.size() + 1, worlds);
  }
  write_last();
  return 0;
}

}  // namespace

Command sim_command() {
  return {
      "sim",
      "MODEL.xml",
      "steps worlds of a MJCF model and says how many steps a second that were",
      1,
      1,
      {{"--worlds", "N", "worlds, 1 (with --start: as many as it holds)"},
       {"--steps", "K", "steps, 1000 (with --ctrl: as many as it holds)"},
       {"--timestep", "H", "seconds a step; without it the model's own"},
       {"--keyframe", "NAME|INDEX", "start from a keyframe (its qpos, qvel and ctrl)"},
       {"--start", "F.npz",
        "start from the last entry of a trace: time (T), qpos (T,N,nq), qvel (T,N,nv), act (T,N,na) or none; N = 1 is given to all worlds; "
        "of a file of --save: go on from it to the bit"},
       {"--ctrl", "F.npy", "controls (K,nu) or (K,N,nu), one row a step; without it those of the keyframe, else 0"},
       {"--iterations", "I",
        "most sweeps of the solver a step (profile mujoco: iterations of Newton's method); without it the library's default"},
       {"--tolerance", "T",
        "a world stops to sweep when no rate changes by more than T times what gravity does in a step, 1e-4; 0: after all sweeps. Profile "
        "mujoco: when an iteration changes the impulses by less than T of them, 1e-10"},
       {"--cone", "box|elliptic|pyramidal",
        "friction along the two tangents: each by itself, together in a disc, or MuJoCo's soft edges; without it as the file says in "
        "profile "
        "mujoco, else elliptic"},
       {"--friction-time", "S",
        "friction holds as a spring of so many seconds, without creep: 0.0015 hurries crowded worlds; 0 without the option: it sticks at "
        "once (docs/constraint/contact_rows.md)"},
       {"--sleep", "", "islands that rest sleep until something wakes them; without it as the file says (<flag sleep>)"},
       {"--disable", "LIST", "of constraint, contact, limit, equality, friction (of joints and tendons), sleep, with commas: left out"},
       {"--profile", "mujoco|stable",
        "mujoco: as the file says, solved exactly; stable (without the option): rigid friction, implicit joints"},
       {"--precision", "float|double", "float without the option"},
       device_option(),
       threads_option(),
       {"--trace", "OUT.npz", "write time, qpos, qvel (and act), float64, the start first, the last step last"},
       {"--sensors", "OUT.npz",
        "write what the model's sensors say, float64: time (T), sensordata (T,N,nsensordata) in MuJoCo's layout, of the states of the "
        "trace; "
        "adr, dim and names of the sensors"},
       {"--every", "E", "steps between two entries of the trace and of --sensors, 1"},
       {"--save", "OUT.npz", "write the last state whole, impulses and who sleeps with it, for --start"},
       {"--contacts", "OUT.npz",
        "write the contacts of the last step: status of each world; world, geom1, geom2, dist, pos, frame, force (in the frame, on geom2)"},
       {"--forces", "OUT.npz", "write what constraints did in the last step: status (N), qfrc_constraint (N,nv), float64"},
       {"--time-from", "S", "run the first S steps without timing them"},
       skip_visuals_option(),
       decompose_option(),
       approximate_option(),
       floating_base_option(),
       package_option(),
       quiet_option(),
       {"--json", "",
        "print one JSON object: seconds, steps_per_second, startup_seconds, peak_bytes, contacts, rows, iterations, residual, residuals, "
        "state_hash, report, ..."}},
      run};
}

}  // namespace gsp_cli
