// The referee: every luxel by paths of its own, tile by tile.
#include "bake/bake_job.h"
#include "bake/texel_sites.h"

#include "base/error.h"

#include <string.h>

enum { tile_luxels = lx_luxel_tile_edge * lx_luxel_tile_edge };

// Working memory of one worker.
typedef struct tile_scratch {
    lx_path_batch *batch;
    double *sums;         // [luxel of the tile][layer][channel]
    lx_texel texel;       // the one seen last
    lx_receiver sites[lx_site_count];
    lx_path_start starts[lx_path_batch_size];
    lx_rgb layer[tile_luxels]; // one layer on its way out
} tile_scratch;

typedef struct path_job {
    const lx_bake_job *job;
    tile_scratch *scratch; // [worker]
    lx_path_settings settings;
} path_job;

// Luxel by luxel, so that the paths of a batch start close together. A site keeps a run of consecutive samples, which is
// a well-spread set in itself.
static void trace_luxels(const path_job *p, const lx_luxel_tile *tile, tile_scratch *s)
{
    const lx_bake *bake = p->job->bake;
    const uint32_t samples = bake->desc.samples, sites = samples < lx_site_count ? samples : lx_site_count;
    size_t filled = 0;
    for (uint32_t i = 0; i < tile->count; ++i) {
        uint32_t texel;
        const lx_luxel_page *page = lx_job_page(p->job, tile->first + i, &texel);
        if (!p->job->map.valid[tile->first + i]) continue;
        lx_luxel_sites(&s->texel, bake, page, texel, 0, sites, s->sites);
        const uint32_t stream = lx_luxel_stream(bake, page, texel);
        for (uint32_t sample = 0; sample < samples; ++sample) {
            const uint32_t site = (uint32_t)((uint64_t)sample * sites / samples);
            s->starts[filled++] = (lx_path_start){.receiver = s->sites[site], .weight = {1, 1, 1}, .stream = stream, .sample = sample, .target = i};
            if (filled == lx_path_batch_size) {
                if (lx_pool_is_stopping(bake->scene->context->pool)) return;
                lx_path_trace(s->batch, &p->settings, s->starts, filled, s->sums, NULL);
                filled = 0;
            }
        }
    }
    lx_path_trace(s->batch, &p->settings, s->starts, filled, s->sums, NULL);
}

static lx_result store_luxels(const path_job *p, const lx_luxel_tile *tile, tile_scratch *s, lx_error *error)
{
    const lx_bake *bake = p->job->bake;
    const double scale = 1.0 / bake->desc.samples;
    for (uint32_t layer = 0; layer < bake->layer_count; ++layer) {
        for (uint32_t i = 0; i < tile->count; ++i) {
            const double *sum = s->sums + 3 * ((size_t)i * bake->layer_count + layer);
            s->layer[i] = (lx_rgb){(float)(sum[0] * scale), (float)(sum[1] * scale), (float)(sum[2] * scale)};
        }
        const lx_result result = lx_finished_write(bake->finished, layer, tile->first, tile->count, s->layer, error);
        if (result != LX_OK) return result;
    }
    return LX_OK;
}

static lx_result bake_tile(void *user, size_t task, uint32_t worker, lx_error *error)
{
    const path_job *p = user;
    const lx_luxel_tile *tile = &p->job->map.tiles[task];
    tile_scratch *s = &p->scratch[worker];
    memset(s->sums, 0, sizeof(double) * 3 * tile->count * p->job->bake->layer_count);
    trace_luxels(p, tile, s);
    return store_luxels(p, tile, s, error);
}

lx_result lx_bake_by_paths(lx_bake_job *job, lx_error *error)
{
    lx_result result = LX_OK;
    const lx_bake *bake = job->bake;
    lx_pool *pool = bake->scene->context->pool;
    const uint32_t workers = lx_pool_worker_count(pool);
    path_job p = {.job = job, .scratch = lx_calloc_array(workers, sizeof *p.scratch)};
    p.settings = (lx_path_settings){.tracer = bake->tracer, .uses = bake->uses, .layer_count = bake->layer_count,
                                    .bounces = bake->desc.direct_only ? 0 : bake->desc.transport.bounces,
                                    .direct = !bake->desc.indirect_only, .indirect = !bake->desc.direct_only};
    if (!p.scratch) return lx_fail_memory(error, "workers");
    for (uint32_t i = 0; i < workers; ++i) {
        p.scratch[i].batch = lx_path_batch_create();
        p.scratch[i].sums = lx_calloc_array((size_t)tile_luxels * 3, bake->layer_count * sizeof(double));
        if (!p.scratch[i].batch || !p.scratch[i].sums) {
            result = lx_fail_memory(error, "workers");
            goto cleanup;
        }
    }
    LX_TRY(lx_pool_run_weighted(pool, job->map.tile_count, job->tile_weights, bake_tile, &p, "bake", job->progress, error));
    job->group_count = 1;
cleanup:
    for (uint32_t i = 0; i < workers; ++i) {
        if (p.scratch[i].batch) job->ray_count += lx_path_batch_rays(p.scratch[i].batch);
        lx_path_batch_destroy(p.scratch[i].batch);
        lx_free(p.scratch[i].sums);
    }
    lx_free(p.scratch);
    return result;
}
