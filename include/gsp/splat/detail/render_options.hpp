#pragma once

namespace gsp {

/// Constants of the picture; the defaults are those of gsplat 1.5.3.
struct RenderOptions {
  float near = 0.01f, far = 1e10f;  // camera z outside is not seen [m]
  float blur = 0.3f;                // added to both variances of a splat [pixel^2]
  float alpha_max = 0.999f;         // an alpha is at most this
  float stop = 1e-4f;               // a pixel is done before the Gaussian that would leave no more light than this
};

}  // namespace gsp
