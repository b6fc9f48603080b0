#include "peer.hpp"

#include <dlfcn.h>

#include <cstdlib>
#include <gsp/io/write_mjcf.hpp>
#include <mutex>
#include <thread>

namespace gsp_cli {
namespace {

// What is used of mujoco.h 4.0.1.
struct mjSpec;
struct mjModel;
struct mjData;
constexpr int wanted_version = 4000001;
enum State : int {  // mjtState
  state_qpos = 1 << 1,
  state_qvel = 1 << 2,
  state_act = 1 << 3,
  state_ctrl = 1 << 6,
  state_mocap_pos = 1 << 10,
  state_mocap_quat = 1 << 11,
  state_integration = (1 << 15) - 1
};

std::mutex warning_mutex;
std::string first_warning;
void keep_warning(char const* text) {
  std::lock_guard const lock(warning_mutex);
  if (first_warning.empty()) first_warning = text;
}
[[noreturn]] void stop_at_error(char const* text) {  // MuJoCo goes on in no other way
  std::fprintf(stderr, "gsp: bench: MuJoCo stopped: %s\n", text);
  std::_Exit(1);
}

struct Library {
  int (*version)();
  mjSpec* (*parse)(char const*, void const*, char*, int);
  mjModel* (*compile)(mjSpec*, void const*);
  char const* (*spec_error)(mjSpec*);
  void (*delete_spec)(mjSpec*);
  void (*delete_model)(mjModel*);
  mjData* (*make_data)(mjModel const*);
  void (*delete_data)(mjData*);
  void (*reset)(mjModel const*, mjData*);
  void (*step)(mjModel const*, mjData*);
  int (*state_size)(mjModel const*, int);
  void (*get_state)(mjModel const*, mjData const*, double*, int);
  void (*set_state)(mjModel const*, mjData*, double const*, int);
};

Library open_library(std::string const& file) {
  void* const handle = dlopen(file.c_str(), RTLD_NOW | RTLD_LOCAL);
  if (!handle) throw Error(file + ": is no library that can be opened (" + dlerror() + "); --mujoco takes libmujoco.so.4.0.1");
  auto const symbol = [&](char const* name) {
    void* const found = dlsym(handle, name);
    if (!found) throw Error(file + ": has no " + name + "; --mujoco takes libmujoco.so.4.0.1");
    return found;
  };
  auto const find = [&](auto& function, char const* name) { function = reinterpret_cast<std::decay_t<decltype(function)>>(symbol(name)); };
  Library l{};
  find(l.version, "mj_version");
  if (int const version = l.version(); version != wanted_version)
    throw Error(file + ": is version " + std::to_string(version) + " of MuJoCo; --mujoco takes 4.0.1 (" + std::to_string(wanted_version) +
                ")");
  find(l.parse, "mj_parseXMLString");
  find(l.compile, "mj_compile");
  find(l.spec_error, "mjs_getError");
  find(l.delete_spec, "mj_deleteSpec");
  find(l.delete_model, "mj_deleteModel");
  find(l.make_data, "mj_makeData");
  find(l.delete_data, "mj_deleteData");
  find(l.reset, "mj_resetData");
  find(l.step, "mj_step");
  find(l.state_size, "mj_stateSize");
  find(l.get_state, "mj_getState");
  find(l.set_state, "mj_setState");
  *static_cast<void (**)(char const*)>(symbol("mju_user_warning")) = keep_warning;
  *static_cast<void (**)(char const*)>(symbol("mju_user_error")) = stop_at_error;
  return l;
}

/// The description with the solver's options behind its own: MuJoCo takes the last.
std::string text_for_mujoco(gsp::Description const& description, std::string const& solver) {
  std::string const option = solver == "newton" ? R"(solver="Newton" iterations="100" ls_iterations="50")"
                             : solver == "cg"   ? R"(solver="CG" iterations="100" ls_iterations="50")"
                                                : R"(solver="PGS" iterations="10")";
  std::string text = gsp::io::format_mjcf(description);
  text.insert(text.rfind("</mujoco>"), "<option " + option + R"( tolerance="1e-8"/>)");
  return text;
}

class MujocoPeer : public Peer {
 public:
  MujocoPeer(std::string const& file, gsp::Description const& description, int worlds, PeerOptions const& options)
      : mujoco_(open_library(file)), worlds_(static_cast<std::size_t>(worlds)) {
    char error[1000] = "";
    std::string const text = text_for_mujoco(description, options.solver);
    mjSpec* const spec = mujoco_.parse(text.c_str(), nullptr, error, sizeof error);
    if (!spec) throw Error(file + ": MuJoCo does not take the model: " + error + "; leave out --peers");
    model_ = mujoco_.compile(spec, nullptr);
    std::string const why = model_ ? "" : mujoco_.spec_error(spec);
    mujoco_.delete_spec(spec);
    if (!model_) throw Error(file + ": MuJoCo does not take the model: " + why + "; leave out --peers");
    std::size_t const threads = std::min(worlds_, static_cast<std::size_t>(options.threads));
    for (std::size_t t = 0; t < threads; ++t) data_.push_back(mujoco_.make_data(model_));
    size_ = size_of(state_integration);
    states_.resize(worlds_ * size_);
  }
  ~MujocoPeer() override {
    for (mjData* const d : data_) mujoco_.delete_data(d);
    if (model_) mujoco_.delete_model(model_);
  }
  MujocoPeer(MujocoPeer const&) = delete;
  MujocoPeer& operator=(MujocoPeer const&) = delete;

  void start(States const& s) override {
    mjData* const d = data_.front();
    auto const set = [&](std::vector<double> const& rows, std::size_t row, int what) {
      if (!rows.empty()) mujoco_.set_state(model_, d, &rows[row * size_of(what)], what);
    };
    for (std::size_t w = 0; w < worlds_; ++w) {
      std::size_t const from = s.worlds == 1 ? 0 : w;
      mujoco_.reset(model_, d);
      set(s.qpos, from, state_qpos);
      set(s.qvel, from, state_qvel);
      set(s.act, from, state_act);
      set(s.ctrl, from, state_ctrl);
      set(s.mocap_pos, 0, state_mocap_pos);
      set(s.mocap_quat, 0, state_mocap_quat);
      mujoco_.get_state(model_, d, state(w), state_integration);
    }
  }
  void step(long long steps, std::vector<double> const& ctrl, long long period) override {
    auto const work = [&](std::size_t thread) {
      for (std::size_t w = thread; w < worlds_; w += data_.size()) step_world(data_[thread], w, steps, ctrl, period);
    };
    std::vector<std::thread> others;
    for (std::size_t t = 1; t < data_.size(); ++t) others.emplace_back(work, t);
    work(0);
    for (auto& t : others) t.join();
  }
  void save() override { saved_ = states_; }
  void restore() override { states_ = saved_; }
  void get(std::vector<double>& qpos, std::vector<double>& qvel) const override {
    mjData* const d = data_.front();
    std::size_t const nq = size_of(state_qpos);
    std::size_t const nv = size_of(state_qvel);
    qpos.resize(worlds_ * nq);
    qvel.resize(worlds_ * nv);
    for (std::size_t w = 0; w < worlds_; ++w) {
      mujoco_.set_state(model_, d, &states_[w * size_], state_integration);
      mujoco_.get_state(model_, d, &qpos[w * nq], state_qpos);
      mujoco_.get_state(model_, d, &qvel[w * nv], state_qvel);
    }
  }
  std::string warning() const override {
    std::lock_guard const lock(warning_mutex);
    return first_warning;
  }

 private:
  std::size_t size_of(int what) const { return static_cast<std::size_t>(mujoco_.state_size(model_, what)); }
  double* state(std::size_t world) { return &states_[world * size_]; }
  void step_world(mjData* d, std::size_t w, long long steps, std::vector<double> const& ctrl, long long period) {
    std::size_t const nu = size_of(state_ctrl);
    mujoco_.set_state(model_, d, state(w), state_integration);
    for (long long k = 0; k < steps; ++k) {
      if (!ctrl.empty()) mujoco_.set_state(model_, d, &ctrl[(w + static_cast<std::size_t>(k % period)) * nu], state_ctrl);
      mujoco_.step(model_, d);
    }
    mujoco_.get_state(model_, d, state(w), state_integration);
  }

  Library mujoco_;
  std::size_t worlds_ = 0, size_ = 0;
  mjModel* model_ = nullptr;
  std::vector<mjData*> data_;
  std::vector<double> states_, saved_;  // (worlds, size_)
};

}  // namespace

std::string mujoco_file(Arguments const& a) {
  if (auto const given = a.text("--mujoco")) return *given;
  if (char const* const file = std::getenv("GSP_MUJOCO")) return file;
  a.fail("--peers needs MuJoCo's library: give --mujoco FILE, libmujoco.so.4.0.1 of the wheel mujoco-core, or set GSP_MUJOCO");
}

std::unique_ptr<Peer> make_mujoco(std::string const& library, gsp::Description const& description, int worlds, PeerOptions const& options) {
  return std::make_unique<MujocoPeer>(library, description, worlds, options);
}

}  // namespace gsp_cli
