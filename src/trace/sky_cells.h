/// Directions around a normal, cut into cells of equal shares of cosine-weighted light: where samples of a uniform sky pay.
///
/// Most cells see all of the sky or nothing of it, and a few gather rays tell either without any noise. What varies lies in the few cells that an outline before the sky runs
/// through: those get samples besides. A cell is a rectangle of the unit square that cosine-weighted directions are drawn from, so samples and rays agree on it whatever
/// frame a site has, and Sobol points fill all cells alike.
#ifndef LX_TRACE_SKY_CELLS_H
#define LX_TRACE_SKY_CELLS_H

#include "math/vec.h"

#include <stdint.h>

enum { lx_sky_most_cells = 64 };

/// Cells of one luxel that samples look into; bit k: cell k.
typedef struct lx_sky_cells {
    uint64_t mixed;  ///< An outline runs through it, likely.
    uint64_t beside; ///< It may do.
} lx_sky_cells;

/// So many samples a cell has for each gather ray there.
static inline float lx_sky_per_ray(const lx_sky_cells *cells, uint32_t cell)
{
    static const float mixed = 2, beside = 0.5f;
    return cells->mixed >> cell & 1 ? mixed : cells->beside >> cell & 1 ? beside : 0;
}

/// What of a cell's light `per_ray` samples for each gather ray bring; rays bring the rest.
///
/// Looks of either kind would count alike; but a ray that misses the sky meets what shines a little like it, and the errors of both cancel in part. That is lost with what
/// samples bring, and they get so much less.
static inline float lx_sky_samples_share(float per_ray)
{
    return 0.9f * per_ray / (per_ray + 1);
}

/// `count` cells, a power of two up to lx_sky_most_cells, are rings of u.x, the square of the sine of the angle to the normal, times sectors of u.y, which goes around it.
static inline uint32_t lx_sky_sectors(uint32_t count)
{
    return count >= 32 ? 16 : count >= 8 ? 8 : count;
}

/// The cell of a point of the unit square.
static inline uint32_t lx_sky_cell_of(lx_vec2 u, uint32_t count)
{
    const uint32_t sectors = lx_sky_sectors(count);
    return (uint32_t)(u.x * (float)(count / sectors)) * sectors + (uint32_t)(u.y * (float)sectors);
}

/// Where the point of the unit square lies if a cell is all of it.
static inline lx_vec2 lx_sky_point_in(uint32_t cell, lx_vec2 u, uint32_t count)
{
    const uint32_t sectors = lx_sky_sectors(count), rings = count / sectors;
    return (lx_vec2){((float)(cell / sectors) + u.x) / (float)rings, ((float)(cell % sectors) + u.y) / (float)sectors};
}

#endif
