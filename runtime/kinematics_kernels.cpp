#include <gsp/dynamics/kinematics.hpp>
#include <gsp/runtime/stepper.hpp>
#include <gsp/sensor/cameras.hpp>
#include <optional>

#include "device.hpp"

namespace gsp::runtime {

template <class Exec>
class KokkosKinematics : public Kinematics {
  using Mem = typename Exec::memory_space;

 public:
  explicit KokkosKinematics(CompiledModel const& m) : compiled_(m), bodies_(std::max(1, m.nbody)) {
    if (m.nv > 0)
      model_ = make_model<double>(exec_, m);
    else if (m.nbody > 0) {
      compiled_.body_mocap.clear();  // nobody moves them here: they stand where the model has them
      fixed_ = static_poses(compiled_);
    }
  }

  PoseArrays poses(Array const& qpos) override {
    int const worlds = static_cast<int>(qpos.rank == 2 ? qpos.extents[0] : 0);
    expects(worlds > 0 && qpos.extents[1] == (model_ ? model_->nq : 0), "gsp::runtime::Kinematics::poses: qpos must be (worlds, nq)");
    if (worlds != worlds_) make_buffers(worlds);
    if (model_) {
      copy(qpos, array_of<Exec>(state_->qpos));
      forward_kinematics(exec_, *model_, *state_, *poses_, *dynamics_);
    }
    return {array_of<Exec>(poses_->xpos), array_of<Exec>(poses_->xquat), array_of<Exec>(poses_->xanchor), array_of<Exec>(poses_->xaxis)};
  }

  CameraArrays cameras(int camera, int width, int height) override {
    expects(worlds_ > 0, "gsp::runtime::Kinematics::cameras: call poses first");
    if (!model_) throw Error("gsp::runtime::Kinematics::cameras: nothing moves in the model; give its camera as viewmats and Ks");
    auto mounts =
        make_camera_mounts(exec_, *model_, compiled_, {{.camera_id = camera}}, {.worlds = worlds_, .width = width, .height = height});
    if (!cameras_ || cameras_->images() != mounts.images()) cameras_ = make_cameras(exec_, mounts.images());
    cameras_of(exec_, *model_, *poses_, mounts, *cameras_);
    exec_.fence("gsp::runtime::Kinematics::cameras: the mounts go away");
    return {array_of<Exec>(cameras_->viewmats), array_of<Exec>(cameras_->Ks), array_of<Exec>(cameras_->world)};
  }

 private:
  void make_buffers(int worlds) {
    worlds_ = worlds;
    state_.reset();
    dynamics_.reset();
    poses_.reset();  // the old ones go before the new ones come
    if (model_) {
      state_ = make_state(exec_, *model_, {.worlds = worlds});
      dynamics_ = make_dynamics(exec_, *model_, {.worlds = worlds});
      poses_ = make_poses(exec_, *model_, {.worlds = worlds});
      return;
    }
    poses_ = make_poses<double>(exec_, worlds, bodies_, 0);
    if (fixed_.empty()) return;
    std::vector<double> pos;
    std::vector<double> quat;
    for (int b = 0; b < bodies_; ++b) {
      auto const* const pose = &fixed_[7 * std::size_t(b)];
      pos.insert(pos.end(), pose, pose + 3);
      quat.insert(quat.end(), pose + 3, pose + 7);
    }
    copy(host_array(pos.data(), {1, bodies_, 3}), array_of<Exec>(poses_->xpos));
    copy(host_array(quat.data(), {1, bodies_, 4}), array_of<Exec>(poses_->xquat));
  }

  Exec exec_;
  CompiledModel compiled_;
  int bodies_;
  int worlds_ = 0;
  std::vector<double> fixed_;  // poses of a model in which nothing moves
  std::optional<Model<double, Mem>> model_;
  std::optional<State<double, Mem>> state_;
  std::optional<Dynamics<double, Mem>> dynamics_;
  std::optional<Poses<double, Mem>> poses_;
  std::optional<Cameras<Mem>> cameras_;
};

std::unique_ptr<Kinematics> make_kinematics(Device device, CompiledModel const& model) {
  std::unique_ptr<Kinematics> out;
  on_device(device, [&]<class Exec>(Exec const&) { out = std::make_unique<KokkosKinematics<Exec>>(model); });
  return out;
}

}  // namespace gsp::runtime
