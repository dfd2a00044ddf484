#include "bake/finish.h"

#include "bake/interpolation.h"
#include "bake/seams.h"
#include "base/error.h"
#include "post/denoise.h"
#include "post/oidn.h"

#include <string.h>

struct lx_finish {
    const lx_bake_job *job;
    lx_denoise_graph *graph; // NULL: not by our own denoiser
    lx_oidn *oidn;           // NULL: not by the library
    uint32_t *shown;         // [page][page_size²] for the library: the luxel that dilation shows at each texel
    lx_stitch *stitch;
    uint32_t entry_count;    // luxels, then padding texels that stitching writes
};

typedef struct layer_scratch {
    lx_rgb *light, *indirect; // [entry], [luxel]
    void *denoise, *stitch;
} layer_scratch;

typedef struct layers_job {
    const lx_finish *finish;
    const lx_estimate *direct, *indirect;
    const uint8_t *spacing;
    float *share;           // [luxel] of indirect light, as lx_denoise_knots; NULL: nothing is denoised
    uint32_t first_layer;
    layer_scratch *scratch; // [worker]
} layers_job;

// A step is open if a short ray, held a little above both luxels, meets nothing.
static void can_step(void *user, const lx_luxel_step *steps, size_t count, bool *open)
{
    enum { batch = 256 };
    static const float height = 0.25f; // texels
    const lx_finish *f = user;
    const lx_luxel_map *map = &f->job->map.view;
    lx_ray rays[batch];
    lx_rgb passes[batch];
    for (size_t first = 0; first < count; first += batch) {
        const size_t n = count - first < batch ? count - first : (size_t)batch;
        for (size_t i = 0; i < n; ++i) {
            const uint32_t a = steps[first + i].from, b = steps[first + i].to;
            const lx_vec3 from = lx_mad(map->position[a], map->normal[a], height * map->size_m[a]);
            const lx_vec3 to = lx_mad(map->position[b], map->normal[b], height * map->size_m[b]);
            rays[i] = (lx_ray){.origin = from, .direction = lx_sub(to, from), .t_max = 1};
        }
        lx_trace_transmittance(f->job->bake->tracer, rays, passes, n);
        for (size_t i = 0; i < n; ++i) open[first + i] = !lx_rgb_is_black(passes[i]);
    }
}

static lx_result open_denoiser(lx_finish *f, lx_error *error)
{
    const lx_bake_job *job = f->job;
    const lx_luxel_map *map = &job->map.view;
    lx_pool *pool = job->bake->scene->context->pool;
    if (job->bake->desc.denoise == LX_DENOISE_BUILTIN) return lx_denoise_graph_create(map, can_step, f, pool, &f->graph, error);
    if (job->bake->desc.denoise == LX_DENOISE_NONE) return LX_OK;
    const size_t texels = (size_t)map->page_size * map->page_size * map->page_count;
    f->shown = lx_malloc_array(texels, sizeof *f->shown);
    if (!f->shown) return lx_fail_memory(error, "denoising");
    memcpy(f->shown, lx_finished_entries(job->bake->finished), texels * sizeof *f->shown);
    return lx_oidn_open(NULL, lx_pool_worker_count(pool), &f->oidn, error);
}

static lx_result open_stitch(lx_finish *f, lx_error *error)
{
    lx_bake *bake = f->job->bake;
    lx_seam *seams = NULL;
    size_t count = 0;
    lx_result result = LX_OK;
    LX_TRY(lx_seams_find(bake, &seams, &count, error));
    LX_TRY(lx_stitch_create(&f->job->map.view, lx_finished_entries(bake->finished), bake->texel_chart, seams, count, &f->stitch, error));
    LX_TRY(lx_finished_extend(bake->finished, lx_stitch_texels(f->stitch), lx_stitch_texel_count(f->stitch), error));
    f->entry_count = lx_finished_count(bake->finished);
cleanup:
    lx_free(seams);
    return result;
}

lx_result lx_finish_open(const lx_bake_job *job, lx_finish **out_finish, lx_error *error)
{
    lx_result result = LX_OK;
    lx_finish *f = lx_calloc_array(1, sizeof *f);
    if (!f) return lx_fail_memory(error, "layers");
    f->job = job;
    LX_TRY(open_denoiser(f, error));
    LX_TRY(open_stitch(f, error));
    *out_finish = f;
    f = NULL;
cleanup:
    lx_finish_close(f);
    return result;
}

void lx_finish_close(lx_finish *f)
{
    if (!f) return;
    lx_denoise_graph_destroy(f->graph);
    lx_oidn_close(f->oidn);
    lx_free(f->shown);
    lx_stitch_destroy(f->stitch);
    lx_free(f);
}

uint64_t lx_finish_worker_bytes(const lx_finish *f)
{
    const lx_luxel_map *map = &f->job->map.view;
    uint64_t bytes = f->entry_count * sizeof(lx_rgb) + lx_stitch_scratch_bytes(f->stitch);
    if (f->graph) bytes += map->count * sizeof(lx_rgb) + lx_denoise_scratch_bytes(f->graph);
    if (f->oidn) bytes += (uint64_t)map->page_size * map->page_size * 2 * sizeof(lx_rgb); // a page on its way in and out
    return bytes;
}

// ---- interpolated light -----------------------------------------------------------------------------------------------------

static void visit_interpolated(const layers_job *j, bool coarse_first, void (*visit)(void *to, uint32_t luxel, const lx_knots *knots), void *to)
{
    const lx_bake_map *map = &j->finish->job->map;
    for (uint32_t t = 0; t < map->tile_count; ++t) lx_visit_interpolated(&map->view, &map->tiles[t], j->spacing, coarse_first, visit, to);
}

static void hand_on_share(void *to, uint32_t luxel, const lx_knots *knots)
{
    float *share = to;
    for (uint32_t k = 0; k < knots->count; ++k) share[knots->luxel[k]] += knots->weight[k] * share[luxel];
    share[luxel] = 0;
}

static void find_shares(layers_job *j)
{
    for (uint32_t i = 0; i < j->finish->job->map.view.count; ++i) j->share[i] = 1;
    visit_interpolated(j, false, hand_on_share, j->share); // luxels of fine grids may have knots that are interpolated themselves
}

static void interpolate_luxel(void *to, uint32_t luxel, const lx_knots *knots)
{
    lx_rgb *light = to, sum = {0, 0, 0};
    for (uint32_t k = 0; k < knots->count; ++k) sum = lx_rgb_add(sum, lx_rgb_scale(light[knots->luxel[k]], knots->weight[k]));
    light[luxel] = sum;
}

static void interpolate(void *user, lx_rgb *light) { visit_interpolated(user, true, interpolate_luxel, light); }

// ---- layers -----------------------------------------------------------------------------------------------------------------

static lx_result finish_layer(void *user, size_t task, uint32_t worker, lx_error *error)
{
    layers_job *j = user;
    const lx_finish *f = j->finish;
    const layer_scratch *s = &j->scratch[worker];
    const lx_luxel_map *map = &f->job->map.view;
    const lx_estimate *direct = j->direct + task * map->count, *indirect = j->indirect + task * map->count;
    if (f->graph) {
        const lx_denoise_knots knots = {.share = j->share, .interpolate = interpolate, .user = j};
        lx_denoise_layer(f->graph, lx_light_direct, direct, NULL, s->denoise, s->light);
        lx_denoise_layer(f->graph, lx_light_indirect, indirect, &knots, s->denoise, s->indirect);
        for (uint32_t i = 0; i < map->count; ++i) s->light[i] = lx_rgb_add(s->light[i], s->indirect[i]);
    } else {
        for (uint32_t i = 0; i < map->count; ++i) s->light[i] = lx_rgb_add(direct[i].mean, indirect[i].mean);
    }
    if (f->oidn) {
        const lx_result result = lx_oidn_denoise(f->oidn, map, f->shown, s->light, error);
        if (result != LX_OK) return result;
    }
    lx_stitch_apply(f->stitch, s->light, s->stitch);
    return lx_finished_write(f->job->bake->finished, j->first_layer + (uint32_t)task, 0, f->entry_count, s->light, error);
}

lx_result lx_finish_layers(lx_finish *f, const lx_estimate *direct, const lx_estimate *indirect, const uint8_t *spacing, uint32_t first_layer,
                           uint32_t layer_count, lx_error *error)
{
    lx_result result = LX_OK;
    lx_pool *pool = f->job->bake->scene->context->pool;
    const uint32_t workers = lx_pool_worker_count(pool), luxels = f->job->map.view.count;
    layers_job j = {.finish = f, .direct = direct, .indirect = indirect, .spacing = spacing, .first_layer = first_layer};
    j.scratch = lx_calloc_array(workers, sizeof *j.scratch);
    if (!j.scratch) return lx_fail_memory(error, "layers");
    if (f->graph) {
        j.share = lx_malloc_array(luxels, sizeof *j.share);
        if (!j.share) {
            result = lx_fail_memory(error, "denoising");
            goto cleanup;
        }
        find_shares(&j);
    }
    for (uint32_t i = 0; i < workers; ++i) {
        layer_scratch *s = &j.scratch[i];
        s->light = lx_malloc_array(f->entry_count, sizeof *s->light);
        s->indirect = f->graph ? lx_malloc_array(luxels, sizeof *s->indirect) : NULL;
        s->denoise = f->graph ? lx_malloc_array(1, lx_denoise_scratch_bytes(f->graph)) : NULL;
        s->stitch = lx_malloc_array(1, lx_stitch_scratch_bytes(f->stitch));
        if (!s->light || !s->stitch || (f->graph && (!s->indirect || !s->denoise))) {
            result = lx_fail_memory(error, "denoising");
            goto cleanup;
        }
    }
    LX_TRY(lx_pool_run(pool, layer_count, finish_layer, &j, "denoise", f->job->progress, error));
cleanup:
    for (uint32_t i = 0; i < workers; ++i) {
        void *arrays[] = {j.scratch[i].light, j.scratch[i].indirect, j.scratch[i].denoise, j.scratch[i].stitch};
        for (size_t k = 0; k < sizeof arrays / sizeof *arrays; ++k) lx_free(arrays[k]);
    }
    lx_free(j.scratch);
    lx_free(j.share);
    return result;
}
