#include "bake/rows.h"

// One source for every instruction set: plain loops that compilers turn into vectors. Without fused multiply-adds all give the same bits.
static inline __attribute__((always_inline)) void add(float *sums, const uint16_t *row, size_t count)
{
    for (size_t i = 0; i < count; ++i) {
        const uint32_t bits = (uint32_t)row[i] << 13;
        float value;
        memcpy(&value, &bits, sizeof value);
        sums[i] += value;
    }
}

static inline __attribute__((always_inline)) void add_scaled(float *sums, const uint16_t *row, size_t layers, const float factor[3])
{
    for (size_t c = 0; c < 3; ++c)
        for (size_t i = 0; i < layers; ++i) {
            const uint32_t bits = (uint32_t)row[c * layers + i] << 13;
            float value;
            memcpy(&value, &bits, sizeof value);
            sums[c * layers + i] += factor[c] * value;
        }
}

#if defined(__x86_64__)
__attribute__((target("avx2"))) static void add_avx2(float *restrict sums, const uint16_t *restrict row, size_t count)
{
    add(sums, row, count & ~(size_t)(lx_row_lanes - 1));
}

__attribute__((target("avx2"))) static void add_scaled_avx2(float *restrict sums, const uint16_t *restrict row, size_t layers, const float factor[3])
{
    add_scaled(sums, row, layers & ~(size_t)(lx_row_lanes - 1), factor);
}
#endif

void lx_row_add(float *sums, const uint16_t *row, size_t count)
{
#if defined(__x86_64__)
    if (__builtin_cpu_supports("avx2")) {
        add_avx2(sums, row, count);
        return;
    }
#endif
    add(sums, row, count);
}

void lx_row_add_scaled(float *sums, const uint16_t *row, size_t layers, const float factor[3])
{
#if defined(__x86_64__)
    if (__builtin_cpu_supports("avx2")) {
        add_scaled_avx2(sums, row, layers, factor);
        return;
    }
#endif
    add_scaled(sums, row, layers, factor);
}
