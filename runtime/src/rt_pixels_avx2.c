// The kernel for x86-64 with AVX2.
#include "rt_pixels.h"

#if defined(__x86_64__)
#include <immintrin.h>

#define SIMD __attribute__((target("avx2")))

enum { width = 32, granule = width / 4, excess = 4 };
typedef __m256i vbytes;

#define v_splat(a) _mm256_set1_epi8(a)
#define v_lookup(table, index) _mm256_shuffle_epi8(table, index)
// 0x70 more, no further than 0xff, gives all but the first 16 the highest bit, for which the instruction says 0; else it reads the low four.
#define v_lookup_first(table, index) _mm256_shuffle_epi8(table, _mm256_adds_epu8(index, v_splat(0x70)))
#define v_shift4(a) _mm256_srli_epi16(a, 4)
#define v_and(a, b) _mm256_and_si256(a, b)
#define v_add8(a, b) _mm256_add_epi8(a, b)
#define v_add16(a, b) _mm256_add_epi16(a, b)
#define v_sub16(a, b) _mm256_sub_epi16(a, b)
#define v_add32(a, b) _mm256_add_epi32(a, b)
#define v_dot8(a, b) _mm256_maddubs_epi16(a, b)
#define v_dot16(a) _mm256_madd_epi16(a, _mm256_set1_epi16(1))
#define v_sum8(a) _mm256_sad_epu8(a, _mm256_setzero_si256())
#define v_low32(a, b) _mm256_unpacklo_epi32(a, b)
#define v_high32(a, b) _mm256_unpackhi_epi32(a, b)
#define v_low64(a, b) _mm256_unpacklo_epi64(a, b)
#define v_prefetch(p) _mm_prefetch((const char *)(p), _MM_HINT_T0)

SIMD static inline vbytes v_table(const uint8_t bytes[16])
{
    return _mm256_broadcastsi128_si256(_mm_loadu_si128((const __m128i *)(const void *)bytes));
}

SIMD static inline vbytes v_load4(const unsigned char *p)
{
    const __m128i by_channel = _mm_setr_epi8(0, 4, 8, 12, 1, 5, 9, 13, 2, 6, 10, 14, -1, -1, -1, -1);
    return _mm256_shuffle_epi8(_mm256_loadu_si256((const vbytes *)(const void *)p), _mm256_broadcastsi128_si256(by_channel));
}

SIMD static inline vbytes v_load3(const unsigned char *p)
{
    const __m128i by_channel = _mm_setr_epi8(0, 3, 6, 9, 1, 4, 7, 10, 2, 5, 8, 11, -1, -1, -1, -1);
    const __m128i low = _mm_loadu_si128((const __m128i *)(const void *)p);
    const __m128i high = _mm_loadu_si128((const __m128i *)(const void *)(p + 12));
    return _mm256_shuffle_epi8(_mm256_inserti128_si256(_mm256_castsi128_si256(low), high, 1), _mm256_broadcastsi128_si256(by_channel));
}

SIMD static inline void v_store(int32_t *out, vbytes v)
{
    _mm256_storeu_si256((vbytes *)(void *)out, v);
}

// Wholes or nothing.
#define v_part4(p, count) ((count) > 0 ? v_load4(p) : v_splat(0))
#define v_part3(p, count) ((count) > 0 ? v_load3(p) : v_splat(0))

#define KERNEL lxrt_sum_pixels_avx2
#include "rt_pixels_loop.h"
#endif
