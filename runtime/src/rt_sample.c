// Irradiance at a point: the texels around it, summed as the composer sums them, and a filter over those.
#include "rt_pack.h"

#include <math.h>

// Up to four neighbouring texels along one axis, clamped to the page, and their weights.
typedef struct taps {
    uint32_t texels[4];
    float weights[4];
} taps;

// `coordinate` × size - ½ is the place between texel centres. NaN counts as 0.
static float place_of(float coordinate, uint32_t size)
{
    if (!(coordinate > 0)) coordinate = 0;
    if (coordinate > 1) coordinate = 1;
    return coordinate * (float)size - 0.5f;
}

static uint32_t clamp_texel(int32_t texel, uint32_t size)
{
    return texel < 0 ? 0 : (uint32_t)texel < size ? (uint32_t)texel : size - 1;
}

static void linear_taps(float coordinate, uint32_t size, taps *out)
{
    const float place = place_of(coordinate, size), first = floorf(place), t = place - first;
    for (int32_t i = 0; i < 2; ++i) out->texels[i] = clamp_texel((int32_t)first + i, size);
    out->weights[0] = 1 - t;
    out->weights[1] = t;
}

// The uniform cubic B-spline: its four weights are never negative and add up to 1.
static void cubic_taps(float coordinate, uint32_t size, taps *out)
{
    const float place = place_of(coordinate, size), first = floorf(place), t = place - first, s = 1 - t;
    for (int32_t i = 0; i < 4; ++i) out->texels[i] = clamp_texel((int32_t)first - 1 + i, size);
    out->weights[0] = s * s * s / 6;
    out->weights[1] = (4 - 3 * t * t * (2 - t)) / 6;
    out->weights[2] = (4 - 3 * s * s * (2 - s)) / 6;
    out->weights[3] = t * t * t / 6;
}

lxrt_result lxrt_lightmap_sample(const lxrt_pack *pack, uint32_t page, float u, float v, lxrt_filter filter, float out_rgb[3])
{
    if (!pack || !out_rgb || page >= pack->page_count || (unsigned)filter > LXRT_FILTER_BICUBIC) return LXRT_ERROR_INVALID_ARGUMENT;
    const int across = filter == LXRT_FILTER_BILINEAR ? 2 : 4;
    taps column, row;
    (filter == LXRT_FILTER_BILINEAR ? linear_taps : cubic_taps)(u, pack->page_size, &column);
    (filter == LXRT_FILTER_BILINEAR ? linear_taps : cubic_taps)(v, pack->page_size, &row);

    float sums[16][3] = {{0}};
    for (uint32_t layer = 0; layer < pack->layer_count; ++layer) {
        const float *factor = pack->colors[layer].factor;
        if (lxrt_is_black(factor)) continue;
        for (int j = 0; j < across; ++j) {
            const unsigned char *block = NULL;
            for (int i = 0; i < across; ++i) {
                const uint32_t x = column.texels[i], y = row.texels[j];
                if (i == 0 || x / lxrt_block_size != column.texels[i - 1] / lxrt_block_size)
                    block = lxrt_find_block(pack, page, layer, 0, x / lxrt_block_size, y / lxrt_block_size);
                if (!block) continue;
                const size_t texel = (size_t)(y % lxrt_block_size) * lxrt_block_size + x % lxrt_block_size;
                lxrt_add_texel(lxrt_load_u32(block + 4 * texel), factor, sums[across * j + i]);
            }
        }
    }
    for (int k = 0; k < 3; ++k) {
        float filtered = 0;
        for (int j = 0; j < across; ++j) {
            float along = 0;
            for (int i = 0; i < across; ++i) along += sums[across * j + i][k] * column.weights[i];
            filtered += along * row.weights[j];
        }
        out_rgb[k] = filtered;
    }
    return LXRT_OK;
}
