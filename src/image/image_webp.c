// WebP through libwebp: still pictures, lossy or lossless.
#include "image/codec.h"

#include <webp/decode.h>

static lx_result fail_status(VP8StatusCode status, lx_error *error)
{
    switch (status) {
    case VP8_STATUS_OUT_OF_MEMORY: return lx_fail_memory(error, "WebP");
    case VP8_STATUS_NOT_ENOUGH_DATA:
    case VP8_STATUS_SUSPENDED: return lx_fail(error, LX_ERROR_FORMAT, "WebP: truncated");
    case VP8_STATUS_UNSUPPORTED_FEATURE: return lx_fail(error, LX_ERROR_UNSUPPORTED, "WebP: unsupported feature");
    default: return lx_fail(error, LX_ERROR_FORMAT, "WebP: damaged");
    }
}

lx_result lx_webp_decode(const void *data, size_t size, uint64_t max_pixels, lx_image *out, lx_error *error)
{
    lx_result result = LX_OK;
    lx_image image = {0};
    WebPDecoderConfig config;
    if (!WebPInitDecoderConfig(&config)) return lx_fail(error, LX_ERROR_BACKEND, "WebP: library version mismatch");
    VP8StatusCode status = WebPGetFeatures(data, size, &config.input);
    if (status != VP8_STATUS_OK) return fail_status(status, error);
    if (config.input.has_animation) return lx_fail(error, LX_ERROR_UNSUPPORTED, "WebP: animations are not supported");

    const uint32_t width = (uint32_t)config.input.width, height = (uint32_t)config.input.height;
    const uint32_t channels = config.input.has_alpha ? 4 : 3;
    LX_TRY(lx_image_check_size(width, height, max_pixels, error));
    LX_TRY(lx_image_create(width, height, channels, LX_PIXEL_U8, &image, error));
    config.output.colorspace = channels == 4 ? MODE_RGBA : MODE_RGB;
    config.output.is_external_memory = 1;
    config.output.u.RGBA.rgba = image.u8;
    config.output.u.RGBA.stride = (int)(width * channels); // a WebP is at most 16384 wide
    config.output.u.RGBA.size = (size_t)width * channels * height;
    status = WebPDecode(data, size, &config);
    WebPFreeDecBuffer(&config.output);
    if (status != VP8_STATUS_OK) {
        result = fail_status(status, error);
        goto cleanup;
    }
    *out = image;
    image = (lx_image){0};
cleanup:
    lx_image_release(&image);
    return result;
}
