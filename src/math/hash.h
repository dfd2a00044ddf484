/// Integer hashes: the only source of randomness, so that every number is a function of its indices.
#ifndef LX_MATH_HASH_H
#define LX_MATH_HASH_H

#include <stddef.h>
#include <stdint.h>

/// Finaliser of good avalanche ("lowbias32", Wellons 2018).
static inline uint32_t lx_hash32(uint32_t x)
{
    x ^= x >> 16;
    x *= 0x7feb352du;
    x ^= x >> 15;
    x *= 0x846ca68bu;
    x ^= x >> 16;
    return x;
}

static inline uint32_t lx_hash_combine(uint32_t a, uint32_t b)
{
    return lx_hash32(a ^ (b + 0x9e3779b9u + (a << 6) + (a >> 2)));
}

/// SplitMix64's finaliser.
static inline uint64_t lx_hash64(uint64_t x)
{
    x ^= x >> 30;
    x *= 0xbf58476d1ce4e5b9u;
    x ^= x >> 27;
    x *= 0x94d049bb133111ebu;
    return x ^ (x >> 31);
}

/// FNV-1a over bytes, continued from `hash` (start with 0xcbf29ce484222325).
static inline uint64_t lx_hash_bytes(uint64_t hash, const void *data, size_t size)
{
    const unsigned char *bytes = data;
    for (size_t i = 0; i < size; ++i) hash = (hash ^ bytes[i]) * 0x100000001b3u;
    return hash;
}

/// 24 bits to [0, 1).
static inline float lx_unit_float(uint32_t bits)
{
    return (float)(bits >> 8) * 0x1p-24f;
}

#endif
