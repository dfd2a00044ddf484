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

static void use_tables(lxrt_pack *pack, const lxrt_info *info)
{
    lxrt_layer layer;
    lxrt_source source;
    lxrt_rect rect;
    float rgb[3];
    for (uint32_t i = 0; i < info->layer_count; ++i) {
        require(lxrt_get_layer_info(pack, i, &layer) == LXRT_OK && lxrt_get_layer(pack, i, rgb) == LXRT_OK);
        require(lxrt_find_layer(pack, layer.name) <= i);
        if (i >= 64) break;
    }
    for (uint32_t i = 0; i < info->source_count && i < 64; ++i)
        require(lxrt_get_source(pack, i, &source) == LXRT_OK && source.layer < info->layer_count && strlen(source.name) < SIZE_MAX);
    for (uint32_t i = 0; i < info->rect_count && i < 64; ++i) {
        require(lxrt_get_rect(pack, i, &rect) == LXRT_OK && rect.page < info->page_count);
        require(lxrt_find_rect(pack, rect.node, rect.gpu_instance, &rect) == LXRT_OK);
    }
}

static void use_texels(lxrt_pack *pack, const lxrt_info *info)
{
    if (info->layer_count > 256) return; // slow, not unsafe
    for (uint32_t page = 0; page < info->page_count && page < 2; ++page) {
        for (uint32_t level = 0; level < info->level_count; ++level) {
            const uint32_t size = info->page_size >> level, width = size < 70 ? size : 70;
            float *rgb = malloc(3 * sizeof *rgb * width * width);
            require(rgb != NULL);
            require(lxrt_compose(pack, &(lxrt_region){page, level, 0, 0, width, width}, &(lxrt_target){rgb, 0, LXRT_FORMAT_RGB32F, 1}) == LXRT_OK);
            require(lxrt_compose(pack, &(lxrt_region){page, level, size - width, size - width, width, width},
                                 &(lxrt_target){rgb, 0, LXRT_FORMAT_RGB32F, 1}) == LXRT_OK);
            for (uint32_t i = 0; i < 3 * width * width; ++i) require(isfinite(rgb[i]));
            free(rgb);
        }
        float rgb[3];
        require(lxrt_lightmap_sample(pack, page, 0.99f, 0.01f, LXRT_FILTER_BILINEAR, rgb) == LXRT_OK && isfinite(rgb[0]));
    }
}

// Colours that animations and monitors make of whatever the pack says.
static void use_drivers(lxrt_pack *pack, const lxrt_info *info)
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
    use_drivers(pack, &info);
    if (info.layer_count > 0) {
        lxrt_set_layer(pack, info.layer_count - 1, (const float[3]){1e27f, -1e27f, 0}, 1);
        use_texels(pack, &info);
    }
    free(memory);
    return 0;
}
