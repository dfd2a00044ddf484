// Texels become luxels: numbers by tile, so that what is baked together lies together.
#include "bake/luxel_map.h"

#include "base/error.h"
#include "base/memory.h"

#include <string.h>

// Texels are told by 32 bits over all pages, and two numbers are taken.
static lx_result count_texels(uint32_t page_size, uint32_t page_count, size_t *out, lx_error *error)
{
    size_t page_texels;
    if (!lx_mul_size(page_size, page_size, &page_texels) || !lx_mul_size(page_texels, page_count, out) || *out >= UINT32_MAX)
        return lx_fail(error, LX_ERROR_LIMIT, "%u pages of %u x %u texels are too many; fewer or smaller pages do", page_count, page_size, page_size);
    return LX_OK;
}

static void number_tile(lx_bake_map *map, lx_luxel_tile *tile, const uint32_t *texel_chart, const uint8_t *texel_coverage)
{
    const uint32_t size = map->view.page_size;
    const uint32_t x_end = lx_luxel_tile_edge < size - tile->x ? tile->x + lx_luxel_tile_edge : size;
    const uint32_t y_end = lx_luxel_tile_edge < size - tile->y ? tile->y + lx_luxel_tile_edge : size;
    uint32_t next = tile->first;
    for (uint32_t y = tile->y; y < y_end; ++y)
        for (uint32_t x = tile->x; x < x_end; ++x) {
            const uint32_t texel = (tile->page * size + y) * size + x;
            if (!texel_coverage[texel]) continue;
            map->texel[next] = texel;
            map->chart[next] = texel_chart[texel];
            map->index[texel] = next++;
        }
    tile->count = next - tile->first;
}

lx_result lx_bake_map_build(uint32_t page_size, uint32_t page_count, const uint32_t *texel_chart, const uint8_t *texel_coverage, lx_bake_map *out,
                            lx_error *error)
{
    lx_result result = LX_OK;
    size_t texel_count;
    uint32_t count = 0;
    lx_bake_map map = {0};
    LX_TRY(count_texels(page_size, page_count, &texel_count, error));
    for (size_t i = 0; i < texel_count; ++i) count += texel_coverage[i] != 0;
    const uint32_t edge = page_size / lx_luxel_tile_edge + (page_size % lx_luxel_tile_edge != 0);
    map = (lx_bake_map){
        .texel = lx_malloc_array(count, sizeof *map.texel),
        .index = lx_malloc_array(texel_count, sizeof *map.index),
        .chart = lx_malloc_array(count, sizeof *map.chart),
        .position = lx_calloc_array(count, sizeof *map.position),
        .normal = lx_calloc_array(count, sizeof *map.normal),
        .size_m = lx_calloc_array(count, sizeof *map.size_m),
        .valid = lx_malloc_array(count, 1),
        .tiles = lx_malloc_array((size_t)edge * edge * page_count, sizeof *map.tiles),
    };
    if (!map.texel || !map.index || !map.chart || !map.position || !map.normal || !map.size_m || !map.valid || !map.tiles) {
        result = lx_fail_memory(error, "luxels");
        goto cleanup;
    }
    map.view = (lx_luxel_map){.count = count, .page_size = page_size, .page_count = page_count, .texel = map.texel, .index = map.index,
                              .chart = map.chart, .position = map.position, .normal = map.normal, .size_m = map.size_m, .valid = map.valid};
    memset(map.index, 0xff, texel_count * sizeof *map.index); // LX_NO_LUXEL
    memset(map.valid, 1, count);
    uint32_t first = 0;
    for (uint32_t page = 0; page < page_count; ++page)
        for (uint32_t y = 0; y < page_size; y += lx_luxel_tile_edge)
            for (uint32_t x = 0; x < page_size; x += lx_luxel_tile_edge) {
                lx_luxel_tile tile = {.page = page, .x = x, .y = y, .first = first};
                number_tile(&map, &tile, texel_chart, texel_coverage);
                if (tile.count) map.tiles[map.tile_count++] = tile;
                first += tile.count;
            }
    *out = map;
    map = (lx_bake_map){0};
cleanup:
    lx_bake_map_release(&map);
    return result;
}

void lx_bake_map_release(lx_bake_map *map)
{
    lx_free(map->texel);
    lx_free(map->index);
    lx_free(map->chart);
    lx_free(map->position);
    lx_free(map->normal);
    lx_free(map->size_m);
    lx_free(map->valid);
    lx_free(map->tiles);
    *map = (lx_bake_map){0};
}
