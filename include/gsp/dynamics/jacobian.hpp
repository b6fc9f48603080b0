#pragma once
#include <gsp/core/region.hpp>
#include <gsp/dynamics/detail/dofs_above.hpp>
#include <gsp/dynamics/world_lanes.hpp>

/// Jacobians of points of bodies: velocity of the point = J qvel (MuJoCo's mj_jac, mj_jacBodyCom, mj_jacSite).
namespace gsp {

namespace detail {
inline void expects_index(char const* where, char const* what, int i, int count) {
  if (i < 0 || i >= count)
    throw std::invalid_argument(std::string(where) + ": there is no " + what + " " + std::to_string(i) + ": the model has " +
                                std::to_string(count) + ", numbered from 0; " + what + "_id(compiled, name) finds one");
}
template <class R, class Mem, class View>
struct PointJacobian {
  Model<R, Mem> model;
  Poses<R, Mem> poses;
  Dynamics<R, Mem> dynamics;
  int body;  // -1: of site `item`
  Vec3<R> point;
  Field<R> field;  // where it has data: the point is its item
  int item;
  View J;
  template <class T>
  KOKKOS_FUNCTION void operator()(WorldLane<T> const& l, int) const {
    int const body = this->body < 0 ? model.site_body(item) : this->body;
    DofsAbove<T, R, Mem> const dofs(l, model, dynamics, body);
    if (dofs.none()) return;
    Vec3<T> const local = field.data ? l.constant3(field, item) : Vec3<T>{T(point.x), T(point.y), T(point.z)};
    Vec3<T> const arm = l.load3(poses.xpos, body) + rotate(l.load4(poses.xquat, body), local) - dofs.center();
    dofs.each([&](int i, Spatial<T> const& motion) {
      Vec3<T> const w = motion.angular, v = motion.linear + cross(w, arm);
      for (int c = 0; c < 3; ++c)
        for (int k = 0; k < l.count; ++k) {
          J(l.world(k), c, dofs.in_world(i)) = get_lane(v[c], k);
          J(l.world(k), 3 + c, dofs.in_world(i)) = get_lane(w[c], k);
        }
    });
  }
};
template <ExecutionSpace Exec, class R, class Mem, class View>
void jacobian(char const* where, Exec const& exec, Model<R, Mem> const& model, Poses<R, Mem> const& poses, Dynamics<R, Mem> const& dynamics,
              int body, Vec3<R> const& point, Field<R> const& field, int item, View& J) {
  expects_fit(where, model, dynamics, poses);
  if (int(J.extent(0)) != dynamics.worlds || int(J.extent(1)) != 6 || int(J.extent(2)) != model.nv)
    throw std::invalid_argument(std::string(where) + ": J is (" + std::to_string(J.extent(0)) + ", " + std::to_string(J.extent(1)) + ", " +
                                std::to_string(J.extent(2)) + ") and must be (worlds, 6, nv), here (" + std::to_string(dynamics.worlds) +
                                ", 6, " + std::to_string(model.nv) + ")");
  expects_together(where, dynamics, set_of(Quantity::motion));
  expects_poses_with(where, poses, dynamics);
  zero(exec, J);
  for_world_lanes<R>("gsp::dynamics::jacobian", exec, dynamics.worlds, 1,
                     PointJacobian<R, Mem, View>{model, poses, dynamics, body, point, field, item, J});
}
}  // namespace detail

/// Jacobian of the point `local` (body frame) of a body: J (world, 6, nv), rows 0-2 velocity of the point, 3-5 angular velocity, in world
/// axes. After smooth_dynamics (or forward_kinematics and mass_matrix), at `poses`. Cost 20 flop a dof that moves the body.
/// Does not allocate, does not fence. Errors: std::invalid_argument where the dynamics hold no motions of the dofs, or those of the state
/// before its last step, or the poses are of another moment; for a body or site that the model does not have.
template <ExecutionSpace Exec, class R, class Mem, class View>
void body_jacobian(Exec const& exec, Model<R, Mem> const& model, Poses<R, Mem> const& poses, Dynamics<R, Mem> const& dynamics, int body,
                   std::type_identity_t<Vec3<R>> const& local, View& J) {
  Region const region("gsp::dynamics::body_jacobian");
  detail::expects_index("gsp::body_jacobian", "body", body, model.nbody);
  detail::jacobian("gsp::body_jacobian", exec, model, poses, dynamics, body, local, Field<R>{}, 0, J);
}
/// The same of a body's centre of mass.
template <ExecutionSpace Exec, class R, class Mem, class View>
void com_jacobian(Exec const& exec, Model<R, Mem> const& model, Poses<R, Mem> const& poses, Dynamics<R, Mem> const& dynamics, int body,
                  View& J) {
  Region const region("gsp::dynamics::com_jacobian");
  detail::expects_index("gsp::com_jacobian", "body", body, model.nbody);
  detail::jacobian("gsp::com_jacobian", exec, model, poses, dynamics, body, {}, model.body_ipos, body, J);
}
/// The same of a site.
template <ExecutionSpace Exec, class R, class Mem, class View>
void site_jacobian(Exec const& exec, Model<R, Mem> const& model, Poses<R, Mem> const& poses, Dynamics<R, Mem> const& dynamics, int site,
                   View& J) {
  Region const region("gsp::dynamics::site_jacobian");
  detail::expects_index("gsp::site_jacobian", "site", site, model.nsite);
  detail::jacobian("gsp::site_jacobian", exec, model, poses, dynamics, -1, {}, model.site_pos, site, J);
}

}  // namespace gsp
