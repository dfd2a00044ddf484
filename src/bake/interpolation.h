/// Where indirect light changes so slowly that texels can be interpolated from others: knots on a grid within their tile.
///
/// What a patch at distance t sends to a surface changes over a step h by a share of the order of (h / t)², beyond what is linear in h. Summed over
/// the hemisphere, bilinear interpolation between knots errs by at most
///
///     1/2 · contrast · h² (a b + c d) · closeness,    closeness = mean over cosine-weighted rays of 1 / t²
///
/// of the light, with the luxel a and b texels from its knots along one axis, c and d along the other, and `contrast` for light that does not come evenly from all sides.
///
/// Based on: [Ward1988] G. J. Ward, F. M. Rubinstein, R. D. Clear, "A Ray Tracing Solution for Diffuse Interreflection" (the split sphere: how fast irradiance can
/// change where surfaces are so near); [Schwarzhaupt2012] J. Schwarzhaupt, H. W. Jensen, W. Jarosz, "Practical Hessian-Based Error Control for Irradiance Caching"
/// (second derivatives bound the error of interpolating).
#ifndef LX_BAKE_INTERPOLATION_H
#define LX_BAKE_INTERPOLATION_H

#include "bake/luxel_map.h"

typedef struct lx_knots {
    uint32_t count;     ///< 1 … 4
    uint32_t luxel[4];
    float weight[4];    ///< They add up to 1.
} lx_knots;

/// Grids of knots, coarse ones first: a luxel of a fine grid may have knots that were interpolated from a coarse one.
enum { lx_wide_spacing = 4, lx_narrow_spacing = 2 };

/// Knots of a luxel in the grid of `spacing` texels; false: it is a knot itself, or one of them has no luxel.
bool lx_find_knots(const lx_luxel_map *map, const lx_luxel_tile *tile, uint32_t luxel, uint32_t spacing, lx_knots *out);

/// Chooses the spacing by which each luxel of the tile is interpolated; 0: it needs rays of its own. `closeness`: [luxel] in 1 / m²; INFINITY: it neither is interpolated nor
/// serves as a knot. `bound`: share of its light by which interpolation may err. Writes spacing[tile->first …], reads nothing of other tiles.
void lx_choose_spacing(const lx_luxel_map *map, const lx_luxel_tile *tile, const float *closeness, float bound, uint8_t *spacing);

/// Calls `visit` for every luxel of the tile that is interpolated by its spacing, with its knots: those of the coarse grid first (to interpolate), or last (to hand back to knots
/// what was interpolated from them).
void lx_visit_interpolated(const lx_luxel_map *map, const lx_luxel_tile *tile, const uint8_t *spacing, bool coarse_first,
                           void (*visit)(void *user, uint32_t luxel, const lx_knots *knots), void *user);

#endif
