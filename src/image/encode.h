/// Pixel encodings: half floats and RGB9E5.
#ifndef LX_IMAGE_ENCODE_H
#define LX_IMAGE_ENCODE_H

#include "math/vec.h"

#include <stddef.h>
#include <stdint.h>

/// IEEE 754 binary16, round to nearest even; overflow gives infinity, NaN stays NaN; denormals are kept.
uint16_t lx_half_from_float(float value);
float lx_half_to_float(uint16_t half);

/// Shared-exponent format of EXT_texture_shared_exponent / VK_FORMAT_E5B9G9R9_UFLOAT_PACK32: r bits 0-8, g 9-17, b 18-26,
/// exponent 27-31. Negative and NaN become 0, more than 65408 is clamped.
uint32_t lx_rgb9e5_encode(lx_rgb value);
lx_rgb lx_rgb9e5_decode(uint32_t bits);

#endif
