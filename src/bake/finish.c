#include "bake/finish.h"

#include "base/error.h"
#include "post/denoise.h"

typedef struct finish_job {
    const lx_bake_job *job;
    const lx_estimate *direct, *indirect;
    uint32_t first_layer, luxel_count;
    lx_denoise_graph *graph; // NULL: no denoising
    struct finish_scratch {
        lx_rgb *direct, *indirect; // [luxel]
        void *denoise;
    } *scratch; // [worker]
} finish_job;

// A step is open if a short ray, held a little above both luxels, meets nothing.
static void can_step(void *user, const lx_luxel_step *steps, size_t count, bool *open)
{
    enum { batch = 256 };
    static const float height = 0.25f; // texels
    const lx_bake_job *job = user;
    const lx_luxel_map *map = &job->map.view;
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
        lx_trace_transmittance(job->bake->tracer, rays, passes, n);
        for (size_t i = 0; i < n; ++i) open[first + i] = !lx_rgb_is_black(passes[i]);
    }
}

static lx_result finish_layer(void *user, size_t task, uint32_t worker, lx_error *error)
{
    const finish_job *f = user;
    struct finish_scratch *s = &f->scratch[worker];
    const lx_estimate *direct = f->direct + task * f->luxel_count, *indirect = f->indirect + task * f->luxel_count;
    if (f->graph) {
        lx_denoise_layer(f->graph, direct, s->denoise, s->direct);
        lx_denoise_layer(f->graph, indirect, s->denoise, s->indirect);
        for (uint32_t i = 0; i < f->luxel_count; ++i) s->direct[i] = lx_rgb_add(s->direct[i], s->indirect[i]);
    } else {
        for (uint32_t i = 0; i < f->luxel_count; ++i) s->direct[i] = lx_rgb_add(direct[i].mean, indirect[i].mean);
    }
    return lx_finished_write(f->job->bake->finished, f->first_layer + (uint32_t)task, 0, f->luxel_count, s->direct, error);
}

lx_result lx_bake_finish_layers(const lx_bake_job *job, const lx_estimate *direct, const lx_estimate *indirect, uint32_t first_layer,
                                uint32_t layer_count, lx_error *error)
{
    lx_result result = LX_OK;
    lx_pool *pool = job->bake->scene->context->pool;
    const uint32_t workers = lx_pool_worker_count(pool);
    finish_job f = {.job = job, .direct = direct, .indirect = indirect, .first_layer = first_layer, .luxel_count = job->map.view.count};
    f.scratch = lx_calloc_array(workers, sizeof *f.scratch);
    if (!f.scratch) return lx_fail_memory(error, "layers");
    const bool denoise = job->bake->desc.denoise == LX_DENOISE_BUILTIN;
    if (denoise) LX_TRY(lx_denoise_graph_create(&job->map.view, can_step, (void *)job, pool, &f.graph, error));
    for (uint32_t i = 0; i < workers; ++i) {
        struct finish_scratch *s = &f.scratch[i];
        s->direct = lx_malloc_array(f.luxel_count, sizeof *s->direct);
        s->indirect = denoise ? lx_malloc_array(f.luxel_count, sizeof *s->indirect) : NULL;
        s->denoise = denoise ? lx_malloc_array(1, lx_denoise_scratch_bytes(f.graph)) : NULL;
        if (!s->direct || (denoise && (!s->indirect || !s->denoise))) {
            result = lx_fail_memory(error, "denoising");
            goto cleanup;
        }
    }
    LX_TRY(lx_pool_run(pool, layer_count, finish_layer, &f, "denoise", job->progress, error));
cleanup:
    for (uint32_t i = 0; i < workers; ++i) {
        lx_free(f.scratch[i].direct);
        lx_free(f.scratch[i].indirect);
        lx_free(f.scratch[i].denoise);
    }
    lx_free(f.scratch);
    lx_denoise_graph_destroy(f.graph);
    return result;
}
