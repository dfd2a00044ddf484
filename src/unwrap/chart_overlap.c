// Charts that lie over themselves when projected (spirals, tubes that come back, folds) are cut until none does.
//
// The test is exact up to rounding: every two triangles that share a grid cell are compared by separating axes. Where that
// would be too many pairs (thousands of needles through one cell) it samples the plane with a fine raster instead.
// The cut goes half-way between two overlapping triangles, measured in steps from neighbour to neighbour: on a spiral that
// is half a turn.
#include "base/memory.h"
#include "unwrap/unwrap.h"

#include <string.h>

static const double depth_tolerance = 1e-6; // of the chart's extent; overlaps less deep are rounding
enum { pairs_per_triangle = 400, pairs_free = 100000, fallback_raster = 2048, max_cuts = 48 };

typedef struct box2 { double x0, y0, x1, y1; } box2;

// Comparisons instead of fmin and fmax: these are calls, and this is the innermost loop.
static inline double least(double a, double b) { return a < b ? a : b; }
static inline double most(double a, double b) { return a > b ? a : b; }

static inline box2 triangle_box(const lx_dvec2 *p)
{
    return (box2){least(p[0].x, least(p[1].x, p[2].x)), least(p[0].y, least(p[1].y, p[2].y)),
                  most(p[0].x, most(p[1].x, p[2].x)), most(p[0].y, most(p[1].y, p[2].y))};
}

// True if a line through an edge of `a` has all of `b` outside, up to `slack`.
static bool edge_separates(const lx_dvec2 *a, const lx_dvec2 *b, double slack)
{
    for (int i = 0; i < 3; ++i) {
        const lx_dvec2 p = a[i], q = a[i == 2 ? 0 : i + 1];
        const double dx = q.x - p.x, dy = q.y - p.y, limit = slack * (fabs(dx) + fabs(dy));
        bool outside = true;
        for (int k = 0; k < 3 && outside; ++k) outside = dx * (b[k].y - p.y) - dy * (b[k].x - p.x) <= limit;
        if (outside) return true;
    }
    return false;
}

static bool triangles_overlap(const lx_dvec2 *a, const lx_dvec2 *b, double slack)
{
    return !edge_separates(a, b, slack) && !edge_separates(b, a, slack);
}

static bool are_neighbors(const uint32_t *neighbors, uint32_t a, uint32_t b)
{
    return neighbors && (neighbors[3 * a] == b || neighbors[3 * a + 1] == b || neighbors[3 * a + 2] == b);
}

// ---- Grid ----------------------------------------------------------------------------------------------------------------

typedef struct grid {
    double x0, y0, cell;
    uint32_t columns, rows;
    size_t *starts;      // [columns * rows + 1]
    uint32_t *entries;
} grid;

static uint32_t grid_index(double value, double low, double cell, uint32_t count)
{
    const double i = (value - low) / cell;
    return !(i > 0) ? 0 : i >= (double)count ? count - 1 : (uint32_t)i;
}

static size_t covered_cells(const grid *g, box2 b)
{
    const size_t w = grid_index(b.x1, g->x0, g->cell, g->columns) - grid_index(b.x0, g->x0, g->cell, g->columns) + 1;
    const size_t h = grid_index(b.y1, g->y0, g->cell, g->rows) - grid_index(b.y0, g->y0, g->cell, g->rows) + 1;
    return w * h;
}

static void grid_shape(grid *g, box2 all, double cells)
{
    const double w = all.x1 - all.x0, h = all.y1 - all.y0, longest = fmax(w, h);
    g->x0 = all.x0;
    g->y0 = all.y0;
    g->cell = fmax(sqrt(w * h / cells), longest / 4096);
    if (!(g->cell > 0)) g->cell = 1;
    g->columns = (uint32_t)fmin(4096, floor(w / g->cell) + 1);
    g->rows = (uint32_t)fmin(4096, floor(h / g->cell) + 1);
}

// False: no memory.
static bool grid_build(grid *g, const lx_dvec2 *points, uint32_t count, box2 all)
{
    size_t entries = 0;
    for (double cells = (double)count;; cells /= 4) {
        grid_shape(g, all, cells);
        entries = 0;
        for (uint32_t t = 0; t < count; ++t) entries += covered_cells(g, triangle_box(&points[3 * (size_t)t]));
        if (entries <= (size_t)count * 16 || cells < 4) break; // a coarser grid where triangles are long
    }
    const size_t cells = (size_t)g->columns * g->rows;
    g->starts = lx_calloc_array(cells + 2, sizeof *g->starts);
    g->entries = lx_malloc_array(entries, sizeof *g->entries);
    if (!g->starts || !g->entries) return false;
    for (int fill = 0; fill < 2; ++fill) { // count, then fill; starts[c + 1] is the running end of cell c
        for (uint32_t t = 0; t < count; ++t) {
            const box2 b = triangle_box(&points[3 * (size_t)t]);
            const uint32_t cx1 = grid_index(b.x1, g->x0, g->cell, g->columns), cy1 = grid_index(b.y1, g->y0, g->cell, g->rows);
            for (uint32_t y = grid_index(b.y0, g->y0, g->cell, g->rows); y <= cy1; ++y)
                for (uint32_t x = grid_index(b.x0, g->x0, g->cell, g->columns); x <= cx1; ++x) {
                    const size_t c = (size_t)y * g->columns + x;
                    if (fill)
                        g->entries[g->starts[c + 1]++] = t;
                    else
                        ++g->starts[c + 2];
                }
        }
        if (!fill)
            for (size_t c = 0; c < cells; ++c) g->starts[c + 2] += g->starts[c + 1];
    }
    return true;
}

static bool compare_cells(const grid *g, const lx_dvec2 *points, const uint32_t *neighbors, double slack, uint32_t *out_a,
                          uint32_t *out_b)
{
    for (uint32_t y = 0; y < g->rows; ++y)
        for (uint32_t x = 0; x < g->columns; ++x) {
            const size_t c = (size_t)y * g->columns + x;
            for (size_t i = g->starts[c]; i < g->starts[c + 1]; ++i) {
                const lx_dvec2 *a = &points[3 * (size_t)g->entries[i]];
                const box2 ba = triangle_box(a);
                for (size_t j = i + 1; j < g->starts[c + 1]; ++j) {
                    const lx_dvec2 *b = &points[3 * (size_t)g->entries[j]];
                    const box2 bb = triangle_box(b);
                    const double left = most(ba.x0, bb.x0), bottom = most(ba.y0, bb.y0);
                    if (left > least(ba.x1, bb.x1) || bottom > least(ba.y1, bb.y1)) continue;
                    // A pair meets in many cells; the one with the corner of the common box decides.
                    if (grid_index(left, g->x0, g->cell, g->columns) != x || grid_index(bottom, g->y0, g->cell, g->rows) != y)
                        continue;
                    if (are_neighbors(neighbors, g->entries[i], g->entries[j])) continue;
                    if (!triangles_overlap(a, b, slack)) continue;
                    *out_a = g->entries[i];
                    *out_b = g->entries[j];
                    return true;
                }
            }
        }
    return false;
}

// ---- Raster fallback -------------------------------------------------------------------------------------------------------

typedef struct sampling {
    uint32_t *owners; // [fallback_raster²], triangle + 1
    uint32_t triangle, other;
    bool found;
} sampling;

static void claim(void *user, uint32_t y, uint32_t x0, uint32_t x1)
{
    sampling *s = user;
    for (uint32_t x = x0; x < x1 && !s->found; ++x) {
        uint32_t *owner = &s->owners[(size_t)y * fallback_raster + x];
        if (*owner) {
            s->other = *owner - 1;
            s->found = true;
        }
        *owner = s->triangle + 1;
    }
}

static bool sample_overlap(const lx_dvec2 *points, uint32_t count, box2 all, uint32_t *out_a, uint32_t *out_b,
                           bool *out_of_memory)
{
    sampling s = {.owners = lx_calloc_array((size_t)fallback_raster * fallback_raster, sizeof *s.owners)};
    if (!s.owners) {
        *out_of_memory = true;
        return false;
    }
    const double scale = fallback_raster / fmax(all.x1 - all.x0, all.y1 - all.y0);
    for (uint32_t t = 0; t < count && !s.found; ++t) {
        lx_dvec2 p[3];
        for (int k = 0; k < 3; ++k) {
            const lx_dvec2 q = points[3 * (size_t)t + (size_t)k];
            p[k] = (lx_dvec2){(q.x - all.x0) * scale, (q.y - all.y0) * scale};
        }
        s.triangle = t;
        lx_raster_centers(p, fallback_raster, claim, &s);
        if (s.found) {
            *out_a = s.other;
            *out_b = t;
        }
    }
    lx_free(s.owners);
    return s.found;
}

bool lx_find_overlap(const lx_dvec2 *points, uint32_t count, const uint32_t *neighbors, uint32_t *out_a, uint32_t *out_b,
                     bool *out_of_memory)
{
    if (count < 2 || (count == 2 && neighbors && are_neighbors(neighbors, 0, 1))) return false;
    box2 all = {INFINITY, INFINITY, -INFINITY, -INFINITY};
    for (uint32_t t = 0; t < count; ++t) {
        const box2 b = triangle_box(&points[3 * (size_t)t]);
        all = (box2){least(all.x0, b.x0), least(all.y0, b.y0), most(all.x1, b.x1), most(all.y1, b.y1)};
    }
    const double slack = depth_tolerance * fmax(all.x1 - all.x0, all.y1 - all.y0);
    grid g = {0};
    bool found = false;
    if (grid_build(&g, points, count, all)) {
        double pairs = 0;
        for (size_t c = 0; c < (size_t)g.columns * g.rows; ++c) {
            const double n = (double)(g.starts[c + 1] - g.starts[c]);
            pairs += n * (n - 1) / 2;
        }
        if (pairs <= (double)count * pairs_per_triangle + pairs_free)
            found = compare_cells(&g, points, neighbors, slack, out_a, out_b);
        else
            found = sample_overlap(points, count, all, out_a, out_b, out_of_memory);
    } else {
        *out_of_memory = true;
    }
    lx_free(g.starts);
    lx_free(g.entries);
    return found;
}

// ---- Splitting -------------------------------------------------------------------------------------------------------------

typedef struct splitter {
    const lx_patch *patch;
    lx_segmentation *segmentation;
    uint32_t *order;      // [triangle_count] triangles, those of a chart in one run
    uint32_t *local;      // [triangle_count] place in the run, valid for the chart at hand
    uint32_t *queue;      // [triangle_count]
    uint8_t *side;        // [triangle_count] 0, 1: half of the cut; 2: not reached yet
    lx_dvec2 *points;     // [3 * longest run]
    uint32_t *neighbors;  // [3 * longest run] in the chart, by place
} splitter;

// The better of two normals: the mean of the triangles if all of them face it, else the one they had before.
static lx_dvec3 part_normal(const splitter *s, uint32_t first, uint32_t end, lx_dvec3 inherited)
{
    const lx_patch *patch = s->patch;
    const double unit = patch->areas[s->order[first]];
    lx_dvec3 sum = {0, 0, 0};
    for (uint32_t i = first; i < end; ++i)
        sum = lx_dmad(sum, patch->normals[s->order[i]], patch->areas[s->order[i]] / unit);
    const lx_dvec3 normal = lx_dnormalize(sum);
    for (uint32_t i = first; i < end; ++i)
        if (lx_ddot(patch->normals[s->order[i]], normal) < lx_keep_cosine) return inherited;
    return normal;
}

static bool chart_overlap(splitter *s, uint32_t chart, uint32_t first, uint32_t end, uint32_t *a, uint32_t *b, bool *no_memory)
{
    const lx_patch *patch = s->patch;
    const lx_dvec3 n = s->segmentation->normals[chart];
    lx_vec3 tx, ty;
    lx_tangent_frame(lx_v3((float)n.x, (float)n.y, (float)n.z), &tx, &ty);
    // The frame only has to span the plane: orthogonality in float is enough when made exact against n.
    lx_dvec3 t = {(double)tx.x, (double)tx.y, (double)tx.z};
    t = lx_dnormalize(lx_dmad(t, n, -lx_ddot(t, n)));
    const lx_dvec3 u = lx_dcross(n, t), origin = patch->positions[patch->corners[3 * s->order[first]]];
    for (uint32_t i = first; i < end; ++i) s->local[s->order[i]] = i - first;
    for (uint32_t i = first; i < end; ++i)
        for (uint32_t k = 0; k < 3; ++k) {
            const uint32_t corner = 3 * s->order[i] + k, other = patch->neighbors[corner];
            const lx_dvec3 d = lx_dsub(patch->positions[patch->corners[corner]], origin);
            s->points[3 * (size_t)(i - first) + k] = (lx_dvec2){lx_ddot(d, t), lx_ddot(d, u)};
            s->neighbors[3 * (size_t)(i - first) + k] =
                other != LX_NONE && s->segmentation->chart_of[other] == chart ? s->local[other] : LX_NONE;
        }
    return lx_find_overlap(s->points, end - first, s->neighbors, a, b, no_memory);
}

// Partitions the run [first, end) into triangles nearer to place a and nearer to place b; returns the border between them.
static uint32_t cut(splitter *s, uint32_t first, uint32_t end, uint32_t a, uint32_t b)
{
    const uint32_t count = end - first;
    memset(s->side, 2, count);
    uint32_t head = 0, tail = 0;
    s->queue[tail++] = a;
    s->side[a] = 0;
    s->queue[tail++] = b;
    s->side[b] = 1;
    while (head < tail) {
        const uint32_t i = s->queue[head++];
        for (int k = 0; k < 3; ++k) {
            const uint32_t other = s->neighbors[3 * (size_t)i + (size_t)k];
            if (other == LX_NONE || s->side[other] != 2) continue;
            s->side[other] = s->side[i];
            s->queue[tail++] = other;
        }
    }
    uint32_t middle = first;
    for (uint32_t i = 0; i < count; ++i) s->queue[i] = s->order[first + i];
    for (uint8_t part = 0; part < 2; ++part) {
        for (uint32_t i = 0; i < count; ++i) {
            if ((s->side[i] == 1) != (part == 1)) continue;
            s->order[middle++] = s->queue[i];
        }
        if (part == 0) head = middle;
    }
    return head;
}

typedef struct run { uint32_t first, end, chart, cuts; } run;

static lx_result give_each_its_own(splitter *s, run r, lx_error *error)
{
    for (uint32_t i = r.first; i < r.end; ++i) {
        uint32_t chart = r.chart;
        if (i == r.first)
            s->segmentation->normals[chart] = s->patch->normals[s->order[i]];
        else
            chart = lx_segmentation_add(s->segmentation, s->patch->normals[s->order[i]]);
        if (chart == LX_NONE) return lx_fail_memory(error, "chart overlaps");
        s->segmentation->chart_of[s->order[i]] = chart;
    }
    return LX_OK;
}

static lx_result split_run(splitter *s, run whole, const atomic_bool *stop, lx_error *error)
{
    run stack[max_cuts + 2];
    uint32_t depth = 0;
    stack[depth++] = whole;
    while (depth > 0) {
        if (stop && atomic_load(stop)) return lx_fail(error, LX_ERROR_CANCELLED, "cancelled");
        const run r = stack[--depth];
        bool no_memory = false;
        uint32_t a = 0, b = 0;
        const bool overlaps = chart_overlap(s, r.chart, r.first, r.end, &a, &b, &no_memory);
        if (no_memory) return lx_fail_memory(error, "chart overlaps");
        if (!overlaps) continue;
        if (r.cuts >= max_cuts) {
            const lx_result result = give_each_its_own(s, r, error);
            if (result != LX_OK) return result;
            continue;
        }
        const uint32_t middle = cut(s, r.first, r.end, a, b);
        const lx_dvec3 inherited = s->segmentation->normals[r.chart];
        const uint32_t chart = lx_segmentation_add(s->segmentation, part_normal(s, middle, r.end, inherited));
        if (chart == LX_NONE) return lx_fail_memory(error, "chart overlaps");
        s->segmentation->normals[r.chart] = part_normal(s, r.first, middle, inherited);
        for (uint32_t i = middle; i < r.end; ++i) s->segmentation->chart_of[s->order[i]] = chart;
        stack[depth++] = (run){r.first, middle, r.chart, r.cuts + 1};
        stack[depth++] = (run){middle, r.end, chart, r.cuts + 1};
    }
    return LX_OK;
}

lx_result lx_split_overlaps(const lx_patch *patch, const atomic_bool *stop, lx_segmentation *segmentation, lx_error *error)
{
    lx_result result = LX_OK;
    const uint32_t count = patch->triangle_count, chart_count = segmentation->chart_count;
    uint32_t longest = 0;
    splitter s = {.patch = patch, .segmentation = segmentation};
    uint32_t *ends = lx_calloc_array((size_t)chart_count + 1, sizeof *ends);
    s.order = lx_malloc_array(count, sizeof *s.order);
    s.local = lx_malloc_array(count, sizeof *s.local);
    if (!ends || !s.order || !s.local) LX_TRY(lx_fail_memory(error, "chart overlaps"));

    for (uint32_t t = 0; t < count; ++t)
        if (segmentation->chart_of[t] != LX_NO_CHART) ++ends[segmentation->chart_of[t]];
    for (uint32_t c = 0, end = 0; c < chart_count; ++c) {
        if (ends[c] > longest) longest = ends[c];
        const uint32_t first = end;
        end += ends[c];
        ends[c] = first;
    }
    for (uint32_t t = 0; t < count; ++t)
        if (segmentation->chart_of[t] != LX_NO_CHART) s.order[ends[segmentation->chart_of[t]]++] = t;

    s.queue = lx_malloc_array(longest, sizeof *s.queue);
    s.side = lx_malloc_array(longest, sizeof *s.side);
    s.points = lx_malloc_array((size_t)longest * 3, sizeof *s.points);
    s.neighbors = lx_malloc_array((size_t)longest * 3, sizeof *s.neighbors);
    if (!s.queue || !s.side || !s.points || !s.neighbors) LX_TRY(lx_fail_memory(error, "chart overlaps"));
    for (uint32_t c = 0; c < chart_count; ++c)
        LX_TRY(split_run(&s, (run){c == 0 ? 0 : ends[c - 1], ends[c], c, 0}, stop, error));
cleanup:
    lx_free(ends);
    lx_free(s.order);
    lx_free(s.local);
    lx_free(s.queue);
    lx_free(s.side);
    lx_free(s.points);
    lx_free(s.neighbors);
    return result;
}
