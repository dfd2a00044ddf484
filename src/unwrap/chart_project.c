// Lays charts into the plane: projection along the chart's normal, turned to the tightest rectangle, scaled to the area of
// the surface. No triangle is turned over, because all of a chart face its normal (see lx_segmentation).
#include "base/memory.h"
#include "unwrap/unwrap.h"

#include <stdlib.h>

enum {
    hull_directions = 128, // edges of the hull that are tried as the rectangle's base: the longest ones
    split_passes = 6,      // a chart is cut into 64 pieces at most
};

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
    uint32_t *order;       // triangles, those of a chart in one run
    uint32_t *ends;        // [chart_count] of the runs
    const uint32_t *run;   // the chart at hand
    uint32_t count;
    lx_dvec2 *points;      // [3 * count] its corners, turned into its rectangle, which begins at `low`
    lx_dvec2 low, high;
    double scale;          // from the plane to the area of the surface
    double area;
    uint32_t border_count;
    lx_dvec2 *border, *hull;
    hull_edge *edges;
} projector;

static void projector_release(projector *p)
{
    lx_free(p->order);
    lx_free(p->ends);
    lx_free(p->points);
    lx_free(p->border);
    lx_free(p->hull);
    lx_free(p->edges);
}

static lx_result projector_init(projector *p, const lx_patch *patch, const lx_segmentation *segmentation, lx_error *error)
{
    lx_result result = LX_OK;
    const uint32_t count = patch->triangle_count, chart_count = segmentation->chart_count;
    uint32_t longest = 0, longest_border = 0;
    uint32_t *borders = lx_calloc_array((size_t)chart_count + 1, sizeof *borders);
    *p = (projector){.patch = patch, .segmentation = segmentation};
    p->ends = lx_calloc_array((size_t)chart_count + 1, sizeof *p->ends);
    p->order = lx_malloc_array(count, sizeof *p->order);
    if (!p->ends || !borders || !p->order) LX_TRY(lx_fail_memory(error, "charts"));
    for (uint32_t t = 0; t < count; ++t) {
        const uint32_t chart = segmentation->chart_of[t];
        if (chart == LX_NO_CHART) continue;
        ++p->ends[chart];
        for (uint32_t k = 0; k < 3; ++k) borders[chart] += is_border(patch, segmentation, 3 * t + k);
    }
    for (uint32_t c = 0, end = 0; c < chart_count; ++c) {
        if (p->ends[c] > longest) longest = p->ends[c];
        if (borders[c] > longest_border) longest_border = borders[c];
        const uint32_t first = end;
        end += p->ends[c];
        p->ends[c] = first;
    }
    for (uint32_t t = 0; t < count; ++t)
        if (segmentation->chart_of[t] != LX_NO_CHART) p->order[p->ends[segmentation->chart_of[t]]++] = t;
    p->points = lx_malloc_array((size_t)longest * 3, sizeof *p->points);
    p->border = lx_malloc_array(longest_border, sizeof *p->border);
    p->hull = lx_malloc_array((size_t)longest_border + 2, sizeof *p->hull);
    p->edges = lx_malloc_array((size_t)longest_border + 2, sizeof *p->edges);
    if (!p->points || !p->border || !p->hull || !p->edges) LX_TRY(lx_fail_memory(error, "charts"));
cleanup:
    lx_free(borders);
    if (result != LX_OK) projector_release(p);
    return result;
}

// Lays one chart into its rectangle.
static void project(projector *p, uint32_t chart)
{
    const lx_patch *patch = p->patch;
    const uint32_t first = chart == 0 ? 0 : p->ends[chart - 1];
    p->run = &p->order[first];
    p->count = p->ends[chart] - first;
    p->border_count = 0;
    p->area = 0;

    const lx_dvec3 n = p->segmentation->normals[chart];
    lx_vec3 tx, ty;
    lx_tangent_frame(lx_v3((float)n.x, (float)n.y, (float)n.z), &tx, &ty);
    lx_dvec3 t = {(double)tx.x, (double)tx.y, (double)tx.z};
    t = lx_dnormalize(lx_dmad(t, n, -lx_ddot(t, n)));
    const lx_dvec3 u = lx_dcross(n, t), origin = patch->positions[patch->corners[3 * p->run[0]]];
    double flat_area = 0;
    for (uint32_t i = 0; i < p->count; ++i) {
        const uint32_t triangle = p->run[i];
        lx_dvec2 *q = &p->points[3 * (size_t)i];
        for (uint32_t k = 0; k < 3; ++k) {
            const lx_dvec3 d = lx_dsub(patch->positions[patch->corners[3 * triangle + k]], origin);
            q[k] = (lx_dvec2){lx_ddot(d, t), lx_ddot(d, u)};
        }
        for (uint32_t k = 0; k < 3; ++k)
            if (is_border(patch, p->segmentation, 3 * triangle + k)) p->border[p->border_count++] = q[k];
        p->area += patch->areas[triangle];
        flat_area += 0.5 * lx_dcross2(q[0], q[1], q[2]);
    }
    // A surface that faces one way has a border; the guard is for arithmetic alone.
    const uint32_t hull_size = p->border_count ? convex_hull(p->border, p->border_count, p->hull) : 0;
    const lx_dvec2 d = hull_size ? rectangle_direction(p->hull, hull_size, p->edges) : (lx_dvec2){1, 0};
    p->low = (lx_dvec2){INFINITY, INFINITY};
    p->high = (lx_dvec2){-INFINITY, -INFINITY};
    for (size_t i = 0; i < 3 * (size_t)p->count; ++i) {
        const lx_dvec2 q = p->points[i], r = {q.x * d.x + q.y * d.y, q.y * d.x - q.x * d.y};
        p->points[i] = r;
        p->low = (lx_dvec2){fmin(p->low.x, r.x), fmin(p->low.y, r.y)};
        p->high = (lx_dvec2){fmax(p->high.x, r.x), fmax(p->high.y, r.y)};
    }
    p->scale = flat_area > 0 ? sqrt(p->area / flat_area) : 1;
}

// Gives the triangles of the far half of the chart at hand to a new chart. False: no memory.
static bool cut_across(const projector *p, uint32_t chart, lx_segmentation *segmentation)
{
    const double w = p->high.x - p->low.x, h = p->high.y - p->low.y;
    const bool along_x = w > h;
    const double middle = along_x ? p->low.x + 0.5 * w : p->low.y + 0.5 * h;
    const uint32_t other = lx_segmentation_add(segmentation, segmentation->normals[chart]);
    if (other == LX_NONE) return false;
    for (uint32_t i = 0; i < p->count; ++i) {
        const lx_dvec2 *q = &p->points[3 * (size_t)i];
        const double center = along_x ? (q[0].x + q[1].x + q[2].x) / 3 : (q[0].y + q[1].y + q[2].y) / 3;
        if (center > middle) segmentation->chart_of[p->run[i]] = other;
    }
    return true;
}

lx_result lx_split_long_charts(const lx_patch *patch, double longest, lx_segmentation *segmentation, lx_error *error)
{
    lx_result result = LX_OK;
    for (int pass = 0; pass < split_passes; ++pass) {
        projector p;
        uint32_t cuts = 0;
        LX_TRY(projector_init(&p, patch, segmentation, error));
        for (uint32_t c = 0, count = segmentation->chart_count; c < count && result == LX_OK; ++c) {
            project(&p, c);
            if (p.count < 2 || fmax(p.high.x - p.low.x, p.high.y - p.low.y) * p.scale <= longest) continue;
            if (!cut_across(&p, c, segmentation)) result = lx_fail_memory(error, "charts");
            ++cuts;
        }
        projector_release(&p);
        if (result != LX_OK || cuts == 0) break;
        LX_TRY(lx_segmentation_connect(patch, segmentation, error));
    }
cleanup:
    return result;
}

static lx_result add_chart(projector *p, uint32_t chart, uint32_t primitive, double density, lx_chart_set *set,
                           lx_vec2 *corner_xy, lx_error *error)
{
    project(p, chart);
    const uint32_t border = p->border_count;
    const double scale = p->scale * density;
    if (!lx_array_reserve(&set->segments, &set->segment_capacity, set->segment_count + border, sizeof *set->segments) ||
        !lx_array_reserve(&set->charts, &set->chart_capacity, (size_t)set->chart_count + 1, sizeof *set->charts))
        return lx_fail_memory(error, "charts");
    if (set->segment_count + border > UINT32_MAX) return lx_fail(error, LX_ERROR_LIMIT, "a mesh has too many chart borders");
    for (uint32_t i = 0; i < p->count; ++i)
        for (uint32_t k = 0; k < 3; ++k) {
            const lx_dvec2 q = p->points[3 * (size_t)i + k];
            corner_xy[3 * (size_t)p->run[i] + k] = lx_v2((float)((q.x - p->low.x) * scale), (float)((q.y - p->low.y) * scale));
        }
    set->charts[set->chart_count++] = (lx_chart){.primitive = primitive,
                                                 .first_segment = (uint32_t)set->segment_count,
                                                 .segment_count = border,
                                                 .width = (float)((p->high.x - p->low.x) * scale),
                                                 .height = (float)((p->high.y - p->low.y) * scale),
                                                 .area = (float)(p->area * density * density)};
    for (uint32_t i = 0; i < p->count; ++i)
        for (uint32_t k = 0; k < 3; ++k) {
            if (!is_border(p->patch, p->segmentation, 3 * p->run[i] + k)) continue;
            const lx_vec2 *c = &corner_xy[3 * (size_t)p->run[i]];
            set->segments[set->segment_count++] = (lx_segment2){c[k], c[k == 2 ? 0 : k + 1]};
        }
    set->area += p->area * density * density;
    return LX_OK;
}

lx_result lx_project_charts(const lx_patch *patch, const lx_segmentation *segmentation, uint32_t primitive, double density,
                            lx_chart_set *set, lx_vec2 *corner_xy, uint32_t *triangle_chart, lx_error *error)
{
    const uint32_t before = set->chart_count;
    projector p;
    lx_result result = projector_init(&p, patch, segmentation, error);
    if (result != LX_OK) return result;
    for (uint32_t t = 0; t < patch->triangle_count; ++t) {
        const uint32_t chart = segmentation->chart_of[t];
        triangle_chart[t] = chart == LX_NO_CHART ? LX_NO_CHART : before + chart;
    }
    for (uint32_t c = 0; c < segmentation->chart_count && result == LX_OK; ++c)
        result = add_chart(&p, c, primitive, density, set, corner_xy, error);
    projector_release(&p);
    return result;
}
