#include "render/seen.h"

#include "base/error.h"
#include "math/sobol.h"
#include "render/view.h"

#include <string.h>

enum {
    batch_rays = 1024,
    most_sheets = 16, // panes behind each other
};

bool lx_lightmap_place(const lx_scene *scene, const lx_atlas *atlas, const lx_hit *hit, uint32_t *out_page, lx_vec2 *out_uv)
{
    const lx_surface *surface = &scene->surfaces[hit->surface];
    const lx_atlas_rect *rect = &atlas->rects[surface->instance];
    const lx_vec2 *uv = atlas->primitives[surface->primitive].corner_uv;
    if (!rect->used || !uv) return false;
    uv += 3 * (size_t)hit->triangle;
    const float w = 1 - hit->u - hit->v;
    out_uv->x = (w * uv[0].x + hit->u * uv[1].x + hit->v * uv[2].x) * rect->scale[0] + rect->offset[0];
    out_uv->y = (w * uv[0].y + hit->u * uv[1].y + hit->v * uv[2].y) * rect->scale[1] + rect->offset[1];
    *out_page = rect->page;
    return true;
}

typedef struct seen_batch {
    lx_ray rays[batch_rays];
    lx_hit hits[batch_rays];
    lx_shading shading[batch_rays];
    struct {
        lx_rgb throughput;
        uint32_t pixel, last_surface, last_triangle;
    } sights[batch_rays];
} seen_batch;

static lx_result note_hit(const lx_baked *baked, const lx_hit *hit, const lx_shading *h, lx_rgb throughput, uint32_t pixel, lx_seen *out,
                          lx_error *error)
{
    const lx_rgb weight = lx_rgb_scale(lx_rgb_mul(throughput, h->albedo), h->opacity / LX_PI);
    uint32_t page;
    lx_vec2 uv;
    if (lx_rgb_is_black(weight) || !lx_lightmap_place(baked->scene, baked->atlas, hit, &page, &uv)) return LX_OK;
    if (!lx_array_reserve(&out->texels, &out->capacity, out->count + 1, sizeof *out->texels)) return lx_fail_memory(error, "picture");
    out->texels[out->count++] = (lx_seen_texel){pixel, page, uv.x, uv.y, weight};
    return LX_OK;
}

// Follows `count` rays through what they can see through. Back faces of single-sided surfaces are not drawn (lx_shading.lit).
static lx_result look(const lx_baked *baked, const lx_tracer *tracer, seen_batch *b, size_t count, lx_seen *out, lx_error *error)
{
    for (uint32_t sheet = 0; count > 0 && sheet < most_sheets; ++sheet) {
        lx_trace_closest(tracer, b->rays, b->hits, count);
        lx_shade_hits(tracer, b->hits, b->shading, count);
        size_t going_on = 0;
        for (size_t i = 0; i < count; ++i) {
            const lx_hit *hit = &b->hits[i];
            if (hit->surface == LX_MISS) continue;
            const bool again = hit->surface == b->sights[i].last_surface && hit->triangle == b->sights[i].last_triangle;
            lx_rgb throughput = b->sights[i].throughput;
            if (b->shading[i].lit && !again) {
                const lx_result result = note_hit(baked, hit, &b->shading[i], throughput, b->sights[i].pixel, out, error);
                if (result != LX_OK) return result;
                throughput = lx_rgb_mul(throughput, b->shading[i].transmittance);
                if (lx_rgb_max(throughput) < 1e-3f) continue;
            }
            lx_ray ray = b->rays[i];
            lx_ray_step_past(&ray, hit);
            b->sights[going_on] = b->sights[i];
            b->sights[going_on].throughput = throughput;
            b->sights[going_on].last_surface = hit->surface;
            b->sights[going_on].last_triangle = hit->triangle;
            b->rays[going_on++] = ray;
        }
        count = going_on;
    }
    return LX_OK;
}

lx_result lx_seen_create(const lx_baked *baked, const lx_render_desc *desc, lx_seen *out, lx_error *error)
{
    lx_result result = LX_OK;
    lx_tracer *tracer = NULL;
    lx_seen seen = {.width = desc->width, .height = desc->height};
    lx_view_rays view;
    lx_transport_desc transport = desc->transport;
    transport.sky = (lx_sky_desc){0};
    seen_batch *batch = lx_malloc_array(1, sizeof *batch);
    if (!batch) return lx_fail_memory(error, "picture");
    LX_TRY(lx_tracer_create(baked->scene, &transport, true, NULL, &tracer, error));
    LX_TRY(lx_view_choose(tracer, desc, &view, error));
    const size_t pixels = (size_t)desc->width * desc->height;
    for (size_t first = 0; first < pixels * desc->samples; first += batch_rays) {
        const size_t left = pixels * desc->samples - first, count = left < batch_rays ? left : batch_rays;
        for (size_t i = 0; i < count; ++i) {
            const uint32_t pixel = (uint32_t)((first + i) / desc->samples), sample = (uint32_t)((first + i) % desc->samples);
            const uint32_t x = pixel % desc->width, y = pixel / desc->width;
            const lx_vec2 u = lx_sobol_pair(sample, lx_stream_key(transport.seed, y, x));
            batch->rays[i] = lx_view_ray(&view, ((float)x + u.x) / (float)desc->width, ((float)y + u.y) / (float)desc->height);
            batch->sights[i].throughput = lx_rgb_grey(1 / (float)desc->samples);
            batch->sights[i].pixel = pixel;
            batch->sights[i].last_surface = LX_MISS;
        }
        LX_TRY(look(baked, tracer, batch, count, &seen, error));
    }
    *out = seen;
    seen = (lx_seen){0};
cleanup:
    lx_seen_release(&seen);
    lx_tracer_destroy(tracer);
    lx_free(batch);
    return result;
}

void lx_seen_release(lx_seen *seen)
{
    lx_free(seen->texels);
    *seen = (lx_seen){0};
}

void lx_seen_light(const lx_seen *seen, const lx_baked *baked, float *out_rgb)
{
    memset(out_rgb, 0, 3 * sizeof *out_rgb * seen->width * seen->height);
    for (size_t i = 0; i < seen->count; ++i) {
        const lx_seen_texel *texel = &seen->texels[i];
        float e[3];
        if (lxrt_lightmap_sample(baked->pack, texel->page, texel->u, texel->v, LXRT_FILTER_BILINEAR, e) != LXRT_OK) continue;
        float *pixel = out_rgb + 3 * (size_t)texel->pixel;
        pixel[0] += texel->weight.r * e[0];
        pixel[1] += texel->weight.g * e[1];
        pixel[2] += texel->weight.b * e[2];
    }
}
