// The kernel for x86-64 with AVX-512BW.
#include "rt_pixels.h"

#if defined(__x86_64__)
#include <immintrin.h>

#define SIMD __attribute__((target("avx512bw")))

enum { width = 64, granule = 8, excess = 16 };
typedef __m512i vbytes;

#define v_splat(a) _mm512_set1_epi8(a)
#define v_lookup(table, index) _mm512_shuffle_epi8(table, index)
// 0x70 more, no further than 0xff, gives all but the first 16 the highest bit, for which the instruction says 0; else it reads the low four.
#define v_lookup_first(table, index) _mm512_shuffle_epi8(table, _mm512_adds_epu8(index, v_splat(0x70)))
#define v_shift4(a) _mm512_srli_epi16(a, 4)
#define v_and(a, b) _mm512_and_si512(a, b)
#define v_add8(a, b) _mm512_add_epi8(a, b)
#define v_add16(a, b) _mm512_add_epi16(a, b)
#define v_sub16(a, b) _mm512_sub_epi16(a, b)
#define v_add32(a, b) _mm512_add_epi32(a, b)
#define v_dot8(a, b) _mm512_maddubs_epi16(a, b)
#define v_dot16(a) _mm512_madd_epi16(a, _mm512_set1_epi16(1))
#define v_sum8(a) _mm512_sad_epu8(a, _mm512_setzero_si512())
#define v_low32(a, b) _mm512_unpacklo_epi32(a, b)
#define v_high32(a, b) _mm512_unpackhi_epi32(a, b)
#define v_low64(a, b) _mm512_unpacklo_epi64(a, b)
#define v_prefetch(p) _mm_prefetch((const char *)(p), _MM_HINT_T0)

SIMD static inline vbytes v_table(const uint8_t bytes[16])
{
    return _mm512_broadcast_i32x4(_mm_loadu_si128((const __m128i *)(const void *)bytes));
}

SIMD static inline vbytes v_order4(vbytes pixels)
{
    const __m128i by_channel = _mm_setr_epi8(0, 4, 8, 12, 1, 5, 9, 13, 2, 6, 10, 14, -1, -1, -1, -1);
    return _mm512_shuffle_epi8(pixels, _mm512_broadcast_i32x4(by_channel));
}

SIMD static inline vbytes v_order3(vbytes pixels)
{
    const __m128i by_channel = _mm_setr_epi8(0, 3, 6, 9, 1, 4, 7, 10, 2, 5, 8, 11, -1, -1, -1, -1);
    const vbytes lanes = _mm512_setr_epi32(0, 1, 2, 2, 3, 4, 5, 5, 6, 7, 8, 8, 9, 10, 11, 11); // 12 bytes each
    return _mm512_shuffle_epi8(_mm512_permutexvar_epi32(lanes, pixels), _mm512_broadcast_i32x4(by_channel));
}

SIMD static inline vbytes v_whole(const unsigned char *p)
{
    return _mm512_loadu_si512((const void *)p);
}

// Halves are loads of their own: masked ones took ten times as long where they met rows that were not in the cache.
SIMD static inline vbytes v_half(const unsigned char *p, uint32_t bytes)
{
    const __m256i half = _mm256_loadu_si256((const __m256i *)(const void *)p);
    return _mm512_maskz_mov_epi8(((__mmask64)1 << bytes) - 1, _mm512_castsi256_si512(half));
}

#define v_load4(p) v_order4(v_whole(p))
#define v_load3(p) v_order3(v_whole(p))
#define v_part4(p, count) ((count) >= 16 ? v_load4(p) : (count) >= 8 ? v_order4(v_half(p, 32)) : v_splat(0))
#define v_part3(p, count) ((count) >= 16 ? v_load3(p) : (count) >= 8 ? v_order3(v_half(p, 24)) : v_splat(0))

SIMD static inline void v_store(int32_t *out, vbytes v)
{
    _mm512_storeu_si512((void *)out, v);
}

#define KERNEL lxrt_sum_pixels_avx512
#include "rt_pixels_loop.h"
#endif
