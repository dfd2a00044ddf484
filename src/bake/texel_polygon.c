#include "bake/texel_polygon.h"

// Keeps the part of the polygon where sign · (coordinate - limit) >= 0 (Sutherland & Hodgman 1974).
static lx_polygon clip(const lx_polygon *in, int axis, double sign, double limit)
{
    lx_polygon out = {.count = 0};
    for (int i = 0; i < in->count; ++i) {
        const lx_point a = in->p[i], b = in->p[(i + 1) % in->count];
        const double da = sign * ((axis ? a.y : a.x) - limit), db = sign * ((axis ? b.y : b.x) - limit);
        if (da >= 0 && out.count < lx_most_corners) out.p[out.count++] = a;
        if ((da >= 0) != (db >= 0) && out.count < lx_most_corners) {
            const double t = da / (da - db);
            out.p[out.count++] = (lx_point){a.x + t * (b.x - a.x), a.y + t * (b.y - a.y)};
        }
    }
    return out;
}

lx_polygon lx_clip_to_rect(const lx_point corner[3], lx_point low, lx_point high)
{
    lx_polygon p = {.p = {corner[0], corner[1], corner[2]}, .count = 3};
    p = clip(&p, 0, 1, low.x);
    if (p.count) p = clip(&p, 0, -1, high.x);
    if (p.count) p = clip(&p, 1, 1, low.y);
    if (p.count) p = clip(&p, 1, -1, high.y);
    return p;
}

double lx_polygon_area(const lx_polygon *p)
{
    double sum = 0;
    for (int i = 2; i < p->count; ++i) sum += lx_cross_of(p->p[0], p->p[i - 1], p->p[i]);
    return fabs(sum) * 0.5;
}

bool lx_triangle_on_page(const lx_atlas *atlas, uint32_t instance, uint32_t primitive, uint32_t triangle, lx_point out[3])
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
    return lx_cross_of(out[0], out[1], out[2]) != 0;
}
