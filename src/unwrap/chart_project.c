// Lays charts into the plane: projection along the chart's normal, turned to the tightest rectangle, scaled to the area of
// the surface. No triangle is turned over, because all of a chart face its normal (see lx_segmentation).
#include "base/memory.h"
#include "unwrap/unwrap.h"

#include <stdlib.h>

enum { hull_directions = 128 }; // edges of the hull that are tried as the rectangle's base: the longest ones

void lx_chart_set_release(lx_chart_set *set)
{
    lx_free(set->charts);
    lx_free(set->segments);
    *set = (lx_chart_set){0};
}

static int compare_points(const void *pa, const void *pb)
{
    const lx_dvec2 *a = pa, *b = pb;
    if (a->x != b->x) return a->x < b->x ? -1 : 1;
    return a->y < b->y ? -1 : a->y > b->y;
}

// Convex hull, counter-clockwise, without collinear points (Andrew's monotone chain). `points` are sorted on the way; `hull`
// has room for count + 1.
static uint32_t convex_hull(lx_dvec2 *points, uint32_t count, lx_dvec2 *hull)
{
    qsort(points, count, sizeof *points, compare_points);
    uint32_t n = 0;
    for (uint32_t i = 0; i < count; ++i) {
        while (n >= 2 && lx_dcross2(hull[n - 2], hull[n - 1], points[i]) <= 0) --n;
        hull[n++] = points[i];
    }
    const uint32_t lower = n + 1;
    for (uint32_t i = count - 1; i-- > 0;) {
        while (n >= lower && lx_dcross2(hull[n - 2], hull[n - 1], points[i]) <= 0) --n;
        hull[n++] = points[i];
    }
    return n > 1 ? n - 1 : n;
}

typedef struct hull_edge { double length2; uint32_t index; } hull_edge;

static int compare_edges(const void *pa, const void *pb)
{
    const hull_edge *a = pa, *b = pb;
    if (a->length2 != b->length2) return a->length2 > b->length2 ? -1 : 1;
    return a->index < b->index ? -1 : a->index > b->index;
}

// Direction of the base of the smallest rectangle around a convex polygon; it lies along one of its edges (Freeman and
// Shapira 1975). Of equal ones the first.
static lx_dvec2 rectangle_direction(const lx_dvec2 *hull, uint32_t count, hull_edge *edges)
{
    lx_dvec2 best = {1, 0};
    double best_area = INFINITY;
    for (uint32_t i = 0; i < count; ++i) {
        const lx_dvec2 a = hull[i], b = hull[i + 1 == count ? 0 : i + 1];
        edges[i] = (hull_edge){(b.x - a.x) * (b.x - a.x) + (b.y - a.y) * (b.y - a.y), i};
    }
    qsort(edges, count, sizeof *edges, compare_edges);
    for (uint32_t e = 0; e < count && e < hull_directions; ++e) {
        const uint32_t i = edges[e].index;
        const lx_dvec2 a = hull[i], b = hull[i + 1 == count ? 0 : i + 1];
        const double length = sqrt(edges[e].length2);
        if (!(length > 0)) break;
        const lx_dvec2 d = {(b.x - a.x) / length, (b.y - a.y) / length};
        double low = INFINITY, high = -INFINITY, far = 0;
        for (uint32_t k = 0; k < count; ++k) {
            const double x = (hull[k].x - a.x) * d.x + (hull[k].y - a.y) * d.y;
            const double y = (hull[k].y - a.y) * d.x - (hull[k].x - a.x) * d.y;
            low = fmin(low, x);
            high = fmax(high, x);
            far = fmax(far, y);
        }
        const double area = (high - low) * far;
        if (area < best_area * (1 - 1e-9)) {
            best_area = area;
            best = d;
        }
    }
    return best;
}

static bool is_border(const lx_patch *patch, const lx_segmentation *segmentation, uint32_t half_edge)
{
    const uint32_t other = patch->neighbors[half_edge];
    return other == LX_NONE || segmentation->chart_of[other] != segmentation->chart_of[half_edge / 3];
}

typedef struct projector {
    const lx_patch *patch;
    const lx_segmentation *segmentation;
    const uint32_t *order; // triangles of the chart
    uint32_t count;
    lx_dvec2 *points;      // [3 * longest]
    lx_dvec2 *border, *hull;
    hull_edge *edges;
} projector;

static lx_result add_chart(projector *p, uint32_t chart, uint32_t primitive, double density, lx_chart_set *set,
                           lx_vec2 *corner_xy, lx_error *error)
{
    const lx_patch *patch = p->patch;
    const lx_dvec3 n = p->segmentation->normals[chart];
    lx_vec3 tx, ty;
    lx_tangent_frame(lx_v3((float)n.x, (float)n.y, (float)n.z), &tx, &ty);
    lx_dvec3 t = {(double)tx.x, (double)tx.y, (double)tx.z};
    t = lx_dnormalize(lx_dmad(t, n, -lx_ddot(t, n)));
    const lx_dvec3 u = lx_dcross(n, t), origin = patch->positions[patch->corners[3 * p->order[0]]];

    uint32_t border = 0;
    double area = 0, flat_area = 0;
    for (uint32_t i = 0; i < p->count; ++i) {
        const uint32_t triangle = p->order[i];
        lx_dvec2 *q = &p->points[3 * (size_t)i];
        for (uint32_t k = 0; k < 3; ++k) {
            const lx_dvec3 d = lx_dsub(patch->positions[patch->corners[3 * triangle + k]], origin);
            q[k] = (lx_dvec2){lx_ddot(d, t), lx_ddot(d, u)};
        }
        for (uint32_t k = 0; k < 3; ++k)
            if (is_border(patch, p->segmentation, 3 * triangle + k)) p->border[border++] = q[k];
        area += patch->areas[triangle];
        flat_area += 0.5 * lx_dcross2(q[0], q[1], q[2]);
    }
    if (!lx_array_reserve(&set->segments, &set->segment_capacity, set->segment_count + border, sizeof *set->segments) ||
        !lx_array_reserve(&set->charts, &set->chart_capacity, (size_t)set->chart_count + 1, sizeof *set->charts))
        return lx_fail_memory(error, "charts");

    // A closed surface that faces one way does not exist, but a cut-off one may be all neighbours of itself: no border then.
    const uint32_t hull_size = border ? convex_hull(p->border, border, p->hull) : 0;
    const lx_dvec2 d = hull_size ? rectangle_direction(p->hull, hull_size, p->edges) : (lx_dvec2){1, 0};
    lx_dvec2 low = {INFINITY, INFINITY}, high = {-INFINITY, -INFINITY};
    for (size_t i = 0; i < 3 * (size_t)p->count; ++i) {
        const lx_dvec2 q = p->points[i], r = {q.x * d.x + q.y * d.y, q.y * d.x - q.x * d.y};
        p->points[i] = r;
        low = (lx_dvec2){fmin(low.x, r.x), fmin(low.y, r.y)};
        high = (lx_dvec2){fmax(high.x, r.x), fmax(high.y, r.y)};
    }
    const double scale = (flat_area > 0 ? sqrt(area / flat_area) : 1) * density;
    for (uint32_t i = 0; i < p->count; ++i)
        for (uint32_t k = 0; k < 3; ++k) {
            const lx_dvec2 q = p->points[3 * (size_t)i + k];
            corner_xy[3 * (size_t)p->order[i] + k] = lx_v2((float)((q.x - low.x) * scale), (float)((q.y - low.y) * scale));
        }
    const size_t first_segment = set->segment_count;
    if (first_segment + border > UINT32_MAX) return lx_fail(error, LX_ERROR_LIMIT, "a mesh has too many chart borders");
    for (uint32_t i = 0; i < p->count; ++i)
        for (uint32_t k = 0; k < 3; ++k) {
            if (!is_border(patch, p->segmentation, 3 * p->order[i] + k)) continue;
            const lx_vec2 *c = &corner_xy[3 * (size_t)p->order[i]];
            set->segments[set->segment_count++] = (lx_segment2){c[k], c[k == 2 ? 0 : k + 1]};
        }
    set->charts[set->chart_count++] = (lx_chart){.primitive = primitive,
                                                 .first_segment = (uint32_t)first_segment,
                                                 .segment_count = border,
                                                 .width = (float)((high.x - low.x) * scale),
                                                 .height = (float)((high.y - low.y) * scale),
                                                 .area = (float)(area * density * density)};
    set->area += area * density * density;
    return LX_OK;
}

lx_result lx_project_charts(const lx_patch *patch, const lx_segmentation *segmentation, uint32_t primitive, double density,
                            lx_chart_set *set, lx_vec2 *corner_xy, uint32_t *triangle_chart, lx_error *error)
{
    lx_result result = LX_OK;
    const uint32_t count = patch->triangle_count, chart_count = segmentation->chart_count, before = set->chart_count;
    uint32_t longest = 0, longest_border = 0;
    projector p = {.patch = patch, .segmentation = segmentation};
    uint32_t *ends = lx_calloc_array((size_t)chart_count + 1, sizeof *ends);
    uint32_t *borders = lx_calloc_array((size_t)chart_count + 1, sizeof *borders);
    uint32_t *order = lx_malloc_array(count, sizeof *order);
    if (!ends || !borders || !order) LX_TRY(lx_fail_memory(error, "charts"));
    for (uint32_t t = 0; t < count; ++t) {
        const uint32_t chart = segmentation->chart_of[t];
        triangle_chart[t] = chart == LX_NO_CHART ? LX_NO_CHART : before + chart;
        if (chart == LX_NO_CHART) continue;
        ++ends[chart];
        for (uint32_t k = 0; k < 3; ++k) borders[chart] += is_border(patch, segmentation, 3 * t + k);
    }
    for (uint32_t c = 0, end = 0; c < chart_count; ++c) {
        if (ends[c] > longest) longest = ends[c];
        if (borders[c] > longest_border) longest_border = borders[c];
        const uint32_t first = end;
        end += ends[c];
        ends[c] = first;
    }
    for (uint32_t t = 0; t < count; ++t)
        if (segmentation->chart_of[t] != LX_NO_CHART) order[ends[segmentation->chart_of[t]]++] = t;
    p.points = lx_malloc_array((size_t)longest * 3, sizeof *p.points);
    p.border = lx_malloc_array(longest_border, sizeof *p.border);
    p.hull = lx_malloc_array((size_t)longest_border + 2, sizeof *p.hull);
    p.edges = lx_malloc_array((size_t)longest_border + 2, sizeof *p.edges);
    if (!p.points || !p.border || !p.hull || !p.edges) LX_TRY(lx_fail_memory(error, "charts"));
    for (uint32_t c = 0; c < chart_count; ++c) {
        const uint32_t first = c == 0 ? 0 : ends[c - 1];
        p.order = &order[first];
        p.count = ends[c] - first;
        LX_TRY(add_chart(&p, c, primitive, density, set, corner_xy, error));
    }
cleanup:
    lx_free(ends);
    lx_free(borders);
    lx_free(order);
    lx_free(p.points);
    lx_free(p.border);
    lx_free(p.hull);
    lx_free(p.edges);
    return result;
}
