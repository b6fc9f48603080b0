#include <gsp/step/step.hpp>

GSP_HOST_KERNELS(GSP_PHYSICS_KERNELS, template, float)
