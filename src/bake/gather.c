// All layers and all bounces for the price of one gather ray: [transport 4] in docs/architecture.md.
//
// 1. gather_cache.c: direct light of every luxel and layer by shadow rays (trace/direct.h), and some cosine-weighted rays a luxel, traced once: what they hit is kept.
// 2. The same: passes, radiosity of every luxel <- albedo × (direct light + mean over its rays of the radiosity there), for all layers at once: a sparse matrix
//    times a dense one. One more pass is one more bounce.
// 3. gather_rounds.c: the final gather, many more rays, in rounds; they read the radiosity where they hit, until every layer is sure enough.
//
// Rays never depend on light, so a layer's texels depend on its own sources alone. (Light samples at near hits are drawn per source.)
#include "bake/gather_job.h"

#include "bake/finish.h"
#include "bake/memory_plan.h"
#include "base/clock.h"
#include "base/error.h"
#include "trace/tracer_data.h"

#include <string.h>

static const float near_texels = 1.0f;

static uint32_t max_cells(const lx_gather_job *g)
{
    uint32_t most = 1;
    for (uint32_t s = 0; s < g->bake->source_count; ++s) {
        const uint32_t cells = lx_tracer_cell_count(g->bake->tracer, s);
        if (cells > most) most = cells;
    }
    return most;
}

// A power of two that brings the brightest light a layer may give to at most 1: 2^24 times what its sources give the scene on average.
static void choose_scales(lx_gather_job *g)
{
    for (uint32_t l = 0; l < g->row_layers; ++l) g->scales[l] = 0;
    for (uint32_t s = 0; s < g->bake->source_count; ++s) {
        const lx_source_use *use = &g->uses[s];
        if (use->layer < 0) continue;
        const uint32_t layers = lx_source_use_layers(use, g->bake->tracer, s);
        for (uint32_t l = 0; l < layers; ++l)
            g->scales[(uint32_t)use->layer + l] += lx_rgb_max(use->weight) * lx_source_mean(g->bake->tracer, s);
    }
    for (uint32_t l = 0; l < g->row_layers; ++l) {
        int exponent;
        frexpf(g->scales[l] > 0 && g->scales[l] < INFINITY ? g->scales[l] : 1, &exponent);
        g->scales[l] = ldexpf(1, -24 - exponent);
    }
}

static lx_result create_scratch(lx_gather_job *g, uint32_t workers, uint32_t round_rays, lx_error *error)
{
    const size_t sum_rows = lx_gather_tile_luxels > 2 * lx_gather_chunk_luxels ? lx_gather_tile_luxels : 2 * lx_gather_chunk_luxels;
    const size_t rays = round_rays > lx_gather_most_pass_rays ? round_rays : lx_gather_most_pass_rays, cells = max_cells(g);
    g->scratch = lx_calloc_array(workers, sizeof *g->scratch);
    if (!g->scratch) return lx_fail_memory(error, "workers");
    for (uint32_t i = 0; i < workers; ++i) {
        lx_gather_scratch *s = &g->scratch[i];
        s->batch = lx_gather_batch_create();
        s->direct = lx_direct_batch_create(g->bake->tracer);
        s->sites = lx_calloc_array((size_t)lx_gather_tile_luxels * lx_site_count, sizeof *s->sites);
        s->starts = lx_malloc_array(lx_gather_chunk_luxels * rays, sizeof *s->starts);
        s->sums = lx_malloc_array(sum_rows, g->stride * sizeof *s->sums);
        s->met = lx_malloc_array(sum_rows, g->stride * sizeof *s->met);
        s->near_light = lx_malloc_array(lx_gather_tile_luxels, g->stride * sizeof *s->near_light);
        s->mean = lx_malloc_array(cells * lx_gather_tile_luxels, sizeof *s->mean);
        s->variance = lx_malloc_array(cells * lx_gather_tile_luxels, sizeof *s->variance);
        s->found = lx_malloc_array((size_t)lx_gather_chunk_luxels * lx_gather_most_pass_rays, sizeof *s->found);
        s->distances = lx_malloc_array((size_t)lx_gather_chunk_luxels * lx_gather_most_pass_rays, sizeof *s->distances);
        if (!s->batch || !s->direct || !s->sites || !s->starts || !s->sums || !s->met || !s->near_light || !s->mean || !s->variance || !s->found ||
            !s->distances)
            return lx_fail_memory(error, "workers");
    }
    return LX_OK;
}

// What the final gather was the last to need.
static void release_cache(lx_gather_job *g, uint32_t workers)
{
    for (uint32_t i = 0; g->scratch && i < workers; ++i) {
        lx_gather_scratch *s = &g->scratch[i];
        if (s->batch) g->job->ray_count += lx_gather_batch_rays(s->batch);
        if (s->direct) g->job->ray_count += lx_direct_batch_rays(s->direct);
        lx_gather_batch_destroy(s->batch);
        lx_direct_batch_destroy(s->direct);
        void *arrays[] = {s->sites, s->starts, s->sums, s->met, s->near_light, s->mean, s->variance, s->found, s->distances};
        for (size_t k = 0; k < sizeof arrays / sizeof *arrays; ++k) lx_free(arrays[k]);
    }
    for (uint32_t t = 0; g->extras && t < g->job->map.tile_count; ++t) lx_free(g->extras[t].items);
    void **arrays[] = {(void **)&g->scratch, (void **)&g->extras, (void **)&g->luxels, (void **)&g->rows[0], (void **)&g->rows[1],
                       (void **)&g->rows[2], (void **)&g->rows_direct, (void **)&g->hits, (void **)&g->met_estimates, (void **)&g->closeness, (void **)&g->sky_cells};
    for (size_t i = 0; i < sizeof arrays / sizeof *arrays; ++i) {
        lx_free(*arrays[i]);
        *arrays[i] = NULL;
    }
    lx_lookup_release(&g->lookup);
}

static void release(lx_gather_job *g)
{
    for (uint32_t t = 0; g->tiles && t < g->job->map.tile_count; ++t) {
        lx_free(g->tiles[t].frozen);
    }
    void *arrays[] = {g->met, g->scales, g->authored, g->direct, g->indirect, g->pass_change, g->pass_energy, g->converged, g->tiles, g->layer_means,
                      g->halvings, g->gain, g->spacing};
    for (size_t i = 0; i < sizeof arrays / sizeof *arrays; ++i) lx_free(arrays[i]);
}

// Light sources that gather rays meet: those whose part of the layers' direct light is in two estimates until the last round.
static lx_result allocate_met(lx_gather_job *g, lx_error *error)
{
    uint32_t count = 0;
    g->met = lx_calloc_array(g->layer_count, sizeof *g->met);
    bool *is_met = lx_calloc_array(g->layer_count, sizeof *is_met);
    for (uint32_t s = 0; g->met && is_met && s < g->bake->source_count; ++s) {
        const lx_source_use *use = &g->uses[s];
        if (use->layer < 0 || !lx_bake_meets(g->bake, s)) continue;
        const uint32_t layers = lx_source_use_layers(use, g->bake->tracer, s);
        for (uint32_t l = 0; l < layers; ++l) is_met[(uint32_t)use->layer + l] = true;
    }
    for (uint32_t l = 0; is_met && l < g->layer_count; ++l) count += is_met[l];
    if (count > 0) g->met_estimates = lx_calloc_array(count, g->luxel_count * sizeof *g->met_estimates);
    const bool ok = g->met && is_met && (count == 0 || g->met_estimates);
    for (uint32_t l = 0, k = 0; ok && l < g->layer_count; ++l)
        if (is_met[l]) g->met[l] = g->met_estimates + (size_t)k++ * g->luxel_count;
    lx_free(is_met);
    return ok ? LX_OK : lx_fail_memory(error, "layers; --memory bakes them in groups");
}

static lx_result allocate(lx_gather_job *g, lx_error *error)
{
    const size_t luxels = g->luxel_count, layers = g->layer_count, tiles = g->job->map.tile_count;
    const size_t cached = g->settings.bounces > 0 ? luxels : 0;
    size_t all;
    if (!lx_mul_size(luxels, layers, &all) || !lx_mul_size(all, 64, &all)) return lx_fail_memory(error, "layers");
    g->scales = lx_calloc_array(g->row_layers, sizeof *g->scales);
    g->authored = lx_calloc_array(layers, sizeof *g->authored);
    g->luxels = lx_calloc_array(cached, sizeof *g->luxels);
    g->closeness = lx_calloc_array(luxels, sizeof *g->closeness);
    g->spacing = lx_calloc_array(luxels, sizeof *g->spacing);
    g->sky_cells = lx_calloc_array(g->samples_sky ? luxels : 0, sizeof *g->sky_cells);
    for (int i = 0; i < 3; ++i) g->rows[i] = lx_malloc_array(i < 2 || lx_gather_is_truncated(g) ? cached : 0, g->row_stride * sizeof *g->rows[i]);
    g->rows_direct = lx_malloc_array(cached, g->row_stride * sizeof *g->rows_direct);
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
    if (!g->scales || !g->authored || !g->luxels || !g->closeness || !g->spacing || !g->sky_cells || !g->rows[0] || !g->rows[1] || !g->rows[2] || !g->rows_direct || !g->hits || !g->extras || !g->direct || !g->indirect ||
        !g->pass_change || !g->pass_energy || !g->converged || !g->tiles || !g->layer_means || !g->halvings || !g->gain)
        return lx_fail_memory(error, "layers; --memory bakes them in groups");
    for (size_t l = 0; l < layers; ++l) g->gain[l] = 1;
    for (size_t t = 0; t < tiles; ++t) {
        g->tiles[t].frozen = lx_calloc_array(layers, 1);
        if (!g->tiles[t].frozen) return lx_fail_memory(error, "layers");
    }
    return LX_OK;
}

static void take_met_light(const lx_gather_job *g)
{
    for (uint32_t l = 0; l < g->layer_count; ++l)
        for (uint32_t i = 0; g->met[l] && i < g->luxel_count; ++i) {
            lx_estimate *direct = &g->direct[(size_t)l * g->luxel_count + i];
            direct->mean = lx_rgb_add(direct->mean, g->met[l][i].mean);
            direct->variance += g->met[l][i].variance;
        }
}

// Takes a group's layers into the sum.
static void add_to_sums(const lx_gather_job *g)
{
    for (uint32_t l = 0; l < g->layer_count; ++l) {
        const lx_estimate *direct = g->direct + (size_t)l * g->luxel_count, *indirect = g->indirect + (size_t)l * g->luxel_count;
        const float c = g->authored[l];
        for (uint32_t i = 0; i < g->luxel_count; ++i) {
            g->sums[i].value += c * (lx_rgb_mean(direct[i].mean) + lx_rgb_mean(indirect[i].mean));
            g->sums[i].direct_variance += c * c * direct[i].variance;
            g->sums[i].indirect_variance += c * c * indirect[i].variance;
        }
    }
}

// Relative standard error of the sum. Layers share their rays, so their errors go together: the first round told how much.
static float estimate_noise(const lx_bake_job *job, const lx_gather_sum *sums)
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
        const double value = fmax((double)sums[i].value, (double)lx_gather_darkest * mean);
        const double variance = (double)sums[i].direct_variance + together * (double)sums[i].indirect_variance;
        if (value > 0) sum += variance / (value * value);
    }
    return (float)sqrt(sum / count);
}

static void find_authored(lx_gather_job *g)
{
    for (uint32_t l = 0; l < g->layer_count; ++l) {
        const lx_layer *layer = &g->bake->layers[g->first_layer + l];
        g->authored[l] = (layer->color[0] + layer->color[1] + layer->color[2]) / 3 * layer->intensity;
    }
}

// Luxels that answer for what is hit on them: valid ones, unless they reach into two rooms or under something low.
static lx_result choose_answers(lx_gather_job *g, lx_error *error)
{
    const lx_bake_map *map = &g->job->map;
    uint8_t *answers = lx_malloc_array(map->view.count, 1);
    if (!answers) return lx_fail_memory(error, "luxels");
    for (uint32_t i = 0; i < map->view.count; ++i) {
        uint32_t texel;
        const lx_luxel_page *page = lx_job_page(g->job, i, &texel);
        answers[i] = map->valid[i] && lx_luxel_is_whole(g->bake, page, texel);
    }
    lx_lookup_silence(&g->lookup, &map->view, answers);
    lx_free(answers);
    return LX_OK;
}

// Bakes layers first … first + count - 1. `uses`: [source_count] room for their uses.
static lx_result bake_group(lx_bake_job *job, uint32_t first, uint32_t count, lx_source_use *uses, lx_gather_sum *sums, lx_finish *finish,
                            double deadline, lx_error *error)
{
    lx_result result = LX_OK;
    lx_bake *bake = job->bake;
    lx_pool *pool = bake->scene->context->pool;
    const uint32_t workers = lx_pool_worker_count(pool), rays = lx_gather_rays(bake->desc.samples);
    const uint32_t bounces = bake->desc.direct_only ? 0 : bake->desc.transport.bounces;
    double stage_start = lx_seconds();
    for (uint32_t s = 0; s < bake->source_count; ++s) {
        uses[s] = bake->uses[s];
        const bool in_group = uses[s].layer >= (int32_t)first && uses[s].layer < (int32_t)(first + count);
        uses[s].layer = in_group ? uses[s].layer - (int32_t)first : -1;
    }
    lx_gather_job g = {.job = job, .bake = bake, .uses = uses, .first_layer = first, .layer_count = count, .row_layers = lx_row_layers(count), .sums = sums,
                    .luxel_count = job->map.view.count, .pass_rays = lx_gather_pass_rays(rays, job->map.view.count)};
    g.sky_cell_count = g.pass_rays < lx_sky_most_cells ? g.pass_rays : lx_sky_most_cells;
    g.stride = 3 * (size_t)g.row_layers;
    g.row_stride = lx_row_stride(g.row_layers);
    g.settings.bounces = bounces;
    g.interpolates = bake->desc.interpolation > 0;
    g.samples_sky = lx_sky_is_uniform(&bake->tracer->sky) && uses[bake->source_count - 1].layer >= 0;
    LX_TRY(allocate(&g, error));
    LX_TRY(allocate_met(&g, error));
    find_authored(&g);
    choose_scales(&g);
    LX_TRY(lx_lookup_create(bake, &job->map.view, &g.lookup, error));
    LX_TRY(choose_answers(&g, error));
    LX_TRY(create_scratch(&g, workers, rays < lx_gather_largest_round ? rays : lx_gather_largest_round, error));
    LX_TRY(lx_gather_light(&g, error));
    job->stages.direct += lx_lap(&stage_start);
    if (bounces > 0) {
        LX_TRY(lx_gather_passes(&g, error));
        memset(g.indirect, 0, g.indirect_bytes);
    }
    job->stages.cache += lx_lap(&stage_start);
    g.settings = (lx_gather_settings){.tracer = bake->tracer, .lookup = &g.lookup, .uses = g.uses, .scales = g.scales, .row_layers = g.row_layers,
                                      .bounces = bounces, .direct = !bake->desc.indirect_only, .near_texels = near_texels};
    if (bounces > 0) {
        g.settings.rows = g.rows[0];
        g.settings.rows_later = !lx_gather_is_truncated(&g) ? g.rows[0] : bounces > 1 ? g.rows[1] : NULL;
        g.settings.rows_direct = g.rows_direct;
        g.settings.luxels = g.luxels;
    }
    LX_TRY(lx_gather_rounds(&g, deadline, error));
    job->stages.gather += lx_lap(&stage_start);
    take_met_light(&g);
    add_to_sums(&g);
    release_cache(&g, workers);
    lx_trim_memory();
    LX_TRY(lx_finish_layers(finish, g.direct, g.indirect, g.spacing, first, count, error));
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
    lx_gather_sum *sums = lx_calloc_array(job->map.view.count, sizeof *sums);
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
