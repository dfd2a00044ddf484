/// Seams: edges in the world where two charts meet and light is continuous.
#ifndef LX_BAKE_SEAMS_H
#define LX_BAKE_SEAMS_H

#include "bake/bake.h"
#include "post/stitch.h"

/// Finds edges at which two charts meet, of one object or of two that touch: the same two ends, or collinear edges that overlap in part (boards and tiles of
/// unlike sizes). The surfaces go on from one to the other (within 15 degrees, on both sides of the edge), and nothing stands on the edge
/// that parts their light. The result depends on the scene and its atlas alone. Owned by the caller (lx_free).
lx_result lx_seams_find(const lx_bake *bake, lx_seam **out_seams, size_t *out_count, lx_error *error);

#endif
