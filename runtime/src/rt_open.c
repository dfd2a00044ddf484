// Opening a pack: everything that hostile data could get wrong is checked here, once, so that the rest may trust the tables.
// Layout: docs/pack-format.md.
#include "rt_drive.h"
#include "rt_monitor.h"
#include "rt_pack.h"

#include <math.h>

enum {
    header_bytes = 64,
    entry_bytes = 32, // of the directory
    max_page_size = 16384,
    max_page_count = 65536,
    max_layer_count = 1 << 20,
    max_section_count = 65536,
    page_bytes = 16,
    layer_bytes = 48,
    rect_bytes = 48,
    source_bytes = 40,
    monitor_bytes = 48,
    animation_bytes = 80,
    max_monitor_edge = 4096,
    memory_alignment = 16,
};

#define MAX_SCALE 0x1p100f

const char *lxrt_result_name(lxrt_result result)
{
    switch (result) {
    case LXRT_OK: return "ok";
    case LXRT_ERROR_INVALID_ARGUMENT: return "invalid argument";
    case LXRT_ERROR_MEMORY_TOO_SMALL: return "memory too small";
    case LXRT_ERROR_NOT_A_PACK: return "not a pack";
    case LXRT_ERROR_VERSION: return "unknown version";
    case LXRT_ERROR_TRUNCATED: return "truncated";
    case LXRT_ERROR_CORRUPT: return "corrupt";
    case LXRT_ERROR_NOT_FOUND: return "not found";
    }
    return "unknown result";
}

// What is being opened.
typedef struct input {
    const unsigned char *data;
    uint64_t size; // file_bytes of the header, at most what we were given
} input;

static lxrt_result read_header(input *in, lxrt_pack *pack, uint32_t *section_count, uint64_t *section_offset)
{
    static const char magic[8] = {'l', 'u', 'x', 'e', 'l', 'p', 'a', 'k'};
    const uint64_t given = in->size;
    const size_t compared = given < sizeof magic ? (size_t)given : sizeof magic;
    if (compared == 0 || memcmp(in->data, magic, compared) != 0) return LXRT_ERROR_NOT_A_PACK;
    if (given < 12) return LXRT_ERROR_TRUNCATED;
    if (lxrt_load_u32(in->data + 8) != 1) return LXRT_ERROR_VERSION;
    if (given < header_bytes) return LXRT_ERROR_TRUNCATED;
    if (lxrt_load_u32(in->data + 12) != header_bytes) return LXRT_ERROR_CORRUPT;
    in->size = lxrt_load_u64(in->data + 16);
    if (in->size > given) return LXRT_ERROR_TRUNCATED;

    pack->page_size = lxrt_load_u32(in->data + 24);
    pack->page_count = lxrt_load_u32(in->data + 28);
    pack->layer_count = lxrt_load_u32(in->data + 32);
    pack->level_count = lxrt_load_u32(in->data + 36);
    *section_count = lxrt_load_u32(in->data + 44);
    *section_offset = lxrt_load_u64(in->data + 48);
    if (in->size < header_bytes || pack->page_size < 1 || pack->page_size > max_page_size || pack->page_count > max_page_count ||
        pack->layer_count > max_layer_count || pack->level_count < 1 || pack->level_count > lxrt_max_levels ||
        pack->page_size >> (pack->level_count - 1) == 0 || lxrt_load_u32(in->data + 40) != lxrt_block_size ||
        *section_count > max_section_count)
        return LXRT_ERROR_CORRUPT;
    if (*section_offset > in->size || in->size - *section_offset < (uint64_t)*section_count * entry_bytes) return LXRT_ERROR_CORRUPT;

    uint32_t entries = 0;
    for (uint32_t level = 0; level < pack->level_count; ++level) {
        const uint32_t across = lxrt_blocks_across(lxrt_level_size(pack, level));
        pack->level_first[level] = entries;
        entries += across * across; // at most 512² + 256² + … < 2^19
    }
    pack->level_first[pack->level_count] = entries;
    return LXRT_OK;
}

// The section of a type as a table of elements of at least `element_bytes`. A missing one is an error only if `required`.
static lxrt_result find_section(const input *in, uint32_t section_count, uint64_t section_offset, const char *type, uint32_t element_bytes,
                                int required, lxrt_table *out)
{
    *out = (lxrt_table){in->data, 0, element_bytes};
    int found = 0;
    for (uint32_t i = 0; i < section_count; ++i) {
        const unsigned char *entry = in->data + section_offset + (uint64_t)i * entry_bytes;
        if (memcmp(entry, type, 4) != 0) continue;
        if (found) return LXRT_ERROR_CORRUPT;
        found = 1;
        if (lxrt_load_u32(entry + 4) != 1) return LXRT_ERROR_VERSION;
        const uint64_t offset = lxrt_load_u64(entry + 8), bytes = lxrt_load_u64(entry + 16);
        const uint32_t count = lxrt_load_u32(entry + 24), stride = lxrt_load_u32(entry + 28);
        if (offset > in->size || bytes > in->size - offset || stride < element_bytes || (uint64_t)count * stride > bytes)
            return LXRT_ERROR_CORRUPT;
        *out = (lxrt_table){in->data + offset, count, stride};
    }
    return found || !required ? LXRT_OK : LXRT_ERROR_CORRUPT;
}

static int are_finite(const unsigned char *floats, int count)
{
    for (int i = 0; i < count; ++i)
        if (!isfinite(lxrt_load_f32(floats + 4 * i))) return 0;
    return 1;
}

// A name is an offset into the strings and a length, and a 0 follows it.
static int is_name(const lxrt_pack *pack, const unsigned char *reference)
{
    const uint64_t end = (uint64_t)lxrt_load_u32(reference) + lxrt_load_u32(reference + 4);
    return end < pack->strings.count && pack->strings.data[end] == 0;
}

static int is_scale(float scale)
{
    int exponent;
    return scale >= 1 / MAX_SCALE && scale <= MAX_SCALE && frexpf(scale, &exponent) == 0.5f;
}

// Colour × scale of a layer, if all is within what we can sum.
static int color_factors(const float color[3], float scale, float out_factor[3])
{
    for (int i = 0; i < 3; ++i) {
        out_factor[i] = color[i] * scale;
        if (!(fabsf(color[i]) <= LXRT_MAX_FACTOR && fabsf(out_factor[i]) <= LXRT_MAX_FACTOR)) return 0; // NaN fails too
    }
    return 1;
}

static int read_authored_color(const unsigned char *layer, lxrt_color *out)
{
    const float intensity = lxrt_load_f32(layer + 20);
    for (int i = 0; i < 3; ++i) out->color[i] = lxrt_load_f32(layer + 8 + 4 * i) * intensity;
    return color_factors(out->color, lxrt_load_f32(layer + 24), out->factor);
}

static int check_pages(const lxrt_pack *pack)
{
    for (uint32_t i = 0; i < pack->pages.count; ++i) {
        const unsigned char *page = lxrt_element(&pack->pages, i);
        const float coverage = lxrt_load_f32(page + 8);
        if (lxrt_load_u32(page) != pack->page_size || lxrt_load_u32(page + 4) != pack->page_size || !(coverage >= 0 && coverage <= 1)) return 0;
    }
    return 1;
}

static int check_layers(const lxrt_pack *pack)
{
    for (uint32_t i = 0; i < pack->layers.count; ++i) {
        const unsigned char *layer = lxrt_element(&pack->layers, i);
        lxrt_color color;
        if (!is_name(pack, layer) || !are_finite(layer + 8, 5) || !is_scale(lxrt_load_f32(layer + 24)) ||
            !read_authored_color(layer, &color) || lxrt_load_u32(layer + 28) > LXRT_KIND_COMBINED || lxrt_load_u32(layer + 32) > 1)
            return 0;
    }
    return 1;
}

static int compare_rect(const unsigned char *rect, uint32_t node, int32_t gpu_instance)
{
    const uint32_t rect_node = lxrt_load_u32(rect);
    const int32_t rect_instance = (int32_t)lxrt_load_u32(rect + 4);
    if (rect_node != node) return rect_node < node ? -1 : 1;
    return rect_instance < gpu_instance ? -1 : rect_instance > gpu_instance;
}

static int check_rects(const lxrt_pack *pack)
{
    for (uint32_t i = 0; i < pack->rects.count; ++i) {
        const unsigned char *rect = lxrt_element(&pack->rects, i);
        const uint64_t right = (uint64_t)lxrt_load_u32(rect + 16) + lxrt_load_u32(rect + 24);
        const uint64_t bottom = (uint64_t)lxrt_load_u32(rect + 20) + lxrt_load_u32(rect + 28);
        if (lxrt_load_u32(rect + 8) >= pack->page_count || right > pack->page_size || bottom > pack->page_size ||
            !are_finite(rect + 32, 4) || (int32_t)lxrt_load_u32(rect + 4) < -1)
            return 0;
        if (i > 0 && compare_rect(lxrt_element(&pack->rects, i - 1), lxrt_load_u32(rect), (int32_t)lxrt_load_u32(rect + 4)) >= 0)
            return 0;
    }
    return 1;
}

static int check_sources(const lxrt_pack *pack)
{
    for (uint32_t i = 0; i < pack->sources.count; ++i) {
        const unsigned char *source = lxrt_element(&pack->sources, i);
        if (!is_name(pack, source) || lxrt_load_u32(source + 8) >= pack->layer_count || lxrt_load_u32(source + 12) > LXRT_KIND_SKY ||
            !are_finite(source + 16, 3) || (int32_t)lxrt_load_u32(source + 32) < -1)
            return 0;
    }
    return 1;
}

static int check_monitors(const lxrt_pack *pack)
{
    for (uint32_t i = 0; i < pack->monitors.count; ++i) {
        const unsigned char *monitor = lxrt_element(&pack->monitors, i);
        const uint32_t columns = lxrt_load_u32(monitor + 16), rows = lxrt_load_u32(monitor + 20);
        if (!is_name(pack, monitor) || (int32_t)lxrt_load_u32(monitor + 12) < -1 || columns < 1 || columns > max_monitor_edge || rows < 1 ||
            rows > max_monitor_edge || (uint64_t)lxrt_load_u32(monitor + 24) + columns * rows > pack->layer_count)
            return 0;
        for (int k = 0; k < 3; ++k) {
            const float strength = lxrt_load_f32(monitor + 28 + 4 * k);
            if (!(strength >= 0 && strength <= LXRT_MAX_FACTOR)) return 0;
        }
    }
    return 1;
}

// Keys belong to one animation each, so that their checks take no longer than the file is large.
static int check_animations(const lxrt_pack *pack)
{
    const lxrt_table *numbers = &pack->animation_keys;
    uint64_t used = 0;
    for (uint32_t i = 0; i < numbers->count; ++i)
        if (!are_finite(lxrt_element(numbers, i), 1)) return 0;
    for (uint32_t i = 0; i < pack->animations.count; ++i) {
        const unsigned char *data = lxrt_element(&pack->animations, i);
        if (!is_name(pack, data) || lxrt_load_u32(data + 8) >= pack->layer_count || lxrt_load_u32(data + 76) > 1) return 0;
        const uint32_t channel = lxrt_load_u32(data + 16), first = lxrt_load_u32(data + 24), count = lxrt_load_u32(data + 28);
        const lxrt_program program = lxrt_stored_program(data);
        if (!lxrt_is_program(&program) || channel > lxrt_channel_intensity || (channel != 0 && program.kind != LXRT_PROGRAM_KEYS) ||
            (program.interpolation == LXRT_CUBIC && program.kind != LXRT_PROGRAM_KEYS))
            return 0;
        if (!lxrt_has_keys(&program)) continue;
        const lxrt_keys keys = lxrt_stored_keys(pack, data);
        const uint64_t bytes = (uint64_t)count * lxrt_key_stride(&keys);
        used += bytes;
        if (first > numbers->count || bytes > numbers->count - first || used > numbers->count || !lxrt_are_keys(&program, &keys)) return 0;
    }
    return 1;
}

static int check_block_index(const lxrt_pack *pack, const lxrt_table *index)
{
    // 2^16 pages × 2^20 layers × 2^19 entries fit 64 bits
    const uint64_t entries = (uint64_t)pack->page_count * pack->layer_count * pack->level_first[pack->level_count];
    if (index->count != entries || index->stride != 4) return 0;
    for (uint32_t i = 0; i < index->count; ++i)
        if (lxrt_load_u32(index->data + 4 * (size_t)i) > pack->block_count) return 0;
    return 1;
}

// Everything but the colours.
static lxrt_result read_pack(const void *data, size_t size, lxrt_pack *pack)
{
    input in = {data, size};
    uint32_t section_count;
    uint64_t section_offset;
    lxrt_table index, blocks;
    if (!data) return LXRT_ERROR_INVALID_ARGUMENT;
    memset(pack, 0, sizeof *pack);
    lxrt_result result = read_header(&in, pack, &section_count, &section_offset);
    if (result != LXRT_OK) return result;

    const struct {
        const char *type;
        uint32_t element_bytes;
        int required;
        lxrt_table *table;
    } sections[] = {
        {"PAGE", page_bytes, 1, &pack->pages},  {"LAYR", layer_bytes, 1, &pack->layers},   {"STRS", 1, 1, &pack->strings},
        {"RECT", rect_bytes, 0, &pack->rects},  {"SRCE", source_bytes, 0, &pack->sources}, {"BIDX", 4, 1, &index},
        {"BLKS", lxrt_block_bytes, 1, &blocks}, {"MONI", monitor_bytes, 0, &pack->monitors},
        {"ANIM", animation_bytes, 0, &pack->animations}, {"AKEY", 4, 0, &pack->animation_keys},
    };
    for (size_t i = 0; i < sizeof sections / sizeof *sections; ++i) {
        result = find_section(&in, section_count, section_offset, sections[i].type, sections[i].element_bytes, sections[i].required,
                              sections[i].table);
        if (result != LXRT_OK) return result;
    }
    pack->file_bytes = in.size;
    pack->block_index = index.data;
    pack->blocks = blocks.data;
    pack->block_count = blocks.count;
    if (pack->pages.count != pack->page_count || pack->layers.count != pack->layer_count || pack->strings.stride != 1 ||
        blocks.stride != lxrt_block_bytes || pack->animation_keys.stride != 4)
        return LXRT_ERROR_CORRUPT;
    if (!check_pages(pack) || !check_layers(pack) || !check_rects(pack) || !check_sources(pack) || !check_monitors(pack) ||
        !check_animations(pack) || !check_block_index(pack, &index))
        return LXRT_ERROR_CORRUPT;
    return LXRT_OK;
}

// Where the parts of a handle begin, from its aligned start.
typedef struct memory_layout {
    size_t colors, drivers, animation_states, monitor_states, total;
} memory_layout;

// The next part, after `count` elements; returns where they begin. No overflow: the largest part, a million drivers, is below 2^28 bytes
// and the others are smaller than the file.
static size_t place(size_t *end, uint32_t count, size_t element_bytes)
{
    const size_t begin = (*end + memory_alignment - 1) / memory_alignment * memory_alignment;
    *end = begin + count * element_bytes;
    return begin;
}

static memory_layout lay_out_memory(const lxrt_pack *pack)
{
    memory_layout out;
    size_t end = sizeof *pack;
    out.colors = place(&end, pack->layer_count, sizeof *pack->colors);
    out.drivers = place(&end, pack->layer_count, sizeof *pack->drivers);
    out.animation_states = place(&end, pack->animations.count, sizeof *pack->animation_states);
    out.monitor_states = place(&end, pack->monitors.count, sizeof *pack->monitor_states);
    out.total = end + memory_alignment; // the caller's memory may begin anywhere
    return out;
}

lxrt_result lxrt_memory_bytes(const void *data, size_t size, size_t *out_bytes)
{
    lxrt_pack pack;
    if (!out_bytes) return LXRT_ERROR_INVALID_ARGUMENT;
    const lxrt_result result = read_pack(data, size, &pack);
    if (result == LXRT_OK) *out_bytes = lay_out_memory(&pack).total;
    return result;
}

lxrt_result lxrt_open(const void *data, size_t size, void *memory, size_t memory_bytes, lxrt_pack **out_pack)
{
    lxrt_pack local;
    if (!memory || !out_pack) return LXRT_ERROR_INVALID_ARGUMENT;
    const lxrt_result result = read_pack(data, size, &local);
    if (result != LXRT_OK) return result;
    const memory_layout layout = lay_out_memory(&local);
    if (memory_bytes < layout.total) return LXRT_ERROR_MEMORY_TOO_SMALL;

    const size_t misaligned = (uintptr_t)memory % memory_alignment;
    unsigned char *aligned = (unsigned char *)memory + (misaligned ? memory_alignment - misaligned : 0);
    lxrt_pack *pack = (lxrt_pack *)(void *)aligned;
    *pack = local;
    pack->handle_bytes = layout.total;
    pack->kernel = lxrt_best_kernel();
    pack->colors = (lxrt_color *)(void *)(aligned + layout.colors);
    pack->drivers = (lxrt_driver *)(void *)(aligned + layout.drivers);
    pack->animation_states = (lxrt_animation_state *)(void *)(aligned + layout.animation_states);
    pack->monitor_states = (lxrt_monitor_state *)(void *)(aligned + layout.monitor_states);
    for (uint32_t i = 0; i < pack->layer_count; ++i) read_authored_color(lxrt_element(&pack->layers, i), &pack->colors[i]);
    lxrt_begin_drivers(pack);
    lxrt_begin_monitors(pack);
    *out_pack = pack;
    return LXRT_OK;
}

void lxrt_get_info(const lxrt_pack *pack, lxrt_info *out)
{
    *out = (lxrt_info){
        .page_size = pack->page_size,
        .page_count = pack->page_count,
        .layer_count = pack->layer_count,
        .level_count = pack->level_count,
        .rect_count = pack->rects.count,
        .source_count = pack->sources.count,
        .animation_count = pack->animations.count,
        .monitor_count = pack->monitors.count,
        .block_count = pack->block_count,
    };
}

float lxrt_page_coverage(const lxrt_pack *pack, uint32_t page)
{
    return page < pack->page_count ? lxrt_load_f32(lxrt_element(&pack->pages, page) + 8) : 0;
}

lxrt_result lxrt_get_layer_info(const lxrt_pack *pack, uint32_t layer, lxrt_layer *out)
{
    if (layer >= pack->layer_count) return LXRT_ERROR_NOT_FOUND;
    const unsigned char *data = lxrt_element(&pack->layers, layer);
    *out = (lxrt_layer){
        .name = lxrt_name(pack, data),
        .kind = (lxrt_kind)lxrt_load_u32(data + 28),
        .mixed = lxrt_load_u32(data + 32),
        .color = {lxrt_load_f32(data + 8), lxrt_load_f32(data + 12), lxrt_load_f32(data + 16)},
        .intensity = lxrt_load_f32(data + 20),
        .scale = lxrt_load_f32(data + 24),
    };
    return LXRT_OK;
}

uint32_t lxrt_find_layer(const lxrt_pack *pack, const char *name)
{
    for (uint32_t i = 0; i < pack->layer_count; ++i)
        if (strcmp(lxrt_name(pack, lxrt_element(&pack->layers, i)), name) == 0) return i;
    return LXRT_NONE;
}

lxrt_result lxrt_set_layer(lxrt_pack *pack, uint32_t layer, const float rgb[3], float intensity)
{
    lxrt_color color;
    if (layer >= pack->layer_count) return LXRT_ERROR_NOT_FOUND;
    for (int i = 0; i < 3; ++i) color.color[i] = rgb[i] * intensity;
    if (!color_factors(color.color, lxrt_load_f32(lxrt_element(&pack->layers, layer) + 24), color.factor))
        return LXRT_ERROR_INVALID_ARGUMENT;
    pack->colors[layer] = color;
    return LXRT_OK;
}

lxrt_result lxrt_set_layer_named(lxrt_pack *pack, const char *name, const float rgb[3], float intensity)
{
    return lxrt_set_layer(pack, lxrt_find_layer(pack, name), rgb, intensity);
}

lxrt_result lxrt_get_layer(const lxrt_pack *pack, uint32_t layer, float out_rgb[3])
{
    if (layer >= pack->layer_count) return LXRT_ERROR_NOT_FOUND;
    memcpy(out_rgb, pack->colors[layer].color, 3 * sizeof *out_rgb);
    return LXRT_OK;
}

lxrt_result lxrt_get_rect(const lxrt_pack *pack, uint32_t index, lxrt_rect *out)
{
    if (index >= pack->rects.count) return LXRT_ERROR_NOT_FOUND;
    const unsigned char *data = lxrt_element(&pack->rects, index);
    *out = (lxrt_rect){
        .node = lxrt_load_u32(data),
        .gpu_instance = (int32_t)lxrt_load_u32(data + 4),
        .page = lxrt_load_u32(data + 8),
        .texcoord = lxrt_load_u32(data + 12),
        .x = lxrt_load_u32(data + 16),
        .y = lxrt_load_u32(data + 20),
        .width = lxrt_load_u32(data + 24),
        .height = lxrt_load_u32(data + 28),
        .scale = {lxrt_load_f32(data + 32), lxrt_load_f32(data + 36)},
        .offset = {lxrt_load_f32(data + 40), lxrt_load_f32(data + 44)},
    };
    return LXRT_OK;
}

lxrt_result lxrt_find_rect(const lxrt_pack *pack, uint32_t node, int32_t gpu_instance, lxrt_rect *out)
{
    uint32_t low = 0, high = pack->rects.count;
    while (low < high) {
        const uint32_t middle = low + (high - low) / 2;
        const int order = compare_rect(lxrt_element(&pack->rects, middle), node, gpu_instance);
        if (order == 0) return lxrt_get_rect(pack, middle, out);
        if (order < 0)
            low = middle + 1;
        else
            high = middle;
    }
    return LXRT_ERROR_NOT_FOUND;
}

lxrt_result lxrt_get_source(const lxrt_pack *pack, uint32_t index, lxrt_source *out)
{
    if (index >= pack->sources.count) return LXRT_ERROR_NOT_FOUND;
    const unsigned char *data = lxrt_element(&pack->sources, index);
    *out = (lxrt_source){
        .name = lxrt_name(pack, data),
        .layer = lxrt_load_u32(data + 8),
        .kind = (lxrt_kind)lxrt_load_u32(data + 12),
        .weight = {lxrt_load_f32(data + 16), lxrt_load_f32(data + 20), lxrt_load_f32(data + 24)},
        .node = lxrt_load_u32(data + 28),
        .material = (int32_t)lxrt_load_u32(data + 32),
    };
    return LXRT_OK;
}
