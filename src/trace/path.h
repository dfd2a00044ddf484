/// The unbiased path integrator: irradiance of all layers from the same paths. The referee of every faster method.
///
/// Based on: [Kajiya1986] the rendering equation; [Veach1997] chapters 8 to 10: next-event estimation, multiple importance sampling,
/// Russian roulette.
#ifndef LX_TRACE_PATH_H
#define LX_TRACE_PATH_H

#include "trace/light_sample.h"

/// What becomes of the light of one source.
typedef struct lx_source_use {
    int32_t layer;  ///< Where it is added; -1: left out. For a source told by cell the layer of cell 0; the others follow.
    lx_rgb weight;  ///< Multiplies it: 1 for a layer of one source, its share in a group, authored colour × intensity when combined.
    bool direct;    ///< False: what comes straight from the source to the path's start is left out (mixed lights).
    const lx_rgb *cells; ///< For a source told by cell: all of it goes to `layer`, each cell's light times its colour here. NULL: every cell
                         ///< has its own layer.
} lx_source_use;

/// How many layers, from `use->layer` on, source `source` is a part of.
static inline uint32_t lx_source_use_layers(const lx_source_use *use, const lx_tracer *tracer, uint32_t source)
{
    return use->cells ? 1 : lx_tracer_cell_count(tracer, source);
}

typedef struct lx_path_settings {
    const lx_tracer *tracer;
    const lx_source_use *uses; ///< One per source of the tracer.
    uint32_t layer_count;
    uint32_t bounces;      ///< LX_BOUNCES_INF: ended by roulette alone.
    bool direct, indirect; ///< False: light that arrives straight, or after a bounce, is left out.
} lx_path_settings;

/// One path: where it starts, which random numbers it takes, where its estimate goes.
typedef struct lx_path_start {
    lx_receiver receiver;
    lx_rgb weight;   ///< Multiplies what the path adds; 1 for irradiance.
    uint32_t stream; ///< Key of the start's random streams: a hash of seed, page and texel.
    uint32_t sample; ///< Number of the path within the stream.
    uint32_t target; ///< Row of the sums.
} lx_path_start;

enum { lx_path_batch_size = 2048 };

/// Working memory of one worker.
typedef struct lx_path_batch lx_path_batch;
lx_path_batch *lx_path_batch_create(void);
void lx_path_batch_destroy(lx_path_batch *batch);
/// Rays traced with this batch so far, of both kinds.
uint64_t lx_path_batch_rays(const lx_path_batch *batch);

/// Traces `count` <= lx_path_batch_size paths and adds each one's estimate to
/// sums[(target * layer_count + layer) * 3 + channel]. `back_hits` (may be NULL): back_hits[target] counts paths whose first ray met the
/// black side of a surface. The order of additions depends on the arguments alone.
void lx_path_trace(lx_path_batch *batch, const lx_path_settings *settings, const lx_path_start *starts, size_t count, double *sums,
                   uint32_t *back_hits);

/// Stream key of a point: (seed, a, b) → 32 well-mixed bits.
uint32_t lx_stream_key(uint32_t seed, uint32_t a, uint32_t b);

#endif
