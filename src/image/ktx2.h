/// KTX 2.0 files with lightmap arrays: our own small writer and reader.
/// Based on: Khronos KTX File Format Specification 2.0; Khronos Data Format Specification 1.3 (descriptor).
#ifndef LX_IMAGE_KTX2_H
#define LX_IMAGE_KTX2_H

#include "image/image.h"

typedef enum lx_ktx2_format {
    LX_KTX2_RGB9E5,  ///< VK_FORMAT_E5B9G9R9_UFLOAT_PACK32 (123), 4 bytes a texel.
    LX_KTX2_RGBA16F, ///< VK_FORMAT_R16G16B16A16_SFLOAT (97), 8 bytes a texel.
} lx_ktx2_format;

enum { lx_ktx2_max_levels = 16 };

/// More pixel data than this, all levels uncompressed, is refused by the reader (LX_ERROR_LIMIT).
#define LX_KTX2_MAX_BYTES ((uint64_t)12 << 30)

/// A 2D array texture. levels[k] holds all layers of mip level k, one after the other, rows from the top,
/// max(1, width >> k) × max(1, height >> k) texels each, little-endian.
typedef struct lx_ktx2 {
    lx_ktx2_format format;
    uint32_t width, height; ///< Of level 0, in texels, 1…65535.
    uint32_t layer_count;   ///< At least 1, and written as an array even then. A file without layers reads as one layer.
    uint32_t level_count;   ///< At least 1.
    lx_bytes levels[lx_ktx2_max_levels]; ///< Owned after decoding; lx_ktx2_encode only reads them.
} lx_ktx2;

/// Bytes of mip level `level` with all its layers.
size_t lx_ktx2_level_size(const lx_ktx2 *texture, uint32_t level);

/// `zstd`: supercompression scheme 2. `writer` goes into KTXwriter ("luxel 0.1.0").
lx_result lx_ktx2_encode(const lx_ktx2 *texture, bool zstd, const char *writer, lx_bytes *out, lx_error *error);

/// Reads what lx_ktx2_encode writes and any other KTX2 of these two formats (uncompressed or zstd). Hostile input gives an error.
lx_result lx_ktx2_decode(const void *data, size_t size, lx_ktx2 *out, lx_error *error);
void lx_ktx2_release(lx_ktx2 *texture);

#endif
