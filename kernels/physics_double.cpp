#include <gsp/step/step.hpp>

GSP_PHYSICS_KERNELS(template, Kokkos::DefaultHostExecutionSpace, Kokkos::HostSpace, double)
