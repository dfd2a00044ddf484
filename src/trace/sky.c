#include "trace/sky.h"

#include "base/error.h"
#include "base/memory.h"

#include <string.h>

enum { max_columns = 1024 };

static lx_rgb fetch(const lx_image *image, int64_t x, int64_t y)
{
    const int64_t width = image->width, height = image->height;
    x = ((x % width) + width) % width;
    y = y < 0 ? 0 : y >= height ? height - 1 : y;
    const float *p = image->f32 + 3 * ((size_t)y * (size_t)width + (size_t)x);
    return (lx_rgb){p[0], p[1], p[2]};
}

// v from the top, u around; bilinear.
static lx_rgb lookup(const lx_image *image, float u, float v)
{
    const float x = u * (float)image->width - 0.5f, y = v * (float)image->height - 0.5f;
    const float x_floor = floorf(x), y_floor = floorf(y);
    const float fx = x - x_floor, fy = y - y_floor;
    const int64_t ix = (int64_t)x_floor, iy = (int64_t)y_floor;
    const lx_rgb top = lx_rgb_add(lx_rgb_scale(fetch(image, ix, iy), 1 - fx), lx_rgb_scale(fetch(image, ix + 1, iy), fx));
    const lx_rgb bottom =
        lx_rgb_add(lx_rgb_scale(fetch(image, ix, iy + 1), 1 - fx), lx_rgb_scale(fetch(image, ix + 1, iy + 1), fx));
    return lx_rgb_add(lx_rgb_scale(top, 1 - fy), lx_rgb_scale(bottom, fy));
}

// u = 1/2 + atan2(z, x) / 2 pi after undoing the rotation; v = angle from +Y over pi.
static void to_uv(const lx_sky *sky, lx_vec3 d, float *u, float *v)
{
    const float c = cosf(sky->rotation), s = sinf(sky->rotation);
    const float x = c * d.x - s * d.z, z = s * d.x + c * d.z;
    float around = 0.5f + atan2f(z, x) / (2 * LX_PI);
    around -= floorf(around);
    *u = around < 1 ? around : 0;
    *v = acosf(lx_clamp(d.y, -1, 1)) / LX_PI;
}

static lx_vec3 from_uv(const lx_sky *sky, float u, float v)
{
    const float phi = (u - 0.5f) * 2 * LX_PI, theta = v * LX_PI;
    const float sine = sinf(theta);
    const float x = sine * cosf(phi), z = sine * sinf(phi);
    const float c = cosf(sky->rotation), s = sinf(sky->rotation);
    return (lx_vec3){c * x + s * z, cosf(theta), -s * x + c * z};
}

lx_rgb lx_sky_radiance(const lx_sky *sky, lx_vec3 direction)
{
    if (!sky->present) return (lx_rgb){0, 0, 0};
    if (sky->image.width == 0) return (lx_rgb){1, 1, 1};
    float u, v;
    to_uv(sky, direction, &u, &v);
    return lookup(&sky->image, u, v);
}

// Solid angle of one cell of a row: 2 pi / columns times the difference of cosines.
static float cell_solid_angle(const lx_sky *sky, uint32_t row)
{
    const float top = (float)row / (float)sky->rows * LX_PI, bottom = (float)(row + 1) / (float)sky->rows * LX_PI;
    return 2 * LX_PI / (float)sky->columns * (cosf(top) - cosf(bottom));
}

static float cell_brightness(const lx_sky *sky, uint32_t column, uint32_t row)
{
    // The mean over the pixels that the cell covers, a pixel more on each side because lookups are bilinear.
    const lx_image *image = &sky->image;
    const int64_t x0 = (int64_t)column * image->width / sky->columns - 1;
    const int64_t x1 = ((int64_t)column + 1) * image->width / sky->columns + 1;
    const int64_t y0 = (int64_t)row * image->height / sky->rows - 1, y1 = ((int64_t)row + 1) * image->height / sky->rows + 1;
    double sum = 0;
    for (int64_t y = y0; y < y1; ++y)
        for (int64_t x = x0; x < x1; ++x) {
            const lx_rgb p = fetch(image, x, y);
            sum += (double)(p.r + p.g + p.b);
        }
    return (float)(sum / (double)((x1 - x0) * (y1 - y0)));
}

static lx_result build_tables(lx_sky *sky, lx_error *error)
{
    sky->columns = sky->image.width < max_columns ? sky->image.width : max_columns;
    sky->rows = sky->image.height < max_columns / 2 ? sky->image.height : max_columns / 2;
    sky->row_cdf = lx_calloc_array(sky->rows + 1, sizeof(float));
    sky->cell_cdf = lx_calloc_array((size_t)sky->rows * (sky->columns + 1), sizeof(float));
    if (!sky->row_cdf || !sky->cell_cdf) return lx_fail_memory(error, "sky");
    double total = 0;
    for (uint32_t row = 0; row < sky->rows; ++row) {
        float *cdf = sky->cell_cdf + (size_t)row * (sky->columns + 1);
        const double solid_angle = (double)cell_solid_angle(sky, row);
        double sum = 0;
        for (uint32_t column = 0; column < sky->columns; ++column) {
            sum += (double)cell_brightness(sky, column, row) * solid_angle;
            cdf[column + 1] = (float)sum;
        }
        for (uint32_t column = 1; column <= sky->columns; ++column)
            cdf[column] = sum > 0 ? (float)((double)cdf[column] / sum) : (float)column / (float)sky->columns;
        total += sum;
        sky->row_cdf[row + 1] = (float)total;
    }
    for (uint32_t row = 1; row <= sky->rows; ++row)
        sky->row_cdf[row] = total > 0 ? (float)((double)sky->row_cdf[row] / total) : (float)row / (float)sky->rows;
    return LX_OK;
}

static lx_result keep_rgb(lx_image *image, lx_error *error)
{
    lx_image rgb;
    const lx_result result = lx_image_create(image->width, image->height, 3, LX_PIXEL_F32, &rgb, error);
    if (result != LX_OK) return result;
    const size_t count = (size_t)image->width * image->height;
    bool bad = false;
    for (size_t i = 0; i < count; ++i)
        for (uint32_t c = 0; c < 3; ++c) {
            const float value = image->f32[i * image->channels + (image->channels >= 3 ? c : 0)];
            const bool good = value >= 0 && value < INFINITY;
            bad |= !good && !(value < 0);
            rgb.f32[i * 3 + c] = good ? value : 0;
        }
    lx_image_release(image);
    *image = rgb;
    if (bad) return lx_fail(error, LX_ERROR_FORMAT, "sky picture has pixels that are not finite");
    return LX_OK;
}

lx_result lx_sky_load(const lx_sky_desc *desc, lx_sky *out, lx_error *error)
{
    lx_result result = LX_OK;
    lx_sky sky = {.rotation = desc->rotation_deg * LX_PI / 180};
    if (!desc->file) {
        sky.present = desc->color[0] > 0 || desc->color[1] > 0 || desc->color[2] > 0;
        *out = sky;
        return LX_OK;
    }
    sky.present = true;
    result = lx_image_load(desc->file, &sky.image, error);
    if (result != LX_OK) {
        lx_error_prefix(error, "%s", desc->file);
        return result;
    }
    if (sky.image.type != LX_PIXEL_F32) {
        result = lx_fail(error, LX_ERROR_FORMAT, "%s: a sky must be a .hdr or .exr picture", desc->file);
        goto cleanup;
    }
    result = keep_rgb(&sky.image, error);
    if (result != LX_OK) {
        lx_error_prefix(error, "%s", desc->file);
        goto cleanup;
    }
    LX_TRY(build_tables(&sky, error));
    *out = sky;
    sky = (lx_sky){0};
cleanup:
    lx_sky_release(&sky);
    return result;
}

void lx_sky_release(lx_sky *sky)
{
    lx_image_release(&sky->image);
    lx_free(sky->row_cdf);
    lx_free(sky->cell_cdf);
    *sky = (lx_sky){0};
}

bool lx_sky_has_samples(const lx_sky *sky)
{
    return sky->present && sky->image.width != 0;
}

bool lx_sky_is_uniform(const lx_sky *sky)
{
    return sky->present && sky->image.width == 0;
}

// Largest i with cdf[i] <= u, i < count; u is rescaled to its place within the step.
static uint32_t find_step(const float *cdf, uint32_t count, float *u)
{
    uint32_t low = 0, high = count;
    while (high - low > 1) {
        const uint32_t middle = (low + high) / 2;
        if (cdf[middle] <= *u)
            low = middle;
        else
            high = middle;
    }
    const float width = cdf[low + 1] - cdf[low];
    *u = width > 0 ? lx_clamp((*u - cdf[low]) / width, 0, 0x1.fffffep-1f) : 0.5f;
    return low;
}

static float cell_pdf(const lx_sky *sky, uint32_t column, uint32_t row)
{
    const float *cdf = sky->cell_cdf + (size_t)row * (sky->columns + 1);
    const float share = (sky->row_cdf[row + 1] - sky->row_cdf[row]) * (cdf[column + 1] - cdf[column]);
    return share / cell_solid_angle(sky, row);
}

lx_vec3 lx_sky_sample(const lx_sky *sky, lx_vec2 u, float *pdf_solid_angle)
{
    const uint32_t row = find_step(sky->row_cdf, sky->rows, &u.y);
    const uint32_t column = find_step(sky->cell_cdf + (size_t)row * (sky->columns + 1), sky->columns, &u.x);
    *pdf_solid_angle = cell_pdf(sky, column, row);
    const float top = cosf((float)row / (float)sky->rows * LX_PI), bottom = cosf((float)(row + 1) / (float)sky->rows * LX_PI);
    const float theta = acosf(lx_clamp(top + u.y * (bottom - top), -1, 1));
    return from_uv(sky, ((float)column + u.x) / (float)sky->columns, theta / LX_PI);
}

float lx_sky_pdf(const lx_sky *sky, lx_vec3 direction)
{
    float u, v;
    to_uv(sky, direction, &u, &v);
    uint32_t column = (uint32_t)(u * (float)sky->columns), row = (uint32_t)(v * (float)sky->rows);
    if (column >= sky->columns) column = sky->columns - 1;
    if (row >= sky->rows) row = sky->rows - 1;
    return cell_pdf(sky, column, row);
}
