#pragma once
// MuJoCo's state and its own contacts for our rows, so that these can be compared one by one.
#include <doctest/doctest.h>
#include <mujoco/mujoco.h>

#include <algorithm>
#include <cmath>
#include <gsp/collision/contacts.hpp>
#include <gsp/model/state.hpp>
#include <map>

namespace gsp_test {

using Contacts = gsp::Contacts<double, Kokkos::HostSpace>;

inline void raise(double& worst, double off) { worst = std::fmax(worst, std::isfinite(off) ? off : INFINITY); }
inline double apart(double a, double b) { return std::abs(a - b) / std::fmax(1e-300, std::fmax(std::abs(a), std::abs(b))); }

inline void copy_state(mjModel const* m, mjData const* d, gsp::State<double, Kokkos::HostSpace>& state) {
  auto const copy = [](auto const& to, double const* from, int n) { std::copy(from, from + n, to.data()); };
  copy(state.qpos, d->qpos, m->nq), copy(state.qvel, d->qvel, m->nv), copy(state.act, d->act, m->na), copy(state.ctrl, d->ctrl, m->nu);
  copy(state.mocap_pos, d->mocap_pos, 3 * m->nmocap), copy(state.mocap_quat, d->mocap_quat, 4 * m->nmocap);
  for (int i = 0; i < m->neq; ++i) state.eq_active(0, i) = d->eq_active[i];
  gsp::detail::moves_on(state);
}

/// Friction, softness and kind of a contact of ours beside MuJoCo's.
inline double parameters_apart(gsp::ContactParameters<double> const& p, mjContact const& t) {
  int const condim = t.dist >= t.includemargin && t.efc_address >= 0 ? 1 : p.condim;  // adhesion over a gap: a normal alone
  double worst = condim == t.dim ? 0 : INFINITY;
  auto const put = [&](double mine, double theirs) { raise(worst, mine == theirs ? 0 : apart(mine, theirs)); };
  for (int i = 0; i < 5; ++i) put(p.friction[i], t.friction[i]);
  for (int i = 0; i < 2; ++i) put(p.solref[i], t.solref[i]), put(p.solreffriction[i], t.solreffriction[i]);
  for (int i = 0; i < 5; ++i) put(p.solimp[i], t.solimp[i]);
  put(p.margin, t.includemargin), put(p.adhesion, t.adhesion);
  return worst;
}

/// MuJoCo's contacts, in its order, in a pool of ours, whose pairs are listed; `parameters`: how far those of our pairs are from its own.
inline Contacts contacts_of(mjData const* d, gsp::CollisionModel<double, Kokkos::HostSpace> const& collision, double& parameters) {
  auto contacts = gsp::make_contacts(Kokkos::DefaultHostExecutionSpace{}, collision, {.contacts_per_world = d->ncon + 1});
  contacts.stamp = {};  // ours are not found by collide
  std::multimap<std::pair<int, int>, int> pairs;
  for (int p = 0; p < collision.pairs; ++p) {
    int const a = collision.collider_geom(collision.pair_collider(p, 0)), b = collision.collider_geom(collision.pair_collider(p, 1));
    pairs.emplace(std::minmax(a, b), p);
  }
  for (int c = 0; c < d->ncon; ++c) {
    auto const& t = d->contact[c];
    auto const [first, last] = pairs.equal_range(std::minmax(t.geom[0], t.geom[1]));
    REQUIRE(first != last);  // else they are no pair of ours
    double off = INFINITY;
    int pair = first->second;
    for (auto at = first; at != last; ++at)  // two geoms may be named twice
      if (double const own = parameters_apart(collision.parameters_of(0, at->second), t); own < off) off = own, pair = at->second;
    raise(parameters, off);
    int const collider = collision.pair_collider(pair, 0), other = collision.pair_collider(pair, 1);
    bool const swapped = collision.collider_geom(collider) != t.geom[0];
    contacts.pair(c) = pair;
    contacts.feature(c) = c;
    contacts.geom1(c) = t.geom[0], contacts.geom2(c) = t.geom[1];
    contacts.body1(c) = collision.collider_body(swapped ? other : collider);
    contacts.body2(c) = collision.collider_body(swapped ? collider : other);
    contacts.dist(c) = t.dist, contacts.includemargin(c) = t.includemargin;
    for (int i = 0; i < 3; ++i) contacts.pos(c, i) = t.pos[i];
    for (int i = 0; i < 9; ++i) contacts.frame(c, i) = t.frame[i];
    if (contacts.adhesive) contacts.adhesion(c) = t.adhesion;
    for (int i = 0; i < 3 && contacts.moving; ++i) contacts.surfacevel(c, i) = t.surfacevel[i];
  }
  contacts.first(0) = 0, contacts.end(0) = d->ncon, contacts.status(0) = 0;
  return contacts;
}

/// Row i of efc_J, dense.
inline std::vector<double> row_of(mjModel const* m, mjData const* d, int i) {
  std::vector<double> row(std::size_t(m->nv), 0.);
  int const adr = mj_isSparse(m) ? d->efc_J_rowadr[i] : i * m->nv, n = mj_isSparse(m) ? d->efc_J_rownnz[i] : m->nv;
  for (int e = 0; e < n; ++e) row[std::size_t(mj_isSparse(m) ? d->efc_J_colind[adr + e] : e)] = d->efc_J[adr + e];
  return row;
}
}  // namespace gsp_test
