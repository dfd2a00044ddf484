// What happens to one mesh: measuring it in the world, judging the set it brings or cutting it into charts, and writing the
// final coordinates. Each function is a task of the pool and touches its own mesh only.
#include "base/memory.h"
#include "unwrap/unwrap.h"

#include <string.h>

static lx_metric metric_of(const lx_instance *instance)
{
    const float *m = instance->transform.m;
    lx_metric metric;
    for (int row = 0; row < 3; ++row)
        for (int column = 0; column < 3; ++column) metric.m[3 * row + column] = (double)m[4 * column + row];
    return metric;
}

// Scale of a metric that keeps shapes, else 0.
static double uniform_scale(const lx_metric *metric)
{
    const double *m = metric->m;
    double gram[6];
    for (int k = 0, i = 0; i < 3; ++i)
        for (int j = i; j < 3; ++j, ++k) gram[k] = m[i] * m[j] + m[3 + i] * m[3 + j] + m[6 + i] * m[6 + j];
    const double s = (gram[0] + gram[3] + gram[5]) / 3, off = 1e-5 * s;
    const bool same = fabs(gram[0] - s) < off && fabs(gram[3] - s) < off && fabs(gram[5] - s) < off;
    return same && fabs(gram[1]) < off && fabs(gram[2]) < off && fabs(gram[4]) < off ? sqrt(s) : 0;
}

static double lit_area(const lx_unwrap_job *job, const lx_mesh *mesh, const lx_metric *metric)
{
    double area = 0;
    for (uint32_t i = 0; i < mesh->primitive_count; ++i) {
        if (!job->lit[mesh->first_primitive + i]) continue;
        const lx_primitive *primitive = &job->scene->primitives[mesh->first_primitive + i];
        for (uint32_t t = 0; t < primitive->triangle_count; ++t) {
            lx_dvec3 p[3];
            for (uint32_t k = 0; k < 3; ++k) p[k] = lx_metric_apply(metric, primitive->positions[primitive->indices[3 * t + k]]);
            const lx_dvec3 n = lx_dcross(lx_dsub(p[1], p[0]), lx_dsub(p[2], p[0]));
            const double triangle = 0.5 * sqrt(lx_ddot(n, n));
            if (triangle < 1e300) area += triangle;
        }
    }
    return area;
}

static double usable_density(float density)
{
    return density > 0 && density < INFINITY ? fmin(fmax((double)density, 1e-4), 1e4) : 1;
}

// The mesh is measured, cut and projected as its largest instance (density counted in) stands in the world, so that an
// unevenly scaled cube has as many texels per metre on all sides. Other instances get a part of that rectangle's size, by
// the square root of their share of the area.
lx_result lx_measure_mesh(void *user, size_t index, uint32_t worker, lx_error *error)
{
    lx_unwrap_job *job = user;
    lx_mesh_job *mesh = &job->meshes[index];
    const lx_mesh *source = &job->scene->meshes[mesh->mesh];
    const lx_metric identity = {{1, 0, 0, 0, 1, 0, 0, 0, 1}};
    const double local_area = lit_area(job, source, &identity);
    double largest = -1;
    (void)worker;
    (void)error;
    for (uint32_t i = 0; i < mesh->instance_count; ++i) {
        const uint32_t instance_index = job->instances[mesh->first_instance + i];
        const lx_instance *instance = &job->scene->instances[instance_index];
        const lx_metric metric = metric_of(instance);
        const double scale = uniform_scale(&metric), density = usable_density(instance->density);
        const double size = scale > 0 ? scale * sqrt(local_area) : sqrt(lit_area(job, source, &metric));
        job->ratios[instance_index] = (float)(size * density);
        if (!(size * density > largest)) continue;
        largest = size * density;
        mesh->metric = metric;
        mesh->density = density;
    }
    mesh->size = largest;
    for (uint32_t i = 0; i < mesh->instance_count; ++i) {
        float *ratio = &job->ratios[job->instances[mesh->first_instance + i]];
        *ratio = largest > 0 ? (float)((double)*ratio / largest) : 1;
        if (!(*ratio < 0.99f)) *ratio = 1; // rounding in transforms must not make copies differ
    }
    return LX_OK;
}

// ---- Charts ----------------------------------------------------------------------------------------------------------------

// For every triangle without a chart a corner at the same place that has one, LX_NONE if there is none.
static lx_result find_donors(lx_mesh_job *mesh, const lx_patch *patch, uint32_t primitive, const uint32_t *charts,
                             lx_error *error)
{
    uint32_t *corner_at = NULL; // [vertex_count]
    for (uint32_t t = 0; t < patch->triangle_count; ++t) {
        if (charts[t] != LX_NO_CHART) continue;
        if (!corner_at) {
            corner_at = lx_malloc_array(patch->vertex_count, sizeof *corner_at);
            if (!corner_at) return lx_fail_memory(error, "unwrapping a mesh");
            memset(corner_at, 0xff, patch->vertex_count * sizeof *corner_at);
            for (uint32_t i = 3 * patch->triangle_count; i-- > 0;)
                if (charts[i / 3] != LX_NO_CHART) corner_at[patch->corners[i]] = i;
        }
        uint32_t corner = LX_NONE;
        for (uint32_t k = 0; k < 3 && corner == LX_NONE; ++k) corner = corner_at[patch->corners[3 * t + k]];
        if (!lx_array_reserve(&mesh->donors, &mesh->donor_capacity, mesh->donor_count + 1, sizeof *mesh->donors)) {
            lx_free(corner_at);
            return lx_fail_memory(error, "unwrapping a mesh");
        }
        mesh->donors[mesh->donor_count++] = (lx_donor){primitive, t, corner};
    }
    lx_free(corner_at);
    return LX_OK;
}

static lx_result unwrap_primitive(lx_unwrap_job *job, lx_mesh_job *mesh, uint32_t index, lx_error *error)
{
    lx_result result = LX_OK;
    const lx_primitive *primitive = &job->scene->primitives[index];
    lx_atlas_primitive *out = &job->atlas->primitives[index];
    const double density = usable_density(job->scene->materials[primitive->material].density);
    lx_patch patch = {0};
    lx_segmentation segmentation = {0};
    out->corner_uv = lx_calloc_array((size_t)primitive->triangle_count * 3, sizeof *out->corner_uv);
    out->triangle_chart = lx_malloc_array(primitive->triangle_count, sizeof *out->triangle_chart);
    if (!out->corner_uv || !out->triangle_chart) LX_TRY(lx_fail_memory(error, "unwrapping a mesh"));
    LX_TRY(lx_patch_init(&patch, primitive, &mesh->metric, error));
    LX_TRY(lx_segment(&patch, &job->stop, &segmentation, error));
    LX_TRY(lx_split_overlaps(&patch, &job->stop, &segmentation, error));
    LX_TRY(lx_split_long_charts(&patch, job->longest_chart / (mesh->density * density), &segmentation, error));
    LX_TRY(lx_project_charts(&patch, &segmentation, index, density, &mesh->charts, out->corner_uv, out->triangle_chart, error));
    LX_TRY(find_donors(mesh, &patch, index, out->triangle_chart, error));
cleanup:
    lx_patch_release(&patch);
    lx_segmentation_release(&segmentation);
    return result;
}

lx_result lx_unwrap_mesh(void *user, size_t index, uint32_t worker, lx_error *error)
{
    lx_result result = LX_OK;
    lx_unwrap_job *job = user;
    lx_mesh_job *mesh = &job->meshes[index];
    const lx_mesh *source = &job->scene->meshes[mesh->mesh];
    (void)worker;
    if (mesh->existing || mesh->placements) return LX_OK;
    for (uint32_t i = 0; i < source->primitive_count; ++i)
        if (job->lit[source->first_primitive + i]) LX_TRY(unwrap_primitive(job, mesh, source->first_primitive + i, error));
    mesh->placements = lx_calloc_array(mesh->charts.chart_count, sizeof *mesh->placements);
    if (!mesh->placements) LX_TRY(lx_fail_memory(error, "unwrapping a mesh"));
cleanup:
    if (result != LX_OK && result != LX_ERROR_CANCELLED) lx_error_prefix(error, "mesh \"%s\"", source->name);
    return result;
}

// ---- Final coordinates -------------------------------------------------------------------------------------------------------

static float unit(double v)
{
    return v <= 0 ? 0.0f : v >= 1 ? 1.0f : (float)v;
}

static void write_charts(const lx_mesh_job *mesh, const lx_primitive *primitive, lx_atlas_primitive *out)
{
    for (uint32_t t = 0; t < primitive->triangle_count; ++t) {
        const uint32_t c = out->triangle_chart[t];
        if (c == LX_NO_CHART) continue;
        lx_vec2 *uv = &out->corner_uv[3 * (size_t)t];
        lx_dvec2 q[3];
        for (int k = 0; k < 3; ++k) {
            const lx_dvec2 p = lx_placement_apply(&mesh->placements[c], &mesh->charts.charts[c], uv[k]);
            uv[k] = lx_v2(unit(p.x / mesh->width), unit(p.y / mesh->height));
            q[k] = (lx_dvec2){(double)uv[k].x, (double)uv[k].y};
        }
        // Too small for the resolution of floats in the unit square: the triangle keeps its place, but counts no more.
        if (!(lx_dcross2(q[0], q[1], q[2]) > 0)) out->triangle_chart[t] = LX_NO_CHART;
    }
}

static void write_donors(const lx_unwrap_job *job, const lx_mesh_job *mesh)
{
    lx_vec2 anywhere = {0, 0};
    if (mesh->charts.chart_count > 0) {
        const lx_placement *p = &mesh->placements[0];
        const lx_chart *chart = &mesh->charts.charts[0];
        const lx_dvec2 q = lx_placement_apply(p, chart, mesh->charts.segments[chart->first_segment].a);
        anywhere = lx_v2(unit(q.x / mesh->width), unit(q.y / mesh->height));
    }
    for (size_t i = 0; i < mesh->donor_count; ++i) {
        const lx_donor *donor = &mesh->donors[i];
        lx_vec2 *uv = job->atlas->primitives[donor->primitive].corner_uv;
        const lx_vec2 place = donor->corner == LX_NONE ? anywhere : uv[donor->corner];
        for (size_t k = 0; k < 3; ++k) uv[3 * (size_t)donor->triangle + k] = place;
    }
}

// The file's own set: copied per corner, so that those who read the atlas need not care where it came from.
static lx_result write_set(const lx_unwrap_job *job, lx_mesh_job *mesh, lx_error *error)
{
    const lx_mesh *source = &job->scene->meshes[mesh->mesh];
    size_t first = 0;
    for (uint32_t i = 0; i < source->primitive_count; ++i) {
        const uint32_t index = source->first_primitive + i;
        if (!job->lit[index]) continue;
        const size_t count = job->scene->primitives[index].triangle_count;
        lx_atlas_primitive *out = &job->atlas->primitives[index];
        out->corner_uv = lx_malloc_array(count * 3, sizeof *out->corner_uv);
        out->triangle_chart = lx_malloc_array(count, sizeof *out->triangle_chart);
        if (!out->corner_uv || !out->triangle_chart) return lx_fail_memory(error, "the atlas");
        memcpy(out->corner_uv, &mesh->set.uv[3 * first], count * 3 * sizeof *out->corner_uv);
        memcpy(out->triangle_chart, &mesh->set.charts[first], count * sizeof *out->triangle_chart);
        first += count;
    }
    return LX_OK;
}

// The set that will hold new coordinates. Set 1 by convention, or the next one that no material of the mesh samples. glTF
// wants sets without gaps: where a primitive lacks lower ones the exporter adds zeros, and a mesh without any set (and without
// a texture that would ask for one) gets set 0.
static uint32_t free_texcoord(const lx_scene *scene, const lx_mesh *mesh)
{
    bool present[lx_texcoord_sets] = {false}, any = false;
    uint32_t sampled = 0;
    for (uint32_t i = 0; i < mesh->primitive_count; ++i) {
        const lx_primitive *primitive = &scene->primitives[mesh->first_primitive + i];
        sampled |= scene->materials[primitive->material].sampled_texcoords;
        for (uint32_t n = 0; n < lx_texcoord_sets; ++n) any |= present[n] |= primitive->texcoords[n] != NULL;
    }
    if (!any && !sampled) return 0;
    if (!(sampled & 2)) return 1; // a set 1 that is there is bad: replaced
    uint32_t n = 2;
    while (n < lx_texcoord_sets && (present[n] || sampled >> n & 1)) ++n;
    return n;
}

lx_result lx_write_mesh(void *user, size_t index, uint32_t worker, lx_error *error)
{
    lx_unwrap_job *job = user;
    lx_mesh_job *mesh = &job->meshes[index];
    const lx_mesh *source = &job->scene->meshes[mesh->mesh];
    lx_atlas_mesh *out = &job->atlas->meshes[mesh->mesh];
    (void)worker;
    out->existing = mesh->existing;
    if (mesh->existing) {
        out->texcoord = 1;
        out->chart_count = mesh->set.chart_count;
        return write_set(job, mesh, error);
    }
    out->texcoord = free_texcoord(job->scene, source);
    out->chart_count = mesh->charts.chart_count;
    for (uint32_t i = 0; i < source->primitive_count; ++i) {
        const uint32_t p = source->first_primitive + i;
        if (job->lit[p]) write_charts(mesh, &job->scene->primitives[p], &job->atlas->primitives[p]);
    }
    write_donors(job, mesh);
    return LX_OK;
}
