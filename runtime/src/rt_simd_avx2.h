// Eight lanes and F16C. The words are explained in rt_simd_scalar.h.
#ifndef LXRT_RT_SIMD_AVX2_H
#define LXRT_RT_SIMD_AVX2_H

#include <immintrin.h>

// Per function, not per file: the runtime needs no compiler flags, and no other code of this file can end up on an older processor.
#define SIMD __attribute__((target("avx2,f16c")))

enum { lanes = 8 };
typedef __m256 vfloat;
typedef __m256i vint;

#define i_shl(a, n) _mm256_slli_epi32(a, n)
#define i_shr(a, n) _mm256_srli_epi32(a, n)
#define i_half(a) _mm256_cvtepu16_epi32(_mm256_cvtps_ph(a, _MM_FROUND_TO_NEAREST_INT))

SIMD static inline vfloat f_set1(float a) { return _mm256_set1_ps(a); }
SIMD static inline vfloat f_load(const float *p) { return _mm256_loadu_ps(p); }
SIMD static inline void f_store(float *p, vfloat a) { _mm256_storeu_ps(p, a); }
SIMD static inline vfloat f_add(vfloat a, vfloat b) { return _mm256_add_ps(a, b); }
SIMD static inline vfloat f_sub(vfloat a, vfloat b) { return _mm256_sub_ps(a, b); }
SIMD static inline vfloat f_mul(vfloat a, vfloat b) { return _mm256_mul_ps(a, b); }
SIMD static inline vfloat f_min(vfloat a, vfloat b) { return _mm256_min_ps(a, b); }
SIMD static inline vfloat f_max(vfloat a, vfloat b) { return _mm256_max_ps(a, b); }

SIMD static inline vint i_set1(int a) { return _mm256_set1_epi32(a); }
SIMD static inline vint i_load(const unsigned char *p) { return _mm256_loadu_si256((const vint *)(const void *)p); }
SIMD static inline void i_store(unsigned char *p, vint a) { _mm256_storeu_si256((vint *)(void *)p, a); }
SIMD static inline vint i_add(vint a, vint b) { return _mm256_add_epi32(a, b); }
SIMD static inline vint i_sub(vint a, vint b) { return _mm256_sub_epi32(a, b); }
SIMD static inline vint i_and(vint a, vint b) { return _mm256_and_si256(a, b); }
SIMD static inline vint i_or(vint a, vint b) { return _mm256_or_si256(a, b); }
SIMD static inline vint i_pick(vint a, vint mask, vint b) { return _mm256_or_si256(_mm256_and_si256(a, mask), b); }
SIMD static inline vint i_trunc(vfloat a) { return _mm256_cvttps_epi32(a); }
SIMD static inline vint bits_of(vfloat a) { return _mm256_castps_si256(a); }
SIMD static inline vfloat float_of(vint a) { return _mm256_castsi256_ps(a); }

// Float j of 24 is channel j % 3 of texel j / 3: the same permutation for each channel, then the channel's places are taken.
SIMD static inline void f_store_triples(unsigned char *p, vfloat r, vfloat g, vfloat b)
{
    const vint first = _mm256_setr_epi32(0, 0, 0, 1, 1, 1, 2, 2), second = _mm256_setr_epi32(2, 3, 3, 3, 4, 4, 4, 5);
    const vint third = _mm256_setr_epi32(5, 5, 6, 6, 6, 7, 7, 7);
#define TRIPLES(places, greens, blues)                                                                                              \
    bits_of(_mm256_blend_ps(_mm256_blend_ps(_mm256_permutevar8x32_ps(r, places), _mm256_permutevar8x32_ps(g, places), greens),      \
                            _mm256_permutevar8x32_ps(b, places), blues))
    i_store(p, TRIPLES(first, 0x92, 0x24));
    i_store(p + 32, TRIPLES(second, 0x24, 0x49));
    i_store(p + 64, TRIPLES(third, 0x49, 0x92));
#undef TRIPLES
}

SIMD static inline void i_store_pairs(unsigned char *p, vint a, vint b)
{
    const vint low = _mm256_unpacklo_epi32(a, b), high = _mm256_unpackhi_epi32(a, b);
    i_store(p, _mm256_permute2x128_si256(low, high, 0x20));
    i_store(p + 32, _mm256_permute2x128_si256(low, high, 0x31));
}

SIMD static inline void prefetch(const unsigned char *p)
{
    _mm_prefetch((const char *)p, _MM_HINT_T0);
}

#endif
