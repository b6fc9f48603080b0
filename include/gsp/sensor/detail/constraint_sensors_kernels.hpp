#pragma once
#include <gsp/constraint/detail/tree_reader.hpp>
#include <gsp/constraint/detail/write_contact_forces.hpp>
#include <gsp/constraint/joint_limit.hpp>
#include <gsp/constraint/tendon.hpp>
#include <gsp/ray/ray_shapes.hpp>
#include <gsp/sensor/detail/sensor_frames.hpp>

/// Kernels of gsp/sensor/constraint_sensors.hpp, where the contract stands.
namespace gsp::detail {

template <class R, class Mem>
struct ContactSensorBase {
  ContactForce<R, Mem> force_of;
  SitePoses<R, Mem> site;  // site(w, s)
  typename Model<R, Mem>::template Array<int> body_parent;
  Kokkos::View<int*, Mem> site_type;
  Kokkos::View<R*, Mem> site_size;
  bool solved;

  KOKKOS_INLINE_FUNCTION ShapeType volume(int s) const { return ShapeType(site_type(s)); }
  KOKKOS_INLINE_FUNCTION Vec3<R> size_of(int s) const { return {site_size(3 * s), site_size(3 * s + 1), site_size(3 * s + 2)}; }
  KOKKOS_INLINE_FUNCTION bool force(int w, int k, R (&f)[6]) const {
    for (R& x : f) x = R(0);
    return solved && force_of(w, k, f);
  }
};

template <class R, class Mem>
struct TouchSensors {
  ContactSensorBase<R, Mem> base;
  Kokkos::View<SensorEntry<R>*, Mem> entries;
  int nsensordata;
  int count() const { return int(entries.extent(0)); }
  KOKKOS_INLINE_FUNCTION int size() const { return 1; }
  KOKKOS_INLINE_FUNCTION int adr(int i) const { return entries(i).adr; }
  int columns() const { return nsensordata; }
  KOKKOS_INLINE_FUNCTION R limit(int i, R x) const { return cut(entries(i), x); }
  template <class Put>
  KOKKOS_FUNCTION void operator()(int w, int i, Put const& put) const {
    int const s = entries(i).object, body = base.site.site_body(s);
    auto const& contacts = base.force_of.contacts;
    Transform<R> const site = base.site(w, s);
    R sum(0);
    for (int k = 0; k < contacts.count_of(w); ++k) {
      int const c = contacts.first_of(w) + k;
      bool const second = contacts.body2(c) == body;
      if (!second && contacts.body1(c) != body) continue;
      R f[6];
      if (!base.force(w, k, f) || !(f[0] > R(0))) continue;
      Vec3<R> const outward = (second ? R(-1) : R(1)) * contacts.axis(c, 0);
      Ray<R> const ray{rotate_inverse(site.q, contacts.point(c) - site.p), rotate_inverse(site.q, outward)};
      if (ray_shape(base.volume(s), base.size_of(s), ray).x < no_hit<R>()) sum += f[0];
    }
    put(0, sum);
  }
};

/// Velocity of a body's point in world axes.
template <class R, class Mem>
KOKKOS_INLINE_FUNCTION Spatial<R> point_velocity(TreeReader<R, Mem> const& trees, int w, int body, Vec3<R> const& point) {
  auto const m = trees.motion(w, body);
  Spatial<R> v = m.velocity;
  v.linear = v.linear + cross(v.angular, point - m.center);
  return v;
}

/// What MuJoCo takes for the velocity of an adhesion actuator: that with which its body's contacts close, on average.
template <class R, class Mem>
struct AdhesionVelocities {
  ContactSensorBase<R, Mem> base;
  TreeReader<R, Mem> trees;
  Kokkos::View<SensorEntry<R>*, Mem> entries;
  int nsensordata;
  bool actuation;
  int count() const { return int(entries.extent(0)); }
  KOKKOS_INLINE_FUNCTION int size() const { return 1; }
  KOKKOS_INLINE_FUNCTION int adr(int i) const { return entries(i).adr; }
  int columns() const { return nsensordata; }
  KOKKOS_INLINE_FUNCTION R limit(int i, R x) const { return cut(entries(i), x); }
  template <class Put>
  KOKKOS_FUNCTION void operator()(int w, int i, Put const& put) const {
    int const body = entries(i).object;
    auto const& contacts = base.force_of.contacts;
    R sum(0);
    int touching = 0;
    for (int c = contacts.first_of(w); actuation && c < contacts.first_of(w) + contacts.count_of(w); ++c) {
      int const first = contacts.body1(c), second = contacts.body2(c);
      if (first != body && second != body) continue;
      Vec3<R> const point = contacts.point(c);
      sum += dot(contacts.axis(c, 0), point_velocity(trees, w, first, point).linear - point_velocity(trees, w, second, point).linear);
      ++touching;
    }
    put(0, touching > 0 ? sum / R(touching) : R(0));
  }
};

template <class R, class Mem>
struct ContactSensors {
  ContactSensorBase<R, Mem> base;
  TreeReader<R, Mem> trees;
  Kokkos::View<ContactSensorEntry*, Mem> entries;
  int nsensordata;
  using Entry = ContactSensorEntry;
  int count() const { return int(entries.extent(0)); }
  KOKKOS_INLINE_FUNCTION int size() const { return nsensordata; }  // at most
  KOKKOS_INLINE_FUNCTION int adr(int i) const { return entries(i).adr; }
  int columns() const { return nsensordata; }

  /// Whether end `end` of contact c is what a side names.
  KOKKOS_INLINE_FUNCTION bool is(int c, int end, Entry const& e, int k) const {
    auto const& contacts = base.force_of.contacts;
    int const side = e.side[k], id = e.id[k];
    if (side == Entry::geom) {
      int const geom = end == 0 ? contacts.geom1(c) : contacts.geom2(c);
      return geom >= id && geom < e.end[k];
    }
    int body = end == 0 ? contacts.body1(c) : contacts.body2(c);
    if (side == Entry::subtree)
      while (body > id) body = base.body_parent(body);
    return body == id;
  }
  /// 0: it does not match; 1: it does; -1: it does the other way round.
  KOKKOS_INLINE_FUNCTION int match(int w, Entry const& e, int c) const {
    int const *side = e.side, *id = e.id;
    bool const one = side[0] != Entry::any && side[0] != Entry::site, two = side[1] != Entry::any;
    if (side[0] == Entry::site) {
      Transform<R> const site = base.site(w, id[0]);
      if (!inside_volume(base.volume(id[0]), base.size_of(id[0]), rotate_inverse(site.q, base.force_of.contacts.point(c) - site.p)))
        return 0;
    }
    bool const forth = (!one || is(c, 0, e, 0)) && (!two || is(c, 1, e, 1));
    if (forth) return 1;
    bool const back = (!one || is(c, 1, e, 0)) && (!two || is(c, 0, e, 1));
    return back ? -1 : 0;
  }
  /// By which contacts are sorted, the smallest first.
  KOKKOS_INLINE_FUNCTION R key(int w, Entry const& e, int k) const {
    auto const& contacts = base.force_of.contacts;
    if (e.reduce == ContactReduce::mindist) return contacts.dist(contacts.first_of(w) + k);
    if (e.reduce != ContactReduce::maxforce) return R(0);
    R f[6];
    base.force(w, k, f);
    return -(f[0] * f[0] + f[1] * f[1] + f[2] * f[2]);
  }
  /// What a slot holds; force and torque in its frame, whose rows are normal, tangent and what is left.
  struct Slot {
    R found = R(0), dist = R(0);
    R force[6] = {};
    Vec3<R> pos{R(0), R(0), R(0)}, normal{R(0), R(0), R(0)}, tangent{R(0), R(0), R(0)}, linvel{R(0), R(0), R(0)}, angvel{R(0), R(0), R(0)};
  };
  template <class Put>
  KOKKOS_INLINE_FUNCTION static void write(Entry const& e, int slot, Slot const& s, Put const& put) {
    int at = slot * e.size;
    auto const add = [&](R x) { put(at++, x); };
    auto const add3 = [&](Vec3<R> const& x) {
      for (int c = 0; c < 3; ++c) add(x[c]);
    };
    if (e.has(ContactField::found)) add(s.found);
    if (e.has(ContactField::force)) add3({s.force[0], s.force[1], s.force[2]});
    if (e.has(ContactField::torque)) add3({s.force[3], s.force[4], s.force[5]});
    if (e.has(ContactField::dist)) add(s.dist);
    if (e.has(ContactField::pos)) add3(s.pos);
    if (e.has(ContactField::normal)) add3(s.normal);
    if (e.has(ContactField::tangent)) add3(s.tangent);
    if (e.has(ContactField::linvel)) add3(s.linvel);
    if (e.has(ContactField::angvel)) add3(s.angvel);
  }
  /// Of one contact. The other way round normal and tangent are turned about the third axis: equal and opposite, its part changes sign.
  KOKKOS_INLINE_FUNCTION Slot slot_of(int w, Entry const& e, int k, bool turned, int found) const {
    auto const& contacts = base.force_of.contacts;
    int const c = contacts.first_of(w) + k;
    Slot s;
    s.found = R(found);
    s.dist = contacts.dist(c);
    s.pos = contacts.point(c);
    R const sign(turned ? -1 : 1);
    s.normal = sign * contacts.axis(c, 0);
    s.tangent = sign * contacts.axis(c, 1);
    if (e.has(ContactField::force) || e.has(ContactField::torque)) base.force(w, k, s.force);
    s.force[2] *= sign;
    s.force[5] *= sign;
    if (!e.has(ContactField::linvel) && !e.has(ContactField::angvel)) return s;
    Spatial<R> const v1 = point_velocity(trees, w, contacts.body1(c), s.pos), v2 = point_velocity(trees, w, contacts.body2(c), s.pos);
    for (int r = 0; r < 3; ++r) {
      R const side = r == 2 ? sign : R(1);
      s.linvel[r] = side * dot(contacts.axis(c, r), v2.linear - v1.linear);
      s.angvel[r] = side * dot(contacts.axis(c, r), v2.angular - v1.angular);
    }
    return s;
  }
  /// All together: force, and torque about the centre of the points, weighted by their forces; in world axes.
  KOKKOS_INLINE_FUNCTION Slot net_of(int w, Entry const& e, int found) const {
    auto const& contacts = base.force_of.contacts;
    Slot s;
    if (found == 0) return s;
    s.found = R(found);
    s.normal.x = s.tangent.y = R(1);
    Vec3<R> force{R(0), R(0), R(0)}, torque = force, place = force;
    R weight(0);
    auto const each = [&](auto const& use) {
      for (int k = 0; k < contacts.count_of(w); ++k) {
        int const c = contacts.first_of(w) + k, way = match(w, e, c);
        R f[6];
        if (way == 0) continue;
        base.force(w, k, f);
        Vec3<R> push{R(0), R(0), R(0)}, turn = push;
        for (int r = 0; r < 3; ++r) {
          push = fma(R(way) * f[r], contacts.axis(c, r), push);
          turn = fma(R(way) * f[3 + r], contacts.axis(c, r), turn);
        }
        use(contacts.point(c), push, turn);
      }
    };
    each([&](Vec3<R> const& at, Vec3<R> const& push, Vec3<R> const&) {
      R const own = norm(push);
      weight += own;
      place = fma(own, at, place);
    });
    s.pos = (R(1) / max(weight, R(1e-15))) * place;
    each([&](Vec3<R> const& at, Vec3<R> const& push, Vec3<R> const& turn) {
      force = force + push;
      torque = torque + turn + cross(at - s.pos, push);
    });
    for (int r = 0; r < 3; ++r) {
      s.force[r] = force[r];
      s.force[3 + r] = torque[r];
    }
    return s;
  }
  template <class Put>
  KOKKOS_FUNCTION void operator()(int w, int i, Put const& put) const {
    Entry const e = entries(i);
    auto const& contacts = base.force_of.contacts;
    int const n = contacts.count_of(w), begin = contacts.first_of(w);
    int found = 0;
    for (int k = 0; k < n; ++k) found += match(w, e, begin + k) != 0;
    if (e.reduce == ContactReduce::netforce) {
      write(e, 0, net_of(w, e, found), put);
      for (int slot = 1; slot < e.slots; ++slot) write(e, slot, Slot{}, put);
      return;
    }
    int last = -1;  // the contact of the slot before, and its key
    R last_key(0);
    for (int slot = 0; slot < e.slots; ++slot) {
      int best = -1, best_way = 0;
      R best_key(0);
      for (int k = 0; k < n && slot < found; ++k) {
        int const way = match(w, e, begin + k);
        if (way == 0) continue;
        R const own = key(w, e, k);
        bool const after = last < 0 || own > last_key || (own == last_key && k > last);
        if (!after || (best >= 0 && !(own < best_key))) continue;
        best = k;
        best_way = way;
        best_key = own;
      }
      write(e, slot, best < 0 ? Slot{} : slot_of(w, e, best, best_way < 0, found), put);
      if (best < 0) continue;
      last = best;
      last_key = best_key;
    }
  }
};

template <class R, class Mem>
struct LimitSensors {
  JointLimits<R, Mem> joints;
  TendonLimits<R, Mem> tendons;
  ElementImpulses<R, Mem> joint_impulses, tendon_impulses;
  TreeReader<R, Mem> trees;
  Kokkos::View<SensorEntry<R>*, Mem> entries;
  R inverse_timestep;
  int nsensordata;
  bool solved;
  int count() const { return int(entries.extent(0)); }
  KOKKOS_INLINE_FUNCTION int size() const { return 1; }
  KOKKOS_INLINE_FUNCTION int adr(int i) const { return entries(i).adr; }
  int columns() const { return nsensordata; }
  KOKKOS_INLINE_FUNCTION R limit(int i, R x) const { return cut(entries(i), x); }

  /// In place of a row: its rate J v, and J low, by which its gap is off (State::qpos_low).
  struct Rates {
    TreeReader<R, Mem> const& trees;
    int world;
    R rate = R(0), low = R(0);
    KOKKOS_INLINE_FUNCTION void set_dof(int dof, R value) {
      int const t = trees.dof_tree[dof], local = dof - trees.tree_dof[t];
      TreeItems<R> const items = trees.tree(world, t);
      rate = fma(value, items[items.at.qvel + local], rate);
      low = fma(value, items[items.at.low + local], low);
    }
  };
  template <class Limits>
  KOKKOS_INLINE_FUNCTION R value(Limits const& limits, ElementImpulses<R, Mem> const& impulses, int w, int k, int what, R margin) const {
    for (int end = 0; end < 2; ++end) {
      if (!solved || impulses.first_row(w, 2 * k + end) < 0) continue;
      if (what == 2) return impulses(w, 2 * k + end) * inverse_timestep;
      Rates rates{trees, w};
      R const gap = limits.jacobian(w, 2 * k + end, 0, rates);
      return what == 1 ? rates.rate : gap + rates.low - margin;
    }
    return R(0);
  }
  template <class Put>
  KOKKOS_FUNCTION void operator()(int w, int i, Put const& put) const {
    SensorEntry<R> const e = entries(i);
    int const k = e.object;
    if (k < 0) return put(0, R(0));
    int const first = int(SensorType::joint_limit_pos), what = int(e.type) - first;  // pos, vel, force of joints, then of tendons
    put(0, what < 3 ? value(joints, joint_impulses, w, k, what, joints.jnt_margin(w, joints.limited_joints(k)))
                    : value(tendons, tendon_impulses, w, k, what - 3, tendons.tendon_margin(w, tendons.limited_tendons(k))));
  }
};

}  // namespace gsp::detail
