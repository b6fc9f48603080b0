// URDF against MuJoCo's own reader, told to keep fixed links and visuals and to take masses from <inertial> alone, as we do.
#include <doctest/doctest.h>

#include <gsp/io/urdf.hpp>
#include <gsp/model/compile.hpp>
#include <gsp/model/detail/host_math.hpp>
#include <io/urdf_robots.hpp>

#include "oracle/load.hpp"

namespace {

std::string with_extension(std::string text) {
  auto const at = text.rfind("</robot>");
  return text.insert(
      at, "<mujoco><compiler fusestatic='false' discardvisual='false' inertiafromgeom='false' balanceinertia='false'/></mujoco>");
}

struct Worst {
  double value = 0;
  void add(double a, double b) { value = std::fmax(value, std::isfinite(a) ? std::fabs(a - b) / std::fmax(1., std::fabs(b)) : INFINITY); }
  template <class A>
  void add(A const& a, double const* b, int n) {
    for (int i = 0; i < n; ++i) add(a[std::size_t(i)], b[i]);
  }
  /// Either sign of a quaternion is the same rotation.
  void add_quat(gsp::Double4 const& a, double const* b) {
    double dot = 0;
    for (int i = 0; i < 4; ++i) dot += a[std::size_t(i)] * b[i];
    for (int i = 0; i < 4; ++i) add((dot < 0 ? -1 : 1) * a[std::size_t(i)], b[i]);
  }
};

std::array<double, 6> tensor(gsp::Double4 const& q, gsp::Double3 const& moments) {
  std::array<double, 6> t{};
  for (std::size_t k = 0; k < 3; ++k) {
    gsp::Double3 axis{0, 0, 0};
    axis[k] = 1;
    auto const v = gsp::detail::rotate(q, axis);
    double const products[] = {v[0] * v[0], v[1] * v[1], v[2] * v[2], v[0] * v[1], v[0] * v[2], v[1] * v[2]};
    for (std::size_t i = 0; i < 6; ++i) t[i] += moments[k] * products[i];
  }
  return t;
}

void compare(std::string const& text) {
  auto const theirs = gsp_test::load_oracle("model.xml", with_extension(text));
  auto const description = gsp::io::parse_urdf(text, "r.urdf");
  auto const ours = gsp::compile(description);
  mjModel const* m = theirs.m();
  REQUIRE(ours.nbody == m->nbody);
  REQUIRE(ours.njnt == m->njnt);
  REQUIRE(ours.nv == m->nv);
  REQUIRE(ours.ngeom == m->ngeom);
  Worst worst;
  for (int b = 1; b < m->nbody; ++b) {
    CAPTURE(ours.body_name[b]);
    int const t = mj_name2id(m, mjOBJ_BODY, ours.body_name[b].c_str());
    REQUIRE(t > 0);
    worst.add(ours.body_mass[b], m->body_mass[t]), worst.add(ours.body_pos[b], m->body_pos + 3 * t, 3);
    worst.add_quat(ours.body_quat[b], m->body_quat + 4 * t);
    if (ours.body_mass[b] == 0) continue;
    worst.add(ours.body_ipos[b], m->body_ipos + 3 * t, 3);
    double const *q = m->body_iquat + 4 * t, *i = m->body_inertia + 3 * t;
    auto const reference = tensor({q[0], q[1], q[2], q[3]}, {i[0], i[1], i[2]});
    worst.add(tensor(ours.body_iquat[b], ours.body_inertia[b]), reference.data(), 6);
    REQUIRE(ours.body_geomnum[b] == m->body_geomnum[t]);
    for (int k = 0; k < ours.body_geomnum[b]; ++k) {
      int const g = ours.body_geomadr[b] + k, o = m->body_geomadr[t] + k;
      // they list collisions or visuals first: the kind must be there, with the same numbers
      bool found = false;
      for (int e = m->body_geomadr[t]; e < m->body_geomadr[t] + m->body_geomnum[t]; ++e) {
        Worst own;
        own.add(ours.geom_size[g], m->geom_size + 3 * e, 3), own.add(ours.geom_pos[g], m->geom_pos + 3 * e, 3);
        own.add_quat(ours.geom_quat[g], m->geom_quat + 4 * e);
        found = found || (ours.geom_type[g] == m->geom_type[e] && ours.geom_contype[g] == m->geom_contype[e] && own.value < 1e-14);
      }
      CHECK_MESSAGE(found, "geom ", g, " and ", o);
    }
  }
  for (int j = 0; j < m->njnt; ++j) {
    CAPTURE(ours.jnt_name[j]);
    int const t = mj_name2id(m, mjOBJ_JOINT, ours.jnt_name[j].c_str());
    REQUIRE(t >= 0);
    CHECK(ours.jnt_type[j] == m->jnt_type[t]);
    CHECK(ours.jnt_limited[j] == m->jnt_limited[t]);
    CHECK(ours.jnt_actfrclimited[j] == m->jnt_actfrclimited[t]);
    if (ours.jnt_limited[j]) worst.add(ours.jnt_range[j], m->jnt_range + 2 * t, 2);
    if (ours.jnt_actfrclimited[j]) worst.add(ours.jnt_actfrcrange[j], m->jnt_actfrcrange + 2 * t, 2);
    worst.add(ours.jnt_axis[j], m->jnt_axis + 3 * t, 3), worst.add(ours.jnt_pos[j], m->jnt_pos + 3 * t, 3);
    int const d = ours.jnt_dofadr[j], e = m->jnt_dofadr[t];
    worst.add(ours.dof_damping[d], m->dof_damping[e]), worst.add(ours.dof_frictionloss[d], m->dof_frictionloss[e]);
    worst.add(ours.dof_invweight0[d], m->dof_invweight0[e]);
  }
  REQUIRE(int(description.equalities.size()) == m->neq);
  for (int e = 0; e < m->neq; ++e) {
    auto const& own = description.equalities[std::size_t(e)];
    CHECK(int(own.type) == m->eq_type[e]);
    CHECK(own.name1 == mj_id2name(m, mjOBJ_JOINT, m->eq_obj1id[e]));
    CHECK(own.name2 == mj_id2name(m, mjOBJ_JOINT, m->eq_obj2id[e]));
    worst.add(own.data, m->eq_data + mjNEQDATA * e, 5);
  }
  MESSAGE("largest difference ", worst.value);
  CHECK(worst.value < 1e-10);
}

}  // namespace

TEST_CASE("three robots have MuJoCo's numbers") {
  SUBCASE("arm") { compare(gsp_test::urdf_arm()); }
  SUBCASE("quadruped") { compare(gsp_test::urdf_quadruped()); }
  SUBCASE("wheels") { compare(gsp_test::urdf_wheels()); }
}

TEST_CASE("planar and floating joints turn into the same joints") {
  std::string const inertial = "<inertial><mass value='1'/><inertia ixx='1' ixy='0' ixz='0' iyy='1' iyz='0' izz='1'/></inertial>";
  compare("<robot name='r'><link name='world'/><link name='b'>" + inertial + "</link><link name='c'>" + inertial +
          "</link><joint name='f' type='floating'><parent link='world'/><child link='b'/><origin xyz='1 2 3' rpy='0.1 0.2 0.3'/></joint>"
          "<joint name='p' type='planar'><parent link='b'/><child link='c'/><axis xyz='0 1 2'/></joint></robot>");
}
