#pragma once
// The Stepper over Kokkos; stepper_float_kernels.cpp and stepper_double_kernels.cpp instantiate it.
#include <gsp/step/step.hpp>

#include "stepper.hpp"

namespace gsp_cli {

/// ctrl = the controls of one step, of each world or of all.
template <class R, class Mem>
struct CopyControls {
  Kokkos::View<R***, Kokkos::LayoutRight, Mem> controls;
  Kokkos::View<R**, Kokkos::LayoutRight, Mem> ctrl;
  std::size_t step;
  int nu;
  bool shared;
  KOKKOS_FUNCTION void operator()(int i) const { ctrl(i / nu, i % nu) = controls(step, shared ? 0 : i / nu, i % nu); }
};

template <class R, class Exec>
class KokkosStepper : public Stepper {
  using Mem = typename Exec::memory_space;
  template <class T>
  using Host = Kokkos::View<T, Kokkos::LayoutRight, Kokkos::HostSpace>;

 public:
  KokkosStepper(gsp::CompiledModel const& m, StepperOptions const& o)
      : model_(gsp::make_model<R>(exec_, m, {.profile = o.mujoco ? gsp::Profile::mujoco : gsp::Profile::stable, .timestep = o.timestep})),
        state_(gsp::make_state(exec_, model_, {.worlds = o.worlds})),
        simulation_(gsp::make_simulation(exec_, model_, m, {.worlds = o.worlds, .approximate = o.approximate})),
        timestep_(o.timestep > 0 ? o.timestep : m.option.timestep) {
    if (o.iterations > 0) solver_.iterations = o.iterations;
  }

  void set(States const& s) override {
    int const n = state_.worlds;
    Host<R**> q("qpos", n, model_.nq), low("qpos_low", n, model_.nq), v("qvel", n, model_.nv), c("ctrl", n, model_.nu);
    for (std::size_t i = 0; i < s.qpos.size(); ++i) q.data()[i] = R(s.qpos[i]), low.data()[i] = R(s.qpos[i] - double(q.data()[i]));
    for (std::size_t i = 0; i < s.qvel.size(); ++i) v.data()[i] = R(s.qvel[i]);
    for (std::size_t i = 0; i < s.ctrl.size(); ++i) c.data()[i] = R(s.ctrl[i]);
    Kokkos::deep_copy(exec_, state_.qpos, q), Kokkos::deep_copy(exec_, state_.qpos_low, low), Kokkos::deep_copy(exec_, state_.qvel, v),
        Kokkos::deep_copy(exec_, state_.ctrl, c);
    exec_.fence("gsp: the start is on the device");
  }

  void load(Controls const& c) override {
    Host<R***> host("controls", c.steps, c.worlds, model_.nu);
    for (std::size_t i = 0; i < c.values.size(); ++i) host.data()[i] = R(c.values[i]);
    controls_ = Kokkos::create_mirror_view_and_copy(Mem{}, host);
  }
  void apply(std::size_t step) override {
    auto const controls = controls_;
    auto const ctrl = state_.ctrl;
    int const nu = model_.nu;
    bool const shared = controls.extent(1) == 1;
    Kokkos::parallel_for("gsp::program::apply", Kokkos::RangePolicy<Exec>(exec_, 0, state_.worlds * nu),
                         CopyControls<R, Mem>{controls, ctrl, step, nu, shared});
  }

  void step(int steps, bool measure) override {
    auto solver = solver_;
    solver.residual = measure;
    gsp::step(exec_, model_, state_, simulation_, {.steps = steps, .solver = solver});
    exec_.fence("gsp: steps are done");
  }

  void get(std::vector<double>& qpos, std::vector<double>& qvel) override {
    auto const q = Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, state_.qpos),
               low = Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, state_.qpos_low),
               v = Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, state_.qvel);
    qpos.resize(q.size()), qvel.resize(v.size());
    for (std::size_t i = 0; i < q.size(); ++i) qpos[i] = double(q.data()[i]) + double(low.data()[i]);
    for (std::size_t i = 0; i < v.size(); ++i) qvel[i] = v.data()[i];
  }

  StepCounts counts() override {
    StepCounts out;
    out.failed_worlds = count_failed();
    if (!model_.constraints) return out;
    auto const host = [](auto const& view) { return Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, view); };
    auto const rows = host(simulation_.rows.count), iterations = host(simulation_.rows.iterations);
    auto const residual = host(simulation_.rows.residual);
    out.contacts = simulation_.contacts.demand(exec_).contacts;
    for (int w = 0; w < state_.worlds; ++w)
      out.rows += rows(w), out.iterations = std::max(out.iterations, iterations(w)),
                           out.residual = std::max(out.residual, double(residual(w)));
    return out;
  }
  double timestep() const override { return timestep_; }

 private:
  int count_failed() const {
    auto const status = Kokkos::create_mirror_view_and_copy(Kokkos::HostSpace{}, state_.status);
    int n = 0;
    for (int w = 0; w < state_.worlds; ++w) n += (status(w) & gsp::status::stopped) != 0;
    return n;
  }

  Exec exec_;
  gsp::Model<R, Mem> model_;
  gsp::State<R, Mem> state_;
  gsp::Simulation<R, Mem> simulation_;
  gsp::PgsOptions solver_;
  double timestep_;
  Kokkos::View<R***, Kokkos::LayoutRight, Mem> controls_;
};

template <class R>
std::unique_ptr<Stepper> make_stepper_of(Device device, gsp::CompiledModel const& model, StepperOptions const& options) {
#ifdef KOKKOS_ENABLE_CUDA
  if (device == Device::cuda) return std::make_unique<KokkosStepper<R, Kokkos::Cuda>>(model, options);
#endif
  (void)device;
  return std::make_unique<KokkosStepper<R, Kokkos::DefaultHostExecutionSpace>>(model, options);
}

}  // namespace gsp_cli
