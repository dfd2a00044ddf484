/// Luxels: texels of the lightmap with their places in the world.
#ifndef LX_BAKE_LUXELS_H
#define LX_BAKE_LUXELS_H

#include "bake/bake.h"

/// The part of one texel's square that one triangle covers.
typedef struct lx_fragment {
    uint32_t surface, triangle;
    float area; ///< Share of the texel's square, 0…1.
} lx_fragment;

/// All fragments of a page, grouped by texel: those of texel i are first[i] … first[i + 1] - 1. All of a texel's fragments belong to one chart.
typedef struct lx_luxel_page {
    uint32_t *first;        ///< [page_size² + 1]
    lx_fragment *fragments;
} lx_luxel_page;

/// Conservative rasterisation of page `page`: fills `out`, and bake->texel_chart and bake->texel_coverage of that page.
/// Where two charts touch one texel the larger share wins.
lx_result lx_luxels_rasterise(lx_bake *bake, uint32_t page, lx_luxel_page *out, lx_error *error);
void lx_luxels_release(lx_luxel_page *page);

/// `count` places spread over the covered part of a texel, by area: positions on the surface, lifted off it where smooth shading asks for it and
/// pushed out of solid geometry. `stream` seeds the spread.
void lx_luxel_sites(const lx_bake *bake, const lx_luxel_page *page, uint32_t x, uint32_t y, uint32_t stream, uint32_t count,
                    lx_receiver *out);

#endif
