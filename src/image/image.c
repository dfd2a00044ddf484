// Images in memory; which codec a file goes to. The codecs are one file per format.
#include "image/codec.h"

#include "base/memory.h"
#include "math/color.h"

#include <string.h>

enum { max_side = 65535 };

lx_result lx_image_check_size(uint64_t width, uint64_t height, uint64_t max_pixels, lx_error *error)
{
    if (width == 0 || height == 0) return lx_fail(error, LX_ERROR_FORMAT, "image has no pixels");
    if (width > max_side || height > max_side || width * height > max_pixels)
        return lx_fail(error, LX_ERROR_LIMIT, "image of %llux%llu pixels is larger than the limit",
                       (unsigned long long)width, (unsigned long long)height);
    return LX_OK;
}

static size_t type_size(lx_pixel_type type)
{
    return type == LX_PIXEL_F32 ? sizeof(float) : 1;
}

lx_result lx_image_create(uint32_t width, uint32_t height, uint32_t channels, lx_pixel_type type, lx_image *out,
                          lx_error *error)
{
    if (width == 0 || height == 0 || channels == 0 || channels > 4)
        return lx_fail(error, LX_ERROR_INVALID_ARGUMENT, "image of %ux%u pixels with %u channels", width, height, channels);
    const lx_result size_result = lx_image_check_size(width, height, LX_IMAGE_MAX_PIXELS, error);
    if (size_result != LX_OK) return size_result;
    // No overflow: LX_IMAGE_MAX_PIXELS · 4 channels · 4 bytes is 2^32.
    void *data = lx_calloc_array((size_t)width * height, channels * type_size(type));
    if (!data) return lx_fail_memory(error, "image");
    *out = (lx_image){.width = width, .height = height, .channels = channels, .type = type, .data = data};
    return LX_OK;
}

void lx_image_release(lx_image *image)
{
    lx_free(image->data);
    *image = (lx_image){0};
}

static bool has_bytes(const void *data, size_t size, size_t offset, const char *expected, size_t length)
{
    return size >= offset + length && memcmp((const uint8_t *)data + offset, expected, length) == 0;
}

lx_image_format lx_image_sniff(const void *data, size_t size)
{
    if (has_bytes(data, size, 0, "\x89PNG\r\n\x1a\n", 8)) return LX_IMAGE_PNG;
    if (has_bytes(data, size, 0, "\xff\xd8\xff", 3)) return LX_IMAGE_JPEG;
    if (has_bytes(data, size, 0, "RIFF", 4) && has_bytes(data, size, 8, "WEBP", 4)) return LX_IMAGE_WEBP;
    if (has_bytes(data, size, 0, "\x76\x2f\x31\x01", 4)) return LX_IMAGE_EXR;
    if (has_bytes(data, size, 0, "#?", 2)) return LX_IMAGE_HDR;
    if (has_bytes(data, size, 0, "\xabKTX 20\xbb\r\n\x1a\n", 12)) return LX_IMAGE_KTX2;
    return LX_IMAGE_UNKNOWN;
}

lx_result lx_image_decode_limited(const void *data, size_t size, uint64_t max_pixels, lx_image *out, lx_error *error)
{
    if (max_pixels > LX_IMAGE_MAX_PIXELS) max_pixels = LX_IMAGE_MAX_PIXELS;
    switch (lx_image_sniff(data, size)) {
    case LX_IMAGE_PNG: return lx_png_decode(data, size, max_pixels, out, error);
    case LX_IMAGE_JPEG: return lx_jpeg_decode(data, size, max_pixels, out, error);
    case LX_IMAGE_WEBP: return lx_webp_decode(data, size, max_pixels, out, error);
    case LX_IMAGE_EXR: return lx_exr_decode(data, size, max_pixels, out, error);
    case LX_IMAGE_HDR: return lx_hdr_decode(data, size, max_pixels, out, error);
    case LX_IMAGE_KTX2: return lx_fail(error, LX_ERROR_UNSUPPORTED, "KTX2 textures are not supported here");
    case LX_IMAGE_UNKNOWN: break;
    }
    return lx_fail(error, LX_ERROR_FORMAT, "not a PNG, JPEG, WebP, EXR or HDR image");
}

lx_result lx_image_decode(const void *data, size_t size, lx_image *out, lx_error *error)
{
    return lx_image_decode_limited(data, size, LX_IMAGE_MAX_PIXELS, out, error);
}

lx_result lx_image_load(const char *path, lx_image *out, lx_error *error)
{
    lx_result result = LX_OK;
    lx_bytes bytes = {0};
    LX_TRY(lx_file_read(path, (size_t)1 << 30, &bytes, error));
    LX_TRY(lx_image_decode(bytes.data, bytes.size, out, error));
cleanup:
    lx_bytes_release(&bytes);
    return result;
}

static uint8_t to_byte(float value)
{
    if (!(value > 0)) return 0; // NaN too
    return value < 1 ? (uint8_t)(value * 255.0f + 0.5f) : 255;
}

// Physical values to sRGB bytes; alpha (the last of two or four channels) stays linear.
static lx_result to_srgb_bytes(const lx_image *image, lx_image *out, lx_error *error)
{
    const lx_result result = lx_image_create(image->width, image->height, image->channels, LX_PIXEL_U8, out, error);
    if (result != LX_OK) return result;
    const size_t count = (size_t)image->width * image->height * image->channels;
    const uint32_t alpha = image->channels % 2 == 0 ? image->channels - 1 : image->channels;
    for (size_t i = 0; i < count; ++i) {
        const bool is_alpha = i % image->channels == alpha;
        out->u8[i] = to_byte(is_alpha ? image->f32[i] : lx_linear_to_srgb(image->f32[i]));
    }
    return LX_OK;
}

static lx_result encode_png(const lx_image *image, lx_bytes *out, lx_error *error)
{
    if (image->type == LX_PIXEL_U8) return lx_png_encode(image, out, error);
    lx_image bytes = {0};
    lx_result result = to_srgb_bytes(image, &bytes, error);
    if (result == LX_OK) result = lx_png_encode(&bytes, out, error);
    lx_image_release(&bytes);
    return result;
}

static lx_result encode_by_extension(const lx_image *image, const char *path, lx_bytes *out, lx_error *error)
{
    char extension[8];
    lx_path_extension(path, extension);
    if (strcmp(extension, "png") == 0) return encode_png(image, out, error);
    if (strcmp(extension, "hdr") == 0) return lx_hdr_encode(image, out, error);
    if (strcmp(extension, "exr") == 0) return lx_exr_encode(image, false, out, error);
    return lx_fail(error, LX_ERROR_INVALID_ARGUMENT, "the name must end in .png, .hdr or .exr");
}

lx_result lx_image_save(const lx_image *image, const char *path, lx_error *error)
{
    lx_result result = LX_OK;
    lx_bytes bytes = {0};
    LX_TRY(encode_by_extension(image, path, &bytes, error));
    LX_TRY(lx_file_write(path, bytes.data, bytes.size, error));
cleanup:
    lx_bytes_release(&bytes);
    return result;
}

bool lx_sink_write_at(lx_sink *sink, size_t offset, const void *data, size_t size)
{
    size_t end;
    if (!lx_add_size(offset, size, &end)) return false;
    if (!lx_array_reserve(&sink->bytes.data, &sink->capacity, end, 1)) return false;
    if (offset > sink->bytes.size) memset(sink->bytes.data + sink->bytes.size, 0, offset - sink->bytes.size);
    if (size) memcpy(sink->bytes.data + offset, data, size);
    if (end > sink->bytes.size) sink->bytes.size = end;
    return true;
}

bool lx_sink_append(lx_sink *sink, const void *data, size_t size)
{
    return lx_sink_write_at(sink, sink->bytes.size, data, size);
}

void lx_sink_release(lx_sink *sink)
{
    lx_bytes_release(&sink->bytes);
    sink->capacity = 0;
}
