#pragma once
// What `gsp` reads and writes: models, traces, starts, controls, cameras. All errors are gsp::Error: file, place, remedy.
#include <gsp/io/npz.hpp>
#include <gsp/io/splat_transform.hpp>
#include <gsp/model/compiled.hpp>
#include <gsp/runtime/renderer.hpp>
#include <map>
#include <string>
#include <vector>

#include "arguments.hpp"

namespace gsp_cli {

/// The options --skip-visuals, --decompose, --approximate, --floating-base and --package, for the tables of commands.
Option skip_visuals_option();
Option decompose_option();
Option approximate_option();
extern std::string const approximate_note;
Option floating_base_option();
Option package_option();

/// Reads and compiles a MJCF file, or a URDF file where the name ends in .urdf.
gsp::CompiledModel load_model(std::string const& path, Arguments const& arguments);
/// The same in two parts; list_refusals: what is refused becomes a line of the report. (The reader is long to compile, so it is in
/// files.cpp alone.)
gsp::Description describe_model(std::string const& path, Arguments const& arguments, bool list_refusals);
gsp::Description describe_model(std::string const& path, Arguments const& arguments, bool list_refusals, bool skip_visuals);
gsp::CompiledModel compile_model(gsp::Description const& description);
/// Whether a line of the report is about simulations in this profile.
bool concerns(gsp::ReportLine const& line, bool mujoco);
/// One line: how much of the file is not taken as it stands; empty when all is. In profile stable, or mujoco.
std::string summary(gsp::CompiledModel const& model, bool mujoco = false);

/// States of `worlds` worlds, (worlds, nq) and (worlds, nv).
struct States {
  int worlds = 1;
  double time = 0;
  std::vector<double> qpos, qvel, ctrl;                    // ctrl: (worlds, nu), or empty
  std::vector<double> act;                                 // (worlds, na), or empty: the model's
  std::vector<double> mocap_pos, mocap_quat;               // of a keyframe: one row for all worlds, or empty: the model's
  std::map<std::string, gsp::io::NpyArray> snapshot = {};  // of a file of --save, all that a stepper goes on from; or empty
  std::vector<double> saved_with;                          // options_in_numbers of then; empty: not known
};
/// Gaussians of a file, moved to `pose`.
gsp::io::SplatSet load_splats(std::string const& path, gsp::io::SplatPose const& pose);
/// Adds a plane at z = 0 unless something of the model that does not move can be touched already; true if it did.
bool add_floor(gsp::Description& description);
/// Makes servos of motors that drive a hinge or slide joint with limited force, so that a robot without a policy holds the pose that their
/// ctrl names: full force at an error of 0.3 [rad, m], damping of 0.03 s times the stiffness. Returns how many; `hold` gives the ctrl for a
/// state.
int motors_to_servos(gsp::Description& description);
void hold(gsp::CompiledModel const& model, int servos, States& states);

/// Which of the model's keyframes or cameras (`what`) an option names: by name, or by index from 0.
int named_or_index(std::string const& file, std::string const& what, std::vector<std::string> const& names, std::string const& text);
/// A camera of the model in messages: by its name where it has one, else by its index.
std::string camera_name(gsp::CompiledModel const& model, int camera);
/// The initial state of the file, or of a keyframe given by name or index; one world. Numbers beyond gsp::state_bound are refused.
States initial_state(gsp::CompiledModel const& model, std::string const& file, std::optional<std::string> const& keyframe);
/// The model with its mocap bodies where the state has them: poses of qpos alone are of the model's.
void place_mocap(gsp::CompiledModel& model, States const& states);
/// The last entry of a trace or start file: qpos (T,N,nq), qvel (T,N,nv), time (T), and act (T,N,na) where it is there; and what
/// write_snapshot put beside them. Numbers beyond gsp::state_bound are refused.
States read_start(std::string const& path, gsp::CompiledModel const& model);
/// A start with all that the stepper goes on from to the bit.
void write_snapshot(std::string const& path, gsp::runtime::Stepper& stepper, double time, gsp::CompiledModel const& model,
                    gsp::runtime::StepperOptions const& options);
/// What a simulation that goes on to the bit must have as it was: timestep [s], profile (1: mujoco), cone (-1: the model's), most
/// iterations (0: the library's), tolerance (-1: the library's), bits of what is disabled, a number of the model,
/// friction time [s].
std::vector<double> options_in_numbers(gsp::CompiledModel const& model, gsp::runtime::StepperOptions const& options);
/// A sentence where what is gone on from was saved with others; or empty. Where the model or what is disabled is another, who slept is left
/// out of the states, so that all are awake.
std::string other_options(States& states, std::vector<double> const& now);
/// Throws where the snapshot is of another version, precision, or of sleepers and the run is without.
void expect_goes_on(States const& states, bool in_double, bool sleep, std::string const& path);
/// Throws where there are neither 1 nor `worlds` states.
void expect_worlds(States const& states, int worlds, std::string const& what);
/// One world's state for all, or as it is.
States spread(States const& states, int worlds);

/// All entries of a trace: qpos (entries, worlds, nq), act (entries, worlds, na) or empty.
struct Trace {
  std::size_t entries = 0, worlds = 0;
  std::vector<double> time, qpos, qvel, act;
};
Trace read_trace(std::string const& path, gsp::CompiledModel const& model);
void write_trace(std::string const& path, Trace const& trace, gsp::CompiledModel const& model);
/// What sensors said at each entry: sensordata (entries, worlds, nsensordata), and which numbers are whose.
void write_sensors(std::string const& path, std::vector<double> const& time, std::vector<double> const& sensordata, int worlds,
                   gsp::CompiledModel const& model);

/// Controls (K, nu) or (K, N, nu).
struct Controls {
  std::size_t steps = 0, worlds = 0;  // worlds 1: for all
  std::vector<double> values;         // (steps, worlds, nu)
};
Controls read_controls(std::string const& path, gsp::CompiledModel const& model, int worlds);

/// viewmats (C, 4, 4) and Ks (C, 3, 3), as float32; lenses (C), one for all, or none.
struct CameraFile {
  std::size_t count = 0;
  std::vector<float> viewmats, Ks;
  std::vector<gsp::Lens> lenses;
  /// Cameras first ... first + n - 1.
  gsp::runtime::CameraArrays arrays(std::size_t first, std::size_t n) const {
    std::int64_t const c = static_cast<std::int64_t>(n);
    auto const from = lenses.begin() + static_cast<std::ptrdiff_t>(lenses.size() > 1 ? first : 0);
    return {gsp::runtime::host_array(&viewmats[16 * first], {c, 4, 4}),
            gsp::runtime::host_array(&Ks[9 * first], {c, 3, 3}),
            {},
            {from, lenses.size() > 1 ? from + static_cast<std::ptrdiff_t>(n) : lenses.end()}};
  }
  /// Another one, as camera i of `from`. All that are added come from files of one kind: a lens each, one for all, or none.
  void add(CameraFile const& from, std::size_t i);
};
CameraFile read_cameras(std::string const& path, bool quiet);

/// Pictures, or numbers of cameras, on the host; empty where there are none. Of rank 3 or 4.
std::vector<float> fetch(gsp::runtime::Array const& array);

/// Does a picture of n numbers (alpha, depth or colours on black) show nothing at all?
bool shows_nothing(float const* numbers, std::size_t n);

/// Throws unless `path` can be written: its folder is there and it is no folder itself. Called before long work.
void expect_writable(std::string const& path, char const* option);
/// A file and the option that names it.
struct NamedFile {
  std::string option, path;
};
/// Throws where an output is an input, or another output, by whatever names and links: the later one would replace the other. Devices may
/// take several.
void expect_apart(std::vector<NamedFile> const& inputs, std::vector<NamedFile> const& outputs);
/// Contacts of all worlds, and what constraints do to the degrees of freedom, as docs/cli.md has them.
/// status: (worlds) uint32 bits of gsp::status: what a world that stopped has is no contact or force.
void write_contacts(std::string const& path, gsp::runtime::ContactArrays const& contacts, gsp::runtime::Array const& status);
void write_forces(std::string const& path, gsp::runtime::Array const& qfrc_constraint, gsp::runtime::Array const& status);
/// Where the program says what it has done: stdout, or stderr where `output` is stdout itself (/dev/stdout).
std::FILE* text_beside(std::optional<std::string> const& output);
/// Makes the folder and those above it.
void make_folder(std::string const& path, char const* option);

/// 64-bit FNV-1a of the bytes, as hex text.
std::string hash_of(std::vector<std::vector<double> const*> const& parts);

}  // namespace gsp_cli
