// The wide kernel, written once: a .c file defines the words below for its instruction set, then KERNEL, and includes this.
//
//     SIMD             attributes of functions
//     vbytes, width    a register and its bytes, 16, 32 or 64; all happens within lanes of 16
//     v_load4, v_load3 width / 4 pixels of four or three bytes, four pixels a lane
//     granule          pixels of which v_part4 and v_part3, which read some of those and 0 for the rest, take whole numbers
//     excess           bytes that v_load3 and v_part3 read behind the pixels
//     v_table          16 bytes, the same in every lane
//     v_lookup         table[i] of each byte i of the second; they are below 16
//     v_lookup_first   the same of any bytes, 0 where they are 16 or more
//     v_shift4         each 16 bits >> 4
//     v_and, v_add8, v_add16, v_sub16, v_add32
//     v_dot8           sums of pairs of products of bytes, as 16 bits; the first may be anything, the second at most 127
//     v_dot16          sums of pairs of signed 16 bits, as 32 bits
//     v_sum8           sums of bytes as 32 bits: those of the lower and of the upper half of each lane stay apart
//     v_low32, v_high32, v_low64  lower or upper halves of lanes, interleaved by 4 bytes or one after the other
//     v_store          to 4-byte numbers
//     v_prefetch       will be read soon
#include "rt_pixels.h"

typedef struct tables {
    vbytes a_low, a_high, b_low, b_high, c, bow, toe;
    vbytes low_bits;
} tables;

// What has been summed; each lane's lower and upper half is a channel.
typedef struct half_sums {
    vbytes a_low, a_high, fine, b_high; // F = 64 a_low + 16384 a_high + fine + 256 b_high
} half_sums;

// Sums of 16 bits: B's low byte and C, which have the same unit, and B's high byte.
typedef struct short_sums {
    vbytes fine, b_high;
} short_sums;

SIMD static inline short_sums look_up(const tables *t, vbytes v, half_sums *sums)
{
    const vbytes h = v_and(v_shift4(v), t->low_bits), l = v_and(v, t->low_bits);
    sums->a_low = v_add32(sums->a_low, v_sum8(v_add8(v_lookup(t->a_low, h), v_lookup_first(t->toe, v))));
    sums->a_high = v_add32(sums->a_high, v_sum8(v_lookup(t->a_high, h)));
    // −2 · 96 · 56 … 2 · 255 · 15: twice that fits 16 bits
    const vbytes fine = v_sub16(v_dot8(v_lookup(t->b_low, h), l), v_dot8(v_lookup(t->bow, l), v_lookup(t->c, h)));
    return (short_sums){fine, v_dot8(v_lookup(t->b_high, h), l)};
}

SIMD static inline void widen(short_sums s, half_sums *sums)
{
    sums->fine = v_add32(sums->fine, v_dot16(s.fine));
    sums->b_high = v_add32(sums->b_high, v_dot16(s.b_high));
}

// `width` pixels, four registers of r r r r g g g g b b b b - - - - a lane.
SIMD static inline void add_pixels(const tables *t, vbytes p0, vbytes p1, vbytes p2, vbytes p3, half_sums *red_green, half_sums *blue)
{
    const short_sums first = look_up(t, v_low32(p0, p1), red_green), second = look_up(t, v_low32(p2, p3), red_green);
    widen((short_sums){v_add16(first.fine, second.fine), v_add16(first.b_high, second.b_high)}, red_green);
    widen(look_up(t, v_low64(v_high32(p0, p1), v_high32(p2, p3)), blue), blue);
}

// Sums of the lower and upper halves of lanes.
SIMD static inline void add_lanes(vbytes v, int64_t factor, int64_t out[2])
{
    int32_t numbers[width / 4];
    v_store(numbers, v);
    for (int i = 0; i < width / 4; ++i) out[i / 2 % 2] += factor * numbers[i];
}

SIMD static inline void add_halves(const half_sums *sums, int64_t out[2])
{
    add_lanes(sums->a_low, 64, out);
    add_lanes(sums->a_high, 16384, out);
    add_lanes(sums->fine, 1, out);
    add_lanes(sums->b_high, 256, out);
}

SIMD void KERNEL(const lxrt_pixel_block *block, uint64_t sums[3])
{
    enum { group = width / 4 }; // pixels of a register
    const uint32_t pixel_bytes = block->pixel_bytes;
    // Of three bytes: the last pixels of a row are left to the scalar kernel, so that nothing behind it is read.
    const uint32_t left = pixel_bytes == 4 ? 0 : (excess + 2) / 3;
    const uint32_t wide = block->width < left ? 0 : (block->width - left) / granule * granule;
    if (wide > 0) {
        const vbytes zero = v_splat(0);
        const tables t = {v_table(lxrt_srgb_a_low), v_table(lxrt_srgb_a_high), v_table(lxrt_srgb_b_low), v_table(lxrt_srgb_b_high),
                          v_table(lxrt_srgb_c),     v_table(lxrt_srgb_bow),    v_table(lxrt_srgb_toe),   v_splat(0x0f)};
        half_sums red_green = {zero, zero, zero, zero}, blue = red_green;
        for (uint32_t y = 0; y < block->rows; ++y) {
            const unsigned char *p = block->pixels + y * block->stride;
            const size_t ahead = y + lxrt_rows_ahead < block->rows ? lxrt_rows_ahead * block->stride : 0;
            uint32_t x = 0;
            // Values of 0 add 0: registers without pixels are simply that.
#define PART(bytes, number) v_part##bytes(p + number * group * bytes, wide - x > number * group ? wide - x - number * group : 0)
#define PIXELS(bytes)                                                                                                               \
    for (; x + 4 * group <= wide; x += 4 * group, p += 4 * group * bytes) {                                                         \
        v_prefetch(p + ahead);                                                                                                      \
        v_prefetch(p + ahead + 2 * group * bytes);                                                                                  \
        add_pixels(&t, v_load##bytes(p), v_load##bytes(p + group * bytes), v_load##bytes(p + 2 * group * bytes),                    \
                   v_load##bytes(p + 3 * group * bytes), &red_green, &blue);                                                        \
    }                                                                                                                               \
    if (x < wide)                                                                                                                   \
        add_pixels(&t, PART(bytes, 0), PART(bytes, 1), PART(bytes, 2), PART(bytes, 3), &red_green, &blue);
            if (pixel_bytes == 4) {
                PIXELS(4)
            } else {
                PIXELS(3)
            }
#undef PIXELS
#undef PART
        }
        int64_t red_green_sums[2] = {0, 0}, blue_sums[2] = {0, 0};
        add_halves(&red_green, red_green_sums);
        add_halves(&blue, blue_sums);
        sums[0] += (uint64_t)red_green_sums[0];
        sums[1] += (uint64_t)red_green_sums[1];
        sums[2] += (uint64_t)(blue_sums[0] + blue_sums[1]);
    }
    if (wide < block->width) {
        lxrt_pixel_block rest = *block;
        rest.pixels += (size_t)wide * pixel_bytes;
        rest.width -= wide;
        lxrt_sum_pixels_scalar(&rest, sums);
    }
}
