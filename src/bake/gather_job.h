/// The gather integrator at work: what its parts share. See gather.c.
#ifndef LX_BAKE_GATHER_JOB_H
#define LX_BAKE_GATHER_JOB_H

#include "bake/bake_job.h"
#include "bake/gather_rays.h"
#include "bake/texel_sites.h"
#include "trace/direct.h"

enum {
    lx_gather_tile_luxels = lx_luxel_tile_edge * lx_luxel_tile_edge,
    lx_gather_chunk_luxels = 256,    ///< Of a tile, whose sums are at work at a time.
    lx_gather_largest_round = 256,   ///< Rays a luxel.
};

static const float lx_gather_darkest = 0.01f; ///< Of a layer's mean: below it errors count as if the texel were that bright.

/// Working memory of one worker.
typedef struct lx_gather_scratch {
    lx_gather_batch *batch;
    lx_direct_batch *direct;
    lx_texel texel;         // the one seen last
    lx_receiver *sites;     // [lx_gather_tile_luxels][lx_site_count]
    lx_gather_start *starts; // [lx_gather_chunk_luxels × rays of a round at most]
    float *sums;            // [2][lx_gather_chunk_luxels][3][row_layers], or [lx_gather_tile_luxels][3][row_layers]
    float *met;             // the same, of what rays meet of light sources
    float *near_light;      // [lx_gather_tile_luxels][3][row_layers] of sources near the luxel
    lx_rgb *mean;           // [cells][lx_gather_tile_luxels] of one source
    float *variance;
    uint32_t *found;        // [lx_gather_chunk_luxels][lx_gather_most_pass_rays]
    float *distances;       // likewise
    uint32_t stream[lx_gather_tile_luxels], chart[lx_gather_tile_luxels];
    uint16_t place[lx_gather_tile_luxels];
    uint32_t luxel[lx_gather_tile_luxels]; // of the map
    uint8_t alone[lx_gather_tile_luxels];  // it sends no gather rays
    uint64_t sky_seen[lx_gather_tile_luxels], sky_through[lx_gather_tile_luxels]; // cells in which the cache's rays met a uniform sky, and through a pane
    lx_sky_cells sky_cells[lx_gather_tile_luxels]; // of luxels of the tile, later of targets
    uint32_t count;              // luxels of the tile that are at work
} lx_gather_scratch;

// What a round knows of a tile.
typedef struct lx_gather_tile {
    bool done;
    uint8_t *frozen; // [layer] sure enough: its estimates stay as they are
} lx_gather_tile;

// What all layers at their authored colours add up to in a luxel, and how sure that is.
typedef struct lx_gather_sum {
    float value, direct_variance, indirect_variance; // layers taken as independent
    float difference, squares; // of the halves of the first round: of the sum, and the sum of the layers' squares
} lx_gather_sum;

// Squares of differences over the light's, summed over a tile's luxels: between the halves of a round, and between it and as many samples before it; in terms of the
// variance that either shows of the mean of both.
typedef struct lx_gather_halving {
    double within, between;
} lx_gather_halving;

typedef struct lx_gather_job {
    lx_bake_job *job;
    const lx_bake *bake;
    const lx_source_use *uses;
    uint32_t first_layer, layer_count, row_layers;
    size_t stride, row_stride; // values of a row of sums, and from one row of the cache to the next
    uint32_t luxel_count;
    lx_lookup lookup;
    float *scales;          // [row_layers]
    float *authored;        // [layer_count] mean channel of c
    lx_gather_luxel *luxels; // [luxel]
    float *closeness;       // [luxel] of what is around, 1 / m²; INFINITY: not to be interpolated
    lx_sky_cells *sky_cells; // [luxel] where samples look for a uniform sky besides gather rays; sky_cell_count of them
    uint8_t *spacing;       // [luxel] of the knots it is interpolated from; 0: it sends gather rays
    bool interpolates;
    bool samples_sky;       // it is of one colour
    float *radiosity;       // [luxel][3][row_layers] of all passes so far, times scale; until gathering begins it lives where `indirect` will
    uint16_t *rows[3];      // [luxel][row_stride], of them [3][row_layers]: what the last pass added, what the next one will, and with a number of bounces what the pass before the last added;
                            // in the end what gather rays read
    uint16_t *rows_direct;  // likewise, light straight from sources that are not near
    uint32_t pass;          // passes so far
    uint32_t pass_rays, sky_cell_count;
    uint32_t *hits;         // [luxel][pass_rays]
    lx_gather_extras *extras; // [tile]; targets are luxels of the tile
    lx_estimate *direct, *indirect; // [layer][luxel]
    size_t indirect_bytes;
    lx_estimate *met_estimates; // [those layers that gather rays may meet][luxel]: a part of direct light, taken into it after the last round
    lx_estimate **met;      // [layer] where among them; NULL: never met
    double *pass_change, *pass_energy; // [tile][layer]
    uint8_t *converged;     // [layer] needs no more passes
    lx_gather_tile *tiles;
    float *layer_means;     // [layer_count]
    lx_gather_halving *halvings;      // [tile][layer_count] of a round as long as all before
    float *gain;            // [layer_count] variance of gathered light over what halves of rounds show
    lx_gather_sum *sums;     // [luxel] of all groups
    lx_gather_scratch *scratch; // [worker]
    uint32_t round_first, round_count; // samples of the round
    lx_gather_settings settings;
} lx_gather_job;

/// Are bounces counted, rather than gone on with until no layer gains what counts?
static inline bool lx_gather_is_truncated(const lx_gather_job *g)
{
    return g->settings.bounces != LX_BOUNCES_INF;
}

/// Runs of the pool that follow one another are one stage to who watches: this one is the part from `from` on, `share` of the whole.
typedef struct lx_stage_part {
    const lx_progress_sink *sink;
    double from, share, start;
} lx_stage_part;

/// An lx_progress_func; `user` is an lx_stage_part.
bool lx_report_part(void *user, const lx_progress *progress);

/// Valid luxels of a tile, or those of them that send gather rays.
void lx_gather_list_luxels(const lx_gather_job *g, const lx_luxel_tile *tile, bool senders, lx_gather_scratch *s);
/// Some of the sites of a listed luxel.
void lx_gather_place_sites(const lx_gather_job *g, lx_gather_scratch *s, uint32_t index, uint32_t first, uint32_t count, lx_receiver *out);

/// Chooses where the listed luxels sample a uniform sky, by what the cache's rays met in them and around them: gather_sky.c.
void lx_gather_choose_sky_cells(const lx_gather_job *g, lx_gather_scratch *s);

/// Direct light and the irradiance cache's rays; then its passes, one a bounce beyond the first: gather_cache.c.
lx_result lx_gather_light(lx_gather_job *g, lx_error *error);
lx_result lx_gather_passes(lx_gather_job *g, lx_error *error);

/// The final gather, rounds of rays and then what is interpolated between them: gather_rounds.c. Rounds that would end after `deadline` (lx_seconds) are not begun.
lx_result lx_gather_rounds(lx_gather_job *g, double deadline, lx_error *error);

#endif
