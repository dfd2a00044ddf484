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
    tile_edge = lx_site_block, // texels; the same blocks the pack is stored in
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
    size_t texel_count, value_count;
    if (!lx_mul_size((size_t)atlas->page_size * atlas->page_size, atlas->page_count, &texel_count) ||
        !lx_mul_size(texel_count * 3, bake->layer_count, &value_count)) {
        result = lx_fail(error, LX_ERROR_LIMIT, "%u pages of %u layers are too many", atlas->page_count, bake->layer_count);
        goto cleanup;
    }
    bake->texels = lx_calloc_array(value_count, sizeof *bake->texels);
    bake->texel_chart = lx_malloc_array(texel_count, sizeof *bake->texel_chart);
    bake->texel_coverage = lx_calloc_array(texel_count, sizeof *bake->texel_coverage);
    if (!bake->texels || !bake->texel_chart || !bake->texel_coverage) {
        result = lx_fail(error, LX_ERROR_OUT_OF_MEMORY, "out of memory: %u layers of %u pages need %.1f GiB; fewer layers or pages do",
                         bake->layer_count, atlas->page_count, (double)value_count * sizeof(float) / (1u << 30));
        goto cleanup;
    }
    memset(bake->texel_chart, 0xff, texel_count * sizeof *bake->texel_chart); // LX_NO_CHART
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
    lx_free(bake->texels);
    lx_free(bake->texel_chart);
    lx_free(bake->texel_coverage);
    lx_free(bake);
}

void lx_bake_get_summary(const lx_bake *bake, lx_bake_summary *out)
{
    *out = bake->summary;
}

// ---- tiles ------------------------------------------------------------------------------------------------------------------

// Working memory of one worker. A tile has at most tile_edge² texels.
typedef struct tile_scratch {
    lx_path_batch *batch;
    double *sums;         // [texel of the tile][layer][channel]
    lx_receiver *sites;   // [texel of the tile][lx_site_count]
    uint32_t texels[tile_edge * tile_edge]; // on the page
    lx_path_start starts[lx_path_batch_size];
} tile_scratch;

typedef struct luxel_tile {
    uint32_t page, x, y;
    float texel_count;
} luxel_tile;

typedef struct bake_job {
    lx_bake *bake;
    lx_luxel_page *pages;
    luxel_tile *tiles;
    size_t tile_count;
    tile_scratch *scratch; // [worker]
    lx_path_settings settings;
    uint32_t site_count;
    lx_stage_seconds stages;
} bake_job;

static uint32_t collect_texels(const bake_job *job, const luxel_tile *tile, tile_scratch *s)
{
    const uint32_t size = job->bake->atlas->page_size;
    const uint8_t *coverage = job->bake->texel_coverage + (size_t)tile->page * size * size;
    uint32_t count = 0;
    for (uint32_t y = tile->y; y < tile->y + tile_edge && y < size; ++y)
        for (uint32_t x = tile->x; x < tile->x + tile_edge && x < size; ++x)
            if (coverage[(size_t)y * size + x]) s->texels[count++] = y * size + x;
    return count;
}

static void place_sites(const bake_job *job, const luxel_tile *tile, tile_scratch *s, uint32_t count)
{
    for (uint32_t i = 0; i < count; ++i)
        lx_luxel_sites(job->bake, &job->pages[tile->page], s->texels[i], 0, job->site_count, s->sites + (size_t)i * lx_site_count);
}

// Texel by texel, so that the paths of a batch start close together. A site keeps a run of consecutive samples, which is
// a well-spread set in itself.
static void trace_texels(const bake_job *job, const luxel_tile *tile, tile_scratch *s, uint32_t count)
{
    const uint32_t samples = job->bake->desc.samples;
    const lx_luxel_page *page = &job->pages[tile->page];
    size_t filled = 0;
    for (uint32_t i = 0; i < count; ++i) {
        if (!lx_luxel_is_valid(page, s->texels[i])) continue;
        const uint32_t stream = lx_luxel_stream(job->bake, page, s->texels[i]);
        for (uint32_t sample = 0; sample < samples; ++sample) {
            const uint32_t site = (uint32_t)((uint64_t)sample * job->site_count / samples);
            s->starts[filled++] = (lx_path_start){.receiver = s->sites[(size_t)i * lx_site_count + site], .weight = {1, 1, 1},
                                                  .stream = stream, .sample = sample, .target = i};
            if (filled == lx_path_batch_size) {
                if (lx_pool_is_stopping(job->bake->scene->context->pool)) return;
                lx_path_trace(s->batch, &job->settings, s->starts, filled, s->sums, NULL);
                filled = 0;
            }
        }
    }
    lx_path_trace(s->batch, &job->settings, s->starts, filled, s->sums, NULL);
}

static void store_texels(const bake_job *job, const luxel_tile *tile, const tile_scratch *s, uint32_t count)
{
    const lx_bake *bake = job->bake;
    const double scale = 1.0 / bake->desc.samples;
    for (uint32_t layer = 0; layer < bake->layer_count; ++layer) {
        float *image = lx_bake_image(bake, tile->page, layer);
        for (uint32_t i = 0; i < count; ++i) {
            const double *sum = s->sums + 3 * ((size_t)i * bake->layer_count + layer);
            for (int c = 0; c < 3; ++c) image[3 * (size_t)s->texels[i] + (size_t)c] = (float)(sum[c] * scale);
        }
    }
}

static lx_result bake_tile(void *user, size_t task, uint32_t worker, lx_error *error)
{
    (void)error;
    const bake_job *job = user;
    const luxel_tile *tile = &job->tiles[task];
    tile_scratch *s = &job->scratch[worker];
    const uint32_t count = collect_texels(job, tile, s);
    memset(s->sums, 0, sizeof(double) * 3 * count * job->bake->layer_count);
    place_sites(job, tile, s, count);
    trace_texels(job, tile, s, count);
    store_texels(job, tile, s, count);
    return LX_OK;
}

// ---- stages -----------------------------------------------------------------------------------------------------------------

static lx_result rasterise_page(void *user, size_t page, uint32_t worker, lx_error *error)
{
    (void)worker;
    bake_job *job = user;
    return lx_luxels_rasterise(job->bake, (uint32_t)page, &job->pages[page], error);
}

static lx_result settle_tile(void *user, size_t task, uint32_t worker, lx_error *error)
{
    (void)worker;
    bake_job *job = user;
    const luxel_tile *tile = &job->tiles[task];
    return lx_luxels_settle(job->bake, &job->pages[tile->page], tile->x, tile->y, error);
}

static lx_result list_tiles(bake_job *job, lx_error *error)
{
    const lx_bake *bake = job->bake;
    const uint32_t size = bake->atlas->page_size, edge = (size + tile_edge - 1) / tile_edge;
    job->tiles = lx_calloc_array((size_t)edge * edge * bake->atlas->page_count, sizeof *job->tiles);
    if (!job->tiles) return lx_fail_memory(error, "tiles");
    for (uint32_t page = 0; page < bake->atlas->page_count; ++page)
        for (uint32_t y = 0; y < size; y += tile_edge)
            for (uint32_t x = 0; x < size; x += tile_edge) {
                luxel_tile t = {.page = page, .x = x, .y = y};
                t.texel_count = (float)collect_texels(job, &t, &job->scratch[0]);
                if (t.texel_count > 0) job->tiles[job->tile_count++] = t;
            }
    return LX_OK;
}

static lx_result create_scratch(bake_job *job, uint32_t workers, lx_error *error)
{
    job->scratch = lx_calloc_array(workers, sizeof *job->scratch);
    if (!job->scratch) return lx_fail_memory(error, "workers");
    for (uint32_t i = 0; i < workers; ++i) {
        tile_scratch *s = &job->scratch[i];
        s->batch = lx_path_batch_create();
        s->sums = lx_calloc_array((size_t)tile_edge * tile_edge * job->bake->layer_count * 3, sizeof *s->sums);
        s->sites = lx_calloc_array((size_t)tile_edge * tile_edge * lx_site_count, sizeof *s->sites);
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
    lx_free(job->tiles);
}

// Fills padding and invalid texels of one page in all layers.
static lx_result fill_page(void *user, size_t page, uint32_t worker, lx_error *error)
{
    (void)worker;
    bake_job *job = user;
    lx_bake *bake = job->bake;
    const uint32_t size = bake->atlas->page_size;
    const size_t texel_count = (size_t)size * size;
    uint32_t *source = lx_malloc_array(texel_count, sizeof *source);
    uint8_t *valid = lx_malloc_array(texel_count, 1);
    lx_result result = LX_OK;
    if (!source || !valid) {
        result = lx_fail_memory(error, "dilation");
        goto cleanup;
    }
    const uint8_t *coverage = bake->texel_coverage + page * texel_count;
    for (size_t i = 0; i < texel_count; ++i) valid[i] = coverage[i] && lx_luxel_is_valid(&job->pages[page], (uint32_t)i);
    LX_TRY(lx_dilate_map(size, bake->atlas->padding, bake->texel_chart + page * texel_count, valid, source, error));
    for (uint32_t layer = 0; layer < bake->layer_count; ++layer)
        lx_dilate_apply(size, source, lx_bake_image(bake, (uint32_t)page, layer));
cleanup:
    lx_free(source);
    lx_free(valid);
    return result;
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
    const size_t page_texels = (size_t)bake->atlas->page_size * bake->atlas->page_size, total = page_texels * bake->atlas->page_count;
    lx_bake_summary *s = &bake->summary;
    *s = (lx_bake_summary){.page_count = bake->atlas->page_count, .page_size = bake->atlas->page_size,
                           .layer_count = bake->layer_count, .source_count = bake->source_count,
                           .texels_per_m = bake->atlas->texels_per_m, .stages = job->stages};
    for (size_t i = 0; i < total; ++i) {
        s->texel_count += bake->texel_coverage[i] != 0;
        s->invalid_count += bake->texel_coverage[i] && !lx_luxel_is_valid(&job->pages[i / page_texels], (uint32_t)(i % page_texels));
    }
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
    for (size_t i = 0; i < job->tile_count && !job->bake->desc.combined; ++i) {
        const luxel_tile *tile = &job->tiles[i];
        if (tile->page == last_page) continue;
        last_page = tile->page;
        tile_scratch *s = &job->scratch[0];
        const uint32_t texels = collect_texels(job, tile, s), count = texels < points_per_page ? texels : points_per_page;
        for (uint32_t k = 0; k < count; ++k) {
            lx_luxel_sites(job->bake, &job->pages[tile->page], s->texels[k * texels / count], 0, 1, &points[k]);
        }
        lx_layers_check(job->bake, s->batch, points, count);
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
    bake_job job = {.bake = bake, .stages = {.import = bake->scene->import_seconds, .unwrap = atlas->seconds}, .site_count = samples < lx_site_count ? samples : (uint32_t)lx_site_count};
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
    LX_TRY(list_tiles(&job, error));
    weights = lx_malloc_array(job.tile_count, sizeof *weights);
    if (!weights) {
        result = lx_fail_memory(error, "tiles");
        goto cleanup;
    }
    for (size_t i = 0; i < job.tile_count; ++i) weights[i] = job.tiles[i].texel_count;
    LX_TRY(lx_pool_run_weighted(pool, job.tile_count, weights, settle_tile, &job, "luxels", progress, error));
    job.stages.luxels = lap(&stage_start);
    LX_TRY(lx_pool_run_weighted(pool, job.tile_count, weights, bake_tile, &job, "bake", progress, error));
    job.stages.bake = lap(&stage_start);
    LX_TRY(lx_pool_run(pool, atlas->page_count, fill_page, &job, "post", progress, error));
    job.stages.post = lap(&stage_start);
    summarise(&job, workers, start);
    check_sum_of_layers(&job);
    lx_advise_on_layers(bake);
cleanup:
    release_job(&job, workers);
    lx_free(weights);
    return result;
}
