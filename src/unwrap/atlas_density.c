// How many texels a metre gets. Every density that is tried means packing all meshes and all instances anew: what fits is
// found out by doing it, not by estimating areas.
#include "base/context.h"
#include "base/memory.h"
#include "unwrap/unwrap.h"

#include <string.h>

static const double density_step = 1.005; // relative accuracy of the search: 1 % of the texels
static const double usual_share = 0.8;    // of the pages' texels that lx_estimate_texels() comes to when they are full

// Packing one mesh at job->texels_per_m.
static lx_result pack_mesh(void *user, size_t index, uint32_t worker, lx_error *error)
{
    lx_unwrap_job *job = user;
    lx_mesh_job *mesh = &job->meshes[index];
    (void)worker;
    const double texels_per_m = job->texels_per_m * mesh->density;
    if (mesh->existing) {
        const double edge = ceil(texels_per_m * sqrt(mesh->set.area / mesh->set.uv_area));
        mesh->fits = edge < 1e6;
        mesh->width = mesh->height = mesh->fits ? (uint32_t)fmax(edge, 1) : 0;
        return LX_OK;
    }
    mesh->width = mesh->height = 0;
    mesh->fits = true;
    if (mesh->charts.chart_count == 0) return LX_OK;
    return lx_pack_charts(&mesh->charts, texels_per_m, job->desc.padding, job->desc.page_size, job->instance_count == 1,
                          &job->stop, mesh->placements, &mesh->width, &mesh->height, &mesh->fits, error);
}

// Texels of the unit square of an instance: all of them shrink with the instance, but never so far that the padding falls
// below two texels.
static void instance_texels(const lx_unwrap_job *job, const lx_mesh_job *mesh, uint32_t instance, uint32_t out[2])
{
    const double s = fmax((double)job->ratios[instance], 2.0 / job->desc.padding);
    out[0] = (uint32_t)ceil(mesh->width * s);
    out[1] = (uint32_t)ceil(mesh->height * s);
}

// The part of the unit square that goes to the page, in its texels. New charts fill theirs, with padding at the rim. A set of
// the file may use only a part, and may touch the rim.
typedef struct window { int32_t x, y; uint32_t width, height; } window;

static window instance_window(const lx_unwrap_job *job, const lx_mesh_job *mesh, const uint32_t texels[2])
{
    if (!mesh->existing) return (window){0, 0, texels[0], texels[1]};
    const int32_t border = ((int32_t)job->desc.padding + 1) / 2;
    const int32_t x0 = (int32_t)floor((double)mesh->set.low.x * texels[0] + 1e-3) - border;
    const int32_t y0 = (int32_t)floor((double)mesh->set.low.y * texels[1] + 1e-3) - border;
    const int32_t x1 = (int32_t)ceil((double)mesh->set.high.x * texels[0] - 1e-3) + border;
    const int32_t y1 = (int32_t)ceil((double)mesh->set.high.y * texels[1] - 1e-3) + border;
    return (window){x0, y0, (uint32_t)(x1 - x0), (uint32_t)(y1 - y0)};
}

static bool takes_texels(const lx_mesh_job *mesh)
{
    return mesh->existing || mesh->charts.chart_count > 0;
}

// Packs everything at a density. *out_pages above the limit: it does not fit.
static lx_result evaluate(lx_unwrap_job *job, double texels_per_m, uint32_t max_pages, lx_box *boxes, uint32_t *out_pages,
                          lx_error *error)
{
    lx_result result = LX_OK;
    uint32_t count = 0;
    job->texels_per_m = texels_per_m;
    *out_pages = UINT32_MAX;
    LX_TRY(lx_unwrap_run(job, pack_mesh, job->progress_high + (1 - job->progress_high) * 0.2, error));
    for (uint32_t m = 0; m < job->mesh_count; ++m) {
        const lx_mesh_job *mesh = &job->meshes[m];
        if (!mesh->fits) return LX_OK;
        for (uint32_t i = 0; takes_texels(mesh) && i < mesh->instance_count; ++i) {
            uint32_t texels[2];
            instance_texels(job, mesh, job->instances[mesh->first_instance + i], texels);
            const window w = instance_window(job, mesh, texels);
            boxes[count++] = (lx_box){.width = w.width, .height = w.height};
        }
    }
    LX_TRY(lx_pack_pages(boxes, count, job->desc.page_size, max_pages, out_pages, error));
cleanup:
    return result;
}

static double total_area(const lx_unwrap_job *job, double *out_longest)
{
    double total = 0;
    *out_longest = 0;
    for (uint32_t m = 0; m < job->mesh_count; ++m) {
        const lx_mesh_job *mesh = &job->meshes[m];
        const double area = (mesh->existing ? mesh->set.area : mesh->charts.area) * mesh->density * mesh->density;
        for (uint32_t i = 0; i < mesh->instance_count; ++i) {
            const double ratio = (double)job->ratios[job->instances[mesh->first_instance + i]];
            total += area * ratio * ratio;
        }
        if (mesh->existing) *out_longest = fmax(*out_longest, sqrt(mesh->set.area / mesh->set.uv_area) * mesh->density);
        for (uint32_t c = 0; !mesh->existing && c < mesh->charts.chart_count; ++c)
            *out_longest = fmax(*out_longest, (double)fmaxf(mesh->charts.charts[c].width, mesh->charts.charts[c].height) *
                                                  mesh->density);
    }
    return total;
}

// Nothing fits even with a texel per chart: says what would.
static lx_result fail_hopeless(lx_unwrap_job *job, double lowest, lx_box *boxes, lx_error *error)
{
    const uint32_t page_size = job->desc.page_size, max_pages = job->desc.max_pages;
    uint64_t charts = 0;
    uint32_t pages = 0;
    lx_result result = LX_OK;
    for (uint32_t m = 0; m < job->mesh_count; ++m)
        charts += (uint64_t)(job->meshes[m].existing ? job->meshes[m].set.chart_count : job->meshes[m].charts.chart_count) *
                  job->meshes[m].instance_count;
    LX_TRY(evaluate(job, lowest, 256, boxes, &pages, error));
    if (pages <= 256)
        return lx_fail(error, LX_ERROR_LIMIT,
                       "%u instances with %llu charts do not fit %u page%s of %u texels even at the lowest density; %u pages would do",
                       job->instance_count, (unsigned long long)charts, max_pages, max_pages == 1 ? "" : "s", page_size, pages);
    for (uint32_t size = page_size * 2; page_size < 4096; size *= 2) {
        job->desc.page_size = size < 4096 ? size : 4096;
        result = evaluate(job, lowest, 256, boxes, &pages, error);
        size = job->desc.page_size;
        job->desc.page_size = page_size;
        LX_TRY(result);
        if (pages <= 256)
            return lx_fail(error, LX_ERROR_LIMIT,
                           "%u instances with %llu charts do not fit %u page%s of %u texels even at the lowest density; "
                           "%u page%s of %u texels would do",
                           job->instance_count, (unsigned long long)charts, max_pages, max_pages == 1 ? "" : "s", page_size,
                           pages, pages == 1 ? "" : "s", size);
        if (size == 4096) break;
    }
    return lx_fail(error, LX_ERROR_LIMIT, "%u instances with %llu charts do not fit any pages; split the scene or lower the padding",
                   job->instance_count, (unsigned long long)charts);
cleanup:
    return result;
}

static double estimate_texels(const lx_unwrap_job *job, double texels_per_m)
{
    double texels = 0;
    for (uint32_t m = 0; m < job->mesh_count; ++m) {
        const lx_mesh_job *mesh = &job->meshes[m];
        const double own = texels_per_m * mesh->density, edge = own * sqrt(mesh->set.area / fmax(mesh->set.uv_area, 1e-30));
        const double whole = mesh->existing ? edge * edge * (double)(mesh->set.high.x - mesh->set.low.x) *
                                                  (double)(mesh->set.high.y - mesh->set.low.y)
                                            : lx_estimate_texels(&mesh->charts, own, job->desc.padding);
        for (uint32_t i = 0; i < mesh->instance_count; ++i) {
            const double ratio = fmax((double)job->ratios[job->instances[mesh->first_instance + i]], 2.0 / job->desc.padding);
            texels += whole * ratio * ratio;
        }
    }
    return texels;
}

// Where the search begins: the density at which the estimate fills a usual share of the pages.
static double guess_density(const lx_unwrap_job *job, double low, double high, double texels)
{
    for (int i = 0; i < 24 && high > low * 1.01; ++i) {
        const double middle = sqrt(low * high);
        if (estimate_texels(job, middle) < usual_share * texels)
            low = middle;
        else
            high = middle;
    }
    return low;
}

// The largest density that fits, at most `high` (0: no bound), within density_step. On return that density is evaluated.
static lx_result search(lx_unwrap_job *job, double high, lx_box *boxes, double *out, uint32_t *out_pages, lx_error *error)
{
    lx_result result = LX_OK;
    double longest = 0, low = 0, tried = 0, step = 1.06;
    uint32_t pages = 0;
    const uint32_t max_pages = job->desc.max_pages;
    const double texels = (double)job->desc.page_size * job->desc.page_size * max_pages;
    const double full = sqrt(texels / total_area(job, &longest)); // every texel used
    const double lowest = 0.5 / longest;                          // every chart within a texel
    if (!(high > 0)) high = fmax(full, lowest) * 1.001;
    double density = fmin(guess_density(job, lowest, high, texels), high / density_step);
    while (!(low > 0) || high / low > density_step) {
        LX_TRY(evaluate(job, density, max_pages, boxes, &pages, error));
        tried = density;
        if (pages <= max_pages)
            low = density;
        else
            high = density;
        if (low > 0 && high / low <= step) { // bracketed
            density = sqrt(high * low);
        } else if (low > 0) { // upwards, in growing steps
            density = fmin(low * step, sqrt(high * low));
            step *= step;
        } else if (high > lowest) { // downwards
            density = fmax(high / step, lowest);
            step *= step;
        } else {
            return fail_hopeless(job, lowest, boxes, error);
        }
    }
    if (tried != low) LX_TRY(evaluate(job, low, max_pages, boxes, &pages, error));
    *out = low;
    *out_pages = pages;
cleanup:
    return result;
}

// Sets of the file that come too close to themselves at the resolution they get are given up.
static lx_result check_padding(void *user, size_t index, uint32_t worker, lx_error *error)
{
    lx_result result = LX_OK;
    lx_unwrap_job *job = user;
    lx_mesh_job *mesh = &job->meshes[index];
    uint32_t smallest = UINT32_MAX;
    bool apart = true;
    (void)worker;
    if (!mesh->existing || mesh->set.chart_count < 2) return LX_OK;
    for (uint32_t i = 0; i < mesh->instance_count; ++i) {
        uint32_t texels[2];
        instance_texels(job, mesh, job->instances[mesh->first_instance + i], texels);
        if (texels[0] < smallest) smallest = texels[0];
    }
    const lx_uv_set *set = &mesh->set;
    LX_TRY(lx_uv_sets_apart(&set, 1, smallest, &apart, error));
    if (!apart) {
        mesh->existing = false;
        mesh->flaw = "has less than 2 texels between its charts at the resolution it gets";
    }
cleanup:
    return result;
}

static void fill_rects(lx_unwrap_job *job, const lx_box *boxes)
{
    const float page_size = (float)job->desc.page_size;
    for (uint32_t m = 0; m < job->mesh_count; ++m) {
        const lx_mesh_job *mesh = &job->meshes[m];
        for (uint32_t i = 0; takes_texels(mesh) && i < mesh->instance_count; ++i) {
            const uint32_t instance = job->instances[mesh->first_instance + i];
            const lx_box *box = boxes++;
            uint32_t texels[2];
            instance_texels(job, mesh, instance, texels);
            const window w = instance_window(job, mesh, texels);
            job->atlas->rects[instance] =
                (lx_atlas_rect){.used = true, .page = box->page, .x = box->x, .y = box->y, .width = box->width, .height = box->height,
                                .scale = {(float)texels[0] / page_size, (float)texels[1] / page_size},
                                .offset = {(float)((int32_t)box->x - w.x) / page_size, (float)((int32_t)box->y - w.y) / page_size}};
        }
    }
}

// To three digits, so that what a message promises still fits.
static double round_down(double v)
{
    const double unit = pow(10, floor(log10(v)) - 2);
    return floor(v / unit) * unit;
}

lx_result lx_choose_density(lx_unwrap_job *job, lx_error *error)
{
    lx_result result = LX_OK;
    const uint32_t max_pages = job->desc.max_pages, page_size = job->desc.page_size;
    const double asked = (double)job->desc.texels_per_m;
    double density = asked, longest = 0;
    uint32_t pages = 0;
    lx_box *boxes = lx_calloc_array(job->instance_count, sizeof *boxes);
    if (!boxes) LX_TRY(lx_fail_memory(error, "the atlas"));
    if (!(total_area(job, &longest) > 0)) { // only triangles without area
        for (uint32_t m = 0; m < job->mesh_count; ++m) job->meshes[m].width = job->meshes[m].height = 1;
        goto cleanup;
    }
    for (bool settled = false; !settled;) {
        if (asked > 0) {
            LX_TRY(evaluate(job, asked, max_pages, boxes, &pages, error));
            if (pages > max_pages) {
                LX_TRY(search(job, asked, boxes, &density, &pages, error));
                LX_TRY(lx_fail(error, LX_ERROR_LIMIT, "%g texels per metre do not fit %u page%s of %u texels; %.3g texels per metre would fit",
                               asked, max_pages, max_pages == 1 ? "" : "s", page_size, round_down(density)));
            }
        } else {
            LX_TRY(search(job, 0, boxes, &density, &pages, error));
        }
        uint32_t before = 0, after = 0;
        for (uint32_t m = 0; m < job->mesh_count; ++m) before += job->meshes[m].existing;
        if (before > 0) LX_TRY(lx_unwrap_run(job, check_padding, job->progress_high, error));
        for (uint32_t m = 0; m < job->mesh_count; ++m) after += job->meshes[m].existing;
        settled = after == before;
        if (!settled) LX_TRY(lx_unwrap_run(job, lx_unwrap_mesh, job->progress_high, error));
    }
    fill_rects(job, boxes);
    job->atlas->page_count = pages;
    job->atlas->texels_per_m = (float)density;
cleanup:
    lx_free(boxes);
    return result;
}
