// Path-traced irradiance at free points: the referee in the hand.
//
// A task traces a block of samples of one point, or all samples of several points; blocks are added in order, so the result
// does not depend on the number of threads.
#include "bake/layers.h"

#include "base/error.h"

#include <string.h>

enum { block_samples = 1 << 14, block_paths = 1 << 13 };

typedef struct irradiance_job {
    const lx_pool *pool;
    const float *positions, *normals;
    lx_path_settings settings;
    uint32_t samples, seed;
    uint32_t blocks_per_point; // > 1: points_per_task is 1
    size_t points_per_task, point_count;
    double *sums;              // [point * blocks_per_point + block][3]
    struct scratch {
        lx_path_batch *batch;
        lx_path_start starts[lx_path_batch_size];
    } *scratch;
} irradiance_job;

static lx_receiver receiver_at(const irradiance_job *job, size_t point)
{
    const float *p = job->positions + 3 * point, *n = job->normals + 3 * point;
    const lx_vec3 normal = lx_normalize((lx_vec3){n[0], n[1], n[2]});
    return (lx_receiver){.position = {p[0], p[1], p[2]}, .normal = normal, .geometric_normal = normal};
}

static void trace_block(const irradiance_job *job, struct scratch *s, size_t point, uint32_t first, uint32_t end, double *sum)
{
    const lx_receiver receiver = receiver_at(job, point);
    const uint32_t stream = lx_stream_key(job->seed, (uint32_t)(point >> 32) ^ 0x70696e74u, (uint32_t)point);
    for (uint32_t sample = first; sample < end;) {
        if (lx_pool_is_stopping(job->pool)) return;
        size_t count = 0;
        for (; count < lx_path_batch_size && sample < end; ++sample)
            s->starts[count++] = (lx_path_start){.receiver = receiver, .weight = {1, 1, 1}, .stream = stream,
                                                 .sample = sample};
        lx_path_trace(s->batch, &job->settings, s->starts, count, sum, NULL);
    }
}

static lx_result trace_task(void *user, size_t task, uint32_t worker, lx_error *error)
{
    (void)error;
    const irradiance_job *job = user;
    struct scratch *s = &job->scratch[worker];
    if (job->blocks_per_point > 1) {
        const size_t point = task / job->blocks_per_point;
        const uint32_t first = (uint32_t)(task % job->blocks_per_point) * block_samples;
        const uint32_t end = job->samples - first < block_samples ? job->samples : first + block_samples;
        trace_block(job, s, point, first, end, job->sums + 3 * task);
        return LX_OK;
    }
    const size_t begin = task * job->points_per_task;
    for (size_t point = begin; point < begin + job->points_per_task && point < job->point_count; ++point)
        trace_block(job, s, point, 0, job->samples, job->sums + 3 * point);
    return LX_OK;
}

static lx_result check_points(const float *positions, const float *normals, size_t count, lx_error *error)
{
    for (size_t i = 0; i < count; ++i) {
        float length = 0;
        for (size_t c = 0; c < 3; ++c) {
            length = fmaxf(length, fabsf(normals[3 * i + c]));
            if (!isfinite(positions[3 * i + c]) || !isfinite(normals[3 * i + c]))
                return lx_fail(error, LX_ERROR_FORMAT, "point %zu: a coordinate is not finite", i);
        }
        if (length == 0) return lx_fail(error, LX_ERROR_FORMAT, "point %zu: its normal is zero", i);
    }
    return LX_OK;
}

lx_result lx_irradiance(const lx_scene *scene, const lx_transport_desc *transport, uint32_t samples, const float *positions,
                        const float *normals, size_t count, const lx_progress_sink *progress, float *out_rgb, lx_error *error)
{
    if (samples < 1 || samples > 1u << 24)
        return lx_fail(error, LX_ERROR_INVALID_ARGUMENT, "samples must be 1 to %u, not %u", 1u << 24, samples);
    lx_result result = check_points(positions, normals, count, error);
    if (result != LX_OK) return result;
    lx_tracer *tracer = NULL;
    lx_source_use *uses = NULL;
    const uint32_t workers = lx_pool_worker_count(scene->context->pool);
    irradiance_job job = {.pool = scene->context->pool, .positions = positions, .normals = normals, .samples = samples, .seed = transport->seed,
                          .point_count = count};
    job.blocks_per_point = (samples + block_samples - 1) / block_samples;
    job.points_per_task = samples < block_paths ? block_paths / samples : 1;
    LX_TRY(lx_tracer_create(scene, transport, false, NULL, &tracer, error));
    uses = lx_uses_combined(tracer);
    job.sums = lx_calloc_array(count * job.blocks_per_point, 3 * sizeof *job.sums);
    job.scratch = lx_calloc_array(workers, sizeof *job.scratch);
    if (!uses || !job.sums || !job.scratch) {
        result = lx_fail_memory(error, "irradiance");
        goto cleanup;
    }
    for (uint32_t i = 0; i < workers; ++i)
        if (!(job.scratch[i].batch = lx_path_batch_create())) {
            result = lx_fail_memory(error, "irradiance");
            goto cleanup;
        }
    job.settings = (lx_path_settings){.tracer = tracer, .uses = uses, .layer_count = 1, .bounces = transport->bounces,
                                      .direct = true, .indirect = true};
    const size_t tasks = job.blocks_per_point > 1 ? count * job.blocks_per_point
                                                  : (count + job.points_per_task - 1) / job.points_per_task;
    LX_TRY(lx_pool_run(scene->context->pool, tasks, trace_task, &job, "irradiance", progress, error));
    for (size_t i = 0; i < count; ++i)
        for (size_t c = 0; c < 3; ++c) {
            double sum = 0;
            for (uint32_t block = 0; block < job.blocks_per_point; ++block)
                sum += job.sums[3 * (i * job.blocks_per_point + block) + c];
            out_rgb[3 * i + c] = (float)(sum / samples);
        }
cleanup:
    for (uint32_t i = 0; job.scratch && i < workers; ++i) lx_path_batch_destroy(job.scratch[i].batch);
    lx_free(job.scratch);
    lx_free(job.sums);
    lx_free(uses);
    lx_tracer_destroy(tracer);
    return result;
}
