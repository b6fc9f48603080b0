#pragma once

/// The bytes of a pack (math/pack.hpp), by the instruction set that a file is compiled for, and the inline namespace of all that depends on
/// it: packs, and what lays its memory out by their width (Dynamics, Solution, Simulation). So functions that take one of these have other
/// symbols at another width, and files and libraries of different widths can stand in one program.
#if defined(__AVX512F__)
#define GSP_PACK_BYTES 64
#define GSP_PACK_NAMESPACE pack512
#elif defined(__AVX2__)
#define GSP_PACK_BYTES 32
#define GSP_PACK_NAMESPACE pack256
#else
#define GSP_PACK_BYTES 16
#define GSP_PACK_NAMESPACE pack128
#endif
