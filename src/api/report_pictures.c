// Pictures of lightmap pages and of what a camera sees of them: small, tone-mapped, as JPEG.
#include "api/report.h"

#include "base/error.h"
#include "math/color.h"
#include "render/develop.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

lx_result lx_report_add_jpeg(lx_builder *html, const lx_image *image, int quality, lx_error *error)
{
    lx_bytes bytes = {0};
    const lx_result result = lx_jpeg_encode(image, quality, &bytes, error);
    if (result != LX_OK) return result;
    lx_builder_add(html, "data:image/jpeg;base64,");
    lx_builder_base64(html, bytes.data, bytes.size);
    lx_bytes_release(&bytes);
    return LX_OK;
}

// The smallest mip level that still has `pixels` texels along an edge; *out is its size.
static uint32_t choose_level(const lx_baked *baked, uint32_t pixels, uint32_t *out)
{
    lxrt_info info;
    lxrt_get_info(baked->pack, &info);
    uint32_t level = 0;
    while (level + 1 < info.level_count && info.page_size >> (level + 1) >= pixels) ++level;
    *out = info.page_size >> level;
    return level;
}

static lx_result compose(const lx_baked *baked, uint32_t page, uint32_t level, uint32_t size, float **out, lx_error *error)
{
    float *rgb = lx_malloc_array((size_t)size * size, 3 * sizeof *rgb);
    if (!rgb) return lx_fail_memory(error, "report");
    const lx_result result = lx_baked_compose_level(baked, page, level, rgb, error);
    if (result != LX_OK) {
        lx_free(rgb);
        return result;
    }
    *out = rgb;
    return LX_OK;
}

// Means over boxes of whole texels, in place.
static void shrink(float *rgb, uint32_t size, uint32_t target)
{
    for (uint32_t y = 0; y < target; ++y)
        for (uint32_t x = 0; x < target; ++x) {
            const uint32_t x0 = x * size / target, x1 = (x + 1) * size / target, y0 = y * size / target, y1 = (y + 1) * size / target;
            double sum[3] = {0};
            for (uint32_t j = y0; j < y1; ++j)
                for (uint32_t i = x0; i < x1; ++i)
                    for (int k = 0; k < 3; ++k) sum[k] += (double)rgb[3 * ((size_t)j * size + i) + (size_t)k];
            const double count = (double)(x1 - x0) * (y1 - y0);
            for (int k = 0; k < 3; ++k) rgb[3 * ((size_t)y * target + x) + (size_t)k] = (float)(sum[k] / count);
        }
}

static int compare_floats(const void *a, const void *b)
{
    const float x = *(const float *)a, y = *(const float *)b;
    return (x > y) - (x < y);
}

// Exposure by which all but the brightest fortieth of what is lit stays below white. *out_black: nothing is lit.
static lx_result bright_exposure(const float *rgb, size_t count, float *out, bool *out_black, lx_error *error)
{
    float *lit = lx_malloc_array(count, sizeof *lit);
    if (!lit) return lx_fail_memory(error, "report");
    size_t lit_count = 0;
    float largest = 0;
    for (size_t i = 0; i < count; ++i) largest = fmaxf(largest, lx_luminance((lx_rgb){rgb[3 * i], rgb[3 * i + 1], rgb[3 * i + 2]}));
    for (size_t i = 0; i < count; ++i) {
        const float luminance = lx_luminance((lx_rgb){rgb[3 * i], rgb[3 * i + 1], rgb[3 * i + 2]});
        if (luminance > largest * 1e-4f) lit[lit_count++] = luminance;
    }
    qsort(lit, lit_count, sizeof *lit, compare_floats);
    *out_black = lit_count == 0;
    *out = lit_count ? log2f(0.8f / lit[lit_count - 1 - lit_count / 40]) : 0;
    lx_free(lit);
    return LX_OK;
}

static lx_result develop(const float *rgb, uint32_t width, uint32_t height, lx_image *out, bool *out_black, lx_error *error)
{
    lx_result result = LX_OK;
    float ev = 0;
    lx_render_desc desc = lx_render_desc_default();
    desc.width = width;
    desc.height = height;
    LX_TRY(bright_exposure(rgb, (size_t)width * height, &ev, out_black, error));
    LX_TRY(lx_image_create(width, height, 3, LX_PIXEL_U8, out, error));
    lx_render_develop(&desc, ev, rgb, out->u8);
cleanup:
    return result;
}

lx_result lx_report_page_picture(const lx_baked *baked, uint32_t page, uint32_t largest, lx_image *out, lx_error *error)
{
    lx_result result = LX_OK;
    float *rgb = NULL;
    bool black;
    uint32_t size;
    const uint32_t level = choose_level(baked, largest, &size);
    LX_TRY(compose(baked, page, level, size, &rgb, error));
    if (size > largest) {
        shrink(rgb, size, largest);
        size = largest;
    }
    LX_TRY(develop(rgb, size, size, out, &black, error));
cleanup:
    lx_free(rgb);
    return result;
}

lx_result lx_report_seen_picture(const lx_baked *baked, const lx_seen *seen, lx_image *out, bool *out_black, lx_error *error)
{
    float *rgb = lx_malloc_array((size_t)seen->width * seen->height, 3 * sizeof *rgb);
    if (!rgb) return lx_fail_memory(error, "report");
    lx_seen_light(seen, baked, rgb);
    lx_baked_rest(baked);
    const lx_result result = develop(rgb, seen->width, seen->height, out, out_black, error);
    lx_free(rgb);
    return result;
}

lx_result lx_report_brightest_page(const lx_baked *baked, uint32_t *out_page, lx_error *error)
{
    double most = -1;
    const uint32_t page_count = lx_baked_page_count(baked);
    *out_page = 0;
    for (uint32_t page = 0; page_count > 1 && page < page_count; ++page) {
        float *rgb = NULL;
        uint32_t size;
        const uint32_t level = choose_level(baked, 1, &size);
        const lx_result result = compose(baked, page, level, size, &rgb, error);
        if (result != LX_OK) return result;
        double sum = 0;
        for (size_t i = 0; i < 3 * (size_t)size * size; ++i) sum += (double)rgb[i];
        lx_free(rgb);
        if (sum > most) {
            most = sum;
            *out_page = page;
        }
    }
    return LX_OK;
}

void lx_report_swatch(const float rgb[3], char out[8])
{
    const float largest = fmaxf(rgb[0], fmaxf(rgb[1], rgb[2]));
    unsigned bytes[3] = {0};
    for (int i = 0; i < 3 && largest > 0; ++i)
        bytes[i] = (unsigned)(lx_linear_to_srgb(lx_clamp(rgb[i] / largest, 0, 1)) * 255 + 0.5f);
    snprintf(out, 8, "#%02x%02x%02x", bytes[0], bytes[1], bytes[2]);
}
