/// The luxels of a bake: which texel is which luxel, by tile; owner of what post/luxel_map.h shows.
#ifndef LX_BAKE_LUXEL_MAP_H
#define LX_BAKE_LUXEL_MAP_H

#include "luxel/base.h"
#include "post/luxel_map.h"

/// A square of lx_luxel_tile_edge² texels that holds at least one luxel: the unit of work.
typedef struct lx_luxel_tile {
    uint32_t page, x, y;   ///< Of its first texel.
    uint32_t first, count; ///< Its luxels: first … first + count - 1, row by row.
} lx_luxel_tile;

/// All zero is legal to release.
typedef struct lx_bake_map {
    lx_luxel_map view; ///< Points into the arrays below.
    uint32_t *texel, *index, *chart; ///< Filled by lx_bake_map_build.
    lx_vec3 *position, *normal;      ///< Zero, until whoever places the sites fills them,
    float *size_m;                   ///< likewise,
    uint8_t *valid;                  ///< and 1, until whoever bakes knows better.
    lx_luxel_tile *tiles; ///< Page by page, row by row.
    uint32_t tile_count;
} lx_bake_map;

/// Numbers the covered texels. `texel_chart`, `texel_coverage`: [page_count][page_size²], as in lx_bake.
lx_result lx_bake_map_build(uint32_t page_size, uint32_t page_count, const uint32_t *texel_chart, const uint8_t *texel_coverage, lx_bake_map *out,
                            lx_error *error);
void lx_bake_map_release(lx_bake_map *map);

/// Luxel `luxel`'s place on its page.
static inline uint32_t lx_luxel_x(const lx_luxel_map *map, uint32_t luxel)
{
    return map->texel[luxel] % map->page_size;
}

static inline uint32_t lx_luxel_y(const lx_luxel_map *map, uint32_t luxel)
{
    return map->texel[luxel] / map->page_size % map->page_size;
}

#endif
