/// Low-discrepancy points: Owen-scrambled Sobol pairs, decorrelated by hashing.
///
/// Based on: [Burley2020] Brent Burley, "Practical Hash-based Owen Scrambling", JCGT 9(4), 2020; the (0,2)-sequence of
/// its first two dimensions, nested-uniformly scrambled, with the sample order shuffled per key ("padding").
#ifndef LX_MATH_SOBOL_H
#define LX_MATH_SOBOL_H

#include "math/hash.h"
#include "math/vec.h"

static inline uint32_t lx_reverse_bits(uint32_t x)
{
    x = (x << 16) | (x >> 16);
    x = ((x & 0x00ff00ffu) << 8) | ((x & 0xff00ff00u) >> 8);
    x = ((x & 0x0f0f0f0fu) << 4) | ((x & 0xf0f0f0f0u) >> 4);
    x = ((x & 0x33333333u) << 2) | ((x & 0xccccccccu) >> 2);
    return ((x & 0x55555555u) << 1) | ((x & 0xaaaaaaaau) >> 1);
}

/// Laine-Karras style permutation on reversed bits, with Vegdahl's improved constants (cited in [Burley2020] follow-ups).
static inline uint32_t lx_owen_reversed(uint32_t x, uint32_t seed)
{
    x ^= x * 0x3d20adeau;
    x += seed;
    x *= (seed >> 16) | 1u;
    x ^= x * 0x05526c56u;
    x ^= x * 0x53a22864u;
    return x;
}

static inline uint32_t lx_owen_scramble(uint32_t x, uint32_t seed)
{
    return lx_reverse_bits(lx_owen_reversed(lx_reverse_bits(x), seed));
}

/// Bits of the second Sobol dimension, lowest first (the first dimension is the index itself): the index times Pascal's triangle
/// modulo 2, which is a Kronecker power of (1 1; 0 1) (Lucas' theorem) and so takes one step per level, not one per bit.
static inline uint32_t lx_sobol_second_reversed(uint32_t index)
{
    index ^= (index >> 1) & 0x55555555u;
    index ^= (index >> 2) & 0x33333333u;
    index ^= (index >> 4) & 0x0f0f0f0fu;
    index ^= (index >> 8) & 0x00ff00ffu;
    index ^= (index >> 16) & 0x0000ffffu;
    return index;
}

/// Point `index` of the stream `key`, in [0,1)². Different keys give independent streams; within a key the first 2^k points
/// are a (0,k,2)-net, so stratified in every way.
static inline lx_vec2 lx_sobol_pair(uint32_t index, uint32_t key)
{
    // Scrambling works on reversed digits, which is how both dimensions arrive: each needs one reversal, at the end.
    const uint32_t shuffled = lx_owen_scramble(index, lx_hash32(key));
    const uint32_t x = lx_owen_reversed(shuffled, lx_hash32(key ^ 0x5bd1e995u));
    const uint32_t y = lx_owen_reversed(lx_sobol_second_reversed(shuffled), lx_hash32(key ^ 0x1b873593u));
    return (lx_vec2){lx_unit_float(lx_reverse_bits(x)), lx_unit_float(lx_reverse_bits(y))};
}

/// One-dimensional version: the scrambled van der Corput sequence.
static inline float lx_sobol_one(uint32_t index, uint32_t key)
{
    const uint32_t shuffled = lx_owen_scramble(index, lx_hash32(key));
    return lx_unit_float(lx_reverse_bits(lx_owen_reversed(shuffled, lx_hash32(key ^ 0x5bd1e995u))));
}

#endif
