// Placing sites: a point of the texel's square, its triangle, its place in the world.
//
// Based on: [Hanika2021] Johannes Hanika, "Hacking the Shadow Terminator", Ray Tracing Gems II, ch. 4 (lifting sites to the smooth surface that
// vertex normals pretend).
#include "bake/texel_sites.h"

#include "math/sobol.h"
#include "trace/sampling.h"

#include <string.h>

uint32_t lx_luxel_stream(const lx_bake *bake, const lx_luxel_page *page, uint32_t texel)
{
    return lx_stream_key(bake->desc.transport.seed, page->number, texel);
}

void lx_texel_open(lx_texel *t, const lx_bake *bake, const lx_luxel_page *page, uint32_t texel)
{
    const uint32_t size = bake->atlas->page_size;
    t->bake = bake;
    t->fragments = page->fragments + page->first[texel];
    t->fragment_count = page->first[texel + 1] - page->first[texel];
    t->x = texel % size;
    t->y = texel / size;
    t->stream = lx_luxel_stream(bake, page, texel);
    t->area = 0;
    for (uint32_t i = 0; i < t->fragment_count; ++i) t->area += t->fragments[i].area;
    for (uint32_t i = 0; i < lx_piece_slots; ++i) {
        t->pieces[i].fragment = UINT32_MAX;
        t->pieces[i].clipped = false;
    }
}

static bool are_equal(const lx_vec3 v[3])
{
    return memcmp(&v[0], &v[1], sizeof v[0]) == 0 && memcmp(&v[0], &v[2], sizeof v[0]) == 0;
}

static void make_piece(const lx_bake *bake, const lx_fragment *f, lx_piece *piece)
{
    const lx_tracer *tracer = bake->tracer;
    const lx_surface *surface = &bake->scene->surfaces[f->surface];
    *piece = (lx_piece){.known = true, .surface = f->surface, .triangle = f->triangle};
    lx_triangle_on_page(bake->atlas, surface->instance, surface->primitive, f->triangle, piece->corner);
    piece->whole = lx_cross_of(piece->corner[0], piece->corner[1], piece->corner[2]);
    lx_triangle_corners(tracer, f->surface, f->triangle, piece->world);
    piece->normal = lx_triangle_normal(tracer, f->surface, piece->world);
    piece->smooth = lx_triangle_normals(tracer, f->surface, f->triangle, piece->vertex_normal);
    piece->shading_normal = piece->normal;
    if (piece->smooth && are_equal(piece->vertex_normal)) { // as exporters write faces with hard edges
        piece->smooth = false;
        if (lx_dot(piece->vertex_normal[0], piece->normal) > 0) piece->shading_normal = piece->vertex_normal[0];
    }
    const lx_vec3 cross = lx_cross(lx_sub(piece->world[1], piece->world[0]), lx_sub(piece->world[2], piece->world[0]));
    piece->texel_m = (float)sqrt((double)lx_length(cross) / fabs(piece->whole));
}

const lx_piece *lx_texel_piece(lx_texel *t, uint32_t fragment)
{
    lx_piece *piece = &t->pieces[fragment % lx_piece_slots];
    if (piece->fragment == fragment) return piece;
    const lx_fragment *f = &t->fragments[fragment];
    lx_piece *last = t->pieces; // the triangle's, when it was a part of another texel
    while (last < t->pieces + lx_piece_slots && !(last->known && last->triangle == f->triangle && last->surface == f->surface)) ++last;
    if (last == t->pieces + lx_piece_slots) {
        make_piece(t->bake, f, piece);
    } else if (last != piece) {
        const lx_piece other = *piece;
        *piece = *last;
        *last = other;
    }
    piece->fragment = fragment;
    return piece;
}

// Barycentrics of the second and third corner. The point may lie a rounding, or a sliver too thin for a fragment, outside.
static lx_vec2 barycentrics(const lx_piece *piece, lx_point p)
{
    const double u = lx_cross_of(piece->corner[0], p, piece->corner[2]) / piece->whole;
    const double v = lx_cross_of(piece->corner[0], piece->corner[1], p) / piece->whole;
    return (lx_vec2){(float)u, (float)v};
}

static lx_vec2 onto_triangle(lx_vec2 b)
{
    b = (lx_vec2){lx_clamp(b.x, 0, 1), lx_clamp(b.y, 0, 1)};
    const float sum = b.x + b.y;
    return sum > 1 ? (lx_vec2){b.x / sum, b.y / sum} : b;
}

static lx_vec3 blend(const lx_piece *piece, lx_vec2 b)
{
    return lx_add(lx_add(lx_scale(piece->world[0], 1 - b.x - b.y), lx_scale(piece->world[1], b.x)), lx_scale(piece->world[2], b.y));
}

const lx_polygon *lx_texel_part(lx_texel *t, const lx_piece *piece)
{
    lx_piece *own = &t->pieces[piece->fragment % lx_piece_slots];
    if (!own->clipped) own->part = lx_clip_to_texel(own->corner, t->x, t->y);
    own->clipped = true;
    return &own->part;
}

lx_vec3 lx_piece_point(const lx_piece *piece, lx_point on_page)
{
    return blend(piece, onto_triangle(barycentrics(piece, on_page)));
}

// A uniform point of a convex polygon: choose a triangle of its fan by area, then a point of it.
static lx_point point_in(const lx_polygon *p, lx_vec2 u)
{
    const double total = 2 * lx_polygon_area(p);
    double along = (double)u.x * total;
    for (int i = 2; i < p->count; ++i) {
        const double area = fabs(lx_cross_of(p->p[0], p->p[i - 1], p->p[i]));
        if (along > area && i + 1 < p->count) {
            along -= area;
            continue;
        }
        u.x = area > 0 ? lx_clamp((float)(along / area), 0, 1) : 0;
        const lx_vec2 b = lx_sample_triangle(u);
        const lx_point o = p->p[0], q = p->p[i - 1], r = p->p[i];
        return (lx_point){o.x + (double)b.x * (q.x - o.x) + (double)b.y * (r.x - o.x),
                          o.y + (double)b.x * (q.y - o.y) + (double)b.y * (r.y - o.y)};
    }
    return p->p[0];
}

// A texel that is covered all over takes the point as it is and asks which triangle it lies on: that keeps the points' spread. Of others the
// fragments are lined up by area.
static const lx_piece *choose(lx_texel *t, lx_vec2 u, lx_vec2 *out_b)
{
    const lx_piece *best = NULL;
    *out_b = (lx_vec2){0, 0};
    if (t->area > 0.9995f && t->fragment_count <= lx_piece_slots) {
        const lx_point p = {t->x + (double)u.x, t->y + (double)u.y};
        float best_inside = -INFINITY;
        for (uint32_t i = 0; i < t->fragment_count && best_inside < 0; ++i) {
            const lx_piece *piece = lx_texel_piece(t, i);
            const lx_vec2 b = barycentrics(piece, p);
            const float inside = lx_min(lx_min(b.x, b.y), 1 - b.x - b.y);
            if (inside <= best_inside) continue;
            best = piece;
            best_inside = inside;
            *out_b = b;
        }
    } else {
        uint32_t chosen = 0;
        float along = u.x * t->area;
        while (chosen + 1 < t->fragment_count && along > t->fragments[chosen].area) along -= t->fragments[chosen++].area;
        best = lx_texel_piece(t, chosen);
        u.x = lx_clamp(along / t->fragments[chosen].area, 0, 1);
        *out_b = barycentrics(best, point_in(lx_texel_part(t, best), u));
    }
    *out_b = onto_triangle(*out_b);
    return best;
}

// [Hanika2021]: the site moves from the flat triangle to the mean of its projections onto the corners' tangent planes, so that a smooth-shaded surface
// does not shadow itself along its facets. Only outwards, and never through anything.
static lx_vec3 lift(const lx_tracer *tracer, const lx_piece *piece, lx_vec2 b, lx_vec3 position)
{
    const float weight[3] = {1 - b.x - b.y, b.x, b.y};
    lx_vec3 shift = {0, 0, 0};
    for (int i = 0; i < 3; ++i) {
        const lx_vec3 n = piece->vertex_normal[i];
        const float below = lx_min(0, lx_dot(lx_sub(position, piece->world[i]), n));
        if (lx_dot(n, piece->normal) > 0) shift = lx_mad(shift, n, -below * weight[i]);
    }
    if (!(lx_dot(shift, piece->normal) > 0)) return position;
    const lx_ray ray = {.origin = lx_offset_origin(position, piece->normal), .direction = shift, .t_max = 1};
    lx_hit hit;
    lx_trace_closest(tracer, &ray, &hit, 1);
    return lx_mad(position, shift, hit.surface == LX_MISS ? 1.0f : 0.5f * hit.t);
}

// As hits have it, from vertex normals that are at hand; one that points behind the triangle can't tell which way is up.
static lx_vec3 smooth_normal(const lx_piece *piece, lx_vec2 b)
{
    const lx_vec3 sum = lx_add(lx_add(lx_scale(piece->vertex_normal[0], 1 - b.x - b.y), lx_scale(piece->vertex_normal[1], b.x)), lx_scale(piece->vertex_normal[2], b.y));
    const lx_vec3 n = lx_normalize_or(sum, piece->normal);
    return lx_dot(n, piece->normal) > 0 ? n : piece->normal;
}

// Where site `number` falls, on the flat triangle.
static const lx_piece *place_site(lx_texel *t, uint32_t number, lx_receiver *out, lx_vec2 *out_b)
{
    const lx_vec2 u = lx_sobol_pair(number, lx_hash_combine(t->stream, 0x51e1u));
    const lx_piece *piece = choose(t, u, out_b);
    out->position = blend(piece, *out_b);
    out->geometric_normal = piece->normal;
    out->normal = piece->smooth ? smooth_normal(piece, *out_b) : piece->shading_normal;
    return piece;
}

const lx_piece *lx_texel_site(lx_texel *t, uint32_t number, lx_receiver *out)
{
    lx_vec2 b;
    const lx_piece *piece = place_site(t, number, out, &b);
    if (piece->smooth) out->position = lift(t->bake->tracer, piece, b, out->position);
    return piece;
}

// NULL: all sites are where they fall, or there are none.
static const lx_settled *settled_of(const lx_bake *bake, const lx_luxel_page *page, uint32_t texel)
{
    const uint32_t state = page->state[texel], size = bake->atlas->page_size, edge = (size + lx_site_block - 1) / lx_site_block;
    if (state >= LX_SITES_INVALID) return NULL;
    return &page->settled[texel / size / lx_site_block * edge + texel % size / lx_site_block][state];
}

bool lx_luxel_is_whole(const lx_bake *bake, const lx_luxel_page *page, uint32_t texel)
{
    const lx_settled *settled = settled_of(bake, page, texel);
    return !settled || !settled->split;
}

void lx_luxel_sites(lx_texel *t, const lx_bake *bake, const lx_luxel_page *page, uint32_t texel, uint32_t first, uint32_t count, lx_receiver *out)
{
    lx_texel_open(t, bake, page, texel);
    const lx_settled *settled = settled_of(bake, page, texel);
    for (uint32_t i = first; i < first + count; ++i, ++out) {
        lx_vec2 b;
        if (!settled) {
            lx_texel_site(t, i, out);
            continue;
        }
        place_site(t, settled->number[i], out, &b);
        out->position = settled->position[i];
    }
}

float lx_texel_size(lx_texel *t)
{
    return t->fragment_count > 0 ? lx_texel_piece(t, 0)->texel_m : 0;
}

lx_vec2 lx_piece_barycentrics(const lx_piece *piece, lx_vec3 place)
{
    const lx_vec3 e1 = lx_sub(piece->world[1], piece->world[0]), e2 = lx_sub(piece->world[2], piece->world[0]);
    const lx_vec3 d = lx_sub(place, piece->world[0]), n = lx_cross(e1, e2);
    const float square = lx_dot(n, n);
    if (!(square > 0)) return (lx_vec2){0, 0};
    const float u = lx_clamp(lx_dot(lx_cross(d, e2), n) / square, 0, 1);
    return (lx_vec2){u, lx_clamp(lx_dot(lx_cross(e1, d), n) / square, 0, 1 - u)};
}
