#pragma once
#include <gsp/collision/shapes.hpp>

/// The plane of a patch. Points of two bodies with one normal lie midway between the surfaces, each at a height of its own: half of what it
/// overlaps more than the others. Friction at these heights would stop turning about the tangents with a lever of that little length, by
/// impulses beyond all measure, and sweeps would build them up without end (decision 27). In one plane it has no such lever.
namespace gsp::detail {

inline constexpr int most_patch_points = 64;  // either way in the list, so that the search stays linear

/// Contacts::lift of each contact: to the height of the deepest of its patch.
template <class ContactsType>
struct LevelContacts {
  using R = typename ContactsType::real_type;
  ContactsType contacts;
  KOKKOS_FUNCTION void operator()(std::int64_t item) const {
    int const size = contacts.size(), c = int(item);
    if (c >= size) return;
    Vec3<R> const normal = contacts.axis(c, 0), point = contacts.point(c);
    R deepest = contacts.dist(c), lift(0);
    auto const look = [&](int o) {
      R const dist = contacts.dist(o);
      if (!(dist < deepest) || !(dot(contacts.axis(o, 0), normal) > R(1 - 1e-5))) return;
      R const height = dot(contacts.point(o) - point, normal);      // of two flat sides half of the difference in dist
      if (abs(height) > abs(dist) + abs(contacts.dist(c))) return;  // on another step of stairs
      deepest = dist;
      lift = height;
    };
    for (int o = c + 1; o < size && o <= c + most_patch_points && of_one_patch(o, c); ++o) look(o);
    for (int o = c - 1; o >= 0 && o >= c - most_patch_points && of_one_patch(o, c); --o) look(o);
    contacts.lift(c) = lift;
  }

 private:
  KOKKOS_INLINE_FUNCTION bool of_one_patch(int a, int b) const {
    return contacts.world(a) == contacts.world(b) && contacts.body1(a) == contacts.body1(b) && contacts.body2(a) == contacts.body2(b);
  }
};

}  // namespace gsp::detail
