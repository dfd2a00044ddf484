// A primitive's triangles as a surface: vertices welded where their positions are equal bit by bit (glTF splits them at
// every seam of normals or texture coordinates), neighbours over edges that exactly two triangles use in opposite directions.
// All other edges (open, non-manifold, of turned-over neighbours) count as borders.
#include "base/memory.h"
#include "math/hash.h"
#include "unwrap/unwrap.h"

#include <string.h>

lx_dvec3 lx_dnormalize(lx_dvec3 a)
{
    const double m = fmax(fabs(a.x), fmax(fabs(a.y), fabs(a.z)));
    if (!(m > 0) || !(m < (double)INFINITY)) return (lx_dvec3){0, 0, 1};
    a = (lx_dvec3){a.x / m, a.y / m, a.z / m};
    const double s = 1 / sqrt(lx_ddot(a, a));
    return (lx_dvec3){a.x * s, a.y * s, a.z * s};
}

lx_dvec3 lx_metric_apply(const lx_metric *metric, lx_vec3 p)
{
    const double *m = metric->m, x = (double)p.x, y = (double)p.y, z = (double)p.z;
    return (lx_dvec3){m[0] * x + m[1] * y + m[2] * z, m[3] * x + m[4] * y + m[5] * z, m[6] * x + m[7] * y + m[8] * z};
}

static size_t table_size(size_t count)
{
    size_t size = 16;
    while (size < count * 2) size *= 2;
    return size;
}

static uint32_t float_bits(float value)
{
    uint32_t bits;
    value += 0.0f; // -0 and 0 are one place
    memcpy(&bits, &value, sizeof bits);
    return bits;
}

static bool weld(lx_patch *patch, const lx_primitive *primitive, const lx_metric *metric)
{
    const size_t slots = table_size(primitive->vertex_count);
    uint32_t *table = lx_malloc_array(slots, sizeof *table);
    uint32_t *welded = lx_malloc_array(primitive->vertex_count, sizeof *welded);
    uint32_t *first = lx_malloc_array(primitive->vertex_count, sizeof *first);
    const bool ok = table && welded && first;
    if (ok) {
        memset(table, 0xff, slots * sizeof *table);
        for (uint32_t v = 0; v < primitive->vertex_count; ++v) {
            const lx_vec3 p = primitive->positions[v];
            const uint32_t bits[3] = {float_bits(p.x), float_bits(p.y), float_bits(p.z)};
            const uint64_t hash = lx_hash64(bits[0] | (uint64_t)bits[1] << 32) + bits[2];
            size_t slot = (size_t)lx_hash64(hash) & (slots - 1);
            for (; table[slot] != LX_NONE; slot = (slot + 1) & (slots - 1)) {
                const lx_vec3 q = primitive->positions[first[table[slot]]];
                if (float_bits(q.x) == bits[0] && float_bits(q.y) == bits[1] && float_bits(q.z) == bits[2]) break;
            }
            if (table[slot] == LX_NONE) {
                table[slot] = patch->vertex_count;
                first[patch->vertex_count] = v;
                patch->positions[patch->vertex_count++] = lx_metric_apply(metric, p);
            }
            welded[v] = table[slot];
        }
        for (uint32_t i = 0; i < 3 * patch->triangle_count; ++i) patch->corners[i] = welded[primitive->indices[i]];
    }
    lx_free(table);
    lx_free(welded);
    lx_free(first);
    return ok;
}

// A height below 1e-7 of the longest edge is less than the positions resolve: the normal of such a triangle is noise.
static void measure(lx_patch *patch)
{
    for (uint32_t t = 0; t < patch->triangle_count; ++t) {
        const uint32_t *c = &patch->corners[3 * t];
        const lx_dvec3 p = patch->positions[c[0]];
        const lx_dvec3 a = lx_dsub(patch->positions[c[1]], p), b = lx_dsub(patch->positions[c[2]], p), e = lx_dsub(b, a);
        const double longest = fmax(lx_ddot(a, a), fmax(lx_ddot(b, b), lx_ddot(e, e)));
        const lx_dvec3 n = lx_dcross(a, b);
        const double doubled = sqrt(lx_ddot(n, n));
        const bool usable = doubled > 1e-7 * longest && doubled > 0 && doubled < 1e300;
        patch->areas[t] = usable ? 0.5 * doubled : 0;
        patch->normals[t] = lx_dnormalize(n);
    }
}

typedef struct edge {
    uint32_t low, high;   // vertices
    uint32_t first, second; // half edges 3 * triangle + corner
    uint32_t count;
} edge;

static bool link_edges(lx_patch *patch)
{
    const size_t half_edges = (size_t)patch->triangle_count * 3, slots = table_size(half_edges);
    edge *edges = lx_malloc_array(half_edges, sizeof *edges);
    uint32_t *table = lx_malloc_array(slots, sizeof *table);
    uint32_t edge_count = 0;
    const bool ok = edges && table;
    if (ok) {
        memset(table, 0xff, slots * sizeof *table);
        for (uint32_t h = 0; h < half_edges; ++h) {
            patch->neighbors[h] = LX_NONE;
            if (patch->areas[h / 3] <= 0) continue;
            const uint32_t a = patch->corners[h], b = patch->corners[h % 3 == 2 ? h - 2 : h + 1];
            const uint32_t low = a < b ? a : b, high = a < b ? b : a;
            size_t slot = (size_t)lx_hash64(low | (uint64_t)high << 32) & (slots - 1);
            while (table[slot] != LX_NONE && (edges[table[slot]].low != low || edges[table[slot]].high != high))
                slot = (slot + 1) & (slots - 1);
            if (table[slot] == LX_NONE) {
                table[slot] = edge_count;
                edges[edge_count++] = (edge){low, high, h, LX_NONE, 1};
            } else {
                edge *e = &edges[table[slot]];
                if (e->count++ == 1) e->second = h;
            }
        }
        for (uint32_t i = 0; i < edge_count; ++i) {
            const edge *e = &edges[i];
            if (e->count != 2 || patch->corners[e->first] == patch->corners[e->second]) continue;
            patch->neighbors[e->first] = e->second / 3;
            patch->neighbors[e->second] = e->first / 3;
        }
    }
    lx_free(edges);
    lx_free(table);
    return ok;
}

lx_result lx_patch_init(lx_patch *patch, const lx_primitive *primitive, const lx_metric *metric, lx_error *error)
{
    *patch = (lx_patch){.triangle_count = primitive->triangle_count};
    if (primitive->triangle_count > UINT32_MAX / 4)
        return lx_fail(error, LX_ERROR_LIMIT, "%u triangles in one primitive are too many", primitive->triangle_count);
    const size_t triangles = primitive->triangle_count;
    patch->positions = lx_malloc_array(primitive->vertex_count, sizeof *patch->positions);
    patch->corners = lx_malloc_array(triangles * 3, sizeof *patch->corners);
    patch->neighbors = lx_malloc_array(triangles * 3, sizeof *patch->neighbors);
    patch->normals = lx_malloc_array(triangles, sizeof *patch->normals);
    patch->areas = lx_malloc_array(triangles, sizeof *patch->areas);
    if (patch->positions && patch->corners && patch->neighbors && patch->normals && patch->areas &&
        weld(patch, primitive, metric)) {
        measure(patch);
        if (link_edges(patch)) return LX_OK;
    }
    lx_patch_release(patch);
    return lx_fail_memory(error, "unwrapping a mesh");
}

void lx_patch_release(lx_patch *patch)
{
    lx_free(patch->positions);
    lx_free(patch->corners);
    lx_free(patch->neighbors);
    lx_free(patch->normals);
    lx_free(patch->areas);
    *patch = (lx_patch){0};
}
