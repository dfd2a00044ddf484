// All layers and all bounces for the price of one gather ray: [transport 4] in docs/architecture.md.
//
// 1. Direct light of every luxel and layer by shadow rays (trace/direct.h), and some cosine-weighted rays a luxel, traced once: what they hit is kept.
// 2. Passes: radiosity of every luxel <- albedo × (direct light + mean over its rays of the radiosity there), for all layers at once: a sparse matrix
//    times a dense one. One more pass is one more bounce.
// 3. Final gather: many more rays, in rounds; they read the radiosity where they hit. Half of a round against the other tells how sure the mean is; tiles where
//    every layer is sure enough take part in no further round, and a layer that is sure enough stays as it is while others go on.
//
// Rays never depend on light, so a layer's texels depend on its own sources alone. (Light samples at near hits are drawn per source.)
#include "bake/bake_job.h"

#include "bake/finish.h"
#include "bake/gather_rays.h"
#include "bake/interpolation.h"
#include "bake/memory_plan.h"
#include "bake/texel_sites.h"
#include "base/clock.h"
#include "base/error.h"
#include "math/hash.h"
#include "trace/direct.h"
#include "trace/tracer_data.h"

#include <stdlib.h>
#include <string.h>

enum {
    tile_luxels = lx_luxel_tile_edge * lx_luxel_tile_edge,
    chunk_luxels = 256,    // of a tile, whose sums are at work at a time
    first_round = 32,      // rays a luxel
    largest_round = 256,
    enough_luxels = 64,    // of a tile, to tell its error from one pair of halves each
    rays_per_site = 8,     // in a round
    most_pass_rays = 32,
    most_passes = 1000,
};

static const float near_texels = 1.0f, pass_near_texels = 1.0f;
static const double enough_energy = 1e-3; // of a layer's: what later bounces may still have added
static const float darkest = 0.01f;      // of a layer's mean: below it errors count as if the texel were that bright
// Variances of one look at the sky, as a share of it, from which on it is sampled besides, and four times as often.
static const float some_sky_variance = 0.02f, much_sky_variance = 0.1f;
static const uint32_t cache_stream = 0x63616368;

typedef struct gather_scratch {
    lx_gather_batch *batch;
    lx_direct_batch *direct;
    lx_receiver *sites;     // [tile_luxels][lx_site_count]
    lx_gather_start *starts; // [chunk_luxels × rays of a round at most]
    float *sums;            // [2][chunk_luxels][3][row_layers], or [tile_luxels][3][row_layers]
    float *met;             // the same, of what rays meet of light sources
    lx_rgb *mean;           // [cells][tile_luxels] of one source
    float *variance;
    uint32_t *found;        // [chunk_luxels][most_pass_rays]
    float *distances;       // likewise
    uint32_t stream[tile_luxels], chart[tile_luxels];
    uint16_t place[tile_luxels];
    uint32_t luxel[tile_luxels]; // of the map
    uint8_t alone[tile_luxels];  // it sends no gather rays
    lx_rgb sky_light[tile_luxels]; // what the cache's rays met of the sky
    uint8_t sky_weight[tile_luxels]; // of luxels of the tile, later of targets
    uint32_t count;              // luxels of the tile that are at work
} gather_scratch;

// What a round knows of a tile.
typedef struct tile_state {
    bool done;
    uint8_t *frozen; // [layer] sure enough: its estimates stay as they are
} tile_state;

// What all layers at their authored colours add up to in a luxel, and how sure that is.
typedef struct sum_estimate {
    float value, direct_variance, indirect_variance; // layers taken as independent
    float difference, squares; // of the halves of the first round: of the sum, and the sum of the layers' squares
} sum_estimate;

// Squares of differences over the light's, summed over a tile's luxels: between the halves of a round, and between it and as many samples before it; in terms of the
// variance that either shows of the mean of both.
typedef struct halving {
    double within, between;
} halving;

typedef struct gather_job {
    lx_bake_job *job;
    const lx_bake *bake;
    const lx_source_use *uses;
    uint32_t first_layer, layer_count, row_layers;
    size_t stride;          // values of a row
    uint32_t luxel_count;
    lx_lookup lookup;
    float *scales;          // [row_layers]
    float *authored;        // [layer_count] mean channel of c
    lx_rgb *albedo;         // [luxel]
    float *closeness;       // [luxel] of what is around, 1 / m²; INFINITY: not to be interpolated
    uint8_t *sky_weight;    // [luxel] of samples of a uniform sky against gather rays; 0: those alone look for it
    uint8_t *spacing;       // [luxel] of the knots it is interpolated from; 0: it sends gather rays
    bool interpolates;
    bool samples_sky;       // it is of one colour
    float *radiosity;       // [luxel][3][row_layers] of all passes so far, times scale; until gathering begins it lives where `indirect` will
    uint16_t *rows[3];      // [luxel][3][row_layers] what the last pass added, what the next one will, and with a number of bounces what the pass before the last added;
                            // in the end what gather rays read
    uint16_t *rows_direct;  // [luxel][3][row_layers] light straight from the sources
    uint32_t pass;          // passes so far
    uint32_t pass_rays;
    uint32_t *hits;         // [luxel][pass_rays]
    lx_gather_extras *extras; // [tile]; targets are luxels of the tile
    lx_estimate *direct, *indirect; // [layer][luxel]
    size_t indirect_bytes;
    lx_estimate *met_estimates; // [those layers that gather rays may meet][luxel]: a part of direct light, taken into it after the last round
    lx_estimate **met;      // [layer] where among them; NULL: never met
    double *pass_change, *pass_energy; // [tile][layer]
    uint8_t *converged;     // [layer] needs no more passes
    tile_state *tiles;
    float *layer_means;     // [layer_count]
    halving *halvings;      // [tile][layer_count] of a round as long as all before
    float *gain;            // [layer_count] variance of gathered light over what halves of rounds show
    sum_estimate *sums;     // [luxel] of all groups
    gather_scratch *scratch; // [worker]
    uint32_t round_first, round_count; // samples of the round
    lx_gather_settings settings;
} gather_job;

// ---- progress -----------------------------------------------------------------------------------------------------------------

// Runs of the pool that follow one another are one stage to who watches: this one is the part from `from` on, `share` of the whole.
typedef struct stage_part {
    const lx_progress_sink *sink;
    double from, share, start;
} stage_part;

static bool report_part(void *user, const lx_progress *progress)
{
    const stage_part *part = user;
    if (!part->sink || !part->sink->func) return true;
    const lx_progress whole = {progress->stage, part->from + part->share * progress->fraction, lx_seconds() - part->start};
    return part->sink->func(part->sink->user, &whole);
}

// ---- tiles -----------------------------------------------------------------------------------------------------------------------

static uint32_t max_cells(const gather_job *g)
{
    uint32_t most = 1;
    for (uint32_t s = 0; s < g->bake->source_count; ++s) {
        const uint32_t cells = lx_tracer_cell_count(g->bake->tracer, s);
        if (cells > most) most = cells;
    }
    return most;
}

// Valid luxels of a tile, or those of them that send gather rays.
static void list_luxels(const gather_job *g, const lx_luxel_tile *tile, bool senders, gather_scratch *s)
{
    const lx_luxel_map *map = &g->job->map.view;
    s->count = 0;
    for (uint32_t i = tile->first; i < tile->first + tile->count; ++i) {
        if (!map->valid[i] || (senders && g->spacing[i] > 0)) continue;
        uint32_t texel;
        const lx_luxel_page *page = lx_job_page(g->job, i, &texel);
        s->luxel[s->count] = i;
        s->chart[s->count] = map->chart[i];
        s->stream[s->count] = lx_luxel_stream(g->bake, page, texel);
        s->place[s->count++] = (uint16_t)((lx_luxel_y(map, i) - tile->y) * lx_luxel_tile_edge + lx_luxel_x(map, i) - tile->x);
    }
}

static void place_sites(const gather_job *g, const gather_scratch *s, uint32_t index, uint32_t first, uint32_t count, lx_receiver *out)
{
    uint32_t texel;
    const lx_luxel_page *page = lx_job_page(g->job, s->luxel[index], &texel);
    lx_luxel_sites(g->bake, page, texel, first, count, out);
}

// Mean albedo of a luxel: what its row is multiplied by. Hits that are looked up lie farther than a texel, where no finer detail can be told.
static lx_rgb mean_albedo(const gather_job *g, uint32_t luxel)
{
    enum { places = 8 };
    uint32_t texel;
    const lx_luxel_page *page = lx_job_page(g->job, luxel, &texel);
    lx_texel t;
    lx_texel_open(&t, g->bake, page, texel);
    lx_ray rays[places];
    lx_hit hits[places];
    lx_shading shading[places];
    for (uint32_t k = 0; k < places; ++k) {
        lx_receiver r;
        const lx_piece *piece = lx_texel_site(&t, k * (lx_site_count / places), &r);
        const lx_fragment *f = &t.fragments[piece->fragment];
        const lx_vec2 b = lx_piece_barycentrics(piece, r.position);
        rays[k] = (lx_ray){.origin = r.position, .direction = lx_neg(r.geometric_normal), .t_max = 1};
        hits[k] = (lx_hit){.surface = f->surface, .triangle = f->triangle, .u = b.x, .v = b.y};
    }
    lx_shade_hits(g->bake->tracer, rays, hits, shading, places);
    lx_rgb sum = {0, 0, 0};
    for (uint32_t k = 0; k < places; ++k) sum = lx_rgb_add(sum, shading[k].albedo);
    return lx_rgb_scale(sum, 1.0f / places);
}

// ---- direct light and the cache's rays -----------------------------------------------------------------------------------------------

// Adds a source's direct light to its layers: to the estimates if it counts there, to the cache's rows always.
static void add_source(const gather_job *g, gather_scratch *s, uint32_t source, bool counts)
{
    const lx_source_use *use = &g->uses[source];
    const uint32_t cells = lx_tracer_cell_count(g->bake->tracer, source);
    for (uint32_t cell = 0; cell < cells; ++cell) {
        const uint32_t layer = (uint32_t)use->layer + (use->cells ? 0 : cell);
        const lx_rgb weight = use->cells ? lx_rgb_mul(use->weight, use->cells[cell]) : use->weight;
        const float grey_weight = (weight.r + weight.g + weight.b) / 3;
        const float unit = g->scales[layer];
        lx_estimate *estimates = g->direct + (size_t)layer * g->luxel_count;
        for (uint32_t i = 0; i < s->count; ++i) {
            const lx_rgb e = lx_rgb_mul(s->mean[(size_t)cell * s->count + i], weight);
            float *row = s->sums + g->stride * i + layer;
            row[0] += e.r * unit;
            row[g->row_layers] += e.g * unit;
            row[2 * g->row_layers] += e.b * unit;
            if (!counts) continue;
            lx_estimate *estimate = &estimates[s->luxel[i]];
            estimate->mean = lx_rgb_add(estimate->mean, e);
            estimate->variance += s->variance[(size_t)cell * s->count + i] * grey_weight * grey_weight;
        }
    }
}

// Extras of a tile lie in the order in which paths ended; they are added after the luxel's plain hits, luxel by luxel.
static int compare_extras(const void *a, const void *b)
{
    const lx_gather_extra *x = a, *y = b;
    if (x->target != y->target) return x->target < y->target ? -1 : 1;
    if (x->luxel != y->luxel) return x->luxel < y->luxel ? -1 : 1;
    return memcmp(&x->weight, &y->weight, sizeof x->weight);
}

// What a luxel's cosine-weighted rays hit, as interpolation asks: the mean of 1 / distance².
static float find_closeness(const float *distances, uint32_t count)
{
    float sum = 0;
    for (uint32_t k = 0; k < count; ++k) sum += 1 / (distances[k] * distances[k]);
    return sum / (float)count;
}

// The cache's rays of a tile: their hits are recorded; what they bring by themselves is added to the sums, in 1 / LX_ROW_UNIT for each ray, and what they meet at once to
// the sums of that.
static lx_result send_pass_rays(const gather_job *g, gather_scratch *s, size_t task, lx_error *error)
{
    const lx_gather_settings settings = {.tracer = g->bake->tracer, .lookup = &g->lookup, .uses = g->uses, .scales = g->scales,
                                         .row_layers = g->row_layers, .bounces = g->settings.bounces, .everything = true, .near_texels = pass_near_texels};
    lx_gather_extras *extras = &g->extras[task];
    for (uint32_t first = 0; first < s->count; first += chunk_luxels) {
        const uint32_t end = first + chunk_luxels < s->count ? first + chunk_luxels : s->count;
        size_t count = 0;
        for (uint32_t i = first; i < end; ++i)
            for (uint32_t k = 0; k < g->pass_rays; ++k)
                s->starts[count++] = (lx_gather_start){.receiver = &s->sites[i * lx_site_count + k % lx_site_count],
                                                       .stream = s->stream[i] ^ cache_stream, .sample = k, .target = i};
        const lx_gather_output out = {.sums = s->sums, .met = s->met, .sky_light = s->sky_light, .distances = s->distances, .luxels = s->found, .extras = extras};
        const lx_result result = lx_gather_trace(s->batch, &settings, s->starts, count, &out, error);
        if (result != LX_OK) return result;
        for (uint32_t i = first; i < end; ++i) {
            const size_t ray = (size_t)(i - first) * g->pass_rays;
            if (settings.bounces > 0) memcpy(g->hits + (size_t)s->luxel[i] * g->pass_rays, s->found + ray, g->pass_rays * sizeof *g->hits);
            g->closeness[s->luxel[i]] = find_closeness(s->distances + ray, g->pass_rays);
        }
    }
    for (size_t k = 0; k < extras->count; ++k) extras->items[k].target = s->luxel[extras->items[k].target];
    if (extras->count) qsort(extras->items, extras->count, sizeof *extras->items, compare_extras);
    return LX_OK;
}

// Which luxels of the tile will send gather rays. Those that won't get all their direct light from samples.
static void choose_senders(const gather_job *g, gather_scratch *s, const lx_luxel_tile *tile)
{
    const lx_luxel_map *map = &g->job->map.view;
    if (!g->interpolates) return;
    for (uint32_t i = tile->first; i < tile->first + tile->count; ++i) {
        uint32_t texel;
        const lx_luxel_page *page = lx_job_page(g->job, i, &texel);
        if (!map->valid[i] || !lx_luxel_is_whole(g->bake, page, texel)) g->closeness[i] = INFINITY;
    }
    lx_choose_spacing(map, tile, g->closeness, g->bake->desc.interpolation, g->spacing);
    for (uint32_t i = 0; i < s->count; ++i) s->alone[i] = g->spacing[s->luxel[i]] > 0;
}

// How often a luxel samples a uniform sky beside its gather rays, which look for it too: by the variance of one look, as the cache's rays in the luxel and around it tell; where
// they saw all of it or nothing, not at all. (The rays that decide are others than those that count, so nothing is lost on average.)
static void weigh_sky(const gather_job *g, gather_scratch *s)
{
    enum { edge = lx_luxel_tile_edge };
    float seen[edge + 2][edge + 2], lists[edge + 2][edge + 2];
    memset(seen, 0, sizeof seen);
    memset(lists, 0, sizeof lists);
    for (uint32_t i = 0; i < s->count; ++i) {
        const uint32_t x = s->place[i] % edge + 1, y = s->place[i] / edge + 1;
        seen[y][x] = lx_rgb_max(s->sky_light[i]) / (LX_PI * (float)g->pass_rays);
        lists[y][x] = 1;
    }
    for (uint32_t i = 0; i < s->count; ++i) {
        float sum = 0, count = 0;
        for (uint32_t k = 0; k < 9; ++k) {
            const uint32_t x = s->place[i] % edge + k % 3, y = s->place[i] / edge + k / 3;
            sum += seen[y][x];
            count += lists[y][x];
        }
        const float share = sum / count, variance = share * (1 - share);
        uint8_t weight = variance > much_sky_variance ? 4 : variance > some_sky_variance;
        if (s->alone[i] && weight == 0) weight = 1;
        s->sky_weight[i] = g->sky_weight[s->luxel[i]] = weight;
    }
}

// The cache's rays met a uniform sky as if nobody else looked for it: what samples share with them is taken from their part again.
static void share_sky(const gather_job *g, gather_scratch *s, const lx_source_use *use)
{
    const float unit = g->scales[use->layer] / (float)g->pass_rays;
    for (uint32_t i = 0; i < s->count; ++i) {
        if (s->alone[i]) continue; // their part is gone already
        const lx_rgb taken = lx_rgb_scale(lx_rgb_mul(s->sky_light[i], use->weight), (1 - lx_uniform_sky_weight(s->sky_weight[i])) * unit);
        float *row = s->sums + g->stride * i + use->layer;
        row[0] -= taken.r;
        row[g->row_layers] -= taken.g;
        row[2 * g->row_layers] -= taken.b;
    }
}

static void light_from_sources(const gather_job *g, gather_scratch *s)
{
    const lx_bake_desc *desc = &g->bake->desc;
    lx_direct_bounds bounds;
    lx_direct_tile direct = {.count = s->count, .place = s->place, .chart = s->chart, .stream = s->stream, .sites = s->sites, .alone = s->alone,
                             .sky_weight = s->sky_weight};
    lx_direct_find_bounds(&direct, &bounds);
    direct.bounds = &bounds;
    const lx_direct_settings settings = {.tracer = g->bake->tracer, .samples = (desc->samples + lx_direct_sites - 1) / lx_direct_sites * lx_direct_sites,
                                         .noise = desc->noise};
    for (uint32_t source = 0; source < g->bake->source_count; ++source) {
        const lx_source_use *use = &g->uses[source];
        const bool counts = use->direct && !desc->indirect_only;
        if (use->layer < 0 || (!counts && g->settings.bounces == 0)) continue;
        if (lx_pool_is_stopping(g->bake->scene->context->pool)) return;
        if (lx_direct_light(s->direct, &settings, &direct, source, s->mean, s->variance)) add_source(g, s, source, counts);
        if (g->samples_sky && source == g->bake->source_count - 1 && g->settings.bounces > 0) share_sky(g, s, use); // the sky comes last
    }
}

// Irradiance × unit becomes radiosity.
static void reflect(const gather_job *g, uint32_t luxel, const float *irradiance, float unit, float *radiosity, uint16_t *row)
{
    const lx_rgb a = g->albedo[luxel];
    const float factor[3] = {a.r * unit, a.g * unit, a.b * unit};
    for (size_t c = 0; c < 3; ++c)
        for (size_t l = c * g->row_layers; l < (c + 1) * g->row_layers; ++l) {
            const float value = factor[c] * irradiance[l];
            if (radiosity) radiosity[l] = value;
            row[l] = lx_row_encode(value);
        }
}

static lx_result light_tile(void *user, size_t task, uint32_t worker, lx_error *error)
{
    const gather_job *g = user;
    const lx_luxel_tile *tile = &g->job->map.tiles[task];
    gather_scratch *s = &g->scratch[worker];
    list_luxels(g, tile, false, s);
    for (uint32_t i = 0; i < s->count; ++i) place_sites(g, s, i, 0, lx_site_count, s->sites + (size_t)i * lx_site_count);
    const size_t row_values = g->stride * s->count;
    memset(s->sums, 0, row_values * sizeof *s->sums);
    memset(s->alone, 0, s->count);
    memset(s->sky_light, 0, s->count * sizeof *s->sky_light);
    const bool bounces = g->settings.bounces > 0;
    if (bounces || g->interpolates || g->samples_sky) { // direct light must know as well
        memset(s->met, 0, row_values * sizeof *s->met);
        const lx_result result = send_pass_rays(g, s, task, error);
        if (result != LX_OK) return result;
        choose_senders(g, s, tile);
        if (g->samples_sky) weigh_sky(g, s);
    }
    if (bounces) {
        const float ray_unit = LX_ROW_UNIT / (float)g->pass_rays;
        for (uint32_t i = 0; i < s->count; ++i) {
            g->albedo[s->luxel[i]] = mean_albedo(g, s->luxel[i]);
            reflect(g, s->luxel[i], s->sums + g->stride * i, ray_unit, NULL, g->rows[1] + g->stride * s->luxel[i]); // the first pass adds it
        }
        for (size_t i = 0; i < s->count; ++i)
            for (size_t k = g->stride * i; k < g->stride * (i + 1); ++k)
                s->sums[k] = s->alone[i] ? 0 : s->met[k] * ray_unit;
    }
    light_from_sources(g, s);
    for (uint32_t i = 0; bounces && i < s->count; ++i) {
        const size_t row = g->stride * s->luxel[i];
        reflect(g, s->luxel[i], s->sums + g->stride * i, 1, g->radiosity + row, g->rows[0] + row);
        memcpy(g->rows_direct + row, g->rows[0] + row, g->stride * sizeof *g->rows_direct);
    }
    return LX_OK;
}

// ---- passes -------------------------------------------------------------------------------------------------------------------------

static bool is_truncated(const gather_job *g)
{
    return g->settings.bounces != LX_BOUNCES_INF;
}

static lx_result pass_tile(void *user, size_t task, uint32_t worker, lx_error *error)
{
    (void)error;
    const gather_job *g = user;
    const lx_luxel_tile *tile = &g->job->map.tiles[task];
    // What recorded paths found behind a near hit is a bounce further: where bounces are counted, of the pass before.
    const uint16_t *from = g->rows[0], *from_later = is_truncated(g) ? g->rows[2] : g->rows[0];
    float *sums = g->scratch[worker].sums;
    double *change = g->pass_change + task * g->layer_count, *energy = g->pass_energy + task * g->layer_count;
    memset(change, 0, g->layer_count * sizeof *change);
    memset(energy, 0, g->layer_count * sizeof *energy);
    const lx_gather_extras *extras = &g->extras[task];
    size_t extra = 0;
    const float unit = 1 / (float)g->pass_rays;
    for (uint32_t i = tile->first; i < tile->first + tile->count; ++i) {
        if (!g->job->map.valid[i]) continue;
        memset(sums, 0, g->stride * sizeof *sums);
        const uint32_t *hits = g->hits + (size_t)i * g->pass_rays;
        for (uint32_t k = 0; k < g->pass_rays; ++k)
            if (hits[k] != LX_NO_LUXEL) __builtin_prefetch(from + g->stride * hits[k]);
        for (uint32_t k = 0; k < g->pass_rays; ++k)
            if (hits[k] != LX_NO_LUXEL) lx_row_add(sums, from + g->stride * hits[k], g->stride);
        for (; extra < extras->count && extras->items[extra].target == i; ++extra) {
            const lx_gather_extra *e = &extras->items[extra];
            const float weight[3] = {e->weight.r, e->weight.g, e->weight.b};
            lx_row_add_scaled(sums, from_later + g->stride * e->luxel, g->row_layers, weight);
        }
        float *radiosity = g->radiosity + g->stride * i;
        uint16_t *row = g->rows[1] + g->stride * i;
        const lx_rgb a = g->albedo[i];
        const float factor[3] = {a.r * LX_ROW_UNIT * unit, a.g * LX_ROW_UNIT * unit, a.b * LX_ROW_UNIT * unit};
        for (size_t c = 0; c < 3; ++c)
            for (size_t l = 0; l < g->layer_count; ++l) {
                const size_t at = c * g->row_layers + l;
                if (g->converged[l]) {
                    row[at] = 0;
                    continue;
                }
                float value = factor[c] * sums[at];
                if (g->pass == 0) value += lx_row_decode_small(row[at]) * LX_ROW_UNIT; // light that those paths found themselves
                row[at] = lx_row_encode(value);
                radiosity[at] += value;
                change[l] += (double)value;
                energy[l] += (double)radiosity[at];
            }
    }
    return LX_OK;
}

// What gather rays read: rows[0] the sum of all passes, for first hits; where bounces are counted rows[1], that without the last, for later ones, which are a bounce further.
static lx_result sum_rows(void *user, size_t task, uint32_t worker, lx_error *error)
{
    (void)worker;
    (void)error;
    const gather_job *g = user;
    const lx_luxel_tile *tile = &g->job->map.tiles[task];
    const bool truncated = is_truncated(g);
    for (size_t i = g->stride * tile->first; i < g->stride * ((size_t)tile->first + tile->count); ++i) {
        const float last = truncated ? lx_row_decode_small(g->rows[0][i]) * LX_ROW_UNIT : 0;
        g->rows[0][i] = lx_row_encode(g->radiosity[i]);
        if (truncated) g->rows[1][i] = lx_row_encode(g->radiosity[i] - last);
    }
    return LX_OK;
}

// `wanted` bounces beyond the first; LX_BOUNCES_INF: until no layer gains what counts.
static lx_result run_passes(gather_job *g, uint32_t wanted, lx_error *error)
{
    lx_result result = LX_OK;
    lx_bake_job *job = g->job;
    lx_pool *pool = g->bake->scene->context->pool;
    double *changes = lx_calloc_array(g->layer_count, sizeof *changes); // of the last pass
    if (!changes) return lx_fail_memory(error, "irradiance cache");
    memset(g->converged, 0, g->layer_count);
    stage_part part = {.sink = job->progress, .start = lx_seconds()};
    const lx_progress_sink sink = {report_part, &part};
    const uint32_t limit = wanted < most_passes ? wanted : most_passes;
    for (uint32_t pass = 0; pass < limit; ++pass) {
        const double expected = wanted == LX_BOUNCES_INF ? pass + 4.0 : limit; // nobody knows how many it will take
        part.from = pass / expected;
        part.share = 1 / (expected + (wanted == LX_BOUNCES_INF)) * (1 - part.from);
        LX_TRY(lx_pool_run_weighted(pool, job->map.tile_count, job->tile_weights, pass_tile, g, "cache", &sink, error));
        ++g->pass;
        uint16_t *last = g->rows[0], *free_rows = is_truncated(g) ? g->rows[2] : last;
        g->rows[0] = g->rows[1];
        g->rows[1] = free_rows;
        if (is_truncated(g)) g->rows[2] = last;
        if (wanted != LX_BOUNCES_INF) continue;
        bool all = true;
        for (uint32_t l = 0; l < g->layer_count; ++l) {
            double change = 0, energy = 0;
            for (uint32_t t = 0; t < job->map.tile_count; ++t) {
                change += g->pass_change[(size_t)t * g->layer_count + l];
                energy += g->pass_energy[(size_t)t * g->layer_count + l];
            }
            if (g->converged[l]) continue;
            // Each bounce is about `ratio` of the one before: what is still to come is the rest of a geometric series.
            const double ratio = changes[l] > 0 ? fmin(change / changes[l], 0.99) : 0.9;
            if (!(change * ratio / (1 - ratio) > enough_energy * energy)) g->converged[l] = 1;
            changes[l] = change;
            all &= g->converged[l] != 0;
        }
        if (all) break;
    }
    part.from = 1;
    part.share = 0;
    LX_TRY(lx_pool_run(pool, job->map.tile_count, sum_rows, g, "cache", &sink, error));
cleanup:
    lx_free(changes);
    return result;
}

// ---- final gather ---------------------------------------------------------------------------------------------------------------------

// The round's rays of luxels first … end - 1 of the list; the first half of a luxel's samples and the second have sums of their own.
static size_t make_starts(const gather_job *g, gather_scratch *s, uint32_t first, uint32_t end)
{
    const uint32_t n = g->round_count, half = (n + 1) / 2;
    size_t count = 0;
    for (uint32_t i = first; i < end; ++i) {
        lx_receiver *sites = s->sites + (size_t)(i - first) * lx_site_count;
        const uint32_t first_site = g->round_first / rays_per_site % lx_site_count;
        const uint32_t sites_wanted = (n + rays_per_site - 1) / rays_per_site;
        const uint32_t site_count = sites_wanted < lx_site_count ? sites_wanted : lx_site_count;
        const uint32_t straight = first_site + site_count <= lx_site_count ? site_count : lx_site_count - first_site;
        place_sites(g, s, i, first_site, straight, sites);
        if (straight < site_count) place_sites(g, s, i, 0, site_count - straight, sites + straight);
        s->sky_weight[i - first] = s->sky_weight[chunk_luxels + i - first] = g->sky_weight[s->luxel[i]];
        for (uint32_t k = 0; k < n; ++k)
            s->starts[count++] = (lx_gather_start){.receiver = &sites[k / rays_per_site % site_count], .stream = s->stream[i],
                                                   .sample = g->round_first + k, .target = (k < half ? 0u : chunk_luxels) + i - first};
    }
    return count;
}

static float grey(lx_rgb c)
{
    return (c.r + c.g + c.b) / 3;
}

// Takes the round's sums of one layer into the estimate of one luxel. Returns how far the halves' means are apart.
static float take_round(const gather_job *g, const float *a, const float *b, float unit, lx_estimate *e)
{
    const uint32_t n = g->round_count, half = (n + 1) / 2;
    const float before = (float)g->round_first, after = before + (float)n, old = before / after, new = unit / after;
    const float of_a = unit / (float)half / 3, of_b = n > half ? unit / (float)(n - half) / 3 : 0;
    float sum[3], difference = 0;
    for (size_t c = 0; c < 3; ++c) {
        const float x = a[c * g->row_layers], y = b[c * g->row_layers];
        sum[c] = x + y;
        difference += x * of_a - y * of_b;
    }
    if (n == half) difference = 0;
    const float share = (float)n / after;
    e->mean.r = e->mean.r * old + sum[0] * new;
    e->mean.g = e->mean.g * old + sum[1] * new;
    e->mean.b = e->mean.b * old + sum[2] * new;
    e->variance = e->variance * (old * old) + difference * difference / 4 * (share * share);
    return difference;
}

// Takes the round's sums into the estimates of luxels from … end - 1 of the list, of the chunk that begins with `first`: layer by layer, as estimates lie in memory.
static void fold_block(const gather_job *g, const tile_state *state, const gather_scratch *s, size_t task, uint32_t first, uint32_t from, uint32_t end)
{
    for (uint32_t l = 0; l < g->layer_count; ++l) {
        if (state->frozen[l]) continue;
        const float unit = LX_ROW_UNIT / g->scales[l], authored = g->authored[l], least = darkest * g->layer_means[l];
        const lx_estimate *direct = g->direct + (size_t)l * g->luxel_count;
        halving *halvings = &g->halvings[(size_t)task * g->layer_count + l];
        lx_estimate *indirect = g->indirect + (size_t)l * g->luxel_count, *met = g->met[l];
        for (uint32_t i = from; i < end; ++i) {
            const size_t a = g->stride * (i - first) + l, b = a + g->stride * chunk_luxels;
            const uint32_t luxel = s->luxel[i];
            const lx_rgb before = indirect[luxel].mean;
            const float difference = take_round(g, s->sums + a, s->sums + b, unit, &indirect[luxel]);
            if (met) take_round(g, s->met + a, s->met + b, unit, &met[luxel]);
            if (g->round_first == g->round_count) { // all samples before against as many: the mean moved half way from the ones to the others
                const float moved = grey(indirect[luxel].mean) - grey(before), value = lx_max(grey(direct[luxel].mean) + grey(indirect[luxel].mean), least);
                halvings->within += value > 0 ? (double)(difference * difference / 4) / ((double)value * (double)value) : 0;
                halvings->between += value > 0 ? (double)(moved * moved) / ((double)value * (double)value) : 0;
            }
            if (g->round_first > 0) continue;
            g->sums[luxel].difference += difference * authored;
            g->sums[luxel].squares += difference * difference * authored * authored;
        }
    }
}

// So few luxels at a time that their sums of all layers stay in the first cache.
static void fold(const gather_job *g, const tile_state *state, const gather_scratch *s, size_t task, uint32_t first, uint32_t end)
{
    enum { block = 16 };
    for (uint32_t from = first; from < end; from += block) fold_block(g, state, s, task, first, from, from + block < end ? from + block : end);
}

// Root mean square over the tile's luxels of a layer's standard error over its light.
static double tile_error(const gather_job *g, const gather_scratch *s, uint32_t layer)
{
    const lx_estimate *direct = g->direct + (size_t)layer * g->luxel_count, *indirect = g->indirect + (size_t)layer * g->luxel_count;
    double sum = 0;
    const float least = darkest * g->layer_means[layer];
    for (uint32_t i = 0; i < s->count; ++i) {
        const lx_estimate *d = &direct[s->luxel[i]], *e = &indirect[s->luxel[i]];
        float value = grey(d->mean) + grey(e->mean), variance = d->variance + e->variance * g->gain[layer];
        if (g->met[layer]) {
            value += grey(g->met[layer][s->luxel[i]].mean);
            variance += g->met[layer][s->luxel[i]].variance * g->gain[layer];
        }
        value = lx_max(value, least);
        if (variance > 0) sum += (double)variance / ((double)value * (double)value);
    }
    return s->count > 0 ? sqrt(sum / s->count) : 0;
}

static lx_result gather_tile(void *user, size_t task, uint32_t worker, lx_error *error)
{
    const gather_job *g = user;
    const lx_luxel_tile *tile = &g->job->map.tiles[task];
    const tile_state *state = &g->tiles[task];
    gather_scratch *s = &g->scratch[worker];
    if (state->done) return LX_OK;
    list_luxels(g, tile, true, s);
    const uint32_t chunk = chunk_luxels;
    lx_gather_settings settings = g->settings;
    settings.sky_weight = s->sky_weight;
    for (uint32_t first = 0; first < s->count; first += chunk) {
        if (lx_pool_is_stopping(g->bake->scene->context->pool)) return LX_OK;
        const uint32_t end = first + chunk < s->count ? first + chunk : s->count;
        memset(s->sums, 0, 2 * chunk_luxels * g->stride * sizeof *s->sums);
        const size_t count = make_starts(g, s, first, end);
        if (g->met_estimates) memset(s->met, 0, 2 * chunk_luxels * g->stride * sizeof *s->met);
        const lx_gather_output out = {.sums = s->sums, .met = g->met_estimates ? s->met : NULL};
        const lx_result result = lx_gather_trace(s->batch, &settings, s->starts, count, &out, error);
        if (result != LX_OK) return result;
        fold(g, state, s, task, first, end);
    }
    return LX_OK;
}

// One luxel's halves tell little of its variance; those of a tile tell enough for layers to be done.
static lx_result judge_tile(void *user, size_t task, uint32_t worker, lx_error *error)
{
    (void)error;
    const gather_job *g = user;
    tile_state *state = &g->tiles[task];
    gather_scratch *s = &g->scratch[worker];
    if (state->done) return LX_OK;
    list_luxels(g, &g->job->map.tiles[task], true, s);
    if (g->round_first == 0 && s->count < enough_luxels) return LX_OK;
    bool all = true;
    for (uint32_t l = 0; l < g->layer_count; ++l) {
        if (!state->frozen[l] && tile_error(g, s, l) <= (double)g->bake->desc.noise) state->frozen[l] = 1;
        all &= state->frozen[l] != 0;
    }
    state->done = all;
    return LX_OK;
}

static lx_estimate interpolate(const lx_estimate *of, const lx_knots *knots)
{
    lx_estimate e = {{0, 0, 0}, 0};
    for (uint32_t k = 0; k < knots->count; ++k) {
        e.mean = lx_rgb_add(e.mean, lx_rgb_scale(of[knots->luxel[k]].mean, knots->weight[k]));
        e.variance += knots->weight[k] * knots->weight[k] * of[knots->luxel[k]].variance;
    }
    return e;
}

// What the tile's luxels without gather rays have from their knots. The met part of direct light they have from their samples.
static lx_result interpolate_tile(void *user, size_t task, uint32_t worker, lx_error *error)
{
    (void)worker;
    (void)error;
    const gather_job *g = user;
    const lx_luxel_tile *tile = &g->job->map.tiles[task];
    for (uint32_t spacing = lx_wide_spacing; spacing >= lx_narrow_spacing; spacing /= 2)
        for (uint32_t i = tile->first; i < tile->first + tile->count; ++i) {
            lx_knots knots;
            if (g->spacing[i] != spacing || !lx_find_knots(&g->job->map.view, tile, i, spacing, &knots)) continue;
            for (uint32_t l = 0; l < g->layer_count; ++l) {
                lx_estimate *layer = g->indirect + (size_t)l * g->luxel_count;
                layer[i] = interpolate(layer, &knots);
            }
        }
    return LX_OK;
}

static void find_layer_means(gather_job *g)
{
    const lx_luxel_map *map = &g->job->map.view;
    for (uint32_t l = 0; l < g->layer_count; ++l) {
        double sum = 0;
        uint32_t count = 0;
        for (uint32_t i = 0; i < map->count; ++i) {
            if (!map->valid[i] || g->spacing[i] > 0) continue;
            const size_t at = (size_t)l * g->luxel_count + i;
            sum += (double)(grey(g->direct[at].mean) + grey(g->indirect[at].mean) + (g->met[l] ? grey(g->met[l][i].mean) : 0));
            ++count;
        }
        g->layer_means[l] = count > 0 ? (float)(sum / count) : 0;
    }
}

// Variance of a mean falls faster with the number of samples than by its inverse, since a Sobol sequence fills its gaps: the two halves of n samples err in opposite
// ways, and the variance d(n) that their difference shows (a quarter of its square) is more than the mean's, V(n). What d falls by from n to 2n tells how much more: for halves that
// are each as good as the other, V(n) = d(2n) + V(2n) = d(2n) + d(4n) + …, or d(n) q / (1 - q) if each is q times the one before. Rounds were added up as if q were 1/2.
static void find_gains(gather_job *g)
{
    static const double least_q = 0.25;
    const uint32_t tiles = g->job->map.tile_count;
    for (uint32_t l = 0; l < g->layer_count; ++l) {
        double within = 0, between = 0;
        for (uint32_t t = 0; t < tiles; ++t) {
            const halving *h = &g->halvings[(size_t)t * g->layer_count + l];
            within += h->within;
            between += h->between;
        }
        const double q = within > 0 ? fmin(fmax(between / within, least_q), 0.5) : 0.5;
        g->gain[l] = (float)(2 * q * q / (1 - q));
    }
    memset(g->halvings, 0, (size_t)tiles * g->layer_count * sizeof *g->halvings);
}

static void apply_gains(const gather_job *g)
{
    for (uint32_t l = 0; l < g->layer_count; ++l)
        for (uint32_t i = 0; i < g->luxel_count; ++i) {
            g->indirect[(size_t)l * g->luxel_count + i].variance *= g->gain[l];
            if (g->met[l]) g->met[l][i].variance *= g->gain[l];
        }
}

// Rounds that would end after `deadline` (lx_seconds) are not begun.
static lx_result run_rounds(gather_job *g, double deadline, lx_error *error)
{
    lx_result result = LX_OK;
    lx_bake_job *job = g->job;
    lx_pool *pool = g->bake->scene->context->pool;
    const lx_bake_desc *desc = &g->bake->desc;
    stage_part part = {.sink = job->progress, .start = lx_seconds()};
    const lx_progress_sink sink = {report_part, &part};
    for (uint32_t done = 0; done < desc->samples;) {
        const uint32_t step = done == 0 ? first_round : done < largest_round ? done : largest_round; // cumulative counts are powers of two, for which Sobol points are best spread
        g->round_first = done;
        g->round_count = step < desc->samples - done ? step : desc->samples - done;
        const double round_start = lx_seconds();
        part.from = (double)done / desc->samples;
        part.share = (double)g->round_count / desc->samples;
        LX_TRY(lx_pool_run_weighted(pool, job->map.tile_count, job->tile_weights, gather_tile, g, "gather", &sink, error));
        done += g->round_count;
        if (g->round_first == 0) find_layer_means(g);
        if (g->round_first == g->round_count) find_gains(g);
        if (desc->noise > 0) LX_TRY(lx_pool_run(pool, job->map.tile_count, judge_tile, g, "gather", NULL, error));
        const uint32_t upcoming = done < largest_round ? done : largest_round;
        const double now = lx_seconds(), next = (now - round_start) * (double)upcoming / (double)g->round_count;
        if (desc->time_s > 0 && now + next > deadline) break;
        bool all = true;
        for (uint32_t t = 0; t < job->map.tile_count; ++t) all &= g->tiles[t].done;
        if (all) break;
    }
cleanup:
    return result;
}

// ---- the whole ------------------------------------------------------------------------------------------------------------------------

// A power of two that brings the brightest light a layer may give to at most 1: 2^24 times what its sources give the scene on average.
static void choose_scales(gather_job *g)
{
    for (uint32_t l = 0; l < g->row_layers; ++l) g->scales[l] = 0;
    for (uint32_t s = 0; s < g->bake->source_count; ++s) {
        const lx_source_use *use = &g->uses[s];
        if (use->layer < 0) continue;
        const uint32_t cells = use->cells ? 1 : lx_tracer_cell_count(g->bake->tracer, s);
        for (uint32_t cell = 0; cell < cells; ++cell)
            g->scales[(uint32_t)use->layer + cell] += lx_rgb_max(use->weight) * g->bake->tracer->source_scales[s] * 20;
    }
    for (uint32_t l = 0; l < g->row_layers; ++l) {
        int exponent;
        frexpf(g->scales[l] > 0 && g->scales[l] < INFINITY ? g->scales[l] : 1, &exponent);
        g->scales[l] = ldexpf(1, -24 - exponent);
    }
}

static lx_result create_scratch(gather_job *g, uint32_t workers, uint32_t round_rays, lx_error *error)
{
    const size_t sum_rows = tile_luxels > 2 * chunk_luxels ? tile_luxels : 2 * chunk_luxels;
    const size_t rays = round_rays > most_pass_rays ? round_rays : most_pass_rays, cells = max_cells(g);
    g->scratch = lx_calloc_array(workers, sizeof *g->scratch);
    if (!g->scratch) return lx_fail_memory(error, "workers");
    for (uint32_t i = 0; i < workers; ++i) {
        gather_scratch *s = &g->scratch[i];
        s->batch = lx_gather_batch_create();
        s->direct = lx_direct_batch_create(g->bake->tracer);
        s->sites = lx_calloc_array((size_t)tile_luxels * lx_site_count, sizeof *s->sites);
        s->starts = lx_malloc_array(chunk_luxels * rays, sizeof *s->starts);
        s->sums = lx_malloc_array(sum_rows, g->stride * sizeof *s->sums);
        s->met = lx_malloc_array(sum_rows, g->stride * sizeof *s->met);
        s->mean = lx_malloc_array(cells * tile_luxels, sizeof *s->mean);
        s->variance = lx_malloc_array(cells * tile_luxels, sizeof *s->variance);
        s->found = lx_malloc_array((size_t)chunk_luxels * most_pass_rays, sizeof *s->found);
        s->distances = lx_malloc_array((size_t)chunk_luxels * most_pass_rays, sizeof *s->distances);
        if (!s->batch || !s->direct || !s->sites || !s->starts || !s->sums || !s->met || !s->mean || !s->variance || !s->found ||
            !s->distances)
            return lx_fail_memory(error, "workers");
    }
    return LX_OK;
}

// What the final gather was the last to need.
static void release_cache(gather_job *g, uint32_t workers)
{
    for (uint32_t i = 0; g->scratch && i < workers; ++i) {
        gather_scratch *s = &g->scratch[i];
        if (s->batch) g->job->ray_count += lx_gather_batch_rays(s->batch);
        if (s->direct) g->job->ray_count += lx_direct_batch_rays(s->direct);
        lx_gather_batch_destroy(s->batch);
        lx_direct_batch_destroy(s->direct);
        void *arrays[] = {s->sites, s->starts, s->sums, s->met, s->mean, s->variance, s->found, s->distances};
        for (size_t k = 0; k < sizeof arrays / sizeof *arrays; ++k) lx_free(arrays[k]);
    }
    for (uint32_t t = 0; g->extras && t < g->job->map.tile_count; ++t) lx_free(g->extras[t].items);
    void **arrays[] = {(void **)&g->scratch, (void **)&g->extras, (void **)&g->albedo, (void **)&g->rows[0], (void **)&g->rows[1],
                       (void **)&g->rows[2], (void **)&g->rows_direct, (void **)&g->hits, (void **)&g->met_estimates, (void **)&g->closeness, (void **)&g->spacing, (void **)&g->sky_weight};
    for (size_t i = 0; i < sizeof arrays / sizeof *arrays; ++i) {
        lx_free(*arrays[i]);
        *arrays[i] = NULL;
    }
    lx_lookup_release(&g->lookup);
}

static void release(gather_job *g)
{
    for (uint32_t t = 0; g->tiles && t < g->job->map.tile_count; ++t) {
        lx_free(g->tiles[t].frozen);
    }
    void *arrays[] = {g->met, g->scales, g->authored, g->direct, g->indirect, g->pass_change, g->pass_energy, g->converged, g->tiles, g->layer_means,
                      g->halvings, g->gain};
    for (size_t i = 0; i < sizeof arrays / sizeof *arrays; ++i) lx_free(arrays[i]);
}

// Light sources that gather rays meet: those whose part of the layers' direct light is in two estimates until the last round.
static lx_result allocate_met(gather_job *g, lx_error *error)
{
    uint32_t count = 0;
    g->met = lx_calloc_array(g->layer_count, sizeof *g->met);
    bool *is_met = lx_calloc_array(g->layer_count, sizeof *is_met);
    for (uint32_t s = 0; g->met && is_met && s < g->bake->source_count; ++s) {
        const lx_source_use *use = &g->uses[s];
        if (use->layer < 0 || !lx_bake_meets(g->bake, s)) continue;
        const uint32_t cells = use->cells ? 1 : lx_tracer_cell_count(g->bake->tracer, s);
        for (uint32_t cell = 0; cell < cells; ++cell) is_met[(uint32_t)use->layer + cell] = true;
    }
    for (uint32_t l = 0; is_met && l < g->layer_count; ++l) count += is_met[l];
    if (count > 0) g->met_estimates = lx_calloc_array(count, g->luxel_count * sizeof *g->met_estimates);
    const bool ok = g->met && is_met && (count == 0 || g->met_estimates);
    for (uint32_t l = 0, k = 0; ok && l < g->layer_count; ++l)
        if (is_met[l]) g->met[l] = g->met_estimates + (size_t)k++ * g->luxel_count;
    lx_free(is_met);
    return ok ? LX_OK : lx_fail_memory(error, "layers; --memory bakes them in groups");
}

static lx_result allocate(gather_job *g, lx_error *error)
{
    const size_t luxels = g->luxel_count, layers = g->layer_count, tiles = g->job->map.tile_count;
    const size_t cached = g->settings.bounces > 0 ? luxels : 0;
    size_t all;
    if (!lx_mul_size(luxels, layers, &all) || !lx_mul_size(all, 64, &all)) return lx_fail_memory(error, "layers");
    g->scales = lx_calloc_array(g->row_layers, sizeof *g->scales);
    g->authored = lx_calloc_array(layers, sizeof *g->authored);
    g->albedo = lx_calloc_array(cached, sizeof *g->albedo);
    g->closeness = lx_calloc_array(luxels, sizeof *g->closeness);
    g->spacing = lx_calloc_array(luxels, sizeof *g->spacing);
    g->sky_weight = lx_calloc_array(luxels, sizeof *g->sky_weight);
    for (int i = 0; i < 3; ++i) g->rows[i] = lx_calloc_array(i < 2 || is_truncated(g) ? cached : 0, g->stride * sizeof *g->rows[i]);
    g->rows_direct = lx_calloc_array(cached, g->stride * sizeof *g->rows_direct);
    g->hits = lx_malloc_array(cached, g->pass_rays * sizeof *g->hits);
    g->extras = lx_calloc_array(tiles, sizeof *g->extras);
    g->direct = lx_calloc_array(luxels, layers * sizeof *g->direct);
    g->indirect_bytes = layers * sizeof *g->indirect;
    if (cached && g->stride * sizeof *g->radiosity > g->indirect_bytes) g->indirect_bytes = g->stride * sizeof *g->radiosity;
    g->indirect = lx_calloc_array(luxels, g->indirect_bytes);
    g->indirect_bytes *= luxels;
    g->radiosity = (float *)g->indirect;
    g->pass_change = lx_calloc_array(tiles, layers * sizeof *g->pass_change);
    g->pass_energy = lx_calloc_array(tiles, layers * sizeof *g->pass_energy);
    g->converged = lx_calloc_array(layers, 1);
    g->tiles = lx_calloc_array(tiles, sizeof *g->tiles);
    g->layer_means = lx_calloc_array(layers, sizeof *g->layer_means);
    g->halvings = lx_calloc_array(tiles, layers * sizeof *g->halvings);
    g->gain = lx_malloc_array(layers, sizeof *g->gain);
    if (!g->scales || !g->authored || !g->albedo || !g->closeness || !g->spacing || !g->sky_weight || !g->rows[0] || !g->rows[1] || !g->rows[2] || !g->rows_direct || !g->hits || !g->extras || !g->direct || !g->indirect ||
        !g->pass_change || !g->pass_energy || !g->converged || !g->tiles || !g->layer_means || !g->halvings || !g->gain)
        return lx_fail_memory(error, "layers; --memory bakes them in groups");
    for (size_t l = 0; l < layers; ++l) g->gain[l] = 1;
    for (size_t t = 0; t < tiles; ++t) {
        g->tiles[t].frozen = lx_calloc_array(layers, 1);
        if (!g->tiles[t].frozen) return lx_fail_memory(error, "layers");
    }
    return LX_OK;
}

static void take_met_light(const gather_job *g)
{
    for (uint32_t l = 0; l < g->layer_count; ++l)
        for (uint32_t i = 0; g->met[l] && i < g->luxel_count; ++i) {
            lx_estimate *direct = &g->direct[(size_t)l * g->luxel_count + i];
            direct->mean = lx_rgb_add(direct->mean, g->met[l][i].mean);
            direct->variance += g->met[l][i].variance;
        }
}

// Takes a group's layers into the sum.
static void add_to_sums(const gather_job *g)
{
    for (uint32_t l = 0; l < g->layer_count; ++l) {
        const lx_estimate *direct = g->direct + (size_t)l * g->luxel_count, *indirect = g->indirect + (size_t)l * g->luxel_count;
        const float c = g->authored[l];
        for (uint32_t i = 0; i < g->luxel_count; ++i) {
            g->sums[i].value += c * (grey(direct[i].mean) + grey(indirect[i].mean));
            g->sums[i].direct_variance += c * c * direct[i].variance;
            g->sums[i].indirect_variance += c * c * indirect[i].variance;
        }
    }
}

// Relative standard error of the sum. Layers share their rays, so their errors go together: the first round told how much.
static float estimate_noise(const lx_bake_job *job, const sum_estimate *sums)
{
    const lx_luxel_map *map = &job->map.view;
    double whole = 0, apart = 0, mean = 0, sum = 0;
    uint32_t count = 0;
    for (uint32_t i = 0; i < map->count; ++i) {
        if (!map->valid[i]) continue;
        whole += (double)sums[i].difference * (double)sums[i].difference;
        apart += (double)sums[i].squares;
        mean += (double)sums[i].value;
        ++count;
    }
    if (count == 0) return 0;
    const double together = apart > 0 ? whole / apart : 1;
    mean /= count;
    for (uint32_t i = 0; i < map->count; ++i) {
        if (!map->valid[i]) continue;
        const double value = fmax((double)sums[i].value, (double)darkest * mean);
        const double variance = (double)sums[i].direct_variance + together * (double)sums[i].indirect_variance;
        if (value > 0) sum += variance / (value * value);
    }
    return (float)sqrt(sum / count);
}

static void find_authored(gather_job *g)
{
    for (uint32_t l = 0; l < g->layer_count; ++l) {
        const lx_layer *layer = &g->bake->layers[g->first_layer + l];
        g->authored[l] = (layer->color[0] + layer->color[1] + layer->color[2]) / 3 * layer->intensity;
    }
}

// Luxels that answer for what is hit on them: valid ones, unless they reach into two rooms.
static lx_result choose_answers(gather_job *g, lx_error *error)
{
    const lx_bake_map *map = &g->job->map;
    uint8_t *answers = lx_malloc_array(map->view.count, 1);
    if (!answers) return lx_fail_memory(error, "luxels");
    for (uint32_t i = 0; i < map->view.count; ++i) {
        uint32_t texel;
        const lx_luxel_page *page = lx_job_page(g->job, i, &texel);
        answers[i] = map->valid[i] && lx_luxel_is_whole(g->bake, page, texel);
    }
    lx_lookup_invalidate(&g->lookup, &map->view, answers);
    lx_free(answers);
    return LX_OK;
}

// Bakes layers first … first + count - 1. `uses`: [source_count] room for their uses.
static lx_result bake_group(lx_bake_job *job, uint32_t first, uint32_t count, lx_source_use *uses, sum_estimate *sums, lx_finish *finish,
                            double deadline, lx_error *error)
{
    lx_result result = LX_OK;
    lx_bake *bake = job->bake;
    lx_pool *pool = bake->scene->context->pool;
    const uint32_t workers = lx_pool_worker_count(pool), samples = bake->desc.samples;
    const uint32_t bounces = bake->desc.direct_only ? 0 : bake->desc.transport.bounces;
    double stage_start = lx_seconds();
    for (uint32_t s = 0; s < bake->source_count; ++s) {
        uses[s] = bake->uses[s];
        const bool in_group = uses[s].layer >= (int32_t)first && uses[s].layer < (int32_t)(first + count);
        uses[s].layer = in_group ? uses[s].layer - (int32_t)first : -1;
    }
    gather_job g = {.job = job, .bake = bake, .uses = uses, .first_layer = first, .layer_count = count, .row_layers = lx_row_layers(count), .sums = sums,
                    .luxel_count = job->map.view.count, .pass_rays = samples < 128 ? 16 : most_pass_rays};
    g.stride = 3 * (size_t)g.row_layers;
    g.settings.bounces = bounces;
    g.interpolates = bake->desc.interpolation > 0;
    g.samples_sky = lx_sky_is_uniform(&bake->tracer->sky) && uses[bake->source_count - 1].layer >= 0;
    LX_TRY(allocate(&g, error));
    LX_TRY(allocate_met(&g, error));
    find_authored(&g);
    choose_scales(&g);
    LX_TRY(lx_lookup_create(bake, &job->map.view, &g.lookup, error));
    LX_TRY(choose_answers(&g, error));
    LX_TRY(create_scratch(&g, workers, samples < largest_round ? samples : largest_round, error));
    LX_TRY(lx_pool_run_weighted(pool, job->map.tile_count, job->tile_weights, light_tile, &g, "direct", job->progress, error));
    job->stages.direct += lx_lap(&stage_start);
    if (bounces > 0) {
        LX_TRY(run_passes(&g, bounces == LX_BOUNCES_INF ? bounces : bounces - 1, error));
        memset(g.indirect, 0, g.indirect_bytes);
    }
    job->stages.cache += lx_lap(&stage_start);
    g.settings = (lx_gather_settings){.tracer = bake->tracer, .lookup = &g.lookup, .uses = g.uses, .scales = g.scales, .row_layers = g.row_layers,
                                      .bounces = bounces, .direct = !bake->desc.indirect_only, .near_texels = near_texels};
    if (bounces > 0) {
        g.settings.rows = g.rows[0];
        g.settings.rows_later = !is_truncated(&g) ? g.rows[0] : bounces > 1 ? g.rows[1] : NULL;
        g.settings.rows_direct = g.rows_direct;
        g.settings.albedo = g.albedo;
    }
    LX_TRY(run_rounds(&g, deadline, error));
    if (g.interpolates) LX_TRY(lx_pool_run(pool, job->map.tile_count, interpolate_tile, &g, "gather", NULL, error));
    job->stages.gather += lx_lap(&stage_start);
    apply_gains(&g);
    take_met_light(&g);
    add_to_sums(&g);
    release_cache(&g, workers);
    lx_trim_memory();
    LX_TRY(lx_finish_layers(finish, g.direct, g.indirect, first, count, error));
    job->stages.denoise += lx_lap(&stage_start);
cleanup:
    release_cache(&g, workers);
    release(&g);
    return result;
}

lx_result lx_bake_by_gathering(lx_bake_job *job, lx_error *error)
{
    lx_result result = LX_OK;
    const double start = lx_seconds();
    lx_bake *bake = job->bake;
    lx_source_use *uses = lx_calloc_array(bake->source_count, sizeof *uses);
    sum_estimate *sums = lx_calloc_array(job->map.view.count, sizeof *sums);
    lx_finish *finish = NULL;
    if (!uses || !sums) {
        result = lx_fail_memory(error, "layers");
        goto cleanup;
    }
    lx_memory_plan plan;
    LX_TRY(lx_finish_open(job, &finish, error));
    LX_TRY(lx_memory_plan_make(job, finish, &plan, error));
    job->predicted_bytes = plan.peak_bytes;
    for (uint32_t first = 0; first < bake->layer_count; ++job->group_count) {
        const uint32_t count = lx_memory_group(bake, &plan, first);
        const double share = (double)(first + count) / bake->layer_count; // of the time that all groups have
        LX_TRY(bake_group(job, first, count, uses, sums, finish, start + share * bake->desc.time_s, error));
        first += count;
        lx_trim_memory(); // what one group leaves behind in holes is not there for the next
    }
    job->noise = estimate_noise(job, sums);
cleanup:
    lx_finish_close(finish);
    lx_free(uses);
    lx_free(sums);
    return result;
}
