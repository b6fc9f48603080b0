// Contacts of many small worlds and of one crowded world, all backends: the sample quadruped, the humanoid (GSP_DATA_DIR), and 1,000 boxes
// piled up.
#include <cmath>
#include <filesystem>
#include <gsp/collision/contacts.hpp>
#include <gsp/dynamics/kinematics.hpp>
#include <gsp/io/mjcf.hpp>
#include <gsp/model/compile.hpp>
#include <gsp/model/samples.hpp>
#include <random>
#include <support/bench.hpp>
#ifdef GSP_HAS_MUJOCO
#include <mujoco/mujoco.h>
#endif

using namespace gsp;

namespace {

/// World poses of a batch, made on the host in double: the initial positions, every free body shaken by `shift` [m] and turned by `turn`
/// [rad], every hinge and slide by `bend`.
std::vector<double> shaken(CompiledModel const& m, int worlds, double shift, double turn, double bend, double lower) {
  std::mt19937 random(1);
  std::uniform_real_distribution<double> uniform(-1, 1);
  std::vector<double> qpos;
  for (int w = 0; w < worlds; ++w) {
    std::vector<double> q = m.qpos0;
    for (int j = 0; j < m.njnt; ++j) {
      int const a = m.jnt_qposadr[j];
      if (m.jnt_type[j] >= int(JointType::slide)) {
        q[a] += bend * uniform(random);
        continue;
      }
      int const at = m.jnt_type[j] == int(JointType::free) ? a + 3 : a;
      if (at > a) {
        for (int i = 0; i < 3; ++i) q[a + i] += shift * uniform(random);
        q[a + 2] -= lower;
      }
      auto const r = exp_rotation(Vec3<double>{turn * uniform(random), turn * uniform(random), turn * uniform(random)}) *
                     Quat<double>{q[at], q[at + 1], q[at + 2], q[at + 3]};
      q[at] = r.w, q[at + 1] = r.x, q[at + 2] = r.y, q[at + 3] = r.z;
    }
    qpos.insert(qpos.end(), q.begin(), q.end());
  }
  return qpos;
}

template <class R, class Exec>
void run(Exec const& exec, char const* scene, CompiledModel const& m, std::vector<double> const& qpos, int worlds, char const* precision) {
  auto const model = make_model<R>(exec, m);
  auto state = make_state<R>(exec, model, {.worlds = worlds});
  auto poses = make_poses<R>(exec, model, {.worlds = worlds});
  auto dynamics = make_dynamics<R>(exec, model, {.worlds = worlds});
  auto const host = Kokkos::create_mirror_view(Kokkos::HostSpace{}, state.qpos);
  for (int w = 0; w < worlds; ++w)
    for (int i = 0; i < m.nq; ++i) host(w, i) = R(qpos[std::size_t(w) * m.nq + i]);
  Kokkos::deep_copy(exec, state.qpos, host);
  forward_kinematics(exec, model, state, poses, dynamics);
  auto const collision = make_collision_model<R>(exec, m);
  auto contacts = make_contacts(exec, collision, {.worlds = worlds});
  do collide(exec, collision, poses, contacts);
  while (grow(exec, contacts));
  auto const time = gsp_bench::measure(exec, [&] { collide(exec, collision, poses, contacts); });
  auto const demand = contacts.demand(exec);
  gsp_bench::Line("collision/collide", exec)
      .add("scene", scene)
      .add("precision", precision)
      .add("worlds", worlds)
      .add("pairs", collision.pairs)
      .add("candidates_per_world", double(demand.candidates) / worlds)
      .add("contacts_per_world", double(demand.contacts) / worlds)
      .add(time)
      .add("us_per_world", 1e6 * time.median / worlds)
      .add_hash(contacts.end)
      .print();
}

template <class Exec>
void run_all(Exec const& exec, char const* scene, CompiledModel const& m, std::vector<double> const& qpos, int worlds) {
  run<float>(exec, scene, m, qpos, worlds, "float");
  if (worlds <= 1024) run<double>(exec, scene, m, qpos, worlds, "double");
}

void every_backend(char const* scene, CompiledModel const& m, int worlds, double shift, double turn, double bend, double lower) {
  auto const qpos = shaken(m, worlds, shift, turn, bend, lower);
#ifdef KOKKOS_ENABLE_SERIAL
  run_all(Kokkos::Serial{}, scene, m, qpos, worlds);
#endif
#ifdef KOKKOS_ENABLE_OPENMP
  run_all(Kokkos::OpenMP{}, scene, m, qpos, worlds);
#endif
#ifdef KOKKOS_ENABLE_CUDA
  run_all(Kokkos::Cuda{}, scene, m, qpos, worlds);
#endif
}

#ifdef GSP_HAS_MUJOCO
/// MuJoCo's collision of the same file and positions, one thread.
void oracle(char const* scene, std::string const& file, CompiledModel const& m, int worlds, double shift, double turn, double bend,
            double lower) {
  char error[500];
  mjModel* const o = mj_loadXML(file.c_str(), nullptr, error, sizeof error);
  if (o == nullptr || o->nq != m.nq) return;
  auto const qpos = shaken(m, worlds, shift, turn, bend, lower);
  std::vector<mjData*> data;
  for (int w = 0; w < worlds; ++w) {
    data.push_back(mj_makeData(o));
    std::copy_n(&qpos[std::size_t(w) * m.nq], m.nq, data.back()->qpos);
    mj_kinematics(o, data.back());
    mj_comPos(o, data.back());
  }
  long contacts = 0;
  Kokkos::Serial const exec;
  auto const time = gsp_bench::measure(exec, [&] {
    contacts = 0;
    for (mjData* d : data) mj_collision(o, d), contacts += d->ncon;
  });
  gsp_bench::Line("collision/mujoco", exec)
      .add("scene", scene)
      .add("precision", "double")
      .add("worlds", worlds)
      .add("contacts_per_world", double(contacts) / worlds)
      .add(time)
      .add("us_per_world", 1e6 * time.median / worlds)
      .print();
  for (mjData* d : data) mj_deleteData(d);
  mj_deleteModel(o);
}
#endif

Description pile(int side) {
  Description d;
  GeomDescription floor;
  floor.type = ShapeType::plane, floor.size = {0, 0, 1};
  d.bodies[0].geoms.push_back(floor);
  for (int k = 0; k < side * side * side; ++k) {
    BodyDescription b;
    b.parent = 0, b.pos = {0.199 * (k % side), 0.199 * (k / side % side), 0.0995 + 0.199 * (k / side / side)};
    GeomDescription g;
    g.type = ShapeType::box, g.size = {0.1, 0.1, 0.1};
    JointDescription j;
    j.type = JointType::free;
    b.geoms.push_back(g), b.joints.push_back(j);
    d.bodies.push_back(b);
  }
  return d;
}

}  // namespace

int main(int argc, char** argv) {
  Kokkos::ScopeGuard kokkos(argc, argv);
  every_backend("quadruped among boxes and balls", compile(samples::quadruped_scene()), 1024, 0.05, 0.2, 0.3, 0.05);
  std::string const humanoid = std::string(GSP_DATA_DIR) + "/models/mujoco/humanoid/humanoid.xml";
  if (std::filesystem::exists(humanoid)) {
    auto const m = compile(io::read_mjcf(humanoid));
    for (int worlds : {1024, 8192}) every_backend("humanoid, fallen", m, worlds, 0.02, 1.5, 0.3, 1.1);
#ifdef GSP_HAS_MUJOCO
    oracle("humanoid, fallen", humanoid, m, 256, 0.02, 1.5, 0.3, 1.1);
#endif
  }
  every_backend("1,000 boxes in one world", compile(pile(10)), 1, 0.0005, 0.001, 0, 0);
}
