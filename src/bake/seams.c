// Seams: see seams.h.
//
// Borders are edges of triangles beyond which their chart does not go on. They are found per mesh, placed per surface, and paired by their ends, which
// are welded within a fraction of a texel; what finds no partner that way is compared with the borders around it for partial overlap.
#include "bake/seams.h"

#include "bake/luxels.h"
#include "base/error.h"
#include "base/memory.h"

#include <stdlib.h>
#include <string.h>

enum {
    no_item = UINT32_MAX,
    most_pieces = 256, // into which a seam is cut to see where something stands on it
};

static const float least_cosine = 0.9659f;    // 15 degrees
static const float weld_texels = 0.05f;       // ends this near to each other are one
static const float cell_texels = 4;           // of the grid for overlaps
static const float least_overlap_texels = 0.5f;

// Edge `corner` → `corner + 1` of a triangle.
typedef struct mesh_edge {
    uint32_t primitive, triangle, corner;
} mesh_edge;

typedef struct border {
    lx_vec3 end[2], normal[2];
    lx_vec3 inward;    // unit, in the triangle's plane, away from the edge
    lx_vec2 on_page[2]; // texels
    uint32_t page, chart;
    uint32_t vertex[2]; // welded ends
    uint32_t next;      // with the same ends
    bool has_partner;
} border;

typedef struct build {
    const lx_bake *bake;
    mesh_edge *edges; // of all meshes that have lightmaps, borders alone, primitive by primitive
    size_t edge_count, edge_capacity;
    size_t *first_edge; // [primitive_count + 1]
    border *borders;
    size_t border_count, border_capacity;
    float texel_m, tolerance;
    lx_seam *seams;
    size_t seam_count, seam_capacity;
} build;

static uint32_t mix(uint32_t h, uint32_t value)
{
    h = (h ^ value) * 0x9e3779b1u;
    return h ^ h >> 15;
}

static uint32_t float_bits(float f)
{
    uint32_t bits;
    f += 0.0f; // -0 is 0
    memcpy(&bits, &f, sizeof bits);
    return bits;
}

static uint32_t table_size(size_t count)
{
    uint32_t size = 16;
    while (size < 2 * count && size < 1u << 31) size *= 2;
    return size;
}

// ---- borders of meshes ----------------------------------------------------------------------------------------------------------------

static lx_vec3 edge_position(const build *b, const mesh_edge *e, int end)
{
    const lx_primitive *p = &b->bake->scene->primitives[e->primitive];
    return p->positions[p->indices[3 * (size_t)e->triangle + (e->corner + (uint32_t)end) % 3]];
}

static lx_vec2 edge_uv(const build *b, const mesh_edge *e, int end)
{
    return b->bake->atlas->primitives[e->primitive].corner_uv[3 * (size_t)e->triangle + (e->corner + (uint32_t)end) % 3];
}

static uint32_t chart_of(const build *b, const mesh_edge *e) { return b->bake->atlas->primitives[e->primitive].triangle_chart[e->triangle]; }

// Does not depend on the edge's sense.
static uint32_t hash_edge(const build *b, const mesh_edge *e)
{
    uint32_t sum = 0;
    for (int end = 0; end < 2; ++end) {
        const lx_vec3 p = edge_position(b, e, end);
        const lx_vec2 uv = edge_uv(b, e, end);
        uint32_t h = mix(mix(mix(17, float_bits(p.x)), float_bits(p.y)), float_bits(p.z));
        h = mix(mix(h, float_bits(uv.x)), float_bits(uv.y));
        sum += h;
    }
    return mix(sum, chart_of(b, e));
}

static bool same_end(const build *b, const mesh_edge *a, int a_end, const mesh_edge *c, int c_end)
{
    const lx_vec3 p = edge_position(b, a, a_end), q = edge_position(b, c, c_end);
    const lx_vec2 u = edge_uv(b, a, a_end), v = edge_uv(b, c, c_end);
    return p.x == q.x && p.y == q.y && p.z == q.z && u.x == v.x && u.y == v.y;
}

static bool same_edge(const build *b, const mesh_edge *a, const mesh_edge *c)
{
    return chart_of(b, a) == chart_of(b, c) && ((same_end(b, a, 0, c, 0) && same_end(b, a, 1, c, 1)) ||
                                                (same_end(b, a, 0, c, 1) && same_end(b, a, 1, c, 0)));
}

// Appends the mesh's edges that occur once in the world and on the page.
static lx_result find_mesh_borders(build *b, const lx_mesh *mesh, lx_error *error)
{
    lx_result result = LX_OK;
    const lx_scene *scene = b->bake->scene;
    size_t count = 0, filled = 0;
    for (uint32_t p = mesh->first_primitive; p < mesh->first_primitive + mesh->primitive_count; ++p)
        if (b->bake->atlas->primitives[p].corner_uv) count += 3 * (size_t)scene->primitives[p].triangle_count;
    if (count > UINT32_MAX / 2) return LX_OK; // more than any page has texels: no seam of it could be seen
    const uint32_t slots = table_size(count);
    mesh_edge *all = lx_malloc_array(count, sizeof *all);
    uint32_t *table = lx_malloc_array(slots, sizeof *table);
    uint8_t *twice = lx_calloc_array(count, 1);
    if (!all || !table || !twice) {
        result = lx_fail_memory(error, "seams");
        goto cleanup;
    }
    memset(table, 0xff, slots * sizeof *table); // no_item
    for (uint32_t p = mesh->first_primitive; p < mesh->first_primitive + mesh->primitive_count; ++p) {
        if (!b->bake->atlas->primitives[p].corner_uv) continue;
        for (uint32_t t = 0; t < scene->primitives[p].triangle_count; ++t) {
            if (b->bake->atlas->primitives[p].triangle_chart[t] == LX_NO_CHART) continue;
            for (uint32_t corner = 0; corner < 3; ++corner) {
                const uint32_t number = (uint32_t)filled++;
                all[number] = (mesh_edge){p, t, corner};
                uint32_t slot = hash_edge(b, &all[number]) & (slots - 1);
                while (table[slot] != no_item && !same_edge(b, &all[table[slot]], &all[number])) slot = (slot + 1) & (slots - 1);
                if (table[slot] == no_item)
                    table[slot] = number;
                else
                    twice[table[slot]] = twice[number] = 1;
            }
        }
    }
    for (uint32_t p = mesh->first_primitive, i = 0; p < mesh->first_primitive + mesh->primitive_count; ++p) {
        b->first_edge[p] = b->edge_count;
        for (; i < filled && all[i].primitive == p; ++i) {
            if (twice[i]) continue;
            if (!lx_array_reserve(&b->edges, &b->edge_capacity, b->edge_count + 1, sizeof *b->edges)) {
                result = lx_fail_memory(error, "seams");
                goto cleanup;
            }
            b->edges[b->edge_count++] = all[i];
        }
    }
cleanup:
    lx_free(all);
    lx_free(table);
    lx_free(twice);
    return result;
}

// ---- borders in the world ---------------------------------------------------------------------------------------------------------------

static lx_vec2 place_on_page(const lx_atlas *atlas, const lx_atlas_rect *rect, lx_vec2 uv)
{
    const float size = (float)atlas->page_size;
    return lx_v2((uv.x * rect->scale[0] + rect->offset[0]) * size, (uv.y * rect->scale[1] + rect->offset[1]) * size);
}

static lx_result place_borders(build *b, uint32_t surface, uint32_t first_chart, lx_error *error)
{
    const lx_bake *bake = b->bake;
    const lx_surface *s = &bake->scene->surfaces[surface];
    const lx_atlas_rect *rect = &bake->atlas->rects[s->instance];
    for (size_t i = b->first_edge[s->primitive]; i < b->edge_count && b->edges[i].primitive == s->primitive; ++i) {
        const mesh_edge *e = &b->edges[i];
        const uint32_t from = e->corner, to = (e->corner + 1) % 3;
        lx_vec3 corner[3], normal[3], position, flat;
        lx_triangle_corners(bake->tracer, surface, e->triangle, corner);
        const lx_hit hit = {.surface = surface, .triangle = e->triangle};
        lx_hit_geometry(bake->tracer, &hit, &position, &flat);
        if (!lx_triangle_normals(bake->tracer, surface, e->triangle, normal)) normal[0] = normal[1] = normal[2] = flat;
        border one = {.end = {corner[from], corner[to]}, .normal = {normal[from], normal[to]}, .page = rect->page,
                      .chart = first_chart + chart_of(b, e), .next = no_item};
        const lx_vec3 along = lx_normalize_or(lx_sub(one.end[1], one.end[0]), lx_v3(0, 0, 0));
        const lx_vec3 third = lx_sub(corner[(e->corner + 2) % 3], one.end[0]);
        one.inward = lx_normalize_or(lx_mad(third, along, -lx_dot(third, along)), lx_v3(0, 0, 0));
        if (lx_dot(along, along) == 0 || lx_dot(one.inward, one.inward) == 0) continue; // no length or no area
        for (int end = 0; end < 2; ++end) one.on_page[end] = place_on_page(bake->atlas, rect, edge_uv(b, e, end));
        if (b->border_count + 1 >= no_item) return lx_fail(error, LX_ERROR_LIMIT, "too many chart borders to stitch");
        if (!lx_array_reserve(&b->borders, &b->border_capacity, b->border_count + 1, sizeof *b->borders)) return lx_fail_memory(error, "seams");
        b->borders[b->border_count++] = one;
    }
    return LX_OK;
}

// ---- welding and pairing --------------------------------------------------------------------------------------------------------------------

typedef struct cell {
    int64_t x, y, z;
} cell;

static cell cell_at(lx_vec3 p, float edge) { return (cell){(int64_t)floorf(p.x / edge), (int64_t)floorf(p.y / edge), (int64_t)floorf(p.z / edge)}; }

static uint32_t hash_cell(int64_t x, int64_t y, int64_t z)
{
    return mix(mix(mix(29, (uint32_t)x), (uint32_t)y), (uint32_t)z);
}

// Numbers the borders' ends: those within the tolerance of an earlier one take its number.
static lx_result weld(build *b, lx_error *error)
{
    lx_result result = LX_OK;
    const uint32_t slots = table_size(2 * b->border_count);
    const float edge = 2 * b->tolerance;
    uint32_t *head = lx_malloc_array(slots, sizeof *head);           // first end of a cell
    uint32_t *next = lx_malloc_array(2 * b->border_count, sizeof *next); // end 2 i + k is borders[i].end[k]
    if (!head || !next) {
        result = lx_fail_memory(error, "seams");
        goto cleanup;
    }
    memset(head, 0xff, slots * sizeof *head);
    for (uint32_t i = 0; i < 2 * b->border_count; ++i) {
        const lx_vec3 p = b->borders[i / 2].end[i & 1], reach = {b->tolerance, b->tolerance, b->tolerance};
        const cell low = cell_at(lx_sub(p, reach), edge), high = cell_at(lx_add(p, reach), edge);
        uint32_t found = no_item;
        for (int64_t z = low.z; z <= high.z; ++z)
            for (int64_t y = low.y; y <= high.y; ++y)
                for (int64_t x = low.x; x <= high.x; ++x)
                    for (uint32_t k = head[hash_cell(x, y, z) & (slots - 1)]; k != no_item; k = next[k])
                        if (lx_distance(b->borders[k / 2].end[k & 1], p) <= b->tolerance && k < found) found = k;
        b->borders[i / 2].vertex[i & 1] = found == no_item ? i : found;
        if (found != no_item) continue;
        const cell own = cell_at(p, edge);
        const uint32_t slot = hash_cell(own.x, own.y, own.z) & (slots - 1);
        next[i] = head[slot];
        head[slot] = i;
    }
cleanup:
    lx_free(head);
    lx_free(next);
    return result;
}

// Do the surfaces go on from one border to the other? `turned`: a's first end is c's second.
static bool is_continuous(const border *a, const border *c, bool turned)
{
    return lx_dot(a->normal[0], c->normal[turned]) > least_cosine && lx_dot(a->normal[1], c->normal[!turned]) > least_cosine &&
           lx_dot(a->inward, c->inward) < -least_cosine;
}

static lx_vec3 lerp3(lx_vec3 a, lx_vec3 b, float t) { return lx_mad(a, lx_sub(b, a), t); }
static lx_vec2 lerp2(lx_vec2 a, lx_vec2 b, float t) { return lx_v2(a.x + t * (b.x - a.x), a.y + t * (b.y - a.y)); }

// A place on the seam seen from one side: half a texel in, a quarter of a texel up.
static lx_vec3 beside_seam(const build *b, const border *a, float t)
{
    const lx_vec3 p = lx_mad(lerp3(a->end[0], a->end[1], t), a->inward, 0.5f * b->texel_m);
    return lx_mad(p, lerp3(a->normal[0], a->normal[1], t), 0.25f * b->texel_m);
}

// Part [from, to] of border `a`, which lies on part [other_from, other_to] of border `c`: seams where nothing stands between the two sides.
static lx_result add_seams(build *b, const border *a, float from, float to, const border *c, float other_from, float other_to, lx_error *error)
{
    const float length = fabsf(to - from) * lx_distance(a->end[0], a->end[1]) / b->texel_m;
    const uint32_t pieces = (uint32_t)lx_min(ceilf(length), most_pieces), count = pieces > 0 ? pieces : 1;
    lx_ray rays[most_pieces];
    lx_rgb light[most_pieces];
    for (uint32_t i = 0; i < count; ++i) {
        const float t = ((float)i + 0.5f) / (float)count;
        const lx_vec3 start = beside_seam(b, a, from + t * (to - from)), end = beside_seam(b, c, other_from + t * (other_to - other_from));
        rays[i] = (lx_ray){.origin = start, .direction = lx_sub(end, start), .t_max = 1};
    }
    lx_trace_transmittance(b->bake->tracer, rays, light, count);
    for (uint32_t begin = 0, end; begin < count; begin = end) {
        const bool open = lx_rgb_max(light[begin]) > 0.5f;
        for (end = begin + 1; end < count && (lx_rgb_max(light[end]) > 0.5f) == open;) ++end;
        if (!open) continue;
        if (!lx_array_reserve(&b->seams, &b->seam_capacity, b->seam_count + 1, sizeof *b->seams)) return lx_fail_memory(error, "seams");
        const float t0 = (float)begin / (float)count, t1 = (float)end / (float)count;
        const float a0 = from + t0 * (to - from), a1 = from + t1 * (to - from);
        const float c0 = other_from + t0 * (other_to - other_from), c1 = other_from + t1 * (other_to - other_from);
        b->seams[b->seam_count++] = (lx_seam){{{lerp2(a->on_page[0], a->on_page[1], a0), lerp2(a->on_page[0], a->on_page[1], a1), a->page, a->chart},
                                               {lerp2(c->on_page[0], c->on_page[1], c0), lerp2(c->on_page[0], c->on_page[1], c1), c->page, c->chart}}};
    }
    return LX_OK;
}

static lx_result pair_equal(build *b, lx_error *error)
{
    lx_result result = LX_OK;
    const uint32_t slots = table_size(b->border_count);
    uint32_t *head = lx_malloc_array(slots, sizeof *head);
    if (!head) return lx_fail_memory(error, "seams");
    memset(head, 0xff, slots * sizeof *head);
    for (uint32_t i = 0; i < b->border_count; ++i) {
        border *a = &b->borders[i];
        if (a->vertex[0] == a->vertex[1]) continue;
        const uint32_t low = a->vertex[0] < a->vertex[1] ? a->vertex[0] : a->vertex[1];
        uint32_t *slot = &head[mix(mix(31, low), a->vertex[0] ^ a->vertex[1]) & (slots - 1)];
        for (uint32_t k = *slot; k != no_item; k = b->borders[k].next) {
            border *c = &b->borders[k];
            const bool turned = a->vertex[0] == c->vertex[1] && a->vertex[1] == c->vertex[0];
            if (!turned && !(a->vertex[0] == c->vertex[0] && a->vertex[1] == c->vertex[1])) continue;
            if (!is_continuous(a, c, turned)) continue;
            a->has_partner = c->has_partner = true;
            LX_TRY(add_seams(b, a, 0, 1, c, turned, !turned, error));
        }
        a->next = *slot;
        *slot = i;
    }
cleanup:
    lx_free(head);
    return result;
}

// ---- partial overlap ----------------------------------------------------------------------------------------------------------------------------

// One border in one cell of the grid.
typedef struct entry {
    uint32_t hash, border;
} entry;

static int compare_entries(const void *a, const void *b)
{
    const entry *x = a, *y = b;
    if (x->hash != y->hash) return x->hash < y->hash ? -1 : 1;
    return x->border < y->border ? -1 : x->border > y->border;
}

static int compare_pairs(const void *a, const void *b)
{
    const uint64_t x = *(const uint64_t *)a, y = *(const uint64_t *)b;
    return x < y ? -1 : x > y;
}

static lx_result pair_overlapping(build *b, const border *a, const border *c, lx_error *error)
{
    const lx_vec3 along = lx_sub(a->end[1], a->end[0]);
    const float length = lx_length(along);
    const lx_vec3 unit = lx_scale(along, 1 / length);
    float at[2];
    for (int end = 0; end < 2; ++end) {
        const lx_vec3 from_start = lx_sub(c->end[end], a->end[0]);
        at[end] = lx_dot(from_start, unit);
        if (lx_distance(from_start, lx_scale(unit, at[end])) > b->tolerance) return LX_OK;
    }
    const float low = lx_max(0, lx_min(at[0], at[1])), high = lx_min(length, lx_max(at[0], at[1])), span = at[1] - at[0];
    if (high - low < least_overlap_texels * b->texel_m || !is_continuous(a, c, span < 0)) return LX_OK;
    return add_seams(b, a, low / length, high / length, c, (low - at[0]) / span, (high - at[0]) / span, error);
}

static lx_result pair_rest(build *b, lx_error *error)
{
    enum { most_cells = 1 << 16, most_in_cell = 64 };
    lx_result result = LX_OK;
    entry *entries = NULL;
    uint64_t *pairs = NULL;
    size_t count = 0, capacity = 0, pair_count = 0, pair_capacity = 0;
    const float edge = cell_texels * b->texel_m;
    const lx_vec3 off_round = {0.3719f * edge, 0.2837f * edge, 0.4243f * edge};
    for (uint32_t i = 0; i < b->border_count; ++i) {
        const border *a = &b->borders[i];
        const float length = lx_distance(a->end[0], a->end[1]);
        if (a->has_partner || length < least_overlap_texels * b->texel_m) continue;
        // Steps of half a cell: two borders on one line meet in at least one. Floors and walls lie at round numbers; the cells' faces must not, or
        // rounding would tell the two apart.
        const float steps = lx_min(ceilf(2 * length / edge), most_cells);
        uint32_t last = 0;
        for (float k = 0; k <= steps; ++k) {
            const cell at = cell_at(lx_add(lerp3(a->end[0], a->end[1], k / steps), off_round), edge);
            const uint32_t hash = hash_cell(at.x, at.y, at.z);
            if (k > 0 && hash == last) continue;
            last = hash;
            if (!lx_array_reserve(&entries, &capacity, count + 1, sizeof *entries)) {
                result = lx_fail_memory(error, "seams");
                goto cleanup;
            }
            entries[count++] = (entry){hash, i};
        }
    }
    if (count > 0) qsort(entries, count, sizeof *entries, compare_entries);
    for (size_t begin = 0, end; begin < count; begin = end) {
        for (end = begin + 1; end < count && entries[end].hash == entries[begin].hash;) ++end;
        if (end - begin > most_in_cell) continue; // finer than texels: nothing a lightmap could show
        for (size_t i = begin; i < end; ++i)
            for (size_t k = i + 1; k < end; ++k) {
                if (entries[i].border == entries[k].border) continue;
                if (!lx_array_reserve(&pairs, &pair_capacity, pair_count + 1, sizeof *pairs)) {
                    result = lx_fail_memory(error, "seams");
                    goto cleanup;
                }
                pairs[pair_count++] = (uint64_t)entries[i].border << 32 | entries[k].border;
            }
    }
    if (pair_count > 0) qsort(pairs, pair_count, sizeof *pairs, compare_pairs);
    for (size_t i = 0; i < pair_count; ++i)
        if (i == 0 || pairs[i] != pairs[i - 1])
            LX_TRY(pair_overlapping(b, &b->borders[pairs[i] >> 32], &b->borders[pairs[i] & UINT32_MAX], error));
cleanup:
    lx_free(entries);
    lx_free(pairs);
    return result;
}

lx_result lx_seams_find(const lx_bake *bake, lx_seam **out_seams, size_t *out_count, lx_error *error)
{
    lx_result result = LX_OK;
    const lx_scene *scene = bake->scene;
    const lx_atlas *atlas = bake->atlas;
    build b = {.bake = bake, .texel_m = atlas->texels_per_m > 0 ? 1 / atlas->texels_per_m : 1};
    b.tolerance = weld_texels * b.texel_m;
    b.first_edge = lx_calloc_array((size_t)scene->primitive_count + 1, sizeof *b.first_edge);
    uint32_t *bases = lx_chart_bases(atlas);
    if (!b.first_edge || !bases) {
        result = lx_fail_memory(error, "seams");
        goto cleanup;
    }
    for (uint32_t m = 0; m < scene->mesh_count; ++m) LX_TRY(find_mesh_borders(&b, &scene->meshes[m], error));
    for (uint32_t s = 0; s < scene->surface_count; ++s) {
        const lx_surface *surface = &scene->surfaces[s];
        if (atlas->rects[surface->instance].used && atlas->primitives[surface->primitive].corner_uv)
            LX_TRY(place_borders(&b, s, bases[surface->instance], error));
    }
    LX_TRY(weld(&b, error));
    LX_TRY(pair_equal(&b, error));
    LX_TRY(pair_rest(&b, error));
    *out_seams = b.seams;
    *out_count = b.seam_count;
    b.seams = NULL;
cleanup:
    lx_free(b.edges);
    lx_free(b.first_edge);
    lx_free(b.borders);
    lx_free(b.seams);
    lx_free(bases);
    return result;
}
