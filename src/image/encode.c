// Pixel encodings, in integers where that is exact, so that flush-to-zero mode and the rounding mode do not matter.
//
// Based on: IEEE 754-2008 (binary16); EXT_texture_shared_exponent, section "Encode" (RGB9E5).
#include "image/encode.h"

#include <string.h>

static uint32_t bits_of(float value)
{
    uint32_t bits;
    memcpy(&bits, &value, sizeof bits);
    return bits;
}

static float float_of(uint32_t bits)
{
    float value;
    memcpy(&value, &bits, sizeof value);
    return value;
}

// Drops the lowest `shift` bits (1 … 31), rounding to nearest, ties to even.
static uint32_t shift_round_even(uint32_t value, uint32_t shift)
{
    const uint32_t half = 1u << (shift - 1);
    const uint32_t odd = (value >> shift) & 1u;
    return (value + half - 1 + odd) >> shift;
}

uint16_t lx_half_from_float(float value)
{
    const uint32_t bits = bits_of(value);
    const uint32_t sign = (bits >> 16) & 0x8000u;
    const uint32_t magnitude = bits & 0x7fffffffu;
    uint32_t half;
    if (magnitude > 0x7f800000u) {
        half = 0x7e00u | ((magnitude >> 13) & 0x3ffu); // quiet NaN with what fits of its payload
    } else if (magnitude >= 0x47800000u) {
        half = 0x7c00u; // 65536 and above, infinity
    } else if (magnitude >= 0x38800000u) {
        // Normal in both: rebias the exponent by 127 - 15. A carry out of the mantissa moves into the exponent, and from
        // 65520 on to infinity, which is what rounding asks for.
        half = shift_round_even(magnitude - (112u << 23), 13);
    } else if (magnitude >= 0x33000000u) {
        // Denormal half: the mantissa with its leading one, in units of 2^-24.
        half = shift_round_even((magnitude & 0x7fffffu) | 0x800000u, 126u - (magnitude >> 23));
    } else {
        half = 0; // below half of the smallest denormal
    }
    return (uint16_t)(sign | half);
}

float lx_half_to_float(uint16_t half)
{
    const uint32_t sign = (uint32_t)(half & 0x8000u) << 16;
    const uint32_t exponent = (half >> 10) & 0x1fu;
    const uint32_t mantissa = half & 0x3ffu;
    if (exponent == 0x1f) return float_of(sign | 0x7f800000u | mantissa << 13);
    if (exponent != 0) return float_of(sign | (exponent + 112u) << 23 | mantissa << 13);
    const float magnitude = (float)mantissa * 0x1p-24f;
    return float_of(sign | bits_of(magnitude));
}

enum { mantissa_bits = 9, exponent_bias = 15 };

// Zero for negative values and NaN, at most the largest value of the format: 511/512 · 2^16.
static float clamp_to_range(float value)
{
    if (!(value > 0)) return 0;
    return value < 65408.0f ? value : 65408.0f;
}

// 2^exponent for -126 … 127.
static float power_of_two(int exponent)
{
    return float_of((uint32_t)(exponent + 127) << 23);
}

// floor(value / unit + 0.5). In double, since the sum would round up in float for values just below k + 0.5.
static uint32_t quantise(float value, float unit)
{
    return (uint32_t)((double)value / (double)unit + 0.5);
}

uint32_t lx_rgb9e5_encode(lx_rgb value)
{
    const float r = clamp_to_range(value.r), g = clamp_to_range(value.g), b = clamp_to_range(value.b);
    float largest = r > g ? r : g;
    if (b > largest) largest = b;

    // exp_shared_p of the extension: max(-B-1, floor(log2(max))) + 1 + B; floor(log2) is the float's exponent field.
    const int log2_floor = (int)(bits_of(largest) >> 23) - 127;
    int exponent = (log2_floor > -exponent_bias - 1 ? log2_floor : -exponent_bias - 1) + 1 + exponent_bias;
    float unit = power_of_two(exponent - exponent_bias - mantissa_bits);
    if (quantise(largest, unit) == 1u << mantissa_bits) {
        ++exponent;
        unit *= 2;
    }
    return quantise(r, unit) | quantise(g, unit) << 9 | quantise(b, unit) << 18 | (uint32_t)exponent << 27;
}

lx_rgb lx_rgb9e5_decode(uint32_t bits)
{
    const float unit = power_of_two((int)(bits >> 27) - exponent_bias - mantissa_bits);
    return (lx_rgb){(float)(bits & 0x1ffu) * unit, (float)(bits >> 9 & 0x1ffu) * unit, (float)(bits >> 18 & 0x1ffu) * unit};
}
