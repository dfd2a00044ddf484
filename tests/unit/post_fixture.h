// A page of luxels made by hand: charts of any shape, each on a plane of its own.
#ifndef POST_FIXTURE_H
#define POST_FIXTURE_H

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include "math/hash.h"
#include "post/dilate.h"
#include "post/luxel_map.h"

#include <stdlib.h>
#include <string.h>

enum { page_edge = 64, page_texels = page_edge * page_edge };

static uint32_t luxel_texel[page_texels], luxel_index[page_texels], luxel_chart[page_texels];
static lx_vec3 luxel_position[page_texels], luxel_normal[page_texels];
static float luxel_size[page_texels];
static uint8_t luxel_valid[page_texels];
static lx_luxel_map map;

static void map_clear(void)
{
    memset(luxel_index, 0xff, sizeof luxel_index);
    map = (lx_luxel_map){.page_size = page_edge, .page_count = 1, .texel = luxel_texel, .index = luxel_index, .chart = luxel_chart,
                         .position = luxel_position, .normal = luxel_normal, .size_m = luxel_size, .valid = luxel_valid};
}

// A rectangle of texels with texel (0, 0) of the rectangle at `origin`, and `right` and `down` per texel. Charts are added one below the other's end.
static void map_add(uint32_t chart, uint32_t x0, uint32_t y0, uint32_t width, uint32_t height, lx_vec3 origin, lx_vec3 right, lx_vec3 down)
{
    for (uint32_t y = y0; y < y0 + height; ++y)
        for (uint32_t x = x0; x < x0 + width; ++x) {
            const uint32_t i = map.count++;
            luxel_texel[i] = y * page_edge + x;
            luxel_index[luxel_texel[i]] = i;
            luxel_chart[i] = chart;
            luxel_position[i] = lx_mad(lx_mad(origin, right, (float)(x - x0)), down, (float)(y - y0));
            luxel_normal[i] = lx_normalize(lx_cross(down, right));
            luxel_size[i] = lx_length(right);
            luxel_valid[i] = 1;
        }
}

// Uniform in 0…1, a function of its arguments.
static inline float random_of(uint32_t seed, uint32_t i) { return (float)(lx_hash32(seed * 0x9e3779b9u ^ lx_hash32(i)) >> 8) / (float)(1 << 24); }

// Nearly normal with unit variance: a sum of twelve.
static inline float normal_of(uint32_t seed, uint32_t i)
{
    float sum = -6;
    for (uint32_t k = 0; k < 12; ++k) sum += random_of(seed + 97 * k, i);
    return sum;
}

#endif
