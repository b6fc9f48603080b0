#pragma once
#include <gsp/constraint/constraint_type.hpp>
#include <gsp/constraint/impulses.hpp>

/// What the impulses of an element begin from: those of the last step, by identity or by place.
namespace gsp::detail {

KOKKOS_INLINE_FUNCTION std::uint64_t row_key(int type, RowId id) {
  return (std::uint64_t(type) << 59) | (std::uint64_t(id.major) << 32) | id.minor;
}

template <class R, class Mem>
struct StartImpulses {
  Impulses<R, Mem> const& impulses;
  TypeNames const& names;
  /// Where an element acts and how its friction lies, for the next step.
  template <class Type>
  KOKKOS_INLINE_FUNCTION void mark_place(Type const& type, int w, int k, int n, int first) const {
    auto const mark = [&](int row, Vec3<R> const& v) {
      for (int c = 0; c < 3; ++c) impulses.place[impulses.parity()](row, c) = v[c];
    };
    if constexpr (requires { type.place(w, k); }) mark(first, type.place(w, k));
    if constexpr (requires { type.tangent(w, k, 0); })
      if (n >= 3 && turns(type)) mark(first + 1, type.tangent(w, k, 0));
  }
  /// Whether rows 1 and 2 are friction along the tangents.
  template <class Type>
  KOKKOS_INLINE_FUNCTION static bool turns(Type const& type) {
    if constexpr (requires { type.turns(); })
      return type.turns();
    else
      return true;
  }
  /// Impulses along and about the first tangent t of the last step and the normal cross t become those of this step's tangents: turned by
  /// the angle from these to t.
  template <class Type>
  KOKKOS_INLINE_FUNCTION static void turn(Type const& type, int w, int k, int n, Vec3<R> const& t, R* p) {
    Vec3<R> const first = type.tangent(w, k, 0);
    if (t.x == first.x && t.y == first.y && t.z == first.z) return;  // the usual case keeps its bits
    R const x = dot(t, first), y = dot(t, type.tangent(w, k, 1)), length = sqrt(fma(x, x, y * y));
    if (!(length > R(0))) return;
    R const c = x / length, s = y / length;
    for (int r = 1; r + 1 < n; r += 3) {
      R const along = p[r];
      p[r] = fma(c, along, -s * p[r + 1]);
      p[r + 1] = fma(s, along, c * p[r + 1]);
    }
  }
  /// Adds the impulses that the element had in the last step to `start`: those of its identity; or, where it had none and the type says
  /// where its elements act, of all elements of the same major identity that are gone and to which it is the nearest of the new ones.
  /// @param at  its first row, counted from the world's: where it is likely to have been
  /// @return    what the elements of its major identity carried on average
  template <class Type>
  KOKKOS_INLINE_FUNCTION R find(Type const& type, int k, int place, RowId id, int w, int at, int n, R* start) const {
    int const before = 1 - impulses.parity();
    int known = impulses.type_names(place, before) == names.name[place] ? place : 0;  // all names differ
    for (; impulses.type_names(known, before) != names.name[place]; ++known)
      if (impulses.type_names(known, before) == 0) return R(0);
    auto const& ids = impulses.id[before];
    std::uint64_t const key = row_key(known, id), major = key >> 32;
    int const first = impulses.first[before](w);
    int low = first, end = first + impulses.count[before](w);
    auto const is_of_major = [&](int row) { return (ids(row) >> 32) == major; };
    auto const search = [&] {
      for (int high = end; low < high;) {  // identities are sorted but for the minor part
        int const middle = low + (high - low) / 2;
        if ((ids(middle) >> 32) < major)
          low = middle + 1;
        else
          high = middle;
      }
    };
    int const guess = first + at;
    if (guess < end && is_of_major(guess)) {
      for (low = guess; low > first && is_of_major(low - 1);) --low;
    } else {
      search();
    }
    if (!(low < end && is_of_major(low)) && impulses.kept[before](w) > 0) {  // all of a major identity sleep, or none
      low = end;
      end += impulses.kept[before](w);
      search();
    }
    auto const add = [&](int row) {
      std::uint64_t const old = ids(row);
      R p[most_element_rows];
      int had = 0;
      for (; had < n && row + had < end && ids(row + had) == old; ++had) p[had] = impulses.p[before](row + had);
      if constexpr (requires { type.tangent(w, k, 0); }) {
        auto const& t = impulses.place[before];
        if (had >= 3 && turns(type)) turn(type, w, k, had, {t(row + 1, 0), t(row + 1, 1), t(row + 1, 2)}, p);
      }
      for (int r = 0; r < had; ++r) start[r] += p[r];
    };
    R load(0);
    int old = 0, same = -1;  // elements that there were, the row of this one
    for (int row = low; row < end && is_of_major(row); ++row) {
      if (row > low && ids(row) == ids(row - 1)) continue;
      load += abs(impulses.p[before](row));
      ++old;
      if (ids(row) == key) same = row;
    }
    if (old > 0) load = load / R(old);
    if (same >= 0) {
      add(same);
      return load;
    }
    if constexpr (requires { type.place(w, k); }) {
      int from = k, to = k + 1;
      int const elements = int(type.count(w));
      while (from > 0 && type.id(w, from - 1).major == id.major) --from;
      while (to < elements && type.id(w, to).major == id.major) ++to;
      auto const was_there = [&](std::uint32_t minor) {
        for (int row = low; row < end && is_of_major(row); ++row)
          if (std::uint32_t(ids(row)) == minor) return true;
        return false;
      };
      for (int row = low; row < end && is_of_major(row); ++row) {
        if (row > low && ids(row) == ids(row - 1)) continue;
        bool gone = true;
        for (int e = from; e < to; ++e) gone = gone && !(type.rows(w, e) > 0 && type.id(w, e).minor == std::uint32_t(ids(row)));
        if (!gone) continue;
        Vec3<R> const at{impulses.place[before](row, 0), impulses.place[before](row, 1), impulses.place[before](row, 2)};
        R const distance = norm(type.place(w, k) - at);
        bool nearest = true;
        for (int e = from; e < to; ++e) {
          if (e == k || type.rows(w, e) == 0) continue;
          R const other = norm(type.place(w, e) - at);
          if (other < distance || (other == distance && e < k)) nearest = nearest && was_there(type.id(w, e).minor);
        }
        if (nearest) add(row);
      }
    }
    return load;
  }
};

}  // namespace gsp::detail
