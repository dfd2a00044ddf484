// An opened pack, as the files of this folder share it. Layout of the data: docs/pack-format.md.
#ifndef LXRT_RT_PACK_H
#define LXRT_RT_PACK_H

#include "luxel_rt.h"
#include "rt_kernel.h"

#include <string.h>

enum {
    lxrt_block_size = 32,
    lxrt_block_bytes = lxrt_block_size * lxrt_block_size * 4,
    lxrt_max_levels = 15, // 16384 texels and their mips
};

// The largest factor a texel is multiplied by: sums of a million layers at that and at 65408 stay finite.
#define LXRT_MAX_FACTOR 1e27f

// A table: elements of at least the size we know, `stride` apart.
typedef struct lxrt_table {
    const unsigned char *data;
    uint32_t count, stride;
} lxrt_table;

// c of a layer, and that times its scale: what a stored texel is multiplied by.
typedef struct lxrt_color {
    float color[3];
    float factor[3];
} lxrt_color;

struct lxrt_driver;
struct lxrt_animation_state;
struct lxrt_monitor_state;
struct lxrt_pixel_block;

struct lxrt_pack {
    uint32_t page_size, page_count, layer_count, level_count;
    lxrt_table pages, layers, strings, rects, sources, monitors, animations, animation_keys;
    const unsigned char *block_index;
    const unsigned char *blocks;
    uint32_t block_count;
    uint32_t level_first[lxrt_max_levels + 1]; // of a layer's page: where each level's entries begin; the last is their number
    lxrt_color *colors;                        // [layer_count]
    struct lxrt_driver *drivers;               // [layer_count], rt_drive.h
    struct lxrt_animation_state *animation_states; // [animations.count], rt_drive.h
    struct lxrt_monitor_state *monitor_states; // [monitors.count], rt_monitor.h
    void (*pixel_sum)(const struct lxrt_pixel_block *block, uint64_t sums[3]); // for this processor, rt_pixels.h
    uint64_t file_bytes;
    size_t handle_bytes;
    lxrt_kernel kernel; // of the composer
};

// Little-endian numbers at any address. Compilers turn these into plain loads.
static inline uint32_t lxrt_load_u32(const unsigned char *p)
{
    return (uint32_t)p[0] | (uint32_t)p[1] << 8 | (uint32_t)p[2] << 16 | (uint32_t)p[3] << 24;
}

static inline uint64_t lxrt_load_u64(const unsigned char *p)
{
    return (uint64_t)lxrt_load_u32(p) | (uint64_t)lxrt_load_u32(p + 4) << 32;
}

static inline float lxrt_load_f32(const unsigned char *p)
{
    const uint32_t bits = lxrt_load_u32(p);
    float value;
    memcpy(&value, &bits, sizeof value);
    return value;
}

static inline const unsigned char *lxrt_element(const lxrt_table *table, uint32_t index)
{
    return table->data + (size_t)index * table->stride;
}

// The text that a name in a table, an offset into the strings and a length, refers to.
static inline const char *lxrt_name(const lxrt_pack *pack, const unsigned char *reference)
{
    return (const char *)pack->strings.data + lxrt_load_u32(reference);
}

static inline uint32_t lxrt_level_size(const lxrt_pack *pack, uint32_t level)
{
    return pack->page_size >> level;
}

static inline uint32_t lxrt_blocks_across(uint32_t size)
{
    return (size + lxrt_block_size - 1) / lxrt_block_size;
}

// Texels of a block, NULL if it is absent.
static inline const unsigned char *lxrt_find_block(const lxrt_pack *pack, uint32_t page, uint32_t layer, uint32_t level,
                                                   uint32_t block_x, uint32_t block_y)
{
    const size_t image = (size_t)page * pack->layer_count + layer;
    const size_t entry = image * pack->level_first[pack->level_count] + pack->level_first[level] +
                         (size_t)block_y * lxrt_blocks_across(lxrt_level_size(pack, level)) + block_x;
    const uint32_t number = lxrt_load_u32(pack->block_index + 4 * entry);
    return number == 0 ? NULL : pack->blocks + (size_t)(number - 1) * lxrt_block_bytes;
}

static inline int lxrt_is_black(const float rgb[3])
{
    return rgb[0] == 0 && rgb[1] == 0 && rgb[2] == 0;
}

// rgb += texel × factor. Mantissas and the power of two are exact in a float; the product and the sum round once each.
static inline void lxrt_add_texel(uint32_t texel, const float factor[3], float rgb[3])
{
    const uint32_t power_bits = ((texel >> 27) + 127 - 24) << 23; // 2^(e - 24)
    float power;
    memcpy(&power, &power_bits, sizeof power);
    rgb[0] += (float)(int32_t)(texel & 511) * power * factor[0];
    rgb[1] += (float)(int32_t)(texel >> 9 & 511) * power * factor[1];
    rgb[2] += (float)(int32_t)(texel >> 18 & 511) * power * factor[2];
}

#endif
