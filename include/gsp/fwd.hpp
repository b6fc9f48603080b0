#pragma once

/// The names of the library's types, for headers that only mention them: no Kokkos, no standard library, nothing to compile.
/// R: float or double. Mem: a memory space of Kokkos.
namespace gsp {

struct Error;
struct Description;    // model/description.hpp
struct CompiledModel;  // model/compiled.hpp
struct ModelOptions;
struct StateOptions;
struct SimulationOptions;
struct StepOptions;
struct PgsOptions;

template <class R>
struct Field;  // model/field.hpp
template <class R, class Mem>
struct Model;  // model/model.hpp
template <class R, class Mem>
struct State;  // model/state.hpp
template <class R, class Mem>
struct Poses;  // model/poses.hpp
template <class R, class Mem>
struct Dynamics;  // dynamics/dynamics.hpp
template <class R, class Mem>
struct RungeKutta;  // dynamics/runge_kutta.hpp
template <class R, class Mem>
struct CollisionModel;  // collision/collision_model.hpp
template <class R, class Mem>
struct Contacts;  // collision/contacts.hpp
template <class R, class Mem>
struct RayScene;  // ray/ray_scene.hpp
template <class R, class Mem>
struct Rays;  // ray/cast_rays.hpp
template <class R, class Mem>
struct RayHits;  // ray/cast_rays.hpp
template <class R, class Mem>
struct RayScan;  // ray/ray_scan.hpp
template <class R, class Mem>
struct Rows;  // constraint/rows.hpp
template <class Mem>
struct Islands;  // constraint/islands.hpp
template <class R, class Mem>
struct Impulses;  // constraint/impulses.hpp
template <class Mem>
struct Progress;  // constraint/progress.hpp
template <class R, class Mem>
struct Solution;  // solver/solution.hpp
template <class R, class Mem>
struct Newton;  // solver/newton.hpp
template <class R, class Mem>
struct Simulation;  // step/step.hpp

struct GaussianSet;  // splat/gaussians.hpp
struct FrameOptions;
struct RenderOptions;
template <class Mem>
struct Gaussians;
template <class Mem>
struct Cameras;  // splat/cameras.hpp
template <class Mem>
struct Frames;  // splat/frames.hpp

namespace io {
struct MjcfOptions;  // io/mjcf.hpp
struct UrdfOptions;  // io/urdf.hpp
struct SplatSet;     // io/splat_set.hpp
}  // namespace io

}  // namespace gsp
