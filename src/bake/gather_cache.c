// Direct light, and the irradiance cache: radiosity of every luxel <- albedo × (direct light + mean over its rays of the radiosity there), for all layers at once.
#include "bake/gather_job.h"

#include "bake/interpolation.h"
#include "base/clock.h"
#include "base/error.h"
#include "trace/tracer_data.h"

#include <stdlib.h>
#include <string.h>

enum { most_passes = 1000 };

static const float pass_near_texels = 1.0f;
static const float near_source_texels = 4; // light of what is nearer differs too much over a luxel
static const double enough_energy = 1e-3; // of a layer's: what later bounces may still have added
static const uint32_t cache_stream = 0x63616368;

// Mean albedo of a luxel: what its row is multiplied by. Hits that are looked up lie farther than a texel, where no finer detail can be told.
static lx_rgb mean_albedo(const lx_gather_job *g, lx_texel *t)
{
    enum { places = 8 };
    lx_hit hits[places];
    lx_shading shading[places];
    for (uint32_t k = 0; k < places; ++k) {
        lx_receiver r;
        const lx_piece *piece = lx_texel_site(t, k * (lx_site_count / places), &r);
        const lx_fragment *f = &t->fragments[piece->fragment];
        const lx_vec2 b = lx_piece_barycentrics(piece, r.position);
        hits[k] = (lx_hit){.surface = f->surface, .triangle = f->triangle, .u = b.x, .v = b.y};
    }
    lx_shade_materials(g->bake->tracer, hits, shading, places);
    lx_rgb sum = {0, 0, 0};
    for (uint32_t k = 0; k < places; ++k) sum = lx_rgb_add(sum, shading[k].albedo);
    return lx_rgb_scale(sum, 1.0f / places);
}

static void open_luxel(const lx_gather_job *g, lx_texel *t, uint32_t luxel)
{
    uint32_t texel;
    const lx_luxel_page *page = lx_job_page(g->job, luxel, &texel);
    lx_texel_open(t, g->bake, page, texel);
}

// What near hits on the luxel will take of it.
static lx_gather_luxel describe(const lx_gather_job *g, lx_texel *t, uint32_t luxel, const lx_receiver *first_site)
{
    open_luxel(g, t, luxel);
    lx_gather_luxel out = {.albedo = mean_albedo(g, t), .centre = first_site->position, .texel_m = lx_texel_size(t)};
    out.reach = near_source_texels * out.texel_m;
    for (uint32_t s = 0; s < g->bake->source_count; ++s)
        if (g->uses[s].layer >= 0 && lx_gather_is_near(g->bake->tracer, &out, s)) out.near_sources |= (uint64_t)1 << s % 64;
    return out;
}

// Paths that meet an invalid luxel ask it for its albedo alone.
static void describe_invalid(const lx_gather_job *g, lx_texel *t, const lx_luxel_tile *tile)
{
    for (uint32_t i = tile->first; i < tile->first + tile->count; ++i) {
        if (g->job->map.valid[i]) continue;
        open_luxel(g, t, i);
        g->luxels[i] = (lx_gather_luxel){.albedo = mean_albedo(g, t)};
    }
}

// ---- direct light and the cache's rays -----------------------------------------------------------------------------------------------

static bool is_near(const lx_gather_job *g, uint32_t luxel, uint32_t source)
{
    return g->settings.bounces > 0 && g->luxels[luxel].near_sources && lx_gather_is_near(g->bake->tracer, &g->luxels[luxel], source);
}

// Adds a source's direct light to its layers: to the estimates if it counts there, and to the cache's rows. Those have all of a uniform sky from the cache's rays already: samples
// of it lie where these rays saw it, so what they bring must not be mixed with what these rays bring.
static void add_source(const lx_gather_job *g, lx_gather_scratch *s, uint32_t source, bool counts)
{
    const lx_source_use *use = &g->uses[source];
    const uint32_t cells = lx_tracer_cell_count(g->bake->tracer, source);
    const bool is_shared_sky = g->samples_sky && source == g->bake->source_count - 1; // the sky comes last
    for (uint32_t cell = 0; cell < cells; ++cell) {
        const uint32_t layer = (uint32_t)use->layer + (use->cells ? 0 : cell);
        const lx_rgb weight = use->cells ? lx_rgb_mul(use->weight, use->cells[cell]) : use->weight;
        const float grey_weight = lx_rgb_mean(weight), unit = g->scales[layer];
        lx_estimate *estimates = g->direct + (size_t)layer * g->luxel_count;
        for (uint32_t i = 0; i < s->count; ++i) {
            const lx_rgb e = lx_rgb_mul(s->mean[(size_t)cell * s->count + i], weight);
            if (counts) {
                lx_estimate *estimate = &estimates[s->luxel[i]];
                estimate->mean = lx_rgb_add(estimate->mean, e);
                estimate->variance += s->variance[(size_t)cell * s->count + i] * grey_weight * grey_weight;
            }
            if (is_shared_sky && !s->alone[i]) continue;
            float *row = (is_near(g, s->luxel[i], source) ? s->near_light : s->sums) + g->stride * i + layer;
            row[0] += e.r * unit;
            row[g->row_layers] += e.g * unit;
            row[2 * g->row_layers] += e.b * unit;
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
static lx_result send_pass_rays(const lx_gather_job *g, lx_gather_scratch *s, size_t task, lx_error *error)
{
    const lx_gather_settings settings = {.tracer = g->bake->tracer, .lookup = &g->lookup, .uses = g->uses, .scales = g->scales,
                                         .row_layers = g->row_layers, .bounces = g->settings.bounces, .everything = true, .near_texels = pass_near_texels, .luxels = g->luxels, .sky_cell_count = g->sky_cell_count};
    lx_gather_extras *extras = &g->extras[task];
    for (uint32_t first = 0; first < s->count; first += lx_gather_chunk_luxels) {
        const uint32_t end = first + lx_gather_chunk_luxels < s->count ? first + lx_gather_chunk_luxels : s->count;
        size_t count = 0;
        for (uint32_t i = first; i < end; ++i)
            for (uint32_t k = 0; k < g->pass_rays; ++k)
                s->starts[count++] = (lx_gather_start){.receiver = &s->sites[i * lx_site_count + k % lx_site_count],
                                                       .stream = s->stream[i] ^ cache_stream, .sample = k, .target = i};
        const lx_gather_output out = {.sums = s->sums, .met = s->met, .near_met = settings.bounces > 0 ? s->near_light : NULL, .targets = s->luxel,
                                      .sky_seen = g->samples_sky ? s->sky_seen : NULL, .sky_through = s->sky_through, .distances = s->distances, .luxels = s->found, .extras = extras};
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
static void choose_senders(const lx_gather_job *g, lx_gather_scratch *s, const lx_luxel_tile *tile)
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

static void light_from_sources(const lx_gather_job *g, lx_gather_scratch *s)
{
    const lx_bake_desc *desc = &g->bake->desc;
    lx_direct_bounds bounds;
    lx_direct_tile direct = {.count = s->count, .place = s->place, .chart = s->chart, .stream = s->stream, .sites = s->sites, .alone = s->alone,
                             .sky_cells = s->sky_cells, .sky_cell_count = g->sky_cell_count};
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
    }
}

// Irradiance × unit becomes radiosity.
static void reflect(const lx_gather_job *g, uint32_t luxel, const float *irradiance, float unit, float *radiosity, uint16_t *row)
{
    const lx_rgb a = g->luxels[luxel].albedo;
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
    const lx_gather_job *g = user;
    const lx_luxel_tile *tile = &g->job->map.tiles[task];
    lx_gather_scratch *s = &g->scratch[worker];
    lx_gather_list_luxels(g, tile, false, s);
    for (uint32_t i = 0; i < s->count; ++i) lx_gather_place_sites(g, s, i, 0, lx_site_count, s->sites + (size_t)i * lx_site_count);
    const size_t row_values = g->stride * s->count;
    memset(s->sums, 0, row_values * sizeof *s->sums);
    memset(s->alone, 0, s->count);
    memset(s->sky_seen, 0, s->count * sizeof *s->sky_seen);
    memset(s->sky_through, 0, s->count * sizeof *s->sky_through);
    const bool bounces = g->settings.bounces > 0;
    for (uint32_t i = 0; bounces && i < s->count; ++i) g->luxels[s->luxel[i]] = describe(g, &s->texel, s->luxel[i], &s->sites[(size_t)i * lx_site_count]);
    if (bounces) describe_invalid(g, &s->texel, tile);
    if (bounces || g->interpolates || g->samples_sky) { // direct light must know as well
        memset(s->met, 0, row_values * sizeof *s->met);
        memset(s->near_light, 0, row_values * sizeof *s->near_light);
        const lx_result result = send_pass_rays(g, s, task, error);
        if (result != LX_OK) return result;
        choose_senders(g, s, tile);
        if (g->samples_sky) lx_gather_choose_sky_cells(g, s);
    }
    if (bounces) {
        const float ray_unit = LX_ROW_UNIT / (float)g->pass_rays;
        for (uint32_t i = 0; i < s->count; ++i)
            reflect(g, s->luxel[i], s->sums + g->stride * i, ray_unit, NULL, g->rows[1] + g->row_stride * s->luxel[i]); // the first pass adds it
        for (size_t i = 0; i < s->count; ++i)
            for (size_t k = g->stride * i; k < g->stride * (i + 1); ++k) {
                s->sums[k] = s->alone[i] ? 0 : s->met[k] * ray_unit;
                s->near_light[k] = s->alone[i] ? 0 : s->near_light[k] * ray_unit;
            }
    }
    light_from_sources(g, s);
    for (uint32_t i = 0; bounces && i < s->count; ++i) {
        const size_t row = g->row_stride * s->luxel[i];
        float *sums = s->sums + g->stride * i;
        const float *near_light = s->near_light + g->stride * i;
        reflect(g, s->luxel[i], sums, 1, NULL, g->rows_direct + row);
        for (size_t k = 0; k < g->stride; ++k) sums[k] += near_light[k];
        reflect(g, s->luxel[i], sums, 1, g->radiosity + g->stride * s->luxel[i], g->rows[0] + row);
    }
    return LX_OK;
}

lx_result lx_gather_light(lx_gather_job *g, lx_error *error)
{
    return lx_pool_run_weighted(g->bake->scene->context->pool, g->job->map.tile_count, g->job->tile_weights, light_tile, g, "direct", g->job->progress, error);
}

// ---- passes -------------------------------------------------------------------------------------------------------------------------

static lx_result pass_tile(void *user, size_t task, uint32_t worker, lx_error *error)
{
    (void)error;
    const lx_gather_job *g = user;
    const lx_luxel_tile *tile = &g->job->map.tiles[task];
    // What recorded paths found behind a near hit is a bounce further: where bounces are counted, of the pass before.
    const uint16_t *from = g->rows[0], *from_later = !lx_gather_is_truncated(g) ? g->rows[0] : g->pass > 0 ? g->rows[2] : NULL; // before the first pass there was none
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
            if (hits[k] != LX_NO_LUXEL) lx_row_fetch(from + g->row_stride * hits[k], g->stride);
        for (uint32_t k = 0; k < g->pass_rays; ++k)
            if (hits[k] != LX_NO_LUXEL) lx_row_add(sums, from + g->row_stride * hits[k], g->stride);
        for (; extra < extras->count && extras->items[extra].target == i; ++extra) {
            const lx_gather_extra *e = &extras->items[extra];
            if (!from_later) continue;
            const float weight[3] = {e->weight.r, e->weight.g, e->weight.b};
            lx_row_add_scaled(sums, from_later + g->row_stride * e->luxel, g->row_layers, weight);
        }
        float *radiosity = g->radiosity + g->stride * i;
        uint16_t *row = g->rows[1] + g->row_stride * i;
        const lx_rgb a = g->luxels[i].albedo;
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
    const lx_gather_job *g = user;
    const lx_luxel_tile *tile = &g->job->map.tiles[task];
    const bool truncated = lx_gather_is_truncated(g);
    for (uint32_t i = tile->first; i < tile->first + tile->count; ++i) {
        if (!g->job->map.valid[i]) continue;
        const float *radiosity = g->radiosity + g->stride * i;
        uint16_t *all = g->rows[0] + g->row_stride * i, *without_last = g->rows[1] + g->row_stride * i;
        for (size_t k = 0; k < g->stride; ++k) {
            const float last = truncated ? lx_row_decode_small(all[k]) * LX_ROW_UNIT : 0;
            all[k] = lx_row_encode(radiosity[k]);
            if (truncated) without_last[k] = lx_row_encode(radiosity[k] - last);
        }
    }
    return LX_OK;
}

lx_result lx_gather_passes(lx_gather_job *g, lx_error *error)
{
    lx_result result = LX_OK;
    const uint32_t wanted = lx_gather_is_truncated(g) ? g->settings.bounces - 1 : LX_BOUNCES_INF; // beyond the first; LX_BOUNCES_INF: until no layer gains what counts
    lx_bake_job *job = g->job;
    lx_pool *pool = g->bake->scene->context->pool;
    double *changes = lx_calloc_array(g->layer_count, sizeof *changes); // of the last pass
    if (!changes) return lx_fail_memory(error, "irradiance cache");
    memset(g->converged, 0, g->layer_count);
    lx_stage_part part = {.sink = job->progress, .start = lx_seconds()};
    const lx_progress_sink sink = {lx_report_part, &part};
    const uint32_t limit = wanted < most_passes ? wanted : most_passes;
    for (uint32_t pass = 0; pass < limit; ++pass) {
        const double expected = wanted == LX_BOUNCES_INF ? pass + 4.0 : limit; // nobody knows how many it will take
        part.from = pass / expected;
        part.share = 1 / (expected + (wanted == LX_BOUNCES_INF)) * (1 - part.from);
        LX_TRY(lx_pool_run_weighted(pool, job->map.tile_count, job->tile_weights, pass_tile, g, "cache", &sink, error));
        ++g->pass;
        uint16_t *last = g->rows[0], *free_rows = lx_gather_is_truncated(g) ? g->rows[2] : last;
        g->rows[0] = g->rows[1];
        g->rows[1] = free_rows;
        if (lx_gather_is_truncated(g)) g->rows[2] = last;
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
