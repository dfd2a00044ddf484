// The final gather: many more rays, in rounds; they read the radiosity where they hit. Half of a round against the other tells how sure the mean is; tiles where
// every layer is sure enough take part in no further round, and a layer that is sure enough stays as it is while others go on.
#include "bake/gather_job.h"

#include "bake/interpolation.h"
#include "base/clock.h"
#include "base/error.h"
#include "math/hash.h"
#include "trace/tracer_data.h"

#include <string.h>

enum {
    first_round = 32,      // rays a luxel
    enough_luxels = 64,    // of a tile, to tell its error from one pair of halves each
    rays_per_site = 16,    // in a round
};

// The round's rays of luxels first … end - 1 of the list; the first half of a luxel's samples and the second have sums of their own.
static size_t make_starts(const lx_gather_job *g, lx_gather_scratch *s, uint32_t first, uint32_t end)
{
    const uint32_t n = g->round_count, half = (n + 1) / 2;
    size_t count = 0;
    for (uint32_t i = first; i < end; ++i) {
        lx_receiver *sites = s->sites + (size_t)(i - first) * lx_site_count;
        const uint32_t first_site = g->round_first / rays_per_site % lx_site_count;
        const uint32_t sites_wanted = (n + rays_per_site - 1) / rays_per_site;
        const uint32_t site_count = sites_wanted < lx_site_count ? sites_wanted : lx_site_count;
        const uint32_t straight = first_site + site_count <= lx_site_count ? site_count : lx_site_count - first_site;
        lx_gather_place_sites(g, s, i, first_site, straight, sites);
        if (straight < site_count) lx_gather_place_sites(g, s, i, 0, site_count - straight, sites + straight);
        if (g->samples_sky) s->sky_cells[i - first] = s->sky_cells[lx_gather_chunk_luxels + i - first] = g->sky_cells[s->luxel[i]];
        for (uint32_t k = 0; k < n; ++k)
            s->starts[count++] = (lx_gather_start){.receiver = &sites[k / rays_per_site % site_count], .stream = s->stream[i],
                                                   .sample = g->round_first + k, .target = (k < half ? 0u : lx_gather_chunk_luxels) + i - first};
    }
    return count;
}

// ---- rounds ---------------------------------------------------------------------------------------------------------------------

// How a round's sums of one layer, of its halves, become a part of an estimate.
typedef struct round_weights {
    float before, sum;  // of the estimate so far, and of what the halves add up to
    float a, b;         // of the halves: their means of a channel, a third of it
    float squared;      // of the square of the difference of these means
} round_weights;

static round_weights weigh_round(const lx_gather_job *g, float unit)
{
    const uint32_t n = g->round_count, half = (n + 1) / 2;
    const float before = (float)g->round_first, after = before + (float)n, share = (float)n / after;
    round_weights w = {.before = before / after, .sum = unit / after};
    if (n == half) return w; // one ray has no halves
    w.a = unit / (float)half / 3;
    w.b = unit / (float)(n - half) / 3;
    w.squared = share * share / 4;
    return w;
}

// Takes the round's sums of one layer into the estimate of one luxel. Returns how far the halves' means are apart.
static inline float take_round(const round_weights *w, const float *a, const float *b, size_t layers, lx_estimate *e)
{
    const float a0 = a[0], a1 = a[layers], a2 = a[2 * layers], b0 = b[0], b1 = b[layers], b2 = b[2 * layers];
    const float difference = (a0 + a1 + a2) * w->a - (b0 + b1 + b2) * w->b;
    e->mean.r = e->mean.r * w->before + (a0 + b0) * w->sum;
    e->mean.g = e->mean.g * w->before + (a1 + b1) * w->sum;
    e->mean.b = e->mean.b * w->before + (a2 + b2) * w->sum;
    e->variance = e->variance * (w->before * w->before) + difference * difference * w->squared;
    return difference;
}

// Takes the round's sums into the estimates of luxels from … end - 1 of the list, of the chunk that begins with `first`: layer by layer, as estimates lie in memory.
static void fold_block(const lx_gather_job *g, const lx_gather_tile *state, const lx_gather_scratch *s, size_t task, uint32_t first, uint32_t from, uint32_t end)
{
    for (uint32_t l = 0; l < g->layer_count; ++l) {
        if (state->frozen[l]) continue;
        const float unit = LX_ROW_UNIT / g->scales[l], authored = g->authored[l], least = lx_gather_darkest * g->layer_means[l];
        const lx_estimate *direct = g->direct + (size_t)l * g->luxel_count;
        lx_gather_halving *halvings = &g->halvings[(size_t)task * g->layer_count + l];
        lx_estimate *indirect = g->indirect + (size_t)l * g->luxel_count, *met = g->met[l];
        const round_weights weights = weigh_round(g, unit);
        for (uint32_t i = from; i < end; ++i) {
            const size_t a = g->stride * (i - first) + l, b = a + g->stride * lx_gather_chunk_luxels;
            const uint32_t luxel = s->luxel[i];
            const lx_rgb before = indirect[luxel].mean;
            const float difference = take_round(&weights, s->sums + a, s->sums + b, g->row_layers, &indirect[luxel]);
            if (met) take_round(&weights, s->met + a, s->met + b, g->row_layers, &met[luxel]);
            if (g->round_first == g->round_count) { // all samples before against as many: the mean moved half way from the ones to the others
                const float moved = lx_rgb_mean(indirect[luxel].mean) - lx_rgb_mean(before), value = lx_max(lx_rgb_mean(direct[luxel].mean) + lx_rgb_mean(indirect[luxel].mean), least);
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
static void fold(const lx_gather_job *g, const lx_gather_tile *state, const lx_gather_scratch *s, size_t task, uint32_t first, uint32_t end)
{
    enum { block = 16 };
    for (uint32_t from = first; from < end; from += block) fold_block(g, state, s, task, first, from, from + block < end ? from + block : end);
}

// Root mean square over the tile's luxels of a layer's standard error over its light.
static double tile_error(const lx_gather_job *g, const lx_gather_scratch *s, uint32_t layer)
{
    const lx_estimate *direct = g->direct + (size_t)layer * g->luxel_count, *indirect = g->indirect + (size_t)layer * g->luxel_count;
    double sum = 0;
    const float least = lx_gather_darkest * g->layer_means[layer];
    for (uint32_t i = 0; i < s->count; ++i) {
        const lx_estimate *d = &direct[s->luxel[i]], *e = &indirect[s->luxel[i]];
        float value = lx_rgb_mean(d->mean) + lx_rgb_mean(e->mean), variance = d->variance + e->variance * g->gain[layer];
        if (g->met[layer]) {
            value += lx_rgb_mean(g->met[layer][s->luxel[i]].mean);
            variance += g->met[layer][s->luxel[i]].variance * g->gain[layer];
        }
        value = lx_max(value, least);
        if (variance > 0) sum += (double)variance / ((double)value * (double)value);
    }
    return s->count > 0 ? sqrt(sum / s->count) : 0;
}

static lx_result gather_tile(void *user, size_t task, uint32_t worker, lx_error *error)
{
    const lx_gather_job *g = user;
    const lx_luxel_tile *tile = &g->job->map.tiles[task];
    const lx_gather_tile *state = &g->tiles[task];
    lx_gather_scratch *s = &g->scratch[worker];
    if (state->done) return LX_OK;
    lx_gather_list_luxels(g, tile, true, s);
    const uint32_t chunk = lx_gather_chunk_luxels;
    lx_gather_settings settings = g->settings;
    settings.sky_cells = g->samples_sky ? s->sky_cells : NULL;
    settings.sky_cell_count = g->sky_cell_count;
    for (uint32_t first = 0; first < s->count; first += chunk) {
        if (lx_pool_is_stopping(g->bake->scene->context->pool)) return LX_OK;
        const uint32_t end = first + chunk < s->count ? first + chunk : s->count;
        memset(s->sums, 0, 2 * lx_gather_chunk_luxels * g->stride * sizeof *s->sums);
        const size_t count = make_starts(g, s, first, end);
        if (g->met_estimates) memset(s->met, 0, 2 * lx_gather_chunk_luxels * g->stride * sizeof *s->met);
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
    const lx_gather_job *g = user;
    lx_gather_tile *state = &g->tiles[task];
    lx_gather_scratch *s = &g->scratch[worker];
    if (state->done) return LX_OK;
    lx_gather_list_luxels(g, &g->job->map.tiles[task], true, s);
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

static void interpolate_layers(void *user, uint32_t luxel, const lx_knots *knots)
{
    const lx_gather_job *g = user;
    for (uint32_t l = 0; l < g->layer_count; ++l) {
        lx_estimate *layer = g->indirect + (size_t)l * g->luxel_count;
        layer[luxel] = interpolate(layer, knots);
    }
}

// What the tile's luxels without gather rays have from their knots. The met part of direct light they have from their samples.
static lx_result interpolate_tile(void *user, size_t task, uint32_t worker, lx_error *error)
{
    (void)worker;
    (void)error;
    lx_gather_job *g = user;
    lx_visit_interpolated(&g->job->map.view, &g->job->map.tiles[task], g->spacing, true, interpolate_layers, g);
    return LX_OK;
}

static void find_layer_means(lx_gather_job *g)
{
    const lx_luxel_map *map = &g->job->map.view;
    for (uint32_t l = 0; l < g->layer_count; ++l) {
        double sum = 0;
        uint32_t count = 0;
        for (uint32_t i = 0; i < map->count; ++i) {
            if (!map->valid[i] || g->spacing[i] > 0) continue;
            const size_t at = (size_t)l * g->luxel_count + i;
            sum += (double)(lx_rgb_mean(g->direct[at].mean) + lx_rgb_mean(g->indirect[at].mean) + (g->met[l] ? lx_rgb_mean(g->met[l][i].mean) : 0));
            ++count;
        }
        g->layer_means[l] = count > 0 ? (float)(sum / count) : 0;
    }
}

// Variance of a mean falls faster with the number of samples than by its inverse, since a Sobol sequence fills its gaps: the two halves of n samples err in opposite
// ways, and the variance d(n) that their difference shows (a quarter of its square) is more than the mean's, V(n). What d falls by from n to 2n tells how much more: for halves that
// are each as good as the other, V(n) = d(2n) + V(2n) = d(2n) + d(4n) + …, or d(n) q / (1 - q) if each is q times the one before. Rounds were added up as if q were 1/2.
static void find_gains(lx_gather_job *g)
{
    static const double least_q = 0.25;
    const uint32_t tiles = g->job->map.tile_count;
    for (uint32_t l = 0; l < g->layer_count; ++l) {
        double within = 0, between = 0;
        for (uint32_t t = 0; t < tiles; ++t) {
            const lx_gather_halving *h = &g->halvings[(size_t)t * g->layer_count + l];
            within += h->within;
            between += h->between;
        }
        const double q = within > 0 ? fmin(fmax(between / within, least_q), 0.5) : 0.5;
        g->gain[l] = (float)(2 * q * q / (1 - q));
    }
    memset(g->halvings, 0, (size_t)tiles * g->layer_count * sizeof *g->halvings);
}

static void apply_gains(const lx_gather_job *g)
{
    for (uint32_t l = 0; l < g->layer_count; ++l)
        for (uint32_t i = 0; i < g->luxel_count; ++i) {
            g->indirect[(size_t)l * g->luxel_count + i].variance *= g->gain[l];
            if (g->met[l]) g->met[l][i].variance *= g->gain[l];
        }
}

// Rounds that would end after `deadline` (lx_seconds) are not begun.
static lx_result run_rounds(lx_gather_job *g, double deadline, lx_error *error)
{
    lx_result result = LX_OK;
    lx_bake_job *job = g->job;
    lx_pool *pool = g->bake->scene->context->pool;
    const lx_bake_desc *desc = &g->bake->desc;
    const uint32_t rays = lx_gather_rays(desc->samples);
    lx_stage_part part = {.sink = job->progress, .start = lx_seconds()};
    const lx_progress_sink sink = {lx_report_part, &part};
    for (uint32_t done = 0; done < rays;) {
        const uint32_t step = done == 0 ? first_round : done < lx_gather_largest_round ? done : lx_gather_largest_round; // cumulative counts are powers of two, for which Sobol points are best spread
        g->round_first = done;
        g->round_count = step < rays - done ? step : rays - done;
        const double round_start = lx_seconds();
        part.from = (double)done / rays;
        part.share = (double)g->round_count / rays;
        LX_TRY(lx_pool_run_weighted(pool, job->map.tile_count, job->tile_weights, gather_tile, g, "gather", &sink, error));
        done += g->round_count;
        if (g->round_first == 0) find_layer_means(g);
        if (g->round_first == g->round_count) find_gains(g);
        if (desc->noise > 0) LX_TRY(lx_pool_run(pool, job->map.tile_count, judge_tile, g, "gather", NULL, error));
        const uint32_t upcoming = done < lx_gather_largest_round ? done : lx_gather_largest_round;
        const double now = lx_seconds(), next = (now - round_start) * (double)upcoming / (double)g->round_count;
        if (desc->time_s > 0 && now + next > deadline) break;
        bool all = true;
        for (uint32_t t = 0; t < job->map.tile_count; ++t) all &= g->tiles[t].done;
        if (all) break;
    }
cleanup:
    return result;
}

lx_result lx_gather_rounds(lx_gather_job *g, double deadline, lx_error *error)
{
    lx_result result = run_rounds(g, deadline, error);
    if (result == LX_OK && g->interpolates) result = lx_pool_run(g->bake->scene->context->pool, g->job->map.tile_count, interpolate_tile, g, "gather", NULL, error);
    if (result == LX_OK) apply_gains(g);
    return result;
}
