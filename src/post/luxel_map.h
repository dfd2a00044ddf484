/// What post-processing knows of luxels: their places on the pages and in the world, as flat arrays.
///
/// Luxels are the covered texels, numbered tile by tile (lx_luxel_tile_edge² texels of a page), row by row within a tile: those of a tile
/// are consecutive, which is how they are baked and how they lie in memory.
#ifndef LX_POST_LUXEL_MAP_H
#define LX_POST_LUXEL_MAP_H

#include "math/vec.h"

#include <stdint.h>

#define LX_NO_LUXEL UINT32_MAX

enum { lx_luxel_tile_edge = 32 }; ///< texels; the same blocks the pack is stored in

typedef struct lx_luxel_map {
    uint32_t count;                ///< Luxels of all pages.
    uint32_t page_size, page_count;
    const uint32_t *texel;         ///< [count] page * page_size² + y * page_size + x.
    const uint32_t *index;         ///< [page_count * page_size²] number of the texel's luxel; LX_NO_LUXEL: not covered.
    const uint32_t *chart;         ///< [count] chart that owns the texel, numbered over the whole atlas.
    const lx_vec3 *position;       ///< [count] mean of its sites, world.
    const lx_vec3 *normal;         ///< [count] unit, interpolated.
    const float *size_m;           ///< [count] edge of the texel on the surface, metres.
    const uint8_t *valid;          ///< [count] false: inside solid geometry, its light means nothing.
} lx_luxel_map;

/// Irradiance of one luxel in one layer with the variance of its estimate.
typedef struct lx_estimate {
    lx_rgb mean;
    float variance; ///< Of the mean; of the channels' mean (r + g + b) / 3. 0: exact or unknown.
} lx_estimate;

#endif
