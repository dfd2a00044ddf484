/// Compares two pictures: RMSE and friends over the pixels that are valid in both, and a picture of the difference.
#include "luxel/picture.h"

#include "base/error.h"
#include "base/memory.h"
#include "image/image.h"
#include "math/color.h"
#include "math/vec.h"

#include <math.h>

static lx_result load(const char *path, lx_image *out, lx_error *error)
{
    const lx_result result = lx_image_load(path, out, error);
    if (result != LX_OK) lx_error_prefix(error, "%s", path);
    return result;
}

static lx_rgb pixel_color(const lx_image *image, size_t pixel)
{
    const size_t first = pixel * image->channels;
    float values[3];
    for (size_t c = 0; c < 3; ++c) {
        const size_t element = first + (image->channels >= 3 ? c : 0);
        values[c] = image->type == LX_PIXEL_U8 ? lx_srgb_byte_to_linear[image->u8[element]] : image->f32[element];
    }
    return (lx_rgb){values[0], values[1], values[2]};
}

static bool pixel_is_valid(const lx_image *image, size_t pixel)
{
    if (image->channels == 1 || image->channels == 3) return true;
    const size_t alpha = pixel * image->channels + image->channels - 1;
    return image->type == LX_PIXEL_U8 ? image->u8[alpha] > 0 : image->f32[alpha] > 0.0f;
}

// Clears what lies within `distance` steps of an invalid pixel of the line, which was valid itself.
static void erode_line(uint8_t *line, size_t count, size_t stride, size_t distance)
{
    for (int backwards = 0; backwards < 2; ++backwards) {
        size_t since = SIZE_MAX; // steps since the last pixel that was invalid before this pass
        for (size_t k = 0; k < count; ++k) {
            uint8_t *const valid = line + (backwards ? count - 1 - k : k) * stride;
            if (*valid == 0)
                since = 0;
            else if (since != SIZE_MAX && ++since <= distance)
                *valid = 2; // to be cleared; still counts as valid for the way back
        }
    }
    for (size_t k = 0; k < count; ++k)
        if (line[k * stride] == 2) line[k * stride] = 0;
}

// A square of 2·distance + 1 pixels, as two passes along the axes. Outside of the picture counts as valid.
static void erode(uint8_t *valid, uint32_t width, uint32_t height, uint32_t distance)
{
    if (distance == 0) return;
    for (uint32_t y = 0; y < height; ++y) erode_line(valid + (size_t)y * width, width, 1, distance);
    for (uint32_t x = 0; x < width; ++x) erode_line(valid + x, height, width, distance);
}

static lx_result measure(const lx_image *a, const lx_image *b, const uint8_t *valid, const char *path_a, const char *path_b,
                         lx_comparison *out, lx_error *error)
{
    const size_t pixel_count = (size_t)a->width * a->height;
    lx_comparison c = {.width = a->width, .height = a->height};
    double sum_a = 0.0, sum_b = 0.0, sum_squares = 0.0;
    for (size_t pixel = 0; pixel < pixel_count; ++pixel) {
        if (!valid[pixel]) continue;
        const lx_rgb va = pixel_color(a, pixel), vb = pixel_color(b, pixel);
        const float channels_a[3] = {va.r, va.g, va.b}, channels_b[3] = {vb.r, vb.g, vb.b};
        ++c.valid_count;
        for (int k = 0; k < 3; ++k) {
            // One broken pixel would make every number below meaningless: say where it is instead.
            if (!isfinite(channels_a[k]) || !isfinite(channels_b[k]))
                return lx_fail(error, LX_ERROR_FORMAT, "%s: pixel (%u, %u) is not a finite number",
                               isfinite(channels_a[k]) ? path_b : path_a, (unsigned)(pixel % a->width),
                               (unsigned)(pixel / a->width));
            const double difference = (double)channels_b[k] - (double)channels_a[k];
            sum_a += (double)channels_a[k];
            sum_b += (double)channels_b[k];
            sum_squares += difference * difference;
            if (fabs(difference) > c.worst) {
                c.worst = fabs(difference);
                c.worst_x = (uint32_t)(pixel % a->width);
                c.worst_y = (uint32_t)(pixel / a->width);
            }
        }
    }
    if (c.valid_count == 0)
        return lx_fail(error, LX_ERROR_FORMAT, "%s: no pixel is valid in both pictures", path_b);
    const double count = 3.0 * (double)c.valid_count;
    c.mean_a = sum_a / count;
    c.mean_b = sum_b / count;
    c.rmse = sqrt(sum_squares / count);
    c.relative_rmse = c.rmse == 0.0 ? 0.0 : c.rmse / c.mean_a;

    const double floor_a = 0.01 * c.mean_a * c.mean_a; // keeps dark pixels from deciding all
    double sum_relative = 0.0;
    for (size_t pixel = 0; pixel < pixel_count; ++pixel) {
        if (!valid[pixel]) continue;
        const lx_rgb va = pixel_color(a, pixel), vb = pixel_color(b, pixel);
        const double channels_a[3] = {(double)va.r, (double)va.g, (double)va.b};
        const double channels_b[3] = {(double)vb.r, (double)vb.g, (double)vb.b};
        for (int k = 0; k < 3; ++k) {
            const double difference = channels_b[k] - channels_a[k];
            if (difference != 0.0) sum_relative += difference * difference / (channels_a[k] * channels_a[k] + floor_a);
        }
    }
    c.rel_mse = sum_relative / count;
    *out = c;
    return LX_OK;
}

static lx_result save_difference(const char *path, const lx_image *a, const lx_image *b, const uint8_t *valid,
                                 lx_error *error)
{
    const size_t pixel_count = (size_t)a->width * a->height;
    float *const rgb = lx_calloc_array(pixel_count, 3 * sizeof *rgb);
    if (!rgb) return lx_fail_memory(error, "difference picture");
    for (size_t pixel = 0; pixel < pixel_count; ++pixel) {
        if (!valid[pixel]) continue;
        const lx_rgb va = pixel_color(a, pixel), vb = pixel_color(b, pixel);
        rgb[3 * pixel + 0] = fabsf(vb.r - va.r);
        rgb[3 * pixel + 1] = fabsf(vb.g - va.g);
        rgb[3 * pixel + 2] = fabsf(vb.b - va.b);
    }
    const lx_result result = lx_picture_save(path, a->width, a->height, rgb, error);
    lx_free(rgb);
    return result;
}

lx_result lx_picture_compare(const char *path_a, const char *path_b, uint32_t erode_distance, const char *difference_path,
                             lx_comparison *out, lx_error *error)
{
    lx_result result = LX_OK;
    lx_image a = {0}, b = {0};
    uint8_t *valid = NULL;
    lx_comparison comparison;

    LX_TRY(load(path_a, &a, error));
    LX_TRY(load(path_b, &b, error));
    if (a.width != b.width || a.height != b.height) {
        result = lx_fail(error, LX_ERROR_FORMAT, "%s: %u x %u pixels, but %s has %u x %u", path_b, b.width, b.height, path_a,
                         a.width, a.height);
        goto cleanup;
    }
    const size_t pixel_count = (size_t)a.width * a.height;
    valid = lx_malloc_array(pixel_count, 1);
    if (!valid) {
        result = lx_fail_memory(error, "comparison");
        goto cleanup;
    }
    for (size_t pixel = 0; pixel < pixel_count; ++pixel)
        valid[pixel] = pixel_is_valid(&a, pixel) && pixel_is_valid(&b, pixel);
    erode(valid, a.width, a.height, erode_distance);
    LX_TRY(measure(&a, &b, valid, path_a, path_b, &comparison, error));
    if (difference_path) LX_TRY(save_difference(difference_path, &a, &b, valid, error));
    *out = comparison;
cleanup:
    lx_free(valid);
    lx_image_release(&b);
    lx_image_release(&a);
    return result;
}
