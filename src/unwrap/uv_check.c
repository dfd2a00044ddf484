// Judges the lightmap coordinates that a file brings: inside 0…1, every surface with an area, nothing on top of each other,
// charts far enough apart at the resolution they get.
#include "base/memory.h"
#include "math/hash.h"
#include "unwrap/unwrap.h"

#include <string.h>

// Exporters and normalised integers leave values a rounding step outside.
static const double outside_tolerance = 1e-4;
// Share of the surface that may be without area in the set: slivers that a tool snapped together.
static const double lost_tolerance = 0.01;
// Share of the samples that may lie in two triangles: at a thousandth, a texel in a thousand holds the light of two places.
// What is meant to overlap (tiled or mirrored textures) overlaps in large parts.
static const double overlap_tolerance = 1e-3;
// Share of the covered cells that may be closer than two texels to another chart. Tools round charts to texels of their own
// resolution; a chart corner that comes a fraction nearer leaks into one texel at most.
static const double near_tolerance = 5e-3;

enum { weld_steps = 1 << 20, overlap_samples = 2048, padding_cells = 4096 };

// ---- Connected parts ---------------------------------------------------------------------------------------------------

static uint32_t find_root(uint32_t *parents, uint32_t i)
{
    while (parents[i] != i) {
        parents[i] = parents[parents[i]];
        i = parents[i];
    }
    return i;
}

// Number of `key` in an open hash table whose keys are in `keys`; adds it if it is new.
static uint32_t number_of(uint64_t key, uint32_t *table, size_t slots, uint64_t *keys, uint32_t *count)
{
    size_t slot = (size_t)lx_hash64(key) & (slots - 1);
    while (table[slot] != LX_NONE && keys[table[slot]] != key) slot = (slot + 1) & (slots - 1);
    if (table[slot] == LX_NONE) {
        table[slot] = *count;
        keys[(*count)++] = key;
    }
    return table[slot];
}

// Joins triangles with a common edge in uv (both ends equal within 2^-20), numbers the parts in order.
static bool find_parts(lx_uv_set *set)
{
    const size_t corners = 3 * (size_t)set->triangle_count;
    size_t slots = 16;
    while (slots < corners * 2) slots *= 2;
    uint32_t *table = lx_malloc_array(slots, sizeof *table);
    uint64_t *keys = lx_malloc_array(corners, sizeof *keys);
    uint32_t *points = lx_malloc_array(corners, sizeof *points);
    uint32_t *owners = lx_malloc_array(corners, sizeof *owners);
    uint32_t *parents = lx_malloc_array(set->triangle_count, sizeof *parents);
    const bool ok = table && keys && points && owners && parents;
    if (ok) {
        uint32_t count = 0;
        memset(table, 0xff, slots * sizeof *table);
        for (size_t i = 0; i < corners; ++i) {
            const int32_t x = (int32_t)floor((double)set->uv[i].x * weld_steps + 0.5);
            const int32_t y = (int32_t)floor((double)set->uv[i].y * weld_steps + 0.5);
            points[i] = number_of((uint32_t)x | (uint64_t)(uint32_t)y << 32, table, slots, keys, &count);
        }
        count = 0;
        memset(table, 0xff, slots * sizeof *table);
        for (uint32_t t = 0; t < set->triangle_count; ++t) parents[t] = t;
        for (size_t i = 0; i < corners; ++i) {
            const uint32_t t = (uint32_t)(i / 3), known = count;
            if (set->charts[t] == LX_NO_CHART) continue;
            const uint32_t a = points[i], b = points[i % 3 == 2 ? i - 2 : i + 1];
            const uint32_t edge = number_of(a < b ? a | (uint64_t)b << 32 : b | (uint64_t)a << 32, table, slots, keys, &count);
            if (edge == known)
                owners[edge] = t;
            else {
                const uint32_t p = find_root(parents, t), q = find_root(parents, owners[edge]);
                if (p < q)
                    parents[q] = p;
                else
                    parents[p] = q;
            }
        }
        for (uint32_t t = 0; t < set->triangle_count; ++t) { // roots are the first of their part
            if (set->charts[t] == LX_NO_CHART) continue;
            const uint32_t root = find_root(parents, t);
            set->charts[t] = root == t ? set->chart_count++ : set->charts[root];
        }
    }
    lx_free(table);
    lx_free(keys);
    lx_free(points);
    lx_free(owners);
    lx_free(parents);
    return ok;
}

// ---- Gathering -----------------------------------------------------------------------------------------------------------

static bool is_inside(lx_vec2 uv)
{
    const double low = -outside_tolerance, high = 1 + outside_tolerance; // NaN is outside
    return (double)uv.x >= low && (double)uv.x <= high && (double)uv.y >= low && (double)uv.y <= high;
}

static double triangle_area(const lx_primitive *primitive, uint32_t t, const lx_metric *metric)
{
    lx_dvec3 p[3];
    for (uint32_t k = 0; k < 3; ++k) p[k] = lx_metric_apply(metric, primitive->positions[primitive->indices[3 * t + k]]);
    const lx_dvec3 n = lx_dcross(lx_dsub(p[1], p[0]), lx_dsub(p[2], p[0]));
    const double area = 0.5 * sqrt(lx_ddot(n, n));
    return area < 1e300 ? area : 0;
}

static void add_triangle(lx_uv_set *set, const lx_primitive *primitive, uint32_t t, const lx_metric *metric, double *lost)
{
    lx_dvec2 q[3];
    for (uint32_t k = 0; k < 3; ++k) {
        const lx_vec2 uv = primitive->texcoords[1][primitive->indices[3 * t + k]];
        if (!is_inside(uv)) set->flaw = "has values outside 0..1";
        const lx_vec2 inside = lx_v2(lx_clamp(uv.x, 0, 1), lx_clamp(uv.y, 0, 1));
        set->uv[3 * (size_t)set->triangle_count + k] = inside;
        q[k] = (lx_dvec2){(double)inside.x, (double)inside.y};
    }
    const double area = triangle_area(primitive, t, metric), uv_area = 0.5 * fabs(lx_dcross2(q[0], q[1], q[2]));
    const bool usable = area > 0 && uv_area > 0;
    set->charts[set->triangle_count++] = usable ? 0 : LX_NO_CHART;
    if (!usable) {
        *lost += area;
        return;
    }
    set->area += area;
    set->uv_area += uv_area;
    for (int k = 0; k < 3; ++k) {
        set->low = lx_v2(fminf(set->low.x, (float)q[k].x), fminf(set->low.y, (float)q[k].y));
        set->high = lx_v2(fmaxf(set->high.x, (float)q[k].x), fmaxf(set->high.y, (float)q[k].y));
    }
}

lx_result lx_uv_set_init(lx_uv_set *set, const lx_scene *scene, const lx_mesh *mesh, const bool *lit, const lx_metric *metric,
                         lx_error *error)
{
    size_t count = 0;
    double lost = 0;
    *set = (lx_uv_set){.low = {1, 1}, .high = {0, 0}};
    for (uint32_t i = 0; i < mesh->primitive_count; ++i) {
        if (!lit[mesh->first_primitive + i]) continue;
        const lx_primitive *primitive = &scene->primitives[mesh->first_primitive + i];
        if (!primitive->texcoords[1]) set->flaw = "is missing on some of the primitives";
        count += primitive->triangle_count;
    }
    if (count > UINT32_MAX / 4) return lx_fail(error, LX_ERROR_LIMIT, "a mesh has too many triangles");
    if (set->flaw) return LX_OK;
    set->uv = lx_malloc_array(count * 3, sizeof *set->uv);
    set->charts = lx_malloc_array(count, sizeof *set->charts);
    if (!set->uv || !set->charts) goto no_memory;
    for (uint32_t i = 0; i < mesh->primitive_count; ++i) {
        if (!lit[mesh->first_primitive + i]) continue;
        const lx_primitive *primitive = &scene->primitives[mesh->first_primitive + i];
        for (uint32_t t = 0; t < primitive->triangle_count; ++t) add_triangle(set, primitive, t, metric, &lost);
    }
    if (!set->flaw && (set->uv_area <= 0 || lost > lost_tolerance * (set->area + lost)))
        set->flaw = "leaves part of the surface without area";
    if (!set->flaw && !find_parts(set)) goto no_memory;
    return LX_OK;
no_memory:
    lx_uv_set_release(set);
    return lx_fail_memory(error, "checking TEXCOORD_1");
}

void lx_uv_set_release(lx_uv_set *set)
{
    lx_free(set->uv);
    lx_free(set->charts);
    *set = (lx_uv_set){0};
}

static void place_triangle(const lx_uv_set *set, uint32_t t, double cells, lx_dvec2 out[3])
{
    for (size_t k = 0; k < 3; ++k) {
        const lx_vec2 uv = set->uv[3 * (size_t)t + k];
        out[k] = (lx_dvec2){(double)uv.x * cells, (double)uv.y * cells};
    }
}

// ---- Overlap -------------------------------------------------------------------------------------------------------------

typedef struct sampling {
    uint8_t *hit; // [overlap_samples²]
    uint64_t covered, twice;
} sampling;

static void hit_samples(void *user, uint32_t y, uint32_t x0, uint32_t x1)
{
    sampling *s = user;
    uint8_t *row = &s->hit[(size_t)y * overlap_samples];
    for (uint32_t x = x0; x < x1; ++x) {
        s->covered += row[x] == 0;
        s->twice += row[x] == 1; // a sample counts once, however many triangles lie over it
        if (row[x] < 2) ++row[x];
    }
}

lx_result lx_uv_sets_overlap(const lx_uv_set *const *sets, uint32_t set_count, bool *out_overlap, lx_error *error)
{
    sampling s = {.hit = lx_calloc_array((size_t)overlap_samples * overlap_samples, 1)};
    if (!s.hit) return lx_fail_memory(error, "checking TEXCOORD_1");
    for (uint32_t i = 0; i < set_count; ++i)
        for (uint32_t t = 0; t < sets[i]->triangle_count; ++t) {
            if (sets[i]->charts[t] == LX_NO_CHART) continue;
            lx_dvec2 p[3];
            place_triangle(sets[i], t, overlap_samples, p);
            lx_raster_centers(p, overlap_samples, hit_samples, &s);
        }
    *out_overlap = (double)s.twice > overlap_tolerance * (double)s.covered;
    lx_free(s.hit);
    return LX_OK;
}

// ---- Padding -------------------------------------------------------------------------------------------------------------

#define SHARED UINT32_MAX

typedef struct ownership {
    uint32_t *owners; // [cells²] chart + 1 over all sets; SHARED: several
    uint32_t cells, chart;
} ownership;

static void own_cells(void *user, uint32_t y, uint32_t x0, uint32_t x1)
{
    ownership *o = user;
    uint32_t *row = &o->owners[(size_t)y * o->cells];
    for (uint32_t x = x0; x < x1; ++x) row[x] = row[x] == 0 || row[x] == o->chart ? o->chart : SHARED;
}

// Inside a chart nothing is near: only cells at its rim need to look further.
static bool is_rim(const ownership *o, uint32_t x, uint32_t y)
{
    if (x == 0 || y == 0 || x + 1 == o->cells || y + 1 == o->cells) return true;
    const uint32_t *row = &o->owners[(size_t)y * o->cells + x], own = *row;
    return row[-1] != own || row[1] != own || row[-(ptrdiff_t)o->cells] != own || row[o->cells] != own;
}

static bool has_other_near(const ownership *o, uint32_t x, uint32_t y, uint32_t radius)
{
    const uint32_t own = o->owners[(size_t)y * o->cells + x];
    const uint32_t x0 = x > radius ? x - radius : 0, x1 = x + radius < o->cells ? x + radius : o->cells - 1;
    const uint32_t y0 = y > radius ? y - radius : 0, y1 = y + radius < o->cells ? y + radius : o->cells - 1;
    for (uint32_t j = y0; j <= y1; ++j)
        for (uint32_t i = x0; i <= x1; ++i) {
            const uint32_t other = o->owners[(size_t)j * o->cells + i];
            if (other != 0 && other != own) return true;
        }
    return false;
}

// Cells are half texels where memory allows. Two charts at least two texels apart touch cells with three empty half texels
// (one empty texel) or more between them; charts 1.5 texels (1 texel) apart or less never do.
lx_result lx_uv_sets_apart(const lx_uv_set *const *sets, uint32_t set_count, uint32_t texels, bool *out_apart,
                           lx_error *error)
{
    const uint32_t per_texel = texels * 2 <= padding_cells ? 2 : 1, radius = 2 * per_texel - 1;
    ownership o = {.cells = texels * per_texel};
    uint64_t covered = 0, near = 0;
    uint32_t first = 1;
    o.owners = lx_calloc_array((size_t)o.cells * o.cells, sizeof *o.owners);
    if (!o.owners) return lx_fail_memory(error, "checking TEXCOORD_1");
    for (uint32_t i = 0; i < set_count; ++i) {
        for (uint32_t t = 0; t < sets[i]->triangle_count; ++t) {
            if (sets[i]->charts[t] == LX_NO_CHART) continue;
            lx_dvec2 p[3];
            place_triangle(sets[i], t, o.cells, p);
            o.chart = first + sets[i]->charts[t];
            lx_raster_touched(p, o.cells, own_cells, &o);
        }
        first += sets[i]->chart_count;
    }
    for (uint32_t y = 0; y < o.cells; ++y)
        for (uint32_t x = 0; x < o.cells; ++x) {
            const uint32_t own = o.owners[(size_t)y * o.cells + x];
            if (own == 0) continue;
            ++covered;
            if (own == SHARED || (is_rim(&o, x, y) && has_other_near(&o, x, y, radius))) ++near;
        }
    *out_apart = (double)near <= near_tolerance * (double)covered;
    lx_free(o.owners);
    return LX_OK;
}
