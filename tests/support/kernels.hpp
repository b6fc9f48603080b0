#pragma once
// Declares what gsp::kernels holds: a test that calls stages takes them from there and compiles its own types alone (docs/decisions/0009),
// in a third of the time.
#include <gsp/step/step.hpp>
