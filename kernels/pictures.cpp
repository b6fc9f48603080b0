#include <gsp/splat/render.hpp>

GSP_PICTURE_KERNELS(template, Kokkos::DefaultHostExecutionSpace, Kokkos::HostSpace)
GSP_PICTURE_KERNELS_OF_POSES(template, Kokkos::DefaultHostExecutionSpace, Kokkos::HostSpace, float)
GSP_PICTURE_KERNELS_OF_POSES(template, Kokkos::DefaultHostExecutionSpace, Kokkos::HostSpace, double)
