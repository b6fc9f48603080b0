#pragma once
#include <gsp/constraint/detail/write_contact_forces.hpp>

/// Kernels of gsp/sensor/body_contacts.hpp, where the contract stands.
namespace gsp::detail {

template <class R, class Mem, class Of>
struct SumBodyContacts {
  ContactForce<R, Mem> force_of;
  Of of;
  bool solved;
  KOKKOS_FUNCTION void operator()(int item) const {
    int const n = int(of.bodies.extent(0)), w = item / n, i = item % n, body = of.bodies(i), partners = int(of.partners.extent(0));
    auto const& contacts = force_of.contacts;
    Vec3<R> const zero{R(0), R(0), R(0)};
    Vec3<R> force = zero, friction = zero, place = zero;
    R load(0);
    int found = 0;
    for (int p = 0; p < partners; ++p)
      for (int k = 0; k < 3; ++k) of.force_matrix(w, i, p, k) = R(0);
    for (int k = 0; k < contacts.count_of(w); ++k) {
      int const c = contacts.first_of(w) + k, body1 = contacts.body1(c), body2 = contacts.body2(c);
      if (body1 != body && body2 != body) continue;
      ++found;
      R f[6];
      if (!solved || !force_of(w, k, f)) continue;
      R const side(body2 == body ? 1 : -1);
      Vec3<R> const along = (side * f[0]) * contacts.axis(c, 0);
      Vec3<R> const across = fma(side * f[1], contacts.axis(c, 1), (side * f[2]) * contacts.axis(c, 2));
      Vec3<R> const push = along + across;
      R const own = norm(push);
      force = force + push;
      friction = friction + across;
      load += own;
      place = fma(own, contacts.point(c), place);
      int const other = body2 == body ? body1 : body2;
      for (int p = 0; p < partners; ++p)
        if (of.partners(p) == other)
          for (int j = 0; j < 3; ++j) of.force_matrix(w, i, p, j) += push[j];
    }
    R const weight = load > R(0) ? R(1) / load : R(0);
    for (int k = 0; k < 3; ++k) {
      of.force(w, i, k) = force[k];
      of.friction(w, i, k) = friction[k];
      of.position(w, i, k) = weight * place[k];
    }
    of.found(w, i) = found;
    of.load(w, i) = load;
  }
};

template <class R, class Mem, class Of>
struct CountContactTimes {
  Kokkos::View<std::uint32_t*, Kokkos::LayoutRight, Mem> status;
  Of of;
  R dt;
  KOKKOS_FUNCTION void operator()(int item) const {
    int const n = int(of.bodies.extent(0)), w = item / n, i = item % n;
    if (status(w) & status::stopped) return;
    bool const touches = of.load(w, i) > of.threshold;
    R& begun = touches ? of.contact_time(w, i) : of.air_time(w, i);
    R& ended = touches ? of.air_time(w, i) : of.contact_time(w, i);
    R& last = touches ? of.last_air_time(w, i) : of.last_contact_time(w, i);
    if (ended > R(0)) last = ended;
    ended = R(0);
    begun += dt;
    for (int h = int(of.force_history.extent(1)); h-- > 0;)
      for (int k = 0; k < 3; ++k) of.force_history(w, h, i, k) = h > 0 ? of.force_history(w, h - 1, i, k) : of.force(w, i, k);
  }
};

template <class Of, class Mask>
struct ResetBodyContacts {
  Of of;
  Mask mask;
  KOKKOS_FUNCTION void operator()(int item) const {
    int const n = int(of.bodies.extent(0)), w = item / n, i = item % n;
    if (!mask(w)) return;
    for (int k = 0; k < 3; ++k) {
      of.force(w, i, k) = 0;
      of.friction(w, i, k) = 0;
      of.position(w, i, k) = 0;
      for (int p = 0; p < int(of.partners.extent(0)); ++p) of.force_matrix(w, i, p, k) = 0;
      for (int h = 0; h < int(of.force_history.extent(1)); ++h) of.force_history(w, h, i, k) = 0;
    }
    of.found(w, i) = 0;
    of.load(w, i) = 0;
    of.air_time(w, i) = 0;
    of.contact_time(w, i) = 0;
    of.last_air_time(w, i) = 0;
    of.last_contact_time(w, i) = 0;
  }
};

}  // namespace gsp::detail
