// Four lanes: what every x86-64 has. The words are explained in rt_simd_scalar.h.
#ifndef LXRT_RT_SIMD_SSE2_H
#define LXRT_RT_SIMD_SSE2_H

#include <emmintrin.h>

#define SIMD

enum { lanes = 4 };
typedef __m128 vfloat;
typedef __m128i vint;

#define i_shl(a, n) _mm_slli_epi32(a, n)
#define i_shr(a, n) _mm_srli_epi32(a, n)

static inline vfloat f_set1(float a) { return _mm_set1_ps(a); }
static inline vfloat f_load(const float *p) { return _mm_loadu_ps(p); }
static inline void f_store(float *p, vfloat a) { _mm_storeu_ps(p, a); }
static inline vfloat f_add(vfloat a, vfloat b) { return _mm_add_ps(a, b); }
static inline vfloat f_sub(vfloat a, vfloat b) { return _mm_sub_ps(a, b); }
static inline vfloat f_mul(vfloat a, vfloat b) { return _mm_mul_ps(a, b); }
static inline vfloat f_min(vfloat a, vfloat b) { return _mm_min_ps(a, b); }
static inline vfloat f_max(vfloat a, vfloat b) { return _mm_max_ps(a, b); }

static inline vint i_set1(int a) { return _mm_set1_epi32(a); }
static inline vint i_load(const unsigned char *p) { return _mm_loadu_si128((const vint *)(const void *)p); }
static inline void i_store(unsigned char *p, vint a) { _mm_storeu_si128((vint *)(void *)p, a); }
static inline vint i_add(vint a, vint b) { return _mm_add_epi32(a, b); }
static inline vint i_sub(vint a, vint b) { return _mm_sub_epi32(a, b); }
static inline vint i_and(vint a, vint b) { return _mm_and_si128(a, b); }
static inline vint i_or(vint a, vint b) { return _mm_or_si128(a, b); }
static inline vint i_pick(vint a, vint mask, vint b) { return _mm_or_si128(_mm_and_si128(a, mask), b); }
static inline vint i_less(vint a, vint b) { return _mm_cmplt_epi32(a, b); }
static inline vint i_select(vint mask, vint a, vint b) { return _mm_or_si128(_mm_and_si128(mask, a), _mm_andnot_si128(mask, b)); }
static inline vint i_trunc(vfloat a) { return _mm_cvttps_epi32(a); }
static inline vint bits_of(vfloat a) { return _mm_castps_si128(a); }
static inline vfloat float_of(vint a) { return _mm_castsi128_ps(a); }

static inline void f_store_triples(unsigned char *p, vfloat r, vfloat g, vfloat b)
{
    const __m128 rg_low = _mm_unpacklo_ps(r, g), rg_high = _mm_unpackhi_ps(r, g);
    const __m128 b0r1 = _mm_shuffle_ps(b, r, _MM_SHUFFLE(1, 1, 0, 0)), g1b1 = _mm_shuffle_ps(g, b, _MM_SHUFFLE(1, 1, 1, 1));
    const __m128 b2r3 = _mm_shuffle_ps(b, r, _MM_SHUFFLE(3, 3, 2, 2)), g3b3 = _mm_shuffle_ps(g, b, _MM_SHUFFLE(3, 3, 3, 3));
    i_store(p, bits_of(_mm_shuffle_ps(rg_low, b0r1, _MM_SHUFFLE(2, 0, 1, 0))));
    i_store(p + 16, bits_of(_mm_shuffle_ps(g1b1, rg_high, _MM_SHUFFLE(1, 0, 2, 0))));
    i_store(p + 32, bits_of(_mm_shuffle_ps(b2r3, g3b3, _MM_SHUFFLE(2, 0, 2, 0))));
}

static inline void i_store_pairs(unsigned char *p, vint a, vint b)
{
    i_store(p, _mm_unpacklo_epi32(a, b));
    i_store(p + 16, _mm_unpackhi_epi32(a, b));
}

static inline void prefetch(const unsigned char *p)
{
    _mm_prefetch((const char *)p, _MM_HINT_T0);
}

#endif
