/// Packs put together byte by byte after docs/pack-format.md, without our writer: one page without texels, any layers, monitors and animations.
#ifndef RUNTIME_MAKER_H
#define RUNTIME_MAKER_H

#include "luxel_rt.h"

#include <stdlib.h>
#include <string.h>

typedef struct made_layer {
    float color[3], intensity;
    float scale; // 0: 1
} made_layer;

typedef struct made_monitor {
    uint32_t columns, rows, first_layer;
    float strength[3];
} made_monitor;

typedef struct made_animation {
    const char *name;
    uint32_t layer, channel;
    lxrt_program program; // with its keys
} made_animation;

typedef struct made_desc {
    const made_layer *layers; // NULL: all white, 1
    uint32_t layer_count;
    const made_monitor *monitors;
    uint32_t monitor_count;
    const made_animation *animations;
    uint32_t animation_count;
} made_desc;

typedef struct made_pack {
    uint8_t *bytes;
    size_t size;
    size_t monitors_at, animations_at, keys_at;
    lxrt_pack *pack; // made_open
    void *memory;
} made_pack;

enum { made_directory_at = 64, made_section_count = 8 };
// Entries of the directory, in their order.
enum { made_page, made_layers, made_strings, made_index, made_blocks, made_monitors, made_animations, made_keys };

static inline void made_put_u32(made_pack *made, size_t at, uint32_t value)
{
    for (size_t i = 0; i < 4; ++i) made->bytes[at + i] = (uint8_t)(value >> (8 * i));
}

static inline void made_put_f32(made_pack *made, size_t at, float value)
{
    uint32_t bits;
    memcpy(&bits, &value, 4);
    made_put_u32(made, at, bits);
}

// A section at the next multiple of `alignment`, zeroed; returns where.
static inline size_t made_add(made_pack *made, int entry, const char *type, size_t count, uint32_t stride, size_t alignment)
{
    const size_t offset = (made->size + alignment - 1) / alignment * alignment, at = made_directory_at + 32 * (size_t)entry;
    const size_t size = offset + count * stride;
    made->bytes = realloc(made->bytes, size);
    memset(made->bytes + made->size, 0, size - made->size);
    made->size = size;
    memcpy(made->bytes + at, type, 4);
    made_put_u32(made, at + 4, 1);
    made_put_u32(made, at + 8, (uint32_t)offset);
    made_put_u32(made, at + 16, (uint32_t)(count * stride));
    made_put_u32(made, at + 24, (uint32_t)count);
    made_put_u32(made, at + 28, stride);
    return offset;
}

static inline uint32_t made_key_stride(const made_animation *animation)
{
    const int cubic = animation->program.kind == LXRT_PROGRAM_KEYS && animation->program.interpolation == LXRT_CUBIC;
    return 1 + (animation->channel == 2 ? 1 : 3) * (cubic ? 3 : 1);
}

static inline void made_put_animation(made_pack *made, size_t at, const made_animation *from, uint32_t name, uint32_t first_key)
{
    const lxrt_program *p = &from->program;
    const float floats[] = {p->color[0], p->color[1], p->color[2], p->intensity, p->period_s, p->phase_s, p->duty, p->low, p->high, p->fade_s};
    made_put_u32(made, at, name);
    made_put_u32(made, at + 4, (uint32_t)strlen(from->name));
    made_put_u32(made, at + 8, from->layer);
    made_put_u32(made, at + 12, (uint32_t)p->kind);
    made_put_u32(made, at + 16, from->channel);
    made_put_u32(made, at + 20, (uint32_t)p->interpolation);
    made_put_u32(made, at + 24, first_key);
    made_put_u32(made, at + 28, p->key_count);
    for (size_t k = 0; k < 10; ++k) made_put_f32(made, at + 32 + 4 * k, floats[k]);
    made_put_u32(made, at + 72, p->seed);
    made_put_u32(made, at + 76, p->loop != 0);
}

static inline made_pack made_create(const made_desc *desc)
{
    made_pack made = {.size = made_directory_at + 32 * made_section_count};
    size_t key_count = 0, text_bytes = 3;
    made.bytes = calloc(made.size, 1);
    memcpy(made.bytes, "luxelpak", 8);
    made_put_u32(&made, 8, 1);
    made_put_u32(&made, 12, 64);
    made_put_u32(&made, 24, 32);
    made_put_u32(&made, 28, 1);
    made_put_u32(&made, 32, desc->layer_count);
    made_put_u32(&made, 36, 1);
    made_put_u32(&made, 40, 32);
    made_put_u32(&made, 44, made_section_count);
    made_put_u32(&made, 48, made_directory_at);
    const size_t page = made_add(&made, made_page, "PAGE", 1, 16, 64);
    made_put_u32(&made, page, 32);
    made_put_u32(&made, page + 4, 32);

    const size_t layers = made_add(&made, made_layers, "LAYR", desc->layer_count, 48, 64);
    for (uint32_t i = 0; i < desc->layer_count; ++i) {
        const made_layer layer = desc->layers ? desc->layers[i] : (made_layer){{1, 1, 1}, 1, 1};
        const size_t at = layers + 48 * (size_t)i;
        for (size_t k = 0; k < 3; ++k) made_put_f32(&made, at + 8 + 4 * k, layer.color[k]);
        made_put_f32(&made, at + 20, layer.intensity);
        made_put_f32(&made, at + 24, layer.scale == 0 ? 1 : layer.scale);
    }
    made.monitors_at = made_add(&made, made_monitors, "MONI", desc->monitor_count, 48, 64);
    for (uint32_t i = 0; i < desc->monitor_count; ++i) {
        const made_monitor *from = &desc->monitors[i];
        const size_t at = made.monitors_at + 48 * (size_t)i;
        made_put_u32(&made, at, 1); // "tv"
        made_put_u32(&made, at + 4, 2);
        made_put_u32(&made, at + 8, 7 + i);
        made_put_u32(&made, at + 12, UINT32_MAX);
        made_put_u32(&made, at + 16, from->columns);
        made_put_u32(&made, at + 20, from->rows);
        made_put_u32(&made, at + 24, from->first_layer);
        for (size_t k = 0; k < 3; ++k) made_put_f32(&made, at + 28 + 4 * k, from->strength[k]);
    }
    for (uint32_t i = 0; i < desc->animation_count; ++i) {
        key_count += desc->animations[i].program.key_count * made_key_stride(&desc->animations[i]);
        text_bytes += strlen(desc->animations[i].name) + 1;
    }
    made.keys_at = made_add(&made, made_keys, "AKEY", key_count, 4, 64);
    made.animations_at = made_add(&made, made_animations, "ANIM", desc->animation_count, 80, 64);
    const size_t strings = made_add(&made, made_strings, "STRS", text_bytes + 1, 1, 64);
    memcpy(made.bytes + strings, "\0tv", 4);
    uint32_t first_key = 0, name = 4;
    for (uint32_t i = 0; i < desc->animation_count; ++i) {
        const made_animation *from = &desc->animations[i];
        const uint32_t numbers = from->program.key_count * made_key_stride(from);
        memcpy(made.bytes + strings + name, from->name, strlen(from->name) + 1);
        made_put_animation(&made, made.animations_at + 80 * (size_t)i, from, name, first_key);
        for (uint32_t k = 0; k < numbers; ++k) made_put_f32(&made, made.keys_at + 4 * (size_t)(first_key + k), from->program.keys[k]);
        first_key += numbers;
        name += (uint32_t)strlen(from->name) + 1;
    }
    made_add(&made, made_index, "BIDX", desc->layer_count, 4, 64);
    made_add(&made, made_blocks, "BLKS", 0, 4096, 4096);
    made_put_u32(&made, 16, (uint32_t)made.size);
    return made;
}

// What lxrt_open says to the bytes; made->pack is NULL unless it is LXRT_OK.
static inline lxrt_result made_open(made_pack *made)
{
    size_t needed = 0;
    free(made->memory);
    made->memory = NULL;
    made->pack = NULL;
    const lxrt_result result = lxrt_memory_bytes(made->bytes, made->size, &needed);
    if (result != LXRT_OK) return result;
    made->memory = malloc(needed);
    return lxrt_open(made->bytes, made->size, made->memory, needed, &made->pack);
}

static inline void made_release(made_pack *made)
{
    free(made->bytes);
    free(made->memory);
    *made = (made_pack){0};
}

#endif
