#pragma once
#include <gsp/math/vec3.hpp>
#include <gsp/splat/detail/lanes.hpp>

namespace gsp::detail {

/// add(k, Y_k(d)) for each of the (degree + 1)^2 terms; d unit (of degree 0 any). Basis and signs are those of 3DGS files (real spherical
/// harmonics of degree 0-3).
template <class T, class Add>
KOKKOS_INLINE_FUNCTION void each_sh_term(int degree, Vec3<T> const& d, Add const& add) {
  add(0, T(0.28209479177387814f));
  if (degree > 0) {
    T const x = d.x, y = d.y, z = d.z;
    add(1, -0.48860251190291992f * y);
    add(2, 0.48860251190291992f * z);
    add(3, -0.48860251190291992f * x);
    if (degree > 1) {
      T const xx = x * x, yy = y * y, zz = z * z, xy = x * y;
      add(4, 1.0925484305920792f * xy);
      add(5, -1.0925484305920792f * (y * z));
      add(6, fma(T(0.94617469575756f), zz, T(-0.31539156525252f)));
      add(7, -1.0925484305920792f * (x * z));
      add(8, 0.5462742152960396f * (xx - yy));
      if (degree > 2) {
        add(9, -0.5900435899266435f * y * fma(T(3.f), xx, -yy));
        add(10, 2.890611442640554f * xy * z);
        add(11, -0.4570457994644658f * y * fma(T(5.f), zz, T(-1.f)));
        add(12, 0.3731763325901154f * z * fma(T(5.f), zz, T(-3.f)));
        add(13, -0.4570457994644658f * x * fma(T(5.f), zz, T(-1.f)));
        add(14, 1.445305721320277f * z * (xx - yy));
        add(15, -0.5900435899266435f * x * fma(T(-3.f), yy, xx));
      }
    }
  }
}

/// max(0, 1/2 + sum_k c_k Y_k(d)) of one Gaussian (or a pack of neighbours, from i on); d unit, in the frame that the coefficients stand
/// in. `sh` is (3 K, n): row 3 k + channel.
template <class T, class View>
KOKKOS_INLINE_FUNCTION Vec3<T> sh_colour(View const& sh, int degree, int i, Vec3<T> const& d) {
  Vec3<T> c{T(0.5f), T(0.5f), T(0.5f)};
  each_sh_term(degree, d, [&](int k, T const& y) {
    c.x = fma(y, Lanes<T>::load(sh, 3 * k, i), c.x);
    c.y = fma(y, Lanes<T>::load(sh, 3 * k + 1, i), c.y);
    c.z = fma(y, Lanes<T>::load(sh, 3 * k + 2, i), c.z);
  });
  T const zero(0.f);
  return {max(c.x, zero), max(c.y, zero), max(c.z, zero)};
}

}  // namespace gsp::detail
