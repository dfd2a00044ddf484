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
            require(lxrt_compose(pack, page, level, size - width, size - width, width, width, rgb, 0) == LXRT_OK);
            for (uint32_t i = 0; i < 3 * width * width; ++i) require(isfinite(rgb[i]));
            free(rgb);
        }
        float rgb[3];
        require(lxrt_lightmap_sample(pack, page, 0.99f, 0.01f, LXRT_FILTER_BILINEAR, rgb) == LXRT_OK && isfinite(rgb[0]));
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
    if (info.layer_count > 0) {
        lxrt_set_layer(pack, info.layer_count - 1, (const float[3]){1e27f, -1e27f, 0}, 1);
        use_texels(pack, &info);
    }
    free(memory);
    return 0;
}
