// Building the atlas: which meshes take light, which of them bring coordinates that serve, charts for the others, packing.
#include "base/clock.h"
#include "base/context.h"
#include "base/memory.h"
#include "unwrap/unwrap.h"

#include <string.h>

lx_atlas_desc lx_atlas_desc_default(void)
{
    return (lx_atlas_desc){.page_size = 1024, .max_pages = 1, .texels_per_m = 0, .padding = 4, .force_unwrap = false};
}

void lx_atlas_destroy(lx_atlas *atlas)
{
    if (!atlas) return;
    for (uint32_t i = 0; atlas->primitives && i < atlas->scene->primitive_count; ++i) {
        lx_free(atlas->primitives[i].corner_uv);
        lx_free(atlas->primitives[i].triangle_chart);
    }
    lx_free(atlas->primitives);
    lx_free(atlas->meshes);
    lx_free(atlas->rects);
    lx_free(atlas);
}

static lx_result check_desc(const lx_atlas_desc *desc, lx_error *error)
{
    if (desc->page_size < 16 || desc->page_size > 4096 || desc->page_size % 4 != 0)
        return lx_fail(error, LX_ERROR_INVALID_ARGUMENT, "page size %u: must be a multiple of 4 from 16 to 4096", desc->page_size);
    if (desc->max_pages < 1 || desc->max_pages > 256)
        return lx_fail(error, LX_ERROR_INVALID_ARGUMENT, "%u pages: must be 1 to 256", desc->max_pages);
    if (desc->padding < 2 || desc->padding > 32)
        return lx_fail(error, LX_ERROR_INVALID_ARGUMENT, "padding of %u texels: must be 2 to 32", desc->padding);
    if (!(desc->texels_per_m >= 0) || !(desc->texels_per_m < 1e9f))
        return lx_fail(error, LX_ERROR_INVALID_ARGUMENT, "%g texels per metre: must be positive, or 0 for what fits",
                       (double)desc->texels_per_m);
    return LX_OK;
}

// ---- Progress: several runs of the pool are one stage. -----------------------------------------------------------------------

static bool report(void *user, const lx_progress *progress)
{
    lx_unwrap_job *job = user;
    if (atomic_load(&job->stop)) return false; // said once is enough
    if (!job->sink || !job->sink->func) return true;
    const lx_progress whole = {.stage = "unwrap",
                               .fraction = job->progress_low + (job->progress_high - job->progress_low) * progress->fraction,
                               .seconds = lx_seconds() - job->started};
    const bool go_on = job->sink->func(job->sink->user, &whole);
    if (!go_on) atomic_store(&job->stop, true);
    return go_on;
}

lx_result lx_unwrap_run(lx_unwrap_job *job, lx_task task, double to, lx_error *error)
{
    lx_result result = LX_OK;
    const lx_progress_sink sink = {report, job};
    float *weights = lx_malloc_array(job->mesh_count, sizeof *weights);
    if (!weights) LX_TRY(lx_fail_memory(error, "the atlas"));
    for (uint32_t m = 0; m < job->mesh_count; ++m) weights[m] = (float)job->meshes[m].triangle_count;
    job->progress_low = job->progress_high;
    job->progress_high = to;
    LX_TRY(lx_pool_run_weighted(job->scene->context->pool, job->mesh_count, weights, task, job, "unwrap", &sink, error));
    if (atomic_load(&job->stop)) LX_TRY(lx_fail(error, LX_ERROR_CANCELLED, "cancelled")); // after the last task
cleanup:
    lx_free(weights);
    return result;
}

// ---- Who takes light -------------------------------------------------------------------------------------------------------

static bool takes_light(const lx_scene *scene, uint32_t primitive)
{
    const lx_primitive *p = &scene->primitives[primitive];
    return p->triangle_count > 0 && !scene->materials[p->material].unlit;
}

// Lists static instances by mesh, for meshes with something to light.
static lx_result list_meshes(lx_unwrap_job *job, lx_error *error)
{
    const lx_scene *scene = job->scene;
    uint32_t *job_of = lx_malloc_array(scene->mesh_count, sizeof *job_of);
    job->lit = lx_calloc_array(scene->primitive_count, sizeof *job->lit);
    job->meshes = lx_calloc_array(scene->mesh_count, sizeof *job->meshes);
    job->instances = lx_malloc_array(scene->instance_count, sizeof *job->instances);
    job->ratios = lx_calloc_array(scene->instance_count, sizeof *job->ratios);
    if (!job_of || !job->lit || !job->meshes || !job->instances || !job->ratios) {
        lx_free(job_of);
        return lx_fail_memory(error, "the atlas");
    }
    for (uint32_t m = 0; m < scene->mesh_count; ++m) job_of[m] = LX_NONE;
    for (uint32_t i = 0; i < scene->instance_count; ++i)
        if (scene->instances[i].is_static) job_of[scene->instances[i].mesh] = 0;
    for (uint32_t m = 0; m < scene->mesh_count; ++m) {
        const lx_mesh *mesh = &scene->meshes[m];
        if (job_of[m] == LX_NONE) continue;
        lx_mesh_job *out = &job->meshes[job->mesh_count];
        out->mesh = m;
        for (uint32_t p = mesh->first_primitive; p < mesh->first_primitive + mesh->primitive_count; ++p) {
            if (!takes_light(scene, p)) continue;
            job->lit[p] = true;
            out->triangle_count += scene->primitives[p].triangle_count;
            out->has_set |= scene->primitives[p].texcoords[1] != NULL;
        }
        job_of[m] = out->triangle_count > 0 ? job->mesh_count++ : LX_NONE;
    }
    for (uint32_t i = 0; i < scene->instance_count; ++i) {
        const lx_instance *instance = &scene->instances[i];
        if (instance->is_static && job_of[instance->mesh] != LX_NONE) ++job->meshes[job_of[instance->mesh]].instance_count;
    }
    for (uint32_t m = 0; m < job->mesh_count; ++m) {
        job->meshes[m].first_instance = job->instance_count;
        job->instance_count += job->meshes[m].instance_count;
        job->meshes[m].instance_count = 0;
    }
    for (uint32_t i = 0; i < scene->instance_count; ++i) {
        const lx_instance *instance = &scene->instances[i];
        if (!instance->is_static || job_of[instance->mesh] == LX_NONE) continue;
        lx_mesh_job *mesh = &job->meshes[job_of[instance->mesh]];
        job->instances[mesh->first_instance + mesh->instance_count++] = i;
    }
    lx_free(job_of);
    return LX_OK;
}

// ---- Sets that the file brings ---------------------------------------------------------------------------------------------

static lx_result read_set(void *user, size_t index, uint32_t worker, lx_error *error)
{
    lx_unwrap_job *job = user;
    lx_mesh_job *mesh = &job->meshes[index];
    (void)worker;
    if (!mesh->has_set) return LX_OK;
    const lx_result result =
        lx_uv_set_init(&mesh->set, job->scene, &job->scene->meshes[mesh->mesh], job->lit, &mesh->metric, error);
    mesh->flaw = mesh->set.flaw;
    return result;
}

static lx_result judge_set(void *user, size_t index, uint32_t worker, lx_error *error)
{
    lx_result result = LX_OK;
    lx_unwrap_job *job = user;
    lx_mesh_job *mesh = &job->meshes[index];
    bool overlap = false;
    (void)worker;
    if (!mesh->has_set || mesh->flaw) return LX_OK;
    const lx_uv_set *set = &mesh->set;
    LX_TRY(lx_uv_sets_overlap(&set, 1, &overlap, error));
    if (overlap)
        mesh->flaw = "overlaps itself";
    else
        mesh->existing = true;
cleanup:
    return result;
}

// One atlas for everything, made by whoever made the file: no mesh twice, every set good, and all of them together too.
static lx_result find_scene_atlas(lx_unwrap_job *job, bool *out_found, const char **out_flaw, lx_error *error)
{
    lx_result result = LX_OK;
    bool overlap = false, apart = false;
    const lx_uv_set **sets = lx_malloc_array(job->mesh_count, sizeof *sets);
    *out_found = false;
    *out_flaw = NULL;
    if (!sets) LX_TRY(lx_fail_memory(error, "the atlas"));
    for (uint32_t m = 0; m < job->mesh_count; ++m) {
        const lx_mesh_job *mesh = &job->meshes[m];
        if (mesh->instance_count != 1 || !mesh->has_set || mesh->flaw) goto cleanup;
        sets[m] = &mesh->set;
    }
    LX_TRY(lx_uv_sets_overlap(sets, job->mesh_count, &overlap, error));
    if (overlap) goto cleanup;
    LX_TRY(lx_uv_sets_apart(sets, job->mesh_count, job->desc.page_size, &apart, error));
    if (apart)
        *out_found = true;
    else
        *out_flaw = "has less than 2 texels between its charts";
cleanup:
    lx_free(sets);
    return result;
}

// Texels per metre that the file's own atlas gives.
static float scene_atlas_density(const lx_unwrap_job *job)
{
    double area = 0, uv_area = 0;
    for (uint32_t m = 0; m < job->mesh_count; ++m) {
        area += job->meshes[m].set.area;
        uv_area += job->meshes[m].set.uv_area;
    }
    return (float)((double)job->desc.page_size * sqrt(uv_area / area));
}

static void keep_scene_atlas(lx_unwrap_job *job)
{
    lx_atlas *atlas = job->atlas;
    atlas->scene_atlas = true;
    atlas->page_count = 1;
    for (uint32_t m = 0; m < job->mesh_count; ++m) {
        lx_mesh_job *mesh = &job->meshes[m];
        mesh->existing = true;
        atlas->rects[job->instances[mesh->first_instance]] = (lx_atlas_rect){
            .used = true, .width = atlas->page_size, .height = atlas->page_size, .scale = {1, 1}, .offset = {0, 0}};
    }
    atlas->texels_per_m = scene_atlas_density(job);
}

// A chart longer than a page would keep the density of the whole scene down. At the density that would use three quarters of
// the texels it has to fit; so does a square or a disk that has the page to itself. A lower density that was asked for allows
// longer ones; a higher one will not fit anyway.
static double longest_chart(const lx_unwrap_job *job)
{
    const double page = (double)job->desc.page_size, border = (job->desc.padding + 1) / 2;
    double area = 0;
    for (uint32_t m = 0; m < job->mesh_count; ++m)
        for (uint32_t i = 0; i < job->meshes[m].instance_count; ++i) {
            const double size = job->meshes[m].size * (double)job->ratios[job->instances[job->meshes[m].first_instance + i]];
            area += size * size;
        }
    const double longest = 1.15 * sqrt(area / job->desc.max_pages);
    return job->desc.texels_per_m > 0 ? fmax(longest, (page - 2 * border - 1) / (double)job->desc.texels_per_m) : longest;
}

static void warn_of_flaws(const lx_unwrap_job *job)
{
    for (uint32_t m = 0; m < job->mesh_count; ++m) {
        const lx_mesh_job *mesh = &job->meshes[m];
        if (!mesh->has_set || mesh->existing || !mesh->flaw) continue;
        lx_log_warning(job->scene->context->log, "mesh \"%s\": its TEXCOORD_1 %s; unwrapped anew",
                       job->scene->meshes[mesh->mesh].name, mesh->flaw);
    }
}

static lx_result build(lx_unwrap_job *job, lx_error *error)
{
    lx_result result = LX_OK;
    bool found = false;
    const char *flaw = NULL;
    LX_TRY(list_meshes(job, error));
    if (job->mesh_count == 0) {
        lx_log_warning(job->scene->context->log, "nothing in the scene takes light: no static mesh with a lit material");
        goto cleanup;
    }
    LX_TRY(lx_unwrap_run(job, lx_measure_mesh, 0.05, error));
    job->longest_chart = longest_chart(job);
    if (!job->desc.force_unwrap) {
        LX_TRY(lx_unwrap_run(job, read_set, 0.1, error));
        LX_TRY(find_scene_atlas(job, &found, &flaw, error));
        if (!found) LX_TRY(lx_unwrap_run(job, judge_set, 0.15, error));
    }
    if (found) {
        keep_scene_atlas(job);
    } else {
        LX_TRY(lx_unwrap_run(job, lx_unwrap_mesh, 0.5, error));
        result = lx_choose_density(job, error);
        // Rather light that bleeds a little between charts than hardly a texel for each: the page is too small for anything better.
        const bool too_small = result == LX_ERROR_LIMIT ||
                               (result == LX_OK && job->atlas->texels_per_m < 0.5f * scene_atlas_density(job));
        if (too_small && flaw && job->desc.texels_per_m == 0) {
            lx_log_warning(job->scene->context->log, "the file's TEXCOORD_1 atlas %s at %u texels, and nothing better fits; it is used as it is",
                           flaw, job->desc.page_size);
            keep_scene_atlas(job);
            result = LX_OK;
        } else if (result == LX_OK) {
            if (flaw)
                lx_log_warning(job->scene->context->log, "the file's TEXCOORD_1 atlas %s at %u texels; its meshes are packed anew",
                               flaw, job->desc.page_size);
            warn_of_flaws(job);
        }
        if (result != LX_OK) goto cleanup;
    }
    LX_TRY(lx_unwrap_run(job, lx_write_mesh, 1, error));
cleanup:
    return result;
}

lx_result lx_atlas_build(const lx_scene *scene, const lx_atlas_desc *desc, const lx_progress_sink *progress,
                         lx_atlas **out_atlas, lx_error *error)
{
    lx_result result = LX_OK;
    const lx_atlas_desc defaults = lx_atlas_desc_default();
    lx_unwrap_job job = {.scene = scene, .desc = desc ? *desc : defaults, .sink = progress, .started = lx_seconds()};
    atomic_init(&job.stop, false);
    LX_TRY(check_desc(&job.desc, error));
    job.atlas = lx_calloc_array(1, sizeof *job.atlas);
    if (!job.atlas) LX_TRY(lx_fail_memory(error, "the atlas"));
    job.atlas->scene = scene;
    job.atlas->page_size = job.desc.page_size;
    job.atlas->padding = job.desc.padding;
    job.atlas->primitives = lx_calloc_array(scene->primitive_count, sizeof *job.atlas->primitives);
    job.atlas->meshes = lx_calloc_array(scene->mesh_count, sizeof *job.atlas->meshes);
    job.atlas->rects = lx_calloc_array(scene->instance_count, sizeof *job.atlas->rects);
    if (!job.atlas->primitives || !job.atlas->meshes || !job.atlas->rects) LX_TRY(lx_fail_memory(error, "the atlas"));
    LX_TRY(build(&job, error));
    job.atlas->seconds = lx_seconds() - job.started;
    *out_atlas = job.atlas;
    job.atlas = NULL;
cleanup:
    for (uint32_t m = 0; m < job.mesh_count; ++m) {
        lx_uv_set_release(&job.meshes[m].set);
        lx_chart_set_release(&job.meshes[m].charts);
        lx_free(job.meshes[m].donors);
        lx_free(job.meshes[m].placements);
    }
    lx_free(job.lit);
    lx_free(job.meshes);
    lx_free(job.instances);
    lx_free(job.ratios);
    lx_atlas_destroy(job.atlas);
    return result;
}
