/// sRGB and linear light (IEC 61966-2-1).
#ifndef LX_MATH_COLOR_H
#define LX_MATH_COLOR_H

#include <math.h>
#include <stdint.h>

static inline float lx_srgb_to_linear(float v)
{
    return v <= 0.04045f ? v / 12.92f : powf((v + 0.055f) / 1.055f, 2.4f);
}

static inline float lx_linear_to_srgb(float v)
{
    return v <= 0.0031308f ? v * 12.92f : 1.055f * powf(v, 1.0f / 2.4f) - 0.055f;
}

/// Linear values of the 256 sRGB bytes.
extern const float lx_srgb_byte_to_linear[256];

#endif
