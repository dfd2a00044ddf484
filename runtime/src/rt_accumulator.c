// Sums of one page that live from frame to frame: c T + Δc T instead of all layers again.
#include "rt_accumulator.h"
#include "rt_sum.h"

enum {
    memory_alignment = 64, // of the sums: a row's channel is two cache lines
    begins_between_full = 64,
};

// The blocks of a layer on a level; ends excluded, empty where there are none.
typedef struct extent {
    uint16_t x0, y0, x1, y1;
} extent;

struct lxrt_accumulator {
    const lxrt_pack *pack;
    uint32_t page;
    uint32_t begin_count; // since the sums were made anew and have been added to
    int is_inexact;       // changes were added since the sums were made anew
    int is_lost;          // the next begin asks for everything
    int is_full;          // what was begun asks for everything
    float (*noted)[3];    // [layer_count] factors of the last begin
    float (*changes)[3];  // [layer_count] what they changed by
    extent *extents;      // [layer_count × level_count]
    float *sums;          // [blocks of the page × lxrt_sums_floats], levels one after the other
};

static uint64_t align_up(uint64_t bytes)
{
    return (bytes + memory_alignment - 1) / memory_alignment * memory_alignment;
}

static uint64_t extents_bytes(const lxrt_pack *pack)
{
    return (uint64_t)pack->layer_count * pack->level_count * sizeof(extent);
}

static uint64_t factors_bytes(const lxrt_pack *pack)
{
    return (uint64_t)pack->layer_count * 3 * sizeof(float);
}

uint64_t lxrt_accumulator_bytes64(const lxrt_pack *pack)
{
    const uint64_t sums_bytes = (uint64_t)pack->level_first[pack->level_count] * lxrt_sums_floats * sizeof(float);
    return memory_alignment + align_up(sizeof(lxrt_accumulator)) + 2 * align_up(factors_bytes(pack)) + align_up(extents_bytes(pack)) + sums_bytes;
}

size_t lxrt_accumulator_bytes(const lxrt_pack *pack)
{
    const uint64_t bytes = lxrt_accumulator_bytes64(pack);
    return bytes < SIZE_MAX ? (size_t)bytes : SIZE_MAX;
}

static extent find_extent(const lxrt_pack *pack, uint32_t page, uint32_t layer, uint32_t level)
{
    const uint32_t across = lxrt_blocks_across(lxrt_level_size(pack, level));
    extent e = {UINT16_MAX, UINT16_MAX, 0, 0};
    for (uint32_t y = 0; y < across; ++y) {
        for (uint32_t x = 0; x < across; ++x) {
            if (!lxrt_find_block(pack, page, layer, level, x, y)) continue;
            if (x < e.x0) e.x0 = (uint16_t)x;
            if (y < e.y0) e.y0 = (uint16_t)y;
            if (x >= e.x1) e.x1 = (uint16_t)(x + 1);
            if (y >= e.y1) e.y1 = (uint16_t)(y + 1);
        }
    }
    return e;
}

static const extent *extents_of(const lxrt_accumulator *accumulator, uint32_t layer)
{
    return accumulator->extents + (size_t)layer * accumulator->pack->level_count;
}

lxrt_result lxrt_accumulator_create(const lxrt_pack *pack, uint32_t page, void *memory, size_t memory_bytes,
                                    lxrt_accumulator **out_accumulator)
{
    if (!pack || !memory || !out_accumulator || page >= pack->page_count) return LXRT_ERROR_INVALID_ARGUMENT;
    if (memory_bytes < lxrt_accumulator_bytes64(pack)) return LXRT_ERROR_MEMORY_TOO_SMALL;

    unsigned char *at = (unsigned char *)memory;
    at += align_up((uintptr_t)at) - (uintptr_t)at;
    lxrt_accumulator *accumulator = (lxrt_accumulator *)(void *)at;
    at += align_up(sizeof *accumulator);
    *accumulator = (lxrt_accumulator){.pack = pack, .page = page, .is_lost = 1};
    accumulator->noted = (float(*)[3])(void *)at;
    at += align_up(factors_bytes(pack));
    accumulator->changes = (float(*)[3])(void *)at;
    at += align_up(factors_bytes(pack));
    accumulator->extents = (extent *)(void *)at;
    at += align_up(extents_bytes(pack));
    accumulator->sums = (float *)(void *)at;

    memset(accumulator->noted, 0, (size_t)factors_bytes(pack));
    memset(accumulator->changes, 0, (size_t)factors_bytes(pack));
    for (uint32_t layer = 0; layer < pack->layer_count; ++layer)
        for (uint32_t level = 0; level < pack->level_count; ++level)
            accumulator->extents[(size_t)layer * pack->level_count + level] = find_extent(pack, page, layer, level);
    *out_accumulator = accumulator;
    return LXRT_OK;
}

static int is_on_page(const lxrt_accumulator *accumulator, uint32_t layer)
{
    const extent *extents = extents_of(accumulator, layer);
    for (uint32_t level = 0; level < accumulator->pack->level_count; ++level)
        if (extents[level].x1 != 0) return 1;
    return 0;
}

uint32_t lxrt_accumulator_begin(lxrt_accumulator *accumulator)
{
    const lxrt_pack *pack = accumulator->pack;
    uint32_t changed_count = 0;
    for (uint32_t layer = 0; layer < pack->layer_count; ++layer) {
        const float *factor = pack->colors[layer].factor;
        float *noted = accumulator->noted[layer], *change = accumulator->changes[layer];
        for (int k = 0; k < 3; ++k) {
            change[k] = factor[k] - noted[k];
            noted[k] = factor[k];
        }
        if (!lxrt_is_black(change) && is_on_page(accumulator, layer)) ++changed_count;
    }
    accumulator->is_inexact |= changed_count != 0;
    if (accumulator->is_inexact) ++accumulator->begin_count;
    accumulator->is_full = accumulator->is_lost || accumulator->begin_count == begins_between_full;
    if (accumulator->is_full) {
        accumulator->begin_count = 0;
        accumulator->is_inexact = accumulator->is_lost = 0;
        if (changed_count == 0) changed_count = 1; // there is something to do
    }
    return changed_count;
}

void lxrt_accumulator_reset(lxrt_accumulator *accumulator)
{
    accumulator->is_lost = 1;
}

lxrt_result lxrt_accumulator_bounds(const lxrt_accumulator *accumulator, uint32_t level, lxrt_region *out)
{
    if (!accumulator || !out || level >= accumulator->pack->level_count) return LXRT_ERROR_INVALID_ARGUMENT;
    const lxrt_pack *pack = accumulator->pack;
    const uint32_t size = lxrt_level_size(pack, level);
    *out = (lxrt_region){.page = accumulator->page, .level = level};
    if (accumulator->is_full) {
        out->width = out->height = size;
        return LXRT_OK;
    }
    extent bounds = {UINT16_MAX, UINT16_MAX, 0, 0};
    for (uint32_t layer = 0; layer < pack->layer_count; ++layer) {
        const extent e = extents_of(accumulator, layer)[level];
        if (e.x1 == 0 || lxrt_is_black(accumulator->changes[layer])) continue;
        if (e.x0 < bounds.x0) bounds.x0 = e.x0;
        if (e.y0 < bounds.y0) bounds.y0 = e.y0;
        if (e.x1 > bounds.x1) bounds.x1 = e.x1;
        if (e.y1 > bounds.y1) bounds.y1 = e.y1;
    }
    if (bounds.x1 == 0) return LXRT_OK;
    const uint32_t right = (uint32_t)bounds.x1 * lxrt_block_size, bottom = (uint32_t)bounds.y1 * lxrt_block_size;
    out->x = (uint32_t)bounds.x0 * lxrt_block_size;
    out->y = (uint32_t)bounds.y0 * lxrt_block_size;
    out->width = (right < size ? right : size) - out->x;
    out->height = (bottom < size ? bottom : size) - out->y;
    return LXRT_OK;
}

// On block borders, or at the page's edge.
static int is_whole(uint32_t first, uint32_t count, uint32_t size)
{
    return first % lxrt_block_size == 0 && (count % lxrt_block_size == 0 || first + count == size);
}

lxrt_result lxrt_accumulator_update(lxrt_accumulator *accumulator, const lxrt_region *region, const lxrt_target *target)
{
    if (!accumulator) return LXRT_ERROR_INVALID_ARGUMENT;
    const lxrt_pack *pack = accumulator->pack;
    const lxrt_result result = lxrt_check_region(pack, region, target);
    if (result != LXRT_OK) return result;
    const uint32_t size = lxrt_level_size(pack, region->level);
    if (region->page != accumulator->page || !is_whole(region->x, region->width, size) || !is_whole(region->y, region->height, size))
        return LXRT_ERROR_INVALID_ARGUMENT;

    const lxrt_kept kept = {
        .sums = accumulator->sums + (size_t)pack->level_first[region->level] * lxrt_sums_floats,
        .changes = {pack->layer_count ? accumulator->changes[0] : NULL, 3},
        .afresh = accumulator->is_full,
    };
    lxrt_sum_region(pack, region, target, (lxrt_factors){pack->layer_count ? accumulator->noted[0] : NULL, 3}, &kept);
    return LXRT_OK;
}
