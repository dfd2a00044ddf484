// The pack's tables are laid out at once, blocks are appended as images come, so only the file itself is ever in memory.
// Layout: docs/pack-format.md.
#include "store/pack.h"

#include "base/error.h"
#include "base/memory.h"
#include "base/scratch.h"
#include "image/encode.h"
#include "store/manifest.h"

#include <stdlib.h>
#include <string.h>

enum {
    block_size = 32,
    block_texels = block_size * block_size,
    block_bytes = 4 * block_texels,
    header_bytes = 64,
    entry_bytes = 32,
    page_bytes = 16,
    layer_bytes = 48,
    rect_bytes = 48,
    source_bytes = 40,
    monitor_bytes = 48,
    animation_bytes = 80,
    section_alignment = 64,
    block_alignment = 4096,
    section_count = 10,
    waiting_blocks = 64, // until they are written
    max_page_size = 16384,
    max_page_count = 65536,
    max_layer_count = 1 << 20,
    max_monitor_edge = 4096,
};

// The format's numbers are those of our enums.
_Static_assert(LX_SOURCE_POINT == 0 && LX_SOURCE_SPOT == 1 && LX_SOURCE_DIRECTIONAL == 2 && LX_SOURCE_RECT == 3 &&
                   LX_SOURCE_DISK == 4 && LX_SOURCE_EMISSIVE == 5 && LX_SOURCE_SKY == 6 && LX_MODE_BAKED == 0 && LX_MODE_MIXED == 1,
               "kinds and modes are stored as they are");
_Static_assert(LX_PACK_CHANNEL_WHOLE == 0 && LX_PACK_CHANNEL_COLOR == 1 && LX_PACK_CHANNEL_INTENSITY == 2 &&
                   LXRT_PROGRAM_CONSTANT == 0 && LXRT_PROGRAM_KEYS == 1 && LXRT_PROGRAM_BLINK == 2 && LXRT_PROGRAM_FLICKER == 3 &&
                   LXRT_PROGRAM_PULSE == 4 && LXRT_PROGRAM_WHEEL == 5 && LXRT_PROGRAM_SCHEDULE == 6 && LXRT_STEP == 0 &&
                   LXRT_LINEAR == 1 && LXRT_CUBIC == 2,
               "channels, programs and interpolations are stored as they are");

typedef struct layer_coding {
    float inverse_scale; // a power of two too: exact
    float scale;
    float threshold;
} layer_coding;

struct lx_pack_writer {
    uint8_t *data;      // all of it, or with a file: what comes before the blocks
    size_t size, capacity; // size: of all of it
    lx_scratch *file;   // NULL: none
    uint8_t *waiting;   // with a file: blocks that come next
    size_t waiting_bytes;
    uint32_t page_size, page_count, layer_count, level_count;
    uint32_t entries_per_image_set; // of one layer's page, all levels
    uint32_t level_first[16];
    layer_coding *layers;
    size_t block_index_offset, blocks_offset, blocks_entry; // the last: of the directory
    lx_pack_stats stats;
};

static void store_u32(uint8_t *p, uint32_t value)
{
    for (int i = 0; i < 4; ++i) p[i] = (uint8_t)(value >> (8 * i));
}

static void store_u64(uint8_t *p, uint64_t value)
{
    store_u32(p, (uint32_t)value);
    store_u32(p + 4, (uint32_t)(value >> 32));
}

static void store_f32(uint8_t *p, float value)
{
    uint32_t bits;
    memcpy(&bits, &value, sizeof bits);
    store_u32(p, bits);
}

float lx_pack_scale(float largest)
{
    if (!(largest > 0) || !isfinite(largest)) return 1;
    int exponent;
    frexpf(largest, &exponent); // largest = m 2^exponent with m in [0.5, 1)
    exponent -= 15;
    return ldexpf(1, exponent < -100 ? -100 : exponent > 100 ? 100 : exponent);
}

uint32_t lx_pack_level_count(uint32_t page_size, uint32_t padding)
{
    uint32_t count = 1;
    while (count < 15 && padding >> count > 0 && page_size >> count > 0) ++count;
    return count;
}

static uint32_t blocks_across(uint32_t size)
{
    return (size + block_size - 1) / block_size;
}

static size_t align(size_t offset, size_t alignment)
{
    return (offset + alignment - 1) / alignment * alignment;
}

static bool has_keys(const lxrt_program *program)
{
    return program->kind == LXRT_PROGRAM_KEYS || program->kind == LXRT_PROGRAM_SCHEDULE;
}

uint32_t lx_pack_key_stride(const lx_pack_animation *animation)
{
    const uint32_t width = animation->channel == LX_PACK_CHANNEL_INTENSITY ? 1 : 3;
    const bool cubic = animation->program.kind == LXRT_PROGRAM_KEYS && animation->program.interpolation == LXRT_CUBIC;
    return 1 + width * (cubic ? 3 : 1);
}

static uint64_t key_numbers(const lx_pack_animation *animation)
{
    return has_keys(&animation->program) ? (uint64_t)animation->program.key_count * lx_pack_key_stride(animation) : 0;
}

// What is wrong with an animation; NULL if nothing is.
static const char *animation_problem(const lx_pack_animation *animation)
{
    lxrt_program program = animation->program;
    float unused[3];
    const bool keyed = has_keys(&program);
    if ((uint32_t)animation->channel > LX_PACK_CHANNEL_INTENSITY) return "no such channel";
    if (animation->channel != LX_PACK_CHANNEL_WHOLE && program.kind != LXRT_PROGRAM_KEYS)
        return "only keys drive a colour or an intensity alone";
    if (program.interpolation == LXRT_CUBIC && program.kind != LXRT_PROGRAM_KEYS) return "only keys are cubic";
    if (keyed && (!program.keys || program.key_count == 0)) return "no keys";
    for (uint64_t i = 0; i < key_numbers(animation); ++i)
        if (!isfinite(program.keys[i])) return "a key is not finite";
    for (uint32_t i = 1; keyed && i < program.key_count; ++i)
        if (program.keys[(size_t)i * lx_pack_key_stride(animation)] < program.keys[(size_t)(i - 1) * lx_pack_key_stride(animation)])
            return "keys are not in the order of their times";
    if (animation->channel == LX_PACK_CHANNEL_INTENSITY) program.kind = LXRT_PROGRAM_CONSTANT; // its keys are no colours
    if (lxrt_program_evaluate(&program, 0, unused) != LXRT_OK)
        return "a number of its program is out of range (period > 0, 0 <= duty <= 1, fade >= 0; a schedule's keys within its period)";
    return NULL;
}

static lx_result check_animations(const lx_pack_desc *desc, lx_error *error)
{
    for (uint32_t i = 0; i < desc->animation_count; ++i) {
        const lx_pack_animation *animation = &desc->animations[i];
        if (animation->layer >= desc->layer_count)
            return lx_fail(error, LX_ERROR_INVALID_ARGUMENT, "luxel.pack: animation %u: no layer %u", i, animation->layer);
        const char *problem = animation_problem(animation);
        if (problem)
            return lx_fail(error, LX_ERROR_INVALID_ARGUMENT, "luxel.pack: animation '%s' of layer %s: %s", animation->name,
                           desc->layers[animation->layer].name, problem);
    }
    return LX_OK;
}

static lx_result check_monitors(const lx_pack_desc *desc, lx_error *error)
{
    for (uint32_t i = 0; i < desc->monitor_count; ++i) {
        const lx_pack_monitor *monitor = &desc->monitors[i];
        if (monitor->columns < 1 || monitor->columns > max_monitor_edge || monitor->rows < 1 || monitor->rows > max_monitor_edge)
            return lx_fail(error, LX_ERROR_LIMIT, "luxel.pack: monitor %s: %u x %u cells are not possible", monitor->name, monitor->columns,
                           monitor->rows);
        if ((uint64_t)monitor->first_layer + monitor->columns * monitor->rows > desc->layer_count)
            return lx_fail(error, LX_ERROR_INVALID_ARGUMENT, "luxel.pack: monitor %s: %u x %u cells from layer %u on, but %u layers",
                           monitor->name, monitor->columns, monitor->rows, monitor->first_layer, desc->layer_count);
        for (int k = 0; k < 3; ++k)
            if (!(monitor->strength[k] >= 0 && monitor->strength[k] <= LX_PACK_MOST_LIGHT))
                return lx_fail(error, LX_ERROR_INVALID_ARGUMENT, "luxel.pack: monitor %s: strength %g is not possible", monitor->name,
                               (double)monitor->strength[k]);
    }
    return LX_OK;
}

static lx_result check_desc(const lx_pack_desc *desc, lx_error *error)
{
    if (desc->page_size < 1 || desc->page_size > max_page_size || desc->page_count > max_page_count ||
        desc->layer_count > max_layer_count || desc->level_count < 1 || desc->level_count > 15 ||
        desc->page_size >> (desc->level_count - 1) == 0)
        return lx_fail(error, LX_ERROR_LIMIT, "luxel.pack: %u pages of %u texels, %u layers, %u levels are not possible", desc->page_count,
                       desc->page_size, desc->layer_count, desc->level_count);
    for (uint32_t i = 0; i < desc->source_count; ++i)
        if (desc->sources[i].layer >= desc->layer_count)
            return lx_fail(error, LX_ERROR_INVALID_ARGUMENT, "luxel.pack: source %s: no layer %u", desc->sources[i].name,
                           desc->sources[i].layer);
    lx_result result = check_monitors(desc, error);
    return result == LX_OK ? check_animations(desc, error) : result;
}

static int compare_rects(const void *a, const void *b)
{
    const lx_pack_rect *left = a, *right = b;
    if (left->node != right->node) return left->node < right->node ? -1 : 1;
    return (left->gpu_instance > right->gpu_instance) - (left->gpu_instance < right->gpu_instance);
}

// Where each section of the file begins; all of it is known before the first image comes.
typedef struct file_layout {
    size_t offsets[section_count], bytes[section_count], total;
} file_layout;

enum {
    section_page,
    section_layer,
    section_rect,
    section_source,
    section_monitor,
    section_animation,
    section_key,
    section_strings,
    section_index,
    section_blocks
};

static const struct {
    const char *type;
    uint32_t stride;
} sections[section_count] = {
    [section_page] = {"PAGE", page_bytes},           [section_layer] = {"LAYR", layer_bytes},
    [section_rect] = {"RECT", rect_bytes},           [section_source] = {"SRCE", source_bytes},
    [section_monitor] = {"MONI", monitor_bytes},     [section_animation] = {"ANIM", animation_bytes},
    [section_key] = {"AKEY", 4},                     [section_strings] = {"STRS", 1},
    [section_index] = {"BIDX", 4},                   [section_blocks] = {"BLKS", block_bytes},
};

static lx_result plan(const lx_pack_desc *desc, uint32_t entries_per_image_set, file_layout *out, lx_error *error)
{
    uint64_t text_bytes = 1;
    for (uint32_t i = 0; i < desc->layer_count; ++i) text_bytes += strlen(desc->layers[i].name) + 1;
    for (uint32_t i = 0; i < desc->source_count; ++i) text_bytes += strlen(desc->sources[i].name) + 1;
    for (uint32_t i = 0; i < desc->monitor_count; ++i) text_bytes += strlen(desc->monitors[i].name) + 1;
    uint64_t key_count = 0;
    for (uint32_t i = 0; i < desc->animation_count; ++i) {
        text_bytes += strlen(desc->animations[i].name) + 1;
        key_count += key_numbers(&desc->animations[i]);
    }
    const uint64_t counts[section_count] = {
        [section_page] = desc->page_count,
        [section_layer] = desc->layer_count,
        [section_rect] = desc->rect_count,
        [section_source] = desc->source_count,
        [section_monitor] = desc->monitor_count,
        [section_animation] = desc->animation_count,
        [section_key] = key_count,
        [section_strings] = text_bytes,
        [section_index] = (uint64_t)desc->page_count * desc->layer_count * entries_per_image_set,
    };
    size_t at = header_bytes + section_count * entry_bytes;
    for (int i = 0; i < section_count; ++i) {
        if (counts[i] > UINT32_MAX) return lx_fail(error, LX_ERROR_LIMIT, "luxel.pack: more than 2^32 elements in %s", sections[i].type);
        out->bytes[i] = (size_t)counts[i] * sections[i].stride;
        at = align(at, i == section_blocks ? block_alignment : section_alignment);
        out->offsets[i] = at;
        at += out->bytes[i];
    }
    out->total = at;
    return LX_OK;
}

static void write_header(const lx_pack_writer *writer, uint8_t *data)
{
    memcpy(data, "luxelpak", 8);
    store_u32(data + 8, 1);
    store_u32(data + 12, header_bytes);
    store_u32(data + 24, writer->page_size);
    store_u32(data + 28, writer->page_count);
    store_u32(data + 32, writer->layer_count);
    store_u32(data + 36, writer->level_count);
    store_u32(data + 40, block_size);
    store_u32(data + 44, section_count);
    store_u64(data + 48, header_bytes);
}

static void write_directory(const file_layout *layout, uint8_t *data)
{
    for (int i = 0; i < section_count; ++i) {
        uint8_t *entry = data + header_bytes + i * entry_bytes;
        memcpy(entry, sections[i].type, 4);
        store_u32(entry + 4, 1);
        store_u64(entry + 8, layout->offsets[i]);
        store_u64(entry + 16, layout->bytes[i]);
        store_u32(entry + 24, (uint32_t)(layout->bytes[i] / sections[i].stride));
        store_u32(entry + 28, sections[i].stride);
    }
}

// Appends text and its final 0 to the strings and refers to it from `reference`.
static void write_name(const char *name, uint8_t *strings, size_t *used, uint8_t *reference)
{
    const size_t length = strlen(name);
    store_u32(reference, (uint32_t)*used);
    store_u32(reference + 4, (uint32_t)length);
    memcpy(strings + *used, name, length + 1);
    *used += length + 1;
}

static void write_monitors(const lx_pack_desc *desc, uint8_t *monitors, uint8_t *strings, size_t *used)
{
    for (uint32_t i = 0; i < desc->monitor_count; ++i) {
        const lx_pack_monitor *from = &desc->monitors[i];
        uint8_t *monitor = monitors + (size_t)i * monitor_bytes;
        write_name(from->name, strings, used, monitor);
        store_u32(monitor + 8, from->node);
        store_u32(monitor + 12, (uint32_t)from->material);
        store_u32(monitor + 16, from->columns);
        store_u32(monitor + 20, from->rows);
        store_u32(monitor + 24, from->first_layer);
        for (int k = 0; k < 3; ++k) store_f32(monitor + 28 + 4 * k, from->strength[k]);
    }
}

static void write_animations(const lx_pack_desc *desc, uint8_t *animations, uint8_t *keys, uint8_t *strings, size_t *used)
{
    size_t first_key = 0;
    for (uint32_t i = 0; i < desc->animation_count; ++i) {
        const lx_pack_animation *from = &desc->animations[i];
        const lxrt_program *program = &from->program;
        const size_t numbers = (size_t)key_numbers(from);
        uint8_t *animation = animations + (size_t)i * animation_bytes;
        write_name(from->name, strings, used, animation);
        store_u32(animation + 8, from->layer);
        store_u32(animation + 12, program->kind);
        store_u32(animation + 16, from->channel);
        store_u32(animation + 20, program->interpolation);
        store_u32(animation + 24, (uint32_t)first_key);
        store_u32(animation + 28, numbers > 0 ? program->key_count : 0);
        for (int k = 0; k < 3; ++k) store_f32(animation + 32 + 4 * k, program->color[k]);
        const float floats[] = {program->intensity, program->period_s, program->phase_s, program->duty,
                                program->low,       program->high,     program->fade_s};
        for (int k = 0; k < 7; ++k) store_f32(animation + 44 + 4 * k, floats[k]);
        store_u32(animation + 72, program->seed);
        store_u32(animation + 76, program->loop != 0);
        for (size_t k = 0; k < numbers; ++k) store_f32(keys + 4 * (first_key + k), program->keys[k]);
        first_key += numbers;
    }
}

static void write_tables(const lx_pack_desc *desc, const file_layout *layout, const lx_pack_rect *sorted_rects, uint8_t *data)
{
    uint8_t *strings = data + layout->offsets[section_strings];
    size_t used = 1; // an empty string leads, so that the section is never empty
    for (uint32_t i = 0; i < desc->page_count; ++i) {
        uint8_t *page = data + layout->offsets[section_page] + (size_t)i * page_bytes;
        store_u32(page, desc->page_size);
        store_u32(page + 4, desc->page_size);
        store_f32(page + 8, desc->page_coverage ? desc->page_coverage[i] : 0);
    }
    for (uint32_t i = 0; i < desc->layer_count; ++i) {
        const lx_pack_layer *from = &desc->layers[i];
        uint8_t *layer = data + layout->offsets[section_layer] + (size_t)i * layer_bytes;
        write_name(from->name, strings, &used, layer);
        for (int k = 0; k < 3; ++k) store_f32(layer + 8 + 4 * k, from->color[k]);
        store_f32(layer + 20, from->intensity);
        store_f32(layer + 24, from->scale);
        store_u32(layer + 28, from->kind);
        store_u32(layer + 32, from->mode);
    }
    for (uint32_t i = 0; i < desc->rect_count; ++i) {
        const lx_pack_rect *from = &sorted_rects[i];
        uint8_t *rect = data + layout->offsets[section_rect] + (size_t)i * rect_bytes;
        const uint32_t numbers[8] = {from->node, (uint32_t)from->gpu_instance, from->page, from->texcoord,
                                     from->x,    from->y,                      from->width, from->height};
        for (int k = 0; k < 8; ++k) store_u32(rect + 4 * k, numbers[k]);
        for (int k = 0; k < 2; ++k) {
            store_f32(rect + 32 + 4 * k, from->scale[k]);
            store_f32(rect + 40 + 4 * k, from->offset[k]);
        }
    }
    for (uint32_t i = 0; i < desc->source_count; ++i) {
        const lx_pack_source *from = &desc->sources[i];
        uint8_t *source = data + layout->offsets[section_source] + (size_t)i * source_bytes;
        write_name(from->name, strings, &used, source);
        store_u32(source + 8, from->layer);
        store_u32(source + 12, from->kind);
        for (int k = 0; k < 3; ++k) store_f32(source + 16 + 4 * k, from->weight[k]);
        store_u32(source + 28, from->node);
        store_u32(source + 32, (uint32_t)from->material);
    }
    write_monitors(desc, data + layout->offsets[section_monitor], strings, &used);
    write_animations(desc, data + layout->offsets[section_animation], data + layout->offsets[section_key], strings, &used);
}

static lx_result writer_create(const lx_pack_desc *desc, lx_pack_writer **out, lx_error *error)
{
    lx_pack_writer *writer = lx_calloc_array(1, sizeof *writer);
    if (!writer) return lx_fail_memory(error, "luxel.pack");
    *out = writer;
    writer->page_size = desc->page_size;
    writer->page_count = desc->page_count;
    writer->layer_count = desc->layer_count;
    writer->level_count = desc->level_count;
    for (uint32_t level = 0; level < desc->level_count; ++level) {
        const uint32_t across = blocks_across(desc->page_size >> level);
        writer->level_first[level] = writer->entries_per_image_set;
        writer->entries_per_image_set += across * across;
    }
    writer->layers = lx_malloc_array(desc->layer_count, sizeof *writer->layers);
    if (!writer->layers) return lx_fail_memory(error, "luxel.pack");
    for (uint32_t i = 0; i < desc->layer_count; ++i)
        writer->layers[i] = (layer_coding){1 / desc->layers[i].scale, desc->layers[i].scale, desc->layers[i].threshold};
    return LX_OK;
}

lx_result lx_pack_begin(const lx_pack_desc *desc, lx_pack_writer **out_writer, lx_error *error)
{
    lx_result result = LX_OK;
    lx_pack_writer *writer = NULL;
    lx_pack_rect *sorted_rects = NULL;
    file_layout layout = {0};

    LX_TRY(check_desc(desc, error));
    LX_TRY(writer_create(desc, &writer, error));
    LX_TRY(plan(desc, writer->entries_per_image_set, &layout, error));
    sorted_rects = lx_malloc_array(desc->rect_count, sizeof *sorted_rects);
    writer->data = lx_calloc_array(layout.total, 1);
    if (!sorted_rects || !writer->data) {
        result = lx_fail_memory(error, "luxel.pack");
        goto cleanup;
    }
    if (desc->rect_count > 0) {
        memcpy(sorted_rects, desc->rects, desc->rect_count * sizeof *sorted_rects);
        qsort(sorted_rects, desc->rect_count, sizeof *sorted_rects, compare_rects);
    }
    writer->size = writer->capacity = layout.total;
    writer->block_index_offset = layout.offsets[section_index];
    writer->blocks_offset = layout.offsets[section_blocks];
    writer->blocks_entry = header_bytes + section_blocks * entry_bytes;
    write_header(writer, writer->data);
    write_directory(&layout, writer->data);
    write_tables(desc, &layout, sorted_rects, writer->data);
    *out_writer = writer;
    writer = NULL;
cleanup:
    lx_pack_destroy(writer);
    lx_free(sorted_rects);
    return result;
}

lx_result lx_pack_begin_file(const lx_pack_desc *desc, const char *path, lx_pack_writer **out_writer, lx_error *error)
{
    lx_result result = LX_OK;
    lx_pack_writer *writer = NULL;
    LX_TRY(lx_pack_begin(desc, &writer, error));
    writer->waiting = lx_malloc_array(waiting_blocks, block_bytes);
    if (!writer->waiting) {
        result = lx_fail_memory(error, "luxel.pack");
        goto cleanup;
    }
    LX_TRY(lx_scratch_create_file(path, &writer->file, error));
    *out_writer = writer;
    writer = NULL;
cleanup:
    lx_pack_destroy(writer);
    return result;
}

void lx_pack_destroy(lx_pack_writer *writer)
{
    if (!writer) return;
    lx_scratch_destroy(writer->file);
    lx_free(writer->waiting);
    lx_free(writer->data);
    lx_free(writer->layers);
    lx_free(writer);
}

// Encodes a block; false if nothing in it reaches the threshold.
static bool encode_block(const layer_coding *coding, uint32_t size, uint32_t x0, uint32_t y0, const float *rgb, uint32_t *out_texels,
                         float *largest_error)
{
    const float smallest_precise = 0x1p-16f; // stored; below it RGB9E5's exponent is used up
    const uint32_t width = size - x0 < block_size ? size - x0 : block_size, height = size - y0 < block_size ? size - y0 : block_size;
    bool visible = false;
    float error = *largest_error;
    if (width < block_size || height < block_size) memset(out_texels, 0, block_bytes);
    for (uint32_t y = 0; y < height; ++y) {
        const float *row = rgb + 3 * ((size_t)(y0 + y) * size + x0);
        for (uint32_t x = 0; x < width; ++x) {
            const lx_rgb value = {row[3 * x] * coding->inverse_scale, row[3 * x + 1] * coding->inverse_scale,
                                  row[3 * x + 2] * coding->inverse_scale};
            const uint32_t bits = lx_rgb9e5_encode(value);
            out_texels[y * block_size + x] = bits;
            const float largest = lx_rgb_max(value);
            if (!(largest > 0)) continue;
            const lx_rgb stored = lx_rgb9e5_decode(bits);
            visible |= largest * coding->scale >= coding->threshold && lx_rgb_max(stored) > 0;
            if (largest < smallest_precise) continue;
            // Negative channels are stored as 0; light has none, so they count as noise and not as error.
            const lx_rgb wrong = {fabsf(stored.r - fmaxf(value.r, 0)), fabsf(stored.g - fmaxf(value.g, 0)),
                                  fabsf(stored.b - fmaxf(value.b, 0))};
            error = fmaxf(error, lx_rgb_max(wrong) / largest);
        }
    }
    if (visible) *largest_error = error;
    return visible;
}

static lx_result write_waiting(lx_pack_writer *writer, lx_error *error)
{
    const size_t bytes = writer->waiting_bytes;
    writer->waiting_bytes = 0;
    const lx_result result = bytes ? lx_scratch_write(writer->file, writer->size - bytes, writer->waiting, bytes, error) : LX_OK;
    if (result != LX_OK) lx_error_prefix(error, "luxel.pack");
    return result;
}

static lx_result append_block(lx_pack_writer *writer, const uint32_t *texels, lx_error *error)
{
    uint8_t *out;
    if (writer->file) {
        if (writer->waiting_bytes == (size_t)waiting_blocks * block_bytes) {
            const lx_result result = write_waiting(writer, error);
            if (result != LX_OK) return result;
        }
        out = writer->waiting + writer->waiting_bytes;
        writer->waiting_bytes += block_bytes;
    } else {
        if (!lx_array_reserve(&writer->data, &writer->capacity, writer->size + block_bytes, 1)) return lx_fail_memory(error, "luxel.pack");
        out = writer->data + writer->size;
    }
    for (int k = 0; k < block_texels; ++k) store_u32(out + 4 * k, texels[k]);
    writer->size += block_bytes;
    return LX_OK;
}

lx_result lx_pack_add_image(lx_pack_writer *writer, uint32_t page, uint32_t layer, uint32_t level, const float *rgb, lx_error *error)
{
    if (page >= writer->page_count || layer >= writer->layer_count || level >= writer->level_count)
        return lx_fail(error, LX_ERROR_INVALID_ARGUMENT, "luxel.pack: no page %u, layer %u, level %u", page, layer, level);
    const uint32_t size = writer->page_size >> level, across = blocks_across(size);
    const size_t first = ((size_t)page * writer->layer_count + layer) * writer->entries_per_image_set + writer->level_first[level];
    uint32_t texels[block_texels];
    for (uint32_t i = 0; i < across * across; ++i) {
        if (!encode_block(&writer->layers[layer], size, i % across * block_size, i / across * block_size, rgb, texels,
                          &writer->stats.largest_error)) {
            ++writer->stats.absent_count;
            continue;
        }
        if (writer->stats.block_count == UINT32_MAX - 1) return lx_fail(error, LX_ERROR_LIMIT, "luxel.pack: more than 2^32 blocks");
        const lx_result result = append_block(writer, texels, error);
        if (result != LX_OK) return result;
        ++writer->stats.block_count;
        store_u32(writer->data + writer->block_index_offset + 4 * (first + i), (uint32_t)writer->stats.block_count);
    }
    return LX_OK;
}

// Tables last, when all of them is known; then the hash, which goes through the file from its start.
static lx_result finish_file(lx_pack_writer *writer, uint64_t *out_hash, lx_error *error)
{
    lx_result result = LX_OK;
    result = write_waiting(writer, error);
    if (result != LX_OK) return result;
    LX_TRY(lx_scratch_write(writer->file, 0, writer->data, writer->blocks_offset, error));
    uint64_t hash = lx_content_hash_add(LX_CONTENT_HASH_START, writer->data, writer->blocks_offset);
    for (size_t at = writer->blocks_offset; at < writer->size;) {
        const size_t left = writer->size - at, bytes = left < (size_t)waiting_blocks * block_bytes ? left : (size_t)waiting_blocks * block_bytes;
        LX_TRY(lx_scratch_read(writer->file, at, writer->waiting, bytes, error));
        hash = lx_content_hash_add(hash, writer->waiting, bytes);
        at += bytes;
    }
    LX_TRY(lx_scratch_flush(writer->file, error));
    *out_hash = lx_content_hash_end(hash);
cleanup:
    if (result != LX_OK) lx_error_prefix(error, "luxel.pack");
    return result;
}

lx_result lx_pack_finish(lx_pack_writer *writer, lx_bytes *out, lx_pack_stats *out_stats, lx_error *error)
{
    lx_result result = LX_OK;
    if (!writer->data) return lx_fail(error, LX_ERROR_INVALID_ARGUMENT, "luxel.pack: already finished");
    uint8_t *entry = writer->data + writer->blocks_entry;
    store_u64(entry + 16, writer->size - writer->blocks_offset);
    store_u32(entry + 24, (uint32_t)writer->stats.block_count);
    store_u64(writer->data + 16, writer->size);
    writer->stats.bytes = writer->size;
    if (writer->file) {
        LX_TRY(finish_file(writer, &writer->stats.hash, error));
        lx_free(writer->data);
        *out = (lx_bytes){0};
    } else {
        *out = (lx_bytes){writer->data, writer->size};
    }
    if (out_stats) *out_stats = writer->stats;
    writer->data = NULL;
    writer->size = writer->capacity = 0;
cleanup:
    return result;
}
