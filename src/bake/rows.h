/// Rows of light: what one luxel sends out in every layer, packed so that one ray's hit costs a cache line or two, not a line per layer.
///
/// A row holds radiosity: albedo times irradiance of a luxel, [channel][layer], layers padded to a multiple of lx_row_lanes. Values are not negative,
/// so 16 bits hold six bits of exponent and ten of mantissa (rounding error 2^-11, range 2^62): one shift turns them into a float that is
/// 2^lx_row_bias of what it stands for. A layer's power-of-two scale makes its brightest direct light fit with room for all bounces.
#ifndef LX_BAKE_ROWS_H
#define LX_BAKE_ROWS_H

#include <math.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

enum { lx_row_lanes = 8, lx_row_line = 32 }; // values

/// Layers of a row, padded.
static inline uint32_t lx_row_layers(uint32_t layer_count)
{
    return (layer_count + lx_row_lanes - 1) / lx_row_lanes * lx_row_lanes;
}

/// Values from one row to the next: rows begin with a cache line each, since most are read one by one.
static inline size_t lx_row_stride(uint32_t row_layers)
{
    return (3 * (size_t)row_layers + lx_row_line - 1) / lx_row_line * lx_row_line;
}

/// `value` times the layer's scale, 0 … 1.
static inline uint16_t lx_row_encode(float value)
{
    uint32_t bits;
    value *= 0x1p-64f; // 1.0 becomes exponent 63 of 63
    if (!(value > 0x1p-126f)) return 0;
    memcpy(&bits, &value, sizeof bits);
    bits = (bits + 0xfff + ((bits >> 13) & 1)) >> 13; // nearest even
    return bits > 0xffff ? 0xffff : (uint16_t)bits;
}

/// 2^-64 of the encoded value.
static inline float lx_row_decode_small(uint16_t code)
{
    const uint32_t bits = (uint32_t)code << 13;
    float value;
    memcpy(&value, &bits, sizeof value);
    return value;
}

#define LX_ROW_UNIT 0x1p64f ///< Times what the sums below add up: the value.

/// Asks for a row that will be read soon. The second cache can wait for more lines at a time than the first.
static inline void lx_row_fetch(const uint16_t *row, size_t count)
{
#if defined(__GNUC__)
    for (size_t k = 0; k < count; k += lx_row_line) __builtin_prefetch(row + k, 0, 2);
#else
    (void)row;
    (void)count;
#endif
}

/// sums[i] += row[i], decoded small. `count` is a multiple of lx_row_lanes.
void lx_row_add(float *sums, const uint16_t *row, size_t count);
/// The same with a factor per channel; `layers`: per channel.
void lx_row_add_scaled(float *sums, const uint16_t *row, size_t layers, const float factor[3]);

#endif
