#pragma once
// A fuzz target is one file with one call: FUZZ(bytes) { parse(bytes); }. It survives when `parse` returns, or throws gsp::Error with one
// line of text; whatever else happens (a crash, a leak, another exception, too much memory) is a finding.
#include <cstdint>
#include <cstdlib>
#include <gsp/io/detail/bytes.hpp>
#include <string>

namespace gsp_fuzz {
template <class F>
void survive(F const& f) {
  try {
    f();
  } catch (gsp::Error const& e) {
    std::string const text = e.what();
    if (text.size() < 10 || text.find('\n') != text.npos) std::abort();  // not a sentence
  }
}
inline void require(bool condition) {
  if (!condition) std::abort();
}
}  // namespace gsp_fuzz
