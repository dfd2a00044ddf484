// The composer: E = Σ c_i T_i, block by block. Absent blocks and black layers are skipped; what is left is added in layer order.
#include "rt_pack.h"

#include <math.h>

// The part of a rectangle that lies in one block.
typedef struct block_part {
    uint32_t x0, y0, x1, y1; // within the block, ends excluded
    float *rgb;              // of (x0, y0)
    size_t row_stride;
} block_part;

static void clear_part(const block_part *part)
{
    for (uint32_t y = part->y0; y < part->y1; ++y)
        memset(part->rgb + (y - part->y0) * part->row_stride, 0, 3 * (size_t)(part->x1 - part->x0) * sizeof *part->rgb);
}

static void add_part(const block_part *part, const unsigned char *block, const float factor[3])
{
    for (uint32_t y = part->y0; y < part->y1; ++y) {
        float *rgb = part->rgb + (y - part->y0) * part->row_stride;
        const unsigned char *texel = block + 4 * (size_t)(y * lxrt_block_size + part->x0);
        for (uint32_t x = part->x0; x < part->x1; ++x, texel += 4, rgb += 3) lxrt_add_texel(lxrt_load_u32(texel), factor, rgb);
    }
}

static uint32_t least(uint32_t a, uint32_t b)
{
    return a < b ? a : b;
}

size_t lxrt_format_bytes(lxrt_format format)
{
    return format == LXRT_FORMAT_RGB32F ? 12 : format == LXRT_FORMAT_RGBA16F ? 8 : 4;
}

lxrt_result lxrt_compose(const lxrt_pack *pack, const lxrt_region *region, const lxrt_target *target)
{
    const uint32_t page = region->page, level = region->level, x = region->x, y = region->y, width = region->width, height = region->height;
    if (page >= pack->page_count || level >= pack->level_count) return LXRT_ERROR_INVALID_ARGUMENT;
    const uint32_t size = lxrt_level_size(pack, level);
    if (x > size || width > size - x || y > size || height > size - y) return LXRT_ERROR_INVALID_ARGUMENT;
    if (target->format != LXRT_FORMAT_RGB32F || target->scale != 1) return LXRT_ERROR_INVALID_ARGUMENT;
    float *const out_rgb = target->texels;
    const size_t row_stride = target->row_bytes ? target->row_bytes / sizeof(float) : 3 * (size_t)width;
    if (row_stride < 3 * (size_t)width) return LXRT_ERROR_INVALID_ARGUMENT;
    if (width == 0 || height == 0) return LXRT_OK;
    if (!out_rgb) return LXRT_ERROR_INVALID_ARGUMENT;

    for (uint32_t row = y; row < y + height;) {
        const uint32_t block_y = row / lxrt_block_size, row_end = least(y + height, (block_y + 1) * lxrt_block_size);
        for (uint32_t column = x; column < x + width;) {
            const uint32_t block_x = column / lxrt_block_size, column_end = least(x + width, (block_x + 1) * lxrt_block_size);
            const block_part part = {
                .x0 = column - block_x * lxrt_block_size,
                .y0 = row - block_y * lxrt_block_size,
                .x1 = column_end - block_x * lxrt_block_size,
                .y1 = row_end - block_y * lxrt_block_size,
                .rgb = out_rgb + (row - y) * row_stride + 3 * (size_t)(column - x),
                .row_stride = row_stride,
            };
            clear_part(&part);
            for (uint32_t layer = 0; layer < pack->layer_count; ++layer) {
                const float *factor = pack->colors[layer].factor;
                if (lxrt_is_black(factor)) continue;
                const unsigned char *block = lxrt_find_block(pack, page, layer, level, block_x, block_y);
                if (block) add_part(&part, block, factor);
            }
            column = column_end;
        }
        row = row_end;
    }
    return LXRT_OK;
}

// Texels on both sides of a coordinate, and the weight of the second. NaN counts as 0.
static void split_coordinate(float coordinate, uint32_t size, uint32_t *first, uint32_t *second, float *weight)
{
    const float at = coordinate * (float)size - 0.5f;
    if (!(at > 0)) {
        *first = *second = 0;
        *weight = 0;
    } else if (at >= (float)(size - 1)) {
        *first = *second = size - 1;
        *weight = 0;
    } else {
        *first = (uint32_t)at;
        *second = *first + 1;
        *weight = at - (float)*first;
    }
}

lxrt_result lxrt_lightmap_sample(const lxrt_pack *pack, uint32_t page, float u, float v, lxrt_filter filter, float out_rgb[3])
{
    (void)filter;
    if (page >= pack->page_count) return LXRT_ERROR_INVALID_ARGUMENT;
    uint32_t x[2], y[2];
    float weight_x, weight_y, texels[4][3];
    split_coordinate(u, pack->page_size, &x[0], &x[1], &weight_x);
    split_coordinate(v, pack->page_size, &y[0], &y[1], &weight_y);
    for (int i = 0; i < 4; ++i) {
        const lxrt_result result = lxrt_compose(pack, &(lxrt_region){page, 0, x[i & 1], y[i >> 1], 1, 1},
                                                &(lxrt_target){texels[i], 0, LXRT_FORMAT_RGB32F, 1});
        if (result != LXRT_OK) return result;
    }
    for (int k = 0; k < 3; ++k) {
        const float top = texels[0][k] + (texels[1][k] - texels[0][k]) * weight_x;
        const float bottom = texels[2][k] + (texels[3][k] - texels[2][k]) * weight_x;
        out_rgb[k] = top + (bottom - top) * weight_y;
    }
    return LXRT_OK;
}
