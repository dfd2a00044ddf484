// The bake: luxels, their light by one integrator or the other, padding. Tiles of luxels are the unit of work; what a tile computes depends on
// nothing but its place and the settings, so any number of threads gives the same bits.
#include "bake/bake.h"

#include "bake/advice.h"
#include "bake/animations.h"
#include "bake/bake_job.h"
#include "bake/layers.h"
#include "base/clock.h"
#include "base/error.h"

#include <string.h>

enum { most_samples = 1 << 24 };

lx_transport_desc lx_transport_desc_default(void)
{
    return (lx_transport_desc){.bounces = 8, .sky = {.intensity = 1}, .seed = 1};
}

lx_bake_desc lx_bake_desc_default(void)
{
    lx_bake_desc desc = {.transport = lx_transport_desc_default(), .integrator = LX_INTEGRATOR_GATHER, .samples = 256, .noise = 0.02f, .interpolation = 0.02f,
                         .denoise = LX_DENOISE_BUILTIN, .max_layers = 64};
    desc.transport.bounces = LX_BOUNCES_INF;
    return desc;
}

// Room for all layers of the luxels that `map` knows.
static lx_result create_finished(lx_bake *bake, const lx_luxel_map *map, lx_error *error)
{
    lx_finished_destroy(bake->finished);
    bake->finished = NULL;
    return lx_finished_create(map, bake->layer_count, bake->desc.memory_bytes > 0, bake->desc.scratch_folder, &bake->finished, error);
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
    const lx_luxel_map none = {.page_size = atlas->page_size, .page_count = atlas->page_count};
    LX_TRY(create_finished(bake, &none, error)); // a bake that never ran is black
    bake->created_bytes = lx_resident_memory();
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
    lx_free(bake->texel_chart);
    lx_free(bake->texel_coverage);
    lx_free(bake);
}

void lx_bake_get_summary(const lx_bake *bake, lx_bake_summary *out)
{
    *out = bake->summary;
}

// ---- stages -----------------------------------------------------------------------------------------------------------------

static lx_result rasterise_page(void *user, size_t page, uint32_t worker, lx_error *error)
{
    (void)worker;
    lx_bake_job *job = user;
    return lx_luxels_rasterise(job->bake, (uint32_t)page, &job->pages[page], error);
}

// Where the luxels of a tile are, and whether their light will mean anything.
static lx_result settle_tile(void *user, size_t task, uint32_t worker, lx_error *error)
{
    (void)worker;
    lx_bake_job *job = user;
    const lx_luxel_tile *tile = &job->map.tiles[task];
    lx_luxel_page *page = &job->pages[tile->page];
    const lx_result result = lx_luxels_settle(job->bake, page, tile->x, tile->y, error);
    if (result != LX_OK) return result;
    lx_texel t = {0};
    for (uint32_t i = tile->first; i < tile->first + tile->count; ++i) {
        enum { sites = 4 };
        uint32_t texel;
        lx_job_page(job, i, &texel);
        lx_texel_open(&t, job->bake, page, texel);
        job->map.size_m[i] = lx_texel_size(&t);
        job->map.valid[i] = lx_luxel_is_valid(page, texel);
        if (!job->map.valid[i]) continue;
        lx_receiver r[sites];
        lx_luxel_sites(&t, job->bake, page, texel, 0, sites, r);
        lx_vec3 position = {0, 0, 0}, normal = {0, 0, 0};
        for (int k = 0; k < sites; ++k) {
            position = lx_mad(position, r[k].position, 1.0f / sites);
            normal = lx_add(normal, r[k].normal);
        }
        job->map.position[i] = position;
        job->map.normal[i] = lx_normalize_or(normal, r[0].geometric_normal);
    }
    return LX_OK;
}

static lx_result place_luxels(lx_bake_job *job, lx_error *error)
{
    lx_result result = LX_OK;
    const lx_bake *bake = job->bake;
    const lx_atlas *atlas = bake->atlas;
    lx_pool *pool = bake->scene->context->pool;
    LX_TRY(lx_pool_run(pool, atlas->page_count, rasterise_page, job, "luxels", job->progress, error));
    LX_TRY(lx_bake_map_build(atlas->page_size, atlas->page_count, bake->texel_chart, bake->texel_coverage, &job->map, error));
    LX_TRY(create_finished(job->bake, &job->map.view, error));
    job->tile_weights = lx_malloc_array(job->map.tile_count, sizeof *job->tile_weights);
    if (!job->tile_weights) return lx_fail_memory(error, "tiles");
    for (uint32_t i = 0; i < job->map.tile_count; ++i) job->tile_weights[i] = (float)job->map.tiles[i].count;
    LX_TRY(lx_pool_run_weighted(pool, job->map.tile_count, job->tile_weights, settle_tile, job, "luxels", job->progress, error));
cleanup:
    return result;
}

// Where padding and invalid texels of one page take their light from.
static lx_result fill_page(void *user, size_t page, uint32_t worker, lx_error *error)
{
    (void)worker;
    const lx_bake_job *job = user;
    const lx_bake *bake = job->bake;
    const size_t texel_count = (size_t)bake->atlas->page_size * bake->atlas->page_size;
    return lx_finished_dilate(bake->finished, &job->map.view, (uint32_t)page, bake->atlas->padding, bake->texel_chart + page * texel_count, error);
}

static void summarise(const lx_bake_job *job, double start)
{
    lx_bake *bake = job->bake;
    const lx_luxel_map *map = &job->map.view;
    lx_bake_summary *s = &bake->summary;
    *s = (lx_bake_summary){.page_count = bake->atlas->page_count, .page_size = bake->atlas->page_size,
                           .layer_count = bake->layer_count, .source_count = bake->source_count, .texel_count = map->count,
                           .texels_per_m = bake->atlas->texels_per_m, .stages = job->stages, .ray_count = job->ray_count,
                           .noise = job->noise, .group_count = job->group_count, .predicted_bytes = job->predicted_bytes};
    for (uint32_t i = 0; i < map->count; ++i) s->invalid_count += !map->valid[i];
    const double total = (double)map->page_size * map->page_size * map->page_count;
    s->coverage = total > 0 ? (float)((double)s->texel_count / total) : 0;
    s->path_count = s->texel_count * bake->desc.samples;
    s->seconds = lx_seconds() - start;
}

// A few places of the first tile of each page stand for all.
static lx_result check_sum_of_layers(const lx_bake_job *job, lx_error *error)
{
    enum { points_per_page = 16 };
    lx_receiver points[points_per_page];
    if (job->bake->desc.combined) return LX_OK;
    lx_path_batch *batch = lx_path_batch_create();
    if (!batch) return lx_fail_memory(error, "bake");
    uint32_t last_page = UINT32_MAX;
    for (uint32_t i = 0; i < job->map.tile_count; ++i) {
        const lx_luxel_tile *tile = &job->map.tiles[i];
        if (tile->page == last_page) continue;
        last_page = tile->page;
        const uint32_t wanted = tile->count < points_per_page ? tile->count : points_per_page;
        uint32_t count = 0;
        lx_texel t = {0};
        for (uint32_t k = 0; k < wanted; ++k) {
            const uint32_t luxel = tile->first + k * tile->count / wanted;
            uint32_t texel;
            const lx_luxel_page *page = lx_job_page(job, luxel, &texel);
            if (job->map.valid[luxel]) lx_luxel_sites(&t, job->bake, page, texel, 0, 1, &points[count++]);
        }
        lx_layers_check(job->bake, batch, points, count);
    }
    lx_path_batch_destroy(batch);
    return LX_OK;
}

static void release_job(lx_bake_job *job)
{
    for (uint32_t i = 0; job->pages && i < job->bake->atlas->page_count; ++i) lx_luxels_release(&job->pages[i]);
    lx_free(job->pages);
    lx_bake_map_release(&job->map);
    lx_free(job->tile_weights);
}

lx_result lx_bake_run(lx_bake *bake, const lx_progress_sink *progress, lx_error *error)
{
    lx_result result = LX_OK;
    const double start = lx_seconds();
    double stage_start = start;
    const lx_atlas *atlas = bake->atlas;
    lx_pool *pool = bake->scene->context->pool;
    lx_bake_job job = {.bake = bake, .progress = progress, .stages = {.import = bake->scene->import_seconds, .unwrap = atlas->seconds}};
    job.pages = lx_calloc_array(atlas->page_count, sizeof *job.pages);
    if (!job.pages) return lx_fail_memory(error, "luxels");
    lx_advise_on_scene(bake);
    LX_TRY(place_luxels(&job, error));
    job.stages.luxels = lx_lap(&stage_start);
    LX_TRY(lx_pool_run(pool, atlas->page_count, fill_page, &job, "padding", progress, error));
    job.stages.post = lx_lap(&stage_start);
    if (bake->desc.integrator == LX_INTEGRATOR_PATH)
        LX_TRY(lx_bake_by_paths(&job, error));
    else
        LX_TRY(lx_bake_by_gathering(&job, error));
    job.stages.bake = lx_lap(&stage_start);
    summarise(&job, start);
    LX_TRY(check_sum_of_layers(&job, error));
    LX_TRY(lx_advise_on_layers(bake, error));
cleanup:
    release_job(&job);
    return result;
}
