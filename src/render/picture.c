// Pictures: camera rays in tiles, hits shaded by lightmap look-up or by paths.
//
// Surfaces seen through glass and blended sheets are added up front to back, each by what the sheets before it let through; nothing is left to
// chance there, so panes stay smooth at few samples. Back faces of single-sided surfaces are not drawn, as in any glTF viewer.
#include "render/picture.h"

#include "base/error.h"
#include "math/sobol.h"
#include "render/seen.h"

#include <string.h>

enum {
    tile_edge = 32,
    tile_pixels = tile_edge * tile_edge,
    most_layers = 64, // sheets behind each other that one camera ray looks through
};

typedef struct sight {
    lx_rgb throughput; // what reaches the camera of light from behind the sheets so far
    uint32_t pixel;    // in the tile
    uint32_t stream;   // of the pixel's random numbers
    uint32_t last_surface, last_triangle;
} sight;

typedef struct picture_scratch {
    lx_path_batch *batch;
    lx_ray rays[tile_pixels];
    lx_hit hits[tile_pixels];
    lx_shading shading[tile_pixels];
    sight sights[tile_pixels];
    lx_path_start traced[tile_pixels], mixed[tile_pixels];
    double sums[tile_pixels * 3];
} picture_scratch;

typedef struct picture_job {
    const lx_picture *picture;
    const lx_view_rays *view;
    const lx_render_desc *desc;
    lx_path_settings traced, mixed;
    picture_scratch *scratch;
    float *out;
    uint32_t tiles_across;
} picture_job;

static void add_radiance(picture_scratch *s, uint32_t pixel, lx_rgb value)
{
    s->sums[3 * pixel] += (double)value.r;
    s->sums[3 * pixel + 1] += (double)value.g;
    s->sums[3 * pixel + 2] += (double)value.b;
}

static lx_rgb page_texel(const float *page, uint32_t size, int64_t x, int64_t y)
{
    x = x < 0 ? 0 : x >= size ? size - 1 : x;
    y = y < 0 ? 0 : y >= size ? size - 1 : y;
    const float *p = page + 3 * ((size_t)y * size + (size_t)x);
    return (lx_rgb){p[0], p[1], p[2]};
}

// Irradiance from the lightmap, bilinear. False: the surface has no texels.
static bool lightmap_at(const lx_picture *picture, const lx_hit *hit, lx_rgb *out)
{
    const lx_atlas *atlas = picture->atlas;
    uint32_t page_index;
    lx_vec2 uv;
    if (!atlas || !lx_lightmap_place(lx_tracer_scene(picture->tracer), atlas, hit, &page_index, &uv)) return false;
    const uint32_t size = atlas->page_size;
    const float x = lx_clamp(uv.x, 0, 1) * (float)size - 0.5f, y = lx_clamp(uv.y, 0, 1) * (float)size - 0.5f;
    const float x_floor = floorf(x), y_floor = floorf(y), fx = x - x_floor, fy = y - y_floor;
    const int64_t ix = (int64_t)x_floor, iy = (int64_t)y_floor;
    const float *page = picture->pages[page_index];
    const lx_rgb top = lx_rgb_add(lx_rgb_scale(page_texel(page, size, ix, iy), 1 - fx),
                                  lx_rgb_scale(page_texel(page, size, ix + 1, iy), fx));
    const lx_rgb bottom = lx_rgb_add(lx_rgb_scale(page_texel(page, size, ix, iy + 1), 1 - fx),
                                     lx_rgb_scale(page_texel(page, size, ix + 1, iy + 1), fx));
    *out = lx_rgb_add(lx_rgb_scale(top, 1 - fy), lx_rgb_scale(bottom, fy));
    return true;
}

// Radiance that the surface itself sends out: emission in its source's colour now; realtime emitters as authored.
static lx_rgb shown_emission(const lx_picture *picture, const lx_hit *hit, const lx_shading *s)
{
    const lx_scene *scene = lx_tracer_scene(picture->tracer);
    const lx_surface *surface = &scene->surfaces[hit->surface];
    const lx_material *m = &scene->materials[surface->material];
    if (m->unlit) return s->emission;
    if (surface->source >= 0) {
        const lx_source_use *use = &picture->uses[surface->source];
        const lx_rgb strength = use->cells ? lx_rgb_mul(use->weight, use->cells[lx_tracer_cell_at(picture->tracer, hit->surface, hit->triangle, hit->u, hit->v)])
                                           : use->weight;
        return lx_rgb_mul(s->emission, strength);
    }
    return lx_rgb_mul(s->emission, lx_rgb_scale(m->emissive_factor, m->emissive_strength));
}

static lx_rgb sky_radiance(const lx_picture *picture, lx_vec3 direction)
{
    const uint32_t count = lx_tracer_source_count(picture->tracer);
    if (count == 0 || lx_tracer_source(picture->tracer, count - 1)->kind != LX_SOURCE_SKY) return (lx_rgb){0, 0, 0};
    return lx_rgb_mul(lx_tracer_sky_radiance(picture->tracer, direction), picture->uses[count - 1].weight);
}

static size_t start_sights(const picture_job *job, picture_scratch *s, uint32_t tile_x, uint32_t tile_y, uint32_t sample)
{
    const lx_render_desc *desc = job->desc;
    size_t count = 0;
    for (uint32_t y = tile_y; y < tile_y + tile_edge && y < desc->height; ++y)
        for (uint32_t x = tile_x; x < tile_x + tile_edge && x < desc->width; ++x) {
            const uint32_t stream = lx_stream_key(desc->transport.seed, y, x);
            const lx_vec2 u = lx_sobol_pair(sample, stream);
            s->rays[count] = lx_view_ray(job->view, ((float)x + u.x) / (float)desc->width, ((float)y + u.y) / (float)desc->height);
            s->sights[count++] = (sight){.throughput = {1, 1, 1}, .pixel = (y - tile_y) * tile_edge + (x - tile_x), .stream = stream,
                                         .last_surface = LX_MISS};
        }
    return count;
}

static lx_path_start path_from(const lx_shading *s, lx_rgb weight, uint32_t stream, uint32_t sample, uint32_t pixel)
{
    const float side = s->front ? 1.0f : -1.0f;
    return (lx_path_start){.receiver = {s->position, lx_scale(s->normal, side), lx_scale(s->geometric_normal, side)},
                           .weight = weight, .stream = stream, .sample = sample, .target = pixel};
}

// Adds what one hit sends to the camera, or queues the paths that will find out.
static void shade_hit(const picture_job *job, picture_scratch *s, size_t i, uint32_t stream, uint32_t sample, size_t *traced,
                      size_t *mixed)
{
    const lx_picture *picture = job->picture;
    const lx_shading *h = &s->shading[i];
    const sight *see = &s->sights[i];
    if (job->desc->view == LX_VIEW_ALBEDO) {
        add_radiance(s, see->pixel, lx_rgb_mul(see->throughput, lx_rgb_scale(h->albedo, h->opacity)));
        return;
    }
    // Lightmap view: irradiance over pi, as if every surface were white paint, and no emission.
    const bool lightmap_only = job->desc->view == LX_VIEW_LIGHTMAP;
    if (!lightmap_only) add_radiance(s, see->pixel, lx_rgb_mul(see->throughput, shown_emission(picture, &s->hits[i], h)));
    const lx_rgb albedo = lightmap_only ? lx_rgb_grey(1) : h->albedo;
    const lx_rgb weight = lx_rgb_scale(lx_rgb_mul(see->throughput, albedo), h->opacity / LX_PI);
    if (lx_rgb_is_black(weight)) return;
    lx_rgb irradiance;
    if (!lightmap_at(picture, &s->hits[i], &irradiance)) {
        s->traced[(*traced)++] = path_from(h, weight, stream, sample, see->pixel);
        return;
    }
    add_radiance(s, see->pixel, lx_rgb_mul(weight, irradiance));
    if (picture->mixed_uses) s->mixed[(*mixed)++] = path_from(h, weight, stream, sample, see->pixel);
}

// One camera ray per pixel of the tile, through all sheets to where it ends.
static void trace_sights(const picture_job *job, picture_scratch *s, size_t count, uint32_t sample)
{
    const lx_tracer *tracer = job->picture->tracer;
    for (uint32_t sheet = 0; count > 0 && sheet < most_layers; ++sheet) {
        lx_trace_closest(tracer, s->rays, s->hits, count);
        lx_shade_hits(tracer, s->hits, s->shading, count);
        size_t traced = 0, mixed = 0, going_on = 0;
        for (size_t i = 0; i < count; ++i) {
            sight see = s->sights[i];
            const lx_hit *hit = &s->hits[i];
            if (hit->surface == LX_MISS) {
                if (job->desc->view == LX_VIEW_LIT)
                    add_radiance(s, see.pixel, lx_rgb_mul(see.throughput, sky_radiance(job->picture, s->rays[i].direction)));
                continue;
            }
            const lx_shading *h = &s->shading[i];
            const bool again = hit->surface == see.last_surface && hit->triangle == see.last_triangle;
            if (h->lit && !again) {
                shade_hit(job, s, i, lx_hash_combine(see.stream, sheet + 1), sample, &traced, &mixed);
                see.throughput = lx_rgb_mul(see.throughput, h->transmittance);
                if (lx_rgb_max(see.throughput) < 1e-4f) continue;
            }
            see.last_surface = hit->surface;
            see.last_triangle = hit->triangle;
            lx_ray ray = s->rays[i];
            lx_ray_step_past(&ray, hit);
            s->sights[going_on] = see;
            s->rays[going_on++] = ray;
        }
        lx_path_trace(s->batch, &job->traced, s->traced, traced, s->sums, NULL);
        lx_path_trace(s->batch, &job->mixed, s->mixed, mixed, s->sums, NULL);
        count = going_on;
    }
}

static lx_result render_tile(void *user, size_t task, uint32_t worker, lx_error *error)
{
    (void)error;
    const picture_job *job = user;
    picture_scratch *s = &job->scratch[worker];
    const lx_render_desc *desc = job->desc;
    const uint32_t tile_x = (uint32_t)(task % job->tiles_across) * tile_edge, tile_y = (uint32_t)(task / job->tiles_across) * tile_edge;
    memset(s->sums, 0, sizeof s->sums);
    const lx_pool *pool = lx_tracer_scene(job->picture->tracer)->context->pool;
    for (uint32_t sample = 0; sample < desc->samples && !lx_pool_is_stopping(pool); ++sample) {
        const size_t count = start_sights(job, s, tile_x, tile_y, sample);
        trace_sights(job, s, count, sample);
    }
    for (uint32_t y = tile_y; y < tile_y + tile_edge && y < desc->height; ++y)
        for (uint32_t x = tile_x; x < tile_x + tile_edge && x < desc->width; ++x)
            for (uint32_t c = 0; c < 3; ++c)
                job->out[3 * ((size_t)y * desc->width + x) + c] =
                    (float)(s->sums[3 * ((y - tile_y) * tile_edge + (x - tile_x)) + c] / desc->samples);
    return LX_OK;
}

lx_result lx_picture_render(const lx_picture *picture, const lx_view_rays *view, const lx_render_desc *desc,
                            const lx_progress_sink *progress, float *out_rgb, lx_error *error)
{
    lx_result result = LX_OK;
    lx_pool *pool = lx_tracer_scene(picture->tracer)->context->pool;
    const uint32_t workers = lx_pool_worker_count(pool);
    picture_job job = {.picture = picture, .view = view, .desc = desc, .out = out_rgb};
    job.traced = (lx_path_settings){.tracer = picture->tracer, .uses = picture->uses, .layer_count = 1,
                                    .bounces = desc->transport.bounces, .direct = true, .indirect = true};
    job.mixed = (lx_path_settings){.tracer = picture->tracer, .uses = picture->mixed_uses, .layer_count = 1, .direct = true};
    job.tiles_across = (desc->width + tile_edge - 1) / tile_edge;
    const size_t tiles = (size_t)job.tiles_across * ((desc->height + tile_edge - 1) / tile_edge);
    job.scratch = lx_calloc_array(workers, sizeof *job.scratch);
    if (!job.scratch) return lx_fail_memory(error, "picture");
    for (uint32_t i = 0; i < workers; ++i)
        if (!(job.scratch[i].batch = lx_path_batch_create())) {
            result = lx_fail_memory(error, "picture");
            goto cleanup;
        }
    LX_TRY(lx_pool_run(pool, tiles, render_tile, &job, "render", progress, error));
cleanup:
    for (uint32_t i = 0; i < workers; ++i) lx_path_batch_destroy(job.scratch[i].batch);
    lx_free(job.scratch);
    return result;
}
