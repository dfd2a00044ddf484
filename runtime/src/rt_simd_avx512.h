// Sixteen lanes: AVX-512F alone. The words are explained in rt_simd_scalar.h.
#ifndef LXRT_RT_SIMD_AVX512_H
#define LXRT_RT_SIMD_AVX512_H

#include <immintrin.h>

#define SIMD __attribute__((target("avx512f")))

enum { lanes = 16 };
typedef __m512 vfloat;
typedef __m512i vint;

#define i_shl(a, n) _mm512_slli_epi32(a, n)
#define i_shr(a, n) _mm512_srli_epi32(a, n)
#define i_half(a) _mm512_cvtepu16_epi32(_mm512_cvtps_ph(a, _MM_FROUND_TO_NEAREST_INT))

SIMD static inline vfloat f_set1(float a) { return _mm512_set1_ps(a); }
SIMD static inline vfloat f_load(const float *p) { return _mm512_loadu_ps(p); }
SIMD static inline void f_store(float *p, vfloat a) { _mm512_storeu_ps(p, a); }
SIMD static inline vfloat f_add(vfloat a, vfloat b) { return _mm512_add_ps(a, b); }
SIMD static inline vfloat f_sub(vfloat a, vfloat b) { return _mm512_sub_ps(a, b); }
SIMD static inline vfloat f_mul(vfloat a, vfloat b) { return _mm512_mul_ps(a, b); }
SIMD static inline vfloat f_min(vfloat a, vfloat b) { return _mm512_min_ps(a, b); }
SIMD static inline vfloat f_max(vfloat a, vfloat b) { return _mm512_max_ps(a, b); }

SIMD static inline vint i_set1(int a) { return _mm512_set1_epi32(a); }
SIMD static inline vint i_load(const unsigned char *p) { return _mm512_loadu_si512((const void *)p); }
SIMD static inline void i_store(unsigned char *p, vint a) { _mm512_storeu_si512((void *)p, a); }
SIMD static inline vint i_add(vint a, vint b) { return _mm512_add_epi32(a, b); }
SIMD static inline vint i_sub(vint a, vint b) { return _mm512_sub_epi32(a, b); }
SIMD static inline vint i_and(vint a, vint b) { return _mm512_and_si512(a, b); }
SIMD static inline vint i_or(vint a, vint b) { return _mm512_or_si512(a, b); }
SIMD static inline vint i_pick(vint a, vint mask, vint b) { return _mm512_ternarylogic_epi32(a, mask, b, 0xea); }
SIMD static inline vint i_trunc(vfloat a) { return _mm512_cvttps_epi32(a); }
SIMD static inline vint bits_of(vfloat a) { return _mm512_castps_si512(a); }
SIMD static inline vfloat float_of(vint a) { return _mm512_castsi512_ps(a); }

// Float j of 48 is channel j % 3 of texel j / 3; 16 more means green where two channels are permuted at once.
SIMD static inline void f_store_triples(unsigned char *p, vfloat r, vfloat g, vfloat b)
{
    const vint first = _mm512_setr_epi32(0, 16, 0, 1, 17, 1, 2, 18, 2, 3, 19, 3, 4, 20, 4, 5);
    const vint second = _mm512_setr_epi32(21, 5, 6, 22, 6, 7, 23, 7, 8, 24, 8, 9, 25, 9, 10, 26);
    const vint third = _mm512_setr_epi32(10, 11, 27, 11, 12, 28, 12, 13, 29, 13, 14, 30, 14, 15, 31, 15);
    i_store(p, bits_of(_mm512_mask_permutexvar_ps(_mm512_permutex2var_ps(r, first, g), 0x4924, first, b)));
    i_store(p + 64, bits_of(_mm512_mask_permutexvar_ps(_mm512_permutex2var_ps(r, second, g), 0x2492, second, b)));
    i_store(p + 128, bits_of(_mm512_mask_permutexvar_ps(_mm512_permutex2var_ps(r, third, g), 0x9249, third, b)));
}

SIMD static inline void i_store_pairs(unsigned char *p, vint a, vint b)
{
    const vint low = _mm512_setr_epi32(0, 16, 1, 17, 2, 18, 3, 19, 4, 20, 5, 21, 6, 22, 7, 23);
    const vint high = _mm512_setr_epi32(8, 24, 9, 25, 10, 26, 11, 27, 12, 28, 13, 29, 14, 30, 15, 31);
    i_store(p, _mm512_permutex2var_epi32(a, low, b));
    i_store(p + 64, _mm512_permutex2var_epi32(a, high, b));
}

SIMD static inline void prefetch(const unsigned char *p)
{
    _mm_prefetch((const char *)p, _MM_HINT_T0);
}

#endif
