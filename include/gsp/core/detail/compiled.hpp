#pragma once

/// Functions of the host that no template parameter needs (readers, writers, gsp::compile) are declared in their public header and defined
/// in detail/*_impl.hpp. A target that links gsp::io gets GSP_COMPILED and finds them in its library; all others are header-only: the
/// public header includes the definitions at its end (docs/decisions/0005-readers-are-compiled-once.md).
#if defined(GSP_COMPILED)
#define GSP_INLINE
#else
#define GSP_INLINE inline
#endif
