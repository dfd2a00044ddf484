// Corners back to vertices: corners of one vertex with one coordinate are one vertex again, others become copies.
#include "scene/gltf_export_private.h"

#include "math/hash.h"

#include <string.h>

// Two coordinates are one if their numbers are equal, so -0 is turned into 0 and bits can be compared.
static lx_vec2 plain(lx_vec2 uv)
{
    return (lx_vec2){uv.x + 0.0f, uv.y + 0.0f};
}

static bool is_same(lx_vec2 a, lx_vec2 b)
{
    return memcmp(&a, &b, sizeof a) == 0;
}

// Coordinates by vertex. False as soon as a vertex needs two.
static bool assign_unsplit(const lx_primitive *primitive, const lx_vec2 *corner_uv, lx_vec2 *uv, uint8_t *used)
{
    for (size_t corner = 0; corner < 3 * (size_t)primitive->triangle_count; ++corner) {
        const uint32_t vertex = primitive->indices[corner];
        const lx_vec2 value = plain(corner_uv[corner]);
        if (used[vertex] && !is_same(uv[vertex], value)) return false;
        uv[vertex] = value;
        used[vertex] = 1;
    }
    return true;
}

static uint64_t corner_hash(uint32_t vertex, lx_vec2 uv)
{
    uint64_t bits;
    memcpy(&bits, &uv, sizeof bits);
    return lx_hash64(bits ^ lx_hash64(vertex + 1));
}

// Numbers new vertices as the triangles ask for them; `table` finds the (vertex, uv) that were met. Its capacity is a power of two.
static void assign_split(const lx_primitive *primitive, const lx_vec2 *corner_uv, uint32_t *table, size_t capacity,
                         lx_export_weld *weld)
{
    for (size_t corner = 0; corner < 3 * (size_t)primitive->triangle_count; ++corner) {
        const uint32_t vertex = primitive->indices[corner];
        const lx_vec2 value = plain(corner_uv[corner]);
        size_t place = (size_t)corner_hash(vertex, value) & (capacity - 1);
        uint32_t found;
        while ((found = table[place]) != LX_EXPORT_NONE && (weld->old[found] != vertex || !is_same(weld->uv[found], value)))
            place = (place + 1) & (capacity - 1);
        if (found == LX_EXPORT_NONE) {
            found = table[place] = weld->count++;
            weld->old[found] = vertex;
            weld->uv[found] = value;
        }
        weld->indices[corner] = found;
    }
}

static lx_result weld_split(const lx_primitive *primitive, const lx_vec2 *corner_uv, lx_export_weld *weld,
                            lx_error *error)
{
    const size_t corner_count = 3 * (size_t)primitive->triangle_count;
    size_t capacity = 16;
    while (capacity < 2 * corner_count) capacity *= 2;
    uint32_t *table = lx_malloc_array(capacity, sizeof *table);
    weld->split = true;
    weld->old = lx_malloc_array(corner_count, sizeof *weld->old);
    weld->uv = lx_malloc_array(corner_count, sizeof *weld->uv);
    weld->indices = lx_malloc_array(corner_count, sizeof *weld->indices);
    const bool enough = table && weld->old && weld->uv && weld->indices && corner_count < LX_EXPORT_NONE;
    if (enough) {
        memset(table, 0xff, capacity * sizeof *table);
        assign_split(primitive, corner_uv, table, capacity, weld);
    }
    lx_free(table);
    return enough ? LX_OK : lx_fail_memory(error, "lightmap coordinates");
}

lx_result lx_export_weld_corners(const lx_primitive *primitive, const lx_vec2 *corner_uv, lx_export_weld *out,
                                 lx_error *error)
{
    *out = (lx_export_weld){.count = primitive->vertex_count};
    out->uv = lx_calloc_array(primitive->vertex_count, sizeof *out->uv);
    out->used = lx_calloc_array(primitive->vertex_count, sizeof *out->used);
    if (!out->uv || !out->used) {
        lx_export_weld_release(out);
        return lx_fail_memory(error, "lightmap coordinates");
    }
    if (assign_unsplit(primitive, corner_uv, out->uv, out->used)) return LX_OK;
    lx_export_weld_release(out);
    const lx_result result = weld_split(primitive, corner_uv, out, error);
    if (result != LX_OK) lx_export_weld_release(out);
    return result;
}

void lx_export_weld_release(lx_export_weld *weld)
{
    lx_free(weld->old);
    lx_free(weld->indices);
    lx_free(weld->uv);
    lx_free(weld->used);
    *weld = (lx_export_weld){0};
}
