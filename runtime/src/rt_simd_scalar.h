// One lane of plain C: the twin that the wide kernels are held against, and what processors without one of their own run. The words
// mean the same in every rt_simd_*.h: f_ is for floats, i_ for 32-bit integers (sums wrap), `pick` is (a & mask) | b, `trunc` is
// defined for 0 … 2^31, and stores go to any address.
#ifndef LXRT_RT_SIMD_SCALAR_H
#define LXRT_RT_SIMD_SCALAR_H

#include "rt_pack.h"

#define SIMD

enum { lanes = 1 };
typedef float vfloat;
typedef uint32_t vint;

#define i_shl(a, n) ((a) << (n))
#define i_shr(a, n) ((a) >> (n))

static inline vfloat f_set1(float a) { return a; }
static inline vfloat f_load(const float *p) { return *p; }
static inline void f_store(float *p, vfloat a) { *p = a; }
static inline vfloat f_add(vfloat a, vfloat b) { return a + b; }
static inline vfloat f_sub(vfloat a, vfloat b) { return a - b; }
static inline vfloat f_mul(vfloat a, vfloat b) { return a * b; }
static inline vfloat f_min(vfloat a, vfloat b) { return a < b ? a : b; }
static inline vfloat f_max(vfloat a, vfloat b) { return a > b ? a : b; }

static inline vint i_set1(int32_t a) { return (uint32_t)a; }
static inline vint i_load(const unsigned char *p) { return lxrt_load_u32(p); }
static inline vint i_add(vint a, vint b) { return a + b; }
static inline vint i_sub(vint a, vint b) { return a - b; }
static inline vint i_and(vint a, vint b) { return a & b; }
static inline vint i_or(vint a, vint b) { return a | b; }
static inline vint i_pick(vint a, vint mask, vint b) { return (a & mask) | b; }
static inline vint i_less(vint a, vint b) { return (int32_t)a < (int32_t)b ? UINT32_MAX : 0; }
static inline vint i_select(vint mask, vint a, vint b) { return mask ? a : b; }
static inline vint i_trunc(vfloat a) { return (uint32_t)(int32_t)a; }

static inline vint bits_of(vfloat a)
{
    vint bits;
    memcpy(&bits, &a, sizeof bits);
    return bits;
}

static inline vfloat float_of(vint a)
{
    vfloat value;
    memcpy(&value, &a, sizeof value);
    return value;
}

static inline void i_store(unsigned char *p, vint a)
{
    memcpy(p, &a, sizeof a);
}

// r g b, r g b, …
static inline void f_store_triples(unsigned char *p, vfloat r, vfloat g, vfloat b)
{
    memcpy(p, &r, 4);
    memcpy(p + 4, &g, 4);
    memcpy(p + 8, &b, 4);
}

// a b, a b, … ; each is two halves, the first in the low bits
static inline void i_store_pairs(unsigned char *p, vint a, vint b)
{
    const uint16_t halves[4] = {(uint16_t)a, (uint16_t)(a >> 16), (uint16_t)b, (uint16_t)(b >> 16)};
    memcpy(p, halves, sizeof halves);
}

static inline void prefetch(const unsigned char *p)
{
    (void)p;
}

#endif
