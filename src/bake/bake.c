// The bake: luxels, paths, averages, padding. Tiles of luxels are the unit of work; what a tile computes depends on nothing but its place
// and the settings, so any number of threads gives the same bits.
#include "bake/bake.h"

#include "bake/advice.h"
#include "bake/animations.h"
#include "bake/layers.h"
#include "bake/luxels.h"
#include "base/clock.h"
#include "base/error.h"
#include "math/hash.h"
#include "post/dilate.h"

#include <string.h>

enum {
    tile_luxels = lx_luxel_tile_edge * lx_luxel_tile_edge,
    most_sites = 16,    // places per texel; more would cost rays for push-off without telling more
    most_samples = 1 << 24,
};

lx_transport_desc lx_transport_desc_default(void)
{
    return (lx_transport_desc){.bounces = 8, .sky = {.intensity = 1}, .seed = 1};
}

lx_bake_desc lx_bake_desc_default(void)
{
    lx_bake_desc desc = {.transport = lx_transport_desc_default(), .integrator = LX_INTEGRATOR_PATH, .samples = 256, .noise = 0.02f, .denoise = LX_DENOISE_BUILTIN,
                         .max_layers = 64};
    return desc;
}

static lx_result check_desc(const lx_bake_desc *desc, lx_error *error)
{
    if (desc->samples < 1 || desc->samples > most_samples)
        return lx_fail(error, LX_ERROR_INVALID_ARGUMENT, "samples must be 1 to %d, not %u", most_samples, desc->samples);
    if (desc->direct_only && desc->indirect_only)
        return lx_fail(error, LX_ERROR_INVALID_ARGUMENT, "direct-only and indirect-only exclude each other");
    if (desc->max_layers < 1 || desc->max_layers > 4096)
        return lx_fail(error, LX_ERROR_INVALID_ARGUMENT, "max-layers must be 1 to 4096, not %u", desc->max_layers);
    const lx_sky_desc *sky = &desc->transport.sky;
    for (int i = 0; i < 3; ++i)
        if (!(sky->color[i] >= 0) || !(sky->color[i] < INFINITY))
            return lx_fail(error, LX_ERROR_INVALID_ARGUMENT, "the sky's colour must not be negative");
    if (!(sky->intensity >= 0) || !(sky->intensity < INFINITY))
        return lx_fail(error, LX_ERROR_INVALID_ARGUMENT, "the sky's intensity must not be negative");
    return LX_OK;
}

// Monitors are told by cell, unless all light goes into one layer: then their pictures need no cells.
static lx_result create_tracer(lx_bake *bake, lx_error *error)
{
    const lx_scene *scene = bake->scene;
    bool *cells = lx_calloc_array(scene->source_count, sizeof *cells);
    if (!cells) return lx_fail_memory(error, "bake");
    for (uint32_t i = 0; i < scene->source_count; ++i) cells[i] = scene->sources[i].columns > 0 && !bake->desc.combined;
    const lx_result result = lx_tracer_create(scene, &bake->desc.transport, false, cells, &bake->tracer, error);
    lx_free(cells);
    return result;
}

// From what is rasterised so far.
static lx_result number_luxels(lx_bake *bake, lx_error *error)
{
    lx_result result = LX_OK;
    lx_finished_destroy(bake->finished);
    bake->finished = NULL;
    lx_bake_map_release(&bake->map);
    LX_TRY(lx_bake_map_build(bake->atlas->page_size, bake->atlas->page_count, bake->texel_chart, bake->texel_coverage, &bake->map, error));
    LX_TRY(lx_finished_create(&bake->map, bake->layer_count, false, NULL, &bake->finished, error));
cleanup:
    return result;
}

lx_result lx_bake_create(const lx_scene *scene, const lx_atlas *atlas, const lx_bake_desc *desc, lx_bake **out_bake,
                         lx_error *error)
{
    lx_result result = check_desc(desc, error);
    if (result != LX_OK) return result;
    lx_bake *bake = lx_calloc_array(1, sizeof *bake);
    if (!bake) return lx_fail_memory(error, "bake");
    bake->scene = scene;
    bake->atlas = atlas;
    bake->desc = *desc;
    LX_TRY(create_tracer(bake, error));
    LX_TRY(lx_layers_build(bake, error));
    LX_TRY(lx_animations_build(bake, error));
    size_t texel_count;
    if (!lx_mul_size((size_t)atlas->page_size * atlas->page_size, atlas->page_count, &texel_count)) {
        result = lx_fail(error, LX_ERROR_LIMIT, "%u pages are too many", atlas->page_count);
        goto cleanup;
    }
    bake->texel_chart = lx_malloc_array(texel_count, sizeof *bake->texel_chart);
    bake->texel_coverage = lx_calloc_array(texel_count, sizeof *bake->texel_coverage);
    if (!bake->texel_chart || !bake->texel_coverage) {
        result = lx_fail_memory(error, "texels");
        goto cleanup;
    }
    memset(bake->texel_chart, 0xff, texel_count * sizeof *bake->texel_chart); // LX_NO_CHART
    LX_TRY(number_luxels(bake, error)); // none yet: a bake that never ran is black
    *out_bake = bake;
    bake = NULL;
cleanup:
    lx_bake_destroy(bake);
    return result;
}

void lx_bake_destroy(lx_bake *bake)
{
    if (!bake) return;
    lx_animations_release(bake);
    lx_layers_release(bake);
    lx_tracer_destroy(bake->tracer);
    lx_finished_destroy(bake->finished);
    lx_bake_map_release(&bake->map);
    lx_free(bake->texel_chart);
    lx_free(bake->texel_coverage);
    lx_free(bake);
}

void lx_bake_get_summary(const lx_bake *bake, lx_bake_summary *out)
{
    *out = bake->summary;
}

// ---- tiles ------------------------------------------------------------------------------------------------------------------

// Working memory of one worker.
typedef struct tile_scratch {
    lx_path_batch *batch;
    double *sums;         // [luxel of the tile][layer][channel]
    lx_receiver *sites;   // [luxel of the tile][most_sites]
    uint32_t back_hits[tile_luxels];
    lx_rgb layer[tile_luxels]; // one layer on its way out
    lx_path_start starts[lx_path_batch_size];
} tile_scratch;

typedef struct bake_job {
    lx_bake *bake;
    lx_luxel_page *pages;
    tile_scratch *scratch; // [worker]
    lx_path_settings settings;
    uint32_t site_count;
    lx_stage_seconds stages;
} bake_job;

// On its page.
static uint32_t texel_of(const lx_luxel_map *map, uint32_t luxel)
{
    return map->texel[luxel] % (map->page_size * map->page_size);
}

static uint32_t luxel_stream(const bake_job *job, const lx_luxel_tile *tile, uint32_t luxel)
{
    return lx_stream_key(job->bake->desc.transport.seed, tile->page, texel_of(&job->bake->map.view, luxel));
}

static void place_sites(const bake_job *job, const lx_luxel_tile *tile, uint32_t luxel, uint32_t count, lx_receiver *out)
{
    const lx_luxel_map *map = &job->bake->map.view;
    lx_luxel_sites(job->bake, &job->pages[tile->page], lx_luxel_x(map, luxel), lx_luxel_y(map, luxel), luxel_stream(job, tile, luxel), count, out);
}

// Luxel by luxel, so that the paths of a batch start close together. A site keeps a run of consecutive samples, which is
// a well-spread set in itself.
static void trace_luxels(const bake_job *job, const lx_luxel_tile *tile, tile_scratch *s)
{
    const uint32_t samples = job->bake->desc.samples;
    size_t filled = 0;
    for (uint32_t i = 0; i < tile->count; ++i) {
        const uint32_t stream = luxel_stream(job, tile, tile->first + i);
        for (uint32_t sample = 0; sample < samples; ++sample) {
            const uint32_t site = (uint32_t)((uint64_t)sample * job->site_count / samples);
            s->starts[filled++] = (lx_path_start){.receiver = s->sites[(size_t)i * most_sites + site], .weight = {1, 1, 1},
                                                  .stream = stream, .sample = sample, .target = i};
            if (filled == lx_path_batch_size) {
                if (lx_pool_is_stopping(job->bake->scene->context->pool)) return;
                lx_path_trace(s->batch, &job->settings, s->starts, filled, s->sums, s->back_hits);
                filled = 0;
            }
        }
    }
    lx_path_trace(s->batch, &job->settings, s->starts, filled, s->sums, s->back_hits);
}

static lx_result store_luxels(const bake_job *job, const lx_luxel_tile *tile, tile_scratch *s, lx_error *error)
{
    lx_bake *bake = job->bake;
    const double scale = 1.0 / bake->desc.samples;
    for (uint32_t layer = 0; layer < bake->layer_count; ++layer) {
        for (uint32_t i = 0; i < tile->count; ++i) {
            const double *sum = s->sums + 3 * ((size_t)i * bake->layer_count + layer);
            s->layer[i] = (lx_rgb){(float)(sum[0] * scale), (float)(sum[1] * scale), (float)(sum[2] * scale)};
        }
        const lx_result result = lx_finished_write(bake->finished, layer, tile->first, tile->count, s->layer, error);
        if (result != LX_OK) return result;
    }
    // A place that sees the black side of closed surfaces in more than a quarter of all directions is inside something.
    for (uint32_t i = 0; i < tile->count; ++i) bake->map.valid[tile->first + i] = s->back_hits[i] <= bake->desc.samples / 4;
    return LX_OK;
}

static lx_result bake_tile(void *user, size_t task, uint32_t worker, lx_error *error)
{
    const bake_job *job = user;
    const lx_luxel_tile *tile = &job->bake->map.tiles[task];
    tile_scratch *s = &job->scratch[worker];
    memset(s->sums, 0, sizeof(double) * 3 * tile->count * job->bake->layer_count);
    memset(s->back_hits, 0, sizeof s->back_hits);
    for (uint32_t i = 0; i < tile->count; ++i) place_sites(job, tile, tile->first + i, job->site_count, s->sites + (size_t)i * most_sites);
    trace_luxels(job, tile, s);
    return store_luxels(job, tile, s, error);
}

// ---- stages -----------------------------------------------------------------------------------------------------------------

static lx_result rasterise_page(void *user, size_t page, uint32_t worker, lx_error *error)
{
    (void)worker;
    bake_job *job = user;
    return lx_luxels_rasterise(job->bake, (uint32_t)page, &job->pages[page], error);
}

static lx_result create_scratch(bake_job *job, uint32_t workers, lx_error *error)
{
    job->scratch = lx_calloc_array(workers, sizeof *job->scratch);
    if (!job->scratch) return lx_fail_memory(error, "workers");
    for (uint32_t i = 0; i < workers; ++i) {
        tile_scratch *s = &job->scratch[i];
        s->batch = lx_path_batch_create();
        s->sums = lx_calloc_array((size_t)tile_luxels * job->bake->layer_count * 3, sizeof *s->sums);
        s->sites = lx_calloc_array((size_t)tile_luxels * most_sites, sizeof *s->sites);
        if (!s->batch || !s->sums || !s->sites) return lx_fail_memory(error, "workers");
    }
    return LX_OK;
}

static void release_job(bake_job *job, uint32_t workers)
{
    for (uint32_t i = 0; job->scratch && i < workers; ++i) {
        lx_path_batch_destroy(job->scratch[i].batch);
        lx_free(job->scratch[i].sums);
        lx_free(job->scratch[i].sites);
    }
    for (uint32_t i = 0; job->pages && i < job->bake->atlas->page_count; ++i) lx_luxels_release(&job->pages[i]);
    lx_free(job->scratch);
    lx_free(job->pages);
}

// Fills padding and invalid texels of one page in all layers.
static lx_result fill_page(void *user, size_t page, uint32_t worker, lx_error *error)
{
    (void)worker;
    const lx_bake *bake = ((bake_job *)user)->bake;
    const size_t texel_count = (size_t)bake->atlas->page_size * bake->atlas->page_size;
    return lx_finished_dilate(bake->finished, (uint32_t)page, bake->atlas->padding, bake->texel_chart + page * texel_count, error);
}

// Seconds since *start, which becomes now.
static double lap(double *start)
{
    const double now = lx_seconds(), seconds = now - *start;
    *start = now;
    return seconds;
}

static void summarise(bake_job *job, uint32_t workers, double start)
{
    lx_bake *bake = job->bake;
    const size_t total = (size_t)bake->atlas->page_size * bake->atlas->page_size * bake->atlas->page_count;
    lx_bake_summary *s = &bake->summary;
    *s = (lx_bake_summary){.page_count = bake->atlas->page_count, .page_size = bake->atlas->page_size,
                           .layer_count = bake->layer_count, .source_count = bake->source_count,
                           .texels_per_m = bake->atlas->texels_per_m, .stages = job->stages};
    s->texel_count = bake->map.view.count;
    for (uint32_t i = 0; i < bake->map.view.count; ++i) s->invalid_count += !bake->map.valid[i];
    s->coverage = (float)((double)s->texel_count / (double)total);
    s->path_count = s->texel_count * bake->desc.samples;
    for (uint32_t i = 0; i < workers; ++i) s->ray_count += lx_path_batch_rays(job->scratch[i].batch);
    s->seconds = lx_seconds() - start;
}

// A few places of the first tile of each page stand for all.
static void check_sum_of_layers(const bake_job *job)
{
    enum { points_per_page = 16 };
    lx_receiver points[points_per_page];
    uint32_t last_page = UINT32_MAX;
    for (uint32_t i = 0; i < job->bake->map.tile_count && !job->bake->desc.combined; ++i) {
        const lx_luxel_tile *tile = &job->bake->map.tiles[i];
        if (tile->page == last_page) continue;
        last_page = tile->page;
        const uint32_t count = tile->count < points_per_page ? tile->count : points_per_page;
        for (uint32_t k = 0; k < count; ++k) place_sites(job, tile, tile->first + k * tile->count / count, 1, &points[k]);
        lx_layers_check(job->bake, job->scratch[0].batch, points, count);
    }
}

lx_result lx_bake_run(lx_bake *bake, const lx_progress_sink *progress, lx_error *error)
{
    lx_result result = LX_OK;
    const double start = lx_seconds();
    double stage_start = start;
    const lx_atlas *atlas = bake->atlas;
    lx_pool *pool = bake->scene->context->pool;
    const uint32_t workers = lx_pool_worker_count(pool), samples = bake->desc.samples;
    float *weights = NULL;
    bake_job job = {.bake = bake, .stages = {.import = bake->scene->import_seconds, .unwrap = atlas->seconds}, .site_count = samples < most_sites ? samples : (uint32_t)most_sites};
    job.settings = (lx_path_settings){.tracer = bake->tracer, .uses = bake->uses, .layer_count = bake->layer_count,
                                      .bounces = bake->desc.direct_only ? 0 : bake->desc.transport.bounces,
                                      .direct = !bake->desc.indirect_only, .indirect = !bake->desc.direct_only};
    job.pages = lx_calloc_array(atlas->page_count, sizeof *job.pages);
    if (!job.pages) {
        result = lx_fail_memory(error, "luxels");
        goto cleanup;
    }
    LX_TRY(create_scratch(&job, workers, error));
    lx_advise_on_scene(bake);
    LX_TRY(lx_pool_run(pool, atlas->page_count, rasterise_page, &job, "luxels", progress, error));
    LX_TRY(number_luxels(bake, error));
    weights = lx_malloc_array(bake->map.tile_count, sizeof *weights);
    if (!weights) {
        result = lx_fail_memory(error, "tiles");
        goto cleanup;
    }
    for (uint32_t i = 0; i < bake->map.tile_count; ++i) weights[i] = (float)bake->map.tiles[i].count;
    job.stages.luxels = lap(&stage_start);
    LX_TRY(lx_pool_run_weighted(pool, bake->map.tile_count, weights, bake_tile, &job, "bake", progress, error));
    job.stages.bake = lap(&stage_start);
    LX_TRY(lx_pool_run(pool, atlas->page_count, fill_page, &job, "post", progress, error));
    job.stages.post = lap(&stage_start);
    summarise(&job, workers, start);
    check_sum_of_layers(&job);
    LX_TRY(lx_advise_on_layers(bake, error));
cleanup:
    release_job(&job, workers);
    lx_free(weights);
    return result;
}
