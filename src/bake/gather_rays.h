/// Gather rays: from a luxel's sites to where the light is already known.
///
/// A cosine-weighted ray leaves a site; what it hits is looked up in the rows of the luxel there, for all layers at once. Hits nearer than a texel or two
/// (where a texel's mean says little), and on what has no valid luxel, go on as a path with next-event estimation until one can be looked up. Light
/// sources met by the first ray carry their multiple importance weight against the samples of trace/direct.h; nothing is counted twice.
///
/// Based on: [Jensen1996] final gathering over a cache of irradiance; [Ward1988]; here the cache is the lightmap itself.
#ifndef LX_BAKE_GATHER_RAYS_H
#define LX_BAKE_GATHER_RAYS_H

#include "bake/lookup.h"
#include "bake/rows.h"
#include "trace/direct.h"

/// What near hits take of a luxel beside its row of direct light.
typedef struct lx_gather_luxel {
    lx_rgb albedo;
    lx_vec3 centre;
    float texel_m;    ///< Its edge.
    float reach;      ///< How far from the centre a source is near: light of such ones is in no row of direct light, for it differs too much over the luxel.
    uint64_t near_sources; ///< Bit s modulo 64: source s may be near.
} lx_gather_luxel;

/// Is a source so near the luxel that its light differs too much over it? Never of one that is everywhere.
bool lx_gather_is_near(const lx_tracer *tracer, const lx_gather_luxel *luxel, uint32_t source);

typedef struct lx_gather_settings {
    const lx_tracer *tracer;
    const lx_lookup *lookup;
    const lx_source_use *uses;  ///< One per source of the tracer.
    const float *scales;        ///< [row_layers] rows and sums hold light × scale × 1 / LX_ROW_UNIT.
    uint32_t row_layers;        ///< lx_row_layers(layer count)
    uint32_t bounces;           ///< 0: only light sources are met.
    bool direct;                ///< Light sources met by the first ray count (those of mixed lights never, unless `everything`).
    bool everything;            ///< The cache's own rays: all light counts.
    const uint16_t *rows;       ///< [luxel][lx_row_stride(row_layers)] what a first hit reads: all bounces but one. NULL: nothing (or recorded, see below).
    const uint16_t *rows_later; ///< What later hits read: all bounces but two.
    const uint16_t *rows_direct; ///< Light straight from sources that are not near, for hits too near for all light to be looked up. NULL: they get light samples.
    const lx_gather_luxel *luxels; ///< [luxel], for rows_direct and near_met.
    const lx_sky_cells *sky_cells; ///< [target] where samples share the light of a uniform sky with first rays (lx_direct_tile). NULL: nowhere.
    uint32_t sky_cell_count;
    float near_texels;          ///< Hits nearer than so many texels of their surface are not looked up.
} lx_gather_settings;

typedef struct lx_gather_start {
    const lx_receiver *receiver;
    uint32_t stream; ///< Key of the luxel's random numbers.
    uint32_t sample; ///< Number of the ray within the stream.
    uint32_t target; ///< Row of the sums.
} lx_gather_start;

/// Where a later hit of a recorded ray found its light.
typedef struct lx_gather_extra {
    uint32_t target, luxel;
    lx_rgb weight;
} lx_gather_extra;

typedef struct lx_gather_extras {
    lx_gather_extra *items;
    size_t count, capacity;
} lx_gather_extras;

typedef struct lx_gather_output {
    float *sums;             ///< [target][3][row_layers], added to.
    float *met;              ///< Likewise, what the first rays themselves meet of light sources. NULL: that goes to `sums` too.
    uint64_t *sky_seen;      ///< [target] bit k: the one of the first sky_cell_count rays that leaves in cell k met the sky. NULL: not wanted.
    uint64_t *sky_through;   ///< Likewise, through a pane.
    float *near_met;         ///< As `met`, of emissive sources that are near luxel `targets`[target]. NULL: that goes to `met`.
    const uint32_t *targets; ///< [target] its luxel, beside near_met.
    float *distances;        ///< [start] to the first hit; INFINITY: none. NULL: not wanted.
    uint32_t *luxels;        ///< Recording (no rows are read): [start] luxel that the first hit may be looked up at, else LX_NO_LUXEL. NULL: rows are added.
    lx_gather_extras *extras; ///< Recording: later hits.
} lx_gather_output;

enum { lx_gather_batch_size = 4096 };

/// Gather rays of a luxel, where `samples` look at each light source.
static inline uint32_t lx_gather_rays(uint32_t samples)
{
    return lx_rays_per_sample * samples;
}

enum { lx_gather_most_pass_rays = 256 };

/// Rays of a luxel for the cache's passes, beside so many gather rays: a power of two. What they have of noise all luxels share that look it up, and no filter can tell; in a
/// scene of few luxels it does not average out either. Passes themselves cost next to nothing, but remember each ray's hit.
static inline uint32_t lx_gather_pass_rays(uint32_t rays, uint32_t luxels)
{
    enum { least = 16, usual = 64, enough = 1 << 24 }; // the last of all luxels together
    uint32_t count = least;
    while (count < lx_gather_most_pass_rays && 4 * count < rays && (count < usual || (uint64_t)count * luxels < enough)) count *= 2;
    return count;
}

/// Working memory of one worker.
typedef struct lx_gather_batch lx_gather_batch;
lx_gather_batch *lx_gather_batch_create(void);
void lx_gather_batch_destroy(lx_gather_batch *batch);
uint64_t lx_gather_batch_rays(const lx_gather_batch *batch);

/// Traces one ray from each start, and what follows. The order of additions depends on the arguments alone.
lx_result lx_gather_trace(lx_gather_batch *batch, const lx_gather_settings *settings, const lx_gather_start *starts, size_t count,
                          const lx_gather_output *output, lx_error *error);

#endif
