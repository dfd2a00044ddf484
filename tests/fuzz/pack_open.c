// Any bytes as a luxel.pack: whatever lxrt_open accepts must be safe to use in every way, and its sums finite.
#include "luxel_rt.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

static void require(int condition)
{
    if (!condition) abort();
}

static int is_finite(const float rgb[3])
{
    return isfinite(rgb[0]) && isfinite(rgb[1]) && isfinite(rgb[2]);
}

static void use_tables(lxrt_pack *pack, const lxrt_info *info)
{
    lxrt_layer layer;
    lxrt_source source;
    lxrt_rect rect;
    lxrt_animation animation;
    lxrt_monitor monitor;
    lxrt_budget budget;
    float rgb[3];
    for (uint32_t i = 0; i < info->layer_count && i < 64; ++i) {
        require(lxrt_get_layer_info(pack, i, &layer) == LXRT_OK && lxrt_get_layer(pack, i, rgb) == LXRT_OK && is_finite(rgb));
        require(lxrt_find_layer(pack, layer.name) <= i);
    }
    for (uint32_t i = 0; i < info->source_count && i < 64; ++i)
        require(lxrt_get_source(pack, i, &source) == LXRT_OK && source.layer < info->layer_count && strlen(source.name) < SIZE_MAX);
    for (uint32_t i = 0; i < info->rect_count && i < 64; ++i) {
        require(lxrt_get_rect(pack, i, &rect) == LXRT_OK && rect.page < info->page_count);
        require(lxrt_find_rect(pack, rect.node, rect.gpu_instance, &rect) == LXRT_OK);
    }
    for (uint32_t i = 0; i < info->animation_count && i < 64; ++i)
        require(lxrt_get_animation(pack, i, &animation) == LXRT_OK && animation.layer < info->layer_count && strlen(animation.name) < SIZE_MAX);
    for (uint32_t i = 0; i < info->monitor_count && i < 64; ++i) {
        require(lxrt_get_monitor(pack, i, &monitor) == LXRT_OK && strlen(monitor.name) < SIZE_MAX);
        require((uint64_t)monitor.first_layer + (uint64_t)monitor.columns * monitor.rows <= info->layer_count);
    }
    require(lxrt_get_layer_info(pack, info->layer_count, &layer) != LXRT_OK && lxrt_get_source(pack, info->source_count, &source) != LXRT_OK &&
            lxrt_get_rect(pack, info->rect_count, &rect) != LXRT_OK && lxrt_get_animation(pack, info->animation_count, &animation) != LXRT_OK &&
            lxrt_get_monitor(pack, info->monitor_count, &monitor) != LXRT_OK);
    for (uint32_t page = 0; page < 3; ++page) require(isfinite(lxrt_page_coverage(pack, page)));
    lxrt_get_budget(pack, &budget);
    require(budget.gpu_layers_bytes >= budget.gpu_composed_bytes || info->layer_count == 0);
}

static void use_texels(lxrt_pack *pack, const lxrt_info *info)
{
    if (info->layer_count > 256) return; // slow, not unsafe
    for (uint32_t page = 0; page < info->page_count && page < 2; ++page) {
        for (uint32_t level = 0; level < info->level_count; ++level) {
            const uint32_t size = info->page_size >> level, width = size < 70 ? size : 70;
            float *texels = malloc(12 * (size_t)width * width);
            require(texels != NULL);
            for (int format = 2; format >= 0; --format) {
                const lxrt_region regions[] = {{page, level, 0, 0, width, width}, {page, level, size - width, size - width, width, width}};
                const lxrt_target target = {texels, 0, (lxrt_format)format, format == 2 ? 0.001f : 1};
                for (int i = 0; i < 2; ++i) require(lxrt_compose(pack, &regions[i], &target) == LXRT_OK);
            }
            for (uint32_t i = 0; i < 3 * width * width; ++i) require(isfinite(texels[i]));
            free(texels);
        }
        float rgb[3];
        for (int filter = 0; filter < 2; ++filter)
            for (int i = 0; i < 4; ++i)
                require(lxrt_lightmap_sample(pack, page, (float)i * 0.37f - 0.1f, 0.99f - (float)i * 0.4f, (lxrt_filter)filter, rgb) == LXRT_OK &&
                        is_finite(rgb));
    }
}

static void accumulate(lxrt_accumulator *accumulator, const lxrt_info *info)
{
    lxrt_accumulator_begin(accumulator);
    for (uint32_t level = 0; level < info->level_count; ++level) {
        lxrt_region region;
        const uint32_t size = info->page_size >> level;
        require(lxrt_accumulator_bounds(accumulator, level, &region) == LXRT_OK);
        require(region.x <= size && region.width <= size - region.x && region.y <= size && region.height <= size - region.y);
        float *texels = malloc(12 * (size_t)region.width * region.height + 1);
        require(texels && lxrt_accumulator_update(accumulator, &region, &(lxrt_target){texels, 0, LXRT_FORMAT_RGB32F, 1}) == LXRT_OK);
        free(texels);
    }
}

static void use_accumulator(lxrt_pack *pack, const lxrt_info *info)
{
    if (info->page_count == 0 || info->page_size > 300 || info->layer_count > 256) return;
    const size_t bytes = lxrt_accumulator_bytes(pack);
    void *memory = malloc(bytes);
    lxrt_accumulator *accumulator = NULL;
    require(memory && lxrt_accumulator_create(pack, info->page_count - 1, memory, bytes, &accumulator) == LXRT_OK);
    accumulate(accumulator, info);
    for (uint32_t i = 0; i < info->layer_count && i < 3; ++i) {
        lxrt_set_layer(pack, i, (const float[3]){1, 0.5f, (float)i}, 1);
        accumulate(accumulator, info);
    }
    free(memory);
}

// Colours that animations and monitors make of whatever the pack says.
static void use_animations(lxrt_pack *pack, const lxrt_info *info)
{
    static const uint8_t picture[5 * 7 * 4] = {255, 2, 99, 0, 17};
    static const double times_s[] = {0, -3.7, 0.7, 86399, 1e9, -1e300};
    lxrt_animation animation;
    lxrt_monitor monitor;
    for (uint32_t i = 0; i < info->animation_count && i < 64; ++i) {
        require(lxrt_get_animation(pack, i, &animation) == LXRT_OK && animation.layer < info->layer_count && isfinite(animation.duration_s));
        require(lxrt_play(pack, animation.name, i % 3 != 0) == LXRT_OK);
    }
    for (size_t t = 0; t < sizeof times_s / sizeof *times_s; ++t) require(lxrt_update(pack, times_s[t]) <= info->layer_count);
    for (uint32_t i = 0; i < info->monitor_count && i < 8; ++i) {
        require(lxrt_get_monitor(pack, i, &monitor) == LXRT_OK && strlen(monitor.name) < SIZE_MAX);
        require((uint64_t)monitor.first_layer + monitor.columns * monitor.rows <= info->layer_count);
        if (monitor.columns * monitor.rows > 4096) continue; // slow, not unsafe
        require(lxrt_monitor_update(pack, i, picture, 5, 7, 0, i % 2 ? LXRT_PIXELS_RGB8_SRGB : LXRT_PIXELS_RGBA8_SRGB) == LXRT_OK);
    }
    for (uint32_t i = 0; i < info->layer_count; ++i) {
        float rgb[3];
        require(lxrt_get_layer(pack, i, rgb) == LXRT_OK && isfinite(rgb[0]) && isfinite(rgb[1]) && isfinite(rgb[2]));
    }
}

static void read_light(void *user, uint32_t layer, double time_s, float rgb[3])
{
    (void)user;
    require(is_finite(rgb));
    rgb[layer % 3] = (float)time_s;
}

// Drivers that code sets, beside those of the pack.
static void use_drivers(lxrt_pack *pack, const lxrt_info *info)
{
    if (info->layer_count > 0) {
        lxrt_program program = lxrt_program_default();
        program.kind = LXRT_PROGRAM_FLICKER;
        require(lxrt_set_program(pack, 0, &program) == LXRT_OK);
        require(lxrt_set_callback(pack, info->layer_count - 1, read_light, NULL) == LXRT_OK);
        lxrt_update(pack, 1.5);
        require(lxrt_reset_driver(pack, 0) == LXRT_OK);
        require(lxrt_play(pack, NULL, 1) == LXRT_OK || info->animation_count == 0);
        lxrt_update(pack, 2.5);
    }
    static const unsigned char picture[16 * 3] = {255, 3, 7, 200};
    for (uint32_t i = 0; i < info->monitor_count && i < 8; ++i) {
        require(lxrt_monitor_configure(pack, i, NULL, 0.25f) == LXRT_OK);
        lxrt_monitor_update(pack, i, picture, 5, 3, 16, LXRT_PIXELS_RGB8_SRGB);
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    size_t needed;
    if (lxrt_memory_bytes(data, size, &needed) != LXRT_OK) return 0;
    void *memory = malloc(needed);
    lxrt_pack *pack = NULL;
    lxrt_info info;
    require(memory != NULL && lxrt_open(data, size, memory, needed, &pack) == LXRT_OK);
    lxrt_get_info(pack, &info);
    use_tables(pack, &info);
    use_texels(pack, &info);
    use_animations(pack, &info);
    use_drivers(pack, &info);
    use_accumulator(pack, &info);
    if (info.layer_count > 0) {
        lxrt_set_layer(pack, info.layer_count - 1, (const float[3]){1e27f, -1e27f, 0}, 1);
        use_texels(pack, &info);
    }
    free(memory);
    return 0;
}
