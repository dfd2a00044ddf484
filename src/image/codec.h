/// What the files of image/ share: one decoder per format and a growing buffer. Nobody else includes this.
#ifndef LX_IMAGE_CODEC_H
#define LX_IMAGE_CODEC_H

#include "base/error.h"
#include "image/image.h"

/// Decoders of the single formats behind lx_image_decode; `max_pixels` bounds width × height.
lx_result lx_png_decode(const void *data, size_t size, uint64_t max_pixels, lx_image *out, lx_error *error);
lx_result lx_jpeg_decode(const void *data, size_t size, uint64_t max_pixels, lx_image *out, lx_error *error);
lx_result lx_webp_decode(const void *data, size_t size, uint64_t max_pixels, lx_image *out, lx_error *error);
lx_result lx_hdr_decode(const void *data, size_t size, uint64_t max_pixels, lx_image *out, lx_error *error);
lx_result lx_exr_decode(const void *data, size_t size, uint64_t max_pixels, lx_image *out, lx_error *error);

/// What a file's header says about its size: LX_ERROR_FORMAT for an empty image, LX_ERROR_LIMIT for one that is too large.
lx_result lx_image_check_size(uint64_t width, uint64_t height, uint64_t max_pixels, lx_error *error);

/// A file being written in memory.
typedef struct lx_sink {
    lx_bytes bytes;
    size_t capacity;
} lx_sink;

/// Overwrites or extends; a gap between the end and `offset` is filled with zeros. False: no memory.
bool lx_sink_write_at(lx_sink *sink, size_t offset, const void *data, size_t size);
bool lx_sink_append(lx_sink *sink, const void *data, size_t size);
void lx_sink_release(lx_sink *sink);

#endif
