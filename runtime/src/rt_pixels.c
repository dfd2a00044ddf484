// The sRGB table, the scalar kernel that adds it up, and which kernel runs.
#include "rt_pixels.h"

#include "rt_pack.h"

void lxrt_fill_srgb_table(uint32_t table[256])
{
    for (uint32_t v = 0; v < 256; ++v) {
        const uint32_t h = v >> 4, l = v & 15;
        const uint32_t a = (uint32_t)(lxrt_srgb_a_high[h] << 8) + lxrt_srgb_a_low[h] + (h == 0 ? lxrt_srgb_toe[l] : 0);
        const uint32_t b = (uint32_t)(lxrt_srgb_b_high[h] << 8) + lxrt_srgb_b_low[h];
        table[v] = 64 * a + b * l - (uint32_t)lxrt_srgb_c[h] * lxrt_srgb_bow[l];
    }
}

void lxrt_sum_pixels_scalar(const lxrt_pixel_block *block, uint64_t sums[3])
{
    const uint32_t *table = block->table;
    uint64_t r = 0, g = 0, b = 0;
    for (uint32_t y = 0; y < block->rows; ++y) {
        const unsigned char *pixel = block->pixels + y * block->stride;
        for (uint32_t x = 0; x < block->width; ++x, pixel += block->pixel_bytes) {
            r += table[pixel[0]];
            g += table[pixel[1]];
            b += table[pixel[2]];
        }
    }
    sums[0] += r;
    sums[1] += g;
    sums[2] += b;
}

static void fetch(const unsigned char *bytes, size_t count)
{
#if defined(__GNUC__)
    for (size_t i = 0; i < count; i += 64) __builtin_prefetch(bytes + i);
#else
    (void)bytes;
    (void)count;
#endif
}

static void sum_float_row(const unsigned char *pixel, uint32_t width, double sums[4])
{
    const uint32_t exponent = 0x7f800000; // all ones: infinite or no number
    double all[4];
    memcpy(all, sums, sizeof all);
    for (uint32_t x = 0; x < width; ++x, pixel += 16) {
        uint32_t bits[4];
        float rgba[4];
        memcpy(bits, pixel, sizeof bits);
        for (int i = 0; i < 4; ++i) bits[i] = (bits[i] & exponent) == exponent ? 0 : bits[i];
        memcpy(rgba, bits, sizeof rgba);
        for (int i = 0; i < 4; ++i) all[i] += rgba[i];
    }
    memcpy(sums, all, sizeof all);
}

void lxrt_sum_floats(const unsigned char *pixels, size_t stride, uint32_t width, uint32_t rows, double sums[4])
{
    memset(sums, 0, 4 * sizeof *sums);
    for (uint32_t y = 0; y < rows; ++y) {
        const unsigned char *row = pixels + y * stride;
        if (y + lxrt_rows_ahead < rows) fetch(row + lxrt_rows_ahead * stride, 16 * (size_t)width);
        sum_float_row(row, width, sums);
    }
}

lxrt_pixel_sum lxrt_get_pixel_sum(uint32_t index, const char **out_name)
{
    struct {
        lxrt_pixel_sum sum;
        const char *name;
    } sums[4] = {{lxrt_sum_pixels_scalar, "scalar"}};
    uint32_t count = 1;
#define ADD(which) (sums[count].sum = lxrt_sum_pixels_##which, sums[count++].name = #which)
#if defined(__x86_64__)
    __builtin_cpu_init();
    if (__builtin_cpu_supports("ssse3")) ADD(ssse3);
    if (__builtin_cpu_supports("avx2")) ADD(avx2);
    if (__builtin_cpu_supports("avx512bw")) ADD(avx512);
#endif
#if defined(__wasm_simd128__)
    ADD(wasm);
#endif
#undef ADD
    if (index >= count) return NULL;
    if (out_name) *out_name = sums[index].name;
    return sums[index].sum;
}

void lxrt_use_pixel_sum(lxrt_pack *pack, lxrt_pixel_sum sum)
{
    pack->pixel_sum = sum;
}
