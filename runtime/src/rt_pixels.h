// Sums of pixels.
//
// Those of 8-bit sRGB pixels are of their linear values, in whole numbers throughout: every order of adding gives the same bits, so wide
// kernels and the scalar one agree exactly, here and in WebAssembly.
//
// With v = 16 h + l a channel's linear value is F(v) = 64 (A[h] + toe[v]) + B[h] l − C[h] l (15 − l): a parabola for each of 16 stretches of
// the sRGB curve, which a byte shuffle of 16 entries can look up. `toe`, for v < 16 alone, bends the first one where the curve's straight
// part ends. The numbers are the ones with the smallest largest error of each stretch, found by trying all near the interpolating parabola.
// F / F(255) is within 8.1e-6 of the exact curve and within 0.25 % of each value: as good as 16-bit linear numbers can be.
#ifndef LXRT_RT_PIXELS_H
#define LXRT_RT_PIXELS_H

#include "luxel_rt.h"

enum {
    lxrt_white = 4194225, // F(255)
    // Of a block; keeps the 32-bit sums of wide kernels from overflowing: 2^15 steps of 16 pixels, each at most 8 C l (15 − l) = 43008.
    lxrt_max_sum_width = 4096,
    lxrt_max_sum_rows = 128,
    // Rows of a cell are short and far apart: processors do not guess the next ones by themselves, so they are fetched this much earlier.
    lxrt_rows_ahead = 4,
};

static const uint8_t lxrt_srgb_a_low[16] = {0, 84, 179, 145, 32, 137, 242, 123, 66, 101, 254, 36, 240, 121, 210, 17};
static const uint8_t lxrt_srgb_a_high[16] = {0, 1, 3, 7, 13, 20, 29, 41, 55, 71, 89, 111, 134, 161, 190, 223};
static const uint8_t lxrt_srgb_b_low[16] = {249, 75, 67, 3, 104, 97, 219, 210, 62, 19, 68, 220, 200, 7, 158, 127};
static const uint8_t lxrt_srgb_b_high[16] = {4, 9, 15, 22, 29, 37, 45, 54, 64, 74, 84, 94, 105, 117, 128, 140};
static const uint8_t lxrt_srgb_c[16] = {0, 44, 51, 57, 62, 66, 70, 74, 76, 80, 83, 86, 88, 91, 94, 96};
static const uint8_t lxrt_srgb_bow[16] = {0, 14, 26, 36, 44, 50, 54, 56, 56, 54, 50, 44, 36, 26, 14, 0}; // l (15 − l)
static const uint8_t lxrt_srgb_toe[16] = {0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1, 2, 5, 9, 15};

// A rectangle of whole pixels within the limits above.
typedef struct lxrt_pixel_block {
    const unsigned char *pixels;
    size_t stride; // bytes from row to row
    uint32_t width, rows;
    uint32_t pixel_bytes;  // 3 or 4; the fourth is ignored
    const uint32_t *table; // F
} lxrt_pixel_block;

// Adds the sums of F of red, green and blue.
typedef void (*lxrt_pixel_sum)(const lxrt_pixel_block *block, uint64_t sums[3]);

void lxrt_fill_srgb_table(uint32_t table[256]);

void lxrt_sum_pixels_scalar(const lxrt_pixel_block *block, uint64_t sums[3]);
#if defined(__x86_64__)
void lxrt_sum_pixels_ssse3(const lxrt_pixel_block *block, uint64_t sums[3]);
void lxrt_sum_pixels_avx2(const lxrt_pixel_block *block, uint64_t sums[3]);
void lxrt_sum_pixels_avx512(const lxrt_pixel_block *block, uint64_t sums[3]);
#endif
#if defined(__wasm_simd128__)
void lxrt_sum_pixels_wasm(const lxrt_pixel_block *block, uint64_t sums[3]);
#endif

// The sums of RGBA floats at any address; those that are not finite count as 0. In one order, row by row. Alpha is summed like the others:
// four alike, without a branch, are what compilers make vectors of.
void lxrt_sum_floats(const unsigned char *pixels, size_t stride, uint32_t width, uint32_t rows, double sums[4]);

// Kernels that this processor can run, slowest first: 0 is the scalar one. NULL beyond the last. `out_name` may be NULL.
lxrt_pixel_sum lxrt_get_pixel_sum(uint32_t index, const char **out_name);
// Makes a pack use a kernel from now on. For tests and measurements.
void lxrt_use_pixel_sum(lxrt_pack *pack, lxrt_pixel_sum sum);

#endif
