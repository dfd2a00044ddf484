/// Images in memory and the file formats they come in and go out as.
#ifndef LX_IMAGE_IMAGE_H
#define LX_IMAGE_IMAGE_H

#include "base/file.h"

typedef enum lx_pixel_type {
    LX_PIXEL_U8,  ///< 0…255 as stored in the file (sRGB or linear is the reader's business).
    LX_PIXEL_F32, ///< Physical values.
} lx_pixel_type;

/// Interleaved channels, row 0 first, no padding: pixel (x, y) starts at element (y * width + x) * channels.
typedef struct lx_image {
    uint32_t width, height;
    uint32_t channels; ///< 1 grey, 2 grey + alpha, 3 RGB, 4 RGBA.
    lx_pixel_type type;
    union {
        uint8_t *u8;
        float *f32;
        void *data; ///< Owned.
    };
} lx_image;

/// Zeroed pixels. Width and height 1…65535, channels 1…4, at most LX_IMAGE_MAX_PIXELS pixels (LX_ERROR_LIMIT beyond).
#define LX_IMAGE_MAX_PIXELS (256u * 1024u * 1024u)
lx_result lx_image_create(uint32_t width, uint32_t height, uint32_t channels, lx_pixel_type type, lx_image *out,
                          lx_error *error);
void lx_image_release(lx_image *image);

typedef enum lx_image_format {
    LX_IMAGE_UNKNOWN,
    LX_IMAGE_PNG,
    LX_IMAGE_JPEG,
    LX_IMAGE_WEBP,
    LX_IMAGE_EXR,
    LX_IMAGE_HDR,
    LX_IMAGE_KTX2,
} lx_image_format;

/// By the first bytes, never by the file's name.
lx_image_format lx_image_sniff(const void *data, size_t size);

/// Decodes PNG, JPEG, WebP (→ U8), EXR, HDR (→ F32) from memory. Hostile input gives an error, never a crash; sizes are
/// checked against LX_IMAGE_MAX_PIXELS before anything is allocated. Messages are one line without the path.
/// PNG: 16 bits are rounded to 8; palettes, 1-4 bits and transparent colours expand. JPEG: grey or RGB (CMYK and YCCK are
/// converted). WebP: stills, RGB or RGBA. Alpha is as stored.
/// EXR: scanline or tiled single-part images, half or float, with channels R G B (A), a missing one of the three being 0,
/// or Y (A); other channels are ignored; compression none, RLE, ZIP, PIZ or PXR24; the data window decides the size.
/// HDR: RGBE stored row by row; EXPOSURE is divided out.
lx_result lx_image_decode(const void *data, size_t size, lx_image *out, lx_error *error);
/// The same with a lower limit on width × height.
lx_result lx_image_decode_limited(const void *data, size_t size, uint64_t max_pixels, lx_image *out, lx_error *error);

/// Reads and decodes a file of at most 1 GiB. Messages do not repeat the path.
lx_result lx_image_load(const char *path, lx_image *out, lx_error *error);

/// Encoders; `out` is owned by the caller. EXR channels are named Y, Y A, R G B or R G B A.
lx_result lx_png_encode(const lx_image *image, lx_bytes *out, lx_error *error);                 ///< U8 only.
lx_result lx_jpeg_encode(const lx_image *image, int quality, lx_bytes *out, lx_error *error);   ///< U8, 3 channels; quality 1…100.
lx_result lx_hdr_encode(const lx_image *image, lx_bytes *out, lx_error *error);                 ///< F32, 3 channels; RLE.
lx_result lx_exr_encode(const lx_image *image, bool half_float, lx_bytes *out, lx_error *error); ///< F32; ZIP.

/// Format by the ending of `path` (png: values are clamped 0…1 and stored sRGB; hdr; exr: 32-bit float), written atomically.
lx_result lx_image_save(const lx_image *image, const char *path, lx_error *error);

#endif
