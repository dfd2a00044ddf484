/// Seam stitching: where two charts meet, bilinear filtering reads different texels on the two sides of one edge. Texels along the edge are moved as
/// little as possible so that both sides show the same light.
///
/// What may move: luxels and padding texels within one bilinear footprint of a seam. Padding becomes entries of its own, behind the luxels.
///
/// Based on: [Iwanicki2013] "Lighting Technology of The Last of Us", SIGGRAPH 2013 (least squares over points along the seam); [Rakhteenko]
/// "Baking artifact-free lightmaps on the GPU" (padding takes part); solved by conjugate gradients, [Shewchuk1994].
///
/// Use, with bake/seams.h and bake/finished.h:
///     lx_seams_find(bake, &map, &seams, &seam_count, error);                                         // after rasterising
///     lx_stitch_create(&map, lx_finished_entries(finished), bake->texel_chart, seams, seam_count, &stitch, error); // after dilation
///     lx_finished_extend(finished, lx_stitch_texels(stitch), lx_stitch_texel_count(stitch), error);
///     // per layer, any thread: entries [luxel count + texel count], the luxels filled
///     lx_stitch_apply(stitch, entries, scratch);                                                     // scratch: lx_stitch_scratch_bytes
///     lx_finished_write(finished, layer, 0, lx_finished_count(finished), entries, error);
#ifndef LX_POST_STITCH_H
#define LX_POST_STITCH_H

#include "luxel/base.h"
#include "post/luxel_map.h"

/// One side of a seam: a straight line on a page, in texels (texel (i, j) has its centre at (i + 1/2, j + 1/2)), and the chart it borders.
typedef struct lx_seam_side {
    lx_vec2 from, to;
    uint32_t page, chart;
} lx_seam_side;

/// One edge in the world that lies on two charts: sides[0].from meets sides[1].from.
typedef struct lx_seam {
    lx_seam_side sides[2];
} lx_seam;

/// Immutable: all threads share it.
typedef struct lx_stitch lx_stitch;

/// `shown` [page_count * page_size²]: the luxel whose colour a texel shows (its own, or the one dilation took), LX_NO_LUXEL or above the map's count: none.
/// `chart` likewise, after dilation. Neither is kept. Where a side shows what it took from elsewhere because it is inside solid geometry, the seam
/// is left open.
lx_result lx_stitch_create(const lx_luxel_map *map, const uint32_t *shown, const uint32_t *chart, const lx_seam *seams, size_t seam_count,
                           lx_stitch **out_stitch, lx_error *error);
void lx_stitch_destroy(lx_stitch *stitch);

/// Padding texels that get colours of their own (page * page_size² + y * page_size + x), ascending; borrowed.
uint32_t lx_stitch_texel_count(const lx_stitch *stitch);
const uint32_t *lx_stitch_texels(const lx_stitch *stitch);

size_t lx_stitch_scratch_bytes(const lx_stitch *stitch);

/// `entries`: the luxels of one layer, which are adjusted, then lx_stitch_texel_count padding texels, which are written. Light that is black stays
/// black; nothing becomes negative.
void lx_stitch_apply(const lx_stitch *stitch, lx_rgb *entries, void *scratch);

#endif
