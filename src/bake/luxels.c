// From charts to luxels: which triangles cover which texels, and where in the world a texel's samples stand.
//
// Based on: [Hanika2021] Johannes Hanika, "Hacking the Shadow Terminator", Ray Tracing Gems II, ch. 4 (lifting sites to the smooth surface that
// vertex normals pretend); push-off: a texel that reaches under a wall is moved to the wall's front.
#include "bake/luxels.h"

#include "base/error.h"
#include "math/sobol.h"
#include "trace/sampling.h"

#include <string.h>

enum { max_polygon = 8 }; // a triangle cut by four lines has at most seven corners
static const double least_area = 1e-4; // of a texel's square: thinner slivers would sample one spot of another texel's light

typedef struct point {
    double x, y;
} point;

typedef struct polygon {
    point p[max_polygon];
    int count;
} polygon;

// ---- clipping -------------------------------------------------------------------------------------------------------------

// Keeps the part of the polygon where sign · (coordinate - limit) >= 0 (Sutherland & Hodgman 1974).
static polygon clip(const polygon *in, int axis, double sign, double limit)
{
    polygon out = {.count = 0};
    for (int i = 0; i < in->count; ++i) {
        const point a = in->p[i], b = in->p[(i + 1) % in->count];
        const double da = sign * ((axis ? a.y : a.x) - limit), db = sign * ((axis ? b.y : b.x) - limit);
        if (da >= 0 && out.count < max_polygon) out.p[out.count++] = a;
        if ((da >= 0) != (db >= 0) && out.count < max_polygon) {
            const double t = da / (da - db);
            out.p[out.count++] = (point){a.x + t * (b.x - a.x), a.y + t * (b.y - a.y)};
        }
    }
    return out;
}

static polygon clip_to_texel(const point corner[3], double x, double y)
{
    polygon p = {.p = {corner[0], corner[1], corner[2]}, .count = 3};
    p = clip(&p, 0, 1, x);
    if (p.count) p = clip(&p, 0, -1, x + 1);
    if (p.count) p = clip(&p, 1, 1, y);
    if (p.count) p = clip(&p, 1, -1, y + 1);
    return p;
}

static double cross_of(point a, point b, point c)
{
    return (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
}

static double area_of(const polygon *p)
{
    double sum = 0;
    for (int i = 2; i < p->count; ++i) sum += cross_of(p->p[0], p->p[i - 1], p->p[i]);
    return fabs(sum) * 0.5;
}

// ---- rasterisation -------------------------------------------------------------------------------------------------------

// A triangle's corners in texels of its page.
static bool triangle_on_page(const lx_atlas *atlas, uint32_t instance, uint32_t primitive, uint32_t triangle, point out[3])
{
    const lx_atlas_primitive *p = &atlas->primitives[primitive];
    if (!p->corner_uv || p->triangle_chart[triangle] == LX_NO_CHART) return false;
    const lx_atlas_rect *rect = &atlas->rects[instance];
    const double size = atlas->page_size;
    for (int i = 0; i < 3; ++i) {
        const lx_vec2 uv = p->corner_uv[3 * (size_t)triangle + (size_t)i];
        out[i].x = ((double)uv.x * (double)rect->scale[0] + (double)rect->offset[0]) * size;
        out[i].y = ((double)uv.y * (double)rect->scale[1] + (double)rect->offset[1]) * size;
    }
    return cross_of(out[0], out[1], out[2]) != 0;
}

// First number of each instance's charts on the pages: [instance_count], owned by the caller.
static uint32_t *chart_bases(const lx_atlas *atlas)
{
    const lx_scene *scene = atlas->scene;
    uint32_t *bases = lx_calloc_array(scene->instance_count, sizeof *bases);
    if (!bases) return NULL;
    uint32_t next = 0;
    for (uint32_t i = 0; i < scene->instance_count; ++i) {
        bases[i] = next;
        if (atlas->rects[i].used) next += atlas->meshes[scene->instances[i].mesh].chart_count;
    }
    return bases;
}

typedef struct raw_fragment {
    uint32_t texel, chart;
    lx_fragment fragment;
} raw_fragment;

typedef struct raw_fragments {
    raw_fragment *items;
    size_t count, capacity;
} raw_fragments;

static lx_result cover(raw_fragments *out, uint32_t size, const point corner[3], raw_fragment fragment, lx_error *error)
{
    double low_x = size, low_y = size, high_x = 0, high_y = 0;
    for (int i = 0; i < 3; ++i) {
        low_x = fmin(low_x, corner[i].x);
        low_y = fmin(low_y, corner[i].y);
        high_x = fmax(high_x, corner[i].x);
        high_y = fmax(high_y, corner[i].y);
    }
    const int64_t x0 = low_x > 0 ? (int64_t)low_x : 0, y0 = low_y > 0 ? (int64_t)low_y : 0;
    const int64_t x1 = high_x < size ? (int64_t)high_x : (int64_t)size - 1, y1 = high_y < size ? (int64_t)high_y : (int64_t)size - 1;
    for (int64_t y = y0; y <= y1; ++y)
        for (int64_t x = x0; x <= x1; ++x) {
            const polygon part = clip_to_texel(corner, (double)x, (double)y);
            const double area = part.count >= 3 ? area_of(&part) : 0;
            if (area < least_area) continue;
            if (!lx_array_reserve(&out->items, &out->capacity, out->count + 1, sizeof *out->items))
                return lx_fail_memory(error, "luxels");
            fragment.texel = (uint32_t)((size_t)y * size + (size_t)x);
            fragment.fragment.area = (float)area;
            out->items[out->count++] = fragment;
        }
    return LX_OK;
}

static lx_result cover_page(const lx_bake *bake, uint32_t page, const uint32_t *bases, raw_fragments *out, lx_error *error)
{
    const lx_scene *scene = bake->scene;
    const lx_atlas *atlas = bake->atlas;
    for (uint32_t s = 0; s < scene->surface_count; ++s) {
        const lx_surface *surface = &scene->surfaces[s];
        const lx_atlas_rect *rect = &atlas->rects[surface->instance];
        if (!rect->used || rect->page != page) continue;
        const lx_atlas_primitive *charts = &atlas->primitives[surface->primitive];
        for (uint32_t t = 0; t < scene->primitives[surface->primitive].triangle_count; ++t) {
            point corner[3];
            if (!triangle_on_page(atlas, surface->instance, surface->primitive, t, corner)) continue;
            const raw_fragment f = {.chart = bases[surface->instance] + charts->triangle_chart[t],
                                    .fragment = {.surface = s, .triangle = t}};
            const lx_result result = cover(out, atlas->page_size, corner, f, error);
            if (result != LX_OK) return result;
        }
    }
    return LX_OK;
}

// Of the charts that touch a texel, the one with the largest share; ties go to the lowest number.
static uint32_t owner_of(const raw_fragment *f, const uint32_t *order, size_t count)
{
    uint32_t best = LX_NO_CHART;
    float best_area = 0;
    for (size_t i = 0; i < count; ++i) {
        const uint32_t chart = f[order[i]].chart;
        float area = 0;
        for (size_t k = 0; k < count; ++k) area += f[order[k]].chart == chart ? f[order[k]].fragment.area : 0;
        if (area > best_area || (area == best_area && chart < best)) {
            best = chart;
            best_area = area;
        }
    }
    return best;
}

// Groups raw fragments by texel (counting sort, stable) and drops those of charts that lost their texel.
static lx_result group_by_texel(lx_bake *bake, uint32_t page, const raw_fragments *raw, lx_luxel_page *out, lx_error *error)
{
    const size_t texel_count = (size_t)bake->atlas->page_size * bake->atlas->page_size;
    uint32_t *start = lx_calloc_array(texel_count + 1, sizeof *start);
    uint32_t *order = lx_malloc_array(raw->count, sizeof *order);
    out->first = lx_calloc_array(texel_count + 1, sizeof *out->first);
    out->fragments = lx_malloc_array(raw->count, sizeof *out->fragments);
    lx_result result = LX_OK;
    if (!start || !order || !out->first || !out->fragments) {
        result = lx_fail_memory(error, "luxels");
        goto cleanup;
    }
    for (size_t i = 0; i < raw->count; ++i) ++start[raw->items[i].texel + 1];
    for (size_t i = 0; i < texel_count; ++i) start[i + 1] += start[i];
    for (size_t i = 0; i < raw->count; ++i) order[start[raw->items[i].texel]++] = (uint32_t)i; // start[t] is now the end of t
    uint32_t *charts = bake->texel_chart + page * texel_count;
    uint8_t *coverage = bake->texel_coverage + page * texel_count;
    uint32_t kept = 0;
    for (size_t t = 0, begin = 0; t < texel_count; begin = start[t++]) {
        const uint32_t owner = owner_of(raw->items, order + begin, start[t] - begin);
        float area = 0;
        for (size_t k = begin; k < start[t]; ++k) {
            const raw_fragment *f = &raw->items[order[k]];
            if (f->chart != owner) continue;
            out->fragments[kept++] = f->fragment;
            area += f->fragment.area;
        }
        out->first[t + 1] = kept;
        charts[t] = owner;
        coverage[t] = owner == LX_NO_CHART ? 0 : (uint8_t)lx_clamp(ceilf(area * 255), 1, 255);
    }
cleanup:
    lx_free(start);
    lx_free(order);
    return result;
}

lx_result lx_luxels_rasterise(lx_bake *bake, uint32_t page, lx_luxel_page *out, lx_error *error)
{
    lx_result result = LX_OK;
    raw_fragments raw = {0};
    *out = (lx_luxel_page){0};
    uint32_t *bases = chart_bases(bake->atlas);
    if (!bases) return lx_fail_memory(error, "luxels");
    LX_TRY(cover_page(bake, page, bases, &raw, error));
    if (raw.count > UINT32_MAX) {
        result = lx_fail(error, LX_ERROR_LIMIT, "page %u: too many triangles per texel; use more or larger pages", page);
        goto cleanup;
    }
    LX_TRY(group_by_texel(bake, page, &raw, out, error));
cleanup:
    lx_free(bases);
    lx_free(raw.items);
    if (result != LX_OK) lx_luxels_release(out);
    return result;
}

void lx_luxels_release(lx_luxel_page *page)
{
    lx_free(page->first);
    lx_free(page->fragments);
    *page = (lx_luxel_page){0};
}

// ---- sites ---------------------------------------------------------------------------------------------------------------

// A uniform point of a convex polygon: choose a triangle of its fan by area, then a point of it.
static point point_in(const polygon *p, lx_vec2 u)
{
    const double total = 2 * area_of(p);
    double along = (double)u.x * total;
    for (int i = 2; i < p->count; ++i) {
        const double area = fabs(cross_of(p->p[0], p->p[i - 1], p->p[i]));
        if (along > area && i + 1 < p->count) {
            along -= area;
            continue;
        }
        u.x = area > 0 ? lx_clamp((float)(along / area), 0, 1) : 0;
        const lx_vec2 b = lx_sample_triangle(u);
        const point o = p->p[0], q = p->p[i - 1], r = p->p[i];
        return (point){o.x + (double)b.x * (q.x - o.x) + (double)b.y * (r.x - o.x),
                       o.y + (double)b.x * (q.y - o.y) + (double)b.y * (r.y - o.y)};
    }
    return p->p[0];
}

// [Hanika2021]: the site moves from the flat triangle to the mean of its projections onto the corners' tangent planes, so that a smooth-shaded surface
// does not shadow itself along its facets. Only outwards, and never through anything.
static lx_vec3 lift(const lx_tracer *tracer, const lx_fragment *f, const lx_vec3 corner[3], lx_vec2 b, const lx_receiver *r)
{
    lx_vec3 normal[3];
    if (!lx_triangle_normals(tracer, f->surface, f->triangle, normal)) return r->position;
    const float weight[3] = {1 - b.x - b.y, b.x, b.y};
    lx_vec3 shift = {0, 0, 0};
    for (int i = 0; i < 3; ++i) {
        const float below = lx_min(0, lx_dot(lx_sub(r->position, corner[i]), normal[i]));
        if (lx_dot(normal[i], r->geometric_normal) > 0) shift = lx_mad(shift, normal[i], -below * weight[i]);
    }
    if (!(lx_dot(shift, r->geometric_normal) > 0)) return r->position;
    const lx_ray ray = {.origin = lx_offset_origin(r->position, r->geometric_normal), .direction = shift, .t_max = 1};
    lx_hit hit;
    lx_trace_closest(tracer, &ray, &hit, 1);
    return lx_mad(r->position, shift, hit.surface == LX_MISS ? 1.0f : 0.5f * hit.t);
}

// From a place that is (perhaps) inside solid geometry: a back face nearer than a texel along the surface means that the texel reaches under
// something; the site moves to that face's front.
static void push_off(const lx_tracer *tracer, float texel_m, lx_receiver *r)
{
    enum { direction_count = 8 }; // diagonals reach the inner corner of a room from under it
    lx_vec3 t, b;
    lx_tangent_frame(r->geometric_normal, &t, &b);
    const lx_vec3 direction[direction_count] = {
        t, lx_neg(t), b, lx_neg(b), lx_add(t, b), lx_sub(t, b), lx_sub(b, t), lx_neg(lx_add(t, b))};
    const lx_vec3 origin = lx_offset_origin(r->position, r->geometric_normal);
    lx_ray rays[direction_count];
    lx_hit hits[direction_count];
    for (int i = 0; i < direction_count; ++i) rays[i] = (lx_ray){.origin = origin, .direction = direction[i], .t_max = texel_m};
    lx_trace_closest(tracer, rays, hits, direction_count);
    float nearest = INFINITY;
    for (int i = 0; i < direction_count; ++i) {
        if (hits[i].surface == LX_MISS || lx_surface_is_double_sided(tracer, hits[i].surface)) continue;
        const float distance = hits[i].t * lx_length(direction[i]);
        lx_vec3 position, normal;
        lx_hit_geometry(tracer, &hits[i], &position, &normal);
        if (distance >= nearest || lx_dot(normal, direction[i]) <= 0) continue; // a front face: just a neighbour
        nearest = distance;
        r->position = lx_offset_origin(position, normal);
    }
}

// Metres along a texel's edge on this triangle.
static float texel_size(const lx_vec3 corner[3], const point on_page[3])
{
    const double area = (double)lx_length(lx_cross(lx_sub(corner[1], corner[0]), lx_sub(corner[2], corner[0])));
    return (float)sqrt(area / fabs(cross_of(on_page[0], on_page[1], on_page[2])));
}

static void place_site(const lx_bake *bake, const lx_fragment *f, uint32_t x, uint32_t y, lx_vec2 u, lx_receiver *out)
{
    const lx_surface *surface = &bake->scene->surfaces[f->surface];
    point on_page[3];
    triangle_on_page(bake->atlas, surface->instance, surface->primitive, f->triangle, on_page);
    const polygon part = clip_to_texel(on_page, x, y);
    const point p = point_in(&part, u);
    const double whole = cross_of(on_page[0], on_page[1], on_page[2]);
    const double bu = cross_of(on_page[0], p, on_page[2]) / whole, bv = cross_of(on_page[0], on_page[1], p) / whole;
    const lx_vec2 b = {lx_clamp((float)bu, 0, 1), lx_clamp((float)bv, 0, 1)};
    lx_vec3 corner[3];
    lx_triangle_corners(bake->tracer, f->surface, f->triangle, corner);
    const lx_hit here = {.surface = f->surface, .triangle = f->triangle, .u = b.x, .v = b.y};
    lx_hit_geometry(bake->tracer, &here, &out->position, &out->geometric_normal);
    out->normal = lx_normal_at(bake->tracer, f->surface, f->triangle, b.x, b.y);
    out->position = lift(bake->tracer, f, corner, b, out);
    push_off(bake->tracer, texel_size(corner, on_page), out);
}

void lx_luxel_sites(const lx_bake *bake, const lx_luxel_page *page, uint32_t x, uint32_t y, uint32_t stream,
                    uint32_t count, lx_receiver *out)
{
    const size_t texel = (size_t)y * bake->atlas->page_size + x;
    const lx_fragment *fragments = page->fragments + page->first[texel];
    const uint32_t fragment_count = page->first[texel + 1] - page->first[texel];
    float total = 0;
    for (uint32_t i = 0; i < fragment_count; ++i) total += fragments[i].area;
    for (uint32_t site = 0; site < count; ++site) {
        // Stratified over the fragments' areas, then a low-discrepancy point within the chosen one.
        const lx_vec2 u = lx_sobol_pair(site, lx_hash_combine(stream, 0x51e1u));
        float along = ((float)site + lx_sobol_one(site, lx_hash_combine(stream, 0x51e2u))) / (float)count * total;
        uint32_t chosen = 0;
        while (chosen + 1 < fragment_count && along > fragments[chosen].area) along -= fragments[chosen++].area;
        place_site(bake, &fragments[chosen], x, y, u, &out[site]);
    }
}
