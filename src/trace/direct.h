/// Light that reaches luxels straight from one source, by as many shadow rays as its penumbras ask for.
///
/// A luxel's sites are all looked at, but few rays tell that a luxel is lit or dark altogether; only where a luxel or one of its neighbours saw both
/// do all samples get their rays. What a luxel gets depends on its sites, its stream and the source alone (and its neighbours' first rays), never on
/// other sources or on threads.
#ifndef LX_TRACE_DIRECT_H
#define LX_TRACE_DIRECT_H

#include "trace/sky_cells.h"
#include "trace/tracer.h"

enum { lx_direct_sites = 16 }; ///< Receivers per luxel.

/// A sphere around all sites of a tile and a cone around their geometric normals: what no source behind its horizon, out of range or
/// turned away can reach.
typedef struct lx_direct_bounds {
    lx_vec3 centre, axis;
    float radius;
    float half_angle; ///< Radians; pi: any direction.
} lx_direct_bounds;

/// The luxels of one tile.
typedef struct lx_direct_tile {
    uint32_t count;             ///< At most 32 × 32.
    const uint16_t *place;      ///< [count] y * 32 + x within the tile, ascending: who is whose neighbour.
    const uint32_t *chart;      ///< [count] only luxels of one chart are neighbours.
    const uint32_t *stream;     ///< [count] key of the luxel's random numbers.
    const lx_receiver *sites;   ///< [count][lx_direct_sites]
    const uint8_t *alone;       ///< [count] true: no gather rays leave the luxel, samples bring all light. NULL: they leave all.
    const lx_sky_cells *sky_cells; ///< [count] where samples of a uniform sky look besides the luxel's gather rays.
    uint32_t sky_cell_count;
    const lx_direct_bounds *bounds; ///< Of the sites, once for all sources; NULL: no source is left out at once.
} lx_direct_tile;

void lx_direct_find_bounds(const lx_direct_tile *tile, lx_direct_bounds *out);

/// Cosine-weighted rays that leave a luxel for each sample: they serve all sources at once and cost little, yet hold most of the noise.
enum { lx_rays_per_sample = 4 };

typedef struct lx_direct_settings {
    const lx_tracer *tracer;
    uint32_t samples;           ///< At most so many shadow rays a luxel and source (times lx_direct_sample_weight), a multiple of lx_direct_sites.
    float noise;                ///< Luxels that are surer than a share of it (standard error over light) take fewer. 0: all samples.
    bool all_rays;              ///< Every sample gets its ray: the referee of what is spared otherwise.
} lx_direct_settings;

/// Working memory of one worker.
typedef struct lx_direct_batch lx_direct_batch;
lx_direct_batch *lx_direct_batch_create(const lx_tracer *tracer); ///< NULL: no memory.
void lx_direct_batch_destroy(lx_direct_batch *batch);
uint64_t lx_direct_batch_rays(const lx_direct_batch *batch);

/// Irradiance of source `source` at unit strength: mean over the sites, with the variance of that mean. The share of emissive surfaces and
/// skies that cosine-weighted rays find better is left out: samples are weighed as `lx_sample_source(count = lx_direct_sample_weight)` says, hits have
/// lx_hit_weight with the same count, rays that leave the scene lx_sky_weight or, of a uniform sky, what lx_sky_samples_share leaves. `mean`: [cell][luxel of the tile] rgb; `variance`: [cell][luxel], of the mean of the channels.
/// False: nothing arrives anywhere in the tile; what `mean` and `variance` hold is undefined.
bool lx_direct_light(lx_direct_batch *batch, const lx_direct_settings *settings, const lx_direct_tile *tile, uint32_t source, lx_rgb *mean,
                     float *variance);

/// The `count` that weighs samples of a source against one cosine-weighted ray: 1 but for monitors. A matter of the source alone.
/// There are more rays than that; but samples are spread over the source alone, so they err by less than their number says.
uint32_t lx_direct_sample_weight(const lx_tracer *tracer, uint32_t source);

#endif
